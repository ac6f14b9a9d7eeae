"""List the file formats of histories; each format has one line in `READERS` and one module.

A reader is imported only when a file may have its format. Help texts list the formats without importing their readers,
which keeps start-up fast.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from d2rpick.base.tuples import NamedTuple

if TYPE_CHECKING:
    from collections.abc import Mapping

# In these formats, a run is a family of files (d3plot, d3plot01, ...) of which only the first has a header.
FAMILIES: Final = ("d3thdt", "d3plot")


class Listed(NamedTuple):
    """A file format, described without importing its reader ``module``.

    The regular expression ``hint`` finds a match in the first bytes of each file of the format; the reader is imported
    and its ``recognises`` called only for files in which ``hint`` finds a match. ``files`` matches the file names that
    the ``solver`` uses; its group ``root`` is the name of the run if the solver puts it into the file name. Only solver
    files have an energy balance and common times of all columns. Files of a format without a ``solver`` contain columns
    that a user has named.
    """

    module: str
    hint: bytes
    solver: str = ""
    files: str = ""


# Formats are tried in this order, and a quantity is read from the first format that contains it if possible.
# Binary formats come before text formats, because their numbers have more digits.
# csv comes after the other text formats, because it accepts any text; rare formats come last.
READERS: Final[Mapping[str, Listed]] = {
    "binout": Listed(
        "binout", rb"\A[\x08-\x40].{5}\0", "LS-DYNA", r"(?i:binout[\d%]*)"
    ),
    "radioss-th": Listed(
        "radioss_th", rb"\A\0\0\0T|ZZZZZEOR", "Radioss", r"(?P<root>.*)T\d\d"
    ),
    "glstat": Listed("glstat", rb" time\.|ls-dyna", "LS-DYNA", "(?i:glstat)"),
    "matsum": Listed("matsum", rb" time =|{BEGIN LEGEND}", "LS-DYNA", "(?i:matsum)"),
    "hdf5": Listed("hdf5_file", rb"\x89HDF"),
    "csv": Listed("csv_table", b""),
    "d3thdt": Listed("d3thdt", b"", "LS-DYNA", r"(?i:d3thdt(?:\d{2,})?)"),
    "d3plot": Listed("d3plot", b"", "LS-DYNA", r"(?i:d3plot(?:\d{2,})?)"),
}
