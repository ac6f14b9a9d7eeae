"""Write the result of ``study`` as a table, JSON, CSV, Markdown, or the last line of newline-delimited JSON."""

from __future__ import annotations

import re
from collections import Counter
from pathlib import PurePath
from typing import TYPE_CHECKING, Any, Final

from d2rpick.base.errors import list_names, make_printable
from d2rpick.choice.pair.grades import GOOD, GRADES, POOR, VERDICTS
from d2rpick.choice.pair.quality import grade_residual
from d2rpick.choice.runs.study import (
    NAMED,
    OK,
    Spread,
    StudyOfRuns,
    StudyRow,
    describe_end_of_record,
    describe_other_model,
    describe_other_unit,
    explain_left_out,
    find_cut_runs,
    find_repeated_runs,
    format_number_of_runs,
)
from d2rpick.histories.digits import format_window
from d2rpick.report import keys, tables
from d2rpick.report.fields import (
    Document,
    Field,
    get_kind,
    many,
    maybe,
    one_of,
    row,
    write_csv,
)
from d2rpick.report.formats import RepeatedQuestion
from d2rpick.report.next_step import name_step_to_parts, write_command

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from d2rpick.report.formats import DisplayOptions

STATUS: Final = one_of(
    "ok", "none", "unreadable", "out-of-range", "failed", "internal-error"
)
_A_NUMBER, _NULL = {"type": "number"}, {"type": "null"}
# Fields of a run that are None unless its status is "ok".
_JUDGED: Final[dict[str, Any]] = {
    "description": "One run; null where nothing can be said.",
    "if": {"properties": {"status": {"const": "ok"}}},
    "then": {
        "properties": {
            **dict.fromkeys(("tr", "tr_low", "tr_high", "energy_td"), _A_NUMBER),
            "message": _NULL,
        }
    },
    "else": {"properties": {"tr": _NULL, "message": {"type": "string"}}},
}
PLAIN: Final = row(
    Field("source", "text", "run, as given"),
    Field("tr", "number?", "tr recommended for this run"),
    keys.CANDIDATE.field("tr_low"),
    keys.CANDIDATE.field("tr_high"),
    Field("energy_td", "number?", "internal energy at td"),
    Field("residual", "number?", "residual R of the pair of this run; null if unknown"),
    Field("status", STATUS, "ok if a tr is recommended, otherwise why there is none"),
    Field("message", "text?", "reason why no tr is recommended; null if status is ok"),
    Field("basis", maybe(keys.BASIS), "model of the vibration on which the choice is based"),
    Field("warnings", "texts", "warnings about this run"),
    Field("time_unit", "text", "unit of the times; empty if no file contains it"),
    Field("td", "number?", "td of this run"),
    Field("record_end", "number?", "last time of the record"),
    Field("quality", keys.GRADE, "grade of the pair; null if there is no pair", later=True),
    Field("verdict", maybe(keys.VERDICT), "what to do with the pair of this run", later=True),
    Field("verdict_reason", "text?", "reason for the verdict, as text", later=True),
    Field("cure", "text?", "how to improve the pair; empty for a good pair", later=True),
    Field("better_td", "number?", "td of a better pair; null if none is known", later=True),
    Field("energy_unit", "text", "unit of the energies; empty if no file contains it", later=True),
    Field("energy", "text?", "name of the energy by which the run was judged; it lists at most 5 parts", later=True),
    Field("parts", maybe(many("integer")), "numbers of the parts whose energies were added; null for the whole model, "
                                           "or for columns", later=True),
    Field("is_unchosen", "flag?", "true if this is the energy of the whole model because no part or energy was chosen, "
                                  "although the files show which parts fly", later=True),
    Field("parts_in_files", "texts", "number and title of each part in the files of this run", later=True),
)  # fmt: skip
_ERROR: Final = Field(
    "common_error", "number?",
    "error at the common tr: the residual, or the level error if the basis is energy; 0 if nothing vibrates; with -f "
    "ndjson see common_errors in the last line",
    lambda run_and_error: run_and_error[1],
)  # fmt: skip
# Fields of a run and of its error at the common tr, in JSON and in a row of the CSV.
RUN: Final = row(
    *PLAIN.of_part(lambda run_and_error: run_and_error[0]), _ERROR, **_JUDGED
)
_RUN: Final = row(
    *RUN.fields, name="run", later=("common_error", "record_end"), **_JUDGED
)
# Keys of the statistics of tr, with the words for them.
_EXTENTS: Final = {"min": "smallest", "median": "median", "max": "largest"}
_SHARED: Final = row(
    keys.WARNINGS,
    Field("td", "number?", "given td; null if each run has its own td"),
    Field("td_window", "span?", "range in which each run chose its td"),
    Field("tr", row(*(Field(key, "number?", f"{extent} tr") for key, extent in _EXTENTS.items())),
          "statistics of tr, for the runs that have a tr",
          lambda answer: answer.spread or dict.fromkeys(_EXTENTS)),
    Field("agree", "flag?", "true if the intervals from tr_low to tr_high of these runs overlap"),
    Field("common_tr", "number?",
          "tr for all runs; null if there is none. If the runs agree: the median of tr, or the nearest time that lies "
          "in all intervals. Otherwise: the earliest tr that is admissible in every run with status ok or none, and "
          "within the timing tolerance of each of these runs", lambda answer: answer.common.tr),
    Field("common_verdict", maybe(keys.VERDICT),
          "what to do with common_tr: the verdict for the worst run, from its own pair and from its error at "
          "common_tr",
          lambda answer: VERDICTS.get(answer.grade), later=True),
    Field("common_window", "span?", "first and last tr around common_tr that meet the same conditions",
          lambda answer: answer.common.window),
    Field("common_reason", "text?", "reason why there is no common_tr", lambda answer: answer.common.reason),
    Field("common_keeps_timing_tolerance", "flag?",
          "true if no error at common_tr is more than 0.05 larger than the error at the run's own tr; null if there "
          "is no common_tr",
          lambda answer: answer.common.keeps_tolerance),
    Field("common_errors", many("number?"), "errors of the runs at common_tr, in the same order; empty if there is no "
                                            "common_tr",
          lambda answer: answer.common.errors),
)  # fmt: skip
_RUNS: Final = Field("runs", many(RUN), "one entry for each run, in the order of the arguments",
                     lambda answer: list(add_errors(answer)))  # fmt: skip
_MEANING: Final = (
    "Answer of d2rpick study; times in the unit of the histories. With -f ndjson, each run is a line that conforms "
    "to $defs/line; the last line conforms to $defs/last."
)
# Newline-delimited JSON has one line per run, written by `d2rpick.api.studies`, and a last line of common results.
_CURVE: Final = get_kind(many(many("number")), minItems=2, maxItems=2)
_LINE: Final = row(
    *RUN.fields,
    Field("acceptable", many(many("span")),
          "intervals of admissible tr, and intervals in which the error is at most 0.05 above the error at tr"),
    Field("files", many(row(Field("name", "text"), Field("size", "integer"), Field("mtime_ns", "integer")))),
    Field("asked", "text", "hash of the options and the version"),
    Field("curve", _CURVE, "times and energies of an outline of the record, for a figure"),
    Field("profile", maybe(_CURVE), "Times and errors of admissible tr, straight lines between them."),
    name="line", later=("common_error", "curve", "record_end"), **_JUDGED,
)  # fmt: skip
_MOST_REASONS: Final = 3
# Numbers in a reason; reasons that differ only in them are shown once.
_NUMBER: Final = r"\d+(?:\.\d+)?(?:e[+-]?\d+)?"
# Runs share a better td if their better td differ by at most this fraction [-].
_SAME_TD: Final = 1e-3
# Columns that are omitted, in this order, if a terminal is too narrow; the energy at td is omitted before them.
_SPARE: Final = (
    "+-",
    "basis",
    "error at common tr",
    "residual at common tr",
    "level error at common tr",
)
LAST: Final = Document("d2rpick/study/1", _MEANING, _SHARED)
DOCUMENT: Final = Document(
    LAST.name,
    _MEANING,
    row(*_SHARED.fields[:3], _RUNS, *_SHARED.fields[3:]),
    also=(_RUN, _LINE, row(*LAST.whole.fields, name="last")),
)


def as_table(answer: StudyOfRuns, display: DisplayOptions) -> str:
    """Return, as text, the results common to all runs, and a line per run with its shortened name."""
    head, rows = tables.select_known_columns(*build_run_table(answer))
    rows = [
        [name, *row[1:]]
        for name, row in zip(
            shorten_names([row.source for row in answer.runs]), rows, strict=True
        )
    ]
    outcome_lines = tables.format_in_line(
        [
            *list_outcome(answer),
            *list_run_reasons(answer),
            *list_next_step(answer, display.question),
        ]
    )
    return "\n".join(
        [
            *outcome_lines,
            "",
            tables.as_text(
                head, rows, display.width, (name_target_energy(answer), *_SPARE)
            ),
        ]
    )


def as_markdown(answer: StudyOfRuns, display: DisplayOptions) -> str:
    """Return the results common to all runs, and a Markdown table of the runs."""
    outcome_lines = tables.format_as_list(
        [
            *list_outcome(answer),
            *list_run_reasons(answer),
            *list_next_step(answer, display.question),
        ]
    )
    listed = "\n".join(f"* {line}" for line in outcome_lines)
    return f"{listed}\n\n{tables.as_markdown(*build_run_table(answer))}"


def as_csv(answer: StudyOfRuns, _: DisplayOptions) -> str:
    """Return CSV with one row per run and a column for each key of the JSON output."""
    return write_csv(RUN.keys, map(RUN.plain, add_errors(answer)))


def as_ndjson(answer: StudyOfRuns, display: DisplayOptions) -> str:
    """Return the lines of the runs that are not yet written, and the line with the common results."""
    return "\n".join([*display.lines, LAST.as_json(answer, display.command, None)])


def add_errors(answer: StudyOfRuns) -> Iterator[tuple[StudyRow, float | None]]:
    """Yield the runs, each with its error at the common tr."""
    return zip(
        answer.runs, answer.common.errors or [None] * len(answer.runs), strict=True
    )


def build_run_table(answer: StudyOfRuns) -> tuple[list[str], list[list[tables.Cell]]]:
    """Return the column names and cells of the runs."""
    ends = {
        row.source: describe_end_of_record(row) for row in find_cut_runs(answer.runs)
    }
    has_failures = any(row.status != OK for row in answer.runs)
    columns: dict[str, Callable[[tuple[StudyRow, float | None]], tables.Cell]] = {
        "run": lambda run_and_error: run_and_error[0].source,
        "tr": lambda run_and_error: run_and_error[0].tr,
        "+-": lambda run_and_error: tables.format_half_width(
            run_and_error[0].tr_low, run_and_error[0].tr_high
        ),
        "td": lambda run_and_error: run_and_error[0].td,
        name_target_energy(answer): lambda run_and_error: run_and_error[0].energy_td,
        "residual": lambda run_and_error: tables.format_measure(
            run_and_error[0].residual
        ),
        f"{_name_error(answer)} at common tr": lambda run_and_error: (
            tables.format_measure(run_and_error[1])
        ),
        "verdict": lambda run_and_error: run_and_error[0].verdict,
        "basis": lambda run_and_error: run_and_error[0].basis,
        "status": lambda run_and_error: (
            run_and_error[0].status if has_failures else None
        ),
        "why": lambda run_and_error: "; ".join(
            filter(
                None,
                (
                    ends.get(run_and_error[0].source),
                    _explain_status(run_and_error[0]),
                ),
            )
        ),
    }
    return tables.fill_table(columns, add_errors(answer))


def _explain_status(row: StudyRow) -> str:
    """Return the message of a run, without the name of the run. If it has none, return the codes of its warnings."""
    text = row.message or ", ".join(row.warnings)
    return text.removeprefix(f"{row.source.rstrip('/')}: ")


def name_target_energy(answer: StudyOfRuns) -> str:
    """Return the header of the target-energy column, with the unit if all runs give the same unit."""
    return f"E(td) [{answer.energy_unit}]" if answer.energy_unit else "E(td)"


def list_outcome(answer: StudyOfRuns) -> list[tuple[str, str]]:
    """Return the results common to all runs, as (name, text) pairs."""
    spread = answer.spread
    common = answer.common
    own_tr = "none"
    if spread:
        own_tr = _describe_spread(spread, overlaps=bool(answer.agree))
    heading = "common tr"
    shared = f"none: {common.reason}"
    if common.tr is not None and common.window:
        errors = [error for error in common.errors if error is not None]
        heading = VERDICTS[answer.grade] if answer.grade else heading
        # A run that was given twice counts once.
        repeated = _count_repetitions(answer)
        different = answer.judged - repeated
        runs = f"{different} of {format_number_of_runs(len(answer.runs) - repeated)}"
        if repeated:
            runs += " (repeated runs count once)"
        # Nothing is common to a single run.
        name = "tr" if different == 1 else "common tr"
        extent = "as good: every"
        if common.keeps_tolerance is False:
            name = "no tr is within the timing tolerance of every run; the best compromise is tr"
            extent = "admissible in every run:"
        shared = f"{name} = {common.tr:g}, for {runs}, {_name_error(answer)} {_format_error_span(errors)}"
        shared += f"; {extent} tr from {format_window(*common.window)}"
    return [
        (heading, shared),
        ("each run", _count_verdicts(answer)),
        *_list_left_out(answer),
        *_list_repetitions(answer),
        *_list_judged_energies(answer),
        ("td", describe_td(answer)),
        ("own tr", own_tr),
    ]


def _list_judged_energies(answer: StudyOfRuns) -> list[tuple[str, str]]:
    """Return a line with the energies by which the runs were judged, and the number of runs if they differ."""
    descriptions = [_describe_energy(row) for row in answer.runs if row.energy]
    if not descriptions:
        return []
    # Formats name the same energy with spaces or underscores.
    counts = Counter(text.replace("_", " ") for text in descriptions)
    if len(counts) == 1:
        return [("judged", descriptions[0])]
    texts = [f"{text} in {format_number_of_runs(n)}" for text, n in counts.items()]
    return [("judged", list_names(texts, most=NAMED, between="; "))]


def _describe_energy(row: StudyRow) -> str:
    """Return the name of the energy by which a run was judged; if nothing was chosen, say how to choose parts."""
    energy = make_printable(row.energy or "")
    return f"{energy}, not that of chosen parts (--part)" if row.is_unchosen else energy


def _describe_spread(spread: Spread, *, overlaps: bool) -> str:
    """Describe the tr of the runs; several tr also by whether their intervals of accuracy overlap."""
    if spread.min == spread.max:
        return f"{spread.median:.6g}"
    intervals = "overlap" if overlaps else "do not overlap"
    span = f"{spread.min:.6g} to {spread.max:.6g}, median {spread.median:.6g}"
    return f"{span}; the intervals {intervals}"


def _name_error(answer: StudyOfRuns) -> str:
    """Return the name of the errors at the common tr: residual, level error, or error if the runs have both."""
    bases = {row.basis for row in answer.runs if row.judged}
    if "energy" not in bases:
        return "residual"
    return "level error" if bases == {"energy"} else "error"


def _format_error_span(errors: Sequence[float]) -> str:
    """Return the smallest and largest error as text, or a single number if both look the same."""
    low = tables.format_measure(min(errors))
    high = tables.format_measure(max(errors))
    return low if low == high else f"{low} to {high}"


def _count_repetitions(answer: StudyOfRuns) -> int:
    """Return the number of runs that have the same content as an earlier run."""
    return sum(len(group) - 1 for group in find_repeated_runs(answer.runs))


def _list_left_out(answer: StudyOfRuns) -> list[tuple[str, str]]:
    """Return the first run that could not be judged, with the reason; empty if all or none could be judged."""
    rows = [row for row in answer.runs if not row.judged]
    if not rows or not answer.judged:
        return []
    more = f"; {len(rows) - 1} more in the table" if len(rows) > 1 else ""
    return [("left out", f"{explain_left_out(rows[0])}{more}")]


def _list_repetitions(answer: StudyOfRuns) -> list[tuple[str, str]]:
    """Describe how many runs have the same content as another run; empty if all runs differ."""
    count = _count_repetitions(answer)
    if not count:
        return []
    have = "has" if count == 1 else "have"
    return [
        (
            "repeated",
            f"{format_number_of_runs(count)} {have} the same content as another run",
        )
    ]


def _count_verdicts(answer: StudyOfRuns) -> str:
    """Describe how many runs have each verdict on their own pair."""
    counts = Counter(row.verdict for row in answer.runs if row.verdict)
    counted = [
        f"{word} in {format_number_of_runs(counts[word])}"
        for word in VERDICTS.values()
        if counts[word]
    ]
    undecided_count = sum(row.verdict is None for row in answer.runs)
    return ", ".join(
        [
            *counted,
            *[f"no verdict in {format_number_of_runs(undecided_count)}"]
            * (undecided_count > 0),
        ]
    )


def list_run_reasons(answer: StudyOfRuns) -> list[tuple[str, str]]:
    """Return, each only once, why the pairs of the runs are no better and how to improve them.

    The reasons for "use" are among them if the vibration error is large, but small beside the next contact.
    """
    rows_by_cause: dict[tuple[str | None, str], list[StudyRow]] = {}
    for run in answer.runs:
        if run.verdict and (run.cure or _has_large_error(run)):
            without_numbers = re.sub(_NUMBER, "#", _describe_cause(run))
            rows_by_cause.setdefault((run.verdict, without_numbers), []).append(run)
    groups = sorted(rows_by_cause.values(), key=len, reverse=True)
    return [("why", _describe_shared_cause(rows)) for rows in groups[:_MOST_REASONS]]


def _describe_shared_cause(rows: Sequence[StudyRow]) -> str:
    """Return the verdict, reason and cure that runs share; if their numbers differ, with those of the first run."""
    causes = {_describe_cause(row) for row in rows}
    example = f" (numbers of {rows[0].source})" if len(causes) > 1 else ""
    runs = format_number_of_runs(len(rows))
    return f"{rows[0].verdict} in {runs}: {_describe_cause(rows[0])}{example}"


def _describe_cause(row: StudyRow) -> str:
    """Return why the pair of a run is not better, and how to improve it."""
    cure = f". To improve: {row.cure}" if row.cure else ""
    return f"{row.verdict_reason}{cure}"


def _has_large_error(row: StudyRow) -> bool:
    """Return True if the residual of a run is too large for a pair that preserves the vibration well."""
    return row.residual is not None and grade_residual(row.residual) != GOOD


def list_next_step(
    answer: StudyOfRuns, question: RepeatedQuestion
) -> list[tuple[str, str]]:
    """Return the next command: to one td for all runs, to the verdict on the common pair, or to the worst run.

    If the energy of the whole model was judged although the files show which parts fly, the parts are chosen first.
    If every run has a usable pair but no tr is common to all of them, each run can have its own tr and td. The td of
    one run is not offered to the others, because their pairs there were not judged and may be unusable.
    """
    judged = [row for row in answer.runs if row.verdict and row.td is not None]
    if not judged:
        first = RepeatedQuestion(files=question.files[:1])
        return [("next", f"look at the first run with {write_command(first, 'info')}")]
    if describe_other_model(judged):
        step = "study the runs of each model separately; d2rpick info RUN lists the parts of a run"
        return [("next", step)]
    if any(row.is_unchosen for row in judged):
        return [("next", name_step_to_parts(question, "study"))]
    worst = min(judged, key=lambda row: GRADES.index(row.quality or POOR))
    if describe_other_unit(judged):
        step = "convert the runs to one unit of time, and repeat the study"
        return [("next", step)]
    of_worst = question._replace(files=(worst.source,))
    better_td = _find_shared_better_td(answer)
    if worst.quality == POOR and better_td is not None:
        of_readable = question._replace(files=_list_different_runs(answer))
        line = write_command(of_readable, "study", "--td", f"{better_td:.6g}")
        step = f"judge all runs at the better td with {line}"
    elif worst.quality == POOR:
        line = write_command(of_worst, "suggest", *question.times)
        step = f"look at the first of the worst runs with {line}"
    elif len(judged) - _count_repetitions(answer) == 1:
        line = write_command(of_worst, "suggest", *question.times)
        step = f"look at the run that was judged with {line}"
    elif answer.common.tr is None:
        line = write_command(of_worst, "suggest", *question.times)
        own_times = "tr" if answer.td is not None else "tr and td"
        contained = "which its cards contain"
        step = (
            f"give each run its own {own_times}, {contained}; for the first, see {line}"
        )
    elif answer.td is None:
        earliest = min(row.td for row in judged if row.td is not None)
        of_readable = question._replace(files=_list_different_runs(answer))
        line = write_command(of_readable, "study", "--td", f"{earliest:.6g}")
        step = f"choose one td for all runs, for example the earliest, with {line}"
    else:
        times = ("--tr", f"{answer.common.tr:.6g}", "--td", f"{answer.td:.6g}")
        line = write_command(of_worst, "verify", *times)
        step = f"judge the common pair in the worst run with {line}"
    return [("next", step)]


def _list_different_runs(answer: StudyOfRuns) -> tuple[str, ...]:
    """Return the names of the judged runs, each content once."""
    repeated = {
        id(row) for group in find_repeated_runs(answer.runs) for row in group[1:]
    }
    return tuple(
        row.source for row in answer.runs if row.judged and id(row) not in repeated
    )


def _find_shared_better_td(answer: StudyOfRuns) -> float | None:
    """Return the better td that all runs with a given td share [time]; None if one has no other or a different td."""
    poor = [row for row in answer.runs if row.quality == POOR]
    found = [row.better_td for row in poor if row.better_td is not None]
    if answer.td is None or len(poor) < 2 or len(found) < len(poor):
        return None
    is_shared = max(found) - min(found) <= _SAME_TD * max(found)
    is_other = abs(found[0] - answer.td) > _SAME_TD * answer.td
    return found[0] if is_shared and is_other else None


def describe_td(answer: StudyOfRuns) -> str:
    """Describe the td common to all runs, or the range in which each run has its own td."""
    if answer.td_window:
        return "of each run in {:.6g} to {:.6g}".format(*answer.td_window)
    if answer.td is None:
        return "of each run in its longest flight"
    return f"{answer.td:.6g}"


def shorten_names(sources: Sequence[str]) -> tuple[str, ...]:
    """Return the distinctive part of each name, without the folders and file names that all share.

    Examples
    --------
    >>> shorten_names(["runs/soft/glstat", "runs/hard/glstat"])
    ('soft', 'hard')
    >>> shorten_names(["runs/a.csv", "runs/b.csv"])
    ('a.csv', 'b.csv')
    """
    paths = [PurePath(source).parts for source in sources]
    depth = min(map(len, paths), default=0)
    first = next(
        (i for i in range(depth) if len({path[i] for path in paths}) > 1),
        max(depth - 1, 0),
    )
    last = next(
        (i for i in range(1, depth + 1) if len({path[-i] for path in paths}) > 1), 1
    )
    distinct_paths = (path[first : len(path) - last + 1] or path[-1:] for path in paths)
    return tuple(
        "/".join(part.strip("/") for part in distinct_path) or source
        for distinct_path, source in zip(distinct_paths, sources, strict=True)
    )
