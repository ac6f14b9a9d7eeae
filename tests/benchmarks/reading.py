"""Time and memory of reading large databases, compared with plain loops and with lasso-python.

The files are made in a temporary folder, read once by both to compare the results, and are in the page cache.
lasso-python must be installed for this interpreter, or for the one named by D2RPICK_LASSO_PYTHON.
"""

from __future__ import annotations

import io
import os
import subprocess
import sys
import tarfile
from functools import cache
from importlib import import_module
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

import numpy as np

from d2rpick.histories.formats import csv_table, hdf5_file
from d2rpick.histories.opening import Selection, open_run
from tests.benchmarks.timing import (
    ROOT,
    make_environment,
    measure_own_seconds,
    measure_processor_seconds,
    measure_ratio,
    measure_seconds,
    read_output,
)
from tests.made_binout import GLSTAT, LsdaWriter, compute_value
from tests.made_d3plot import END, D3plotWriter, make_states as made_states
from tests.text_files import make_glstat_text, make_matsum_text

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from d2rpick.histories.history import History, Samples

LASSO = Path(os.environ.get("D2RPICK_LASSO_PYTHON", sys.executable))
_STATES = 100_000
_FIRST = "507c24f"  # version 0.6.0
_PARTS, _PART_STATES = 500, 2000
_ROWS = 1_000_000
_ROUNDS = 7
_ROOM = 64  # memory that reading may need in addition to twice the answer [MB]
_folder = TemporaryDirectory()

Numbers = tuple[list[float], list[float]]


def glstat_to_loop() -> float:
    """Return the cost of a loop over the lines of glstat (1e5 states) over that of reading time and internal energy."""
    file = _write_glstat()
    _check_agreement(_read(file), _read_glstat_by_loop(file))
    return measure_ratio(
        lambda: _read_glstat_by_loop(file), lambda: _read(file), _ROUNDS
    )


def glstat_to_bare_read() -> float:
    """Return the cost of reading time and internal energy of the same glstat over that of reading its bytes."""
    file = _write_glstat()
    return measure_ratio(lambda: _read(file), lambda: _read_bytes(file), _ROUNDS)


@cache
def _find_first_version() -> Path | None:
    """Return the folder of version 0.6.0 from the git history, compiled; None without the history."""
    packed = subprocess.run(
        ["git", "archive", _FIRST, "d2rpick"],
        cwd=ROOT,
        capture_output=True,
        check=False,
    )
    if packed.returncode:
        return None
    then = Path(_folder.name, "then")
    with tarfile.open(fileobj=io.BytesIO(packed.stdout)) as archive:
        archive.extractall(then, filter="data")
    subprocess.run([sys.executable, "-m", "compileall", "-q", then], check=True)
    return then


def suggest_to_first() -> float | None:
    """Return the CPU time of `suggest` for 1e5 states of one oscillator over that of version 0.6.0."""
    then, time = _find_first_version(), np.linspace(0, 9, _STATES)
    if then is None:
        return None
    file = _write_once(
        "oscillator",
        make_glstat_text(time, (np.exp(-0.1 * time) * np.cos(20 * time)) ** 2),
    )

    def suggesting(root: Path) -> Callable[[], object]:
        command = [sys.executable, "-m", "d2rpick", "suggest", "--td", "8", str(file)]
        clean = {**make_environment(), "PYTHONPATH": str(root)}
        return lambda: subprocess.run(
            command, check=True, capture_output=True, cwd=root, env=clean
        )

    return measure_ratio(
        suggesting(ROOT), suggesting(then), _ROUNDS, cost=measure_processor_seconds
    )


def glstat_to_first() -> float | None:
    """Return the CPU time of reading 1e5 states of glstat over that of version 0.6.0; None without history."""
    then = _find_first_version()
    if then is None:
        return None

    def reading(root: Path, module: str) -> Callable[[], float]:
        code = (
            f"import sys, time; sys.path.insert(0, {str(root)!r}); from {module} import Selection, open_run\n"
            "def read(): open_run([sys.argv[1]]).history(Selection())\n"
            "read(); start = time.process_time(); [read() for _ in range(5)]; print(time.process_time() - start)"
        )
        return lambda: float(read_output("-c", code, str(_write_glstat())))

    cost_now = reading(ROOT, "d2rpick.histories.opening")
    return measure_ratio(
        cost_now, reading(then, "d2rpick.readers"), _ROUNDS, cost=_call_measure
    )


def _call_measure(measure: Callable[[], object]) -> float:
    figure = measure()
    assert isinstance(figure, float)
    return figure


def matsum_to_loop(part: int | None) -> float:
    """Return the cost of a loop over a matsum (500 parts, 2000 states) over that of reading all parts or one."""
    file = _write_matsum()
    start = b" mat.#=" if part is None else b" mat.#=%5d " % part

    def read() -> tuple[Samples, Samples]:
        run = open_run([str(file)])
        chosen = [run_part for run_part in run.parts if part in (None, run_part.id)]
        return run.databases[0].part_time, run.part_energies(chosen)

    _check_agreement(read(), _read_matsum_by_loop(file, start))
    return measure_ratio(lambda: _read_matsum_by_loop(file, start), read, _ROUNDS)


def lasso_to_binout() -> float | None:
    """Return the cost of lasso-python over that of d2rpick for 1e5 states of a binout; None if it is not installed."""
    file = _write_binout()
    code = (
        "import sys, time; from lasso.dyna import Binout; times = []\n"
        "for _ in range(3):\n"
        "    start = time.perf_counter(); run = Binout(sys.argv[1])\n"
        "    numbers = run.read('glstat', 'time'), run.read('glstat', 'internal_energy')\n"
        "    times.append(time.perf_counter() - start)\n"
        "print(sorted(times)[1], *(float(column.sum()) for column in numbers))"
    )
    process = subprocess.run(
        [LASSO, "-c", code, str(file)], capture_output=True, text=True, check=False
    )
    if "ModuleNotFoundError" in process.stderr:
        return None
    taken, *sums = map(float, process.stdout.split())
    history = _read(file)
    np.testing.assert_allclose(
        [history.time.sum(), history.energy.sum()], sums, rtol=1e-4
    )  # lasso adds in singles
    return taken / median(measure_seconds(lambda: _read(file)) for _ in range(_ROUNDS))


def binout_to_dynars() -> float | None:
    """Return the cost of reading 1e5 states of a binout over that of dynars; None if it is not installed."""
    try:
        opened = import_module("dynars").Binout
    except ImportError:
        return None
    file = _write_binout()

    def theirs() -> tuple[Samples, Samples]:
        run = opened(str(file))
        return run.read("glstat", "time"), run.read("glstat", "internal_energy")

    history = _read(file)
    for ours, column in zip((history.time, history.energy), theirs(), strict=True):
        np.testing.assert_array_equal(ours, column)
    return measure_ratio(lambda: _read(file), theirs, _ROUNDS)


def memory_over_limit(kind: str) -> float:
    """Return the peak anonymous memory of a reading process over its limit: twice the answer plus 64 MB."""
    return _measure_memory(
        {"glstat": _write_glstat, "matsum": _write_matsum, "binout": _write_binout}[
            kind
        ](),
        times=2,
    )


def _measure_memory(file: Path, times: int) -> float:
    """Return the peak memory of reading over its limit: ``times`` the energies plus a constant."""
    code = (
        "import sys; from pathlib import Path; from d2rpick.histories.opening import Selection, open_run\n"
        "def anonymous():\n"
        "    status = Path('/proc/self/status').read_text().split('RssAnon:')[1]\n"
        "    return int(status.split()[0]) / 1024\n"
        "import threading, time\n"
        "import d2rpick.histories.formats.binout, d2rpick.histories.formats.glstat, d2rpick.histories.formats.matsum\n"
        "import d2rpick.histories.formats.csv_table\n"
        "before, peak, done = anonymous(), 0.0, False\n"
        "def watch():\n"
        "    global peak\n"
        "    while not done:\n"
        "        peak = max(peak, anonymous()); time.sleep(0.0005)\n"
        "watcher = threading.Thread(target=watch); watcher.start()\n"
        "run = open_run([sys.argv[1]])\n"
        "answer = run.part_energies(run.parts) if run.parts else run.history(Selection()).energy\n"
        "peak = max(peak, anonymous()); done = True; watcher.join()\n"
        "print(peak - before, answer.nbytes / 2**20)"
    )
    process = subprocess.run(
        [sys.executable, "-c", code, str(file)],
        capture_output=True,
        text=True,
        check=True,
    )
    taken, answer = map(float, process.stdout.split())
    return taken / (times * answer + _ROOM)


def d3plot_to_bare_read(files: int, states: int) -> float:
    """Return the cost of reading a d3plot with states of 5 MB over that of seeking and reading the state headers."""
    first, size, head = _write_d3plot(files, states)

    def bare() -> list[bytes]:
        frames = []
        for number in range(1, files + 1):
            with Path(f"{first}{number:02d}").open("rb", buffering=0) as file:
                for state in range(states):
                    file.seek(state * size)
                    frames.append(file.read(head))
        return frames

    times = [float(np.frombuffer(state, "<f4", 1)[0]) for state in bare()]
    np.testing.assert_array_equal(_read(first).time, times)
    return measure_ratio(lambda: _read(first), bare, _ROUNDS)


def csv_to_loadtxt() -> float:
    """Return the cost of reading a csv of 1e6 rows and two columns over that of numpy.loadtxt."""
    file = _write_csv(_ROWS, 2)
    np.testing.assert_array_equal(_read(file).energy, _read_by_loadtxt(file)[:, 1])
    return measure_ratio(lambda: _read(file), lambda: _read_by_loadtxt(file), _ROUNDS)


def csv_to_pandas(columns: int) -> float:
    """Return the CPU time of reading two columns of a csv of 1e6 rows over that of pandas for all columns."""
    import pandas as pd

    file = _write_csv(_ROWS, columns)
    return measure_ratio(
        lambda: _read(file),
        lambda: pd.read_csv(file),
        _ROUNDS,
        cost=measure_own_seconds,
    )


def suggest_memory() -> float:
    """Return the peak memory of `suggest` for that csv, with pandas [MB]."""
    code = (
        "import resource, subprocess, sys; subprocess.run(sys.argv[1:], check=True, stdout=subprocess.DEVNULL);"
        "print(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1024)"
    )
    suggest = (
        "-m",
        "d2rpick",
        "suggest",
        "--td",
        "0.9",
        "--exit-zero",
        "-q",
        str(_write_csv(_ROWS, 2)),
    )
    return float(read_output("-c", code, sys.executable, *suggest))


def hdf5_to_h5py() -> float:
    """Return the cost of reading an hdf5 of 1e6 rows over that of h5py alone, both as processes."""
    file = _write_hdf5()
    ours = "import sys; from d2rpick.choice.question import read_reference; read_reference(sys.argv[1:])"
    alone = "import sys, h5py; file = h5py.File(sys.argv[1]); file['time'][()], file['internal_energy'][()]"
    return measure_ratio(
        lambda: read_output("-c", ours, str(file)),
        lambda: read_output("-c", alone, str(file)),
        _ROUNDS,
    )


def hdf5_to_h5py_here() -> float:
    """Return the same ratio in this process, including the child process that tests whether the file crashes h5py."""
    import h5py

    file = _write_hdf5()

    def alone() -> tuple[Samples, Samples]:
        with h5py.File(file) as opened:
            return opened["time"][()], opened["internal_energy"][()]

    np.testing.assert_array_equal(_read(file).energy, alone()[1])
    return measure_ratio(lambda: _read(file), alone, _ROUNDS)


def extract_to_pandas() -> float:
    """Return the cost of `extract` of 1e6 rows to csv, start-up included, over that of pandas to_csv alone."""
    import pandas as pd

    file, out = _write_csv(_ROWS, 2), str(_name_file("out.csv"))
    frame = pd.read_csv(file)
    return measure_ratio(
        lambda: read_output(
            "-m", "d2rpick", "extract", str(file), "-o", out, "--overwrite"
        ),
        lambda: frame.to_csv(out, index=False),
        _ROUNDS,
    )


def write_to_pandas() -> float:
    """Return the cost of writing 1e6 rows of two columns as csv over that of pandas to_csv."""
    import pandas as pd

    time, energy = _make_rows(_ROWS, 2).T
    columns = {"time": time, "internal_energy": energy}
    frame = pd.DataFrame(columns)
    assert csv_table.write(columns).decode() == frame.to_csv(index=False)
    return measure_ratio(
        lambda: csv_table.write(columns), lambda: frame.to_csv(index=False), _ROUNDS
    )


def csv_memory_over_limit() -> float:
    """Return the peak anonymous memory of reading 1e6 rows over its limit: three times the answer plus 64 MB."""
    return _measure_memory(_write_csv(_ROWS, 2), times=3)


def _read(file: Path) -> History:
    return open_run([str(file)]).history(Selection())


def _make_rows(rows: int, columns: int) -> Samples:
    """Return noisy columns, shape (rows, columns), the first of them a time."""
    values = np.random.default_rng(14).normal(size=(rows, columns))
    values[:, 0] = np.arange(rows) * 1e-6
    return values


def _write_csv(rows: int, columns: int) -> Path:
    file = _name_file(f"{columns}.csv")
    if not file.exists():
        names = ["time", "internal_energy", *(f"column {i}" for i in range(2, columns))]
        file.write_bytes(
            csv_table.write(dict(zip(names, _make_rows(rows, columns).T, strict=True)))
        )
    return file


def _name_file(name: str) -> Path:
    return Path(_folder.name) / name


def _read_by_loadtxt(file: Path) -> Samples:
    return np.loadtxt(file, delimiter=",", skiprows=1)


def _read_glstat_by_loop(file: Path) -> Numbers:
    times, energies = [], []
    with file.open("rb") as lines:
        for line in lines:
            if line.startswith(b" time..."):
                times.append(float(line[32:46]))
            elif line.startswith(b" internal energy..."):
                energies.append(float(line[32:46]))
    return times, energies


def _read_matsum_by_loop(file: Path, start: bytes) -> Numbers:
    times, energies = [], []
    with file.open("rb") as lines:
        for line in lines:
            if line.startswith(start):
                energies.append(float(line[31:44]))
            elif line.startswith(b" time ="):
                times.append(float(line[7:20]))
    return times, energies


def _read_bytes(file: Path) -> None:
    buffer = bytearray(1 << 20)
    with file.open("rb", buffering=0) as content:
        while content.readinto(buffer):
            pass


def _check_agreement(ours: History | tuple[Samples, Samples], loop: Numbers) -> None:
    time, energy = ours if isinstance(ours, tuple) else (ours.time, ours.energy)
    assert time.tolist() == loop[0]
    assert energy.ravel().tolist() == loop[1]


def _write_once(name: str, content: bytes | bytearray) -> Path:
    file = Path(_folder.name, name)
    file.write_bytes(content)
    return file


@cache
def _write_glstat() -> Path:
    energy = np.random.default_rng(1).normal(size=_STATES)
    return _write_once("glstat", make_glstat_text(np.linspace(0, 9, _STATES), energy))


@cache
def _write_matsum() -> Path:
    ids: Sequence[int] = [10 * part + 1 for part in range(_PARTS)]
    energies = np.random.default_rng(2).normal(size=(_PART_STATES, _PARTS))
    return _write_once(
        "matsum", make_matsum_text(np.linspace(0, 1, _PART_STATES), ids, energies)
    )


@cache
def _write_d3plot(files: int, states: int) -> tuple[Path, int, int]:
    """Write a family of sparse files without nodes and elements; return its name, and the sizes of both [bytes]."""
    writer = D3plotWriter(
        ids=range(1, 101),
        titles=(),
        control={"numnp": 0, "nel2": 0, "nelt": 0, "nv2d": 1_250_000},
    )
    first = _write_once(f"of_{files}.d3plot", writer.filled(writer.head()))
    first_states = made_states((0.001 * np.arange(files * states)).tolist(), 100)
    size, head = (
        len(writer.state(first_states[0])),
        len(first_states[0].values()) * writer.width,
    )
    for number in range(files):
        with Path(f"{first}{number + 1:02d}").open("wb") as file:
            for state_number in range(states):
                file.seek(state_number * size)
                file.write(
                    writer.real(first_states[number * states + state_number].values())
                )
            file.seek(states * size)
            file.write(writer.real([END]))
    return first, size, head


@cache
def _write_hdf5() -> Path:
    time, energy = _make_rows(_ROWS, 2).T
    return _write_once(
        "rows.h5", hdf5_file.write({"time": time, "internal_energy": energy})
    )


@cache
def _write_binout() -> Path:
    writer = LsdaWriter()
    for state in range(1, _STATES + 1):
        writer.cd(f"/glstat/d{state:06d}")
        writer.put("cycle", [state], "i4")
        for name in GLSTAT:
            writer.put(name, [compute_value(name, state)], "f4")
        writer.table()
    return _write_once("binout", writer.data)
