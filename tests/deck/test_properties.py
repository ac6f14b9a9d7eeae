"""Random decks: the reader returns what was written, and no bytes crash the check."""

import contextlib
import string
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory

from hypothesis import given, strategies as st

from d2rpick.base.errors import D2RPickError
from d2rpick.rules import check_deck
from d2rpick.rules.example import END, HEAD, PARTS
from d2rpick.rules.rule import GOOD
from tests.decks import list_spans, read, write

TIMES = st.integers(1, 10**6).map(lambda n: n / 1000)

PIECES = [
    *("*DEFORMABLE_TO_RIGID_AUTOMATIC\n", "*DEFORMABLE_TO_RIGID\n", "*PARAMETER\n", "*PARAMETER_EXPRESSION\n"),
    *("*DEFORMABLE_TO_RIGID_INERTIA\n", "*RIGID_DEFORMABLE_CONTROL\n", "*INCLUDE\n", "*INCLUDE_TRANSFORM\n"),
    *("*PART\n", "*PART_INERTIA\n", "*SET_PART_LIST_GENERATE\n", "*SET_PART_ADD\n", "*CONTROL_TERMINATION\n"),
    *("*DATABASE_GLSTAT\n", "*MAT_RIGID\n", "*ELEMENT_SHELL\n", "*COMMENT ", "*KEYWORD LONG=Y\n", "*\n", "main.k\n"),
    *("R a       &b+1\n", "R b       &a\n", "&a", "<1/0>", "-&a", "1e999", "PSET", "\xe9"),
    *("-----BEGIN PGP MESSAGE\n", "\0"),
    *("         1", "         2", "       0.5", "        -1", "9999999999", "    1.e300"),
    *("\n", "\r\n", ",", "$", " +\n", "&"),
]  # fmt: skip


@dataclass(frozen=True)
class DeckWithWindows:
    """Windows, and how their deck is written."""

    windows: list[tuple[int, float, float | None]] = field(default_factory=list)
    style: str = "fixed"
    ending: str = "\n"
    upper: bool = True
    comments: bool = False
    offset: int = 0
    as_parameters: bool = False


@st.composite
def draw_deck(draw: st.DrawFn) -> DeckWithWindows:
    windows: list[tuple[int, float, float | None]] = []
    for part in sorted(draw(st.sets(st.integers(1, 9999), max_size=4))):
        times = sorted(draw(st.sets(TIMES, min_size=1, max_size=6)))
        pairs = list(zip(times[::2], [*times[1::2], None], strict=False))
        windows += [(part, tr, td) for tr, td in pairs]
    return DeckWithWindows(
        windows,
        draw(st.sampled_from(["fixed", "comma", "long"])),
        draw(st.sampled_from(["\n", "\r\n"])),
        draw(st.booleans()),
        draw(st.booleans()),
        draw(st.integers(0, 10**6)),
        draw(st.booleans()),
    )


def write_text(written: DeckWithWindows) -> str:
    """Return the deck with one card per switch."""
    width = 20 if written.style == "long" else 10
    lines = ["*KEYWORD" + (" LONG=Y" if written.style == "long" else "")]

    def line(*values: object) -> str:
        texts = [str(value) for value in values]
        return (
            ",".join(texts)
            if written.style == "comma"
            else "".join(text.rjust(width) for text in texts)
        )

    swset = 0
    for part, *times in written.windows:
        for to_rigid, time in zip((True, False), times, strict=True):
            if time is None:
                continue
            swset += 1
            time_text = f"&t{swset}" if written.as_parameters else repr(time)
            if written.as_parameters:
                lines += ["*PARAMETER", line(f"R t{swset}", repr(time))]
            lines += ["*DEFORMABLE_TO_RIGID_AUTOMATIC", line(swset, 0, time_text)]
            lines += [line("", "", "", "", int(to_rigid), int(not to_rigid))]
            lines += [line(part, 0, "PART") if to_rigid else line(part, "PART")]
    if written.comments:
        lines = [piece for row in lines for piece in ("$ a comment, *END", row)]
    text = "".join(row + written.ending for row in lines)
    return text if written.upper else text.lower()


@given(draw_deck())
def test_what_is_written_is_read(written: DeckWithWindows) -> None:
    with TemporaryDirectory() as folder:
        deck = read(Path(folder), write_text(written))
        assert list_spans(deck) == written.windows
        checked = check_deck(deck.path)
        assert {finding.rule for finding in checked.findings} <= {"D2R104"}


@given(draw_deck())
def test_offsets_move_every_window(written: DeckWithWindows) -> None:
    outer = f"*INCLUDE_TRANSFORM\ninner.k\n{0:10d}{0:10d}{written.offset:10d}\n"
    with TemporaryDirectory() as folder:
        deck = read(Path(folder), outer, {"inner.k": write_text(written)})
        assert list_spans(deck) == [
            (part + written.offset, tr, td) for part, tr, td in written.windows
        ]


def check_survives(content: bytes) -> None:
    with TemporaryDirectory() as folder:
        path = write(Path(folder), content)
        with contextlib.suppress(D2RPickError):
            for finding in check_deck(path).findings:
                assert 1 <= finding.line <= content.count(b"\n") + 1
                assert finding.column >= 1
                assert "\n" not in finding.message


@given(st.binary(max_size=400))
def test_any_bytes(content: bytes) -> None:
    check_survives(content)


@given(st.lists(st.sampled_from(PIECES), max_size=40))
def test_any_mix_of_what_decks_are_made_of(pieces: list[str]) -> None:
    check_survives("".join(pieces).encode("latin-1"))


@given(st.data())
def test_a_good_deck_with_damage(data: st.DataObject) -> None:
    content = bytearray(GOOD.encode())
    for _ in range(data.draw(st.integers(1, 5))):
        at = data.draw(st.integers(0, len(content) - 1))
        content[at : at + data.draw(st.integers(0, 12))] = data.draw(
            st.binary(max_size=12)
        )
    check_survives(bytes(content))


@given(st.text(string.printable, max_size=10))
def test_any_text_in_the_time_field(text: str) -> None:
    card = f"*DEFORMABLE_TO_RIGID_AUTOMATIC\n{1:10d}{0:10d}{text:>10s}\n"
    check_survives((HEAD + PARTS + card + END).encode("latin-1"))
