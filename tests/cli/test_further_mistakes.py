"""Each message on a mistake says what was found, what was expected, and what to do."""

from pathlib import Path

import numpy as np
import pytest

from tests.command import ENERGY, MATSUM, ROOT, put, run, run_json
from tests.computed import locate_stored

DECK = str(ROOT / "sample_data" / "rollover_box.k")
SWITCHING = str(ROOT / "sample_data" / "switching.k")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (
            ("suggest", "--td"),
            "--td needs a value: Switch back to deformable at this time (see",
        ),
        (("verify", "--tr", "0.05", "--td", "0.05", ENERGY), "give a td after tr"),
        (
            ("card", "--part", "1", "--tr", "0.05", "--td", "0.05"),
            "tr and td are both 0.05; give a td after tr",
        ),
        (
            ("verify", "--tr", "0.01", ENERGY),
            "missing: --td T (or --switched FILE, a finished switched run)",
        ),
        (
            ("verify", ENERGY),
            "missing: --tr T and --td T (or --switched FILE, a finished switched run)",
        ),
        (("first",), "missing: DECK (main deck of the run); --output-dir DIR (folder"),
        (
            ("first", DECK),
            "missing: --output-dir DIR (folder for the copy); --part (parts to switch); --wait (force-free time",
        ),
        (
            ("card", "--solver", "radioss", "--tr", "0.01"),
            (
                "missing: --td T (or --windows FILE, with lines 'tr td'); --node IDS (main nodes of the rigid bodies); "
                "--end T (end"
            ),
        ),
        (
            ("drive", str(ROOT / "sample_data" / "falling_plate" / "plate_0000.rad")),
            (
                "missing: -o RUNDIR (folder of the run); --starter 'CMD {deck}' and --engine 'CMD {deck}' "
                "(or OPENRADIOSS_PATH, the folder of OpenRadioss); --part IDS (parts to switch)"
            ),
        ),
        (
            ("replay", "--mass", "1", "--beta", "1"),
            (
                "missing: --stiffness NUMBER (spring stiffness k); --t-end T (end of the computed run); "
                "--dt T (output interval); --v0 NUMBER, or some of"
            ),
        ),
        (
            ("verify",),
            "missing: HISTORY (file, folder or quoted pattern of the run); --tr",
        ),
        (
            ("check", "--td", "0.2", SWITCHING),
            "The times are those of the deck; d2rpick verify judges other times",
        ),
        (
            ("suggest", "--limit", "x", ENERGY),
            "x was found, but a whole number of at least 1 was expected",
        ),
        (
            ("suggest", "--limit", "0", ENERGY),
            "0 was found, but a whole number of at least 1 was expected",
        ),
        (
            ("plan", MATSUM, ENERGY),
            "flight 1, from 0.086 to 0.2776, reaches outside the record, 0 to 0.15; do",
        ),
        (("calibrate", "no_such_folder"), "no_such_folder: no such folder; give the"),
        (
            ("card", "--tr", "0.1", "--td", "0.2", "--part", "IDS"),
            "IDS stands for ids that the files do not contain; give those of your deck",
        ),
    ],
)
def test_a_message_says_what_to_do(arguments: tuple[str, ...], message: str) -> None:
    result = run(*arguments)
    assert result.exit_code == 2
    assert message in " ".join(result.stderr.split())


@pytest.mark.parametrize(
    ("content", "problem"),
    [(b"", "the file is empty"), (b"\x00\x90\xff" * 50, "binary data was found")],
)
def test_a_deck_without_keywords_is_described(
    tmp_path: Path, content: bytes, problem: str
) -> None:
    deck = put(tmp_path / "main.k", content)
    assert f"main.k: {problem}; an LS-DYNA deck" in run("check", str(deck)).stderr


@pytest.mark.parametrize(
    ("channel", "expected"),
    [
        ("mass=356", ", not a value (--mass takes that of the oscillator model)"),
        ("kinetic_energy=356", ""),
    ],
)
def test_a_value_in_place_of_a_column_is_refused(channel: str, expected: str) -> None:
    """Before, a column of the usual name was used in its place without a word."""
    answer = run("suggest", "--channel", channel, ENERGY)
    assert answer.exit_code == 2
    assert (
        f"--channel {channel}: the name of a column was expected{expected}; no column "
        "'356'; there are: 1 'time'"
    ) in answer.stderr
    parts = run("suggest", "--channel", channel, "--part", "box", MATSUM)
    assert f"column was expected{expected}, and there are only columns" in parts.stderr


SAMPLES = ROOT / "sample_data"


@pytest.mark.parametrize(
    ("name", "title"),
    [
        ("energy.csv", "a table of numbers"),
        ("energy.glstat", "a glstat of LS-DYNA"),
        ("rollover_box.matsum", "a matsum of LS-DYNA"),
        ("rollover_box.binout", "a binout of LS-DYNA"),
        ("rollover_box.h5", "an HDF5 file"),
        ("rollover_boxT01", "a T01 of Radioss"),
        ("rolloverT01.gz", "a T01 of Radioss"),
    ],
)
def test_a_history_in_place_of_a_deck_is_named_with_its_option(
    name: str, title: str
) -> None:
    history = str(SAMPLES / name)
    wrong = f"{name}: this is {title}, but a deck was expected; give the main deck of the run"
    times = ("--tr", "0.1", "--td", "0.2", "--part", "1")
    for arguments, place in (
        (("check", history), ", and this file as --history"),
        (("card", *times, "--deck", history), ", and this file as --history"),
        (("plan", "--deck", history, MATSUM), ", and this file as HISTORY"),
        (("first", history, "--part", "1", "--wait", "1", "-o", "new"), ""),
    ):
        answer = run(*arguments)
        assert answer.exit_code == 2
        assert answer.stderr.endswith(f"{wrong}{place}\n")


def test_a_deck_in_place_of_a_history_is_named_with_its_option() -> None:
    wrong = "name the glstat, matsum, binout or T01 of its run"
    for arguments, place in (
        (("suggest", DECK), ", and this file as --deck"),
        (("check", DECK, "--history", DECK), ", and this file as DECK"),
        (("extract", DECK), ""),
        (("study", DECK), ""),
    ):
        assert run(*arguments).stderr.endswith(f"{wrong}{place}\n")


def test_weights_that_are_not_text_name_the_command_that_writes_them(
    tmp_path: Path,
) -> None:
    file = put(tmp_path / "weights.toml", b"\x90\x00\xff")
    answer = run("plan", "--deck", DECK, "--weights", str(file), MATSUM)
    assert "cannot be read (binary data)" in answer.stderr
    assert "d2rpick calibrate writes one" in answer.stderr


def test_an_energy_of_zero_is_the_reason_why_no_flight_is_found(tmp_path: Path) -> None:
    rows = "".join(f"{step / 100},0\n" for step in range(100))
    file = put(tmp_path / "zero.csv", f"time,internal_energy\n{rows}")
    answer = run("suggest", str(file))
    assert "the energy is 0 in all states; choose the internal" in answer.stderr


def test_parts_of_a_table_asks_for_a_history_with_parts() -> None:
    answer = run("parts", ENERGY).stdout
    assert answer.startswith("make rigid  unknown: the history contains no data")
    assert "d2rpick plan" in answer.partition("\nnext ")[2]


def test_the_history_of_a_check_is_that_of_the_next_command() -> None:
    glstat = str(ROOT / "sample_data" / "energy.glstat")
    answer = run("check", "--history", glstat, DECK).stdout
    assert f"d2rpick plan {glstat}" in " ".join(answer.split())


def test_a_mistyped_run_to_follow_is_compared_with_its_neighbours(
    tmp_path: Path,
) -> None:
    (tmp_path / "run_a").mkdir()
    answer = run("follow", "--once", str(tmp_path / "run_b"))
    assert answer.exit_code == 2
    assert "(did you mean 'run_a'?)" in answer.stdout
    assert "exit code 2: there is no such file or folder" in answer.stderr
    waiting = run("follow", "--once", str(tmp_path / "run_a"))
    assert waiting.exit_code == 1
    assert "exit code 1: the parts do not fly" in waiting.stderr
    assert "did you mean" not in waiting.stdout


def test_a_main_node_that_the_deck_lacks_is_refused_with_those_it_has() -> None:
    folder = str(ROOT / "sample_data" / "oscillator")
    answer = run("plan", "-f", "card", "--node", "1001", folder)
    assert answer.exit_code == 2
    assert "no rigid body has the main node 1001" in answer.stderr
    assert "as --node: the deck has 9001" in answer.stderr
    assert run("plan", "-f", "card", "--node", "9001", folder).exit_code == 0


def test_an_energy_of_zero_leads_to_the_choice_of_another_column(
    tmp_path: Path,
) -> None:
    rows = "".join(f"{step / 100},0\n" for step in range(100))
    file = put(tmp_path / "zero.csv", f"time,internal_energy\n{rows}")
    answer = " ".join(run("suggest", "--td", "0.3", str(file)).stdout.split())
    assert (
        "next choose the internal energy as --energy; see the columns with d2rpick info"
        in answer
    )


def test_no_flight_is_assumed_across_a_missing_restart_segment() -> None:
    """Before, the parts were said to fly from 0.09 to 0.38 in a run whose second of three segments is missing."""
    legs = [locate_stored(f"rollover_r100_T0{leg}.gz") for leg in (1, 3)]
    first_screen = " ".join(run("info", *legs).stdout.split())
    assert first_screen.startswith(
        "record suitable with care for choosing times: it contains flights (d2rpick plan judges the windows in "
        "them) why there "
        "are no states from 0.0999564 to 0.370008: a restart segment may be missing, and no flight is assumed"
    )
    flights = run_json("info", *legs)["flights"]
    assert [flight["start"] > 0.37 for flight in flights] == [True]
    across = run("verify", "--part", "box", "--tr", "0.0915", "--td", "0.3707", *legs)
    assert "tr before the states go on at 0.370008 (is a restart segment missing?)" in (
        " ".join(across.stdout.split())
    )
    inside = run("suggest", "--part", "box", "--td", "0.2", *legs)
    assert "there are no states from 0.0999564 to 0.370008, around td = 0.2" in (
        inside.stderr
    )


def test_a_table_written_less_often_for_a_while_keeps_its_flight(
    tmp_path: Path,
) -> None:
    """Only a single interval that is much longer than its neighbours is a gap."""
    rows = (SAMPLES / "energy.csv").read_text().splitlines()
    thinned = [*rows[:600], *rows[600:900:40], *rows[900:]]
    table = put(tmp_path / "thinned.csv", "\n".join(thinned).encode() + b"\n")
    assert "restart segment" not in run("info", str(table)).output
    cut = put(tmp_path / "cut.csv", "\n".join([*rows[:600], *rows[900:]]).encode())
    (flight, *_) = run_json("info", str(cut))["flights"]
    assert flight["end"] == pytest.approx(float(rows[599].split(",")[0]))


def test_verify_names_the_best_pair_for_the_given_td_too() -> None:
    """Before, it named only the nearest good pair, although td may be fixed."""
    answer = " ".join(
        run("verify", "--tr", "0.03", "--td", "0.12", ENERGY).stdout.split()
    )
    assert (
        "to improve use tr = 0.0128534, td = 0.119046: vibration error 0.0%, rigid for 0.106193; with the given "
        "td, tr = 0.0128455, td = 0.12: vibration error 23%, rigid for 0.107155 expect"
    ) in answer


def test_verify_names_the_best_pair_of_the_flight_beside_the_nearest(
    tmp_path: Path,
) -> None:
    time = np.linspace(0, 0.3, 3001)
    modes = ((35, 0, 1), (61, 1, 0.6), (97, 2, 0.3))
    energy = np.full(time.size, 3.0)
    for rate, phase, size in modes:
        energy += (size * np.cos(2 * np.pi * rate * time + phase)) ** 2
    rows = "".join(
        f"{t!r},{e!r}\n" for t, e in zip(time.tolist(), energy.tolist(), strict=True)
    )
    table = put(tmp_path / "modes.csv", f"time,internal_energy\n{rows}".encode())
    answer = run("verify", "--tr", "0.05", "--td", "0.12", str(table)).stdout
    cure = " ".join(answer.split()).partition("to improve use ")[2]
    nearest, best = cure.partition(" expect ")[0].split("; best in the flight, ")
    assert nearest.startswith("tr = 0.0307804, td = 0.1135: vibration error 38%")
    assert best == "tr = 0.0725888, td = 0.3: vibration error 20%, rigid for 0.227411"


def test_the_record_of_a_switched_run_is_called_one(tmp_path: Path) -> None:
    """Not all parts were rigid, and the solver writes the kinetic energy of rigid parts, so only energies show it."""
    switched = str(tmp_path / "switched.matsum")
    times = ("--tr", "0.09", "--td", "0.37")
    run("rollover", "--mesh", "4", *times, "-o", switched)
    expected = "rigid-times: this is a switched run, with these rigid parts: box from 0.09 to 0.37; choose times from"
    for question in (("suggest",), ("explore",), ("plan",), ("verify", *times)):
        answer = run(*question, "--part", "flying", switched)
        assert answer.stderr.count(expected) == 1
    for unswitched in (MATSUM, str(SAMPLES / "rolloverT01.gz")):
        assert (
            "rigid-times" not in run("suggest", "--part", "flying", unswitched).stderr
        )


def test_a_flight_after_a_rigid_window_belongs_to_a_switched_run() -> None:
    """All parts were rigid before the flight, so what the window froze changes its vibration."""
    legs = [locate_stored(f"drop2_w123_T0{leg}.gz") for leg in range(1, 7)]
    answer = run("suggest", "--td", "0.5", *legs)
    assert "this is a switched run" in answer.stderr


@pytest.mark.parametrize(
    ("question", "problem"),
    [
        (
            ("card", "--tr", "0.1", "--td", "0.2", "--part", "1"),
            "nothing shows that the model has a part 7; give a part of the model as --merge, or the main deck as",
        ),
        (
            ("plan", "--part", "flying", "-f", "card", MATSUM),
            "the history has no part 7, only box, step; give a part of the model as --merge, or the main deck",
        ),
    ],
)
def test_a_lead_part_that_nothing_shows_is_a_warning(
    question: tuple[str, ...], problem: str
) -> None:
    answer = run(*question, "--merge", "7")
    assert f"warning: lead-part-unknown: --merge 7: {problem}" in answer.stderr
    assert "lead-part-unknown" not in run(*question, "--merge", "1").stderr
