"""Cards printed for 20 folders of runs, pasted into their decks, and checked: nothing is objected to.

Each folder has something on the parts that a card must respect: parts that share nodes, nodal rigid bodies, joints,
included files, restarts; in Radioss several bodies, groups and included files.
"""

import shutil
from collections.abc import Callable, Mapping
from pathlib import Path

import pytest

from tests.command import MATSUM, ROOT, put, run
from tests.decks import wide
from tests.sample_deck import DECK

pytestmark = pytest.mark.usefixtures("by_level")

DATABASES = "*DATABASE_MATSUM\n     0.001\n*DATABASE_GLSTAT\n     0.001\n"


def node_set(number: int, *nodes: int) -> str:
    return f"*SET_NODE_LIST\n{wide(number)}{wide(*nodes)}"


def nodal_body(number: int, *nodes: int, option: str = "") -> str:
    return (
        node_set(number, *nodes)
        + f"*CONSTRAINED_NODAL_RIGID_BODY{option}\n{wide(number, 0, number)}"
    )


def box(folder: Path, more: str = "") -> Path:
    """Write the sample run of LS-DYNA: a box (part 1), a step on it (2), and the sled (3)."""
    shutil.copy(MATSUM, folder / "matsum")
    text = DECK.read_text("utf-8").replace("*END", f"{DATABASES}{more}*END")
    return put(folder / "main.k", text)


def with_cards(*cards: str) -> Callable[[Path], Path]:
    return lambda folder: box(folder, "".join(cards))


def with_include(folder: Path) -> Path:
    """Move all but the title into a file that another one includes."""
    main = box(folder, nodal_body(9, 1, 2))
    put(folder / "mesh.k", main.read_text("utf-8"))
    put(folder / "outer.k", "*KEYWORD\n*INCLUDE\nmesh.k\n*END\n")
    return put(main, "*KEYWORD\n*INCLUDE\nouter.k\n*END\n")


def with_parameters(folder: Path) -> Path:
    return box(
        folder,
        "*PARAMETER\nR tend          0.43\n*CONTROL_TERMINATION\n     &tend\n",
    )


def with_restart(folder: Path) -> Path:
    main = box(folder, "*CONTROL_TERMINATION\n      0.43\n")
    put(
        folder / "later.k",
        "*KEYWORD\n*CONTROL_TERMINATION\n       0.6\n*RIGID_DEFORMABLE_R2D\n         3\n*END\n",
    )
    return main


def with_line_ends(folder: Path) -> Path:
    main = box(folder)
    main.write_bytes(main.read_bytes().replace(b"\n", b"\r\n"))
    return main


def without_end(folder: Path) -> Path:
    main = box(folder)
    return put(main, main.read_text("utf-8").replace("*END\n", ""))


def with_switches(folder: Path) -> Path:
    """Take the first ids of switch sets for a part that is not the card's."""
    first = wide(901, 0, 0.01, 0.0, 0.0, 0, 0, 0)
    return box(
        folder,
        f"*DEFORMABLE_TO_RIGID_AUTOMATIC\n{first}{wide(0, 0, 0, 0.0, 1, 0, 0.0)}{wide(3, 0)}",
    )


LS_DYNA: Mapping[str, Callable[[Path], Path]] = {
    "plain": with_cards(),
    "a nodal rigid body on one part": with_cards(nodal_body(9, 1, 2, 4)),
    "a nodal rigid body from part to part": with_cards(nodal_body(9, 1, 51)),
    "two nodal rigid bodies, one inertial": with_cards(
        nodal_body(9, 1, 2),
        node_set(8, 3, 4),
        f"*CONSTRAINED_NODAL_RIGID_BODY_INERTIA\n{wide(8, 0, 8)}{wide(0.0, 0.0, 0.0, 1.0)}"
        f"{wide(1.0, 0.0, 0.0, 1.0, 0.0, 1.0)}{wide(0.0, 0.0, 0.0)}",
    ),
    "a spotweld": with_cards(f"*CONSTRAINED_SPOTWELD\n{wide(1, 51)}"),
    "extra nodes of the sled elsewhere": with_cards(
        f"*NODE\n{9001:8d}{0.0:16g}{0.0:16g}{0.0:16g}\n*CONSTRAINED_EXTRA_NODES_NODE\n{wide(3, 9001)}"
    ),
    "a contact and a wall": with_cards(
        f"*CONTACT_AUTOMATIC_SINGLE_SURFACE_ID\n{wide(4)}\n{wide(0, 0, 0, 0)}",
        f"*RIGIDWALL_PLANAR_ID\n{wide(7)}\n{wide(0, 0, 0)}{wide(0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.3)}",
    ),
    "sets of parts": with_cards(
        f"*SET_PART_LIST\n{wide(901)}{wide(1, 2)}*SET_PART_LIST\n{wide(950)}{wide(1)}"
    ),
    "included files": with_include,
    "parameters": with_parameters,
    "a restart": with_restart,
    "line ends of another system": with_line_ends,
    "no end": without_end,
    "switch sets of another part": with_switches,
}
FLYING = ("--part", "flying")


def paste_and_check(main: Path, card: str) -> str:
    text = main.read_bytes().decode("latin-1")
    end = text.rfind("*END")
    text = f"{text}{card}" if end < 0 else f"{text[:end]}{card}{text[end:]}"
    main.write_bytes(text.encode("latin-1"))
    return run("check", "--fail-on", "warning", str(main)).stdout


@pytest.mark.parametrize("name", LS_DYNA)
def test_a_card_of_ls_dyna_is_clean_in_its_deck(name: str, tmp_path: Path) -> None:
    main = LS_DYNA[name](tmp_path)
    result = run("plan", str(tmp_path), *FLYING, "-f", "card")
    assert result.exit_code == 0, result.stderr
    assert "card-objection" not in result.stderr
    told = paste_and_check(main, result.stdout)
    assert "parts 1, 2: rigid" in told
    assert "0 errors, 0 warnings" in told, told


MAIN, OTHER = 101, 102  # main nodes
BODIED = (
    "/RBODY/{}\nbody\n{}{:20g}{}" + 2 * wide(0.0, 0.0, 0.0, width=20) + wide(0, 0, 0)
)


def body(number: int, node: int, group: int) -> str:
    return BODIED.format(number, wide(node, 0, 0, 0)[:-1], 0.0, wide(group, 0, 0, 0))


def parts_group(number: int, *parts: int) -> str:
    return f"/GRNOD/PART/{number}\nparts\n{wide(*parts)}"


def plates(folder: Path, more: str = "", off: str = "") -> Path:
    """Write two plates that share nodes (parts 1 and 2) and one apart (3), with the history of the sample box."""
    text = f"#RADIOSS STARTER\n/BEGIN\nBOX\n{wide(2022, 0)}/TITLE\nplates\n/MAT/ELAST/1\nsteel\n"
    text += wide(7850.0, width=20) + wide(2.1e11, 0.3, width=20)
    text += f"/PROP/SHELL/1\nshell\n{wide(24)}\n{wide(3, 0)[:-1]}{0.005:20g}\n/NODE\n"
    corners = [(x, y) for x in (0.0, 1.0, 2.0, 4.0, 5.0) for y in (0.0, 1.0)]
    places = dict(enumerate(corners, start=1)) | {MAIN: (0.5, 2.0), OTHER: (1.5, 2.0)}
    for node, place in places.items():
        text += wide(node)[:-1] + wide(*place, 0.0, width=20)
    elements = {1: (1, 3, 4, 2), 2: (3, 5, 6, 4), 3: (7, 9, 10, 8)}
    for part, nodes in elements.items():
        title = ("box", "step", "sled")[part - 1]
        text += (
            f"/PART/{part}\n{title}\n{wide(1, 1)}/SHELL/{part}\n{wide(part, *nodes)}"
        )
    shutil.copy(ROOT / "sample_data" / "rollover_boxT01", folder / "BOXT01")
    engine = f"/RUN/BOX/1\n0.43\n/VERS/2022\n/DT\n0.9 0.0\n{off}/TFILE/4\n0.0001\n"
    put(folder / "BOX_0001.rad", engine)
    return put(folder / "BOX_0000.rad", f"{text}{more}/END\n")


def with_body(*cards: str, off: int | str = MAIN) -> Callable[[Path], Path]:
    return lambda folder: plates(folder, "".join(cards), f"/RBODY/OFF\n{off}\n")


def with_included_body(folder: Path) -> Path:
    put(folder / "body.inc", parts_group(8, 1, 2) + body(5, MAIN, 8) + "# end")
    return plates(folder, "#include body.inc\n", f"/RBODY/OFF\n{MAIN}\n")


RADIOSS: Mapping[str, Callable[[Path], Path]] = {
    "without a body": plates,
    "a body of both parts": with_body(parts_group(8, 1, 2), body(5, MAIN, 8)),
    "a body of the nodes": with_body(
        f"/GRNOD/NODE/8\nnodes\n{wide(1, 2, 3, 4, 5, 6)}", body(5, MAIN, 8)
    ),
    "two bodies that are merged": with_body(
        parts_group(8, 1),
        f"/GRNOD/NODE/9\nnodes\n{wide(5, 6)}",
        body(5, MAIN, 8),
        body(6, OTHER, 9),
        f"/MERGE/RBODY/1\nmerged\n{wide(5, 1, 6, 1)}",
    ),
    "a body of the part that lies apart": with_body(
        parts_group(8, 1, 2),
        parts_group(9, 3),
        body(5, MAIN, 8),
        body(6, OTHER, 9),
        off=f"{MAIN} {OTHER}",
    ),
    "a main node that the starter makes": with_body(
        parts_group(8, 1, 2), body(5, 0, 8), off=OTHER + 1
    ),
    "an included body": with_included_body,
}


def write_pieces(folder: Path, main: Path, printed: str) -> None:
    """Put what is printed where its headings say: into the starter deck, and into engine files."""
    heading = "# ---- "
    for piece in printed.split(heading)[1:]:
        first, _, content = piece.partition("\n")
        if first.startswith("into "):
            text = main.read_text("utf-8").replace("/END\n", f"{content}/END\n")
            put(main, text)
        else:
            put(folder / first.split()[0], content)


@pytest.mark.parametrize("name", RADIOSS)
def test_a_card_of_radioss_is_clean_in_its_run(name: str, tmp_path: Path) -> None:
    main = RADIOSS[name](tmp_path)
    times = ("--tr", "0.1", "--td", "0.37", "--part", "1,2", "--after", "0.09")
    result = run("card", *times, "--history", str(tmp_path))
    assert "/RBODY/ON" in result.stdout, result.stderr
    assert "card-objection" not in result.stderr
    write_pieces(tmp_path, main, result.stdout)
    told = run("check", "--fail-on", "warning", str(main)).stdout
    assert "parts 1, 2: rigid from 0.1 to 0.37" in told
    assert "0 errors, 0 warnings" in told, told
