"""A table that is narrowed loses no word, and is as wide as asked for wherever its words allow that."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from d2rpick.report.tables import as_text

WORDS = st.lists(st.text("abc-1", min_size=1, max_size=9), max_size=6).map(" ".join)


@given(st.integers(1, 5).flatmap(lambda n: st.lists(st.lists(WORDS, min_size=n, max_size=n), min_size=1, max_size=5)))
def test_a_narrow_table_keeps_every_word_below_its_name(rows: list[list[str]]) -> None:
    head = [f"{chr(ord('P') + at)} name" for at in range(len(rows[0]))]
    plain, narrow = as_text(head, rows).split("\n"), as_text(head, rows, 40).split("\n")
    if max(map(len, plain)) <= 40:
        assert narrow == plain
    longest = [max(map(len, " ".join(column).split())) for column in zip(head, *rows, strict=True)]
    assert max(map(len, narrow)) <= max(40, sum(longest) + 2 * (len(head) - 1))
    starts = [narrow[0].index(name[0]) for name in head] + [None]
    for column, start, end in zip(zip(head, *rows, strict=True), starts, starts[1:], strict=False):
        shown = " ".join(line[start:end] for line in narrow).split()
        assert shown == " ".join(column).split()
