"""Compare a finished switched run with its reference run: locked-in energy, energy at td, and motion.

Between tr and td, only the energy is compared, because no kinetic energy or momentum is written for a rigid part.
"""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from d2rpick.base.errors import RangeError
from d2rpick.choice.switched.frozen import FEWEST, compute_energy_range
from d2rpick.choice.switched.same_model import (
    MOST_MOMENTUM_ERROR,
    check_before_window,
    check_same_model,
    explain_difference,
)
from d2rpick.choice.switched.switch_times import SwitchedWindows
from d2rpick.choice.switched.switched_run import choose_same_parts
from d2rpick.flight.internal_energy import round_off
from d2rpick.flight.window import LAST_DIGIT
from d2rpick.vibration import measures

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from d2rpick.base.spans import Times
    from d2rpick.choice.pair.situation import Situation
    from d2rpick.choice.question import Reference
    from d2rpick.histories.history import History, Samples, Track
    from d2rpick.histories.names import Part
    from d2rpick.histories.run import OpenedRun


# Smallest divisor of deviations, as a fraction of the largest momentum [-]; it is needed because a body may rest.
_AT_REST = 0.01
# A note is issued if the energy while rigid differs from the energy at td by more than this fraction [-].
# The energies can differ because some solvers report a wrong energy for rigid solid elements.
_REPORTED_OFF = 0.01
# _STILL: relative changes of an energy up to this are treated as zero [-].
# _STILL_OF_VIBRATION: changes of an energy up to this fraction of the vibration energy are treated as zero [-].
_STILL, _STILL_OF_VIBRATION = 1e-4, 1e-2
# Relative tolerance for the energy near tr [-], because the solver may switch a state or two after the output.
_ABOUT = 0.05
# Number of output intervals by which a finished run may end before the time that it should reach.
_STATES_AT_END: Final = 2
# Number of states before a rigid window in which the runs are compared if there are earlier windows.
_STATES_BEFORE: Final = 2 * FEWEST
# The windows of a switched run of which only the energy is known.
_UNKNOWN_WINDOWS: Final = SwitchedWindows(None)


class Comparison(NamedTuple):
    """Differences between a switched run and its reference run; unknown quantities are None.

    The fields are the keys of the JSON output, except the last six: ``min_mean`` is the smallest expected ratio of
    the means [-], ``has_energy`` is False if the energies after td are not compared, because they are only round-off or
    all wrong, ``misreported`` contains the names of the parts for which the solver reports a wrong energy after td,
    ``is_of_other_run`` is True if the runs differ although neither was rigid yet, ``is_of_other_times`` is True if the
    switched run was rigid in another window, and ``is_incomplete`` is True if the only objection is that the switched
    run ended too early or with an error.

    ``energy_frozen`` is the energy of the switched run at td, ``energy_td`` that of the reference run. ``rigid_from``
    and ``rigid_to`` are the first and last states of the window around the middle of (tr, td) in which the energy of
    the switched run is constant [time]; None if there is no such window. Means and spreads (standard deviations) refer
    to the time from td to ``end``, as do the next two fields, which ignore the first state. ``momentum_error`` is the
    largest deviation of the momentum, relative to the largest momentum of the reference run, and ``displacement`` the
    largest distance between the centres of the parts in both runs [length]. ``notes`` lists anomalies of the switched
    run, and what was omitted or assumed when reading the switched run but not the reference run. ``other_windows`` are
    the further windows (tr, td) in which the switched run was rigid [time]. The energies of the switched run are None
    if the solver reports wrong energies of all compared parts.
    """

    source: tuple[str, ...]
    energy_frozen: float | None
    energy_td: float
    level_ratio: float | None
    end: float
    mean_after: float | None
    mean_after_reference: float
    spread_after: float | None
    spread_after_reference: float
    momentum_error: float | None
    displacement: float | None
    rigid_from: float | None
    rigid_to: float | None
    objections: tuple[str, ...]
    notes: tuple[str, ...]
    other_windows: tuple[Times, ...] = ()
    min_mean: float = 0.0
    has_energy: bool = True
    misreported: tuple[str, ...] = ()
    is_of_other_run: bool = False
    is_of_other_times: bool = False
    is_incomplete: bool = False


def compare_with_reference(
    situation: Situation,
    tr: float,
    reference: Reference,
    switched: Reference,
    windows: SwitchedWindows,
    min_mean: float = 0.0,
) -> Comparison:
    """Compare a finished switched run with its reference run by the parts that both runs contain.

    Both runs are read in the same way. ``situation`` is that at td in the reference run; see ``compare_runs`` for
    ``windows`` and ``min_mean``.

    Raises
    ------
    RangeError
        If one of the two runs does not continue after td.
    """
    flight = situation.flight
    parts = situation.history.parts
    run = reference.run
    together = flight.parts if flight.source == "momentum" else flight.parts or parts
    pair = tr, situation.td
    judged = choose_same_parts(reference, switched, pair)
    end = min((window.tr for window in windows.later), default=np.inf)
    if situation.latest_td > situation.td:
        end = min(end, situation.latest_td)
    centres: tuple[Track | None, Track | None] = (None, None)
    if parts:
        centres = (run.centre(parts), switched.run.centre(parts))
    comparison = compare_runs(
        judged.reference,
        judged.switched,
        pair,
        end,
        situation.settings.tolerance,
        momenta=(run.momentum(together), _read_momentum(switched.run, together)),
        centres=centres,
        is_reported=judged.is_reported,
        min_mean=min_mean,
        windows=windows,
        explain=partial(explain_difference, run, switched.run),
    )
    others = (*windows.earlier, *windows.later)
    objections = (*judged.objections, *comparison.objections)
    if comparison.is_of_other_run:
        objections = (*comparison.objections, *judged.objections)
    early_end = explain_early_end(
        switched, reference, _find_expected_end(situation, windows)
    )
    return comparison._replace(
        objections=(*objections, *early_end),
        is_incomplete=bool(early_end) and not objections,
        notes=(*judged.notes, *comparison.notes),
        other_windows=tuple((window.tr, window.td) for window in others),
        misreported=judged.misreported,
    )


def _find_expected_end(
    situation: Situation, windows: SwitchedWindows
) -> tuple[float, str]:
    """Return the time [time] that a switched run should reach, and its name: the next rigid window or contact."""
    later = min((window.tr for window in windows.later), default=np.inf)
    contact = situation.flight.end
    if contact is None or contact <= situation.td:
        contact = np.inf
    if later < contact:
        return later, "the next rigid window"
    return contact, "the next contact"


def explain_early_end(
    switched: Reference, reference: Reference, expected: tuple[float, str]
) -> tuple[str, ...]:
    """Return the objection to a switched run that ended too early or with an error; empty if there is none.

    ``expected`` is the time that the run should reach [time], and the name of this time; infinite if it is unknown.
    The run need not continue beyond the end of the reference run.
    """
    # Imported here to keep start-up fast.
    from d2rpick.histories.listings import find_listing_with_error

    last = switched.history.end
    time, name = expected
    if time > reference.history.end:
        time = reference.history.end
        name = "the end of the reference run"
    room = _STATES_AT_END * max(switched.history.step, reference.history.step)
    before = f", before {name} at {time:.6g}" if last < time - room else ""
    listing = find_listing_with_error(switched.run.sources)
    if listing:
        return (
            f"the switched run ended with an error at {last:.6g}{before} ({listing})",
        )
    if before:
        return (f"the switched run ended at {last:.6g}{before}",)
    return ()


def _read_momentum(run: OpenedRun, parts: Sequence[Part] | None) -> Track | None:
    """Return the momentum of the given parts; None if the run lacks a part or its momentum."""
    missing = {part.id for part in parts or ()} - {part.id for part in run.parts}
    return None if missing else run.momentum(parts)


def compare_runs(
    reference: History,
    switched: History,
    pair: Times,
    end: float,
    tolerance: float,
    momenta: tuple[Track | None, Track | None],
    centres: tuple[Track | None, Track | None],
    *,
    is_reported: bool = True,
    min_mean: float = 0.0,
    windows: SwitchedWindows = _UNKNOWN_WINDOWS,
    explain: Callable[[], str] = str,
) -> Comparison:
    """Check whether a switched run was rigid from tr to td, and compare its energy after td with the reference run.

    Parameters
    ----------
    reference, switched : History
        Energies of the same parts in both runs.
    pair : (float, float)
        tr and td [time].
    end : float
        Time of the next contact, or the end of the records [time].
    tolerance : float
        Largest error of the locked-in amplitude [-].
    momenta, centres : pair of Track or None
        Momenta and centres of the reference run and of the switched run; None if a run has no such data.
    is_reported : bool
        True if the switched run reports its energies correctly after td; if not, they are not compared.
    min_mean : float
        Smallest expected mean energy after td, relative to that of the reference run [-]; the largest one is 2 -
        ``min_mean``.
    windows : SwitchedWindows
        The rigid windows of the switched run, as far as they are known.
    explain : callable
        Returns what is known of the models of the two runs if their energies differ before the switch.

    Raises
    ------
    RangeError
        If a run has fewer than three states from td to ``end``.
    """
    tr, td = pair
    after = _read_energies_after(reference, switched, td, end)
    energy_td = reference.energy_at(td)
    notes = [note for note in switched.notes if note not in reference.notes]
    notes += _note_energy_while_rigid(after, is_reported=is_reported)
    error = _compute_relative_distance(*momenta, td, after.end)
    limit = _find_limit_of_change(reference, switched, tr, td)
    rigid = _find_rigid_window(switched, pair, limit, windows)
    first_rigid = min(rigid[0] if rigid else tr, tr)
    first_of_all = min(first_rigid, windows.first_rigid)
    of_other_run = [*check_same_model(reference, switched, first_of_all, explain)]
    rigid_at_other_times = [
        *_check_for_other_window(reference, switched, rigid, tr, td, limit)
    ]
    objections = [
        *of_other_run,
        *_check_rigid_window(switched, rigid, tr, td),
        *rigid_at_other_times,
    ]
    differing = [
        *_check_before_window(reference, switched, momenta, windows, first_rigid)
    ]
    objections += differing
    # What follows from an earlier window says nothing about this one.
    if is_reported and not differing:
        objections += _check_energies_after(reference, after, pair, tolerance, min_mean)
    if not differing:
        objections += _check_momentum(error)
    rounding = round_off(reference)
    mean_reference = float(after.reference.mean())
    frozen = float(after.switched[0])
    has_level = is_reported and energy_td > rounding
    return Comparison(
        source=switched.source,
        energy_frozen=frozen if is_reported else None,
        energy_td=energy_td,
        level_ratio=frozen / energy_td if has_level else None,
        end=after.end,
        mean_after=float(after.switched.mean()) if is_reported else None,
        mean_after_reference=mean_reference,
        spread_after=float(after.switched.std()) if is_reported else None,
        spread_after_reference=float(after.reference.std()),
        momentum_error=error,
        displacement=_compute_distance(*centres, td, after.end),
        rigid_from=rigid and rigid[0],
        rigid_to=rigid and rigid[1],
        objections=tuple(objections),
        notes=tuple(notes),
        min_mean=min_mean,
        has_energy=is_reported and mean_reference > rounding,
        is_of_other_run=bool(of_other_run),
        is_of_other_times=bool(rigid_at_other_times),
    )


def _check_before_window(
    reference: History,
    switched: History,
    momenta: tuple[Track | None, Track | None],
    windows: SwitchedWindows,
    first_rigid: float,
) -> Iterator[str]:
    """Yield an objection if an earlier rigid window has changed the switched run before the judged window.

    Only the last states before the ``first_rigid`` state [time] are compared, because a contact that begins slightly
    earlier or later matters only if the motion after it is another one.
    """
    if not windows.earlier:
        return
    before = switched.time[switched.time < first_rigid][-_STATES_BEFORE:]
    if not before.size:
        return
    start = max(windows.earlier[-1].td, float(before[0]))
    error = _compute_relative_distance(*momenta, start, float(before[-1]))
    yield from check_before_window(reference, switched, start, first_rigid, error)


def _note_energy_while_rigid(
    after: _EnergiesAfter, *, is_reported: bool
) -> Iterator[str]:
    """Yield a note if the solver reports a wrong energy while the parts are rigid, but the right one after td."""
    energy_rigid = after.reported_while_rigid
    if energy_rigid is None or not is_reported:
        return
    frozen = float(after.switched[0])
    reported = (
        f"the solver reports an energy of {energy_rigid:.6g} while the parts are rigid"
    )
    if frozen > 0:
        reported += f", {energy_rigid / frozen:.4g} times the energy right after td, {frozen:.6g}"
    yield (
        f"{reported}; this is a fault of some solvers for rigid solid elements, and the value is not used"
    )


class _EnergiesAfter(NamedTuple):
    """Energies of both runs at their states from td to ``end`` [time], each of shape (n,) [energy].

    ``reported_while_rigid`` is the energy that the solver reports while the parts are rigid; None if it is correct.
    """

    end: float
    reference: Samples
    switched: Samples
    reported_while_rigid: float | None


def _read_energies_after(
    reference: History, switched: History, td: float, end: float
) -> _EnergiesAfter:
    """Return the energies from td to ``end``, or to the end of the shorter record; raise RangeError if too few."""
    end = min(end, float(reference.time[-1]), float(switched.time[-1]))
    reference_after = reference.between(td, end)[1]
    states = min(switched.between(td, end)[1].size, reference_after.size)
    _check_number_of_states(reference, switched, states, td, end)
    switched_after, energy_rigid = _select_energies_after(switched, td, end)
    return _EnergiesAfter(end, reference_after, switched_after, energy_rigid)


def _select_energies_after(
    switched: History, td: float, end: float
) -> tuple[Samples, float | None]:
    """Return the energies of the switched run from td to ``end``, and the energy while rigid if it is wrong.

    The second value is the energy that the solver reports while the parts are rigid; None if it is correct.
    """
    energies_after = switched.between(td, end)[1]
    energies_before = switched.energy[switched.time < td]
    if not energies_before.size:
        return energies_after, None
    energy_rigid = float(energies_before[-1])
    energies_to_end = switched.between(td, np.inf)[1]
    if energies_after[0] == energy_rigid and _is_reported_wrong(
        energy_rigid, energies_to_end[1:]
    ):
        # The solver switches at the first step at or after td, so the parts are still rigid in this state.
        energies_after = energies_after[1:]
        energies_to_end = energies_to_end[1:]
    is_wrong = _is_reported_wrong(energy_rigid, energies_to_end)
    return energies_after, energy_rigid if is_wrong else None


def _check_number_of_states(
    reference: History, switched: History, states: int, td: float, end: float
) -> None:
    """Raise RangeError if a run has too few states after td."""
    if states < 3:
        short = min(reference, switched, key=lambda history: history.end)
        name = ", ".join(short.source)
        last = float(short.time[-1])
        if last == td:
            raise RangeError(
                f"{name}: the record ends at {last:g}, while the parts are still rigid, so no state after td can be "
                "compared; give a finished switched run with all its restart segments"
            )
        if last < td:
            raise RangeError(
                f"{name}: ends at {last:g}, not after td {td:g}; give the later restart segments too"
            )
        states_text = f"fewer than 3 states from td {td:g} to {end:g}"
        raise RangeError(
            f"{name}: {states_text}; at least 3 are needed to compare the runs"
        )


def _find_limit_of_change(
    reference: History, switched: History, tr: float, td: float
) -> float:
    """Return the largest change of an energy that is treated as zero, at least the rounding error [energy]."""
    level = float(np.abs(switched.energies_at(np.array((tr + td) / 2))))
    digits = max(LAST_DIGIT * level, switched.energy_precision.quantum(level))
    vibrates = compute_energy_range(reference, tr, td)
    rounding = round_off(reference)
    if level + vibrates <= rounding:
        return max(digits, rounding)
    return max(digits, min(_STILL * level, _STILL_OF_VIBRATION * vibrates))


def _find_rigid_window(
    switched: History, pair: Times, limit: float, windows: SwitchedWindows
) -> Times | None:
    """Return the first and last rigid state of the judged window [time]; None if there is no state.

    If the output of the parts does not show the window, it is that of constant energy around the middle of (tr, td).
    """
    judged = windows.judged
    if judged and judged.rigid:
        return judged.first, judged.td
    tr, td = pair
    time = switched.time
    energy = switched.energy
    middle = int(np.argmin(np.abs(time - (tr + td) / 2)))
    if not tr <= time[middle] <= td:
        return None
    moving = np.flatnonzero(np.abs(energy - energy[middle]) > limit)
    first = int(moving[moving < middle].max(initial=-1)) + 1
    last = int(moving[moving > middle].min(initial=time.size)) - 1
    return float(time[first]), float(time[last])


def _check_rigid_window(
    switched: History, rigid: Times | None, tr: float, td: float
) -> Iterator[str]:
    """Yield an objection if no state shows that the energy is constant somewhere between tr and td."""
    if rigid is None:
        yield f"the switched run has no state between tr {tr:g} and td {td:g}: it may not have been rigid"
    elif rigid[1] - rigid[0] <= 2 * switched.step < td - tr:
        yield f"the energy of the switched run is not constant from tr {tr:g} to td {td:g}: was it switched?"


def _check_for_other_window(
    reference: History,
    switched: History,
    rigid: Times | None,
    tr: float,
    td: float,
    limit: float,
) -> Iterator[str]:
    """Yield an objection if the energy is constant in another window than from tr to td.

    A constant energy before tr or after td is an objection only if the energy of the reference run is not constant
    there.
    """
    room = 2 * switched.step
    if rigid is None or rigid[1] - rigid[0] <= room < td - tr:
        return

    def lasts_longer(start: float, end: float) -> bool:
        return (
            end - start > room and compute_energy_range(reference, start, end) > limit
        )

    if (
        rigid[0] > tr + room
        or rigid[1] < td - room
        or lasts_longer(rigid[0], tr)
        or lasts_longer(td, rigid[1])
    ):
        rigid_text = f"the energy of the switched run is constant from {rigid[0]:.6g} to {rigid[1]:.6g}"
        yield f"{rigid_text}, not from tr {tr:g} to td {td:g}"


def _check_locked_in_energy(
    reference: History, tr: float, frozen: float, energy_td: float, tolerance: float
) -> Iterator[str]:
    """Yield objections if the energy at td differs from that of the reference run near tr or at td."""
    if max(frozen, energy_td) <= round_off(reference):
        return  # An error relative to the vibration energy has no meaning if nothing vibrates.
    about = reference.energy[np.abs(reference.time - tr) <= 2 * reference.step]
    room = _ABOUT * float(np.abs(about).max(initial=0.0))
    if about.size and not about.min() - room <= frozen <= about.max() + room:
        yield (
            f"the energy after td, {frozen:.6g}, is not the energy of the reference run at tr {tr:g}, "
            f"{reference.energy_at(tr):.6g}: was it switched at another time?"
        )
    if measures.level_error(frozen, energy_td) > tolerance:
        yield f"the frozen energy, {frozen:.6g}, differs from the energy of the reference run at td, {energy_td:.6g}"


def _check_energies_after(
    reference: History,
    after: _EnergiesAfter,
    pair: Times,
    tolerance: float,
    min_mean: float,
) -> Iterator[str]:
    """Yield objections to the energies after td: to the locked-in energy, and to the mean energy."""
    tr, td = pair
    frozen = float(after.switched[0])
    yield from _check_locked_in_energy(
        reference, tr, frozen, reference.energy_at(td), tolerance
    )
    mean_reference = float(after.reference.mean())
    if mean_reference > round_off(reference):
        share = float(after.switched.mean()) / mean_reference
        yield from _check_mean_energy(share, min_mean)


def _check_mean_energy(share: float, min_mean: float) -> Iterator[str]:
    """Yield an objection if the mean energy after td differs from that of the reference run."""
    if not min_mean <= share <= 2 - min_mean:
        mean_text = (
            f"the mean energy after td is {share:.0%} of that of the reference run"
        )
        yield f"{mean_text}, but {100 * min_mean:g}% to {100 * (2 - min_mean):g}% were expected (`min_mean_energy`)"


def _check_momentum(error: float | None) -> Iterator[str]:
    """Yield an objection if the relative momentum ``error`` after td is too large."""
    if error is not None and error > MOST_MOMENTUM_ERROR:
        moved = f"the momentum of the switched run after td differs by {error:.1%}"
        yield f"{moved} from that of the reference run, so it moves differently"


def _is_reported_wrong(rigid: float, energies_after: Samples) -> bool:
    """Return True if the energy while the parts are rigid differs from the energy at td."""
    usual = np.abs(np.diff(energies_after)).max()
    return bool(
        abs(rigid - energies_after[0])
        > max(usual, _REPORTED_OFF * abs(energies_after[0]))
    )


def _compute_relative_distance(
    reference: Track | None, switched: Track | None, td: float, end: float
) -> float | None:
    """Return the largest distance between two tracks, relative to the largest vector of the reference track [-]."""
    distance = _compute_distance(reference, switched, td, end)
    if reference is None or distance is None:
        return None
    sizes = np.linalg.norm(reference.values, axis=1)
    sizes_after = sizes[(reference.time >= td) & (reference.time <= end)]
    largest = max(float(sizes_after.max(initial=0.0)), _AT_REST * float(sizes.max()))
    return distance / largest if largest > 0 else None


def _compute_distance(
    reference: Track | None, switched: Track | None, td: float, end: float
) -> float | None:
    """Return the largest distance between two tracks in a time range; None if either track is missing.

    The first state at or after td is omitted, because the parts may still be rigid in this state.
    """
    if reference is None or switched is None:
        return None
    inside = np.flatnonzero((switched.time >= td) & (switched.time <= end))[1:]
    if not inside.size:
        return None
    reference_values = [
        np.interp(switched.time[inside], reference.time, column)
        for column in reference.values.T
    ]
    return float(
        np.linalg.norm(
            switched.values[inside] - np.stack(reference_values, axis=1), axis=1
        ).max()
    )
