"""Plugin for pytest that fails any test that reads files outside the repository.

A test fails if it opens a file outside the repository, lists a folder there, or passes such a name to a child process,
even if it catches the error.  Tests in tests/real have the marker ``real`` and are exempt; they are skipped if their
files are absent.
"""

import os
import sys
import tempfile
from collections.abc import Generator
from functools import cache
from pathlib import Path
from typing import Any

import pytest

from tests.real.files import REAL

ROOT = Path(__file__).resolve().parents[1]
LEFT_OUT = pytest.StashKey[int]()
_EVENTS = {"open", "os.listdir", "os.scandir", "subprocess.Popen"}
# Python's own files and temporary folders may be outside the repository.
_OURS = (tempfile.gettempdir(), sys.prefix, sys.base_prefix, *filter(None, sys.path))


class _Watch:
    """Audit hook that records accesses outside the repository; ``free`` turns it off while pytest itself reads."""

    def __init__(self) -> None:
        self.opened: list[str] = []
        self.free = True

    def __call__(self, event: str, args: tuple[Any, ...]) -> None:
        if event not in _EVENTS or self.free:  # most events are irrelevant
            return
        names = (
            args[:1]
            if event != "subprocess.Popen"
            else [args[1]]
            if isinstance(args[1], str)
            else args[1]
        )
        for name in names:
            if isinstance(name, str | bytes | os.PathLike) and is_beside(
                os.path.abspath(os.fsdecode(name))  # noqa: PTH100
            ):
                self.opened.append(os.fsdecode(name))
                raise AssertionError(
                    f"{self.opened[-1]!r} lies beside the clone; tests/data holds what tests read"
                )


WATCH = _Watch()
sys.addaudithook(WATCH)


@cache
def is_beside(name: str, root: Path = ROOT) -> bool:
    """Return True if this absolute path is outside the repository, not hidden, and not a file that Python needs."""
    path, parent = (
        Path(os.path.normpath(name)),
        root.parent,
    )  # symbolic links are not resolved
    if path.is_relative_to(REAL):
        return True
    if (
        not path.is_relative_to(parent)
        or path.is_relative_to(root)
        or parent in (path, parent.parent)
    ):
        return False
    ours = (
        outside_path
        for outside_path in map(Path, _OURS)
        if outside_path == parent or not parent.is_relative_to(outside_path)
    )
    return path.relative_to(parent).parts[0][0] != "." and not any(
        path.is_relative_to(outside_path) for outside_path in ours
    )


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Generator[None, Any, Any]:
    """Watch the test modules while they are imported."""
    WATCH.free = False
    try:
        return (yield)
    finally:
        WATCH.free = True


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> Generator[None, Any, Any]:
    """Watch each test except those marked ``real``."""
    WATCH.free = item.get_closest_marker("real") is not None
    try:
        return (yield)
    finally:
        WATCH.free = True


@pytest.hookimpl(wrapper=True)
def pytest_runtest_teardown() -> Generator[None, Any, Any]:
    """Fail a test that caught the error of the watch."""
    outcome = yield
    opened, WATCH.opened = WATCH.opened, []
    assert not opened, f"opened beside the clone: {', '.join(opened)}"
    return outcome


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(
    config: pytest.Config, items: list[pytest.Item]
) -> None:
    """Mark the tests in tests/real, and skip them if their files are absent."""
    tests_of_real_files = [
        item for item in items if item.path.is_relative_to(ROOT / "tests" / "real")
    ]
    for item in tests_of_real_files:
        item.add_marker("real")
    if not REAL.is_dir():
        config.stash[LEFT_OUT] = len(tests_of_real_files)
        items[:] = [item for item in items if not item.get_closest_marker("real")]


def pytest_sessionfinish(session: pytest.Session) -> None:
    """Send the number of skipped tests to the process that reports."""
    if hasattr(session.config, "workeroutput"):
        session.config.workeroutput["left_out"] = session.config.stash.get(LEFT_OUT, 0)


@pytest.hookimpl(optionalhook=True)
def pytest_testnodedown(node: Any) -> None:
    """Take the number of skipped tests from a worker; all workers collect all tests, so one number is enough."""
    node.config.stash[LEFT_OUT] = getattr(node, "workeroutput", {}).get("left_out", 0)


def pytest_terminal_summary(
    terminalreporter: pytest.TerminalReporter, config: pytest.Config
) -> None:
    """Report the skipped tests in one line."""
    if left_out := config.stash.get(LEFT_OUT, 0):
        terminalreporter.write_line(
            f"{left_out} tests of files of others left out: no folder {REAL}; D2RPICK_REAL names it"
        )
