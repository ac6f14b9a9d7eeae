"""The same question for many runs."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import partial
from typing import TYPE_CHECKING, Unpack

from d2rpick.api import arguments
from d2rpick.api.answers import written
from d2rpick.api.document import Document
from d2rpick.api.frames import frame_of
from d2rpick.report.shell import positional

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping
    from pathlib import Path

    import pandas as pd
    from matplotlib.figure import Figure

    from d2rpick.api.arguments import Choosing, Parts
    from d2rpick.choice.study import Study as Core
    from d2rpick.choice.study_rows import Common, StudyRow
    from d2rpick.choice.warnings import Caution


@dataclass(frozen=True, eq=False)
class Study(Document):
    """Answer of `study`; nothing of it changes.

    ``runs`` has a row per run; ``agree`` is whether the intervals of tr intersect, None without a tr; ``common`` is one
    tr for all judged runs, with the window they share and the ``errors`` of the runs at it, or None with the reason.
    Times are in the unit of the runs; ``td`` is None where each run has its own.
    """

    td: float | None
    runs: tuple[StudyRow, ...] = field(repr=False)
    agree: bool | None
    common: Common
    warnings: tuple[Caution, ...]
    command: tuple[str, ...] = field(repr=False)
    _core: Core = field(repr=False)

    def to_json(self) -> str:
        """Give the JSON document of ``d2rpick study``, schema d2rpick/study/1."""
        from d2rpick.report.study import DOCUMENT

        return DOCUMENT.as_json(self._core, self.command)

    def to_frame(self) -> pd.DataFrame:
        """Give a row per run, a column per key of ``runs`` in the JSON; what is not known is NaN.

        Examples
        --------
        >>> import d2rpick as d2
        >>> d2.study(["sample_data/energy.csv"], td=0.0687534).to_frame()["status"].tolist()
        ['ok']
        """
        from d2rpick.report.study import RUN

        return frame_of(self.to_dict()["runs"], RUN.keys, td=self.td)

    def plot(self) -> Figure:
        """Draw the energies over each other, with every tr, as a matplotlib Figure."""
        from d2rpick.report.figures_study import draw_study

        return draw_study(self._core)

    def report(self, path: arguments.Path) -> Path:
        """Write the study to one HTML page that needs no network; an existing file is replaced."""
        from d2rpick.report.pages import study_page

        return written(path, study_page(self._core, ("d2rpick", *self.command)))


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
    from d2rpick.api.repeat import options_of
    from d2rpick.api.runs import known_format, selection_of
    from d2rpick.choice.study import Question, ask, failed, find_runs, summarise
    from d2rpick.workers import answers, on_cores

    if (td is None) == (td_window is None):
        raise TypeError("td or td_window was expected, and not both")
    processes = arguments.whole("jobs", jobs, 1)
    asked = arguments.number("td", td) if td_window is None else arguments.window("td_window", td_window)
    names = find_runs(arguments.paths("runs", [runs] if isinstance(runs, str) else runs))
    selection = selection_of(time, energy, channels)._replace(
        parts=arguments.part_names("parts", parts), flying=arguments.part_names("flying", flying)
    )
    question = Question(asked, arguments.settings(choosing), selection, known_format(input_format), True)
    rows: dict[int, StudyRow] = {}
    with on_cores(min(processes, len(names)), "d2rpick.choice.study") as farm:
        for answer in answers(farm, partial(ask, question), names):
            row = failed(names[answer.number], answer.error) if answer.error else answer.result
            rows[answer.number] = replace(row, source=names[answer.number])
    core = summarise(question.td, [rows[number] for number in range(len(names))])
    times = ("--td", repr(asked)) if isinstance(asked, float) else ("--td-window", *map(repr, asked))
    choosing.pop("cost_share", None)  # of the run time neither the study nor its command says anything
    choosing.pop("step_ratio", None)
    command = ("study", *times, *options_of(selection, choosing, input_format), *positional(names))
    return Study(core.td, core.rows, core.agree, core.common, core.cautions, command, core)
