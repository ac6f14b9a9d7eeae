"""A first run that switches itself: the content of its engine files and switches, and what is refused."""

import math
import re
import stat
from pathlib import Path

import pytest

import d2rpick as d2
from d2rpick.deck.radioss_run import read_run
from tests.command import ROOT, run
from tests.decks import pad, write
from tests.sprung import write_cubes

REAL = 20
ENGINE = "/RUN/box/1\n 0.4\n/VERS/2022\n/TFILE/4\n1e-5\n"
CONTACT = "/INTER/TYPE7/6\nfloor\n" + pad(3, 1)
TIED = "/INTER/TYPE2/9\ntied\n" + pad(3, 1)
WALL = "/RWALL/PLANE/8\nground\n" + pad(0, 0, 0, 0) + 3 * pad(0.0, 0.0, 1.0, width=REAL)
GRAVITY = f"/GRAV/5\ndown\n{pad(0, 'Z', 0, 0, 0)[:-1]}{pad(1.0, -9.81, width=REAL)}"
THROWN = f"/GRNOD/PART/1\nall\n{pad(1, 2)}/INIVEL/TRA/3\nthrown\n{pad(10.0, 0.0, 0.0, width=REAL)[:-1]}{pad(1)}"
MASS, STIFFNESS = 5.0, 1e6
PERIOD = 2 * math.pi * math.sqrt(MASS / 2 / STIFFNESS)

SHELL = (
    "*SECTION_SHELL\n         1         2\n     0.002     0.002     0.002     0.002\n"
)
CURVE = "".join(f"{time:20.1f}{1.0:20.1f}\n" for time in (0.0, 10.0))
FALLS = f"*LOAD_BODY_Z\n         1       9.81\n*DEFINE_CURVE\n         1\n{CURVE}"


def write_radioss_run(folder: Path, contents: str = CONTACT + THROWN + GRAVITY) -> str:
    folder.mkdir(exist_ok=True)
    (folder / "box_0001.rad").write_text(ENGINE)
    deck = write_cubes((MASS, MASS), [(10, 20, STIFFNESS)]).replace(
        "/END\n", contents + "/END\n"
    )
    return write(folder, deck, name="box_0000.rad")


def read_leg_states(files: tuple[str, ...]) -> list[tuple[bool, int]]:
    """Return for each engine file if it is rigid, and the sensor that ends it."""
    return [
        (rigid, leg.sensor)
        for leg in read_run(files[0]).legs
        for _, rigid, _ in leg.switched
    ]


def test_legs_end_by_sensors_of_flight_and_of_contact(tmp_path: Path) -> None:
    prepared = d2.first(
        write_radioss_run(tmp_path / "ref", CONTACT + WALL + TIED + THROWN),
        tmp_path / "next",
        parts="1-2",
    )
    assert prepared.wait == pytest.approx(PERIOD / 2, rel=1e-2)
    assert "springs" in prepared.reason
    checked = run("check", prepared.files[0])
    assert checked.exit_code == 0
    assert "switches itself by forces or sensors of the run" in checked.stdout
    assert "no switching cards" not in checked.stdout
    assert f"d2rpick follow {tmp_path / 'next'}" in checked.stdout
    assert not any(
        "stays active" in note for note in prepared.notes
    )  # the body is deactivated, as in runs computed with OpenRadioss
    assert any("a momentum of 511 afterwards" in note for note in prepared.notes)
    starter = Path(prepared.files[0]).read_text()
    kinds = re.findall(r"/SENSOR/(\w+)/(\d+)", starter)
    assert kinds == [
        ("INTER", "1"),
        ("RWALL", "2"),
        ("OR", "3"),
        ("NOT", "4"),
        ("TIME", "5"),
        ("AND", "6"),
    ]
    assert [line.split()[0] for line in re.findall(r".*NF.*", starter)] == [
        "6",
        "8",
    ]  # not the tied contact
    assert read_leg_states(prepared.files) == [*4 * [(False, 6), (True, 3)], (False, 0)]
    legs = [Path(name).read_text() for name in prepared.files[1:]]
    assert all(text.count("/RUN/box/") == 1 and "/TFILE" in text for text in legs)
    assert ["/DTIX" in text for text in legs] == [
        rigid for rigid, _ in read_leg_states(prepared.files)
    ]


def test_parts_at_rest_that_fall_are_rigid_from_the_start(tmp_path: Path) -> None:
    prepared = d2.first(
        write_radioss_run(tmp_path / "ref", CONTACT + GRAVITY),
        tmp_path / "next",
        parts=(1, 2),
    )
    assert [rigid for rigid, _ in read_leg_states(prepared.files)] == 4 * [True, False]
    assert "fall freely from rest, so they are rigid from 0" in prepared.notes[0]
    later = d2.first(
        write_radioss_run(tmp_path / "ref", CONTACT + GRAVITY),
        tmp_path / "later",
        parts=(1, 2),
        after=0.1,
    )
    assert [rigid for rigid, _ in read_leg_states(later.files)][:2] == [False, True]


def test_the_check_says_that_it_does_not_know_these_times(tmp_path: Path) -> None:
    prepared = d2.first(
        write_radioss_run(tmp_path / "ref"), tmp_path / "next", parts=(1, 2)
    )
    checked = d2.check(prepared.files[0])
    assert not checked.windows
    assert {finding.rule for finding in checked.findings} == {"D2R302"}
    assert "engine file 1 ends when sensor" in checked.findings[0].message


@pytest.mark.parametrize(
    ("contents", "arguments", "message"),
    [
        (THROWN, {}, "no contact and no rigid wall"),
        (CONTACT + "/CLOAD/4\npush\n", {}, "/CLOAD/4 acts without a contact"),
        (
            CONTACT
            + f"/BCS/1\nheld\n   111 000{pad(0, 7)[:20]}\n/GRNOD/NODE/7\nheld\n{pad(10)}",
            {},
            "part 1 is held",
        ),
        (CONTACT, {"wait": 0.4 * PERIOD}, "below 0.00497, half of a known period"),
        (CONTACT, {"parts": (1, 77)}, "part 77: no elements"),
        (
            CONTACT,
            {"parts": None},
            r"missing: `parts` \(parts to switch; .* deactivates no rigid body \(/RBODY/OFF\)",
        ),
    ],
)
def test_what_cannot_be_done_is_refused_in_one_line(
    tmp_path: Path, contents: str, arguments: dict[str, float], message: str
) -> None:
    with pytest.raises((d2.D2RPickError, ValueError), match=message) as refusal:
        d2.first(
            write_radioss_run(tmp_path / "ref", contents),
            tmp_path / "next",
            **{"parts": (1, 2), **arguments},  # type: ignore[arg-type]
        )
    assert "\n" not in str(refusal.value)
    assert not (tmp_path / "next").exists()


def test_a_deck_without_known_springs_asks_for_the_wait(tmp_path: Path) -> None:
    main = write_radioss_run(tmp_path / "ref")
    Path(main).write_text(
        Path(main).read_text().replace("/PROP/SPRING/", "/PROP/SPR_GENE/")
    )
    with pytest.raises(ValueError, match=r"missing: `wait` \(force-free time"):
        d2.first(main, tmp_path / "next", parts=(1, 2))
    assert (
        d2.first(main, tmp_path / "next", parts=(1, 2), wait=0.01).reason == "as given"
    )


def write_dyna_run(
    folder: Path, contact: str = "AUTOMATIC_SURFACE_TO_SURFACE_ID"
) -> str:
    """Write two shells that share nodes, one separate shell, and a contact."""
    nodes = "".join(
        f"{n:8d}{n % 3:16.1f}{n // 3:16.1f}{0.0:16.1f}\n" for n in range(1, 20)
    )
    rows = [(1, (3, 4, 7, 6)), (2, (4, 5, 8, 7)), (3, (12, 13, 16, 15))]
    parts = "".join(f"*PART\np\n{part:10d}{1:10d}{1:10d}\n" for part, _ in rows)
    shells = "".join(
        "".join(f"{number:8d}" for number in (part, part, *corners)) + "\n"
        for part, corners in rows
    )
    contact_end = f"*CONTACT_{contact}\n{7:10d}floor\n" + 3 * (8 * f"{0:10d}" + "\n")
    text = f"*KEYWORD\n*CONTROL_TERMINATION\n 1.0\n{parts}*NODE\n{nodes}*ELEMENT_SHELL\n{shells}{contact_end}*END\n"
    folder.mkdir(exist_ok=True)
    return write(folder, text)


def test_ls_dyna_gets_a_pair_of_switches_with_contact_codes(tmp_path: Path) -> None:
    prepared = d2.first(
        write_dyna_run(tmp_path / "ref"),
        tmp_path / "next",
        parts="1-3",
        wait=0.02,
        after=0.05,
    )
    main, switches = prepared.files
    checked = run("check", main).stdout
    assert "switches itself by forces or sensors of the run" in checked
    assert "no switching cards" not in checked
    assert "plan HISTORY" not in checked
    text = Path(switches).read_text()
    heads = [
        text.splitlines()[line_number + 2].split()
        for line_number, line in enumerate(text.splitlines())
        if line.startswith("*DEF")
    ]
    assert heads == [
        ["901", "2", "0.05", "0.0", "0.0002", "7", "902", "1"],
        ["902", "4", "0.0", "0.0", "0.02", "7", "901", "-1"],
    ]
    assert text.count(f"{2:10d}{1:10d}      PART") == 1  # shares nodes with part 1
    assert {finding.rule for finding in d2.check(main).findings} <= {"D2R302", "D2R305"}
    assert any("has no force-free time" in note for note in prepared.notes)


def test_constraints_on_the_parts_are_deleted_and_used_ids_are_left_alone(
    tmp_path: Path,
) -> None:
    main = Path(write_dyna_run(tmp_path / "ref"))
    body = "*CONSTRAINED_NODAL_RIGID_BODY\n         9         0         5\n"
    body += "*SET_NODE_LIST\n         5\n         3         5\n"
    used = "*SET_PART_LIST\n       901\n         3\n"
    main.write_text(main.read_text().replace("*END", f"{body}{used}*END"))
    prepared = d2.first(str(main), tmp_path / "next", parts="1-2", wait=0.02)
    lines = Path(prepared.files[1]).read_text().splitlines()
    following = {
        name: [
            lines[number + 1][:20].split()
            for number, line in enumerate(lines)
            if line.startswith("$#") and name in line
        ]
        for name in ("swset", "nrbf")
    }
    assert following == {
        "swset": [["902", "2"], ["903", "4"]],
        "nrbf": [["1", "0"], ["2", "0"]],
    }
    assert any("NRBF" in note for note in prepared.notes)
    assert {finding.rule for finding in d2.check(prepared.files[0]).findings} <= {
        "D2R302"
    }


@pytest.mark.parametrize(
    "contact", ["AUTOMATIC_SINGLE_SURFACE_ID", "AUTOMATIC_GENERAL_ID"]
)
def test_a_contact_that_triggers_nothing_is_refused(
    tmp_path: Path, contact: str
) -> None:
    with pytest.raises(d2.DeckError, match="0 contacts between surfaces"):
        d2.first(
            write_dyna_run(tmp_path / "ref", contact),
            tmp_path / "next",
            parts=1,
            wait=0.02,
        )


def read_offsets(files: tuple[str, ...]) -> list[str]:
    text = Path(files[1]).read_text().splitlines()
    return [
        text[line_number + 1].split()[-1]
        for line_number, line in enumerate(text)
        if line.startswith("$#    nrbf")
    ]


def test_ls_dyna_switches_back_before_the_contact_where_its_keyword_has_an_offset(
    tmp_path: Path,
) -> None:
    deck = Path(write_dyna_run(tmp_path / "ref"))
    deck.write_text(deck.read_text().replace("*NODE", f"{SHELL}*NODE"))
    prepared = d2.first(deck, tmp_path / "next", parts="1-3", wait=0.02)
    assert read_offsets(prepared.files) == ["0.0", "0.004"]
    other_deck = Path(write_dyna_run(tmp_path / "other", "SURFACE_TO_SURFACE_ID"))
    prepared = d2.first(other_deck, tmp_path / "without", parts="1-3", wait=0.02)
    assert read_offsets(prepared.files) == ["0.0", "0.0"]
    assert any("deformable in the contact" in note for note in prepared.notes)


@pytest.mark.parametrize(
    "contents",
    ["*LOAD_NODE_POINT\n", "*AIRBAG_SIMPLE_AIRBAG_MODEL\n", "*LOAD_SEGMENT\n"],
)
def test_loads_of_ls_dyna_that_push_without_a_contact_are_refused(
    tmp_path: Path, contents: str
) -> None:
    deck = Path(write_dyna_run(tmp_path / "ref"))
    deck.write_text(
        deck.read_text().replace("*END", f"{FALLS}{contents}{9 * f'{1:10d}'}\n*END")
    )
    with pytest.raises(d2.DeckError, match="acts without a contact"):
        d2.first(deck, tmp_path / "next", parts=1, wait=0.02)


@pytest.mark.parametrize("thrown", [True, False])
def test_what_falls_from_rest_is_rigid_from_the_start_in_ls_dyna_too(
    tmp_path: Path, thrown: bool
) -> None:
    deck = Path(write_dyna_run(tmp_path / "ref"))
    velocity = "*INITIAL_VELOCITY_GENERATION\n         1         2\n" * thrown
    deck.write_text(deck.read_text().replace("*END", f"{FALLS}{velocity}*END"))
    notes = d2.first(deck, tmp_path / "next", parts="1-3", wait=0.02).notes
    assert any("if you know the end of the load" in note for note in notes) is thrown
    assert any("fall freely from rest" in note for note in notes) is not thrown


def test_a_file_that_is_replaced_keeps_its_mode(tmp_path: Path) -> None:
    plate = str(ROOT / "sample_data/falling_plate/plate_0000.rad")
    written = d2.first(plate, tmp_path / "next", parts=1, wait=0.02)
    for file in (tmp_path / "next").iterdir():
        file.chmod(0o600)
    again = d2.first(plate, tmp_path / "next", parts=1, wait=0.02, overwrite=True)
    assert again.files == written.files
    assert {
        stat.S_IMODE(file.stat().st_mode) for file in (tmp_path / "next").iterdir()
    } == {0o600}
