"""Where the bytes of a history come from: files, folders, globs, standard input."""

from __future__ import annotations

import os
import re
import stat
import sys
from typing import TYPE_CHECKING, Final

from d2rpick.base.errors import FormatError, listing
from d2rpick.base.files import STDIN, FileState, bound, unpacked_beyond
from d2rpick.base.tuples import NamedTuple
from d2rpick.histories.content import OnDisk, scattered, stored
from d2rpick.histories.formats import READERS
from d2rpick.histories.names import in_seconds, near_miss, number_in_family

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path


# Files of LS-DYNA's d3 family, with the name of the job and the number in the family, if any.
_FAMILY: Final = r"(?i:(?P<first>(?:.*\.)?d3(?:plot|thdt|part))(?P<number>\d{2,})?)"
# Files of forces, which count beside those that hold energies.
_FORCES: Final = r"(?i:r[cw]forc(?:\.gz)?)"
_GZIP = b"\x1f\x8b"
_BLOCK = 1 << 16  # packed bytes at a time, which become 68 MB at most
# Files of a folder often share their suffix, and have it in common with any name that has it.
_LIKENESS = 0.8
_NUMBER = r"\d+\.?\d*|\.\d+"  # compiled where it is needed, as the next one


class Source(NamedTuple):
    """The unpacked bytes of one file, those of a big one still on its disk, under the name the user gave it.

    ``cut`` is True when packed data ends early: ``data`` is what could be unpacked of ``packed``.  ``by_pattern`` is
    True if a pattern matched the file, and nobody named it.
    """

    name: str
    data: bytes | OnDisk
    cut: bool = False
    packed: bytes | OnDisk | None = None
    by_pattern: bool = False

    def sha256(self) -> str:
        """SHA-256 of the bytes that were read, as they lay on the disk or came in by standard input.

        ChangedError where a big file was written anew since.
        """
        read = self.data if self.packed is None else self.packed
        if not isinstance(read, bytes):
            return read.sha256()
        import hashlib

        return hashlib.sha256(read).hexdigest()


def expand(names: Sequence[str]) -> tuple[str, ...]:
    """Replace folders and globs by the files they hold, without changing the order otherwise.

    Of a folder only the databases of solvers count, and they must be of one run.

    Raises
    ------
    FormatError
        If a folder or glob holds none, or a folder the T01 files of several runs.
    """
    return tuple(dict.fromkeys(file for name in names for file in _files(name)))


def open_files(names: Sequence[str]) -> list[Source]:
    """Read the files of one run, as `expand` gives them and `open_source` reads them.

    Raises
    ------
    FormatError
        If one cannot be read, or one of several was replaced or cut meanwhile: they may be of two runs.
    """
    files = expand(names)
    apart = _of_families(files)  # what is read of them is checked when it is
    before = {name: _state(name) for name in files if name not in apart}
    given = {
        *names,
        *(file for name in names if not _is_pattern(name) for file in _files(name)),
    }
    opened = (apart[name] if name in apart else open_source(name) for name in files)
    sources = [
        source._replace(by_pattern=source.name not in given) for source in opened
    ]
    for name, state in before.items():
        now = _state(name)
        if len(files) > 1 and not (
            now.continues(state) if now and state else now is state
        ):
            found = f"{name}: this file was replaced or written anew while the others of its run were opened"
            raise FormatError(f"{found}; read them again when they are complete")
    return sources


def _of_families(names: Sequence[str]) -> dict[str, Source]:
    """Open those of the files of which little is read, by their names."""
    family = re.compile(_FAMILY)
    found = [name for name in names if family.fullmatch(os.path.basename(name))]  # noqa: PTH119
    try:
        sources = {
            name: Source(name, data)
            for name, data in zip(found, scattered(found), strict=True)
        }
    except OSError as error:
        raise _unread(error.filename, error) from None
    for name, source in sources.items():
        if (
            not source.data and not name[-1].isdigit()
        ):  # a solver opens the next file before it writes a state
            raise _empty(name)
    return sources


def _state(name: str) -> FileState | None:
    """State of a file; None of what is none."""
    try:
        found = os.stat(name)  # noqa: PTH116  start-up
    except (OSError, ValueError):
        return None
    return (
        FileState.of_stat(found)
        if stat.S_ISREG(found.st_mode) and name != STDIN
        else None
    )


def open_source(name: str) -> Source:
    """Read a file, or standard input for ``-``; what is gzipped is unpacked.

    Raises
    ------
    FormatError
        If there is nothing to be read under this name.
    """
    data = _read_stdin() if name == STDIN else _read_file(name)
    source = _unpacked(name, data) if data[:2] == _GZIP else Source(name, data)
    if not source.data:
        raise _empty(name)
    return source


def _empty(name: str) -> FormatError:
    return FormatError(f"{name}: the file is empty; has the run been started?")


def _files(name: str) -> Sequence[str]:
    # os.path, not pathlib: start-up
    if name == STDIN or os.path.isfile(name):  # noqa: PTH113
        return [name, *_behind(name)]
    from pathlib import Path

    path = Path(name)
    try:
        is_folder = path.is_dir()
    except OSError:  # a name too long; what is wrong with it shows when it is opened
        return [name]
    if is_folder:
        return _databases(path)
    if _is_pattern(name):
        found = sorted(
            str(file)
            for file in Path(path.anchor).glob(name.removeprefix(path.anchor))
            if file.is_file()
        )
        if not found:
            raise FormatError(f"{name}: no file matches; check the name and the folder")
        return found
    return [name]


def _is_pattern(name: str) -> bool:
    return any(sign in name for sign in "*?[")


def _behind(name: str) -> Sequence[str]:
    """Find the files behind the first one of a family, in their order: who names that one means all."""
    folder, first = os.path.split(name)
    match = re.fullmatch(_FAMILY, first)
    if match is None or match["number"]:
        return []
    try:
        beside = os.listdir(folder or ".")  # noqa: PTH208  not pathlib: start-up
    except OSError:
        return []
    numbers = {
        name: number
        for name in beside
        if (number := number_in_family(name, first)) is not None
    }
    in_order = sorted(numbers, key=numbers.__getitem__)
    return [os.path.join(folder, name) for name in in_order]  # noqa: PTH118


def _databases(folder: Path) -> list[str]:
    found = {file: run for file in sorted(folder.iterdir()) if (run := _run_of(file))}
    if not found:
        inner = any(map(_run_of, folder.glob("*/*")))
        cure = (
            f"its folders are runs: give one, or all to study as '{folder}/*'"
            if inner
            else "give the file"
        )
        raise FormatError(
            f"{folder}: no glstat, matsum, binout, d3plot or T01 in this folder; {cure}"
        )
    runs = sorted({*found.values()})
    if len(runs) > 1:
        what = f"{folder}: this folder holds several runs ({listing(runs, most=5)}), one was expected"
        raise FormatError(f"{what}; name the files of one")
    return [str(file) for file in found]


def _run_of(file: Path) -> str:
    """Say to which run a file belongs that has the name of a solver's database; nothing of any other."""
    if re.fullmatch(_FORCES, file.name) and file.is_file():
        return "one of LS-DYNA"
    for one in READERS.values():
        match = re.fullmatch(rf"{one.files}(?:\.gz)?", file.name) if one.files else None
        if match and file.is_file():
            return (
                f"{match['root']}T01" if match.groupdict() else f"one of {one.solver}"
            )
    return ""


def _read_stdin() -> bytes:
    if sys.stdin is None:
        raise FormatError(f"{STDIN}: standard input is closed; give a file")
    try:
        return sys.stdin.buffer.read()
    except OSError as error:
        raise FormatError(
            f"{STDIN}: standard input cannot be read ({error.strerror}); give a file"
        ) from None


def _read_file(name: str) -> bytes | OnDisk:
    try:
        return stored(name)
    except (OSError, ValueError) as error:  # ValueError: a NUL character in the name
        raise _unread(name, error) from None


def _unread(name: str, error: OSError | ValueError) -> FormatError:
    if isinstance(error, FileNotFoundError):
        return FormatError(
            f"{name}: no such file{_meant(name)}; check the name and the folder"
        )
    reason = getattr(error, "strerror", None) or error
    return FormatError(
        f"{name}: cannot be read ({reason}); check the name and the permissions"
    )


def _meant(name: str) -> str:
    """Ask for the file beside it that has nearly this name, or whether it is a time."""
    seconds = in_seconds(name)
    if seconds is not None or re.fullmatch(_NUMBER, name):
        value = "" if seconds is None else f", {seconds:g} where it is s"
        return (
            f", and a time is given as `td`, a number in the unit of the record{value}"
        )
    folder, wanted = os.path.split(name)
    try:
        beside = os.listdir(folder or ".")  # noqa: PTH208  not pathlib: start-up
    except OSError:
        return ""
    return near_miss(wanted, beside, _LIKENESS)


def _unpacked(name: str, packed: bytes | OnDisk) -> Source:
    """Unpack what there is, within the bounds."""
    import zlib

    data = bytes(packed)
    try:
        if len(data) * bound("RATIO") > bound("UNPACKED"):
            _pieces(name, data, keep=False)  # before memory is taken for it
        pieces, cut = _pieces(name, data)
        return Source(name, b"".join(pieces), cut, packed)
    except zlib.error as error:
        raise FormatError(
            f"{name}: damaged gzip data ({error}); copy the file again"
        ) from None
    except MemoryError:
        raise FormatError(
            f"{name}: its unpacked data do not fit into memory; unpack it with gunzip"
        ) from None


def _pieces(name: str, packed: bytes, *, keep: bool = True) -> tuple[list[bytes], bool]:
    """Unpack files packed one behind the other; whether the last of them is cut."""
    import zlib

    found, size, unpacker = (
        list[bytes](),
        0,
        zlib.decompressobj(wbits=31),
    )  # 31: the gzip format
    for end in range(_BLOCK, len(packed) + _BLOCK, _BLOCK):
        rest = packed[end - _BLOCK : end]
        while rest:
            if unpacker.eof:
                if not _GZIP.startswith(rest[:2]):
                    return found, False
                unpacker = zlib.decompressobj(wbits=31)
            piece = unpacker.decompress(rest)
            found += [piece] * keep
            size += len(piece)
            if too_much := unpacked_beyond(end, size):
                raise FormatError(f"{name}: its packed data become {too_much}")
            rest = unpacker.unused_data
    return found, not unpacker.eof


# A name and the number of the leg behind it: runT01, binout0001, glstat02; the first leg may have none.
_NUMBERED: Final = re.compile(r"(.*?)(\d*)(\.gz)?", re.DOTALL)


def later_legs(names: Sequence[str]) -> list[str]:
    """Find the files beside these that are named alike but for a higher number at the end, and were not named."""
    from pathlib import Path  # not above: start-up

    found: list[str] = []
    for name in names:
        path = Path(name)
        stem, number = _split(path.name)
        try:
            beside = sorted(path.parent.iterdir())
        except OSError:
            continue
        found += [
            str(one)
            for one in beside
            if _split(one.name)[0] == stem and _split(one.name)[1] > number
        ]
    named = {str(Path(name)) for name in names}
    return [name for name in dict.fromkeys(found) if name not in named]


def _split(name: str) -> tuple[str, int]:
    match = _NUMBERED.fullmatch(name)
    assert match is not None  # it matches any text
    return match[1], int(match[2] or 0)
