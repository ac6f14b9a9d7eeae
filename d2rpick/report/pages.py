"""Write answers as HTML: pages to be read, printed and signed, and what a notebook shows of a run or an answer."""

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


# Most rows of a table on a page: the eye cannot compare more, and CSV and JSON hold all.
_MOST_ROWS = 20

# Most rows of a table in a notebook.
_FEW_ROWS: Final = 12
_WIDEST: Final = "max-width: 40em"  # a picture without a width fills the screen


def _of_run(record: page.PageContext, *sections: Markup) -> str:
    """Write a page about one run, with its script if something can be explored."""
    needed = {"styles": styles(), "scripts": scripts()} if record.explorer else {}
    return document(
        f"Switch times: {page.title_of(record.run)}",
        *sections,
        signed=page.SIGNED,
        **needed,
    )


def _figures(
    prefix: str, caption: str, kind: str, *arguments: Any, **how: Any
) -> Markup:
    """Draw a figure by the name of its kind, with a caption, as an SVG element whose ids begin with ``prefix``."""
    from d2rpick.report import figures, figures_choice

    drawn = getattr(figures_choice, f"draw_{kind}")(*arguments, **how)
    return page.drawing(caption, figures.svg_element(drawn, prefix))


def _draw_suggestion(answer: Suggestion) -> Markup:
    if answer.clearly_better:
        choice_text = "the choice, and a better pair"
    else:
        choice_text = "and the choice"
    return _figures(
        "choice-",
        f"Internal energy with its level at td, {choice_text}",
        "suggestion",
        answer,
        page=True,
    )


def _starred(title: str, head: Sequence[str], rows: Sequence[Sequence[Cell]]) -> Markup:
    """Return a table without its first column; a star there marks the recommended row, which is highlighted instead."""
    marked = next((at for at, row in enumerate(rows) if row[0] == "*"), None)
    return table(title, *unstarred(head, rows), marked)


def suggestion_page(answer: Suggestion, record: page.PageContext) -> str:
    """Write the page of ``suggest``."""
    first_sections = (
        _choice(answer),
        explorer(record.explorer),
        _draw_suggestion(answer),
    )
    return _of_run(record, *first_sections, *_below_figures(answer, record))


def _below_figures(answer: Suggestion, record: page.PageContext) -> Iterator[Markup]:
    yield section("Candidates", *_candidates(answer))
    yield page.parts(answer.chosen)
    yield from page.evidence(answer.situation, answer.health, record)
    if answer.recommended:
        yield page.solver_input((answer.recommended.tr, answer.recommended.td), record)


def _choice(answer: Suggestion) -> Markup:
    """Return the section above the figures: the pairs in large type, and remarks."""
    cards = [_recommended(answer)]
    better = answer.clearly_better
    if better:
        better_text = tag("p", suggestion.better_about(answer, better))
        times = (better.tr, better.td)
        cards.append(
            page.pair(
                "Better pair: another td",
                times,
                better_text,
                answer.situation.history,
                "card",
            )
        )
    return page.front(
        cards, remarks(answer.cautions), pairs(suggestion.outlook(answer))
    )


def _recommended(answer: Suggestion) -> Markup:
    best = answer.chosen
    decision = answer.decision
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
    if (hidden_count := len(answer.candidates) - _MOST_ROWS) > 0:
        yield tag(
            "p", f"{hidden_count} more in the csv and json results.", class_="soft"
        )


def verdict_page(answer: Verdict, record: page.PageContext) -> str:
    """Write the page of ``verify``."""
    return _of_run(record, *_of_verdict(answer, record))


def _of_verdict(answer: Verdict, record: page.PageContext) -> Iterator[Markup]:
    situation = answer.situation
    candidate = answer.candidate
    times = candidate.tr, situation.td
    card = page.decided(
        "", answer.decision, times, situation.history, verdict.facts(answer)
    )
    further_reasons = [
        reason for reason in answer.reasons if reason not in answer.decision.reason
    ]
    yield page.front([card], remarks(answer.cautions, further_reasons))
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


def _switched(comparison: Comparison, files: Iterable[Source]) -> Markup:
    """Return the comparison of the finished switched run with the reference."""
    title = "The switched run"
    listed = [
        ("compared", f"from td to {comparison.end:.6g}"),
        *verdict.deviations(comparison),
        *page.digests(files),
    ]
    listed += [("note", note) for note in comparison.notes]
    return section(
        title,
        table(
            title, ("quantity", *verdict.COMPARED[1:]), verdict.comparison(comparison)
        ),
        pairs(listed),
    )


def trade_off_page(answer: TradeOff, record: page.PageContext) -> str:
    """Write the page of ``explore``."""
    further = [
        caution
        for caution in answer.cautions
        if caution not in answer.suggestion.cautions
    ]
    caption = "Error and rigid time of the best pair for each td"
    best = trade_off.some_of(answer, _MOST_ROWS)
    hidden = tag(
        "p",
        f"{len(answer.offers) - len(best)} more td in the csv and json results.",
        class_="soft",
    )
    return _of_run(
        record,
        _choice(answer.suggestion),
        tag("section", tag("p", trade_off.answer(answer)), remarks(further)),
        explorer(record.explorer),
        _draw_suggestion(answer.suggestion),
        _figures("explore-", caption, "trade_off", answer, page=True),
        section(
            "Pairs that nothing beats",
            _starred("Pairs", *known(*trade_off.table(best))),
            hidden,
        ),
        *_below_figures(answer.suggestion, record),
    )


def plan_page(
    answer: Plan,
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
        The run that was read.
    command : sequence of str
        Arguments that repeat the answer.
    card : str or None
        Solver input for the next run, if the parts to be switched are known.
    explored : Explorer, optional
        The flights of the plan.
    """
    cards = [_window(row, answer) for row in answer.supported]
    cards = cards or [page.refused("No window of this run can be recommended.")]
    caption = "Internal energy with the flights, and below it the rigid windows with their numbers"
    files = [*page.digests(run.files), *page.digests_of(answer.settings)]
    notes = [("note", note) for note in answer.history.notes]
    return _of_run(
        page.PageContext(run, command, (), explorer=explored),
        page.front(
            cards,
            remarks(answer.cautions),
            pairs(
                [
                    ("plan", plan.sentence(answer)),
                    *plan.next_steps(answer),
                    *plan.outlook(answer),
                ]
            ),
        ),
        explorer(explored),
        _figures("plan-", caption, "plan", answer, page=True),
        section(
            "Flights",
            table("Flights", *unstarred(*plan.table(answer))),
            pairs([*plan.verdicts(answer), *plan.reasons(answer)]),
        ),
        section("For the solver's input", tag("pre", card, tabindex="0"))
        if card
        else Markup(),
        section(
            "What was read",
            pairs([("history", what_was_read(answer.history)), *files, *notes]),
        ),
        *page.method(command),
    )


def _window(row: Planned, answer: Plan) -> Markup:
    assert row.window is not None
    assert row.candidate is not None
    assert row.decision is not None
    facts = [("rigid for", rigid_for(row.candidate)), *statements(row.decision)]
    title = f"Flight {row.number}: "
    return page.decided(title, row.decision, row.window, answer.history, facts)


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
    tr = answer.common.tr
    title = tag("h2", "One tr for all runs")
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
    (_, outcome), *_ = study.outcome(answer)
    kind = page.CLASSES[verdict]
    lines = (
        tag("div", *times, class_="times"),
        tag("p", outcome),
        tag("p", exact, class_="soft"),
    )
    badge = tag(
        "h2", "One tr for all runs: ", tag("span", verdict, class_=f"badge {kind}")
    )
    return tag("div", badge, *lines, class_=f"card {kind}")


def _files(answer: Study) -> str:
    """Return the input files with size and time, in the order of the runs."""
    from datetime import UTC, datetime

    files = dict.fromkeys(stamp for row in answer.runs for stamp in row.files)
    return "\n".join(
        f"{datetime.fromtimestamp(stamp.mtime_ns / 1e9, UTC):%Y-%m-%d %H:%M:%S} UTC {stamp.size:>12} {stamp.name}"
        for stamp in files
    )


def parts_page(answer: Parts, command: Sequence[str]) -> str:
    """Write the page of ``parts``; ``command`` are the arguments that repeat the answer."""
    if answer.sets:
        sets = [section("Sets", _starred("Sets", *parts.set_table(answer, parts.SETS)))]
    else:
        sets = []
    tables = {
        name: unstarred(*parts.table(answer, columns))
        for name, columns in parts.TABLES.items()
    }
    weights = [("weights", answer.weights.source)] if answer.weights else []
    if answer.inventory:
        deck = page.deck_digests(answer.inventory.files, answer.weights)
    else:
        deck = []
    return document(
        f"Parts to switch: {page.title_of(answer.files)}",
        page.front([_set(answer.recommended)], remarks(answer.cautions)),
        *sets,
        *(section(name, table(name, *cells)) for name, cells in tables.items()),
        section("What to know", pairs(parts.outlook(answer))),
        section(
            "What was read",
            pairs(
                [
                    *parts.heading(answer),
                    *weights,
                    *page.digests(answer.files.files),
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


def drive_page(answer: Driven, command: Sequence[str]) -> str:
    """Write the page of ``drive``; ``command`` are the arguments that repeat the run."""
    from d2rpick.histories.names import Selection

    history = answer.run.history(Selection(parts=tuple(map(str, answer.deck.parts))))
    switched = [window for window in answer.windows if not window.reason]
    contacts = (
        "none to the end" if window.contact is None else f"{window.contact:.6g}"
        for window in switched
    )
    cards = [
        page.pair(
            f"Window {number}",
            (window.tr, window.td),
            pairs([("contact", text)]),
            history,
            "card chosen",
        )
        for number, (window, text) in enumerate(
            zip(switched, contacts, strict=True), start=1
        )
    ]
    cards = cards or [tag("p", "No flight was switched.")]
    caption = "Internal energy in the deformable legs, with the rigid windows; rigid legs have none that is believed"
    flights = [(window.free, window.contact or window.td) for window in switched]
    rigid = [(window.tr, window.td) for window in switched]
    return document(
        f"First run: {answer.deck.name}",
        page.front(cards, remarks(answer.cautions), pairs(drive.outlook(answer))),
        _figures("driven-", caption, "run", history, flights, rigid),
        section("Evidence", table("Windows", *drive.windows(answer))),
        section("Cost", table("Legs", *drive.legs(answer))),
        section("What was read", pairs(page.digests(answer.run.files))),
        page.repeated(command),
        signed=page.CHECKED,
    )


# For each kind of answer: sentences, the shortest first, and the head and rows of its table.
_LOOKS: Final[
    Mapping[str, tuple[Callable[[Any], list[tuple[str, str]]], Callable[[Any], Any]]]
] = {
    "overview": (
        overview.verdict,
        lambda answer: (("", ""), _told(overview.facts(answer)[1:])),
    ),
    "suggestion": (
        suggestion.verdict,
        lambda answer: suggestion.table(answer, _FEW_ROWS),
    ),
    "verdict": (
        verdict.verdict,
        lambda answer: (("measure", "value"), verdict.measured(answer)),
    ),
    "trade_off": (
        lambda answer: [("", trade_off.answer(answer))],
        lambda answer: trade_off.table(trade_off.some_of(answer, _FEW_ROWS)),
    ),
    "plan": (
        lambda answer: [("", plan.sentence(answer)), *plan.outlook(answer)],
        plan.table,
    ),
    "parts": (
        parts.verdict_on_set,
        lambda answer: parts.table(answer, next(iter(parts.TABLES.values()))),
    ),
    "study": (study.outcome, study.table),
}


def sentence(kind: str, answer: Any) -> str:
    """Return an answer in one sentence."""
    return ": ".join(filter(None, _LOOKS[kind][0](answer)[0]))


def of_run(run: Run) -> str:
    """Return a summary of a run: files, format, states, times and parts, as far as its files are readable."""
    first = run.databases[0]
    time = give_if_written(lambda: first.time if first.channels else first.part_time)
    facts = [" + ".join(database.format for database in run.databases)]
    if time is not None and time.size:
        facts += [
            f"{time.size} states",
            f"{time[0]:.6g} to {time[-1]:.6g} {first.time_unit}".rstrip(),
        ]
    facts += [f"{len(run.parts)} part{'s' * (len(run.parts) > 1)}"] if run.parts else []
    return f"{', '.join(map(repr, run.sources))}: {', '.join(facts)}"


def glance(kind: str, answer: Any, figure: Figure | None) -> str:
    """Return an answer, or the overview of a run, as HTML for a notebook, without columns of unknown values."""
    give_sentences, table = _LOOKS[kind]
    lines = [
        tag("div", tag("b", name), f" {text}") for name, text in give_sentences(answer)
    ]
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
    """Return only the facts whose values are known."""
    return [fact for fact in facts if fact[1] is not None]
