"""When a file is at rest: so long after its last change that no write is under way and a later one would show."""

import os
import time
from pathlib import Path
from types import SimpleNamespace

import pytest

from d2rpick.base.files import settled_state

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
        (200 * MOMENT, 100 * MEGABYTE, 0.55, False),  # the write of so much may have begun then
        (200 * MOMENT, 100 * MEGABYTE, 0.05, True),  # but little at a time is appended
        *((WHOLE, 0, 2.05, may_grow) for may_grow in (False, True)),  # times in whole seconds
        (WHOLE + 10**9, 0, 2.05, True),
        (WHOLE + 3 * 10**9, 0, None, True),
    ],
)
def test_a_file_is_waited_for_as_long_as_it_may_change_unseen(
    ago: int, size: int, pause: float | None, may_grow: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pauses: list[float] = []
    times = dict.fromkeys(("st_mtime_ns", "st_ctime_ns"), NOW - ago)
    monkeypatch.setattr(time, "sleep", pauses.append)
    monkeypatch.setattr(time, "time_ns", lambda: NOW)
    (tmp_path / "deck.k").touch()
    with (tmp_path / "deck.k").open("rb", buffering=0) as file, monkeypatch.context() as made_up:
        made_up.setattr(os, "fstat", lambda _: SimpleNamespace(st_dev=1, st_ino=2, st_size=size, **times))
        found = settled_state(file, may_grow=may_grow)
    assert found
    assert found.size == size
    assert pauses == ([] if pause is None else [pytest.approx(pause)])
