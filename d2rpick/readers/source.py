"""Where the bytes of a history come from, what is to be taken from them, and what all readers share."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from d2rpick.errors import FormatError, HistoryError
from d2rpick.history import newest_states

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from d2rpick.history import Samples

STDIN = "-"

# Standard input can be read only once; its bytes stay here for a later sha256("-").
_stdin = b""


@dataclass(frozen=True)
class Selection:
    """What the user asked for: columns or labels by name, columns also by 1-based number.

    Nothing asked: each reader takes the time and the internal energy.  Several energies are added.
    """

    time: str | None = None
    energy: tuple[str, ...] = ()


@dataclass(frozen=True)
class Source:
    """The unpacked bytes of one file, under the name the user gave it."""

    name: str
    data: bytes


def open_source(name: str) -> Source:
    """Read a file, or standard input for ``-``; what is gzipped is unpacked.

    Raises
    ------
    FormatError
        If there is nothing to be read under this name.
    """
    data = _read_stdin() if name == STDIN else _read_file(name)
    if data.startswith(b"\x1f\x8b"):
        data = _unpacked(name, data)
    if not data:
        raise FormatError(f"{name}: the file is empty, an energy history was expected; was the run started?")
    return Source(name, data)


def sha256(name: str) -> str:
    """SHA-256 of the bytes under this name, as they lie on the disk or came in by standard input.

    For ``-`` these are the bytes of the last history read from there.
    """
    import hashlib

    return hashlib.sha256(_stdin if name == STDIN else _read_file(name)).hexdigest()


def states_that_count(name: str, time: Samples) -> tuple[NDArray[np.bool_], tuple[str, ...]]:
    """`newest_states`, with the file named in its error, and refused when there are no states at all."""
    if not time.size:
        raise FormatError(f"{name}: no states, a history has at least one; look whether the run wrote output")
    try:
        return newest_states(time)
    except HistoryError as error:
        raise FormatError(f"{name}: {error}") from None


def _read_stdin() -> bytes:
    global _stdin  # noqa: PLW0603
    _stdin = sys.stdin.buffer.read()
    return _stdin


def _read_file(name: str) -> bytes:
    try:
        return Path(name).read_bytes()
    except FileNotFoundError:
        raise FormatError(f"{name}: no such file; check the name and the folder") from None
    except IsADirectoryError:
        raise FormatError(f"{name}: this is a folder, a file was expected; name a file in it") from None
    except (OSError, ValueError) as error:  # ValueError: a NUL character in the name
        reason = getattr(error, "strerror", None) or error
        raise FormatError(f"{name}: cannot be read ({reason}); check the name and the permissions") from None


def _unpacked(name: str, data: bytes) -> bytes:
    import gzip
    import zlib

    try:
        return gzip.decompress(data)
    except (EOFError, OSError, zlib.error) as error:
        raise FormatError(f"{name}: gzip data that cannot be unpacked ({error}); copy the file again") from None
