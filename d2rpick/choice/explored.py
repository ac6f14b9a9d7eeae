"""The flight that a choice lies in, explored: what its page shows beside the choice."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from d2rpick.choice.flights import bounds
from d2rpick.choice.trade_off import TradeOff, explore_of
from d2rpick.errors import RangeError

if TYPE_CHECKING:
    from d2rpick.choice.of_run import Reference
    from d2rpick.choice.plan import Plan
    from d2rpick.choice.situation import Situation

# td on the grid of a page: some pixels of a screen apart, and finer than anybody drags.
_STEPS: Final = 120
# td of a flight in a plan of many: a curve of fewer points tells little.
_LEAST: Final = 40


def explored_flights(reference: Reference, plan: Plan) -> tuple[TradeOff, ...]:
    """Find what other td cost than those of a plan, for each of its flights; its grids are the coarser the more."""
    answers = {row.number: row.answer for row in plan.rows if row.answer and row.window}
    landings = {row.number: row.flight.end for row in plan.rows}
    reference = reference._replace(history=plan.history)
    steps = max(_STEPS // max(len(answers), 1), _LEAST)
    found = (
        explored_around(reference, one.situation, one.td_window, steps=steps, since=landings.get(number - 1))
        for number, one in answers.items()
    )
    return tuple(one for one in found if one)


def explored_around(
    reference: Reference,
    situation: Situation,
    window: tuple[float, float] | None = None,
    *,
    steps: int | None = None,
    since: float | None = None,
) -> TradeOff | None:
    """Find what other td cost than that of a situation.

    Parameters
    ----------
    reference : Reference
    situation : Situation
        What the record tells about the td that was asked for or chosen.
    window : (float, float), optional
        Where td was looked for [time].  Default: the flight that td lies in.
    steps : int, optional
        So many td on an even grid.  Default: as many as a page needs.
    since : float, optional
        No flight is taken to begin before [time].

    Returns
    -------
    TradeOff or None
        None where no flight is known.
    """
    flight = situation.flight
    if window is None and flight.start is None:
        return None
    try:
        span = window or bounds(situation.history, flight)
        return explore_of(reference, situation.settings, span, td=situation.td, steps=steps or _STEPS, since=since)
    except RangeError:  # the window holds no state
        return None
