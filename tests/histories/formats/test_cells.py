"""Split lines into cells, one by one and all at once."""

from __future__ import annotations

import re

import numpy as np
import pytest
from hypothesis import given, strategies as st

from d2rpick.histories.formats.cells import (
    has_number,
    is_skipped,
    split_cells,
    split_columns_of_numbers,
)
from d2rpick.histories.formats.text import find_precisions
from d2rpick.histories.history import EXACT

CELLS = st.one_of(
    st.floats(allow_nan=False, allow_infinity=False).map(repr),
    st.integers(-99, 99).map(str),
    st.sampled_from(["", " 1", "1 ", "n/a", ".5", "5.", "+1e5", "1D3", '"1"', "-", "1,5"]),
)  # fmt: skip


@pytest.mark.parametrize("separator", [",", ";", "\t", "|"])
@pytest.mark.parametrize("decimal", [".", ","])
@given(st.lists(st.lists(CELLS, min_size=2, max_size=2), max_size=4), st.booleans())
def test_columns_split_at_once_are_those_split_line_by_line(
    separator: str, decimal: str, table: list[list[str]], is_closed: bool
) -> None:
    lines = [separator.join([*row, *[""] * is_closed]) for row in table]
    columns = split_columns_of_numbers(lines, separator, decimal, 2)
    rows = [split_cells(line, separator) for line in lines]
    if columns is None:
        assert separator == decimal or any(
            len(row) != 2 or not all(cell.isascii() for cell in row) or
            not all(has_number(cell, decimal) for cell in row) or
            row != line.split(separator)
            for line, row in zip(lines, rows, strict=True)
        )  # fmt: skip
    else:
        assert rows == [list(row) for row in zip(*columns, strict=True)]
        assert all(has_number(cell, decimal) for row in rows for cell in row)
        assert not any(map(is_skipped, lines))


@given(st.lists(st.one_of(CELLS, st.text("+-0.15eED", max_size=12)), min_size=1))
def test_the_precision_is_that_of_the_field_with_most_digits(fields: list[str]) -> None:
    most = 1
    for field in fields:
        if has_number(field, "."):
            mantissa, *exponent = re.split("[eEdD]", field)
            written = re.sub(r"\D", "", mantissa)
            digits = written.lstrip("0") or (written if exponent else "")
            most = max(most, len(digits))
    expected = most if most < 15 else EXACT.digits
    assert (
        find_precisions(fields, fields, np.array([0.0, 1.0, 3.0]))[0].digits == expected
    )


@pytest.mark.parametrize(
    "line", ["1", "1.5,2", "0 # words", "7 8", "²", "٣", "-1", "- -", "# 1", " 1", ""]
)
def test_a_line_that_begins_with_a_digit_is_no_comment(line: str) -> None:
    assert is_skipped(f" {line}") == is_skipped(line)
