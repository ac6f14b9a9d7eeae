"""Small Radioss runs whose rigid parts are known from the listings of OpenRadioss (bd4557ba7), event by event.

With OPENRADIOSS_PATH the runs are computed again, and `check` is compared with the listings themselves.
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from math import inf
from pathlib import Path
from typing import NamedTuple

import pytest

from d2rpick.deck import read_inventory
from d2rpick.rules import check_deck
from tests.deck.test_openradioss import run_solver
from tests.decks import pad

WIDE = 20  # columns of a real number
STEP = 1e-5  # duration of a cycle
OFF, ON, RESET = "/RBODY/OFF\n", "/RBODY/ON\n", "/SENS/RESET\n"
Spans = Mapping[int, Sequence[tuple[float, float | None]]]

MIDDLE = [(0.002, 0.004)]
BOTH = f"/GRNOD/PART/9\nboth\n{pad(1, 2)}"


class Listed(NamedTuple):
    """A run: its starter cards in addition to three plates, the cards of its legs, and when each part is rigid."""

    starter: str
    legs: tuple[str, ...]
    rigid: Spans
    version: int = 2023
    parts: Mapping[
        int, str
    ] = {}  # lines of /PART below the title, for plates with other than the default lines


def write_head(version: int) -> str:
    text = f"#RADIOSS STARTER\n/BEGIN\nX\n{pad(version, 0)}" + 2 * pad(
        "kg", "m", "s", width=WIDE
    )
    text += f"/TITLE\nplates\n/MAT/ELAST/1\nsteel\n{pad(7850.0, width=WIDE)}{pad(2.1e11, 0.3, width=WIDE)}"
    return (
        text
        + f"/PROP/SHELL/1\nshell\n{pad(24, 0, 0, 0)}\n{pad(3, 0)[:-1]}{pad(0.005, width=WIDE)}"
    )


def write_plates(lines: Mapping[int, str]) -> str:
    """Write three plates that share no nodes: part i has nodes 10 i + 1 to 4; nodes 101 to 103 lie above them."""
    corners = ((0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0))
    coordinates = {
        10 * part + at: (3.0 * part + x, y, 0.0)
        for part in (1, 2, 3)
        for at, (x, y) in enumerate(corners, 1)
    }
    coordinates |= {100 + part: (3.0 * part + 0.5, 0.5, 0.2) for part in (1, 2, 3)}
    text = "/NODE\n" + "".join(
        pad(node)[:-1] + pad(*position, width=WIDE)
        for node, position in coordinates.items()
    )
    for part in (1, 2, 3):
        text += f"/PART/{part}\nplate\n{lines.get(part, pad(1, 1))}"
        text += f"/SHELL/{part}\n{pad(part, *(10 * part + at for at in range(1, 5)))}"
    return text + "".join(
        f"/GRNOD/PART/{part}\nplate\n{pad(part)}" for part in (1, 2, 3)
    )


def write_body(number: int, node: int, part: int, sensor: int = 0) -> str:
    first = (
        pad(node, sensor, 0, 0)[:-1] + pad(0.0, width=WIDE)[:-1] + pad(part, 0, 0, 0)
    )
    return f"/RBODY/{number}\nbody\n{first}{2 * pad(0.0, 0.0, 0.0, width=WIDE)}{pad(0, 0, 0)}"


def write_merge(*lines: tuple[int, ...]) -> str:
    return "/MERGE/RBODY/1\nmerged\n" + "".join(pad(*line) for line in lines)


def write_clock(number: int, delay: float, stop: float | None = None) -> str:
    return f"/SENSOR/TIME/{number}\nclock\n{pad(delay, width=WIDE)}" + (
        pad(stop, width=WIDE) if stop else ""
    )


def write_logic(kind: str, number: int, *others: int, delay: float = 0.0) -> str:
    return f"/SENSOR/{kind}/{number}\nof others\n{pad(delay, width=WIDE)}{pad(*others)}"


def write_rigid_part(node: int = 0, sensor: int = 0) -> str:
    first = pad(1, 1, 0)[:-1] + pad(0.0, width=WIDE)[:-1] + pad(1)
    second = pad(node, 0)[:-1] + pad(0.0, width=WIDE)[:-1] + pad("", sensor)
    return first + second + 2 * pad(0.0, 0.0, 0.0, width=WIDE)


THREE = write_body(1, 101, 1) + write_body(2, 102, 2) + write_body(3, 103, 3)
TWICE = write_clock(5, 0.0, 0.002) + write_clock(6, 0.004) + write_logic("OR", 7, 5, 6)
ALONE = write_body(1, 101, 1, 5)


def write_fourth(*nodes: int) -> str:
    """Write a further part of one element, on nodes of the plates."""
    return f"/PART/4\nfurther\n{pad(1, 1)}/SHELL/4\n{pad(4, *nodes)}"


LISTED = {
    "a merged body goes with the main one": Listed(
        THREE + write_merge((1, 1, 2, 1)),
        (OFF + "101 103", ON + "101", OFF + "101"),
        {1: MIDDLE, 2: MIDDLE},
    ),
    "the engine does not know the main node of a merged body": Listed(
        THREE + write_merge((1, 1, 2, 1)),
        (OFF + "101 102", ON + "102", OFF + "102"),
        {},
    ),
    "merges follow each other": Listed(
        THREE + write_merge((1, 1, 2, 1), (2, 1, 3, 1)),
        (OFF + "101", ON + "101", OFF + "101"),
        dict.fromkeys((1, 2, 3), MIDDLE),
    ),
    "kinds of a merge are bodies where they are left out": Listed(
        THREE + write_merge((1, 0, 2, 0), (1, 0, 3)),
        (OFF + "101", ON + "101", OFF + "101"),
        dict.fromkeys((1, 2, 3), MIDDLE),
    ),
    "a group of nodes is merged": Listed(
        write_body(1, 101, 1) + write_merge((1, 1, 2, 3)),
        (OFF + "101", ON + "101", OFF + "101"),
        {1: MIDDLE, 2: MIDDLE},
    ),
    "a body beside merged ones is apart": Listed(
        THREE + write_merge((1, 1, 2, 1)),
        (OFF + "101 102 103", ON + "101 103", OFF + "103"),
        {1: [(0.002, None)], 2: [(0.002, None)], 3: MIDDLE},
    ),
    "the starter numbers main nodes by the ids of the bodies": Listed(
        write_body(7, 0, 1) + write_body(2, 0, 2),
        (OFF + "104", ON + "104", OFF + "104 105"),
        {1: [(0.0, 0.004)], 2: MIDDLE},
    ),
    "above all nodes": Listed(
        "/NODE\n"
        + pad(5000)[:-1]
        + pad(9.0, 9.0, 9.0, width=WIDE)
        + write_body(7, 0, 1)
        + write_body(2, 103, 2)
        + write_body(3, 0, 3),
        (OFF + "5001 5002", ON + "5001", OFF + "5001 103"),
        {2: [(0.0, 0.004)], 3: MIDDLE},
    ),
    "0 in a leg names no body": Listed(
        write_body(1, 0, 1) + write_body(2, 102, 2),
        (OFF + "102 0", ON + "0 102", OFF + "102 104"),
        {1: [(0.0, 0.004)], 2: MIDDLE},
    ),
    "a skin on the nodes of a part is rigid with it": Listed(
        write_fourth(11, 12, 13, 14) + write_body(1, 101, 1),
        (OFF + "101", ON + "101", OFF + "101"),
        {1: MIDDLE, 4: MIDDLE},
    ),
    "a part between two of a body is rigid with them": Listed(
        write_fourth(12, 21, 24, 13) + BOTH + write_body(1, 101, 9),
        (OFF + "101", ON + "101", OFF + "101"),
        dict.fromkeys((1, 2, 4), MIDDLE),
    ),
    "a part beside one of a body is not": Listed(
        write_fourth(12, 21, 24, 13) + write_body(1, 101, 1),
        (OFF + "101", ON + "101", OFF + "101"),
        {1: MIDDLE},
    ),
    "a group of a range of nodes": Listed(
        f"/GRNOD/GENE/9\nrange\n{pad(11, 24)}" + write_body(1, 101, 9),
        (OFF + "101", ON + "101", OFF + "101"),
        {1: MIDDLE, 2: MIDDLE},
    ),
    "groups of materials and properties": Listed(
        f"/GRNOD/MAT/9\nall\n{pad(1)}/GRNOD/PROP/8\nnone\n{pad(7)}"
        + write_body(1, 101, 9),
        (OFF + "101", ON + "101", OFF + "101"),
        dict.fromkeys((1, 2, 3), MIDDLE),
    ),
    "sensors of time join": Listed(
        write_body(1, 101, 1, 7) + TWICE, ("",), {1: MIDDLE}
    ),
    "formats before 2023 know Tstop": Listed(
        write_body(1, 101, 1, 7) + TWICE, ("",), {1: MIDDLE}, version=2018
    ),
    "a second number on the line of Tdelay is no Tstop": Listed(
        ALONE + f"/SENSOR/TIME/5\nclock\n{pad(0.0, 0.002, width=WIDE)}",
        ("",),
        {},
    ),
    "a restart keeps sensors": Listed(
        write_body(1, 101, 1, 7) + TWICE, ("", "", ""), {1: MIDDLE}
    ),
    "a delay of a sensor of others has no effect": Listed(
        write_body(1, 101, 1, 7)
        + write_clock(5, 0.001, 0.003)
        + write_clock(6, 0.004)
        + write_logic("OR", 7, 5, 6, delay=0.0005),
        ("",),
        {1: [(0.0, 0.001), (0.003, 0.004)]},
    ),
    "not of or": Listed(
        write_body(1, 101, 1, 9)
        + write_clock(5, 0.001, 0.002)
        + write_clock(6, 0.003, 0.004)
        + write_logic("OR", 8, 5, 6)
        + write_logic("NOT", 9, 8),
        ("",),
        {1: [(0.001, 0.002), (0.003, 0.004)]},
    ),
    "and": Listed(
        write_body(1, 101, 1, 7)
        + write_clock(5, 0.001, 0.003)
        + write_clock(6, 0.002)
        + write_logic("AND", 7, 5, 6),
        ("",),
        {1: [(0.0, 0.002), (0.003, None)]},
    ),
    "a stop before the delay": Listed(
        ALONE + write_clock(5, 0.003, 0.001), ("",), {1: [(0.0, None)]}
    ),
    "a sensor that is reset ends": Listed(
        ALONE + write_clock(5, 0.001, 0.006),
        ("", RESET + "5", ""),
        {1: [(0.0, 0.001), (0.002, None)]},
    ),
    "a sensor that is reset before it begins never does": Listed(
        ALONE + write_clock(5, 0.003), ("", RESET + "5", ""), {1: [(0.0, None)]}
    ),
    "a reset of all needs their numbers": Listed(
        ALONE + write_clock(5, 0.001), ("", RESET, ""), {1: [(0.0, 0.001)]}
    ),
    "a sensor overrules the legs": Listed(
        ALONE + write_clock(5, 0.003),
        (OFF + "101", "", ON + "101"),
        {1: [(0.0, 0.003)]},
    ),
}
RIGID_PARTS = {
    "rigid parts": Listed(
        "",
        ("",),
        {1: [(0.0, None)], 3: [(0.0, None)]},
        2612,
        {1: write_rigid_part(), 3: write_rigid_part()},
    ),
    "rigid parts with a sensor": Listed(
        TWICE, ("",), {1: MIDDLE}, 2612, {1: write_rigid_part(0, 7)}
    ),
    "legs switch a rigid part by its main node": Listed(
        "",
        (OFF + "101", ON + "101", OFF + "101"),
        {1: MIDDLE},
        2612,
        {1: write_rigid_part(101)},
    ),
    "a rigid part merged into a body": Listed(
        write_body(9, 103, 3) + write_merge((9, 1, 1, 4)),
        (OFF + "103", ON + "103", OFF + "103"),
        {1: MIDDLE, 3: MIDDLE},
        2612,
        {1: write_rigid_part(101)},
    ),
    "formats before 2612 have none": Listed(
        "", ("",), {}, 2026, {1: write_rigid_part()}
    ),
}


def write_run(folder: Path, run: Listed) -> str:
    """Write a run of three legs of 2 ms each, or of one leg of 6 ms."""
    end = f"/TH/PART/1\nparts\nDEF\n{pad(1, 2, 3)}/END\n"
    main = folder / "X_0000.rad"
    main.write_text(
        write_head(run.version) + write_plates(run.parts) + run.starter + end
    )
    length = 6 // len(run.legs)
    for number, text in enumerate(run.legs, start=1):
        leg = f"/RUN/X/{number}\n{length * number / 1000}\n/VERS/{run.version}\n/DT\n0.9 0.0\n{text}\n"
        (folder / f"X_{number:04d}.rad").write_text(
            f"{leg}/DTIX\n{STEP} {STEP}\n/TFILE/4\n0.0002\n/PRINT/-1\n"
        )
    return str(main)


def find_spans_by_check(main: str) -> dict[int, list[tuple[float, float | None]]]:
    rigid_spans: dict[int, list[tuple[float, float | None]]] = {}
    for window in check_deck(main).windows:
        assert window.part is not None
        rigid_spans.setdefault(window.part, []).append((window.tr, window.td))
    return rigid_spans


@pytest.mark.parametrize("name", [*LISTED, *RIGID_PARTS])
def test_check_gives_the_spans_and_parts_of_the_listings(
    tmp_path: Path, name: str
) -> None:
    run = (LISTED | RIGID_PARTS)[name]
    assert find_spans_by_check(write_run(tmp_path, run)) == run.rigid


def read_events(folder: Path) -> Iterator[tuple[int, bool, float]]:
    """Yield part, True if it becomes rigid, and time from the listings of the engine; element i belongs to part i."""
    length = 0.0
    for listing in sorted(folder.glob("X_000[1-9].out")):
        now = length
        for line in listing.read_text("latin-1").splitlines():
            if cycle := re.match(r"\s+\d+\s+([\d.E+-]+)\s+[\d.E+-]+ [A-Z]+ ", line):
                now = length = float(cycle[1])
            elif event := re.match(r"\s*SHELL (DE)?ACTIVATION:\s+(\d+)", line):
                yield int(event[2]), bool(event[1]), now


def find_spans_by_listing(folder: Path) -> dict[int, list[tuple[float, float]]]:
    """Return the rigid spans by part without those of a few cycles; a first activation means rigid before."""
    rigid_spans: dict[int, list[tuple[float, float]]] = {}
    for part, rigid, now in read_events(folder):
        spans = rigid_spans.setdefault(part, [])
        if rigid:
            if spans and now - spans[-1][1] < 4 * STEP:
                spans[-1] = spans[-1][0], inf  # the sensor changed its state again
            elif not spans or spans[-1][1] < inf:
                spans.append((now, inf))
        elif not spans:
            spans.append((0.0, now))
        elif spans[-1][1] == inf:
            spans[-1] = spans[-1][0], now
    lasting_spans = {
        part: [span for span in spans if span[1] - span[0] > 4 * STEP]
        for part, spans in rigid_spans.items()
    }
    return {part: spans for part, spans in lasting_spans.items() if spans}


@pytest.mark.parametrize("name", LISTED)
def test_the_listings_of_the_solver_say_so(tmp_path: Path, name: str) -> None:
    run = LISTED[name]
    main = write_run(tmp_path, run)
    run_solver(tmp_path, "X")
    listed, checked = find_spans_by_listing(tmp_path), find_spans_by_check(main)
    assert listed.keys() == checked.keys()
    for part, spans in checked.items():
        ends = [
            time
            for span in spans
            for time in (span[0], inf if span[1] is None else span[1])
        ]
        assert [time for span in listed[part] for time in span] == pytest.approx(
            ends, abs=4 * STEP
        )


def test_a_main_node_that_the_starter_makes_is_named_by_its_number(
    tmp_path: Path,
) -> None:
    main = write_run(
        tmp_path,
        Listed(
            write_body(7, 0, 1) + write_body(2, 102, 2),
            (OFF + "102", ON + "102", OFF + "102"),
            {},
        ),
    )
    (finding,) = check_deck(main).findings
    assert finding.rule == "D2R408"
    assert (
        "list main node 104 in the /RBODY/OFF of every engine file (the starter makes node 104: see its listing)"
        in finding.message
    )


def test_the_main_node_of_a_merged_body_is_none(tmp_path: Path) -> None:
    findings = check_deck(
        write_run(
            tmp_path, LISTED["the engine does not know the main node of a merged body"]
        )
    ).findings
    assert {finding.rule for finding in findings} == {"D2R402"}
    assert (
        "its body is merged into /RBODY 1: write main node 101" in findings[0].message
    )


@pytest.mark.parametrize("name", ["rigid parts", "a body beside merged ones is apart"])
def test_parts_that_stay_rigid_are_rigid_in_the_inventory(
    tmp_path: Path, name: str
) -> None:
    run = (LISTED | RIGID_PARTS)[name]
    inventory = read_inventory(write_run(tmp_path, run)).parts
    always = {part for part, spans in run.rigid.items() if spans == [(0.0, None)]}
    assert {
        part
        for part, data in inventory.items()
        if data.material and data.material.kind == "rigid"
    } == always


def test_a_body_that_nothing_switches_makes_its_parts_rigid(tmp_path: Path) -> None:
    main = write_run(tmp_path, Listed(write_body(7, 101, 1), ("",), {}))
    material = read_inventory(main).parts[1].material
    assert material is not None
    assert material.kind == "rigid"
    Path(
        main.replace("0000", "0001")
    ).unlink()  # without engine files it may be switched
    material = read_inventory(main).parts[1].material
    assert material is not None
    assert material.kind == "deformable"


def test_main_nodes_of_rigid_parts_follow_the_order_of_the_deck(tmp_path: Path) -> None:
    """Nodes 101 to 103 are the last nodes of the deck; the body of an /RBODY precedes those of parts."""
    legs = (OFF + "104 105 106", ON + "105", OFF + "105")
    parts = {1: write_rigid_part(), 3: write_rigid_part()}
    main = Path(write_run(tmp_path, Listed(write_body(9, 0, 2), legs, {}, 2612, parts)))
    before, first, *others = main.read_text().partition("/PART/1\n")
    middle, third, rest = others[0].partition("/PART/3\n")
    block, groups, after = rest.partition("/GRNOD/")
    main.write_text(before + third + block + first + middle + groups + after)
    assert find_spans_by_check(str(main)) == {3: MIDDLE}


@pytest.mark.parametrize("name", ["rigid parts with a sensor", "sensors of time join"])
def test_parts_that_a_sensor_switches_already_are_not_switched_again(
    tmp_path: Path, name: str
) -> None:
    inventory = read_inventory(write_run(tmp_path, (LISTED | RIGID_PARTS)[name])).parts
    assert inventory[1].unswitchable == "the deck switches it by sensor 7 already"
    assert inventory[2].unswitchable == ""
