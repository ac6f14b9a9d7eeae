"""Whether a time was given in another unit than that of its record."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from collections.abc import Sequence

    import numpy as np
    from numpy.typing import NDArray

    Samples = NDArray[np.float64]

# Nobody means a time in this first share of a record: a number that lies there in another unit was given in this one.
_NEVER_MEANT: Final = 0.01
# Nor a td that has fewer states before it: no period is seen in them, and hardly anything would be saved.  That its
# thousandfold lies in the record too takes at least a thousand states, or a td before the second one.
_FIRST_STATES: Final = 10


def in_smaller_unit(record: Samples, times: Sequence[float], argument: str) -> str:
    """Ask whether an argument that misses a ``record`` (n,) was given in a smaller unit, in which it lies in it.

    One that misses the record by less than its length does so in the record's own unit.
    """
    first, last = float(record[0]), float(record[-1])
    if any(first <= time <= last for time in times if time) or times[-1] < 2 * last - first:
        return ""
    least = max(first, 0.0) + _NEVER_MEANT * (last - first)
    for unit, size in (("ms", 1e-3), ("us", 1e-6)):
        values = _scaled(times, size)
        if least <= values[-1] and all(first <= value <= last for value in values):
            return _question(unit, argument, values)
    return ""


def in_larger_unit(record: Samples, times: Sequence[float], argument: str, unit: str = "") -> str:
    """Ask whether an argument among the first states of a ``record`` (n,) was given in s, and that is in ms or us."""
    values = in_the_record(record, times, unit)
    return _question("s", argument, values) if values else ""


def in_the_record(record: Samples, times: Sequence[float], unit: str = "") -> list[float]:
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
    if unit == "s" or times[-1] <= first or not all(first <= time <= early for time in times):
        return []
    least = min(early, first + _NEVER_MEANT * (last - first))
    for size in (1e6, 1e3):  # where both fit, the smaller one is no time of the record that anybody means
        values = _scaled(times, size)
        if least <= values[-1] <= last:
            return values
    return []


def _scaled(times: Sequence[float], size: float) -> list[float]:
    return [float(f"{time * size:.12g}") for time in times]


def _question(unit: str, argument: str, values: Sequence[float]) -> str:
    shown = " ".join(f"{value:g}" for value in values)
    return f"; was it meant in {unit}? Then give `{argument}` {shown}, in the unit of the record"
