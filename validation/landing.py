"""Differences after the landing between a switched run and its reference.

States are too far apart to show when a contact begins.  So the runs are aligned near their first contacts after td,
where the sums of their energies differ least.  Energies are relative to the rise of the same energy in the reference,
from before the landing to its peak; ``total`` is the sum of the parts.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from d2rpick.histories.opening import Selection, open_run
from validation.compare import read
from validation.driven import compute_angle
from validation.nodes import interpolate, read_motion

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    from validation.nodes import Nodes

    Reals = NDArray[np.float64]

_BEFORE: Final = 2e-4  # the landing has not begun so long before its first contact [s]
_ALIGNED: Final = np.linspace(
    -2e-4, 2e-4, 81
)  # shifts that are tried against the first contact [s]
_END: Final = 0.2  # share of the time after the landing whose mean is the final energy
TOTAL: Final = "total"


class EnergyDifference(NamedTuple):
    """Differences of an internal energy after the landing, relative to its rise in the reference [-].

    ``rms`` over the time, of the highest values (``peak``) and of the means at the end (``final``).  ``rise`` [energy].
    """

    rms: float
    peak: float
    final: float
    rise: float


class LandingDifference(NamedTuple):
    """Differences after the landing: energies of the parts and their ``total``, and the effect of the contact.

    ``shift`` of the landing [s]; ``impulse`` of the difference over that of the reference [-]; the centre of mass at
    the end is out of ``place`` [length] and the structure is ``turned`` [degrees].
    """

    energies: dict[str, EnergyDifference]
    shift: float
    impulse: float
    place: float
    turned: float


class Course(NamedTuple):
    """Run from its landing on: energies of parts (n, parts) and before it, impulse (3,), positions at the end."""

    landing: float
    energies: Reals
    before: Reals
    impulse: Reals
    places: Reals


class Record:
    """Histories of the switched parts of a run, and the start of its landing: the first contact after td [time]."""

    def __init__(self, legs: Sequence[Path], parts: Sequence[str], td: float) -> None:
        names = [str(leg) for leg in sorted(legs)]
        (database,) = open_run(names, Selection()).databases
        numbers = {part.title: part.id for part in database.parts}
        self._database, self._legs = database, legs
        self._ids = [numbers[title] for title in parts]
        self._internal = database.part_channel("internal_energy", self._ids)
        self.landing = min(time for time in read(names).contacts() if time > td)

    def energies(self, times: Reals | float) -> Reals:
        """Return the internal energies of the parts and their total at some times, shape (..., parts + 1) [energy]."""
        energies = np.stack(
            [
                np.interp(times, self._database.time, column)
                for column in self._internal.T
            ],
            axis=-1,
        )
        return np.concatenate([energies, energies.sum(axis=-1, keepdims=True)], axis=-1)

    def align(self, reference: Course, since: Reals) -> None:
        """Move the start of the landing to where the total energy differs least from that of a reference."""
        misfits = [
            np.mean(
                (self.energies(self.landing + shift + since) - reference.energies)[
                    :, -1
                ]
                ** 2
            )
            for shift in _ALIGNED
        ]
        self.landing += float(_ALIGNED[np.argmin(misfits)])

    def course(self, nodes: Nodes, since: Reals) -> Course:
        """Return the run at some times since its landing."""
        end, start = self.landing + float(since[-1]), self.landing - _BEFORE
        motion = interpolate(
            read_motion(self._legs, nodes, end - _BEFORE, end + _BEFORE),
            np.array([end]),
        )
        return Course(
            landing=self.landing,
            energies=self.energies(self.landing + since),
            before=self.energies(start),
            impulse=self._momentum(end) - self._momentum(start),
            places=motion.places[0],
        )

    def _momentum(self, time: float) -> Reals:
        sums = (
            self._database.part_channel(f"{axis}_momentum", self._ids).sum(axis=1)
            for axis in "xyz"
        )
        return np.array(
            [np.interp(time, self._database.time, momentum) for momentum in sums]
        )


def compare_landings(
    reference: Course, switched: Course, parts: Sequence[str], nodes: Nodes
) -> LandingDifference:
    """Compare a switched run with its reference after the landing."""
    last = slice(-round(_END * len(reference.energies)), None)
    rises = reference.energies.max(axis=0) - reference.before
    energy_differences = switched.energies - reference.energies
    measures = (
        np.sqrt((energy_differences**2).mean(axis=0)),
        switched.energies.max(axis=0) - reference.energies.max(axis=0),
        energy_differences[last].mean(axis=0),
    )
    shares = np.stack([measure / rises for measure in measures] + [rises], axis=1)
    moved = nodes.centre(switched.places) - nodes.centre(reference.places)
    impulses = [
        float(np.linalg.norm(impulse_difference))
        for impulse_difference in (
            switched.impulse - reference.impulse,
            reference.impulse,
        )
    ]
    return LandingDifference(
        energies={
            title: EnergyDifference(*row)
            for title, row in zip([*parts, TOTAL], shares.tolist(), strict=True)
        },
        shift=switched.landing - reference.landing,
        impulse=impulses[0] / impulses[1],
        place=float(np.linalg.norm(moved)),
        turned=compute_angle(reference.places, switched.places),
    )
