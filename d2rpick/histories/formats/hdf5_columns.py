"""Columns of an HDF5 file: those of datasets, matrices, compound types and tables of pandas, and their values."""

from __future__ import annotations

import math
import re
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np

from d2rpick.base.errors import FormatError
from d2rpick.histories.formats.hdf5_damage import check_data

if TYPE_CHECKING:
    from collections.abc import Iterator

    import h5py

    from d2rpick.histories.history import Samples

_PICKLED_NAME: Final = re.compile(rb"^a?V([^\n]*)$", re.MULTILINE)
_PICKLED_INDEX_NAME: Final = re.compile(rb"^s?a?Vindex_name\n(?:p\d+\n)?V([^\n]*)$", re.MULTILINE)
_BOOKKEEPING: Final = ("_i_", "#")  # PyTables' index trees, MATLAB's references
_WIDEST: Final = 64  # a matrix with more columns and no names for them is no table of histories


class Column(NamedTuple):
    """One column: the ``path`` by which a user names it, and where in the file it is.

    ``field`` is the member of a compound dataset, ``place`` the (axis, index) to take in a matrix.
    """

    path: str
    size: int
    dtype: str
    dataset: str
    field: str | None = None
    place: tuple[int, int] | None = None

    @property
    def group(self) -> str:
        """Path of what the column is in."""
        return self.path.rpartition("/")[0]

    @property
    def name(self) -> str:
        """Its own name in lower case, without unit; of ``internal_energy/value`` the first."""
        group, _, leaf = self.path.rpartition("/")
        if leaf in ("value", "values") and group:
            leaf = group.rpartition("/")[2]
        bare = re.sub(r"\s*[\[(][^\d\])]+[\])]$", "", leaf)
        return re.sub(r"[\s\-]+", "_", bare.strip().lower())

    def load(self, file: h5py.File, content: bytes, source: str) -> Samples:
        """Its values, shape (size,), of a file with that ``content``; FormatError unless all are finite."""
        dataset = file[self.dataset]
        check_data(dataset, source)
        if self.field is None and self.place is None:
            return finite(_values(dataset, content), self.path, source).reshape(self.size)
        whole = dataset if self.field is None else dataset.fields(self.field)
        if self.place is None:
            values = whole[()]
        elif self.field is not None:
            values = whole[()][:, self.place[1]]
        else:
            axis, index = self.place
            values = whole[index, :] if axis == 0 else whole[:, index]
        return finite(values, self.path, source).reshape(self.size)


# Of a file: smaller data are copied out of it, or what a column keeps in memory would be far more than itself.
_LARGE: Final = 1 / 4


def _values(dataset: h5py.Dataset, content: bytes) -> Any:
    """Numbers of a dataset; where it makes much of the file with that ``content``, in one piece, they stay there."""
    start = dataset.id.get_offset()  # None of data in chunks, and in other files
    if start is None or not _LARGE * len(content) < dataset.nbytes <= len(content) - start:
        return dataset[()]
    return np.frombuffer(content, dataset.dtype, dataset.size, start).reshape(dataset.shape)


def finite(values: Any, path: str, source: str) -> Samples:
    """``values`` as doubles, read-only so that nobody needs a copy of his own; FormatError unless all are finite."""
    numbers = np.asarray(values, dtype=np.float64)
    known = np.isfinite(numbers)
    if not known.all():
        bad = np.argwhere(~known)[0]
        found = f"{source}: {path} is {numbers[tuple(bad)]} at state {bad[0] + 1}, not a finite number"
        raise FormatError(f"{found}; choose another dataset")
    numbers.flags.writeable = False
    return numbers


def columns_of(file: h5py.File) -> tuple[Column, ...]:
    """All columns of numbers in ``file``, sorted by path."""
    import h5py

    found: list[Column] = []
    done: list[str] = []  # groups that were understood as a whole

    def visit(name: str, item: h5py.Group | h5py.Dataset) -> None:
        if any(step.startswith(_BOOKKEEPING) for step in name.split("/")) or name.startswith(tuple(done)):
            return
        if isinstance(item, h5py.Dataset):
            found.extend(_dataset_columns(name, item))
            return
        reader = _PANDAS.get(_text(item.attrs.get("pandas_type")))
        if reader is not None:
            found.extend(reader(name, item))
            done.append(name + "/")

    file.visititems(visit)
    return tuple(sorted(found, key=lambda column: column.path))


def _dataset_columns(name: str, dataset: h5py.Dataset) -> Iterator[Column]:
    import h5py

    plan, shape, dtype = dataset.id.get_create_plist(), dataset.shape, dataset.dtype
    if shape is None or plan.get_layout() == h5py.h5d.VIRTUAL or plan.get_external_count():
        return
    if dtype.names is not None:
        yield from _compound_columns(name, dataset, index_name="index")
        return
    if dtype.kind not in "iuf" or not shape:
        return
    size = math.prod(shape)
    if max(shape) == size:
        yield Column(name, size, str(dtype), name)
    elif len(shape) == 2:
        titles = _titles(dataset.attrs.get("columns", dataset.attrs.get("names")))
        yield from _matrix_columns(name, dataset, titles)


def _matrix_columns(name: str, dataset: h5py.Dataset, titles: list[str]) -> Iterator[Column]:
    """Columns along the axis that has as many entries as there are titles, or the shorter one."""
    rows, width = dataset.shape
    if rows == width:
        return
    if len(titles) in (rows, width):
        axis = 1 if len(titles) == width else 0
        paths = [f"{name}/{title}" for title in titles]
    else:
        axis = 1 if width < rows else 0
        paths = [f"{name}[{index}]" for index in range(dataset.shape[axis])]
        if len(paths) > _WIDEST:
            return
    for index, path in enumerate(paths):
        yield Column(path, dataset.shape[1 - axis], str(dataset.dtype), name, place=(axis, index))


def _compound_columns(name: str, dataset: h5py.Dataset, index_name: str) -> Iterator[Column]:
    """One column for each member, several for a member that is a vector; pandas notes its names beside it."""
    if len(dataset.shape) != 1:
        return
    base = name.removesuffix("/table")
    for field in dataset.dtype.names:
        kind = dataset.dtype[field]
        if kind.base.kind not in "iuf" or len(kind.shape) > 1:
            continue
        if not kind.shape:
            path = f"{base}/{index_name if field == 'index' else field}"
            yield Column(path, dataset.shape[0], str(kind), name, field)
            continue
        titles = _pickled_names(dataset.attrs.get(f"{field}_kind"))
        named = len(titles) == kind.shape[0]
        for index in range(kind.shape[0]):
            path = f"{base}/{titles[index]}" if named else f"{base}/{field}[{index}]"
            yield Column(path, dataset.shape[0], str(kind.base), name, field, (1, index))


def _pandas_table(name: str, group: h5py.Group) -> Iterator[Column]:
    found = _PICKLED_INDEX_NAME.search(bytes(_text(group.attrs.get("info")), "utf-8"))
    yield from _compound_columns(f"{name}/table", group["table"], found[1].decode() if found else "index")


def _pandas_frame(name: str, group: h5py.Group) -> Iterator[Column]:
    """Find the columns of a frame in the "fixed" store: the index, and blocks of columns of one type."""
    index = group["axis1"]
    yield from _pandas_index(name, index)
    for number in range(int(group.attrs["nblocks"])):
        titles = _titles(group[f"block{number}_items"][()])
        values = group[f"block{number}_values"]
        if values.dtype.kind not in "iuf" or values.shape not in ((index.size, len(titles)), (len(titles), index.size)):
            continue
        across = values.shape[0] == index.size and (index.size != len(titles) or bool(values.attrs.get("transposed")))
        for place, title in enumerate(titles):
            where = (1 if across else 0, place)
            yield Column(f"{name}/{title}", index.size, str(values.dtype), values.name[1:], place=where)


def _pandas_series(name: str, group: h5py.Group) -> Iterator[Column]:
    values = group["values"]
    yield from _pandas_index(name, group["index"])
    if values.dtype.kind in "iuf" and values.ndim == 1:
        yield Column(f"{name}/values", values.size, str(values.dtype), values.name[1:])


def _pandas_index(name: str, index: h5py.Dataset) -> Iterator[Column]:
    title = _text(index.attrs.get("name"))
    title = "index" if title in ("", "N.") else title  # "N." is a pickled None
    if index.dtype.kind in "iuf" and index.ndim == 1:
        yield Column(f"{name}/{title}", index.size, str(index.dtype), index.name[1:])


_PANDAS: Final = {"frame": _pandas_frame, "series": _pandas_series, "frame_table": _pandas_table}


def _text(value: object) -> str:
    """Read an attribute as text, whichever way it was stored; empty if it is not text."""
    if isinstance(value, np.ndarray) and value.size == 1:
        value = value.item()
    if isinstance(value, bytes):
        return value.decode("utf-8", "replace")
    return value if isinstance(value, str) else ""


def _titles(value: object) -> list[str]:
    """Make a list of names from an array of texts or from one text with commas."""
    if isinstance(value, np.ndarray) and value.ndim == 1:
        return [_text(entry) for entry in value.tolist()]
    text = _text(value)
    return [title.strip() for title in text.split(",")] if text else []


def _pickled_names(value: object) -> list[str]:
    return [name.decode("raw-unicode-escape") for name in _PICKLED_NAME.findall(bytes(_text(value), "utf-8"))]
