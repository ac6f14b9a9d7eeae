"""The longest period in which what springs hold together swings, by the masses and springs of a deck.

A piece that hangs together without springs has mass m, those that its springs join it to have M: it swings against
them as their reduced mass mu = m M/(m + M) does.  By a spring of stiffness k along the unit vector l the stiffness of
all is the matrix K, the sum of k l l^T, and the period along an eigenvector of K is 2 pi (mu/lambda)^(1/2).  A push is
handed on first where the springs are stiffest, with the largest lambda; no period is below that with the sum of all k,
the trace of K.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from d2rpick.base.errors import name_units
from d2rpick.deck.geometry import masses_and_steps, sizes_and_lengths
from d2rpick.deck.model import DISCRETE, SPRING, Inventory
from d2rpick.deck.pieces import labels_of

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator, Mapping

    from d2rpick.deck.mesh import Places, Reals

# What swings with a smaller share of the mass of all that hangs on springs moves the others too little.
_HEAVY: Final = 0.05


class InnerPeriod(NamedTuple):
    """The longest period [time], what it cannot be below [time], and in words what swings."""

    time: float
    least: float
    reason: str


class _Piece(NamedTuple):
    """What hangs together without springs: its parts and its mass."""

    parts: frozenset[int]
    mass: float


class _Spring(NamedTuple):
    """A spring: its stiffness along its length as a matrix (3, 3), and the labels of what it joins."""

    stiffness: Reals
    joins: frozenset[int]


def inner_period(inventory: Inventory) -> InnerPeriod | None:
    """Find the longest period in which the parts of a deck swing on springs against each other.

    None where no springs join them, or the deck does not give every mass and stiffness in a way that is followed:
    springs that are linear along their length (Radioss: /PROP/SPRING without functions).
    """
    stiff = frozenset(part for part in inventory.nodes_by_part if not set(inventory.counts[part]) <= DISCRETE)
    if inventory.moved or not inventory.complete:
        return None
    labels = labels_of(inventory, stiff, springs=False)
    pieces = _pieces(inventory, stiff, labels)
    springs = list(_springs(inventory, labels, pieces)) if pieces else []
    if not pieces or None in springs:
        return None
    held = {label: [one for one in springs if one and label in one.joins] for label in pieces}
    whole = sum(piece.mass for label, piece in pieces.items() if held[label])
    heavy = [label for label in pieces if held[label] and pieces[label].mass >= _HEAVY * whole]
    return max((_period(label, pieces, held[label]) for label in heavy), key=lambda one: one.time, default=None)


def _pieces(inventory: Inventory, parts: Collection[int], labels: Places) -> Mapping[int, _Piece] | None:
    """Pieces by their label; None where the mass of a part is not known."""
    masses, made = masses_and_steps(inventory), dict[int, _Piece]()
    sizes: dict[int, dict[int, float]] = {part: {} for part in parts}
    for elements in inventory.elements:
        own, _ = sizes_and_lengths(elements.kind, elements.nodes, inventory.coordinates)
        for part in set(np.unique(elements.part).tolist()) & sizes.keys():
            of = elements.part == part
            found, at = np.unique(labels[elements.nodes[of, 0]], return_inverse=True)
            for label, size in zip(found.tolist(), np.bincount(at, own[of]).tolist(), strict=True):
                sizes[part][label] = sizes[part].get(label, 0.0) + size
    for part, pieces in sizes.items():
        mass = masses.get(part, (None,))[0]
        if mass is None:
            return None
        for label, size in pieces.items():
            before = made.get(label, _Piece(frozenset(), 0.0))
            made[label] = _Piece(before.parts | {part}, before.mass + mass * size / sum(pieces.values()))
    return made


def _springs(inventory: Inventory, labels: Places, pieces: Mapping[int, _Piece]) -> Iterator[_Spring | None]:
    """Springs between two pieces; None for one that is not known."""
    springs = (elements for elements in inventory.elements if elements.kind == SPRING)
    for elements in springs:
        for part, ends in zip(elements.part.tolist(), elements.nodes[:, :2], strict=True):
            joins = frozenset[int](labels[ends].tolist())
            if len(joins) < 2 or not joins & pieces.keys():
                continue
            data = inventory.parts.get(part)
            stiffness = data.section.stiffness if data else None
            way = np.subtract(*inventory.coordinates[ends])
            known = stiffness is not None and joins <= pieces.keys() and way.any()
            yield _Spring(stiffness * np.outer(way, way) / (way @ way), joins) if stiffness and known else None


def _period(label: int, pieces: Mapping[int, _Piece], springs: list[_Spring]) -> InnerPeriod:
    """Period in which a piece swings against those that springs join it to."""
    piece, others = pieces[label], frozenset[int]().union(*(one.joins for one in springs)) - {label}
    mass = 1 / (1 / piece.mass + 1 / sum(pieces[one].mass for one in others))
    stiffness = np.sum([one.stiffness for one in springs], axis=0)
    most = float(np.linalg.eigvalsh(stiffness)[-1])
    time, least = (2 * math.pi * math.sqrt(mass / one) for one in (most, float(np.trace(stiffness))))
    return InnerPeriod(time, least, f"{name_units(piece.parts)} of mass {piece.mass:.4g} on {len(springs)} springs")
