"""Many switched runs of the box: how roll and energy after td depend on tr, and what the tool says of it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from d2rpick.base.errors import RangeError
from d2rpick.base.workers import answers, cores, on_cores
from d2rpick.choice.situation import Settings
from d2rpick.choice.suggest import suggest
from d2rpick.histories.history import EXACT, Given, History, Momenta
from d2rpick.histories.names import Part
from d2rpick.models.box_motion import Motion
from d2rpick.models.box_run import BOX, PARTS, RigidWindow, proceed, run_to

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from d2rpick.choice.suggest import Suggestion
    from d2rpick.models.box_model import Parameters
    from d2rpick.models.box_run import Record


def history_of(record: Record) -> History:
    """Give the energy of the box, with the momenta of both parts."""
    parts = tuple(Part(number, title) for number, title in enumerate(PARTS, start=1))
    momentum = np.stack([record.momentum.real, 0 * record.momentum.real, record.momentum.imag], axis=2)
    return History(
        time=record.time,
        energy=record.internal_energy[:, BOX],
        source=("rollover",),
        format="rollover",
        channel="internal energy of box",
        parts=parts[:1],
        evidence=Given((Momenta(record.time, momentum, parts, EXACT, chosen=(BOX,)),)),
        time_unit="s",
    )


def suggestion_for(record: Record, td: float) -> Suggestion:
    """Let the tool choose tr for ``td`` [s], by nothing but the record."""
    return suggest(history_of(record), td, Settings())


# Between the times of a scan [s], while the load may last and then; and how long before td the last one is.  In the
# flight the energy swings at 40 Hz, twice the lowest mode: six times in each swing show it as it is.
_FINE, _COARSE, _LAST = 0.003, 0.004, 0.03


@dataclass(frozen=True)
class Outcome:
    """One switched run against the reference run.

    ``energy`` [J]: of the box at tr, what is locked in; ``energy_ratio``: over that at td.  At td: ``roll_error``
    [degrees], ``x_error``, ``z_error`` [m] of the centre of mass, ``omega_error`` [rad/s].  ``lost_energy`` [J] of the
    vibration at tr.  ``mean_ratio``: mean energy of the box from td to the landing, over that of the reference.
    """

    tr: float
    energy: float
    energy_ratio: float
    roll_error: float
    x_error: float
    z_error: float
    omega_error: float
    lost_energy: float
    mean_ratio: float


def scan_times(released: float, td: float) -> list[float]:
    """Times for tr: closest until half as long again after the load, then close enough for the vibration, up to td [s].

    RangeError when td leaves no time for any.
    """
    dense = min(1.5 * released, td - _LAST)
    if not dense > _FINE:
        raise RangeError(f"td {td:g} leaves no time for tr; the earliest possible td is {_FINE + _LAST:g}")
    return [*np.arange(_FINE, dense, _FINE).tolist(), *np.arange(dense, td - _LAST, _COARSE).tolist()]


def comparison_end(reference: Record, td: float) -> float:
    """When the landing, or the record, ends the comparison after ``td`` [s]; RangeError when td is not before."""
    end = float(reference.time[-1]) if reference.landed is None else reference.landed
    if not td < end:
        raise RangeError(f"td {td:g} is not before the end of the flight at {end:g}")
    return end


def scan(
    parameters: Parameters, reference: Record, times: Sequence[float], td: float, jobs: int | None = None
) -> Iterator[Outcome]:
    """Compute a switched run for each of ``times``; give outcomes in the order of tr as they are ready.

    All runs are the reference until their tr, so that is computed once; then ``jobs`` processes share them (None: one
    for each core; 1: this one).
    """
    end = comparison_end(reference, td)
    ready: dict[int, Record] = {}
    ordered = sorted(times)
    following = 0
    with on_cores(jobs or cores(), "d2rpick.models.box_run") as farm:
        for answer in answers(farm, _switched, _branches(Motion(parameters, _interval(reference)), ordered, td, end)):
            if answer.error:
                raise answer.error
            ready[answer.number] = answer.result
            while following in ready:
                yield compare(reference, ready.pop(following), ordered[following], td)
                following += 1


def _branches(
    motion: Motion, times: Iterable[float], td: float, end: float
) -> Iterator[tuple[Motion, float, RigidWindow]]:
    """Advance the reference from one tr to the next, and leave a copy of it at each."""
    for tr in times:
        run_to(motion, tr)
        yield motion.copy(), end, RigidWindow(tr, td)


def _switched(branch: tuple[Motion, float, RigidWindow]) -> Record:
    return proceed(*branch)


def compare(reference: Record, switched: Record, tr: float, td: float) -> Outcome:
    """Hold a switched run, which may begin at tr, against the reference run at td and from there to the landing."""
    interval = _interval(reference)
    at, end = round(td / interval), round(comparison_end(reference, td) / interval)
    begin = round(float(switched.time[0]) / interval)
    here, there = slice(at, end), slice(at - begin, end - begin)
    energy = float(np.interp(tr, reference.time, reference.internal_energy[:, BOX]))
    way = complex(switched.centre[at - begin] - reference.centre[at])
    means = [float(run.internal_energy[part, BOX].mean()) for run, part in ((switched, there), (reference, here))]
    return Outcome(
        tr=tr,
        energy=energy,
        energy_ratio=energy / float(reference.internal_energy[at, BOX]),
        roll_error=float(np.degrees(switched.roll[at - begin] - reference.roll[at])),
        x_error=way.real,
        z_error=way.imag,
        omega_error=float(switched.omega[at - begin] - reference.omega[at]),
        lost_energy=float(switched.lost_energy[-1]),
        mean_ratio=means[0] / means[1],
    )


def _interval(record: Record) -> float:
    return float(record.time[1] - record.time[0])
