"""Writes Radioss time histories for tests: any number of globals, parts with variables, subsets, groups."""

from __future__ import annotations

import struct
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence


@dataclass
class T01Writer:
    """Appends Fortran records to ``data``; ``marks`` are the bytes where they begin."""

    data: bytearray = field(default_factory=bytearray)
    marks: list[int] = field(default_factory=list)

    def record(self, body: bytes) -> None:
        self.marks.append(len(self.data))
        self.data += struct.pack(">i", len(body)) + body + struct.pack(">i", len(body))

    def integers(self, *numbers: int) -> None:
        if numbers:
            self.record(np.array(numbers, ">i4").tobytes())

    def reals(self, numbers: Sequence[float]) -> None:
        if numbers:
            self.record(np.array(numbers, ">f4").tobytes())

    def state(self, time: float, whole: Sequence[float], parts: Sequence[float], subset_variables: int = 2) -> None:
        self.reals([time])
        self.reals(whole)
        self.reals(parts)
        self.reals([0.0] * subset_variables)
        self.reals([0.0] * 18)


@dataclass(frozen=True)
class MadePart:
    id: int
    title: str
    codes: tuple[int, ...] = (1, 2, 3, 4, 5, 6, 7, 28)
    is_group: bool = False


def value(state: int, part: int, code: int) -> float:
    """A number that belongs to one state, part (0: globals) and variable only, exact in single precision."""
    return state + part * 16384.0 + code / 64


def t01(
    states: int,
    parts: Sequence[MadePart] = (MadePart(3, "box"), MadePart(12, "step")),
    *,
    globals_: int = 22,
    code: int = 3040,
    title: int = 40,
    subset_variables: int = 2,
    start: int = 0,
) -> T01Writer:
    made = headed(parts, globals_=globals_, code=code, title=title, subset_variables=subset_variables)
    for state in range(start, start + states):
        globals_of = [value(state, 0, code) for code in range(1, globals_ + 1)]
        of_parts = [value(state, part.id, code) for part in parts for code in part.codes]
        made.state(state / 8, globals_of, of_parts, subset_variables)
    return made


def headed(
    parts: Sequence[MadePart], *, globals_: int, code: int = 3040, title: int = 40, subset_variables: int = 2
) -> T01Writer:
    """Write what stands before the states."""
    made = T01Writer()
    made.record(struct.pack(">i", code) + b"made for tests".ljust(80))
    made.record(b"Fri Nov 20 23:34:18 2026 RADIOSS OpenRadioss,       linuxa64 gf".ljust(80))
    if code >= 3050:
        made.integers(2)
        made.integers(title)
        made.record(np.array([1, 1, 1], ">f4").tobytes())
    made.integers(len(parts), 2, 1, 1, 1, globals_)
    made.integers(*range(1, globals_ + 1))
    for part in parts:
        numbers = (0, 0 if part.is_group else 1, 0 if part.is_group else 2, len(part.codes))
        made.record(struct.pack(">i", part.id) + part.title.encode().ljust(title) + struct.pack(">4i", *numbers))
        made.integers(*part.codes)
    for number in (1, 2, 3):
        made.record(struct.pack(">i", number) + b"steel".ljust(title))
    made.record(struct.pack(">5i", 0, 0, 0, len(parts), subset_variables) + b"GLOBAL MODEL".ljust(title))
    made.integers(*(part.id for part in parts))
    made.integers(*range(1, subset_variables + 1))
    made.record(struct.pack(">5i", 1, 0, 0, 3, 6) + b"nodes".ljust(title))
    for node in (5, 6, 7):
        made.record(struct.pack(">i", node) + b"corner".ljust(title))
    made.integers(*range(1, 7))
    return made
