"""If the digits of a momentum may hide a flight, every message that denies the flight says so, and only then."""

import csv
from pathlib import Path

import pytest

from tests.command import ROOT, join_wrapped_lines, put, run

TABLE = ROOT / "sample_data" / "rollover_box.csv"
MOMENTA = ("momentum_x", "momentum_z")
CONTACT_ENDS = 0.086  # The box leaves the step [s].
IN_FLIGHT = "0.25"


def write_table(digits: int, end: float) -> str:
    """Return a table of the falling box up to a time, whose momenta have the given number of significant digits."""
    with TABLE.open() as file:
        rows = [row for row in csv.DictReader(file) if float(row["time"]) <= end]
    columns = ("time", "internal_energy", *MOMENTA)
    lines = [",".join(columns)]
    for row in rows:
        rounded = {name: f"{float(row[name]):.{digits - 1}e}" for name in MOMENTA}
        lines.append(",".join({**row, **rounded}[name] for name in columns))
    return "\n".join(lines) + "\n"


@pytest.mark.parametrize("digits", [3, 4])
def test_few_digits_of_the_momentum_are_named_where_they_hide_the_flight(
    digits: int, tmp_path: Path
) -> None:
    table = str(put(tmp_path / "few.csv", write_table(digits, 1.0)))
    hint = f"the {digits} significant digits of the momentum may be too few to show a flight: write more digits"
    for command in (
        ("info",),
        ("plan",),
        ("suggest",),
        ("suggest", "--td", IN_FLIGHT),
        ("verify", "--tr", "0.1", "--td", IN_FLIGHT),
    ):
        result = run(*command, table)
        assert hint in join_wrapped_lines(result.stdout + result.stderr)


@pytest.mark.parametrize(
    ("digits", "end"), [(6, 1.0), (4, CONTACT_ENDS), (5, CONTACT_ENDS)]
)
def test_digits_that_hide_nothing_are_not_named(
    digits: int, end: float, tmp_path: Path
) -> None:
    """With enough digits the flight is found, and before it the contact denies every flight with any digits."""
    table = str(put(tmp_path / "run.csv", write_table(digits, end)))
    td = ("--td", str(end / 2 if end < 1 else IN_FLIGHT))
    for command in (("info",), ("plan",), ("suggest",), ("suggest", *td)):
        result = run(*command, table)
        assert "significant digit" not in result.stdout + result.stderr
