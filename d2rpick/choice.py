"""Choosing and judging: candidates for tr at a given td, their order, the better td."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from d2rpick.candidates import Candidate, Found, find_candidates, judge
from d2rpick.cautions import POOR_KINETIC_SHARE, Caution, cautions_of
from d2rpick.crossings import find_extrema
from d2rpick.errors import RangeError
from d2rpick.situation import Settings, Situation, examine

if TYPE_CHECKING:
    from collections.abc import Iterable

    from d2rpick.history import History
    from d2rpick.switched import Comparison

# Candidates whose error is within this of the smallest count as equally good: then the longer rigid window wins.
EQUALLY_GOOD = 0.02


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
    switched: Comparison | None = None


def suggest(history: History, td: float, settings: Settings) -> Suggestion:
    """Rank the candidates for tr at ``td`` and recommend one; RangeError when td lies outside the record."""
    situation = examine(history, td, settings)
    candidates = rank(find_candidates(situation))
    best = _best(situation, candidates)
    if best:
        candidates = tuple(replace(c, recommended=c is best) for c in candidates)
    better = better_pair(situation)
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
    (candidate,) = judge(situation, [Found(tr, "given", None)])
    known = situation.flight.start is not None
    share = situation.kinetic_share
    limit = POOR_KINETIC_SHARE if settings.max_kinetic_share is None else settings.max_kinetic_share
    outside = td > situation.latest_td or (situation.earliest_tr is not None and td <= situation.earliest_tr)
    td_ok = False if outside else None if share is None else share <= limit
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


def approve(situation: Situation, times: Iterable[float]) -> list[bool]:
    """Tell for each of ``times`` before td whether ``verify`` would verify it as tr."""
    judged = judge(situation, [Found(tr, "given", None) for tr in times])
    return [candidate.acceptable and not _over_limits(situation, candidate) for candidate in judged]


def with_comparison(verdict: Verdict, comparison: Comparison) -> Verdict:
    """Add what a finished switched run shows; a wrong motion of it overrules the verdict."""
    return replace(
        verdict,
        switched=comparison,
        verified=verdict.verified and not comparison.objections,
        reasons=verdict.reasons + comparison.objections,
    )


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


def better_pair(situation: Situation) -> Pair | None:
    """Give the nearest peak of the energy in the flight that has an acceptable tr, and the best one there."""
    for td in sorted(_peaks(situation), key=lambda peak: abs(peak - situation.td)):
        there = situation.at(td)
        if situation.fitted and not there.mode:
            continue  # the oscillator has sunk into the scatter there
        best = _best(there, rank(find_candidates(there)))
        if best:
            return Pair(best.tr, td, best.residual)
    return None


def _peaks(situation: Situation) -> list[float]:
    """Peaks of the energy in the flight; where nothing tells its end, up to td."""
    start, history = situation.earliest_tr, situation.history
    if start is None:
        return []
    mode, span = situation.fitted, situation.span
    if mode and span:
        return list(mode.peaks(max(start, span.start), min(situation.latest_td, span.end)))
    extrema = find_extrema(history.time, history.energy)
    return [e.time for e in extrema if e.peak and start < e.time <= min(situation.latest_td, situation.td)]


def _why_none(situation: Situation, ranked: tuple[Candidate, ...]) -> str:
    if not ranked:
        level = situation.energy_td
        return f"before td = {situation.td:.6g} the energy neither passes its level {level:.6g} nor turns near it"
    nearest = ranked[0]
    reasons = "; ".join((*nearest.notes, *_over_limits(situation, nearest)))
    return f"none of {len(ranked)} candidates is acceptable; the nearest, tr = {nearest.tr:.6g}: {reasons}"
