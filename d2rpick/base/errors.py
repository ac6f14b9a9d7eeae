"""Define one-line errors and warnings; each gives the place, the value found, the expected value, and the remedy."""

from __future__ import annotations

from bisect import bisect_right
from errno import EBADF
from typing import TYPE_CHECKING, Final, TypeVar

from d2rpick.base.tuples import NamedTuple

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Iterable, Sequence

# Unicode categories of the characters that are escaped: control and format characters, and line separators.
UNSEEN: Final = frozenset({"Cc", "Cf", "Zl", "Zp"})
_Read = TypeVar("_Read")
_MOST_NAMED: Final = 20  # Largest number of names that one message lists.

# Code of the warning that a bug in the program caused an input to be skipped.
INTERNAL_ERROR: Final = "internal-error"

# Advice for a file that is not of the format that was asked for.
CHOOSE_FORMAT: Final = (
    "leave `input_format` out to have the format recognised, or name another file"
)

# What a message says of a folder with the files of more than one run.
SEVERAL_RUNS: Final = "several runs"

# Advice for a file that ends within a state.
COPY_AGAIN: Final = "copy the file again, or let the run finish"


class D2RPickError(Exception):
    """Base class of all errors of d2rpick; its text is one line, ready to be shown to a user."""


class FormatError(D2RPickError):
    """A file cannot be read as an energy history."""


class EnergyChoiceError(FormatError):
    """A table does not show which of its ``columns`` is the internal energy, so the user has to choose one of them.

    ``columns`` are the numbers of the columns that may be meant, as values of the argument ``energy``.
    """

    def __init__(self, message: str, columns: tuple[str, ...]) -> None:
        super().__init__(message, columns)
        self.columns = columns

    def __str__(self) -> str:
        """Return the message alone."""
        return str(self.args[0])


class DamageError(FormatError):
    """A file contains a number that cannot be read, so it is damaged; the number was not left out by the solver."""


class ChangedError(D2RPickError):
    """A file was rewritten while it was read, so its content mixes two versions and cannot be used."""


class HistoryError(D2RPickError):
    """Numbers were read, but they are not a valid energy history."""


class RangeError(D2RPickError):
    """A time or a parameter lies outside the range that the history or the mechanics allow."""


class DeckError(D2RPickError):
    """A deck cannot be read, or a card cannot be written."""


class ArgumentError(TypeError, ValueError):
    """The arguments contradict each other; the message names the arguments in backticks."""


class ConfigurationError(D2RPickError):
    """The configuration of the deck check is wrong: an unknown rule, key or severity."""


class Caution(NamedTuple):
    """A warning for the user: a stable ``code`` for scripts, and a sentence."""

    code: str
    message: str


# Errors with a cause outside the program, e.g. invalid input, a full disk or too little memory.
FORESEEN: Final = (D2RPickError, OSError, MemoryError)


def give_if_written(read: Callable[[], _Read]) -> _Read | None:
    """Return the result of ``read``; None if the files lack the data for any state.

    Raises
    ------
    DamageError
        If the files contain the data, but one of the numbers cannot be read.
    """
    try:
        return read()
    except DamageError:
        raise
    except FormatError:
        return None


def give_if_readable(read: Callable[[], _Read]) -> _Read | None:
    """Return the result of ``read`` for a display; None if the files lack the data, or if the data are damaged."""
    try:
        return read()
    except FormatError:
        return None


def format_in_one_line(error: BaseException) -> str:
    """Return any error as a one-line message; for an unforeseen error, ask the user to report it.

    Examples
    --------
    >>> format_in_one_line(RangeError("run: td 9 lies outside the record")), format_in_one_line(KeyError("time"))
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
    if isinstance(error, MemoryError):
        return "there is not enough memory; give it more, or name fewer files"
    return str(error)


def make_printable(text: str) -> str:
    r"""Escape those characters of a name that would break a line or control a terminal.

    Letters of any language and blanks stay, as do the lone surrogates that stand for bytes of a file name.

    Examples
    --------
    >>> make_printable("Gehäuse, IE"), make_printable("IE\n\x1b[31m")
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


def format_ranges(ids: Iterable[int]) -> list[str]:
    """Format numbers in ascending order; three or more consecutive numbers are written as a range.

    Examples
    --------
    >>> format_ranges([6, 1, 2, 3, 5, 12])
    ['1-3', '5', '6', '12']
    """
    rows: list[list[int]] = []
    for number in sorted(set(ids)):
        if rows and rows[-1][-1] == number - 1:
            rows[-1].append(number)
        else:
            rows.append([number])
    texts: list[str] = []
    for row in rows:
        if len(row) > 2:
            texts.append(f"{row[0]}-{row[-1]}")
        else:
            texts += map(str, row)
    return texts


def name_units(ids: Iterable[int], kind: str = "part") -> str:
    """Return a short list of part ids for a message; a long list is cut and ends with the number of omitted ids.

    Examples
    --------
    >>> name_units([7]), name_units([3, 1, 2, 9])
    ('part 7', 'parts 1-3, 9')
    >>> name_units([*range(1, 41, 2), *range(100, 150)])
    'parts 1, 3, 5, 7, 9, 11, 13, 15, 17, 19, 21, 23, 25, 27, 29, 31, 33, 35, 37, 39 and 50 more'
    """
    numbers = sorted(set(ids))
    texts = format_ranges(numbers)[:_MOST_NAMED]
    unnamed = 0
    if texts:
        last_named = int(texts[-1].rpartition("-")[2])
        unnamed = len(numbers) - bisect_right(numbers, last_named)
    kinds = f"{kind}s" if len(numbers) > 1 else kind
    remainder = f" and {unnamed} more" if unnamed else ""
    return f"{kinds} {', '.join(texts)}{remainder}"


def choose_verb(things: Collection[object]) -> str:
    """Return "is" for one thing and "are" for several things."""
    return "is" if len(things) == 1 else "are"


def list_names(
    names: Sequence[object], most: int = _MOST_NAMED, between: str = ", "
) -> str:
    """Return printable names on one line; the list is cut after ``most`` names.

    Examples
    --------
    >>> list_names([3, 7, 8]), list_names([3, 7, 8], most=2), list_names([3, 7], between=",")
    ('3, 7, 8', '3, 7 and 1 more', '3,7')
    """
    remainder = f" and {len(names) - most} more" if len(names) > most else ""
    return make_printable(between.join(map(str, names[:most]))) + remainder
