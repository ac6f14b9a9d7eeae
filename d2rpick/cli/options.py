"""Options of the commands, made from the tables of what can be asked; ``--show-settings``, and the line to repeat."""

from __future__ import annotations

import os
from functools import cache, wraps
from typing import TYPE_CHECKING, Any, Final

import click
from click.core import ParameterSource

from d2rpick.api.cards import Cards
from d2rpick.api.request import (
    CHOOSING,
    JUDGING,
    OSCILLATOR,
    READING,
    TIME,
    Option,
    Request,
    dashed,
    options_of,
)
from d2rpick.base.errors import ArgumentError
from d2rpick.base.settings import find_nearest_settings
from d2rpick.cli import Documented, documented
from d2rpick.cli.output import Output, tell, text_bytes, with_options
from d2rpick.cli.values import CARDS, click_type, settings_of, spelled, words_of

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Sequence

    from d2rpick.api.runs import Run

WINDOW = tuple[float, float] | None
Decorated = Any  # a command function; click's decorators do not say more
TABLES: Final[tuple[Any, ...]] = (Request, Cards, Output)
FILES: Final = ("output_file", "overwrite", "quiet")
RESULT: Final = ("output_format", "exit_zero", *FILES)
HISTORY: Final = "HISTORY"  # stands for the argument, not the option of that name
ONE_RUN: Final = ("deck", "no_deck", "weights", HISTORY, *READING, *CHOOSING)
REFERENCE: Final = ("history", *JUDGING)
ANSWER: Final = ("plot", "report", *CARDS, *RESULT)
DECK: Final = (
    "Main deck of the run (LS-DYNA, or a starter or engine file of Radioss): gives the cost of the parts, "
    "and which of them become one rigid body"
)
DECK_OF_PARTS: Final = (
    f"{DECK}; `--part recommended` stands for the set that d2rpick parts recommends."
)
# Sections of the help, behind the options of a command that are in none.
GROUPS: Final[dict[str, tuple[str, ...]]] = {
    "Times": (
        *(
            "tr",
            "td",
            "td_window",
            "steps",
            "min_rigid",
            "after",
            "landing",
            "margin",
            "wait",
        ),
        *(
            "tolerance",
            "max_kinetic_share",
            "max_residual",
            "min_mean_energy",
            "strict",
            "keep_vibration",
            "min_quality",
        ),
    ),
    "What to read": ("history", "switched", "from", *READING, "done", "before"),
    "Deck and cost": ("deck", "no_deck", "weights", "write_deck"),
    "Cards": CARDS,
    "Output": (
        "all",
        "limit",
        "plot",
        "report",
        *RESULT,
        "verbose",
        "show_settings",
        "debug",
        "help",
    ),
    "Advanced": (*OSCILLATOR, "fit_window", "no_verify", "cost_share", "step_ratio"),
}
# Options that write files, which the same command would find the next time.
_WRITTEN: Final = ("output_file", "plot", "report", "write_deck")
_SOURCES: Final = {
    ParameterSource.COMMANDLINE: "command line",
    ParameterSource.ENVIRONMENT: "environment",
    ParameterSource.DEFAULT_MAP: "settings",
}


class Command(Documented):
    """A command that can show its settings instead of running, and names options where arguments make no sense."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Read the command line; what neither it nor the environment gives, the settings may."""
        if ctx.resilient_parsing:
            return super().parse_args(ctx, args)
        table, source, ctx.meta["d2rpick.unused"] = find_nearest_settings(os.curdir)
        ctx.meta["d2rpick.settings"] = source
        if table:
            without = click.Context(
                self, ctx.parent, ctx.info_name, resilient_parsing=True
            )
            super().parse_args(without, list(args))
            ctx.default_map = settings_of(ctx, without, table, source)
        rest = super().parse_args(ctx, args)
        if words := words_of(ctx):
            ctx.meta["d2rpick.command"] = inserted(ctx.meta["d2rpick.command"], words)
        return rest

    def format_options(
        self, ctx: click.Context, formatter: click.HelpFormatter
    ) -> None:
        """Write the options in groups, each where it is looked for."""
        shown = (one for one in self.get_params(ctx) if isinstance(one, click.Option))
        records = {
            spelled(one).replace("-", "_"): one.get_help_record(ctx) for one in shown
        }
        grouped = {name for names in GROUPS.values() for name in names}
        for title, names in {
            "Options": [one for one in records if one not in grouped],
            **GROUPS,
        }.items():
            if rows := [record for name in names if (record := records.get(name))]:
                with formatter.section(title):
                    formatter.write_dl(rows)

    def invoke(self, ctx: click.Context) -> Any:
        """Run the command; UsageError for what makes no sense together."""
        if not ctx.params.get("quiet"):
            for note in ctx.meta["d2rpick.unused"]:
                tell(f"note: {note}")
        if ctx.meta.get("d2rpick.show-settings"):
            return click.echo(text_bytes("\n".join(_settings(ctx))))
        if (words := words_of(ctx)) and not ctx.params.get("quiet"):
            import shlex  # not above: start-up

            tell(f"note: {shlex.join(words)} by {ctx.meta['d2rpick.settings']}")
        # Numpy before the modules of a run: its import makes many calls, and as deep as theirs each may meet the end of
        # a piece of the stack of Python 3.11, which maps memory for it and unmaps it again.
        if ctx.params.get("history"):
            import numpy as np  # noqa: F401
        try:
            return super().invoke(ctx)
        except ArgumentError as error:
            raise click.UsageError(with_options(str(error)), ctx) from error


class Either(click.Option):
    """An option that excludes others: what the environment says of it gives way to those on the command line."""

    def __init__(self, *args: Any, instead_of: Sequence[str], **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self.instead_of = instead_of

    def consume_value(
        self, ctx: click.Context, opts: Any
    ) -> tuple[Any, ParameterSource]:
        """Find the value and its source; click has done so before for all that is on the command line."""
        value, source = super().consume_value(ctx, opts)
        typed = (
            ctx.get_parameter_source(name) is ParameterSource.COMMANDLINE
            for name in self.instead_of
        )
        if source is ParameterSource.ENVIRONMENT and any(typed):
            return self.get_default(ctx), ParameterSource.DEFAULT
        return value, source


def command(function: Decorated) -> click.Command:
    """Make a command of a function."""
    return documented(Command)(function)


def takes(
    *names: str, of: Sequence[Any] = TABLES, forms: Iterable[str] = (), **other: Any
) -> Callable[[Decorated], Decorated]:
    """Give a command options of tables, passed on as one object for each, by the name of its class in small letters.

    Parameters
    ----------
    *names : str
        Of options, in the order of the help.
    of : sequence of classes
        The tables.
    forms : str
        Forms of the result, the first by default.
    **other : str or dict
        Of an option by its name: the help of this command, or what click is told otherwise.
    """
    tables = {table: [one for one in names if one in options_of(table)] for table in of}
    if HISTORY in names:
        tables[Request].append("history")
    if choices := list(forms):
        about = {
            "type": click.Choice(choices),
            "default": choices[0],
            "show_default": True,
        }
        other["output_format"] = about

    def decorate(function: Decorated) -> Decorated:
        @wraps(function)
        def run(*args: Any, **values: Any) -> Any:
            ctx = click.get_current_context()
            if "history" in values:
                ctx.meta["d2rpick.history"] = values["history"]
            given = {
                name
                for name in values
                if ctx.get_parameter_source(name) is not ParameterSource.DEFAULT
            }
            for table, taken in tables.items():
                if taken:
                    more = {"given": given & {*taken}} if table is Request else {}
                    values[table.__name__.lower()] = table(
                        **{name: values.pop(name) for name in taken}, **more
                    )
            if "no_deck" in names:
                from d2rpick.api.deck_in_folder import find_deck_in_folder

                values["request"] = find_deck_in_folder(values["request"])
            return function(*args, **values)

        if "quiet" in names:
            for flag in _FLAGS:
                run = flag(run)
        for name in reversed(names):
            as_in_table = of is TABLES and name not in other
            run = (
                _as_in_table(name)
                if as_in_table
                else _decorator(of, name, other.get(name, {}))
            )(run)
        return run

    return decorate


def _shared(
    decorate: Callable[[Decorated], Decorated],
) -> Callable[[Decorated], Decorated]:
    """Give all commands the same object of an option: a module has commands, of which one is called."""
    made = decorate(lambda: None).__click_params__[0]
    again: Any = lambda *_, **__: made  # noqa: E731  click takes what makes an option for its class
    return click.option(cls=again)


@cache
def _as_in_table(name: str) -> Callable[[Decorated], Decorated]:
    return _shared(_decorator(TABLES, name, {}))


def _decorator(
    tables: Sequence[Any], name: str, other: Any
) -> Callable[[Decorated], Decorated]:
    if name == HISTORY:
        return click.argument(
            "history",
            metavar="HISTORY...",
            nargs=-1,
            required=True,
            type=click_type("file"),
        )
    table = next(one for one in tables if name in options_of(one))
    more = {"help": other} if isinstance(other, str) else other
    return option(
        name,
        options_of(table)[name],
        **{"default": table.__dataclass_fields__[name].default, **more},
    )


def option(name: str, one: Option, **other: Any) -> Callable[[Decorated], Decorated]:
    """Make click's option of an entry of a table."""
    about: dict[str, Any] = {"help": one.help, "metavar": one.metavar}
    if one.kind == "flag":
        about["is_flag"] = True
    else:
        kind = click_type(one.kind)
        about |= {"type": kind, "nargs": 2 if one.pair else 1, "multiple": one.many}
    about |= {"instead_of": one.instead_of} | other
    if about["instead_of"]:
        about["cls"] = Either
    else:
        del about["instead_of"]
    if (
        about.get("default") is None
        or about["default"] is False
        or about["default"] == ()
    ):
        about.pop("default", None)
    else:
        about.setdefault("show_default", True)
    return click.option(*one.short, f"--{dashed(name)}", name, **about)


def time(name: str, text: str, **more: Any) -> Callable[[Decorated], Decorated]:
    """Make an option of one command that is a time, or a window of time."""
    pair, required = more.get("pair", False), more.pop("required", False)
    return option(
        name[2:].replace("-", "_"),
        Option(text, TIME, "LO HI" if pair else "T", **more),
        required=required,
    )


def file(
    name: str, text: str, metavar: str = "FILE", **more: Any
) -> Callable[[Decorated], Decorated]:
    """Make an option of one command that names a file, or ``many`` of them, one each time.

    Its ``kind`` is "file", or "output" if the command writes it.
    """
    required, kind = more.pop("required", False), more.pop("kind", "file")
    return option(
        name[2:].replace("-", "_"),
        Option(text, kind, metavar, **more),
        required=required,
    )


def windows_in(file: str) -> Sequence[tuple[float, float]]:
    """Read the windows in a file with lines 'tr td'."""
    from d2rpick.api.arguments import read_windows

    with click.open_file(file, encoding="utf-8", errors="replace") as stream:
        return read_windows(stream.read(), file)


def judging_run(request: Request) -> Run | None:
    """Open the history by which cards are judged; None without one."""
    if not request.history:
        return None
    from d2rpick.api.asked import (
        open_run,
    )  # not above: without a history nothing is computed

    return open_run(request)


def _remember(ctx: click.Context, option: click.Parameter, value: bool) -> None:
    ctx.meta[f"d2rpick.{dashed(option.name or '')}"] = value


# What every command can be told and none asks for itself: it is kept in the context.
_FLAGS: Final = [
    _shared(
        click.option(
            *names, is_flag=True, expose_value=False, callback=_remember, help=text
        )
    )
    for names, text in (
        (["--debug"], "Show the traceback of an error."),
        (
            ["--show-settings"],
            "Print every option with its value and its source, and do nothing else.",
        ),
        (
            ["-v", "--verbose"],
            "Say all that is known, and on stderr what was read and how long it took.",
        ),
    )
]


def repeat() -> list[str]:
    """Give the command line that was typed, and before it the environment variables that set options.

    It may replace the files that it has written, so that it can be typed again.
    """
    context = click.get_current_context()
    names = [
        _variable(context, name)
        for name in context.params
        if _source(context, name) == "environment"
    ]
    variables = [f"{name}={os.environ[name]}" for name in names]
    words = context.meta["d2rpick.command"]
    if not context.params["overwrite"] and any(
        context.params.get(name) for name in _WRITTEN
    ):
        words = inserted(words, ["--overwrite"])
    return [*(["env", *variables] if variables else []), "d2rpick", *words]


def inserted(command: Sequence[str], words: Sequence[str]) -> tuple[str, ...]:
    """Add options to a command line, before the names that are behind ``--``.

    Examples
    --------
    >>> inserted(["info", "--", "-x.csv"], ["--quiet"])
    ('info', '--quiet', '--', '-x.csv')
    """
    place = command.index("--") if "--" in command else len(command)
    return (*command[:place], *words, *command[place:])


def _settings(ctx: click.Context) -> Iterator[str]:
    """Write every option with its value, and where that comes from."""
    from d2rpick.report.tables import as_json

    for one in ctx.command.get_params(ctx):
        if one.expose_value and one.name:
            value, source = ctx.params[one.name], _source(ctx, one.name)
            named = {
                "environment": f", {_variable(ctx, one.name)}",
                "settings": f", {ctx.meta['d2rpick.settings']}",
            }
            name = spelled(one) if isinstance(one, click.Option) else one.name
            shown = "none" if value in (None, ()) else as_json(value, None)
            yield f"{name} = {shown}  # {source}{named.get(source, '')}"


def _source(ctx: click.Context, name: str) -> str:
    source = ctx.get_parameter_source(name)
    return _SOURCES.get(source, "default") if source else "default"


def _variable(ctx: click.Context, name: str) -> str:
    """Name of the environment variable that sets an option."""
    return f"{ctx.auto_envvar_prefix}_{name.upper()}"
