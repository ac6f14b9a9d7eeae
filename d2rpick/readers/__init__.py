"""Readers of energy histories: one module per format, one table of formats.

A reader is a module with the two functions of `Reader`; a new format is a new module and a line in `READERS`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final, Protocol

from d2rpick.errors import FormatError
from d2rpick.readers import csv_table, glstat
from d2rpick.readers.source import Selection, Source, open_source, sha256

if TYPE_CHECKING:
    from collections.abc import Mapping

    from d2rpick.history import History

__all__ = ["READERS", "Reader", "Selection", "Source", "read_history", "sha256"]

# Enough of a file for its head and more than one state of the longest blocks.
_HEAD = 8192
_DEFAULT = Selection()


class Reader(Protocol):
    """What a module has to offer to be a reader."""

    def recognises(self, head: bytes) -> bool:
        """Whether a file that begins like this is of the reader's format; never raises."""

    def read(self, source: Source, selection: Selection) -> History:
        """Read what was selected; FormatError when that cannot be done for sure."""


# In the order they are asked: csv takes any text, so it comes last.
READERS: Final[Mapping[str, Reader]] = {"glstat": glstat, "csv": csv_table}


def read_history(name: str, selection: Selection = _DEFAULT, input_format: str = "auto") -> History:
    """Read one energy history.

    Parameters
    ----------
    name : str
        File name, or ``-`` for standard input.
    selection : Selection
        Time and energies to take; by default the time and the internal energy.
    input_format : str
        A key of `READERS`, or ``auto``: decided by the content, never by the name.

    Raises
    ------
    FormatError
        If the file cannot be read as an energy history, in one line.
    """
    source = open_source(name)
    if input_format != "auto":
        return READERS[input_format].read(source, selection)
    head = source.data[:_HEAD]
    for reader in READERS.values():
        if reader.recognises(head):
            return reader.read(source, selection)
    raise FormatError(
        f"{name}: binary data of no known format, one of {', '.join(READERS)} was expected; "
        "export the energy history as text"
    )
