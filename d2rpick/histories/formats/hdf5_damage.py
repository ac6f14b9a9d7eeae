"""Damage of an HDF5 file that its library does not report: a crash, bytes too many, chunks that are not there.

What cannot be seen: a changed byte in data that is stored without a checksum: `fletcher32`, or that of gzip.
"""

from __future__ import annotations

import os
import signal
import struct
from contextlib import suppress
from functools import cache
from typing import TYPE_CHECKING, BinaryIO, Final

from d2rpick.base.errors import FormatError
from d2rpick.base.files import beyond, unpacked_beyond

if TYPE_CHECKING:
    from collections.abc import Iterator

    import h5py


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
        what = "did not finish reading it" if number == signal.SIGXCPU else f"crashed on it (signal {number})"
        raise FormatError(f"{source}: the HDF5 library {what}; the file is damaged, copy it again")


def check_data(dataset: h5py.Dataset, source: str) -> None:
    """FormatError if data of a dataset are not there, which would read as zeros, or of a type that nothing writes."""
    _check_type(dataset, source)
    stored = dataset.id.get_storage_size()
    if too_much := unpacked_beyond(stored, dataset.nbytes):
        raise FormatError(f"{source}: {dataset.name} becomes {too_much}")
    if dataset.size and not stored:
        raise FormatError(f"{source}: {dataset.name} was never written; choose another dataset or copy the file again")
    if dataset.chunks and dataset.size:
        chunks: set[tuple[int, ...]] = set()
        dataset.id.chunk_iter(lambda chunk: chunks.add(tuple(chunk.chunk_offset)))
        expected = 1
        for extent, length in zip(dataset.shape, dataset.chunks, strict=True):
            expected *= -(-extent // length)
        inside = sum(all(at < extent for at, extent in zip(chunk, dataset.shape, strict=True)) for chunk in chunks)
        if inside < expected:
            found = f"{source}: {dataset.name} has {inside} of {expected} chunks of its data"
            raise FormatError(f"{found}; the file is damaged or was not written to its end")


def _check_type(dataset: h5py.Dataset, source: str) -> None:
    """FormatError for numbers of a type that HDF5 does not define: a changed byte in it would change them all."""
    for kind in _numbers(dataset.id.get_type()):
        if not any(kind.equal(standard) for standard in _standard_types()):
            found = f"{source}: {dataset.name} has numbers of {kind.get_size()} bytes that are no standard type of HDF5"
            raise FormatError(f"{found}; the file is damaged, copy it again, or write it with a standard type")


def _numbers(kind: h5py.h5t.TypeID) -> Iterator[h5py.h5t.TypeID]:
    """Types of the numbers in a type, which may be made of others."""
    import h5py

    if isinstance(kind, h5py.h5t.TypeCompoundID):
        for member in range(kind.get_nmembers()):
            yield from _numbers(kind.get_member_type(member))
    elif isinstance(kind, h5py.h5t.TypeArrayID | h5py.h5t.TypeEnumID):
        yield from _numbers(kind.get_super())
    elif isinstance(kind, h5py.h5t.TypeAtomicID) and kind.get_class() in (h5py.h5t.INTEGER, h5py.h5t.FLOAT):
        yield kind


@cache
def _standard_types() -> tuple[h5py.h5t.TypeID, ...]:
    import h5py

    names = [f"IEEE_F{bits}" for bits in (16, 32, 64)] + [
        f"STD_{sign}{bits}" for sign in "IU" for bits in (8, 16, 32, 64)
    ]
    return tuple(getattr(h5py.h5t, name + order) for name in names for order in ("LE", "BE"))


def _check_size_of_file(file: BinaryIO, source: str) -> None:
    head, size = _head_and_size(file)
    base = 0 if head.startswith(b"\x89HDF") else _USER_BLOCK
    head = head[base:]
    version = head[_VERSION] if len(head) > _VERSION else -1
    place = _END_OF_FILE.get(version)
    if place is None or len(head) < place + _ADDRESS_SIZE or head[_SIZE[version]] != _ADDRESS_SIZE:
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
        resource.setrlimit(resource.RLIMIT_CPU, (limit if most < 0 else min(limit, most), most))
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
