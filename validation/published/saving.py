"""Savings of switching: the cost model compared with the published saving and with measured runs.

The formulas are in `d2rpick.choice.parts.cost` (share c of a time step) and
`d2rpick.vibration.measures.run_time_share`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from d2rpick.choice.parts.cost import POINT, Weights, compute_saved_share
from d2rpick.vibration.measures import run_time_share
from validation.published.exhibits import Curve, Exhibit, Panel

if TYPE_CHECKING:
    from collections.abc import Mapping

# Hours of the pick-up truck without and with switching; neither its times nor its elements are published.
PICK_UP: Final = (25.5, 6.5)
# Step while everything is rigid (capped) over that while deformable, 20.00 of 21.54 us.
_CAPPED: Final = 20.00 / 21.54

# A car of 17 parts on an obstacle of 309 shells, rigid for 96.8 of 240 ms; CPU time of OpenRadioss 2026-08, one
# thread.
_WEIGHTS: Final = Weights()
_RIGID: Final = 0.0968 / 0.24
_BODY: Final = {
    "QEPH": 764,
    "QBAT": 154,
    "BT": 258,
    "beam": 60,
    "solid": 160,
    "spring": 120,
    POINT: 4348,
}
_CAR: Final = {**_BODY, "BT": 258 + 309}


class MeasuredRun(NamedTuple):
    """MeasuredRun whose CPU time was measured with and without switching.

    ``rigid`` are elements by formulation, and their integration points beside those of one layer.
    """

    name: str
    rigid_fraction: float
    rigid: Mapping[str, int]
    nodes: int
    step_ratio: float
    measured: float

    def predicted(self, share: float) -> float:
        """Return the saving if ``share`` of the cost of a time step is saved [-]."""
        return 1 - run_time_share(self.rigid_fraction, share, self.step_ratio)

    @property
    def element_share(self) -> float:
        """Share of the elements that are rigid [-]."""
        return _number(self.rigid) / _number(_CAR)

    @property
    def cost_share(self) -> float:
        """Share of the cost of a time step that is saved, by the cost model [-]."""
        return compute_saved_share(
            _WEIGHTS, _compute_cost(_CAR), _compute_cost(self.rigid), self.nodes
        )

    @property
    def by_cost(self) -> float:
        """Saving by the cost model [-]."""
        return self.predicted(self.cost_share)

    @property
    def by_count(self) -> float:
        """Saving if the cost is proportional to the number of elements [-]."""
        return self.predicted(self.element_share)


def _compute_cost(elements: Mapping[str, int]) -> float:
    return sum(_WEIGHTS.per_element[name] * count for name, count in elements.items())


def _number(elements: Mapping[str, int]) -> int:
    return sum(count for name, count in elements.items() if name != POINT)


RUNS: Final = (
    MeasuredRun("all parts", _RIGID, _BODY, 1450, _CAPPED, 0.306),
    MeasuredRun(
        "all but the part that lands first",
        _RIGID,
        {**_BODY, "QBAT": 92, POINT: 3356},
        1408,
        1.0,
        0.270,
    ),
    MeasuredRun(
        "parts that have stopped deforming",
        _RIGID,
        {"QEPH": 764, "beam": 60, POINT: 1528},
        839,
        1.0,
        0.126,
    ),
    MeasuredRun(
        "heavy parts",
        _RIGID,
        {"solid": 160, "beam": 18, "QEPH": 48, POINT: 96},
        361,
        1.0,
        0.075,
    ),
)


def find_needed_fraction(share: float) -> float:
    """Return the rigid fraction at which the pick-up truck's saving requires this share of the cost [-].

    Examples
    --------
    >>> round(find_needed_fraction(1.0), 3), round(find_needed_fraction(0.85), 3)
    (0.745, 0.877)
    """
    return (1 - PICK_UP[1] / PICK_UP[0]) / share


def make_saving_exhibit() -> Exhibit:
    """Return predicted savings beside measured ones, and what the published saving requires."""
    published = 1 - PICK_UP[1] / PICK_UP[0]
    share = np.linspace(published, 1.0, 51)  # with less, no rigid fraction is enough
    number = np.arange(1.0, len(RUNS) + 1)
    columns = {
        "run": np.append(number, np.full(share.size - number.size, np.nan)), "share": share,
        "rigid_fraction": np.array([find_needed_fraction(float(run)) for run in share]),
    }  # fmt: skip
    for name, values in (
        ("measured", [run.measured for run in RUNS]), ("by_cost", [run.by_cost for run in RUNS]),
        ("by_count", [run.by_count for run in RUNS]),
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
    names = "; ".join(
        f"{run_number} {run.name}" for run_number, run in enumerate(RUNS, start=1)
    )
    largest = max(abs(run.by_cost - run.measured) for run in RUNS)
    return Exhibit(
        "saving", "What switching saves", 5, "section 5",
        f"A pick-up truck takes {PICK_UP[1]:g} instead of {PICK_UP[0]:g} h on 8 processors.",
        f"That is a saving of {published:.3f}; tr, td, the end and the parts are not published, so it cannot be "
        f"computed anew. By the formula it needs a rigid fraction of at least {find_needed_fraction(1.0):.3f}, "
        f"or {find_needed_fraction(0.85):.3f} "
        f"with elements that take 85 % of a step. For runs of our own the formula is right within {largest:.3f} with "
        f"the cost of the elements; with their number alone it promises up to "
        f"{max(run.by_count - run.measured for run in RUNS):.3f} too much. Sets: {names}.",
        None, columns, panels,
    )  # fmt: skip
