"""Write answers as HTML: pages to be read, printed and signed, and displays in notebooks."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

from d2rpick.base.errors import give_if_readable
from d2rpick.choice.pair.grades import POOR, VERDICTS
from d2rpick.choice.runs.study import StudyOfRuns, format_number_of_runs
from d2rpick.report import (
    drive,
    overview_table,
    page,
    parts,
    plan,
    study,
    suggestion,
    trade_off,
    verdict,
)
from d2rpick.report.decision import (
    format_accuracy,
    format_rigid_time,
    list_statements,
    list_verdict_lines,
)
from d2rpick.report.explorer import build_explorer, read_scripts, read_styles
from d2rpick.report.formats import DisplayOptions, RepeatedQuestion
from d2rpick.report.page import (
    Explorer,
    Markup,
    build_document,
    build_grid,
    build_pairs,
    build_remarks,
    build_scrolling_table,
    build_section,
    build_steps,
    join,
    make_element,
)
from d2rpick.report.situation import describe_input
from d2rpick.report.tables import (
    Cell,
    format_short,
    remove_star_column,
    select_known_columns,
)
from d2rpick.report.warning_texts import EXPLANATIONS

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence

    from matplotlib.figure import Figure

    from d2rpick.base.errors import Caution
    from d2rpick.choice.answers import PairSuggestion, PairVerdict
    from d2rpick.choice.parts.sets_of_parts import Parts
    from d2rpick.choice.switched.comparison import Comparison
    from d2rpick.choice.td.plan import PlannedFlight, RunPlan
    from d2rpick.choice.td.trade_off import Offer, TradeOff
    from d2rpick.histories.run import OpenedRun
    from d2rpick.histories.source import Source
    from d2rpick.running.drive import Driven


# Largest number of table rows on a page. More rows cannot be compared by eye; CSV and JSON contain all of them.
_MOST_ROWS = 20

# Largest number of table rows in a notebook.
_FEW_ROWS: Final = 12
# Largest width of a picture in a notebook, as a CSS length.
_WIDEST: Final = "max-width: 40em"
# For each type of answer, the function that returns its sentences, table header and table rows.
_LOOKS: Final[
    Mapping[str, tuple[Callable[[Any], list[tuple[str, str]]], Callable[[Any], Any]]]
] = {
    "overview": (
        overview_table.list_overview_lines,
        lambda answer: (
            ("", ""),
            _select_known_facts(overview_table.list_facts(answer)[1:]),
        ),
    ),
    "suggestion": (
        suggestion.list_verdict,
        lambda answer: suggestion.build_candidate_table(answer, _FEW_ROWS),
    ),
    "verdict": (
        verdict.list_pair_verdict,
        lambda answer: (("measure", "value"), verdict.list_known_measures(answer)),
    ),
    "trade_off": (
        trade_off.list_answer_lines,
        lambda answer: trade_off.build_offer_table(
            trade_off.select_offers(answer, _FEW_ROWS), answer
        ),
    ),
    "plan": (
        lambda answer: [
            ("", plan.give_plan_sentence(answer)),
            *plan.list_verdicts(answer),
            *plan.list_accuracies(answer),
            *plan.list_plan_remarks(answer),
        ],
        plan.build_flight_table,
    ),
    "parts": (
        parts.list_verdict_on_set,
        lambda answer: parts.build_part_table(
            answer, next(iter(parts.TABLES.values()))
        ),
    ),
    "study": (
        lambda answer: [*study.list_outcome(answer), *study.list_run_reasons(answer)],
        study.build_run_table,
    ),
}
# For each type of answer, the function that returns the numbered reasons for the verdicts in its table.
_REASONS: Final[Mapping[str, Callable[[Any], list[tuple[str, str]]]]] = {
    "suggestion": lambda answer: suggestion.list_candidate_reasons(
        answer, answer.candidates[:_FEW_ROWS]
    ),
    "trade_off": lambda answer: trade_off.list_offer_reasons(
        trade_off.select_offers(answer, _FEW_ROWS)
    ),
}


# Heads of the table of the input files, and the bytes of a kilobyte.
_FILES: Final = ("run", "written (UTC)", "size, kB", "file")
_KILOBYTE: Final = 1000


def _write_run_page(record: page.PageContext, *sections: Markup) -> str:
    """Write a page about one run, with its script if it has trade-offs to explore."""
    needed = (
        {"styles": read_styles(), "scripts": read_scripts()} if record.explorer else {}
    )
    return build_document(
        f"Switch times: {page.get_title(record.run)}",
        *sections,
        signed=page.SIGNED,
        **needed,
    )


def _build_figure(
    prefix: str, caption: str, kind: str, *arguments: Any, **how: Any
) -> Markup:
    """Draw a figure of the given kind, with a caption, as an SVG element whose ids begin with ``prefix``."""
    from d2rpick.report import figures, figures_choice

    drawn = getattr(figures_choice, f"draw_{kind}")(*arguments, **how)
    return page.build_drawing(caption, figures.render_svg_element(drawn, prefix))


def _draw_suggestion(answer: PairSuggestion) -> Markup:
    if answer.clearly_better:
        choice_text = "the choice, and a better pair"
    else:
        choice_text = "and the choice"
    return _build_figure(
        "choice-",
        f"Internal energy with its level at td, {choice_text}",
        "suggestion",
        answer,
        page=True,
    )


def _build_starred_table(
    title: str, head: Sequence[str], rows: Sequence[Sequence[Cell]]
) -> Markup:
    """Remove the column of stars from a table, and highlight the row with a star, which is the recommended one."""
    marked = next((at for at, row in enumerate(rows) if row[0] == "*"), None)
    return build_scrolling_table(title, *remove_star_column(head, rows), marked)


def suggestion_page(answer: PairSuggestion, record: page.PageContext) -> str:
    """Write the page of ``suggest``."""
    question = _ask_about_td(record, "--td", f"{answer.td:.6g}")
    first_sections = (
        _build_choice(answer, steps=suggestion.list_next_step(answer, question)),
        build_explorer(record.explorer),
        _draw_suggestion(answer),
    )
    return _write_run_page(
        record, *first_sections, *_build_lower_sections(answer, record)
    )


def _ask_about_td(record: page.PageContext, *times: str) -> RepeatedQuestion:
    """Return the question of a page with the times of its pair, as typed options."""
    return (record.question or RepeatedQuestion())._replace(times=times)


def _build_lower_sections(
    answer: PairSuggestion, record: page.PageContext
) -> Iterator[Markup]:
    yield build_section("Candidates", *_build_candidates(answer))
    yield from page.build_evidence(answer.situation, answer.health, record)
    if answer.recommended and answer.decision:
        yield page.build_solver_input(
            answer.decision, (answer.recommended.tr, answer.recommended.td), record
        )


def _build_choice(
    answer: PairSuggestion, title: str = "", steps: Iterable[tuple[str, str]] = ()
) -> Markup:
    """Return the section above the figures, with the pairs of times in large type, the next steps, and remarks."""
    cards = [_build_recommendation(answer, title)]
    better = answer.clearly_better
    if better:
        better_text = make_element("p", suggestion.describe_improvement(answer, better))
        times = (better.tr, better.td)
        cards.append(
            page.build_pair_card(
                "Better pair: another td",
                times,
                better_text,
                answer.situation.history,
                "card",
            )
        )
    return page.build_front(
        cards,
        build_steps(steps),
        build_remarks(answer.cautions),
        build_pairs(suggestion.list_alternatives(answer)),
    )


def _build_recommendation(answer: PairSuggestion, title: str) -> Markup:
    best = answer.chosen
    decision = answer.decision
    if best is None or decision is None:
        return page.build_refusal(
            f"No tr can be recommended for this td: {answer.why_none}"
        )
    times = best.tr, answer.td
    return page.build_verdict_card(
        title,
        decision,
        times,
        answer.situation.history,
        suggestion.list_evidence(answer),
    )


def _build_candidates(answer: PairSuggestion) -> Iterator[Markup]:
    if not answer.candidates:
        yield make_element("p", "None.")
        return
    yield _build_starred_table(
        "Candidates",
        *select_known_columns(*suggestion.build_candidate_table(answer, _MOST_ROWS)),
    )
    listed = answer.candidates[:_MOST_ROWS]
    yield build_pairs(suggestion.list_candidate_reasons(answer, listed))
    if (hidden_count := len(answer.candidates) - _MOST_ROWS) > 0:
        yield make_element(
            "p", f"{hidden_count} more in the csv and json results.", class_="soft"
        )


def verdict_page(answer: PairVerdict, record: page.PageContext) -> str:
    """Write the page of ``verify``."""
    return _write_run_page(record, *_build_verdict(answer, record))


def _build_verdict(answer: PairVerdict, record: page.PageContext) -> Iterator[Markup]:
    situation = answer.situation
    candidate = answer.candidate
    times = candidate.tr, situation.td
    card = page.build_verdict_card(
        "",
        answer.decision,
        times,
        situation.history,
        [
            *verdict.list_comparison(answer),
            *verdict.list_pair_evidence(answer),
        ],
    )
    further_reasons = [
        reason for reason in answer.reasons if reason not in answer.decision.reason
    ]
    tr, td = times
    question = _ask_about_td(record, "--tr", f"{tr:.6g}", "--td", f"{td:.6g}")
    display = DisplayOptions(question=question, page="this page")
    yield page.build_front(
        [card],
        build_steps(verdict.list_next_step(answer, display)),
        build_remarks(answer.cautions, further_reasons),
    )
    yield build_explorer(record.explorer, answer)
    caption = "Internal energy with its level at td, and the pair"
    yield _build_figure("pair-", caption, "verdict", answer, page=True)
    measures = verdict.list_known_measures(answer)
    yield build_section(
        "Measures", build_pairs((name, format_short(value)) for name, value in measures)
    )
    if answer.switched:
        yield _build_comparison(
            answer.switched, record.switched.files if record.switched else ()
        )
    yield from page.build_evidence(situation, answer.health, record)
    if record.printing:
        yield page.build_solver_input(answer.decision, times, record)


def _build_comparison(comparison: Comparison, files: Iterable[Source]) -> Markup:
    """Return the comparison of the finished switched run with the reference run."""
    title = "The switched run"
    listed = [
        ("compared", f"from td to {comparison.end:.6g}"),
        *verdict.list_deviations(comparison),
        *page.list_digests(files),
    ]
    listed += [("note", note) for note in comparison.notes]
    return build_section(
        title,
        build_scrolling_table(
            title,
            ("quantity", *verdict.COMPARED[1:]),
            verdict.compare_values(comparison),
        ),
        build_pairs(listed),
    )


def trade_off_page(answer: TradeOff, record: page.PageContext) -> str:
    """Write the page of ``explore``."""
    further = [
        caution
        for caution in answer.cautions
        if caution not in answer.suggestion.cautions
    ]
    caption = "Error and rigid time of the best pair for each td"
    best = trade_off.select_offers(answer, _MOST_ROWS)
    hidden = make_element(
        "p",
        f"{len(answer.offers) - len(best)} more td in the csv and json results.",
        class_="soft",
    )
    steps = trade_off.list_next_step(answer, _ask_about_td(record))
    if answer.requested:
        front = [
            page.build_front(
                [_build_requested(answer, answer.requested)], build_steps(steps)
            ),
            _build_choice(answer.suggestion, "If td is free: "),
        ]
    else:
        lines = build_pairs(trade_off.list_costs_of_other_offers(answer))
        front = [
            _build_choice(answer.suggestion, steps=steps),
            make_element("section", lines),
        ]
    return _write_run_page(
        record,
        *front,
        make_element("section", build_remarks(further)),
        build_explorer(record.explorer),
        _draw_suggestion(answer.suggestion),
        _build_figure("explore-", caption, "trade_off", answer, page=True),
        build_section(
            "Pareto-optimal pairs",
            _build_starred_table(
                "Pairs",
                *select_known_columns(*trade_off.build_offer_table(best, answer)),
            ),
            build_pairs(trade_off.list_offer_reasons(best)),
            hidden,
        ),
        *_build_lower_sections(answer.suggestion, record),
    )


def _build_requested(answer: TradeOff, requested: Offer) -> Markup:
    """Return the card of the best pair at the requested td, with the nearest better td."""
    decision = answer.decide_on(requested)
    if requested.best is None or decision is None:
        return page.build_refusal(
            f"No tr can be recommended for td = {requested.td:.6g}: {requested.answer.why_none}"
        )
    return page.build_verdict_card(
        "Requested td: ",
        decision,
        (requested.best.tr, requested.td),
        answer.situation.history,
        [trade_off.list_other_td(answer, requested)],
    )


def plan_page(
    answer: RunPlan,
    run: OpenedRun,
    command: Sequence[str],
    card: str | None,
    explored: Explorer | None = None,
    question: RepeatedQuestion | None = None,
) -> str:
    """Write the page of ``plan``.

    Parameters
    ----------
    found : Plan
    run : Run
        The run that was read.
    command : sequence of str
        Arguments that reproduce the answer.
    card : str or None
        Solver input for the next run, if the parts to be switched are known.
    explored : Explorer, optional
        The flights of the plan.
    question : RepeatedQuestion, optional
        Words with which the next command asks about the same run.
    """
    cards = [_build_window_card(row, answer) for row in answer.supported]
    cards = cards or [page.build_refusal("No window of this run can be recommended.")]
    caption = "Internal energy with the flights, and above it the rigid windows with their numbers"
    files = [
        *page.list_digests(run.files),
        *page.list_digests_of_settings(answer.settings),
    ]
    notes = [("note", note) for note in answer.history.notes]
    return _write_run_page(
        page.PageContext(run, command, (), explorer=explored),
        page.build_front(
            cards,
            build_remarks(answer.cautions),
            build_steps(
                [
                    ("plan", plan.give_plan_sentence(answer)),
                    *plan.list_next_steps(answer, question or RepeatedQuestion()),
                    *plan.list_plan_remarks(answer),
                ]
            ),
        ),
        build_explorer(explored),
        _build_figure("plan-", caption, "plan", answer, page=True),
        build_section(
            "Flights",
            build_scrolling_table(
                "Flights", *remove_star_column(*plan.build_flight_table(answer))
            ),
            build_pairs([*plan.list_verdicts(answer), *plan.list_reasons(answer)]),
        ),
        build_section("For the solver's input", make_element("pre", card, tabindex="0"))
        if card
        else Markup(),
        build_section(
            "What was read",
            build_pairs([("history", describe_input(answer.history)), *files, *notes]),
        ),
        *page.build_method(command),
    )


def _build_window_card(row: PlannedFlight, answer: RunPlan) -> Markup:
    assert row.window is not None
    assert row.candidate is not None
    assert row.decision is not None
    facts = [
        ("rigid for", format_rigid_time(row.candidate, answer.history)),
        *list_statements(row.decision),
    ]
    if accuracy := format_accuracy(row.candidate):
        facts.append(("tr", accuracy))
    title = f"Flight {row.number}: "
    return page.build_verdict_card(
        title, row.decision, row.window, answer.history, facts
    )


def study_page(
    answer: StudyOfRuns,
    command: Sequence[str],
    question: RepeatedQuestion | None = None,
) -> str:
    """Write the page of ``study``; ``command`` contains the arguments that repeat it.

    ``question`` has the words of the next command; without them the page names none.
    """
    steps = study.list_next_step(answer, question) if question else []
    caption = (
        "Internal energies of all runs, with the tr of each, the common one and td"
    )
    head, rows = study.build_run_table(answer)
    return build_document(
        f"Switch times of {format_number_of_runs(len(answer.runs))}",
        page.build_front(
            [_build_common_card(answer)],
            build_steps(steps),
            build_remarks(map(_add_meaning, answer.cautions)),
            build_pairs([*_list_below_card(answer), *study.list_run_reasons(answer)]),
        ),
        _build_figure("runs-", caption, "study", answer, page=True),
        build_section(
            "Runs",
            build_scrolling_table(
                "Runs",
                *select_known_columns([name.replace("+-", "±") for name in head], rows),
            ),
        ),
        build_section(
            "Files", build_scrolling_table("Files", _FILES, _list_input_files(answer))
        ),
        *page.build_method(command),
        signed=page.CHECKED,
    )


def _add_meaning(caution: Caution) -> Caution:
    """Add to a warning about several runs, which names only these runs, what the warning means for each of them."""
    if caution.code not in EXPLANATIONS:
        return caution
    means = EXPLANATIONS[caution.code].means.partition(". ")[0].rstrip(".")
    return caution._replace(message=f"{caution.message}. {means}.")


def _list_below_card(answer: StudyOfRuns) -> Sequence[tuple[str, str]]:
    """Return the results common to all runs, except those on the card of the common tr."""
    return study.list_outcome(answer)[1:]


def _build_common_card(answer: StudyOfRuns) -> Markup:
    tr = answer.common.tr
    title = make_element("h2", "One tr for all runs")
    if tr is None:
        return make_element(
            "div",
            title,
            make_element("p", "None: ", answer.common.reason or ""),
            class_="card",
        )
    times = [make_element("span", make_element("i", "tr"), f"{tr:.6g}")]
    if answer.td is not None:
        times.append(make_element("span", make_element("i", "td"), f"{answer.td:.6g}"))
    exact = f"in full: tr = {tr!r}" + (
        "" if answer.td is None else f", td = {answer.td!r}"
    )
    verdict = VERDICTS[answer.grade or POOR]
    (_, outcome), *_ = study.list_outcome(answer)
    kind = page.CLASSES[verdict]
    lines = (
        make_element("div", *times, class_="times"),
        make_element("p", outcome),
        make_element("p", exact, class_="soft"),
    )
    badge = make_element(
        "h2",
        "One tr for all runs: ",
        make_element("span", verdict, class_=f"badge {kind}"),
    )
    return make_element("div", badge, *lines, class_=f"card {kind}")


def _list_input_files(answer: StudyOfRuns) -> list[tuple[Cell, ...]]:
    """Return a row for each input file, in the order of the runs; a run without files has one row."""
    from datetime import UTC, datetime

    rows: list[tuple[Cell, ...]] = []
    for row in answer.runs:
        if not row.files:
            rows.append((row.source, None, None, "none could be read"))
        for stamp in row.files:
            written = datetime.fromtimestamp(stamp.mtime_ns / 1e9, UTC)
            # Other hyphens and blanks would break the time into several lines.
            time = f"{written:%Y\u2011%m\u2011%d\u00a0%H:%M:%S}"
            rows.append((row.source, time, round(stamp.size / _KILOBYTE), stamp.name))
    return rows


def parts_page(
    answer: Parts,
    command: Sequence[str],
    question: RepeatedQuestion | None = None,
) -> str:
    """Write the page of ``parts``; ``command`` contains the arguments that reproduce the answer.

    ``question`` has the words of the next command; without them the page names none.
    """
    steps = parts.list_next_step(answer, question) if question else []
    if answer.sets:
        sets = [
            build_section(
                "Sets",
                _build_starred_table(
                    "Sets", *parts.build_set_table(answer, parts.SETS)
                ),
            )
        ]
    else:
        sets = []
    tables = {
        name: remove_star_column(*parts.build_part_table(answer, columns))
        for name, columns in parts.TABLES.items()
    }
    weights = [("weights", answer.weights.source)] if answer.weights else []
    remarks = parts.list_page_remarks(answer)
    if answer.inventory:
        deck = page.list_deck_digests(answer.inventory.files, answer.weights)
    else:
        deck = []
    return build_document(
        f"Parts to switch: {page.get_title(answer.files)}",
        page.build_front(
            [_build_set_card(answer)],
            build_steps(steps),
            build_remarks(answer.cautions),
        ),
        *sets,
        *(
            build_section(name, build_scrolling_table(name, *cells))
            for name, cells in tables.items()
            if answer.rows
        ),
        *([build_section("What to know", build_pairs(remarks))] if remarks else []),
        build_section(
            "What was read",
            build_pairs(
                [
                    *parts.list_heading(answer),
                    *weights,
                    *page.list_digests(answer.files.files),
                    *deck,
                ]
            ),
        ),
        page.build_command(command),
        signed=page.SIGNED,
    )


def _build_set_card(answer: Parts) -> Markup:
    best = answer.recommended
    if best is None:
        return _build_card_without_set(answer)
    saved = make_element(
        "span",
        make_element("i", "saves about"),
        f"{best.saving:.0%}",
        make_element("i", " of the CPU time"),
    )
    name = f"Parts {parts.format_part_ranges(best.parts)}, {parts.name_set(best)}: "
    decision = best.decision
    if decision is None or best.window is None:
        why = Markup()
        title, class_ = name, "card chosen"
    else:
        (_, times), *why_and_cure = list_verdict_lines(decision, *best.window)
        why = build_pairs([("times", times), *why_and_cure])
        title = join([name, page.build_badge(decision)])
        class_ = f"card {page.CLASSES[decision.verdict]}"
    return make_element(
        "div",
        make_element("h2", title),
        make_element("div", saved, class_="times"),
        why,
        class_=class_,
    )


def _build_card_without_set(answer: Parts) -> Markup:
    """Return the card that says, as the terminal does, that no part is known to be suitable, and why."""
    lines = build_pairs(parts.list_verdict_on_set(answer))
    if answer.inventory is None:
        title, class_ = "unknown", "card"
    else:
        title, class_ = "nothing to use", "card refused"
    badge = make_element("span", title, class_=class_.replace("card", "badge"))
    return make_element("div", make_element("h2", badge), lines, class_=class_)


def drive_page(answer: Driven, command: Sequence[str]) -> str:
    """Write the page of ``drive``; ``command`` contains the arguments that repeat the run."""
    from d2rpick.histories.names import Selection

    history = answer.run.history(Selection(parts=tuple(map(str, answer.deck.parts))))
    switched = [window for window in answer.windows if not window.reason]
    contacts = (
        "none to the end" if window.contact is None else f"{window.contact:.6g}"
        for window in switched
    )
    cards = [
        page.build_pair_card(
            f"Window {number}",
            (window.tr, window.td),
            build_pairs([("contact", text)]),
            history,
            "card chosen",
        )
        for number, (window, text) in enumerate(
            zip(switched, contacts, strict=True), start=1
        )
    ]
    cards = cards or [make_element("p", "No flight was switched.")]
    caption = "Internal energy while the parts are deformable, with the rigid windows; while rigid it means nothing"
    flights = [(window.free, window.contact or window.td) for window in switched]
    rigid = [(window.tr, window.td) for window in switched]
    return build_document(
        f"First run: {answer.deck.name}",
        page.build_front(
            cards,
            build_remarks(answer.cautions),
            build_pairs(
                [*drive.list_verdict_lines(answer), *drive.list_savings(answer)]
            ),
        ),
        _build_figure("driven-", caption, "run", history, flights, rigid),
        build_section(
            "Evidence",
            build_scrolling_table("Windows", *drive.list_window_rows(answer)),
        ),
        build_section(
            "Cost", build_scrolling_table("Legs", *drive.list_leg_rows(answer))
        ),
        build_section(
            "What was read", build_pairs(page.list_digests(answer.run.files))
        ),
        page.build_command(command),
        signed=page.CHECKED,
    )


def give_sentence(kind: str, answer: Any) -> str:
    """Return an answer in one sentence."""
    return ": ".join(filter(None, _LOOKS[kind][0](answer)[0]))


def summarise_files(run: OpenedRun) -> str:
    """Return a summary of a run's files, format, states, times and parts, as far as the files can be read."""
    first = run.databases[0]
    time = give_if_readable(lambda: first.time if first.channels else first.part_time)
    facts = [" + ".join(database.format for database in run.databases)]
    if time is not None and time.size:
        facts += [
            f"{time.size} states",
            f"{time[0]:.6g} to {time[-1]:.6g} {first.time_unit}".rstrip(),
        ]
    facts += [f"{len(run.parts)} part{'s' * (len(run.parts) > 1)}"] if run.parts else []
    return f"{', '.join(map(repr, run.sources))}: {', '.join(facts)}"


def show_at_a_glance(kind: str, answer: Any, figure: Figure | None) -> str:
    """Return an answer, or the overview of a run, as HTML for a notebook; columns without known values are omitted."""
    give_sentences, table = _LOOKS[kind]
    lines = [
        make_element("div", make_element("b", name), f" {text}")
        for name, text in give_sentences(answer)
    ]
    head, rows = table(answer)
    lines += [build_grid(*select_known_columns(head, rows[:_FEW_ROWS]))] if rows else []
    lines += (
        [make_element("div", f"... and {len(rows) - _FEW_ROWS} more")]
        if len(rows) > _FEW_ROWS
        else []
    )
    if kind in _REASONS:
        lines += [
            make_element("div", f"{number} {reason}")
            for number, reason in _REASONS[kind](answer)
        ]
    return make_element("div", *lines, *([_build_picture(figure)] if figure else []))


def _build_picture(figure: Figure) -> Markup:
    from d2rpick.report.figures import render_svg_element

    return make_element(
        "div", Markup(render_svg_element(figure, "glance-")), style=_WIDEST
    )


def _select_known_facts(facts: Iterable[tuple[str, Cell]]) -> list[tuple[str, Cell]]:
    """Return only the facts with known values."""
    return [fact for fact in facts if fact[1] is not None]
