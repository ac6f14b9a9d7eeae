"""Define the types of option values, how the shell completes them, and their defaults from a settings file."""

from __future__ import annotations

import math
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Final

import click
from click.core import ParameterSource

from d2rpick.api.arguments import suggest_share
from d2rpick.api.cards import (
    SETTINGS,
    Cards,
    explain_unknown_solver,
    list_solvers,
)
from d2rpick.api.request import JUDGING, write_option
from d2rpick.base.errors import ConfigurationError
from d2rpick.base.options import UNLIMITED, list_options
from d2rpick.base.ranges import Number
from d2rpick.base.settings import (
    RULE_KEYS,
    format_toml_value,
    locate_setting,
    refuse_unknown_settings,
)
from d2rpick.cli import COMMANDS

if TYPE_CHECKING:
    from click.shell_completion import CompletionItem

    from d2rpick.api.runs import Run

    FloatType = click.ParamType[float]
    WordType = click.Choice[str]
else:
    # These classes are not generic in older versions of click.
    FloatType = click.ParamType
    WordType = click.Choice

CARDS: Final = tuple(list_options(Cards))
# Placeholder of a time that is measured by the clock, not in the unit of the run.
SECONDS: Final = "SECONDS"
_PAIR: Final = 2  # Number of values of an option that takes a pair.
# Options that settings may contain for every command, but that apply only if one of the listed options is given.
_BESIDE: Final[dict[str | None, tuple[str, ...]]] = {
    "weights": ("deck",),
    "step_ratio": ("cost_share", "deck"),
    **dict.fromkeys(CARDS, ("report", "write_deck")),
}


# What an option expects, by its metavar.
_SOME_TIME: Final = "a time in the unit of the run, such as 0.005,"
_SOME_SECONDS: Final = "a number of seconds, such as 60,"


class NumberType(FloatType):
    """A finite number within its limits; the decimal sign is a point."""

    name = "number"

    def __init__(self, limits: Number) -> None:
        self.limits = limits

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> float:
        """Read a number; the error message contains the value found and the allowed values."""
        try:
            number = float(value)
        except ValueError:
            from d2rpick.api.arguments import (
                suggest_decimal_point,
                suggest_seconds,
                suggest_without_percent,
                suggest_without_unit,
            )

            is_by_clock = bool(param and param.metavar == SECONDS)
            hint = (
                suggest_decimal_point(value)
                or (suggest_seconds if is_by_clock else suggest_without_unit)(value)
                or suggest_without_percent(
                    value, is_time=bool(param and param.metavar == "T")
                )
            )
            if param and param.nargs == _PAIR and not hint:
                hint = ": two numbers were expected"
            if param and param.metavar == "T" and not hint:
                hint = f", but {_SOME_TIME} was expected"
            if is_by_clock and not hint:
                hint = f"; give {_SOME_SECONDS.rstrip(',')}"
            self.fail(f"{value!r} is not a number{hint}", param, ctx)
        if not math.isfinite(number):
            expected = "a finite number"
            if param and param.metavar == SECONDS:
                expected = _SOME_SECONDS
            elif param and param.metavar == "T":
                expected = _SOME_TIME
            self.fail(f"{value!r} was found, but {expected} was expected", param, ctx)
        if limit := self.limits.missed(number):
            hint = suggest_share(number) if self.limits.high == 1 else ""
            self.fail(
                f"{value} was found, but a number {limit} was expected{hint}",
                param,
                ctx,
            )
        return number


class Word(WordType):
    """One of several words; the error message names the word that resembles a wrong one."""

    def get_invalid_choice_message(self, value: Any, ctx: click.Context | None) -> str:
        """Return the message on a wrong word."""
        from difflib import get_close_matches

        near = get_close_matches(str(value).lower(), self.choices, n=1)
        hint = f" (did you mean {near[0]!r}?)" if near else ""
        return f"{super().get_invalid_choice_message(value, ctx).rstrip('.')}{hint}"


class WholeNumber(click.IntRange):
    """A whole number within its limits."""

    def get_metavar(self, *_: Any, **__: Any) -> str:
        """Return the name of a value, as shown in the help."""
        return "N"

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> int:
        """Read a whole number; the error message contains the value found and the allowed values."""
        least, most = self.min, self.max
        limits = f"of at least {least}" if most is None else f"from {least} to {most}"
        try:
            number = int(value)
        except ValueError:
            number = None
        is_within = number is not None and (least or 0) <= number
        if number is None or not is_within or (most is not None and number > most):
            self.fail(
                f"{value} was found, but a whole number {limits} was expected",
                param,
                ctx,
            )
        return number


class File(click.types.StringParamType):
    """Name of a file or folder, completed by the shell."""

    envvar_list_splitter = ";"

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> Any:
        """Return a name; refuse a NUL byte, which only a program can pass."""
        name = super().convert(value, param, ctx)
        if "\0" in name:
            self.fail(
                f"{name!r} holds a NUL byte, but the name of a file was expected",
                param,
                ctx,
            )
        return name

    def shell_complete(
        self,
        ctx: click.Context,  # noqa: ARG002  click passes the argument
        param: click.Parameter,  # noqa: ARG002  click passes the argument
        incomplete: str,
    ) -> list[CompletionItem]:
        """Request completion of the name by the shell."""
        from click.shell_completion import CompletionItem

        return [CompletionItem(incomplete, type="file")]


class OutputFile(File):
    """Name of a file or folder to be written, which a settings file must not set."""


class Program(click.types.StringParamType):
    """A command to be started, or the address of a computing cluster; a settings file must not set either."""


class CompletedText(click.types.StringParamType):
    """A text that the shell completes from a list of possible values."""

    def offer(self, ctx: click.Context) -> Iterable[tuple[str, str]]:  # noqa: ARG002  subclasses use the argument
        """Return the names to choose from, each with a description."""
        return ()

    def shell_complete(
        self,
        ctx: click.Context,
        param: click.Parameter,  # noqa: ARG002  click passes the argument
        incomplete: str,
    ) -> list[CompletionItem]:
        """Offer the names that begin with this prefix, except names that the shell would split."""
        import re

        from click.shell_completion import CompletionItem

        return [
            CompletionItem(name, help=description)
            for name, description in self.offer(ctx)
            if name.startswith(incomplete) and re.fullmatch(r"[\w./-]+", name)
        ]


class Names(CompletedText):
    """Names. In an environment variable, semicolons separate them, because names may contain spaces."""

    envvar_list_splitter = ";"


class PartNames(Names):
    """Ids and titles of parts, completed from the history on the command line."""

    def offer(self, ctx: click.Context) -> Iterable[tuple[str, str]]:
        """Return the parts in the files on the command line, and the words that stand for several parts."""
        run = _open_typed_run(ctx)
        parts = run.parts if run else ()
        words = [
            ("flying", "parts that fly together"),
            ("all", "every part that has energy"),
        ]
        return [
            *((str(part.id), part.title) for part in parts),
            *((part.title, str(part.id)) for part in parts),
            *words,
        ]


class RuleIds(CompletedText):
    """Ids of the rules of ``check``."""

    def offer(self, ctx: click.Context) -> Iterable[tuple[str, str]]:  # noqa: ARG002  other subclasses use the argument
        """Return the rules with their summaries."""
        from d2rpick.report.rule_texts import list_rules

        rows = (line.split(maxsplit=2) for line in list_rules().split("\n"))
        return [(rule, summary) for rule, _, summary in rows]

    def shell_complete(
        self, ctx: click.Context, param: click.Parameter, incomplete: str
    ) -> list[CompletionItem]:
        """Offer the rules that begin with this prefix, in upper or lower case."""
        return super().shell_complete(ctx, param, incomplete.upper())


class ChannelNames(Names):
    """Names of channels, completed from the history that is named on the command line."""

    def offer(self, ctx: click.Context) -> Iterable[tuple[str, str]]:
        """Return the channels in the files on the command line; spaces become underscores, which are equivalent."""
        run = _open_typed_run(ctx)
        return [(name.replace(" ", "_"), "") for name in (run.channels if run else ())]


def _open_typed_run(ctx: click.Context) -> Run | None:
    """Open the files named on the command line; None if they are not a run."""
    from pathlib import Path

    from d2rpick.api.runs import read
    from d2rpick.base.errors import D2RPickError

    # When click completes an option, it has not yet read any argument.
    words = ctx.meta.get("d2rpick.command", ())[1:]
    try:
        return read([word for word in words if Path(word).exists()])
    except (D2RPickError, OSError, ValueError):
        return None


class SolverName(CompletedText):
    """Name of a solver whose input can be printed. The table of solvers is imported only when it is needed."""

    name = "solver"

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> str:
        """Return the name of a solver, or fail with the allowed names."""
        if value not in list_solvers():
            self.fail(explain_unknown_solver(value), param, ctx)
        return str(value)

    def get_metavar(self, *_: Any, **__: Any) -> str:
        """Return the names of the solvers, as shown in the help."""
        return f"[{'|'.join(list_solvers())}]"

    def offer(self, ctx: click.Context) -> Iterable[tuple[str, str]]:  # noqa: ARG002  other subclasses use the argument
        """Return the names of the solvers."""
        return [(name, "") for name in list_solvers()]


_NAMED: Final = {
    "text": click.STRING,
    "file": File(),
    "output": OutputFile(),
    "program": Program(),
    "names": Names(),
    "parts": PartNames(),
    "channels": ChannelNames(),
    "solver": SolverName(),
    "rules": RuleIds(),
}


def choose_click_type(kind: Number | range | tuple[str, ...] | str) -> Any:
    """Return the click type that reads this type of value."""
    if isinstance(kind, str):
        return _NAMED[kind]
    if isinstance(kind, range):
        return WholeNumber(
            kind.start, None if kind.stop >= UNLIMITED else kind.stop - 1
        )
    return NumberType(kind) if isinstance(kind, Number) else Word(kind)


def read_settings(
    ctx: click.Context, without: click.Context, table: Mapping[str, object], source: str
) -> dict[str, Any]:
    """Return the option values by name, from the settings ``table`` that was read from ``source``.

    Keys at the top apply to all commands, keys in a table of a command's name to that command.  ``without`` is the
    context with the command line and the environment: settings that these exclude are ignored.

    Raises
    ------
    ConfigurationError
        For a key that is not an option, or a value that its option does not allow.
    """
    values = {
        option: _read_value(ctx, option, value, position)
        for option, value, position in _list_given_settings(ctx.command, table, source)
    }
    given_values = {
        name: value
        for name, value in without.params.items()
        if _get_source(without, name) is not ParameterSource.DEFAULT
    }
    all_values = {
        **{option.name: value for option, value in values.items()},
        **given_values,
    }
    return {
        option.name or "": value
        for option, value in values.items()
        if is_used(ctx, option, given_values, all_values)
    }


def _list_given_settings(
    command: click.Command, table: Mapping[str, object], source: str
) -> Iterator[tuple[click.Option, object, str]]:
    """Yield each option of a command that the settings contain, with its value and position; refuse unknown keys."""
    tables = {
        name: entry for name, entry in table.items() if isinstance(entry, Mapping)
    }
    shared = {
        name: entry
        for name, entry in table.items()
        if name not in (*tables, *RULE_KEYS)
    }
    for name in COMMANDS:
        if name in shared:
            raise ConfigurationError(
                f"{source}: {name} is {format_toml_value(shared[name])}, but a table was expected"
            )
    refuse_unknown_settings(shared, (*RULE_KEYS, *SETTINGS), source)
    refuse_unknown_settings(tables, (*COMMANDS, "severity"), source)
    options = {
        spell_option(entry): entry
        for entry in command.params
        if isinstance(entry, click.Option)
    }
    own_table = tables.get(command.name or "", {})
    own_name = command.name or ""
    refuse_unknown_settings(own_table, options, source, own_name)
    for name, value in {**shared, **own_table}.items():
        if name in options:
            table_of_key = own_name if name in own_table else ""
            place = locate_setting(source, name, table_of_key)
            yield options[name], value, f"{place}: {name}"


def _read_value(
    ctx: click.Context, option: click.Option, value: Any, position: str
) -> Any:
    """Read the value of an option; relative file names refer to the folder of the settings file."""
    _refuse_dangerous(option, position)
    has_list = option.multiple or option.nargs > 1
    values = value if has_list and isinstance(value, list) else [value]
    if (option.nargs > 1 and not isinstance(value, list)) or not all(
        is_of_kind(option, single) for single in values
    ):
        expected = "a list" if option.nargs > 1 else _name_expected_kind(option)
        raise ConfigurationError(
            f"{position} is {format_toml_value(value)}, but {expected} was expected"
        )
    try:
        converted = option.type_cast_value(ctx, values if has_list else value)
    except click.BadParameter as error:
        raise ConfigurationError(f"{position}: {error.message}") from None
    if not isinstance(option.type, File):
        return converted
    from pathlib import Path  # Imported here to keep start-up fast.

    folder = os.path.relpath(Path(position.partition(": ")[0]).parent)
    if has_list:
        return [str(Path(folder, name)) for name in converted]
    return str(Path(folder, converted))


def _refuse_dangerous(option: click.Option, position: str) -> None:
    """Refuse settings that start a program or write a file, because another person may have written them."""
    if isinstance(option.type, OutputFile | Program) or option.name == "overwrite":
        reason = "programs, output files and overwrite are never taken from a file"
    elif not option.expose_value:
        # click does not expose options for a single call, such as --help and --debug.
        reason = "this is never taken from a file"
    else:
        return
    raise ConfigurationError(
        f"{position}: {reason}; remove the key, and give the option on the command line"
    )


def is_of_kind(option: click.Option, value: object) -> bool:
    """Return True if a single value from a TOML file has the type of the option."""
    if option.is_flag or isinstance(value, bool):
        return option.is_flag and isinstance(value, bool)
    if isinstance(option.type, File):
        return isinstance(value, str)
    if isinstance(value, int):
        return abs(value) < UNLIMITED
    return isinstance(value, str) or (
        isinstance(value, float) and not isinstance(option.type, click.IntRange)
    )


def _name_expected_kind(option: click.Option) -> str:
    """Return the name of the type of value that an option takes."""
    if option.is_flag:
        return "true or false"
    if isinstance(option.type, File):
        return "a text"
    if isinstance(option.type, click.IntRange):
        return "a whole number"
    return "a number or a text"


def is_used(
    ctx: click.Context,
    option: click.Option,
    given_values: Mapping[str, Any],
    all_values: Mapping[Any, Any],
) -> bool:
    """Return True if an option applies to the options of the user (``given_values``) and of all (``all_values``)."""
    if any(name in given_values for name in getattr(option, "instead_of", ())):
        return False
    if option.name in CARDS and (
        ctx.command.name == "card" or all_values.get("output_format") == "card"
    ):
        return True
    unjudged = option.name in JUDGING and ctx.command.name in ("card", "check")
    needed_options = ("history",) if unjudged else _BESIDE.get(option.name, ())
    return not needed_options or any(all_values.get(name) for name in needed_options)


def _get_source(ctx: click.Context, name: str | None) -> ParameterSource | None:
    return ctx.get_parameter_source(name or "")


def list_words(ctx: click.Context) -> Sequence[str]:
    """Return the settings as command-line options, as a user would type them."""
    of_settings = (
        parameter
        for parameter in ctx.command.params
        if _get_source(ctx, parameter.name) is ParameterSource.DEFAULT_MAP
    )
    options = [
        parameter for parameter in of_settings if isinstance(parameter, click.Option)
    ]
    return [
        text
        for parameter in options
        for text in write_option(
            spell_option(parameter),
            ctx.params[parameter.name or ""],
            many=parameter.multiple,
        )
    ]


def spell_option(option: click.Option) -> str:
    """Return the long name of an option in the form that settings use."""
    return max(option.opts, key=len)[2:]
