"""The command ``plan`` in all formats."""

import json
import re
from dataclasses import replace
from pathlib import Path

import pytest

import d2rpick as d2
from d2rpick.choice.question import Settings, read_reference
from d2rpick.choice.td.plan import plan_run
from d2rpick.histories.names import Selection
from d2rpick.report.formats import DisplayOptions
from d2rpick.report.plan import give_plan_sentence
from tests.command import (
    BOX,
    ENERGY,
    join_wrapped_lines,
    put,
    read_refusal,
    run,
    run_json,
)
from tests.computed import locate_stored, read_starter
from tests.drops import drop, write_run_files
from tests.json_schemas import check_by_schema, run_json_checked

pytestmark = pytest.mark.slow
FINE = 4e-4  # output interval [s], short enough to show a landing that occurs slightly later
# No oscillator describes the run, and none is searched for; its flights with vibration are poor but still planned.
PART = ("--part", "box", "--no-verify", "--min-quality", "poor")

DECK = """*KEYWORD
*CONTROL_TERMINATION
       1.2
*DATABASE_GLSTAT
    0.0001
*DATABASE_MATSUM
    0.0001
*PART
box
         1         1         1
*PART
step
         2         1         1
*END
"""


@pytest.fixture(scope="module")
def history(tmp_path_factory: pytest.TempPathFactory) -> list[str]:
    return write_run_files(drop(interval=FINE), tmp_path_factory.mktemp("run"))


def test_all_forms_hold_the_same_windows(history: list[str]) -> None:
    plan = d2.plan(d2.read(history), parts="box", replay=False, min_quality="poor")
    document = plan.to_dict()
    check_by_schema(document)
    supported = [
        (row["tr"], row["td"])
        for row in document["windows"]
        if row["status"] == "supported"
    ]
    all_windows = [
        (row["tr"], row["td"]) for row in document["windows"] if row["tr"] is not None
    ]
    assert all(
        (row["quality"] is None) is (row["tr"] is None) for row in document["windows"]
    )
    assert 1 < len(supported) < len(all_windows)
    values = run("plan", "-q", "-f", "value", "--all", *PART, *history).stdout
    for text, wanted in (
        (plan.text("value", DisplayOptions()), supported),
        (values, all_windows),
    ):
        assert [
            tuple(map(float, line.split(" "))) for line in text.splitlines()
        ] == wanted
    table = plan.text("csv", DisplayOptions())
    assert [row["td"] for row in read_csv_rows(table)] == [
        row["td"] for row in document["windows"]
    ]
    for form in ("table", "markdown"):
        text = plan.text(form, DisplayOptions())
        assert all(
            f"{tr:.6g}" in text and f"{td:.6g}" in text for tr, td in all_windows
        )
        assert "plan this flight from a run with that switch" in " ".join(text.split())


def read_csv_rows(text: str) -> list[dict[str, object]]:
    """Return the rows of a csv, with numbers as numbers."""
    import csv
    import io

    rows = csv.DictReader(io.StringIO(text))
    return [
        {
            key: float(cell) if key in ("tr", "td") and cell else cell or None
            for key, cell in row.items()
        }
        for row in rows
    ]


def test_a_poor_window_is_called_poor() -> None:
    """The level may match although most of the vibration is kinetic at td."""
    box = locate_stored("drop2T01.gz")
    plan = d2.plan(d2.read(box), parts="all", min_quality="poor")
    document = plan.to_dict()
    rows = [row for row in document["windows"] if row["status"] == "supported"]
    assert [row["quality"] for row in rows] == ["good", "poor"]
    for row in rows:
        alone = run_json(
            "suggest",
            "--part",
            "all",
            "--td-window",
            str(row["flight_start"]),
            str(row["flight_end"]),
            box,
        )
        assert alone["quality"] == row["quality"]
    text = plan.text("table", DisplayOptions())
    wrong = f"the vibration after td is wrong by {rows[1]['residual']:.0%}"
    assert f"why   flight {rows[1]['flight']}: {wrong}" in text
    assert rows[1]["residual"] > 0.5
    sentence = " ".join(text.partition("\nnext")[0].split())
    assert f"(do not use flight {rows[1]['flight']})" in sentence
    assert "with care" not in sentence


def test_the_first_sentence_recommends_no_poor_window(history: list[str]) -> None:
    arguments = ("plan", "-q", *PART, *history)
    rows = run_json(*arguments)["windows"]
    planned = [row for row in rows if row["status"] == "supported"]
    assert [row["verdict"] for row in planned] == ["use", "do not use"]
    sentence = run(*arguments).stdout
    number = planned[1]["flight"]
    assert sentence.startswith(
        f"use 1 of {len(rows)} windows now (do not use flight {number}): make the parts rigid from"
    )
    good, poor = ("from {tr:.6g} to {td:.6g}".format(**row) for row in planned)
    first, named, rest = join_wrapped_lines(sentence).partition(good)
    assert poor not in first
    assert named
    assert f"; {poor} they are rigid only because of --min-quality poor" in rest
    assert f"why   flight {number}: " in sentence


def test_where_all_planned_windows_are_poor_none_is_recommended(
    history: list[str],
) -> None:
    plan = plan_run(
        read_reference(history, Selection(parts=("box",))),
        Settings(replay=False, min_quality="poor"),
    )
    poor = [row._replace(status="supported") for row in plan.flights[1:]]
    sentence = give_plan_sentence(replace(plan, flights=tuple(poor)))
    assert sentence.startswith("do not use flights 2, 3: rigid from ")
    assert "is planned only because of `min_quality` poor" in sentence


def test_the_card_holds_the_supported_windows_and_passes_check(
    history: list[str], tmp_path: Path
) -> None:
    card = tmp_path / "switches.k"
    result = run("plan", "-q", "-f", "card", *PART, "-o", str(card), *history)
    assert (result.exit_code, result.stdout) == (0, "")
    windows = json.loads(run("check", "-q", "-f", "json", str(card)).stdout)["windows"]
    lines = run("plan", "-q", "-f", "value", *PART, *history).stdout.split()
    assert [
        time for window in windows for time in (window["tr"], window["td"])
    ] == pytest.approx(list(map(float, lines)), abs=1e-7)


def test_radioss_gets_a_leg_for_each_switch(history: list[str]) -> None:
    card = run(
        "plan",
        "-q",
        "-f",
        "card",
        "--solver",
        "radioss",
        "--node",
        "7",
        *PART,
        *history,
    ).stdout
    lines = run("plan", "-q", "-f", "value", *PART, *history).stdout.splitlines()
    assert card.count("/RBODY/ON") == len(lines)
    assert card.count("/RBODY/OFF") >= len(lines)


def test_pictures_and_pages_are_written(history: list[str], tmp_path: Path) -> None:
    plot, page = tmp_path / "plan.svg", tmp_path / "plan.html"
    assert (
        run(
            "plan", "-q", *PART, "--plot", str(plot), "--report", str(page), *history
        ).exit_code
        == 0
    )
    assert plot.read_text().startswith("<?xml")
    text = page.read_text()
    assert "*DEFORMABLE_TO_RIGID_AUTOMATIC" in text
    assert "http://" not in text.replace("http://www.w3.org", "")


def test_a_flight_without_a_usable_window_does_not_stop_a_script(
    history: list[str],
) -> None:
    """The exit code is 1 only if no flight has a window that can be used in the next run."""
    box = ("--part", "box", *history)
    flights = run_json("plan", *box)["windows"]
    statuses = [flight["status"] for flight in flights]
    assert (statuses.count("supported"), statuses.count("left-out")) == (1, 2)
    assert run("plan", "-q", *box).exit_code == 0
    assert run("plan", "-q", "--min-rigid", "5", *box).exit_code == 1


def test_nothing_to_recommend_is_an_objection(history: list[str]) -> None:
    assert (
        run("plan", "-q", "--min-rigid", "5", "-f", "card", *PART, *history).exit_code
        == 1
    )
    assert (
        run("plan", "-q", "--min-rigid", "5", "--exit-zero", *PART, *history).exit_code
        == 0
    )


def test_a_flight_that_is_too_short_has_no_other_verdict() -> None:
    box = "sample_data/rollover_box.matsum"
    output = run("plan", "-q", "--min-rigid", "5", "--part", "1,2", box).output
    (row,) = (line for line in output.splitlines() if line.endswith("no run"))
    assert row.split() == [
        "1",
        "0.086",
        "0.379",
        "0.00879",
        "too",
        "short",
        "no",
        "run",
    ]
    # It is not the verdict on a pair.
    assert not {"use", "care"} & set(row.split())


def test_one_oscillator_is_one_flight() -> None:
    plan_answer = run_json("plan", ENERGY)
    (row,) = plan_answer["windows"]
    assert (row["status"], row["basis"], row["margin_source"]) == (
        "supported",
        "oscillator",
        "no-contact",
    )
    assert row["residual"] < 1e-3


def test_where_nothing_vibrates_no_level_is_held_against_another() -> None:
    file = locate_stored("drop2T01.gz")
    arguments = ("--part", "flying", "--tr", "0", "--td", "0.27")
    verdict, why, *others = run("verify", "-q", *arguments, file).stdout.splitlines()
    assert verdict == "use     tr = 0, td = 0.27"
    assert why == "why     nothing vibrates in the flight up to td"
    assert "basis      energy: nothing vibrates" in others
    assert "flight     from 0 (" in "\n".join(others)
    chosen = run("suggest", "-q", "--part", "flying", "--td", "0.27", file).stdout
    kept = "the same as in the reference run: nothing vibrates in the flight up to td"
    assert f"expect  {kept}\n" in chosen
    card = run(
        "card",
        "-q",
        "--part",
        "1",
        *arguments[2:],
        "--solver",
        "ls-dyna",
        "--history",
        file,
    ).stdout
    assert "at-rest: nothing vibrates" in card
    assert "evel error" not in card


def test_the_next_window_is_planned_from_the_switched_run(
    history: list[str], tmp_path: Path
) -> None:
    done = tmp_path / "switches.txt"
    run("plan", "-q", "-f", "value", *PART, "-o", str(done), *history)
    windows = [
        (float(tr), float(td))
        for tr, td in map(str.split, done.read_text().splitlines())
    ]
    switched = write_run_files(drop(*windows, interval=FINE), tmp_path / "next")
    before_options = [text for name in history for text in ("--before", name)]
    plan_answer = run_json_checked(
        "plan", *PART, "--done", str(done), *before_options, *switched
    )
    assert [
        (row["tr"], row["td"])
        for row in plan_answer["windows"]
        if row["status"] == "done"
    ] == windows
    assert all(
        row["landing"] > row["td"]
        for row in plan_answer["windows"]
        if row["status"] == "done"
    )
    result = run(
        "plan", "-q", *PART, "--done", str(done), *before_options, *switched
    ).stdout
    assert "as planned" in result
    assert "than planned" in result
    assert "is planned only because of --min-quality poor" in join_wrapped_lines(result)
    new = [
        (row["tr"], row["td"])
        for row in plan_answer["windows"]
        if row["status"] == "supported"
    ]
    lines = run(
        "plan",
        "-q",
        "-f",
        "value",
        *PART,
        "--done",
        str(done),
        *before_options,
        *switched,
    ).stdout.splitlines()
    assert [tuple(map(float, line.split())) for line in lines] == [*windows, *new]
    assert "a window that --done names" in read_refusal(
        "plan", "-q", *PART, "--done", str(done), *history
    )


def test_the_cards_of_the_next_run_hold_the_windows_that_are_done(
    history: list[str], tmp_path: Path
) -> None:
    """The next run starts from the beginning; a run that was rigid in a finished window cannot be used to judge it."""
    done, main, folder = tmp_path / "done.txt", tmp_path / "main.k", tmp_path / "next"
    main.write_text(DECK)
    run("plan", "-q", "-f", "value", *PART, "-o", str(done), *history)
    windows = [
        (float(tr), float(td))
        for tr, td in map(str.split, done.read_text().splitlines())
    ]
    switched = write_run_files(drop(*windows, interval=FINE), tmp_path / "switched")
    args = ("plan", "-q", *PART, "--done", str(done))
    card = run(*args, "-f", "card", *switched)
    assert card.exit_code == 0
    assert "not judged again" in " ".join(card.stdout.replace("$", "").split())
    assert card.stdout.count("*DEFORMABLE_TO_RIGID_AUTOMATIC") == 2 * (len(windows) + 1)
    result = run(*args, "--deck", str(main), "--write-deck", str(folder), *switched)
    assert result.exit_code == 0, result.stdout
    assert "0 errors, 0 warnings" in result.stdout
    document = json.loads(
        run("check", "-q", "-f", "json", str(folder / "main.k")).stdout
    )
    times = [(window["tr"], window["td"]) for window in document["windows"]]
    assert times[:-1] == [pytest.approx(window, abs=1e-7) for window in windows]
    assert times[-1][0] > windows[-1][1]
    nothing = run(*args, "-f", "card", "--min-rigid", "1", *switched)
    assert (nothing.exit_code, nothing.stdout) == (1, "")


def test_a_radioss_run_gets_its_starter_and_a_leg_for_each_switch(
    tmp_path: Path,
) -> None:
    """The first fall of the falling box is free, so the reference can replace a run that is switched in it."""
    name, node = "DROP2", "535"
    deck = put(tmp_path / f"{name}_0000.rad", read_starter("DROP2"))
    engine = f"/RUN/{name}/1\n0.7\n/VERS/2022\n/DT\n0.9 0.0\n/RBODY/OFF\n{node}\n/TFILE/4\n0.0002\n"
    (tmp_path / f"{name}_0001.rad").write_text(engine)
    history, done = locate_stored("drop2T01.gz"), tmp_path / "done.txt"
    done.write_text("0.0 0.277\n")
    args = (
        "plan",
        "-q",
        "--part",
        "all",
        "--node",
        node,
        "--min-quality",
        "poor",
        "--deck",
        str(deck),
        "--write-deck",
    )
    for folder, options in (
        (tmp_path / "a", ()),
        (tmp_path / "b", ("--done", str(done))),
    ):
        result = run(*args, str(folder), *options, history)
        assert result.exit_code == 0, result.stdout
        assert "0 errors, 0 warnings" in result.stdout
        names = [f"{name}_{leg:04d}.rad" for leg in range(5)]
        assert sorted(path.name for path in folder.iterdir()) == names
        assert (folder / names[0]).read_bytes() == deck.read_bytes()
        legs = [(folder / leg).read_text() for leg in names[1:]]
        assert ["/RBODY/ON" in leg for leg in legs] == [True, False, True, False]
        assert all("/TFILE/4" in leg for leg in legs)
    assert legs[0].splitlines()[1].strip() == "0.277"
    in_sensors = ("--solver", "radioss-sensors", "-f", "json", history)
    answer = json.loads(run(*args, str(tmp_path / "s"), *in_sensors).stdout)
    engine_file = (tmp_path / "s" / f"{name}_0001.rad").read_text()
    step = float(engine_file.partition("/DTIX\n")[2].split()[0])
    assert answer["fewest_cycles"] == round(0.7 / step) > 1000
    lacking = read_starter("DROP2").partition(b"/RBODY")
    deck.write_bytes(lacking[0] + lacking[2][lacking[2].index(b"/SURF") :])
    (tmp_path / f"{name}_0001.rad").write_text(
        engine.replace(f"/RBODY/OFF\n{node}\n", "")
    )
    result = run("plan", *args[2:4], *args[6:], str(tmp_path / "c"), history)
    assert (
        result.exit_code,
        "/RBODY with main node 536 is new, for parts 1-5" in result.stderr,
    ) == (0, True)
    assert "parts 1-5: rigid from" in result.stdout


def test_a_copy_of_the_deck_holds_the_cards_and_passes_the_check(
    history: list[str], tmp_path: Path
) -> None:
    main, folder = tmp_path / "main.k", tmp_path / "next"
    main.write_text(DECK)
    args = (
        "plan",
        "-q",
        "--part",
        "flying",
        "--deck",
        str(main),
        "--write-deck",
        str(folder),
        *history,
    )
    result = run(*args)
    assert result.exit_code == 0, result.stdout
    assert "0 errors, 0 warnings" in result.stdout
    assert (folder / "main.k").read_text() == DECK.replace(
        "*END", "*INCLUDE\nswitches.k\n*END"
    )
    judged = run(
        "check",
        str(folder / "main.k"),
        *(text for name in history for text in ("--history", name)),
    )
    assert judged.exit_code == 0, judged.stdout
    assert "the file exists; choose another folder or --overwrite" in read_refusal(
        *args
    )
    assert run(*args, "--overwrite").exit_code == 0
    assert "--write-deck needs --deck" in read_refusal(
        "plan", "--part", "box", "--write-deck", str(folder), *history
    )


def test_a_plan_explains_a_window_whose_vibration_error_is_only_small_beside_the_contact() -> (
    None
):
    screen = run("plan", BOX).stdout
    header = next(line for line in screen.splitlines() if "switch in" in line)
    assert "error" in header.split()
    words = " ".join(screen.split())
    assert "residual 0.607 use next run" in words
    reason = "the vibration after td is wrong by 61%, but the energy of this error is at most 0.43% of the energy"
    limit = "of the next contact (limit for use: 1%): use only the motion"
    assert f"why flight 1: {reason} {limit}" in words
    assert "flight 1 Expect: mean energy after td 97% to 98%" in words
    assert "judged internal_energy, not that of chosen parts (--part)" in words
    assert "limit for use: 1%" in run("plan", "-f", "markdown", BOX).stdout
    assert "limit for use: 1%" in run("plan", "-f", "csv", BOX).stdout
    assert "limit for use: 1%" in run("suggest", BOX).stdout
    flights = re.findall(r"^flight (\d+) ", screen, re.MULTILINE)
    assert flights == sorted(flights, key=int)


def test_a_plan_says_how_exactly_tr_has_to_be_met_as_suggest_does(
    tmp_path: Path,
) -> None:
    """The planned window of this run is the pair that suggest chooses."""
    page = tmp_path / "plan.html"
    suggestion = run("suggest", ENERGY).stdout
    (line,) = (row for row in suggestion.splitlines() if row.startswith("tr  "))
    words = " ".join(line.split()[1:])
    assert words.startswith("accurate to ±")
    assert "; timing tolerance ±" in words
    screen = join_wrapped_lines(run("plan", "--report", str(page), ENERGY).stdout)
    assert re.search(rf" flight 1 tr = [\d.]+: {re.escape(words)} history ", screen)
    assert words in page.read_text()
    assert words in run("plan", "-f", "markdown", ENERGY).stdout
    (window,) = run_json("plan", ENERGY)["windows"]
    pair = run_json("suggest", ENERGY)["candidates"][0]
    for key in ("timing_tolerance", "tr_low", "tr_high"):
        assert window[key] == pair[key]
