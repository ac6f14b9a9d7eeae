"""A file is settled once its last change is so old that no write is in progress and a later write would show."""

import os
import stat
import time
from pathlib import Path
from types import SimpleNamespace

import pytest

from d2rpick.base.files import wait_for_settled_state, write_as_a_whole

NOW = 1_700_000_000_123_456_789
MOMENT, HOUR = 10**6, 3600 * 10**9
WHOLE = 123_456_789  # since the last whole second
MEGABYTE = 10**6


@pytest.mark.parametrize(
    ("ago", "size", "pause", "may_grow"),
    [
        *((HOUR, 0, None, may_grow) for may_grow in (False, True)),
        *((MOMENT, 0, 0.05, may_grow) for may_grow in (False, True)),
        (-HOUR, 0, 0.05, True),  # the clock of a server is ahead
        (200 * MOMENT, MEGABYTE, None, False),
        (
            200 * MOMENT,
            100 * MEGABYTE,
            0.55,
            False,
        ),  # a write of this size may have begun then
        (
            200 * MOMENT,
            100 * MEGABYTE,
            0.05,
            True,
        ),  # a write appends only little at a time
        *(
            (WHOLE, 0, 2.05, may_grow) for may_grow in (False, True)
        ),  # times in whole seconds
        (WHOLE + 10**9, 0, 2.05, True),
        (WHOLE + 3 * 10**9, 0, None, True),
    ],
)
def test_a_file_is_waited_for_as_long_as_it_may_change_unseen(
    ago: int,
    size: int,
    pause: float | None,
    may_grow: bool,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    pauses: list[float] = []
    times = dict.fromkeys(("st_mtime_ns", "st_ctime_ns"), NOW - ago)
    monkeypatch.setattr(time, "sleep", pauses.append)
    monkeypatch.setattr(time, "time_ns", lambda: NOW)
    (tmp_path / "deck.k").touch()
    with (
        (tmp_path / "deck.k").open("rb", buffering=0) as file,
        monkeypatch.context() as made_up,
    ):
        made_up.setattr(
            os,
            "fstat",
            lambda _: SimpleNamespace(st_dev=1, st_ino=2, st_size=size, **times),
        )
        state = wait_for_settled_state(file, may_grow=may_grow)
    assert state
    assert state.size == size
    assert pauses == ([] if pause is None else [pytest.approx(pause)])


@pytest.mark.parametrize("mode", [0o600, 0o640, 0o644, 0o664, 0o755, 0o444])
def test_a_file_that_is_replaced_keeps_its_mode(tmp_path: Path, mode: int) -> None:
    file = tmp_path / "report.html"
    file.touch()
    file.chmod(mode)
    write_as_a_whole(file, b"new")
    assert (file.read_bytes(), stat.S_IMODE(file.stat().st_mode)) == (b"new", mode)


def test_a_file_behind_a_link_keeps_its_mode(tmp_path: Path) -> None:
    file, link = tmp_path / "a", tmp_path / "b"
    file.touch(mode=0o600)
    link.symlink_to(file)
    write_as_a_whole(link, b"new")
    assert link.is_symlink()
    assert stat.S_IMODE(file.stat().st_mode) == 0o600


@pytest.mark.skipif(
    not hasattr(os, "geteuid") or os.geteuid() != 0, reason="only root gives files away"
)
def test_a_file_that_is_replaced_keeps_its_owner(tmp_path: Path) -> None:
    file = tmp_path / "a"
    file.touch(mode=0o600)
    os.chown(file, 12345, 23456)
    write_as_a_whole(file, b"new")
    status = file.stat()
    assert (status.st_uid, status.st_gid, stat.S_IMODE(status.st_mode)) == (
        12345,
        23456,
        0o600,
    )


def test_a_new_file_has_the_mode_of_any_new_file(tmp_path: Path) -> None:
    write_as_a_whole(tmp_path / "a", b"")
    (tmp_path / "b").touch()
    assert (tmp_path / "a").stat().st_mode == (tmp_path / "b").stat().st_mode


@pytest.mark.parametrize("letter", ["x", "é", "\udcff"])
def test_a_name_may_be_as_long_as_the_file_system_allows(
    tmp_path: Path, letter: str
) -> None:
    longest = os.pathconf(tmp_path, "PC_NAME_MAX")
    file = tmp_path / (letter * (longest // len(os.fsencode(letter))))
    for content in (b"old", b"new"):
        write_as_a_whole(file, content)
    assert [path.read_bytes() for path in tmp_path.iterdir()] == [b"new"]
    with pytest.raises(OSError, match="too long"):
        write_as_a_whole(tmp_path / f"{file.name}{letter}", b"")


def test_what_cannot_be_written_leaves_the_file_and_nothing_beside_it(
    tmp_path: Path,
) -> None:
    file = tmp_path / "a"
    file.write_bytes(b"old")
    with pytest.raises(TypeError):
        write_as_a_whole(file, ["no bytes"])  # type: ignore[arg-type]
    assert [(path.name, path.read_bytes()) for path in tmp_path.iterdir()] == [
        ("a", b"old")
    ]
