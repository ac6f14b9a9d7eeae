"""The published results as one HTML page, which needs nothing but itself."""

from __future__ import annotations

from typing import TYPE_CHECKING

from d2rpick.models.published import MISPRINTS
from d2rpick.report.figures_models import draw_exhibit
from d2rpick.report.figures_page import svg_element
from d2rpick.report.html import Markup, document, section, table, tag
from d2rpick.report.reproduction import HEAD, MODEL, cells, heading, pairs_of, verdict
from d2rpick.report.shell import shell_line

if TYPE_CHECKING:
    from collections.abc import Sequence

    from d2rpick.models.exhibit import Exhibit
    from d2rpick.models.published import PublishedValue


def as_page(rows: Sequence[PublishedValue], exhibits: Sequence[Exhibit], command: Sequence[str]) -> str:
    """Write the page: every figure with what the paper shows and what is found, then the table."""
    return document(
        "Analysis of switched-rigid floating oscillator, reproduced",
        tag("p", f"{MODEL}. The box is a model of our own; the paper states none of its figures."),
        *(_shown(one) for one in exhibits),
        section("Published and here", table("Published and here", HEAD, [cells(row) for row in rows])),
        tag("ul", *(tag("li", text) for text in pairs_of())),
        section("Misprints in the paper", tag("ul", *(tag("li", misprint) for misprint in MISPRINTS))),
        section("To repeat this", tag("pre", shell_line(command), class_="wrap")),
        signed=("checked by", "date", "signature"),
    )


def _shown(one: Exhibit) -> Markup:
    drawing = Markup(svg_element(draw_exhibit(one), f"{one.name}-"))
    class_ = {True: "good", False: "bad", None: "soft"}[one.agrees]
    return section(
        heading(one),
        tag("figure", tag("div", drawing, role="img", aria_label=one.title)),
        tag("p", tag("b", "Paper: "), one.paper),
        tag("p", tag("b", "Here: "), one.found),
        tag("p", "Agrees: ", tag("span", verdict(one), class_=class_)),
    )
