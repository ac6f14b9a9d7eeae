"""Files of records to be damaged. Each number identifies its variable, state and part, so a shifted one is noticed."""

import tracemalloc
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from random import Random
from typing import TypeVar

import numpy as np

from d2rpick.base.caching import cached_property
from d2rpick.base.errors import FormatError
from d2rpick.histories.database import Database
from d2rpick.histories.formats.binout import Binout
from d2rpick.histories.formats.radioss_th import TimeHistory
from tests.made_binout import GLSTAT, LsdaWriter, compute_value, make_binout
from tests.made_t01 import (
    MadePart,
    T01TextWriter,
    T01Writer,
    format_real,
    make_t01,
    make_value,
)

Read = TypeVar("Read")

STATES = 6
PARTS = (7, 3)
MEMORY = (
    1 << 22
)  # far above what the small files need, far below what a damaged length field may demand


def check_binout(data: bytes) -> list[tuple[int, bool]]:
    """Check that all numbers read are true; return the number of states of each column, and if the file is complete."""
    run = read_or_refuse(lambda: Binout([("binout", data)]))
    if run is not None and run.complete and not run.notes:
        assert {"time", *run.channels} == {*GLSTAT}, "a lost variable is told"
        for times in (
            read_or_refuse(lambda: run.time),
            read_or_refuse(lambda: run.part_time),
        ):
            assert times is None or times[:1].tolist() in ([], [1 / 8]), (
                "a lost first state is told"
            )
    return check_columns(
        lambda: Binout([("binout", data)]),
        ("internal_energy", "z_momentum"),
        compute_value,
    )


def compute_t01_value(name: str, state: int, part: int = 0) -> float:
    return make_value(state, part, {"internal_energy": 1, "z_momentum": 5}[name])


def check_t01(
    data: bytes, value_of: Callable[..., float] = compute_t01_value
) -> list[tuple[int, bool]]:
    """Read a binary T01 in the same way as `true_binout`."""
    return check_columns(
        lambda: TimeHistory(data, "runT01"),
        ("internal_energy", "z_momentum"),
        value_of,
    )


def check_text_t01(data: bytes) -> list[tuple[int, bool]]:
    """Read a text T01 in the same way as `true_binout`."""
    return check_t01(
        data, lambda name, state, part=0: printed(compute_t01_value(name, state, part))
    )


def printed(number: float) -> float:
    return float(format_real(number))


def check_columns(
    opened: Callable[[], Database], names: tuple[str, ...], true: Callable[..., float]
) -> list[tuple[int, bool]]:
    run = read_or_refuse(opened)
    if run is None:
        return []
    assert all("\n" not in note for note in run.notes)
    columns_read = []
    for name in names:
        columns = [(lambda: run.time, partial(run.channel, name), partial(true, name))]
        columns += [
            (
                lambda: run.part_time,
                partial(run.part_channel, name, [id_]),
                partial(true, name, part=id_),
            )
            for id_ in PARTS
        ]
        for times, numbers, of_state in columns:
            time, column = read_or_refuse(times), read_or_refuse(numbers)
            if time is not None and column is not None:
                states = [round(t * 8) for t in time.tolist()]
                assert time.tolist() == [state / 8 for state in states]
                assert column.ravel().tolist() == [of_state(state) for state in states]
                columns_read.append((len(states), run.complete))
    return columns_read


def read_or_refuse(reader: Callable[[], Read]) -> Read | None:
    """Return the result of ``reader``, or None if it raises a d2rpick error of one line."""
    try:
        return reader()
    except FormatError as error:
        line = str(error)
    assert "\n" not in line
    return None


@contextmanager
def limit_memory() -> Iterator[None]:
    tracemalloc.start()
    try:
        yield
        assert tracemalloc.get_traced_memory()[1] < MEMORY
    finally:
        tracemalloc.stop()


@dataclass
class Damaged:
    """File to be damaged. A state has ``per_state`` records; 1 if each state gives the number of its records."""

    made: LsdaWriter | T01Writer
    true: Callable[[bytes], list[tuple[int, bool]]]
    states: int = STATES
    per_state: int = 1

    @cached_property
    def data(self) -> bytes:
        return bytes(self.made.data)

    @cached_property
    def first(self) -> int:
        """Return the index of the first record that belongs to a state of a time history."""
        return len(self.made.marks) - self.per_state * self.states

    @cached_property
    def structure(self) -> list[int]:
        """Return the offsets of all bytes that are not values of variables."""
        data, number = self.data, np.zeros(len(self.data), dtype=bool)
        for block_number, (begin, end) in enumerate(
            pairwise([*self.made.marks, len(data)])
        ):
            if isinstance(self.made, T01TextWriter):
                number[data.index(b"\n", begin) + 1 : end] = block_number >= self.first
            elif isinstance(self.made, T01Writer):
                number[begin + 4 : end - 4] = block_number >= self.first
            elif data[begin + 8] == 3:
                number[begin + 11 + data[begin + 10] : end] = True
        return np.flatnonzero(~number).tolist()

    def restructured(self, random: Random) -> bytes:
        """Flip bytes of the structure, cut the file, insert bytes, or lose, duplicate and move records.

        A block of records as long as one state, moved to the same position in another state, joins two states into one.
        A time history does not say which record belongs to which state, so this damage cannot be noticed.  Blocks of
        other lengths leave a trace.
        """
        changed, marks = bytearray(self.data), self.made.marks
        fault_kind = random.choice(("flip", "cut", "insert", "lost", "twice", "moved"))
        if fault_kind == "cut":
            return self.data[: random.randrange(len(changed))]
        if fault_kind in ("flip", "insert"):
            for _ in range(random.randint(fault_kind == "flip", 4)):
                changed[random.choice(self.structure)] = random.randrange(256)
            offset = random.choice(marks)
            changed[offset:offset] = random.randbytes(
                random.randint(1, 40) if fault_kind == "insert" else 0
            )
            return bytes(changed)
        records = [
            self.data[begin:end] for begin, end in pairwise([*marks, len(changed)])
        ]
        first, length = random.randrange(len(records)), random.randint(1, 30)
        length += self.per_state > 1 and length % self.per_state == 0
        moved = records[first : first + length]
        if fault_kind != "twice":
            del records[first : first + length]
        if fault_kind != "lost" and (
            self.per_state == 1 or len(moved) % self.per_state
        ):
            offset = random.randint(0, len(records))
            records[offset:offset] = moved
        return self.data[: marks[0]] + b"".join(records)


FILES = {
    "binout": Damaged(make_binout(range(1, STATES + 1), PARTS), check_binout),
    "long binout": Damaged(make_binout(range(1, 200), PARTS), check_binout),
    "T01": Damaged(make_t01(STATES, [MadePart(id_, f"part {id_}") for id_ in PARTS]), check_t01, per_state=5),
    "T01 as text": Damaged(
        make_t01(
            3, [MadePart(id_, f"part {id_}", (1, 5)) for id_ in PARTS], globals_=5, subset_variables=0,
            writer=T01TextWriter(),
        ),
        check_text_t01, 3, per_state=4,
    ),
}  # fmt: skip
