"""Show the progress of a command on stderr if it is a terminal."""

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

# Time before the first progress line, and time between progress lines [s].
_PERIOD: Final = 1.0


@contextmanager
def show_reading(
    names: Sequence[str], *, quiet: bool, period: float = _PERIOD
) -> Iterator[None]:
    """Show on the terminal for how long ``names`` have been read so far [s]; do nothing if ``quiet``.

    ``period`` is the time before the first line, and between two lines [s].  The remaining time is unknown: how much of
    a file must be read depends on the question.
    """
    input_name = "standard input" if names[0] == "-" else make_printable(names[0])
    rest_text = f" and {len(names) - 1} more" if len(names) > 1 else ""
    start = perf_counter()
    with show_progress(
        lambda seconds: f"reading {input_name}{rest_text} ... {seconds:.0f} s",
        quiet=quiet,
        period=period,
    ):
        yield
    context = click.get_current_context(silent=True)
    if context and context.meta.get("d2rpick.verbose"):
        click.echo(
            f"read {input_name}{rest_text} in {perf_counter() - start:.2f} s", err=True
        )


@contextmanager
def show_computing(*, quiet: bool, period: float = _PERIOD) -> Iterator[None]:
    """Show on the terminal for how long an answer has been computed so far [s]; do nothing if ``quiet``."""
    with show_progress(
        lambda seconds: f"computing ... {seconds:.0f} s", quiet=quiet, period=period
    ):
        yield


class Count:
    """Number of finished runs out of ``total``, including ``taken`` runs whose results come from an earlier study."""

    def __init__(self, total: int) -> None:
        self.total, self.done, self.taken = total, 0, -1

    def tell(self, done: int) -> None:
        """Set the number of finished runs, which in the first call is the number of results from an earlier study."""
        self.done, self.taken = done, done if self.taken < 0 else self.taken

    def told(self, seconds: float) -> str:
        """Describe the progress after ``seconds``, and the remaining time at the current pace."""
        computed = self.done - max(self.taken, 0)
        if computed:
            remaining = f", {_format_duration(seconds / computed * (self.total - self.done))} left"
        else:
            remaining = ""
        return f"{self.done} of {self.total} runs{remaining}"


@contextmanager
def show_counting(
    total: int, *, quiet: bool, period: float = _PERIOD
) -> Iterator[Count]:
    """Show on a terminal how many runs are finished, as counted by the caller, and how much time remains."""
    count = Count(total)
    with show_progress(count.told, quiet=quiet, period=period):
        yield count


def _format_duration(seconds: float) -> str:
    """Return a duration as hours, minutes and seconds.

    Examples
    --------
    >>> _format_duration(7), _format_duration(3725)
    ('0:07', '1:02:05')
    """
    minutes, seconds_left = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return (
        f"{hours}:{minutes:02}:{seconds_left:02}"
        if hours
        else f"{minutes}:{seconds_left:02}"
    )


def is_on_terminal() -> bool:
    """Return True if stderr is a terminal."""
    return sys.stderr is not None and sys.stderr.isatty()


@contextmanager
def show_progress(
    say: Callable[[float], str], *, quiet: bool, period: float = _PERIOD
) -> Iterator[None]:
    """While code runs, show the text ``say(elapsed_seconds)`` on the terminal; do nothing if ``quiet``."""
    if quiet or not is_on_terminal():
        yield
        return
    from threading import Event, Thread  # Imported here to keep start-up fast.

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
        # A line that wraps could not be erased completely.
        room = shutil.get_terminal_size().columns - 1
        previous_line = line
        line = say(seconds)[-room:]
        sys.stderr.write(f"\r{line.ljust(len(previous_line))}")
        sys.stderr.flush()
    if line:
        sys.stderr.write(f"\r{' ' * len(line)}\r")
        sys.stderr.flush()
