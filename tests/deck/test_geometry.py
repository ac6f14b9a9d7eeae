"""Masses, stable time steps and positions of parts, compared with manual results; watched nodes of a run."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from d2rpick.deck import ls_dyna_inventory, radioss_inventory, read_inventory
from d2rpick.deck.geometry import Placement, compute_masses_and_steps
from d2rpick.deck.mesh import Elements
from d2rpick.deck.model import Inventory
from d2rpick.deck.radioss_run import read_run
from tests.command import put
from tests.computed import locate_stored, read_starter
from tests.deck import test_ls_dyna_inventory as dyna, test_radioss_inventory as rad
from tests.decks import make_row, pad, read

RHO, E, NU = 8000.0, 2.0e11, 0.25
SPEED = math.sqrt(E / RHO)
CARDS = f"*MAT_ELASTIC\n{1:10d}{RHO:10.1f}{E:10.2e}{NU:10.2f}\n"
PLACES = [
    (0, 0, 0),
    (2, 0, 0),
    (2, 1, 0),
    (0, 1, 0),
    (0, 0, 3),
    (2, 0, 3),
    (2, 1, 3),
    (0, 1, 3),
]
NODES = "*NODE\n" + "".join(
    f"{n:8d}" + "".join(f"{float(x):16.4f}" for x in place) + "\n"
    for n, place in enumerate(PLACES, start=1)
)
SHELL = (
    "*SECTION_SHELL\n         1         2\n      0.01      0.01      0.01      0.01\n"
)
IN_SHELLS = SPEED / math.sqrt(1 - NU**2)
IN_SOLIDS = SPEED * math.sqrt((1 - NU) / ((1 + NU) * (1 - 2 * NU)))

ALONG, ACROSS = 12, 5
PART = f"/PART/1\na\n{pad(1, 1)}/SHELL/1\n{pad(1, 1, 2, 4, 6)}{rad.PROPS}"
WATCHED = "/TH/NODE/7\nthree points\nDX        VX\n         2         0first\n        99         0no node\n         4\n"
PLATE = "*ELEMENT_SHELL\n" + make_row(1, 7, 1, 2, 4, 3)
PLATE_MESH = f"{dyna.HEAD}*NODE\n{dyna.write_nodes()}{PLATE}"


@pytest.mark.parametrize(
    ("section", "elements", "mass", "step"),
    [
        (SHELL, "*ELEMENT_SHELL\n" + make_row(1, 7, 1, 2, 3, 4), RHO * 2 * 0.01, 1 / IN_SHELLS),
        (SHELL, "*ELEMENT_SHELL\n" + make_row(1, 7, 1, 2, 3, 3), RHO * 0.01, 2 / math.sqrt(5) / IN_SHELLS),
        ("*SECTION_SOLID\n         1         2\n", "*ELEMENT_SOLID\n" + make_row(1, 7, *range(1, 9)), RHO * 6,
         1 / IN_SOLIDS),
        ("*SECTION_SOLID\n         1        10\n", "*ELEMENT_SOLID\n" + make_row(1, 7, 1, 2, 4, 5, 5, 5, 5, 5), RHO,
         3 / math.sqrt(49 / 4) / IN_SOLIDS),
        ("*SECTION_BEAM\n         1         2\n      0.05\n", "*ELEMENT_BEAM\n" + make_row(1, 7, 1, 2), RHO * 0.1,
         2 / SPEED),
    ],
)  # fmt: skip
def test_by_hand(
    tmp_path: Path, section: str, elements: str, mass: float, step: float
) -> None:
    part = "*KEYWORD\n*PART\na\n" + make_row(7, 1, 1, width=10)
    masses = compute_masses_and_steps(
        ls_dyna_inventory.read_ls_dyna_inventory(
            read(tmp_path, f"{part}{section}{CARDS}{NODES}{elements}*END\n")
        )
    )
    assert list(masses[7]) == pytest.approx([mass, step])


@pytest.mark.parametrize("lost", ["*MAT", "*SECTION", "*NODE"])
def test_what_is_not_in_the_deck_is_not_guessed(tmp_path: Path, lost: str) -> None:
    part = "*KEYWORD\n*PART\na\n" + make_row(7, 1, 1, width=10)
    text = f"{part}{SHELL}{CARDS}{NODES}*ELEMENT_SHELL\n{make_row(1, 7, 1, 2, 3, 4)}*END\n".replace(
        lost, "*OTHER"
    )
    mass, step = compute_masses_and_steps(
        ls_dyna_inventory.read_ls_dyna_inventory(read(tmp_path, text))
    )[7]
    assert mass is None
    assert (step is None) == (lost != "*SECTION")


def test_cards_without_a_usable_element_have_no_mass(tmp_path: Path) -> None:
    part = "*KEYWORD\n*PART\na\n" + make_row(7, 1, 1, width=10)
    assert (
        compute_masses_and_steps(
            ls_dyna_inventory.read_ls_dyna_inventory(
                read(tmp_path, f"{part}*ELEMENT_SHELL\n{make_row(1, 7, 1)}*END\n")
            )
        )
        == {}
    )


def test_masses_of_the_car_are_those_that_the_solver_printed(tmp_path: Path) -> None:
    (tmp_path / "CAR_0000.rad").write_bytes(read_starter("CAR"))
    masses = compute_masses_and_steps(
        radioss_inventory.read_radioss_inventory(
            read_run(str(tmp_path / "CAR_0000.rad"))
        )
    )
    lines = Path(locate_stored("car_parts.csv")).read_text("ascii").splitlines()
    head, *rows = (line.split(",") for line in lines)
    for cells in rows:
        values = dict(zip(head, cells, strict=True))
        mass, step = masses[int(values["id"])]
        assert mass == pytest.approx(float(values["mass_kg"]), rel=1e-3)
        assert (
            step is None
            or step == pytest.approx(21.54e-6 / 0.9, rel=0.25)
            or values["part"] in ("engine", "battery", "wheels")
        )


def make_plate(far: float = 0.0) -> Inventory:
    """Return a deck with a plate of shells, 3.6 x 1.5, in the plane x = far, and a part of two springs."""
    y, z = np.meshgrid(
        np.linspace(0, 3.6, ALONG + 1), np.linspace(0, 1.5, ACROSS + 1), indexing="ij"
    )
    coordinates = np.stack([np.full(y.size, far), y.ravel(), z.ravel()], axis=1)
    first = np.array(
        [i * (ACROSS + 1) + j for i in range(ALONG) for j in range(ACROSS)]
    )
    shells = np.stack(
        [first, first + 1, first + ACROSS + 2, first + ACROSS + 1], axis=1
    )
    springs = np.array([[0, 1], [0, ACROSS]])
    elements = (
        Elements("shell", np.full(len(shells), 3), shells),
        Elements("spring", np.full(2, 4), springs),
    )
    return Inventory(
        "radioss",
        {},
        elements,
        coordinates,
        watched=np.array([0, ACROSS, coordinates.shape[0] - 1]),
    )


@pytest.mark.parametrize("far", [0.0, 1e6])
def test_a_plate_lies_at_its_middle_and_spreads_as_its_elements_do(far: float) -> None:
    placed_parts = Placement(make_plate(far)).parts
    np.testing.assert_allclose(placed_parts[3].centre, [far, 1.8, 0.75], rtol=1e-9)
    spread = [0.0, 3.6**2 / 12 * (1 - 1 / ALONG**2), 1.5**2 / 12 * (1 - 1 / ACROSS**2)]
    np.testing.assert_allclose(
        placed_parts[3].spread, np.diag(spread), rtol=1e-9, atol=1e-9
    )
    np.testing.assert_allclose(
        placed_parts[4].centre, [far, 0.0, (0.15 + 0.75) / 2], rtol=1e-9
    )


def test_watched_nodes_count_once() -> None:
    deck = Placement(make_plate())
    np.testing.assert_allclose(
        deck.watched_centre([3, 4]),  # type: ignore[arg-type]
        np.mean([[0, 0, 0], [0, 0, 1.5], [0, 3.6, 1.5]], axis=0),  # type: ignore[arg-type]
    )
    np.testing.assert_allclose(deck.watched_centre([4]), [0, 0, 0.75])  # type: ignore[arg-type]
    assert deck.watched_centre([]) is None
    assert deck.hanging_together([3, 4]) == {3, 4}


def test_a_part_with_a_node_that_is_nowhere_is_not_placed() -> None:
    lost = make_plate()
    lost.coordinates[0] = np.nan
    assert Placement(lost).parts.keys() == set()


def test_where_elements_are_missing_no_part_is_placed() -> None:
    assert Placement(replace(make_plate(), complete=False)).parts == {}


def list_coordinates(inventory: Inventory) -> list[list[float]]:
    return [
        where.tolist() for where in inventory.coordinates[np.sort(inventory.watched)]
    ]


def test_nodes_of_a_time_history_are_watched(tmp_path: Path) -> None:
    inventory = rad.read_text(tmp_path, f"{rad.write_nodes(8)}{PART}{WATCHED}")
    assert list_coordinates(inventory) == [[2.0, 0.0, 2.0], [4.0, 0.0, 1.0]]
    assert rad.read_text(tmp_path, f"{rad.write_nodes(8)}{PART}").watched.size == 0


@pytest.mark.parametrize(
    ("keyword", "ids"),
    [
        ("", make_row(2, 99, 4, width=10)),
        ("_ID", "         2first\n         4second\n"),
        ("_SET", make_row(2, 4, width=10)),  # sets of nodes, not nodes
    ],
)
def test_nodes_of_nodout_are_watched(tmp_path: Path, keyword: str, ids: str) -> None:
    text = f"{dyna.HEAD}*NODE\n{dyna.write_nodes()}{PLATE}*DATABASE_HISTORY_NODE{keyword}\n{ids}*END\n"
    inventory = dyna.read_text(tmp_path, text)
    assert len(list_coordinates(inventory)) == (0 if keyword == "_SET" else 2)
    assert inventory.complete


def test_nodes_written_in_local_axes_show_no_rotation_of_their_part(
    tmp_path: Path,
) -> None:
    """LS-DYNA writes them in the coordinate system of the card, Radioss in a skew system; both may rotate."""
    cards = f"*DATABASE_HISTORY_NODE\n{make_row(2, 3, width=10)}"
    local = f"*DATABASE_HISTORY_NODE_LOCAL\n{make_row(3, 5, 1, width=10)}"
    text = f"{dyna.HEAD}*NODE\n{dyna.write_nodes()}{PLATE}{cards}"
    plain = Placement(dyna.read_text(tmp_path, f"{text}*END\n"))
    assert {*plain.find_watched_nodes([7])} == {2, 3}
    turned = Placement(dyna.read_text(tmp_path, f"{text}{local}*END\n"))
    assert {*turned.find_watched_nodes([7])} == {2}
    rows = "         2         0second\n         3         4third\n"
    deck = (
        f"{rad.write_nodes(8)}{PART}/TH/NODE/1\nnodes\nDX        DY        DZ\n{rows}"
    )
    skewed = Placement(rad.read_text(tmp_path, deck))
    assert {*skewed.find_watched_nodes([1])} == {2}


@pytest.mark.parametrize(
    ("text", "placed"),
    [
        (f"{PLATE_MESH}*END\n", True),
        (f"{PLATE_MESH}*NODE_TRANSFORM\n         1         1\n*END\n", False),
        (f"{PLATE_MESH}*PART_MOVE\n         7       1.0\n*END\n", False),
        (f"{dyna.HEAD}*INCLUDE_TRANSFORM\nmesh.k\n\n\n\n         0\n*END\n", True),
        (f"{dyna.HEAD}*INCLUDE_TRANSFORM\nmesh.k\n\n\n\n         3\n*END\n", False),
        (
            f"{dyna.HEAD}*INCLUDE_TRANSFORM\nmesh.k\n\n\n\n     &turn\n*END\n",
            False,
        ),  # unknown, so not at rest
    ],
)
def test_where_a_deck_moves_its_nodes_no_part_is_placed(
    tmp_path: Path, text: str, placed: bool
) -> None:
    inventory = dyna.read_text(
        tmp_path, text, mesh=f"*NODE\n{dyna.write_nodes()}{PLATE}*END\n"
    )
    assert inventory.counts == {7: {"shell": 1}}
    assert ({*Placement(inventory).parts} == {7}) is placed


def test_a_starter_that_moves_its_nodes_places_no_part(tmp_path: Path) -> None:
    text = f"{rad.write_nodes(8)}{PART}"
    assert Placement(rad.read_text(tmp_path, text)).parts.keys() == {1}
    moved = f"{text}/TRANSFORM/TRA/1\nshift\n         1                 1.0\n"
    assert Placement(rad.read_text(tmp_path, moved)).parts.keys() == set()


def test_the_car_lies_where_its_generator_put_it(tmp_path: Path) -> None:
    deck = put(tmp_path / "CAR_0000.rad", read_starter("CAR"))
    placed_parts = Placement(read_inventory(str(deck)))
    np.testing.assert_allclose(
        placed_parts.parts[12].centre, [0.6, 0.0, 0.375], atol=1e-9
    )  # the engine, 0.6 x 0.6 x 0.45
    np.testing.assert_allclose(
        placed_parts.parts[12].spread, np.diag([0.0281, 0.0281, 0.015]), atol=1e-4
    )
    np.testing.assert_allclose(
        placed_parts.watched_centre(range(1, 12)),  # type: ignore[arg-type]
        [2.025, 0.0, 0.7],  # type: ignore[arg-type]
        atol=1e-9,
    )
    assert placed_parts.hanging_together(range(1, 15)) == {
        *range(1, 12),
        13,
    }  # all but engine and wheels
