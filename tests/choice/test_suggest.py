"""What suggest decides: the published example, a computed rollover, the end of the flight, units."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from d2rpick.choice.answers import suggest
from d2rpick.choice.situation import Settings
from d2rpick.vibration.oscillator import to_mode
from tests import paper
from tests.energies import codes, of, rollover, sure, vibration

PLAIN = Settings()


# ---- the published example


def test_the_published_example_is_recommended_warned_of_and_bettered() -> None:
    answer = suggest(paper.history(), paper.TD, PLAIN)
    assert answer.recommended is not None
    assert answer.better_pair is not None
    assert answer.recommended.tr == pytest.approx(0.0128852793630525, rel=1e-9)
    assert answer.recommended.residual == pytest.approx(0.957444, abs=1e-6)
    assert (answer.better_pair.td, answer.better_pair.tr) == pytest.approx((paper.BETTER_TD, paper.BETTER_TR), rel=1e-8)
    assert answer.better_pair.residual == pytest.approx(0.0, abs=1e-6)
    assert answer.situation.kinetic_share == pytest.approx(paper.KINETIC_SHARE, rel=1e-8)
    assert codes(answer) == {"poor-td"}


def test_a_given_oscillator_answers_as_the_identified_one() -> None:
    given_one = suggest(paper.history(), paper.TD, Settings(oscillator=to_mode(paper.OSCILLATOR, 6.0)))
    identified = suggest(paper.history(), paper.TD, PLAIN)
    assert [c.tr for c in given_one.candidates] == pytest.approx([c.tr for c in identified.candidates], rel=1e-8)
    assert given_one.recommended is not None


# ---- the computed rollover


def test_the_rollover_is_switched_after_the_trip() -> None:
    answer = suggest(rollover(), 0.37, PLAIN)
    assert answer.situation.basis == "energy"
    assert 0.0908 <= sure(answer.recommended).tr <= 0.185
    assert "flight-from-energy" in codes(answer)
    for c in answer.candidates:
        assert (c.sign_match, c.lock_in_error, c.residual, c.timing_tolerance) == (None, None, None, None)


def test_td_after_the_next_contact_is_not_acceptable() -> None:
    time = np.arange(0, 3, 0.01)
    energy = np.sin(2 * np.pi * time) ** 2 + np.where(time > 2.5, 40 * (time - 2.5), 0)
    answer = suggest(of(energy, time), 2.8, Settings(fit_window=(0.0, 2.4)))
    assert answer.recommended is None
    before = suggest(of(energy, time), 2.4, PLAIN)
    assert before.recommended is not None
    assert before.situation.flight.end == pytest.approx(2.5, abs=0.03)


@settings(max_examples=25, deadline=None)
@given(st.floats(-50, 50), st.sampled_from([1e-3, 1.0, 1e3]), st.sampled_from([1e-6, 1.0, 1e6]))
def test_units_do_not_matter(shift: float, unit: float, joule: float) -> None:
    plain = vibration(decay=0.3)
    there = of(joule * plain.energy, unit * (plain.time + shift))
    expected = suggest(plain, 3.1, PLAIN)
    found = suggest(there, float(unit * (3.1 + shift)), PLAIN)
    assert expected.recommended is not None
    assert found.recommended is not None
    assert found.recommended.tr / unit - shift == pytest.approx(expected.recommended.tr, abs=1e-7)
    assert found.recommended.residual == pytest.approx(expected.recommended.residual, abs=1e-6)


def test_a_vibration_that_has_died_down_to_nothing_at_td_has_no_sign_there() -> None:
    time = np.linspace(0.0, 0.01, 400)
    answer = suggest(of(np.exp(-8e4 * time) * np.sin(3000.0 * time) ** 2, time), 0.01, Settings())
    assert answer.situation.basis == "energy"
    assert answer.recommended is None
