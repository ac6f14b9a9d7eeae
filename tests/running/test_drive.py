"""A run that switches itself, with a script as solver: its results, also after an early end."""

import errno
import json
import os
import shlex
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis.strategies import booleans, floats, lists, tuples

from d2rpick.api.arguments import read_windows
from d2rpick.api.drives import Driving
from d2rpick.base.errors import D2RPickError
from d2rpick.histories.opening import open_run
from d2rpick.report.drive import describe_progress
from d2rpick.running import engine
from d2rpick.running.sequence import (
    LOAD,
    PROBE,
    RIGID,
    Leg,
    LegFindings,
    Limits,
    Order,
    choose_next_leg,
    find_next_window,
    windows,
)
from tests.command import ROOT, put, read_refusal, run
from tests.deck.test_openradioss import ENGINE, write_starter
from tests.decks import pad

FAKE = Path(__file__).with_name("fake_solver.py")
GRAVITY = (
    f"/FUNCT/1\ngravity\n{pad(0.0, -9.81, width=20)}{pad(10.0, -9.81, width=20)}"
    f"/GRAV/1\ngravity\n{pad(1, 'Z', 0, 0, 1)[:-1]}{pad(1.0, 1.0, width=20)}"
)
WALL = "/RWALL/PLANE/8\nground\n" + pad(0, 0, 0, 0) + 3 * pad(0.0, 0.0, 1.0, width=20)
WAIT, END, LANDS, LOADED = 0.02, 0.22, 0.17, 0.03

IDLE, SWINGS = (
    LegFindings(0.0, 0.02, flies=True, idle=True),
    LegFindings(0.05, 0.05, flies=True, tr=0.1, swing=0.015),
)
WITHIN = Limits(1.0, 1e-3, 0.002, 0.01, 0.2)
FLOWN = Leg(Order(LOAD, 1, 0.0, 0.1), SWINGS, 1000, 1.0)


def give_solver_command(kind: str) -> str:
    return shlex.join([sys.executable, str(FAKE), kind, "{deck}"])


def prepare_drive(folder: Path, *options: str) -> list[str]:
    deck = folder / "deck"
    if not deck.exists():
        deck.mkdir()
        (deck / "strip_0000.rad").write_text(
            write_starter().replace("/TH/PART", f"{GRAVITY}{WALL}/TH/PART")
        )
        text = ENGINE.replace("0.02\n/VERS", f"{END}\n/VERS").replace(
            "/TFILE/4\n2e-05", "/TFILE/4\n0.001"
        )
        (deck / "strip_0001.rad").write_text(text)
    return [
        "drive", str(deck / "strip_0000.rad"), "-o", str(folder / "run"), "--wait", str(WAIT),
        "--starter", give_solver_command("starter"), "--engine", give_solver_command("engine"), "-f", "json", *options,
    ]  # fmt: skip


def make_driving(folder: Path) -> Driving:
    return Driving(
        prepare_drive(folder)[1],
        folder / "run",
        print,
        wait=WAIT,
        starter=give_solver_command("starter"),
        engine=give_solver_command("engine"),
    )


def check_finished_run(report: dict[str, Any], folder: Path) -> None:
    """Check what must hold for every finished run: it is complete, and rigid only in the flight."""
    switched = [
        window_row for window_row in report["windows"] if window_row["reason"] is None
    ]
    joined = open_run(
        [str(path) for path in sorted((folder / "run").glob("stripT??"))]
    ).databases[0]
    assert joined.time[-1] == pytest.approx(END, abs=0.002)
    assert np.diff(joined.time) == pytest.approx(
        0.001, abs=1e-5
    )  # no state is missing between restart segments
    parts = joined.part_channel("internal_energy", [1])[:, 0]
    rigid = joined.time[
        parts > 1e9
    ]  # part values are meaningless exactly while the parts are rigid
    (window,) = switched
    assert LOADED - 0.002 <= window["free"] <= LOADED + 0.002
    assert window["tr"] >= window["free"] + WAIT / 2
    assert window["td"] < LANDS < window["contact"]
    assert rigid[0] == pytest.approx(window["tr"], abs=0.0021)
    assert rigid[-1] == pytest.approx(window["td"], abs=0.0021)


def read_histories(folder: Path) -> dict[str, bytes]:
    return {
        path.name: path.read_bytes()
        for path in sorted((folder / "run").glob("stripT??"))
    }


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, object]]:
    """Return an undisturbed run, and the answer about it."""
    folder = tmp_path_factory.mktemp("whole")
    return folder, json.loads(
        run(*prepare_drive(folder, "--report", str(folder / "page.html"), "-q")).stdout
    )


def test_a_run_is_rigid_in_its_flight_and_comes_to_its_end(
    whole: tuple[Path, dict[str, object]],
) -> None:
    folder, outcome = whole
    check_finished_run(outcome, folder)
    legs: list[dict[str, object]] = outcome["legs"]  # type: ignore[assignment]
    assert {"load", "probe"} <= {str(leg["kind"]) for leg in legs}
    assert all(leg["cpu"] == 1.0 for leg in legs)
    assert "First run: strip" in (folder / "page.html").read_text()
    assert (
        len(list((folder / "run").glob("*.rst"))) <= 4
    )  # restart files of the starter, and those that may still be needed
    result = run(*prepare_drive(folder, "--resume", "-q", "-f", "table")).stdout
    assert "switched" in result
    assert "tr is not matched to the energy at td" in result
    assert "--resume" in read_refusal(*prepare_drive(folder))
    over = run(*prepare_drive(folder, "--resume"))
    assert (
        f"resumed: {len(legs)} engine runs are done, the last until {END}"
        in over.stderr
    )
    assert json.loads(over.stdout)["windows"] == outcome["windows"]
    journal = (folder / "run" / "drive.ndjson").read_text()
    switched = [
        row for row in json.loads(over.stdout)["windows"] if row["reason"] is None
    ]
    written = read_windows(journal, "drive.ndjson")
    assert np.array(written) == pytest.approx(
        np.array([(row["tr"], row["td"]) for row in switched]), abs=0.0021
    )


@pytest.mark.slow
@pytest.mark.parametrize("fault", ["empty", "cut", "slow", "fail", "damaged"])
def test_the_same_command_gives_the_same_run_whatever_befalls_it(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    whole: tuple[Path, dict[str, object]],
    fault: str,
) -> None:
    """After a full disk, on a slow machine, or after a solver error, the history is the same bit by bit."""
    monkeypatch.setenv("D2RPICK_FAKE", fault)
    result = run(*prepare_drive(tmp_path))
    if fault == "fail":
        assert result.exit_code == 2
        assert "strip_0002.out: the solver failed" in result.stderr
        assert "NEGATIVE VOLUME" in result.stderr
        monkeypatch.delenv("D2RPICK_FAKE")
        result = run(*prepare_drive(tmp_path, "--resume"))
    if (
        fault == "damaged"
    ):  # segment 4 fails on its restart file, which segment 3 then writes again
        assert "strip_0004.out: the solver failed" in result.stderr
        result = run(*prepare_drive(tmp_path, "--resume"))
        assert (
            "the last engine run is computed again from 0.032: the engine run after it has failed"
            in result.stderr
        )
    if fault in ("empty", "cut"):
        assert (
            "engine run 3: its restart file or history is incomplete; computing it again"
            in result.stderr
        )
    check_finished_run(json.loads(result.stdout), tmp_path)
    assert read_histories(tmp_path) == read_histories(whole[0])


@pytest.mark.slow
@pytest.mark.parametrize(
    "ended",
    [signal.SIGKILL, signal.SIGINT, signal.SIGTERM],
    ids=["killed", "int", "term"],
)
def test_a_driver_that_is_ended_loses_nothing_but_its_leg(
    tmp_path: Path, ended: signal.Signals, whole: tuple[Path, dict[str, object]]
) -> None:
    words, slow = (
        [sys.executable, "-m", "d2rpick", *prepare_drive(tmp_path)],
        {**os.environ, "D2RPICK_FAKE": "slow"},
    )
    begun, lock = tmp_path / "run" / "stripT03", tmp_path / "run" / ".solver.lock"
    with subprocess.Popen(
        words, cwd=ROOT, env=slow, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    ) as process:
        while not begun.exists():
            time.sleep(0.05)
        process.send_signal(ended)
    if ended is not signal.SIGKILL:
        with pytest.raises(ProcessLookupError):  # the solver has ended too
            os.killpg(int(lock.read_text()), 0)
    result = run(*prepare_drive(tmp_path, "--resume", "-q"))
    assert not result.stderr
    check_finished_run(json.loads(result.stdout), tmp_path)
    assert read_histories(tmp_path) == read_histories(whole[0])


@pytest.mark.slow
def test_a_solver_that_hangs_is_ended_with_its_driver(tmp_path: Path) -> None:
    words, hangs = (
        [sys.executable, "-m", "d2rpick", *prepare_drive(tmp_path)],
        {**os.environ, "D2RPICK_FAKE": "hang"},
    )
    begun, lock = tmp_path / "run" / "strip_0002.out", tmp_path / "run" / ".solver.lock"
    with subprocess.Popen(
        words, cwd=ROOT, env=hangs, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    ) as process:
        while not begun.exists():
            time.sleep(0.05)
        process.send_signal(signal.SIGINT)
    with pytest.raises(ProcessLookupError):
        os.killpg(int(lock.read_text()), 0)


def test_a_run_goes_back_to_the_last_restart_that_is_whole(
    tmp_path: Path, whole: tuple[Path, dict[str, object]]
) -> None:
    """If restart files are damaged, the run continues from an earlier one, if necessary from that of the starter."""
    shutil.copytree(whole[0] / "deck", tmp_path / "deck")
    shutil.copytree(whole[0] / "run", tmp_path / "run")
    journal = tmp_path / "run" / "drive.ndjson"
    lines = journal.read_bytes().splitlines(keepends=True)
    ends = [
        line_number
        for line_number, line in enumerate(lines)
        if b'"event": "ended"' in line
    ]
    journal.write_bytes(b"".join(lines[: ends[-2] + 1]))
    for path in (tmp_path / "run").glob("strip_00[0-9][1-9]_0001.rst"):
        path.write_bytes(b"")
    result = run(*prepare_drive(tmp_path, "--resume"))
    assert (
        "the last engine run is computed again from 0: its restart file is incomplete"
        in result.stderr
    )
    check_finished_run(json.loads(result.stdout), tmp_path)
    assert read_histories(tmp_path) == read_histories(whole[0])


def test_a_leg_that_a_probe_replaced_is_not_computed_again_if_the_window_is_not_used(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With a margin of half of the run, no window pays off; the leg before the probe is then needed after all."""
    options = ["--margin", "0.109", "--wait", "0.028"]
    result = run(*prepare_drive(tmp_path, *options))
    assert "engine run 4: probe from 0.058 to" in result.stderr
    assert "engine run 4: load from 0.058 to 0.065, computed before" in result.stderr
    outcome = json.loads(result.stdout)
    assert all(window["reason"] for window in outcome["windows"])
    loads = [leg for leg in outcome["legs"] if leg["kind"] == "load"]
    # Each deformable engine run counts once, and together they are the run.
    assert sum(leg["cpu"] for leg in loads) == len(loads)
    assert sum(leg["length"] for leg in loads) == pytest.approx(END)
    paths = sorted((tmp_path / "run").glob("stripT??"))
    joined = open_run([str(path) for path in paths]).databases[0]
    assert np.diff(joined.time) == pytest.approx(0.001, abs=1e-5)
    assert not (tmp_path / "run" / ".drive.replaced").exists()
    # Without the files that were set aside, the leg is computed again; the run stays the same.
    monkeypatch.setenv("D2RPICK_FAKE", "lost")
    (again := tmp_path / "again").mkdir()
    computed = run(*prepare_drive(again, *options))
    assert "engine run 4: load from 0.058 to 0.065\n" in computed.stderr
    assert "computed before" not in computed.stderr
    assert read_histories(again) == read_histories(tmp_path)
    assert json.loads(computed.stdout)["windows"] == outcome["windows"]


def test_files_are_set_aside_and_restored_even_if_a_driver_was_stopped_in_between(
    tmp_path: Path,
) -> None:
    solver = engine.Solver(tmp_path, "strip", engine.Commands())
    names = ["strip_0004.rad", "strip_0004_0001.rst", "stripT04", "strip_0004.out"]
    for name in names:
        put(tmp_path / name, f"{name} NORMAL TERMINATION".encode())
    aside = tmp_path / ".drive.replaced"
    aside.mkdir()
    (tmp_path / names[0]).rename(aside / names[0])  # the driver was stopped here
    solver.set_aside(4)
    put(tmp_path / names[0], b"the engine file of the probe")
    solver.set_aside(4)  # the listing is gone, so all files are there already
    assert sorted(path.name for path in aside.iterdir()) == sorted(names)
    solver.clear(4)
    solver.restore(4)
    for name in names:
        assert (tmp_path / name).read_text() == f"{name} NORMAL TERMINATION"
    solver.remove_replaced()
    assert not aside.exists()


def test_silence_is_measured_by_what_the_solver_writes(tmp_path: Path) -> None:
    solver, then = (
        engine.Solver(tmp_path, "strip", engine.Commands()),
        time.time() - 100,
    )
    assert solver.silent_for() == 0.0
    os.utime(put(tmp_path / "stripT01", b"x"), (then, then))
    assert solver.silent_for() == pytest.approx(100, abs=5)


def test_a_second_driver_is_kept_out(tmp_path: Path) -> None:
    with (
        engine.alone(tmp_path),
        pytest.raises(D2RPickError, match="another d2rpick drives"),
        engine.alone(tmp_path),
    ):
        pass


def test_a_leg_is_not_begun_on_a_full_disk(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    import shutil

    (tmp_path / "strip_0001_0001.rst").write_bytes(bytes(1000))
    solver = engine.Solver(tmp_path, "strip", engine.Commands())
    usage = shutil.disk_usage(tmp_path)
    monkeypatch.setattr(shutil, "disk_usage", lambda _: usage._replace(free=1999))
    with pytest.raises(D2RPickError, match="make room, then --resume"):
        solver.check_room(2)
    monkeypatch.setattr(shutil, "disk_usage", lambda _: usage._replace(free=2000))
    solver.check_room(2)
    put(tmp_path / "strip_0001.log", b"TOTAL DISK SPACE USED")
    assert solver.last_words(1) == "TOTAL DISK SPACE USED"
    monkeypatch.setattr(shutil, "disk_usage", lambda _: usage._replace(free=999))
    assert solver.last_words(1).startswith("the disk is full, 0.000999 MB are free; TO")


def test_commands_are_split_as_a_shell_does_and_given_to_none() -> None:
    deck = "a b; rm -rf x_0001.rad"
    commands = engine.Commands(
        engine="mpirun -np 2 'my engine' -i {deck} -nt {threads}", threads=4
    )
    assert commands.words("engine", deck) == [
        "mpirun", "-np", "2", "my engine", "-i", deck, "-nt", "4",
    ]  # fmt: skip
    for template in ("engine", "engine '{deck}"):
        with pytest.raises(D2RPickError):
            engine.Commands(engine=template).words("engine", deck)


def test_a_restart_is_whole_that_begins_with_its_name_and_is_as_long_as_the_first(
    tmp_path: Path,
) -> None:
    solver, size = engine.Solver(tmp_path, "strip", engine.Commands()), 1000
    for number in (0, 1):
        name = f"strip_{number:04d}_0001.rst"
        put(tmp_path / name, name.encode().ljust(size))
    assert solver.whole(0)
    assert solver.whole(1)
    assert not solver.whole(2)
    content = (tmp_path / "strip_0001_0001.rst").read_bytes()
    for bad_content in (
        b"",
        content[:100],
        content[: size // 2],
        bytes(size),
        content.replace(b"0001_", b"0002_"),
    ):
        (tmp_path / "strip_0001_0001.rst").write_bytes(bad_content)
        assert not solver.whole(1)
    (tmp_path / "strip_0001_0001.rst").write_bytes(content)
    put(
        tmp_path / "strip_0000_0002.rst", b"strip_0000_0002.rst".ljust(size)
    )  # one of two domains is missing
    assert not solver.whole(1)


def test_a_signal_that_ended_a_solver_is_told(tmp_path: Path) -> None:
    kill = shlex.join([sys.executable, "-c", "import os; os.kill(os.getpid(), 9)"])
    commands = engine.Commands(engine=f"{kill} {{deck}}")
    solver = engine.Solver(tmp_path, "strip", commands)
    solver.start("engine", 1)
    while solver.alive:
        time.sleep(0.01)
    assert solver.last_words(1) == "ended by signal 9; nothing was printed"


def test_of_a_listing_the_lines_with_the_error_are_told(tmp_path: Path) -> None:
    lines = [
        " read",
        " ** ERROR IN INPUT",
        " LINE 12: NODE 7 IS NOT DEFINED",
        "",
        *(f" more {n}" for n in range(99)),
    ]
    put(tmp_path / "strip_0000.out", "\n".join(lines).encode())
    last_words = engine.Solver(tmp_path, "strip", engine.Commands()).last_words(0)
    assert last_words.startswith("** ERROR IN INPUT | LINE 12: NODE 7 IS NOT DEFINED")


def test_a_disk_that_is_full_is_told_with_what_to_do(tmp_path: Path) -> None:
    driving = Driving(
        prepare_drive(tmp_path)[1],
        tmp_path / "run",
        print,
        wait=WAIT,
        starter=give_solver_command("starter"),
        engine=give_solver_command("engine"),
    )
    for fault, message in (
        (errno.ENOSPC, "run: No space left on device; make room, then --resume"),
        (errno.EIO, "Input"),
    ):
        with (
            pytest.raises((D2RPickError, OSError), match=message),
            driving.driver(resume=False),
        ):
            raise OSError(fault, os.strerror(fault))


def test_how_far_a_run_is_can_be_told_at_any_time(tmp_path: Path) -> None:
    with Driving(
        prepare_drive(tmp_path)[1],
        tmp_path / "run",
        print,
        wait=WAIT,
        starter=give_solver_command("starter"),
        engine=give_solver_command("engine"),
    ).driver(resume=False) as driver:
        assert describe_progress(driver, 3.4) == "starting ... 3 s"
        driver.at = Order(RIGID, 2, 0.05, 0.2)
        assert (
            describe_progress(driver, 9.0)
            == f"engine run 2, rigid: 0.05 to 0.2 of {END:g}"
        )


@pytest.mark.parametrize(
    ("swing_seen", "margin"), [(IDLE, 0.002), (SWINGS, 0.03 * 0.35)]
)
def test_the_margin_is_the_least_one_where_nothing_vibrates(
    swing_seen: LegFindings, margin: float
) -> None:
    flown = Leg(Order(LOAD, 1, 0.0, 0.1), swing_seen, 1000)
    probe = Leg(Order(PROBE, 2, 0.1, 1.0), LegFindings(contact=0.4), 100)
    assert find_next_window(
        [flown, probe], Limits(1.0, 1e-3, 0.002)
    ).td == pytest.approx(0.4 - margin)
    assert find_next_window(
        [flown, probe], Limits(1.0, 1e-3, 0.002, 0.05)
    ).td == pytest.approx(0.35)


def make_probes(*ends: float, contact: float) -> list[Leg]:
    starts = [0.1, *ends[:-1]]
    orders = [
        Order(PROBE, number, *span)
        for number, span in enumerate(zip(starts, ends, strict=True), start=2)
    ]
    return [
        FLOWN,
        *(
            Leg(
                order,
                LegFindings(contact=contact if order.until > contact else None),
                100,
                0.1,
            )
            for order in orders
        ),
    ]


def test_a_run_goes_on_from_the_last_leg_of_a_probe_that_ended_before_td() -> None:
    assert choose_next_leg(make_probes(0.2, 0.3, 0.45, contact=0.4), WITHIN) == Order(
        RIGID, 4, 0.3, 0.39
    )
    legs = make_probes(0.2, 0.39, 0.45, contact=0.4)  # the last probe ended at td
    next_leg = choose_next_leg(legs, WITHIN)
    assert next_leg
    assert (next_leg.kind, next_leg.number, next_leg.start) == (LOAD, 4, 0.39)
    assert choose_next_leg(make_probes(0.45, contact=0.4), WITHIN) == Order(
        RIGID, 2, 0.1, 0.39
    )


def test_a_probe_goes_on_from_its_own_restarts_to_the_end_of_the_run() -> None:
    legs = [FLOWN]
    while order := choose_next_leg(legs, WITHIN):
        assert order.kind == PROBE
        assert order.start == legs[-1].order.until
        legs.append(Leg(order, LegFindings(), 100, 0.1))
    assert legs[-1].order.until == WITHIN.end
    assert len(legs) < 12
    assert [
        (window.tr, window.td, window.contact) for window in windows(legs, WITHIN)
    ] == [(0.1, 1.0, None)]


def test_a_flight_that_is_left_out_is_deformable_from_where_the_parts_would_have_become_rigid() -> (
    None
):
    for contact, reason in (
        (0.13, "less than 4%"),
        (0.09, "half cycles"),
        (0.109, "begins before tr"),
    ):
        legs = make_probes(0.2, contact=contact)
        (window,) = windows(legs, WITHIN)
        assert reason in str(window.reason)
        next_leg = choose_next_leg(legs, WITHIN)
        assert next_leg
        assert (next_leg.kind, next_leg.number, next_leg.start) == (LOAD, 2, 0.1)
        again = Leg(next_leg, SWINGS, 1000, 1.0)  # the same flight is not tried twice
        following = choose_next_leg([*legs, again], WITHIN)
        assert following
        assert following.kind == LOAD


@given(
    wait=floats(1e-3, 0.3),
    evidence=lists(tuples(floats(0.0, 1.0), booleans()), min_size=200, max_size=200),
)
def test_whatever_is_seen_the_run_comes_to_its_end_with_the_numbers_that_the_solver_has(
    wait: float, evidence: list[tuple[float, bool]]
) -> None:
    legs: list[Leg] = []
    for share, flies in evidence:
        order = choose_next_leg(legs, WITHIN)
        if order is None:
            break
        assert order.until > order.start
        assert order.number <= 99
        free = share * order.until
        contact = (
            order.start + share * (order.until - order.start)
            if order.rigid and flies
            else None
        )
        tr = order.start if flies else order.until
        legs.append(
            Leg(
                order,
                LegFindings(free, wait, flies=flies, tr=tr, contact=contact),
                100,
                1.0,
            )
        )
        if order.kind == RIGID:
            legs[-1] = legs[-1]._replace(
                findings=LegFindings()
            )  # it flies in the same way as the probe did


@pytest.mark.parametrize(
    ("old", "new", "options", "message"),
    [
        (
            "/RWALL/PLANE/8",
            "/FUNCT/8",
            [],
            "strip_0000.rad: the deck has no contact and no rigid wall, so nothing",
        ),
        (
            "DEF       MASS\n         1",
            "DEF       MASS\n         7",
            [],
            "no momenta of part 1 in the time history",
        ),
        (
            "/TH/PART",
            "/TH/NODE",
            [],
            "strip_0000.rad: no momenta of part 1 in the time history; /TH/PART with DEF",
        ),
        ("DEF       MASS", "IE        MASS", [], "no momenta of part 1"),
        (
            "",
            "",
            ["--wait", "0.2"],
            "--wait 0.2: a time from 0.012, 12 states of the history, to 0.11",
        ),
        ("", "", ["--wait", "0.001"], "--wait 0.001: a time from 0.012"),
        (
            "",
            "",
            ["--margin", "0.2"],
            "--margin 0.2: less than 0.11, half of the run, was expected",
        ),
        ("", "", ["--part", "9"], "part 9"),
        (
            "",
            "",
            ["--engine", "/no/such/engine {deck}"],
            "/no/such/engine: no such program; correct",
        ),
    ],
)
def test_what_a_run_lacks_is_told_before_anything_is_computed(
    tmp_path: Path, old: str, new: str, options: list[str], message: str
) -> None:
    words, deck = prepare_drive(tmp_path), tmp_path / "deck" / "strip_0000.rad"
    text = deck.read_text()
    assert not old or old in text
    deck.write_text(text.replace(old, new) if old else text)
    assert message in read_refusal(*words, *options)
    assert not (tmp_path / "run").exists()
    if "--engine" in options:
        planned = run(*words, *options, "--dry-run")
        assert planned.exit_code == 1
        assert "there is no program '/no/such/engine'" in planned.stdout
    else:
        assert message in read_refusal(*words, *options, "--dry-run")


def test_a_command_that_is_corrected_is_not_one_that_has_begun(tmp_path: Path) -> None:
    broken = put(tmp_path / "broken", b"#!/bin/sh\nexit 3\n")
    broken.chmod(0o755)
    failed = run(*prepare_drive(tmp_path), "--starter", f"{broken} {{deck}}")
    assert "the starter failed" in failed.stderr
    with Driving(
        prepare_drive(tmp_path)[1],
        tmp_path / "run",
        print,
        wait=WAIT,
        starter=give_solver_command("starter"),
        engine=give_solver_command("engine"),
    ).driver(resume=False) as driver:
        assert not driver.journal.legs
