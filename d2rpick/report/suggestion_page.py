"""The answer of ``suggest`` as one HTML page to be read, printed and signed."""

from __future__ import annotations

from typing import TYPE_CHECKING

from d2rpick.report import page
from d2rpick.report.explorer import explorer
from d2rpick.report.html import Markup, drawings, pairs, remarks, section, table, tag
from d2rpick.report.suggestion import HEAD, better_about, headline, outlook, rows, verdict
from d2rpick.report.tables import known, measure

if TYPE_CHECKING:
    from collections.abc import Iterator

    from d2rpick.choice.suggest import Suggestion

# More rows than one compares by eye; csv and json hold all.
_MOST_ROWS = 20
# What is said of the pair beside its times.
_TOLD = ("quality", "keeps", "saves")


def drawn(answer: Suggestion) -> dict[str, str]:
    """Draw the figure of the page."""
    from d2rpick.report.figures_choice import draw_suggestion
    from d2rpick.report.figures_page import svg_element

    shown = "the choice, and a better pair" if answer.clearly_better else "and the choice"
    caption = f"Internal energy with its level at td, {shown}"
    return {caption: svg_element(draw_suggestion(answer, page=True), "choice-")}


def as_page(answer: Suggestion, record: page.PageContext) -> str:
    """Write the page."""
    return page.run_page(record.run, _sections(answer, record), record.explorer)


def _sections(answer: Suggestion, record: page.PageContext) -> Iterator[Markup]:
    yield choice(answer)
    if record.explorer:
        yield explorer(record.explorer)
    yield drawings(record.figures)
    yield from rest(answer, record)


def rest(answer: Suggestion, record: page.PageContext) -> Iterator[Markup]:
    """Give the sections below the figures."""
    yield section("Candidates", *_candidates(answer))
    yield page.parts(answer.chosen)
    yield from page.evidence(answer.situation, answer.health, record)
    if answer.recommended:
        yield page.solver_input((answer.recommended.tr, answer.recommended.td), record)


def choice(answer: Suggestion) -> Markup:
    """Give the section above the figures: the pairs, large, and what to know of them."""
    cards, better = [_recommended(answer)], answer.clearly_better
    if better:
        told, times = tag("p", better_about(answer, better)), (better.tr, better.td)
        cards.append(page.pair("Better pair: another td", times, told, answer.situation.history, "card"))
    return tag("section", tag("div", *cards, class_="choice"), remarks(answer.cautions), pairs(outlook(answer)))


def _recommended(answer: Suggestion) -> Markup:
    pair, quality = answer.recommended, answer.quality
    if pair is None or quality is None:
        nothing = tag("p", "No tr can be recommended for this td.")
        return tag("div", tag("h2", "Nothing recommended"), nothing, class_="card refused")
    wrong = [("residual", measure(pair.residual))] if pair.residual is not None else []
    told = pairs([*((name, text) for name, text in verdict(answer) if name in _TOLD), *wrong])
    class_ = "card refused" if quality.grade == "poor" else "card chosen"
    return page.pair(headline(answer).capitalize(), (pair.tr, pair.td), told, answer.situation.history, class_)


def _candidates(answer: Suggestion) -> Iterator[Markup]:
    if not answer.candidates:
        yield tag("p", "None.")
        return
    shown = answer.candidates[:_MOST_ROWS]
    marked = next((i for i, candidate in enumerate(shown) if candidate.recommended), None)
    head = [name.replace("+-", "±") for name in HEAD[1:]]
    yield table("Candidates", *known(head, [row[1:] for row in rows(answer, _MOST_ROWS)]), marked)
    left = len(answer.candidates) - len(shown)
    if left:
        yield tag("p", f"{left} more in the csv and json results.", class_="soft")
