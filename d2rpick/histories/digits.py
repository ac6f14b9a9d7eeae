"""Times as people read and type them: in six digits, which are typed again, and perhaps in another unit."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from collections.abc import Sequence

    import numpy as np
    from numpy.typing import NDArray

    Samples = NDArray[np.float64]

_DIGITS: Final = 6
# No file has more digits of a time, and a double has some to spare.
_EXACT: Final = 12


def as_read(time: float) -> float:
    """Give the time that is typed again where one was read.

    Examples
    --------
    >>> as_read(0.0128852793630525)
    0.0128853
    """
    return float(f"{time:.{_DIGITS}g}")


def first_as_read(time: float) -> float:
    """Give the time itself, or the one that is read for it where that lies before.

    Examples
    --------
    >>> first_as_read(0.0385101065), first_as_read(0.0385101965)
    (0.0385101, 0.0385101965)
    """
    return min(time, as_read(time))


def sum_as_read(time: float, further: float) -> float:
    """Add two times that were read without the digits that only a sum of doubles has.

    Examples
    --------
    >>> 0.2884 - 0.02, sum_as_read(0.2884, -0.02)
    (0.26839999999999997, 0.2684)
    """
    return float(f"{time + further:.{_EXACT}g}") if further else time


def not_before(time: float) -> float:
    """Give the first time in six digits that is not before this one.

    Examples
    --------
    >>> not_before(0.1000520661), not_before(0.25)
    (0.100053, 0.25)
    """
    read = as_read(time)
    return read if read >= time else _next(read)


def not_after(time: float) -> float:
    """Give the last time in six digits that is not after this one.

    Examples
    --------
    >>> not_after(0.1986539), not_after(0.25)
    (0.198653, 0.25)
    """
    return -not_before(-time)


def window_as_read(start: float, end: float) -> str:
    """Write a window so that every time from the one to the other, as they are read, lies in it.

    One that is too short for that is written in full.

    Examples
    --------
    >>> window_as_read(0.08800000000000001, 0.3108), window_as_read(0.10005206, 0.10005208)
    ('0.0880001 to 0.3108', '0.10005206 to 0.10005208')
    """
    low, high = not_before(start), not_after(end)
    return (
        f"{low:.{_DIGITS}g} to {high:.{_DIGITS}g}"
        if low <= high
        else f"{float(start)!r} to {float(end)!r}"
    )


def told_apart(numbers: Sequence[float]) -> list[str]:
    """Write numbers in six digits, or in as many as tell those apart that differ.

    Examples
    --------
    >>> told_apart([0.42, 0.0, 0.15]), told_apart([0.42, 0.4199999])
    (['0.42', '0', '0.15'], ['0.42', '0.4199999'])
    """
    texts = (
        [f"{number:.{digits}g}" for number in numbers] for digits in range(_DIGITS, 17)
    )
    return next(
        (found for found in texts if len({*found}) == len({*numbers})),
        [repr(float(n)) for n in numbers],
    )


def above(value: float, limit: float) -> str:
    """Write a value that is above a limit in three digits, or in as many as show that it is.

    Examples
    --------
    >>> above(0.31416, 0.2), above(0.20004, 0.2)
    ('0.314', '0.20004')
    """
    texts = (f"{value:.{digits}g}" for digits in range(3, 17))
    return next((text for text in texts if float(text) > limit), repr(float(value)))


def _next(read: float) -> float:
    """Go on by a unit of the last digit that is read."""
    mantissa, _, exponent = f"{read:.{_DIGITS - 1}e}".partition("e")
    return float(f"{int(mantissa.replace('.', '')) + 1}e{int(exponent) - _DIGITS + 1}")


# Nobody means a time in this first share of a record: a number that lies there in another unit was given in this one.
_NEVER_MEANT: Final = 0.01
# Nor in the first share of a record that a smaller unit would lead to: more likely the record was cut before that time.
_HARDLY_MEANT: Final = 0.05
# Nor a td that has fewer states before it: no period is seen in them, and hardly anything would be saved.  That its
# thousandfold lies in the record too takes at least a thousand states, or a td before the second one.
_FIRST_STATES: Final = 10


def in_smaller_unit(record: Samples, times: Sequence[float], argument: str) -> str:
    """Ask whether an argument that misses a ``record`` (n,) was given in a smaller unit, in which it lies in it.

    One that misses the record by less than its length does so in the record's own unit.
    """
    first, last = float(record[0]), float(record[-1])
    if (
        any(first <= time <= last for time in times if time)
        or times[-1] < 2 * last - first
    ):
        return ""
    least = max(first, 0.0) + _HARDLY_MEANT * (last - first)
    for unit, size in (("ms", 1e-3), ("us", 1e-6)):
        values = _scaled(times, size)
        if least <= values[-1] and all(first <= value <= last for value in values):
            return _question(unit, argument, values)
    return ""


def in_larger_unit(
    record: Samples, times: Sequence[float], argument: str, unit: str = ""
) -> str:
    """Ask whether an argument among the first states of a ``record`` (n,) was given in s, and that is in ms or us."""
    values = in_the_record(record, times, unit)
    return _question("s", argument, values) if values else ""


def in_the_record(
    record: Samples, times: Sequence[float], unit: str = ""
) -> list[float]:
    """Turn times among the first ten states of a ``record`` (n,) from s into the ms or us of the record.

    Where neither the thousandfold nor the millionfold is a time of the record that somebody may mean, into nothing.
    ``unit`` is that of the record, where its file names it.  The start of the record is in any unit what it is.

    Examples
    --------
    >>> import numpy as np
    >>> record = np.linspace(0, 150, 1501)
    >>> in_the_record(record, [0.064]), in_the_record(record, [0.64]), in_the_record(record, [0.0])
    ([64.0], [], [])
    """
    first, last = float(record[0]), float(record[-1])
    early = float(record[min(_FIRST_STATES, record.size) - 1])
    if (
        unit == "s"
        or times[-1] <= first
        or not all(first <= time <= early for time in times)
    ):
        return []
    least = min(early, first + _NEVER_MEANT * (last - first))
    for size in (
        1e6,
        1e3,
    ):  # where both fit, the smaller one is no time of the record that anybody means
        values = _scaled(times, size)
        if least <= values[-1] <= last:
            return values
    return []


def _scaled(times: Sequence[float], size: float) -> list[float]:
    return [float(f"{time * size:.12g}") for time in times]


def _question(unit: str, argument: str, values: Sequence[float]) -> str:
    shown = " ".join(f"{value:g}" for value in values)
    return f"; was it meant in {unit}? Then give `{argument}` {shown}, in the unit of the record"
