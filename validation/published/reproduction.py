"""The answer of ``reproduce`` as table, JSON, CSV, Markdown and HTML page."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final, NamedTuple

from d2rpick.base import __version__
from d2rpick.report import keys, page, tables
from d2rpick.report.fields import Document, Field, Kind, get_kind, many, one_of, row
from d2rpick.report.figures import render_svg_element
from d2rpick.report.page import (
    Markup,
    build_document,
    build_scrolling_table,
    build_section,
    make_element,
)
from validation.published.drawing import draw_exhibit
from validation.published.exhibits import IN_PART, NO, NOTHING, RUNS, VERDICTS, YES
from validation.published.values import (
    MISPRINTS,
    MOST_DIFFERENCE,
    PUBLISHED,
    compute_residual,
    find_pair_at_peak,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    from d2rpick.report.formats import DisplayOptions
    from validation.published.exhibits import Exhibit
    from validation.published.values import PublishedValue

MODEL = "k = 660e3 N/m, M = 31.4 kg, beta = 2, alpha = 50 1/s, V0 = 6 m/s"
_DECIMALS = 12
HEAD = (
    "quantity",
    "unit",
    "published",
    "reference",
    "here",
    "difference",
    "agrees",
    "source",
)


# Columns of the values of one figure, without their source: it stands once below them.
_VALUES: Final = HEAD[:-1]
# Heading of the published and of the better pair.
_PAIRS: Final = (
    "Switch times: the published pair, and the pair at the next peak of the energy"
)
# Section of the paper with the equations that have misprints, and the one that chooses the pair.
_EQUATIONS: Final = 2
_CHOICE: Final = 4
_OVERVIEW: Final = ("figure", "the paper shows", "agrees")


class Reproduction(NamedTuple):
    """Values and figures of the paper next to those found here, in its order; ``files`` were written."""

    rows: Sequence[PublishedValue]
    exhibits: Sequence[Exhibit]
    files: Sequence[str] = ()

    @property
    def misprints(self) -> Sequence[str]:
        """Misprints in the equations, if their section is asked for."""
        return MISPRINTS if self._has_section(_EQUATIONS) else ()

    @property
    def pairs(self) -> Sequence[str]:
        """How good the published and the better pair are, if the section that chooses them is asked for."""
        return describe_pairs() if self._has_section(_CHOICE) else ()

    def _has_section(self, section: int) -> bool:
        """Return True if figures of a section of the paper are in the answer."""
        return any(exhibit.section == section for exhibit in self.exhibits)

    def list_values(self, exhibit: Exhibit) -> Sequence[PublishedValue]:
        """Return the values that belong to a figure; with several pictures of it, those of the first."""
        place = (exhibit.section, exhibit.figure)
        first = next(
            other for other in self.exhibits if (other.section, other.figure) == place
        )
        return [row for row in self.rows if first is exhibit and row.place == place]


_PAIR: Final = Kind(
    row(
        keys.TR,
        keys.TD,
        Field("residual", "number", "residual computed in closed form"),
    ).schema,
    lambda pair: {"tr": pair[0], "td": pair[1], "residual": compute_residual(pair)},
    "pair",
)
_ROW: Final = row(
    Field("what", "text", "quantity"), Field("unit", "text", "unit of the quantity"),
    Field("published", "number?", "value in the paper; null if the paper gives none"),
    Field("reference", "number?", "reference value, computed in another way (see source)"),
    Field("here", "number", "computed value"),
    Field("difference", "number", "computed value minus published value; minus the reference value if nothing is "
                                  "published"),
    Field("tolerance", get_kind("number", minimum=0), "largest absolute difference at which the values agree"),
    Field("source", "text", "source of the published value or of the reference value"),
    Field("agrees", "flag", "true if the difference is within the tolerance"),
    Field("section", get_kind("integer", minimum=1, maximum=5), "section of the paper", later=True),
    Field("figure", "text", "number of the figure in the paper", later=True),
)  # fmt: skip
_FIGURE: Final = row(
    Field("name", "text", "name of the figure and of its file"), Field("title", "text", "title of the figure"),
    Field("section", get_kind("integer", minimum=1, maximum=5), "section of the paper"),
    Field("figure", "text", "number of the figure in the paper"),
    Field("paper", "text", "result in the paper"),
    Field("found", "text", "result computed here"),
    Field("agrees", "flag?", "true if the results agree; null if there is nothing to compare"),
    Field("verdict", one_of(*VERDICTS), "whether the results agree; in part: only roughly, or only some of them",
          later=True),
)  # fmt: skip
DOCUMENT: Final = Document(
    "d2rpick/reproduce/2",
    "Published and computed results of the floating oscillator; times of pairs in seconds.",
    row(
        keys.WARNINGS._replace(get=lambda _: ()),
        Field("rows", many(_ROW), "values of the paper, compared with computed values"),
        Field("published", _PAIR, "pair in the paper", lambda _: PUBLISHED),
        Field(
            "better",
            _PAIR,
            "pair whose td is the next energy peak after the published td",
            lambda _: find_pair_at_peak(),
        ),
        Field(
            "figures",
            many(_FIGURE),
            "figures of the paper, compared with computed figures",
            lambda answer: answer.exhibits,
        ),
        Field("misprints", "texts", "misprints in the equations of the paper"),
        Field("files", "texts", "files written"),
    ),
)


def as_table(answer: Reproduction, shown: DisplayOptions) -> str:
    """Each figure with its verdict; then, in the order of the paper, what it shows, what is found here, the values."""
    overview = [
        [name_place(exhibit), exhibit.paper, exhibit.verdict]
        for exhibit in answer.exhibits
    ]
    blocks = [tables.as_text(_OVERVIEW, overview, shown.width)]
    for exhibit in answer.exhibits:
        found, _, runs = exhibit.found.partition(f" {RUNS} ")
        lines = [
            f"{write_heading(exhibit)}: {exhibit.verdict}",
            f"  paper  {exhibit.paper}",
            f"  here   {found}",
            *([f"  runs   {runs}"] if runs else []),
        ]
        if rows := answer.list_values(exhibit):
            body = [list_cells(row)[:-1] for row in rows]
            lines += ["", tables.as_text(_VALUES, body, shown.width)]
            lines += [f"sources  {'; '.join(list_sources(rows))}"]
        blocks.append("\n".join(lines))
    if answer.pairs:
        blocks.append("\n".join([_PAIRS, *(f"  {pair}" for pair in answer.pairs)]))
    if answer.misprints:
        listed = (f"  {misprint}" for misprint in answer.misprints)
        blocks.append("\n".join(["misprints in the paper", *listed]))
    return tables.wrap_lines("\n\n".join(blocks), shown.width)


def as_markdown(
    answer: Reproduction, _: DisplayOptions, *, pictures: bool = False
) -> str:
    """Give the same as Markdown, with the figures if ``pictures`` are in the same folder."""
    overview = [
        [name_place(exhibit), exhibit.paper, exhibit.verdict]
        for exhibit in answer.exhibits
    ]
    blocks = [
        "# Analysis of switched-rigid floating oscillator, reproduced",
        f"{MODEL}; d2rpick {__version__}.",
        tables.as_markdown(_OVERVIEW, overview),
    ]
    for exhibit in answer.exhibits:
        picture = f"![{exhibit.title}]({exhibit.name}.svg)"
        blocks += [
            f"## {write_heading(exhibit)}",
            *((picture,) if pictures else ()),
            f"Paper: {exhibit.paper}",
            f"Here: {exhibit.found}",
            f"Agrees: {exhibit.verdict}.",
        ]
        if rows := answer.list_values(exhibit):
            blocks.append(tables.as_markdown(HEAD, [list_cells(row) for row in rows]))
    if answer.pairs:
        listed = "\n".join(f"* {pair}" for pair in answer.pairs)
        blocks += [f"## {_PAIRS}", listed]
    if answer.misprints:
        listed = "\n".join(f"* {misprint}" for misprint in answer.misprints)
        blocks += ["## Misprints in the paper", listed]
    return "\n\n".join(blocks)


def as_csv(answer: Reproduction, _: DisplayOptions) -> str:
    """Give the rows at full precision."""
    rows = answer.rows
    body: list[list[tables.Cell]]
    body = [
        [
            r.what,
            r.unit,
            r.published,
            r.reference,
            r.here,
            r.difference,
            r.agrees,
            r.source,
        ]
        for r in rows
    ]
    return tables.as_csv(HEAD, body).rstrip("\n")


def list_cells(row: PublishedValue) -> list[tables.Cell]:
    """Give a row in six digits, which are the same on every machine; the CSV file has all digits."""
    known = (
        None if value is None else f"{round(value, _DECIMALS):.6g}"
        for value in (row.published, row.reference)
    )
    here = f"{round(row.here, _DECIMALS):.6g}"
    difference = (
        "0"
        if abs(row.difference) < MOST_DIFFERENCE * abs(row.expected)
        else f"{row.difference:.1e}"
    )
    return [row.what, row.unit, *known, here, difference, row.agrees, row.source]


def name_place(exhibit: Exhibit) -> str:
    """Return the figure or the section of the paper."""
    is_section = exhibit.figure.startswith("section")
    return exhibit.figure if is_section else f"fig. {exhibit.figure}"


def write_heading(exhibit: Exhibit) -> str:
    """Give the figure of the paper and what it shows."""
    place = name_place(exhibit)
    return f"{place[0].upper()}{place[1:]}: {exhibit.title}"


def list_sources(rows: Sequence[PublishedValue]) -> list[str]:
    """Return the sources of some values, each once."""
    return [*dict.fromkeys(row.source for row in rows)]


def describe_pairs() -> list[str]:
    """Say how good the published and the better pair are."""
    return [
        f"{name} pair: tr = {1e3 * pair[0]:.6g} ms, td = {1e3 * pair[1]:.6g} ms, residual {compute_residual(pair):.3f}"
        for name, pair in (("published", PUBLISHED), ("better", find_pair_at_peak()))
    ]


def as_page(answer: Reproduction, command: Sequence[str]) -> str:
    """Write the page: every figure with what the paper shows, what is found here, and its values."""
    overview = [
        [name_place(exhibit), exhibit.paper, exhibit.verdict]
        for exhibit in answer.exhibits
    ]
    pairs = make_element("ul", *(make_element("li", text) for text in answer.pairs))
    misprints = make_element(
        "ul", *(make_element("li", text) for text in answer.misprints)
    )
    return build_document(
        "Analysis of switched-rigid floating oscillator, reproduced",
        make_element(
            "p",
            f"{MODEL}. The box is a model of our own; the paper states none of its figures.",
        ),
        build_section(
            "Overview",
            build_scrolling_table("Figures of the paper", _OVERVIEW, overview),
        ),
        *(_show_exhibit(exhibit, answer) for exhibit in answer.exhibits),
        build_section("Published and better pair", pairs) if answer.pairs else "",
        build_section("Misprints in the paper", misprints) if answer.misprints else "",
        page.build_command(command),
        signed=page.CHECKED,
    )


_CLASSES: Final = {YES: "good", IN_PART: "care", NO: "bad", NOTHING: "soft"}


def _show_exhibit(exhibit: Exhibit, answer: Reproduction) -> Markup:
    """Show a figure with the verdict on it and the values that belong to it."""
    drawing = Markup(render_svg_element(draw_exhibit(exhibit), f"{exhibit.name}-"))
    rows = [list_cells(row) for row in answer.list_values(exhibit)]
    verdict = make_element("span", exhibit.verdict, class_=_CLASSES[exhibit.verdict])
    return build_section(
        write_heading(exhibit),
        make_element(
            "figure", make_element("div", drawing, role="img", aria_label=exhibit.title)
        ),
        make_element("p", make_element("b", "Paper: "), exhibit.paper),
        make_element("p", make_element("b", "Here: "), exhibit.found),
        make_element("p", "Agrees: ", verdict),
        build_scrolling_table(f"Values of {name_place(exhibit)}", HEAD, rows)
        if rows
        else "",
    )
