"""Fit the cost weights of a site to the CPU times of its own runs.

A restart segment is an engine run of Radioss, or the part of an LS-DYNA run between two restarts. The CPU time per
cycle of each restart segment obeys

    E = sum of w_k n_k,     T = E + b N + r R

where E is the time that the elements need and T the total time [us]. n_k is the number of deformable elements of a
formulation, N the number of nodes, and R the number of rigid-body nodes. The unknowns w_k, b and r are fitted relative
to their default values, which were measured with other runs. Unknowns that the restart segments do not determine keep
their default ratio to the others.
"""

from __future__ import annotations

import hashlib
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from d2rpick.base.data_classes import dataclass
from d2rpick.base.errors import Caution, ConfigurationError, DeckError, FormatError
from d2rpick.choice.parts.cost import (
    ELEMENT_SHARE,
    MEASURED,
    POINT,
    RIGID_NODE,
    Weights,
)
from d2rpick.deck import find_main_decks, ls_dyna_inventory, radioss_inventory
from d2rpick.deck.ls_dyna_columns import TERMINATION
from d2rpick.deck.ls_dyna_parts import read_parts
from d2rpick.deck.radioss_files import list_run_files
from d2rpick.deck.radioss_run import find_run_windows, read_run
from d2rpick.deck.reader import Deck, read_deck
from d2rpick.deck.switching import find_windows, read_switching
from d2rpick.histories.listings import (
    Timing,
    ZoneTimes,
    is_glstat,
    read_timing,
    read_zone_times,
)

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from numpy.typing import NDArray

    from d2rpick.deck.model import Inventory
    from d2rpick.histories.history import Samples

# Ratio of the relative errors assumed for CPU times (5 %) and for weight ratios (50 %) [-].
_DOUBT: Final = 0.1
# Restart segments determine a weight if they contribute at least this fraction of its value [-].
_TOLD: Final = 0.5
_REST, _RIGID = "rest", "rigid node"

# Microseconds per second.
_US: Final = 1e6


class Observation(NamedTuple):
    """The CPU time per cycle of a restart segment [us], and the elements and nodes computed in the segment.

    ``counts`` contains the number of deformable elements by class. ``total`` is the CPU time of all work, and
    ``elements`` that of the elements; it is None if the solver writes only the total.
    """

    name: str
    counts: Mapping[str, float]
    nodes: int
    rigid_nodes: float
    total: float
    elements: float | None


@dataclass(frozen=True)
class FittedWeights:
    """The fitted weights, and the number of restart segments that determine each weight.

    ``told`` lists the unknowns that the restart segments determine, and ``misfit`` is the relative rms misfit [-].
    """

    weights: Weights
    told: tuple[str, ...]
    misfit: float
    legs: tuple[Observation, ...]
    cautions: tuple[Caution, ...] = ()


def fit_weights(observations: Sequence[Observation]) -> FittedWeights:
    """Fit weights to the CPU times of restart segments, some of which have rigid parts.

    Raises
    ------
    ConfigurationError
        If there is no restart segment without rigid parts, or if no element belongs to a class with a default weight.
    """
    deformable = [
        observation for observation in observations if not observation.rigid_nodes
    ]
    names = set[str]()
    for observation in observations:
        names.update(name for name, count in observation.counts.items() if count)
    classes = sorted(names & MEASURED.keys())
    if not deformable or not classes:
        raise ConfigurationError(
            "no run without rigid parts has elements of a known formulation; give such a run too"
        )
    start = _make_start_values(deformable, classes)
    matrix, right_side = _build_equations(observations, classes)
    scaled = matrix * start / right_side[:, np.newaxis]
    solution, is_determined = _solve_equations(scaled)
    values = dict(
        zip((*classes, _REST, _RIGID), (solution * start).tolist(), strict=True)
    )
    share = [_compute_element_share(observation, values) for observation in deformable]
    weights = Weights(
        {name: values[name] for name in classes}, float(np.mean(share)), values[_RIGID],
        f"calibrated with {len(observations)} solver runs",
    )  # fmt: skip
    misfit = float(np.sqrt(np.mean((scaled @ solution - 1) ** 2)))
    unknowns = (*classes, _REST, _RIGID)
    return FittedWeights(
        weights,
        tuple(np.array(unknowns)[is_determined].tolist()),
        misfit,
        tuple(observations),
    )


def _make_start_values(
    deformable: Sequence[Observation], classes: Sequence[str]
) -> Samples:
    """Return starting values: weights scaled to these runs, remaining cost per node, and cost per rigid-body node."""
    measured = [
        sum(MEASURED[name] * observation.counts.get(name, 0.0) for name in classes)
        for observation in deformable
    ]
    elements = [
        ELEMENT_SHARE * observation.total
        if observation.elements is None
        else observation.elements
        for observation in deformable
    ]
    scale = float(np.median(np.array(elements) / np.array(measured)))
    rests = [
        max(observation.total - spent, 1e-6 * observation.total)
        for observation, spent in zip(deformable, elements, strict=True)
    ]
    per_node = float(
        np.median(np.array(rests) / [observation.nodes for observation in deformable])
    )
    return np.array(
        [*(scale * MEASURED[name] for name in classes), per_node, scale * RIGID_NODE]
    )


def _build_equations(
    observations: Sequence[Observation], classes: Sequence[str]
) -> tuple[Samples, Samples]:
    """Return the matrix and the right-hand side of the equations for all restart segments."""
    rows, right_side = [], []
    for observation in observations:
        counts = [observation.counts.get(name, 0.0) for name in classes]
        if observation.elements is not None and any(counts):
            rows.append([*counts, 0.0, 0.0])
            right_side.append(observation.elements)
        rows.append([*counts, float(observation.nodes), float(observation.rigid_nodes)])
        right_side.append(observation.total)
    return np.array(rows), np.array(right_side)


def _solve_equations(scaled: Samples) -> tuple[Samples, NDArray[np.bool_]]:
    """Solve the non-negative least-squares problem; return all unknowns, and those that the rows determine.

    Unknowns that the rows do not determine are 1.
    """
    from scipy.optimize import lsq_linear

    normal = scaled.T @ scaled
    resolution = np.linalg.solve(normal + _DOUBT**2 * np.eye(len(normal)), normal)
    is_determined = np.diag(resolution) > _TOLD
    solution = np.ones(len(normal))
    if is_determined.any():
        right_side = 1 - scaled[:, ~is_determined].sum(axis=1)
        solution[is_determined] = lsq_linear(
            scaled[:, is_determined], right_side, bounds=(0.0, np.inf)
        ).x
    return solution, is_determined


def _compute_element_share(
    observation: Observation, values: Mapping[str, float]
) -> float:
    """Return the fraction of the CPU time of a step that is due to elements [-]."""
    spent = sum(
        values.get(name, 0.0) * count for name, count in observation.counts.items()
    )
    elements = spent if observation.elements is None else observation.elements
    return min(1.0, elements / observation.total)


class _RigidPart(NamedTuple):
    """A part that is rigid from ``tr`` to ``td`` [time]."""

    part: int
    tr: float
    td: float


def read_observations_of_runs(
    folders: Sequence[str],
) -> tuple[tuple[Observation, ...], tuple[Caution, ...]]:
    """Read the CPU times of the restart segments of several runs. Files with equal content are used only once.

    Raises
    ------
    DeckError, FormatError
        The errors are those of ``read_observations``.
    """
    legs_by_content: dict[str, tuple[Observation, ...]] = {}
    cautions = []
    for folder in folders:
        by_file: dict[str, list[Observation]] = {}
        for observation in read_observations(folder):
            by_file.setdefault(observation.name, []).append(observation)
        for name, legs in by_file.items():
            with Path(name).open("rb") as stream:
                content = hashlib.file_digest(stream, "sha256").hexdigest()
            if content in legs_by_content:
                same = legs_by_content[content][0].name
                if Path(same).samefile(name):
                    reason = "is given twice"
                else:
                    reason = f"has the content of {same}"
                cautions.append(
                    Caution("same-leg-twice", f"{name} {reason}; it is used once")
                )
            else:
                legs_by_content[content] = tuple(legs)
    observations = tuple(chain.from_iterable(legs_by_content.values()))
    return observations, tuple(dict.fromkeys(cautions))


def read_observations(folder: str) -> tuple[Observation, ...]:
    """Read the CPU times of the restart segments of the run in a folder.

    Parameters
    ----------
    folder : str
        Folder with the deck of one run and its Radioss listings, d3hsp or glstat.

    Raises
    ------
    DeckError
        If the folder does not contain exactly one main deck.
    FormatError
        If no file contains CPU times of the run.
    """
    if Path(folder).is_file():
        raise DeckError(
            f"{folder}: this is a file, but the folder of one run was expected; give the folder that contains it"
        )
    if not Path(folder).exists():
        raise DeckError(
            f"{folder}: no such folder; give the folder that contains the deck and the listings of one run"
        )
    decks = find_main_decks(
        folder, "give the folder that contains the deck and the listings of one run"
    )
    if len(decks) != 1:
        raise DeckError(
            f"{folder}: {len(decks)} main decks were found, but exactly one was expected; give the folder of one run"
        )
    observations = tuple(
        _read_radioss_observations(decks[0])
        if list_run_files(decks[0])
        else _read_ls_dyna_observations(decks[0])
    )
    if not observations:
        wanted = "a listing NAME_0001.out of Radioss, d3hsp or glstat was expected; add it to the folder"
        raise FormatError(
            f"{folder}: no file contains the CPU time of the run; {wanted}"
        )
    return observations


def _read_radioss_observations(deck: str) -> Iterator[Observation]:
    """Read the CPU times of a Radioss run from the listings of its engine runs."""
    run = read_run(deck)
    inventory = radioss_inventory.read_radioss_inventory(run)
    windows = find_run_windows(run).windows.windows
    rigid = [
        _RigidPart(switched.unit.id, switched.tr, switched.td or np.inf)
        for switched in windows
        if not switched.unit.is_body
    ]
    start = 0.0
    for leg in run.legs:
        listing = Path(deck).parent / f"{leg.name}_{leg.number:04d}.out"
        middle = (start + leg.stop.value) / 2
        start = leg.stop.value
        if listing.is_file():
            parts = {
                switched.part
                for switched in rigid
                if switched.tr <= middle < switched.td
            }
            yield _make_observation(
                read_timing(str(listing)), inventory, dict.fromkeys(parts, 1.0)
            )


def _read_ls_dyna_observations(deck: str) -> Iterator[Observation]:
    """Read the CPU times of an LS-DYNA run from d3hsp and glstat."""
    content = read_deck(deck)
    inventory = ls_dyna_inventory.read_ls_dyna_inventory(content)
    windows = find_windows(read_switching(content), read_parts(content)).windows
    rigid = [
        _RigidPart(switched.part, switched.tr, switched.td or np.inf)
        for switched in windows
        if switched.part is not None
    ]
    folder = Path(deck).parent
    for name in sorted(file.name for file in folder.iterdir() if file.is_file()):
        path = str(folder / name)
        if name == "d3hsp":
            end = _read_termination_time(content)
            if end:
                lasting = {
                    window.part: (min(window.td, end) - window.tr) / end
                    for window in rigid
                }
            else:
                lasting = {}
            if not rigid or end:
                yield _make_observation(read_timing(path), inventory, lasting)
        elif name.startswith("glstat") and is_glstat(path):
            yield from _make_zone_observations(read_zone_times(path), inventory, rigid)


def _read_termination_time(deck: Deck) -> float:
    """Return the termination time of an LS-DYNA run [time]; 0 if it is unknown."""
    cards = deck.named("CONTROL_TERMINATION")
    rows = [row for row in cards[0].rows if not row.blank] if cards else []
    return float(cards[0].real(rows[0], TERMINATION["ENDTIM"]).value) if rows else 0.0


def _make_observation(
    timing: Timing, inventory: Inventory, lasting: Mapping[int, float]
) -> Observation:
    """Return the observation of a restart segment. Each part is rigid for its fraction ``lasting`` of the segment."""
    counts, nodes = _count_computed(inventory, lasting)
    cycle = _US / timing.cycles
    return Observation(
        timing.name,
        counts,
        len(inventory.coordinates),
        nodes,
        timing.total * cycle,
        timing.elements * cycle,
    )


def _make_zone_observations(
    zones: ZoneTimes, inventory: Inventory, rigid: Sequence[_RigidPart]
) -> Iterator[Observation]:
    """Yield one observation for each set of rigid parts: the median CPU time of a cycle while they are rigid."""
    number = sum(counts.total() for counts in inventory.counts.values())
    states: dict[frozenset[int], list[float]] = {}
    for time, per_zone in zip(
        zones.time.tolist(), zones.per_zone.tolist(), strict=True
    ):
        rigid_parts = frozenset(
            part.part for part in rigid if part.tr < time <= part.td
        )
        states.setdefault(rigid_parts, []).append(per_zone)
    for rigid_parts, times in states.items():
        counts, nodes = _count_computed(inventory, dict.fromkeys(rigid_parts, 1.0))
        total = float(np.median(times)) * number * _US
        yield Observation(
            zones.name, counts, len(inventory.coordinates), nodes, total, None
        )


def _count_computed(
    inventory: Inventory, lasting: Mapping[int, float]
) -> tuple[dict[str, float], float]:
    """Return the average numbers of deformable elements and integration points by class, and of rigid-body nodes."""
    always = inventory.rigid_parts
    computed: dict[str, float] = {}
    _add_counts(
        computed,
        inventory,
        {
            part: counts
            for part, counts in inventory.counts.items()
            if part not in always
        },
        1.0,
    )
    nodes = 0.0
    for fraction in sorted(set(lasting.values())):
        parts = [part for part, value in lasting.items() if value == fraction]
        nodes += fraction * inventory.rigid_nodes(parts)
        elements = inventory.elements_within(parts)
        _add_counts(
            computed,
            inventory,
            {part: counts for part, counts in elements.items() if part not in always},
            -fraction,
        )
    return computed, nodes


def _add_counts(
    into: dict[str, float],
    inventory: Inventory,
    counts: Mapping[int, Mapping[str, int]],
    times: float,
) -> None:
    """Add the numbers of elements of known cost, multiplied by ``times``, to the counts by class."""
    for part, kinds in counts.items():
        for kind, count in kinds.items():
            cost = inventory.formulation(part, kind).cost
            further = inventory.further_points(part, kind)
            if cost is not None:
                into[cost] = into.get(cost, 0.0) + times * count
            if cost is not None and further:
                into[POINT] = into.get(POINT, 0.0) + times * count * further
