"""Split lines of text into cells, and recognise numbers and missing values in the cells."""

from __future__ import annotations

import re
from functools import lru_cache
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from collections.abc import Sequence

_COMMENTS: Final = ("#", "$", "%", "//")
# Values that spreadsheets write, in English or German, if a computation fails.
# A line that begins with such an error value is a row, although "#" is also the comment character.
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
# Pattern of the characters that are printed when a number is too wide for its field.
_OVERFLOW: Final = r"\*+|#{2,}"

# Pattern of a number, keyed by decimal sign.
# The possessive quantifiers prevent backtracking, so that the matching time is proportional to the cell length.
_NUMBER: Final = {
    "." : re.compile(r"[+-]?(?:\d++\.?+\d*+|\.\d++)(?:[eEdD][+-]?\d++)?", re.ASCII),
    ",": re.compile(r"[+-]?(?:\d++,?+\d*+|,\d++)(?:[eEdD][+-]?\d++)?", re.ASCII),
}  # fmt: skip
# Template of the pattern of a number with thousands separators, for a given separator and decimal sign.
_GROUPED: Final = r"[+-]?[1-9]\d{0,2}(?:%s\d{3})+(?:%s\d*)?"
# Thousands separators that are tried in addition to "." and ",".
_THOUSANDS: Final = ("'", "’", "\N{NO-BREAK SPACE}", "\N{NARROW NO-BREAK SPACE}", " ")
# Pattern of a date, clock time or percentage, which is not a number but does not make the separator implausible.
_DATE_OR_SHARE: Final = r"(?a)\d{1,4}[-/.:]\d{1,2}[-/.:]\d.*|[-+]?[\d.,]+\s*%"
# Characters of the lines that separate rows or surround a table.
_RULE: Final = "-=+|:_ \t"
_RULE_STARTS: Final = ("-", "=", "+", "|", ":")


def split_cells(line: str, separator: str | None) -> list[str]:
    """Split a line into its cells, without outer spaces and quotes. A separator inside quotes belongs to its cell.

    Examples
    --------
    >>> split_cells('"part 3, left", 1.5 ,', ",")
    ['part 3, left', '1.5', '']
    """
    if '"' not in line:
        if separator is None:
            return line.split()
        return [*map(str.strip, line.split(separator))]
    sign = separator or " "
    if separator is None:
        line = " ".join(line.split())
    cells: list[str] = []
    is_quoted = False
    for piece in line.split(sign):
        if is_quoted:
            cells[-1] += sign + piece
        else:
            cells.append(piece)
        if piece.count('"') % 2:
            is_quoted = not is_quoted
    return [cell.strip().removeprefix('"').removesuffix('"').strip() for cell in cells]


def is_skipped(line: str) -> bool:
    """Return True if a line is blank, a comment, or a horizontal rule.

    Examples
    --------
    >>> [line for line in ("", "# 1,2", "#DIV/0!,1", "|---|---|", "-1.5,2") if not is_skipped(line)]
    ['#DIV/0!,1', '-1.5,2']
    """
    if line[:1].isdigit():
        return False  # This test comes first to save time, because most rows begin with a digit.
    line = line.lstrip()
    if not line:
        return True
    if line.startswith(_COMMENTS):
        return not line.casefold().startswith(tuple(_SPREADSHEET_ERRORS))
    return line.startswith(_RULE_STARTS) and len(line) > 2 and not line.strip(_RULE)


def parse_cell(cell: str, decimal: str, thousands: str = "") -> float | None:
    """Return the number in a cell, otherwise None. Unlike Python's float, reject words (``nan``) and underscores.

    Examples
    --------
    >>> parse_cell("1.234,5", ",", "."), parse_cell("1.23,5", ",", "."), parse_cell("1,5D3", ",")
    (1234.5, None, 1500.0)
    """
    number = _written_number(cell, decimal, thousands)
    if number is None:
        return None
    return float(number.replace(",", ".").replace("D", "E").replace("d", "e"))


def has_number(cell: str, decimal: str, thousands: str = "") -> bool:
    """Return True if a cell contains a number. The number is not computed, because many cells are tested."""
    return _written_number(cell, decimal, thousands) is not None


def split_columns_of_numbers(
    lines: Sequence[str], separator: str | None, decimal: str, columns: int
) -> list[list[str]] | None:
    """Return the cells of each column if all lines consist of ``columns`` plain numbers; otherwise None.

    Examples
    --------
    >>> split_columns_of_numbers(["0,1.5", "1,-2e3"], ",", ".", 2)
    [['0', '1'], ['1.5', '-2e3']]
    >>> split_columns_of_numbers(["0,1.5", "1,n/a"], ",", ".", 2)
    """
    if separator is None or separator == decimal:
        return None
    rows = "\n".join([*lines, ""])
    if not _compile_rows(separator, decimal, columns).fullmatch(rows):
        return None
    cells = rows.replace("\n", separator).split(separator)[:-1]
    return [cells[column::columns] for column in range(columns)]


@lru_cache
def _compile_rows(separator: str, decimal: str, columns: int) -> re.Pattern[str]:
    """Return a regular expression for any number of rows of ``columns`` plain numbers, each ending with a line feed."""
    number = _NUMBER[decimal].pattern
    further = f"(?:{re.escape(separator)}{number}){{{columns - 1}}}"
    return re.compile(rf"(?:{number}{further}\n)*+", re.ASCII)


def _written_number(cell: str, decimal: str, thousands: str) -> str | None:
    """Return the text of a number without thousands separators and with an ASCII minus sign; None if it is invalid."""
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
    """Return True if a cell is empty or marks a missing number (``NaN``, ``n/a``, ``#DIV/0!``, ``****``)."""
    return cell.casefold() in _MISSING or re.fullmatch(_OVERFLOW, cell) is not None


def is_word(cell: str) -> bool:
    """Return True if a cell that is not a number is a word, date, clock time or percentage.

    A word begins with a letter, because a wrong separator may cut cells such as "5 load 1" out of "0,5 load 1,5".
    """
    return cell[0].isalpha() or re.fullmatch(_DATE_OR_SHARE, cell) is not None


def find_thousands(cells: Sequence[str], decimal: str) -> str:
    """Return the thousands separator that the cells prove; empty if no cell proves one.

    A cell proves it if it also has a decimal sign, or two such separators; "1.234" alone is ambiguous.

    Examples
    --------
    >>> find_thousands(["0,5", "1.234,5"], ","), find_thousands(["0.5", "1,234,567"], "."), find_thousands(["1.2"], ",")
    ('.', ',', '')
    """
    for sign in ("." if decimal == "," else ",", *_THOUSANDS):
        grouped = re.compile(_GROUPED % (re.escape(sign), re.escape(decimal)), re.ASCII)
        for cell in cells:
            is_proof = decimal in cell or cell.count(sign) > 1 or sign not in ".,"
            if sign in cell and is_proof and grouped.fullmatch(cell):
                return sign
    return ""
