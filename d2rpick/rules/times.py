"""Define rules D2R101-102, D2R105, D2R111, D2R114-115, D2R201-207 and D2R209-210 on the times of windows."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final

from d2rpick.base.errors import name_units
from d2rpick.deck.ls_dyna_columns import DATABASE
from d2rpick.deck.switching import (
    BY_SENSOR,
    BY_TIME,
    SwitchHeader,
    SwitchSet,
    SwitchWindow,
)
from d2rpick.rules.base import BOTH, ERROR, WARNING, Case, PlacedMessage, group_values
from d2rpick.rules.example import (
    END,
    HEAD,
    PARTS,
    Example,
    make_deck,
    make_window,
    write_automatic_card,
)
from d2rpick.rules.rule import (
    BACK,
    GOOD,
    PASS,
    THERE,
    make_rule_decorator,
    set_failing,
    set_passing,
)

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence


# Smallest number of output intervals in a rigid window, which resolves crossings to within 0.5 % of the window.
_INTERVALS = 200
# If an output interval exceeds its limit by at most this fraction, the excess is attributed to rounding [-].
_ROUNDING = 1e-9
_DATABASES: Final = ("DATABASE_GLSTAT", "DATABASE_MATSUM")


_THOUSAND = 1000.0
# Up to this number of cards, D2R102 and D2R105 would report the same mistake twice.
_FEW = 2

_DECADES = 3.0  # Powers of ten between adjacent time units.
# Tolerance for the ratio of end times, as a power of ten [-]; a reference run may be half as long as the run.
_NEAR = math.log10(2)
_HISTORY: Final = (
    "--stiffness 660e3 --mass 31.4 --beta 2 --alpha 50 --v0 6 --t-end 0.15 --dt 1e-4"
)
_GOOD_PAIR: Final = (".0135867", ".0687534")
_WITHOUT_END: Final = HEAD.replace("*CONTROL_TERMINATION\n       0.2\n", "")


@set_failing(
    lambda: [
        make_window("0.02", "0.2"),
        make_window("-0.02", "0.09"),
        Example(
            PARTS
            + write_automatic_card(1, "0.02", rigid=["1"], code=2).replace(
                "       0.0", "      0.01", 1
            )
            + END
        ),
    ]
)
@make_rule_decorator("D2R101", ERROR, "a switch time outside [0, ENDTIM)")
def _check_times_in_run(case: Case) -> Iterator[PlacedMessage]:
    """TIME1 is the switching time for CODE 0, and the earliest switching time for CODE 1 to 4. If TIME1 is at or after
    ENDTIM of *CONTROL_TERMINATION, the set never switches. With CODE 1 to 4 it does not switch after TIME2 either.

    Fix: Correct TIME1, TIME2 or ENDTIM. Check that all of them have the same time unit.
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
                f"TIME1 is {time:g}, expected 0 or later; correct TIME1",
            )
        elif case.end is not None and time >= case.end:
            problem = f"TIME1 is {time:g} but the run ends at {case.end:g} (ENDTIM)"
            cure = _suggest_seconds(time, case.end) or "correct one of them"
            yield (
                header.time1.field,
                f"{problem}, so the set never switches; {cure}",
            )
        latest = header.time2
        if (
            header.code.value != BY_TIME
            and not latest.problem
            and 0 < latest.value < header.time1.value
        ):
            problem = f"TIME2 is {latest.value:g}, before TIME1 ({header.time1.value:g}), so the set never switches"
            yield latest.field, f"{problem}; give a later time, or 0 for no limit"


def _suggest_seconds(time: float, end: float) -> str:
    """Return the question whether a time after the end of the run is in a smaller unit; empty if none explains it."""
    import numpy as np  # Imported here to keep start-up fast.

    from d2rpick.histories.digits import find_smaller_unit

    unit, values = find_smaller_unit(np.array([0.0, end]), [time])
    if not unit:
        return ""
    return f"was it meant in {unit}? Then write {values[0]:g}, in the unit of ENDTIM"


def _group_closed_windows(
    case: Case,
) -> dict[tuple[SwitchSet, SwitchSet], list[SwitchWindow]]:
    """Return the windows that have both ends, by the cards that open and close them."""
    return group_values(
        ((window.opened.by, window.closed.by), window)
        for window in case.windows.windows
        if window.closed is not None
    )


def _name_parts(windows: Sequence[SwitchWindow]) -> str:
    """Return the part ids in some windows as text."""
    return name_units(window.unit.id for window in windows)


def _is_lost(window: SwitchWindow) -> bool:
    """Return True if both times of a window are zero."""
    return window.tr == 0 == window.td


@set_failing(lambda: [make_window("0.09", "0.02"), make_window("0.02", "0.02")])
@make_rule_decorator(
    "D2R102", ERROR, "a part switched back before, or when, it is made rigid", BOTH
)
def _check_times_in_order(case: Case) -> Iterator[PlacedMessage]:
    """The R2D switch of a part must come after its D2R switch. The solver does not sort the switches by time.

    Fix: Make td later than tr. Perhaps the two times were exchanged.
    """
    for (opening, closing), windows in _group_closed_windows(case).items():
        first = windows[0]
        together = (
            opening.kind == closing.kind == "restart"
            and opening.card.file == closing.card.file
        )  # Rule D2R117 reports cards with equal times.
        if (
            first.td is not None
            and first.td <= first.tr
            and not _is_lost(first)
            and not together
        ):
            problem = f"{_name_parts(windows)} switched back at {first.td:g} but made rigid at {first.tr:g}"
            cure = f"({opening.time_field.at}); give a later time here, unless the two times are swapped"
            yield closing.time_field, f"{problem} {cure}"


@set_passing(lambda: [PASS, make_window("0.0", "0.09")])
@set_failing(lambda: [make_window("0.0", "0.0")])
@make_rule_decorator(
    "D2R105", ERROR, "a window whose times are both 0 (decimals lost in writing)"
)
def _check_zero_times(case: Case) -> Iterator[PlacedMessage]:
    """Programs that print times with one decimal write every time below 0.05 as 0.0. Two sets that both switch at 0 are
    a sign of this.

    Fix: Print the times with more decimals, for example as 0.0135867.
    """
    for (opening, closing), windows in _group_closed_windows(case).items():
        if _is_lost(windows[0]) and opening.kind == "automatic":
            problem = f"both times of {_name_parts(windows)} are 0 (the other at {opening.time_field.at})"
            yield (
                closing.time_field,
                f"{problem}; print times below 0.05 with more than one decimal",
            )


@set_passing(lambda: [PASS, Example(THERE + BACK)])
@set_failing(
    lambda: [
        Example(PARTS + THERE + BACK + END),
        Example(GOOD.replace("    0.0001", "      0.01")),
    ]
)
@make_rule_decorator(
    "D2R111",
    WARNING,
    "a missing *DATABASE_GLSTAT/_MATSUM, or a DT above (td-tr)/200",
)
def _check_sampling(case: Case) -> Iterator[PlacedMessage]:
    """Switching times are chosen from the internal energy of a reference run: glstat contains the energy of the whole
    model, and matsum contains the energy of each part. If the output interval is too long, the energy at tr and td is
    not known well enough. The command d2rpick verify --switched compares a switched run with its reference run by means
    of this output. So the rule also applies to checks with --history. It does not apply to decks that contain only
    switching cards.

    Fix: Add *DATABASE_GLSTAT and *DATABASE_MATSUM with a DT of at most 1/200 of the shortest rigid window.
    """
    spans = [
        window.td - window.tr
        for window in case.windows.windows
        if window.td is not None
    ]
    spans = [span for span in spans if span > 0]
    if not spans:
        return
    limit = min(spans) / _INTERVALS
    missing = []
    for keyword in _DATABASES:
        cards = [card for card in case.deck.named(keyword) if card.rows]
        if not cards:
            missing.append(f"*{keyword}")
            continue
        card = cards[-1]
        value = card.real(card.rows[0], DATABASE["DT"])
        curve = card.integer(card.rows[0], DATABASE["LCUR"]).value
        interval = value.value * card.transform.time
        if value.problem or curve:
            continue
        if interval <= 0:
            missing.append(f"*{keyword} with DT above 0")
        elif interval > limit * (1 + _ROUNDING):
            problem = (
                f"DT of *{keyword} is {interval:g}, too long to choose switching times from its energies, "
                "or to compare a switched run with its reference run"
            )
            why = f"expected at most {limit:g}: {_INTERVALS} intervals in the shortest rigid window"
            yield value.field, f"{problem} ({why}); reduce DT"
    whole = case.knows_all_parts or (case.parts.all_known and case.end_time is not None)
    if missing and whole:
        problem = (
            f"the deck has no {' and no '.join(missing)}, so its run writes no energies: no times can be chosen from "
            "them, and a switched run cannot be compared with its reference run"
        )
        first = next(window for window in case.windows.windows if window.closed)
        yield first.opened.by.card.here, f"{problem}; add what is missing"


def _find_timed(case: Case) -> list[tuple[SwitchSet, SwitchHeader]]:
    """Return the CODE 0 cards with a known time, with their headers."""
    return [
        (card, header)
        for card, header in case.headers
        if card.time is not None and header.code.value == BY_TIME
    ]


@set_passing(
    lambda: [PASS, make_deck(THERE + write_automatic_card(3, "0.02", rigid=["2"]))]
)
@set_failing(
    lambda: [
        make_window(
            "0.1",
            "0.1",
            write_automatic_card(3, "0.1", rigid=["2"])
            + write_automatic_card(4, "0.1", deformable=["2"]),
        ),
        make_deck(
            write_automatic_card(1, "0.0", rigid=["1"])
            + write_automatic_card(2, "0.0", deformable=["2"])
        ),
    ]
)
@make_rule_decorator(
    "D2R114", ERROR, "switching times that are all equal (decimals lost in writing)"
)
def _check_equal_times(case: Case) -> Iterator[PlacedMessage]:
    """Programs that print times with one decimal write 0.0 for every time below 0.05, and 0.1 for 0.07 and 0.13. If all
    cards switch at the same time, the decimals were probably lost in this way. Source: a public drop tool wrote such
    decks.

    Fix: Print the times with more decimals.
    """
    timed = _find_timed(case)
    times = {card.time for card, _ in timed}
    ways = {line.to_rigid for card, _ in timed for line in card.switched}
    inverted = any(
        window.td is not None and window.td <= window.tr
        for window in case.windows.windows
    )
    if (
        len(times) != 1
        or len(timed) < _FEW
        or len(ways) < 2
        or (inverted and len(timed) == _FEW)
    ):
        return
    (time,) = times
    problem = (
        f"all {len(timed)} switching times of the deck are {time:g}, to rigid and back"
    )
    yield timed[0][1].time1.field, f"{problem}; print them with more decimals"


def _find_mixed_units(times: list[float], end: float, run_end: str) -> str | None:
    """Return a message if only times multiplied by 1000 or 1/1000 would fit a run up to ``end``; otherwise None.

    ``run_end`` names the end in the message. Times at or before the start of the run fit in any unit.
    """
    later = [time for time in times if time > 0]
    if not later:
        return None
    latest = max(later)
    earliest = min(later)
    if 10 * end < latest < _THOUSAND * end and earliest >= end:
        size = "larger: milliseconds for seconds"
    elif end / 50 <= _THOUSAND * latest < end:
        size = "smaller: seconds for milliseconds"
    else:
        return None
    problem = (
        f"the switching times reach only {latest:g}"
        if size.startswith("smaller")
        else f"the switching times reach {latest:g}"
    )
    return f"{problem} but {run_end}: they are about 1000 times {size}? give both in the same unit"


@set_passing(
    lambda: [
        PASS,
        Example(THERE + BACK),
        make_window("-0.01", "0.07"),
        make_window("-0.02", "-0.01"),
        make_window("0.0", "0.07"),
    ]
)
@set_failing(lambda: [make_window("20.0", "90.0"), make_window("2.0e-5", "9.0e-5")])
@make_rule_decorator(
    "D2R115",
    ERROR,
    "switching times of about 1000 times the termination time, or 1/1000 of it",
)
def _check_units_of_deck(case: Case) -> Iterator[PlacedMessage]:
    """The deck seems to mix seconds and milliseconds. The switching times lie outside the run or in its first 1/1000,
    but would lie in the run after division or multiplication by 1000. Files contain no unit names, so d2rpick infers
    this from the magnitudes. D2R101 does not report these times again.

    Fix: Write the switching times and ENDTIM in the same time unit.
    """
    times = [card.time for card, _ in _find_timed(case) if card.time is not None]
    if case.end is None:
        return
    if problem := _find_mixed_units(
        times, case.end, f"the run ends at {case.end:g} (ENDTIM)"
    ):
        yield _find_timed(case)[0][1].time1.field, problem


def _make_pair_deck(
    tr: str, td: str, options: str = "", head: str = HEAD, history: str = _HISTORY
) -> Example:
    """Return a deck with one window for part 1, checked with a history of `d2rpick replay` for these arguments."""
    rigid_card = write_automatic_card(1, tr, rigid=["1"])
    back_card = write_automatic_card(2, td, deformable=["1"])
    return Example(
        head + PARTS + rigid_card + back_card + END, history=history, options=options
    )


def _make_good_pair() -> Example:
    """Return a deck whose window begins and ends at a good pair of times of the history."""
    return _make_pair_deck(*_GOOD_PAIR)


def _report_faults(case: Case, rule_id: str) -> Iterator[PlacedMessage]:
    """Yield the problems that one rule finds in the energy history; parts on the same card share a problem."""
    objections: list[tuple[tuple[SwitchSet, str, str], int]] = []
    for judged_window, judgement in case.judgements:
        for fault in judgement.faults:
            event = judged_window.closed if fault.at_td else judged_window.opened
            if event and fault.rule == rule_id:
                key = event.by, judged_window.unit.kind, fault.message
                objections.append((key, judged_window.unit.id))
    for (card, kind, message), ids in group_values(objections).items():
        yield card.time_field, f"{name_units(ids, kind)}: {message}"


@set_passing(lambda: [_make_good_pair(), PASS])
@set_failing(
    lambda: [
        _make_pair_deck(
            "13586.7", "68753.4", head=HEAD.replace("       0.2", "  150000.0")
        )
    ]
)
@make_rule_decorator(
    "D2R206",
    WARNING,
    "a deck and a history that seem to have different time units (their ends differ by a power of 1000)",
    BOTH,
)
def _check_units_of_history(case: Case) -> Iterator[PlacedMessage]:
    """The deck may be in microseconds or milliseconds, and the history in seconds. Files contain no unit names, so
    d2rpick compares the two end times. If D2R115 or D2R207 reports the same mistake, this rule does not.

    Fix: Give the history that the solver wrote: it has the time unit of its deck. If you have only a converted table,
    convert its times back.
    """
    assert case.judge is not None
    if case.end is None or case.end_time is None or not case.judge.end > 0:
        return
    decades = math.log10(case.end) - math.log10(case.judge.end)
    power = round(decades / _DECADES)
    if power and abs(decades - _DECADES * power) <= _NEAR:
        problem = f"the deck ends at {case.end:g} but the history at {case.judge.end:g}, about 1e{abs(3 * power)} times"
        direction = "earlier" if power > 0 else "later"
        yield (
            case.end_time.field,
            f"{problem} {direction}, so the time units seem to differ; give both in the same unit",
        )


@set_passing(lambda: [_make_good_pair(), PASS])
@set_failing(
    lambda: [
        _make_pair_deck(
            "13.5867", "68.7534", head=HEAD.replace("       0.2", "     150.0")
        ),
        _make_pair_deck("1.0e-5", "6.0e-5", head=_WITHOUT_END),
    ]
)
@make_rule_decorator(
    "D2R207",
    ERROR,
    "switching times of about 1000 times the times in the history, or 1/1000 of them",
    BOTH,
)
def _check_times_of_history(case: Case) -> Iterator[PlacedMessage]:
    """Deck and history seem to have different time units: the windows would lie in the history if they were divided or
    multiplied by 1000. Files contain no unit names, so d2rpick infers this from the magnitudes. Other times outside the
    history are reported by D2R205.

    Fix: If the history was converted to another time unit, give the history that the solver wrote: it has the time unit
    of its deck. Otherwise correct the times on the cards.
    """
    windows = case.windows.windows
    times = [
        time
        for window in windows
        for time in (window.tr, window.td)
        if time is not None
    ]
    assert case.judge is not None
    if not case.judge.end > 0:
        return
    if problem := _find_mixed_units(
        times, case.judge.end, f"the history ends at {case.judge.end:g}"
    ):
        yield windows[0].opened.by.time_field, problem


@set_passing(lambda: [_make_good_pair(), PASS])
@set_failing(
    lambda: [
        _make_pair_deck("0.017", ".0687534"),
        _make_pair_deck("0.0135", ".0687534", "--tolerance 0.05"),
    ]
)
@make_rule_decorator(
    "D2R201", ERROR, "an error of the frozen deformation above --tolerance", BOTH
)
def _check_locked_in_error(case: Case) -> Iterator[PlacedMessage]:
    """While a part is rigid, it keeps the deformation that it had at tr, and it springs back at td. This deformation
    should equal the deformation in the reference run at td: same energy, same direction. d2rpick judges all parts with
    the same window together, as d2rpick verify does. If the history has no parts, it judges the whole model. It uses
    the frozen-deformation error if a vibration model describes the history, otherwise the level error.

    Fix: Replace tr, or both times, by the times in the finding, or by the times that d2rpick suggest gives.
    """
    return _report_faults(case, "D2R201")


@set_passing(lambda: [_make_good_pair()])
@set_failing(lambda: [_make_pair_deck(".0122659", "0.064")])
@make_rule_decorator(
    "D2R202", ERROR, "deformations at tr and td that have opposite directions", BOTH
)
def _check_sign(case: Case) -> Iterator[PlacedMessage]:
    """In each oscillation cycle a part passes every energy level twice in tension and twice in compression. If the
    frozen deformation has the wrong sign, the vibration after td is worse than without any frozen deformation. The sign
    is known only if a vibration model (oscillator, modal or swings) describes the history.

    Fix: Replace tr, or both times, by the times in the finding, which have the right sign.
    """
    return _report_faults(case, "D2R202")


@set_passing(lambda: [_make_good_pair()])
@set_failing(lambda: [_make_pair_deck(".0128853", "0.064", "--min-quality poor")])
@make_rule_decorator(
    "D2R203",
    WARNING,
    "a poor td, at which more than half of the vibration energy is kinetic",
    BOTH,
)
def _check_kinetic_share(case: Case) -> Iterator[PlacedMessage]:
    """A rigid part does not vibrate, so the kinetic part of the vibration energy at td is lost for every tr. Near a
    maximum of the internal energy, little vibration energy is kinetic. If D2R209 reports the pair, this rule does not.

    Fix: Replace both times by the pair in the finding or choose a td near a maximum of the internal energy.
    """
    return _report_faults(case, "D2R203")


@set_passing(
    lambda: [
        _make_good_pair(),
        _make_pair_deck(".0128853", "0.064", "--min-quality poor"),
    ]
)
@set_failing(lambda: [_make_pair_deck(".0128853", "0.064")])
@make_rule_decorator("D2R209", ERROR, "a pair with a grade below --min-quality", BOTH)
def _check_quality(case: Case) -> Iterator[PlacedMessage]:
    """The pair is admissible, but according to the history, the motion or the vibration after td will be wrong or may
    be wrong. d2rpick judges the pair in the same way as d2rpick verify. With --min-quality good, it also reports fair
    pairs; with --min-quality poor, it reports no pair.

    Fix: Use the pair that the finding names. If it names none, follow its advice.
    """
    return _report_faults(case, "D2R209")


@set_passing(lambda: [_make_good_pair()])
@set_failing(lambda: [_make_pair_deck(".0128853", "0.064", "--max-residual 0.5")])
@make_rule_decorator(
    "D2R210", ERROR, "a pair that exceeds a limit, such as --max-residual", BOTH
)
def _check_limits(case: Case) -> Iterator[PlacedMessage]:
    """The pair exceeds a limit that an option sets, such as --max-residual or --max-kinetic-share, or the history does
    not show whether the pair exceeds it. With the same limit, d2rpick suggest does not recommend such a pair.

    Fix: Use the pair that the finding names, or a pair that d2rpick suggest recommends with this limit.
    """
    return _report_faults(case, "D2R210")


@set_passing(lambda: [_make_good_pair()])
@set_failing(lambda: [_make_pair_deck(*_GOOD_PAIR, "--after 0.03")])
@make_rule_decorator(
    "D2R204",
    ERROR,
    "a tr before the load is over, or a td after the next contact",
    BOTH,
)
def _check_flight(case: Case) -> Iterator[PlacedMessage]:
    """If tr lies before the end of the load, an equal energy is a coincidence, and the motion of the body is wrong. If
    td lies after the next contact, a rigid part does not deform in this contact. d2rpick finds the start and end of the
    flight from the momentum or the energy in the history, or uses the time of --after. The rule also reports a problem
    if the history shows no flight, or if a support or a prescribed motion in the deck prevents a part from flying.

    Fix: Move tr after the load and td before the next contact. If the history does not show when the load ends, give
    --after.
    """
    return _report_faults(case, "D2R204")


@set_passing(lambda: [_make_good_pair()])
@set_failing(lambda: [_make_pair_deck(".0135867", "0.16")])
@make_rule_decorator(
    "D2R205", ERROR, "a time or part that the history does not contain", BOTH
)
def _check_in_history(case: Case) -> Iterator[PlacedMessage]:
    """The history gives no energy at times outside its record, and no energy of a part that it does not contain. If td
    lies within the first ten states and 1000 times td lies in the history, td seems to be in another unit. d2rpick
    reports such a td too.

    Fix: Correct the time or the part id, or extend the reference run.
    """
    return _report_faults(case, "D2R205")
