"""Runs of the falling planar box, as LS-DYNA files."""

from functools import cache
from pathlib import Path

from d2rpick.models.box_model import Parameters
from d2rpick.models.box_run import BoxWindow, Record, simulate
from d2rpick.report import history_files

MESH = 6  # elements per edge; coarse, for speed
T_END = 1.2


@cache
def drop(
    *windows: tuple[float, float],
    height: float = 0.4,
    tilt: float = 30.0,
    interval: float = 8e-4,
) -> Record:
    """Compute a run that is rigid in ``windows`` (tr, td) [s]."""
    parameters = Parameters(speed=0.0, drop=height, tilt=tilt, mesh=MESH)
    return simulate(
        parameters,
        T_END,
        *(BoxWindow(*window) for window in windows),
        interval=interval,
    )


def write_run_files(record: Record, folder: Path) -> list[str]:
    """Write the matsum and glstat of a run and return their names."""
    folder.mkdir(parents=True, exist_ok=True)
    names = []
    for form in ("matsum", "glstat"):
        path = folder / form
        path.write_bytes(history_files.BOX_WRITERS[form](record))
        names.append(str(path))
    return names
