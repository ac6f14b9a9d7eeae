"""In which order candidates are offered, and which of them keeps the limits asked for."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from d2rpick.histories.digits import above
from d2rpick.vibration.measures import TOLERATED_GROWTH

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from d2rpick.choice.candidates import Candidate, Candidates, Judged
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
    """Order candidates, best first, number them, and recommend the first that keeps the limits asked for, if any.

    Acceptable ones first, of them those on the same swing as td last: they save nothing.  Of each group first those
    of like quality, the earliest first, but where it is much the same those that leave the body out of place behind the
    others; then the rest by their error.
    """
    return next(one for one in ranked(candidates.judged) if one.situation is candidates.situation)


def ranked(judged: Judged) -> Iterator[Candidates]:
    """The same of all td that were judged together."""
    group = np.where(judged.acceptable, judged.columns["same_swing"], np.int8(2)) + 3 * judged.place
    room = np.repeat([like_quality(one) for one in judged.situations], 3)
    places = order(group, judged.error, judged.td - judged.moments.tr, judged.out_of_place, room)
    kept = judged.kept[places]
    for one, (first, last) in zip(judged.each(), pairwise(judged.ends), strict=True):
        best = np.flatnonzero(kept[first:last])
        yield replace(one, order=places[first:last], ranked=True, recommended=int(best[0]) if best.size else None)


def like_quality(situation: Situation) -> float:
    """By how much errors of pairs alike in quality differ from the smallest: of a deformation, or of the level [-]."""
    return LIKE_LEVELS if situation.vibration.unknown else EQUALLY_GOOD


def order(
    group: NDArray[np.int32], error: Samples, rigid: Samples, off: NDArray[np.bool_], room: Samples
) -> NDArray[np.intp]:
    """Give the places in the order of the groups, in each the errors within its ``room`` (g,) of the smallest first.

    Of these come the longest rigid times first, but behind those within a tenth of the longest those that are ``off``.
    The others follow by error.
    """
    good = error <= (_extreme(np.minimum, group, error, room.size) + room)[group]
    longest = _extreme(np.maximum, group, np.where(good, rigid, -np.inf), room.size)
    near = good & (rigid >= (1 - _LIKE_TIMES) * longest[group])
    return np.lexsort((-rigid, np.where(good, -rigid, error), near & off, good & ~near, ~good, group))


def _extreme(which: np.ufunc, group: NDArray[np.int32], values: Samples, groups: int) -> Samples:
    """Least or greatest of the values in each of so many groups."""
    found = np.full(groups, np.inf if which is np.minimum else -np.inf)
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
