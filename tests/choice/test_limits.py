"""A limit of a recommendation refuses pairs, is explained, and cuts windows, whatever quantity it limits."""

from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import given, settings, strategies as st

from d2rpick.base.data_classes import dataclass
from d2rpick.choice.answers import suggest_in_history, verify_in_history
from d2rpick.choice.options import Limit
from d2rpick.choice.pair.windows import find_acceptable_windows
from d2rpick.choice.question import Settings, read_reference
from d2rpick.choice.runs.study import make_row
from d2rpick.choice.td.plan import plan_run
from d2rpick.choice.td.trade_off import explore_run
from d2rpick.histories.history import Samples
from d2rpick.rules.judgement import find_faults
from tests.command import ENERGY, run

TR, TD = 0.0135867, 0.0687534
REFERENCE = read_reference([ENERGY])
# A limit longer than the record, which no pair can meet.
ENDLESS = 1.0


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class WithLeastRigidTime(Settings):
    """Settings with a made-up limit: the shortest rigid time that is worth a restart [time]."""

    least_rigid_time: float

    @property
    def limits(self) -> Iterator[tuple[Limit, float]]:
        """The limits that the user has set, and the made-up one."""
        yield from super().limits
        yield Limit("rigid_time", is_lower=True), self.least_rigid_time


def find_windows(asked: Settings) -> Samples:
    """Return the windows of acceptable tr for the td of the paper."""
    answer = suggest_in_history(REFERENCE.history, TD, asked)
    best = answer.chosen.tr if answer.chosen else None
    return find_acceptable_windows(answer.situation, answer.candidates, best)


def test_a_made_up_limit_is_kept_by_every_answer() -> None:
    asked = WithLeastRigidTime(least_rigid_time=ENDLESS)
    history = REFERENCE.history
    assert verify_in_history(history, TR, TD, Settings()).admissible
    verdict = verify_in_history(history, TR, TD, asked)
    assert not verdict.admissible
    reason = "rigid time 0.0552 below the limit 1"
    assert verdict.reasons == (reason,)
    assert [fault.rule for fault in find_faults(verdict)] == ["D2R210"]
    assert next(find_faults(verdict)).message.startswith(reason)
    suggestion = suggest_in_history(history, TD, asked)
    assert suggestion.recommended is None
    assert "below the limit 1" in suggestion.why_none
    row = make_row("energy.csv", suggestion)
    assert (row.tr, row.message) == (None, suggestion.why_none)
    assert not row.acceptable.size
    assert not find_windows(asked).size
    explored = explore_run(REFERENCE, asked, (0.06, 0.07), steps=5)
    (message,) = (
        caution.message
        for caution in explored.cautions
        if caution.code == "no-candidate"
    )
    assert message.endswith("below the limit 1")
    assert not [
        flight for flight in plan_run(REFERENCE, asked).flights if flight.window
    ]


@settings(max_examples=6)
@given(least=st.floats(0.0, TD))
def test_a_window_is_cut_where_the_limit_is_reached(least: float) -> None:
    asked = WithLeastRigidTime(least_rigid_time=least)
    windows = find_windows(asked)
    step = REFERENCE.history.step
    for start, end in find_windows(Settings()).tolist():
        kept_end = min(end, TD - least)
        cut = windows[(windows[:, 1] >= start) & (windows[:, 0] <= end)]
        if kept_end - start > step:
            assert cut.tolist() == [
                [pytest.approx(start), pytest.approx(kept_end, abs=1e-6 * step)]
            ]
    for tr in windows.ravel().tolist():
        assert verify_in_history(REFERENCE.history, tr, TD, asked).admissible


@pytest.mark.parametrize(
    "asked",
    [Settings(max_residual=0.0), Settings(max_kinetic_share=0.0)],
    ids=["residual", "kinetic"],
)
def test_a_flight_in_which_nothing_vibrates_meets_every_limit_of_the_vibration(
    tmp_path: Path, asked: Settings
) -> None:
    """Its residual and kinetic fraction are None, not because they are unknown, but because its error is 0."""
    fall = str(tmp_path / "fall.matsum")
    run("rollover", "--drop", "0.4", "--tilt", "30", "--dt", "2e-3", "-o", fall)
    history = read_reference([fall]).history
    td = 0.2
    suggestion = suggest_in_history(history, td, asked)
    assert suggestion.situation.at_rest
    assert suggestion.chosen
    assert suggestion.chosen.residual is None
    assert suggestion.kinetic_share is None
    verdict = verify_in_history(history, suggestion.chosen.tr, td, asked)
    assert verdict.admissible
    assert not verdict.reasons
    first_flight = plan_run(read_reference([fall]), asked).flights[0]
    assert first_flight.window
    assert first_flight.answer
    assert first_flight.answer.situation.at_rest
    # A vibrating flight is still refused.
    assert suggest_in_history(history, 0.75, asked).chosen is None
