"""The sign of life while files are read: on a terminal only, after a second only, and gone afterwards."""

from __future__ import annotations

import io
import os
import re
import signal
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from d2rpick.cli import progress
from tests.command import ENERGY, started

if TYPE_CHECKING:
    from collections.abc import Sequence

pty = pytest.importorskip("pty", reason="terminals are a matter of POSIX")
PERIOD = 0.02


class Terminal(io.StringIO):
    """A stderr that is a terminal."""

    def isatty(self) -> bool:
        return True


def rest_of(terminal: int) -> bytes:
    """What is left to be read where nobody writes any more."""
    rest = b""
    with suppress(OSError):  # how Linux tells that the other end is closed
        while piece := os.read(terminal, 1000):
            rest += piece
    os.close(terminal)
    return rest


def shown(stream: io.StringIO, names: Sequence[str], *, periods: float, quiet: bool = False) -> str:
    """Give what is on ``stream`` after that many periods of reading."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "stderr", stream)
        patch.setenv("COLUMNS", "40")
        with progress.reading(names, quiet=quiet, period=PERIOD):
            time.sleep(periods * PERIOD)
    return stream.getvalue()


def test_a_line_counts_the_time_and_is_erased() -> None:
    pieces = shown(Terminal(), ["glstat"], periods=10).split("\r")
    assert pieces[0] == pieces[-1] == ""
    assert pieces[1] == "reading glstat ... 0 s"
    assert pieces[-2] == " " * len(pieces[-3])
    assert len(pieces) > 5


def test_several_files_are_counted_and_a_long_name_does_not_wrap() -> None:
    long = shown(Terminal(), ["a/very/long/name/" * 5 + "binout0000", "b", "c"], periods=5).split("\r")[1]
    assert long.endswith("/binout0000 and 2 more ... 0 s")
    assert len(long) == 39


@pytest.mark.parametrize("case", ["no terminal", "quiet", "fast"])
def test_nothing_is_shown_otherwise(case: str) -> None:
    stream = io.StringIO() if case == "no terminal" else Terminal()
    assert shown(stream, ["glstat"], periods=0 if case == "fast" else 5, quiet=case == "quiet") == ""


def test_an_error_is_shown_on_a_clean_line(monkeypatch: pytest.MonkeyPatch) -> None:
    stream = Terminal()
    monkeypatch.setattr(sys, "stderr", stream)

    def fail() -> None:
        with progress.reading(["glstat"], quiet=False, period=PERIOD):
            time.sleep(5 * PERIOD)
            raise ValueError("broken")

    with pytest.raises(ValueError, match="broken"):
        fail()
    assert stream.getvalue().endswith(" \r")


def test_a_program_that_waits_for_its_input_says_so_on_the_terminal() -> None:
    master, slave = pty.openpty()
    with started("info", "-f", "csv", "-", stdin=subprocess.PIPE, stderr=slave) as process:
        os.close(slave)
        first = os.read(master, 1000)  # blocks until there is something
        result, _ = process.communicate(Path(ENERGY).read_bytes(), timeout=30)
    rest = rest_of(master)
    assert first.startswith(b"\rreading standard input ... 1 s")
    assert rest.endswith(b" \r")
    assert process.returncode == 0
    assert result.startswith(b"source,format,")


@pytest.mark.parametrize("quiet", [False, True])
def test_the_runs_of_a_scan_are_counted_until_it_is_interrupted(quiet: bool) -> None:
    master, slave = pty.openpty()
    options = ["--quiet"] if quiet else []
    with started("rollover", "--scan", "--mesh", "4", "--jobs", "2", *options, stderr=slave) as process:
        os.close(slave)
        told = b""
        if quiet:
            time.sleep(2.5)  # others have told something by now
        while not quiet and b" runs" not in told:
            told += os.read(master, 1000)
        os.killpg(process.pid, signal.SIGINT)  # as a terminal does: to the children too
        process.communicate(timeout=30)
    told += rest_of(master)
    assert process.returncode == 2
    assert b"Traceback" not in told
    assert told.endswith(b"d2rpick: interrupted\r\n")
    assert told == b"\r\nd2rpick: interrupted\r\n" if quiet else re.search(rb"\r\d+ of \d+ runs[,\r]", told)


def test_runs_are_counted_with_the_time_that_is_left(monkeypatch: pytest.MonkeyPatch) -> None:
    stream = Terminal()
    monkeypatch.setattr(sys, "stderr", stream)
    with progress.counting(9, quiet=False, period=PERIOD) as count:
        count.done = count.taken = 3
        time.sleep(5 * PERIOD)
        count.done = 5
        time.sleep(5 * PERIOD)
    assert "\r3 of 9 runs\r" in stream.getvalue()
    assert "\r5 of 9 runs, 0:00 left\r" in stream.getvalue()
    assert stream.getvalue().endswith(" \r")
    # two runs took 60 s, so do the next two
    count = progress.Count(total=9)
    count.tell(3)
    count.tell(5)
    assert count.told(60) == "5 of 9 runs, 2:00 left"
