"""In which order candidates are offered, and which of them keeps the limits asked for."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable

    from d2rpick.choice.candidates import Candidate
    from d2rpick.choice.situation import Situation

# Candidates whose error is within this of the smallest count as equally good: then the longer rigid window wins.
EQUALLY_GOOD = 0.02


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


def over_limits(situation: Situation, candidate: Candidate) -> tuple[str, ...]:
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


def keeps(situation: Situation, candidate: Candidate) -> bool:
    """Whether a candidate is acceptable and keeps the limits asked for: the rule of ``verify``."""
    return candidate.acceptable and not over_limits(situation, candidate)


def best_of(situation: Situation, ranked: Iterable[Candidate]) -> Candidate | None:
    """Give the first candidate that is acceptable and keeps the limits asked for."""
    return next((c for c in ranked if keeps(situation, c)), None)
