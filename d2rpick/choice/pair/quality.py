"""Rank candidates by quality, test the limits of a recommendation, and grade a pair."""

from __future__ import annotations

from itertools import chain, pairwise
from typing import TYPE_CHECKING, Final

import numpy as np

from d2rpick.base.errors import list_names
from d2rpick.base.memory import remember
from d2rpick.base.tuples import NamedTuple
from d2rpick.choice.pair.aftermath import (
    compare_error_with_contact,
    compute_static_change,
)
from d2rpick.choice.pair.candidates import Candidates, judge_candidates
from d2rpick.choice.pair.few_states import ENOUGH_STATES
from d2rpick.choice.pair.grades import (
    FAIR,
    GOOD,
    GRADES,
    MIN_MEAN_ENERGY,
    POOR,
    format_residual,
)
from d2rpick.choice.pair.moving_apart import find_parts_moving_apart
from d2rpick.choice.pair.warnings import (
    POOR_KINETIC_SHARE,
    POOR_RESIDUAL,
    list_times_outside_flight,
)
from d2rpick.histories.samples import changes_at_random
from d2rpick.histories.surroundings import UNKNOWN
from d2rpick.vibration.identify import MIN_PLASTIC, MIN_SAMPLES_PER_PERIOD
from d2rpick.vibration.measures import TOLERATED_GROWTH
from d2rpick.vibration.model import NOTHING_KEPT

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from numpy.typing import NDArray

    from d2rpick.choice.pair.aftermath import Worth
    from d2rpick.choice.pair.candidates import Candidate, Judged, Pair
    from d2rpick.choice.pair.moving_apart import MovingApart
    from d2rpick.choice.pair.situation import Situation
    from d2rpick.histories.history import History, Samples

# Deformation errors that exceed the smallest error by at most this are treated as equal [-].
EQUALLY_GOOD = 0.02
# Pairs whose level errors differ by at most this are treated as equal [-].
# Smaller level differences do not matter, because a level predicts the mean energy after td to 10 % at best.
LIKE_LEVELS = TOLERATED_GROWTH
# Largest level error due to rounding at a crossing, if the level exceeds this fraction of the highest energy [-].
ROUNDING: Final = 1e-3
# Number of decimals to which errors are rounded before comparison, so that round-off does not affect the ranking.
_DECIMALS: Final = 4
# Rigid times that are shorter than the longest rigid time by at most this fraction are treated as equal [-].
LIKE_TIMES = 0.1

# Largest residual of a good pair [-], which is also the default tolerance for tr.
MOST_GOOD = 0.2
# Largest upper bound of the residual of a good pair [-]; the bound includes modes hidden in the misfit.
_MOST_HIDDEN: Final = 0.3
# The energy is treated as above or below its mean if it deviates by at least this number of standard deviations [-].
_BAND: Final = 0.25
# The following limits of the vibration error are explained in docs/explanation/validation-vibration.md.
# MOST_WORTH_OF_GOOD: largest vibration-error energy of a good pair, relative to the energy of the next contact [-].
# MOST_WORTH_OF_FAIR: largest vibration-error energy of a fair pair, relative to the energy of the next contact [-].
MOST_WORTH_OF_GOOD: Final = 0.01
MOST_WORTH_OF_FAIR: Final = 0.05
# More frequent output is proposed as a cure only if fewer than this number of states lie before td.
_FEW_STATES: Final = 20
# Largest number of parts that are named in a sentence.
_NAMED: Final = 5
# Number of standard deviations of the noise by which an energy of zero may seem negative; 4 cover 16,000 states.
_NOISE_DEVIATIONS: Final = 4.0
_WRONG_BY_MORE: Final = "the vibration after td is wrong by more than"
MORE_OFTEN: Final = "write the energies more often"
NAME_PARTS: Final = "name the parts to be switched with `parts`"
NAME_PARTS_IF_ANY: Final = f"{NAME_PARTS}, if the files contain parts"
CHOOSE_TIMES_IN_FLIGHT: Final = "choose tr and td in one flight"
_CORRECT_THE_DECK: Final = "correct the deck, and run the reference again"
_CHECK_GIVEN_TIMES: Final = (
    "make sure that no force acts in the flight that you gave, "
    "or let the evidence decide, without `after` and `landing`"
)
# End of the advice on a pair, which is omitted if a finished switched run is already available.
COMPARE: Final = "compare with a finished switched run"
OR_COMPARE: Final = f", or {COMPARE}"


def rank_candidates(
    situations: Sequence[Situation], *, in_flight: bool = False
) -> Iterator[Candidates]:
    """Yield the ranked candidates and the recommended candidate for each td of a record."""
    return chain.from_iterable(
        map(rank_judged, judge_candidates(situations, in_flight=in_flight))
    )


def rank_judged(judged: Judged) -> Iterator[Candidates]:
    """Rank and number the candidates of each td, and recommend the first candidate within the limits of the settings.

    There are three groups: acceptable candidates, acceptable candidates that save little because they lie near td or on
    its half cycle, and all others. In each group, the candidates of the best quality come first, and of these the
    earliest. But among rigid times within 10 % of the longest, candidates with a large position error come last. For
    many modes, each tr has a different residual; all good candidates are then equally good. If none is good, all
    candidates that may be as good as the best one, given its error band, are equally good. The other candidates follow
    in order of error.
    """
    late = (judged.columns["same_swing"] != 0) | judged.near_td
    group = np.where(judged.admissible, late, np.int8(2)) + 3 * judged.situation_of
    situations = judged.situations
    room = np.repeat([get_limit_of_like_quality(each) for each in situations], 3)
    residual = judged.columns["residual"]
    rows = order_by_quality(
        group,
        Errors(
            judged.error,
            np.where(judged.modal & ~np.isnan(residual), residual, judged.error),
            judged.modal & is_good_residual(residual, judged.columns["residual_high"]),
        ),
        judged.columns["rigid_time"],
        judged.out_of_place,
        room,
    )
    is_kept = judged.recommendable[rows]
    for situation, (first, last) in zip(
        judged.situations, pairwise(judged.ends), strict=True
    ):
        best = np.flatnonzero(is_kept[first:last])
        yield Candidates(
            situation,
            judged,
            rows[first:last],
            ranked=True,
            recommended=int(best[0]) if best.size else None,
        )


def get_limit_of_like_quality(situation: Situation) -> float:
    """Return the largest difference [-] at which two deformation errors, or two level errors, are treated as equal."""
    return LIKE_LEVELS if situation.vibration.unknown else EQUALLY_GOOD


def is_good_residual(residual: Samples, highest: Samples) -> NDArray[np.bool_]:
    """Return True for each good pair, given its residual and the upper bound, both of shape (n,) [-]; False for NaN."""
    return (residual <= MOST_GOOD) & (highest <= _MOST_HIDDEN)


def is_within_band(
    error: Samples, expected: Samples, error_of_best: Samples, best: Samples
) -> NDArray[np.bool_]:
    """Return True for each pair that may be as good as the best pair, given the error band of the best pair.

    All arguments and the result have shape (n,) [-]. The square of an error lies halfway between the square of the
    ``expected`` residual (``best`` for the best pair) and that of its upper bound. A pair is within the band if its
    expected residual is at most the error of the best pair, and its error at most the upper bound of the best pair. In
    addition, both must be on the same side of the residual 0.5, and of the residual 1, at which no vibration is
    preserved.
    """
    limit = np.maximum(error_of_best, best)
    # Numpy warnings are suppressed, because infinite errors leave the bound undefined.
    with np.errstate(invalid="ignore"):
        highest = np.sqrt(np.fmax(2 * error_of_best**2 - best**2, limit**2))
    for bound in (POOR_RESIDUAL, NOTHING_KEPT):
        limit = np.where(best <= bound, np.minimum(limit, bound), limit)
    return np.asarray((expected <= limit) & (error <= highest))


class Errors(NamedTuple):
    """Errors of n candidates, shape (n,): the ``error`` by which they are ranked, and the ``expected`` error [-].

    Their squares differ by half of the error band. ``is_good`` is True for good candidates, which are treated as
    equally good.
    """

    error: Samples
    expected: Samples
    is_good: NDArray[np.bool_]


def order_by_quality(
    group: NDArray[np.int32],
    errors: Errors,
    rigid: Samples,
    is_off: NDArray[np.bool_],
    room: Samples,
) -> NDArray[np.intp]:
    """Return the order of the candidates, group by group; in each group, the best candidates come first.

    The best candidates of a group are the good ones. If there is none, they are the candidates whose error exceeds the
    smallest one by at most ``room``, shape (groups,), or whose error lies within the band of the best candidate. They
    are ordered by descending rigid time. But of the candidates whose rigid time is within 10 % of the longest, those
    whose error exceeds the smallest by more than ``room`` come later, and those for which ``is_off`` is True come last.
    All other candidates follow in order of error. The arguments except ``room`` have shape (n,).
    """
    error = np.round(errors.error, _DECIMALS)
    expected = np.round(errors.expected, _DECIMALS)
    groups = room.size
    smallest = _find_extremes(np.minimum, group, error, groups)
    is_best = error == smallest[group]
    expected_of_best = _find_extremes(
        np.minimum, group, np.where(is_best, expected, np.inf), groups
    )
    is_near = (error <= (smallest + room)[group]) | is_within_band(
        error, expected, smallest[group], expected_of_best[group]
    )
    has_good = np.bincount(group[errors.is_good], minlength=groups) > 0
    is_like = np.where(has_good[group], errors.is_good, is_near)
    longest = _find_extremes(
        np.maximum, group, np.where(is_like, rigid, -np.inf), groups
    )
    is_long = is_like & (rigid >= (1 - LIKE_TIMES) * longest[group])
    smallest_of_long = _find_extremes(
        np.minimum, group, np.where(is_long, error, np.inf), groups
    )
    is_worse = is_long & (error > (smallest_of_long + room)[group])
    return np.lexsort(
        (
            -rigid,
            np.where(is_like, -rigid, error),
            is_worse,
            is_long & is_off,
            is_like & ~is_long,
            ~is_like,
            group,
        )
    )


def _find_extremes(
    extreme: np.ufunc, group: NDArray[np.int32], values: Samples, groups: int
) -> Samples:
    """Return the smallest value of each group if ``extreme`` is ``np.minimum``, the largest if it is ``np.maximum``."""
    extremes = np.full(groups, np.inf if extreme is np.minimum else -np.inf)
    extreme.at(extremes, group, values)
    return extremes


class Excess(NamedTuple):
    """A limit that a pair exceeds, or that cannot be tested because a value is unknown, with the ``message`` about it.

    ``is_td_wrong`` is True if the value is known and depends only on td, so that no other tr helps.
    """

    message: str
    is_td_wrong: bool


def list_exceeded_limits(
    situation: Situation, candidate: Candidate
) -> tuple[Excess, ...]:
    """Return the limits in the settings that a candidate exceeds, or for which its value is unknown."""
    exceeded = []
    for limit, value in situation.settings.limits:
        if limit.is_of_vibration and situation.at_rest:
            continue
        of_td = limit.quantity not in candidate._fields
        quantity = getattr(situation if of_td else candidate, limit.quantity)
        if quantity is None or not limit.is_kept_by(quantity, value):
            is_td_wrong = of_td and quantity is not None
            exceeded.append(Excess(limit.explain(quantity, value), is_td_wrong))
    return tuple(exceeded)


class Cause(NamedTuple):
    """The ``reason`` why a grade is not better, and the ``cure`` that would improve the grade.

    ``needs_other_times`` is True if the cure is a different tr or td. ``is_of_record`` is True if the cause applies to
    each pair of the record, so that other times do not help unless the record or the deck is improved, or other parts
    are chosen. ``kind`` is the reason without the numbers of this pair, by default the reason itself; tables state it
    once for several pairs. ``better_parts`` contains values of `parts` for which the cause does not apply.
    ``needs_deck`` is True if the deck of the run may remove the cause. ``is_unknown_load`` is True if an unknown load
    may change the motion.
    """

    reason: str
    cure: str
    needs_other_times: bool = False
    kind: str = ""
    is_of_record: bool = False
    better_parts: tuple[str, ...] = ()
    needs_deck: bool = False
    is_unknown_load: bool = False

    @property
    def general_reason(self) -> str:
        """The reason, worded without the values of a particular pair."""
        return self.kind or self.reason


_NOT_CERTAIN: Final = Cause(
    "the flight is not certain",
    "write the part momenta (LS-DYNA matsum, Radioss /TH/PART), or give the end of the load as `after`",
)
_NEGATIVE_ENERGY: Final = Cause(
    "the energy becomes negative, which an internal energy never does",
    "name the internal energy with `energy` or `parts`",
)
_NOISE: Final = Cause(
    "noise hides the vibration: most changes of the energy from state to state are random",
    "name an energy with less noise, such as that of the parts, or a file with more digits (binout)",
    is_of_record=True,
)
_UNKNOWN_OUTSIDE: Final = Cause(
    "the error of the vibration is unknown, because tr or td lies outside the flight",
    CHOOSE_TIMES_IN_FLIGHT,
)
_UNKNOWN_MASS: Final = Cause(
    "the files do not contain the mass, so it is unknown whether gravity or another load changes the momentum in the "
    "flight",
    "write the mass, or the kinetic and internal energy, or give the file with the energies of the parts (LS-DYNA "
    "matsum, Radioss T01)",
    is_of_record=True,
    is_unknown_load=True,
)
_UNKNOWN_LOAD: Final = Cause(
    "gravity or another load changes momentum or energy in the flight",
    "give the deck of the run as `deck`, because it defines gravity and loads, or write the part momenta",
    is_of_record=True,
    needs_deck=True,
    is_unknown_load=True,
)
# The cause if the user gave the deck, but its loads do not explain the change of momentum or energy.
_UNKNOWN_LOAD_WITH_DECK: Final = _UNKNOWN_LOAD._replace(
    cure="write the part momenta (LS-DYNA matsum, Radioss /TH/PART)", needs_deck=False
)


class Grade(NamedTuple):
    """A ``grade`` from `GRADES`, and the ``causes`` that prevent a better grade; no causes for "good"."""

    grade: str
    causes: tuple[Cause, ...] = ()

    @classmethod
    def of(cls, poor: Sequence[Cause], fair: Sequence[Cause]) -> Grade:
        """Make a grade: "poor" or "fair" if there are causes for this grade, otherwise "good"."""
        if poor:
            return cls("poor", tuple(poor))
        return cls("fair", tuple(fair)) if fair else cls("good")

    @property
    def reasons(self) -> tuple[str, ...]:
        """Reasons why the grade is not better."""
        return tuple(cause.reason for cause in self.causes)


def grade_residual(residual: float) -> str:
    """Grade a residual [-], ignoring all other criteria.

    Examples
    --------
    >>> grade_residual(0.1), grade_residual(0.3), grade_residual(0.6)
    ('good', 'fair', 'poor')
    """
    if residual > POOR_RESIDUAL:
        return POOR
    return FAIR if residual > MOST_GOOD else GOOD


class Quality(NamedTuple):
    """Two grades of a pair, for the ``motion`` and for the ``vibration`` after td. The worse grade is used.

    ``alone`` is the grade of the vibration without regard to the next contact. ``worth``, which may raise this grade,
    is the energy of the vibration error relative to that of the next contact; None if it is unknown.
    """

    motion: Grade
    vibration: Grade
    alone: Grade
    worth: Worth | None = None

    @property
    def grade(self) -> str:
        """The worse of two grades: that of the motion and that of the vibration."""
        return min((self.motion.grade, self.vibration.grade), key=GRADES.index)

    @property
    def causes(self) -> tuple[Cause, ...]:
        """The causes that prevent a better grade, with their cures."""
        statements = (self.motion, self.vibration)
        worst = [part.causes for part in statements if part.grade == self.grade]
        return tuple(chain.from_iterable(worst))

    @property
    def reasons(self) -> tuple[str, ...]:
        """Reasons why the grade is not better."""
        return tuple(cause.reason for cause in self.causes)


def _explain_uncertain_flight(situation: Situation) -> Cause:
    """Return why a flight is uncertain: what contradicts the times given by the user, or what evidence is missing."""
    flight = situation.flight
    if flight.source == "given" and flight.doubts:
        settings = situation.settings
        times = (("`after`", settings.after), ("`landing`", settings.landing))
        given = " and ".join(name for name, time in times if time is not None)
        condition = (
            f"the motion is good only if the parts fly as you stated with {given}"
        )
        return Cause(
            f"{condition}: {flight.doubts[-1]}",
            _CHECK_GIVEN_TIMES,
            kind="the evidence contradicts the flight that was given",
        )
    return _NOT_CERTAIN


def _explain_unknown_load(situation: Situation) -> Cause:
    """Return why a load in the flight is unknown: the mass, the deck or the momenta are missing."""
    history, flight = situation.history, situation.flight
    momenta = history.find_momenta(of_parts=flight.parts is not None)
    if flight.source == "momentum" and momenta and not momenta.velocity:
        mass = momenta.mass(momenta.chosen)
        # A mass that the files do not contain is NaN, or 0 in a sum.
        if not mass > 0:
            return _UNKNOWN_MASS
    return _UNKNOWN_LOAD if history.surroundings is UNKNOWN else _UNKNOWN_LOAD_WITH_DECK


def _explain_moving_apart(moving_apart: MovingApart) -> Cause:
    """Return why parts that fly away from each other are no rigid body, and which parts are one."""
    return Cause(
        moving_apart.describe(),
        moving_apart.advice,
        kind="some of the parts fly away from the others",
        is_of_record=True,
        better_parts=tuple(str(part.id) for part in moving_apart.staying),
    )


def grade_pair(
    situation: Situation, best: Candidate, best_residual: float | None = None
) -> Quality:
    """Grade a tr by its motion, its vibration error, and this error relative to the next contact.

    ``best_residual`` is the residual of the best tr at this td [-]; None if it is unknown or if this is the best tr.
    """
    flight = situation.flight
    uncertain = () if flight.certain else (_explain_uncertain_flight(situation),)
    outside = list_times_outside_flight(situation, best.tr)
    ruined = [
        *(Cause(fault, CHOOSE_TIMES_IN_FLIGHT) for fault in outside),
        *(
            Cause(fault, _CORRECT_THE_DECK, is_of_record=True)
            for fault in situation.settings.ruined
        ),
    ]
    if flight.unknown_load:
        ruined.append(_explain_unknown_load(situation))
    moving_apart = find_parts_moving_apart(situation)
    separate: list[Cause] = []
    if moving_apart is not None:
        cause = _explain_moving_apart(moving_apart)
        (separate if moving_apart.are_all_separate else ruined).append(cause)
    motion = Grade.of(ruined, (*uncertain, *separate))
    if situation.at_rest:
        return Quality(motion, Grade("good"), Grade("good"))
    alone = Grade.of(
        _list_causes_for_poor(situation, best, best_residual),
        _list_causes_for_fair(situation, best),
    )
    worth = compare_error_with_contact(situation, best)
    counted = (
        alone
        if situation.settings.keep_vibration
        else _raise_grade_by_worth(alone, worth)
    )
    return Quality(motion, counted, alone, worth)


def is_vibration_lost(situation: Situation, pair: Candidate | Pair) -> bool:
    """Return True if the residual of a pair is poor and its error matters in the next contact."""
    if pair.residual is None or pair.residual <= POOR_RESIDUAL:
        return False
    worth = compare_error_with_contact(situation, pair)
    if worth is None or situation.settings.keep_vibration:
        return True
    return worth.share > MOST_WORTH_OF_FAIR


def _raise_grade_by_worth(alone: Grade, worth: Worth | None) -> Grade:
    """Raise the grade of a vibration whose error hardly matters in the next contact."""
    if worth is None or alone.grade == "good" or worth.share > MOST_WORTH_OF_FAIR:
        return alone
    if worth.share <= MOST_WORTH_OF_GOOD:
        return Grade("good")
    return Grade("fair", alone.causes)


def refuse_error(quality: Quality, errors: Sequence[str]) -> Quality:
    """Return the grades of a pair that its ``errors`` make inadmissible, however little they affect the next contact.

    Nothing changes unless the next contact has raised the grade of the vibration.
    """
    alone = quality.alone
    if not errors or quality.vibration.grade == alone.grade:
        return quality
    first, *others = alone.causes
    refusal = "d2rpick accepts no such pair, even if the error hardly matters in the next contact"
    reason = f"{first.reason}; {'; '.join(errors)}: {refusal}"
    cause = first._replace(reason=reason)
    refused = alone._replace(causes=(cause, *others))
    return quality._replace(vibration=refused, alone=refused)


def trust_measured_momentum(quality: Quality) -> Quality:
    """Return the grades of a pair whose computed switched run has the momentum of the reference run after td.

    A load that the record does not explain acts in both runs, so it makes the motion no worse than "fair".
    """
    motion = quality.motion
    if not motion.causes or not all(cause.is_unknown_load for cause in motion.causes):
        return quality
    causes = tuple(
        cause._replace(
            reason=f"{cause.reason}, but the momentum of the computed run agrees",
            is_of_record=False,
            needs_deck=False,
        )
        for cause in motion.causes
    )
    return quality._replace(motion=Grade(FAIR, causes))


def _list_causes_for_poor(
    situation: Situation, best: Candidate, best_residual: float | None
) -> list[Cause]:
    """Return the causes of the vibration grade "poor"."""
    causes = []
    if best.residual is None:
        if list_times_outside_flight(situation, best.tr):
            causes.append(_UNKNOWN_OUTSIDE)
        else:
            causes.append(_describe_unknown_direction(situation))
    elif best.residual > POOR_RESIDUAL:
        wrong = _describe_wrong_tr(best, best.residual, best_residual)
        causes.append(wrong or _describe_wrong_vibration(situation, best.residual))
    record = situation.history, situation.flight.start, situation.td
    if _is_energy_negative(*record):
        causes.append(_NEGATIVE_ENERGY)
    if situation.basis == "energy":
        causes += list_causes_of_record(*record)
    causes += _list_causes_of_static_change(situation, best)
    return causes


def _list_causes_of_static_change(
    situation: Situation, best: Candidate
) -> Iterator[Cause]:
    """Yield the cause that rigid parts miss too large a change of the static energy."""
    change = compute_static_change(situation, best)
    if change is None or abs(change) <= 1 - MIN_MEAN_ENERGY:
        return
    verb, missed = ("rises", "gain") if change > 0 else ("falls", "lose")
    kind = f"the internal energy {verb} between tr and td by more than the vibration explains"
    yield Cause(
        f"{kind}: by {abs(change):.0%} of its mean after td, an energy that rigid parts do not {missed}",
        "use d2rpick explore to find times between which it changes less, and find out what changes it: a load, "
        "plastic flow, or a part that was not chosen",
        needs_other_times=True,
        kind=kind,
    )


def _describe_unknown_direction(situation: Situation) -> Cause:
    """Return the cause that the directions of the deformation at tr and td are unknown, with its ``cure``."""
    refusal = situation.evidence.refusal
    why = f": {refusal}" if refusal else ""
    unknown = "it is unknown whether the parts are deformed in the same direction at tr and td"
    cures = [*_ask_for_more_states(situation)]
    if cures and _count_states(situation) < _FEW_STATES:
        few = f"only {_count_states(situation)} states lie in the flight up to td"
        return Cause(
            f"{unknown}, because {few}",
            cures[0].partition(", because")[0],
            kind=unknown,
        )
    for_modes = _describe_cure_for_modes(situation)
    if for_modes and (not cures or for_modes != MORE_OFTEN):
        cures.append(for_modes)
    return Cause(
        f"{unknown}{why}",
        f"{', '.join(cures)}{OR_COMPARE}" if cures else COMPARE,
        kind=unknown,
    )


def _get_begin(situation: Situation) -> float:
    """Return the start of the flight, or of the record if the start is unknown [time]."""
    start = situation.flight.start
    return float(situation.history.time[0]) if start is None else start


def _count_states(situation: Situation) -> int:
    """Return the number of states in the flight up to td."""
    return int(situation.history.between(_get_begin(situation), situation.td)[0].size)


def _ask_for_more_states(situation: Situation) -> Iterator[str]:
    """Yield a request for a shorter output interval if the flight has too few states up to td."""
    begin = _get_begin(situation)
    states = _count_states(situation)
    if states < ENOUGH_STATES and situation.td > begin:
        interval = (situation.td - begin) / ENOUGH_STATES
        yield (
            f"write the energies every {interval:.2g} or more often, because only {states} states lie in the flight "
            "up to td"
        )


def _describe_cure_for_modes(situation: Situation) -> str:
    """Return the cure that would show the modes of the vibration: other parts or more states.

    It is empty if all other vibrating parts are springs or the like, whose energy a choice of parts would not add.
    """
    other_parts = situation.parts_to_add
    others_are_springs = bool(situation.together.not_chosen.parts) and not other_parts
    if others_are_springs:
        return ""
    if situation.history.parts is None and not other_parts:
        return NAME_PARTS_IF_ANY
    if other_parts:
        names = list_names([part.name for part in other_parts], most=_NAMED)
        vibrates = "it vibrates" if len(other_parts) == 1 else "they vibrate"
        return f"also make {names} rigid, because {vibrates} together with the chosen parts"
    return MORE_OFTEN


def _describe_wrong_tr(
    candidate: Candidate, residual: float, best_residual: float | None
) -> Cause | None:
    """Return the cause that tr does not match td if the best tr at this td is clearly better; otherwise None."""
    if best_residual is None or residual - best_residual <= EQUALLY_GOOD:
        return None
    reason = f"the vibration after td is wrong by {format_residual(residual)}, because tr does not match td"
    ratio = candidate.level_ratio
    if ratio is not None and abs(ratio - 1) > LIKE_LEVELS:
        reason += f": the energy at tr is {ratio:.3g} times that at td"
    elif candidate.sign_match is False:
        reason += ": the deformation has the opposite direction"
    elif best_residual > POOR_RESIDUAL:
        # Every tr is poor, and the only reason against this tr is its error.
        return None
    best = f"the best tr at this td is wrong by {format_residual(best_residual)}"
    return Cause(
        f"{reason}; {best}",
        "use d2rpick suggest with this td to find a better tr",
        needs_other_times=True,
        kind=f"{_WRONG_BY_MORE} {POOR_RESIDUAL:.0%}, because tr does not match td",
    )


def _describe_wrong_vibration(situation: Situation, residual: float) -> Cause:
    """Return the cause "the vibration after td is wrong"; its cure is another tr or td."""
    reason = f"the vibration after td is wrong by {format_residual(residual)}"
    share = situation.kinetic_share
    if share is None or share <= POOR_KINETIC_SHARE:
        return Cause(
            reason,
            "use d2rpick explore to see whether another tr or td is better",
            needs_other_times=True,
            kind=f"{_WRONG_BY_MORE} {POOR_RESIDUAL:.0%}",
        )
    return Cause(
        f"{reason}, since {share:.0%} of its energy is kinetic at td, and no tr can keep kinetic energy",
        "use d2rpick explore to see whether another td is better",
        needs_other_times=True,
        kind="most of the vibration energy is kinetic at td, and no tr can keep kinetic energy",
    )


@remember
def list_causes_of_record(
    history: History, start: float | None, td: float
) -> tuple[Cause, ...]:
    """Return the reasons why the states of the flight up to td do not suffice to determine the energy level."""
    _, energy = history.between(-np.inf if start is None else start, td)
    causes = []
    states = count_states_per_period(energy)
    if states is None or states >= MIN_SAMPLES_PER_PERIOD:
        return ()
    if changes_at_random(energy):
        causes.append(_NOISE)
    else:
        states_text = f"the energy has {states:.3g} states per period"
        causes.append(
            Cause(
                f"{states_text}, at least {MIN_SAMPLES_PER_PERIOD} are needed to compare energies",
                f"{MORE_OFTEN}, at least {MIN_SAMPLES_PER_PERIOD / states:.2g} times as often",
                kind=f"the energy has fewer than {MIN_SAMPLES_PER_PERIOD} states per period",
            )
        )
    return tuple(causes)


@remember
def _is_energy_negative(history: History, start: float | None, td: float) -> bool:
    """Return True if the energy in the flight up to td becomes negative by more than noise explains."""
    _, energy = history.between(-np.inf if start is None else start, td)
    if not energy.size:
        return False
    # The second differences of white noise have 6 times its variance; those of a vibration only add to them.
    variance = np.mean(np.diff(energy, 2) ** 2) / 6 if energy.size > 2 else 0.0
    lowest_of_zero = MIN_PLASTIC * np.abs(energy).max()
    return bool(energy.min() < lowest_of_zero - _NOISE_DEVIATIONS * np.sqrt(variance))


def rate_certainty_of_tr(best: Candidate) -> int:
    """Rate the accuracy of tr: 2 if better than the timing tolerance, 1 if sufficient for a good pair, otherwise 0."""
    if best.tr_high is None or best.timing_tolerance is None:
        return 2
    if _is_loose(best):
        return 0
    return 2 if best.tr_high - best.tr <= best.timing_tolerance else 1


def _is_loose(best: Candidate) -> bool:
    """Return True if tr is so inaccurate that the frozen-deformation error may be too large for a good pair."""
    if best.tr_high is None or best.timing_tolerance is None:
        return False
    return (
        TOLERATED_GROWTH * (best.tr_high - best.tr) > MOST_GOOD * best.timing_tolerance
    )


def _list_causes_for_fair(situation: Situation, best: Candidate) -> list[Cause]:
    """Return the causes of the vibration grade "fair"."""
    if best.residual is None:
        return []
    low = best.residual if best.residual_low is None else best.residual_low
    high = best.residual_high or best.residual
    causes = []
    is_vague = high > _MOST_HIDDEN
    # If a residual exceeds the limit but its error band does not exclude smaller values, the pair may still be good.
    is_wrong = best.residual > MOST_GOOD and (is_vague or low > MOST_GOOD)
    if is_wrong:
        worst_text = f", or {format_residual(high)} at worst" if is_vague else ""
        causes.append(
            Cause(
                f"the vibration after td is wrong by {format_residual(best.residual)}{worst_text}",
                "use d2rpick explore to see whether another td is better",
                needs_other_times=True,
                kind=f"{_WRONG_BY_MORE} {MOST_GOOD:.0%}",
            )
        )
    elif is_vague:
        causes.append(
            Cause(
                f"the vibration after td may be wrong by up to {format_residual(high)}, because the record may hide a "
                "further mode",
                _describe_cure_for_modes(situation),
                kind="the record may hide a further mode",
            )
        )
    if not is_wrong and _is_loose(best):
        reach = (best.tr_high or best.tr) - best.tr
        causes.append(
            Cause(
                f"tr is known only to ±{reach:.1g}, which is more than its timing tolerance of "
                f"±{best.timing_tolerance:.1g}, so the vibration error may be larger",
                "write the energies more often, and with more digits",
                kind="tr is less accurate than its timing tolerance demands",
            )
        )
    return causes


def count_states_per_period(energy: Samples) -> float | None:
    """Return the average number of states per energy period; None if the energy does not complete a period.

    Examples
    --------
    >>> round(count_states_per_period(np.sin(np.arange(1000) * 2 * np.pi / 8) ** 2))
    4
    """
    if energy.size < 2:
        return None
    deviation = energy - energy.mean()
    side = np.sign(deviation[np.abs(deviation) > _BAND * deviation.std()])
    passes = np.flatnonzero(np.diff(side)).size
    return 2 * energy.size / passes if passes > 1 else None
