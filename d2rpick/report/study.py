"""The answer of ``study`` as table, JSON, CSV, Markdown, and its last line of newline-delimited JSON."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

from d2rpick.choice.study_rows import PLAIN, runs_of
from d2rpick.errors import printable
from d2rpick.histories.digits import window_as_read
from d2rpick.report import tables
from d2rpick.report.keys import of_warnings
from d2rpick.version import __version__

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from d2rpick.choice.study import Study
    from d2rpick.choice.study_rows import StudyRow

SCHEMA = "d2rpick/study/1"
# Keys of a run in JSON, and columns of the csv.
RUN = (*PLAIN, "common_error")
HEAD = ("run", "tr", "+-", "td", "E(td)", "R", "at common", "basis", "status", "message")


def as_table(answer: Study) -> str:
    """One line per run, and below what they have in common."""
    width = max(len(name) for name, _ in outcome(answer))
    below = [f"{name.ljust(width)}  {printable(text)}" for name, text in outcome(answer)]
    return "\n".join([tables.as_text(HEAD, rows(answer)), "", *below])


def as_markdown(answer: Study) -> str:
    """The runs as a Markdown table, and below what they have in common."""
    below = "\n".join(f"* {name}: {tables.in_markdown(text)}" for name, text in outcome(answer))
    return f"{tables.as_markdown(HEAD, rows(answer))}\n\n{below}"


def as_csv(answer: Study) -> str:
    """One row per run, a column for each key of the JSON output."""
    cells = ([_joined(value) for value in one.values()] for one in runs(answer))
    return tables.as_csv(RUN, cells).rstrip("\n")


def as_json(answer: Study, command: Sequence[str]) -> str:
    """The whole answer by schema d2rpick/study/1."""
    return tables.as_json({**_front(answer, command), "runs": runs(answer), **_shared(answer)})


def as_last_line(answer: Study, command: Sequence[str]) -> str:
    """The JSON output without the runs, in one line: what follows their lines."""
    return json.dumps({**_front(answer, command), **_shared(answer)}, allow_nan=False)


def runs(answer: Study) -> list[dict[str, Any]]:
    """Values of each run by their keys in JSON, with its error at the common tr."""
    return [row.plain | {"common_error": error} for row, error in _with_errors(answer)]


def _with_errors(answer: Study) -> Iterator[tuple[StudyRow, float | None]]:
    return zip(answer.rows, answer.common.errors or [None] * len(answer.rows), strict=True)


def rows(answer: Study) -> list[list[tables.Cell]]:
    """Cells of the table of runs."""
    return [
        [
            row.source,
            row.tr,
            None if row.tr_low is None or row.tr_high is None else f"{(row.tr_high - row.tr_low) / 2:.1e}",
            row.td,
            row.energy_td,
            tables.measure(row.residual),
            tables.measure(error),
            row.basis,
            row.status,
            row.message or ", ".join(row.warnings),
        ]
        for row, error in _with_errors(answer)
    ]


def outcome(answer: Study) -> list[tuple[str, str]]:
    """What the runs have in common, by names, for people."""
    spread, common = answer.spread, answer.common
    found = "none"
    if spread:
        found = f"{spread.min:.6g} to {spread.max:.6g}, median {spread.median:.6g}; "
        found += "the intervals overlap" if answer.agree else "the intervals do not overlap"
    shared = f"none: {common.reason}"
    if common.tr is not None and common.window:
        known = [error for error in common.errors if error is not None]
        shared = f"{common.tr:g}, acceptable in {answer.judged} of {runs_of(answer.judged)}; "
        shared += f"so is every tr from {window_as_read(*common.window)}; "
        shared += f"error there {tables.measure(min(known))} to {tables.measure(max(known))}"
    return [
        ("td", f"{td_of(answer)}, {answer.judged} of {runs_of(len(answer.rows))} judged"),
        ("tr", found),
        ("common tr", shared),
    ]


def td_of(answer: Study) -> str:
    """The td of all runs, or the window in which each has its own."""
    if answer.td_window:
        return "of each run in {:.6g} to {:.6g}".format(*answer.td_window)
    return f"{answer.td:.6g}"


def _front(answer: Study, command: Sequence[str]) -> dict[str, Any]:
    return {
        "schema": SCHEMA,
        "tool_version": __version__,
        "command": list(command),
        "warnings": of_warnings(answer.cautions),
        "td": answer.td,
        "td_window": answer.td_window,
    }


def _shared(answer: Study) -> dict[str, Any]:
    spread, common = answer.spread, answer.common
    return {
        "tr": dict(zip(("min", "median", "max"), spread or (None, None, None), strict=True)),
        "agree": answer.agree,
        "common_tr": common.tr,
        "common_window": common.window,
        "common_reason": common.reason,
        "common_keeps_timing_tolerance": common.keeps_tolerance,
        "common_errors": list(common.errors),
    }


def _joined(value: Any) -> tables.Cell:
    cell: tables.Cell = "; ".join(value) if isinstance(value, tuple) else value
    return cell
