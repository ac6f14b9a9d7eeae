"""Files that others may be writing or reading: what one held at a single moment, and a new one put in its place."""

from __future__ import annotations

import os
import stat
import time
from errno import ELOOP
from typing import TYPE_CHECKING, Final, NamedTuple

if TYPE_CHECKING:
    from io import FileIO
    from pathlib import Path

_TRIES: Final = 5  # looks at a file that changes all the time
_TICK: Final = 50_000_000  # [ns] above the resolution of most files' times: later changes show in them
_COARSE: Final = 2_000_000_000  # [ns] the resolution of the others, which give whole seconds
_SLOWEST: Final = 5  # [ns] for a byte that is written: the times of a file are those when its last write began
_PAUSE: Final = 0.05  # [s] for a write that may be under way: until it ends, half of it stands in the file


class FileState(NamedTuple):
    """What tells whether a file has changed; ``settled`` when no write is under way and one after it would show."""

    device: int
    inode: int
    size: int
    modified: int
    changed: int
    settled: bool

    @classmethod
    def of(cls, file: FileIO) -> FileState:
        """Look at a file as it is now."""
        return cls.told(os.fstat(file.fileno()))

    @classmethod
    def told(cls, found: os.stat_result) -> FileState:
        """Take from what the system tells just now."""
        now = time.time_ns()
        # Of the two times the modification can be set, to one in the future too, which would never be past.
        latest = max(found.st_ctime_ns, found.st_mtime_ns if found.st_mtime_ns <= now else 0)
        settled = now - latest > _TICK + _slowness(latest, found.st_size)
        return cls(found.st_dev, found.st_ino, found.st_size, found.st_mtime_ns, found.st_ctime_ns, settled)

    def is_as(self, other: FileState) -> bool:
        """Whether this is the same file, and nothing that shows has changed."""
        return self[:-1] == other[:-1]

    def continues(self, earlier: FileState) -> bool:
        """Whether this is the earlier one, or has grown since; a new file may take an old one's number."""
        return self.is_as(earlier) or (self[:2] == earlier[:2] and self.size > earlier.size)


def _slowness(changed: int, size: int) -> int:
    """How much longer than usual a write may last, or a change not show in the times [ns]."""
    return _SLOWEST * size + (0 if changed % 1_000_000_000 else _COARSE)


def is_endless(file: FileIO) -> bool:
    """Whether a file is a device other than a terminal: /dev/zero and /dev/full never end."""
    return stat.S_ISCHR(os.fstat(file.fileno()).st_mode) and not file.isatty()


def is_regular(file: FileIO) -> bool:
    """Whether a file can be read again, unlike a pipe or a terminal."""
    return stat.S_ISREG(os.fstat(file.fileno()).st_mode)


def settled_state(file: FileIO, *, may_grow: bool = False) -> FileState | None:
    """State of a file when no write is under way and a later one will show; None where it changes all the time.

    Of one that ``may_grow`` the bytes up to the size of this state are at rest: what is appended does not touch them.
    """
    for _ in range(_TRIES):
        found = FileState.of(file)
        if found.settled:
            return found
        time.sleep(_PAUSE + _slowness(found.changed, 0 if may_grow else found.size) * 1e-9)
        now = FileState.of(file)
        if now.is_as(found) or (may_grow and now.continues(found)):
            return found
    return None


def write_whole(path: Path, content: bytes) -> None:
    """Write a file whole or not at all: into a temporary file beside it, which then takes its name.

    A link stays, and the file it points to is replaced; a device or a named pipe is written to.
    """
    import tempfile

    if path.exists() and not path.is_file():
        path.write_bytes(content)
        return
    try:
        path = path.resolve()
    except RuntimeError:  # a loop of links, before Python 3.13
        raise OSError(ELOOP, os.strerror(ELOOP), str(path)) from None
    handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
    scratch = path.parent / temporary
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(content)
        mask = os.umask(0)
        os.umask(mask)
        scratch.chmod(0o666 & ~mask)  # mkstemp gives the owner alone access
        scratch.replace(path)
    except BaseException:
        scratch.unlink(missing_ok=True)
        raise
