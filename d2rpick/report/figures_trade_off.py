"""The figure of a trade-off: energy, error and rigid time over td."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np
from matplotlib.figure import Figure

from d2rpick.histories.samples import outline
from d2rpick.report.figures import FLIGHT, GOOD, REFERENCE, STRETCHES, SWITCHED, WIDTH, entries, finish, with_unit
from d2rpick.report.figures_page import arrange

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from d2rpick.choice.trade_off import TradeOff

# Of the figure in a file, and of one of its axes on a page [inch].
_HEIGHT, _PANEL = 7.0, 1.9
_ERRORS: Final = {True: "shortfall of the level", False: "residual"}


def draw_trade_off(found: TradeOff, *, page: bool = False) -> Figure:
    """Draw the energy in the window of td, and below it error and saving of the best pair for each td."""
    figure = Figure(figsize=(WIDTH, _HEIGHT), layout=None if page else "constrained")
    energy, error, rigid = figure.subplots(3, sharex=True)
    history = found.situation.history
    inner = history.between(*found.td_window)
    energy.plot(*outline(*inner, stretches=STRETCHES), color=REFERENCE, linewidth=1)
    energy.set(ylabel="internal energy")
    by_energy = bool(found.offers) and all(one.basis == "energy" for one in found.offers)
    _curve(error, found, [one.error for one in found.offers])
    error.set(ylabel=_ERRORS[by_energy], ylim=(0, None))
    saved = [one.saving for one in found.offers]
    cost = any(one is not None for one in saved)
    _curve(rigid, found, saved if cost else [one.rigid_time for one in found.offers])
    td = with_unit("td", history.time_unit)
    rigid.set(ylabel="run time saved" if cost else "rigid time", xlabel=td, ylim=(0, None))
    panels = (energy, error, rigid)
    for axes in panels:
        for one, colour, name in ((found.asked, FLIGHT, "td asked for"), (found.recommended, SWITCHED, "recommended")):
            if one:
                axes.axvline(one.td, color=colour, linewidth=1, linestyle="--", label=name)
        finish(axes, legend=False)
    if page:
        arrange(figure, panels, _PANEL)
    else:
        known = entries(panels)
        figure.legend(known.values(), known, loc="outside lower left", ncols=4, frameon=False)
    return figure


def _curve(axes: Axes, found: TradeOff, values: list[float | None]) -> None:
    """Draw one measure of all offers, with gaps where it is unknown, and mark those that nothing beats."""
    td = np.array([one.td for one in found.offers])
    shown = np.array([np.nan if value is None else value for value in values])
    best = np.array([one.unbeaten for one in found.offers], dtype=bool)
    axes.plot(td, shown, color=REFERENCE, linewidth=0.8, label="best pair for each td")
    axes.plot(td[best], shown[best], "o", color=GOOD, markersize=4, label="nothing beats it")
