"""D2R1: the times of the windows; D2R2: windows held against the energy history of a run without switching."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final

from d2rpick.base.errors import name_units
from d2rpick.deck.switching import BY_SENSOR, BY_TIME, Header, SwitchSet, Window
from d2rpick.rules.base import BOTH, ERROR, WARNING, Case, Objection, grouped
from d2rpick.rules.rule import (
    BACK,
    END,
    GOOD,
    HEAD,
    PARTS,
    PASS,
    THERE,
    Example,
    automatic,
    deck,
    fails,
    passes,
    rule,
    window,
)

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence


_INTERVALS = (
    200  # output intervals per rigid window, for crossings to be found within 0.5 %
)
_ROUNDING = 1e-9
_DATABASES: Final = ("DATABASE_GLSTAT", "DATABASE_MATSUM")


_THOUSAND = 1000.0
_FEW = 2  # cards: D2R102 and D2R105 say it already
_SECOND: Final = automatic(3, "0.1", rigid=["2"]) + automatic(
    4, "0.1", deformable=["2"]
)


@fails(
    window("0.02", "0.2"),
    window("-0.02", "0.09"),
    Example(
        PARTS
        + automatic(1, "0.02", rigid=["1"], code=2).replace(
            "       0.0", "      0.01", 1
        )
        + END
    ),
)
@rule("D2R101", ERROR, "switch time outside [0, ENDTIM)")
def _in_run(case: Case) -> Iterator[Objection]:
    """TIME1 is the switching time for CODE 0 and the earliest one for CODE 1 to 4. At or after ENDTIM of
    *CONTROL_TERMINATION the switch never happens, and with CODE 1 to 4 not after TIME2 either.
    """
    for card, header in case.headers:
        if (
            header.code.problem
            or header.time1.problem
            or header.code.value == BY_SENSOR
        ):
            continue
        time = header.time1.value * card.card.transform.time
        if time < 0:
            yield (
                header.time1.field,
                f"TIME1 is {time:g}, a time from 0 on was expected",
            )
        elif case.end is not None and time >= case.end:
            found = f"TIME1 is {time:g} but the run ends at {case.end:g} (ENDTIM)"
            yield (
                header.time1.field,
                f"{found}, so nothing is ever switched; correct one of them",
            )
        latest = header.time2
        if (
            header.code.value != BY_TIME
            and not latest.problem
            and 0 < latest.value < header.time1.value
        ):
            problem = f"TIME2 is {latest.value:g}, before TIME1 ({header.time1.value:g}), so nothing is ever switched"
            yield latest.field, f"{problem}; a later time was expected, or 0 for no end"


def _closed(case: Case) -> dict[tuple[SwitchSet, SwitchSet], list[Window]]:
    """Windows with both ends, by the cards that open and close them."""
    return grouped(
        ((one.opened.by, one.closed.by), one)
        for one in case.windows.windows
        if one.closed is not None
    )


def _named(windows: Sequence[Window]) -> str:
    return name_units(one.unit.id for one in windows)


def _lost(one: Window) -> bool:
    return one.tr == 0 == one.td


@fails(window("0.09", "0.02"), window("0.02", "0.02"))
@rule("D2R102", ERROR, "switched back before (or when) it was switched to rigid", BOTH)
def _order(case: Case) -> Iterator[Objection]:
    """The R2D switch of a part must come after its D2R switch; the solver does not sort them for you."""
    for (opening, closing), windows in _closed(case).items():
        first = windows[0]
        together = (
            opening.kind == closing.kind == "restart"
            and opening.card.file == closing.card.file
        )  # D2R117
        if (
            first.td is not None
            and first.td <= first.tr
            and not _lost(first)
            and not together
        ):
            found = f"{_named(windows)} switched back at {first.td:g} but made rigid at {first.tr:g}"
            way_out = f"({opening.time_field.at}), an earlier time was expected there; are the two times swapped?"
            yield closing.time_field, f"{found} {way_out}"


@passes(PASS, window("0.0", "0.09"))
@fails(window("0.0", "0.0"))
@rule("D2R105", ERROR, "both times of a window are 0 (decimals lost in writing)")
def _zero(case: Case) -> Iterator[Objection]:
    """Writers that print times with one decimal turn everything below 0.05 into 0.0. Two sets that both switch at 0
    are a sign of it.
    """
    for (opening, closing), windows in _closed(case).items():
        if _lost(windows[0]) and opening.kind == "automatic":
            found = f"both times of {_named(windows)} are 0 (the other at {opening.time_field.at})"
            yield (
                closing.time_field,
                f"{found}; print times below 0.05 with more than one decimal",
            )


@passes(PASS, Example(THERE + BACK))
@fails(
    Example(PARTS + THERE + BACK + END),
    Example(GOOD.replace("    0.0001", "      0.01")),
)
@rule(
    "D2R111",
    WARNING,
    "without --history: *DATABASE_GLSTAT/_MATSUM missing, or DT above (td-tr)/200",
)
def _sampling(case: Case) -> Iterator[Objection]:
    """Switching times are chosen by the internal energy of a reference run: glstat holds it for the whole run,
    matsum for every part. Written too rarely, the energy at tr and td is not known well enough. Decks that are only
    switching cards, and runs with --history, are not judged.
    """
    spans = [one.td - one.tr for one in case.windows.windows if one.td is not None]
    spans = [span for span in spans if span > 0]
    if case.judge is not None or not spans:
        return
    limit = min(spans) / _INTERVALS
    missing = []
    for keyword in _DATABASES:
        cards = [card for card in case.deck.named(keyword) if card.rows]
        if not cards:
            missing.append(f"*{keyword}")
            continue
        card = cards[-1]
        value = card.real(card.rows[0], 0)
        by_curve = card.integer(card.rows[0], 2).value
        interval = value.value * card.transform.time
        if value.problem or by_curve:
            continue
        if interval <= 0:
            missing.append(f"*{keyword} with DT above 0")
        elif interval > limit * (1 + _ROUNDING):
            found = f"DT of *{keyword} is {interval:g}, at most {limit:g} was expected ({_INTERVALS} intervals"
            why = "in the shortest rigid window) to choose a switching time from its energies"
            yield value.field, f"{found} {why}; write it more often"
    whole = case.whole or (case.parts.all_known and case.end_time is not None)
    if missing and whole:
        found = f"the deck has no {' and no '.join(missing)}, so there is no energy history to choose the times by"
        first = next(one for one in case.windows.windows if one.closed)
        yield first.opened.by.card.here, f"{found}; add what is missing"


def _timed(case: Case) -> list[tuple[SwitchSet, Header]]:
    return [
        (card, header)
        for card, header in case.headers
        if card.time is not None and header.code.value == BY_TIME
    ]


@passes(PASS, deck(THERE + automatic(3, "0.02", rigid=["2"])))
@fails(
    window("0.1", "0.1", _SECOND),
    deck(automatic(1, "0.0", rigid=["1"]) + automatic(2, "0.0", deformable=["2"])),
)
@rule("D2R114", ERROR, "all switching times are equal (decimals lost in writing)")
def _equal(case: Case) -> Iterator[Objection]:
    """Writers with one decimal make 0.0 of every time below 0.05, and 0.1 of 0.07 and 0.13. Cards that make parts
    rigid and cards that make them deformable, all at one time, are a sign of it. Source: a public drop tool wrote
    such decks.
    """
    timed = _timed(case)
    times = {card.time for card, _ in timed}
    ways = {line.to_rigid for card, _ in timed for line in card.switched}
    inverted = any(
        one.td is not None and one.td <= one.tr for one in case.windows.windows
    )
    if (
        len(times) != 1
        or len(timed) < _FEW
        or len(ways) < 2
        or (inverted and len(timed) == _FEW)
    ):
        return
    (time,) = times
    found = f"all {len(timed)} switching times of the deck are {time:g}, to rigid and back; were decimals lost?"
    yield timed[0][1].time1.field, f"{found} print them with more digits"


def _mixed(times: list[float], end: float, what: str) -> str | None:
    """Say so where all times multiplied by 1000, or by 1/1000, suit a run up to ``end``, and as they are do not.

    Times before the run, or at its start, suit it in any unit.
    """
    later = [time for time in times if time > 0]
    if not later:
        return None
    latest, earliest = max(later), min(later)
    if 10 * end < latest < _THOUSAND * end and earliest >= end:
        way = "later: milliseconds for seconds"
    elif end / 50 <= _THOUSAND * latest < end:
        way = "earlier: seconds for milliseconds"
    else:
        return None
    return f"the switching times reach {latest:g} but {what}, about 1000 times {way}? give both in the same unit"


@passes(
    PASS,
    Example(THERE + BACK),
    window("-0.01", "0.07"),
    window("-0.02", "-0.01"),
    window("0.0", "0.07"),
)
@fails(window("20.0", "90.0"), window("2.0e-5", "9.0e-5"))
@rule(
    "D2R115",
    ERROR,
    "the switching times are about 1000 times the termination time, or a thousandth of it",
)
def _thousand(case: Case) -> Iterator[Objection]:
    """Seconds and milliseconds are mixed: the times would lie in the run if they were divided, or multiplied, by
    1000, and do not, or only in its first 1/1000. D2R101 reports times after the end too. Files name no units, so
    this is a guess by size.
    """
    times = [card.time for card, _ in _timed(case) if card.time is not None]
    if case.end is None:
        return
    if found := _mixed(times, case.end, f"the run ends at {case.end:g} (ENDTIM)"):
        yield _timed(case)[0][1].time1.field, found


_DECADES = 3.0  # of a factor of 1000
_NEAR = math.log10(2)  # a reference run may have been stopped at half of its time

_HISTORY: Final = (
    "--stiffness 660e3 --mass 31.4 --beta 2 --alpha 50 --v0 6 --t-end 0.15 --dt 1e-4"
)
_GOOD_PAIR: Final = (".0135867", ".0687534")


def _pair(
    tr: str, td: str, options: str = "", head: str = HEAD, history: str = _HISTORY
) -> Example:
    there, back = automatic(1, tr, rigid=["1"]), automatic(2, td, deformable=["1"])
    return Example(head + PARTS + there + back + END, history=history, options=options)


_PASSING: Final = (_pair(*_GOOD_PAIR),)


def _faults(case: Case, rule_id: str) -> Iterator[Objection]:
    """Objections of one rule; those that parts of one card share are one."""
    assert case.judge is not None
    windows = case.windows.windows
    together = grouped(
        ((one.tr, one.td), one.part) for one in windows if one.part is not None
    )
    by_force = {window for each in case.by_condition for window in each.windows}
    found = grouped(
        ((event.by, one.unit.kind, fault.message), one.unit.id)
        for one in windows
        for fault in case.judge.faults(
            one, together.get((one.tr, one.td), ()), by_force=one in by_force
        )
        if (event := one.closed if fault.at_td else one.opened)
        and fault.rule == rule_id
    )
    for (card, kind, message), ids in found.items():
        yield card.time_field, f"{name_units(ids, kind)}: {message}"


_WITHOUT_END: Final = HEAD.replace("*CONTROL_TERMINATION\n       0.2\n", "")


@passes(*_PASSING, PASS)
@fails(_pair("13586.7", "68753.4", head=HEAD.replace("       0.2", "  150000.0")))
@rule(
    "D2R206",
    WARNING,
    "deck and history seem to have different time units (ENDTIM and the record's end differ by a power of 1000)",
    BOTH,
)
def _units(case: Case) -> Iterator[Objection]:
    """Decks in microseconds or milliseconds and histories in seconds are a common mix. Files name no units, so the two
    ends are all there is to compare. It is left out if D2R115 or D2R207 reports the same mistake.
    """
    assert case.judge is not None
    if case.end is None or case.end_time is None or not case.judge.end > 0:
        return
    decades = math.log10(case.end) - math.log10(case.judge.end)
    power = round(decades / _DECADES)
    if power and abs(decades - _DECADES * power) <= _NEAR:
        found = f"the deck ends at {case.end:g} but the history at {case.judge.end:g}, about 1e{abs(3 * power)} times"
        way = "earlier" if power > 0 else "later"
        yield (
            case.end_time.field,
            f"{found} {way}: different units of time? give both in the same",
        )


@passes(*_PASSING, PASS)
@fails(
    _pair("13.5867", "68.7534", head=HEAD.replace("       0.2", "     150.0")),
    _pair("1.0e-5", "6.0e-5", head=_WITHOUT_END),
)
@rule(
    "D2R207",
    ERROR,
    "the switching times are about 1000 times those of the history, or a thousandth of them",
    BOTH,
)
def _thousand_of_history(case: Case) -> Iterator[Objection]:
    """A deck in milliseconds and a history in seconds, or the other way round: the windows would lie in the history
    if their times were divided, or multiplied, by 1000. Files name no units, so this is a guess by size; D2R205
    tells of times outside the history.
    """
    windows = case.windows.windows
    times = [time for one in windows for time in (one.tr, one.td) if time is not None]
    assert case.judge is not None
    if not case.judge.end > 0:
        return
    if found := _mixed(
        times, case.judge.end, f"the history ends at {case.judge.end:g}"
    ):
        yield windows[0].opened.by.time_field, found


@passes(*_PASSING, PASS)
@fails(_pair("0.017", ".0687534"), _pair("0.0135", ".0687534", "--tolerance 0.05"))
@rule("D2R201", ERROR, "the error of the locked-in energy is above --tolerance", BOTH)
def _d2r201(case: Case) -> Iterator[Objection]:
    """While a part is rigid it keeps the deformation it had at tr; it springs back at td. The deformation should be
    the one it would have had at td: same energy, same sign. Judged as d2rpick verify does, for the parts that share
    a window together, else by the energy of the whole model: by the lock-in error where an oscillator describes the
    record, else by the level error.
    """
    return _faults(case, "D2R201")


@passes(*_PASSING)
@fails(_pair(".0122659", "0.064"))
@rule("D2R202", ERROR, "opposite sign of the deformation", BOTH)
def _d2r202(case: Case) -> Iterator[Objection]:
    """A vibrating part passes every energy level twice stretched and twice compressed. Locked in with the wrong
    sign, the vibration after td is worse than with no energy at all. Known only where an oscillator describes the
    record.
    """
    return _faults(case, "D2R202")


@passes(*_PASSING)
@fails(_pair(".0128853", "0.064"))
@rule(
    "D2R203",
    WARNING,
    "poor td (kinetic share above one half): the better td, named",
    BOTH,
)
def _d2r203(case: Case) -> Iterator[Objection]:
    """The share of the vibration energy that is kinetic at td is lost whatever tr is, since a rigid part does not
    vibrate. Near a peak of the internal energy hardly any is kinetic.
    """
    return _faults(case, "D2R203")


@passes(*_PASSING)
@fails(_pair(*_GOOD_PAIR, "--after 0.03"))
@rule("D2R204", ERROR, "tr before the load is over, or td after the next contact", BOTH)
def _d2r204(case: Case) -> Iterator[Objection]:
    """Before the load is over equal energy is an accident and the motion comes out wrong; after the next contact the
    part should have deformed. When the flight begins and ends is found from the momentum or the energy of the
    history, or given with --after. A history that does not show it is an objection too.
    """
    return _faults(case, "D2R204")


@passes(*_PASSING)
@fails(_pair(".0135867", "0.16"))
@rule("D2R205", ERROR, "tr or td outside the reference history", BOTH)
def _d2r205(case: Case) -> Iterator[Objection]:
    """The energy at such a time is unknown, and so is that of a part that the history does not have. A td within the
    first ten states, whose thousandfold lies in the history, was given in another unit.
    """
    return _faults(case, "D2R205")
