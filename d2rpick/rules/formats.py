"""D2R114, D2R115: times that were lost or mistaken in writing."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from d2rpick.deck.switching import BY_TIME
from d2rpick.rules.base import Example, Rule, Severity
from d2rpick.rules.example_decks import BACK, END, GOOD, HEAD, PARTS, THERE, automatic

if TYPE_CHECKING:
    from collections.abc import Iterator

    from d2rpick.deck.switching import Header, SwitchSet
    from d2rpick.rules.base import Case, Objection

THOUSAND = 1000.0
_FEW = 2  # cards: D2R102 and D2R105 say it already


def _timed(case: Case) -> list[tuple[SwitchSet, Header]]:
    return [
        (card, card.header)
        for card in case.sets
        if card.header and card.time is not None and card.header.code.value == BY_TIME
    ]


def _equal(case: Case) -> Iterator[Objection]:
    timed = _timed(case)
    times = {card.time for card, _ in timed}
    ways = {line.to_rigid for card, _ in timed for line in card.switched}
    inverted = any(window.td is not None and window.td <= window.tr for window in case.windows.windows)
    if len(times) != 1 or len(timed) < _FEW or len(ways) < 2 or (inverted and len(timed) == _FEW):
        return
    (time,) = times
    yield (
        timed[0][1].time1.field,
        (
            f"all {len(timed)} switching times of the deck are {time:g}, to rigid and back; were decimals lost? "
            "print them with more digits"
        ),
    )


def factor_of(times: list[float], end: float) -> float:
    """1000 or 1/1000 where all times multiplied by its inverse suit a run up to ``end``, and as they are do not.

    Times before the run, or at its start, suit it in any unit.
    """
    later = [time for time in times if time > 0]
    if not later:
        return 1.0
    latest, earliest = max(later), min(later)
    if earliest >= end and latest < THOUSAND * end:
        return THOUSAND if latest > 10 * end else 1.0
    return 1 / THOUSAND if end / 50 <= THOUSAND * latest < end else 1.0


def mistaken(factor: float) -> str:
    """Say which units seem to be mixed."""
    way = ("later", "milliseconds for seconds") if factor > 1 else ("earlier", "seconds for milliseconds")
    return f"about 1000 times {way[0]}: {way[1]}?"


def _thousand(case: Case) -> Iterator[Objection]:
    times = [card.time for card, _ in _timed(case) if card.time is not None]
    if case.end is None:
        return
    factor = factor_of(times, case.end)
    if factor != 1:
        found = f"the switching times reach {max(times):g} but the run ends at {case.end:g} (ENDTIM)"
        yield _timed(case)[0][1].time1.field, f"{found}, {mistaken(factor)} give both in the same unit"


def _pair(tr: str, td: str, more: str = "") -> Example:
    return Example(HEAD + PARTS + automatic(1, tr, rigid=["1"]) + automatic(2, td, deformable=["1"]) + more + END)


_SECOND: Final = automatic(3, "0.1", rigid=["2"]) + automatic(4, "0.1", deformable=["2"])

RULES: Final = (
    Rule(
        "D2R114",
        Severity.ERROR,
        "all switching times are equal (decimals lost in writing)",
        "Writers with one decimal make 0.0 of every time below 0.05, and 0.1 of 0.07 and 0.13. Cards that make parts "
        "rigid and cards that make them deformable, all at one time, are a sign of it. Source: a public drop tool "
        "wrote such decks.",
        _equal,
        (Example(GOOD), Example(HEAD + PARTS + THERE + automatic(3, "0.02", rigid=["2"]) + END)),
        (
            _pair("0.1", "0.1", _SECOND),
            Example(HEAD + PARTS + automatic(1, "0.0", rigid=["1"]) + automatic(2, "0.0", deformable=["2"]) + END),
        ),
    ),
    Rule(
        "D2R115",
        Severity.WARNING,
        "the switching times are about 1000 times the termination time, or a thousandth of it",
        "Seconds and milliseconds are mixed: the times would lie in the run if they were divided, or multiplied, by "
        "1000, and do not, or only in its first 1/1000. D2R101 reports times after the end too. Files name no "
        "units, so this is a guess by size.",
        _thousand,
        (Example(GOOD), Example(THERE + BACK), _pair("-0.01", "0.07"), _pair("-0.02", "-0.01"), _pair("0.0", "0.07")),
        (_pair("20.0", "90.0"), _pair("2.0e-5", "9.0e-5")),
    ),
)
