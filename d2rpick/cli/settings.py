"""Settings of the commands in a file, which give their options other defaults."""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Final

import click
from click.core import ParameterSource

from d2rpick.api.cards import SETTINGS, Cards
from d2rpick.api.request import JUDGING, options_of, typed
from d2rpick.base.errors import ConfigurationError
from d2rpick.base.settings import RULE_KEYS, nearest_settings, refuse_unknown
from d2rpick.cli import COMMANDS
from d2rpick.cli.values import File

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

CARDS: Final = tuple(options_of(Cards))
# What counts only beside one of other options: settings are for all commands, and not all of them are asked for it.
_BESIDE: Final[dict[str | None, tuple[str, ...]]] = {
    "weights": ("deck",),
    "step_ratio": ("cost_share", "deck"),
    **dict.fromkeys(CARDS, ("report", "write_deck")),
}


def settings_of(ctx: click.Context, without: click.Context) -> tuple[dict[str, Any], str]:
    """Values of options by name, as the settings nearest to the working folder give them, and their file.

    Keys of all commands stand above, those of one command in a table of its name.  ``without`` holds what the command
    line and the environment give: what they exclude counts for nothing.

    Raises
    ------
    ConfigurationError
        For a key that is no option, or a value that is none of it.
    """
    table, source = nearest_settings(os.curdir)
    own = {option: _value(ctx, option, value, place) for option, value, place in _given(ctx.command, table, source)}
    given = {name: one for name, one in without.params.items() if _source(without, name) is not ParameterSource.DEFAULT}
    asked = {**{option.name: value for option, value in own.items()}, **given}
    return {option.name or "": value for option, value in own.items() if _counts(ctx, option, given, asked)}, source


def _given(
    command: click.Command, table: Mapping[str, object], source: str
) -> Iterator[tuple[click.Option, object, str]]:
    """Options of a command that the settings name, with what stands there and where; unknown keys are refused."""
    tables = {name: one for name, one in table.items() if isinstance(one, Mapping)}
    shared = {name: one for name, one in table.items() if name not in (*tables, *RULE_KEYS)}
    refuse_unknown(shared, (*RULE_KEYS, *SETTINGS), source)
    refuse_unknown(tables, (*COMMANDS, "severity"), source)
    options = {spelled(one): one for one in command.params if isinstance(one, click.Option)}
    own = tables.get(command.name or "", {})
    refuse_unknown(own, options, f"{source}: {command.name}")
    for name, value in {**shared, **own}.items():
        if name in options:
            yield options[name], value, f"{source}: {name}"


def _value(ctx: click.Context, option: click.Option, value: Any, place: str) -> Any:
    """Read the value of an option; files lie where the settings do."""
    several = option.multiple or option.nargs > 1
    if isinstance(value, bool) != option.is_flag or isinstance(value, Mapping) or isinstance(value, list) > several:
        kind = "true or false" if option.is_flag else "a list" if option.nargs > 1 else "a number or a text"
        raise ConfigurationError(f"{place} is {value!r}, {kind} was expected")
    try:
        found = option.type_cast_value(ctx, [value] if option.multiple and not isinstance(value, list) else value)
    except click.BadParameter as error:
        raise ConfigurationError(f"{place}: {error.message}") from None
    if not isinstance(option.type, File):
        return found
    from pathlib import Path  # mostly no file is among the settings

    folder = os.path.relpath(Path(place.partition(": ")[0]).parent)
    return [str(Path(folder, name)) for name in found] if several else str(Path(folder, found))


def _counts(ctx: click.Context, option: click.Option, given: Mapping[str, Any], asked: Mapping[Any, Any]) -> bool:
    """Whether a setting counts, beside the options that are ``given``, and with all that is ``asked``."""
    if any(name in given for name in getattr(option, "instead_of", ())):
        return False
    if option.name in CARDS and (ctx.command.name == "card" or asked.get("output_format") == "card"):
        return True
    unjudged = option.name in JUDGING and ctx.command.name in ("card", "check")
    beside = ("history",) if unjudged else _BESIDE.get(option.name, ())
    return not beside or any(asked.get(name) for name in beside)


def _source(ctx: click.Context, name: str | None) -> ParameterSource | None:
    return ctx.get_parameter_source(name or "")


def words_of(ctx: click.Context) -> Sequence[str]:
    """Write the options that settings gave as they are typed."""
    of_settings = (one for one in ctx.command.params if _source(ctx, one.name) is ParameterSource.DEFAULT_MAP)
    options = [one for one in of_settings if isinstance(one, click.Option)]
    return [text for one in options for text in typed(spelled(one), ctx.params[one.name or ""], many=one.multiple)]


def spelled(option: click.Option) -> str:
    """Spell an option in full, as in the settings."""
    return max(option.opts, key=len)[2:]
