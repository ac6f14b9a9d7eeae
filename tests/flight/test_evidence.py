"""Flights found by all evidence in the files of computed runs, compared with the known flights of these runs."""

import json
import re
from functools import cache
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd
import pytest

from d2rpick.choice.answers import suggest_in_history, verify_at
from d2rpick.choice.pair.situation import examine_td
from d2rpick.choice.question import Settings
from d2rpick.choice.td.flights import find_flights
from d2rpick.flight.flight import find_seen_flight
from d2rpick.flight.internal_energy import find_quiet_time
from d2rpick.histories.digits import format_window
from d2rpick.histories.history import Balance, Given, History, Momenta
from d2rpick.histories.names import Selection
from d2rpick.histories.opening import open_run
from d2rpick.models.box_model import Parameters
from d2rpick.models.box_run import Record, simulate
from d2rpick.report.history_files import BOX_WRITERS
from tests.command import (
    BOX,
    ENERGY,
    ROLLOVER,
    join_wrapped_lines,
    list_warning_codes,
    put,
    run,
    run_json,
)
from tests.computed import locate_stored, read_columns
from tests.energies import require
from tests.json_schemas import run_json_checked
from tests.records import make_table
from tests.sample_box import make_t01

MILLISECOND = 1e-3
CAR, DROP = locate_stored("carT01.gz"), locate_stored("drop2T01.gz")

ALONE = ("--td", "0.37", "--no-verify", "--energy", "boxIE_J", ROLLOVER)


class Rolled(NamedTuple):
    """Computed rollover run, and its true flight."""

    record: Record
    folder: Path
    start: float
    end: float

    def file(self, form: str) -> str:
        """Write the run in a format and return the file name."""
        path = self.folder / f"run.{form}"
        if not path.exists():
            path.write_bytes(
                make_t01(self.record)
                if form == "T01"
                else BOX_WRITERS[form](self.record)
            )
        return str(path)


@pytest.fixture(
    scope="module",
    params=[
        Parameters(mesh=6, speed=7.4, stiffness=6e6, damping=1.0),
        pytest.param(
            Parameters(
                mesh=5, speed=6.7, stiffness=3.5e6, yield_strain=6e-3, damping=0.0
            ),
            marks=pytest.mark.slow,
        ),
    ],
    ids=["fast", "slow"],
)
def rolled(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> Rolled:
    """Compute runs that were not used to set any threshold."""
    record = simulate(request.param, 0.5, interval=2e-4)
    return Rolled(
        record,
        tmp_path_factory.mktemp("rolled"),
        require(record.released),
        require(record.landed),
    )


@pytest.mark.slow
@pytest.mark.parametrize("form", ["csv", "hdf5", "glstat", "matsum", "T01"])
def test_every_format_of_a_run_tells_its_flight_to_a_millisecond_and_none_after_it(
    rolled: Rolled, form: str
) -> None:
    part = ["--part", "box"] if form in ("matsum", "T01") else []
    arguments = ["suggest", "--no-verify", *part, rolled.file(form), "--td"]
    document = run_json(*arguments, str(round(rolled.end - 0.01, 3)))
    flight = document["flight"]
    assert (flight["certain"], flight["source"]) == (True, "momentum")
    assert (flight["start"], flight["end"]) == pytest.approx(
        (rolled.start, rolled.end), abs=MILLISECOND
    )
    assert document["recommended"]["tr"] >= rolled.start - 2e-4
    assert not list_warning_codes(document) & {
        "contact-in-window",
        "work-in-window",
        "flight-sources-disagree",
    }
    result = run(*arguments, str(rolled.end + 0.02), "-f", "json")
    assert result.exit_code == 1
    assert "no free flight at td" in result.stderr
    flight = json.loads(result.stdout)["flight"]
    assert format_window(flight["start"], flight["end"]) in result.stderr


@pytest.mark.slow
@pytest.mark.parametrize(
    ("names", "options"),
    [
        (("x velocity", "z velocity"), ()),
        (("Global_X_Velocity [m/s]", "Global_Z_Velocity [m/s]"), ()),
        (("v1", "v2"), ("--channel", "x_velocity=v1", "--channel", "z_velocity=v2")),
    ],
)
def test_a_table_with_velocities_tells_the_flight_as_one_with_momenta(
    names: tuple[str, str], options: tuple[str, ...], rolled: Rolled, tmp_path: Path
) -> None:
    table = pd.read_csv(rolled.file("csv"))
    mass = table["momentum_x"][0] / table["vx"][0]
    velocities = {
        name: table[axis] / mass
        for name, axis in zip(names, ("momentum_x", "momentum_z"), strict=True)
    }
    velocity_table = table[["time", "internal_energy"]].assign(**velocities, mass=mass)
    velocity_table.to_csv(tmp_path / "run.csv", index=False)
    td = str(round(rolled.end - 0.01, 3))
    flight_dict, expected = (
        run_json("suggest", "--no-verify", "--td", td, *arguments, str(file))["flight"]
        for arguments, file in (
            (options, tmp_path / "run.csv"),
            ((), rolled.file("csv")),
        )
    )
    assert flight_dict == expected
    assert flight_dict["source"] == "momentum"


@pytest.mark.slow
def test_td_after_the_contact_is_refused_by_every_command(
    rolled: Rolled, tmp_path: Path
) -> None:
    file, td = rolled.file("glstat"), rolled.end + 0.02
    judged = run_json("verify", "--tr", "0.2", "--td", str(td), file)
    assert (judged["verified"], judged["td_ok"]) == (False, False)
    rows = run_json("study", "--td", str(td), file)["runs"]
    assert [row["status"] for row in rows] == ["none"]
    assert "after the end of the flight" in rows[0]["message"]
    deck = put(
        tmp_path / "deck.k",
        run("card", "--tr", "0.2", "--td", str(td), "--part", "1").stdout,
    )
    check_report = run_json("check", str(deck), "--history", file)
    assert "D2R204" in {finding["rule"] for finding in check_report["findings"]}


@pytest.mark.slow
def test_the_contact_energy_tells_the_flight_where_no_momentum_is_written(
    rolled: Rolled,
) -> None:
    whole = read_history_of_parts(rolled.file("glstat"))
    written = {
        name: getattr(whole.balance, name) for name in ("sliding", "external_work")
    }
    history = make_table(
        whole.time, whole.energy, balance=Balance(whole.time, **written)
    )
    flight = examine_td(history, rolled.end - 0.01, Settings()).flight
    assert flight.source == "contact-energy"
    assert (flight.start, flight.end) == pytest.approx(
        (rolled.start, rolled.end), abs=MILLISECOND
    )
    assert find_seen_flight(history, rolled.end + 0.02).refusal


def test_the_energy_balance_tells_the_flight_where_there_is_neither(
    rolled: Rolled,
) -> None:
    whole = read_history_of_parts(rolled.file("glstat"))
    time, energy = whole.time[::2], whole.energy[::2]
    written = {
        name: getattr(whole.balance, name)[::2]
        for name in ("internal", "kinetic", "external_work")
    }
    history = make_table(
        time,
        energy,
        balance=Balance(time, **written, precision=require(whole.balance).precision),
    )
    flight = examine_td(
        history, (rolled.start + rolled.end) / 2, Settings(replay=False)
    ).flight
    assert flight.source == "energy-balance"
    # Damping bends the parabola of the work of gravity: the flight found is shorter, never longer.
    start, end = require(flight.start), require(flight.end)
    assert rolled.start - 4 * MILLISECOND <= start < end <= rolled.end + 4 * MILLISECOND
    assert find_seen_flight(history, rolled.end + 0.02).refusal


def test_on_the_energy_alone_nothing_is_certain_and_no_tr_lies_in_the_load(
    rolled: Rolled,
) -> None:
    whole = read_history_of_parts(rolled.file("csv"))
    history = make_table(whole.time, whole.energy)
    td = rolled.end - 0.01
    suggestion = suggest_in_history(history, td, Settings(replay=False))
    if suggestion.recommended:
        assert suggestion.recommended.tr >= rolled.start
        assert not suggestion.situation.flight.certain
    assert (
        suggest_in_history(history, td, Settings(replay=False, strict=True)).recommended
        is None
    )


@cache
def read_history_of_parts(source: str, *parts: str) -> History:
    return open_run([source]).history(Selection(parts=parts))


@pytest.mark.parametrize(
    ("source", "parts", "flights"),
    [
        (BOX, ("box",), [(0.0908, 0.3819)]),
        (CAR, (), [(0.0118, 0.0281), (0.0385, 0.1504)]),
        (
            DROP,
            (),
            [(0.0, 0.2858), (0.3394, 0.4196), (0.4204, 0.4800), (0.5020, 0.5966)],
        ),
    ],
)
def test_all_flights_of_runs_of_a_solver_are_found(
    source: str, parts: tuple[str, ...], flights: list[tuple[float, float]]
) -> None:
    flight_times = [
        (f.start, f.end)
        for f in find_flights(read_history_of_parts(source, *parts), Settings())
        if f.start is not None
    ]
    for start, end in flights:
        assert [
            flight
            for flight in flight_times
            if abs(flight[0] - start) <= 5e-4
            and abs((flight[1] or np.inf) - end) <= 5e-4
        ]


def test_the_last_weak_pushes_of_a_load_belong_to_it() -> None:
    history = read_history_of_parts(CAR)
    assert (
        0.0385
        <= require(examine_td(history, 0.146, Settings(replay=False)).flight.start)
        <= 0.0390
    )


@pytest.mark.slow
def test_in_a_free_fall_there_is_nothing_to_match() -> None:
    history = read_history_of_parts(DROP)
    suggestion = suggest_in_history(history, 0.2838, Settings())
    assert (require(suggestion.recommended).tr, suggestion.candidates[0].kind) == (
        0.0,
        "start",
    )
    assert "at-rest" in {caution.code for caution in suggestion.cautions}
    assert require(suggestion.windows)[0][:2] == pytest.approx((0.0, 0.2838), abs=1e-4)
    assert all(verify_at(suggestion.situation, tr).verified for tr in (0.0, 0.1, 0.28))
    alone = suggest_in_history(
        make_table(history.time, history.energy), 0.2838, Settings()
    )
    assert require(alone.recommended).tr == 0.0


@pytest.mark.parametrize(
    ("source", "energy", "start", "end"),
    [
        (ROLLOVER, "boxIE_J", 0.0908, 0.3819),
        (locate_stored("load_L1_ref.csv.gz"), "IE_J", 0.0200, 0.1),
        (locate_stored("load_L3_ref.csv.gz"), "IE_J", 0.0235, 0.1),
    ],
)
@pytest.mark.parametrize("share", [0.5, 0.7, 0.9, 0.97])
def test_the_energy_alone_takes_the_end_of_the_load_late_enough(
    source: str, energy: str, start: float, end: float, share: float
) -> None:
    time, values = read_columns(source, energy)
    quiet = find_quiet_time(make_table(time, values), start + share * (end - start))
    assert quiet is None or quiet.start >= start


@pytest.mark.parametrize("part", ["bottom", "walls", "lid", "springs"])
@pytest.mark.parametrize("share", [0.3, 0.5, 0.7, 0.85, 0.95, 0.98])
def test_the_energy_alone_of_a_tumbling_box_never_begins_before_an_impact(
    part: str, share: float
) -> None:
    whole = read_history_of_parts(DROP, part)
    history = make_table(whole.time, whole.energy)
    for start, end in ((0.3394, 0.4196), (0.4204, 0.4800), (0.5020, 0.5966)):
        quiet = find_quiet_time(history, start + share * (end - start))
        assert quiet is None or quiet.start >= start


def test_a_contact_between_two_flights_on_one_level_ends_the_first() -> None:
    time = np.linspace(0, 1, 2001)
    load = 400 * np.exp(-(((time - 0.2) / 0.05) ** 2))
    contact = 80 * np.exp(
        -(((time - 0.8) / 0.01) ** 2)
    )  # short, in the last quarter before td
    energy = 190 + 5 * np.sin(250 * time) + load + contact
    quiet = require(
        find_quiet_time(make_table(time, np.where(time < 0.1, 0, energy)), 0.95)
    )
    assert quiet.start > 0.81


def test_what_stays_of_a_contact_energy_is_no_flight_where_a_load_of_another_kind_works() -> (
    None
):
    time = np.linspace(0, 1, 501)
    touched = np.where(time < 0.2, 5 * time, 1.0)
    for work, flies in (
        (np.zeros_like(time), True),
        (40 * np.maximum(0, time - 0.5), False),
    ):
        balance = Balance(
            time, sliding=touched, external_work=work, kinetic=np.full_like(time, 10.0)
        )
        history = make_table(time, 1 + 0.3 * np.sin(200 * time), balance=balance)
        assert examine_td(history, 0.9, Settings(replay=False)).in_flight is flies


def test_where_the_momentum_of_parts_is_exact_contacts_of_others_and_among_them_do_not_count() -> (
    None
):
    own_history = read_history_of_parts(BOX, "box")
    assert own_history.balance
    longer = np.minimum(own_history.time, 0.15) + np.maximum(
        own_history.time - 0.3819, 0.0
    )
    balance = Balance(
        own_history.time,
        sliding=longer,
        external_work=own_history.balance.external_work,
    )
    (of_parts, _) = own_history.momenta
    flown = of_parts.of((0, 1))[:, np.newaxis]
    whole = Momenta(
        of_parts.time,
        flown,
        None,
        of_parts.precision,
        (0,),
        masses=np.array([of_parts.mass((0, 1))]),
    )
    for momenta, start in ((of_parts, 0.0908), (whole, 0.15)):
        evidence = Given((momenta,), balance)
        history = History(
            own_history.time,
            own_history.energy,
            ("run",),
            "made",
            "E",
            parts=own_history.parts,
            evidence=evidence,
        )
        flight = examine_td(history, 0.37, Settings(replay=False)).flight
        assert flight.start == pytest.approx(start, abs=MILLISECOND)
        assert bool(flight.doubts) is (momenta is whole)
    (doubt,) = flight.doubts
    assert "by the momentum" in doubt
    assert "by the contact energy" in doubt


def test_the_energy_alone_is_said_to_be_uncertain_and_strict_refuses_it() -> None:
    assert "(energy alone, not certain)" in run("suggest", *ALONE).stdout
    suggestion = run_json("suggest", *ALONE)
    assert (suggestion["flight"]["source"], suggestion["flight"]["certain"]) == (
        "energy",
        False,
    )
    pair = ("verify", "--tr", str(suggestion["recommended"]["tr"]), *ALONE)
    judged = run(*pair).stdout
    assert judged.startswith("use with care")
    assert (
        "it is unknown whether the parts are deformed in the same direction at tr and td"
        in join_wrapped_lines(judged)
    )
    assert [
        run(*arguments, "--strict").exit_code
        for arguments in (("suggest", *ALONE), pair)
    ] == [1, 1]
    (message,) = (
        w["message"]
        for w in suggestion["warnings"]
        if w["code"] == "flight-from-energy"
    )
    td = suggestion["recommended"]["td"]
    assert re.search(
        rf"d2rpick waits for another [\d.]+, a third of the time until td = {td:.6g}",
        message,
    )


def test_windows_of_acceptable_tr_hold_the_recommended_one_and_verify_throughout() -> (
    None
):
    suggestion = run_json_checked("suggest", *ALONE)
    windows = suggestion["acceptable_windows"]
    (recommended_window,) = (window for window in windows if window["recommended"])
    assert (
        recommended_window["start"]
        <= suggestion["recommended"]["tr"]
        <= recommended_window["end"]
    )
    assert all(
        suggestion["flight"]["start"] <= w["start"] < w["end"] <= 0.37 for w in windows
    )
    assert sum(w["share"] for w in windows) <= 1
    for window in windows[:3]:
        for tr in (
            window["start"],
            (window["start"] + window["end"]) / 2,
            window["end"],
        ):
            assert run_json("verify", "--tr", repr(tr), *ALONE)["verified"]
    assert (
        f"{recommended_window['start']:.6g} to {recommended_window['end']:.6g}"
        in run("suggest", *ALONE).stdout
    )
    assert run_json("suggest", "--td", "0.064", ENERGY)["acceptable_windows"] is None


@pytest.mark.slow
@pytest.mark.parametrize("form", ["glstat", "matsum"])
def test_a_flight_is_the_same_from_any_td_in_it_and_what_was_seen_before_changes_nothing(
    rolled: Rolled, form: str
) -> None:
    def fresh() -> History:
        return open_run([rolled.file(form)]).history(
            Selection(parts=("box",) if form == "matsum" else ())
        )

    history, length = fresh(), rolled.end - rolled.start
    times = [rolled.start + share * length for share in (0.9, 0.02, 0.5, 0.98, 0.3)]
    evidences = [find_seen_flight(history, td) for td in times]
    assert evidences == [find_seen_flight(fresh(), td) for td in times]
    assert len({evidence.flight and evidence.flight[:2] for evidence in evidences}) == 1
    contact_time = rolled.end + 0.02
    assert find_seen_flight(history, contact_time) == find_seen_flight(
        fresh(), contact_time
    )
    assert find_seen_flight(history, contact_time).refusal
