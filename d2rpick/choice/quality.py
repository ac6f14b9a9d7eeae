"""How good a pair is: the order in which candidates are offered, the limits that it keeps, and its grade."""

from __future__ import annotations

from itertools import chain, pairwise
from typing import TYPE_CHECKING, Final

import numpy as np

from d2rpick.base.tuples import NamedTuple
from d2rpick.choice.aftermath import worth_of_error
from d2rpick.choice.candidates import Candidates, judged_of
from d2rpick.histories.digits import format_above_limit
from d2rpick.vibration.identify import MIN_PLASTIC, MIN_SAMPLES_PER_PERIOD
from d2rpick.vibration.measures import TOLERATED_GROWTH

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from numpy.typing import NDArray

    from d2rpick.choice.aftermath import Worth
    from d2rpick.choice.candidates import Candidate, Judged
    from d2rpick.choice.situation import Situation
    from d2rpick.histories.history import Samples

# Errors of a deformation within this of the smallest count as equally good: then the earliest tr that is safe wins.
EQUALLY_GOOD = 0.02
# Of the level of the energy alone so much: it tells the mean energy after td within a tenth at best, and swings by as
# much while td moves by less than the margin.  A timing tolerance allows the same change of an error.
LIKE_LEVELS = TOLERATED_GROWTH
# Level error that rounding leaves of a crossing at most, of a level above this share of the highest energy.
ROUNDING: Final = 1e-3
# Errors are compared to so many decimals.  Pairs of equal error, as on all swings of one mode, differ in the last
# digits by how the numbers were written: those would decide which pair comes first.
_DECIMALS: Final = 4
# Rigid times within this share of the longest are alike: there a body that stays in place is worth more.
_LIKE_TIMES = 0.1


def candidates_at(
    situations: Sequence[Situation], *, in_flight: bool = False
) -> Iterator[Candidates]:
    """Give the candidates of each td of one record, by `judged_of`, best first, one of them recommended."""
    return chain.from_iterable(map(ranked, judged_of(situations, in_flight=in_flight)))


def ranked(judged: Judged) -> Iterator[Candidates]:
    """Order the candidates of each td, best first, number them, and recommend the first that keeps the limits, if any.

    Acceptable ones first, of them those on the same swing as td, or near it, last: they save little.  Of each group
    first those of like quality, the earliest first, but where it is much the same those that leave the body out of
    place behind the others; then the rest by their error.
    """
    rigid = judged.td - judged.moments.tr
    late = (judged.columns["same_swing"] != 0) | judged.near_td
    group = np.where(judged.acceptable, late, np.int8(2)) + 3 * judged.place
    room = np.repeat([like_quality(one) for one in judged.situations], 3)
    places = order(group, judged.error, rigid, judged.out_of_place, room)
    kept = judged.kept[places]
    for one, (first, last) in zip(
        judged.situations, pairwise(judged.ends), strict=True
    ):
        best = np.flatnonzero(kept[first:last])
        yield Candidates(
            one,
            judged,
            places[first:last],
            ranked=True,
            recommended=int(best[0]) if best.size else None,
        )


def like_quality(situation: Situation) -> float:
    """By how much errors of pairs alike in quality differ from the smallest: of a deformation, or of the level [-]."""
    return LIKE_LEVELS if situation.vibration.unknown else EQUALLY_GOOD


def order(
    group: NDArray[np.int32],
    error: Samples,
    rigid: Samples,
    off: NDArray[np.bool_],
    room: Samples,
) -> NDArray[np.intp]:
    """Give the places in the order of the groups, in each the errors within its ``room`` (g,) of the smallest first.

    Of these come the longest rigid times first, but behind those within a tenth of the longest those that are ``off``.
    The others follow by error.
    """
    error = np.round(error, _DECIMALS)
    good = error <= (_extreme(np.minimum, group, error, room.size) + room)[group]
    longest = _extreme(np.maximum, group, np.where(good, rigid, -np.inf), room.size)
    near = good & (rigid >= (1 - _LIKE_TIMES) * longest[group])
    return np.lexsort(
        (-rigid, np.where(good, -rigid, error), near & off, good & ~near, ~good, group)
    )


def _extreme(
    which: np.ufunc, group: NDArray[np.int32], values: Samples, groups: int
) -> Samples:
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
        else f"{name} {format_above_limit(value, limit)} above the limit {limit:g}"
        for name, value, limit in limits
        if limit is not None and (value is None or value > limit)
    )  # fmt: skip


# From the worst to the best.
GRADES: Final = ("poor", "fair", "good")
# Of the vibration [-].  A residual of a half is a quarter of its energy; beyond, the error is what an engineer sees of
# the motion after td.  A good pair keeps what the tolerance on tr asks for by default.
_MOST_FAIR, MOST_GOOD = 0.5, 0.2
# What a further mode may make of it at most in a good pair: a good grade is a promise.
_MOST_HIDDEN: Final = 0.3
# Of the standard deviation: an energy passes its mean when it gets so far beyond it; noise near it does not count.
_BAND: Final = 0.25
# Of the energy that the next contact puts into the parts: an error of the vibration with less of it does not make a
# pair worse than good, or than fair (docs/validation.md).
_HARDLY_GOOD, _HARDLY_FAIR = 0.01, 0.05
_NOT_CERTAIN: Final = "the flight is not certain"
_UNKNOWN_LOAD: Final = (
    "momentum or energy changes in the flight, by gravity or by another load"
)


class Grade(NamedTuple):
    """A ``grade``, one of `GRADES`, and the ``reasons`` why it is none better; empty for "good"."""

    grade: str
    reasons: tuple[str, ...] = ()

    @classmethod
    def of(cls, poor: Sequence[str], fair: Sequence[str]) -> Grade:
        """Grade by the reasons for "poor", else by those for "fair"."""
        if poor:
            return cls("poor", tuple(poor))
        return cls("fair", tuple(fair)) if fair else cls("good")


class Quality(NamedTuple):
    """Two statements on a pair: how the ``motion`` comes out, and the ``vibration`` after td; the worse one counts.

    ``alone``: the grade of the vibration by itself, which ``worth`` may raise: what its error is worth in the next
    contact, None if that is not known.
    """

    motion: Grade
    vibration: Grade
    alone: Grade
    worth: Worth | None = None

    @property
    def grade(self) -> str:
        """The worse of the two grades."""
        return min((self.motion.grade, self.vibration.grade), key=GRADES.index)

    @property
    def reasons(self) -> tuple[str, ...]:
        """Why the grade is none better."""
        both = (self.motion, self.vibration)
        return tuple(
            reason for one in both if one.grade == self.grade for reason in one.reasons
        )

    @property
    def told(self) -> str:
        """The grade, and why it is none better."""
        return f"{self.grade}{': ' * bool(self.reasons)}{'; '.join(self.reasons)}"


def quality_of(situation: Situation, best: Candidate) -> Quality:
    """Grade the recommended tr of a td: its motion, and its vibration, also by what its error is worth."""
    flight = situation.flight
    uncertain = () if flight.certain else (_NOT_CERTAIN,)
    motion = Grade.of(
        (*situation.settings.ruined, *(_UNKNOWN_LOAD,) * flight.unknown_load), uncertain
    )
    if situation.at_rest:
        return Quality(motion, Grade("good"), Grade("good"))
    alone = Grade.of(_poor(situation, best), _fair(best))
    worth = worth_of_error(situation, best)
    counted = alone if situation.settings.keep_vibration else _weighed(alone, worth)
    return Quality(motion, counted, alone, worth)


def _weighed(alone: Grade, worth: Worth | None) -> Grade:
    """Raise the grade of a vibration whose error hardly matters in the next contact."""
    if worth is None or alone.grade == "good" or worth.share > _HARDLY_FAIR:
        return alone
    if worth.share <= _HARDLY_GOOD:
        return Grade("good")
    return Grade("fair", alone.reasons)


def _poor(situation: Situation, best: Candidate) -> list[str]:
    found = []
    if best.residual is None:
        found.append(
            f"how the deformations at tr and td lie to each other is unknown{_refusal(situation)}"
        )
    elif best.residual > _MOST_FAIR:
        found.append(f"the vibration after td is off by {best.residual:.0%}")
    if situation.basis == "energy":
        found += _of_record(situation)
    return found


def _refusal(situation: Situation) -> str:
    """Say why the modes could not be identified."""
    refusal = situation.evidence.refusal
    return f": {refusal}" if refusal else ""


def _of_record(situation: Situation) -> list[str]:
    """Why the samples of the flight up to td are none that a level can be read from."""
    start = situation.flight.start
    _, energy = situation.history.between(
        -np.inf if start is None else start, situation.td
    )
    found = []
    if energy.size and energy.min() < MIN_PLASTIC * np.abs(energy).max():
        found.append("the record falls below zero, as no internal energy does")
    states = states_per_period(energy)
    if states is not None and states < MIN_SAMPLES_PER_PERIOD:
        found.append(
            f"the record has {states:.2g} states per period, fewer than the {MIN_SAMPLES_PER_PERIOD} that show a level"
        )
    return found


def _is_loose(best: Candidate) -> bool:
    """Whether the lock-in error may be above what is good, as far as tr is known."""
    if best.tr_high is None or best.timing_tolerance is None:
        return False
    return (
        TOLERATED_GROWTH * (best.tr_high - best.tr) > MOST_GOOD * best.timing_tolerance
    )


def _fair(best: Candidate) -> list[str]:
    found: list[str] = []
    if best.residual is None:
        return found
    if best.residual > MOST_GOOD:
        found.append(f"the vibration after td is off by {best.residual:.0%}")
    elif _is_loose(best):
        found.append("tr is not known well enough for its timing tolerance")
    if best.residual_high is not None and best.residual_high > _MOST_HIDDEN:
        found.append(f"it may be off by up to {best.residual_high:.0%}")
    return found


def states_per_period(energy: Samples) -> float | None:
    """How many samples a period of the energy has on average: it passes its mean twice in one; None without a period.

    Examples
    --------
    >>> round(states_per_period(np.sin(np.arange(1000) * 2 * np.pi / 8) ** 2))
    4
    """
    if energy.size < 2:
        return None
    off = energy - energy.mean()
    side = np.sign(off[np.abs(off) > _BAND * off.std()])
    passes = np.flatnonzero(np.diff(side)).size
    return 2 * energy.size / passes if passes > 1 else None
