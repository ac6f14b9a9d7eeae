"""Define the grades of a pair and their verdicts; separate from the grading, which needs numpy."""

from __future__ import annotations

from typing import Final

# In order from the worst to the best.
POOR: Final = "poor"
FAIR: Final = "fair"
GOOD: Final = "good"
GRADES: Final = (POOR, FAIR, GOOD)

USE: Final = "use"
USE_WITH_CARE: Final = "use with care"
DO_NOT_USE: Final = "do not use"
VERDICTS: Final = {POOR: DO_NOT_USE, FAIR: USE_WITH_CARE, GOOD: USE}
