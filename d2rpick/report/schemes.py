"""Schemes of the models: sled, curb and box; two masses; their finite elements."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np
from matplotlib.patches import FancyArrowPatch, Polygon, Rectangle

from d2rpick.models.rollover.contact import CURB_THICKNESS
from d2rpick.models.rollover.model import Parameters, build
from d2rpick.report.figures import FLIGHT, GOOD, REFERENCE, SWITCHED

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from matplotlib.axes import Axes

_SLED_LENGTH: Final = 1.6


def draw_sled(axes: Axes, parameters: Parameters, place: float) -> None:
    """Floor, curb and cushion of the sled when it has come to ``place`` [m], and the ground."""
    p = parameters
    axes.axhline(-p.ground, color=REFERENCE, linewidth=1.2)
    if p.drop is not None:
        return
    turn = np.exp(-1j * np.radians(p.tilt))
    for corners, colour in (
        ((-_SLED_LENGTH, CURB_THICKNESS, CURB_THICKNESS - 0.04j, -_SLED_LENGTH - 0.04j), FLIGHT),
        ((0.0, CURB_THICKNESS, CURB_THICKNESS + 1j * p.curb, 1j * p.curb), SWITCHED),
    ):
        shape = place + np.array(corners) * turn
        axes.add_patch(Polygon(np.column_stack([shape.real, shape.imag]), closed=True, color=colour, alpha=0.6))


def box(axes: Axes) -> None:
    """The rollover box on its sled."""
    parameters = Parameters()
    structure = build(parameters)
    draw_sled(axes, parameters, 0.0)
    for truss, colour, width in ((structure.box, REFERENCE, 0.4), (structure.step, GOOD, 1.2)):
        for one, other in structure.places[truss.ends]:
            axes.plot([one.real, other.real], [one.imag, other.imag], color=colour, linewidth=width)
    _arrow(axes, (-1.35, 0.95), (-0.95, 0.95), "sled, 7 m/s, stops in 60 ms")
    for text, place, at in (
        ("box, switched", (0.55, 1.2), (0.1, 1.0)), ("step, stays deformable", (0.55, 0.75), (0.02, 0.1)),
        ("curb with cushion", (0.55, 0.35), (0.07, 0.04)), ("ground", (0.75, -0.08), (0.75, -parameters.ground)),
    ):  # fmt: skip
        axes.annotate(text, at, xytext=place, fontsize="small", arrowprops={"arrowstyle": "-", "linewidth": 0.6})
    axes.set(xlim=(-1.7, 1.5), ylim=(-0.25, 1.7), xlabel="x [m]", ylabel="z [m]")


def masses(axes: Axes) -> None:
    """Two masses, a spring, a damper to each."""
    _block(axes, 0.0, "m")
    _block(axes, 3.0, "M")
    _spring(axes, 1.0, 3.0, 0.65)
    axes.text(2.0, 0.95, "k", ha="center")
    for left, name, label in ((0.0, "z", "α m"), (3.0, "y", "α M")):
        _arrow(axes, (left + 0.5, 1.35), (left + 1.1, 1.35), name)
        _damper(axes, left + 0.5, label)
    _arrow(axes, (-1.0, 0.65), (-0.1, 0.65), "V0")
    axes.text(2.0, -1.25, "β = M/m,  no support: dampers act against the rest", ha="center", fontsize="small")
    axes.set(xlim=(-1.3, 4.6), ylim=(-1.5, 1.9))
    axes.axis("off")


def elements(axes: Axes) -> None:
    """Ten bricks as the spring between two lumps of mass."""
    for number in range(10):
        axes.add_patch(
            Rectangle((1.0 + 0.2 * number, 0.55), 0.2, 0.2, facecolor=FLIGHT, edgecolor=REFERENCE, alpha=0.6)
        )
    _block(axes, 0.0, "m")
    _block(axes, 3.0, "M")
    axes.text(2.0, 0.95, "ten bricks, E A/L = k", ha="center")
    _arrow(axes, (-1.0, 0.65), (-0.1, 0.65), "V0")
    axes.text(2.0, -0.5, "masses added to the nodes of the end sections;\nall nodes are one rigid body from tr to td",
              ha="center", fontsize="small")  # fmt: skip
    axes.set(xlim=(-1.3, 4.6), ylim=(-0.9, 1.5))
    axes.axis("off")


SCHEMES: Final[Mapping[str, Callable[[Axes], None]]] = {"box": box, "masses": masses, "elements": elements}


def _block(axes: Axes, left: float, name: str) -> None:
    axes.add_patch(Rectangle((left, 0.15), 1.0, 1.0, facecolor="white", edgecolor=REFERENCE, linewidth=1.2))
    axes.text(left + 0.5, 0.65, name, ha="center", va="center", fontsize="large")


def _spring(axes: Axes, left: float, right: float, height: float) -> None:
    inner = np.linspace(left + 0.3, right - 0.3, 13)
    x = np.concatenate([[left], inner, [right]])
    z = height + 0.14 * np.concatenate([[0, 0], np.resize([1.0, -1.0], 11), [0, 0]])
    axes.plot(x, z, color=REFERENCE, linewidth=1.2)


def _damper(axes: Axes, x: float, label: str) -> None:
    """A dashpot from a mass down to the rest."""
    axes.plot([x, x], [0.15, -0.25], color=REFERENCE, linewidth=1)
    axes.plot([x - 0.13, x + 0.13], [-0.25, -0.25], color=REFERENCE, linewidth=2)
    axes.plot([x - 0.18, x - 0.18, x + 0.18, x + 0.18], [-0.15, -0.45, -0.45, -0.15], color=REFERENCE, linewidth=1)
    axes.plot([x, x], [-0.45, -0.75], color=REFERENCE, linewidth=1)
    axes.plot([x - 0.35, x + 0.35], [-0.75, -0.75], color=REFERENCE, linewidth=1.5)
    axes.text(x + 0.28, -0.4, label, fontsize="small")


def _arrow(axes: Axes, start: tuple[float, float], end: tuple[float, float], text: str) -> None:
    axes.add_patch(FancyArrowPatch(start, end, arrowstyle="-|>", mutation_scale=12, color=SWITCHED))
    axes.text(start[0], start[1] + 0.08, text, color=SWITCHED, fontsize="small")
