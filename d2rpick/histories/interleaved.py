"""Recognise and reject tables with a row for each part and time, because they contain no single energy history."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from d2rpick.base.errors import FormatError, list_names
from d2rpick.histories.samples import FEWEST_TIMES, count_rows_per_time

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from d2rpick.histories.history import Samples

# Smallest energy variation between rows that indicates several parts, relative to the variation due to noise [-].
# Without noise, a single energy varies as much from row to row as from time to time.
# Noise multiplies a single energy's variation from row to row by at most the number of rows per time.
_VARIES_MORE: Final = 3.0
_MOST_PARTS: Final = 1000


def is_of_several_parts(time: Samples, energy: Samples) -> bool:
    """Return True if an energy (n,) jumps between rows of the same time, because the rows alternate between parts.

    ``time`` (n,) contains the times of the rows.
    """
    rows = count_rows_per_time(time)
    if rows == 1:
        return False
    last_rows = np.append(time[1:] != time[:-1], True)
    from_row_to_row = np.abs(np.diff(energy)).sum()
    from_time_to_time = np.abs(np.diff(energy[last_rows])).sum()
    return bool(from_row_to_row > _VARIES_MORE * rows * from_time_to_time)


def find_part_column(columns: Mapping[str, Sequence[object]], rows: int) -> str | None:
    """Return the first column that has the same ``rows`` distinct values at each time; None if there is none.

    Examples
    --------
    >>> find_part_column({"IE": [1, 2, 3, 4, 5, 6], "part": ["a", "b", "a", "b", "a", "b"]}, 2)
    'part'
    """
    for name, values in columns.items():
        cycle = list(values[:rows])
        times = len(values) // rows
        if times < FEWEST_TIMES or len(set(cycle)) < rows:
            continue
        if list(values[: rows * times]) == cycle * times:
            return name
    return None


def refuse_rows_of_parts(
    source: str, time: Samples, energy: Samples, columns: Mapping[str, Sequence[object]]
) -> None:
    """Raise FormatError if a table has a row for each part and time.

    Parameters
    ----------
    source : str
        Name of the file, for the message.
    time, energy : array of shape (n,)
        Times in the order of the rows [time], and the values used as the energy [energy].
        The first rows of the columns that may identify the parts, by name.
    """
    rows = count_rows_per_time(time)
    if not 1 < rows <= _MOST_PARTS:
        return
    parts = find_part_column(columns, rows)
    if parts is None and not is_of_several_parts(time, energy):
        return
    problem = f"{source}: each time stands {rows} times with different energies, but one row for each time was expected"
    if parts is None:
        raise FormatError(f"{problem}; give the rows of one part")
    values = list_names(
        [str(value) for value in dict.fromkeys(columns[parts][:rows])], most=6
    )
    raise FormatError(
        f"{problem}; column {parts!r} tells the parts apart ({values}): give the rows of one part"
    )
