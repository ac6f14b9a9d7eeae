"""Names in messages: nothing in them may break a line or reach a terminal as a command."""

import unicodedata

from hypothesis import given, strategies as st

from d2rpick.base.errors import list_names, make_printable


@given(st.text())
def test_what_is_shown_holds_no_line_end_and_no_control_character(text: str) -> None:
    escaped = make_printable(text)
    assert len(escaped.splitlines()) <= 1
    assert not {unicodedata.category(letter) for letter in escaped} & {
        "Cc",
        "Cf",
        "Zl",
        "Zp",
    }


@given(st.text(st.characters(exclude_categories=["Cc", "Cf", "Zl", "Zp"])))
def test_every_other_name_is_shown_as_it_is(text: str) -> None:
    assert make_printable(text) == text


def test_an_escape_code_is_spelled_out() -> None:
    assert (
        make_printable("\x1b[2Jbox\u202e\u2028é\udce9")
        == "\\x1b[2Jbox\\u202e\\u2028é\udce9"
    )


def test_a_listing_is_one_line_and_counts_what_it_leaves_out() -> None:
    assert (
        list_names([f"box\n{i}" for i in range(4)], most=2)
        == "box\\n0, box\\n1 and 2 more"
    )
    assert list_names([3, 7], most=2, between=",") == "3,7"
    assert list_names([]) == ""
