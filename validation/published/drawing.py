"""Drawing of the figures of the study: panels of curves, and schemes of the models."""

from __future__ import annotations

from itertools import cycle
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import FancyArrowPatch, Rectangle
from matplotlib.ticker import MaxNLocator

from d2rpick.models.box_model import Parameters, build_structure
from d2rpick.report.figures import (
    BETTER,
    NEUTRAL,
    REFERENCE,
    RIGID_OPACITY,
    SWITCHED,
    format_axes,
    make_logarithmic,
)
from d2rpick.report.figures_models import draw_sled
from d2rpick.report.view import BELOW_LEVEL, LOGARITHMIC

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from matplotlib.axes import Axes

    from d2rpick.histories.history import Samples
    from validation.published.exhibits import Exhibit, Panel

# Colours of the curves of an exhibit, by their order: the reference run is black, the first switched run orange.
_COLOURS = (REFERENCE, SWITCHED, BETTER, "#882255", "#44aa99", "#999933")
# Dashes of the times that are marked in a panel.
_DASHES: Final = ("--", ":", "-.")
_STYLES: Final[Mapping[str, dict[str, Any]]] = {
    "line": {"linewidth": 1}, "thin": {"linewidth": 0.6, "linestyle": "--"}, "dots": {"linestyle": "", "marker": "."},
}  # fmt: skip
# Dots on a curve: few enough that the line below stays in sight.
_DOTS = 100


def draw_exhibit(exhibit: Exhibit) -> Figure:
    """Draw all panels of an exhibit, or its scheme."""
    if not exhibit.panels:
        figure = Figure(figsize=(8, 4.2), layout="constrained")
        axes = figure.subplots()
        SCHEMES[exhibit.name](axes)
        axes.set_aspect("equal")
        return figure
    rows, columns = len(exhibit.panels), len(exhibit.panels[0])
    figure = Figure(
        figsize=(9 if columns == 1 else 5.2 * columns, 3.4 * rows), layout="constrained"
    )
    grid = figure.subplots(rows, columns, squeeze=False)
    panels = [panel for row in exhibit.panels for panel in row]
    colours = _choose_colours(panels)
    for axes, panel in zip(grid.flat, panels, strict=True):
        _draw_panel(axes, panel, exhibit.columns, colours)
    return figure


def _choose_colours(panels: Sequence[Panel]) -> dict[str, str]:
    """Return the colour of each label, so that a run has one colour in all panels of an exhibit."""
    labels: list[str] = []
    for panel in panels:
        labels += [shape.label for shape in panel.shapes]
        labels += [curve.label for curve in panel.curves]
    distinct_labels = dict.fromkeys(filter(None, labels))
    return dict(zip(distinct_labels, cycle(_COLOURS), strict=False))


def _draw_panel(
    axes: Axes,
    panel: Panel,
    columns: Mapping[str, Samples],
    colours: Mapping[str, str],
) -> None:
    drawn = dict.fromkeys(_STYLES, 0)
    for curve in panel.curves:
        x, y = (
            columns[curve.x] if curve.x else next(iter(columns.values())),
            columns[curve.column],
        )
        shown_points = slice(
            None,
            None,
            max(1, x.size // _DOTS) if curve.style == "dots" and not panel.span else 1,
        )
        label = curve.label or "_"
        axes.plot(
            x[shown_points],
            y[shown_points],
            label=label,
            color=colours.get(curve.label or "", _COLOURS[drawn[curve.style]]),
            **_STYLES[curve.style],
        )
        drawn[curve.style] += 1
    for shape in panel.shapes:
        closed = np.column_stack([shape.outlines, shape.outlines[:, 0]]).T
        lines = axes.plot(
            closed.real,
            closed.imag,
            color=colours[shape.label],
            **_STYLES[shape.style],
        )
        lines[0].set_label(shape.label)
        axes.set_aspect("equal")
    _draw_marks(axes, panel)
    if panel.span:
        _show(axes, panel, columns)
    axes.set_title(panel.title, fontsize="small")
    axes.set(xlabel=panel.xlabel, ylabel=panel.ylabel)
    format_axes(axes, legend=False)
    if panel.curves and all(
        curve.x and curve.style == "dots" for curve in panel.curves
    ):
        axes.margins(x=0.1, y=0.1)  # single runs, which would stand on the edges
        axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    if panel.shapes:
        # Outlines fill the panel, so that a legend inside would hide some of them.
        axes.margins(0.06)
        axes.legend(
            fontsize="x-small", loc="upper center", bbox_to_anchor=(0.5, -0.2), ncols=3
        )
    elif axes.get_legend_handles_labels()[0]:
        axes.legend(fontsize="x-small", loc="best")


def _draw_marks(axes: Axes, panel: Panel) -> None:
    for name, level in panel.levels:
        axes.axhline(level, color=SWITCHED, linewidth=0.8, label=name)
    for (name, x), dashes in zip(panel.marks, cycle(_DASHES), strict=False):
        axes.axvline(x, color=NEUTRAL, linestyle=dashes, linewidth=1, label=name)
    for x, y in panel.points:
        axes.plot(x, y, "o", color=SWITCHED, markersize=5)
    if panel.rigid:
        axes.axvspan(
            *panel.rigid,
            color=NEUTRAL,
            alpha=RIGID_OPACITY,
            linewidth=0,
            label="rigid",
        )


def _show(axes: Axes, panel: Panel, columns: Mapping[str, Samples]) -> None:
    """Limit a panel to its span, and to the parts of its curves inside."""
    assert panel.span is not None
    low, high = panel.span
    x = next(iter(columns.values()))
    values = np.concatenate(
        [columns[curve.column][(low <= x) & (x <= high)] for curve in panel.curves]
    )
    axes.set_xlim(low, high)
    room = 0.06 * float(np.ptp(values))
    axes.set_ylim(float(values.min()) - room, float(values.max()) + room)
    for _, level in panel.levels[:1]:
        _show_level(axes, level, float(values.max()))


def _show_level(axes: Axes, level: float, highest: float) -> None:
    """Make the axis logarithmic if the level would be invisible on a linear one."""
    if level > 0 and highest > LOGARITHMIC * level:
        make_logarithmic(axes, level / BELOW_LEVEL, highest)
        axes.set_ylim(bottom=level / BELOW_LEVEL)


def box(axes: Axes) -> None:
    """Draw the rollover box on its sled."""
    parameters = Parameters()
    structure = build_structure(parameters)
    draw_sled(axes, parameters, 0.0)
    for truss, colour, width in (
        (structure.box, REFERENCE, 0.4),
        (structure.step, BETTER, 1.2),
    ):
        for first_node, second_node in structure.places[truss.ends]:
            axes.plot(
                [first_node.real, second_node.real],
                [first_node.imag, second_node.imag],
                color=colour,
                linewidth=width,
            )
    _draw_arrow(axes, (-1.35, 0.95), (-0.95, 0.95), "sled, 7 m/s, stops in 60 ms")
    for text, text_position, arrow_position in (
        ("box, switched", (0.55, 1.2), (0.1, 1.0)), ("step, stays deformable", (0.55, 0.75), (0.02, 0.1)),
        ("curb with cushion", (0.55, 0.35), (0.07, 0.04)), ("ground", (0.75, -0.08), (0.75, -parameters.ground)),
    ):  # fmt: skip
        axes.annotate(
            text,
            arrow_position,
            xytext=text_position,
            fontsize="small",
            arrowprops={"arrowstyle": "-", "linewidth": 0.6},
        )
    axes.set(xlim=(-1.7, 1.5), ylim=(-0.25, 1.7), xlabel="x [m]", ylabel="z [m]")


def masses(axes: Axes) -> None:
    """Draw two masses, a spring, and a damper for each mass."""
    _draw_block(axes, 0.0, "m")
    _draw_block(axes, 3.0, "M")
    _draw_spring(axes, 1.0, 3.0, 0.65)
    axes.text(2.0, 0.95, "k", ha="center")
    for left_edge, name, label in ((0.0, "z", "α m"), (3.0, "y", "α M")):
        _draw_arrow(axes, (left_edge + 0.5, 1.35), (left_edge + 1.1, 1.35), name)
        _draw_damper(axes, left_edge + 0.5, label)
    _draw_arrow(axes, (-1.0, 0.65), (-0.1, 0.65), "V0")
    axes.text(
        2.0,
        -1.25,
        "β = M/m,  no support: dampers act against the rest",
        ha="center",
        fontsize="small",
    )
    axes.set(xlim=(-1.3, 4.6), ylim=(-1.5, 1.9))
    axes.axis("off")


def elements(axes: Axes) -> None:
    """Draw ten bricks as the spring between two lumped masses."""
    for number in range(10):
        axes.add_patch(
            Rectangle(
                (1.0 + 0.2 * number, 0.55),
                0.2,
                0.2,
                facecolor=NEUTRAL,
                edgecolor=REFERENCE,
                alpha=RIGID_OPACITY,
            )
        )
    _draw_block(axes, 0.0, "m")
    _draw_block(axes, 3.0, "M")
    axes.text(2.0, 0.95, "ten bricks, E A/L = k", ha="center")
    _draw_arrow(axes, (-1.0, 0.65), (-0.1, 0.65), "V0")
    axes.text(2.0, -0.5, "masses added to the nodes of the end sections;\nall nodes are one rigid body from tr to td",
              ha="center", fontsize="small")  # fmt: skip
    axes.set(xlim=(-1.3, 4.6), ylim=(-0.9, 1.5))
    axes.axis("off")


SCHEMES: Final[Mapping[str, Callable[[Axes], None]]] = {
    "box": box,
    "masses": masses,
    "elements": elements,
}


def _draw_block(axes: Axes, left_edge: float, name: str) -> None:
    axes.add_patch(
        Rectangle(
            (left_edge, 0.15),
            1.0,
            1.0,
            facecolor="white",
            edgecolor=REFERENCE,
            linewidth=1.2,
        )
    )
    axes.text(left_edge + 0.5, 0.65, name, ha="center", va="center", fontsize="large")


def _draw_spring(axes: Axes, left_end: float, right_end: float, height: float) -> None:
    inner = np.linspace(left_end + 0.3, right_end - 0.3, 13)
    x = np.concatenate([[left_end], inner, [right_end]])
    z = height + 0.14 * np.concatenate([[0, 0], np.resize([1.0, -1.0], 11), [0, 0]])
    axes.plot(x, z, color=REFERENCE, linewidth=1.2)


def _draw_damper(axes: Axes, x: float, label: str) -> None:
    """Draw a dashpot from a mass down to the ground."""
    axes.plot([x, x], [0.15, -0.25], color=REFERENCE, linewidth=1)
    axes.plot([x - 0.13, x + 0.13], [-0.25, -0.25], color=REFERENCE, linewidth=2)
    axes.plot(
        [x - 0.18, x - 0.18, x + 0.18, x + 0.18],
        [-0.15, -0.45, -0.45, -0.15],
        color=REFERENCE,
        linewidth=1,
    )
    axes.plot([x, x], [-0.45, -0.75], color=REFERENCE, linewidth=1)
    axes.plot([x - 0.35, x + 0.35], [-0.75, -0.75], color=REFERENCE, linewidth=1.5)
    axes.text(x + 0.28, -0.4, label, fontsize="small")


def _draw_arrow(
    axes: Axes, start: tuple[float, float], end: tuple[float, float], text: str
) -> None:
    axes.add_patch(
        FancyArrowPatch(start, end, arrowstyle="-|>", mutation_scale=12, color=SWITCHED)
    )
    axes.text(start[0], start[1] + 0.08, text, color=SWITCHED, fontsize="small")
