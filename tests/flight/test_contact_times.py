"""Contact times from momenta, for a part that falls and bounces as computed here."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import example, given as over, settings, strategies as st

from d2rpick.flight.contact_times import find_contact_times
from d2rpick.histories.history import EXACT, Momenta
from d2rpick.histories.names import Part
from d2rpick.histories.surroundings import Surroundings

MASS, GRAVITY = 2.0, 9.81


def make_bouncing_part(
    contacts: list[tuple[float, float]],
    end: float,
    interval: float,
    gravity: float = GRAVITY,
) -> Momenta:
    """Return the momentum of a part that a constant force turns back in each contact, without a state at its ends."""
    time = np.arange(0.0, end + interval / 2, interval)
    impulses = [
        40.0 * MASS * (0.05 + 0.02 * contact_number)
        for contact_number in range(len(contacts))
    ]
    contacts_and_impulses = zip(contacts, impulses, strict=True)
    impulse = sum(
        size * (np.clip(time, *span) - span[0]) / (span[1] - span[0])
        for span, size in contacts_and_impulses
    )
    values = np.zeros((time.size, 1, 3))
    values[:, 0, 2] = -MASS * gravity * time + impulse - 1.0
    values[:, 0, 0] = 3.0
    part = (Part(1, "ball"),)
    return Momenta(
        time,
        values,
        part,
        EXACT,
        (0,),
        masses=np.array([MASS]),
        surroundings=Surroundings(),
    )


@settings(max_examples=15)
@example(0.028825, 2.97249461311557)
@over(st.floats(0.0, 1.0), st.floats(0.2, 3.0))
def test_every_contact_is_seen_within_half_an_interval(
    shift: float, length: float
) -> None:
    """A contact inside one interval is placed in its middle third, with an error of at most 2/3 of an interval."""
    interval = 1e-3
    sliver = 0.01 * interval  # a push shorter than this in one interval is invisible
    contacts = [
        (0.1 + shift * interval, 0.1 + (shift + length) * interval),
        (0.3037, 0.3115),
    ]
    contact_times = find_contact_times(make_bouncing_part(contacts, 0.6, interval))
    assert contact_times is not None
    assert len(contact_times.spans) == 2
    for span, contact in zip(contact_times.spans, contacts, strict=True):
        is_short = contact[1] - contact[0] < interval + 2 * sliver
        tolerance = interval * (2 / 3 if is_short else 1 / 2) + sliver
        assert span == pytest.approx(contact, abs=tolerance)
    assert contact_times.interval == pytest.approx(interval)


def test_without_gravity_a_push_is_seen_too() -> None:
    contact_times = find_contact_times(
        make_bouncing_part([(0.1, 0.11)], 0.5, 1e-3, gravity=0.0)
    )
    assert contact_times is not None
    assert np.array(contact_times.spans) == pytest.approx(
        np.array([[0.1, 0.11]]), abs=1.1e-3
    )


def test_the_speed_is_that_at_the_end_of_the_longest_flight() -> None:
    contact_times = find_contact_times(
        make_bouncing_part([(0.1, 0.11)], 0.5, 1e-3, gravity=0.0)
    )
    assert contact_times is not None
    assert contact_times.speed == pytest.approx(np.hypot(1.5, 40.0 * 0.05 - 0.5))


def test_of_what_never_flies_nothing_is_known() -> None:
    momenta = make_bouncing_part([], 0.5, 1e-3)
    shaken = momenta.values + 5 * np.sin(momenta.time * 300)[:, np.newaxis, np.newaxis]
    assert find_contact_times(replace(momenta, values=shaken)) is None
