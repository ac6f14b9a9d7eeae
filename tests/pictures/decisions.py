"""Pictures of decisions: the cost of another td, the saving, when to stop, and how often to write."""

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
    name_axes,
    show_names,
)
from tests.pictures.runs import oscillator, sample_oscillator, validated

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def trade_off() -> Figure:
    """Draw the residual of the best pair of each td against its rigid time."""
    figure, (axes,) = make_figure(3.4)
    exploration = d2.explore(
        sample_oscillator(), td=0.064, td_window=(0.055, 0.08)
    ).to_frame()
    for chosen, color, name in (
        (
            ~exploration["unbeaten"].astype(bool),
            MUTED,
            "another td is at least as good in both",
        ),
        (
            exploration["unbeaten"].astype(bool),
            REFERENCE,
            "no other td is as good in both",
        ),
    ):
        rows = exploration[chosen]
        axes.plot(
            rows["rigid_time"] * 1e3,
            rows["residual"],
            ".",
            color=color,
            label=name,
            markersize=5,
        )
    offer_of_td = exploration.iloc[(exploration["td"] - 0.064).abs().argmin()]
    axes.annotate(
        "td = 64 ms",
        (offer_of_td["rigid_time"] * 1e3, offer_of_td["residual"]),
        (0.5, 0.55),
        textcoords="axes fraction",
        arrowprops={"arrowstyle": "->"},
    )
    axes.axhspan(0, 0.2, color=RIGID, alpha=0.3, linewidth=0)
    axes.text(0.02, 0.1, "good", transform=axes.get_yaxis_transform(), va="center")
    name_axes(axes, "rigid time [ms]", "residual R")
    axes.set_ylim(0, 1.35)
    show_names(axes, "upper left")
    return figure


def saving() -> Figure:
    """Draw the CPU time of a switched run against the rigid fraction, by the cost model."""
    figure, (axes,) = make_figure(3.2)
    rigid = np.linspace(0, 1, 50)
    for share, ratio, color, style in (
        (0.6, 1.0, MUTED, "-"),
        (0.9, 1.0, REFERENCE, "-"),
        (0.9, 3.0, REFERENCE, "--"),
    ):
        time = 1 - rigid * (1 - (1 - share) / ratio)
        name = (
            f"parts take {share:.0%} of the CPU time; time step × {ratio:g} while rigid"
        )
        draw_curve(axes, rigid * 100, time * 100, color, name, style)
    axes.set(xlim=(0, 100), ylim=(0, 100))
    name_axes(axes, "rigid fraction of the simulated time [%]", "CPU time [%]")
    show_names(axes, "lower left")
    return figure


def sampling() -> Figure:
    """Draw an energy that is written often enough, and one that is written too seldom."""
    figure, panels = make_figure(4.0, rows=2)
    energy = oscillator()["internal_energy"].iloc[: 600 + 1]
    for axes, stride, text in (
        (panels[0], 10, "a state every 1 ms: 12 for each period of the energy"),
        (panels[1], 100, "a state every 10 ms: the peaks are lost"),
    ):
        draw_curve(axes, energy.index * 1e3, energy, MUTED, "energy")
        coarse = energy.iloc[::stride]
        axes.plot(
            coarse.index * 1e3, coarse, ".-", color=REFERENCE, label="output states"
        )
        axes.set_title(text, fontsize=9)
        axes.set(ylim=(0, None), xlim=(0, 60))
        name_axes(axes, "", "energy [J]")
    panels[1].set_xlabel("time [ms]")
    show_names(panels[0], "upper right")
    return figure


def landings() -> Figure:
    """Draw by how much td lies before the landing of the switched run, for plans in steps and at once."""
    figure, (axes,) = make_figure(3.2)
    for row_number, (name, label, color) in enumerate(
        (
            ("drop_plans_at_once", "all windows\nfrom one run", SWITCHED),
            ("drop_plans", "window by\nwindow", RIGID),
        )
    ):
        table = validated(name)
        time_before_landing = (table["landing_s"] - table["td_s"]) * 1e3
        spread = np.linspace(-0.2, 0.2, len(time_before_landing))
        axes.plot(
            time_before_landing, row_number + spread, "o", color=color, markersize=5
        )
        axes.text(-77, row_number, label, va="center", ha="right")
    axes.axvline(0, color="black", linewidth=0.8)
    axes.text(-1, 1.42, "rigid in the contact", ha="right", va="center")
    axes.text(1, 1.42, "deformable before the contact", ha="left", va="center")
    axes.set(xlim=(-75, 75), ylim=(-0.5, 1.6), yticks=[])
    axes.spines["left"].set_visible(False)
    name_axes(axes, "time from td to the landing of the switched run [ms]", "")
    return figure


def worth() -> Figure:
    """Draw how much a vibration error matters at the next contact."""
    figure, (axes,) = make_figure(3.0)
    share = np.logspace(-4, -0.4, 60)
    for factor, name, color in (
        (0.31, "total energy", REFERENCE),
        (0.52, "peak of the total energy", MUTED),
        (1.6, "energy of a single part", SWITCHED),
    ):
        draw_curve(axes, share * 100, factor * np.sqrt(share) * 100, color, name)
    for limit, name in ((1, "good"), (5, "fair")):
        axes.axvline(limit, color="black", linewidth=0.8, linestyle=":")
        axes.text(limit, 105, name, ha="center")
    axes.set(xscale="log", xlim=(0.01, 40), ylim=(0, 100))
    axes.xaxis.set_major_formatter("{x:g}")
    name_axes(
        axes,
        "energy of the vibration error / energy of the contact [%]",
        "largest difference [%]",
    )
    show_names(axes, "upper left")
    return figure
