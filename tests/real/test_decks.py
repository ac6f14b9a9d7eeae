"""Findings in public decks that contain, or seem to contain, switching cards.

No public deck with an active *DEFORMABLE_TO_RIGID_AUTOMATIC by time was found: the real ones here have plain
or restart cards, a pair by contact force, a disabled card, templates and a documentation snippet.
"""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import pytest

from d2rpick.base.errors import DeckError
from d2rpick.deck import ls_dyna_inventory, read_inventory
from d2rpick.deck.reader import read_deck
from d2rpick.rules import Checked, check_deck
from tests.deck.test_ls_dyna_inventory import count_elements
from tests.real.files import real

FOUND: dict[str, dict[str, int]] = {
    "batmac_nail_main.k": {"D2R003": 5, "D2R301": 1},
    "jr_pendulum.k": {"D2R104": 2, "D2R302": 2},
    "k2rad_plain_lrb.k": {"D2R104": 2, "D2R302": 2},
    "koo_pair_code24.k": {"D2R009": 2, "D2R302": 2},
    "koo_pair_code42_wrong.k": {"D2R005": 1, "D2R009": 2, "D2R302": 2},
    "koo_plan_doc_snippet.txt": {"D2R001": 2, "D2R002": 4},
    "lstc_pendulum_restart.k": {"D2R302": 2},
    "nodes.k": {},
    "tmpl_automatic_d2r.k": {"D2R002": 2},
    "tmpl_plain.k": {"D2R002": 1, "D2R302": 1},
    "misc/car5.k": {},
    "misc/control_cards.k": {"D2R003": 1, "D2R011": 1},
    "misc/elementary_main.k": {"D2R003": 1},
    "misc/encoding_sample.k": {},
    "params/collision_main.k": {"D2R003": 2},
    "params/collision_module_a.k": {},
    "params/collision_module_b.k": {},
    "params/eccentric.k": {"D2R003": 1},
    "yaris/000_main.k": {"D2R003": 2},
    "yaris/fixed_ground.k": {},
    "yaris/implicit_control_cards_R9.k": {},
}
EXCERPTS = ["radioss/HYPE_sensor_excerpt.rad", "radioss/IDEL8_0000_rbody_excerpt.rad"]
OF_RADIOSS = [*EXCERPTS, "radioss/IDEL8_0001.rad", "radioss/IDEL8_0002.rad"]


def check(name: str) -> Checked:
    return check_deck(real(f"decks/{name}"))


@pytest.mark.parametrize("name", FOUND)
def test_findings(name: str) -> None:
    assert Counter(finding.rule for finding in check(name).findings) == FOUND[name]


def test_all_decks_are_covered() -> None:
    folder = Path(real("decks"))
    files = {
        str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file()
    }
    assert files == FOUND.keys() | set(OF_RADIOSS)


@pytest.mark.parametrize("name", EXCERPTS)
def test_decks_of_another_solver_are_not_passed_silently(name: str) -> None:
    with pytest.raises(DeckError, match="an LS-DYNA deck"):
        check(name)


def test_the_disabled_card_is_shown_where_it_stands() -> None:
    (finding,) = (
        finding
        for finding in check("batmac_nail_main.k").findings
        if finding.rule == "D2R301"
    )
    assert finding.line == 587
    assert "*COMMENT c:*DEFORMABLE_TO_RIGID_AUTOMATIC" in finding.message


def test_the_snippet_is_not_in_legal_columns() -> None:
    first = next(
        finding
        for finding in check("koo_plan_doc_snippet.txt").findings
        if finding.rule == "D2R002"
    )
    assert "'2 0.'" in first.message


def test_swapped_codes_are_named() -> None:
    (finding,) = (
        finding
        for finding in check("koo_pair_code42_wrong.k").findings
        if finding.rule == "D2R005"
    )
    assert "exchange the CODEs" in finding.message
    assert finding.severity == "error"


@pytest.mark.parametrize("name", ["jr_pendulum.k", "k2rad_plain_lrb.k"])
def test_plain_cards_are_rigid_from_the_start(name: str) -> None:
    assert [(window.part, window.tr, window.td) for window in check(name).windows] == [
        (1, 0.0, None),
        (2, 0.0, None),
    ]


# Radioss.


@pytest.mark.parametrize("name", ["IDEL8_0000.rad", "IDEL8_0001.rad", "IDEL8_0002.rad"])
def test_any_file_of_a_public_run_is_the_run(name: str) -> None:
    checked = check_deck(real(f"radioss-decks/{name}"))
    assert [finding.rule for finding in checked.findings] == [
        "D2R003"
    ]  # qadiags.inc is missing
    assert len(checked.files) == 3
    assert {(window.tr, window.td) for window in checked.windows} == {(0.0, 0.05)}
    assert [window.part for window in checked.windows] == [1]


def test_a_public_run_that_switches_nobody() -> None:
    checked = check_deck(real("radioss-decks/BLOCK_0000.rad"))
    assert [finding.rule for finding in checked.findings] == [
        "D2R003"
    ]  # qadiags.inc is missing
    assert checked.windows == ()


def test_legs_without_their_starter_deck_tell_main_nodes() -> None:
    checked = check("radioss/IDEL8_0001.rad")
    assert [
        (window.unit.id, window.unit.kind, window.tr, window.td)
        for window in checked.windows
    ] == [(450, "main node", 0.0, 0.05)]
    assert [finding.rule for finding in checked.findings] == ["D2R307"]


# Elements.


def test_real_decks_hold_what_a_plain_count_finds() -> None:
    text = Path(real("decks/nodes.k")).read_text("latin-1").splitlines()
    plain: Counter[int] = Counter()
    reading = False
    for line in text:
        reading = (
            line.upper().startswith(("*ELEMENT_SHELL", "*ELEMENT_BEAM"))
            if line.startswith("*")
            else reading
        )
        if reading and line[:1] not in "*$" and line.strip():
            plain[int(line[8:16])] += 1
    inventory = ls_dyna_inventory.read_ls_dyna_inventory(
        read_deck(real("decks/nodes.k"))
    )
    assert {part: counts.total() for part, counts in inventory.counts.items()} == plain


def test_a_real_deck_is_counted() -> None:
    inventory = read_inventory(real("radioss-decks/IDEL8_0000.rad"))
    assert count_elements(inventory) == {
        1: {"solid": 24},
        2: {"shell": 350, "triangle": 8},
    }
    assert not inventory.complete  # one of its includes is missing
    assert not inventory.parts[1].section.turns
