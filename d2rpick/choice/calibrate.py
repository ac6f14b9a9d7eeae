"""Weights of a site, fitted to what its own runs took.

With the elements that were computed in a leg, its cycles and its processor time,

    E = sum of w_k n_k,     T = E + b N + r R

per cycle: E of the elements and T of all work [us], n_k deformable elements of a formulation, N nodes, R nodes of rigid
bodies.  Fitted are the w_k, b and r, each relative to its measured value.  What the legs do not tell apart keeps its
measured ratio to the others.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from d2rpick.choice.cost import ELEMENT_SHARE, MEASURED, RIGID_NODE, Weights
from d2rpick.errors import ConfigurationError

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from d2rpick.choice.warnings import Caution
    from d2rpick.histories.history import Samples

# Times of a leg are right within some 5 %, measured ratios of weights within a half: one over the other.
_DOUBT: Final = 0.1
# A weight is told by the legs where, with this doubt, they decide more than half of it.
_TOLD: Final = 0.5
_REST, _RIGID = "rest", "rigid node"


@dataclass(frozen=True)
class Observation:
    """What one leg took per cycle [us], and what it computed.

    ``counts`` are deformable elements by class; ``elements`` is None where the solver gives the total alone.
    """

    name: str
    counts: Mapping[str, float]
    nodes: int
    rigid_nodes: float
    total: float
    elements: float | None


@dataclass(frozen=True)
class Calibration:
    """Weights with what they rest on: ``told`` are the classes that the legs decide, ``misfit`` is relative [-]."""

    weights: Weights
    told: tuple[str, ...]
    misfit: float
    observations: tuple[Observation, ...]
    cautions: tuple[Caution, ...] = ()


def calibrate(observations: Sequence[Observation]) -> Calibration:
    """Fit weights to legs with and without rigid parts.

    Raises
    ------
    ConfigurationError
        If there is no leg without rigid parts, or none of its elements has a class with a measured weight.
    """
    deformable = [one for one in observations if not one.rigid_nodes]
    classes = sorted({name for one in observations for name, count in one.counts.items() if count and name in MEASURED})
    if not deformable or not classes:
        raise ConfigurationError("no leg without rigid parts has elements of a known formulation; give such a run too")
    start = _start(deformable, classes)
    matrix, right = _rows(observations, classes)
    scaled = matrix * start / right[:, np.newaxis]
    found, told = _solved(scaled)
    values = dict(zip((*classes, _REST, _RIGID), (found * start).tolist(), strict=True))
    share = [_share(one, values) for one in deformable]
    weights = Weights(
        {name: values[name] for name in classes}, float(np.mean(share)), values[_RIGID],
        f"calibrated by {len(observations)} legs",
    )  # fmt: skip
    misfit = float(np.sqrt(np.mean((scaled @ found - 1) ** 2)))
    names = (*classes, _REST, _RIGID)
    return Calibration(weights, tuple(np.array(names)[told].tolist()), misfit, tuple(observations))


def _start(deformable: Sequence[Observation], classes: Sequence[str]) -> Samples:
    """Measured weights in the unit of these runs, then the rest per node, then what a node of a rigid body costs."""
    measured = [sum(MEASURED[name] * one.counts.get(name, 0.0) for name in classes) for one in deformable]
    elements = [ELEMENT_SHARE * one.total if one.elements is None else one.elements for one in deformable]
    scale = float(np.median(np.array(elements) / np.array(measured)))
    rest = [max(one.total - spent, 1e-6 * one.total) for one, spent in zip(deformable, elements, strict=True)]
    per_node = float(np.median(np.array(rest) / [one.nodes for one in deformable]))
    return np.array([*(scale * MEASURED[name] for name in classes), per_node, scale * RIGID_NODE])


def _rows(observations: Sequence[Observation], classes: Sequence[str]) -> tuple[Samples, Samples]:
    rows, right = [], []
    for one in observations:
        counts = [one.counts.get(name, 0.0) for name in classes]
        if one.elements is not None and any(counts):
            rows.append([*counts, 0.0, 0.0])
            right.append(one.elements)
        rows.append([*counts, float(one.nodes), float(one.rigid_nodes)])
        right.append(one.total)
    return np.array(rows), np.array(right)


def _solved(scaled: Samples) -> tuple[Samples, NDArray[np.bool_]]:
    """Least squares, none below 0, over the unknowns that the rows decide; the others stay 1.  Give both."""
    from scipy.optimize import lsq_linear

    normal = scaled.T @ scaled
    resolution = np.linalg.solve(normal + _DOUBT**2 * np.eye(len(normal)), normal)
    told = np.diag(resolution) > _TOLD
    found = np.ones(len(normal))
    if told.any():
        left = 1 - scaled[:, ~told].sum(axis=1)
        found[told] = lsq_linear(scaled[:, told], left, bounds=(0.0, np.inf)).x
    return found, told


def _share(one: Observation, values: Mapping[str, float]) -> float:
    """Share of the elements in a step."""
    spent = sum(values.get(name, 0.0) * count for name, count in one.counts.items())
    elements = spent if one.elements is None else one.elements
    return min(1.0, elements / one.total)
