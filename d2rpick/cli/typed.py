"""The command line as it was typed, for questions that are asked again."""

from __future__ import annotations

import os
from typing import Any

import click

# What of the options says how to read a history and how to judge by it.
JUDGING = ("input_format", "time", "energy", "flying", "channel", "after", "margin", "tolerance")
# What of the options of ``suggest`` a td is judged by.
ASKING = (
    *("part", *JUDGING, "max_kinetic_share", "max_residual", "stiffness", "mass", "frame_mass", "beta", "alpha", "v0"),
    *("fit_window", "no_verify", "strict", "cost_share", "step_ratio", "deck", "weights"),
)
# Options that write files, which the same command would find the next time.
_WRITTEN = ("output_file", "plot", "report", "write_deck")


def judging(options: dict[str, Any]) -> list[str]:
    """Give the options of ``reference_options`` that judge by the history that ``history_options`` named."""
    names = [*JUDGING, *(["part"] if options["part"] else [])]
    context = click.get_current_context()
    given = [name for name in names if context.get_parameter_source(name) is not click.core.ParameterSource.DEFAULT]
    pairs = [(name, value) for name in ("history", *given) for value in _each(options[name])]
    return [text for name, value in pairs for text in (f"--{dashed(name)}", str(value))]


def asking() -> tuple[list[str], list[str]]:
    """Give the command line that asks for the pair of a td by the same history, in front of td and behind it."""
    from d2rpick.report.shell import positional  # not above: most answers repeat no command

    context = click.get_current_context()
    given = [
        text
        for option in context.command.params
        if option.name in ASKING and context.get_parameter_source(option.name) is not click.core.ParameterSource.DEFAULT
        for text in _typed(option, context.params[option.name])
    ]
    return ["d2rpick", "suggest", "--td"], [*given, *positional(context.params["history"])]


def _typed(option: click.Parameter, value: Any) -> list[str]:
    """Write an option with its value as it would be typed."""
    name = max(option.opts, key=len)
    if value is True:
        return [name]
    given = value if option.multiple else [value]
    return [text for one in given for text in (name, *map(str, _each(one)))]


def repeat() -> list[str]:
    """Give the command line that was typed, and before it the environment variables that set options.

    It may replace the files that it has written, so that it can be typed again.
    """
    context = click.get_current_context()
    source = click.core.ParameterSource.ENVIRONMENT
    names = [
        f"{context.auto_envvar_prefix}_{name.upper()}"
        for name in context.params
        if context.get_parameter_source(name) is source
    ]
    variables = [f"{name}={os.environ[name]}" for name in names]
    words = list(context.meta["d2rpick.command"])
    if not context.params["overwrite"] and any(context.params.get(name) for name in _WRITTEN):
        words.insert(words.index("--") if "--" in words else len(words), "--overwrite")
    return [*(["env", *variables] if variables else []), "d2rpick", *words]


def _each(value: Any) -> tuple[Any, ...]:
    return value if isinstance(value, tuple) else (value,)


def dashed(name: str) -> str:
    """Give the name of an option as it is typed."""
    return name.replace("_", "-")
