"""A narrowed table loses only optional columns, and keeps the requested width if its words allow this."""

import csv
import io
import sys
import unicodedata

import pytest
from hypothesis import given, strategies as st

from d2rpick.report.tables import Cell, as_csv, as_text, wrap_lines

WORDS = st.lists(st.text("abc-1", min_size=1, max_size=9), max_size=6).map(" ".join)


@given(
    st.integers(1, 5).flatmap(
        lambda n: st.lists(
            st.lists(WORDS, min_size=n, max_size=n), min_size=1, max_size=5
        )
    )
)
def test_a_narrow_table_keeps_every_word_below_its_name(rows: list[list[str]]) -> None:
    head = [
        f"{chr(ord('P') + column_number)} name" for column_number in range(len(rows[0]))
    ]
    plain, narrow = as_text(head, rows).split("\n"), as_text(head, rows, 40).split("\n")
    if max(map(len, plain)) <= 40:
        assert narrow == plain
    longest = [
        max(map(len, " ".join(column).split()))
        for column in zip(head, *rows, strict=True)
    ]
    assert max(map(len, narrow)) <= max(40, sum(longest) + 2 * (len(head) - 1))
    starts = [narrow[0].index(name[0]) for name in head] + [None]
    for column, start, end in zip(
        zip(head, *rows, strict=True), starts, starts[1:], strict=False
    ):
        shown_words = " ".join(line[start:end] for line in narrow).split()
        assert shown_words == " ".join(column).split()


@given(
    st.integers(40, 100),
    st.lists(st.text("ab1/,_", min_size=13, max_size=60), min_size=1, max_size=3),
)
def test_words_that_are_too_long_are_broken_and_numbers_are_not(
    width: int, names: list[str]
) -> None:
    number = -1.23456e-05
    shown_text = as_text(
        [f"name {name_number}" for name_number in range(len(names))] + ["td"],
        [[*names, number]],
        width,
    )
    assert max(map(len, shown_text.split("\n"))) <= max(
        width, 12 * len(names) + 2 * len(names) + 12
    )
    assert f"{number:.6g}" in shown_text
    if len(names) == 1:
        assert (
            "".join(line.split()[0] for line in shown_text.split("\n")[1:]) == names[0]
        )


def test_a_long_word_breaks_behind_what_joins_its_parts() -> None:
    lines = as_text(["shares"], [["1,7,11,13,15,16"]], 12).split("\n")
    assert lines == ["shares", "1,7,11,13,", "15,16"]
    assert as_text(["run"], [["speed-12-thick-3"]], 12).split("\n") == [
        "run",
        "speed-12-",
        "thick-3",
    ]


@given(st.integers(20, 60), st.lists(WORDS, min_size=1, max_size=4).map("  ".join))
def test_wrapped_text_loses_no_word_and_no_line_is_longer_than_it_may_be(
    width: int, text: str
) -> None:
    lines = wrap_lines(text, width).split("\n")
    assert " ".join(lines).split() == text.split()
    assert max(map(len, lines)) <= width
    assert text.count("\n") or len(text) > width or lines == [text]


@given(st.integers(1, 80))
def test_spare_columns_are_left_out_in_their_order_and_only_where_room_is_short(
    width: int,
) -> None:
    head = ["tr", "tolerance", "verdict", "+-"]
    row: list[Cell] = [0.123456, "1.0e-04", "acceptable", "2.0e-05"]
    names = as_text(head, [row], width, ("+-", "tolerance")).split("\n")[0].split()
    assert names == (
        head if width >= 40 else head[:3] if width >= 31 else ["tr", "verdict"]
    )


def read_cell(value: Cell) -> str:
    """Return the value that a csv reader obtains for a cell."""
    ((cell, last),) = csv.reader(
        io.StringIO(as_csv([], [[value, "last"]]).removeprefix("\n")), strict=True
    )
    assert last == "last"
    return cell


@given(st.text("=+-@＝＋－＠ ;1.eEa", max_size=9))
def test_no_text_of_a_csv_is_a_formula(text: str) -> None:
    for piece in read_cell(text).split(";"):
        begin = piece.strip()[:1]
        if begin in "=+-@＝＋－＠":
            assert not begin or isinstance(float(piece), float)
    assert read_cell(text).replace("'", "") == text


@pytest.mark.parametrize("before", ["", " ", "\u00a0", "\u3000", "a;", "a; "])
def test_a_sign_that_normalisation_makes_the_begin_of_a_formula_is_treated_as_such(
    before: str,
) -> None:
    """The small equals sign, for example, becomes "=" where a program normalises text."""
    signs = [
        sign
        for sign in map(chr, range(sys.maxunicode + 1))
        if unicodedata.normalize("NFKC", sign).startswith(("=", "+", "-", "@"))
    ]
    assert "\N{SMALL EQUALS SIGN}" in signs
    assert [read_cell(f"{before}{sign}A1") for sign in signs] == [
        f"{before}'{sign}A1" for sign in signs
    ]


@pytest.mark.parametrize("before", ["\t", "\r", "\n", "\x00", "\ufeff"])
def test_a_control_code_before_a_sign_is_a_printed_code(before: str) -> None:
    """The cell then begins with a backslash, so that no spreadsheet treats it as a formula."""
    assert read_cell(f"{before}=A1").startswith("\\")


@given(st.floats(allow_nan=False, allow_infinity=False) | st.integers())
def test_a_number_in_a_csv_reads_back_to_itself(number: float) -> None:
    kind = type(number)  # no float holds an integer of 17 digits
    assert kind(read_cell(number)) == number == kind(read_cell(str(number)))
    assert read_cell(f"{number}; {number}") == f"{number}; {number}"
