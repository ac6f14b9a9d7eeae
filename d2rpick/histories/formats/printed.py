"""What the printed form of numbers tells: how finely they were written, and whether one was cut."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import numpy as np

from d2rpick.histories.history import EXACT, Precision

if TYPE_CHECKING:
    from collections.abc import Sequence

    from d2rpick.histories.history import Samples

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
    shapes = {(len(part[2]), _exponent_width(part[3])) for part in parts if part}
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


def _exponent_width(exponent: str | None) -> int:
    return len(exponent.lstrip("+-")) if exponent else 0
