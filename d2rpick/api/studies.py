"""Ask the same question about many runs. A file with a line per judged run makes it possible to resume a study."""

from __future__ import annotations

import hashlib
import json
import os
from dataclasses import asdict, replace
from functools import partial
from itertools import chain
from os.path import abspath
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, Unpack

import numpy as np

from d2rpick.api import arguments
from d2rpick.api.answer import Paged, build_frame
from d2rpick.api.asked import make_request
from d2rpick.api.request import OPTIONS, Request, choose_time_or_window
from d2rpick.api.times import TimeArguments, find_common_unit
from d2rpick.base.data_classes import dataclass
from d2rpick.base.errors import INTERNAL_ERROR, ArgumentError, FormatError
from d2rpick.base.files import add_checksum, append_as_a_whole, parse_record
from d2rpick.base.workers import Farm, choose_farm
from d2rpick.choice.runs import study as core
from d2rpick.choice.runs.study import (
    FAILED,
    UNREADABLE,
    Question,
    Stamp,
    StudyRow,
    stamp_files,
)
from d2rpick.histories.names import has_recommended
from d2rpick.report.study import PLAIN, RUN
from d2rpick.report.tables import make_positional

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence

    import pandas as pd

    from d2rpick.api.arguments import Parts, Time
    from d2rpick.api.cards import Cards
    from d2rpick.api.choosing import Choosing
    from d2rpick.report.formats import RepeatedQuestion

_FIRST: Final = b'{"source": '
# First bytes of the summary line, which follows the rows.
_LAST: Final = b'{"schema": '
# Fields of a row that JSON stores as arrays.
_LISTS: Final = ("warnings", "parts", "parts_in_files")


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Study(Paged, core.StudyOfRuns):
    """Immutable answer of `study`.

    ``runs`` has a row per run. ``agree`` is True if the tr intervals of all runs overlap; None if there is no tr.
    ``common`` contains one tr for all judged runs, with the window that they share and the ``errors`` of the runs at
    this tr; if there is no such tr, it contains None and the reason. Times are in the unit of the runs; ``td`` is None
    if each run has its own td.
    """

    command: tuple[str, ...]
    question: RepeatedQuestion
    kind = "study"

    def page(
        self,
        command: Sequence[str],
        judging: Sequence[str] = (),  # noqa: ARG002  other answers use the argument
        cards: Cards | None = None,  # noqa: ARG002  other answers use the argument
    ) -> str:
        """Return the page with the next step; ``command`` is the command line that repeats it."""
        from d2rpick.report.pages import study_page

        return study_page(self, command, self.question)

    def to_frame(self) -> pd.DataFrame:
        """Return a row per run and a column per key of ``runs`` in the JSON output; unknown values are NaN.

        Examples
        --------
        >>> import d2rpick as d2
        >>> d2.study(["sample_data/energy.csv"], td=0.0687534).to_frame()["status"].tolist()
        ['ok']
        """
        return build_frame(self.to_dict()["runs"], RUN.keys, td=self.td)


def study(
    runs: Iterable[arguments.Path],
    td: Time | None = None,
    *,
    td_window: tuple[Time, Time] | None = None,
    parts: Parts | None = None,
    flying: Parts | None = None,
    time: str | int | None = None,
    energy: str | int | Iterable[str | int] | None = None,
    channels: Mapping[str, str | int] | None = None,
    input_format: str | None = "auto",
    jobs: int | None = 1,
    **choosing: Unpack[Choosing],
) -> Study:
    """Ask the same question about many runs, as ``d2rpick study`` does.

    Parameters
    ----------
    runs : several paths
        Each path is a file, or a folder with the files of one run; each match of a pattern is a run.
    td : float or text, optional
        Time at which the parts become deformable again [time]; it may be a string such as ``"64ms"`` if all runs name
        the same unit.
    td_window : (float, float), optional
        Range in which each run gets its own td, instead of ``td`` [time]; the default is the longest flight of the run.
    parts, flying, **choosing
        Arguments as for `suggest`.
    time, energy, channels, input_format
        Arguments as for `read`.
    jobs : int
        Number of processes that work at the same time.  If it is above 1, a script needs the guard ``if __name__ ==
        "__main__":``.

    Returns
    -------
    Study
        The answer; the row of a run that cannot be read states the reason.

    Raises
    ------
    TypeError, ValueError
        If an argument has a wrong type or value.

    Examples
    --------
    >>> import d2rpick as d2
    >>> found = d2.study(["sample_data/energy.csv", "sample_data/energy.glstat"], td=0.0687534)
    >>> found.agree, round(found.common.tr, 4)
    (True, 0.0136)
    """
    from d2rpick.api.runs import check_format, make_selection

    chosen = make_selection(time, energy, channels)
    file_format = check_format(input_format)
    names = find_runs(
        arguments.list_paths("runs", [runs] if isinstance(runs, str) else runs)
    )
    times = TimeArguments(
        lambda: find_common_unit([[name] for name in names], chosen, file_format)
    )
    td_or_window = choose_time_or_window(
        times.check_time("td", td), times.check_window("td_window", td_window)
    )
    processes = arguments.check_whole_number("jobs", 1 if jobs is None else jobs, 1)
    choosing_in_unit: Any = times.convert_options(choosing, OPTIONS)
    request = make_request(None, parts, flying, None, None, choosing_in_unit)
    request = replace(
        request, time=chosen.time, energy=chosen.energy, channel=tuple("=".join(pair) for pair in chosen.channels),
        input_format=file_format,
    )  # fmt: skip
    question = make_question(request, td_or_window, curve=True)
    with choose_farm(min(processes, len(names)), "d2rpick.choice.runs.study") as farm:
        return answer_study(
            request, question, names, list(compute_rows(question, names, farm))
        )


def find_runs(names: Iterable[str]) -> tuple[str, ...]:
    """Replace patterns with the matching files and folders, each of which is a run. Other names are kept."""
    from glob import glob

    runs: list[str] = []
    for name in names:
        pattern = any(sign in name for sign in "*?[") and not Path(name).exists()
        runs += (pattern and _remove_repeated(glob(name, recursive=True))) or [name]  # noqa: PTH207  Path.glob drops "./"
    return tuple(runs)


def _remove_repeated(names: Iterable[str]) -> list[str]:
    """Return each file or folder only once, by its shortest name, because circular links give it many names."""
    shortest_first = sorted(names, key=lambda name: (len(name), name), reverse=True)
    return sorted({os.path.realpath(name): name for name in shortest_first}.values())


def make_question(
    request: Request, td: float | tuple[float, float] | None, *, curve: bool
) -> Question:
    """Return the question to ask about every run; ``curve`` is True if the energies of all runs are drawn.

    Raises
    ------
    ArgumentError
        If the recommended set is requested, which depends on the deck of each run: one tr suits all runs only if all of
        them switch the same parts.
    """
    if has_recommended(request.part, ()):
        raise ArgumentError(
            "`parts` recommended needs a deck, but the runs of a study share one set of parts; find a set with d2rpick "
            "parts, and give its numbers"
        )
    return Question(
        td, request.settings, request.selection(), request.input_format, curve=curve
    )


def answer_study(
    request: Request, question: Question, names: Sequence[str], rows: Sequence[StudyRow]
) -> Study:
    """Compare the answers for all runs."""
    td = question.td
    times: tuple[str, ...] = () if td is None else ("--td", repr(td))
    if isinstance(td, tuple):
        times = ("--td-window", *map(repr, td))
    # A study reports no CPU time, so these options are omitted from its command line.
    options = replace(request, cost_share=None, step_ratio=None).asking()
    return Study.of(
        core.compare_rows(td, rows),
        command=("study", *times, *options, *make_positional(names)),
        question=request.repeat()._replace(times=times, files=tuple(names)),
    )


def compute_rows(
    question: Question,
    sources: Sequence[str],
    farm: Farm,
    ledger: Ledger | None = None,
    *,
    absolute: bool = False,
    told: Callable[[int], None] | None = None,
) -> Iterator[StudyRow]:
    """Yield the rows in the order of the runs, each as soon as this row and all rows before it are computed.

    Parameters
    ----------
    question : Question
    sources : sequence of str
        Files or folders of the runs.
    farm : Farm
        Computes the rows that are not in the ledger.
    ledger : Ledger, optional
        File of rows that are already computed, to which new rows are appended.
    absolute : bool
        True if the processes of the farm work in other folders, so that they need absolute paths.
    told : function, optional
        Function that is called with the number of finished rows, initially with the number of rows from the ledger.
    """
    known_rows = dict(ledger.known) if ledger else {}
    new = [number for number in range(len(sources)) if number not in known_rows]
    done = len(known_rows)
    following = 0
    names = [sources[number] for number in new]
    if absolute:
        names = [abspath(name) for name in names]  # noqa: PTH100  Path.resolve would follow links
    for answer in chain(
        (None,), farm.answers(partial(core.judge_run, question), names)
    ):
        if answer:
            number = new[answer.number]
            if answer.error:
                row = core.make_failed_row(sources[number], answer.error)
            else:
                row = answer.result
            known_rows[number] = replace(row, source=sources[number])
            done += 1
            if ledger:
                ledger.add(known_rows[number])
        if told:
            told(done)
        while following in known_rows:
            yield known_rows.pop(following)
            following += 1


def compute_fingerprint(question: Question) -> str:
    """Return a digest of the version and the options, which affect a row in addition to the files of its run."""
    values = {**asdict(question), "curve": None}
    return hashlib.sha256(json.dumps(values, sort_keys=True).encode()).hexdigest()[:16]


def write_row(row: StudyRow, question_digest: str) -> str:
    """Return a row as one line with its values and the data that are needed to restore it.

    ``asked`` is the ``fingerprint`` of the question.
    """
    record = PLAIN.plain(row) | {
        "acceptable": [windows.tolist() for windows in (row.acceptable, row.alike)],
        "profile": None if row.profile is None else row.profile.tolist(),
        "files": [stamp._asdict() for stamp in row.files],
        "asked": question_digest,
    }
    if row.curve is not None:
        record["curve"] = row.curve.tolist()
    return add_checksum(json.dumps(record, allow_nan=False))


class Ledger:
    """A file of finished rows, one per line; the file need not exist yet.

    Damaged lines are skipped, including an incomplete last line of a killed study.

    Raises
    ------
    FormatError
        If the file contains something else.
    """

    def __init__(self, name: str, question: Question) -> None:
        self.name, self.asked, self.curve = (
            name,
            compute_fingerprint(question),
            question.curve,
        )
        self.taken = self.outdated = self.damaged = 0
        self._rows: dict[tuple[Stamp, ...], StudyRow] = {}
        self.known: dict[int, StudyRow] = {}
        self._known: set[tuple[str, ...]] = set()
        new = not Path(name).exists()
        if not new and not Path(name).is_file():
            raise FormatError(
                f"{name}: cannot be written (not a regular file); give another file"
            )
        try:
            # The file is opened before the work begins, so that a file that cannot be written is reported at once.
            with Path(name).open("a+b") as file:
                file.seek(0)
                content = file.read()
            # The empty file is deleted, because the first row creates it again.
            if new:
                Path(name).unlink()
        except OSError as error:
            raise FormatError(
                f"{name}: cannot be written ({error.strerror or error}); give another file"
            ) from None
        if content[: len(_FIRST)] != _FIRST[: len(content)]:
            raise FormatError(
                f'{name}:1: not a run of a study, which begins with {{"source": ; give another file'
            )
        for text in content.split(b"\n"):
            if record := parse_record(text):
                self._remember(record)
            else:
                # A killed study leaves an incomplete last line.
                cut = text.startswith(_FIRST) and not text.endswith(b"}")
                self.damaged += bool(text) and not cut and not text.startswith(_LAST)
        self._end = b"" if content.endswith(b"\n") or not content else b"\n"

    def _remember(self, record: dict[str, Any]) -> None:
        files = tuple(Stamp(**stamp) for stamp in record["files"])
        self._known.add(tuple(stamp.name for stamp in files))
        needed = {*PLAIN.keys, "profile", *(["curve"] if self.curve else [])}
        whole = needed <= record.keys()
        if record["asked"] == self.asked and files and whole:
            self._rows[files] = StudyRow(
                **{name: record[name] for name in PLAIN.keys if name not in _LISTS},
                warnings=tuple(record["warnings"]),
                parts=None if record["parts"] is None else tuple(record["parts"]),
                parts_in_files=tuple(record["parts_in_files"]),
                acceptable=np.array(record["acceptable"][0]).reshape(-1, 2),
                alike=np.array(record["acceptable"][1]).reshape(-1, 2),
                profile=None
                if record["profile"] is None
                else np.array(record["profile"]).reshape(2, -1),
                files=files,
                curve=np.array(record["curve"]) if self.curve else None,
            )

    def find(self, source: str) -> StudyRow | None:
        """Return the stored row of a run whose files are unchanged; None if no such row is stored."""
        files = stamp_files(source)
        row = self._rows.get(files)
        if row:
            self.taken += 1
            return replace(row, source=source)
        self.outdated += tuple(stamp.name for stamp in files) in self._known
        return None

    def taking(self, sources: Sequence[str]) -> int:
        """Return the number of runs whose rows are already in the file."""
        self.known = {
            number: row
            for number, source in enumerate(sources)
            if (row := self.find(source))
        }
        return len(self.known)

    def told(self, runs: int) -> str:
        """Describe how many of ``runs`` runs are taken from the file, and why other stored rows are not used."""
        if self.outdated:
            outdated = f"; {self.outdated} have changed, or were computed with other options, and are computed again"
        else:
            outdated = ""
        if self.damaged:
            damaged = f"; lines skipped, damaged or without a checksum: {self.damaged}"
        else:
            damaged = ""
        return f"{self.taken} of {runs} runs reused from {self.name}{outdated}{damaged}"

    def add(self, row: StudyRow) -> None:
        """Append the row of a judged run; the row is on disk when this method returns."""
        # A row that is not stored will be computed again next time.
        if row.status in (FAILED, UNREADABLE, INTERNAL_ERROR):
            return
        try:
            append_as_a_whole(
                Path(self.name), self._end + write_row(row, self.asked).encode() + b"\n"
            )
        except OSError as error:
            raise FormatError(
                f"{self.name}: cannot be written ({error.strerror}); make room and begin again"
            ) from None
        self._end = b""
