"""Figures of pages: one width for every screen and for paper, with margins that are known, so that it is drawn once."""

from __future__ import annotations

import io
import re
from math import ceil
from typing import TYPE_CHECKING, Any, Final

import matplotlib as mpl
from matplotlib.backends.backend_svg import FigureCanvasSVG

from d2rpick.report.figures import any_letters, entries

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# Width [inch]: on a phone as wide as the screen its letters have about the size of those of the page, and a page that
# has more room makes them no larger than its own.
WIDTH: Final = 4.5
# Above the panels, for the labels of the switch times; between panels; on the right, for half a number; below, for
# numbers and name of the time axis; for a line of the legend; and beside the name of the other axis [inch].
_TOP, _BETWEEN, _RIGHT, _BELOW, _LINE, _EDGE = 0.3, 0.12, 0.2, 0.5, 0.19, 0.05
# Height of the letters of an axis' name [inch].
_NAME: Final = 0.16
_COLUMNS: Final = 2
# Numbers of the time axis, at most.
_NUMBERS: Final = 5


def arrange(figure: Figure, panels: Sequence[Axes], height: float) -> None:
    """Put panels of one ``height`` [inch] below each other, and one legend of all of them below the last.

    Margins are measured once, by the numbers of the vertical axes; an engine for layouts draws a figure three times.
    """
    FigureCanvasSVG(figure)
    known = entries(panels)
    foot = _BELOW + _LINE * ceil(len(known) / _COLUMNS)
    full = _TOP + len(panels) * height + (len(panels) - 1) * _BETWEEN + foot
    figure.set_size_inches(WIDTH, full)
    panels[-1].locator_params(axis="x", nbins=_NUMBERS)
    _place(panels, 0.15 * WIDTH, height, full)
    boxes = ((panel, panel.yaxis.get_tightbbox()) for panel in panels)
    left = max(panel.bbox.x0 - box.x0 for panel, box in boxes if box) / figure.dpi + _EDGE
    _place(panels, left, height, full)
    for panel in panels:
        panel.yaxis.set_label_coords((_EDGE + _NAME - left) / (WIDTH - left - _RIGHT), 0.5)
    figure.legend(
        known.values(), known, loc="lower left", ncols=_COLUMNS, fontsize="small", frameon=False, borderaxespad=0.1
    )


def _place(panels: Sequence[Axes], left: float, height: float, full: float) -> None:
    """Give each panel its place in a figure that is ``full`` high [inch]."""
    for place, panel in enumerate(panels):
        bottom = full - _TOP - (place + 1) * height - place * _BETWEEN
        panel.set_position((left / WIDTH, bottom / full, 1 - (left + _RIGHT) / WIDTH, height / full))


def svg_element(figure: Figure, prefix: str) -> str:
    """Turn a figure into an SVG element for a page, whose ids all begin with ``prefix``; letters stay letters.

    It has no style sheet of its own: that of the page holds what matplotlib writes into it.
    """
    content = io.StringIO()
    nothing = dict.fromkeys(("Creator", "Date", "Format", "Type"))
    with mpl.rc_context({"svg.fonttype": "none", "svg.hashsalt": prefix}), any_letters():
        canvas: Any = FigureCanvasSVG(figure)
        canvas.print_svg(content, metadata=nothing)  # `Figure.savefig` draws it twice
    element = content.getvalue()
    element = element[element.index("<svg") :]
    element = re.sub(r' (?:width|height)="[\d.]+pt"', "", element, count=2)  # the page says how wide
    # a hundredth of a point is finer than any screen
    element = re.sub(r'(?<= d=")[^"]*', lambda path: re.sub(r"(\.\d\d)\d+", r"\1", path[0]), element)
    element = re.sub(r"<style.*?</style>", "", element, flags=re.DOTALL)
    return re.sub(r'(?<= id=")|(?<=href="#)|(?<=url\(#)', prefix, element)
