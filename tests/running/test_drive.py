"""A run that switches itself, with a solver that is a script: what is left of it, also after what ends it early."""

import errno
import json
import os
import shlex
import signal
import subprocess
import sys
import time
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from hypothesis import given
from hypothesis.strategies import floats, integers

from d2rpick.api.drives import Driving
from d2rpick.base.errors import D2RPickError
from d2rpick.histories.formats.radioss_th import TimeHistory
from d2rpick.histories.opening import open_run
from d2rpick.running import engine
from d2rpick.running.sequence import (
    LOAD,
    PROBE,
    RIGID,
    SEARCH,
    Leg,
    Limits,
    Order,
    Seen,
    control,
    next_order,
    window_of,
    windows,
)
from tests.command import ROOT, put, refused, run
from tests.deck.test_openradioss import ENGINE, starter
from tests.decks import wide
from tests.made_t01 import MadePart, headed

FAKE = Path(__file__).with_name("fake_solver.py")
GRAVITY = (
    f"/FUNCT/1\ngravity\n{wide(0.0, -9.81, width=20)}{wide(10.0, -9.81, width=20)}"
    f"/GRAV/1\ngravity\n{wide(1, 'Z', 0, 0, 1)[:-1]}{wide(1.0, 1.0, width=20)}"
)
WAIT, END, LANDS, LOADED = 0.02, 0.22, 0.17, 0.03


def command(kind: str) -> str:
    return shlex.join([sys.executable, str(FAKE), kind, "{deck}"])


def asked(folder: Path, *more: str) -> list[str]:
    deck = folder / "deck"
    if not deck.exists():
        deck.mkdir()
        (deck / "strip_0000.rad").write_text(starter().replace("/TH/PART", f"{GRAVITY}/TH/PART"))
        text = ENGINE.replace("0.02\n/VERS", f"{END}\n/VERS").replace("/TFILE/4\n2e-05", "/TFILE/4\n0.001")
        (deck / "strip_0001.rad").write_text(text)
    return [
        "drive", str(deck / "strip_0000.rad"), "-o", str(folder / "run"), "--wait", str(WAIT),
        "--starter", command("starter"), "--engine", command("engine"), "-f", "json", *more,
    ]  # fmt: skip


def check(found: dict[str, object], folder: Path) -> None:
    """What must hold of every run that came to its end: it is whole, and rigid in the flight alone.

    The solver goes on without a driver, so that one that comes back late may find the flight over.
    """
    switched = [one for one in found["windows"] if one["reason"] is None]  # type: ignore[attr-defined]
    joined = open_run([str(path) for path in sorted((folder / "run").glob("stripT??"))]).databases[0]
    assert joined.time[-1] == pytest.approx(END, abs=0.002)
    # what the parts say is void exactly where they were rigid
    parts = joined.part_channel("internal_energy", [1])[:, 0]
    rigid = joined.time[parts > 1e9]
    assert len(switched) == bool(rigid.size)
    if not switched:
        return
    (window,) = switched
    assert LOADED - 0.002 <= window["free"] <= LOADED + 0.002
    assert window["tr"] >= window["free"] + WAIT
    assert window["td"] < LANDS < window["contact"]
    assert rigid[0] == pytest.approx(window["tr"], abs=0.0021)
    assert rigid[-1] == pytest.approx(window["td"], abs=0.0021)


def test_a_run_is_rigid_in_its_flight_and_comes_to_its_end(tmp_path: Path) -> None:
    report = tmp_path / "page.html"
    found = json.loads(run(*asked(tmp_path, "--report", str(report), "-q")).stdout)
    check(found, tmp_path)
    assert len(found["windows"]) == 1
    kinds = [leg["kind"] for leg in found["legs"]]
    assert kinds[-3:] == ["probe", "rigid", "load"]
    assert found["legs"][-2]["length"] < 0.1 * found["legs"][-3]["length"]  # from a restart of the probe
    assert all(leg["cpu"] == 1.0 for leg in found["legs"])
    assert "First run: strip" in report.read_text()
    restarts = {int(path.name[6:10]) for path in (tmp_path / "run").glob("*.rst")}
    assert max(restarts) - min(restarts) <= 2
    assert not list((tmp_path / "run").glob("*.ctl"))
    shown = run(*asked(tmp_path, "--resume", "-q", "-f", "table")).stdout
    assert "switched" in shown
    assert "no level at td is matched" in shown
    assert "--resume" in refused(*asked(tmp_path))
    over = run(*asked(tmp_path, "--resume"))
    assert f"resumed: legs that are over: {len(kinds)}, the last at 0.2" in over.stderr
    assert json.loads(over.stdout)["windows"] == found["windows"]


@pytest.mark.slow
def test_what_a_solver_says_when_it_fails_is_told_and_the_run_goes_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("D2RPICK_FAKE", "fail")
    failed = run(*asked(tmp_path))
    assert failed.exit_code == 2
    assert "strip_0002.out: the solver failed" in failed.stderr
    assert "NEGATIVE VOLUME IN ELEMENT 7" in failed.stderr
    monkeypatch.delenv("D2RPICK_FAKE")
    check(json.loads(run(*asked(tmp_path, "--resume", "-q")).stdout), tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("ended", [signal.SIGKILL, signal.SIGINT], ids=["killed", "interrupted"])
def test_a_driver_that_is_ended_loses_no_leg(tmp_path: Path, ended: signal.Signals) -> None:
    words = [sys.executable, "-m", "d2rpick", *asked(tmp_path)]
    with subprocess.Popen(words, cwd=ROOT, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as process:
        time.sleep(4)
        process.send_signal(ended)
        process.wait()
    found = run(*asked(tmp_path, "--resume", "-q"))
    assert not found.stderr
    check(json.loads(found.stdout), tmp_path)


@pytest.mark.slow
def test_a_leg_that_was_stopped_before_its_first_state_is_begun_again(tmp_path: Path) -> None:
    words, slow = [sys.executable, "-m", "d2rpick", *asked(tmp_path)], {**os.environ, "D2RPICK_FAKE": "slow"}
    begun = tmp_path / "run" / "strip_0002.out"
    with subprocess.Popen(words, cwd=ROOT, env=slow, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as process:
        while not begun.exists():
            time.sleep(0.05)
        process.send_signal(signal.SIGINT)
    found = run(*asked(tmp_path, "--resume", "-q"))
    assert not found.stderr
    check(json.loads(found.stdout), tmp_path)


def test_a_leg_is_not_told_to_stop_before_its_first_state() -> None:
    """A short search was over by the highest energy of the leg before it, and stopped where it began."""
    order, limits = Order(SEARCH, 2, 0.1, 0.104), Limits(1.0, 1e-3, 0.0, None)
    assert not control(order, Seen(0.1, peak=0.1), limits)
    assert control(order, Seen(0.103, peak=0.1), limits) == "/STOP\n"


def test_a_second_driver_is_kept_out(tmp_path: Path) -> None:
    with engine.alone(tmp_path), pytest.raises(D2RPickError, match="another d2rpick drives"), engine.alone(tmp_path):
        pass


def test_a_leg_is_not_begun_on_a_full_disk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import shutil

    (tmp_path / "strip_0001_0001.rst").write_bytes(bytes(1000))
    solver = engine.Solver(tmp_path, "strip")
    usage = shutil.disk_usage(tmp_path)
    monkeypatch.setattr(shutil, "disk_usage", lambda _: usage._replace(free=2999))
    with pytest.raises(D2RPickError, match="make room, then --resume"):
        solver.check_room(2, 0.5, 2)
    monkeypatch.setattr(shutil, "disk_usage", lambda _: usage._replace(free=3000))
    solver.check_room(2, 0.5, 2)


def test_commands_are_split_as_a_shell_does_and_given_to_none() -> None:
    deck = "a b; rm -rf x_0001.rad"
    given = engine.Commands(engine="mpirun -np 2 'my engine' -i {deck} -nt {threads}", threads=4)
    assert given.words("engine", deck) == [
        "mpirun", "-np", "2", "my engine", "-i", deck, "-nt", "4",
    ]  # fmt: skip
    for wrong in ("engine", "engine '{deck}"):
        with pytest.raises(D2RPickError):
            engine.Commands(engine=wrong).words("engine", deck)


def test_a_restart_that_may_be_cut_is_not_taken(tmp_path: Path) -> None:
    solver = engine.Solver(tmp_path, "strip")
    for name, at in (("strip_0001_0001_I.rst", 10), ("strip_0001_0001_J.rst", 30), ("stripT01", 20)):
        os.utime(put(tmp_path / name, b"x"), (at, at))
    assert solver.left(1).restart == "I"
    (tmp_path / "strip_0001.out").write_text(" NORMAL TERMINATION\n")
    assert solver.left(1).restart == "J"


def test_a_disk_that_is_full_is_told_with_what_to_do(tmp_path: Path) -> None:
    driving = Driving(asked(tmp_path)[1], tmp_path / "run", print, wait=WAIT)
    for wrong, message in (
        (errno.ENOSPC, "run: No space left on device; make room, then --resume"),
        (errno.EIO, "Input"),
    ):
        with pytest.raises((D2RPickError, OSError), match=message), driving.driver(resume=True):
            raise OSError(wrong, os.strerror(wrong))


def test_how_far_a_run_is_can_be_told_at_any_time(tmp_path: Path) -> None:
    with Driving(asked(tmp_path)[1], tmp_path / "run", print, wait=WAIT).driver(resume=False) as driver:
        assert driver.progress(3.4) == "starting ... 3 s"
        driver.at = Order(RIGID, 2, 0.05, 0.2), 0.1234567
        assert driver.progress(9.0) == f"leg 2, rigid: 0.123457 of {END:g}"


def test_a_history_that_is_cut_in_a_record_ends_with_a_whole_state(tmp_path: Path) -> None:
    made = headed([MadePart(1, "strip of shells", (1, 6))], globals_=6)
    for time_ in (0.0, 1.0, 2.0):
        made.state(time_, [1.0] * 6, [1.0, 1.0])
    solver, history = engine.Solver(tmp_path, "strip"), tmp_path / "stripT01"
    for cut in (1, 5, 41):  # of 60 bytes
        history.write_bytes(made.data[:-cut])
        solver.shorten(1, 9.0)
        assert TimeHistory(history.read_bytes(), "T01").time.tolist() == [0.0, 1.0]
        assert not TimeHistory(history.read_bytes(), "T01").notes


@pytest.mark.parametrize(("idle", "margin"), [(True, 0.002), (False, 0.03 * 0.4)])
def test_the_margin_is_the_least_one_where_nothing_vibrates(idle: bool, margin: float) -> None:
    flown = Leg(Order(LOAD, 1, 0.0, 1.0), Seen(0.01, 0.0, 0.02, idle=idle))
    probe = Leg(Order(PROBE, 2, 0.01, 1.0), Seen(0.45, contact=0.4))
    assert window_of([flown, probe], Limits(1.0, 1e-3, 0.002)).td == pytest.approx(0.4 - margin)
    assert window_of([flown, probe], Limits(1.0, 1e-3, 0.002, 0.05)).td == pytest.approx(0.35)


FLOWN, PROBED = Leg(Order(LOAD, 1, 0.0, 1.0), Seen(0.1, 0.05, 0.05)), Order(PROBE, 2, 0.1, 1.0)
WITHIN = Limits(1.0, 1e-3, 0.002, 0.01)


def test_a_rigid_leg_begins_at_the_last_restart_that_surely_lies_before_td() -> None:
    """A restart may come later than it seems, by five intervals of the history."""
    probe = Leg(PROBED, Seen(0.42, contact=0.4), restarts=((0.3, "K"), (0.38, "L"), (0.389, "M"), (0.41, "N")))
    rigid = next_order([FLOWN, probe], WITHIN)
    assert rigid == Order(RIGID, 3, 0.38, 0.39, restart="L")
    after = next_order([FLOWN, probe, Leg(rigid, Seen(0.39))], WITHIN)
    assert after
    assert (after.kind, after.number) == (LOAD, 4)
    (window,) = windows([FLOWN, probe, Leg(rigid, Seen(0.39))], WITHIN)
    assert (window.tr, window.td) == (0.1, 0.39)


def test_a_rigid_leg_without_such_a_restart_or_with_a_contact_begins_where_the_parts_became_rigid() -> None:
    probe = Leg(PROBED, Seen(0.42, contact=0.4), restarts=((0.389, "M"),))
    assert next_order([FLOWN, probe], WITHIN) == Order(RIGID, 2, 0.1, 0.39)
    hit = Leg(Order(RIGID, 3, 0.3, 0.39, restart="K"), Seen(0.37, contact=0.36))
    assert next_order([FLOWN, probe, hit], WITHIN) == Order(RIGID, 2, 0.1, 0.35)
    assert [(one.tr, one.td) for one in windows([FLOWN, probe, hit], WITHIN)] == [(0.1, 0.35)]


@given(step=floats(1e-6, 1e-4), growth=floats(1.0, 1.2), apart=integers(1, 8))
def test_the_times_of_cycles_follow_from_the_steps_of_the_history(step: float, growth: float, apart: int) -> None:
    """Steps that grow to five times as much, as they do when parts become rigid, are known within a state's cycles."""
    steps = np.minimum(step * growth ** np.arange(500), 5 * step)
    times = np.cumsum(steps)
    made = headed([], globals_=7)
    for cycle in range(apart - 1, 500, apart):
        made.state(times[cycle], [1.0] * 6 + [steps[cycle]], [])
    with TemporaryDirectory() as folder:
        Path(folder, "stripT02").write_bytes(made.data)
        found = engine.Solver(Path(folder), "strip").times(2, 0.0, [100, 200, 400])
    assert found == pytest.approx(times[[99, 199, 399]], abs=apart * steps[-1])


@pytest.mark.parametrize("written", [[], [0.0]])
def test_without_steps_no_restart_has_a_time(tmp_path: Path, written: list[float]) -> None:
    made = headed([], globals_=6 + len(written))
    made.state(1.0, [1.0] * 6 + written, [])
    (tmp_path / "stripT02").write_bytes(made.data)
    assert engine.Solver(tmp_path, "strip").times(2, 0.0, [100]) == []
