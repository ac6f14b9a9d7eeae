"""Finished runs of a study, one JSON object per line, so that a study that is begun again need not repeat them."""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from d2rpick.errors import FormatError
from d2rpick.studies.study import FAILED, UNREADABLE, Row, Stamp, stamps

if TYPE_CHECKING:
    from d2rpick.studies.study import Question

# Keys of a line that are a row's plain values, in the order of the output.
PLAIN: Final = (
    *("source", "tr", "tr_low", "tr_high", "energy_td", "residual", "status", "message", "basis", "warnings"),
    "time_unit",
)


def fingerprint(question: Question) -> str:
    """Stand for all that a row depends on beside its files: options and version, not whether its curve is drawn."""
    asked = {**asdict(question), "curve": None}
    return hashlib.sha256(json.dumps(asked, sort_keys=True).encode()).hexdigest()[:16]


def plain(row: Row) -> dict[str, Any]:
    """Give the values of a row by their keys in JSON results."""
    return {name: getattr(row, name) for name in PLAIN}


def line(row: Row, asked: str) -> str:
    """Write a row as one line: its values, and what is needed to take it from there later.

    ``asked`` is the ``fingerprint`` of the question.
    """
    record = plain(row) | {
        "acceptable": [windows.tolist() for windows in row.acceptable],
        "files": [stamp._asdict() for stamp in row.files],
        "asked": asked,
    }
    if row.curve is not None:
        record["curve"] = row.curve.tolist()
    return json.dumps(record, allow_nan=False)


class Ledger:
    """Rows that a file of such lines holds; it need not exist yet.

    What a killed study left of its last line is passed over.

    Raises
    ------
    FormatError
        If the file holds something else.
    """

    def __init__(self, name: str, question: Question) -> None:
        self.name, self.asked, self.curve = name, fingerprint(question), question.curve
        self.taken = self.outdated = 0
        self._rows: dict[tuple[Stamp, ...], Row] = {}
        self._known: set[tuple[str, ...]] = set()
        try:
            with Path(name).open("a+b") as file:  # created, and sure to be writable before the work begins
                file.seek(0)
                content = file.read()
        except OSError as error:
            raise FormatError(f"{name}: cannot be written ({error.strerror}); name another file") from None
        if content and not content.startswith(b'{"source": '):
            raise FormatError(f'{name}:1: no run of a study, which begins with {{"source": ; name another file')
        for text in content.splitlines():
            try:
                record = json.loads(text)
            except ValueError:  # cut where the study was killed
                continue
            if "files" in record:  # else the summary at the end
                self._remember(record)
        self._end = b"" if content.endswith(b"\n") or not content else b"\n"

    def _remember(self, record: dict[str, Any]) -> None:
        files = tuple(Stamp(**stamp) for stamp in record["files"])
        self._known.add(tuple(stamp.name for stamp in files))
        if record["asked"] == self.asked and files and ("curve" in record or not self.curve):
            self._rows[files] = Row(
                **{name: record[name] for name in PLAIN if name != "warnings"},
                warnings=tuple(record["warnings"]),
                acceptable=tuple(np.array(windows).reshape(-1, 2) for windows in record["acceptable"]),
                files=files,
                curve=np.array(record["curve"]) if self.curve else None,
            )

    def find(self, source: str) -> Row | None:
        """Give the row of a run whose files are as they were, None where there is none."""
        files = stamps(source)
        row = self._rows.get(files)
        if row:
            self.taken += 1
            return replace(row, source=source)
        self.outdated += tuple(stamp.name for stamp in files) in self._known
        return None

    def told(self, runs: int) -> str:
        """Say how many of so many runs were taken, and why others that the file holds were not."""
        outdated = f"; {self.outdated} have changed or were asked for with other options" if self.outdated else ""
        return f"{self.taken} of {runs} runs taken from {self.name}{outdated}"

    def add(self, row: Row) -> None:
        """Append the row of a run that was judged; it is in the file when this returns."""
        if row.status in (FAILED, UNREADABLE):  # asked again next time
            return
        with Path(self.name).open("ab") as file:
            file.write(self._end + line(row, self.asked).encode() + b"\n")
        self._end = b""
