"""Define the grades of a pair and their verdicts, without importing numpy, which only the grading needs."""

from __future__ import annotations

from typing import Final

# Grades of a pair in ascending order.
POOR: Final = "poor"
FAIR: Final = "fair"
GOOD: Final = "good"
GRADES: Final = (POOR, FAIR, GOOD)

USE: Final = "use"
USE_WITH_CARE: Final = "use with care"
DO_NOT_USE: Final = "do not use"
VERDICTS: Final = {POOR: DO_NOT_USE, FAIR: USE_WITH_CARE, GOOD: USE}

# From this residual on, sentences do not give tenths of a per cent [-].
_COARSE: Final = 0.1
# Smallest accepted mean energy after td, relative to the reference run; well-switched computed runs had at least 0.77.
MIN_MEAN_ENERGY: Final = 0.7


def format_residual(residual: float) -> str:
    """Format a residual for a sentence, in per cent.

    Examples
    --------
    >>> format_residual(0.603), format_residual(0.039), format_residual(2e-5)
    ('60%', '3.9%', '0.0%')
    """
    return f"{residual:.0%}" if residual >= _COARSE else f"{residual:.1%}"
