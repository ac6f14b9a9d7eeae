"""Read HDF5 files: time and energy columns in any layout, and binouts saved by lasso-python.

A file with the branches of a binout is treated as a saved binout. In any other file, columns are selected by their
paths. If the user selects no column, the only suitable column is used; if there are several, the message lists them.
"""

from __future__ import annotations

import io
import os
import signal
import struct
import sys
from contextlib import contextmanager, suppress
from importlib import import_module
from typing import TYPE_CHECKING, BinaryIO, Final

import numpy as np

from d2rpick.base.caching import cached_property
from d2rpick.base.errors import FormatError, list_names, make_printable
from d2rpick.base.files import describe_excess, describe_unpacked_excess
from d2rpick.histories.database import DIGITS, Database
from d2rpick.histories.formats.hdf5_columns import (
    Column,
    check_data,
    check_finite,
    find_columns,
)
from d2rpick.histories.history import Precision, Samples
from d2rpick.histories.interleaved import refuse_rows_of_parts
from d2rpick.histories.meaning import find_internal_energies, refuse_other_quantity
from d2rpick.histories.names import Part, Selection, suggest_name
from d2rpick.histories.samples import check_one_run, count_rows_per_time

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    import h5py

    from d2rpick.histories.source import Source

SIGNATURE: Final = b"\x89HDF\r\n\x1a\n"
_MANY: Final = 12  # Largest number of columns that a message lists.
_BRANCHES: Final = ("glstat", "matsum")
# Exceptions that h5py raises on damaged files.
_DAMAGED: Final = (
    OSError,
    RuntimeError,
    KeyError,
    ValueError,
    TypeError,
    AttributeError,
    OverflowError,
    MemoryError,
)

# Offset of the end-of-file address in superblock versions 0 to 3, in which all writers use 8-byte addresses.
_END_OF_FILE: Final = {0: 40, 1: 44, 2: 28, 3: 28}
_VERSION, _SIZE, _ADDRESS_SIZE = 8, {0: 13, 1: 13, 2: 9, 3: 9}, 8
# Time-out of a read in addition to 1 s per 100 kB [s]; a longer read indicates a cyclic B-tree in a damaged file.
_SECONDS: Final = 60
_SLOWEST: Final = 100_000  # Slowest expected reading speed [bytes/s].
_USER_BLOCK: Final = 512  # Number of bytes that MATLAB writes before the HDF5 content.


def recognises(head: bytes) -> bool:
    """Return True if ``head`` is the start of an HDF5 file; MATLAB writes 512 bytes before the signature."""
    return SIGNATURE in (head[:8], head[512:520])


def open_legs(sources: Sequence[Source], selection: Selection) -> list[Database]:
    """Open each file as a restart segment. Selected columns take precedence over the branches of a saved binout."""
    return [_open_leg(source, selection) for source in sources]


def _open_leg(source: Source, selection: Selection) -> Database:
    """Open one file as a saved binout or as a file of columns."""
    _import_library(source.name)
    import h5py

    # The file is read into memory, because a change on disk during the read could crash the library.
    content = bytes(source.data)
    file = io.BytesIO(content)
    check_file(file, source.name)
    with _explain_damage(source.name):
        opened = h5py.File(file, "r")
    if not selection.time and not selection.energy:
        branches = _open_branches(opened, source.name)
        if branches:
            return SavedBinout(source.name, branches)
    return Columns(opened, content, source.name, selection)


def _open_branches(opened: h5py.File, source: str) -> dict[str, PartGroup]:
    """Open the glstat and matsum branches that lasso-python saved; empty for a file with another layout."""
    with _explain_damage(source):
        return {
            name: PartGroup(source, opened[name])
            for name in _BRANCHES
            if f"{name}/time" in opened
            and f"{name}/internal_energy" in opened
            and "pandas_type" not in opened[name].attrs
        }


class Columns(Database):
    """The columns of an HDF5 file with any layout, keyed by path, as a `Database` without parts."""

    format = "hdf5"
    named_by_people = True

    def __init__(
        self, opened: h5py.File, content: bytes, source: str, selection: Selection
    ) -> None:
        self._opened, self._content, self.source = opened, content, source
        with _explain_damage(source):
            self._columns = find_columns(opened)
        self._times = [column for column in self._columns if column.is_time]
        self._named_time: Column | None = None
        if selection.time:
            self._named_time = _find_named_column(selection.time, self._columns, source)
        self._energies = [
            _find_named_column(path, self._columns, source) for path in selection.energy
        ]
        self.channels = tuple(
            column.path for column in self._columns if column is not self._named_time
        )

    @property
    def energy_channel(self) -> str:
        """The only column whose name denotes an internal energy or, failing that, the only column besides the time.

        Raise a FormatError that lists all columns if there is no such column.
        """
        return _find_only_energy(self._columns, self._named_time, self.source).path

    def find(self, wanted: str) -> str:
        """Return the path of the column that ``wanted`` selects."""
        return _find_named_column(wanted, self._columns, self.source).path

    @cached_property
    def time(self) -> Samples:
        """Values of the time column, shape (n,) [time]; raise FormatError if they are not the times of a single run."""
        path = self._time_column.path
        times = check_one_run(
            self._load(self._time_column),
            lambda state: f"{self.source}: {path}, value {state + 1}",
        )
        if count_rows_per_time(times) > 1:
            energies = self._energies or [
                _find_only_energy(self._columns, self._named_time, self.source)
            ]
            whole_numbers = {
                column.path: self._load(column).astype(int).tolist()
                for column in self._columns
                if column.size == times.size and column.is_whole_number
            }
            energy = self._load(energies[0])
            refuse_rows_of_parts(self.source, times, energy, whole_numbers)
        return times

    def channel(self, name: str) -> Samples:
        """Return one column, shape (n,); raise FormatError if its length or times differ from those of the energy."""
        column = _find_named_column(name, self._columns, self.source)
        if column.size != self._time_column.size:
            raise FormatError(
                f"{self.source}: {column.path} has {column.size} values, {self._time_column.path} has "
                f"{self._time_column.size}; choose columns of one length"
            )
        self._check_own_times(column)
        return self._load(column)

    def _check_own_times(self, column: Column) -> None:
        """Raise FormatError if the times in the group of a column differ from the times of the energy."""
        times_of_group = [time for time in self._times if time.group == column.group]
        if len(times_of_group) != 1:
            return
        own_time = times_of_group[0]
        if own_time in (self._time_column, column):
            return
        if not np.array_equal(self._load(own_time), self.time):
            raise FormatError(
                f"{self.source}: {column.path} has other times ({own_time.path}) than the energy "
                f"({self._time_column.path}); choose columns of the same times"
            )

    def precisions(self, names: Sequence[str]) -> tuple[Precision, Precision]:
        """Return the precisions with which the times and these columns are stored."""
        energies = [
            _find_named_column(name, self._columns, self.source) for name in names
        ]
        digits = [
            DIGITS[4 if column.dtype.endswith("32") else 8]
            for column in (self._time_column, *energies)
        ]
        return Precision(digits[0]), Precision(min(digits[1:], default=DIGITS[8]))

    @cached_property
    def _time_column(self) -> Column:
        """The selected time column, or the time in the group closest to the energy."""
        if self._named_time:
            return self._named_time
        if self._energies:
            energy = self._energies[0]
        else:
            energy = _find_only_energy(self._columns, None, self.source)
        return _find_only_time(self._columns, energy, self.source)

    def _load(self, column: Column) -> Samples:
        """Return the values of a column, shape (size,)."""
        with _explain_damage(self.source):
            return column.load(self._opened, self._content, self.source)


class SavedBinout(Database):
    """A binout saved by lasso-python: the channels of its glstat branch, and the parts of its matsum branch."""

    format = "hdf5"

    def __init__(self, source: str, branches: dict[str, PartGroup]) -> None:
        self.source, self._branches = source, branches
        first = next(iter(branches.values()))
        self.title, self.version = first.title, first.version
        self.channels = branches["glstat"].channels if "glstat" in branches else ()
        self.parts = branches["matsum"].parts if "matsum" in branches else ()

    def branch(self, name: str) -> PartGroup:
        """Return a branch by name; raise FormatError if it was not saved."""
        if name not in self._branches:
            raise FormatError(
                f"{self.source}: no {name} in this saved binout; name the run's own files"
            )
        return self._branches[name]


class PartGroup(Database):
    """The glstat or matsum branch of a file saved by lasso-python."""

    def __init__(self, source: str, group: h5py.Group) -> None:
        self.source, self._group = source, group
        self.name = group.name.strip("/")
        self.title = _read_line(group, "title")
        self.version = " ".join(
            text
            for text in (_read_line(group, "version"), _read_line(group, "revision"))
            if text
        )
        check_data(group["time"], source)
        self.time: Samples = check_finite(
            group["time"][()], f"{self.name}/time", source
        ).reshape(-1)
        if "ids" in group:
            self.parts = _read_parts(group, source)
        else:
            self.channels = tuple(
                column.path
                for column in find_columns(group)
                if column.size == self.time.size
                and column.place is None
                and column.path != "time"
            )

    def channel(self, name: str) -> Samples:
        """Return the values of the dataset ``name``, shape (n,)."""
        if name not in self.channels:
            raise FormatError(
                f"{self.source}: {self.name} has no channel {name!r}, only {', '.join(self.channels)}"
            )
        with _explain_damage(self.source):
            return self._load(name, (self.time.size,))

    def part_channel(self, quantity: str, ids: Sequence[int]) -> Samples:
        """Return a quantity of the parts ``ids``, shape (n, len(ids))."""
        part_ids = [part.id for part in self.parts]
        missing = [id_ for id_ in ids if part_ids.count(id_) != 1]
        if missing:
            raise FormatError(
                f"{self.source}: {self.name} has not exactly one part {', '.join(map(str, missing))}; "
                f"choose from {', '.join(map(str, part_ids)) or 'none'}"
            )
        with _explain_damage(self.source):
            if quantity not in self._group:
                raise FormatError(f"{self.source}: {self.name} has no {quantity}")
            values = self._load(quantity, (self.time.size, len(part_ids)))
        return values[:, [part_ids.index(id_) for id_ in ids]]

    def _load(self, name: str, shape: tuple[int, ...]) -> Samples:
        """Return the dataset ``name`` in this ``shape``; the file may lack axes of length 1."""
        dataset = self._group[name]
        check_data(dataset, self.source)
        if [size for size in dataset.shape if size != 1] != [
            size for size in shape if size != 1
        ]:
            raise FormatError(
                f"{self.source}: {dataset.name} has shape {dataset.shape}, but {shape} was expected"
            )
        return check_finite(dataset[()], dataset.name, self.source).reshape(shape)


def _read_parts(group: h5py.Group, source: str) -> tuple[Part, ...]:
    """Return the parts in the order of the columns. Titles belong to ``legend_ids``, whose order may differ."""
    check_data(group["ids"], source)
    titles: dict[int, str] = {}
    if "legend" in group and "legend_ids" in group:
        check_data(group["legend_ids"], source)
        ids = np.ravel(group["legend_ids"][()])
        legend = b"".join(np.ravel(group["legend"][()]).tolist())
        size, remainder = divmod(len(legend), max(1, ids.size))
        if not remainder:
            for row, id_ in enumerate(ids.tolist()):
                text = legend[size * row : size * (row + 1)]
                titles[int(id_)] = text.decode("latin-1").strip()
    return tuple(
        Part(int(id_), titles.get(int(id_), "")) for id_ in np.ravel(group["ids"][()])
    )


def _read_line(group: h5py.Group, name: str) -> str:
    """Return a string that was saved as an array of one element; empty if nothing was saved."""
    if name not in group:
        return ""
    values = np.ravel(group[name][()])
    text = values[0] if values.size else b""
    if isinstance(text, bytes):
        return text.decode("latin-1").strip("\0 ")
    return str(text).strip()


def _find_named_column(path: str, columns: Sequence[Column], source: str) -> Column:
    """Return the column with this path, or raise a FormatError that suggests a similar path."""
    matching = [column for column in columns if column.path == path.strip("/")]
    near = ""
    if not matching:
        near = suggest_name(path.strip("/"), [column.path for column in columns])
    return _choose_only_column(matching, columns, f"{path!r}{near}", source)


def _find_only_energy(
    columns: Sequence[Column], time: Column | None, source: str
) -> Column:
    """Return the only column whose name denotes an internal energy, or the only column besides a time."""
    paths = [column.path for column in columns]
    fitting = [columns[index] for index in find_internal_energies(paths)]
    if not fitting:
        times = [time] if time else [column for column in columns if column.is_time]
        tables = {(column.group, column.size) for column in times}
        fitting = [
            column
            for column in columns
            if column not in times and (column.group, column.size) in tables
        ]
        if len(fitting) == 1:
            refuse_other_quantity(fitting[0].path, source)
    return _choose_only_column(fitting, columns, "the internal energy", source)


def _find_only_time(columns: Sequence[Column], energy: Column, source: str) -> Column:
    """Return the time in the group of the energy, or in the closest enclosing group."""
    group = energy.group
    while True:
        fitting = [
            column for column in columns if column.is_time and column.group == group
        ]
        if fitting or not group:
            return _choose_only_column(
                fitting, columns, f"the time of {energy.path}", source
            )
        group = group.rpartition("/")[0]


def _choose_only_column(
    fitting: Sequence[Column], columns: Sequence[Column], purpose: str, source: str
) -> Column:
    """Return the only matching column; otherwise raise FormatError with the columns from which to choose."""
    if len(fitting) == 1:
        return fitting[0]
    count = "no column" if not fitting else f"{len(fitting)} columns"
    paths = [f"{column.path} ({column.size})" for column in fitting or columns]
    menu = list_names(paths, most=_MANY) or "there is none"
    raise FormatError(
        f"{source}: {count} for {purpose}, but one was expected; give its path: {menu}"
    )


def _import_library(source: str) -> None:
    """Import h5py before a process is forked, so that it is imported only once; raise FormatError if it is missing."""
    try:
        with _without_name_of_processor():
            import_module("h5py")
    except ImportError:
        raise FormatError(
            f"{source}: HDF5 files need h5py; pip install h5py, or export the columns as CSV"
        ) from None


@contextmanager
def _without_name_of_processor() -> Iterator[None]:
    """Let `platform.uname` contain no name of the processor.

    h5py reads the name of the machine there. Python would also start the program ``uname`` for that of the processor,
    which takes a sixth of the time of h5py's import.
    """
    import platform

    names = vars(platform.uname())
    if "processor" in names:
        yield
        return
    names["processor"] = ""
    try:
        yield
    finally:
        del names["processor"]


@contextmanager
def _explain_damage(source: str) -> Iterator[None]:
    """Turn any h5py error about a damaged file into a FormatError."""
    try:
        yield
    except _DAMAGED as error:
        reason = make_printable(" ".join(str(error).split()))
        raise FormatError(
            f"{source}: HDF5 cannot be read ({reason}); the file is damaged or needs a filter"
        ) from error


# The functions below find damage that would make the library crash or loop forever.


def check_file(file: BinaryIO, source: str, seconds: int = _SECONDS) -> None:
    """Raise FormatError if a file is truncated or too large, or if the library would crash on it.

    The file is first read in a child process whose time is limited to ``seconds`` plus 1 s per 100 kB, because a read
    that crashes or never ends would otherwise affect this process.
    """
    _check_size_of_file(file, source)
    if not hasattr(os, "fork"):
        return
    read_end, write_end = os.pipe()
    child = os.fork()
    if child == 0:
        _read_and_exit(file, source, seconds, write_end)
    os.close(write_end)
    with os.fdopen(read_end, encoding="utf-8", errors="surrogateescape") as pipe:
        message = pipe.read()
    _, status = os.waitpid(child, 0)
    if message:
        raise FormatError(message)
    if os.WIFSIGNALED(status):
        number = os.WTERMSIG(status)
        failure = f"crashed on it (signal {number})"
        if number == signal.SIGXCPU:
            failure = "did not finish reading it"
        raise FormatError(
            f"{source}: the HDF5 library {failure}; the file is damaged, copy it again"
        )


def _check_size_of_file(file: BinaryIO, source: str) -> None:
    """Raise FormatError if the size of a file differs from the size given in its header."""
    head, size = _head_and_size(file)
    base = 0 if head.startswith(b"\x89HDF") else _USER_BLOCK
    head = head[base:]
    version = head[_VERSION] if len(head) > _VERSION else -1
    offset = _END_OF_FILE.get(version)
    if (
        offset is None
        or len(head) < offset + _ADDRESS_SIZE
        or head[_SIZE[version]] != _ADDRESS_SIZE
    ):
        return  # The library itself reports this problem.
    (end,) = struct.unpack_from("<Q", head, offset)
    if size not in (end, end + base):
        raise FormatError(
            f"{source}: the file has {size} bytes, {end} by its own header; it is damaged or cut, copy it again"
        )


def _head_and_size(file: BinaryIO) -> tuple[bytes, int]:
    """Return the first bytes of a file, and its size [bytes]."""
    file.seek(0)
    head = file.read(2 * _USER_BLOCK)
    return head, file.seek(0, os.SEEK_END)


def _read_and_exit(file: BinaryIO, source: str, seconds: int, write_end: int) -> None:
    """Read all data that could crash the library, write the message of any FormatError to ``write_end``, and exit."""
    try:
        import resource

        # Python has imported this module if it, or the user, has made it print a traceback after a crash.
        if "faulthandler" in sys.modules:
            sys.modules["faulthandler"].disable()
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        limit = seconds + _head_and_size(file)[1] // _SLOWEST
        _, hard_limit = resource.getrlimit(resource.RLIMIT_CPU)
        if hard_limit >= 0:
            limit = min(limit, hard_limit)
        resource.setrlimit(resource.RLIMIT_CPU, (limit, hard_limit))
        os.dup2(os.open(os.devnull, os.O_WRONLY), 2)
        _read_all_data(file, source)
    except FormatError as error:
        os.write(write_end, str(error).encode(errors="surrogateescape"))
    finally:
        os._exit(0)


def _read_all_data(file: BinaryIO, source: str) -> None:
    """Read the description of all data, and all chunked data; raise FormatError if a limit is exceeded."""
    import h5py

    size = _head_and_size(file)[1]
    unpacked = 0

    def visit(name: bytes, info: h5py.h5o.ObjInfo) -> None:
        nonlocal unpacked
        if too_deep := describe_excess("DEPTH", name.count(b"/")):
            raise FormatError(f"{source}: its data lie in {too_deep}")
        if info.type == h5py.h5o.TYPE_DATASET:
            dataset = h5py.h5d.open(opened, name)
            if dataset.get_create_plist().get_layout() == h5py.h5d.CHUNKED:
                unpacked += h5py.Dataset(dataset).nbytes
                if too_much := describe_unpacked_excess(size, unpacked):
                    raise FormatError(f"{source}: its packed data become {too_much}")
                with suppress(Exception):
                    check_data(h5py.Dataset(dataset), "")
                    h5py.Dataset(dataset)[()]

    # A child process pays for each page of memory that it uses, and `h5py.File` uses many.
    access = h5py.h5p.create(h5py.h5p.FILE_ACCESS)
    access.set_fileobj_driver(h5py.h5fd.fileobj_driver, file)
    opened = h5py.h5f.open(b"content", h5py.h5f.ACC_RDONLY, access)
    h5py.h5o.visit(opened, visit, info=True)


def write(columns: Mapping[str, Samples]) -> bytes:
    """Return an HDF5 file with a dataset of doubles for each column (n,)."""
    import h5py

    content = io.BytesIO()
    with h5py.File(content, "w") as file:
        for name, column in columns.items():
            file[name] = column
    return content.getvalue()
