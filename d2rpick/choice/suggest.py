"""Choosing and judging: candidates for tr at a given td, their order, the better td."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple, TypeVar

from d2rpick.choice.candidates import Candidate, Found, find_candidates, judge
from d2rpick.choice.expectation import Expectation, expectation
from d2rpick.choice.situation import Settings, Situation, examine
from d2rpick.choice.warnings import POOR_KINETIC_SHARE, Caution, cautions_of
from d2rpick.errors import RangeError

if TYPE_CHECKING:
    from collections.abc import Iterable

    from d2rpick.choice.comparison import Comparison
    from d2rpick.choice.health import Health
    from d2rpick.histories.energy_balance import Balance
    from d2rpick.histories.history import History

# Candidates whose error is within this of the smallest count as equally good: then the longer rigid window wins.
EQUALLY_GOOD = 0.02


class Pair(NamedTuple):
    """A recommended (tr, td) [time] with its residual, None on basis "energy"."""

    tr: float
    td: float
    residual: float | None


class Suggestion(NamedTuple):
    """Answer of ``suggest``: ranked candidates, the recommended pair, a better td, and what to be aware of.

    ``td_window`` is where td was chosen, if it was; ``expected`` what the energy alone tells of the time after td.
    """

    situation: Situation
    candidates: tuple[Candidate, ...]
    recommended: Pair | None
    better_td: Pair | None
    cautions: tuple[Caution, ...]
    health: Health | None = None
    td_window: tuple[float, float] | None = None
    expected: Expectation | None = None


class Verdict(NamedTuple):
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
    health: Health | None = None


_Answer = TypeVar("_Answer", Suggestion, Verdict)


def suggest(history: History, td: float, settings: Settings) -> Suggestion:
    """Rank the candidates for tr at ``td`` and recommend one; RangeError when td lies outside the record."""
    situation = examine(history, td, settings)
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
    recommended = Pair(best.tr, td, best.residual) if best else None
    expected = expectation(situation, best.energy if best else None)
    return Suggestion(situation, candidates, recommended, better, tuple(cautions), expected=expected)


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


def with_health(answer: _Answer, balance: Balance) -> _Answer:
    """Add how far the reference run can be trusted, above all in the rigid window, else in the flight up to td.

    ``balance`` is that of the reference run up to td: what comes later does not matter for the choice.
    """
    from d2rpick.choice.health import assess, cautions_of_health

    history, td = answer.situation.history, answer.situation.td
    if isinstance(answer, Verdict):
        start: float | None = answer.candidate.tr
    else:
        start = answer.recommended.tr if answer.recommended else answer.situation.earliest_tr
    window = None if start is None or start >= td else (start, td)
    locked = history.mean_energy(*window) if window else None
    health = assess(balance, window, locked)
    return answer._replace(health=health, cautions=answer.cautions + tuple(cautions_of_health(health)))


def with_comparison(verdict: Verdict, comparison: Comparison) -> Verdict:
    """Add what a finished switched run shows; a wrong motion of it overrules the verdict."""
    return verdict._replace(
        switched=comparison,
        verified=verdict.verified and not comparison.objections,
        reasons=verdict.reasons + comparison.objections,
    )


def rank(candidates: Iterable[Candidate]) -> tuple[Candidate, ...]:
    """Order candidates, best first, and number them.

    Acceptable ones first, of them those on the same swing as td last: they save nothing.  Of each group first those
    whose error is within 0.02 of the smallest, by the length of the rigid window; then the others by their error.
    """
    ordered: list[Candidate] = []
    candidates = list(candidates)
    worth = [(not c.acceptable, c.acceptable and c.same_swing) for c in candidates]
    for wanted in sorted(set(worth)):
        group = [c for c, own in zip(candidates, worth, strict=True) if own == wanted]
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


def best_of(situation: Situation, ranked: Iterable[Candidate]) -> Candidate | None:
    """Give the first acceptable candidate that keeps the limits asked for."""
    return next((c for c in ranked if c.acceptable and not _over_limits(situation, c)), None)


def better_pair(situation: Situation) -> Pair | None:
    """Give the nearest peak of the energy in the flight that has an acceptable tr, and the best one there."""
    start = situation.earliest_tr
    if start is None:
        return None
    # where nothing tells the end of the flight, it is not sought beyond td
    end = situation.td if situation.flight.end is None and not situation.span else situation.latest_td
    for td in sorted(situation.peaks(start, end), key=lambda peak: abs(peak - situation.td)):
        there = situation.at(td)
        if situation.fitted and not there.mode:
            continue  # the oscillator has sunk into the scatter there
        best = best_of(there, rank(find_candidates(there)))
        if best and not best.same_swing:
            return Pair(best.tr, td, best.residual)
    return None


def _why_none(situation: Situation, ranked: tuple[Candidate, ...]) -> str:
    if not ranked:
        level = situation.energy_td
        return f"before td = {situation.td:.6g} the energy neither passes its level {level:.6g} nor turns near it"
    nearest = ranked[0]
    reasons = "; ".join((*nearest.notes, *_over_limits(situation, nearest)))
    return f"none of {len(ranked)} candidates is acceptable; the nearest, tr = {nearest.tr:.6g}: {reasons}"
