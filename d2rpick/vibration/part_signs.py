"""The deformation of each part with its sign: what its zeros give, where waves confirm it, else modes of its own.

The root of a part's energy is proportional to its deformation but for the sign, and the sign turns where the energy
passes through zero.  In a record no energy is zero exactly.  But the deformation is smooth: through a zero the root
bends sharply unless the sign is turned there, at any other minimum it bends sharply if it is.

Zeros alone prove no sign.  Where a part bends in two planes its energy is the sum of two squares, hardly ever zero, and
the root of it with signs from its minima jumps or bends as no sum of a few waves does.
"""

from __future__ import annotations

from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING, Final, NamedTuple, TypeAlias

import numpy as np

from d2rpick.histories.history import Memory
from d2rpick.histories.samples import stretches
from d2rpick.vibration import measures
from d2rpick.vibration.identify import Identification, identify, identify_several
from d2rpick.vibration.swings import SOLVER_FLOOR
from d2rpick.vibration.uncertainty import SMALLEST, hidden_share, resolved
from d2rpick.vibration.waves import Waves, fit_waves

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from numpy.typing import NDArray

    from d2rpick.histories.history import Samples
    from d2rpick.vibration.modes import Mode, Modes


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
        # and beside it, where the mean still holds much that is right
        off = _means(missed.astype(np.float64), width) * width > 0.5
        fitted, stretch = stretch, max(stretches(~off), key=lambda one: one.stop - one.start, default=slice(0, 0))
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
    memory = Memory()
    fits = (fitter(time, energy, quick=True, memory=memory) for fitter in (identify, identify_several))
    fit = next(filter(_purely_vibrates, fits), None)
    if fit is None:
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


Places: TypeAlias = "NDArray[np.intp]"

# One way must be this many times smoother than the other to be believed.  At 24 samples per period of a chain of two
# springs the least clear of 35 minima has 2.5, the usual ones have 5 to 60.
_SMOOTHER = 2.0
# Every other sample is left out again and again while minima are unclear: in fine output a zero drowns in the error
# of the solver, 1e-5 of the highest energy, and the root is round there.  But minima stay this many samples apart.
_LEAST_APART = 8
# Samples of parts that are looked at together: what is made of them stays in the cache.
_TOGETHER = 1 << 14
# Signs of five samples about a minimum where the deformation turns nowhere, just before the minimum, just after it.
_TURNS = np.array([[1, 1, 1, 1, 1], [-1, -1, 1, 1, 1], [-1, -1, -1, 1, 1]])


class Zeros(NamedTuple):
    """Times at which a deformation passes zero, at which it may or may not, and, near the ends, cannot be seen to."""

    sure: Samples
    doubtful: Samples
    unseen: Samples


def all_zeros(time: Samples, roots: Samples) -> Iterator[Zeros]:
    """Find the zeros of each row of ``roots``, shape (k, n)."""
    rows = max(1, _TOGETHER // time.size)
    for first in range(0, len(roots), rows):
        yield from _zeros(time, roots[first : first + rows])


def _zeros(time: Samples, roots: Samples) -> list[Zeros]:
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


def _unsure(zeros: Sequence[Zeros], rows: Iterable[int]) -> Places:
    return np.array([row for row in rows if zeros[row].doubtful.size], dtype=np.intp)


def _zeros_of(time: Samples, roots: Samples, minima: NDArray[np.bool_]) -> list[Zeros]:
    """Zeros of each row from just these samples, which have these minima."""
    row, at = np.nonzero(minima)
    # two samples to either side tell how the root bends; of a minimum nearer to an end nothing is known
    early, late = at < 2, at >= time.size - 2
    own, middle = row[~early & ~late], at[~early & ~late]
    around = middle[:, np.newaxis] + np.arange(-2, 3)
    plain, before, after = _bends(time[around], roots[own[:, np.newaxis], around] * _TURNS[:, np.newaxis])
    turned = np.minimum(before, after)
    zero = plain > _SMOOTHER * turned
    doubt = ~zero & (turned <= _SMOOTHER * plain)
    left = np.where(before < after, middle - 1, middle)[zero]
    low, high = roots[own[zero], left], roots[own[zero], left + 1]
    share = np.divide(low, low + high, out=np.full(left.shape, 0.5), where=low + high > 0)
    sure = time[left] + share * (time[left + 1] - time[left])
    # a zero beside a minimum near an end may lie one sample further inwards
    ends, unseen = np.append(row[early], row[late]), np.append(time[at[early] + 1], time[at[late] - 1])
    order = np.argsort(ends, kind="stable")
    tables = (sure, own[zero]), (time[middle[doubt]], own[doubt]), (unseen[order], ends[order])
    parted = (_by_row(times, owners, len(roots)) for times, owners in tables)
    return [Zeros(*one) for one in zip(*parted, strict=True)]


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


# A deformation that swings about zero is zero on average; beyond this share of its mean size it swings about
# something else, a preload or plastic work, and its sign at a zero of the energy means nothing.
_MOST_OFF_CENTRE = 0.5
# Parts without a sign are left out where they hold no more than this share of the energy: D changes by 0.2 at most,
# the default tolerance.
MOST_UNSIGNED = 0.01
_NOT_FOLLOWED = "no few modes have its energy, with the signs that its minima give or on their own"


class Unsigned(NamedTuple):
    """A part whose deformation has no sign, and why."""

    name: str
    reason: str


class SignedParts:
    """Signed deformations of parts, and what else of their vibration is known.

    Those that hold most are read first.  As soon as too much is known to have no sign, nothing rests on the others, and
    they are read when somebody asks for their names.

    Parameters
    ----------
    time : array of shape (n,)
        Of free flight [time].
    energies : array of shape (n, k)
        Internal energies of the parts [energy].
    names : sequence of str
        Of the k parts.

    Attributes
    ----------
    unsigned_share : float
        What the parts that were left out hold of the energy, on average; of too many, those that hold most [-].

    Examples
    --------
    >>> t = np.linspace(0.0, 2.0, 201)
    >>> one, other = np.sin(5 * t) + np.sin(8 * t), np.cos(5 * t) - 0.5 * np.cos(8 * t)
    >>> found = SignedParts(t, np.stack([one**2, other**2, other**2 + 1], axis=1), ["one", "other", "third"])
    >>> found.names, [part.name for part in found.unsigned]
    (('one', 'other'), ['third'])
    >>> bool(np.abs(np.abs(found.motions[0].model.deformation(t) @ one) - one @ one) < 1e-6)
    True
    """

    kinetic = "the modes found in each part add up to"
    undescribed = "the signs of the parts' deformations cannot be followed from here to td"

    def __init__(self, time: Samples, energies: Samples, names: Sequence[str]) -> None:
        self.time, self._names = time, names
        self._roots = np.sqrt(np.maximum(energies.T, 0.0), order="C")
        held = np.sum(self._roots**2, axis=1)
        self._order = np.argsort(-held, kind="stable")
        lost, self._main = 0.0, dict[int, PartMotion | Unsigned]()
        for i, known in self._by_zeros(self._order):
            motion = known if isinstance(known, PartMotion) else None
            if motion is None or motion.hidden > SMALLEST:
                motion = by_own_modes(time, self._roots[i] ** 2, motion)
            self._main[i] = motion or known
            lost += 0.0 if motion else held[i]
            if lost > MOST_UNSIGNED * held.sum():
                break
        self.unsigned_share = float(lost / held.sum()) if lost else float(not held.any())

    def _by_zeros(self, places: Places) -> Iterator[tuple[int, PartMotion | Unsigned]]:
        """Read the signs of parts from the zeros of their energy."""
        lasting = np.gradient(self.time)
        for i, own in zip(places.tolist(), all_zeros(self.time, self._roots[places]), strict=True):
            root = self._roots[i]
            tracked = np.where(np.searchsorted(own.sure, self.time) % 2, -root, root)
            reason = _no_sign(lasting, tracked, own.sure)
            motion = None if reason else followed(self.time, tracked, own)
            yield i, motion or Unsigned(self._names[i], reason or _NOT_FOLLOWED)

    @cached_property
    def _all(self) -> list[PartMotion | Unsigned]:
        """All parts: where too much has no sign, no modes of their own are looked for in those that hold less."""
        found = {**self._main, **dict(self._by_zeros(self._order[len(self._main) :]))}
        return [found[i] for i in sorted(found)]

    @property
    def signed(self) -> bool:
        """Whether enough of the energy lies in parts that have a sign."""
        return self.unsigned_share <= MOST_UNSIGNED

    @property
    def told(self) -> str:
        """Name the parts that a choice rests on."""
        return f"parts, signs of {', '.join(self.names)}"

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Of the k parts that have a sign."""
        return tuple(name for name, known in zip(self._names, self._all, strict=True) if isinstance(known, PartMotion))

    @cached_property
    def motions(self) -> tuple[PartMotion, ...]:
        """How each of them vibrates; the sign of a deformation as a whole is arbitrary."""
        return tuple(known for known in self._all if isinstance(known, PartMotion))

    @property
    def unsigned(self) -> tuple[Unsigned, ...]:
        """Parts that were left out."""
        return tuple(known for known in self._all if isinstance(known, Unsigned))

    @cached_property
    def owner(self) -> Places:
        """Place in ``names`` of the part of each deformation: a part has one for each of its modes."""
        return np.repeat(np.arange(len(self.names)), [len(one.model.amplitudes(0.0)) for one in self.motions])

    def amplitudes(self, t: Samples | float) -> Samples:
        """Signed deformations of the parts' modes, of the shape of ``t`` with an axis before it [sqrt(energy)]."""
        return np.concatenate([one.model.amplitudes(t) for one in self.motions])

    def kinetic_energy(self, t: Samples | float) -> Samples:
        """Kinetic energy of the vibration, T [energy]."""
        return np.asarray(np.sum([one.model.kinetic_energy(t) for one in self.motions], axis=0))

    def vibration_energy(self, t: Samples | float) -> Samples:
        """Energy of the vibration, V = E + T [energy]."""
        return np.asarray(np.sum([one.model.vibration_energy(t) for one in self.motions], axis=0))

    def unseen(self, t: Samples | float, td: float) -> Samples:
        """Share of the vibration energy at td that further modes, and parts left out, may have at ``t`` [-]."""
        beside = self.unsigned_share / (1 - self.unsigned_share)
        hidden = [(one.hidden + beside) * one.model.vibration_energy(t) for one in self.motions]
        return np.asarray(np.sum(hidden, axis=0) / self.vibration_energy(td))

    def known_at(self, td: float) -> bool:
        """Whether the energy of the vibration is above a solver's errors at td."""
        return bool(self.vibration_energy(td) >= SOLVER_FLOOR * np.max(self.vibration_energy(self.time)))

    def residual_bound(self, residual: Samples, tr: Samples, td: float) -> Samples:
        """Largest residual of each tr of shape (n,), if what may be hidden stood opposed at tr and td [-]."""
        return np.asarray(np.hypot(residual, np.sqrt(self.unseen(tr, td)) + np.sqrt(self.unseen(td, td))))

    def comparable_since(self, td: float) -> float:
        """Earliest time whose signs can be compared with those at ``td``: the last unclear one before it [time]."""
        unclear = np.concatenate([one.unclear for one in self.motions])
        return float(np.max(unclear[unclear < td], initial=self.time[0]))


def _no_sign(lasting: Samples, deformation: Samples, zeros: Samples) -> str | None:
    """Say why a deformation, whose states last so long, is none that swings about zero."""
    if zeros.size < 2:
        return "the energy does not return to zero: preloaded, yielded or vibrating in many modes"
    off, size = abs(float(lasting @ deformation)), float(lasting @ np.abs(deformation))
    if off > _MOST_OFF_CENTRE * size:
        return f"the deformation would vibrate about {off / size:.2g} of its mean size: preloaded or yielded"
    return None


# The parts that are named together make up this much of the mismatch.
_NAMED_TOGETHER = 0.8


class PartMatch(NamedTuple):
    """One part: whether its deformation has the same sign at tr and td, and its share in the square of D.

    Both None where the part has no sign; ``reason`` says why.
    """

    name: str
    sign_match: bool | None
    share: float | None
    reason: str | None = None


def contributions(vibration: SignedParts, tr: float, td: float) -> tuple[PartMatch, ...]:
    """Give the match of each part, that with the largest share first, then those without a sign."""
    shares = np.bincount(vibration.owner, measures.mismatch_shares(vibration, tr, td)).tolist()
    same = np.bincount(vibration.owner, vibration.amplitudes(tr) * vibration.amplitudes(td)) >= 0
    matches = [PartMatch(*row) for row in zip(vibration.names, same.tolist(), shares, strict=True)]
    matches.sort(key=lambda one: -(one.share or 0.0))
    return (*matches, *(PartMatch(part.name, None, None, part.reason) for part in vibration.unsigned))


def main_contributors(matches: Sequence[PartMatch]) -> str:
    """Name the parts that contribute most.

    Examples
    --------
    >>> main_contributors([PartMatch("roof", False, 0.7), PartMatch("door", True, 0.25), PartMatch("seat", True, 0.05)])
    'roof 70 % (opposite sign), door 25 %'
    """
    named, sum_of_shares = [], 0.0
    for match in matches:
        if match.share is None or sum_of_shares >= _NAMED_TOGETHER:
            break
        named.append(f"{match.name} {match.share * 100:.0f} %{'' if match.sign_match else ' (opposite sign)'}")
        sum_of_shares += match.share
    return ", ".join(named)
