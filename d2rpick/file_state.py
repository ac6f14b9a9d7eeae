"""Files that others may be writing: what tells that one has changed, and whether a change would show."""

from __future__ import annotations

import os
import stat
import time
from typing import TYPE_CHECKING, Final, NamedTuple

if TYPE_CHECKING:
    from io import FileIO

TRIES: Final = 5  # looks at a file that changes all the time
_TICK: Final = 50_000_000  # [ns] above the resolution of any file's times: later changes show in them
PAUSE: Final = 0.05  # [s] for a write that may be under way: until it ends, half of it stands in the file


class FileState(NamedTuple):
    """What tells whether a file has changed; ``settled`` when a change after it would have shown."""

    device: int
    inode: int
    size: int
    modified: int
    changed: int
    settled: bool

    @classmethod
    def of(cls, file: FileIO) -> FileState:
        """Look at a file as it is now."""
        found = os.fstat(file.fileno())
        settled = time.time_ns() - max(found.st_mtime_ns, found.st_ctime_ns) > _TICK
        return cls(found.st_dev, found.st_ino, found.st_size, found.st_mtime_ns, found.st_ctime_ns, settled)

    def is_as(self, other: FileState) -> bool:
        """Whether this is the same file, and nothing that shows has changed."""
        return self[:-1] == other[:-1]


def pause() -> None:
    """Wait for the end of a write that may be under way."""
    time.sleep(PAUSE)


def is_endless(file: FileIO) -> bool:
    """Whether a file is a device other than a terminal: /dev/zero and /dev/full never end."""
    return stat.S_ISCHR(os.fstat(file.fileno()).st_mode) and not file.isatty()


def is_regular(file: FileIO) -> bool:
    """Whether a file can be read again, unlike a pipe or a terminal."""
    return stat.S_ISREG(os.fstat(file.fileno()).st_mode)


def settled_state(file: FileIO) -> FileState | None:
    """State of a file in which a later change will show; None where it changes all the time."""
    for _ in range(TRIES):
        found = FileState.of(file)
        if found.settled:
            return found
        pause()
        if FileState.of(file).is_as(found):
            return found
    return None
