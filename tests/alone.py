"""Plugin of pytest: tests read nothing beside the clone, but for those of files of others, which may be left out.

A test that opens a file beside the clone, lists a folder there or names one to a child process fails, whatever becomes
of the error.  The tests in tests/real have the marker ``real`` and are free.
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
# What Python runs from, and temporary folders, may lie beside the clone.
_OURS = (tempfile.gettempdir(), sys.prefix, sys.base_prefix, *filter(None, sys.path))


class _Watch:
    """What was opened beside the clone, and whether that is free: while pytest itself reads and reports, it is."""

    def __init__(self) -> None:
        self.opened: list[str] = []
        self.free = True

    def __call__(self, event: str, args: tuple[Any, ...]) -> None:
        if event not in _EVENTS or self.free:  # most events are none of these
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
    """Whether a file of this full name is one of others, or beside the clone, not hidden and not needed by Python."""
    path, parent = Path(os.path.normpath(name)), root.parent  # links stay
    if path.is_relative_to(REAL):
        return True
    if (
        not path.is_relative_to(parent)
        or path.is_relative_to(root)
        or parent in (path, parent.parent)
    ):
        return False
    ours = (
        one
        for one in map(Path, _OURS)
        if one == parent or not parent.is_relative_to(one)
    )
    return path.relative_to(parent).parts[0][0] != "." and not any(
        path.is_relative_to(one) for one in ours
    )


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Generator[None, Any, Any]:
    """Watch the modules of the tests."""
    WATCH.free = False
    try:
        return (yield)
    finally:
        WATCH.free = True


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> Generator[None, Any, Any]:
    """Watch a test, but for one of files of others."""
    WATCH.free = item.get_closest_marker("real") is not None
    try:
        return (yield)
    finally:
        WATCH.free = True


@pytest.hookimpl(wrapper=True)
def pytest_runtest_teardown() -> Generator[None, Any, Any]:
    """Fail a test that swallowed the error."""
    found = yield
    opened, WATCH.opened = WATCH.opened, []
    assert not opened, f"opened beside the clone: {', '.join(opened)}"
    return found


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(
    config: pytest.Config, items: list[pytest.Item]
) -> None:
    """Mark the tests of files of others, and leave them out where the files are absent."""
    others = [
        item for item in items if item.path.is_relative_to(ROOT / "tests" / "real")
    ]
    for item in others:
        item.add_marker("real")
    if not REAL.is_dir():
        config.stash[LEFT_OUT] = len(others)
        items[:] = [item for item in items if not item.get_closest_marker("real")]


def pytest_sessionfinish(session: pytest.Session) -> None:
    """Tell the process that reports."""
    if hasattr(session.config, "workeroutput"):
        session.config.workeroutput["left_out"] = session.config.stash.get(LEFT_OUT, 0)


@pytest.hookimpl(optionalhook=True)
def pytest_testnodedown(node: Any) -> None:
    """Hear it of a process that tests; each of them collects all tests."""
    node.config.stash[LEFT_OUT] = getattr(node, "workeroutput", {}).get("left_out", 0)


def pytest_terminal_summary(
    terminalreporter: pytest.TerminalReporter, config: pytest.Config
) -> None:
    """Say in one line what was left out."""
    if left_out := config.stash.get(LEFT_OUT, 0):
        terminalreporter.write_line(
            f"{left_out} tests of files of others left out: no folder {REAL}; D2RPICK_REAL names it"
        )
