"""A branch of LS-DYNA's binout: its states in all files of a family, grouped by file and layout.

A column is gathered with a few array operations, however many states there are.  Whatever does not fit - a variable or
a part that one state lacks, a count that changes - is refused with the state named, never shifted.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from d2rpick.base.caching import cached_property
from d2rpick.base.errors import FormatError, listing
from d2rpick.histories.database import Database
from d2rpick.histories.names import plain_text

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from typing import Any

    from numpy.typing import NDArray

    from d2rpick.histories.formats.lsda import DirectoryLayout, Lsda, Variable
    from d2rpick.histories.history import Samples

    Indices = NDArray[np.int64]

# Values gathered at a time: keeps the index arrays small beside the answer.
_CHUNK: Final = 1 << 17


@dataclass(frozen=True)
class Group:
    """States of one file and one layout: their rows in the columns, and the bytes where they start."""

    file: Lsda
    layout: DirectoryLayout
    rows: Indices
    starts: Indices

    def chunks(self, width: int) -> Iterator[Group]:
        """Divide into pieces of so few states that ``width`` values of each fit into a chunk."""
        length = max(1, _CHUNK // max(1, width))
        for begin in range(0, self.rows.size, length):
            part = slice(begin, begin + length)
            yield Group(self.file, self.layout, self.rows[part], self.starts[part])

    def values(self, variable: Variable, places: Indices) -> NDArray[Any]:
        """Values of a variable at ``places`` of its list, shape (states, places); floating-point ones as doubles."""
        positions = (
            self.starts[:, None] + variable.offset + variable.dtype.itemsize * places
        )
        found = self.file.read(positions, variable.dtype)
        with np.errstate(invalid="ignore"):  # a NaN of any kind is refused, or not used
            return found.astype(np.float64) if variable.dtype.kind == "f" else found


def _start(file: Lsda, branch: str) -> float:
    """Time of the first state of a branch in a file; before all others where it has none."""
    _, start, layout = file.visits[branch][:3]
    variable = file.layouts[layout].variables.get("time")
    if variable is None or not variable.count:
        return -np.inf
    return float(file.read(np.array([start + variable.offset]), variable.dtype)[0])


def _is_unfinished(file: Lsda, branch: str) -> bool:
    """Whether the file ends in a state of this branch that differs from the one before."""
    layouts = file.visits[branch][2::3][-2:]
    return file.unfinished == branch and len({*layouts}) > 1


def _damages(
    numbers: Indices, layouts: Sequence[DirectoryLayout], where: str
) -> Iterator[str]:
    """Say what shows, in the states of one file, that records are lost or out of place."""
    steps = np.diff(numbers)
    if (steps > 1).any():
        hole = int(np.argmax(steps > 1))
        yield f"{where} goes from state {numbers[hole]} to {numbers[hole + 1]}"
    if doubled := sorted(name for layout in layouts for name in layout.doubled):
        yield f"{where} has {doubled[0]} twice in one state"
    if (steps < 1).any() and len(
        {frozenset(layout.variables) for layout in layouts}
    ) > 1:
        yield f"{where} begins a new leg whose states hold other variables"


def _groups(
    layouts: Sequence[tuple[Lsda, DirectoryLayout]], kinds: Indices, starts: Indices
) -> Iterator[Group]:
    """States by layout; ``kinds`` says which of ``layouts`` each one has."""
    order = np.argsort(kinds, kind="stable")
    cuts = np.flatnonzero(np.diff(kinds[order])) + 1
    for rows in np.split(order, cuts) if order.size else ():
        file, layout = layouts[kinds[rows[0]]]
        yield Group(file, layout, rows, starts[rows])


class Branch(Database):
    """The states of one branch in all files of a family; false when no file knows the branch.

    A solver numbers its states one by one.  Where a file begins higher than the last one ended, a member of
    the family is missing; a number that comes again begins a newer leg, which writes the same variables, be it
    the same states again or the next ones: that shows in their times.  A number left out inside a file, a name
    twice in a state and a leg with other variables are the marks of records lost or out of place: what then seems
    to be one state may be made of two.

    Parameters
    ----------
    name : str
    files : sequence of Lsda
        The family, in its order.
    by_part : bool
        Whether variables are lists with one value per part.

    Attributes
    ----------
    damage : str
        Where records are lost or out of place, so that no state can be trusted; empty if nowhere.
    """

    def __init__(self, name: str, files: Sequence[Lsda], *, by_part: bool) -> None:
        self.name, self._by_part, self._files = name, by_part, files
        visited = sorted(
            (file for file in files if file.visits[name]),
            key=lambda file: _start(file, name),
        )
        self._unfinished = [
            file.source for file in visited if _is_unfinished(file, name)
        ]  # less their last state
        damages = [
            f"{file.source}: {name} has {file.odd[name][0]!r}, which is not a state"
            for file in files
            if file.odd[name]
        ]
        numbers, starts, kinds = np.empty((3, 0), dtype=np.int64)
        layouts: list[tuple[Lsda, DirectoryLayout]] = []
        for file in visited:
            states = file.states(name)
            here, begin, used = states[
                : len(states) - (file.source in self._unfinished)
            ].T
            damages += _damages(
                here,
                [file.layouts[kind] for kind in {*used.tolist()}],
                f"{file.source}: {name}",
            )
            numbers, starts = np.append(numbers, here), np.append(starts, begin)
            kinds = np.append(kinds, used + len(layouts))
            layouts += [(file, layout) for layout in file.layouts]
        self.damage = damages[-1] if damages else ""
        self._numbers = numbers
        self._groups = tuple(_groups(layouts, kinds, starts))
        self._variables = [group.layout.variables for group in self._groups]
        holes = np.flatnonzero(np.diff(numbers) > 1)
        self._missing = tuple(
            f"{numbers[i] + 1} to {numbers[i + 1] - 1}" for i in holes
        )
        self.source = (
            f"{', '.join(file.source for file in files if name in file.names)}: {name}"
        )
        self.complete = not (self._missing or self._unfinished or self.damage)
        self.notes = self._remarks()

    def __bool__(self) -> bool:
        return any(self.name.split("/")[0] in file.names for file in self._files)

    def _remarks(self) -> tuple[str, ...]:
        """What was left out, what is missing, what only some states hold."""
        notes = [
            f"{name}: the last state of {self.name} is not whole and was left out"
            for name in self._unfinished
        ]
        if self.damage:
            notes.append(f"{self.damage}; records are lost or out of place")
        first = int(self._numbers[0]) if self._numbers.size else 1
        if first != 1:
            notes.append(
                f"{self.source} begins with state {first}, not 1; is a file of the family missing or damaged?"
            )
        if self._missing:
            holes = listing(self._missing, most=3)
            notes.append(
                f"{self.source} lacks the states {holes}; is a file of the family missing?"
            )
        every = set().union(*self._variables)
        common = {
            name for name in every if all(name in held for held in self._variables)
        }
        if late := listing(sorted(every - common)):
            notes.append(f"{self.source} has {late} in some states only")
        kinds = {
            name: {held[name].dtype.kind for held in self._variables} for name in common
        }
        if changing := listing(sorted(name for name in common if len(kinds[name]) > 1)):
            notes.append(
                f"{self.source} has {changing} of another type in some states: damaged there, and left out"
            )
        if self and not self._numbers.size:
            notes.append(f"{self.source} holds no state yet")
        return tuple(notes)

    @property
    def scalars(self) -> tuple[str, ...]:
        """Floating-point variables that all states hold with one value, in the order of the file."""
        held = self._variables
        return tuple(
            name
            for name in (held[0] if held else ())
            if all(_is_scalar(one.get(name)) for one in held)
        )

    @property
    def time_width(self) -> int:
        """Bytes per number of the times, the shortest of all states; times of another type are refused when read."""
        times = (held["time"].dtype for held in self._variables if "time" in held)
        return min((one.itemsize for one in times if one.kind == "f"), default=8)

    @cached_property
    def legend(self) -> dict[int, str]:
        """Titles of the parts by id."""
        titles: dict[int, str] = {}
        for file, start, layout in self._metadata:
            ids, legend = (
                _integers(file, start, layout, "legend_ids"),
                layout.variables.get("legend"),
            )
            if legend is None or not ids.size or legend.count % ids.size:
                continue  # without a whole length per title nobody knows where one ends
            raw, width = file.raw(start, legend), legend.count // ids.size
            titles.update(
                (id_, plain_text(raw[i * width : (i + 1) * width]))
                for i, id_ in enumerate(ids.tolist())
            )
        return titles

    @cached_property
    def part_ids(self) -> tuple[int, ...]:
        """Ids of all parts that any state holds, in the order of the lists."""
        known: dict[int, None] = {}
        for group in self._groups:
            for part in group.chunks(max(self._list_lengths(group), default=1)):
                listed = self.ids_of(part)
                changed = np.append(True, (np.diff(listed, axis=0) != 0).any(axis=1))
                known.update(dict.fromkeys(listed[changed].ravel().tolist()))
        return tuple(known)

    def text(self, name: str) -> str:
        """Text from the metadata; empty if it is not there."""
        for file, start, layout in self._metadata:
            if name in layout.variables:
                return plain_text(file.raw(start, layout.variables[name]))
        return ""

    @cached_property
    def time(self) -> Samples:
        """Times of the states, shape (n,) [time]."""
        return self.channel("time")

    def channel(self, name: str) -> Samples:
        """One variable of one value per state, shape (n,)."""
        column = np.empty(self._numbers.size)
        for group, variable in self.checked(name):
            if variable.count != 1:
                raise self.refused(
                    group,
                    f"one {name} was expected, not {variable.count}; ask for another",
                )
            for part in group.chunks(1):
                column[part.rows] = part.values(
                    variable, np.zeros((1, 1), dtype=np.int64)
                )[:, 0]
        return column

    def part_channel(self, quantity: str, ids: Sequence[int]) -> Samples:
        """One variable of some parts, shape (n, len(ids))."""
        columns = np.empty((self._numbers.size, len(ids)))
        for group, variable in self.checked(quantity):
            for part in group.chunks(max(variable.count, len(ids))):
                listed = self.ids_of(part)
                if listed.shape[1] != variable.count:
                    counts = f"{variable.count} values of {quantity} for {listed.shape[1]} parts"
                    raise self.refused(part, f"{counts}; they cannot be told apart")
                places = [self._places(part, listed, id_) for id_ in ids]
                columns[part.rows] = (
                    part.values(variable, np.stack(places, axis=1)) if places else 0.0
                )
        return columns

    def checked(self, name: str) -> Iterator[tuple[Group, Variable]]:
        """Each group with its variable of this name.

        A count that fits neither the parts nor the other states is the mark of records of two states run into
        each other: then no value of the state can be trusted.
        """
        for group in self._groups:
            variables = group.layout.variables
            if name not in variables:
                raise self.refused(
                    group,
                    f"no {name}, only {listing(list(variables), most=40)}; ask for one of these",
                )
            if variables[name].dtype.kind != "f":
                raise self.refused(
                    group,
                    f"{name} is stored as {variables[name].dtype}, not as floating point",
                )
            for other, variable in variables.items():
                if variable.count not in (fit := self._fitting(group, other)):
                    counts = f"{variable.count} values of {other} where {listing(sorted(fit))} would fit"
                    raise self.refused(group, f"{counts}; the file is damaged there")
            yield group, variables[name]

    def _fitting(self, group: Group, name: str) -> set[int]:
        """Possible counts of a variable: one per state or per part, or what it is in the other states."""
        if self._by_part:
            return {1, *self._list_lengths(group)}
        return {self._variables[0].get(name, group.layout.variables[name]).count}

    def _list_lengths(self, group: Group) -> set[int]:
        own = group.layout.variables.get("ids")
        return {own.count} if own else {ids.size for _, _, ids in self._id_lists}

    def refused(self, group: Group, why: str, row: int = 0) -> FormatError:
        """Say why a value of a state is not given."""
        return FormatError(
            f"{self.source} state {self._numbers[group.rows[row]]}: {why}"
        )

    @cached_property
    def _metadata(self) -> list[tuple[Lsda, int, DirectoryLayout]]:
        return [
            (file, start, file.layouts[layout])
            for file in self._files
            for start, layout in file.metadata[self.name]
        ]

    @cached_property
    def _id_lists(self) -> list[tuple[int, int, Indices]]:
        """Each list of part ids in the metadata: number of the file, byte, ids."""
        lists = (
            (file, at, _integers(file, at, layout, "ids"))
            for file, at, layout in self._metadata
        )
        return [
            (self._files.index(file), at, ids) for file, at, ids in lists if ids.size
        ]

    def ids_of(self, group: Group) -> Indices:
        """Part ids of a group's states, shape (states, parts); (1, parts) if they are the same for all."""
        own = group.layout.variables.get("ids")
        if own and own.dtype.kind in "iu":
            return group.values(own, np.arange(own.count)[None, :]).astype(np.int64)
        if not self._id_lists:
            raise FormatError(
                f"{self.source} has no part ids in its metadata; the values cannot be assigned to parts"
            )
        index = self._files.index(group.file)
        before = sum(1 for file, _, _ in self._id_lists if file < index)
        here = np.array(
            [start for file, start, _ in self._id_lists if file == index],
            dtype=np.int64,
        )
        # The last list before a state is in force; a rank's file may bring its list behind the first states.
        in_force = np.maximum(before + np.searchsorted(here, group.starts) - 1, 0)
        lists = {
            int(i): self._id_lists[i][2] for i in np.flatnonzero(np.bincount(in_force))
        }
        if len({entry.size for entry in lists.values()}) > 1:
            raise self.refused(
                group,
                "the number of parts changes here or later, that of the values does not",
            )
        if len(lists) == 1:
            ids: Indices = next(iter(lists.values()))
            return ids[None, :]
        return np.stack([lists[i] for i in in_force.tolist()])

    def _places(self, group: Group, listed: Indices, id_: int) -> Indices:
        """Where in its lists each state has a part, shape (states,) or (1,)."""
        found = listed == id_
        times = found.sum(axis=1)
        if (times != 1).any():
            row = int(np.argmax(times != 1))
            hint = (
                "it is there in some states only"
                if id_ in self.part_ids
                else f"there are {listing(self.part_ids)}"
            )
            raise self.refused(
                group, f"part {id_} is listed {times[row]} times, not once; {hint}", row
            )
        return np.asarray(found.argmax(axis=1))


def _is_scalar(variable: Variable | None) -> bool:
    return variable is not None and variable.count == 1 and variable.dtype.kind == "f"


def _integers(file: Lsda, start: int, layout: DirectoryLayout, name: str) -> Indices:
    """List of integers from a directory; empty if there is none of this name."""
    variable = layout.variables.get(name)
    if variable is None or variable.dtype.kind not in "iu":
        return np.empty(0, dtype=np.int64)
    places = (
        start + variable.offset + variable.dtype.itemsize * np.arange(variable.count)
    )
    return file.read(places, variable.dtype).astype(np.int64)
