"""The answer of ``explore`` as table, JSON, CSV and Markdown."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from d2rpick.base.errors import make_printable
from d2rpick.choice.quality import EQUALLY_GOOD
from d2rpick.report import keys, tables
from d2rpick.report.decision import headed, in_short
from d2rpick.report.fields import Document, Field, csv_of, many, maybe, row
from d2rpick.report.situation import what_was_read

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from d2rpick.choice.trade_off import Offer, TradeOff
    from d2rpick.report.formats import Shown

OFFER: Final = row(
    Field("td", "number"),
    Field("peak", "flag", "the energy peaks at td"),
    Field("tr", "number?", "the tr that suggest recommends for td; null where it recommends none"),
    Field("error", "size?",
          "what offers are compared by: the residual; on basis energy 1 - sqrt(E(td) / (2 mean E)), null above "
          "2 mean E"),
    Field("unbeaten", "flag",
          "no other offer has less error and as much rigid time, or more rigid time and no more error"),
    Field("recommended", "flag", "the pair of suggest where td is chosen too"),
    *keys.QUALITY,
    Field("basis", keys.BASIS),
    Field("energy_td", "number"),
    Field("kinetic_share", maybe(keys.SHARE)),
    *(field._replace(kind=maybe(field.kind)) for field in keys.CANDIDATE.of_part(
        lambda offer: offer.best, ("kind", *keys.MEASURES, "tr_low", "tr_high", "same_swing"))),
    Field("reason", "text?", "why no tr is recommended", lambda offer: offer.answer.why_none or None),
    Field("acceptable_windows", maybe(many(keys.WINDOW)), "on basis energy: windows in which every tr is acceptable",
          lambda offer: offer.answer.windows),
    keys.EXPECTED._replace(get=lambda offer: offer.answer.expected),
)  # fmt: skip
# Columns of the csv and of a frame.
COLUMNS: Final = [
    key for key in OFFER.keys if key not in ("acceptable_windows", "expected")
]


# A change of the rigid time below this share is none that people read.
_NO_CHANGE: Final = 5e-4
# An error that falls to about this share of itself is halved; much further, it is as good as gone.
_HALF: Final = (0.45, 0.5)


# Columns that are left out first where the table would be too wide.
_SPARE: Final = (
    "timing tolerance",
    "level error",
    "of simulated time",
    "peak",
    "kinetic fraction",
)


def as_table(found: TradeOff, shown: Shown) -> str:
    """The answer in a sentence, the verdict on the best pair, some of the offers that nothing beats, what was read."""
    some = some_of(found, shown.limit)
    offered = (
        tables.as_text(*tables.known(*table(some)), shown.width, _SPARE)
        if some
        else "nothing to offer"
    )
    low, high = found.td_window
    window = f"{len(found.offers)} times from {low:.6g} to {high:.6g}"
    lines = [
        make_printable(answer(found)),
        *tables.in_line(verdict(found)),
        "",
        offered,
    ]
    left = len(found.offers) - len(some)
    if left:
        lines.append(f"... and {left} more td (--limit; csv and json have all)")
    read = [("history", what_was_read(found.situation.history)), ("td", window)]
    return "\n".join([*lines, "", *tables.in_line(read)])


def verdict(found: TradeOff) -> list[tuple[str, str]]:
    """What to do with the recommended pair, why, and what would be better."""
    best = found.recommended
    if best is None or best.best is None or best.decision is None:
        return [("no pair to use", "no td in the window has an acceptable tr")]
    return headed(best.decision, best.best.tr, best.td)


def as_markdown(found: TradeOff, shown: Shown) -> str:
    """The same offers as a Markdown table, and the answer below it."""
    some = tables.known(*table(some_of(found, shown.limit)))
    said = [tables.in_markdown(answer(found)), *tables.listed(verdict(found))]
    return "\n\n".join([*said, tables.as_markdown(*some)])


def as_csv(found: TradeOff, _: Shown) -> str:
    """All offers, a column for each key of ``offers`` in the JSON output that is a single value."""
    return csv_of(COLUMNS, map(OFFER.plain, found.offers))


_NOT_HALVED: Final = "has half of it and keeps half of the rigid time"


def answer(found: TradeOff) -> str:
    """The shortest sensible answer in a sentence: how good the td asked for is, and what a step to another one changes.

    Without a td that was asked for, the step begins at the one that saves most.
    """
    start, step, unit = found.start, found.step, found.situation.history.time_unit
    if start is None:
        return "no td in the window has an acceptable tr"
    named = f"td = {start.td:.6g}" + ("" if found.asked else " saves the most")
    if start.best is None:
        what = f"{named} has no acceptable tr"
        return what if step is None else f"{what}; {_away(start, step, unit)} has one"
    what = (
        f"{named}, {_error(start)}" if not found.asked else f"{named}: {_error(start)}"
    )
    if step is None:
        small = start.error is not None and start.error <= EQUALLY_GOOD
        return (
            f"{what}; no other td in the window {'is better' if small else _NOT_HALVED}"
        )
    return f"{what}; {_away(start, step, unit)} {_less(start, step)} and {_cost(start, step)}"


DOCUMENT: Final = Document("d2rpick/explore/1", "Answer of d2rpick explore; times in the unit of the history.", row(
    *keys.FRAME,
    Field("td", "number?", "the td that was asked for", lambda found: found.asked and found.asked.td),
    Field("td_window", "span",
          "where td was explored: the window asked for or the longest flight, less the margin before the contact"),
    *keys.MECHANICS.of_part(lambda found: found.situation, ("flight", "oscillator", "modes")),
    Field("answer", "text", "the shortest sensible answer", answer),
    Field("recommended", maybe(keys.TIMES)),
    Field("start", "number?",
          "td of the offer that the answer starts from: the one asked for, else the one that saves most",
          lambda found: found.start and found.start.td),
    Field("step", "number?",
          "the nearest unbeaten td with half the error of that, else the recommended one where it has less",
          lambda found: found.step and found.step.td),
    Field("offers", many(OFFER),
          "by ascending td: a grid, the peaks of the energy, the td asked for and the recommended one"),
))  # fmt: skip


def _away(start: Offer, step: Offer, unit: str) -> str:
    """Where the step leads."""
    apart = step.td - start.td
    size = f"{abs(apart):.2g} {unit}".rstrip()
    return f"{size} {'later' if apart > 0 else 'earlier'} (tr = {step.tr:.6g}, td = {step.td:.6g})"


def _less(start: Offer, step: Offer) -> str:
    """What the step does to the error."""
    assert start.error is not None or step.error is not None
    if start.error is None:
        return "brings the level below twice the mean energy"
    assert step.error is not None
    halves = _HALF[0] * start.error <= step.error <= _HALF[1] * start.error
    return f"{'halves the error' if halves else 'cuts the error'} to {step.error:.3f}"


def _cost(start: Offer, step: Offer) -> str:
    """What the step does to the run time, or to the rigid time where the cost of the parts is not known."""
    if start.saving is not None and step.saving is not None:
        longer = start.saving - step.saving
        if abs(longer) < _NO_CHANGE:
            return "costs no processor time"
        return f"{'costs' if longer > 0 else 'saves'} {abs(longer):.1%} of the reference's processor time"
    assert start.rigid_time is not None
    assert step.rigid_time is not None
    change = step.rigid_time / start.rigid_time - 1
    if abs(change) < _NO_CHANGE:
        return "costs no rigid time"
    return (
        f"costs {-change:.1%} of the rigid time"
        if change < 0
        else f"makes the rigid time {change:.1%} longer"
    )


def _error(one: Offer) -> str:
    """The error of an offer, with its name."""
    if one.error is None:
        return "a level above twice the mean energy"
    if one.basis == "energy":
        return f"error {tables.measure(one.error)} (shortfall of the level at td)"
    return f"residual {tables.measure(one.error)}"


def some_of(found: TradeOff, limit: int) -> list[Offer]:
    """Offers that the answer names, and evenly over those that nothing beats as many as make ``limit``."""
    named = {
        one.td
        for one in (found.asked, found.recommended, found.start, found.step)
        if one
    }
    best = [one.td for one in found.offers if one.unbeaten and one.td not in named]
    room = min(max(limit - len(named), 0), len(best))
    named.update(
        best[round((place + 0.5) * len(best) / room - 0.5)] for place in range(room)
    )
    return [one for one in found.offers if one.td in named]


def table(offers: Sequence[Offer]) -> tuple[list[str], list[list[tables.Cell]]]:
    """Give names of columns and cells of some offers; the recommended one has a star."""
    return tables.filled(_COLUMNS, offers)


def _of_best(key: str, form: str) -> Callable[[Offer], tables.Cell]:
    """Show a measure of the best pair of an offer."""
    return lambda one: tables.shown(getattr(one.best, key), form) if one.best else None


_COLUMNS: Final[dict[str, Callable[[Offer], tables.Cell]]] = {
    "": lambda one: "*" if one.recommended else " ",
    "td": lambda one: one.td,
    "peak": lambda one: "peak" if one.peak else "",
    "tr": lambda one: one.tr,
    "error": lambda one: tables.measure(one.error),
    "level error": lambda one: tables.measure(
        one.best.level_error if one.best else None
    ),
    "kinetic fraction": lambda one: tables.measure(one.kinetic_share),
    "rigid for": lambda one: one.rigid_time,
    "of simulated time": _of_best("rigid_fraction", ".1%"),
    "processor time": _of_best("run_time_share", ".0%"),
    "timing tolerance": _of_best("timing_tolerance", ".1e"),
    "verdict": lambda one: (
        in_short(one.decision) if one.decision else one.answer.why_none
    ),
}
