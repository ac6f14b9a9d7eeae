# What `import d2rpick` offers, for type checkers and editors, which do not follow names that are imported on first use.
from d2rpick.api.checking import Findings as Findings, check as check
from d2rpick.api.costs import (
    Calibration as Calibration,
    PartTable as PartTable,
    calibrate as calibrate,
    parts as parts,
)
from d2rpick.api.judged_cards import JudgedCard as JudgedCard, card as card
from d2rpick.api.plans import (
    Exploration as Exploration,
    Plan as Plan,
    explore as explore,
    plan as plan,
)
from d2rpick.api.running import FirstRun as FirstRun, first as first, follow as follow
from d2rpick.api.runs import Run as Run, from_frame as from_frame, read as read
from d2rpick.api.studies import Study as Study, study as study
from d2rpick.api.suggestions import (
    Suggestion as Suggestion,
    Verdict as Verdict,
    suggest as suggest,
    verify as verify,
)
from d2rpick.base import __version__ as __version__
from d2rpick.base.errors import (
    ChangedError as ChangedError,
    ConfigurationError as ConfigurationError,
    D2RPickError as D2RPickError,
    DeckError as DeckError,
    FormatError as FormatError,
    HistoryError as HistoryError,
    RangeError as RangeError,
)
from d2rpick.choice.parts.cost import Weights as Weights
from d2rpick.report.follow import Event as Event
from d2rpick.vibration.oscillator import Oscillator as Oscillator

__all__: list[str]
