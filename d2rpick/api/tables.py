"""Convert the tables of other libraries to pandas frames without importing these libraries."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
    import pandas as pd

_SERIES_NAME: Final = "internal_energy"
_METHODS_OF_TABLES: Final = (
    "to_pandas",
    "to_dataframe",
    "to_frame",
    "get_column",
    "columns",
)


def is_table(value: Any) -> bool:
    """Return True if a value is a table of a library or an array of numbers, and False if it is the name of a file.

    Examples
    --------
    >>> import numpy as np
    >>> is_table(np.zeros((3, 2))), is_table(np.array(["a.csv"])), is_table({"time": [0.0]}), is_table("a.csv")
    (True, False, True, False)
    """
    kind = getattr(getattr(value, "dtype", None), "kind", "")
    if kind:
        return hasattr(value, "ndim") and kind not in "OUST"
    # Only the type is examined, because reading the columns of a lazy frame would compute them.
    return isinstance(value, Mapping) or any(
        hasattr(type(value), name) for name in _METHODS_OF_TABLES
    )


def is_plain_array(table: Any) -> bool:
    """Return True for a numpy array whose columns have no names."""
    return hasattr(table, "__array_interface__") and table.dtype.names is None


def convert_to_frame(table: Any) -> pd.DataFrame:
    """Return a table as a pandas.DataFrame.

    Parameters
    ----------
    table : pandas, polars, pyarrow or xarray object, numpy array, or mapping of columns
        A Series or DataArray is treated as the internal energy.  An array of numbers (n, k) has columns without names.

    Raises
    ------
    TypeError
        If the value is none of these.
    """
    import pandas as pd

    if isinstance(table, pd.DataFrame):
        return table
    if isinstance(table, pd.Series):
        return table.to_frame(_SERIES_NAME)
    # The table is an xarray object; only a DataArray has a name.
    if hasattr(table, "to_dataframe"):
        if hasattr(table, "name"):
            frame = table.to_dataframe(name=_SERIES_NAME)
        else:
            frame = table.to_dataframe()
        return pd.DataFrame(frame)
    if hasattr(table, "collect"):  # The table is a lazy polars frame.
        table = table.collect()
    # The table is a polars frame, whose own conversion to pandas needs pyarrow.
    if hasattr(table, "columns") and hasattr(table, "get_column"):
        return pd.DataFrame(
            {str(name): table.get_column(name).to_numpy() for name in table.columns}
        )
    if hasattr(table, "to_pandas"):  # The table comes from pyarrow or another library.
        frame = table.to_pandas()
        if isinstance(frame, pd.Series):
            return frame.to_frame(_SERIES_NAME)
        return pd.DataFrame(frame)
    if isinstance(table, Mapping):
        return pd.DataFrame({str(name): values for name, values in table.items()})
    kind = getattr(getattr(table, "dtype", None), "kind", "")
    if kind == "V" or (kind and kind in "iuf" and table.ndim == 2):
        return pd.DataFrame(table)
    description = f"frame is of type {type(table).__name__}"
    if kind:
        description = f"frame is an array of shape {table.shape}"
    raise TypeError(
        f"{description}, but a table was expected: of pandas, polars, pyarrow or xarray, an array of rows and columns, "
        "or a mapping of columns"
    )
