"""Draw the sample models: the oscillator and the rollover box."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Polygon

from d2rpick.models.box_motion import CURB_THICKNESS, Sled
from d2rpick.report.figures import (
    BETTER,
    NEUTRAL,
    REFERENCE,
    RIGID_OPACITY,
    SWITCHED,
    format_axes,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.axes import Axes

    from d2rpick.choice.answers import PairSuggestion
    from d2rpick.models.box_model import Parameters
    from d2rpick.models.box_run import BoxWindow, Outcome, Record
    from d2rpick.vibration.oscillator import Replay, Trajectory


# Number of outlines that are drawn of the rolling box; it is small so that they can be told apart.
_OUTLINES = 8

_SLED_LENGTH: Final = 1.6
_SLED: Final = "#b0b8c0"  # Colour of the sled.
# Second quantity next to one in the colour of the reference run; both belong to one run.
_SECOND: Final = BETTER


def draw_replay(motion: Trajectory, switched: Replay | None) -> Figure:
    """Draw the displacements of both masses and the energies over time, with the rigid window shaded."""
    figure = Figure(figsize=(9, 6.5), layout="constrained")
    upper, lower = figure.subplots(2, 1, sharex=True)
    upper.plot(motion.time, motion.state.z, color=REFERENCE, label="z, frame")
    upper.plot(motion.time, motion.state.y, color=_SECOND, label="y, suspended mass")
    upper.set_ylabel("displacement")
    lower.plot(
        motion.time, motion.internal_energy, color=REFERENCE, label="internal energy"
    )
    lower.plot(
        motion.time, motion.kinetic_energy, color=_SECOND, label="kinetic energy"
    )
    lower.set(xlabel="time", ylabel="energy")
    for axes in (upper, lower):
        if switched:
            axes.axvspan(
                switched.tr,
                switched.td,
                color=NEUTRAL,
                alpha=RIGID_OPACITY,
                label="rigid",
                linewidth=0,
            )
        format_axes(axes)
    return figure


def draw_rollover(
    parameters: Parameters,
    reference: Record,
    switched: Record | None = None,
    windows: Sequence[BoxWindow] = (),
) -> Figure:
    """Draw outlines of the box at regular times with sled, curb and ground and, below, roll angle and height over time.

    ``switched`` is a run of the same box, rigid in ``windows``; if given, the difference of the two runs is drawn too.
    """
    if switched:
        rows = ["roll", "roll difference", "height", "height difference"]
    else:
        rows = ["roll", "height"]
    figure = Figure(figsize=(12, 8 if switched else 5.5), layout="constrained")
    grid = figure.subplot_mosaic(
        [["outlines", row] for row in rows], width_ratios=(1.4, 1)
    )
    _draw_outlines(grid["outlines"], parameters, reference, switched)
    time = reference.time
    runs = [(reference, REFERENCE, "-", "without switching")]
    runs += [(switched, SWITCHED, "--", "switched")] if switched else []
    for record, colour, style, name in runs:
        drawn: dict[str, Any] = {
            "color": colour,
            "linewidth": 1,
            "linestyle": style,
            "label": name,
        }
        grid["roll"].plot(time, np.degrees(record.roll), **drawn)
        grid["height"].plot(time, record.centre.imag, **drawn)
    if switched:
        deviation = np.degrees(switched.roll - reference.roll)
        grid["roll difference"].plot(time, deviation, color=SWITCHED, linewidth=1)
        deviation = 1e3 * (switched.centre - reference.centre).imag
        grid["height difference"].plot(time, deviation, color=SWITCHED, linewidth=1)
    units = {
        "roll": "roll [degrees]",
        "roll difference": "roll off by [degrees]",
        "height": "height [m]",
        "height difference": "height off by [mm]",
    }
    for row in rows:
        grid[row].set_ylabel(units[row])
        _draw_times(grid[row], reference, windows)
        format_axes(grid[row], legend=row in {"roll", "height"})
    grid[rows[-1]].set_xlabel("time [s]")
    return figure


def _draw_outlines(
    axes: Axes, parameters: Parameters, reference: Record, switched: Record | None
) -> None:
    """Draw labelled outlines of the box at regular times, the first and last position of the sled, and the ground."""
    drawn_states = (
        np.linspace(0, reference.time.size - 1, _OUTLINES).round().astype(int)
    )
    sled = Sled(parameters.speed, parameters.braking)
    for time in (0.0, float(reference.time[-1])):
        draw_sled(axes, parameters, sled.place(time))
    for record, colour, style in (
        (reference, REFERENCE, "-"),
        (switched, SWITCHED, "--"),
    ):
        if record:
            closed = np.column_stack(
                [record.outline[drawn_states], record.outline[drawn_states, 0]]
            ).T
            axes.plot(
                closed.real, closed.imag, color=colour, linewidth=0.9, linestyle=style
            )
    for state in drawn_states:
        centre = reference.centre[state]
        text = f"{1e3 * reference.time[state]:.0f}"
        axes.text(
            centre.real,
            centre.imag,
            text,
            fontsize="small",
            ha="center",
            va="center",
            color=NEUTRAL,
        )
    axes.set(aspect="equal", xlabel="x [m]", ylabel="z [m]")
    if parameters.drop is None:
        around = "; sled at start and end, curb, ground"
    else:
        around = "; ground"
    axes.set_title(f"box at the times named [ms]{around}", fontsize="medium")
    axes.grid(visible=True, linewidth=0.3)


def _draw_times(axes: Axes, reference: Record, windows: Sequence[BoxWindow]) -> None:
    """Shade the rigid windows; mark the end of the push by the sled and the start of the ground contact."""
    for number, window in enumerate(windows):
        label = "_" if number else "rigid"
        axes.axvspan(
            window.tr,
            window.td,
            color=NEUTRAL,
            alpha=RIGID_OPACITY,
            linewidth=0,
            label=label,
        )
    if reference.released is not None:
        axes.axvline(
            reference.released,
            color=NEUTRAL,
            linestyle="--",
            linewidth=1,
            label="sled pushed last",
        )
    for number, (start, _) in enumerate(reference.landings):
        label = "_" if number else "landing"
        axes.axvline(start, color=NEUTRAL, linestyle=":", linewidth=1, label=label)


def draw_scan(
    reference: Record, outcomes: Sequence[Outcome], answer: PairSuggestion
) -> Figure:
    """Draw the energy of the box with its level at td and, below, the errors of roll and mean energy for each tr."""
    figure = Figure(figsize=(9, 8), layout="constrained")
    energy, roll, mean = figure.subplots(3, 1, sharex=True)
    is_before_td = reference.time <= answer.situation.td
    internal = reference.internal_energy[is_before_td, 0]
    energy.plot(
        reference.time[is_before_td],
        internal,
        color=REFERENCE,
        linewidth=1,
        label="internal energy of the box",
    )
    energy.axhline(
        internal[-1],
        color=SWITCHED,
        linewidth=0.8,
        label=f"level at td, {internal[-1]:.4g}",
    )
    times = [outcome.tr for outcome in outcomes]
    roll.plot(
        times,
        [abs(outcome.roll_error) for outcome in outcomes],
        ".-",
        color=REFERENCE,
        label="roll error at td",
    )
    mean.plot(
        times,
        [outcome.mean_ratio - 1 for outcome in outcomes],
        ".-",
        color=REFERENCE,
        label="error of the mean energy",
    )
    mean.axhline(0, color=REFERENCE, linewidth=0.5)
    energy.set_ylabel("energy [J]")
    roll.set(ylabel="|roll error| [degrees]", yscale="log")
    mean.set(ylabel="mean energy after td,\nrelative error", xlabel="tr [s]")
    for axes in (energy, roll, mean):
        _mark_times_of_scan(axes, reference, answer)
        format_axes(axes)
    return figure


def _mark_times_of_scan(axes: Axes, reference: Record, answer: PairSuggestion) -> None:
    """Mark the time span in which the sled pushes the box, and the recommended tr."""
    if reference.released is not None:
        axes.axvspan(
            0,
            reference.released,
            color=NEUTRAL,
            alpha=RIGID_OPACITY,
            linewidth=0,
            label="the sled pushes",
        )
    if answer.recommended:
        axes.axvline(
            answer.recommended.tr,
            color=SWITCHED,
            linestyle="--",
            linewidth=1,
            label="recommended tr",
        )


def draw_sled(axes: Axes, parameters: Parameters, position: float) -> None:
    """Draw the ground, and the sled at ``position`` [m] with its floor, curb and cushion."""
    p = parameters
    axes.axhline(-p.ground, color=REFERENCE, linewidth=1.2)
    if p.drop is not None:
        return
    turn = np.exp(-1j * np.radians(p.tilt))
    for corners, colour in (
        (
            (
                -_SLED_LENGTH,
                CURB_THICKNESS,
                CURB_THICKNESS - 0.04j,
                -_SLED_LENGTH - 0.04j,
            ),
            _SLED,
        ),
        ((0.0, CURB_THICKNESS, CURB_THICKNESS + 1j * p.curb, 1j * p.curb), NEUTRAL),
    ):
        shape = position + np.array(corners) * turn
        axes.add_patch(
            Polygon(
                np.column_stack([shape.real, shape.imag]),
                closed=True,
                color=colour,
                alpha=0.6,
            )
        )
