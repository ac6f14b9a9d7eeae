"""A pair is refused if it is estimated to return more energy than the reference run ever has."""

from dataclasses import replace

import numpy as np
import pytest

from d2rpick.choice.answers import suggest_at, verify_at
from d2rpick.choice.pair.candidates import judge_times
from d2rpick.choice.pair.situation import Situation, examine_td
from d2rpick.choice.pair.warnings import (
    MOST_KEPT,
    estimate_time_after,
    find_largest_energy,
)
from d2rpick.choice.pair.windows import find_acceptable_windows
from d2rpick.choice.question import Settings
from d2rpick.choice.td.trade_off import make_offers
from d2rpick.rules.judgement import find_faults
from tests.energies import make_energy_history, require

TIME = np.linspace(0, 1, 2001)
# Two modes in flight until 0.8, then an unreported crash; the mean before td is far below the energy after it.
ENERGY = (2 + np.sin(90 * TIME) + 0.8 * np.sin(173 * TIME)) * np.where(
    TIME > 0.8, 50.0, 1.0
)


def examine_at(td: float, energy: np.ndarray = ENERGY) -> Situation:
    """Return the situation at a td in a flight that begins at 0.1 and has no known end."""
    situation = examine_td(
        make_energy_history(energy, TIME), td, Settings(after=0.1, replay=False)
    )
    return replace(
        situation, flight=situation.flight._replace(start=0.1, end=None, refusal=None)
    )


def test_a_pair_that_gives_back_more_than_there_is_is_refused_by_all_that_judge_it() -> (
    None
):
    situation = examine_at(0.95)
    assert estimate_time_after(situation, situation.energy_td).ratio > 2  # type: ignore[union-attr, operator]
    answer = suggest_at(situation, with_better=False)
    assert answer.recommended is None
    (why,) = (
        remark.message for remark in answer.cautions if remark.code == "no-candidate"
    )
    assert "times that of the reference run, but at most 1.2 was expected" in why
    crossing = next(
        remark
        for remark in answer.candidates
        if remark.level_error == pytest.approx(0, abs=1e-6)
    )
    verdict = verify_at(situation, crossing.tr)
    assert not verdict.verified
    assert "times that of the reference run" in verdict.reasons[0]
    assert [fault.rule for fault in find_faults(verdict)] == ["D2R201"]
    (offer,) = make_offers([situation], set())
    assert offer.best is None
    assert not find_acceptable_windows(situation, answer.candidates, None).size


def test_up_to_the_limit_it_is_accepted_and_the_windows_end_there() -> None:
    """At a td on the highest peak, the higher levels within the tolerance return too much energy."""
    energy = 0.1 + np.sin(61 * TIME) ** 2 * (1 + 0.9 * np.sin(4.4 * TIME + 0.4))
    peak = TIME[np.argmax(energy * (TIME < 0.6))]
    situation = examine_at(float(peak), energy)
    candidates = suggest_at(situation, with_better=False).candidates
    windows = find_acceptable_windows(situation, candidates, None)
    grid = np.linspace(0.1, float(windows[-1, 1]), 3000)
    judged = judge_times(situation, grid.tolist()).recommendable
    levels = situation.vibration.whole.energies(grid)
    assert judged.any()
    assert levels[judged].max() <= find_largest_energy(situation)
    is_within_limit = np.abs(np.sqrt(levels / situation.energy_td) - 1) <= 0.2
    assert (
        judged == (is_within_limit & (levels <= find_largest_energy(situation)))
    ).all()
    expected_energy = require(
        estimate_time_after(situation, find_largest_energy(situation))
    )
    assert expected_energy.ratio == pytest.approx(MOST_KEPT)
    inside = (windows[:, :1] <= grid) & (grid <= windows[:, 1:])
    assert (inside.any(axis=0) == judged).mean() > 0.999
