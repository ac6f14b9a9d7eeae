"""Measure the ratios that the project promises on this machine: ``python -m tests.benchmarks``.

``python -m tests.benchmarks noise window`` measures only rows whose names contain one of the words.  Compared calls
take turns, and medians are divided; results are checked before they are timed.  Rows without a goal show how much a
condition of the measurement matters.  The exit code is 1 if a goal is missed.
"""

from __future__ import annotations

import os
import subprocess
import sys
from functools import partial
from importlib import import_module
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, NamedTuple

from tests.benchmarks.timing import ROOT, measure_processor_seconds, measure_ratio

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from d2rpick.histories.history import Samples

SUGGEST = ("suggest", "--td", "0.064", "sample_data/energy.csv")
CHECK = ("check", "sample_data/switching.k")
THREADS = "OPENBLAS_NUM_THREADS"
# The command line sets one thread for itself, so the measurements in this process do the same.
ONE_THREAD = {THREADS: "1"}
_PROCESSES = 25
_POINTS = 1_000_000
_ROUNDS = 5

SEARCHES = (
    ("no window", ("suggest",), 3.0),
    ("wide window", ("suggest", "--td-window", "0.3", "0.9"), 3.0),
    ("explore", ("explore", "--steps", "200"), 10.0),
)
# No flight is visible, so each td looks at its own windows, down to short ones.
UNSEEN = (
    *SEARCHES[1:2],
    ("explore", ("explore", "--td", "0.9", "--steps", "200"), 15.0),
)
# Records that are searched for modes: a random walk has none, and noisy modes are found in several windows.
SEARCHED = (
    ("random walk", 10_000, 3.5),
    ("random walk", 100_000, 5.5),
    ("noisy", 10_000, 7.5),
)
STARTS = (
    *(
        (("info", f"sample_data/rollover_box{kind}"), 1.5)
        for kind in (".binout", ".matsum", "T01")
    ),
    (("info", "sample_data/rollover_box.h5"), 1.6),  # h5py alone takes 1.33
    (("plan", "sample_data/energy.csv"), 2.0),
    # The pair for this td is poor, for which explore exits with 1.
    (("explore", "sample_data/energy.csv", "--td", "0.064", "--exit-zero"), 2.5),
)


def process_ratio(
    libraries: str, *args: str, env: Mapping[str, str] | None = None
) -> float:
    """Return the CPU time of a command over that of a process that only imports the required libraries."""
    own_settings = (THREADS, "PYTHONDONTWRITEBYTECODE")
    clean = {
        name: value
        for name, value in os.environ.items()
        if name not in own_settings and not name.startswith("D2RPICK_")
    }

    def process(*command: str) -> Callable[[], object]:
        return lambda: subprocess.run(
            [sys.executable, *command],
            check=True,
            capture_output=True,
            cwd=ROOT,
            env={**clean, **(env or {})},
        )

    ours, lower_bound = (
        process("-m", "d2rpick", *args),
        process("-c", f"import {libraries}"),
    )
    with TemporaryDirectory() as compiled:
        clean["PYTHONPYCACHEPREFIX"] = (
            compiled  # an installed package is compiled; a working copy may not be
        )
        ours(), lower_bound()
        return measure_ratio(
            ours, lower_bound, _PROCESSES, cost=measure_processor_seconds
        )


def integration_ratio(repeats: int) -> float:
    """Return the time of DOP853 (relative tolerance 1e-10) over that of the closed form, for 1e6 states to 0.15 s."""
    import numpy as np
    from scipy.integrate import solve_ivp

    from tests import paper

    step = 0.15 / (_POINTS - 1)
    times = step * np.arange(_POINTS)
    k, m, heavy = (
        paper.OSCILLATOR.stiffness,
        paper.OSCILLATOR.frame_mass,
        paper.OSCILLATOR.mass,
    )
    system = np.zeros((4, 4))
    system[:2, 2:] = np.eye(2)
    system[2:, :2] = [[-k / m, k / m], [k / heavy, -k / heavy]]
    system[2:, 2:] = -paper.OSCILLATOR.alpha * np.eye(2)

    def slope(_: float, state: Samples) -> Samples:
        return np.asarray(system @ state)

    def closed_form() -> tuple[Samples, ...]:
        return paper.OSCILLATOR.free_on_grid(paper.START, step, _POINTS)

    def integrated() -> Samples:
        solution = solve_ivp(
            slope,
            (0.0, times[-1]),
            np.array(paper.START),
            "DOP853",
            t_eval=times,
            rtol=1e-10,
            atol=1e-12,
        )
        return np.asarray(solution.y)

    for ours, theirs in zip(closed_form(), integrated(), strict=True):
        np.testing.assert_allclose(
            ours, theirs, rtol=0, atol=1e-9 * np.max(np.abs(theirs))
        )
    return measure_ratio(integrated, closed_form, _ROUNDS, repeats)


def measured(
    module: str, name: str, *args: int | str | None
) -> Callable[[], float | None]:
    """Return a measure of a benchmark module, which is imported and makes its files on the first call."""

    def measure() -> float | None:
        figure: float | None = getattr(
            import_module(f"tests.benchmarks.{module}"), name
        )(*args)
        return figure

    return measure


reading, choosing, deck, identification, study = (
    partial(measured, module)
    for module in ("reading", "choosing", "deck", "identification", "study")
)


class Row(NamedTuple):
    """Ratio to measure, with an upper or a lower limit; the measure returns None if a library is missing."""

    what: str
    measure: Callable[[], float | None]
    most: float | None = None
    least: float | None = None


# Largest processor times for which a user waits at the screen [s].
WAITS = (
    *(
        Row(f"wait for {what}, three modes, {kind}, 1e5 [s]", measure, most)
        for kind in ("clean", "noise 1 %")
        for what, measure, most in (
            ("info", choosing("wait_for_info", kind, 100_000), 1.0),
            ("suggest", choosing("wait", kind, 100_000, "suggest"), 2.5),
            ("plan", choosing("wait", kind, 100_000, "plan"), 2.5),
            ("explore", choosing("wait", kind, 100_000, "explore"), 4.0),
        )
    ),
    Row(
        "wait for explore of 500 parts x 2000 [s]",
        choosing("wait_for_parts", 500),
        most=4.0,
    ),
    *(
        Row(
            f"wait for explore --td, a vibration on heat, {states:.0e} [s]",
            choosing("wait", "a vibration on heat", states, "explore", "--td", "0.9"),
            most,
        )
        for states, most in ((10_000, 2.0), (100_000, 6.0))
    ),
    Row(
        "wait for info, a vibration on heat, 1e5 [s]",
        choosing("wait_for_info", "a vibration on heat", 100_000),
        1.0,
    ),
    Row(
        "wait for plan, random walk, 1e4 [s]",
        choosing("wait", "random walk", 10_000, "plan"),
        most=2.0,
    ),
    Row(
        "explore of three impacts, 1e5 states: peak memory [MB]",
        choosing("explore_memory"),
        most=150.0,
    ),
    Row(
        "study of 1000 csv of 1501 states, CPU a run [ms]",
        choosing("study_of_small_runs"),
        most=10.0,
    ),
)
ROWS = (
    *WAITS,
    Row(
        "suggest / import numpy, click: processes",
        lambda: process_ratio("numpy, click", *SUGGEST),
    ),
    Row(
        "  both with one thread",
        lambda: process_ratio("numpy, click", *SUGGEST, env=ONE_THREAD),
        most=1.4,
    ),
    *(
        Row(
            f"{' '.join(command)} / import numpy, click: processes, one thread",
            partial(process_ratio, "numpy, click", *command, env=ONE_THREAD),
            most,
        )
        for command, most in STARTS
    ),
    Row(
        "--help / import click: processes",
        lambda: process_ratio("click", "--help"),
        most=1.3,
    ),
    *(
        Row(
            f"suggest --td, {kind}, {states} states / import numpy, click",
            choosing("suggest_to_imports", kind, states),
            most,
        )
        for kind, states, most in SEARCHED
    ),
    Row(
        "suggest, noise, 1e5 states / pandas.read_csv",
        choosing("noisy_to_pandas"),
        most=4.0,
    ),
    Row("suggest, noise, 1e6 / 1e5 states", choosing("noisy_growth"), most=12.0),
    Row(
        "suggest, a vibration that noise drowns, 2e5 / 1e5 states",
        choosing("drowned_growth"),
        most=2.5,
    ),
    Row(
        "narrow window / --td, noise",
        choosing("window_to_td", "noisy", "narrow"),
        most=3.0,
    ),
    Row(
        "wide window / --td, noise", choosing("window_to_td", "noisy", "wide"), most=3.0
    ),
    Row(
        "wide window / --td, energy alone",
        choosing("window_to_td", "noisy", "wide", "--no-verify"),
        most=3.0,
    ),
    Row(
        "narrow window / --td, end of the load unknown",
        choosing("open_window_to_td"),
        most=3.0,
    ),
    Row(
        "narrow window / --td, clean oscillator",
        choosing("window_to_td", "clean", "narrow"),
        most=3.0,
    ),
    Row(
        "wide window / --td, clean oscillator",
        choosing("window_to_td", "clean", "wide"),
        most=3.0,
    ),
    Row(
        "explore / --td, noise, 1e5 states",
        choosing("explore_to_td", "noisy", "0.9", "--after", "0.1"),
        most=10.0,
    ),
    Row(
        "explore / --td, noise, end of the load unknown",
        choosing("explore_to_td", "noisy", "0.9"),
        most=10.0,
    ),
    Row(
        "explore / --td, most noise before the flight",
        choosing("explore_to_td", "noisy", "0.9", "--after", "0.8"),
        most=10.0,
    ),
    Row(
        "explore / --td, one oscillator",
        choosing("explore_to_td", "energy.csv", "0.064"),
        most=10.0,
    ),
    Row(
        "explore / --td, a part",
        choosing("explore_to_td", "rolloverT01.gz", "0.37", "--part", "box"),
        most=10.0,
    ),
    Row(
        "explore / --td, energy alone",
        choosing("explore_to_td", "rollover.csv", "0.37", "--energy", "2"),
        most=10.0,
    ),
    Row(
        "suggest, clean oscillator, 1e6 / 1e5 states",
        choosing("clean_growth", "suggest"),
        most=11.0,
    ),
    Row(
        "verify, clean oscillator, 1e6 / 1e5 states",
        choosing("clean_growth", "verify"),
        most=11.0,
    ),
    Row(
        "wide window, clean oscillator, 1e6 / 1e5 states",
        choosing("clean_growth", "--td-window"),
        most=11.0,
    ),
    *(
        Row(
            f"plan, {trouble}, 1e5 states / pandas.read_csv",
            choosing("plan_to_pandas", trouble),
            most=6.0,
        )
        for trouble in ("noise 1 %", "noise 10 %", "200 modes", "chaotic contact")
    ),
    Row(
        "plan, several flights, 1e5 states / pandas.read_csv",
        choosing("plan_to_pandas", "several flights"),
    ),
    *(
        Row(
            f"{what} / --td, three modes, {kind}, {states:.0e}",
            choosing("search_to_td", kind, states, *command),
            most,
        )
        for kind in ("clean", "noise 1 %")
        for states in (10_000, 100_000)
        for what, command, most in SEARCHES
    ),
    *(
        Row(
            f"{what} / --td, {trouble}, 1e4",
            choosing("search_to_td", trouble, 10_000, *command),
            most,
        )
        for trouble in ("a rise", "a rise and a vibration", "noise alone", "below zero")
        for what, command, most in UNSEEN
    ),
    Row(
        "suggest of 50 parts, 2000 states / reading matsum",
        choosing("parts_to_matsum", 50),
    ),
    Row(
        "suggest of 500 parts, 2000 states / reading matsum",
        choosing("parts_to_matsum", 500),
        most=4.0,
    ),
    Row(
        "study, 1e4 noisy states / suggest, per run",
        choosing("study_to_loop"),
        most=1.15,
    ),
    Row("study: speed-up with 2 processes", choosing("study_speed_up"), least=1.8),
    Row(
        "study on a cluster of 8 workers: overhead [ms a run]",
        study("cluster_overhead", 8),
        most=5.0,
    ),
    Row(
        "rollover --scan: speed-up with 2 processes",
        choosing("scan_speed_up"),
        least=1.6,
    ),
    Row(
        "--report / matplotlib and one Figure to svg",
        choosing("report_to_matplotlib"),
        most=1.5,
    ),
    Row(
        "identification / least_squares from the right answer",
        identification("to_scipy"),
        most=3.0,
    ),
    Row(
        "residual off by, 95 % of 600 records of one mode",
        identification("residual_error", "one", 600),
        most=0.05,
    ),
    Row(
        "  of 200 with 0.3 to 3 % in a second mode",
        identification("residual_error", "small", 200),
        most=0.05,
    ),
    Row(
        "  of 200 with 3 to 30 % in a second mode",
        identification("residual_error", "large", 200),
        most=0.05,
    ),
    Row(
        "DOP853 / closed form, 1e6 points",
        lambda: integration_ratio(repeats=3),
        least=20.0,
    ),
    Row(
        "  alternating call by call, in memory just freed",
        lambda: integration_ratio(repeats=1),
    ),
    Row(
        "cards of a 50 MB deck / loop over its lines",
        deck("to_loop", "cards"),
        most=1 / 3,
    ),
    Row("  with the number of each card's line", deck("to_loop", "lines of cards")),
    Row(
        "parts and elements of a 50 MB deck / loop over its lines",
        deck("to_loop", "inventory"),
        most=15.0,
    ),
    Row("check of a 50 MB deck / dynars.parse_deck", deck("check_to_dynars"), most=1.0),
    Row("  memory for the cards [MB]", deck("memory"), most=32.0),
    Row(
        "check of 1000 small decks / finding their cards, CPU",
        deck("many_to_parse"),
        most=4.0,
    ),
    *(
        Row(
            f"check of 20,000 {trouble} / loop over lines, CPU",
            deck("troubled_to_loop", trouble),
            most,
        )
        for trouble, most in (
            ("parts on one card", 100.0),
            ("rigid bodies", 400.0),
            ("boxes of comments", 25.0),
        )
    ),
    Row(
        "check / import click: processes",
        lambda: process_ratio("click", *CHECK),
        most=1.45,
    ),
    Row("loop over lines / glstat, 1e5 states", reading("glstat_to_loop"), least=8.0),
    Row("glstat, 1e5 states / bare read", reading("glstat_to_bare_read"), most=4.0),
    Row(
        "glstat, 1e5 states / version 0.6.0, CPU", reading("glstat_to_first"), most=1.0
    ),
    Row(
        "suggest of a glstat, 1e5 states / version 0.6.0, CPU",
        reading("suggest_to_first"),
        most=1.1,
    ),
    Row(
        "loop over lines / matsum, 2000 states, 500 parts",
        reading("matsum_to_loop", None),
        least=5.0,
    ),
    Row(
        "loop over lines / matsum, 2000 states, 1 part",
        reading("matsum_to_loop", 2501),
        least=25.0,
    ),
    Row("lasso-python / binout, 1e5 states", reading("lasso_to_binout"), least=12.0),
    Row("binout, 1e5 states / dynars.Binout", reading("binout_to_dynars"), most=1.0),
    Row(
        "memory / (2 answers + 64 MB): glstat",
        reading("memory_over_limit", "glstat"),
        most=1.0,
    ),
    Row(
        "memory / (2 answers + 64 MB): matsum",
        reading("memory_over_limit", "matsum"),
        most=1.0,
    ),
    Row(
        "memory / (2 answers + 64 MB): binout",
        reading("memory_over_limit", "binout"),
        most=1.0,
    ),
    Row(
        "d3plot, 10 GB, 5 files / bare read of the heads of states",
        reading("d3plot_to_bare_read", 5, 400),
        most=3.0,
    ),
    Row(
        "d3plot, 10 GB, 100 files / bare read of the heads of states",
        reading("d3plot_to_bare_read", 100, 20),
        most=3.0,
    ),
    Row(
        "csv, 1e6 rows, 2 columns / numpy.loadtxt", reading("csv_to_loadtxt"), most=1.5
    ),
    Row(
        "memory / (3 answers + 64 MB): csv, 1e6 rows",
        reading("csv_memory_over_limit"),
        most=1.0,
    ),
    Row(
        "csv, 1e6 rows, 2 columns / pandas.read_csv",
        reading("csv_to_pandas", 2),
        most=2.0,
    ),
    Row("suggest of that csv: peak memory [MB]", reading("suggest_memory"), most=150.0),
    Row(
        "csv, 1e6 rows, 20 columns / pandas.read_csv",
        reading("csv_to_pandas", 20),
        most=2.0,
    ),
    Row("hdf5, 1e6 rows / h5py alone: processes", reading("hdf5_to_h5py"), most=2.0),
    Row(
        "hdf5, 1e6 rows / h5py alone, in process",
        reading("hdf5_to_h5py_here"),
        most=5.0,
    ),
    Row("writing csv, 1e6 rows / pandas to_csv", reading("write_to_pandas"), most=1.0),
    Row(
        "extract of 1e6 rows (process) / pandas to_csv alone",
        reading("extract_to_pandas"),
        most=1.0,
    ),
)


def main() -> int:
    """Print all ratios and their goals, or those whose names contain a given word; return 1 if a goal is missed."""
    os.environ.setdefault(THREADS, "1")
    words = sys.argv[1:] or [""]
    print(f"{'ratio':<54}  measured  goal")
    missed = []
    for row in (row for row in ROWS if any(word in row.what for word in words)):
        figure = row.measure()
        if figure is None:
            print(f"{row.what:<54}  not installed")
            continue
        goal = (
            f"<= {row.most:g}" if row.most else f">= {row.least:g}" if row.least else ""
        )
        met = (row.most is None or figure <= row.most) and (
            row.least is None or figure >= row.least
        )
        missed += [row.what.strip()] * (not met)
        print(
            f"{row.what:<54}  {figure:8.2f}  {goal}{'' if met else '  missed'}".rstrip(),
            flush=True,
        )
    print("goals missed: " + ("; ".join(missed) or "none"))
    return int(bool(missed))


if __name__ == "__main__":
    sys.exit(main())
