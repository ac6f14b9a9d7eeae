"""Find the files of a history (files, folders, glob patterns, standard input) and read their bytes."""

from __future__ import annotations

import os
import re
import stat
import sys
from typing import TYPE_CHECKING, Final

from d2rpick.base.errors import SEVERAL_RUNS, FormatError, list_names
from d2rpick.base.files import STDIN, FileState, bound, describe_unpacked_excess
from d2rpick.base.tuples import NamedTuple
from d2rpick.histories.content import OnDisk, open_content, open_scattered
from d2rpick.histories.digits import parse_seconds
from d2rpick.histories.formats import READERS
from d2rpick.histories.names import number_in_family, suggest_file

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path


# Pattern of the file names of LS-DYNA's d3 families: job name, family name, file number.
_FAMILY: Final = r"(?i:(?P<first>(?:.*\.)?d3(?:plot|thdt|part))(?P<number>\d{2,})?)"
# Pattern of the file names of force listings, which are read in addition to files that contain energies.
_FORCES: Final = r"(?i:r[cw]forc(?:\.gz)?)"
# Name of an LS-DYNA database that begins with the name of its job, such as job7.glstat.
_OF_JOB: Final = r"(?i:(?P<job>.+)\.(?:glstat|matsum|binout[\d%]*|d3plot\d*|d3thdt\d*|r[cw]forc)(?:\.gz)?)"
_GZIP = b"\x1f\x8b"
# Number of packed bytes that are unpacked at a time; they unpack to at most 68 MB.
_BLOCK = 1 << 16
_NUMBER = r"\d+\.?\d*|\.\d+"
# A table with this word in its first bytes is probably an energy history.
_ENERGY_IN_HEAD: Final = b"energy"
_HEAD_OF_TABLE: Final = 4096
# Name that contains that of a database with energies, such as matsum01 or glstat.old.
_LIKE_DATABASE: Final = r"(?i:.*(?:glstat|matsum|binout|d3thdt).*)"
# Suffixes of results, figures, programs and decks, which are no history even if they are named after one.
_OTHER_SUFFIXES: Final = (
    *(".csv", ".html", ".json", ".k", ".key", ".md", ".ndjson"),
    *(".pdf", ".png", ".py", ".rad", ".sh", ".svg", ".toml"),
)
# The patterns below are compiled on first use to keep start-up fast.
# Beginning of an address on the network, such as https://.
_ADDRESS: Final = r"(?i)[a-z]+://"
# Suffixes of decks. A folder with decks but no databases belongs to a run that has not been computed yet.
_DECKS: Final = (".k", ".key", ".dyn", ".rad")

# Pattern of the name of a Radioss history, whose last two digits are the number of its restart segment.
_RADIOSS_LEG: Final = r"(?s)(.*T)(\d\d)(?:\.gz)?"
# Pattern of a file name with or without the number of a restart segment (e.g. runT01, binout0001).
_NUMBERED: Final = r"(?s)(.*?)(\d*)(\.gz)?"


class Source(NamedTuple):
    """The unpacked bytes of one file, in memory or on disk, under the file name that the user gave.

    ``cut`` is True if packed data is truncated; ``data`` is then the part of ``packed`` that could be unpacked.
    ``by_pattern`` is True if the user gave a pattern or folder rather than the name of the file.
    """

    name: str
    data: bytes | OnDisk
    cut: bool = False
    packed: bytes | OnDisk | None = None
    by_pattern: bool = False

    def sha256(self) -> str:
        """Return the SHA-256 of the bytes as they were read, before unpacking.

        Raises ChangedError if a large file was rewritten since then.
        """
        raw = self.data if self.packed is None else self.packed
        if not isinstance(raw, bytes):
            return raw.sha256()
        import hashlib

        return hashlib.sha256(raw).hexdigest()


def expand(names: Sequence[str]) -> tuple[str, ...]:
    """Replace folders and patterns by the files that they contain or match, and keep the order of all others.

    Only the solver databases in a folder are used, and they must belong to one run.

    Raises
    ------
    FormatError
        If a folder or pattern yields no file, or if a folder contains the T01 files of several runs.
    """
    return tuple(dict.fromkeys(file for name in names for file in _list_files(name)))


def open_files(names: Sequence[str]) -> list[Source]:
    """Read the files of one run that `expand` finds and `open_source` opens.

    Raises
    ------
    FormatError
        If a file cannot be read, or if one of several files was replaced or truncated in the meantime, so that they may
        belong to two runs.
    """
    files = expand(names)
    families = _open_families(files)  # The files of a family are checked at each read.
    states_before = {
        name: _look_at_state(name) for name in files if name not in families
    }
    named_files = {*names}
    for name in names:
        if not _is_pattern(name):
            named_files.update(_list_files(name))
    sources = []
    for name in files:
        source = families[name] if name in families else open_source(name)
        sources.append(source._replace(by_pattern=source.name not in named_files))
    for name, state in states_before.items():
        now = _look_at_state(name)
        is_unchanged = now.continues(state) if now and state else now is state
        if len(files) > 1 and not is_unchanged:
            raise FormatError(
                f"{name}: this file was replaced or written anew while the others of its run were opened; "
                "read them again when they are complete"
            )
    return sources


def _open_families(names: Sequence[str]) -> dict[str, Source]:
    """Open the files whose names show that they belong to families, of which only small parts are read."""
    family = re.compile(_FAMILY)
    in_families = [name for name in names if family.fullmatch(os.path.basename(name))]  # noqa: PTH119  pathlib would slow down start-up
    try:
        sources = {
            name: Source(name, data)
            for name, data in zip(in_families, open_scattered(in_families), strict=True)
        }
    except OSError as error:
        raise _report_unread(error.filename, error) from None
    for name, source in sources.items():
        # A later file may be empty, because a solver opens it before writing a state to it.
        if not source.data and not name[-1].isdigit():
            raise _report_empty(name)
    return sources


def _look_at_state(name: str) -> FileState | None:
    """Return the status of a file; None if it is not a regular file."""
    try:
        status = os.stat(name)  # noqa: PTH116  pathlib would slow down start-up
    except (OSError, ValueError):
        return None
    if name == STDIN or not stat.S_ISREG(status.st_mode):
        return None
    return FileState.of_stat(status)


def open_source(name: str) -> Source:
    """Read a file, or standard input for the name ``-``, and unpack it if it contains gzip data.

    Raises
    ------
    FormatError
        If there is no readable file of this name.
    """
    data = _read_stdin() if name == STDIN else _read_file(name)
    source = _unpack(name, data) if data[:2] == _GZIP else Source(name, data)
    if not source.data:
        raise _report_empty(name)
    return source


def _report_empty(name: str) -> FormatError:
    """Return the error for an empty file."""
    return FormatError(
        f"{name}: the file is empty, states were expected; wait until the run has written some, or give another file"
    )


def _list_files(name: str) -> Sequence[str]:
    """Return the files that a name stands for: a file with its family, the files of a folder, or those of a pattern."""
    # os.path is used instead of pathlib to keep start-up fast.
    if name == STDIN or os.path.isfile(name):  # noqa: PTH113  pathlib would slow down start-up
        return [name, *_list_later_files(name)]
    from pathlib import Path

    path = Path(name)
    try:
        is_folder = path.is_dir()
    except OSError:  # A name that is too long is reported when the file is opened.
        return [name]
    if is_folder:
        return _list_databases(path)
    if _is_pattern(name):
        pattern = name.removeprefix(path.anchor)
        matches = Path(path.anchor).glob(pattern)
        files = sorted(str(file) for file in matches if file.is_file())
        if not files:
            raise FormatError(f"{name}: no file matches; check the name and the folder")
        return files
    return [name]


def _is_pattern(name: str) -> bool:
    """Return True if a name contains a wildcard."""
    return any(sign in name for sign in "*?[")


def _list_later_files(name: str) -> Sequence[str]:
    """Return the later files of a family in ascending order, given the name of its first file."""
    folder, first = os.path.split(name)
    match = re.fullmatch(_FAMILY, first)
    if match is None or match["number"]:
        return []
    try:
        siblings = os.listdir(folder or ".")  # noqa: PTH208  pathlib would slow down start-up
    except OSError:
        return []
    numbers: dict[str, int] = {}
    for sibling in siblings:
        number = number_in_family(sibling, first)
        if number is not None:
            numbers[sibling] = number
    in_order = sorted(numbers, key=numbers.__getitem__)
    return [os.path.join(folder, sibling) for sibling in in_order]  # noqa: PTH118  pathlib would slow down start-up


def _list_databases(folder: Path) -> list[str]:
    """Return the solver databases in a folder; raise FormatError unless all belong to one run."""
    runs_of_files = {file: _find_run(file) for file in sorted(folder.iterdir())}
    databases = {file: run for file, run in runs_of_files.items() if run}
    of_no_job = {
        file: run for file, run in databases.items() if not _find_job(file.name)
    }
    # Files that a user has named, such as old.glstat, may lie beside the files of the solver.
    databases = of_no_job or databases
    if not databases:
        inner = any(map(_find_run, folder.glob("*/*")))
        cure = "give the file"
        decks = [file.name for file in runs_of_files if file.suffix in _DECKS]
        if decks:
            cure = f"it contains the deck {decks[0]}: run it, or give the files that the solver wrote"
        if inner:
            cure = f"its folders are runs: give one, or all to study as '{folder}/*'"
        raise FormatError(
            f"{folder}: no glstat, matsum, binout, d3plot or T01 in this folder; {cure}"
        )
    runs = sorted({*databases.values()})
    if len(runs) > 1:
        problem = f"{folder}: this folder contains {SEVERAL_RUNS} ({list_names(runs, most=5)}), but one was expected"
        raise FormatError(f"{problem}; give the files of one run")
    return [str(file) for file in databases]


def list_tables_of_folder(name: str) -> list[str]:
    """Return the unread CSV files with energies in a folder; empty if ``name`` is not a folder."""
    if name == STDIN or not os.path.isdir(name):  # noqa: PTH112  pathlib would slow down start-up
        return []
    from pathlib import Path

    return [
        str(file)
        for file in sorted(Path(name).glob("*.csv"))
        if file.is_file() and _ENERGY_IN_HEAD in _read_head(file).lower()
    ]


def list_unread_databases(name: str, files: Sequence[str]) -> list[str]:
    """Return the files of a folder that are named like a database but are not among the ``files`` that were read.

    No file is opened. The result is empty if ``name`` is not a folder.
    """
    if name == STDIN or not os.path.isdir(name):  # noqa: PTH112  pathlib would slow down start-up
        return []
    given = {os.path.basename(file) for file in files}  # noqa: PTH119  pathlib would slow down start-up
    with os.scandir(name) as entries:
        return sorted(
            os.path.join(name, entry.name)  # noqa: PTH118  pathlib would slow down start-up
            for entry in entries
            if re.fullmatch(_LIKE_DATABASE, entry.name)
            and entry.name not in given
            and not entry.name.lower().endswith(_OTHER_SUFFIXES)
            and entry.is_file()
        )


def _read_head(file: Path) -> bytes:
    """Return the first bytes of a file; empty if it cannot be read."""
    try:
        with file.open("rb") as opened:
            return opened.read(_HEAD_OF_TABLE)
    except OSError:
        return b""


def _find_run(file: Path) -> str:
    """Return the run name that the file name of a solver database contains; empty for any other file."""
    job = _find_job(file.name)
    name = file.name.removeprefix(f"{job}.")
    if re.fullmatch(_FORCES, name) and file.is_file():
        return job or "one of LS-DYNA"
    for listed in READERS.values():
        if not listed.files:
            continue
        match = re.fullmatch(rf"{listed.files}(?:\.gz)?", name)
        if match and file.is_file():
            if match.groupdict():
                return f"{match['root']}T01"
            return job or f"one of {listed.solver}"
    return ""


def _find_job(name: str) -> str:
    """Return the job that LS-DYNA puts before the name of a database (``jobid=`` of its command line), or nothing."""
    match = re.fullmatch(_OF_JOB, name)
    return match["job"] if match else ""


def _read_stdin() -> bytes:
    """Return the bytes of standard input."""
    if sys.stdin is None:
        raise FormatError(f"{STDIN}: standard input is closed; give a file")
    try:
        return sys.stdin.buffer.read()
    except OSError as error:
        raise FormatError(
            f"{STDIN}: standard input cannot be read ({error.strerror}); give a file"
        ) from None


def _read_file(name: str) -> bytes | OnDisk:
    """Return the content of a file; raise FormatError if it cannot be read."""
    try:
        return open_content(name)
    except (
        OSError,
        ValueError,
    ) as error:  # A name with a NUL character raises a ValueError.
        raise _report_unread(name, error) from None


def _report_unread(name: str, error: OSError | ValueError) -> FormatError:
    """Return the error for a file that cannot be read."""
    if isinstance(error, FileNotFoundError) and os.path.islink(name):  # noqa: PTH114  pathlib would slow down start-up
        target = os.readlink(name)  # noqa: PTH115  pathlib would slow down start-up
        return FormatError(
            f"{name}: this link leads to {target}, which does not exist; give the file itself, or correct the link"
        )
    if isinstance(error, FileNotFoundError) and re.match(_ADDRESS, name):
        return FormatError(
            f"{name}: an address on the network cannot be read; download the file, and give its name"
        )
    if isinstance(error, FileNotFoundError):
        return FormatError(
            f"{name}: no such file{_suggest_file(name)}; check the name and the folder"
        )
    reason = getattr(error, "strerror", None) or error
    return FormatError(
        f"{name}: cannot be read ({reason}); check the name and the permissions"
    )


def _suggest_file(name: str) -> str:
    """Return a question that suggests a similar file in the folder, a hint if the name is a time, or ""."""
    seconds = parse_seconds(name)
    if seconds is not None or re.fullmatch(_NUMBER, name):
        value = "" if seconds is None else f", {seconds:g} if that unit is s"
        hint = (
            f", and a time is given as `td`, a number in the unit of the record{value}"
        )
        if name.isdecimal():
            hint += "; several parts are separated by commas, as in `parts` 1,2"
        return hint
    return suggest_file(name)


def _unpack(name: str, packed: bytes | OnDisk) -> Source:
    """Unpack gzip data as far as they are complete, within the limits on memory."""
    import zlib

    data = bytes(packed)
    try:
        if len(data) * bound("RATIO") > bound("UNPACKED"):
            # The size is checked before memory is allocated for the data.
            _unpack_pieces(name, data, keep=False)
        pieces, cut = _unpack_pieces(name, data)
        return Source(name, b"".join(pieces), cut, packed)
    except zlib.error as error:
        raise FormatError(
            f"{name}: damaged gzip data ({error}); copy the file again"
        ) from None
    except MemoryError:
        raise FormatError(
            f"{name}: its unpacked data do not fit into memory; unpack it with gunzip"
        ) from None


def _unpack_pieces(
    name: str, packed: bytes, *, keep: bool = True
) -> tuple[list[bytes], bool]:
    """Unpack consecutive gzip files; return their contents, and True if the last file is truncated."""
    import zlib

    pieces: list[bytes] = []
    size = 0
    unpacker = zlib.decompressobj(wbits=31)  # The value 31 selects the gzip format.
    for end in range(_BLOCK, len(packed) + _BLOCK, _BLOCK):
        unread = packed[end - _BLOCK : end]
        while unread:
            if unpacker.eof:
                if not _GZIP.startswith(unread[:2]):
                    return pieces, False
                unpacker = zlib.decompressobj(wbits=31)
            piece = unpacker.decompress(unread)
            if keep:
                pieces.append(piece)
            size += len(piece)
            if too_much := describe_unpacked_excess(end, size):
                raise FormatError(f"{name}: its packed data become {too_much}")
            unread = unpacker.unused_data
    return pieces, not unpacker.eof


def has_next_leg(name: str) -> bool:
    """Return True if the file is a T01, T02, ... of Radioss and the file with the next number is in its folder."""
    match = re.fullmatch(_RADIOSS_LEG, name)
    if match is None:
        return False
    successor = f"{match[1]}{int(match[2]) + 1:02d}"
    return any(os.path.isfile(f"{successor}{suffix}") for suffix in ("", ".gz"))  # noqa: PTH113  pathlib would slow down start-up


def find_unread_legs(files: Sequence[str]) -> list[str]:
    """Return the later restart segments of a Radioss run that lie next to its ``files`` but are not among them."""
    continued = [file for file in files if has_next_leg(file)]
    if not continued:
        return []
    from pathlib import Path  # Imported here to keep start-up fast.

    given = {str(Path(file)) for file in files}
    return [leg for leg in find_later_legs(continued) if leg not in given]


def find_earlier_legs(files: Sequence[str]) -> list[str]:
    """Return the restart segments of a Radioss run that lie next to its ``files`` and precede the first of them."""
    matches = [match for file in files if (match := re.fullmatch(_RADIOSS_LEG, file))]
    if not matches:
        return []
    first = min(matches, key=lambda match: int(match[2]))
    names = (f"{first[1]}{number:02d}" for number in range(1, int(first[2])))
    return [
        name
        for stem in names
        for name in (stem, f"{stem}.gz")
        if os.path.isfile(name)  # noqa: PTH113  pathlib would slow down start-up
    ]


def find_later_legs(names: Sequence[str]) -> list[str]:
    """Return the later restart segments next to these files that the user did not name."""
    from pathlib import Path  # Imported here to keep start-up fast.

    legs: list[str] = []
    for name in names:
        path = Path(name)
        stem, number = _split_leg_number(path.name)
        try:
            siblings = sorted(path.parent.iterdir())
        except OSError:
            continue
        for sibling in siblings:
            sibling_stem, sibling_number = _split_leg_number(sibling.name)
            if sibling_stem == stem and sibling_number > number:
                legs.append(str(sibling))
    given = {str(Path(name)) for name in names}
    return [leg for leg in dict.fromkeys(legs) if leg not in given]


def _split_leg_number(name: str) -> tuple[str, int]:
    """Split a file name into its stem and the number of its restart segment (0 if there is none)."""
    match = re.fullmatch(_NUMBERED, name)
    # The match is never None, because the pattern matches any text.
    assert match is not None
    return match[1], int(match[2] or 0)
