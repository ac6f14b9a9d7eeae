"""Read files within size limits, detect changes during reading, and replace files atomically.

Lines of JSON that a program resumes from have a checksum, so that a damaged line is recognised.
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

STDIN: Final = "-"  # File name that stands for standard input.
# Limits on the content of a file, each with its default and its unit.
_BOUNDS: Final = {
    "RATIO": (
        100.0,
        "times as many bytes",
    ),  # Largest ratio of unpacked to packed size; real files have a ratio of 3 to 30.
    # Largest unpacked size [bytes], which is limited because unpacked data are kept in memory.
    "UNPACKED": (4e9, "bytes"),
    "LINE": (
        1e6,
        "bytes",
    ),  # Largest length of a line [bytes], which is enough for about 50,000 columns.
    "DEPTH": (100.0, "groups"),
}
# The ratio of unpacked to packed size is checked above this unpacked size [bytes]; constant columns reach 1000.
_ALLOWED: Final = 1 << 24
_TRIES: Final = 5  # Number of attempts to read a file that keeps changing.
_TICK: Final = 50_000_000  # Resolution of the file times on most file systems [ns].
# Resolution of file times on file systems that store whole seconds [ns].
_COARSE: Final = 2_000_000_000
# Longest time that is needed to write a byte [ns]; a system may set the file time when the last write begins.
_SLOWEST: Final = 5
# Pause before rereading a file that another process may still be writing [s].
_PAUSE: Final = 0.05
_CHECKSUM: Final = ', "checksum": "'


class Searched(Protocol):
    """An object of bytes that can be searched backwards for a marker."""

    def __len__(self) -> int: ...

    def rfind(self, wanted: bytes, begin: int, end: int, /) -> int:
        """Return the offset of the last occurrence of ``wanted`` between two offsets, or -1 if there is none."""


def bound(name: str) -> float:
    """Return a limit; raise D2RPickError if the environment sets it to something other than a positive number."""
    variable = f"D2RPICK_MAX_{name}"
    text = os.environ.get(variable)
    try:
        value = _BOUNDS[name][0] if text is None else float(text)
    except ValueError:
        value = 0.0
    if not value > 0:
        raise D2RPickError(
            f"{variable} is {text!r}, but a number above 0 was expected; correct it or leave it out"
        )
    return value


def describe_excess(name: str, value: float = float("inf")) -> str:
    """Return a message with the remedy if a value exceeds its limit; otherwise return an empty string.

    Examples
    --------
    >>> describe_excess("DEPTH", 101), describe_excess("DEPTH", 100)
    ('more than 100 groups; is the file damaged? Copy it again, or set D2RPICK_MAX_DEPTH higher', '')
    """
    limit = bound(name)
    if value <= limit:
        return ""
    excess = f"more than {limit:,.10g} {_BOUNDS[name][1]}"
    return f"{excess}; is the file damaged? Copy it again, or set D2RPICK_MAX_{name} higher"


def describe_unpacked_excess(packed: int, unpacked: int) -> str:
    """Return a message if ``packed`` bytes unpack to more bytes than the limits allow; otherwise return ""."""
    ratio = unpacked / max(packed, 1) if unpacked > _ALLOWED else 0.0
    return describe_excess("UNPACKED", unpacked) or describe_excess("RATIO", ratio)


def find_long_line(data: bytes | Searched, most: float | None = None) -> int:
    r"""Return the offset of a line that exceeds the length limit, or -1; only a part of the data is examined.

    ``most`` is the bound, if it is known already.

    Examples
    --------
    >>> find_long_line(b"ab\n" * 9), find_long_line(b"ab\n" + bytes(1_000_001))
    (-1, 3)
    """
    limit = int(min(bound("LINE") if most is None else most, len(data)))
    begin = 0
    while begin + limit < len(data):
        end = data.rfind(b"\n", begin, begin + limit + 1) + 1
        if not end:
            return begin
        begin = end
    return -1


class FileState(NamedTuple):
    """Identity, size and times of a file.

    If ``settled``, no write is pending, and any later write would change them.
    """

    device: int
    inode: int
    size: int
    modified: int
    changed: int
    settled: bool

    @classmethod
    def of(cls, file: FileIO) -> FileState:
        """Return the current state of an open file."""
        return cls.of_stat(os.fstat(file.fileno()))

    @classmethod
    def of_stat(cls, status: os.stat_result, *, may_grow: bool = False) -> FileState:
        """Return the current state of a file from the status that the operating system reports.

        A write in progress to a file that ``may_grow`` appends to it, so that its size does not matter.
        """
        now = time.time_ns()
        # A modification time in the future is ignored, because programs can set it to any value.
        latest = max(
            status.st_ctime_ns, status.st_mtime_ns if status.st_mtime_ns <= now else 0
        )
        settled = now - latest > _TICK + compute_slowness(
            latest, 0 if may_grow else status.st_size
        )
        return cls(
            status.st_dev,
            status.st_ino,
            status.st_size,
            status.st_mtime_ns,
            status.st_ctime_ns,
            settled,
        )

    def is_as(self, earlier: FileState) -> bool:
        """Return True if this is the same file without any change."""
        return self[:-1] == earlier[:-1]

    def continues(self, earlier: FileState) -> bool:
        """Return True if this is the same file, which may have grown. A new file can reuse an old inode number."""
        return self.is_as(earlier) or (
            self[:2] == earlier[:2] and self.size > earlier.size
        )


def compute_slowness(changed: int, size: int) -> int:
    """Return the extra time for which a file must be unchanged [ns]; large files and coarse time stamps need more."""
    return _SLOWEST * size + (0 if changed % 1_000_000_000 else _COARSE)


def wait_for_settled_state(file: FileIO, *, may_grow: bool = False) -> FileState | None:
    """Return the state of a file after all pending writes; None if the file keeps changing.

    If the file ``may_grow``, the bytes up to the size of this state do not change: further bytes are appended.
    """
    for _ in range(_TRIES):
        state = FileState.of(file)
        if state.settled:
            return state
        time.sleep(
            _PAUSE
            + compute_slowness(state.changed, 0 if may_grow else state.size) * 1e-9
        )
        now = FileState.of(file)
        if now.is_as(state) or (may_grow and now.continues(state)):
            return state
    return None


def wait_for_settled_states(
    names: Sequence[str], error: type[D2RPickError]
) -> list[FileState]:
    """Return the settled states of growing files after a single pause; raise ``error`` if a file keeps changing."""
    states = [_state_of(name) for name in names]
    for _ in range(_TRIES):
        moving = [state for state in states if not state.settled]
        if not moving:
            return states
        time.sleep(
            _PAUSE + max(compute_slowness(state.changed, 0) for state in moving) * 1e-9
        )
        states = [
            _settle(name, state) for name, state in zip(names, states, strict=True)
        ]
    for name, state in zip(names, states, strict=True):
        if not state.settled:
            raise error(
                f"{name}: the file keeps changing while it is read; read it again when it is complete"
            )
    return states


def _settle(name: str, state: FileState) -> FileState:
    """Return the state of a file, which is settled if the file has only grown since ``state`` was read."""
    now = state if state.settled else _state_of(name)
    return state._replace(settled=True) if now.continues(state) else now


def _state_of(name: str) -> FileState:
    """Return the current state of a file that may grow."""
    return FileState.of_stat(os.stat(name), may_grow=True)  # noqa: PTH116  os.stat is faster for many files


def read_into(file: FileIO, room: memoryview, begin: int) -> int:
    """Fill ``room`` with the bytes of a file after an offset; return the number of bytes read (fewer at its end)."""
    done = 0
    while done < len(room):
        # One call may return fewer bytes than requested, and never returns more than 2 GB.
        count = _read_once(file, room[done:], begin + done)
        if not count:
            break
        done += count
    return done


def _read_once(file: FileIO, room: memoryview, begin: int) -> int:
    """Read bytes from an offset into ``room``, if possible in a single system call, and return their number."""
    if hasattr(os, "preadv"):
        return os.preadv(file.fileno(), [room], begin)
    file.seek(begin)
    return file.readinto(room)


def read_at_rest(
    name: str, file: FileIO, error: type[D2RPickError], *, may_grow: bool = False
) -> FileState | bytes:
    """Return the settled state of a file, or all bytes of a pipe or terminal, which can be read only once.

    Raise ``error`` if the file keeps changing, or is another device: /dev/zero and /dev/full never end.
    """
    mode = os.fstat(file.fileno()).st_mode
    if stat.S_ISCHR(mode) and not file.isatty():
        raise error(
            f"{name}: this is a device; a file, a pipe or a terminal was expected"
        )
    if not stat.S_ISREG(mode):
        return file.read()
    state = wait_for_settled_state(file, may_grow=may_grow)
    if state is None:
        raise error(
            f"{name}: the file keeps changing while it is read; read it again when it is complete"
        )
    return state


def write_as_a_whole(path: Path, content: bytes) -> None:
    """Write a file completely or not at all: write the data to a temporary file, which then replaces the old file.

    A replaced file keeps its mode, and its owner and group as far as the user may set them. A link stays, and the
    file to which it points is replaced; a device or a named pipe is written to.
    """
    import tempfile

    if path.exists() and not path.is_file():
        path.write_bytes(content)
        return
    try:
        path = path.resolve()
    except RuntimeError:  # Python before 3.13, for links that form a loop
        path = path.absolute()
    # If resolve() still returns a link, this link is part of a loop.
    if path.is_symlink():
        raise OSError(ELOOP, os.strerror(ELOOP), str(path))
    # The temporary name is not derived from the file name, which may already have the maximum length.
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
    """Copy owner, group and mode of the file that will be replaced; if there is none, use the default mode."""
    try:
        status = replaced.stat()
    except FileNotFoundError:
        mask = os.umask(0)
        os.umask(mask)
        # mkstemp creates files that only their owner can access.
        scratch.chmod(0o666 & ~mask)
        return
    if hasattr(os, "chown"):
        with suppress(PermissionError):
            os.chown(scratch, status.st_uid, status.st_gid)
    # The mode is set after the owner, because a change of owner clears the set-user-id bits.
    scratch.chmod(stat.S_IMODE(status.st_mode))


def append_as_a_whole(path: Path, content: bytes, *, durable: bool = False) -> None:
    """Append all data to a file, or leave the file as it was and raise OSError; ``durable`` waits for the disk."""
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


def add_checksum(text: str) -> str:
    """Add a checksum to a JSON object as its last key.

    Examples
    --------
    >>> parse_record(add_checksum('{"leg": 1}').encode())["leg"], parse_record(b'{"leg": 1}')
    (1, None)
    """
    return f'{text[:-1]}{_CHECKSUM}{_compute_checksum(text[:-1].encode())}"}}'


def parse_record(line: bytes) -> dict[str, Any] | None:
    """Return the record in a line with a checksum; None if the line is damaged."""
    body, _, checksum = line.rpartition(_CHECKSUM.encode())
    if checksum != f'{_compute_checksum(body)}"}}'.encode():
        return None
    import json  # Imported here to keep start-up fast.

    record: dict[str, Any] = json.loads(line)
    return record


def _compute_checksum(text: bytes) -> str:
    """Return a short checksum of a string."""
    import hashlib

    return hashlib.sha256(text).hexdigest()[:16]
