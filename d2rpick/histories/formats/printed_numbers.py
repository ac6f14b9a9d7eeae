"""What the printed form of numbers tells: how finely they were written, and whether one was cut."""

from __future__ import annotations

import re
from functools import cache
from typing import TYPE_CHECKING, Final

import numpy as np

from d2rpick.base.errors import FormatError
from d2rpick.histories.history import EXACT, Precision, Samples
from d2rpick.histories.samples import median

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray


_PARTS = re.compile(r"[+-]?(\d*+)\.?+(\d*+)(?:[eEdD]([+-]?\d++))?")

# Digits that restore every double, and numbers that are not written with an exponent.
_LONGEST = 17
_PLAIN = r"[+-]?(?:0|[1-9]\d+)\.\d+"  # compiled where it is needed

# 15 significant digits are what every double keeps; a writer that shows so many meant to lose nothing.
_FULL = 15


def precisions(time: Sequence[str], energy: Sequence[str], moments: Samples) -> tuple[Precision, Precision]:
    """How finely time and energy were written, from a sample of their fields.

    One writer uses one format: the most significant digits seen in any field hold for both columns, since
    formats like ``%g`` drop trailing zeros; 15 or more mean that nothing was lost.  A column without
    exponents whose fields all have the same number of decimals is taken as written in fixed decimals.
    Times on an exactly uniform grid that show more decimals than the grid needs are the multiples of a step
    that was meant, and get the digits of the energy; with no decimal to spare they may be rounded to the grid.

    Parameters
    ----------
    time, energy : sequences of str
        Fields with a decimal point, at least one each.
    moments : array of shape (n,)
        The times as numbers, of the whole record [unit of the run].

    Examples
    --------
    >>> precisions(["0.001", "0.0025", "0.0041"], ["1.25000e+01"], np.array([0.001, 0.0025, 0.0041]))
    (Precision(digits=6, decimals=None), Precision(digits=6, decimals=None))
    """
    digits = 0
    for field in (*energy, *time):
        digits = max(digits, _significant(field))
        if digits >= _FULL:
            return EXACT, EXACT
    general = Precision(digits=max(digits, 1))
    time_decimals, energy_decimals = _fixed_decimals(time), _fixed_decimals(energy)
    time_fixed = time_decimals and not _is_finer_than_its_grid(time_decimals, moments)
    return (
        Precision(digits=general.digits, decimals=time_decimals) if time_fixed else general,
        Precision(digits=general.digits, decimals=energy_decimals) if energy_decimals else general,
    )


def is_whole(field: str, above: Sequence[str]) -> bool:
    """Whether a field at which a file breaks off is certainly not cut, judged by the fields above it.

    It is when the column has a format of constant length: always the same number of decimals (two or more)
    and of digits in the exponent, with a trailing zero somewhere, which shortest formats (``%g``) never
    write.  An exponent that could be the start of a longer one (``e-10`` of ``e-100``) remains in doubt.  It also is
    when it has the 17 digits that restore every double, as no field above has more, and no exponent can follow: that
    stands behind a mantissa of one digit before the point.

    Examples
    --------
    >>> is_whole("1.25", ["0.50", "0.75"]), is_whole("1.2", ["0.50", "0.75"]), is_whole("1.25", ["0.55"])
    (True, False, False)
    >>> is_whole("0.30000000000000004", ["0.1"]), is_whole("3.0000000000000004", ["0.1"])
    (True, False)
    """
    if above and _significant(field) == _LONGEST == max(_LONGEST, *map(_significant, above)):
        return re.fullmatch(_PLAIN, field, re.ASCII) is not None
    parts = [_PARTS.fullmatch(text) for text in (field, *above)]
    shapes = {(len(part[2]), len((part[3] or "").lstrip("+-"))) for part in parts if part}
    if None in parts or len(shapes) != 1:
        return False
    decimals, width = shapes.pop()
    padded = any(part[2].endswith("0") for part in parts[1:] if part)
    longest_start = 32  # no double has an exponent beyond 324
    exponent = parts[0][3] if parts[0] else None
    doubtful = width == 2 and exponent is not None and 10 <= abs(int(exponent)) <= longest_start
    return decimals > 1 and padded and not doubtful


def _significant(field: str) -> int:
    parts = _PARTS.fullmatch(field)
    if not parts:
        return 0
    digits = parts[1] + parts[2]
    return len(digits.lstrip("0")) or (len(digits) if parts[3] else 0)  # 0.00000E+00 has six


def _fixed_decimals(fields: Sequence[str]) -> int | None:
    parts = [_PARTS.fullmatch(field) for field in fields]
    decimals = {len(part[2]) if part and part[3] is None else 0 for part in parts}
    return decimals.pop() or None if len(decimals) == 1 else None


def _is_finer_than_its_grid(decimals: int, moments: Samples) -> bool:
    """Whether times are equidistant and their step could be written with fewer decimals."""
    if moments.size < 3:
        return False
    steps = np.diff(moments)
    coarser = float(steps[0]) * 10.0 ** (decimals - 1)
    return bool(np.ptp(steps) <= 1e-9 * abs(steps[0])) and abs(coarser - round(coarser)) <= 1e-6 * abs(coarser)


# A restarted run goes on with its output interval; another curve or an unsorted table has another one.
_ALIKE = 2.0


def of_one_run(time: Samples, place: Callable[[int], str]) -> Samples:
    """Give times (n,) back; FormatError, with the place of the state, where they are not those of one run."""
    state = _not_a_restart(time)
    if state is None:
        return time
    raise FormatError(
        f"{place(state)}: time steps back from {time[state - 1]:g} to {time[state]:g}, increasing times or one restart "
        "were expected; sort the rows, or put each curve into its own file"
    )


def _not_a_restart(time: Samples) -> int | None:
    """Find the first state at which times (n,) step back as those of one run do not; None where they never do.

    One step back is a restart: it does not go back to the start, and the interval behind it, as the median of all
    behind it, is half to twice the median of those before.

    Examples
    --------
    >>> _not_a_restart(np.array([0.0, 1.0, 2.0, 3.0, 1.5, 2.5])), _not_a_restart(np.array([0.0, 1.0, 0.0, 1.0]))
    (None, 2)
    """
    back = np.flatnonzero(time[1:] < time[:-1]) + 1
    if back.size == 0:
        return None
    first = int(back[0])
    if back.size > 1 or time[first] <= time[0]:
        return first
    before, behind = (np.diff(one) for one in np.split(time, [first]))
    ratios = [_median(steps) / _median(before) for steps in (behind, behind[:1])]
    return first if any(ratio < 1 / _ALIKE or ratio > _ALIKE for ratio in ratios) else None


def _median(steps: Samples) -> float:
    steps = steps[steps > 0]  # equal printed times are no interval
    return float(median(steps)) if steps.size else np.nan  # which is neither too small nor too large


_NUMBER: Final = re.compile(rb" *([+-]?(?:\d+\.?\d*|\.\d+))(?:[EeDd]?([+-]\d+)|[EeDd](\d+))?")
_EXACT: Final = 22  # 10**22 is the largest power of ten that a double holds exactly
_SHRINKS, _NEGATIVE = 1 << 8, 1 << 9  # beside the two digits of an exponent, which fill a byte


@cache
def _scales(decimals: int) -> tuple[Samples, Samples]:
    """Factors and divisors of mantissas without point, one of both 1, by exponent and signs; NaN for none exact."""
    exponent = np.arange(_SHRINKS) * [[1], [-1]] - decimals
    powers = np.array([float(f"1e{size}") for size in range(_EXACT + 1)] + [np.nan])[
        np.minimum(abs(exponent), _EXACT + 1)
    ]
    factors = np.where(exponent > 0, powers, 1.0)
    return np.stack([factors, -factors]).ravel(), np.tile(np.where(exponent < 0, powers, 1.0).ravel(), 2)


def number(text: bytes) -> float:
    """Value of one right-justified Fortran field, NaN if it does not hold a finite number.

    Examples
    --------
    >>> [number(text) for text in (b"   4.87301E-03", b"   1.23457-100", b"   1.00000D+00", b"     1447")]
    [0.00487301, 1.23457e-100, 1.0, 1447.0]
    >>> [number(text) for text in (b"**************", b"      NaN", b"  1.0E+00 ", b"   1.0E+999")]
    [nan, nan, nan, nan]
    """
    match = _NUMBER.fullmatch(text)
    if match is None:
        return np.nan
    mantissa, signed, unsigned = match.groups()
    value = float(mantissa + b"E" + (signed or unsigned or b"0"))
    return value if np.isfinite(value) else np.nan


def decode(fields: NDArray[np.bytes_], decimals: int) -> Samples:
    """Values of fixed-width fields, each the very double that ``float()`` gives; NaN for what is no number.

    Fields of the usual shape, ``-d.dddddE+dd`` right-justified, are converted together: mantissa and power
    of ten are both exact doubles, so their one product or quotient is correctly rounded.  All others go
    through ``number``.

    Parameters
    ----------
    fields : array of bytes of one width, shape (n,)
        As written in the file.
    decimals : int
        Places behind the point in the usual shape.

    Returns
    -------
    array of shape (n,)

    Examples
    --------
    >>> decode(np.array([b"   4.87301E-03", b"  -8.05000E+02", b"   2.00000E-20"]), decimals=5).tolist()
    [0.00487301, -805.0, 2e-20]
    """
    if not fields.size:
        return np.empty(0)
    width = fields.dtype.itemsize
    column = np.ascontiguousarray(np.ascontiguousarray(fields).view(np.uint8).reshape(-1, width).T)
    point, mark = width - 5 - decimals, width - 4
    negative, shrinks = column[point - 2] == ord("-"), column[mark + 1] == ord("-")
    # wraps around for what is below "0", so one comparison is enough
    digits = column[[point - 1, *range(point + 1, mark), mark + 2, mark + 3]] - np.uint8(ord("0"))
    usual = digits.max(axis=0) <= 9
    usual &= (column[point] == ord(".")) & (column[mark] == ord("E"))
    usual &= negative | (column[point - 2] == ord(" "))
    usual &= shrinks | (column[mark + 1] == ord("+"))
    usual &= np.all(column[: point - 2] == ord(" "), axis=0)

    weights = np.array([float(10**place) for place in range(decimals, -1, -1)])
    values: Samples = weights @ digits[:-2].astype(np.float64)  # exact
    tens, ones = digits[-2:]
    scale = tens * np.uint8(10) + ones + shrinks * np.uint16(_SHRINKS) + negative * np.uint16(_NEGATIVE)
    factors, divisors = (table.take(scale) for table in _scales(decimals))
    values *= factors
    values /= divisors

    far = usual & np.isnan(values)
    values[far] = [float(text) for text in fields[far].tolist()]
    for row in np.flatnonzero(~usual):
        values[row] = number(fields[row : row + 1].tobytes())
    return values
