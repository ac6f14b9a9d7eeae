"""Health of a run: each threshold from both sides, each missing term, real runs, and runs that cannot be judged."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from d2rpick.choice.health import Health, assess_health, list_flaws, warn_about_health
from d2rpick.histories.balance import read_balance
from d2rpick.histories.history import Balance, Given, History, Precision, Samples
from d2rpick.histories.names import Part
from d2rpick.histories.opening import open_run
from d2rpick.report.situation import list_health_measures
from tests.command import BOX, ENERGY, GLSTAT, list_warning_codes, put, run, run_json
from tests.computed import locate_stored
from tests.energies import make_energy_history, require
from tests.made_t01 import make_t01, make_value

TIME: Samples = np.linspace(0.0, 1.0, 201)
ONES = np.ones_like(TIME)
# A body that is thrown up and vibrates: internal energy 2 J, and a parabola as the work of gravity.
INTERNAL = 2.0 + np.sin(60 * TIME)
WORK = -100.0 * TIME * (1.0 - TIME)
KINETIC = 50 + WORK - np.sin(60 * TIME)
HEALTHY = Balance(
    TIME, internal=INTERNAL, kinetic=KINETIC, hourglass=0.0 * ONES, sliding=0.0 * ONES,
    external_work=WORK, eroded=0.0 * ONES,
)  # fmt: skip
PRINTED = np.round(2e6 + 3 * WORK, -1)
PART = Part(7, "floor")
WINDOW = (0.2, 0.8)

LOADED = np.linspace(0, 0.1, 201)
# A body that is shaken and falls apart between two states at 0.03.
TORN = LOADED > 0.03
TORN_INTERNAL = np.where(TORN, 8e3, 3 * LOADED)
TORN_KINETIC = np.where(TORN, 1.5e13, 0.2 * np.sqrt(LOADED))
LATE = LOADED > 0.05
COMMANDS = (
    ("suggest",), ("suggest", "--td", "0.02"), ("suggest", "--td-window", "0.01", "0.02"), ("plan",), ("explore",),
    ("study", "--td", "0.02"),
)  # fmt: skip


def list_warnings(
    balance: Balance, window: tuple[float, float] | None = WINDOW
) -> list[str]:
    return [
        caution.code for caution in warn_about_health(assess_health(balance, window))
    ]


def test_a_healthy_run_gets_no_warning_and_keeps_all_limits() -> None:
    health = assess_health(HEALTHY, WINDOW)
    assert not list(warn_about_health(health))
    assert health.window_work == pytest.approx(0.0, abs=1e-3)
    assert all(
        measure.good for measure in list_health_measures(health) if measure.value
    )


@pytest.mark.parametrize(
    ("code", "terms", "more_terms"),
    [
        ("hourglass", {"hourglass": 0.29 * TIME}, {"hourglass": 0.31 * TIME}),
        ("part-hourglass", {"hourglass_of_parts": ((PART, 0.09, 1.0),)}, {"hourglass_of_parts": ((PART, 0.11, 1.0),)}),
        ("energy-ratio", {"kinetic": KINETIC + 4 * TIME}, {"kinetic": KINETIC + 6 * TIME}),
        ("energy-ratio", {"ratio": ONES - 0.09 * TIME}, {"ratio": ONES - 0.11 * TIME}),
        ("sliding", {"sliding": 0.29 * (TIME < 0.1)}, {"sliding": 0.31 * (TIME < 0.1)}),
        ("negative-sliding", {"sliding": -0.14 * (TIME < 0.1)}, {"sliding": -0.16 * (TIME < 0.1)}),
        ("contact-in-window", {"sliding": 0.1 * (TIME > 0.9)}, {"sliding": 0.1 * (TIME > 0.5)}),
        ("work-in-window", {"external_work": WORK + 0.1 * TIME}, {"external_work": WORK + 0.5 * (TIME > 0.5)}),
        ("erosion", {"eroded": 0.01 * (TIME > 0.1)}, {"eroded": 0.01 * (TIME > 0.5)}),
        ("eroded-energy", {"eroded": 0.1 * (TIME > 0.1)}, {"eroded": 0.2 * (TIME > 0.1)}),
        # Friction recorded separately is not penetration, and rounding of printed digits is not work.
        ("sliding", {"sliding": 1.0 * (TIME < 0.1), "friction": 0.9 * (TIME < 0.1)}, {"sliding": 1.0 * (TIME < 0.1)}),
        ("work-in-window", {"external_work": PRINTED, "precision": Precision(digits=6)}, {"external_work": PRINTED}),
    ],
)  # fmt: skip
def test_a_warning_comes_beyond_its_threshold_only(
    code: str, terms: dict[str, Any], more_terms: dict[str, Any]
) -> None:
    assert code not in list_warnings(replace(HEALTHY, **terms))
    assert code in list_warnings(replace(HEALTHY, **more_terms))


@pytest.mark.parametrize(
    ("term", "measures"),
    [
        (
            "internal",
            ["hourglass_share", "energy_ratio_min", "sliding_share", "eroded_share"],
        ),
        ("hourglass", ["hourglass_share"]),
        ("sliding", ["sliding_share", "negative_sliding_share", "window_sliding"]),
        ("external_work", ["energy_ratio_min", "energy_ratio_max", "window_work"]),
        ("eroded", ["eroded_share", "window_eroded"]),
    ],
)
def test_what_the_files_do_not_have_is_unknown_and_not_zero(
    term: str, measures: list[str]
) -> None:
    health = assess_health(replace(HEALTHY, **{term: None}), WINDOW)  # type: ignore[arg-type]
    assert [getattr(health, name) for name in measures] == [None] * len(measures)
    assert [getattr(assess_health(HEALTHY, WINDOW), name) for name in measures].count(
        None
    ) == 0


def test_a_window_of_too_few_states_is_not_judged() -> None:
    few_states, enough = (0.2, 0.2 + 4.5 / 200), (0.2, 0.2 + 5.5 / 200)
    reason = (
        "the window holds 5 states: at least 6 are needed to tell a load from gravity"
    )
    assert assess_health(HEALTHY, few_states).window_reason == reason
    assert [
        caution.message
        for caution in warn_about_health(assess_health(HEALTHY, few_states))
    ] == [reason]
    assert list_warnings(HEALTHY, few_states) == ["window-not-judged"]
    assert "window-not-judged" not in list_warnings(HEALTHY, enough)
    assert "window-not-judged" not in list_warnings(
        replace(HEALTHY, external_work=None), few_states
    )


def test_a_term_with_a_state_that_is_no_number_is_unknown(tmp_path: Path) -> None:
    written, nan = (
        np.array(make_value(3, 0, 12), ">f4").tobytes(),
        np.array(np.nan, ">f4").tobytes(),
    )
    for name, content in (
        ("whole", bytes(make_t01(8).data)),
        ("damaged", bytes(make_t01(8).data).replace(written, nan)),
    ):
        run_of = open_run([str(put(tmp_path / f"{name}T01", content))])
        balance = require(read_balance(run_of.databases, run_of.parts))
        assert (balance.hourglass is None, balance.kinetic is None) == (
            name == "damaged",
            False,
        )


def test_nothing_known_is_nothing_said() -> None:
    assert assess_health(Balance(TIME)) == Health()


@pytest.mark.parametrize("internal", [2e-20 * ONES, 1e-5 * INTERNAL])
def test_shares_of_a_tiny_internal_energy_are_left_out_with_the_reason(
    internal: Samples,
) -> None:
    health = assess_health(replace(HEALTHY, internal=internal, hourglass=ONES), WINDOW)
    assert health.hourglass_share is None
    assert health.sliding_share is None
    assert health.reason
    assert not [
        code
        for code in list_warnings(replace(HEALTHY, internal=internal, hourglass=ONES))
        if code != "energy-ratio"
    ]


def test_a_part_without_energy_of_its_own_is_not_the_worst_part() -> None:
    parts = ((PART, 0.05, 1.0), (Part(8, "trim"), 0.005, 0.008))
    assert assess_health(replace(HEALTHY, hourglass_of_parts=parts)).part == PART


def test_a_ratio_is_not_judged_where_the_run_has_hardly_any_energy_yet() -> None:
    total = 10 * TIME + 1e-3
    ratio = np.where(TIME < 0.05, 30.0, 1.0)
    assert "energy-ratio" not in list_warnings(
        replace(HEALTHY, total=total, ratio=ratio)
    )


def test_the_ratio_counts_what_damping_and_walls_have_taken_and_the_total_that_is_written() -> (
    None
):
    taken = 10 * TIME
    damped = replace(
        HEALTHY, kinetic=require(HEALTHY.kinetic) - taken, total=None, ratio=None
    )
    assert "energy-ratio" in list_warnings(damped)
    whole = assess_health(HEALTHY, WINDOW)
    for term in ("damping", "wall"):
        health = assess_health(replace(damped, **{term: taken}), WINDOW)  # type: ignore[arg-type]
        assert health.energy_ratio_min == pytest.approx(whole.energy_ratio_min)
    total = 50 + require(HEALTHY.external_work)
    written = assess_health(replace(damped, total=total), WINDOW)
    assert (written.energy_ratio_min, written.energy_ratio_max) == pytest.approx(
        (1.0, 1.0)
    )


def test_the_total_energy_of_abaqus_is_without_the_external_work(
    tmp_path: Path,
) -> None:
    rows = [f"{time},{5 + time},{3 + 2 * time},{3 * time},8" for time in range(5)]
    path = put(
        tmp_path / "abaqus.csv",
        "\n".join(["time,ALLIE,ALLKE,ALLWK,ETOTAL", *rows]).encode(),
    )
    run_of = open_run([str(path)])
    health = assess_health(require(read_balance(run_of.databases, None)))
    assert (health.energy_ratio_min, health.energy_ratio_max) == (1.0, 1.0)


def test_damping_that_counts_as_external_work_is_no_load() -> None:
    fall = 4 * np.exp(-3 * TIME) - 2  # solution of v' = g - 3 v with g = -6
    velocity = np.stack([np.exp(-3 * TIME), 0 * TIME, fall], axis=1)
    kinetic = 5 / 2 * np.sum(velocity**2, axis=1) + 50 * np.exp(-3 * TIME) * (
        1.2 + np.cos(60 * TIME)
    )
    gravity, damping = (
        np.append(0, np.cumsum((rate[1:] + rate[:-1]) / 2 * np.diff(TIME)))
        for rate in (-6 * 5 * fall, -6 * kinetic)
    )
    damped = replace(
        HEALTHY, kinetic=kinetic, external_work=gravity + damping, velocity=velocity
    )
    assert "work-in-window" not in list_warnings(damped)
    assert "work-in-window" in list_warnings(replace(damped, kinetic=None))


def test_up_to_td_the_rollover_is_healthy_and_beyond_it_touches_the_ground() -> None:
    run_of = open_run([BOX])
    box = [part for part in run_of.parts if part.title == "box"]
    flight = (0.0886, 0.37)
    up_to_td = assess_health(
        read_balance(run_of.databases, box, until=0.37) or Balance(TIME),
        flight,
        locked=1.75,
    )
    assert not list(warn_about_health(up_to_td))
    assert up_to_td.energy_ratio_min == pytest.approx(1.0, abs=1e-3)
    for window, code in (
        ((0.06, 0.37), "work-in-window"),
        ((0.0886, 0.4), "contact-in-window"),
    ):
        whole = assess_health(
            read_balance(run_of.databases, box) or Balance(TIME), window, locked=1.75
        )
        assert code in {caution.code for caution in warn_about_health(whole)}


@pytest.mark.parametrize(
    "name", ["oscillator_referenceT01.gz", "chain_referenceT01.gz"]
)
def test_the_damping_of_computed_runs_is_no_load(name: str) -> None:
    run_of = open_run([locate_stored(name)])
    health = assess_health(
        read_balance(run_of.databases, run_of.parts) or Balance(TIME), (0.013, 0.064)
    )
    assert require(health.window_work) < 1e-3
    assert not list(warn_about_health(health))


def test_suggest_and_info_tell_the_health() -> None:
    suggestion = run_json(
        "suggest", "--no-verify", "--td", "0.37", "--part", "box", BOX
    )
    assert suggestion["health"]["part"] == {"id": 1, "title": "box"}
    assert suggestion["health"]["window"] == [suggestion["recommended"]["tr"], 0.37]
    assert not list_warning_codes(suggestion) & {
        "hourglass",
        "energy-ratio",
        "sliding",
        "work-in-window",
    }
    about = run_json("info", BOX)
    assert about["health"]["sliding_share"] == pytest.approx(0.0523, abs=1e-3)
    assert "hourglass energy of box" in run("info", BOX).stdout


def test_verify_judges_the_window_between_its_times() -> None:
    flying = (
        "verify",
        "--no-verify",
        "--td",
        "0.37",
        "--part",
        "box",
        "--after",
        "0.05",
        BOX,
    )
    document = run_json(*flying, "--tr", "0.1")
    assert document["health"]["window"] == [0.1, 0.37]
    assert not list_warning_codes(document) & {"contact-in-window", "work-in-window"}
    assert {"contact-in-window", "work-in-window"} <= list_warning_codes(
        run_json(*flying, "--tr", "0.06")
    )


def test_a_window_that_reaches_into_the_next_contact_is_warned_of() -> None:
    suggestion = run_json(
        "suggest", "--no-verify", "--td", "0.39", "--part", "box", "--after", "0.1", BOX
    )
    assert "contact-in-window" in list_warning_codes(suggestion)


@pytest.mark.slow
@pytest.mark.parametrize("swing", [0.0, 3.0])
def test_hourglass_is_an_alarm_only_where_a_level_is_matched(
    swing: float, tmp_path: Path
) -> None:
    time = np.linspace(0, 1, 401)
    internal = np.where(
        time < 0.2, 250 * time, 50 + swing * np.sin(90 * time) * np.sin(61 * time)
    )
    columns = np.stack([time, internal, 200 - 0 * time, 0.2 * internal], axis=1)
    file = tmp_path / "glass.csv"
    np.savetxt(
        file,
        columns,
        "%.9g",
        ",",
        header="time,internal_energy,kinetic_energy,hourglass_energy",
        comments="",
    )
    for args in (("suggest",), ("verify", "--tr", "0.41")):
        document = run_json(*args, "--td", "0.9", "--after", "0.3", str(file))
        assert ("at-rest" in list_warning_codes(document)) == (swing == 0)
        assert ("hourglass" in list_warning_codes(document)) == (swing > 0)
        assert document["health"]["hourglass_share"] == pytest.approx(0.2, abs=1e-3)


def test_of_files_with_nothing_to_judge_nothing_is_said() -> None:
    assert run_json("suggest", "--td", "0.064", ENERGY)["health"] is None
    assert run_json("info", ENERGY)["health"] is None


def test_terms_that_leave_everything_open_leave_it_unknown() -> None:
    suggestion = run_json("suggest", "--td", "0.064", GLSTAT)
    assert {
        value
        for key, value in suggestion["health"].items()
        if key not in ("window", "until")
    } == {None}
    assert suggestion["health"]["until"] == 0.064


def record(internal: Samples, kinetic: Samples, **terms: Any) -> History:
    balance = Balance(LOADED, internal=internal, kinetic=kinetic, **terms)
    return History(
        LOADED, internal, ("made",), "made", "E", evidence=Given(balance=balance)
    )


def list_objections(history: History) -> list[str]:
    return [objection.code for objection in list_flaws(history)]


@pytest.mark.parametrize("terms", [{}, {"external_work": 4 * LOADED}])
def test_a_run_that_gains_energy_from_nothing_blew_up(
    terms: dict[str, Samples],
) -> None:
    (objection_row,) = list_flaws(record(TORN_INTERNAL, TORN_KINETIC, **terms))
    assert objection_row.code == "blew-up"
    assert "from 0.1" in objection_row.message
    assert "grows from 0.107 to 1.5e+13 at 0.0305" in objection_row.message


@pytest.mark.parametrize(
    ("internal", "kinetic", "terms"),
    [
        # A load on a body at rest (except round-off), and a body that hits a wall after free fall.
        (np.where(LATE, 40.0, 1e-13), np.where(LATE, 1e3, 1e-12), {}),
        (np.where(LATE, 200.0, 1e-18), np.where(LATE, 20.0, 220.0), {}),
        # A velocity given to the whole body, at rest or in the noise of a contact, does not deform the body.
        (np.where(LATE, 2e-9, 1e-9), np.where(LATE, 1e5, 1e-9), {}),
        (0 * LOADED, np.where(LATE, 1e5, 1.9e-9), {}),
        (np.where(LATE, 1e-5, 0.0), np.where(LATE, 1e5, 1.9e-9), {}),
        # Energy explained by external work, and an energy gain that a load can cause.
        (
            TORN_INTERNAL,
            TORN_KINETIC,
            {"external_work": np.where(TORN, 1.5e13, LOADED)},
        ),
        (np.where(TORN, 8e3, 3 * LOADED), np.where(TORN, 1e7, 0.2 * LOADED), {}),
        # only the first states
        (
            np.where(LOADED > 0.004, 8e3, 3 * LOADED),
            np.where(LOADED > 0.004, 1.5e13, LOADED),
            {},
        ),
    ],
)
def test_a_run_with_a_sudden_load_is_sound(
    internal: Samples, kinetic: Samples, terms: dict[str, Samples]
) -> None:
    assert "blew-up" not in list_objections(record(internal, kinetic, **terms))


def test_energies_of_nothing_are_nothing_to_judge() -> None:
    assert list_objections(record(0 * LOADED, 0 * LOADED + 1.9e-9)) == [
        "nothing-to-judge"
    ]
    assert list_objections(record(1e-32 * LOADED, 1e-31 * LOADED)) == [
        "nothing-to-judge"
    ]
    assert (
        list_objections(record(1e-18 + 0 * LOADED, 225.0 * LOADED)) == []
    )  # free fall does not yet deform anything
    assert (
        list_objections(make_energy_history(0 * LOADED, LOADED)) == []
    )  # a single column is judged by its energy alone


@pytest.fixture
def csv(tmp_path: Path) -> Any:
    def write(internal: Samples, kinetic: Samples) -> str:
        file, table = (
            tmp_path / "run.csv",
            np.stack([LOADED, internal, kinetic], axis=1),
        )
        np.savetxt(
            file,
            table,
            "%.7g",
            ",",
            header="time,internal_energy,kinetic_energy",
            comments="",
        )
        return str(file)

    return write


@pytest.mark.parametrize(
    "args", [*COMMANDS, ("verify", "--tr", "0.01", "--td", "0.02")]
)
def test_a_run_that_blew_up_is_refused_by_all(csv: Any, args: tuple[str, ...]) -> None:
    result = run(*args, csv(TORN_INTERNAL, TORN_KINETIC))
    assert (result.exit_code, result.stderr.count("\n")) == (2, 1)
    assert "run.csv: the run is unstable: its energy grows from 0.1" in result.stderr


@pytest.mark.parametrize("args", COMMANDS)
def test_where_nothing_deforms_nothing_is_chosen(
    csv: Any, args: tuple[str, ...]
) -> None:
    result = run(*args, csv(0 * LOADED, 0 * LOADED + 1.9e-9))
    assert result.exit_code == 2
    assert (
        "run.csv: nothing to judge: no internal energy exceeds 0, so nothing deforms; give a longer run"
        in result.stderr
    )


@pytest.mark.parametrize(
    ("columns", "code"),
    [
        ((TORN_INTERNAL, TORN_KINETIC), "blew-up"),
        ((0 * LOADED, LOADED), "nothing-to-judge"),
    ],
)
def test_info_tells_it_and_lists_no_flight(
    csv: Any, columns: tuple[Samples, Samples], code: str
) -> None:
    run_info = run_json("info", csv(*columns))
    assert code in list_warning_codes(run_info)
    assert run_info["flights"] == []
