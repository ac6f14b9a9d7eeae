"""Damaged binouts and time histories: an error of ours or true numbers, never shifted ones, never a crash.

Structure is damaged at every byte and by hypothesis; the numbers in a file carry their variable, state and
part, so a shifted one is seen.  Damage of the numbers themselves cannot be found by anyone and is not tried.
"""

import tracemalloc
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from itertools import pairwise
from typing import TypeVar

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from d2rpick.base.errors import FormatError
from d2rpick.histories.database import Database
from d2rpick.histories.formats.binout import Binout
from d2rpick.histories.formats.radioss_th import TimeHistory
from tests.faults import cases, some
from tests.made_binout import GLSTAT, LsdaWriter, Style, binout, values
from tests.made_t01 import MadePart, T01Writer, t01, value

Read = TypeVar("Read")

STATES = 6
PARTS = (7, 3)
MEMORY = 1 << 22  # far above what the small files need, far below what a damaged length may promise


def true_binout(data: bytes) -> list[tuple[int, bool]]:
    """Read everything; what is read must be true.  States of each column, and if the file is complete."""
    run = refused_or(lambda: Binout([("binout", data)]))
    if run is not None and run.complete and not run.notes:
        assert {"time", *run.channels} == {*GLSTAT}, "a lost variable is told"
        for times in (refused_or(lambda: run.time), refused_or(lambda: run.part_time)):
            assert times is None or times[:1].tolist() in ([], [1 / 8]), "a lost first state is told"
    return true_columns(lambda: Binout([("binout", data)]), ("internal_energy", "z_momentum"), values)


def true_t01(data: bytes) -> list[tuple[int, bool]]:
    """Read everything; what is read must be true."""
    return true_columns(lambda: TimeHistory(data, "runT01"), ("internal_energy", "z_momentum"), t01_value)


def t01_value(name: str, state: int, part: int = 0) -> float:
    return value(state, part, {"internal_energy": 1, "z_momentum": 5}[name])


def true_columns(
    opened: Callable[[], Database], names: tuple[str, ...], true: Callable[..., float]
) -> list[tuple[int, bool]]:
    run = refused_or(opened)
    if run is None:
        return []
    assert all("\n" not in note for note in run.notes)
    found = []
    for name in names:
        columns = [(lambda: run.time, partial(run.channel, name), partial(true, name))]
        columns += [
            (lambda: run.part_time, partial(run.part_channel, name, [id_]), partial(true, name, part=id_))
            for id_ in PARTS
        ]
        for times, numbers, of_state in columns:
            time, column = refused_or(times), refused_or(numbers)
            if time is not None and column is not None:
                states = [round(t * 8) for t in time.tolist()]
                assert time.tolist() == [state / 8 for state in states]
                assert column.ravel().tolist() == [of_state(state) for state in states]
                found.append((len(states), run.complete))
    return found


def refused_or(read: Callable[[], Read]) -> Read | None:
    """What is read, or None for an error of ours in one line."""
    try:
        return read()
    except FormatError as error:
        line = str(error)
    assert "\n" not in line
    return None


@contextmanager
def bounded_memory() -> Iterator[None]:
    tracemalloc.start()
    try:
        yield
        assert tracemalloc.get_traced_memory()[1] < MEMORY
    finally:
        tracemalloc.stop()


def structure(made: LsdaWriter | T01Writer) -> list[int]:
    """Bytes that are no values of variables."""
    data = bytes(made.data)
    number = np.zeros(len(data), dtype=bool)
    for place, (begin, end) in enumerate(pairwise([*made.marks, len(data)])):
        if isinstance(made, T01Writer):
            number[begin + 4 : end - 4] = place >= first_state_record(made)
        elif data[begin + 8] == 3:
            number[begin + 11 + data[begin + 10] : end] = True
    return [int(place) for place in np.flatnonzero(~number)]


def first_state_record(made: T01Writer) -> int:
    return len(made.marks) - 5 * STATES


BINOUT = binout(range(1, STATES + 1), PARTS)
LONG = binout(range(1, 200), PARTS)
T01 = t01(STATES, [MadePart(id_, f"part {id_}") for id_ in PARTS])
BINOUT_STRUCTURE = structure(BINOUT)
T01_STRUCTURE = structure(T01)


def test_the_undamaged_files_are_whole() -> None:
    assert true_binout(bytes(BINOUT.data)) == [(STATES, True)] * 5
    assert true_t01(bytes(T01.data)) == [(STATES, True)] * 6


@pytest.mark.parametrize("tables", [True, False])
def test_a_binout_cut_at_any_byte_keeps_its_whole_states(tables: bool) -> None:
    made = binout(range(1, STATES + 1), PARTS, tables=tables)
    data = bytes(made.data)
    whole = 0
    states = [mark for mark in made.marks if data[mark + 8] == 2 and b"/glstat/d" in data[mark : mark + 25]]
    for cut in some(range(len(data))):
        whole = sum(state < cut for state in states[1:])  # the state before one that began is whole
        found = true_binout(data[:cut])
        assert all(count >= whole for count, _ in found)
        assert len(found) == 5 or whole < 2


def test_a_time_history_cut_at_any_byte_keeps_its_whole_states() -> None:
    data = bytes(T01.data)
    begin = T01.marks[first_state_record(T01)]
    stride = (len(data) - begin) // STATES
    for cut in sorted({*some(range(len(data)), 7), *T01.marks}):
        whole, rest = divmod(cut - begin, stride)
        expected = [(whole, rest == 0)] * 6 if whole >= 0 else []
        assert true_t01(data[:cut]) == expected


@pytest.mark.slow
@pytest.mark.parametrize("flip", [0x01, 0x04, 0x80, 0xFF])
def test_any_byte_of_a_binouts_structure_may_be_wrong(flip: int) -> None:
    data = bytearray(BINOUT.data)
    for place in some(BINOUT_STRUCTURE[flip % 7 :]):
        data[place] ^= flip
        true_binout(bytes(data))
        data[place] ^= flip


@pytest.mark.parametrize("states", [1, 3])
@pytest.mark.parametrize("change", [2, 5, -2])
def test_bytes_inserted_into_a_value_or_lost_from_it_shift_no_number(states: int, change: int) -> None:
    """The record before the place where the records break is the one that is damaged."""
    made = binout(range(1, states + 1), PARTS, tables=False)
    data = bytes(made.data)
    for begin, end in pairwise([*made.marks, len(data)]):
        if data[begin + 8] == 3 and end < len(data):
            middle = end - 4
            true_binout(data[:middle] + b"\x11" * change + data[middle + max(0, -change) :])


def test_a_variable_whose_type_changes_between_states_is_left_out_with_a_note() -> None:
    name = b"\x10hourglass_energy"
    data = bytearray(BINOUT.data)
    data[data.index(name, data.index(b"/glstat/d000001")) - 1] = 3  # integers of four bytes
    run = Binout([("binout", bytes(data))])
    assert "hourglass_energy" not in run.channels
    assert any("hourglass_energy of another type in some states" in note for note in run.notes)


@pytest.mark.parametrize("flip", [0x01, 0x02, 0x04, 0x08, 0x10, 0x20, 0x40, 0x80, 0xFF])
def test_any_byte_of_a_time_historys_structure_may_be_wrong(flip: int) -> None:
    data = bytearray(T01.data)
    for place in some(T01_STRUCTURE, 23):
        data[place] ^= flip
        true_t01(bytes(data))
        data[place] ^= flip


# A run as long as one state, moved to the same place of another, puts a state together from two: neither
# format says anywhere which record belongs to which state.  Runs of other lengths leave a trace.


@pytest.mark.parametrize("made", [BINOUT, LONG], ids=["short", "long"])
@cases(25)
@given(draw=st.data())
def test_records_of_a_binout_may_be_lost_doubled_and_moved(made: LsdaWriter, draw: st.DataObject) -> None:
    true_binout(_shuffled(draw, made, st.integers(1, 30)))


@cases(25)
@given(st.data())
def test_records_of_a_time_history_may_be_lost_doubled_and_moved(draw: st.DataObject) -> None:
    true_t01(_shuffled(draw, T01, st.integers(1, 24).filter(lambda length: length % 5)))


@pytest.mark.parametrize("made", [BINOUT, T01], ids=["binout", "T01"])
@cases(25)
@given(draw=st.data())
def test_bytes_may_be_added_between_records_and_structure_flipped(
    made: LsdaWriter | T01Writer, draw: st.DataObject
) -> None:
    data = bytearray(made.data)
    places = BINOUT_STRUCTURE if made is BINOUT else T01_STRUCTURE
    for place in draw.draw(st.lists(st.sampled_from(places), max_size=4)):
        data[place] = draw.draw(st.integers(0, 255))
    at = draw.draw(st.sampled_from(made.marks))
    data[at:at] = draw.draw(st.binary(max_size=40))
    with bounded_memory():
        (true_binout if made is BINOUT else true_t01)(bytes(data))


@given(st.binary(max_size=300), st.sampled_from([bytes(BINOUT.data[:700]), bytes(T01.data[:700]), b""]))
def test_any_bytes_behind_a_true_beginning(rest: bytes, beginning: bytes) -> None:
    with bounded_memory():
        true_binout(beginning + rest)
        true_t01(beginning + rest)


@pytest.mark.parametrize("style", [Style(">", 4, 4, 1, 1, "f8"), Style("<", 8, 4, 2, 4, "f4")], ids=str)
def test_other_styles_cut_anywhere(style: Style) -> None:
    data = bytes(binout(range(1, 4), PARTS, style=style).data)
    for cut in some(range(len(data))):
        true_binout(data[:cut])


def _shuffled(draw: st.DataObject, made: LsdaWriter | T01Writer, length: st.SearchStrategy[int]) -> bytes:
    """The records of a file with a run of them lost, written twice, or moved."""
    data = bytes(made.data)
    records = [data[begin:end] for begin, end in pairwise([*made.marks, len(data)])]
    first = draw.draw(st.integers(0, len(records) - 1))
    moved = records[first : first + draw.draw(length)]
    what = draw.draw(st.sampled_from(["lost", "twice", "moved"]))
    if what != "twice":
        del records[first : first + len(moved)]
    if what != "lost":
        at = draw.draw(st.integers(0, len(records)))
        records[at:at] = moved
    return data[: made.marks[0]] + b"".join(records)
