"""Compare a switched run with its reference by their time histories: ``python -m validation.compare --help``.

Compared are the internal energy from td to the next landing, and the times at which contacts begin.
"""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from d2rpick.histories.opening import Selection, open_run

if TYPE_CHECKING:
    from collections.abc import Sequence

    from d2rpick.histories.history import Samples

# A contact has begun when its energy has changed by this share of its range since the previous state.
_CONTACT = 1e-4
# Below this share of the highest energy of the run, an energy is round-off, as in a free fall.
_ROUNDING = 1e-9
# Changes within this time of each other belong to one contact [s], because the corners of a shell chatter.
_SAME_CONTACT = 5e-3


class Run(NamedTuple):
    """Internal energy of the model and energy of its contacts over time (n,)."""

    time: Samples
    internal: Samples
    contact: Samples

    def contacts(self) -> list[float]:
        """Times at which contacts begin [s]."""
        size = float(np.ptp(self.contact))
        changes = (
            self.time[1:][np.abs(np.diff(self.contact)) > _CONTACT * size]
            if size
            else self.time[:0]
        )
        apart = np.diff(changes, prepend=-np.inf) > _SAME_CONTACT
        return [float(time) for time in changes[apart]]


class Comparison(NamedTuple):
    """Differences of a switched run from its reference after td.

    ``deviation``: largest difference of the internal energy over its peak in the reference; ``mean_ratio``: of the mean
    energies; both up to ``landing``, the next contact, or the end, None where there is no energy.  ``shifts`` of the
    contacts after td [s], in order.
    """

    deviation: float | None
    mean_ratio: float | None
    landing: float
    shifts: tuple[float, ...]


def read(names: Sequence[str]) -> Run:
    """Read the restart segments of a run."""
    (database,) = open_run(names, Selection()).databases
    return Run(
        database.time,
        *(database.channel(name) for name in ("internal_energy", "contact_energy")),
    )


def compare(reference: Run, switched: Run, td: float) -> Comparison:
    """Compare a switched run with its reference."""
    theirs, ours = (
        [time for time in run.contacts() if time > td] for run in (reference, switched)
    )
    landing = min(
        [*theirs[:1], *ours[:1], float(reference.time[-1]), float(switched.time[-1])]
    )
    time = reference.time[(reference.time > td) & (reference.time < landing)]
    wanted = np.interp(time, reference.time, reference.internal)
    switched_energy = np.interp(time, switched.time, switched.internal)
    shifts = tuple(
        our_time - their_time
        for our_time, their_time in zip(ours, theirs, strict=False)
    )
    if wanted.max() <= _ROUNDING * reference.internal.max():
        return Comparison(None, None, landing, shifts)
    deviation = float(np.abs(switched_energy - wanted).max() / wanted.max())
    return Comparison(
        deviation, float(switched_energy.mean() / wanted.mean()), landing, shifts
    )


def main() -> None:
    """Print the comparison."""
    parser = argparse.ArgumentParser(
        prog="python -m validation.compare", description=__doc__
    )
    parser.add_argument("--td", type=float, required=True)
    parser.add_argument("--reference", nargs="+", required=True)
    parser.add_argument("--switched", nargs="+", required=True)
    options = parser.parse_args()
    comparison = compare(read(options.reference), read(options.switched), options.td)
    finding = "round-off until the next contact"
    if comparison.deviation is not None:
        finding = f"off by {comparison.deviation:.3g} of its peak, mean ratio {comparison.mean_ratio:.3f}"
    print(f"internal energy after td  {finding}")
    print(f"compared up to            {comparison.landing:.6g}")
    print(
        f"contacts shifted by       {', '.join(f'{1e3 * shift:+.2f}' for shift in comparison.shifts[:4]) or '-'} ms"
    )


if __name__ == "__main__":
    main()
