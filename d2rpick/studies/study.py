"""The same question for many runs: tr of each, how far they agree, and one tr for all of them."""

from __future__ import annotations

import os
from collections import Counter
from dataclasses import dataclass, replace
from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from d2rpick.choice.acceptable_windows import acceptable_windows, common_windows, coverage
from d2rpick.choice.of_run import read, suggest_of
from d2rpick.choice.warnings import Caution
from d2rpick.errors import D2RPickError, RangeError
from d2rpick.histories.names import listing
from d2rpick.histories.outline import outline
from d2rpick.histories.selection import Selection
from d2rpick.histories.source import expand
from d2rpick.version import __version__

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from d2rpick.choice.settings import Settings
    from d2rpick.histories.history import Samples

# A run has one of these; the first two were judged.
OK, NONE, UNREADABLE, OUT_OF_RANGE, FAILED = "ok", "none", "unreadable", "out-of-range", "failed"
# Cautions about single runs that a row says otherwise, or that are about what a study does not answer.
_NOT_REPEATED = ("no-candidate",)
# Runs that a sentence names.
_NAMED = 3
# A common tr saves at least this part of the rigid time of the earliest one.
_SAVED = 0.5
# Stretches of a curve that is drawn, each with its lowest and highest energy: twice as many as an eye tells apart.
_STRETCHES = 200


_DEFAULT = Selection()


@dataclass(frozen=True)
class Question:
    """What is asked of every run: ``curve`` whether its energy will be drawn."""

    td: float
    settings: Settings
    selection: Selection = _DEFAULT
    input_format: str = "auto"
    curve: bool = False
    tool_version: str = __version__


class Stamp(NamedTuple):
    """A file as it was when its run was read: size in bytes, modification time in nanoseconds."""

    name: str
    size: int
    mtime_ns: int


@dataclass(frozen=True, eq=False)
class Row:
    """Answer for one run; times in the unit of its history, None for what is not known.

    ``status``: "ok"; "none", nothing can be recommended; "unreadable"; "out-of-range", the record does not reach td or
    is too short to choose; "failed", its process died.  ``message`` says why it is not "ok"; ``warnings`` are codes.
    ``acceptable`` are windows of acceptable tr, shape (n, 2), at the tolerance and at finer levels; ``files`` what was
    read; ``curve`` is an outline of the energy, shape (2, m), where one was asked for.
    """

    source: str
    status: str
    message: str | None = None
    tr: float | None = None
    tr_low: float | None = None
    tr_high: float | None = None
    energy_td: float | None = None
    residual: float | None = None
    basis: str | None = None
    time_unit: str = ""
    warnings: tuple[str, ...] = ()
    acceptable: tuple[Samples, ...] = ()
    files: tuple[Stamp, ...] = ()
    curve: Samples | None = None

    @property
    def judged(self) -> bool:
        """Whether the run could be read and judged."""
        return self.status in (OK, NONE)


class Spread(NamedTuple):
    """Smallest, middle and largest tr of the runs that have one [time]."""

    min: float
    median: float
    max: float


class Common(NamedTuple):
    """One tr for all judged runs and the window around it that they share [time]; None with the reason."""

    tr: float | None
    window: tuple[float, float] | None
    reason: str | None


@dataclass(frozen=True)
class Study:
    """Answer of ``study``; ``agree`` whether the intervals of tr intersect, None without a tr."""

    td: float
    rows: tuple[Row, ...]
    spread: Spread | None
    agree: bool | None
    common: Common
    cautions: tuple[Caution, ...]

    @property
    def judged(self) -> int:
        """How many runs could be read and judged."""
        return sum(row.judged for row in self.rows)

    @property
    def objection(self) -> bool:
        """Whether a run has no tr, or all have none in common."""
        return self.common.tr is None or any(row.status != OK for row in self.rows)


def find_runs(names: Iterable[str]) -> tuple[str, ...]:
    """Replace patterns by the files and folders they match, each a run; what matches nothing stays."""
    from glob import glob

    found: list[str] = []
    for name in names:
        pattern = any(sign in name for sign in "*?[") and not Path(name).exists()
        found += (pattern and _once(glob(name, recursive=True))) or [name]  # noqa: PTH207  Path drops "./"
    return tuple(found)


def _once(names: Iterable[str]) -> list[str]:
    """Give each file or folder by its shortest name only: links that lead in a circle give it many."""
    shortest_first = sorted(names, key=lambda name: (len(name), name), reverse=True)
    return sorted({os.path.realpath(name): name for name in shortest_first}.values())


def ask(question: Question, source: str) -> Row:
    """Read and judge one run; whatever is wrong with it is said in the row.

    Raises
    ------
    D2RPickError
        If another version of this program asks.
    """
    if question.tool_version != __version__:
        raise D2RPickError(
            f"d2rpick {question.tool_version} asks d2rpick {__version__}; install the same version everywhere"
        )
    files = stamps(source)
    try:
        reference = read([source], question.selection, question.input_format)
        answer = suggest_of(reference, question.td, question.settings, with_better=False)
    except (D2RPickError, OSError) as error:
        status = OUT_OF_RANGE if isinstance(error, RangeError) else UNREADABLE
        text = f"{source}: {error.strerror}" if isinstance(error, OSError) and error.strerror else str(error)
        return Row(source, status, text, files=files)
    best = answer.chosen
    said = {caution.code: caution.message for caution in answer.cautions}
    row = Row(
        source=source,
        status=NONE,
        message=said.get("no-candidate"),
        energy_td=answer.situation.energy_td,
        basis=answer.situation.basis,
        warnings=tuple(code for code in said if code not in _NOT_REPEATED),
        time_unit=reference.history.time_unit,
        acceptable=acceptable_windows(answer.situation, answer.candidates, best.tr if best else None),
        files=files,
        curve=outline(reference.history.time, reference.history.energy, _STRETCHES) if question.curve else None,
    )
    if best is None:
        return row
    return replace(row, status=OK, tr=best.tr, tr_low=best.tr_low, tr_high=best.tr_high, residual=best.residual)


def failed(source: str, error: BaseException) -> Row:
    """Row of a run whose process did not come back with one."""
    text = " ".join(str(error).split())
    if not isinstance(error, D2RPickError):
        text = f"internal error, please report it ({type(error).__name__}: {text})"
    return Row(source, FAILED, f"{source}: {text}")


def stamps(source: str) -> tuple[Stamp, ...]:
    """Size and time of the files of a run as they are now, under their absolute names; none where there is no run."""
    try:
        found = [(os.path.realpath(name), Path(name).stat()) for name in expand([source])]
    except (D2RPickError, OSError):  # told by whoever reads it
        return ()
    return tuple(Stamp(path, state.st_size, state.st_mtime_ns) for path, state in found)


def summarise(td: float, rows: Sequence[Row]) -> Study:
    """Hold the rows of a study against each other."""
    times = [row.tr for row in rows if row.tr is not None]
    lows = [row.tr_low for row in rows if row.tr_low is not None]
    highs = [row.tr_high for row in rows if row.tr_high is not None]
    spread = Spread(min(times), median(times), max(times)) if times else None
    agree = max(lows) <= min(highs) if times else None
    return Study(td, tuple(rows), spread, agree, _common(td, rows), tuple(_cautions(rows)))


def _common(td: float, rows: Sequence[Row]) -> Common:
    """Choose one tr for all runs that were judged.

    Of the windows that all share those count that save at least half as much as the first one; of these the one in
    which the worst run is best, by levels of the tolerance; of these the first.  The tr has few digits and lies in the
    middle half of it.
    """
    judged = [row for row in rows if row.judged]
    if not judged:
        return Common(None, None, "no run could be judged")
    shared = common_windows([row.acceptable[0] for row in judged])
    if not shared.size:
        return Common(None, None, _why_none(judged))
    latest = td - _SAVED * (td - shared[0, 0])
    low, high = shared[0]
    for level in range(1, len(judged[0].acceptable)):
        finer = common_windows([row.acceptable[level] for row in judged])
        worth = finer[finer[:, 0] <= latest]
        low, high = worth[0] if worth.size else (low, high)
    tr = fewest_digits((3 * low + high) / 4, (low + 3 * high) / 4)
    (window,) = shared[(shared[:, 0] <= tr) & (tr <= shared[:, 1])].tolist()
    return Common(tr, tuple(window), None)


def fewest_digits(low: float, high: float) -> float:
    """Give a number of the fewest digits between ``low`` and ``high``, the nearest to their middle.

    Examples
    --------
    >>> fewest_digits(0.0128717, 0.0128989)
    0.01289
    """
    middle = (low + high) / 2
    rounded = (float(f"{middle:.{digits}g}") for digits in range(1, 18))
    return float(next((number for number in rounded if low <= number <= high), low))


def _why_none(judged: Sequence[Row]) -> str:
    """Say which tr suits most runs, and which runs it does not suit."""
    stretches, counts = coverage([row.acceptable[0] for row in judged])
    if not counts.size:
        return f"no tr is acceptable in any of {runs_of(len(judged))}"
    tr = fewest_digits(*stretches[np.argmax(counts)])
    left = [row.source for row in judged if not _holds(row.acceptable[0], tr)]
    return (
        f"no tr is acceptable in all of {runs_of(len(judged))}; tr = {tr:.6g} is in {len(judged) - len(left)}, "
        f"not in {listing(left, most=_NAMED)}"
    )


def _holds(windows: Samples, time: float) -> bool:
    return bool(np.any((windows[:, 0] <= time) & (time <= windows[:, 1])))


def _cautions(rows: Sequence[Row]) -> Iterator[Caution]:
    """What to be aware of: runs left out, where the others differ in kind, and what was said of single ones."""
    judged = [row for row in rows if row.judged]
    left = [row.source for row in rows if not row.judged]
    if left and judged:
        found = f"{len(left)} of {runs_of(len(rows))} could not be judged"
        yield Caution("runs-left-out", f"{found} and are left out: {listing(left, most=_NAMED)}")
    for code, what, kinds in (
        (
            "mixed-units",
            "the times of the runs have different units, td has only one",
            [row.time_unit for row in judged],
        ),
        ("mixed-bases", "the basis of the choice differs between the runs", [row.basis for row in judged]),
    ):
        counted = Counter(kind or "not named" for kind in kinds)
        if len(counted) > 1:
            yield Caution(code, f"{what}: {', '.join(f'{kind} in {runs_of(n)}' for kind, n in counted.most_common())}")
    for code in dict.fromkeys(code for row in judged for code in row.warnings):
        named = [row.source for row in judged if code in row.warnings]
        yield Caution(code, f"in {len(named)} of {runs_of(len(judged))}: {listing(named, most=_NAMED)}")


def runs_of(number: int) -> str:
    """Write a number of runs."""
    return "1 run" if number == 1 else f"{number} runs"
