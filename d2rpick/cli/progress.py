"""How far a command has come, on stderr where that is a terminal."""

from __future__ import annotations

import sys
from contextlib import contextmanager
from time import perf_counter
from typing import TYPE_CHECKING, Final

import click

from d2rpick.base.errors import make_printable

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence
    from threading import Event

_PERIOD: Final = 1.0  # [s] before the first line, and between two


@contextmanager
def reading(
    names: Sequence[str], *, quiet: bool, period: float = _PERIOD
) -> Iterator[None]:
    """Tell on stderr for how many seconds ``names`` have been read, unless ``quiet`` or where no terminal is.

    ``period``: before the first line, and between two [s].  Nobody knows how long it will take: how much of a file has
    to be read depends on what is asked of it.
    """
    what = "standard input" if names[0] == "-" else make_printable(names[0])
    more = f" and {len(names) - 1} more" if len(names) > 1 else ""
    start = perf_counter()
    with telling(
        lambda seconds: f"reading {what}{more} ... {seconds:.0f} s",
        quiet=quiet,
        period=period,
    ):
        yield
    context = click.get_current_context(silent=True)
    if context and context.meta.get("d2rpick.verbose"):
        click.echo(f"read {what}{more} in {perf_counter() - start:.2f} s", err=True)


class Count:
    """How many of ``total`` runs are done; ``taken`` of them cost nothing."""

    def __init__(self, total: int) -> None:
        self.total, self.done, self.taken = total, 0, -1

    def tell(self, done: int) -> None:
        """Be told how many are done, first how many cost nothing."""
        self.done, self.taken = done, done if self.taken < 0 else self.taken

    def told(self, seconds: float) -> str:
        """Say how far it is after so many seconds, and how long the rest will take at this pace."""
        computed = self.done - max(self.taken, 0)
        left = (
            f", {_clock(seconds / computed * (self.total - self.done))} left"
            if computed
            else ""
        )
        return f"{self.done} of {self.total} runs{left}"


@contextmanager
def counting(total: int, *, quiet: bool, period: float = _PERIOD) -> Iterator[Count]:
    """Tell on stderr how many runs are done and how long the rest will take; the caller counts."""
    count = Count(total)
    with telling(count.told, quiet=quiet, period=period):
        yield count


def _clock(seconds: float) -> str:
    """Write a duration as people read it.

    Examples
    --------
    >>> _clock(7), _clock(3725)
    ('0:07', '1:02:05')
    """
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02}:{rest:02}" if hours else f"{minutes}:{rest:02}"


def on_terminal() -> bool:
    """Whether somebody at a terminal reads what is told."""
    return sys.stderr is not None and sys.stderr.isatty()


@contextmanager
def telling(
    say: Callable[[float], str], *, quiet: bool, period: float = _PERIOD
) -> Iterator[None]:
    """Show what ``say`` gives for the seconds that have gone by, unless ``quiet`` or where no terminal is."""
    if quiet or not on_terminal():
        yield
        return
    from threading import Event, Thread  # --help does without

    done = Event()
    thread = Thread(target=_tell, args=(say, done, period), daemon=True)
    thread.start()
    try:
        yield
    finally:
        done.set()
        thread.join()


def _tell(say: Callable[[float], str], done: Event, period: float) -> None:
    import shutil

    line, seconds = "", 0.0
    while not done.wait(period):
        seconds += period
        room = (
            shutil.get_terminal_size().columns - 1
        )  # a line that wraps could not be erased
        before, line = line, say(seconds)[-room:]
        sys.stderr.write(f"\r{line.ljust(len(before))}")
        sys.stderr.flush()
    if line:
        sys.stderr.write(f"\r{' ' * len(line)}\r")
        sys.stderr.flush()
