"""Find the error and the rigid time of the best tr for each td of a grid, and for each energy peak."""

from __future__ import annotations

from dataclasses import replace
from itertools import accumulate
from typing import TYPE_CHECKING, Final

import numpy as np

from d2rpick.base.caching import cached_property
from d2rpick.base.data_classes import dataclass
from d2rpick.base.errors import Caution, RangeError
from d2rpick.choice.answers import (
    PairSuggestion,
    decide_with_better_pair,
    refuse_switched_flight,
    suggest_at,
    suggest_in_run,
)
from d2rpick.choice.health import refuse_unsound
from d2rpick.choice.pair.candidates import judge_candidates
from d2rpick.choice.pair.quality import (
    EQUALLY_GOOD,
    list_exceeded_limits,
    rank_candidates,
    rank_judged,
)
from d2rpick.choice.pair.situation import AnswerAtTd, Situation, make_look
from d2rpick.choice.pair.warnings import warn_about_td
from d2rpick.choice.switched.frozen import RIGID_TIMES
from d2rpick.choice.td.flights import check_chosen_flight, find_longest_flight
from d2rpick.choice.td.suggest_td import (
    STEPS,
    find_best_known,
    get_error_of_pair,
    list_offered_times,
    round_error,
)
from d2rpick.histories.digits import round_as_read

if TYPE_CHECKING:
    from collections.abc import Container, Iterator, Sequence

    from d2rpick.choice.pair.aftermath import MeanEnergyBounds
    from d2rpick.choice.pair.candidates import Candidate, Candidates, Pair
    from d2rpick.choice.pair.decision import Decision
    from d2rpick.choice.pair.quality import Quality
    from d2rpick.choice.question import Reference, Settings
    from d2rpick.choice.td.plan import RunPlan

# Another td is mentioned if its displayed error is at most this fraction of the error at the given td [-].
_MUCH_LESS: Final = 0.5
# Another pair is mentioned if its rigid time is at least this fraction of that of the given pair [-].
_LEAST_KEPT: Final = 0.5
# Number of td values in the grid on a page, which gives the curve a point every few pixels.
_STEPS_OF_PAGE: Final = 120
# Smallest number of td values per flight if a plan has many flights.
_FEWEST_STEPS: Final = 40


@dataclass(frozen=True, eq=False)
class Offer(AnswerAtTd):
    """The answer of ``suggest`` for one td of the trade-off. Most values are computed only when they are used.

    ``candidates`` ends with the recommended candidate, if any. ``peak`` is True if the energy has a maximum at td.
    ``unbeaten`` is True if the offer is Pareto-optimal: no other offer is better in error or saving and worse in
    neither. ``recommended`` is True if this is the answer of ``suggest`` when td is chosen, too.
    """

    situation: Situation
    candidates: Candidates
    peak: bool
    unbeaten: bool = False
    recommended: bool = False

    @property
    def pair(self) -> Pair | None:
        """The recommended pair at this td, by which different td are compared; None if no tr is recommended."""
        return self.candidates.pair

    @cached_property
    def error(self) -> float | None:
        """Error by which the pairs of different td are compared [-].

        This error is the residual or, on the basis "energy", the shortfall of the level at td, 1 - sqrt(E(td)/(2 <E>)),
        relative to the largest vibration energy.
        """
        return get_error_of_pair(self.situation, self.pair)

    @property
    def tr(self) -> float | None:
        """Recommended tr [time]; None if no tr is recommended."""
        return self.pair.tr if self.pair else None

    @property
    def rigid_time(self) -> float | None:
        """Time for which the parts are rigid [time]; None if there is no pair."""
        return self.pair.rigid_time if self.pair else None

    @property
    def best(self) -> Candidate | None:
        """The recommended candidate; None if no candidate is recommended."""
        return self.candidates.chosen

    @property
    def saving(self) -> float | None:
        """Fraction of the run time that is saved [-]; None if the cost of the parts is unknown."""
        share = self.best.run_time_share if self.best else None
        return None if share is None else 1 - share

    @cached_property
    def answer(self) -> PairSuggestion:
        """The complete answer of ``suggest`` for this td.

        All candidates are needed for the windows, and those before the flight for the reason why no tr is recommended.
        """
        if self.pair:
            candidates = self.candidates
        else:
            candidates = None
        if candidates and self.basis == "energy":
            candidates = next(rank_candidates([self.situation], in_flight=True))
        return suggest_at(self.situation, with_better=False, ranked=candidates)

    @property
    def decision(self) -> Decision | None:
        """Verdict on the recommended pair, with its reason."""
        return self.answer.decision

    @cached_property
    def decision_with_cure(self) -> Decision | None:
        """The verdict, including the better pair that ``suggest`` would name."""
        return decide_with_better_pair(self.answer)

    @property
    def quality(self) -> Quality | None:
        """Grade of the recommended pair."""
        return self.answer.quality

    @property
    def mean_energy_bounds(self) -> MeanEnergyBounds | None:
        """Bounds of the mean energy after td relative to the reference run [-]."""
        return self.answer.mean_energy_bounds


def make_offers(
    situations: Sequence[Situation], peaks: Container[float]
) -> Iterator[Offer]:
    """Yield the proposal (`Offer`) for the td of each situation; ``peaks`` are the times of the energy peaks [time]."""
    for judged in judge_candidates(situations, in_flight=True):
        candidates_of_each = [*rank_judged(judged)]
        orders = [
            candidates.order[
                : 0 if candidates.recommended is None else candidates.recommended + 1
            ]
            for candidates in candidates_of_each
        ]
        judged_up_to_best = judged.at(np.concatenate(orders))
        ends = accumulate(
            rows.size for rows in orders
        )  # Candidates before the flight are omitted, because noisy records have very many of them.
        for candidates, rows, end in zip(candidates_of_each, orders, ends, strict=True):
            best = replace(
                candidates,
                judged=judged_up_to_best,
                order=np.arange(end - rows.size, end),
            )
            yield Offer(candidates.situation, best, candidates.situation.td in peaks)


@dataclass(frozen=True)
class TradeOff:
    """The answer of ``explore``: proposals for the range ``td_window`` in ascending order of td [time].

    ``requested`` is the offer for the requested td, and ``recommended`` that for the pair that ``suggest`` chooses in
    the window; ``suggestion`` is its complete answer. ``start`` is the offer with which the others are compared: that
    for the requested td or, if there is none, the offer that saves most. ``step`` is the nearest offer with half the
    error of ``start``: preferably an energy peak, otherwise a Pareto-optimal td, otherwise the recommended offer if its
    error is smaller.
    """

    situation: Situation
    suggestion: PairSuggestion
    td_window: tuple[float, float]
    offers: tuple[Offer, ...]
    cautions: tuple[Caution, ...]
    requested: Offer | None = None
    recommended: Offer | None = None
    start: Offer | None = None
    step: Offer | None = None

    @property
    def shown(self) -> Offer | None:
        """The offer whose verdict is the answer: that for the requested td, or else the recommended one."""
        return self.requested or self.recommended

    @property
    def more_accurate(self) -> Offer | None:
        """The proposal with the smallest error; None if it is the recommended one or its error is of another kind."""
        recommended = self.recommended
        if recommended is None:
            return None
        by_energy = recommended.basis == "energy"
        smaller = (
            offer
            for offer in self.offers
            if _is_comparable(offer)
            and (offer.basis == "energy") == by_energy
            and round_error(offer.error) < round_error(recommended.error)
        )
        return min(smaller, key=lambda offer: round_error(offer.error), default=None)

    def decide_on(self, offer: Offer) -> Decision | None:
        """Return the verdict on a proposed pair as ``suggest`` gives it, with a better pair if there is one.

        If no other td is clearly better than the requested one, the advice in its verdict states this.
        """
        if offer.recommended:
            return self.suggestion.decision
        decision = offer.decision_with_cure
        if decision and offer is self.requested and self.step is None:
            return decision._replace(best_of=self.td_window)
        return decision


def explore_run(
    reference: Reference,
    settings: Settings,
    td_window: tuple[float, float] | None = None,
    *,
    td: float | None = None,
    steps: int = STEPS,
    since: float | None = None,
) -> TradeOff:
    """Find the best pair for each of many td in a range.

    Parameters
    ----------
    reference : Reference
    settings : Settings
    td_window : (float, float), optional
        Window for td [time].  The default is the flight that contains td, or else the longest flight; if there is no
        flight and td is given, it is the whole record.
    td : float, optional
        Requested td, with which others are compared [time].
    steps : int
        Number of td on an even grid, to which every energy peak is added. If there are more peaks than grid points, the
        highest peak in each interval of the grid replaces the grid point.
    since : float, optional
        No flight is assumed to begin before this time [time].

    Raises
    ------
    RangeError
        If td or the window lies outside the record, or there is no flight and neither of them is given.
    """
    history = reference.history
    refuse_unsound(history, settings, td)
    record = history.start, history.end
    window = td_window or find_longest_flight(
        history, settings, around=td, otherwise=None if td is None else record
    )
    if td_window is None:
        check_chosen_flight(history, window, td)
    look = make_look(history, settings, since)
    known_best, inside = find_best_known(look, history, window)
    offered, peaks = list_offered_times(known_best, inside, steps)
    times = offered.tolist() if td is None else [*offered.tolist(), td]
    suggestion = suggest_in_run(reference, window, settings, since=since, times=times)
    chosen = suggestion.recommended.td if suggestion.recommended else None
    fully = make_look(history, settings, since, quick=False)
    asked_at = map(look, sorted({*times, *([] if chosen is None else [chosen])}))
    # The full search is used, because only it determines why there is no oscillator.
    situations = [
        offer if offer.evidence.span else fully(offer.td) for offer in asked_at
    ]
    offers = [
        replace(offer, recommended=offer.td == chosen)
        for offer in _mark_unbeaten([*make_offers(situations, peaks)])
    ]
    requested = next((offer for offer in offers if offer.td == td), None)
    if requested:
        # The chosen pair was judged in its own flight, which may be another one.
        refuse_switched_flight(reference, requested.situation)
    situation = fully(known_best.td)
    # Before the first td of the flight, the states are too few to show a vibration.
    warned = suggestion.situation
    if td is not None and look(td).in_flight:
        # The energy alone shows a different flight for each td, so the flight that ``suggest`` finds is shown.
        situation = warned = fully(td)
    start = requested or max(
        filter(_is_comparable, offers),
        key=lambda offer: offer.rigid_time or 0.0,
        default=None,
    )
    return TradeOff(
        situation=situation,
        suggestion=suggestion,
        td_window=inside,
        offers=tuple(offers),
        cautions=tuple(_warn_about_window(warned, window, inside, offers, suggestion)),
        requested=requested,
        recommended=next((offer for offer in offers if offer.recommended), None),
        start=start,
        step=_find_step(start, offers) if start else None,
    )


def _is_comparable(offer: Offer) -> bool:
    """Return True if a proposal can be compared: its pair saves run time and has a known error."""
    return offer.candidates.saving is not None and offer.error is not None


def _mark_unbeaten(offers: Sequence[Offer]) -> Iterator[Offer]:
    """Mark the Pareto-optimal proposals; deformation errors are not compared with energy-level errors."""
    unbeaten = set()
    for is_residual in (True, False):
        group = [
            offer
            for offer in offers
            if _is_comparable(offer) and (offer.basis != "energy") == is_residual
        ]
        smallest_error = np.inf
        longest = np.inf
        printed = {
            offer.td: (
                -round_as_read(offer.rigid_time or 0.0),
                round_error(offer.error),
            )
            for offer in group
        }
        for offer in sorted(group, key=lambda offer: printed[offer.td]):
            rigid, error = printed[offer.td]
            # Two equal pairs are both Pareto-optimal.
            if error < smallest_error or (error, rigid) == (
                smallest_error,
                longest,
            ):
                unbeaten.add(offer.td)
                smallest_error, longest = error, rigid
    return (replace(offer, unbeaten=offer.td in unbeaten) for offer in offers)


def _find_step(start: Offer, offers: Sequence[Offer]) -> Offer | None:
    """Return the proposal closest to ``start`` with at most half its error, else the recommended one if it is better.

    Like ``suggest``, this function tries the energy peaks first. If no peak is suitable, it returns a Pareto-optimal
    offer.
    """
    error = np.inf if start.error is None else start.error
    least_time = _LEAST_KEPT * (start.rigid_time or 0.0)
    comparable = [
        offer
        for offer in offers
        if start.pair is None or (offer.basis == "energy") == (start.basis == "energy")
    ]
    better = [
        offer
        for offer in comparable
        if _is_comparable(offer) and (offer.error or 0.0) < error - EQUALLY_GOOD
    ]
    halved = [
        offer
        for offer in better
        if (offer.error or 0.0) <= _MUCH_LESS * error
        and (offer.rigid_time or 0.0) >= least_time
    ]
    peaks = [offer for offer in halved if offer.peak]
    nearby = peaks or [offer for offer in halved if offer.unbeaten]
    if nearby:
        return min(nearby, key=lambda offer: abs(offer.td - start.td))
    return next((offer for offer in better if offer.recommended), None)


def _warn_about_window(
    situation: Situation,
    window: tuple[float, float],
    inside: tuple[float, float],
    offers: Sequence[Offer],
    suggestion: PairSuggestion,
) -> Iterator[Caution]:
    """Yield the warnings about the td range; a warning about a single td belongs to the proposal for this td."""
    yield from (
        caution for caution in suggestion.cautions if caution.code == RIGID_TIMES
    )
    of_td = {"poor-td", "td-in-load", "td-after-contact", "no-energy", "at-rest"}
    yield from (
        caution for caution in warn_about_td(situation) if caution.code not in of_td
    )
    if inside[1] < window[1]:
        contact = situation.flight.end
        if contact is not None and inside[1] < contact:
            kept_before, limit = f"the contact at {contact:.6g}", contact
        else:
            kept_before, limit = f"{window[1]:.6g}", window[1]
        margin = f"a margin of {limit - inside[1]:.3g} is kept before {kept_before}"
        yield Caution("margin-kept", f"td is at most {inside[1]:.6g}: {margin}")
    if not any(map(_is_comparable, offers)):
        nothing = "no td in the range has an admissible tr"
        yield Caution("no-candidate", f"{nothing}{_explain_by_limits(suggestion)}")


def _explain_by_limits(suggestion: PairSuggestion) -> str:
    """Describe the limits that the nearest candidate exceeds at the td of ``suggest``; empty if it exceeds none."""
    if suggestion.recommended or not suggestion.candidates:
        return ""
    nearest = suggestion.candidates[0]
    exceeded = list_exceeded_limits(suggestion.situation, nearest)
    if not exceeded:
        return ""
    reasons = "; ".join(excess.message for excess in exceeded)
    return f"; tr = {nearest.tr:.6g} for td = {suggestion.td:.6g}: {reasons}"


def explore_flights(reference: Reference, plan: RunPlan) -> tuple[TradeOff, ...]:
    """Explore other td for each flight of a plan, with coarser grids if there are more flights."""
    answers = {
        row.number: row.answer for row in plan.flights if row.answer and row.window
    }
    landings = {row.number: row.flight.end for row in plan.flights}
    reference = reference._replace(history=plan.history)
    steps = max(_STEPS_OF_PAGE // max(len(answers), 1), _FEWEST_STEPS)
    trade_offs = (
        explore_around(
            reference,
            answer.situation,
            answer.td_window,
            steps=steps,
            since=landings.get(number - 1),
        )
        for number, answer in answers.items()
    )
    return tuple(trade_off for trade_off in trade_offs if trade_off)


def explore_around(
    reference: Reference,
    situation: Situation,
    window: tuple[float, float] | None = None,
    *,
    steps: int = _STEPS_OF_PAGE,
    since: float | None = None,
) -> TradeOff | None:
    """Explore other td around the td of a situation.

    Parameters
    ----------
    reference : Reference
    situation : Situation
        Describes the requested or chosen td.
    window : (float, float), optional
        Window in which td was chosen [time].  The default is the flight that contains td.
    steps : int, optional
        Number of td on an even grid.  The default is the number that a page needs.
    since : float, optional
        No flight is assumed to begin before this time [time].

    Returns
    -------
    TradeOff or None
        None if no flight is known.
    """
    flight = situation.flight
    if window is None and flight.start is None:
        return None
    try:
        span = window or flight.within(situation.history.time)
        return explore_run(
            reference,
            situation.settings,
            span,
            td=situation.td,
            steps=steps,
            since=since,
        )
    except RangeError:  # The history has no state in this range of td.
        return None
