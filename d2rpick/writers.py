"""Histories as files that others read: CSV and HDF5 at full precision, glstat and matsum as solvers write them."""

from __future__ import annotations

import io
from pathlib import PurePath
from typing import TYPE_CHECKING, Final

from d2rpick import __version__
from d2rpick.errors import FormatError
from d2rpick.report.tables import as_csv

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from d2rpick.history import Samples
    from d2rpick.oscillator import Oscillator
    from d2rpick.replay import Trajectory

Table = dict[str, "Samples"]

_SUFFIXES: Final = {"csv": "csv", "h5": "hdf5", "hdf5": "hdf5", "hdf": "hdf5"}
_TITLE: Final = " floating oscillator"
# No version of the solver wrote this; the word alone lets programs recognise the layout.
_VERSION: Final = f"{' ' * 25}d2rpick {__version__}, layout of ls-dyna"
_FRAME, _SUSPENDED, _SPRING = 1, 2, 3


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


def trajectory_glstat(motion: Trajectory) -> bytes:
    """Blocks of ``label....... value`` with six significant digits (14 columns, E14.5)."""
    step = float(motion.time[1] - motion.time[0]) if motion.time.size > 1 else 0.0
    blocks = (
        f" dt of cycle{cycle:8d} is controlled by solid              1 of part         1\n\n"
        + "".join(
            f" {label:.<31}{value:14.5E}\n"
            for label, value in (
                ("time", time),
                ("time step", step),
                ("kinetic energy", kinetic),
                ("internal energy", internal),
                ("total energy", kinetic + internal),
            )
        )
        for cycle, (time, kinetic, internal) in enumerate(
            _rows(motion.time, motion.kinetic_energy, motion.internal_energy), start=1
        )
    )
    return (f"{_TITLE}\n{_VERSION} glstat\n\n\n" + "\n\n".join(blocks)).encode()


def trajectory_matsum(motion: Trajectory, oscillator: Oscillator) -> bytes:
    """Parts frame, suspended mass and spring with their energies and momenta, five significant digits (E13.4)."""
    frame, suspended, state = oscillator.frame_mass, oscillator.mass, motion.state
    zero = 0.0 * motion.time
    parts = {
        (_FRAME, "frame"): (zero, frame / 2 * state.vz**2, frame * state.vz),
        (_SUSPENDED, "suspended mass"): (zero, suspended / 2 * state.vy**2, suspended * state.vy),
        (_SPRING, "spring"): (motion.internal_energy, zero, zero),
    }
    legend = "".join(f"{number:9d}     {title:<70}\n" for number, title in parts)
    columns = [list(_rows(*columns)) for columns in parts.values()]
    blocks = (
        f"\n time ={time:13.4E}\n"
        + "".join(_matsum_part(number, *rows[i]) for (number, _), rows in zip(parts, columns, strict=True))
        for i, time in enumerate(motion.time.tolist())
    )
    head = f"{_TITLE}\n{_VERSION} matsum\n\n{{BEGIN LEGEND}}\n Entity #        Title\n{legend}{{END LEGEND}}\n"
    return (head + "\n".join(blocks)).encode()


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


def _matsum_part(number: int, internal: float, kinetic: float, momentum: float) -> str:
    return (
        f" mat.#={number:5d}             inten={internal:13.4E}     kinen={kinetic:13.4E}"
        f"     eroded_ie={0:13.4E}     eroded_ke={0:13.4E}\n"
        f" x-mom={0:13.4E}     y-mom={0:13.4E}     z-mom={momentum:13.4E}\n"
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
