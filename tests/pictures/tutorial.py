"""Pictures of the tutorial and of the workflow: a box that falls, bounces and is switched."""

from __future__ import annotations

from typing import TYPE_CHECKING

from matplotlib.patches import FancyBboxPatch

from tests.pictures.drawing import (
    FLIGHT,
    REFERENCE,
    RIGID,
    SWITCHED,
    draw_curve,
    make_figure,
    mark_time,
    name_axes,
    shade,
    show_names,
)
from tests.pictures.runs import FALL_FLIGHTS, FALL_WINDOWS, fall

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_STEPS = (
    ("1  reference run", "solver, nothing\nswitched", FLIGHT),
    ("2  choose", "d2rpick parts\nd2rpick plan", RIGID),
    ("3  cards", "plan --write-deck\ncheck", RIGID),
    ("4  switched run", "solver, parts\nrigid in flight", FLIGHT),
    ("5  compare", "verify --switched\nplan --done", RIGID),
)


def workflow() -> Figure:
    """Draw the five steps from the reference run to the comparison."""
    figure, (axes,) = make_figure(1.7)
    axes.set(xlim=(0, 15), ylim=(0, 3))
    axes.axis("off")
    for step_number, (title, text, color) in enumerate(_STEPS):
        left_edge = 3 * step_number + 0.1
        box = FancyBboxPatch(
            (left_edge, 0.9),
            2.4,
            1.6,
            boxstyle="round,pad=0.08",
            facecolor=color,
            edgecolor="none",
        )
        axes.add_patch(box)
        axes.text(left_edge + 1.2, 2.2, title, ha="center", va="center", weight="bold")
        axes.text(left_edge + 1.2, 1.4, text, ha="center", va="center", fontsize=8)
        if step_number:
            _draw_arrow(axes, (left_edge - 0.45, 1.7), (left_edge - 0.02, 1.7))
    _draw_arrow(axes, (13.3, 0.75), (4.3, 0.75), bend=-0.08)
    axes.text(8.8, 0.05, "flights that were not switched yet", ha="center", fontsize=8)
    return figure


def _draw_arrow(
    axes: Axes, start: tuple[float, float], end: tuple[float, float], bend: float = 0.0
) -> None:
    style = {
        "arrowstyle": "->",
        "connectionstyle": f"arc3,rad={bend}",
        "linewidth": 1.2,
    }
    axes.annotate("", end, start, arrowprops=style)


def fall_motion() -> Figure:
    """Draw how the box of the tutorial falls: its height, and its internal energy."""
    figure, (height, energy) = make_figure(4.2, rows=2)
    table = fall()
    draw_curve(height, table.index, table["z"], REFERENCE)
    draw_curve(energy, table.index, table["internal_energy"], REFERENCE)
    for number, (start, end) in enumerate(FALL_FLIGHTS, 1):
        shade(height, start, end, f"flight {number}")
        shade(energy, start, end, "")
    name_axes(height, "", "height of the centre [m]")
    name_axes(energy, "time [s]", "internal energy [J]")
    height.set_ylim(0.4, 1.0)
    energy.annotate(
        "impact",
        (0.25, 140),
        (0.36, 200),
        arrowprops={"arrowstyle": "->"},
        va="center",
    )
    return figure


def fall_plan() -> Figure:
    """Draw the second flight of the tutorial with the level, tr, td and the next contact."""
    figure, (axes,) = make_figure(3.2)
    (start, end), (tr, td) = FALL_FLIGHTS[1], FALL_WINDOWS[1]
    energy = fall()["internal_energy"].loc[start - 0.03 : end + 0.02]
    draw_curve(axes, energy.index, energy, REFERENCE)
    axes.set(ylim=(1, 20), xlim=(start - 0.03, end + 0.02))
    shade(axes, start, end, "flight 2: no contact")
    axes.axvspan(tr, td, ymax=0.06, color=RIGID, linewidth=0)
    axes.text((tr + td) / 2, 1.6, "rigid", ha="center", va="center")
    level = float(energy.loc[td - 1e-4 : td + 1e-4].iloc[0])
    axes.axhline(level, color=SWITCHED, linewidth=0.8, linestyle=":")
    axes.text(start - 0.028, level + 0.15, "level E(td)", color=SWITCHED, va="bottom")
    mark_time(axes, tr, "tr", 0.75)
    mark_time(axes, td, "td", 0.75)
    name_axes(axes, "time [s]", "internal energy of the box [J]")
    return figure


def fall_comparison() -> Figure:
    """Draw the internal energy of the box around td, with and without switching."""
    figure, (axes,) = make_figure(3.2)
    td = FALL_WINDOWS[1][1]
    for name, table, color in (
        ("reference run", fall(), REFERENCE),
        ("switched run", fall(*FALL_WINDOWS), SWITCHED),
    ):
        energy = table["internal_energy"].loc[td - 0.06 : FALL_FLIGHTS[1][1]]
        draw_curve(
            axes, energy.index, energy, color, name, "-" if color == REFERENCE else "--"
        )
    axes.axvspan(td - 0.06, td, color=RIGID, alpha=0.35, linewidth=0)
    axes.text(td - 0.03, 2.2, "rigid in the switched run", ha="center")
    mark_time(axes, td, "td", 0.9)
    axes.set(xlim=(td - 0.06, FALL_FLIGHTS[1][1]), ylim=(1.5, 13.5))
    name_axes(axes, "time [s]", "internal energy of the box [J]")
    show_names(axes, "lower right")
    return figure
