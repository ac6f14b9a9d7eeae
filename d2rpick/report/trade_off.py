"""Write the result of ``explore`` as a table, JSON, CSV or Markdown."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from d2rpick.choice.pair.grades import DO_NOT_USE
from d2rpick.choice.pair.quality import EQUALLY_GOOD
from d2rpick.report import keys, tables
from d2rpick.report.decision import (
    format_with_number,
    is_refused,
    list_numbered_reasons,
    list_verdict_lines,
    number_reasons,
)
from d2rpick.report.fields import Document, Field, many, maybe, row, write_csv
from d2rpick.report.next_step import (
    add_step_to_copy,
    name_step_after_flight,
    name_step_after_refusal,
    name_step_with_pair,
    name_step_without_flight,
    write_command,
)
from d2rpick.report.situation import describe_input

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from d2rpick.choice.td.trade_off import Offer, TradeOff
    from d2rpick.report.formats import DisplayOptions, RepeatedQuestion

OFFER: Final = row(
    keys.TD,
    Field("peak", "flag", "true if the energy has a peak at td"),
    Field("tr", "number?", "tr that suggest recommends for td; null if there is none"),
    Field("error", "size?",
          "error by which the values of td are compared: the residual; if the basis is energy, 1 - sqrt(E(td) / (2 "
          "mean E)), or null if E(td) is above 2 mean E"),
    Field("unbeaten", "flag",
          "true if the pair is Pareto-optimal: no other td has a smaller error with at least the same rigid time, or "
          "a longer rigid time with at most the same error"),
    Field("recommended", "flag", "true for the pair that suggest recommends if td is not given"),
    *keys.QUALITY,
    *(keys.MECHANICS.field(key) for key in ("basis", "energy_td", "kinetic_share")),
    *(field._replace(kind=maybe(field.kind)) for field in keys.CANDIDATE.of_part(
        lambda offer: offer.best, ("kind", *keys.MEASURES, "tr_low", "tr_high", "same_swing"))),
    Field("reason", "text?", "reason why no tr is recommended", lambda offer: offer.answer.why_none or None),
    Field("acceptable_windows", maybe(many(keys.WINDOW)), "admissible tr ranges, if the basis is energy",
          lambda offer: offer.answer.windows),
    keys.EXPECTED._replace(get=lambda offer: offer.answer.expected),
)  # fmt: skip
# Columns of the CSV output and of data frames.
COLUMNS: Final = [
    key for key in OFFER.keys if key not in ("acceptable_windows", "expected")
]


# A relative change of the rigid time is mentioned if it is at least this [-].
_NO_CHANGE: Final = 5e-4
# Ratios of errors in this range are described as halving the error [-]; other ratios are given as numbers.
_HALF: Final = (0.45, 0.5)


# Columns that are omitted first if the table is too wide.
_SPARE: Final = (
    "timing tolerance",
    "level error",
    "of simulated time",
    "peak",
    "kinetic fraction",
)

# Error of a td if no model of the vibration is known, and its meaning.
_LEVEL_SHORTFALL: Final = "level shortfall"
_SHORTFALL_MEANS: Final = (
    "part of the largest deformation that is missing at td, judged by the energy alone; the vibration may be wrong by "
    "more"
)
_NONE_ADMISSIBLE: Final = "no td in the range has an admissible tr"
_NONE_BETTER: Final = "no other td in the range is better"
_NOT_HALVED: Final = "no other td in the range halves this error without giving up more than half of the rigid time"


def as_table(trade_off: TradeOff, display: DisplayOptions) -> str:
    """Return the verdict with alternatives, the Pareto-optimal pairs, the reasons for verdicts, and the input."""
    listed_offers = select_offers(trade_off, display.limit)
    if listed_offers:
        offered = tables.as_text(
            *tables.select_known_columns(*build_offer_table(listed_offers, trade_off)),
            display.width,
            _SPARE,
        )
    else:
        offered = "nothing to offer"
    low, high = trade_off.td_window
    window = f"{len(trade_off.offers)} times from {low:.6g} to {high:.6g}"
    lines = [
        *tables.format_in_line(
            (
                *list_answer_lines(trade_off),
                *list_next_step(trade_off, display.question),
            )
        ),
        "",
        offered,
        *tables.format_in_line(list_offer_reasons(listed_offers)),
    ]
    hidden_count = len(trade_off.offers) - len(listed_offers)
    if hidden_count:
        lines.append(
            f"... and {hidden_count} more values of td (raise --limit, or use -f csv or -f json)"
        )
    input_lines = [
        ("history", describe_input(trade_off.situation.history)),
        ("td", window),
    ]
    return "\n".join([*lines, "", *tables.format_in_line(input_lines)])


def list_answer_lines(trade_off: TradeOff) -> list[tuple[str, str]]:
    """Return what to do with the requested or chosen pair, why, and what another td would change, with names."""
    if trade_off.requested is None:
        return [
            *_list_verdict_of_chosen(trade_off),
            *list_costs_of_other_offers(trade_off),
        ]
    return [
        *_list_verdict_of_requested(trade_off, trade_off.requested),
        *_list_choice_if_td_is_free(trade_off, trade_off.requested),
    ]


def list_next_step(
    trade_off: TradeOff, question: RepeatedQuestion
) -> list[tuple[str, str]]:
    """Return the next command, which leads to the card of the requested or chosen pair, otherwise to a better pair."""
    offer = trade_off.shown
    decision = trade_off.decide_on(offer) if offer else None
    situation = offer.answer.situation if offer else trade_off.situation
    if offer is None or offer.tr is None or decision is None:
        if situation.flight.start is None:
            step = name_step_without_flight(situation.history, question)
        else:
            step = f"compare all flights with {write_command(question, 'plan')}"
    elif decision.verdict == DO_NOT_USE:
        if "--td-window" in question.times:
            otherwise = f"compare all flights with {write_command(question, 'plan')}"
        else:
            otherwise = name_step_after_flight(situation, decision, question)
        step = name_step_after_refusal(
            situation, decision.better, question, otherwise, decision
        )
    else:
        times = ("--td", f"{offer.td:.6g}")
        step = name_step_with_pair(
            trade_off.situation,
            (offer.tr, offer.td),
            decision.better,
            question._replace(times=times),
            "suggest",
        )
    return add_step_to_copy(trade_off.situation.history, [("next", step)])


def _list_verdict_of_chosen(trade_off: TradeOff) -> list[tuple[str, str]]:
    """Return the verdict on the pair that ``suggest`` chooses in the td range."""
    best = trade_off.recommended
    decision = trade_off.decide_on(best) if best else None
    if best is None or best.best is None or decision is None:
        return [("no pair to use", _explain_why_no_pair(trade_off))]
    verdict_lines = list_verdict_lines(decision, best.best.tr, best.td)
    return [(decision.verdict, _describe_offer(best)), *verdict_lines[1:]]


def _list_verdict_of_requested(
    trade_off: TradeOff, requested: Offer
) -> list[tuple[str, str]]:
    """Return the verdict on the best pair at the requested td, and the nearest better td."""
    decision = trade_off.decide_on(requested)
    if requested.best is None or decision is None:
        lines = [
            (
                "no pair to use",
                f"td = {requested.td:.6g}: {requested.answer.why_none}",
            )
        ]
    else:
        lines = list_verdict_lines(decision, requested.best.tr, requested.td)
    return [*lines, list_other_td(trade_off, requested)]


def list_other_td(trade_off: TradeOff, requested: Offer) -> tuple[str, str]:
    """Return what the nearest better td changes, as a (name, sentence) pair."""
    return ("other td", _describe_step(trade_off, requested))


def _list_choice_if_td_is_free(
    trade_off: TradeOff, requested: Offer
) -> list[tuple[str, str]]:
    """Return the pair that ``suggest`` chooses in the td range, unless it is that of the requested td."""
    best = trade_off.recommended
    if best is None or best is requested or best.decision is None:
        return []
    return [
        ("if td is free", f"{best.decision.verdict}: {_describe_offer(best)}"),
    ]


def list_costs_of_other_offers(trade_off: TradeOff) -> list[tuple[str, str]]:
    """Describe the drawbacks of a pair with a smaller error and of a pair with a longer rigid time.

    A pair that cannot be used is no alternative, so it stands only in the table.
    """
    best = trade_off.recommended
    if best is None:
        return []
    lines = []
    accurate = trade_off.more_accurate
    if accurate and not is_refused(accurate.decision):
        cost_text = _describe_cost_change(best, accurate)
        lines.append(("smaller error", f"{_describe_error_at(accurate)} {cost_text}"))
    longest = trade_off.start
    is_longer = longest and (longest.rigid_time or 0.0) > (best.rigid_time or 0.0)
    if longest and is_longer and not is_refused(longest.decision):
        cost_text = _describe_cost_change(best, longest)
        lines.append(("longest", f"{_describe_error_at(longest)} {cost_text}"))
    return lines


def _describe_offer(offer: Offer) -> str:
    """Describe a proposed pair by its times, its error and its rigid time."""
    times = f"tr = {offer.tr:.6g}, td = {offer.td:.6g}"
    return (
        f"{times}, {_format_offer_error(offer)}, rigid for {offer.rigid_time or 0:.6g}"
    )


def _describe_error_at(offer: Offer) -> str:
    """Return the beginning of a sentence that states the error of a proposed pair."""
    return f"td = {offer.td:.6g} with {_format_offer_error(offer)}"


def as_markdown(trade_off: TradeOff, display: DisplayOptions) -> str:
    """Return the lines and the pairs of the text table as Markdown, with the reasons for the verdicts above them."""
    listed_offers = select_offers(trade_off, display.limit)
    offer_table = tables.select_known_columns(
        *build_offer_table(listed_offers, trade_off)
    )
    reasons = tables.format_as_list(list_offer_reasons(listed_offers))
    return "\n\n".join(
        [
            *tables.format_as_list(
                (
                    *list_answer_lines(trade_off),
                    *list_next_step(trade_off, display.question),
                )
            ),
            *reasons,
            tables.as_markdown(*offer_table),
        ]
    )


def as_csv(trade_off: TradeOff, _: DisplayOptions) -> str:
    """Return CSV with a row for each td and a column for each scalar key of ``offers`` in the JSON output."""
    return write_csv(COLUMNS, map(OFFER.plain, trade_off.offers))


def give_answer(trade_off: TradeOff) -> str:
    """Return, in one sentence, the pair to use, or how good the requested td is and what another td changes."""
    requested = trade_off.requested
    if requested is None:
        return ": ".join(_list_verdict_of_chosen(trade_off)[0])
    if requested.best is None:
        quality_text = f"td = {requested.td:.6g} has no admissible tr"
    else:
        quality_text = f"td = {requested.td:.6g}: {_format_offer_error(requested)}"
    return f"{quality_text}; {_describe_step(trade_off, requested)}"


def _describe_step(trade_off: TradeOff, requested: Offer) -> str:
    """Describe what the nearest better td changes, or state that no td is better."""
    step = trade_off.step
    if step is None:
        small = requested.error is not None and requested.error <= EQUALLY_GOOD
        if requested.best is None:
            return _NONE_ADMISSIBLE
        return _NONE_BETTER if small else _NOT_HALVED
    distance = _describe_distance(
        requested, step, trade_off.situation.history.time_unit
    )
    if requested.best is None:
        return f"{distance} has an admissible tr"
    error_change = _describe_error_change(requested, step)
    cost_change = _describe_cost_change(requested, step)
    return f"{distance} {error_change} and {cost_change}"


DOCUMENT: Final = Document("d2rpick/explore/2", "Answer of d2rpick explore; times in the unit of the history.", row(
    *keys.FRAME,
    Field("td", "number?", "given td", lambda trade_off: trade_off.requested and trade_off.requested.td),
    Field("td_window", "span",
          "range in which td was explored: the given range or, up to the margin before the contact, the flight that "
          "contains td, else the longest flight"),
    *keys.MECHANICS.of_part(lambda trade_off: trade_off.situation, ("flight", "oscillator", "modes")),
    Field("answer", "text", "summary of the answer in one sentence", give_answer),
    Field("recommended", maybe(keys.TIMES), "recommended pair; null if there is none"),
    Field("start", "number?",
          "td with which the other values are compared: the given td or, if none is given, the td with the largest "
          "saving",
          lambda trade_off: trade_off.start and trade_off.start.td),
    Field("step", "number?",
          "td to which the answer points: the nearest energy peak with at most half of the error at start and at "
          "least half of the rigid time at start; if there is no such peak, the nearest Pareto-optimal td with these "
          "properties; otherwise the recommended td, if its error is smaller than the error at start; else null",
          lambda trade_off: trade_off.step and trade_off.step.td),
    Field("offers", many(OFFER),
          "evenly spaced values of td, the peaks of the energy, the given td and the recommended td, by ascending td"),
))  # fmt: skip


def _explain_why_no_pair(trade_off: TradeOff) -> str:
    """Explain why no td has an acceptable pair, with the td of the highest energy as an example."""
    if not trade_off.offers:
        return "no td in the range has an admissible tr"
    highest = max(trade_off.offers, key=lambda offer: offer.energy_td)
    return f"no td in the range has an admissible tr; td = {highest.td:.6g}: {highest.answer.why_none}"


def _describe_distance(start: Offer, step: Offer, unit: str) -> str:
    """Describe the distance of another td from the chosen td, and the pair at the other td."""
    apart = step.td - start.td
    size = f"{abs(apart):.2g} {unit}".rstrip()
    return f"{size} {'later' if apart > 0 else 'earlier'} (tr = {step.tr:.6g}, td = {step.td:.6g})"


def _describe_error_change(start: Offer, step: Offer) -> str:
    """Describe how the error changes at the other td."""
    assert start.error is not None or step.error is not None
    if start.error is None:
        return "brings the energy at td below twice its mean"
    assert step.error is not None
    halves = _HALF[0] * start.error <= step.error <= _HALF[1] * start.error
    return f"{'halves the error' if halves else 'cuts the error'} to {step.error:.3f}"


def _describe_cost_change(start: Offer, step: Offer) -> str:
    """Describe how the CPU time, or the rigid time if the cost of the parts is unknown, changes at the other td."""
    if start.saving is not None and step.saving is not None:
        longer = start.saving - step.saving
        if abs(longer) < _NO_CHANGE:
            return "needs the same CPU time"
        return f"needs {1 - step.saving:.1%} of the CPU time of the reference run instead of {1 - start.saving:.1%}"
    assert start.rigid_time is not None
    assert step.rigid_time is not None
    change = step.rigid_time / start.rigid_time - 1
    if abs(change) < _NO_CHANGE:
        return "costs no rigid time"
    if change < 0:
        return f"costs {-change:.1%} of the rigid time"
    if change >= 1:
        return f"makes the rigid time {change + 1:.3g} times as long"
    return f"makes the rigid time {change:.1%} longer"


def _format_offer_error(offer: Offer) -> str:
    """Return the name and the value of the error of a proposed pair, such as "residual 0.02"."""
    if offer.error is None:
        return "an energy above twice its mean"
    if offer.basis == "energy":
        return f"{_LEVEL_SHORTFALL} {tables.format_measure(offer.error)}"
    return f"residual {tables.format_measure(offer.error)}"


def select_offers(trade_off: TradeOff, limit: int) -> list[Offer]:
    """Return up to ``limit`` proposed pairs: those that the answer names, and evenly spaced Pareto-optimal pairs."""
    named_td = {
        offer.td
        for offer in (
            trade_off.requested,
            trade_off.recommended,
            trade_off.start,
            trade_off.step,
            trade_off.more_accurate,
        )
        if offer
    }
    best = [
        offer.td
        for offer in trade_off.offers
        if offer.unbeaten and offer.td not in named_td
    ]
    room = min(max(limit - len(named_td), 0), len(best))
    named_td.update(
        best[round((index + 0.5) * len(best) / room - 0.5)] for index in range(room)
    )
    return [offer for offer in trade_off.offers if offer.td in named_td]


def build_offer_table(
    offers: Sequence[Offer], trade_off: TradeOff
) -> tuple[list[str], list[list[tables.Cell]]]:
    """Return the column names and cells of the proposed pairs; a star marks the pair in the first line of the answer.

    `list_offer_reasons` explains the numbers beside the verdicts.
    """
    numbers = _number_offer_reasons(offers)
    first = trade_off.shown
    columns = {
        "": lambda offer: "*" if offer is first else " ",
        **{
            _name_errors(offers) if name == "error" else name: get
            for name, get in _COLUMNS.items()
        },
        "verdict": lambda offer: _format_verdict(offer, numbers),
    }
    return tables.fill_table(columns, offers)


def _name_errors(offers: Sequence[Offer]) -> str:
    """Return the name of the errors of the proposed pairs, or "error" if they differ in kind."""
    is_by_level = {offer.basis == "energy" for offer in offers}
    if len(is_by_level) > 1:
        return "error"
    return _LEVEL_SHORTFALL if True in is_by_level else "residual"


def list_offer_reasons(offers: Sequence[Offer]) -> list[tuple[str, str]]:
    """Return the meaning of the errors, and the reasons for the verdicts, each with its number in the table."""
    reasons = list_numbered_reasons(_number_offer_reasons(offers))
    if any(offer.basis == "energy" and offer.error is not None for offer in offers):
        return [*reasons, (_LEVEL_SHORTFALL, _SHORTFALL_MEANS)]
    return reasons


def _number_offer_reasons(offers: Sequence[Offer]) -> dict[str, int]:
    """Number the reasons why the proposed pairs are not rated higher."""
    return number_reasons(offer.decision for offer in offers if offer.decision)


def _format_verdict(offer: Offer, numbers: Mapping[str, int]) -> str:
    """Return the verdict on a proposed pair, with the number under which its reason is listed."""
    decision = offer.decision
    return format_with_number(decision, numbers) if decision else "no admissible tr"


def _make_getter_of_best(key: str, form: str) -> Callable[[Offer], tables.Cell]:
    """Return a function that formats a quantity of the best pair at a td."""
    return lambda offer: (
        tables.format_if_known(getattr(offer.best, key), form) if offer.best else None
    )


_COLUMNS: Final[dict[str, Callable[[Offer], tables.Cell]]] = {
    "td": lambda offer: offer.td,
    "peak": lambda offer: "peak" if offer.peak else "",
    "tr": lambda offer: offer.tr,
    "error": lambda offer: tables.format_measure(offer.error),
    "level error": lambda offer: tables.format_measure(
        offer.best.level_error if offer.best else None
    ),
    "kinetic fraction": lambda offer: tables.format_measure(offer.kinetic_share),
    "rigid for": lambda offer: offer.rigid_time,
    "of simulated time": _make_getter_of_best("rigid_fraction", ".1%"),
    "CPU time": _make_getter_of_best("run_time_share", ".0%"),
    "timing tolerance": _make_getter_of_best("timing_tolerance", ".1e"),
}
