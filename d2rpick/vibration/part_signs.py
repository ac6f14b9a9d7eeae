"""The deformation of each part with its sign, read from the part's own energy and held against a model of it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from d2rpick.vibration import measures
from d2rpick.vibration.part_motion import PartMotion, Places, all_zeros, by_own_modes, followed
from d2rpick.vibration.swings import SOLVER_FLOOR
from d2rpick.vibration.uncertainty import SMALLEST

if TYPE_CHECKING:
    from collections.abc import Sequence

    from d2rpick.histories.history import Samples


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


@dataclass(frozen=True, eq=False)
class SignedParts:
    """Signed deformations of parts, and what else of their vibration is known.

    Parameters
    ----------
    names : tuple of str
        Of the k parts that have a sign.
    motions : tuple of PartMotion
        How each of them vibrates; the sign of a deformation as a whole is arbitrary.
    time : array of shape (n,)
        Of the states that they were read from [time].
    unsigned : tuple of Unsigned
        Parts that were left out.
    unsigned_share : float
        What they hold of the energy, on average [-].
    """

    names: tuple[str, ...]
    motions: tuple[PartMotion, ...]
    time: Samples
    unsigned: tuple[Unsigned, ...]
    unsigned_share: float

    @property
    def signed(self) -> bool:
        """Whether enough of the energy lies in parts that have a sign."""
        return bool(self.names) and self.unsigned_share <= MOST_UNSIGNED

    @cached_property
    def owner(self) -> Places:
        """Place in ``names`` of the part of each deformation: a part has one for each of its modes."""
        return np.repeat(np.arange(len(self.names)), [len(one.model.amplitudes(0.0)) for one in self.motions])

    @cached_property
    def unclear(self) -> Samples:
        """Times where the sign of some part may turn or not: no two times on different sides can be compared."""
        return np.sort(np.concatenate([np.zeros(0), *(one.unclear for one in self.motions)]))

    def amplitudes(self, t: Samples | float) -> Samples:
        """Signed deformations of the parts' modes, of the shape of ``t`` with an axis before it [sqrt(energy)]."""
        return np.concatenate([one.model.amplitudes(t) for one in self.motions])

    def kinetic_energy(self, t: Samples | float) -> Samples:
        """Kinetic energy of the vibration, T [energy]."""
        return np.asarray(np.sum([one.model.kinetic_energy(t) for one in self.motions], axis=0))

    def vibration_energy(self, t: Samples | float) -> Samples:
        """Energy of the vibration, V = E + T [energy]."""
        return np.asarray(np.sum([one.model.vibration_energy(t) for one in self.motions], axis=0))

    def hidden_energy(self, t: Samples | float) -> Samples:
        """Vibration energy that further modes, and the parts that were left out, may have [energy]."""
        beside = self.unsigned_share / (1 - self.unsigned_share)
        hidden = [(one.hidden + beside) * one.model.vibration_energy(t) for one in self.motions]
        return np.asarray(np.sum(hidden, axis=0))

    def sunk(self, t: float) -> bool:
        """Whether the energy of the vibration is below a solver's errors at ``t``."""
        return bool(self.vibration_energy(t) < SOLVER_FLOOR * np.max(self.vibration_energy(self.time)))

    def residual_bound(self, residual: Samples, tr: Samples, td: float) -> Samples:
        """Largest residual of each tr of shape (n,), if what may be hidden stood opposed at tr and td [-]."""
        apart = np.sqrt(self.hidden_energy(tr)) + np.sqrt(self.hidden_energy(td))
        return np.asarray(np.sqrt(residual**2 + apart**2 / self.vibration_energy(td)))

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
    >>> bool(np.abs(np.abs(found.motions[0].model.deformation(t) @ one) - one @ one) < 1e-6)
    True
    """
    roots = np.sqrt(np.maximum(energies.T, 0.0), order="C")
    lasting, held = np.gradient(time), np.sum(roots**2, axis=1)
    found: dict[int, PartMotion] = {}
    reasons: dict[int, str] = {}
    lost = 0.0
    zeros = list(all_zeros(time, roots))
    for i in np.argsort(-held, kind="stable").tolist():
        root, own = roots[i], zeros[i]
        tracked = np.where(np.searchsorted(own.sure, time) % 2, -root, root)
        reason = _no_sign(lasting, tracked, own.sure)
        motion = None if reason else followed(time, tracked, own)
        if (motion is None or motion.hidden > SMALLEST) and lost <= MOST_UNSIGNED * held.sum():  # else it is no use
            motion = by_own_modes(time, root**2, motion)
        if motion:
            found[i] = motion
        else:
            reasons[i] = reason or _NOT_FOLLOWED
            lost += held[i]
    return SignedParts(
        names=tuple(names[i] for i in sorted(found)),
        motions=tuple(found[i] for i in sorted(found)),
        time=time,
        unsigned=tuple(Unsigned(names[i], reasons[i]) for i in sorted(reasons)),
        unsigned_share=float(lost / held.sum()) if lost else float(not held.any()),
    )


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
