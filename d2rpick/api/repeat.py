"""The command line that gives the same answer as a call of the library."""

from __future__ import annotations

from typing import TYPE_CHECKING

from d2rpick.report.shell import positional

if TYPE_CHECKING:
    from collections.abc import Iterator

    from d2rpick.api.arguments import Choosing
    from d2rpick.api.runs import Run
    from d2rpick.histories.names import Selection
    from d2rpick.vibration.oscillator import Oscillator


def asking(run: Run, selection: Selection, choosing: Choosing) -> tuple[str, ...]:
    """Give what follows the times in such a command line."""
    return (*options_of(selection, choosing, run.input_format), *positional(run.sources))


def options_of(selection: Selection, choosing: Choosing, input_format: str) -> tuple[str, ...]:
    """Give the options that say how to read a history, select an energy of it and choose."""
    form = () if input_format == "auto" else ("--input-format", input_format)
    return (*form, *_selected(selection), *_options(choosing))


def _selected(selection: Selection) -> Iterator[str]:
    if selection.time is not None:
        yield from ("--time", selection.time)
    for option, values in (("energy", selection.energy), ("part", selection.parts), ("flying", selection.flying)):
        for value in values:
            yield from (f"--{option}", value)
    for quantity, channel in selection.channels:
        yield from ("--channel", f"{quantity}={channel}")


def _options(choosing: Choosing) -> Iterator[str]:
    for name, value in choosing.items():
        if name == "replay":
            yield from ("--no-verify",) * (not value)
        elif name == "strict":
            yield from ("--strict",) * bool(value)
        elif name == "oscillator" and value is not None:
            yield from _oscillator(value)  # type: ignore[arg-type]  # the values of a TypedDict are objects
        elif name == "fit_window" and value is not None:
            yield from ("--fit-window", *(repr(float(time)) for time in value))  # type: ignore[attr-defined]
        elif value is not None:
            yield from (f"--{name.replace('_', '-')}", repr(float(value)))  # type: ignore[arg-type]


def _oscillator(oscillator: Oscillator) -> Iterator[str]:
    names = {"stiffness": "stiffness", "mass": "mass", "frame_mass": "frame-mass", "alpha": "alpha"}
    for name, option in names.items():
        yield from (f"--{option}", repr(float(getattr(oscillator, name))))
