"""A switched run is recognised by its energy alone, and a reference run is never treated as a switched run."""

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from d2rpick.base.errors import RangeError
from d2rpick.choice.switched.frozen import find_frozen_times, refuse_switched
from d2rpick.histories.history import History

OMEGA = 250.0
TR, TD, END = 0.0135, 0.0687, 0.15


def make_history(time: np.ndarray, energy: np.ndarray) -> History:
    """Return a history of one energy."""
    return History(time, energy, source=("run.csv",), format="csv", channel="E")


def compute_reference(time: np.ndarray, damping: float, preload: float) -> np.ndarray:
    """Return the energy of a damped oscillator that starts with velocity only, over a constant energy."""
    deformation = np.exp(-damping * time) * np.sin(OMEGA * time)
    return preload + 100.0 * deformation**2


def compute_switched(
    time: np.ndarray, tr: float, td: float, damping: float, preload: float
) -> np.ndarray:
    """Return the energy of a run that is rigid from tr to td and released at rest with the deformation at tr."""
    before = compute_reference(time, damping, preload)
    frozen = compute_reference(np.array([tr]), damping, preload)[0] - preload
    after = np.exp(-damping * (time - td)) * np.cos(OMEGA * (time - td))
    rigid = np.where(time < td, frozen, frozen * after**2)
    return np.where(time < tr, before, preload + rigid)


@given(
    share=st.floats(0.2, 0.9),
    damping=st.floats(0.0, 50.0),
    preload=st.floats(0.0, 1000.0),
    states=st.integers(1001, 4001),
)
@settings(max_examples=30, deadline=None)
def test_the_rigid_time_is_found_to_within_a_state(
    share: float, damping: float, preload: float, states: int
) -> None:
    time = np.linspace(0.0, END, states)
    # Half a period after the start, the deformation has passed through its full range of levels.
    tr = (2 + share) * np.pi / OMEGA / 2
    history = make_history(time, compute_switched(time, tr, TD, damping, preload))
    ((start, end),) = find_frozen_times(history)
    step = time[1]
    assert tr - step <= start <= tr + step
    assert TD - step <= end <= TD + step
    with pytest.raises(RangeError, match="this is a switched run"):
        refuse_switched(history, 0.0, 0.1)
    refuse_switched(history, TD + step, 0.1)


@given(
    damping=st.floats(0.0, 2000.0),
    preload=st.floats(0.0, 1000.0),
    states=st.integers(301, 2001),
)
@settings(max_examples=30, deadline=None)
def test_a_run_without_a_switch_is_not_refused(
    damping: float, preload: float, states: int
) -> None:
    time = np.linspace(0.0, END, states)
    history = make_history(time, compute_reference(time, damping, preload))
    assert find_frozen_times(history) == ()


@pytest.mark.parametrize("rise", [0.0, 5.0])
def test_a_flight_in_which_nothing_vibrates_is_not_taken_for_a_rigid_window(
    rise: float,
) -> None:
    """The contact that ends such a flight adds energy, even if the energy vibrated before it suddenly stopped."""
    time = np.linspace(0.0, END, 1501)
    energy = compute_switched(time, TR, TD, 0.0, 10.0)
    frozen = energy[np.searchsorted(time, TR) + 2]
    contact = np.clip((time - TD) / 0.01, 0.0, 1.0)
    after = frozen + (rise + 1.0) * contact
    assert (
        find_frozen_times(make_history(time, np.where(time < TD, energy, after))) == ()
    )
