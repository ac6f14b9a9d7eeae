"""Judges the windows of a deck by the history of a run without switching, with the code of ``verify``.

Not imported by the rules themselves: without a history the check does not need numbers.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Final, NamedTuple

from d2rpick.base.errors import Caution, DeckError, if_written, name_units
from d2rpick.choice.answers import Verdict, find_better_pair, suggest_at, verify_of
from d2rpick.choice.deck_of_run import in_deck
from d2rpick.choice.health import WRONG_ENERGY
from d2rpick.choice.question import Reference, Settings
from d2rpick.choice.situation import examine
from d2rpick.choice.warnings import POOR_KINETIC_SHARE, end_of_flight, end_of_load
from d2rpick.deck import read_inventory
from d2rpick.flight.contact_times import (
    ContactTimes,
    find_contact_times,
    find_force_times,
    narrow_to_states,
)
from d2rpick.histories.contact_forces import find_force
from d2rpick.histories.digits import above, first_as_read, in_the_record
from d2rpick.histories.surroundings import UNKNOWN

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Iterator

    from d2rpick.choice.switched_run import Times
    from d2rpick.deck.switching import Window
    from d2rpick.histories.history import History
    from d2rpick.histories.opening import Run, Selection


class Fault(NamedTuple):
    """What an energy history has against a window: the rule it belongs to, at which end, and why."""

    rule: str
    at_td: bool
    message: str


# What verify warns of and no rule reports.
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
    "nothing in the history shows when the load is over; give that time as `after`"
)


@dataclass
class HistoryJudge:
    """Judges by one run: the parts of a window together where the run has parts, else by the whole model.

    As ``suggest`` chooses it for these parts: they are locked in and released at the same times.

    ``selection`` says what else was asked for; with a named energy all windows are judged by that one.  In the windows
    that are ``done`` the run was switched already: they cannot be judged by it.
    """

    run: Run
    selection: Selection
    settings: Settings
    done: tuple[Times, ...] = ()
    _references: dict[tuple[int, ...], Reference] = field(default_factory=dict)
    _faults: dict[tuple[tuple[int, ...], float, float | None], tuple[Fault, ...]] = (
        field(default_factory=dict)
    )
    _cautions: dict[Caution, list[int]] = field(default_factory=dict)

    def beside(self, deck: str) -> None:
        """Let the deck that is judged next tell what acts on its parts; one without parts of its own tells nothing."""
        try:
            inventory = read_inventory(deck)
        except DeckError:
            inventory = None
        run = in_deck(self.run.within(UNKNOWN), inventory)
        if run.surroundings is not self.run.surroundings:
            self.run = run
            self._references.clear()
            self._faults.clear()

    @property
    def end(self) -> float:
        """Last time of the history."""
        return float(self._reference(self._known[:1]).history.time[-1])

    @property
    def cautions(self) -> list[Caution]:
        """What to be aware of, by what was judged so far."""
        return [
            caution._replace(message=f"{name_units(parts)}: {caution.message}")
            if parts
            else caution
            for caution, parts in self._cautions.items()
        ]

    @property
    def notes(self) -> tuple[str, ...]:
        """What the readers left out or assumed, by what was judged so far."""
        return tuple(
            dict.fromkeys(
                note for one in self._references.values() for note in one.history.notes
            )
        )

    def _reference(self, parts: tuple[int, ...]) -> Reference:
        """Give the run with the energy of some parts, or of the whole model where there are none."""
        if parts not in self._references:
            chosen = (
                self.selection._replace(parts=tuple(map(str, parts)))
                if parts
                else self.selection
            )
            self._references[parts] = Reference.of(self.run, chosen)
        return self._references[parts]

    def faults(
        self, window: Window, together: Iterable[int], *, by_force: bool = False
    ) -> tuple[Fault, ...]:
        """Everything that speaks against a window; of one that is not closed, or inverted, tr alone is judged.

        ``together`` are the parts that are switched at the same times.  One that a force switches (``by_force``) is
        judged between states of the history.
        """
        td = window.td if window.td is not None and window.td > window.tr else None
        known = self._known
        if known and window.part is not None and window.part not in known:
            what = f"not in the history, which has {name_units(known)}; was it renumbered, or not written?"
            return (Fault("D2R205", False, what),)
        parts = (
            ()
            if window.part is None
            else tuple(part for part in known if part in {*together})
        )
        tr = window.tr
        if by_force:
            tr, td = narrow_to_states(self._reference(parts).history.time, tr, td)
        key = parts, tr, td
        if key not in self._faults:
            if known and not parts:
                which = "members" if window.unit.is_set else "parts"
                who = f"the {which} of {window.unit.kind} {window.unit.id}"
                what = f"{who} are not known, so it is judged by the whole model"
                self._cautions[Caution("judged-by-whole", what)] = []
            self._faults[key] = tuple(self._judged(parts, tr, td))
        return self._faults[key]

    def deforming(self, parts: Collection[int]) -> tuple[int, ...] | None:
        """Those of some parts that ever have internal energy; None where the history has not all of them."""
        chosen = [part for part in self.run.parts if part.id in parts]
        if len(chosen) < len(parts):
            return None
        energies = if_written(lambda: self.run.part_energies(chosen))
        if energies is None:
            return None
        return tuple(
            part.id
            for part, energy in zip(chosen, energies.T, strict=True)
            if energy.any()
        )

    def contacts(
        self, parts: Collection[int]
    ) -> tuple[tuple[float, float], ...] | None:
        """When something pushes some parts [time], by their momenta; None where the history does not show it."""
        found = self.pushed(parts)
        return found and found.spans

    def pushed(self, parts: Collection[int]) -> ContactTimes | None:
        """As `contacts`, with how well the times are known."""
        chosen = [part for part in self.run.parts if part.id in parts]
        momenta = (
            next((one for one in self.run.momenta(chosen, None) if one.parts), None)
            if chosen
            else None
        )
        return find_contact_times(momenta) if momenta else None

    def find_force_spans(
        self, kind: str, number: int, least: float = 0.0
    ) -> tuple[tuple[float, float], ...] | None:
        """Find when the force of a contact, interface or rigid wall acts [time]; None if the history has it not.

        ``least``: only a force above it counts [force].
        """
        force = find_force(self.run.contact_forces, kind, number)
        found = find_force_times(force, least) if force else None
        return found and found.spans

    @property
    def _known(self) -> tuple[int, ...]:
        return (
            () if self.selection.energy else tuple(part.id for part in self.run.parts)
        )

    def _judged(
        self, parts: tuple[int, ...], tr: float, td: float | None
    ) -> Iterator[Fault]:
        reference = self._reference(parts)
        history = reference.history
        first, last = float(history.time[0]), float(history.time[-1])
        times = [("tr", tr)] if td is None else [("tr", tr), ("td", td)]
        outside = [
            (name == "td", name, time)
            for name, time in times
            if not first <= time <= last
        ]
        for at_td, name, time in outside:
            message = (
                f"{name} = {time:.6g} lies outside the history, {first:.6g} to {last:.6g}; "
                f"correct it or run longer"
            )
            yield Fault("D2R205", at_td, message)
        if outside:
            return
        if td is None:
            yield from _of_load(history, tr, self.settings)
            return
        if meant := in_the_record(history.time, [td], history.time_unit):
            found = f"td = {td:.6g} lies within the first ten states of the history, {first:.6g} to {last:.6g}"
            yield Fault(
                "D2R205",
                True,
                f"{found}; is the deck in s and the history not? {meant[0]:.6g} lies in it too",
            )
            return
        if (tr, td) in self.done:
            return
        verdict = verify_of(reference, tr, td, self.settings)
        if parts and not history.energy.any():
            # nothing to lock in, as the reader's note says; when it may be switched is known by momentum alone
            yield from (
                _of_flight(verdict)
                if verdict.situation.flight.start is not None
                else ()
            )
            return
        for caution in verdict.cautions:
            if caution.code in _KEPT:
                self._cautions.setdefault(caution, []).extend(parts)
        yield from faults_of(verdict)


def faults_of(verdict: Verdict) -> Iterator[Fault]:
    """Translate a verdict into rules: any pair that does not verify has at least one fault of severity error."""
    found = [*_of_flight(verdict), *_of_error(verdict)]
    if not verdict.verified and not found:
        found = [Fault("D2R201", False, "; ".join(verdict.reasons))]
    yield from found
    situation = verdict.situation
    if (
        situation.kinetic_share is not None
        and situation.kinetic_share > POOR_KINETIC_SHARE
    ):
        better = find_better_pair(situation)
        way_out = (
            f"better: td = {better.td:.6g} with tr = {better.tr:.6g}"
            if better
            else "no better td was found"
        )
        what = f"{situation.kinetic_share:.0%} of the vibration energy is kinetic at td = {situation.td:.6g}"
        yield Fault("D2R203", True, f"{what} and no tr can keep it; {way_out}")


def _of_load(history: History, tr: float, settings: Settings) -> Iterator[Fault]:
    """Judge a tr of which no td is known: it should lie in the last flight of the history, or in one around it."""
    last = examine(history, float(history.time[-1]), settings)
    earliest = last.earliest_tr
    if earliest is not None and tr >= earliest:
        return
    around = examine(history, tr, settings)
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
        end = f"before {end_of_load(last)} ({last.flight.source})"
        yield Fault("D2R204", False, f"tr = {tr:.6g} lies {end}; switch after it")


def _of_flight(verdict: Verdict) -> Iterator[Fault]:
    situation, tr = verdict.situation, verdict.candidate.tr
    earliest = situation.earliest_tr
    if earliest is None:
        yield Fault("D2R204", False, situation.flight.refusal or _UNKNOWN)
    elif tr < first_as_read(earliest):
        end = f"before {end_of_load(situation)} ({situation.flight.source})"
        yield Fault("D2R204", False, f"tr = {tr:.6g} lies {end}; {_way_out(verdict)}")
    if situation.td > situation.latest_td:
        end = f"after {end_of_flight(situation)}"
        yield Fault(
            "D2R204", True, f"td = {situation.td:.6g} lies {end}; switch back before it"
        )


def _of_error(verdict: Verdict) -> Iterator[Fault]:
    candidate, situation = verdict.candidate, verdict.situation
    tolerance = situation.most_error
    if situation.at_rest:
        return  # nothing vibrates: any level is that of td but for round-off
    if candidate.sign_match is False:
        what = "the deformation at tr has the opposite sign of that at td"
        yield Fault("D2R202", False, f"{what}; {_way_out(verdict)}")
        return
    if candidate.lock_in_error is not None:
        error, what = candidate.lock_in_error, "lock-in error"
    elif candidate.level_error is not None:
        error, what = candidate.level_error, "level error"
    else:
        return
    if error > tolerance:
        parts = situation.history.parts or ()
        of = (
            f" of the {len(parts)} parts that are switched together"
            if len(parts) > 1
            else ""
        )
        levels = f"the energy{of} is {candidate.energy:.4g} at tr and {situation.energy_td:.4g} at td"
        expected = (
            f"{what} {above(error, tolerance)}, at most {tolerance:g} was expected"
        )
        yield Fault("D2R201", False, f"{levels}: {expected}; {_way_out(verdict)}")


def _way_out(verdict: Verdict) -> str:
    """Name a tr that suits the td, or where to look for a pair."""
    other = suggest_at(verdict.situation, with_better=False)
    if other.recommended:
        return f"tr = {other.recommended.tr:.6g} suits this td"
    if better := find_better_pair(verdict.situation):
        return (
            f"no tr suits this td; td = {better.td:.6g} with tr = {better.tr:.6g} does"
        )
    return "no tr suits this td; see d2rpick suggest"
