"""Which columns of a table are meant: by name, by number, or by what they are called."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING

from d2rpick.errors import FormatError, listing
from d2rpick.histories.names import internal_energies, is_time, near_miss, normalised, refuse_other_quantity

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from d2rpick.histories.formats.layout import Layout


def labelled(layout: Layout, time: int) -> dict[str, int]:
    """Columns beside the time by the name they are called by, with their number where a name is not theirs alone."""
    names = [layout.channel(column) for column in range(layout.trusted)]
    bearers, times = Counter(names), {time, *own_times(layout)}
    return {
        name if bearers[name] == 1 else f"{name} (column {column + 1})": column
        for column, name in enumerate(names)
        if column not in times
    }


def own_times(layout: Layout) -> tuple[int, ...]:
    """Time columns of curves side by side, each with times of its own: x, y, x, y; nothing for another table."""
    times = tuple(column for column in range(0, layout.trusted, 2) if is_time(layout.name(column)))
    others = any(is_time(layout.name(column)) for column in range(1, layout.trusted, 2))
    return times if len(times) > 1 and 2 * len(times) == layout.columns and not others else ()


def time_column(source: str, layout: Layout, wanted: str | None, energies: Sequence[str]) -> tuple[int, list[str]]:
    """Column of the time, and what had to be assumed; of curves side by side the one beside the first energy."""
    if wanted is not None:
        return named_column(source, layout, wanted), []
    times = [i for i, column in enumerate(layout.names[: layout.trusted]) if is_time(column)]
    if own_times(layout):
        if energies:
            return named_column(source, layout, energies[0]) // 2 * 2, []
        return internal_energy(source, layout, times) // 2 * 2, []
    if len(times) > 1:
        raise FormatError(
            f"{source}: {len(times)} columns are named like a time; choose with `time`: {_menu(layout, times)}"
        )
    if layout.names and not times:
        return 0, [f"no column has the name of a time; {layout.name(0)!r}, the first, was taken as the time"]
    return (times[0] if times else 0), []


def internal_energy(source: str, layout: Layout, times: Sequence[int]) -> int:
    """Pick the only column beside the times, or else the one named like an internal energy."""
    apart = {*times}
    beside = [column for column in range(layout.columns) if column not in apart]
    if len(beside) == 1:
        refuse_other_quantity(layout.channel(beside[0]), source)
        return beside[0]
    sure = [column for column in beside if column < layout.trusted]
    named = [sure[i] for i in internal_energies([layout.name(column) for column in sure])]
    if len(named) == 1:
        return named[0]
    found = f"{len(named)} columns are" if named else "no column is"
    raise FormatError(
        f"{source}: {found} named like an internal energy; choose with `energy`: {_menu(layout, named or beside)}"
    )


def named_column(source: str, layout: Layout, wanted: str) -> int:
    """Find a column by its name, or by its 1-based number."""
    spellings: tuple[Callable[[str], str], ...] = (
        str.strip,
        lambda text: text.strip().casefold(),
        normalised,
    )
    found = next(
        (same for key in spellings if (same := [i for i, own in enumerate(layout.names) if key(own) == key(wanted)])),
        [],
    )
    if wanted.isdecimal() and 0 < int(wanted) <= layout.columns:
        found = [*({*found} | {int(wanted) - 1})]
    if not found:
        raise FormatError(
            f"{source}: no column {wanted!r}{near_miss(wanted, layout.names)}; "
            f"there are: {_menu(layout, range(layout.columns))}"
        )
    if len(found) > 1:
        raise FormatError(
            f"{source}: {wanted!r} may be any of these columns: {_menu(layout, found)}; "
            "choose by another name or number"
        )
    if found[0] >= layout.trusted:
        raise FormatError(
            f"{source}: the header has {len(layout.names)} names for {layout.columns} values (th_to_csv writes "
            f"such files), so the name of column {found[0] + 1} is not sure; "
            f"only these may be used: {_menu(layout, range(2))}"
        )
    return found[0]


def _menu(layout: Layout, columns: Sequence[int]) -> str:
    return listing([f"{column + 1} {layout.name(column)!r}" for column in columns])
