"""Contents of files as a run, past the names and folders that a user would give."""

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
from d2rpick.histories.opening import Reader, Run, Selection, open_run, open_sources
from d2rpick.histories.source import Source
from tests.command import ROOT
from tests.computed import stored


class InPieces(OnDisk):
    """Read in pieces that are small even beside the files of tests."""

    block, gap, window = 256, 32, 64


def run_of(
    reader: Reader,
    *contents: bytes | str,
    selection: Selection | None = None,
    name: str = "run",
) -> Run:
    """Open contents as the legs of one run in one format; texts are latin-1."""
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
    return Run(tuple(names), (Legs(legs),))


def history_of(
    reader: Reader,
    *contents: bytes | str,
    selection: Selection | None = None,
    name: str = "run",
) -> History:
    """Read the history that is selected, by default the internal energy."""
    selection = selection or Selection()
    return run_of(reader, *contents, selection=selection, name=name).history(selection)


def read(
    names: Sequence[str], selection: Selection | None = None, input_format: str = "auto"
) -> Reference:
    """Read as `d2rpick.choice.question.read` does, each file of the repository once."""
    selection = selection or Selection()
    asked = (
        tuple(names),
        selection._replace(parts=(), flying=(), springs=None),
        input_format,
    )
    of_clone = all(Path(name).absolute().is_relative_to(ROOT) for name in names)
    return Reference.of((_opened if of_clone else open_run)(*asked), selection)


_opened = cache(open_run)


def solved(name: str, *parts: str) -> Reference:
    """Read a run of a solver in tests/data, and of its energy that of these parts."""
    return read([stored(name)], Selection(parts=parts))


def read_history(
    names: Sequence[str], selection: Selection | None = None, input_format: str = "auto"
) -> History:
    """Read the history that is selected of a run, by default the internal energy."""
    return read(names, selection, input_format).history


def on_disk(file: Path, of: type[OnDisk] = InPieces) -> OnDisk:
    """Content of a file that stays on its disk, however small it is itself."""
    with file.open("rb", buffering=0) as opened:
        state = read_at_rest(str(file), opened, FormatError, may_grow=True)
        assert not isinstance(state, bytes)
        return of(str(file), os.dup(opened.fileno()), state)


def run_of_file(file: Path) -> Run:
    """Open a file, which is held in memory where it is small."""
    return open_run([str(file)])


def run_on_disk(file: Path) -> Run:
    """Open a file and leave it on its disk."""
    return open_sources([Source(str(file), on_disk(file))])


def states_of(history: History) -> list[tuple[float, float]]:
    """Time and energy of each state."""
    return list(zip(history.time.tolist(), history.energy.tolist(), strict=True))
