"""Settings for all tests of a process, which are made before any test module is imported."""

import gc
import os
import signal
import sys
import time
from collections.abc import Iterator
from pathlib import Path

# One thread, as on the command line: the systems are small, and threads of several workers would compete for cores.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
# Tests start the program many times and must not compile it each time.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
# A job in the background ignores interrupts, and so would every program that a test starts and interrupts.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)
# Importing the hypothesis plugins of other libraries takes 0.1 s in each process.
os.environ.setdefault("HYPOTHESIS_NO_PLUGINS", "1")

import pytest
from hypothesis import settings

from d2rpick.base.workers import count_cores

# A busy machine is not an error, so there is no deadline.
# A commit must pass or fail in the same way each time, so the examples of a test are the same in each run.
settings.register_profile(
    "d2rpick", deadline=None, max_examples=20, derandomize=True, database=None
)
# New examples: pytest --hypothesis-profile=search
settings.register_profile("search", deadline=None, max_examples=100)
settings.load_profile("d2rpick")

# Nor must workers compile the tests again.
sys.dont_write_bytecode = False


_now = time.time_ns


@pytest.fixture(scope="session", autouse=True)
def _old_files() -> Iterator[None]:
    """Make all files look old, so that d2rpick does not wait for a writer of files that a test has just written."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(time, "time_ns", lambda: _now() + 3_600_000_000_000)
        yield


@pytest.fixture
def new_files(monkeypatch: pytest.MonkeyPatch) -> None:
    """Show files with their true age, but do not pause, because nothing else writes the files of these tests."""
    monkeypatch.setattr(time, "time_ns", _now)
    monkeypatch.setattr(time, "sleep", lambda _: None)


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Change to an empty folder and return its path."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def by_level(monkeypatch: pytest.MonkeyPatch) -> None:
    """Judge by the energy level alone on the command line, because fitting a vibration takes most of the time.

    What the level alone shows is poor, and is not to be a problem."""
    for command in ("SUGGEST", "VERIFY", "PLAN", "EXPLORE", "PARTS"):
        monkeypatch.setenv(f"D2RPICK_{command}_NO_VERIFY", "1")
        monkeypatch.setenv(f"D2RPICK_{command}_MIN_QUALITY", "poor")


pytest_plugins = ["tests.alone"]

# The default frequency of garbage collection takes 10 % of the time of all tests.
gc.set_threshold(20_000, 20, 50)


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_auto_num_workers() -> int:
    """Use one worker per core; a worker that waits for a child process leaves its core to the child."""
    return count_cores()


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Run the slow folder first; otherwise, one worker would wait for the other at the end."""
    items.sort(key=lambda item: not item.nodeid.startswith("tests/vibration/"))


def pytest_collection_finish() -> None:
    """Exclude the modules and the collected tests from garbage collection, because they are needed to the end."""
    gc.freeze()
