"""Order of candidates, limits of a recommendation, and the grade."""

import re
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings, strategies as st

from d2rpick.api import read, verify
from d2rpick.choice.answers import suggest_in_history, verify_in_history
from d2rpick.choice.pair.candidates import Candidate
from d2rpick.choice.pair.grades import GRADES
from d2rpick.choice.pair.quality import (
    EQUALLY_GOOD,
    Cause,
    Errors,
    Grade,
    Quality,
    count_states_per_period,
    grade_pair,
    list_causes_of_record,
    list_exceeded_limits,
    order_by_quality,
    rank_candidates,
    rank_judged,
    trust_measured_momentum,
)
from d2rpick.choice.pair.situation import examine_td
from d2rpick.choice.question import Settings
from d2rpick.histories.history import History
from d2rpick.report.formats import DisplayOptions
from d2rpick.report.suggestion import as_table
from tests import paper
from tests.energies import make_energy_history, read_rollover, require
from tests.reading import read_solved
from tests.records import ENERGY, TIME, make_mode

rows = st.lists(
    st.tuples(
        st.floats(0, 0.9),
        st.one_of(st.floats(0, 0.1), st.floats(0, 2), st.just(np.inf)),
        st.sampled_from([0, 1, 2]),
        st.booleans(),
        st.floats(0.5, 1),
    ),
    max_size=12,
)

RECORD = make_energy_history(ENERGY, TIME)
ALL_GOOD = Quality(Grade("good"), Grade("good"), Grade("good"))
UNIT, FINE = np.linspace(0, 1, 401), np.linspace(0, 1, 2001)
DAMPED = 100 + 2.6 * np.exp(-40 * FINE) * (1 + np.cos(150 * FINE) * np.cos(97 * FINE))
STATES = np.arange(400)
EARLY = np.where(STATES < 12, 1e-12, 1.0 + np.sin(STATES) ** 2)


def test_limits_that_cannot_be_judged_are_not_kept() -> None:
    settings_asked = Settings(max_residual=10.0, replay=False)
    answer = suggest_in_history(read_rollover(), 0.37, settings_asked)
    assert answer.recommended is None
    judged = verify_in_history(read_rollover(), 0.0886, 0.37, settings_asked)
    assert "residual unknown" in " ".join(judged.reasons)


class Ranked(NamedTuple):
    """A candidate of `order_by_quality`."""

    rigid: float
    error: float
    group: int
    is_out_of_place: bool
    expected: float
    is_good: bool


def select_alike(ranked: list[Ranked]) -> list[Ranked]:
    """Return the candidates that the band of the best one does not distinguish from it, within its grade."""
    smallest = min(row.error for row in ranked)
    expected = min(row.expected for row in ranked if row.error == smallest)
    limit = max(smallest, expected)
    highest = max(2 * smallest**2 - expected**2, limit**2) ** 0.5
    if np.isinf(smallest):
        highest = np.inf
    limit = min([limit, *(bound for bound in (0.5, 1.0) if expected <= bound)])
    return [row for row in ranked if row.expected <= limit and row.error <= highest]


@given(rows, st.booleans())
def test_the_order_of_candidates(
    drawn: list[tuple[float, float, int, bool, float]], has_good: bool
) -> None:
    candidate_rows = [
        Ranked(*row[:4], row[1] * row[4], has_good and row[1] <= 0.2 and row[4] > 0.8)
        for row in drawn
    ]
    rigid, error, group, is_out_of_place, expected, is_good = (
        np.array([row[column] for row in candidate_rows], dtype)
        for column, dtype in enumerate((float, float, np.int32, bool, float, bool))
    )
    order_found = order_by_quality(
        group,
        Errors(error, expected, is_good),
        rigid,
        is_out_of_place,
        np.full(3, EQUALLY_GOOD),
    ).tolist()
    # differences in further decimals are due to rounding
    candidate_rows = [
        row._replace(
            error=float(np.round(row.error, 4)),
            expected=float(np.round(row.expected, 4)),
        )
        for row in candidate_rows
    ]
    assert sorted(order_found) == list(range(len(candidate_rows)))
    assert [candidate_rows[i].group for i in order_found] == sorted(group.tolist())
    for number in set(group.tolist()):
        ranked = [
            candidate_rows[i] for i in order_found if candidate_rows[i].group == number
        ]
        near = min(row.error for row in ranked) + EQUALLY_GOOD
        within_band = select_alike(ranked)
        alike = [row for row in ranked if row.is_good] or [
            row for row in ranked if row.error <= near or row in within_band
        ]
        longest = max(row.rigid for row in alike)
        late = [row for row in alike if row.rigid < 0.9 * longest]
        long = [row for row in alike if row not in late]
        best = min(row.error for row in long) + EQUALLY_GOOD
        early = sorted(
            long,
            key=lambda row: (
                row.is_out_of_place,
                row.error > best,
                -row.rigid,
                row.error,
            ),
        )
        others = [row for row in ranked if row not in alike]
        rows_far_off = sorted(others, key=lambda row: (row.error, -row.rigid))
        assert [row[:4] for row in ranked] == [
            row[:4]
            for row in early + sorted(late, key=lambda row: -row.rigid) + rows_far_off
        ]


def make_errors(*errors: tuple[float, float, bool]) -> Errors:
    """Return the errors of candidates from each error, the expected part of it, and whether the pair is good."""
    error, expected, is_good = zip(*errors, strict=True)
    return Errors(np.array(error), np.array(expected), np.array(is_good, dtype=bool))


@pytest.mark.parametrize(
    ("errors", "first"),
    [
        # The band of the shorter pair does not show whether that pair is better.
        ([(0.62, 0.57, False), (0.66, 0.6, False)], 1),
        ([(0.58, 0.57, False), (0.66, 0.6, False)], 0),
        # A pair that may be far worse is not equal to the best pair.
        ([(0.62, 0.57, False), (1.5, 0.6, False)], 0),
        # The limit is neither above that of a grade nor above the residual of a release without vibration.
        ([(0.55, 0.45, False), (0.6, 0.52, False)], 0),
        ([(1.1, 0.9, False), (1.2, 1.05, False)], 0),
        # Good pairs are equally good; a pair that is slightly worse than the best of them, but not good, is not.
        ([(0.1, 0.05, True), (0.2, 0.19, True)], 1),
        ([(0.199, 0.199, True), (0.21, 0.21, False)], 0),
    ],
)
def test_a_longer_pair_is_preferred_if_the_bands_do_not_tell_it_from_the_best(
    errors: list[tuple[float, float, bool]], first: int
) -> None:
    order = order_by_quality(
        np.zeros(2, np.int32),
        make_errors(*errors),
        np.array([0.4, 0.8]),
        np.zeros(2, np.bool_),
        np.full(1, EQUALLY_GOOD),
    )
    assert order[0] == first


@pytest.mark.slow
@pytest.mark.parametrize("parts", ["1-17", "1-14"])
def test_tr_does_not_jump_when_td_moves_a_little(parts: str) -> None:
    """A jump from 49.6 to 82.4 ms for a td that is 3 ms later would gain nothing, as the mean energy hardly changes."""
    history, grades = read_solved("carT01.gz", parts).history, []
    for td in np.arange(0.141, 0.1502, 0.0015).tolist():
        situation = examine_td(history, td, Settings())
        best = require(next(rank_candidates([situation])).chosen)
        assert require(best.level_error) < 0.06
        grades.append(best.tr)
    assert max(grades) - min(grades) < 3e-3
    assert min(grades) > 0.0384  # the flight begins there


def test_of_times_alike_the_one_that_leaves_the_body_in_place_is_recommended() -> None:
    situation = examine_td(read_solved("carT01.gz", "1-17").history, 0.12, Settings())
    assert situation.bodies is not None
    ranked_candidates = next(rank_candidates([situation]))

    def first(until: float) -> float:
        """Return the best tr if tr before ``until`` displace the body."""
        out_of_place = np.where(ranked_candidates.judged.moments.tr < until, 1.0, 0.0)
        return next(
            rank_judged(
                replace(
                    ranked_candidates.judged,
                    columns={
                        **ranked_candidates.judged.columns,
                        "position_error": out_of_place,
                    },
                )
            )
        )[0].tr

    best = ranked_candidates[0].tr
    assert best < 0.0395 < first(0.0395) < best + 0.1 * (0.12 - best)
    assert first(0.09) == best


@pytest.mark.parametrize(
    "limits",
    [{}, {"max_kinetic_share": 0.9, "max_residual": 0.95}, {"tolerance": 1e-3}],
)
@pytest.mark.parametrize(
    ("history", "td"),
    [(paper.make_history(), paper.TD), (read_rollover(), 0.37)],
)
def test_candidates_are_kept_together_as_one_by_one(
    history: History, td: float, limits: dict[str, float]
) -> None:
    situation = examine_td(history, td, Settings(**limits))  # type: ignore[arg-type]
    ranked = next(rank_candidates([situation]))
    assert len(ranked) > 3
    kept_flags = ranked.recommendable.tolist()
    assert kept_flags == [
        candidate.admissible and not list_exceeded_limits(situation, candidate)
        for candidate in ranked
    ]
    assert ranked.recommended == (kept_flags.index(True) if any(kept_flags) else None)
    assert [candidate.rank for candidate in ranked] == list(range(1, len(ranked) + 1))
    assert [candidate.error for candidate in ranked] == ranked.judged.error[
        ranked.order
    ].tolist()
    assert [candidate.admissible for candidate in ranked] == ranked.judged.admissible[
        ranked.order
    ].tolist()
    assert ranked[1:3] == (ranked[1], ranked[2])
    assert ranked[-1].tr == ranked.tr[-1]


def find_grade(history: History, td: float, **arguments: float | bool) -> str | None:
    """Return the grade of the recommendation at a td."""
    suggestion = suggest_in_history(history, td, Settings(**arguments)).quality  # type: ignore[arg-type]
    return suggestion.grade if suggestion else None


@settings(max_examples=15)
@given(st.floats(0.04, 0.14))
def test_the_residual_of_a_known_vibration_decides(td: float) -> None:
    answer = suggest_in_history(RECORD, td, Settings())
    if answer.chosen is None or answer.quality is None:
        return
    residual = require(answer.chosen.residual)
    assert answer.quality.grade == (
        "good" if residual <= 0.2 else "fair" if residual <= 0.5 else "poor"
    )
    assert bool(answer.quality.reasons) == (answer.quality.grade != "good")


def test_the_energy_alone_says_nothing_of_the_vibration() -> None:
    mode = make_mode(np.array([200.0, 2.0, 1.0, 0.0]))
    record = make_energy_history(mode.energy(TIME), TIME)
    at_a_peak = float(mode.peaks(0.06, 0.08)[0])
    assert find_grade(record, at_a_peak) == "good"
    assert find_grade(record, at_a_peak, replay=False, after=0.005) == "poor"
    answer = suggest_in_history(record, at_a_peak, Settings(replay=False, after=0.005))
    (reason,) = require(answer.quality).reasons
    assert reason.startswith(
        "it is unknown whether the parts are deformed in the same direction at tr and td"
    )
    assert require(answer.quality).motion == Grade("good")


def test_a_td_near_the_zero_of_the_energy_is_poor_by_the_energy_alone() -> None:
    assert find_grade(RECORD, 0.064, replay=False, after=0.005) == "poor"


@pytest.mark.parametrize(
    ("energy", "reason"),
    [
        (np.sin(40 * np.linspace(0, 1, 400)), "becomes negative"),
        (1 + 0.3 * np.sin(np.linspace(0, 1, 400) * 400), "states per period"),
    ],
    ids=["a velocity", "a coarse output"],
)
def test_a_record_that_no_level_can_be_read_from_is_poor(
    energy: np.ndarray, reason: str
) -> None:
    history = make_energy_history(energy, np.linspace(0, 1, 400))
    answers = [
        suggest_in_history(history, td, Settings(after=0.1, replay=False))
        for td in np.linspace(0.7, 0.9, 3)
    ]
    grades = [answer.quality for answer in answers if answer.quality]
    assert grades
    assert all(
        grade_found.grade == "poor"
        and any(reason in text for text in grade_found.reasons)
        for grade_found in grades
    )


def test_a_flight_that_is_not_certain_is_no_better_than_fair() -> None:
    time = np.linspace(0, 1, 500)
    waves = sum(
        (np.sin(rate * time + rate) ** 2 for rate in (30, 47, 71, 103, 151, 199)),
        np.zeros(500),
    )
    energy = np.where(time < 0.2, 50 * (0.2 - time), 0) + waves
    answer = suggest_in_history(make_energy_history(energy, time), 0.8, Settings())
    guessed = replace(
        answer.situation, flight=answer.situation.flight._replace(source="energy")
    )
    motion = grade_pair(guessed, require(answer.chosen)).motion
    assert (motion.grade, motion.reasons) == ("fair", ("the flight is not certain",))


def test_a_pair_is_graded_the_same_whether_it_is_suggested_or_verified() -> None:
    for td in (0.064, 0.0687534, 0.07):
        answer = suggest_in_history(RECORD, td, Settings())
        verdict = verify_in_history(
            RECORD, require(answer.recommended).tr, td, Settings()
        )
        assert require(verdict.quality).grade == require(answer.quality).grade
        assert grade_pair(verdict.situation, verdict.candidate).grade in GRADES
    assert verify_in_history(RECORD, 0.02, 0.064, Settings()).quality.grade == "poor"


@given(st.integers(4, 40), st.integers(3, 30))
def test_states_per_period_are_counted_over_whole_periods(
    states: int, periods: int
) -> None:
    wave = 1 + np.sin(2 * np.pi * np.arange(states * periods) / states + 0.4)
    states_per_cycle = require(count_states_per_period(wave))
    assert states_per_cycle == pytest.approx(states, rel=2 / periods)
    noise = 0.02 * np.random.default_rng(1).standard_normal(wave.size)
    noisy = count_states_per_period(wave + noise)
    assert noisy == pytest.approx(
        states, rel=2 / periods
    )  # noise about the mean must not be treated as periods


def test_without_a_period_there_are_no_states_of_one() -> None:
    assert count_states_per_period(np.ones(10)) is None
    assert count_states_per_period(np.linspace(0, 1, 50)) is None
    assert count_states_per_period(np.zeros(0)) is None


def test_rest_is_good_only_in_a_flight_that_is_certain() -> None:
    time = np.linspace(0, 1, 201)
    energy = np.where(time < 0.2, 50 * time, 10.0) + 1e-5 * np.random.default_rng(
        1
    ).random(201)
    suggestion = suggest_in_history(
        make_energy_history(energy, time), 0.9, Settings(after=0.25)
    )
    assert suggestion.situation.at_rest
    assert suggestion.quality == ALL_GOOD
    guessed = replace(
        suggestion.situation,
        flight=suggestion.situation.flight._replace(source="energy"),
    )
    assert guessed.at_rest
    quality = grade_pair(guessed, require(suggestion.chosen))
    assert (quality.grade, quality.reasons) == ("fair", ("the flight is not certain",))


def make_crushed_energy(vibration: float) -> np.ndarray:
    """Return 100 J with little vibration, so that a frozen tr at the right level may lose the whole vibration."""
    swinging = sum(np.sin(rate * UNIT + rate) ** 2 for rate in (31.0, 47.0, 66.0)) / 3
    return np.asarray(
        100 * np.minimum(UNIT / 0.1, 1) ** 2
        + vibration * np.where(UNIT > 0.1, swinging, 0)
    )


@pytest.mark.parametrize(
    ("energy", "time", "td", "energy_after", "energy_at_rest"),
    [
        (np.full(TIME.size, 3.0), TIME, 0.1, 0.01, True),
        (make_crushed_energy(0.05), UNIT, 0.9, 0.15, False), (make_crushed_energy(2.6), UNIT, 0.9, 0.15, False),
        (make_crushed_energy(0.0), UNIT, 0.9, 0.15, True),
        (DAMPED, FINE, 0.9, 0.5, True), (DAMPED, FINE, 0.9, 0.05, False),
        # One state, with td in the same output interval, says nothing about the time between them.
        (np.tile([1.5, 2.5, 1.0, 2.5], 10), np.linspace(0, 3.9, 40), 2.2, 2.15, False),
        (EARLY, 0.1 * STATES, 0.85, 0.0, False), (EARLY, 0.1 * STATES, 1.05, 0.0, True),
    ],
)  # fmt: skip
def test_rest_is_told_from_a_vibration(
    energy: np.ndarray,
    time: np.ndarray,
    td: float,
    energy_after: float,
    energy_at_rest: bool,
) -> None:
    suggestion = suggest_in_history(
        make_energy_history(energy, time), td, Settings(after=energy_after)
    )
    assert suggestion.situation.at_rest is energy_at_rest
    assert energy_at_rest is (
        suggestion.chosen is not None and suggestion.chosen.kind == "start"
    )


def test_a_tr_that_is_not_known_to_its_tolerance_is_fair() -> None:
    """Late in a damped record, the level is so low that the misfit of the oscillator shifts the crossing far."""
    history = read_solved("oscillator_referenceT01.gz").history
    early, late = (
        suggest_in_history(history, td, Settings()) for td in (0.068753, 0.144191)
    )
    for answer, wanted in ((early, "good"), (late, "fair")):
        best, quality = answer.chosen, answer.quality
        assert best is not None
        assert best.residual == pytest.approx(0, abs=1e-3)
        assert require(quality).grade == wanted
        assert (
            require(best.tr_high) - best.tr > 4 * require(best.timing_tolerance)
        ) is (wanted == "fair")
        verdict = verify_in_history(
            history, best.tr, answer.situation.td, Settings()
        ).quality
        assert verdict == require(quality)
    worst = [
        float(
            re.findall(
                r"At worst: vibration\s+error ([\d.]+)%",
                as_table(answer_of_td, DisplayOptions()),
            )[0]
        )
        for answer_of_td in (early, late)
    ]
    assert worst[0] < 10
    assert worst[1] == 46


@pytest.mark.parametrize(
    ("low", "residual", "high", "wanted"),
    [
        (0.10, 0.15, 0.19, "good"),
        (0.19, 0.20, 0.21, "good"),
        (0.19, 0.21, 0.23, "good"),
        (0.14, 0.23, 0.29, "good"),
        (0.21, 0.22, 0.23, "fair"),
        (0.14, 0.24, 0.31, "fair"),
        (0.00, 0.15, 0.31, "fair"),
    ],
)
def test_a_pair_is_good_if_it_may_be_and_is_not_much_worse_in_the_worst_case(
    low: float, residual: float, high: float, wanted: str
) -> None:
    answer = suggest_in_history(
        read_solved("oscillator_referenceT01.gz").history, 0.068753, Settings()
    )
    bounds = {"residual_low": low, "residual": residual, "residual_high": high}
    banded = Candidate(**require(answer.chosen)._asdict() | bounds)
    quality = grade_pair(answer.situation, banded)
    assert quality.alone.grade == wanted
    assert len(quality.alone.causes) == (wanted == "fair")


def test_a_flight_that_vibrates_later_was_never_at_rest() -> None:
    """A structure with many modes is quiet at some moments, but nothing excites it again in free flight."""
    time = np.linspace(0, 1, 201)
    energy = (
        np.where(time < 0.2, 50 * time, 10.0)
        + 1.5 * (time > 0.5) * np.sin(200 * time) ** 2
    )
    quiet = suggest_in_history(
        make_energy_history(energy, time), 0.4, Settings(after=0.25)
    ).situation
    assert quiet.at_rest  # nothing after td is known
    assert not replace(quiet, flight=quiet.flight._replace(end=0.9)).at_rest
    assert replace(quiet, flight=quiet.flight._replace(end=0.5)).at_rest


def test_where_nothing_vibrates_there_is_no_residual() -> None:
    """If the energy is round-off, the oscillator describes noise, and no vibration is left."""
    time = np.linspace(0, 1, 4001)
    energy = (np.exp(-25 * time) * np.sin(120 * time)) ** 2
    suggestion = suggest_in_history(
        make_energy_history(energy, time), 0.95, Settings(after=0.6)
    )
    assert suggestion.situation.vibration.unknown is None
    assert suggestion.situation.at_rest
    assert suggestion.situation.kinetic_share is None
    best = require(suggestion.chosen)
    assert (best.residual, best.sign_match, best.notes) == (None, None, ())
    assert suggestion.quality == ALL_GOOD
    verdict = verify_in_history(
        suggestion.situation.history, 0.7, 0.95, Settings(after=0.6)
    )
    assert verdict.verified
    assert verdict.candidate.residual is None


def test_equal_errors_come_in_one_order_in_single_and_in_double_precision() -> None:
    """Pairs on all cycles of one mode have the same error, except for rounding."""
    count = 12
    rng = np.random.default_rng(5)
    group, out_of_place = np.zeros(count, np.int32), np.zeros(count, np.bool_)
    rigid = rng.permutation(np.linspace(0.1, 0.9, count))
    error = np.where(np.arange(count) < count // 2, 0.9026349, 1.2472975)

    def places(rounding: float) -> list[int]:
        noise = rounding * rng.standard_normal(count)
        order = order_by_quality(
            group,
            Errors(error + noise, error + noise, out_of_place),
            rigid,
            out_of_place,
            np.full(1, EQUALLY_GOOD),
        )
        return [*map(int, order)]

    assert places(1e-16) == places(1e-7) == places(0.0)
    places_above = [
        place_in_order for place_in_order in places(0.0) if error[place_in_order] > 1
    ]
    assert places_above == sorted(
        places_above, key=lambda place_in_order: -rigid[place_in_order]
    )


def test_a_given_flight_that_the_momentum_contradicts_is_not_advised_again(
    tmp_path: Path,
) -> None:
    time = np.linspace(0, 0.08, 401)
    columns = {
        "time": time,
        "internal_energy": 1 + 0.5 * np.cos(600 * time) ** 2,
        "kinetic_energy": 10 + np.sin(200 * time),
        "x_momentum": np.sin(90 * time),
        "y_momentum": 0.0,
        "z_momentum": 3 * np.sin(150 * time),
    }
    table = tmp_path / "driven.csv"
    pd.DataFrame(columns).to_csv(table, index=False)
    judged = verify(read(table), 0.015708, 0.0471239, after=0.01)
    causes = require(judged.quality).motion.causes
    assert len(causes) == 1
    assert "although the momentum shows no free flight" in causes[0].reason
    assert "without `after`" in causes[0].cure
    assert "give the end of the load" not in causes[0].cure


def test_a_measured_momentum_answers_the_doubt_about_an_unknown_load() -> None:
    """A load that the record does not explain acts in both runs; other doubts about the motion remain."""
    good = Grade("good")
    load = Cause(
        "a load acts", "give the deck", is_of_record=True, is_unknown_load=True
    )
    apart = Cause("the parts fly apart", "switch fewer parts")
    for causes, grade in (
        ((load,), "fair"),
        ((load, apart), "poor"),
        ((apart,), "poor"),
    ):
        quality = Quality(Grade("poor", causes), good, good)
        assert trust_measured_momentum(quality).motion.grade == grade
    trusted = trust_measured_momentum(Quality(Grade("poor", (load,)), good, good))
    assert trusted.reasons == (
        "a load acts, but the momentum of the computed run agrees",
    )


@pytest.mark.parametrize("noise", [0.0, 1.0])
def test_noise_is_not_blamed_on_the_output_interval(noise: float) -> None:
    """The energy has 5 states per period, or seems to because of its noise, which no shorter interval removes."""
    time = np.linspace(0.0, 0.599, 600)
    fast = np.cos(np.pi / 5 * time / 1e-3) ** 2
    slow = np.cos(np.pi / 200 * time / 1e-3) ** 2
    random = np.random.default_rng(3).standard_normal(time.size)
    energy = np.asarray(20 + (slow + 1.5 * random if noise else fast), dtype=np.float64)
    history = History(time, energy, source=("run",), format="csv", channel="E")
    (cause,) = list_causes_of_record(history, None, 0.5)
    if noise:
        assert cause.reason.startswith("noise hides the vibration")
        assert "write the energies more often" not in cause.cure
    else:
        assert cause.reason.startswith("the energy has 5")


def test_an_inaccurate_tr_is_explained_without_a_second_but(tmp_path: Path) -> None:
    """Before, "but" followed "but", and "this error" had no noun, if the error hardly affects the next contact."""
    coarse = zip(TIME[::10], ENERGY[::10], strict=True)
    lines = ["time,internal_energy", *(f"{t:.3f},{e:.1e}" for t, e in coarse)]
    path = tmp_path / "coarse.csv"
    path.write_text("\n".join(lines), "utf-8")
    verdict = verify(read(str(path)), tr=0.0135867, td=0.0687534)
    reason = require(verdict.decision).reason
    assert "which is more than its timing tolerance of ±5e-05" in reason
    assert "so the vibration error may be larger" in reason
    assert "but" not in reason
