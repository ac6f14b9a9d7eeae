"""Plans: flights, windows and what one reference supports, on computed runs of the box and of a real solver."""

from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import example, given, settings, strategies as st

from d2rpick.base.errors import RangeError
from d2rpick.choice.answers import suggest_of
from d2rpick.choice.plan import Plan, plan_of
from d2rpick.choice.question import Reference, Settings
from d2rpick.choice.trade_off import explored_flights
from d2rpick.histories.digits import round_to_first_as_read
from d2rpick.histories.opening import Selection
from tests.computed import stored
from tests.drops import drop, written
from tests.energies import of, reference as made, suggest_in_window, sure
from tests.reading import read, solved

# no oscillator describes these runs, and none is sought: the level alone is poor
PLAIN = Settings(replay=False, min_quality="poor")
BOX = Selection(parts=("box",))


@pytest.fixture(scope="module")
def reference(tmp_path_factory: pytest.TempPathFactory) -> Reference:
    return read(written(drop(), tmp_path_factory.mktemp("run")), BOX)


@pytest.fixture(scope="module")
def plan(reference: Reference) -> Plan:
    return plan_of(reference, PLAIN)


def statuses(plan: Plan) -> list[str]:
    return [row.status for row in plan.flights]


@pytest.mark.slow
def test_every_flight_of_the_box_is_listed_where_it_lies(plan: Plan) -> None:
    touched = drop().landings
    assert len(plan.flights) >= 3
    for row in plan.flights:
        inside = [
            t for t in touched if row.start + 2e-3 < t[1] and t[0] < row.end - 2e-3
        ]
        assert not inside, f"{row.start} to {row.end}"


def test_the_first_fall_is_rigid_from_the_start_and_the_first_that_locks_in_energy_is_the_last_supported(
    plan: Plan,
) -> None:
    first, *others = [row for row in plan.flights if row.window]
    assert sure(first.window)[0] == 0.0
    assert (first.status, first.locks_in) == ("supported", False)
    assert others[0].status == "supported"
    assert others[0].locks_in
    assert {row.status for row in others[1:]} == {"re-plan"}
    for row in others[1:]:
        assert (
            f"{sure(others[0].window)[0]:.6g} to {sure(others[0].window)[1]:.6g}"
            in (row.reason or "")
        )


def test_each_window_is_what_suggest_says_for_its_td(
    reference: Reference, plan: Plan
) -> None:
    for tr, td in plan.all_windows:
        found = suggest_of(reference, td, PLAIN)
        assert (sure(found.recommended).tr, sure(found.recommended).td) == (tr, td)


def test_windows_keep_their_margin_and_follow_each_other(plan: Plan) -> None:
    windows = plan.all_windows
    assert all(one[1] < other[0] for one, other in pairwise(windows))
    for row in plan.flights:
        if row.window and row.flight.end is not None:
            assert (
                row.start
                <= row.window[0]
                < row.window[1]
                <= row.end - row.margin.time + 1e-12
            )
            assert row.margin.time >= 0.03 * (row.end - row.start)
    assert plan.rigid_time == pytest.approx(sum(td - tr for tr, td in plan.windows))


def test_a_margin_that_is_given_overrules(reference: Reference) -> None:
    given = plan_of(reference, replace(PLAIN, margin=0.02))
    assert {row.margin.time for row in given.flights} == {0.02}
    assert given.flights[0].window == pytest.approx(
        (0.02, given.flights[0].end - 0.02), abs=1e-9
    )


def test_short_windows_are_left_out_with_the_reason(reference: Reference) -> None:
    found = plan_of(reference, PLAIN, min_rigid=0.2)
    for row in found.flights:
        assert (row.status == "left-out") == (row.window is None)
        assert row.window is None or row.window[1] - row.window[0] >= 0.2
        assert row.status != "left-out" or "at least 0.2 was asked for" in (
            row.reason or ""
        )
    assert plan_of(reference, PLAIN, min_rigid=2.0).supported == ()


def test_after_counts_in_its_flight_alone(reference: Reference, plan: Plan) -> None:
    second = plan.flights[1]
    found = plan_of(reference, replace(PLAIN, after=(second.start + second.end) / 2))
    assert found.flights[0].status == "left-out"
    assert (
        found.flights[1].window is None
        or found.flights[1].window[0] >= (second.start + second.end) / 2
    )
    assert [row.window for row in found.flights[2:]] == [
        row.window for row in plan.flights[2:]
    ]


# ---- switched runs


@pytest.mark.slow
def test_a_switched_run_is_recognised_and_the_next_window_planned(
    reference: Reference, plan: Plan, tmp_path: Path
) -> None:
    done = plan.windows
    switched = read(written(drop(*done), tmp_path), BOX)
    found = plan_of(switched, PLAIN, done=done, before=reference)
    assert [row.window for row in found.flights if row.status == "done"] == list(done)
    assert found.windows
    assert found.windows[0][0] > done[-1][1]
    for row in found.flights:
        if row.done:
            assert abs(sure(row.done.moved)) <= row.margin.time
            assert not row.done.landed_rigid
    landed = [row.done.landing for row in found.flights if row.done]
    contacts = [start for start, _ in drop(*done).landings]
    assert all(
        min(abs(one - at) for at in contacts) < 2e-3
        for one in landed
        if one is not None
    )
    assert found.next_run == (*done, *found.windows)
    assert plan.next_run == done
    assert plan_of(switched, PLAIN, done=done, min_rigid=1.0).next_run == ()


@pytest.mark.slow
@pytest.mark.parametrize("window", [(0.31, 0.5), (0.281, 0.75)])
def test_a_contact_at_the_beginning_of_a_rigid_time_is_told(
    plan: Plan, window: tuple[float, float], tmp_path: Path
) -> None:
    """The box is made rigid before, or while, it stands on the ground; it takes off while it is rigid."""
    done = [one for one in (plan.windows[0], window) if one[1] < window[0]] + [window]
    record = drop(*done)
    (take_off,) = [end for _, end in record.landings if window[0] < end < window[1]]
    found = plan_of(read(written(record, tmp_path), BOX), PLAIN, done=done)
    (told,) = [row.done for row in found.flights if row.done and row.window == window]
    assert not told.landed_rigid
    assert told.took_off == pytest.approx(take_off, abs=1e-3)
    assert "rigid in the contact" in told.told
    assert "landed-rigid" in [caution.code for caution in found.cautions]
    assert not found.supported
    assert not found.next_run
    reasons = [row.reason or "" for row in found.flights if row.status == "re-plan"]
    assert reasons
    assert all(
        f"in the window {window[0]:.6g} to {window[1]:.6g}" in reason
        for reason in reasons
    )


def test_where_nothing_vibrates_td_lies_as_late_as_the_margin_allows(
    reference: Reference, plan: Plan
) -> None:
    resting = [
        row
        for row in plan.flights
        if row.window and row.answer and row.answer.situation.at_rest
    ]
    assert [row.number for row in resting] == [
        1
    ]  # after it there is plastic work, and little vibration above it
    for row in resting:
        room = max(row.margin.time, 2 * (row.margin.spread or 0.0))
        assert sure(row.window)[1] == pytest.approx(row.end - room, abs=1e-5)
    flight = resting[0].flight
    cut = reference.history.between(0, 0.9 * (flight.end or 0))[
        0
    ].size  # a record that ends before the landing
    short = replace(
        reference.history,
        time=reference.history.time[:cut],
        energy=reference.history.energy[:cut],
    )
    found = sure(
        suggest_in_window(
            short, (0.0, float(short.time[-1])), replace(PLAIN, after=0.0)
        ).recommended
    )
    assert short.time[-3] < found.td <= short.time[-2]


@pytest.mark.slow
def test_a_window_that_is_done_where_nothing_flies_is_told(tmp_path: Path) -> None:
    window = (0.31, 0.36)  # on the ground all the time
    found = plan_of(read(written(drop(window), tmp_path), BOX), PLAIN, done=[window])
    assert (
        "done-without-flight",
        "the window 0.31 to 0.36: no flight is seen there",
    ) in found.cautions
    assert window not in [row.window for row in found.flights]


def test_a_run_that_was_not_switched_is_not_taken_for_one(
    reference: Reference, plan: Plan
) -> None:
    with pytest.raises(RangeError, match="said to be done"):
        plan_of(reference, PLAIN, done=plan.windows)
    with pytest.raises(RangeError, match="outside the record"):
        plan_of(reference, PLAIN, done=[(0.1, 9.0)])


# ---- a real solver


@pytest.mark.slow
def test_the_flights_and_windows_of_the_computed_box() -> None:
    """Contacts as the solver wrote them, openradioss/car_drop/drop2_runs.csv.

    A window of more than half the longest comes first: one after the other both are had with one more run.
    """
    found = plan_of(solved("drop2T01.gz"), PLAIN)
    flights = [
        (0, 0.2858),
        (0.3022, 0.3386),
        (0.3394, 0.4196),
        (0.4206, 0.4800),
        (0.5020, 0.5966),
        (0.619, 0.6614),
    ]
    for row, (start, end) in zip(found.flights, flights, strict=False):
        assert (row.start, row.end) == pytest.approx((start, end), abs=1e-3)
    assert statuses(found) == [
        "supported",
        "left-out",
        "supported",
        "left-out",
        "re-plan",
        "left-out",
        "re-plan",
    ]
    assert found.flights[4].rigid_time == pytest.approx(
        0.0888, abs=4e-4
    )  # a state each 0.4 ms


def test_a_landing_while_rigid_is_told() -> None:
    """Three windows planned from one reference: the third landed 5.4 ms early, while it was rigid."""
    legs = [stored(f"drop2_w123_T0{leg}.gz") for leg in range(1, 7)]
    done = [(0.0, 0.2838), (0.3654, 0.4176), (0.5046, 0.5946)]
    found = plan_of(read(legs), PLAIN, done=done, before=solved("drop2T01.gz"))
    moved = [row.done.moved for row in found.flights if row.done]
    assert moved == pytest.approx([0.0, -1.6e-3, -5.4e-3], abs=3e-4)
    again = plan_of(
        read(legs), PLAIN, done=done, before=read(legs)
    )  # rigid times of that run are no flights
    assert [row.done.moved for row in again.flights if row.done] == [0.0, 0.0, 0.0]
    assert [row.done.landed_rigid for row in found.flights if row.done] == [
        False,
        False,
        True,
    ]
    assert found.supported == ()
    assert "landed-rigid" in [caution.code for caution in found.cautions]
    alone = plan_of(
        read(legs), PLAIN
    )  # recognised by the kinetic energy that the parts lack
    recognised = [row.window for row in alone.flights if row.done and row.window]
    assert [time for pair in recognised for time in pair] == pytest.approx(
        [t for pair in done for t in pair], abs=1e-3
    )


def test_the_switched_car_landed_as_computed() -> None:
    legs = [stored(f"car_all_T0{leg}.gz") for leg in range(1, 4)]
    found = plan_of(
        read(legs), PLAIN, done=[(0.0496, 0.1464)], before=solved("carT01.gz")
    )
    (moved,) = (row.done.moved for row in found.flights if row.done)
    assert moved == pytest.approx(0.5e-3, abs=1.5e-4)


@pytest.mark.slow
def test_flights_of_the_energy_alone_end_before_the_next_begins(tmp_path: Path) -> None:
    """One window was offered for two flights that lay in each other, as the energy before and after a load tells."""
    record = drop(tilt=35.0, interval=1e-4)
    rows = zip(record.time.tolist(), record.internal_energy[:, 0].tolist(), strict=True)
    table = tmp_path / "energy.csv"
    table.write_text(
        "time,internal_energy\n" + "".join(f"{t!r},{energy!r}\n" for t, energy in rows)
    )
    found = plan_of(read([str(table)]), PLAIN)
    assert len(found.flights) == 3
    assert all(one.end < other.start for one, other in pairwise(found.flights))
    windows = found.all_windows
    assert all(one[1] < other[0] for one, other in pairwise(windows))


def bouncing(seed: int) -> Reference:
    """The energy of a run of two to five impacts, after each of which another vibration sets in."""
    rng = np.random.default_rng(seed)
    time = np.linspace(0.0, 1.0, int(rng.integers(300, 900)))
    plastic, elastic = np.zeros_like(time), np.zeros_like(time)
    for impact in np.sort(rng.uniform(0.05, 0.95, int(rng.integers(2, 6)))):
        rate, damping, size = rng.uniform((40, 0, 0.3), (300, 10, 2))
        since = np.clip(time - impact, 0, None)
        pushed = np.clip(since / rng.uniform(0.01, 0.05), 0, 1)
        elastic += size * np.exp(-damping * since) * np.sin(rate * since) * pushed
        plastic += rng.uniform(0, 2) * pushed
    return made(of(plastic + elastic**2, time))


@pytest.mark.slow
@settings(max_examples=8)
@given(seed=st.integers(0, 100_000))
@example(seed=204)  # at the end of this flight the energy shows none
def test_a_window_of_the_energy_alone_lies_in_its_flight(seed: int) -> None:
    """The energy shows another beginning of the flight to each td; a window began before the flight of its row."""
    reference = bouncing(seed)
    plan = plan_of(reference, PLAIN)
    for row in plan.flights:
        assert (
            row.window is None
            or round_to_first_as_read(row.start)
            <= row.window[0]
            < row.window[1]
            <= row.end
        )
    assert all(one.end <= other.start for one, other in pairwise(plan.flights))
    if len(plan.flights) == 1 and plan.flights[0].window:
        alone = sure(suggest_of(reference, None, PLAIN).recommended)
        assert plan.flights[0].window == (alone.tr, alone.td)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [33, 72])
def test_no_other_td_of_a_flight_reaches_back_beyond_a_landing(seed: int) -> None:
    """The page of a plan offered pairs that were rigid while the flight before had not landed."""
    reference = bouncing(seed)
    plan = plan_of(reference, PLAIN)
    landings = {row.number: row.end for row in plan.flights}
    rows = [row for row in plan.flights if row.window]
    for row, found in zip(rows, explored_flights(reference, plan), strict=True):
        assert (sure(found.asked).tr, sure(found.asked).td) == row.window
        assert all(
            one.tr is None or one.tr >= landings.get(row.number - 1, 0.0)
            for one in found.offers
        )


# ---- a short window before a longer one


@pytest.fixture(scope="module")
def car() -> Reference:
    return solved("carT01.gz", "1-14")


@pytest.mark.slow
def test_a_short_window_that_locks_in_energy_is_left_out_for_a_much_longer_one(
    car: Reference,
) -> None:
    """Between two pushes the car is rigid for 17 ms, after them for 108: the window that `parts` compares sets in."""
    found = plan_of(car, PLAIN)
    assert statuses(found) == ["left-out", "supported"]
    assert "flight 2 behind it for 0.108: this window locks in energy" in (
        found.flights[0].reason or ""
    )
    longest = sure(suggest_of(car, None, PLAIN).recommended)
    assert found.windows == ((longest.tr, longest.td),)


@pytest.mark.slow
def test_a_window_that_is_left_out_says_what_it_would_cost_the_longer_one_even_where_that_waits(
    tmp_path: Path,
) -> None:
    """Flight 2 is left out for flight 4, which waits for flight 3: with flight 2 it would wait for one run more."""
    box = read(written(drop(height=0.15, tilt=80.0), tmp_path), BOX)
    found = plan_of(box, PLAIN)
    assert statuses(found)[:4] == ["supported", "left-out", "supported", "re-plan"]
    reason = found.flights[1].reason or ""
    assert "flight 4 behind it for 0.192: this window locks in energy" in reason
    assert "that flight would wait for one run more" in reason
    every = plan_of(box, PLAIN, min_rigid=0.07)
    assert statuses(every)[:4] == ["supported", "supported", "re-plan", "re-plan"]


@pytest.mark.slow
def test_a_minimal_rigid_time_that_is_given_plans_both_one_after_the_other(
    car: Reference,
) -> None:
    found = plan_of(car, PLAIN, min_rigid=0.013)
    assert statuses(found) == ["supported", "re-plan"]
    assert found.flights[0].rigid_time == pytest.approx(0.0131, abs=1e-4)
    assert [one.code for one in found.cautions][-1] == "longer-window-later"
