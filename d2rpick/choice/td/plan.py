"""Plan the rigid windows of a run: find times for each flight, and the windows that need no further reference run.

A window in which nothing vibrates freezes no vibration energy and does not shift any landing. A window that freezes
energy shifts the next landing by less than the margin, and later landings by more than any margin. Therefore one
reference run supports all windows up to and including the first one that freezes energy. Later windows are planned from
the run that is switched in these windows (docs/explanation/planning.md, "Why you cannot use all windows of one run").

Each window that freezes energy requires a further run, so a short window is left out in favour of a longer later one.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Final

import numpy as np

from d2rpick.base.data_classes import dataclass
from d2rpick.base.errors import Caution
from d2rpick.base.tuples import NamedTuple
from d2rpick.choice.answers import suggest_in_run
from d2rpick.choice.health import WRONG_ENERGY, refuse_unsound, warn_about_engine
from d2rpick.choice.pair.warnings import LANDING_NOT_SHOWN
from d2rpick.choice.parts.margins import find_margin
from d2rpick.choice.switched.frozen import RIGID_TIMES
from d2rpick.choice.switched.switched_run import (
    DoneWindow,
    find_done_windows,
    prepare_switched_history,
    refuse_partly_rigid,
)
from d2rpick.choice.td.flights import (
    MIN_RIGID,
    compute_last_td,
    find_flights,
    refuse_landing_before_flights,
)
from d2rpick.flight.internal_energy import round_off

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from d2rpick.base.spans import Times
    from d2rpick.choice.answers import PairSuggestion
    from d2rpick.choice.pair.candidates import Candidate, Pair
    from d2rpick.choice.pair.decision import Decision
    from d2rpick.choice.pair.quality import Quality
    from d2rpick.choice.question import Reference, Settings
    from d2rpick.flight.flight import Flight
    from d2rpick.flight.margin import Margin
    from d2rpick.histories.history import History

# An earlier window is left out if a later window is more than this many times as long [-].
# If windows of lengths w and W (the later one) are both used, two successive runs are rigid for w and w + W.
# If only the later window is used, both runs are rigid for W, which is more in total if W > 2 w.
_LONGER: Final = 2.0
# The reason for leaving out a flight that is too short for a window begins with these words.
TOO_SHORT: Final = "too short"


class PlannedFlight(NamedTuple):
    """One flight of a run and its rigid window, with times in the unit of the history.

    ``status`` is "supported" (by this reference run), "re-plan" (to be planned from a switched run), "done", or
    "left-out"; ``reason`` explains every status except "supported". ``answer`` is the suggestion for this flight; None
    if there is none. ``done`` describes the result of a window that is done; ``record`` is the length of the record
    [time].
    """

    number: int
    flight: Flight
    start: float
    end: float
    margin: Margin
    record: float
    status: str
    reason: str | None = None
    answer: PairSuggestion | None = None
    done: DoneWindow | None = None

    @property
    def window(self) -> Times | None:
        """Window in which the parts are rigid, (tr, td) [time]; None if nothing can be recommended."""
        if self.done:
            return self.done.tr, self.done.td
        if self.answer and self.status in ("supported", "re-plan"):
            pair = self.answer.recommended
        else:
            pair = None
        return (pair.tr, pair.td) if pair else None

    @property
    def is_within_given_margin(self) -> bool:
        """True if the margin given by the user leaves nothing of the flight."""
        is_given = self.margin.source == "given"
        return is_given and self.end - self.margin.time <= self.start

    @property
    def rigid_time(self) -> float | None:
        """Length of the window [time]; None if there is no window."""
        return self.window[1] - self.window[0] if self.window else None

    @property
    def rigid_fraction(self) -> float | None:
        """Fraction of the record for which the window makes the parts rigid [-]; None if there is no window."""
        return None if self.rigid_time is None else self.rigid_time / self.record

    @property
    def candidate(self) -> Candidate | None:
        """The recommended tr with its measures; None if there is no window."""
        return self.answer.chosen if self.answer and self.window else None

    @property
    def decision(self) -> Decision | None:
        """Verdict on the pair as in ``suggest``; None if there is no pair or a finished run has used the window."""
        return self.answer.decision if self.answer else None

    @property
    def quality(self) -> Quality | None:
        """Grade of the pair as in ``suggest``; None if there is no window or a finished run has used it."""
        return self.answer.quality if self.answer and self.window else None

    @property
    def locks_in(self) -> bool | None:
        """True if the window locks in energy, which shifts later landings; None if there is no window.

        The window freezes no vibration energy if the energy is constant within round-off, as in a free fall from rest.
        """
        if self.answer is None or self.window is None:
            return None
        history = self.answer.situation.history
        _, energy = history.between(self.start, self.window[1])
        return float(np.ptp(energy)) > round_off(history)


@dataclass(frozen=True)
class RunPlan:
    """The answer of ``plan``: all flights in time order, and warnings.

    Windows shorter than ``min_rigid`` are left out [time]. ``done`` contains the windows in which the run was switched.
    ``fewest_cycles`` is the smallest number of cycles of the written run, if one upper limit of the time step applies
    throughout the run, as with sensors.
    """

    history: History
    settings: Settings
    min_rigid: float
    flights: tuple[PlannedFlight, ...]
    cautions: tuple[Caution, ...]
    done: tuple[Times, ...] = ()
    fewest_cycles: int | None = None

    @property
    def supported(self) -> tuple[PlannedFlight, ...]:
        """Flights with a window that can be used without a further reference run."""
        return tuple(row for row in self.flights if row.status == "supported")

    @property
    def windows(self) -> tuple[Times, ...]:
        """Pairs (tr, td) of the windows that can be used without a further reference run [time]."""
        return tuple(row.window for row in self.supported if row.window)

    @property
    def all_windows(self) -> tuple[Times, ...]:
        """Pairs (tr, td) of all windows not yet computed, including those that require a switched run first [time]."""
        return tuple(
            row.window
            for row in self.flights
            if row.status in ("supported", "re-plan") and row.window
        )

    @property
    def next_run(self) -> tuple[Times, ...]:
        """Pairs (tr, td) of the next run's windows, including those already used [time]; empty if no window is new.

        The next run starts again from time zero, so it needs both the earlier and the new windows.
        """
        return (*self.done, *self.windows) if self.windows else ()

    @property
    def rigid_time(self) -> float:
        """Total length of the windows that can be used without a further reference run [time]."""
        return sum(row.rigid_time or 0.0 for row in self.supported)

    @property
    def rigid_fraction(self) -> float:
        """Fraction of the record covered by windows that can be used without a further reference run [-]."""
        return self.rigid_time / self.history.duration

    @property
    def run_time_share(self) -> float | None:
        """Expected run time with the windows, relative to the reference run [-]; None if no cost fraction is known."""
        return self.settings.run_time_share(self.rigid_fraction)


def plan_run(
    reference: Reference,
    settings: Settings,
    *,
    min_rigid: float | None = None,
    done: Sequence[Times] = (),
    before: Reference | None = None,
) -> RunPlan:
    """Plan the rigid windows of a run.

    Parameters
    ----------
    reference : Reference
        The run, which must not be switched outside the windows ``done``.
    settings : Settings
        Settings as for ``suggest``. ``after`` applies to the flight that contains this time; earlier flights are left
        out.
    min_rigid : float, optional
        Shorter windows are left out [time]. The default is 5 % of the record; a window that freezes energy is then also
        left out if a later one is rigid for more than twice as long.
    done : sequence of (float, float)
        Windows in which the run was switched, in order [time].
    before : Reference, optional
        The run from which these windows were planned; its landings show by how much those of this run have shifted.

    Returns
    -------
    Plan

    Raises
    ------
    RangeError
        If ``after`` or a window lies outside the record, if the margin is longer than the record, if ``landing`` lies
        before all flights, or if the parts were deformable in a done window.
    """
    history = reference.history
    refuse_unsound(history, settings)
    span = history.duration
    shortest = MIN_RIGID * span if min_rigid is None else min_rigid
    history, done_times, cautions = prepare_switched_history(reference, done)
    reference = reference._replace(history=history)
    flights = find_flights(history, settings)
    refuse_landing_before_flights(history, flights, settings)
    # The earlier run may be a switched run, too.
    earlier = before and find_flights(prepare_switched_history(before, ())[0], settings)
    done_rows = find_done_windows(history, flights, done_times, earlier)
    judged: Iterable[PlannedFlight] = _list_rows(
        reference, flights, settings, shortest, done_rows
    )
    if min_rigid is None:
        judged = _leave_out_short(list(judged))
    rows = tuple(_mark_status(list(judged), done_rows))
    if not done_times:
        cautions = (*cautions, *_warn_about_switched_run(rows))
    cautions = (
        *cautions,
        *warn_about_engine(reference.run.sources),
        *_warn_about_windows(rows, done_rows),
    )
    return RunPlan(history, settings, shortest, rows, cautions, done_times)


def _list_rows(
    reference: Reference,
    flights: Sequence[Flight],
    settings: Settings,
    shortest: float,
    done_rows: Sequence[DoneWindow],
) -> Iterator[PlannedFlight]:
    """Yield every flight with its window, which is planned as if it were the first window of the run."""
    last = max((done.td for done in done_rows), default=None)
    record = reference.history.duration
    landed: float | None = None  # End of the previous flight [time].
    for number, found_flight in enumerate(flights, start=1):
        flight = _apply_given_start(reference.history, found_flight, settings.after)
        start, end = flight.within(reference.history.time)
        margin = find_margin(reference.history, flight, settings)
        row = PlannedFlight(number, flight, start, end, margin, record, "left-out")
        done_in_flight = [done for done in done_rows if done.flight == found_flight]
        if done_in_flight:
            for done in done_in_flight:
                yield row._replace(status="done", reason=done.description, done=done)
        elif last is not None and start < last:
            yield row._replace(reason="before the last window that the run has done")
        elif settings.after is not None and end <= settings.after:
            yield row._replace(
                reason=f"before the end of the load at {settings.after:.6g} (`after`)"
            )
        elif end - margin.time - start < shortest:
            yield row._replace(
                reason=_explain_short_window(
                    end - margin.time - start, shortest, margin
                )
            )
        else:
            yield _suggest_window(reference, row, settings, shortest, landed)
        landed = flight.end


def _apply_given_start(
    history: History, flight: Flight, load_end: float | None
) -> Flight:
    """Let the flight that contains the given end of the load begin at that time, as ``suggest`` does."""
    start, end = flight.within(history.time)
    if load_end is None or not start <= load_end < end:
        return flight
    return flight._replace(start=load_end, source="given")


def _suggest_window(
    reference: Reference,
    row: PlannedFlight,
    settings: Settings,
    shortest: float,
    landed: float | None,
) -> PlannedFlight:
    """Complete a row of the plan with the window suggested for a flight that starts after the previous landing.

    If only the energy shows the flight, its start depends on td, and an oscillator is found for some td but not for
    others. Therefore the row contains the flight that belongs to the chosen td.
    """
    is_after_here = (
        settings.after is not None and row.start <= settings.after <= row.end
    )
    flight_settings = settings if is_after_here else replace(settings, after=None)
    if settings.landing is not None and not row.start < settings.landing <= row.end:
        flight_settings = replace(flight_settings, landing=None)
    # The energy alone may not show the end of the flight, so the margin is kept before the listed end.
    window = row.start, compute_last_td(row.end, row.margin.time)
    reference.history.check(*window, subject=f"flight {row.number},")
    refuse_partly_rigid(reference, *window)
    answer = suggest_in_run(reference, window, flight_settings, since=landed)
    known_flight = answer.situation.flight
    row = row._replace(answer=answer)
    if known_flight.start is not None and (
        known_flight.start < row.start or answer.recommended
    ):
        flight = row.flight._replace(
            start=known_flight.start, source=known_flight.source
        )
        row = row._replace(flight=flight, start=known_flight.start)
    if answer.recommended is None:
        return row._replace(reason=answer.why_none)
    if answer.recommended.rigid_time < shortest:
        return row._replace(
            reason=_explain_short_window(
                answer.recommended.rigid_time, shortest, row.margin
            )
        )
    if answer.decision and not answer.decision.reaches(settings.min_quality):
        return row._replace(reason=_explain_grade(answer.decision, answer.recommended))
    return row._replace(status="supported")


def _explain_grade(decision: Decision, pair: Pair) -> str:
    """Explain why a pair is too poor for a planned window, and how to plan the window anyway."""
    times = f"tr = {pair.tr:.6g}, td = {pair.td:.6g}"
    advice = f"with `min_quality` {decision.grade} it is planned nevertheless"
    return f"{decision.verdict} {times}: {decision.reason}. To improve: {decision.cure}; {advice}"


def _explain_short_window(rigid: float, shortest: float, margin: Margin) -> str:
    """Explain that a window is too short."""
    if np.isinf(margin.time):
        return (
            f"{TOO_SHORT}: a switch may shift the landing by more than the duration of the flight, so no margin before "
            "the contact is long enough; a given margin (`margin`) is used as it is"
        )
    if margin.source == "given" and rigid <= 0.0:
        return (
            f"{TOO_SHORT}: the margin {margin.time:.6g} before the contact leaves nothing of the flight; give a "
            "smaller `margin`"
        )
    if margin.time:
        margin_text = f", with the margin {margin.time:.3g} before the contact"
    else:
        margin_text = ""
    return (
        f"{TOO_SHORT}: rigid for {max(rigid, 0.0):.3g}{margin_text}; the shortest window allowed is "
        f"{shortest:.3g} (`min_rigid`)"
    )


def _leave_out_short(rows: Sequence[PlannedFlight]) -> Iterator[PlannedFlight]:
    """Leave out each window that locks in energy if a much longer window follows it that would need a further run."""
    for index, row in enumerate(rows):
        rigid = row.rigid_time or 0.0
        longest_after = max(
            rows[index + 1 :],
            key=lambda row_after: row_after.rigid_time or 0.0,
            default=row,
        )
        if (
            row.status != "supported"
            or not row.locks_in
            or not (longest_after.rigid_time or 0.0) > _LONGER * rigid
        ):
            yield row
            continue
        tr, td = row.window or (0.0, 0.0)
        longer = (
            f"flight {longest_after.number} after it for {longest_after.rigid_time:.3g}"
        )
        window_text = f"rigid for {rigid:.3g} from {tr:.6g} to {td:.6g}, {longer}"
        why = (
            "this window freezes vibration energy and shifts the later landings, so that flight would "
            "need a further run"
        )
        cure = f"with `min_rigid` below {rigid:.6g} this window is planned too"
        yield row._replace(status="left-out", reason=f"{window_text}: {why}; {cure}")


def _mark_status(
    rows: Sequence[PlannedFlight], done_rows: Sequence[DoneWindow]
) -> Iterator[PlannedFlight]:
    """Mark the windows to be planned again: all after the first that locks in energy or has a contact while rigid."""
    in_contact = next((done for done in done_rows if done.rigid_in_contact), None)
    why = ""
    if in_contact:
        window = f"the window {in_contact.tr:.6g} to {in_contact.td:.6g}"
        why = f"the run was rigid in a contact in {window}; plan the windows from there on again"
    for row in rows:
        if row.status == "supported" and why:
            yield row._replace(status="re-plan", reason=why)
            continue
        yield row
        if row.status == "supported" and row.locks_in and row.window:
            tr, td = row.window
            moved = f"switching from {tr:.6g} to {td:.6g} freezes vibration energy and shifts the later landings"
            why = f"{moved}; plan this flight from a run with that switch"


def _warn_about_blocked(rows: Sequence[PlannedFlight]) -> Iterator[Caution]:
    """Yield a warning if a short window prevents this run from supporting a longer window."""
    first = next(
        (row for row in rows if row.status == "supported" and row.locks_in), None
    )
    longest = max(
        (row for row in rows if row.status == "re-plan"),
        key=lambda row: row.rigid_time or 0,
        default=None,
    )
    if (
        first
        and longest
        and first.rigid_time
        and longest.rigid_time
        and longest.rigid_time > first.rigid_time
    ):
        text = f"flight {longest.number} is rigid for {longest.rigid_time:.3g}, flight {first.number} before it for"
        cure = "to plan the longer one instead, give a `min_rigid` between the two"
        yield Caution("longer-window-later", f"{text} {first.rigid_time:.3g}: {cure}")


def _warn_about_switched_run(rows: Sequence[PlannedFlight]) -> Iterator[Caution]:
    """Yield the warning that the record is that of a switched run, once for all flights."""
    warnings = (
        caution
        for row in rows
        for caution in (row.answer.cautions if row.answer else ())
        if caution.code == RIGID_TIMES
    )
    first = next(warnings, None)
    if first is not None:
        yield first


def _warn_about_windows(
    rows: Sequence[PlannedFlight], done_rows: Sequence[DoneWindow]
) -> Iterator[Caution]:
    """Yield the warnings about the windows, each only once."""
    for done in done_rows:
        window = f"the window {done.tr:.6g} to {done.td:.6g}: {done.description}"
        if done.rigid_in_contact:
            yield Caution("landed-rigid", window)
        elif done.flight is None:
            yield Caution("done-without-flight", window)
    for row in rows:
        for caution in row.answer.cautions if row.answer else ():
            # The first warning concerns the given landing, with or without a window before it; the others concern
            # the whole run, not a single flight.
            is_told = row.status == "supported" or caution.code == LANDING_NOT_SHOWN
            if not is_told or caution.code in (WRONG_ENERGY, RIGID_TIMES):
                continue
            which = f"flight {row.number}: " if len(rows) > 1 else ""
            yield caution._replace(message=which + caution.message)
    yield from _warn_about_blocked(rows)
    if not rows:
        yield Caution("no-flight", "no flight is found in the record")
