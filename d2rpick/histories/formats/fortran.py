"""Numbers as Fortran prints them in fixed columns: text to doubles, many at a time, the same as ``float()``."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Final

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from d2rpick.histories.history import Samples

_NUMBER: Final = re.compile(rb" *([+-]?(?:\d+\.?\d*|\.\d+))(?:[EeDd]?([+-]\d+)|[EeDd](\d+))?")
_EXACT: Final = 22  # 10**22 is the largest power of ten that a double holds exactly
_POWERS: Final = np.array([float(f"1e{exponent}") for exponent in range(_EXACT + 1)])


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
    mantissa_columns = [point - 1, *range(point + 1, mark)]
    digit = column - np.uint8(ord("0"))  # wraps around for what is below "0", so one comparison is enough
    negative, shrinks = column[point - 2] == ord("-"), column[mark + 1] == ord("-")
    usual = np.max(digit[[*mantissa_columns, mark + 2, mark + 3]], axis=0) <= 9
    usual &= (column[point] == ord(".")) & (column[mark] == ord("E"))
    usual &= negative | (column[point - 2] == ord(" "))
    usual &= shrinks | (column[mark + 1] == ord("+"))
    usual &= np.all(column[: point - 2] == ord(" "), axis=0)

    whole = np.zeros(fields.size, np.int64)
    for place in mantissa_columns:
        whole *= 10
        whole += digit[place]
    mantissa = whole.astype(np.float64)
    exponent = digit[mark + 2].astype(np.int16) * 10 + digit[mark + 3]
    exponent = np.where(shrinks, -exponent, exponent) - decimals
    values: Samples = np.where(
        exponent < 0,
        mantissa / _POWERS[np.clip(-exponent, 0, _EXACT)],
        mantissa * _POWERS[np.clip(exponent, 0, _EXACT)],
    )
    np.negative(values, out=values, where=negative)

    far = usual & (np.abs(exponent) > _EXACT)
    values[far] = [float(text) for text in fields[far].tolist()]
    for row in np.flatnonzero(~usual):
        values[row] = number(fields[row : row + 1].tobytes())
    return values
