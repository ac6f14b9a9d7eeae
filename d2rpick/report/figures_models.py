"""Figures of the models: the oscillator, the published results and the rollover box."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from d2rpick.report.figures import FLIGHT, GOOD, REFERENCE, SWITCHED, finish, show_level
from d2rpick.report.schemes import SCHEMES

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from matplotlib.axes import Axes

    from d2rpick.choice.suggest import Suggestion
    from d2rpick.histories.history import Samples
    from d2rpick.models.exhibit import Exhibit, Panel
    from d2rpick.models.rollover.record import Record
    from d2rpick.models.rollover.run import Window
    from d2rpick.models.rollover.scan import Outcome
    from d2rpick.vibration.replay import Replay, Trajectory

# Okabe and Ito's palette goes on.
_COLOURS = (REFERENCE, SWITCHED, GOOD, FLIGHT, "#cc79a7", "#e69f00")
_STYLES: Final[Mapping[str, dict[str, Any]]] = {
    "line": {"linewidth": 1}, "thin": {"linewidth": 0.6, "linestyle": "--"}, "dots": {"linestyle": "", "marker": "."},
}  # fmt: skip
# Dots on a curve: few enough that the line below stays in sight.
_DOTS = 100
# Outlines of the rolling box, as many as can be told apart.
_OUTLINES = 8


def draw_replay(motion: Trajectory, switched: Replay | None) -> Figure:
    """Displacements of both masses and the energies over time; the rigid window shaded."""
    figure = Figure(figsize=(9, 6.5), layout="constrained")
    upper, lower = figure.subplots(2, 1, sharex=True)
    upper.plot(motion.time, motion.state.z, color=REFERENCE, label="z, frame")
    upper.plot(motion.time, motion.state.y, color=SWITCHED, label="y, suspended mass")
    upper.set_ylabel("displacement")
    lower.plot(motion.time, motion.internal_energy, color=REFERENCE, label="internal energy")
    lower.plot(motion.time, motion.kinetic_energy, color=SWITCHED, label="kinetic energy")
    lower.set(xlabel="time", ylabel="energy")
    for axes in (upper, lower):
        if switched:
            axes.axvspan(switched.tr, switched.td, color=FLIGHT, alpha=0.2, label="rigid", linewidth=0)
        finish(axes)
    return figure


def draw_exhibit(exhibit: Exhibit) -> Figure:
    """All panels of an exhibit, or its scheme."""
    if not exhibit.panels:
        figure = Figure(figsize=(8, 4.2), layout="constrained")
        axes = figure.subplots()
        SCHEMES[exhibit.name](axes)
        axes.set_aspect("equal")
        return figure
    rows, columns = len(exhibit.panels), len(exhibit.panels[0])
    figure = Figure(figsize=(9 if columns == 1 else 5.2 * columns, 3.4 * rows), layout="constrained")
    grid = figure.subplots(rows, columns, squeeze=False)
    for axes, panel in zip(grid.flat, (panel for row in exhibit.panels for panel in row), strict=True):
        _draw_panel(axes, panel, exhibit.columns)
    return figure


def _draw_panel(axes: Axes, panel: Panel, columns: Mapping[str, Samples]) -> None:
    drawn = dict.fromkeys(_STYLES, 0)
    for curve in panel.curves:
        x, y = columns[curve.x] if curve.x else next(iter(columns.values())), columns[curve.column]
        shown = slice(None, None, max(1, x.size // _DOTS) if curve.style == "dots" and not panel.span else 1)
        label = curve.label or "_"
        axes.plot(x[shown], y[shown], label=label, color=_COLOURS[drawn[curve.style]], **_STYLES[curve.style])
        drawn[curve.style] += 1
    for shape, colour in zip(panel.shapes, _COLOURS, strict=False):
        closed = np.column_stack([shape.outlines, shape.outlines[:, 0]]).T
        lines = axes.plot(closed.real, closed.imag, color=colour, **_STYLES[shape.style])
        lines[0].set_label(shape.label)
        axes.set_aspect("equal")
    _draw_marks(axes, panel)
    if panel.span:
        _show(axes, panel, columns)
    axes.set_title(panel.title, fontsize="small")
    axes.set(xlabel=panel.xlabel, ylabel=panel.ylabel)
    finish(axes, legend=False)
    if panel.curves and all(curve.x and curve.style == "dots" for curve in panel.curves):
        axes.margins(x=0.1, y=0.1)  # single runs, which would stand on the edges
        axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    if axes.get_legend_handles_labels()[0]:
        axes.legend(fontsize="x-small", loc="best")


def _draw_marks(axes: Axes, panel: Panel) -> None:
    for name, level in panel.levels:
        axes.axhline(level, color=SWITCHED, linewidth=0.8, label=name)
    for place, (name, x) in enumerate(panel.marks):
        axes.axvline(x, color=_COLOURS[2 + place], linestyle="--", linewidth=1, label=name)
    for x, y in panel.points:
        axes.plot(x, y, "o", color=GOOD, markersize=5)
    if panel.rigid:
        axes.axvspan(*panel.rigid, color=FLIGHT, alpha=0.2, linewidth=0, label="rigid")


def _show(axes: Axes, panel: Panel, columns: Mapping[str, Samples]) -> None:
    """Show the span of a panel, and of its curves what lies in it."""
    assert panel.span is not None
    low, high = panel.span
    x = next(iter(columns.values()))
    values = np.concatenate([columns[curve.column][(low <= x) & (x <= high)] for curve in panel.curves])
    axes.set_xlim(low, high)
    room = 0.06 * float(np.ptp(values))
    axes.set_ylim(float(values.min()) - room, float(values.max()) + room)
    if panel.levels:
        show_level(axes, panel.levels[0][1], float(values.max()))


def draw_rollover(reference: Record, switched: Record | None, windows: Sequence[Window] = ()) -> Figure:
    """Outlines of the box at even times, with and without switching; beside them roll and height over time."""
    figure = Figure(figsize=(11, 5.5), layout="constrained")
    outlines, roll, height = figure.subplot_mosaic([["o", "r"], ["o", "h"]], width_ratios=(1.4, 1)).values()
    runs = [(reference, REFERENCE, "without switching"), (switched, SWITCHED, "switched")]
    for record, colour, name in [(record, colour, name) for record, colour, name in runs if record]:
        shown = np.linspace(0, record.time.size - 1, _OUTLINES).round().astype(int)
        closed = np.column_stack([record.outline[shown], record.outline[shown, 0]]).T
        style = "-" if record is reference else "--"
        outlines.plot(closed.real, closed.imag, color=colour, linewidth=0.9, linestyle=style)
        roll.plot(record.time, np.degrees(record.roll), color=colour, linewidth=1, linestyle=style, label=name)
        height.plot(record.time, record.centre.imag, color=colour, linewidth=1, linestyle=style, label=name)
    outlines.set(aspect="equal", xlabel="x [m]", ylabel="z [m]")
    outlines.set_title(f"box every {reference.time[-1] / (_OUTLINES - 1) * 1e3:.3g} ms", fontsize="medium")
    outlines.grid(visible=True, linewidth=0.3)
    roll.set(ylabel="roll [degrees]")
    height.set(ylabel="height of the centre [m]", xlabel="time [s]")
    for axes in (roll, height):
        for number, window in enumerate(windows):
            label = "_" if number else "rigid"
            axes.axvspan(window.tr, window.td, color=FLIGHT, alpha=0.2, linewidth=0, label=label)
        finish(axes)
    return figure


def draw_scan(reference: Record, outcomes: Sequence[Outcome], answer: Suggestion) -> Figure:
    """Energy of the box against its level at td; below it, against tr, the errors of roll and of mean energy."""
    figure = Figure(figsize=(9, 8), layout="constrained")
    energy, roll, mean = figure.subplots(3, 1, sharex=True)
    before = reference.time <= answer.situation.td
    internal = reference.internal_energy[before, 0]
    energy.plot(reference.time[before], internal, color=REFERENCE, linewidth=1, label="internal energy of the box")
    energy.axhline(internal[-1], color=SWITCHED, linewidth=0.8, label=f"level at td, {internal[-1]:.4g}")
    times = [one.tr for one in outcomes]
    roll.plot(times, [abs(one.roll_error) for one in outcomes], ".-", color=REFERENCE, label="roll error at td")
    mean.plot(times, [one.mean_ratio - 1 for one in outcomes], ".-", color=REFERENCE, label="error of the mean energy")
    mean.axhline(0, color=REFERENCE, linewidth=0.5)
    energy.set_ylabel("energy [J]")
    roll.set(ylabel="|roll error| [degrees]", yscale="log")
    mean.set(ylabel="mean energy after td,\nrelative error", xlabel="tr [s]")
    for axes in (energy, roll, mean):
        if reference.released is not None:
            axes.axvspan(0, reference.released, color=SWITCHED, alpha=0.1, linewidth=0, label="the sled pushes")
        if answer.recommended:
            axes.axvline(answer.recommended.tr, color=GOOD, linestyle="--", linewidth=1, label="recommended tr")
        finish(axes)
    return figure
