"""The lines of a text are the same for a large file on disk and for bytes in memory."""

from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import example, given, strategies as st

from d2rpick.base.errors import ChangedError
from d2rpick.histories.content import OnDisk
from d2rpick.histories.formats.text import Text
from d2rpick.histories.source import Source
from tests.command import put
from tests.reading import InPieces, open_on_disk

CONTENTS = st.lists(
    st.sampled_from([b"0.125,17", b"\n", b"\r\n", b"\xc2\xb5s", b"\xb5", b""]),
    max_size=40,
).map(b"".join)


class Small(Text):
    """A text that is read in very small pieces."""

    top, piece, short, some = 5, 16, 32, 3


class Narrow(InPieces):
    """A file on disk that is read in very small blocks."""

    gap, window = 8, 16


def on_a_disk(file: Path) -> Text:
    """A text on disk that is read in small pieces."""
    return Small(Source("text", open_on_disk(file, Narrow)))


def lines_of(data: bytes) -> list[str]:
    try:
        text = data.decode("utf-8")
    except UnicodeDecodeError:
        text = data.decode("latin-1")
    return text.replace("\r\n", "\n").split("\n")


@given(CONTENTS, st.integers(0, 12), st.booleans())
@example(b"0.125,17\n" * 20 + b"0.5,1", 3, True)
@example(b"0.125,17" * 9 + b"\n1,2", 1, False)
def test_a_text_has_its_lines_from_a_disk_and_from_memory(
    tmp_path_factory: pytest.TempPathFactory, data: bytes, skipped: int, rest: bool
) -> None:
    file = put(tmp_path_factory.getbasetemp() / "text", data)
    *ended, last = lines_of(data)
    skipped = min(skipped, len(ended))
    lines = [*ended, last][skipped:] if rest and last else ended[skipped:]
    samples = []
    for text in (Small(Source("text", data)), on_a_disk(file)):
        assert (text.unended, text.head, text.is_short) == (
            last,
            ended[:5],
            len(ended) <= 5,
        )
        begin = text.place(skipped)
        if rest:
            text.take_rest()
        assert [*text.lines(begin)] == lines
        samples.append(text.sample(begin))
    assert samples[0] == samples[1]
    assert {*lines[:3], *lines[-3:]} <= {*samples[0]} <= {*lines}


def test_a_big_plain_text_is_not_taken_into_memory(tmp_path: Path) -> None:
    class TooBig(OnDisk):
        """A file on disk that must not be read into memory as a whole."""

        def __bytes__(self) -> bytes:
            raise MemoryError

    file = put(tmp_path / "text", b"time,IE\n" + b"0.125,17\n" * 50)
    text = Small(Source("text", open_on_disk(file, TooBig)))
    assert [*text.lines(text.place(1))] == ["0.125,17"] * 50


@pytest.mark.usefixtures("new_files")
@pytest.mark.parametrize(
    "read", [lambda found: [*found.lines(0)], lambda found: found.sample(0)]
)
def test_a_text_written_anew_since_it_was_opened_is_an_error(
    read: Callable[[Text], object], tmp_path: Path
) -> None:
    file = put(tmp_path / "text", b"0.125,17\n" * 50)
    text = on_a_disk(file)
    file.write_bytes(b"0.125,18\n" * 50)
    with pytest.raises(ChangedError, match="rewritten"):
        read(text)
