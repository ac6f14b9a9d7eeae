"""The figure of a plan: the energy of the run with its flights and all rigid windows."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from matplotlib.figure import Figure

from d2rpick.report.figures import FLIGHT, GOOD, REFERENCE, SWITCHED, WIDTH, entries, finish, with_unit
from d2rpick.report.figures_page import arrange

if TYPE_CHECKING:
    from d2rpick.choice.plan import Plan

_COLOURS: Final = {"supported": GOOD, "re-plan": SWITCHED, "done": "#999999"}
_HATCHES: Final = {"supported": None, "re-plan": "//", "done": None}  # told apart without colour, too
# Of the figure in a file, and of the axes on a page [inch].
_HEIGHT, _PANEL = 4.0, 2.8
# Share of the axes below the energy in which the windows are drawn.
_STRIP: Final = 0.07


def draw_plan(plan: Plan, *, page: bool = False) -> Figure:
    """Draw the energy over time, the flights behind it and the rigid windows below it."""
    figure = Figure(figsize=(WIDTH, _HEIGHT), layout=None if page else "constrained")
    axes = figure.subplots()
    history = plan.history
    axes.plot(history.time, history.energy, color=REFERENCE, linewidth=1, label="internal energy")
    for row in plan.rows:
        axes.axvspan(row.start, row.end, color=FLIGHT, alpha=0.15, linewidth=0, label="flight")
        if row.window:
            axes.axvspan(
                *row.window, ymax=_STRIP, facecolor=_COLOURS[row.status], hatch=_HATCHES[row.status],
                edgecolor="white", linewidth=0, label=f"rigid, {row.status}",
            )  # fmt: skip
            axes.annotate(
                str(row.number), (sum(row.window) / 2, _STRIP), xycoords=("data", "axes fraction"), xytext=(0, 2),
                textcoords="offset points", ha="center", fontsize="small",
            )  # fmt: skip
    low, high = axes.get_ylim()
    axes.set_ylim(low - 2 * _STRIP * (high - low), high)
    axes.set(xlabel=with_unit("time", history.time_unit), ylabel="internal energy")
    finish(axes, legend=False)
    if page:
        arrange(figure, [axes], _PANEL)
    else:
        known = entries([axes])
        figure.legend(known.values(), known, loc="outside lower left", ncols=4, fontsize="small", frameon=False)
    return figure
