"""Provide the command line: a thin layer on top of the library, and the only place that prints or exits.

Commands are imported when they are called, and heavy modules inside the commands, so that ``--help`` stays fast.
"""

from __future__ import annotations

import importlib
import os
import re
import sys
from inspect import cleandoc
from typing import TYPE_CHECKING, Any, Final, NoReturn, TypeVar

import click

from d2rpick.base import __version__
from d2rpick.base.caching import cached_property
from d2rpick.base.errors import format_in_one_line, list_names

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

# Module and summary of each command, so that the help need not import the modules.
# Commands for one run come first, then commands for many runs and decks, then commands that compute runs.
_WORK: Final = {
    "info": ("contents", "Show what is in the files of a run."),
    "drive": (
        "running",
        "Run a Radioss model and switch its parts at the right times.",
    ),
    "plan": ("one_run", "Plan the rigid windows of all flights of a run."),
    "suggest": ("one_run", "Choose tr for a given td, or both times."),
    "explore": ("one_run", "Compare values of td: error, rigid time and saving."),
    "parts": ("one_run", "List which parts may be switched, and what that saves."),
    "verify": ("one_run", "Judge a pair of times, or a finished switched run."),
    "study": ("study", "Choose tr for many runs, and one tr for all."),
    "follow": (
        "running",
        "Watch a running computation: when the parts fly, when to switch.",
    ),
    "extract": ("contents", "Write the chosen energy as csv or hdf5."),
    "card": ("cards", "Print solver input for rigid windows."),
    "first": (
        "running",
        "Write a deck in which the solver chooses the switching times.",
    ),
    "check": ("decks", "Check the switches of decks, also against a run."),
    "rule": ("decks", "Explain a rule of check, or list all."),
    "calibrate": ("study", "Fit the cost of elements to your own runs."),
}
_EXPERIMENTS: Final = {
    "replay": ("models", "Compute the floating oscillator in closed form."),
    "rollover": ("models", "Compute a box that trips or falls, flies and lands."),
    "reproduce": ("models", "Reproduce the published results."),
}
COMMANDS: Final = _WORK | _EXPERIMENTS
COULD_NOT_RUN: Final = 2
BROKEN_PIPE: Final = 141  # Exit code that a shell reports if SIGPIPE ended the program.
_Made = TypeVar("_Made", bound=click.Command)
_LIBRARIES: Final = ("click", "numpy", "scipy", "pandas", "h5py", "matplotlib")
# Options of a pair of times.
_TIMES: Final = ("--tr", "--td")
# Largest difference in similarity between the best match for a mistyped option and others that are suggested [-].
_LESS_ALIKE: Final = 0.1
# Message of click on arguments that a command does not take.
_UNEXPECTED: Final = r"Got unexpected extra arguments? \((.*)\)"
_VERSIONS: Final = "Show the versions of d2rpick and of its libraries, and exit."


class _PipeClosed(Exception):  # noqa: N818  this is not an error: the reader of the pipe needs no more output
    """Exception that carries a BrokenPipeError past click, which would exit with 1, the code of a failed check."""


def _show_help(ctx: click.Context, _: click.Parameter, value: bool) -> None:
    if value and not ctx.resilient_parsing:
        click.echo(ctx.get_help(), color=ctx.color)
        ctx.exit()


class Documented(click.Command):
    """A command whose help ends with examples."""

    def get_help_option(self, ctx: click.Context) -> click.Option:  # noqa: ARG002  click passes the argument
        """Return d2rpick's own help option, because files on the user's system could change the language of click's."""
        return self._help

    @cached_property
    def _help(self) -> click.Option:
        flag: Any = {
            "is_flag": True,
            "is_eager": True,
            "expose_value": False,
            "allow_from_autoenv": False,
        }
        return click.Option(
            ["-h", "--help"],
            **flag,
            callback=_show_help,
            help="Show this message and exit.",
        )

    def format_epilog(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:  # noqa: ARG002  click passes the argument
        """Write the examples of a command, no wider than its help."""
        # Imported here to keep start-up fast.
        from d2rpick.report.tables import wrap_command

        lines = [
            wrap_command(f"  {line}", formatter.width)
            for line in (self.epilog or "").split("\n")
        ]
        formatter.write("\n" + "\n".join(lines) + "\n")


class _CommandGroup(Documented, click.Group):
    """Command group that loads commands on demand, and turns errors into messages and exit codes."""

    def list_commands(self, ctx: click.Context) -> list[str]:  # noqa: ARG002  click passes the argument
        return list(COMMANDS)

    def format_commands(
        self,
        ctx: click.Context,  # noqa: ARG002  click passes the argument
        formatter: click.HelpFormatter,
    ) -> None:
        for title, commands in (("Commands", _WORK), ("Experiments", _EXPERIMENTS)):
            with formatter.section(title):
                formatter.write_dl(
                    [(name, line) for name, (_, line) in commands.items()]
                )

    def get_command(self, ctx: click.Context, name: str) -> click.Command | None:  # noqa: ARG002  click passes the argument
        if name not in COMMANDS:
            return None
        command: click.Command = getattr(
            importlib.import_module(f"d2rpick.cli.{COMMANDS[name][0]}"), name
        )
        return command

    def resolve_command(self, ctx: click.Context, args: list[str]) -> Any:
        if not (
            args[0] in COMMANDS or args[0].startswith("-") or ctx.resilient_parsing
        ):
            import difflib

            close = difflib.get_close_matches(args[0], COMMANDS, n=1)
            if close:
                hint = f"Did you mean {close[0]!r}?"
            else:
                hint = f"The commands are {', '.join(COMMANDS)}."
            raise click.UsageError(f"No such command {args[0]!r}. {hint}", ctx)
        return super().resolve_command(ctx, args)

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        if not args and not ctx.resilient_parsing:
            click.echo(ctx.get_help(), err=True)
            ctx.exit(COULD_NOT_RUN)
        # A copy is kept, because click empties the original list.
        ctx.meta["d2rpick.command"] = tuple(args)
        return super().parse_args(ctx, args)

    def invoke(self, ctx: click.Context) -> Any:
        try:
            return super().invoke(ctx)
        except BrokenPipeError as error:
            raise _PipeClosed from error
        except (click.ClickException, click.exceptions.Exit, click.Abort):
            raise
        except Exception as error:  # For any error, the user gets a one-line message.
            if _is_interrupt(error):
                raise click.Abort from None
            from d2rpick.cli.output import explain_error

            raise click.ClickException(
                explain_error(error, ctx.meta.get("d2rpick.history", ()))
            ) from error

    def main(  # type: ignore[override]  # click parameters that are not needed are omitted
        self,
        args: Sequence[str] | None = None,
        prog_name: str | None = None,
        **extra: Any,
    ) -> NoReturn:
        extra["standalone_mode"] = False
        try:
            code = super().main(args, prog_name or "d2rpick", **extra)
        except click.UsageError as error:
            where = f" (see '{error.ctx.command_path} --help')" if error.ctx else ""
            stop_with_error(_format_usage_error(error).rstrip(".") + where)
        except click.ClickException as error:
            stop_with_error(error.format_message())
        except OSError as error:  # The help or the version could not be written.
            stop_with_error(format_in_one_line(error))
        except click.Abort:  # click converts an interrupt to Abort.
            _tell_error("interrupted")
            raise KeyboardInterrupt from None
        except _PipeClosed:
            # Writing to os.devnull prevents Python from reporting an error when it closes the stream at exit.
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
            sys.exit(BROKEN_PIPE)
        sys.exit(code if isinstance(code, int) else 0)


def _format_usage_error(error: click.UsageError) -> str:
    """Return the message of a usage error; for an unknown option, it suggests the options that resemble it most."""
    if isinstance(error, click.BadOptionUsage) and "requires an argument" in str(error):
        return _ask_for_value(error)
    if unexpected := re.fullmatch(_UNEXPECTED, error.message):
        return _place_unexpected(error, unexpected[1])
    if not isinstance(error, click.NoSuchOption):
        return error.format_message()
    problem = error.message.rstrip(".")
    word = error.option_name.lstrip("-")
    if error.ctx and any(
        isinstance(parameter, click.Argument) and parameter.name == word
        for parameter in error.ctx.command.params
    ):
        return f"{problem}. Give the {word} by its name alone, without an option"
    if error.ctx and isinstance(error.ctx.command, click.Group):
        near = _suggest_alike(error.option_name, error.possibilities or ())
        if near:
            return f"{problem}. Did you mean {near}?"
        return f"{problem} before the command; give the options of a command after its name"
    same = error.option_name.lower()
    if error.ctx and any(same in option.opts for option in error.ctx.command.params):
        return f"{problem}. Did you mean {same!r}?"
    if not error.possibilities:
        return error.format_message()
    if error.ctx and error.ctx.command.name == "plan" and error.option_name == "--td":
        return f"{problem}. d2rpick plan chooses td itself; d2rpick suggest chooses tr for a given td"
    if error.ctx and error.ctx.command.name == "check" and error.option_name in _TIMES:
        return f"{problem}. The times are those of the deck; d2rpick verify judges other times"
    if error.option_name == "--tr":
        return f"{problem}. d2rpick verify judges a given tr with its td"
    commands = _list_commands_with_option(error)
    if commands:
        return f"{problem}. It is an option of {list_names(commands, most=3)}"
    return f"{problem}. Did you mean {_suggest_alike(error.option_name, error.possibilities)}?"


def _suggest_alike(wanted: str, options: Iterable[str]) -> str:
    """Return the options whose spelling is closest to a mistyped option, joined by "or"; empty without options."""
    import difflib

    likeness = {
        name: difflib.SequenceMatcher(None, wanted, name).ratio() for name in options
    }
    best = max(likeness.values(), default=0.0)
    nearest = [name for name in likeness if likeness[name] >= best - _LESS_ALIKE]
    return " or ".join(map(repr, sorted(nearest, key=lambda name: -likeness[name])))


def _place_unexpected(error: click.UsageError, words: str) -> str:
    """Return the message on words that a command does not take, with the place where it takes a file."""
    if error.ctx is None:
        return error.format_message()
    command = error.ctx.command
    names = [option.name for option in command.params if option.name != "help"]
    taken = [
        parameter.make_metavar(error.ctx)
        for parameter in command.params
        if isinstance(parameter, click.Argument)
    ]
    if taken:
        problem = f"{words}: unexpected, because d2rpick {command.name} takes one {' '.join(taken)}"
    else:
        problem = (
            f"{words}: unexpected, because d2rpick {command.name} takes options only"
        )
    if "history" in names:
        return f"{problem}; give a history as --history {words}"
    if "RUN" in taken:
        return f"{problem}; if these are files of one run, give their folder"
    return f"{problem}; leave it out, or put quotes around a name with spaces"


def _list_commands_with_option(error: click.NoSuchOption) -> list[str]:
    """Return the names of the other commands that have an unknown option."""
    context = error.ctx.parent if error.ctx else None
    if context is None or not isinstance(context.command, click.Group):
        return []
    named = (
        (name, context.command.get_command(context, name))
        for name in context.command.list_commands(context)
    )
    return [
        f"d2rpick {name}"
        for name, command in named
        if command
        and any(error.option_name in option.opts for option in command.params)
    ]


def _ask_for_value(error: click.BadOptionUsage) -> str:
    """Return the message on an option without its value, with what the option means."""
    parameters = error.ctx.command.params if error.ctx else []
    for option in parameters:
        if isinstance(option, click.Option) and error.option_name in option.opts:
            meaning = (option.help or "").partition(".")[0]
            return f"{error.option_name} needs a value: {meaning}"
    return error.format_message()


def _is_interrupt(error: BaseException | None) -> bool:
    """Return True if an interrupt caused the error. Python replaces an interrupt while it creates a class."""
    while error and not isinstance(error, KeyboardInterrupt):
        error = error.__cause__ or error.__context__
    return error is not None


def stop_with_error(message: str) -> NoReturn:
    """Print an error message and exit with code 2."""
    _tell_error(message)
    sys.exit(COULD_NOT_RUN)


def _tell_error(message: str) -> None:
    from d2rpick.cli.output import tell

    tell(f"d2rpick: {message}")


def _print_versions(ctx: click.Context, _: click.Parameter, value: bool) -> None:
    """Print the versions that a bug report needs."""
    if not value or ctx.resilient_parsing:
        return
    from importlib.metadata import PackageNotFoundError, version
    from platform import platform, python_version

    click.echo(f"d2rpick, version {__version__}")
    click.echo(f"Python {python_version()}, {platform()}")
    for library in _LIBRARIES:
        try:
            click.echo(f"{library} {version(library)}")
        except PackageNotFoundError:
            click.echo(f"{library} is not installed")
    ctx.exit()


def make_documented(cls: type[_Made], **settings: Any) -> Callable[[Any], _Made]:
    """Make a command from a function whose docstring is the help text, with examples at the end."""

    def made(function: Any) -> _Made:
        help_text, _, examples = cleandoc(function.__doc__).partition(
            "\n\nExamples\n--------\n"
        )
        # In the examples, each command is on one line.
        lines = examples.replace("\\\n    ", "").split("\n")
        epilog = "\n".join(["Examples:", *(f"  {line}" for line in lines)])
        return click.command(
            function.__name__, cls=cls, help=help_text, epilog=epilog, **settings
        )(function)

    return made


@make_documented(
    _CommandGroup,
    context_settings={"auto_envvar_prefix": "D2RPICK", "max_content_width": 100},
)
@click.option(
    "--version",
    is_flag=True,
    is_eager=True,
    expose_value=False,
    callback=_print_versions,
    help=_VERSIONS,
)
def d2rpick() -> None:
    """Choose the times of deformable-to-rigid switching from the internal energy of one reference run.

    Examples
    --------
    d2rpick plan --part flying sample_data/rollover_box.matsum
    d2rpick suggest --td 0.064 sample_data/energy.csv
    d2rpick check sample_data/switching.k --history sample_data/energy.glstat
    d2rpick plan --help
    """
