"""Which runs of a study stand out, and by what short names runs are told apart."""

from __future__ import annotations

from pathlib import PurePath
from typing import TYPE_CHECKING, Final

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from d2rpick.studies.row import StudyRow

# Tukey's fences: so many times the distance of the quartiles beyond them.
_FENCE: Final = 1.5


def outliers(rows: Sequence[StudyRow]) -> tuple[StudyRow, ...]:
    """Give the judged runs that stand out: those without a tr, then those whose tr lies beyond Tukey's fences.

    The farthest from the median come first.
    """
    without = [row for row in rows if row.judged and row.tr is None]
    chosen = [(row, row.tr) for row in rows if row.tr is not None]
    if not chosen:
        return tuple(without)
    low, middle, high = np.quantile([tr for _, tr in chosen], [0.25, 0.5, 0.75]).tolist()
    reach = _FENCE * (high - low)
    far = [(row, abs(tr - middle)) for row, tr in chosen if not low - reach <= tr <= high + reach]
    return (*without, *(row for row, _ in sorted(far, key=lambda one: -one[1])))


def short_names(sources: Sequence[str]) -> tuple[str, ...]:
    """Give of each name what tells it from the others: folders and file names that all share are left out.

    Examples
    --------
    >>> short_names(["runs/soft/glstat", "runs/hard/glstat"])
    ('soft', 'hard')
    >>> short_names(["runs/a.csv", "runs/b.csv"])
    ('a.csv', 'b.csv')
    """
    paths = [PurePath(source).parts for source in sources]
    depth = min(map(len, paths), default=0)
    first = next((i for i in range(depth) if len({path[i] for path in paths}) > 1), max(depth - 1, 0))
    last = next((i for i in range(1, depth + 1) if len({path[-i] for path in paths}) > 1), 1)
    kept = (path[first : len(path) - last + 1] or path[-1:] for path in paths)
    return tuple("/".join(part.strip("/") for part in one) or source for one, source in zip(kept, sources, strict=True))
