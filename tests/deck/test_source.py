"""The places of keywords are the same in memory and on disk, for any size of pieces and number of threads."""

from __future__ import annotations

import builtins
import errno
import io
import os
import re
import time
from contextlib import contextmanager
from threading import Event, current_thread, main_thread
from typing import TYPE_CHECKING

import pytest
from hypothesis import given, strategies as st

from d2rpick.base.errors import DeckError
from d2rpick.base.files import FileState
from d2rpick.deck.source import SourceFile, find_marks
from d2rpick.deck.stored import DeckOnDisk, HeldInMemory

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from d2rpick.deck.stored import Filling

HEAD = b"-----BEGIN PGP MESSAGE"
MARK = b"\xef\xbb\xbf"
FRAGMENTS = [
    *(
        b"*",
        b" *",
        b"*END",
        b"*NODE\n",
        b"\n",
        b"\r\n",
        b"\n*",
        b" " * 20,
        b" " * 31 + b"*",
        b" " * 32 + b"*",
    ),
    *(
        HEAD,
        b"\n" + HEAD,
        HEAD[:9],
        HEAD[9:],
        b"G",
        b"$",
        MARK,
        b"1.5",
        b"-",
        b"x" * 70,
    ),
]
FILES = st.lists(st.sampled_from(FRAGMENTS), max_size=40).map(b"".join)


def find_marks_by_line(data: bytes) -> Iterator[int]:
    """Yield the offsets of keywords by checking every line."""
    start = len(MARK) if data.startswith(MARK) else 0
    for line in (
        data[start:].splitlines(keepends=True)
        if b"\r" not in data
        else re.split(rb"(?<=\n)", data[start:])
    ):
        if match := re.match(rb" {0,31}\*|" + HEAD, line):
            yield start + (match.end() - 1 if match[0].endswith(b"*") else 0)
        start += len(line)


def open_on_disk(file: Path, window: int = 64) -> DeckOnDisk:
    """Return a file that stays on disk and is read in small pieces."""
    with file.open("rb", buffering=0) as opened:
        return DeckOnDisk(str(file), FileState.of(opened), window)


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("marks") / "deck.k"


@given(FILES, st.integers(1, 90), st.integers(0, 3), st.integers(1, 80))
def test_pieces_and_threads_find_what_a_look_at_every_line_finds(
    file: Path, data: bytes, piece: int, helpers: int, window: int
) -> None:
    file.write_bytes(data)
    expected = [*find_marks_by_line(data)]
    assert [*find_marks(HeldInMemory(data))] == expected
    blocks = [
        (block.start, block.end, block.head, block.line, [*block.lines()])
        for block in SourceFile("held", data).blocks()
    ]
    disk_file = open_on_disk(file, window)
    for content in (disk_file, HeldInMemory(data)):
        assert [*find_marks(content, piece, alone=0, helpers=helpers)] == expected
    source = SourceFile(str(file), disk_file, piece)
    assert [*source.marks] == expected
    assert [
        (block.start, block.end, block.head, block.line, [*block.lines()])
        for block in source.blocks()
    ] == blocks


@given(FILES, st.integers(1, 40), st.integers(0, 90), st.none() | st.integers(0, 120))
def test_pieces_are_whole_lines(
    file: Path, data: bytes, size: int, start: int, end: int | None
) -> None:
    file.write_bytes(data)
    pieces = [
        *SourceFile(str(file), open_on_disk(file, 2 * size), size).pieces(start, end)
    ]
    assert b"".join(pieces) == data[start:end]
    assert all(piece.endswith(b"\n") for piece in pieces[:-1])
    assert all(pieces)


class Sparing(io.FileIO):
    """A file that returns three bytes per read."""

    def readinto(self, room: memoryview, /) -> int:  # type: ignore[override]
        return super().readinto(room[:3])


def test_a_call_of_the_system_that_gives_less_is_repeated(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "deck.k"
    path.write_bytes(b"0123456789")
    disk_file = open_on_disk(path, window=1)
    monkeypatch.delattr("os.preadv", raising=False)  # not every system has it
    monkeypatch.setattr(builtins, "open", lambda name, mode, **_: Sparing(name, mode))
    assert disk_file.read(1, 9) == b"12345678"
    os.truncate(path, 6)
    with pytest.raises(DeckError, match="rewritten"):
        disk_file.read(1, 9)


class Failing(HeldInMemory):
    """Bytes that can be read only up to an offset."""

    @contextmanager
    def opened(self) -> Iterator[Filling]:
        def failing(room: bytearray, begin: int, end: int) -> int:
            if begin > 300:
                raise OSError(errno.EIO, "Input/output error")
            return fill(room, begin, end)

        with super().opened() as fill:
            yield failing


def test_what_goes_wrong_in_a_thread_is_said() -> None:
    with pytest.raises(OSError, match="Input/output"):
        find_marks(Failing(b"*NODE\n" * 100), 64, alone=0)


def test_where_no_more_threads_are_allowed_one_searches_all(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def none_left(*_: object) -> None:
        raise RuntimeError("can't start new thread")

    monkeypatch.setattr("_thread.start_new_thread", none_left)
    assert [*find_marks(HeldInMemory(b"*NODE\n" * 100), 64, alone=0)] == [
        *range(0, 600, 6)
    ]


class Short(HeldInMemory):
    """Bytes for which only the main thread can allocate memory."""

    @contextmanager
    def opened(self) -> Iterator[Filling]:
        if current_thread() is not main_thread():
            raise MemoryError
        with super().opened() as fill:
            yield fill


def test_what_a_thread_has_no_memory_for_the_first_one_searches(
    capfd: pytest.CaptureFixture[str],
) -> None:
    assert [*find_marks(Short(b"*NODE\n" * 100), 64, alone=0, helpers=3)] == [
        *range(0, 600, 6)
    ]
    assert capfd.readouterr() == ("", "")


class Counting(HeldInMemory):
    """Bytes that count how many of them are read."""

    asked = 0

    @contextmanager
    def opened(self) -> Iterator[Filling]:
        def counting(room: bytearray, begin: int, end: int) -> int:
            self.asked += end - begin
            return fill(room, begin, end)

        with super().opened() as fill:
            yield counting


def test_lines_are_counted_once_in_whatever_order_they_are_asked_for() -> None:
    text = b"*NODE\n1\n" * 500
    file = Counting(text)
    blocks = [*SourceFile("deck.k", file).blocks()]
    file.asked = 0
    assert blocks[-1].line == 999
    assert [block.line for block in blocks] == [*range(1, 1000, 2)]
    assert file.asked < 3 * len(text)


class Interrupted(HeldInMemory):
    """Bytes whose read interrupts the main thread."""

    def __init__(self, data: bytes) -> None:
        super().__init__(data)
        self.interrupted, self.searched = Event(), 0

    @contextmanager
    def opened(self) -> Iterator[Filling]:
        def interrupted(room: bytearray, begin: int, end: int) -> int:
            if current_thread() is main_thread():
                self.interrupted.set()
                raise KeyboardInterrupt
            self.interrupted.wait()
            time.sleep(0.001)
            self.searched += 1
            return fill(room, begin, end)

        with super().opened() as fill:
            yield interrupted


def test_no_thread_goes_on_where_a_search_is_interrupted() -> None:
    file = Interrupted(b"*NODE\n" * 200)
    with pytest.raises(KeyboardInterrupt):
        find_marks(file, 1, alone=0)
    assert file.searched < 600
