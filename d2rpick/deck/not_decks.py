"""Recognise energy histories that were given in place of a deck, by the first bytes of their formats."""

from __future__ import annotations

import re
from typing import Final

from d2rpick.base.errors import DeckError

_GZIP: Final = b"\x1f\x8b"
# Binary histories; the patterns are those by which d2rpick.histories recognises the formats.
_BINARY: Final = (
    (rb"[\x08-\x40].{5}\0", "a binout of LS-DYNA"),
    (rb"\0\0\0T", "a T01 of Radioss"),
    (rb"\x89HDF", "an HDF5 file"),
)
# Text histories. A deck may contain these words, so they are searched only in a file without keywords.
_TEXT: Final = (
    (rb"(?m)^ mat\.#=", "a matsum of LS-DYNA"),
    (rb"(?m)^ time\.{5}", "a glstat of LS-DYNA"),
    (rb"ZZZZZEOR", "a T01 of Radioss"),
    # At least two lines that begin with two numbers, without the comments of a deck, which may begin with a table.
    (
        rb"(?m)\A(?!(?s:.*)^[#$])(?s:.*?)(?:^[ \t]*[-+.\d][-+.\deE]*[ \t]*[,;\t ][ \t]*[-+.\d].*\r?\n){2}",
        "a table of numbers",
    ),
)
# The option `run` names a history on the command line and in Python.
_CURE: Final = (
    "but a deck was expected; give the main deck of the run, and this file as `run`"
)


def refuse_binary_history(name: str, head: bytes) -> None:
    """Raise DeckError if a file with these first bytes is a binary history."""
    for pattern, title in _BINARY:
        if b"\0" in head and re.match(pattern, head, re.DOTALL):
            raise DeckError(f"{name}: this is {title}, {_CURE}")


def refuse_text_history(name: str, head: bytes) -> None:
    """Raise DeckError if a file without keywords that begins with these bytes is a text history."""
    for pattern, title in _TEXT:
        if re.search(pattern, head):
            raise DeckError(f"{name}: this is {title}, {_CURE}")


def refuse_packed(name: str, head: bytes) -> None:
    """Raise DeckError if a file is compressed, with the name of the format if it contains a history."""
    if not head.startswith(_GZIP):
        return
    import zlib  # Imported here to keep start-up fast.

    try:
        content = zlib.decompressobj(wbits=zlib.MAX_WBITS | 16).decompress(
            head, len(head)
        )
    except zlib.error:
        content = b""
    refuse_binary_history(name, content)
    if not re.search(rb"(?m)^(?:\*|/)[A-Za-z]", content):
        refuse_text_history(name, content)
    raise DeckError(f"{name}: the deck is compressed with gzip; unpack it")
