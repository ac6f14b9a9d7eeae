"""From a run to an answer: the recommendation with its rivals and the better td, and the verdict on a pair.

The command line, ``study``, ``check --history``, ``card`` and Python go this one way, and get the same numbers.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, TypeVar

from d2rpick.base.caching import cached_property
from d2rpick.base.errors import Caution, RangeError
from d2rpick.base.tuples import NamedTuple
from d2rpick.choice.aftermath import Kept, kept_mean_energy
from d2rpick.choice.candidates import Candidate, Candidates, Pair, judge
from d2rpick.choice.decision import Decision, decide
from d2rpick.choice.grades import POOR
from d2rpick.choice.health import (
    OF_THE_MODEL,
    assess,
    cautions_of_engine,
    cautions_of_health,
    refuse_unsound,
)
from d2rpick.choice.quality import (
    EQUALLY_GOOD,
    ROUNDING,
    Quality,
    candidates_at,
    over_limits,
)
from d2rpick.choice.situation import OfTd, Situation, examine
from d2rpick.choice.warnings import (
    POOR_KINETIC_SHARE,
    POOR_RESIDUAL,
    Expectation,
    against_td,
    cautions_of,
    expectation,
    most_energy,
    out_of_place,
)
from d2rpick.flight.internal_energy import round_off
from d2rpick.histories.balance import read_balance
from d2rpick.histories.digits import round_as_read

if TYPE_CHECKING:
    from collections.abc import Sequence

    from d2rpick.choice.comparison import Comparison
    from d2rpick.choice.health import Health
    from d2rpick.choice.question import Reference, Settings
    from d2rpick.histories.history import History
    from d2rpick.histories.run import Run
    from d2rpick.vibration.span import Fits


@dataclass(frozen=True, eq=False, repr=False)
class Verdict(OfTd):
    """Answer of ``verify``: the measures of one pair, and what is right or wrong with it.

    ``tr_ok`` and ``td_ok`` are None where the record does not tell.  ``computed`` is the energy of the
    finished switched run, if there is one.
    """

    situation: Situation
    candidate: Candidate
    tr_ok: bool | None
    td_ok: bool | None
    admissible: bool
    reasons: tuple[str, ...]
    cautions: tuple[Caution, ...]
    switched: Comparison | None = None
    health: Health | None = None
    computed: History | None = None

    @property
    def verified(self) -> bool:
        """Whether the pair is admissible and not poor, and its vibration is not wrong by more than a half."""
        residual = self.candidate.residual
        kept = residual is None or residual <= POOR_RESIDUAL
        return kept and self.decision.grade != POOR

    @cached_property
    def decision(self) -> Decision:
        """Whether to use the pair, why, and what would be better."""
        found = self._decide(None)
        return self._decide(self.better) if found.grade == POOR else found

    def _decide(self, better: Pair | None) -> Decision:
        unknown = () if self.reasons else ("nothing shows that tr suits this td",)
        objections = () if self.admissible else self.reasons or unknown
        return decide(
            self.situation, self.candidate, objections=objections, better=better
        )

    @cached_property
    def better(self) -> Pair | None:
        """A pair that is not poor: another tr for this td, or one at the nearest td that has one; None without."""
        return way_out(self.situation)

    @property
    def quality(self) -> Quality | None:
        """How good the pair is; None if it is not admissible."""
        return self.decision.quality if self.admissible else None

    @cached_property
    def kept(self) -> Kept | None:
        """Bounds of the mean energy after td, over that of the reference; None if nothing tells it."""
        return kept_mean_energy(self.situation, self.candidate)


def verify(
    history: History,
    tr: float,
    td: float,
    settings: Settings,
    known: Situation | None = None,
) -> Verdict:
    """Judge one pair, by what is ``known`` where its td is that one, or nearly so as it is printed.

    RangeError when a time lies outside the record or tr is not before td.
    """
    _in_order(tr, td)
    fits = known.fits if known else None
    return verify_at(
        known if known and td == known.td else examine(history, td, settings, fits), tr
    )


def verify_at(situation: Situation, tr: float) -> Verdict:
    """Judge one pair in a situation that is known; RangeError when tr lies outside the record or is not before td."""
    settings, td = situation.settings, situation.td
    _in_order(tr, td)
    situation.history.energy_at(tr, "tr")
    judged = judge(situation, [tr])
    candidate = judged[0]
    known = situation.flight.start is not None
    share = situation.kinetic_share
    limit = (
        POOR_KINETIC_SHARE
        if settings.max_kinetic_share is None
        else settings.max_kinetic_share
    )
    outside = td > situation.latest_td or (
        situation.earliest_tr is not None and td <= situation.earliest_tr
    )
    td_ok = False if outside else None if share is None else share <= limit
    return Verdict(
        situation=situation,
        candidate=candidate,
        tr_ok=candidate.admissible if known else None,
        td_ok=td_ok,
        admissible=bool(judged.kept[0]),
        reasons=(*candidate.notes, *over_limits(situation, candidate)),
        cautions=(*cautions_of(situation), *out_of_place(situation, tr)),
    )


def _in_order(tr: float, td: float) -> None:
    if not tr < td:
        raise RangeError(
            f"tr {tr:g} is not before td {td:g}; the part is rigid from tr to td"
        )


# Pairs at other peaks that may turn out not to verify when the record is examined there, before it is given up.
_MOST_REFUSED = 3


class AcceptableWindow(NamedTuple):
    """From ``start`` to ``end`` [time] every tr is acceptable; ``share`` is its share of the flight up to td [-]."""

    start: float
    end: float
    share: float


@dataclass(frozen=True, eq=False, repr=False)
class Suggestion(OfTd):
    """Answer of ``suggest``: ranked candidates, the recommended pair, a better one at another td, warnings.

    ``td_window`` is where td was chosen, if it was; ``longer`` is the longest acceptable pair in it, where much saving
    was given up for quality.
    """

    situation: Situation
    candidates: Candidates
    better_pair: Pair | None
    cautions: tuple[Caution, ...]
    health: Health | None = None
    td_window: tuple[float, float] | None = None
    longer: Pair | None = None

    @property
    def chosen(self) -> Candidate | None:
        """The candidate that is recommended."""
        return self.candidates.chosen

    @property
    def why_none(self) -> str:
        """Why nothing is recommended; empty where a pair is."""
        return "; ".join(
            one.message for one in self.cautions if one.code == "no-candidate"
        )

    @property
    def recommended(self) -> Pair | None:
        """The recommended pair."""
        return self.candidates.pair

    @cached_property
    def expected(self) -> Expectation | None:
        """What the energy alone tells of the time after td, where it is all there is."""
        if self.situation.basis != "energy":
            return None
        return expectation(self.situation, self.chosen.energy if self.chosen else None)

    @cached_property
    def acceptable_windows(self) -> tuple[tuple[float, float], ...]:
        """First and last acceptable tr of each window of them, on any basis [time]."""
        if not self.situation.in_flight:
            return ()
        from d2rpick.choice.windows import (
            acceptable_windows,
        )  # not above: an oscillator does without it

        found = acceptable_windows(
            self.situation, self.candidates, self.chosen.tr if self.chosen else None
        )
        return tuple((start, end) for start, end in found.tolist())

    @cached_property
    def windows(self) -> tuple[AcceptableWindow, ...] | None:
        """The same where the level alone decides, None on another basis: any tr in one is as good as a crossing."""
        if self.situation.basis != "energy":
            return None
        flown = self.situation.td - (self.situation.earliest_tr or 0.0)
        return tuple(
            AcceptableWindow(low, high, (high - low) / flown)
            for low, high in self.acceptable_windows
        )

    @cached_property
    def decision(self) -> Decision | None:
        """Whether to use the recommended pair, why, and what would be better; None without a pair."""
        best = self.chosen
        if best is None:
            return None
        return decide(self.situation, best, better=self._good_pair)

    @property
    def _good_pair(self) -> Pair | None:
        """The better pair, if a residual shows that it is not poor."""
        better = self.clearly_better
        if better is None or better.residual is None or better.residual > POOR_RESIDUAL:
            return None
        return better

    def decision_on(self, candidate: Candidate) -> Decision:
        """Decide on one of the candidates, by the rules of `verify`."""
        objections = () if candidate.admissible else candidate.notes
        limits = over_limits(self.situation, candidate)
        return decide(self.situation, candidate, objections=(*objections, *limits))

    @property
    def quality(self) -> Quality | None:
        """How good the recommended pair is; None without one."""
        return self.decision.quality if self.decision else None

    @cached_property
    def kept(self) -> Kept | None:
        """Bounds of the mean energy after td for the recommended tr, over that of the reference; None if unknown."""
        return kept_mean_energy(self.situation, self.chosen) if self.chosen else None

    @property
    def clearly_better(self) -> Pair | None:
        """The better pair where it is better than that recommended by more than what counts as equally good.

        Residuals are compared; on basis "energy" the amplitudes of the levels at td.
        """
        better, own = self.better_pair, self.recommended
        if better is None or own is None:
            return better
        if better.residual is not None and own.residual is not None:
            bound = self.chosen.residual_high if self.chosen else None
            uncertain = 0.0 if bound is None else bound - own.residual
            return (
                better
                if own.residual - better.residual > max(EQUALLY_GOOD, uncertain)
                else None
            )
        levels = [
            max(self.situation.vibration.whole.energy(td), 0.0) ** 0.5
            for td in (better.td, own.td)
        ]
        return better if levels[0] > (1 + EQUALLY_GOOD) * levels[1] else None


def suggest(history: History, td: float, settings: Settings) -> Suggestion:
    """Rank the candidates for tr at ``td`` and recommend one; RangeError when td lies outside the record."""
    return suggest_at(examine(history, td, settings))


def suggest_at(
    situation: Situation, *, with_better: bool = True, ranked: Candidates | None = None
) -> Suggestion:
    """Rank the candidates for tr in a situation that is known, and recommend one; look for a better td too.

    ``ranked`` are the candidates in order where they are known, up to the recommended one at least.
    """
    candidates = next(candidates_at([situation])) if ranked is None else ranked
    best = candidates.chosen
    better = find_better_pair(situation) if with_better else None
    cautions = list(cautions_of(situation))
    if best:
        cautions += out_of_place(situation, best.tr)
    else:
        cautions.append(Caution("no-candidate", _why_none(situation, candidates)))
    if with_better and not better:
        cautions.append(
            Caution(
                "no-better-td",
                "no peak of the energy in the flight has an acceptable tr",
            )
        )
    return Suggestion(situation, candidates, better, tuple(cautions))


def find_better_pair(situation: Situation) -> Pair | None:
    """Give the nearest peak of the energy in the flight that has an acceptable tr, and the best one there.

    The pair is the one that a user finds who asks for that td: the record is examined anew there.
    """
    start = situation.earliest_tr
    if start is None:
        return None
    # where nothing tells the end of the flight, it is not sought beyond td
    end = (
        situation.td
        if situation.flight.end is None and not situation.evidence.span
        else situation.latest_td
    )
    refused = 0
    for td in sorted(
        situation.peaks(start, end), key=lambda peak: abs(peak - situation.td)
    ):
        there = situation.at(td)
        if (
            there.vibration.doubts
            or _level_refuses(there)
            or not (best := _saving(there))
        ):
            continue
        anew = _anew(situation, td)
        best = best if anew.sees_as(there) else _saving(anew)
        if best and _holds_as_printed(situation, best.tr, td):
            return best
        refused += 1
        if refused == _MOST_REFUSED:
            return None
    return None


def way_out(situation: Situation) -> Pair | None:
    """Give a pair that is not poor: the recommended tr of this td, else the pair of the nearest better td."""
    answer = suggest_at(situation)
    if answer.decision and answer.decision.grade != POOR:
        return answer.recommended
    better = answer.better_pair
    if better is None or better.residual is None or better.residual > POOR_RESIDUAL:
        return None
    return better


def _level_refuses(situation: Situation) -> bool:
    """Whether the level at td alone speaks against any tr: noise makes thousands of peaks below zero, or too high."""
    if situation.basis != "energy":
        return False
    level, least = (
        situation.energy_td,
        max(0.0, 1 - situation.settings.tolerance - ROUNDING),
    )
    return level < -round_off(situation.history) or level * least**2 > most_energy(
        situation
    )


def _saving(situation: Situation) -> Pair | None:
    """Give what is recommended at a td, where that saves something."""
    return next(candidates_at([situation], in_flight=True)).saving


def _anew(situation: Situation, td: float) -> Situation:
    """Look at the same record for another td, as if that had been asked for."""
    quick = (
        situation.evidence.span is None
    )  # an oscillator is sought again, why there is none is not
    return examine(
        situation.history, td, situation.settings, situation.fits, quick=quick
    )


def _holds_as_printed(situation: Situation, tr: float, td: float) -> bool:
    """Whether ``verify`` would verify a pair in the six digits that people read."""
    try:
        return verify_at(
            _anew(situation, round_as_read(td)), round_as_read(tr)
        ).admissible
    except RangeError:  # rounded beyond an end of the record, or onto each other
        return False


def _why_none(situation: Situation, ranked: Candidates) -> str:
    if not ranked:
        level = situation.energy_td
        return f"before td = {situation.td:.6g} the energy neither passes its level {level:.6g} nor peaks near it"
    if situation.td > situation.latest_td:
        return f"td = {situation.td:.6g}: {'; '.join(against_td(situation))}"
    nearest = ranked[0]
    reasons = "; ".join((*nearest.notes, *over_limits(situation, nearest)))
    return f"none of {len(ranked)} candidates is acceptable; the nearest, tr = {nearest.tr:.6g}: {reasons}"


_Answer = TypeVar("_Answer", Suggestion, Verdict)


def suggest_of(
    reference: Reference,
    td: float | tuple[float, float] | None,
    settings: Settings,
    *,
    with_better: bool = True,
    fits: Fits | None = None,
    since: float | None = None,
    times: Sequence[float] | None = None,
) -> Suggestion:
    """Choose tr for ``td``, or both times with td in a window (low, high) or, for None, in the longest flight [time].

    ``with_better`` False: for a given td no better one is looked for.  ``fits`` are those of an earlier look at the
    record with the same settings.  For a td in a window: no flight is taken to begin before ``since``, and ``times``
    are td that are looked at beside the peaks of the energy, by default an even grid [time].

    Raises
    ------
    RangeError
        If td or the window lies outside the record, no flight is seen, or the run cannot be judged.
    """
    refuse_unsound(reference.history, settings, td)
    if td is None or isinstance(td, tuple):
        from d2rpick.choice.suggest_td import (
            choose_td,
        )  # not above: a td that is given needs no search

        chosen = choose_td(reference.history, td, settings, fits, since, times)
        answer = suggest_at(chosen.situation)
        answer = replace(
            answer, td_window=chosen.window, longer=chosen.given_up(answer.recommended)
        )
    else:
        answer = suggest_at(
            examine(reference.history, td, settings, fits), with_better=with_better
        )
    return _with_health(answer, reference.run)


def verify_of(
    reference: Reference,
    tr: float,
    td: float,
    settings: Settings,
    known: Situation | None = None,
) -> Verdict:
    """Judge one pair of switch times; errors and ``known`` as for `verify`."""
    refuse_unsound(reference.history, settings, td, choosing=False)
    return _with_health(
        verify(reference.history, tr, td, settings, known), reference.run
    )


def compare_with(
    verdict: Verdict, reference: Reference, switched: Reference, min_mean: float = 0.0
) -> Verdict:
    """Hold a finished switched run, read in the same way, against the reference by which its times were judged.

    ``min_mean`` is the least mean energy after td that is expected, as a share of the reference's [-].

    Raises
    ------
    RangeError
        If one of the two runs does not go on after td.
    """
    from d2rpick.choice.comparison import compare

    found = compare(
        verdict.situation, verdict.candidate.tr, reference, switched, min_mean
    )
    return replace(
        verdict,
        switched=found,
        computed=switched.history,
        admissible=verdict.admissible
        and not found.objections,  # a wrong motion overrules the verdict
        reasons=verdict.reasons + found.objections,
        cautions=(*verdict.cautions, *cautions_of_engine(switched.run.sources)),
    )


def _with_health(answer: _Answer, run: Run) -> _Answer:
    """Add how far the run can be trusted, above all in the rigid window, else in the flight up to td.

    What comes after td does not matter for the choice.
    """
    answer = replace(
        answer, cautions=(*answer.cautions, *cautions_of_engine(run.sources))
    )
    history, td = answer.situation.history, answer.situation.td
    balance = read_balance(run.databases, history.parts, td)
    if balance is None:
        return answer
    if isinstance(answer, Verdict):
        start: float | None = answer.candidate.tr
    else:
        start = (
            answer.recommended.tr
            if answer.recommended
            else answer.situation.earliest_tr
        )
    window = None if start is None or start >= td else (start, td)
    locked = history.mean_energy(*window) if window else None
    health, flight = assess(balance, window, locked, td), answer.situation.flight
    flies = (
        window is not None
        and flight.within(history.time)[0] <= window[0]
        and answer.situation.in_flight
    )
    found = cautions_of_health(health, at_rest=answer.situation.at_rest)
    told: list[Caution] = [
        one
        for one in found
        if not (flies and flight.by_parts and one.code in OF_THE_MODEL)
    ]
    return replace(answer, health=health, cautions=(*answer.cautions, *told))
