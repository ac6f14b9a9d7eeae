"""The deformation of each part, with its sign, read from the zeros of the part's own energy.

The root of a part's energy is proportional to its deformation but for the sign, and the sign turns where the energy
passes through zero.  In a record no energy is zero exactly.  But the deformation is smooth: through a zero the root
bends sharply unless the sign is turned there, at any other minimum it bends sharply if it is.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple, TypeAlias

import numpy as np

from d2rpick.vibration.envelope import Envelope

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from numpy.typing import NDArray

    from d2rpick.histories.history import Samples
    from d2rpick.vibration.modes import Modes
    from d2rpick.vibration.one_mode import Mode

Places: TypeAlias = "NDArray[np.intp]"

# One way must be this many times smoother than the other to be believed.  At 24 samples per period of a chain of two
# springs the least clear of 35 minima has 2.5, the usual ones have 5 to 60.
_CLEARLY = 2.0
# A deformation that swings about zero is zero on average; beyond this share of its mean size it swings about
# something else, a preload or plastic work, and its sign at a zero of the energy means nothing.
_MOST_OFF_CENTRE = 0.5
# Every other sample is left out again and again while minima are unclear: in fine output a zero drowns in the error
# of the solver, 1e-5 of the highest energy, and the root is round there.  But minima stay this many samples apart.
_LEAST_APART = 8
# Samples of parts that are looked at together: what is made of them stays in the cache.
_TOGETHER = 1 << 14
# Signs of five samples about a minimum where the deformation turns nowhere, just before the minimum, just after it.
_TURNS = np.array([[1, 1, 1, 1, 1], [-1, -1, 1, 1, 1], [-1, -1, -1, 1, 1]])
# Parts without a sign are left out where they hold no more than this share of the energy: D changes by 0.2 at most,
# the default tolerance.
MOST_UNSIGNED = 0.01


class Unsigned(NamedTuple):
    """A part whose deformation has no sign, and why."""

    name: str
    reason: str


@dataclass(frozen=True, eq=False)
class SignedParts:
    """Signed deformations of parts over ``time`` (n,).

    Parameters
    ----------
    names : tuple of str
        Of the k parts that have a sign.
    deformation : array of shape (k, n)
        Root of the energy with the sign; of one part the sign as a whole is arbitrary [sqrt(energy)].
    unclear : array
        Times at which the sign of some part may turn or not: no two times on different sides can be compared.
    unsigned : tuple of Unsigned
        Parts that were left out.
    unsigned_share : float
        What they hold of the energy, on average [-].
    """

    names: tuple[str, ...]
    time: Samples
    deformation: Samples
    unclear: Samples
    unsigned: tuple[Unsigned, ...]
    unsigned_share: float

    @property
    def signed(self) -> bool:
        """Whether enough of the energy lies in parts that have a sign."""
        return bool(self.names) and self.unsigned_share <= MOST_UNSIGNED

    def amplitudes(self, t: Samples | float) -> Samples:
        """Signed deformations, of the shape of ``t`` with an axis for the parts before it [sqrt(energy)]."""
        time = np.clip(t, self.time[0], self.time[-1])
        cell = np.clip(np.searchsorted(self.time, time, side="right") - 1, 0, self.time.size - 2)
        left, right = self.deformation[:, cell], self.deformation[:, cell + 1]
        slope = (right - left) / (self.time[cell + 1] - self.time[cell])
        return np.asarray(left + slope * (time - self.time[cell]))

    def comparable_since(self, td: float) -> float:
        """Earliest time whose signs can be compared with those at ``td`` [time]."""
        before = self.unclear[self.unclear < td]
        return float(before[-1] if before.size else self.time[0])


def read_parts(time: Samples, energies: Samples, names: Sequence[str]) -> SignedParts:
    """Read the signed deformation of each part.

    Parameters
    ----------
    time : array of shape (n,)
        Of free flight [time].
    energies : array of shape (n, k)
        Internal energies of the parts [energy].
    names : sequence of str
        Of the k parts.

    Examples
    --------
    >>> t = np.linspace(0.0, 2.0, 201)
    >>> one, other = np.sin(5 * t) + np.sin(8 * t), np.cos(5 * t) - 0.5 * np.cos(8 * t)
    >>> found = read_parts(t, np.stack([one**2, other**2, other**2 + 1], axis=1), ["one", "other", "third"])
    >>> found.names, [part.name for part in found.unsigned]
    (('one', 'other'), ['third'])
    >>> bool(np.abs(np.abs(found.deformation[0] @ one) - one @ one) < 1e-9)
    True
    """
    signed: list[tuple[str, Samples]] = []
    unsigned: list[Unsigned] = []
    unclear: list[Samples] = []
    roots = np.sqrt(np.maximum(energies.T, 0.0), order="C")
    lasting = np.gradient(time)
    for name, root, zeros in zip(names, roots, _all_zeros(time, roots), strict=True):
        deformation = np.where(np.searchsorted(zeros.sure, time) % 2, -root, root)
        reason = _no_sign(lasting, deformation, zeros.sure)
        if reason:
            unsigned.append(Unsigned(name, reason))
        else:
            signed.append((name, deformation))
            unclear += [zeros.doubtful, zeros.unseen]
    total = float(np.sum(roots**2))
    held = sum(float(np.sum(column**2)) for _, column in signed)
    return SignedParts(
        names=tuple(name for name, _ in signed),
        time=time,
        deformation=np.array([column for _, column in signed]),
        unclear=np.sort(np.concatenate(unclear)) if unclear else np.zeros(0),
        unsigned=tuple(unsigned),
        unsigned_share=1 - held / total if total > 0 else 1.0,
    )


def _no_sign(lasting: Samples, deformation: Samples, zeros: Samples) -> str | None:
    """Say why a deformation, whose states last so long, is none that swings about zero."""
    if zeros.size < 2:
        return "the energy does not return to zero: preloaded, yielded or vibrating in many modes"
    off, size = abs(float(lasting @ deformation)), float(lasting @ np.abs(deformation))
    if off > _MOST_OFF_CENTRE * size:
        return f"the deformation would vibrate about {off / size:.2g} of its mean size: preloaded or yielded"
    return None


class _Zeros(NamedTuple):
    """Times at which a deformation passes zero, at which it may or may not, and, near the ends, cannot be seen to."""

    sure: Samples
    doubtful: Samples
    unseen: Samples


def _all_zeros(time: Samples, roots: Samples) -> Iterator[_Zeros]:
    """Find the zeros of each row of ``roots``, shape (k, n)."""
    rows = max(1, _TOGETHER // time.size)
    for first in range(0, len(roots), rows):
        yield from _zeros(time, roots[first : first + rows])


def _zeros(time: Samples, roots: Samples) -> list[_Zeros]:
    """Find the zeros of each row from every sample, or every other, and so on: what leaves the fewest doubts."""
    best, stride = _zeros_of(time, roots, _minima(roots)), 2
    unsure = _unsure(best, range(len(best)))
    while unsure.size:
        coarse = roots[unsure, ::stride]
        minima = _minima(coarse)
        apart = coarse.shape[1] >= _LEAST_APART * np.maximum(1, np.count_nonzero(minima, axis=1))
        rows = unsure[apart].tolist()
        for row, coarser in zip(rows, _zeros_of(time[::stride], coarse[apart], minima[apart]), strict=True):
            best[row] = min(best[row], coarser, key=lambda found: found.doubtful.size)
        unsure, stride = _unsure(best, rows), 2 * stride
    return best


def _unsure(zeros: Sequence[_Zeros], rows: Iterable[int]) -> Places:
    return np.array([row for row in rows if zeros[row].doubtful.size], dtype=np.intp)


def _zeros_of(time: Samples, roots: Samples, minima: NDArray[np.bool_]) -> list[_Zeros]:
    """Zeros of each row from just these samples, which have these minima."""
    row, at = np.nonzero(minima)
    # two samples to either side tell how the root bends; of a minimum nearer to an end nothing is known
    early, late = at < 2, at >= time.size - 2
    own, middle = row[~early & ~late], at[~early & ~late]
    around = middle[:, np.newaxis] + np.arange(-2, 3)
    plain, before, after = _bends(time[around], roots[own[:, np.newaxis], around] * _TURNS[:, np.newaxis])
    turned = np.minimum(before, after)
    zero = plain > _CLEARLY * turned
    doubt = ~zero & (turned <= _CLEARLY * plain)
    left = np.where(before < after, middle - 1, middle)[zero]
    low, high = roots[own[zero], left], roots[own[zero], left + 1]
    share = np.divide(low, low + high, out=np.full(left.shape, 0.5), where=low + high > 0)
    sure = time[left] + share * (time[left + 1] - time[left])
    # a zero beside a minimum near an end may lie one sample further inwards
    ends, unseen = np.append(row[early], row[late]), np.append(time[at[early] + 1], time[at[late] - 1])
    order = np.argsort(ends, kind="stable")
    tables = (sure, own[zero]), (time[middle[doubt]], own[doubt]), (unseen[order], ends[order])
    parted = (_by_row(times, owners, len(roots)) for times, owners in tables)
    return [_Zeros(*one) for one in zip(*parted, strict=True)]


def _by_row(values: Samples, row: Places, rows: int) -> list[Samples]:
    """Values of each row, of which some may have none; they stand in the order of the rows."""
    edges = np.searchsorted(row, np.arange(rows + 1)).tolist()
    return [values[first:last] for first, last in pairwise(edges)]


def _minima(values: Samples) -> NDArray[np.bool_]:
    """Where in each row local minima are, of a flat one the first; an end below its neighbour counts."""
    around = np.pad(values, ((0, 0), (1, 1)), constant_values=np.inf)
    return np.asarray((values < around[:, :-2]) & (values <= around[:, 2:]))


def _bends(times: Samples, values: Samples) -> Samples:
    """Largest second difference of the slopes in each row of five samples, of any number of tables of such rows."""
    slopes = (values[..., 1:] - values[..., :-1]) / (times[:, 1:] - times[:, :-1])
    return np.asarray(np.abs(slopes[..., 1:] - slopes[..., :-1]).max(axis=-1, initial=0.0))


@dataclass(frozen=True, eq=False)
class PartVibration:
    """Vibration of signed parts: ``whole`` knows its energy, a model of all parts together or an estimate."""

    parts: SignedParts
    whole: Mode | Modes | Envelope

    def amplitudes(self, t: Samples | float) -> Samples:
        """Signed deformations of the parts, of the shape of ``t`` with an axis before it [sqrt(energy)]."""
        return self.parts.amplitudes(t)

    def kinetic_energy(self, t: Samples | float) -> Samples:
        """Kinetic energy of the vibration, T: of the model, or what the estimate leaves beside E [energy]."""
        if isinstance(self.whole, Envelope):
            return np.maximum(self.whole.vibration_energy(t) - self._energy(t), 0.0)
        return self.whole.kinetic_energy(t)

    def vibration_energy(self, t: Samples | float) -> Samples:
        """Energy of the vibration, V = E + T [energy]."""
        return self._energy(t) + self.kinetic_energy(t)

    def sunk(self, t: float) -> bool:
        """Whether the estimated energy of the vibration is below a solver's errors at ``t``; a model tells more."""
        return isinstance(self.whole, Envelope) and bool(self.whole.vibration_energy(t) < self.whole.floor)

    def _energy(self, t: Samples | float) -> Samples:
        return np.asarray(np.sum(self.amplitudes(t) ** 2, axis=0))
