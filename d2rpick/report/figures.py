"""How every figure is drawn and rendered, in files and on pages: colours, sizes, marks, and what is in sight."""

from __future__ import annotations

import io
import re
import warnings
from contextlib import contextmanager
from math import ceil
from pathlib import PurePath
from typing import TYPE_CHECKING, Any, Final

import matplotlib as mpl
from matplotlib import figure as figures
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.ticker import LogFormatter, NullLocator

from d2rpick.base.errors import FormatError

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from matplotlib.artist import Artist
    from matplotlib.axes import Axes

    from d2rpick.report.view import Scale


FORMATS = ("png", "svg", "pdf")
# Okabe and Ito's palette: told apart with any colour vision.
REFERENCE, SWITCHED, GOOD, FLIGHT, BETTER = (
    "#000000",
    "#d55e00",
    "#009e73",
    "#56b4e9",
    "#0072b2",
)
# Width of a figure that is written to a file [inch].
WIDTH: Final = 10.0
# Share of the axes that the label of a switch time takes up, at most: in a file and on a page.
LABEL: Final = {False: 0.14, True: 0.28}
# From this ratio on a logarithmic axis has marks enough without those between powers of ten, each of which costs time.
_DECADES: Final = 100.0
# Stretches of a curve, each with its lowest and highest value: as many as paper and screen tell apart.
STRETCHES: Final = 400
# Of a name from a file, what fits into a legend; in full it stands in the result.
_LONGEST_NAME = 28

# Width [inch]: on a phone as wide as the screen its letters have about the size of those of the page, and a page that
# has more room makes them no larger than its own.
PAGE_WIDTH: Final = 4.5
# Above the panels, for the labels of the switch times; between panels; on the right, for half a number; below, for
# numbers and name of the time axis; for a line of the legend; and beside the name of the other axis [inch].
_TOP, _BETWEEN, _RIGHT, _BELOW, _LINE, _EDGE = 0.3, 0.12, 0.2, 0.5, 0.19, 0.05
# Height of the letters of an axis' name [inch].
_NAME: Final = 0.16
_COLUMNS: Final = 2
# Numbers of the time axis, at most.
_NUMBERS: Final = 5


class Figure(figures.Figure):
    """A figure that a notebook shows, whatever its backend is."""

    def _repr_png_(self) -> bytes:
        return render(self, "figure.png")


def begin(count: int, height: float, *, page: bool) -> tuple[Figure, list[Axes]]:
    """Begin a figure of axes below each other that share their times; ``height`` is that of it in a file [inch]."""
    figure = Figure(figsize=(WIDTH, height), layout=None if page else "constrained")
    return figure, list(figure.subplots(count, 1, sharex=True, squeeze=False)[:, 0])


def shade(
    axes: Axes,
    span: Sequence[float],
    label: str,
    colour: str = FLIGHT,
    alpha: float = 0.15,
) -> None:
    """Shade a span of times, a flight if nothing else is said."""
    axes.axvspan(*span, color=colour, alpha=alpha, linewidth=0, label=label)


def note(
    axes: Axes,
    text: str,
    place: tuple[float, float],
    offset: tuple[float, float],
    **look: Any,
) -> None:
    """Write at a place, its height a share of the axes, ``offset`` by some points; by default at a time."""
    look = {"xycoords": ("data", "axes fraction"), "fontsize": "small", **look}
    axes.annotate(text, place, xytext=offset, textcoords="offset points", **look)


def picture_format(name: str) -> str:
    """Tell the format that the suffix of ``name`` asks for; FormatError unless it is png, svg or pdf."""
    form = PurePath(name).suffix.lower().lstrip(".")
    if form not in FORMATS:
        raise FormatError(
            f"{name}: plots are written as {', '.join(FORMATS)}; give the file such a suffix"
        )
    return form


def render(figure: figures.Figure, name: str) -> bytes:
    """Turn a figure into the bytes of the file ``name``, in the format that its suffix asks for, always the same."""
    content = io.BytesIO()
    form = picture_format(name)
    undated = {"svg": {"Date": None}, "pdf": {"CreationDate": None}}.get(form)
    with mpl.rc_context({"svg.hashsalt": "d2rpick"}), any_letters():
        figure.savefig(content, format=form, dpi=150, metadata=undated)
    return content.getvalue()


@contextmanager
def any_letters() -> Iterator[None]:
    """Let letters of a name that the font lacks be boxes, without a warning."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", r"Glyph \d+ .* missing from", UserWarning)
        yield


def make_logarithmic(axes: Axes, low: float, high: float) -> None:
    """Make the vertical axis logarithmic, with plain numbers: typesetting powers takes a third of a figure's time."""
    axes.set_yscale("log")
    axes.yaxis.set_major_formatter("{x:g}")
    if high > _DECADES * low:
        axes.yaxis.set_minor_locator(NullLocator())
    else:
        axes.yaxis.set_minor_formatter(LogFormatter())


def show_span(
    axes: Axes,
    span: tuple[float, float],
    scale: Scale,
    above: Sequence[tuple[str, float]],
) -> None:
    """Show of a curve the times in ``span``; what is higher than the scale is cut, with a mark.

    Parameters
    ----------
    axes : Axes
    span : (float, float)
        First and last time in sight [time].
    scale : Scale
    above : sequence of (str, float)
        What stands high in the span, and how high: a mark names it where it is cut.
    """
    axes.set_xlim(*span)
    if scale.logarithmic:
        make_logarithmic(axes, scale.low, scale.high)
    axes.set_ylim(scale.low, scale.high)
    for what, highest in above:
        if highest <= scale.high:
            continue
        early = what == "load"  # it stands on the left, a landing on the right
        note(
            axes, f"{what}, up to {highest:.4g} \N{UPWARDS ARROW}", (0 if early else 1, 1), (6 if early else -6, -6),
            xycoords="axes fraction", ha="left" if early else "right", va="top",
            bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 1},
        )  # fmt: skip


def mark_times(
    panels: Sequence[Axes], tr: float | None, td: float | None, *, page: bool
) -> None:
    """Mark the switch times; their labels stand above the first axes, away from each other and from the edges.

    Where a label would reach over an edge it changes its side if there is room.
    """
    width, (low, high) = LABEL[page], panels[0].get_xlim()
    places = [
        None if time is None else (time - low) / (high - low) for time in (tr, td)
    ]
    room = 1.0 if places[0] is None or places[1] is None else places[1] - places[0]
    sides = ["right", "left"]
    if places[0] is not None and places[0] < width < room:
        sides[0] = "left"
    if (
        places[1] is not None
        and places[1] > 1 - width
        and room > width * (1 + (sides[0] == "left"))
    ):
        sides[1] = "right"
    for name, time, side in zip(("tr", "td"), (tr, td), sides, strict=True):
        if time is not None:
            for axes in panels:
                axes.axvline(time, color=SWITCHED, linestyle="--", linewidth=0.8)
            note(
                panels[0],
                f" {name} = {time:.6g} ",
                (time, 1),
                (0, 3),
                ha=side,
                color=SWITCHED,
            )


def finish(axes: Axes, *, legend: bool = True) -> None:
    """Draw the grid, keep the time axis tight, and put the legend beside the axes.

    A power of ten of the numbers stands above them, clear of the labels of the switch times.
    """
    axes.grid(visible=True, linewidth=0.3)
    axes.yaxis.get_offset_text().set_horizontalalignment("right")
    axes.margins(x=0)
    if legend:
        axes.legend(fontsize="small", loc="upper left", bbox_to_anchor=(1.0, 1.0))


def _entries(panels: Sequence[Axes]) -> dict[str, Artist]:
    """What a legend of several panels names, each thing once."""
    known = (zip(*panel.get_legend_handles_labels(), strict=True) for panel in panels)
    return {name: handle for pairs in known for handle, name in pairs}


def legend_below(
    figure: figures.Figure,
    panels: Sequence[Axes],
    columns: int = 4,
    size: str | None = "small",
) -> None:
    """Put one legend of all panels below them."""
    if known := _entries(panels):
        figure.legend(
            known.values(),
            known,
            loc="outside lower left",
            ncols=columns,
            fontsize=size,
            frameon=False,
        )


def with_unit(name: str, unit: str) -> str:
    """Label an axis, with the unit where a file names one."""
    return f"{name} [{plain(unit)}]" if unit else name


def plain(name: str) -> str:
    """Keep a name from a file from being read as a formula, or, with an underscore in front, as one to be hidden.

    It is cut where it is too long, and what cannot be printed becomes a question mark.
    """
    shown = "".join(letter if letter.isprintable() else "?" for letter in name)
    shown = shown if len(shown) <= _LONGEST_NAME else f"{shown[: _LONGEST_NAME - 1]}…"
    return f"{' ' if shown.startswith('_') else ''}{shown}".replace("$", r"\$")


def arrange(figure: figures.Figure, panels: Sequence[Axes], height: float) -> None:
    """Put panels of one ``height`` [inch] below each other, and one legend of all of them below the last.

    Margins are measured once, by the numbers of the vertical axes; an engine for layouts draws a figure three times.
    """
    FigureCanvasSVG(figure)
    known = _entries(panels)
    foot = _BELOW + _LINE * ceil(len(known) / _COLUMNS)
    full = _TOP + len(panels) * height + (len(panels) - 1) * _BETWEEN + foot
    figure.set_size_inches(PAGE_WIDTH, full)
    panels[-1].locator_params(axis="x", nbins=_NUMBERS)
    _place(panels, 0.15 * PAGE_WIDTH, height, full)
    boxes = ((panel, panel.yaxis.get_tightbbox()) for panel in panels)
    left = (
        max(panel.bbox.x0 - box.x0 for panel, box in boxes if box) / figure.dpi + _EDGE
    )
    _place(panels, left, height, full)
    for panel in panels:
        panel.yaxis.set_label_coords(
            (_EDGE + _NAME - left) / (PAGE_WIDTH - left - _RIGHT), 0.5
        )
    figure.legend(
        known.values(),
        known,
        loc="lower left",
        ncols=_COLUMNS,
        fontsize="small",
        frameon=False,
        borderaxespad=0.1,
    )


def _place(panels: Sequence[Axes], left: float, height: float, full: float) -> None:
    """Give each panel its place in a figure that is ``full`` high [inch]."""
    for place, panel in enumerate(panels):
        bottom = full - _TOP - (place + 1) * height - place * _BETWEEN
        panel.set_position(
            (
                left / PAGE_WIDTH,
                bottom / full,
                1 - (left + _RIGHT) / PAGE_WIDTH,
                height / full,
            )
        )


def svg_element(figure: figures.Figure, prefix: str) -> str:
    """Turn a figure into an SVG element for a page, whose ids all begin with ``prefix``; letters stay letters.

    It has no style sheet of its own: that of the page holds what matplotlib writes into it.
    """
    content = io.StringIO()
    nothing = dict.fromkeys(("Creator", "Date", "Format", "Type"))
    with (
        mpl.rc_context({"svg.fonttype": "none", "svg.hashsalt": prefix}),
        any_letters(),
    ):
        canvas: Any = FigureCanvasSVG(figure)
        canvas.print_svg(content, metadata=nothing)  # `Figure.savefig` draws it twice
    element = content.getvalue()
    element = element[element.index("<svg") :]
    element = re.sub(
        r' (?:width|height)="[\d.]+pt"', "", element, count=2
    )  # the page says how wide
    # a hundredth of a point is finer than any screen
    element = re.sub(
        r'(?<= d=")[^"]*', lambda path: re.sub(r"(\.\d\d)\d+", r"\1", path[0]), element
    )
    element = re.sub(r"<style.*?</style>", "", element, flags=re.DOTALL)
    return re.sub(r'(?<= id=")|(?<=href="#)|(?<=url\(#)', prefix, element)
