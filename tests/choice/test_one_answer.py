"""One question has one answer: each command confirms the pairs, windows and flights that another one prints."""

import re
from dataclasses import replace
from functools import cache
from html import unescape
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import d2rpick as d2
from d2rpick.choice.answers import (
    PairVerdict,
    suggest_in_history,
    verify_at,
    verify_in_history,
)
from d2rpick.choice.pair.windows import find_acceptable_windows
from d2rpick.choice.question import Reference, Settings
from d2rpick.choice.td.plan import plan_run
from d2rpick.flight.flight import find_all_seen, find_seen_flight
from d2rpick.histories.digits import round_as_read
from d2rpick.histories.history import History
from d2rpick.histories.opening import Selection
from d2rpick.report.suggestion import describe_acceptable_windows
from d2rpick.rules.judgement import find_faults
from tests.choice.test_same_answers import make_record
from tests.command import BOX, MATSUM, ROOT, run
from tests.computed import locate_stored
from tests.drops import drop, write_run_files
from tests.energies import (
    list_codes,
    make_energy_history,
    make_reference,
    require,
    suggest_in_window,
)
from tests.reading import read

PLAIN = Settings()
# The level alone gives poor pairs here, because no oscillator describes the box and none is searched for.
LEVEL = Settings(replay=False, min_quality="poor")
planned = cache(plan_run)


@pytest.fixture(scope="module")
def box(tmp_path_factory: pytest.TempPathFactory) -> Reference:
    return read(
        write_run_files(drop(), tmp_path_factory.mktemp("run")),
        Selection(parts=("box",)),
    )


def make_resting_history() -> History:
    """Return a constant energy over times of many digits."""
    time = 0.10005206614732742 + np.linspace(0, 1, 101)
    return make_energy_history(np.ones(time.size), time)


def read_again(
    history: History, tr: float, td: float, settings: Settings
) -> PairVerdict:
    """Judge a pair with its times as they are printed."""
    return verify_in_history(history, round_as_read(tr), round_as_read(td), settings)


@pytest.mark.slow
@pytest.mark.parametrize("td", [0.7, 0.8])
def test_the_better_pair_is_what_is_said_of_its_td(td: float) -> None:
    history = make_record("five modes")
    pair = require(suggest_in_history(history, td, PLAIN).better_pair)
    assert suggest_in_history(history, pair.td, PLAIN).recommended == pair


@pytest.mark.parametrize(
    "arguments", [{"max_residual": 0.9}, {"max_kinetic_share": 0.9}]
)
def test_where_nothing_vibrates_every_tr_is_acceptable_and_verifies(
    arguments: dict[str, Any],
) -> None:
    """Limits of the vibration refuse no pair there: suggest, its windows and verify agree."""
    history, settings = make_resting_history(), Settings(after=0.3, **arguments)
    answer = suggest_in_history(history, 0.8, settings)
    assert answer.situation.at_rest
    assert require(answer.recommended).tr == 0.3
    (window,) = answer.windows or ()
    assert window.start == 0.3
    assert window.end == pytest.approx(0.8)
    for tr in (window.start, 0.5, window.end):
        assert verify_in_history(history, tr, 0.8, settings).admissible
    found = find_acceptable_windows(answer.situation, answer.candidates, None)
    assert found.tolist() == [[0.3, pytest.approx(0.8)]]


def test_a_start_that_is_read_does_not_lie_before_the_flight() -> None:
    history = make_resting_history()
    settings = Settings(after=float(history.time[0]))
    answer = suggest_in_history(history, 0.8, settings)
    assert "at-rest" in list_codes(answer)
    assert read_again(history, *require(answer.recommended)[:2], settings).admissible


@pytest.mark.slow
def test_a_td_that_is_read_keeps_the_margin(box: Reference) -> None:
    settings = replace(LEVEL, margin=0.0123456789)
    for row in plan_run(box, settings).flights:
        if row.window:
            assert read_again(box.history, *row.window, settings).admissible


@pytest.mark.slow
def test_every_tr_of_the_windows_that_are_read_verifies() -> None:
    history, settings = make_record("five modes"), Settings(after=0.1, replay=False)
    answer = suggest_in_history(history, 0.8, settings)
    line = describe_acceptable_windows(answer.windows or (), None)
    windows = re.findall(r"(\S+) to (\S+) \(", line)
    assert len(windows) > 2
    assert all(
        verify_at(answer.situation, float(tr_read)).admissible
        for window in windows
        for tr_read in window
    )


@pytest.mark.slow
def test_a_plan_begins_a_flight_where_the_load_is_said_to_end(box: Reference) -> None:
    second = planned(box, LEVEL).flights[1]
    load_end = (second.start + second.end) / 2
    settings = replace(LEVEL, after=load_end)
    (row,) = (
        flight_row
        for flight_row in plan_run(box, settings).flights
        if flight_row.number == second.number
    )
    assert row.window
    flight = verify_in_history(box.history, *row.window, settings).situation.flight
    assert (row.flight.start, row.flight.end, row.flight.source) == (
        load_end,
        flight.end,
        flight.source,
    )
    assert row.margin.time == pytest.approx(0.03 * (second.end - load_end))
    assert row.window[1] <= row.end - row.margin.time


def test_verify_and_check_name_the_same_ends_of_a_flight(box: Reference) -> None:
    settings = replace(LEVEL, margin=0.01)
    flight = planned(box, LEVEL).flights[1]
    verdict = verify_in_history(
        box.history, flight.start + 0.005, flight.end - 0.005, settings
    )
    reasons = [reason for reason in verdict.reasons if "s the margin" in reason]
    messages = [
        fault.message for fault in find_faults(verdict) if fault.rule == "D2R204"
    ]
    assert len(reasons) == len(messages) == 2
    for reason, message in zip(reasons, messages, strict=True):
        assert reason.removeprefix("td ").removeprefix("tr ") in message


@pytest.mark.parametrize("margin", [None, 0.01])
def test_the_last_td_that_is_named_lies_in_the_flight(
    box: Reference, margin: float | None
) -> None:
    settings, flights = replace(LEVEL, margin=margin), planned(box, LEVEL).flights
    answer = suggest_in_history(
        box.history, (flights[1].end + flights[2].start) / 2, settings
    )
    (message,) = (
        caution.message
        for caution in answer.cautions
        if caution.code == "no-free-flight"
    )
    match = require(
        re.search(
            r"its last td is (\S+)$" if margin else r"to (\S+); td must lie in it$",
            message,
        )
    )
    assert suggest_in_history(box.history, float(match[1]), settings).recommended


@pytest.mark.parametrize(
    "file", [locate_stored("rollover_r100_T01.gz"), BOX, locate_stored("drop2T01.gz")]
)
def test_a_flight_that_is_listed_is_the_one_that_is_used(file: str) -> None:
    history = read([file]).history
    listed = find_all_seen(history)
    assert listed
    for source, flight in listed:
        used = find_seen_flight(history, (flight.start + flight.end) / 2)
        assert (source, flight) == (used.source, used.flight)


def test_an_error_that_is_refused_reads_as_too_large() -> None:
    history, td = make_record("one mode"), 0.8
    best = require(suggest_in_history(history, td, PLAIN).chosen)
    assert best.residual
    barely = Settings(max_residual=best.residual * (1 - 1e-6))
    (reason,) = (
        reason_text
        for reason_text in verify_in_history(history, best.tr, td, barely).reasons
        if "above the limit" in reason_text
    )
    value, limit = map(float, re.findall(r"[\d.]+", reason))
    assert value > limit


@pytest.mark.slow
def test_a_plan_knows_a_flight_as_surely_as_the_td_in_it() -> None:
    """An oscillator fits around some td of the flight, but not around the chosen td."""
    rng, time = np.random.default_rng(0), np.linspace(0, 1, 1500)
    load, contact, omega, alpha = (
        rng.uniform(0.05, 0.3),
        rng.uniform(0.6, 0.9),
        rng.uniform(20, 60),
        rng.uniform(0, 3),
    )
    energy = np.exp(-alpha * time) * np.sin(omega * time + omega) ** 2
    energy += np.where(time < load, 6 * np.sin(np.pi * time / load) ** 2, 0)
    energy += np.where(time > contact, 20 * ((time - contact) / (1 - contact)) ** 2, 0)
    record = make_reference(make_energy_history(energy, time))
    rows = [row for row in plan_run(record, PLAIN).flights if row.window]
    assert rows
    for row in rows:
        flight = verify_in_history(
            record.history, *require(row.window), PLAIN
        ).situation.flight
        assert (row.flight.source, row.flight.certain, row.start) == (
            flight.source,
            flight.certain,
            flight.start,
        )


def test_a_flight_whose_start_is_given_ends_where_the_oscillator_does() -> None:
    time = np.linspace(0, 1, 1500)
    energy = np.exp(-time) * np.sin(40 * time) ** 2 + np.where(
        time > 0.8, 30 * (time - 0.8), 0
    )
    record, settings = (
        make_reference(make_energy_history(energy, time)),
        Settings(after=0.1),
    )
    (row,) = plan_run(record, settings).flights
    flight = verify_in_history(
        record.history, *require(row.window), settings
    ).situation.flight
    assert row.flight == flight
    assert row.end == pytest.approx(0.8, abs=0.01)
    assert row.margin.source == "flight"
    assert suggest_in_window(record.history, None, settings).td_window == (0.1, row.end)


@pytest.mark.slow
def test_a_card_says_the_same_of_a_pair_whoever_prints_it(tmp_path: Path) -> None:
    """This includes the health of the run, and a td that is printed with other digits than those chosen."""
    time = np.linspace(0, 1, 1500) / 7
    values = np.stack(
        [time, np.exp(-time) * np.sin(280 * time) ** 2, 0.2 + 0 * time], axis=1
    )
    file = tmp_path / "energy.csv"
    head = "time,internal_energy,hourglass_energy"
    np.savetxt(file, values, delimiter=",", header=head, comments="", fmt="%.17g")
    body = ("-q", "--solver", "radioss", "--node", "1")
    of_suggest = run("suggest", *body, "-f", "card", str(file)).stdout
    # The comment rounds the times; the engine files have them with all digits.
    tr, td, *_ = re.findall(r"/RUN/\S+\n *(\S+)\n", of_suggest)
    of_card = run("card", *body, "--tr", tr, "--td", td, "--history", str(file)).stdout
    page = tmp_path / "page.html"
    run("verify", *body, "--tr", tr, "--td", td, "--report", str(page), str(file))
    judged = of_card[of_card.index("Verdict according to") :]
    assert "hourglass: " in judged
    assert of_suggest[of_suggest.index("Verdict according to") :] == judged
    assert judged.splitlines()[0] in unescape(page.read_text("utf-8"))
    assert (
        "hourglass: "
        in unescape(page.read_text("utf-8"))
        .partition("/RUN/")[0]
        .rpartition("Verdict according to")[2]
    )


def test_a_plan_keeps_the_margin_that_it_lists() -> None:
    """For a td in this flight, the energy alone shows no end of the flight."""
    rng, time = np.random.default_rng(277), np.linspace(0, 1, 200)
    omega, phase = rng.uniform(20, 80, 2), rng.uniform(0, 6, 2)
    energy = (
        np.sin(omega[0] * time + phase[0]) ** 2
        + 0.5 * np.sin(omega[1] * time + phase[1]) ** 2
        + 0.6
    )
    rows = [
        row
        for row in plan_run(
            make_reference(make_energy_history(energy, time)), LEVEL
        ).flights
        if row.window and row.flight.end
    ]
    assert rows
    for row in rows:
        assert require(row.window)[1] <= row.end - row.margin.time


def test_a_crossing_at_the_start_of_the_flight_may_be_typed_as_it_is_read() -> None:
    time = 0.10005206614732742 + np.linspace(0, 1, 401)
    history = make_energy_history(1 + np.sin(40 * (time - time[60])) ** 2, time)
    start = float(time[60])
    settings = replace(LEVEL, after=start)
    assert round_as_read(start) < start
    for tr in (start, round_as_read(start)):
        verdict = verify_in_history(history, tr, float(time[60] + np.pi / 10), settings)
        assert verdict.admissible
        assert not list(find_faults(verdict))
    assert not verify_in_history(
        history, start - 1e-5, float(time[60] + np.pi / 10), settings
    ).admissible


@pytest.mark.parametrize("after", [None, 0.086, 0.087])
def test_a_state_at_the_end_of_the_load_does_not_turn_the_answer(
    after: float | None,
) -> None:
    """The momenta begin the flight a state before the energies; with this state, R was stated as 0 to 1.55."""
    box = d2.read([MATSUM, str(ROOT / "sample_data" / "rollover_box.glstat")])
    verdict = d2.verify(box, tr=0.123689, td=0.37, after=after).to_dict()
    alone = d2.verify(d2.read(MATSUM), tr=0.123689, td=0.37, parts="flying").to_dict()
    assert verdict["residual"] == pytest.approx(alone["residual"], abs=0.01)
    assert verdict["residual_high"] < 0.75
    assert verdict["quality"] == alone["quality"]
