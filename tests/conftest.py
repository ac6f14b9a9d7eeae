"""Settings that must hold before any test module is imported, and what all tests of a process share."""

import gc
import os
import sys
import time
from collections.abc import Iterator
from pathlib import Path

# As on the command line: the systems here are small, and threads of several test processes would fight over cores.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
# The program is started again and again: that it is compiled each time is no part of any test.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
# What other libraries plug into hypothesis takes a tenth of a second to import, in each process.
os.environ.setdefault("HYPOTHESIS_NO_PLUGINS", "1")

import pytest
from hypothesis import settings

from d2rpick.base.workers import count_cores

# A busy machine is no finding.  Each run asks other examples: a fifth of the usual hundred are as good as all.
settings.register_profile("d2rpick", deadline=None, max_examples=20)
settings.load_profile("d2rpick")

# Nor is it that each process of the tests compiles them anew.
sys.dont_write_bytecode = False


_now = time.time_ns


@pytest.fixture(scope="session", autouse=True)
def _old_files() -> Iterator[None]:
    """Let all files look old: most tests read what they have just written, and no write of theirs is under way."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(time, "time_ns", lambda: _now() + 3_600_000_000_000)
        yield


@pytest.fixture
def new_files(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let files look as new as they are, but make no pause: what is under way in these tests ends by itself."""
    monkeypatch.setattr(time, "time_ns", _now)
    monkeypatch.setattr(time, "sleep", lambda _: None)


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Work in a folder of its own."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def by_level(monkeypatch: pytest.MonkeyPatch) -> None:
    """Judge by the energy level alone on the command line: looking for a vibration takes most of its time.

    What the level alone shows is poor, and is not to be a problem.
    """
    for command in ("SUGGEST", "VERIFY", "PLAN", "EXPLORE", "PARTS"):
        monkeypatch.setenv(f"D2RPICK_{command}_NO_VERIFY", "1")
        monkeypatch.setenv(f"D2RPICK_{command}_MIN_QUALITY", "poor")


pytest_plugins = ["tests.alone"]

# Looking for garbage as often as Python does by itself takes a tenth of the time of all tests.
gc.set_threshold(20_000, 20, 50)


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_auto_num_workers() -> int:
    """Run a process on each core: each collects all tests, and what waits for a child leaves its core to that."""
    return count_cores()


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Begin with the slow folder that would come last: at the end one process would wait for the other."""
    items.sort(key=lambda item: not item.nodeid.startswith("tests/vibration/"))


def pytest_collection_finish() -> None:
    """Look for no garbage among the modules and the collected tests, which are needed to the end."""
    gc.freeze()
