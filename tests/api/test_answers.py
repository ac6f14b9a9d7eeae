"""The library gives the same answers as the command line, loses nothing in tables, and reports wrong arguments."""

import io
import json
import pickle
import shutil
from collections.abc import Callable, Collection, Mapping, Sequence
from copy import deepcopy
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import numpy as np
import pandas as pd
import pytest
from hypothesis import HealthCheck, given, settings, strategies as st

import d2rpick as d2
from d2rpick.api.answer import write_page
from d2rpick.report.keys import MEASURES
from d2rpick.report.plan import give_plan_sentence as plan_sentence
from tests.command import (
    BOX,
    DECK,
    ENERGY,
    GLSTAT,
    MATSUM,
    ROLLOVER,
    ROOT,
    put,
    run,
    run as run_command,
    run_json,
)
from tests.drops import drop, write_run_files
from tests.energies import require
from tests.sample_deck import DECK as SAMPLE_DECK

TD = "0.0687534"
loose: Any = d2  # for what a type checker would not let pass


def assert_same_document(mine: Mapping[str, Any], theirs: Mapping[str, Any]) -> None:
    """Compare two documents, except for the command that is stored in them."""
    assert {**mine, "command": None} == {**theirs, "command": None}


def assert_frame_holds(
    frame: pd.DataFrame, rows: Sequence[Mapping[str, Any]], *, but: Collection[str] = ()
) -> None:
    """Check that a frame contains every value of a document's rows bit for bit, with NaN for null."""
    assert len(frame) == len(rows) > 0
    for shown_row, expected in zip(frame.to_dict("records"), rows, strict=True):
        for key in expected.keys() - {*but}:
            assert (
                pd.isna(shown_row[key])
                if expected[key] is None
                else shown_row[key] == expected[key]
            ), key


@st.composite
def records(draw: st.DrawFn) -> tuple[np.ndarray, np.ndarray]:
    """Draw the energy of a damped oscillator after a load, with or without noise; not every record can be described."""
    states, periods = draw(st.integers(30, 200)), draw(st.floats(0.5, 12))
    noise, damping = draw(st.sampled_from([0.0, 0.0, 0.01, 0.5])), draw(st.floats(0, 3))
    time = np.linspace(0, 1, states)
    energy = (
        np.exp(-damping * time)
        * np.sin(np.pi * periods * time + draw(st.floats(0, 3))) ** 2
    )
    return time, energy + noise * np.random.default_rng(
        draw(st.integers(0, 99))
    ).uniform(size=states)


@pytest.mark.slow
@settings(
    max_examples=5,
    deadline=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)
@given(record=records(), td=st.floats(0.3, 1.0), tr=st.floats(0.0, 0.29))
def test_the_library_and_the_command_line_say_the_same(
    record: tuple[np.ndarray, np.ndarray], td: float, tr: float, tmp_path: Path
) -> None:
    file = tmp_path / "run.csv"
    pd.DataFrame({"time": record[0], "internal_energy": record[1]}).to_csv(
        file, index=False
    )
    run = d2.read(file)
    suggestion, verdict = d2.suggest(run, td), d2.verify(run, tr, td, margin=0.01)
    assert_same_document(
        suggestion.to_dict(), run_json("suggest", "--td", repr(td), str(file))
    )
    if suggestion.candidates:
        assert_frame_holds(suggestion.to_frame(), suggestion.to_dict()["candidates"])
    assert suggestion.to_frame().attrs["basis"] == suggestion.basis
    measures = {"energy_td", "kinetic_share", *MEASURES, "verified", "tr_ok", "td_ok"}
    assert_frame_holds(
        verdict.to_frame(),
        [{key: value for key, value in verdict.to_dict().items() if key in measures}],
    )
    assert_same_document(
        verdict.to_dict(),
        run_json(
            "verify", "--tr", repr(tr), "--td", repr(td), "--margin", "0.01", str(file)
        ),
    )


@pytest.mark.parametrize(
    ("arguments", "options"),
    [
        ({"parts": "box"}, ("--part", "box")),
        (
            {"parts": [1, "2"], "flying": (1, 2)},
            ("--part", "1", "--part", "2", "--flying", "1", "--flying", "2"),
        ),
        (
            {"parts": 1, "after": 0.1, "tolerance": 0.1},
            ("--part", "1", "--after", "0.1", "--tolerance", "0.1"),
        ),
        ({"parts": "box", "cost_share": 0.8}, ("--part", "1", "--cost-share", "0.8")),
    ],
)
def test_arguments_mean_what_options_mean(
    arguments: dict[str, Any], options: tuple[str, ...]
) -> None:
    suggestion = d2.suggest(d2.read(BOX), td=0.37, replay=False, **arguments)
    assert_same_document(
        suggestion.to_dict(),
        run_json("suggest", "--td", "0.37", "--no-verify", *options, BOX),
    )


@pytest.mark.slow
@pytest.mark.parametrize(
    ("arguments", "options"),
    [
        ({"parts": "recommended"}, ("--part", "recommended")),
        (
            {"parts": [1, 2], "step_ratio": 2.0},
            ("--part", "1", "--part", "2", "--step-ratio", "2"),
        ),
        (
            {"parts": 1, "weights": "site.toml"},
            ("--part", "1", "--weights", "site.toml"),
        ),
        ({}, ()),  # the cost remains unknown
    ],
)
@pytest.mark.usefixtures("here")
def test_a_deck_means_what_it_means_on_the_command_line(
    arguments: dict[str, Any], options: tuple[str, ...]
) -> None:
    Path("site.toml").write_text("[per_element]\nBT = 1\nQBAT = 2\n", "utf-8")
    run, by_deck = d2.read(BOX), {"deck": SAMPLE_DECK, "replay": False, **arguments}
    cost = ("--no-verify", "--deck", str(SAMPLE_DECK), *options, BOX)
    chosen = d2.suggest(run, td=0.37, **by_deck)
    assert_same_document(chosen.to_dict(), run_json("suggest", "--td", "0.37", *cost))
    assert_same_document(
        d2.verify(run, 0.1, 0.37, **by_deck).to_dict(),
        run_json("verify", "--tr", "0.1", "--td", "0.37", *cost),
    )
    planned = d2.plan(run, **by_deck)
    assert_same_document(planned.to_dict(), run_json("plan", *cost))
    for suggestion in (
        (chosen, planned) if arguments in ({}, {"parts": "recommended"}) else ()
    ):
        assert_same_document(suggestion.to_dict(), run_json(*suggestion.command))
    assert (planned.to_dict()["run_time_share"] is None) == (not arguments)


def test_weights_in_memory_count_as_those_of_a_file() -> None:
    cheap, dear = (
        d2.suggest(
            d2.read(BOX),
            0.37,
            parts=1,
            replay=False,
            deck=SAMPLE_DECK,
            weights=d2.Weights(weights),
        )
        for weights in ({"BT": 1.0, "QBAT": 0.1}, {"BT": 1.0, "QBAT": 10.0})
    )
    shares = [
        part_table.to_frame()["run_time_share"].min() for part_table in (cheap, dear)
    ]
    assert shares[0] < shares[1]  # the other part keeps its cost


@pytest.mark.slow
def test_weights_of_a_site_are_those_of_the_command_line_and_of_the_file_they_are_saved_in(
    tmp_path: Path,
) -> None:
    calibration = d2.calibrate("sample_data/flying_box")
    assert calibration.to_dict() == run_json(*calibration.command) | {
        "command": list(calibration.command)
    }
    assert calibration.to_frame()["weight"].tolist() == [
        *calibration.weights.per_element.values()
    ]
    file = calibration.save(tmp_path / "site.toml")
    assert (
        file.read_text("utf-8")
        == run("calibrate", "-f", "toml", "sample_data/flying_box").stdout
    )
    part_table = d2.parts(d2.read(BOX), deck=SAMPLE_DECK, weights=file).to_dict()[
        "weights"
    ]
    assert part_table["per_element"] == pytest.approx(
        calibration.weights.per_element, rel=1e-5
    )  # the file has six digits
    assert part_table["element_share"] == pytest.approx(
        calibration.weights.element_share, rel=1e-5
    )


def test_a_folder_that_begins_with_a_dash_is_calibrated_by_the_command_too(
    here: Path,
) -> None:
    shutil.copytree(ROOT / "sample_data/flying_box", here / "-box")
    calibration = d2.calibrate("-box")
    name, *words = calibration.command
    repeated = json.loads(run(name, "-f", "json", *words).stdout)
    assert repeated["per_element"] == calibration.to_dict()["per_element"]


def test_the_command_of_an_answer_asks_the_same() -> None:
    oscillator = d2.Oscillator(stiffness=660e3, mass=31.4, frame_mass=15.7, alpha=50)
    suggestion = d2.suggest(
        d2.read(ENERGY), td_window=(0.06, 0.07), oscillator=oscillator, v0=6.0
    )
    assert_same_document(suggestion.to_dict(), run_json(*suggestion.command))
    assert suggestion.to_dict()["command"] == list(suggestion.command)


@pytest.mark.slow
def test_tables_lose_nothing_that_the_json_has(tmp_path: Path) -> None:
    """Lists are not cells: the fractions of a part in each flight and the details of a td have their own tables."""
    run = d2.read(BOX)
    plan, parts = (
        d2.plan(run, parts="box", replay=False, min_quality="poor"),
        d2.parts(run, deck=SAMPLE_DECK, replay=False),
    )
    assert_frame_holds(plan.to_frame(), plan.to_dict()["windows"])
    assert_frame_holds(parts.to_frame(), parts.to_dict()["parts"], but=["flights"])
    assert_frame_holds(parts.sets_frame(), parts.to_dict()["sets"])
    study = d2.study([BOX, tmp_path / "absent"], td=0.37, replay=False)
    assert_frame_holds(study.to_frame(), study.to_dict()["runs"])
    findings = d2.check(DECK, history=d2.read(GLSTAT))
    assert_frame_holds(findings.to_frame(), findings.to_dict()["findings"])
    explored = d2.explore(run, parts="box", steps=4, replay=False)
    lists = ["quality_reasons", "acceptable_windows", "expected"]
    assert_frame_holds(explored.to_frame(), explored.to_dict()["offers"], but=lists)


def test_a_table_of_a_run_holds_its_energies() -> None:
    run = d2.read(BOX)
    whole_model, box = run.to_frame(parts="all"), run.to_frame(parts="box")
    assert [*whole_model] == [part.title for part in run.parts]
    assert whole_model.index.name == "time"
    assert (whole_model.attrs["titles"][1], whole_model.attrs["ids"]["box"]) == (
        "box",
        1,
    )
    pd.testing.assert_series_equal(whole_model["box"], box["box"])
    history = d2.suggest(run, 0.37, parts="box", replay=False).situation.history
    assert history.energy == pytest.approx(box["box"].to_numpy())


def test_a_frame_is_the_file_it_would_be() -> None:
    table = pd.DataFrame(
        np.genfromtxt(ENERGY, delimiter=",", names=True)
    )  # read_csv is exact from pandas 3.1 on
    mine, theirs = (
        d2.suggest(d2.from_frame(table), 0.064),
        d2.suggest(d2.read(ENERGY), 0.064),
    )
    assert mine.to_frame()["tr"].tolist() == theirs.to_frame()["tr"].tolist()
    by_index = table.set_index(table.columns[0])
    assert d2.suggest(d2.from_frame(by_index), 0.064).recommended == theirs.recommended
    with pytest.raises(d2.D2RPickError, match="frame:3: 'internal_energy' is ''"):
        d2.from_frame(
            pd.DataFrame({"time": [0, 1, 2], "internal_energy": [1.0, np.nan, 2.0]})
        ).to_frame()
    with pytest.raises(d2.D2RPickError):
        d2.suggest(
            d2.from_frame(
                pd.DataFrame({"time": [0, 2, 1.0], "internal_energy": [1.0, 2.0, 2.0]})
            ),
            1.0,
        )


@pytest.mark.parametrize(
    "convert_table",
    [
        lambda table: table["internal_energy"],
        lambda table: table["internal_energy"].rename(None),
        lambda table: table.rename_axis("cycle").set_index(
            pd.to_timedelta(table.index, unit="s")
        ),
        lambda table: table.reset_index().assign(
            time=lambda one: pd.to_timedelta(one["time"], unit="s")
        ),
        lambda table: table.reset_index(drop=False).set_index("time", drop=False),
    ],
)
def test_the_time_of_a_frame_is_what_is_named_so_and_timedeltas_are_seconds(
    convert_table: Callable[[Any], Any],
) -> None:
    table = pd.read_csv(ENERGY, index_col="time").head(300)
    frame = d2.from_frame(convert_table(table)).to_frame()
    assert frame.index.to_numpy() == pytest.approx(table.index.to_numpy(), abs=1e-9)
    assert frame["internal_energy"].tolist() == table["internal_energy"].tolist()


def test_an_index_is_the_time_where_its_name_is_given() -> None:
    table = pd.read_csv(ENERGY, index_col="time").head(300).rename_axis("x")
    assert (
        d2.from_frame(table, time="x").to_frame().index.tolist() == table.index.tolist()
    )


@pytest.mark.parametrize("name", [None, "cycle", "internal_energy"])
def test_numbers_of_rows_are_no_time(name: str | None) -> None:
    table = pd.DataFrame(
        {"internal_energy": [0.0, 4.0, 1.0], "box": [0.0, 4.0, 1.0]}
    ).rename_axis(name)
    shown_name = "no name" if name is None else f"the name '{name}'"
    with pytest.raises(
        ValueError,
        match=f"no time: its index has {shown_name}, its columns are 'internal_energy', 'box'",
    ):
        d2.from_frame(table)
    with pytest.raises(ValueError, match="frame has no time 'tau'"):
        d2.from_frame(table, time="tau")


def test_the_recommended_pair_is_no_better_pair() -> None:
    chosen, bad = (
        d2.suggest(d2.read(ENERGY), **arguments)
        for arguments in ({"td_window": (0.06, 0.07)}, {"td": 0.064})
    )
    assert chosen.better_pair is None
    assert require(bad.better_pair).td == pytest.approx(require(chosen.recommended).td)
    assert "no-better-td" not in [warning.code for warning in chosen.warnings]


def test_an_open_file_is_read() -> None:
    with Path(ENERGY).open("rb") as file:
        assert_same_document(
            d2.suggest(d2.read(file), 0.064).to_dict(),
            run_json("suggest", "--td", "0.064", ENERGY),
        )
    with pytest.raises(TypeError, match="opened as text"):
        loose.read(io.StringIO("time,energy\n"))


def test_pictures_and_pages(tmp_path: Path) -> None:
    suggestion = d2.suggest(d2.read(ENERGY), float(TD))
    assert suggestion.plot().axes
    page = suggestion.report(tmp_path / "choice.html").read_text("utf-8")
    assert '"command":["d2rpick suggest --td "' in page  # data of the interactive part
    assert "d2rpick suggest --td 0.0687534" in page
    verdict = d2.verify(
        d2.read(ENERGY), tr=require(suggestion.recommended).tr, td=float(TD)
    )
    assert verdict.plot().axes
    assert '<span class="badge use">use</span>' in verdict.report(
        str(tmp_path / "verdict.html")
    ).read_text("utf-8")


def test_the_command_of_a_study_runs_whatever_was_asked() -> None:
    study_answer = loose.study(
        [ENERGY], td=0.0687534, tolerance=0.1, cost_share=0.8, step_ratio=2.0
    )
    assert_same_document(study_answer.to_dict(), run_json(*study_answer.command))


def test_channels_of_unusual_names_tell_the_flight_as_on_the_command_line(
    tmp_path: Path,
) -> None:
    table = pd.read_csv("sample_data/rollover_box.csv")
    names = {"momentum_x": "a7", "momentum_z": "a8"}
    table.rename(columns=names).to_csv(tmp_path / "run.csv", index=False)
    channels = {"x_momentum": "a7", "z_momentum": "a8"}
    suggestion = d2.suggest(d2.read(tmp_path / "run.csv", channels=channels), td=0.37)
    assert suggestion.flight.source == "momentum"
    assert_same_document(suggestion.to_dict(), run_json(*suggestion.command))
    assert (
        suggestion.to_frame()["tr"].tolist()
        == d2.suggest(d2.from_frame(table), td=0.37).to_frame()["tr"].tolist()
    )


@pytest.mark.slow
def test_the_format_that_was_named_is_in_the_command_that_repeats_it(
    tmp_path: Path,
) -> None:
    file = put(tmp_path / "run.csv", f"*Time{Path(ENERGY).read_text()[4:]}")
    reading: Any = {"time": "*Time", "input_format": "csv"}
    with pytest.raises(d2.D2RPickError, match="this is a deck"):
        d2.read(file, time="*Time")
    run, td = d2.read(file, **reading), float(TD)
    answers: list[Any] = [
        d2.suggest(run, td),
        d2.verify(run, 0.0135867, td),
        d2.explore(run, steps=2),
        d2.plan(run),
    ]
    for library_answer in (
        *answers,
        d2.study([file], td, **reading),
        d2.check(DECK, history=run),
    ):
        assert_same_document(
            library_answer.to_dict(), run_json(*library_answer.command)
        )
    assert "--input-format" not in d2.suggest(d2.read(ENERGY), td).command


@pytest.mark.parametrize("ask", [d2.suggest, d2.explore, d2.plan])
def test_answers_can_be_copied(ask: Callable[..., Any]) -> None:
    library_answer = ask(d2.read(ENERGY))
    assert_same_document(deepcopy(library_answer).to_dict(), library_answer.to_dict())


def test_a_verdict_goes_to_another_process() -> None:
    verdict = d2.verify(d2.read(ENERGY), tr=0.0135867, td=0.0687534)
    assert_same_document(
        pickle.loads(pickle.dumps(verdict)).to_dict(), verdict.to_dict()
    )


def test_numbers_of_numpy_stand_in_the_command_as_numbers() -> None:
    suggestion = d2.suggest(
        d2.read(ENERGY), np.float64(TD), margin=np.float64(0.001), tolerance=1
    )
    assert_same_document(suggestion.to_dict(), run_json(*suggestion.command))


@pytest.mark.parametrize(
    "arguments",
    [{"select": "D2R2", "tolerance": 0.1}, {"ignore": ["D2R203", "D2R1"]}, {}],
)
def test_a_check_names_the_command_that_repeats_it(arguments: dict[str, Any]) -> None:
    check_report = d2.check(
        DECK, history=d2.read(ENERGY, energy="internal_energy"), **arguments
    )
    assert check_report.to_dict() == run_json(*check_report.command) | {
        "command": list(check_report.command)
    }
    kept_rules = [
        rule for rule in ("D2R202", "D2R203") if rule not in arguments.get("ignore", ())
    ]
    assert check_report.to_frame()["rule"].tolist() == kept_rules


def test_a_run_is_shown_by_what_its_files_hold(tmp_path: Path) -> None:
    assert repr(d2.read(ENERGY)) == f"Run({ENERGY!r}: csv, 1501 states, 0 to 0.15)"
    assert (
        repr(d2.read(MATSUM))
        == f"Run({MATSUM!r}: matsum, 421 states, 0 to 0.42, 2 parts)"
    )
    damaged = put(tmp_path / "run.csv", "time,energy\n0,0\nx,1\n2,2\n")
    assert repr(d2.read(damaged)) == f"Run({str(damaged)!r}: csv)"
    assert loose.read(damaged)._repr_html_() is None  # the notebook shows that instead


@pytest.mark.slow
def test_a_notebook_shows_a_sentence_a_small_table_and_the_picture() -> None:
    run, energy = d2.read(MATSUM), d2.read(ENERGY)
    of_box: Any = {"parts": 1, "replay": False}
    chosen, plan, parts = (
        d2.suggest(run, 0.37, **of_box),
        d2.plan(run, **of_box),
        d2.parts(run, replay=False),
    )
    explored, verdict = (
        d2.explore(energy, td_window=(0.06, 0.07), steps=6),
        d2.verify(energy, 0.01, 0.064),
    )
    study = d2.study([ENERGY] * 20 + ["<b>absent.csv"], 0.064)
    answers: list[Any] = [chosen, plan, parts, explored, verdict, study]
    for library_answer in (run, *answers):
        shown_html = library_answer._repr_html_()
        ET.fromstring(
            shown_html.replace("&nbsp;", " ")
        )  # whole, with nothing of a file unescaped
        assert "<svg" in shown_html
        assert 0 < shown_html.count("<tr>") <= 13
        assert len(repr(library_answer)) < 250
        assert "\n" not in repr(library_answer)
    assert repr(plan) == f"Plan({plan_sentence(plan)})"
    assert plan_sentence(plan) in plan._repr_html_()
    assert f"tr = {require(chosen.recommended).tr:.6g}" in repr(chosen)
    assert "... and 9 more" in study._repr_html_()
    assert verdict.reasons[0] in verdict._repr_html_().replace("&gt;", ">")


def test_a_table_that_no_energy_is_known_of_is_shown_without_a_picture(
    tmp_path: Path,
) -> None:
    file = put(tmp_path / "run.csv", "time,a,b\n0,0,1\n1,0,1\n")
    shown_html = loose.read(file)._repr_html_()
    assert "a, b" in shown_html
    assert "<svg" not in shown_html
    assert "<svg" not in d2.parts(loose.read(file))._repr_html_()


@pytest.mark.slow
def test_cards_are_those_of_the_command_line(tmp_path: Path) -> None:
    ids: Any = {"merge": 1, "swset": (11, 12), "step_cap": 1e-6}
    run, at_rest = d2.read(MATSUM), d2.read(write_run_files(drop(), tmp_path))
    poor = (
        d2.suggest(run, 0.37, parts=1, replay=False),
        d2.plan(run, parts=1, replay=False, min_quality="poor"),
    )
    good = (
        d2.suggest(at_rest, 0.27, parts=1, replay=False),
        d2.plan(at_rest, parts=1, replay=False),
    )
    options = (
        "--merge",
        "1",
        "--swset",
        "11",
        "12",
        "--step-cap",
        "1e-6",
        "-f",
        "card",
    )
    for library_answer in (*poor, *good):
        card = library_answer.card(**ids)
        assert str(card) == run_command(*library_answer.command, *options).stdout
        assert require(card).verified is (library_answer in good)
    times = ["--tr", "0.1", "--td", "0.37", "--part", "box"]
    alone = d2.card([(0.1, 0.37)], run=run, parts="box", margin=0.001)
    assert (
        str(alone)
        == run_command("card", *times, "--margin", "0.001", "--history", MATSUM).stdout
    )
    assert alone.verdicts[0].decision.verdict == "do not use"
    assert not alone.verdicts[0].verified
    of_rest = d2.card([(0.01, 0.27)], run=at_rest, parts="box", margin=0.001)
    assert of_rest.verdicts[0].decision.verdict == "use"
    assert of_rest.verdicts[0].verified
    bare = (
        "card",
        "--solver",
        "radioss",
        "--node",
        "7",
        "--end",
        "1",
        "--tr",
        "0.1",
        "--td",
        "0.37",
    )
    assert (
        str(d2.card([(0.1, 0.37)], solver="radioss", node=7, end=1))
        == run_command(*bare).stdout
    )


def test_no_pair_is_no_card() -> None:
    suggestion = d2.suggest(d2.read(MATSUM), 0.41, parts=1, replay=False)
    assert suggestion.recommended is None
    assert suggestion.card() is None


@pytest.mark.parametrize(
    ("options", "error", "text"),
    [
        (
            {"solver": "abaqus"},
            ValueError,
            "solver is 'abaqus', but one of ls-dyna, radioss",
        ),
        ({"solver": 3}, TypeError, "solver is 3, but a text"),
        (
            {"marge": 1},
            TypeError,
            "no argument 'marge'; is 'margin' meant|is 'merge' meant",
        ),
        ({"merge": 0}, ValueError, "merge is 0, but a number of at least 1"),
        ({"swset": 5}, TypeError, "swset is 5, but a pair of numbers"),
        ({"step_cap": "x"}, TypeError, "step_cap is 'x', but a number"),
        ({"step_cap": 0}, ValueError, "step_cap is 0, but a number above 0"),
        ({"node": 5}, ValueError, "`node` is an option of `solver` radioss"),
        ({}, ValueError, "needs `parts`, the parts to switch"),
    ],
)
def test_a_wrong_option_of_a_card_is_named(
    options: dict[str, Any], error: type[Exception], text: str
) -> None:
    with pytest.raises(error, match=text):
        loose.card([(0.1, 0.2)], **options)
    with pytest.raises(TypeError, match=r"windows\[1\] is 3"):
        loose.card([(0.1, 0.2), 3], parts=1)


def test_a_figure_shows_itself() -> None:
    figure: Any = d2.plan(
        d2.read(MATSUM), parts=1, replay=False, min_quality="poor"
    ).plot()
    assert figure._repr_png_().startswith(b"\x89PNG")


@pytest.mark.parametrize(
    ("call", "error", "text"),
    [
        (
            lambda: loose.read(ENERGY, channels={"joy": "z"}),
            ValueError,
            "channels names 'joy', but one of",
        ),
        (
            lambda: loose.read(ENERGY, channels={"kinetic_energy": 1.5}),
            TypeError,
            "kinetic_energy is 1.5",
        ),
        (
            lambda: loose.suggest(d2.read(ENERGY), td=0.06, td_window=(0.06, 0.07)),
            TypeError,
            "`td` and `td_window` exclude",
        ),
        (
            lambda: loose.suggest(d2.read(ENERGY), "0.064"),
            TypeError,
            "td is '0.064', but a number was expected",
        ),
        (
            lambda: loose.suggest(d2.read(ENERGY), "64ms"),
            ValueError,
            "give 0.064 if it is s, 64 if it is ms",
        ),
        (
            lambda: loose.suggest(d2.read(ENERGY), td_window=(2, 1)),
            ValueError,
            "td_window is 2 to 1, which is empty",
        ),
        (
            lambda: loose.suggest(d2.read(ENERGY), 0.06, tolerence=1),
            TypeError,
            "'tolerence'; is 'tolerance' meant",
        ),
        (
            lambda: loose.suggest(d2.read(BOX), 0.06, part=1),
            TypeError,
            "no argument 'part'; is 'parts' meant",
        ),
        (
            lambda: loose.plan(d2.read(BOX), colour=1),
            TypeError,
            "no argument 'colour'; expected one of after, ",
        ),
        (
            lambda: loose.suggest(pd.DataFrame({"t": [1.0]}), 0.06),
            TypeError,
            r"DataFrame; give .* d2rpick.from_frame",
        ),
        (
            lambda: loose.suggest(d2.read(ENERGY), 0.06, margin=-1),
            ValueError,
            "margin is -1, but a number of at least 0",
        ),
        (
            lambda: loose.suggest(d2.read(ENERGY), 0.06, tolerance="a"),
            TypeError,
            "tolerance is 'a'",
        ),
        (
            lambda: loose.suggest(d2.read(ENERGY), np.array([1, 2])),
            TypeError,
            r"td is array\(\[1, 2\]\), but a number",
        ),
        (
            lambda: loose.suggest(d2.read(ENERGY), np.True_),
            TypeError,
            "td is .*True_?, but a number was expected",
        ),
        (
            lambda: loose.suggest(d2.read(ENERGY), 0.06, replay="no"),
            TypeError,
            "replay is 'no', but True or False",
        ),
        (
            lambda: loose.suggest(d2.read(ENERGY), 0.06, strict=1),
            TypeError,
            "strict is 1, but True or False",
        ),
        (
            lambda: loose.suggest(d2.read(ENERGY), 0.06, oscillator=5, v0=1.0),
            TypeError,
            "oscillator is 5, but a d2rpick",
        ),
        (
            lambda: loose.suggest(d2.read(ENERGY), td_window={1, 2}),
            TypeError,
            "td_window is .*, but a pair of times",
        ),
        (
            lambda: loose.suggest(d2.read(ENERGY), td_window=np.eye(2)),
            TypeError,
            "td_window is .*, but a pair of times",
        ),
        (
            lambda: loose.suggest(d2.read(BOX), 0.3, parts={1: "a"}),
            TypeError,
            r"parts is \{1: 'a'\}; a number, a title",
        ),
        (
            lambda: loose.suggest(d2.read(BOX), 0.3, parts=np.array([1.5])),
            TypeError,
            "parts holds",
        ),
        (
            lambda: loose.suggest(d2.read(BOX), 0.3, deck=DECK, weights=3),
            TypeError,
            "weights is 3, but d2rpick.Weights or",
        ),
        (
            lambda: loose.verify(d2.read(ENERGY), switched=ENERGY),
            TypeError,
            "switched is .*; give what d2rpick.read",
        ),
        (
            lambda: loose.plan(d2.read(ENERGY), done=0.1),
            TypeError,
            "done is 0.1; pairs of times were expected",
        ),
        (
            lambda: loose.plan(d2.read(ENERGY), done=[0.1]),
            TypeError,
            r"done\[0\] is 0.1, but a pair of times",
        ),
        (
            lambda: loose.plan(d2.read(ENERGY), before="a", done=[(0.1, 0.2)]),
            TypeError,
            "before is 'a'; give what",
        ),
        (
            lambda: loose.read(ENERGY, energy=1.5),
            TypeError,
            "energy is 1.5, but the name or number of a column",
        ),
        (
            lambda: loose.read(ENERGY, channels=["a"]),
            TypeError,
            r"channels is \['a'\], but a mapping",
        ),
        (
            lambda: loose.read(ENERGY, input_format=3),
            TypeError,
            "input_format is 3, but a text was expected",
        ),
        (
            lambda: loose.read(pd.DataFrame({"t": [1.0]})),
            TypeError,
            r"a table of type DataFrame; give it to d2rpick.from_",
        ),
        (
            lambda: loose.read(np.zeros((3, 2))),
            TypeError,
            r"a table of type ndarray; give it to d2rpick.from_frame",
        ),
        (
            lambda: loose.from_frame(np.zeros(3)),
            TypeError,
            r"frame is an array of shape \(3,\), but a table was expected",
        ),
        (
            lambda: loose.from_frame({"t": [1.0]}, name=3),
            TypeError,
            "name is 3, but a text was expected",
        ),
        (
            lambda: loose.card(5, parts=1),
            TypeError,
            "windows is 5; pairs of times were expected",
        ),
        (lambda: d2.read(ENERGY).overview(deck=loose.Run), TypeError, "deck is "),
        (
            lambda: loose.suggest(d2.read(ENERGY), 0.06, v0=6.0),
            ValueError,
            "give oscillator and v0 together",
        ),
        (
            lambda: loose.suggest(d2.read(BOX), 0.3, parts=[]),
            ValueError,
            "parts is empty",
        ),
        (
            lambda: loose.suggest(d2.read(BOX), 0.3, parts=[1.5]),
            TypeError,
            "parts holds 1.5",
        ),
        (
            lambda: loose.suggest(d2.read(BOX), 0.3, parts=d2.read(BOX).parts[0]),
            TypeError,
            r"parts holds Part\(id=1,",
        ),
        (
            lambda: loose.suggest(ENERGY, 0.06),
            TypeError,
            r"run is .*; give what d2rpick.read",
        ),
        (
            lambda: loose.suggest(d2.read(ROLLOVER, energy="boxIE_J"), 0.3, parts=1),
            ValueError,
            "exclude each other",
        ),
        (
            lambda: loose.suggest(d2.read(BOX), 0.3, weights="a.toml"),
            ValueError,
            "`weights` needs `deck`",
        ),
        (lambda: loose.parts(d2.read(BOX), tr=0.1), ValueError, "`tr` needs `td`"),
        (
            lambda: loose.parts(d2.read(BOX), tr=0.3, td=0.1),
            ValueError,
            "tr must lie before td",
        ),
        (
            lambda: loose.parts("box.matsum"),
            TypeError,
            r"run is 'box\.matsum'; give what d2rpick\.read\(\.\.\.\) makes",
        ),
        (
            lambda: loose.plan(d2.read(ENERGY), min_rigid=-1),
            ValueError,
            "min_rigid is -1",
        ),
        (
            lambda: loose.plan(d2.read(ENERGY), done=[(0.2, 0.1)]),
            ValueError,
            r"done\[0\] is",
        ),
        (
            lambda: loose.plan(d2.read(ENERGY), before=d2.read(ENERGY)),
            ValueError,
            "name its windows with `done`",
        ),
        (
            lambda: loose.plan(d2.read(ENERGY), done=[(0.1, 0.9)]),
            d2.RangeError,
            "outside the record",
        ),
        (lambda: loose.suggest(d2.read(BOX), 0.3, deck=3), TypeError, "deck is 3"),
        (
            lambda: loose.suggest(d2.read(BOX), 0.3, deck=["a.k", "b.k"]),
            ValueError,
            "deck names 2 files",
        ),
        (
            lambda: loose.suggest(d2.read(BOX), 0.3, deck="absent.k"),
            d2.DeckError,
            "absent.k",
        ),
        (
            lambda: loose.plan(d2.read(BOX), parts="recommended"),
            ValueError,
            "needs `deck`",
        ),
        (
            lambda: loose.plan(d2.read(BOX), parts=["recommended", 1]),
            ValueError,
            "a whole set",
        ),
        (
            lambda: loose.plan(d2.read(BOX), step_ratio=2),
            ValueError,
            "`cost_share` or `deck`",
        ),
        (lambda: loose.read(3), TypeError, "source is 3"),
        (lambda: loose.read([]), ValueError, "source is empty"),
        (
            lambda: loose.read("a\0b"),
            ValueError,
            r"source holds 'a\\x00b' with a NUL byte",
        ),
        (lambda: write_page("a\0b", ""), ValueError, "path holds .* with a NUL byte"),
        (
            lambda: loose.plan(d2.read(BOX), deck="a\0b"),
            ValueError,
            "deck holds .* with a NUL byte",
        ),
        (
            lambda: loose.suggest(d2.read(ENERGY), 0.06, step_ratio=0.5, cost_share=1),
            ValueError,
            "at least 1 was",
        ),
        (
            lambda: loose.read(ENERGY, input_format="exel"),
            ValueError,
            "input_format is 'exel', but one of auto, binout",
        ),
        (lambda: loose.from_frame([1, 2]), TypeError, "frame is of type list"),
        (lambda: loose.study([ENERGY], 0.06, jobs=0), ValueError, "jobs is 0"),
        (
            lambda: loose.study([ENERGY], 0.06, jobs=1.5),
            TypeError,
            "jobs is 1.5, but a whole number was expected",
        ),
        (
            lambda: loose.explore(d2.read(ENERGY), steps=2.5),
            TypeError,
            "steps is 2.5, but a whole number was expected",
        ),
        (
            lambda: loose.suggest(d2.read(BOX), 0.3, parts=1.5),
            TypeError,
            "parts is 1.5; a number, a title or several",
        ),
        (
            lambda: loose.check(DECK, history=ENERGY),
            TypeError,
            r"history is .*; give what d2rpick.read",
        ),
        (
            lambda: loose.check(DECK, select=5),
            TypeError,
            "select is 5; ids of rules were expected",
        ),
        (
            lambda: loose.suggest(d2.read(ENERGY), 9),
            d2.RangeError,
            "lies outside the record",
        ),
        (
            lambda: loose.suggest(d2.read(ENERGY), 0.06, parts=1),
            d2.D2RPickError,
            "this table has no parts",
        ),
        (lambda: loose.check("absent.k"), d2.DeckError, "absent.k"),
    ],
)
def test_a_wrong_argument_is_named(
    call: Callable[[], Any], error: type[Exception], text: str
) -> None:
    with pytest.raises(error, match=text):
        call()
