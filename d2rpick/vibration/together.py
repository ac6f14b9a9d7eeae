"""Many td of one record at once: what td have in common whose oscillator is the same is found in one go on arrays."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from d2rpick.vibration import measures
from d2rpick.vibration.of_modes import OfModes, measured, spread
from d2rpick.vibration.one_mode import Mode

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from d2rpick.histories.history import Samples
    from d2rpick.vibration.model import Vibration
    from d2rpick.vibration.moments import Measured, Moment

# Numbers in an array, at most: beyond, arrays leave the cache, and would fill the memory in the end.
_MOST: Final = 50_000


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
    passed: dict[int, Samples] = {}
    for places, mode, alike in _alike(vibrations):
        swings = 1 + (max(one.td for one in alike) - alike[0].before) * mode.omega / np.pi
        for some in _split(len(places), swings):
            td = np.array([one.td for one in alike[some]])
            passed |= zip(places[some], mode.all_level_crossings(td, alike[0].before), strict=True)
    return [
        one.moments_with(passed[place], tolerance)
        if place in passed and isinstance(one, OfModes)
        else one.moments(tolerance, since[place])
        for place, one in enumerate(vibrations)
    ]


def measured_of(vibrations: Sequence[Vibration], times: Sequence[Samples]) -> list[Sequence[Measured | None]]:
    """Give the measures of the times of each vibration, as ``Vibration.measured`` does."""
    known: dict[int, Sequence[Measured | None]] = {}
    for places, mode, alike in _alike(vibrations):
        most = max(times[place].size for place in places)
        for some in _split(len(places), most):
            inside = [one.inside(times[place]) for place, one in zip(places[some], alike[some], strict=True)]
            tr = np.concatenate([times[place][here] for place, here in zip(places[some], inside, strict=True)])
            td = np.repeat([one.td for one in alike[some]], [int(here.sum()) for here in inside])
            tolerance = measures.timing_tolerance(mode, tr, td).tolist()
            found = measured(alike[0].fit, mode, tr, td, tolerance)
            known |= {place: spread(found, here) for place, here in zip(places[some], inside, strict=True)}
    return [known[i] if i in known else one.measured(times[i]) for i, one in enumerate(vibrations)]


def _alike(vibrations: Sequence[Vibration]) -> Iterator[tuple[list[int], Mode, list[OfModes]]]:
    """Give the places of vibrations of one single mode in one window, and these vibrations."""
    groups: dict[tuple[int, float], list[int]] = {}
    for place, one in enumerate(vibrations):
        if isinstance(one, OfModes) and isinstance(one.mode, Mode):
            groups.setdefault((id(one.fit), one.span.start), []).append(place)
    for places in groups.values():
        alike = [one for one in (vibrations[place] for place in places) if isinstance(one, OfModes)]
        mode = alike[0].mode
        assert isinstance(mode, Mode)
        yield places, mode, alike


def _split(count: int, size: float) -> Iterator[slice]:
    """Give slices of ``count`` rows with so few of this ``size`` that an array holds them."""
    step = max(1, int(_MOST / max(size, 1.0)))
    yield from (slice(first, first + step) for first in range(0, count, step))
