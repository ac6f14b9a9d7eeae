"""Rigid bodies that parts form: connected by springs, by a rigid body of the deck, or not at all."""

from pathlib import Path

import pytest

from d2rpick.choice.parts.deck_of_run import find_rigid_bodies
from d2rpick.deck import read_inventory
from d2rpick.deck.model import Inventory
from d2rpick.deck.pieces import count_pieces
from d2rpick.flight.position_error import RigidBody
from tests import made_car
from tests.deck import test_radioss_inventory as rad
from tests.deck.test_joints import MESH
from tests.deck.test_ls_dyna_inventory import read_text
from tests.decks import make_row, pad

# Part 1 is a row of shells with the nodes 1 to 40; parts 2 and 3 are one shell each: 41 to 44, 45 to 48.
ROW = "".join(pad(n, 2 * n - 1, 2 * n, 2 * n + 2, 2 * n + 1) for n in range(1, 20))
RADIOSS = (
    "".join(f"/PART/{n}\np{n}\n{pad(1, 1)}" for n in (1, 2, 3))
    + f"/SHELL/1\n{ROW}/SHELL/2\n{pad(31, 41, 42, 44, 43)}/SHELL/3\n{pad(32, 45, 46, 48, 47)}"
)
SPRING = f"/PART/9\nmount\n{pad(2, 1)}/SPRING/9\n"
# The same for the three shells of LS-DYNA, with the nodes 1 to 12.
DISCRETE = (
    f"*PART\nmount\n{pad(15, 2)}*SECTION_DISCRETE\n{pad(2)}\n\n*ELEMENT_DISCRETE\n"
)

FIRST, SECOND, THIRD = range(1, 41), range(41, 45), range(45, 49)


def read_radioss(folder: Path, *more: str, engine: str = "") -> Inventory:
    if engine:
        (folder / "TEST_0001.rad").write_text(f"/RUN/TEST/1\n0.1\n{engine}")
    return rad.read_text(
        folder, rad.write_nodes(50) + RADIOSS + rad.PROPS + "".join(more)
    )


def write_body(number: int, *nodes: int) -> str:
    group = "".join(pad(*nodes[at : at + 10]) for at in range(0, len(nodes), 10))
    line = f"{48 + number:10d}{0:10d}{0:10d}{0:10d}{'0':>20}{number:10d}\n"
    return f"/RBODY/{number}\nrb\n{line}/GRNOD/NODE/{number}\ng\n{group}"


def test_a_small_part_beside_a_big_one_is_a_body_of_its_own(tmp_path: Path) -> None:
    """In an earlier version, loose wheels were merged with a car that had 75 % of the nodes."""
    assert read_radioss(tmp_path).bodies([1, 2, 3]) == ((1,), (2,), (3,))


def test_springs_hold_parts_in_one_body_and_go_with_it(tmp_path: Path) -> None:
    inventory = read_radioss(tmp_path, SPRING, pad(91, 40, 41))
    assert inventory.bodies([1, 2, 3]) == ((1, 2), (3,))
    assert inventory.bodies([1, 2, 3, 9]) == ((1, 2, 9), (3,))
    assert inventory.bodies([2, 3]) == ((2,), (3,))
    assert inventory.bodies([2, 9]) == ((2,),)  # the other end of the spring moves
    assert inventory.groups([1, 2, 3]) == (
        (1,),
        (2,),
        (3,),
    )  # each may have a body of its own
    assert count_pieces(inventory, [1, 2]) == 1
    assert find_rigid_bodies(inventory, [1, 2]) == (RigidBody((1, 2)),)


def test_springs_of_ls_dyna_hold_parts_too(tmp_path: Path) -> None:
    found = read_text(tmp_path, MESH + DISCRETE + make_row(91, 15, 4, 5) + "*END\n")
    assert found.bodies([7, 9, 11]) == ((7, 9), (11,))


def test_a_rigid_body_that_is_there_to_be_switched_says_which_parts_become_one(
    tmp_path: Path,
) -> None:
    inventory = read_radioss(
        tmp_path, write_body(1, *FIRST, *THIRD), engine="/RBODY/OFF\n49\n"
    )
    assert inventory.bodies([1, 2, 3]) == ((1, 3), (2,))
    assert find_rigid_bodies(inventory, [1, 3]) == (RigidBody((1, 3)),)
    assert inventory.bodies([2, 3]) == (
        (2,),
        (3,),
    )  # it contains another part as well, so it cannot switch these parts
    assert inventory.groups([1, 2, 3]) == ((1,), (2,), (3,))
    assert inventory.joined == {}


def test_parts_on_springs_stay_apart_where_the_deck_has_a_body_for_each(
    tmp_path: Path,
) -> None:
    spring = SPRING + pad(91, 40, 41)
    inventory = read_radioss(
        tmp_path,
        spring,
        write_body(1, *FIRST),
        write_body(2, *SECOND),
        engine="/RBODY/OFF\n49 50\n",
    )
    assert inventory.bodies([1, 2]) == ((1,), (2,))
    alone = read_radioss(
        tmp_path, spring, write_body(1, *FIRST), engine="/RBODY/OFF\n49\n"
    )
    assert alone.bodies([1, 2]) == ((1, 2),)


@pytest.mark.parametrize(
    ("engine", "joined"),
    [("/PRINT/-100\n", True), ("/RBODY/ON\n49\n", False), ("", True)],
    ids=["always on", "switched", "no engine file, and no part whole in it"],
)
def test_a_rigid_body_that_is_always_on_joins_parts(
    tmp_path: Path, engine: str, joined: bool
) -> None:
    nodes = (39, 40, 41, 42) if engine != "/RBODY/ON\n49\n" else (*FIRST, 41, 42)
    inventory = read_radioss(tmp_path, write_body(1, *nodes), engine=engine)
    assert inventory.bodies([1, 2, 3]) == (
        ((1, 2), (3,)) if joined else ((1,), (2,), (3,))
    )
    assert inventory.joined.get(1, {}) == ({2: {"rigid body"}} if joined else {})


def test_a_rigid_body_that_is_always_on_with_a_group_that_is_not_followed_is_a_tie(
    tmp_path: Path,
) -> None:
    inventory = read_radioss(
        tmp_path,
        write_body(1, 40, 41).replace("/GRNOD/NODE", "/GRNOD/BOX"),
        engine="/PRINT/-100\n",
    )
    assert [tie.split()[0] for tie in inventory.ties] == ["/RBODY/1"]
    assert find_rigid_bodies(inventory, [1, 2]) == ()


def test_parts_of_a_body_may_lie_in_pieces_that_nothing_joins(tmp_path: Path) -> None:
    """Four parts of a car form one body, and hubs and tyres form two wheels."""
    for deck, whole in (
        (made_car.write_starter(tmp_path), True),
        (made_car.write_keywords(tmp_path), False),
    ):
        inventory = read_inventory(deck)
        assert find_rigid_bodies(inventory, [*made_car.BODY, *made_car.WHEELS]) == (
            RigidBody(made_car.BODY), RigidBody(made_car.WHEELS, whole=False)
        )  # fmt: skip
        assert (
            count_pieces(inventory, made_car.WHEELS)
            == count_pieces(inventory, [7])
            == 2
        )
        assert find_rigid_bodies(inventory, [7]) == (
            RigidBody((7,), whole),
        )  # Radioss switches each piece by itself
    welded = read_inventory(
        made_car.write_keywords(tmp_path, f"*CONSTRAINED_SPOTWELD\n{pad(21, 31)}")
    )
    assert count_pieces(welded, [7]) == 1
    through = read_inventory(
        made_car.write_keywords(
            tmp_path, f"*ELEMENT_SHELL\n{make_row(99, 1, 21, 22, 32, 31)}"
        )
    )
    assert (
        count_pieces(through, [7]),
        count_pieces(through, [7], among=range(1, 10)),
    ) == (
        2,
        1,
    )
