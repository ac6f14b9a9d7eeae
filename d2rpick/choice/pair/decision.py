"""Decide on the verdict on a pair, its reason, the expected and the worst motion after td, and a better pair.

All commands, output formats and pages use the texts of this module, so that they cannot contradict each other.
"""

from __future__ import annotations

from math import floor
from typing import TYPE_CHECKING, Final

from d2rpick.base.tuples import NamedTuple
from d2rpick.choice.pair.aftermath import MeanEnergyBounds, bound_mean_energy
from d2rpick.choice.pair.grades import (
    GOOD,
    GRADES,
    MIN_MEAN_ENERGY,
    POOR,
    VERDICTS,
    format_residual,
)
from d2rpick.choice.pair.quality import (
    CHOOSE_TIMES_IN_FLIGHT,
    MOST_WORTH_OF_FAIR,
    MOST_WORTH_OF_GOOD,
    grade_pair,
    refuse_error,
)
from d2rpick.vibration.measures import wrong_sign

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from d2rpick.choice.pair.candidates import Candidate, Pair
    from d2rpick.choice.pair.quality import Cause, Quality
    from d2rpick.choice.pair.situation import Situation

# CHOOSE_ANOTHER: advice if a pair is not admissible.
# GIVE_END_OF_LOAD: advice if no flight is found.
# CHECK_SWITCHED_RUN: advice if a finished switched run contradicts the verdict on a recommended pair.
CHOOSE_ANOTHER: Final = "choose another pair (d2rpick suggest names one)"
GIVE_END_OF_LOAD: Final = "if you know the end of the load, give it as `after`"
CHECK_SWITCHED_RUN: Final = (
    "check that the switched run was switched at these times and is otherwise identical to the reference run; "
    "if so, choose another td"
)
# COMPARE_OTHER_WINDOW: advice if the switched run was rigid in another window than the one that is judged.
COMPARE_OTHER_WINDOW: Final = (
    "leave out `tr` and `td` to compare the window in which the switched run was rigid"
)
# FINISH_SWITCHED_RUN: advice if the switched run ended before the next contact, or with an error.
FINISH_SWITCHED_RUN: Final = (
    "let the switched run continue to the next contact, or add the files of its later restart segments, and compare "
    "again"
)
# GIVE_SWITCHED_RUN_OF_MODEL: advice if the switched run differs from the reference run before the switch.
GIVE_SWITCHED_RUN_OF_MODEL: Final = (
    "give the switched run of this model, with the same loads and velocities"
)
# _USE_BEST: advice if the best pair in the given range of td can be used with care.
# _AVOID_BEST: advice if even the best pair in the given range of td cannot be used.
_USE_BEST: Final = (
    "use this pair if only the motion matters, or compare it with a finished switched run "
    "(d2rpick verify)"
)
_AVOID_BEST: Final = "choose another flight, if there is one, or make other parts rigid"
# _USE_COMPARED: the advice that replaces _USE_BEST if a switched run has been compared.
_USE_COMPARED: Final = "use this pair if only the motion matters"
# _MORE_OFTEN: beginning of the advice on too few states per period.
# _RUN_LONGER: advice if the flight goes on after the end of the record.
_MORE_OFTEN: Final = "write the energies more often, at least"
_RUN_LONGER: Final = (
    ", where the record ends in the flight (a longer run may allow a better pair)"
)
# The worst case is shown if its residual exceeds the expected residual by more than this [-].
_ALIKE: Final = 5e-3


class Decision(NamedTuple):
    """Verdict on a pair of times.

    Parameters
    ----------
    grade : str
        "good", "fair" or "poor"; `verdict` gives it in words.
    quality : Quality
        The grades of motion and vibration from which ``grade`` follows.
    objections : tuple of str
        Reasons why the pair is not admissible; empty if it is.
    at_rest : bool
        True if nothing vibrates in the flight up to td.
    mean_energy_bounds : MeanEnergyBounds or None
        Bounds of the mean energy after td relative to that of the reference run [-]; None if they are unknown.
    residual : float or None
        Expected residual [-].
    worst_residual : float
        Largest residual that the record allows [-].
    better : Pair or None
        A better pair, if one was requested and found.
    better_level : float or None
        Energy level at td of the better pair, relative to that of this pair [-]; None if it was not compared.
    cure_of_objections : str
        Advice on how to remove the objections if there is no better pair.
    best_of : (float, float) or None
        Range of td in which this pair is the best [time]; None if not all td of the range were compared.
    ends_in_flight : bool
        True if the record ends before the next contact.
    is_compared : bool
        True if a finished switched run was compared with the reference run.
    other_pairs : tuple of (str, Pair)
        Further pairs that are better, each with the words that introduce it.
    """

    grade: str
    quality: Quality
    objections: tuple[str, ...]
    at_rest: bool
    mean_energy_bounds: MeanEnergyBounds | None
    residual: float | None
    worst_residual: float
    better: Pair | None = None
    better_level: float | None = None
    cure_of_objections: str = CHOOSE_ANOTHER
    best_of: tuple[float, float] | None = None
    ends_in_flight: bool = False
    is_compared: bool = False
    other_pairs: tuple[tuple[str, Pair], ...] = ()

    @property
    def verdict(self) -> str:
        """The verdict in words: "use", "use with care" or "do not use"."""
        return VERDICTS[self.grade]

    @property
    def needs_better_record(self) -> bool:
        """True if the pair cannot be used for a reason that applies to every pair of the record."""
        causes = self.quality.causes
        return self.grade == POOR and any(cause.is_of_record for cause in causes)

    @property
    def needs_deck(self) -> bool:
        """True if the pair cannot be used because of a load that the deck of the run would explain."""
        return self.needs_better_record and any(
            cause.needs_deck for cause in self.quality.causes
        )

    @property
    def better_parts(self) -> tuple[str, ...]:
        """Values of `parts` with which a reason against the pair does not apply; empty if no other parts are known."""
        if self.grade != POOR:
            return ()
        return next(
            (cause.better_parts for cause in self.quality.causes if cause.better_parts),
            (),
        )

    @property
    def is_outside_flight(self) -> bool:
        """True if tr or td lies outside the flight."""
        return any(
            cause.cure == CHOOSE_TIMES_IN_FLIGHT for cause in self.quality.motion.causes
        )

    @property
    def allows_only_motion(self) -> bool:
        """True if the pair can be used, but only because its wrong vibration hardly affects the next contact."""
        return self.grade != POOR and self.quality.alone.grade == POOR

    def reaches(self, grade: str) -> bool:
        """Return True if the pair has at least the given grade."""
        return GRADES.index(self.grade) >= GRADES.index(grade)

    @property
    def reason(self) -> str:
        """Reason for the verdict."""
        if self.objections:
            return "; ".join(self.objections)
        if self.at_rest and not self.quality.reasons:
            return "nothing vibrates in the flight up to td"
        reasons = "; ".join(self.quality.reasons)
        if not reasons:
            return _explain_why_good(self.quality, self.residual)
        if self.is_limited_by_raised_grade:
            return f"{reasons}{_explain_raised_grade(self.quality)}"
        return reasons

    @property
    def general_reason(self) -> str:
        """Reason for a verdict other than "use", without numbers, so that several pairs can share the reason."""
        if self.objections:
            return "; ".join(self.objections)
        reasons = "; ".join(cause.general_reason for cause in self.quality.causes)
        if self.is_limited_by_raised_grade:
            limit = (
                f"at most {MOST_WORTH_OF_FAIR:.0%} of the energy of the next contact"
            )
            return f"{reasons}, but this is {limit}"
        return reasons

    @property
    def is_limited_by_raised_grade(self) -> bool:
        """True if the verdict rests on a vibration grade that was raised because the vibration error is negligible."""
        vibration = self.quality.vibration
        is_raised = self.quality.alone.grade != vibration.grade
        return is_raised and vibration.grade == self.grade

    @property
    def expected(self) -> str:
        """Description of the motion expected after td."""
        if self.at_rest:
            return "the same as in the reference run: nothing vibrates in the flight up to td"
        parts = []
        if self.mean_energy_bounds is not None:
            bounds = format_bounds(self.mean_energy_bounds)
            parts.append(
                f"mean energy after td {bounds} of the reference run{self._name_exceeded_limits()}"
            )
        if self.residual is not None:
            parts.append(
                f"vibration error {format_residual(self.residual)} (residual {self.residual:.3f})"
            )
        return ", ".join(parts) or "unknown: no model of the vibration fits the record"

    def _name_exceeded_limits(self) -> str:
        """Name the limits of ``verify`` that a switched run may exceed although its pair is usable; empty if none."""
        if self.grade == POOR or self.is_compared or self.mean_energy_bounds is None:
            return ""
        limits = MeanEnergyBounds(MIN_MEAN_ENERGY, 2 - MIN_MEAN_ENERGY)
        low, high = self.mean_energy_bounds
        if limits.low <= low and high <= limits.high:
            return ""
        accepted = f"d2rpick verify accepts only {format_bounds(limits)}"
        if high < limits.low:
            # The limit is rounded down to a whole per cent, so that it accepts the lower bound.
            lowest = floor(100 * low) / 100
            return (
                f" ({accepted}, so it will reject the switched run; to accept it because only the motion is used, set "
                f"`min_mean_energy` to {lowest:g})"
            )
        will = "will" if low > limits.high else "may"
        return f" ({accepted}, so it {will} reject the switched run)"

    @property
    def worst_case(self) -> str:
        """Description of the worst motion after td that the record does not rule out."""
        if self.at_rest:
            return "the same"
        if self.residual is None:
            text = f"vibration error {format_residual(self.worst_residual)}"
            return f"{text}, if the deformation at tr is opposite to that at td"
        if self.worst_residual - self.residual <= _ALIKE:
            return "the same"
        return f"vibration error {format_residual(self.worst_residual)}"

    @property
    def cure(self) -> str:
        """The change that would make the pair better; empty if the pair is already good."""
        if self.grade == GOOD:
            return ""
        if self.needs_better_record:
            # A better pair of the same record cannot be used either.
            return self.cure_without_other_times
        if self.better is not None:
            best = f"use {_describe_pair(self.better, self.better_level)}"
            if not self.other_pairs:
                return best
            others = [
                f"{introduction}, {_describe_pair(pair, None)}, rigid for {pair.td - pair.tr:.6g}"
                for introduction, pair in self.other_pairs
            ]
            rigid_time = self.better.td - self.better.tr
            return "; ".join([f"{best}, rigid for {rigid_time:.6g}", *others])
        if self.is_outside_flight and not self.is_compared:
            return CHOOSE_TIMES_IN_FLIGHT
        if self.objections or not self.quality.causes:
            return self.cure_of_objections
        return join_cures(map(self.specify_cure, self.quality.causes))

    @property
    def cure_without_other_times(self) -> str:
        """The changes other than that of tr or td that would make the pair better; empty if there are none."""
        causes = self.quality.causes
        return join_cures(cause.cure for cause in causes if not cause.needs_other_times)

    def specify_cure(self, cause: Cause) -> str:
        """Return the advice on a cause of the verdict; do not suggest other times for the best pair in a td range."""
        if self.best_of is None or not cause.needs_other_times:
            return cause.cure
        low, high = self.best_of
        usable = _USE_COMPARED if self.is_compared else _USE_BEST
        advice = _AVOID_BEST if self.grade == POOR else usable
        longer = _RUN_LONGER if self.ends_in_flight else ""
        return f"nothing clearly better was found for td from {low:.6g} to {high:.6g}{longer}; {advice}"


def join_cures(cures: Iterable[str]) -> str:
    """Join cures, each only once, and omit those with which a longer cure begins.

    Examples
    --------
    >>> join_cures(["write more often", "write more often, with more digits", "give the deck"])
    'write more often, with more digits; give the deck'
    """
    listed = [*dict.fromkeys(cures)]
    if any(cure.startswith("write the energies every") for cure in listed):
        # A cure with an interval makes one without an interval superfluous.
        listed = [cure for cure in listed if not cure.startswith(_MORE_OFTEN)]
    return "; ".join(
        cure
        for cure in listed
        if not any(other != cure and other.startswith(cure) for other in listed)
    )


def decide(
    situation: Situation,
    candidate: Candidate,
    *,
    objections: Sequence[str] = (),
    errors: Sequence[str] = (),
    better: Pair | None = None,
    cure_of_objections: str = CHOOSE_ANOTHER,
    best_of: tuple[float, float] | None = None,
    best_residual: float | None = None,
) -> Decision:
    """Return the verdict on a tr, which any of the ``objections`` makes inadmissible; ``better`` is a better pair.

    ``errors`` are further objections, which repeat that the residual is too large. ``best_residual`` is the residual of
    the best tr at this td [-]: if it is clearly smaller, the verdict blames tr. If there is no better pair,
    ``cure_of_objections`` is the advice on the objections. ``best_of`` is the range of td in which the pair is the best
    [time], if all td of the range were compared.
    """
    quality = grade_pair(situation, candidate, best_residual)
    quality = refuse_error(quality, errors)
    return Decision(
        grade=POOR if errors or objections else quality.grade,
        quality=quality,
        objections=tuple(objections),
        at_rest=situation.at_rest,
        mean_energy_bounds=bound_mean_energy(situation, candidate),
        residual=candidate.residual,
        worst_residual=_find_worst_residual(situation, candidate),
        better=better,
        better_level=_compare_levels(situation, better),
        cure_of_objections=cure_of_objections,
        best_of=best_of,
        ends_in_flight=situation.flight.start is not None
        and situation.flight.end is None,
    )


def _find_worst_residual(situation: Situation, candidate: Candidate) -> float:
    """Return the largest residual that the record does not rule out [-]; 0 if nothing vibrates.

    If the direction of the deformation is unknown, the result is the residual for equal levels with opposite signs.
    """
    if situation.at_rest:
        return 0.0
    if candidate.residual is None:
        return wrong_sign(0.0)
    return max(candidate.residual, candidate.residual_high or 0.0)


def _explain_why_good(quality: Quality, residual: float | None) -> str:
    """Explain why a pair is good: it preserves the vibration, or the error of its vibration hardly matters."""
    if quality.alone.grade == GOOD:
        error = (
            "" if residual is None else f" with an error of {format_residual(residual)}"
        )
        return f"the flight is certain, and the vibration after td is reproduced{error}"
    return f"{'; '.join(quality.alone.reasons)}{_explain_raised_grade(quality)}"


def _explain_raised_grade(quality: Quality) -> str:
    """Explain why the vibration error hardly matters; empty if this did not raise the grade."""
    if quality.worth is None or quality.alone.grade == quality.vibration.grade:
        return ""
    share = quality.worth.share
    advice = ": use only the motion" if quality.alone.grade == POOR else ""
    limit = (
        MOST_WORTH_OF_GOOD if quality.vibration.grade == GOOD else MOST_WORTH_OF_FAIR
    )
    compared = f"at most {share:.2%} of the energy of the next contact"
    allowed = f"limit for {VERDICTS[quality.vibration.grade]}: {limit:.0%}"
    return f", but the energy of this error is {compared} ({allowed}){advice}"


def format_bounds(bounds: MeanEnergyBounds) -> str:
    """Format the bounds of the mean energy, or a single number if both bounds have the same digits."""
    low, high = f"{bounds.low:.0%}", f"{bounds.high:.0%}"
    return low if low == high else f"{low} to {high}"


def _compare_levels(situation: Situation, better: Pair | None) -> float | None:
    """Return the energy level at td of a better pair, relative to that of the situation [-]; None if it is unknown."""
    if better is None or not situation.energy_td > 0:
        return None
    return situation.vibration.whole.energy(better.td) / situation.energy_td


def _describe_pair(pair: Pair, level: float | None) -> str:
    """Describe a pair by its times and its residual or, if that is unknown, by its higher ``level`` at td [-]."""
    times = f"tr = {pair.tr:.6g}, td = {pair.td:.6g}"
    if pair.residual is None and level is not None and level > 1:
        return f"{times}: the energy at td is {level:.3g} times as high, so more of the vibration can be kept"
    if pair.residual is None:
        return times
    return f"{times}: vibration error {format_residual(pair.residual)}"
