"""Write the result of ``explore`` as a table, JSON, CSV and Markdown."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from d2rpick.base.errors import make_printable
from d2rpick.choice.pair.quality import EQUALLY_GOOD
from d2rpick.report import keys, tables
from d2rpick.report.decision import format_in_short, list_verdict_lines
from d2rpick.report.fields import Document, Field, many, maybe, row, write_csv
from d2rpick.report.situation import describe_input

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from d2rpick.choice.td.trade_off import Offer, TradeOff
    from d2rpick.report.formats import DisplayOptions

OFFER: Final = row(
    Field("td", "number"),
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
    Field("basis", keys.BASIS),
    Field("energy_td", "number"),
    Field("kinetic_share", maybe(keys.SHARE)),
    *(field._replace(kind=maybe(field.kind)) for field in keys.CANDIDATE.of_part(
        lambda offer: offer.best, ("kind", *keys.MEASURES, "tr_low", "tr_high", "same_swing"))),
    Field("reason", "text?", "reason why no tr is recommended", lambda offer: offer.answer.why_none or None),
    Field("acceptable_windows", maybe(many(keys.WINDOW)), "admissible tr ranges, if the basis is energy",
          lambda offer: offer.answer.windows),
    keys.EXPECTED._replace(get=lambda offer: offer.answer.expected),
)  # fmt: skip
# columns of the CSV output and of a data frame
COLUMNS: Final = [
    key for key in OFFER.keys if key not in ("acceptable_windows", "expected")
]


# A smaller relative change of the rigid time is not mentioned.
_NO_CHANGE: Final = 5e-4
# An error that falls to a share within these limits is described as halved.
# If it falls further, its new value is given.
_HALF: Final = (0.45, 0.5)


# Columns that are omitted first if the table would be too wide.
_SPARE: Final = (
    "timing tolerance",
    "level error",
    "of simulated time",
    "peak",
    "kinetic fraction",
)

_NONE_BETTER: Final = "No other td in the range is better."
_NOT_HALVED: Final = "No other td in the range halves this error without giving up more than half of the rigid time."


def as_table(trade_off: TradeOff, display: DisplayOptions) -> str:
    """Return the answer in one sentence, the verdict on the best pair, the Pareto-optimal offers, and the input."""
    listed_offers = select_offers(trade_off, display.limit)
    if listed_offers:
        offered = tables.as_text(
            *tables.select_known_columns(*build_offer_table(listed_offers)),
            display.width,
            _SPARE,
        )
    else:
        offered = "nothing to offer"
    low, high = trade_off.td_window
    window = f"{len(trade_off.offers)} times from {low:.6g} to {high:.6g}"
    lines = [
        make_printable(give_answer(trade_off)),
        *tables.format_in_line(list_offer_verdict(trade_off)),
        "",
        offered,
    ]
    hidden_count = len(trade_off.offers) - len(listed_offers)
    if hidden_count:
        lines.append(f"... and {hidden_count} more td (--limit; csv and json have all)")
    input_lines = [
        ("history", describe_input(trade_off.situation.history)),
        ("td", window),
    ]
    return "\n".join([*lines, "", *tables.format_in_line(input_lines)])


def list_offer_verdict(trade_off: TradeOff) -> list[tuple[str, str]]:
    """Return what to do with the recommended pair, why, and how to improve it, as (name, text) pairs."""
    best = trade_off.recommended
    decision = trade_off.decide_on(best) if best else None
    if best is None or best.best is None or decision is None:
        return [("no pair to use", _explain_why_no_pair(trade_off))]
    (verdict, times), *others = list_verdict_lines(decision, best.best.tr, best.td)
    return [(verdict, f"{times}, the best pair of the range"), *others]


def as_markdown(trade_off: TradeOff, display: DisplayOptions) -> str:
    """Return the offers of the text table as a Markdown table, with the answer below it."""
    offer_table = tables.select_known_columns(
        *build_offer_table(select_offers(trade_off, display.limit))
    )
    paragraphs = [
        tables.escape_markdown(give_answer(trade_off)),
        *tables.format_as_list(list_offer_verdict(trade_off)),
    ]
    return "\n\n".join([*paragraphs, tables.as_markdown(*offer_table)])


def as_csv(trade_off: TradeOff, _: DisplayOptions) -> str:
    """Return CSV with all offers and a column for each key of ``offers`` in the JSON output that is a single value."""
    return write_csv(COLUMNS, map(OFFER.plain, trade_off.offers))


def give_answer(trade_off: TradeOff) -> str:
    """Return in one sentence how good the requested td is, and the gain or cost of another td.

    Without a requested td, other td are compared with the td that saves most.
    """
    start = trade_off.start
    step = trade_off.step
    unit = trade_off.situation.history.time_unit
    if start is None:
        return "no td in the range has an admissible tr"
    start_text = f"td = {start.td:.6g}"
    if not trade_off.requested:
        start_text += f" {_describe_longest(start)}"
    if start.best is None:
        quality_text = f"{start_text} has no admissible tr"
        return (
            quality_text
            if step is None
            else f"{quality_text}; {_describe_distance(start, step, unit)} has one"
        )
    if not trade_off.requested:
        quality_text = f"{start_text}, {_format_offer_error(start)}"
    else:
        quality_text = f"{start_text}: {_format_offer_error(start)}"
    if step is None:
        small = start.error is not None and start.error <= EQUALLY_GOOD
        return f"{quality_text}. {_NONE_BETTER if small else _NOT_HALVED}"
    distance = _describe_distance(start, step, unit)
    error_change = _describe_error_change(start, step)
    cost_change = _describe_cost_change(start, step)
    return f"{quality_text}; {distance} {error_change} and {cost_change}"


DOCUMENT: Final = Document("d2rpick/explore/1", "Answer of d2rpick explore; times in the unit of the history.", row(
    *keys.FRAME,
    Field("td", "number?", "given td", lambda trade_off: trade_off.requested and trade_off.requested.td),
    Field("td_window", "span",
          "range in which td was explored: the given range, or the longest flight up to the margin before the contact"),
    *keys.MECHANICS.of_part(lambda trade_off: trade_off.situation, ("flight", "oscillator", "modes")),
    Field("answer", "text", "summary of the answer in one sentence", give_answer),
    Field("recommended", maybe(keys.TIMES)),
    Field("start", "number?",
          "td with which the others are compared: the given td, otherwise the td with the largest saving",
          lambda trade_off: trade_off.start and trade_off.start.td),
    Field("step", "number?",
          "nearest td with at most half of the error at start and at least half of its rigid time: an energy peak, "
          "otherwise a Pareto-optimal td, otherwise the recommended td if its error is smaller",
          lambda trade_off: trade_off.step and trade_off.step.td),
    Field("offers", many(OFFER),
          "evenly spaced values of td, the peaks of the energy, the given td and the recommended td, by ascending td"),
))  # fmt: skip


def _explain_why_no_pair(trade_off: TradeOff) -> str:
    """Explain why no td has a pair, by the example of the td with the highest energy, which could keep most."""
    if not trade_off.offers:
        return "no td in the range has an admissible tr"
    highest = max(trade_off.offers, key=lambda offer: offer.energy_td)
    return f"no td in the range has an admissible tr; td = {highest.td:.6g}: {highest.answer.why_none}"


def _describe_longest(start: Offer) -> str:
    """Describe in which respect the td with which others are compared exceeds them."""
    return "is rigid for longest" if start.saving is None else "saves the most CPU time"


def _describe_distance(start: Offer, step: Offer, unit: str) -> str:
    """Describe how far away the other td is, with its value."""
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
    """Describe how the CPU time changes at the other td, or the rigid time if the cost of the parts is unknown."""
    if start.saving is not None and step.saving is not None:
        longer = start.saving - step.saving
        if abs(longer) < _NO_CHANGE:
            return "costs no CPU time"
        return f"{'costs' if longer > 0 else 'saves'} {abs(longer):.1%} of the reference's CPU time"
    assert start.rigid_time is not None
    assert step.rigid_time is not None
    change = step.rigid_time / start.rigid_time - 1
    if abs(change) < _NO_CHANGE:
        return "costs no rigid time"
    if change < 0:
        return f"costs {-change:.1%} of the rigid time"
    return f"makes the rigid time {change:.1%} longer"


def _format_offer_error(offer: Offer) -> str:
    """Return the error of an offer with its name."""
    if offer.error is None:
        return "an energy above twice its mean"
    if offer.basis == "energy":
        return (
            f"error {tables.format_measure(offer.error)} (shortfall of the level at td)"
        )
    return f"residual {tables.format_measure(offer.error)}"


def select_offers(trade_off: TradeOff, limit: int) -> list[Offer]:
    """Return up to ``limit`` offers: those that the answer names, and evenly spaced Pareto-optimal ones."""
    named_td = {
        offer.td
        for offer in (
            trade_off.requested,
            trade_off.recommended,
            trade_off.start,
            trade_off.step,
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
    offers: Sequence[Offer],
) -> tuple[list[str], list[list[tables.Cell]]]:
    """Return the column names and cells of the offers; the recommended offer has a star."""
    return tables.fill_table(_COLUMNS, offers)


def _make_getter_of_best(key: str, form: str) -> Callable[[Offer], tables.Cell]:
    """Return a function that formats a measure of an offer's best pair."""
    return lambda offer: (
        tables.format_if_known(getattr(offer.best, key), form) if offer.best else None
    )


_COLUMNS: Final[dict[str, Callable[[Offer], tables.Cell]]] = {
    "": lambda offer: "*" if offer.recommended else " ",
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
    "verdict": lambda offer: (
        format_in_short(offer.decision) if offer.decision else offer.answer.why_none
    ),
}
