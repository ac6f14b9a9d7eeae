"""Candidates for tr at a given td: where they are, how far they can be trusted, what speaks against them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from d2rpick.choice import measures
from d2rpick.choice.part_shares import PartMatch, contributions, main_contributors
from d2rpick.choice.rest import at_rest
from d2rpick.choice.uncertainty import fitted_reach, sampled_reach
from d2rpick.histories.crossings import find_crossings, find_extrema
from d2rpick.vibration.one_mode import Mode
from d2rpick.vibration.replay import replayed_residual

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from d2rpick.choice.situation import Situation
    from d2rpick.histories.history import Samples


# Of a radian: below, a time is the same but for rounding.
_ZERO = 1e-9
# Why a tr has no measures although the situation has a basis for them.
_UNDESCRIBED = {
    "parts": "the signs of the parts cannot be followed from here to td",
    "oscillator": "not described by the oscillator",
}
_SAME_SWING = ("on the same swing as td: hardly anything is saved",)


@dataclass(frozen=True)
class Candidate:
    """One tr for the td of a situation; fields are the keys of the JSON output, None where nothing can be said.

    Times in the unit of the history; ``level_error``, ``lock_in_error``, ``residual`` and ``rigid_fraction``
    without unit.  ``kind``: "crossing" of the level, "extremum" near it, or "match" where the deformations of several
    parts or modes come closest, "start" of a flight in which nothing vibrates ("given" for a pair to be verified).
    ``acceptable``: in the flight, same sign, error within tolerance; else ``notes`` say why not.  ``run_time_share``:
    expected run time over that of the reference. ``same_swing``: the energy turns less than twice from tr to td, so
    that hardly anything is saved. ``parts``: what each part has of the mismatch, empty where single parts are not
    known.
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
    run_time_share: float | None = None
    same_swing: bool = False
    parts: tuple[PartMatch, ...] = ()

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
    """All crossings of the level before td, extrema near enough to it, and closest matches, judged, in time order.

    Where nothing vibrates in the flight, its start alone.
    """
    start = situation.earliest_tr
    if start is not None and at_rest(situation):
        return judge(situation, [Found(max(start, float(situation.history.time[0])), "start", None)])
    of_level = [*_from_samples(situation), *_from_mode(situation)]
    taken = np.array([one.tr for one in of_level])
    new = [one for one in _from_profile(situation) if np.all(np.abs(taken - one.tr) > situation.history.step)]
    return judge(situation, sorted([*of_level, *new], key=lambda one: one.tr))


def judge(situation: Situation, found: Sequence[Found]) -> tuple[Candidate, ...]:
    """Measure each tr and hold it against flight, sign and tolerance."""
    if not found:
        return ()
    times = np.array([one.tr for one in found])
    reaches = _reach(situation, found, times)
    measured = _measured(situation, times)
    return tuple(
        _candidate(situation, one, known, low=one.tr - reach, high=one.tr + reach)
        for one, known, reach in zip(found, measured, reaches.tolist(), strict=True)
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
    start = situation.span.start
    before = start - _ZERO / mode.fastest  # the first sample counts like any other
    times = np.maximum(mode.level_crossings(td, before), start)
    slopes = mode.energy_slopes(times)[0]
    after = td - _ZERO / mode.fastest  # td may be an extremum itself
    turns = np.array([t for t in np.maximum(mode.extrema(before, after), start) if situation.measured(t)])
    near = measures.lock_in_error(situation.vibration or mode, turns, td) <= situation.settings.tolerance
    return [
        *(Found(t, "crossing", bool(up > 0)) for t, up in zip(times.tolist(), slopes, strict=True)),
        *(Found(t, "extremum", None) for t in turns[near].tolist()),
    ]


def _from_profile(situation: Situation) -> list[Found]:
    """Closest matches of the deformations of several parts or modes."""
    return [Found(t, "match", None) for t in situation.profile.minima()] if situation.profile else []


class _OfVibration(NamedTuple):
    """Measures that only known deformations give."""

    sign_match: bool
    lock_in_error: float
    residual: float
    timing_tolerance: float
    part_mismatch: float | None


def _measured(situation: Situation, times: Samples) -> list[_OfVibration | None]:
    """Measures by the deformations, None where they are not known."""
    vibration, td, profile = situation.vibration, situation.td, situation.profile
    measured = [situation.measured(float(t)) for t in times]
    if not vibration or not any(measured):
        return [None] * times.size
    tr = times[measured]
    lock_in = measures.lock_in_error(vibration, tr, td)
    if isinstance(vibration, Mode):
        tolerance = measures.timing_tolerance(vibration, tr, td).tolist()
    else:
        assert profile is not None
        tolerance = [profile.tolerance(float(t), float(error)) for t, error in zip(tr, lock_in, strict=True)]
    if situation.part_vibration:
        mismatch = measures.part_mismatch(vibration, tr, td).tolist()
        kinetic = measures.kinetic_share(vibration, td)
        residual = [measures.residual(float(error), kinetic) for error in lock_in]
    else:
        assert situation.mode is not None
        mismatch, residual = [None] * tr.size, replayed_residual(situation.mode, tr, td).tolist()
    columns = (measures.sign_match(vibration, tr, td).tolist(), lock_in.tolist(), residual, tolerance, mismatch)
    found = (_OfVibration(*row) for row in zip(*columns, strict=True))
    return [next(found) if one else None for one in measured]


def _reach(situation: Situation, found: Sequence[Found], times: Samples) -> Samples:
    """How far the true tr may lie away: of a match half a cell of the profile, else what the level leaves open."""
    history, td, profile = situation.history, situation.td, situation.profile
    fit, mode = situation.fit, situation.mode
    reach = sampled_reach(history, times, td, situation.energy_td)
    if mode and fit:
        described = np.array([situation.described(float(t)) for t in times])
        reach = np.where(described, fitted_reach(history, fit, mode, times, td), reach)
    if profile:
        reach = np.where([one.kind == "match" for one in found], profile.cell(times) / 2, reach)
    return reach


def _candidate(situation: Situation, found: Found, known: _OfVibration | None, *, low: float, high: float) -> Candidate:
    history, td, tr = situation.history, situation.td, found.tr
    energy, energy_td = situation.energy_at(tr), situation.energy_td
    level_error = measures.level_error(energy, energy_td)
    objections = tuple(_objections(situation, tr, known, level_error))
    rigid_fraction = (td - tr) / float(history.time[-1] - history.time[0])
    parts = contributions(situation, tr) if known else ()
    same_swing = situation.turns_since(tr) < 2 and not at_rest(situation)
    remarks = (*_SAME_SWING * same_swing, *_remarks(situation, (high - low) / 2, known, parts))
    return Candidate(
        rank=0,
        tr=tr,
        kind=found.kind,
        energy=energy,
        energy_ratio=energy / energy_td if energy_td > 0 else None,
        level_error=level_error,
        rising=found.rising,
        sign_match=known and known.sign_match,
        lock_in_error=known and known.lock_in_error,
        residual=known and known.residual,
        part_mismatch=known and known.part_mismatch,
        rigid_time=td - tr,
        rigid_fraction=rigid_fraction,
        timing_tolerance=known and known.timing_tolerance,
        tr_low=low,
        tr_high=high,
        acceptable=not objections,
        recommended=False,
        notes=objections + remarks,
        run_time_share=_run_time_share(situation, rigid_fraction),
        same_swing=same_swing,
        parts=parts,
    )


def _objections(
    situation: Situation, tr: float, known: _OfVibration | None, level_error: float | None
) -> Iterator[str]:
    """Why this tr is not acceptable, one sentence each."""
    error = known.lock_in_error if known else level_error
    earliest = situation.earliest_tr
    if earliest is None:
        yield "unknown: nothing shows when the load is over"
    elif tr < earliest:
        yield f"before {situation.end_of_load}"
    if situation.td > situation.latest_td:
        yield f"td after {situation.end_of_flight}"
    if situation.settings.strict and not situation.flight.certain:
        yield "the flight was read off the energy alone, which is not certain"
    if situation.drowned:
        yield "the level at td has sunk into the scatter of the record"
    if situation.prescribed and situation.mode is None:
        yield "the prescribed oscillator does not describe the record at td"
    if situation.vibration and known is None:
        yield _UNDESCRIBED[situation.basis]
    elif known and not known.sign_match:
        yield "opposite sign of the deformation"
    elif at_rest(situation):
        return
    elif error is None:
        yield "no positive energy to compare"
    elif error > situation.settings.tolerance:
        yield f"error {error:.3g} above the tolerance {situation.settings.tolerance:g}"


def _remarks(
    situation: Situation, reach: float, known: _OfVibration | None, parts: Sequence[PartMatch]
) -> Iterator[str]:
    """What to know of this tr beside its acceptance."""
    if situation.vibration is None:
        yield f"sign, lock-in error and residual unknown: {situation.no_vibration}"
    elif known is None:
        yield f"sign, lock-in error and residual unknown: {_UNDESCRIBED[situation.basis]}"
    if known and known.lock_in_error > measures.TOLERATED_GROWTH and parts:
        yield f"mismatch of {main_contributors(parts)}"
    if known and reach > known.timing_tolerance:
        yield f"tr is known to ±{reach:.2g} only, its timing tolerance is {known.timing_tolerance:.2g}"
    if known is None and reach >= situation.history.step:
        yield "the level lies within the sampling error of an extremum"


def _run_time_share(situation: Situation, rigid_fraction: float) -> float | None:
    cost_share, step_ratio = situation.settings.cost_share, situation.settings.step_ratio
    return None if cost_share is None else measures.run_time_share(rigid_fraction, cost_share, step_ratio)
