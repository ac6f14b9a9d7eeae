"""The answer of ``verify`` as one HTML page to be read, printed and signed."""

from __future__ import annotations

from typing import TYPE_CHECKING

from d2rpick.report import page
from d2rpick.report.explorer import explorer
from d2rpick.report.html import drawings, pairs, remarks, section, table, tag
from d2rpick.report.keys import of_verdict
from d2rpick.report.tables import measure, short
from d2rpick.report.verdict import COMPARED, comparison, deviations

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from d2rpick.choice.comparison import Comparison
    from d2rpick.choice.verify import Verdict
    from d2rpick.histories.source import Source
from d2rpick.report.html import Markup


def drawn(answer: Verdict) -> dict[str, str]:
    """Draw the figure of the page."""
    from d2rpick.report.figures_choice import draw_verdict
    from d2rpick.report.figures_page import svg_element

    caption = "Internal energy with its level at td, and the pair"
    return {caption: svg_element(draw_verdict(answer, page=True), "pair-")}


def as_page(answer: Verdict, record: page.PageContext) -> str:
    """Write the page."""
    return page.run_page(record.run, _sections(answer, record), record.explorer)


def _sections(answer: Verdict, record: page.PageContext) -> Iterator[Markup]:
    situation, candidate = answer.situation, answer.candidate
    times = candidate.tr, situation.td
    poor = answer.quality is not None and answer.quality.grade == "poor"
    shown = page.pair(
        f"{answer.word.capitalize()}{', but of poor quality' * poor}",
        times,
        tag("p", _left_over(candidate.residual), "; ", page.rigid_for(times, situation.history)),
        situation.history,
        "card chosen" if answer.verified and not poor else "card refused",
    )
    yield tag("section", tag("div", shown, class_="choice"), remarks(answer.cautions, answer.reasons))
    if record.explorer:
        yield explorer(record.explorer)
    yield drawings(record.figures)
    yield section("Measures", pairs(_measures(answer)))
    yield page.parts(candidate)
    if answer.switched:
        yield _switched(answer.switched, record.switched.files if record.switched else ())
    yield from page.evidence(situation, answer.health, record)
    if answer.verified:
        yield page.solver_input(times, record)


def _left_over(residual: float | None) -> str:
    """Say what of the vibration is wrong after td, as far as it is known."""
    return "judged by its energy level alone" if residual is None else f"residual {measure(residual)}"


def _measures(answer: Verdict) -> Iterator[tuple[str, str]]:
    """What is known of the pair."""
    yield from ((name.replace("_", " "), short(one)) for name, one in of_verdict(answer).items() if one is not None)


def _switched(found: Comparison, files: Iterable[Source]) -> Markup:
    """Show what the finished switched run has of the reference."""
    title = "The switched run"
    listed = [("compared", f"from td to {found.end:.6g}"), *deviations(found), *page.digests(files)]
    listed += [("note", note) for note in found.notes]
    return section(title, table(title, ("quantity", *COMPARED[1:]), comparison(found)), pairs(listed))
