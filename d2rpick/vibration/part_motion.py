"""How one part vibrates: the deformation that its zeros give, where waves confirm it, else modes of its own.

Zeros alone prove no sign.  Where a part bends in two planes its energy is the sum of two squares, hardly ever zero, and
the root of it with signs from its minima jumps or bends as no sum of a few waves does.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from d2rpick.vibration.identify import identify, identify_several
from d2rpick.vibration.second_mode import hidden_share, resolved
from d2rpick.vibration.waves import fit_waves

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from d2rpick.histories.history import Samples
    from d2rpick.vibration.identify import Identification
    from d2rpick.vibration.modes import Modes
    from d2rpick.vibration.one_mode import Mode
    from d2rpick.vibration.part_zeros import Zeros
    from d2rpick.vibration.waves import Waves

# Of the energy, what waves may leave of a deformation: a sign that is wrong at one of thirty minima leaves ten times as
# much, noise of half a per cent of the highest energy a tenth.
_MOST_LEFT: Final = 0.01
# A second plane with so much of the energy hides zeros, or makes some where there are none.
_MOST_HIDDEN: Final = 0.01
# Of the vibration energy at the time, over a quarter of a period: beyond, the record is another one there, or lost in
# noise, and the sign is unclear.
_OFF: Final = 0.2
_MOST_OFF: Final = 0.5  # of the samples
_ROUNDS: Final = 4  # in which the stretch that is fitted comes to hold all that is clear
# Modes of a part's own can imitate what crosses between modes in its energy: they must leave so much less.
_CLEARLY: Final = 0.5


class PartMotion(NamedTuple):
    """A ``model`` of a part's vibration, the times at which it is ``unclear`` [time], and what may be ``hidden``.

    That is the share of the vibration energy that a further mode may have unseen [-].
    """

    model: Waves | Mode | Modes
    unclear: Samples
    hidden: float


def followed(time: Samples, tracked: Samples, zeros: Zeros) -> PartMotion | None:
    """Hold a deformation against waves, which are fitted where it is clear and tell the signs in doubt.

    Parameters
    ----------
    time, tracked : array of shape (n,)
        [time], the root of the energy with the signs that its zeros give [sqrt(energy)].
    zeros : Zeros

    Returns
    -------
    PartMotion or None
        None where no waves follow it.
    """
    root, deformation, width = np.abs(tracked), tracked, max(3, time.size // (2 * zeros.sure.size))
    edges = np.sort(np.concatenate([time[[0, -1]], zeros.doubtful, zeros.unseen]))
    longest = int(np.argmax(np.diff(edges)))
    stretch = slice(*np.searchsorted(time, edges[longest : longest + 2]).tolist())
    for _ in range(_ROUNDS):
        fit = fit_waves(time[stretch], deformation[stretch])
        if fit is None:
            return None
        waves = fit
        modelled = waves.deformation(time)
        miss = (np.abs(modelled) - root) ** 2
        missed = _means(miss, width) > _OFF * waves.vibration_energy(time)
        off = (
            _means(missed.astype(np.float64), width) * width > 0.5
        )  # and beside it, where the mean still holds much that is right
        fitted, stretch = stretch, _longest(~off)
        if stretch == fitted:
            break
        deformation = np.copysign(root, modelled)
    if np.mean(off) > _MOST_OFF or miss[~off].sum() > _MOST_LEFT * (root[~off] ** 2).sum():
        return None
    hidden = hidden_share(time[fitted], root[fitted] ** 2, waves)
    return PartMotion(waves, time[off], hidden) if hidden <= _MOST_HIDDEN else None


def by_own_modes(time: Samples, energy: Samples, followed: PartMotion | None) -> PartMotion | None:
    """Take the energy for a sum of those of modes that do not mix in the part, as those of two planes do not.

    Else, or where they leave hardly less, ``followed`` is given.
    """
    fit = identify(time, energy, quick=True)
    if not _purely_vibrates(fit):
        fit = identify_several(time, energy, quick=True)
    if not _purely_vibrates(fit):
        return followed
    fit = resolved(time, energy, fit)
    if fit.mode is None or (followed and fit.hidden_share > _CLEARLY * followed.hidden):
        return followed
    return PartMotion(fit.mode, np.zeros(0), fit.hidden_share)


def _purely_vibrates(fit: Identification) -> bool:
    """Whether a fit describes the record without a plastic rest or preload: these may be a plane of a rate close by."""
    return bool(fit.describes_record and fit.mode and not (fit.mode.energy_plastic or fit.mode.preload))


def _means(values: Samples, width: int) -> Samples:
    """Means of so many values around each."""
    return np.convolve(values, np.ones(width) / width, mode="same")


def _longest(true: NDArray[np.bool_]) -> slice:
    """Longest run of true values."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], true, [False]]).astype(np.int8)))
    starts, ends = edges[::2], edges[1::2]
    if not starts.size:
        return slice(0, 0)
    best = int(np.argmax(ends - starts))
    return slice(int(starts[best]), int(ends[best]))
