"""Contact times from forces and impulses at states, which are exact to half an interval."""

import numpy as np
import pytest
from hypothesis import given, strategies as st

from d2rpick.flight.contact_times import find_force_times
from d2rpick.histories.contact_forces import ContactForce

STEP = 0.01
TIME = np.arange(101, dtype=np.float64) * np.float64(STEP)
FORCE = 3.0


def integrate_constant_force(start: float, end: float) -> ContactForce:
    """Return a constant force from ``start`` to ``end``, as impulses since the start of the run."""
    pushed = FORCE * (np.clip(TIME, start, end) - start)
    return ContactForce.of_impulses("interface 1", TIME, np.outer(pushed, [0, 0, 1]))


@given(start=st.floats(0.02, 0.6), length=st.floats(2.01 * STEP, 0.3))
def test_ends_are_within_half_an_interval(start: float, length: float) -> None:
    force_times = find_force_times(integrate_constant_force(start, start + length))
    assert force_times is not None
    ((begins, ends),) = force_times.spans
    assert begins == pytest.approx(start, abs=0.501 * STEP)
    assert ends == pytest.approx(start + length, abs=0.501 * STEP)


@given(start=st.floats(0.02, 0.9), length=st.floats(1e-4, 2 * STEP))
def test_a_short_force_has_a_time_within_its_intervals(
    start: float, length: float
) -> None:
    force_times = find_force_times(integrate_constant_force(start, start + length))
    assert force_times is not None
    ((begins, ends),) = force_times.spans
    assert begins < ends
    assert begins == pytest.approx(start, abs=STEP)
    assert ends == pytest.approx(start + length, abs=STEP)


def test_a_force_at_the_ends_of_the_record_has_no_end_seen() -> None:
    force_times = find_force_times(integrate_constant_force(0.0, 1.0))
    assert force_times is not None
    assert force_times.spans == ((0.0, 1.0),)


def test_only_a_force_above_the_least_counts() -> None:
    force = integrate_constant_force(0.2, 0.4)
    above, below = find_force_times(force, 2.9), find_force_times(force, 3.1)
    assert above is not None
    assert below is not None
    assert len(above.spans) == 1
    assert below.spans == ()
    changes = ContactForce.of_changes("wall force", TIME, TIME[:, np.newaxis])
    assert find_force_times(changes, 1.0) is None
