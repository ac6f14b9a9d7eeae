"""Define the commands for many runs: ``study`` and ``calibrate``."""

from __future__ import annotations

import os
import sys
from typing import TYPE_CHECKING

import click

from d2rpick.api.request import (
    CHOOSING_FOR_SETS,
    READING,
    Request,
    choose_time_or_window,
)
from d2rpick.base.errors import (
    INTERNAL_ERROR,
    D2RPickError,
    FormatError,
    list_names,
)
from d2rpick.base.options import UNLIMITED, Option
from d2rpick.cli import options
from d2rpick.cli.options import RESULT, WINDOW
from d2rpick.cli.output import Output, name_options, tell
from d2rpick.cli.progress import show_counting
from d2rpick.cli.values import choose_click_type
from d2rpick.report.formats import FORMATS, RepeatedQuestion

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from d2rpick.api.studies import Ledger, Study
    from d2rpick.base.workers import Farm


@options.make_command
@click.argument("run", metavar="RUN...", nargs=-1, type=choose_click_type("file"))
@options.make_time_option(
    "--td", "Switch back to deformable at this time.", instead_of=("td_window",)
)
@options.make_time_option(
    "--td-window",
    "Choose the time to switch back within this window, for each run.",
    instead_of=("td",),
    pair=True,
)
@click.option(
    "--from", "listed", envvar="D2RPICK_STUDY_FROM", metavar="LIST", type=choose_click_type("file"),
    help="File with the names of further runs, one per line; - is stdin.",
)  # fmt: skip
@options.make_file_option(
    "--resume",
    "Write the answers for finished runs to FILE, and reuse them for unchanged runs.",
    kind="output",
)
@options.make_click_option("jobs", Option(
    "Number of processes.  [default: one per core]", range(1, UNLIMITED), "N", instead_of=("scheduler",)
))  # fmt: skip
@options.make_click_option("scheduler", Option(
    "Use a running Dask cluster, which must see the same files.", "program", "ADDRESS", instead_of=("jobs",)
))  # fmt: skip
@options.add_options(
    *(*READING, *CHOOSING_FOR_SETS, "plot", "report", *RESULT),
    plot="Plot the energies of all runs and write the figure to FILE (png, svg, pdf).",
    report="Write everything to one HTML page to read, print and sign.",
    forms=FORMATS["study"],
)
def study(
    run: tuple[str, ...],
    td: float | None,
    td_window: WINDOW,
    listed: str | None,
    resume: str | None,
    jobs: int | None,
    scheduler: str | None,
    request: Request,
    output: Output,
) -> None:
    """Choose tr for each of many runs, show how well the values agree, and give a common tr if there is one.

    If you omit --td and --td-window, both times of each run are chosen in its longest flight.  Each RUN is a file, a
    folder with the files of one run, or a pattern that matches runs.  A run that cannot be read is reported in its row
    and does not stop the others.

    Examples
    --------
    d2rpick study --td 0.064 sample_data/energy.csv sample_data/energy.glstat
    d2rpick study --td 0.064 --plot runs.png 'sample_data/energy.*'
    d2rpick study --td 0.37 --part box --resume runs.ndjson -f json sample_data/rolloverT01.gz
    d2rpick study --td 0.064 --tolerance 0.1 -f ndjson sample_data/energy.csv sample_data/energy.glstat
    """
    from d2rpick.api.studies import (
        Ledger,
        answer_study,
        compute_fingerprint,
        compute_rows,
        make_question,
        write_row,
    )

    if scheduler and jobs:
        raise click.UsageError(
            "--scheduler and --jobs exclude each other: the cluster has its own processes"
        )
    td_or_window = choose_time_or_window(td, td_window)
    sources = _list_sources(run, listed)
    output = output.beside(*sources)
    written = {"output-file": output.file, "plot": output.plot, "report": output.report}
    _check_ledger(resume, written)
    question = make_question(
        request, td_or_window, curve=bool(output.plot or output.report)
    )
    ledger = Ledger(resume, question) if resume is not None else None
    mark = compute_fingerprint(question)
    is_by_row = output.output_format == "ndjson"
    # Rows for standard output are printed as soon as they are known, those for a file at the end.
    is_streamed = is_by_row and output.file is None
    quiet = output.quiet or (is_streamed and sys.stdout.isatty())
    calls = len(sources) - _count_known(ledger, sources, quiet=output.quiet)
    rows = []
    with (
        _choose_farm(jobs, scheduler, calls, quiet=output.quiet) as farm,
        show_counting(len(sources), quiet=quiet) as count,
    ):
        for row in compute_rows(
            question, sources, farm, ledger, absolute=bool(scheduler), told=count.tell
        ):
            rows.append(row)
            if is_streamed:
                output.result(write_row(row, mark))
    lines = []
    if is_by_row and not is_streamed:
        lines = [write_row(row, mark) for row in rows]
    answer = answer_study(request, question, sources, rows)
    output.notes((), answer.cautions)
    output.spare(dict.fromkeys(stamp.name for row in rows for stamp in row.files))
    output.beside_answer(answer, lambda: answer.page(options.repeat_command()))
    output.answer(answer, lines=lines, question=answer.question)
    _finish_study(answer, output)


def _finish_study(answer: Study, output: Output) -> None:
    """Exit with the code that the answer requires, after a message that explains the code."""
    if not answer.judged:
        tell(
            f"d2rpick: no run could be judged; the first: {name_options(answer.runs[0].message or '')}"
        )
    if not answer.judged or any(row.status == INTERNAL_ERROR for row in answer.runs):
        click.get_current_context().exit(2)
    if answer.is_choice_refused and not output.exit_zero:
        tell("d2rpick: exit code 1: the verdict on the common tr is 'do not use'")
    output.finish(objection=answer.objection)


def _list_sources(names: Sequence[str], listed: str | None) -> tuple[str, ...]:
    """Return the runs named on the command line and in the list file; patterns are replaced with their matches."""
    from d2rpick.api.studies import find_runs

    sources = find_runs([*names, *(_read_list(listed) if listed is not None else ())])
    if not sources:
        if listed is None:
            where = ""
        else:
            where = f"{'standard input' if listed == '-' else listed} names none; "
        raise click.UsageError(
            f"no runs; {where}give their names, or a list with --from"
        )
    if all(_is_unmatched_pattern(source) for source in sources):
        raise FormatError(
            f"{list_names(sources)}: no file matches; check the name and the folder"
        )
    if "-" in sources:
        raise click.UsageError(
            "- cannot be a run: standard input cannot be passed to other processes"
        )
    return sources


def _is_unmatched_pattern(name: str) -> bool:
    """Return True for a name with wildcards that is not a file or folder and matches nothing."""
    return any(sign in name for sign in "*?[") and not os.path.lexists(name)


def _read_list(name: str) -> list[str]:
    """Return the names in a list file, one per line; blank lines and comments are skipped."""
    from pathlib import Path

    if name == "-" and sys.stdin is None:
        raise FormatError(
            "-: standard input is closed; give a file with one run per line"
        )
    try:
        content = sys.stdin.buffer.read() if name == "-" else Path(name).read_bytes()
    except OSError as error:
        raise FormatError(
            f"{name}: cannot be read ({error.strerror}); give a file with one run per line"
        ) from None
    if b"\0" in content:
        raise FormatError(
            f"{name}: holds NUL bytes; give a text file with one run per line"
        )
    # splitlines() is not used, because it also splits at characters that names may contain.
    lines = os.fsdecode(content).removeprefix("\ufeff").split("\n")
    names = [
        text for line in lines if (text := line.strip()) and not text.startswith("#")
    ]
    if len(names) > 1 and not any(map(_may_be_run, names)):
        raise FormatError(
            f"{name}: none of its {len(names)} lines names a file or folder, the first is {names[0]!r}; give a file "
            "with one run per line, or name a run without --from"
        )
    return names


def _may_be_run(name: str) -> bool:
    """Return True for a name that exists or is a pattern."""
    return os.path.lexists(name) or any(sign in name for sign in "*?[")


def _check_ledger(name: str | None, written: Mapping[str, str | None]) -> None:
    """Raise D2RPickError if a result would overwrite the file of ``--resume``; the keys of ``written`` are options."""
    if name is None:
        return
    for option, file in written.items():
        if file is not None and os.path.realpath(file) == os.path.realpath(name):
            raise D2RPickError(
                f"{name}: --resume and --{option} are the same file; give two files"
            )
    if os.path.exists(name) and os.path.samestat(os.stat(name), os.fstat(1)):  # noqa: PTH110, PTH116  pathlib would slow down start-up
        raise D2RPickError(
            f"{name}: --resume and standard output are the same file; send one elsewhere"
        )


def _count_known(ledger: Ledger | None, sources: Sequence[str], *, quiet: bool) -> int:
    """Print and return the number of runs whose rows come from an earlier study."""
    if ledger is None:
        return 0
    known_count = ledger.taking(sources)
    if (known_count or ledger.outdated or ledger.damaged) and not quiet:
        tell(f"note: {ledger.told(len(sources))}")
    return known_count


def _choose_farm(
    jobs: int | None, scheduler: str | None, calls: int, *, quiet: bool
) -> Farm:
    """Choose where the given number of calls is executed; a single call needs no separate process."""
    from d2rpick.base import workers

    if scheduler and calls:
        cluster = workers.Cluster(scheduler)
        if not cluster.threads and not quiet:
            tell(f"note: {scheduler}: no workers yet, waiting for some")
        return cluster
    return workers.choose_farm(
        min(jobs or workers.count_cores(), calls), "d2rpick.choice.runs.study"
    )


@options.make_command
@click.argument(
    "folders", metavar="RUN...", nargs=-1, required=True, type=choose_click_type("file")
)
@options.add_options(*RESULT, forms=FORMATS["calibration"])
def calibrate(folders: tuple[str, ...], output: Output) -> None:
    """Fit the cost of elements to the CPU times of your runs, for --weights.

    Each RUN is the folder of one run, with its deck and the listings of its solver: NAME_0001.out for Radioss (run with
    /MON/ON), or d3hsp or glstat for LS-DYNA.  Give runs of the same model with and without switching.  If the runs
    cannot distinguish the costs of two formulations, the built-in ratio of the two is kept.  A run that is named
    twice is used once.

    Examples
    --------
    d2rpick calibrate sample_data/flying_box
    d2rpick calibrate -f toml -o site.toml sample_data/flying_box
    """
    from d2rpick.api.costs import calibrate as fit
    from d2rpick.report.next_step import name_step_after_weights

    output = output.beside()
    answer = fit(folders)
    output.notes((), answer.cautions)
    output.answer(answer, question=RepeatedQuestion(files=folders))
    if output.file and output.output_format == "toml":
        output.next_step(name_step_after_weights(output.file))
