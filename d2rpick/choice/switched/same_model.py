"""Check that a switched run and its reference run have the same parts, and agree while both are deformable."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from d2rpick.base.errors import RangeError, list_names
from d2rpick.choice.parts.deck_of_run import is_different_title
from d2rpick.choice.switched.frozen import FEWEST
from d2rpick.flight.internal_energy import round_off

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from d2rpick.histories.history import History
    from d2rpick.histories.names import Part
    from d2rpick.histories.run import OpenedRun

# Runs belong to the same model if their energies before the switch differ by at most this fraction [-].
_OF_ANOTHER_MODEL: Final = 0.2
# The masses of a part in two runs of one model differ by at most this fraction [-], for example by mass scaling.
_MOST_MASS_ERROR: Final = 0.2
# DIFFERENT_MODELS: beginning of an objection if the files show that two runs belong to different models.
# UNKNOWN_DIFFERENCE: beginning of an objection if two runs differ and the files do not show why.
DIFFERENT_MODELS: Final = "the runs belong to different models"
UNKNOWN_DIFFERENCE: Final = (
    "these are not two runs of one model with the same loads and velocities"
)
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
        f"{', '.join(switched.sources)}: {DIFFERENT_MODELS}: part {part.id} is {titles}; give the switched run of this "
        "model"
    )


def check_same_model(
    reference: History,
    switched: History,
    first_rigid: float,
    explain: Callable[[], str] = str,
) -> Iterator[str]:
    """Yield an objection if the energies of two runs differ before the first state that may be rigid [time].

    ``explain`` returns what else is known of the two models, for example by `explain_difference`.
    """
    difference = _measure_difference(reference, switched, -np.inf, first_rigid)
    if difference > _OF_ANOTHER_MODEL:
        yield (
            f"{explain() or UNKNOWN_DIFFERENCE}: the energies of the two runs differ by {difference:.0%} before "
            f"{first_rigid:.6g}, when both are deformable{_compare_kinetic_energies(reference, switched)}"
        )


def _compare_kinetic_energies(reference: History, switched: History) -> str:
    """Return the kinetic energies at the start if they differ, so that the velocities differ; otherwise empty."""
    start = max(reference.start, switched.start)
    energies = [
        float(np.interp(start, history.balance.time, history.balance.kinetic))
        for history in (reference, switched)
        if history.balance is not None and history.balance.kinetic is not None
    ]
    largest = max(energies, default=0.0)
    if len(energies) < len((reference, switched)) or not largest:
        return ""
    expected, found = energies
    if abs(expected - found) <= _OF_ANOTHER_MODEL * largest:
        return ""
    return (
        f" (kinetic energy at {start:.6g}: {expected:.4g} in the reference run, {found:.4g} in the switched "
        "run)"
    )


def explain_difference(reference: OpenedRun, switched: OpenedRun) -> str:
    """Return whether two runs with different energies belong to the same model; empty if the files do not show it.

    Parts and their masses decide. The titles of the runs are only a sign, because a user may edit the title of a
    switched run.
    """
    parts = {part.id: part for part in reference.parts}
    others = {part.id for part in switched.parts}
    absent = [part for part in reference.parts if part.id not in others]
    further = [part for part in switched.parts if part.id not in parts]
    if parts and others and absent and further:
        return (
            f"{DIFFERENT_MODELS} (only the reference run has {_name_part(absent[0])}, only the switched run "
            f"{_name_part(further[0])})"
        )
    masses = _pair_masses(reference, switched)
    for id_, expected, mass in masses:
        if abs(mass - expected) > _MOST_MASS_ERROR * expected:
            return (
                f"{DIFFERENT_MODELS} (the mass of {_name_part(parts[id_])} is {expected:.4g} in the reference run and "
                f"{mass:.4g} in the switched run)"
            )
    titles = [run.databases[0].title for run in (reference, switched)]
    if all(titles) and is_different_title(*titles):
        return f"{DIFFERENT_MODELS}, it seems (the titles are {titles[0]!r} and {titles[1]!r})"
    if masses:
        return "the loads or velocities differ, but the masses of the parts do not"
    return ""


def _name_part(part: Part) -> str:
    """Return the id of a part with its title."""
    return f"part {part.id}{f' {part.title!r}' * bool(part.title)}"


def _pair_masses(
    reference: OpenedRun, switched: OpenedRun
) -> list[tuple[int, float, float]]:
    """Return the id of each common part with its masses in both runs, as far as they are known [mass]."""
    masses = []
    for run in (reference, switched):
        values = () if run.masses is None else run.masses.tolist()
        known = zip(run.parts, values, strict=False)
        masses.append({part.id: mass for part, mass in known if mass > 0})
    first, second = masses
    return [(id_, mass, second[id_]) for id_, mass in first.items() if id_ in second]


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
