"""Cards printed for 20 run folders, pasted into their decks and checked, cause no findings.

The parts in each folder have a feature that a card must respect: shared nodes, nodal rigid bodies, joints, included
files, restarts; in Radioss several bodies, groups and included files.
"""

import shutil
from collections.abc import Callable, Mapping
from pathlib import Path

import pytest

from tests.command import MATSUM, ROOT, put, run
from tests.decks import pad
from tests.sample_deck import DECK

pytestmark = pytest.mark.usefixtures("by_level")

DATABASES = "*DATABASE_MATSUM\n     0.001\n*DATABASE_GLSTAT\n     0.001\n"

FLYING = ("--part", "flying")
MAIN, OTHER = 101, 102  # main nodes
BODIED = "/RBODY/{}\nbody\n{}{:20g}{}" + 2 * pad(0.0, 0.0, 0.0, width=20) + pad(0, 0, 0)


def write_node_set(number: int, *nodes: int) -> str:
    return f"*SET_NODE_LIST\n{pad(number)}{pad(*nodes)}"


def write_nodal_body(number: int, *nodes: int, option: str = "") -> str:
    return (
        write_node_set(number, *nodes)
        + f"*CONSTRAINED_NODAL_RIGID_BODY{option}\n{pad(number, 0, number)}"
    )


def write_box(folder: Path, extra_text: str = "") -> Path:
    """Write the sample run of LS-DYNA: a box (part 1), a step on it (2), and the sled (3)."""
    shutil.copy(MATSUM, folder / "matsum")
    text = DECK.read_text("utf-8").replace("*END", f"{DATABASES}{extra_text}*END")
    return put(folder / "main.k", text)


def add_cards(*cards: str) -> Callable[[Path], Path]:
    return lambda folder: write_box(folder, "".join(cards))


def move_to_include(folder: Path) -> Path:
    """Move everything except the title to a file that is included by another one."""
    main = write_box(folder, write_nodal_body(9, 1, 2))
    put(folder / "mesh.k", main.read_text("utf-8"))
    put(folder / "outer.k", "*KEYWORD\n*INCLUDE\nmesh.k\n*END\n")
    return put(main, "*KEYWORD\n*INCLUDE\nouter.k\n*END\n")


def use_parameters(folder: Path) -> Path:
    return write_box(
        folder,
        "*PARAMETER\nR tend          0.43\n*CONTROL_TERMINATION\n     &tend\n",
    )


def add_restart(folder: Path) -> Path:
    main = write_box(folder, "*CONTROL_TERMINATION\n      0.43\n")
    put(
        folder / "later.k",
        "*KEYWORD\n*CONTROL_TERMINATION\n       0.6\n*RIGID_DEFORMABLE_R2D\n         3\n*END\n",
    )
    return main


def change_line_ends(folder: Path) -> Path:
    main = write_box(folder)
    main.write_bytes(main.read_bytes().replace(b"\n", b"\r\n"))
    return main


def drop_end(folder: Path) -> Path:
    main = write_box(folder)
    return put(main, main.read_text("utf-8").replace("*END\n", ""))


def add_switches(folder: Path) -> Path:
    """Use the first ids of switch sets for a part outside the card."""
    first = pad(901, 0, 0.01, 0.0, 0.0, 0, 0, 0)
    return write_box(
        folder,
        f"*DEFORMABLE_TO_RIGID_AUTOMATIC\n{first}{pad(0, 0, 0, 0.0, 1, 0, 0.0)}{pad(3, 0)}",
    )


LS_DYNA: Mapping[str, Callable[[Path], Path]] = {
    "plain": add_cards(),
    "a nodal rigid body on one part": add_cards(write_nodal_body(9, 1, 2, 4)),
    "a nodal rigid body from part to part": add_cards(write_nodal_body(9, 1, 51)),
    "two nodal rigid bodies, one inertial": add_cards(
        write_nodal_body(9, 1, 2),
        write_node_set(8, 3, 4),
        f"*CONSTRAINED_NODAL_RIGID_BODY_INERTIA\n{pad(8, 0, 8)}{pad(0.0, 0.0, 0.0, 1.0)}"
        f"{pad(1.0, 0.0, 0.0, 1.0, 0.0, 1.0)}{pad(0.0, 0.0, 0.0)}",
    ),
    "a spotweld": add_cards(f"*CONSTRAINED_SPOTWELD\n{pad(1, 51)}"),
    "extra nodes of the sled elsewhere": add_cards(
        f"*NODE\n{9001:8d}{0.0:16g}{0.0:16g}{0.0:16g}\n*CONSTRAINED_EXTRA_NODES_NODE\n{pad(3, 9001)}"
    ),
    "a contact and a wall": add_cards(
        f"*CONTACT_AUTOMATIC_SINGLE_SURFACE_ID\n{pad(4)}\n{pad(0, 0, 0, 0)}",
        f"*RIGIDWALL_PLANAR_ID\n{pad(7)}\n{pad(0, 0, 0)}{pad(0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.3)}",
    ),
    "sets of parts": add_cards(
        f"*SET_PART_LIST\n{pad(901)}{pad(1, 2)}*SET_PART_LIST\n{pad(950)}{pad(1)}"
    ),
    "included files": move_to_include,
    "parameters": use_parameters,
    "a restart": add_restart,
    "line ends of another system": change_line_ends,
    "no end": drop_end,
    "switch sets of another part": add_switches,
}


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
    check_text = paste_and_check(main, result.stdout)
    assert "parts 1, 2: rigid" in check_text
    assert "0 errors, 0 warnings" in check_text, check_text


def write_body(number: int, node: int, group: int) -> str:
    return BODIED.format(number, pad(node, 0, 0, 0)[:-1], 0.0, pad(group, 0, 0, 0))


def write_parts_group(number: int, *parts: int) -> str:
    return f"/GRNOD/PART/{number}\nparts\n{pad(*parts)}"


def write_plates(folder: Path, extra_text: str = "", nodes_off: str = "") -> Path:
    """Write two plates that share nodes (parts 1 and 2) and a separate one (3), with the history of the sample box."""
    text = f"#RADIOSS STARTER\n/BEGIN\nBOX\n{pad(2022, 0)}/TITLE\nplates\n/MAT/ELAST/1\nsteel\n"
    text += pad(7850.0, width=20) + pad(2.1e11, 0.3, width=20)
    text += f"/PROP/SHELL/1\nshell\n{pad(24)}\n{pad(3, 0)[:-1]}{0.005:20g}\n/NODE\n"
    corners = [(x, y) for x in (0.0, 1.0, 2.0, 4.0, 5.0) for y in (0.0, 1.0)]
    positions = dict(enumerate(corners, start=1)) | {
        MAIN: (0.5, 2.0),
        OTHER: (1.5, 2.0),
    }
    for node, position in positions.items():
        text += pad(node)[:-1] + pad(*position, 0.0, width=20)
    elements = {1: (1, 3, 4, 2), 2: (3, 5, 6, 4), 3: (7, 9, 10, 8)}
    for part, nodes in elements.items():
        title = ("box", "step", "sled")[part - 1]
        text += f"/PART/{part}\n{title}\n{pad(1, 1)}/SHELL/{part}\n{pad(part, *nodes)}"
    shutil.copy(ROOT / "sample_data" / "rollover_boxT01", folder / "BOXT01")
    engine = (
        f"/RUN/BOX/1\n0.43\n/VERS/2022\n/DT\n0.9 0.0\n{nodes_off}/TFILE/4\n0.0001\n"
    )
    put(folder / "BOX_0001.rad", engine)
    return put(folder / "BOX_0000.rad", f"{text}{extra_text}/END\n")


def add_body(*cards: str, nodes_off: int | str = MAIN) -> Callable[[Path], Path]:
    return lambda folder: write_plates(
        folder, "".join(cards), f"/RBODY/OFF\n{nodes_off}\n"
    )


def add_included_body(folder: Path) -> Path:
    put(
        folder / "body.inc",
        write_parts_group(8, 1, 2) + write_body(5, MAIN, 8) + "# end",
    )
    return write_plates(folder, "#include body.inc\n", f"/RBODY/OFF\n{MAIN}\n")


RADIOSS: Mapping[str, Callable[[Path], Path]] = {
    "without a body": write_plates,
    "a body of both parts": add_body(
        write_parts_group(8, 1, 2), write_body(5, MAIN, 8)
    ),
    "a body of the nodes": add_body(
        f"/GRNOD/NODE/8\nnodes\n{pad(1, 2, 3, 4, 5, 6)}",
        write_body(5, MAIN, 8),
    ),
    "two bodies that are merged": add_body(
        write_parts_group(8, 1),
        f"/GRNOD/NODE/9\nnodes\n{pad(5, 6)}",
        write_body(5, MAIN, 8),
        write_body(6, OTHER, 9),
        f"/MERGE/RBODY/1\nmerged\n{pad(5, 1, 6, 1)}",
    ),
    "a body of the part that lies apart": add_body(
        write_parts_group(8, 1, 2),
        write_parts_group(9, 3),
        write_body(5, MAIN, 8),
        write_body(6, OTHER, 9),
        nodes_off=f"{MAIN} {OTHER}",
    ),
    "a main node that the starter makes": add_body(
        write_parts_group(8, 1, 2), write_body(5, 0, 8), nodes_off=OTHER + 1
    ),
    "an included body": add_included_body,
}


def write_pieces(folder: Path, main: Path, printed: str) -> None:
    """Put the printed text in the places that its headings name: in the starter deck, and in engine files."""
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
    run_result = run("check", "--fail-on", "warning", str(main)).stdout
    assert "parts 1, 2: rigid from 0.1 to 0.37" in run_result
    assert "0 errors, 0 warnings" in run_result, run_result


@pytest.mark.parametrize("keyword", ["*INCLUDE\n", "*INCLUDE_PATH_RELATIVE\n"])
def test_a_card_fits_into_a_deck_with_an_include_outside_its_folder(
    keyword: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Before, the warning card-error and exit code 1 followed, although the card was right."""
    folder = tmp_path / "run"
    common = tmp_path / "common"
    folder.mkdir()
    common.mkdir()
    main = write_box(folder)
    put(common / "mesh.k", main.read_text("utf-8"))
    include = "../common/mesh.k\n"
    if "PATH" in keyword:
        include = "../common\n*INCLUDE\nmesh.k\n"
    put(main, f"*KEYWORD\n{keyword}{include}*END\n")
    for deck in (str(main), "main.k"):
        monkeypatch.chdir(folder)
        arguments = ("plan", *FLYING, "--deck", deck, "-f", "card", "-o", "switches.k")
        printed = run(*arguments, "--overwrite", str(folder / "matsum"))
        assert printed.exit_code == 0, printed.stderr
        assert "card-error" not in printed.stderr
        assert "print the card again" not in printed.stderr
    put(main, f"*KEYWORD\n{keyword}{include}*INCLUDE\nswitches.k\n*END\n")
    assert run("check", str(main)).exit_code == 0
