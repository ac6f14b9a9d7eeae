"""What can go wrong, in one line each: where, what was found, what was expected, what to do; and what to beware of."""

from __future__ import annotations

from bisect import bisect_right
from errno import EBADF
from typing import TYPE_CHECKING, Final, TypeVar

from d2rpick.base.tuples import NamedTuple

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Iterable, Sequence

# Control and format characters (escape codes, text direction), line and paragraph separators.
UNSEEN: Final = frozenset({"Cc", "Cf", "Zl", "Zp"})
_Read = TypeVar("_Read")
_MOST_NAMED: Final = 20  # things in one line


class D2RPickError(Exception):
    """Root of all errors of d2rpick; its text is one line, ready to be shown to a user."""


class FormatError(D2RPickError):
    """A file cannot be read as an energy history."""


class ChangedError(D2RPickError):
    """A file was written anew while it was read: what it holds is of two of its states, and nothing of it counts."""


class HistoryError(D2RPickError):
    """Numbers were read, but they do not make an energy history."""


class RangeError(D2RPickError):
    """A time or a parameter lies outside what the history or the mechanics allow."""


class DeckError(D2RPickError):
    """A deck cannot be read, or a card cannot be written."""


class ArgumentError(TypeError, ValueError):
    """What is asked contradicts itself, said with the names of arguments in backticks."""


class ConfigurationError(D2RPickError):
    """The configuration of the deck check is wrong: an unknown rule, key or severity."""


class Caution(NamedTuple):
    """Something the user should know: a stable ``code`` for scripts, and a sentence."""

    code: str
    message: str


INTERNAL_ERROR: Final = "internal-error"  # what becomes of one of several inputs where it meets an error of the program
FORESEEN: Final = (
    D2RPickError,
    OSError,
    MemoryError,
)  # what is no error of the program itself


def if_written(read: Callable[[], _Read]) -> _Read | None:
    """Give what is read of a history, None where it is not written, or not in every state."""
    try:
        return read()
    except FormatError:
        return None


def one_line(error: BaseException) -> str:
    """Say any error in one line; one that nobody foresaw as what to report.

    Examples
    --------
    >>> one_line(RangeError("run: td 9 lies outside the record")), one_line(KeyError("time"))
    ('run: td 9 lies outside the record', "internal error, please report it (KeyError: 'time')")
    """
    if not isinstance(error, FORESEEN):
        return f"internal error, please report it ({type(error).__name__}: {' '.join(str(error).split())})"
    if isinstance(error, FileNotFoundError) and error.filename:
        return f"{error.filename}: no such file; check the name and the folder"
    if isinstance(error, OSError) and error.errno == EBADF:
        return "standard output is closed; open it, or name a file for the result"
    if isinstance(error, OSError) and error.strerror:
        return f"{error.filename or 'standard output'}: {error.strerror}"
    return (
        "there is not enough memory; give it more, or name fewer files"
        if isinstance(error, MemoryError)
        else str(error)
    )


def printable(text: str) -> str:
    r"""Escape what would break a line or command a terminal, in a name that comes from a file or a user.

    Letters of any language and blanks stay, and so do the lone surrogates that stand for bytes of a file name.

    Examples
    --------
    >>> printable("Gehäuse, IE"), printable("IE\n\x1b[31m")
    ('Gehäuse, IE', 'IE\\n\\x1b[31m')
    """
    if text.isprintable():
        return text
    import unicodedata

    return "".join(
        letter.encode("unicode_escape").decode()
        if unicodedata.category(letter) in UNSEEN
        else letter
        for letter in text
    )


def in_rows(ids: Iterable[int]) -> list[str]:
    """Write numbers in order, three and more in a row as a range.

    Examples
    --------
    >>> in_rows([6, 1, 2, 3, 5, 12])
    ['1-3', '5', '6', '12']
    """
    rows: list[list[int]] = []
    for number in sorted(set(ids)):
        if rows and rows[-1][-1] == number - 1:
            rows[-1].append(number)
        else:
            rows.append([number])
    return [
        text
        for row in rows
        for text in ([f"{row[0]}-{row[-1]}"] if len(row) > 2 else map(str, row))
    ]


def name_units(ids: Iterable[int], kind: str = "part") -> str:
    """Name parts briefly, of many the first ones.

    Examples
    --------
    >>> name_units([7]), name_units([3, 1, 2, 9])
    ('part 7', 'parts 1-3, 9')
    >>> name_units([*range(1, 41, 2), *range(100, 150)])
    'parts 1, 3, 5, 7, 9, 11, 13, 15, 17, 19, 21, 23, 25, 27, 29, 31, 33, 35, 37, 39 and 50 more'
    """
    every = sorted(set(ids))
    named = in_rows(every)[:_MOST_NAMED]
    left = (
        len(every) - bisect_right(every, int(named[-1].rpartition("-")[2]))
        if named
        else 0
    )
    return f"{kind}{'s' * (len(every) > 1)} {', '.join(named)}{f' and {left} more' * (left > 0)}"


def are(things: Collection[object]) -> str:
    """Give the verb of one thing, or of several."""
    return "is" if len(things) == 1 else "are"


def listing(
    names: Sequence[object], most: int = _MOST_NAMED, between: str = ", "
) -> str:
    """Name things in one line, printable, cut where they would fill the screen.

    Examples
    --------
    >>> listing([3, 7, 8]), listing([3, 7, 8], most=2), listing([3, 7], between=",")
    ('3, 7, 8', '3, 7 and 1 more', '3,7')
    """
    more = f" and {len(names) - most} more" if len(names) > most else ""
    return printable(between.join(map(str, names[:most]))) + more
