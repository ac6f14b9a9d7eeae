"""Candidates for tr at a given td: where they are, how far they can be trusted, what speaks against them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from d2rpick.choice.warnings import end_of_flight, end_of_load
from d2rpick.vibration import measures
from d2rpick.vibration.moments import Moment
from d2rpick.vibration.part_shares import main_contributors

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from d2rpick.choice.situation import Situation
    from d2rpick.vibration.moments import Measured
    from d2rpick.vibration.part_shares import PartMatch


# A residual that may be so much higher is worth a note.
_MUCH_HIGHER = 0.1
_SAME_SWING = ("on the same swing of the energy as td, which saves hardly anything",)


@dataclass(frozen=True)
class Candidate:
    """One tr for the td of a situation; fields are the keys of the JSON output, None where nothing can be said.

    Times in the unit of the history; ``level_error``, ``lock_in_error``, ``residual`` and ``rigid_fraction``
    without unit.  ``kind``: "crossing" of the level, "extremum" near it, or "match" where the deformations of several
    parts or modes come closest, "start" of a flight in which nothing vibrates ("given" for a pair to be verified).
    ``acceptable``: in the flight, same sign, error within tolerance; else ``notes`` say why not.  ``run_time_share``:
    expected run time over that of the reference.  ``same_swing``: the energy turns less than twice from tr to td, so
    that hardly anything is saved.  ``residual_high``: how large the residual may be if what the oscillator leaves over
    is a further mode.  ``parts``: what each part has of the mismatch, empty where single parts are not known.
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
    residual_high: float | None = None

    @property
    def error(self) -> float:
        """What the order goes by: the residual, on basis "energy" the level error; infinite when unknown."""
        error = self.residual if self.residual is not None else self.level_error
        return np.inf if error is None else error


def find_candidates(situation: Situation) -> tuple[Candidate, ...]:
    """All crossings of the level before td, extrema near enough to it, and closest matches, judged, in time order.

    Where nothing vibrates in the flight, its start alone.
    """
    start = situation.earliest_tr
    if start is not None and situation.at_rest:
        return judge(situation, [Moment(max(start, float(situation.history.time[0])), "start", None)])
    found = situation.vibration.moments(situation.settings.tolerance)
    of_level = np.array([one.tr for one in found if one.kind != "match"])
    new = [one for one in found if one.kind != "match" or np.all(np.abs(of_level - one.tr) > situation.history.step)]
    return judge(situation, sorted(new, key=lambda one: one.tr))


def judge(situation: Situation, found: Sequence[Moment]) -> tuple[Candidate, ...]:
    """Measure each tr and hold it against flight, sign and tolerance."""
    if not found:
        return ()
    reaches = situation.vibration.reach(found)
    measured = situation.vibration.measured(np.array([one.tr for one in found]))
    return tuple(
        _candidate(situation, one, known, low=one.tr - reach, high=one.tr + reach)
        for one, known, reach in zip(found, measured, reaches.tolist(), strict=True)
    )


def _candidate(situation: Situation, found: Moment, known: Measured | None, *, low: float, high: float) -> Candidate:
    history, td, tr = situation.history, situation.td, found.tr
    energy, energy_td = situation.vibration.energy(tr), situation.energy_td
    level_error = measures.level_error(energy, energy_td)
    objections = tuple(_objections(situation, tr, known, level_error))
    rigid_fraction = (td - tr) / float(history.time[-1] - history.time[0])
    parts = situation.vibration.part_matches(tr) if known else ()
    same_swing = situation.turns_since(tr) < 2 and not situation.at_rest
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
        residual_high=known and known.residual_high,
    )


def _objections(situation: Situation, tr: float, known: Measured | None, level_error: float | None) -> Iterator[str]:
    """Why this tr is not acceptable, one sentence each."""
    error = known.lock_in_error if known else level_error
    earliest = situation.earliest_tr
    if earliest is None:
        yield "unknown: nothing shows when the load is over"
    elif tr < earliest:
        yield f"before {end_of_load(situation)}"
    if situation.td > situation.latest_td:
        yield f"td after {end_of_flight(situation)}"
    if situation.settings.strict and not situation.flight.certain:
        yield "the flight was found from the energy alone, which is not certain"
    yield from situation.vibration.doubts
    if not situation.vibration.unknown and known is None:
        yield situation.vibration.undescribed
    elif known and not known.sign_match:
        yield "opposite sign of the deformation"
    elif situation.at_rest:
        return
    elif error is None:
        yield "the energy is not positive here, so there is nothing to compare"
    elif error > situation.settings.tolerance:
        yield f"error {error:.3g} above the tolerance {situation.settings.tolerance:g}"


def _remarks(situation: Situation, reach: float, known: Measured | None, parts: Sequence[PartMatch]) -> Iterator[str]:
    """What to know of this tr beside its acceptance."""
    if known is None:
        reason = situation.vibration.unknown or situation.vibration.undescribed
        yield f"sign, lock-in error and residual unknown: {reason}"
    if known and known.lock_in_error > measures.TOLERATED_GROWTH and parts:
        yield f"mismatch of {main_contributors(parts)}"
    if known and known.residual_high > known.residual + _MUCH_HIGHER:
        yield f"residual up to {known.residual_high:.2g} if what the oscillator leaves over is a further mode"
    if known and reach > known.timing_tolerance:
        yield f"tr is known only to ±{reach:.2g}, its timing tolerance is {known.timing_tolerance:.2g}"
    if known is None and reach >= situation.history.step:
        yield "the level lies within the sampling error of an extremum"


def _run_time_share(situation: Situation, rigid_fraction: float) -> float | None:
    cost_share, step_ratio = situation.settings.cost_share, situation.settings.step_ratio
    return None if cost_share is None else measures.run_time_share(rigid_fraction, cost_share, step_ratio)
