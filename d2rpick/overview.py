"""What the files of a run hold, before anything is chosen from them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from d2rpick.momentum import FreeFlight, all_flights
from d2rpick.readers.selection import select_parts

if TYPE_CHECKING:
    from d2rpick.history import Part
    from d2rpick.readers import Run, Selection


@dataclass(frozen=True)
class PartOverview:
    """A part and the highest internal energy it ever has; None where that is not written."""

    part: Part
    energy_max: float | None


@dataclass(frozen=True)
class Sampling:
    """Output intervals [time]."""

    min: float
    median: float
    max: float


@dataclass(frozen=True)
class Overview:
    """What the files of a run hold.

    Times in the unit of the run, which ``time_unit`` gives only where a file names it.  ``sampling`` is None where
    there is a single state.  ``flights`` are the windows in which the parts asked for, or all, fly freely by their
    momentum.
    """

    source: tuple[str, ...]
    format: str
    version: str
    title: str
    states: int
    time_start: float
    time_end: float
    time_unit: str
    sampling: Sampling | None
    complete: bool
    channels: tuple[str, ...]
    parts: tuple[PartOverview, ...]
    flights: tuple[FreeFlight, ...]
    notes: tuple[str, ...]


def survey(run: Run, selection: Selection) -> Overview:
    """Look at all databases of a run; of ``selection`` the parts matter, for the flights."""
    first = run.databases[0]
    time = first.time if first.channels else first.part_time
    steps = np.diff(time)
    return Overview(
        source=run.sources,
        format=" + ".join(database.format for database in run.databases),
        version=next((d.version for d in run.databases if d.version), ""),
        title=next((d.title for d in run.databases if d.title), ""),
        states=int(time.size),
        time_start=float(time[0]),
        time_end=float(time[-1]),
        time_unit=first.time_unit,
        sampling=Sampling(float(steps.min()), float(np.median(steps)), float(steps.max())) if steps.size else None,
        complete=all(database.complete for database in run.databases),
        channels=tuple(dict.fromkeys(name for database in run.databases for name in database.channels)),
        parts=tuple(_overviews(run)),
        flights=_flights(run, selection),
        notes=run.notes,
    )


def _overviews(run: Run) -> list[PartOverview]:
    if not run.parts:
        return []
    highest = run.part_energies(run.parts).max(axis=0)
    return [PartOverview(part, float(energy)) for part, energy in zip(run.parts, highest, strict=True)]


def _flights(run: Run, selection: Selection) -> tuple[FreeFlight, ...]:
    parts = select_parts(selection.parts, run.parts, run.name) if selection.parts else None
    flying = select_parts(selection.flying, run.parts, run.name) if selection.flying else None
    found = (all_flights(momenta) for momenta in run.momenta(parts, flying))
    return next(filter(None, found), ())
