"""Each message on a mistake says what was found, what was expected, and what to do."""

from pathlib import Path

import pytest

from tests.command import ENERGY, MATSUM, ROOT, put, run

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
            "give --td too, or a finished switched run as --switched",
        ),
        (("verify", ENERGY), "give --tr and --td, or a finished switched run"),
        (
            ("check", "--td", "0.2", SWITCHING),
            "The times are those of the deck; d2rpick verify judges other times",
        ),
        (
            ("suggest", "--limit", "x", ENERGY),
            "x was found, a whole number of at least 1 was expected",
        ),
        (
            ("suggest", "--limit", "0", ENERGY),
            "0 was found, a whole number of at least 1 was expected",
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
    assert answer.startswith("make rigid  unknown: this history does not contain")
    step = next(line for line in answer.splitlines() if line.startswith("next"))
    assert "d2rpick plan" in step


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
    assert "next choose the internal energy as --energy; d2rpick info" in answer
