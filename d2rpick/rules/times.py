"""D2R101, D2R102, D2R105, D2R111: the times of the windows, and whether a history can support them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from d2rpick.deck.switching import BY_SENSOR, BY_TIME
from d2rpick.errors import name_units
from d2rpick.rules.base import BOTH, Example, Rule, Severity
from d2rpick.rules.example_decks import BACK, END, GOOD, HEAD, PARTS, THERE, automatic

if TYPE_CHECKING:
    from collections.abc import Iterator

    from d2rpick.deck import SwitchSet, Window
    from d2rpick.rules.base import Case, Objection

_INTERVALS = 200  # output intervals per rigid window, for crossings to be found within 0.5 %
_ROUNDING = 1e-9
_DATABASES: Final = ("DATABASE_GLSTAT", "DATABASE_MATSUM")


def _in_run(case: Case) -> Iterator[Objection]:
    for card in case.sets:
        header = card.header
        if header is None or header.code.problem or header.time1.problem or header.code.value == BY_SENSOR:
            continue
        time = header.time1.value * card.card.transform.time
        if time < 0:
            yield header.time1.field, f"TIME1 is {time:g}, a time from 0 on was expected"
        elif case.end is not None and time >= case.end:
            yield (
                header.time1.field,
                (
                    f"TIME1 is {time:g} but the run ends at {case.end:g} (ENDTIM), so nothing is ever switched; "
                    "correct one of them"
                ),
            )
        latest = header.time2
        if header.code.value != BY_TIME and not latest.problem and 0 < latest.value < header.time1.value:
            problem = f"TIME2 is {latest.value:g}, before TIME1 ({header.time1.value:g}), so nothing is ever switched"
            yield latest.field, f"{problem}; a later time was expected, or 0 for no end"


def _closed(case: Case) -> dict[tuple[SwitchSet, SwitchSet], list[Window]]:
    """Windows with both ends, by the cards that open and close them."""
    found: dict[tuple[SwitchSet, SwitchSet], list[Window]] = {}
    for window in case.windows.windows:
        if window.closed is not None:
            found.setdefault((window.opened.by, window.closed.by), []).append(window)
    return found


def _lost(window: Window) -> bool:
    return window.tr == 0 == window.td


def _order(case: Case) -> Iterator[Objection]:
    for (opening, closing), windows in _closed(case).items():
        first = windows[0]
        if first.td is not None and first.td <= first.tr and not _lost(first):
            place = opening.time_field
            yield (
                closing.time_field,
                (
                    f"{name_units(window.unit.id for window in windows)} switched back at {first.td:g} but "
                    f"made rigid at {first.tr:g} ({place.file}:{place.line}), an earlier time was expected "
                    "there; are the two times swapped?"
                ),
            )


def _zero(case: Case) -> Iterator[Objection]:
    for (opening, closing), windows in _closed(case).items():
        if _lost(windows[0]) and opening.kind == "automatic":
            place = opening.time_field
            yield (
                closing.time_field,
                (
                    f"both times of {name_units(window.unit.id for window in windows)} are 0 (the other at "
                    f"{place.file}:{place.line}); print times below 0.05 with more than one decimal"
                ),
            )


def _sampling(case: Case) -> Iterator[Objection]:
    spans = [window.td - window.tr for window in case.windows.windows if window.td is not None]
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
            yield (
                value.field,
                (
                    f"DT of *{keyword} is {interval:g}, at most {limit:g} was expected ({_INTERVALS} intervals "
                    "in the shortest rigid window) to choose a switching time from its energies; write it "
                    "more often"
                ),
            )
    whole = case.parts.all_known and (case.parts.materials or case.end_time is not None)
    if missing and whole:  # a file with nothing but cards is for another deck to include
        yield (
            next(window for window in case.windows.windows if window.closed).opened.by.card.here,
            (
                f"the deck has no {' and no '.join(missing)}, so there is no energy history to choose the "
                "times by; add what is missing"
            ),
        )


def _window(tr: str, td: str) -> Example:
    there, back = automatic(1, tr, rigid=["1"]), automatic(2, td, deformable=["1"])
    return Example(HEAD + PARTS + there + back + END)


RULES: Final = (
    Rule(
        "D2R101",
        Severity.ERROR,
        "switch time outside [0, ENDTIM)",
        "TIME1 is the switching time for CODE 0 and the earliest one for CODE 1 to 4. At or after ENDTIM of "
        "*CONTROL_TERMINATION the switch never happens, and with CODE 1 to 4 not after TIME2 either.",
        _in_run,
        (Example(GOOD),),
        (
            _window("0.02", "0.2"),
            _window("-0.02", "0.09"),
            Example(PARTS + automatic(1, "0.02", rigid=["1"], code=2).replace("       0.0", "      0.01", 1) + END),
        ),
    ),
    Rule(
        "D2R102",
        Severity.ERROR,
        "switched back before (or when) it was switched to rigid",
        "The R2D switch of a part must come after its D2R switch; the solver does not sort them for you.",
        _order,
        (Example(GOOD),),
        (_window("0.09", "0.02"), _window("0.02", "0.02")),
        solvers=BOTH,
    ),
    Rule(
        "D2R105",
        Severity.ERROR,
        "both times of a window are 0 (decimals lost in writing)",
        "Writers that print times with one decimal turn everything below 0.05 into 0.0. Two sets that "
        "both switch at 0 are a sign of it.",
        _zero,
        (Example(GOOD), _window("0.0", "0.09")),
        (_window("0.0", "0.0"),),
    ),
    Rule(
        "D2R111",
        Severity.WARNING,
        "without --history: *DATABASE_GLSTAT/_MATSUM missing, or DT above (td-tr)/200",
        "Switching times are chosen by the internal energy of a reference run: glstat holds it for the "
        "whole run, matsum for every part. Written too rarely, the energy at tr and td is not known well "
        "enough. Decks that are only switching cards, and runs with --history, are not judged.",
        _sampling,
        (Example(GOOD), Example(THERE + BACK)),
        (Example(PARTS + THERE + BACK + END), Example(GOOD.replace("    0.0001", "      0.01"))),
    ),
)
