"""Choosing and judging: candidates for tr at a given td, their order, the better td."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from d2rpick import measures
from d2rpick.cautions import POOR_KINETIC_SHARE, Caution, cautions_of
from d2rpick.crossings import find_crossings, find_extrema
from d2rpick.errors import RangeError
from d2rpick.replay import Replay, from_mode
from d2rpick.situation import Settings, Situation, examine
from d2rpick.uncertainty import fitted_reach, sampled_reach

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from d2rpick.history import History, Samples

# Candidates whose error is within this of the smallest count as equally good: then the longer rigid window wins.
EQUALLY_GOOD = 0.02


@dataclass(frozen=True)
class Candidate:
    """One tr for the td of a situation; fields are the keys of the JSON output, None where nothing can be said.

    Times in the unit of the history; ``level_error``, ``lock_in_error``, ``residual`` and ``rigid_fraction``
    without unit.  ``kind``: "crossing" of the level or "extremum" near it ("given" for a pair to be verified).
    ``acceptable``: in the flight, same sign, error within tolerance; else ``notes`` say why not.
    """

    rank: int
    tr: float
    kind: str
    energy: float
    energy_ratio: float | None
    level_error: float | None
    rising: bool | None
    sign_match: bool | None
    lock_in_error: float | None
    residual: float | None
    part_mismatch: float | None
    rigid_time: float
    rigid_fraction: float
    timing_tolerance: float | None
    tr_low: float | None
    tr_high: float | None
    acceptable: bool
    recommended: bool
    notes: tuple[str, ...]

    @property
    def lock_in(self) -> float:
        """What the tolerance judges: the lock-in error, else the level error; infinite when neither is known."""
        error = self.level_error if self.lock_in_error is None else self.lock_in_error
        return np.inf if error is None else error

    @property
    def error(self) -> float:
        """What the order goes by: the residual, on basis "energy" the level error; infinite when unknown."""
        error = self.residual if self.residual is not None else self.level_error
        return np.inf if error is None else error


@dataclass(frozen=True)
class Pair:
    """A recommended (tr, td) [time] with its residual, None on basis "energy"."""

    tr: float
    td: float
    residual: float | None


@dataclass(frozen=True)
class Suggestion:
    """Answer of ``suggest``: ranked candidates, the recommended pair, a better td, and what to be aware of."""

    situation: Situation
    candidates: tuple[Candidate, ...]
    recommended: Pair | None
    better_td: Pair | None
    cautions: tuple[Caution, ...]


@dataclass(frozen=True)
class Verdict:
    """Answer of ``verify``: the measures of one pair, and what is right or wrong with it.

    ``tr_ok`` and ``td_ok`` are None where the record does not tell.
    """

    situation: Situation
    candidate: Candidate
    tr_ok: bool | None
    td_ok: bool | None
    verified: bool
    reasons: tuple[str, ...]
    cautions: tuple[Caution, ...]


def suggest(history: History, td: float, settings: Settings) -> Suggestion:
    """Rank the candidates for tr at ``td`` and recommend one; RangeError when td lies outside the record."""
    situation = examine(history, td, settings)
    candidates = rank(find_candidates(situation))
    best = _best(situation, candidates)
    if best:
        candidates = tuple(replace(c, recommended=c is best) for c in candidates)
    better = _better_td(situation)
    cautions = list(cautions_of(situation))
    if not best:
        cautions.append(Caution("no-candidate", _why_none(situation, candidates)))
    if not better:
        cautions.append(Caution("no-better-td", "no peak of the energy in the flight has an acceptable tr"))
    recommended = Pair(best.tr, td, best.residual) if best else None
    return Suggestion(situation, candidates, recommended, better, tuple(cautions))


def verify(history: History, tr: float, td: float, settings: Settings) -> Verdict:
    """Judge one pair; RangeError when a time lies outside the record or tr is not before td."""
    if not tr < td:
        raise RangeError(f"tr {tr:g} is not before td {td:g}; the part is rigid from tr to td")
    situation = examine(history, td, settings)
    history.energy_at(tr)
    candidate = _judge(situation, [(tr, "given", None)])[0]
    known = situation.flight.start is not None
    share = situation.kinetic_share
    limit = POOR_KINETIC_SHARE if settings.max_kinetic_share is None else settings.max_kinetic_share
    td_ok = False if td > situation.latest_td else None if share is None else share <= limit
    over = _over_limits(situation, candidate)
    reasons = (*candidate.notes, *over)
    return Verdict(
        situation=situation,
        candidate=candidate,
        tr_ok=candidate.acceptable if known else None,
        td_ok=td_ok,
        verified=candidate.acceptable and not over,
        reasons=reasons,
        cautions=tuple(cautions_of(situation)),
    )


def find_candidates(situation: Situation) -> tuple[Candidate, ...]:
    """All crossings of the level before td, and the extrema near enough to it, judged, in the order of time."""
    found = [*_from_samples(situation), *_from_mode(situation)]
    judged = _judge(situation, sorted(found, key=lambda one: one[0]))
    tolerance = situation.settings.tolerance
    return tuple(c for c in judged if c.kind == "crossing" or c.lock_in <= tolerance)


def rank(candidates: Iterable[Candidate]) -> tuple[Candidate, ...]:
    """Order candidates, best first, and number them.

    Acceptable ones first; of these, and of the rest, first those whose error is within 0.02 of the smallest,
    by the length of the rigid window; then the others by their error.
    """
    ordered: list[Candidate] = []
    candidates = list(candidates)
    for acceptable in (True, False):
        group = [c for c in candidates if c.acceptable == acceptable]
        limit = min((c.error for c in group), default=0.0) + EQUALLY_GOOD
        good = sorted((c for c in group if c.error <= limit), key=lambda c: c.tr)
        ordered += good + sorted((c for c in group if c.error > limit), key=lambda c: (c.error, c.tr))
    return tuple(replace(c, rank=i) for i, c in enumerate(ordered, start=1))


Found = tuple[float, str, bool | None]  # tr, kind, rising


def _from_samples(situation: Situation) -> list[Found]:
    """Crossings and extrema of the sampled record, up to where an oscillator takes over."""
    history, td = situation.history, situation.td
    before = history.time < td
    time = np.append(history.time[before], td)
    energy = np.append(history.energy[before], situation.energy_td)
    end = situation.span.start if situation.mode and situation.span else td
    crossings = find_crossings(time, energy, situation.energy_td)
    found: list[Found] = [(c.time, "crossing", c.rising) for c in crossings if c.time < end]
    if not situation.mode:
        found += [(e.time, "extremum", None) for e in find_extrema(time, energy)]
    return found


def _from_mode(situation: Situation) -> list[Found]:
    """Exact crossings and standstills of the oscillator between the end of the load and td."""
    mode, td = situation.mode, situation.td
    if not mode or not situation.span:
        return []
    start = situation.span.start
    level = float(mode.deformation(td))
    times = sorted({t for q in (level, -level) for t in mode.crossings(q, start, td)})
    rising = [bool(mode.deformation(t) * mode.velocity(t) > 0) for t in times]
    found: list[Found] = [(t, "crossing", up) for t, up in zip(times, rising, strict=True)]
    return found + [(t, "extremum", None) for t in mode.extrema(start, td)]


def _judge(situation: Situation, found: list[Found]) -> list[Candidate]:
    """Measure each tr and hold it against flight, sign and tolerance."""
    if not found:
        return []
    low, high = _interval(situation, np.array([tr for tr, _, _ in found]))
    return [
        _candidate(situation, *one, low=float(a), high=float(b)) for one, a, b in zip(found, low, high, strict=True)
    ]


def _interval(situation: Situation, times: Samples) -> tuple[Samples, Samples]:
    """Bounds of the true tr, from the samples or, in the flight of an oscillator, from its fit."""
    history, td, fit, mode = situation.history, situation.td, situation.fit, situation.mode
    reach = sampled_reach(history, times, td)
    if mode and fit:
        described = np.array([situation.described(float(t)) for t in times])
        reach = np.where(described, fitted_reach(history, fit, mode, times, td), reach)
    return times - reach, times + reach


def _candidate(
    situation: Situation, tr: float, kind: str, rising: bool | None, *, low: float, high: float
) -> Candidate:
    history, td, mode = situation.history, situation.td, situation.mode
    energy, energy_td = situation.energy_at(tr), situation.energy_td
    level_error = measures.level_error(energy, energy_td)
    sign_match = lock_in = residual = tolerance = None
    if mode and situation.described(tr):
        sign_match = bool(mode.deformation(tr) * mode.deformation(td) >= 0)
        lock_in = measures.lock_in_error(mode, tr, td)
        residual = Replay(*from_mode(mode, tr), origin=tr, tr=tr, td=td).residual()
        tolerance = measures.timing_tolerance(mode, tr, td)
    objections = tuple(_objections(situation, tr, sign_match, level_error if lock_in is None else lock_in))
    return Candidate(
        rank=0,
        tr=tr,
        kind=kind,
        energy=energy,
        energy_ratio=energy / energy_td if energy_td > 0 else None,
        level_error=level_error,
        rising=rising,
        sign_match=sign_match,
        lock_in_error=lock_in,
        residual=residual,
        part_mismatch=None,
        rigid_time=td - tr,
        rigid_fraction=(td - tr) / float(history.time[-1] - history.time[0]),
        timing_tolerance=tolerance,
        tr_low=low,
        tr_high=high,
        acceptable=not objections,
        recommended=False,
        notes=objections + tuple(_remarks(situation, (high - low) / 2, tolerance)),
    )


def _objections(situation: Situation, tr: float, sign_match: bool | None, error: float | None) -> Iterator[str]:
    """Why this tr is not acceptable, one sentence each."""
    earliest = situation.earliest_tr
    if earliest is None:
        yield "unknown: nothing shows when the load is over"
    elif tr < earliest:
        yield f"before the end of the load at {earliest:.6g}"
    if situation.td > situation.latest_td:
        yield f"td after the end of the flight at {situation.latest_td:.6g}"
    if situation.mode and sign_match is None:
        yield "not described by the oscillator"
    elif sign_match is False:
        yield "opposite sign of the deformation"
    elif error is None:
        yield "no positive energy to compare"
    elif error > situation.settings.tolerance:
        yield f"error {error:.3g} above the tolerance {situation.settings.tolerance:g}"


def _remarks(situation: Situation, reach: float, tolerance: float | None) -> Iterator[str]:
    """What to know of this tr beside its acceptance."""
    if situation.mode is None and situation.no_mode:
        yield f"sign, lock-in error and residual unknown: {situation.no_mode}"
    elif tolerance is None:
        yield "sign, lock-in error and residual unknown where the oscillator does not describe the record"
    if tolerance is not None and reach > tolerance:
        yield f"tr is known to ±{reach:.2g} only, its timing tolerance is {tolerance:.2g}"
    if tolerance is None and reach >= situation.history.step:
        yield "the level lies within the sampling error of an extremum"


def _over_limits(situation: Situation, candidate: Candidate) -> tuple[str, ...]:
    """Which of --max-kinetic-share and --max-residual are not kept, or cannot be judged."""
    settings = situation.settings
    limits = (
        ("kinetic share", situation.kinetic_share, settings.max_kinetic_share),
        ("residual", candidate.residual, settings.max_residual),
    )
    return tuple(
        f"{name} unknown, at most {limit:g} was asked for" if value is None
        else f"{name} {value:.3g} above the limit {limit:g}"
        for name, value, limit in limits
        if limit is not None and (value is None or value > limit)
    )  # fmt: skip


def _best(situation: Situation, ranked: Iterable[Candidate]) -> Candidate | None:
    return next((c for c in ranked if c.acceptable and not _over_limits(situation, c)), None)


def _better_td(situation: Situation) -> Pair | None:
    """Give the nearest peak of the energy in the flight that has an acceptable tr, and the best one there."""
    for td in sorted(_peaks(situation), key=lambda peak: abs(peak - situation.td)):
        there = situation.at(td)
        best = _best(there, rank(find_candidates(there)))
        if best:
            return Pair(best.tr, td, best.residual)
    return None


def _peaks(situation: Situation) -> list[float]:
    """Peaks of the energy in the flight; where nothing tells its end, up to td."""
    start, history = situation.earliest_tr, situation.history
    if start is None:
        return []
    if situation.mode and situation.span:
        return list(
            situation.mode.peaks(max(start, situation.span.start), min(situation.latest_td, situation.span.end))
        )
    extrema = find_extrema(history.time, history.energy)
    return [e.time for e in extrema if e.peak and start < e.time <= min(situation.latest_td, situation.td)]


def _why_none(situation: Situation, ranked: tuple[Candidate, ...]) -> str:
    if not ranked:
        level = situation.energy_td
        return f"before td = {situation.td:.6g} the energy neither passes its level {level:.6g} nor turns near it"
    nearest = ranked[0]
    reasons = "; ".join((*nearest.notes, *_over_limits(situation, nearest)))
    return f"none of {len(ranked)} candidates is acceptable; the nearest, tr = {nearest.tr:.6g}: {reasons}"
