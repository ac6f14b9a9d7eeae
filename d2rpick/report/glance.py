"""What a notebook shows of a run or an answer: what it says, a small table and the picture."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

from d2rpick.base.errors import if_written
from d2rpick.report import overview, parts, plan, study, suggestion, trade_off, verdict
from d2rpick.report.html import Markup, grid, tag
from d2rpick.report.tables import known

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping

    from matplotlib.figure import Figure

    from d2rpick.histories.run import Run
    from d2rpick.report.tables import Cell

_MOST_ROWS: Final = 12
_WIDEST: Final = "max-width: 40em"  # a picture without a width is as wide as the screen
# What is said, the shortest first, and the head and rows of the table.
_LOOKS: Final[Mapping[str, tuple[Callable[[Any], list[tuple[str, str]]], Callable[[Any], Any]]]] = {
    "overview": (
        lambda seen: [("run", ", ".join(seen.source))],
        lambda seen: (("", ""), _told(overview.facts(seen)[1:])),
    ),
    "suggestion": (suggestion.verdict, lambda one: suggestion.table(one, _MOST_ROWS)),
    "verdict": (
        lambda one: [("", verdict.told(one)), *(("but", reason) for reason in one.reasons)],
        lambda one: (("measure", "value"), _told(verdict.MEASURES.plain(one).items())),
    ),
    "trade_off": (
        lambda one: [("", trade_off.answer(one))],
        lambda one: trade_off.table(trade_off.some_of(one, _MOST_ROWS)),
    ),
    "plan": (lambda one: [("", plan.sentence(one)), *plan.outlook(one)], plan.table),
    "parts": (parts.outlook, lambda one: parts.table(one, next(iter(parts.TABLES.values())))),
    "study": (lambda one: study.outcome(one)[::-1], study.table),
}


def sentence(kind: str, answer: Any) -> str:
    """Say an answer in short."""
    return ": ".join(filter(None, _LOOKS[kind][0](answer)[0]))


def of_run(run: Run) -> str:
    """Say what a run is in short: files, format, states, times, parts, as far as its files can be read."""
    first = run.databases[0]
    time = if_written(lambda: first.time if first.channels else first.part_time)
    told = [" + ".join(one.format for one in run.databases)]
    if time is not None and time.size:
        told += [f"{time.size} states", f"{time[0]:.6g} to {time[-1]:.6g} {first.time_unit}".rstrip()]
    told += [f"{len(run.parts)} part{'s' * (len(run.parts) > 1)}"] if run.parts else []
    return f"{', '.join(map(repr, run.sources))}: {', '.join(told)}"


def glance(kind: str, answer: Any, figure: Figure | None) -> str:
    """Show an answer, or the overview of a run, as HTML; columns in which nothing is known are left out."""
    said, table = _LOOKS[kind]
    lines = [tag("div", tag("b", name), f" {text}") for name, text in said(answer)]
    head, rows = table(answer)
    lines += [grid(*known(head, rows[:_MOST_ROWS]))] if rows else []
    lines += [tag("div", f"... and {len(rows) - _MOST_ROWS} more")] if len(rows) > _MOST_ROWS else []
    return tag("div", *lines, *([_picture(figure)] if figure else []))


def _picture(figure: Figure) -> Markup:
    from d2rpick.report.figures import svg_element

    return tag("div", Markup(svg_element(figure, "glance-")), style=_WIDEST)


def _told(facts: Iterable[tuple[str, Cell]]) -> list[tuple[str, Cell]]:
    """Leave out what is not known."""
    return [fact for fact in facts if fact[1] is not None]
