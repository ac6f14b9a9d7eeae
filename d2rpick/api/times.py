"""Convert times typed with a unit to numbers in the unit of the run."""

from __future__ import annotations

from typing import TYPE_CHECKING

from d2rpick.base.errors import ArgumentError
from d2rpick.histories.digits import convert_to_unit, parse_seconds

if TYPE_CHECKING:
    from collections.abc import Sequence

    from d2rpick.histories.names import Selection


def is_time_with_unit(text: str) -> bool:
    """Return True for a number with a unit of time after it.

    Examples
    --------
    >>> [is_time_with_unit(text) for text in ("64ms", "1.5 min", "64", "64 mm")]
    [True, True, False, False]
    """
    return parse_seconds(text) is not None


def find_time_unit(
    names: Sequence[str], selection: Selection, input_format: str
) -> str:
    """Return the time unit that the files of a run name; empty if they name no unit, or different units.

    Raises
    ------
    D2RPickError
        If a file cannot be read.
    """
    from d2rpick.histories.opening import open_run

    databases = open_run(names, selection, input_format).databases
    units = {database.time_unit for database in databases}
    return units.pop() if len(units) == 1 else ""


def convert_typed_time(text: str, unit: str, source: str) -> float:
    """Return a typed time as a number in the ``unit`` of the run; raise an error if ``source`` names no unit.

    Raises
    ------
    ArgumentError
        If the unit of the run is not known; the message has the number to give for s and ms.

    Examples
    --------
    >>> convert_typed_time("64ms", "s", "energy.csv")
    0.064
    """
    number = convert_to_unit(text, unit)
    if number is not None:
        return number
    in_seconds = convert_to_unit(text, "s")
    in_milliseconds = convert_to_unit(text, "ms")
    raise ArgumentError(
        f"{text!r}: the unit of time is not known from {source}; "
        f"give {in_seconds:.12g} if it is s, {in_milliseconds:.12g} if it is ms"
    )
