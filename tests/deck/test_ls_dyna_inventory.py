"""Elements of LS-DYNA decks, against an independent count."""

from collections import Counter
from collections.abc import Sequence
from pathlib import Path

import pytest
from hypothesis import given, strategies as st

from d2rpick.base.errors import DeckError
from d2rpick.deck import ls_dyna_inventory, read_inventory
from d2rpick.deck.model import Inventory
from d2rpick.deck.pieces import pieces_of
from d2rpick.deck.reader import read_deck
from tests.decks import read, row, write
from tests.sample_deck import DECK, FLYING, deck, radioss

HEAD = "*KEYWORD\n*PART\na\n         7         1         1\n*PART\nb\n         9         1         1\n"


def nodes(width: int = 8, real: int = 16, count: int = 24) -> str:
    """Node cards of a row of unit cubes."""
    places = [(i // 4, i % 2, i // 2 % 2) for i in range(count)]
    return "".join(
        f"{n:{width}d}" + "".join(f"{float(x):{real}.4f}" for x in place) + "\n"
        for n, place in enumerate(places, 1)
    )


def inventory(folder: Path, text: str, **files: str) -> Inventory:
    return ls_dyna_inventory.read(
        read(folder, text, {f"{name}.k": content for name, content in files.items()})
    )


def counted(found: Inventory) -> dict[int, dict[str, int]]:
    return {part: dict(counts) for part, counts in found.counts.items()}


SHELLS = row(1, 7, 1, 2, 4, 3) + row(2, 7, 5, 6, 8, 7)
WIDE = row(1, 7, 1, 2, 4, 3, width=10) + row(2, 7, 5, 6, 8, 7, width=10)
LINES = SHELLS.splitlines(keepends=True)


def after_each(line: str) -> str:
    """Shells, each with a line of an option below."""
    return "".join(f"{shell}{line}\n" for shell in LINES)


FORMS = {
    "plain": f"*ELEMENT_SHELL\n{SHELLS}",
    "i10": f"*ELEMENT_SHELL %\n{WIDE}",
    "i10 in the name": f"*ELEMENT_SHELL%\n{WIDE}",
    "commas": "*ELEMENT_SHELL\n1,7,1,2,4,3\n2,7,5,6,8,7\n",
    "commas and columns": f"*ELEMENT_SHELL\n1,7,1,2,4,3\n{LINES[1]}",
    "parameter": "*PARAMETER\nI      pid         7\n*ELEMENT_SHELL\n"
    + SHELLS.replace("       7", "    &pid", 1),
    "thickness": "*ELEMENT_SHELL_THICKNESS\n" + after_each("             1.0" * 4),
    "whole thickness": "*ELEMENT_SHELL_THICKNESS\n"
    + after_each("               1" * 4),
    "beta": "*ELEMENT_SHELL_BETA\n" + after_each("             0.0"),
    "comments and blank lines": "*ELEMENT_SHELL\n$#   eid     pid\n"
    + SHELLS.replace("\n", "\n$ 1 7 1 2 3\n\n", 1),
    "lower case": f"*Element_Shell\n{SHELLS}",
    "CR LF": f"*ELEMENT_SHELL\n{SHELLS}".replace("\n", "\r\n"),
    "triangles": "*ELEMENT_SHELL\n" + row(1, 7, 1, 2, 4, 4) + row(2, 7, 5, 6, 8),
    "trailing nodes": "*ELEMENT_SHELL\n" + SHELLS.replace("\n", "       0" * 4 + "\n"),
}


@pytest.mark.parametrize("form", FORMS)
def test_two_shells_are_counted_in_every_form(tmp_path: Path, form: str) -> None:
    mesh = f"*NODE %\n{nodes(10)}" if form == "i10" else f"*NODE\n{nodes()}"
    found = inventory(tmp_path, f"{HEAD}{mesh}{FORMS[form]}*END\n")
    assert counted(found) == {7: {"shell": 2}}
    assert found.notes == ()
    assert found.rigid_nodes([7]) == (6 if form == "triangles" else 8)


def test_long_format(tmp_path: Path) -> None:
    head = "*KEYWORD LONG=Y\n*PART\na\n" + row(7, 1, 1, width=20)
    shells = row(1, 7, 1, 2, 4, 3, width=20) + row(2, 7, 5, 6, 8, 7, width=20)
    found = inventory(
        tmp_path, f"{head}*NODE\n{nodes(20, 20)}*ELEMENT_SHELL\n{shells}*END\n"
    )
    assert counted(found) == {7: {"shell": 2}}
    assert found.rigid_nodes([7]) == 8


@pytest.mark.parametrize(
    ("elements", "expected"),
    [
        ("*ELEMENT_SOLID\n" + row(1, 7, *range(1, 9)), {7: {"solid": 1}}),
        ("*ELEMENT_SOLID (ten nodes format)\n" + row(1, 7) + row(*range(1, 9)) + row(2, 9) + row(*range(5, 15)),
         {7: {"solid": 1}, 9: {"solid": 1}}),
        ("*ELEMENT_SOLID_ORTHO\n" + row(1, 7, *range(1, 9)) + ("             1.0" * 3 + "\n") * 2, {7: {"solid": 1}}),
        ("*ELEMENT_BEAM\n" + row(1, 7, 1, 2, 3) + row(2, 9, 2, 3, 0), {7: {"beam": 1}, 9: {"beam": 1}}),
        ("*ELEMENT_BEAM_THICKNESS\n" + row(1, 7, 1, 2, 3) + "             2.0" * 4 + "\n", {7: {"beam": 1}}),
        ("*ELEMENT_BEAM_PID\n" + row(1, 7, 1, 2, 3) + row(7, 9), {7: {"beam": 1}}),
        ("*ELEMENT_DISCRETE\n" + row(1, 7, 1, 2, 0) + "       2       9       3       4       0   1.00E+00\n",
         {7: {"spring": 1}, 9: {"spring": 1}}),
        ("*ELEMENT_SOLID_H20\n" + (row(1, 7) + row(*range(1, 11)) + row(*range(11, 21))) * 2, {7: {"solid": 2}}),
        ("*ELEMENT_SOLID_TET4TOTET10\n" + row(1, 7) + row(1, 2, 3, 5), {7: {"solid": 1}}),
        ("*ELEMENT_SEATBELT\n" + row(1, 7, 1, 2) + "*ELEMENT_SEATBELT_SLIPRING\n" + row(1, 1, 2, width=10),
         {7: {"seatbelt": 1}}),
        ("*ELEMENT_TSHELL\n" + row(1, 7, *range(1, 9)), {7: {"thick shell": 1}}),
        ("*ELEMENT_MASS\n       1       1             0.5       7\n", {}),
    ],
)  # fmt: skip
def test_other_kinds(
    tmp_path: Path, elements: str, expected: dict[int, dict[str, int]]
) -> None:
    found = inventory(tmp_path, f"{HEAD}*NODE\n{nodes()}{elements}*END\n")
    assert counted(found) == expected
    assert found.notes == ()


@pytest.mark.slow
def test_two_line_solids_go_on_over_the_pieces_that_are_read_together(
    tmp_path: Path,
) -> None:
    text = "".join(row(n, 7) + row(*range(1, 9)) for n in range(1, 60_001))
    assert len(text) > 4 << 20  # a piece ends in it
    for shift in (
        "",
        "$" * 63 + "\n",
    ):  # then the other line of an element is the last of a piece
        found = inventory(
            tmp_path, f"{HEAD}*NODE\n{nodes()}*ELEMENT_SOLID\n{shift}{text}*END\n"
        )
        assert counted(found) == {7: {"solid": 60_000}}


def test_ids_move_with_a_transform_and_parts_of_other_files_share_nodes(
    tmp_path: Path,
) -> None:
    other = f"*KEYWORD\n*PART\nc\n         1         1         1\n*ELEMENT_SHELL\n{row(1, 1, 1, 2, 4, 3)}*END\n"
    transform = "*INCLUDE_TRANSFORM\nother.k\n" + row(4, 0, 20, 0, 0, width=10) + "\n\n"
    main = f"{HEAD}*NODE\n{nodes()}*ELEMENT_SHELL\n{row(1, 7, 1, 2, 4, 3)}{row(2, 9, 5, 6, 8, 7)}{transform}*END\n"
    found = inventory(tmp_path, main, other=other)
    assert counted(found) == {7: {"shell": 1}, 9: {"shell": 1}, 21: {"shell": 1}}
    assert found.neighbours == {7: frozenset(), 9: {21}, 21: {9}}
    assert found.groups([7, 9, 21]) == ((7,), (9, 21))


def test_what_is_not_followed_is_said(tmp_path: Path) -> None:
    strange = (
        "*ELEMENT_SOLID_STRANGE\n"
        + row(1, 7)
        + "*INCLUDE\nabsent.k\n*ELEMENT_SHELL\n"
        + row(1, 5, 1, 2, 4, 99)
    )
    found = inventory(tmp_path, f"{HEAD}*NODE\n{nodes()}{strange}       2")
    assert not found.complete
    told = " ".join(found.notes)
    for words in (
        "ELEMENT_SOLID_STRANGE",
        "absent.k was not read",
        "may be truncated",
        "part 5, which no *PART",
        "1 nodes of",
    ):
        assert words in told


def test_large_ids_are_kept_apart_and_numbers_beyond_them_are_not_ids(
    tmp_path: Path,
) -> None:
    head = "*KEYWORD LONG=Y\n*PART\na\n" + row(7, 1, 1, width=20) + "*ELEMENT_SHELL\n"
    first = 4_000_000_000
    shells = row(1, 7, first, first + 1, first + 2, first + 3, width=20) + row(
        2, 7, first, 5, 6, first + 9, width=20
    )
    wide = f"{3:20d}{7:20d}{'9' * 20}{first:20d}{first:20d}\n"
    found = inventory(tmp_path, f"{head}{shells}{wide}*END\n")
    assert counted(found) == {7: {"shell": 2}}
    assert found.rigid_nodes([7]) == 7


def test_a_deck_cut_at_any_byte_of_its_mesh_says_that_it_is_cut(tmp_path: Path) -> None:
    text = f"{HEAD}*NODE\n{nodes()}*ELEMENT_SHELL\n{SHELLS}"
    whole = {7: {"shell": 2}}
    for end in range(text.index("*ELEMENT") + 16, len(text) + 1):
        found = inventory(tmp_path, text[:end])
        assert sum("may be truncated" in note for note in found.notes) == 1
        assert counted(found) in ({}, {7: {"shell": 1}}, whole)
        assert not found.complete
    found = inventory(tmp_path, f"{text}*END\n")
    assert (counted(found), found.complete) == (whole, True)
    (tmp_path / "mesh.k").write_text(
        text.removeprefix(HEAD), "utf-8"
    )  # an include may do without *END
    found = inventory(tmp_path, f"{HEAD}*INCLUDE\nmesh.k\n")
    assert (counted(found), found.complete) == (whole, True)


def test_a_deck_without_parts_is_refused(tmp_path: Path) -> None:
    with pytest.raises(DeckError, match="no parts were found"):
        read_inventory(write(tmp_path, "*KEYWORD\n*END\n"))


def test_materials_and_sections_are_told(tmp_path: Path) -> None:
    cards = (
        "*MAT_RIGID\n" + row(1, width=10) + "*MAT_SPRING_ELASTIC\n" + row(2, width=10)
        + "*MAT_DAMPER_VISCOUS_TITLE\nd\n"
        + row(3, width=10) + "*MAT_FABRIC\n" + row(4, width=10) + "*MAT_SIMPLIFIED_RUBBER/FOAM\n" + row(5, width=10)
        + "*SECTION_SOLID\n" + row(1, 1, width=10)
    )  # fmt: skip
    parts = "".join(f"*PART\np{n}\n{n:10d}{1:10d}{n:10d}\n" for n in range(1, 6))
    solids = "*ELEMENT_SOLID\n" + "".join(row(n, n, *range(1, 9)) for n in range(1, 6))
    found = inventory(
        tmp_path, f"*KEYWORD\n{parts}{cards}*NODE\n{nodes()}{solids}*END\n"
    )
    kinds = {
        part: data.material.kind for part, data in found.parts.items() if data.material
    }
    assert kinds == {1: "rigid", 2: "spring", 3: "spring", 4: "airbag", 5: "deformable"}
    assert [found.parts[n].section.damped for n in (1, 2, 3)] == [None, False, True]
    assert not found.parts[
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
    text = f"*KEYWORD\n{parts}*NODE\n{nodes(count=44)}*ELEMENT_SHELL\n{''.join(row(*line) for line in lines)}*END\n"
    found = ls_dyna_inventory.read(read_deck(write(folder, text)))
    assert {part: counts["shell"] for part, counts in found.counts.items()} == Counter(
        part for part, _ in shells
    )
    own = {
        part: {n for p, node in shells if p == part for n in range(node, node + 4)}
        for part, _ in shells
    }
    assert all(found.rigid_nodes([part]) == len(used) for part, used in own.items())
    touching = {
        part: {other for other in own if other != part and own[other] & own[part]}
        for part in own
    }
    assert dict(found.neighbours) == touching


def test_the_sample_decks_are_what_their_module_writes() -> None:
    assert DECK.read_text("utf-8") == deck()
    assert {name: (FLYING / name).read_text("utf-8") for name in radioss()} == radioss()
    found = read_inventory(str(DECK))
    assert counted(found) == {1: {"shell": 94}, 2: {"shell": 15}, 3: {"shell": 4}}


def test_pieces_of_a_part_are_those_that_share_no_nodes(tmp_path: Path) -> None:
    shells = [
        (7, 1, 2, 4, 3),
        (7, 3, 4, 6, 5),
        (7, 9, 10, 11, 11),
        (9, 13, 14, 15, 16),
        (9, 16, 17, 18, 18),
    ]
    mesh = "".join(row(number, *one) for number, one in enumerate(shells, 1))
    found = inventory(
        tmp_path, HEAD + "*NODE\n" + nodes() + "*ELEMENT_SHELL\n" + mesh + "*END\n"
    )
    assert [pieces_of(found, [part]) for part in (7, 9, 3)] == [2, 1, 0]
