"""What switching saves: a formula with its inputs, for the published figures and for runs that were measured.

The run takes 1 - f (1 - (1 - c)/n) of the time without switching (`measures.run_time_share`): f is the rigid fraction
of the run, c the share of the switched elements in the cost of a step, n the step while rigid over that before.  c is
the share of all elements in a step times that of the switched ones among them, weighted by their cost.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from d2rpick.models.exhibit import Curve, Exhibit, Panel
from d2rpick.vibration.measures import run_time_share

# Hours of the pick-up truck without and with switching; neither its times nor its elements are published.
PICK_UP: Final = (25.5, 6.5)
# Of a step of the car: elements over all work, from legs with and without them.
_ELEMENTS_OF_STEP: Final = 0.87
# Step while everything is rigid (capped) over that while deformable, 20.00 of 21.54 us.
_CAPPED: Final = 20.00 / 21.54


class Run(NamedTuple):
    """A run whose processor time was measured with and without switching."""

    name: str
    rigid_fraction: float
    element_share: float
    element_cost: float
    step_ratio: float
    measured: float

    def predicted(self, share: float) -> float:
        """Saving when the switched elements take ``share`` of the cost of a step [-]."""
        return 1 - run_time_share(self.rigid_fraction, share, self.step_ratio)

    @property
    def by_cost(self) -> float:
        """Saving with elements weighted by their cost and by the share of elements in a step [-]."""
        return self.predicted(_ELEMENTS_OF_STEP * self.element_cost)

    @property
    def by_count(self) -> float:
        """Saving when the share of the elements is taken for that of the cost [-]."""
        return self.predicted(self.element_share)


# A car of 16 parts, 1516 elements, rigid for 96.8 of 240 ms; processor time of OpenRadioss 2026-08, one thread.
_RIGID: Final = 0.0968 / 0.24
RUNS: Final = (
    Run("all parts", _RIGID, 1.000, 0.970, _CAPPED, 0.306),
    Run("all but the part that lands first", _RIGID, 0.959, 0.893, 1.0, 0.270),
    Run("parts that have stopped deforming", _RIGID, 0.544, 0.382, 1.0, 0.126),
    Run("heavy parts", _RIGID, 0.149, 0.219, 1.0, 0.075),
)


def needed(share: float) -> float:
    """Rigid fraction with which the pick-up truck's saving needs this share of the cost [-].

    Examples
    --------
    >>> round(needed(1.0), 3), round(needed(0.85), 3)
    (0.745, 0.877)
    """
    return (1 - PICK_UP[1] / PICK_UP[0]) / share


def exhibit() -> Exhibit:
    """Predicted savings beside the measured ones, and what the published saving asks for."""
    published = 1 - PICK_UP[1] / PICK_UP[0]
    share = np.linspace(published, 1.0, 51)  # with less, no rigid fraction is enough
    number = np.arange(1.0, len(RUNS) + 1)
    columns = {
        "run": np.append(number, np.full(share.size - number.size, np.nan)), "share": share,
        "rigid_fraction": np.array([needed(float(one)) for one in share]),
    }  # fmt: skip
    for name, values in (
        ("measured", [one.measured for one in RUNS]), ("by_cost", [one.by_cost for one in RUNS]),
        ("by_count", [one.by_count for one in RUNS]),
    ):  # fmt: skip
        columns[name] = np.append(values, np.full(share.size - len(values), np.nan))
    dots = [
        Curve("measured", "measured", "dots", "run"), Curve("predicted by cost", "by_cost", "dots", "run"),
        Curve("predicted by number of elements", "by_count", "dots", "run"),
    ]  # fmt: skip
    panels = (
        (
            Panel("car of 16 parts, OpenRadioss", "saving [-]", tuple(dots), xlabel="set of parts"),
            Panel(f"what a saving of {published:.3f} asks for", "rigid fraction of the run [-]",
                  (Curve("n = 1", "rigid_fraction", "line", "share"),), xlabel="share of the cost of a step [-]"),
        ),
    )  # fmt: skip
    names = "; ".join(f"{place} {one.name}" for place, one in enumerate(RUNS, start=1))
    off = max(abs(one.by_cost - one.measured) for one in RUNS)
    return Exhibit(
        "saving", "What switching saves", 5, "section 5",
        f"A pick-up truck takes {PICK_UP[1]:g} instead of {PICK_UP[0]:g} h on 8 processors.",
        f"That is a saving of {published:.3f}; tr, td, the end and the parts are not published, so it cannot be "
        f"computed anew. By the formula it needs a rigid fraction of at least {needed(1.0):.3f}, or {needed(0.85):.3f} "
        f"with elements that take 85 % of a step. For runs of our own the formula is right within {off:.3f} with the "
        f"cost of the elements; with their number alone it promises up to "
        f"{max(one.by_count - one.measured for one in RUNS):.3f} too much. Sets: {names}.",
        None, columns, panels,
    )  # fmt: skip
