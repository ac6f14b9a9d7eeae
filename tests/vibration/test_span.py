"""The span that one oscillator describes, how it is searched for, and what its misfit may hide."""

import tracemalloc

import numpy as np
import pytest

from d2rpick.choice.answers import suggest_in_history
from d2rpick.choice.pair.situation import examine_td
from d2rpick.choice.question import Settings
from d2rpick.histories.history import History
from d2rpick.vibration.identify import identify, judge_given
from d2rpick.vibration.modes import Mode
from d2rpick.vibration.oscillator_band import OscillatorBand
from d2rpick.vibration.span import (
    Span,
    SpanSearch,
    estimate_hidden_share,
    find_described_span,
    find_span,
    fit_window,
    measure_deviations,
)
from tests import paper
from tests.benchmarks.identification import small_second_modes
from tests.energies import forget, require
from tests.records import (
    ENERGY,
    MODE,
    TIME,
    add_noise,
    compute_replayed_residual,
    make_table,
    round_as_printed,
    sum_energies,
)

MAIN = Mode(2 * np.pi, 0.2, 0.3, 0.9, 0.0)
TIMES = np.arange(0, 7, 1 / 40)


def make_history(energy: np.ndarray) -> History:
    return make_table(TIME, energy)


def find_span_by_convolution(energy: np.ndarray, anchor: float) -> tuple[float, float]:
    """Return the span in which running means over 1/25 period stay within 1 % of the energy of the paper's mode."""
    width = round(2 * np.pi / MODE.omega / 25 / 1e-4)
    gone = np.abs(
        np.convolve(energy - ENERGY, np.ones(width) / width, mode="same")
    ) > 0.01 * MODE.vibration_energy(TIME)
    anchor_index = int(np.searchsorted(TIME, anchor))
    left_end, right_end = (
        np.flatnonzero(gone[:anchor_index])[-1] + 1 + width // 2,
        anchor_index + np.flatnonzero(gone[anchor_index:])[0] - 1 - width // 2,
    )
    return float(TIME[left_end]), float(TIME[right_end])


@pytest.mark.parametrize("anchor", [0.06, 0.08, 0.1])
@pytest.mark.parametrize("size", [1e-2, 1.0, 1e300])
def test_a_span_ends_where_running_means_leave_the_fit(
    size: float, anchor: float
) -> None:
    energy = ENERGY + size * MODE.vibration_energy(TIME) * (
        (TIME < 0.0311) | (TIME > 0.1234)
    )
    fit = judge_given(MODE, TIME, ENERGY)
    assert find_span(
        make_history(energy), anchor, fit, Span(0.0, 0.15)
    ) == find_span_by_convolution(energy, anchor)


def test_a_refusal_on_a_few_samples_names_the_misfit_of_all() -> None:
    rng = np.random.default_rng(1)
    energy = rng.normal(size=TIME.size)
    span, fit = find_described_span(
        SpanSearch(make_history(energy), Span(0.0, 0.15)), 0.1
    )
    assert span is None
    early = TIME <= 0.1
    assert fit.reason == identify(TIME[early], energy[early]).reason
    for fitted in (
        identify(TIME, energy, quick=True),
        judge_given(MODE, TIME, energy, quick=True),
    ):
        assert (fitted.mode, fitted.describes_record) == (None, False)
        assert fitted.reason


def test_an_energy_that_only_rises_takes_no_memory_for_periods_beyond_the_record() -> (
    None
):
    energy = (8192e3 + np.arange(2000.0)).astype(np.float32).astype(np.float64)
    tracemalloc.start()
    span, fit = find_described_span(
        SpanSearch(make_table(np.arange(2000.0), energy), Span(0.0, 1999.0)), 1000.0
    )
    peak_memory = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert (span, fit.describes_record) == (None, False)
    assert "vibration period" in str(fit.reason)
    assert peak_memory < 100 * energy.nbytes


@pytest.mark.parametrize("noise", [0.0, 0.02])
def test_what_is_accepted_is_the_same_when_refusals_are_quick(noise: float) -> None:
    energy = add_noise(ENERGY, noise, seed=2)
    quick, thorough = identify(TIME, energy, quick=True), identify(TIME, energy)
    assert isinstance(quick.mode, Mode)
    assert (quick.mode, quick.reason, quick.rms) == (thorough.mode, None, thorough.rms)


def test_a_window_is_fitted_once_by_each_oscillator_and_demand() -> None:
    history = make_history(ENERGY)
    whole = Span(0.0, 0.15)
    first = fit_window(history, whole, quick=False)
    assert fit_window(history, Span(-1e-6, 0.15 + 1e-6), quick=False) is first
    others = (
        fit_window(history, whole, quick=True),
        fit_window(history, whole, MODE, quick=False),
        fit_window(history, Span(TIME[1], 0.15), quick=False),
    )
    assert all(other is not first for other in others)
    assert others[1].mode == MODE
    assert fit_window(history, Span(0.2, 0.3), quick=False).reason
    assert fit_window(forget(history), whole, quick=False) is not first


def test_what_was_fitted_before_changes_no_answer() -> None:
    history = paper.make_history()
    for td in (0.05, paper.TD, 0.1):
        anew, again = (
            examine_td(record, td, Settings()) for record in (forget(history), history)
        )
        assert again.evidence.span == anew.evidence.span
        assert require(again.evidence.fit).mode == require(anew.evidence.fit).mode


def add_second_mode(share: float, rate: float = 2.3) -> tuple[Mode, Mode]:
    """Return the main mode and a mode with this fraction of its energy."""
    root = float(np.sqrt(share * MAIN.vibration_energy(0.0)))
    return MAIN, Mode(
        rate * 2 * np.pi, 0.2, root * np.cos(1.0), root * np.sin(1.0) * 0.97, 0.0
    )


@pytest.mark.parametrize("rate", [0.6, 1.8, 3.1])
@pytest.mark.parametrize("noise", [0.0, 1e-3])
@pytest.mark.parametrize("share", [0.003, 0.01])
def test_the_share_of_a_small_second_mode_is_estimated(
    share: float, noise: float, rate: float
) -> None:
    energy = add_noise(sum_energies(add_second_mode(share, rate), TIMES), noise, seed=1)
    fitted = identify(TIMES, energy)
    assert fitted.mode is not None  # its remaining misfit is too small to refuse it
    assert fitted.describes_record
    assert estimate_hidden_share(TIMES, energy, fitted.mode) == pytest.approx(
        share, rel=0.5
    )


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("noise", [1e-4, 0.03])
def test_white_noise_hides_a_second_mode_of_its_own_size(
    noise: float, seed: int
) -> None:
    energy = add_noise(MAIN.energy(TIMES), noise, seed)
    assert (
        0
        < estimate_hidden_share(TIMES, energy, require(identify(TIMES, energy).mode))
        < 3 * noise
    )


def test_a_clean_or_printed_record_hides_nothing() -> None:
    for energy, largest in ((ENERGY, 1e-12), (round_as_printed(ENERGY), 1e-5)):
        assert (
            estimate_hidden_share(TIME, energy, require(identify(TIME, energy).mode))
            < largest
        )


def test_the_bound_holds_for_a_mode_that_drowns_in_noise() -> None:
    tr, td = np.array([0.3, 1.1, 2.6]), 5.3
    for seed in range(0, 20, 3):
        truth = add_second_mode(0.005, rate=1.5 + seed / 10)
        energy = add_noise(sum_energies(truth, TIMES), 0.03, seed)
        fitted = identify(TIMES, energy)
        mode = require(fitted.mode)
        fitted = fitted._replace(
            hidden_share=estimate_hidden_share(TIMES, energy, mode)
        )
        true, predicted = (
            compute_replayed_residual(truth, tr, td),
            compute_replayed_residual(mode, tr, td),
        )
        _, low, high = OscillatorBand(fitted, td).bound_residual(predicted, tr, td)
        assert np.all(high > true - 0.05)
        assert np.all(low < true + 0.05)


def test_candidates_state_how_large_their_residual_may_be() -> None:
    energy = add_noise(MAIN.energy(TIMES), 0.03, seed=3)
    suggestion = suggest_in_history(make_table(TIMES, energy), 5.3, Settings(after=0.0))
    assert suggestion.candidates
    for candidate in suggestion.candidates:
        assert require(candidate.residual_high) >= require(candidate.residual)
        noted = any(
            "if the record hides a further mode" in note for note in candidate.notes
        )
        assert noted == (
            require(candidate.residual_high) > require(candidate.residual) + 0.1
        )


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["one", "small", "large"])
def test_of_random_records_95_percent_are_within_their_bounds(kind: str) -> None:
    records = small_second_modes(kind, range(3))
    assert len(records) >= 2
    deviations = [
        max(record.stated - record.true, record.true - record.highest, 0.0)
        for record in records
    ]
    assert np.percentile(deviations, 95) <= 0.05


def make_decaying_modes(scale: float) -> list[Mode]:
    """Return a mode that lasts, and one that has decayed after the first of its periods."""
    return [
        Mode(320.23, 40.92, 1.024 * scale, -0.495 * scale, 0.0),
        Mode(1269.22, 382.38, -0.038 * scale, 0.130 * scale, 0.0),
    ]


@pytest.mark.parametrize("scale", [1.0, 1e-100, 1e100])
def test_what_a_fast_mode_leaves_before_it_dies_is_measured(scale: float) -> None:
    slow, fast = make_decaying_modes(scale)
    time = np.linspace(0.0, 0.14, 2400)
    energy = sum_energies([slow, fast], time)
    late = time > 0.03
    fit = identify(time[late], energy[late])
    times, deviations = measure_deviations(time, energy, fit)
    period = np.pi / slow.omega
    highest = np.array(
        [fast.energy(time[np.abs(time - t) < period]).max() for t in times[:8]]
    )
    assert deviations[:8] == pytest.approx(highest, rel=0.6)
    assert np.all(deviations[times > 0.05] < 1e-3 * fast.energy(0.0))


@pytest.mark.parametrize("noise", [1e-3, 1e-2])
def test_noise_alone_does_not_deviate(noise: float) -> None:
    for seed in range(5):
        energy = add_noise(MAIN.energy(TIMES), noise, seed)
        _, deviations = measure_deviations(TIMES, energy, identify(TIMES, energy))
        assert not deviations.any()


def test_cells_without_states_do_not_deviate() -> None:
    time = np.concatenate([TIMES[TIMES < 2.0], TIMES[TIMES > 4.0]])
    energy = MAIN.energy(time)
    _, deviations = measure_deviations(time, energy, identify(time, energy))
    assert deviations == pytest.approx(0.0, abs=1e-9)


def test_the_band_holds_for_a_mode_that_dies_early() -> None:
    """At tr, it has more energy than all that vibrates at td, although one oscillator describes the record."""
    modes = make_decaying_modes(1.0)
    time = np.linspace(0.0, 0.139, 2000)
    energy = sum_energies(modes, time)
    late = time > 0.01
    fit = identify(time[late], energy[late])
    times, deviations = measure_deviations(time, energy, fit)
    judged = fit._replace(deviation_times=times, deviations=deviations)
    mode = require(fit.mode)
    tr, td = np.array([0.0033, 0.0424]), 0.1357
    true = compute_replayed_residual(modes, tr, td)
    stated = compute_replayed_residual(mode, tr, td)
    assert true[0] > 0.5 > stated[0]
    _, _, high_before = OscillatorBand(fit, td).bound_residual(stated, tr, td)
    assert high_before[0] < true[0]
    stated_now, low, high = OscillatorBand(judged, td).bound_residual(stated, tr, td)
    assert np.all((low <= true + 1e-3) & (true <= high + 1e-3))
    assert stated_now[0] == pytest.approx(true[0], abs=0.3)
    assert stated_now[1] == pytest.approx(stated[1], abs=1e-9)
