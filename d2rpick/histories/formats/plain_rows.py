"""Rows of numbers that are all alike, read at once: every number is the one that `float` reads, with any pandas."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from d2rpick.histories.formats.layout import Layout
    from d2rpick.histories.history import Samples

_UNIT_SEPARATOR: Final = "\x1f"  # no table has this control character
# How far a reader that rounds may be off, of the number: the fast one of pandas takes 17 digits, with leading zeros.
_ROUNDED: Final = 1e-9


def plain_rows(
    piece: bytes, layout: Layout, used: Sequence[int], *, is_large: bool
) -> Samples | None:
    """Read the columns ``used`` of whole lines, shape (rows, len(used)).

    ``is_large`` is whether they are part of a large text, for which the import of a fast reader pays.  None unless all
    rows have all cells and no other line is between them.
    """
    if layout.thousands:
        return None
    if b'"' in piece:
        unquoted = _without_quotes(piece, layout)
        if unquoted is None:
            return None
        piece, layout = unquoted, layout._replace(separator=_UNIT_SEPARATOR)
    if layout.decimal == ",":
        if b"." in piece:
            return None
        piece = piece.replace(b",", b".")
    taken, chosen = [*range(layout.columns)], None
    closed = piece[: piece.index(b"\n")].endswith(
        (layout.separator or "\n").encode("latin-1")
    )
    if layout.separator and (closed or sorted(used) != taken):
        # otherwise the parser sees to it that each row has its cells
        if not _has_all_cells(piece, layout):
            return None
        taken = sorted({0, *used})  # a comment would show in the first column
        chosen = taken if closed or len(taken) < layout.columns else None
    try:
        table = (
            _by_pandas(piece, layout, chosen)
            if is_large
            else _by_numpy(piece, layout, chosen)
        )
    except ValueError:
        return None
    lines = np.count_nonzero(
        np.frombuffer(piece, np.uint8) == ord("\n")
    )  # count() is slow where they are short
    if table.shape != (lines, len(taken)):
        return None  # blank lines were passed over
    return table if taken == [*used] else table[:, np.searchsorted(taken, used)]


def _without_quotes(piece: bytes, layout: Layout) -> bytes | None:
    """Put a sign that no text has between the cells of rows that are all in quotes; None if there are others."""
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


def _by_numpy(piece: bytes, layout: Layout, columns: Sequence[int] | None) -> Samples:
    """Columns of rows of numbers, all unless some are chosen; ValueError where there is something else."""
    lines = piece.decode("latin-1").split("\n")[
        :-1
    ]  # no character beside those of latin-1 belongs to a number
    if not lines[0].strip():
        raise ValueError  # numpy passes over it, and warns where there is no other
    return np.loadtxt(
        lines, delimiter=layout.separator, comments=None, ndmin=2, usecols=columns
    )


def _by_pandas(piece: bytes, layout: Layout, columns: Sequence[int] | None) -> Samples:
    """The same, five times as fast."""
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
    if [*map(int, pd.__version__.split(".")[:2])] < [
        3,
        1,
    ]:  # from there on always exact, as `float` is
        if columns is None and layout.separator:
            fast = pd.read_csv(
                BytesIO(piece), sep=separator, float_precision="high", **options
            ).to_numpy()
            exact = exact_numbers(piece, layout.separator, fast)
            if exact is not None:
                return exact
        options["float_precision"] = "round_trip"  # takes three times as long
    table: Samples = pd.read_csv(BytesIO(piece), sep=separator, **options).to_numpy()
    return table


def exact_numbers(piece: bytes, separator: str, fast: Samples) -> Samples | None:
    """Read rows of numbers exactly, by scipy; None if it cannot or reads something else than a reader that rounds.

    Scipy takes them as a matrix with one number a line, and passes over what is behind a number in its line: so it is
    not trusted alone.  ``fast``, shape (rows, columns), are the numbers to some nine digits.
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
    with np.errstate(invalid="ignore"):  # what is not finite does not agree
        agrees = np.abs(exact - fast) <= _ROUNDED * np.abs(exact)
    return exact if bool(np.all(agrees)) else None


def _has_all_cells(piece: bytes, layout: Layout) -> bool:
    """Whether all rows have their number of cells, and end alike."""
    assert layout.separator
    signs = np.frombuffer(piece, np.uint8)
    ends = signs == ord("\n")
    closed = piece.startswith(
        layout.separator.encode("latin-1"), piece.index(b"\n") - 1
    )  # rows end with a separator
    each, rows = layout.columns + closed, np.count_nonzero(ends)
    marks = np.flatnonzero(ends | (signs == ord(layout.separator)))
    if marks.size != rows * each:
        return False
    table = marks.reshape(rows, each)
    return bool(
        np.all(ends[table[:, -1]])
        and (not closed or np.all(np.diff(table[:, -2:]) == 1))
    )
