"""Pictures of the mechanics: flight, level, sign, kinetic fraction, place."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

import d2rpick as d2
from tests.pictures.drawing import (
    MUTED,
    REFERENCE,
    RIGID,
    SWITCHED,
    draw_curve,
    make_figure,
    mark_time,
    name_axes,
    shade,
    show_names,
)
from tests.pictures.runs import (
    deformation,
    fall,
    oscillator,
    sample_oscillator,
    sample_rollover,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_PEAK = 0.0687534  # [s] a td at a peak of the oscillator's energy
_SLOPE = 0.064  # [s] the published td, where nearly all energy is kinetic


def flight() -> Figure:
    """Draw load, flight, tr, td, margin and contact of the sample rollover."""
    figure, (energy, momentum) = make_figure(4.4, rows=2)
    table = sample_rollover()
    draw_curve(energy, table.index, table["internal_energy"], REFERENCE)
    draw_curve(momentum, table.index, table["momentum_x"] / 1e3, REFERENCE, "along x")
    draw_curve(momentum, table.index, table["momentum_z"] / 1e3, MUTED, "along z")
    for axes in (energy, momentum):
        shade(axes, 0.0, 0.0861, "", "#fbe6d4")
        shade(axes, 0.0861, 0.3793, "")
    energy.text(0.043, 350, "load", ha="center")
    energy.text(0.25, 350, "free flight", ha="center")
    momentum.text(0.25, 1.6, "x constant; z changes only due to gravity", ha="center")
    mark_time(energy, 0.1434, "tr", 0.85)
    energy.axvline(0.37, color="black", linestyle="--", linewidth=0.8)
    energy.text(0.365, 180, "td", ha="right")
    energy.annotate(
        "contact", (0.3793, 45), (0.395, 200), arrowprops={"arrowstyle": "->"}
    )
    energy.set_ylim(0, 420)
    name_axes(energy, "", "internal energy [J]")
    name_axes(momentum, "time [s]", "momentum [kN s]")
    show_names(momentum, "lower left")
    return figure


def level() -> Figure:
    """Draw the times at which the energy has its level at td."""
    figure, (axes,) = make_figure(3.2)
    energy = oscillator()["internal_energy"]
    draw_curve(axes, energy.index * 1e3, energy, REFERENCE)
    answer = d2.suggest(sample_oscillator(), td=_PEAK)
    at_td = float(np.interp(_PEAK, energy.index, energy))
    for candidate in answer.candidates:
        if candidate.tr < _PEAK - 1e-3:
            same = candidate.sign_match
            axes.plot(
                candidate.tr * 1e3,
                at_td,
                "o" if same else "x",
                color=RIGID if same else SWITCHED,
                markersize=7,
            )
    axes.plot([], [], "o", color=RIGID, label="same direction of deformation")
    axes.plot([], [], "x", color=SWITCHED, label="opposite direction")
    axes.axhline(at_td, color="black", linewidth=0.8, linestyle=":")
    axes.text(74, at_td + 0.5, "level E(td)")
    axes.set(ylim=(0, 30), xlim=(0, 85))
    mark_time(axes, _PEAK * 1e3, "td", 0.85)
    name_axes(axes, "time [ms]", "internal energy [J]")
    show_names(axes, "upper center")
    return figure


def sign() -> Figure:
    """Draw what returns after td from the same level, in the right and in the wrong direction."""
    figure, (axes,) = make_figure(3.2)
    draw_curve(
        axes,
        oscillator().index * 1e3,
        deformation(oscillator()),
        REFERENCE,
        "reference run",
    )
    for tr, color, name in (
        (0.0135867, RIGID, "tr with the same direction"),
        (0.0116095, SWITCHED, "tr with the opposite direction, same energy"),
    ):
        table = oscillator(tr, _PEAK)
        draw_curve(axes, table.index * 1e3, deformation(table), color, name, "--")
    axes.set(xlim=(5, 110), ylim=(-9, 9))
    mark_time(axes, _PEAK * 1e3, "td", 0.93)
    name_axes(axes, "time [ms]", "deformation [mm]")
    show_names(axes, "lower right")
    return figure


def kinetic_fraction() -> Figure:
    """Draw the vibration after a td at a peak of the energy, and after one where all energy is kinetic."""
    figure, panels = make_figure(4.4, rows=2)
    for axes, (tr, td, text) in zip(
        panels,
        (
            (0.0135867, _PEAK, "td at a peak of the energy: K = 0, nothing is lost"),
            (0.0128853, _SLOPE, "td between peaks: K = 0.92, the velocity is lost"),
        ),
        strict=True,
    ):
        draw_curve(
            axes,
            oscillator().index * 1e3,
            deformation(oscillator()),
            REFERENCE,
            "reference run",
        )
        table = oscillator(tr, td)
        draw_curve(
            axes, table.index * 1e3, deformation(table), SWITCHED, "switched run", "--"
        )
        axes.set(xlim=(50, 110), ylim=(-5, 5))
        axes.set_title(text, fontsize=9)
        mark_time(axes, td * 1e3, "td", 0.9)
        name_axes(axes, "", "deformation [mm]")
    panels[1].set_xlabel("time [ms]")
    show_names(panels[0], "lower right")
    return figure


def residual() -> Figure:
    """Draw the residual of each tr for one td, with the limits of the grades."""
    figure, (energy, error) = make_figure(4.4, rows=2)
    table = oscillator()
    stretch, square = deformation(table), table["internal_energy"]
    at_td = float(np.interp(_PEAK, table.index, stretch))
    before_peak = table.index < _PEAK
    draw_curve(energy, table.index * 1e3, square, REFERENCE)
    energy.set_ylim(0, 30)
    distance = (stretch[before_peak] - at_td).abs() / abs(at_td)
    draw_curve(error, table.index[before_peak] * 1e3, distance, REFERENCE)
    for limit, name in ((0.2, "good"), (0.5, "fair"), (1.0, "no vibration at all")):
        error.axhline(limit, color=MUTED, linewidth=0.8, linestyle=":")
        error.text(84, limit, name, ha="right", va="bottom", color=MUTED)
    error.set(ylim=(0, 3), xlim=(0, 85))
    for axes in (energy, error):
        mark_time(axes, _PEAK * 1e3, "td", 0.85)
        mark_time(axes, 13.5867, "recommended tr", 0.93)
    name_axes(energy, "", "internal energy [J]")
    name_axes(error, "time or tr [ms]", "residual R of tr")
    return figure


def out_of_place() -> Figure:
    """Draw a body whose engine moves on its mounts in flight, and the position of the body if both are frozen."""
    figure, (axes,) = make_figure(3.0)
    time = np.linspace(0, 100, 400)
    share, swing = (
        0.2,
        20.0,
    )  # mass fraction of the engine; its travel on the mounts [mm]
    travel = swing * np.cos(2 * np.pi * time / 80)
    body = -share * travel
    frozen = np.where(time < 20, body, body[np.searchsorted(time, 20)])
    draw_curve(axes, time, body, REFERENCE, "body in the reference run")
    draw_curve(axes, time, frozen, SWITCHED, "body in the switched run", "--")
    at_td = int(np.searchsorted(time, 85))
    axes.annotate(
        "",
        (85, body[at_td]),
        (85, frozen[at_td]),
        arrowprops={"arrowstyle": "<->", "shrinkA": 0, "shrinkB": 0},
    )
    axes.text(83.5, frozen[at_td] + 1.0, "position error", ha="right", va="center")
    mark_time(axes, 20, "tr", 0.93)
    mark_time(axes, 85, "td", 0.93)
    axes.set(xlim=(0, 100), ylim=(-6, 6))
    name_axes(axes, "time [ms]", "position relative to\ncentre of mass [mm]")
    show_names(axes, "lower left")
    return figure


def static_energy() -> Figure:
    """Draw an internal energy that is mostly plastic work, with the vibration above it."""
    figure, (axes,) = make_figure(3.0)
    energy = fall()["internal_energy"].loc[0.2:0.7]
    draw_curve(axes, energy.index, energy, REFERENCE)
    axes.axhspan(0, 3.4, xmin=0.2, color="#f3dfc1", linewidth=0)
    axes.text(0.5, 1.2, "plastic work: stays, does not vibrate", ha="center")
    axes.annotate(
        "elastic vibration", (0.45, 12), (0.5, 20), arrowprops={"arrowstyle": "->"}
    )
    axes.set(ylim=(0, 30), xlim=(0.2, 0.7))
    name_axes(axes, "time [s]", "internal energy of the box [J]")
    return figure
