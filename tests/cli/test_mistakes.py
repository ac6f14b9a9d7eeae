"""Mistakes of users are answered with what was found, what was expected, and what to do."""

import shutil
from pathlib import Path

import pytest

from tests.command import BOX, GLSTAT, ROOT, read_refusal, run, run_json
from tests.computed import locate_stored

ENERGY = "sample_data/energy.csv"
MATSUM = "sample_data/rollover_box.matsum"
DECK = "sample_data/rollover_box.k"
DECK_OF_ANOTHER_MODEL = (
    (ROOT / DECK)
    .read_text("utf-8")
    .replace("\nbox\n", "\nfloor\n")
    .replace("\nstep\n", "\nrail\n")
)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ("rule D2R999", "no rule 'D2R999'"),
        ("rule D2R999", "; d2rpick rule lists all"),
        (f"suggest --td 0.2 {ENERGY}", "0 to 0.15; give a time within it"),
        (f"suggest --td 64 {ENERGY}", "give --td 0.064"),
        (f"suggest --td -0.01 {ENERGY}", "; give a time within it"),
        (f"calibrate {DECK}", "a file, but the folder of one run was expected"),
        (
            f"verify --switched {ENERGY} {ENERGY}",
            "both runs have the same energies",
        ),
        (
            "card --tr 0.07 --td 0.06 --part 1",
            "tr < td was expected; give the earlier time as tr",
        ),
        ("card --tr 0,0135 --td 0.2 --part 1", "write it with a decimal point, 0.0135"),
        (f"suggest --part bx {MATSUM}", "did you mean 'box'?"),
        (
            f"suggest --td 0.064 --td-window 0.06 0.07 {ENERGY}",
            "give --td to keep that time, --td-window to have it chosen",
        ),
        (
            f"suggest --td-window 0.06 {ENERGY}",
            "'sample_data/energy.csv' is not a number: two numbers were expected",
        ),
        (
            f"suggest --channel kinetic=total_energy {MATSUM}",
            "unknown quantity 'kinetic' (did you mean 'kinetic_energy'?)",
        ),
        (
            "card --solver ls-dyn --tr 0.06 --td 0.07 --part 1",
            "'ls-dyn' was found (did you mean 'ls-dyna'?)",
        ),
        (
            f"verify --switched {MATSUM} {ENERGY}",
            "these are not two runs of one model with the same loads and velocities: the energies of the two runs",
        ),
        (
            "verify --switched sample_data/oscillator sample_data/oscillator_switched",
            "sample_data/oscillator/OSCT01.gz was not switched: exchange them, so that --switched names",
        ),
        (
            f"verify --switched sample_data/oscillator_switched {MATSUM}",
            "OSCT03.gz: the runs belong to different models: part 1 is 'box' in the reference run",
        ),
        (
            "study nothing/*",
            "nothing/*: no file matches; check the name and the folder",
        ),
    ],
)
def test_a_mistake_is_answered_with_its_cure(arguments: str, message: str) -> None:
    assert message in read_refusal(*arguments.split())


def test_a_table_with_one_column_is_named_so(tmp_path: Path) -> None:
    table = tmp_path / "one.csv"
    table.write_text("internal_energy\n" + "1.5\n" * 20)
    assert "only one column, 'internal_energy', was found" in read_refusal(
        "suggest", str(table)
    )


def test_a_line_of_a_window_names_what_was_expected(tmp_path: Path) -> None:
    done = tmp_path / "done.txt"
    done.write_text("0.1\n")
    message = read_refusal("plan", "--done", str(done), MATSUM)
    assert (
        "done.txt:1: '0.1' was found, but two numbers 'tr td' were expected" in message
    )


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (
            " Livermore Software Technology\n" + " text\n" * 60,
            (
                "this is a listing of LS-DYNA; a table of time and energy was expected; give the "
                "glstat, matsum or binout of the run"
            ),
        ),
        (
            "time,internal_energy\n0,1\n1,2\n",
            "2 states were found, but at least 3 were expected; write the energies more often",
        ),
        (
            "time,internal_energy\n" + "".join(f"{i},{i * i}\n" for i in range(200)),
            "no flight is found in the record, so no td can be chosen: the energy never falls",
        ),
        (
            "Time [ms],Internal energy [mJ]\n" + "".join(f"{i},1\n" for i in range(9)),
            "no column 'Internal' (did you mean 'Internal energy [mJ]'?)",
        ),
    ],
)
def test_a_history_that_cannot_be_used_says_why(
    tmp_path: Path, content: str, message: str
) -> None:
    history = tmp_path / "history"
    history.write_text(content)
    column = ("--energy", "Internal") if "[mJ]" in content else ()
    assert message in read_refusal("suggest", *column, str(history))


def test_energies_that_are_zero_in_all_states_are_named_so(tmp_path: Path) -> None:
    table = tmp_path / "zero.csv"
    table.write_text("time,internal_energy\n" + "".join(f"{i},0\n" for i in range(150)))
    assert (
        "the energy is 0 in all states"
        in run("suggest", "--td", "64", str(table)).stderr
    )


def test_a_step_back_is_named_with_its_times(tmp_path: Path) -> None:
    table = tmp_path / "back.csv"
    times = [*range(100), *range(50, 200)]
    table.write_text(
        "time,internal_energy\n" + "".join(f"{t},{t % 7}\n" for t in times)
    )
    assert (
        f"{table}, state 101: time steps back once, from 99 to 50 (restart)"
        in run("suggest", "--td", "150", str(table)).stderr
    )


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ("# ours\ncolour = 1\n", "d2rpick.toml:2: unknown key 'colour'"),
        (
            "\nmargn = 1\n",
            "d2rpick.toml:2: unknown key 'margn' (did you mean 'margin'?)",
        ),
        ("margin = 'two'\n", "d2rpick.toml:1: margin: 'two' is not a number"),
        (
            "after = 0\n[suggest]\nafter = 0\nmargin = 'two'\n",
            "d2rpick.toml:4: margin: 'two' is not a number",
        ),
        ("[suggest]\ndone = 'x'\n", "d2rpick.toml:2: suggest: unknown key 'done'"),
        ("\n[sugest]\nmargin = 1\n", "d2rpick.toml:2: unknown key 'sugest'"),
    ],
)
def test_a_wrong_setting_is_named_with_its_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, settings: str, message: str
) -> None:
    history = str(Path(ENERGY).resolve())
    (tmp_path / "d2rpick.toml").write_text(settings)
    monkeypatch.chdir(tmp_path)
    line = read_refusal("suggest", "--td", "0.064", history)
    assert message in line
    assert len(line) < 2 * 120 + len(str(tmp_path))


def test_a_missing_include_is_named_without_parts_too(tmp_path: Path) -> None:
    deck = tmp_path / "main.k"
    content = Path(DECK).read_text()
    include = "*KEYWORD\n*INCLUDE\nmissing/mesh.k"
    deck.write_text(content.replace("*KEYWORD", include, 1))
    answer = run("plan", "--deck", str(deck), MATSUM)
    assert "main.k:3: missing/mesh.k was not read: no such file" in answer.stderr


def test_a_record_with_few_states_names_the_interval_to_ask_for(tmp_path: Path) -> None:
    lines = Path(ENERGY).read_text().splitlines()
    coarse = tmp_path / "coarse.csv"
    coarse.write_text("\n".join([lines[0], *lines[1::125]]) + "\n")
    document = run_json("suggest", "--td", "0.064", str(coarse))
    assert document["verdict"] == "do not use"
    states, start = 5, document["flight"]["start"]
    assert (
        f"write the energies every {(0.064 - start) / 200:.2g} or more often"
        in document["cure"]
    )
    assert (
        f"because only {states} states lie in the flight" in document["verdict_reason"]
    )


def test_a_table_beside_the_databases_of_a_folder_is_named(tmp_path: Path) -> None:
    shutil.copy(GLSTAT, tmp_path / "glstat")
    shutil.copy(ENERGY, tmp_path / "a.csv")
    (tmp_path / "other.csv").write_text("x,y\n1,2\n")
    result = run("info", str(tmp_path))
    notes = [line for line in result.stdout.splitlines() if "left out" in line]
    notes += [line for line in result.stderr.splitlines() if "left out" in line]
    assert len(notes) == 1
    assert f"{tmp_path / 'a.csv'} was left out" in notes[0]
    assert "other.csv" not in notes[0]
    named = run("info", str(tmp_path / "a.csv"))
    assert "left out" not in named.stdout + named.stderr


@pytest.mark.parametrize("command", ["suggest", "explore", "plan", "verify"])
def test_a_deck_of_another_model_that_was_given_is_an_objection(
    tmp_path: Path, command: str
) -> None:
    deck = tmp_path / "other.k"
    deck.write_text(DECK_OF_ANOTHER_MODEL)
    options = (
        ["--td-window", "0.3", "0.36"] if command in ("suggest", "explore") else []
    )
    options += ["--steps", "4"] if command == "explore" else []
    options += ["--tr", "0.143139", "--td", "0.345455"] if command == "verify" else []
    arguments = (command, *options, "--part", "1,2")
    alone = run(*arguments, "--no-deck", MATSUM)
    result = run(*arguments, "--deck", str(deck), MATSUM)
    assert (alone.exit_code, result.exit_code) == (0, 1)
    assert result.stdout.endswith(alone.stdout)
    first_line = result.stdout.removesuffix(alone.stdout)
    expected = f"{deck} was not used, because it is not the deck of this run"
    assert " ".join(first_line.split()) == expected
    assert f"exit code 1: {deck} was not used" in result.stderr
    assert run(*arguments, "--deck", str(deck), "--exit-zero", MATSUM).exit_code == 0


@pytest.mark.parametrize("form", ["table", "json", "csv", "markdown", "value", "card"])
def test_a_given_td_is_answered_with_its_verdict_in_every_format(form: str) -> None:
    result = run("suggest", "--td", "0.2", "--part", "box", "-f", form, MATSUM)
    assert result.exit_code == 0
    screen = result.stderr if form == "value" else result.stdout
    assert "do not use" in " ".join(screen.replace("$", "").lower().split())
    strict = ("suggest", "--td", "0.2", "--part", "box", "--min-quality", "fair")
    assert run(*strict, "-f", form, MATSUM).exit_code == 1


def test_a_folder_without_a_run_is_named_by_follow(tmp_path: Path) -> None:
    folder = tmp_path / "nofolder"
    answer = run("follow", "--once", str(folder))
    assert f"{folder}: no file of a run yet; check the name" in answer.stdout


@pytest.mark.parametrize("td", ["0.05", "0.39"])
def test_a_td_outside_the_flight_is_warned_about_once(td: str) -> None:
    answer = run("suggest", "--td", td, "--part", "box", MATSUM)
    warnings = [line for line in answer.stderr.splitlines() if "warning: " in line]
    assert len([line for line in warnings if f"td = {td}" in line]) == 1
    assert "the nearest flight is 0.086 to 0.379; td must lie in it" in answer.stderr


def test_a_folder_without_a_deck_is_not_answered_with_the_advice_to_give_a_file(
    tmp_path: Path,
) -> None:
    """Calibrate reads folders only, so it must not ask for the deck itself."""
    answer = read_refusal("calibrate", str(tmp_path))
    assert "give the folder that contains the deck and the listings" in answer
    assert "give the deck itself" not in answer


def test_a_packed_deck_in_a_folder_is_named(tmp_path: Path) -> None:
    packed = tmp_path / "RUN_0000.rad.gz"
    packed.write_bytes(b"")
    assert f"{packed} is packed); unpack it" in read_refusal("check", str(tmp_path))


def test_a_dry_run_names_every_program_that_is_unknown(tmp_path: Path) -> None:
    deck = str(ROOT / "sample_data/falling_plate/plate_0000.rad")
    question = ("drive", deck, "--part", "1", "--wait", "0.02", "--dry-run")
    folder = ("-o", str(tmp_path / "driven"))
    both = run(*question, *folder).stderr
    assert "no starter and no engine are known" in both
    assert "--starter 'CMD {deck}' and --engine 'CMD {deck}'" in both
    one = run(*question, *folder, "--starter", "starter {deck}").stderr
    assert "no engine is known" in one


def test_a_switched_run_that_ends_rigid_is_not_blamed_on_td() -> None:
    """No td was given, so the cause is that the record ends while the parts are rigid."""
    legs = [locate_stored(f"rollover_r100_T0{leg}.gz") for leg in (1, 2)]
    switched = [word for leg in legs for word in ("--switched", leg)]
    answer = read_refusal("verify", "--part", "box", *switched, BOX)
    assert "while the parts are still rigid" in answer
    assert "give a finished switched run" in answer


def test_a_deck_of_the_other_solver_is_named_with_the_history() -> None:
    deck = str(ROOT / "sample_data/rollover_box.k")
    warnings = run_json("suggest", "--deck", deck, "--part", "box", BOX)["warnings"]
    (message,) = (
        warning["message"]
        for warning in warnings
        if warning["code"] == "deck-of-another-solver"
    )
    assert message.startswith(f"{BOX} was written by Radioss, but {deck} is a deck of")


@pytest.mark.parametrize("command", ["plan", "info"])
def test_too_few_states_are_named_as_the_cause_that_no_flight_is_seen(
    command: str, tmp_path: Path
) -> None:
    """Plan must not send the user to info, and info to plan, while both know that the output is too coarse."""
    table = tmp_path / "coarse.csv"
    rows = [f"{0.01 * i},{1 + i},0,0,{-7 * i * i}" for i in range(21)]
    head = "time,internal_energy,x_momentum,y_momentum,z_momentum"
    table.write_text("\n".join([head, *rows]) + "\n")
    text = " ".join(run(command, str(table)).stdout.split())
    assert "write the states every 0.001 or more often" in text
    assert "because 21 states may miss a flight" in text
