"""Mistakes that users make are answered with what was found, what was expected, and what to do."""

from pathlib import Path

import pytest

from tests.command import read_refusal

ENERGY = "sample_data/energy.csv"
MATSUM = "sample_data/rollover_box.matsum"
DECK = "sample_data/rollover_box.k"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ("rule D2R999", "no rule 'D2R999'"),
        ("rule D2R999", "; d2rpick rule lists all"),
        (f"suggest --td 0.2 {ENERGY}", "0 to 0.15; give a time within it"),
        (f"suggest --td 64 {ENERGY}", "give --td 0.064"),
        (f"suggest --td -0.01 {ENERGY}", "; give a time within it"),
        (f"calibrate {DECK}", "a file, the folder of one run was expected"),
        (
            f"verify --switched {ENERGY} {ENERGY}",
            "both runs have the same energies",
        ),
        (
            "card --tr 0.07 --td 0.06 --part 1",
            "0 <= tr < td was expected; give the earlier time as tr",
        ),
        ("card --tr 0,0135 --td 0.2 --part 1", "write it with a decimal point, 0.0135"),
        (f"suggest --part bx {MATSUM}", "did you mean 'box'?"),
    ],
)
def test_a_mistake_is_answered_with_its_cure(arguments: str, message: str) -> None:
    assert message in read_refusal(*arguments.split())


def test_a_table_with_one_column_is_named_so(tmp_path: Path) -> None:
    table = tmp_path / "one.csv"
    table.write_text("internal_energy\n" + "1.5\n" * 20)
    assert "this file has one column; add the times" in read_refusal(
        "suggest", str(table)
    )


def test_a_line_of_a_window_names_what_was_expected(tmp_path: Path) -> None:
    done = tmp_path / "done.txt"
    done.write_text("0.1\n")
    message = read_refusal("plan", "--done", str(done), MATSUM)
    assert "done.txt:1: '0.1' was found, two numbers 'tr td' were expected" in message
