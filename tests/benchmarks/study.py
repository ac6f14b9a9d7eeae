"""Cost of a study per run, against a plain loop over the library call, and its memory: ``python -m tests.benchmarks.study``.

1000 runs of 1e4 states each; every study is a process of its own.  What is compared takes turns, medians are told.
Exit code 1 when a goal is missed: the study in one process may cost a tenth more than the loop and its start, and 900
runs more may cost 10 kB of memory each.
"""

from __future__ import annotations

import json
import os
import resource
import subprocess
import sys
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from time import perf_counter

import numpy as np

from tests.paper import OMEGA_2
from tests.records import MODE

ROOT = Path(__file__).resolve().parents[2]
TD = 0.0687534
RUNS, STATES, FEW, ROUNDS = 1000, 10_000, 100, 3
LOOP = f"""
import sys
from d2rpick.choice import suggest
from d2rpick.readers import read_history
from d2rpick.situation import Settings
found = [suggest(read_history([name]), {TD}, Settings()).recommended for name in sys.argv[1:]]
assert all(found)
"""


def write_runs(folder: Path, number: int, states: int) -> list[str]:
    """Write records of the paper's oscillator whose rate scatters by a thousandth; names of the files."""
    rng = np.random.default_rng(7)
    time = np.linspace(0.0, 0.15, states)
    names = []
    for i in range(number):
        mode = type(MODE)(OMEGA_2 * (1 + 1e-3 * rng.standard_normal()), MODE.alpha, MODE.cosine, MODE.sine, MODE.origin)
        names.append(str(folder / f"run{i:04}.csv"))
        table = np.stack([time, mode.energy(time)], axis=1)
        np.savetxt(names[-1], table, delimiter=",", header="time,internal_energy", comments="", fmt="%.7g")
    return names


def process(*args: str) -> tuple[float, float, bytes]:
    """Seconds and peak memory of the largest process [MB] of a command, and what it prints."""
    # the peak is that of the largest child so far, so each command has a parent of its own
    code = (
        "import json, resource, subprocess, sys, time; start = time.perf_counter();"
        "out = subprocess.run(sys.argv[1:], stdout=subprocess.PIPE, check=True).stdout;"
        "print(json.dumps([time.perf_counter() - start, resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1024]));"
        "sys.stdout.flush(); sys.stdout.buffer.write(out)"
    )
    result = subprocess.run(
        [sys.executable, "-c", code, sys.executable, *args], stdout=subprocess.PIPE, check=True, cwd=ROOT,
        env={**os.environ, "OPENBLAS_NUM_THREADS": "1"},
    ).stdout  # fmt: skip
    head, _, rest = result.partition(b"\n")
    seconds, memory = json.loads(head)
    return seconds, memory, rest


def study(names: list[str], *options: str) -> tuple[float, float]:
    """Seconds and peak memory of a study in which every run has a tr and all share one."""
    args = ("-m", "d2rpick", "study", "-q", "--td", str(TD), "-f", "json", *options, *names)
    seconds, memory, text = process(*args)
    found = json.loads(text)
    assert [run["status"] for run in found["runs"]] == ["ok"] * len(names)
    assert found["common_tr"] is not None
    return seconds, memory


def main() -> int:
    """Measure and tell; 1 when a goal is missed."""
    everything = str(len(os.sched_getaffinity(0)))
    with TemporaryDirectory() as place:
        names = write_runs(Path(place), RUNS, STATES)
        ways = {
            "plain loop over the library call": lambda: process("-c", LOOP, *names)[:2],
            "study --jobs 1": lambda: study(names, "--jobs", "1"),
            "study --jobs 2": lambda: study(names, "--jobs", "2"),
            f"study --jobs {everything} (all cores)": lambda: study(names, "--jobs", everything),
        }
        measured: dict[str, list[tuple[float, float]]] = {name: [] for name in ways}
        load = os.getloadavg()
        for _ in range(ROUNDS):
            for name, way in ways.items():
                measured[name].append(way())
        seconds = {name: median(one[0] for one in found) for name, found in measured.items()}
        few = {extra: study(names[:FEW], "--jobs", "2", *extra)[1] for extra in ((), ("--plot", f"{place}/few.png"))}
        many = {extra: study(names, "--jobs", "2", *extra)[1] for extra in ((), ("--plot", f"{place}/many.png"))}
    loop, own = list(seconds.values())[:2]
    print(
        f"{RUNS} runs of {STATES} states, {everything} cores, load before {load[0]:.1f}, after {os.getloadavg()[0]:.1f}"
    )
    for name, value in seconds.items():
        print(f"{name:40} {value / RUNS * 1e3:7.2f} ms per run  {value / loop:5.2f} of the loop")
    grown = []
    for what, one, other in zip(("study", "study --plot"), few.values(), many.values(), strict=True):
        grown.append((other - one) / (RUNS - FEW) * 1e3)
        print(
            f"peak memory of {what}: {one:.1f} MB with {FEW} runs, {other:.1f} MB with {RUNS}; {grown[-1]:.1f} kB per run"
        )
    return int(own > 1.1 * loop + 0.1 or max(grown) > 10)


if __name__ == "__main__":
    sys.exit(main())
