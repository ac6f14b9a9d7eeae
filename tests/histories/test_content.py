"""The bytes of files that are appended to, cut, replaced or rewritten while they are read."""

import hashlib
import os
import sys
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from itertools import cycle
from pathlib import Path
from threading import Event, Thread
from time import sleep
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, strategies as st

from d2rpick.base.errors import ChangedError, D2RPickError
from d2rpick.choice.overview import describe_run
from d2rpick.histories.content import Content
from d2rpick.histories.formats import csv_table
from d2rpick.histories.opening import OpenedRun, Selection
from tests.command import put
from tests.hdf5_files import ENERGY, plain, write_hdf5
from tests.histories.test_source import CONTENTS, TIMES
from tests.made_binout import make_binout
from tests.made_d3plot import D3plotWriter, make_states
from tests.made_t01 import make_t01
from tests.reading import open_file, open_on_disk, open_run_on_disk, read_history
from tests.text_files import make_glstat_text, make_matsum_text

pytestmark = pytest.mark.usefixtures("new_files")

STATES = np.arange(400)
ONE, OTHER = (
    make_glstat_text(STATES / 8, energy + STATES) for energy in (1000.0, 2000.0)
)
TABLES = [
    csv_table.write({"time": STATES / 8, "IE": np.float64(energy) + STATES})
    for energy in (1000.0, 2000.0)
]


OPENERS = pytest.mark.parametrize(
    "opened", [open_file, open_run_on_disk], ids=["in memory", "on disk"]
)

ANEW = {
    "binout": bytes(make_binout([1, 2, 3], shift=1).data),
    "radioss-th": bytes(make_t01(3, start=1).data),
    "glstat": make_glstat_text(TIMES, [3, 2, 1]),
    "matsum": make_matsum_text(TIMES, [7, 3], np.full((3, 2), 2.0)),
    "hdf5": write_hdf5(plain)
    .getvalue()
    .replace(ENERGY.tobytes(), (ENERGY + 1).tobytes()),
    "csv": b"time,IE\n0,2\n1,1\n",
    "d3thdt": D3plotWriter(family=3).together(make_states(TIMES)[::-1]),
    "d3plot": D3plotWriter(order=">").together(make_states(TIMES)),
}
HOUR = 3_600_000_000_001


@given(
    st.binary(min_size=8, max_size=3000),
    st.lists(st.integers(0, 2995), max_size=60),
    st.integers(1, 8),
    st.integers(-5, 3005),
    st.integers(0, 3005),
)
def test_bytes_on_a_disk_are_those_in_memory(
    tmp_path_factory: pytest.TempPathFactory,
    data: bytes,
    places: list[int],
    width: int,
    begin: int,
    size: int,
) -> None:
    file = put(tmp_path_factory.getbasetemp() / "bytes", data)
    held, disk_content = Content(data), open_on_disk(file)
    addresses = np.array(
        [place % (len(data) - width + 1) for place in places], dtype=np.int64
    )
    assert (
        disk_content.fields(addresses, width).tolist()
        == held.fields(addresses, width).tolist()
    )
    assert (len(disk_content), bytes(disk_content), disk_content[begin:size]) == (
        len(held),
        data,
        held[begin:size],
    )
    assert disk_content.view(0, len(data)).tobytes() == data
    assert disk_content.find(data[-5:], len(data) // 3) == data.find(
        data[-5:], len(data) // 3
    )
    assert disk_content.find(b"not there") == -1
    for begin in (0, size // 3):
        assert (
            disk_content.rfind(data[:1], begin, size)
            == held.rfind(data[:1], begin, size)
            == data.rfind(data[:1], begin, size)
        )
    assert disk_content.rfind(data[:1], 0, 0) == -1
    assert disk_content.sha256() == hashlib.sha256(data).hexdigest()


def test_threads_that_read_one_file_together_get_each_what_it_asks_for(
    tmp_path: Path,
) -> None:
    data = np.random.default_rng(5).bytes(2000)
    disk_content = open_on_disk(put(tmp_path / "bytes", data))
    starts = np.arange(0, 1960, 40)

    def wrong(step: int) -> int:
        """Count, for each thread, the readings that differ from the data."""
        found = [
            disk_content[at : at + 7 * step] == data[at : at + 7 * step]
            for at in range(0, 1900, 9)
        ]
        fields = disk_content.fields(starts, step).tobytes() == b"".join(
            data[at : at + step] for at in starts.tolist()
        )
        return found.count(False) + (not fields)

    switch_interval = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    try:
        with ThreadPoolExecutor(4) as threads:
            assert not any(threads.map(wrong, range(1, 31)))
    finally:
        sys.setswitchinterval(switch_interval)
    disk_content.check()


@pytest.mark.parametrize("kind", CONTENTS)
def test_every_format_is_read_alike_from_a_disk_and_from_memory(
    kind: str, tmp_path: Path
) -> None:
    file = put(tmp_path / "run", CONTENTS[kind])
    held, disk_run = open_file(file), open_run_on_disk(file)
    assert (held.notes, held.parts) == (disk_run.notes, disk_run.parts)
    for database, expected in zip(disk_run.databases, held.databases, strict=True):
        assert database.channels == expected.channels
        for name in expected.channels:
            assert database.channel(name).tolist() == expected.channel(name).tolist()
        ids = [part.id for part in expected.parts]
        for wanted in (ids, ids[::-1]) if ids else ():
            columns = [
                one.part_channel("internal_energy", wanted).tolist()
                for one in (database, expected)
            ]
            assert columns[0] == columns[1]
    assert disk_run.files[0].sha256() == hashlib.sha256(CONTENTS[kind]).hexdigest()


def test_what_is_appended_does_not_count(tmp_path: Path) -> None:
    file = put(tmp_path / "glstat", ONE)
    run = open_run_on_disk(file)
    with file.open("ab") as appending:
        appending.write(OTHER)
    history = run.history(Selection())
    assert history.energy.tolist() == (1000.0 + STATES).tolist()
    assert history.files[0].sha256() == hashlib.sha256(ONE).hexdigest()


def test_a_file_that_is_appended_to_all_the_time_is_read_as_it_was_at_one_moment(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = put(tmp_path / "glstat", ONE)
    fstat = os.fstat

    def growing(number: int) -> os.stat_result:
        with file.open("ab") as more:
            more.write(b"\n")
        return fstat(number)

    monkeypatch.setattr(os, "fstat", growing)
    assert (
        open_run_on_disk(file).history(Selection()).energy.tolist()
        == (1000.0 + STATES).tolist()
    )
    assert (
        open_file(file).history(Selection()).energy.tolist()
        == (1000.0 + STATES).tolist()
    )


def test_a_file_replaced_by_another_is_read_as_it_was(tmp_path: Path) -> None:
    file, newer = tmp_path / "glstat", tmp_path / "newer"
    file.write_bytes(ONE)
    run = open_run_on_disk(file)
    newer.write_bytes(OTHER)
    newer.replace(file)
    history = run.history(Selection())
    assert history.energy.tolist() == (1000.0 + STATES).tolist()
    assert history.files[0].sha256() == hashlib.sha256(ONE).hexdigest()


@pytest.mark.parametrize(
    ("rest", "reason"),
    [
        (b"", "became shorter|written anew"),
        (OTHER, "rewritten"),
        (2 * OTHER, "rewritten"),
    ],
)
def test_a_file_written_anew_is_an_error_and_never_half_of_each(
    tmp_path: Path, rest: bytes, reason: str
) -> None:
    file = put(tmp_path / "glstat", ONE)
    run = open_run_on_disk(file)
    file.write_bytes(rest)
    with pytest.raises(D2RPickError, match=reason):
        run.databases[0].channel("kinetic energy")
    with pytest.raises(D2RPickError, match=reason):
        run.files[0].sha256()


def test_a_write_under_way_is_no_file_written_anew(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The system updates the time of a file before its size."""
    file = put(tmp_path / "glstat", ONE)
    disk_content = open_on_disk(file)
    os.utime(file)
    monkeypatch.setattr(time, "sleep", lambda _: file.write_bytes(ONE + b" "))
    disk_content.check()
    assert bytes(disk_content) == ONE


@pytest.mark.parametrize("contents", [(ONE, OTHER), TABLES], ids=["glstat", "csv"])
@pytest.mark.slow
@pytest.mark.usefixtures(
    "new_files"
)  # if a file looks old, half of a write cannot be detected
@OPENERS
def test_a_file_that_is_written_anew_all_the_time_gives_one_of_its_contents_or_an_error(
    opened: Callable[[Path], OpenedRun],
    contents: Sequence[bytes],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(
        time, "sleep", sleep
    )  # shorter pauses would end before a write that a busy machine delays
    file, done = tmp_path / "run", Event()
    first_content, second_content = contents
    file.write_bytes(first_content)

    def write() -> None:
        for data in cycle((second_content, first_content)):
            with file.open("r+b", buffering=0) as target:
                target.write(data)
            if done.wait(0.0005):
                return

    writer = Thread(target=write)
    writer.start()
    try:
        for _ in range(5):
            try:
                energy = opened(file).history(Selection()).energy
            except D2RPickError as error:
                assert "\n" not in str(error)  # noqa: PT017
            else:
                assert energy.tolist() in [
                    (offset + STATES[: energy.size]).tolist()
                    for offset in (1000.0, 2000.0)
                ]
    finally:
        done.set()
        writer.join()


@OPENERS
@pytest.mark.parametrize("share", [0.001, 0.5, 0.999])
def test_a_file_that_is_half_written_anew_when_it_is_opened_is_not_read_as_it_stands(
    opened: Callable[[Path], OpenedRun],
    share: float,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    file, written = tmp_path / "glstat", int(share * len(ONE))
    file.write_bytes(OTHER[:written] + ONE[written:])

    def write_the_rest(seconds: float) -> None:
        if file.read_bytes() != OTHER:
            with file.open("r+b", buffering=0) as target:
                target.seek(written)
                target.write(OTHER[written:])
        sleep(seconds)

    monkeypatch.setattr(time, "sleep", write_the_rest)
    assert (
        opened(file).history(Selection()).energy.tolist() == (2000.0 + STATES).tolist()
    )


@pytest.mark.parametrize("kind", CONTENTS)
def test_a_file_of_any_format_that_is_written_anew_between_two_readings_gives_what_it_was(
    kind: str, tmp_path: Path
) -> None:
    assert ANEW[kind] != CONTENTS[kind]
    file = put(tmp_path / "run", CONTENTS[kind])
    whole = read_history([str(file)]).energy.tolist()
    run = open_run_on_disk(file)
    database = run.databases[0]
    assert (database.time if database.channels else database.part_time).size
    file.write_bytes(ANEW[kind])
    with suppress(D2RPickError):
        assert run.history(Selection()).energy.tolist() == whole
    with suppress(D2RPickError):
        assert run.files[0].sha256() == hashlib.sha256(CONTENTS[kind]).hexdigest()


@pytest.mark.parametrize("kind", ["binout", "radioss-th", "matsum"])
def test_what_is_not_there_since_a_file_was_written_anew_is_not_passed_over(
    kind: str, tmp_path: Path
) -> None:
    file = put(tmp_path / "run", CONTENTS[kind])
    run = open_run_on_disk(file)
    assert run.databases[0].span
    file.write_bytes(ANEW[kind])
    with pytest.raises(ChangedError, match="rewritten"):
        describe_run(run, Selection())


def fixed_times(
    monkeypatch: pytest.MonkeyPatch, modified: int, changed: int
) -> list[float]:
    """Give files constant times [ns before now]; return the list of pauses that are made."""
    pauses: list[float] = []
    now, fstat = time.time_ns(), os.fstat

    def found(number: int) -> SimpleNamespace:
        really = fstat(number)
        kept = {
            name: getattr(really, name)
            for name in ("st_dev", "st_ino", "st_size", "st_mode")
        }
        return SimpleNamespace(
            **kept, st_mtime_ns=now - modified, st_ctime_ns=now - changed
        )

    monkeypatch.setattr(os, "fstat", found)
    monkeypatch.setattr(time, "sleep", pauses.append)
    monkeypatch.setattr(time, "time_ns", lambda: now)
    return pauses


@pytest.mark.parametrize(
    ("modified", "changed"),
    [(HOUR, HOUR), (-HOUR, HOUR)],
    ids=["old", "time set ahead"],
)
@OPENERS
def test_a_file_that_did_not_change_lately_is_read_without_a_pause(
    opened: Callable[[Path], OpenedRun],
    modified: int,
    changed: int,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    file = put(tmp_path / "run", ONE)
    pauses = fixed_times(monkeypatch, modified, changed)
    history = opened(file).history(Selection())
    assert history.files[0].sha256() == hashlib.sha256(ONE).hexdigest()
    assert not pauses


def test_a_small_file_that_changes_later_is_signed_as_it_was_read(
    tmp_path: Path,
) -> None:
    file = put(tmp_path / "glstat", ONE)
    history = read_history([str(file)])
    file.write_bytes(OTHER)
    assert history.files[0].sha256() == hashlib.sha256(ONE).hexdigest()


def test_a_named_pipe_is_read_once_and_signed(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    writer = Thread(target=lambda: pipe.write_bytes(ONE))
    writer.start()
    history = read_history([str(pipe)])
    writer.join()
    assert history.energy.tolist() == (1000.0 + STATES).tolist()
    assert history.files[0].sha256() == hashlib.sha256(ONE).hexdigest()
