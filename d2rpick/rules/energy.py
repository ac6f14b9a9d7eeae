"""D2R201-207: the windows held against the energy history of a run without switching."""

from __future__ import annotations

import math
from functools import partial
from typing import TYPE_CHECKING, Final

from d2rpick.errors import name_units
from d2rpick.rules.base import BOTH, Example, Rule, Severity
from d2rpick.rules.example_decks import END, GOOD, HEAD, PARTS, automatic
from d2rpick.rules.formats import factor_of, mistaken

if TYPE_CHECKING:
    from collections.abc import Iterator

    from d2rpick.deck import SwitchSet
    from d2rpick.rules.base import Case, Objection

_THOUSAND = 3.0  # decades
_NEAR = math.log10(2)  # a reference run may have been stopped at half of its time


def _faults(rule: str, case: Case) -> Iterator[Objection]:
    """Objections of one rule; those that parts of one card share are one."""
    if case.judge is None:
        return
    found: dict[tuple[SwitchSet, str, str], list[int]] = {}
    together: dict[tuple[float, float | None], list[int]] = {}
    for window in case.windows.windows:
        together.setdefault((window.tr, window.td), []).extend([] if window.part is None else [window.part])
    for window in case.windows.windows:
        for fault in case.judge.faults(window, together[window.tr, window.td]):
            event = window.closed if fault.at_td else window.opened
            if fault.rule == rule and event:
                found.setdefault((event.by, window.unit.kind, fault.message), []).append(window.unit.id)
    for (card, kind, message), ids in found.items():
        yield card.time_field, f"{name_units(ids, kind)}: {message}"


def _units(case: Case) -> Iterator[Objection]:
    if case.judge is None or case.end is None or case.end_time is None or not case.judge.end > 0:
        return
    decades = math.log10(case.end) - math.log10(case.judge.end)
    power = round(decades / _THOUSAND)
    if power and abs(decades - _THOUSAND * power) <= _NEAR:
        yield (
            case.end_time.field,
            (
                f"the deck ends at {case.end:g} but the history at {case.judge.end:g}, about 1e{abs(3 * power)} times "
                f"{'earlier' if power > 0 else 'later'}: different units of time? give both in the same"
            ),
        )


def _thousand(case: Case) -> Iterator[Objection]:
    windows = case.windows.windows
    times = [time for one in windows for time in (one.tr, one.td) if time is not None]
    if case.judge is None or not case.judge.end > 0:
        return
    factor = factor_of(times, case.judge.end)
    if factor != 1:
        found = f"the switching times reach {max(times):g} but the history ends at {case.judge.end:g}"
        yield windows[0].opened.by.time_field, f"{found}, {mistaken(factor)} give both in the same unit"


_HISTORY: Final = "--stiffness 660e3 --mass 31.4 --beta 2 --alpha 50 --v0 6 --t-end 0.15 --dt 1e-4"
_GOOD_PAIR: Final = (".0135867", ".0687534")


def _pair(tr: str, td: str, options: str = "", head: str = HEAD, history: str = _HISTORY) -> Example:
    there, back = automatic(1, tr, rigid=["1"]), automatic(2, td, deformable=["1"])
    return Example(head + PARTS + there + back + END, history=history, options=options)


_PASSING: Final = (_pair(*_GOOD_PAIR),)

RULES: Final = (
    Rule(
        "D2R201",
        Severity.ERROR,
        "the error of the locked-in energy is above --tolerance",
        "While a part is rigid it keeps the deformation it had at tr; it springs back at td. The deformation "
        "should be the one it would have had at td: same energy, same sign. Judged as d2rpick verify does, "
        "for the parts that share a window together, else by the energy of the whole model: by the lock-in "
        "error where an oscillator describes the record, else by the level error.",
        partial(_faults, "D2R201"),
        (*_PASSING, Example(GOOD)),
        (_pair("0.017", ".0687534"), _pair("0.0135", ".0687534", "--tolerance 0.05")),
        solvers=BOTH,
    ),
    Rule(
        "D2R202",
        Severity.ERROR,
        "opposite sign of the deformation",
        "A vibrating part passes every energy level twice stretched and twice compressed. Locked in with the "
        "wrong sign, the vibration after td is worse than with no energy at all. Known only where an "
        "oscillator describes the record.",
        partial(_faults, "D2R202"),
        _PASSING,
        (_pair(".0122659", "0.064"),),
        solvers=BOTH,
    ),
    Rule(
        "D2R203",
        Severity.WARNING,
        "poor td (kinetic share above one half): the better td, named",
        "The share of the vibration energy that is kinetic at td is lost whatever tr is, since a rigid part "
        "does not vibrate. Near a peak of the internal energy hardly any is kinetic.",
        partial(_faults, "D2R203"),
        _PASSING,
        (_pair(".0128853", "0.064"),),
        solvers=BOTH,
    ),
    Rule(
        "D2R204",
        Severity.ERROR,
        "tr before the load is over, or td after the next contact",
        "Before the load is over equal energy is an accident and the motion comes out wrong; after the next "
        "contact the part should have deformed. When the flight begins and ends is found from the momentum or "
        "the energy of the history, or given with --after. A history that does not show it is an objection too.",
        partial(_faults, "D2R204"),
        _PASSING,
        (_pair(*_GOOD_PAIR, "--after 0.03"),),
        solvers=BOTH,
    ),
    Rule(
        "D2R205",
        Severity.ERROR,
        "tr or td outside the reference history",
        "The energy at such a time is unknown, and so is that of a part that the history does not have. A td within "
        "the first ten states, whose thousandfold lies in the history, was given in another unit.",
        partial(_faults, "D2R205"),
        _PASSING,
        (_pair(".0135867", "0.16"),),
        solvers=BOTH,
    ),
    Rule(
        "D2R206",
        Severity.WARNING,
        "deck and history seem to have different time units (ENDTIM and the record's end differ by a power of 1000)",
        "Decks in milliseconds and histories in seconds are a common mix. Files name no units, so the two ends "
        "are all there is to compare.",
        _units,
        (*_PASSING, Example(GOOD)),
        (_pair("13.5867", "68.7534", head=HEAD.replace("       0.2", "     150.0")),),
        solvers=BOTH,
    ),
    Rule(
        "D2R207",
        Severity.WARNING,
        "the switching times are about 1000 times those of the history, or a thousandth of them",
        "A deck in milliseconds and a history in seconds, or the other way round: the windows would lie in the history "
        "if their times were divided, or multiplied, by 1000. Files name no units, so this is a guess by size; "
        "D2R205 tells of times outside the history.",
        _thousand,
        (*_PASSING, Example(GOOD)),
        (_pair("13.5867", "68.7534", head=HEAD.replace("       0.2", "     150.0")), _pair("1.0e-5", "6.0e-5")),
        solvers=BOTH,
    ),
)
