"""From the files of a run to what they hold: the reader of each is found by its content."""

from __future__ import annotations

import re
from functools import partial
from importlib import import_module
from itertools import combinations
from typing import TYPE_CHECKING, Final, Protocol, cast

import numpy as np

from d2rpick.base.errors import FormatError
from d2rpick.histories import force_listings
from d2rpick.histories.content import Scattered
from d2rpick.histories.database import Database, Legs
from d2rpick.histories.formats import FAMILIES, READERS
from d2rpick.histories.names import Selection
from d2rpick.histories.run import Run
from d2rpick.histories.source import Source, open_files

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from d2rpick.histories.contact_forces import ContactForce
    from d2rpick.histories.database import Indices
    from d2rpick.histories.history import Samples
    from d2rpick.histories.surroundings import Surroundings


__all__ = ["Reader", "Run", "Selection", "Source", "open_run", "open_sources", "reader"]

# Enough of a file for its head and more than one state of the longest blocks.
_HEAD = 8192
_DEFAULT = Selection()
# No legend of an ASCII database has more bytes.
_LONGEST_LEGEND: Final = 1 << 24
_DIGITS: Final = (
    "0123456789"  # of the number of a file behind the first one of its family
)


class Reader(Protocol):
    """What a module has to offer to be a reader; that of a table has ``write``, too."""

    def recognises(self, head: bytes) -> bool:
        """Whether a file that begins like this is of the reader's format; never raises."""

    def open_legs(
        self, sources: Sequence[Source], selection: Selection
    ) -> Sequence[Database]:
        """Open files of this format as the legs of one run; FormatError when one is none."""


def reader(kind: str) -> Reader:
    """Import the reader of a format, one of `READERS`."""
    return cast(
        "Reader", import_module(f"d2rpick.histories.formats.{READERS[kind].module}")
    )


def open_run(
    names: Sequence[str], selection: Selection = _DEFAULT, input_format: str = "auto"
) -> Run:
    """Open the files of one run: of one format as its legs, of different formats as companions.

    Parameters
    ----------
    names : sequence of str
        Files, folders, globs, or ``-`` for standard input.
    selection : Selection
        What tables need to know to be read at all: their time and energy columns.
    input_format : str
        A key of `READERS` for all files, or ``auto``: decided by the content, never by the name.

    Raises
    ------
    FormatError
        If a file cannot be read as an energy history, companions have no time in common, or one of several files was
        replaced while they were opened.
    """
    return open_sources(open_files(names), selection, input_format)


def open_sources(
    sources: Sequence[Source],
    selection: Selection = _DEFAULT,
    input_format: str = "auto",
) -> Run:
    """Open the files of one run whose bytes are at hand; arguments and errors as of `open_run`."""
    with_forces = [
        one for one in sources if input_format == "auto" and _holds_forces(one)
    ]
    sources = [one for one in sources if one not in with_forces]
    if not sources and with_forces:
        found = f"{with_forces[0].name}: an rcforc or rwforc of LS-DYNA, which holds forces and no internal energy"
        raise FormatError(
            f"{found}; name the glstat, matsum or binout of the run with it"
        )
    kinds, left_out = _sort_by_format(sources, input_format)
    ordered = [kind for kind in READERS if kind in kinds]
    _refuse_time_of_solver(ordered, selection.time)
    opened, notes = _opened(kinds, ordered, selection)
    ordered = [kind for kind in ordered if kind in opened]
    forces, unread = _forces_of(with_forces)
    read = [
        *(source for kind in ordered for source in kinds[kind]),
        *([] if unread else with_forces),
    ]
    used = {source.name for source in read}
    for legs in opened.values():
        check_legs(legs)
    ordered = _with_forces_last(opened, ordered)
    databases = tuple(
        Legs(
            opened[kind],
            cut=[one.name for one in kinds[kind] if one.cut],
            named=selection.channels,
            notes=left_out if kind == ordered[0] else (),
        )
        for kind in ordered
    )
    _refuse_unknown_channels(databases, selection)
    check_companions(databases)
    behind = {name for kind in FAMILIES for name in _behind_firsts(kinds.get(kind, ()))}
    every = (*sources, *with_forces)
    named = tuple(
        source.name
        for source in every
        if source.name not in behind and source.name in used
    )
    files = tuple(source for source in every if source.name in used)
    reopen = partial(_reopen, files, selection, input_format)
    return Run(
        named, databases, files, notes=(*notes, *unread), forces=forces, reopen=reopen
    )


def _reopen(
    sources: Sequence[Source],
    selection: Selection,
    input_format: str,
    surroundings: Surroundings,
) -> Run:
    return open_sources(sources, selection, input_format).within(surroundings)


def _sort_by_format(
    sources: Sequence[Source], input_format: str
) -> tuple[dict[str, list[Source]], list[str]]:
    """Sort the files of a run by their formats, and say which of those that a pattern matched are left out.

    Of a pattern the histories are used, as of a folder: a table only if there is no database of a solver.  Files
    behind the first one of a family have its format.

    Raises
    ------
    FormatError
        If a file that was named is no history, or none of a pattern is.
    """
    formats: dict[str, str] = {}
    foreign: list[tuple[Source, FormatError]] = []
    for source in sorted(sources, key=lambda one: one.name[-2:].isdigit()):
        first = formats.get(source.name.rstrip(_DIGITS))
        try:
            known = first if first in FAMILIES else None
            formats[source.name] = known or (
                input_format if input_format != "auto" else _format(source)
            )
        except FormatError as error:
            if not source.by_pattern:
                raise
            foreign.append((source, error))
    kinds: dict[str, list[Source]] = {}
    for source in sources:
        if source.name in formats:
            kinds.setdefault(formats[source.name], []).append(source)
    if foreign and not kinds:
        raise foreign[0][1]
    notes = [_left_out(source, str(error)) for source, error in foreign]
    if input_format == "auto" and any(READERS[kind].solver for kind in kinds):
        tables = [source for source in kinds.get("csv", []) if source.by_pattern]
        notes += [
            f"{source.name} was left out: a table beside databases of the solver; name it to use it"
            for source in tables
        ]
        named = [source for source in kinds.pop("csv", []) if source not in tables]
        kinds |= {"csv": named} if named else {}
    return kinds, notes


def _left_out(source: Source, refusal: str) -> str:
    reason = (
        refusal.removeprefix(f"{source.name}: ")
        .partition(";")[0]
        .removesuffix(", an energy history was expected")
    )
    return f"{source.name} was left out: {reason}"


def _with_forces_last(
    opened: Mapping[str, Sequence[Database]], ordered: Sequence[str]
) -> list[str]:
    """Give the formats with those last that hold forces alone; FormatError where all do."""
    alone = {kind: all(leg.only_forces for leg in opened[kind]) for kind in ordered}
    if all(alone.values()):
        opened[ordered[0]][0].branch("glstat")  # knows best what is missing
    return sorted(ordered, key=alone.__getitem__)


def _holds_forces(source: Source) -> bool:
    """Whether a file is a listing of forces, as none of a family is of which little is read."""
    return not isinstance(source.data, Scattered) and force_listings.recognises(
        source.data[:_HEAD]
    )


def _forces_of(
    sources: Sequence[Source],
) -> tuple[tuple[ContactForce, ...], tuple[str, ...]]:
    """Read the forces of files that hold nothing else, or say why they cannot be: the run is read without them."""
    try:
        return force_listings.forces_of(sources), ()
    except FormatError as error:
        return (), (f"{error}; it was not used",)


def _behind_firsts(sources: Sequence[Source]) -> set[str]:
    """Names of the files that are behind the first one of a family: this one stands for all."""
    names = {source.name for source in sources}
    return {
        name for name in names if name[-1:].isdigit() and name.rstrip(_DIGITS) in names
    }


def _opened(
    kinds: Mapping[str, list[Source]], ordered: Sequence[str], selection: Selection
) -> tuple[dict[str, Sequence[Database]], tuple[str, ...]]:
    """Open the files by their formats, and say what was not used.

    Families of files lie beside everything that LS-DYNA writes: they count where the others leave something out, and
    where others are there, those that cannot be read stop nothing.
    """
    opened: dict[str, Sequence[Database]] = {}
    notes = []
    for kind in ordered:
        if kind in FAMILIES and _hold_all(
            [leg for legs in opened.values() for leg in legs]
        ):
            continue
        try:
            opened[kind] = reader(kind).open_legs(kinds[kind], selection)
        except FormatError as error:
            if kind not in FAMILIES or len(ordered) == 1:
                raise
            notes.append(f"{error}; it was not used")
    if not opened:
        raise FormatError(notes[0].removesuffix("; it was not used"))
    return opened, tuple(notes)


def _hold_all(legs: Sequence[Database]) -> bool:
    """Whether databases have histories of the whole model and of its parts."""
    return any(leg.channels for leg in legs) and any(leg.parts for leg in legs)


def _refuse_unknown_channels(databases: Sequence[Legs], selection: Selection) -> None:
    """FormatError, with what there is, where a channel that is named for a quantity is in none of the databases."""
    for quantity, name in selection.channels:
        if not any(quantity in database.quantities for database in databases):
            databases[0].find(name)


def _refuse_time_of_solver(kinds: Sequence[str], time: str | None) -> None:
    """Refuse ``--time`` where it would be passed over: solvers have one time and call it so."""
    if (
        time is not None
        and time.strip().casefold() != "time"
        and all(READERS[kind].solver for kind in kinds)
    ):
        raise FormatError(
            f"no time {time!r} in {' and '.join(kinds)}, the time is 'time'; leave `time` out"
        )


def _format(source: Source) -> str:
    """Return the format of a file: a signature decides first, a text is a table only if it is nothing else."""
    head = _head_of(source)
    is_binary = b"\0" in head
    if is_binary:
        _refuse_foreign(source.name, head)
    for kind, listed in READERS.items():
        if kind == "csv" and not is_binary:
            _refuse_foreign(source.name, head)
        if re.search(listed.hint, head, re.DOTALL) and reader(kind).recognises(head):
            return kind
    if re.search(r"(^|[/\\.])d3(plot|part|thdt)\d+$", source.name):
        first = source.name.rstrip(_DIGITS)
        found = f"{source.name}: the first file of its family says what it holds"
        raise FormatError(
            f"{found}; name {first}, with which all files behind it are read"
        )
    if re.search(r"(^|[/\\.])d3(plot|part|dump|thdt)[^/\\]*$", source.name):
        what = "this is a file of LS-DYNA's d3 family, which holds no energies that are read"
        raise FormatError(
            f"{source.name}: {what}; name the glstat, matsum, d3plot or binout of the run"
        )
    found = f"{source.name}: binary data of no known format, one of {', '.join(READERS)} was expected"
    raise FormatError(f"{found}; export the energy history as text")


def _refuse_foreign(name: str, head: bytes) -> None:
    from d2rpick.histories.foreign import (
        refuse_foreign,
    )  # not above: the databases of solvers do without

    refuse_foreign(name, head)


def _head_of(source: Source) -> bytes:
    """Return the beginning of a file, with some of what comes after the legend of an ASCII database of LS-DYNA."""
    head = source.data[:_HEAD]
    if b"{BEGIN LEGEND}" in head and b"{END LEGEND}" not in head:
        end = source.data[:_LONGEST_LEGEND].find(b"{END LEGEND}")
        if end >= 0:
            head = source.data[: end + _HEAD]
    return head


# Energies of two legs at a time that both have are the same within this share of the largest, else the runs differ.
_SAME = 0.01
# Parts that are compared.
_COMPARED = 50


def check_companions(databases: Sequence[Legs]) -> None:
    """Refuse databases that have no time in common."""
    for one, other in combinations(databases, 2):
        if (
            one.span
            and other.span
            and (one.span[0] > other.span[1] or other.span[0] > one.span[1])
        ):
            raise FormatError(
                f"{one.source} and {other.source} have no time in common, files of one run were expected"
            )


def check_legs(legs: Sequence[Database]) -> None:
    """Refuse files of one format that are not of one run.

    All legs of a run hold the same quantities.  A restart repeats the state it begins with.  Files that begin at the
    same time are copies, or of different runs: then all states that they share are compared.
    """
    for one, other in combinations(legs, 2):
        here, there = _held(one), _held(other)
        if here and there and not here & there:
            found = f"{one.source} and {other.source} have neither a column nor a part in common"
            raise FormatError(
                f"{found}, legs of one run were expected; give the files of one run"
            )
        for times, columns in ((_own_times, _energies), (_part_times, _part_energies)):
            try:
                shared = _shared(times(one), times(other))
                values = (
                    [
                        columns(leg, at)
                        for leg, at in zip((one, other), shared, strict=True)
                    ]
                    if shared
                    else []
                )
            except FormatError:  # said when it is read
                continue
            if values and not _alike(*values):
                found = f"{one.source} and {other.source} have different energies at the same times"
                raise FormatError(
                    f"{found}, legs of one run were expected; give the files of one run"
                )


def _held(leg: Database) -> set[str | int]:
    """Columns and parts of a leg."""
    return {*leg.channels, *(part.id for part in leg.parts)}


def _own_times(leg: Database) -> Samples:
    return leg.time if leg.channels else np.empty(0)


def _part_times(leg: Database) -> Samples:
    return leg.part_time if leg.parts else np.empty(0)


def _energies(leg: Database, states: Indices) -> Samples:
    name = leg.energy_channel
    return leg.channel(name)[states] if name else np.empty((states.size, 0))


def _part_energies(leg: Database, states: Indices) -> Samples:
    ids = [part.id for part in leg.parts][:_COMPARED]
    return leg.part_channel("internal_energy", ids)[states]


def _shared(one: Samples, other: Samples) -> tuple[Indices, Indices] | None:
    """States at the same times: all where both begin alike, else the first of the later one; None without any."""
    _, here, there = np.intersect1d(one, other, return_indices=True)
    if not here.size:
        return None
    if here[0] == there[0] == 0:
        return here, there
    begins = there == 0 if other[0] > one[0] else here == 0
    return (here[begins], there[begins]) if begins.any() else None


def _alike(one: Samples, other: Samples) -> bool:
    """Whether energies are the same up to what a restart on other processors changes; NaN is none."""
    if one.shape != other.shape:
        return True
    known = np.isfinite(one) & np.isfinite(other)
    largest = np.maximum(np.abs(one), np.abs(other)).max(initial=0.0, where=known)
    return bool(np.all(np.abs(one - other)[known] <= _SAME * largest))
