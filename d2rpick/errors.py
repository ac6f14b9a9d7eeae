"""What can go wrong, in one line each: where, what was found, what was expected, what to do."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from collections.abc import Sequence

# Control and format characters (escape codes, text direction), line and paragraph separators.
UNSEEN: Final = frozenset({"Cc", "Cf", "Zl", "Zp"})


class D2RPickError(Exception):
    """Root of all errors of d2rpick; its text is one line, ready to be shown to a user."""


class FormatError(D2RPickError):
    """A file cannot be read as an energy history."""


class HistoryError(D2RPickError):
    """Numbers were read, but they do not make an energy history."""


class RangeError(D2RPickError):
    """A time or a parameter lies outside what the history or the mechanics allow."""


class DeckError(D2RPickError):
    """A deck cannot be read, or a card cannot be written."""


class ConfigurationError(D2RPickError):
    """The configuration of the deck check is wrong: an unknown rule, key or severity."""


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
        letter.encode("unicode_escape").decode() if unicodedata.category(letter) in UNSEEN else letter
        for letter in text
    )


def listing(names: Sequence[object], most: int = 20, between: str = ", ") -> str:
    """Name things in one line, printable, cut where they would fill the screen.

    Examples
    --------
    >>> listing([3, 7, 8]), listing([3, 7, 8], most=2), listing([3, 7], between=",")
    ('3, 7, 8', '3, 7 and 1 more', '3,7')
    """
    more = f" and {len(names) - most} more" if len(names) > most else ""
    return printable(between.join(map(str, names[:most]))) + more
