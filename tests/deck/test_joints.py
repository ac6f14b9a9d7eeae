"""Joints of parts that share no nodes, in every form that d2rpick reads, and notes on forms that it cannot read."""

from pathlib import Path

import pytest

from d2rpick.choice.parts.deck_of_run import find_rigid_bodies
from d2rpick.deck.model import Inventory
from d2rpick.flight.position_error import RigidBody
from tests.deck import test_radioss_inventory as rad
from tests.deck.test_ls_dyna_inventory import read_text, write_nodes
from tests.decks import make_row, pad

# Parts 7, 9 and 11 are one shell each and have no common nodes: 1 to 4, 5 to 8, 9 to 12.
MESH = (
    "*KEYWORD\n"
    + "".join(f"*PART\np{part}\n{part:10d}         1         1\n" for part in (7, 9, 11))
    + "*NODE\n" + write_nodes()
    + "*ELEMENT_SHELL\n" + make_row(1, 7, 1, 2, 4, 3) + make_row(2, 9, 5, 6, 8, 7) + make_row(3, 11, 9, 10, 12, 11)
)  # fmt: skip


SET = "*SET_NODE_LIST\n" + pad(5) + pad(4, 5)
JOINTS = {
    "spotweld": "*CONSTRAINED_SPOTWELD\n" + pad(4, 5),
    "spotweld of an id": "*CONSTRAINED_SPOTWELD_ID\n" + pad(99) + pad(4, 5),
    "rivet": "*CONSTRAINED_RIVET\n" + pad(5, 1),
    "nodal rigid body": SET + "*CONSTRAINED_NODAL_RIGID_BODY\n" + pad(1, 0, 5),
    "generalized weld": SET + "*CONSTRAINED_GENERALIZED_WELD_SPOT\n" + pad(5, 0),
    "extra nodes": "*CONSTRAINED_EXTRA_NODES_NODE\n" + pad(9, 2),
    "extra nodes of a set": SET + "*CONSTRAINED_EXTRA_NODES_SET\n" + pad(9, 5),
    "tied contact": "*CONTACT_TIED_SHELL_EDGE_TO_SURFACE\n" + pad(7, 9, 3, 3),
    "tied contact of an id": "*CONTACT_TIED_NODES_TO_SURFACE_ID\n"
    + pad(1)
    + pad(7, 9, 3, 3),
    "tied contact of MPP": "*CONTACT_TIED_SURFACE_TO_SURFACE_OFFSET_ID_MPP\n"
    + pad(1)
    + pad(0, 200)
    + "&        0         1\n"
    + pad(7, 9, 3, 3),
    "tied contact of MPP with a blank line": "*CONTACT_TIED_NODES_TO_SURFACE_MPP\n\n"
    + pad(7, 9, 3, 3),
    "tied contact of nodes": SET + "*CONTACT_TIED_NODES_TO_SURFACE\n" + pad(5, 9, 4, 3),
}

RADIOSS = "".join(
    f"/PART/{n}\np{n}\n{pad(1, 1)}/SHELL/{n}\n{pad(n, *range(4 * n - 3, 4 * n + 1))}"
    for n in (1, 2, 3)
)


def read_with_mesh(folder: Path, text: str) -> Inventory:
    return read_text(folder, MESH + text + "*END\n")


@pytest.mark.parametrize("form", JOINTS)
def test_what_joins_two_parts_makes_one_body_of_them(tmp_path: Path, form: str) -> None:
    inventory = read_with_mesh(tmp_path, JOINTS[form])
    kind = form.partition(" of ")[0]
    assert inventory.joined == {7: {9: {kind}}, 9: {7: {kind}}}
    assert inventory.groups([7, 9, 11]) == ((7, 9), (11,))
    assert inventory.neighbours == {7: frozenset(), 9: frozenset(), 11: frozenset()}
    assert (inventory.ties, inventory.complete) == ((), True)


def test_without_a_joint_each_is_a_body_and_a_joint_within_a_part_is_none(
    tmp_path: Path,
) -> None:
    for text in (
        "",
        "*CONSTRAINED_SPOTWELD\n" + pad(1, 2),
        "*CONSTRAINED_SPOTWELD\n" + pad(4, 999),
    ):
        inventory = read_with_mesh(tmp_path, text)
        assert inventory.groups([7, 9, 11]) == ((7,), (9,), (11,))
        assert {
            part: dict(joined_parts)
            for part, joined_parts in inventory.joined.items()
            if joined_parts
        } == {}


def test_several_welds_on_the_lines_of_a_keyword_join_a_chain(tmp_path: Path) -> None:
    inventory = read_with_mesh(
        tmp_path, "*CONSTRAINED_SPOTWELD\n" + pad(4, 5) + pad(6, 9)
    )
    assert inventory.groups([7, 9, 11]) == ((7, 9, 11),)
    assert inventory.groups([7, 11]) == (
        (7,),
        (11,),
    )  # a part that stays deformable joins nothing


@pytest.mark.parametrize(
    ("text", "told"),
    [
        (
            "*CONTACT_TIED_NODES_TO_SURFACE\n" + pad(1, 2, 0, 0),
            "*CONTACT_TIED_NODES_TO_SURFACE",
        ),
        ("*CONTACT_SPOTWELD\n" + pad(1, 2, 2, 2), "*CONTACT_SPOTWELD"),
        (
            "*CONTACT_AUTOMATIC_SURFACE_TO_SURFACE_TIEBREAK\n" + pad(1, 2, 2, 2),
            "TIEBREAK",
        ),
        (
            "*CONSTRAINED_NODAL_RIGID_BODY\n" + pad(1, 0, 77),
            "nodal rigid body",
        ),  # the set does not exist
        ("*CONSTRAINED_SPR2\n" + pad(7, 9), "*CONSTRAINED_SPR2"),
        (
            "*CONSTRAINED_INTERPOLATION\n" + pad(1, 2, 123456),
            "*CONSTRAINED_INTERPOLATION",
        ),
        (
            "*CONSTRAINED_BEAM_IN_SOLID_ID\n" + pad(1),
            "*CONSTRAINED_BEAM_IN_SOLID_ID",
        ),
        (
            "*CONSTRAINED_LINEAR_GLOBAL\n" + pad(1),
            "*CONSTRAINED_LINEAR_GLOBAL",
        ),
        ("*CONSTRAINED_TIE-BREAK\n" + pad(1, 2), "*CONSTRAINED_TIE-BREAK"),
    ],
)
def test_a_tie_that_is_not_followed_is_named_and_leaves_the_bodies_open(
    tmp_path: Path, text: str, told: str
) -> None:
    inventory = read_with_mesh(tmp_path, text)
    (tie,) = inventory.ties
    assert told in tie
    assert "main.k:" in tie
    assert find_rigid_bodies(inventory, [7, 9]) == ()
    assert find_rigid_bodies(inventory, [7]) == (RigidBody((7,)),)
    assert inventory.complete  # its cost is known


@pytest.mark.parametrize(
    ("group", "surface", "joined"),
    [
        (f"/GRNOD/PART/5\ng\n{pad(1)}", f"/SURF/PART/6\ns\n{pad(2)}", {1: {2}, 2: {1}}),
        (f"/GRNOD/NODE/5\ng\n{pad(4, 3)}", f"/SURF/PART/EXT/6\ns\n{pad(2)}", {1: {2}, 2: {1}}),
        (f"/GRNOD/NODE/5\ng\n{pad(4, 3)}", f"/SURF/PART/6\ns\n{pad(2, 3)}", None),
        (f"/GRNOD/BOX/5\ng\n{pad(4)}", f"/SURF/PART/6\ns\n{pad(2)}", None),
    ],
)  # fmt: skip
def test_tied_interfaces_of_radioss(
    tmp_path: Path, group: str, surface: str, joined: dict[int, set[int]] | None
) -> None:
    tie = f"/INTER/TYPE2/1\ntie\n{pad(5, 6)}"
    inventory = rad.read_text(
        tmp_path, rad.write_nodes(12) + RADIOSS + rad.PROPS + group + surface + tie
    )
    assert len(inventory.ties) == (0 if joined else 1)
    assert {
        part: {*joined_parts} for part, joined_parts in inventory.joined.items()
    } == (joined or {})
    assert bool(find_rigid_bodies(inventory, [1, 2])) == bool(joined)


@pytest.mark.parametrize("keyword", ["RBE2", "RBE3", "RLINK", "MPC"])
def test_other_ties_of_radioss_leave_the_bodies_open(
    tmp_path: Path, keyword: str
) -> None:
    tie = f"/{keyword}/1\ntie\n{pad(4, 0, 0, 5)}"
    inventory = rad.read_text(tmp_path, rad.write_nodes(12) + RADIOSS + rad.PROPS + tie)
    assert [tie.split()[0] for tie in inventory.ties] == [f"/{keyword}/1"]
    assert find_rigid_bodies(inventory, [1, 2]) == ()
    assert inventory.complete
