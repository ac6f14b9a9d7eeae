"""A sign of life while files are read: on a terminal, from the first second on, gone when it is over."""

from __future__ import annotations

import sys
from contextlib import contextmanager
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from threading import Event

PERIOD: Final = 1.0  # [s] before the first line, and between two


@contextmanager
def reading(names: Sequence[str], *, quiet: bool) -> Iterator[None]:
    """Tell on stderr for how many seconds ``names`` have been read, unless ``quiet`` or where no terminal is.

    Nobody knows how long it will take: how much of a file has to be read depends on what is asked of it.
    """
    if quiet or not sys.stderr.isatty():
        yield
        return
    from threading import Event, Thread  # --help does without

    done = Event()
    thread = Thread(target=_tell, args=(names, done), daemon=True)
    thread.start()
    try:
        yield
    finally:
        done.set()
        thread.join()


def _tell(names: Sequence[str], done: Event) -> None:
    import shutil

    what = "standard input" if names[0] == "-" else names[0]
    more = f" and {len(names) - 1} more" if len(names) > 1 else ""
    line, seconds = "", 0.0
    while not done.wait(PERIOD):
        seconds += PERIOD
        room = shutil.get_terminal_size().columns - 1  # a line that wraps could not be erased
        line = f"reading {what}{more} ... {seconds:.0f} s"[-room:]
        sys.stderr.write(f"\r{line}")
        sys.stderr.flush()
    if line:
        sys.stderr.write(f"\r{' ' * len(line)}\r")
        sys.stderr.flush()
