"""Answer ``suggest`` and ``verify``: recommend a pair with alternatives, or judge a given pair.

The commands (including ``study``, ``check --history`` and ``card``) and the Python functions all call these functions,
so that their numbers agree.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, TypeVar

from d2rpick.base.caching import cached_property
from d2rpick.base.data_classes import dataclass
from d2rpick.base.errors import Caution, RangeError
from d2rpick.base.memory import remember
from d2rpick.base.tuples import NamedTuple
from d2rpick.choice.health import (
    OF_THE_MODEL,
    assess_health,
    refuse_unsound,
    warn_about_engine,
    warn_about_health,
)
from d2rpick.choice.pair.aftermath import MeanEnergyBounds, bound_mean_energy
from d2rpick.choice.pair.candidates import Candidate, Candidates, Pair, judge_times
from d2rpick.choice.pair.decision import (
    CHECK_SWITCHED_RUN,
    CHOOSE_ANOTHER,
    COMPARE_OTHER_WINDOW,
    FINISH_SWITCHED_RUN,
    GIVE_END_OF_LOAD,
    GIVE_SWITCHED_RUN_OF_MODEL,
    Decision,
    decide,
)
from d2rpick.choice.pair.grades import GOOD, POOR
from d2rpick.choice.pair.quality import (
    EQUALLY_GOOD,
    MOST_GOOD,
    ROUNDING,
    Quality,
    list_exceeded_limits,
    rank_candidates,
    trust_measured_momentum,
)
from d2rpick.choice.pair.situation import AnswerAtTd, Situation, examine_td
from d2rpick.choice.pair.warnings import (
    POOR_KINETIC_SHARE,
    POOR_RESIDUAL,
    Expectation,
    describe_end_of_load,
    estimate_time_after,
    find_largest_energy,
    list_objections_to_td,
    warn_about_place,
    warn_about_td,
)
from d2rpick.flight.internal_energy import round_off
from d2rpick.histories.balance import read_balance
from d2rpick.histories.digits import round_as_read

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from d2rpick.choice.health import Health
    from d2rpick.choice.question import Reference, Settings
    from d2rpick.choice.switched.comparison import Comparison
    from d2rpick.choice.td.suggest_td import Chosen
    from d2rpick.histories.history import History
    from d2rpick.histories.run import OpenedRun

# The search for a better pair stops once this many pairs at other energy peaks turn out to be inadmissible.
_MOST_REFUSED = 3


@dataclass(frozen=True, eq=False, repr=False)
class PairVerdict(AnswerAtTd):
    """The answer of ``verify``: the measures of one pair, and the reasons for and against it.

    ``tr_ok`` and ``td_ok`` are None if the record does not show whether the time is suitable. ``remarks`` are the
    ``reasons`` that are not objections to the pair, or that only repeat that the residual is large; ``errors`` are the
    latter. ``computed`` contains the finished switched run, and ``switched`` its comparison with the reference run, if
    there is such a run. ``tr_interval`` is the output interval of the switched run that contains tr [time]; None if tr
    was given instead of read from this run.
    """

    situation: Situation
    candidate: Candidate
    tr_ok: bool | None
    td_ok: bool | None
    admissible: bool
    reasons: tuple[str, ...]
    cautions: tuple[Caution, ...]
    remarks: tuple[str, ...] = ()
    errors: tuple[str, ...] = ()
    switched: Comparison | None = None
    health: Health | None = None
    computed: History | None = None
    tr_interval: float | None = None

    @property
    def verified(self) -> bool:
        """True if the pair is admissible, its grade is not "poor", and its residual is 0.5 or less."""
        residual = self.candidate.residual
        is_kept = residual is None or residual <= POOR_RESIDUAL
        return is_kept and self.decision.grade != POOR

    @cached_property
    def decision(self) -> Decision:
        """Verdict on the pair, with the reason and the remedy."""
        decision = self._decide(None)
        if decision.grade == POOR:
            decision = self._decide(self.better)
            if self.better is not None:
                others = tuple(self._list_other_pairs(self.better))
                decision = decision._replace(other_pairs=others)
        if self._is_refuted or self.is_of_other_run:
            return decision
        return compare_in_flight(decision, self.situation, self.candidate)

    @property
    def _cure_of_objections(self) -> str:
        """Advice on a pair that is not admissible."""
        if self.is_of_other_run:
            return GIVE_SWITCHED_RUN_OF_MODEL
        if self.is_of_other_times:
            return COMPARE_OTHER_WINDOW
        if self.is_incomplete:
            return FINISH_SWITCHED_RUN
        if self._is_refuted:
            return CHECK_SWITCHED_RUN
        flight = self.situation.flight
        if flight.start is None and not flight.refusal:
            return GIVE_END_OF_LOAD
        return CHOOSE_ANOTHER

    def _decide(self, better: Pair | None) -> Decision:
        """Return the verdict on the pair; ``better`` is a better pair, or None if no better pair is known."""
        unknown = () if self.reasons else ("no evidence shows that tr suits this td",)
        objections = [text for text in self.reasons if text not in self.remarks]
        decision = decide(
            self.situation,
            self.candidate,
            objections=() if self.admissible else objections or unknown,
            errors=self.errors,
            best_residual=self._best_residual,
            better=better,
            cure_of_objections=self._cure_of_objections,
        )
        if self.switched is None:
            return decision
        # Imported here to keep start-up fast.
        from d2rpick.choice.pair.cures import omit_comparison

        quality = omit_comparison(decision.quality)
        grade = decision.grade
        is_momentum_equal = self.switched.momentum_error is not None
        if is_momentum_equal and not self.switched.objections:
            quality = trust_measured_momentum(quality)
            is_refused = decision.objections or self.errors
            grade = POOR if is_refused else quality.grade
        return decision._replace(grade=grade, quality=quality, is_compared=True)

    @cached_property
    def _best_residual(self) -> float | None:
        """The residual of the best tr at this td [-] if the residual of the pair is poor; None if it is unknown."""
        residual = self.candidate.residual
        if residual is None or residual <= POOR_RESIDUAL:
            return None
        pair = next(rank_candidates([self.situation])).pair
        return None if pair is None else pair.residual

    @cached_property
    def better(self) -> Pair | None:
        """A better pair with a grade other than "poor": that of ``suggest`` for this td, or what it names as better."""
        is_of_other = self.is_of_other_run or self.is_of_other_times
        if self._is_refuted or is_of_other or self.is_incomplete:
            return None
        good = self._good_pair
        if good is None or good.td != self.situation.td:
            return good
        decision = decide_with_better_pair(self._suggestion)
        return decision.better if decision and decision.better else good

    def _list_other_pairs(self, better: Pair) -> Iterator[tuple[str, Pair]]:
        """Yield the best pair at this td, and that of the flight if its residual is clearly smaller.

        ``better`` is the pair that the verdict names first: the nearest good one, which may need another td.
        """
        good = self._good_pair
        if good is not None and good.td == self.td != better.td:
            yield "with the given td", good
        if better.residual is None or better.residual <= MOST_GOOD:
            return
        choice = _choose_in_flight(self.situation)
        best = choice.recommended if choice else None
        if best is None or best.residual is None or best == better:
            return
        if better.residual - best.residual > EQUALLY_GOOD:
            yield "best in the flight", best

    @cached_property
    def _suggestion(self) -> PairSuggestion:
        """The answer of ``suggest`` for this td, from the reference run alone."""
        return suggest_at(self.situation)

    @cached_property
    def _good_pair(self) -> Pair | None:
        """The pair recommended from the reference run alone, even if a finished switched run is known."""
        return find_good_pair(self._suggestion)

    @property
    def is_of_other_run(self) -> bool:
        """True if the switched run differs from the reference run although neither was rigid yet."""
        return self.switched is not None and self.switched.is_of_other_run

    @property
    def is_of_other_times(self) -> bool:
        """True if the switched run was rigid in another window, so that it shows nothing about this pair."""
        return self.switched is not None and self.switched.is_of_other_times

    @property
    def is_incomplete(self) -> bool:
        """True if the switched run agrees with the reference run, but ended too early or with an error."""
        return self.switched is not None and self.switched.is_incomplete

    @property
    def _is_refuted(self) -> bool:
        """True if the finished switched run contradicts the pair that the reference run recommends.

        A switched run tests the recommended pair if its tr differs from that of the pair by no more than the timing
        tolerance.
        """
        if self.switched is None or not self.switched.objections:
            return False
        if self.is_incomplete:
            return False
        good = self._good_pair
        if good is None:
            return False
        tr = self.candidate.tr
        is_same_tr = abs(good.tr - tr) <= (self.candidate.timing_tolerance or 0.0)
        is_same_tr |= round_as_read(good.tr) == round_as_read(tr)
        return is_same_tr and good.td == self.situation.td

    @property
    def quality(self) -> Quality:
        """Grades for the motion and for the vibration of the pair."""
        return self.decision.quality

    @cached_property
    def mean_energy_bounds(self) -> MeanEnergyBounds | None:
        """Bounds of the mean energy after td relative to the reference run [-]; None if they are unknown."""
        return bound_mean_energy(self.situation, self.candidate)


def verify_in_history(
    history: History,
    tr: float,
    td: float,
    settings: Settings,
    earlier: Situation | None = None,
) -> PairVerdict:
    """Judge one pair (tr, td); the situation ``earlier`` is reused if it belongs to the same td.

    Raises
    ------
    RangeError
        If a time lies outside the record, or tr is not before td.
    """
    _check_order(tr, td)
    history.check_pair(tr, td)
    if earlier and td == earlier.td:
        return verify_at(earlier, tr)
    situation = examine_td(history, td, settings)
    return verify_at(situation, tr)


def verify_at(situation: Situation, tr: float) -> PairVerdict:
    """Judge one pair (tr, td), given the situation at td.

    Raises
    ------
    RangeError
        If tr lies outside the record or is not before td.
    """
    td = situation.td
    _check_order(tr, td)
    situation.history.energy_at(tr, "tr")
    judged = judge_times(situation, [tr])
    candidate = judged[0]
    is_known = situation.flight.start is not None
    share = situation.kinetic_share
    exceeded = list_exceeded_limits(situation, candidate)
    outside = td > situation.latest_td or (
        situation.earliest_tr is not None and td <= situation.earliest_tr
    )
    td_ok: bool | None = None
    if share is not None:
        # A limit of the user replaces the usual one; `exceeded` shows whether the td exceeds it.
        has_own_limit = situation.settings.max_kinetic_share is not None
        td_ok = has_own_limit or share <= POOR_KINETIC_SHARE
    if outside or any(excess.is_td_wrong for excess in exceeded):
        td_ok = False
    return PairVerdict(
        situation=situation,
        candidate=candidate,
        tr_ok=candidate.admissible if is_known else None,
        td_ok=td_ok,
        admissible=bool(judged.recommendable[0]),
        reasons=(*candidate.notes, *(excess.message for excess in exceeded)),
        remarks=_list_remarks(judged, candidate),
        errors=list_shown_errors(judged, candidate),
        cautions=(*warn_about_td(situation), *warn_about_place(situation, tr)),
    )


def _list_remarks(judged: Candidates, candidate: Candidate) -> tuple[str, ...]:
    """Return the notes on a candidate that raise no objection or only restate the size of its error."""
    objections = list_separate_objections(judged, candidate)
    return tuple(note for note in candidate.notes if note not in objections)


def list_separate_objections(
    judged: Candidates, candidate: Candidate
) -> tuple[str, ...]:
    """Return the objections to a candidate, but those to a large error only if the residual does not show the error."""
    is_shown = candidate.residual is not None and candidate.residual > POOR_RESIDUAL
    return judged.list_objections(max(candidate.rank - 1, 0), of_error=not is_shown)


def list_shown_errors(judged: Candidates, candidate: Candidate) -> tuple[str, ...]:
    """Return the objections to a candidate that the residual shows, so that they are not among the separate ones."""
    separate = list_separate_objections(judged, candidate)
    objections = judged.list_objections(max(candidate.rank - 1, 0))
    return tuple(text for text in objections if text not in separate)


def _check_order(tr: float, td: float) -> None:
    """Raise RangeError if tr is not before td."""
    if tr == td:
        raise RangeError(f"tr and td are both {tr:g}; give a td after tr")
    if not tr < td:
        raise RangeError(
            f"tr {tr:g} is not before td {td:g}; give the earlier time as tr"
        )


class AcceptableWindow(NamedTuple):
    """Window of acceptable tr from ``start`` to ``end`` [time]; ``share`` is its fraction of the flight up to td."""

    start: float
    end: float
    share: float


@dataclass(frozen=True, eq=False, repr=False)
class PairSuggestion(AnswerAtTd):
    """The answer of ``suggest``: ranked candidates, the recommended pair, a better pair at another td, and warnings.

    ``td_window`` is the window in which td was chosen; None if td was given. ``compared_td`` is the part of this window
    that keeps the margin; all td in it were compared. ``longer`` is the longest acceptable pair in the window, if the
    recommended pair is much shorter but better.
    """

    situation: Situation
    candidates: Candidates
    better_pair: Pair | None
    cautions: tuple[Caution, ...]
    health: Health | None = None
    td_window: tuple[float, float] | None = None
    compared_td: tuple[float, float] | None = None
    longer: Pair | None = None

    @property
    def chosen(self) -> Candidate | None:
        """The recommended candidate; None if no candidate is recommended."""
        return self.candidates.chosen

    @property
    def why_none(self) -> str:
        """Reason why no pair is recommended; empty if a pair is recommended."""
        return "; ".join(
            caution.message
            for caution in self.cautions
            if caution.code == "no-candidate"
        )

    @property
    def recommended(self) -> Pair | None:
        """The recommended pair; None if no pair is recommended."""
        return self.candidates.pair

    @cached_property
    def expected(self) -> Expectation | None:
        """Estimate of the motion after td if the basis is "energy"; otherwise None."""
        if self.situation.basis != "energy":
            return None
        return estimate_time_after(
            self.situation, self.chosen.energy if self.chosen else None
        )

    @cached_property
    def acceptable_windows(self) -> tuple[tuple[float, float], ...]:
        """First and last tr of each window of acceptable tr; empty if td lies outside the flight [time]."""
        if not self.situation.in_flight:
            return ()
        # Imported here to keep start-up fast.
        from d2rpick.choice.pair.windows import (
            find_acceptable_windows,
        )

        windows = find_acceptable_windows(
            self.situation, self.candidates, self.chosen.tr if self.chosen else None
        )
        return tuple((start, end) for start, end in windows.tolist())

    @cached_property
    def windows(self) -> tuple[AcceptableWindow, ...] | None:
        """Windows of acceptable and equally good tr if the basis is "energy"; otherwise None."""
        if self.situation.basis != "energy":
            return None
        flown = self.situation.td - (self.situation.earliest_tr or 0.0)
        return tuple(
            AcceptableWindow(low, high, (high - low) / flown)
            for low, high in self.acceptable_windows
        )

    @cached_property
    def decision(self) -> Decision | None:
        """Verdict on the recommended pair, with its reason and cure; None if there is no pair."""
        best = self.chosen
        if best is None:
            return None
        return decide(
            self.situation,
            best,
            better=self._good_pair,
            best_of=None if self.clearly_better else self.compared_td,
        )

    @property
    def _good_pair(self) -> Pair | None:
        """Another pair, clearly better than the recommended one and not poor; None if there is no such pair.

        A residual above 0.5 is poor unless the next contact makes it negligible.
        """
        better = self.clearly_better
        if better is None or _drop_poor(better):
            return better
        decision = self.decision_on_better
        return better if decision and decision.grade != POOR else None

    @cached_property
    def decision_on_better(self) -> Decision | None:
        """Verdict on the better pair by the rules of ``verify``; None if no better pair is known."""
        better = self.better_pair
        if better is None:
            return None
        examined = _examine_anew(self.situation, better.td)
        return verify_at(examined, better.tr)._decide(None)

    @cached_property
    def decision_on_longer(self) -> Decision | None:
        """Verdict on the longer pair by the rules of ``verify``; None if there is no longer pair."""
        longer = self.longer
        if longer is None:
            return None
        return verify_at(_examine_anew(self.situation, longer.td), longer.tr)._decide(
            None
        )

    def decision_on(self, candidate: Candidate) -> Decision:
        """Return the verdict on one of the candidates by the rules of ``verify``."""
        objections = list_separate_objections(self.candidates, candidate)
        limits = list_exceeded_limits(self.situation, candidate)
        messages = (excess.message for excess in limits)
        return decide(
            self.situation,
            candidate,
            objections=(*objections, *messages),
            errors=list_shown_errors(self.candidates, candidate),
            best_residual=self.recommended.residual if self.recommended else None,
            better=self._find_better_than(candidate),
            best_of=None if self.clearly_better else self.compared_td,
        )

    def _find_better_than(self, candidate: Candidate) -> Pair | None:
        """Return a pair that is clearly better than a candidate: at another td, or else the recommended one."""
        recommended = self.recommended
        is_usable = self.decision is not None and self.decision.grade != POOR
        if self._good_pair or recommended is None or not is_usable:
            return self._good_pair
        is_better = _has_smaller_residual(recommended, candidate)
        return recommended if is_better or not candidate.admissible else None

    @property
    def quality(self) -> Quality | None:
        """Grade of the recommended pair; None if no pair is recommended."""
        return self.decision.quality if self.decision else None

    @cached_property
    def mean_energy_bounds(self) -> MeanEnergyBounds | None:
        """Bounds of the mean energy after td for the recommended tr, relative to the reference run; None if unknown."""
        return bound_mean_energy(self.situation, self.chosen) if self.chosen else None

    @property
    def clearly_better(self) -> Pair | None:
        """Another pair that is clearly better than the recommended pair; None if there is none.

        Residuals are compared or, on the basis "energy", the amplitudes that correspond to the energies at td.
        """
        better = self.better_pair
        recommended = self.recommended
        if better is None or recommended is None or self.chosen is None:
            return better
        if better.residual is not None and recommended.residual is not None:
            return better if _has_smaller_residual(better, self.chosen) else None
        levels = [
            max(self.situation.vibration.whole.energy(td), 0.0) ** 0.5
            for td in (better.td, recommended.td)
        ]
        return better if levels[0] > (1 + EQUALLY_GOOD) * levels[1] else None


def _has_smaller_residual(pair: Pair, candidate: Candidate) -> bool:
    """Return True if the residual of a pair is smaller than that of a candidate by more than its uncertainty."""
    if pair.residual is None or candidate.residual is None:
        return False
    bound = candidate.residual_high
    uncertain = 0.0 if bound is None else bound - candidate.residual
    return candidate.residual - pair.residual > max(EQUALLY_GOOD, uncertain)


def decide_with_better_pair(answer: PairSuggestion) -> Decision | None:
    """Return the verdict on the recommended pair, after a search for a better pair if its grade is not "good"."""
    decision = answer.decision
    best = answer.chosen
    if best is None or decision is None or decision.reaches(GOOD):
        return decision
    if not answer.better_pair:
        decision = suggest_at(answer.situation, ranked=answer.candidates).decision
    return decision and compare_in_flight(decision, answer.situation, best)


def compare_in_flight(
    decision: Decision, situation: Situation, candidate: Candidate
) -> Decision:
    """Add to the decision on a pair a clearly better pair of the same flight, or the td range without a better pair.

    The flight is searched only if another time may be better, and if no better pair with a residual of at most 0.5 is
    known yet.
    """
    is_refused = decision.objections or decision.grade != decision.quality.grade
    needs_other_times = is_refused or any(
        cause.needs_other_times for cause in decision.quality.causes
    )
    if decision.grade == GOOD or not needs_other_times:
        return decision
    known = decision.better
    if known and (known.residual is None or known.residual <= POOR_RESIDUAL):
        return decision
    choice = _choose_in_flight(situation)
    if choice is None or choice.recommended is None or choice.decision is None:
        return decision
    if decision.grade == POOR:
        is_better = choice.decision.grade != POOR
    else:
        is_better = _has_smaller_residual(choice.recommended, candidate)
    if is_better:
        return decision._replace(better=choice.recommended)
    return decision if known else decision._replace(best_of=choice.compared_td)


def _choose_in_flight(situation: Situation) -> PairSuggestion | None:
    """Return the suggestion for the flight of a situation; None if the flight is unknown or allows no choice."""
    # Imported here to keep start-up fast.
    from d2rpick.choice.td.flights import find_longest_flight

    history, settings = situation.history, situation.settings
    flight = situation.flight
    if flight.start is None:
        return None
    own = (flight.start, history.end if flight.end is None else flight.end)
    longest = find_longest_flight(history, settings, otherwise=own)
    is_longest = longest[0] <= situation.td <= longest[1]
    return _choose_in_window(history, settings, longest if is_longest else own)


@remember
def _choose_in_window(
    history: History, settings: Settings, window: tuple[float, float]
) -> PairSuggestion | None:
    """Return the suggestion for a td in a window; None if the record does not allow a choice."""
    # Imported here to keep start-up fast.
    from d2rpick.choice.td.suggest_td import choose_td

    try:
        return _suggest_in_window(choose_td(history, window, settings))
    except RangeError:
        return None


def _suggest_in_window(chosen: Chosen) -> PairSuggestion:
    """Return the suggestion for the td that was chosen in a window."""
    answer = suggest_at(chosen.situation)
    return replace(
        answer,
        td_window=chosen.window,
        compared_td=chosen.inside,
        longer=chosen.given_up(answer.recommended),
    )


def suggest_in_history(
    history: History, td: float, settings: Settings
) -> PairSuggestion:
    """Rank the candidates for tr at ``td`` and recommend one; raise RangeError if td lies outside the record."""
    situation = examine_td(history, td, settings)
    return suggest_at(situation)


def suggest_at(
    situation: Situation, *, with_better: bool = True, ranked: Candidates | None = None
) -> PairSuggestion:
    """Rank the candidates for tr at the td of a situation, recommend one, and search for a better td.

    ``ranked`` lists the ranked candidates, at least up to the recommended one, if they are already known.
    """
    candidates = next(rank_candidates([situation])) if ranked is None else ranked
    best = candidates.chosen
    better = find_better_pair(situation) if with_better else None
    cautions = list(warn_about_td(situation))
    if best:
        cautions += warn_about_place(situation, best.tr)
    else:
        cautions.append(
            Caution("no-candidate", _explain_why_none(situation, candidates))
        )
    if with_better and not better:
        cautions.append(
            Caution(
                "no-better-td",
                "no peak of the energy in the flight has an admissible tr",
            )
        )
    return PairSuggestion(situation, candidates, better, tuple(cautions))


def find_better_pair(situation: Situation) -> Pair | None:
    """Return the recommended pair at the nearest energy peak for which a pair is recommended; None if there is none.

    The record is examined again at the td of this peak, so the pair is the one that ``suggest`` recommends for this td.
    """
    start = situation.earliest_tr
    if start is None:
        return None
    # If the end of the flight is unknown, only times up to the given td are tried.
    if situation.flight.end is None and not situation.evidence.span:
        end = situation.td
    else:
        end = situation.latest_td
    refused = 0
    for td in sorted(
        situation.peaks(start, end), key=lambda peak: abs(peak - situation.td)
    ):
        peak_situation = situation.at(td)
        if peak_situation.vibration.doubts or _is_level_refused(peak_situation):
            continue
        best = _find_saving_pair(peak_situation)
        if best is None:
            continue
        examined = _examine_anew(situation, td)
        best = best if examined.sees_as(peak_situation) else _find_saving_pair(examined)
        if best and _is_admissible_as_printed(situation, best.tr, td):
            return best
        refused += 1
        if refused == _MOST_REFUSED:
            return None
    return None


def find_good_pair(answer: PairSuggestion) -> Pair | None:
    """Return a pair whose grade is not "poor": the recommended pair at this td or else a better pair at another td."""
    if answer.decision and answer.decision.grade != POOR:
        return answer.recommended
    return _drop_poor(answer.better_pair)


def _drop_poor(pair: Pair | None) -> Pair | None:
    """Return a pair if its residual is known and not poor; otherwise None."""
    if pair is None or pair.residual is None or pair.residual > POOR_RESIDUAL:
        return None
    return pair


def _is_level_refused(situation: Situation) -> bool:
    """Return True if no tr can match the energy level at td because the level is negative or too high.

    This test saves time, because noise causes thousands of such peaks.
    """
    if situation.basis != "energy":
        return False
    level = situation.energy_td
    smallest_share = max(0.0, 1 - situation.settings.tolerance - ROUNDING)
    return level < -round_off(
        situation.history
    ) or level * smallest_share**2 > find_largest_energy(situation)


def _find_saving_pair(situation: Situation) -> Pair | None:
    """Return the recommended pair at a td if it saves run time, otherwise None."""
    return next(rank_candidates([situation], in_flight=True)).saving


def _examine_anew(situation: Situation, td: float) -> Situation:
    """Examine the same record at another td in the same way as at a td given by the user."""
    # The oscillator is fitted again, but the slow search for the reason for its rejection is skipped.
    quick = situation.evidence.span is None
    return examine_td(situation.history, td, situation.settings, quick=quick)


def _is_admissible_as_printed(situation: Situation, tr: float, td: float) -> bool:
    """Return True if ``verify`` accepts a pair once it is rounded to the six printed digits."""
    # RangeError means that rounding moved a time out of the record, or made both times equal.
    try:
        return verify_at(
            _examine_anew(situation, round_as_read(td)), round_as_read(tr)
        ).admissible
    except RangeError:
        return False


def _explain_why_none(situation: Situation, ranked: Candidates) -> str:
    """Return the reason why no candidate is acceptable."""
    if situation.keeps_nothing_of_flight:
        flight = situation.flight
        return (
            f"the margin {situation.margin:.6g} after the load and before the contact leaves nothing of the flight, "
            f"{flight.start:.6g} to {flight.end:.6g}; give a smaller `margin`"
        )
    if not (situation.history.parts or situation.history.energy.any()):
        return "the energy is 0 in all states, so nothing deforms; choose the internal energy with `energy`"
    if situation.td <= situation.history.start:
        return f"td = {situation.td:.6g} is the start of the record, so no time before it can be tr; give a later td"
    if not ranked:
        level = situation.energy_td
        return (
            f"before td = {situation.td:.6g} the energy neither reaches its value at td, {level:.6g}, nor "
            "peaks near it"
        )
    if situation.td > situation.latest_td:
        reasons = "; ".join(list_objections_to_td(situation)).removeprefix("td ")
        return f"td = {situation.td:.6g} lies {reasons}"
    flight = situation.flight
    if flight.start is not None and situation.td <= flight.start:
        where = f"td = {situation.td:.6g} lies before {describe_end_of_load(situation)}"
        end = "" if flight.end is None else f", and at most {flight.end:.6g}"
        return f"{where}; choose a later td{end}"
    nearest = ranked[0]
    exceeded = list_exceeded_limits(situation, nearest)
    reasons = "; ".join((*nearest.notes, *(excess.message for excess in exceeded)))
    return f"no tr is admissible; the best of {len(ranked)}, tr = {nearest.tr:.6g}: {reasons}"


_Answer = TypeVar("_Answer", PairSuggestion, PairVerdict)


def suggest_in_run(
    reference: Reference,
    td: float | tuple[float, float] | None,
    settings: Settings,
    *,
    with_better: bool = True,
    since: float | None = None,
    times: Sequence[float] | None = None,
) -> PairSuggestion:
    """Choose tr for ``td``, or both times if ``td`` is a time range (low, high) or None (the longest flight) [time].

    If ``with_better`` is False, no search for a better td than the given one is made. If td is chosen, no flight is
    assumed to begin before ``since`` [time]. In addition to the energy peaks, the td in ``times`` [time] are tried, by
    default an even grid.

    Raises
    ------
    RangeError
        If td or the window lies outside the record, if there is no flight, or if the run cannot be judged.
    """
    refuse_unsound(reference.history, settings, td)
    if td is None or isinstance(td, tuple):
        # Imported here to keep start-up fast.
        from d2rpick.choice.td.suggest_td import (
            choose_td,
        )

        chosen = choose_td(reference.history, td, settings, since, times)
        answer = _suggest_in_window(chosen)
    else:
        situation = examine_td(reference.history, td, settings)
        answer = suggest_at(situation, with_better=with_better)
        if with_better:
            answer = _add_choice_in_flight(answer)
    of_switched_run = refuse_switched_flight(reference, answer.situation)
    answer = replace(answer, cautions=(*of_switched_run, *answer.cautions))
    return _add_health(answer, reference.run)


def refuse_switched_flight(
    reference: Reference, situation: Situation
) -> tuple[Caution, ...]:
    """Raise RangeError if the parts, or some of them, were rigid in the flight up to td.

    The result is a warning if they were rigid before the flight, or if the energy of one part seems to be frozen.
    """
    # Imported here to keep start-up fast.
    from d2rpick.choice.switched.frozen import refuse_switched

    start, td = situation.flight.start, situation.td
    refuse_switched(situation.history, start, td)
    if not reference.run.parts:
        return ()
    from d2rpick.choice.switched.switched_run import (
        refuse_partly_rigid,
        warn_about_switched_run,
    )

    windows = refuse_partly_rigid(reference, start, td)
    return tuple(warn_about_switched_run(reference, windows, td))


def _add_choice_in_flight(answer: PairSuggestion) -> PairSuggestion:
    """Add to the answer for a given td the result of a search in its flight if the pair is not good."""
    best, decision = answer.chosen, answer.decision
    if best is None:
        choice = _choose_in_flight(answer.situation)
        is_usable = choice and choice.decision and choice.decision.grade != POOR
        if choice and is_usable:
            return replace(answer, better_pair=choice.recommended)
        return answer
    if decision is None:
        return answer
    decision = compare_in_flight(decision, answer.situation, best)
    if decision.better:
        return replace(answer, better_pair=decision.better)
    return replace(answer, compared_td=decision.best_of)


def verify_run(
    reference: Reference,
    tr: float,
    td: float,
    settings: Settings,
    earlier: Situation | None = None,
) -> PairVerdict:
    """Judge one pair (tr, td) of a reference run; see `verify_in_history` for ``earlier`` and the errors raised."""
    refuse_unsound(reference.history, settings, td, choosing=False)
    verdict = verify_in_history(reference.history, tr, td, settings, earlier)
    of_switched_run = refuse_switched_flight(reference, verdict.situation)
    verdict = replace(verdict, cautions=(*of_switched_run, *verdict.cautions))
    return _add_health(verdict, reference.run)


def _add_health(answer: _Answer, run: OpenedRun) -> _Answer:
    """Add the health of the run and its warnings, for the rigid window or, if no pair exists, for the flight up to td.

    States after td are ignored, because they do not affect the choice.
    """
    answer = replace(
        answer, cautions=(*answer.cautions, *warn_about_engine(run.sources))
    )
    history = answer.situation.history
    td = answer.situation.td
    balance = read_balance(run.databases, history.parts, td)
    if balance is None:
        return answer
    if isinstance(answer, PairVerdict):
        start: float | None = answer.candidate.tr
    else:
        if answer.recommended:
            start = answer.recommended.tr
        else:
            start = answer.situation.earliest_tr
    window = None if start is None or start >= td else (start, td)
    locked = history.mean_energy(*window) if window else None
    health = assess_health(balance, window, locked, td)
    flight = answer.situation.flight
    flies = (
        window is not None
        and flight.within(history.time)[0] <= window[0]
        and answer.situation.in_flight
    )
    health_cautions = warn_about_health(health, at_rest=answer.situation.at_rest)
    relevant: list[Caution] = [
        caution
        for caution in health_cautions
        if not (flies and flight.by_parts and caution.code in OF_THE_MODEL)
    ]
    return replace(answer, health=health, cautions=(*answer.cautions, *relevant))
