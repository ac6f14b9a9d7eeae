"""The answer of ``study`` as table, JSON, CSV, Markdown, and its last line of newline-delimited JSON."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

from d2rpick.errors import printable
from d2rpick.report import tables
from d2rpick.studies.resume_file import PLAIN, plain
from d2rpick.studies.study import runs_of
from d2rpick.version import __version__

if TYPE_CHECKING:
    from collections.abc import Sequence

    from d2rpick.studies.study import Study

SCHEMA = "d2rpick/study/1"
HEAD = ("run", "tr", "+-", "E(td)", "R", "basis", "status", "message")


def as_table(answer: Study) -> str:
    """One line per run, and below what they have in common."""
    width = max(len(name) for name, _ in outcome(answer))
    below = [f"{name.ljust(width)}  {printable(text)}" for name, text in outcome(answer)]
    return "\n".join([tables.as_text(HEAD, rows(answer)), "", *below])


def as_markdown(answer: Study) -> str:
    """The runs as a Markdown table, and below what they have in common."""
    below = "\n".join(f"* {name}: {printable(text)}" for name, text in outcome(answer))
    return f"{tables.as_markdown(HEAD, rows(answer))}\n\n{below}"


def as_csv(answer: Study) -> str:
    """One row per run, a column for each key of the JSON output."""
    cells = ([_joined(value) for value in plain(row).values()] for row in answer.rows)
    return tables.as_csv(PLAIN, cells).rstrip("\n")


def as_json(answer: Study, command: Sequence[str]) -> str:
    """The whole answer by schema d2rpick/study/1."""
    return tables.as_json({**_front(answer, command), "runs": [plain(row) for row in answer.rows], **_shared(answer)})


def as_last_line(answer: Study, command: Sequence[str]) -> str:
    """The JSON output without the runs, in one line: what follows their lines."""
    return json.dumps({**_front(answer, command), **_shared(answer)}, allow_nan=False)


def rows(answer: Study) -> list[list[tables.Cell]]:
    """Cells of the table of runs."""
    return [
        [
            row.source,
            row.tr,
            None if row.tr_low is None or row.tr_high is None else f"{(row.tr_high - row.tr_low) / 2:.1e}",
            row.energy_td,
            tables.measure(row.residual),
            row.basis,
            row.status,
            row.message or ", ".join(row.warnings),
        ]
        for row in answer.rows
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
        low, high = common.window
        shared = f"{common.tr:g}, acceptable in {answer.judged} of {runs_of(answer.judged)}; "
        shared += f"so is every tr from {low:.6g} to {high:.6g}"
    return [
        ("td", f"{answer.td:.6g}, {answer.judged} of {runs_of(len(answer.rows))} judged"),
        ("tr", found),
        ("common tr", shared),
    ]


def _front(answer: Study, command: Sequence[str]) -> dict[str, Any]:
    return {
        "schema": SCHEMA,
        "tool_version": __version__,
        "command": list(command),
        "warnings": [{"code": caution.code, "message": caution.message} for caution in answer.cautions],
        "td": answer.td,
    }


def _shared(answer: Study) -> dict[str, Any]:
    spread, common = answer.spread, answer.common
    return {
        "tr": dict(zip(("min", "median", "max"), spread or (None, None, None), strict=True)),
        "agree": answer.agree,
        "common_tr": common.tr,
        "common_window": common.window,
        "common_reason": common.reason,
    }


def _joined(value: Any) -> tables.Cell:
    cell: tables.Cell = "; ".join(value) if isinstance(value, tuple) else value
    return cell
