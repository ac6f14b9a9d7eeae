"""Write runs of a few masses in the formats of solvers and as tables."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from tests.made_binout import LsdaWriter
from tests.made_t01 import MadePart, write_head
from tests.text_files import HEAD, format_glstat_line, make_matsum_head

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping
    from pathlib import Path

    from d2rpick.histories.history import Samples


class Written(NamedTuple):
    """Run of k masses: ``time`` (n,), ``momentum`` (n, k, 2), energies of each (n, k) and the external ``work`` (n,).

    ``damped`` (n,) is the energy that damping has dissipated.
    """

    time: Samples
    momentum: Samples
    kinetic: Samples
    internal: Samples
    work: Samples
    masses: Samples
    damped: Samples


def as_totals(run: Written, folder: Path) -> str:
    """Write a table of kinetic and internal energy."""
    columns = {
        "time": run.time,
        "internal_energy": run.internal.sum(axis=1),
        "kinetic_energy": run.kinetic.sum(axis=1),
    }
    return _table(columns, folder)


def as_momenta(run: Written, folder: Path, *, kinetic: bool = True) -> str:
    """Write a table of energies, momenta and mass of the model."""
    return _table(
        _of_momenta(run, kinetic=kinetic)
        | {"mass": np.full(run.time.size, run.masses.sum())},
        folder,
    )


def as_momenta_alone(run: Written, folder: Path, *, kinetic: bool = True) -> str:
    """Write a table of energies and momenta of the model, without its mass."""
    return _table(_of_momenta(run, kinetic=kinetic), folder)


def _of_momenta(run: Written, *, kinetic: bool) -> dict[str, Samples]:
    whole = run.momentum.sum(axis=1)
    columns = {"time": run.time, "internal_energy": run.internal.sum(axis=1)}
    columns |= {"kinetic_energy": run.kinetic.sum(axis=1)} if kinetic else {}
    return columns | {
        "x_momentum": whole[:, 0],
        "y_momentum": whole[:, 1],
        "z_momentum": 0 * run.time,
    }


def as_glstat(run: Written, folder: Path, *, kinetic: bool = True) -> str:
    """Write a glstat."""
    blocks = [HEAD + b"\n"]
    columns = _of_glstat(run, kinetic=kinetic)
    for state, time in enumerate(run.time.tolist()):
        head = (
            b" dt of cycle%8d is controlled by solid              1 of part         1\n\n"
            % (24 * state + 1)
        )
        lines = [
            format_glstat_line(name.replace("_", " "), float(values[state]))
            for name, values in columns.items()
        ]
        blocks += [head, format_glstat_line("time", time), *lines, b"\n\n"]
    path = folder / "glstat"
    path.write_bytes(b"".join(blocks))
    return str(path)


def as_binout(run: Written, folder: Path, *, kinetic: bool = True) -> str:
    """Write a binout with the branch glstat."""
    writer = LsdaWriter()
    writer.cd("/glstat/metadata")
    writer.put("title", b"made for tests".ljust(80), "i1")
    columns = {"time": run.time} | _of_glstat(run, kinetic=kinetic)
    for state in range(run.time.size):
        writer.cd(f"/glstat/d{state + 1:06d}")
        writer.put("cycle", [state], "i4")
        for name, values in columns.items():
            writer.put(name, [values[state]], "f4")
    writer.table()
    path = folder / "binout"
    path.write_bytes(bytes(writer.data))
    return str(path)


def _of_glstat(run: Written, *, kinetic: bool) -> dict[str, Samples]:
    velocity = run.momentum.sum(axis=1) / run.masses.sum()
    moving, inner = run.kinetic.sum(axis=1), run.internal.sum(axis=1)
    columns = {"time_step": 0 * run.time + 1e-4}
    columns |= {"kinetic_energy": moving} if kinetic else {}
    columns |= {
        "internal_energy": inner,
        "system_damping_energy": run.damped,
        "external_work": run.work,
    }
    columns |= {"total_energy": moving + inner + run.damped} if kinetic else {}
    axes = {"global_x_velocity": velocity[:, 0], "global_y_velocity": velocity[:, 1]}
    return columns | axes | {"global_z_velocity": 0 * run.time}


def as_t01(run: Written, folder: Path, *, kinetic: bool = True) -> str:
    """Write a T01 with one part for each mass."""
    names = (1, 2, 3, 4, 5, 6) if kinetic else (1, 3, 4, 5, 6)
    parts = [
        MadePart(part_index + 1, f"mass {part_index + 1}", names)
        for part_index in range(run.masses.size)
    ]
    writer = write_head(parts, globals_=12)
    momentum, still = run.momentum.sum(axis=1), [0.0] * 5
    for state, time in enumerate(run.time.tolist()):
        energies = [float(run.internal[state].sum()), float(run.kinetic[state].sum())]
        whole = [
            *energies,
            *momentum[state].tolist(),
            0.0,
            float(run.masses.sum()),
            1e-4,
            0.0,
            float(run.work[state]),
        ]
        of_parts: list[float] = []
        for part, mass in enumerate(run.masses.tolist()):
            inner, moving = (
                float(run.internal[state, part]),
                float(run.kinetic[state, part]),
            )
            of_parts += [inner, moving] if kinetic else [inner]
            of_parts += [*run.momentum[state, part].tolist(), 0.0, mass]
        writer.state(time, whole + still[:3], of_parts)
    path = folder / "runT01"
    path.write_bytes(bytes(writer.data))
    return str(path)


def as_matsum(run: Written, folder: Path) -> str:
    """Write a matsum with one part for each mass."""
    count = run.masses.size
    text = [make_matsum_head(range(1, count + 1))]
    still = f"{0.0:13.4E}"
    for state, time in enumerate(run.time.tolist()):
        text.append(f" time ={time:13.4E}\n".encode())
        for part in range(count):
            inner, moving = (
                float(run.internal[state, part]),
                float(run.kinetic[state, part]),
            )
            x, y = run.momentum[state, part].tolist()
            text.append(
                f" mat.#={part + 1:5d}             inten={inner:13.4E}     kinen={moving:13.4E}"
                f"     eroded_ie={still}     eroded_ke={still}\n"
                f" x-mom={x:13.4E}     y-mom={y:13.4E}     z-mom={still}\n"
                f" x-rbv={still}     y-rbv={still}     z-rbv={still}\n"
                f"                         hgeng={still}\n\n\n".encode()
            )
    path = folder / "matsum"
    path.write_bytes(b"".join(text))
    return str(path)


def _table(columns: Mapping[str, Samples], folder: Path) -> str:
    rows = np.column_stack(list(columns.values())).tolist()
    lines = [
        ",".join(columns),
        *(",".join(f"{value:.7g}" for value in row) for row in rows),
    ]
    path = folder / "run.csv"
    path.write_text("\n".join(lines) + "\n", encoding="ascii")
    return str(path)


WRITERS: Final[Mapping[str, Callable[[Written, Path], str]]] = {
    "totals": as_totals,
    "momenta": as_momenta,
    "glstat": as_glstat,
    "matsum": as_matsum,
}
FALL_WRITERS: Final = {
    "table": as_momenta,
    "massless": as_momenta_alone,
    "glstat": as_glstat,
    "binout": as_binout,
    "t01": as_t01,
}
