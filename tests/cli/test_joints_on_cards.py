"""Cards for parts that joints connect: whether a joint is deleted, and what the card itself says about it."""

import re
from pathlib import Path

import pytest

from tests.command import put, run
from tests.decks import make_row, pad

TIMES = ("--tr", "0.1", "--td", "0.3", "--part", "1,2")
# Two plates of one shell each, which share no nodes.
PLATES = (
    "*KEYWORD\n*CONTROL_TERMINATION\n       0.5\n*NODE\n"
    + "".join(
        f"{node:8d}{x:16g}{y:16g}{0.0:16g}\n"
        for node, (x, y) in enumerate(
            [(0, 0), (1, 0), (1, 1), (0, 1), (1.01, 0), (2, 0), (2, 1), (1.01, 1)], 1
        )
    )
    + "".join(f"{50 + i:8d}{1.0:16g}{0.5:16g}{float(i):16g}\n" for i in range(4))
    + f"*ELEMENT_SHELL\n{make_row(1, 1, 1, 2, 3, 4)}{make_row(2, 2, 5, 6, 7, 8)}"
    + "".join(f"*PART\nplate {part}\n{pad(part, 1, 1)}" for part in (1, 2))
    + f"*SECTION_SHELL\n{pad(1, 2)}{pad(0.001, 0.001, 0.001, 0.001)}"
    + f"*MAT_ELASTIC\n{pad(1, 7800.0, 2.1e11, 0.3)}"
)
JOINT = f"*CONSTRAINED_JOINT_REVOLUTE\n{pad(3, 5, 50, 51, 52, 53)}"
WELD_IN_PART = f"*CONSTRAINED_SPOTWELD\n{pad(1, 3)}"
HOSTS = (
    f"*SET_NODE_LIST\n{pad(7)}{pad(3, 4, 50)}"
    f"*SET_NODE_LIST\n{pad(8)}{pad(5, 6, 51)}"
    f"*CONSTRAINED_NODAL_RIGID_BODY\n{pad(7, 0, 7)}{pad(8, 0, 8)}"
)
HOSTED_JOINT = f"*CONSTRAINED_JOINT_REVOLUTE\n{pad(50, 51, 50, 51, 52, 53)}"


def print_card(folder: Path, constraints: str, *options: str) -> tuple[str, str]:
    """Return the card and the warnings for two plates with constraints."""
    main = put(folder / "main.k", f"{PLATES}{constraints}*END\n")
    result = run("card", *TIMES, "--deck", str(main), *options)
    assert result.exit_code in (0, 1), result.stderr
    return result.stdout, result.stderr


def read_flags(card: str) -> list[tuple[int, int]]:
    """Return NRBF and NCSF of each switch set."""
    lines = card.splitlines()
    return [
        (int(lines[i + 1][:10]), int(lines[i + 1][10:20]))
        for i, line in enumerate(lines)
        if line.startswith("$#    nrbf")
    ]


def read_comment(card: str) -> str:
    """Return the comment lines of a card as one text."""
    return " ".join(re.sub(r"(?m)^\$ *", "", card.partition("*")[0]).split())


def test_a_joint_between_separate_rigid_bodies_stays_active(tmp_path: Path) -> None:
    card, warnings = print_card(tmp_path, JOINT)
    assert read_flags(card) == [(0, 0), (0, 0)]
    comment = read_comment(card)
    assert "stay active (NCSF 0): joint of parts 1, 2." in comment
    assert "CHECK BEFORE USE" not in comment
    assert "D2R121" not in warnings
    assert "D2R113" not in warnings


def test_the_joint_of_merged_parts_is_deleted(tmp_path: Path) -> None:
    card, warnings = print_card(tmp_path, JOINT, "--merge", "1")
    assert read_flags(card) == [(0, 1), (0, 2)]
    assert "separate rigid bodies" not in read_comment(card)
    assert "D2R121" not in warnings


@pytest.mark.parametrize("quiet", [(), ("-q",)])
def test_the_card_says_that_parts_separate_if_the_flag_must_delete_a_weld(
    tmp_path: Path, quiet: tuple[str, ...]
) -> None:
    """NCSF acts on all its constraints at once, so the joint cannot be kept."""
    card, _ = print_card(tmp_path, JOINT + WELD_IN_PART, *quiet)
    assert read_flags(card) == [(0, 1), (0, 2)]
    comment = read_comment(card)
    assert "CHECK BEFORE USE: parts may separate while they are rigid" in comment
    assert "joint of parts 1, 2. Merge these parts" in comment


def test_the_card_says_that_parts_separate_if_their_hosts_are_deleted(
    tmp_path: Path,
) -> None:
    """The joint lies on nodal rigid bodies, as usual in LS-DYNA; NRBF deletes these."""
    card, warnings = print_card(tmp_path, HOSTS + HOSTED_JOINT)
    assert read_flags(card) == [(1, 0), (2, 0)]
    comment = read_comment(card)
    assert "CHECK BEFORE USE: parts may separate while they are rigid" in comment
    assert "joint of parts 1, 2" in comment
    assert "D2R121" in warnings


def test_a_card_in_a_deck_needs_no_history(tmp_path: Path) -> None:
    shared = PLATES.replace(make_row(2, 2, 5, 6, 7, 8), make_row(2, 2, 2, 6, 7, 3))
    main = put(tmp_path / "main.k", f"{shared}*END\n")
    result = run("card", *TIMES, "--deck", str(main))
    assert result.exit_code == 0, result.stderr
    comment = read_comment(result.stdout)
    assert "NOT JUDGED: no history of a reference run was given" in comment
    assert "2 parts are one rigid body in the deck, with lead part 1" in comment
    assert "these times were not judged" in " ".join(result.stderr.split())


def test_a_card_in_a_deck_without_its_parts_is_refused(tmp_path: Path) -> None:
    main = put(tmp_path / "main.k", f"{PLATES}*END\n")
    times = ("--tr", "0.1", "--td", "0.3")
    result = run("card", *times, "--part", "7", "--deck", str(main))
    assert result.exit_code == 2
    assert "part 7: no elements in the deck" in result.stderr
    nothing = run("card", *times, "--deck", str(main))
    assert nothing.exit_code == 2
    assert "--part" in nothing.stderr
