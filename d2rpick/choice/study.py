"""The same question for many runs: tr of each, how far they agree, and one tr for all of them."""

from __future__ import annotations

import os
from collections import Counter
from dataclasses import dataclass, replace
from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING, NamedTuple

from d2rpick.base.errors import FORESEEN, INTERNAL_ERROR, D2RPickError, RangeError, listing, one_line
from d2rpick.base.version import __version__
from d2rpick.choice.acceptable_windows import acceptable_windows, alike_windows, clear_of_td, error_profile
from d2rpick.choice.of_run import read, suggest_of
from d2rpick.choice.study_rows import (
    FAILED,
    NAMED,
    NONE,
    OK,
    OUT_OF_RANGE,
    UNREADABLE,
    Common,
    Stamp,
    StudyRow,
    common_tr,
    runs_of,
)
from d2rpick.choice.warnings import Caution
from d2rpick.histories.names import Selection
from d2rpick.histories.samples import outline
from d2rpick.histories.source import expand

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from d2rpick.choice.settings import Settings
    from d2rpick.choice.suggest import Suggestion

# Cautions about single runs that a row says otherwise, or that are about what a study does not answer.
_NOT_REPEATED = ("no-candidate",)
# Stretches of a curve that is drawn, each with its lowest and highest energy: twice as many as an eye tells apart.
_STRETCHES = 200


_DEFAULT = Selection()


@dataclass(frozen=True)
class Question:
    """What is asked of every run: ``td``, or the window for it; ``curve`` whether its energy will be drawn."""

    td: float | tuple[float, float]
    settings: Settings
    selection: Selection = _DEFAULT
    input_format: str = "auto"
    curve: bool = False
    tool_version: str = __version__


class Spread(NamedTuple):
    """Smallest, middle and largest tr of the runs that have one [time]."""

    min: float
    median: float
    max: float


@dataclass(frozen=True)
class Study:
    """Answer of ``study``; ``agree`` whether the intervals of tr intersect, None without a tr.

    ``td`` is None where each run has its own, chosen in ``td_window``.
    """

    td: float | None
    td_window: tuple[float, float] | None
    rows: tuple[StudyRow, ...]
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


def ask(question: Question, source: str) -> StudyRow:
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
        return StudyRow(source, status, text, files=files)
    time, energy = reference.history.time, reference.history.energy
    curve = outline(time, energy, _STRETCHES) if question.curve else None
    return replace(row_of(source, answer), files=files, curve=curve)


def row_of(source: str, answer: Suggestion) -> StudyRow:
    """Keep of the answer for one run what a study needs."""
    best, situation = answer.chosen, answer.situation
    acceptable = clear_of_td(situation, acceptable_windows(situation, answer.candidates, best.tr if best else None))
    said = {caution.code: caution.message for caution in answer.cautions}
    row = StudyRow(
        source=source,
        status=NONE,
        message=said.get("no-candidate"),
        energy_td=situation.energy_td,
        basis=situation.basis,
        warnings=tuple(code for code in said if code not in _NOT_REPEATED),
        time_unit=situation.history.time_unit,
        td=situation.td,
        acceptable=acceptable,
        alike=alike_windows(situation, answer.candidates, best, acceptable) if best else acceptable,
        profile=error_profile(situation, answer.candidates, acceptable),
    )
    if best is None:
        return row
    return replace(row, status=OK, tr=best.tr, tr_low=best.tr_low, tr_high=best.tr_high, residual=best.residual)


def failed(source: str, error: BaseException) -> StudyRow:
    """StudyRow of a run whose process did not come back with one."""
    status = FAILED if isinstance(error, FORESEEN) else INTERNAL_ERROR
    return StudyRow(source, status, f"{source}: {one_line(error)}")


def stamps(source: str) -> tuple[Stamp, ...]:
    """Size and time of the files of a run as they are now, under their absolute names; none where there is no run."""
    try:
        found = [(os.path.realpath(name), Path(name).stat()) for name in expand([source])]
    except (D2RPickError, OSError):  # told by whoever reads it
        return ()
    return tuple(Stamp(path, state.st_size, state.st_mtime_ns) for path, state in found)


def summarise(td: float | tuple[float, float], rows: Sequence[StudyRow]) -> Study:
    """Hold the rows of a study against each other; ``td`` as it was asked for."""
    times = [row.tr for row in rows if row.tr is not None]
    lows = [row.tr_low for row in rows if row.tr_low is not None]
    highs = [row.tr_high for row in rows if row.tr_high is not None]
    spread = Spread(min(times), median(times), max(times)) if times else None
    agree = max(lows) <= min(highs) if times else None
    common = common_tr(rows)
    one, window = (None, td) if isinstance(td, tuple) else (td, None)
    return Study(one, window, tuple(rows), spread, agree, common, tuple(_cautions(rows, common)))


def _cautions(rows: Sequence[StudyRow], common: Common) -> Iterator[Caution]:
    """What to be aware of: runs left out, where the others differ in kind, and what was said of single ones."""
    judged = [row for row in rows if row.judged]
    left = [row.source for row in rows if not row.judged]
    if left and judged:
        found = f"{len(left)} of {runs_of(len(rows))} could not be judged"
        yield Caution("runs-left-out", f"{found} and are left out: {listing(left, most=NAMED)}")
    if common.keeps_tolerance is False:
        found = f"tr = {common.tr:g} is acceptable in all runs, but no tr is within the timing tolerance of each"
        yield Caution("timing-tolerance", f"{found}: the error of a run grows by more than 0.05")
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
        yield Caution(code, f"in {len(named)} of {runs_of(len(judged))}: {listing(named, most=NAMED)}")
