"""The answer of ``suggest`` as one HTML page to be read, printed and signed."""

from __future__ import annotations

from typing import TYPE_CHECKING

from d2rpick.report import page
from d2rpick.report.html import Markup, drawings, pairs, remarks, section, table, tag
from d2rpick.report.suggestion import HEAD, headline, outlook, rows, verdict

if TYPE_CHECKING:
    from collections.abc import Iterator

    from d2rpick.choice.suggest import Pair, Suggestion

# More rows than one compares by eye; csv and json hold all.
_MOST_ROWS = 20


def drawn(answer: Suggestion) -> dict[str, tuple[str, str]]:
    """Draw the figures of the page, wide and narrow."""
    from d2rpick.report import figures

    found = {
        "Internal energy with its level at td, and the choice": figures.both_widths(
            figures.draw_suggestion, answer, "choice"
        )
    }
    if answer.clearly_better:
        found["The better pair"] = figures.both_widths(figures.draw_better, answer, "better")
    return found


def as_page(answer: Suggestion, record: page.Record) -> str:
    """Write the page."""
    return page.run_page(record.run, _sections(answer, record))


def _sections(answer: Suggestion, record: page.Record) -> Iterator[Markup]:
    yield choice(answer)
    yield drawings(record.figures)
    yield from rest(answer, record)


def rest(answer: Suggestion, record: page.Record) -> Iterator[Markup]:
    """Give the sections below the figures."""
    yield section("Candidates", *_candidates(answer))
    yield page.parts(answer.chosen)
    yield from page.evidence(answer.situation, answer.health, record)
    if answer.recommended:
        yield page.solver_input(answer.situation, (answer.recommended.tr, answer.recommended.td), record)


def choice(answer: Suggestion) -> Markup:
    """Give the section above the figures: the pairs, large, and what to know of them."""
    better = answer.clearly_better
    if answer.recommended:
        cards = [_pair(answer, headline(answer).capitalize(), answer.recommended, class_="card chosen")]
    else:
        nothing = tag("p", "No tr can be recommended for this td.")
        cards = [tag("div", tag("h2", "Nothing recommended"), nothing, class_="card refused")]
    if better:
        cards.append(_pair(answer, "Better pair: td at the nearest peak", better, class_="card"))
    return tag(
        "section",
        tag("div", *cards, class_="choice"),
        pairs((*verdict(answer)[1:], *outlook(answer))),
        remarks(answer.cautions),
    )


def _pair(answer: Suggestion, title: str, pair: Pair, class_: str) -> Markup:
    return page.pair(title, (pair.tr, pair.td), pair.residual, answer.situation.history, class_)


def _candidates(answer: Suggestion) -> Iterator[Markup]:
    if not answer.candidates:
        yield tag("p", "None.")
        return
    shown = answer.candidates[:_MOST_ROWS]
    marked = next((i for i, candidate in enumerate(shown) if candidate.recommended), None)
    head = [name.replace("+-", "±") for name in HEAD[1:]]
    yield table("Candidates", head, [row[1:] for row in rows(answer, _MOST_ROWS)], marked)
    left = len(answer.candidates) - len(shown)
    if left:
        yield tag("p", f"{left} more in the csv and json results.", class_="soft")
