"""The answer of ``reproduce`` as table, JSON, CSV, Markdown and HTML page."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final, NamedTuple

from d2rpick.base import __version__
from d2rpick.report import keys, page, tables
from d2rpick.report.fields import Document, Field, Kind, get_kind, many, row
from d2rpick.report.figures import render_svg_element
from d2rpick.report.page import (
    Markup,
    build_document,
    build_scrolling_table,
    build_section,
    make_element,
)
from validation.published.drawing import draw_exhibit
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


class Reproduction(NamedTuple):
    """Values and figures of the paper beside those found here; ``files`` were written."""

    rows: Sequence[PublishedValue]
    exhibits: Sequence[Exhibit]
    files: Sequence[str] = ()


_PAIR: Final = Kind(
    row(*(Field(key, "number") for key in ("tr", "td", "residual"))).schema,
    lambda pair: {"tr": pair[0], "td": pair[1], "residual": compute_residual(pair)},
    "pair",
)
_ROW: Final = row(
    Field("what", "text"), Field("unit", "text"),
    Field("published", "number?", "what the paper states; null where it states none"),
    Field("reference", "number?", "computed in another way, see source"),
    Field("here", "number"),
    Field("difference", "number", "here less published, or less reference where nothing is published"),
    Field("tolerance", get_kind("number", minimum=0)),
    Field("source", "text", "where the published number or the reference value is from"),
    Field("agrees", "flag", "the difference is within the tolerance"),
)  # fmt: skip
_FIGURE: Final = row(
    Field("name", "text"), Field("title", "text"), Field("section", get_kind("integer", minimum=1, maximum=5)),
    Field("figure", "text", "number in the paper"),
    Field("paper", "text", "what the paper shows"),
    Field("found", "text", "what is found here"),
    Field("agrees", "flag?", "null where there is nothing to compare"),
)  # fmt: skip
DOCUMENT: Final = Document(
    "d2rpick/reproduce/2",
    "Published results of the floating oscillator beside those found here; times of pairs in seconds.",
    row(
        keys.WARNINGS._replace(get=lambda _: ()),
        Field("rows", get_kind(many(_ROW), minItems=1)),
        Field("published", _PAIR, get=lambda _: PUBLISHED),
        Field("better", _PAIR, get=lambda _: find_pair_at_peak()),
        Field("figures", many(_FIGURE), get=lambda answer: answer.exhibits),
        Field("misprints", "texts", get=lambda _: MISPRINTS),
        Field("files", "texts"),
    ),
)


def as_table(answer: Reproduction, is_shown: DisplayOptions) -> str:
    """Published numbers and reference values beside those here, the pairs, the figures, the misprints."""
    rows, exhibits = answer[:2]
    lines = [
        tables.as_text(HEAD, [list_cells(row) for row in rows], is_shown.width),
        "",
        *describe_pairs(),
        "",
    ]
    for exhibit in exhibits:
        lines += [
            f"{write_heading(exhibit)}: {write_verdict(exhibit)}",
            f"  paper  {exhibit.paper}",
            f"  here   {exhibit.found}",
        ]
    lines += [
        "",
        "misprints in the paper",
        *(f"  {misprint}" for misprint in MISPRINTS),
    ]
    return tables.wrap_lines("\n".join(lines), is_shown.width)


def as_markdown(
    answer: Reproduction, _: DisplayOptions, *, pictures: bool = False
) -> str:
    """Give the same as Markdown, with the figures where ``pictures`` lie beside it."""
    rows, exhibits = answer[:2]
    blocks = [
        "# Analysis of switched-rigid floating oscillator, reproduced",
        f"{MODEL}; d2rpick {__version__}.",
    ]
    for exhibit in exhibits:
        picture_lines = [f"![{exhibit.title}]({exhibit.name}.svg)"] if pictures else []
        blocks += [
            f"## {write_heading(exhibit)}",
            *picture_lines,
            f"Paper: {exhibit.paper}",
            f"Here: {exhibit.found}",
            f"Agrees: {write_verdict(exhibit)}.",
        ]
    blocks += [
        "## Published and computed values",
        tables.as_markdown(HEAD, [list_cells(row) for row in rows]),
        *describe_pairs(),
    ]
    blocks += [
        "## Misprints in the paper",
        "\n".join(f"* {misprint}" for misprint in MISPRINTS),
    ]
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
    """Give a row in digits that are the same on every machine."""
    cell_texts = (
        None if value is None else f"{round(value, _DECIMALS):.12g}"
        for value in (row.published, row.reference)
    )
    our_value = f"{round(row.here, _DECIMALS):.12g}"
    difference = (
        "0"
        if abs(row.difference) < MOST_DIFFERENCE * abs(row.expected)
        else f"{row.difference:.1e}"
    )
    return [
        row.what,
        row.unit,
        *cell_texts,
        our_value,
        difference,
        row.agrees,
        row.source,
    ]


def write_heading(exhibit: Exhibit) -> str:
    """Give the figure of the paper and what it shows."""
    figure_label = (
        exhibit.figure
        if exhibit.figure.startswith("section")
        else f"fig. {exhibit.figure}"
    )
    return f"{figure_label[0].upper()}{figure_label[1:]}: {exhibit.title}"


def write_verdict(exhibit: Exhibit) -> str:
    """Say whether what is found is what the paper shows."""
    return {True: "yes", False: "no", None: "nothing to compare"}[exhibit.agrees]


def describe_pairs() -> list[str]:
    """Say how good the published and the better pair are."""
    return [
        f"{name} pair: tr = {1e3 * pair[0]:.6g} ms, td = {1e3 * pair[1]:.6g} ms, residual {compute_residual(pair):.3f}"
        for name, pair in (("published", PUBLISHED), ("better", find_pair_at_peak()))
    ]


def as_page(answer: Reproduction, command: Sequence[str]) -> str:
    """Write the page: every figure with what the paper shows and what is found, then the table."""
    published = build_scrolling_table(
        "Published and here", HEAD, [list_cells(row) for row in answer.rows]
    )
    return build_document(
        "Analysis of switched-rigid floating oscillator, reproduced",
        make_element(
            "p",
            f"{MODEL}. The box is a model of our own; the paper states none of its figures.",
        ),
        *(_write_exhibit(exhibit) for exhibit in answer.exhibits),
        build_section("Published and here", published),
        make_element("ul", *(make_element("li", text) for text in describe_pairs())),
        build_section(
            "Misprints in the paper",
            make_element(
                "ul", *(make_element("li", misprint) for misprint in MISPRINTS)
            ),
        ),
        page.build_command(command),
        signed=page.CHECKED,
    )


def _write_exhibit(exhibit: Exhibit) -> Markup:
    drawing = Markup(render_svg_element(draw_exhibit(exhibit), f"{exhibit.name}-"))
    class_ = {True: "good", False: "bad", None: "soft"}[exhibit.agrees]
    return build_section(
        write_heading(exhibit),
        make_element(
            "figure", make_element("div", drawing, role="img", aria_label=exhibit.title)
        ),
        make_element("p", make_element("b", "Paper: "), exhibit.paper),
        make_element("p", make_element("b", "Here: "), exhibit.found),
        make_element(
            "p", "Agrees: ", make_element("span", write_verdict(exhibit), class_=class_)
        ),
    )
