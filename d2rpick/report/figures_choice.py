"""Figures of a choice: of suggest and verify with the flight, its level and the motion; of a plan; of a trade-off."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np
from matplotlib.figure import Figure

from d2rpick.histories.samples import outline
from d2rpick.report.figures import (
    BETTER,
    FLIGHT,
    GOOD,
    REFERENCE,
    STRETCHES,
    SWITCHED,
    WIDTH,
    arrange,
    entries,
    finish,
    mark_times,
    plain,
    show_span,
    with_unit,
)
from d2rpick.report.situation import energy_name
from d2rpick.report.view import merged, replayed_motion, scale_of, view_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.axes import Axes

    from d2rpick.choice.candidates import Candidate
    from d2rpick.choice.plan import Plan
    from d2rpick.choice.situation import Situation
    from d2rpick.choice.suggest import Pair, Suggestion
    from d2rpick.choice.trade_off import TradeOff
    from d2rpick.choice.verify import Verdict
    from d2rpick.report.view import Motion, View


# Height of a file's figure of the energy alone, and with the motion; on a page, that of a panel [inch].
_HEIGHTS: Final = (4.0, 6.5)
_PANELS: Final = (2.6, 2.0)
# Up to so many candidates are told apart as marks; beyond, what is acceptable is a band.
_FEW: Final = 20
# Share of the axes at their foot in which the band lies, clear of the curve.
_BAND: Final = 0.045


def draw_suggestion(answer: Suggestion, *, page: bool = False) -> Figure:
    """Energy in the flight with its level at td, candidates or acceptable windows, the choice; below it the motion.

    On a page, where nobody asks for two figures that are nearly the same, a better pair too.
    """
    best = answer.chosen
    few = answer.windows is None and len(answer.candidates) <= _FEW
    shown = tuple(answer.candidates) if few else (best,) if best else ()
    bands = () if few else answer.acceptable_windows
    better = answer.clearly_better if page else None
    return _draw(answer.situation, best.tr if best else None, shown, bands, better, page=page)


def draw_verdict(answer: Verdict, *, page: bool = False) -> Figure:
    """Energy in the flight with its level at td and the pair that was judged; below it the motion after that pair."""
    return _draw(answer.situation, answer.candidate.tr, (answer.candidate,), page=page)


def _draw(
    situation: Situation,
    tr: float | None,
    candidates: Sequence[Candidate] = (),
    bands: Sequence[tuple[float, float]] = (),
    better: Pair | None = None,
    *,
    page: bool = False,
) -> Figure:
    motion = None if tr is None else replayed_motion(situation, tr)
    figure = Figure(figsize=(WIDTH, _HEIGHTS[bool(motion)]), layout=None if page else "constrained")
    panels = list(figure.subplots(2 if motion else 1, 1, sharex=True, squeeze=False)[:, 0])
    seen = view_of(situation, *(() if tr is None else (tr,)), *(better[:2] if better else ()))
    _draw_energy(panels[0], situation, seen, candidates, bands)
    if motion:
        _draw_motion(panels[1], motion)
    if better:
        _draw_better(panels, situation.at(better.td), better.tr)
    panels[-1].set_xlabel(with_unit("time", situation.history.time_unit))
    for panel in panels:
        finish(panel, legend=not page)
    _show(panels[0], situation, seen)
    if page:
        arrange(figure, panels, _PANELS[bool(motion)])
    mark_times(panels, tr, situation.td, page=page)
    return figure


def _show(axes: Axes, situation: Situation, seen: View) -> None:
    """Show the flight; the level belongs to it, also where td lies beyond."""
    level = situation.energy_td
    scale = scale_of(min(seen.low, level), max(seen.high, level), level)
    show_span(axes, (seen.start, seen.end), scale, seen.above)


def _draw_energy(
    axes: Axes,
    situation: Situation,
    seen: View,
    candidates: Sequence[Candidate],
    bands: Sequence[tuple[float, float]],
) -> None:
    history, level, flight, span = situation.history, situation.energy_td, situation.flight, situation.evidence.span
    drawn = outline(*history.between(seen.start, seen.end), stretches=STRETCHES)
    if flight.start is not None:
        known = span.end if span else situation.td  # without a contact, as far as it was seen
        end = known if flight.end is None else flight.end
        axes.axvspan(flight.start, end, color=FLIGHT, alpha=0.15, linewidth=0, label=f"flight ({flight.source})")
    axes.plot(*drawn, color=REFERENCE, linewidth=1, label=plain(energy_name(history)))
    axes.axhline(level, color=SWITCHED, linewidth=0.8, label=f"level at td, {level:.4g}")
    for number, band in enumerate(merged(bands, (seen.end - seen.start) / STRETCHES)):
        label = "_" if number else "acceptable tr"
        axes.axvspan(*band, ymax=_BAND, facecolor=GOOD, linewidth=0, label=label)
    for acceptable, fill, name in ((True, GOOD, "acceptable"), (False, "none", "not acceptable")):
        some = [one for one in candidates if one.acceptable == acceptable]
        if some:
            label = name if len(candidates) > 1 else "tr"
            axes.scatter(
                [one.tr for one in some], [one.energy for one in some], s=28, linewidths=0.7, facecolors=fill,
                edgecolors=GOOD, zorder=3, label=label,
            )  # fmt: skip
    axes.set_ylabel("internal energy")


def _draw_better(panels: Sequence[Axes], there: Situation, tr: float) -> None:
    """Draw a better pair, seen from its td: level, times and what follows, in a colour and a pattern of their own."""
    lines = [panels[0].axhline(there.energy_td)]
    lines += [panel.axvline(time) for panel in panels for time in (tr, there.td)]
    motion = replayed_motion(there, tr)
    if motion and len(panels) > 1:
        lines += panels[1].plot(motion.time, motion.switched)
    for line in lines:
        line.set(color=BETTER, linestyle="-.", linewidth=0.8, label="better pair")


def _draw_motion(axes: Axes, motion: Motion) -> None:
    for values, colour, name in (
        (motion.reference, REFERENCE, "without switching"),
        (motion.switched, SWITCHED, "switched"),
    ):
        axes.plot(motion.time, values, color=colour, linewidth=1, label=name)
    axes.set_ylabel("deformation [√energy]")


_COLOURS: Final = {"supported": GOOD, "re-plan": SWITCHED, "done": "#999999"}
_HATCHES: Final = {"supported": None, "re-plan": "//", "done": None}  # told apart without colour, too
# Of the figure in a file, and of the axes on a page [inch].
_PLAN_HEIGHT, _PLAN_PANEL = 4.0, 2.8
# Share of the axes below the energy in which the windows are drawn.
_STRIP: Final = 0.07


def draw_plan(plan: Plan, *, page: bool = False) -> Figure:
    """Draw the energy over time, the flights behind it and the rigid windows below it."""
    figure = Figure(figsize=(WIDTH, _PLAN_HEIGHT), layout=None if page else "constrained")
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
        arrange(figure, [axes], _PLAN_PANEL)
    else:
        known = entries([axes])
        figure.legend(known.values(), known, loc="outside lower left", ncols=4, fontsize="small", frameon=False)
    return figure


# Of the figure in a file, and of one of its axes on a page [inch].
_TRADE_HEIGHT, _TRADE_PANEL = 7.0, 1.9
_ERRORS: Final = {True: "shortfall of the level", False: "residual"}


def draw_trade_off(found: TradeOff, *, page: bool = False) -> Figure:
    """Draw the energy in the window of td, and below it error and saving of the best pair for each td."""
    figure = Figure(figsize=(WIDTH, _TRADE_HEIGHT), layout=None if page else "constrained")
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
        arrange(figure, panels, _TRADE_PANEL)
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
