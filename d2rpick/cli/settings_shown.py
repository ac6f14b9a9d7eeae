"""What a command would be run with: every option with its value, and where that comes from."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

import click
from click.core import ParameterSource

from d2rpick.cli.output import text_bytes
from d2rpick.report.tables import as_line

if TYPE_CHECKING:
    from collections.abc import Iterator

_SOURCES: Final = {
    ParameterSource.COMMANDLINE: "command line",
    ParameterSource.ENVIRONMENT: "environment",
    ParameterSource.DEFAULT: "default",
    ParameterSource.DEFAULT_MAP: "default",
}


def show(ctx: click.Context) -> None:
    """Print the settings, one per line."""
    click.echo(text_bytes("\n".join(_lines(ctx))))


def _lines(ctx: click.Context) -> Iterator[str]:
    for option in ctx.command.get_params(ctx):
        if option.expose_value and option.name:
            source = ctx.get_parameter_source(option.name)
            named = f", {ctx.auto_envvar_prefix}_{option.name.upper()}" * (source is ParameterSource.ENVIRONMENT)
            where = _SOURCES.get(source, "default") if source else "default"
            yield f"{_spelled(option)} = {_written(ctx.params[option.name])}  # {where}{named}"


def _spelled(option: click.Parameter) -> str:
    """Name of an option as it is typed, without the dashes; of an argument its own."""
    return max(option.opts, key=len).lstrip("-")


def _written(value: Any) -> str:
    return "none" if value in (None, ()) else as_line(value)
