"""In which format a history is written: by the name of the file, or by what is asked for."""

from __future__ import annotations

from pathlib import PurePath
from typing import TYPE_CHECKING, Final

from d2rpick.errors import FormatError, printable
from d2rpick.histories.formats import csv_table, hdf5_file

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from d2rpick.histories.history import Samples

Table = dict[str, "Samples"]

# Formats that hold any columns under any names.
TABLE_WRITERS: Final[Mapping[str, Callable[[Table], bytes]]] = {"csv": csv_table.write, "hdf5": hdf5_file.write}
_SUFFIXES: Final = {"csv": "csv", "h5": "hdf5", "hdf5": "hdf5", "hdf": "hdf5"}


def format_of(name: str | None, formats: Sequence[str]) -> str:
    """Tell the format that a file's name asks for; csv without a name, FormatError when it asks for none.

    The suffix decides; a name without one of these suffixes is that of a solver's database, or holds it.

    Examples
    --------
    >>> every = ("csv", "hdf5", "glstat", "matsum")
    >>> [format_of(name, every) for name in ("glstat.csv", "run1.glstat", "runglstat.h5", None)]
    ['csv', 'glstat', 'hdf5', 'csv']
    """
    if name is None:
        return "csv"
    path = PurePath(name.lower())
    by_name = next((form for form in ("glstat", "matsum") if form in path.name), None)
    asked = _SUFFIXES.get(path.suffix[1:], by_name)
    if asked not in formats:
        raise FormatError(f"{printable(name)}: the suffix names no format; give `write_as`: {', '.join(formats)}")
    return str(asked)
