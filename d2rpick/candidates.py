"""Candidates for tr at a given td: where they are, how far they can be trusted, what speaks against them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from d2rpick import measures
from d2rpick.crossings import find_crossings, find_extrema
from d2rpick.replay import replayed_residual
from d2rpick.uncertainty import fitted_reach, sampled_reach

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from d2rpick.history import Samples
    from d2rpick.situation import Situation


# Of the amplitude, and of a radian: below, a deformation is zero and a time the same but for rounding.
_ZERO = 1e-9


@dataclass(frozen=True)
class Candidate:
    """One tr for the td of a situation; fields are the keys of the JSON output, None where nothing can be said.

    Times in the unit of the history; ``level_error``, ``lock_in_error``, ``residual`` and ``rigid_fraction``
    without unit.  ``kind``: "crossing" of the level or "extremum" near it ("given" for a pair to be verified).
    ``acceptable``: in the flight, same sign, error within tolerance; else ``notes`` say why not.
    """

    rank: int
    tr: float
    kind: str
    energy: float
    energy_ratio: float | None
    level_error: float | None
    rising: bool | None
    sign_match: bool | None
    lock_in_error: float | None
    residual: float | None
    part_mismatch: float | None
    rigid_time: float
    rigid_fraction: float
    timing_tolerance: float | None
    tr_low: float | None
    tr_high: float | None
    acceptable: bool
    recommended: bool
    notes: tuple[str, ...]

    @property
    def error(self) -> float:
        """What the order goes by: the residual, on basis "energy" the level error; infinite when unknown."""
        error = self.residual if self.residual is not None else self.level_error
        return np.inf if error is None else error


class Found(NamedTuple):
    """A time that may serve as tr, before anything is measured; ``rising`` None where the energy turns."""

    tr: float
    kind: str
    rising: bool | None


def find_candidates(situation: Situation) -> tuple[Candidate, ...]:
    """All crossings of the level before td, and the extrema near enough to it, judged, in the order of time."""
    return judge(situation, sorted([*_from_samples(situation), *_from_mode(situation)], key=lambda one: one.tr))


def judge(situation: Situation, found: Sequence[Found]) -> tuple[Candidate, ...]:
    """Measure each tr and hold it against flight, sign and tolerance."""
    if not found:
        return ()
    times = np.array([one.tr for one in found])
    low, high = _interval(situation, times)
    measured = _measured(situation, times)
    return tuple(
        _candidate(situation, one, of_mode, low=float(a), high=float(b))
        for one, of_mode, a, b in zip(found, measured, low, high, strict=True)
    )


def _from_samples(situation: Situation) -> list[Found]:
    """Crossings and extrema of the sampled record, up to where an oscillator takes over."""
    history, td = situation.history, situation.td
    before = history.time < td
    time = np.append(history.time[before], td)
    energy = np.append(history.energy[before], situation.energy_td)
    end = situation.span.start if situation.mode and situation.span else td
    crossings = find_crossings(time, energy, situation.energy_td)
    found = [Found(c.time, "crossing", c.rising) for c in crossings if c.time < end]
    if not situation.mode:
        errors = ((e, measures.level_error(e.energy, situation.energy_td)) for e in find_extrema(time, energy))
        tolerance = situation.settings.tolerance
        found += [Found(e.time, "extremum", None) for e, error in errors if error is not None and error <= tolerance]
    return found


def _from_mode(situation: Situation) -> list[Found]:
    """Exact crossings and standstills of the oscillator between the end of the load and td."""
    mode, td = situation.mode, situation.td
    if not mode or not situation.span:
        return []
    start, level = situation.span.start, float(mode.deformation(td))
    # a level of zero is met once by each passage, whatever rounding makes of its sign
    levels = {level, -level} if abs(level) > _ZERO * np.sqrt(mode.vibration_energy(td)) else {0.0}
    # the first sample counts like any other: look from a little before it
    before = start - _ZERO / mode.omega
    times = sorted(max(t, start) for q in levels for t in mode.crossings(q, before, td))
    slope = mode.deformation(np.array(times)) * mode.velocity(np.array(times))
    turns = np.maximum(mode.extrema(before, td), start)
    near = measures.lock_in_error(mode, turns, td) <= situation.settings.tolerance
    return [
        *(Found(t, "crossing", bool(up > 0)) for t, up in zip(times, slope, strict=True)),
        *(Found(t, "extremum", None) for t in turns[near].tolist()),
    ]


class _OfMode(NamedTuple):
    """Measures that only an oscillator gives."""

    sign_match: bool
    lock_in_error: float
    residual: float
    timing_tolerance: float


def _measured(situation: Situation, times: Samples) -> list[_OfMode | None]:
    """Measures by the oscillator, None where it does not describe the record."""
    mode, td = situation.mode, situation.td
    described = [situation.described(float(t)) for t in times]
    if not mode or not any(described):
        return [None] * times.size
    tr = times[described]
    columns = (
        (mode.deformation(tr) * mode.deformation(td) >= 0).tolist(),
        measures.lock_in_error(mode, tr, td).tolist(),
        replayed_residual(mode, tr, td).tolist(),
        measures.timing_tolerance(mode, tr, td).tolist(),
    )
    found = (_OfMode(*row) for row in zip(*columns, strict=True))
    return [next(found) if one else None for one in described]


def _interval(situation: Situation, times: Samples) -> tuple[Samples, Samples]:
    """Bounds of the true tr, from the samples or, where an oscillator describes them, from its fit."""
    history, td, fit, mode = situation.history, situation.td, situation.fit, situation.mode
    reach = sampled_reach(history, times, td)
    if mode and fit:
        described = np.array([situation.described(float(t)) for t in times])
        reach = np.where(described, fitted_reach(history, fit, mode, times, td), reach)
    return times - reach, times + reach


def _candidate(situation: Situation, found: Found, of_mode: _OfMode | None, *, low: float, high: float) -> Candidate:
    history, td, tr = situation.history, situation.td, found.tr
    energy, energy_td = situation.energy_at(tr), situation.energy_td
    level_error = measures.level_error(energy, energy_td)
    objections = tuple(_objections(situation, tr, of_mode, level_error))
    return Candidate(
        rank=0,
        tr=tr,
        kind=found.kind,
        energy=energy,
        energy_ratio=energy / energy_td if energy_td > 0 else None,
        level_error=level_error,
        rising=found.rising,
        sign_match=of_mode and of_mode.sign_match,
        lock_in_error=of_mode and of_mode.lock_in_error,
        residual=of_mode and of_mode.residual,
        part_mismatch=None,
        rigid_time=td - tr,
        rigid_fraction=(td - tr) / float(history.time[-1] - history.time[0]),
        timing_tolerance=of_mode and of_mode.timing_tolerance,
        tr_low=low,
        tr_high=high,
        acceptable=not objections,
        recommended=False,
        notes=objections + tuple(_remarks(situation, (high - low) / 2, of_mode)),
    )


def _objections(situation: Situation, tr: float, of_mode: _OfMode | None, level_error: float | None) -> Iterator[str]:
    """Why this tr is not acceptable, one sentence each."""
    error = of_mode.lock_in_error if of_mode else level_error
    earliest = situation.earliest_tr
    if earliest is None:
        yield "unknown: nothing shows when the load is over"
    elif tr < earliest:
        yield f"before {situation.end_of_load}"
    if situation.td > situation.latest_td:
        yield f"td after {situation.end_of_flight}"
    if situation.drowned:
        yield "the level at td has sunk into the scatter of the record"
    if situation.prescribed and situation.mode is None:
        yield "the prescribed oscillator does not describe the record at td"
    if situation.mode and of_mode is None:
        yield "not described by the oscillator"
    elif of_mode and not of_mode.sign_match:
        yield "opposite sign of the deformation"
    elif error is None:
        yield "no positive energy to compare"
    elif error > situation.settings.tolerance:
        yield f"error {error:.3g} above the tolerance {situation.settings.tolerance:g}"


def _remarks(situation: Situation, reach: float, of_mode: _OfMode | None) -> Iterator[str]:
    """What to know of this tr beside its acceptance."""
    if situation.no_mode:
        yield f"sign, lock-in error and residual unknown: {situation.no_mode}"
    elif of_mode is None:
        yield "sign, lock-in error and residual unknown where the oscillator does not describe the record"
    if of_mode and reach > of_mode.timing_tolerance:
        yield f"tr is known to ±{reach:.2g} only, its timing tolerance is {of_mode.timing_tolerance:.2g}"
    if of_mode is None and reach >= situation.history.step:
        yield "the level lies within the sampling error of an extremum"
