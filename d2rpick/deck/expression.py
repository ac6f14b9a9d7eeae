"""Evaluate numbers and expressions in decks with a small parser; no deck text is ever executed as Python code.

Source: LS-DYNA Vol I R17, pages 36-7 to 36-9, as quoted by a converter (secondary): integers stay integers (``2/5`` is
0), the unary minus binds more tightly than ``**`` (``-3**2`` is 9), and the functions are those of Fortran.
"""

from __future__ import annotations

import math
import operator
import re
from functools import lru_cache
from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

Number = int | float

_NUMBER = re.compile(
    r"([+-]?(?:\d+\.?\d*|\.\d+))(?:[eEdD]([+-]?\d+)|([+-]\d+))?", re.ASCII
)
_TOKEN: Final = (  # This pattern is compiled on first use to keep start-up fast.
    r"\s*(?:(?P<number>(?:\d+\.?\d*|\.\d+)(?:[eEdD][+-]?\d+)?)|(?P<name>&?\s*[a-z_]\w*)|(?P<sign>\*\*|[-+*/(),]))"
)
REFERENCE: Final = r"(?ai)&\s*([a-z_]\w*)"  # Reference to a parameter, such as &tend.
# Largest depth of nested parentheses, which prevents the recursion from exhausting Python's stack.
_DEEPEST = 50
LONGEST = 40  # Largest number of characters in a number.
_LONGEST_EXPRESSION = 2000
_INTEGER_LIMIT = 2**63

_CONSTANTS: Final = {"pi": math.pi, "dtor": math.pi / 180, "rtod": 180 / math.pi}


class ExpressionError(Exception):
    """Raised inside the deck reader for a string that is not a number; the message gives the reason."""


@lru_cache(4096)  # Results are cached, because most fields are blank or 0.
def parse_number(text: str) -> Number:
    """Read a number as LS-DYNA does: ``12``, ``12.e-3``, ``1.5D-3``, or ``1.5-3`` (without an exponent letter).

    Examples
    --------
    >>> parse_number("12"), parse_number(" 12.e-3 "), parse_number("1.5D-3"), parse_number("1.5-3")
    (12, 0.012, 0.0015, 0.0015)
    """
    text = text.strip()
    match = _NUMBER.fullmatch(text) if len(text) <= LONGEST else None
    if match is None:
        raise ExpressionError(f"{text[:LONGEST]!r} is not a number")
    mantissa = match[1]
    exponent = match[2] or match[3]
    if exponent is None and "." not in mantissa:
        return _check_range(int(mantissa))
    return _check_range(float(f"{mantissa}e{exponent or 0}"))


def is_deck_number(text: str) -> bool:
    """Return True if `parse_number` can read the string."""
    try:
        parse_number(text)
    except ExpressionError:
        return False
    return True


@lru_cache(4096)
def convert_plain(kind: Callable[[float], Any], text: str) -> tuple[Any, str] | None:
    """Return the number in a string that is a plain number of this type; None if the string must be evaluated."""
    return (
        None
        if "&" in text or text[0] == "<"
        else convert_text(kind, text, parse_number)
    )


def convert_text(
    kind: Callable[[float], Any], text: str, value: Callable[[str], Number]
) -> tuple[Any, str]:
    """Convert a string to a number of the given type (int or float).

    Return the number and an empty string, or None and the reason.

    Examples
    --------
    >>> convert_text(int, "2.0", parse_number), convert_text(int, "2.5", parse_number)
    ((2, ''), (None, "'2.5' is not an integer"))
    """
    try:
        exact = float(value(text))
        converted = kind(exact)
    except (ExpressionError, OverflowError) as error:
        return None, str(error)
    if converted == exact:
        return (converted, "")
    return (None, f"{text!r} is not an integer")


def parse_real(text: str) -> float:
    """Parse a field as a number: a blank field gives 0.0, and text that is not a number gives NaN."""
    try:
        return float(parse_number(text)) if text.strip() else 0.0
    except ExpressionError:
        return math.nan


def find_parameters(text: str) -> tuple[str, ...]:
    """Return the names of the parameters used in a string, in lower case.

    Examples
    --------
    >>> find_parameters("-&tEnd/6.0+&dt")
    ('tend', 'dt')
    """
    if "&" in text:
        return tuple(name.lower() for name in re.findall(REFERENCE, text))
    return ()


def evaluate(text: str, lookup: Callable[[str], Number]) -> Number:
    """Evaluate an expression; ``lookup`` returns the value of a parameter from its lower-case name.

    Examples
    --------
    >>> evaluate("2/5", {}.__getitem__), evaluate("2.0/5", {}.__getitem__), evaluate("-3**2", {}.__getitem__)
    (0, 0.4, 9)
    >>> evaluate("max(&a, 2)*nint(2.5)", {"a": 4}.__getitem__)
    12
    """
    if len(text) > _LONGEST_EXPRESSION:
        raise ExpressionError(
            f"an expression is longer than {_LONGEST_EXPRESSION} characters"
        )
    try:
        return _Parser(text, lookup).whole()
    except (ValueError, OverflowError, ZeroDivisionError, TypeError):
        raise ExpressionError(f"{text!r} has no finite value") from None


def _round_half_away(x: Number) -> int:
    """Round to the nearest integer, with halves away from zero."""
    return int(math.copysign(math.floor(abs(x) + 0.5), x))


_FUNCTIONS: Final[dict[str, tuple[int, Callable[..., Number]]]] = {
    **{
        name: (1, getattr(math, name))
        for name in (
            *(
                "sin",
                "cos",
                "tan",
                "asin",
                "acos",
                "atan",
                "sinh",
                "cosh",
                "tanh",
                "asinh",
                "acosh",
                "atanh",
            ),
            *("sqrt", "exp", "log", "log10"),
        )
    },
    "csc": (1, lambda x: 1 / math.sin(x)),
    "sec": (1, lambda x: 1 / math.cos(x)),
    "ctn": (1, lambda x: 1 / math.tan(x)),
    "abs": (1, abs),
    "float": (1, float),
    "int": (1, int),
    "aint": (1, lambda x: float(int(x))),
    "nint": (1, _round_half_away),
    "anint": (1, lambda x: float(_round_half_away(x))),
    "atan2": (2, math.atan2),
    "min": (2, min),
    "max": (2, max),
    "sign": (2, lambda x, y: abs(x) if y >= 0 else -abs(x)),
    "mod": (2, lambda x, y: int(math.fmod(_round_half_away(x), _round_half_away(y)))),
}


def _divide(x: Number, y: Number) -> Number:
    """Divide as Fortran does: the quotient of two integers is an integer, rounded towards zero."""
    if isinstance(x, int) and isinstance(y, int):
        whole = abs(x) // abs(y)
        return whole if (x < 0) == (y < 0) else -whole
    return x / y


def _raise_to_power(x: Number, y: Number) -> Number:
    """Raise a number to a power as Fortran does: an integer to the power of an integer gives an integer."""
    result = math.pow(x, y)
    return int(result) if isinstance(x, int) and isinstance(y, int) else result


# Precedence of each operator, and the function that implements the operator.
_OPERATIONS: Final[dict[str, tuple[int, Callable[[Number, Number], Number]]]] = {
    "+": (1, operator.add),
    "-": (1, operator.sub),
    "*": (2, operator.mul),
    "/": (2, _divide),
    "**": (3, _raise_to_power),
}


class _Parser:
    """Parser of arithmetic expressions that respects the precedence of the operators."""

    def __init__(self, text: str, lookup: Callable[[str], Number]) -> None:
        self.text = text
        self.lookup = lookup
        self.tokens = [*_split_tokens(text), ""]
        self.depth = 0

    def whole(self) -> Number:
        """Evaluate the whole expression, which must end where the text ends."""
        value = self.nested()
        if self.tokens[0]:
            raise self.unexpected()
        return value

    def nested(self, lowest_level: int = 1) -> Number:
        """Evaluate one level of nesting, with the operators whose precedence is at least ``lowest_level``."""
        self.depth += 1
        if self.depth > _DEEPEST:
            raise ExpressionError(
                f"an expression is nested deeper than {_DEEPEST} levels"
            )
        value = self.value(lowest_level)
        self.depth -= 1
        return value

    def value(self, lowest_level: int) -> Number:
        """Evaluate a signed value and the operators after it whose precedence is at least ``lowest_level``."""
        value = self.signed()
        while (operation := _OPERATIONS.get(self.tokens[0])) and operation[
            0
        ] >= lowest_level:
            level, operate = operation
            # Operators of equal precedence are applied from left to right, powers from right to left.
            if self.tokens.pop(0) == "**":
                operand = self.nested(level)
            else:
                operand = self.value(level + 1)
            value = _check_range(operate(value, operand))
        return value

    def signed(self) -> Number:
        """Evaluate a value with any number of signs before it."""
        negative = False
        while self.tokens[0] in ("+", "-"):
            negative ^= self.tokens.pop(0) == "-"
        value = self.atom()
        return -value if negative else value

    def atom(self) -> Number:
        """Evaluate a number, a parameter, a constant, a function call or an expression in parentheses."""
        token = self.tokens.pop(0)
        if token == "(":
            value = self.nested()
            self.expect(")")
            return value
        if token[:1].isdigit() or token[:1] == ".":
            return parse_number(token)
        if token[:1] == "&":
            return self.lookup(token[1:].strip().lower())
        name = token.lower()
        if self.tokens[:1] == ["("]:
            return self.call(name)
        if not name.isidentifier():
            self.tokens.insert(0, token)
            raise self.unexpected()
        return _CONSTANTS[name] if name in _CONSTANTS else self.lookup(name)

    def call(self, name: str) -> Number:
        """Evaluate a function call."""
        if name not in _FUNCTIONS:
            raise ExpressionError(
                f"{name!r} is not a function of *PARAMETER_EXPRESSION"
            )
        arity, function = _FUNCTIONS[name]
        self.expect("(")
        arguments = [self.nested()]
        while self.tokens[0] == ",":
            self.tokens.pop(0)
            arguments.append(self.nested())
        self.expect(")")
        if len(arguments) != arity:
            raise ExpressionError(
                f"{name}() takes {arity} values, found {len(arguments)}"
            )
        return _check_range(function(*arguments))

    def expect(self, sign: str) -> None:
        """Remove the next token, which must be the character ``sign``."""
        if self.tokens[0] != sign:
            raise self.unexpected()
        self.tokens.pop(0)

    def unexpected(self) -> ExpressionError:
        """Return the error for an unexpected next token."""
        token = repr(self.tokens[0]) if self.tokens[0] else "the end"
        return ExpressionError(
            f"{self.text!r} is not an expression (found {token}, expected an operator, a value or its end)"
        )


def _split_tokens(text: str) -> Iterator[str]:
    """Split the text of an expression into tokens."""
    position = 0
    text = text.rstrip()
    token = re.compile(_TOKEN, re.ASCII | re.IGNORECASE)
    while position < len(text):
        match = token.match(text, position)
        if match is None:
            raise ExpressionError(f"{text!r} is not a number or an expression")
        yield match[0].strip()
        position = match.end()


def _check_range(value: Number) -> Number:
    """Return the value; raise ExpressionError if it is infinite, undefined or too large."""
    if isinstance(value, int) and abs(value) >= _INTEGER_LIMIT:
        raise ExpressionError("an integer leaves the 64-bit range")
    if not math.isfinite(value):
        raise ExpressionError("a number leaves the range of doubles")
    return value
