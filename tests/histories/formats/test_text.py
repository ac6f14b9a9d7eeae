"""The lines of a text, of a big one that stays on its disk as of one in memory."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from d2rpick.errors import ChangedError
from d2rpick.histories import content
from d2rpick.histories.content import OnDisk, stored
from d2rpick.histories.formats import text
from d2rpick.histories.formats.text import Text
from d2rpick.histories.source import Source

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

CONTENTS = st.lists(st.sampled_from([b"0.125,17", b"\n", b"\r\n", b"\xc2\xb5s", b"\xb5", b""]), max_size=40).map(
    b"".join
)


@pytest.fixture
def small_pieces(monkeypatch: pytest.MonkeyPatch) -> None:
    """Leave every file on its disk, and take texts apart in small pieces."""
    for module, name, size in (
        (content, "_HELD", 0),
        (content, "_NEAR", 8),
        (content, "_WINDOW", 16),
        (text, "_PIECE", 16),
        (text, "_SHORT", 32),
        (text, "_SAMPLE", 3),
        (text, "HEAD", 5),
    ):
        monkeypatch.setattr(module, name, size)


def lines_of(data: bytes) -> list[str]:
    try:
        found = data.decode("utf-8")
    except UnicodeDecodeError:
        found = data.decode("latin-1")
    return found.replace("\r\n", "\n").split("\n")


@pytest.mark.usefixtures("small_pieces")
@given(CONTENTS, st.integers(0, 12), st.booleans())
@example(b"0.125,17\n" * 20 + b"0.5,1", 3, True)
@example(b"0.125,17" * 9 + b"\n1,2", 1, False)
def test_a_text_has_its_lines_from_a_disk_and_from_memory(
    tmp_path_factory: pytest.TempPathFactory, data: bytes, skipped: int, rest: bool
) -> None:
    file = tmp_path_factory.getbasetemp() / "text"
    file.write_bytes(data)
    *ended, last = lines_of(data)
    skipped = min(skipped, len(ended))
    lines = [*ended, last][skipped:] if rest and last else ended[skipped:]
    samples = []
    for found in (Text(Source("text", data)), Text(Source("text", stored(str(file))))):
        assert (found.unended, found.head, found.is_short) == (last, ended[:5], len(ended) <= 5)
        begin = found.place(skipped)
        if rest:
            found.take_rest()
        assert [*found.lines(begin)] == lines
        samples.append(found.sample(begin))
    assert samples[0] == samples[1]
    assert {*lines[:3], *lines[-3:]} <= {*samples[0]} <= {*lines}


@pytest.mark.usefixtures("small_pieces")
def test_a_big_plain_text_is_not_taken_into_memory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delattr(OnDisk, "__bytes__")
    file = tmp_path / "text"
    file.write_bytes(b"time,IE\n" + b"0.125,17\n" * 50)
    found = Text(Source("text", stored(str(file))))
    assert [*found.lines(found.place(1))] == ["0.125,17"] * 50


@pytest.mark.usefixtures("small_pieces")
@pytest.mark.parametrize("read", [lambda found: [*found.lines(0)], lambda found: found.sample(0)])
def test_a_text_written_anew_since_it_was_opened_is_an_error(read: Callable[[Text], object], tmp_path: Path) -> None:
    file = tmp_path / "text"
    file.write_bytes(b"0.125,17\n" * 50)
    found = Text(Source("text", stored(str(file))))
    file.write_bytes(b"0.125,18\n" * 50)
    with pytest.raises(ChangedError, match="rewritten"):
        read(found)
