"""In which order candidates are offered, and which of them keeps the limits asked for."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from d2rpick.histories.digits import above
from d2rpick.vibration.measures import TOLERATED_GROWTH

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from d2rpick.choice.candidates import Candidate, Candidates
    from d2rpick.choice.situation import Situation
    from d2rpick.histories.history import Samples

# Errors of a deformation within this of the smallest count as equally good: then the earliest tr that is safe wins.
EQUALLY_GOOD = 0.02
# Of the level of the energy alone so much: it tells the mean energy after td within a tenth at best, and swings by as
# much while td moves by less than the margin.  A timing tolerance allows the same change of an error.
LIKE_LEVELS = TOLERATED_GROWTH
# Rigid times within this share of the longest are alike: there a body that stays in place is worth more.
_LIKE_TIMES = 0.1


def rank(candidates: Candidates) -> Candidates:
    """Order candidates, best first, and number them.

    Acceptable ones first, of them those on the same swing as td last: they save nothing.  Of each group first those
    of like quality, the earliest first, but where it is much the same those that leave the body out of place behind the
    others; then the rest by their error.
    """
    acceptable = candidates.acceptable
    group = np.where(acceptable, np.where(candidates.same_swing, 1, 0), 2)
    rigid, room = candidates.situation.td - candidates.tr, like_quality(candidates.situation)
    return candidates.ordered(order(group, candidates.error, rigid, candidates.out_of_place, room))


def like_quality(situation: Situation) -> float:
    """By how much errors of pairs alike in quality differ from the smallest: of a deformation, or of the level [-]."""
    return LIKE_LEVELS if situation.vibration.unknown else EQUALLY_GOOD


def order(
    group: NDArray[np.intp], error: Samples, rigid: Samples, off: NDArray[np.bool_], room: float = EQUALLY_GOOD
) -> NDArray[np.intp]:
    """Give the places in the order of the groups, in each the errors within ``room`` of the smallest first.

    Of these come the longest rigid times first, but behind those within a tenth of the longest those that are ``off``.
    The others follow by error.
    """
    good = error <= _extreme(np.minimum, group, error)[group] + room
    near = good & (rigid >= (1 - _LIKE_TIMES) * _extreme(np.maximum, group, np.where(good, rigid, -np.inf))[group])
    return np.lexsort((-rigid, np.where(good, -rigid, error), near & off, good & ~near, ~good, group))


def _extreme(which: np.ufunc, group: NDArray[np.intp], values: Samples) -> Samples:
    """Least or greatest of the values in each group."""
    found = np.full(int(group.max(initial=0)) + 1, np.inf if which is np.minimum else -np.inf)
    which.at(found, group, values)
    return found


def over_limits(situation: Situation, candidate: Candidate) -> tuple[str, ...]:
    """Which of --max-kinetic-share and --max-residual are not kept, or cannot be judged."""
    settings = situation.settings
    limits = (
        ("kinetic share", situation.kinetic_share, settings.max_kinetic_share),
        ("residual", candidate.residual, settings.max_residual),
    )
    return tuple(
        f"{name} unknown, at most {limit:g} was asked for" if value is None
        else f"{name} {above(value, limit)} above the limit {limit:g}"
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


def recommend(ranked: Candidates) -> Candidates:
    """Recommend the first candidate that is acceptable and keeps the limits asked for, where there is one."""
    places = np.flatnonzero(kept(ranked.situation, ranked))
    return ranked.recommending(int(places[0])) if places.size else ranked
