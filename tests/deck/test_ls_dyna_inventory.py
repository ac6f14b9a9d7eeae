"""Elements of LS-DYNA decks, compared with an independent count."""

from collections import Counter
from collections.abc import Sequence
from pathlib import Path

import pytest
from hypothesis import given, strategies as st

from d2rpick.base.errors import DeckError
from d2rpick.deck import ls_dyna_inventory, read_inventory
from d2rpick.deck.model import Inventory
from d2rpick.deck.pieces import count_pieces
from d2rpick.deck.reader import read_deck
from tests.decks import make_row, read, write
from tests.sample_deck import DECK, FLYING, make_deck, make_radioss_files

HEAD = "*KEYWORD\n*PART\na\n         7         1         1\n*PART\nb\n         9         1         1\n"

SHELLS = make_row(1, 7, 1, 2, 4, 3) + make_row(2, 7, 5, 6, 8, 7)
WIDE = make_row(1, 7, 1, 2, 4, 3, width=10) + make_row(2, 7, 5, 6, 8, 7, width=10)
LINES = SHELLS.splitlines(keepends=True)


def write_nodes(width: int = 8, real: int = 16, count: int = 24) -> str:
    """Return the node lines of a row of unit cubes."""
    coordinates = [(i // 4, i % 2, i // 2 % 2) for i in range(count)]
    return "".join(
        f"{n:{width}d}" + "".join(f"{float(x):{real}.4f}" for x in position) + "\n"
        for n, position in enumerate(coordinates, 1)
    )


def read_text(folder: Path, text: str, **files: str) -> Inventory:
    return ls_dyna_inventory.read_ls_dyna_inventory(
        read(folder, text, {f"{name}.k": content for name, content in files.items()})
    )


def count_elements(deck_inventory: Inventory) -> dict[int, dict[str, int]]:
    return {part: dict(counts) for part, counts in deck_inventory.counts.items()}


def insert_after_each(line: str) -> str:
    """Return shells, each followed by a line of an option."""
    return "".join(f"{shell}{line}\n" for shell in LINES)


FORMS = {
    "plain": f"*ELEMENT_SHELL\n{SHELLS}",
    "i10": f"*ELEMENT_SHELL %\n{WIDE}",
    "i10 in the name": f"*ELEMENT_SHELL%\n{WIDE}",
    "commas": "*ELEMENT_SHELL\n1,7,1,2,4,3\n2,7,5,6,8,7\n",
    "commas and columns": f"*ELEMENT_SHELL\n1,7,1,2,4,3\n{LINES[1]}",
    "parameter": "*PARAMETER\nI      pid         7\n*ELEMENT_SHELL\n"
    + SHELLS.replace("       7", "    &pid", 1),
    "thickness": "*ELEMENT_SHELL_THICKNESS\n"
    + insert_after_each("             1.0" * 4),
    "whole thickness": "*ELEMENT_SHELL_THICKNESS\n"
    + insert_after_each("               1" * 4),
    "beta": "*ELEMENT_SHELL_BETA\n" + insert_after_each("             0.0"),
    "comments and blank lines": "*ELEMENT_SHELL\n$#   eid     pid\n"
    + SHELLS.replace("\n", "\n$ 1 7 1 2 3\n\n", 1),
    "lower case": f"*Element_Shell\n{SHELLS}",
    "CR LF": f"*ELEMENT_SHELL\n{SHELLS}".replace("\n", "\r\n"),
    "triangles": "*ELEMENT_SHELL\n"
    + make_row(1, 7, 1, 2, 4, 4)
    + make_row(2, 7, 5, 6, 8),
    "trailing nodes": "*ELEMENT_SHELL\n" + SHELLS.replace("\n", "       0" * 4 + "\n"),
}


@pytest.mark.parametrize("form", FORMS)
def test_two_shells_are_counted_in_every_form(tmp_path: Path, form: str) -> None:
    mesh = f"*NODE %\n{write_nodes(10)}" if form == "i10" else f"*NODE\n{write_nodes()}"
    read_inventory = read_text(tmp_path, f"{HEAD}{mesh}{FORMS[form]}*END\n")
    assert count_elements(read_inventory) == {7: {"shell": 2}}
    assert read_inventory.notes == ()
    assert read_inventory.rigid_nodes([7]) == (6 if form == "triangles" else 8)


def test_long_format(tmp_path: Path) -> None:
    head = "*KEYWORD LONG=Y\n*PART\na\n" + make_row(7, 1, 1, width=20)
    shells = make_row(1, 7, 1, 2, 4, 3, width=20) + make_row(2, 7, 5, 6, 8, 7, width=20)
    long_inventory = read_text(
        tmp_path, f"{head}*NODE\n{write_nodes(20, 20)}*ELEMENT_SHELL\n{shells}*END\n"
    )
    assert count_elements(long_inventory) == {7: {"shell": 2}}
    assert long_inventory.rigid_nodes([7]) == 8


@pytest.mark.parametrize(
    ("elements", "expected"),
    [
        ("*ELEMENT_SOLID\n" + make_row(1, 7, *range(1, 9)), {7: {"solid": 1}}),
        ("*ELEMENT_SOLID (ten nodes format)\n" + make_row(1, 7) + make_row(*range(1, 9))
          + make_row(2, 9) + make_row(*range(5, 15)),
         {7: {"solid": 1}, 9: {"solid": 1}}),
        ("*ELEMENT_SOLID_ORTHO\n" + make_row(1, 7, *range(1, 9))
          + ("             1.0" * 3 + "\n") * 2, {7: {"solid": 1}}),
        ("*ELEMENT_BEAM\n" + make_row(1, 7, 1, 2, 3) + make_row(2, 9, 2, 3, 0), {7: {"beam": 1}, 9: {"beam": 1}}),
        ("*ELEMENT_BEAM_THICKNESS\n" + make_row(1, 7, 1, 2, 3) + "             2.0" * 4 + "\n", {7: {"beam": 1}}),
        ("*ELEMENT_BEAM_PID\n" + make_row(1, 7, 1, 2, 3) + make_row(7, 9), {7: {"beam": 1}}),
        ("*ELEMENT_DISCRETE\n" + make_row(1, 7, 1, 2, 0) + "       2       9       3       4       0   1.00E+00\n",
         {7: {"spring": 1}, 9: {"spring": 1}}),
        ("*ELEMENT_SOLID_H20\n"
          + (make_row(1, 7) + make_row(*range(1, 11)) + make_row(*range(11, 21))) * 2, {7: {"solid": 2}}),
        ("*ELEMENT_SOLID_TET4TOTET10\n" + make_row(1, 7) + make_row(1, 2, 3, 5), {7: {"solid": 1}}),
        ("*ELEMENT_SEATBELT\n" + make_row(1, 7, 1, 2) + "*ELEMENT_SEATBELT_SLIPRING\n" + make_row(1, 1, 2, width=10),
         {7: {"seatbelt": 1}}),
        ("*ELEMENT_TSHELL\n" + make_row(1, 7, *range(1, 9)), {7: {"thick shell": 1}}),
        ("*ELEMENT_MASS\n       1       1             0.5       7\n", {}),
    ],
)  # fmt: skip
def test_other_kinds(
    tmp_path: Path, elements: str, expected: dict[int, dict[str, int]]
) -> None:
    mixed_inventory = read_text(
        tmp_path, f"{HEAD}*NODE\n{write_nodes()}{elements}*END\n"
    )
    assert count_elements(mixed_inventory) == expected
    assert mixed_inventory.notes == ()


@pytest.mark.slow
def test_two_line_solids_go_on_over_the_pieces_that_are_read_together(
    tmp_path: Path,
) -> None:
    text = "".join(make_row(n, 7) + make_row(*range(1, 9)) for n in range(1, 60_001))
    assert len(text) > 4 << 20  # a piece ends within the element
    for shift in (
        "",
        "$" * 63 + "\n",
    ):  # now a piece ends after the other line of an element
        solid_inventory = read_text(
            tmp_path, f"{HEAD}*NODE\n{write_nodes()}*ELEMENT_SOLID\n{shift}{text}*END\n"
        )
        assert count_elements(solid_inventory) == {7: {"solid": 60_000}}


def test_ids_move_with_a_transform_and_parts_of_other_files_share_nodes(
    tmp_path: Path,
) -> None:
    included_deck = (
        "*KEYWORD\n*PART\nc\n         1         1         1\n"
        f"*ELEMENT_SHELL\n{make_row(1, 1, 1, 2, 4, 3)}*END\n"
    )
    transform = (
        "*INCLUDE_TRANSFORM\nother.k\n" + make_row(4, 0, 20, 0, 0, width=10) + "\n\n"
    )
    elements = make_row(1, 7, 1, 2, 4, 3) + make_row(2, 9, 5, 6, 8, 7)
    main = f"{HEAD}*NODE\n{write_nodes()}*ELEMENT_SHELL\n{elements}{transform}*END\n"
    joined_inventory = read_text(tmp_path, main, other=included_deck)
    assert count_elements(joined_inventory) == {
        7: {"shell": 1},
        9: {"shell": 1},
        21: {"shell": 1},
    }
    assert joined_inventory.neighbours == {7: frozenset(), 9: {21}, 21: {9}}
    assert joined_inventory.groups([7, 9, 21]) == ((7,), (9, 21))


def test_what_is_not_followed_is_said(tmp_path: Path) -> None:
    strange = (
        "*ELEMENT_SOLID_STRANGE\n"
        + make_row(1, 7)
        + "*INCLUDE\nabsent.k\n*ELEMENT_SHELL\n"
        + make_row(1, 5, 1, 2, 4, 99)
    )
    partial_inventory = read_text(
        tmp_path, f"{HEAD}*NODE\n{write_nodes()}{strange}       2"
    )
    assert not partial_inventory.complete
    notes = " ".join(partial_inventory.notes)
    for words in (
        "ELEMENT_SOLID_STRANGE",
        "absent.k was not read",
        "may be truncated",
        "part 5, which no *PART",
        "1 nodes of",
    ):
        assert words in notes


def test_large_ids_are_kept_apart_and_numbers_beyond_them_are_not_ids(
    tmp_path: Path,
) -> None:
    head = (
        "*KEYWORD LONG=Y\n*PART\na\n" + make_row(7, 1, 1, width=20) + "*ELEMENT_SHELL\n"
    )
    first = 4_000_000_000
    shells = make_row(
        1, 7, first, first + 1, first + 2, first + 3, width=20
    ) + make_row(2, 7, first, 5, 6, first + 9, width=20)
    wide = f"{3:20d}{7:20d}{'9' * 20}{first:20d}{first:20d}\n"
    large_inventory = read_text(tmp_path, f"{head}{shells}{wide}*END\n")
    assert count_elements(large_inventory) == {7: {"shell": 2}}
    assert large_inventory.rigid_nodes([7]) == 7


def test_a_deck_cut_at_any_byte_of_its_mesh_says_that_it_is_cut(tmp_path: Path) -> None:
    text = f"{HEAD}*NODE\n{write_nodes()}*ELEMENT_SHELL\n{SHELLS}"
    whole = {7: {"shell": 2}}
    for end in range(text.index("*ELEMENT") + 16, len(text) + 1):
        cut_inventory = read_text(tmp_path, text[:end])
        assert sum("may be truncated" in note for note in cut_inventory.notes) == 1
        assert count_elements(cut_inventory) in ({}, {7: {"shell": 1}}, whole)
        assert not cut_inventory.complete
    cut_inventory = read_text(tmp_path, f"{text}*END\n")
    assert (count_elements(cut_inventory), cut_inventory.complete) == (whole, True)
    (tmp_path / "mesh.k").write_text(
        text.removeprefix(HEAD), "utf-8"
    )  # an include needs no *END
    cut_inventory = read_text(tmp_path, f"{HEAD}*INCLUDE\nmesh.k\n")
    assert (count_elements(cut_inventory), cut_inventory.complete) == (whole, True)


def test_a_deck_without_parts_is_refused(tmp_path: Path) -> None:
    with pytest.raises(DeckError, match="no parts were found"):
        read_inventory(write(tmp_path, "*KEYWORD\n*END\n"))


def test_materials_and_sections_are_told(tmp_path: Path) -> None:
    cards = (
        "*MAT_RIGID\n" + make_row(1, width=10) + "*MAT_SPRING_ELASTIC\n" + make_row(2, width=10)
        + "*MAT_DAMPER_VISCOUS_TITLE\nd\n"
        + make_row(3, width=10) + "*MAT_FABRIC\n" + make_row(4, width=10)
        + "*MAT_SIMPLIFIED_RUBBER/FOAM\n" + make_row(5, width=10)
        + "*SECTION_SOLID\n" + make_row(1, 1, width=10)
    )  # fmt: skip
    parts = "".join(f"*PART\np{n}\n{n:10d}{1:10d}{n:10d}\n" for n in range(1, 6))
    solids = "*ELEMENT_SOLID\n" + "".join(
        make_row(n, n, *range(1, 9)) for n in range(1, 6)
    )
    part_data = read_text(
        tmp_path, f"*KEYWORD\n{parts}{cards}*NODE\n{write_nodes()}{solids}*END\n"
    )
    kinds = {
        part: data.material.kind
        for part, data in part_data.parts.items()
        if data.material
    }
    assert kinds == {1: "rigid", 2: "spring", 3: "spring", 4: "airbag", 5: "deformable"}
    assert [part_data.parts[n].section.damped for n in (1, 2, 3)] == [None, False, True]
    assert not part_data.parts[
        5
    ].section.turns  # ELFORM 1 keeps its stresses in global axes


@given(
    shells=st.lists(
        st.tuples(st.integers(1, 3), st.integers(1, 40)), min_size=1, max_size=30
    )
)
def test_counts_and_nodes_agree_with_a_plain_count(
    tmp_path_factory: pytest.TempPathFactory, shells: Sequence[tuple[int, int]]
) -> None:
    folder = tmp_path_factory.mktemp("deck")
    lines = [
        (n, part, node, node + 1, node + 2, node + 3)
        for n, (part, node) in enumerate(shells, start=1)
    ]
    parts = "".join(f"*PART\np\n{part:10d}\n" for part in (1, 2, 3))
    elements = "".join(make_row(*line) for line in lines)
    text = f"*KEYWORD\n{parts}*NODE\n{write_nodes(count=44)}*ELEMENT_SHELL\n{elements}*END\n"
    random_inventory = ls_dyna_inventory.read_ls_dyna_inventory(
        read_deck(write(folder, text))
    )
    assert {
        part: counts["shell"] for part, counts in random_inventory.counts.items()
    } == Counter(part for part, _ in shells)
    nodes_of_part = {
        part: {n for p, node in shells if p == part for n in range(node, node + 4)}
        for part, _ in shells
    }
    assert all(
        random_inventory.rigid_nodes([part]) == len(used)
        for part, used in nodes_of_part.items()
    )
    touching = {
        part: {
            other_part
            for other_part in nodes_of_part
            if other_part != part and nodes_of_part[other_part] & nodes_of_part[part]
        }
        for part in nodes_of_part
    }
    assert dict(random_inventory.neighbours) == touching


def test_the_sample_decks_are_what_their_module_writes() -> None:
    assert DECK.read_text("utf-8") == make_deck()
    assert {
        name: (FLYING / name).read_text("utf-8") for name in make_radioss_files()
    } == make_radioss_files()
    sample_inventory = read_inventory(str(DECK))
    assert count_elements(sample_inventory) == {
        1: {"shell": 94},
        2: {"shell": 15},
        3: {"shell": 4},
    }


def test_pieces_of_a_part_are_those_that_share_no_nodes(tmp_path: Path) -> None:
    shells = [
        (7, 1, 2, 4, 3),
        (7, 3, 4, 6, 5),
        (7, 9, 10, 11, 11),
        (9, 13, 14, 15, 16),
        (9, 16, 17, 18, 18),
    ]
    mesh = "".join(make_row(number, *shell) for number, shell in enumerate(shells, 1))
    shell_inventory = read_text(
        tmp_path,
        HEAD + "*NODE\n" + write_nodes() + "*ELEMENT_SHELL\n" + mesh + "*END\n",
    )
    assert [count_pieces(shell_inventory, [part]) for part in (7, 9, 3)] == [2, 1, 0]
