"""The effects of the commands and their options for a user."""

import os
import shlex
import shutil
import subprocess
import sys
from pathlib import Path
from subprocess import CompletedProcess
from typing import Any

import numpy as np
import pytest

from d2rpick import __version__
from d2rpick.cli import COMMANDS
from d2rpick.histories.opening import Selection
from tests import paper
from tests.command import (
    ENERGY,
    GLSTAT,
    MATSUM,
    OSCILLATOR,
    ROLLOVER,
    ROOT,
    TIME_LIMIT,
    join_wrapped_lines,
    run,
    run_json,
)
from tests.reading import read_history

SUGGEST = ("suggest", "--td", "0.064")
# Commands whose examples compute runs, or plan and compare many.
SLOW = ("rollover", "reproduce", "plan", "study", "follow", "explore")
# A page based on the level alone takes longer, because it contains the windows of acceptable tr of every td.
BY_VIBRATION = dict.fromkeys(("D2RPICK_SUGGEST_NO_VERIFY", "D2RPICK_VERIFY_NO_VERIFY"))
ROLLING = ("suggest", "--td", "0.37", "--energy", "boxIE_J", ROLLOVER)

GIVEN = {"stiffness": "660e3", "mass": "31.4", "beta": "2", "alpha": "50", "v0": "6"}


def run_program(*args: str, **options: Any) -> CompletedProcess[str]:
    """Run ``python -m d2rpick`` as a separate process."""
    command = [sys.executable, "-m", "d2rpick", *args]
    popen_options = {
        "capture_output": True,
        "text": True,
        "cwd": ROOT,
        "timeout": TIME_LIMIT,
        **options,
    }
    return subprocess.run(command, check=False, **popen_options)


# The purpose of the tool: recommendations that hold.


@pytest.mark.parametrize(("source", "digits"), [(ENERGY, 1e-10), (GLSTAT, 1e-5)])
def test_the_published_record_gets_the_published_answer(
    source: str, digits: float
) -> None:
    document = run_json(*SUGGEST, source)
    assert document["basis"] == "oscillator"
    assert document["recommended"] == {
        "tr": pytest.approx(paper.CROSSINGS[2][0] / 1e3, rel=digits),
        "td": 0.064,
    }
    assert document["kinetic_share"] == pytest.approx(paper.KINETIC_SHARE, rel=digits)
    assert document["better_td"]["td"] == pytest.approx(paper.BETTER_TD, rel=digits)
    assert document["better_td"]["tr"] == pytest.approx(paper.BETTER_TR, rel=digits)
    assert document["better_td"]["residual"] == pytest.approx(0, abs=10 * digits)
    assert [(w["code"], "92%" in w["message"]) for w in document["warnings"]] == [
        ("poor-td", True)
    ]


def test_what_a_pair_keeps_and_how_good_it_is_are_two_things() -> None:
    pair = ("verify", "--tr", "0.0128853", "--td", "0.064")
    poor = run(*pair, ENERGY)
    assert poor.exit_code == 1
    text = join_wrapped_lines(poor.stdout)
    assert text.startswith(
        "do not use tr = 0.0128853, td = 0.064 why the vibration after td is wrong by 96%, since 92% of"
    )
    assert "to improve use tr = 0.0135867, td = 0.0687534: vibration error 0.0%" in text
    assert "motion good vibration poor" in text
    assert run(*pair, "--min-quality", "poor", ENERGY).exit_code == 0
    alone = run(*pair, "--no-verify", ENERGY)
    assert alone.exit_code == 1
    assert join_wrapped_lines(alone.stdout).startswith(
        "do not use tr = 0.0128853, td = 0.064 why it is unknown whether the parts are deformed in "
        "the same direction at tr and td"
    )


def test_the_better_pair_verifies_and_the_crossing_before_it_of_opposite_sign_does_not() -> (
    None
):
    good = run("verify", "--tr", "0.0135867", "--td", "0.0687534", ENERGY)
    assert good.exit_code == 0
    assert good.stdout.startswith("use     tr = 0.0135867, td = 0.0687534\nwhy     ")
    bad = run_json("verify", "--tr", "0.0122659", "--td", "0.064", ENERGY)
    assert (bad["verified"], bad["tr_ok"], bad["sign_match"]) == (False, False, False)
    assert any("opposite direction" in reason for reason in bad["reasons"])


# Options of suggest and verify.


def test_an_oscillator_can_be_given_instead_of_identified() -> None:
    document, identified = (
        run_json(*SUGGEST, *OSCILLATOR, ENERGY),
        run_json(*SUGGEST, ENERGY),
    )
    assert (document["oscillator"]["source"], identified["oscillator"]["source"]) == (
        "given",
        "identified",
    )
    assert document["oscillator"]["omega"] == pytest.approx(paper.OMEGA_2, rel=1e-13)
    assert document["kinetic_share"] == pytest.approx(
        identified["kinetic_share"], rel=1e-9
    )
    times = [
        [c["tr"] for c in answer_document["candidates"]]
        for answer_document in (document, identified)
    ]
    np.testing.assert_allclose(times[0], times[1], rtol=1e-9)
    assert [c["acceptable"] for c in document["candidates"]] == [
        c["acceptable"] for c in identified["candidates"]
    ]


def test_beta_is_the_ratio_of_the_masses() -> None:
    by_mass = shlex.split(
        "--stiffness 660e3 --mass 31.4 --frame-mass 15.7 --alpha 50 --v0 6"
    )
    assert (
        run_json(*SUGGEST, *by_mass, ENERGY)["candidates"]
        == run_json(*SUGGEST, *OSCILLATOR, ENERGY)["candidates"]
    )


def test_an_oscillator_that_is_not_that_of_the_record_is_not_relied_on() -> None:
    document = run_json(*SUGGEST, *OSCILLATOR[:-1], "7", ENERGY)
    assert (document["basis"], document["oscillator"]["describes_record"]) == (
        "energy",
        False,
    )
    assert document["oscillator"]["reason"]


def test_a_fit_window_gives_the_same_oscillator_from_a_part_of_the_record() -> None:
    document = run_json(*SUGGEST, "--fit-window", "0.02", "0.1", ENERGY)
    assert document["oscillator"]["omega"] == pytest.approx(paper.OMEGA_2, rel=1e-9)
    assert document["recommended"]["tr"] == pytest.approx(
        paper.CROSSINGS[2][0] / 1e3, rel=1e-9
    )


def test_without_verification_only_the_energy_level_counts() -> None:
    document = run_json(*SUGGEST, "--no-verify", ENERGY)
    assert (document["basis"], document["oscillator"], document["kinetic_share"]) == (
        "energy",
        None,
        None,
    )
    assert {c["sign_match"] for c in document["candidates"]} == {None}


@pytest.mark.parametrize("options", [("--after", "0.02"), ("--margin", "0.02")])
def test_nothing_before_the_end_of_the_load_and_the_margin_is_acceptable(
    options: tuple[str, str],
) -> None:
    document = run_json(*SUGGEST, *options, ENERGY)
    assert document["recommended"]["tr"] == pytest.approx(
        paper.CROSSINGS[3][0] / 1e3, rel=1e-9
    )
    early = [c["notes"][0] for c in document["candidates"] if c["tr"] <= 0.02]
    assert early
    assert all("end of the load" in note for note in early)
    assert (
        run_json("verify", "--tr", "0.0128853", "--td", "0.064", *options, ENERGY)[
            "tr_ok"
        ]
        is False
    )


def test_after_moves_the_start_of_the_flight_and_says_so() -> None:
    flight = run_json(*SUGGEST, "--after", "0.02", ENERGY)["flight"]
    assert (flight["start"], flight["source"]) == (0.02, "given")


@pytest.mark.parametrize("tolerance", [0.001, 0.05, 0.2])
def test_the_tolerance_bounds_what_is_acceptable(tolerance: float) -> None:
    candidates = run_json(*ROLLING, "--no-verify", "--tolerance", str(tolerance))[
        "candidates"
    ]
    assert max(c["level_error"] for c in candidates if c["acceptable"]) <= tolerance
    assert all(
        c["level_error"] <= tolerance for c in candidates if c["kind"] == "extremum"
    )


@pytest.mark.parametrize(
    ("limit", "measure"),
    [
        (("--max-kinetic-share", "0.5"), "kinetic fraction"),
        (("--max-residual", "0.9"), "residual"),
    ],
)
def test_a_limit_turns_a_poor_pair_into_an_objection(
    limit: tuple[str, str], measure: str
) -> None:
    document = run_json(*SUGGEST, *limit, ENERGY)
    assert document["recommended"] is None
    assert document["better_td"] is not None
    assert any(
        measure in w["message"] and w["code"] == "no-candidate"
        for w in document["warnings"]
    )
    judged = run_json("verify", "--tr", "0.0128853", "--td", "0.064", *limit, ENERGY)
    assert (judged["verified"], judged["tr_ok"]) == (False, True)
    assert any(measure in reason for reason in judged["reasons"])
    assert run_json(*SUGGEST, limit[0], "0.99", ENERGY)["recommended"] is not None


def test_limit_shortens_the_table_but_not_json_and_csv() -> None:
    result = run(*SUGGEST, "-v", "--limit", "2", ENERGY).stdout
    *rows, last_line = result.partition(" verdict\n")[2].splitlines()
    ranks = [
        row.lstrip("* ").split()[0] for row in rows if row.lstrip("* ")[0].isdigit()
    ]
    assert ranks == ["1", "2"]
    assert last_line == "... and 8 more (--limit)"
    assert len(run_json(*SUGGEST, "--limit", "2", ENERGY)["candidates"]) == 10
    assert (
        len(run(*SUGGEST, "--limit", "2", "-f", "csv", ENERGY).stdout.splitlines())
        == 11
    )


def test_columns_are_chosen_by_name_or_number_and_energies_added() -> None:
    by_name = run_json(
        *SUGGEST, "--time", "time", "--energy", "internal_energy", ENERGY
    )
    by_number = run_json(*SUGGEST, "--time", "1", "--energy", "6", ENERGY)
    assert by_name["candidates"] == by_number["candidates"]
    assert by_name["history"]["channel"] == "internal_energy"
    total = run_json(*SUGGEST, "--energy", "6", "--energy", "7", ENERGY)
    both_energies = read_history([ENERGY], Selection(energy=("6", "7")))
    assert total["history"]["channel"] == "internal_energy + kinetic_energy"
    assert total["energy_td"] == pytest.approx(both_energies.energy_at(0.064), rel=1e-6)


# replay.


@pytest.mark.parametrize("suffix", ["csv", "glstat"])
def test_a_replayed_history_read_back_has_the_same_answer(
    suffix: str, tmp_path: Path
) -> None:
    name = str(tmp_path / f"again.{suffix}")
    written = run("replay", *OSCILLATOR, "--t-end", "0.15", "--dt", "1e-4", "-o", name)
    assert (written.exit_code, written.stdout, written.stderr) == (0, "", "")
    again, sample = (
        run_json(*SUGGEST, name),
        run_json(*SUGGEST, GLSTAT if suffix == "glstat" else ENERGY),
    )
    assert again["history"]["format"] == suffix
    assert again["recommended"]["tr"] == pytest.approx(
        sample["recommended"]["tr"], rel=1e-10
    )


def test_replay_writes_the_motion_through_both_switches() -> None:
    result = run(
        "replay",
        *OSCILLATOR,
        *shlex.split("--tr 0.006 --td 0.08 --t-end 0.15 --dt 1e-3"),
    )
    head, *rows = result.stdout.splitlines()
    assert head == "time,z,y,vz,vy,internal_energy,kinetic_energy"
    table = {
        float(row.split(",")[0]): [float(cell) for cell in row.split(",")]
        for row in rows
    }
    assert len(table) == 151
    for expected in paper.SWITCHED_6_80:
        np.testing.assert_allclose(table[expected[0]][:6], expected, rtol=1e-11)


def test_a_replay_that_starts_in_the_middle_goes_on_as_the_whole_does() -> None:
    def motion(*args: str) -> np.ndarray:
        text = run("replay", *OSCILLATOR[:-2], *args, "--dt", "1e-3").stdout
        return np.array(
            [[float(cell) for cell in row.split(",")] for row in text.splitlines()[1:]]
        )

    whole = motion("--v0", "6", "--tr", "0.03", "--td", "0.05", "--t-end", "0.1")
    _, z, y, vz, vy, *_ = whole[20].tolist()
    start = [
        f"--{name}={value!r}"
        for name, value in (("z0", z), ("y0", y), ("vz0", vz), ("vy0", vy))
    ]
    later = motion(*start, "--tr", "0.01", "--td", "0.03", "--t-end", "0.08")
    np.testing.assert_allclose(later[:, 1:], whole[20:, 1:], rtol=1e-10, atol=1e-12)


def test_velocity_of_the_frame_has_two_names() -> None:
    other_options = (*OSCILLATOR[:-2], "--t-end", "0.01", "--dt", "1e-3")
    assert (
        run("replay", *other_options, "--v0", "6").stdout
        == run("replay", *other_options, "--vz0", "6", "--y0", "0").stdout
    )


def test_what_stdout_is_given_and_what_a_file_is_given_is_the_same(
    tmp_path: Path,
) -> None:
    args = (
        "replay",
        *OSCILLATOR,
        "--t-end",
        "0.01",
        "--dt",
        "1e-3",
        "--write-as",
        "glstat",
    )
    run(*args, "-o", str(tmp_path / "motion.csv"))
    assert (tmp_path / "motion.csv").read_text() == run(*args).stdout


@pytest.mark.parametrize("line", [line for line in (ROOT / "sample_data/README.md").read_text().split("`")
                                  if line.startswith("d2rpick replay")])  # fmt: skip
@pytest.mark.parametrize("name", ["energy.csv", "energy.glstat"])
def test_the_sample_data_is_what_the_command_beside_it_writes(
    line: str, name: str, here: Path
) -> None:
    (here / "sample_data").mkdir()
    args = shlex.split(line.replace("energy.csv", name))
    assert run(*args[1:]).exit_code == 0
    fresh, stored_history = (
        read_history([str(folder / "sample_data" / name)]) for folder in (Path(), ROOT)
    )
    np.testing.assert_allclose(fresh.time, stored_history.time, rtol=1e-14)
    np.testing.assert_allclose(
        fresh.energy,
        stored_history.energy,
        rtol=1e-5 if "glstat" in name else 1e-11,
        atol=1e-13,
    )


# The program.


def test_the_module_runs_as_a_program() -> None:
    result = run_program("--version")
    assert (result.returncode, result.stderr) == (0, "")
    assert result.stdout.splitlines()[0].split()[-1] == __version__


def test_a_reader_that_has_seen_enough_ends_the_program_silently() -> None:
    read_end, write_end = os.pipe()
    os.close(read_end)
    args = [sys.executable, "-m", "d2rpick", *SUGGEST, "-q", ENERGY]
    result = subprocess.run(
        args,
        stdout=write_end,
        stderr=subprocess.PIPE,
        check=False,
        cwd=ROOT,
        timeout=TIME_LIMIT,
    )
    os.close(write_end)
    assert (result.returncode, result.stderr) == (141, b"")


def test_debug_shows_the_traceback_and_the_message() -> None:
    result = run(*SUGGEST, "--debug", "absent.csv")
    assert result.exit_code == 2
    assert result.stderr.startswith("Traceback")
    assert result.stderr.splitlines()[-1].startswith("d2rpick: absent.csv: ")


def test_options_come_from_the_environment_too() -> None:
    result = run(
        "suggest",
        ENERGY,
        env={"D2RPICK_SUGGEST_TD": "0.064", "D2RPICK_SUGGEST_OUTPUT_FORMAT": "value"},
    )
    assert float(result.stdout) == pytest.approx(paper.CROSSINGS[2][0] / 1e3, rel=1e-10)
    assert run("suggest", ENERGY, env={"D2RPICK_SUGGEST_TD": "soon"}).exit_code == 2


@pytest.mark.slow
@pytest.mark.parametrize(
    ("command", "args", "env"),
    [
        ("suggest", "--td 0.064", {"td_window": "0.06 0.07"}),
        ("suggest", "--td-window 0.06 0.07", {"td": "0.064"}),
        ("suggest", "--td 0.064 --no-verify", {"fit_window": "0 0.1", **GIVEN}),
        ("suggest", "--td 0.064 --fit-window 0 0.1", {"no_verify": "1"}),
        ("study", "--td 0.064", {"td_window": "0.06 0.07"}),
        ("study", "--td-window 0.06 0.07", {"td": "0.064"}),
        ("study", "--td 0.064 --jobs 1", {"scheduler": "tcp://127.0.0.1:1"}),
        ("explore", "--td-window 0.06 0.07 --steps 2 --energy 2", {"part": "1"}),
        ("verify", "--tr 0.0128853 --td 0.064 --stiffness 660e3 --mass 31.4 --frame-mass 15.7 --alpha 50 --v0 6",
         {"beta": "3", "no_verify": "1", "fit_window": "0 0.1"}),
        ("plan", "--energy internal_energy", {"part": "1"}),
    ],
)  # fmt: skip
def test_an_option_overrules_those_in_the_environment_that_it_excludes(
    command: str, args: str, env: dict[str, str]
) -> None:
    variables = {
        f"D2RPICK_{command}_{name}".upper(): value for name, value in env.items()
    }
    plain, overruled = (
        run(command, *args.split(), "-f", "csv", ENERGY, env=environment)
        for environment in ({}, variables)
    )
    assert overruled.exit_code in (0, 1), overruled.stderr
    assert (overruled.exit_code, overruled.stdout) == (plain.exit_code, plain.stdout)


def test_options_that_exclude_each_other_are_refused_where_both_come_from_the_environment() -> (
    None
):
    both_variables = {
        "D2RPICK_SUGGEST_TD_WINDOW": "0.06 0.07",
        "D2RPICK_SUGGEST_TD": "0.064",
    }
    assert run("suggest", ENERGY, env=both_variables).exit_code == 2


@pytest.mark.parametrize("source", [ENERGY, GLSTAT])
def test_a_history_comes_through_standard_input(source: str) -> None:
    data = Path(source).read_bytes()
    piped = run(*SUGGEST, "-f", "csv", "-", stdin=data)
    assert piped.stdout == run(*SUGGEST, "-f", "csv", source).stdout


def test_without_a_command_the_help_is_an_error_message() -> None:
    result = run()
    assert (result.exit_code, result.stdout) == (2, "")
    assert result.stderr == run("--help").stdout


@pytest.mark.parametrize("command", COMMANDS)
def test_the_shell_completes_the_names_of_commands(command: str) -> None:
    env = {
        "_D2RPICK_COMPLETE": "bash_complete",
        "COMP_WORDS": f"d2rpick {command[:4]}",
        "COMP_CWORD": "1",
    }
    assert run(env=env).stdout.strip() == f"plain,{command}"


@pytest.mark.parametrize(
    "words",
    [
        "suggest --td 0.1 ener", "verify --switched ener", "info ener", "extract ener -o ener", "check swi",
        "check --history ener", "card --history ener", "suggest --report rep", "suggest --plot pic",
        "replay --plot pic", "reproduce --output-dir pap", "reproduce --solver osc",
    ],
)  # fmt: skip
def test_the_shell_completes_the_names_of_files(words: str) -> None:
    typed = words.split()
    env = {
        "_D2RPICK_COMPLETE": "bash_complete",
        "COMP_WORDS": f"d2rpick {words}",
        "COMP_CWORD": f"{len(typed)}",
    }
    assert run(env=env).stdout.strip() == f"file,{typed[-1]}"


# Help.


def list_examples(command: str) -> list[list[str]]:
    """Return the arguments of the examples at the end of a command's help."""
    text = run(*filter(None, [command]), "--help").stdout
    _, end = text.split("\n  Examples:\n")
    lines = end.replace("\\\n", " ").strip("\n").split("\n")
    calls = [shlex.split(line) for line in lines]
    assert all(call[0] == "d2rpick" for call in calls), end
    return [call[1:] for call in calls]


@pytest.mark.usefixtures("by_level")
@pytest.mark.parametrize(
    "command",
    [
        pytest.param(one, marks=pytest.mark.slow) if one in SLOW else one
        for one in ("", *COMMANDS)
    ],
)
@pytest.mark.usefixtures("here")
def test_every_help_ends_with_examples_that_run(
    command: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("D2RPICK_EXPLORE_STEPS", "4")
    monkeypatch.setenv("D2RPICK_ROLLOVER_DT", "1e-3")
    monkeypatch.setenv("D2RPICK_ROLLOVER_MESH", "4")
    shutil.copytree(ROOT / "sample_data", "sample_data")
    calls = list_examples(command)
    assert calls
    for call in calls:
        assert call[0] == command or not command
        result = run(*call, env=BY_VIBRATION if "--report" in call else {})
        assert (call, result.exit_code) in [(call, 0), (call, 1)], result.stderr


def test_the_help_names_each_command_in_a_line() -> None:
    work, experiments = (
        run("--help").stdout.split(f"{title}:\n")[1].split("\n\n")[0].split("\n")
        for title in ("Commands", "Experiments")
    )
    commands_shown = [*work, *experiments]
    assert commands_shown == [
        f"  {name:9}  {line}" for name, (_, line) in COMMANDS.items()
    ]
    assert max(map(len, commands_shown)) <= 80


@pytest.mark.parametrize("command", COMMANDS)
def test_help_is_the_same_by_its_short_name_and_explains_every_option(
    command: str,
) -> None:
    text = run(command, "--help").stdout
    assert run(command, "-h").stdout == text
    entries = [
        line
        for line in text.split("Examples:")[0].replace("\n      ", " ").split("\n")
        if line.startswith("  -")
    ]
    assert entries
    for entry in entries:
        name, *meaning = entry.split("  ", 3)[1:]
        assert any(part.strip() for part in meaning), f"{name} is not explained"


def test_the_margin_is_kept_before_a_landing_that_is_given() -> None:
    """The margin is 3 % of a flight that begins at 0.086; the record itself shows the landing at 0.379."""
    landing = 0.36
    arguments = ("--no-verify", "--part", "box", "--landing", str(landing), MATSUM)
    suggestion = run_json("suggest", *arguments)
    last = landing - 0.03 * (landing - suggestion["flight"]["start"])
    assert suggestion["flight"]["end"] == landing
    assert last - 0.03 < suggestion["recommended"]["td"] <= last
    assert (
        run_json("plan", "--min-quality", "poor", *arguments)["windows"][0]["td"]
        == suggestion["recommended"]["td"]
    )
    at_landing = run_json("suggest", "--td", str(landing), *arguments)
    assert at_landing["recommended"] is None
    assert at_landing["better_td"]["td"] <= last
    assert not run_json("verify", "--tr", "0.1", "--td", str(landing), *arguments)[
        "verified"
    ]
