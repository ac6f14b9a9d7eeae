"""Check that a switched run and its reference run have the same parts, and agree while both are deformable."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from d2rpick.base.errors import RangeError, list_names
from d2rpick.choice.parts.deck_of_run import is_different_title
from d2rpick.choice.switched.frozen import FEWEST
from d2rpick.flight.internal_energy import round_off

if TYPE_CHECKING:
    from collections.abc import Iterator

    from d2rpick.histories.history import History
    from d2rpick.histories.run import OpenedRun

# Runs belong to the same model if their energies before the switch differ by at most this fraction [-].
_OF_ANOTHER_MODEL: Final = 0.2
# The motions of both runs are treated as equal if the momenta differ by at most this fraction [-].
MOST_MOMENTUM_ERROR: Final = 0.05


def refuse_other_model(reference: OpenedRun, switched: OpenedRun) -> None:
    """Raise RangeError if most of the parts with the same id have different titles in the two runs."""
    parts = {part.id: part for part in reference.parts if part.title}
    pairs = [
        (parts[part.id], part)
        for part in switched.parts
        if part.id in parts and part.title
    ]
    differing = [
        (expected, part)
        for expected, part in pairs
        if is_different_title(expected.title, part.title)
    ]
    if 2 * len(differing) <= len(pairs):
        return
    expected, part = differing[0]
    titles = f"{expected.title!r} in the reference run and {part.title!r} in the switched run"
    raise RangeError(
        f"{', '.join(switched.sources)}: runs of different models: part {part.id} is {titles}; give the switched run "
        "of this model"
    )


def check_same_model(
    reference: History, switched: History, first_rigid: float
) -> Iterator[str]:
    """Yield an objection if the energies of two runs differ before the first state that may be rigid [time]."""
    difference = _measure_difference(reference, switched, -np.inf, first_rigid)
    if difference > _OF_ANOTHER_MODEL:
        yield (
            f"the energies of the two runs differ by {difference:.0%} before {first_rigid:.6g}, when both are "
            "deformable, so they seem to be runs of different models"
        )


def check_before_window(
    reference: History,
    switched: History,
    start: float,
    first_rigid: float,
    momentum_error: float | None,
) -> Iterator[str]:
    """Yield an objection if two runs differ from ``start`` to the first rigid state, after an earlier window [time].

    ``momentum_error`` is the relative error of the momentum in this time [-]; None if it is unknown.
    """
    differences = {
        "energies": (
            _measure_difference(reference, switched, start, first_rigid),
            _OF_ANOTHER_MODEL,
        ),
        "momenta": (momentum_error or 0.0, MOST_MOMENTUM_ERROR),
    }
    differing = [
        f"their {name} by {difference:.0%}"
        for name, (difference, limit) in differences.items()
        if difference > limit
    ]
    if differing:
        yield (
            f"the two runs differ already before tr, from {start:.6g} to {first_rigid:.6g}, {list_names(differing)}, "
            "because of an earlier rigid window: compare this window with a run that is rigid only in the earlier ones"
        )


def _measure_difference(
    reference: History, switched: History, start: float, end: float
) -> float:
    """Return the largest difference of the energies of two runs relative to the largest energy of the reference run.

    Only times between two states of the switched run that lie strictly between ``start`` and ``end`` [time] are
    compared. The result is 0 if there are too few of them, or if the energies are only round-off [-].
    """
    states = switched.time[(switched.time > start) & (switched.time < end)]
    if not states.size:
        return 0.0
    first = max(reference.start, float(states[0]))
    time, energy = reference.between(first, float(states[-1]))
    largest = float(np.abs(energy).max(initial=0.0))
    if time.size < FEWEST or largest <= round_off(reference):
        return 0.0
    return float(np.abs(switched.energies_at(time) - energy).max()) / largest
