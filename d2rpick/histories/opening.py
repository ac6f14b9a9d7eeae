"""Readers of energy histories: one module per format, one table of formats.

A reader is a module with the two functions of `Reader`; a new format is a new module and a line in `READERS`.  It is
imported when a file may be its own: start-up is part of the product.
"""

from __future__ import annotations

import re
from importlib import import_module
from typing import TYPE_CHECKING, Final, Protocol, cast

from d2rpick.base.errors import FormatError
from d2rpick.base.tuples import NamedTuple
from d2rpick.histories.companions import check_companions, check_legs
from d2rpick.histories.database import Database, Legs
from d2rpick.histories.names import Selection
from d2rpick.histories.run import Run
from d2rpick.histories.source import Source, open_files

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence


__all__ = ["READERS", "Reader", "Run", "Selection", "Source", "open_run", "open_sources", "reader"]

# Enough of a file for its head and more than one state of the longest blocks.
_HEAD = 8192
_DEFAULT = Selection()
# A keyword of LS-DYNA at the start of a line, or the first line of a Radioss deck; compiled where it is needed.
_DECK: Final = rb"\*[A-Za-z][A-Za-z_]{2}|#RADIOSS|/BEGIN"
# What is often given instead of a history: how it begins, what it is, and the way out.
_OTHERS: Final = (
    (
        rb"PK\x03\x04.{0,2000}(xl/|\[Content_Types\])",
        "an Excel workbook",
        "save the sheet as csv, with a line of headings",
    ),
    (rb"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1", "an Excel workbook", "save the sheet as csv, with a line of headings"),
    (rb"PK\x03\x04", "a zip archive", "unpack it and name the history in it"),
    (rb"7z\xbc\xaf|BZh[1-9]1AY|\xfd7zXZ", "a packed file", "unpack it first: only gzip is read as it is"),
    (rb"PAR1", "a parquet file", "write it as csv: pandas.read_parquet(...).to_csv(...)"),
)


class Reader(Protocol):
    """What a module has to offer to be a reader; that of a table has ``write``, too."""

    def recognises(self, head: bytes) -> bool:
        """Whether a file that begins like this is of the reader's format; never raises."""

    def open_legs(self, sources: Sequence[Source], selection: Selection) -> Sequence[Database]:
        """Open files of this format as the legs of one run; FormatError when one is none."""


class Listed(NamedTuple):
    """Module of a reader, and what its files have in their head: a regular expression that is found there."""

    module: str
    hint: bytes


# In the order they are asked, and in which they are preferred as sources of one quantity: binary before text, since it
# holds more digits; csv takes any text, so it comes last.
READERS: Final[Mapping[str, Listed]] = {
    "binout": Listed("binout", rb"\A[\x08-\x40].{5}\0"),
    "radioss-th": Listed("radioss_th", rb"\A\0\0\0T|ZZZZZEOR"),
    "glstat": Listed("glstat", rb" time\.|ls-dyna"),
    "matsum": Listed("matsum", rb" time =|{BEGIN LEGEND}"),
    "hdf5": Listed("hdf5_file", rb"\x89HDF"),
    "csv": Listed("csv_table", b""),
}


def reader(kind: str) -> Reader:
    """Import the reader of a format, one of `READERS`."""
    return cast("Reader", import_module(f"d2rpick.histories.formats.{READERS[kind].module}"))


def open_run(names: Sequence[str], selection: Selection = _DEFAULT, input_format: str = "auto") -> Run:
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


def open_sources(sources: Sequence[Source], selection: Selection = _DEFAULT, input_format: str = "auto") -> Run:
    """Open the files of one run whose bytes are at hand; arguments and errors as of `open_run`."""
    kinds: dict[str, list[Source]] = {}
    for source in sources:
        kinds.setdefault(input_format if input_format != "auto" else _format(source), []).append(source)
    ordered = [kind for kind in READERS if kind in kinds]
    _refuse_time_of_solver(ordered, selection.time)
    opened = {kind: reader(kind).open_legs(kinds[kind], selection) for kind in ordered}
    for legs in opened.values():
        check_legs(legs)
    databases = tuple(
        Legs(opened[kind], cut=[one.name for one in kinds[kind] if one.cut], named=selection.channels)
        for kind in ordered
    )
    _refuse_unknown_channels(databases, selection)
    check_companions(databases)
    return Run(tuple(source.name for source in sources), databases, tuple(sources))


def _refuse_unknown_channels(databases: Sequence[Legs], selection: Selection) -> None:
    """FormatError, with what there is, where a channel that is named for a quantity is in none of the databases."""
    for quantity, name in selection.channels:
        if not any(quantity in database.quantities for database in databases):
            databases[0].find(name)


def _refuse_time_of_solver(kinds: Sequence[str], time: str | None) -> None:
    """Refuse ``--time`` where it would be passed over: solvers have one time and call it so."""
    if time is not None and time.strip().casefold() != "time" and not {"csv", "hdf5"} & {*kinds}:
        raise FormatError(f"no time {time!r} in {' and '.join(kinds)}, the time is 'time'; leave `time` out")


def _is_deck(head: bytes) -> bool:
    """Whether a deck begins, behind comments only."""
    lines = head.removeprefix(b"\xef\xbb\xbf").split(b"\n")
    first = next((line for line in lines if line.strip() and not line.lstrip().startswith(b"$")), b"")
    return first.startswith((b"*", b"#", b"/")) and re.match(_DECK, first) is not None


def _format(source: Source) -> str:
    head = source.data[:_HEAD]
    if _is_deck(head):
        found = f"{source.name}: this is a deck, an energy history was expected"
        raise FormatError(f"{found}; name the glstat, matsum, binout or T01 of its run")
    for begins, what, way_out in _OTHERS:
        if re.match(begins, head, re.DOTALL):
            raise FormatError(f"{source.name}: this is {what}, an energy history was expected; {way_out}")
    for kind, listed in READERS.items():
        if re.search(listed.hint, head, re.DOTALL) and reader(kind).recognises(head):
            return kind
    if re.search(r"(^|[/\\])d3(plot|part|dump|thdt)[^/\\]*$", source.name):
        what = "this is a file of LS-DYNA's d3 family, which holds no energies that are read"
        raise FormatError(f"{source.name}: {what}; name the glstat, matsum or binout of the run")
    found = f"{source.name}: binary data of no known format, one of {', '.join(READERS)} was expected"
    raise FormatError(f"{found}; export the energy history as text")
