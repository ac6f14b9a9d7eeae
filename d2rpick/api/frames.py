"""Rows of a result as a table in pandas."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    import pandas as pd


def frame_of(rows: Sequence[Mapping[str, Any]], columns: Sequence[str], **attrs: Any) -> pd.DataFrame:
    """Give a row per mapping; what is not known is NaN, also where nothing of a column is known.

    Examples
    --------
    >>> frame_of([{"tr": 0.5, "residual": None}], ["tr", "residual"]).dtypes.astype(str).tolist()
    ['float64', 'float64']
    """
    import pandas as pd

    frame = pd.DataFrame(list(rows), columns=list(columns))
    frame = frame.astype({name: "float64" for name in frame.columns if len(frame) and frame[name].isna().all()})
    frame.attrs.update(attrs)
    return frame
