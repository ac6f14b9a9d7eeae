"""Where a command's results, notes and files go."""

from __future__ import annotations

import os
import re
import sys
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Final, TextIO

import click

from d2rpick.api.cards import Cards, JudgedCard
from d2rpick.api.request import OPTIONS, UNLIMITED, Request, dashed, option, options_of
from d2rpick.base.errors import (
    FORESEEN,
    ArgumentError,
    D2RPickError,
    format_in_one_line,
    list_names,
    make_printable,
)
from d2rpick.base.files import write_as_a_whole
from d2rpick.cli.progress import on_terminal, reading

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Sequence

    from d2rpick.api.answer import Answer, Paged
    from d2rpick.api.runs import Run
    from d2rpick.base.errors import Caution
    from d2rpick.report.formats import Shown


OBJECTION = 1
# A terminal of fewer columns is none that tables are read on.
_NARROWEST: Final = 40
# Formats that names of files promise.
_NAMED: Final = {".json": "json", ".ndjson": "ndjson", ".csv": "csv", ".md": "markdown"}
# What a report is often expected to be, and is not.
_PRINTED: Final = (".pdf", ".doc", ".docx")
# Lines of a result that stand out: what is recommended or judged, and what a deck is to be changed for.
_VERDICTS: Final = "use|use with care|do not use|no pair to use|common tr"
_ANSWER: Final = rf"(?m)^(\* |({_VERDICTS})\b|  .*:\d+:\d+: (error|warning) D2R).*"


# Arguments that messages name in backticks, and which options set them where these have other names.
ARGUMENTS: Final = (
    *OPTIONS,
    *options_of(Cards),
    *(
        "td",
        "td_window",
        "tr",
        "min_rigid",
        "overwrite",
        "write_as",
        "done",
        "before",
        "wait",
        "min_mean_energy",
    ),
)
_OTHERS: Final = {
    "parts": "part",
    "channels": "channel",
    "replay": "no_verify",
    "run": "history",
}
_FOR_PROGRAMS: Final = {"json", "ndjson", "csv", "value"}
IN_WORDS: Final = {
    "table",
    "markdown",
}  # forms in which the answer says itself why nothing is recommended


@dataclass(eq=False, repr=False)
class Output:
    """Results to stdout or a file, everything else to stderr unless ``quiet``; ``inputs`` are never written to."""

    plot: str | None = option(
        "Draw energy and motion to FILE (png, svg, pdf).", "output", "FILE"
    )
    report: str | None = option(
        "Write everything to one HTML page to read, print and sign.", "output", "FILE"
    )
    output_format: str = option("Format of the result.", default="table", short=("-f",))
    exit_zero: bool = option(
        "Exit with 0 instead of 1 when the answer is an objection.",
        "flag",
        default=False,
    )
    output_file: str | None = option(
        "Write the result to FILE, completely or not at all.",
        "output",
        "FILE",
        short=("-o",),
    )
    overwrite: bool = option("Replace existing files.", "flag", default=False)
    quiet: bool = option(
        "Print no notes and warnings to stderr.", "flag", default=False, short=("-q",)
    )
    limit: int = option(
        "Number of rows in the table; json and csv have all.",
        range(1, UNLIMITED),
        default=3,
    )
    inputs: tuple[str, ...] = ()

    @property
    def file(self) -> str | None:
        """Where the result goes; None for stdout."""
        return None if self.output_file == "-" else self.output_file

    @property
    def columns(self) -> int:
        """Columns of the terminal that the result goes to; 0 where it goes to none."""
        return 0 if self.file else columns_of(sys.stdout) or 0

    def beside(self, *inputs: str | None) -> Output:
        """Give what writes beside these inputs; D2RPickError when a file to be written may not be."""
        output = replace(
            self, inputs=tuple(name for name in inputs if name not in (None, "-"))
        )
        if self.plot is not None:
            from d2rpick.report import figures

            figures.picture_format(self.plot)
        _check_report(self.report)
        claimed: dict[str, str] = {}
        for name in ("output_file", "plot", "report"):
            file, named = getattr(self, name), f"--{dashed(name)}"
            if file is not None:
                output.claim(file)
                other = claimed.setdefault(os.path.realpath(file), named)
                if other != named:
                    raise D2RPickError(
                        f"{file}: {named} and {other} are the same file; give two"
                    )
        if self.file is not None and not self.quiet and (form := _meant(self.file)):
            tell(
                f"note: {self.file} gets the table; -f {form} writes what its name promises"
            )
        return output

    def check(self, cards: Cards, *, by_itself: bool = False) -> None:
        """Refuse options of a card where none is asked for, ``by_itself`` or in a page."""
        if cards.given and not (
            by_itself or self.output_format == "card" or self.report is not None
        ):
            raise ArgumentError(
                f"--{dashed(cards.given[0])} is about the card; ask for one with -f card or --report"
            )

    def shown(self, **more: Any) -> Shown:
        """Give what a form may show beside the answer."""
        from d2rpick.report.formats import Shown

        meta = click.get_current_context().meta
        shown = Shown(
            meta["d2rpick.command"],
            self.limit,
            verbose=meta.get("d2rpick.verbose", False),
            **more,
        )
        return shown._replace(width=self.columns or shown.width)

    def answer(self, answer: Answer, below: str = "", **shown: Any) -> None:
        """Give out an answer in the form that is asked for."""
        now = self.shown(**shown)
        text = in_words(
            answer.text(self.output_format, now), self.output_format, now.width
        )
        self.result(f"{text}\n\n{below}" if below else text)

    def beside_answer(self, answer: Paged, page: Callable[[], str]) -> None:
        """Write the figure and the page, as far as they are asked for."""
        if self.plot:
            from d2rpick.report import figures

            self.write(self.plot, figures.render(answer.plot(), self.plot))
        if self.report:
            self.write(self.report, text_bytes(with_options(page())))

    def finish(self, *, objection: bool) -> None:
        """Exit with 1 if the answer is an objection, unless told otherwise."""
        if objection and not self.exit_zero:
            click.get_current_context().exit(OBJECTION)

    def spare(self, inputs: Iterable[str]) -> None:
        """Raise D2RPickError when a file would replace one of further inputs, known only since they were read."""
        further = replace(self, inputs=tuple(inputs))
        for name in (self.file, self.plot, self.report):
            if name is not None:
                further.claim(name)

    def claim(self, name: str) -> None:
        """Raise D2RPickError when ``name`` cannot be written, is an input, or exists and was not to be replaced."""
        from pathlib import Path  # not above: --help does without it

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
        """Give out the result; on a terminal the lines of the answer stand out."""
        content = text_bytes(text and f"{text}\n")
        if self.file is not None:
            self.write(self.file, content)
            return
        text = content.decode()
        colour = (
            False
            if os.environ.get("NO_COLOR")
            else True
            if os.environ.get("FORCE_COLOR")
            else None
        )
        bold = re.sub(_ANSWER, lambda line: click.style(line[0], bold=True), text)
        click.echo(bold, nl=False, color=colour)

    def content(self, content: bytes) -> None:
        """Give out a result that is the content of a file."""
        if self.file is not None:
            self.write(self.file, content)
        else:
            click.echo(content, nl=False)

    def card(self, found: JudgedCard | None, cautions: Iterable[Caution]) -> bool:
        """Give out the card of an answer with what is to be told of it; False where there is none or one fails."""
        if found is None:
            self.content(b"")
            return False
        self.notes(found.card.notes, cautions)
        self.content(found.card.text.encode())
        return found.passed

    def notes(self, notes: Iterable[str], cautions: Iterable[Caution]) -> None:
        """Say what a reader left out, and what the user should know."""
        if self.quiet:
            return
        for note in notes:
            tell(f"note: {note}")
        for caution in cautions:
            tell(f"warning: {caution.code}: {caution.message}")

    def write(self, name: str, content: bytes) -> None:
        """Write a file whole or not at all; D2RPickError where it cannot be written."""
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
    """Raise D2RPickError where a report would not be what its name says: it is an HTML page in a file."""
    if name == "-":
        raise D2RPickError("-: --report writes a file; give its name")
    if name is not None and name.lower().endswith(_PRINTED):
        raise D2RPickError(
            f"{name}: the report is an HTML page; name it .html, and print it to PDF in a browser"
        )


def _meant(name: str) -> str | None:
    """Give the format that the name of a result promises, where the command has it and none was asked for."""
    ctx = click.get_current_context()
    given = (
        ctx.get_parameter_source("output_format")
        is not click.core.ParameterSource.DEFAULT
    )
    if given or "write_as" in ctx.params:  # of a history the name itself decides
        return None
    form = next(
        (form for ending, form in _NAMED.items() if name.lower().endswith(ending)), None
    )
    (choice,) = [one.type for one in ctx.command.params if one.name == "output_format"]
    return form if isinstance(choice, click.Choice) and form in choice.choices else None


def columns_of(stream: TextIO) -> int | None:
    """Columns of the terminal that a stream writes to, as many as are read at a glance; None where there is none."""
    given = os.environ.get("COLUMNS", "")
    try:
        columns = (
            int(given)
            if given.isdecimal()
            else os.get_terminal_size(stream.fileno()).columns
        )
    except OSError:
        return None
    from d2rpick.report.formats import WIDEST

    return max(_NARROWEST, min(WIDEST, columns))


def tell(message: str) -> None:
    """Print a message to stderr, with the options of the command line and without control codes.

    It is one line, on a terminal broken where that ends; never in a log, where ``COLUMNS`` may be set as well.
    """
    text = make_printable(with_options(message))
    if on_terminal() and (width := columns_of(sys.stderr)):
        from d2rpick.report.tables import wrapped  # not above: --help does without it

        text = wrapped(text, width)
    click.echo(text, err=True)


def explained(error: BaseException, inputs: Sequence[str] = ()) -> str:
    """Say any error in one line, with the options of the command line; ``--debug`` shows its traceback before.

    ``inputs`` are named where nobody foresaw it, since it names none.
    """
    if click.get_current_context().meta.get("d2rpick.debug"):
        import traceback

        click.echo("".join(traceback.format_exception(error)), err=True, nl=False)
    if isinstance(error, FORESEEN):
        return with_options(format_in_one_line(error))
    return f"{list_names(inputs)}{': ' * bool(inputs)}{format_in_one_line(error)}; --debug shows where"


def text_bytes(text: str) -> bytes:
    """Encode a text; bytes of file names that are none come as lone surrogates, which no encoding can write."""
    return text.encode(errors="surrogateescape").decode(errors="replace").encode()


def with_options(message: str) -> str:
    """Replace the arguments that a message names by the options that set them.

    Examples
    --------
    >>> with_options("give it as `after` where it is known")
    'give it as --after where it is known'
    """
    named = "`" in message
    return (
        re.sub(r"`(\w+)`", lambda found: option_of(found[1]) or found[0], message)
        if named
        else message
    )


def option_of(argument: str) -> str:
    """Spell the option that sets an argument; nothing where there is none."""
    name = _OTHERS.get(argument, argument)
    return f"--{dashed(name)}" if name in ARGUMENTS else ""


def in_words(text: str, form: str, width: int = 0) -> str:
    """Name the options in a result that people read, with lines of ``width`` columns; other programs get the arguments.

    Examples
    --------
    >>> in_words("choose with `energy`", "table"), in_words("choose with `energy`", "json")
    ('choose with --energy', 'choose with `energy`')
    """
    if form in _FOR_PROGRAMS:
        return text
    text = with_options(text)
    if form != "table" or not width:
        return text
    from d2rpick.report.tables import wrapped  # not above: --help does without it

    return wrapped(text, width)


def check_switched(what: str, request: Request, cards: Cards) -> None:
    """Refuse a card that switches nobody, before a file is opened."""
    if not (request.part or cards.node):
        found = f"{what} needs --part, the parts to switch (Radioss: --node, their main nodes)"
        way = "d2rpick card --tr T --td T --part IDS --history FILE"
        raise ArgumentError(f"{found}; where the history has no parts: {way}")


@contextmanager
def opened(
    request: Request, output: Output, *inputs: str | None
) -> Iterator[tuple[Run, Output]]:
    """Open the run that is asked about and give it with what writes beside it and further ``inputs``.

    What reads of it belongs inside.
    """
    from d2rpick.api.asked import open_run

    request.selection()  # refuses what makes no sense together, before a file is opened
    with reading(request.history, quiet=output.quiet):
        run = open_run(request)
        weights = request.weights if isinstance(request.weights, str) else None
        yield run, output.beside(*run.sources, request.deck, weights, *inputs)
