"""Command lines as a shell takes them, whatever the names in them are."""

from __future__ import annotations

import shlex
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence


def shell_line(words: Iterable[str]) -> str:
    r"""Quote words so that bash, zsh and POSIX shells of 2024 give them back, in printable characters.

    Examples
    --------
    >>> print(shell_line(["d2rpick", "info", "my run.csv", "it's\n\udcff"]))
    d2rpick info 'my run.csv' $'it\'s\012\377'
    """
    return " ".join(shlex.quote(word) if word.isprintable() else f"$'{''.join(map(_escaped, word))}'" for word in words)


def positional(names: Sequence[str]) -> tuple[str, ...]:
    """Give names as they are typed behind the options: behind ``--`` where one could be taken for an option.

    Examples
    --------
    >>> positional(["glstat", "-"]), positional(["-run.csv"])
    (('glstat', '-'), ('--', '-run.csv'))
    """
    return (*(["--"] if any(name.startswith("-") and name != "-" for name in names) else []), *names)


def _escaped(letter: str) -> str:
    if letter.isprintable():
        return f"\\{letter}" if letter in "\\'" else letter
    # Bytes of a file name that are no text come as lone surrogates.
    errors = "surrogateescape" if "\udc80" <= letter <= "\udcff" else "surrogatepass"
    # Three octal digits: of hexadecimal ones some shells take more than two, those of the name behind them.
    return "".join(f"\\{byte:03o}" for byte in letter.encode(errors=errors))
