"""Runs of a few masses as solvers and tables write them: totals, momenta of the model, glstat and matsum."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from tests.text_files import HEAD, glstat_line, matsum_head

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping
    from pathlib import Path

    from d2rpick.histories.history import Samples


class Written(NamedTuple):
    """A run of k masses: ``time`` (n,), ``momentum`` (n, k, 2), energies of each (n, k) and the external ``work`` (n,).

    ``damped`` (n,) is what damping has taken, None where the files do not have it.
    """

    time: Samples
    momentum: Samples
    kinetic: Samples
    internal: Samples
    work: Samples
    masses: Samples
    damped: Samples | None = None


def as_totals(run: Written, folder: Path) -> str:
    """Write a table of kinetic and internal energy."""
    columns = {"time": run.time, "internal_energy": run.internal.sum(axis=1), "kinetic_energy": run.kinetic.sum(axis=1)}
    return _table(columns, folder / "totals.csv")


def as_momenta(run: Written, folder: Path, *, kinetic: bool = True, mass: bool = True) -> str:
    """Write a table of energies and momenta of the model."""
    whole = run.momentum.sum(axis=1)
    columns = {"time": run.time, "internal_energy": run.internal.sum(axis=1)}
    columns |= {"kinetic_energy": run.kinetic.sum(axis=1)} if kinetic else {}
    columns |= {"x_momentum": whole[:, 0], "y_momentum": whole[:, 1], "z_momentum": 0 * run.time}
    columns |= {"mass": np.full(run.time.size, run.masses.sum())} if mass else {}
    return _table(columns, folder / "momenta.csv")


def as_glstat(run: Written, folder: Path, *, kinetic: bool = True, work: bool = True) -> str:
    """Write a glstat."""
    velocity = run.momentum.sum(axis=1) / run.masses.sum()
    taken = np.zeros(run.time.size) if run.damped is None else run.damped
    total = run.kinetic.sum(axis=1) + run.internal.sum(axis=1) + taken
    columns = {"time step": 0 * run.time + 1e-4}
    columns |= {"kinetic energy": run.kinetic.sum(axis=1)} if kinetic else {}
    columns |= {"internal energy": run.internal.sum(axis=1)}
    columns |= {} if run.damped is None else {"system damping energy": run.damped}
    columns |= {"external work": run.work} if work else {}
    columns |= {"total energy": total} if kinetic else {}
    axes = {"global x velocity": velocity[:, 0], "global y velocity": velocity[:, 1], "global z velocity": 0 * run.time}
    columns |= axes
    blocks = [HEAD + b"\n"]
    for state, time in enumerate(run.time.tolist()):
        head = b" dt of cycle%8d is controlled by solid              1 of part         1\n\n" % (24 * state + 1)
        lines = [glstat_line(label, float(values[state])) for label, values in columns.items()]
        blocks += [head, glstat_line("time", time), *lines, b"\n\n"]
    path = folder / "glstat"
    path.write_bytes(b"".join(blocks))
    return str(path)


def as_matsum(run: Written, folder: Path) -> str:
    """Write a matsum with one part for each mass."""
    count = run.masses.size
    text = [matsum_head(range(1, count + 1))]
    still = f"{0.0:13.4E}"
    for state, time in enumerate(run.time.tolist()):
        text.append(f" time ={time:13.4E}\n".encode())
        for part in range(count):
            inner, moving = float(run.internal[state, part]), float(run.kinetic[state, part])
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


def _table(columns: Mapping[str, Samples], path: Path) -> str:
    rows = np.column_stack(list(columns.values())).tolist()
    lines = [",".join(columns), *(",".join(f"{value:.7g}" for value in row) for row in rows)]
    path.write_text("\n".join(lines) + "\n", encoding="ascii")
    return str(path)


WRITERS: Final[Mapping[str, Callable[[Written, Path], str]]] = {
    "totals": as_totals,
    "momenta": as_momenta,
    "glstat": as_glstat,
    "matsum": as_matsum,
}
