"""The answer of ``plan`` as one HTML page to be read, printed and signed."""

from __future__ import annotations

from typing import TYPE_CHECKING

from d2rpick.report import page
from d2rpick.report.explorer import explorer
from d2rpick.report.figures_page import svg_element
from d2rpick.report.figures_plan import draw_plan
from d2rpick.report.html import Markup, drawings, pairs, remarks, resource, section, table, tag
from d2rpick.report.plan import error, head, heading, outlook, rows
from d2rpick.report.shell import shell_line

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from d2rpick.choice.plan import Plan, Planned
    from d2rpick.histories.opening import Run
    from d2rpick.report.explorer import Explorer

_CAPTION = "Internal energy with the flights, and below it the rigid windows with their numbers"


def as_page(plan: Plan, run: Run, command: Sequence[str], card: str | None, explored: Explorer | None = None) -> str:
    """Write the page.

    Parameters
    ----------
    plan : Plan
    run : Run
        What was read.
    command : sequence of str
        Arguments that repeat the answer.
    card : str or None
        Solver input for the next run, where it is known whom it switches.
    explored : Explorer, optional
        The flights of the plan.
    """
    return page.run_page(run, _sections(plan, run, command, card, explored), explored)


def _sections(
    plan: Plan, run: Run, command: Sequence[str], card: str | None, explored: Explorer | None
) -> Iterator[Markup]:
    cards = [_window(row, plan) for row in plan.supported]
    if not cards:
        nothing = tag("p", "No window of this run can be recommended.")
        cards = [tag("div", tag("h2", "Nothing recommended"), nothing, class_="card refused")]
    yield tag("section", tag("div", *cards, class_="choice"), remarks(plan.cautions), pairs(outlook(plan)))
    if explored:
        yield explorer(explored)
    yield drawings({_CAPTION: svg_element(draw_plan(plan, page=True), "plan-")})
    reasons = pairs([(f"flight {row.number}", row.reason) for row in plan.rows if row.reason])
    yield section("Flights", table("Flights", head(plan)[1:], [row[1:] for row in rows(plan)]), reasons)
    if card:
        yield section("For the solver's input", tag("pre", card, tabindex="0"))
    what, _, text = heading(plan).partition(" ")
    notes = [("note", note) for note in plan.history.notes]
    files = [*page.digests(run.files), *page.digests_of(plan.settings)]
    yield section("What was read", pairs([(what, text.strip()), *files, *notes]))
    yield section("Method and limits", resource("method.html"))
    yield section("To repeat this", tag("pre", shell_line(command), class_="wrap"))


def _window(row: Planned, plan: Plan) -> Markup:
    assert row.window is not None
    assert row.quality is not None
    told = pairs(
        [
            ("saves", page.rigid_for(row.window, plan.history)),
            ("quality", row.quality.told),
            ("error", error(row) or "-"),
        ]
    )
    return page.pair(f"Flight {row.number}", row.window, told, plan.history, "card chosen")
