"""From the files of a run to an answer: read, examine, choose or verify, and judge the health of the run.

The command line, ``study``, ``check --history``, ``card`` and Python go this one way, and get the same numbers.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, TypeVar

from d2rpick.choice.answers import Suggestion, Verdict, suggest_at, verify, verify_at
from d2rpick.choice.health import OF_THE_MODEL, assess, cautions_of_health, refuse_unsound
from d2rpick.choice.situation import Situation, examine
from d2rpick.choice.warnings import cautions_of_engine
from d2rpick.histories.balance import balance_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from d2rpick.choice.question import Reference, Settings
    from d2rpick.histories.history import Track
    from d2rpick.histories.names import Part
    from d2rpick.histories.run import Run
    from d2rpick.vibration.span import Fits

_Answer = TypeVar("_Answer", Suggestion, Verdict)


def suggest_of(
    reference: Reference,
    td: float | tuple[float, float] | None,
    settings: Settings,
    *,
    with_better: bool = True,
    fits: Fits | None = None,
    since: float | None = None,
    times: Sequence[float] | None = None,
) -> Suggestion:
    """Choose tr for ``td``, or both times with td in a window (low, high) or, for None, in the longest flight [time].

    ``with_better`` False: for a given td no better one is looked for.  ``fits`` are those of an earlier look at the
    record with the same settings.  For a td in a window: no flight is taken to begin before ``since``, and ``times``
    are td that are looked at beside the peaks of the energy, by default an even grid [time].

    Raises
    ------
    RangeError
        If td or the window lies outside the record, no flight is seen, or the run cannot be judged.
    """
    refuse_unsound(reference.history, settings, td)
    if td is None or isinstance(td, tuple):
        from d2rpick.choice.suggest_td import suggest_in_window

        answer = suggest_in_window(reference.history, td, settings, fits, since, times)
    else:
        answer = suggest_at(examine(reference.history, td, settings, fits), with_better=with_better)
    return _with_health(answer, reference.run)


def verify_of(reference: Reference, tr: float, td: float, settings: Settings) -> Verdict:
    """Judge one pair of switch times.

    Raises
    ------
    RangeError
        If a time lies outside the record or tr is not before td.
    """
    refuse_unsound(reference.history, settings, td, choosing=False)
    return _with_health(verify(reference.history, tr, td, settings), reference.run)


def judge_of(reference: Reference, known: Situation, tr: float, td: float) -> Verdict:
    """Judge a pair whose td is that of a situation, or nearly so as it is printed, as `verify_of` does.

    Raises
    ------
    RangeError
        If a time lies outside the record or tr is not before td.
    """
    there = known if td == known.td else examine(reference.history, td, known.settings, known.fits)
    return _with_health(verify_at(there, tr), reference.run)


def compare_with(verdict: Verdict, reference: Reference, switched: Reference, min_mean: float = 0.0) -> Verdict:
    """Hold a finished switched run, read in the same way, against the reference by which its times were judged.

    ``min_mean`` is the least mean energy after td that is expected, as a share of the reference's [-].

    Raises
    ------
    RangeError
        If one of the two runs does not go on after td.
    """
    from d2rpick.choice.comparison import compare_runs
    from d2rpick.choice.switched_run import judged_parts

    situation, run = verdict.situation, reference.run
    flight, parts = situation.flight, situation.history.parts
    together = flight.parts if flight.source == "momentum" else flight.parts or parts
    pair = verdict.candidate.tr, situation.td
    judged = judged_parts(reference, switched, pair)
    found = compare_runs(
        judged.reference,
        judged.switched,
        pair,
        situation.latest_td if situation.latest_td > situation.td else float("inf"),
        situation.settings.tolerance,
        momenta=(run.momentum(together), _momentum(switched.run, together)),
        centres=(run.centre(parts), switched.run.centre(parts)) if parts else (None, None),
        known=judged.known,
        min_mean=min_mean,
    )
    objections = (*judged.objections, *found.objections)
    return replace(
        verdict,
        switched=found._replace(objections=objections, notes=(*judged.notes, *found.notes)),
        verified=verdict.verified and not objections,  # a wrong motion overrules the verdict
        reasons=verdict.reasons + objections,
        cautions=(*verdict.cautions, *cautions_of_engine(switched.run.sources)),
    )


def _with_health(answer: _Answer, run: Run) -> _Answer:
    """Add how far the run can be trusted, above all in the rigid window, else in the flight up to td.

    What comes after td does not matter for the choice.
    """
    answer = replace(answer, cautions=(*answer.cautions, *cautions_of_engine(run.sources)))
    history, td = answer.situation.history, answer.situation.td
    balance = balance_of(run.databases, history.parts, td)
    if balance is None:
        return answer
    if isinstance(answer, Verdict):
        start: float | None = answer.candidate.tr
    else:
        start = answer.recommended.tr if answer.recommended else answer.situation.earliest_tr
    window = None if start is None or start >= td else (start, td)
    locked = history.mean_energy(*window) if window else None
    health = assess(balance, window, locked, td)
    cautions = tuple(cautions_of_health(health, at_rest=answer.situation.at_rest))
    flight = answer.situation.flight
    if (
        window
        and flight.by_parts
        and flight.start is not None
        and flight.start <= window[0]
        and answer.situation.in_flight
    ):
        cautions = tuple(one for one in cautions if one.code not in OF_THE_MODEL)
    return replace(answer, health=health, cautions=answer.cautions + cautions)


def _momentum(run: Run, parts: Sequence[Part] | None) -> Track | None:
    """Momentum of some parts, None also where the run does not have them all."""
    missing = {part.id for part in parts or ()} - {part.id for part in run.parts}
    return None if missing else run.momentum(parts)
