"""Round and convert times as users read and type them, i.e. with six digits and an optional unit."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from collections.abc import Sequence
    from decimal import Decimal

    import numpy as np
    from numpy.typing import NDArray

    Samples = NDArray[np.float64]

_DIGITS: Final = 6  # Number of significant digits with which times are printed.
# Number of significant digits of a sum of times; times in files have fewer digits, and a double has more.
_EXACT: Final = 12

# Sizes of the time units, keyed by name [s], as strings because 0.001 has no exact double.
_SIZES: Final = {
    **dict.fromkeys(("s", "sec", "second", "seconds"), "1"),
    **dict.fromkeys(("ms", "msec"), "1e-3"),
    **dict.fromkeys(("us", "µs", "μs"), "1e-6"),
    "ns": "1e-9",
    "min": "60",
    "h": "3600",
}
_TYPED_TIME: Final = (
    r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d{1,3})?)\s*([A-Za-zµμ]+)\s*"
)

# A time converted to ms or us is plausible if it is at least this fraction of the record after its start [-].
_NEVER_MEANT: Final = 0.01
# A converted time is suggested only if it lies at least this fraction of the record after the start [-].
_HARDLY_MEANT: Final = 0.05
# A td within this number of first states is assumed to be in another unit, because it would hardly save time.
# In a record of fewer than 1000 states, a td and 1000 times this td cannot both be valid.
_FIRST_STATES: Final = 10


def round_as_read(time: float) -> float:
    """Round a time to the six digits with which it is printed, because users type printed times.

    Examples
    --------
    >>> round_as_read(0.0128852793630525)
    0.0128853
    """
    return float(f"{time:.{_DIGITS}g}")


def round_to_first_as_read(time: float) -> float:
    """Return the time rounded to six printed digits; if this is later than the time itself, return the time.

    Examples
    --------
    >>> round_to_first_as_read(0.0385101065), round_to_first_as_read(0.0385101965)
    (0.0385101, 0.0385101965)
    """
    return min(time, round_as_read(time))


def sum_times_as_read(time: float, further: float) -> float:
    """Add two printed times without the spurious digits of floating-point sums.

    Examples
    --------
    >>> 0.2884 - 0.02, sum_times_as_read(0.2884, -0.02)
    (0.26839999999999997, 0.2684)
    """
    return float(f"{time + further:.{_EXACT}g}") if further else time


def round_up_as_read(time: float) -> float:
    """Return the earliest six-digit time that is not before this time.

    Examples
    --------
    >>> round_up_as_read(0.1000520661), round_up_as_read(0.25)
    (0.100053, 0.25)
    """
    printed = round_as_read(time)
    return printed if printed >= time else _find_next_printed(printed)


def round_down_as_read(time: float) -> float:
    """Return the latest six-digit time that is not after this time.

    Examples
    --------
    >>> round_down_as_read(0.1986539), round_down_as_read(0.25)
    (0.198653, 0.25)
    """
    return -round_up_as_read(-time)


def format_window(start: float, end: float) -> str:
    """Format a window so that its printed ends lie within it. A very short window is printed with all digits.

    Examples
    --------
    >>> format_window(0.08800000000000001, 0.3108), format_window(0.10005206, 0.10005208)
    ('0.0880001 to 0.3108', '0.10005206 to 0.10005208')
    """
    low = round_up_as_read(start)
    high = round_down_as_read(end)
    if low > high:
        return f"{float(start)!r} to {float(end)!r}"
    return f"{low:.{_DIGITS}g} to {high:.{_DIGITS}g}"


def format_distinctly(numbers: Sequence[float]) -> list[str]:
    """Format numbers with six digits, or with as many digits as are needed to distinguish different numbers.

    Examples
    --------
    >>> format_distinctly([0.42, 0.0, 0.15]), format_distinctly([0.42, 0.4199999])
    (['0.42', '0', '0.15'], ['0.42', '0.4199999'])
    """
    for digits in range(_DIGITS, 17):
        texts = [f"{number:.{digits}g}" for number in numbers]
        if len({*texts}) == len({*numbers}):
            return texts
    return [repr(float(number)) for number in numbers]


def format_beyond_limit(value: float, limit: float) -> str:
    """Format a value beyond a limit with three digits, or with more if three would hide how far it is beyond the limit.

    Examples
    --------
    >>> format_beyond_limit(0.31416, 0.2), format_beyond_limit(0.20004, 0.2), format_beyond_limit(0.19996, 0.2)
    ('0.314', '0.20004', '0.19996')
    """
    side = value > limit
    texts = (f"{value:.{digits}g}" for digits in range(3, 17))
    return next(
        (
            text
            for text in texts
            if float(text) != limit and (float(text) > limit) == side
        ),
        repr(float(value)),
    )


def parse_seconds(text: str) -> Decimal | None:
    """Return the exact value of a time that has a unit [s]; None for any other string.

    Examples
    --------
    >>> [str(parse_seconds(text)) for text in ("64ms", "2 min", "64", "forms")]
    ['0.064', '120', 'None', 'None']
    """
    typed_time = re.fullmatch(_TYPED_TIME, text, re.ASCII)
    size = _SIZES.get(typed_time[2]) if typed_time else None
    if typed_time is None or size is None:
        return None
    from decimal import Decimal  # Most times are typed without a unit.

    return Decimal(typed_time[1]) * Decimal(size)


def convert_to_unit(text: str, unit: str) -> float | None:
    """Convert a time with a unit to a number in another ``unit``; None for any other text or an unknown unit.

    Examples
    --------
    >>> convert_to_unit("64ms", "s"), convert_to_unit("64 ms", "ms"), convert_to_unit("64ms", "")
    (0.064, 64.0, None)
    """
    seconds = parse_seconds(text)
    size = _SIZES.get(unit.casefold())
    if seconds is None or size is None:
        return None
    return float(seconds / type(seconds)(size))


def _find_next_printed(printed: float) -> float:
    """Return the next larger number with six digits."""
    mantissa, _, exponent = f"{printed:.{_DIGITS - 1}e}".partition("e")
    return float(f"{int(mantissa.replace('.', '')) + 1}e{int(exponent) - _DIGITS + 1}")


def ask_for_smaller_unit(record: Samples, times: Sequence[float], argument: str) -> str:
    """Return text that asks whether an argument's times outside a ``record`` (n,) were given in a smaller unit.

    The text is empty if no smaller unit explains the values.
    """
    unit, values = find_smaller_unit(record, times)
    return _ask_for_unit(unit, argument, values) if unit else ""


def find_smaller_unit(
    record: Samples, times: Sequence[float]
) -> tuple[str, list[float]]:
    """Return the smaller unit in which times outside a ``record`` (n,) lie inside it, and the converted times.

    The unit is ms or us; it is empty if neither explains the values. Times that lie outside the record by less than its
    length are assumed to be in the unit of the record.
    """
    first = float(record[0])
    last = float(record[-1])
    if (
        any(first <= time <= last for time in times if time)
        or times[-1] < 2 * last - first
    ):
        return "", []
    earliest = max(first, 0.0) + _HARDLY_MEANT * (last - first)
    for unit, size in (("ms", 1e-3), ("us", 1e-6)):
        values = _scale_times(times, size)
        is_inside = all(first <= value <= last for value in values)
        if earliest <= values[-1] and is_inside:
            return unit, values
    return "", []


def ask_for_larger_unit(
    record: Samples, times: Sequence[float], argument: str, unit: str = ""
) -> str:
    """Return text that asks whether early times for a ``record`` (n,) in ms or us were given in s.

    The text is empty if this does not explain the values.
    """
    values = convert_to_unit_of_record(record, times, unit)
    return _ask_for_unit("s", argument, values) if values else ""


def convert_to_unit_of_record(
    record: Samples, times: Sequence[float], unit: str = ""
) -> list[float]:
    """Convert times among the first ten states of a ``record`` (n,) from seconds to the record's unit, ms or us.

    Return an empty list if neither 1000 times nor 1,000,000 times their value is a plausible time of the record.
    ``unit`` is the unit of the record if its file contains it. The start of the record has the same value in any unit.

    Examples
    --------
    >>> import numpy as np
    >>> record = np.linspace(0, 150, 1501)
    >>> [convert_to_unit_of_record(record, [time]) for time in (0.064, 0.64, 0.0)]
    [[64.0], [], []]
    """
    first = float(record[0])
    last = float(record[-1])
    early = float(record[min(_FIRST_STATES, record.size) - 1])
    if (
        unit == "s"
        or times[-1] <= first
        or not all(first <= time <= early for time in times)
    ):
        return []
    earliest = min(early, first + _NEVER_MEANT * (last - first))
    # The unit us comes first, because a value in ms would lie too early in the record if both units are possible.
    for size in (1e6, 1e3):
        values = _scale_times(times, size)
        if earliest <= values[-1] <= last:
            return values
    return []


def _scale_times(times: Sequence[float], size: float) -> list[float]:
    """Multiply times by the size of a unit without the spurious digits of floating-point products."""
    return [float(f"{time * size:.12g}") for time in times]


def _ask_for_unit(unit: str, argument: str, values: Sequence[float]) -> str:
    """Return text that asks whether an argument was given in another unit, and that shows the converted values."""
    numbers = " ".join(f"{value:g}" for value in values)
    return f"; was it meant in {unit}? Then give `{argument}` {numbers}, in the unit of the record"
