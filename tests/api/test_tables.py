"""Tables of other libraries: real ones if the libraries are installed, otherwise stand-ins with the same interface."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pandas as pd
import pytest

import d2rpick as d2

TIME = np.arange(50) * 0.01
ENERGY = 1 - np.cos(20 * TIME)
FRAME = pd.DataFrame(
    {"time": TIME, "internal_energy": ENERGY, "kinetic_energy": 5 - ENERGY}
)
loose: Any = d2


def convert_to_polars(frame: pd.DataFrame) -> Any:
    library: Any = pytest.importorskip("polars")
    return library.DataFrame({name: frame[name].to_numpy() for name in frame})


def convert_to_arrow(frame: pd.DataFrame) -> Any:
    library: Any = pytest.importorskip("pyarrow")
    return library.table({name: frame[name].to_numpy() for name in frame})


def convert_to_dataset(frame: pd.DataFrame) -> Any:
    library: Any = pytest.importorskip("xarray")
    return library.Dataset.from_dataframe(frame.set_index("time"))


def convert_to_data_array(frame: pd.DataFrame) -> Any:
    library: Any = pytest.importorskip("xarray")
    return library.DataArray(
        frame["internal_energy"].to_numpy(), coords={"time": TIME}, dims="time"
    )


class Polars:
    """Stand-in with the interface of a polars frame."""

    def __init__(self, frame: pd.DataFrame) -> None:
        self._frame, self.columns = frame, list(frame)

    def get_column(self, name: str) -> pd.Series:
        return self._frame[name]


class Lazy:
    """Stand-in with the interface of a polars lazy frame, whose columns are expensive to find."""

    def __init__(self, frame: pd.DataFrame) -> None:
        self._frame = frame

    @property
    def columns(self) -> list[str]:
        raise AssertionError("costs a computation")

    def collect(self) -> Polars:
        return Polars(self._frame)


class Arrow:
    """Stand-in with the interface of a pyarrow table."""

    def __init__(self, frame: pd.DataFrame) -> None:
        self._frame = frame

    def to_pandas(self) -> pd.DataFrame:
        return self._frame


class Dataset:
    """Stand-in with the interface of an xarray dataset."""

    def __init__(self, frame: pd.DataFrame) -> None:
        self._frame = frame

    def to_dataframe(self) -> pd.DataFrame:
        return self._frame.set_index("time")


class DataArray:
    """Stand-in with the interface of an xarray array."""

    name = None

    def __init__(self, frame: pd.DataFrame) -> None:
        self._frame = frame

    def to_dataframe(self, name: str) -> pd.DataFrame:
        return self._frame.set_index("time")[["internal_energy"]].set_axis(
            [name], axis=1
        )


MADE: dict[str, Callable[[pd.DataFrame], Any]] = {
    "pandas": lambda frame: frame,
    "a series": lambda frame: frame.set_index("time")["internal_energy"],
    "a mapping": lambda frame: {name: frame[name].to_list() for name in frame},
    "records of numpy": lambda frame: frame.to_records(index=False),
    "rows and columns": lambda frame: frame[["time", "internal_energy"]].to_numpy(),
    **{
        function.__name__: function
        for function in (
            convert_to_polars,
            convert_to_arrow,
            convert_to_dataset,
            convert_to_data_array,
        )
    },
    **{kind.__name__: kind for kind in (Polars, Lazy, Arrow, Dataset, DataArray)},
}


@pytest.mark.parametrize("name", MADE)
def test_a_table_of_any_library_is_taken_and_read_says_what_to_call(name: str) -> None:
    table = MADE[name](FRAME)
    frame = d2.from_frame(table).to_frame()
    np.testing.assert_array_equal(frame.index, TIME)
    np.testing.assert_array_equal(frame["internal_energy"], ENERGY)
    if not isinstance(table, Lazy):
        with pytest.raises(
            TypeError,
            match=r"source is a table of type \w+; give it to d2rpick.from_frame\(...\)",
        ):
            loose.read(table)


def test_columns_without_names_are_named_by_number() -> None:
    frame = d2.from_frame(FRAME.to_numpy(), energy=2, channels={"kinetic_energy": 3})
    np.testing.assert_array_equal(frame.to_frame()["internal_energy"], ENERGY)
    assert frame.files.databases[0].quantities == {"kinetic_energy": "column 3"}
    with pytest.raises(
        d2.FormatError, match="choose with `energy`: 2 'column 2', 3 'column 3'"
    ):
        d2.from_frame(FRAME.to_numpy()).to_frame()


def test_names_of_files_in_an_array_are_names_of_files() -> None:
    with pytest.raises(d2.FormatError, match=r"absent\.csv: no such file"):
        loose.read(np.array(["absent.csv"]))
