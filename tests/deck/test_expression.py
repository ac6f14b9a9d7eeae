import contextlib
import math

import pytest
from hypothesis import given, strategies as st

from d2rpick.deck.expression import (
    ExpressionError,
    convert_plain,
    evaluate,
    parse_number,
)
from d2rpick.deck.reader import read_deck
from d2rpick.deck.switching import read_switching

PARAMETERS = {"a": 4, "b": 2.5}


def look_up(name: str) -> int | float:
    try:
        return PARAMETERS[name]
    except KeyError:
        raise ExpressionError(name) from None


@pytest.mark.parametrize(
    ("text", "value"),
    [
        *(
            ("12.e-3", 0.012),
            ("5.0000E+4", 5e4),
            ("1.0000E+20", 1e20),
            ("1e20", 1e20),
            ("-99", -99),
        ),
        *(
            (".5", 0.5),
            ("1.5D-3", 1.5e-3),
            ("1.5-3", 1.5e-3),
            ("+7", 7),
            ("1.000000E8", 1e8),
        ),
    ],
)
def test_numbers_as_decks_write_them(text: str, value: float) -> None:
    assert parse_number(text) == value


@pytest.mark.parametrize(
    "text",
    [
        "",
        "?",
        "CID",
        "1 2",
        "1_000",
        "1e999",
        "nan",
        "inf",
        "0x10",
        "٣",
        "9" * 30,
        "1" * 5000,
    ],
)
def test_what_is_no_number(text: str) -> None:
    with pytest.raises(ExpressionError):
        parse_number(text)


@given(st.floats(allow_nan=False, allow_infinity=False))
def test_every_double_reads_back(value: float) -> None:
    assert parse_number(repr(value)) == value


@pytest.mark.parametrize(
    ("text", "value"),
    [
        *(
            ("2/5", 0),
            ("-7/2", -3),
            ("7/-2", -3),
            ("2.0/5", 0.4),
            ("2**3**2", 512),
            ("-3**2", 9),
            ("2**-1", 0),
        ),
        *(
            ("1-2-3", -4),
            ("2*(3+4)", 14),
            ("-&b", -2.5),
            ("&A/8", 0),
            ("&a/8.", 0.5),
            ("2*pi", 2 * math.pi),
        ),
        *(
            ("sign(-4,8)", 4),
            ("mod(-7,2)", -1),
            ("nint(2.5)", 3),
            ("nint(-2.5)", -3),
            ("int(-48.1)", -48),
        ),
        *(("1+(" * 45 + "1" + ")" * 45, 46), ("1**" * 45 + "1", 1)),
        *(
            ("max(1,2.5)", 2.5),
            ("sqrt(16)", 4.0),
            ("cos(0)", 1.0),
            ("2.38+(&a-&b)/2.", 3.13),
            ("1e3+0", 1000.0),
        ),
    ],
)
def test_expressions(text: str, value: float) -> None:
    result = evaluate(text, look_up)
    assert result == pytest.approx(value)
    assert type(result) is type(value)


@pytest.mark.parametrize(
    "text",
    [
        *(
            "",
            "1+",
            "(1",
            "1)",
            "&nobody",
            "foo(1)",
            "max(1)",
            "1/0",
            "2/0.",
            "sqrt(-1)",
            "2**9999",
            "9**99",
            "log(0)",
        ),
        *(
            "(" * 500 + "1" + ")" * 500,
            "1**" * 500 + "1",
            "-" * 3000 + "1",
            "a b",
            "1,2",
            "#",
            "__import__('os')",
        ),
    ],
)
def test_what_is_no_expression(text: str) -> None:
    with pytest.raises(ExpressionError):
        evaluate(text, look_up)


@given(st.text(alphabet="0123456789.+-*/()&abepidt, ", max_size=60))
def test_any_text_is_a_finite_number_or_refused(text: str) -> None:
    with contextlib.suppress(ExpressionError):
        assert math.isfinite(evaluate(text, look_up))


@given(st.integers(-(10**6), 10**6), st.integers(-(10**6), 10**6).filter(bool))
def test_integer_division_drops_the_fraction(x: int, y: int) -> None:
    quotient = evaluate(f"({x})/({y})", look_up)
    assert abs(quotient) == abs(x) // abs(y)
    assert quotient * x * y >= 0


def test_texts_that_are_too_long_for_a_number_are_not_kept() -> None:
    size_before = convert_plain.cache_info().currsize
    content = b"*DEFORMABLE_TO_RIGID\n" + b"x" * 100 + b",1\n"
    (card,) = read_switching(read_deck("deck.k", content))
    assert (
        next(problem for _, problem in card.problems) == f"{'x' * 40!r} is not a number"
    )
    assert (
        convert_plain.cache_info().currsize <= size_before + 1
    )  # the digit 1 after the blanks
