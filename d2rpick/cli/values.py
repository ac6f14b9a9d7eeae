"""How options get their values: the kinds there are, how the shell completes them, and defaults from a file."""

from __future__ import annotations

import math
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Final

import click
from click.core import ParameterSource

from d2rpick.api.cards import SETTINGS, Cards, solvers
from d2rpick.api.request import JUDGING, UNLIMITED, Number, options_of, typed
from d2rpick.base.errors import ConfigurationError
from d2rpick.base.settings import RULE_KEYS, format_toml_value, refuse_unknown
from d2rpick.cli import COMMANDS

if TYPE_CHECKING:
    from click.shell_completion import CompletionItem

    from d2rpick.api.runs import Run

    FloatType = click.ParamType[float]
else:
    FloatType = click.ParamType  # generic from click 8.4 on


class NumberType(FloatType):
    """A finite number with a point within its limits."""

    name = "number"

    def __init__(self, limits: Number) -> None:
        self.limits = limits

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> float:
        """Read a number or fail with what was found and what was expected."""
        try:
            number = float(value)
        except ValueError:
            from d2rpick.api.arguments import with_point, without_unit

            hint = with_point(value) or without_unit(value)
            self.fail(f"{value!r} is not a number{hint}", param, ctx)
        if not math.isfinite(number):
            self.fail(f"{value!r} is not a finite number", param, ctx)
        if limit := self.limits.missed(number):
            self.fail(f"{value} was found, a number {limit} was expected", param, ctx)
        return number


class File(click.types.StringParamType):
    """Name of a file or folder, for the shell to complete."""

    envvar_list_splitter = ";"

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> Any:
        """Take a name; one with a NUL byte, which only a program can give, is none of a file."""
        name = super().convert(value, param, ctx)
        if "\0" in name:
            self.fail(
                f"{name!r} holds a NUL byte, the name of a file was expected",
                param,
                ctx,
            )
        return name

    def shell_complete(
        self,
        ctx: click.Context,  # noqa: ARG002
        param: click.Parameter,  # noqa: ARG002
        incomplete: str,
    ) -> list[CompletionItem]:
        """Leave it to the shell."""
        from click.shell_completion import CompletionItem

        return [CompletionItem(incomplete, type="file")]


class OutputFile(File):
    """Name of a file or folder to write, which no settings file may choose."""


class Program(click.types.StringParamType):
    """Command that is started, or the address of a cluster that computes: no settings file may choose either."""


class Names(click.types.StringParamType):
    """Names that are separated by semicolons in an environment variable, since labels hold blanks."""

    envvar_list_splitter = ";"


class PartNames(Names):
    """Numbers and titles of parts, for the shell to complete from the history that was typed before."""

    def shell_complete(
        self,
        ctx: click.Context,
        param: click.Parameter,  # noqa: ARG002
        incomplete: str,
    ) -> list[CompletionItem]:
        """Offer the parts of the files that were typed before, and the words for several."""
        run = _typed_run(ctx)
        parts = run.parts if run else ()
        words = [
            ("flying", "parts that fly together"),
            ("all", "every part that has energy"),
        ]
        offered = [
            *((str(part.id), part.title) for part in parts),
            *((p.title, str(p.id)) for p in parts),
            *words,
        ]
        return _completed(offered, incomplete)


class RuleIds(click.types.StringParamType):
    """Ids of the rules of check."""

    def shell_complete(
        self,
        ctx: click.Context,  # noqa: ARG002
        param: click.Parameter,  # noqa: ARG002
        incomplete: str,
    ) -> list[CompletionItem]:
        """Offer the rules that begin so, with what they say."""
        from d2rpick.report.findings import as_list

        rows = (line.split(maxsplit=2) for line in as_list().split("\n"))
        return _completed(
            [(id_, summary) for id_, _, summary in rows], incomplete.upper()
        )


class ChannelNames(Names):
    """Names of channels, for the shell to complete from the history that was typed before."""

    def shell_complete(
        self,
        ctx: click.Context,
        param: click.Parameter,  # noqa: ARG002
        incomplete: str,
    ) -> list[CompletionItem]:
        """Offer the channels of the files that were typed before; underscores stand for blanks, as they may."""
        run = _typed_run(ctx)
        return _completed(
            [(name.replace(" ", "_"), "") for name in (run.channels if run else ())],
            incomplete,
        )


def _typed_run(ctx: click.Context) -> Run | None:
    """Open the files that were typed before; None where they are none of a run."""
    from pathlib import Path

    from d2rpick.api.runs import read
    from d2rpick.base.errors import D2RPickError

    words = ctx.meta.get("d2rpick.command", ())[
        1:
    ]  # click has read no argument yet when an option is completed
    try:
        return read([word for word in words if Path(word).exists()])
    except (D2RPickError, OSError, ValueError):
        return None


def _completed(
    offered: Iterable[tuple[str, str]], incomplete: str
) -> list[CompletionItem]:
    """Give the names that begin with what was typed; what a shell would take apart is left out."""
    import re

    from click.shell_completion import CompletionItem

    words = [(name, told) for name, told in offered if re.fullmatch(r"[\w./-]+", name)]
    return [
        CompletionItem(name, help=told)
        for name, told in words
        if name.startswith(incomplete)
    ]


class SolverName(click.types.StringParamType):
    """Name of a solver whose input can be printed; the table of solvers is read when it is asked."""

    name = "solver"

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> str:
        """Take a name or fail with those there are."""
        if value not in solvers():
            self.fail(
                f"{value!r} was found, one of {', '.join(solvers())} was expected",
                param,
                ctx,
            )
        return str(value)

    def get_metavar(self, *_: Any, **__: Any) -> str:
        """Show the names in the help."""
        return f"[{'|'.join(solvers())}]"

    def shell_complete(
        self,
        ctx: click.Context,  # noqa: ARG002
        param: click.Parameter,  # noqa: ARG002
        incomplete: str,
    ) -> list[CompletionItem]:
        """Offer the names that begin so."""
        return _completed([(name, "") for name in solvers()], incomplete)


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


def click_type(kind: Number | range | tuple[str, ...] | str) -> Any:
    """Give the type by which click reads a kind of value."""
    if isinstance(kind, str):
        return _NAMED[kind]
    if isinstance(kind, range):
        return click.IntRange(
            kind.start, None if kind.stop >= UNLIMITED else kind.stop - 1
        )
    return NumberType(kind) if isinstance(kind, Number) else click.Choice(kind)


CARDS: Final = tuple(options_of(Cards))
# What counts only beside one of other options: settings are for all commands, and not all of them are asked for it.
_BESIDE: Final[dict[str | None, tuple[str, ...]]] = {
    "weights": ("deck",),
    "step_ratio": ("cost_share", "deck"),
    **dict.fromkeys(CARDS, ("report", "write_deck")),
}


def settings_of(
    ctx: click.Context, without: click.Context, table: Mapping[str, object], source: str
) -> dict[str, Any]:
    """Values of options by name, as the ``table`` of settings gives them that was read from ``source``.

    Keys of all commands stand above, those of one command in a table of its name.  ``without`` holds what the command
    line and the environment give: what they exclude counts for nothing.

    Raises
    ------
    ConfigurationError
        For a key that is no option, or a value that is none of it.
    """
    own = {
        option: _value(ctx, option, value, place)
        for option, value, place in _given(ctx.command, table, source)
    }
    given = {
        name: one
        for name, one in without.params.items()
        if _source(without, name) is not ParameterSource.DEFAULT
    }
    asked = {**{option.name: value for option, value in own.items()}, **given}
    return {
        option.name or "": value
        for option, value in own.items()
        if _counts(ctx, option, given, asked)
    }


def _given(
    command: click.Command, table: Mapping[str, object], source: str
) -> Iterator[tuple[click.Option, object, str]]:
    """Options of a command that the settings name, with what stands there and where; unknown keys are refused."""
    tables = {name: one for name, one in table.items() if isinstance(one, Mapping)}
    shared = {
        name: one for name, one in table.items() if name not in (*tables, *RULE_KEYS)
    }
    for name in COMMANDS:
        if name in shared:
            raise ConfigurationError(
                f"{source}: {name} is {format_toml_value(shared[name])}, a table was expected"
            )
    refuse_unknown(shared, (*RULE_KEYS, *SETTINGS), source)
    refuse_unknown(tables, (*COMMANDS, "severity"), source)
    options = {
        spelled(one): one for one in command.params if isinstance(one, click.Option)
    }
    own = tables.get(command.name or "", {})
    refuse_unknown(own, options, f"{source}: {command.name}")
    for name, value in {**shared, **own}.items():
        if name in options:
            yield options[name], value, f"{source}: {name}"


def _value(ctx: click.Context, option: click.Option, value: Any, place: str) -> Any:
    """Read the value of an option; files lie where the settings do."""
    _refuse_dangerous(option, place)
    has_list = option.multiple or option.nargs > 1
    values = value if has_list and isinstance(value, list) else [value]
    if (option.nargs > 1 and not isinstance(value, list)) or not all(
        _fits(option, single) for single in values
    ):
        expected = "a list" if option.nargs > 1 else _expected_kind(option)
        raise ConfigurationError(
            f"{place} is {format_toml_value(value)}, {expected} was expected"
        )
    try:
        found = option.type_cast_value(ctx, values if has_list else value)
    except click.BadParameter as error:
        raise ConfigurationError(f"{place}: {error.message}") from None
    if not isinstance(option.type, File):
        return found
    from pathlib import Path  # mostly no file is among the settings

    folder = os.path.relpath(Path(place.partition(": ")[0]).parent)
    return (
        [str(Path(folder, name)) for name in found]
        if has_list
        else str(Path(folder, found))
    )


def _refuse_dangerous(option: click.Option, place: str) -> None:
    """Refuse what would start a program, write a file or replace one: the settings may be those of somebody else."""
    if isinstance(option.type, OutputFile | Program) or option.name == "overwrite":
        what = "programs, output files and overwrite are never taken from a file"
    elif not option.expose_value:  # --help, --debug and others that are about one call
        what = "this is never taken from a file"
    else:
        return
    raise ConfigurationError(
        f"{place}: {what}; remove the key, and give the option on the command line"
    )


def _fits(option: click.Option, value: object) -> bool:
    """Return whether a single value from a TOML file is of the kind that an option takes."""
    if option.is_flag or isinstance(value, bool):
        return option.is_flag and isinstance(value, bool)
    if isinstance(option.type, File):
        return isinstance(value, str)
    if isinstance(value, int):
        return abs(value) < UNLIMITED
    return isinstance(value, str) or (
        isinstance(value, float) and not isinstance(option.type, click.IntRange)
    )


def _expected_kind(option: click.Option) -> str:
    """Say which kind of value an option takes."""
    if option.is_flag:
        return "true or false"
    if isinstance(option.type, File):
        return "a text"
    return (
        "a whole number"
        if isinstance(option.type, click.IntRange)
        else "a number or a text"
    )


def _counts(
    ctx: click.Context,
    option: click.Option,
    given: Mapping[str, Any],
    asked: Mapping[Any, Any],
) -> bool:
    """Whether a setting counts, beside the options that are ``given``, and with all that is ``asked``."""
    if any(name in given for name in getattr(option, "instead_of", ())):
        return False
    if option.name in CARDS and (
        ctx.command.name == "card" or asked.get("output_format") == "card"
    ):
        return True
    unjudged = option.name in JUDGING and ctx.command.name in ("card", "check")
    beside = ("history",) if unjudged else _BESIDE.get(option.name, ())
    return not beside or any(asked.get(name) for name in beside)


def _source(ctx: click.Context, name: str | None) -> ParameterSource | None:
    return ctx.get_parameter_source(name or "")


def words_of(ctx: click.Context) -> Sequence[str]:
    """Write the options that settings gave as they are typed."""
    of_settings = (
        one
        for one in ctx.command.params
        if _source(ctx, one.name) is ParameterSource.DEFAULT_MAP
    )
    options = [one for one in of_settings if isinstance(one, click.Option)]
    return [
        text
        for one in options
        for text in typed(spelled(one), ctx.params[one.name or ""], many=one.multiple)
    ]


def spelled(option: click.Option) -> str:
    """Spell an option in full, as in the settings."""
    return max(option.opts, key=len)[2:]
