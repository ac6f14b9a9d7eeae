"""Open a run: find the reader of each file by the file content."""

from __future__ import annotations

import re
from functools import partial
from importlib import import_module
from itertools import combinations
from typing import TYPE_CHECKING, Final, Protocol, cast

import numpy as np

from d2rpick.base.errors import DamageError, FormatError, list_names
from d2rpick.histories.content import Scattered
from d2rpick.histories.database import Database, Legs
from d2rpick.histories.formats import FAMILIES, READERS
from d2rpick.histories.names import Selection
from d2rpick.histories.run import OpenedRun
from d2rpick.histories.source import (
    Source,
    find_unread_legs,
    list_tables_of_folder,
    list_unread_databases,
    open_files,
)

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from d2rpick.histories.contact_forces import ContactForce
    from d2rpick.histories.database import Indices
    from d2rpick.histories.history import Samples
    from d2rpick.histories.surroundings import Surroundings


__all__ = [
    "OpenedRun",
    "Reader",
    "Selection",
    "Source",
    "load_reader",
    "open_run",
    "open_sources",
]

# Number of bytes that contain the header of a file and more than one state, even if its blocks are long.
_HEAD = 8192
_DEFAULT = Selection()
# Largest length of the legend in an ASCII database [bytes].
_LONGEST_LEGEND: Final = 1 << 24
# Largest number of unused tables that a note names.
_MOST_TABLES: Final = 3
# Each force listing contains one of these words, in upper or lower case.
_WORDS_OF_FORCES: Final = (b"slave", b"master", b"surf", b"wall#")
# Words that LS-DYNA prints above the states in a nodout.
_NODOUT: Final = b"n o d a l   p r i n t   o u t"
# Characters at the end of the name of a later file in a family.
_DIGITS: Final = "0123456789"

# At a common time, energies of two restart segments differ by at most this fraction of the largest energy [-].
_SAME = 0.01
# Number of parts whose energies are compared to recognise restart segments of different runs.
_COMPARED = 50


class Reader(Protocol):
    """The functions that each reader module defines. The module of a table format also defines ``write``."""

    def recognises(self, head: bytes) -> bool:
        """Return True if a file with these first bytes has the format of the reader. This function never raises."""

    def open_legs(
        self, sources: Sequence[Source], selection: Selection
    ) -> Sequence[Database]:
        """Open files of this format as the restart segments of one run; raise FormatError for any other format."""


def load_reader(kind: str) -> Reader:
    """Import the reader of a format, given its key in `READERS`."""
    return cast(
        "Reader", import_module(f"d2rpick.histories.formats.{READERS[kind].module}")
    )


def open_run(
    names: Sequence[str], selection: Selection = _DEFAULT, input_format: str = "auto"
) -> OpenedRun:
    """Open the files of one run: files of the same format are its restart segments, and all others are companion files.

    Parameters
    ----------
    names : sequence of str
        Files, folders, globs, or ``-`` for standard input.
    selection : Selection
        Selection that contains the time and energy columns, which are needed to read a table.
    input_format : str
        A key of `READERS` for all files, or ``auto`` to detect the format from the content (never from the name).

    Raises
    ------
    FormatError
        If a file cannot be read as an energy history, if companions have no time in common, or if one of several files
        was replaced while they were opened.
    """
    sources = open_files(names)
    files = [source.name for source in sources]
    notes = (
        *_note_unused_tables(names),
        *_note_unread_databases(names, files),
        *_note_unread_legs(files),
    )
    return open_sources(sources, selection, input_format, notes)


def _note_unused_tables(names: Sequence[str]) -> tuple[str, ...]:
    """Return a note on energy tables in the named folders, which are not read next to solver databases."""
    tables = [table for name in names for table in list_tables_of_folder(name)]
    if not tables:
        return ()
    listed = list_names(tables, most=_MOST_TABLES)
    if len(tables) == 1:
        return (_note_left_out_table(listed),)
    return (
        f"{listed} were left out: tables next to databases of the solver; name one to use it",
    )


def _note_unread_databases(
    names: Sequence[str], files: Sequence[str]
) -> tuple[str, ...]:
    """Return a note on files in the named folders whose names resemble those of databases, but that were not read."""
    unread = [file for name in names for file in list_unread_databases(name, files)]
    if not unread:
        return ()
    listed = list_names(unread, most=_MOST_TABLES)
    if len(unread) == 1:
        note = f"{listed} was not read, because the solver gives no file this name; if it belongs to the run"
    else:
        note = f"{listed} were not read, because the solver gives no files these names; if they belong to the run"
    return (f"{note}, give all files by name",)


def _note_unread_legs(files: Sequence[str]) -> tuple[str, ...]:
    """Return a note on the later restart segments of a Radioss run that lie next to its files but were not read."""
    unread = find_unread_legs(files)
    if not unread:
        return ()
    listed = list_names(unread, most=_MOST_TABLES)
    if len(unread) == 1:
        return (
            f"{listed} in the same folder was not read; if it is a later restart segment of the run, name it too",
        )
    return (
        f"{listed} in the same folder were not read; if they are later restart segments of the run, name them too",
    )


def open_sources(
    sources: Sequence[Source],
    selection: Selection = _DEFAULT,
    input_format: str = "auto",
    notes_on_names: tuple[str, ...] = (),
) -> OpenedRun:
    """Open the files of one run from their bytes; the arguments and errors are those of `open_run`.

    ``notes_on_names`` contains notes about the names by which the files were found.
    """
    sources, notes_on_copies = _leave_out_copies(sources)
    notes_on_names = (*notes_on_names, *notes_on_copies)
    with_forces: list[Source] = []
    with_nodes: list[Source] = []
    if input_format == "auto":
        with_forces = [source for source in sources if _is_force_listing(source)]
        with_nodes = [source for source in sources if _is_node_listing(source)]
    listings = (*with_forces, *with_nodes)
    sources = [source for source in sources if source not in listings]
    if not sources:
        _refuse_only_listings(with_forces, with_nodes)
    kinds, left_out = _sort_by_format(sources, input_format)
    ordered = [kind for kind in READERS if kind in kinds]
    _refuse_several_solvers(kinds)
    _refuse_time_of_solver(ordered, selection.time)
    opened, notes = _open_legs_of_formats(kinds, ordered, selection)
    ordered = [kind for kind in ordered if kind in opened]
    forces, unread = _read_force_listings(with_forces)
    read_sources = [source for kind in ordered for source in kinds[kind]]
    if not unread:
        read_sources += with_forces
    read_sources += with_nodes
    used = {source.name for source in read_sources}
    for legs in opened.values():
        check_legs(legs)
    ordered = _sort_forces_last(opened, ordered)
    databases = tuple(
        Legs(
            opened[kind],
            cut=[source.name for source in kinds[kind] if source.cut],
            named=selection.channels,
            notes=left_out if kind == ordered[0] else (),
        )
        for kind in ordered
    )
    _refuse_unknown_channels(databases, selection)
    check_companions(databases)
    later_files = set[str]()
    for kind in FAMILIES:
        later_files |= _find_later_files(kinds.get(kind, ()))
    files = tuple(source for source in (*sources, *listings) if source.name in used)
    # The first file of a family stands for all files of the family.
    names = tuple(source.name for source in files if source.name not in later_files)
    reopen = partial(_reopen, files, selection, input_format, notes_on_names)
    return OpenedRun(
        names,
        databases,
        files,
        notes=(*notes_on_names, *notes, *unread),
        forces=forces,
        nodes=tuple(with_nodes),
        reopen=reopen,
    )


def _leave_out_copies(
    sources: Sequence[Source],
) -> tuple[list[Source], tuple[str, ...]]:
    """Return the files without those that have the content of an earlier one, and a note on each that is left out."""
    kept = list[Source]()
    notes = list[str]()
    for source in sources:
        original = next((other for other in kept if _is_copy(source, other)), None)
        if original:
            notes.append(
                f"{source.name} has the same content as {original.name} and was left out"
            )
        else:
            kept.append(source)
    return kept, tuple(notes)


def _is_copy(source: Source, other: Source) -> bool:
    """Return True if two files have the same content, packed or not; the files of a family are never copies."""
    content, other_content = source.data, other.data
    if isinstance(content, Scattered) or isinstance(other_content, Scattered):
        return False
    if len(content) != len(other_content) or content[:_HEAD] != other_content[:_HEAD]:
        return False
    return content[:] == other_content[:]


def _refuse_several_solvers(kinds: Mapping[str, Sequence[Source]]) -> None:
    """Raise FormatError if the files of a run were written by different solvers."""
    files = {
        READERS[kind].solver: sources[0].name
        for kind, sources in kinds.items()
        if READERS[kind].solver
    }
    if len(files) > 1:
        listed = " and ".join(
            f"{name} by {solver}" for solver, name in sorted(files.items())
        )
        raise FormatError(
            f"{listed} were written by different solvers, but files of one run were expected; give the files of one run"
        )


def _refuse_only_listings(
    with_forces: Sequence[Source], with_nodes: Sequence[Source]
) -> None:
    """Raise FormatError if there are only listings of forces or of the motion of nodes, which contain no energy."""
    if with_forces:
        raise FormatError(
            f"{with_forces[0].name}: an rcforc or rwforc of LS-DYNA, which has forces and no internal energy; "
            "name the glstat, matsum or binout of the run with it"
        )
    if with_nodes:
        raise FormatError(
            f"{with_nodes[0].name}: this is the nodout of LS-DYNA, which has no internal energy; "
            "name the glstat, matsum or binout of the run with it"
        )


def _reopen(
    sources: Sequence[Source],
    selection: Selection,
    input_format: str,
    notes_on_names: tuple[str, ...],
    surroundings: Surroundings,
) -> OpenedRun:
    """Open a run again with different external forces (``surroundings``)."""
    run = open_sources(sources, selection, input_format, notes_on_names)
    return run.within(surroundings)


def _sort_by_format(
    sources: Sequence[Source], input_format: str
) -> tuple[dict[str, list[Source]], list[str]]:
    """Group the files of a run by format, and return notes on files that match a pattern but are not used.

    Of the files that match a pattern or lie in a folder, the energy histories are used, but tables only if there is no
    solver database. The later files of a family have the format of its first file.

    Raises
    ------
    FormatError
        If a file that the user named is not an energy history, or if no file of a pattern is one.
    """
    formats: dict[str, str] = {}
    foreign: list[tuple[Source, FormatError]] = []
    # The first file of a family precedes its later files, whose names end with digits.
    for source in sorted(sources, key=lambda source: source.name[-2:].isdigit()):
        first = formats.get(source.name.rstrip(_DIGITS))
        try:
            if first in FAMILIES:
                formats[source.name] = first
            elif input_format != "auto":
                formats[source.name] = input_format
            else:
                formats[source.name] = _detect_format(source)
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
    notes = [_note_left_out_file(source, str(error)) for source, error in foreign]
    if input_format == "auto" and any(READERS[kind].solver for kind in kinds):
        tables = [source for source in kinds.get("csv", []) if source.by_pattern]
        notes += [_note_left_out_table(source.name) for source in tables]
        named_tables = [s for s in kinds.pop("csv", []) if s not in tables]
        if named_tables:
            kinds["csv"] = named_tables
    return kinds, notes


def _note_left_out_table(name: str) -> str:
    """Return the note on a table that was left out."""
    return f"{name} was left out: a table next to databases of the solver; name it to use it"


def _note_left_out_file(source: Source, refusal: str) -> str:
    """Return the note on a file that was left out; the error gives the reason."""
    reason = (
        refusal.removeprefix(f"{source.name}: ")
        .partition(";")[0]
        .removesuffix(", but an energy history was expected")
    )
    return f"{source.name} was left out: {reason}"


def _sort_forces_last(
    opened: Mapping[str, Sequence[Database]], ordered: Sequence[str]
) -> list[str]:
    """Return the formats, with those that contain only forces last; raise FormatError if all contain only forces."""
    alone = {kind: all(leg.only_forces for leg in opened[kind]) for kind in ordered}
    if all(alone.values()):
        # Reading the branch raises the error with the best message about the missing data.
        opened[ordered[0]][0].branch("glstat")
    return sorted(ordered, key=alone.__getitem__)


def _is_force_listing(source: Source) -> bool:
    """Return True if a file is a force listing, which is never part of a family."""
    if isinstance(source.data, Scattered):
        return False
    head = source.data[:_HEAD]
    in_lower_case = head.lower()
    if not any(word in in_lower_case for word in _WORDS_OF_FORCES):
        return False
    # Imported here to keep start-up fast.
    from d2rpick.histories.force_listings import recognises

    return recognises(head)


def _is_node_listing(source: Source) -> bool:
    """Return True if a file is a node listing, which is never part of a family."""
    if isinstance(source.data, Scattered) or _NODOUT not in _head_of(source):
        return False
    # Imported here to keep start-up fast.
    from d2rpick.histories.node_listings import recognises

    return recognises(_head_of(source))


def _read_force_listings(
    sources: Sequence[Source],
) -> tuple[tuple[ContactForce, ...], tuple[str, ...]]:
    """Read the forces in files without energies; if the forces cannot be read, return a note."""
    if not sources:
        return (), ()
    # Imported here to keep start-up fast.
    from d2rpick.histories.force_listings import read_listed_forces

    try:
        return read_listed_forces(sources), ()
    except DamageError:
        raise
    except FormatError as error:
        return (), (f"{error}; it was not used",)


def _find_later_files(sources: Sequence[Source]) -> set[str]:
    """Return the names of the later files of families; the first file of a family stands for all of them."""
    names = {source.name for source in sources}
    return {
        name for name in names if name[-1:].isdigit() and name.rstrip(_DIGITS) in names
    }


def _open_legs_of_formats(
    kinds: Mapping[str, list[Source]], ordered: Sequence[str], selection: Selection
) -> tuple[dict[str, Sequence[Database]], tuple[str, ...]]:
    """Open the files by format; return the restart segments of each format, and notes on unused files.

    LS-DYNA always writes a d3plot family in addition to other files, so the family is used only for data that the other
    files lack. If there are other files, a family that cannot be read is not an error.
    """
    opened: dict[str, Sequence[Database]] = {}
    notes = []
    for kind in ordered:
        legs_so_far = [leg for legs in opened.values() for leg in legs]
        if kind in FAMILIES and _has_model_and_parts(legs_so_far):
            continue
        try:
            opened[kind] = load_reader(kind).open_legs(kinds[kind], selection)
        except FormatError as error:
            if kind not in FAMILIES or len(ordered) == 1:
                raise
            notes.append(f"{error}; it was not used")
    if not opened:
        raise FormatError(notes[0].removesuffix("; it was not used"))
    return opened, tuple(notes)


def _has_model_and_parts(legs: Sequence[Database]) -> bool:
    """Return True if databases contain histories of both the whole model and its parts."""
    return any(leg.channels for leg in legs) and any(leg.parts for leg in legs)


def _refuse_unknown_channels(databases: Sequence[Legs], selection: Selection) -> None:
    """Raise FormatError if no database has a channel that the user names for a quantity."""
    with_channels = [database for database in databases if database.channels]
    for quantity, name in selection.channels:
        if any(_has_channel(database, name) for database in with_channels):
            continue
        option = f"`channels` {quantity}={name}"
        expected = "the name of a column was expected"
        if quantity == "mass" and _is_number(name):
            expected += ", not a value (`mass` takes that of the oscillator model)"
        if not with_channels:
            sources = ", ".join(database.source for database in databases)
            raise FormatError(
                f"{sources}: {option}: {expected}, and there are only columns of parts"
            )
        database = with_channels[0]
        try:
            database.find(name)
        except FormatError as error:
            problem = str(error).removeprefix(f"{database.source}: ")
            raise FormatError(
                f"{database.source}: {option}: {expected}; {problem}"
            ) from None


def _has_channel(database: Legs, name: str) -> bool:
    """Return True if a name or number selects a channel of a database."""
    try:
        database.find(name)
    except FormatError:
        return False
    return True


def _is_number(text: str) -> bool:
    """Return True if a text is a number."""
    try:
        float(text)
    except ValueError:
        return False
    return True


def _refuse_time_of_solver(kinds: Sequence[str], time: str | None) -> None:
    """Raise FormatError if ``--time`` would be ignored, because solver files contain only one time, named 'time'."""
    if (
        time is not None
        and time.strip().casefold() != "time"
        and all(READERS[kind].solver for kind in kinds)
    ):
        raise FormatError(
            f"no time {time!r} in {' and '.join(kinds)}, the time is 'time'; leave `time` out"
        )


def _detect_format(source: Source) -> str:
    """Return the format of a file. Binary signatures are tested first, and tables last."""
    head = _head_of(source)
    is_binary = b"\0" in head
    if is_binary:
        _refuse_foreign(source.name, head)
    for kind, listed in READERS.items():
        if kind == "csv" and not is_binary:
            _refuse_foreign(source.name, head)
        if re.search(listed.hint, head, re.DOTALL) and load_reader(kind).recognises(
            head
        ):
            return kind
    if re.search(r"(^|[/\\.])d3(plot|part|thdt)\d+$", source.name):
        first = source.name.rstrip(_DIGITS)
        raise FormatError(
            f"{source.name}: the first file of its family says what it holds; "
            f"name {first}, with which all files after it are read"
        )
    if re.search(r"(^|[/\\.])d3(plot|part|dump|thdt)[^/\\]*$", source.name):
        raise FormatError(
            f"{source.name}: this is a file of LS-DYNA's d3 family, which has no energies that are read; "
            "name the glstat, matsum, d3plot or binout of the run"
        )
    raise FormatError(
        f"{source.name}: binary data of no known format, but one of {', '.join(READERS)} was expected; "
        "export the energy history as text"
    )


def _refuse_foreign(name: str, head: bytes) -> None:
    """Raise FormatError for a file of a known format that contains no energy history."""
    # Imported here to keep start-up fast.
    from d2rpick.histories.foreign import refuse_foreign

    refuse_foreign(name, head)


def _head_of(source: Source) -> bytes:
    """Return the first bytes of a file; for an LS-DYNA ASCII database, add the bytes after the legend."""
    head = source.data[:_HEAD]
    if b"{BEGIN LEGEND}" in head and b"{END LEGEND}" not in head:
        end = source.data[:_LONGEST_LEGEND].find(b"{END LEGEND}")
        if end >= 0:
            head = source.data[: end + _HEAD]
    return head


def check_companions(databases: Sequence[Legs]) -> None:
    """Raise FormatError if two databases have no common times."""
    for first, second in combinations(databases, 2):
        if not first.span or not second.span:
            continue
        if first.span[0] > second.span[1] or second.span[0] > first.span[1]:
            raise FormatError(
                f"{first.source} and {second.source} have no time in common, but files of one run were expected"
            )


def check_legs(legs: Sequence[Database]) -> None:
    """Raise FormatError if files of one format belong to different runs.

    All restart segments of a run have the same quantities, and a restart repeats the state with which it begins. Files
    that begin at the same time are files of different runs unless one is an earlier copy of the other, so all their
    states are compared.
    """
    for first, second in combinations(legs, 2):
        _check_content(first, second)
        _check_starts(first, second)
        for times, columns in (
            (_list_model_times, _read_model_energies),
            (_list_part_times, _read_part_energies),
        ):
            try:
                shared = _find_shared_states(times(first), times(second))
                if shared is None:
                    continue
                are_alike = _is_same_energy(
                    columns(first, shared[0]), columns(second, shared[1])
                )
            except FormatError:  # The error is reported later, when the column is read.
                continue
            if not are_alike:
                raise _expect_legs(
                    first, second, "have different energies at the same times"
                )


def _check_content(first: Database, second: Database) -> None:
    """Raise FormatError if two files have no part in common, or neither a column nor a part."""
    parts = [{part.id for part in leg.parts} for leg in (first, second)]
    columns = [{*leg.channels} for leg in (first, second)]
    if all(parts) and parts[0].isdisjoint(parts[1]):
        raise _expect_legs(first, second, "have no part in common")
    contents = [
        {*map(str, ids), *names} for ids, names in zip(parts, columns, strict=True)
    ]
    if all(contents) and contents[0].isdisjoint(contents[1]):
        raise _expect_legs(first, second, "have neither a column nor a part in common")


def _check_starts(first: Database, second: Database) -> None:
    """Raise FormatError if two files begin at the same time, but have different times up to the end of the shorter."""
    for list_times in (_list_model_times, _list_part_times):
        try:
            times = [np.unique(list_times(leg)) for leg in (first, second)]
        except FormatError:  # The error is reported later, when the times are read.
            continue
        if not all(values.size for values in times) or times[0][0] != times[1][0]:
            continue
        end = min(values[-1] for values in times)
        if not np.array_equal(*(values[values <= end] for values in times)):
            problem = f"both begin at {times[0][0]:g}, but have different times"
            raise _expect_legs(first, second, problem)


def _expect_legs(first: Database, second: Database, problem: str) -> FormatError:
    """Return the error for two files that are not restart segments of one run."""
    return FormatError(
        f"{first.source} and {second.source} {problem}, but restart segments of one run were expected; "
        "give the files of one run"
    )


def _list_model_times(leg: Database) -> Samples:
    """Return the times of the states with model quantities, shape (n,); empty if the restart segment has none."""
    return leg.time if leg.channels else np.empty(0)


def _list_part_times(leg: Database) -> Samples:
    """Return the times of the states with part quantities, shape (n,); empty if the restart segment has none."""
    return leg.part_time if leg.parts else np.empty(0)


def _read_model_energies(leg: Database, states: Indices) -> Samples:
    """Return the internal energy of the model at given states, shape (states,), or (states, 0) if it is missing."""
    name = leg.energy_channel
    return leg.channel(name)[states] if name else np.empty((states.size, 0))


def _read_part_energies(leg: Database, states: Indices) -> Samples:
    """Return the internal energies of the compared parts at given states, shape (states, parts)."""
    ids = [part.id for part in leg.parts][:_COMPARED]
    return leg.part_channel("internal_energy", ids)[states]


def _find_shared_states(
    first: Samples, second: Samples
) -> tuple[Indices, Indices] | None:
    """Return the indices of common times in two restart segments; only the first time if one segment begins later."""
    _, in_first, in_second = np.intersect1d(first, second, return_indices=True)
    if not in_first.size:
        return None
    if in_first[0] == in_second[0] == 0:
        return in_first, in_second
    begins = in_second == 0 if second[0] > first[0] else in_first == 0
    if not begins.any():
        return None
    return in_first[begins], in_second[begins]


def _is_same_energy(first: Samples, second: Samples) -> bool:
    """Return True if energies differ by no more than after a restart on other processors; NaN values are ignored."""
    if first.shape != second.shape:
        return True
    are_finite = np.isfinite(first) & np.isfinite(second)
    sizes = np.maximum(np.abs(first), np.abs(second))
    largest = sizes.max(initial=0.0, where=are_finite)
    return bool(np.all(np.abs(first - second)[are_finite] <= _SAME * largest))
