"""Answers as HTML: pages to be read, printed and signed, and what a notebook shows of a run or an answer."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

from d2rpick.base.errors import give_if_written
from d2rpick.choice.grades import POOR, VERDICTS
from d2rpick.choice.study import Study, runs_of
from d2rpick.report import (
    drive,
    overview,
    page,
    parts,
    plan,
    study,
    suggestion,
    trade_off,
    verdict,
)
from d2rpick.report.decision import rigid_for, statements
from d2rpick.report.explorer import explorer, scripts, styles
from d2rpick.report.page import (
    Explorer,
    Markup,
    document,
    grid,
    pairs,
    remarks,
    section,
    table,
    tag,
)
from d2rpick.report.situation import what_was_read
from d2rpick.report.tables import Cell, known, short, unstarred

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence

    from matplotlib.figure import Figure

    from d2rpick.choice.answers import Suggestion, Verdict
    from d2rpick.choice.comparison import Comparison
    from d2rpick.choice.plan import Plan, Planned
    from d2rpick.choice.sets_of_parts import Parts, PartSet
    from d2rpick.choice.trade_off import TradeOff
    from d2rpick.histories.run import Run
    from d2rpick.histories.source import Source
    from d2rpick.running.drive import Driven


# More rows than one compares by eye; csv and json hold all.
_MOST_ROWS = 20


def _of_run(record: page.PageContext, *sections: Markup) -> str:
    """Write a page about one run; where something can be explored it runs a script."""
    needed = {"styles": styles(), "scripts": scripts()} if record.explorer else {}
    return document(
        f"Switch times: {page.title_of(record.run)}",
        *sections,
        signed=page.SIGNED,
        **needed,
    )


def _figures(prefix: str, caption: str, kind: str, *asked: Any, **how: Any) -> Markup:
    """Draw something of a kind under its caption, an SVG element whose ids begin with ``prefix``."""
    from d2rpick.report import figures, figures_choice

    drawn = getattr(figures_choice, f"draw_{kind}")(*asked, **how)
    return page.drawing(caption, figures.svg_element(drawn, prefix))


def _draw_suggestion(answer: Suggestion) -> Markup:
    shown = (
        "the choice, and a better pair" if answer.clearly_better else "and the choice"
    )
    return _figures(
        "choice-",
        f"Internal energy with its level at td, {shown}",
        "suggestion",
        answer,
        page=True,
    )


def _starred(title: str, head: Sequence[str], rows: Sequence[Sequence[Cell]]) -> Markup:
    """Give a table whose first column has a star for what is recommended: the row stands out instead."""
    marked = next((at for at, row in enumerate(rows) if row[0] == "*"), None)
    return table(title, *unstarred(head, rows), marked)


def suggestion_page(answer: Suggestion, record: page.PageContext) -> str:
    """Write the page of ``suggest``."""
    shown = (_choice(answer), explorer(record.explorer), _draw_suggestion(answer))
    return _of_run(record, *shown, *_below_figures(answer, record))


def _below_figures(answer: Suggestion, record: page.PageContext) -> Iterator[Markup]:
    yield section("Candidates", *_candidates(answer))
    yield page.parts(answer.chosen)
    yield from page.evidence(answer.situation, answer.health, record)
    if answer.recommended:
        yield page.solver_input((answer.recommended.tr, answer.recommended.td), record)


def _choice(answer: Suggestion) -> Markup:
    """Give the section above the figures: the pairs, large, and what to know of them."""
    cards, better = [_recommended(answer)], answer.clearly_better
    if better:
        told, times = (
            tag("p", suggestion.better_about(answer, better)),
            (better.tr, better.td),
        )
        cards.append(
            page.pair(
                "Better pair: another td", times, told, answer.situation.history, "card"
            )
        )
    return page.front(
        cards, remarks(answer.cautions), pairs(suggestion.outlook(answer))
    )


def _recommended(answer: Suggestion) -> Markup:
    best, decision = answer.chosen, answer.decision
    if best is None or decision is None:
        return page.refused(f"No tr can be recommended for this td: {answer.why_none}")
    times = best.tr, answer.td
    return page.decided(
        "", decision, times, answer.situation.history, suggestion.facts(answer)
    )


def _candidates(answer: Suggestion) -> Iterator[Markup]:
    if not answer.candidates:
        yield tag("p", "None.")
        return
    yield _starred("Candidates", *known(*suggestion.table(answer, _MOST_ROWS)))
    if (left := len(answer.candidates) - _MOST_ROWS) > 0:
        yield tag("p", f"{left} more in the csv and json results.", class_="soft")


def verdict_page(answer: Verdict, record: page.PageContext) -> str:
    """Write the page of ``verify``."""
    return _of_run(record, *_of_verdict(answer, record))


def _of_verdict(answer: Verdict, record: page.PageContext) -> Iterator[Markup]:
    situation, candidate = answer.situation, answer.candidate
    times = candidate.tr, situation.td
    card = page.decided(
        "", answer.decision, times, situation.history, verdict.facts(answer)
    )
    remarked = [one for one in answer.reasons if one not in answer.decision.reason]
    yield page.front([card], remarks(answer.cautions, remarked))
    yield explorer(record.explorer)
    caption = "Internal energy with its level at td, and the pair"
    yield _figures("pair-", caption, "verdict", answer, page=True)
    measures = verdict.measured(answer)
    yield section("Measures", pairs((name, short(value)) for name, value in measures))
    yield page.parts(candidate)
    if answer.switched:
        yield _switched(
            answer.switched, record.switched.files if record.switched else ()
        )
    yield from page.evidence(situation, answer.health, record)
    if record.card:
        yield page.solver_input(times, record)


def _switched(found: Comparison, files: Iterable[Source]) -> Markup:
    """Show what the finished switched run has of the reference."""
    title = "The switched run"
    listed = [
        ("compared", f"from td to {found.end:.6g}"),
        *verdict.deviations(found),
        *page.digests(files),
    ]
    listed += [("note", note) for note in found.notes]
    return section(
        title,
        table(title, ("quantity", *verdict.COMPARED[1:]), verdict.comparison(found)),
        pairs(listed),
    )


def trade_off_page(found: TradeOff, record: page.PageContext) -> str:
    """Write the page of ``explore``."""
    further = [one for one in found.cautions if one not in found.suggestion.cautions]
    caption = "Error and rigid time of the best pair for each td"
    best = trade_off.some_of(found, _MOST_ROWS)
    left = tag(
        "p",
        f"{len(found.offers) - len(best)} more td in the csv and json results.",
        class_="soft",
    )
    return _of_run(
        record,
        _choice(found.suggestion),
        tag("section", tag("p", trade_off.answer(found)), remarks(further)),
        explorer(record.explorer),
        _draw_suggestion(found.suggestion),
        _figures("explore-", caption, "trade_off", found, page=True),
        section(
            "Pairs that nothing beats",
            _starred("Pairs", *known(*trade_off.table(best))),
            left,
        ),
        *_below_figures(found.suggestion, record),
    )


def plan_page(
    found: Plan,
    run: Run,
    command: Sequence[str],
    card: str | None,
    explored: Explorer | None = None,
) -> str:
    """Write the page of ``plan``.

    Parameters
    ----------
    found : Plan
    run : Run
        What was read.
    command : sequence of str
        Arguments that repeat the answer.
    card : str or None
        Solver input for the next run, where it is known whom it switches.
    explored : Explorer, optional
        The flights of the plan.
    """
    cards = [_window(row, found) for row in found.supported]
    cards = cards or [page.refused("No window of this run can be recommended.")]
    caption = "Internal energy with the flights, and below it the rigid windows with their numbers"
    files = [*page.digests(run.files), *page.digests_of(found.settings)]
    notes = [("note", note) for note in found.history.notes]
    return _of_run(
        page.PageContext(run, command, (), explorer=explored),
        page.front(
            cards,
            remarks(found.cautions),
            pairs(
                [
                    ("plan", plan.sentence(found)),
                    *plan.next_steps(found),
                    *plan.outlook(found),
                ]
            ),
        ),
        explorer(explored),
        _figures("plan-", caption, "plan", found, page=True),
        section(
            "Flights",
            table("Flights", *unstarred(*plan.table(found))),
            pairs([*plan.verdicts(found), *plan.reasons(found)]),
        ),
        section("For the solver's input", tag("pre", card, tabindex="0"))
        if card
        else Markup(),
        section(
            "What was read",
            pairs([("history", what_was_read(found.history)), *files, *notes]),
        ),
        *page.method(command),
    )


def _window(row: Planned, found: Plan) -> Markup:
    assert row.window is not None
    assert row.candidate is not None
    assert row.decision is not None
    facts = [("rigid for", rigid_for(row.candidate)), *statements(row.decision)]
    title = f"Flight {row.number}: "
    return page.decided(title, row.decision, row.window, found.history, facts)


def study_page(answer: Study, command: Sequence[str]) -> str:
    """Write the page of ``study``; ``command`` are the arguments that repeat it."""
    caption = (
        "Internal energies of all runs, with the tr of each, the common one and td"
    )
    head, rows = study.table(answer)
    return document(
        f"Switch times of {runs_of(len(answer.runs))}",
        page.front(
            [_common(answer)],
            remarks(answer.cautions),
            pairs([*study.outcome(answer), *study.reasons(answer)]),
        ),
        _figures("runs-", caption, "study", answer, page=True),
        section(
            "Runs",
            table("Runs", *known([name.replace("+-", "±") for name in head], rows)),
        ),
        section("Files", tag("pre", _files(answer), class_="wrap")),
        *page.method(command),
        signed=page.CHECKED,
    )


def _common(answer: Study) -> Markup:
    tr, title = answer.common.tr, tag("h2", "One tr for all runs")
    if tr is None:
        return tag(
            "div", title, tag("p", "None: ", answer.common.reason or ""), class_="card"
        )
    times = [tag("span", tag("i", "tr"), f"{tr:.6g}")]
    if answer.td is not None:
        times.append(tag("span", tag("i", "td"), f"{answer.td:.6g}"))
    exact = f"in full: tr = {tr!r}" + (
        "" if answer.td is None else f", td = {answer.td!r}"
    )
    verdict = VERDICTS[answer.grade or POOR]
    (_, said), *_ = study.outcome(answer)
    kind = page.CLASSES[verdict]
    lines = (
        tag("div", *times, class_="times"),
        tag("p", said),
        tag("p", exact, class_="soft"),
    )
    badge = tag(
        "h2", "One tr for all runs: ", tag("span", verdict, class_=f"badge {kind}")
    )
    return tag("div", badge, *lines, class_=f"card {kind}")


def _files(answer: Study) -> str:
    """Name what was read, with size and time, in the order of the runs."""
    from datetime import UTC, datetime

    files = dict.fromkeys(stamp for row in answer.runs for stamp in row.files)
    return "\n".join(
        f"{datetime.fromtimestamp(stamp.mtime_ns / 1e9, UTC):%Y-%m-%d %H:%M:%S} UTC {stamp.size:>12} {stamp.name}"
        for stamp in files
    )


def parts_page(found: Parts, command: Sequence[str]) -> str:
    """Write the page of ``parts``; ``command`` are the arguments that repeat the answer."""
    sets = (
        [section("Sets", _starred("Sets", *parts.set_table(found, parts.SETS)))]
        if found.sets
        else []
    )
    tables = {
        name: unstarred(*parts.table(found, columns))
        for name, columns in parts.TABLES.items()
    }
    weights = [("weights", found.weights.source)] if found.weights else []
    deck = (
        page.deck_digests(found.inventory.files, found.weights)
        if found.inventory
        else []
    )
    return document(
        f"Parts to switch: {page.title_of(found.files)}",
        page.front([_set(found.recommended)], remarks(found.cautions)),
        *sets,
        *(section(name, table(name, *cells)) for name, cells in tables.items()),
        section("What to know", pairs(parts.outlook(found))),
        section(
            "What was read",
            pairs(
                [
                    *parts.heading(found),
                    *weights,
                    *page.digests(found.files.files),
                    *deck,
                ]
            ),
        ),
        page.repeated(command),
        signed=page.SIGNED,
    )


def _set(best: PartSet | None) -> Markup:
    if best is None:
        return page.refused("No set of parts can be recommended.")
    saved = tag(
        "span",
        tag("i", "saves about"),
        f"{best.saving:.0%}",
        tag("i", " of the processor time"),
    )
    listed = tag("p", f"parts {parts.ranges(best.parts)}")
    return tag(
        "div",
        tag("h2", parts.set_name(best)),
        tag("div", saved, class_="times"),
        listed,
        class_="card chosen",
    )


def drive_page(found: Driven, command: Sequence[str]) -> str:
    """Write the page of ``drive``; ``command`` are the arguments that repeat the run."""
    from d2rpick.histories.names import Selection

    history = found.run.history(Selection(parts=tuple(map(str, found.deck.parts))))
    switched = [one for one in found.windows if not one.reason]
    contacts = (
        "none to the end" if one.contact is None else f"{one.contact:.6g}"
        for one in switched
    )
    cards = [
        page.pair(
            f"Window {number}",
            (one.tr, one.td),
            pairs([("contact", text)]),
            history,
            "card chosen",
        )
        for number, (one, text) in enumerate(
            zip(switched, contacts, strict=True), start=1
        )
    ]
    cards = cards or [tag("p", "No flight was switched.")]
    caption = "Internal energy in the deformable legs, with the rigid windows; rigid legs have none that is believed"
    flights, rigid = (
        [(one.free, one.contact or one.td) for one in switched],
        [(one.tr, one.td) for one in switched],
    )
    return document(
        f"First run: {found.deck.name}",
        page.front(cards, remarks(found.cautions), pairs(drive.outlook(found))),
        _figures("driven-", caption, "run", history, flights, rigid),
        section("Evidence", table("Windows", *drive.windows(found))),
        section("Cost", table("Legs", *drive.legs(found))),
        section("What was read", pairs(page.digests(found.run.files))),
        page.repeated(command),
        signed=page.CHECKED,
    )


# Of a table in a notebook.
_FEW_ROWS: Final = 12
_WIDEST: Final = "max-width: 40em"  # a picture without a width is as wide as the screen
# What is said, the shortest first, and the head and rows of the table.
_LOOKS: Final[
    Mapping[str, tuple[Callable[[Any], list[tuple[str, str]]], Callable[[Any], Any]]]
] = {
    "overview": (
        overview.verdict,
        lambda seen: (("", ""), _told(overview.facts(seen)[1:])),
    ),
    "suggestion": (suggestion.verdict, lambda one: suggestion.table(one, _FEW_ROWS)),
    "verdict": (
        verdict.verdict,
        lambda one: (("measure", "value"), verdict.measured(one)),
    ),
    "trade_off": (
        lambda one: [("", trade_off.answer(one))],
        lambda one: trade_off.table(trade_off.some_of(one, _FEW_ROWS)),
    ),
    "plan": (lambda one: [("", plan.sentence(one)), *plan.outlook(one)], plan.table),
    "parts": (
        parts.verdict_on_set,
        lambda one: parts.table(one, next(iter(parts.TABLES.values()))),
    ),
    "study": (study.outcome, study.table),
}


def sentence(kind: str, answer: Any) -> str:
    """Say an answer in short."""
    return ": ".join(filter(None, _LOOKS[kind][0](answer)[0]))


def of_run(run: Run) -> str:
    """Say what a run is in short: files, format, states, times, parts, as far as its files can be read."""
    first = run.databases[0]
    time = give_if_written(lambda: first.time if first.channels else first.part_time)
    told = [" + ".join(one.format for one in run.databases)]
    if time is not None and time.size:
        told += [
            f"{time.size} states",
            f"{time[0]:.6g} to {time[-1]:.6g} {first.time_unit}".rstrip(),
        ]
    told += [f"{len(run.parts)} part{'s' * (len(run.parts) > 1)}"] if run.parts else []
    return f"{', '.join(map(repr, run.sources))}: {', '.join(told)}"


def glance(kind: str, answer: Any, figure: Figure | None) -> str:
    """Show an answer, or the overview of a run, as HTML; columns in which nothing is known are left out."""
    said, table = _LOOKS[kind]
    lines = [tag("div", tag("b", name), f" {text}") for name, text in said(answer)]
    head, rows = table(answer)
    lines += [grid(*known(head, rows[:_FEW_ROWS]))] if rows else []
    lines += (
        [tag("div", f"... and {len(rows) - _FEW_ROWS} more")]
        if len(rows) > _FEW_ROWS
        else []
    )
    return tag("div", *lines, *([_picture(figure)] if figure else []))


def _picture(figure: Figure) -> Markup:
    from d2rpick.report.figures import svg_element

    return tag("div", Markup(svg_element(figure, "glance-")), style=_WIDEST)


def _told(facts: Iterable[tuple[str, Cell]]) -> list[tuple[str, Cell]]:
    """Leave out what is not known."""
    return [fact for fact in facts if fact[1] is not None]
