"""Damage files, and read damaged texts line by line to determine the numbers in them.

With ``D2RPICK_THOROUGH=20`` the damage tests run 20 times as many cases, and the exhaustive tests run all of them.
"""

import os
import re
from collections.abc import Sequence
from typing import TypeVar

from hypothesis import HealthCheck, settings, strategies as st

Item = TypeVar("Item")
_MORE = int(os.environ.get("D2RPICK_THOROUGH", "1"))

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


def make_settings(count: int) -> settings:
    """Return hypothesis settings for this number of examples, which may be slow and large."""
    return settings(
        max_examples=count * _MORE,
        deadline=None,
        suppress_health_check=list(HealthCheck),
    )


def count_inputs(count: int) -> int:
    """Return the number of inputs: ``count`` in a thorough run of 20, proportionally fewer in other runs."""
    return count * _MORE // 20 if _MORE > 1 else count // 3000


def choose_some(items: Sequence[Item], step: int = 97) -> Sequence[Item]:
    """Return all items in a thorough run, otherwise every ``step``-th; ``step`` must not divide the file's period."""
    return items if _MORE > 1 else items[::step]


def list_cuts(text: bytes) -> list[int]:
    """Return offsets at which to cut a text: near all line ends, and some between; every offset in a thorough run."""
    ends = {
        line_end.end() + shift
        for line_end in re.finditer(rb"\n|$", text)
        for shift in (-2, -1, 0, 1)
    }
    return sorted({*choose_some(range(len(text)), 7), *ends} & {*range(len(text) + 1)})


# A fault: its kind, its start and size (as fractions of the file), and the byte that it writes.
Fault = tuple[str, float, float, int]
State = tuple[
    float | None, list[float | None]
]  # time and energies; None for text that is not a number


def damage(text: bytes, faults: list[Fault], borders: list[int]) -> bytes:
    """Apply ``faults``. A fault with an odd ``byte`` begins and ends at ``borders``, one with an even byte anywhere."""
    for kind, where, much, byte in faults:
        offset = int(where * len(text))
        end = min(len(text), offset + 1 + int(much**4 * len(text)))
        if byte % 2 and borders:
            first = int(where * (len(borders) - 1))
            offset, end = (
                borders[first],
                borders[min(len(borders) - 1, first + 1 + int(3 * much))],
            )
        span = text[offset:end]
        text = {
            "flip": text[:offset] + bytes([byte]) + text[offset + 1 :],
            "cut": text[:offset],
            "drop": text[:offset] + text[end:],
            "double": text[:end] + span + text[end:],
            "swap": text[:offset]
            + text[end : 2 * end - offset]
            + span
            + text[2 * end - offset :],
            "insert": text[:offset] + bytes([byte]) + text[offset:],
            "blank": text[:offset] + bytes(len(span)) + text[end:],
        }[kind]
    return text


def number(field: bytes) -> float | None:
    if not re.fullmatch(rb" *[+-]?(\d+\.?\d*|\.\d+)([EeDd][+-]?\d+|[+-]\d+)?", field):
        return None
    text = re.sub(rb"(?<=[\d.])([+-])", rb"E\1", field.upper().replace(b"D", b"E"))
    value = float(text)
    return value if abs(value) < float("inf") else None


def split_states(
    text: bytes, start: bytes, width: int
) -> list[tuple[bytes, list[bytes]]]:
    """Return the time field and the lines of each state, from complete lines only."""
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


def parse_value(field: bytes, width: int) -> float | None:
    """Return the number at the beginning of ``field``, or None if its columns are wrong."""
    if len(field) < width or field[width : width + 1].strip():
        return None
    return number(field[:width])


def read_glstat_states(text: bytes) -> list[State]:
    def is_energy(line: bytes) -> bool:
        return (
            line[31:32] == b"."
            and line[:32].rstrip(b".").rstrip() == b" internal energy"
        )

    return [
        (
            parse_value(time, 14),
            [parse_value(line[32:], 14) for line in lines if is_energy(line)],
        )
        for time, lines in split_states(text, b" time".ljust(32, b"."), 14)
    ]


def read_matsum_states(text: bytes, id_: int) -> list[State]:
    label = b" mat.#=%5d             inten=" % id_
    return [
        (
            parse_value(time, 13),
            [parse_value(line[31:], 13) for line in lines if line.startswith(label)],
        )
        for time, lines in split_states(text, b" time =", 13)
    ]


def is_within(
    read_states: list[tuple[float, float]], states: list[State], most_lost: int = 1
) -> bool:
    """Return True if the states read are in ``states`` in the same order; each may lack ``most_lost`` lines at most."""
    remaining_states = iter(states)
    return all(
        any(
            time == state_time and energy in energies and len(energies) <= most_lost
            for state_time, energies in remaining_states
        )
        for time, energy in read_states
    )
