"""The flight that a choice lies in, explored: what its page shows beside the choice."""

from __future__ import annotations

from typing import TYPE_CHECKING

from d2rpick.choice.suggest_td import bounds
from d2rpick.choice.trade_off import STEPS, TradeOff, explore_of
from d2rpick.errors import RangeError

if TYPE_CHECKING:
    from d2rpick.choice.of_run import Reference
    from d2rpick.choice.situation import Situation


def explored_around(
    reference: Reference, situation: Situation, window: tuple[float, float] | None = None, *, steps: int = STEPS
) -> TradeOff | None:
    """Find what other td cost than that of a situation.

    Parameters
    ----------
    reference : Reference
    situation : Situation
        What the record tells about the td that was asked for or chosen.
    window : (float, float), optional
        Where td was looked for [time].  Default: the flight that td lies in.
    steps : int
        So many td on an even grid.

    Returns
    -------
    TradeOff or None
        None where no flight is known.
    """
    flight = situation.flight
    if window is None and flight.start is None:
        return None
    try:
        return explore_of(
            reference, situation.settings, window or bounds(situation.history, flight), td=situation.td, steps=steps
        )
    except RangeError:  # the window holds no state
        return None
