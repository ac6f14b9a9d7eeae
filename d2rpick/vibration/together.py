"""Many td of one record at once: what td have in common whose oscillator is the same is found in one go on arrays."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from d2rpick.vibration import measures
from d2rpick.vibration.modes import Mode
from d2rpick.vibration.of_modes import OfModes, measured, spread

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from d2rpick.histories.history import Samples
    from d2rpick.vibration.measures import Measured
    from d2rpick.vibration.model import Vibration
    from d2rpick.vibration.moments import Moment


def moments_of(vibrations: Sequence[Vibration], tolerance: float, since: Sequence[float]) -> list[Sequence[Moment]]:
    """Give the moments of each vibration, as ``Vibration.moments`` does.

    Parameters
    ----------
    vibrations : sequence of length n
    tolerance : float
        [-]
    since : sequence of length n
        [time]
    """
    known: dict[int, Sequence[Moment]] = {}
    for mode, alike in _alike(vibrations):
        models = list(alike.values())
        passed = mode.all_level_crossings(np.array([one.td for one in models]), models[0].before)
        found = (one.moments_with(times, tolerance) for one, times in zip(models, passed, strict=True))
        known |= zip(alike, found, strict=True)
    return [known[i] if i in known else one.moments(tolerance, since[i]) for i, one in enumerate(vibrations)]


def measured_of(vibrations: Sequence[Vibration], times: Sequence[Samples]) -> list[Sequence[Measured | None]]:
    """Give the measures of the times of each vibration, as ``Vibration.measured`` does."""
    known: dict[int, Sequence[Measured | None]] = {}
    for mode, alike in _alike(vibrations):
        inside = {place: one.inside(times[place]) for place, one in alike.items()}
        tr = np.concatenate([times[place][here] for place, here in inside.items()])
        td = np.repeat([one.td for one in alike.values()], [int(here.sum()) for here in inside.values()])
        tolerance = measures.timing_tolerance(mode, tr, td)
        found = measured(next(iter(alike.values())).fit, mode, tr, td, tolerance)
        known |= {place: spread(found, here) for place, here in inside.items()}
    return [known[i] if i in known else one.measured(times[i]) for i, one in enumerate(vibrations)]


def _alike(vibrations: Sequence[Vibration]) -> Iterator[tuple[Mode, dict[int, OfModes]]]:
    """Give each single mode with the vibrations, by their places, that it describes in one window."""
    groups: dict[tuple[int, float], dict[int, OfModes]] = {}
    modes: dict[tuple[int, float], Mode] = {}
    for place, one in enumerate(vibrations):
        if isinstance(one, OfModes) and isinstance(one.mode, Mode):
            key = id(one.fit), one.span.start
            groups.setdefault(key, {})[place] = one
            modes[key] = one.mode
    yield from ((modes[key], group) for key, group in groups.items())
