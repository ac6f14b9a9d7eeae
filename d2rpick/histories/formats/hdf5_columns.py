"""Find the columns of an HDF5 file (datasets, matrices, compound types, pandas tables) and read their values.

The library returns zeros for data that were never written, and does not detect a damaged type; this module checks both.
A changed byte in data without a checksum (`fletcher32` or gzip) cannot be detected.
"""

from __future__ import annotations

import math
import re
from functools import cache
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from d2rpick.base.errors import FormatError
from d2rpick.base.files import describe_unpacked_excess
from d2rpick.base.tuples import NamedTuple
from d2rpick.histories.meaning import is_time

if TYPE_CHECKING:
    from collections.abc import Iterator

    import h5py

    from d2rpick.histories.history import Samples

# These patterns are compiled on first use to keep start-up fast.
_PICKLED_NAME: Final = rb"(?m)^a?V([^\n]*)$"
_PICKLED_INDEX_NAME: Final = rb"(?m)^s?a?Vindex_name\n(?:p\d+\n)?V([^\n]*)$"
# Name prefixes of groups that contain no histories, e.g. PyTables index trees and MATLAB references.
_BOOKKEEPING: Final = ("_i_", "#")
_ERF_BLOCK: Final = "/erfblock"
# Tables without column names are read if they have at most this number of columns.
_WIDEST: Final = 64

# Largest dataset that is copied, as a fraction of the file size [-]; a view keeps the whole file in memory.
_LARGE: Final = 1 / 4


class Column(NamedTuple):
    """One column of an HDF5 file: the ``path`` by which a user names the column, and its position in the file.

    ``field`` is the member of a compound dataset, and ``place`` the (axis, index) of the column in a matrix.
    """

    path: str
    size: int
    dtype: str
    dataset: str
    field: str | None = None
    place: tuple[int, int] | None = None

    @property
    def group(self) -> str:
        """Path of the group that contains the column."""
        return self.path.rpartition("/")[0]

    @property
    def is_time(self) -> bool:
        """True if the name of the column denotes a time; for ``time/value``, this name is ``time``."""
        group, _, leaf = self.path.rpartition("/")
        if leaf in ("value", "values") and group:
            leaf = group.rpartition("/")[2]
        return is_time(leaf)

    @property
    def is_whole_number(self) -> bool:
        """True if the values of the column are integers, such as part ids."""
        return self.dtype.startswith(("int", "uint"))

    def load(self, file: h5py.File, content: bytes, source: str) -> Samples:
        """Return the values of the column, shape (size,), from the file's ``content``; all values must be finite."""
        dataset = file[self.dataset]
        check_data(dataset, source)
        if self.field is None and self.place is None:
            return check_finite(
                _read_values(dataset, content), self.path, source
            ).reshape(self.size)
        whole = dataset if self.field is None else dataset.fields(self.field)
        if self.place is None:
            values = whole[()]
        elif self.field is not None:
            values = whole[()][:, self.place[1]]
        else:
            axis, index = self.place
            values = whole[index, :] if axis == 0 else whole[:, index]
        return check_finite(values, self.path, source).reshape(self.size)


def check_data(dataset: h5py.Dataset, source: str) -> None:
    """Raise FormatError if a dataset's type is damaged or its data are missing, which h5py would read as zeros."""
    _check_type(dataset, source)
    stored = dataset.id.get_storage_size()
    if too_much := describe_unpacked_excess(stored, dataset.nbytes):
        raise FormatError(f"{source}: {dataset.name} becomes {too_much}")
    if dataset.size and not stored:
        raise FormatError(
            f"{source}: {dataset.name} was never written; choose another dataset or copy the file again"
        )
    if dataset.chunks and dataset.size:
        chunks: set[tuple[int, ...]] = set()
        dataset.id.chunk_iter(lambda chunk: chunks.add(tuple(chunk.chunk_offset)))
        expected = math.prod(
            -(-extent // length)
            for extent, length in zip(dataset.shape, dataset.chunks, strict=True)
        )
        inside = sum(
            all(at < extent for at, extent in zip(chunk, dataset.shape, strict=True))
            for chunk in chunks
        )
        if inside < expected:
            raise FormatError(
                f"{source}: {dataset.name} has {inside} of {expected} chunks of its data; "
                "the file is damaged or was not written to its end"
            )


def _check_type(dataset: h5py.Dataset, source: str) -> None:
    """Raise FormatError for number types that HDF5 does not define, because a damaged type would change all numbers."""
    for kind in _list_number_types(dataset.id.get_type()):
        if not any(kind.equal(standard) for standard in _list_standard_types()):
            raise FormatError(
                f"{source}: {dataset.name} has numbers of {kind.get_size()} bytes that are no standard type of HDF5; "
                "the file is damaged, copy it again, or write it with a standard type"
            )


def _list_number_types(kind: h5py.h5t.TypeID) -> Iterator[h5py.h5t.TypeID]:
    """Yield the number types in a data type, which may be composed of several types."""
    import h5py

    if isinstance(kind, h5py.h5t.TypeCompoundID):
        for member in range(kind.get_nmembers()):
            yield from _list_number_types(kind.get_member_type(member))
    elif isinstance(kind, h5py.h5t.TypeArrayID | h5py.h5t.TypeEnumID):
        yield from _list_number_types(kind.get_super())
    elif isinstance(kind, h5py.h5t.TypeAtomicID) and kind.get_class() in (
        h5py.h5t.INTEGER,
        h5py.h5t.FLOAT,
    ):
        yield kind


@cache
def _list_standard_types() -> tuple[h5py.h5t.TypeID, ...]:
    """Return the integer and floating-point types that HDF5 defines."""
    import h5py

    names = [f"IEEE_F{bits}" for bits in (16, 32, 64)] + [
        f"STD_{sign}{bits}" for sign in "IU" for bits in (8, 16, 32, 64)
    ]
    return tuple(
        getattr(h5py.h5t, name + order) for name in names for order in ("LE", "BE")
    )


def _read_values(dataset: h5py.Dataset, content: bytes) -> Any:
    """Return the numbers of a dataset. A large contiguous dataset is returned as a view of ``content``."""
    # Data in chunks or in external files have no offset in this file.
    start = dataset.id.get_offset()
    if start is None:
        return dataset[()]
    if not _LARGE * len(content) < dataset.nbytes <= len(content) - start:
        return dataset[()]
    values = np.frombuffer(content, dataset.dtype, dataset.size, start)
    return values.reshape(dataset.shape)


def check_finite(values: Any, path: str, source: str) -> Samples:
    """Return ``values`` as read-only doubles, which callers can share; raise FormatError unless all are finite."""
    numbers = np.asarray(values, dtype=np.float64)
    is_finite = np.isfinite(numbers)
    if not is_finite.all():
        bad = np.argwhere(~is_finite)[0]
        problem = f"{source}: {path} is {numbers[tuple(bad)]} at state {bad[0] + 1}, not a finite number"
        raise FormatError(f"{problem}; choose another dataset")
    numbers.flags.writeable = False
    return numbers


def find_columns(file: h5py.File) -> tuple[Column, ...]:
    """Return all columns of numbers in ``file``, sorted by path."""
    import h5py

    columns: list[Column] = []
    # Groups of this layout have their own reader, which reads them completely.
    read_groups: list[str] = []

    def visit(name: str, item: h5py.Group | h5py.Dataset) -> None:
        if any(step.startswith(_BOOKKEEPING) for step in name.split("/")):
            return
        if name.startswith(tuple(read_groups)):
            return
        if isinstance(item, h5py.Dataset):
            columns.extend(_list_dataset_columns(name, item))
            return
        pandas_type = _read_attribute_text(item.attrs.get("pandas_type"))
        if name.endswith(_ERF_BLOCK):
            columns.extend(_list_erf_columns(name, item))
            read_groups.append(name + "/")
        elif pandas_type in _PANDAS:
            columns.extend(_PANDAS[pandas_type](name, item))
            read_groups.append(name + "/")

    file.visititems(visit)
    return tuple(sorted(columns, key=lambda column: column.path))


def _list_dataset_columns(name: str, dataset: h5py.Dataset) -> Iterator[Column]:
    """Yield the columns of a dataset: members of a compound type, a vector, or columns of a matrix."""
    import h5py

    plan = dataset.id.get_create_plist()
    shape = dataset.shape
    dtype = dataset.dtype
    if (
        shape is None
        or plan.get_layout() == h5py.h5d.VIRTUAL
        or plan.get_external_count()
    ):
        return
    if dtype.names is not None:
        yield from _list_compound_columns(name, dataset, index_name="index")
        return
    if dtype.kind not in "iuf" or not shape:
        return
    size = math.prod(shape)
    if max(shape) == size:
        yield Column(name, size, str(dtype), name)
    elif len(shape) == 2:
        titles = _read_exodus_titles(dataset) or _split_titles(
            dataset.attrs.get("columns", dataset.attrs.get("names"))
        )
        yield from _list_matrix_columns(name, dataset, titles)


def _list_matrix_columns(
    name: str, dataset: h5py.Dataset, titles: list[str]
) -> Iterator[Column]:
    """Yield the columns of a matrix along the axis that has one title per column, otherwise along the shorter axis."""
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
        yield Column(
            path, dataset.shape[1 - axis], str(dataset.dtype), name, place=(axis, index)
        )


def _list_erf_columns(name: str, block: h5py.Group) -> Iterator[Column]:
    """Yield the columns of a time history in ERF-HDF5 (VPS), such as ``.../MODEL/INTERNAL_ENERGY/ZONE1/erfblock``.

    ``res`` has the shape (states, entities, components); ``indexval`` contains the times, and ``entid`` the ids of the
    entities. Only quantities with one component are columns. The paths of columns contain the id of the entity unless
    it is the model.
    """
    results, times, entities = (block.get(key) for key in ("res", "indexval", "entid"))
    if (
        results is None
        or times is None
        or results.dtype.kind not in "iuf"
        or times.dtype.kind not in "iuf"
    ):
        return
    states = math.prod(times.shape)
    if results.ndim != 3 or states != results.shape[0] or results.shape[2] != 1:
        return
    # Path of the variable without the name of the zone (such as ZONE1).
    variable = name.removesuffix(_ERF_BLOCK).rpartition("/")[0]
    yield Column(f"{variable}/time", states, str(times.dtype), times.name[1:])
    of_model = "/MODEL/" in variable or "/GLOBAL/" in variable
    numbers = [] if entities is None else np.ravel(entities[()]).tolist()
    for entity in range(results.shape[1]):
        number = "" if of_model or entity >= len(numbers) else f"/{numbers[entity]}"
        where = None if results.shape[1] == 1 else (1, entity)
        yield Column(
            f"{variable}{number}/value",
            states,
            str(results.dtype),
            results.name[1:],
            place=where,
        )


def _read_exodus_titles(dataset: h5py.Dataset) -> list[str]:
    """Return the column names that Exodus stores next to a matrix, as in ``name_glo_var`` for ``vals_glo_var``."""
    import h5py

    leaf = (dataset.name or "").rpartition("/")[2]
    if not leaf.startswith("vals_"):
        return []
    names = dataset.parent.get(f"name_{leaf.removeprefix('vals_')}")
    if (
        not isinstance(names, h5py.Dataset)
        or names.dtype.kind != "S"
        or names.ndim != 2
    ):
        return []
    return [
        b"".join(letters).decode("utf-8", "replace").strip("\0 ")
        for letters in names[()].tolist()
    ]


def _list_compound_columns(
    name: str, dataset: h5py.Dataset, index_name: str
) -> Iterator[Column]:
    """Yield a column for each member of a compound type, or for each component that pandas names in an attribute."""
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
        titles = _read_pickled_names(dataset.attrs.get(f"{field}_kind"))
        has_titles = len(titles) == kind.shape[0]
        for index in range(kind.shape[0]):
            leaf = titles[index] if has_titles else f"{field}[{index}]"
            path = f"{base}/{leaf}"
            yield Column(
                path, dataset.shape[0], str(kind.base), name, field, (1, index)
            )


def _list_table_columns(name: str, group: h5py.Group) -> Iterator[Column]:
    """Yield the columns of a data frame stored in the "table" format of pandas."""
    info = bytes(_read_attribute_text(group.attrs.get("info")), "utf-8")
    match = re.search(_PICKLED_INDEX_NAME, info)
    index_name = match[1].decode() if match else "index"
    yield from _list_compound_columns(f"{name}/table", group["table"], index_name)


def _list_frame_columns(name: str, group: h5py.Group) -> Iterator[Column]:
    """Yield the columns of a data frame stored in the "fixed" format of pandas: the index, and blocks of one type."""
    index = group["axis1"]
    yield from _list_index_column(name, index)
    for number in range(int(group.attrs["nblocks"])):
        titles = _split_titles(group[f"block{number}_items"][()])
        values = group[f"block{number}_values"]
        if values.dtype.kind not in "iuf" or values.shape not in (
            (index.size, len(titles)),
            (len(titles), index.size),
        ):
            continue
        across = values.shape[0] == index.size and (
            index.size != len(titles) or bool(values.attrs.get("transposed"))
        )
        for column, title in enumerate(titles):
            where = (1 if across else 0, column)
            yield Column(
                f"{name}/{title}",
                index.size,
                str(values.dtype),
                values.name[1:],
                place=where,
            )


def _list_series_columns(name: str, group: h5py.Group) -> Iterator[Column]:
    """Yield the index and the values of a pandas series."""
    values = group["values"]
    yield from _list_index_column(name, group["index"])
    if values.dtype.kind in "iuf" and values.ndim == 1:
        yield Column(f"{name}/values", values.size, str(values.dtype), values.name[1:])


def _list_index_column(name: str, index: h5py.Dataset) -> Iterator[Column]:
    """Yield the index of a data frame or series if the index consists of numbers."""
    title = _read_attribute_text(index.attrs.get("name"))
    # The pickled form of None is "N.".
    title = "index" if title in ("", "N.") else title
    if index.dtype.kind in "iuf" and index.ndim == 1:
        yield Column(f"{name}/{title}", index.size, str(index.dtype), index.name[1:])


_PANDAS: Final = {
    "frame": _list_frame_columns,
    "series": _list_series_columns,
    "frame_table": _list_table_columns,
}


def _read_attribute_text(value: object) -> str:
    """Return an attribute of any type as text; empty if it is not text."""
    if isinstance(value, np.ndarray) and value.size == 1:
        value = value.item()
    if isinstance(value, bytes):
        return value.decode("utf-8", "replace")
    return value if isinstance(value, str) else ""


def _split_titles(value: object) -> list[str]:
    """Return the names in an array of strings or in a single comma-separated string."""
    if isinstance(value, np.ndarray) and value.ndim == 1:
        return [_read_attribute_text(entry) for entry in value.tolist()]
    text = _read_attribute_text(value)
    return [title.strip() for title in text.split(",")] if text else []


def _read_pickled_names(value: object) -> list[str]:
    """Return the names in a list of strings that pandas pickled."""
    return [
        name.decode("raw-unicode-escape")
        for name in re.findall(
            _PICKLED_NAME, bytes(_read_attribute_text(value), "utf-8")
        )
    ]
