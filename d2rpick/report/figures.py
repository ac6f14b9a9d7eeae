"""Style and render all figures, for files and pages: colours, sizes, marks, and the visible range."""

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
# Meaning of the colours in all figures, and on the pages: black is the reference run, orange the switched run with tr,
# td and the level at td, light blue a flight, blue another pair, and grey what has no verdict, e.g. rigid windows and
# admissible times. Green, yellow and red stand only for verdicts.
# Palette of Okabe and Ito, whose colours remain distinguishable to colour-blind readers.
REFERENCE, SWITCHED, GOOD, FLIGHT, BETTER = (
    "#000000",
    "#d55e00",
    "#009e73",
    "#56b4e9",
    "#0072b2",
)
NEUTRAL: Final = "#595959"
BAD: Final = "#b3261e"
# Opacity of rigid windows that are shaded over the whole height of the axes [-].
RIGID_OPACITY: Final = 0.2
# Width of a figure in a file [inch].
WIDTH: Final = 10.0
# Largest width of the label of a switch time, as a fraction of the axes [-]; the key is True for a page.
LABEL: Final = {False: 0.14, True: 0.28}
# A logarithmic axis with a ratio of largest to smallest value above this has marks only at powers of ten [-].
_DECADES: Final = 100.0
# Number of intervals into which a curve is divided; in each, only the lowest and highest value are drawn.
STRETCHES: Final = 400
# Largest number of letters in a legend name; longer names from files are shortened.
_LONGEST_NAME = 28

# Width of a figure on a page [inch], at which its letters are as large as the text on a phone.
PAGE_WIDTH: Final = 4.5
# _TOP: space above the panels for the labels of the switch times [inch].
# _BETWEEN: space between two panels [inch].
# _RIGHT: space to the right of the panels, which is needed for half of the last number on the time axis [inch].
# _BELOW: space below the panels for the time axis [inch].
# _LINE: height of a legend line [inch].
# _EDGE: horizontal space next to the label of the vertical axis [inch].
_TOP, _BETWEEN, _RIGHT, _BELOW, _LINE, _EDGE = 0.3, 0.12, 0.2, 0.5, 0.19, 0.05
# Height of the letters in an axis label [inch].
_NAME: Final = 0.16
_COLUMNS: Final = 2
# Largest number of labels on the time axis.
_NUMBERS: Final = 5


class Figure(figures.Figure):
    """A matplotlib figure that a notebook shows with any backend."""

    def _repr_png_(self) -> bytes:
        return render(self, "figure.png")


def begin(count: int, height: float, *, page: bool) -> tuple[Figure, list[Axes]]:
    """Create a figure whose axes are stacked and share the time axis; ``height`` is its height in a file [inch]."""
    figure = Figure(figsize=(WIDTH, height), layout=None if page else "constrained")
    return figure, list(figure.subplots(count, 1, sharex=True, squeeze=False)[:, 0])


def mark_span(
    axes: Axes,
    span: Sequence[float],
    label: str,
    colour: str = FLIGHT,
    alpha: float = 0.15,
) -> None:
    """Shade a time span, by default in the colour of a flight."""
    axes.axvspan(*span, color=colour, alpha=alpha, linewidth=0, label=label)


def note(
    axes: Axes,
    text: str,
    position: tuple[float, float],
    offset: tuple[float, float],
    **look: Any,
) -> None:
    """Write a string at ``position`` (time, height as a fraction of the axes), shifted by ``offset`` points."""
    look = {"xycoords": ("data", "axes fraction"), "fontsize": "small", **look}
    axes.annotate(text, position, xytext=offset, textcoords="offset points", **look)


def choose_picture_format(name: str) -> str:
    """Return the picture format for the suffix of ``name``; raise FormatError unless it is png, svg or pdf."""
    form = PurePath(name).suffix.lower().lstrip(".")
    if form not in FORMATS:
        raise FormatError(
            f"{name}: plots are written as {', '.join(FORMATS)}; give the file such a suffix"
        )
    return form


def render(figure: figures.Figure, name: str) -> bytes:
    """Return the content of the picture file ``name`` in the format of its suffix; equal figures give equal bytes."""
    content = io.BytesIO()
    form = choose_picture_format(name)
    undated = {"svg": {"Date": None}, "pdf": {"CreationDate": None}}.get(form)
    with mpl.rc_context({"svg.hashsalt": "d2rpick"}), ignore_missing_letters():
        figure.savefig(content, format=form, dpi=150, metadata=undated)
    return content.getvalue()


@contextmanager
def ignore_missing_letters() -> Iterator[None]:
    """Draw letters that the font lacks as boxes, and suppress the warning about these letters."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", r"Glyph \d+ .* missing from", UserWarning)
        yield


def make_logarithmic(axes: Axes, low: float, high: float) -> None:
    """Make the vertical axis logarithmic with plain numbers, because powers are slow to typeset."""
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
    """Plot a curve over ``span``, and mark where its values are clipped at the top of the scale.

    Parameters
    ----------
    axes : Axes
    span : (float, float)
        First and last visible time [time].
    scale : Scale
    above : sequence of (str, float)
        Name and height of each peak that is cut off; a mark names it.
    """
    axes.set_xlim(*span)
    if scale.logarithmic:
        make_logarithmic(axes, scale.low, scale.high)
    axes.set_ylim(scale.low, scale.high)
    for peak_name, highest in above:
        if highest <= scale.high:
            continue
        # The note on the load is on the left, and the note on the landing is on the right.
        early = peak_name == "load"
        note(
            axes,
            f"{peak_name}, up to {highest:.4g} \N{UPWARDS ARROW}",
            (0 if early else 1, 1),
            (6 if early else -6, -6),
            xycoords="axes fraction",
            ha="left" if early else "right",
            va="top",
            bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 1},
        )


def mark_times(
    panels: Sequence[Axes], tr: float | None, td: float | None, *, page: bool
) -> None:
    """Mark the switch times. Their labels are above the first axes and overlap neither each other nor the edges.

    A label that would cross an edge moves to the other side of its line if there is room.
    """
    width, (low, high) = LABEL[page], panels[0].get_xlim()
    positions = [
        None if time is None else (time - low) / (high - low) for time in (tr, td)
    ]
    room = (
        1.0
        if positions[0] is None or positions[1] is None
        else positions[1] - positions[0]
    )
    sides = ["right", "left"]
    if positions[0] is not None and positions[0] < width < room:
        sides[0] = "left"
    if (
        positions[1] is not None
        and positions[1] > 1 - width
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


def format_axes(axes: Axes, *, legend: bool = True) -> None:
    """Draw the grid, limit the time axis to the data, and place the legend next to the axes.

    The common power of ten is printed above the axes, where it does not touch the labels of the switch times.
    """
    axes.grid(visible=True, linewidth=0.3)
    axes.yaxis.get_offset_text().set_horizontalalignment("right")
    axes.margins(x=0)
    if legend:
        axes.legend(fontsize="small", loc="upper left", bbox_to_anchor=(1.0, 1.0))


def _collect_legend_entries(panels: Sequence[Axes]) -> dict[str, Artist]:
    """Return the legend entries of several panels, with each name only once."""
    panel_entries = (
        zip(*panel.get_legend_handles_labels(), strict=True) for panel in panels
    )
    return {name: handle for pairs in panel_entries for handle, name in pairs}


def add_legend_below(
    figure: figures.Figure,
    panels: Sequence[Axes],
    columns: int = 4,
    size: str | None = "small",
) -> None:
    """Place one legend for all panels below the panels."""
    if entries := _collect_legend_entries(panels):
        figure.legend(
            entries.values(),
            entries,
            loc="outside lower left",
            ncols=columns,
            fontsize=size,
            frameon=False,
        )


def add_unit(name: str, unit: str) -> str:
    """Return the label of a time axis, with the unit given in a file or else "units of the run"."""
    return f"{name} [{make_plain_text(unit)}]" if unit else f"{name} (unit of the run)"


def make_plain_text(name: str) -> str:
    """Return a name from a file as plain text for matplotlib.

    A name may otherwise be read as a formula, or be hidden if it begins with an underscore.  Long names are cut off;
    unprintable letters become question marks.
    """
    text = "".join(letter if letter.isprintable() else "?" for letter in name)
    text = text if len(text) <= _LONGEST_NAME else f"{text[: _LONGEST_NAME - 1]}…"
    return f"{' ' if text.startswith('_') else ''}{text}".replace("$", r"\$")


def place_panels(figure: figures.Figure, panels: Sequence[Axes], height: float) -> None:
    """Stack panels of one ``height`` [inch], with a common legend below the last panel.

    Margins are measured once, from the numbers on the vertical axes; a layout engine would draw the figure three times.
    """
    FigureCanvasSVG(figure)
    entries = _collect_legend_entries(panels)
    foot = _BELOW + _LINE * ceil(len(entries) / _COLUMNS)
    full = _TOP + len(panels) * height + (len(panels) - 1) * _BETWEEN + foot
    figure.set_size_inches(PAGE_WIDTH, full)
    panels[-1].locator_params(axis="x", nbins=_NUMBERS)
    _place(panels, 0.15 * PAGE_WIDTH, height, full)
    boxes = ((panel, panel.yaxis.get_tightbbox()) for panel in panels)
    left_margin = (
        max(panel.bbox.x0 - box.x0 for panel, box in boxes if box) / figure.dpi + _EDGE
    )
    _place(panels, left_margin, height, full)
    for panel in panels:
        panel.yaxis.set_label_coords(
            (_EDGE + _NAME - left_margin) / (PAGE_WIDTH - left_margin - _RIGHT), 0.5
        )
    figure.legend(
        entries.values(),
        entries,
        loc="lower left",
        ncols=_COLUMNS,
        fontsize="small",
        frameon=False,
        borderaxespad=0.1,
    )


def _place(
    panels: Sequence[Axes], left_margin: float, height: float, full: float
) -> None:
    """Place the panels in a figure of height ``full`` [inch]."""
    for index, panel in enumerate(panels):
        bottom = full - _TOP - (index + 1) * height - index * _BETWEEN
        panel.set_position(
            (
                left_margin / PAGE_WIDTH,
                bottom / full,
                1 - (left_margin + _RIGHT) / PAGE_WIDTH,
                height / full,
            )
        )


def render_svg_element(figure: figures.Figure, prefix: str) -> str:
    """Return a figure as an SVG element for a page, with ids that begin with ``prefix``. Text is not drawn as outlines.

    The element has no style sheet of its own: that of the page contains what matplotlib would write.
    """
    content = io.StringIO()
    nothing = dict.fromkeys(("Creator", "Date", "Format", "Type"))
    with (
        mpl.rc_context({"svg.fonttype": "none", "svg.hashsalt": prefix}),
        ignore_missing_letters(),
    ):
        canvas: Any = FigureCanvasSVG(figure)
        canvas.print_svg(
            content, metadata=nothing
        )  # This function avoids `Figure.savefig`, which draws a figure twice.
    element = content.getvalue()
    element = element[element.index("<svg") :]
    element = re.sub(
        r' (?:width|height)="[\d.]+pt"', "", element, count=2
    )  # The size is removed because the page sets it.
    # Coordinates are rounded to 0.01 points, which is finer than any screen.
    element = re.sub(
        r'(?<= d=")[^"]*', lambda path: re.sub(r"(\.\d\d)\d+", r"\1", path[0]), element
    )
    element = re.sub(r"<style.*?</style>", "", element, flags=re.DOTALL)
    return re.sub(r'(?<= id=")|(?<=href="#)|(?<=url\(#)', prefix, element)
