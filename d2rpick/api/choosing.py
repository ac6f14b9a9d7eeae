"""Define the keyword arguments that determine how pairs are chosen and judged.

They follow from `d2rpick.choice.options.ChoiceOptions`: ``python -m tests.generated_arguments`` writes this module.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, TypedDict

if TYPE_CHECKING:
    from d2rpick.vibration.oscillator import Oscillator


class JudgingOptions(TypedDict, total=False):
    """Options that determine how a pair is judged.  None stands for the default.

    Times have the unit of the history, or are strings with a unit, such as ``"64ms"``.

    ``after``: end of the load (default: found from the record).  ``landing``: time of the next contact after the
    flight; td is at least one margin earlier (default: found from the record).  ``margin``: time kept free after the
    load and before the next contact (default: after the load, none; before the contact, from the flight and the
    vibration, or none with ``td`` but without ``landing``).  ``tolerance``: largest allowed frozen-deformation error
    or, with the basis energy, largest allowed level error. Not used with the basis modal (default: 0.2).
    ``max_kinetic_share``: reject a td at which a larger fraction of the vibration energy is kinetic.
    ``max_residual``: reject a pair with a larger residual.  ``min_quality``: exit with 1 if the grade is lower than
    this (poor: do not use, fair: use with care, good: use) (default: fair).
    """

    after: float | str | None
    landing: float | str | None
    margin: float | str | None
    tolerance: float | None
    max_kinetic_share: float | None
    max_residual: float | None
    min_quality: str | None


class Choosing(JudgingOptions, total=False):
    """Options that determine how pairs are chosen and judged, as in ``d2rpick suggest``.  None stands for the default.

    ``fit_window``: time range to which the oscillator is fitted.  ``strict``: recommend no pair if the end of the load
    is known from the energy alone (default: False).  ``keep_vibration``: grade the vibration by its residual alone,
    even if the next contact has far more energy than the error (default: False).  ``cost_share``: fraction of the CPU
    time per time step that is saved while the parts are rigid; used to predict the saving.  ``step_ratio``: time step
    while the parts are rigid, divided by the time step before; at least 1 (default: 1).  ``oscillator``: given instead
    of identified, with ``v0``.  ``v0``: velocity of the frame of ``oscillator`` at time 0.  ``replay``: False: judge
    by the energy level alone, without an oscillator (default: True).
    """

    fit_window: tuple[float | str, float | str] | None
    strict: bool | None
    keep_vibration: bool | None
    cost_share: float | None
    step_ratio: float | None
    oscillator: Oscillator | None
    v0: float | None
    replay: bool | None
