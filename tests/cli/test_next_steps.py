"""The next step named in an answer works, and messages name only what the user gave."""

import html
import re
import shlex
from math import sin
from pathlib import Path

import numpy as np
import pytest

from d2rpick.choice.pair.cures import name_parts_in_verify, omit_comparison
from d2rpick.choice.pair.grades import VERDICTS
from d2rpick.choice.pair.quality import (
    Cause,
    Grade,
    Quality,
)
from tests import variants
from tests.command import (
    BOX,
    ENERGY,
    MATSUM,
    ROLLOVER,
    ROOT,
    join_wrapped_lines,
    put,
    run,
    run_json,
)
from tests.computed import locate_stored

SAMPLES = ROOT / "sample_data"
DECK = str(SAMPLES / "rollover_box.k")


def find_line(name: str, *arguments: str) -> str:
    """Return, on one line, the sentence that the table of an answer gives under a name."""
    text = run(*arguments).stdout
    match = re.search(rf"^{name}  .*(?:\n  .*)*", text, re.MULTILINE)
    assert match, text
    return " ".join(match[0].removeprefix(name).split())


@pytest.mark.parametrize("command", ["suggest", "plan"])
def test_the_step_to_the_card_names_the_option_that_the_card_needs(
    command: str,
) -> None:
    text = find_line("next", command, ENERGY)
    match = re.search(r"d2rpick (card .*) \(ids of your parts instead of IDS", text)
    assert match
    card = run(*shlex.split(match[1].replace("IDS", "1")))
    assert card.exit_code == 0
    assert "*DEFORMABLE_TO_RIGID" in card.stdout


def test_the_step_to_the_card_of_a_radioss_run_names_the_nodes() -> None:
    text = find_line("next", "suggest", "--part", "flying", BOX)
    assert "-f card --node NODES" in text
    assert "(main nodes of your rigid bodies instead of NODES)" in text


def test_the_step_to_the_card_of_a_radioss_run_names_the_only_body_of_its_deck() -> (
    None
):
    text = find_line("next", "plan", str(SAMPLES / "oscillator"))
    assert "-f card --node 9001 " in text
    assert "instead of" not in text


def test_after_the_deck_is_written_the_next_step_is_to_run_it(tmp_path: Path) -> None:
    folder = str(tmp_path / "next")
    options = ("--part", "1,2", "--deck", DECK, "--write-deck", folder)
    text = find_line("next", "plan", *options, MATSUM)
    assert text.startswith(f"run the deck in {folder} from t = 0")


def test_the_step_after_info_keeps_the_deck() -> None:
    assert f"--deck {DECK}" in find_line("next", "info", "--deck", DECK, MATSUM)


def test_the_step_after_info_keeps_the_selected_energy() -> None:
    text = find_line("next", "info", "--energy", "boxIE_J", ROLLOVER)
    assert text == f"d2rpick plan --energy boxIE_J {ROLLOVER}"
    step = run(*shlex.split(text)[1:])
    assert step.exit_code in (0, 1)
    assert "flight" in step.stdout


def test_info_refuses_files_whose_flight_lasts_longer_than_the_energy() -> None:
    result = run("info", MATSUM, ENERGY)
    text = join_wrapped_lines(result.stdout)
    assert text.startswith(
        "record do not use it to choose times why the flight from 0.086 to 0.379"
    )
    assert "do all files belong to the same run?" in text
    assert "next" not in text.split("source")[0]


@pytest.mark.parametrize(
    ("arguments", "cause"),
    [
        (("suggest", "--after", "0.5", MATSUM), "--after 0.5 lies outside the record"),
        (("explore", "--after", "0.5", MATSUM), "--after 0.5 lies outside the record"),
        (
            ("suggest", MATSUM, ENERGY),
            "the longest flight, from 0.086 to 0.379, reaches outside",
        ),
        (("plan", MATSUM, ENERGY), "flight 1, from 0.086 "),
        (
            ("explore", MATSUM, ENERGY),
            "the longest flight, from 0.086 to 0.379, reaches outside",
        ),
        (
            ("explore", "--td", "0.1", MATSUM, ENERGY),
            "the flight that contains --td, from 0.086 to 0.379, reaches outside",
        ),
        (
            ("parts", "--deck", str(SAMPLES / "oscillator"), MATSUM),
            "this is a folder; give the main deck in it",
        ),
        (
            ("verify", "--tr", "0.0687534", "--td", "0.0135867", ENERGY),
            "give the earlier time as tr",
        ),
        (("suggest", "--margin", "50%", ENERGY), "give a time in the unit of the run"),
        (("suggest", "--tolerance", "20%", ENERGY), "write the share as a number, 0.2"),
        (
            ("card", "--tr", "0.1", "--td", "0.2", "--part", "99999999999"),
            "an id has at most 10 digits",
        ),
        (("card", "--tr", "0.1", "--td", "0.2", "--part", "0"), "--part: '0' does not"),
    ],
)
def test_a_refusal_names_what_was_given_and_the_cure(
    arguments: tuple[str, ...], cause: str
) -> None:
    result = run(*arguments)
    assert result.exit_code == 2
    assert cause in result.stderr


def test_a_margin_longer_than_the_flight_is_named_as_the_reason() -> None:
    question = ("--margin", "0.4", "--part", "flying", MATSUM)
    text = find_line("no pair to use", "suggest", *question)
    assert text.startswith(
        "the margin 0.4 after the load and before the contact leaves"
    )
    assert text.endswith("give a smaller --margin")
    text = find_line("why", "plan", *question)
    assert text == (
        "the margin 0.4 is longer than every flight; the longest lasts 0.293 (--margin)"
    )


@pytest.mark.parametrize(
    "command", [("suggest",), ("plan",), ("verify", "--tr", "0.124", "--td", "0.37")]
)
@pytest.mark.parametrize("margin", ["0.2", "0.4"])
def test_a_margin_longer_than_the_flight_leads_to_the_margin_of_the_run(
    command: tuple[str, ...], margin: str
) -> None:
    step = find_line("next", *command, "--margin", margin, "--part", "flying", MATSUM)
    line = f"d2rpick plan --part flying {MATSUM}"
    assert step == f"leave out --margin, so that it is derived from the run: {line}"


@pytest.mark.parametrize("command", ["suggest", "plan", "explore"])
def test_a_margin_longer_than_the_record_is_refused(command: str) -> None:
    result = run(command, "--margin", "5", MATSUM)
    assert result.exit_code == 2
    cause = "--margin 5 is longer than the record, 0.42; give a shorter time"
    assert cause in result.stderr


def test_a_margin_in_ms_is_refused_with_its_value_in_the_unit_of_the_record() -> None:
    stderr = run("suggest", "--margin", "50", MATSUM).stderr
    assert "was it meant in ms? Then give --margin 0.05, in the unit" in stderr


@pytest.mark.parametrize("command", ["suggest", "plan", "explore"])
def test_a_landing_before_every_flight_is_refused(command: str) -> None:
    result = run(command, "--landing", "0.0379", "--part", "flying", MATSUM)
    assert result.exit_code == 2
    assert (
        "--landing 0.0379 lies in no flight, the first of which lasts from 0.086 to 0.379"
        in result.stderr
    )
    assert "give the time of the contact that ends a flight" in result.stderr


def test_info_leads_to_the_later_restart_segments_that_were_not_named() -> None:
    legs = [locate_stored(f"rollover_r100_T0{number}.gz") for number in (1, 2, 3)]
    question = ("info", "--part", "box")
    step = find_line("next", *question, legs[0])
    line = shlex.join(("d2rpick", *question, *legs))
    assert step == f"read the later restart segments too with {line}"
    assert "info" not in find_line("next", *question, *legs)


def test_without_part_energies_no_part_is_called_unable_to_be_switched() -> None:
    text = find_line("make rigid", "parts", "--deck", DECK, ENERGY)
    assert text == "unknown: the history contains no data for individual parts"


def test_a_better_pair_that_verify_refuses_is_not_offered() -> None:
    options = ("--part", "box", MATSUM)
    text = run("suggest", "--td", "0.064", *options).stdout
    better = run_json("suggest", "--td", "0.064", *options)["better_td"]
    times = ("--tr", repr(better["tr"]), "--td", repr(better["td"]))
    assert run_json("verify", *times, *options)["verdict"] == "do not use"
    assert f"td = {better['td']:.6g}" not in text


def test_a_complete_run_is_not_called_cut_because_another_is_longer() -> None:
    result = run("study", "--part", "flying", MATSUM, BOX)
    assert "ends early, at 0.42" in join_wrapped_lines(result.stdout)
    assert "cut at" not in result.stdout
    assert ";\n" not in result.stdout


def test_after_the_comparison_with_a_switched_run_none_is_asked_for() -> None:
    assert (
        omit_comparison_from(
            "write more often, or compare with a finished switched run"
        )
        == "write more often"
    )


def test_after_the_comparison_with_a_switched_run_no_parts_are_asked_for() -> None:
    """The switched run shows which parts were rigid, so the advice leads to no other answer."""
    name_parts = (
        "name the parts to be switched with `parts`, if the files contain parts"
    )
    for beginning, expected in (("", ""), ("write more often, ", "write more often")):
        cure = f"{beginning}{name_parts}"
        assert omit_comparison_from(cure) == expected
        assert (
            omit_comparison_from(f"{cure}, or compare with a finished switched run")
            == expected
        )


def omit_comparison_from(cure: str) -> str:
    """Return the cure that remains after a comparison."""
    grade = Grade("poor", (Cause("unknown", cure),))
    quality = omit_comparison(Quality(grade, grade, grade))
    (remaining,) = {cause.cure for cause in (*quality.causes, *quality.alone.causes)}
    return remaining


@pytest.mark.slow
def test_no_spring_is_advised_to_become_rigid() -> None:
    """The energy of springs with dampers would be left out, so that choosing them too changes nothing."""
    car = str(ROOT / "tests/data/carT01.gz")
    answer = run_json("suggest", "--part", "1-14", car)
    assert answer["verdict"] == "do not use"
    assert answer["cure"] == "compare with a finished switched run"
    step = find_line("next", "suggest", "--part", "1-14", car)
    assert "15" not in step


def test_a_check_advises_no_option_that_it_lacks() -> None:
    """The parts of a window come from the deck, so the cure names the command that has the option --part."""
    cure = "name the parts to be switched with `parts`, if the files contain parts"
    grade = Grade("poor", (Cause("unknown", cure),))
    quality = name_parts_in_verify(Quality(grade, grade, grade))
    cures = {cause.cure for cause in (*quality.causes, *quality.alone.causes)}
    assert cures == {
        "judge the pair with d2rpick verify by the energy of its parts (`parts`), if the files contain parts"
    }
    check_options = run("check", "--help").stdout
    assert "--part" not in check_options


@pytest.mark.slow
@pytest.mark.parametrize("form", ["table", "page"])
def test_the_step_after_a_comparison_keeps_the_restriction_to_the_motion(
    tmp_path: Path, form: str
) -> None:
    """If the reason for the verdict says that only the motion can be used, so does the next step."""
    switched, page = str(tmp_path / "switched.matsum"), str(tmp_path / "page.html")
    times = ("--tr", "0.123689", "--td", "0.37")
    run("rollover", *times, "--with-step", "--dt", "1e-3", "-o", switched)
    report = ("--report", page) if form == "page" else ()
    parts = ("--deck", DECK, "--part", "recommended")
    text = run("verify", *parts, "--switched", switched, *report, MATSUM).stdout
    sentences = join_wrapped_lines(text)
    assert "limit for use with care: 5%): use only the motion " in sentences
    step = "use only the motion of the switched run; "
    assert f"next {step}" in sentences
    assert not report or step in Path(page).read_text("utf-8")


def test_the_step_after_a_comparison_of_a_good_pair_has_no_restriction() -> None:
    folder = str(SAMPLES / "oscillator_switched")
    verify = ("verify", "--part", "bar", "--switched", folder)
    text = find_line("next", *verify, str(SAMPLES / "oscillator" / "OSCT01.gz"))
    assert text.startswith("use the results of the switched run; ")


WITH_CARE = ("--tr", "0.123689", "--td", "0.37", "--part", "flying")
DO_NOT_USE = ("--tr", "0.09", "--td", "0.37", "--part", "flying")
FLYING = ("--part", "flying", MATSUM)
BOX_ONLY = ("--part", "box", MATSUM)


@pytest.mark.parametrize(
    "arguments",
    [
        ("suggest", ENERGY),
        pytest.param(
            ("suggest", "--energy", "boxIE_J", ROLLOVER), marks=pytest.mark.slow
        ),
        ("suggest", MATSUM),
        ("suggest", *FLYING),
        ("suggest", "--td", "0.37", *FLYING),
        ("suggest", "--td", "0.064", ENERGY),
        ("suggest", "--td", "0.064", *BOX_ONLY),
        pytest.param(("suggest", "--part", "flying", BOX), marks=pytest.mark.slow),
        ("plan", ENERGY),
        ("plan", "--deck", DECK, "--part", "recommended", MATSUM),
        ("plan", "--deck", DECK, "--part", "1", MATSUM),
        ("explore", ENERGY),
        ("explore", "--td", "0.064", ENERGY),
        ("explore", *FLYING),
        ("explore", *BOX_ONLY),
        ("verify", "--tr", "0.0135867", "--td", "0.0687534", ENERGY),
        ("verify", "--tr", "0.0135", "--td", "0.064", ENERGY),
        ("verify", *WITH_CARE, MATSUM),
        ("verify", *WITH_CARE[:4], MATSUM),
        ("verify", "--deck", DECK, *WITH_CARE, MATSUM),
        ("verify", *DO_NOT_USE, MATSUM),
        ("parts", "--deck", DECK, MATSUM),
        ("study", ENERGY, ENERGY),
        ("study", "--td", "0.0687534", ENERGY),
        ("study", "--td", "0.064", ENERGY),
        ("info", MATSUM),
    ],
    ids=" ".join,
)
def test_the_next_command_can_be_typed_as_it_stands(
    arguments: tuple[str, ...], tmp_path: Path
) -> None:
    text = find_line("next", *arguments)
    match = re.search(r"d2rpick (.*?)( \(|$)", text)
    assert match, text
    # Only the user knows the parts of a table, the bodies, the main deck and the folder for its copy.
    given = {"IDS": "1", "NODES": "1001", "DECK": DECK}
    for placeholder in {*given} & {*shlex.split(match[1])}:
        assert f"instead of {placeholder}" in text
    given["switched"] = str(tmp_path / "switched")
    step = run(*(given.get(word, word) for word in shlex.split(match[1])))
    assert step.exit_code in (0, 1), step.stderr
    assert any(
        verdict in step.stdout.lower()
        for verdict in (*VERDICTS.values(), "written by d2rpick")
    )


@pytest.mark.parametrize(
    "arguments",
    [
        ("plan", *FLYING),
        ("suggest", *FLYING),
        ("explore", *FLYING),
        ("verify", *WITH_CARE, MATSUM),
    ],
    ids=" ".join,
)
def test_the_shortest_way_to_a_card_of_connected_parts_merges_them(
    arguments: tuple[str, ...], tmp_path: Path
) -> None:
    copy = put(tmp_path / "matsum", Path(MATSUM).read_bytes())
    of_copy = (str(copy) if word == MATSUM else word for word in arguments)
    text = find_line("next", *of_copy)
    assert "without it, parts that share nodes become separate rigid bodies" in text
    match = re.search(r"d2rpick (.*?) \(", text)
    assert match, text
    folder = tmp_path / "switched"
    given = {"DECK": DECK, "switched": str(folder)}
    step = run(*(given.get(word, word) for word in shlex.split(match[1])))
    written = [path.read_text() for path in folder.glob("*.k")]
    card = "".join([step.stdout, *written])
    assert "         2         1      PART\n" in card
    assert "CHECK BEFORE USE" not in card


@pytest.mark.parametrize(
    "arguments",
    [("plan", *FLYING), ("suggest", *FLYING), ("verify", *WITH_CARE, MATSUM)],
    ids=" ".join,
)
def test_the_deck_next_to_a_history_is_named_in_the_next_command(
    arguments: tuple[str, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    text = find_line("next", *arguments)
    assert f"--deck {DECK}" in text
    match = re.search(r"d2rpick (.*?)$", text)
    assert match, text
    step = run(*shlex.split(match[1]))
    written = [path.read_text() for path in Path("switched").glob("*.k")]
    assert "         2         1      PART\n" in "".join([step.stdout, *written])


def test_a_card_whose_parts_may_share_nodes_says_so_in_its_text() -> None:
    times = ("--tr", "0.1", "--td", "0.2")
    warning = "$ CHECK BEFORE USE: each part becomes a rigid body of its own (LRB 0)"
    assert warning in run("card", *times, "--part", "1,2").stdout
    assert warning in run("plan", "-q", "-f", "card", *FLYING).stdout
    assert warning not in run("card", *times, "--part", "1").stdout
    merged = run("card", *times, "--part", "1,2", "--merge", "1").stdout
    assert warning not in merged


def test_the_step_to_the_card_keeps_the_merged_part(tmp_path: Path) -> None:
    for command in ("plan", "suggest", "verify"):
        times = WITH_CARE[:4] if command == "verify" else ()
        page = str(tmp_path / f"{command}.html")
        merging = ("--merge", "1", "--report", page)
        text = find_line("next", command, *times, *merging, *FLYING)
        assert "--merge 1" in text
        assert "DECK" not in text


@pytest.mark.parametrize("text", ["suggest --td 0.37", "explore --td 0.37"])
def test_verify_and_the_choice_give_one_cure_for_a_pair(text: str) -> None:
    cure = find_line("to improve", "verify", *WITH_CARE, MATSUM)
    assert cure.startswith("nothing clearly better was found for td from 0.086 to ")
    assert find_line("to improve", *text.split(), *FLYING) == cure
    assert find_line("to improve", "suggest", *FLYING) == cure
    assert find_line("to improve", "explore", *FLYING) == cure


def test_a_td_next_to_a_good_one_is_improved_by_naming_it() -> None:
    times = ("--tr", "0.0127221", "--td", "0.1455")
    cure = find_line("to improve", "verify", *times, ENERGY)
    assert cure.startswith("use tr = 0.0127221, td = 0.144192")


def test_a_set_that_cannot_be_used_is_not_recommended_beside_one_that_can() -> None:
    result = run("parts", "--deck", DECK, "--td", "0.13", MATSUM)
    assert result.stdout.startswith("use with care  make rigid --part 1,2")


def test_no_form_of_output_names_an_argument_of_python() -> None:
    for form in ("table", "json", "csv", "markdown"):
        text = run("suggest", "--td", "0.2", "-f", form, *BOX_ONLY).stdout
        assert re.search(r"`\w+`", text) is None


def test_a_pair_at_a_better_td_has_its_verdict_in_json() -> None:
    better = run_json("suggest", "--td", "0.064", *BOX_ONLY)["better_td"]
    assert better["verdict"] == "do not use"
    assert better["verdict_reason"].startswith("it is unknown whether")


def test_a_mistyped_option_is_compared_with_the_nearest_only() -> None:
    assert "Did you mean '--td'?" in run("suggest", "--tdd", "1", ENERGY).stderr


def test_a_deck_that_already_switches_its_parts_is_named(tmp_path: Path) -> None:
    options = ("--part", "1,2", "--deck", DECK)
    assert "already switches" not in run("plan", *options, MATSUM).stderr
    folder = tmp_path / "next"
    run("plan", *options, "--write-deck", str(folder), MATSUM)
    deck = str(folder / "rollover_box.k")
    text = run("plan", "--part", "1,2", "--deck", deck, MATSUM).stderr
    assert "the deck already switches parts with *DEFORMABLE_TO_RIGID_AUTOMATIC" in text
    assert "remove its switching cards" in text


EXCEL = str(SAMPLES / "rollover_box_excel.csv")


@pytest.mark.parametrize("options", [(), ("--deck", DECK)])
@pytest.mark.parametrize("command", ["suggest", "explore"])
def test_a_missing_mass_is_named_and_no_deck_is_asked_for(
    command: str, options: tuple[str, ...]
) -> None:
    question = (command, "--td", "369.631", *options, EXCEL)
    assert "do not contain the mass" in find_line("why", *question)
    cure = find_line("to improve", *question)
    assert cure.startswith("write the mass")
    assert "--deck" not in cure
    # All commands have the same verdict, so the step names the change of the record, and no command.
    step = find_line("next", *question)
    assert step.startswith("improve the record: write the mass")
    assert "d2rpick" not in step


def test_the_mass_that_was_asked_for_helps(tmp_path: Path) -> None:
    head, *rows = Path(EXCEL).read_text().splitlines()
    table = tmp_path / "with_mass.csv"
    table.write_text("\n".join([f"{head};Mass", *(f"{row};356" for row in rows)]))
    assert run_json("suggest", EXCEL)["verdict"] == "do not use"
    assert run_json("suggest", str(table))["verdict"] == "use with care"


@pytest.fixture(scope="module")
def loaded(tmp_path_factory: pytest.TempPathFactory) -> str:
    """Write a vibration with a kinetic energy that grows without a contact, by a load that no file names."""
    head, *rows = Path(ENERGY).read_text().splitlines()
    internal = head.split(",").index("internal_energy")
    lines = ["time,internal_energy,kinetic_energy"]
    for row in rows:
        columns = row.split(",")
        kinetic = 1000 + 20000 * float(columns[0])
        lines.append(f"{columns[0]},{columns[internal]},{kinetic!r}")
    table = tmp_path_factory.mktemp("load") / "loaded.csv"
    table.write_text("\n".join(lines))
    return str(table)


@pytest.mark.parametrize("command", ["suggest", "plan"])
def test_a_deck_that_may_explain_a_load_is_asked_for_in_a_new_command(
    command: str, loaded: str
) -> None:
    step = find_line("next", command, loaded)
    again = shlex.join(["suggest", "--deck", "DECK", loaded])
    assert step.startswith(f"judge the run with its deck: d2rpick {again} (")


def test_the_step_to_the_deck_keeps_a_window_for_td(loaded: str) -> None:
    step = find_line("next", "suggest", "--td-window", "0.12", "0.15", loaded)
    assert "suggest --td-window 0.12 0.15 --deck DECK" in step


def list_followed_commands(*first: str) -> list[list[str]]:
    """Type the command that each answer names next, until one names none or asks for a deck; stop at a repetition."""
    commands = [list(first)]
    while len(commands) < 10 and commands.count(commands[-1]) == 1:
        step = find_line("next", *commands[-1])
        match = re.search(r"d2rpick (\w+ .*?)(?: \(.*)?$", step)
        if match is None or "DECK" in step:
            break
        commands.append(shlex.split(match[1]))
    return commands


@pytest.mark.parametrize(
    "history",
    [
        EXCEL,
        pytest.param(locate_stored("carT01.gz"), marks=pytest.mark.slow),
    ],
)
@pytest.mark.parametrize("command", ["suggest", "explore", "plan"])
def test_the_next_commands_of_a_run_that_cannot_be_used_end(
    command: str, history: str
) -> None:
    commands = list_followed_commands(command, history)
    assert len({*map(shlex.join, commands)}) == len(commands)


def test_the_next_commands_of_a_run_under_a_load_end(loaded: str) -> None:
    assert list_followed_commands("explore", loaded) == [["explore", loaded]]
    margin = ("--margin", "0.13")
    followed = list_followed_commands("explore", *margin, ENERGY)
    assert [command[0] for command in followed] == ["explore"]


@pytest.mark.slow
def test_a_plan_that_finds_no_pair_says_so_and_names_a_way_out() -> None:
    history = locate_stored("carT01.gz")
    step = find_line("next", "plan", history)
    assert step.startswith("no pair of this run can be used with all parts; ")
    assert step.endswith(f"d2rpick plan --part flying {history}")
    last = find_line("next", "plan", "--part", "flying", history)
    assert last.startswith("no pair of this run can be used: write the energies more")
    # The only way left is a switched run, whose deck this command writes.
    assert last.count("d2rpick ") == 1
    assert "d2rpick plan --deck DECK --min-quality poor --write-deck switched" in last


def test_a_plan_of_short_flights_asks_for_shorter_windows_only_once() -> None:
    given = ("--after", "0.01", "--landing", "0.012")
    shorter = ("plan", "--min-rigid", "0", *given, ENERGY)
    step = find_line("next", "plan", *given, ENERGY)
    assert step == f"plan shorter windows too with d2rpick {shlex.join(shorter)}"
    assert "plan" not in find_line("next", *shorter)
    last = find_line("next", "plan", "--min-rigid", "0.002", *given, ENERGY)
    assert last.startswith("no pair of this run can be used with --after 0.01, ")
    assert "--min-rigid 0.002 (other values may allow one): every flight is" in last


def test_a_plan_of_a_record_that_ends_in_the_flight_asks_for_a_longer_run(
    tmp_path: Path,
) -> None:
    time = np.linspace(0, 1, 400)
    rows = [f"{t},{100 * t}" for t in time]
    history = tmp_path / "rising.csv"
    history.write_text("\n".join(["time,internal energy", *rows, ""]))
    step = find_line("next", "plan", "--after", "0.1", str(history))
    assert "continue the run, because its record ends in the flight; if this" in step


def test_a_plan_with_a_deck_proposes_its_copy(tmp_path: Path) -> None:
    question = ("--part", "flying", "--deck", DECK, MATSUM)
    step = find_line("next", "plan", *question)
    words = shlex.split(step.partition("This writes the copy: d2rpick ")[2])
    assert words[:3] == ["plan", "--write-deck", "switched"]
    words[2] = str(tmp_path / "switched")
    assert run(*words).exit_code == 0
    assert (tmp_path / "switched" / "rollover_box.k").exists()


def test_a_plan_names_the_option_strict_that_excludes_every_pair() -> None:
    step = find_line("next", "plan", "--strict", "--energy", "boxIE_J", ROLLOVER)
    assert step.startswith(
        "no pair of this run can be used with --strict (an answer without --strict may allow one)"
    )


def test_the_step_of_a_plan_without_a_mass_is_not_another_tour() -> None:
    step = find_line("next", "plan", EXCEL)
    assert step.startswith("improve the record: write the mass")
    assert "d2rpick" not in step


# verify names the time that is to blame.


def test_verify_blames_a_wrong_tr_with_one_error() -> None:
    reason = find_line("why", "verify", "--tr", "0.02", "--td", "0.064", ENERGY)
    assert "285%, because tr does not match td" in reason
    assert "the energy at tr is 106 times that at td" in reason
    # The best tr of suggest has this error.
    best = run_json("suggest", "--td", "0.064", ENERGY)["candidates"][0]["residual"]
    assert reason.endswith(f"the best tr at this td is wrong by {best:.0%}")
    assert "frozen-deformation error" not in reason
    assert "hides a further mode" not in reason


def test_verify_blames_td_if_tr_is_the_best_for_it() -> None:
    tr = run_json("suggest", "--td", "0.064", ENERGY)["recommended"]["tr"]
    reason = find_line("why", "verify", "--tr", str(tr), "--td", "0.064", ENERGY)
    assert "kinetic at td, and no tr can keep kinetic energy" in reason
    assert "tr does not match" not in reason


# The next step does not contradict the answer.


def test_outside_the_flight_the_step_is_to_the_flight() -> None:
    for tr, td in (("0.1", "0.4"), ("0.05", "0.36")):
        question = ("verify", "--tr", tr, "--td", td, "--part", "box", MATSUM)
        assert find_line("to improve", *question) == "choose tr and td in one flight"
        expected = shlex.join(["suggest", "--part", "box", MATSUM])
        assert find_line("next", *question).endswith(expected)


def test_a_tr_during_the_load_is_named_as_the_only_reason() -> None:
    question = ("verify", "--tr", "0.05", "--td", "0.36", "--part", "1,2", MATSUM)
    assert find_line("why", *question) == "tr before the end of the load at 0.086"
    assert "write the energies more often" not in run(*question).stdout


@pytest.mark.parametrize("deck", [(), ("--deck", str(SAMPLES / "switching.k"))])
def test_parts_without_its_deck_asks_for_the_deck(
    deck: tuple[str, ...], tmp_path: Path
) -> None:
    step = find_line("next", "parts", *deck, MATSUM)
    assert step.endswith(f"d2rpick parts --deck {DECK} {MATSUM}")
    copy = str(put(tmp_path / "matsum", Path(MATSUM).read_bytes()))
    step = find_line("next", "parts", *deck, copy)
    assert f"d2rpick parts --deck DECK {copy}" in step
    assert "switching.k" not in step


def test_parts_without_momenta_leads_to_the_plan_of_all_parts() -> None:
    folder = str(SAMPLES / "oscillator")
    step = find_line("next", "parts", folder)
    assert step.endswith(f"plan --part all {folder}")
    assert run("plan", "--part", "all", folder).exit_code == 0


@pytest.mark.parametrize("command", ["suggest", "explore"])
def test_the_step_leads_to_the_better_pair_that_the_answer_names(command: str) -> None:
    question = (command, "--td", "0.08", ENERGY)
    better = re.search(r"td = ([0-9.]+)", find_line("to improve", *question))
    assert better
    expected = shlex.join(["suggest", "--td", better[1], ENERGY])
    assert find_line("next", *question).endswith(expected)


def test_the_star_marks_the_pair_of_the_first_line() -> None:
    text = run("explore", "--td", "0.08", ENERGY).stdout
    (starred,) = re.findall(r"^\*  +([0-9.]+)", text, re.MULTILINE)
    assert starred == "0.08"
    assert run_json("explore", "--td", "0.08", ENERGY)["recommended"]["td"] != 0.08


def test_without_a_pair_the_better_one_is_that_of_its_flight() -> None:
    answer = run_json("suggest", "--td", "0.02", "--part", "1,2", MATSUM)
    best = run_json("suggest", "--part", "1,2", MATSUM)["recommended"]
    assert answer["better_td"]["td"] == best["td"]


def test_a_plan_against_the_verdict_says_so() -> None:
    question = ("plan", "--part", "box", "--min-quality", "poor", MATSUM)
    text = join_wrapped_lines(run(*question).stdout)
    assert text.startswith("do not use: rigid from ")
    assert "is planned only because of --min-quality poor" in text
    # The next step is the same as without the option; it does not lead to the cards.
    assert "-f card" not in find_line("next", *question)


def test_a_study_of_pairs_that_cannot_be_used_fails_as_suggest_does() -> None:
    chosen = ("--part", "box", MATSUM)
    assert run("suggest", *chosen).exit_code == 1
    study = run("study", *chosen)
    assert study.stdout.startswith("do not use")
    assert "level error 0.000" in study.stdout
    assert study.exit_code == 1
    assert run("study", "--exit-zero", *chosen).exit_code == 0
    for command in ("suggest", "study"):
        assert run(command, "--td", "0.37", *chosen).exit_code == 0


def test_the_next_study_leaves_out_what_cannot_be_read(tmp_path: Path) -> None:
    broken = tmp_path / "broken.csv"
    broken.write_text("x,y\n")
    step = find_line("next", "study", ENERGY, str(broken))
    assert step.endswith(ENERGY)
    assert "broken.csv" not in step


@pytest.mark.parametrize("command", ["suggest", "explore", "plan"])
def test_a_tr_that_is_given_leads_to_verify(command: str) -> None:
    refused = run(command, "--tr", "0.01", ENERGY)
    assert refused.exit_code == 2
    assert "d2rpick verify judges a given tr" in refused.stderr


def test_a_cure_is_given_once() -> None:
    times = ("--tr", "0.0001", "--td", "0.1", "--part", "all")
    text = run("verify", *times, str(SAMPLES / "oscillator" / "OSCT01.gz")).stdout
    assert "write the energies more often; write" not in " ".join(text.split())


# A study leads to a better td of all runs, and gives a shared reason once.


def test_a_study_at_a_poor_td_leads_to_the_better_td_of_all_runs() -> None:
    runs = (ENERGY, str(SAMPLES / "energy.glstat"))
    step = find_line("next", "study", "--td", "0.064", *runs)
    better = run_json("suggest", "--td", "0.064", ENERGY)["better_td"]["td"]
    expected = ("d2rpick", "study", "--td", f"{better:.6g}", *runs)
    assert step == f"judge all runs at the better td with {shlex.join(expected)}"
    followed = run(*expected[1:])
    assert followed.stdout.startswith("use ")
    assert "-td" not in find_line("td", *expected[1:])


def test_a_study_gives_reasons_that_differ_only_in_numbers_once(tmp_path: Path) -> None:
    runs = variants.write_variants(tmp_path)
    text = join_wrapped_lines(run("study", "--td", "0.064", *runs).stdout)
    (shared,) = re.findall(r"why (do not use in \d runs?: .*?) next ", text)
    assert shared.startswith(f"do not use in {len(runs)} runs: ")
    assert f"(numbers of {runs[0]})" in shared


# A plan gives its reason in the first lines.


@pytest.mark.parametrize(
    "question",
    [
        (ENERGY,),
        ("--part", "1,2", MATSUM),
        ("--part", "box", MATSUM),
        ("--part", "box", "--min-quality", "poor", MATSUM),
    ],
)
def test_a_plan_gives_the_reason_of_suggest_in_its_first_lines(
    question: tuple[str, ...],
) -> None:
    reason = find_line("why", "suggest", *question)
    assert find_line("why", "plan", *question) == reason
    first_lines = run("plan", *question).stdout.partition("\nnext")[0]
    assert "why" in first_lines


def test_a_flight_that_is_too_short_has_no_other_verdict() -> None:
    question = ("plan", "--min-rigid", "0.3", BOX)
    rows = re.findall(r"^ +\d .*", run(*question).stdout, re.MULTILINE)
    assert rows
    assert all("too short" in row and "use" not in row for row in rows)
    assert "every flight is too short" in find_line("why", *question)
    assert "with --min-rigid 0.3 (another value may allow one)" in find_line(
        "next", *question
    )


# Commands that follow each other do not contradict each other.


@pytest.mark.parametrize("history", [EXCEL, "loaded"])
def test_info_does_not_offer_a_run_that_suggest_refuses(
    history: str, request: pytest.FixtureRequest
) -> None:
    name = history if history == EXCEL else request.getfixturevalue(history)
    assert run_json("suggest", name)["verdict"] == "do not use"
    overview = run_json("info", name)
    assert overview["verdict"] == "do not use"
    assert "gravity or another load" in overview["verdict_reason"]
    assert "write the mass" in find_line("to improve", "info", name)


@pytest.mark.parametrize(("tr", "td"), [("0.02", "0.2"), ("0.05", "0.36")])
def test_the_findings_of_check_name_the_pair_of_the_verdict(
    tr: str, td: str, tmp_path: Path
) -> None:
    card = run("card", "--tr", tr, "--td", td, "--part", "1,2").stdout
    deck = put(tmp_path / "main.k", card)
    question = ("check", str(deck), "--history", MATSUM, "--select", "D2R2")
    report = run_json(*question)
    cures = {window["cure"] for window in report["windows"]}
    (pair,) = {tuple(re.findall(r"t[rd] = ([0-9.]+)", cure)[:2]) for cure in cures}
    assert report["findings"]
    for finding in report["findings"]:
        named = re.search(r"use td = ([0-9.]+) with tr = ([0-9.]+)", finding["message"])
        assert named is None or (named[2], named[1]) == pair


# The page of an answer gives its next step.


@pytest.mark.parametrize(
    "question",
    [
        ("suggest", "--td", "0.064", ENERGY),
        ("suggest", "--td", "0.0687534", ENERGY),
        ("verify", "--tr", "0.0128853", "--td", "0.064", ENERGY),
        ("verify", "--tr", "0.0135867", "--td", "0.0687534", ENERGY),
        ("explore", "--td", "0.064", "--steps", "3", ENERGY),
        ("plan", ENERGY),
        ("study", "--td", "0.064", ENERGY, ENERGY),
        ("parts", "--no-deck", MATSUM),
    ],
    ids=" ".join,
)
def test_a_page_gives_the_next_step_of_its_answer(
    question: tuple[str, ...], tmp_path: Path
) -> None:
    page = tmp_path / "page.html"
    run(*question, "--report", str(page))
    (step,) = re.findall(
        r"<dt>next</dt><dd>(.*?)</dd>", page.read_text(encoding="utf-8")
    )
    written = re.sub(r'<pre class="wrap">(d2rpick .*?)</pre>', r"\1", step)
    assert html.unescape(written) == find_line("next", *question)


# The better pair that verify names has no better pair itself.


@pytest.mark.parametrize(("tr", "td"), [("0.006", "0.08"), ("0.02", "0.064")])
def test_the_better_pair_of_verify_is_good_at_once(tr: str, td: str) -> None:
    verdict = run_json("verify", "--tr", tr, "--td", td, ENERGY)
    named = re.search(r"td = ([0-9.]+)", verdict["cure"])
    assert named
    followed = run_json("suggest", "--td", named[1], ENERGY)
    assert (followed["verdict"], followed["cure"]) == ("use", "")
    # A row of the candidates at this td names the same pair.
    candidates = run_json("suggest", "--td", td, ENERGY)["candidates"]
    best, _, _ = verdict["cure"].partition(", rigid for")
    assert best in {row["cure"] for row in candidates}


def test_no_step_asks_for_an_end_of_the_load_that_the_momentum_denies(
    tmp_path: Path,
) -> None:
    """A block slides with friction all the time."""
    times = [state / 400 for state in range(401)]
    lines = [
        f"{time},{5 + 5 * sin(30 * time) ** 2},{500 - 40 * time},0,0,10"
        for time in times
    ]
    head = "time,internal_energy,x_momentum,y_momentum,z_momentum,mass"
    table = tmp_path / "slide.csv"
    table.write_text("\n".join([head, *lines]))
    for command in ("plan", "suggest", "explore", "info"):
        answer = run(command, str(table))
        text = " ".join((answer.stdout + answer.stderr).split())
        assert "--after" not in text
        assert "no flight is found" in text or "no free flight is found" in text
    given = run("plan", "--after", "0.2", str(table))
    text = " ".join(given.stdout.split())
    assert text.startswith("use with care: make the parts rigid from ")
    assert (
        " why the motion is good only if the parts fly as you stated with --after: the flight is used as given, "
        "although the momentum shows no free flight" in text
    )


@pytest.mark.parametrize(
    "arguments",
    [
        ("verify", "--tr", "0.0127221", "--td", "0.144192", ENERGY),
        ("suggest", ENERGY),
        ("plan", ENERGY),
        ("plan", MATSUM),
        ("plan", *FLYING),
        ("plan", "--margin", "0.4", *FLYING),
        ("suggest", "--landing", "0.1", MATSUM),
        ("suggest", "--td", "0.064", ENERGY),
    ],
    ids=" ".join,
)
@pytest.mark.parametrize("columns", ["60", "100"])
def test_the_next_command_stands_whole_in_one_line_and_beside_no_punctuation(
    arguments: tuple[str, ...],
    columns: str,
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
) -> None:
    """A shell takes the parts of a wrapped command for several commands; on the page, the command is in a box."""
    monkeypatch.setenv("COLUMNS", columns)
    report = tmp_path / "page.html"
    command, *words = arguments
    screen = run(command, "--report", str(report), *words).stdout
    step = re.search(r"^next  .*(?:\n  .*)*", screen, re.MULTILINE)
    assert step
    boxes = re.findall(
        r'<dt>next</dt><dd>[^<]*<pre class="wrap">([^<]*)</pre>([^<]*)',
        report.read_text(),
    )
    assert boxes
    for box, after in boxes:
        assert re.fullmatch(r"( (\(|\w).*)?", html.unescape(after), re.DOTALL)
        lines = [line for line in step[0].split("\n") if html.unescape(box) in line]
        assert len(lines) == 1
        is_alone = lines[0].strip() == html.unescape(box)
        assert is_alone or len(lines[0]) <= int(columns)
