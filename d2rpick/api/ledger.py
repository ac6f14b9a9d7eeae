"""The file from which a study goes on: a line for each run that was judged, with a checksum."""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from d2rpick.base.errors import INTERNAL_ERROR, FormatError
from d2rpick.base.files import append_whole, record_of, signed
from d2rpick.choice.study import FAILED, UNREADABLE, Question, Stamp, StudyRow, stamps
from d2rpick.report.study import PLAIN

if TYPE_CHECKING:
    from collections.abc import Sequence

_FIRST: Final = b'{"source": '
_LAST: Final = b'{"schema": '  # of the summary behind the rows


def fingerprint(question: Question) -> str:
    """Stand for all that a row depends on beside its files: options and version, not whether its curve is drawn."""
    asked = {**asdict(question), "curve": None}
    return hashlib.sha256(json.dumps(asked, sort_keys=True).encode()).hexdigest()[:16]


def line(row: StudyRow, asked: str) -> str:
    """Write a row as one line: its values, and what is needed to take it from there later.

    ``asked`` is the ``fingerprint`` of the question.
    """
    record = PLAIN.plain(row) | {
        "acceptable": [windows.tolist() for windows in (row.acceptable, row.alike)],
        "profile": None if row.profile is None else row.profile.tolist(),
        "files": [stamp._asdict() for stamp in row.files],
        "asked": asked,
    }
    if row.curve is not None:
        record["curve"] = row.curve.tolist()
    return signed(json.dumps(record, allow_nan=False))


class Ledger:
    """Rows that a file of such lines holds; it need not exist yet.

    Damaged lines are passed over, among them what a killed study left of its last one.

    Raises
    ------
    FormatError
        If the file holds something else.
    """

    def __init__(self, name: str, question: Question) -> None:
        self.name, self.asked, self.curve = name, fingerprint(question), question.curve
        self.taken = self.outdated = self.damaged = 0
        self._rows: dict[tuple[Stamp, ...], StudyRow] = {}
        self.known: dict[int, StudyRow] = {}
        self._known: set[tuple[str, ...]] = set()
        new = not Path(name).exists()
        if not new and not Path(name).is_file():
            raise FormatError(f"{name}: cannot be written (not a regular file); give another file")
        try:
            with Path(name).open("a+b") as file:  # sure to be writable before the work begins
                file.seek(0)
                content = file.read()
            if new:  # the first row makes it
                Path(name).unlink()
        except OSError as error:
            raise FormatError(f"{name}: cannot be written ({error.strerror or error}); give another file") from None
        if content[: len(_FIRST)] != _FIRST[: len(content)]:
            raise FormatError(f'{name}:1: not a run of a study, which begins with {{"source": ; give another file')
        for text in content.split(b"\n"):
            if record := record_of(text):
                self._remember(record)
            else:
                cut = text.startswith(_FIRST) and not text.endswith(b"}")  # by the end of a killed study
                self.damaged += bool(text) and not cut and not text.startswith(_LAST)
        self._end = b"" if content.endswith(b"\n") or not content else b"\n"

    def _remember(self, record: dict[str, Any]) -> None:
        files = tuple(Stamp(**stamp) for stamp in record["files"])
        self._known.add(tuple(stamp.name for stamp in files))
        whole = "profile" in record and ("curve" in record or not self.curve)
        if record["asked"] == self.asked and files and whole:
            self._rows[files] = StudyRow(
                **{name: record[name] for name in PLAIN.keys if name != "warnings"},
                warnings=tuple(record["warnings"]),
                acceptable=np.array(record["acceptable"][0]).reshape(-1, 2),
                alike=np.array(record["acceptable"][1]).reshape(-1, 2),
                profile=None if record["profile"] is None else np.array(record["profile"]).reshape(2, -1),
                files=files,
                curve=np.array(record["curve"]) if self.curve else None,
            )

    def find(self, source: str) -> StudyRow | None:
        """Give the row of a run whose files are as they were, None where there is none."""
        files = stamps(source)
        row = self._rows.get(files)
        if row:
            self.taken += 1
            return replace(row, source=source)
        self.outdated += tuple(stamp.name for stamp in files) in self._known
        return None

    def taking(self, sources: Sequence[str]) -> int:
        """Count the runs that are known."""
        self.known = {number: row for number, source in enumerate(sources) if (row := self.find(source))}
        return len(self.known)

    def told(self, runs: int) -> str:
        """Say how many of so many runs were taken, and why others that the file holds were not."""
        outdated = f"; {self.outdated} have changed, or were computed with other options" if self.outdated else ""
        damaged = f"; lines skipped, damaged or without a checksum: {self.damaged}" if self.damaged else ""
        return f"{self.taken} of {runs} runs reused from {self.name}{outdated}{damaged}"

    def add(self, row: StudyRow) -> None:
        """Append the row of a run that was judged; it is in the file when this returns."""
        if row.status in (FAILED, UNREADABLE, INTERNAL_ERROR):  # asked again next time
            return
        try:
            append_whole(Path(self.name), self._end + line(row, self.asked).encode() + b"\n")
        except OSError as error:
            raise FormatError(f"{self.name}: cannot be written ({error.strerror}); make room and begin again") from None
        self._end = b""
