"""The motion of the floating oscillator as a file: which columns each format has of it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from d2rpick.histories.formats import csv_table, glstat, hdf5_file, matsum

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from d2rpick.histories.opening import Table
    from d2rpick.vibration.oscillator import Oscillator
    from d2rpick.vibration.replay import Trajectory

_TITLE: Final = "floating oscillator"


def table(motion: Trajectory) -> Table:
    """Columns time z y vz vy internal_energy kinetic_energy."""
    state = motion.state
    return {
        "time": motion.time, "z": state.z, "y": state.y, "vz": state.vz, "vy": state.vy,
        "internal_energy": motion.internal_energy, "kinetic_energy": motion.kinetic_energy,
    }  # fmt: skip


def as_glstat(motion: Trajectory) -> bytes:
    """Energies of the oscillator; its time step is the output interval."""
    step = float(motion.time[1] - motion.time[0]) if motion.time.size > 1 else 0.0
    internal, kinetic = motion.internal_energy, motion.kinetic_energy
    return glstat.write(
        _TITLE,
        {
            "time": motion.time, "time step": 0 * motion.time + step, "kinetic energy": kinetic,
            "internal energy": internal, "total energy": kinetic + internal,
        },
    )  # fmt: skip


def as_matsum(motion: Trajectory, oscillator: Oscillator) -> bytes:
    """Parts frame, suspended mass and spring with their energies and momenta."""
    frame, suspended, state = oscillator.frame_mass, oscillator.mass, motion.state
    zero = 0.0 * motion.time
    parts = (
        matsum.PartColumns("frame", zero, frame / 2 * state.vz**2, zero, frame * state.vz),
        matsum.PartColumns("suspended mass", zero, suspended / 2 * state.vy**2, zero, suspended * state.vy),
        matsum.PartColumns("spring", motion.internal_energy, zero, zero, zero),
    )
    return matsum.write(_TITLE, motion.time, parts)


WRITERS: Final[Mapping[str, Callable[[Trajectory, Oscillator], bytes]]] = {
    "csv": lambda motion, _: csv_table.write(table(motion)),
    "hdf5": lambda motion, _: hdf5_file.write(table(motion)),
    "glstat": lambda motion, _: as_glstat(motion),
    "matsum": as_matsum,
}
