"""Gravity, supports and prescribed motions of decks, and the parts that they hold.

The mesh is that of the made car: six parts that share nodes 1 to 12, in three rows along y, and two wheels of nodes 21
to 26 and 31 to 36.
"""

from math import inf
from pathlib import Path

import pytest

from d2rpick.choice.parts.deck_of_run import add_surroundings
from d2rpick.deck import read_inventory
from d2rpick.deck.model import Inventory
from d2rpick.deck.pieces import find_supports
from d2rpick.histories.opening import open_run
from d2rpick.histories.run import OpenedRun
from d2rpick.histories.surroundings import Surroundings
from tests import made_car
from tests.decks import pad

BODY, WHEEL, OTHER = (
    set(made_car.BODY),
    {7, 8},
    {7, 9},
)  # both wheels have hubs of one part

RAMP = "/FUNCT/1\nramp\n" + "".join(
    pad(*point, width=20) for point in ((0, 0), (1, 0), (2, 1), (3, 1))
)


def write_group(number: int, *nodes: int) -> str:
    return f"/GRNOD/NODE/{number}\nnodes\n{pad(*nodes)}"


def write_support(code: str, group: int, skew: int = 0) -> str:
    return f"/BCS/1\nheld\n   {code}{pad(skew, group)}"


def read_radioss(folder: Path, further_cards: str) -> Inventory:
    return read_inventory(made_car.write_starter(folder, further_cards))


def read_ls_dyna(folder: Path, further_cards: str) -> Inventory:
    return read_inventory(made_car.write_keywords(folder, further_cards))


def find_held_parts(inventory: Inventory) -> tuple[set[int], bool]:
    """Return the parts that are held, and True if the whole model is held."""
    by_part, whole = find_supports(inventory)
    return set(by_part), bool(whole)


@pytest.mark.parametrize(
    ("more", "expected"),
    [
        (write_group(1, 1) + write_support("111 000", 1), (BODY, True)),
        (write_group(1, 1) + write_support("000 000", 1), (set(), False)),
        (write_group(1, 1) + write_support("000 111", 1), (BODY, True)),  # shells have rotations
        (write_group(1, 22) + write_support("111 111", 1), (WHEEL, True)),
        (write_group(1, *range(31, 37)) + write_support("111 111", 1), (OTHER, False)),  # completely fixed: an obstacle
        (write_group(1, *range(31, 37)) + write_support("110 111", 1), (set(), False)),  # no motion there, free along z
        ("/GRNOD/PART/1\nparts\n" + pad(9) + write_support("111 000", 1), (OTHER, True)),
        (write_group(1, 1) + "/IMPVEL/1\nmoved\n" + pad(1, "Y", 0, 0, 1), (BODY, True)),
        ("/IMPDISP/FGEO/1\nmoved\n" + pad(1, 0) + pad(1.0, width=20) + pad(21, 1.0) + pad(22, 1.0), (WHEEL, True)),
        (write_group(1, 99) + write_support("111 000", 1) + write_group(2, 1, 2) + "/RBODY/1\nbody\n" + pad(99, 0, 0,
         0, "", 0, 2),
         (BODY, True)),
    ],
)  # fmt: skip
def test_a_support_holds_what_hangs_together_with_its_nodes(
    tmp_path: Path, more: str, expected: tuple[set[int], bool]
) -> None:
    assert find_held_parts(read_radioss(tmp_path, more)) == expected


@pytest.mark.parametrize(
    ("nodes", "code", "expected"),
    [
        ((1, 2, 3, 4), "010 101", set()),
        ((1, 2, 3), "010 101", BODY),  # not all nodes of the plane
        ((5, 6, 7, 8), "010 000", BODY),  # the body lies on both sides
        (
            (1, 2, 3, 4),
            "011 000",
            BODY,
        ),  # they lie at different heights along gravity
        ((1, 2, 3, 4), "010 000", set()),
    ],
)
def test_a_symmetry_plane_holds_nothing(
    tmp_path: Path, nodes: tuple[int, ...], code: str, expected: set[int]
) -> None:
    assert (
        find_held_parts(
            read_radioss(tmp_path, write_group(1, *nodes) + write_support(code, 1))
        )[0]
        == expected
    )
    assert (
        find_held_parts(
            read_radioss(
                tmp_path, write_group(1, *nodes) + write_support(code, 1, skew=3)
            )
        )[0]
        == BODY
    )  # its plane is unknown


def test_imposed_motion_holds_from_its_start_to_its_stop_and_always_where_a_sensor_is_asked(
    tmp_path: Path,
) -> None:
    for sensor, times in ((0, (0.01, 0.05)), (4, (0.0, inf))):
        moved = (
            "/IMPVEL/1\nmoved\n"
            + pad(1, "X", 0, sensor, 1)
            + pad(0, 1, 0.01, 0.05, width=20)
        )
        (hold,) = read_radioss(tmp_path, write_group(1, 1) + moved).boundary.holds
        assert (hold.start, hold.end) == times
    assert "/IMPVEL/1" in hold.name
    assert "MADE_0000.rad:" in hold.name


@pytest.mark.parametrize(
    ("more", "expected"),
    [
        ("*BOUNDARY_SPC_NODE\n" + pad(1, 0, 1, 1, 1), BODY),
        ("*BOUNDARY_SPC_NODE\n" + pad(1, 0, 0, 0, 0), set()),
        ("*BOUNDARY_SPC_SET_ID\n" + pad(5) + pad(4, 0, 1, 1, 1) + "*SET_NODE_LIST\n" + pad(4) + pad(21, 22), WHEEL),
        ("*BOUNDARY_SPC_SYMMETRY_PLANE\n" + pad(1), set()),
        ("*CONSTRAINED_GLOBAL\n" + pad(7, 7, 2, 0.0, 1.6, 0.0), BODY),
        ("*CONSTRAINED_GLOBAL\n" + pad(2, 0, 2, 0.0, 1.6, 0.0), set()),  # a symmetry plane
        ("*NODE\n" + f"{99:8d}" + pad(0, 0, 0, width=16).rstrip() + pad(7, 7, width=8) + "*CONSTRAINED_SPOTWELD\n"
         + pad(99, 1), BODY),
        ("*PART\ntool\n" + pad(10, 1, 2) + "*MAT_RIGID\n" + pad(2, 7800.0, 2.1e11, 0.3) + pad(1.0, 7, 7)
         + "*ELEMENT_SHELL\n" + pad(99, 10, 1, 2, 6, 5, width=8), BODY | {10}),
        ("*BOUNDARY_PRESCRIBED_MOTION_RIGID\n" + pad(9, 1, 2, 1, 1.0), OTHER),
        ("*BOUNDARY_PRESCRIBED_MOTION_NODE\n" + pad(1, 9, 2, 1, 1.0) + pad(1, 1) + pad(21, 1, 2, 1, 1.0),
         BODY | WHEEL),
    ],
)  # fmt: skip
def test_supports_of_ls_dyna(tmp_path: Path, more: str, expected: set[int]) -> None:
    assert find_held_parts(read_ls_dyna(tmp_path, more))[0] == expected


def test_birth_and_death(tmp_path: Path) -> None:
    motion = "*BOUNDARY_PRESCRIBED_MOTION_NODE\n" + pad(1, 1, 2, 1, 1.0, 0, 0.05, 0.01)
    spc = "*BOUNDARY_SPC_NODE_BIRTH_DEATH\n" + pad(1, 0, 1, 1, 1) + pad(0.0, 0.02)
    holds = read_ls_dyna(tmp_path, motion + spc).boundary.holds
    assert {(hold.start, hold.end) for hold in holds} == {(0.01, 0.05), (0.0, 0.02)}


def test_what_is_not_followed_is_told(tmp_path: Path) -> None:
    boundary = read_radioss(
        tmp_path,
        "/GRNOD/BOX/1\nnodes\n" + pad(1) + write_support("111 000", 1),
    ).boundary
    assert not boundary.holds
    assert "/BCS/1" in boundary.notes[0]
    boundary = read_ls_dyna(
        tmp_path,
        "*BOUNDARY_SPC_SET\n" + pad(77, 0, 1, 1, 1) + "*LOAD_BODY_RX\n" + pad(1, 1.0),
    ).boundary
    assert [note.split(" ")[0] for note in boundary.notes] == [
        "*BOUNDARY_SPC_SET",
        "*LOAD_BODY_RX",
    ]
    assert boundary.gravity is None
    (tmp_path / "MADE_0001.rad").write_text("/RUN/MADE/1\n0.1\n/BCSR/TRA/X/1\n1\n")
    boundary = read_radioss(
        tmp_path, write_group(1, 1) + write_support("111 000", 1)
    ).boundary
    assert not boundary.holds
    assert "/BCSR" in boundary.notes[0]


def write_gravity(
    function: int, scale: float, *, sensor: int = 0, group: int = 0, axis: str = "Z"
) -> str:
    return f"/GRAV/2\nmore\n{pad(function, axis, 0, sensor, group or '')[:-1]:80}{scale:20g}\n"


def find_surroundings(inventory: Inventory) -> Surroundings:
    """Return the surroundings that a deck defines for a run without other information."""
    return add_surroundings(OpenedRun((), ()), inventory).surroundings


@pytest.mark.parametrize(
    ("more", "body", "wheel", "whole"),
    [
        ("", (9.81,), (9.81,), (9.81,)),
        (
            write_gravity(0, 3.0, axis="X"),
            ((9.81**2 + 9) ** 0.5,),
            ((9.81**2 + 9) ** 0.5,),
            ((9.81**2 + 9) ** 0.5,),
        ),
        (write_gravity(5, 1.0), None, None, None),  # no such function
    ],
)
def test_gravity_by_part(
    tmp_path: Path,
    more: str,
    body: tuple[float, ...],
    wheel: tuple[float, ...],
    whole: tuple[float, ...],
) -> None:
    surroundings = find_surroundings(read_radioss(tmp_path, more)).gravity
    for part, expected in ((1, body), (8, wheel), (None, whole)):
        assert surroundings.get(part) == (pytest.approx(expected) if expected else None)


@pytest.mark.parametrize(
    ("card", "expected"),
    [
        (RAMP + write_gravity(1, -1.62), (0.0, 1.62)),
        (write_gravity(0, -1.62, sensor=3), (0.0, 1.62)),
        (
            RAMP.replace(pad(1, 0, width=20), "").replace(pad(3, 1, width=20), "")
            + write_gravity(1, 1.0),
            None,
        ),
        ("", (0.0,)),
    ],
)
def test_values_that_gravity_keeps(
    tmp_path: Path, card: str, expected: tuple[float, ...] | None
) -> None:
    name = made_car.write_starter(tmp_path, card)
    text = (tmp_path / "MADE_0000.rad").read_text()
    (tmp_path / "MADE_0000.rad").write_text(
        text.partition("/GRAV/1\n")[0] + card + "/END\n"
    )
    assert find_surroundings(read_inventory(name)).gravity.get(1) == expected


def test_gravity_on_a_group_of_nodes_is_that_of_the_parts_that_lie_in_it(
    tmp_path: Path,
) -> None:
    name = made_car.write_starter(tmp_path)
    text = (tmp_path / "MADE_0000.rad").read_text().partition("/GRAV/1\n")[0]
    (tmp_path / "MADE_0000.rad").write_text(
        text
        + write_group(1, *range(21, 25))
        + write_gravity(0, -9.81, group=1)
        + "/END\n"
    )
    surroundings = find_surroundings(read_inventory(name)).gravity
    assert (surroundings[1], surroundings.get(7)) == (
        (0.0,),
        None,
    )  # hubs: some of their nodes


@pytest.mark.parametrize(
    ("cards", "expected"),
    [
        ("", (9.81,)),
        (
            "*SET_PART_LIST\n" + pad(5) + pad(1, 2) + "*LOAD_BODY_PARTS\n" + pad(5),
            (0.0,),
        ),
        ("*LOAD_BODY_VECTOR\n" + pad(1, 1.0), None),
    ],
)
def test_body_loads_of_ls_dyna(
    tmp_path: Path, cards: str, expected: tuple[float, ...] | None
) -> None:
    surroundings = find_surroundings(read_ls_dyna(tmp_path, cards)).gravity
    assert surroundings.get(8) == expected
    assert (surroundings.get(1) == (9.81,)) is (expected is not None)


def test_the_deck_of_another_model_tells_nothing(tmp_path: Path) -> None:
    history = made_car.write_t01(tmp_path, 3.0)
    deck = made_car.write_starter(
        tmp_path, write_group(1, 1) + write_support("111 000", 1)
    )
    assert add_surroundings(
        open_run([history]), read_inventory(deck)
    ).surroundings.supports[1]
    other_inventory = read_inventory("sample_data/rollover_box.k")
    assert not add_surroundings(
        open_run([history]), other_inventory
    ).surroundings.supports
