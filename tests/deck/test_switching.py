"""Parts, part sets and their rigid windows."""

from pathlib import Path

import pytest

from d2rpick.deck.ls_dyna_inventory import find_shared_nodes
from d2rpick.deck.ls_dyna_parts import find_element_cards, read_parts
from d2rpick.rules.example import PARTS, write_automatic_card
from tests.decks import list_spans, pad, read, windows

Spans = list[tuple[int | None, float, float | None]]

PLAIN = "*DEFORMABLE_TO_RIGID\n         1\n"
SETS: dict[str, tuple[str, list[int]]] = {
    "list": ("*SET_PART_LIST\n         9\n         1         2\n", [1, 2]),
    "list with title": (
        "*SET_PART_LIST_TITLE\nall\n         9\n         1         2\n",
        [1, 2],
    ),
    "two lines": ("*SET_PART\n         9\n         1\n         2\n", [1, 2]),
    "generate": ("*SET_PART_LIST_GENERATE\n         9\n         1       100\n", [1, 2]),
    "column": ("*SET_PART_COLUMN\n         9\n         2       0.5\n", [2]),
    "add": (
        "*SET_PART\n         8\n         2\n*SET_PART_ADD\n         9\n         8\n",
        [2],
    ),
    "added to itself": ("*SET_PART_ADD\n         9\n         9\n", []),
    "collect": (
        "*SET_PART_COLLECT\n         9\n         1\n*SET_PART_COLLECT\n         9\n         2\n",
        [1, 2],
    ),
}
PART_CARDS: dict[str, tuple[str, dict[int, str]]] = {
    "pairs": ("*PART\na\n" + pad(1, 1, 7) + "\n" + pad(2, 1, "STEEL"), {1: "7", 2: "STEEL"}),
    "contact": ("*PART_CONTACT\na\n" + pad(1, 1, 7) + pad(0.1) + "b\n" + pad(2, 1, 8), {1: "7", 2: "8"}),
    "inertia": (
        "*PART_INERTIA\na\n" + pad(1, 1, 7) + pad(0, 0, 0, 1, 0) + pad(1) + pad(0) + "b\n" + pad(2, 1, 8),
        {1: "7", 2: "8"},
    ),
    "inertia in local axes": (
        "*PART_INERTIA\na\n" + pad(1, 1, 7) + pad(0, 0, 0, 1, 1) + pad(1) + pad(0) + pad(9)
        + "b\n" + pad(2, 1, 8),
        {1: "7", 2: "8"},
    ),
    "move is no part": ("*PART_MOVE\n10,0,0,0.0045\n", {}),
    "composite": ("*PART_COMPOSITE\na\n" + pad(5, 2) + pad(7, 0.1), {5: ""}),
}  # fmt: skip


def write_rigid_card(time: str, *parts: str, swset: int = 1) -> str:
    return write_automatic_card(swset, time, rigid=parts)


def write_back_card(time: str, *parts: str, swset: int = 2) -> str:
    return write_automatic_card(swset, time, deformable=parts)


CASES: dict[str, tuple[str, Spans]] = {
    "one": (
        write_rigid_card("0.02", "1") + write_back_card("0.09", "1"),
        [(1, 0.02, 0.09)],
    ),
    "cards in any order": (
        write_back_card("0.09", "1") + write_rigid_card("0.02", "1"),
        [(1, 0.02, 0.09)],
    ),
    "from the start": (PLAIN + write_back_card("0.09", "1"), [(1, 0.0, 0.09)]),
    "to the end": (write_rigid_card("0.02", "1"), [(1, 0.02, None)]),
    "two parts": (
        write_rigid_card("0.02", "1", "2") + write_back_card("0.09", "2", "1"),
        [(1, 0.02, 0.09), (2, 0.02, 0.09)],
    ),
    "parts apart": (
        write_rigid_card("1", "1", "2")
        + write_back_card("2", "1")
        + write_back_card("3", "2"),
        [(1, 1, 2), (2, 1, 3)],
    ),
    "two windows": (
        PLAIN
        + write_back_card("1", "1")
        + write_rigid_card("2", "1")
        + write_back_card("3", "1"),
        [(1, 0, 1), (1, 2, 3)],
    ),
    "merged again while rigid": (
        write_rigid_card("1", "1")
        + write_rigid_card("2", "1")
        + write_back_card("3", "1"),
        [(1, 1, 3)],
    ),
    "inverted": (write_rigid_card("2", "1") + write_back_card("1", "1"), [(1, 2, 1)]),
    "at once": (write_rigid_card("1", "1") + write_back_card("1", "1"), [(1, 1, 1)]),
    "by force": (
        write_automatic_card(1, "0", rigid=["1"], code=2)
        + write_automatic_card(2, "0", deformable=["1"], code=4),
        [],
    ),
    "restart": ("*RIGID_DEFORMABLE_R2D\n         1\n", []),
    "bare keyword": ("*DEFORMABLE_TO_RIGID\n", []),
    "inertia": (
        "*DEFORMABLE_TO_RIGID_INERTIA\n         1\n       0.0\n       1.0\n",
        [],
    ),
}


@pytest.mark.parametrize(("deck", "expected"), CASES.values(), ids=CASES.keys())
def test_windows(tmp_path: Path, deck: str, expected: Spans) -> None:
    assert list_spans(read(tmp_path, deck)) == expected


def test_what_nothing_made_rigid_is_an_orphan(tmp_path: Path) -> None:
    (orphan,) = windows(
        read(
            tmp_path,
            write_back_card("1", "1")
            + write_rigid_card("2", "1")
            + write_back_card("3", "1"),
        )
    ).orphans
    assert orphan.unit.id == 1
    assert orphan.by.time == 1


def write_set_card(set_id: int) -> str:
    return f"*DEFORMABLE_TO_RIGID\n{set_id:10d}         0      PSET\n"


@pytest.mark.parametrize(("cards", "expected"), SETS.values(), ids=SETS.keys())
def test_part_sets_are_resolved(
    tmp_path: Path, cards: str, expected: list[int]
) -> None:
    assert [
        part
        for part, _, _ in list_spans(read(tmp_path, PARTS + cards + write_set_card(9)))
    ] == expected


@pytest.mark.parametrize("cards", ["", "*SET_PART_GENERAL\n         9\nALL\n"])
def test_a_set_of_unknown_members_stays_a_set(tmp_path: Path, cards: str) -> None:
    (window,) = windows(read(tmp_path, PARTS + cards + write_set_card(9))).windows
    assert window.part is None
    assert (window.unit.id, window.unit.kind) == (9, "part set")


@pytest.mark.parametrize(
    ("deck", "expected"), PART_CARDS.values(), ids=PART_CARDS.keys()
)
def test_parts(tmp_path: Path, deck: str, expected: dict[int, str]) -> None:
    assert read_parts(read(tmp_path, deck)).material_by_part == expected


@pytest.mark.parametrize("name", ["*MAT_RIGID", "*MAT_020", "*mat_rigid_title"])
def test_rigid_materials_move_with_their_include(tmp_path: Path, name: str) -> None:
    title = "steel\n" if "title" in name else ""
    inner = f"{name}\n{title}{pad(7)}*PART\na\n{pad(1, 1, 7)}"
    deck = "*INCLUDE_TRANSFORM\na.k\n" + pad(0, 0, 100, 50) + pad(0) + pad(0)
    parts = read_parts(read(tmp_path, deck, {"a.k": inner}))
    assert parts.is_rigid(101)
    assert not parts.is_rigid(1)


def write_shell(*ids: int, width: int = 8) -> str:
    return "".join(f"{number:{width}d}" for number in ids) + "\n"


ELEMENTS: dict[str, str] = {
    "shells": "*ELEMENT_SHELL\n" + write_shell(1, 1, 1, 2, 3, 4) + write_shell(2, 2, 3, 4, 5, 6),
    "thickness": "*ELEMENT_SHELL_THICKNESS\n"
    + write_shell(1, 1, 1, 2, 3, 4) + f"{'0.1':>16s}\n" + write_shell(2, 2, 3, 4, 5, 6) + f"{'0.1':>16s}\n",
    "solids": "*ELEMENT_SOLID\n" + write_shell(1, 1, 1, 2, 3, 8) + write_shell(2, 2, 3, 4, 5, 6),
    "ten nodes": "*ELEMENT_SOLID (ten nodes format)\n"
    + write_shell(1, 1) + write_shell(1, 2, 3, 8, 9, 10, 11, 12, 13, 14)
    + write_shell(2, 2) + write_shell(21, 22, 23, 24, 25, 26, 27, 28, 29, 3),
    "ten columns": "*ELEMENT_SHELL%\n" + write_shell(1, 1, 1, 2, 3, 4, width=10) + write_shell(2, 2, 3, 4, 5, 6,
    width=10),
    "long": "*ELEMENT_SHELL+\n" + write_shell(1, 1, 1, 2, 3, 4, width=20) + write_shell(2, 2, 3, 4, 5, 6, width=20),
    "comma": "*ELEMENT_SHELL\n1,1,1,2,3,4\n2,2,3,4,5,6\n",
    "beam and shell": "*ELEMENT_BEAM\n" + write_shell(1, 1, 3, 9, 5) + "*ELEMENT_SHELL\n" + write_shell(2, 2, 3, 4, 6,
    7),
}  # fmt: skip


@pytest.mark.parametrize("deck", ELEMENTS.values(), ids=ELEMENTS.keys())
def test_shared_nodes(tmp_path: Path, deck: str) -> None:
    cards = find_element_cards(read(tmp_path, deck), searched=True)
    assert find_shared_nodes(cards, {1: 1, 2: 2})[(1, 2)] == 3
    assert find_shared_nodes(cards, {1: 1, 2: 1}) == {}
    assert find_shared_nodes(cards, {1: 1, 3: 3}) == {}


def test_the_third_node_of_a_beam_is_not_shared(tmp_path: Path) -> None:
    deck = (
        "*ELEMENT_BEAM\n"
        + write_shell(1, 1, 8, 9, 3)
        + "*ELEMENT_SHELL\n"
        + write_shell(2, 2, 3, 4, 6, 7)
    )
    assert (
        find_shared_nodes(
            find_element_cards(read(tmp_path, deck), searched=True), {1: 1, 2: 2}
        )
        == {}
    )
