"""The figure of a study: the energies of all runs around td, told apart, with the tr of each and the common one."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from d2rpick.choice.study import outliers, runs_of, short_names
from d2rpick.report.figures import (
    GOOD,
    PAGE_WIDTH,
    REFERENCE,
    SWITCHED,
    WIDTH,
    finish,
    mark_times,
    plain,
    show_span,
    with_unit,
)
from d2rpick.report.view import scale_of

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from matplotlib.axes import Axes

    from d2rpick.choice.study import Study, StudyRow
    from d2rpick.histories.history import Samples

# Okabe and Ito's palette, without the yellow that white swallows; dashes tell apart lines of the same colour.
_COLOURS: Final = (REFERENCE, SWITCHED, GOOD, "#0072b2", "#cc79a7", "#e69f00", "#56b4e9")
_PATTERNS: Final = ("-", "--")
# Up to so many runs each has its own colour and name; beyond, all are grey and those that stand out are named.
_NAMED: Final = 10
_MOST_OUTLIERS: Final = 5
_GREY: Final = "#808080"
# Many curves over each other are together as dark as so many, and none is fainter than this.
_DARK, _FAINTEST = 10, 0.02
# Above so many runs lines and marks are thin.
_MANY: Final = 40
# Shown before the first tr and after td, as shares of the time between.
_BEFORE, _AFTER = 0.25, 0.15
# Height of the figure [inch].
_HEIGHT: Final = 4.0
# Height of a name, as a share of the axes.
_LINE: Final = 0.055
# A line to a name begins at the left of it.
_ENDS: Final = {"relpos": (0, 0.5), "shrinkA": 1}
# The lowest level may be so much lower than the others before it counts for the axis.
_LOWEST: Final = 50.0


class _Named(NamedTuple):
    row: StudyRow
    name: str
    colour: str
    pattern: str


def draw_study(answer: Study, *, page: bool = False) -> Figure:
    """Draw energies around td over each other, the tr of each, the common one and td."""
    # names of runs stand beside the axes, so that the margins are not known, on a page neither
    figure = Figure(figsize=(PAGE_WIDTH if page else WIDTH, _HEIGHT), layout="constrained")
    axes = figure.subplots()
    drawn = [row for row in answer.rows if row.curve is not None]
    named = _named(drawn)
    _draw_others(axes, drawn, named)
    for one in named:
        assert one.row.curve is not None
        axes.plot(*one.row.curve, color=one.colour, linestyle=one.pattern, linewidth=1, label="_")
    if answer.common.window:
        axes.axvspan(*answer.common.window, color=GOOD, alpha=0.2, linewidth=0, label="acceptable in all runs")
    _draw_times(axes, drawn)
    units = {row.time_unit for row in answer.rows if row.judged}
    unit = units.pop() if len(units) == 1 else ""
    axes.set(xlabel=with_unit("time", unit), ylabel="internal energy")
    finish(axes, legend=False)
    _show(axes, answer, drawn)
    _name(axes, named, page=page)
    if axes.get_legend_handles_labels()[0]:
        figure.legend(loc="outside lower left", ncols=1 if page else 4, fontsize="small", frameon=False)
    mark_times([axes], answer.common.tr, answer.td, page=page)
    return figure


def _named(drawn: Sequence[StudyRow]) -> list[_Named]:
    """Give the runs that have a colour and a name: all where they are few, else those that stand out."""
    chosen = list(drawn) if len(drawn) <= _NAMED else list(outliers(drawn))[:_MOST_OUTLIERS]
    names = dict(zip(map(id, drawn), short_names([row.source for row in drawn]), strict=True))
    palette = _COLOURS if len(drawn) <= _NAMED else _COLOURS[1:]
    return [
        _Named(row, plain(names[id(row)]), palette[place % len(palette)], _PATTERNS[place // len(palette) % 2])
        for place, row in enumerate(chosen)
    ]


def _draw_others(axes: Axes, drawn: Sequence[StudyRow], named: Sequence[_Named]) -> None:
    """Draw the runs without a name in grey; taken together they stay as dark as ten lines."""
    told = {id(one.row) for one in named}
    curves = [row.curve.T for row in drawn if row.curve is not None and id(row) not in told]
    many = len(drawn) > _MANY
    lines = LineCollection(
        curves, colors=_GREY if told or len(curves) > 1 else REFERENCE, linewidths=0.6 if many else 1, rasterized=many,
        alpha=max(_FAINTEST, min(1.0, _DARK / max(1, len(curves)))),
        label=f"internal energy of {runs_of(len(drawn))}" if curves else "_",
    )  # fmt: skip
    axes.add_collection(lines)
    axes.autoscale_view()


def _draw_times(axes: Axes, drawn: Sequence[StudyRow]) -> None:
    """Mark the tr of each run at its level."""
    points = np.array([(row.tr, row.energy_td) for row in drawn if row.tr is not None])
    if points.size:
        many = len(drawn) > _MANY
        axes.scatter(
            points[:, 0], points[:, 1], s=8 if many else 28, linewidths=0.7, facecolors=GOOD, edgecolors="white",
            zorder=3, label="tr of each run", rasterized=many,
        )  # fmt: skip


def _show(axes: Axes, answer: Study, drawn: Sequence[StudyRow]) -> None:
    """Show the time from a little before the first tr to a little after td; what is higher there is cut."""
    curves = [row.curve for row in drawn if row.curve is not None]
    if not curves:
        return
    first, last = min(float(one[0, 0]) for one in curves), max(float(one[0, -1]) for one in curves)
    times = [row.tr for row in drawn if row.tr is not None]
    td = max((row.td for row in drawn if row.td is not None), default=last) if answer.td is None else answer.td
    early = min([*times, td if answer.common.tr is None else answer.common.tr]) if times else first
    span = max(first, early - _BEFORE * (td - early)), min(last, td + _AFTER * (td - early))
    levels = np.array([row.energy_td for row in drawn if row.energy_td is not None])
    inner, seen = (np.concatenate([levels, *_energies(curves, *window)]) for window in ((early, td), span))
    # the lowest level stays in sight beside the middle one
    level = min(float(np.median(levels)), _LOWEST * float(levels.min()))
    scale = scale_of(float(inner.min()), float(inner.max()), level)
    show_span(axes, span, scale, [("highest run", float(seen.max()))])


def _energies(curves: Sequence[Samples], start: float, end: float) -> Iterator[Samples]:
    """Give the energies of each curve from ``start`` to ``end``."""
    for time, energy in curves:
        yield energy[(start <= time) & (time <= end)]


def _name(axes: Axes, named: Sequence[_Named], *, page: bool) -> None:
    """Write the names of runs beside the axes, in the order of their curves there, with a line to each."""
    end, free = axes.get_xlim()[1], 0.0
    places = ((_height(axes, float(np.interp(end, *one.row.curve))), one) for one in named if one.row.curve is not None)
    for place, one in sorted(places, key=lambda known: known[0]):
        at = max(free, min(place, 1 - _LINE * (len(named) - 1)))
        free = at + _LINE
        axes.annotate(
            one.name, (1, place), xycoords="axes fraction", xytext=(1.03, at), textcoords="axes fraction", va="center",
            fontsize="x-small" if page else "small", color=one.colour, annotation_clip=False,
            arrowprops={"arrowstyle": "-", "color": one.colour, "linewidth": 0.6, "linestyle": one.pattern, **_ENDS},
        )  # fmt: skip


def _height(axes: Axes, value: float) -> float:
    """Where a value stands in the axes, 0 at their foot and 1 at their top."""
    bottom, top = axes.get_ylim()
    value = min(max(value, bottom), top)
    if axes.get_yscale() == "log":
        return float(np.log(value / bottom) / np.log(top / bottom))
    return (value - bottom) / (top - bottom)
