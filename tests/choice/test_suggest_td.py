"""Choice of both times for every basis, the answer if td is missing, and the bound of the window search."""

import csv

import numpy as np
import pytest
from hypothesis import given, strategies as st

from d2rpick.choice.answers import suggest_at, suggest_in_history
from d2rpick.choice.pair.aftermath import bound_mean_energy
from d2rpick.choice.pair.candidates import judge_times
from d2rpick.choice.pair.quality import rank_candidates
from d2rpick.choice.pair.situation import Situation, examine_td
from d2rpick.choice.pair.warnings import compute_shortfall, estimate_time_after
from d2rpick.choice.question import Settings
from d2rpick.choice.td.suggest_td import bound_rigid_times
from d2rpick.histories.history import EXACT, Given, History, Momenta, Samples
from d2rpick.histories.names import Part
from d2rpick.histories.opening import Selection
from d2rpick.models.box_model import Parameters
from d2rpick.models.box_run import make_history, simulate
from d2rpick.report.suggestion import list_alternatives
from tests import paper
from tests.command import ENERGY, ROLLOVER, ROOT, join_wrapped_lines, run, run_json
from tests.computed import locate_results
from tests.energies import (
    count_fits,
    forget,
    make_energy_history,
    require,
    suggest_in_window,
)
from tests.reading import read, read_solved
from tests.records import make_mode, make_table, sum_energies

PLAIN = Settings()
T01 = str(ROLLOVER).replace(".csv", "T01.gz")


def read_rollover_run() -> History:
    return read([T01], Selection(parts=("box",))).history


def test_both_times_of_the_published_oscillator() -> None:
    suggestion = suggest_in_window(paper.make_history(), (0.06, 0.07), PLAIN)
    assert suggestion.recommended is not None
    assert suggestion.recommended.td == pytest.approx(paper.BETTER_TD, abs=1e-8)
    assert suggestion.recommended.tr == pytest.approx(paper.BETTER_TR, abs=1e-8)
    assert require(suggestion.recommended.residual) < 1e-3
    assert suggestion.td_window == (0.06, 0.07)
    assert all(
        candidate.rigid_time > 1e-4 for candidate in suggestion.candidates
    )  # td itself is not a candidate


def test_of_equally_good_peaks_the_longest_rigid_window_wins() -> None:
    time = np.arange(0, 4, 0.01)
    history = make_energy_history(np.sin(2 * np.pi * time) ** 2, time)
    suggestion = suggest_in_window(history, (2.1, 3.6), PLAIN)
    # Peaks at 2.25, 2.75 and 3.25; the first tr with the sign of each is 0.25, 0.75 and 0.25.
    assert (
        require(suggestion.recommended).tr,
        require(suggestion.recommended).td,
    ) == pytest.approx((0.25, 3.25), abs=1e-6)


def test_without_a_peak_in_the_window_one_of_its_ends_is_taken() -> None:
    suggestion = suggest_in_window(paper.make_history(), (0.0635, 0.066), PLAIN)
    ends = [
        suggest_in_history(paper.make_history(), td, PLAIN).recommended
        for td in (0.0635, 0.066)
    ]
    assert require(suggestion.recommended).td == 0.066
    assert require(suggestion.recommended).residual == min(
        end.residual or 1 for end in ends if end
    )


def test_on_energy_alone_of_levels_alike_the_longest_rigid_window_wins() -> None:
    history = read_rollover_run()
    suggestion = suggest_in_window(history, (0.13, 0.38), PLAIN)
    mean = require(suggestion.expected).mean_energy
    assert mean == pytest.approx(1.885, abs=0.005)
    assert require(suggestion.recommended).rigid_time > 0.27
    assert suggestion.longer is None
    situation = suggestion.situation
    falls = {
        td: float(compute_shortfall(np.array(history.energy_at(td)), mean))
        for td in situation.peaks(0.13, 0.38)
    }
    level = falls[require(suggestion.recommended).td]
    assert level <= min(falls.values()) + PLAIN.tolerance
    assert require(suggestion.expected).kinetic_share == pytest.approx(
        1 - situation.energy_td / (2 * mean)
    )


@pytest.mark.slow
def test_td_is_not_taken_early_for_a_level_that_is_hardly_better() -> None:
    """The highest peak of the planar box in flight is its third; 0.0989 to 0.1478 would be rigid for only 0.049 s."""
    suggestion = suggest_in_window(
        make_history(simulate(Parameters(), 0.42)), (0.09, 0.379), PLAIN
    )
    assert require(suggestion.recommended).td == pytest.approx(0.37, abs=1e-3)
    assert require(suggestion.recommended).rigid_time > 0.2


def test_what_is_given_up_for_a_higher_level_is_told() -> None:
    """The energy is high up to 6, then as low as before 0.5."""
    time = np.arange(0, 10, 0.01)
    high = (time > 0.5) & (time < 6)
    energy = np.where(
        high, 1 + 0.3 * np.sin(5 * np.pi * time), 0.1 + 0.05 * np.sin(5 * np.pi * time)
    )
    history = make_energy_history(energy, time)
    suggestion = suggest_in_window(
        history, (1.0, 9.5), Settings(after=0.05, replay=False)
    )
    assert (
        require(suggestion.longer).rigid_time
        > 1.5 * require(suggestion.recommended).rigid_time
    )
    lines = dict(list_alternatives(suggestion))
    assert lines["longer"].startswith("a longer window exists (tr = ")


def test_the_reason_against_a_longer_window_is_the_verdict_on_it() -> None:
    """The residuals of both windows are printed as 0.000, but only the longer one may hide a further mode."""
    folder = ROOT / "sample_data/oscillator"
    question = ("--part", "all", "--deck", str(folder / "OSC_0000.rad"))
    history = str(folder / "OSCT01.gz")
    longer = run_json("suggest", *question, history)["longer_pair"]
    times = ("--tr", repr(longer["tr"]), "--td", repr(longer["td"]))
    judged = run_json("verify", *times, *question, history)
    text = join_wrapped_lines(run("plan", *question, history).stdout)
    assert judged["verdict"] == "use with care"
    assert f"but its verdict is 'use with care': {judged['verdict_reason']}" in text
    assert "has residual 0.000" not in text


@pytest.mark.slow
def test_without_a_window_the_longest_flight_is_searched_up_to_its_margin() -> None:
    suggestion = run_json("suggest", "--part", "box", T01)
    start, end = suggestion["td_window"]
    assert (start, end) == pytest.approx((0.091, 0.3815), abs=1e-3)
    assert suggestion["td"] <= end - 0.03 * (end - start)
    again = run_json("suggest", "--part", "box", "--td", repr(suggestion["td"]), T01)
    assert again["recommended"] == suggestion["recommended"]
    early = run_json("suggest", "--part", "box", "--margin", "0.02", T01)
    assert early["td"] <= end - 0.02 < suggestion["td"]


def test_no_oscillator_is_sought_again_for_peaks_without_an_acceptable_tr() -> None:
    late = Settings(
        after=0.34
    )  # no tr lies between the end of the load and these peaks
    history = forget(read_rollover_run())
    for td in (0.30, 0.3175, 0.335):
        suggest_at(examine_td(history, td, late))
        examine_td(history, td, late, quick=True)
    results_before = count_fits(history)
    assert results_before > 0
    assert suggest_in_window(history, (0.30, 0.335), late).recommended is None
    assert count_fits(history) == results_before


def test_peaks_above_all_vibration_energy_are_not_locked_in() -> None:
    time = np.arange(0, 10, 0.02)
    rng = np.random.default_rng(2)
    energy = sum(
        np.sin(w * time + rng.uniform(0, 6)) ** 2 for w in rng.uniform(4, 20, 15)
    )
    energy = np.asarray(energy) + 30 * np.exp(
        -(((time - 8.5) / 0.1) ** 2)
    )  # a burst that is not a vibration
    history = make_energy_history(energy, time)
    suggestion = suggest_in_window(history, (8.0, 9.0), Settings(after=0.5))
    for t in (require(suggestion.recommended).tr, require(suggestion.recommended).td):
        assert history.energy_at(t) <= 2 * require(suggestion.expected).mean_energy


def test_a_known_oscillator_expects_nothing_of_the_energy_alone() -> None:
    assert suggest_in_history(paper.make_history(), paper.TD, PLAIN).expected is None


def test_a_window_that_reaches_over_the_next_contact_ends_there() -> None:
    suggestion = suggest_in_window(read_rollover_run(), (0.36, 0.43), PLAIN)
    assert suggestion.situation.flight.end == pytest.approx(0.3819, abs=1e-3)
    assert require(suggestion.recommended).td < 0.3819


def test_no_td_is_taken_before_a_window_that_the_margin_cuts_off() -> None:
    suggestion = suggest_in_window(
        read_rollover_run(), (0.3815, 0.382), Settings(margin=0.01)
    )
    assert suggestion.recommended is None
    assert suggestion.situation.td == 0.3815


def test_the_record_ends_before_the_flight_of_an_oscillator_is_left() -> None:
    time = np.arange(0, 3, 0.01)
    energy = np.sin(2 * np.pi * time) ** 2 + np.where(time > 2.5, 40 * (time - 2.5), 0)
    history = make_energy_history(energy, time)
    suggestion = suggest_in_window(history, (2.0, 2.9), PLAIN)
    assert require(suggestion.recommended).td == pytest.approx(2.25, abs=1e-3)


# ---- the computed rollover


def test_the_means_of_the_computed_rollover_lie_between_the_expected_ones() -> None:
    """The bounds are the energy if all of it vibrates, and the expected energy if part of it is static."""
    history = read_rollover_run()
    table = np.genfromtxt(
        locate_results("rollover_scan.csv"),
        delimiter=",",
        names=True,
        dtype=None,
        encoding=None,
    )
    situation = suggest_in_history(history, 0.37, PLAIN).situation
    flying = table[table["tr_s"] > 0.0885]
    computed = flying["IEmean_td_to_380ms_J"] / flying["IEmean_ref_J"]
    expected_means = [
        estimate_time_after(situation, history.energy_at(float(tr)))
        for tr in flying["tr_s"]
    ]
    low = np.array(
        [expected_mean.ratio_low for expected_mean in expected_means if expected_mean]
    )
    high = np.array(
        [expected_mean.ratio for expected_mean in expected_means if expected_mean]
    )
    assert np.all(low < computed)
    assert np.all((computed - high < 0.06) & (high - computed < 0.17))


def test_the_means_of_the_computed_car_are_expected() -> None:
    """For shells and beams until the landing; for all parts including springs, 96 % was stated and 89 % computed."""
    history = read_solved("carT01.gz", "1-17").history
    situation = examine_td(history, 0.1464, PLAIN)
    with locate_results("car_runs.csv").open() as table:
        rows = [
            row
            for row in csv.DictReader(table)
            if row["run"].startswith(("car_a", "car_b_all", "car_full"))
        ]
    flying = [row for row in rows if float(row["tr_s"]) > 0.0386]
    assert len(flying) == 12
    for row in flying:
        expected = require(
            estimate_time_after(situation, history.energy_at(float(row["tr_s"])))
        )
        computed = float(row["meanIEstruct_td_landing_ratio"])
        assert expected.ratio == pytest.approx(computed, abs=0.03)
        assert require(expected.ratio_low) < computed


@pytest.mark.parametrize("alpha", [0.0, 1.0])
def test_what_many_modes_give_back_is_expected(alpha: float) -> None:
    """Forty modes above a static energy, damped or not: the mean after td lies between the bounds."""
    generator = np.random.default_rng(3)
    time = np.arange(0.0, 2.0, 2e-4)
    rates, phases, amplitudes = (
        generator.uniform(60, 400, 40),
        generator.uniform(0, 6.3, 40),
        generator.uniform(0, 1, 40),
    )
    remaining_time, td, tr = 4.0, 0.8, 0.4

    def deformations(t: Samples) -> Samples:
        decay = amplitudes[:, None] * np.exp(-alpha * t / 2)
        return np.asarray(decay * np.sin(rates[:, None] * t + phases[:, None]))

    energy = remaining_time + np.sum(deformations(time) ** 2, axis=0)
    locked = remaining_time + np.sum(deformations(np.array([tr])) ** 2)
    momentum = np.exp(-alpha * time)[:, None, None] * np.array([700.0, 0.0, 0.0])
    flying = Momenta(time, momentum, (Part(1, "box"),), EXACT, chosen=(0,))
    history = History(
        time,
        energy,
        source=("made",),
        format="made",
        channel="energy",
        evidence=Given((flying,)),
    )
    after_td = (time > td) & (time < td + 0.2)
    released = deformations(np.array([tr])) * np.cos(
        rates[:, None] * (time[after_td] - td)
    )
    switched = remaining_time + np.mean(
        np.sum(released**2, axis=0) * np.exp(-alpha * (time[after_td] - td))
    )
    alone = suggest_in_history(history, td, Settings(replay=False)).situation
    expected = require(estimate_time_after(alone, float(locked)))
    assert (
        require(expected.ratio_low)
        < switched / energy[after_td].mean()
        < require(expected.ratio)
    )
    assert expected.resting_energy == pytest.approx(energy[time <= td].min())
    for situation in (alone, suggest_in_history(history, td, PLAIN).situation):
        kept_energy = require(
            bound_mean_energy(situation, judge_times(situation, [tr])[0])
        )
        assert (
            kept_energy.low - 0.02
            < switched / energy[after_td].mean()
            < kept_energy.high + 0.02
        )


# ---- the command line


def test_value_prints_both_times_with_one_blank() -> None:
    result = run("suggest", "--td-window", "0.06", "0.07", "-f", "value", ENERGY)
    tr, td = result.stdout.removesuffix("\n").split(" ")
    suggestion = run_json("suggest", "--td-window", "0.06", "0.07", ENERGY)
    assert {"tr": float(tr), "td": float(td)} == suggestion["recommended"]
    assert (result.exit_code, suggestion["td"], suggestion["td_window"]) == (
        0,
        float(td),
        [0.06, 0.07],
    )


def test_the_expected_run_time_is_told_by_suggest_and_verify() -> None:
    saving = ("--cost-share", "0.8", "--step-ratio", "2")
    suggestion = run_json("suggest", "--td", "0.064", *saving, ENERGY)
    best = suggestion["candidates"][0]
    assert best["run_time_share"] == pytest.approx(
        1 - best["rigid_fraction"] * (1 - 0.2 / 2)
    )
    judged = run_json(
        "verify", "--td", "0.064", "--tr", repr(best["tr"]), *saving, ENERGY
    )
    assert judged["run_time_share"] == pytest.approx(best["run_time_share"])
    assert (
        "rigid for  0.0511147, 34% of the simulated time"
        in run("suggest", "--td", "0.064", *saving, ENERGY).stdout
    )
    assert (
        run_json("suggest", "--td", "0.064", ENERGY)["candidates"][0]["run_time_share"]
        is None
    )


def find_rigid_time(situation: Situation) -> float:
    best = next(rank_candidates([situation])).chosen
    return best.rigid_time if best and not best.same_swing else 0.0


@pytest.mark.slow
@given(
    st.integers(0, 2**32 - 1),
    st.floats(0.0, 0.05),
    st.floats(0.0, 3.0),
    st.sampled_from([0.0, 1e-4, 0.02, 0.2, 1.0]),
    st.sampled_from([0.0, 0.05, 0.333]),
)
def test_no_recommended_tr_lies_further_back_than_the_bound(
    seed: int, noise: float, decay: float, tolerance: float, load_end: float
) -> None:
    rng = np.random.default_rng(seed)
    time = np.linspace(0.0, 1.0, 120)
    rates, phases = rng.uniform(5, 60, 4), rng.uniform(0, 3, 4)
    energy = np.exp(-decay * time) * (
        np.sin(time[:, np.newaxis] * rates + phases) ** 2
    ).sum(axis=1)
    energy += noise * rng.standard_normal(time.size)
    start = examine_td(
        make_energy_history(energy, time),
        0.8,
        Settings(tolerance=tolerance, after=load_end, replay=False),
    )
    tds = rng.choice(time[1:], 12)
    bounds = bound_rigid_times(start, tds)
    for td, bound in zip(tds.tolist(), bounds.tolist(), strict=True):
        assert find_rigid_time(start.at(td)) <= bound


def test_the_bound_is_near_where_the_energy_passes_the_level() -> None:
    time = np.linspace(0.0, 10.0, 4001)
    energy = np.exp(-time / 10) * np.sin(3 * time) ** 2
    situation = examine_td(
        make_energy_history(energy, time), 9.0, Settings(after=0.5, replay=False)
    )
    tds = time[(time > 3) & (energy > 0.05)][::50]
    rigid_times = np.array([find_rigid_time(situation.at(td)) for td in tds.tolist()])
    bounds = bound_rigid_times(situation, tds)
    assert rigid_times.all()
    assert (bounds - rigid_times).max() < 0.1
    assert (bounds < tds - 0.5).mean() > 0.5


def test_where_a_model_decides_the_flight_alone_is_the_bound() -> None:
    history = paper.make_history()
    situation = examine_td(history, 0.064, Settings(after=0.01))
    assert bound_rigid_times(situation, np.array([0.05, 0.064])).tolist() == [
        0.04,
        0.054,
    ]


def test_without_a_start_of_the_flight_nothing_is_rigid() -> None:
    time = np.linspace(0.0, 1.0, 50)
    situation = examine_td(
        make_energy_history(1 + time, time), 0.5, Settings(replay=False)
    )
    assert situation.earliest_tr is None
    assert bound_rigid_times(situation, time).tolist() == [0.0] * 50


def test_all_formats_of_a_run_give_one_pair() -> None:
    """Before, a td at the end of the flight was offered only if the residual rises before the end, by chance."""
    pairs = []
    for name in ("matsum", "binout", "d3plot"):
        file = str(ROOT / "sample_data" / f"rollover_box.{name}")
        answer = run_json("suggest", "--part", "1,2", file)
        (best,) = [row for row in answer["candidates"] if row["recommended"]]
        pairs.append((best["tr"], answer["td"]))
    assert pairs == [pytest.approx(pairs[0], rel=1e-3)] * len(pairs)


def test_a_long_window_is_not_chosen_if_only_a_shorter_one_keeps_the_vibration() -> (
    None
):
    """Before, the only window longer than half the flight was chosen although its vibration was lost."""
    time = np.linspace(0.0, 0.378, 420)
    modes = [
        make_mode(np.array([164.3, 1.963, 1.938, 0.952])),
        make_mode(np.array([170.2, 0.661, 1.373, 0.155])),
    ]
    answer = suggest_in_window(
        make_table(time, sum_energies(modes, time)), None, Settings(after=0.0)
    )
    pair = require(answer.recommended)
    assert require(pair.residual) < 0.5
    longer = require(answer.longer)
    assert require(longer.residual) > 0.5
