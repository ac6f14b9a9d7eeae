"""Elements of Radioss starter decks."""

from pathlib import Path

import pytest

from d2rpick.deck import radioss_inventory, read_inventory
from d2rpick.deck.model import Inventory
from d2rpick.deck.radioss_run import read_run
from d2rpick.rules import check_deck
from tests.computed import locate_stored, read_starter
from tests.deck.test_ls_dyna_inventory import count_elements
from tests.decks import pad

BEGIN = "#RADIOSS STARTER\n/BEGIN\nTEST\n      2022         0\n                  kg\n                  kg\n"
PROPS = (
    "/PROP/SHELL/1\nsh\n        24\n\n"
    "/PROP/SPRING/2\nspr\n                 0.1\n              200000                 300\n"
    "/PROP/SPRING/3\nspr\n                 0.1\n              200000                   0\n"
    "/PROP/SOLID/4\nsol\n         1         4\n/PROP/SOLID/5\nsol\n         1         4"
    + "         0" * 5
    + "         2\n"
)


def read_text(folder: Path, text: str) -> Inventory:
    (folder / "TEST_0000.rad").write_text(BEGIN + text + "/END\n")
    return radioss_inventory.read_radioss_inventory(
        read_run(str(folder / "TEST_0000.rad"))
    )


def write_nodes(count: int) -> str:
    return "/NODE\n" + "".join(
        f"{n:10d}{n:20d}{n % 2:20d}{n % 3:20d}\n" for n in range(1, count + 1)
    )


@pytest.mark.parametrize(
    ("elements", "kind"),
    [
        (
            "/SHELL/1\n# a comment\n" + pad(1, 1, 2, 3, 4) + "\n" + pad(2, 3, 4, 5, 6),
            "shell",
        ),
        (
            "/SH3N/1\n" + pad(1, 1, 2, 3) + pad(2, 3, 4, 5),
            "triangle",
        ),
        (
            "/BRICK/1\n" + pad(*range(1, 10)) + pad(2, *range(9, 17)),
            "solid",
        ),
        (
            "/TETRA4/1\n" + pad(1, 1, 2, 3, 4) + pad(2, 5, 6, 7, 8),
            "tetrahedron",
        ),
        (
            "/TETRA10/1\n" + pad(1) + pad(*range(1, 11)) + pad(2) + pad(*range(11, 21)),
            "tetrahedron",
        ),
        (
            "/BRIC20/1\n"
            + (pad(1, *range(1, 9)) + pad(*range(9, 17)) + pad(*range(17, 21))) * 2,
            "solid",
        ),
        ("/SPRING/1\n" + pad(1, 1, 2) + pad(2, 3, 4), "spring"),
    ],
)
def test_two_elements_of_every_kind(tmp_path: Path, elements: str, kind: str) -> None:
    read_inventory = read_text(
        tmp_path, f"{write_nodes(24)}/PART/1\na\n{pad(1, 1)}{elements}{PROPS}"
    )
    assert count_elements(read_inventory) == {1: {kind: 2}}
    assert read_inventory.notes == ()


def test_flags_of_properties_are_read(tmp_path: Path) -> None:
    parts = "".join(f"/PART/{n}\np{n}\n{pad(n, 1)}" for n in range(1, 6))
    bricks = "".join(f"/BRICK/{n}\n{pad(n, *range(1, 9))}" for n in (4, 5))
    springs = "".join(f"/SPRING/{n}\n{pad(10 + n, 1, 2)}" for n in (2, 3))
    read_inventory = read_text(
        tmp_path,
        f"{write_nodes(9)}{parts}/SHELL/1\n{pad(20, 1, 2, 3, 4)}{bricks}{springs}{PROPS}",
    )
    assert read_inventory.formulation(1, "shell").cost == "QEPH"
    assert [read_inventory.parts[n].section.damped for n in (2, 3)] == [True, False]
    assert [read_inventory.parts[n].section.turns for n in (4, 5)] == [False, True]


def test_elements_between_the_parts_of_a_body_are_rigid_with_it(tmp_path: Path) -> None:
    parts = "".join(f"/PART/{n}\np{n}\n{pad(1, 1)}" for n in (1, 2, 3))
    shells = "".join(
        f"/SHELL/{n}\n{pad(n, *range(4 * n - 3, 4 * n + 1))}" for n in (1, 2)
    )
    read_inventory = read_text(
        tmp_path,
        f"{write_nodes(9)}{parts}{shells}/SHELL/3\n{pad(3, 1, 2, 5, 6)}{PROPS}",
    )
    assert read_inventory.groups([1, 2]) == ((1,), (2,))
    assert set(read_inventory.elements_within([1, 2])) == {
        1,
        2,
    }  # two bodies: the elements between them deform
    assert set(read_inventory.elements_within([1, 3])) == {1, 3}
    assert set(read_inventory.elements_within([1, 2, 3])) == {1, 2, 3}


@pytest.mark.parametrize(
    ("without", "complete"), [("", True), ("/PART/1", False), ("/NODE", False)]
)
def test_what_is_missing_is_said(tmp_path: Path, without: str, complete: bool) -> None:
    text = (
        f"{write_nodes(4)}/PART/1\na\n{pad(1, 1)}/SHELL/1\n{pad(1, 1, 2, 3, 4)}{PROPS}"
    )
    partial_inventory = read_text(
        tmp_path, text.replace(without, "/OTHER") if without else text
    )
    assert partial_inventory.complete == complete
    assert bool(partial_inventory.notes) != complete


def test_rigid_elements_of_the_car_are_those_that_the_solver_put_off(
    tmp_path: Path,
) -> None:
    (tmp_path / "CAR_0000.rad").write_bytes(read_starter("CAR"))
    car_inventory = read_inventory(str(tmp_path / "CAR_0000.rad"))
    head, *rows = (
        line.split(",")
        for line in Path(locate_stored("car_parts.csv")).read_text("ascii").splitlines()
    )
    table = [dict(zip(head, cells, strict=True)) for cells in rows]
    assert {int(row["id"]): int(row["elements"]) for row in table} == {
        part: counts.total()
        for part, counts in car_inventory.counts.items()
        if part != 18
    }
    sets = {"all": range(1, 15), "notfirst": [n for n in range(1, 18) if n != 3], "heavy": [12, 13, 14],
            "stopped": [1, 4, 5, 7, 11]}  # fmt: skip
    for name, parts in sets.items():
        rigid = {
            part: counts.total()
            for part, counts in car_inventory.elements_within(list(parts)).items()
        }
        assert rigid == {
            int(row["id"]): int(row[f"rigid_in_{name}"])
            for row in table
            if row[f"rigid_in_{name}"] != "0"
        }


def test_an_include_that_is_absent_is_told(tmp_path: Path) -> None:
    text = f"{write_nodes(4)}/PART/1\na\n{pad(1, 1)}/SHELL/1\n{pad(1, 1, 2, 3, 4)}{PROPS}#include absent.inc\n"
    partial_inventory = read_text(tmp_path, text)
    assert not partial_inventory.complete
    assert any("absent.inc was not read" in note for note in partial_inventory.notes)


def test_a_starter_deck_that_ends_within_its_mesh_is_doubted(tmp_path: Path) -> None:
    text = f"{BEGIN}{PROPS}/PART/1\na\n{pad(1, 1)}{write_nodes(8)}/SHELL/1\n{pad(1, 1, 2, 3, 4)}{pad(2, 3, 4, 5, 6)}"
    deck = tmp_path / "TEST_0000.rad"
    for end in range(text.rindex("/SHELL/1") + 9, len(text) + 1):
        deck.write_text(text[:end])
        cut_inventory = radioss_inventory.read_radioss_inventory(read_run(str(deck)))
        assert (
            sum("may be truncated" in note for note in cut_inventory.notes),
            cut_inventory.complete,
        ) == (
            1,
            False,
        )
        assert [finding.rule for finding in check_deck(str(deck)).findings] == [
            "D2R011"
        ]
    deck.write_text(f"{text}/END\n")
    assert radioss_inventory.read_radioss_inventory(read_run(str(deck))).complete


def test_titles_may_be_empty(tmp_path: Path) -> None:
    part = read_text(
        tmp_path,
        f"{write_nodes(4)}/PART/1\n\n{pad(1, 1)}{PROPS}/SHELL/1\n{pad(1, 1, 2, 3, 4)}",
    ).parts[1]
    assert (part.title, part.section.formulations["shell"].name) == ("", "QEPH")
