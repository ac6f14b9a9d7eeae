"""Files of Radioss runs: missing and truncated files, and which deck they belong to."""

from pathlib import Path

import pytest

from d2rpick.deck import find_main_decks
from d2rpick.deck.radioss_bodies import find_bodies
from d2rpick.rules import check_deck
from d2rpick.rules.example import write_engine_files, write_starter_deck
from tests.command import put, run

ENGINE = write_engine_files(("0.2", "OFF"))["box_0001.rad"]
SENSED = "/RBODY/2\nbody\n      1809         7         0         0                   0         7\n"


def write_run(folder: Path, starter: str = "", engine: str = ENGINE) -> str:
    put(folder / "box_0001.rad", engine)
    return str(put(folder / "box_0000.rad", starter or write_starter_deck()))


def list_rules(path: str) -> list[str]:
    return [finding.rule for finding in check_deck(path).findings]


@pytest.mark.parametrize(
    "last",
    [
        "/END/ENGINE",
        "/MON/ON",
        "/PARITH/ON",
        "# made by hand",
        "$ a comment",
        "/ANIM/ELEM/VONM",
    ],
)
def test_a_last_line_that_can_lose_nothing_needs_no_line_end(
    tmp_path: Path, last: str
) -> None:
    path = write_run(tmp_path, engine=ENGINE + last)
    assert list_rules(path) == []
    starter = write_starter_deck(
        more="/NODE\n"
        + "".join(f"{node:10d}{node:20}{0:20}{0:20}\n" for node in (1, 2, 3, 4))
    )
    assert find_bodies(write_run(tmp_path, starter, ENGINE + last), [1]).nodes == (
        1808,
    )


@pytest.mark.parametrize(
    "last",
    [
        "/RBODY/O",
        "/RBODY/ON",
        "/RBODY/ON\n18",
        "/R",
        "/DT",
        "/VERS/202",
        "/DTIX\n1e-5 1e-",
        "/EN",
    ],
)
def test_a_last_line_that_may_have_lost_something_is_told(
    tmp_path: Path, last: str
) -> None:
    assert "D2R011" in list_rules(write_run(tmp_path, engine=ENGINE + last))


def test_what_stands_behind_the_end_is_not_read(tmp_path: Path) -> None:
    checked = check_deck(
        write_run(tmp_path, engine=f"{ENGINE}/END/ENGINE\n/RBODY/ON\n1808\n")
    )
    assert [*checked.windows] == []


def test_a_missing_include_is_an_error_whatever_the_legs_say(tmp_path: Path) -> None:
    path = write_run(
        tmp_path,
        write_starter_deck(more="#include body.inc\n"),
        write_engine_files(("0.2", ""))["box_0001.rad"],
    )
    (finding,) = check_deck(path).findings
    assert (finding.rule, str(finding.severity)) == ("D2R003", "error")
    assert finding.message.endswith("add the file")
    put(tmp_path / "body.inc", SENSED + "/SENSOR/TIME/7\ntime\n                0.02\n")
    assert "D2R003" not in list_rules(path)


def test_no_switching_cards_is_not_said_above_windows(tmp_path: Path) -> None:
    sensor = "/SENSOR/TIME/7\ntime\n                0.02\n"
    body = write_starter_deck(more=sensor).replace(
        f"{1808:10d}{0:10d}", f"{1808:10d}{7:10d}"
    )
    path = write_run(tmp_path, body, write_engine_files(("0.2", ""))["box_0001.rad"])
    output = run("check", path).stdout
    assert "no switching cards" not in output
    assert "part 1: rigid from 0 to 0.02" in output


def test_included_files_are_no_decks_of_their_own(tmp_path: Path) -> None:
    path = write_run(tmp_path, write_starter_deck(more="#include body.inc\n"))
    put(tmp_path / "body.inc", "/BEGIN\nbody\n      2022         0\n" + SENSED)
    assert find_main_decks(str(tmp_path)) == [path]


def test_what_is_no_main_node_is_told_once(tmp_path: Path) -> None:
    for name, text in write_engine_files(("0.02", "OFF"), ("0.2", "ON")).items():
        put(
            tmp_path / name,
            text.replace("1808", "1808 1 2") if "0002" in name else text,
        )
    path = str(put(tmp_path / "box_0000.rad", write_starter_deck()))
    assert [rule for rule in list_rules(path) if rule.startswith("D2R4")] == [
        "D2R402",
        "D2R402",
    ]
