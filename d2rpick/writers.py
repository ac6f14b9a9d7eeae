"""Histories as files that d2rpick and others read: CSV at full precision, glstat as a solver writes it."""

from __future__ import annotations

from pathlib import PurePath
from typing import TYPE_CHECKING, Final

from d2rpick import __version__
from d2rpick.errors import FormatError
from d2rpick.report.tables import as_csv

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from d2rpick.replay import Trajectory

_COLUMNS: Final = ("time", "z", "y", "vz", "vy", "internal_energy", "kinetic_energy")
# No version of the solver wrote this; the word alone lets programs recognise the layout.
_GLSTAT_HEAD: Final = f" floating oscillator\n{' ' * 25}d2rpick {__version__}, layout of ls-dyna glstat\n\n\n"


def trajectory_csv(motion: Trajectory) -> str:
    """Columns time z y vz vy internal_energy kinetic_energy, in the shortest digits that read back."""
    columns = (motion.time, *motion.state, motion.internal_energy, motion.kinetic_energy)
    return as_csv(_COLUMNS, zip(*(column.tolist() for column in columns), strict=True))


def trajectory_glstat(motion: Trajectory) -> str:
    """Blocks of ``label....... value`` with six significant digits (14 columns, E14.5)."""
    step = float(motion.time[1] - motion.time[0]) if motion.time.size > 1 else 0.0
    columns = (motion.time, motion.kinetic_energy, motion.internal_energy)
    blocks = (
        f" dt of cycle{cycle:8d} is controlled by solid              1 of part         1\n\n"
        + _line("time", time)
        + _line("time step", step)
        + _line("kinetic energy", kinetic)
        + _line("internal energy", internal)
        + _line("total energy", kinetic + internal)
        for cycle, (time, kinetic, internal) in enumerate(zip(*(c.tolist() for c in columns), strict=True), start=1)
    )
    return _GLSTAT_HEAD + "\n\n".join(blocks)


WRITERS: Final[Mapping[str, Callable[[Trajectory], str]]] = {
    "csv": trajectory_csv,
    "glstat": trajectory_glstat,
}


def format_of(name: str | None) -> str:
    """Tell the format that a file's name asks for; csv without a name, FormatError when it asks for neither.

    Examples
    --------
    >>> format_of("switched.csv"), format_of("run1.glstat"), format_of(None)
    ('csv', 'glstat', 'csv')
    """
    lower = "" if name is None else PurePath(name).name.lower()
    if "glstat" in lower:
        return "glstat"
    if name is None or lower.endswith(".csv"):
        return "csv"
    raise FormatError(f"{name}: the name tells no format; give --write-as {' or '.join(WRITERS)}")


def _line(label: str, value: float) -> str:
    return f" {label:.<31}{value:14.5E}\n"
