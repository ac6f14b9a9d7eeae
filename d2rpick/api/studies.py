"""The same question for many runs."""

from __future__ import annotations

import os
from functools import partial
from itertools import chain
from os.path import abspath
from pathlib import Path
from typing import TYPE_CHECKING, Unpack

from d2rpick.api import arguments
from d2rpick.api.answer import Paged, frame_of
from d2rpick.api.asked import request_of
from d2rpick.api.request import Request, needed_time, time_or_window
from d2rpick.base.records import dataclass, replace
from d2rpick.base.workers import Farm, on_cores
from d2rpick.choice import study as core
from d2rpick.choice.study import Question, StudyRow
from d2rpick.report.study import RUN
from d2rpick.report.tables import positional

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence

    import pandas as pd

    from d2rpick.api.arguments import Choosing, Parts
    from d2rpick.api.ledger import Ledger


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Study(Paged, core.Study):
    """Answer of `study`; nothing of it changes.

    ``runs`` has a row per run; ``agree`` is whether the intervals of tr intersect, None without a tr; ``common`` is one
    tr for all judged runs, with the window they share and the ``errors`` of the runs at it, or None with the reason.
    Times are in the unit of the runs; ``td`` is None where each run has its own.
    """

    command: tuple[str, ...]
    kind = "study"

    def to_frame(self) -> pd.DataFrame:
        """Give a row per run, a column per key of ``runs`` in the JSON; what is not known is NaN.

        Examples
        --------
        >>> import d2rpick as d2
        >>> d2.study(["sample_data/energy.csv"], td=0.0687534).to_frame()["status"].tolist()
        ['ok']
        """
        return frame_of(self.to_dict()["runs"], RUN.keys, td=self.td)


def study(
    runs: Iterable[arguments.Path],
    td: float | None = None,
    *,
    td_window: tuple[float, float] | None = None,
    parts: Parts | None = None,
    flying: Parts | None = None,
    time: str | int | None = None,
    energy: str | int | Iterable[str | int] | None = None,
    channels: Mapping[str, str | int] | None = None,
    input_format: str = "auto",
    jobs: int = 1,
    **choosing: Unpack[Choosing],
) -> Study:
    """Ask the same question of many runs, as ``d2rpick study`` does.

    Parameters
    ----------
    runs : several paths
        Each a file, or a folder with the files of one run; patterns are replaced by what they match, each a run.
    td : float
        When the parts are switched back [time].
    td_window : (float, float)
        Instead of ``td``: where each run chooses its own [time].
    parts, flying, **choosing
        As for `suggest`.
    time, energy, channels, input_format
        As for `read`.
    jobs : int
        Processes that work at the same time.  In a script more than 1 need its guard ``if __name__ == "__main__":``.

    Returns
    -------
    Study
        A run that cannot be read has a row that says why.

    Raises
    ------
    TypeError, ValueError
        If an argument is not of its kind.

    Examples
    --------
    >>> import d2rpick as d2
    >>> found = d2.study(["sample_data/energy.csv", "sample_data/energy.glstat"], td=0.0687534)
    >>> found.agree, round(found.common.tr, 4)
    (True, 0.0136)
    """
    from d2rpick.api.runs import known_format, selection_of

    asked = needed_time(time_or_window(arguments.optional("td", td), arguments.window("td_window", td_window)))
    processes = arguments.whole("jobs", jobs, 1)
    names = find_runs(arguments.paths("runs", [runs] if isinstance(runs, str) else runs))
    request = request_of(None, parts, flying, None, None, choosing)
    chosen = selection_of(time, energy, channels)
    request = replace(
        request, time=chosen.time, energy=chosen.energy, channel=tuple("=".join(one) for one in chosen.channels),
        input_format=known_format(input_format),
    )  # fmt: skip
    question = question_of(request, asked, curve=True)
    with on_cores(min(processes, len(names)), "d2rpick.choice.study") as farm:
        return summary(request, question, names, list(rows_of(question, names, farm)))


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


def question_of(request: Request, td: float | tuple[float, float], *, curve: bool) -> Question:
    """Say what every run is asked; with its ``curve`` where the energies of all are drawn."""
    return Question(td, request.settings, request.selection(), request.input_format, curve=curve)


def summary(request: Request, question: Question, names: Sequence[str], rows: Sequence[StudyRow]) -> Study:
    """Hold the rows of all runs against each other."""
    td = question.td
    times = ("--td-window", *map(repr, td)) if isinstance(td, tuple) else ("--td", repr(td))
    # of the run time neither the study nor its command says anything
    options = replace(request, cost_share=None, step_ratio=None).asking()
    return Study.of(core.summarise(td, rows), command=("study", *times, *options, *positional(names)))


def rows_of(
    question: Question,
    sources: Sequence[str],
    farm: Farm,
    ledger: Ledger | None = None,
    *,
    absolute: bool = False,
    told: Callable[[int], None] | None = None,
) -> Iterator[StudyRow]:
    """Rows in the order of the runs, each as soon as those before it are there.

    Parameters
    ----------
    question : Question
    sources : sequence of str
        Files or folders of the runs.
    farm : Farm
        Computes the rows that are not known.
    ledger : Ledger, optional
        Knows rows already, and gets new ones.
    absolute : bool
        The processes of the farm work in other folders.
    told : function, optional
        Is called with the number of rows that are there, first with those that were known.
    """
    known = dict(ledger.known) if ledger else {}
    new = [number for number in range(len(sources)) if number not in known]
    done, following = len(known), 0
    names = [abspath(sources[number]) if absolute else sources[number] for number in new]  # noqa: PTH100
    for answer in chain((None,), farm.answers(partial(core.ask, question), names)):
        if answer:
            number = new[answer.number]
            row = core.failed(sources[number], answer.error) if answer.error else answer.result
            known[number] = replace(row, source=sources[number])
            done += 1
            if ledger:
                ledger.add(known[number])
        if told:
            told(done)
        while following in known:
            yield known.pop(following)
            following += 1
