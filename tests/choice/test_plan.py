"""Plans: flights, windows and what one reference run supports, for computed runs of the box and of a solver."""

from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import example, given, settings, strategies as st

from d2rpick.base.errors import RangeError
from d2rpick.choice.answers import suggest_in_run
from d2rpick.choice.question import Reference, Settings
from d2rpick.choice.td.plan import RunPlan, plan_run
from d2rpick.choice.td.trade_off import explore_flights
from d2rpick.histories.digits import round_to_first_as_read
from d2rpick.histories.opening import Selection
from tests.computed import locate_stored
from tests.drops import drop, write_run_files
from tests.energies import (
    make_energy_history,
    make_reference as made,
    require,
    suggest_in_window,
)
from tests.reading import read, read_solved

# The level alone gives poor pairs here, because no oscillator describes these runs and none is searched for.
PLAIN = Settings(replay=False, min_quality="poor")
BOX = Selection(parts=("box",))
# A car grazes its second push. The margin for a grazing contact leaves no time between the pushes; this margin does.
SHORT_MARGIN = replace(PLAIN, margin=0.0015)


@pytest.fixture(scope="module")
def reference(tmp_path_factory: pytest.TempPathFactory) -> Reference:
    return read(write_run_files(drop(), tmp_path_factory.mktemp("run")), BOX)


@pytest.fixture(scope="module")
def plan(reference: Reference) -> RunPlan:
    return plan_run(reference, PLAIN)


def list_statuses(plan: RunPlan) -> list[str]:
    return [row.status for row in plan.flights]


@pytest.mark.slow
def test_every_flight_of_the_box_is_listed_where_it_lies(plan: RunPlan) -> None:
    touched = drop().landings
    assert len(plan.flights) >= 3
    for row in plan.flights:
        inside = [
            t for t in touched if row.start + 2e-3 < t[1] and t[0] < row.end - 2e-3
        ]
        assert not inside, f"{row.start} to {row.end}"


def test_the_first_fall_is_rigid_from_the_start_and_the_first_that_locks_in_energy_is_the_last_supported(
    plan: RunPlan,
) -> None:
    first, *other_rows = [row for row in plan.flights if row.window]
    assert require(first.window)[0] == 0.0
    assert (first.status, first.locks_in) == ("supported", False)
    assert other_rows[0].status == "supported"
    assert other_rows[0].locks_in
    assert {row.status for row in other_rows[1:]} == {"re-plan"}
    for row in other_rows[1:]:
        assert (
            f"{require(other_rows[0].window)[0]:.6g} to {require(other_rows[0].window)[1]:.6g}"
            in (row.reason or "")
        )


def test_each_window_is_what_suggest_says_for_its_td(
    reference: Reference, plan: RunPlan
) -> None:
    for tr, td in plan.all_windows:
        suggestion = suggest_in_run(reference, td, PLAIN)
        assert (
            require(suggestion.recommended).tr,
            require(suggestion.recommended).td,
        ) == (tr, td)


def test_windows_keep_their_margin_and_follow_each_other(plan: RunPlan) -> None:
    windows = plan.all_windows
    assert all(
        earlier_window[1] < later_window[0]
        for earlier_window, later_window in pairwise(windows)
    )
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
    planned = plan_run(reference, replace(PLAIN, margin=0.02))
    assert {row.margin.time for row in planned.flights} == {0.02}
    assert planned.flights[0].window == pytest.approx(
        (0.02, planned.flights[0].end - 0.02), abs=1e-9
    )


def test_short_windows_are_left_out_with_the_reason(reference: Reference) -> None:
    planned = plan_run(reference, PLAIN, min_rigid=0.2)
    for row in planned.flights:
        assert (row.status == "left-out") == (row.window is None)
        assert row.window is None or row.window[1] - row.window[0] >= 0.2
        assert row.status != "left-out" or "at least 0.2 was asked for" in (
            row.reason or ""
        )
    assert plan_run(reference, PLAIN, min_rigid=2.0).supported == ()


def test_after_counts_in_its_flight_alone(reference: Reference, plan: RunPlan) -> None:
    second = plan.flights[1]
    planned = plan_run(reference, replace(PLAIN, after=(second.start + second.end) / 2))
    assert planned.flights[0].status == "left-out"
    assert (
        planned.flights[1].window is None
        or planned.flights[1].window[0] >= (second.start + second.end) / 2
    )
    assert [row.window for row in planned.flights[2:]] == [
        row.window for row in plan.flights[2:]
    ]


# ---- switched runs


@pytest.mark.slow
def test_a_switched_run_is_recognised_and_the_next_window_planned(
    reference: Reference, plan: RunPlan, tmp_path: Path
) -> None:
    done = plan.windows
    switched = read(write_run_files(drop(*done), tmp_path), BOX)
    planned = plan_run(switched, PLAIN, done=done, before=reference)
    assert [row.window for row in planned.flights if row.status == "done"] == list(done)
    assert planned.windows
    assert planned.windows[0][0] > done[-1][1]
    for row in planned.flights:
        if row.done:
            assert abs(require(row.done.moved)) <= row.margin.time
            assert not row.done.landed_rigid
    landed = [row.done.landing for row in planned.flights if row.done]
    contacts = [start for start, _ in drop(*done).landings]
    assert all(
        min(abs(landing - contact) for contact in contacts) < 2e-3
        for landing in landed
        if landing is not None
    )
    assert planned.next_run == (*done, *planned.windows)
    assert plan.next_run == done
    assert plan_run(switched, PLAIN, done=done, min_rigid=1.0).next_run == ()


@pytest.mark.slow
@pytest.mark.parametrize("window", [(0.31, 0.5), (0.281, 0.75)])
def test_a_contact_at_the_beginning_of_a_rigid_time_is_told(
    plan: RunPlan, window: tuple[float, float], tmp_path: Path
) -> None:
    """The box becomes rigid before or while it stands on the ground, and takes off while it is rigid."""
    done = [
        planned_window
        for planned_window in (plan.windows[0], window)
        if planned_window[1] < window[0]
    ] + [window]
    record = drop(*done)
    (take_off,) = [end for _, end in record.landings if window[0] < end < window[1]]
    planned = plan_run(read(write_run_files(record, tmp_path), BOX), PLAIN, done=done)
    (row_done,) = [
        row.done for row in planned.flights if row.done and row.window == window
    ]
    assert not row_done.landed_rigid
    assert row_done.took_off == pytest.approx(take_off, abs=1e-3)
    assert "rigid in the contact" in row_done.description
    assert "landed-rigid" in [caution.code for caution in planned.cautions]
    assert not planned.supported
    assert not planned.next_run
    reasons = [row.reason or "" for row in planned.flights if row.status == "re-plan"]
    assert reasons
    assert all(
        f"in the window {window[0]:.6g} to {window[1]:.6g}" in reason
        for reason in reasons
    )


def test_where_nothing_vibrates_td_lies_as_late_as_the_margin_allows(
    reference: Reference, plan: RunPlan
) -> None:
    resting = [
        row
        for row in plan.flights
        if row.window and row.answer and row.answer.situation.at_rest
    ]
    assert [row.number for row in resting] == [
        1
    ]  # afterwards, there is plastic work with little vibration above it
    for row in resting:
        room = max(row.margin.time, 2 * (row.margin.spread or 0.0))
        assert require(row.window)[1] == pytest.approx(row.end - room, abs=1e-5)
    flight = resting[0].flight
    cut = reference.history.between(0, 0.9 * (flight.end or 0))[
        0
    ].size  # a record that ends before the landing
    short = replace(
        reference.history,
        time=reference.history.time[:cut],
        energy=reference.history.energy[:cut],
    )
    suggestion = require(
        suggest_in_window(
            short, (0.0, float(short.time[-1])), replace(PLAIN, after=0.0)
        ).recommended
    )
    assert short.time[-3] < suggestion.td <= short.time[-2]


@pytest.mark.slow
def test_a_window_that_is_done_where_nothing_flies_is_told(tmp_path: Path) -> None:
    window = (0.31, 0.36)  # the box stands on the ground all the time
    planned = plan_run(
        read(write_run_files(drop(window), tmp_path), BOX), PLAIN, done=[window]
    )
    assert (
        "done-without-flight",
        "the window 0.31 to 0.36: no flight is found there",
    ) in planned.cautions
    assert window not in [row.window for row in planned.flights]


def test_a_run_that_was_not_switched_is_not_taken_for_one(
    reference: Reference, plan: RunPlan
) -> None:
    with pytest.raises(RangeError, match="a window that `done` names"):
        plan_run(reference, PLAIN, done=plan.windows)
    with pytest.raises(RangeError, match="outside the record"):
        plan_run(reference, PLAIN, done=[(0.1, 9.0)])


# ---- a real solver


@pytest.mark.slow
def test_the_flights_and_windows_of_the_computed_box() -> None:
    """Contacts as the solver reports them (openradioss/car_drop/drop2_runs.csv).

    A window of more than half the longest one is planned first: one more run then gives both windows.
    """
    planned = plan_run(read_solved("drop2T01.gz"), PLAIN)
    flights = [
        (0, 0.2858),
        (0.3022, 0.3386),
        (0.3394, 0.4196),
        (0.4206, 0.4800),
        (0.5020, 0.5966),
        (0.619, 0.6614),
    ]
    for row, (start, end) in zip(planned.flights, flights, strict=False):
        assert (row.start, row.end) == pytest.approx((start, end), abs=1e-3)
    assert list_statuses(planned) == [
        "supported",
        "left-out",
        "supported",
        "left-out",
        "re-plan",
        "left-out",
        "re-plan",
    ]
    assert planned.flights[4].rigid_time == pytest.approx(
        0.0888, abs=4e-4
    )  # one state each 0.4 ms


def test_a_landing_while_rigid_is_told() -> None:
    """Three windows planned from one reference: the third landed 5.4 ms early, while it was rigid."""
    legs = [locate_stored(f"drop2_w123_T0{leg}.gz") for leg in range(1, 7)]
    done = [(0.0, 0.2838), (0.3654, 0.4176), (0.5046, 0.5946)]
    planned = plan_run(read(legs), PLAIN, done=done, before=read_solved("drop2T01.gz"))
    moved = [row.done.moved for row in planned.flights if row.done]
    assert moved == pytest.approx([0.0, -1.6e-3, -5.4e-3], abs=3e-4)
    again = plan_run(
        read(legs), PLAIN, done=done, before=read(legs)
    )  # rigid times of that run are not flights
    assert [row.done.moved for row in again.flights if row.done] == [0.0, 0.0, 0.0]
    assert [row.done.landed_rigid for row in planned.flights if row.done] == [
        False,
        False,
        True,
    ]
    assert planned.supported == ()
    assert "landed-rigid" in [caution.code for caution in planned.cautions]
    alone = plan_run(
        read(legs), PLAIN
    )  # recognised by the missing kinetic energy of the parts
    recognised = [row.window for row in alone.flights if row.done and row.window]
    assert [time for pair in recognised for time in pair] == pytest.approx(
        [t for pair in done for t in pair], abs=1e-3
    )


def test_the_switched_car_landed_as_computed() -> None:
    legs = [locate_stored(f"car_all_T0{leg}.gz") for leg in range(1, 4)]
    planned = plan_run(
        read(legs), PLAIN, done=[(0.0496, 0.1464)], before=read_solved("carT01.gz")
    )
    (moved,) = (row.done.moved for row in planned.flights if row.done)
    assert moved == pytest.approx(0.5e-3, abs=1.5e-4)


@pytest.mark.slow
def test_flights_of_the_energy_alone_end_before_the_next_begins(tmp_path: Path) -> None:
    """Before and after a load, the energy alone shows overlapping flights, which must not share a window."""
    record = drop(tilt=35.0, interval=1e-4)
    rows = zip(record.time.tolist(), record.internal_energy[:, 0].tolist(), strict=True)
    table = tmp_path / "energy.csv"
    table.write_text(
        "time,internal_energy\n" + "".join(f"{t!r},{energy!r}\n" for t, energy in rows)
    )
    planned = plan_run(read([str(table)]), PLAIN)
    assert len(planned.flights) == 3
    assert all(
        earlier_row.end < later_row.start
        for earlier_row, later_row in pairwise(planned.flights)
    )
    windows = planned.all_windows
    assert all(
        earlier_row[1] < later_row[0] for earlier_row, later_row in pairwise(windows)
    )


def make_bouncing_energy(seed: int) -> Reference:
    """Return the energy of a run with two to five impacts, each of which starts a different vibration."""
    rng = np.random.default_rng(seed)
    time = np.linspace(0.0, 1.0, int(rng.integers(300, 900)))
    plastic, elastic = np.zeros_like(time), np.zeros_like(time)
    for impact in np.sort(rng.uniform(0.05, 0.95, int(rng.integers(2, 6)))):
        rate, damping, size = rng.uniform((40, 0, 0.3), (300, 10, 2))
        since = np.clip(time - impact, 0, None)
        pushed = np.clip(since / rng.uniform(0.01, 0.05), 0, 1)
        elastic += size * np.exp(-damping * since) * np.sin(rate * since) * pushed
        plastic += rng.uniform(0, 2) * pushed
    return made(make_energy_history(plastic + elastic**2, time))


@pytest.mark.slow
@settings(max_examples=8)
@given(seed=st.integers(0, 100_000))
@example(seed=204)  # the energy shows no end of the flight here
def test_a_window_of_the_energy_alone_lies_in_its_flight(seed: int) -> None:
    """The energy shows a different flight start for each td; a window must not begin before the flight of its row."""
    reference = make_bouncing_energy(seed)
    plan = plan_run(reference, PLAIN)
    for row in plan.flights:
        assert (
            row.window is None
            or round_to_first_as_read(row.start)
            <= row.window[0]
            < row.window[1]
            <= row.end
        )
    assert all(
        earlier_row.end <= later_row.start
        for earlier_row, later_row in pairwise(plan.flights)
    )
    if len(plan.flights) == 1 and plan.flights[0].window:
        alone = require(suggest_in_run(reference, None, PLAIN).recommended)
        assert plan.flights[0].window == (alone.tr, alone.td)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [33, 72])
def test_no_other_td_of_a_flight_reaches_back_beyond_a_landing(seed: int) -> None:
    """The page of a plan must not offer pairs that are rigid before the previous flight has landed."""
    reference = make_bouncing_energy(seed)
    plan = plan_run(reference, PLAIN)
    landings = {row.number: row.end for row in plan.flights}
    rows = [row for row in plan.flights if row.window]
    for row, explored in zip(rows, explore_flights(reference, plan), strict=True):
        assert (
            require(explored.requested).tr,
            require(explored.requested).td,
        ) == row.window
        assert all(
            offer.tr is None or offer.tr >= landings.get(row.number - 1, 0.0)
            for offer in explored.offers
        )


# ---- a short window before a longer one


@pytest.fixture(scope="module")
def car() -> Reference:
    return read_solved("carT01.gz", "1-14")


@pytest.mark.slow
def test_a_short_window_that_locks_in_energy_is_left_out_for_a_much_longer_one(
    car: Reference,
) -> None:
    """The car is rigid for 13 ms between two pushes, and for 108 ms after them; `parts` compares sets for 108 ms."""
    planned = plan_run(car, SHORT_MARGIN)
    assert list_statuses(planned) == ["left-out", "supported"]
    assert "flight 2 after it for 0.108: this window freezes vibration energy" in (
        planned.flights[0].reason or ""
    )
    longest = require(suggest_in_run(car, None, SHORT_MARGIN).recommended)
    assert planned.windows == ((longest.tr, longest.td),)


@pytest.mark.slow
def test_a_grazing_push_may_come_before_any_window_between_two_pushes(
    car: Reference,
) -> None:
    """The second push takes little momentum at first, so a displaced car may meet it at any earlier time."""
    planned = plan_run(car, PLAIN)
    assert list_statuses(planned) == ["left-out", "supported"]
    between, after = planned.flights
    assert between.margin.source == "grazing"
    assert between.margin.time > between.end - between.start
    assert "too short: rigid for 0, with the margin" in (between.reason or "")
    longest = require(suggest_in_run(car, None, PLAIN).recommended)
    assert after.window == (longest.tr, longest.td)
    assert after.rigid_time == pytest.approx(0.108, abs=5e-4)


@pytest.mark.slow
def test_a_window_that_is_left_out_says_what_it_would_cost_the_longer_one_even_where_that_waits(
    tmp_path: Path,
) -> None:
    """Flight 2 is left out for flight 4, which waits for flight 3; with flight 2 it would wait one run longer."""
    box = read(write_run_files(drop(height=0.15, tilt=80.0), tmp_path), BOX)
    planned = plan_run(box, PLAIN)
    assert list_statuses(planned)[:4] == [
        "supported",
        "left-out",
        "supported",
        "re-plan",
    ]
    reason = planned.flights[1].reason or ""
    assert "flight 4 after it for 0.192: this window freezes vibration energy" in reason
    assert "that flight would need a further run" in reason
    plan_made = plan_run(box, PLAIN, min_rigid=0.07)
    assert list_statuses(plan_made)[:4] == [
        "supported",
        "supported",
        "re-plan",
        "re-plan",
    ]


@pytest.mark.slow
def test_a_minimal_rigid_time_that_is_given_plans_both_one_after_the_other(
    car: Reference,
) -> None:
    planned = plan_run(car, SHORT_MARGIN, min_rigid=0.013)
    assert list_statuses(planned) == ["supported", "re-plan"]
    assert planned.flights[0].rigid_time == pytest.approx(0.0132, abs=1e-4)
    assert [caution.code for caution in planned.cautions][-1] == "longer-window-later"
