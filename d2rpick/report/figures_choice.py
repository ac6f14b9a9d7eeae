"""Figures of a choice: suggest and verify with flight, level and motion; of a plan, a trade-off, a study."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np
from matplotlib.collections import LineCollection

from d2rpick.choice.study import Study, StudyRow, outliers, runs_of
from d2rpick.histories.samples import draw_outline
from d2rpick.report import figures
from d2rpick.report.figures import (
    BETTER,
    FLIGHT,
    GOOD,
    REFERENCE,
    STRETCHES,
    SWITCHED,
    Figure,
    plain,
    shade,
    with_unit,
)
from d2rpick.report.figures_modal import draw_halfway, draw_residuals
from d2rpick.report.situation import energy_name
from d2rpick.report.study import short_names
from d2rpick.report.view import (
    Motion,
    View,
    merged,
    replayed_motion,
    scale_in,
    scale_of,
    view_of,
)

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from matplotlib.axes import Axes

    from d2rpick.choice.answers import Suggestion, Verdict
    from d2rpick.choice.candidates import Candidate, Pair
    from d2rpick.choice.plan import Plan
    from d2rpick.choice.sets_of_parts import Parts
    from d2rpick.choice.situation import Situation
    from d2rpick.choice.switched_run import Times
    from d2rpick.choice.trade_off import TradeOff
    from d2rpick.histories.history import History, Samples


# Height of a file's figure of the energy alone, and with the motion; on a page, that of a panel [inch].
_HEIGHTS: Final = (4.0, 6.5)
_PANELS: Final = (2.6, 2.0)
# Up to so many candidates are told apart as marks; beyond, what is acceptable is a band.
_FEW: Final = 20
# Share of the axes at their foot in which the band lies, clear of the curve.
_BAND: Final = 0.045
# Of the flights of a plan: so much is shown before and after them.
_BEYOND_FLIGHTS: Final = 0.05
# Of the record: the times of a shorter window have no room beside each other.
_ROOM_FOR_TIMES: Final = 0.2


def draw_suggestion(answer: Suggestion, *, page: bool = False) -> Figure:
    """Energy in the flight with its level at td, candidates or acceptable windows, the choice; below it the motion.

    On a page, where nobody asks for two figures that are nearly the same, a better pair too.
    """
    best = answer.chosen
    few = answer.windows is None and len(answer.candidates) <= _FEW
    shown = tuple(answer.candidates) if few else (best,) if best else ()
    bands = () if few else answer.acceptable_windows
    better = answer.clearly_better if page else None
    return _draw(
        answer.situation, best.tr if best else None, shown, bands, better, page=page
    )


def draw_verdict(answer: Verdict, *, page: bool = False) -> Figure:
    """Energy in the flight with its level at td and the pair that was judged; below it the motion after that pair.

    With a finished switched run its energy is drawn over that of the reference, in place of the motion of a model.
    """
    pair = answer.situation, answer.candidate.tr, (answer.candidate,)
    return _draw(*pair, computed=answer.computed, page=page)


def _draw(
    situation: Situation,
    tr: float | None,
    candidates: Sequence[Candidate] = (),
    bands: Sequence[tuple[float, float]] = (),
    better: Pair | None = None,
    *,
    computed: History | None = None,
    page: bool = False,
) -> Figure:
    modelled = tr is not None and computed is None
    motion = replayed_motion(situation, tr) if modelled and tr is not None else None
    modal = situation.basis == "modal" and modelled
    below = modal or motion is not None
    figure, panels = figures.begin(2 if below else 1, _HEIGHTS[below], page=page)
    seen = view_of(
        situation, *(() if tr is None else (tr,)), *(better[:2] if better else ())
    )
    _draw_energy(panels[0], situation, seen, candidates, bands)
    if computed is not None:
        panels[0].plot(
            computed.time,
            computed.energy,
            color=BETTER,
            linewidth=1,
            label="switched run, as computed",
        )
    if modal and tr is not None:
        draw_halfway(panels[0], situation, tr)
        draw_residuals(panels[1], situation)
    elif motion:
        _draw_motion(panels[1], motion)
    if better:
        _draw_better(panels, situation.at(better.td), better.tr)
    panels[-1].set_xlabel(with_unit("time", situation.history.time_unit))
    for panel in panels:
        figures.finish(panel, legend=not page)
    # the level belongs to the flight, also where td lies beyond
    scale = scale_in(situation, seen, [situation.energy_td])
    figures.show_span(panels[0], (seen.start, seen.end), scale, seen.above)
    if page:
        figures.arrange(figure, panels, _PANELS[below])
    figures.mark_times(panels, tr, situation.td, page=page)
    return figure


def _draw_energy(
    axes: Axes,
    situation: Situation,
    seen: View,
    candidates: Sequence[Candidate],
    bands: Sequence[tuple[float, float]],
) -> None:
    history, level, flight, span = (
        situation.history,
        situation.energy_td,
        situation.flight,
        situation.evidence.span,
    )
    drawn = draw_outline(*history.between(seen.start, seen.end), stretches=STRETCHES)
    if flight.start is not None:
        known = (
            span.end if span else situation.td
        )  # without a contact, as far as it was seen
        end = known if flight.end is None else flight.end
        shade(axes, (flight.start, end), f"flight ({flight.source})")
    axes.plot(*drawn, color=REFERENCE, linewidth=1, label=plain(energy_name(history)))
    axes.axhline(
        level, color=SWITCHED, linewidth=0.8, label=f"level at td, {level:.4g}"
    )
    for number, band in enumerate(merged(bands, (seen.end - seen.start) / STRETCHES)):
        label = "_" if number else "acceptable tr"
        axes.axvspan(*band, ymax=_BAND, facecolor=GOOD, linewidth=0, label=label)
    for acceptable, fill, name in (
        (True, GOOD, "acceptable"),
        (False, "none", "not acceptable"),
    ):
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
_HATCHES: Final = {
    "supported": None,
    "re-plan": "//",
    "done": None,
}  # told apart without colour, too
# Of the figure in a file, and of the axes on a page [inch].
_PLAN_HEIGHT, _PLAN_PANEL = 4.0, 2.8
# Share of the axes below the energy in which the windows are drawn; parts of which the energy is drawn.
_STRIP: Final = 0.07
_MOST_PARTS: Final = 6


def draw_plan(plan: Plan, *, page: bool = False) -> Figure:
    """Draw the energy over time, the flights behind it and the rigid windows below it."""
    figure, (axes,) = figures.begin(1, _PLAN_HEIGHT, page=page)
    history = plan.history
    span = float(history.time[-1] - history.time[0])
    axes.plot(
        history.time,
        history.energy,
        color=REFERENCE,
        linewidth=1,
        label="internal energy",
    )
    for row in plan.flights:
        shade(axes, (row.start, row.end), "flight")
        if row.window:
            axes.axvspan(
                *row.window, ymax=_STRIP, facecolor=_COLOURS[row.status], hatch=_HATCHES[row.status],
                edgecolor="white", linewidth=0, label=f"rigid, {row.status}",
            )  # fmt: skip
            figures.note(
                axes,
                _window_label(row.number, row.window, span),
                (sum(row.window) / 2, _STRIP),
                (0, 2),
                ha="center",
            )
    low, high = axes.get_ylim()
    axes.set_ylim(low - 2 * _STRIP * (high - low), high)
    # below the energies stand the windows alone
    axes.set_yticks([tick for tick in axes.get_yticks() if low <= tick <= high])
    _zoom_into_flights(axes, plan)
    _finish(figure, axes, with_unit("time", history.time_unit), page=page)
    return figure


def _zoom_into_flights(axes: Axes, plan: Plan) -> None:
    """Show the flights, and a little of what lies before and after them."""
    if not plan.flights:
        return
    start, end = plan.flights[0].start, plan.flights[-1].end
    beyond = _BEYOND_FLIGHTS * (end - start)
    first, last = plan.history.time[[0, -1]].tolist()
    axes.set_xlim(max(first, start - beyond), min(last, end + beyond))


def _window_label(number: int, window: Times, span: float) -> str:
    """Number a window, with its times if there is room for them."""
    tr, td = window
    if td - tr < _ROOM_FOR_TIMES * span:
        return str(number)
    return f"{number}: tr = {tr:.4g}, td = {td:.4g}"


def draw_run(
    history: History, flights: Sequence[Times], windows: Sequence[Times] = ()
) -> Figure:
    """Draw the energy of a run, as far as it is believed, its flights and the windows in which parts were rigid."""
    figure, (axes,) = figures.begin(1, _PLAN_HEIGHT, page=True)
    rigid = np.any(
        [(history.time > tr) & (history.time < td) for tr, td in windows], axis=0
    )
    axes.plot(
        history.time,
        np.where(rigid, np.nan, history.energy),
        color=REFERENCE,
        linewidth=1,
        label="energy",
    )
    for flight in flights:
        shade(axes, flight, "flight")
    for window in windows:
        axes.axvspan(*window, ymax=_STRIP, color=GOOD, linewidth=0, label="rigid")
    _finish(figure, axes, with_unit("time", history.time_unit), page=True)
    return figure


def draw_parts(found: Parts) -> Figure:
    """Draw the energies of the parts that have most over time, and the flights; FormatError without parts."""
    run = found.files
    energies, time = run.part_energies(run.parts), run.part_time
    figure, (axes,) = figures.begin(1, _PLAN_HEIGHT, page=True)
    for at in energies.max(axis=0).argsort()[::-1][:_MOST_PARTS]:
        curve = draw_outline(time, energies[:, at], stretches=STRETCHES)
        axes.plot(*curve, linewidth=1, label=plain(run.parts[at].name))
    for flight in found.facts.flights:
        shade(axes, flight, "flight")
    _finish(figure, axes, "time", page=True)
    return figure


def _finish(figure: Figure, axes: Axes, time: str, *, page: bool) -> None:
    """Name the axes of a whole run, and put the legend below."""
    axes.set(xlabel=time, ylabel="internal energy")
    figures.finish(axes, legend=False)
    if page:
        figures.arrange(figure, [axes], _PLAN_PANEL)
    else:
        figures.legend_below(figure, [axes])


# Of the figure in a file, and of one of its axes on a page [inch].
_TRADE_HEIGHT, _TRADE_PANEL = 7.0, 1.9
# Room beside the first and last td, as a share of the axes: lines and marks there are seen whole.
_AT_EDGE: Final = 0.02
_ERRORS: Final = {True: "shortfall of the level", False: "residual"}


def draw_trade_off(found: TradeOff, *, page: bool = False) -> Figure:
    """Draw the energy in the window of td, and below it error and saving of the best pair for each td."""
    figure, panels = figures.begin(3, _TRADE_HEIGHT, page=page)
    energy, error, rigid = panels
    history = found.situation.history
    inner = history.between(*found.td_window)
    energy.plot(
        *draw_outline(*inner, stretches=STRETCHES), color=REFERENCE, linewidth=1
    )
    energy.set(ylabel="internal energy")
    by_energy = bool(found.offers) and all(
        one.basis == "energy" for one in found.offers
    )
    _curve(error, found, [one.error for one in found.offers])
    error.set(ylabel=_ERRORS[by_energy], ylim=(0, None))
    saved = [one.saving for one in found.offers]
    cost = any(one is not None for one in saved)
    _curve(rigid, found, saved if cost else [one.rigid_time for one in found.offers])
    td = with_unit("td", history.time_unit)
    rigid.set(
        ylabel="run time saved" if cost else "rigid time", xlabel=td, ylim=(0, None)
    )
    for axes in panels:
        for one, colour, name in (
            (found.asked, FLIGHT, "td asked for"),
            (found.recommended, SWITCHED, "recommended"),
        ):
            if one:
                axes.axvline(
                    one.td, color=colour, linewidth=1, linestyle="--", label=name
                )
        figures.finish(axes, legend=False)
        axes.margins(x=_AT_EDGE)
    if page:
        figures.arrange(figure, panels, _TRADE_PANEL)
    else:
        figures.legend_below(figure, panels, size=None)
    return figure


def _curve(axes: Axes, found: TradeOff, values: list[float | None]) -> None:
    """Draw one measure of all offers, with gaps where it is unknown, and mark those that nothing beats."""
    td = np.array([one.td for one in found.offers])
    shown = np.array([np.nan if value is None else value for value in values])
    best = np.array([one.unbeaten for one in found.offers], dtype=bool)
    axes.plot(td, shown, color=REFERENCE, linewidth=0.8, label="best pair for each td")
    axes.plot(
        td[best], shown[best], "o", color=GOOD, markersize=4, label="nothing beats it"
    )


# Okabe and Ito's palette, without the yellow that white swallows; dashes tell apart lines of the same colour.
_RUN_COLOURS: Final = (
    REFERENCE,
    SWITCHED,
    GOOD,
    "#0072b2",
    "#cc79a7",
    "#e69f00",
    "#56b4e9",
)
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
    curve: Samples
    name: str
    colour: str
    pattern: str


def draw_study(answer: Study, *, page: bool = False) -> Figure:
    """Draw energies around td over each other, the tr of each, the common one and td."""
    # names of runs stand beside the axes, so that the margins are not known, on a page neither
    figure = Figure(
        figsize=(figures.PAGE_WIDTH if page else figures.WIDTH, _HEIGHT),
        layout="constrained",
    )
    axes = figure.subplots()
    drawn = {id(row): row.curve for row in answer.runs if row.curve is not None}
    runs = [row for row in answer.runs if id(row) in drawn]
    named = _named(runs, drawn)
    _draw_others(axes, [*drawn.values()], named)
    for one in named:
        axes.plot(
            *one.curve, color=one.colour, linestyle=one.pattern, linewidth=1, label="_"
        )
    if answer.common.window:
        shade(axes, answer.common.window, "acceptable in all runs", GOOD, alpha=0.2)
    _draw_times(axes, runs)
    units = {row.time_unit for row in answer.runs if row.judged}
    axes.set(
        xlabel=with_unit("time", units.pop() if len(units) == 1 else ""),
        ylabel="internal energy",
    )
    figures.finish(axes, legend=False)
    _show_runs(axes, answer, runs, [*drawn.values()])
    _name(axes, named, page=page)
    figures.legend_below(figure, [axes], columns=1 if page else 4)
    figures.mark_times([axes], answer.common.tr, answer.td, page=page)
    return figure


def _named(runs: Sequence[StudyRow], curves: Mapping[int, Samples]) -> list[_Named]:
    """Give the runs that have a colour and a name: all where they are few, else those that stand out."""
    chosen = (
        list(runs) if len(runs) <= _NAMED else list(outliers(runs))[:_MOST_OUTLIERS]
    )
    names = dict(
        zip(map(id, runs), short_names([row.source for row in runs]), strict=True)
    )
    palette = _RUN_COLOURS if len(runs) <= _NAMED else _RUN_COLOURS[1:]
    return [
        _Named(
            curves[id(row)],
            plain(names[id(row)]),
            palette[i % len(palette)],
            _PATTERNS[i // len(palette) % 2],
        )
        for i, row in enumerate(chosen)
    ]


def _draw_others(
    axes: Axes, curves: Sequence[Samples], named: Sequence[_Named]
) -> None:
    """Draw the runs without a name in grey; taken together they stay as dark as ten lines."""
    told = {id(one.curve) for one in named}
    others, many = (
        [curve.T for curve in curves if id(curve) not in told],
        len(curves) > _MANY,
    )
    lines = LineCollection(
        others, colors=_GREY if told or len(others) > 1 else REFERENCE, linewidths=0.6 if many else 1, rasterized=many,
        alpha=max(_FAINTEST, min(1.0, _DARK / max(1, len(others)))),
        label=f"internal energy of {runs_of(len(curves))}" if others else "_",
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


def _show_runs(
    axes: Axes, answer: Study, drawn: Sequence[StudyRow], curves: Sequence[Samples]
) -> None:
    """Show the time from a little before the first tr to a little after td; what is higher there is cut."""
    if not curves:
        return
    first, last = (
        min(float(one[0, 0]) for one in curves),
        max(float(one[0, -1]) for one in curves),
    )
    times = [row.tr for row in drawn if row.tr is not None]
    td = (
        max((row.td for row in drawn if row.td is not None), default=last)
        if answer.td is None
        else answer.td
    )
    early = (
        min([*times, td if answer.common.tr is None else answer.common.tr])
        if times
        else first
    )
    span = (
        max(first, early - _BEFORE * (td - early)),
        min(last, td + _AFTER * (td - early)),
    )
    levels = np.array([row.energy_td for row in drawn if row.energy_td is not None])
    inner, seen = (
        np.concatenate([levels, *_energies(curves, *window)])
        for window in ((early, td), span)
    )
    # the lowest level stays in sight beside the middle one
    level = min(float(np.median(levels)), _LOWEST * float(levels.min()))
    scale = scale_of(float(inner.min()), float(inner.max()), level)
    if drawn and all("at-rest" in row.warnings for row in drawn):
        scale = scale_of(0.0, max(float(one[1].max()) for one in curves), 0.0)
    figures.show_span(axes, span, scale, [("highest run", float(seen.max()))])


def _energies(curves: Sequence[Samples], start: float, end: float) -> Iterator[Samples]:
    """Give the energies of each curve from ``start`` to ``end``."""
    for time, energy in curves:
        yield energy[(start <= time) & (time <= end)]


def _name(axes: Axes, named: Sequence[_Named], *, page: bool) -> None:
    """Write the names of runs beside the axes, in the order of their curves there, with a line to each."""
    end, free = axes.get_xlim()[1], 0.0
    places = ((_height(axes, float(np.interp(end, *one.curve))), one) for one in named)
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
