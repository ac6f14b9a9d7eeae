"""Properties that all pictures share: size, colours, curves with few points, labels and files."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from d2rpick.report.figures import render
from tests.command import ROOT

if TYPE_CHECKING:
    from collections.abc import Iterable

    from matplotlib.axes import Axes
    from numpy.typing import ArrayLike

PLACE: Final = ROOT / "docs" / "pictures"
REFERENCE: Final = "#1f4e8c"
SWITCHED: Final = "#d1495b"
RIGID: Final = "#7fb685"
FLIGHT: Final = "#dbe9f6"
MUTED: Final = "#8a8f98"
WIDTH: Final = 7.5  # [inches]
POINTS: Final = 500  # largest number of points of a curve; a screen shows no more
# Text stays text, so that a file is small and can be searched.
STYLE: Final[Any] = {
    "svg.fonttype": "none",
    "font.family": "sans-serif",
    "font.sans-serif": ["DejaVu Sans", "Arial", "Helvetica"],
    "font.size": 9,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "path.simplify_threshold": 1.0,
}


def make_figure(height: float, rows: int = 1) -> tuple[Figure, list[Axes]]:
    """Make a figure of this height in inches with axes above each other that share their times."""
    with mpl.rc_context(STYLE):
        size = (WIDTH, height)
        figure = Figure(figsize=size, layout="constrained", facecolor="white")
        axes = figure.subplots(rows, 1, sharex=True, squeeze=False)
    return figure, [*axes[:, 0]]


def draw_curve(
    axes: Axes,
    x: ArrayLike,
    y: ArrayLike,
    color: str,
    label: str = "",
    style: str = "-",
) -> None:
    """Draw a curve with at most ``POINTS`` points, evenly spaced."""
    across, up = np.asarray(x, float), np.asarray(y, float)
    chosen = np.unique(np.linspace(0, across.size - 1, POINTS).astype(int))
    axes.plot(
        across[chosen],
        up[chosen],
        style,
        color=color,
        label=label or None,
        linewidth=1.4,
    )


def shade(
    axes: Axes, start: float, end: float, label: str, color: str = FLIGHT
) -> None:
    """Shade an interval of time and write its name at the top."""
    axes.axvspan(start, end, color=color, linewidth=0, zorder=0)
    axes.text(
        (start + end) / 2,
        0.97,
        label,
        transform=axes.get_xaxis_transform(),
        ha="center",
        va="top",
        color="#44505c",
    )


def mark_time(axes: Axes, time: float, label: str, height: float = 0.5) -> None:
    """Draw a dashed line at a time, with its name beside it."""
    axes.axvline(time, color="black", linewidth=0.8, linestyle="--")
    axes.text(
        time,
        height,
        f" {label}",
        transform=axes.get_xaxis_transform(),
        ha="left",
        va="center",
        bbox={"facecolor": "white", "edgecolor": "none", "pad": 1, "alpha": 0.8},
    )


def name_axes(axes: Axes, across: str, up: str) -> None:
    """Label the axes, with units."""
    axes.set_xlabel(across)
    axes.set_ylabel(up)


def show_names(axes: Axes, location: Any = "best") -> None:
    """Show the names of the curves."""
    axes.legend(loc=location, frameon=False, fontsize=8)


def drawn(figure: Figure, name: str) -> bytes:
    """Write a figure as the svg file with this name."""
    with mpl.rc_context(STYLE):
        return without_trailing_blanks(render(figure, f"{name}.svg"))


def write_figure(figure: Figure, name: str) -> None:
    """Write a figure as ``docs/pictures/NAME.svg``."""
    PLACE.mkdir(exist_ok=True)
    PLACE.joinpath(f"{name}.svg").write_bytes(drawn(figure, name))


def without_trailing_blanks(content: bytes) -> bytes:
    """Remove the spaces at the ends of lines, which matplotlib writes into paths."""
    lines: Iterable[bytes] = content.split(b"\n")
    return b"\n".join(line.rstrip() for line in lines)
