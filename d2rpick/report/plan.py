"""Write the result of ``plan`` as a table, JSON, CSV, Markdown or bare values."""

from __future__ import annotations

from math import isinf
from typing import TYPE_CHECKING, Any, Final

from d2rpick.base.errors import list_names, make_printable
from d2rpick.choice.pair.grades import DO_NOT_USE, GOOD, USE, USE_WITH_CARE
from d2rpick.choice.td.plan import TOO_SHORT
from d2rpick.report import keys, tables
from d2rpick.report.decision import (
    format_accuracy,
    format_in_full,
    format_outlook,
    format_rigid_share,
    format_saved_share,
)
from d2rpick.report.fields import (
    Document,
    Field,
    get_kind,
    many,
    maybe,
    one_of,
    row,
    write_csv,
)
from d2rpick.report.next_step import (
    add_step_to_copy,
    name_lack_of_pairs,
    name_step_after_refusal,
    name_step_after_switched_run,
    name_step_to_card,
    name_step_to_deck,
    name_step_to_derived_margin,
    name_step_without_flight,
    name_way_out_of_run,
    needs_deck,
    write_command,
)
from d2rpick.report.situation import describe_input
from d2rpick.report.suggestion import describe_given_up_time

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    from d2rpick.choice.pair.decision import Decision
    from d2rpick.choice.pair.situation import Situation
    from d2rpick.choice.td.plan import PlannedFlight, RunPlan
    from d2rpick.report.formats import DisplayOptions, RepeatedQuestion, WrittenDeck


# Run in which the parts can be switched in a window, by status of the window.
_RUN: Final = {
    "supported": "next run",
    "re-plan": "later run",
    "done": "done",
    "left-out": "no run",
}

_BEST: Final = row(*keys.CANDIDATE.of_part(lambda planned: planned.candidate))
_POSITION: Final = (
    "position_error",
    "position_error_part",
    "position_error_body",
    "position_error_assumes",
)
# _OUT_OF_PLACE: name of the column with the position error.
# _SPARE: columns that are omitted first if the table is too wide.
_OUT_OF_PLACE: Final = "out of place"
# The error is never omitted, because it may decide whether a window of the verdict "use" suits the purpose.
_SPARE: Final = ("margin", "CPU time", _OUT_OF_PLACE, "rigid for")


def _get_time(row: PlannedFlight, at: int) -> float | None:
    return row.window[at] if row.window else None


def _get_situation(row: PlannedFlight) -> Situation | None:
    return row.answer.situation if row.answer and row.window else None


def _make_margin_getter(key: str) -> Callable[[PlannedFlight], Any]:
    """Return a function that reads an attribute of the `Margin` of a row; None if its window is already in the past."""
    return lambda row: None if row.done else getattr(row.margin, key)


WINDOW: Final = row(
    Field(
        "flight",
        get_kind("integer", minimum=1),
        "number of the flight in the record, starting at 1",
        lambda row: row.number,
    ),
    Field("flight_start", "number", "start of the flight", lambda row: row.start),
    Field(
        "flight_end",
        "number?",
        "time of the contact that ends the flight; null if the record ends in flight",
        lambda row: row.flight.end,
    ),
    Field(
        "flight_source",
        "text?",
        "evidence for the flight",
        lambda row: row.flight.source,
    ),
    Field(
        "certain",
        "flag",
        "true if the evidence for the flight rules out contacts and loads",
        lambda row: row.flight.certain,
    ),
    Field(
        "status",
        one_of("supported", "re-plan", "done", "left-out"),
        "when to use the window: in the next run (supported), in a later run (re-plan), already used (done), or not "
        "at all (left-out)",
    ),
    Field(
        "reason",
        "text?",
        "reason why the window is not supported; for a window that is done, what happened after it",
    ),
    Field(
        "tr",
        "number?",
        "time at which the parts become rigid; null without a window",
        lambda row: _get_time(row, 0),
    ),
    Field(
        "td",
        "number?",
        "time at which the parts become deformable again; null without a window",
        lambda row: _get_time(row, 1),
    ),
    Field("rigid_time", "number?", "td minus tr"),
    Field(
        "rigid_fraction", "number?", "rigid time as a fraction of the simulated time"
    ),
    _BEST.field("run_time_share")._replace(
        kind="number?",
        meaning="CPU time relative to the reference run, with this window alone; null if the cost is unknown",
    ),
    Field(
        "locks_in",
        "flag?",
        "true if the window freezes vibration energy, so that later landings shift",
    ),
    Field(
        "basis",
        maybe(keys.BASIS),
        "model of the vibration on which the choice is based",
        lambda row: (now := _get_situation(row)) and now.basis,
    ),
    _BEST.field("kind")._replace(kind=maybe(keys.KIND)),
    *(
        _BEST.field(key)._replace(kind="number?")
        for key in ("level_error", "lock_in_error", "residual")
    ),
    Field(
        "kinetic_share",
        "number?",
        "kinetic fraction K: fraction of the vibration energy that is kinetic at td",
        lambda row: (now := _get_situation(row)) and now.kinetic_share,
    ),
    Field(
        "margin",
        "number?",
        "margin before the contact; null for a window that is done",
        _make_margin_getter("time"),
    ),
    Field(
        "margin_source",
        maybe(one_of("given", "flight", "landing", "grazing", "no-contact")),
        "source of the margin: --margin (given), 3 % of the flight (flight), the shift that a switch may cause "
        "(landing), a grazing contact (grazing); no-contact if there is no next contact, and therefore no margin",
        _make_margin_getter("source"),
    ),
    Field(
        "landing_spread",
        "number?",
        "time by which a switch may shift the landing; null if unknown",
        _make_margin_getter("spread"),
    ),
    Field(
        "landing",
        "number?",
        "landing after a window that is done",
        lambda row: row.done and row.done.landing,
    ),
    Field(
        "landing_planned",
        "number?",
        "landing in the run from which the window was planned",
        lambda row: row.done and row.done.planned,
    ),
    *(_BEST.field(key) for key in _POSITION),
    keys.GRADE_OF_PAIR._replace(
        meaning="grade of the pair; null if there is no pair, or if the window is done"
    ),
    _BEST.field("position_error_is_lower_bound"),
    *keys.DECISION,
    *(
        _BEST.field(key)._replace(kind="number?", later=True)
        for key in ("timing_tolerance", "tr_low", "tr_high")
    ),
    closed=True,
)
DOCUMENT: Final = Document(
    "d2rpick/plan/1",
    "Answer of d2rpick plan; times in the unit of the history.",
    row(
        *keys.FRAME,
        Field("min_rigid", "number", "minimum length of a window"),
        Field(
            "windows",
            many(WINDOW),
            "one entry for each flight, in the order of time",
            lambda plan: plan.flights,
        ),
        Field(
            "rigid_time",
            "number",
            "sum of the rigid times of the windows whose status is supported",
        ),
        Field(
            "rigid_fraction",
            "number",
            "fraction of the simulated time that is rigid in the windows whose status is supported",
        ),
        Field(
            "run_time_share",
            "number?",
            "CPU time relative to the reference run, with the windows whose status is supported; null if the cost is "
            "unknown",
        ),
        Field(
            "fewest_cycles",
            "integer?",
            "smallest number of time steps of the written run, if the same maximum time step applies to the whole run, "
            "as with sensors; otherwise null",
        ),
    ),
)


def as_table(plan: RunPlan, display: DisplayOptions) -> str:
    """Return the plan in one sentence, the next command, a row per flight, and reasons with improvements."""
    rows = ""
    if plan.flights:
        known_columns = tables.select_known_columns(*build_flight_table(plan))
        rows = f"\n{tables.as_text(*known_columns, display.width, _SPARE)}\n"
    has_place_column = _OUT_OF_PLACE in rows.strip().partition("\n")[0]
    further = [] if has_place_column else _list_position_errors(plan)
    below = [*_list_judged_energy(plan), *list_flight_remarks(plan, further)]
    printable = [(name, make_printable(text)) for name, text in below]
    above = tables.format_in_line([("history", describe_input(plan.history))], 8)
    steps = tables.format_in_line(
        [
            *list_decisive_reasons(plan),
            *list_next_steps(plan, display.question, display.written_deck),
        ],
        4,
    )
    return "\n".join(
        [
            give_plan_sentence(plan),
            *steps,
            rows,
            *tables.format_in_line(printable, 9),
            *above,
        ]
    )


def give_plan_sentence(plan: RunPlan) -> str:
    """Return the recommended action in one sentence."""
    supported = [row for row in plan.supported if row.window]
    waiting = len(plan.all_windows) - len(supported)
    if not supported and plan.done:
        windows = list_names(["{:.6g} to {:.6g}".format(*times) for times in plan.done])
        return (
            f"{DO_NOT_USE} any window of this run: it was switched, with rigid parts from {windows}, and no later "
            "flight can be used"
        )
    if not plan.flights:
        return f"{DO_NOT_USE} any window of this run: no flight is found in the record"
    if not supported:
        return f"{DO_NOT_USE} any window of this run now"
    poor = [row for row in supported if _is_poor(row)]
    spans = _join_spans(row for row in supported if row not in poor)
    poor_spans = _join_spans(poor)
    use = _describe_use(plan)
    share = format_rigid_share(plan.rigid_fraction, plan.history)
    if not spans:
        return f"{use}: rigid {poor_spans}, {share}, is planned only because of `min_quality` poor"
    text = f"{use}: make the parts rigid {spans}"
    if poor:
        text += f"; {poor_spans} they are rigid only because of `min_quality` poor; together {share}"
    else:
        text += f", {share}"
    if plan.run_time_share is not None:
        text += f"; saves {format_saved_share(plan.run_time_share)}"
    if not waiting:
        return text
    more = (
        "1 more window requires" if waiting == 1 else f"{waiting} more windows require"
    )
    return f"{text}; {more} a new run"


def _join_spans(rows: Iterable[PlannedFlight]) -> str:
    """Return the rigid windows of flights in words; empty without flights."""
    windows = [row.window for row in rows if row.window]
    return " and ".join("from {:.6g} to {:.6g}".format(*window) for window in windows)


def _is_poor(row: PlannedFlight) -> bool:
    """Return True if the window of a flight should not be used."""
    return row.decision is not None and row.decision.verdict == DO_NOT_USE


def _describe_use(plan: RunPlan) -> str:
    """Describe how many windows can be used now, how many only with care, and how many cannot be used."""
    decisions = [(row.number, row.decision) for row in plan.supported if row.decision]
    if len(decisions) == 1:
        number, decision = decisions[0]
        which = f"flight {number}: " if len(plan.flights) > 1 else ""
        return f"{which}{decision.verdict}"
    careful, poor = (
        [number for number, decision in decisions if decision.verdict == verdict]
        for verdict in (USE_WITH_CARE, DO_NOT_USE)
    )
    limits = []
    if careful:
        limits.append(f"{_name_flights(careful)} with care")
    if poor:
        limits.append(f"{DO_NOT_USE} {_name_flights(poor)}")
    if len(poor) == len(decisions):
        return limits[0]
    which = f" ({'; '.join(limits)})" if limits else ""
    open_ones = sum(row.status != "done" for row in plan.flights)
    return f"use {len(decisions) - len(poor)} of {open_ones} windows now{which}"


def _uses_only_poor_windows(plan: RunPlan) -> bool:
    """Return True if every window of the plan is one that should not be used, as `min_quality` allows."""
    decided = [row for row in plan.supported if row.decision]
    return bool(decided) and all(map(_is_poor, decided))


def _list_decided_flights(plan: RunPlan) -> list[PlannedFlight]:
    """Return the flights on which the first sentence of a plan rests.

    These are the flights with a planned window or, if there is none, the longest flight that has a pair.
    """
    judged = [row for row in plan.flights if row.decision and not row.done]
    planned = [row for row in judged if row.status == "supported"]
    refused = [
        row for row in judged if row.reason and not row.reason.startswith(TOO_SHORT)
    ]
    longest = max(refused, key=lambda row: row.end - row.start, default=None)
    return planned or ([longest] if longest else [])


def list_decisive_reasons(plan: RunPlan) -> list[tuple[str, str]]:
    """Return the reasons for the first sentence of a plan, as (name, sentence) pairs; flights may share a reason."""
    decided = _list_decided_flights(plan)
    numbers_by_reason: dict[str, list[int]] = {}
    for flight in decided:
        if flight.decision:
            reason = flight.decision.reason
            numbers_by_reason.setdefault(reason, []).append(flight.number)
    if not decided and not plan.done and plan.flights:
        reasons = {row.reason: row.number for row in plan.flights if row.reason}
        if all(row.is_within_given_margin for row in plan.flights):
            longest = max(row.end - row.start for row in plan.flights)
            margin = plan.flights[0].margin.time
            cause = f"the margin {margin:.6g} is longer than every flight"
            return [
                ("why", f"{cause}; the longest lasts {longest:.6g} (`margin`)"),
            ]
        if all(reason.startswith(TOO_SHORT) for reason in reasons):
            shortest = f"the shortest window allowed is {plan.min_rigid:.3g}"
            return [("why", f"every flight is too short; {shortest} (`min_rigid`)")]
        return [
            ("why", f"flight {number}: {reason}") for reason, number in reasons.items()
        ]
    if len(plan.flights) == 1:
        return [("why", reason) for reason in numbers_by_reason]
    return [
        ("why", f"{_name_flights(numbers)}: {reason}")
        for reason, numbers in numbers_by_reason.items()
    ]


def _name_flights(numbers: Sequence[int]) -> str:
    plural = "s" if len(numbers) > 1 else ""
    return f"flight{plural} {', '.join(map(str, numbers))}"


def list_next_steps(
    plan: RunPlan,
    question: RepeatedQuestion,
    written_deck: WrittenDeck | None = None,
) -> list[tuple[str, str]]:
    """Return the next commands for the windows that can be used now, as (name, command) pairs.

    If the deck has already been written with the cards, the next step is to run it. If the files are cut, the first
    step is to copy them again.
    """
    steps = _list_steps_for_record(plan, question, written_deck)
    return add_step_to_copy(plan.history, steps)


def _list_steps_for_record(
    plan: RunPlan, question: RepeatedQuestion, written_deck: WrittenDeck | None
) -> list[tuple[str, str]]:
    """Return the next commands for the part of the run that was read."""
    is_refused = not plan.windows or _uses_only_poor_windows(plan)
    if is_refused and not written_deck:
        return _list_step_without_window(plan, question)
    waiting = any(row.status == "re-plan" for row in plan.flights)
    again = "; then plan the remaining flights from that run (--done)" * waiting
    if written_deck:
        folder = written_deck.folder
        times = _name_times_at_rest(plan)
        compare = write_command(question, "verify", *times, "--switched", folder)
        first = ""
        if not written_deck.passed:
            first = "correct what the check of the written deck found, then "
        elif written_deck.warned:
            first = "read the warnings of the check below, then "
        step = f"{first}run the deck in {folder} from t = 0{again}"
        return [("next", f"{step}. Compare the run with {compare}")]
    also = ", which also contain the windows that are done" if plan.done else ""
    cards = name_step_to_card(
        plan.history,
        plan.settings,
        plan.next_run,
        question,
        "plan",
        flying=any(row.flight.by_parts for row in plan.flights),
        action=f"print the cards{also}, add them to the deck, and run the deck from t = 0{again}. "
        "This prints the cards:",
    )
    chooses_parts = cards.startswith("choose")
    if not chooses_parts and (
        needs_deck(plan.history, plan.settings)
        or (plan.history.parts and "--deck" in question.options)
    ):
        return [("next", name_step_to_deck(question, again))]
    return [("next", cards)]


def _name_times_at_rest(plan: RunPlan) -> tuple[str, ...]:
    """Return the options with the first window of the next run, if nothing vibrates in it; otherwise no options.

    The energies of such a run do not show when its parts were rigid.
    """
    first = plan.supported[0]
    if plan.done or not (first.decision and first.decision.at_rest):
        return ()
    tr, td = plan.windows[0]
    return ("--tr", f"{tr:.6g}", "--td", f"{td:.6g}")


def _list_step_without_window(
    plan: RunPlan, question: RepeatedQuestion
) -> list[tuple[str, str]]:
    """Return the command to type next if no window of a plan can be used now."""
    rows = [row for row in plan.flights if row.answer and not row.done]
    is_partly_rigid = any(caution.code == "partly-rigid" for caution in plan.cautions)
    if plan.done or is_partly_rigid:
        return [("next", name_step_after_switched_run(question))]
    if not rows:
        if not plan.flights and not plan.history.complete:
            return []
        if not plan.flights:
            return [("next", name_step_without_flight(plan.history, question))]
        return [("next", _name_step_if_flights_are_short(plan, question))]
    answer = max(rows, key=lambda row: row.end - row.start).answer
    assert answer is not None
    better = answer.decision.better if answer.decision else None
    otherwise = name_way_out_of_run(answer.situation, answer.decision, question)
    step = name_step_after_refusal(
        answer.situation, better, question, otherwise, answer.decision
    )
    return [("next", step)]


def _name_step_if_flights_are_short(plan: RunPlan, question: RepeatedQuestion) -> str:
    """Return the step if no flight leaves the shortest rigid time: a shorter one or, if it was given, no switching.

    If a given margin leaves nothing of any flight, the step is to derive the margin.
    """
    is_margin_too_long = all(row.is_within_given_margin for row in plan.flights)
    if is_margin_too_long and "--margin" in question.options:
        return name_step_to_derived_margin(question)
    if "--min-rigid" in question.times:
        no_pair = name_lack_of_pairs(question)
        return f"{no_pair}: every flight is too short to switch parts in it"
    line = write_command(question, "plan", *question.times, "--min-rigid", "0")
    return f"plan shorter windows too with {line}"


def list_verdicts(plan: RunPlan) -> list[tuple[str, str]]:
    """Return the verdict, reason and expectation of the planned windows that do not preserve the vibration well.

    A window of the verdict "use" is among them if its vibration error is large, but small beside the next contact.
    """
    return [
        (f"flight {row.number}", format_in_full(row.decision))
        for row in plan.flights
        if row.window and row.decision and _needs_explanation(row.decision)
    ]


def _list_outlooks(plan: RunPlan) -> list[tuple[str, str]]:
    """Return the verdicts as `list_verdicts` does, but without the reasons that stand in the first lines."""
    explained = {row.number for row in _list_decided_flights(plan)}
    return [
        (
            f"flight {row.number}",
            format_outlook(row.decision)
            if row.number in explained
            else format_in_full(row.decision),
        )
        for row in plan.flights
        if row.window and row.decision and _needs_explanation(row.decision)
    ]


def _needs_explanation(decision: Decision) -> bool:
    """Return True unless the motion and the vibration of a pair are both good by themselves."""
    return bool(decision.cure) or decision.quality.alone.grade != GOOD


def _list_judged_energy(plan: RunPlan) -> list[tuple[str, str]]:
    """Return a line that names the energy of a plan, if the files show which parts fly but no part was chosen."""
    flies_by_parts = any(row.flight.by_parts for row in plan.flights)
    if plan.history.parts or not flies_by_parts:
        return []
    energy = make_printable(plan.history.channel)
    return [("judged", f"{energy}, not that of chosen parts (--part)")]


def as_markdown(plan: RunPlan, display: DisplayOptions) -> str:
    """Return the flights as a Markdown table and, below it, the saving and the reasons against windows."""
    below = tables.format_as_list(
        (
            *list_decisive_reasons(plan),
            *list_next_steps(plan, display.question, display.written_deck),
            *_list_judged_energy(plan),
            *list_flight_remarks(plan),
        )
    )
    return "\n\n".join(
        [
            tables.escape_markdown(give_plan_sentence(plan)),
            tables.as_markdown(*build_flight_table(plan)),
            *below,
        ]
    )


def list_flight_remarks(
    plan: RunPlan, further: Sequence[tuple[str, str]] = ()
) -> list[tuple[str, str]]:
    """Return the outlooks, remarks, reasons and ``further`` texts of a plan, in the order of the flights.

    Those of the whole run come last.
    """
    remarks = [
        *_list_outlooks(plan),
        *list_accuracies(plan),
        *list_plan_remarks(plan),
        *list_reasons(plan),
        *further,
    ]
    numbers = {f"flight {row.number}": row.number for row in plan.flights}
    return sorted(remarks, key=lambda remark: numbers.get(remark[0], len(numbers) + 1))


def list_accuracies(plan: RunPlan) -> list[tuple[str, str]]:
    """Return how exactly tr is known and has to be met, for each window of the next run, as (flight, text) pairs."""
    return [
        (f"flight {row.number}", f"tr = {row.candidate.tr:.6g}: {accuracy}")
        for row in plan.supported
        if row.candidate and (accuracy := format_accuracy(row.candidate))
    ]


def list_reasons(plan: RunPlan) -> list[tuple[str, str]]:
    """Return why windows are not supported, as (flight, sentence) pairs."""
    return [(f"flight {row.number}", row.reason) for row in plan.flights if row.reason]


def as_csv(plan: RunPlan, _: DisplayOptions) -> str:
    """Return CSV with one row per flight and a column for each key of ``windows`` in the JSON output."""
    return write_csv(WINDOW.keys, map(WINDOW.plain, plan.flights))


def as_value(plan: RunPlan, display: DisplayOptions) -> str:
    """Return a line ``tr td`` for each window of the next run, with the fewest digits that round-trip exactly.

    The windows of the next run are those that are done and the supported new windows or, on request, all new windows.
    Nothing is returned if there is no new window.
    """
    new = plan.all_windows if display.every else plan.windows
    return "\n".join(f"{tr!r} {td!r}" for tr, td in ((*plan.done, *new) if new else ()))


def list_plan_remarks(plan: RunPlan) -> list[tuple[str, str]]:
    """Return the rigid time given up for quality, and the position errors, as (name, sentence) pairs."""
    supported = plan.supported
    lines = []
    lines += [
        (f"flight {row.number}", describe_given_up_time(row.answer))
        for row in supported
        if row.answer and row.answer.longer and row.answer.recommended
    ]
    assumed = [
        row
        for row in plan.flights
        if row.candidate and row.candidate.position_error_assumes
    ]
    if assumed:
        deck_hint = "; `deck` shows which do" if plan.settings.bodies is None else ""
        listed = ", ".join(
            f"flight {row.number} by {_format_place_error(row)}" for row in assumed
        )
        lines.append(
            (
                "place",
                f"out of place at td if the parts become one rigid body: {listed}{deck_hint}",
            )
        )
    return lines


def _list_position_errors(plan: RunPlan) -> list[tuple[str, str]]:
    """Return the position errors other than 0 that the remarks do not mention, if the table has no column for them."""
    return [
        (f"flight {row.number}", f"out of place at td by {_format_place_error(row)}")
        for row in plan.flights
        if row.candidate
        and row.candidate.position_error
        and not row.candidate.position_error_assumes
    ]


def build_flight_table(plan: RunPlan) -> tuple[list[str], list[list[tables.Cell]]]:
    """Return the column names and cells of all flights; CPU time and position error appear only if they are known."""
    placed = any(
        row.candidate and row.candidate.position_error is not None
        for row in plan.flights
    )
    unknown = [
        *["CPU time"] * (plan.settings.cost_share is None),
        *[_OUT_OF_PLACE] * (not placed),
    ]
    return tables.fill_table(
        {name: cell for name, cell in _COLUMNS.items() if name not in unknown},
        plan.flights,
    )


def format_pair_error(row: PlannedFlight) -> str | None:
    """Return the name and value of the error of a window's pair, as text; None if it is unknown."""
    best = row.candidate
    if best is None:
        return None
    if best.kind == "start":
        return "nothing vibrates"
    if best.residual is None:
        name, size = ("level error", best.level_error)
    else:
        name, size = ("residual", best.residual)
    return f"{name} {tables.format_measure(size)}"


def _format_place_error(row: PlannedFlight) -> str | None:
    """Return the position error of a rigid body at td as text [length]."""
    best = row.candidate
    if best is None or best.position_error is None:
        return None
    bound_sign = ">= " if best.position_error_is_lower_bound else ""
    return f"{bound_sign}{best.position_error:.2g}"


def _get_verdict(row: PlannedFlight) -> str | None:
    """Return the verdict on the pair of a flight; None if the pair is usable but the flight has no window.

    A flight that is too short for a window has no other verdict.
    """
    if row.reason and row.reason.startswith(TOO_SHORT):
        return TOO_SHORT
    if row.decision is None:
        return None
    if row.window is None and row.decision.verdict == USE:
        return None
    return row.decision.verdict


_COLUMNS: Final[dict[str, Callable[[PlannedFlight], tables.Cell]]] = {
    "": lambda row: "*" if row.status == "supported" else " ",
    "flight": lambda row: row.number,
    "from": lambda row: row.start,
    "to": lambda row: "end of record" if row.flight.end is None else row.flight.end,
    "margin": lambda row: (
        "-" if row.done or isinf(row.margin.time) else f"{row.margin.time:.3g}"
    ),
    "tr": lambda row: _get_time(row, 0),
    "td": lambda row: _get_time(row, 1),
    "rigid for": lambda row: row.rigid_time,
    "CPU time": lambda row: tables.format_if_known(
        row.candidate.run_time_share if row.candidate else None, ".0%"
    ),
    "error": format_pair_error,
    _OUT_OF_PLACE: _format_place_error,
    "verdict": _get_verdict,
    "switch in": lambda row: _RUN[row.status],
}
