"""The formats of histories, each a line of `READERS` and a module, and what several of the modules share.

Readers are loaded when a file may be their own, and the help shows the names without them: start-up is part of the
product.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from d2rpick.base.tuples import NamedTuple

if TYPE_CHECKING:
    from collections.abc import Mapping


class Listed(NamedTuple):
    """What is known of a format before its reader, the ``module``, is loaded.

    Regular expressions tell its files: ``hint`` is found in the head of each, ``files`` is what a ``solver`` calls
    them, with the name of the run as ``root`` where it tells them by that.  Energies of a solver can be balanced, and
    its files have one time; a format of no solver holds columns that somebody named.
    """

    module: str
    hint: bytes
    solver: str = ""
    files: str = ""


# In the order they are asked, and in which they are preferred as sources of one quantity: binary before text, since it
# holds more digits; csv takes any text, so it comes last of those; and what a run writes seldom comes behind all.
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
# Of the formats that are families of files, of which only the first says what it is.
FAMILIES: Final = ("d3thdt", "d3plot")
