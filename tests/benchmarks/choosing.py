"""Cost of choosing times for records like those of engineers: structures with many modes and noise.

All records are synthetic, seeded, and in a temporary folder.  Compared calls take turns.  Times are CPU times of
whole processes, because other work on the machine changes the elapsed time.
"""

from __future__ import annotations

import json
import os
import sys
from functools import cache, partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

import numpy as np

from d2rpick.histories.formats import csv_table
from tests.benchmarks.study import LOOP, write_runs
from tests.benchmarks.timing import (
    measure_processor_seconds,
    measure_ratio,
    measure_seconds,
    read_output,
)
from tests.records import MODE
from tests.text_files import make_matsum_text

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from d2rpick.histories.history import Samples

_ROUNDS = 3
_PART_STATES = 2000
_RUNS, _RUN_STATES, _RUN_TD = 1000, 10_000, 0.0687534
# Cycles in the record, energy fractions and phases of the five modes.
_MODES = (
    (15.5, 1.0, 0.0),
    (28.5, 0.7, 1.0),
    (46.5, 0.5, 2.0),
    (69.5, 0.4, 3.0),
    (106.0, 0.3, 4.0),
)
_THREE = ((12.5, 1.0, 0.0), (19.3, 0.6, 1.0), (31.7, 0.4, 2.0))
# Noise, as a fraction of the largest energy; with 1e5 states, it causes some 15,000 candidates.
_NOISE = 0.003
# The given td, and windows for td, in a record of unit length.
_TD, _AFTER, _WINDOWS = 0.9, 0.1, {"narrow": (0.85, 0.9), "wide": (0.3, 0.9)}
_folder = TemporaryDirectory()

PANDAS = "import sys, pandas; pandas.read_csv(sys.argv[1])"
PEAK = (
    "import resource, subprocess, sys; subprocess.run(sys.argv[1:], check=True, stdout=subprocess.DEVNULL);"
    "print(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1024)"
)
FIGURE = (
    "import io, matplotlib; from matplotlib.figure import Figure; figure = Figure(); "
    "figure.subplots().plot(range(1500)); figure.savefig(io.BytesIO(), format='svg')"
)
MATSUM = (
    "import sys; from d2rpick.histories.opening import open_run; run = open_run([sys.argv[1]]); "
    "run.part_energies(run.parts)"
)


def noisy_to_pandas() -> float:
    """Return the cost of `suggest --td` for 1e5 noisy states over that of pandas, which only reads the csv."""
    file = str(_make_noisy_energy(100_000))
    document = json.loads(
        read_output("-m", "d2rpick", "suggest", "--td", str(_TD), "-f", "json", file)
    )
    assert len(document["candidates"]) > 100
    return _compare_processes(_suggest(file), ("-c", PANDAS, file))


def noisy_growth() -> float:
    """Return the cost of `suggest --td` for 1e6 noisy states over that for 1e5."""
    return _compare_processes(
        _suggest(str(_make_noisy_energy(1_000_000))),
        _suggest(str(_make_noisy_energy(100_000))),
        rounds=1,
    )


def drowned_growth() -> float:
    """Return the cost of `suggest --td` for 2e5 states over that for 1e5; the vibration decays into its noise."""

    def build(states: int) -> tuple[str, ...]:
        time = np.linspace(0.0, 1.0, states)
        energy = MODE.energy(0.15 * time)
        energy += 0.1 * energy.max() * np.random.default_rng(3).standard_normal(states)
        file = str(_write_record(f"drowned{states}.csv", time, energy))
        return "-m", "d2rpick", "suggest", "--td", str(_TD), "--exit-zero", file

    return _compare_processes(build(200_000), build(100_000), rounds=1)


def window_to_td(kind: str, width: str, *options: str) -> float:
    """Return the cost of `--td-window` over that of `--td` for 1e5 states; ``kind`` is "noisy" or "clean"."""
    file = str({"noisy": _make_noisy_energy, "clean": _clean}[kind](100_000))
    return _compare_processes(
        _suggest(file, *options, window=_WINDOWS[width]), _suggest(file, *options)
    )


def open_window_to_td() -> float:
    """Return the cost of `--td-window` over that of `--td` if the end of the load must be found."""
    file = str(_make_noisy_energy(100_000))
    suggest = ("-m", "d2rpick", "suggest", "--exit-zero", file)
    return _compare_processes(
        (*suggest, "--td-window", *map(str, _WINDOWS["narrow"])),
        (*suggest, "--td", str(_TD)),
    )


def suggest_to_imports(kind: str, states: int) -> float:
    """Return the cost of `suggest --td`, which searches for modes, over that of importing numpy and click.

    ``kind`` is "noisy" (five modes, whose windows must be found) or a name of `_make_troubled_record`.
    """
    if kind == "noisy":
        file = _make_noisy_energy(states)
    else:
        file = _make_troubled_record(kind, states)
    command = ("suggest", "--td", str(_TD), "--exit-zero", str(file))
    return _compare_processes(
        ("-m", "d2rpick", *command), ("-c", "import numpy, click")
    )


def explore_to_td(file: str, td: str, *options: str) -> float:
    """Return the cost of `explore` of 200 td over that of `suggest --td`; a sample, or "noisy" for 1e5 noisy states."""
    name = (
        str(_make_noisy_energy(100_000)) if file == "noisy" else f"sample_data/{file}"
    )
    arguments = ("--exit-zero", "-q", "-f", "json", *options, name)
    return _compare_processes(
        ("-m", "d2rpick", "explore", *arguments),
        ("-m", "d2rpick", "suggest", "--td", td, *arguments),
        rounds=1,
    )


def clean_growth(command: str) -> float:
    """Return the cost of a command for a clean oscillator of 1e6 states over that for 1e5."""

    def build(file: str) -> tuple[str, ...]:
        if command == "verify":
            return (
                "-m",
                "d2rpick",
                "verify",
                "--tr",
                "0.4",
                "--td",
                str(_TD),
                "--exit-zero",
                file,
            )
        return _suggest(
            file, window=_WINDOWS["wide"] if command == "--td-window" else None
        )

    return _compare_processes(
        build(str(_clean(1_000_000))), build(str(_clean(100_000)))
    )


def plan_to_pandas(trouble: str) -> float:
    """Return the cost of `plan` for 1e5 states of a difficult record over that of pandas, which only reads the csv."""
    file = str(_make_troubled_record(trouble, 100_000))
    return _compare_processes(
        ("-m", "d2rpick", "plan", "--exit-zero", file), ("-c", PANDAS, file), rounds=1
    )


def search_to_td(trouble: str, states: int, *command: str) -> float:
    """Return the cost of a command that searches td over that of `suggest --td`; the end of the load is unknown."""
    arguments = ("--exit-zero", "-q", str(_make_troubled_record(trouble, states)))
    return _compare_processes(
        ("-m", "d2rpick", *command, *arguments),
        ("-m", "d2rpick", "suggest", "--td", str(_TD), *arguments),
        rounds=1,
    )


def wait(trouble: str, states: int, *command: str) -> float:
    """Return the CPU time of a command for a difficult record [s]."""
    return _measure_cost(
        *command, "--exit-zero", "-q", str(_make_troubled_record(trouble, states))
    )


def wait_for_info(trouble: str, states: int) -> float:
    """Return the CPU time of `info` for a difficult record [s]."""
    return _measure_cost("info", "-q", str(_make_troubled_record(trouble, states)))


def wait_for_parts(parts: int) -> float:
    """Return the CPU time of `explore` for this number of parts and 2000 states [s]."""
    names = (
        "--part",
        f"2001-{2000 + parts}",
        "--exit-zero",
        "-q",
        str(_write_matsum(parts)),
    )
    return _measure_cost("explore", *names)


def explore_memory() -> float:
    """Return the peak memory of `explore` for three impacts, 1e5 states [MB]."""
    file = str(_make_troubled_record("several flights", 100_000))
    return float(
        read_output(
            "-c",
            PEAK,
            sys.executable,
            "-m",
            "d2rpick",
            "explore",
            "--exit-zero",
            "-q",
            file,
        )
    )


def study_of_small_runs() -> float:
    """Return the CPU time per run of `study` for 1000 csv of 1501 states in one process [ms]."""
    folder = Path(_folder.name) / "small runs"
    if not folder.exists():
        folder.mkdir()
        write_runs(folder, _RUNS, 1501)
    names = sorted(map(str, folder.iterdir()))
    return _measure_cost(*_study_runs(names, "1")) / _RUNS * 1e3


def parts_to_matsum(parts: int) -> float:
    """Return the cost of `suggest --part` for this number of parts and 2000 states over that of reading the matsum."""
    file = str(_write_matsum(parts))
    choosing = (
        "-m",
        "d2rpick",
        "suggest",
        "--td",
        "0.16",
        "--part",
        f"2001-{2000 + parts}",
        "--exit-zero",
        file,
    )
    return _compare_processes(choosing, ("-c", MATSUM, file))


def study_to_loop() -> float:
    """Return the cost per run of `study` over that of a loop over the library's `suggest`; 1e4 states each."""
    names = _write_runs()
    return _compare_processes(
        ("-m", "d2rpick", *_study_runs(names, "1")), ("-c", LOOP, *names), rounds=1
    )


def study_speed_up() -> float | None:
    """Return the elapsed time of a `study` in one process over that in two; None on one core."""
    return _measure_speed_up(lambda jobs: _study_runs(_write_runs(), jobs), rounds=2)


def scan_speed_up() -> float | None:
    """Return the elapsed time of `rollover --scan` in one process over that in two; None on one core."""
    return _measure_speed_up(
        lambda jobs: (
            "rollover",
            "--scan",
            "--mesh",
            "6",
            "--jobs",
            jobs,
            "-q",
            "--exit-zero",
        ),
        rounds=_ROUNDS,
    )


def report_to_matplotlib() -> float:
    """Return the cost of `suggest --report` for a sample over that of importing matplotlib and drawing one svg."""
    page = str(Path(_folder.name) / "report.html")
    ours = (
        "-m",
        "d2rpick",
        "suggest",
        "--td",
        "0.064",
        "--report",
        page,
        "--overwrite",
        "sample_data/energy.csv",
    )
    return _compare_processes(ours, ("-c", FIGURE), rounds=9)


def _suggest(
    file: str, *options: str, window: tuple[float, float] | None = None
) -> tuple[str, ...]:
    when = ("--td", str(_TD)) if window is None else ("--td-window", *map(str, window))
    return (
        "-m",
        "d2rpick",
        "suggest",
        *when,
        "--after",
        str(_AFTER),
        "--exit-zero",
        *options,
        file,
    )


def _study_runs(names: Sequence[str], jobs: str) -> tuple[str, ...]:
    return (
        "study",
        "-q",
        "--exit-zero",
        "--td",
        str(_RUN_TD),
        "--jobs",
        jobs,
        "-f",
        "json",
        *names,
    )


def _make_noisy_energy(states: int) -> Path:
    """Write the energy of five equally damped modes with white noise."""
    return _make_ringing_energy(f"noisy{states}.csv", states, _MODES, _NOISE)


def _make_troubled_record(name: str, states: int) -> Path:
    """Write a record in which times are hard to choose: many modes, noise, impacts, rising or negative energies."""
    rng = np.random.default_rng(14)
    if name == "random walk":
        steps = rng.standard_normal(states)
        return _write_record(
            f"{name}{states}.csv",
            np.linspace(0.0, 1.0, states),
            100.0 + np.cumsum(steps),
        )
    if name == "a vibration on heat":
        time = np.linspace(0.02, 1.2, states)
        energy = 10 * time + 0.8 * (np.exp(-1.5 * time) * np.cos(60 * time)) ** 2
        return _write_record(f"{name}{states}.csv", time, energy)
    trouble_modes = zip(
        rng.uniform(8, 40, 200),
        rng.uniform(0.3, 1, 200),
        rng.uniform(0, np.pi, 200),
        strict=True,
    )
    rise = {"a rise": 3.0, "a rise and a vibration": 3.0}.get(name, 0.0)
    level = {"noise alone": 4.0, "below zero": -4.0}.get(name, 0.0)
    impacts = {
        "several flights": [(0.05, 6.0), (0.35, 4.0), (0.7, 3.0)],
        "chaotic contact": _draw_chaotic_impacts(40),
    }
    modes = {
        "200 modes": tuple(trouble_modes),
        "chaotic contact": _MODES,
        "a rise": (),
        "noise alone": (),
    }.get(name, _THREE)
    noise = {"noise 1 %": 0.01, "noise 10 %": 0.1, "noise alone": 0.01}.get(name, 0.0)
    return _make_ringing_energy(
        f"{name}{states}.csv",
        states,
        modes,
        noise,
        impacts.get(name, ()),
        (level, rise),
    )


def _draw_chaotic_impacts(count: int) -> list[tuple[float, float]]:
    """Return times and heights of impacts in the first half of a record, generated by the logistic map."""
    heights = [0.3]
    while len(heights) < count:
        heights.append(3.9 * heights[-1] * (1 - heights[-1]))
    return [
        (0.45 * (mode_number + height) / count, 3 * height)
        for mode_number, height in enumerate(heights)
    ]


def _make_ringing_energy(
    name: str,
    states: int,
    modes: Sequence[tuple[float, float, float]],
    noise: float,
    impacts: Sequence[tuple[float, float]] = (),
    line: tuple[float, float] = (0.0, 0.0),
) -> Path:
    """Write the energy of equally damped modes above a line, with white noise (fraction of the maximum) and impacts."""
    time = np.linspace(0.0, 1.0, states)
    swings = (
        share * np.sin(2 * np.pi * cycles * time + phase) ** 2
        for cycles, share, phase in modes
    )
    energy = (
        sum(swings, np.zeros(states)) * np.exp(-0.8 * time) + line[0] + line[1] * time
    )
    energy += sum(
        (
            height * np.exp(-(((time - start) / 0.004) ** 2))
            for start, height in impacts
        ),
        np.zeros(states),
    )
    white = np.random.default_rng(14).standard_normal(states)
    return _write_record(name, time, energy + noise * energy.max() * white)


def _clean(states: int) -> Path:
    """Write the energy of the paper's oscillator."""
    time = np.linspace(0.0, 1.0, states)
    return _write_record(f"clean{states}.csv", time, MODE.energy(0.15 * time))


def _write_record(
    name: str,
    time: Samples,
    *energies: Samples,
    names: Sequence[str] = ("internal_energy",),
) -> Path:
    file = Path(_folder.name) / name
    if not file.exists():
        columns = {
            column: np.round(energy, 9)
            for column, energy in zip(names, energies, strict=True)
        }
        file.write_bytes(csv_table.write({"time": time, **columns}))
    return file


def _write_matsum(parts: int) -> Path:
    """Write parts that vibrate in the modes of a chain, with noise."""
    file = Path(_folder.name) / f"matsum{parts}"
    if not file.exists():
        rng = np.random.default_rng(14)
        time = np.linspace(0.0, 0.2, _PART_STATES)
        cycles = rng.choice([4.0, 7.0, 11.0], size=parts)
        phases, sizes = rng.uniform(0, np.pi, parts), rng.uniform(1, 100, parts)
        swing = np.sin(2 * np.pi * 5 * cycles * time[:, np.newaxis] + phases) ** 2
        energies = sizes * np.exp(-5 * time)[:, np.newaxis] * swing
        energies += 1e-3 * sizes * np.abs(rng.standard_normal(energies.shape))
        file.write_bytes(make_matsum_text(time, range(2001, 2001 + parts), energies))
    return file


@cache
def _write_runs() -> list[str]:
    folder = Path(_folder.name) / "runs"
    folder.mkdir()
    return write_runs(folder, _RUNS, _RUN_STATES, noise=1e-3)


def _measure_cost(*command: str) -> float:
    """Return the smaller of two CPU times of a command [s]."""
    return min(
        measure_processor_seconds(lambda: read_output("-m", "d2rpick", *command))
        for _ in range(2)
    )


def _compare_processes(
    ours: Sequence[str], reference: Sequence[str], rounds: int = _ROUNDS
) -> float:
    """Return the CPU time of one process over that of another; the processes run alternately."""
    return measure_ratio(
        lambda: read_output(*ours),
        lambda: read_output(*reference),
        rounds,
        cost=measure_processor_seconds,
    )


def _measure_speed_up(
    command: Callable[[str], Sequence[str]], rounds: int
) -> float | None:
    """Return the shortest elapsed time with one process over that with two; None on one core."""
    if len(os.sched_getaffinity(0)) < 2:
        return None
    times: dict[str, list[float]] = {"1": [], "2": []}
    for _ in range(rounds):
        for jobs, wall_seconds in times.items():
            wall_seconds.append(
                measure_seconds(partial(read_output, "-m", "d2rpick", *command(jobs)))
            )
    return min(times["1"]) / min(times["2"])
