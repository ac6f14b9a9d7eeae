"""Figures of a choice and of a study, and how every figure is rendered."""

from __future__ import annotations

import io
import re
import warnings
from contextlib import contextmanager
from pathlib import PurePath
from typing import TYPE_CHECKING

import matplotlib as mpl
import numpy as np
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from d2rpick.errors import FormatError
from d2rpick.vibration.one_mode import Mode
from d2rpick.vibration.replay import Replay, from_mode

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from matplotlib.axes import Axes

    from d2rpick.choice.candidates import Candidate
    from d2rpick.choice.situation import Situation
    from d2rpick.choice.suggest import AcceptableWindow, Suggestion
    from d2rpick.choice.verify import Verdict
    from d2rpick.histories.history import Samples
    from d2rpick.studies.study import Study

FORMATS = ("png", "svg", "pdf")
# Okabe and Ito's palette: told apart with any colour vision.
REFERENCE, SWITCHED, GOOD, FLIGHT = "#000000", "#d55e00", "#009e73", "#56b4e9"
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
    """Energy with level, candidates or windows, and the recommended pair; below it the motion after that pair."""
    tr = answer.recommended.tr if answer.recommended else None
    shown = tuple(c for c in answer.candidates if answer.windows is None or c.recommended)
    return _draw(answer.situation, shown, tr, answer.windows or (), narrow=narrow)


def draw_better(answer: Suggestion, *, narrow: bool = False) -> Figure:
    """Draw the same for the better pair; there must be one."""
    assert answer.better_pair is not None
    return _draw(answer.situation.at(answer.better_pair.td), (), answer.better_pair.tr, narrow=narrow)


def draw_verdict(answer: Verdict, *, narrow: bool = False) -> Figure:
    """Energy with level and the pair that was judged; below it the motion after that pair."""
    return _draw(answer.situation, (answer.candidate,), answer.candidate.tr, narrow=narrow)


def draw_study(answer: Study, *, narrow: bool = False) -> Figure:
    """Energies of all runs over each other, the tr of each, the common one and td."""
    width, height, _ = _SIZES[narrow]
    figure = Figure(figsize=(width, height), layout="constrained")
    axes = figure.subplots()
    curves = [row.curve for row in answer.rows if row.curve is not None]
    many = len(curves) > _FEW
    # taken together they stay as dark as ten lines
    lines = LineCollection(
        [curve.T for curve in curves], colors=REFERENCE, linewidths=0.6 if many else 1, rasterized=many,
        alpha=max(_FAINTEST, min(1.0, _DARK / max(1, len(curves)))),
        label="internal energy" if len(curves) == 1 else f"internal energy of {len(curves)} runs",
    )  # fmt: skip
    axes.add_collection(lines)
    axes.autoscale_view()
    if answer.common.window:
        axes.axvspan(*answer.common.window, color=GOOD, alpha=0.2, linewidth=0, label="acceptable in all runs")
    points = np.array([(row.tr, row.energy_td) for row in answer.rows if row.tr is not None])
    if points.size:
        axes.scatter(
            points[:, 0], points[:, 1], s=8 if many else 28, linewidths=0.7, facecolors=GOOD, edgecolors="white",
            zorder=3, label="tr of each run", rasterized=many,
        )  # fmt: skip
        _scale(axes, points[:, 1], max(float(curve[1].max()) for curve in curves))
    units = {row.time_unit for row in answer.rows if row.judged}
    unit = units.pop() if len(units) == 1 else ""
    axes.set(xlabel=f"time [{unit}]" if unit else "time", ylabel="internal energy")
    finish(axes, legend=not narrow)
    if narrow:
        figure.legend(loc="outside lower left", ncols=1, fontsize="small", frameon=False)
    _mark(axes, answer.common.tr, answer.td, _LABEL[narrow])
    return figure


def _scale(axes: Axes, levels: Samples, highest: float) -> None:
    """Make the axis logarithmic where the levels would vanish on a linear one; the lowest stays in sight."""
    if levels.min() > 0 and highest > _LOGARITHMIC * levels.max():
        axes.set_yscale("log")
        axes.set_ylim(bottom=min(float(levels.min()) / 2, float(np.median(levels)) / 10**_DECADES_BELOW_LEVEL))


def _draw(
    situation: Situation,
    candidates: tuple[Candidate, ...],
    tr: float | None,
    windows: tuple[AcceptableWindow, ...] = (),
    *,
    narrow: bool = False,
) -> Figure:
    with_motion = tr is not None and isinstance(situation.vibration.mode, Mode) and situation.vibration.described(tr)
    width, one, two = _SIZES[narrow]
    figure = Figure(figsize=(width, two if with_motion else one), layout="constrained")
    axes = figure.subplots(2 if with_motion else 1, 1, sharex=True, squeeze=False)[:, 0]
    _draw_energy(axes[0], situation, candidates)
    if windows:
        starts, ends = ([getattr(window, name) for window in windows] for name in ("start", "end"))
        axes[0].hlines(
            [situation.energy_td] * len(windows), starts, ends, color=GOOD, linewidth=5, label="acceptable tr"
        )
    if with_motion and tr is not None:
        _draw_motion(axes[1], situation, tr)
    unit = situation.history.time_unit
    axes[-1].set_xlabel(f"time [{unit}]" if unit else "time")
    for panel in axes:
        finish(panel, legend=not narrow)
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
        axes.axvspan(flight.start, end, color=FLIGHT, alpha=0.15, linewidth=0, label=f"flight ({flight.source})")
    axes.plot(history.time, history.energy, color=REFERENCE, linewidth=1, label=_plain(history.channel))
    axes.axhline(level, color=SWITCHED, linewidth=0.8, label=f"level at td, {level:.4g}")
    for acceptable, fill, name in ((True, GOOD, "acceptable candidates"), (False, "none", "other candidates")):
        some = [c for c in candidates if c.acceptable == acceptable]
        if some:
            times, energies = [c.tr for c in some], [c.energy for c in some]
            size = 28 if len(candidates) <= _FEW else 8
            axes.scatter(
                times, energies, s=size, linewidths=0.7, facecolors=fill, edgecolors=GOOD, zorder=3, label=name
            )
    show_level(axes, level, float(history.energy.max()))
    axes.set_ylabel("internal energy")


def show_level(axes: Axes, level: float, highest: float) -> None:
    """Make the axis logarithmic where the level would vanish on a linear one."""
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
        (replay.reference(time), REFERENCE, "without switching"),
        (replay.motion(time), SWITCHED, "switched"),
    ):
        axes.plot(time, mode.preload + states.y - states.z, color=colour, linewidth=1, label=name)
    axes.set_ylabel("deformation [√energy]")


def _mark(axes: Axes, tr: float | None, td: float | None, width: float) -> None:
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
            axes.axvline(time, color=SWITCHED, linestyle="--", linewidth=0.8)
            axes.annotate(
                f" {name} = {time:.6g} ", (time, 1), xycoords=("data", "axes fraction"), xytext=(0, 3),
                textcoords="offset points", ha=side, fontsize="small", color=SWITCHED,
            )  # fmt: skip


def finish(axes: Axes, *, legend: bool = True) -> None:
    """Draw the grid, keep the time axis tight, and put the legend beside the axes."""
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
