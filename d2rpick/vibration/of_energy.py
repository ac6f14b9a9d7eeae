"""The energy alone: no deformation is known, so a tr is judged by the level that is locked in."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from d2rpick.errors import listing
from d2rpick.histories.samples import find_turns, passages
from d2rpick.vibration import measures
from d2rpick.vibration.moments import SUNK, Moments
from d2rpick.vibration.uncertainty import sampled_reach

if TYPE_CHECKING:
    from collections.abc import Iterable

    from d2rpick.histories.history import History, Samples
    from d2rpick.vibration.part_signs import PartMatch, SignedParts, Unsigned

# Parts that a warning names of those that share a reason; the JSON document has all.
_NAMED = 5


class OfEnergy:
    """The samples of a record seen from ``td``; ``unknown`` says why no deformation is known."""

    basis = "energy"
    undescribed = ""
    estimated = mode = kinetic_share = sunk = None
    unsigned = signed = ()

    def __init__(self, history: History, td: float, unknown: str, doubts: tuple[str, ...] = ()) -> None:
        self.history, self.td = history, td
        self.unknown, self.doubts = unknown, doubts

    def without_parts(self, parts: SignedParts | None, *, sunk: bool) -> OfEnergy:
        """Say too why single parts do not tell the deformation: without a sign, or ``sunk`` at td."""
        reasons = [self.unknown]
        reasons += ["at td the vibration of the parts is below the error of a solver"] * sunk
        reasons += _by_reason(parts.unsigned) if parts else []
        doubts = (SUNK, *(doubt for doubt in self.doubts if doubt != SUNK)) if sunk else self.doubts
        return OfEnergy(self.history, self.td, "; ".join(reasons), doubts)

    @property
    def has_matches(self) -> bool:
        """Never: no deformation is known."""
        return False

    def energy(self, time: float) -> float:
        """E of the samples, linear between them [energy]."""
        return self.history.energy_at(time)

    def energies(self, times: Samples) -> Samples:
        """E at many times, of their shape [energy]."""
        return self.history.energies_at(times)

    def described(self, time: float) -> bool:  # noqa: ARG002  by the protocol
        """Never: there is no model but the samples."""
        return False

    def peaks(self, start: float, end: float) -> tuple[float, ...]:
        """Samples in (start, end] at which the energy peaks [time]."""
        peaks = self.history.peaks
        return tuple(peaks[(start < peaks) & (peaks <= end)].tolist())

    def moments(self, tolerance: float, since: float = -np.inf) -> Moments:
        """Crossings of the level at td, and samples where the energy turns near it, none before ``since``."""
        time, energy = sampled_before(self.history, self.td, level := self.energy(self.td))
        times, rising = passages(time, energy, level)
        asked, turns = (since <= times) & (times < self.td), find_turns(energy)[0]
        near = time[turns[measures.level_errors(energy[turns], level) <= tolerance]]
        return Moments.of_level(times[asked], rising[asked], near[near >= since])

    def measured(self, times: Samples) -> list[None]:
        """Nothing: no deformation is known."""
        return [None] * times.size

    def errors(self, times: Samples) -> Samples:
        """Level errors, of the shape of ``times``; infinite where an energy is not positive [-]."""
        errors = measures.level_errors(self.energies(times), self.energy(self.td))
        return np.where(np.isnan(errors), np.inf, errors)

    def knots(self) -> Samples:
        """None but the samples, between which the energy is linear."""
        return self.edges()

    def edges(self) -> Samples:
        """None but the samples."""
        return np.zeros(0)

    def reach(self, moments: Moments) -> Samples:
        """How far sampling and printed digits leave the true time open [time]."""
        return self.level_reach(moments.tr)

    def level_reach(self, times: Samples) -> Samples:
        """How far from each time the energy may have the level at td [time]."""
        return sampled_reach(self.history, times, self.td, self.energy(self.td))

    def part_matches(self, tr: float) -> tuple[PartMatch, ...]:  # noqa: ARG002  by the protocol
        """Nothing: single parts are not known."""
        return ()


def sampled_before(history: History, td: float, level: float) -> tuple[Samples, Samples]:
    """Times and energies of the samples before ``td``, and td itself with its ``level`` at the end."""
    before = history.time < td
    return np.append(history.time[before], td), np.append(history.energy[before], level)


def _by_reason(unsigned: Iterable[Unsigned]) -> list[str]:
    """Name the parts of each reason, since all of a structure often share one."""
    names: dict[str, list[str]] = {}
    for part in unsigned:
        names.setdefault(part.reason, []).append(part.name)
    return [f"{listing(parts, most=_NAMED)}: {reason}" for reason, parts in names.items()]
