"""Results as figures; the only module that imports matplotlib."""

from __future__ import annotations

import io
from pathlib import PurePath
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from d2rpick.errors import FormatError
from d2rpick.replay import Replay, Trajectory, from_mode

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from d2rpick.candidates import Candidate
    from d2rpick.choice import Suggestion, Verdict
    from d2rpick.situation import Situation
    from d2rpick.study import Study

FORMATS = ("png", "svg", "pdf")
# Okabe and Ito's palette: told apart with any colour vision.
_REFERENCE, _SWITCHED, _GOOD, _FLIGHT = "#000000", "#d55e00", "#009e73", "#56b4e9"
# Beyond this ratio of the highest energy to the level, the level would vanish on a linear axis.
_LOGARITHMIC = 20.0
_DECADES_BELOW_LEVEL = 2.0
# Up to so many candidates their marks leave the curve visible.
_FEW = 40


def format_of(name: str) -> str:
    """Tell the format that the suffix of ``name`` asks for; FormatError unless it is png, svg or pdf."""
    form = PurePath(name).suffix.lower().lstrip(".")
    if form not in FORMATS:
        raise FormatError(f"{name}: plots are written as {', '.join(FORMATS)}; give the file such a suffix")
    return form


def render(figure: Figure, name: str) -> bytes:
    """Turn a figure into the bytes of the file ``name``, in the format that its suffix asks for."""
    content = io.BytesIO()
    figure.savefig(content, format=format_of(name), dpi=150)
    return content.getvalue()


def draw_suggestion(answer: Suggestion) -> Figure:
    """Energy with level, candidates and the recommended pair; below it the motion after that pair."""
    tr = answer.recommended.tr if answer.recommended else None
    return _draw(answer.situation, answer.candidates, tr)


def draw_verdict(answer: Verdict) -> Figure:
    """Energy with level and the pair that was judged; below it the motion after that pair."""
    return _draw(answer.situation, (answer.candidate,), answer.candidate.tr)


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


def draw_study(answer: Study) -> Figure:
    """Energies of all runs over each other, the tr of each, the common one and td."""
    figure = Figure(figsize=(10, 5), layout="constrained")
    axes = figure.subplots()
    curves = [row.curve for row in answer.rows if row.curve is not None]
    alone = len(curves) == 1
    many = len(curves) > _FEW
    # as a whole they stay as dark as ten lines
    lines = LineCollection(
        [curve.T for curve in curves], colors=_REFERENCE, linewidths=1 if alone else 0.6,
        alpha=max(0.02, min(1.0, 10 / len(curves))) if curves else 1, rasterized=many,
        label="internal energy" if alone else f"internal energy of {len(curves)} runs",
    )  # fmt: skip
    axes.add_collection(lines)
    axes.autoscale_view()
    if answer.common.window:
        axes.axvspan(*answer.common.window, color=_GOOD, alpha=0.2, linewidth=0, label="acceptable in all runs")
    points = [(row.tr, row.energy_td) for row in answer.rows if row.tr is not None]
    if points:
        axes.scatter(
            *zip(*points, strict=True), s=8 if many else 28, linewidths=0.7, facecolors=_GOOD, edgecolors="white",
            zorder=3, label="tr of each run", rasterized=many,
        )  # fmt: skip
    _mark(axes, answer.common.tr, answer.td)
    levels = [energy for _, energy in points if energy is not None]
    highest = max((float(curve[1].max()) for curve in curves), default=0.0)
    if levels and min(levels) > 0 and highest > _LOGARITHMIC * max(levels):
        axes.set_yscale("log")
        axes.set_ylim(bottom=min(min(levels) / 2, float(np.median(levels)) / 10**_DECADES_BELOW_LEVEL))
    units = {row.time_unit for row in answer.rows if row.judged}
    unit = units.pop() if len(units) == 1 else ""
    axes.set(xlabel=f"time [{unit}]" if unit else "time", ylabel="internal energy")
    _finish(axes)
    return figure


def _draw(situation: Situation, candidates: tuple[Candidate, ...], tr: float | None) -> Figure:
    with_motion = tr is not None and situation.described(tr)
    figure = Figure(figsize=(10, 6.5 if with_motion else 4), layout="constrained")
    axes = figure.subplots(2 if with_motion else 1, 1, sharex=True, squeeze=False)[:, 0]
    _draw_energy(axes[0], situation, candidates, tr)
    if with_motion and tr is not None:
        _draw_motion(axes[1], situation, tr)
    unit = situation.history.time_unit
    axes[-1].set_xlabel(f"time [{unit}]" if unit else "time")
    for panel in axes:
        _finish(panel)
    return figure


def _draw_energy(axes: Axes, situation: Situation, candidates: tuple[Candidate, ...], tr: float | None) -> None:
    history, level, flight = situation.history, situation.energy_td, situation.flight
    if flight.start is not None:
        known = situation.span.end if situation.span else situation.td  # without a contact, as far as it was seen
        end = known if flight.end is None else flight.end
        axes.axvspan(flight.start, end, color=_FLIGHT, alpha=0.15, linewidth=0, label=f"flight ({flight.source})")
    axes.plot(history.time, history.energy, color=_REFERENCE, linewidth=1, label=history.channel)
    axes.axhline(level, color=_SWITCHED, linewidth=0.8, label=f"level at td, {level:.4g}")
    for acceptable, fill, name in ((True, _GOOD, "acceptable tr"), (False, "none", "other candidates")):
        some = [c for c in candidates if c.acceptable == acceptable]
        if some:
            times, energies = [c.tr for c in some], [c.energy for c in some]
            size = 28 if len(candidates) <= _FEW else 8
            axes.scatter(
                times, energies, s=size, linewidths=0.7, facecolors=fill, edgecolors=_GOOD, zorder=3, label=name
            )
    _mark(axes, tr, situation.td)
    if level > 0 and float(history.energy.max()) > _LOGARITHMIC * level:
        axes.set_yscale("log")
        axes.set_ylim(bottom=level / 10**_DECADES_BELOW_LEVEL)
    axes.set_ylabel("internal energy")


def _draw_motion(axes: Axes, situation: Situation, tr: float) -> None:
    mode, span, td = situation.mode, situation.span, situation.td
    assert mode is not None
    assert span is not None
    time = np.linspace(span.start, max(span.end, td), 2000)
    oscillator, start = from_mode(mode, span.start)
    replay = Replay(oscillator, start, span.start, tr, td)
    for states, colour, name in (
        (replay.reference(time), _REFERENCE, "without switching"),
        (replay.motion(time), _SWITCHED, "switched"),
    ):
        axes.plot(time, mode.preload + states.y - states.z, color=colour, linewidth=1, label=name)
    _mark(axes, tr, td)
    axes.set_ylabel("deformation [square root of energy]")


def _mark(axes: Axes, tr: float | None, td: float) -> None:
    """Mark the switch times; their labels stand above the axes, away from each other and from the curves."""
    for name, time, side in (("tr", tr, "right"), ("td", td, "left")):
        if time is not None:
            axes.axvline(time, color=_SWITCHED, linestyle="--", linewidth=0.8)
            axes.annotate(
                f" {name} = {time:.6g} ", (time, 1), xycoords=("data", "axes fraction"), xytext=(0, 3),
                textcoords="offset points", ha=side, fontsize="small", color=_SWITCHED,
            )  # fmt: skip


def _finish(axes: Axes) -> None:
    axes.grid(visible=True, linewidth=0.3)
    axes.margins(x=0)
    axes.legend(fontsize="small", loc="upper left", bbox_to_anchor=(1.0, 1.0))
