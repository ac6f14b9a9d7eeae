"""How good recommended pairs are, compared with their stated residuals and grades: ``tests.benchmarks.promise``.

A structure is loaded and then flies.  Its record is written to a file, and ``suggest`` recommends a pair.  The true
residual R comes from the motion: in closed form for linear structures, otherwise from integrating two runs from td on.
An oracle that knows the motion gives the least R in the same flight.  Goals in each class: no pair graded good has R
above 0.3, no pair with a stated residual below 1 has R above 1, and 95 % of the true R are in the stated band.
"""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import argparse
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final, NamedTuple

import numpy as np
import pandas as pd

import d2rpick
from d2rpick.base.errors import D2RPickError
from tests.benchmarks.promise_linear import LINEAR
from tests.benchmarks.promise_records import INTEGRATED, Make, Record

CLASSES: Final[dict[str, Make]] = INTEGRATED | LINEAR

# A stated residual is right if the true residual is this close to it, or lies in its band.
WITHIN: Final = 0.05
# True residuals of a pair that deserves the grade good, of one that does not, and of a release without vibration.
DESERVES_GOOD, BAD, KEEPS_NOTHING = 0.2, 0.3, 1.0
# A pair with a smaller stated residual promises not to be `BAD`.
PROMISES: Final = 0.25
# Rigid time of the oracle, which chooses td freely, as a fraction of the recommended time, or of the flight.
_SHARE_OF_RIGID, _SHARE_OF_FLIGHT = 0.5, 0.25
# A tr lies in the load if it precedes the flight by more than this fraction of the flight.
_EARLY: Final = 0.01
# Rounding errors of times in the file, and in the search of the oracle.
_ROUNDING: Final = 1e-3

_NUMBERS: Final = (
    "td_asked",
    "oracle",
    "flight_start",
    "flight_end",
    "seconds",
    "tr",
    "td",
    "true",
    "residual",
    "low",
    "high",
)


class Pair(NamedTuple):
    """Recommended pair: true residual, stated residual and band (if any), grade and basis."""

    tr: float
    td: float
    true: float
    residual: float | None
    low: float | None
    high: float | None
    grade: str
    basis: str

    @property
    def kept(self) -> bool | None:
        """True if the true residual agrees with the stated one; None if none was stated."""
        if self.low is None or self.high is None:
            return None
        return self.low - WITHIN <= self.true <= self.high + WITHIN


class Trial(NamedTuple):
    """Result for a record: the pair, None if none was recommended, or the first words of the error.

    ``td_asked``: the time that was asked for, None if it was free; ``oracle``: the least true residual, and the start
    and end of the flight, if known.
    """

    pair: Pair | None
    td_asked: float | None = None
    oracle: float | None = None
    flight_start: float | None = None
    flight_end: float | None = None
    error: str = ""
    seconds: float = 0.0


def tabulate(name: str, trials: Sequence[Trial]) -> pd.DataFrame:
    """Return a row for each trial of a class, with NaN for missing numbers."""
    rows = []
    for number, trial in enumerate(trials):
        pair = trial.pair._asdict() if trial.pair else dict.fromkeys(Pair._fields)
        rows.append({"class": name, "number": number} | trial._asdict() | pair)
    return (
        pd.DataFrame(rows).drop(columns="pair").astype(dict.fromkeys(_NUMBERS, float))
    )


def write_record(record: Record, folder: Path) -> Path:
    """Write the file of a record."""
    path = folder / "record.csv"
    names, values = (
        list(record.columns),
        np.stack(list(record.columns.values()), axis=1),
    )
    np.savetxt(
        path, values, f"%.{record.digits}g", ",", header=",".join(names), comments=""
    )
    return path


def ask_for_pair(record: Record, folder: Path) -> Pair | None:
    """Write the record, ask for a pair, and compare it with the truth; None if none is recommended.

    Raises
    ------
    D2RPickError
        If the record is refused.
    """
    path = write_record(record, folder)
    answer = d2rpick.suggest(
        d2rpick.read(str(path), **record.read), **record.suggest
    ).to_dict()
    best = next(
        (candidate for candidate in answer["candidates"] if candidate["recommended"]),
        None,
    )
    if best is None:
        return None
    tr, td, residual = best["tr"], answer["recommended"]["td"], best["residual"]
    return Pair(
        tr=tr,
        td=td,
        true=record.truth.compute_residual(tr, td),
        residual=residual,
        low=best.get("residual_low", residual),
        high=best["residual_high"],
        grade=answer["quality"],
        basis=answer["basis"],
    )


def try_record(record: Record, folder: Path) -> Trial:
    """Determine the recommended pair of a record, and the pair of the oracle."""
    td_asked = record.suggest.get("td")
    pair, error = None, ""
    start = time.perf_counter()
    try:
        pair = ask_for_pair(record, folder)
    except D2RPickError as refusal:
        error = str(refusal).removeprefix(str(folder))[:80]
    seconds = time.perf_counter() - start
    flight_start, flight_end = record.truth.flight_of_file
    shortest = _SHARE_OF_FLIGHT * (flight_end - flight_start)
    if pair is not None:
        shortest = _SHARE_OF_RIGID * (pair.td - pair.tr)
    oracle = record.truth.find_least_residual(td_asked, shortest)
    return Trial(pair, td_asked, oracle, flight_start, flight_end, error, seconds)


def count_group(rows: pd.DataFrame) -> dict[str, object]:
    """Count the results of some records (rows of `tabulate`), in the columns of the table."""
    pairs = rows[rows["true"].notna()]
    stated, unstated = pairs[pairs["residual"].notna()], pairs[pairs["residual"].isna()]
    said_useful = stated[stated["residual"] < KEEPS_NOTHING]
    said_sure = stated[stated["residual"] < PROMISES]
    possible = rows[rows["oracle"] < DESERVES_GOOD]
    good = pairs[pairs["grade"] == "good"]
    banded = pairs[pairs["high"].notna()]
    above = banded["true"] - banded["high"]
    outside_band = above.combine(banded["low"] - banded["true"], max)
    early = pairs["flight_start"] - pairs["tr"]
    flight_time = pairs["flight_end"] - pairs["flight_start"]
    return {
        "records": len(rows),
        "pairs": len(pairs),
        "tr in load": int((early > _EARLY * flight_time).sum()),
        "R>1": _count(pairs["true"] > KEEPS_NOTHING),
        "R>1, said <1": _count(said_useful["true"] > KEEPS_NOTHING),
        "free R (oracle)": _compare(pairs[pairs["td_asked"].isna()]),
        "given R (oracle)": _compare(pairs[pairs["td_asked"].notna()]),
        "unstated: free": _compare(unstated[unstated["td_asked"].isna()]),
        "given": _compare(unstated[unstated["td_asked"].notna()]),
        "R>0.3, said <0.25": _count(said_sure["true"] > BAD),
        "good of oracle<0.2": _count(possible["grade"] == "good"),
        "good, R>0.3": _count(good["true"] > BAD),
        "in band": _compute_share(outside_band <= _ROUNDING),
        "+-0.05": _compute_share(outside_band <= WITHIN),
        "worst above": f"{above.max():.2f}" if len(above) else "-",
        "by basis": ", ".join(
            f"{basis} {count}" for basis, count in pairs["basis"].value_counts().items()
        ),
    }


def _count(hits: pd.Series[bool]) -> str:
    return f"{int(hits.sum())}/{len(hits)}"


def _compute_share(hits: pd.Series[bool]) -> str:
    return f"{hits.mean():.3f} of {len(hits)}" if len(hits) else "-"


def _compare(pairs: pd.DataFrame) -> str:
    """Return the median of the true residuals (in brackets, that of the oracle), and the number of pairs."""
    if pairs.empty:
        return "-"
    return (
        f"{pairs['true'].median():.2f} ({pairs['oracle'].median():.2f}) n={len(pairs)}"
    )


def print_tables(rows: pd.DataFrame) -> None:
    """Print a line for each class and all, then one for each basis of a recommendation."""
    for key in ("class", "basis"):
        counts = {
            str(name): count_group(group)
            for name, group in rows.groupby(key, sort=False)
        }
        if key == "class":
            counts["all"] = count_group(rows)
        table = pd.DataFrame.from_dict(counts, orient="index").rename_axis(columns=key)
        print(table.to_string(max_colwidth=None), end="\n\n", flush=True)


TryClass = Callable[[str, int, int], list[Trial]]


def try_class(name: str, count: int, seed: int) -> list[Trial]:
    """Try this number of records of a class."""
    with TemporaryDirectory() as folder:
        numbers = range(count)
        return [
            try_record(
                CLASSES[name](np.random.default_rng([seed, number])), Path(folder)
            )
            for number in numbers
        ]


def run_benchmark(
    classes: Mapping[str, Any], try_records: TryClass, description: str
) -> None:
    """Try the classes named on the command line, and print the counts."""
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument(
        "records",
        nargs="?",
        type=int,
        default=100,
        help="number of records in a class [default: 100]",
    )
    parser.add_argument(
        "seed", nargs="?", type=int, default=1, help="seed of the records [default: 1]"
    )
    parser.add_argument(
        "names",
        nargs="*",
        metavar="CLASS",
        help="part of the name of a class [default: all classes]",
    )
    parser.add_argument(
        "--csv", type=Path, metavar="FILE", help="write a row for each record to FILE"
    )
    options = parser.parse_args()
    tables = []
    for name in classes:
        if options.names and not any(part in name for part in options.names):
            continue
        start = time.perf_counter()
        trials = try_records(name, options.records, options.seed)
        taken, asking = (
            time.perf_counter() - start,
            sum(trial.seconds for trial in trials),
        )
        print(
            f"{name}: {taken:.0f} s, of these {asking:.0f} s asking",
            file=sys.stderr,
            flush=True,
        )
        tables.append(tabulate(name, trials).assign(seed=options.seed))
        if options.csv:  # after each class, because all classes take an hour
            pd.concat(tables, ignore_index=True).to_csv(options.csv, index=False)
    if tables:
        print_tables(pd.concat(tables, ignore_index=True))
    else:
        parser.error(f"no class has such a name; there are {', '.join(classes)}")


if __name__ == "__main__":
    run_benchmark(
        CLASSES,
        try_class,
        "What a recommended pair, its stated residual and its grade are worth.",
    )
