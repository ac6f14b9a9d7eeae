"""D2R201-207: the windows held against the energy history of a run without switching."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final

from d2rpick.base.errors import name_units
from d2rpick.rules.base import BOTH, ERROR, WARNING, Example, grouped, rule
from d2rpick.rules.examples import END, HEAD, PARTS, PASSES, automatic
from d2rpick.rules.times import factor_of, mistaken

if TYPE_CHECKING:
    from collections.abc import Iterator

    from d2rpick.rules.base import Case, Objection

_THOUSAND = 3.0  # decades
_NEAR = math.log10(2)  # a reference run may have been stopped at half of its time

_HISTORY: Final = "--stiffness 660e3 --mass 31.4 --beta 2 --alpha 50 --v0 6 --t-end 0.15 --dt 1e-4"
_GOOD_PAIR: Final = (".0135867", ".0687534")


def _pair(tr: str, td: str, options: str = "", head: str = HEAD, history: str = _HISTORY) -> Example:
    there, back = automatic(1, tr, rigid=["1"]), automatic(2, td, deformable=["1"])
    return Example(head + PARTS + there + back + END, history=history, options=options)


_PASSING: Final = (_pair(*_GOOD_PAIR),)


def _faults(case: Case, rule_id: str) -> Iterator[Objection]:
    """Objections of one rule; those that parts of one card share are one."""
    if case.judge is None:
        return
    windows = case.windows.windows
    together = grouped(((one.tr, one.td), one.part) for one in windows if one.part is not None)
    found = grouped(
        ((event.by, one.unit.kind, fault.message), one.unit.id)
        for one in windows
        for fault in case.judge.faults(one, together.get((one.tr, one.td), ()))
        if (event := one.closed if fault.at_td else one.opened) and fault.rule == rule_id
    )
    for (card, kind, message), ids in found.items():
        yield card.time_field, f"{name_units(ids, kind)}: {message}"


@rule(
    "D2R206",
    WARNING,
    "deck and history seem to have different time units (ENDTIM and the record's end differ by a power of 1000)",
    (*_PASSING, PASSES),
    (_pair("13.5867", "68.7534", head=HEAD.replace("       0.2", "     150.0")),),
    BOTH,
)
def _units(case: Case) -> Iterator[Objection]:
    """Decks in milliseconds and histories in seconds are a common mix. Files name no units, so the two ends are all
    there is to compare.
    """
    if case.judge is None or case.end is None or case.end_time is None or not case.judge.end > 0:
        return
    decades = math.log10(case.end) - math.log10(case.judge.end)
    power = round(decades / _THOUSAND)
    if power and abs(decades - _THOUSAND * power) <= _NEAR:
        found = f"the deck ends at {case.end:g} but the history at {case.judge.end:g}, about 1e{abs(3 * power)} times"
        way = "earlier" if power > 0 else "later"
        yield case.end_time.field, f"{found} {way}: different units of time? give both in the same"


@rule(
    "D2R207",
    WARNING,
    "the switching times are about 1000 times those of the history, or a thousandth of them",
    (*_PASSING, PASSES),
    (_pair("13.5867", "68.7534", head=HEAD.replace("       0.2", "     150.0")), _pair("1.0e-5", "6.0e-5")),
    BOTH,
)
def _thousand(case: Case) -> Iterator[Objection]:
    """A deck in milliseconds and a history in seconds, or the other way round: the windows would lie in the history
    if their times were divided, or multiplied, by 1000. Files name no units, so this is a guess by size; D2R205
    tells of times outside the history.
    """
    windows = case.windows.windows
    times = [time for one in windows for time in (one.tr, one.td) if time is not None]
    if case.judge is None or not case.judge.end > 0:
        return
    factor = factor_of(times, case.judge.end)
    if factor != 1:
        found = f"the switching times reach {max(times):g} but the history ends at {case.judge.end:g}"
        yield windows[0].opened.by.time_field, f"{found}, {mistaken(factor)} give both in the same unit"


@rule(
    "D2R201",
    ERROR,
    "the error of the locked-in energy is above --tolerance",
    (*_PASSING, PASSES),
    (_pair("0.017", ".0687534"), _pair("0.0135", ".0687534", "--tolerance 0.05")),
    BOTH,
)
def _d2r201(case: Case) -> Iterator[Objection]:
    """While a part is rigid it keeps the deformation it had at tr; it springs back at td. The deformation should be
    the one it would have had at td: same energy, same sign. Judged as d2rpick verify does, for the parts that share
    a window together, else by the energy of the whole model: by the lock-in error where an oscillator describes the
    record, else by the level error.
    """
    return _faults(case, "D2R201")


@rule("D2R202", ERROR, "opposite sign of the deformation", _PASSING, (_pair(".0122659", "0.064"),), BOTH)
def _d2r202(case: Case) -> Iterator[Objection]:
    """A vibrating part passes every energy level twice stretched and twice compressed. Locked in with the wrong
    sign, the vibration after td is worse than with no energy at all. Known only where an oscillator describes the
    record.
    """
    return _faults(case, "D2R202")


@rule(
    "D2R203",
    WARNING,
    "poor td (kinetic share above one half): the better td, named",
    _PASSING,
    (_pair(".0128853", "0.064"),),
    BOTH,
)
def _d2r203(case: Case) -> Iterator[Objection]:
    """The share of the vibration energy that is kinetic at td is lost whatever tr is, since a rigid part does not
    vibrate. Near a peak of the internal energy hardly any is kinetic.
    """
    return _faults(case, "D2R203")


@rule(
    "D2R204",
    ERROR,
    "tr before the load is over, or td after the next contact",
    _PASSING,
    (_pair(*_GOOD_PAIR, "--after 0.03"),),
    BOTH,
)
def _d2r204(case: Case) -> Iterator[Objection]:
    """Before the load is over equal energy is an accident and the motion comes out wrong; after the next contact the
    part should have deformed. When the flight begins and ends is found from the momentum or the energy of the
    history, or given with --after. A history that does not show it is an objection too.
    """
    return _faults(case, "D2R204")


@rule("D2R205", ERROR, "tr or td outside the reference history", _PASSING, (_pair(".0135867", "0.16"),), BOTH)
def _d2r205(case: Case) -> Iterator[Objection]:
    """The energy at such a time is unknown, and so is that of a part that the history does not have. A td within the
    first ten states, whose thousandfold lies in the history, was given in another unit.
    """
    return _faults(case, "D2R205")
