"""HDF5: time and energy columns from any layout, and the binouts that lasso-python saves.

A file is taken for a saved binout when it has its branches; of any other the columns are offered by their paths, the
only ones that fit are taken, and the candidates listed where more than one does.
"""

from __future__ import annotations

import io
import os
import signal
import struct
from contextlib import contextmanager, suppress
from importlib import import_module
from typing import TYPE_CHECKING, BinaryIO, Final

import numpy as np

from d2rpick.base.caching import cached_property
from d2rpick.base.errors import FormatError, listing, printable
from d2rpick.base.files import beyond, unpacked_beyond
from d2rpick.histories.database import DIGITS, Database
from d2rpick.histories.formats.hdf5_columns import (
    Column,
    check_data,
    columns_of,
    finite,
)
from d2rpick.histories.history import Precision, Samples
from d2rpick.histories.interleaved import refuse_rows_of_parts
from d2rpick.histories.meaning import find_internal_energies, refuse_other_quantity
from d2rpick.histories.names import Part, Selection, near_miss
from d2rpick.histories.samples import count_rows_per_time, of_one_run

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    import h5py

    from d2rpick.histories.source import Source

SIGNATURE: Final = b"\x89HDF\r\n\x1a\n"
_MANY: Final = 12  # candidates named in a message
_BRANCHES: Final = ("glstat", "matsum")
# What h5py makes of a damaged file.
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


def recognises(data: bytes) -> bool:
    """Whether ``data``, the beginning of a file, is that of an HDF5 file; MATLAB puts 512 bytes before it."""
    return SIGNATURE in (data[:8], data[512:520])


def open_legs(sources: Sequence[Source], selection: Selection) -> list[Database]:
    """Open each file as a leg of the run; columns that are named overrule what a saved binout would offer."""
    return [_opened_leg(source, selection) for source in sources]


def _opened_leg(source: Source, selection: Selection) -> Database:
    _import_library(source.name)
    # In memory whatever its size: the library crashes on some mixtures of two states of a file.
    file = io.BytesIO(bytes(source.data))
    check_file(file, source.name)
    branches = (
        {} if selection.time or selection.energy else _branches(file, source.name)
    )
    return (
        SavedBinout(source.name, branches)
        if branches
        else Columns(file, source.name, selection)
    )


def _branches(file: io.BytesIO, source: str) -> dict[str, PartGroup]:
    """Open the glstat and matsum branches that lasso-python saved; none in files of other layouts."""
    with _opened(file, source) as opened:
        return {
            name: PartGroup(file, source, opened, name)
            for name in _BRANCHES
            if f"{name}/time" in opened
            and f"{name}/internal_energy" in opened
            and "pandas_type" not in opened[name].attrs
        }


class Columns(Database):
    """The columns of an HDF5 file of any layout, by their paths; a `Database` without parts."""

    format = "hdf5"
    named_by_people = True

    def __init__(self, file: io.BytesIO, source: str, selection: Selection) -> None:
        self._file, self.source = file, source
        with _opened(file, source) as opened:
            self._columns = columns_of(opened)
        self._named_time = (
            _named(selection.time, self._columns, source) if selection.time else None
        )
        self._energies = [
            _named(path, self._columns, source) for path in selection.energy
        ]
        self.channels = tuple(
            column.path for column in self._columns if column is not self._named_time
        )

    @property
    def energy_channel(self) -> str:
        """The only column called an internal energy, or beside the time; else FormatError with the candidates."""
        return _only_energy(self._columns, self._named_time, self.source).path

    def find(self, wanted: str) -> str:
        """Path of the column that is meant."""
        return _named(wanted, self._columns, self.source).path

    @cached_property
    def time(self) -> Samples:
        """Values of the time column, shape (n,) [time]; FormatError where they are not those of one run."""
        path = self._time_column.path
        times = of_one_run(
            self._load(self._time_column),
            lambda state: f"{self.source}: {path}, value {state + 1}",
        )
        if count_rows_per_time(times) > 1:
            energies = self._energies or [
                _only_energy(self._columns, self._named_time, self.source)
            ]
            beside = [
                column
                for column in self._columns
                if column.size == times.size and column.is_whole_number
            ]
            others = {
                column.path: self._load(column).astype(int).tolist()
                for column in beside
            }
            refuse_rows_of_parts(self.source, times, self._load(energies[0]), others)
        return times

    def channel(self, name: str) -> Samples:
        """Values of one column, shape (n,); FormatError when it is not as long as the time."""
        column = _named(name, self._columns, self.source)
        if column.size != self._time_column.size:
            raise FormatError(
                f"{self.source}: {column.path} has {column.size} values, {self._time_column.path} has "
                f"{self._time_column.size}; choose columns of one length"
            )
        self._check_own_times(column)
        return self._load(column)

    def _check_own_times(self, column: Column) -> None:
        """Raise FormatError if a column has times beside it that are not those of the energy."""
        beside = [
            time
            for time in self._columns
            if time.is_time and time.group == column.group
        ]
        if len(beside) != 1 or beside[0] in (self._time_column, column):
            return
        if not np.array_equal(self._load(beside[0]), self.time):
            found = f"{self.source}: {column.path} has other times ({beside[0].path}) than the energy"
            raise FormatError(
                f"{found} ({self._time_column.path}); choose columns of the same times"
            )

    def precisions(self, names: Sequence[str]) -> tuple[Precision, Precision]:
        """Digits that the stored types hold."""
        energies = [_named(name, self._columns, self.source) for name in names]
        digits = [
            DIGITS[4 if column.dtype.endswith("32") else 8]
            for column in (self._time_column, *energies)
        ]
        return Precision(digits[0]), Precision(min(digits[1:], default=DIGITS[8]))

    @cached_property
    def _time_column(self) -> Column:
        if self._named_time:
            return self._named_time
        energy = (
            self._energies[0]
            if self._energies
            else _only_energy(self._columns, None, self.source)
        )
        return _only_time(self._columns, energy, self.source)

    def _load(self, column: Column) -> Samples:
        with _opened(self._file, self.source) as opened:
            return column.load(opened, self._file.getvalue(), self.source)


class SavedBinout(Database):
    """A binout that lasso-python saved: channels of its glstat branch, parts of its matsum branch."""

    format = "hdf5"

    def __init__(self, source: str, branches: dict[str, PartGroup]) -> None:
        self.source, self._branches = source, branches
        first = next(iter(branches.values()))
        self.title, self.version = first.title, first.version
        self.channels = branches["glstat"].channels if "glstat" in branches else ()
        self.parts = branches["matsum"].parts if "matsum" in branches else ()

    def branch(self, name: str) -> PartGroup:
        """Give a branch; FormatError where it was not saved."""
        if name not in self._branches:
            raise FormatError(
                f"{self.source}: no {name} in this saved binout; name the run's own files"
            )
        return self._branches[name]


class PartGroup(Database):
    """The glstat or matsum branch of a file that lasso-python saved."""

    def __init__(
        self, file: io.BytesIO, source: str, opened: h5py.File, name: str
    ) -> None:
        self._file, self.source, self.name = file, source, name
        group = opened[name]
        self.title = _line(group, "title")
        self.version = " ".join(
            text for text in (_line(group, "version"), _line(group, "revision")) if text
        )
        check_data(group["time"], source)
        self.time: Samples = finite(group["time"][()], f"{name}/time", source).reshape(
            -1
        )
        if "ids" in group:
            self.parts = _parts(group, source)
        else:
            self.channels = tuple(
                column.path
                for column in columns_of(group)
                if column.size == self.time.size
                and column.place is None
                and column.path != "time"
            )

    def channel(self, name: str) -> Samples:
        """Values of the dataset ``name``, shape (n,)."""
        if name not in self.channels:
            raise FormatError(
                f"{self.source}: {self.name} has no channel {name!r}, only {', '.join(self.channels)}"
            )
        with _opened(self._file, self.source) as opened:
            return self._load(opened[self.name], name, (self.time.size,))

    def part_channel(self, quantity: str, ids: Sequence[int]) -> Samples:
        """Values of a quantity for the parts ``ids``, shape (n, len(ids))."""
        known = [part.id for part in self.parts]
        missing = [id_ for id_ in ids if known.count(id_) != 1]
        if missing:
            found = f"{self.source}: {self.name} has not exactly one part {', '.join(map(str, missing))}"
            raise FormatError(
                f"{found}; choose from {', '.join(map(str, known)) or 'none'}"
            )
        with _opened(self._file, self.source) as opened:
            group = opened[self.name]
            if quantity not in group:
                raise FormatError(f"{self.source}: {self.name} has no {quantity}")
            values = self._load(group, quantity, (self.time.size, len(known)))
        return values[:, [known.index(id_) for id_ in ids]]

    def _load(self, group: h5py.Group, name: str, shape: tuple[int, ...]) -> Samples:
        """Dataset ``name``, which may lack the axes of length 1 of ``shape``."""
        dataset = group[name]
        check_data(dataset, self.source)
        if [size for size in dataset.shape if size != 1] != [
            size for size in shape if size != 1
        ]:
            raise FormatError(
                f"{self.source}: {dataset.name} has shape {dataset.shape}, {shape} was expected"
            )
        return finite(dataset[()], dataset.name, self.source).reshape(shape)


def _parts(group: h5py.Group, source: str) -> tuple[Part, ...]:
    """Parts in the order of the columns; titles by ``legend_ids``, which may be in another order."""
    check_data(group["ids"], source)
    titles: dict[int, str] = {}
    if "legend" in group and "legend_ids" in group:
        check_data(group["legend_ids"], source)
        ids = np.ravel(group["legend_ids"][()])
        legend = b"".join(np.ravel(group["legend"][()]).tolist())
        size, rest = divmod(len(legend), max(1, ids.size))
        if not rest:
            cut = [legend[size * row : size * (row + 1)] for row in range(ids.size)]
            titles = {
                int(id_): text.decode("latin-1").strip()
                for id_, text in zip(ids, cut, strict=True)
            }
    return tuple(
        Part(int(id_), titles.get(int(id_), "")) for id_ in np.ravel(group["ids"][()])
    )


def _line(group: h5py.Group, name: str) -> str:
    """Read a text that was saved as an array of one string."""
    if name not in group:
        return ""
    values = np.ravel(group[name][()])
    text = values[0] if values.size else b""
    return (
        text.decode("latin-1").strip("\0 ")
        if isinstance(text, bytes)
        else str(text).strip()
    )


def _named(path: str, columns: Sequence[Column], source: str) -> Column:
    found = [column for column in columns if column.path == path.strip("/")]
    near = (
        "" if found else near_miss(path.strip("/"), [column.path for column in columns])
    )
    return _only(found, columns, f"{path!r}{near}", source)


def _only_energy(columns: Sequence[Column], time: Column | None, source: str) -> Column:
    """Find the only column called an internal energy, or the only one beside the time."""
    fitting = [
        columns[place]
        for place in find_internal_energies([column.path for column in columns])
    ]
    if not fitting:
        times = [time] if time else [column for column in columns if column.is_time]
        fitting = [
            column
            for column in columns
            if column not in times
            and any(
                (column.group, column.size) == (one.group, one.size) for one in times
            )
        ]
        if len(fitting) == 1:
            refuse_other_quantity(fitting[0].path, source)
    return _only(fitting, columns, "the internal energy", source)


def _only_time(columns: Sequence[Column], energy: Column, source: str) -> Column:
    """Find the time in the group of the energy, else in the nearest group around it."""
    group = energy.group
    while True:
        fitting = [
            column for column in columns if column.is_time and column.group == group
        ]
        if fitting or not group:
            return _only(fitting, columns, f"the time of {energy.path}", source)
        group = group.rpartition("/")[0]


def _only(
    fitting: Sequence[Column], columns: Sequence[Column], what: str, source: str
) -> Column:
    if len(fitting) == 1:
        return fitting[0]
    count = "no column" if not fitting else f"{len(fitting)} columns"
    there = (
        listing(
            [f"{column.path} ({column.size})" for column in fitting or columns],
            most=_MANY,
        )
        or "there is none"
    )
    raise FormatError(
        f"{source}: {count} for {what}, one was expected; give its path: {there}"
    )


def _import_library(source: str) -> None:
    """Import h5py, before a process is forked that would import it too; FormatError where it is not installed."""
    try:
        import_module("h5py")
    except ImportError:
        raise FormatError(
            f"{source}: HDF5 files need h5py; pip install h5py, or export the columns as CSV"
        ) from None


@contextmanager
def _opened(file: io.BytesIO, source: str) -> Iterator[h5py.File]:
    """Open the file; whatever h5py makes of a damaged one becomes a FormatError."""
    import h5py

    try:
        with h5py.File(file, "r") as opened:
            yield opened
    except _DAMAGED as error:
        reason = printable(" ".join(str(error).split()))
        raise FormatError(
            f"{source}: HDF5 cannot be read ({reason}); the file is damaged or needs a filter"
        ) from error


# Damage of which the library crashes or goes round in a circle.

# Place of the end-of-file address in superblocks of version 0 to 3, of addresses of eight bytes, as all writers use.
_END_OF_FILE: Final = {0: 40, 1: 44, 2: 28, 3: 28}
_VERSION, _SIZE, _ADDRESS_SIZE = 8, {0: 13, 1: 13, 2: 9, 3: 9}, 8
# A reading that takes longer than these seconds and one for so many bytes goes round in a circle [s], [bytes].
_SECONDS: Final = 60
_SLOWEST: Final = 100_000
_USER_BLOCK: Final = 512  # MATLAB puts it before the file


def check_file(file: BinaryIO, source: str, seconds: int = _SECONDS) -> None:
    """FormatError where a file has not the size it says, is beyond the bounds, or the library would crash on it.

    It is read once in a child process, of limited time, so many seconds and one for each 100 kB: what ends that one
    would end this one, or never end.
    """
    _check_size_of_file(file, source)
    if not hasattr(os, "fork"):
        return
    reading, told = os.pipe()
    child = os.fork()
    if child == 0:
        _read_and_exit(file, source, seconds, told)
    os.close(told)
    with os.fdopen(reading, encoding="utf-8", errors="surrogateescape") as pipe:
        message = pipe.read()
    _, status = os.waitpid(child, 0)
    if message:
        raise FormatError(message)
    if os.WIFSIGNALED(status):
        number = os.WTERMSIG(status)
        what = (
            "did not finish reading it"
            if number == signal.SIGXCPU
            else f"crashed on it (signal {number})"
        )
        raise FormatError(
            f"{source}: the HDF5 library {what}; the file is damaged, copy it again"
        )


def _check_size_of_file(file: BinaryIO, source: str) -> None:
    head, size = _head_and_size(file)
    base = 0 if head.startswith(b"\x89HDF") else _USER_BLOCK
    head = head[base:]
    version = head[_VERSION] if len(head) > _VERSION else -1
    place = _END_OF_FILE.get(version)
    if (
        place is None
        or len(head) < place + _ADDRESS_SIZE
        or head[_SIZE[version]] != _ADDRESS_SIZE
    ):
        return  # the library says what is wrong with it
    (end,) = struct.unpack_from("<Q", head, place)
    if size not in (end, end + base):
        found = f"{source}: the file has {size} bytes, {end} by its own header"
        raise FormatError(f"{found}; it is damaged or cut, copy it again")


def _head_and_size(file: BinaryIO) -> tuple[bytes, int]:
    file.seek(0)
    head = file.read(2 * _USER_BLOCK)
    return head, file.seek(0, os.SEEK_END)


def _read_and_exit(file: BinaryIO, source: str, seconds: int, told: int) -> None:
    """Read all that could crash the library; what is beyond the bounds is ``told``, other errors are not for here."""
    try:
        import faulthandler
        import resource

        faulthandler.disable()
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        limit = seconds + _head_and_size(file)[1] // _SLOWEST
        _, most = resource.getrlimit(resource.RLIMIT_CPU)
        resource.setrlimit(
            resource.RLIMIT_CPU, (limit if most < 0 else min(limit, most), most)
        )
        os.dup2(os.open(os.devnull, os.O_WRONLY), 2)
        _read(file, source)
    except FormatError as error:
        os.write(told, str(error).encode(errors="surrogateescape"))
    finally:
        os._exit(0)


def _read(file: BinaryIO, source: str) -> None:
    """Read what describes the data, and data in chunks; FormatError where there is more than the bounds allow."""
    import h5py

    size, unpacked = _head_and_size(file)[1], 0

    def visit(name: bytes, info: h5py.h5o.ObjInfo) -> None:
        nonlocal unpacked
        if too_deep := beyond("DEPTH", name.count(b"/")):
            raise FormatError(f"{source}: its data lie in {too_deep}")
        if info.type == h5py.h5o.TYPE_DATASET:
            dataset = h5py.h5d.open(opened.id, name)
            if dataset.get_create_plist().get_layout() == h5py.h5d.CHUNKED:
                unpacked += h5py.Dataset(dataset).nbytes
                if too_much := unpacked_beyond(size, unpacked):
                    raise FormatError(f"{source}: its packed data become {too_much}")
                with suppress(Exception):
                    check_data(h5py.Dataset(dataset), "")
                    h5py.Dataset(dataset)[()]

    with h5py.File(file, "r") as opened:
        h5py.h5o.visit(opened.id, visit, info=True)


def write(columns: Mapping[str, Samples]) -> bytes:
    """Give a file with a dataset of doubles for each column (n,)."""
    import h5py

    content = io.BytesIO()
    with h5py.File(content, "w") as file:
        for name, column in columns.items():
            file[name] = column
    return content.getvalue()
