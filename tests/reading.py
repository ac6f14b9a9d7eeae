"""Open file contents as a run, without the names and folders that a user would give."""

import os
from collections.abc import Sequence
from functools import cache
from pathlib import Path

from d2rpick.base.errors import FormatError
from d2rpick.base.files import read_at_rest
from d2rpick.choice.question import Reference
from d2rpick.histories.content import OnDisk
from d2rpick.histories.database import Legs
from d2rpick.histories.history import History
from d2rpick.histories.opening import (
    OpenedRun,
    Reader,
    Selection,
    open_run,
    open_sources,
)
from d2rpick.histories.source import Source
from tests.command import ROOT
from tests.computed import locate_stored


class InPieces(OnDisk):
    """File on disk that is read in pieces, which are small even compared with the test files."""

    block, gap, window = 256, 32, 64


def open_contents(
    reader: Reader,
    *contents: bytes | str,
    selection: Selection | None = None,
    name: str = "run",
) -> OpenedRun:
    """Open contents as the restart segments of one run in one format; texts are latin-1."""
    data = [
        content.encode("latin-1") if isinstance(content, str) else content
        for content in contents
    ]
    names = (
        [name]
        if len(data) == 1
        else [f"{name}{number}" for number in range(1, len(data) + 1)]
    )
    legs = reader.open_legs(
        [Source(*file) for file in zip(names, data, strict=True)],
        selection or Selection(),
    )
    return OpenedRun(tuple(names), (Legs(legs),))


def read_contents(
    reader: Reader,
    *contents: bytes | str,
    selection: Selection | None = None,
    name: str = "run",
) -> History:
    """Read the selected history, by default the internal energy."""
    selection = selection or Selection()
    return open_contents(reader, *contents, selection=selection, name=name).history(
        selection
    )


def read(
    names: Sequence[str], selection: Selection | None = None, input_format: str = "auto"
) -> Reference:
    """Read as `d2rpick.choice.question.read_reference` does; results for files of the repository are cached."""
    selection = selection or Selection()
    key = (
        tuple(names),
        selection._replace(parts=(), flying=(), springs=None),
        input_format,
    )
    of_clone = all(Path(name).absolute().is_relative_to(ROOT) for name in names)
    return Reference.of((_opened if of_clone else open_run)(*key), selection)


_opened = cache(open_run)


def read_solved(name: str, *parts: str) -> Reference:
    """Read a run computed by a solver from tests/data, and the energy of these parts."""
    return read([locate_stored(name)], Selection(parts=parts))


def read_history(
    names: Sequence[str], selection: Selection | None = None, input_format: str = "auto"
) -> History:
    """Read the selected history of a run, by default the internal energy."""
    return read(names, selection, input_format).history


def open_on_disk(file: Path, disk_type: type[OnDisk] = InPieces) -> OnDisk:
    """Open a file so that it stays on disk, however small it is."""
    with file.open("rb", buffering=0) as opened:
        state = read_at_rest(str(file), opened, FormatError, may_grow=True)
        assert not isinstance(state, bytes)
        return disk_type(str(file), os.dup(opened.fileno()), state)


def open_file(file: Path) -> OpenedRun:
    """Open a file; a small file is held in memory."""
    return open_run([str(file)])


def open_run_on_disk(file: Path) -> OpenedRun:
    """Open a file and leave it on disk."""
    return open_sources([Source(str(file), open_on_disk(file))])


def list_states(history: History) -> list[tuple[float, float]]:
    """Return time and energy of each state."""
    return list(zip(history.time.tolist(), history.energy.tolist(), strict=True))
