"""Write the run of the rollover box in every format that is read: ``python -m tests.sample_box`` from the root.

All files hold the same run, one state each millisecond, to the digits of their format.  ``d2rpick rollover --dt 1e-3 -o
FILE`` writes the csv, hdf5, glstat and matsum.  The program does not write binout, d3plot and Radioss time histories;
the writers of the tests do.
"""

import struct
from collections.abc import Mapping
from typing import Final

import numpy as np

from d2rpick.histories.history import Samples
from d2rpick.models.box_model import Parameters, build_structure
from d2rpick.models.box_run import PARTS, Record, simulate
from d2rpick.report.history_files import BOX_WRITERS
from tests.command import ROOT
from tests.made_binout import LsdaWriter
from tests.made_d3plot import D3plotWriter, State
from tests.made_t01 import T01Writer

T_END, INTERVAL = 0.42, 1e-3
_GLOBALS: Final = 22
_T01_PART: Final = (1, 2, 3, 4, 5, 6)  # internal and kinetic energy, momentum, mass
_TITLE: Final = "rollover box"


def make_files(record: Record) -> Mapping[str, bytes]:
    """Return the contents of all files by file name."""
    suffixes = {"csv": "csv", "hdf5": "h5", "glstat": "glstat", "matsum": "matsum"}
    return {
        **{
            f"rollover_box.{suffixes[form]}": write(record)
            for form, write in BOX_WRITERS.items()
        },
        "rollover_box.binout": make_binout(record),
        "rollover_boxT01": make_t01(record),
        "rollover_box.d3plot": make_d3plot(record, family=1),
        "rollover_box.d3thdt": make_d3plot(record, family=3),
    }


def make_binout(record: Record) -> bytes:
    """Return the branches glstat and matsum in single precision, without symbol tables, as a killed run leaves them."""
    writer = LsdaWriter()
    for branch in ("glstat", "matsum"):
        writer.cd(f"/{branch}/metadata")
        writer.put("title", _TITLE.encode().ljust(80), "i1")
        writer.put("version", b"d2rpick     ", "i1")
    writer.put("ids", range(1, len(PARTS) + 1), "i4")
    writer.put("legend", b"".join(title.encode().ljust(70) for title in PARTS), "i1")
    writer.put("legend_ids", range(1, len(PARTS) + 1), "i4")
    whole, of_parts = _whole(record), _of_parts(record)
    for number, time in enumerate(record.time, start=1):
        for branch, columns in (("glstat", whole), ("matsum", of_parts)):
            writer.cd(f"/{branch}/d{number:06d}")
            writer.put("time", [time], "f4")
            for name, values in columns.items():
                writer.put(name, np.atleast_1d(values[number - 1]), "f4")
    return bytes(writer.data)


def _whole(record: Record) -> dict[str, Samples]:
    speed = record.momentum.sum(axis=1) / record.mass
    return {
        "kinetic_energy": record.kinetic_energy.sum(axis=1), "internal_energy": record.internal_energy.sum(axis=1),
        "stonewall_energy": record.wall_energy, "system_damping_energy": record.damping_energy,
        "sliding_interface_energy": record.friction_energy, "frictional_contact_energy": record.friction_energy,
        "external_work": record.external_work, "total_energy": record.total_energy,
        "energy_ratio": record.energy_ratio, "global_x_velocity": speed.real,
        "global_y_velocity": 0 * speed.real, "global_z_velocity": speed.imag,
    }  # fmt: skip


def _of_parts(record: Record) -> dict[str, Samples]:
    momentum = record.momentum
    return {
        "internal_energy": record.internal_energy, "kinetic_energy": record.kinetic_energy,
        "x_momentum": momentum.real, "y_momentum": 0 * momentum.real, "z_momentum": momentum.imag,
    }  # fmt: skip


def make_t01(record: Record) -> bytes:
    """Return the time history of the model and of both parts.

    Radioss has no terms for rigid walls and for damping: their energy counts as work of external forces.
    """
    writer, count = T01Writer(), len(PARTS)
    writer.record(struct.pack(">i", 3050) + _TITLE.encode().ljust(80))
    writer.record(b"d2rpick, layout of RADIOSS".ljust(80))
    writer.integers(2)
    writer.integers(40)
    writer.record(np.array([1, 1, 1], ">f4").tobytes())
    writer.integers(count, 0, 0, 1, 0, _GLOBALS)
    writer.integers(*range(1, _GLOBALS + 1))
    for number, title in enumerate(PARTS, start=1):
        writer.record(
            struct.pack(">i", number)
            + title.encode().ljust(40)
            + struct.pack(">4i", 0, 1, 2, len(_T01_PART))
        )
        writer.integers(*_T01_PART)
    writer.record(struct.pack(">5i", 0, 0, 0, count, 0) + b"GLOBAL MODEL".ljust(40))
    writer.integers(*range(1, count + 1))
    whole, parts = _t01_globals(record), _of_parts(record)
    mass = np.broadcast_to(_masses(), record.internal_energy.shape)
    of_parts = np.stack([*parts.values(), mass], axis=2)
    for time, values, numbers in zip(record.time, whole, of_parts, strict=True):
        writer.reals([time])
        writer.reals(values.tolist())
        writer.reals(numbers.ravel().tolist())
    return bytes(writer.data)


def make_d3plot(record: Record, family: int) -> bytes:
    """Return a family of one file in double precision, without nodes and elements."""
    nothing = dict.fromkeys(("numnp", "nel8", "nel4", "nel2", "nelt"), 0)
    ids = tuple(range(1, len(PARTS) + 1))
    writer = D3plotWriter(
        8, ids=ids, titles=PARTS, title=_TITLE, control=nothing, family=family
    )
    masses, speed = _masses(), record.momentum.sum(axis=1) / record.mass
    velocities = record.momentum / np.array(masses)
    states = [
        State(
            time=float(record.time[i]),
            kinetic=record.kinetic_energy[i].tolist(),
            internal=record.internal_energy[i].tolist(),
            velocities=np.stack(
                [velocities[i].real, 0 * velocities[i].real, velocities[i].imag], axis=1
            ),
            masses=masses,
            hourglass=[0.0] * len(PARTS),
            model=(float(speed[i].real), 0.0, float(speed[i].imag)),
        )
        for i in range(record.time.size)
    ]
    return writer.together(states)


def _t01_globals(record: Record) -> Samples:
    """Return the globals of all states, 0 if they do not apply; shape (n, globals)."""
    whole, momentum = _whole(record), record.momentum.sum(axis=1)
    globals_by_code = {
        1: whole["internal_energy"], 2: whole["kinetic_energy"], 3: momentum.real, 5: momentum.imag,
        6: record.mass + 0 * record.time, 7: record.dt + 0 * record.time,
        9: record.external_work - record.wall_energy - record.damping_energy,
        11: record.friction_energy, 14: record.friction_energy,
    }  # fmt: skip
    nothing = 0 * record.time
    return np.stack(
        [globals_by_code.get(code, nothing) for code in range(1, _GLOBALS + 1)], axis=1
    )


def _masses() -> tuple[float, float]:
    structure = build_structure(Parameters())
    return float(structure.masses[: structure.of_box].sum()), float(
        structure.masses[structure.of_box :].sum()
    )


if __name__ == "__main__":
    for name, content in make_files(
        simulate(Parameters(), T_END, interval=INTERVAL)
    ).items():
        (ROOT / "sample_data" / name).write_bytes(content)
