"""Recognise files in a run folder that contain no energy history, and tell the user which file to use instead.

Sources: the magic numbers of the formats; ISO/TS 13499 (ISO-MME); the universal file format of SDRC, dataset 58; the
ASCII databases, d3hsp and messag of LS-DYNA; listings of Radioss; the status file of Abaqus.
"""

from __future__ import annotations

import os
import re
from typing import Final

from d2rpick.base.errors import FormatError
from d2rpick.base.tuples import NamedTuple

_NAME_DATABASE: Final = "name the glstat, matsum or binout of the run"
_NAME_TIME_HISTORY: Final = "name the T01 of the run"
_SAVE_SHEET: Final = "save the sheet as csv, with a line of headings"
_FROM_FRAME: Final = (
    "load it in Python and give the columns to d2rpick.from_frame, or write them as csv"
)
_EXPORT: Final = "export time and internal energy as csv, with a line of headings"
# Names of LS-DYNA's ASCII databases without an internal energy of the model or its parts.
# An ASCII database is recognised by its file name, or by words that occur in no other database.
_DYNA_DATABASES: Final = (
    ("nodout", rb"n o d a l   p r i n t   o u t"),
    ("elout", rb"e l e m e n t   s t r e s s"),
    ("rbdout", rb"r i g i d   b o d y   m o t i o n"),
    ("jntforc", rb"j o i n t   f o r c e   o u t p u t"),
    ("nodfor", rb"n o d a l   f o r c e   g r o u p"),
    ("bndout", rb"n o d a l   f o r c e/e n e r g y"),
    ("spcforc", rb"single point constraint forces"),
    ("sleout", rb"contact interface energy output|interface energies"),
    ("rcforc", rb"\n *(?:slave|master|surfa|surfb) +\d+ +time"),
    ("rwforc", rb"normal-force"),
    ("secforc", rb"section#|\n +total-force"),
    ("deforc", rb"spring/damper"),
    ("abstat", rb"airbag/cv"),
    ("swforc", rb"spotweld|constraint #"),
    *(
        (name, b"")
        for name in (
            "ncforc",
            "gceout",
            "sbtout",
            "ssstat",
            "sphout",
            "trhist",
            "disbout",
            "dbfsi",
            "curvout",
        )
    ),
    *(
        (name, b"")
        for name in (
            "defgeo",
            "dcfail",
            "tprint",
            "atdb",
            "pllyout",
            "prtube",
            "cpmfor",
            "massout",
        )
    ),
)
_DYNA_HEAD: Final = rb"\n(?:\{BEGIN LEGEND\}| {10,}ls-dyna )"
# Pattern of a keyword at the start of a line in an LS-DYNA deck, or in a Radioss starter or engine file.
_DECK: Final = rb"\*[A-Za-z][A-Za-z_]{2}|#RADIOSS|/BEGIN|/[A-Z]{3,8}(?:/|\s|\Z)"


class ForeignFormat(NamedTuple):
    """A file format without an energy history: its files begin with one of the ``marks``.

    With a ``pattern``, the marks are somewhere in the first bytes, which the pattern matches. Patterns are compiled
    only for files with such a mark, to keep start-up fast.
    """

    marks: tuple[bytes, ...]
    name: str
    cure: str
    pattern: bytes = b""

    def is_format_of(self, head: bytes) -> bool:
        """Return True if a file with these first bytes has this format."""
        if not self.pattern:
            return head.startswith(self.marks)
        return (
            any(mark in head for mark in self.marks)
            and re.match(self.pattern, head, re.DOTALL) is not None
        )


# Formats that are recognised by their first bytes, from the most specific to the most general.
_BINARY_FORMATS: Final = (
    ForeignFormat(
        (b"PK\x03\x04",),
        "an Excel workbook",
        _SAVE_SHEET,
        rb"PK\x03\x04.{0,2000}(xl/|\[Content_Types\])",
    ),
    ForeignFormat(
        (b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1",), "an Excel workbook", _SAVE_SHEET
    ),
    ForeignFormat(
        (b"PK\x03\x04",),
        "an archive of numpy arrays (npz)",
        _FROM_FRAME,
        rb"PK\x03\x04.{0,80}\.npy",
    ),
    ForeignFormat(
        (b"PK\x03\x04",), "a zip archive", "unpack it and name the history in it"
    ),
    ForeignFormat(
        (b"7z\xbc\xaf", b"BZh", b"\xfd7zXZ"),
        "a packed file",
        "unpack it first: only gzip is read as it is",
        rb"7z\xbc\xaf|BZh[1-9]1AY|\xfd7zXZ",
    ),
    ForeignFormat(
        (b"\x28\xb5\x2f\xfd",),
        "a packed file",
        "unpack it first: only gzip is read as it is",
    ),
    ForeignFormat(
        (b"PAR1",),
        "a parquet file",
        "write it as csv: pandas.read_parquet(...).to_csv(...)",
    ),
    ForeignFormat(
        (b"ARROW1", b"FEA1", b"\xff\xff\xff\xff"),
        "an arrow file",
        _FROM_FRAME,
        rb"ARROW1|FEA1|\xff\xff\xff\xff.{3}\0\x10\0\0\0",
    ),
    ForeignFormat((b"\x93NUMPY",), "a numpy array (npy)", _FROM_FRAME),
    ForeignFormat(
        (b"HKSRD0",),
        "an output database of Abaqus (odb)",
        "write an XY report of ALLIE, ALLKE and ALLWK",
    ),
    ForeignFormat((b"SQLite format 3\0",), "an SQLite database", _FROM_FRAME),
    ForeignFormat(
        (b"MATLAB 5.0 MAT-file",),
        "a MAT-file of MATLAB before version 7.3",
        "save it with -v7.3, or as csv",
    ),
    ForeignFormat(
        (b"\x80",),
        "a pickle of Python, which is never loaded",
        _FROM_FRAME,
        rb"\x80[\x02-\x05][\x80-\xff(\x5d\x7d]",
    ),
    ForeignFormat((b"TDSm", b"MDF    "), "a file of measured data", _EXPORT),
    ForeignFormat(
        (b"CDF",),
        "a file of netCDF 3",
        "write it as netCDF 4, or as csv",
        rb"CDF[\x01\x02\x05]",
    ),
    ForeignFormat(
        (b"%PDF", b"\x89PNG", b"\xff\xd8\xff"), "a document or picture", _EXPORT
    ),
    ForeignFormat(
        (b"\0\0\x54",),
        "an animation file of Radioss",
        _NAME_TIME_HISTORY,
        rb"\0\0\x54[\x26-\x2f]",
    ),
)

# Formats that are recognised by their first lines.
_TEXT_FORMATS: Final = (
    ForeignFormat(
        (
            b"Data format edition number",
            b"Test object number",
            b"Name of the channel",
            b"Channel code",
        ),
        "a channel or header of ISO-MME",
        "write time and values as csv",
        rb"(?:Data format edition number|(?:Test object number|Name of the channel|Channel code)\s*:).*",
    ),
    ForeignFormat(
        (b"-1",), "a universal file (UNV)", _EXPORT, rb"\s*-1 *\r?\n\s*\d{1,5}\s*\r?\n"
    ),
    ForeignFormat(
        (b"Abaqus/",),
        "a status file of Abaqus (.sta), which has no internal energy",
        "write an XY report of ALLIE, ALLKE and ALLWK from the odb",
        rb"\s*Abaqus/(?:Explicit|Standard).*?INCREMENT",
    ),
    ForeignFormat(
        (b"LS-DYNA, A Program for Nonlinear Dynamic",),
        "a listing of LS-DYNA (d3hsp or messag)",
        _NAME_DATABASE,
        rb".{0,4000}\bLS-DYNA, A Program for Nonlinear Dynamic",
    ),
    ForeignFormat(
        (b"*" * 20, b"** CUMULATIVE CPU TIME", b"TIME-STEP"),
        "a listing of Radioss (.out)",
        _NAME_TIME_HISTORY,
        rb"\s*\*{20,}.{0,4000}(?i:radioss)|\s*\*\* CUMULATIVE CPU TIME|.{0,8000}\bCYCLE +TIME +TIME-STEP",
    ),
    ForeignFormat(
        (b"{", b"["),
        "a JSON document",
        "write time and energy as csv",
        rb"\s*[{\[]\s*[\"{\[\]}]",
    ),
    ForeignFormat(
        (b"[",),
        "a JSON document",
        "write time and energy as csv",
        rb"\s*\[[\s\d.eE+,-]*(?:\]|\Z)",
    ),
    ForeignFormat(
        (b"<",),
        "an XML or HTML document",
        _EXPORT,
        rb"\s*<(?:\?xml|!DOCTYPE|html|VTKFile|SOLUTION)",
    ),
    ForeignFormat((b"# vtk DataFile",), "a VTK file", _EXPORT),
    ForeignFormat(
        (b"ISO-10303", b"solid "),
        "a geometry",
        _EXPORT,
        rb"ISO-10303|solid \w+\s*\n\s*facet",
    ),
)


def refuse_foreign(source: str, head: bytes) -> None:
    """Raise FormatError for a file of a known format that contains no energy history.

    Parameters
    ----------
    source : str
        Name of the file, which identifies an ASCII database of LS-DYNA if its content does not.
    head : bytes
        The first bytes of the file.
    """
    _refuse(source, head, _BINARY_FORMATS)
    if b"\0" in head:
        return
    if _is_deck(head):
        raise FormatError(
            f"{source}: this is a deck, but an energy history was expected; "
            "name the glstat, matsum, binout or T01 of its run, and this file as `deck`"
        )
    _refuse(source, head, _TEXT_FORMATS)
    if re.search(_DYNA_HEAD, head):
        name = _name_dyna_database(source, head)
        which = f"the {name}" if name else "an ASCII database"
        raise FormatError(
            f"{source}: this is {which} of LS-DYNA, which has no internal energy of the model or its parts; "
            f"{_NAME_DATABASE}"
        )


def _refuse(source: str, head: bytes, formats: tuple[ForeignFormat, ...]) -> None:
    """Raise FormatError if a file has one of these formats."""
    for foreign in formats:
        if foreign.is_format_of(head):
            raise FormatError(
                f"{source}: this is {foreign.name}, but an energy history was expected; {foreign.cure}"
            )


def _name_dyna_database(source: str, head: bytes) -> str:
    """Return the name of an LS-DYNA ASCII database recognised by content or file name; empty if it is unknown."""
    for name, words in _DYNA_DATABASES:
        if words and re.search(words, head):
            return name
    base_name = os.path.basename(source).casefold().removesuffix(".gz")  # noqa: PTH119  pathlib would slow down start-up
    return base_name if base_name in dict(_DYNA_DATABASES) else ""


def _is_deck(head: bytes) -> bool:
    """Return True if the content begins with deck keywords, possibly preceded by comments."""
    lines = head.removeprefix(b"\xef\xbb\xbf").split(b"\n")
    first = next(
        (line for line in lines if line.strip() and not line.lstrip().startswith(b"$")),
        b"",
    )
    return first.startswith((b"*", b"#", b"/")) and re.match(_DECK, first) is not None
