"""Determine the signed deformation of each part: from zeros confirmed by waves, else from a mode of its own."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from d2rpick.base.caching import cached_property
from d2rpick.vibration import measures
from d2rpick.vibration.amplitudes import SignedAmplitudes
from d2rpick.vibration.identify import Identification, identify
from d2rpick.vibration.measures import Profile
from d2rpick.vibration.modes import SOLVER_FLOOR
from d2rpick.vibration.span import SMALLEST, estimate_hidden_share
from d2rpick.vibration.waves import PartMotion, find_all_zeros, follow_waves

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from numpy.typing import NDArray

    from d2rpick.histories.history import Samples

    Places = NDArray[np.intp]

# A mode fitted to one part can imitate products of other modes: its misfit must be below this share of theirs.
_CLEARLY = 0.5

# A deformation that oscillates about zero has a mean of zero. Beyond this share of its mean size it oscillates about
# a preload or plastic work, and a zero of the energy does not give its sign.
_MOST_OFF_CENTRE = 0.5
# Parts without a sign are ignored if they have less than this share of the energy,
# because D changes then by at most 0.2, the default tolerance.
MOST_UNSIGNED = 0.01
_NOT_FOLLOWED = (
    "no few modes have its energy, with the signs that its minima give or on their own"
)
# The largest contributors are named until together they make up this share of the mismatch.
_NAMED_TOGETHER = 0.8


def find_own_mode(
    time: Samples, energy: Samples, followed: PartMotion | None
) -> PartMotion | None:
    """Fit a single mode to a part; return its motion if its misfit is clearly below the misfit of ``followed``."""
    fit = identify(time, energy, quick=True)
    if fit.mode is None or not _is_pure_vibration(fit):
        return followed
    hidden = max(fit.hidden_share, estimate_hidden_share(time, energy, fit.mode))
    if followed and hidden > _CLEARLY * followed.hidden:
        return followed
    return PartMotion(fit.mode, np.zeros(0), hidden)


def _is_pure_vibration(fit: Identification) -> bool:
    """Return True if a fit has neither plastic work nor a preload, which may be a second plane."""
    return bool(
        fit.describes_record
        and fit.mode
        and not (fit.mode.energy_plastic or fit.mode.preload)
    )


class PartMatch(NamedTuple):
    """One part: whether its deformation has the same sign at tr and td, and its share of D^2.

    Both are None if the part has no sign; ``reason`` says why.
    """

    name: str
    sign_match: bool | None
    share: float | None
    reason: str | None = None


class SignedParts(SignedAmplitudes):
    """Signed deformations of parts, and their vibration energies.

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
    undescribed = (
        "the signs of the parts' deformations cannot be followed from here to td"
    )

    def __init__(self, time: Samples, energies: Samples, names: Sequence[str]) -> None:
        self.time, self._names, self._energies = time, names, energies
        roots = self._roots()
        held = np.sum(roots**2, axis=1)
        self._order = np.argsort(-held, kind="stable")
        lost, self._main = 0.0, dict[int, PartMotion | str]()
        for i, part_motion in self._by_zeros(self._order, roots):
            motion = part_motion if isinstance(part_motion, PartMotion) else None
            if motion is None or motion.hidden > SMALLEST:
                motion = find_own_mode(time, roots[i] ** 2, motion)
            self._main[i] = motion or part_motion
            lost += 0.0 if motion else held[i]
            if lost > MOST_UNSIGNED * held.sum():
                break
        if lost:
            self.unsigned_share = float(lost / held.sum())
        else:
            self.unsigned_share = float(not held.any())

    def _roots(self) -> Samples:
        """Return the roots of the energies (k, n); they are not stored, as there may be a window for each td."""
        return np.sqrt(np.maximum(self._energies.T, 0.0), order="C")

    def _by_zeros(
        self, places: Places, roots: Samples
    ) -> Iterator[tuple[int, PartMotion | str]]:
        """Yield the motion of each part from the zeros of its energy, or the reason why it is unknown."""
        lasting = np.gradient(self.time)
        for i, own_roots in zip(
            places.tolist(), find_all_zeros(self.time, roots[places]), strict=True
        ):
            root = roots[i]
            tracked = np.where(
                np.searchsorted(own_roots.sure, self.time) % 2, -root, root
            )
            reason = _explain_no_sign(lasting, tracked, own_roots.sure)
            motion = None if reason else follow_waves(self.time, tracked, own_roots)
            yield i, motion or reason or _NOT_FOLLOWED

    @cached_property
    def _all(self) -> list[PartMotion | str]:
        """Return all parts; if too much energy has no sign, modes of smaller parts are not searched for."""
        motions = {
            **self._main,
            **dict(self._by_zeros(self._order[len(self._main) :], self._roots())),
        }
        return [motions[i] for i in sorted(motions)]

    @property
    def signed(self) -> bool:
        """Return True if the parts with a sign have enough of the energy."""
        return self.unsigned_share <= MOST_UNSIGNED

    @property
    def told(self) -> str:
        """Return a description of the parts on which a choice is based."""
        return f"parts, signs of {', '.join(self.names)}"

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Return the names of the k parts that have a sign."""
        return tuple(
            name
            for name, motion in zip(self._names, self._all, strict=True)
            if isinstance(motion, PartMotion)
        )

    @cached_property
    def motions(self) -> tuple[PartMotion, ...]:
        """Return the motion of each part with a sign; the sign common to all parts is arbitrary."""
        return tuple(motion for motion in self._all if isinstance(motion, PartMotion))

    @property
    def unsigned(self) -> tuple[PartMatch, ...]:
        """Return the parts without a sign."""
        all_parts = zip(self._names, self._all, strict=True)
        return tuple(
            PartMatch(name, None, None, why)
            for name, why in all_parts
            if isinstance(why, str)
        )

    @cached_property
    def owner(self) -> Places:
        """Return the part of each deformation as an index in ``names``; a part has one for each of its modes."""
        return np.repeat(
            np.arange(len(self.names)),
            [len(motion.model.amplitudes(0.0)) for motion in self.motions],
        )

    def amplitudes(self, t: Samples | float) -> Samples:
        """Return signed deformations of the parts' modes, shape of ``t`` with an axis before it [sqrt(energy)]."""
        return np.concatenate([motion.model.amplitudes(t) for motion in self.motions])

    def kinetic_energy(self, t: Samples | float) -> Samples:
        """Return the kinetic energy of the vibration, T [energy]."""
        return np.asarray(
            np.sum([motion.model.kinetic_energy(t) for motion in self.motions], axis=0)
        )

    def vibration_energy(self, t: Samples | float) -> Samples:
        """Return the energy of the vibration, V = E + T [energy]."""
        return np.asarray(
            np.sum(
                [motion.model.vibration_energy(t) for motion in self.motions], axis=0
            )
        )

    def unseen(self, t: Samples | float, td: float) -> Samples:
        """Return the share of the vibration energy at td that hidden modes and omitted parts may have at ``t`` [-]."""
        unsigned_ratio = self.unsigned_share / (1 - self.unsigned_share)
        hidden = [
            (motion.hidden + unsigned_ratio) * motion.model.vibration_energy(t)
            for motion in self.motions
        ]
        return np.asarray(np.sum(hidden, axis=0) / self.vibration_energy(td))

    def known_at(self, td: float) -> bool:
        """Return True if the vibration energy at td exceeds the solver's errors."""
        return bool(self.vibration_energy(td) >= SOLVER_FLOOR * self._highest_energy)

    @cached_property
    def _highest_energy(self) -> float:
        """Return the highest energy of the vibration in the window [energy]."""
        return float(np.max(self.vibration_energy(self.time)))

    def profile(self, td: float) -> Profile:
        """Return frozen-deformation errors at the times before ``td`` whose sign can be compared with that at td."""
        since = np.searchsorted(self.time, self.comparable_since(td))
        return Profile.of(
            self, self.time[since:], td
        )  # These are views, since a copy for each td would fill the memory.

    def residual_band(
        self, stated: Samples, tr: Samples, td: float
    ) -> tuple[Samples, Samples, Samples]:
        """Return the residual of each tr (n,), with bounds for hidden energy that is opposed at tr and td [-]."""
        opposed = np.sqrt(self.unseen(tr, td)) + np.sqrt(self.unseen(td, td))
        squared = np.square(stated)
        hidden = np.square(opposed)
        return measures.band_about(squared, 0.0 * squared, hidden, hidden)

    def comparable_since(self, td: float) -> float:
        """Return the last unclear time before ``td`` [time]; later signs can be compared with that at td."""
        unclear = np.concatenate([motion.unclear for motion in self.motions])
        return float(np.max(unclear[unclear < td], initial=self.time[0]))


def _explain_no_sign(
    lasting: Samples, deformation: Samples, zeros: Samples
) -> str | None:
    """Return the reason why a deformation does not oscillate about zero; ``lasting`` weighs its states."""
    if zeros.size < 2:
        return "the energy does not return to zero: preloaded, yielded or vibrating in many modes"
    offset = abs(float(lasting @ deformation))
    size = float(lasting @ np.abs(deformation))
    if offset > _MOST_OFF_CENTRE * size:
        return f"the deformation would vibrate about {offset / size:.2g} of its mean size: preloaded or yielded"
    return None


def list_contributions(
    vibration: SignedParts, tr: float, td: float
) -> tuple[PartMatch, ...]:
    """Return the match of each part, the largest share first, then the parts without a sign."""
    shares = np.bincount(
        vibration.owner, measures.mismatch_shares(vibration, tr, td)
    ).tolist()
    same = (
        np.bincount(
            vibration.owner, vibration.amplitudes(tr) * vibration.amplitudes(td)
        )
        >= 0
    )
    matches = [
        PartMatch(*row)
        for row in zip(vibration.names, same.tolist(), shares, strict=True)
    ]
    matches.sort(key=lambda contribution: -(contribution.share or 0.0))
    return (*matches, *vibration.unsigned)


def name_main_contributors(matches: Sequence[PartMatch]) -> str:
    """Return the names of the parts with the largest contributions.

    Examples
    --------
    >>> matches = [("roof", False, 0.7), ("door", True, 0.25), ("seat", True, 0.05)]
    >>> name_main_contributors([PartMatch(*match) for match in matches])
    'roof 70 % (opposite sign), door 25 %'
    """
    contributors, sum_of_shares = [], 0.0
    for match in matches:
        if match.share is None or sum_of_shares >= _NAMED_TOGETHER:
            break
        contributors.append(
            f"{match.name} {match.share * 100:.0f} %{'' if match.sign_match else ' (opposite sign)'}"
        )
        sum_of_shares += match.share
    return ", ".join(contributors)
