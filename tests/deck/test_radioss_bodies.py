"""Rigid bodies that a deck lacks: their parts, their main node, and its velocity and gravity."""

from pathlib import Path

import pytest

from d2rpick.base.errors import DeckError
from d2rpick.deck.mesh import read_nodes
from d2rpick.deck.printed_card import Printing
from d2rpick.deck.printing import print_cards
from d2rpick.deck.radioss_bodies import SwitchedBodies, find_bodies
from d2rpick.deck.radioss_columns import GRAVITY
from d2rpick.deck.radioss_run import RadiossRun, find_rigid_parts, read_run
from d2rpick.deck.writing import write_deck
from d2rpick.rules import check_deck
from tests.command import put
from tests.decks import pad

REAL = 20
ENGINE = "/RUN/box/1\n 0.4\n/VERS/2022\n/TFILE/4\n1e-5\n"
ALL = (1, 2, 3, 4)
BODY = f"/RBODY/7\nbody\n{pad(99, 0, 0, 0, '', 0, 70)}"


def write_quad(part: int, left_edge: float) -> tuple[str, str]:
    """Return nodes and shell of a square part of side 1 that begins at x = left_edge, and its /PART."""
    ids = [10 * part + i for i in range(4)]
    corners = (
        (left_edge, 0.0),
        (left_edge + 1, 0.0),
        (left_edge + 1, 1.0),
        (left_edge, 1.0),
    )
    nodes = "".join(
        pad(n)[:-1] + pad(x, y, 0.0, width=REAL)
        for n, (x, y) in zip(ids, corners, strict=True)
    )
    return (
        nodes,
        f"/PART/{part}\np{part}\n{pad(part, 1)}/SHELL/{part}\n{pad(part, *ids)}",
    )


def write_starter(
    further_cards: str = "", thickness: tuple[float, ...] = (1.0, 2.0, 1.0)
) -> str:
    """Parts 1 and 2 on springs (part 4), part 3 apart from them."""
    nodes, parts = zip(
        *(
            write_quad(part, left_edge)
            for part, left_edge in ((1, 0.0), (2, 2.0), (3, 9.0))
        ),
        strict=True,
    )
    text = (
        "#RADIOSS STARTER\n/BEGIN\nbox\n"
        + pad(2022, 0)
        + 2 * pad("kg", "m", "s", width=REAL)
    )
    text += (
        f"/MAT/ELAST/1\nsteel\n{pad(7850.0, width=REAL)}{pad(2.1e11, 0.3, width=REAL)}"
    )
    for part, depth in enumerate(thickness, start=1):
        text += (
            f"/PROP/SHELL/{part}\nshell\n"
            f"{pad(24)}{pad(0.0, width=REAL)}{pad(3, 0)[:-1]}{pad(depth, width=REAL)}"
        )
    text += f"/PROP/SPRING/4\nspring\n{pad(0.0, width=REAL)}{pad(1e4, width=REAL)}"
    text += (
        "/NODE\n"
        + "".join(nodes)
        + pad(99)[:-1]
        + pad(1.5, 0.5, 0.1, width=REAL)
        + "".join(parts)
    )
    return (
        text
        + f"/PART/4\nspring\n{pad(4, 1)}/SPRING/4\n{pad(41, 11, 20)}{further_cards}/END\n"
    )


def write_run(folder: Path, further_cards: str = "", engine: str = ENGINE) -> str:
    folder.mkdir(exist_ok=True)
    (folder / "box_0001.rad").write_text(engine)
    main = put(folder / "box_0000.rad", write_starter(further_cards))
    return str(main)


def write_group(number: int, *ids: int, kind: str = "NODE") -> str:
    return f"/GRNOD/{kind}/{number}\ngroup\n{pad(*ids)}"


def write_velocity(number: int) -> str:
    return f"/INIVEL/TRA/3\nthrown\n{pad(10.0, 0.0, 0.0, width=REAL)[:-1]}{pad(number)}"


def write_gravity(number: int) -> str:
    return (
        f"/GRAV/5\ndown\n{pad(0, 'Z', 0, 0, number)[:-1]}{pad(1.0, -9.81, width=REAL)}"
    )


def write_bodies(
    tmp_path: Path, further_cards: str = "", parts: tuple[int, ...] = ALL
) -> tuple[tuple[int, ...], RadiossRun, str]:
    """Write the deck with the bodies, and read it again."""
    main = write_run(tmp_path / "deck", further_cards)
    bodies = find_bodies(main, parts)
    printing = Printing(node=bodies.nodes, end=0.4, name="box", starter=bodies.cards)
    name = write_deck(
        main,
        print_cards([(0.1, 0.2)], printing._replace(solver="radioss")),
        str(tmp_path / "next"),
    )[0]
    return bodies.nodes, read_run(name), name


def test_each_group_of_joined_parts_gets_a_body(tmp_path: Path) -> None:
    """Springs belong to the body of their parts; the copy is the deck with the cards before its end."""
    nodes, run, name = write_bodies(tmp_path)
    assert run.starter
    bodies = {body.node.value: body for body in run.starter.bodies}
    held = find_rigid_parts(
        run.starter, {node: body.group for node, body in bodies.items()}
    )
    assert {node: held[node] for node in nodes} == {100: {1, 2, 4}, 101: {3}}
    part_groups, body_groups = (
        write_starter().partition("/END\n")[::2],
        Path(name).read_text(),
    )
    assert body_groups.startswith(part_groups[0])
    assert body_groups.endswith("/END\n")
    checked = check_deck(name)
    assert not checked.findings
    assert {(w.part, w.tr, w.td) for w in checked.windows} == {
        (part, 0.1, 0.2) for part in ALL
    }
    assert (
        f"/RBODY/OFF\n{nodes[0]} {nodes[1]}\n"
        in (Path(name).parent / "box_0001.rad").read_text()
    )


def test_the_main_node_lies_at_the_centre_of_mass(tmp_path: Path) -> None:
    """Centres of the squares are at 0.5 and 2.5, the second has twice the mass; springs without mass count nothing."""
    nodes, run, _ = write_bodies(tmp_path)
    assert run.starter
    ids, coordinates = read_nodes(run.starter.named("NODE"))
    main_coordinates = [coordinates[ids == node][0].tolist() for node in nodes]
    assert main_coordinates == [
        pytest.approx([(0.5 + 2 * 2.5) / 3, 0.5, 0.0], abs=1e-9),
        pytest.approx([9.5, 0.5, 0.0], abs=1e-9),
    ]


def test_what_moves_and_pulls_the_parts_acts_on_the_main_nodes(tmp_path: Path) -> None:
    """Otherwise, the starter sets the bodies to rest (D2R407), and gravity does not act on them."""
    everything = write_group(
        1, *(10 * part + i for part in (1, 2, 3) for i in range(4))
    )
    wall = (
        "/RWALL/PLANE/3\nground\n"
        + pad(0, 0, 1, 0)
        + 2 * pad(0.0, 0.0, 0.0, width=REAL)
    )
    nodes, run, name = write_bodies(
        tmp_path,
        everything
        + write_velocity(1)
        + write_gravity(1)
        + wall
        + pad(0.0, 0.0, 1.0, width=REAL),
    )
    assert not check_deck(name).findings
    assert run.starter
    pulled = {
        number
        for card in run.starter.named("GRAV")
        for number in [card.integer(card.rows[1], GRAVITY["grnod_ID"]).value]
    }
    members = [run.starter.group_members(number) for number in sorted(pulled)]
    assert [group_members and group_members[0] for group_members in members[1:]] == [
        {node} for node in nodes
    ]
    ids = [body.id for body in run.starter.bodies]
    assert len(set(ids)) == len(ids)


def test_gravity_that_acts_on_all_nodes_needs_nothing_more(tmp_path: Path) -> None:
    assert "/GRAV" not in find_bodies(write_run(tmp_path, write_gravity(0)), ALL).cards


def test_a_body_that_the_deck_has_is_taken(tmp_path: Path) -> None:
    main = write_run(
        tmp_path,
        write_group(70, 1, 2, 4, kind="PART") + BODY,
        ENGINE + "/RBODY/OFF\n99\n",
    )
    assert find_bodies(main, (1, 2, 4)) == SwitchedBodies((99,))
    bodies = find_bodies(main, ALL)
    assert bodies.nodes == (99, 100)
    assert "/RBODY/8\n" in bodies.cards
    assert [note.partition(" with ")[0] for note in bodies.notes] == ["/RBODY"]
    assert "part 3" in bodies.notes[0]


@pytest.mark.parametrize("held", [(1,), (1, 2, 3, 4)])
def test_a_body_that_is_never_rigid_gives_its_nodes_to_the_new_one(
    tmp_path: Path, held: tuple[int, ...]
) -> None:
    """A set of parts can be written whatever bodies the deck has for other sets, if the run never activates these."""
    main = write_run(
        tmp_path / "deck",
        write_group(70, *held, kind="PART") + BODY,
        ENGINE + "/RBODY/OFF\n99\n",
    )
    bodies = find_bodies(main, (1, 2, 4))
    assert (bodies.nodes, bodies.replaced) == ((100,), (99,))
    assert "is off in the whole run and must be removed" in bodies.notes[-1]
    printing = Printing(
        node=bodies.nodes,
        end=0.4,
        name="box",
        starter=bodies.cards,
        replaced=bodies.replaced,
    )
    name = write_deck(
        main,
        print_cards([(0.1, 0.2)], printing._replace(solver="radioss")),
        str(tmp_path / "next"),
    )[0]
    starter_of_copy = read_run(name).starter
    assert starter_of_copy
    assert [body.id for body in starter_of_copy.bodies] == [8]
    checked = check_deck(name)
    assert not checked.findings
    assert {window.part for window in checked.windows} == {1, 2, 4}
    assert "99" not in (tmp_path / "next" / "box_0001.rad").read_text().split()


def test_a_body_that_is_rigid_at_some_time_stays(tmp_path: Path) -> None:
    engine = ENGINE + "/RBODY/OFF\n99\n"
    main = write_run(tmp_path, write_group(70, 1, kind="PART") + BODY, engine)
    (tmp_path / "box_0002.rad").write_text(
        ENGINE.replace("box/1", "box/2") + "/RBODY/ON\n99\n"
    )
    with pytest.raises(DeckError, match="not exactly these parts"):
        find_bodies(main, (1, 2, 4))


@pytest.mark.parametrize(
    ("more", "message"),
    [
        (
            write_group(70, 2, kind="PART") + BODY,
            r"box_0000.rad:\d+: /RBODY 7 contains nodes of parts 1, 2",
        ),
        (write_group(70, 10, 11) + BODY, "not exactly these parts"),
        (write_group(70, 1, 2, 3, kind="PART") + BODY, "not exactly these parts"),
        (
            write_group(70, 1, 2, kind="PART")
            + BODY.replace("99         0", "99         4"),
            "sensor 4 already",
        ),
        ("/GRNOD/BOX/70\nbox\n         1\n" + BODY, "nodes of /RBODY 7 are unknown"),
        (
            write_group(1, 10, 11) + write_velocity(1),
            "does not give all nodes of parts 1, 2, 4 one velocity",
        ),
        ("/INIVEL/NODE/1\nthrown\n" + pad(20), "does not give all nodes"),
        ("/TRANSFORM/TRA/1\nmoved\n", "/TRANSFORM moves nodes"),
        ("//SUBMODEL/1\nother\n", "ids of a //SUBMODEL may be moved"),
        ("#include other.inc\n", "other.inc was not read"),
    ],
)
def test_what_cannot_be_done_is_refused_in_one_line(
    tmp_path: Path, more: str, message: str
) -> None:
    with pytest.raises(DeckError, match=message) as refusal:
        find_bodies(write_run(tmp_path, more), (1, 2, 4))
    assert "\n" not in str(refusal.value)


def test_parts_without_nodes_are_named(tmp_path: Path) -> None:
    with pytest.raises(DeckError, match="parts 7, 8 are without elements"):
        find_bodies(write_run(tmp_path), (1, 7, 8))


def test_pieces_that_nothing_joins_are_told(tmp_path: Path) -> None:
    nodes, shell = write_quad(5, 20.0)
    more = "/NODE\n" + nodes + shell.partition("/SHELL/5\n")[2].join(("/SHELL/3\n", ""))
    (note,) = find_bodies(write_run(tmp_path, more), (3,)).notes
    assert note.endswith("it joins 2 pieces that nothing else connects")
