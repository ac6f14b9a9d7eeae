"""Draw a vibration with several modes: the energy midway between tr and td, and the residual of each tr."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from d2rpick.histories.samples import draw_outline
from d2rpick.report.figures import REFERENCE, STRETCHES, SWITCHED
from d2rpick.vibration.measures import residual
from d2rpick.vibration.model import NOTHING_KEPT

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from d2rpick.choice.pair.situation import Situation


def draw_halfway(axes: Axes, situation: Situation, tr: float) -> None:
    """Mark the energy midway between tr and td, which shows the relative direction of the two deformations."""
    middle = (tr + situation.td) / 2
    energy = situation.history.energy_at(middle)
    axes.scatter(
        [middle], [energy], s=40, marker="D", color=SWITCHED, zorder=3, label="halfway"
    )


def draw_residuals(axes: Axes, situation: Situation) -> None:
    """Draw the residual of each tr in the flight, and the residual of a release without any vibration."""
    profile = situation.vibration.profile
    start = situation.earliest_tr
    assert profile is not None
    is_visible = profile.time >= (-np.inf if start is None else start)
    residuals = np.asarray(
        residual(profile.error[is_visible], situation.kinetic_share or 0.0)
    )
    axes.plot(
        *draw_outline(profile.time[is_visible], residuals, stretches=STRETCHES),
        color=REFERENCE,
        linewidth=1,
        label="_",
    )
    axes.axhline(NOTHING_KEPT, color=SWITCHED, linewidth=0.8, label="no vibration kept")
    axes.set(ylabel="residual R of tr", ylim=(0, None))
