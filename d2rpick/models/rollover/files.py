"""A run of the rollover box as a file: which columns each format has of it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from d2rpick.histories.formats import csv_table, glstat, hdf5_file, matsum
from d2rpick.models.rollover.record import PARTS

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from d2rpick.histories.writing import Table
    from d2rpick.models.rollover.model import Values
    from d2rpick.models.rollover.record import Record

_TITLE: Final = "rollover box"


def table(record: Record) -> Table:
    """Columns of the box, time to kinetic_energy; of box and step together: momentum, and what energy was spent."""
    energies = record.internal_energy.T, record.kinetic_energy.T
    flying = record.momentum.sum(axis=1)
    return {
        "time": record.time, "x": record.centre.real, "z": record.centre.imag, "roll": record.roll,
        "vx": record.velocity.real, "vz": record.velocity.imag, "omega": record.omega,
        "internal_energy": energies[0][0], "kinetic_energy": energies[1][0],
        "momentum_x": flying.real, "momentum_z": flying.imag, "momentum_y": 0 * record.time,
        "contact_energy": record.contact_energy, "external_work": record.external_work,
        "damping_energy": record.damping_energy, "total_energy": _total(record),
    }  # fmt: skip


def as_glstat(record: Record) -> bytes:
    """Energies of box and step together, what was exchanged with sled, curb and ground, and the mean velocity."""
    internal, kinetic = record.internal_energy.sum(axis=1), record.kinetic_energy.sum(axis=1)
    total = _total(record)
    momentum, zero = record.momentum.sum(axis=1), 0 * record.time
    speed = momentum / (momentum[0].real / record.velocity[0].real)
    return glstat.write(
        _TITLE,
        {
            "time": record.time, "time step": zero + record.dt, "kinetic energy": kinetic, "internal energy": internal,
            "sliding interface energy": record.contact_energy, "external work": record.external_work,
            "system damping energy": record.damping_energy, "total energy": total,
            "total energy / initial energy": total / (kinetic[0] + record.external_work),
            "global x velocity": speed.real, "global y velocity": zero, "global z velocity": speed.imag,
        },
    )  # fmt: skip


def _total(record: Record) -> Values:
    """Energy of box and step together, that in contact and damping included [J]."""
    there = record.internal_energy.sum(axis=1) + record.kinetic_energy.sum(axis=1)
    return np.asarray(there + record.contact_energy + record.damping_energy)


def as_matsum(record: Record) -> bytes:
    """Parts box and step with their energies and momenta; while the box is rigid, those of its motion as one body."""
    columns = zip(
        PARTS, record.internal_energy.T, record.kinetic_energy.T, record.momentum.T.real, record.momentum.T.imag,
        strict=True,
    )  # fmt: skip
    return matsum.write(_TITLE, record.time, tuple(matsum.PartColumns(*one) for one in columns))


WRITERS: Final[Mapping[str, Callable[[Record], bytes]]] = {
    "csv": lambda record: csv_table.write(table(record)),
    "hdf5": lambda record: hdf5_file.write(table(record)),
    "glstat": as_glstat,
    "matsum": as_matsum,
}
