"""Write the results, notes and files of a command to stdout, stderr or files."""

from __future__ import annotations

import os
import re
import sys
from contextlib import contextmanager
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Final, Protocol, TextIO

import click

from d2rpick.api.option_names import replace_arguments
from d2rpick.base.data_classes import dataclass
from d2rpick.base.errors import (
    FORESEEN,
    ArgumentError,
    D2RPickError,
    format_in_one_line,
    list_names,
    make_printable,
)
from d2rpick.base.files import write_as_a_whole
from d2rpick.base.options import UNLIMITED, make_option, make_option_name
from d2rpick.cli.progress import is_on_terminal, show_computing, show_reading

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Sequence

    from d2rpick.api.answer import Answer, Paged
    from d2rpick.api.cards import Cards
    from d2rpick.api.judged_cards import JudgedCard
    from d2rpick.api.request import Request
    from d2rpick.api.runs import Run
    from d2rpick.base.errors import Caution
    from d2rpick.report.formats import DisplayOptions, RepeatedQuestion


OBJECTION = 1
# Smallest terminal width to which a result is wrapped [columns].
_NARROWEST: Final = 40
# Output formats by the suffix of the file name.
_NAMED: Final = {".json": "json", ".ndjson": "ndjson", ".csv": "csv", ".md": "markdown"}
# Suffixes of unsupported files that users may expect for a report.
_PRINTED: Final = (".pdf", ".doc", ".docx")
# Suffixes of a report.
_PAGES: Final = (".html", ".htm", ".xhtml")
# Pattern of the result lines that are printed in bold: recommendations, verdicts, and findings of rules.
_VERDICTS: Final = "use|use with care|do not use|no pair to use|common tr"
_ANSWER: Final = rf"(?m)^(\* |(  )?({_VERDICTS})\b|  .*:\d+:\d+: (error|warning) D2R).*"
# Code of the warning about a truncated file.
_TRUNCATED: Final = "truncated-input"
_TRUNCATION: Final = "ends within"


# Output formats that already explain why nothing is recommended.
IN_WORDS: Final = {"table", "markdown"}


class VerdictOnPair(Protocol):
    """Verdict on a pair of times, which determines the exit code."""

    @property
    def verdict(self) -> str:
        """The verdict in words."""

    @property
    def grade(self) -> str:
        """Grade of the pair."""

    def reaches(self, grade: str) -> bool:
        """Return True if the pair has at least the given grade."""


@dataclass(eq=False, repr=False)
class Output:
    """Output that writes results to stdout or a file, and messages to stderr. It never overwrites ``inputs``."""

    plot: str | None = make_option(
        "Plot energy and motion, and write the figure to FILE (png, svg, pdf).",
        "output",
        "FILE",
    )
    report: str | None = make_option(
        "Write everything to one HTML page to read, print and sign.", "output", "FILE"
    )
    output_format: str = make_option(
        "Format of the result.", default="table", short=("-f",)
    )
    exit_zero: bool = make_option(
        "Exit with 0 instead of 1 if a problem was found.",
        "flag",
        default=False,
    )
    output_file: str | None = make_option(
        "Write the result to FILE, completely or not at all.",
        "output",
        "FILE",
        short=("-o",),
    )
    overwrite: bool = make_option("Replace existing files.", "flag", default=False)
    quiet: bool = make_option(
        "Print no notes or warnings to stderr.", "flag", default=False, short=("-q",)
    )
    limit: int = make_option(
        "Number of rows in the table; json and csv contain all.",
        range(1, UNLIMITED),
        default=3,
    )
    inputs: tuple[str, ...] = ()

    @property
    def file(self) -> str | None:
        """Name of the file for the result; None if the result goes to stdout."""
        return None if self.output_file == "-" else self.output_file

    @property
    def columns(self) -> int:
        """Width of the terminal on which the result is shown [columns]; 0 if it is not shown on a terminal."""
        return 0 if self.file else measure_columns(sys.stdout) or 0

    def beside(self, *inputs: str | None) -> Output:
        """Return an output that protects these inputs; raise D2RPickError if it would overwrite one of them."""
        output = replace(
            self, inputs=tuple(name for name in inputs if name not in (None, "-"))
        )
        if self.plot is not None:
            from d2rpick.report import figures

            figures.choose_picture_format(self.plot)
        claimed: dict[str, str] = {}
        for name in ("output_file", "plot", "report"):
            file = getattr(self, name)
            option_name = f"--{make_option_name(name)}"
            if file is not None:
                output.claim(file)
                other_option = claimed.setdefault(os.path.realpath(file), option_name)
                if other_option != option_name:
                    raise D2RPickError(
                        f"{file}: {option_name} and {other_option} are the same file; give two"
                    )
        _check_report(self.report)
        if (
            self.file is not None
            and not self.quiet
            and (form := _find_implied_format(self.file))
        ):
            tell(
                f"note: {self.file} gets the table; -f {form} writes what its name promises"
            )
        return output

    def check(self, cards: Cards, *, by_itself: bool = False) -> None:
        """Refuse card options if no card is requested, either ``by_itself`` or on a page."""
        if cards.given and not (
            by_itself or self.output_format == "card" or self.report is not None
        ):
            raise ArgumentError(
                f"--{make_option_name(cards.given[0])} is an option of the card; get one with -f card or --report FILE"
            )

    def shown(self, **further: Any) -> DisplayOptions:
        """Return what to show in addition to the answer."""
        from d2rpick.report.formats import DisplayOptions

        meta = click.get_current_context().meta
        display = DisplayOptions(
            meta["d2rpick.command"],
            self.limit,
            verbose=meta.get("d2rpick.verbose", False),
            **further,
        )
        return display._replace(width=self.columns or display.width)

    def answer(self, answer: Answer, below: str = "", **display_options: Any) -> None:
        """Write an answer in the requested format."""
        now = self.shown(**display_options)
        text = answer.text(self.output_format, now)
        if now.question.unused_deck and self.output_format in IN_WORDS:
            deck = make_printable(now.question.unused_deck)
            text = (
                f"{deck} was not used, because it is not the deck of this run\n{text}"
            )
        if below:
            text = f"{text}\n\n{below}"
        self.result(name_options_and_wrap(text, self.output_format, now.width))

    def beside_answer(self, answer: Paged, page: Callable[[], str]) -> None:
        """Write the figure and the page if the user requests them; on a terminal, show the progress."""
        with show_computing(quiet=self.quiet):
            if self.plot:
                from d2rpick.report import figures

                self.write(self.plot, figures.render(answer.plot(), self.plot))
            if self.report:
                self.write(self.report, encode_text(replace_arguments(page())))

    def finish(self, *, objection: bool) -> None:
        """Exit with code 1 if the answer is a failure, unless ``--exit-zero`` is given."""
        if objection and not self.exit_zero:
            click.get_current_context().exit(OBJECTION)

    def finish_by_verdict(
        self,
        decision: VerdictOnPair | None,
        min_quality: str,
        introduction: str = "",
    ) -> None:
        """Exit with code 1 if there is no pair or its grade is below ``min_quality``; a message states the grade.

        The message begins with the ``introduction``.
        """
        if decision is None or decision.reaches(min_quality):
            self.finish(objection=decision is None)
            return
        if not self.exit_zero:
            verdict = f"the verdict is {decision.verdict!r} (grade {decision.grade})"
            tell(
                f"d2rpick: exit code {OBJECTION}: {introduction}{verdict}; --min-quality {decision.grade} accepts it"
            )
        self.finish(objection=True)

    def spare(self, inputs: Iterable[str]) -> None:
        """Raise D2RPickError if an output file would replace an input that became known only after reading."""
        further = replace(self, inputs=tuple(inputs))
        for name in (self.file, self.plot, self.report):
            if name is not None:
                further.claim(name)

    def claim(self, name: str) -> None:
        """Raise D2RPickError if ``name`` cannot be written, is an input, or exists and must not be replaced."""
        from pathlib import Path  # Imported here to keep start-up fast.

        path = Path(name)
        if path.is_dir():
            raise D2RPickError(
                f"{name or repr(name)}: this is a folder; give a file in it"
            )
        if not path.parent.is_dir():
            raise D2RPickError(
                f"{name}: no such folder: {str(path.parent)!r}; create it or give another one"
            )
        if not path.exists():
            return
        if any(
            Path(source).exists() and path.samefile(source) for source in self.inputs
        ):
            raise D2RPickError(
                f"{name}: this is an input; give another file for the output"
            )
        if path.is_file() and not self.overwrite:
            raise D2RPickError(
                f"{name}: the file exists; give another one or --overwrite"
            )

    def result(self, text: str) -> None:
        """Write the result; on a terminal, the most important lines are bold."""
        content = encode_text(text and f"{text}\n")
        if self.file is not None:
            self.write(self.file, content)
            return
        text = content.decode()
        colour: bool | None = None
        if os.environ.get("NO_COLOR"):
            colour = False
        elif os.environ.get("FORCE_COLOR"):
            colour = True
        bold = re.sub(_ANSWER, lambda line: click.style(line[0], bold=True), text)
        click.echo(bold, nl=False, color=colour)

    def content(self, content: bytes) -> None:
        """Write the bytes of a result, such as a figure, to the result file or to stdout."""
        if self.file is not None:
            self.write(self.file, content)
        else:
            click.echo(content, nl=False)

    def card(
        self,
        judged_card: JudgedCard | None,
        cautions: Iterable[Caution],
        question: RepeatedQuestion,
        deck: str | None,
    ) -> bool:
        """Write a card, its warnings and the next step; return False if there is no card or a window did not pass.

        ``question`` and ``deck`` are those of the next command.
        """
        if judged_card is None:
            self.content(b"")
            return False
        self.notes(judged_card.card.notes, cautions)
        self.content(encode_text(replace_arguments(judged_card.card.text)))
        # Imported here to keep start-up fast.
        from d2rpick.report.next_step import name_step_after_card

        self.next_step(
            name_step_after_card(
                judged_card.card,
                judged_card.worst,
                question,
                deck,
                is_separate=any(
                    caution.code == "parts-not-joined"
                    for caution in judged_card.cautions
                ),
                has_errors=judged_card.has_errors,
            )
        )
        return judged_card.passed

    def next_step(self, step: str) -> None:
        """Print on stderr what to do with a result that goes to a file or to another program."""
        if not self.quiet:
            tell(f"next: {step}")

    def notes(self, notes: Iterable[str], cautions: Iterable[Caution]) -> None:
        """Print the warnings, and notes on what a reader omitted."""
        if self.quiet:
            return
        listed_cautions = list(cautions)
        is_truncated = any(caution.code == _TRUNCATED for caution in listed_cautions)
        for note in notes:
            if not (is_truncated and _TRUNCATION in note):
                tell(f"note: {note}")
        for caution in listed_cautions:
            tell(f"warning: {caution.code}: {caution.message}")

    def finish_without_deck(self, deck: str) -> None:
        """Exit with code 1, because the deck that the user named belongs to another model and was not used."""
        if not self.exit_zero:
            tell(
                f"d2rpick: exit code {OBJECTION}: {deck} was not used; give the deck of this run, or leave out --deck"
            )
        self.finish(objection=True)

    def finish_with_failed_comparison(self, *, is_incomplete: bool) -> None:
        """Exit with code 1, because the switched run disagrees with the reference run, or ended too early."""
        if not self.exit_zero:
            result = "is incomplete" if is_incomplete else "failed"
            tell(
                f"d2rpick: exit code {OBJECTION}: the comparison with the switched run {result}, which --min-quality "
                "does not accept"
            )
        self.finish(objection=True)

    def write(self, name: str, content: bytes) -> None:
        """Write a file completely or not at all; raise D2RPickError if the file cannot be written."""
        from pathlib import Path

        try:
            write_as_a_whole(Path(name), content)
        except BrokenPipeError:
            raise
        except OSError as error:
            raise D2RPickError(
                f"{name}: cannot be written ({error.strerror}); give another file"
            ) from error


def _check_report(name: str | None) -> None:
    """Raise D2RPickError if the file name of a report implies a format other than HTML."""
    if name == "-":
        raise D2RPickError("-: --report writes a file; give its name")
    if name is None:
        return
    stem, suffix = os.path.splitext(name)  # noqa: PTH122  pathlib would slow down start-up
    if suffix.lower() in _PRINTED:
        raise D2RPickError(
            f"{name}: the report is an HTML page; name it .html, and print it to PDF in a browser"
        )
    if suffix and suffix.lower() not in _PAGES:
        raise D2RPickError(f"{name}: the report is an HTML page; name it {stem}.html")


def _find_implied_format(name: str) -> str | None:
    """Return the format that a result's file name implies, if the command supports it and no format was given."""
    ctx = click.get_current_context()
    is_given = (
        ctx.get_parameter_source("output_format")
        is not click.core.ParameterSource.DEFAULT
    )
    # The command `extract` derives the format from the file name itself.
    if is_given or "write_as" in ctx.params:
        return None
    form = next(
        (form for ending, form in _NAMED.items() if name.lower().endswith(ending)), None
    )
    (choice,) = [
        format_type.type
        for format_type in ctx.command.params
        if format_type.name == "output_format"
    ]
    return form if isinstance(choice, click.Choice) and form in choice.choices else None


def measure_columns(stream: TextIO) -> int | None:
    """Return the width of a terminal, limited to a readable value; None if the stream is not a terminal."""
    columns_set = os.environ.get("COLUMNS", "")
    try:
        if columns_set.isdecimal():
            columns = int(columns_set)
        else:
            columns = os.get_terminal_size(stream.fileno()).columns
    except OSError:
        return None
    from d2rpick.report.formats import WIDEST

    return max(_NARROWEST, min(WIDEST, columns))


def tell(message: str) -> None:
    """Print a message to stderr, with options in place of argument names and without control codes.

    The message is one line; on a terminal it is wrapped, but never in a log, where ``COLUMNS`` may be set as well.
    """
    text = make_printable(replace_arguments(message))
    if is_on_terminal() and (width := measure_columns(sys.stderr)):
        # Imported here to keep start-up fast.
        from d2rpick.report.tables import wrap_lines

        text = wrap_lines(text, width)
    click.echo(text, err=True)


def explain_error(error: BaseException, inputs: Sequence[str] = ()) -> str:
    """Return any error as one line with options in place of argument names; ``--debug`` prints its traceback.

    An unforeseen error names no input, so that ``inputs`` are added.
    """
    if click.get_current_context().meta.get("d2rpick.debug"):
        import traceback

        click.echo("".join(traceback.format_exception(error)), err=True, nl=False)
    if isinstance(error, FORESEEN):
        return name_options(format_in_one_line(error))
    return f"{list_names(inputs)}{': ' * bool(inputs)}{format_in_one_line(error)}; --debug shows where"


def name_options(text: str) -> str:
    """Replace argument names with the options of the current command.

    A file that belongs to another option is named with this option, or without a cure if the command has none.
    """
    text = replace_arguments(text)
    for option in ("history", "deck"):
        cure = f", and this file as --{option}"
        if cure in text:
            text = text.replace(cure, _name_place(option))
    return text


def _name_place(name: str) -> str:
    """Return where the current command takes a history or a deck; empty if it takes none."""
    context = click.get_current_context()
    command: click.Command | None = context.command
    if isinstance(command, click.Group):
        command = command.get_command(context, context.invoked_subcommand or "")
    for parameter in command.params if command else ():
        if parameter.name == name:
            is_option = isinstance(parameter, click.Option)
            place = f"--{name}" if is_option else name.upper()
            return f", and this file as {place}"
    return ""


def encode_text(text: str) -> bytes:
    """Encode a string. Characters that cannot be encoded, as in some file names, are replaced."""
    return text.encode(errors="surrogateescape").decode(errors="replace").encode()


def name_options_and_wrap(text: str, form: str, width: int = 0) -> str:
    """Replace argument names with options in a result, and wrap a table to ``width`` columns.

    Examples
    --------
    >>> name_options_and_wrap("choose with `energy`", "table")
    'choose with --energy'
    """
    text = name_options(text)
    if form != "table" or not width:
        return text
    from d2rpick.report.tables import wrap_lines  # Imported here to keep start-up fast.

    return wrap_lines(text, width)


def check_switched(purpose: str, request: Request, cards: Cards) -> None:
    """Before any file is opened, refuse a card that switches no parts."""
    if not (request.part or cards.node):
        problem = f"{purpose} needs --part, the parts to switch (Radioss: --node, their main nodes)"
        way_to_pass = "d2rpick card --tr T --td T --part IDS --history FILE"
        raise ArgumentError(f"{problem}; where the history has no parts: {way_to_pass}")


@contextmanager
def open_with_output(
    request: Request, output: Output, *inputs: str | None
) -> Iterator[tuple[Run, Output]]:
    """Open the requested run, and yield it with an output that protects the run and further ``inputs``.

    Everything that reads from the run belongs inside this context.
    """
    from d2rpick.api.asked import open_requested_run

    request.selection()  # This call raises an error for contradictory options before any file is opened.
    with show_reading(request.history, quiet=output.quiet):
        run = open_requested_run(request)
        weights = request.weights if isinstance(request.weights, str) else None
        yield run, output.beside(*run.sources, request.deck, weights, *inputs)
