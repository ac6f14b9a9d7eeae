"""Make the command-line options from the argument tables of the API, and print the settings and the command line."""

from __future__ import annotations

import os
from copy import copy
from functools import cache, wraps
from typing import TYPE_CHECKING, Any, Final

import click
from click.core import ParameterSource

from d2rpick.api.cards import Cards
from d2rpick.api.option_names import replace_arguments
from d2rpick.api.request import (
    ADVANCED,
    CHOOSING,
    JUDGING,
    READING,
    Request,
    write_option,
)
from d2rpick.base.errors import ArgumentError
from d2rpick.base.options import TIME, Option, list_options, make_option_name
from d2rpick.base.settings import find_nearest_settings
from d2rpick.cli import Documented, make_documented
from d2rpick.cli.output import Output, encode_text, tell
from d2rpick.cli.times import TimeType, convert_typed_times
from d2rpick.cli.values import (
    CARDS,
    Word,
    choose_click_type,
    list_words,
    read_settings,
    spell_option,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Sequence

    from d2rpick.api.runs import Run
    from d2rpick.cli.missing import ListNeeds

WINDOW = tuple[float, float] | None
# Type of a command function; click's decorators have no more specific type.
Decorated = Any
TABLES: Final[tuple[Any, ...]] = (Request, Cards, Output)
FILES: Final = ("output_file", "overwrite", "quiet")
RESULT: Final = ("output_format", "exit_zero", *FILES)
# Name of the positional argument, in capitals because some commands have an option of the same name.
HISTORY: Final = "HISTORY"
ONE_RUN: Final = ("deck", "no_deck", "weights", HISTORY, *READING, *CHOOSING)
REFERENCE: Final = ("history", *JUDGING)
ANSWER: Final = ("plot", "report", *CARDS, *RESULT)
DECK: Final = (
    "Main deck of the run (LS-DYNA, or a starter or engine file of Radioss), which defines gravity, supports, costs "
    "and connected parts"
)
# Help of the commands that accept the recommended set of parts, which follows from the deck.
WITH_RECOMMENDED: Final = {
    "deck": f"{DECK}.  `--part recommended` is the set that d2rpick parts recommends.",
    "part": 'Parts to switch: number (3,7), range (10-19), title, "flying", "all" or, with a deck, "recommended"; '
    "their energies are added.",
}
# Sections of the help; options that belong to no section come first.
_CARDS: Final = "Cards"
GROUPS: Final[dict[str, tuple[str, ...]]] = {
    "Times": (
        *("tr", "td", "td_window", "steps", "min_rigid"),
        *(name for name in CHOOSING if name not in ADVANCED),
        *("wait", "min_mean_energy"),
    ),
    "What to read": ("history", "switched", "from", *READING, "done", "before"),
    "Deck and cost": ("deck", "no_deck", "weights", "write_deck"),
    _CARDS: CARDS,
    "Output": (
        *("all", "limit", "plot", "report", *RESULT),
        *("verbose", "show_settings", "debug", "help"),
    ),
    "Advanced": ADVANCED,
}
# Options that write files, which already exist if the command is repeated.
_WRITTEN: Final = ("output_file", "plot", "report", "write_deck")
_PAIRS: Final = ("td_window",)
_ASKS_FOR_SETTINGS: Final = "--show-settings"
# Key in click's context for a flag that is True if only the settings are shown.
_SETTINGS_ONLY: Final = "d2rpick.settings-only"
_SOURCES: Final = {
    ParameterSource.COMMANDLINE: "command line",
    ParameterSource.ENVIRONMENT: "environment",
    ParameterSource.DEFAULT_MAP: "settings",
}


class Command(Documented):
    """A command that can show its settings instead of running, and that names options in messages about arguments.

    ``list_needs`` names what the command needs depending on the given values.
    """

    def __init__(
        self, *args: Any, list_needs: ListNeeds | None = None, **settings: Any
    ) -> None:
        super().__init__(*args, **settings)
        self._list_needs = list_needs

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Read the command line. Options set neither there nor in the environment are taken from the settings file."""
        if ctx.resilient_parsing:
            return super().parse_args(ctx, args)
        ctx.meta[_SETTINGS_ONLY] = _ASKS_FOR_SETTINGS in args
        table, source, ctx.meta["d2rpick.unused"] = find_nearest_settings(os.curdir)
        ctx.meta["d2rpick.settings"] = source
        if table:
            without = self._read_leniently(ctx, args)
            ctx.default_map = read_settings(ctx, without, table, source)
        # click empties the original list.
        typed = list(args)
        try:
            remaining = super().parse_args(ctx, args)
        except click.MissingParameter:
            self._refuse_missing(ctx, self._read_leniently(ctx, typed))
            raise
        except click.BadOptionUsage as error:
            # click omits the context, without which the message cannot say what the option means.
            error.ctx = error.ctx or ctx
            raise
        if self._list_needs:
            self._refuse_missing(ctx, ctx)
        if words := list_words(ctx):
            ctx.meta["d2rpick.command"] = insert_options(
                ctx.meta["d2rpick.command"], words
            )
        return remaining

    def _read_leniently(self, ctx: click.Context, words: list[str]) -> click.Context:
        """Return a context with the values of the command line and the environment, without refusing any."""
        lenient = click.Context(self, ctx.parent, ctx.info_name, resilient_parsing=True)
        lenient.default_map = ctx.default_map
        super().parse_args(lenient, list(words))
        return lenient

    def _refuse_missing(self, ctx: click.Context, given: click.Context) -> None:
        """Raise UsageError if a required parameter or something else that the command needs is not ``given``."""
        if ctx.meta[_SETTINGS_ONLY]:
            return
        # Imported here to keep start-up fast.
        from d2rpick.cli.missing import explain_missing

        if message := explain_missing(ctx, given.params, self._list_needs):
            raise click.UsageError(message, ctx)

    def get_params(self, ctx: click.Context) -> list[click.Parameter]:
        """Return the parameters, none of which is required if only the settings are shown."""
        parameters = super().get_params(ctx)
        if ctx.meta.get(_SETTINGS_ONLY):
            return [_make_optional(parameter) for parameter in parameters]
        return parameters

    def format_options(
        self, ctx: click.Context, formatter: click.HelpFormatter
    ) -> None:
        """Write the help of the options, grouped by subject."""
        shown_options = (
            parameter
            for parameter in self.get_params(ctx)
            if isinstance(parameter, click.Option)
        )
        records = {
            spell_option(parameter).replace("-", "_"): parameter.get_help_record(ctx)
            for parameter in shown_options
        }
        # A command that prints no cards may have an option of the same name with another meaning.
        prints_cards = "merge" in records
        groups = {
            title: names
            for title, names in GROUPS.items()
            if title != _CARDS or prints_cards
        }
        grouped = {name for names in groups.values() for name in names}
        for title, names in {
            "Options": [parameter for parameter in records if parameter not in grouped],
            **groups,
        }.items():
            if rows := [record for name in names if (record := records.get(name))]:
                with formatter.section(title):
                    formatter.write_dl(rows)

    def invoke(self, ctx: click.Context) -> Any:
        """Run the command; raise UsageError for contradictory options."""
        if not ctx.params.get("quiet"):
            for note in ctx.meta["d2rpick.unused"]:
                tell(f"note: {note}")
        if ctx.meta.get("d2rpick.show-settings"):
            return click.echo(encode_text("\n".join(_list_settings(ctx))))
        if (words := list_words(ctx)) and not ctx.params.get("quiet"):
            # Imported here to keep start-up fast.
            from d2rpick.report.tables import quote_shell_line

            tell(f"note: {quote_shell_line(words)} by {ctx.meta['d2rpick.settings']}")
        convert_typed_times(ctx)
        # numpy is imported here, at a small call depth, because its import makes many nested calls.
        # In Python 3.11, nested calls are slow if they repeatedly cross the end of a chunk of the call stack.
        if ctx.params.get("history"):
            import numpy as np  # noqa: F401  only the import matters
        try:
            return super().invoke(ctx)
        except ArgumentError as error:
            raise click.UsageError(replace_arguments(str(error)), ctx) from error


def _make_optional(parameter: click.Parameter) -> click.Parameter:
    """Return a copy of a parameter that is not required."""
    optional = copy(parameter)
    optional.required = False
    return optional


class Either(click.Option):
    """An option that excludes others. If one of these is on the command line, its environment variable is ignored."""

    def __init__(self, *args: Any, instead_of: Sequence[str], **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self.instead_of = instead_of

    def consume_value(
        self, ctx: click.Context, opts: Any
    ) -> tuple[Any, ParameterSource]:
        """Return the value and its source. click has already read the values of options on the command line."""
        value, source = super().consume_value(ctx, opts)
        typed = (
            ctx.get_parameter_source(name) is ParameterSource.COMMANDLINE
            for name in self.instead_of
        )
        if source is ParameterSource.ENVIRONMENT and any(typed):
            return self.get_default(ctx), ParameterSource.DEFAULT
        return value, source


def make_command(function: Decorated) -> click.Command:
    """Turn a function into a command."""
    return make_documented(Command)(function)


def make_command_with_needs(
    list_needs: ListNeeds,
) -> Callable[[Decorated], click.Command]:
    """Turn a function into a command that refuses a command line without what ``list_needs`` names."""
    return make_documented(Command, list_needs=list_needs)


def add_options(
    *names: str, of: Sequence[Any] = TABLES, forms: Iterable[str] = (), **overrides: Any
) -> Callable[[Decorated], Decorated]:
    """Give a command the options of tables. It receives one object per table, under the name of the table.

    Parameters
    ----------
    *names : str
        Names of options, in the order of the help.
    of : sequence of classes
        The tables.
    forms : str
        Forms of the result, the first by default.
    **other : str or dict
        For an option by its name: the help text for this command, or other arguments of click.
    """
    tables = {
        table: [
            option_name for option_name in names if option_name in list_options(table)
        ]
        for table in of
    }
    if HISTORY in names:
        tables[Request].append("history")
    if choices := list(forms):
        about = {
            "type": Word(choices),
            "default": choices[0],
            "show_default": True,
        }
        overrides["output_format"] = about

    def decorate(function: Decorated) -> Decorated:
        @wraps(function)
        def run(*args: Any, **values: Any) -> Any:
            ctx = click.get_current_context()
            if "history" in values:
                ctx.meta["d2rpick.history"] = values["history"]
            given_names = {
                name
                for name in values
                if ctx.get_parameter_source(name) is not ParameterSource.DEFAULT
            }
            for table, taken in tables.items():
                if taken:
                    given_field = (
                        {"given": given_names & {*taken}} if table is Request else {}
                    )
                    values[table.__name__.lower()] = table(
                        **{name: values.pop(name) for name in taken}, **given_field
                    )
            if "no_deck" in names:
                from d2rpick.api.deck_in_folder import find_deck_in_folder

                values["request"] = find_deck_in_folder(values["request"])
            return function(*args, **values)

        if "quiet" in names:
            for flag in _FLAGS:
                run = flag(run)
        for name in reversed(names):
            as_in_table = of is TABLES and name not in overrides
            run = (
                _make_option_of_table(name)
                if as_in_table
                else _make_decorator(of, name, overrides.get(name, {}))
            )(run)
        return run

    return decorate


def _share_option(
    decorate: Callable[[Decorated], Decorated],
) -> Callable[[Decorated], Decorated]:
    """Return a decorator that gives all commands the same option object, because only one command is ever called."""
    shared_option = decorate(lambda: None).__click_params__[0]
    again: Any = lambda *_, **__: shared_option  # noqa: E731  click accepts a function in place of the option class
    return click.option(cls=again)


@cache
def _make_option_of_table(name: str) -> Callable[[Decorated], Decorated]:
    return _share_option(_make_decorator(TABLES, name, {}))


def _make_decorator(
    tables: Sequence[Any], name: str, override: Any
) -> Callable[[Decorated], Decorated]:
    if name == HISTORY:
        return click.argument(
            "history",
            metavar="HISTORY...",
            nargs=-1,
            required=True,
            type=choose_click_type("file"),
        )
    table = next(
        table_of_option
        for table_of_option in tables
        if name in list_options(table_of_option)
    )
    arguments = {"help": override} if isinstance(override, str) else override
    return make_click_option(
        name,
        list_options(table)[name],
        **{"default": table.__dataclass_fields__[name].default, **arguments},
    )


def make_click_option(
    name: str, entry: Option, **arguments: Any
) -> Callable[[Decorated], Decorated]:
    """Make a click option from a table entry."""
    about: dict[str, Any] = {
        "help": replace_arguments(entry.help),
        "metavar": entry.metavar,
    }
    if entry.kind == "flag":
        about["is_flag"] = True
    else:
        kind = choose_click_type(entry.kind)
        if entry.is_time:
            kind = TimeType(kind.limits)
        about |= {"type": kind, "nargs": 2 if entry.pair else 1, "multiple": entry.many}
    about |= {"instead_of": entry.instead_of} | arguments
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
    return click.option(*entry.short, f"--{make_option_name(name)}", name, **about)


def make_time_option(
    name: str, text: str, **arguments: Any
) -> Callable[[Decorated], Decorated]:
    """Make an option of a single command for a time or a time window."""
    pair = arguments.get("pair", False)
    required = arguments.pop("required", False)
    return make_click_option(
        name[2:].replace("-", "_"),
        Option(text, TIME, "LO HI" if pair else "T", **arguments),
        required=required,
    )


def make_file_option(
    name: str, text: str, metavar: str = "FILE", **arguments: Any
) -> Callable[[Decorated], Decorated]:
    """Make an option of a single command that names a file, or ``many`` files if the option is repeated.

    Its ``kind`` is "file", or "output" if the command writes it.
    """
    required = arguments.pop("required", False)
    kind = arguments.pop("kind", "file")
    return make_click_option(
        name[2:].replace("-", "_"),
        Option(text, kind, metavar, **arguments),
        required=required,
    )


def read_windows_in(file: str) -> Sequence[tuple[float, float]]:
    """Read the windows from a file with lines 'tr td'."""
    from d2rpick.api.arguments import read_windows

    with click.open_file(file, encoding="utf-8", errors="replace") as stream:
        return read_windows(stream.read(), file)


def open_judging_run(request: Request) -> Run | None:
    """Open the history that is used to judge cards; None if no history is given."""
    if not request.history:
        return None
    # Imported here to keep start-up fast.
    from d2rpick.api.asked import open_requested_run

    return open_requested_run(request)


def _keep_in_context(ctx: click.Context, option: click.Parameter, value: bool) -> None:
    ctx.meta[f"d2rpick.{make_option_name(option.name or '')}"] = value


# Options that every command accepts but does not use itself; click's context keeps them.
_FLAGS: Final = [
    _share_option(
        click.option(
            *names,
            is_flag=True,
            expose_value=False,
            callback=_keep_in_context,
            help=text,
        )
    )
    for names, text in (
        (["--debug"], "Show the traceback of an error."),
        (
            [_ASKS_FOR_SETTINGS],
            "Print every option with its value and its source, and do nothing else.",
        ),
        (
            ["-v", "--verbose"],
            "Print all details, and list on stderr each file read and how long reading took.",
        ),
    )
]


def repeat_command() -> list[str]:
    """Return the command line as typed, preceded by the environment variables that set options.

    The line may overwrite the files that it has written, so that it can be run again.
    """
    context = click.get_current_context()
    names = [
        _name_variable(context, name)
        for name in context.params
        if _name_source(context, name) == "environment"
    ]
    variables = [f"{name}={os.environ[name]}" for name in names]
    words = context.meta["d2rpick.command"]
    if not context.params["overwrite"] and any(
        context.params.get(name) for name in _WRITTEN
    ):
        words = insert_options(words, ["--overwrite"])
    return [*(["env", *variables] if variables else []), "d2rpick", *words]


def write_times(**values: Any) -> tuple[str, ...]:
    """Return options as typed; options without a value are omitted.

    Examples
    --------
    >>> write_times(td=0.5, td_window=None, switched=("a", "b"))
    ('--td', '0.5', '--switched', 'a', '--switched', 'b')
    """
    return tuple(
        word
        for name, value in values.items()
        if value is not None
        for word in write_option(
            name, value, many=isinstance(value, tuple) and name not in _PAIRS
        )
    )


def insert_options(command: Sequence[str], words: Sequence[str]) -> tuple[str, ...]:
    """Add options to a command line, before the names that follow ``--``.

    Examples
    --------
    >>> insert_options(["info", "--", "-x.csv"], ["--quiet"])
    ('info', '--quiet', '--', '-x.csv')
    """
    position = command.index("--") if "--" in command else len(command)
    return (*command[:position], *words, *command[position:])


def _list_settings(ctx: click.Context) -> Iterator[str]:
    """Yield a line for every option with its value and the source of the value."""
    from d2rpick.report.tables import as_json

    for parameter in ctx.command.get_params(ctx):
        if parameter.expose_value and parameter.name:
            value = ctx.params[parameter.name]
            source = _name_source(ctx, parameter.name)
            origin_details = {
                "environment": f", {_name_variable(ctx, parameter.name)}",
                "settings": f", {ctx.meta['d2rpick.settings']}",
            }
            name = (
                spell_option(parameter)
                if isinstance(parameter, click.Option)
                else parameter.name
            )
            written_value = "none" if value in (None, ()) else as_json(value, None)
            yield f"{name} = {written_value}  # {source}{origin_details.get(source, '')}"


def _name_source(ctx: click.Context, name: str) -> str:
    source = ctx.get_parameter_source(name)
    return _SOURCES.get(source, "default") if source else "default"


def _name_variable(ctx: click.Context, name: str) -> str:
    """Return the name of the environment variable that sets an option."""
    return f"{ctx.auto_envvar_prefix}_{name.upper()}"
