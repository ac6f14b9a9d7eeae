"""Forces of contacts and rigid walls from every kind of file that contains them."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest

from d2rpick.base.errors import FormatError
from d2rpick.choice.overview import describe_run
from d2rpick.histories.contact_forces import ContactForce
from d2rpick.histories.opening import Selection, open_run
from d2rpick.report import overview_table
from tests.command import run_json
from tests.made_binout import GLSTAT, LsdaWriter
from tests.made_d3plot import D3plotWriter, State
from tests.made_t01 import MadeGroup, MadePart, T01Writer, write_head
from tests.text_files import make_glstat_text

if TYPE_CHECKING:
    from collections.abc import Sequence

    from d2rpick.histories.history import Samples
    from d2rpick.histories.run import OpenedRun

TIMES = np.arange(40) / 8
ACTS = (TIMES >= 1) & (TIMES <= 2)  # forces at the states
FORCE = np.where(ACTS, 3.0, 0.0)
SEEN = ((0.875, 2.125),)  # to within one output interval
ENERGY = make_glstat_text(TIMES, 1 + TIMES)


def only(run: OpenedRun) -> ContactForce:
    (force,) = run.contact_forces
    return force


def rcforc(
    sides: Sequence[str] = ("slave", "master"), times: Samples = TIMES, contact: int = 7
) -> bytes:
    head = " made for tests\n    ls-dyna smp.123456 d    date 01/01/2026\n\n{BEGIN LEGEND}\n Entity #        Title\n"
    head += "        7     body on floor\n{END LEGEND}\n\n"
    lines = [
        f" {name:<8} {contact:6d} time {time:11.5E}  x {0:11.5E} y {0:11.5E} z {sign * force:11.5E} mass {0:11.5E}\n"
        for time, force in zip(times, np.interp(times, TIMES, FORCE), strict=True)
        for name, sign in zip(sides, (1, -1), strict=False)
    ]
    return (head + "".join(lines)).encode()


def rwforc() -> bytes:
    head = (
        " made for tests\n\n r i g i d  w a l l  f o r c e s\n\n  time  wall# "
        "normal-force  x-force  y-force  z-force\n"
    )
    lines = [
        f" {time:12.5E} {wall:8d} {force * (wall == 2):13.6E} {0:13.6E} {0:13.6E} {0:13.6E}\n"
        for time, force in zip(TIMES, FORCE, strict=True)
        for wall in (1, 2)
    ]
    return (head + "".join(lines)).encode()


def put(folder: Path, **files: bytes) -> list[str]:
    for name, content in files.items():
        (folder / name).write_bytes(content)
    return [str(folder / name) for name in files]


@pytest.mark.parametrize(
    "sides", [("slave", "master"), ("master", "slave"), ("SURFA", "SURFB"), ("slave",)]
)
def test_an_rcforc_tells_when_a_contact_acts_whichever_side_is_asked(
    sides: tuple[str, ...], tmp_path: Path
) -> None:
    force = only(open_run(put(tmp_path, glstat=ENERGY, rcforc=rcforc(sides))))
    assert force.name == "contact 7 'body on floor'"
    assert force.times == SEEN
    assert force.tells
    assert abs(force.impulses[:, 2].sum()) == pytest.approx(3.0 * 1.125)  # by trapezia


def test_an_rwforc_tells_it_of_each_wall(tmp_path: Path) -> None:
    first_wall, second_wall = open_run(
        put(tmp_path, glstat=ENERGY, rwforc=rwforc())
    ).contact_forces
    assert (first_wall.name, first_wall.times) == ("rigid wall 1", ())
    assert (second_wall.name, second_wall.times) == ("rigid wall 2", SEEN)


def test_a_folder_is_read_with_its_forces(tmp_path: Path) -> None:
    put(tmp_path, glstat=ENERGY, rcforc=rcforc(), rwforc=rwforc())
    run = open_run([str(tmp_path)])
    assert [force.name for force in run.contact_forces] == [
        "contact 7 'body on floor'",
        "rigid wall 1",
        "rigid wall 2",
    ]
    assert {Path(name).name for name in run.sources} == {"glstat", "rcforc", "rwforc"}
    assert len(run.files) == 3


def test_forces_alone_are_no_history(tmp_path: Path) -> None:
    with pytest.raises(
        FormatError,
        match=r"rcforc: an rcforc or rwforc of LS-DYNA, which has forces .* name the gls",
    ):
        open_run(put(tmp_path, rcforc=rcforc()))


def test_an_rcforc_cut_at_every_byte_gives_what_stands_in_it(tmp_path: Path) -> None:
    content, whole = (
        rcforc(times=TIMES[:12]),
        only(open_run(put(tmp_path, glstat=ENERGY, rcforc=rcforc()))),
    )
    for end in range(content.index(b" master") + 1, len(content), 7):
        run = open_run(put(tmp_path, glstat=ENERGY, rcforc=content[:end]))
        for force in run.contact_forces:
            assert force.time.tolist() == whole.time[: force.time.size].tolist()
            np.testing.assert_array_equal(
                np.abs(force.impulses[:-1]),
                np.abs(whole.impulses[: force.time.size - 1]),
            )
        assert run.contact_forces


def test_a_later_leg_of_an_rcforc_goes_on(tmp_path: Path) -> None:
    first, second = tmp_path / "leg1", tmp_path / "leg2"
    for folder in (first, second):
        folder.mkdir()
    names = [
        *put(first, rcforc=rcforc(times=TIMES[:20])),
        *put(second, rcforc=rcforc(times=TIMES[15:])),
    ]
    force = only(open_run([*put(tmp_path, glstat=ENERGY), *names]))
    assert force.time.tolist() == TIMES.tolist()
    assert force.times == SEEN


def binout(acts: np.ndarray = FORCE) -> bytes:
    """A binout with glstat, rcforc (both sides of contacts 7 and 9 in no order) and rwforc with its inner directory."""
    writer = LsdaWriter()
    writer.cd("/rcforc/metadata")
    writer.put("ids", [9, 7, 7, 9], "i4")
    writer.put("side", [0, 1, 0, 1], "i4")
    writer.put("legend_ids", [7, 9], "i4")
    writer.put(
        "legend",
        b"".join(name.ljust(70) for name in (b"body on floor", b"others")),
        "i1",
    )
    writer.cd("/rwforc/forces/metadata")
    writer.put("ids", [1], "i4")
    for number, (time, force) in enumerate(zip(TIMES, acts, strict=True), start=1):
        writer.cd(f"/glstat/d{number:06d}")
        for name in GLSTAT:
            writer.put(name, [time if name == "time" else 1.0], "f4")
        for branch, count, values in (
            ("rcforc", 4, [0, -force, force, 0]),
            ("rwforc/forces", 1, [2 * force]),
        ):
            writer.cd(f"/{branch}/d{number:06d}")
            writer.put("time", [time], "f4")
            for axis in "xyz":
                writer.put(
                    f"{axis}_force", values if axis == "z" else [0.0] * count, "f4"
                )
        writer.cd(f"/rwforc/transducer/d{number:06d}")
        writer.put("time", [time], "f4")
    return bytes(writer.data)


def test_a_binout_has_them_in_its_branches(tmp_path: Path) -> None:
    run = open_run(put(tmp_path, binout0000=binout()))
    assert [(force.name, force.times) for force in run.contact_forces] == [
        ("contact 9 'others'", ()),
        ("contact 7 'body on floor'", SEEN),
        ("rigid wall 1", SEEN),
    ]


def test_a_binout_of_forces_alone_counts_beside_others(tmp_path: Path) -> None:
    content = binout().replace(b"/glstat", b"/nodout")
    names = put(tmp_path, binout0000=content, glstat=ENERGY)
    run = open_run(names)
    assert len(run.contact_forces) == 3
    assert run.databases[0].format == "glstat"
    assert run.history(Selection()).time.size == TIMES.size
    with pytest.raises(
        FormatError,
        match="no glstat in it, but nodout, rcforc, rwforc; name the binout",
    ):
        open_run(names[:1])


def t01(groups: Sequence[MadeGroup], values: Samples) -> bytes:
    """States whose groups have these values (n, members, 6) each."""
    parts = (MadePart(3, "box", (1,)),)
    writer: T01Writer = write_head(parts, globals_=12, groups=groups)
    for time, of_groups in zip(TIMES.tolist(), values.tolist(), strict=True):
        writer.state(
            time,
            [1 + time] * 12,
            [1 + time],
            groups=[np.ravel(members).tolist() for members in of_groups],
        )
    return bytes(writer.data)


def test_a_t01_has_impulses_which_stay_where_no_force_acts(tmp_path: Path) -> None:
    values = np.zeros((TIMES.size, 2, 2, 6))
    between = np.diff(TIMES, prepend=0.0) * FORCE
    values[:, 0, 1, 2] = np.cumsum(between)  # normal, of the second interface
    values[:, 1, 0, 4] = 5 + np.cumsum(between)  # tangential, of the first wall
    groups = [
        MadeGroup(101, {1: "floor", 2: ""}),
        MadeGroup(102, {4: "pole", 5: "ground"}),
    ]
    run = open_run(put(tmp_path, runT01=t01(groups, values)))
    assert [(force.name, force.times) for force in run.contact_forces] == [
        ("interface 1 'floor'", ()),
        ("interface 2", ((0.875, 2.0),)),
        ("rigid wall 4 'pole'", ((0.875, 2.0),)),
        ("rigid wall 5 'ground'", ()),
    ]
    assert run.contact_forces[1].impulses[:, 2].sum() == pytest.approx(
        between.sum(), rel=1e-6
    )


def test_a_group_of_other_things_has_no_forces(tmp_path: Path) -> None:
    groups = [
        MadeGroup(104, {1: "section"}),
        MadeGroup(101, {1: "floor"}, variables=(7, 8)),
    ]
    values = np.zeros((TIMES.size, 1, 6))
    writer = write_head((MadePart(3, "box", (1,)),), globals_=12, groups=groups)
    for time in TIMES.tolist():
        writer.state(time, [1 + time] * 12, [1 + time], groups=[[0.0] * 6, [0.0] * 2])
    run = open_run(put(tmp_path, runT01=bytes(writer.data)))
    assert run.contact_forces == ()
    assert run.databases[0].time.size == len(values)


def test_rigid_walls_of_a_d3plot_have_theirs(tmp_path: Path) -> None:
    states = [
        State(
            t,
            [1.0],
            [1.0],
            [[1.0, 0, 0]],
            [2.0],
            [0.0],
            [0, 0, 0],
            [0.0, f, *[0.0] * 6],
        )
        for t, f in zip(TIMES.tolist(), FORCE.tolist(), strict=True)
    ]
    files = D3plotWriter(ids=(1,), titles=(), walls=2).written(states, 20)
    run = open_run(put(tmp_path, **files)[:1])
    assert [(force.name, force.times) for force in run.contact_forces] == [
        ("rigid wall 1", ()),
        ("rigid wall 2", SEEN),
    ]


@pytest.mark.parametrize(
    "name",
    [
        "Contact force Z (N)",
        "resultant_contact_force",
        "rcforc 7 z",
        "floor contact1 FNZ",
        "Wall Force",
    ],
)
def test_a_column_of_forces_is_known_by_its_name(name: str, tmp_path: Path) -> None:
    rows = "".join(f"{t},{1 + t},{f},{t}\n" for t, f in zip(TIMES, FORCE, strict=True))
    table = f"time,internal energy,{name},contact force work\n{rows}".encode()
    force = only(open_run(put(tmp_path, **{"run.csv": table})))
    assert force.name == repr(name)
    assert force.times[0][0] == 0.875
    assert force.times[-1][1] == 2.125


@pytest.mark.parametrize(
    "name", ["spring force", "section force", "contact energy", "force", "x momentum"]
)
def test_other_columns_are_none(name: str, tmp_path: Path) -> None:
    rows = "".join(f"{t},{1 + t},{f}\n" for t, f in zip(TIMES, FORCE, strict=True))
    run = open_run(
        put(tmp_path, **{"run.csv": f"time,internal energy,{name}\n{rows}".encode()})
    )
    assert run.contact_forces == ()


def test_round_off_is_no_force() -> None:
    forces = np.zeros((TIMES.size, 3))
    forces[:, 0] = FORCE + 1e-7
    force = ContactForce.of_forces("any", TIMES, forces)
    assert force.times == SEEN


def test_info_lists_them(tmp_path: Path) -> None:
    names = put(tmp_path, glstat=ENERGY, rwforc=rwforc())
    survey_of_run = describe_run(open_run(names), Selection())
    lines_on_forces = [
        value
        for name, value in overview_table.list_facts(survey_of_run)
        if name == "contact force"
    ]
    assert lines_on_forces == [
        "rigid wall 1 never acts",
        "rigid wall 2 acts from 0.875 to 2.125",
    ]
    assert run_json("info", *names)["contact_forces"] == [
        {"name": "rigid wall 1", "acts": []},
        {"name": "rigid wall 2", "acts": [{"start": 0.875, "end": 2.125}]},
    ]
