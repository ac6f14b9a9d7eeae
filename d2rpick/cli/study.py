"""The command ``study``."""

from __future__ import annotations

import os
import sys
from dataclasses import dataclass, replace
from functools import partial
from itertools import chain
from typing import TYPE_CHECKING, Any

import click

from d2rpick.cli import options as shared
from d2rpick.cli import typed
from d2rpick.cli.output import Output, finish, tell, text_bytes
from d2rpick.cli.progress import counting
from d2rpick.cli.wording import in_words, with_options
from d2rpick.errors import INTERNAL_ERROR, D2RPickError, FormatError
from d2rpick.report.formats import FORMATS, Shown, write

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from d2rpick.choice.study import Question, Study
    from d2rpick.choice.study_rows import StudyRow
    from d2rpick.workers import Farm

EXAMPLES = """\b
Examples:
  d2rpick study --td 0.064 sample_data/energy.csv sample_data/energy.glstat
  d2rpick study --td 0.064 --plot runs.png 'sample_data/energy.*'
  d2rpick study --td 0.37 --part box --resume runs.ndjson -f json sample_data/rolloverT01.gz
  d2rpick study --td 0.064 --tolerance 0.1 -f ndjson sample_data/energy.csv sample_data/energy.glstat
"""


@dataclass(frozen=True)
class Work:
    """Where runs are computed, and where finished ones are kept."""

    resume: str | None
    jobs: int | None
    scheduler: str | None
    quiet: bool

    @classmethod
    def of(cls, options: dict[str, Any]) -> Work:
        """Take the options as they were given; UsageError where they contradict each other."""
        if options["scheduler"] and options["jobs"]:
            raise click.UsageError("--scheduler and --jobs exclude each other: the cluster has its own processes")
        return cls(options["resume"], options["jobs"], options["scheduler"], options["quiet"])


@click.command("study", epilog=EXAMPLES)
@click.argument("run", metavar="RUN...", nargs=-1, type=shared.FILE)
@click.option(
    "--td", type=shared.TIME, metavar="T", cls=shared.Either, instead_of=("td_window",),
    help="Switch back to deformable at this time.",
)  # fmt: skip
@click.option(
    "--td-window", type=(shared.TIME, shared.TIME), metavar="LO HI", cls=shared.Either, instead_of=("td",),
    help="Let each run choose its time to switch back within this window.",
)  # fmt: skip
@click.option(
    "--from", "listed", envvar="D2RPICK_STUDY_FROM", metavar="LIST", type=shared.FILE,
    help="File with more names of runs, one per line; - is stdin.",
)  # fmt: skip
@click.option(
    "--resume", metavar="FILE", type=shared.FILE,
    help="Keep finished runs in FILE, and skip those that are in it and unchanged.",
)  # fmt: skip
@click.option(
    "--jobs", type=click.IntRange(min=1), metavar="N", cls=shared.Either, instead_of=("scheduler",),
    help="Number of processes.  [default: one per core]",
)  # fmt: skip
@click.option(
    "--scheduler", metavar="ADDRESS", cls=shared.Either, instead_of=("jobs",),
    help="Use a running Dask cluster, which must see the same files.",
)  # fmt: skip
@shared.reading_options
@shared.judging_options
@click.option("--plot", metavar="FILE", type=shared.FILE, help="Draw the energies of all runs to FILE (png, svg, pdf).")
@click.option(
    "--report", metavar="FILE", type=shared.FILE, help="Write all of it to one HTML page to read, print and sign."
)
@shared.output_options(*FORMATS["study"])
@click.pass_context
def command(ctx: click.Context, /, run: tuple[str, ...], output_format: str, exit_zero: bool, **options: Any) -> None:
    """Choose tr for many runs: how far they agree, and one tr for all of them.

    Each RUN is a file, a folder with the files of one run, or a pattern whose matches are runs.  One that cannot be
    read is listed in its row and does not stop the others.
    """
    from d2rpick.api.resume_file import fingerprint, line
    from d2rpick.choice.study import Question, summarise

    work, plot, report = Work.of(options), options["plot"], options["report"]
    td = _td(options["td"], options["td_window"])
    sources = _sources(run, options["listed"])
    output = Output.of(options, *sources)
    _check_ledger(work.resume, {"output-file": output.file, "plot": plot, "report": report})
    question = Question(
        td, shared.settings(options), shared.selection(options), options["input_format"],
        curve=bool(plot or report),
    )  # fmt: skip
    asked, rows = fingerprint(question), []
    by_line = output_format == "ndjson"
    streaming = by_line and output.file is None
    for row in _rows(question, sources, work, quiet=output.quiet or (streaming and sys.stdout.isatty())):
        rows.append(row)
        if streaming:
            output.result(line(row, asked))
    answer = summarise(question.td, rows)
    output.notes((), answer.cautions)
    _write_files(answer, plot, report, output._replace(inputs=_files_of(rows)))
    before = [line(row, asked) for row in rows] if by_line and not streaming else []
    text = write("study", output_format, answer, Shown(ctx.meta["d2rpick.command"], lines=before))
    output.result(in_words(text, output_format))
    if not answer.judged:
        tell(f"d2rpick: no run could be judged; the first: {rows[0].message or ''}")
        ctx.exit(2)
    if any(row.status == INTERNAL_ERROR for row in rows):
        ctx.exit(2)
    finish(ctx, objection=answer.objection, exit_zero=exit_zero)


def _td(td: float | None, window: tuple[float, float] | None) -> float | tuple[float, float]:
    """Give what is asked for, a time or a window; UsageError for neither, both, or an empty window."""
    if td is not None and window:
        raise click.UsageError("--td and --td-window exclude each other")
    if window and not window[0] < window[1]:
        raise click.UsageError(f"--td-window {window[0]:g} {window[1]:g} is empty; give the lower time first")
    asked = td if td is not None else window
    if asked is None:
        raise click.UsageError("name the time to switch back with --td, or a window for it with --td-window")
    return asked


def _sources(names: Sequence[str], listed: str | None) -> tuple[str, ...]:
    """Names of all runs, given and listed, patterns replaced by what they match."""
    from d2rpick.choice.study import find_runs

    sources = find_runs([*names, *(_listed(listed) if listed is not None else ())])
    if not sources:
        where = "" if listed is None else f"{'standard input' if listed == '-' else listed} names none; "
        raise click.UsageError(f"no runs; {where}give their names, or a list with --from")
    if "-" in sources:
        raise click.UsageError("- cannot be a run: standard input cannot be passed to other processes")
    return sources


def _listed(name: str) -> Iterator[str]:
    """Names in a list, one a line; blank lines and comments are skipped."""
    from pathlib import Path

    if name == "-" and sys.stdin is None:
        raise FormatError("-: standard input is closed; give a file with one run per line")
    try:
        content = sys.stdin.buffer.read() if name == "-" else Path(name).read_bytes()
    except OSError as error:
        raise FormatError(f"{name}: cannot be read ({error.strerror}); give a file with one run per line") from None
    if b"\0" in content:
        raise FormatError(f"{name}: holds NUL bytes; give a text file with one run per line")
    # Not splitlines(): a name may hold its other signs.
    for text in os.fsdecode(content).removeprefix("\ufeff").split("\n"):
        if (text := text.strip()) and not text.startswith("#"):
            yield text


def _check_ledger(name: str | None, written: Mapping[str, str | None]) -> None:
    """Raise D2RPickError when what ``--resume`` keeps would be overwritten by a result, ``written`` by its option."""
    if name is None:
        return
    for option, file in written.items():
        if file is not None and os.path.realpath(file) == os.path.realpath(name):
            raise D2RPickError(f"{name}: --resume and --{option} are the same file; give two files")
    if os.path.exists(name) and os.path.samestat(os.stat(name), os.fstat(1)):  # noqa: PTH110, PTH116
        raise D2RPickError(f"{name}: --resume and standard output are the same file; send one elsewhere")


def _files_of(rows: Sequence[StudyRow]) -> tuple[str, ...]:
    """Files that were read, those in folders too."""
    return tuple(dict.fromkeys(stamp.name for row in rows for stamp in row.files))


def _write_files(answer: Study, plot: str | None, report: str | None, output: Output) -> None:
    """Write figure and page where they are asked for; D2RPickError when one would replace a file that was read."""
    for name in (output.file, plot, report):
        if name is not None:
            output.claim(name)
    if plot is not None:
        from d2rpick.report import figures, figures_study

        output.write(plot, figures.render(figures_study.draw_study(answer), plot))
    if report is not None:
        from d2rpick.report.pages import study_page

        output.write(report, text_bytes(with_options(study_page(answer, typed.repeat()))))


def _rows(question: Question, sources: Sequence[str], work: Work, *, quiet: bool) -> Iterator[StudyRow]:
    """Rows in the order of the runs, each as soon as those before it are there."""
    from d2rpick.api.resume_file import Ledger
    from d2rpick.choice.study import ask, failed
    from d2rpick.workers import answers

    ledger = Ledger(work.resume, question) if work.resume is not None else None
    known = {number: row for number, source in enumerate(sources) if ledger and (row := ledger.find(source))}
    new = [number for number in range(len(sources)) if number not in known]
    if ledger and (ledger.taken or ledger.outdated or ledger.damaged) and not work.quiet:
        tell(f"note: {ledger.told(len(sources))}")
    # the processes of a cluster work in other folders
    names = [os.path.abspath(sources[n]) if work.scheduler else sources[n] for n in new]  # noqa: PTH100
    following = 0
    with _farm(work, len(new)) as farm, counting(len(sources), quiet=quiet) as count:
        count.done = count.taken = len(known)
        for answer in chain((None,), answers(farm, partial(ask, question), names)):
            if answer:
                number = new[answer.number]
                row = failed(sources[number], answer.error) if answer.error else answer.result
                known[number] = replace(row, source=sources[number])
                count.done += 1
                if ledger:
                    ledger.add(known[number])
            while following in known:
                yield known.pop(following)
                following += 1


def _farm(work: Work, calls: int) -> Farm:
    """Choose where to compute so many calls; a single one needs no other process."""
    from d2rpick import workers

    if work.scheduler and calls:
        cluster = workers.Cluster(work.scheduler)
        if not cluster.threads and not work.quiet:
            tell(f"note: {work.scheduler}: no workers yet, waiting for some")
        return cluster
    return workers.on_cores(min(work.jobs or workers.cores(), calls), "d2rpick.choice.study")
