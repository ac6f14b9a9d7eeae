"""Damage done to files, and plain line-by-line readers that say what the numbers in a damaged text are.

With ``D2RPICK_THOROUGH=20`` the tests of damage run twenty times as many cases, the exhaustive ones all of theirs.
"""

import os
import re
from collections.abc import Sequence
from typing import TypeVar

from hypothesis import HealthCheck, settings, strategies as st

Item = TypeVar("Item")
_MORE = int(os.environ.get("D2RPICK_THOROUGH", "1"))


def cases(count: int) -> settings:
    """So many examples of hypothesis, slow or large as they are."""
    return settings(
        max_examples=count * _MORE,
        deadline=None,
        suppress_health_check=list(HealthCheck),
    )


def inputs(count: int) -> int:
    """So many inputs in a thorough run of twenty, in proportion in others; the usual run has few of them."""
    return count * _MORE // 20 if _MORE > 1 else count // 3000


def some(items: Sequence[Item], step: int = 97) -> Sequence[Item]:
    """Each item in a thorough run, else one of ``step``: no multiple of what repeats in a file."""
    return items if _MORE > 1 else items[::step]


def cuts(text: bytes) -> list[int]:
    """Where to cut a text: next to all ends of its lines and at some places between, everywhere in a thorough run."""
    ends = {
        found.end() + shift
        for found in re.finditer(rb"\n|$", text)
        for shift in (-2, -1, 0, 1)
    }
    return sorted({*some(range(len(text)), 7), *ends} & {*range(len(text) + 1)})


# A fault: what is done, where it begins (as a share of the file), how much of it, and with which byte.
Fault = tuple[str, float, float, int]
FAULTS = st.lists(
    st.tuples(
        st.sampled_from(["flip", "cut", "drop", "double", "swap", "insert", "blank"]),
        st.floats(0, 1),
        st.floats(0, 1),
        st.integers(0, 255) | st.sampled_from(b"\n 0123456789.E+-*"),
    ),
    min_size=1,
    max_size=3,
)
State = tuple[
    float | None, list[float | None]
]  # time and energies; None for what is no number


def damage(text: bytes, faults: list[Fault], borders: list[int]) -> bytes:
    """Apply ``faults``; spans of odd ``byte`` begin and end at ``borders``, those of even ones anywhere."""
    for kind, where, much, byte in faults:
        at = int(where * len(text))
        end = min(len(text), at + 1 + int(much**4 * len(text)))
        if byte % 2 and borders:
            first = int(where * (len(borders) - 1))
            at, end = (
                borders[first],
                borders[min(len(borders) - 1, first + 1 + int(3 * much))],
            )
        span = text[at:end]
        text = {
            "flip": text[:at] + bytes([byte]) + text[at + 1 :],
            "cut": text[:at],
            "drop": text[:at] + text[end:],
            "double": text[:end] + span + text[end:],
            "swap": text[:at] + text[end : 2 * end - at] + span + text[2 * end - at :],
            "insert": text[:at] + bytes([byte]) + text[at:],
            "blank": text[:at] + bytes(len(span)) + text[end:],
        }[kind]
    return text


def number(field: bytes) -> float | None:
    if not re.fullmatch(rb" *[+-]?(\d+\.?\d*|\.\d+)([EeDd][+-]?\d+|[+-]\d+)?", field):
        return None
    text = re.sub(rb"(?<=[\d.])([+-])", rb"E\1", field.upper().replace(b"D", b"E"))
    value = float(text)
    return value if abs(value) < float("inf") else None


def states_of(text: bytes, start: bytes, width: int) -> list[tuple[bytes, list[bytes]]]:
    """Field of the time and lines of each state, from whole lines."""
    lines = text[: text.rfind(b"\n") + 1].split(b"\n")[:-1]
    if len(lines) > 1 and b"ls-dyna" in lines[1]:
        lines = lines[2:]
    states: list[tuple[bytes, list[bytes]]] = []
    for line in lines:
        if line.startswith(start):
            states.append((line[len(start) :], []))
        elif states:
            states[-1][1].append(line)
    return [
        (field if not field[width : width + 1].strip() else b"", lines)
        for field, lines in states
    ]


def value(field: bytes, width: int) -> float | None:
    """The number at the beginning of ``field``, if its columns are right."""
    if len(field) < width or field[width : width + 1].strip():
        return None
    return number(field[:width])


def glstat_states(text: bytes) -> list[State]:
    def is_energy(line: bytes) -> bool:
        return (
            line[31:32] == b"."
            and line[:32].rstrip(b".").rstrip() == b" internal energy"
        )

    return [
        (value(time, 14), [value(line[32:], 14) for line in lines if is_energy(line)])
        for time, lines in states_of(text, b" time".ljust(32, b"."), 14)
    ]


def matsum_states(text: bytes, id_: int) -> list[State]:
    label = b" mat.#=%5d             inten=" % id_
    return [
        (
            value(time, 13),
            [value(line[31:], 13) for line in lines if line.startswith(label)],
        )
        for time, lines in states_of(text, b" time =", 13)
    ]


def is_within(
    found: list[tuple[float, float]], states: list[State], most: int = 1
) -> bool:
    """Whether ``found`` stand in ``states``, in their order, each in a state with ``most`` such lines."""
    rest = iter(states)
    return all(
        any(
            time == here and energy in energies and len(energies) <= most
            for here, energies in rest
        )
        for time, energy in found
    )
