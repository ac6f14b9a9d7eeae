"""The answer of ``explore`` as one HTML page to be read, printed and signed."""

from __future__ import annotations

from typing import TYPE_CHECKING

from d2rpick.report import page, suggestion_page
from d2rpick.report.explorer import explorer
from d2rpick.report.html import drawings, remarks, section, table, tag
from d2rpick.report.tables import known
from d2rpick.report.trade_off import HEAD, answer, rows, some_of

if TYPE_CHECKING:
    from collections.abc import Iterator

    from d2rpick.choice.trade_off import TradeOff
    from d2rpick.report.html import Markup

# More rows than one compares by eye.
_MOST_ROWS = 20


def drawn(found: TradeOff) -> dict[str, str]:
    """Draw the figures of the page."""
    from d2rpick.report.figures_page import svg_element
    from d2rpick.report.figures_trade_off import draw_trade_off

    curve = svg_element(draw_trade_off(found, page=True), "explore-")
    return {**suggestion_page.drawn(found.suggestion), "Error and rigid time of the best pair for each td": curve}


def as_page(found: TradeOff, record: page.PageContext) -> str:
    """Write the page."""
    return page.run_page(record.run, _sections(found, record), record.explorer)


def _sections(found: TradeOff, record: page.PageContext) -> Iterator[Markup]:
    yield suggestion_page.choice(found.suggestion)
    further = [one for one in found.cautions if one not in found.suggestion.cautions]
    yield tag("section", tag("p", answer(found)), remarks(further))
    if record.explorer:
        yield explorer(record.explorer)
    yield drawings(record.figures)
    best = some_of(found, _MOST_ROWS)
    marked = next((i for i, one in enumerate(best) if one.recommended), None)
    shown = table("Pairs", *known(HEAD[1:], [row[1:] for row in rows(best)]), marked)
    left = len(found.offers) - len(best)
    yield section(
        "Pairs that nothing beats", shown, tag("p", f"{left} more td in the csv and json results.", class_="soft")
    )
    yield from suggestion_page.rest(found.suggestion, record)
