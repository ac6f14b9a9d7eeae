"""Read uniform rows of numbers in one step, with results equal to those of `float` for any pandas version."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from d2rpick.histories.formats.layout import Layout
    from d2rpick.histories.history import Samples

_UNIT_SEPARATOR: Final = "\x1f"  # A control character that does not occur in tables.
# Largest relative error of the fast number parser of pandas [-], which treats leading zeros as digits.
_ROUNDED: Final = 1e-9


def read_plain_rows(
    piece: bytes, layout: Layout, used: Sequence[int], *, is_large: bool
) -> Samples | None:
    """Read the columns ``used`` of complete lines, shape (rows, len(used)).

    Return None unless each line is a row with all its cells. ``is_large`` is True if the lines belong to a large text,
    for which the time to import pandas is worthwhile.
    """
    if layout.thousands:
        return None
    if b'"' in piece:
        unquoted = _remove_quotes(piece, layout)
        if unquoted is None:
            return None
        piece = unquoted
        layout = layout._replace(separator=_UNIT_SEPARATOR)
    if layout.decimal == ",":
        if b"." in piece:
            return None
        piece = piece.replace(b",", b".")
    read_columns = [*range(layout.columns)]
    chosen = None
    separator_bytes = (layout.separator or "\n").encode("latin-1")
    closed = piece[: piece.index(b"\n")].endswith(separator_bytes)
    if layout.separator and (closed or sorted(used) != read_columns):
        # In all other cases, the parser itself checks that no row lacks cells.
        if not _has_all_cells(piece, layout):
            return None
        # The first column is always read, because comments appear in it.
        read_columns = sorted({0, *used})
        if closed or len(read_columns) < layout.columns:
            chosen = read_columns
    read_table = _read_with_pandas if is_large else _read_with_numpy
    try:
        table = read_table(piece, layout, chosen)
    except ValueError:
        return None
    # bytes.count() is slow if lines are short.
    lines = np.count_nonzero(np.frombuffer(piece, np.uint8) == ord("\n"))
    if table.shape != (lines, len(read_columns)):
        return None  # The parser has skipped blank lines.
    if read_columns == [*used]:
        return table
    return table[:, np.searchsorted(read_columns, used)]


def _remove_quotes(piece: bytes, layout: Layout) -> bytes | None:
    """Replace the separators of rows whose cells are all quoted by a control character; None for other rows."""
    if layout.separator is None:
        return None
    between = f'"{layout.separator}"'.encode("latin-1")
    if not piece.startswith(b'"') or not piece.endswith(b'"\n'):
        return None
    piece = (
        piece[1:-2].replace(between, _UNIT_SEPARATOR.encode()).replace(b'"\n"', b"\n")
        + b"\n"
    )
    return None if b'"' in piece else piece


def _read_with_numpy(
    piece: bytes, layout: Layout, columns: Sequence[int] | None
) -> Samples:
    """Read rows of numbers with numpy, in the given columns or in all columns; raise ValueError for other rows."""
    # Numbers contain only characters of Latin-1.
    lines = piece.decode("latin-1").split("\n")[:-1]
    if not lines[0].strip():
        # numpy skips blank lines, and warns if there are no other lines.
        raise ValueError
    return np.loadtxt(
        lines, delimiter=layout.separator, comments=None, ndmin=2, usecols=columns
    )


def _read_with_pandas(
    piece: bytes, layout: Layout, columns: Sequence[int] | None
) -> Samples:
    """Read rows of numbers with pandas, which is five times as fast as numpy."""
    from csv import QUOTE_NONE
    from io import BytesIO

    import pandas as pd

    separator = layout.separator or r"\s+"
    options: dict[str, Any] = {
        "header": None,
        "usecols": columns,
        "dtype": np.float64,
        "quoting": QUOTE_NONE,
    }
    options |= {"low_memory": False, "skip_blank_lines": False, "na_filter": False}
    # Since pandas 3.1, the default parser has been as exact as `float`.
    if [*map(int, pd.__version__.split(".")[:2])] < [3, 1]:
        if columns is None and layout.separator:
            fast = pd.read_csv(
                BytesIO(piece), sep=separator, float_precision="high", **options
            ).to_numpy()
            exact = read_exact_numbers(piece, layout.separator, fast)
            if exact is not None:
                return exact
        # The exact parser takes three times as long.
        options["float_precision"] = "round_trip"
    table: Samples = pd.read_csv(BytesIO(piece), sep=separator, **options).to_numpy()
    return table


def read_exact_numbers(piece: bytes, separator: str, fast: Samples) -> Samples | None:
    """Parse rows of numbers exactly with scipy; None if scipy fails or contradicts the fast result ``fast``.

    Scipy reads them as a matrix file with one number per line. It ignores text after a number in the same line, so its
    result is compared with ``fast`` (rows, columns), which contains the numbers with about nine digits.
    """
    from io import BytesIO

    from scipy.io import mmread

    head = b"%%%%MatrixMarket matrix array real general\n%d 1\n" % fast.size
    try:
        exact: Samples = mmread(
            BytesIO(head + piece.replace(separator.encode("latin-1"), b"\n"))
        ).reshape(fast.shape)
    except ValueError:
        return None
    with np.errstate(invalid="ignore"):  # Non-finite numbers never count as equal.
        agrees = np.abs(exact - fast) <= _ROUNDED * np.abs(exact)
    return exact if bool(np.all(agrees)) else None


def _has_all_cells(piece: bytes, layout: Layout) -> bool:
    """Return True if all rows have the right number of cells, and either all or none of them end with a separator."""
    assert layout.separator
    signs = np.frombuffer(piece, np.uint8)
    ends = signs == ord("\n")
    closed = piece.startswith(
        layout.separator.encode("latin-1"), piece.index(b"\n") - 1
    )
    marks_per_row = layout.columns + closed
    rows = np.count_nonzero(ends)
    marks = np.flatnonzero(ends | (signs == ord(layout.separator)))
    if marks.size != rows * marks_per_row:
        return False
    table = marks.reshape(rows, marks_per_row)
    rows_end_in_time = bool(np.all(ends[table[:, -1]]))
    return rows_end_in_time and (
        not closed or bool(np.all(np.diff(table[:, -2:]) == 1))
    )
