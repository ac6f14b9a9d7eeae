"""Radioss runs: which files belong together, and when each part is rigid."""

from pathlib import Path

import pytest
from hypothesis import given, settings, strategies as st

from d2rpick.base.errors import DeckError
from d2rpick.deck.printed_card import Printing
from d2rpick.deck.printing import print_cards
from d2rpick.deck.radioss_files import is_radioss, list_run_files
from d2rpick.deck.radioss_run import find_run_windows, read_run
from d2rpick.rules import RULES, check_deck
from tests.command import put
from tests.computed import locate_stored
from tests.decks import write

EXAMPLE = RULES["D2R401"].passing[0]
GROUP = "/GRNOD/PART/7\nbox\n         1\n"
BODY = "      1808         0         0         0                   0         7\n"
Spans = list[tuple[int, str, float, float | None]]

SHELLS = "/SHELL/2\n" + "".join(f"{n:10d}" for n in (2, 3, 4, 5, 6)) + "\n"
ON, OFF = "/RBODY/ON\n1808\n", "/RBODY/OFF\n1808\n"
SOLID = (
    "/PROP/SOLID/1\nsolid\n"
    + "".join(f"{n:10d}" for n in (1, 0, 0, 0, 0, 0, 0, 0))
    + "\n"
)
BRICK = "/BRICK/1\n" + "".join(f"{n:10d}" for n in (9, 1, 2, 3, 4, 5, 6, 7, 8)) + "\n"
FIELDS = b"".join(b"%20d" % n for n in (1, 2, 3)) + b"\n"
BEHIND = [
    *(
        b"/BEGIN\n",
        b"/RUN/x/1\n",
        b"/RBODY/ON\n",
        b"/PART/\xb2\n",
        b"/INIV/TRA/X/1\n",
        b"/INIV\n",
        b"/INIVEL/TRA/1\nv\n",
    ),
    *(
        b"/INIVEL\n",
        b"/INIVEL/AXIS/1\nv\n",
        b"/INIVEL/NODE/1\nv\n",
        b"/RWALL/CYL/1\nw\n",
        b"/RWALL\nw\n\n" + FIELDS,
    ),
    b"/NODE\n         1" + FIELDS + b"/RWALL/PLANE/1\nw\n\n" + FIELDS + FIELDS,
]


def write_run(
    folder: Path,
    starter: str = EXAMPLE.deck,
    legs: tuple[tuple[str, str], ...] | None = None,
) -> str:
    """Write a run; ``legs`` are the end and the further lines of each leg."""
    if legs is None:
        return write(folder, starter, EXAMPLE.files, EXAMPLE.name)
    files = {
        f"box_{n:04d}.rad": f"/RUN/box/{n}\n{stop}\n{starter_deck}"
        for n, (stop, starter_deck) in enumerate(legs, start=1)
    }
    return write(folder, starter, files, EXAMPLE.name)


def read_spans(path: str) -> Spans:
    run_windows = find_run_windows(read_run(path)).windows.windows
    return [
        (window.unit.id, window.unit.kind, window.tr, window.td)
        for window in run_windows
    ]


@pytest.mark.parametrize(
    ("group", "part"),
    [
        (GROUP, 1),
        ("/GRNOD/GRNOD/7\nbox\n         8\n/GRNOD/PART/8\nbox\n         1\n", 1),
        (
            "/GRNOD/SUBSET/7\nbox\n         9\n/SUBSET/9\nall\n         3\n/SUBSET/3\nbox\n",
            4,
        ),
        (
            "/GRNOD/NODE/7\nbox\n# nodes of part 1\n         1         2         3         4         5\n",
            1,
        ),
    ],
)
def test_the_parts_of_a_body_are_those_that_lie_whole_in_its_group(
    tmp_path: Path, group: str, part: int
) -> None:
    subset = "/PART/4\nin a subset\n         1         1         3\n"
    starter = EXAMPLE.deck.replace(GROUP, SHELLS + subset + group)
    assert read_spans(write_run(tmp_path, starter)) == [(part, "part", 0.02, 0.09)]


@pytest.mark.parametrize(
    "group",
    [
        "/GRNOD/BOX/7\nbox\n         1\n",
        "/GRNOD/NODE/7\nbox\n         1         2\n",
        "",
    ],
)
def test_a_body_whose_parts_are_not_known_is_named_by_its_main_node(
    tmp_path: Path, group: str
) -> None:
    starter = EXAMPLE.deck.replace(GROUP, group)
    assert read_spans(write_run(tmp_path, starter)) == [(1808, "main node", 0.02, 0.09)]


@pytest.mark.parametrize(
    ("legs", "expected"),
    [
        ((("0.2", ""),), []),
        ((("0.2", OFF),), []),
        ((("0.2", ON),), [(0.0, None)]),
        ((("0.05", ON), ("0.2", OFF)), [(0.0, 0.05)]),
        ((("0.05", ""), ("0.2", OFF)), [(0.0, 0.05)]),
        ((("0.02", OFF), ("0.09", ON), ("0.2", "")), [(0.02, None)]),
        ((("0.02", OFF), ("0.05", ON), ("0.09", ON), ("0.2", OFF)), [(0.02, 0.09)]),
        (
            (("0.02", OFF), ("0.05", ON), ("0.09", OFF), ("0.1", ON), ("0.2", OFF)),
            [(0.02, 0.05), (0.09, 0.1)],
        ),
        ((("0.09", OFF), ("0.05", ON), ("0.2", OFF)), []),
        ((("0", OFF), ("0.05", ON), ("0.2", OFF)), [(0.0, 0.05)]),
        (
            (("0.02", OFF), ("0.09", ON + OFF), ("0.2", "")),
            [(0.02, 0.02)],
        ),  # in the order of the file
        ((("-1", OFF), ("-0.5", OFF), ("0.2", ON)), [(-0.5, None)]),
    ],
)
def test_windows_follow_the_legs(
    tmp_path: Path,
    legs: tuple[tuple[str, str], ...],
    expected: list[tuple[float, float | None]],
) -> None:
    assert read_spans(write_run(tmp_path, legs=legs)) == [
        (1, "part", tr, td) for tr, td in expected
    ]


def write_clock(number: int, start: float, stop: float | None = None) -> str:
    return f"/SENSOR/TIME/{number}\nclock\n{start:20}\n" + (
        f"{stop:20}\n" if stop is not None else ""
    )


def write_either(number: int, first: int, second: int, kind: str = "OR") -> str:
    return f"/SENSOR/{kind}/{number}\nboth\n{0:20}\n{first:10}{second:10}\n"


def write_neither(number: int, input_sensor: int) -> str:
    return f"/SENSOR/NOT/{number}\nnot\n{0:20}\n{input_sensor:10}\n"


def read_sensed_spans(
    folder: Path,
    sensor: str,
    sensor_id: int = 5,
    cap: str = "/DTIX\n1e-5 1e-5\n",
    end: str = "0.2",
) -> str:
    """Write the run with one leg, in which a sensor switches the body."""
    body = BODY.replace("         0", f"{sensor_id:10}", 1)
    starter = EXAMPLE.deck.replace(BODY, body).replace("/END", f"{sensor}/END")
    return write_run(folder, starter, ((end, cap),))


@pytest.mark.parametrize(
    ("sensor", "expected"),
    [
        (write_clock(5, 0.05), [(0.0, 0.05)]),
        (write_clock(5, 0.05, 0.09), [(0.0, 0.05), (0.09, None)]),
        (write_clock(1, 0, 0.02) + write_clock(2, 0.09) + write_either(5, 1, 2), [(0.02, 0.09)]),
        (write_clock(1, 0.02, 0.09) + write_neither(5, 1), [(0.02, 0.09)]),
        (write_clock(1, 0.02) + write_clock(2, 0, 0.09) + write_either(3, 1, 2, "AND") + write_neither(5, 3), [(0.02,
         0.09)]),
        (write_clock(1, 0, 0.02) + write_clock(2, 0.05, 0.07) + write_clock(3, 0.09) + write_either(4, 1,
         2) + write_either(5, 3, 4),
         [(0.02, 0.05), (0.07, 0.09)]),
    ],
)  # fmt: skip
def test_a_body_is_rigid_while_its_sensor_is_not_active(
    tmp_path: Path, sensor: str, expected: list[tuple[float, float | None]]
) -> None:
    path = read_sensed_spans(tmp_path, sensor)
    assert read_spans(path) == [(1, "part", tr, td) for tr, td in expected]
    rigid_spans = {finding.rule for finding in check_deck(path).findings}
    assert rigid_spans == ({"D2R104"} if expected[-1][1] is None else set())


def test_a_step_without_a_cap_is_told_of_sensors_too(tmp_path: Path) -> None:
    (finding,) = check_deck(
        read_sensed_spans(
            tmp_path,
            write_clock(1, 0, 0.02) + write_clock(2, 0.09) + write_either(5, 1, 2),
            cap="",
        )
    ).findings
    assert finding.rule == "D2R404"


@pytest.mark.parametrize(
    ("sensor", "told"),
    [
        (
            "/SENSOR/DIST/5\nnear\n         1         2\n",
            "sensor 5 (/SENSOR/DIST), which is not a time sensor",
        ),
        ("", "sensor 5, which the deck has not"),
        (write_neither(5, 5), "sensor 5, of sensor 5, which asks for itself"),
        (
            write_clock(1, 0) + write_either(5, 1, 2),
            "sensor 5, of sensor 2, which the deck has not",
        ),
        (
            "/SENSOR/NOT/5\nnot\n                   0\n",
            "sensor 5, which names no other",
        ),
        ("/SENSOR/TIME/5\nlate\n soon\n", "sensor 5, whose time is no number"),
    ],
)
def test_a_sensor_that_cannot_be_followed_is_told(
    tmp_path: Path, sensor: str, told: str
) -> None:
    (finding,) = check_deck(read_sensed_spans(tmp_path, sensor)).findings
    assert finding.rule == "D2R302"
    assert told in finding.message


@settings(max_examples=15)
@given(
    cuts=st.lists(st.integers(0, 1000), min_size=2, max_size=8, unique=True).filter(
        lambda cuts: len(cuts) % 2 == 0
    )
)
def test_printed_sensors_hold_their_windows(
    tmp_path_factory: pytest.TempPathFactory, cuts: list[int]
) -> None:
    times = sorted(cut / 1000 for cut in cuts)
    windows = list(zip(times[::2], times[1::2], strict=True))
    card = print_cards(
        windows,
        Printing(
            node=(1808,), end=windows[-1][1] + 1, sensor=5, solver="radioss-sensors"
        ),
    )
    path = read_sensed_spans(
        tmp_path_factory.mktemp("run"),
        card.starter,
        sensor_id=card.sensors[1808],
        end="2",
    )
    assert read_spans(path) == [(1, "part", tr, td) for tr, td in windows]


@pytest.mark.parametrize(
    ("more", "found"),
    [
        (SOLID + BRICK, True),
        (SOLID.replace("         1", "        12", 1) + BRICK, True),
        (SOLID.replace("         1", "        17", 1) + BRICK, False),
        (SOLID.replace("         0\n", "         2\n") + BRICK, False),
        (SOLID.replace("SOLID", "TYPE6") + BRICK, True),
        (f"/PROP/SOLID/1\n\n\n{BRICK}", True),  # Isolid 1 is the default
        (f"/DEF_SOLID\n        24\n/PROP/SOLID/1\nsolid\n\n{BRICK}", False),
        (
            f"{SOLID}{BRICK}/DEF_SOLID\n{'':70}         2\n/DEF_SOLID\n         1\n",
            False,
        ),  # the first card is used
        (SOLID + BRICK.replace("BRICK", "PENTA6"), False),
        (f"/PROP/TYPE20/1\nthick shell\n\n{BRICK}", False),  # HA8 is its default
        ("/TETRA4/1\n         9         1         2         3         4\n", True),
    ],
)
def test_stresses_of_solids_without_a_frame_do_not_turn(
    tmp_path: Path, more: str, found: bool
) -> None:
    path = write_run(tmp_path, EXAMPLE.deck.replace("/END", f"{more}/END"))
    assert {finding.rule for finding in check_deck(path).findings} == (
        {"D2R116"} if found else set()
    )
    start = write_run(
        tmp_path,
        EXAMPLE.deck.replace("/END", f"{more}/END"),
        (("0.09", f"{ON}/DTIX\n1e-6 1e-6\n"), ("0.2", OFF)),
    )
    (tmp_path / "box_0003.rad").unlink()
    assert check_deck(start).findings == ()  # without stress nothing can rotate wrongly


def test_files_of_a_run_are_found_by_name_or_by_what_they_hold(tmp_path: Path) -> None:
    path = write_run(tmp_path)
    files = [str(tmp_path / f"box_000{n}.rad") for n in range(4)]
    assert list_run_files(path) == list_run_files(files[2]) == files
    other_file = put(tmp_path / "starter.rad", EXAMPLE.deck)
    (tmp_path / "box_0000.rad").unlink()
    assert list_run_files(str(other_file)) == [str(other_file), *files[1:]]
    assert (
        list_run_files(str(tmp_path))
        == list_run_files("absent")
        == list_run_files("\0")
        == []
    )


@pytest.mark.parametrize("cut", range(1, 30))
def test_an_engine_file_that_ends_within_a_line_seems_to_be_cut(
    tmp_path: Path, cut: int
) -> None:
    path, engine = write_run(tmp_path), tmp_path / "box_0002.rad"
    text = engine.read_text()[:-cut]
    engine.write_text(text)
    checked = [
        finding.file
        for finding in check_deck(path).findings
        if finding.rule == "D2R011"
    ]
    assert checked == ([] if text.endswith("\n") else [str(engine)])
    engine.write_text(f"{text}\n/END")
    assert "D2R011" not in {finding.rule for finding in check_deck(path).findings}


def test_an_include_that_is_asked_for_twice_is_read_once(tmp_path: Path) -> None:
    head = EXAMPLE.deck.split("/PART")[0]
    (tmp_path / "inner.inc").write_text("#\n")
    _, *inner = read_run(
        write_run(tmp_path, f"{head}#include inner.inc\n#include inner.inc\n/END\n")
    ).deck.sources[:3]
    assert [Path(source.name).name for source in inner] == ["inner.inc", "inner.inc"]
    assert inner[0] is inner[1]  # both have the same state of the file


def test_an_include_of_the_starter_deck_is_read(tmp_path: Path) -> None:
    head, body, tail = EXAMPLE.deck.partition("/RBODY")
    path = write_run(tmp_path, f"{head}#include inner.inc\n/END\n")
    assert {finding.rule for finding in check_deck(path).findings} == {"D2R003"}
    (tmp_path / "inner.inc").write_text(body + tail)
    assert read_spans(path) == [(1, "part", 0.02, 0.09)]
    assert check_deck(path).findings == ()
    (tmp_path / "inner.inc").write_text("#include inner.inc\n")
    assert {finding.rule for finding in check_deck(path).findings} == {"D2R003"}


def test_ids_of_a_submodel_are_not_followed(tmp_path: Path) -> None:
    path = write_run(
        tmp_path,
        EXAMPLE.deck.replace(
            "/RBODY", "//SUBMODEL/1\nmoved\n      1000\n/RBODY"
        ).replace("1808", " 808"),
    )
    assert read_spans(path) == [(1808, "main node", 0.02, 0.09)]
    assert check_deck(path).findings == ()


def test_a_run_that_switches_nobody_may_have_any_legs(tmp_path: Path) -> None:
    files = {
        "box_0001.rad": "/RUN/box\n1.0\n/VERS/44\n",
        "box_0003.rad": "/RUN/other/3\n0.5\n/VERS/2022\n",
    }
    assert check_deck(write(tmp_path, EXAMPLE.deck, files, EXAMPLE.name)).findings == ()


def test_a_comment_silences_a_rule(tmp_path: Path) -> None:
    legs = (("0.02", ""), ("0.09", f"/DTIX\n1e-6 1e-5\n{ON}"), ("0.2", OFF))
    assert {
        finding.rule for finding in check_deck(write_run(tmp_path, legs=legs)).findings
    } == {
        "D2R403",
        "D2R404",
    }
    legs = (
        legs[0],
        ("0.09", f"/DTIX\n1e-6 1e-5\n# d2rpick: ignore D2R403\n{ON}"),
        legs[2],
    )
    assert {
        finding.rule for finding in check_deck(write_run(tmp_path, legs=legs)).findings
    } == {"D2R404"}


def test_a_run_cut_anywhere_is_checked_or_refused() -> None:
    legs = "".join(EXAMPLE.files.values())
    for text in (EXAMPLE.deck, legs):
        for cut in range(len(text)):
            try:
                checked = check_deck("run.rad", content=text[:cut].encode())
            except DeckError:
                continue
            for window in checked.windows:
                assert window.tr in {0.0, 0.02}


@given(st.binary(max_size=300), st.sampled_from(BEHIND))
def test_garbage_behind_a_keyword_is_no_crash(garbage: bytes, keyword: bytes) -> None:
    legs = b"/RUN/x/1\n 1.0\n/RBODY/OFF\n1808\n"
    content = (
        b"/BEGIN\n"
        + EXAMPLE.deck.encode().replace(b"/END\n", b"")
        + legs
        + keyword
        + garbage
    )
    assert is_radioss(content)
    check_deck("run.rad", content=content)


@pytest.mark.parametrize(
    ("name", "nodes"), [("CAR_all", [1808]), ("CAR_heavy", range(1808, 1814))]
)
def test_legs_that_were_computed(name: str, nodes: list[int]) -> None:
    checked = check_deck(locate_stored(f"{name}_0001.rad"))
    # Without the starter deck, only the main nodes are known.
    assert [finding.rule for finding in checked.findings] == ["D2R307"]
    run_windows = [(window.unit.id, window.tr, window.td) for window in checked.windows]
    assert run_windows == [(node, 0.0496, 0.1464) for node in nodes]
