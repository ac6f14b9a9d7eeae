"""Where the bytes of a history come from: files, folders, globs, standard input."""

from __future__ import annotations

import mmap
import os
import re
import sys
from typing import TYPE_CHECKING, NamedTuple

from d2rpick.errors import FormatError
from d2rpick.histories.names import listing

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

STDIN = "-"
Content = bytes | mmap.mmap

# What solvers call their databases in the folder of a run.
_DATABASE = re.compile(r"(?:(?i:binout[\d%]*|glstat|matsum)|(?P<root>.*)T\d\d)(?:\.gz)?")

# Standard input can be read only once; its bytes stay here for a later sha256("-").
_stdin = b""


class Source(NamedTuple):
    """The unpacked bytes of one file, mapped where it lies on a disk, under the name the user gave it.

    ``cut`` is True when packed data ends early: ``data`` is what could be unpacked.
    """

    name: str
    data: Content
    cut: bool = False


def expand(names: Sequence[str]) -> tuple[str, ...]:
    """Replace folders and globs by the files they hold, without changing the order otherwise.

    Of a folder only the databases of solvers count, and they must be of one run.

    Raises
    ------
    FormatError
        If a folder or glob holds none, or a folder the T01 files of several runs.
    """
    return tuple(dict.fromkeys(file for name in names for file in _files(name)))


def open_source(name: str) -> Source:
    """Read a file, or standard input for ``-``; what is gzipped is unpacked.

    Raises
    ------
    FormatError
        If there is nothing to be read under this name.
    """
    data: Content = _read_stdin() if name == STDIN else _mapped(name)
    cut = False
    if data[:2] == b"\x1f\x8b":
        data, cut = _unpacked(name, data)
    if not data:
        raise FormatError(f"{name}: the file is empty, an energy history was expected; was the run started?")
    return Source(name, data, cut)


def sha256(name: str) -> str:
    """SHA-256 of the bytes under this name, as they lie on the disk or came in by standard input.

    For ``-`` these are the bytes of the last history read from there.
    """
    import hashlib

    if name == STDIN:
        return hashlib.sha256(_stdin).hexdigest()
    with open(name, "rb") as file:  # noqa: PTH123
        return hashlib.file_digest(file, "sha256").hexdigest()


def _files(name: str) -> Sequence[str]:
    # os.path, not pathlib: start-up
    if name == STDIN or os.path.isfile(name):  # noqa: PTH113
        return [name]
    from pathlib import Path

    path = Path(name)
    try:
        is_folder = path.is_dir()
    except OSError:  # a name too long; what is wrong with it shows when it is opened
        return [name]
    if is_folder:
        return _databases(path)
    if any(sign in name for sign in "*?["):
        found = sorted(str(file) for file in Path(path.anchor).glob(name.removeprefix(path.anchor)) if file.is_file())
        if not found:
            raise FormatError(f"{name}: no file has such a name; check the folder")
        return found
    return [name]


def _databases(folder: Path) -> list[str]:
    matches = {file: _DATABASE.fullmatch(file.name) for file in sorted(folder.iterdir()) if file.is_file()}
    found = {file: match["root"] for file, match in matches.items() if match}
    if not found:
        raise FormatError(f"{folder}: no glstat, matsum, binout or T01 in this folder; name the file")
    runs = sorted({"one of LS-DYNA" if root is None else f"{root}T01" for root in found.values()})
    if len(runs) > 1:
        raise FormatError(
            f"{folder}: this folder holds several runs ({listing(runs, most=5)}), one was expected; "
            "name the files of one"
        )
    return [str(file) for file in found]


def _read_stdin() -> bytes:
    global _stdin  # noqa: PLW0603
    _stdin = sys.stdin.buffer.read()
    return _stdin


def _mapped(name: str) -> Content:
    try:
        with open(name, "rb") as file:  # noqa: PTH123
            try:
                return mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
            except (OSError, ValueError):  # empty, or a pipe
                return file.read()
    except FileNotFoundError:
        raise FormatError(f"{name}: no such file; check the name and the folder") from None
    except (OSError, ValueError) as error:  # ValueError: a NUL character in the name
        reason = getattr(error, "strerror", None) or error
        raise FormatError(f"{name}: cannot be read ({reason}); check the name and the permissions") from None


def _unpacked(name: str, data: Content) -> tuple[bytes, bool]:
    """Unpack what there is, of files that were packed one behind the other too; True when the last one ends early."""
    import zlib

    found, rest = [], bytes(data)
    while rest[:2] == b"\x1f\x8b":
        unpacker = zlib.decompressobj(wbits=31)  # 31: the gzip format
        try:
            found.append(unpacker.decompress(rest))
        except zlib.error as error:
            raise FormatError(f"{name}: gzip data that cannot be unpacked ({error}); copy the file again") from None
        if not unpacker.eof:
            return b"".join(found), True
        rest = unpacker.unused_data
    return b"".join(found), False
