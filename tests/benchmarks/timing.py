"""How what is compared is timed: in turns, by medians."""

from __future__ import annotations

import os
import subprocess
import sys
from functools import cache
from pathlib import Path
from resource import RUSAGE_CHILDREN, getrusage
from statistics import median
from time import perf_counter, process_time
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable

ROOT = Path(__file__).resolve().parents[2]


def seconds(call: Callable[[], object]) -> float:
    """How long a call takes."""
    start = perf_counter()
    call()
    return perf_counter() - start


def own_seconds(call: Callable[[], object]) -> float:
    """Processor time of this process for a call."""
    start = process_time()
    call()
    return process_time() - start


def processor_seconds(call: Callable[[], object]) -> float:
    """Processor time of the processes that a call starts."""
    before = getrusage(RUSAGE_CHILDREN)
    call()
    after = getrusage(RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def ratio(
    one: Callable[[], object],
    other: Callable[[], object],
    rounds: int,
    repeats: int = 1,
    cost: Callable[[Callable[[], object]], float] = seconds,
) -> float:
    """``cost`` of ``one`` over that of ``other``, taking turns of so many repeats.

    With more than one repeat each turn begins with an unmeasured call, so that the measured ones find their memory.
    """
    costs: tuple[list[float], list[float]] = ([], [])
    for _ in range(rounds):
        for call, found in zip((one, other), costs, strict=True):
            turn = [cost(call) for _ in range(repeats + (repeats > 1))]
            found += turn[1:] or turn
    return median(costs[0]) / median(costs[1])


def output(*command: str) -> bytes:
    """What a process of this Python prints, in the folder of the project."""
    result = subprocess.run(
        [sys.executable, *command],
        check=True,
        capture_output=True,
        cwd=ROOT,
        env=environment(),
    )
    return result.stdout


@cache
def environment() -> dict[str, str]:
    """Environment of the processes, for which the package is compiled: an installed one is, a working copy may not."""
    own = "PYTHONDONTWRITEBYTECODE"
    clean = {
        name: value
        for name, value in os.environ.items()
        if name != own and not name.startswith("D2RPICK_")
    }
    subprocess.run(
        [sys.executable, "-m", "compileall", "-q", "d2rpick"],
        check=True,
        cwd=ROOT,
        env=clean,
    )
    return clean
