"""LS-DYNA d3plot and d3thdt: energies, velocities and masses of the model and its parts, which each state begins with.

A run writes a family: the first file, d3plot, has the head, the geometry and perhaps states; d3plot01, d3plot02 and
so on have states alone, none of which goes on in the next file.  A state is its time, the values of the model and of
its parts, and then nodes and elements, which are most of it and are passed over.  The files of a family are known by
their names, since only the first says what it is; a restart may leave numbers out.
"""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING, Final

import numpy as np

from d2rpick.base.caching import cached_property
from d2rpick.base.errors import FormatError, listing
from d2rpick.base.tuples import NamedTuple
from d2rpick.histories.contact_forces import ContactForce
from d2rpick.histories.content import content_of
from d2rpick.histories.database import DIGITS, Database
from d2rpick.histories.formats.d3plot_head import GLOBALS, Head, read_head
from d2rpick.histories.formats.d3plot_words import END, family_of
from d2rpick.histories.names import number_in_family

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from typing import Any

    from numpy.typing import NDArray

    from d2rpick.histories.content import Content
    from d2rpick.histories.history import Samples
    from d2rpick.histories.names import Selection
    from d2rpick.histories.source import Source

    Rows = NDArray[np.floating[Any]]

# Values of the whole model behind the time of a state.
_MODEL: Final = (
    "kinetic_energy",
    "internal_energy",
    "total_energy",
    "x_velocity",
    "y_velocity",
    "z_velocity",
)
_FIRST_OF_PARTS: Final = 1 + GLOBALS
# Values of the parts, each for all parts together, by how many of a part come before; the velocity has three of each.
_OF_PARTS: Final = {
    "internal_energy": 0,
    "kinetic_energy": 1,
    "mass": 5,
    "hourglass_energy": 6,
}
_VELOCITY: Final = 2
_VELOCITIES: Final = ("x_rbvelocity", "y_rbvelocity", "z_rbvelocity")
_MOMENTA: Final = ("x_momentum", "y_momentum", "z_momentum")
_WALL: Final = "rigid_wall_{}_force"
_TAIL: Final = 1 << 16  # bytes in which the mark at the end of a file is looked for


def recognises(head: bytes) -> bool:
    """Whether a file that begins like this is the first one of a d3plot, or of a d3part; never raises."""
    return family_of(head) in ("d3plot", "d3part")


def open_legs(sources: Sequence[Source], _: Selection) -> list[D3plot]:
    """Open each family, which begins with a file that has a head, as a leg of the run."""
    families: dict[str, dict[int, Source]] = {source.name: {} for source in sources}
    for source in sources:
        first = source.name.rstrip("0123456789")
        number = number_in_family(source.name, first)
        if first in families and number is not None:
            families[first][number] = source
            del families[source.name]
    return [
        D3plot(source, families[source.name])
        for source in sources
        if source.name in families
    ]


class _States(NamedTuple):
    """States of files: ``rows`` (n, values) of their heads; ``ended`` by marks; what to say of what is left out."""

    rows: Rows
    ended: bool = True
    notes: tuple[str, ...] = ()


class D3plot(Database):
    """One family of files, read as a `Database`; parts and the whole model share their times.

    FormatError if the head cannot be read, or states do not lie where it says.
    """

    format = "d3plot"

    def __init__(self, first: Source, others: Mapping[int, Source]) -> None:
        files = [first, *(others[number] for number in sorted(others))]
        self._head = head = read_head(content_of(first.data), first.name)
        self.source = (
            first.name
            if len(files) == 1
            else f"{first.name} and {len(files) - 1} files behind it"
        )
        found = _states_of(files, head)
        self._rows = found.rows
        self.title, self.version, self.parts, self.no_parts = (
            head.title,
            head.version,
            head.parts,
            head.no_parts,
        )
        self.digits = DIGITS[head.form.width]
        walls = [_WALL.format(number) for number in range(1, head.walls + 1)]
        self.channels = (*_MODEL, *walls)
        missing = _missing(first.name, sorted(others))
        self.complete = not missing and found.ended
        self.notes = (*missing, *found.notes)

    @cached_property
    def time(self) -> Samples:
        """Times of all states, shape (n,) [time]."""
        return self._column(0)

    @cached_property
    def part_time(self) -> Samples:
        """The same."""
        return self.time

    def channel(self, name: str) -> Samples:
        """One value of the whole model, or the force of a rigid wall, shape (n,)."""
        if name not in self.channels:
            raise FormatError(
                f"{self.source}: no {name}, there are {listing(self.channels)}; ask for one of these"
            )
        place = self.channels.index(name)
        of_parts = self._head.part_values * len(self.parts) if place >= GLOBALS else 0
        return self._column(1 + place + of_parts)

    @property
    def contact_forces(self) -> tuple[ContactForce, ...]:
        """Forces of the rigid walls; those of contacts are in no d3plot."""
        walls = self.channels[GLOBALS:]
        return tuple(
            ContactForce.of_forces(
                f"rigid wall {number}",
                self.time,
                np.outer(self.channel(name), np.array([1.0, 0.0, 0.0])),
            )
            for number, name in enumerate(walls, start=1)
        )

    def part_channel(self, quantity: str, ids: Sequence[int]) -> Samples:
        """One quantity of some parts, shape (n, len(ids)); their momenta are those of their masses at their velocity.

        Raises
        ------
        FormatError
            If a part is not in the file, or without this quantity.
        """
        if not self.parts:
            raise FormatError(self.no_parts)
        known = {part.id: place for place, part in enumerate(self.parts)}
        if missing := [id_ for id_ in ids if id_ not in known]:
            found = f"{self.source}: no part {listing(missing)}"
            raise FormatError(f"{found}; choose from {listing(list(known))}")
        places = np.array([known[id_] for id_ in ids], np.intp)
        if quantity in _MOMENTA:
            velocity = self.part_channel(_VELOCITIES[_MOMENTA.index(quantity)], ids)
            return velocity * self.part_channel("mass", ids)
        before = (
            _VELOCITY
            if quantity in _VELOCITIES
            else _OF_PARTS.get(quantity, self._head.part_values)
        )
        if before >= self._head.part_values:
            raise FormatError(
                f"{self.source}: no {quantity} of parts in its states; ask for another"
            )
        if quantity in _VELOCITIES:
            places = 3 * places + _VELOCITIES.index(quantity)
        return self._rows[
            :, _FIRST_OF_PARTS + before * len(self.parts) + places
        ].astype(np.float64)

    def _column(self, place: int) -> Samples:
        return self._rows[:, place].astype(np.float64)


def _states_of(files: Sequence[Source], head: Head) -> _States:
    """Read the heads of the states of a family, whose first file has them behind its own head."""
    real, values = head.form.real, 1 + head.globals
    contents, begins = (
        [content_of(file.data) for file in files],
        [head.begin] + [0] * (len(files) - 1),
    )
    counts = [
        max(0, len(one) - begin) // head.state
        for one, begin in zip(contents, begins, strict=True)
    ]
    behind = np.cumsum(counts).tolist()
    heads = np.empty((behind[-1], values * real.itemsize), np.uint8)
    rests = [
        content.fill_rows(heads[end - count : end], begin, head.state, real.itemsize)
        for content, begin, end, count in zip(
            contents, begins, behind, counts, strict=True
        )
    ]
    for content in contents:
        content.check()
    rows = heads.view(real)
    first_is_empty = not counts[0] and _is_blank(
        contents[0], begins[0], len(contents[0]) - begins[0]
    )
    if (
        first_is_empty
        and set(rests[1:]) == {np.array(END, real).tobytes()}
        and _ascend(rows[:, 0], behind)
    ):
        return _States(rows)  # as mostly
    pieces = zip(files, begins, np.split(rows, behind[:-1]), rests, strict=True)
    found = [
        _whole_states(file, head, begin, piece, rest)
        for file, begin, piece, rest in pieces
    ]
    notes = tuple(note for states in found for note in states.notes)
    return _States(
        np.concatenate([states.rows for states in found]),
        all(states.ended for states in found),
        notes,
    )


def _ascend(time: NDArray[np.floating[Any]], behind: Sequence[int]) -> bool:
    """Whether times are numbers that ascend in each of several files, which end ``behind`` so many states."""
    with np.errstate(invalid="ignore"):
        ascends = np.diff(time) > 0
    ascends[[end - 1 for end in behind if 0 < end < time.size]] = (
        True  # a restart may write a state again
    )
    return bool(ascends.all() and np.isfinite(time).all() and (time != END).all())


def _whole_states(
    file: Source, head: Head, begin: int, rows: Rows, rest: bytes
) -> _States:
    """Give the states of one file up to its end, which the solver marks."""
    content, name = content_of(file.data), file.name
    ends = np.flatnonzero(rows[:, 0] == END)
    if ends.size:
        rows = rows[: ends[0]]
    end = begin + head.state * len(rows)
    while len(rows) and _is_blank(content, end - head.state, head.state):
        rows, end = rows[:-1], end - head.state
    ended = bool(ends.size) or rest == np.array(END, head.form.real).tobytes()
    if begin and not len(rows) and _is_blank(content, begin, len(content) - begin):
        ended = True  # states begin in the next file
    if not ended:
        _refuse_other_states(content, name, head, begin)
    time = rows[:, 0]
    with np.errstate(invalid="ignore"):
        wrong = np.flatnonzero(
            ~(np.diff(time, prepend=-np.inf) > 0) | ~np.isfinite(time)
        )
    if wrong.size:
        where = begin + head.state * int(wrong[0])
        found = f"{name}: a state was expected at byte {where}, with a time above that of the one before"
        raise FormatError(
            f"{found}, not {time[wrong[0]]:g}; the file is damaged, copy it again"
        )
    return _States(rows, ended, () if ended else (_cut(content, name, end, rows),))


def _cut(content: Content, name: str, end: int, rows: Rows) -> str:
    """Say that a file does not end as the solver ends it."""
    if end < len(content):
        return f"{name}: the file ends within state {len(rows) + 1}, which was left out; is the run still writing?"
    return (
        f"{name}: the file ends without the mark of its end; is the run still writing?"
    )


def _is_blank(content: Content, begin: int, size: int) -> bool:
    """Whether nothing but zeros stands there, with which a solver fills a file up: nodes of a state are not all 0."""
    return not content[begin : begin + min(size, _TAIL)].strip(b"\0")


def _refuse_other_states(content: Content, name: str, head: Head, begin: int) -> None:
    """FormatError where the mark at the end of a file stands within a state: then states are longer or shorter."""
    first = max(begin, len(content) - _TAIL)
    tail, mark = content[first : len(content)], np.array(END, head.form.real).tobytes()
    at = tail.rfind(mark)
    if at >= 0 and not tail[at + len(mark) :].strip(b"\0"):
        found = (
            f"{name}: its states are {first + at - begin} bytes together, one of "
            f"{head.state} bytes each by the head"
        )
        cure = "that layout is not known; name the glstat, matsum or binout of the run"
        raise FormatError(f"{found}; {cure}")


def _missing(first: str, numbers: Sequence[int]) -> tuple[str, ...]:
    """Say which numbers of a family are left out."""
    gaps = [
        (low + 1, high - 1) for low, high in pairwise([0, *numbers]) if high > low + 1
    ]
    names = [
        f"{low:02d}" if low == high else f"{low:02d} to {high:02d}"
        for low, high in gaps
    ]
    if not names:
        return ()
    return (
        f"{first}: of the files behind it {listing(names, most=5)} are not there; are they missing?",
    )
