"""Commands whose result is a file, a deck or weights name the next command; each screen says what it rests on."""

import re
import shlex
import shutil
from pathlib import Path

import pytest

from d2rpick.report.formats import RepeatedQuestion
from d2rpick.report.next_step import name_deck_of_run
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

SAMPLES = ROOT / "sample_data"
DECK = str(SAMPLES / "rollover_box.k")
PLATE = str(SAMPLES / "falling_plate" / "plate_0000.rad")
CALIBRATED = str(SAMPLES / "flying_box")
TIMES = ("--tr", "0.0127221", "--td", "0.144192")
POOR = ("--tr", "0.02", "--td", "0.064")
OF_DECK = ("--part", "recommended", "--deck", DECK)
SWITCHED = str(SAMPLES / "oscillator_switched")
OSCILLATOR = str(SAMPLES / "oscillator")


def find_command(text: str, name: str) -> list[str]:
    """Return the words of the command ``name`` that a text contains, up to a hint or the end of the clause."""
    match = re.search(
        rf"d2rpick ({name} .*?)(?: \(|, and |, then |; |$)", text, re.MULTILINE
    )
    assert match, text
    return shlex.split(match[1])


def test_the_step_after_a_card_checks_the_deck_with_it(tmp_path: Path) -> None:
    card = run("card", *TIMES, "--part", "1", "--history", ENERGY)
    main = tmp_path / "main.k"
    main.write_text(
        (SAMPLES / "rollover_box.k").read_text().replace("*END", card.stdout + "*END")
    )
    words = find_command(card.stderr, "check")
    step = run(*(str(main) if word == "DECK" else word for word in words))
    assert "part 1: rigid from 0.0127221 to 0.144192" in step.stdout
    assert "judge the times by the reference run" not in step.stdout


def test_the_step_after_a_card_names_a_deck_that_was_given() -> None:
    for command in ("plan", "suggest"):
        text = run(command, "-f", "card", *OF_DECK, MATSUM).stderr
        (step,) = (line for line in text.splitlines() if line.startswith("next: "))
        assert step.endswith(f"d2rpick check --history {MATSUM} {DECK}")


def test_after_a_card_that_cannot_be_used_other_times_are_chosen() -> None:
    card = run("card", *POOR, "--part", "1", "--history", ENERGY)
    step = run(*find_command(card.stderr, "suggest"))
    assert "next: choose other times with" in card.stderr
    assert step.stdout.startswith("use  ")


@pytest.mark.parametrize("quiet", [False, True])
def test_the_step_after_a_card_is_no_part_of_it(*, quiet: bool) -> None:
    card = run("card", *TIMES, "--part", "1", *["-q"] * quiet)
    assert "next" not in card.stdout
    assert ("next: " in card.stderr) is not quiet


def test_the_verdict_stands_at_the_head_of_a_card() -> None:
    lines = run("card", *TIMES, "--part", "1", "--history", ENERGY).stdout.splitlines()
    # The path of the history decides where the lines are wrapped.
    head = " ".join(line.removeprefix("$").strip() for line in lines[1:4])
    assert head.startswith("Verdict according to")
    assert "(internal_energy): use" in head


def test_the_step_after_an_extraction_judges_the_table(tmp_path: Path) -> None:
    table = str(tmp_path / "box.csv")
    result = run("extract", "--part", "box", MATSUM, "-o", table)
    step = run(*find_command(result.stderr, "suggest"))
    assert step.stdout.startswith("do not use")


def test_the_step_after_a_first_deck_checks_it(tmp_path: Path) -> None:
    folder = str(tmp_path / "first")
    result = run("first", "--part", "1", "--wait", "0.02", PLATE, "-o", folder)
    step = run(*find_command(result.stdout, "check"))
    assert result.stdout.startswith("next  ")
    assert "switches itself" in step.stdout
    assert find_command(result.stdout, "follow")[:2] == ["follow", folder]


@pytest.mark.parametrize(("program", "code"), [("ls", 0), ("no-such-solver", 1)])
def test_a_dry_run_says_whether_the_run_can_be_started(
    program: str, code: int, tmp_path: Path
) -> None:
    folder = str(tmp_path / "driven")
    commands = ("--starter", f"{program} {{deck}}", "--engine", f"{program} {{deck}}")
    question = ("drive", PLATE, "--part", "1", "--wait", "0.02", "-o", folder)
    result = run(*question, "--dry-run", *commands)
    assert result.exit_code == code
    assert (f"there is no program '{program}'" in result.stdout) is bool(code)
    assert find_command(result.stdout, "drive") == [*question, *commands]
    assert "switches  1 part by" in result.stdout


def test_calibrate_says_whether_to_use_the_weights(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    screen = run("calibrate", CALIBRATED).stdout
    text = join_wrapped_lines(screen)
    assert text.startswith("use weights that fit the CPU time of 2 engine runs")
    monkeypatch.chdir(tmp_path)
    assert run(*find_command(screen, "calibrate")).exit_code == 0
    judged = run("parts", "--weights", "weights.toml", "--deck", DECK, MATSUM)
    # The weights are read; they have none for the shells of this other model, so the built-in one is scaled.
    assert re.search("^saves +about", judged.stdout, re.MULTILINE)
    text = join_wrapped_lines(judged.stderr)
    assert "weights.toml has no weight for Belytschko-Tsay" in text


def test_weights_that_fit_badly_are_used_with_care(tmp_path: Path) -> None:
    for name in ("BOX_0000.rad", "BOX_0001.rad", "BOX_0002.rad", "BOX_0001.out"):
        (tmp_path / name).write_bytes((SAMPLES / "flying_box" / name).read_bytes())
    slow = (SAMPLES / "flying_box" / "BOX_0002.out").read_text()
    (tmp_path / "BOX_0002.out").write_text(slow.replace("E-01", "E+00"))
    text = join_wrapped_lines(run("calibrate", str(tmp_path)).stdout)
    misfit = run_json("calibrate", str(tmp_path))["misfit"]
    assert misfit > 0.1
    assert text.startswith("use with care weights that fit")
    assert "to improve repeat the runs" in text


def test_a_written_deck_has_one_next_step(tmp_path: Path) -> None:
    folder = str(tmp_path / "switched")
    text = run("plan", *OF_DECK, "--write-deck", folder, MATSUM).stdout
    assert re.findall(r"^next\b", text, re.MULTILINE) == ["next"]
    words = find_command(join_wrapped_lines(text), "verify")
    assert words[:3] == ["verify", "--switched", folder]


def test_a_plan_without_a_window_says_that_no_deck_is_written(tmp_path: Path) -> None:
    folder = tmp_path / "switched"
    options = ("--part", "box", "--deck", DECK, "--write-deck", str(folder))
    text = run("plan", *options, MATSUM).stdout
    assert (
        f"no deck was written to {folder}, because no window can be used"
        in join_wrapped_lines(text)
    )
    assert not folder.exists()


def test_a_plan_without_a_window_has_no_empty_column() -> None:
    lines = run("plan", "--part", "box", MATSUM).stdout.splitlines()
    (head,) = (line for line in lines if "switch in" in line)
    assert not {"tr", "td", "error"} & set(head.split())


def test_the_page_of_a_comparison_is_not_asked_for_twice(tmp_path: Path) -> None:
    page = str(tmp_path / "verify.html")
    question = ("verify", "--switched", SWITCHED, OSCILLATOR)
    without = run(*question).stdout
    with_page = join_wrapped_lines(run(*question, "--report", page).stdout)
    assert "--report verify.html" in without
    assert "--report" not in with_page
    assert f"{page} contains the comparison" in with_page


@pytest.mark.parametrize(
    "question", [("--part", "box", BOX), ("--energy", "boxIE_J", ROLLOVER)]
)
def test_a_pair_whose_comparison_may_fail_says_so(question: tuple[str, ...]) -> None:
    answer = run_json("suggest", *question)
    low, high = answer["mean_energy_low"], answer["mean_energy_high"]
    assert answer["verdict"] == "use with care"
    assert not 0.7 <= low <= high <= 1.3
    assert "verify accepts only 70% to 130%" in answer["expected_after_td"]
    assert answer["vibration_alone"] == "poor"
    assert answer["verdict_reason"].endswith(": use only the motion")


def test_a_pair_within_the_limits_names_none() -> None:
    assert "accepts" not in run_json("suggest", ENERGY)["expected_after_td"]


def test_a_comparison_beside_its_prediction_names_both_alike() -> None:
    text = run("verify", "--switched", SWITCHED, OSCILLATOR).stdout
    joined = join_wrapped_lines(text)
    assert (
        "mean energy after td 108% of the reference run (limits 70% to 130%)" in joined
    )
    assert "predicted mean energy after td 108% of the reference run" in joined
    assert "1000 times the energy right after td" in joined


def test_the_cards_and_the_parts_say_where_the_time_step_limit_comes_from() -> None:
    card = run("card", *TIMES, "--part", "1").stdout
    rigid = float(TIMES[3]) - float(TIMES[1])
    assert f"{float(f'{rigid / 1000:.2g}'):.1e}".replace("e-04", "e-4") in card
    assert "DTMAX is 1/1000 of the rigid time" in card
    given = run("card", *TIMES, "--part", "1", "--step-cap", "1e-5").stdout
    assert "DTMAX is the given --step-cap" in given
    parts = join_wrapped_lines(run("parts", "--deck", DECK, MATSUM).stdout)
    assert "the cards limit it to 1/1000 of the rigid time" in parts


@pytest.mark.parametrize(
    ("arguments", "cure"),
    [
        (("first", "--deck", DECK), "Give the deck by its name alone"),
        (("suggest", "--history", ENERGY), "Give the history by its name alone"),
        (("suggest", "--part", "1", "2", MATSUM), "as in --part 1,2"),
        (("info", CALIBRATED), "it contains the deck BOX_0000.rad: run it"),
    ],
)
def test_a_wrong_word_is_answered_with_the_right_one(
    arguments: tuple[str, ...], cure: str
) -> None:
    result = run(*arguments)
    assert result.exit_code == 2
    assert cure in result.stderr


def test_the_error_of_a_table_has_the_name_of_the_first_line() -> None:
    residuals = run("explore", ENERGY).stdout
    levels = run("explore", "--part", "box", MATSUM).stdout
    assert re.search(r"tr +residual +kinetic fraction", residuals)
    assert re.search(r"tr +level shortfall", levels)
    assert "level shortfall 0." in levels
    study = run("study", "--td", "0.064", "--", ENERGY, ENERGY).stdout
    assert "residual at common tr" in study


@pytest.mark.parametrize("td", ["0.36", "0.355"])
def test_a_better_pair_is_named_alike_even_if_its_residual_is_large(td: str) -> None:
    """At this td most of the vibration energy is kinetic; the pair at the next peak is wrong by 60% only."""
    question = ("--part", "flying", MATSUM)
    suggested = run_json("suggest", "--td", td, *question)
    times = ("--tr", repr(suggested["recommended"]["tr"]), "--td", td)
    judged = run_json("verify", *times, *question)
    explored = run("explore", "--td", td, *question).stdout
    (studied,) = run_json("study", "--td", td, *question)["runs"]
    cure = suggested["cure"]
    assert cure.startswith("use tr = ")
    assert cure.endswith(": vibration error 60%")
    assert judged["cure"] == cure
    assert studied["cure"] == cure
    assert f"to improve {cure}" in join_wrapped_lines(explored)


def test_a_plan_without_a_flight_says_so_first(tmp_path: Path) -> None:
    table = tmp_path / "rise.csv"
    rows = "".join(f"{i / 1000},{i * i / 1e3}\n" for i in range(200))
    table.write_text(f"time,internal_energy\n{rows}")
    text = run("plan", str(table)).stdout
    assert text.startswith(
        "do not use any window of this run: no flight is found in the record\nnext "
    )
    step = f"or see what the run has to write with d2rpick info {table}"
    assert step in join_wrapped_lines(text)


def test_a_record_of_one_state_is_too_short_for_a_flight(tmp_path: Path) -> None:
    table = tmp_path / "short.csv"
    table.write_text("time,internal_energy,kinetic_energy\n0,1,2\n")
    text = join_wrapped_lines(run("info", str(table)).stdout)
    assert "why the files contain 1 state, but at least 3 were expected" in text


def test_a_card_of_parts_that_may_share_nodes_says_how_to_merge_them() -> None:
    history = ("--history", str(SAMPLES / "rollover_box.glstat"))
    times = ("--tr", "0.123689", "--td", "0.37", "--part", "1,2")
    apart = run("card", *times, *history).stderr
    merged = run("card", *times, "--merge", "1", *history).stderr
    # The history has a deck beside it, which shows whether the parts share nodes.
    assert (
        f"next: if these parts share nodes, print the card again with --deck {DECK}"
        in apart
    )
    assert "next: add these cards to the main deck" in merged


def test_a_table_says_which_parts_its_energy_must_contain() -> None:
    table = str(SAMPLES / "rollover_box.csv")
    of_table = join_wrapped_lines(run("suggest", table).stdout)
    of_parts = run("suggest", "--part", "box", MATSUM).stdout
    assert "all parts that vibrate with them; the table does not name" in of_table
    assert "assumes" not in of_parts


def test_switches_without_a_time_are_not_sent_to_a_history(tmp_path: Path) -> None:
    main = tmp_path / "main.k"
    switch = "*DEFORMABLE_TO_RIGID\n         1\n"
    main.write_text(
        (SAMPLES / "rollover_box.k").read_text().replace("*END", f"{switch}*END")
    )
    step = run("check", str(main)).stdout
    assert "not judged by time" in step
    assert "--history HISTORY" not in step
    assert "d2rpick rule D2R302" in step


@pytest.mark.slow
def test_the_comparison_of_a_fall_without_vibration_gets_the_times_of_its_window(
    tmp_path: Path,
) -> None:
    """The energies of such a run are round-off whether the parts are rigid or not, so they do not show the times."""
    history = str(tmp_path / "reference.matsum")
    fall = ("rollover", "--drop", "0.2", "--tilt", "25", "--mesh", "4")
    run(*fall, "-o", history)
    folder = str(tmp_path / "switched")
    deck = ("--deck", str(SAMPLES / "rollover_box.k"), "--write-deck", folder)
    plan = run("plan", "--part", "flying", *deck, history).stdout
    words = find_command(join_wrapped_lines(plan), "verify")
    assert words[:5] == ["verify", "--tr", "0", "--td", "0.197104"]
    # The whole deck also writes its output less often than check expects, which would be the next step.
    cards = put(tmp_path / "cards.k", (tmp_path / "switched/switches.k").read_bytes())
    checked = run("check", "-q", str(cards), "--history", history).stdout
    again = find_command(join_wrapped_lines(checked), "verify")
    assert again[:5] == words[:5]


def test_the_deck_in_the_folder_of_a_run_is_named_in_the_next_command(
    tmp_path: Path,
) -> None:
    """The deck has another name than the history, and was read; before, the command asked for it."""
    folder = tmp_path / "run"
    folder.mkdir()
    shutil.copy(MATSUM, folder / "matsum")
    shutil.copy(ROOT / "sample_data" / "rollover_box.k", folder / "main.k")
    deck = name_deck_of_run(RepeatedQuestion(files=(str(folder),)))
    assert (deck.name, deck.hint) == (str(folder / "main.k"), "")
