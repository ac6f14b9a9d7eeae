"""Writes the run of the rollover box in every format that is read: ``python -m tests.sample_box`` from the root.

One run, a state each millisecond, so that all files hold the same numbers to the digits of their format.  csv, hdf5,
glstat and matsum are what ``d2rpick rollover --dt 1e-3 -o FILE`` writes; a binout, a d3plot and a Radioss time history
are not written by the program, and the writers of the tests make them.
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


def files(record: Record) -> Mapping[str, bytes]:
    """Content by the name of the file."""
    suffixes = {"csv": "csv", "hdf5": "h5", "glstat": "glstat", "matsum": "matsum"}
    return {
        **{
            f"rollover_box.{suffixes[form]}": write(record)
            for form, write in BOX_WRITERS.items()
        },
        "rollover_box.binout": binout(record),
        "rollover_boxT01": t01(record),
        "rollover_box.d3plot": d3plot(record, family=1),
        "rollover_box.d3thdt": d3plot(record, family=3),
    }


def binout(record: Record) -> bytes:
    """Branches glstat and matsum in single precision, without symbol tables, as a run leaves them that was killed."""
    made = LsdaWriter()
    for branch in ("glstat", "matsum"):
        made.cd(f"/{branch}/metadata")
        made.put("title", _TITLE.encode().ljust(80), "i1")
        made.put("version", b"d2rpick     ", "i1")
    made.put("ids", range(1, len(PARTS) + 1), "i4")
    made.put("legend", b"".join(title.encode().ljust(70) for title in PARTS), "i1")
    made.put("legend_ids", range(1, len(PARTS) + 1), "i4")
    whole, of_parts = _whole(record), _of_parts(record)
    for number, time in enumerate(record.time, start=1):
        for branch, columns in (("glstat", whole), ("matsum", of_parts)):
            made.cd(f"/{branch}/d{number:06d}")
            made.put("time", [time], "f4")
            for name, values in columns.items():
                made.put(name, np.atleast_1d(values[number - 1]), "f4")
    return bytes(made.data)


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


def t01(record: Record) -> bytes:
    """Time history of the whole and of both parts.

    Radioss has no terms for rigid walls and for damping: what they take is work of external forces.
    """
    made, count = T01Writer(), len(PARTS)
    made.record(struct.pack(">i", 3050) + _TITLE.encode().ljust(80))
    made.record(b"d2rpick, layout of RADIOSS".ljust(80))
    made.integers(2)
    made.integers(40)
    made.record(np.array([1, 1, 1], ">f4").tobytes())
    made.integers(count, 0, 0, 1, 0, _GLOBALS)
    made.integers(*range(1, _GLOBALS + 1))
    for number, title in enumerate(PARTS, start=1):
        made.record(
            struct.pack(">i", number)
            + title.encode().ljust(40)
            + struct.pack(">4i", 0, 1, 2, len(_T01_PART))
        )
        made.integers(*_T01_PART)
    made.record(struct.pack(">5i", 0, 0, 0, count, 0) + b"GLOBAL MODEL".ljust(40))
    made.integers(*range(1, count + 1))
    whole, parts = _t01_globals(record), _of_parts(record)
    mass = np.broadcast_to(_masses(), record.internal_energy.shape)
    of_parts = np.stack([*parts.values(), mass], axis=2)
    for time, values, numbers in zip(record.time, whole, of_parts, strict=True):
        made.reals([time])
        made.reals(values.tolist())
        made.reals(numbers.ravel().tolist())
    return bytes(made.data)


def d3plot(record: Record, family: int) -> bytes:
    """A family of one file in double precision, without nodes and elements."""
    nothing = dict.fromkeys(("numnp", "nel8", "nel4", "nel2", "nelt"), 0)
    ids = tuple(range(1, len(PARTS) + 1))
    made = D3plotWriter(
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
    return made.together(states)


def _t01_globals(record: Record) -> Samples:
    """Globals of all states, those that do not apply 0; shape (n, globals)."""
    whole, momentum = _whole(record), record.momentum.sum(axis=1)
    known = {
        1: whole["internal_energy"], 2: whole["kinetic_energy"], 3: momentum.real, 5: momentum.imag,
        6: record.mass + 0 * record.time, 7: record.dt + 0 * record.time,
        9: record.external_work - record.wall_energy - record.damping_energy,
        11: record.friction_energy, 14: record.friction_energy,
    }  # fmt: skip
    nothing = 0 * record.time
    return np.stack(
        [known.get(code, nothing) for code in range(1, _GLOBALS + 1)], axis=1
    )


def _masses() -> tuple[float, float]:
    structure = build_structure(Parameters())
    return float(structure.masses[: structure.of_box].sum()), float(
        structure.masses[structure.of_box :].sum()
    )


if __name__ == "__main__":
    for name, content in files(
        simulate(Parameters(), T_END, interval=INTERVAL)
    ).items():
        (ROOT / "sample_data" / name).write_bytes(content)
