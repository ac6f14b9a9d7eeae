"""What the analyst asks for."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from d2rpick.choice.cost import ByDeck
    from d2rpick.deck.geometry import Placement
    from d2rpick.flight.bodies import RigidBody
    from d2rpick.vibration.modes import Mode


@dataclass(frozen=True)
class Settings:
    """What the analyst asks for; times in the unit of the history.

    ``after``: the load ends here (None: found from the record).  ``margin``: kept clear after the load and before
    the next contact (None: nothing, but where td is chosen what `d2rpick.choice.flights` derives before the contact).
    ``tolerance``: on the lock-in error, on the level error where no oscillator is known.
    ``max_kinetic_share``, ``max_residual``: limits that a recommendation must keep, or None.  ``oscillator``:
    given instead of identified.  ``fit_window``: the oscillator is identified there.  ``replay`` False: judge by
    the energy level alone.  ``strict``: accept no tr of a flight that is not certain.
    ``cost_share``, ``step_ratio``: of the switched parts in the cost of a step, and of the step while rigid to that
    while deformable; without the first nothing is said of the run time.
    ``bodies``: what the parts become while they are rigid, by a deck; None without one, empty where it does not tell.
    Then one body is assumed.
    ``placement``: where the deck puts the parts, or None without one.
    ``by_deck``: the files that these, and a cost share that is not given, come from; None where no deck tells anything.
    ``kept_off``: main nodes of rigid bodies that the run of a Radioss deck keeps off.  ``ruined``: what ruins that run.
    """

    after: float | None = None
    margin: float | None = None
    tolerance: float = 0.2
    max_kinetic_share: float | None = None
    max_residual: float | None = None
    oscillator: Mode | None = None
    fit_window: tuple[float, float] | None = None
    replay: bool = True
    strict: bool = False
    cost_share: float | None = None
    step_ratio: float = 1.0
    bodies: tuple[RigidBody, ...] | None = None
    placement: Placement | None = field(default=None, compare=False, repr=False)
    by_deck: ByDeck | None = field(default=None, compare=False, repr=False)
    kept_off: tuple[int, ...] = field(default=(), compare=False, repr=False)
    ruined: tuple[str, ...] = field(default=(), compare=False, repr=False)
