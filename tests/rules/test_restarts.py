"""Small restarts of LS-DYNA, which switch when they begin, as continuation of a run."""

from pathlib import Path

import pytest

import d2rpick as d2
from d2rpick.deck.reader import read_deck
from d2rpick.deck.restarts import is_restart, join_restarts
from d2rpick.rules import check_deck
from tests.command import put, run, run_json

MAIN = """\
*KEYWORD
*CONTROL_TERMINATION
{:>10}
*DATABASE_GLSTAT
    0.0001
*DATABASE_MATSUM
    0.0001
*DEFORMABLE_TO_RIGID
*PART
hood
        11         1         1
*PART
frame
        12         1         1
*END
"""
TO_RIGID = "*RIGID_DEFORMABLE_D2R\n        11         0\n        12        11\n"
BACK = "*RIGID_DEFORMABLE_R2D\n        11\n        12\n"

NODAL = """\
*ELEMENT_SHELL
       1      11       1       2       3       4
*SET_NODE_LIST
         5
         3         4        99
*CONSTRAINED_NODAL_RIGID_BODY
         9         0         5
*END
"""


def write_restart(end: str, *cards: str) -> str:
    control = "*RIGID_DEFORMABLE_CONTROL\n         1         1         1    1.0e-5\n"
    return f"*KEYWORD\n*CONTROL_TERMINATION\n{end:>10}\n{control}{''.join(cards)}*END\n"


@pytest.fixture
def legs(tmp_path: Path) -> list[str]:
    """Write a run to 0.02 and two restarts: parts 11 and 12 are rigid from 0.02 to 0.09."""
    files = {
        "main.k": MAIN.format(0.02),
        "r1.k": write_restart("0.09", TO_RIGID),
        "r2.k": write_restart("0.15", BACK),
    }
    return [str(put(tmp_path / name, text)) for name, text in files.items()]


def test_cards_of_restarts_switch_when_they_begin(legs: list[str]) -> None:
    (main, *restarts) = legs
    for order in (restarts, restarts[::-1]):
        checked = check_deck(main, restarts=order)
        assert [(window.part, window.tr, window.td) for window in checked.windows] == [
            (11, 0.02, 0.09),
            (12, 0.02, 0.09),
        ]
        assert checked.findings == ()
        assert set(checked.files) == set(legs)


def test_the_command_takes_them_together_in_any_order_and_from_a_folder(
    legs: list[str],
) -> None:
    for names in (legs, legs[::-1], [str(Path(legs[0]).parent)]):
        report = run_json("check", *names)
        assert report["decks"] == [legs[0]]
        assert [
            (window["part"], window["tr"], window["td"]) for window in report["windows"]
        ] == [
            (11, 0.02, 0.09),
            (12, 0.02, 0.09),
        ]
    assert [window.td for window in d2.check(legs).windows] == [0.09, 0.09]


def test_their_windows_are_judged_by_a_history(legs: list[str], tmp_path: Path) -> None:
    history = str(tmp_path / "energy.csv")
    options = "--stiffness 660e3 --mass 31.4 --beta 2 --alpha 50 --v0 6 --t-end 0.15 --dt 1e-4"
    assert run("replay", *options.split(), "-o", history).exit_code == 0
    report = run_json("check", *legs, "--history", history)
    judged = {finding["rule"]: finding for finding in report["findings"]}
    assert judged.keys() & {"D2R201", "D2R202"}
    assert {finding["file"] for finding in judged.values()} <= {*legs}


def test_a_restart_alone_has_no_time(legs: list[str]) -> None:
    checked = check_deck(legs[1])
    assert checked.windows == ()
    assert {finding.rule for finding in checked.findings} == {"D2R302"}


@pytest.mark.parametrize("end", ["0.09", "", "0.01"])
def test_without_ends_that_rise_no_times_are_known(legs: list[str], end: str) -> None:
    main, first, second = legs
    put(Path(second), write_restart(end, BACK))
    checked = check_deck(main, restarts=[first, second])
    unknown = end != ""  # the last run may have none
    assert bool(checked.windows) != unknown
    assert ("D2R302" in {finding.rule for finding in checked.findings}) == unknown


def test_both_ways_in_one_restart_is_an_error(legs: list[str]) -> None:
    main, first, _ = legs
    put(
        Path(first),
        write_restart("0.09", TO_RIGID, "*RIGID_DEFORMABLE_R2D\n        11\n"),
    )
    for checked in (check_deck(main, restarts=[first]), check_deck(first)):
        (error,) = [
            finding for finding in checked.findings if str(finding.severity) == "error"
        ]
        assert error.rule == "D2R117"
        assert "part 11 made rigid and deformable" in error.message


def test_a_part_stays_rigid_over_restarts_that_do_not_name_it(
    legs: list[str], tmp_path: Path
) -> None:
    main, first, second = legs
    third = str(put(tmp_path / "r3.k", write_restart("0.2", BACK)))
    put(Path(second), write_restart("0.15"))
    checked = check_deck(main, restarts=[third, first, second])
    assert {(window.tr, window.td) for window in checked.windows} == {(0.02, 0.15)}


def test_what_has_parts_or_no_restart_card_is_none(
    legs: list[str], tmp_path: Path
) -> None:
    assert [is_restart(name) for name in legs] == [False, True, True]
    full = put(tmp_path / "full.k", MAIN.format(0.1).replace("*END", BACK + "*END"))
    assert not is_restart(str(full))
    assert not is_restart(str(put(tmp_path / "notes.txt", "rigid_deformable")))
    assert not is_restart(str(tmp_path))


def test_of_two_runs_nobody_knows_whose_restart_it_is(
    legs: list[str], tmp_path: Path
) -> None:
    second_main = str(put(tmp_path / "other.k", MAIN.format(0.3)))
    checked = run_json("check", *legs, second_main)
    assert checked["windows"] == []
    assert sorted(checked["decks"]) == sorted([*legs, second_main])


def test_the_run_ends_with_its_last_restart(legs: list[str]) -> None:
    main, *restarts = legs
    deck = join_restarts(read_deck(main), restarts)
    assert [restart_start.at for restart_start in deck.restarts.values()] == [
        0.02,
        0.09,
    ]
    assert deck.files == legs


def test_a_bare_card_that_lets_restarts_switch_is_no_switch(legs: list[str]) -> None:
    assert check_deck(legs[0]).findings == ()


@pytest.mark.parametrize("nrbf", [0, 1])
def test_a_restart_deletes_nodal_rigid_bodies_by_its_control(
    tmp_path: Path, nrbf: int
) -> None:
    main = put(tmp_path / "main.k", MAIN.format(0.02).replace("*END\n", NODAL))
    legs = [write_restart("0.09", TO_RIGID), write_restart("0.15", BACK)]
    legs[0] = legs[0].replace("         1", f"{nrbf:10d}", 1)
    paths = [
        str(put(tmp_path / f"r{number}.k", text))
        for number, text in enumerate(legs, start=1)
    ]
    rules_found = {
        finding.rule for finding in check_deck(str(main), restarts=paths).findings
    }
    assert ("D2R112" in rules_found) == (nrbf == 0)
