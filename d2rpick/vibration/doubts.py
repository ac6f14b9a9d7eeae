"""Measure the signs that a record does not come from a linear structure in free flight, and explain refusals."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from d2rpick.base.tuples import NamedTuple
from d2rpick.vibration.locked_lines import measure_harmonics

if TYPE_CHECKING:
    from d2rpick.histories.history import Samples
    from d2rpick.vibration.lines import Grid, Prediction
    from d2rpick.vibration.locked_lines import StretchLine
    from d2rpick.vibration.midpoint import Reading

# Number of values of tr and of td at which the correlation of the deformations is checked against its bounds.
_CHECKED: Final = 90

# Largest prediction error of an accepted record, relative to the range of the energy [-].
MOST_MISSED: Final = 0.5
# Largest misfit of an accepted record, relative to the range of the energy [-].
_MOST_MISFIT: Final = 0.3
# MOST_NEGATIVE: largest absolute value of a negative static energy, relative to the mean vibration energy [-].
# _MOST_NEGATIVE_AT_ALL: limit that replaces MOST_NEGATIVE if there is no better model [-].
MOST_NEGATIVE, _MOST_NEGATIVE_AT_ALL = 0.07, 0.5
# Largest accepted change of the static energy in a record, relative to the mean vibration energy [-].
_MOST_DRIFT: Final = 0.6
# The overlap of the deformations at tr and td may exceed its bounds by this fraction of the vibration energy [-].
MOST_BEYOND: Final = 0.12
# Largest accepted height of the harmonics, relative to their fundamental line [-].
_MOST_HARMONIC: Final = 0.05
# _MOST_UNSTRETCHED: a static deformation may lack this static energy, relative to the mean vibration energy [-].
# _MOST_UNSTRETCHED_AT_ALL: limit that replaces _MOST_UNSTRETCHED if there is no better model [-].
_MOST_UNSTRETCHED, _MOST_UNSTRETCHED_AT_ALL = 0.15, 0.6
# Smallest number of states per period of the highest-frequency strong line in an accepted record.
_FEWEST_PER_PERIOD: Final = 2.4


class Doubts(NamedTuple):
    """Signs that a record does not come from a linear structure in free flight; 0 means no doubt [-].

    ``missed`` (prediction error) and ``misfit`` are relative to the range of the energy. ``negative`` and ``drift`` (of
    the static energy) and ``unstretched`` (static energy that static deformations lack) are relative to the mean
    vibration energy. ``beyond`` is by how much the overlap exceeds its bounds, relative to the vibration energy.
    ``harmonic`` is the height of the harmonics relative to their fundamental line. ``coarse`` is the number of states
    per period of the highest-frequency strong line.
    """

    missed: float
    misfit: float
    negative: float
    drift: float
    beyond: float
    harmonic: float
    unstretched: float
    coarse: float

    @property
    def refusal(self) -> str | None:
        """Return the reason why the record is refused; None if it is accepted."""
        return self._first_of(MOST_NEGATIVE, _MOST_UNSTRETCHED)

    @property
    def refusal_at_all(self) -> str | None:
        """Return why the record is refused even if there is no better model; None if it is accepted in that case."""
        return self._first_of(_MOST_NEGATIVE_AT_ALL, _MOST_UNSTRETCHED_AT_ALL)

    def _first_of(self, most_negative: float, most_unstretched: float) -> str | None:
        """Return the first reason why the record is refused under the given limits; None if it is accepted."""
        reasons = (
            (
                self.coarse < _FEWEST_PER_PERIOD,
                f"{self.coarse:.2g} states per period of the energy are too few",
            ),
            (
                self.missed > MOST_MISSED,
                "the first part of the flight does not predict the rest",
            ),
            (self.misfit > _MOST_MISFIT, "lines do not describe the energy"),
            (self.negative > most_negative, "the lines hold more energy than there is"),
            (
                self.drift > _MOST_DRIFT,
                "the mean energy changes in the flight by as much as vibrates",
            ),
            (
                self.beyond > MOST_BEYOND,
                "the energy halfway is beyond what any deformations allow",
            ),
            (
                self.harmonic > _MOST_HARMONIC,
                "the lines are harmonics of one another, as those of a nonlinear spring",
            ),
            (
                self.unstretched > most_unstretched,
                "lines at half the rate of others hold more than the static energy",
            ),
        )
        return next((reason for holds, reason in reasons if holds), None)


class StaticEnergy(NamedTuple):
    """Static part of the mean energy.

    ``energy`` (n,) is the static energy at the times of the grid [energy]. ``mean`` is the mean elastic energy of the
    modes [energy], and ``share`` the mean static energy divided by ``mean`` [-].
    """

    energy: Samples
    mean: float
    share: float


def measure_doubts(
    reading: Reading,
    static: StaticEnergy,
    prediction: Prediction,
    grid: Grid,
    stretches: tuple[StretchLine, ...],
    scatter: float,
) -> Doubts:
    """Measure the doubts about one interpretation of the lines of an internal energy that has a static part."""
    spectrum = prediction.spectrum
    mean, share = static.mean, static.share
    line_count = spectrum.lines.poles.size
    in_stretches = sum(stretch.energy for stretch in stretches) / mean
    unstretched = 0.0
    if stretches:
        unstretched = max(in_stretches - share, 0.0) / (1 + max(share, 0.0))
    return Doubts(
        missed=prediction.missed,
        misfit=spectrum.error / prediction.swing,
        negative=max(-share - 2 * line_count * scatter / mean, 0.0),
        drift=float(np.std(static.energy)) / mean,
        beyond=_measure_beyond_bounds(reading, grid),
        harmonic=measure_harmonics(spectrum.lines, grid.span, scatter),
        unstretched=unstretched,
        coarse=grid.strong,
    )


def _measure_beyond_bounds(reading: Reading, grid: Grid) -> float:
    """Return how far the overlap exceeds its bounds (rms over pairs of times), relative to the vibration energy [-]."""
    # The times are evenly spaced, so the middle of any two is one of them or lies halfway between neighbours.
    even = np.linspace(grid.time[0], grid.time[-1], 2 * _CHECKED - 1)
    tr, td = np.triu_indices(_CHECKED, 1)
    middle = tr + td
    elastic = reading.elastic_energy(even)
    level = reading.level(even)
    ends = even[::2]
    at_ends = np.maximum(elastic[::2], 0.0)
    bound = np.sqrt(at_ends[tr] * at_ends[td])
    coherence = (reading.earlier(ends) @ reading.later(ends).T).real
    fluctuation = (elastic - level / 2)[middle]
    overlap = fluctuation + coherence[tr, td] / 2
    beyond = np.maximum(np.abs(overlap) - bound, 0.0)
    relative = beyond / level[middle]
    return float(np.sqrt(np.mean(relative**2)))
