"""Constraints on switched parts: each kind is found, and what a finding advises is no mistake itself."""

import re
from pathlib import Path

import pytest

from d2rpick.rules import check_deck
from d2rpick.rules.base import Finding
from d2rpick.rules.example import END, HEAD, PARTS, write_automatic_card
from tests.decks import make_row, pad, write

# Parts 1, 2 and 3 without a node in common; part 3 is rigid from the start.
MESH = (
    "*PART\nanvil\n" + pad(3, 1, 7) + "*MAT_RIGID\n" + pad(7, 7.8e-9, 210.0, 0.3)
    + "*ELEMENT_SHELL\n" + make_row(1, 1, 1, 2, 4, 3) + make_row(2, 2, 5, 6, 8, 7) + make_row(3, 3, 9, 10, 12, 11)
    + "*SET_NODE_LIST\n" + pad(5) + pad(4, 5)
)  # fmt: skip
CONSTRAINTS = {
    "spotweld": "*CONSTRAINED_SPOTWELD\n" + pad(4, 5),
    "rivet": "*CONSTRAINED_RIVET\n" + pad(4, 5),
    "generalized weld": "*CONSTRAINED_GENERALIZED_WELD_SPOT\n" + pad(5, 0),
    "constrained node set": "*CONSTRAINED_NODE_SET\n" + pad(5, 7),
    "joint": "*CONSTRAINED_JOINT_REVOLUTE\n" + pad(4, 5, 3, 7, 0, 0),
}
FLAGS = {
    "spotweld": (0, 1),
    "rivet": (0, 1),
    "generalized weld": (1, 0),
    "constrained node set": (0, 1),
    "joint": (0, 1),
}
HELD = {"D2R112", "D2R113", "D2R120", "D2R121", "D2R122"}


def find_constraint_findings(
    folder: Path, constraint: str, lines: list[str], flags: tuple[int, int] = (0, 0)
) -> list[Finding]:
    """Return the findings on constraints; ``flags`` are NRBF and NCSF of the card that makes the parts rigid."""
    cards = [
        write_automatic_card(1, "0.02", rigid=lines),
        write_automatic_card(
            2, "0.09", deformable=[str(number + 1) for number in range(len(lines))]
        ),
    ]
    activating = tuple(2 * flag for flag in flags)
    switching = "".join(
        re.sub(r"(\$ +nrbf.*\n) {9}0 {9}0", rf"\g<1>{pad(*values).rstrip()}", card)
        for card, values in zip(cards, (flags, activating), strict=True)
    )
    deck = HEAD + PARTS + MESH + constraint + switching + END
    findings = check_deck(write(folder, deck)).findings
    return [finding for finding in findings if finding.rule in HELD]


MERGED = ["1", pad(2, 1, "PART").rstrip("\n")]


@pytest.mark.parametrize("kind", CONSTRAINTS)
def test_an_active_constraint_is_found_and_its_cure_is_no_mistake(
    tmp_path: Path, kind: str
) -> None:
    (active,) = find_constraint_findings(tmp_path, CONSTRAINTS[kind], MERGED)
    assert active.rule == "D2R113"
    assert active.message.startswith(f"{kind} on part 1")
    assert "set the flag to 1" in active.message
    assert "merge" not in active.message
    assert not find_constraint_findings(
        tmp_path, CONSTRAINTS[kind], MERGED, FLAGS[kind]
    )


@pytest.mark.parametrize("kind", CONSTRAINTS)
def test_parts_that_only_the_constraint_connects_do_not_separate_unseen(
    tmp_path: Path, kind: str
) -> None:
    """Active or deleted, a constraint between separate rigid bodies, or with a deformable part, is reported.

    Only a joint may connect rigid bodies while it is active.
    """
    constraint = CONSTRAINTS[kind]
    apart = find_constraint_findings(tmp_path, constraint, ["1", "2"])
    separate = "become separate rigid bodies (D2R121): merge them with LRB"
    assert [separate in finding.message for finding in apart] == [True] * (
        kind != "joint"
    )
    (deleted,) = find_constraint_findings(tmp_path, constraint, ["1", "2"], FLAGS[kind])
    assert deleted.rule == "D2R121"
    assert "joins parts 1, 2 and is deleted" in deleted.message
    (active,) = find_constraint_findings(tmp_path, constraint, ["1"])
    assert "it also holds part 2, so do not delete it" in active.message
    (half,) = find_constraint_findings(tmp_path, constraint, ["1"], FLAGS[kind])
    assert "but part 2 is not made rigid; switch all" in half.message


def test_a_flag_deletes_only_its_own_kinds(tmp_path: Path) -> None:
    for kind in ("spotweld", "rivet", "generalized weld", "constrained node set"):
        nrbf, ncsf = FLAGS[kind]
        (active,) = find_constraint_findings(
            tmp_path, CONSTRAINTS[kind], MERGED, (ncsf, nrbf)
        )
        assert active.rule == "D2R113"


def test_a_joint_holds_what_its_nodal_rigid_bodies_hold(tmp_path: Path) -> None:
    """The nodes of the joint belong to no element, so the parts hang on the two bodies, which NRBF 1 deletes."""
    bodies = "".join(
        f"*SET_NODE_LIST\n{pad(number)}{pad(node, 90 + number)}*CONSTRAINED_NODAL_RIGID_BODY\n{pad(number, 0, number)}"
        for number, node in ((21, 4), (22, 5))
    )
    text = bodies + "*CONSTRAINED_JOINT_SPHERICAL\n" + pad(111, 112, 0, 0, 0, 0)
    findings = find_constraint_findings(tmp_path, text, ["1", "2"], (1, 0))
    assert [finding.rule for finding in findings] == ["D2R121"]
    assert not find_constraint_findings(tmp_path, text, MERGED, (1, 0))


def test_extra_nodes_of_a_rigid_part_are_not_to_be_deleted_unless_it_leads(
    tmp_path: Path,
) -> None:
    extra = "*CONSTRAINED_EXTRA_NODES_NODE\n" + pad(3, 4)
    (active,) = find_constraint_findings(tmp_path, extra, ["1"])
    cannot = "part 3 has *MAT_RIGID and cannot be switched"
    assert cannot in active.message
    assert "write LRB 3 on the line of part 1" in active.message
    assert "or keep part 1 deformable" in active.message
    (deleted,) = find_constraint_findings(tmp_path, extra, ["1"], (0, 1))
    assert deleted.rule == "D2R121"
    assert cannot in deleted.message
    assert (
        "write LRB 3 on the line of part 1, or keep part 1 deformable"
        in deleted.message
    )
    led = [pad(1, 3, "PART").rstrip("\n")]
    assert not find_constraint_findings(tmp_path, extra, led, (0, 1))


@pytest.mark.parametrize(
    ("keyword", "named"),
    [
        ("*CONSTRAINED_RIGID_BODIES\n" + pad(3, 1), ["part 1"]),
        ("*CONSTRAINED_RIGID_BODIES\n" + pad(3, 9) + pad(2, 1), ["parts 1, 2"]),
        ("*CONSTRAINED_RIGID_BODIES_SET\n" + pad(3, 1), []),
        ("*CONSTRAINED_RIGID_BODIES\n" + pad("wing", 1) + pad(3), ["part 1"]),
        ("*CONSTRAINED_RIGID_BODY_STOPPERS\n" + pad(1, 2), []),
    ],
)
def test_only_switched_parts_of_merged_rigid_bodies_are_reported(
    tmp_path: Path, keyword: str, named: list[str]
) -> None:
    findings = find_constraint_findings(tmp_path, keyword, MERGED)
    assert [finding.rule for finding in findings] == ["D2R122"] * len(named)
    for finding, parts in zip(findings, named, strict=True):
        assert finding.message.startswith(f"{parts} ")
