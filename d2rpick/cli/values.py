"""Kinds of values that options take: how they are read, and how the shell completes them."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, Final

import click

from d2rpick.api.request import UNLIMITED, Number

if TYPE_CHECKING:
    from collections.abc import Iterable

    from click.shell_completion import CompletionItem

    from d2rpick.histories.run import Run

if TYPE_CHECKING:
    FloatType = click.ParamType[float]
else:
    FloatType = click.ParamType  # generic from click 8.4 on


class NumberType(FloatType):
    """A finite number with a point within its limits."""

    name = "number"

    def __init__(self, limits: Number) -> None:
        self.limits = limits

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        """Read a number or fail with what was found and what was expected."""
        low, high, above = self.limits
        try:
            number = float(value)
        except ValueError:
            self.fail(f"{value!r} is not a number{_without_unit(str(value))}", param, ctx)
        if not math.isfinite(number):
            self.fail(f"{value!r} is not a finite number", param, ctx)
        limit = f"{'above' if above else 'of at least'} {low:g}" if number < low or (above and number == low) else ""
        limit = limit or (f"of at most {high:g}" if number > high else "")
        if limit:
            self.fail(f"{value} was found, a number {limit} was expected", param, ctx)
        return number


def _without_unit(text: str) -> str:
    """Say how a time with a unit is given, or nothing."""
    from d2rpick.histories.names import in_seconds

    value = in_seconds(text)
    return "" if value is None else f": give a number in the unit of the history, {value:g} where it is s"


class File(click.types.StringParamType):
    """Name of a file or folder, for the shell to complete."""

    envvar_list_splitter = ";"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Take a name; one with a NUL byte, which only a program can give, is none of a file."""
        name = super().convert(value, param, ctx)
        if "\0" in name:
            self.fail(f"{name!r} holds a NUL byte, the name of a file was expected", param, ctx)
        return name

    def shell_complete(self, ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem]:  # noqa: ARG002
        """Leave it to the shell."""
        from click.shell_completion import CompletionItem

        return [CompletionItem(incomplete, type="file")]


class Names(click.types.StringParamType):
    """Names that are separated by semicolons in an environment variable, since labels hold blanks."""

    envvar_list_splitter = ";"


class PartNames(Names):
    """Numbers and titles of parts, for the shell to complete from the history that was typed before."""

    def shell_complete(self, ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem]:  # noqa: ARG002
        """Offer the parts of the files that were typed before, and the words for several."""
        run = _typed_run(ctx)
        parts = run.parts if run else ()
        words = [("flying", "parts that fly together"), ("all", "every part that has energy")]
        offered = [*((str(part.id), part.title) for part in parts), *((p.title, str(p.id)) for p in parts), *words]
        return _completed(offered, incomplete)


class RuleIds(click.types.StringParamType):
    """Ids of the rules of check."""

    def shell_complete(self, ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem]:  # noqa: ARG002
        """Offer the rules that begin so, with what they say."""
        from d2rpick.rules import RULES

        return _completed([(rule.id, rule.summary) for rule in RULES.values()], incomplete.upper())


class ChannelNames(Names):
    """Names of channels, for the shell to complete from the history that was typed before."""

    def shell_complete(self, ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem]:  # noqa: ARG002
        """Offer the channels of the files that were typed before; underscores stand for blanks, as they may."""
        run = _typed_run(ctx)
        names = (name.replace(" ", "_") for one in (run.databases if run else ()) for name in one.channels)
        return _completed([(name, "") for name in names], incomplete)


def _typed_run(ctx: click.Context) -> Run | None:
    """Open the files that were typed before; None where they are none of a run."""
    from pathlib import Path

    from d2rpick.base.errors import D2RPickError
    from d2rpick.histories.opening import open_run

    words = ctx.meta.get("d2rpick.command", ())[1:]  # click has read no argument yet when an option is completed
    try:
        return open_run([word for word in words if Path(word).exists()])
    except (D2RPickError, OSError, IndexError):
        return None


def _completed(offered: Iterable[tuple[str, str]], incomplete: str) -> list[CompletionItem]:
    """Give the names that begin with what was typed; what a shell would take apart is left out."""
    import re

    from click.shell_completion import CompletionItem

    words = [(name, told) for name, told in offered if re.fullmatch(r"[\w./-]+", name)]
    return [CompletionItem(name, help=told) for name, told in words if name.startswith(incomplete)]


class SolverName(click.types.StringParamType):
    """Name of a solver whose input can be printed; the table of solvers is read when it is asked."""

    name = "solver"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> str:
        """Take a name or fail with those there are."""
        from d2rpick.deck.printing import SOLVERS

        if value not in SOLVERS:
            self.fail(f"{value!r} was found, one of {', '.join(SOLVERS)} was expected", param, ctx)
        return str(value)

    def get_metavar(self, *_: Any, **__: Any) -> str:
        """Show the names in the help."""
        from d2rpick.deck.printing import SOLVERS

        return f"[{'|'.join(SOLVERS)}]"

    def shell_complete(self, ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem]:  # noqa: ARG002
        """Offer the names that begin so."""
        from d2rpick.deck.printing import SOLVERS

        return _completed([(name, "") for name in SOLVERS], incomplete)


_NAMED: Final = {
    "text": click.STRING,
    "file": File(),
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
        return click.IntRange(kind.start, None if kind.stop >= UNLIMITED else kind.stop - 1)
    return NumberType(kind) if isinstance(kind, Number) else click.Choice(kind)
