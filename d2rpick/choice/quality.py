"""How good a pair is: good, fair or poor, and why it is none better."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from d2rpick.choice.warnings import POOR_KINETIC_SHARE
from d2rpick.vibration.identify import MIN_PLASTIC, MIN_SAMPLES_PER_PERIOD
from d2rpick.vibration.measures import TOLERATED_GROWTH, wrong_sign

if TYPE_CHECKING:
    from d2rpick.choice.candidates import Candidate
    from d2rpick.choice.expectation import Expectation
    from d2rpick.choice.situation import Situation
    from d2rpick.histories.history import Samples

# From the worst to the best.
GRADES: Final = ("poor", "fair", "good")
# Of the vibration [-].  A residual of a half is a quarter of its energy; beyond, the error is what an engineer sees of
# the motion after td.  A good pair keeps what the tolerance on tr asks for by default.
_MOST_FAIR, _MOST_GOOD = 0.5, 0.2
# What a further mode may make of it at most in a good pair: a good grade is a promise.
_MOST_HIDDEN: Final = 0.3
# Of the standard deviation: an energy passes its mean when it gets so far beyond it; noise near it does not count.
_BAND: Final = 0.25
# Decimals of a share that people read.
_READ: Final = 2
_NOT_CERTAIN: Final = "the flight is not certain"
_UNKNOWN_LOAD: Final = "kinetic and internal energy change together, by gravity or by another load"


class Quality(NamedTuple):
    """A ``grade``, one of `GRADES`, and the ``reasons`` why it is none better; empty for "good"."""

    grade: str
    reasons: tuple[str, ...] = ()

    @property
    def told(self) -> str:
        """The grade, and why it is none better."""
        return f"{self.grade}{': ' * bool(self.reasons)}{'; '.join(self.reasons)}"


def quality_of(situation: Situation, best: Candidate, expected: Expectation | None) -> Quality:
    """Grade the recommended tr of a td.

    ``expected`` is what the energy alone tells of the time after td, None on another basis.
    """
    flight = situation.flight
    poor = (*situation.settings.ruined, *(_UNKNOWN_LOAD,) * flight.unknown_load)
    poor += () if situation.at_rest else tuple(_poor(situation, best, expected))
    if poor:
        return Quality("poor", poor)
    if situation.at_rest:
        return Quality("good") if flight.certain else Quality("fair", (_NOT_CERTAIN,))
    fair = tuple(_fair(situation, best, expected))
    return Quality("fair" if fair else "good", fair)


def _poor(situation: Situation, best: Candidate, expected: Expectation | None) -> list[str]:
    found = []
    if best.residual is not None and best.residual > _MOST_FAIR:
        found.append(f"the vibration after td is off by {best.residual:.0%}")
    if expected and round(expected.kinetic_share, _READ) > POOR_KINETIC_SHARE:  # an estimate: what is read counts
        found.append(f"about {expected.kinetic_share:.0%} of the vibration energy is kinetic at td")
    if situation.basis == "energy":
        found += _of_record(situation)
    return found


def _of_record(situation: Situation) -> list[str]:
    """Why the samples of the flight up to td are none that a level can be read from."""
    start = situation.flight.start
    _, energy = situation.history.between(-np.inf if start is None else start, situation.td)
    found = []
    if energy.size and energy.min() < MIN_PLASTIC * np.abs(energy).max():
        found.append("the record falls below zero, as no internal energy does")
    states = states_per_period(energy)
    if states is not None and states < MIN_SAMPLES_PER_PERIOD:
        found.append(
            f"the record has {states:.2g} states per period, fewer than the {MIN_SAMPLES_PER_PERIOD} that show a level"
        )
    return found


def _is_loose(best: Candidate) -> bool:
    """Whether the lock-in error may be above what is good, as far as tr is known."""
    if best.tr_high is None or best.timing_tolerance is None:
        return False
    return TOLERATED_GROWTH * (best.tr_high - best.tr) > _MOST_GOOD * best.timing_tolerance


def _fair(situation: Situation, best: Candidate, expected: Expectation | None) -> list[str]:
    found = []
    if best.residual is None:
        off = f"{wrong_sign(expected.kinetic_share if expected else 0.0):.0%}"
        found.append(
            f"the sign of the deformation is unknown, and with a wrong one the vibration after td is off by {off}"
        )
    elif best.residual > _MOST_GOOD:
        found.append(f"the vibration after td is off by {best.residual:.0%}")
    elif _is_loose(best):
        found.append("tr is not known well enough for its timing tolerance")
    if best.residual_high is not None and best.residual_high > _MOST_HIDDEN:
        found.append(f"with a further mode hidden in the record it may be off by {best.residual_high:.0%}")
    if not situation.flight.certain:
        found.append(_NOT_CERTAIN)
    return found


def states_per_period(energy: Samples) -> float | None:
    """How many samples a period of the energy has on average: it passes its mean twice in one; None without a period.

    Examples
    --------
    >>> round(states_per_period(np.sin(np.arange(1000) * 2 * np.pi / 8) ** 2))
    4
    """
    if energy.size < 2:
        return None
    off = energy - energy.mean()
    side = np.sign(off[np.abs(off) > _BAND * off.std()])
    passes = np.flatnonzero(np.diff(side)).size
    return 2 * energy.size / passes if passes > 1 else None
