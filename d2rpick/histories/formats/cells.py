"""Cells of a line of text: how a line is cut, which cells hold a number, and what stands for a missing one."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from collections.abc import Sequence

_COMMENTS: Final = ("#", "$", "%", "//")
# What a spreadsheet writes for a value it cannot compute, in English and German; a line may begin with it.
_SPREADSHEET_ERRORS: Final = frozenset(
    {
        "#div/0!",
        "#nv",
        "#n/a",
        "#wert!",
        "#value!",
        "#bezug!",
        "#ref!",
        "#name?",
        "#zahl!",
        "#num!",
        "#null!",
    }
)
_MISSING: Final = _SPREADSHEET_ERRORS | frozenset(
    {"", "nan", "+nan", "-nan", "inf", "+inf", "-inf", "infinity", "-infinity", "na", "n/a", "null", "none", "nil",
     "n.a.", "k.a.", "nd", "?", ".", "-", "--", "---", "–", "—"}
)  # fmt: skip
_OVERFLOW: Final = re.compile(r"\*+|#{2,}")  # a number too wide for its field

# What was taken is not given back: the time grows with the length of a cell, not with its square.
_NUMBER: Final = {
    "." : re.compile(r"[+-]?(?:\d++\.?+\d*+|\.\d++)(?:[eEdD][+-]?\d++)?", re.ASCII),
    ",": re.compile(r"[+-]?(?:\d++,?+\d*+|,\d++)(?:[eEdD][+-]?\d++)?", re.ASCII),
}  # fmt: skip
_GROUPED: Final = r"[+-]?[1-9]\d{0,2}(?:%s\d{3})+(?:%s\d*)?"  # thousands and decimal sign; compiled where it is needed
# Signs between groups of three digits, beside the one of "." and "," that is not the decimal sign.
_THOUSANDS: Final = ("'", "’", "\N{NO-BREAK SPACE}", "\N{NARROW NO-BREAK SPACE}", " ")
# A date or clock time, a percentage: no numbers, but nothing that a wrong separator makes either.
_DATE_OR_SHARE: Final = re.compile(
    r"\d{1,4}[-/.:]\d{1,2}[-/.:]\d.*|[-+]?[\d.,]+\s*%", re.ASCII
)
_RULE: Final = (
    "-=+|:_ \t"  # signs of a line that is drawn between rows or around a table
)
_RULE_STARTS: Final = ("-", "=", "+", "|", ":")


def split(line: str, separator: str | None) -> list[str]:
    """Cells of a line, without blanks and quotes around them; a separator inside quotes does not count.

    Examples
    --------
    >>> split('"part 3, left", 1.5 ,', ",")
    ['part 3, left', '1.5', '']
    """
    if '"' not in line:
        return (
            line.split()
            if separator is None
            else [cell.strip() for cell in line.split(separator)]
        )
    sign = separator or " "
    cells: list[str] = []
    inside = False
    for piece in (line if separator else " ".join(line.split())).split(sign):
        if inside:
            cells[-1] += sign + piece
        else:
            cells.append(piece)
        inside ^= piece.count('"') % 2 == 1
    return [cell.strip().removeprefix('"').removesuffix('"').strip() for cell in cells]


def is_skipped(line: str) -> bool:
    """Return True if a line is blank, a comment or a rule.

    Examples
    --------
    >>> [line for line in ("", "# 1,2", "#DIV/0!,1", "|---|---|", "-1.5,2") if not is_skipped(line)]
    ['#DIV/0!,1', '-1.5,2']
    """
    line = line.lstrip()
    if not line:
        return True
    if line.startswith(_COMMENTS):
        return not line.casefold().startswith(tuple(_SPREADSHEET_ERRORS))
    return line.startswith(_RULE_STARTS) and len(line) > 2 and not line.strip(_RULE)


def as_number(cell: str, decimal: str, thousands: str = "") -> float | None:
    """Return the number in a cell, or None; words and underscores are none, though Python takes them.

    Examples
    --------
    >>> as_number("1.234,5", ",", "."), as_number("1.23,5", ",", "."), as_number("1,5D3", ",")
    (1234.5, None, 1500.0)
    """
    number = _written_number(cell, decimal, thousands)
    if number is None:
        return None
    return float(number.replace(",", ".").replace("D", "E").replace("d", "e"))


def is_number(cell: str, decimal: str, thousands: str = "") -> bool:
    """Return True if a cell holds a number, which is not computed: cells are asked by the thousand."""
    return _written_number(cell, decimal, thousands) is not None


def _written_number(cell: str, decimal: str, thousands: str) -> str | None:
    """Return a number as it is written, without thousands and with the minus sign of ASCII, or None."""
    if not cell.isascii():
        cell = cell.replace("\N{MINUS SIGN}", "-")
    if thousands and thousands in cell:
        if not re.fullmatch(
            _GROUPED % (re.escape(thousands), re.escape(decimal)), cell, re.ASCII
        ):
            return None
        cell = cell.replace(thousands, "")
    return cell if _NUMBER[decimal].fullmatch(cell) else None


def is_missing(cell: str) -> bool:
    """Return True if a cell is empty, or holds what stands for a number that is missing."""
    return cell.casefold() in _MISSING or _OVERFLOW.fullmatch(cell) is not None


def is_word(cell: str) -> bool:
    """Return True if a cell that is no number is a word, date, clock time or percentage.

    A word begins with a letter: "5 load 1" is a piece of "0,5 load 1,5", cut at the wrong places.
    """
    return cell[0].isalpha() or _DATE_OR_SHARE.fullmatch(cell) is not None


def find_thousands(cells: Sequence[str], decimal: str) -> str:
    """Return the sign between groups of three digits, empty if no cell shows for sure that it is one.

    A number with the sign and the decimal sign shows it, or one with two such signs: "1.234" alone may be either.

    Examples
    --------
    >>> find_thousands(["0,5", "1.234,5"], ","), find_thousands(["0.5", "1,234,567"], "."), find_thousands(["1.2"], ",")
    ('.', ',', '')
    """
    for sign in ("." if decimal == "," else ",", *_THOUSANDS):
        grouped = re.compile(_GROUPED % (re.escape(sign), re.escape(decimal)), re.ASCII)
        sure = (
            cell
            for cell in cells
            if sign in cell
            and (decimal in cell or cell.count(sign) > 1 or sign not in ".,")
        )
        if any(grouped.fullmatch(cell) for cell in sure):
            return sign
    return ""
