"""Contents of files as a run, past the names and folders that a user would give."""

from __future__ import annotations

from typing import TYPE_CHECKING

from d2rpick.choice.of_run import read
from d2rpick.histories.database import Legs
from d2rpick.histories.opening import Run, Selection
from d2rpick.histories.source import Source

if TYPE_CHECKING:
    from collections.abc import Sequence

    from d2rpick.histories.history import History
    from d2rpick.histories.opening import Reader


def run_of(reader: Reader, *contents: bytes | str, selection: Selection | None = None, name: str = "run") -> Run:
    """Open contents as the legs of one run in one format; texts are latin-1."""
    data = [content.encode("latin-1") if isinstance(content, str) else content for content in contents]
    names = [name] if len(data) == 1 else [f"{name}{number}" for number in range(1, len(data) + 1)]
    legs = reader.open_legs([Source(*file) for file in zip(names, data, strict=True)], selection or Selection())
    return Run(tuple(names), (Legs(legs),))


def history_of(
    reader: Reader, *contents: bytes | str, selection: Selection | None = None, name: str = "run"
) -> History:
    """Read the history that is selected, by default the internal energy."""
    selection = selection or Selection()
    return run_of(reader, *contents, selection=selection, name=name).history(selection)


def read_history(names: Sequence[str], selection: Selection | None = None, input_format: str = "auto") -> History:
    """Read the history that is selected of a run, by default the internal energy."""
    return read(names, selection or Selection(), input_format).history


def states_of(history: History) -> list[tuple[float, float]]:
    """Time and energy of each state."""
    return list(zip(history.time.tolist(), history.energy.tolist(), strict=True))
