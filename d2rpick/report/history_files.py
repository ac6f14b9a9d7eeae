"""Write histories of the sample models to files, as tables with arbitrary columns or as solver databases."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, Final, cast

from d2rpick.base.errors import FormatError, make_printable
from d2rpick.histories.formats import glstat, matsum
from d2rpick.histories.opening import load_reader

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from d2rpick.histories.history import Samples
    from d2rpick.models.box_run import Record
    from d2rpick.vibration.oscillator import Oscillator, Trajectory


Table = dict[str, "Samples"]

TABLES: Final = ("csv", "hdf5")  # Formats whose columns can have arbitrary names.
_SUFFIXES: Final = {"csv": "csv", "h5": "hdf5", "hdf5": "hdf5", "hdf": "hdf5"}

# Suffixes of workbooks. A table with such a name could not be opened in the program that its name promises.
_WORKBOOKS: Final = (".xlsx", ".xlsm", ".xls", ".ods")


def choose_history_format(
    name: str | None, formats: Sequence[str], asked: str | None = None
) -> str:
    """Return the requested format (``asked``) or, by default, the format of a file name; csv if there is no name.

    The suffix determines the format.  A name that has no known suffix must be or contain the name of a solver's
    database.

    Raises
    ------
    FormatError
        If the suffix implies no format and none is asked for, or if it is that of a workbook, which is never written.

    Examples
    --------
    >>> every = ("csv", "hdf5", "glstat", "matsum")
    >>> [choose_history_format(name, every) for name in ("glstat.csv", "run1.glstat", "runglstat.h5", None)]
    ['csv', 'glstat', 'hdf5', 'csv']
    """
    from pathlib import PurePath  # Imported here to keep start-up fast.

    if name is None:
        return asked or "csv"
    if os.path.isdir(name):  # noqa: PTH112  pathlib would slow down start-up
        raise FormatError(
            f"{make_printable(name)}: this is a folder; give a file in it"
        )
    path = PurePath(name.lower())
    if path.suffix in _WORKBOOKS:
        table = make_printable(str(PurePath(name).with_suffix(".csv")))
        raise FormatError(
            f"{make_printable(name)}: workbooks ({path.suffix}) are not written; write {table}, which Excel reads"
        )
    if asked is not None:
        return asked
    by_name = next((form for form in ("glstat", "matsum") if form in path.name), None)
    form = _SUFFIXES.get(path.suffix[1:], by_name)
    if form not in formats:
        raise FormatError(
            f"{make_printable(name)}: the suffix names no format; give `write_as`: {', '.join(formats)}"
        )
    return str(form)


def write_table(form: str, columns: Table) -> bytes:
    """Write columns of shape (n,) in one of the formats of `TABLES`."""
    return cast("bytes", load_reader(form).write(columns))  # type: ignore[attr-defined]


def _make_oscillator_table(motion: Trajectory) -> Table:
    """Return a table with the columns time, z, y, vz, vy, internal_energy and kinetic_energy."""
    state = motion.state
    return {
        "time": motion.time, "z": state.z, "y": state.y, "vz": state.vz, "vy": state.vy,
        "internal_energy": motion.internal_energy, "kinetic_energy": motion.kinetic_energy,
    }  # fmt: skip


def _make_oscillator_glstat(motion: Trajectory, _: Oscillator) -> bytes:
    """Return a glstat with the energies of the oscillator; its time step is the output interval."""
    step = float(motion.time[1] - motion.time[0]) if motion.time.size > 1 else 0.0
    internal = motion.internal_energy
    kinetic = motion.kinetic_energy
    columns = {
        "time": motion.time, "time step": 0 * motion.time + step, "kinetic energy": kinetic,
        "internal energy": internal, "total energy": kinetic + internal,
    }  # fmt: skip
    return glstat.write("floating oscillator", columns)


def _make_oscillator_matsum(motion: Trajectory, oscillator: Oscillator) -> bytes:
    """Return a matsum with energies and momenta of three parts: frame, suspended mass and spring."""
    frame = oscillator.frame_mass
    suspended = oscillator.mass
    state = motion.state
    zero = 0.0 * motion.time
    parts = (
        matsum.PartColumns(
            "frame", zero, frame / 2 * state.vz**2, zero, frame * state.vz
        ),
        matsum.PartColumns(
            "suspended mass",
            zero,
            suspended / 2 * state.vy**2,
            zero,
            suspended * state.vy,
        ),
        matsum.PartColumns("spring", motion.internal_energy, zero, zero, zero),
    )
    return matsum.write("floating oscillator", motion.time, parts)


def _make_box_table(record: Record) -> Table:
    """Return the columns for the box, the total momentum of box and step, and the energy balance of the model.

    Internal and kinetic energy belong to the box, so that switch times of the box can be chosen from them.  Separate
    columns contain the energies of the step, the terms of contacts and walls (see `Record`) and the work done.  The
    total energy is the sum of all columns except the work.
    """
    energies = record.internal_energy.T, record.kinetic_energy.T
    flying = record.momentum.sum(axis=1)
    return {
        "time": record.time, "x": record.centre.real, "z": record.centre.imag, "roll": record.roll,
        "vx": record.velocity.real, "vz": record.velocity.imag, "omega": record.omega,
        "internal_energy": energies[0][0], "kinetic_energy": energies[1][0],
        "momentum_x": flying.real, "momentum_z": flying.imag,
        "step_internal_energy": energies[0][1], "step_kinetic_energy": energies[1][1],
        "contact_energy": record.friction_energy, "frictional_contact_energy": record.friction_energy,
        "stonewall_energy": record.wall_energy, "damping_energy": record.damping_energy,
        "external_work": record.external_work, "total_energy": record.total_energy,
        "energy_ratio": record.energy_ratio,
    }  # fmt: skip


def _make_box_glstat(record: Record) -> bytes:
    """Return a glstat file of the model with box and step: energies, work of external forces, and mean velocity.

    The rigid walls of the model are floor, curb and ground, see `Record`.  Friction on them is part of the contact
    energy and is also listed separately, as in Radioss, since health needs the contact energy without friction.
    """
    internal = record.internal_energy.sum(axis=1)
    kinetic = record.kinetic_energy.sum(axis=1)
    zero = 0 * record.time
    speed = record.momentum.sum(axis=1) / record.mass
    return glstat.write(
        "rollover box",
        {
            "time": record.time, "time step": zero + record.dt, "kinetic energy": kinetic, "internal energy": internal,
            "stonewall energy": record.wall_energy, "system damping energy": record.damping_energy,
            "sliding interface energy": record.friction_energy, "frictional contact energy": record.friction_energy,
            "external work": record.external_work, "total energy": record.total_energy,
            "total energy / initial energy": record.energy_ratio,
            "global x velocity": speed.real, "global y velocity": zero, "global z velocity": speed.imag,
        },
    )  # fmt: skip


def _make_box_matsum(record: Record) -> bytes:
    """Return a matsum file with the energies and momenta of the parts box and step."""
    from d2rpick.models.box_run import (
        PARTS,
    )  # Imported here to keep start-up fast.

    columns = zip(
        PARTS, record.internal_energy.T, record.kinetic_energy.T, record.momentum.T.real, record.momentum.T.imag,
        strict=True,
    )  # fmt: skip
    return matsum.write(
        "rollover box",
        record.time,
        tuple(matsum.PartColumns(*part_columns) for part_columns in columns),
    )


def _list_writers(
    table: Callable[..., Table],
    glstat: Callable[..., bytes],
    matsum: Callable[..., bytes],
) -> Mapping[str, Callable[..., bytes]]:
    """Return, for each format, the function that writes it; the arguments are functions that make tables."""
    tables = {
        form: lambda run, *_, form=form: write_table(form, table(run))
        for form in TABLES
    }
    return {**tables, "glstat": glstat, "matsum": matsum}


OSCILLATOR_WRITERS: Final = _list_writers(
    _make_oscillator_table, _make_oscillator_glstat, _make_oscillator_matsum
)
BOX_WRITERS: Final = _list_writers(_make_box_table, _make_box_glstat, _make_box_matsum)
