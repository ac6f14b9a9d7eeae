"""Files of anyone: how much one may hold, whether it changes while it is read, and a new one put in its place.

Lines of JSON have a checksum where a program goes on from them, so that a damaged one is never taken for another.
"""

from __future__ import annotations

import os
import stat
import time
from contextlib import suppress
from errno import ELOOP
from typing import TYPE_CHECKING, Any, Final, Protocol

from d2rpick.base.errors import D2RPickError
from d2rpick.base.tuples import NamedTuple

if TYPE_CHECKING:
    from collections.abc import Sequence
    from io import FileIO
    from pathlib import Path


class Searched(Protocol):
    """Bytes in which something can be looked for."""

    def __len__(self) -> int: ...

    def rfind(self, wanted: bytes, begin: int, end: int, /) -> int:
        """Place of the last ``wanted`` there, -1 where there is none."""


STDIN: Final = "-"  # name of what was read from standard input
# The largest value of each, and what it counts.
_BOUNDS: Final = {
    "RATIO": (100.0, "times as many bytes"),  # histories become 3 to 30 times as many
    "UNPACKED": (4e9, "bytes"),  # they are held in memory
    "LINE": (1e6, "bytes"),  # some 50,000 columns
    "DEPTH": (100.0, "groups"),
}
# Constant columns pack a thousandfold: the ratio counts only above so many bytes, which take no time and little memory.
_ALLOWED: Final = 1 << 24


def bound(name: str) -> float:
    """Largest value that is allowed; D2RPickError where the environment sets one that is no number above 0."""
    variable = f"D2RPICK_MAX_{name}"
    text = os.environ.get(variable)
    try:
        value = _BOUNDS[name][0] if text is None else float(text)
    except ValueError:
        value = 0.0
    if not value > 0:
        raise D2RPickError(
            f"{variable} is {text!r}, a number above 0 was expected; correct it or leave it out"
        )
    return value


def beyond(name: str, value: float = float("inf")) -> str:
    """Say by what a value is above its bound, and what to do; nothing where it is not.

    Examples
    --------
    >>> beyond("DEPTH", 101), beyond("DEPTH", 100)
    ('more than 100 groups; is the file damaged? Copy it again, or set D2RPICK_MAX_DEPTH higher', '')
    """
    most = bound(name)
    if value <= most:
        return ""
    what = f"more than {most:,.10g} {_BOUNDS[name][1]}"
    return (
        f"{what}; is the file damaged? Copy it again, or set D2RPICK_MAX_{name} higher"
    )


def unpacked_beyond(packed: int, unpacked: int) -> str:
    """Say the same of data of so many bytes that become so many."""
    ratio = unpacked / max(packed, 1) if unpacked > _ALLOWED else 0.0
    return beyond("UNPACKED", unpacked) or beyond("RATIO", ratio)


def long_line(data: bytes | Searched, most: float | None = None) -> int:
    r"""Where a line beyond the bound begins, -1 where there is none; of the others little is looked at.

    ``most`` is the bound, where it is known already.

    Examples
    --------
    >>> long_line(b"ab\n" * 9), long_line(b"ab\n" + bytes(1_000_001))
    (-1, 3)
    """
    begin, most = 0, int(min(bound("LINE") if most is None else most, len(data)))
    while begin + most < len(data):
        end = data.rfind(b"\n", begin, begin + most + 1) + 1
        if not end:
            return begin
        begin = end
    return -1


_TRIES: Final = 5  # looks at a file that changes all the time
_TICK: Final = 50_000_000  # [ns] above the resolution of most files' times: later changes show in them
_COARSE: Final = (
    2_000_000_000  # [ns] the resolution of the others, which give whole seconds
)
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
        return cls.of_stat(os.fstat(file.fileno()))

    @classmethod
    def of_stat(cls, found: os.stat_result, *, may_grow: bool = False) -> FileState:
        """Take from what the system tells just now.

        Of a file that ``may_grow`` a write that is under way goes on behind the size that it has.
        """
        now = time.time_ns()
        # Of the two times the modification can be set, to one in the future too, which would never be past.
        latest = max(
            found.st_ctime_ns, found.st_mtime_ns if found.st_mtime_ns <= now else 0
        )
        settled = now - latest > _TICK + _slowness(
            latest, 0 if may_grow else found.st_size
        )
        return cls(
            found.st_dev,
            found.st_ino,
            found.st_size,
            found.st_mtime_ns,
            found.st_ctime_ns,
            settled,
        )

    def is_as(self, other: FileState) -> bool:
        """Whether this is the same file, and nothing that shows has changed."""
        return self[:-1] == other[:-1]

    def continues(self, earlier: FileState) -> bool:
        """Whether this is the earlier one, or has grown since; a new file may take an old one's number."""
        return self.is_as(earlier) or (
            self[:2] == earlier[:2] and self.size > earlier.size
        )


def _slowness(changed: int, size: int) -> int:
    """How much longer than usual a write may last, or a change not show in the times [ns]."""
    return _SLOWEST * size + (0 if changed % 1_000_000_000 else _COARSE)


def settled_state(file: FileIO, *, may_grow: bool = False) -> FileState | None:
    """State of a file when no write is under way and a later one will show; None where it changes all the time.

    Of one that ``may_grow`` the bytes up to the size of this state are at rest: what is appended does not touch them.
    """
    for _ in range(_TRIES):
        found = FileState.of(file)
        if found.settled:
            return found
        time.sleep(
            _PAUSE + _slowness(found.changed, 0 if may_grow else found.size) * 1e-9
        )
        now = FileState.of(file)
        if now.is_as(found) or (may_grow and now.continues(found)):
            return found
    return None


def settled_states(names: Sequence[str], error: type[D2RPickError]) -> list[FileState]:
    """States of many files that may grow, as `settled_state`, with one pause for all; ``error`` where one changes."""
    states = [_state_of(name) for name in names]
    for _ in range(_TRIES):
        moving = [found for found in states if not found.settled]
        if not moving:
            return states
        time.sleep(_PAUSE + max(_slowness(found.changed, 0) for found in moving) * 1e-9)
        looks = [
            (found, found if found.settled else _state_of(name))
            for name, found in zip(names, states, strict=True)
        ]
        states = [
            found._replace(settled=True) if now.continues(found) else now
            for found, now in looks
        ]
    name = next(
        (name for name, found in zip(names, states, strict=True) if not found.settled),
        None,
    )
    if name is not None:
        raise error(
            f"{name}: the file keeps changing while it is read; read it again when it is complete"
        )
    return states


def _state_of(name: str) -> FileState:
    return FileState.of_stat(os.stat(name), may_grow=True)  # noqa: PTH116  of many files


def at_rest(
    name: str, file: FileIO, error: type[D2RPickError], *, may_grow: bool = False
) -> FileState | bytes:
    """Give the `settled_state` of a file, or all bytes of a pipe or a terminal, which are read once.

    An ``error`` is raised where it changes all the time, or is another device: /dev/zero and /dev/full never end.
    """
    mode = os.fstat(file.fileno()).st_mode
    if stat.S_ISCHR(mode) and not file.isatty():
        raise error(
            f"{name}: this is a device; a file, a pipe or a terminal was expected"
        )
    if not stat.S_ISREG(mode):
        return file.read()
    state = settled_state(file, may_grow=may_grow)
    if state is None:
        raise error(
            f"{name}: the file keeps changing while it is read; read it again when it is complete"
        )
    return state


def write_whole(path: Path, content: bytes) -> None:
    """Write a file whole or not at all: into a temporary file beside it, which then takes its name.

    A file that is replaced keeps its mode, and its owner and group as far as the user may set them.  A link stays, and
    the file it points to is replaced; a device or a named pipe is written to.
    """
    import tempfile

    if path.exists() and not path.is_file():
        path.write_bytes(content)
        return
    try:
        path = path.resolve()
    except RuntimeError:  # a loop of links, before Python 3.13
        path = path.absolute()
    if path.is_symlink():  # what is left of it
        raise OSError(ELOOP, os.strerror(ELOOP), str(path))
    # The name of the file may be as long as the file system allows: a longer one cannot be made of it.
    handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=".d2rpick-")
    scratch = path.parent / temporary
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(content)
        _copy_access(path, scratch)
        scratch.replace(path)
    except BaseException:
        scratch.unlink(missing_ok=True)
        raise


def _copy_access(replaced: Path, scratch: Path) -> None:
    """Give a new file the owner, group and mode of the one that it will replace; else the mode of any new file."""
    try:
        status = replaced.stat()
    except FileNotFoundError:
        mask = os.umask(0)
        os.umask(mask)
        scratch.chmod(0o666 & ~mask)  # mkstemp gives the owner alone access
        return
    if hasattr(os, "chown"):
        with suppress(PermissionError):
            os.chown(scratch, status.st_uid, status.st_gid)
    scratch.chmod(
        stat.S_IMODE(status.st_mode)
    )  # after the owner, whose change takes away the bits of set-user-id


def append_whole(path: Path, content: bytes, *, durable: bool = False) -> None:
    """Append to a file whole or not at all, when ``durable`` onto the disk; an OSError leaves it as it was."""
    size = None
    try:
        with path.open("ab") as file:
            size = file.tell()
            file.write(content)
            file.flush()
            if durable:
                os.fsync(file.fileno())
    except OSError:
        with suppress(OSError):
            if size:
                os.truncate(path, size)
            elif size == 0:
                path.unlink()
        raise


_CHECKSUM: Final = ', "checksum": "'


def signed(text: str) -> str:
    """Add a checksum to a JSON object, its last key.

    Examples
    --------
    >>> record_of(signed('{"leg": 1}').encode())["leg"], record_of(b'{"leg": 1}')
    (1, None)
    """
    return f'{text[:-1]}{_CHECKSUM}{_checksum(text[:-1].encode())}"}}'


def record_of(line: bytes) -> dict[str, Any] | None:
    """Record of a line as it was written; None for a damaged one."""
    body, _, checksum = line.rpartition(_CHECKSUM.encode())
    if checksum != f'{_checksum(body)}"}}'.encode():
        return None
    import json  # not above: start-up

    record: dict[str, Any] = json.loads(line)
    return record


def _checksum(text: bytes) -> str:
    import hashlib

    return hashlib.sha256(text).hexdigest()[:16]
