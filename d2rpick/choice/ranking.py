"""In which order candidates are offered, and which of them keeps the limits asked for."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from d2rpick.choice.candidates import Candidate, Candidates
    from d2rpick.choice.situation import Situation
    from d2rpick.histories.history import Samples

# Candidates whose error is within this of the smallest count as equally good: then the longer rigid window wins.
EQUALLY_GOOD = 0.02


def rank(candidates: Candidates) -> Candidates:
    """Order candidates, best first, and number them.

    Acceptable ones first, of them those on the same swing as td last: they save nothing.  Of each group first those
    whose error is within 0.02 of the smallest, by the length of the rigid window; then the others by their error.
    """
    acceptable = candidates.acceptable
    group = np.where(acceptable, np.where(candidates.same_swing, 1, 0), 2)
    return candidates.ordered(order(group, candidates.error, candidates.tr))


def order(group: NDArray[np.intp], error: Samples, tr: Samples) -> NDArray[np.intp]:
    """Give the places in the order of the groups; in each the smallest errors by tr, then the others by error."""
    least = np.full(int(group.max(initial=0)) + 1, np.inf)
    np.minimum.at(least, group, error)
    good = error <= least[group] + EQUALLY_GOOD
    return np.lexsort((tr, np.where(good, tr, error), ~good, group))


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


def kept(situation: Situation, candidates: Candidates) -> NDArray[np.bool_]:
    """Which of the candidates are acceptable and keep the limits asked for, by the same rule."""
    share, settings = situation.kinetic_share, situation.settings
    found = candidates.acceptable
    if settings.max_kinetic_share is not None:
        found = found & (share is not None and share <= settings.max_kinetic_share)
    if settings.max_residual is not None:
        found = found & (candidates.residual <= settings.max_residual)  # not where unknown, NaN
    return found


def best_of(situation: Situation, ranked: Candidates) -> Candidate | None:
    """Give the first candidate that is acceptable and keeps the limits asked for."""
    places = np.flatnonzero(kept(situation, ranked))
    return ranked[int(places[0])] if places.size else None
