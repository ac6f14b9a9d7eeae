"""Results as figures; the only module that imports matplotlib."""

from __future__ import annotations

import io
import re
import warnings
from contextlib import contextmanager
from pathlib import PurePath
from typing import TYPE_CHECKING, Any, Final

import matplotlib as mpl
import numpy as np
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from d2rpick.errors import FormatError
from d2rpick.vibration.one_mode import Mode
from d2rpick.vibration.replay import Replay, Trajectory, from_mode

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, Sequence

    from matplotlib.axes import Axes

    from d2rpick.choice.candidates import Candidate
    from d2rpick.choice.situation import Situation
    from d2rpick.choice.suggest import Suggestion
    from d2rpick.choice.verify import Verdict
    from d2rpick.histories.history import Samples
    from d2rpick.models.published_figures import Exhibit, Panel
    from d2rpick.models.rollover.record import Record
    from d2rpick.models.rollover.run import Window
    from d2rpick.models.rollover.scan import Outcome
    from d2rpick.study.study import Study

FORMATS = ("png", "svg", "pdf")
# Okabe and Ito's palette: told apart with any colour vision.
_REFERENCE, _SWITCHED, _GOOD, _FLIGHT = "#000000", "#d55e00", "#009e73", "#56b4e9"
_COLOURS = (_REFERENCE, _SWITCHED, _GOOD)
_STYLES: Final[Mapping[str, dict[str, Any]]] = {
    "line": {"linewidth": 1}, "thin": {"linewidth": 0.6, "linestyle": "--"}, "dots": {"linestyle": "", "marker": "."},
}  # fmt: skip
# Dots on a curve: few enough that the line below stays in sight.
_DOTS = 100
# Beyond this ratio of the highest energy to the level, the level would vanish on a linear axis.
_LOGARITHMIC = 20.0
_DECADES_BELOW_LEVEL = 2.0
# Of a name from a file, what fits into a legend; in full it stands in the result.
_LONGEST_NAME = 28
# Up to so many candidates their marks leave the curve visible.
_FEW = 40
# Many curves over each other are together as dark as so many, and none is fainter than this.
_DARK, _FAINTEST = 10, 0.02
# Width of a figure, and the height of one panel and of two [inch]; on a narrow page letters keep their size.
_SIZES = {False: (10.0, 4.0, 6.5), True: (4.2, 3.9, 6.6)}
# Share of the axes that the label of a switch time takes up, at most.
_LABEL = {False: 0.14, True: 0.3}
# Outlines of the rolling box, as many as can be told apart.
_OUTLINES = 8


def format_of(name: str) -> str:
    """Tell the format that the suffix of ``name`` asks for; FormatError unless it is png, svg or pdf."""
    form = PurePath(name).suffix.lower().lstrip(".")
    if form not in FORMATS:
        raise FormatError(f"{name}: plots are written as {', '.join(FORMATS)}; give the file such a suffix")
    return form


def render(figure: Figure, name: str) -> bytes:
    """Turn a figure into the bytes of the file ``name``, in the format that its suffix asks for, always the same."""
    content, form = io.BytesIO(), format_of(name)
    undated = {"svg": {"Date": None}, "pdf": {"CreationDate": None}}.get(form)
    with mpl.rc_context({"svg.hashsalt": "d2rpick"}), _any_letters():
        figure.savefig(content, format=form, dpi=150, metadata=undated)
    return content.getvalue()


def svg_element(figure: Figure, prefix: str) -> str:
    """Turn a figure into an SVG element for a page, whose ids all begin with ``prefix``; letters stay letters."""
    content = io.StringIO()
    nothing = dict.fromkeys(("Creator", "Date", "Format", "Type"))
    with mpl.rc_context({"svg.fonttype": "none", "svg.hashsalt": prefix}), _any_letters():
        figure.savefig(content, format="svg", metadata=nothing)
    element = content.getvalue()
    element = element[element.index("<svg") :]
    element = re.sub(r' (?:width|height)="[\d.]+pt"', "", element, count=2)  # the page says how wide
    return re.sub(r'(?<= id=")|(?<=href="#)|(?<=url\(#)', prefix, element)


def both_widths(draw: Callable[..., Figure], answer: Suggestion | Verdict | Study, name: str) -> tuple[str, str]:
    """Give what ``draw`` draws of an answer as SVG elements for a wide and a narrow page; ``name`` tells them apart."""
    return (
        svg_element(draw(answer), f"{name}-wide-"),
        svg_element(draw(answer, narrow=True), f"{name}-narrow-"),
    )


@contextmanager
def _any_letters() -> Iterator[None]:
    """Let letters of a name that the font lacks be boxes, without a warning."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", r"Glyph \d+ .* missing from", UserWarning)
        yield


def draw_suggestion(answer: Suggestion, *, narrow: bool = False) -> Figure:
    """Energy with level, candidates and the recommended pair; below it the motion after that pair."""
    tr = answer.recommended.tr if answer.recommended else None
    return _draw(answer.situation, answer.candidates, tr, narrow=narrow)


def draw_better(answer: Suggestion, *, narrow: bool = False) -> Figure:
    """Draw the same for the better pair; there must be one."""
    assert answer.better_pair is not None
    return _draw(answer.situation.at(answer.better_pair.td), (), answer.better_pair.tr, narrow=narrow)


def draw_verdict(answer: Verdict, *, narrow: bool = False) -> Figure:
    """Energy with level and the pair that was judged; below it the motion after that pair."""
    return _draw(answer.situation, (answer.candidate,), answer.candidate.tr, narrow=narrow)


def draw_replay(motion: Trajectory, switched: Replay | None) -> Figure:
    """Displacements of both masses and the energies over time; the rigid window shaded."""
    figure = Figure(figsize=(9, 6.5), layout="constrained")
    upper, lower = figure.subplots(2, 1, sharex=True)
    upper.plot(motion.time, motion.state.z, color=_REFERENCE, label="z, frame")
    upper.plot(motion.time, motion.state.y, color=_SWITCHED, label="y, suspended mass")
    upper.set_ylabel("displacement")
    lower.plot(motion.time, motion.internal_energy, color=_REFERENCE, label="internal energy")
    lower.plot(motion.time, motion.kinetic_energy, color=_SWITCHED, label="kinetic energy")
    lower.set(xlabel="time", ylabel="energy")
    for axes in (upper, lower):
        if switched:
            axes.axvspan(switched.tr, switched.td, color=_FLIGHT, alpha=0.2, label="rigid", linewidth=0)
        _finish(axes)
    return figure


def draw_study(answer: Study, *, narrow: bool = False) -> Figure:
    """Energies of all runs over each other, the tr of each, the common one and td."""
    width, height, _ = _SIZES[narrow]
    figure = Figure(figsize=(width, height), layout="constrained")
    axes = figure.subplots()
    curves = [row.curve for row in answer.rows if row.curve is not None]
    many = len(curves) > _FEW
    # taken together they stay as dark as ten lines
    lines = LineCollection(
        [curve.T for curve in curves], colors=_REFERENCE, linewidths=0.6 if many else 1, rasterized=many,
        alpha=max(_FAINTEST, min(1.0, _DARK / max(1, len(curves)))),
        label="internal energy" if len(curves) == 1 else f"internal energy of {len(curves)} runs",
    )  # fmt: skip
    axes.add_collection(lines)
    axes.autoscale_view()
    if answer.common.window:
        axes.axvspan(*answer.common.window, color=_GOOD, alpha=0.2, linewidth=0, label="acceptable in all runs")
    points = np.array([(row.tr, row.energy_td) for row in answer.rows if row.tr is not None])
    if points.size:
        axes.scatter(
            points[:, 0], points[:, 1], s=8 if many else 28, linewidths=0.7, facecolors=_GOOD, edgecolors="white",
            zorder=3, label="tr of each run", rasterized=many,
        )  # fmt: skip
        _scale(axes, points[:, 1], max(float(curve[1].max()) for curve in curves))
    units = {row.time_unit for row in answer.rows if row.judged}
    unit = units.pop() if len(units) == 1 else ""
    axes.set(xlabel=f"time [{unit}]" if unit else "time", ylabel="internal energy")
    _finish(axes, legend=not narrow)
    if narrow:
        figure.legend(loc="outside lower left", ncols=1, fontsize="small", frameon=False)
    _mark(axes, answer.common.tr, answer.td, _LABEL[narrow])
    return figure


def _scale(axes: Axes, levels: Samples, highest: float) -> None:
    """Make the axis logarithmic where the levels would vanish on a linear one; the lowest stays in sight."""
    if levels.min() > 0 and highest > _LOGARITHMIC * levels.max():
        axes.set_yscale("log")
        axes.set_ylim(bottom=min(float(levels.min()) / 2, float(np.median(levels)) / 10**_DECADES_BELOW_LEVEL))


def draw_exhibit(exhibit: Exhibit) -> Figure:
    """All panels of an exhibit over their common time."""
    rows, columns = len(exhibit.panels), len(exhibit.panels[0])
    figure = Figure(figsize=(9 if columns == 1 else 5.2 * columns, 3.2 * rows), layout="constrained")
    figure.suptitle(exhibit.title, fontsize="medium")
    grid = figure.subplots(rows, columns, sharex=True, squeeze=False)
    for axes, panel in zip(grid.flat, (panel for row in exhibit.panels for panel in row), strict=True):
        _draw_panel(axes, panel, exhibit.columns)
    for axes in grid[-1]:
        axes.set_xlabel("time [ms]")
    return figure


def _draw_panel(axes: Axes, panel: Panel, columns: Mapping[str, Samples]) -> None:
    time = next(iter(columns.values()))
    drawn = dict.fromkeys(_STYLES, 0)
    for curve in panel.curves:
        every = max(1, time.size // _DOTS) if curve.style == "dots" else 1
        axes.plot(
            time[::every], columns[curve.column][::every], label=curve.label,
            color=_COLOURS[drawn[curve.style]], **_STYLES[curve.style],
        )  # fmt: skip
        drawn[curve.style] += 1
    for name, level in panel.levels:
        axes.axhline(level, color=_SWITCHED, linewidth=0.8, label=name)
        _show_level(axes, level, max(float(columns[curve.column].max()) for curve in panel.curves))
    for x, y in panel.points:
        axes.plot(x, y, "o", color=_GOOD, markersize=5)
    if panel.rigid:
        axes.axvspan(*panel.rigid, color=_FLIGHT, alpha=0.2, linewidth=0, label="rigid")
    axes.set_title(panel.title, fontsize="small")
    axes.set_ylabel(panel.ylabel)
    _finish(axes, legend=False)
    axes.legend(fontsize="small", loc="best")


def draw_rollover(reference: Record, switched: Record | None, window: Window | None) -> Figure:
    """Outlines of the box at even times, with and without switching; beside them roll and height over time."""
    figure = Figure(figsize=(11, 5.5), layout="constrained")
    outlines, roll, height = figure.subplot_mosaic([["o", "r"], ["o", "h"]], width_ratios=(1.4, 1)).values()
    runs = [(reference, _REFERENCE, "without switching"), (switched, _SWITCHED, "switched")]
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
        if window:
            axes.axvspan(window.tr, window.td, color=_FLIGHT, alpha=0.2, linewidth=0, label="rigid")
        _finish(axes)
    return figure


def draw_scan(reference: Record, outcomes: Sequence[Outcome], answer: Suggestion) -> Figure:
    """Energy of the box against its level at td; below it, against tr, the errors of roll and of mean energy."""
    figure = Figure(figsize=(9, 8), layout="constrained")
    energy, roll, mean = figure.subplots(3, 1, sharex=True)
    before = reference.time <= answer.situation.td
    internal = reference.internal_energy[before, 0]
    energy.plot(reference.time[before], internal, color=_REFERENCE, linewidth=1, label="internal energy of the box")
    energy.axhline(internal[-1], color=_SWITCHED, linewidth=0.8, label=f"level at td, {internal[-1]:.4g}")
    times = [one.tr for one in outcomes]
    roll.plot(times, [abs(one.roll_error) for one in outcomes], ".-", color=_REFERENCE, label="roll error at td")
    mean.plot(times, [one.mean_ratio - 1 for one in outcomes], ".-", color=_REFERENCE, label="error of the mean energy")
    mean.axhline(0, color=_REFERENCE, linewidth=0.5)
    energy.set_ylabel("energy [J]")
    roll.set(ylabel="|roll error| [degrees]", yscale="log")
    mean.set(ylabel="mean energy after td,\nrelative error", xlabel="tr [s]")
    for axes in (energy, roll, mean):
        if reference.released is not None:
            axes.axvspan(0, reference.released, color=_SWITCHED, alpha=0.1, linewidth=0, label="the sled pushes")
        if answer.recommended:
            axes.axvline(answer.recommended.tr, color=_GOOD, linestyle="--", linewidth=1, label="recommended tr")
        _finish(axes)
    return figure


def _draw(situation: Situation, candidates: tuple[Candidate, ...], tr: float | None, *, narrow: bool = False) -> Figure:
    with_motion = tr is not None and isinstance(situation.vibration.mode, Mode) and situation.vibration.described(tr)
    width, one, two = _SIZES[narrow]
    figure = Figure(figsize=(width, two if with_motion else one), layout="constrained")
    axes = figure.subplots(2 if with_motion else 1, 1, sharex=True, squeeze=False)[:, 0]
    _draw_energy(axes[0], situation, candidates)
    if with_motion and tr is not None:
        _draw_motion(axes[1], situation, tr)
    unit = situation.history.time_unit
    axes[-1].set_xlabel(f"time [{unit}]" if unit else "time")
    for panel in axes:
        _finish(panel, legend=not narrow)
        _mark(panel, tr, situation.td, _LABEL[narrow])
    if narrow:  # a legend inside would hide the curves
        axes[-1].locator_params(axis="x", nbins=4)
        known = [dict(zip(*reversed(panel.get_legend_handles_labels()), strict=True)) for panel in axes]
        handles = {name: handle for one in known for name, handle in one.items()}
        figure.legend(handles.values(), handles, loc="outside lower left", ncols=2, fontsize="small", frameon=False)
    return figure


def _draw_energy(axes: Axes, situation: Situation, candidates: tuple[Candidate, ...]) -> None:
    history, level, flight, span = situation.history, situation.energy_td, situation.flight, situation.evidence.span
    if flight.start is not None:
        known = span.end if span else situation.td  # without a contact, as far as it was seen
        end = known if flight.end is None else flight.end
        axes.axvspan(flight.start, end, color=_FLIGHT, alpha=0.15, linewidth=0, label=f"flight ({flight.source})")
    axes.plot(history.time, history.energy, color=_REFERENCE, linewidth=1, label=_plain(history.channel))
    axes.axhline(level, color=_SWITCHED, linewidth=0.8, label=f"level at td, {level:.4g}")
    for acceptable, fill, name in ((True, _GOOD, "acceptable tr"), (False, "none", "other candidates")):
        some = [c for c in candidates if c.acceptable == acceptable]
        if some:
            times, energies = [c.tr for c in some], [c.energy for c in some]
            size = 28 if len(candidates) <= _FEW else 8
            axes.scatter(
                times, energies, s=size, linewidths=0.7, facecolors=fill, edgecolors=_GOOD, zorder=3, label=name
            )
    _show_level(axes, level, float(history.energy.max()))
    axes.set_ylabel("internal energy")


def _show_level(axes: Axes, level: float, highest: float) -> None:
    if level > 0 and highest > _LOGARITHMIC * level:
        axes.set_yscale("log")
        axes.set_ylim(bottom=level / 10**_DECADES_BELOW_LEVEL)


def _draw_motion(axes: Axes, situation: Situation, tr: float) -> None:
    mode, span, td = situation.vibration.mode, situation.evidence.span, situation.td
    assert isinstance(mode, Mode)
    assert span is not None
    time = np.linspace(span.start, max(span.end, td), 2000)
    oscillator, start = from_mode(mode, span.start)
    replay = Replay(oscillator, start, span.start, tr, td)
    for states, colour, name in (
        (replay.reference(time), _REFERENCE, "without switching"),
        (replay.motion(time), _SWITCHED, "switched"),
    ):
        axes.plot(time, mode.preload + states.y - states.z, color=colour, linewidth=1, label=name)
    axes.set_ylabel("deformation [√energy]")


def _mark(axes: Axes, tr: float | None, td: float, width: float) -> None:
    """Mark the switch times; their labels stand above the axes, away from each other and from the edges.

    A label takes up ``width`` of the axes: where one would reach over an edge it changes its side if there is room.
    """
    low, high = axes.get_xlim()
    places = [None if time is None else (time - low) / (high - low) for time in (tr, td)]
    room = 1.0 if places[0] is None or places[1] is None else places[1] - places[0]
    sides = ["right", "left"]
    if places[0] is not None and places[0] < width < room:
        sides[0] = "left"
    if places[1] is not None and places[1] > 1 - width and room > width * (1 + (sides[0] == "left")):
        sides[1] = "right"
    for name, time, side in zip(("tr", "td"), (tr, td), sides, strict=True):
        if time is not None:
            axes.axvline(time, color=_SWITCHED, linestyle="--", linewidth=0.8)
            axes.annotate(
                f" {name} = {time:.6g} ", (time, 1), xycoords=("data", "axes fraction"), xytext=(0, 3),
                textcoords="offset points", ha=side, fontsize="small", color=_SWITCHED,
            )  # fmt: skip


def _finish(axes: Axes, *, legend: bool = True) -> None:
    axes.grid(visible=True, linewidth=0.3)
    axes.margins(x=0)
    if legend:
        axes.legend(fontsize="small", loc="upper left", bbox_to_anchor=(1.0, 1.0))


def _plain(name: str) -> str:
    """Keep a name from a file from being read as a formula, or, with an underscore in front, as one to be hidden.

    It is cut where it is too long, and what cannot be printed becomes a question mark.
    """
    shown = "".join(letter if letter.isprintable() else "?" for letter in name)
    shown = shown if len(shown) <= _LONGEST_NAME else f"{shown[: _LONGEST_NAME - 1]}…"
    return f"{' ' if shown.startswith('_') else ''}{shown}".replace("$", r"\$")
