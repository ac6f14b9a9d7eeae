"""Data lines by their columns: what is written is read again by name, in fixed columns and in free format."""

from pathlib import Path

import pytest
from hypothesis import given, strategies as st

from d2rpick.deck import ls_dyna_columns, radioss_columns
from d2rpick.deck.card import Card, Row
from d2rpick.deck.columns import DataLine, blank, integers, reals, words, write_list
from d2rpick.deck.reader import read_deck

LINES = {
    f"{module.__name__.rpartition('.')[2]} {name}": line
    for module in (ls_dyna_columns, radioss_columns)
    for name, line in vars(module).items()
    if isinstance(line, DataLine)
}
MIXED = DataLine(integers("A"), reals("B", 20), blank(10), words("C D"))


@pytest.mark.parametrize("name", LINES)
def test_columns_follow_each_other_without_gap_and_fit_into_a_line(name: str) -> None:
    columns = list(LINES[name])
    starts = [column.start for column in columns]
    ends = [column.start + column.width for column in columns]
    assert starts == [0, *ends[:-1]]
    names = [column.name for column in columns if column.name]
    assert len(names) == len(set(names))
    assert ends[-1] <= 100


@given(
    a=st.integers(-(10**8), 10**9),
    b=st.floats(allow_nan=False, allow_infinity=False, width=32),
    d=st.sampled_from(["PART", "PSET", ""]),
)
def test_what_is_written_stands_in_its_columns(a: int, b: float, d: str) -> None:
    line = MIXED.write(A=a, B=f"{b:.12g}", D=d)
    assert len(line) == 60
    assert int(MIXED["A"].cut(line)) == a
    assert float(MIXED["B"].cut(line)) == float(f"{b:.12g}")
    assert not line[30:40].strip()
    assert [MIXED[name].cut(line).strip() for name in "CD"] == ["", d]


@given(text=st.text("0123456789 ", max_size=70), value=st.integers(0, 10**9))
def test_a_changed_column_leaves_the_others_as_they_are(text: str, value: int) -> None:
    column = MIXED["C"]
    changed = column.put(text, value)
    assert column.cut(changed) == f"{value:10d}"
    assert changed[: column.start] == text[: column.start].ljust(column.start)
    assert changed[column.start + column.width :] == text[column.start + column.width :]


def test_a_value_for_no_column_is_an_error() -> None:
    with pytest.raises(AssertionError):
        MIXED.write(E=1)


@given(count=st.integers(0, 25))
def test_a_list_fills_one_line_after_the_other(count: int) -> None:
    lines = list(write_list(radioss_columns.ID_LIST, range(1, count + 1)))
    assert [int(cell) for line in lines for cell in line.split()] == [
        *range(1, count + 1)
    ]
    assert len(lines) == -(-count // 10)


@pytest.mark.parametrize("form", ["fixed", "free"])
def test_a_card_reads_the_same_from_fixed_columns_and_from_commas(
    form: str, tmp_path: Path
) -> None:
    values = {"SWSET": 7, "CODE": 0, "TIME1": 0.25, "RELSW": 8, "PAIRED": 1}
    line = ls_dyna_columns.SWITCH_TIMES.write(**values)
    if form == "free":
        line = ",".join(line.split())
    deck = tmp_path / "deck.k"
    deck.write_text(f"*DEFORMABLE_TO_RIGID_AUTOMATIC\n{line}\n")
    card: Card = read_deck(str(deck)).cards[0]
    row: Row = card.rows[0]
    read = dict(
        zip(
            [column.name for column in ls_dyna_columns.SWITCH_TIMES],
            card.numbers(row, ls_dyna_columns.SWITCH_TIMES),
            strict=True,
        )
    )
    assert {name: read[name].value for name in values} == values
