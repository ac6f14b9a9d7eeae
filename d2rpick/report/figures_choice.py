"""Draw the figures of suggest, verify, plan, explore, study and parts."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np
from matplotlib.collections import LineCollection

from d2rpick.choice.pair.grades import DO_NOT_USE, POOR
from d2rpick.choice.runs.study import (
    StudyOfRuns,
    StudyRow,
    find_outliers,
    format_number_of_runs,
)
from d2rpick.histories.samples import draw_outline
from d2rpick.report import figures
from d2rpick.report.decision import is_refused
from d2rpick.report.figures import (
    BAD,
    BETTER,
    GOOD,
    NEUTRAL,
    REFERENCE,
    STRETCHES,
    SWITCHED,
    Figure,
    add_unit,
    make_plain_text,
    mark_span,
)
from d2rpick.report.figures_modal import draw_halfway, draw_residuals
from d2rpick.report.situation import label_deformation, label_energy
from d2rpick.report.study import shorten_names
from d2rpick.report.view import (
    ReplayedMotion,
    View,
    make_scale,
    make_scale_of_flight,
    make_view_of_situation,
    merge_windows,
    replay_motion,
)

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from matplotlib.axes import Axes

    from d2rpick.base.spans import Times
    from d2rpick.choice.answers import PairSuggestion, PairVerdict
    from d2rpick.choice.pair.candidates import Candidate, Pair
    from d2rpick.choice.pair.situation import Situation
    from d2rpick.choice.parts.sets_of_parts import Parts
    from d2rpick.choice.td.plan import PlannedFlight, RunPlan
    from d2rpick.choice.td.trade_off import Offer, TradeOff
    from d2rpick.histories.history import History, Samples


# Heights of a figure [inch] without and with the motion. On a page, they apply to each panel.
_HEIGHTS: Final = (4.0, 6.5)
_PANELS: Final = (2.6, 2.0)
# Largest number of candidates that are drawn as marks; a larger number is drawn as a band of admissible tr.
_FEW: Final = 20
# Height of the band below the curve, at the bottom of the axes, as a fraction of the axes [-].
_BAND: Final = 0.045
# Time shown before and after the flights of a plan, as a fraction of the time that they span [-].
_BEYOND_FLIGHTS: Final = 0.05
# The label of a window contains its times if the window has at least this fraction of the shown time [-]; the key is
# True for a page.
_ROOM_FOR_TIMES: Final = {False: 0.15, True: 0.5}

# Colours of the windows in a plan, keyed by verdict or state.
_COLOURS: Final = {
    "use": GOOD,
    "use with care": "#e69f00",
    "do not use": BAD,
    "re-plan": "#cc79a7",
    "done": "#999999",
}
_HATCHES: Final = {
    "use": None,
    "use with care": "..",
    "do not use": "xx",
    "re-plan": "//",
    "done": None,
}  # Hatches distinguish the windows in black-and-white print.
# _PLAN_HEIGHT: height of the figure of a plan in a file [inch].
# _PLAN_PANEL: height of the axes in the figure of a plan on a page [inch].
_PLAN_HEIGHT, _PLAN_PANEL = 4.0, 2.8
# Height of the strip above the energy in which the windows are drawn, as a fraction of the axes [-].
_STRIP: Final = 0.07
# Height of the energy axis, as a multiple of the largest energy shown [-].
_HEADROOM: Final = 1.1
# Largest number of parts whose energy is drawn.
_MOST_PARTS: Final = 6
# _TRADE_HEIGHT: height of the figure of ``explore`` in a file [inch].
# _TRADE_PANEL: height of each axes in the figure of ``explore`` on a page [inch].
_TRADE_HEIGHT, _TRADE_PANEL = 7.0, 1.9
# Space before the first and after the last td, as a fraction of the axes [-], in which their marks fit.
_AT_EDGE: Final = 0.02
_ERRORS: Final = {True: "level shortfall", False: "residual"}
# Colours of the runs of a study, without those of tr, td, flights and verdicts: a palette by Paul Tol, whose colours
# remain distinguishable to colour-blind readers. Dashes distinguish lines of the same colour.
_RUN_COLOURS: Final = (
    REFERENCE,
    BETTER,
    "#882255",
    "#44aa99",
    "#aa4499",
    "#999933",
    "#332288",
)
_PATTERNS: Final = ("-", "--")
# Largest number of runs that are all drawn in colour and named; of more runs, only outliers are coloured and named.
_NAMED: Final = 10
_MOST_OUTLIERS: Final = 5
_GREY: Final = "#808080"
# _DARK: largest combined darkness of all grey curves, as an equivalent number of opaque lines.
# _FAINTEST: smallest opacity of a grey curve [-].
_DARK, _FAINTEST = 10, 0.02
# Up to this number of runs, their lines and marks are drawn thick.
_MANY: Final = 40
# _BEFORE: time shown before the first tr, as a fraction of the time from the first tr to td [-].
# _AFTER: time shown after td, as a fraction of the time from the first tr to td [-].
_BEFORE, _AFTER = 0.25, 0.15
# Height of the figure of ``study`` in a file [inch].
_HEIGHT: Final = 4.0
# Height of a run name, as a fraction of the axes [-].
_LINE: Final = 0.055
# The line from a curve to its name ends at the left edge of the name.
_ENDS: Final = {"relpos": (0, 0.5), "shrinkA": 1}
# The axis includes the lowest level if the median level is at most this multiple of it [-].
_LOWEST: Final = 50.0


def draw_suggestion(answer: PairSuggestion, *, page: bool = False) -> Figure:
    """Draw the energy in the flight with the target energy and the candidates or admissible windows; below, the motion.

    On a page a better pair is drawn into the same figure, since a second figure would look nearly the same.
    """
    best = answer.chosen
    has_few = answer.windows is None and len(answer.candidates) <= _FEW
    drawn = tuple(answer.candidates) if has_few else (best,) if best else ()
    refused = is_refused(answer.decision)
    bands = () if has_few or refused else answer.acceptable_windows
    better = answer.clearly_better if page else None
    return _draw(
        answer.situation,
        best.tr if best else None,
        drawn,
        bands,
        better,
        refused=refused,
        page=page,
    )


def draw_verdict(answer: PairVerdict, *, page: bool = False) -> Figure:
    """Draw the energy in the flight with the target energy and the judged pair, and the motion after td below.

    With a finished switched run, its energy is drawn over that of the reference instead of the motion of a model.
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
    refused: bool = False,
    page: bool = False,
) -> Figure:
    modelled = tr is not None and computed is None
    motion = replay_motion(situation, tr) if modelled and tr is not None else None
    modal = situation.basis == "modal" and modelled
    below = modal or motion is not None
    figure, panels = figures.begin(2 if below else 1, _HEIGHTS[below], page=page)
    view = make_view_of_situation(
        situation, *(() if tr is None else (tr,)), *(better[:2] if better else ())
    )
    _draw_energy(panels[0], situation, view, candidates, bands, refused=refused)
    if computed is not None:
        panels[0].plot(
            computed.time,
            computed.energy,
            color=SWITCHED,
            linewidth=1,
            label="switched run, as computed",
        )
    if modal and tr is not None:
        draw_halfway(panels[0], situation, tr)
        draw_residuals(panels[1], situation)
    elif motion:
        _draw_motion(panels[1], motion, situation.history.energy_unit)
    if better:
        _draw_better(panels, situation.at(better.td), better.tr)
    panels[-1].set_xlabel(add_unit("time", situation.history.time_unit))
    for panel in panels:
        figures.format_axes(panel, legend=not page)
    # The level is an energy in the flight, even if td lies after the end of the flight.
    scale = make_scale_of_flight(situation, view, [situation.energy_td])
    figures.show_span(panels[0], (view.start, view.end), scale, view.above)
    if page:
        figures.place_panels(figure, panels, _PANELS[below])
    figures.mark_times(panels, tr, situation.td, page=page)
    return figure


def _draw_energy(
    axes: Axes,
    situation: Situation,
    view: View,
    candidates: Sequence[Candidate],
    bands: Sequence[tuple[float, float]],
    *,
    refused: bool,
) -> None:
    history = situation.history
    level = situation.energy_td
    flight = situation.flight
    span = situation.evidence.span
    drawn = draw_outline(*history.between(view.start, view.end), stretches=STRETCHES)
    if flight.start is not None:
        if span:
            last_seen = span.end
        else:
            last_seen = situation.td
        end = last_seen if flight.end is None else flight.end
        mark_span(axes, (flight.start, end), f"flight ({flight.source})")
    axes.plot(
        *drawn,
        color=REFERENCE,
        linewidth=1,
        label=make_plain_text(history.energy_name),
    )
    axes.axhline(
        level, color=SWITCHED, linewidth=0.8, label=f"level at td, {level:.4g}"
    )
    for number, band in enumerate(
        merge_windows(bands, (view.end - view.start) / STRETCHES)
    ):
        label = "_" if number else "admissible tr"
        axes.axvspan(*band, ymax=_BAND, facecolor=NEUTRAL, linewidth=0, label=label)
    for admissible, fill, name in (
        (True, NEUTRAL, "candidates" if refused else "admissible"),
        (False, "none", "not admissible"),
    ):
        marked = [
            candidate for candidate in candidates if candidate.admissible == admissible
        ]
        if marked:
            label = name if len(candidates) > 1 else "tr"
            axes.scatter(
                [candidate.tr for candidate in marked],
                [candidate.energy for candidate in marked],
                s=28,
                linewidths=0.7,
                facecolors=fill,
                edgecolors=NEUTRAL,
                zorder=3,
                label=label,
            )
    axes.set_ylabel(label_energy(history.energy_unit))


def _draw_better(
    panels: Sequence[Axes], better_situation: Situation, tr: float
) -> None:
    """Draw a better pair at another td, i.e. its level, times and motion, in a separate colour and line style."""
    lines = [panels[0].axhline(better_situation.energy_td)]
    lines += [
        panel.axvline(time) for panel in panels for time in (tr, better_situation.td)
    ]
    motion = replay_motion(better_situation, tr)
    if motion and len(panels) > 1:
        lines += panels[1].plot(motion.time, motion.switched)
    for line in lines:
        line.set(color=BETTER, linestyle="-.", linewidth=0.8, label="better pair")


def _draw_motion(axes: Axes, motion: ReplayedMotion, energy_unit: str) -> None:
    for values, colour, name in (
        (motion.reference, REFERENCE, "without switching"),
        (motion.switched, SWITCHED, "switched"),
    ):
        axes.plot(motion.time, values, color=colour, linewidth=1, label=name)
    axes.set_ylabel(label_deformation(energy_unit))


def draw_plan(plan: RunPlan, *, page: bool = False) -> Figure:
    """Draw the energy over time on shaded flights, with the rigid windows above the curve."""
    figure, (axes,) = figures.begin(1, _PLAN_HEIGHT, page=page)
    history = plan.history
    axes.plot(
        history.time,
        history.energy,
        color=REFERENCE,
        linewidth=1,
        label="internal energy",
    )
    _show_flights(axes, plan)
    first, last = axes.get_xlim()
    for row in plan.flights:
        mark_span(axes, (row.start, row.end), "flight")
        if row.window:
            kind = _name_window_kind(row)
            axes.axvspan(
                *row.window,
                ymin=1 - _STRIP,
                facecolor=_COLOURS[kind],
                hatch=_HATCHES[kind],
                edgecolor="white",
                linewidth=0,
                label=f"rigid: {kind}",
            )
            figures.note(
                axes,
                _label_window(
                    row.number, row.window, _ROOM_FOR_TIMES[page] * (last - first)
                ),
                (sum(row.window) / 2, 1 - _STRIP),
                (0, -2),
                ha="center",
                va="top",
            )
    axes.set_xlim(first, last)
    shown = history.between(first, last)[1]
    low = min(0.0, float(shown.min(initial=0.0)))
    high = _HEADROOM * float(shown.max(initial=0.0)) or 1.0
    axes.set_ylim(low, high + 2 * _STRIP * (high - low))
    # The axis has no labels next to the windows, which have no energy.
    axes.set_yticks([tick for tick in axes.get_yticks() if low <= tick <= high])
    _finish_run_axes(figure, axes, *_label_run_axes(history), page=page)
    return figure


def _name_window_kind(row: PlannedFlight) -> str:
    """Return the verdict on a window that needs no further run first; for any other window, return its status."""
    if row.status == "supported" and row.decision:
        return row.decision.verdict
    return row.status


def _show_flights(axes: Axes, plan: RunPlan) -> None:
    """Limit the time axis to the flights, with some space before and after them."""
    if not plan.flights:
        return
    start = plan.flights[0].start
    end = plan.flights[-1].end
    beyond = _BEYOND_FLIGHTS * (end - start)
    first, last = plan.history.time[[0, -1]].tolist()
    axes.set_xlim(max(first, start - beyond), min(last, end + beyond))


def _label_window(number: int, window: Times, room: float) -> str:
    """Return the number of a window, and its times if it is longer than the ``room`` that they need [time]."""
    tr, td = window
    if td - tr < room:
        return str(number)
    return f"{number}: tr = {tr:.4g}, td = {td:.4g}"


def draw_run(
    history: History, flights: Sequence[Times], windows: Sequence[Times] = ()
) -> Figure:
    """Draw the reliable part of a run's energy, the flights, and the windows in which parts were rigid."""
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
        mark_span(axes, flight, "flight")
    for window in windows:
        axes.axvspan(*window, ymax=_STRIP, color=NEUTRAL, linewidth=0, label="rigid")
    _finish_run_axes(figure, axes, *_label_run_axes(history), page=True)
    return figure


def draw_parts(answer: Parts) -> Figure:
    """Draw the flights and the largest part energies; raise FormatError if there are no parts."""
    run = answer.files
    energies = run.part_energies(run.parts)
    time = run.part_time
    figure, (axes,) = figures.begin(1, _PLAN_HEIGHT, page=True)
    for at in energies.max(axis=0).argsort()[::-1][:_MOST_PARTS]:
        curve = draw_outline(time, energies[:, at], stretches=STRETCHES)
        axes.plot(*curve, linewidth=1, label=make_plain_text(run.parts[at].name))
    for flight in answer.facts.flights:
        mark_span(axes, flight, "flight")
    _finish_run_axes(figure, axes, "time", "internal energy", page=True)
    return figure


def _label_run_axes(history: History) -> tuple[str, str]:
    """Return the labels of the time and energy axes."""
    time_label = add_unit("time", history.time_unit)
    return time_label, label_energy(history.energy_unit)


def _finish_run_axes(
    figure: Figure, axes: Axes, time_label: str, energy_label: str, *, page: bool
) -> None:
    """Label the axes of a figure of a complete run, and place the legend below them."""
    axes.set(xlabel=time_label, ylabel=energy_label)
    figures.format_axes(axes, legend=False)
    if page:
        figures.place_panels(figure, [axes], _PLAN_PANEL)
    else:
        figures.add_legend_below(figure, [axes])


def draw_trade_off(trade_off: TradeOff, *, page: bool = False) -> Figure:
    """Draw the energy in the td range and, below it, the error and saving of the best pair at each td."""
    figure, panels = figures.begin(3, _TRADE_HEIGHT, page=page)
    energy, error, rigid = panels
    history = trade_off.situation.history
    inner = history.between(*trade_off.td_window)
    energy.plot(
        *draw_outline(*inner, stretches=STRETCHES), color=REFERENCE, linewidth=1
    )
    energy.set(ylabel=label_energy(history.energy_unit))
    by_energy = bool(trade_off.offers) and all(
        offer.basis == "energy" for offer in trade_off.offers
    )
    _draw_offers(error, trade_off, [offer.error for offer in trade_off.offers])
    error.set(ylabel=_ERRORS[by_energy], ylim=(0, None))
    saved = [offer.saving for offer in trade_off.offers]
    cost = any(offer is not None for offer in saved)
    _draw_offers(
        rigid,
        trade_off,
        saved if cost else [offer.rigid_time for offer in trade_off.offers],
    )
    td = add_unit("td", history.time_unit)
    rigid.set(
        ylabel="saves (share of the CPU time)" if cost else "rigid time",
        xlabel=td,
        ylim=(0, None),
    )
    chosen = trade_off.recommended
    _mark_tr(energy, trade_off, trade_off.requested or chosen)
    is_chosen_refused = chosen is not None and is_refused(trade_off.decide_on(chosen))
    chosen_name = f"chosen ({DO_NOT_USE})" if is_chosen_refused else "recommended"
    for axes in panels:
        for offer, colour, name in (
            (trade_off.requested, NEUTRAL, "td asked for"),
            (chosen, SWITCHED, chosen_name),
        ):
            if offer:
                axes.axvline(
                    offer.td, color=colour, linewidth=1, linestyle="--", label=name
                )
        figures.format_axes(axes, legend=False)
        axes.margins(x=_AT_EDGE)
    if page:
        figures.place_panels(figure, panels, _TRADE_PANEL)
    else:
        figures.add_legend_below(figure, panels, size=None)
    return figure


def _mark_tr(axes: Axes, trade_off: TradeOff, offer: Offer | None) -> None:
    """Write the pair with its verdict above the energy; mark its tr, if the td range contains it."""
    decision = trade_off.decide_on(offer) if offer else None
    if offer is None or offer.tr is None or decision is None:
        return
    axes.set_title(
        f"tr = {offer.tr:.6g}, td = {offer.td:.6g}: {decision.verdict}",
        loc="left",
        fontsize="small",
        color=SWITCHED,
    )
    start, end = trade_off.td_window
    if start <= offer.tr <= end:
        axes.axvline(offer.tr, color=SWITCHED, linewidth=1, linestyle=":", label="tr")


def _draw_offers(axes: Axes, trade_off: TradeOff, values: list[float | None]) -> None:
    """Draw one metric of all proposed pairs, with gaps for unknown values, and mark the Pareto-optimal pairs."""
    td = np.array([offer.td for offer in trade_off.offers])
    drawn = np.array([np.nan if value is None else value for value in values])
    best = np.array([offer.unbeaten for offer in trade_off.offers], dtype=bool)
    axes.plot(td, drawn, color=REFERENCE, linewidth=0.8, label="best pair for each td")
    axes.plot(
        td[best], drawn[best], "o", color=NEUTRAL, markersize=4, label="Pareto-optimal"
    )


class _Named(NamedTuple):
    curve: Samples
    name: str
    colour: str
    pattern: str


def draw_study(answer: StudyOfRuns, *, page: bool = False) -> Figure:
    """Draw the energies of all runs around td, the tr of each run, the common tr, and td."""
    # matplotlib has to compute the margins, because their width depends on the run names next to the axes.
    figure = Figure(
        figsize=(figures.PAGE_WIDTH if page else figures.WIDTH, _HEIGHT),
        layout="constrained",
    )
    axes = figure.subplots()
    drawn = {id(row): row.curve for row in answer.runs if row.curve is not None}
    runs = [row for row in answer.runs if id(row) in drawn]
    named_runs = _choose_named_runs(runs, drawn)
    _draw_others(axes, [*drawn.values()], named_runs)
    for named_run in named_runs:
        axes.plot(
            *named_run.curve,
            color=named_run.colour,
            linestyle=named_run.pattern,
            linewidth=1,
            label="_",
        )
    if answer.common.window and answer.grade != POOR:
        mark_span(
            axes, answer.common.window, "admissible in all runs", NEUTRAL, alpha=0.2
        )
    _draw_times(axes, runs)
    units = {row.time_unit for row in answer.runs if row.judged}
    axes.set(
        xlabel=add_unit("time", units.pop() if len(units) == 1 else ""),
        ylabel=label_energy(answer.energy_unit),
    )
    figures.format_axes(axes, legend=False)
    _show_runs(axes, answer, runs, [*drawn.values()])
    _write_names(axes, named_runs, page=page)
    figures.add_legend_below(figure, [axes], columns=1 if page else 4)
    figures.mark_times([axes], answer.common.tr, answer.td, page=page)
    return figure


def _choose_named_runs(
    runs: Sequence[StudyRow], curves: Mapping[int, Samples]
) -> list[_Named]:
    """Return the runs that are drawn in colour and named: all runs if there are few, otherwise the outliers."""
    if len(runs) <= _NAMED:
        chosen = list(runs)
    else:
        chosen = list(find_outliers(runs))[:_MOST_OUTLIERS]
    names = dict(
        zip(map(id, runs), shorten_names([row.source for row in runs]), strict=True)
    )
    palette = _RUN_COLOURS if len(runs) <= _NAMED else _RUN_COLOURS[1:]
    return [
        _Named(
            curves[id(row)],
            make_plain_text(names[id(row)]),
            palette[i % len(palette)],
            _PATTERNS[i // len(palette) % 2],
        )
        for i, row in enumerate(chosen)
    ]


def _draw_others(
    axes: Axes, curves: Sequence[Samples], named_runs: Sequence[_Named]
) -> None:
    """Draw the runs without names in grey, fainter if there are more runs."""
    named_curves = {id(named_run.curve) for named_run in named_runs}
    other_curves = [curve.T for curve in curves if id(curve) not in named_curves]
    is_thin = len(curves) > _MANY
    lines = LineCollection(
        other_curves,
        colors=_GREY if named_curves or len(other_curves) > 1 else REFERENCE,
        linewidths=0.6 if is_thin else 1,
        rasterized=is_thin,
        alpha=max(_FAINTEST, min(1.0, _DARK / max(1, len(other_curves)))),
        label=f"internal energy of {format_number_of_runs(len(curves))}"
        if other_curves
        else "_",
    )
    axes.add_collection(lines)
    axes.autoscale_view()


def _draw_times(axes: Axes, drawn: Sequence[StudyRow]) -> None:
    """Mark the tr of each run at its target energy."""
    points = np.array([(row.tr, row.energy_td) for row in drawn if row.tr is not None])
    if points.size:
        is_thin = len(drawn) > _MANY
        axes.scatter(
            points[:, 0], points[:, 1], s=8 if is_thin else 28, linewidths=0.7, facecolors=NEUTRAL, edgecolors="white",
            zorder=3, label="tr of each run", rasterized=is_thin,
        )  # fmt: skip


def _show_runs(
    axes: Axes,
    answer: StudyOfRuns,
    drawn: Sequence[StudyRow],
    curves: Sequence[Samples],
) -> None:
    """Limit the axes to the time from shortly before the first tr to shortly after td, and to the energies in it."""
    if not curves:
        return
    first = min(float(curve[0, 0]) for curve in curves)
    last = max(float(curve[0, -1]) for curve in curves)
    times = [row.tr for row in drawn if row.tr is not None]
    if answer.td is None:
        td = max((row.td for row in drawn if row.td is not None), default=last)
    else:
        td = answer.td
    if times:
        early = min([*times, td if answer.common.tr is None else answer.common.tr])
    else:
        early = first
    span = (
        max(first, early - _BEFORE * (td - early)),
        min(last, td + _AFTER * (td - early)),
    )
    levels = np.array([row.energy_td for row in drawn if row.energy_td is not None])
    inner, visible_energies = (
        np.concatenate([levels, *_select_energies(curves, *window)])
        for window in ((early, td), span)
    )
    # The axis also shows the lowest level, unless it is far below the median level.
    level = min(float(np.median(levels)), _LOWEST * float(levels.min()))
    scale = make_scale(float(inner.min()), float(visible_energies.max()), level)
    if drawn and all("at-rest" in row.warnings for row in drawn):
        scale = make_scale(0.0, max(float(curve[1].max()) for curve in curves), 0.0)
    figures.show_span(axes, span, scale, [])


def _select_energies(
    curves: Sequence[Samples], start: float, end: float
) -> Iterator[Samples]:
    """Return the energies of each curve from ``start`` to ``end``."""
    for time, energy in curves:
        yield energy[(start <= time) & (time <= end)]


def _write_names(axes: Axes, named_runs: Sequence[_Named], *, page: bool) -> None:
    """Write the run names next to the axes in the order of the curves; a line connects each name to its curve."""
    end = axes.get_xlim()[1]
    free = 0.0
    runs_by_height = (
        (_compute_height(axes, float(np.interp(end, *named_run.curve))), named_run)
        for named_run in named_runs
    )
    for height, named_run in sorted(runs_by_height, key=lambda pair: pair[0]):
        at = max(free, min(height, 1 - _LINE * (len(named_runs) - 1)))
        free = at + _LINE
        axes.annotate(
            named_run.name,
            (1, height),
            xycoords="axes fraction",
            xytext=(1.03, at),
            textcoords="axes fraction",
            va="center",
            fontsize="x-small" if page else "small",
            color=named_run.colour,
            annotation_clip=False,
            arrowprops={
                "arrowstyle": "-",
                "color": named_run.colour,
                "linewidth": 0.6,
                "linestyle": named_run.pattern,
                **_ENDS,
            },
        )


def _compute_height(axes: Axes, value: float) -> float:
    """Return the height of a value on the axes [-], from 0 at the bottom to 1 at the top."""
    bottom, top = axes.get_ylim()
    value = min(max(value, bottom), top)
    if axes.get_yscale() == "log":
        return float(np.log(value / bottom) / np.log(top / bottom))
    return (value - bottom) / (top - bottom)
