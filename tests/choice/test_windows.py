"""Windows of acceptable tr, and margins compared with computed landings; verify accepts only times inside windows."""

import csv
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, example, given, settings, strategies as st

from d2rpick.choice.answers import (
    PairSuggestion,
    suggest_in_history,
    verify_at,
    verify_in_history,
)
from d2rpick.choice.pair.situation import examine_td
from d2rpick.choice.pair.windows import (
    count_coverage,
    cut_before_td,
    find_acceptable_windows,
    find_alike_windows,
    find_common_windows,
    interpolate_error,
    make_error_profile,
)
from d2rpick.choice.question import Settings
from d2rpick.choice.td.flights import find_flights
from d2rpick.flight.flight import Flight
from d2rpick.flight.margin import (
    LEAST_MARGIN,
    changes_momentum_little,
    compute_closing_speed,
    compute_margin,
    estimate_grazing_spread,
    estimate_landing_spread,
    estimate_spread_of_vibration,
    is_grazing,
)
from d2rpick.histories.history import EXACT, Balance, Given, History, Momenta, Samples
from d2rpick.histories.opening import Selection
from d2rpick.vibration.modes import Mode
from tests import chain
from tests.command import ROLLOVER
from tests.computed import locate_results
from tests.energies import make_energy_history, require
from tests.paper import OMEGA_2
from tests.reading import read_history, read_solved
from tests.records import ENERGY, MODE, TIME, add_noise, sum_energies

positive = st.floats(0.1, 10.0)

TD = 0.064
PAPER = make_energy_history(ENERGY, TIME)
WINDOWS = st.lists(st.integers(0, 12), min_size=0, max_size=8, unique=True).map(
    lambda ends: np.array(sorted(ends)[: len(ends) // 2 * 2], float).reshape(-1, 2)
)


def make_flying_oscillator(
    omega: float, amplitude: float, speed: float, mass: float, periods: int = 20
) -> tuple[History, Flight]:
    """Return a falling body that vibrates with a velocity of ``amplitude * omega``, and its flight."""
    time = np.linspace(0.0, 2 * np.pi * periods / omega, 4001)
    internal = mass * (omega * amplitude * np.sin(omega * time)) ** 2 / 2
    velocity = speed * (0.5 + 0.5 * time / time[-1])
    kinetic = mass * velocity**2 / 2 + mass * (omega * amplitude) ** 2 / 2 - internal
    momentum = np.stack([0 * time, 0 * time, -mass * velocity], axis=1)[:, np.newaxis]
    balance = Balance(time, internal=internal, kinetic=kinetic)
    whole = Momenta(time, momentum, None, EXACT, (0,), masses=np.array([mass]))
    evidence = Given((whole,), balance)
    history = History(
        time, internal, source=("test",), format="csv", channel="E", evidence=evidence
    )
    return history, Flight(0.0, float(time[-1]), "momentum")


@given(positive, st.floats(0.001, 0.01), positive, positive)
def test_the_landing_moves_by_the_amplitude_over_the_speed(
    omega: float, amplitude: float, speed: float, mass: float
) -> None:
    """On average, half of the vibration energy is kinetic, so the amplitude enters with a factor of 1/sqrt(2)."""
    history, flight = make_flying_oscillator(
        omega, amplitude * speed / omega, speed, mass
    )
    expected = amplitude * speed / omega / speed / np.sqrt(2)
    assert estimate_spread_of_vibration(history, flight) == pytest.approx(
        expected, rel=0.05
    )


def test_the_larger_of_share_and_spread_counts() -> None:
    history, flight = make_flying_oscillator(10.0, 1e-4, 1.0, 2.0)
    assert compute_margin(history, flight)[:2] == (
        LEAST_MARGIN * require(flight.end),
        "flight",
    )
    history, flight = make_flying_oscillator(10.0, 0.1, 1.0, 2.0, periods=2)
    margin_found = compute_margin(history, flight)
    assert (margin_found.source, margin_found.time) == ("landing", margin_found.spread)
    assert compute_margin(history, flight, 0.25)[:2] == (0.25, "given")


def test_without_a_contact_or_energies_nothing_is_made_up() -> None:
    history, flight = make_flying_oscillator(10.0, 1.0, 1.0, 2.0)
    assert compute_margin(history, flight._replace(end=None)) == (
        0.0,
        "no-contact",
        None,
        None,
        None,
    )
    bare = make_energy_history(history.energy, history.time)
    assert compute_margin(bare, flight) == (
        LEAST_MARGIN * history.time[-1],
        "flight",
        None,
        None,
        None,
    )


@given(st.floats(0.001, 0.05), positive)
def test_a_body_out_of_place_reaches_the_contact_earlier_by_that_over_the_closing_speed(
    drift: float, speed: float
) -> None:
    history, flight = make_flying_oscillator(10.0, 1e-4 * speed, speed, 2.0)
    spread = require(estimate_spread_of_vibration(history, flight))
    assert estimate_landing_spread(history, flight, drift) == pytest.approx(
        spread + drift / speed, rel=1e-6
    )
    assert estimate_landing_spread(history, flight, None) == spread
    for turning in (2.0, -0.5 * speed):  # the rotation moves the surface that touches
        moved = estimate_landing_spread(history, flight, drift, turning)
        assert moved == pytest.approx(spread + drift / (speed + turning), rel=1e-6)
    receding = estimate_landing_spread(history, flight, drift, -1.5 * speed)
    assert receding == estimate_grazing_spread(history, flight, drift)
    margin_kept = compute_margin(history, flight, place=drift)
    assert margin_kept.time == max(
        LEAST_MARGIN * require(flight.end), require(margin_kept.spread)
    )


@given(st.floats(0.001, 0.05), positive)
def test_a_body_that_rises_touches_the_ground_only_by_its_rotation(
    drift: float, speed: float
) -> None:
    """At the contact, its centre rises at half of ``speed``; because of the rotation, a corner goes down faster."""
    history, falling = make_flying_oscillator(10.0, 1e-4 * speed, speed, 2.0)
    (whole,) = history.momenta
    rising = replace(whole, values=whole.values[::-1] * -1.0)
    history = replace(history, evidence=Given((rising,), history.balance))
    flight = falling._replace(gravity=9.81)
    assert compute_closing_speed(history, flight) == pytest.approx(-speed / 2)
    spread = require(estimate_spread_of_vibration(history, flight))
    moved = estimate_landing_spread(history, flight, drift, 1.5 * speed)
    assert moved == pytest.approx(spread + drift / speed, rel=1e-6)
    for turning in (None, 0.4 * speed, -speed):
        grazing = estimate_landing_spread(history, flight, drift, turning)
        assert grazing == pytest.approx(
            np.sqrt(2 * (drift + spread * speed / 2) / 9.81), rel=1e-6
        )


def test_a_change_of_momentum_by_rounding_is_not_taken_for_gravity() -> None:
    history, flight = make_flying_oscillator(10.0, 1e-4, 2.0, 2.0)
    (whole,) = history.momenta
    constant = np.broadcast_to([3.0, 0.0, -4.0], whole.values.shape).copy()
    constant[-1] += [0.0, 2e-6, 1e-6]
    steady = replace(history, evidence=Given((replace(whole, values=constant),)))
    assert compute_closing_speed(steady, flight) == pytest.approx(2.5, rel=1e-5)


def make_touched_body(force: float) -> tuple[History, Flight]:
    """Return a vibrating body of mass 2, pushed by 2000, that flies from 0.1 to 0.6 and then meets this force."""
    time = np.linspace(0.0, 1.0, 2001)
    push = np.where(time < 0.1, 2000.0, np.where(time > 0.6, force, 0.0))
    momentum = np.zeros((time.size, 1, 3))
    momentum[:, 0, 0] = np.concatenate(
        [[0.0], np.cumsum((push[1:] + push[:-1]) / 2) * time[1]]
    )
    momentum[:, 0, 2] = -2 * 9.81 * time
    internal = 0.01 * np.sin(60 * time) ** 2
    kinetic = (momentum[:, 0] ** 2).sum(axis=1) / 4 + 0.01 - internal
    whole = Momenta(time, momentum, None, EXACT, (0,), masses=np.array([2.0]))
    history = make_energy_history(internal, time)
    evidence = Given((whole,), Balance(time, internal=internal, kinetic=kinetic))
    return replace(history, evidence=evidence), Flight(
        0.1, 0.6, "momentum", gravity=9.81
    )


@pytest.mark.parametrize(
    ("force", "grazed"), [(0.5, True), (19.0, True), (30.0, False), (3000.0, False)]
)
def test_a_contact_below_a_hundredth_of_the_largest_force_is_a_grazing_one(
    force: float, grazed: bool
) -> None:
    history, flight = make_touched_body(force)
    margin = compute_margin(history, flight, place=0.02)
    assert is_grazing(history, flight, 0.02) is grazed
    assert (margin.source == "grazing") is grazed
    if (
        grazed
    ):  # meanwhile, gravity alone opens a gap of 20 mm, and the vibration another gap
        assert margin.time >= np.sqrt(2 * 0.02 / 9.81)
        assert margin.time == pytest.approx(np.sqrt(2 * 0.02 / 9.81), rel=0.1)


def make_tapped_body(impulse: float, length: float) -> tuple[History, Flight]:
    """Return the body of `make_touched_body` with a contact of this length and impulse from 0.6 on."""
    history, flight = make_touched_body(0.0)
    (momenta,) = history.momenta
    pushed = np.clip((momenta.time - 0.6) / length, 0.0, 1.0) * impulse
    values = momenta.values.copy()
    values[:, 0, 2] += pushed
    evidence = Given((replace(momenta, values=values),), history.balance)
    return replace(history, evidence=evidence), flight


# At 0.6 the body falls with a momentum of 2 x 9.81 x 0.6 = 11.8.
@pytest.mark.parametrize(
    ("impulse", "length", "grazed"),
    [
        (0.5, 0.004, True),  # a force of 125, above 1 % of 2000
        (1.1, 0.004, True),
        (1.3, 0.004, False),
        (11.8, 0.004, False),  # the body stops
        (11.8, 0.1, False),  # softly, over a time much longer than the margin
    ],
)
def test_a_contact_that_takes_little_of_the_momentum_is_a_grazing_one(
    impulse: float, length: float, grazed: bool
) -> None:
    history, flight = make_tapped_body(impulse, length)
    assert not is_grazing(history, flight, 0.02)
    assert changes_momentum_little(history, flight) is grazed
    margin = compute_margin(history, flight, place=0.02)
    assert (margin.source == "grazing") is grazed
    assert margin.grazing == ("momentum" if grazed else None)


def test_a_contact_that_is_not_over_in_the_record_is_not_taken_for_a_grazing_one() -> (
    None
):
    history, flight = make_tapped_body(0.5, 10.0)
    assert not changes_momentum_little(history, flight)


@pytest.mark.parametrize(("name", "since"), [("carT01.gz", 0.03), ("drop2T01.gz", 0.0)])
def test_no_landing_of_the_computed_car_and_box_is_taken_for_a_grazing_one(
    name: str, since: float
) -> None:
    history = read_solved(name).history
    landing = [
        flight
        for flight in find_flights(history, Settings())
        if flight.end is not None and (flight.start or 0.0) >= since
    ]
    assert landing
    for flight in landing:
        assert not changes_momentum_little(history, flight)


def test_the_second_contact_of_the_car_with_the_block_begins_as_a_grazing_one() -> None:
    """It touches the block at 28 ms with 1 % of the momentum towards it, and then hits it."""
    history = read_solved("carT01.gz").history
    flight = next(
        flight
        for flight in find_flights(history, Settings())
        if 0.01 < (flight.start or 0.0) < 0.03
    )
    assert changes_momentum_little(history, flight)


def test_a_grazing_contact_without_gravity_leaves_no_td() -> None:
    history, flight = make_touched_body(0.5)
    assert (
        compute_margin(history, flight._replace(gravity=0.0), place=0.02).time == np.inf
    )


def test_where_no_force_is_known_no_contact_grazes() -> None:
    history, flight = make_touched_body(0.5)
    assert not is_grazing(
        make_energy_history(history.energy, history.time), flight, 0.02
    )
    assert not is_grazing(
        history, flight._replace(end=0.99), 0.02
    )  # the record ends too early


def test_a_grazing_contact_is_said_and_td_keeps_clear_of_it() -> None:
    history, _ = make_touched_body(0.5)
    answer = suggest_in_history(history, 0.59, Settings())
    messages = {caution.code: caution.message for caution in answer.cautions}
    assert "is at first below 1 % of its maximum" in messages["grazing-contact"]
    assert "grazing-contact" not in {
        caution.code
        for caution in suggest_in_history(
            make_touched_body(3000.0)[0], 0.59, Settings()
        ).cautions
    }


def read_landings(name: str, column: str) -> Iterator[tuple[str, float]]:
    """Yield the name of each computed run, and a number from its row."""
    with locate_results(name).open() as file:
        yield from (
            (row["run"], float(row[column] or "nan")) for row in csv.DictReader(file)
        )


def test_the_landings_of_the_switched_car_lie_within_the_margin() -> None:
    """This holds for all runs that were switched in the flight and switched back before the contact."""
    history = read_solved("carT01.gz").history
    flight = find_flights(history, Settings())[-1]
    margin = compute_margin(history, flight)
    starts, ends = (
        dict(read_landings("car_runs.csv", "tr_s")),
        dict(read_landings("car_runs.csv", "td_s")),
    )
    landed_names = [
        name
        for name in starts
        if starts[name] > (flight.start or 0) and ends[name] < 0.15
    ]
    moved = [
        abs(landing - 0.15041)
        for name, landing in read_landings("car_runs.csv", "landing_s")
        if name in landed_names
    ]
    assert len(moved) > 15
    assert max(moved) == pytest.approx(1.1e-3, abs=1e-4)
    assert max(moved) < margin.time
    assert require(margin.spread) == pytest.approx(1.25e-3, abs=1e-5)
    assert max(moved) < require(margin.spread)  # the formula alone covers them too


@pytest.mark.parametrize(
    ("run", "column", "end"),
    [("drop2_w2", "dland4_ms", 0.4196), ("drop2_w3", "dland7_ms", 0.5966)],
)
def test_the_landings_of_the_switched_box_lie_within_the_margin(
    run: str, column: str, end: float
) -> None:
    history = read_solved("drop2T01.gz").history
    (flight,) = (
        flight_row
        for flight_row in find_flights(history, Settings())
        if flight_row.end == pytest.approx(end, abs=1e-3)
    )
    moved = abs(dict(read_landings("drop2_runs.csv", column))[run]) / 1e3
    assert 1e-3 < moved < compute_margin(history, flight).time


def find_windows_of(answer: PairSuggestion) -> Samples:
    best = answer.recommended
    return find_acceptable_windows(
        answer.situation, answer.candidates, best.tr if best else None
    )


def are_in_windows(windows: Samples, times: Samples) -> Samples:
    """Return, for each time, whether it lies in a window."""
    column_of_times = times[:, np.newaxis]
    return np.asarray(
        np.any(
            (windows[:, 0] <= column_of_times) & (column_of_times <= windows[:, 1]),
            axis=1,
        )
    )


def check(answer: PairSuggestion, seed: int) -> None:
    """Compare the windows with ``verify`` at their ends, inside, and at random times."""
    situation = answer.situation
    history = situation.history
    windows = find_windows_of(answer)
    assert np.all(windows[:, 0] <= windows[:, 1])
    assert np.all(windows[1:, 0] > windows[:-1, 1])
    rng = np.random.default_rng(seed)
    ends = windows[rng.permutation(len(windows))[:3]]
    inside = rng.uniform(ends[:, :1], ends[:, 1:], (len(ends), 2))
    assert all(
        verify_at(situation, t).admissible for t in [*ends.ravel(), *inside.ravel()]
    )
    # Other times that ``verify`` accepts lie in the cycle of td, for which no time outside the tolerance is listed.
    last = max([windows[-1, 1]] if len(windows) else [history.time[0]])
    anywhere = (
        rng.uniform(history.time[0], last, 8) if last > history.time[0] else np.zeros(0)
    )
    clear = anywhere[
        np.min(np.abs(anywhere[:, np.newaxis] - [*windows.ravel(), np.inf]), axis=1)
        > 1e-5 * history.step
    ]
    assert [verify_at(situation, t).admissible for t in clear] == are_in_windows(
        windows, clear
    ).tolist()
    # The errors in the windows are those of ``verify``; if nothing vibrates, there are none.
    profile = make_error_profile(situation, answer.candidates, windows)
    for t in inside.ravel()[:4]:
        error = 0.0 if situation.at_rest else verify_at(situation, t).candidate.error
        assert interpolate_error(profile, t) == pytest.approx(error, abs=1e-3)


@settings(max_examples=8)
@given(
    omega=st.floats(150, 400), alpha=st.floats(0, 60), phase=st.floats(0, np.pi), td=st.floats(0.04, 0.14),
    tolerance=st.floats(0.001, 1.0), plastic=st.sampled_from([0.0, 3.0]), preload=st.sampled_from([0.0, 2.0]),
    load_end=st.none() | st.floats(0.0, 0.03), limit=st.none() | st.floats(0.1, 1.5), seed=st.integers(0, 2**16),
)  # fmt: skip
def test_windows_of_an_oscillator_hold_what_verifies(
    omega: float, alpha: float, phase: float, td: float, tolerance: float, plastic: float, preload: float,
    load_end: float | None, limit: float | None, seed: int,
) -> None:  # fmt: skip
    mode = Mode(
        omega, alpha, 10 * np.cos(phase), 10 * np.sin(phase), 0.0, plastic, preload
    )
    history = make_energy_history(mode.energy(TIME[::3]), TIME[::3])
    answer = suggest_in_history(
        history, td, Settings(tolerance=tolerance, after=load_end, max_residual=limit)
    )
    check(answer, seed)


@example(
    energy=[0, 1, 0, -1, 1],
    share=1.0,
    tolerance=1.0,
    load_end=0.0,
    seed=60,
    uneven=False,
    margin=0.0,
)
@settings(max_examples=12)
@given(
    energy=st.lists(st.floats(-1, 100), min_size=5, max_size=60), share=st.floats(0.3, 1.0),
    tolerance=st.floats(0.01, 1.0), load_end=st.none() | st.floats(0.0, 0.5), seed=st.integers(0, 2**16),
    uneven=st.booleans(), margin=st.sampled_from([0.0, 0.07]),
)  # fmt: skip
def test_windows_of_any_energy_hold_what_verifies(
    energy: list[float],
    share: float,
    tolerance: float,
    load_end: float | None,
    seed: int,
    uneven: bool,
    margin: float,
) -> None:
    time = np.linspace(0, 1, len(energy)) ** (1.5 if uneven else 1.0)
    history = make_energy_history(np.array(energy), time)
    settings_asked = Settings(
        tolerance=tolerance,
        after=load_end and load_end * time[-2],
        margin=margin,
        replay=False,
    )
    assume(share > float(settings_asked.after or 0))
    check(suggest_in_history(history, share, settings_asked), seed)


@pytest.mark.slow
@pytest.mark.parametrize("tolerance", [0.05, 0.6])
def test_windows_of_a_record_with_noise_and_of_a_real_one_hold_what_verifies(
    tolerance: float,
) -> None:
    record = make_energy_history(add_noise(ENERGY, 0.002, 5), TIME)
    rollover = read_history([ROLLOVER], Selection(energy=("boxIE_J",)))
    for history, td in ((record, TD), (rollover, 0.37)):
        answer = suggest_in_history(
            history, td, Settings(tolerance=tolerance, replay=tolerance < 0.5)
        )
        assert len(find_windows_of(answer))
        check(answer, 1)


@pytest.mark.slow
@pytest.mark.parametrize("td", [chain.TD_PEAK, chain.TD_LATE])
def test_windows_of_several_parts_and_modes_hold_what_verifies(td: float) -> None:
    two = (Mode(100.0, 4.0, 2.0, 3.0, 0.0), Mode(261.0, 4.0, -1.5, 1.0, 0.0))
    time = np.linspace(0.0, 0.3, 3001)
    modes = suggest_in_history(
        make_energy_history(sum_energies(two, time), time), td, Settings(tolerance=0.4)
    )
    assert modes.situation.basis == "modal"
    check(modes, 1)
    parts = suggest_in_history(chain.read_chain_history(), td, Settings())
    assert parts.situation.basis == "modal"
    check(parts, 1)
    assert len(find_windows_of(parts))


def test_the_windows_of_the_published_record_are_around_the_crossings_of_equal_sign() -> (
    None
):
    answer = suggest_in_history(PAPER, TD, Settings())
    windows = find_windows_of(answer)
    acceptable = np.array(sorted(c.tr for c in answer.candidates if c.admissible))
    assert len(windows) == len(acceptable)
    assert np.all((windows[:, 0] < acceptable) & (acceptable < windows[:, 1]))


def test_the_swing_of_td_counts_only_where_the_own_tr_lies_on_it() -> None:
    answer = suggest_in_history(PAPER, TD, Settings())
    assert find_windows_of(answer)[-1, 1] < TD - 0.01
    late = suggest_in_history(PAPER, 0.068, Settings(after=0.0655))
    assert late.recommended is None
    assert not find_windows_of(late).size
    flat = make_energy_history(
        1 + 1e-3 * np.cos(np.arange(50) * 2.0), np.linspace(0, 1, 50)
    )
    quiet = suggest_in_history(flat, 0.9, Settings(after=0.1, replay=False))
    assert quiet.recommended
    (window,) = find_windows_of(quiet)
    assert window.tolist() == [0.1, np.nextafter(0.9, 0)]
    (clear_window,) = cut_before_td(quiet.situation, find_windows_of(quiet))
    assert clear_window == pytest.approx([0.1, 0.9 - 1 / 49])
    assert not cut_before_td(quiet.situation, np.array([[0.881, 0.899]])).size


@pytest.mark.parametrize(
    "settings_asked",
    [
        Settings(max_kinetic_share=0.5),  # it is 0.917 there
        Settings(max_residual=0.9),
        Settings(tolerance=0.0, replay=False),
    ],
)
def test_where_nothing_verifies_there_is_no_window(settings_asked: Settings) -> None:
    assert not find_windows_of(suggest_in_history(PAPER, TD, settings_asked)).size


def test_what_is_alike_reaches_as_far_as_the_timing_tolerance_and_no_error_in_it_is_larger() -> (
    None
):
    """By the level alone, the level error grows by 0.05."""
    for history, settings_asked in (
        (PAPER, Settings()),
        (PAPER, Settings(replay=False, after=0.005)),
    ):
        answer = suggest_in_history(history, TD, settings_asked)
        best = require(answer.chosen)
        windows = find_alike_windows(
            answer.situation, answer.candidates, best, find_windows_of(answer)
        )
        (around,) = (
            pair_time
            for pair_time in windows.tolist()
            if pair_time[0] <= best.tr <= pair_time[1]
        )
        if best.timing_tolerance is not None:
            assert min(abs(end - best.tr) for end in around) == pytest.approx(
                best.timing_tolerance, rel=1e-3
            )
        ends = [
            verify_in_history(history, end, TD, settings_asked).candidate
            for end in windows.ravel()
        ]
        errors = [
            pair_time.level_error
            if pair_time.lock_in_error is None
            else pair_time.lock_in_error
            for pair_time in (best, *ends)
        ]
        assert errors[1:] == pytest.approx(
            [require(errors[0]) + 0.05] * len(ends), abs=1e-6
        )


def test_a_profile_is_short_where_the_error_is_smooth() -> None:
    time = np.linspace(0, 0.15, 10_001)
    answer = suggest_in_history(
        make_energy_history(MODE.energy(time), time), 0.0687534, Settings()
    )
    windows = find_windows_of(answer)
    profile = make_error_profile(answer.situation, answer.candidates, windows)
    assert profile.shape[1] < 20 * len(windows)
    assert np.all(np.diff(profile[0]) > 0)
    assert make_error_profile(
        answer.situation, answer.candidates, windows[:0]
    ).shape == (
        2,
        0,
    )


@pytest.mark.slow
def test_two_oscillators_of_different_rate_share_what_both_verify() -> None:
    second_mode = Mode(1.004 * OMEGA_2, MODE.alpha, MODE.cosine, MODE.sine, MODE.origin)
    histories = [PAPER, make_energy_history(second_mode.energy(TIME), TIME)]
    shared_windows = find_common_windows(
        [
            find_windows_of(suggest_in_history(history, 0.0687534, Settings()))
            for history in histories
        ]
    )
    times = np.linspace(0.01, 0.06, 400)
    situations = [examine_td(history, 0.0687534, Settings()) for history in histories]
    expected = [
        all(verify_at(situation, t).admissible for situation in situations)
        for t in times
    ]
    assert are_in_windows(shared_windows, times).tolist() == expected
    assert any(expected)


@given(st.lists(WINDOWS, min_size=1, max_size=5))
def test_coverage_counts_at_every_time_the_runs_with_a_window_there(
    runs: list[Samples],
) -> None:
    stretches, counts = count_coverage(runs)
    times = np.arange(0, 12.5, 0.25)
    expected = np.sum([are_in_windows(windows, times) for windows in runs], axis=0)
    held = (stretches[:, 0] <= times[:, np.newaxis]) & (
        times[:, np.newaxis] <= stretches[:, 1]
    )
    assert np.max(np.where(held, counts, 0), axis=1, initial=0).tolist() == list(
        expected
    )
    shared = find_common_windows(runs)
    assert are_in_windows(shared, times).tolist() == [
        count == len(runs) for count in expected
    ]
    assert np.all(shared[:, 0] <= shared[:, 1])


def test_a_suggestion_gives_its_windows_on_any_basis() -> None:
    for replay in (True, False):
        answer = suggest_in_history(
            PAPER, 0.0687534, Settings(replay=replay, after=0.005)
        )
        windows = answer.acceptable_windows
        assert any(
            start <= require(answer.recommended).tr <= end for start, end in windows
        )
        assert all(start < end for start, end in windows)
