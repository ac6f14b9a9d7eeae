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
