"""What differs after the landing between a switched run and its reference.

Both runs are aligned at the begin of their landing, the first contact after td.  Energies are in shares of the rise of
the same energy in the reference, from before the landing to its peak; ``total`` is the sum over the parts.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from d2rpick.histories.opening import Selection, open_run
from validation.compare import read
from validation.driven import angle
from validation.nodes import read_motion

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    from validation.nodes import Nodes

    Reals = NDArray[np.float64]

_BEFORE: Final = 2e-4  # the landing has not begun so long before its first contact [s]
_END: Final = 0.2  # share of the time after the landing whose mean is the final energy
TOTAL: Final = "total"


class EnergyDifference(NamedTuple):
    """Differences of an internal energy after the landing, in shares of its rise in the reference [-].

    ``rms`` over the time, of the highest values (``peak``) and of the means at the end (``final``).  ``rise`` [energy].
    """

    rms: float
    peak: float
    final: float
    rise: float


class LandingDifference(NamedTuple):
    """Differences after the landing: energies of parts and their ``total``, and what the contact does.

    ``shift`` of the landing [s]; ``impulse`` of the difference over that of the reference [-]; the centre of mass at
    the end is out of ``place`` [length] and the structure is ``turned`` [degrees].
    """

    energies: dict[str, EnergyDifference]
    shift: float
    impulse: float
    place: float
    turned: float


class Course(NamedTuple):
    """A run from its landing on: energies of parts (n, parts) and of before, impulse (3,), places at the end."""

    landing: float
    energies: Reals
    before: Reals
    impulse: Reals
    places: Reals


def read_course(legs: Sequence[Path], parts: Sequence[str], nodes: Nodes, td: float, since: Reals) -> Course:
    """Read a run at the times ``since`` its first contact after td [time]."""
    names = [str(leg) for leg in sorted(legs)]
    landing = min(time for time in read(names).contacts() if time > td)
    (database,) = open_run(names, Selection()).databases
    numbers = {part.title: part.id for part in database.parts}
    ids = [numbers[title] for title in parts]

    def at(quantity: str, times: Reals | float) -> Reals:
        values = database.part_channel(quantity, ids)
        return np.stack([np.interp(times, database.time, column) for column in values.T], axis=-1)

    def momentum(time: float) -> Reals:
        return np.array([at(f"{axis}_momentum", time).sum() for axis in "xyz"])

    end, start = landing + float(since[-1]), landing - _BEFORE
    motion = read_motion(legs, nodes, end - _BEFORE, end)
    return Course(
        landing=landing,
        energies=_with_total(at("internal_energy", landing + since)),
        before=_with_total(at("internal_energy", start)),
        impulse=momentum(end) - momentum(start),
        places=motion.places[-1],
    )


def _with_total(energies: Reals) -> Reals:
    return np.concatenate([energies, energies.sum(axis=-1, keepdims=True)], axis=-1)


def compare_landings(reference: Course, switched: Course, parts: Sequence[str], nodes: Nodes) -> LandingDifference:
    """Compare a switched run with its reference after the landing."""
    last = slice(-round(_END * len(reference.energies)), None)
    rises = reference.energies.max(axis=0) - reference.before
    off = switched.energies - reference.energies
    measures = (
        np.sqrt((off**2).mean(axis=0)),
        switched.energies.max(axis=0) - reference.energies.max(axis=0),
        off[last].mean(axis=0),
    )
    shares = np.stack([measure / rises for measure in measures] + [rises], axis=1)
    moved = nodes.centre(switched.places) - nodes.centre(reference.places)
    impulses = [float(np.linalg.norm(one)) for one in (switched.impulse - reference.impulse, reference.impulse)]
    return LandingDifference(
        energies={title: EnergyDifference(*row) for title, row in zip([*parts, TOTAL], shares.tolist(), strict=True)},
        shift=switched.landing - reference.landing,
        impulse=impulses[0] / impulses[1],
        place=float(np.linalg.norm(moved)),
        turned=angle(reference.places, switched.places),
    )
