"""Flaws of rigid bodies, compared with results of OpenRadioss (bd4557ba7) for these decks.

The decks are the strip of four shells of `tests.deck.test_openradioss`: nodes 1 to 10, 0.1 apart, and main node 99.
"""

from pathlib import Path

import pytest

from d2rpick.deck import read_inventory
from d2rpick.deck.radioss_files import AT_REST, NOT_FOLLOWED, THROUGH_WALL, Flaw
from d2rpick.deck.radioss_flaws import find_flaws
from d2rpick.deck.radioss_run import read_run
from tests.deck.test_openradioss import MAIN, write_starter
from tests.decks import pad

WIDE = 20
OFF, ON = f"/RBODY/OFF\n{MAIN}\n", f"/RBODY/ON\n{MAIN}\n"
ALL = f"/GRNOD/NODE/7\nall\n{pad(*range(1, 11))}{pad(MAIN)}"
SENSOR = f"/SENSOR/TIME/5\nclock\n{pad(0.001, 0.002, width=WIDE)}"

LISTED = "/INIVEL/NODE/1\nlist\n" + "".join(
    f"{pad(node, 0)[:-1]}{pad(10.0, 0.0, 0.0, width=WIDE)}\n" for node in range(1, 11)
)
MAINS = f"/GRNOD/NODE/98\nmain\n{pad(MAIN)}"
CAP = "/DTIX\n1e-5 1e-5\n"


def find_run_flaws(
    folder: Path, further_cards: str = "", *legs: str, deck: str = ""
) -> tuple[Flaw, ...]:
    """Return the flaws of the strip with further cards; ``legs`` are the lines of each leg below /RUN."""
    (folder / "strip_0000.rad").write_text(
        (deck or write_starter()).replace("/TH/PART/1", f"{further_cards}/TH/PART/1")
    )
    for number, text in enumerate(legs or (OFF,), start=1):
        (folder / f"strip_{number:04d}.rad").write_text(
            f"/RUN/strip/{number}\n{number / 1000}\n{text}"
        )
    return find_flaws(read_run(str(folder / "strip_0000.rad")), {MAIN})


def list_codes(run_flaws: tuple[Flaw, ...]) -> list[str]:
    return [flaw.code for flaw in run_flaws]


def write_wall(
    kind: str,
    reach: float,
    *points: tuple[float, ...],
    diameter: float = 0.0,
    fields: str = "",
) -> str:
    sizes = pad(reach, 0.0, diameter, 0.0, width=WIDE)[:-1] + pad(0)
    return f"/RWALL/{kind}\nwall\n{fields or pad(0, 0, 0, 0)}{sizes}" + "".join(
        pad(*point, width=WIDE) for point in points
    )


@pytest.mark.parametrize(
    ("text", "taken"),
    [
        (write_wall("PLANE/1", 0.25, (0.05, 0, 0), (1, 0, 0)), 4),
        (write_wall("PLANE/1", 0.15, (0.35, 0, 0), (0, 0, 0)), 4),
        (
            write_wall("PLANE/1", 0.05, (0, 0, 0), (0, 1, 0), fields=pad(0, 0, 0, 2)),
            4,
        ),
        (write_wall("CYL/1", 0.15, (0.2, 0.05, 0), (0.2, 0.05, 1), diameter=0.05), 6),
        (write_wall("CYL/1", 0.1, (-0.1, 0, 0), (1, 0, 0), diameter=0.02), 5),
        (write_wall("SPHER/1", 0.2, (0, 0, 0), diameter=0.1), 5),
        (write_wall("PARAL/1", 0.1, (0.15, 0, -1), (0.15, 1, -1), (0.15, 0, 1)), 2),
        (
            write_wall(
                "PARAL/1",
                0.1,
                (0.15, 0, -1),
                (0.15, 0, 1),
                (0.15, 1, -1),
                fields=pad(0, 0, 2, 0),
            ),
            4,
        ),
        (
            write_wall(
                "PLANE/1",
                0.25,
                (1, 0, 0, 0),
                (1, 0.05, 0.01),
                fields=pad(MAIN, 0, 0, 0),
            ),
            6,
        ),
        (write_wall("LAGMUL/PLANE/1", 0.25, (0.05, 0, 0), (1, 0, 0)), 4),
        (
            "/GRNOD/PART/77\nall\n"
            + pad(1)
            + write_wall("PLANE/1", 0, (0, 0, 0), (1, 0, 0), fields=pad(0, 0, 77, 0)),
            10,
        ),
        (
            write_wall(
                "PLANE/1",
                0.25,
                (0.05, 0, 0),
                (1, 0, 0),
                fields=pad(0, 0, 0, 0, 1),
            ),
            4,
        ),  # before 2026 there is no Iform
    ],
    ids=lambda text: text.split("\n", 1)[0] if isinstance(text, str) else "",
)
def test_as_many_nodes_are_taken_from_a_wall_as_the_starter_reports(
    tmp_path: Path, text: str, taken: int
) -> None:
    (run_flaws,) = find_run_flaws(tmp_path, text)
    assert run_flaws.code == THROUGH_WALL
    assert f"removes {taken} of" in run_flaws.message
    assert run_flaws.place.file.endswith("strip_0000.rad")


GROUND = write_wall("PLANE/1", 0.25, (0.05, 0, 0), (1, 0, 0))


def set_ikrem(deck: str, value: int = 1) -> str:
    return deck.replace(pad(1, 0, 0, 0), pad(1, value, 0, 0))


def test_a_wall_keeps_nodes_by_the_ikrem_of_the_body_and_of_that_with_the_highest_id(
    tmp_path: Path,
) -> None:
    second_body = (
        "/NODE\n"
        + pad(98)[:-1]
        + pad(0.2, 0.05, 0.05, width=WIDE)
        + "/RBODY/{}\nother\n"
        + pad(98)
    )
    assert list_codes(find_run_flaws(tmp_path, GROUND)) == [THROUGH_WALL]
    assert find_run_flaws(tmp_path, GROUND, deck=set_ikrem(write_starter())) == ()
    higher, lower = second_body.format(2), second_body.format(2)
    assert list_codes(
        find_run_flaws(tmp_path, GROUND + higher, deck=set_ikrem(write_starter()))
    ) == [THROUGH_WALL]
    deck = set_ikrem(write_starter()).replace("/RBODY/1", "/RBODY/3")
    assert find_run_flaws(tmp_path, GROUND + lower, deck=deck) == ()


def test_a_wall_keeps_the_nodes_of_a_body_with_a_sensor(tmp_path: Path) -> None:
    deck = write_starter().replace(pad(MAIN, 0, 0, 0)[:-1], pad(MAIN, 5, 0, 0)[:-1])
    assert find_run_flaws(tmp_path, SENSOR + GROUND, deck=deck) == ()


def test_a_wall_with_the_penalty_formulation_keeps_its_nodes(tmp_path: Path) -> None:
    deck = write_starter().replace(pad(2022, 0), pad(2026, 0))
    assert (
        find_run_flaws(
            tmp_path,
            GROUND.replace(pad(0, 0, 0, 0), pad(0, 0, 0, 0, 1)),
            deck=deck,
        )
        == ()
    )
    assert list_codes(find_run_flaws(tmp_path, GROUND, deck=deck)) == [THROUGH_WALL]


def write_velocity(group: int, kind: str = "TRA") -> str:
    return f"/INIVEL/{kind}/1\nthrown\n{pad(10.0, 0.0, 0.0, width=WIDE)[:-1]}{pad(group, 0)}"


def write_spin(group: int) -> str:
    return f"/INIVEL/AXIS/1\nspin\n{pad('Z', 0, group)}{pad(10.0, 0.0, 0.0, 0.0, width=WIDE)}"


@pytest.mark.parametrize(
    ("text", "moves"),  # whether the kinetic energy at the start exceeded 0 in OpenRadioss
    [
        (write_velocity(1), False), (write_velocity(7) + ALL, True), (write_velocity(98) + MAINS, True),
         (write_velocity(2), False),
        (write_spin(1), False), (write_spin(7) + ALL, True), (LISTED, False), (write_velocity(1, "T+G"), False),
        (write_velocity(1) + write_velocity(98) + MAINS, True),
    ],
)  # fmt: skip
def test_a_body_that_the_starter_lets_rest_is_found(
    tmp_path: Path, text: str, moves: bool
) -> None:
    for legs in ((OFF, ON), (ON, OFF)):
        assert list_codes(find_run_flaws(tmp_path, text, *legs)) == (
            [] if moves else [AT_REST]
        )


def test_a_velocity_that_comes_later_or_is_none_lets_no_body_rest(
    tmp_path: Path,
) -> None:
    assert find_run_flaws(tmp_path, write_velocity(1) + pad(0.0005, width=WIDE)) == ()
    assert find_run_flaws(tmp_path, write_velocity(1) + pad("", "", 5)) == ()
    assert find_run_flaws(tmp_path, write_velocity(1).replace("10.0", " 0.0")) == ()
    assert (
        find_run_flaws(
            tmp_path,
            "/INIVEL/FVM/1\nfluid\n" + pad(10.0, 0.0, 0.0, width=WIDE),
        )
        == ()
    )


def write_start(*nodes: int, type_: int = 1) -> str:
    return f"/INIV/TRA/X/{type_}\n10.0\n{' '.join(map(str, nodes))}\n"


@pytest.mark.parametrize(
    ("legs", "moves"),  # as above, in the leg of the /INIV
    [
        ((ON + CAP + write_start(MAIN, MAIN), OFF), True), ((ON + CAP + write_start(1, 10), OFF), False),
        ((ON + CAP + write_start(1, MAIN), OFF), True), ((CAP + write_start(1, 10), OFF), False),
        ((OFF, ON + CAP + write_start(1, 10)), False), ((OFF + write_start(1, 10), ON), True),
        ((ON + CAP + write_start(2, type_=2), OFF), False), ((ON + CAP + write_start(7, type_=2), OFF), True),
        ((ON + CAP + write_start(1, 2, 3, type_=0), OFF), False), ((ON + CAP + write_start(1, MAIN, type_=0), OFF),
         True),
        ((ON + CAP + "/INIV/AXIS/Z/1\n0\n0 0 0 10.0\n1 10\n", OFF), False),
    ],
)  # fmt: skip
def test_a_body_that_an_engine_file_lets_rest_is_found(
    tmp_path: Path, legs: tuple[str, ...], moves: bool
) -> None:
    assert list_codes(find_run_flaws(tmp_path, ALL, *legs)) == (
        [] if moves else [AT_REST]
    )


def test_a_velocity_of_the_first_leg_stands_for_that_of_the_starter(
    tmp_path: Path,
) -> None:
    """/INIV moves the nodes of an inactive body, whatever velocity the starter gave them."""
    assert find_run_flaws(tmp_path, write_velocity(1), OFF + write_start(1, 10)) == ()


@pytest.mark.parametrize(
    ("text", "legs"),
    [
        (
            "/GRNOD/BOX/8\nbox\n"
            + pad(1)
            + write_wall("PLANE/1", 0, (0, 0, 0), (1, 0, 0), fields=pad(0, 0, 8, 0)),
            (),
        ),
        (GROUND.replace(pad(0, 0, 0, 0), pad(0, 0, 0, 8)), ()),
        ("/TRANSFORM/TRA/1\n" + GROUND, ()),
        (write_wall("CONE/1", 0.1, (0, 0, 0), (1, 0, 0)), ()),
        (write_wall("PLANE/1", 0.1, (0, 0, 0), (0, 0, 0)), ()),
        (
            write_wall("PLANE/1", 0.1, (0, 0, 0), (1, 0, 0), fields=pad(97, 0, 0, 0)),
            (),
        ),
        (write_velocity(8), ()),
        ("", (ON + CAP + write_start(8, type_=2), OFF)),
        ("//SUBMODEL/1\nmoved\n" + write_velocity(1), ()),
        (
            f"/PART/3\nfluid\n{pad(1, 1)}/SPHCEL/3\n{pad(1, 1)}/GRNOD/PART/8\nfluid\n{pad(3)}{write_velocity(8)}",
            (),
        ),
    ],
)
def test_what_cannot_be_resolved_is_said_and_not_judged(
    tmp_path: Path, text: str, legs: tuple[str, ...]
) -> None:
    assert set(list_codes(find_run_flaws(tmp_path, text, *legs))) == {NOT_FOLLOWED}


def test_a_body_whose_nodes_are_not_known_is_said(tmp_path: Path) -> None:
    deck = write_starter().replace("/GRNOD/NODE/1\n", "/GRNOD/BOX/1\n")
    (run_flaws,) = find_run_flaws(tmp_path, write_velocity(7) + ALL, deck=deck)
    assert run_flaws.code == NOT_FOLLOWED
    assert run_flaws.message.startswith("the nodes of group 1 of /RBODY 1 are unknown")


def test_no_body_rests_for_certain_where_an_include_is_missing(tmp_path: Path) -> None:
    assert (
        find_run_flaws(tmp_path, write_velocity(1) + "#include velocities.inc\n") == ()
    )


def test_the_inventory_has_the_flaws_and_what_the_run_keeps_off(tmp_path: Path) -> None:
    find_run_flaws(tmp_path, write_velocity(1) + GROUND, OFF)
    inventory = read_inventory(str(tmp_path / "strip_0000.rad"))
    assert list_codes(inventory.flaws) == [THROUGH_WALL, AT_REST]
    assert inventory.kept_off == (MAIN,)
    find_run_flaws(tmp_path, write_velocity(1), OFF, ON)
    assert read_inventory(str(tmp_path / "strip_0000.rad")).kept_off == ()
    for name in ("strip_0001.rad", "strip_0002.rad"):
        (tmp_path / name).unlink()
    assert list_codes(read_inventory(str(tmp_path / "strip_0000.rad")).flaws) == [
        AT_REST
    ]  # any body may be switched
