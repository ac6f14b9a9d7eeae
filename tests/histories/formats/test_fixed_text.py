"""Numbers copied while blocks are compared equal those that are read individually, in damaged files too."""

import re
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, strategies as st

from d2rpick.base.errors import FormatError
from d2rpick.histories.content import Content
from d2rpick.histories.formats.blocks import parse_fortran_numbers
from d2rpick.histories.formats.glstat import Glstat
from d2rpick.histories.formats.matsum import Matsum
from tests.text_files import (
    HEAD,
    make_glstat_blocks,
    make_glstat_text,
    make_matsum_text,
)

IDS = [1, 20, 300]
Sizes = dict[str, int]  # numbers of blocks and fields that are read together

# Numbers are copied in advance only from runs of many blocks.
SIZES = st.fixed_dictionaries({"many": st.integers(1, 4), "batch": st.integers(1, 12)})


@st.composite
def damaged(draw: st.DrawFn, *, parts: bool) -> bytes:
    """States of which some numbers never change, with a few bytes replaced, lost or inserted, and perhaps cut."""
    states = draw(st.integers(1, 12))
    energies = np.random.default_rng(draw(st.integers(0, 99))).normal(
        size=(states, len(IDS))
    )
    energies[draw(st.integers(0, states)) :, draw(st.integers(0, 2))] = draw(
        st.sampled_from([0.0, -0.0, 2.5])
    )
    time = np.arange(states) / 8
    text = bytearray(
        make_matsum_text(time, IDS, energies)
        if parts
        else make_glstat_text(time, energies[:, 0])
    )
    numbers = [
        match.end() - 6
        for match in re.finditer(
            rb"(inten=|internal energy|time[. ]).*?E[+-]\d\d", text
        )
    ]
    anywhere = st.integers(len(text) // 3, len(text))
    for position in draw(st.lists(st.sampled_from(numbers) | anywhere, max_size=3)):
        new = draw(st.sampled_from([b"*", b"7", b"", b"\n", b" 1 "]))
        text[position : position + len(new) + draw(st.sampled_from([0, 0, 0, 1]))] = new
    return bytes(
        text[: draw(st.integers(len(text) // 2, len(text)))]
        if draw(st.booleans())
        else text
    )


def energies_of_model(data: bytes, sizes: Sizes) -> tuple[bytes, ...]:
    run = type("Sized", (Glstat,), sizes)(data, "glstat", ["internal energy"])
    return (
        run.time.tobytes(),
        run.channel("internal energy").tobytes(),
        run.channel("kinetic energy").tobytes(),
    )


def energies_of_parts(data: bytes, sizes: Sizes) -> tuple[bytes, ...]:
    run = type("Sized", (Matsum,), sizes)(data, "matsum")
    id_lists = ([20], IDS, IDS[::-1])
    return run.part_time.tobytes(), *(
        run.part_channel("internal_energy", ids).tobytes() for ids in id_lists
    )


def answer(
    read: Callable[[bytes, Sizes], tuple[bytes, ...]], data: bytes, sizes: Sizes
) -> object:
    """Return the content that is read; None if it is refused because of the damage."""
    try:
        return read(data, sizes)
    except FormatError:
        return None


@given(damaged(parts=False), SIZES)
def test_numbers_of_a_glstat(data: bytes, sizes: Sizes) -> None:
    assert answer(energies_of_model, data, sizes) == answer(energies_of_model, data, {})


@given(damaged(parts=True), SIZES)
def test_numbers_of_a_matsum(data: bytes, sizes: Sizes) -> None:
    assert answer(energies_of_parts, data, sizes) == answer(energies_of_parts, data, {})


class Noted(Content):
    """A content that counts how many fields are read from it."""

    taken = 0

    def fields(self, addresses: np.ndarray, width: int) -> np.ndarray:
        self.taken += addresses.size
        return super().fields(addresses, width)


def test_what_is_taken_ahead_is_not_fetched() -> None:
    states = np.arange(200.0)
    data = Noted(make_glstat_text(states, states**2))
    run = Glstat(data, "glstat", ["internal energy"])
    assert run.channel("internal energy").tolist() == (states**2).tolist()
    assert (
        data.taken == 4
    )  # numbers of the springs, which never change, and of the last state, which no other follows


def test_all_other_columns_are_read_in_one_pass_and_a_damaged_one_is_refused_alone() -> (
    None
):
    states = np.arange(200.0)
    text = make_glstat_text(states, states)
    sound, damaged = (
        Noted(text),
        text.replace(
            b"work..................   7.0", b"work..................   *.0", 1
        ),
    )
    run = Glstat(sound, "glstat", ["internal energy"])
    run.channel("external work")
    once = sound.taken
    columns = {name: run.channel(name).tolist() for name in run.channels}
    assert sound.taken == once
    hurt = Glstat(damaged, "glstat", ["internal energy"])
    with pytest.raises(
        FormatError, match=r"'external work' is '\*\.00000E\+00', but a number"
    ):
        hurt.channel("external work")
    sound_names = [name for name in hurt.channels if name != "external work"]
    assert {name: hurt.channel(name).tolist() for name in sound_names} == {
        name: columns[name] for name in sound_names
    }


def test_damage_to_a_number_taken_ahead_is_named_with_its_line() -> None:
    states = np.arange(200.0)
    text = make_glstat_text(states, states + 0.125).replace(
        b"1.00125E+02", b"1.00*25E+02"
    )
    run = Glstat(text, "glstat", ["internal energy"])
    assert run.time.tolist() == states.tolist()
    line = 1 + text[: text.index(b"*25")].count(b"\n")
    with pytest.raises(
        FormatError, match=rf"^glstat:{line}: 'internal energy' is '1.00\*25E\+02'"
    ):
        run.channel("internal energy")


@pytest.mark.parametrize("lengths", [1, 7, 20])
def test_blocks_whose_length_varies_are_read(lengths: int) -> None:
    states = np.arange(100.0)
    blocks = [
        block.replace(b"100449", b"1" * (1 + state % lengths))
        for state, block in enumerate(make_glstat_blocks(states, states**2))
    ]
    run = Glstat(HEAD + b"\n\n" + b"".join(blocks), "glstat", ["internal energy"])
    assert run.time.tolist() == states.tolist()
    assert run.channel("internal energy").tolist() == (states**2).tolist()
    assert set(run.channel("external work").tolist()) == {7.0}


@given(st.lists(st.floats(-1e308, 1e308), min_size=1, max_size=50), st.integers(1, 9))
def test_numbers_are_those_of_float_bit_for_bit(
    values: list[float], decimals: int
) -> None:
    texts = [f"{value:.{decimals}E}" for value in values]
    fields = np.array([text.rjust(decimals + 10).encode() for text in texts])
    assert (
        parse_fortran_numbers(fields, decimals).tobytes()
        == np.array([float(text) for text in texts]).tobytes()
    )


@given(
    st.lists(
        st.text("0123456789+-.EeDd *Nna", min_size=14, max_size=14),
        min_size=1,
        max_size=20,
    )
)
def test_odd_fields_are_float_or_nan(texts: list[str]) -> None:
    numbers = parse_fortran_numbers(np.array([text.encode() for text in texts]), 5)
    for text, value in zip(texts, numbers.tolist(), strict=True):
        plain = text.lower().replace("d", "e")
        try:
            expected = float(plain)
        except ValueError:
            continue
        if np.isfinite(value):
            assert value == expected
        else:
            assert not np.isfinite(expected) or text.endswith(" ")
