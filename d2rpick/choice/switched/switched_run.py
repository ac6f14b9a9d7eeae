"""Analyse a switched run: when its parts were rigid, which parts can be compared, and when it landed.

While solids are rigid, some solvers report a sum of energy densities instead of the energy, and some do so even after
td. A frozen deformation does not change, so a part that becomes deformable again should have the same energy as at tr.
If the energy differs by more than the part's largest energy in the reference run, the solver reports a wrong energy,
and the part is ignored.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Final

import numpy as np

from d2rpick.base.errors import (
    Caution,
    RangeError,
    give_if_written,
    list_names,
)
from d2rpick.base.tuples import NamedTuple
from d2rpick.choice.switched.frozen import FEWEST, RIGID_TIMES, find_frozen_times
from d2rpick.flight.internal_energy import round_off
from d2rpick.flight.momentum import find_complete_stretches
from d2rpick.flight.window import LAST_DIGIT
from d2rpick.histories.history import Given, History
from d2rpick.histories.names import Part, Selection
from d2rpick.histories.samples import find_stretches, find_window

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from numpy.typing import NDArray

    from d2rpick.base.spans import Times
    from d2rpick.choice.question import Reference
    from d2rpick.flight.flight import Flight
    from d2rpick.histories.history import Samples
    from d2rpick.histories.run import OpenedRun

# Sources that, unlike the energy alone, determine the start of a flight to within a few states.
_SHARP: Final = ("momentum", "contact-force", "contact-energy", "energy-balance")
# _LEAST_FROZEN: shortest window of frozen energy that shows a rigid part, as a fraction of the record [-].
# _LEAST_SHARE: smallest frozen energy that shows a rigid part, relative to the largest energy of all parts [-].
_LEAST_FROZEN, _LEAST_SHARE = 0.05, 0.01
# A flight that seems to begin up to this many output intervals after tr may have begun before tr.
_SAME_STATES: Final = 3


class DoneWindow(NamedTuple):
    """A window in which a run was switched, the flight around it, and the actual and planned landing times.

    ``landing`` and ``planned`` are None if the respective run shows no contact; ``planned`` is also None if no earlier
    run is given. ``step`` is the output interval [time]; smaller differences of both times are ignored.
    """

    tr: float
    td: float
    flight: Flight | None
    landing: float | None
    planned: float | None
    step: float

    @property
    def landed_rigid(self) -> bool:
        """True if the contact that ends the flight occurred while the parts were rigid."""
        return self.landing is not None and self.landing < self.td

    @property
    def took_off(self) -> float | None:
        """End of the contact in which the parts became rigid [time]; None if the flight began before tr."""
        if (
            self.flight is None
            or self.flight.start is None
            or self.flight.source not in _SHARP
        ):
            return None
        if self.flight.start - self.tr > _SAME_STATES * self.step:
            return self.flight.start
        return None

    @property
    def rigid_in_contact(self) -> bool:
        """True if a contact began or ended while the parts were rigid, so that the plan after it is invalid."""
        return self.landed_rigid or self.took_off is not None

    @property
    def moved(self) -> float | None:
        """Delay of the landing relative to the plan [time]; None if either landing is unknown."""
        if self.landing is None or self.planned is None:
            return None
        return self.landing - self.planned

    @property
    def description(self) -> str:
        """Description, in one sentence, of the outcome of the window for the user."""
        if self.flight is None:
            return "no flight is found there"
        if self.took_off is not None:
            return (
                f"took off at {self.took_off:.6g}, {self.took_off - self.tr:.3g} after tr: the parts were "
                "rigid in the contact"
            )
        if self.landing is None:
            return "no landing is found after it"
        if self.landed_rigid:
            return (
                f"landed at {self.landing:.6g}, {self.td - self.landing:.3g} before td: the parts were "
                "rigid in the contact"
            )
        landed = f"landed at {self.landing:.6g}, {self.landing - self.td:.3g} after td"
        if self.moved is None:
            return landed
        if abs(self.moved) <= self.step:
            return f"{landed}, as planned"
        return f"{landed}, {abs(self.moved):.3g} {'earlier' if self.moved < 0 else 'later'} than planned"


def prepare_switched_history(
    reference: Reference, done: Sequence[Times]
) -> tuple[History, tuple[Times, ...], tuple[Caution, ...]]:
    """Prepare the history of a run with rigid windows for use as a reference run.

    Parameters
    ----------
    reference : Reference
    done : sequence of (float, float)
        Windows (tr, td) in which the run was switched, as far as they are known [time].

    Returns
    -------
    history : History
        History without part momenta if rigid bodies had replaced the parts.
    windows : tuple of (float, float)
        The windows ``done``, and others in which all requested parts were rigid [time].
    cautions : tuple of Caution
        Warnings about further rigid windows, and about parts that were not rigid in ``done``.

    Raises
    ------
    RangeError
        If a window lies outside the record, or the parts were deformable in it.
    """
    history = reference.history
    cautions = list[Caution]()
    for tr, td in done:
        for time in (tr, td):
            history.energy_at(time)
        cautions += _warn_about_deforming(reference, tr, td)
    absent = find_rigid_windows(reference)
    new = []
    for absent_window in absent or _find_frozen_windows(history):
        start, end = absent_window.start, absent_window.end
        if not any(tr < end and start < td for tr, td in done):
            new.append(absent_window)
    cautions += [absent_window.caution for absent_window in new]
    whole_windows = tuple(
        (absent_window.start, absent_window.end)
        for absent_window in new
        if absent_window.whole
    )
    return (
        select_model_momenta(history) if absent else history,
        tuple(sorted((*done, *whole_windows))),
        tuple(cautions),
    )


def select_model_momenta(history: History) -> History:
    """Remove the part momenta from a history, because rigid bodies have replaced parts.

    Energies of rigid solids are meaningless, so only the momentum of the model shows whether the model flies. The part
    momenta remain in the written evidence, for flights in which the parts are deformable.
    """
    whole = tuple(
        replace(momenta, flying=momenta.chosen)
        for momenta in history.momenta
        if momenta.parts is None
    )
    evidence = Given(whole, history.balance, written=history.evidence)
    return replace(history, evidence=evidence)


def find_rigid_times(reference: Reference) -> tuple[Times, ...]:
    """Return the windows in which the output of the parts shows them to be rigid [time]."""
    return tuple((window.start, window.end) for window in find_rigid_windows(reference))


def find_rigid_windows(reference: Reference) -> tuple[RigidWindow, ...]:
    """Return the windows in which the output of the parts shows them to be rigid.

    If there is none, the parts may be rigid throughout the record, as in the restart segment that begins at tr.
    """
    windows = find_absent_windows(reference)
    if windows or not is_rigid_throughout(reference):
        return windows
    history = reference.history
    return (RigidWindow(history.start, history.end, (), whole=True),)


def is_rigid_throughout(reference: Reference) -> bool:
    """Return True if the parts are rigid throughout the record: parts other than springs with energy have no mass."""
    history = reference.history
    run = reference.run
    of_parts = next(
        (momenta for momenta in history.momenta if momenta.parts is not None), None
    )
    whole = next(
        (
            momenta
            for momenta in history.momenta
            if momenta.parts is None and not momenta.velocity
        ),
        None,
    )
    if (
        of_parts is None
        or whole is None
        or of_parts.masses is None
        or find_complete_stretches(of_parts, whole)
    ):
        return False
    energies = give_if_written(lambda: np.abs(run.part_energies(run.parts)).max(axis=0))
    if energies is None:
        return False
    deforms = np.array([part not in run.springs for part in run.parts])
    return bool(((of_parts.masses == 0) & (energies > 0) & deforms).any())


def find_done_windows(
    history: History,
    flights: Sequence[Flight],
    windows: Sequence[Times],
    planned: Sequence[Flight] | None,
) -> tuple[DoneWindow, ...]:
    """Find the actual and the planned landing times of the flights whose windows are complete."""
    done = []
    for tr, td in windows:
        flight = _find_flight_around(history, flights, tr, td)
        planned_flight = _find_flight_around(history, planned or (), tr, td)
        done.append(
            DoneWindow(
                tr,
                td,
                flight,
                flight.end if flight else None,
                planned_flight.end if planned_flight else None,
                history.step,
            )
        )
    return tuple(done)


def _find_flight_around(
    history: History, flights: Sequence[Flight], tr: float, td: float
) -> Flight | None:
    """Return the flight that overlaps a window the longest; None if no flight overlaps it."""

    def shared(flight: Flight) -> float:
        start = history.start if flight.start is None else flight.start
        return min(td, np.inf if flight.end is None else flight.end) - max(tr, start)

    best = max(flights, key=shared, default=None)
    return best if best and shared(best) > 0 else None


def _warn_about_deforming(
    reference: Reference, tr: float, td: float
) -> Iterator[Caution]:
    """Yield a warning that names the requested parts if they deform in a rigid window.

    Raises
    ------
    RangeError
        If no part was rigid according to the files.
    """
    run, history, parts = *reference, _select_deformable(reference)
    rigid = detect_rigid_parts(run, parts, history.time, tr, td)
    if rigid is None:
        return
    if rigid.any():
        names = [
            part.name
            for part, is_rigid in zip(parts, rigid.tolist(), strict=True)
            if not is_rigid
        ]
        if names and history.parts:
            deforming = (
                f"from {tr:.6g} to {td:.6g} these parts deform: {list_names(names)}"
            )
            yield Caution(
                "partly-rigid", f"{deforming}; for the others the window is done"
            )
        return
    if float(np.abs(history.between(tr, td)[1]).max(initial=0.0)) <= round_off(history):
        return  # Parts without internal energy may be in free fall rather than rigid.
    where = f"{', '.join(history.source)}: the parts deform from {tr:.6g} to {td:.6g}"
    raise RangeError(
        f"{where}, a window that `done` names; give the run that was switched in it"
    )


class RigidWindow(NamedTuple):
    """A window [time] in which the ``rigid`` parts have no kinetic energy; empty if only the energy shows the window.

    ``end`` is the time of switching back if a state is written then, else the last rigid state. ``whole`` is True if no
    other part deforms, ``is_frozen`` if the rigid parts keep a deformation.
    """

    start: float
    end: float
    rigid: tuple[Part, ...]
    whole: bool
    is_frozen: bool = True

    @property
    def caution(self) -> Caution:
        """Warning that names the parts that were rigid during the window."""
        when = f"from {self.start:.6g} to {self.end:.6g}"
        if self.whole:
            window_text = f"the parts were rigid {when}, within one output interval; the window is treated as done"
            return Caution(RIGID_TIMES, window_text)
        names = _list_part_names(self.rigid)
        window_text = f"{when} these parts were rigid: {names}; the others deform, so the window is not done"
        return Caution("partly-rigid", window_text)


def find_absent_windows(reference: Reference) -> tuple[RigidWindow, ...]:
    """Return the windows in which parts have no kinetic energy although the model moves."""
    parts = _select_deformable(reference)
    balance = reference.history.balance
    if parts:
        kinetic = give_if_written(lambda: reference.run.part_kinetic_energies(parts))
    else:
        kinetic = None
    if kinetic is None or balance is None or balance.kinetic is None:
        return ()
    time = reference.history.time
    rounding = round_off(reference.history)
    moves = np.interp(time, balance.time, balance.kinetic) > rounding
    gone = ((kinetic == 0) & kinetic.any(axis=0)).any(axis=1)
    energies = reference.run.part_energies(parts)
    windows = []
    for moving in find_stretches(gone & moves, FEWEST):
        states = slice(_find_first_still_state(gone, moves, moving.start), moving.stop)
        start, end = time[states][[0, -1]].tolist()
        rigid = detect_rigid_parts(reference.run, parts, time, start, end)
        rigid = (kinetic[states] == 0).all(axis=0) if rigid is None else rigid
        rigid_parts = tuple(
            part
            for part, is_rigid in zip(parts, rigid.tolist(), strict=True)
            if is_rigid
        )
        deform = ~rigid & (np.ptp(energies[states], axis=0) > rounding)
        is_frozen = bool(energies[states][:, rigid].max(initial=0.0) > rounding)
        whole = not deform.any()
        if _is_still_frozen(energies[:, rigid], states.stop, rounding):
            end = float(time[states.stop])
        windows.append(RigidWindow(start, end, rigid_parts, whole, is_frozen))
    return tuple(windows)


def _is_still_frozen(energies: Samples, state: int, rounding: float) -> bool:
    """Return True if the first state after a rigid window shows the frozen energies, because it is written at td.

    Some solvers report a wrong energy of rigid solids, so one deformed part with the same energy is enough. If no part
    is deformed, nothing vibrates after td either. ``energies`` (n, parts) are those of the rigid parts [energy].
    """
    if state >= len(energies):
        return False
    frozen = energies[state - 1]
    is_deformed = np.abs(frozen) > rounding
    is_same = np.abs(energies[state] - frozen) <= LAST_DIGIT * np.abs(frozen)
    return not is_deformed.any() or bool((is_same & is_deformed).any())


def _find_first_still_state(
    gone: NDArray[np.bool_], moves: NDArray[np.bool_], first: int
) -> int:
    """Return the first of the states before ``first`` in which the model rests, so that a rigid part cannot be seen.

    A run that begins at rest with rigid parts is rigid from its first state. ``gone`` (n,) is True if parts have no
    kinetic energy, ``moves`` (n,) if the model has.
    """
    others = np.flatnonzero(~gone[:first] | moves[:first])
    return int(others.max(initial=-1)) + 1


def refuse_partly_rigid(
    reference: Reference, start: float | None, td: float
) -> tuple[RigidWindow, ...]:
    """Raise RangeError if some of the chosen parts were rigid at some time from the start of the flight to td [time].

    It is also raised if the parts were rigid throughout the record. The result is all rigid windows of the run.

    Parts that rest have no kinetic energy either, but no frozen deformation. If ``start`` is unknown, the test begins
    at the start of the record.
    """
    earliest = reference.history.start if start is None else start
    windows = find_absent_windows(reference)
    if not windows and is_rigid_throughout(reference):
        raise RangeError(
            f"{', '.join(reference.history.source)}: this is a switched run, whose parts are rigid throughout the "
            "record; choose times from the reference run, and compare this one with it (d2rpick verify)"
        )
    for window in windows:
        overlaps = window.end > earliest and window.start < td
        if overlaps and window.is_frozen and not window.whole:
            span = f"from {window.start:.6g} to {window.end:.6g}"
            source = ", ".join(reference.history.source)
            names = _list_part_names(window.rigid)
            raise RangeError(
                f"{source}: this is a switched run: these parts were rigid {span}: {names}; choose times from "
                "the reference run, and compare this one with it (d2rpick verify)"
            )
    return windows


def warn_about_switched_run(
    reference: Reference, windows: Sequence[RigidWindow], td: float
) -> Iterator[Caution]:
    """Yield a warning if the record up to td [time] is that of a switched run, whose reference run is needed.

    ``windows`` are the windows in which parts have no kinetic energy. Solvers that write this energy show a rigid part
    by its frozen internal energy alone.
    """
    rigid = [
        (window.start, window.end, window.rigid)
        for window in windows
        if window.is_frozen and window.start < td
    ] or [window for window in _find_frozen_parts(reference) if window[0] < td]
    if not rigid:
        return
    spans = list_names(
        [
            f"{_list_part_names(parts)} from {start:.6g} to {end:.6g}"
            for start, end, parts in rigid
        ]
    )
    yield Caution(
        RIGID_TIMES,
        f"this is a switched run, with these rigid parts: {spans}; choose times from the reference run, or plan the "
        "later windows with d2rpick plan",
    )


def _find_frozen_parts(
    reference: Reference,
) -> Iterator[tuple[float, float, tuple[Part, ...]]]:
    """Yield the windows in which the energy of a single one of several chosen parts is frozen [time], with this part.

    A short window, or that of a part with little energy, may be a coincidence of printed digits.
    """
    parts = _select_deformable(reference)
    history = reference.history
    energies = reference.run.part_energies(parts)
    least = _LEAST_SHARE * float(energies.sum(axis=1).max())
    for part, energy in zip(parts, energies.T, strict=True):
        if energy.max() < least:
            continue
        of_part = replace(history, energy=energy)
        for start, end in find_frozen_times(of_part):
            level = float(np.interp(start, history.time, energy))
            if end - start >= _LEAST_FROZEN * history.duration and level >= least:
                yield start, end, (part,)


def _find_frozen_windows(history: History) -> Iterator[RigidWindow]:
    """Yield the windows in which the energy shows that the chosen parts were rigid."""
    for start, end in find_frozen_times(history):
        yield RigidWindow(start, end, (), whole=True)


def _select_deformable(
    reference: Reference, among: Sequence[Part] | None = None
) -> tuple[Part, ...]:
    """Return the chosen parts (by default all) with internal energy; ``among`` restricts the choice."""
    run, history = reference
    ids = {part.id for part in run.parts if among is None} | {
        part.id for part in among or ()
    }
    parts = [part for part in history.parts or run.parts if part.id in ids]
    if not parts:
        return ()
    energies = run.part_energies(parts)
    if len(energies) != history.time.size:
        return ()
    return tuple(
        part for part, energy in zip(parts, energies.T, strict=True) if energy.any()
    )


def detect_rigid_parts(
    run: OpenedRun, parts: Sequence[Part], time: Samples, tr: float, td: float
) -> NDArray[np.bool_] | None:
    """Return True for each part that was rigid from tr to td, shape (parts,); None if there are too few states.

    ``time`` (n,) contains the times at which the states of the parts are written [time].
    """
    inside = find_window(time, np.nextafter(tr, td), np.nextafter(td, tr))
    # The solver switches at the first step after tr, so the first state is skipped.
    inside = slice(inside.start + 1, max(inside.start + 1, inside.stop - 1))
    if not parts or len(time[inside]) < FEWEST:
        return None
    energies = run.part_energies(parts)[inside]
    kinetic = give_if_written(lambda: run.part_kinetic_energies(parts))
    still = np.ptp(energies, axis=0) <= LAST_DIGIT * np.abs(energies).max(axis=0)
    if kinetic is not None:
        absent = (kinetic[inside] == 0).all(axis=0)
    else:
        absent = np.zeros(len(parts), dtype=bool)
    return np.asarray(still | absent)


class SameParts(NamedTuple):
    """Energies of the same parts in both runs, with objections and notes about the other parts.

    ``misreported`` contains the names of the parts for which the solver reports a wrong energy after td;
    ``is_reported`` is False if these are all parts.
    """

    reference: History
    switched: History
    objections: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    is_reported: bool = True
    misreported: tuple[str, ...] = ()


def choose_same_parts(
    without: Reference, switched: Reference, pair: Times
) -> SameParts:
    """Choose the parts for the comparison of a finished switched run with its reference run.

    Parameters
    ----------
    without, switched : Reference
        The reference run and the switched run, with the energies of the parts to be switched or of the whole model.
    pair : (float, float)
        tr and td [time].

    Returns
    -------
    SameParts
        The rigid parts if only some parts of the model were rigid, otherwise all parts; parts with wrong energies are
        excluded.
    """
    as_read = SameParts(without.history, switched.history)
    # The result is None if a quantity of a part is missing in some states.
    same_parts = give_if_written(
        lambda: _choose_compared_parts(without, switched, pair)
    )
    return same_parts or as_read


def _choose_compared_parts(
    without: Reference, switched: Reference, pair: Times
) -> SameParts | None:
    """Choose the parts to compare, with objections and notes; None if no part can be compared."""
    parts = _select_deformable(without, switched.run.parts)
    if not parts:
        return None
    history = without.history
    rigid = detect_rigid_parts(switched.run, parts, switched.run.part_time, *pair)
    only_some_rigid = rigid is not None and bool(rigid.any()) and not rigid.all()
    objections = list[str]()
    notes = list[str]()
    chosen = parts
    if only_some_rigid and rigid is not None:
        still = tuple(
            part
            for part, is_rigid in zip(parts, rigid.tolist(), strict=True)
            if is_rigid
        )
        if history.parts is None:
            chosen = still
            notes.append(
                f"judged by the parts that were rigid: {_list_part_names(still)}"
            )
        else:
            deforming = _find_deforming(switched, parts, pair, ~rigid)
            if deforming:
                names = _list_part_names(deforming)
                objections.append(
                    f"not rigid from tr {pair[0]:g} to td {pair[1]:g} in the switched run: {names}"
                )
    misreported = _find_misreported(without, switched.run, chosen, pair)
    if not misreported and chosen is parts:
        return SameParts(history, switched.history, tuple(objections))
    comparable = tuple(part for part in chosen if part not in misreported)
    if comparable and misreported:
        left_out = f"left out of the comparison: {_list_part_names(misreported)}"
        notes.append(
            f"{left_out}, whose energy is wrong after td, as some solvers report it for solids that were rigid"
        )
    selection = Selection(
        parts=tuple(str(part.id) for part in comparable or chosen),
        springs=tuple(str(part.id) for part in history.springs),
    )
    energies = without.run.history(selection), switched.run.history(selection)
    return SameParts(
        *energies,
        tuple(objections),
        tuple(notes),
        is_reported=bool(comparable),
        misreported=tuple(part.name for part in misreported),
    )


def _find_deforming(
    switched: Reference,
    parts: tuple[Part, ...],
    pair: Times,
    is_moving: NDArray[np.bool_],
) -> tuple[Part, ...]:
    """Return the moving parts whose energy changes between tr and td by more than round-off."""
    inside = find_window(switched.run.part_time, *pair)
    changes = np.ptp(switched.run.part_energies(parts)[inside], axis=0)
    deforms = is_moving & (changes > round_off(switched.history))
    return tuple(
        part
        for part, is_deforming in zip(parts, deforms.tolist(), strict=True)
        if is_deforming
    )


def _find_misreported(
    without: Reference, switched: OpenedRun, parts: tuple[Part, ...], pair: Times
) -> tuple[Part, ...]:
    """Return the parts whose energies after td and at tr differ by more than is physically possible."""
    time = switched.part_time
    energies = switched.part_energies(parts)
    # In the first state at or after td, the parts may still be rigid.
    first = int(np.searchsorted(time, pair[1])) + 1
    last = int(np.searchsorted(time, pair[0], side="right")) - 1
    if last < 0 or first >= time.size:
        return ()
    largest = np.abs(without.run.part_energies(parts)).max(axis=0)
    is_misreported = np.abs(energies[first] - energies[last]) > np.maximum(
        largest, round_off(without.history)
    )
    return tuple(
        part
        for part, misreported in zip(parts, is_misreported.tolist(), strict=True)
        if misreported
    )


def _list_part_names(parts: Iterable[Part]) -> str:
    """Return part names as a list for use in a sentence."""
    return list_names([part.name for part in parts])
