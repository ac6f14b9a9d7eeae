"""Where a command's results, notes and files go."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import click

from d2rpick.cli.wording import with_options
from d2rpick.errors import FORESEEN, D2RPickError, listing, one_line, printable
from d2rpick.files import write_whole

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from d2rpick.choice.warnings import Caution

OBJECTION = 1
# Formats that names of files promise.
_NAMED: Final = {".json": "json", ".ndjson": "ndjson", ".csv": "csv", ".md": "markdown"}
# What a report is often expected to be, and is not.
_PRINTED: Final = (".pdf", ".doc", ".docx")


class Output(NamedTuple):
    """Results to stdout or ``file``, everything else to stderr unless ``quiet``; ``inputs`` are never written to."""

    file: str | None
    overwrite: bool
    quiet: bool
    inputs: tuple[str, ...] = ()

    @classmethod
    def of(cls, options: dict[str, Any], *inputs: str) -> Output:
        """Take the options of ``file_options``; D2RPickError when a file to be written may not be."""
        file = None if options["output_file"] == "-" else options["output_file"]
        read = [options[name] for name in ("deck", "weights") if options.get(name)]
        output = cls(file, options["overwrite"], options["quiet"], (*inputs, *read))
        plot = options.get("plot")
        if plot is not None:
            from d2rpick.report import figures

            figures.picture_format(plot)
        _check_report(options.get("report"))
        names = {"--output-file": options["output_file"], "--plot": plot, "--report": options.get("report")}
        claimed: dict[str, str] = {}
        for option, name in names.items():
            if name is not None:
                output.claim(name)
                other = claimed.setdefault(os.path.realpath(name), option)
                if other != option:
                    raise D2RPickError(f"{name}: {option} and {other} are the same file; give two")
        is_result = "write_as" not in options  # of a history the name itself decides
        if file is not None and not output.quiet and is_result and (form := _meant(file)):
            tell(f"note: {file} gets the table; -f {form} writes what its name promises")
        return output

    def spare(self, inputs: Iterable[str]) -> None:
        """Raise D2RPickError when the result would replace one of further inputs, known only since they were read."""
        if self.file is not None:
            self._replace(inputs=tuple(inputs)).claim(self.file)

    def claim(self, name: str) -> None:
        """Raise D2RPickError when ``name`` cannot be written, is an input, or exists and was not to be replaced."""
        from pathlib import Path  # not above: --help does without it

        path = Path(name)
        if path.is_dir():
            raise D2RPickError(f"{name or repr(name)}: this is a folder; give a file in it")
        if not path.parent.is_dir():
            raise D2RPickError(f"{name}: no such folder: {str(path.parent)!r}; create it or give another one")
        if not path.exists():
            return
        if any(Path(source).exists() and path.samefile(source) for source in self.inputs):
            raise D2RPickError(f"{name}: this is an input; give another file for the output")
        if path.is_file() and not self.overwrite:
            raise D2RPickError(f"{name}: the file exists; give another one or --overwrite")

    def result(self, text: str) -> None:
        """Give out the result; on a terminal the line of the recommended candidate stands out."""
        content = text_bytes(text and f"{text}\n")
        if self.file is not None:
            self.write(self.file, content)
            return
        text = content.decode()
        colour = False if os.environ.get("NO_COLOR") else True if os.environ.get("FORCE_COLOR") else None
        lines = (click.style(line, bold=True) if line.startswith("*") else line for line in text.split("\n"))
        click.echo("\n".join(lines), nl=False, color=colour)

    def content(self, content: bytes) -> None:
        """Give out a result that is the content of a file."""
        if self.file is not None:
            self.write(self.file, content)
        else:
            click.echo(content, nl=False)

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
            write_whole(Path(name), content)
        except BrokenPipeError:
            raise
        except OSError as error:
            raise D2RPickError(f"{name}: cannot be written ({error.strerror}); give another file") from error


def _check_report(name: str | None) -> None:
    """Raise D2RPickError where a report would not be what its name says: it is an HTML page in a file."""
    if name == "-":
        raise D2RPickError("-: --report writes a file; give its name")
    if name is not None and name.lower().endswith(_PRINTED):
        raise D2RPickError(f"{name}: the report is an HTML page; name it .html, and print it to PDF in a browser")


def _meant(name: str) -> str | None:
    """Give the format that the name of a result promises, where the command has it and none was asked for."""
    ctx = click.get_current_context()
    if ctx.get_parameter_source("output_format") is not click.core.ParameterSource.DEFAULT:
        return None
    form = next((form for ending, form in _NAMED.items() if name.lower().endswith(ending)), None)
    (choice,) = [one.type for one in ctx.command.params if one.name == "output_format"]
    return form if isinstance(choice, click.Choice) and form in choice.choices else None


def tell(message: str) -> None:
    """Print a message of one line to stderr, with the options of the command line and without control codes."""
    click.echo(printable(with_options(message)), err=True)


def explained(error: BaseException, inputs: Sequence[str] = ()) -> str:
    """Say any error in one line, with the options of the command line; ``--debug`` shows its traceback before.

    ``inputs`` are named where nobody foresaw it, since it names none.
    """
    if click.get_current_context().meta.get("d2rpick.debug"):
        import traceback

        click.echo("".join(traceback.format_exception(error)), err=True, nl=False)
    if isinstance(error, FORESEEN):
        return with_options(one_line(error))
    return f"{listing(inputs)}{': ' * bool(inputs)}{one_line(error)}; --debug shows where"


def text_bytes(text: str) -> bytes:
    """Encode a text; bytes of file names that are none come as lone surrogates, which no encoding can write."""
    return text.encode(errors="surrogateescape").decode(errors="replace").encode()


def finish(ctx: click.Context, *, objection: bool, exit_zero: bool) -> None:
    """Exit with 1 when the answer is an objection, unless told otherwise."""
    if objection and not exit_zero:
        ctx.exit(OBJECTION)
