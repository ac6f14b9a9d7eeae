"""Histories as files that others read: CSV and HDF5 at full precision, glstat and matsum as solvers write them."""

from __future__ import annotations

import io
from pathlib import PurePath
from typing import TYPE_CHECKING, Final, NamedTuple

from d2rpick import __version__
from d2rpick.errors import FormatError
from d2rpick.report.tables import as_csv

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from d2rpick.histories.history import Samples
    from d2rpick.models.rollover.record import Record
    from d2rpick.vibration.oscillator import Oscillator
    from d2rpick.vibration.replay import Trajectory

Table = dict[str, "Samples"]

_SUFFIXES: Final = {"csv": "csv", "h5": "hdf5", "hdf5": "hdf5", "hdf": "hdf5"}
_OSCILLATOR: Final = "floating oscillator"
_ROLLOVER: Final = "rollover box"
# No version of the solver wrote this; the word alone lets programs recognise the layout.
_VERSION: Final = f"{' ' * 25}d2rpick {__version__}, layout of ls-dyna"


class PartColumns(NamedTuple):
    """Histories of one part for a matsum, all of the same shape (n,)."""

    title: str
    internal_energy: Samples
    kinetic_energy: Samples
    x_momentum: Samples
    z_momentum: Samples


def table_csv(table: Table) -> bytes:
    """Columns side by side, each number in the shortest digits that read back to it."""
    rows = zip(*(column.tolist() for column in table.values()), strict=True)
    return as_csv(list(table), rows).encode()


def table_hdf5(table: Table) -> bytes:
    """A dataset for each column, doubles."""
    import h5py

    content = io.BytesIO()
    with h5py.File(content, "w") as file:
        for name, column in table.items():
            file[name] = column
    return content.getvalue()


def trajectory_table(motion: Trajectory) -> Table:
    """Columns time z y vz vy internal_energy kinetic_energy."""
    state = motion.state
    return {
        "time": motion.time, "z": state.z, "y": state.y, "vz": state.vz, "vy": state.vy,
        "internal_energy": motion.internal_energy, "kinetic_energy": motion.kinetic_energy,
    }  # fmt: skip


def rollover_table(record: Record) -> Table:
    """Columns of the box, time to kinetic_energy; the momentum of box and step together; the balance of the model.

    Internal and kinetic energy are those of the box, so that it can be switched by them; those of the step, the terms
    of the contacts and walls (see `Record`) and the work done stand beside them, and the total is the sum of all but
    the work.
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


def trajectory_glstat(motion: Trajectory) -> bytes:
    """Energies of the oscillator; its time step is the output interval."""
    step = float(motion.time[1] - motion.time[0]) if motion.time.size > 1 else 0.0
    internal, kinetic = motion.internal_energy, motion.kinetic_energy
    return _glstat(
        _OSCILLATOR,
        {
            "time": motion.time, "time step": 0 * motion.time + step, "kinetic energy": kinetic,
            "internal energy": internal, "total energy": kinetic + internal,
        },
    )  # fmt: skip


def rollover_glstat(record: Record) -> bytes:
    """Energies of box and step together, what was exchanged with sled, curb and ground, and the mean velocity.

    The walls of the model are floor, curb and ground, see `Record`; the friction on them is energy of the contacts and
    is listed once more by itself, as Radioss does, since health asks for the energy of the contacts without friction.
    """
    internal, kinetic = record.internal_energy.sum(axis=1), record.kinetic_energy.sum(axis=1)
    zero = 0 * record.time
    speed = record.momentum.sum(axis=1) / record.mass
    return _glstat(
        _ROLLOVER,
        {
            "time": record.time, "time step": zero + record.dt, "kinetic energy": kinetic, "internal energy": internal,
            "stonewall energy": record.wall_energy, "system damping energy": record.damping_energy,
            "sliding interface energy": record.friction_energy, "frictional contact energy": record.friction_energy,
            "external work": record.external_work, "total energy": record.total_energy,
            "total energy / initial energy": record.energy_ratio,
            "global x velocity": speed.real, "global y velocity": zero, "global z velocity": speed.imag,
        },
    )  # fmt: skip


def trajectory_matsum(motion: Trajectory, oscillator: Oscillator) -> bytes:
    """Parts frame, suspended mass and spring with their energies and momenta."""
    frame, suspended, state = oscillator.frame_mass, oscillator.mass, motion.state
    zero = 0.0 * motion.time
    parts = (
        PartColumns("frame", zero, frame / 2 * state.vz**2, zero, frame * state.vz),
        PartColumns("suspended mass", zero, suspended / 2 * state.vy**2, zero, suspended * state.vy),
        PartColumns("spring", motion.internal_energy, zero, zero, zero),
    )
    return _matsum(_OSCILLATOR, motion.time, parts)


def rollover_matsum(record: Record) -> bytes:
    """Parts box and step with their energies and momenta; while the box is rigid, those of its motion as one body."""
    from d2rpick.models.rollover.record import PARTS

    columns = zip(
        PARTS, record.internal_energy.T, record.kinetic_energy.T, record.momentum.T.real, record.momentum.T.imag,
        strict=True,
    )  # fmt: skip
    return _matsum(_ROLLOVER, record.time, tuple(PartColumns(*one) for one in columns))


def format_of(name: str | None, formats: Sequence[str]) -> str:
    """Tell the format that a file's name asks for; csv without a name, FormatError when it asks for none.

    Examples
    --------
    >>> every = ("csv", "hdf5", "glstat", "matsum")
    >>> [format_of(name, every) for name in ("switched.csv", "run1.glstat", "ie.h5", None)]
    ['csv', 'glstat', 'hdf5', 'csv']
    """
    if name is None:
        return "csv"
    path = PurePath(name.lower())
    asked = next((form for form in ("glstat", "matsum") if form in path.name), _SUFFIXES.get(path.suffix[1:]))
    if asked not in formats:
        raise FormatError(f"{name}: the name tells no format; give --write-as {', '.join(formats)}")
    return str(asked)


def _rows(*columns: Samples) -> zip[tuple[float, ...]]:
    return zip(*(column.tolist() for column in columns), strict=True)


def _glstat(title: str, lines: Table) -> bytes:
    """Blocks of ``label....... value`` with six significant digits (14 columns, E14.5), ``time`` first."""
    blocks = (
        f" dt of cycle{cycle:8d} is controlled by solid              1 of part         1\n\n"
        + "".join(f" {label:.<31}{value:14.5E}\n" for label, value in zip(lines, values, strict=True))
        for cycle, values in enumerate(_rows(*lines.values()), start=1)
    )
    return (f" {title}\n{_VERSION} glstat\n\n\n" + "\n\n".join(blocks)).encode()


def _matsum(title: str, time: Samples, parts: Sequence[PartColumns]) -> bytes:
    """Blocks of the parts, numbered from 1, with five significant digits (13 columns, E13.4)."""
    legend = "".join(f"{number:9d}     {part.title:<70}\n" for number, part in enumerate(parts, start=1))
    columns = [list(_rows(*part[1:])) for part in parts]
    blocks = (
        f"\n time ={moment:13.4E}\n"
        + "".join(_matsum_part(number, *rows[i]) for number, rows in enumerate(columns, start=1))
        for i, moment in enumerate(time.tolist())
    )
    head = f" {title}\n{_VERSION} matsum\n\n{{BEGIN LEGEND}}\n Entity #        Title\n{legend}{{END LEGEND}}\n"
    return (head + "\n".join(blocks)).encode()


def _matsum_part(number: int, internal: float, kinetic: float, x_momentum: float, z_momentum: float) -> str:
    return (
        f" mat.#={number:5d}             inten={internal:13.4E}     kinen={kinetic:13.4E}"
        f"     eroded_ie={0:13.4E}     eroded_ke={0:13.4E}\n"
        f" x-mom={x_momentum:13.4E}     y-mom={0:13.4E}     z-mom={z_momentum:13.4E}\n"
        f" x-rbv={0:13.4E}     y-rbv={0:13.4E}     z-rbv={0:13.4E}\n"
        f"                         hgeng={0:13.4E}     +mass={0:13.4E}     eroded_he={0:13.4E}\n"
    )


TRAJECTORY_WRITERS: Final[Mapping[str, Callable[[Trajectory, Oscillator], bytes]]] = {
    "csv": lambda motion, _: table_csv(trajectory_table(motion)),
    "hdf5": lambda motion, _: table_hdf5(trajectory_table(motion)),
    "glstat": lambda motion, _: trajectory_glstat(motion),
    "matsum": trajectory_matsum,
}
TABLE_WRITERS: Final[Mapping[str, Callable[[Table], bytes]]] = {"csv": table_csv, "hdf5": table_hdf5}
ROLLOVER_WRITERS: Final[Mapping[str, Callable[[Record], bytes]]] = {
    "csv": lambda record: table_csv(rollover_table(record)),
    "hdf5": lambda record: table_hdf5(rollover_table(record)),
    "glstat": rollover_glstat,
    "matsum": rollover_matsum,
}
