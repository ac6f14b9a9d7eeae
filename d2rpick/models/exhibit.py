"""What a figure of the models shows: panels, curves, and the columns that hold them."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from collections.abc import Mapping

    from d2rpick.histories.history import Samples
    from d2rpick.models.rollover.model import Plane


class Curve(NamedTuple):
    """A column as it is drawn: "line", "thin" or "dots"; over the column ``x``, over the first one without it."""

    label: str
    column: str
    style: str = "line"
    x: str | None = None


class Shape(NamedTuple):
    """Closed outlines in the plane (outlines, points) [m], drawn as "line" or "thin"."""

    label: str
    outlines: Plane
    style: str = "line"


@dataclass(frozen=True)
class Panel:
    """Curves with horizontal ``levels``, vertical ``marks``, the ``rigid`` window and single ``points`` (x, value).

    ``span`` is the range of x that is shown, all of it without one; ``shapes`` are drawn to scale.
    """

    title: str
    ylabel: str
    curves: tuple[Curve, ...] = ()
    rigid: tuple[float, float] | None = None
    levels: tuple[tuple[str, float], ...] = ()
    marks: tuple[tuple[str, float], ...] = ()
    points: tuple[tuple[float, float], ...] = ()
    shapes: tuple[Shape, ...] = ()
    xlabel: str = "time [ms]"
    span: tuple[float, float] | None = None


@dataclass(frozen=True, eq=False)
class Exhibit:
    """A figure and the columns it shows, the first of them the default x; panels row by row, none for a scheme.

    ``section`` and ``figure`` are those of the paper; ``paper`` is what it shows or claims there, ``found`` what is
    found here, ``agrees`` whether that is the same (None: there is nothing to compare).
    """

    name: str
    title: str
    section: int
    figure: str
    paper: str
    found: str
    agrees: bool | None = None
    columns: Mapping[str, Samples] = field(default_factory=dict)
    panels: tuple[tuple[Panel, ...], ...] = ()
