"""Define the commands that choose times from one run: ``suggest``, ``explore``, ``verify``, ``parts``, ``plan``."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import click

from d2rpick.api.request import (
    CHOOSING,
    CHOOSING_FOR_SETS,
    MIN_MEAN_ENERGY,
    MIN_QUALITY,
    READING,
    Request,
    check_window,
    choose_time_or_window,
)
from d2rpick.base.errors import ArgumentError, DeckError, make_printable
from d2rpick.base.options import FRACTION, NOT_NEGATIVE, Option
from d2rpick.cli import options
from d2rpick.cli.options import (
    ANSWER,
    DECK,
    HISTORY,
    ONE_RUN,
    RESULT,
    WINDOW,
    WITH_RECOMMENDED,
)
from d2rpick.cli.output import (
    IN_WORDS,
    Output,
    VerdictOnPair,
    check_switched,
    open_with_output,
)
from d2rpick.cli.progress import show_computing, show_reading
from d2rpick.cli.values import CARDS
from d2rpick.report.formats import FORMATS, WrittenDeck

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping

    from d2rpick.api.asked import RunQuestion
    from d2rpick.api.cards import Cards
    from d2rpick.api.judged_cards import JudgedCard
    from d2rpick.api.plans import Plan
    from d2rpick.base.errors import Caution


@options.make_command
@options.make_time_option(
    "--td", "Switch back to deformable at this time.", instead_of=("td_window",)
)
@options.make_time_option(
    "--td-window",
    "Choose the time to switch back within this window.",
    instead_of=("td",),
    pair=True,
)
@options.add_options(
    "limit",
    *ONE_RUN,
    *ANSWER,
    **WITH_RECOMMENDED,
    min_quality=f"{MIN_QUALITY}  [default: fair; poor if only --td is given]",
    forms=[*FORMATS["suggestion"], "card"],
)
def suggest(
    td: float | None, td_window: WINDOW, request: Request, cards: Cards, output: Output
) -> None:
    """Rank the times tr at which the parts of HISTORY can be made rigid until td, or choose both times.

    If you omit --td, d2rpick chooses both times, in --td-window or in the longest flight.

    A candidate is a time before td at which the parts have nearly the same deformation as at td.  d2rpick judges each
    candidate by the vibration model that fits the record.  It recommends the best candidate and names a better td if
    there is one.

    Examples
    --------
    d2rpick suggest --part box sample_data/rolloverT01.gz
    d2rpick suggest --td 0.064 sample_data/energy.csv
    d2rpick suggest --td-window 0.06 0.07 sample_data/energy.csv
    d2rpick suggest --td 0.37 --energy boxIE_J sample_data/rollover.csv
    d2rpick suggest --td 0.064 -f json sample_data/energy.glstat
    d2rpick suggest --td 0.37 --part box -f card --node 1001 sample_data/rolloverT01.gz
    d2rpick suggest --td 0.064 --report report.html sample_data/energy.csv
    """
    from d2rpick.api.asked import ask_run
    from d2rpick.api.suggestions import suggest_for_question

    wanted = choose_time_or_window(td, td_window)
    card = output.output_format == "card"
    if card:
        check_switched("-f card", request, cards)
    output.check(cards)
    with open_with_output(request, output) as (run, output):
        question = ask_run(run, request, merge=cards.merge)
    with show_computing(quiet=output.quiet):
        answer = suggest_for_question(question, wanted)
    new_cautions = [
        caution
        for caution in answer.cautions
        if caution.code != "no-candidate" or output.output_format not in IN_WORDS
    ]
    output.notes(question.reference.history.notes, new_cautions)
    output.beside_answer(
        answer, lambda: answer.page(options.repeat_command(), request.judging(), cards)
    )
    judged_card = None
    if card:
        # Imported here to keep start-up fast.
        from d2rpick.api.judged_cards import collect_cautions

        judged_card = answer.printed(cards)
        if judged_card is None:
            new_cautions = []
        else:
            new_cautions = [
                caution
                for caution in collect_cautions(judged_card)
                if caution not in answer.cautions
            ]
        output.card(judged_card, new_cautions, question.repeated, request.deck)
        decision = judged_card.worst if judged_card else None
    else:
        times = options.write_times(td=td, td_window=td_window)
        output.answer(answer, question=question.repeated._replace(times=times))
        decision = answer.decision
        if (
            output.output_format == "value"
            and decision
            and not decision.reaches("fair")
        ):
            # The bare value does not contain the verdict.
            output.notes([f"{decision.verdict} this pair: {decision.reason}"], ())
    # The best pair for a given td is shown even if it is poor; the answer and the card then say so.
    min_quality = request.min_quality or ("poor" if td is not None else "fair")
    _finish_answer(output, question, decision, min_quality)
    output.finish(objection=bool(judged_card and judged_card.has_errors))


def _finish_answer(
    output: Output,
    question: RunQuestion,
    decision: VerdictOnPair | None,
    min_quality: str,
    introduction: str = "",
) -> None:
    """Exit with code 1 if the verdict is below ``min_quality``, or if a given deck was not used.

    The message on the verdict begins with the ``introduction``.
    """
    if question.unused_deck:
        output.finish_without_deck(question.unused_deck)
    output.finish_by_verdict(decision, min_quality, introduction)


@options.make_command
@options.make_time_option(
    "--td", "Switch-back time with which all other times are compared."
)
@options.make_time_option(
    "--td-window",
    "Explore the times to switch back within this window.  [default: the flight that contains --td, else the longest "
    "flight]",
    pair=True,
)
@options.make_click_option(
    "steps",
    Option(
        "Number of evenly spaced values of td; the peaks of the energy are added.",
        range(1, 100_001),
    ),
    default=200,
)
@options.add_options(
    *("limit", *ONE_RUN, *ANSWER),
    limit={
        "default": 10,
        "help": "Number of rows in the table of the best pairs; json and csv contain all pairs.",
    },
    **WITH_RECOMMENDED,
    forms=FORMATS["trade_off"],
)
def explore(
    td: float | None,
    td_window: WINDOW,
    steps: int,
    request: Request,
    cards: Cards,
    output: Output,
) -> None:
    """Show the best tr, the error and the rigid time for each td.

    d2rpick compares evenly spaced values of td, and every peak of the energy, in --td-window.  The default is the
    flight that contains --td, or otherwise the longest flight.  d2rpick judges each td as `suggest --td` does.  The
    table lists the Pareto-optimal pairs: any pair with a smaller error has a shorter rigid time, and any pair with a
    longer rigid time has a larger error.  d2rpick also names the nearest td with half the error.

    Examples
    --------
    d2rpick explore --td-window 0.06 0.07 sample_data/energy.csv
    d2rpick explore --td 0.064 --td-window 0.06 0.07 sample_data/energy.csv
    d2rpick explore --part box -f csv sample_data/rollover_box.matsum
    d2rpick explore --part recommended --deck sample_data/rollover_box.k sample_data/rollover_box.matsum
    d2rpick explore --part box --plot explore.png --report explore.html sample_data/rollover_box.matsum
    """
    from d2rpick.api.asked import ask_run
    from d2rpick.api.plans import explore_for_question

    check_window("td_window", td_window)
    output.check(cards)
    with open_with_output(request, output) as (run, output):
        question = ask_run(run, request, merge=cards.merge)
    with show_computing(quiet=output.quiet):
        answer = explore_for_question(question, td, td_window, steps)
    output.notes(question.reference.history.notes, answer.cautions)
    output.beside_answer(
        answer, lambda: answer.page(options.repeat_command(), request.judging(), cards)
    )
    times = options.write_times(td=td, td_window=td_window)
    output.answer(answer, question=question.repeated._replace(times=times))
    shown = answer.shown
    decision = shown.decision if shown else None
    _finish_answer(output, question, decision, question.settings.min_quality)


def _list_needs_of_pair(values: Mapping[str, Any]) -> Iterable[str]:
    """Yield the times that ``verify`` lacks."""
    if values.get("switched"):
        return
    times = [name for name in ("tr", "td") if values.get(name) is None]
    if times:
        names = " and ".join(f"--{name} T" for name in times)
        yield f"{names} (or --switched FILE, a finished switched run)"


@options.make_command_with_needs(_list_needs_of_pair)
@options.make_time_option(
    "--tr", "Switch to rigid at this time.  [default: read from the run of --switched]"
)
@options.make_time_option(
    "--td",
    "Switch back to deformable at this time.  [default: read from the run of --switched]",
)
@options.make_file_option(
    "--switched",
    "Compare a finished switched run with the reference run: file, folder or pattern; repeatable.",
    many=True,
)
@options.make_click_option(
    "min_mean_energy",
    Option(
        "Smallest allowed mean energy after td, relative to the reference run (allowed: E to 2 - E).",
        FRACTION,
        "E",
    ),
    default=MIN_MEAN_ENERGY,
)
@options.add_options(*ONE_RUN, *ANSWER, **WITH_RECOMMENDED, forms=FORMATS["verdict"])
def verify(
    tr: float | None,
    td: float | None,
    switched: tuple[str, ...],
    min_mean_energy: float,
    request: Request,
    cards: Cards,
    output: Output,
) -> None:
    """Judge one pair of switch times by the HISTORY of the reference run.

    With --switched, compare a finished switched run with the reference run, and judge the times at which it switched.

    Examples
    --------
    d2rpick verify --tr 0.0135867 --td 0.0687534 sample_data/energy.csv
    d2rpick verify --tr 0.1 --td 0.37 --energy boxIE_J -f json sample_data/rollover.csv
    d2rpick verify --tr 0.0135867 --td 0.0687534 --report report.html sample_data/energy.csv
    """
    from d2rpick.api.asked import ask_run, open_requested_run
    from d2rpick.api.suggestions import check_pair, judge_pair

    check_pair(tr, td, switched)
    output.check(cards)
    with open_with_output(request, output) as (run, output):
        question = ask_run(run, request, merge=cards.merge)
    switched_run = None
    if switched:
        with show_reading(switched, quiet=output.quiet):
            switched_run = open_requested_run(request, switched)
        output.spare(switched_run.sources)
    with show_computing(quiet=output.quiet):
        answer = judge_pair(question, tr, td, switched_run, min_mean_energy)
    output.notes(question.reference.history.notes, answer.cautions)
    output.beside_answer(
        answer, lambda: answer.page(options.repeat_command(), request.judging(), cards)
    )
    times = options.write_times(tr=tr, td=td, switched=switched)
    output.answer(
        answer,
        question=question.repeated._replace(times=times),
        page=output.report or "",
    )
    if answer.switched and answer.switched.objections:
        output.finish_with_failed_comparison(is_incomplete=answer.is_incomplete)
    introduction = (
        "the comparison is within its limits, but " if answer.switched else ""
    )
    _finish_answer(
        output,
        question,
        answer.decision,
        question.settings.min_quality,
        introduction,
    )


@options.make_command
@options.make_time_option(
    "--tr", "Start of the window in which the sets are compared; needs --td."
)
@options.make_time_option(
    "--td",
    "End of the window in which the sets are compared.  [default: end of the longest flight]",
)
@options.add_options(
    *(
        "deck",
        "no_deck",
        "weights",
        HISTORY,
        *READING,
        *CHOOSING_FOR_SETS,
        "step_ratio",
        "report",
        *RESULT,
    ),
    deck=f"{DECK}.",
    step_ratio="Time step while the parts are rigid, divided by the time step before; at least 1.",
    report="Write everything to one HTML page to read and sign.",
    forms=FORMATS["parts"],
)
def parts(tr: float | None, td: float | None, request: Request, output: Output) -> None:
    """List which parts of a run may be switched, and how much CPU time various sets of parts save.

    Each part is listed with its elements, material, mass and energy, and a verdict with its reasons.  The sets of parts
    follow, each with the CPU time that it saves; one set is recommended.  --part adds a set.

    Examples
    --------
    d2rpick parts sample_data/rollover_box.matsum
    d2rpick parts --deck sample_data/rollover_box.k sample_data/rollover_box.matsum
    d2rpick parts --deck sample_data/rollover_box.k -f json sample_data/rollover_box.matsum
    d2rpick parts --deck sample_data/rollover_box.k --report parts.html sample_data/rollover_box.matsum
    """
    from d2rpick.api.costs import check_times, compare_parts

    check_times(tr, td)
    if request.energy:
        raise ArgumentError(
            "`energy` names one energy for the whole model; parts compares those of its parts"
        )
    with open_with_output(request, output) as (run, output):
        answer = compare_parts(run, request, tr, td)
    output.notes(run.notes, answer.cautions)
    output.beside_answer(answer, lambda: answer.page(options.repeat_command()))
    output.answer(answer, question=answer.question)
    best = answer.recommended
    output.finish(objection=best is None or not best.is_usable)


@options.make_command
@options.make_click_option("min_rigid", Option(
    "Shortest rigid window.  [default: 5% of the record; without this option, d2rpick also leaves out a window if it "
    "would shift a later window that is more than twice as long]",
    *(NOT_NEGATIVE, "T"),
))  # fmt: skip
@click.option(
    "--all", "every", is_flag=True,
    help="With -f value, -f card and --write-deck, write all windows, not only the windows of the next run.",
)  # fmt: skip
@options.make_file_option(
    "--done",
    "File with the windows in which HISTORY was switched, one line 'tr td' for each window.  d2rpick plans the later "
    "windows.",
)
@options.make_file_option(
    "--before",
    "Run from which the windows of --done were planned; d2rpick compares its landings with the landings in HISTORY; "
    "repeatable.",
    *("HISTORY",), many=True,
)  # fmt: skip
@options.make_file_option(
    "--write-deck",
    "Write a copy of --deck with the cards of the windows into this folder, and check it.",
    "DIR",
    kind="output",
)
@options.add_options(
    *(
        "deck",
        "no_deck",
        "weights",
        HISTORY,
        *READING,
        *CHOOSING,
        "plot",
        "report",
        *CARDS,
        *RESULT,
    ),
    **WITH_RECOMMENDED,
    forms=[*FORMATS["plan"], "card"],
)
def plan(
    min_rigid: float | None,
    every: bool,
    done: str | None,
    before: tuple[str, ...],
    write_deck: str | None,
    request: Request,
    cards: Cards,
    output: Output,
) -> None:
    """Plan the rigid windows of a run: tr and td of each flight, and the run in which each window can be used.

    The next run can use the windows up to and including the first window that freezes vibration energy, because this
    window shifts all later landings.  Plan the later windows from the switched run with --done.  The output of -f
    value, -f card and --write-deck then contains the finished and the new windows.  For a run of d2rpick drive, give
    its journal as --done.

    Examples
    --------
    d2rpick plan --part flying sample_data/rollover_box.matsum
    d2rpick plan --part flying -f value sample_data/rollover_box.matsum
    d2rpick plan --part flying -f card sample_data/rollover_box.matsum
    d2rpick plan --part flying --plot plan.png --report plan.html sample_data/rollover_box.matsum
    """
    from d2rpick.api.asked import ask_run, open_requested_run
    from d2rpick.api.plans import plan_for_question

    form = output.output_format
    _check_form(form, write_deck, every=every)
    _check_deck(request, cards, form, write_deck)
    output.check(cards, by_itself=bool(write_deck))
    with open_with_output(request, output, done, *before) as (run, output):
        question = ask_run(run, request, merge=cards.merge)
        if write_deck:
            _refuse_deck_of_another_model(question, request)
        earlier = open_requested_run(request, before) if before else None
    done_windows = options.read_windows_in(done) if done else ()
    with show_computing(quiet=output.quiet):
        answer = plan_for_question(question, min_rigid, done_windows, earlier)
    output.notes(answer.history.notes, answer.cautions)
    output.beside_answer(
        answer, lambda: answer.page(options.repeat_command(), (), cards)
    )
    judged_card = None
    if form == "card" or write_deck:
        judged_card = answer.printed(cards, every=every)
    checked, written = "", None
    if write_deck:
        checked, written = _write_and_check(judged_card, answer, write_deck, output)
    if checked and form != "table":
        click.echo(checked, err=True)
    passed = written is None or written.passed
    if form == "card":
        new_cautions = _select_new_cautions(judged_card, answer)
        passed &= output.card(
            judged_card, new_cautions, question.repeated, request.deck
        )
    else:
        if judged_card:
            output.notes(judged_card.card.notes, _select_unknown_by_check(judged_card))
            answer = replace(answer, fewest_cycles=judged_card.card.fewest_cycles)
        times = options.write_times(min_rigid=min_rigid, done=done, before=before)
        output.answer(
            answer,
            checked if form == "table" else "",
            every=every,
            question=question.repeated._replace(times=times),
            written_deck=written,
        )
        passed &= bool(answer.supported)
    if question.unused_deck:
        output.finish_without_deck(question.unused_deck)
    output.finish(objection=not passed)


def _select_new_cautions(card: JudgedCard | None, plan: Plan) -> list[Caution]:
    """Return the cautions about the card that the plan lacks, e.g. those about windows without a verdict."""
    if card is None:
        return []
    # Imported here to keep start-up fast.
    from d2rpick.api.judged_cards import collect_cautions

    failed = tuple(
        verdict
        for verdict in card.verdicts
        if not verdict.decision.reaches(verdict.situation.settings.min_quality)
    )
    return [
        caution
        for caution in collect_cautions(card._replace(verdicts=failed))
        if caution not in plan.cautions
    ]


def _select_unknown_by_check(card: JudgedCard) -> Iterator[Caution]:
    """Return the cautions about a card that the check of the deck with the card does not repeat."""
    # Imported here to keep start-up fast.
    from d2rpick.api.card_in_deck import NOT_SHOWN_BY_CHECK

    return (caution for caution in card.cautions if caution.code in NOT_SHOWN_BY_CHECK)


def _check_form(form: str, folder: str | None, *, every: bool) -> None:
    """Refuse ``--all`` for output that contains all windows anyway."""
    if every and form not in ("value", "card") and not folder:
        raise click.UsageError(
            "--all belongs to -f value, -f card and --write-deck; other forms hold every window"
        )


def _refuse_deck_of_another_model(question: RunQuestion, request: Request) -> None:
    """Raise DeckError if the deck that is to be copied does not belong to the model of the run."""
    for caution in question.cautions:
        if caution.code == "deck-of-another-model":
            raise DeckError(f"{request.deck}: {caution.message}")


def _check_deck(request: Request, cards: Cards, form: str, folder: str | None) -> None:
    """Before any file is opened, refuse to copy a deck that is not given or to write a card that switches no parts."""
    if folder is not None and request.deck is None:
        raise ArgumentError(
            "--write-deck needs `deck`, the deck that is copied with the cards"
        )
    if form == "card" or folder:
        check_switched("-f card" if form == "card" else "--write-deck", request, cards)


def _write_and_check(
    card: JudgedCard | None, plan: Plan, folder: str, output: Output
) -> tuple[str, WrittenDeck | None]:
    """Write the copy of the deck and check it against the history.

    Returns
    -------
    text : str
        The written files, and below them the output of ``check --history`` for the deck; or why no deck was written.
    written : WrittenDeck or None
        The folder, and whether the check found something; None if there is no card, because no window can be used.
    """
    from d2rpick.api.plans import write_planned_deck

    if card is None:
        text = f"no deck was written to {make_printable(folder)}, because no window can be used"
        return text, None
    names, checked = write_planned_deck(plan, card, folder, overwrite=output.overwrite)
    listed = [f"written  {make_printable(name)}" for name in names]
    written = WrittenDeck(folder, checked.passed, not checked.has_only_infos)
    text = checked.text("table", output.shown(written_deck=written))
    return "\n".join([*listed, "", text]), written
