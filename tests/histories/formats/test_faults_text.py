"""Damaged glstat and matsum give an error of d2rpick, or the numbers that a plain reader finds in the lines."""

import re

import numpy as np
import pytest
from hypothesis import given

from d2rpick.base.errors import FormatError
from d2rpick.histories.formats import glstat, matsum
from tests.faults import (
    FAULTS,
    Fault,
    damage,
    is_within,
    make_settings,
    read_glstat_states,
    read_matsum_states,
)
from tests.text_files import make_glstat_text, make_matsum_text

IDS = [1, 12, 13]
GLSTAT = make_glstat_text(np.arange(8) / 8, np.arange(8) ** 3 - 10)
MATSUM = {
    lines: make_matsum_text(
        np.arange(8) / 8, IDS, 10.0 * np.arange(8)[:, None] + np.array(IDS), lines
    )
    for lines in (3, 4)
}


def borders(text: bytes, start: bytes) -> list[int]:
    return [match.start() for match in re.finditer(rb"(?m)^" + re.escape(start), text)]


def legs(text: bytes) -> int:
    """Return how many states may be left out: the last one before each head, and the last one of the file."""
    return 1 + text.count(b"ls-dyna") - (b"ls-dyna" in b"".join(text.split(b"\n")[1:2]))


def check_glstat(faults: list[Fault]) -> bool:
    """Return True if the damaged file could be read."""
    text = damage(GLSTAT, faults, borders(GLSTAT, b" dt of cycle"))
    states = read_glstat_states(text)
    try:
        run = glstat.Glstat(text, "glstat", ["internal energy"])
        energy = run.channel("internal energy").tolist()
    except FormatError:
        return False
    states_read = list(zip(run.time.tolist(), energy, strict=True))
    assert is_within(states_read, states), (states_read, states)
    assert len(states_read) >= len(states) - legs(text), (states_read, states)
    assert run.complete or run.notes
    return True


def check_matsum(faults: list[Fault], lines: int) -> bool:
    whole = MATSUM[lines]
    text = damage(
        whole, faults, sorted(borders(whole, b" time =") + borders(whole, b" mat.#="))
    )
    readable = 0
    for ids in ([12], IDS):
        try:
            run = matsum.Matsum(text, "matsum")
            energies = run.part_channel("internal_energy", ids).tolist()
        except FormatError:
            continue
        readable += 1
        for column, id_ in enumerate(ids):
            states_read = [
                (time, row[column])
                for time, row in zip(run.part_time.tolist(), energies, strict=True)
            ]
            states = read_matsum_states(text, id_)
            # If one part is read, only its lines are compared, not those of other parts that may have its number.
            assert is_within(states_read, states, most_lost=1 if ids == IDS else 2), (
                id_,
                states_read,
                states,
            )
            assert len(states_read) >= len(states) - legs(text), (states_read, states)
        assert run.complete or run.notes
    return readable > 0


@make_settings(40)
@given(FAULTS)
def test_glstat(faults: list[Fault]) -> None:
    check_glstat(faults)


@pytest.mark.parametrize("lines", MATSUM)
@make_settings(40)
@given(faults=FAULTS)
def test_matsum(lines: int, faults: list[Fault]) -> None:
    check_matsum(faults, lines)


def test_a_first_line_longer_than_any_is_no_fault() -> None:
    """A file of which the disk lost a block of bytes."""
    text = MATSUM[3]
    second = borders(text, b" time =")[1]
    blank = text[: second + 10] + bytes(1400) + text[second + 1410 :]
    with pytest.raises(FormatError):
        matsum.Matsum(blank, "matsum")


@pytest.mark.parametrize("byte", [b"\0", b" ", b"*", b"\xff"])
@pytest.mark.parametrize(
    "line", [b" time step", b" kinetic", b" internal", b" total energy.", b" time per"]
)
def test_states_of_glstat_that_were_blanked_from_line_to_like_line_are_not_lost_silently(
    byte: bytes, line: bytes
) -> None:
    """If bytes between two equal lines are lost, the rest is a state with all lines, one of which is very long."""
    first, last = (borders(GLSTAT, line)[state] for state in (2, 5))
    for inside in (0, 20):
        blank = (
            GLSTAT[: first + inside] + byte * (last - first) + GLSTAT[last + inside :]
        )
        with pytest.raises(
            FormatError, match=r"missing, cut or doubled|a number in its columns"
        ):
            glstat.Glstat(blank, "glstat").channel("internal energy")


@pytest.mark.parametrize(
    "line", [b" mat.#=   12", b" x-rbv", b" y-mom", b" mat.#=   13"]
)
def test_states_of_matsum_that_were_blanked_from_line_to_like_line_are_not_lost_silently(
    line: bytes,
) -> None:
    text = MATSUM[4]
    of_state = text[borders(text, b" time =")[0] :].index(line)
    first, last = (borders(text, b" time =")[state] + of_state for state in (2, 5))
    for inside in (0, 9):
        blank = text[: first + inside] + bytes(last - first) + text[last + inside :]
        with pytest.raises(
            FormatError, match=r"missing, cut or doubled|a number in its columns"
        ):
            matsum.Matsum(blank, "matsum").part_channel("internal_energy", IDS)


def test_a_fragment_of_another_state_is_refused() -> None:
    """If lines of one state get into another, a name occurs twice, or a line lacks some of its columns."""
    states = GLSTAT.split(b" dt of cycle")
    energy = states[4].index(b" internal energy")
    torn = states[4][: energy + 27] + states[2][states[2].index(b" hourglass") :]
    doubled = states[4][:energy] + states[2][states[2].index(b" kinetic") :]
    for mixed in (torn, doubled):
        run = glstat.Glstat(
            b" dt of cycle".join([*states[:4], mixed, *states[5:]]), "glstat"
        )
        with pytest.raises(FormatError, match="missing, cut or doubled"):
            run.channel("internal energy")
        with pytest.raises(FormatError, match="missing, cut or doubled"):
            run.channel("kinetic energy")
