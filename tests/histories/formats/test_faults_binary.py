"""Damaged binouts and time histories give an error of d2rpick or true numbers, never shifted ones, never a crash.

Structure is damaged at every byte and by hypothesis.  Damage of the numbers themselves cannot be found by anyone and is
not tried.
"""

from contextlib import nullcontext
from itertools import pairwise
from random import Random

import pytest
from hypothesis import given, strategies as st

from d2rpick.histories.formats.binout import Binout
from tests.damaged_files import (
    FILES,
    PARTS,
    STATES,
    check_binout,
    check_t01,
    limit_memory,
)
from tests.faults import choose_some, make_settings
from tests.made_binout import Style, make_binout


@pytest.mark.parametrize("tables", [True, False])
def test_a_binout_cut_at_any_byte_keeps_its_whole_states(tables: bool) -> None:
    writer = make_binout(range(1, STATES + 1), PARTS, tables=tables)
    data = bytes(writer.data)
    states = [
        mark
        for mark in writer.marks
        if data[mark + 8] == 2 and b"/glstat/d" in data[mark : mark + 25]
    ]
    assert check_binout(data) == [(STATES, True)] * 5
    for cut in choose_some(range(len(data))):
        whole = sum(
            state < cut for state in states[1:]
        )  # a state is complete once the next one has begun
        states_read = check_binout(data[:cut])
        assert all(count >= whole for count, _ in states_read)
        assert len(states_read) == 5 or whole < 2


@pytest.mark.parametrize(("name", "least"), [("T01", 0), ("T01 as text", 1)])
def test_a_time_history_cut_at_any_byte_keeps_its_whole_states(
    name: str, least: int
) -> None:
    file = FILES[name]
    begin = file.made.marks[file.first]
    stride = (len(file.data) - begin) // file.states
    for cut in sorted(
        {*choose_some(range(len(file.data)), 23), *file.made.marks, len(file.data)}
    ):
        whole, bytes_left = divmod(cut - begin, stride)
        states_read = file.true(file.data[:cut])
        # a text may be refused if it consists only of a head, after which a record begins
        assert states_read == [(whole, bytes_left == 0)] * 6 or (
            states_read == [] and whole < least
        )


@pytest.mark.parametrize("flip", [0x01, 0x02, 0x04, 0x08, 0x10, 0x20, 0x40, 0x80, 0xFF])
@pytest.mark.parametrize(
    "name", [pytest.param("binout", marks=pytest.mark.slow), "T01", "T01 as text"]
)
def test_any_byte_of_structure_may_be_wrong(name: str, flip: int) -> None:
    file = FILES[name]
    data = bytearray(file.data)
    for address in choose_some(file.structure[flip % 7 :], 37):
        data[address] ^= flip
        file.true(bytes(data))
        data[address] ^= flip


@pytest.mark.parametrize("states", [1, 3])
@pytest.mark.parametrize("change", [2, 5, -2])
def test_bytes_inserted_into_a_value_or_lost_from_it_shift_no_number(
    states: int, change: int
) -> None:
    """The damaged record is the one before the address from which the records cannot be followed any more."""
    writer = make_binout(range(1, states + 1), PARTS, tables=False)
    data = bytes(writer.data)
    for begin, end in pairwise([*writer.marks, len(data)]):
        if data[begin + 8] == 3 and end < len(data):
            middle = end - 4
            check_binout(
                data[:middle] + b"\x11" * change + data[middle + max(0, -change) :]
            )


def test_a_variable_whose_type_changes_between_states_is_left_out_with_a_note() -> None:
    name = b"\x10hourglass_energy"
    data = bytearray(FILES["binout"].data)
    data[data.index(name, data.index(b"/glstat/d000001")) - 1] = (
        3  # integers of four bytes
    )
    run = Binout([("binout", bytes(data))])
    assert "hourglass_energy" not in run.channels
    assert any(
        "hourglass_energy of another type in some states" in note for note in run.notes
    )


@pytest.mark.parametrize("name", FILES)
@make_settings(40)
@given(random=st.randoms(use_true_random=True))
def test_records_may_be_lost_doubled_and_moved_and_bytes_put_in_and_changed(
    name: str, random: Random
) -> None:
    with nullcontext() if name == "long binout" else limit_memory():
        FILES[name].true(FILES[name].restructured(random))


@given(
    st.binary(max_size=300),
    st.sampled_from([FILES["binout"].data[:700], FILES["T01"].data[:700], b""]),
)
def test_any_bytes_behind_a_true_beginning(rest: bytes, beginning: bytes) -> None:
    with limit_memory():
        check_binout(beginning + rest)
        check_t01(beginning + rest)


@pytest.mark.parametrize(
    "style", [Style(">", 4, 4, 1, 1, "f8"), Style("<", 8, 4, 2, 4, "f4")], ids=str
)
def test_other_styles_cut_anywhere(style: Style) -> None:
    data = bytes(make_binout(range(1, 4), PARTS, style=style).data)
    for cut in choose_some(range(len(data))):
        check_binout(data[:cut])
