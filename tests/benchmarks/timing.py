"""Timing of calls that are compared: alternating calls, medians."""

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


def measure_seconds(call: Callable[[], object]) -> float:
    """Return the elapsed time of a call [s]."""
    start = perf_counter()
    call()
    return perf_counter() - start


def measure_own_seconds(call: Callable[[], object]) -> float:
    """Return the CPU time of this process for a call [s]."""
    start = process_time()
    call()
    return process_time() - start


def measure_processor_seconds(call: Callable[[], object]) -> float:
    """Return the CPU time of the child processes of a call [s]."""
    usage_before = getrusage(RUSAGE_CHILDREN)
    call()
    usage_after = getrusage(RUSAGE_CHILDREN)
    return (
        usage_after.ru_utime
        + usage_after.ru_stime
        - usage_before.ru_utime
        - usage_before.ru_stime
    )


def measure_ratio(
    first_call: Callable[[], object],
    second_call: Callable[[], object],
    rounds: int,
    repeats: int = 1,
    cost: Callable[[Callable[[], object]], float] = measure_seconds,
) -> float:
    """Return the ``cost`` of ``first_call`` over that of ``second_call``, from this number of alternating repeats.

    With more than one repeat each turn begins with an unmeasured call, so that the measured ones find their memory.
    """
    costs: tuple[list[float], list[float]] = ([], [])
    for _ in range(rounds):
        for call, costs_of_call in zip((first_call, second_call), costs, strict=True):
            turn = [cost(call) for _ in range(repeats + (repeats > 1))]
            costs_of_call += turn[1:] or turn
    return median(costs[0]) / median(costs[1])


def read_output(*command: str) -> bytes:
    """Return the output of a process of this Python, run in the folder of the project."""
    result = subprocess.run(
        [sys.executable, *command],
        check=True,
        capture_output=True,
        cwd=ROOT,
        env=make_environment(),
    )
    return result.stdout


@cache
def make_environment() -> dict[str, str]:
    """Return an environment for child processes that use compiled files, like an installed package."""
    own_variable = "PYTHONDONTWRITEBYTECODE"
    clean = {
        name: value
        for name, value in os.environ.items()
        if name != own_variable and not name.startswith("D2RPICK_")
    }
    subprocess.run(
        [sys.executable, "-m", "compileall", "-q", "d2rpick"],
        check=True,
        cwd=ROOT,
        env=clean,
    )
    return clean
