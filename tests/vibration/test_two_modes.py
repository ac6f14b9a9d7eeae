"""Windows in which known modes show that no single oscillator describes them."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from d2rpick.histories.history import History
from d2rpick.vibration.identify import identify
from d2rpick.vibration.modal_span import identify_window
from d2rpick.vibration.span import Span
from d2rpick.vibration.two_modes import KnownLines, shows_two_modes
from tests.energies import require
from tests.records import make_table
from tests.vibration.linear_structure import LinearStructure

TIME = np.linspace(0.0, 8.0, 1201)


def find_lines(history: History, first: float = 0.0) -> KnownLines:
    """Return the lines of a record from a time on."""
    span = Span(first, float(TIME[-1]))
    vibration = require(identify_window(history, span))
    return KnownLines(vibration.reading.spectrum.lines, *span)


@settings(max_examples=30, deadline=None)
@given(
    st.integers(0, 10**6),
    st.integers(1, 5),
    st.floats(0.0, 0.8),
    st.floats(0.1, 0.5),
    st.sampled_from([0.0, 0.02]),
)
def test_no_oscillator_describes_a_window_that_shows_two_modes(
    seed: int, count: int, first: float, length: float, noise: float
) -> None:
    energy = LinearStructure.draw(seed, count).elastic_energy(TIME)
    random = np.random.default_rng(seed)
    history = make_table(
        TIME, energy + noise * np.std(energy) * random.normal(size=1201)
    )
    vibration = require(identify_window(history, Span(0.0, 8.0)))
    known = KnownLines(vibration.reading.spectrum.lines, 0.0, 8.0)
    window = Span(8 * first, 8 * min(first + length, 1.0))
    if vibration.convinces and shows_two_modes(history, known, window):
        assert not identify(*history.between(*window)).describes_record


def draw_lasting(seed: int) -> LinearStructure:
    """Draw five equally large modes that hardly decay in the record."""
    structure = LinearStructure.draw(seed, 5)
    return structure._replace(amplitude=np.ones(5), damping=0.1 * structure.damping)


@pytest.mark.parametrize("seed", range(6))
def test_most_windows_of_many_modes_show_two_of_them(seed: int) -> None:
    structure = draw_lasting(seed)
    history = make_table(TIME, structure.elastic_energy(TIME))
    known = find_lines(history)
    for window in (Span(0.0, 8.0), Span(1.0, 6.0), Span(4.0, 8.0)):
        assert shows_two_modes(history, known, window)


@pytest.mark.parametrize("preload", [0.0, 0.3, 1.0, 3.0])
def test_an_oscillator_with_or_without_a_preload_never_shows_two_modes(
    preload: float,
) -> None:
    deformation = np.exp(-0.05 * TIME) * np.cos(9.0 * TIME) + preload
    history = make_table(TIME, deformation**2)
    known = find_lines(history)
    for window in (Span(0.0, 8.0), Span(1.0, 3.0), Span(6.0, 8.0)):
        assert not shows_two_modes(history, known, window)


def test_modes_show_nothing_where_they_are_unknown_or_too_short_to_differ() -> None:
    structure = draw_lasting(1)
    history = make_table(TIME, structure.elastic_energy(TIME))
    known = find_lines(history, 4.0)
    assert shows_two_modes(history, known, Span(2.0, 8.0))
    assert not shows_two_modes(history, known, Span(0.0, 3.9))
    assert not shows_two_modes(history, known, Span(7.9, 8.0))


def test_a_window_without_states_shows_nothing() -> None:
    history = make_table(TIME, draw_lasting(1).elastic_energy(TIME))
    assert not shows_two_modes(history, find_lines(history), Span(1.001, 1.002))
