"""Define options for times of a run. A time with a unit remains a string until the unit of the run is known."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from d2rpick.base.errors import ArgumentError
from d2rpick.cli.values import NumberType

if TYPE_CHECKING:
    from collections.abc import Sequence

    from d2rpick.api.request import Request

# Commands that compute runs in SI units and therefore expect times in seconds.
_IN_SECONDS = ("rollover",)
# Name of the argument with the files of one run.
_ONE_RUN = "history"
_MANY_RUNS = "run"
# Options that affect the time unit of a run.
_COLUMNS = ("input_format", "time", "energy", "channel")


class TimeType(NumberType):
    """A time of the run: a number, or a string such as 64ms that `convert_typed_times` replaces with a number."""

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> Any:
        """Read a number, or keep a time with a unit as it was typed."""
        if isinstance(value, str) and value.strip()[-1:].isalpha():
            from d2rpick.api.times import is_time_with_unit

            if is_time_with_unit(value):
                return value.strip()
        return super().convert(value, param, ctx)


def convert_typed_times(ctx: click.Context) -> None:
    """Convert those times of a command that were typed with a unit to numbers in the unit of the run.

    Raises
    ------
    click.BadParameter
        If the unit of the run is not known, or a number is outside its limits.
    """
    typed = {
        option.name: option
        for option in ctx.command.params
        if isinstance(option.type, TimeType)
        and option.name
        and _has_text(ctx.params.get(option.name))
    }
    if not typed:
        return
    unit, source = _find_unit(ctx)
    for name, option in typed.items():
        ctx.params[name] = _convert(ctx.params[name], option, ctx, unit, source)


def _has_text(value: Any) -> bool:
    """Return True if a value, or any item of a tuple of values, is a string."""
    if isinstance(value, tuple):
        return any(_has_text(single) for single in value)
    return isinstance(value, str)


def _convert(
    value: Any, option: click.Parameter, ctx: click.Context, unit: str, source: str
) -> Any:
    """Return a time, or a tuple of times, as numbers."""
    from d2rpick.api.times import convert_typed_time

    if isinstance(value, tuple):
        return tuple(_convert(single, option, ctx, unit, source) for single in value)
    if not isinstance(value, str):
        return value
    try:
        number = convert_typed_time(value, unit, source)
    except ArgumentError as error:
        raise click.BadParameter(str(error), ctx, option) from None
    return option.type.convert(number, option, ctx)


def _find_unit(ctx: click.Context) -> tuple[str, str]:
    """Return the time unit of a command's run, empty if unknown, and the source that should give the unit."""
    if ctx.command.name in _IN_SECONDS:
        return "s", ""
    runs = _list_runs(ctx)
    if not runs and (deck := ctx.params.get("deck")):
        from d2rpick.api.times import find_unit_of_deck

        return find_unit_of_deck(deck)
    if not runs:
        return "", "the command line, which names no run"
    if any("-" in names for names in runs):
        return "", "standard input"
    from d2rpick.api.times import find_common_unit

    request = _make_reading_request(ctx)
    selection = request.selection(parts=False)
    return find_common_unit(runs, selection, request.input_format)


def _list_runs(ctx: click.Context) -> Sequence[Sequence[str]]:
    """Return the names of the files of each run on the command line."""
    if history := ctx.params.get(_ONE_RUN):
        return [history]
    names = ctx.params.get(_MANY_RUNS)
    if not isinstance(names, tuple) or ctx.params.get("listed"):
        return []
    from d2rpick.api.studies import find_runs

    return [[name] for name in find_runs(names)]


def _make_reading_request(ctx: click.Context) -> Request:
    """Make a request from those command-line options that control how the history is read."""
    from d2rpick.api.request import Request

    return Request(
        **{name: ctx.params[name] for name in _COLUMNS if name in ctx.params}
    )
