"""Numbers taken while blocks are compared are those that are fetched by themselves, in damaged files too."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from d2rpick.errors import FormatError
from d2rpick.histories.formats import ahead, alike, fixed_text
from d2rpick.histories.formats.glstat import Glstat
from d2rpick.histories.formats.matsum import Matsum
from tests.text_files import glstat_text, matsum_text

if TYPE_CHECKING:
    from collections.abc import Callable

IDS = [1, 20, 300]


@st.composite
def damaged(draw: st.DrawFn, *, parts: bool) -> bytes:
    """States of which some numbers never change, with a few bytes replaced, lost or put in; maybe cut."""
    states = draw(st.integers(1, 12))
    energies = np.random.default_rng(draw(st.integers(0, 99))).normal(size=(states, len(IDS)))
    energies[draw(st.integers(0, states)) :, draw(st.integers(0, 2))] = draw(st.sampled_from([0.0, -0.0, 2.5]))
    time = np.arange(states) / 8
    text = bytearray(matsum_text(time, IDS, energies) if parts else glstat_text(time, energies[:, 0]))
    numbers = [one.end() - 6 for one in re.finditer(rb"(inten=|internal energy|time[. ]).*?E[+-]\d\d", text)]
    anywhere = st.integers(len(text) // 3, len(text))
    for place in draw(st.lists(st.sampled_from(numbers) | anywhere, max_size=3)):
        new = draw(st.sampled_from([b"*", b"7", b"", b"\n", b" 1 "]))
        text[place : place + len(new) + draw(st.sampled_from([0, 0, 0, 1]))] = new
    return bytes(text[: draw(st.integers(len(text) // 2, len(text)))] if draw(st.booleans()) else text)


def energies_of_model(data: bytes) -> tuple[bytes, ...]:
    run = Glstat(data, "glstat", ["internal energy"])
    return run.time.tobytes(), run.channel("internal energy").tobytes(), run.channel("kinetic energy").tobytes()


def energies_of_parts(data: bytes) -> tuple[bytes, ...]:
    run = Matsum(data, "matsum")
    asked = ([20], IDS, IDS[::-1])
    return run.part_time.tobytes(), *(run.part_channel("internal_energy", ids).tobytes() for ids in asked)


def answer(read: Callable[[bytes], tuple[bytes, ...]], data: bytes) -> tuple[bytes, ...] | None:
    """What is read; None where it is refused, for whichever of several damages."""
    try:
        return read(data)
    except FormatError:
        return None


def agree(read: Callable[[bytes], tuple[bytes, ...]], data: bytes, many: int, chunk: int, batch: int) -> bool:
    """Whether it makes no difference that numbers are taken ahead, so many blocks and numbers at a time."""
    expected = answer(read, data)  # these blocks are too few for it
    with pytest.MonkeyPatch.context() as small:
        for module, name, value in (
            *((fixed_text, "_MANY", many), (alike, "CHUNK", chunk), (fixed_text, "CHUNK", chunk)),
            *((ahead, "BATCH", batch), (fixed_text, "BATCH", batch)),
        ):
            small.setattr(module, name, value)
        return answer(read, data) == expected


SIZES = st.integers(1, 4), st.sampled_from([64, 3000, 1 << 20]), st.integers(1, 12)


@given(damaged(parts=False), *SIZES)
def test_numbers_of_a_glstat(data: bytes, many: int, chunk: int, batch: int) -> None:
    assert agree(energies_of_model, data, many, chunk, batch)


@given(damaged(parts=True), *SIZES)
def test_numbers_of_a_matsum(data: bytes, many: int, chunk: int, batch: int) -> None:
    assert agree(energies_of_parts, data, many, chunk, batch)


def test_what_is_taken_ahead_is_not_fetched(monkeypatch: pytest.MonkeyPatch) -> None:
    fetched = []
    fetch = fixed_text.Blocks._fetch

    def noted(self: fixed_text.Blocks, values: np.ndarray, names: list[str]) -> None:
        fetched.append(values.size)
        fetch(self, values, names)

    monkeypatch.setattr(fixed_text.Blocks, "_fetch", noted)
    states = np.arange(200.0)
    run = Glstat(glstat_text(states, states**2), "glstat", ["internal energy"])
    assert run.channel("internal energy").tolist() == (states**2).tolist()
    assert fetched == [2]  # of the last state, behind which no other one begins


def test_damage_to_a_number_taken_ahead_is_named_with_its_line() -> None:
    states = np.arange(200.0)
    text = glstat_text(states, states + 0.125).replace(b"1.00125E+02", b"1.00*25E+02")
    run = Glstat(text, "glstat", ["internal energy"])
    assert run.time.tolist() == states.tolist()
    line = 1 + text[: text.index(b"*25")].count(b"\n")
    with pytest.raises(FormatError, match=rf"^glstat:{line}: 'internal energy' is '1.00\*25E\+02'"):
        run.channel("internal energy")
