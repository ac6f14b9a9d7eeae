"""Judge the windows of a deck by the energy history of a reference run, with the same code as ``verify``.

The rules do not import this module, because a check without a history needs no numerics and therefore starts faster.
"""

from __future__ import annotations

from dataclasses import field
from typing import TYPE_CHECKING, Final, NamedTuple

from d2rpick.base.data_classes import dataclass
from d2rpick.base.errors import Caution, DeckError, give_if_written, name_units
from d2rpick.choice.answers import PairVerdict, find_better_pair, suggest_at, verify_run
from d2rpick.choice.health import WRONG_ENERGY
from d2rpick.choice.pair.cures import name_parts_in_verify
from d2rpick.choice.pair.quality import list_exceeded_limits
from d2rpick.choice.pair.situation import examine_td
from d2rpick.choice.pair.warnings import (
    POOR_KINETIC_SHARE,
    describe_end_of_flight,
    describe_end_of_load,
)
from d2rpick.choice.parts.deck_of_run import add_surroundings, describe_other_model
from d2rpick.choice.question import Reference, Settings
from d2rpick.deck import read_inventory
from d2rpick.flight.contact_times import (
    ContactTimes,
    find_contact_times,
    find_force_times,
    narrow_to_states,
)
from d2rpick.histories.contact_forces import find_force
from d2rpick.histories.digits import (
    convert_to_unit_of_record,
    format_beyond_limit,
    round_to_first_as_read,
)
from d2rpick.histories.surroundings import UNKNOWN

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Iterator

    from d2rpick.base.spans import Times
    from d2rpick.choice.pair.candidates import Pair
    from d2rpick.choice.pair.decision import Decision
    from d2rpick.choice.pair.situation import Situation
    from d2rpick.deck.switching import SwitchWindow
    from d2rpick.histories.history import History
    from d2rpick.histories.opening import OpenedRun, Selection

# Codes of those ``verify`` warnings that the check repeats because no rule reports the problem.
_KEPT: Final = (
    "truncated-input",
    "no-free-flight",
    "flight-from-energy",
    "flight-sources-disagree",
    "plastic-or-preload",
    "few-states",
    WRONG_ENERGY,
)
_UNKNOWN: Final = (
    "the history does not show when the load ends; give that time with `after`"
)
_NOT_BY_DECK: Final = (
    "the history shows a flight, but not under the gravity and supports of this deck; check that the history is of "
    "this deck, or give the end of the load with `after`"
)


class Fault(NamedTuple):
    """An objection to a window, based on an energy history: the rule, the time to change (td or tr), the message."""

    rule: str
    at_td: bool
    message: str


class Judgement(NamedTuple):
    """The objections to a window, and the verdict on its pair (None if the history does not suffice for a verdict)."""

    faults: tuple[Fault, ...] = ()
    decision: Decision | None = None


@dataclass
class HistoryJudge:
    """Judges windows by the energy of the switched parts in a reference run or, without part data, that of the model.

    Parts that are switched together are judged together, because ``suggest`` chooses one pair of times for them.

    ``selection`` names the parts or the energy by which windows are judged; a named energy applies to all windows.
    ``done`` contains the windows in which the run is already switched, and which it therefore cannot judge.
    """

    run: OpenedRun
    selection: Selection
    settings: Settings
    done: tuple[Times, ...] = ()
    _references: dict[tuple[int, ...], Reference] = field(default_factory=dict)
    _judgements: dict[tuple[tuple[int, ...], float, float | None], Judgement] = field(
        default_factory=dict
    )
    _cautions: dict[Caution, list[int]] = field(default_factory=dict)

    def use_deck(self, deck: str) -> None:
        """Use the supports, gravity and joints of a deck for the next judgements; without parts, none are known.

        Raises
        ------
        DeckError
            If the history belongs to another model than the deck, so that it judges no time of the deck.
        """
        try:
            inventory = read_inventory(deck)
        except DeckError:
            inventory = None
        difference = describe_other_model(self.run, inventory) if inventory else ""
        if difference:
            raise DeckError(
                f"{deck}: the history is of another model: {difference}; give the history of this deck"
            )
        run = add_surroundings(self.run.within(UNKNOWN), inventory)
        if run.surroundings is not self.run.surroundings:
            self.run = run
            self._references.clear()
            self._judgements.clear()

    @property
    def end(self) -> float:
        """Return the time of the last state of the history."""
        return self._reference(self._known[:1]).history.end

    @property
    def cautions(self) -> list[Caution]:
        """Return the warnings that all judgements so far have issued."""
        return [
            caution._replace(message=f"{name_units(parts)}: {caution.message}")
            if parts
            else caution
            for caution, parts in self._cautions.items()
        ]

    @property
    def notes(self) -> tuple[str, ...]:
        """Return what the readers omitted or assumed for all judgements so far."""
        return tuple(
            dict.fromkeys(
                note
                for reference in self._references.values()
                for note in reference.history.notes
            )
        )

    def _reference(self, parts: tuple[int, ...]) -> Reference:
        """Return the reference run with the energy of the given parts, or of the model if no parts are given."""
        if parts not in self._references:
            if parts:
                chosen = self.selection._replace(parts=tuple(map(str, parts)))
            else:
                chosen = self.selection
            self._references[parts] = Reference.of(self.run, chosen)
        return self._references[parts]

    def judge(
        self, window: SwitchWindow, together: Iterable[int], *, by_force: bool = False
    ) -> Judgement:
        """Judge a window. If td is missing or not later than tr, judge only tr.

        ``together`` contains the parts that are switched at the same times. A window that a force switches
        (``by_force``) is judged between states of the history.
        """
        is_from_start = window.tr == 0 and window.opened.by.kind == "plain"
        if is_from_start and window.closed is None:
            # A part that is rigid from the start to the end of the run has no time that a history could judge.
            return Judgement()
        td = window.td if window.td is not None and window.td > window.tr else None
        history_parts = self._known
        if (
            history_parts
            and window.part is not None
            and window.part not in history_parts
        ):
            problem = f"not in the history, which has {name_units(history_parts)}; correct the id, or write its energy"
            return Judgement((Fault("D2R205", False, problem),))
        parts: tuple[int, ...] = ()
        if window.part is not None:
            parts = tuple(part for part in history_parts if part in {*together})
        tr = window.tr
        if by_force:
            tr, td = narrow_to_states(self._reference(parts).history.time, tr, td)
        key = parts, tr, td
        if key not in self._judgements:
            if history_parts and not parts:
                which = "members" if window.unit.is_set else "parts"
                members = f"the {which} of {window.unit.kind} {window.unit.id}"
                problem = f"{members} are unknown, so the window is judged by the energy of the whole model"
                self._cautions[Caution("judged-by-whole", problem)] = []
            self._judgements[key] = self._judge_times(parts, tr, td)
        return self._judgements[key]

    def deforming(self, parts: Collection[int]) -> tuple[int, ...] | None:
        """Return the parts that have internal energy at any time; None if the history lacks one of the given parts."""
        chosen = [part for part in self.run.parts if part.id in parts]
        if len(chosen) < len(parts):
            return None
        part_energies = give_if_written(lambda: self.run.part_energies(chosen))
        if part_energies is None:
            return None
        return tuple(
            part.id
            for part, energy in zip(chosen, part_energies.T, strict=True)
            if energy.any()
        )

    def contacts(
        self, parts: Collection[int]
    ) -> tuple[tuple[float, float], ...] | None:
        """Find the spans [time] in which contact forces act on the given parts, from their momenta; None if unknown."""
        contact_times = self.pushed(parts)
        return contact_times and contact_times.spans

    def pushed(self, parts: Collection[int]) -> ContactTimes | None:
        """Return the time spans that `contacts` returns, and their uncertainty [time]."""
        chosen = [part for part in self.run.parts if part.id in parts]
        if chosen:
            momenta = next(
                (
                    part_momenta
                    for part_momenta in self.run.momenta(chosen, None)
                    if part_momenta.parts
                ),
                None,
            )
        else:
            momenta = None
        return find_contact_times(momenta) if momenta else None

    def find_force_spans(
        self, kind: str, number: int, least: float = 0.0
    ) -> tuple[tuple[float, float], ...] | None:
        """Return the spans in which the force of a contact, interface or wall acts [time]; None if no file contains it.

        Only a force above ``least`` is used [force].
        """
        force = find_force(self.run.contact_forces, kind, number)
        force_spans = find_force_times(force, least) if force else None
        return force_spans and force_spans.spans

    @property
    def _known(self) -> tuple[int, ...]:
        if self.selection.energy:
            return ()
        return tuple(part.id for part in self.run.parts)

    def _explain_unknown_load(self, parts: tuple[int, ...]) -> str:
        """Explain why the end of the load is unknown: by the history, or only by its contradiction to the deck."""
        without_deck = HistoryJudge(
            self.run.within(UNKNOWN), self.selection, self.settings
        )
        history = without_deck._reference(parts).history
        situation = examine_td(history, history.end, self.settings)
        return _UNKNOWN if situation.earliest_tr is None else _NOT_BY_DECK

    def _judge_times(
        self, parts: tuple[int, ...], tr: float, td: float | None
    ) -> Judgement:
        """Judge the times of parts that are switched at the same times."""
        reference = self._reference(parts)
        history = reference.history
        outside = tuple(_find_times_outside(history, tr, td))
        if outside:
            return Judgement(outside)
        if td is None:
            faults = tuple(_judge_open_window(history, tr, self.settings))
            if any(fault.message == _UNKNOWN for fault in faults):
                faults = (Fault("D2R204", False, self._explain_unknown_load(parts)),)
            return Judgement(faults)
        if (tr, td) in self.done:
            return Judgement()
        verdict = verify_run(reference, tr, td, self.settings)
        if parts and not history.energy.any():
            # Parts without internal energy lock in no energy, so only the flight limits their switching times.
            is_flight_known = verdict.situation.flight.start is not None
            return Judgement(tuple(_judge_flight(verdict)) if is_flight_known else ())
        for caution in verdict.cautions:
            if caution.code in _KEPT:
                self._cautions.setdefault(caution, []).extend(parts)
        return Judgement(tuple(find_faults(verdict)), _decide_in_check(verdict))


def _find_times_outside(
    history: History, tr: float, td: float | None
) -> Iterator[Fault]:
    """Yield objections to times outside the history, and to a td that seems to have a different unit."""
    first = history.start
    last = history.end
    named_times = [("tr", tr)] if td is None else [("tr", tr), ("td", td)]
    is_inside = True
    for name, time in named_times:
        if not first <= time <= last:
            is_inside = False
            message = (
                f"{name} = {time:.6g} lies outside the history ({first:.6g} to {last:.6g}); "
                f"correct it, or run the reference longer"
            )
            yield Fault("D2R205", name == "td", message)
    if td is None or not is_inside:
        return
    if times_in_record := convert_to_unit_of_record(
        history.time, [td], history.time_unit
    ):
        problem = f"td = {td:.6g} lies within the first ten states of the history ({first:.6g} to {last:.6g})"
        yield Fault(
            "D2R205",
            True,
            f"{problem}, but {times_in_record[0]:.6g} lies in it too; give deck and history in the same time unit",
        )


def _decide_in_check(verdict: PairVerdict) -> Decision:
    """Return the verdict on a pair, with cures that refer to no option that the check lacks."""
    decision = verdict.decision
    return decision._replace(quality=name_parts_in_verify(decision.quality))


def find_faults(verdict: PairVerdict) -> Iterator[Fault]:
    """Yield the problems that follow from a verdict; an inadmissible pair leads to at least one error."""
    situation, decision = verdict.situation, _decide_in_check(verdict)
    limit_faults = [*_judge_limits(verdict)]
    faults = [*_judge_flight(verdict), *_judge_error(verdict), *limit_faults]
    if not verdict.admissible and not faults:
        faults = [Fault("D2R201", False, "; ".join(verdict.reasons))]
    yield from faults
    if verdict.admissible and not decision.reaches(situation.settings.min_quality):
        what = f"{decision.verdict}: {decision.reason}; {decision.cure}"
        yield Fault("D2R209", False, what)
    elif (
        _loses_most(situation)
        # One mistake should cause only one finding.
        and not any(fault.at_td for fault in limit_faults)
    ):
        better = decision.better or find_better_pair(situation)
        cure = _name_pair(better) if better else "no better td was found"
        problem = f"{situation.kinetic_share:.0%} of the vibration energy is kinetic at td = {situation.td:.6g}"
        yield Fault("D2R203", True, f"{problem} and is lost for every tr; {cure}")


def _judge_open_window(
    history: History, tr: float, settings: Settings
) -> Iterator[Fault]:
    """Object to a tr without td unless tr lies in the last flight of the history or in a flight around this tr."""
    last = examine_td(history, history.end, settings)
    earliest = last.earliest_tr
    if earliest is not None and tr >= earliest:
        return
    around = examine_td(history, tr, settings)
    start = around.earliest_tr
    if (
        around.flight.source != "energy"
        and start is not None
        and start <= tr <= around.latest_td
    ):
        return
    if earliest is None:
        yield Fault("D2R204", False, _UNKNOWN)
    else:
        end = f"before {describe_end_of_load(last)} ({last.flight.source})"
        yield Fault("D2R204", False, f"tr = {tr:.6g} lies {end}; choose a later tr")


def _judge_flight(verdict: PairVerdict) -> Iterator[Fault]:
    """Yield objections to times outside the flight: tr before the end of the load, or td after the next contact."""
    situation = verdict.situation
    tr = verdict.candidate.tr
    earliest = situation.earliest_tr
    if earliest is None:
        yield Fault("D2R204", False, situation.flight.refusal or _UNKNOWN)
    elif tr < round_to_first_as_read(earliest):
        end = f"before {describe_end_of_load(situation)} ({situation.flight.source})"
        yield Fault(
            "D2R204", False, f"tr = {tr:.6g} lies {end}; {_suggest_cure(verdict)}"
        )
    if situation.td > situation.latest_td:
        end = f"after {describe_end_of_flight(situation)}"
        yield Fault(
            "D2R204", True, f"td = {situation.td:.6g} lies {end}; choose an earlier td"
        )


def _judge_error(verdict: PairVerdict) -> Iterator[Fault]:
    """Yield an objection to the frozen deformation if it has the wrong sign or an error above the tolerance."""
    candidate = verdict.candidate
    situation = verdict.situation
    tolerance = situation.most_error
    if situation.at_rest:
        # If nothing vibrates, the energy at td equals that at any tr, apart from rounding.
        return
    if candidate.sign_match is False:
        quantity = "the deformations at tr and td have opposite directions"
        yield Fault("D2R202", False, f"{quantity}; {_suggest_cure(verdict)}")
        return
    if candidate.lock_in_error is not None:
        error = candidate.lock_in_error
        quantity = "frozen-deformation error"
    elif candidate.level_error is not None:
        error = candidate.level_error
        quantity = "level error"
    else:
        return
    if error > tolerance:
        parts = situation.history.parts or ()
        if len(parts) > 1:
            of_parts = f" of the {len(parts)} parts that are switched together"
        else:
            of_parts = ""
        levels = f"the energy{of_parts} is {candidate.energy:.4g} at tr and {situation.energy_td:.4g} at td"
        expected = f"{quantity} {format_beyond_limit(error, tolerance)}, expected at most {tolerance:g}"
        yield Fault("D2R201", False, f"{levels}: {expected}; {_suggest_cure(verdict)}")


def _judge_limits(verdict: PairVerdict) -> Iterator[Fault]:
    """Yield an objection for each limit of a recommendation that the pair exceeds."""
    exceeded = list_exceeded_limits(verdict.situation, verdict.candidate)
    cure = _suggest_cure(verdict) if exceeded else ""
    for excess in exceeded:
        yield Fault("D2R210", excess.is_td_wrong, f"{excess.message}; {cure}")


def _suggest_cure(verdict: PairVerdict) -> str:
    """Suggest a tr that suits this td, a better pair, or where to look for one.

    If most of the vibration energy is lost at td, no tr is suitable, and this cure names the same pair as D2R203.
    """
    situation = verdict.situation
    better = verdict.decision.better
    if better and better.td != situation.td:
        # The verdict names this pair as well.
        return _name_pair(better)
    if _loses_most(situation):
        better = find_better_pair(situation)
        if better:
            return _name_pair(better)
    suggestion = suggest_at(situation, with_better=False)
    if suggestion.recommended:
        return f"for this td, use tr = {suggestion.recommended.tr:.6g}"
    if better := find_better_pair(situation):
        return f"no tr suits this td; {_name_pair(better)}"
    return "no tr suits this td; see d2rpick suggest"


def _loses_most(situation: Situation) -> bool:
    """Return True if more than half of the vibration energy is kinetic at td, so that every tr would lose it."""
    share = situation.kinetic_share
    return share is not None and share > POOR_KINETIC_SHARE


def _name_pair(pair: Pair) -> str:
    """Return the advice to use this pair."""
    return f"use td = {pair.td:.6g} with tr = {pair.tr:.6g}"
