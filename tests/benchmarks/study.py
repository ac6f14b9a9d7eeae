"""Cost of a study per run compared with a plain loop over the library call, and its memory.

``python -m tests.benchmarks.study``: 1000 runs of 1e4 states each; every study is a separate process.  Compared calls
take turns, and medians are printed.  The exit code is 1 if a goal is missed: a study in one process may cost 25 % more
than the loop, because it also finds all windows of acceptable tr; each further run needs much less memory than its 160
kB of numbers.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from time import perf_counter

import numpy as np

from d2rpick.base.workers import Cluster
from tests.paper import OMEGA_2
from tests.records import MODE
from tests.test_cluster import cluster

ROOT = Path(__file__).resolve().parents[2]
TD = 0.0687534
RUNS, STATES, FEW, ROUNDS = 1000, 10_000, 100, 3
# Limits of the cost relative to the loop, and of the memory for each further run [kB].
MOST, MOST_GROWN = 1.25, 25.0
LOOP = f"""
import sys
from d2rpick.choice.answers import suggest_in_history
from d2rpick.choice.question import Settings, read_reference
for name in sys.argv[1:]:
    assert suggest_in_history(read_reference([name]).history, {TD}, Settings()).recommended
"""


def write_runs(folder: Path, number: int, states: int, noise: float = 0.0) -> list[str]:
    """Write records of the paper's oscillator with frequencies scattered by 0.1 %; return the file names.

    ``noise`` is the standard deviation of white noise over the highest energy [-].
    """
    rng = np.random.default_rng(7)
    time = np.linspace(0.0, 0.15, states)
    names = []
    for i in range(number):
        mode = type(MODE)(
            OMEGA_2 * (1 + 1e-3 * rng.standard_normal()),
            MODE.alpha,
            MODE.cosine,
            MODE.sine,
            MODE.origin,
        )
        names.append(str(folder / f"run{i:04}.csv"))
        energy = mode.energy(time)
        energy += noise * energy.max() * rng.standard_normal(states)
        table = np.stack([time, energy], axis=1)
        np.savetxt(
            names[-1],
            table,
            delimiter=",",
            header="time,internal_energy",
            comments="",
            fmt="%.7g",
        )
    return names


def cluster_overhead(workers: int) -> float | None:
    """Return the time of an empty run on a Dask cluster of this number of workers on this machine [ms]."""
    if not find_spec("distributed"):
        return None
    from distributed import Client

    names, seconds = tuple(map(str, range(workers))), []
    with (
        TemporaryDirectory() as folder,
        cluster(Path(folder), names) as (address, _),
        Client(address, set_as_default=False) as client,
        Cluster(address) as farm,
    ):
        client.wait_for_workers(workers)
        for _ in range(ROUNDS):
            start = perf_counter()
            assert {answer.result for answer in farm.answers(abs, range(RUNS))} == set(
                range(RUNS)
            )
            seconds.append(perf_counter() - start)
    return 1e3 * median(seconds) / RUNS


def process(*args: str) -> tuple[float, float, bytes]:
    """Run a command; return its time [s], the peak memory of its largest process [MB], and its output."""
    # the peak is that of the largest child process so far, so each command has its own parent process
    code = (
        "import json, subprocess, sys, time; from resource import *; start = time.perf_counter();"
        "out = subprocess.run(sys.argv[1:], stdout=subprocess.PIPE, check=True).stdout;"
        "print(json.dumps([time.perf_counter() - start, getrusage(RUSAGE_CHILDREN).ru_maxrss / 1024]));"
        "sys.stdout.flush(); sys.stdout.buffer.write(out)"
    )
    result = subprocess.run(
        [sys.executable, "-c", code, sys.executable, *args], stdout=subprocess.PIPE, check=True, cwd=ROOT,
        env={**os.environ, "OPENBLAS_NUM_THREADS": "1"},
    ).stdout  # fmt: skip
    head, _, last_line = result.partition(b"\n")
    seconds, memory = json.loads(head)
    return seconds, memory, last_line


def measure_study(names: list[str], *options: str) -> tuple[float, float]:
    """Return time [s] and peak memory [MB] of a study in which every run has a tr and a common tr exists."""
    args = (
        "-m",
        "d2rpick",
        "study",
        "-q",
        "--td",
        str(TD),
        "-f",
        "json",
        *options,
        *names,
    )
    seconds, memory, text = process(*args)
    document = json.loads(text)
    assert [run["status"] for run in document["runs"]] == ["ok"] * len(names)
    assert document["common_tr"] is not None
    return seconds, memory


def main() -> int:
    """Measure and print the results; return 1 if a goal is missed."""
    everything = str(len(os.sched_getaffinity(0)))
    with TemporaryDirectory() as folder:
        names = write_runs(Path(folder), RUNS, STATES)
        jobs = {
            f"study --jobs {number}": ("--jobs", number)
            for number in ("1", "2", everything)
        }
        load = os.getloadavg()[0]
        loops: list[float] = []
        studies: dict[str, list[float]] = {name: [] for name in jobs}
        for _ in range(ROUNDS):
            loops.append(process("-c", LOOP, *names)[0])
            for name, options in jobs.items():
                studies[name].append(measure_study(names, *options)[0])
        loop = median(loops)
        load_after = os.getloadavg()[0]
        print(
            f"{RUNS} runs of {STATES} states, {everything} cores, load {load:.1f} before, {load_after:.1f} after"
        )
        for name, seconds in {
            "plain loop over the library call": loops,
            **studies,
        }.items():
            print(
                f"{name:34} {median(seconds) / RUNS * 1e3:6.2f} ms per run, {median(seconds) / loop:4.2f} of the loop"
            )
        grown = []
        for extra in ((), ("--plot", f"{folder}/runs.png", "--overwrite")):
            few_mb, many_mb = (
                measure_study(chosen_names, "--jobs", "2", *extra)[1]
                for chosen_names in (names[:FEW], names)
            )
            grown.append((many_mb - few_mb) / (RUNS - FEW) * 1e3)
            quantity = f"peak memory of study {' '.join(extra[:1])}".strip()
            print(
                f"{quantity}: {few_mb:.1f} MB with {FEW} runs, {many_mb:.1f} MB with {RUNS}: "
                f"{grown[-1]:.1f} kB per run more"
            )
    return int(
        median(studies["study --jobs 1"]) > MOST * loop or max(grown) > MOST_GROWN
    )


if __name__ == "__main__":
    sys.exit(main())
