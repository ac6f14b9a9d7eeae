"""Name everything that a command line lacks in one message, so that one correction is enough."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

import click

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping

    # A function of the values given on the command line that names what else a command needs.
    ListNeeds = Callable[[Mapping[str, Any]], Iterable[str]]

# What a positional argument names, by its name in capitals.
_ARGUMENTS: Final = {
    "HISTORY...": "file, folder or quoted pattern of the run",
    "DECK": "main deck of the run",
    "DECK...": "main deck of the run",
    "RUN": "file or folder of the run",
    "RUN...": "folder of a run",
}

# The options without which no card of a solver can be printed, with their meanings.
_NEEDS_OF_CARD: Final = {
    "part": "--part IDS (parts to switch)",
    "node": "--node IDS (main nodes of the rigid bodies)",
    "end": "--end T (end of the run, or --history HISTORY)",
}


def explain_missing(
    ctx: click.Context, given_values: Mapping[str, Any], list_needs: ListNeeds | None
) -> str:
    """Return the message that names all missing arguments and options; empty if none is missing.

    ``given_values`` are the values of the command line, and ``list_needs`` names what the command needs depending on
    them.
    """
    missing = [
        _name_parameter(ctx, parameter)
        for parameter in ctx.command.get_params(ctx)
        if parameter.required and not given_values.get(parameter.name or "")
    ]
    missing += list_needs(given_values) if list_needs else ()
    return f"missing: {'; '.join(missing)}" if missing else ""


def _name_parameter(ctx: click.Context, parameter: click.Parameter) -> str:
    """Return the name of a required argument or option, with its meaning in brackets."""
    name = parameter.make_metavar(ctx)
    if not isinstance(parameter, click.Option):
        meaning = _ARGUMENTS[name]
        return f"{name.removesuffix('...')} ({meaning})"
    meaning = (parameter.help or "").partition(";")[0].rstrip(".")
    return f"{max(parameter.opts, key=len)} {name} ({meaning[0].lower()}{meaning[1:]})"


def list_needs_of_motion(values: Mapping[str, Any]) -> Iterable[str]:
    """Yield the options for which ``replay`` has alternatives, none of which was given."""
    if values.get("frame_mass") is None and values.get("beta") is None:
        yield "--frame-mass NUMBER or --beta NUMBER (frame mass m, or mass ratio M/m)"
    if all(values.get(name) is None for name in ("v0", "z0", "y0", "vz0", "vy0")):
        yield "--v0 NUMBER, or some of --z0, --y0, --vz0 and --vy0 (start of the motion)"


def list_needs_of_card(values: Mapping[str, Any]) -> Iterable[str]:
    """Yield what ``card`` lacks: times, and without a history the parts or bodies and the end of the run."""
    if not values.get("windows"):
        times = [name for name in ("tr", "td") if not values.get(name)]
        if times:
            names = " and ".join(f"--{name} T" for name in times)
            yield f"{names} (or --windows FILE, with lines 'tr td')"
    if values.get("history"):
        return
    # Imported here to keep start-up fast.
    from d2rpick.api.needs import list_needs_of_solver

    for name in list_needs_of_solver(values.get("solver")):
        if values.get(name) in (None, ()):
            yield _NEEDS_OF_CARD[name]


def list_needs_of_first(values: Mapping[str, Any]) -> Iterable[str]:
    """Yield what ``first`` lacks according to its deck, if the folder for the copy is missing too."""
    if not values.get("deck") or values.get("output_dir"):
        return
    # Imported here to keep start-up fast.
    from d2rpick.api.needs import list_needs_of_first_run

    yield from list_needs_of_first_run(
        values["deck"], bool(values.get("part")), values.get("wait")
    )


def list_needs_of_drive(values: Mapping[str, Any]) -> Iterable[str]:
    """Yield the programs and the parts that ``drive`` lacks, unless only programs are missing.

    Unknown programs alone are reported later, when the other options have been checked.
    """
    # Imported here to keep start-up fast.
    from d2rpick.api.needs import (
        deactivates_no_body,
        list_needs_of_deck,
        list_unknown_programs,
    )

    deck = values.get("deck")
    unknown = list_unknown_programs(values.get("starter"), values.get("engine"))
    is_incomplete = not deck or not values.get("folder")
    if deck and is_incomplete:
        yield from list_needs_of_deck(deck)
    has_unknown_parts = not values.get("part") and (
        (unknown or is_incomplete) and deck and deactivates_no_body(deck)
    )
    if unknown and (is_incomplete or has_unknown_parts):
        names = " and ".join(f"--{program} 'CMD {{deck}}'" for program in unknown)
        yield f"{names} (or OPENRADIOSS_PATH, the folder of OpenRadioss)"
    if has_unknown_parts:
        yield "--part IDS (parts to switch)"
