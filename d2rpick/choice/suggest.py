"""Choosing tr for a given td: the recommendation, its rivals, the better td."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

from d2rpick.choice.acceptable_windows import acceptable_windows
from d2rpick.choice.candidates import Candidate, find_candidates
from d2rpick.choice.examine import examine
from d2rpick.choice.expectation import Expectation, expectation
from d2rpick.choice.ranking import best_of, over_limits, rank
from d2rpick.choice.warnings import Caution, cautions_of

if TYPE_CHECKING:
    from d2rpick.choice.health import Health
    from d2rpick.choice.settings import Settings
    from d2rpick.choice.situation import Situation
    from d2rpick.histories.history import History


class Pair(NamedTuple):
    """A recommended (tr, td) [time] with its residual, None on basis "energy"."""

    tr: float
    td: float
    residual: float | None

    @property
    def rigid_time(self) -> float:
        """Length of the rigid window [time]."""
        return self.td - self.tr


class AcceptableWindow(NamedTuple):
    """From ``start`` to ``end`` [time] every tr is acceptable; ``share`` is its share of the flight up to td [-]."""

    start: float
    end: float
    share: float


class Suggestion(NamedTuple):
    """Answer of ``suggest``: ranked candidates, the recommended pair, a better td, and what to be aware of.

    ``windows`` are those of acceptable tr, on basis "energy", ``td_window`` is where td was chosen, if it was;
    ``expected`` what the energy alone tells of the time after td.  ``longer`` is the longest acceptable pair in that
    window, where much saving was given up for quality.
    """

    situation: Situation
    candidates: tuple[Candidate, ...]
    recommended: Pair | None
    better_td: Pair | None
    cautions: tuple[Caution, ...]
    health: Health | None = None
    td_window: tuple[float, float] | None = None
    expected: Expectation | None = None
    windows: tuple[AcceptableWindow, ...] | None = None
    longer: Pair | None = None


def suggest(history: History, td: float, settings: Settings) -> Suggestion:
    """Rank the candidates for tr at ``td`` and recommend one; RangeError when td lies outside the record."""
    return suggest_at(examine(history, td, settings))


def suggest_at(situation: Situation) -> Suggestion:
    """Rank the candidates for tr in a situation that is known, and recommend one."""
    candidates = rank(find_candidates(situation))
    best = best_of(situation, candidates)
    if best:
        candidates = tuple(replace(c, recommended=c is best) for c in candidates)
    better = better_pair(situation)
    cautions = list(cautions_of(situation))
    if not best:
        cautions.append(Caution("no-candidate", _why_none(situation, candidates)))
    if not better:
        cautions.append(Caution("no-better-td", "no peak of the energy in the flight has an acceptable tr"))
    recommended = Pair(best.tr, situation.td, best.residual) if best else None
    expected = expectation(situation, best.energy if best else None)
    windows = _windows(situation, candidates, best)
    return Suggestion(situation, candidates, recommended, better, tuple(cautions), expected=expected, windows=windows)


def better_pair(situation: Situation) -> Pair | None:
    """Give the nearest peak of the energy in the flight that has an acceptable tr, and the best one there."""
    start = situation.earliest_tr
    if start is None:
        return None
    # where nothing tells the end of the flight, it is not sought beyond td
    end = situation.td if situation.flight.end is None and not situation.evidence.span else situation.latest_td
    for td in sorted(situation.peaks(start, end), key=lambda peak: abs(peak - situation.td)):
        there = situation.at(td)
        if there.vibration.doubts:
            continue
        best = best_of(there, rank(find_candidates(there)))
        if best and not best.same_swing:
            return Pair(best.tr, td, best.residual)
    return None


def _windows(
    situation: Situation, candidates: tuple[Candidate, ...], best: Candidate | None
) -> tuple[AcceptableWindow, ...] | None:
    """Windows of acceptable tr where the level alone decides: any tr in one is as good as a crossing."""
    if situation.basis != "energy":
        return None
    start = situation.earliest_tr
    if start is None or not situation.in_flight:
        return ()
    found = acceptable_windows(situation, candidates, best.tr if best else None)[0].tolist()
    return tuple(AcceptableWindow(low, high, (high - low) / (situation.td - start)) for low, high in found)


def _why_none(situation: Situation, ranked: tuple[Candidate, ...]) -> str:
    if not ranked:
        level = situation.energy_td
        return f"before td = {situation.td:.6g} the energy neither passes its level {level:.6g} nor turns near it"
    nearest = ranked[0]
    reasons = "; ".join((*nearest.notes, *over_limits(situation, nearest)))
    return f"none of {len(ranked)} candidates is acceptable; the nearest, tr = {nearest.tr:.6g}: {reasons}"
