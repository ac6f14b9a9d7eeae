"""Judging one pair of times."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from d2rpick.choice.settings import Settings
from d2rpick.choice.situation import examine
from d2rpick.choice.suggest import suggest
from d2rpick.choice.verify import verify, verify_at
from d2rpick.errors import RangeError
from tests import paper
from tests.energies import codes, of, rollover

if TYPE_CHECKING:
    from d2rpick.histories.history import History

PLAIN = Settings()


def test_without_a_known_flight_the_verdict_is_unknown() -> None:
    history = rollover()
    flying = history.time > 0.1
    answer = suggest(of(history.energy[flying], history.time[flying]), 0.37, PLAIN)
    assert answer.situation.flight.start is None
    assert answer.recommended is None
    assert {"no-flight", "no-candidate"} <= codes(answer)
    judged = verify(of(history.energy[flying], history.time[flying]), 0.12, 0.37, PLAIN)
    assert (judged.tr_ok, judged.verified) == (None, False)


def test_the_sign_is_judged_before_the_tolerance() -> None:
    judged = verify(paper.history(), 0.0122658849405802, paper.TD, Settings(tolerance=1.0))
    assert judged.tr_ok is False
    assert judged.reasons == ("opposite sign of the deformation",)


def test_verify_measures_what_suggest_measures() -> None:
    best = suggest(paper.history(), paper.TD, PLAIN).candidates[0]
    judged = verify(paper.history(), best.tr, paper.TD, PLAIN)
    same = (
        "energy",
        "energy_ratio",
        "lock_in_error",
        "residual",
        "sign_match",
        "rigid_time",
        "timing_tolerance",
    )
    for name in same:
        assert getattr(judged.candidate, name) == pytest.approx(getattr(best, name), rel=1e-9, abs=1e-9)
    assert judged.verified
    assert judged.td_ok is False  # a kinetic share of 0.92


def ringing() -> History:
    """Three modes and noise, finely sampled: of several modes a tr may be a closest match, which is off the level."""
    time = np.linspace(0, 0.5, 10_001)
    modes = [(5, 4, 300, 0.3), (2, 6, 777, 1), (1, 9, 1500, 2)]
    energy = sum(a * np.exp(-alpha * time) * np.sin(omega * time + phase) ** 2 for a, alpha, omega, phase in modes)
    return of(energy + 0.01 * np.abs(np.random.default_rng(5).standard_normal(time.size)), time)


def test_verify_remarks_what_suggest_remarks_on_every_tr() -> None:
    history, asked = ringing(), Settings(after=0.05)
    found = suggest(history, 0.4, asked).candidates
    assert {"crossing", "match"} <= {one.kind for one in found}
    situation = examine(history, 0.4, asked)
    for one in found:
        judged = verify_at(situation, one.tr).candidate
        assert judged.notes == one.notes
        assert (judged.tr_low, judged.tr_high) == pytest.approx((one.tr_low, one.tr_high), rel=1e-9)


@pytest.mark.parametrize(("tr", "td"), [(0.064, 0.064), (0.07, 0.064), (-0.1, 0.064), (0.01, 0.2)])
def test_pairs_that_are_none_are_refused(tr: float, td: float) -> None:
    with pytest.raises(RangeError):
        verify(paper.history(), tr, td, PLAIN)
