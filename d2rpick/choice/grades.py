"""Grades of a pair of times, and the verdict that each stands for; apart from what finds them, which takes numpy."""

from __future__ import annotations

from typing import Final

# From the worst to the best.
POOR: Final = "poor"
FAIR: Final = "fair"
GOOD: Final = "good"
GRADES: Final = (POOR, FAIR, GOOD)

USE: Final = "use"
USE_WITH_CARE: Final = "use with care"
DO_NOT_USE: Final = "do not use"
VERDICTS: Final = {POOR: DO_NOT_USE, FAIR: USE_WITH_CARE, GOOD: USE}
