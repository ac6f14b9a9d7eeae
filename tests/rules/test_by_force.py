"""Switches by a force in a history with momenta: their times, their number, and the verdict on their windows."""

import re
from pathlib import Path

import numpy as np
import pytest

import d2rpick as d2
from d2rpick.rules import RULES
from d2rpick.rules.example import write_engine_files, write_starter_deck
from tests.command import put, run, run_json
from tests.decks import pad, write
from tests.histories.test_contact_forces import TIMES, t01
from tests.made_t01 import MadeGroup

LANDING = ("--drop", "0.4", "--mesh", "6", "--dt", "5e-4")


@pytest.fixture(scope="module")
def bounces(tmp_path_factory: pytest.TempPathFactory) -> str:
    """Write the history of a box that falls and bounces twice: momenta of the box (part 1) and the sill."""
    path = str(tmp_path_factory.mktemp("drop") / "drop.matsum")
    assert run("rollover", *LANDING, "-o", path).exit_code == 0
    return path


def write_pair(further_cards: str = "") -> str:
    """Write a deck with a pair of sets that act by a force, to the end of the history."""
    return (
        RULES["D2R208"]
        .failing[0]
        .deck.replace("       0.7", "       1.2", 1)
        .replace("*END", f"{further_cards}*END")
    )


def list_windows(report: dict[str, object]) -> list[tuple[float, float | None]]:
    listed: list[dict[str, float]] = report["windows"]  # type: ignore[assignment]
    return [(window["tr"], window["td"]) for window in listed]


def test_a_pair_is_followed_through_the_contacts(bounces: str, tmp_path: Path) -> None:
    deck = write(tmp_path, write_pair())
    assert list_windows(run_json("check", deck)) == []
    report = run_json("check", deck, "--history", bounces)
    flights = [
        (entry.start, entry.end)
        for entry in d2.plan(d2.read(bounces), parts=1, replay=False).flights
    ]
    spans = list_windows(report)
    assert len(spans) >= len(flights)
    for start, end in flights:
        near = [
            td
            for tr, td in spans
            if td is not None and tr <= start + 0.01 and abs(td - end) < 0.002
        ]
        assert near or end > 1.19  # the last flight may go on
    message = next(
        entry["message"] for entry in report["findings"] if entry["rule"] == "D2R302"
    )
    assert re.search(
        r"switches when the force of contact 0 is zero: \d+ times by the momenta of the history",
        message,
    )
    assert {entry["rule"] for entry in report["findings"]} & {
        "D2R204",
        "D2R201",
    }  # they are judged


def test_of_several_contacts_nobody_knows_which_one_pushes(
    bounces: str, tmp_path: Path
) -> None:
    contacts = "".join(
        f"*CONTACT_AUTOMATIC_SURFACE_TO_SURFACE_ID\n{entry:10d}floor\n"
        for entry in (7, 8)
    )
    report = run_json(
        "check", write(tmp_path, write_pair(contacts)), "--history", bounces
    )
    assert list_windows(report) == []
    assert any("not judged by time" in entry["message"] for entry in report["findings"])


def write_radioss_run(
    folder: Path, sensor: str, further_cards: str = "/RWALL/PLANE/3\nground\n"
) -> str:
    for name, text in write_engine_files(("1.2", "")).items():
        put(folder / name, text)
    deck = write_starter_deck(more=sensor + further_cards).replace(
        pad(1808, 0)[:-1], pad(1808, 5)[:-1]
    )
    return str(put(folder / "box_0000.rad", deck))


def write_force_sensor(
    kind: str = "RWALL", wait: float = 0.05, highest: float = 0.0
) -> str:
    row = pad(3, "NF")[:-1] + pad(-1.0, highest, 0.0, width=20)
    return f"/SENSOR/{kind}/5\nforce\n{pad(wait, width=20)}{row}"


def test_a_sensor_of_a_force_is_followed_through_the_contacts(
    bounces: str, tmp_path: Path
) -> None:
    report = run_json(
        "check", write_radioss_run(tmp_path, write_force_sensor()), "--history", bounces
    )
    spans = list_windows(report)
    flights = [
        (flight.start, flight.end)
        for flight in d2.plan(d2.read(bounces), parts=1, replay=False).flights
    ]
    assert spans[0][0] == 0
    for start, end in flights[1:]:
        if end - start > 0.06:
            assert any(abs(tr - start - 0.05) < 0.002 for tr, _ in spans)
    assert (
        list_windows(
            run_json("check", write_radioss_run(tmp_path, write_force_sensor()))
        )
        == []
    )


@pytest.mark.parametrize(("kind", "start"), [("RWALL", 0.9375), ("INTER", 0.4375)])
def test_of_several_that_push_the_force_of_the_named_one_is_followed(
    tmp_path: Path, kind: str, start: float
) -> None:
    """A T01 with the forces of interface 3 and rigid wall 3, without momenta; ends are known to half an interval."""
    values = np.zeros((TIMES.size, 2, 1, 6))
    for row_number, begins in enumerate((0.5, 1.0)):
        values[:, row_number, 0, 2] = np.clip(TIMES, begins - 0.125, 2.0)
    groups = [MadeGroup(101, {3: "floor"}), MadeGroup(102, {3: "ground"})]
    history = tmp_path / "boxT01"
    history.write_bytes(t01(groups, values))
    both_contacts = "/RWALL/PLANE/3\nground\n/INTER/TYPE7/3\nfloor\n"
    deck = write_radioss_run(tmp_path, write_force_sensor(kind), both_contacts)
    check_report = run_json("check", deck, "--history", str(history))
    ends = [time for pair in list_windows(check_report) for time in pair]
    assert ends == pytest.approx([0.0, start])


@pytest.mark.parametrize(
    ("sensor", "more"),
    [
        (write_force_sensor(highest=100.0), "/RWALL/PLANE/3\nground\n"),
        (write_force_sensor(), "/RWALL/PLANE/3\nground\n/INTER/TYPE7/4\nboth\n"),
        (write_force_sensor(), ""),
    ],
    ids=["a force above a limit", "two that push", "none that pushes"],
)
def test_sensors_that_momenta_do_not_show_are_told(
    bounces: str, tmp_path: Path, sensor: str, more: str
) -> None:
    report = run_json(
        "check", write_radioss_run(tmp_path, sensor, more), "--history", bounces
    )
    assert list_windows(report) == []
    assert "D2R302" in {finding["rule"] for finding in report["findings"]}


def test_each_window_of_a_pair_has_its_line(bounces: str, tmp_path: Path) -> None:
    deck = write(tmp_path, write_pair())
    output = run("check", deck, "--history", bounces).stdout
    assert (
        output.count("part 1: rigid from")
        == len(list_windows(run_json("check", deck, "--history", bounces)))
        > 2
    )
