"""A tumbling box whose parts lie on a line: its motion follows from written nodes or from the kinetic energy."""

from collections.abc import Callable, Sequence
from itertools import pairwise
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest
from hypothesis import given, settings

from d2rpick.deck.geometry import PartPosition, Placement
from d2rpick.flight.body_frame import fit_frame
from d2rpick.flight.flight import Flight
from d2rpick.flight.position_error import Drift, find_drift
from d2rpick.flight.turning import Flying, Turning
from d2rpick.flight.turning_bound import bound_turning_speed
from d2rpick.histories.history import (
    EXACT,
    Balance,
    Given,
    History,
    Momenta,
    NodeMotion,
    Samples,
)
from d2rpick.histories.names import Part
from tests.energies import require
from tests.flight.test_position_error import vectors

TIME = np.linspace(0.0, 0.12, 601)
START, END = 0.02, 0.12
# Bottom, walls, lid, and a block in the box; their centres lie on a line [kg, m].
MASSES = np.array([6.8, 18.3, 4.7, 27.6])
ALONG = np.array([0.1157, 0.0472, 0.1295])
CENTRES = np.outer([-1.0, 0.0, 1.0, 0.2], ALONG) + np.array([0.0, 0.0, 0.6])
BLOCK = 3
SPREADS = np.stack([np.diag([0.05, 0.03, 0.02])] * 3 + [np.diag([0.001, 0.004, 0.004])])
CORNERS = np.array(
    [(x, y, z) for x in (-0.3, 0.3) for y in (-0.24, 0.24) for z in (0.42, 0.78)]
)
CORNER_IDS = (11, 12, 13, 14, 15, 16, 17, 18)
DOWN = np.array([0.0, 0.0, -1.0])
FALL = np.array([0.3, -0.2, -2.0])


def slide_block(times: Samples) -> Samples:
    """Return the places (n, parts, 3) in the box, about their centre, while the block swings by 6 mm along the line."""
    swing = 0.006 * np.sin(230.0 * times)
    inside = np.repeat(CENTRES[np.newaxis], times.size, axis=0)
    inside[:, BLOCK] += np.outer(swing, ALONG / np.linalg.norm(ALONG))
    centre = np.einsum("p,npi->ni", MASSES / MASSES.sum(), inside)
    return np.asarray(inside - centre[:, np.newaxis])


def compute_inertia_of_box(places: Samples) -> Samples:
    """Return the inertia tensors (n, 3, 3) for places (n, parts, 3)."""
    second = np.einsum("p,npi,npj->nij", MASSES, places, places)
    second = second + np.einsum("p,pij->ij", MASSES, SPREADS)
    return np.asarray(
        np.trace(second, axis1=1, axis2=2)[:, np.newaxis, np.newaxis] * np.eye(3)
        - second
    )


def tumble(momentum: Samples, inertia: Samples, start: Samples, step: float) -> Samples:
    """Return the orientations (n, 3, 3) of a body with this angular momentum and inertia (n, 3, 3), by small steps."""
    frames = [start]
    for earlier, later in pairwise(inertia):
        frame = frames[-1]
        for _ in range(2):  # the angular velocity in the middle of the step
            middle = (frames[-1] + frame) / 2
            rate = np.linalg.solve((earlier + later) / 2, middle.T @ momentum)
            x, y, z = rate * step / 2
            half = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
            turn = np.linalg.solve(np.eye(3) - half, np.eye(3) + half)
            frame = frames[-1] @ turn
        frames.append(frame)
    return np.stack(frames)


class Box(SimpleNamespace):
    """A computed motion: ``frames``, places of ``parts`` and ``corners`` over time, and the angular ``momentum``."""

    frames: Samples
    parts: Samples
    corners: Samples
    momentum: Samples


def make_box(momentum: Samples) -> Box:
    inside = slide_block(TIME)
    step = float(TIME[1])
    frames = tumble(momentum, compute_inertia_of_box(inside), np.eye(3), step)
    fall = np.outer(TIME, FALL) + np.outer(TIME**2, [0.0, 0.0, -9.81 / 2])
    middle = np.average(CENTRES, axis=0, weights=MASSES)
    parts = np.einsum("nij,npj->npi", frames, inside) + (fall + middle)[:, np.newaxis]
    # The box is displaced relative to the centre of mass as its bottom is.
    arms = CORNERS - CENTRES[0] + inside[:, :1]
    corners = np.einsum("nij,npj->npi", frames, arms) + (fall + middle)[:, np.newaxis]
    return Box(frames=frames, parts=parts, corners=corners, momentum=momentum)


def make_deck(corner_ids: Sequence[int] = CORNER_IDS) -> Placement:
    """Return the deck: parts 1 to 3 are the box with the watched nodes, 4 is the block."""
    watched = dict(zip(corner_ids, CORNERS, strict=True))
    return cast(
        "Placement",
        SimpleNamespace(
            parts={
                i + 1: PartPosition(centre, spread, {})
                for i, (centre, spread) in enumerate(zip(CENTRES, SPREADS, strict=True))
            },
            watched_centre=lambda _parts: CORNERS.mean(axis=0),
            find_nodes=lambda _parts: CORNERS,
            find_watched_nodes=lambda _parts: watched,
            hanging_together=lambda parts: frozenset(parts) - {BLOCK + 1},
        ),
    )


def make_momenta_of_box(box: Box, first: int = 0) -> Momenta:
    velocity = np.gradient(box.parts, TIME, axis=0, edge_order=2)[first:]
    parts = tuple(Part(i + 1, f"part {i + 1}") for i in range(MASSES.size))
    values = velocity * MASSES[:, np.newaxis]
    return Momenta(
        TIME[first:], values, parts, EXACT, tuple(range(MASSES.size)), masses=MASSES
    )


def find_drift_of_box(
    box: Box,
    nodes: Sequence[int] = CORNER_IDS,
    first: int = 0,
    states: slice = slice(None),
) -> Drift | None:
    """Return the drift in a record that begins with state ``first`` and has the motion of some nodes in some states."""

    def read_displacements(ids: Sequence[int]) -> NodeMotion | None:
        written = tuple(id_ for id_ in ids if id_ in nodes)
        columns = [CORNER_IDS.index(id_) for id_ in written]
        moved = box.corners[:, columns] - CORNERS[columns]
        return NodeMotion(TIME[states], written, moved[states]) if written else None

    return find_drift_with_nodes(box, read_displacements, first)


def find_drift_with_nodes(
    box: Box,
    read_displacements: Callable[[Sequence[int]], NodeMotion | None],
    first: int = 0,
) -> Drift | None:
    """Return the drift in a record that begins with state ``first`` and whose nodes are read by a function."""
    flying = Flying(make_momenta_of_box(box, first), MASSES, range(4), START, END)
    return find_drift(flying, make_deck(), read_displacements)


def get_turning(drift_of_box: Drift | None) -> Turning:
    return require(require(drift_of_box).turning)


BOX = make_box(np.array([9.0, -6.0, 4.0]))


def test_three_nodes_beside_a_line_show_how_a_box_turns_and_two_do_not() -> None:
    assert get_turning(find_drift_of_box(BOX, (11, 14, 15)))
    for nodes in ((), (11, 18)):
        assert require(find_drift_of_box(BOX, nodes)).turning is None


def test_nodes_show_how_a_box_turns_if_they_are_written_throughout_the_flight() -> None:
    """The nodes have their own output interval, and their file may begin later or end earlier."""
    last = int(np.searchsorted(TIME, END))
    first = int(np.searchsorted(TIME, START))
    every = get_turning(find_drift_of_box(BOX))
    rarer = get_turning(find_drift_of_box(BOX, states=slice(None, None, 5)))
    np.testing.assert_allclose(rarer.rate, every.rate, rtol=0.02)
    for states in (slice(last - 5), slice(first + 5, None)):
        assert require(find_drift_of_box(BOX, states=states)).turning is None


def test_nodes_at_other_places_than_in_the_deck_show_no_frame() -> None:
    where = BOX.corners[:100]
    assert fit_frame(CORNERS, where, np.ones(8))
    assert fit_frame(CORNERS[::-1] * [1.0, 2.0, 1.0], where, np.ones(8)) is None


@pytest.mark.parametrize("first", [0, 60])
@settings(max_examples=4, deadline=None)
@given(momentum=vectors)
def test_the_front_moves_as_the_corner_that_is_lowest(
    first: int, momentum: Samples
) -> None:
    """Relative to the centre of mass, in the last 10 % of the flight; also in a record that begins in the flight."""
    box = make_box(12.0 * momentum)
    turning = get_turning(find_drift_of_box(box, first=first))
    centre = np.einsum("p,npi->ni", MASSES / MASSES.sum(), box.parts)
    down = (box.corners - centre[:, np.newaxis]) @ DOWN
    early = int(np.searchsorted(TIME, END - (END - START) / 10))
    lowest = int(np.argmax(down[-1]))
    swing = 0.006 * 230.0  # the box moves against the centre by its share of this
    moved = (down[-1, lowest] - down[early, lowest]) / (TIME[-1] - TIME[early])
    assert turning.compute_speed_at_front(DOWN) == pytest.approx(
        moved, abs=swing / 2 + 0.02
    )


@pytest.mark.parametrize("first", [0, 60])
@pytest.mark.parametrize("tr", [0.034, 0.0477, 0.071])
def test_a_box_that_was_rigid_is_turned_and_out_of_place_as_computed(
    first: int, tr: float
) -> None:
    """The block has half of the mass and swings by 6 mm, which displaces the box by 3 mm and about 0.05 degrees."""
    start = int(np.searchsorted(TIME, tr))
    inside = slide_block(TIME)
    inertia = compute_inertia_of_box(np.repeat(inside[start : start + 1], 601, axis=0))
    frozen = tumble(BOX.momentum, inertia[start:], BOX.frames[start], float(TIME[1]))[
        -1
    ]
    between = BOX.frames[-1].T @ frozen
    angle = np.degrees(np.arccos(np.clip((np.trace(between) - 1) / 2, -1.0, 1.0)))
    drift_of_box = require(find_drift_of_box(BOX, first=first))
    tr_of_state = TIME[start : start + 1]
    scale = float(drift_of_box.angles(TIME[110:590:5], END).max())
    assert 0.01 < scale < 0.5
    assert drift_of_box.angles(tr_of_state, END)[0] == pytest.approx(
        angle, abs=0.05 * scale
    )
    down = (BOX.corners[-1] - BOX.corners[-1].mean(axis=0)) @ DOWN
    lowest = int(np.argmax(down))
    arms = [CORNERS[lowest] - CENTRES[0] + inside[state, 0] for state in (start, -1)]
    apart = frozen @ arms[0] - BOX.frames[-1] @ arms[1]
    error = get_turning(drift_of_box).errors_at_front(tr_of_state, DOWN)[0]
    assert error == pytest.approx(np.linalg.norm(apart), abs=1e-4)
    at_contact = drift_of_box.errors_at_contact(tr_of_state, DOWN)[0]
    assert at_contact == max(error, drift_of_box.errors(tr_of_state, END)[0])


@settings(max_examples=5, deadline=None)
@given(momentum=vectors)
def test_without_nodes_no_corner_turns_faster_than_the_kinetic_energy_allows(
    momentum: Samples,
) -> None:
    box = make_box(12.0 * momentum)
    inertia = compute_inertia_of_box(slide_block(TIME))
    in_frame = 12.0 * momentum @ box.frames
    rates = np.linalg.solve(inertia, in_frame[..., np.newaxis])[..., 0]
    momenta = make_momenta_of_box(box)
    total = momenta.of(range(4))
    rotation = np.einsum("ni,nij,nj->n", rates, inertia, rates) / 2
    slid = np.gradient(slide_block(TIME), TIME, axis=0, edge_order=2)
    vibration = np.einsum("p,npi->n", MASSES, slid**2) / 2
    kinetic = np.square(total).sum(axis=1) / (2 * MASSES.sum()) + rotation + vibration
    whole = Momenta(TIME, total[:, np.newaxis], None, EXACT, (0,))
    history = History(
        TIME,
        vibration,
        source=("box",),
        format="csv",
        channel="E",
        evidence=Given((momenta, whole), Balance(TIME, kinetic=kinetic), MASSES),
    )
    flight = Flight(START, END, "momentum", momenta.parts)
    largest = require(bound_turning_speed(history, flight, make_deck()))
    fastest = np.linalg.norm(
        np.cross(rates[:, np.newaxis], CORNERS - CORNERS.mean(axis=0)), axis=2
    ).max()
    assert largest >= 0.98 * fastest
    unmoved = history.evidence.displacements(CORNER_IDS)
    assert unmoved is None
