"""Parts whose material flows through the mesh or keeps a reference state are named by `parts`, `plan` and `check`."""

from pathlib import Path

import pytest

import d2rpick as d2
from d2rpick.deck import read_inventory
from d2rpick.rules import check_deck
from d2rpick.rules.example import write_engine_files, write_starter_deck
from tests.command import MATSUM, put
from tests.decks import pad

NODES = [
    (x, y, z)
    for z in (0.0, 1.0)
    for x, y in ((0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0))
]
CARD = """\
*DEFORMABLE_TO_RIGID_AUTOMATIC
         1         0     0.097
         0         0         0    1.0e-5         1
         1
*DEFORMABLE_TO_RIGID_AUTOMATIC
         2         0      0.37
         0         0         0    1.0e-5         0         1
         1
"""


def write_bricks(
    folder: Path, elform: int, law: str = "*MAT_ELASTIC", further_cards: str = ""
) -> str:
    """Write the deck of the sample run with a brick for each part; the first part has the material ``law``."""
    text = "*KEYWORD\n*CONTROL_TERMINATION\n      0.42\n*DATABASE_MATSUM\n     0.001\n*DATABASE_GLSTAT\n     0.001\n"
    text += f"{law}\n         7    1000.0   1.0e+06       0.3\n*MAT_ELASTIC\n         8    7850.0   2.1e+11       0.3\n"
    text += f"*SECTION_SOLID\n         1{elform:10d}\n*SECTION_SOLID\n         2         0\n"
    text += "*PART\nbox\n         1         1         7\n*PART\nstep\n         2         2         8\n*NODE\n"
    for first in (1, 11):
        text += "".join(
            f"{first + at:8d}{x + first:16}{y:16}{z:16}\n"
            for at, (x, y, z) in enumerate(NODES)
        )
    rows = (
        [element, element, *range(first, first + 8)]
        for element, first in ((1, 1), (2, 11))
    )
    text += "*ELEMENT_SOLID\n" + "".join(pad(*row, width=8) for row in rows)
    return str(put(folder / "main.k", f"{text}{further_cards}*END\n"))


def test_material_that_flows_is_kept_and_warned_of(tmp_path: Path) -> None:
    run, deck = d2.read(MATSUM), write_bricks(tmp_path, 11)
    first = d2.parts(run, deck=deck).rows[0]
    assert first.verdict == "keep"
    assert "its material flows through the mesh (ALE, ELFORM 11)" in first.reasons
    warnings = d2.plan(run, parts=1, deck=deck, replay=False).warnings
    (message,) = [
        warning.message for warning in warnings if warning.code == "unswitchable-part"
    ]
    assert (
        message
        == "part 1: its material flows through the mesh (ALE, ELFORM 11); leave it out"
    )


@pytest.mark.parametrize("elform", [5, 6, 7, 11, 12])
def test_material_that_flows_is_found(tmp_path: Path, elform: int) -> None:
    findings = {
        finding.rule: finding
        for finding in check_deck(
            write_bricks(tmp_path, elform, further_cards=CARD)
        ).findings
    }
    assert str(findings["D2R118"].severity) == "error"
    assert f"ELFORM {elform})" in findings["D2R118"].message


@pytest.mark.parametrize(
    "law",
    [
        "*MAT_BLATZ-KO_RUBBER",
        "*MAT_007",
        "*MAT_27",
        "*MAT_077_H",
        "*MAT_SIMPLIFIED_RUBBER/FOAM",
        "*MAT_002_ANIS",
    ],
)
def test_a_law_with_a_reference_is_kept_and_found(tmp_path: Path, law: str) -> None:
    data = read_inventory(write_bricks(tmp_path, 0, law)).parts
    assert f"stress-free reference ({law})" in data[1].unswitchable
    assert data[2].unswitchable == ""
    (finding,) = check_deck(write_bricks(tmp_path, 0, law, CARD)).findings
    assert (finding.rule, str(finding.severity)) == ("D2R119", "warning")


@pytest.mark.parametrize(
    "law",
    [
        "*MAT_ELASTIC",
        "*MAT_024",
        "*MAT_070",
        "*MAT_102",
        "*MAT_PLASTIC_KINEMATIC",
        "*MAT_272",
    ],
)
def test_other_laws_and_elements_are_switched(tmp_path: Path, law: str) -> None:
    assert read_inventory(write_bricks(tmp_path, 0, law)).parts[1].unswitchable == ""
    assert check_deck(write_bricks(tmp_path, 0, law, CARD)).findings == ()


@pytest.mark.parametrize(
    ("cards", "rule"),
    [
        ("/ALE/MAT/1\n 0.0\n", "D2R118"),
        ("/EULER/MAT/1\n 0.0\n", "D2R118"),
        ("/MAT/OGDEN/1\nrubber\n 1000.0\n", "D2R119"),
        ("/MAT/LAW92/1\nrubber\n 1000.0\n", "D2R119"),
        (f"/PROP/SOLID/1\nbrick\n{pad(24, 10)}", "D2R119"),
        (f"/PROP/SOLID/1\nbrick\n{pad(24, 4)}", ""),
        ("/ALE/MAT/2\n 0.0\n/MAT/ELAST/1\nsteel\n 7850.0\n", ""),
    ],
)
def test_parts_of_radioss_that_must_not_be_switched(
    tmp_path: Path, cards: str, rule: str
) -> None:
    for name, text in write_engine_files(
        ("0.02", "OFF"), ("0.09", "ON"), ("0.2", "OFF")
    ).items():
        put(tmp_path / name, text)
    main = str(put(tmp_path / "box_0000.rad", write_starter_deck(more=cards)))
    assert [finding.rule for finding in check_deck(main).findings] == [rule] * bool(
        rule
    )
    assert bool(read_inventory(main).parts[1].unswitchable) == bool(rule)
