"""Describe a td before any tr is considered: the flight, the vibration and the energy level at td."""

from __future__ import annotations

from dataclasses import replace
from functools import cache, partial
from typing import TYPE_CHECKING, Final

import numpy as np

from d2rpick.base.caching import cached_property
from d2rpick.base.data_classes import dataclass
from d2rpick.base.errors import RangeError
from d2rpick.base.memory import remember
from d2rpick.base.tuples import NamedTuple
from d2rpick.choice.pair.together import PartsTogether
from d2rpick.choice.parts.margins import find_drift_of_bodies, find_margin
from d2rpick.choice.question import FEWEST_STATES
from d2rpick.flight.chosen import Described, choose_flight
from d2rpick.flight.flight import Flight, Seen, find_seen_flight
from d2rpick.flight.internal_energy import find_largest, find_quiet_time, round_off
from d2rpick.flight.margin import LEAST_MARGIN
from d2rpick.histories.digits import sum_times_as_read
from d2rpick.vibration import find_models
from d2rpick.vibration.identify import MIN_SAMPLES_PER_PERIOD
from d2rpick.vibration.model import (
    Evidence,
    Vibration,
    describe_energy_at,
    find_energy_at,
    is_doubtful,
    model_at,
)
from d2rpick.vibration.span import (
    Span,
    SpanSearch,
    find_longest_described,
    find_oscillator,
    limit_bounds,
)
from d2rpick.vibration.two_modes import KnownLines

if TYPE_CHECKING:
    from collections.abc import Callable

    from d2rpick.choice.question import Settings
    from d2rpick.flight.internal_energy import QuietTime
    from d2rpick.flight.margin import Margin
    from d2rpick.flight.position_error import Bodies
    from d2rpick.histories.history import History, Samples
    from d2rpick.histories.names import Part
    from d2rpick.vibration import SignedModel
    from d2rpick.vibration.identify import Identification
    from d2rpick.vibration.modal_span import ModalWindow

    Look = Callable[[float], "Situation"]


# Assumed upper bound of the error in energies from the solver, as a fraction of the highest energy [-].
_SOLVER_ERROR: Final = 1e-5
# Energy fluctuations up to this fraction of the largest vibration energy after the load are ignored [-].
_FAINT: Final = 1e-4
# If an oscillator describes at least this fraction of the record, no modes are fitted [-].
_MOST_OF_RECORD: Final = 0.5
# Rounding error of a printed energy, in units of the last printed digit [-].
# The rounding error is two units of the last printed digit, because a constant energy may alternate between two values.
_QUANTA: Final = 2


def is_at_rest(
    history: History, flight: tuple[float, float | None], td: float, *, deformed: bool
) -> bool:
    """Return True if the energy in ``flight`` is only round-off, or fluctuates by no more than solver noise.

    ``flight`` is (start, end) [time]; the end is None if it is unknown. Free flight excites no vibration, so a
    vibration in a part of the flight has existed since its start. Therefore the whole flight is tested if its end is
    known, not only the time up to td; only the margin is excluded, because the contact may have begun in it. Plastic
    work does not affect the result, because the test concerns the fluctuation about the level. If ``deformed`` is True
    (a vibration is known), only the test for round-off is made.
    """
    start, end = flight
    last = td if end is None else max(td, end - LEAST_MARGIN * (end - start))
    _, inside = history.between(start, last)
    # Fewer samples than this cannot show a vibration.
    if inside.size < MIN_SAMPLES_PER_PERIOD:
        return False
    # The rounding error is 0 if no energy is written at all.
    rounding = round_off(history)
    if rounding > 0 and float(np.abs(inside).max()) <= rounding:
        return True
    if deformed or float(inside.min()) < 0 or history.energy_at(td) <= 0:
        return False
    return float(np.ptp(inside)) <= _find_faint_fluctuation(history, start)


def _find_faint_fluctuation(history: History, start: float) -> float:
    """Return the largest energy fluctuation in a flight that is treated as free of vibration [energy].

    This limit is the largest of the solver error, the error of the printed digits, and a small fraction of the energy
    decrease after the ``start`` of the flight [time]. This decrease is a lower bound of the elastic energy, because
    plastic work remains.
    """
    energies = history.between(start, history.end)[1]
    fall = float((np.maximum.accumulate(energies) - energies).max(initial=0.0))
    highest = _find_highest_energy(history)
    quantum = history.energy_precision.quantum(float(np.abs(energies).max(initial=0.0)))
    return max(_SOLVER_ERROR * highest, _QUANTA * quantum, _FAINT * fall)


@remember
def _find_highest_energy(history: History) -> float:
    """Return the largest absolute energy of a record [energy]."""
    return find_largest(history.energy)


class AnswerAtTd:
    """Base class of all answers about the td that ``situation`` describes."""

    situation: Situation

    @property
    def td(self) -> float:
        """Time of the switch back to deformable [time]."""
        return self.situation.td

    @property
    def flight(self) -> Flight:
        """Free flight around td, with ``start``, ``end`` and ``source``."""
        return self.situation.flight

    @property
    def basis(self) -> str:
        """Basis of the answer: ``"oscillator"``, ``"modal"``, ``"swings"`` or ``"energy"``."""
        return self.situation.basis

    @property
    def energy_td(self) -> float:
        """Energy level at td [energy]."""
        return self.situation.energy_td

    @property
    def kinetic_share(self) -> float | None:
        """Kinetic fraction K at td [-], which no tr preserves; None on basis ``"energy"`` or if nothing vibrates."""
        return self.situation.kinetic_share


@dataclass(frozen=True, eq=False, repr=False)
class Situation:
    """A history at one td [time], with the flight and the vibration around td.

    ``evidence`` contains the models of the vibration that were found.
    """

    history: History
    td: float
    settings: Settings
    flight: Flight
    evidence: Evidence

    @cached_property
    def vibration(self) -> Vibration:
        """The most detailed vibration model at td that is reliable enough for the choice."""
        return model_at(self.whole, self.evidence)

    @cached_property
    def whole(self) -> Vibration:
        """The vibration model of the total energy of all chosen parts."""
        return find_energy_at(self.history, self.td, self.evidence)

    @property
    def basis(self) -> str:
        """Basis of a choice: "oscillator", "modal", "swings" or "energy"."""
        return self.vibration.basis

    @property
    def energy_td(self) -> float:
        """Energy level at td, from the oscillator if one describes the record [energy]."""
        return self.vibration.whole.energy(self.td)

    @property
    def kinetic_share(self) -> float | None:
        """Kinetic fraction K [-]; None if the basis is "energy" or nothing vibrates."""
        share = self.vibration.kinetic_share
        if share is None or self.at_rest:
            return None
        return share  # The kinetic fraction is NaN if nothing vibrates.

    @property
    def earliest_tr(self) -> float | None:
        """Earliest acceptable tr: the start of the flight plus the margin [time]; None if the start is unknown."""
        start = self.flight.start
        if start is None:
            return None
        return sum_times_as_read(start, self.settings.margin or 0.0)

    @property
    def latest_td(self) -> float:
        """Latest acceptable td: the end of the flight minus the margin [time]; infinite if no contact is recorded."""
        end = self.flight.end
        return float("inf") if end is None else sum_times_as_read(end, -self.margin)

    @cached_property
    def margin(self) -> float:
        """Time kept free before the next contact [time]; 0 if the user gives td but neither a margin nor a landing."""
        if self.settings.margin is None and self.settings.landing is not None:
            return self.expected_margin.time
        return self.settings.margin or 0.0

    @property
    def keeps_nothing_of_flight(self) -> bool:
        """True if the margin after the load and before the contact leaves nothing of the flight."""
        earliest_tr = self.earliest_tr
        if not self.margin or earliest_tr is None:
            return False
        return earliest_tr >= self.latest_td

    @cached_property
    def together(self) -> PartsTogether:
        """Parts that vibrate together in the flight."""
        return PartsTogether(self.history, self.flight)

    @cached_property
    def parts_to_add(self) -> tuple[Part, ...]:
        """Parts that vibrate together with the chosen parts, were not chosen, and can become rigid too.

        Springs and dampers are not among them, because their energy would be left out if they were chosen.
        """
        springs = {part.id for part in self.history.evidence.springs}
        kept = springs.union(self.settings.kept_deformable)
        return tuple(
            part for part in self.together.not_chosen.parts if part.id not in kept
        )

    @cached_property
    def expected_margin(self) -> Margin:
        """Margin for a td that the program chooses: the given margin, or how much earlier the contact may occur."""
        return find_margin(self.history, self.flight, self.settings)

    @cached_property
    def at_rest(self) -> bool:
        """True if there is no vibration in the flight."""
        start = self.earliest_tr
        if start is None or not self.in_flight:
            return False
        window = (start, self.flight.end)
        deformed = self.vibration.unknown is None
        return is_at_rest(self.history, window, self.td, deformed=deformed)

    @cached_property
    def bodies(self) -> Bodies | None:
        """Drift of the rigid bodies that the parts become in the flight; None if no part data exist."""
        return find_drift_of_bodies(self.history, self.flight, self.settings)

    def position_errors(self, times: Samples) -> Samples:
        """Return the position error at td of a body that is frozen at each of ``times`` [length]; NaN if unknown."""
        if self.bodies is None:
            return np.broadcast_to(np.nan, times.shape)
        return self.bodies.errors(times, self.td)

    def errors(self, times: Samples) -> Samples:
        """Return the errors to which the tolerance applies, in the shape of ``times`` [-]; 0 if nothing vibrates."""
        return np.zeros(times.shape) if self.at_rest else self.vibration.errors(times)

    @property
    def most_error(self) -> float:
        """Largest acceptable error of a tr [-]: the tolerance or, for many modes, the limit of the modal model."""
        limit = self.vibration.most_lock_in
        return self.settings.tolerance if limit is None else limit

    @property
    def in_flight(self) -> bool:
        """True if td lies in a known flight and keeps the margin before its end."""
        return (
            self.earliest_tr is not None
            and self.earliest_tr < self.td <= self.latest_td
        )

    def peaks(self, start: float, end: float) -> tuple[float, ...]:
        """Return the ascending times of the energy peaks in (start, end], from the oscillator or the samples."""
        return describe_energy_at(self.history, self.td, self.evidence).peaks(
            start, end
        )

    def sees_as(self, situation: Situation) -> bool:
        """Return True if both situations have the same record, flight and evidence, and differ only in td."""
        return (
            self.evidence.is_that_of(situation.evidence)
            and self.flight == situation.flight
        )

    def at(self, td: float) -> Situation:
        """Return the situation at another ``td`` with the same record, flight and evidence."""
        return self if td == self.td else replace(self, td=td)


def examine_td(
    history: History,
    td: float,
    settings: Settings,
    *,
    quick: bool = False,
) -> Situation:
    """Find the flight around ``td`` and its vibration. Results that many td share are computed once per history.

    ``quick`` should be True for a choice among many td: an oscillator that describes most of the record, including td,
    is then not searched for again, and the misfit of a refused oscillator is not computed.

    Raises
    ------
    RangeError
        If td, ``after`` or the fit window lie outside the record, if the margin is longer than the record, or if the
        record has fewer than 3 states.
    """
    _check_times(history, td, settings)
    seen = find_seen_flight(history, td)
    fitted_at, bounds, is_shown = _choose_search(history, td, seen, settings)
    is_given = settings.oscillator is not None or settings.fit_window is not None
    span: Span | None = None
    fit: Identification | None = None
    if settings.replay:
        search = SpanSearch(
            history, bounds, settings.oscillator, whole=is_shown, quick=quick
        )
        if not (is_shown or is_given):
            search = search._replace(lines=_find_known_lines(search, td))
        span, fit = find_oscillator(search, fitted_at, settings.fit_window)
    described = _skip_first_quarter(history, fit, span)
    quiet: QuietTime | None = None
    if not (is_shown or _covers_most(history, described) or (described and is_given)):
        # The time without loads is needed if only the energy shows a flight, or if no fit covers most of the record.
        quiet = find_quiet_time(history, td)
        if settings.replay:
            modes = _find_modes(history, td, quiet)
            described = _choose_longer_window(described, modes)
    flight = choose_flight(
        history, td, seen, described, quiet, settings.after, settings.landing
    )
    evidence = Evidence(fit, span, settings.oscillator is not None, prescribed=is_given)
    situation = Situation(history, td, settings, flight, evidence)
    if not settings.replay:
        return situation
    models = _find_other_models(situation)
    if not models:
        return situation
    return replace(situation, evidence=evidence._replace(models=models))


def _find_known_lines(search: SpanSearch, td: float) -> KnownLines | None:
    """Return the lines of the modes around td, unless an oscillator describes most of the record or none are found."""
    history = search.history
    if find_longest_described(history, search.bounds, search.whole) is not None:
        return None
    modes = _find_modes(history, td, find_quiet_time(history, td))
    if modes is None:
        return None
    return KnownLines(modes.vibration.reading.spectrum.lines, *modes.span)


def _find_modes(
    history: History, td: float, quiet: QuietTime | None
) -> ModalWindow | None:
    """Find the window around td in which modes continue undisturbed; ``quiet`` is the time without loads."""
    # Imported here to keep start-up fast.
    from d2rpick.vibration.modal_span import find_described

    return find_described(history, td, _get_quiet_window(history, quiet))


class _VibrationSearch(NamedTuple):
    """A search for the vibration around ``td``, within ``bounds`` [time].

    ``is_shown`` is True if the evidence decides whether td is in a flight.
    """

    td: float
    bounds: Span
    is_shown: bool


def _choose_search(
    history: History, td: float, seen: Seen, settings: Settings
) -> _VibrationSearch:
    """Choose where an oscillator is fitted to the energy.

    If td is not in a flight, the oscillator of the nearest flight shows which pairs exist in that flight. If only the
    user states that td is in a flight, the evidence shows at most another flight, whose vibration is a different one.
    """
    is_shown = seen.flight is not None or seen.refusal is not None
    start, end, fitted_at = history.start, history.end, td
    if seen.flight:
        start, end = seen.flight.start, seen.flight.end
    if seen.refusal:
        given = choose_flight(
            history, td, seen, None, None, settings.after, settings.landing
        )
        if given.start is not None and not given.refusal:
            is_shown = False
            start, end = given.start, history.end
        elif seen.flight:
            fitted_at = (start + end) / 2
    bounds = limit_bounds(Span(start, end), fitted_at, settings.after, settings.landing)
    return _VibrationSearch(fitted_at, bounds, is_shown)


def _check_times(history: History, td: float, settings: Settings) -> None:
    """Raise RangeError for a record with fewer than `FEWEST_STATES`, times outside it, and a margin longer than it."""
    if history.time.size < FEWEST_STATES:
        if history.time.size == 1:
            count = "1 state was"
        else:
            count = f"{history.time.size} states were"
        raise RangeError(
            f"{', '.join(history.source)}: {count} found, "
            f"but at least {FEWEST_STATES} were expected; "
            "write the energies more often, or wait until the run has written them"
        )
    history.energy_at(td, "td")
    if settings.after is not None:
        history.check(settings.after, argument="after")
    if settings.landing is not None:
        history.check(settings.landing, argument="landing")
    if settings.margin is not None:
        history.check_length(settings.margin, argument="margin")
    if settings.replay and settings.fit_window:
        history.check(*settings.fit_window, argument="fit_window")


def _find_other_models(situation: Situation) -> dict[str, SignedModel]:
    """Find the vibration models that are needed in addition to the oscillator."""
    flight = situation.flight
    if flight.start is None or not is_doubtful(situation.whole):
        return {}
    history = situation.history
    in_flight = Span(flight.start, flight.end or history.end)
    settled = in_flight
    if flight.settled is not None:
        settled = in_flight._replace(start=flight.settled)
    if flight.source == "energy":
        # Imported here to keep start-up fast.
        from d2rpick.vibration.modal_span import get_inner_window

        # The energy shows a slightly different flight for each td, so modes are fitted in windows that many td share.
        inner = get_inner_window(history, in_flight)
        in_flight = inner if inner.start < situation.td <= inner.end else in_flight
    return find_models(history, in_flight, settled, together=situation.together)


def make_look(
    history: History,
    settings: Settings,
    since: float | None = None,
    *,
    quick: bool = True,
) -> Look:
    """Return a function that examines a record at a td and caches the situation for each td.

    No flight is assumed to begin before ``since`` [time]. ``quick`` has the same meaning as in `examine_td`.
    """
    look = partial(examine_td, history, settings=settings, quick=quick)
    return cache(look if since is None else lambda td: _limit_start(look(td), since))


def _limit_start(situation: Situation, since: float) -> Situation:
    """Return the situation with a flight that begins no earlier than ``since`` [time]."""
    flight = situation.flight
    if flight.start is None or flight.start >= since:
        return situation
    return replace(situation, flight=flight._replace(start=since))


def _get_quiet_window(history: History, quiet: QuietTime | None) -> Span | None:
    """Return the window in which the energy shows no load; without a contact, it lasts until the end of the record."""
    if quiet is None:
        return None
    return Span(quiet.start, history.end if quiet.end is None else quiet.end)


def _covers_most(history: History, described: Described | None) -> bool:
    """Return True if a window covers so much of the record that no modes need to be fitted."""
    if described is None:
        return False
    record = float(history.time[-1] - history.time[0])
    return described.end - described.start >= _MOST_OF_RECORD * record


def _choose_longer_window(
    by_oscillator: Described | None, modes: ModalWindow | None
) -> Described | None:
    """Return the window that an oscillator describes, or a longer window that modes describe; None if there is neither.

    Modes can follow a drifting mean energy, so they describe longer windows than an oscillator, which cannot. Only
    modes that leave hardly anything or only noise may extend beyond the window of an oscillator, because a contact may
    have ended this window.
    """
    if modes is None:
        return by_oscillator
    by_modes = Described(*modes.span, modes.vibration.vibration_energy)
    if by_oscillator is None:
        return by_modes
    is_longer = by_modes.end - by_modes.start > by_oscillator.end - by_oscillator.start
    return by_modes if is_longer and modes.vibration.explains_all else by_oscillator


def _skip_first_quarter(
    history: History, fit: Identification | None, span: Span | None
) -> Described | None:
    """Cut off the first quarter period of an oscillator's window, unless the window begins with the record.

    While the deformation passes through zero, the energy does not show a load that changes the deformation by less than
    10 % of the amplitude; at the largest deformation, it shows changes of 1 %. Each quarter period contains a zero or
    an extremum of the deformation.
    """
    if span is None or fit is None or fit.mode is None:
        return None
    quarter = np.pi / 2 / fit.mode.omega if span.start > history.start else 0.0
    return Described(
        min(span.start + quarter, span.end),
        span.end,
        fit.mode.vibration_energy,
        fit.mode.alpha,
    )
