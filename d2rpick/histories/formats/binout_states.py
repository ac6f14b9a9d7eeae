"""The states of one branch of a binout family: which ones count, in order, grouped for reading by columns."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from typing import Any

    from numpy.typing import NDArray

    from d2rpick.histories.formats.lsda import DirectoryLayout, Lsda, Variable

    Indices = NDArray[np.int64]

# Values gathered at a time: keeps the index arrays small beside the answer.
_CHUNK: Final = 1 << 17


@dataclass(frozen=True)
class Group:
    """States of one file and one layout: their rows in the columns, and the bytes where they start."""

    file: Lsda
    layout: DirectoryLayout
    rows: Indices
    starts: Indices

    def chunks(self, width: int) -> Iterator[Group]:
        """Divide into pieces of so few states that ``width`` values of each fit into a chunk."""
        length = max(1, _CHUNK // max(1, width))
        for begin in range(0, self.rows.size, length):
            part = slice(begin, begin + length)
            yield Group(self.file, self.layout, self.rows[part], self.starts[part])

    def values(self, variable: Variable, places: Indices) -> NDArray[Any]:
        """Values of a variable at ``places`` of its list, shape (states, places); floating-point ones as doubles."""
        positions = self.starts[:, None] + variable.offset + variable.dtype.itemsize * places
        found = self.file.read(positions, variable.dtype)
        with np.errstate(invalid="ignore"):  # a NaN of any kind is refused, or not used
            return found.astype(np.float64) if variable.dtype.kind == "f" else found


class States:
    """The states of one branch in all files of a family.

    A solver numbers its states one by one.  Where a file begins higher than the last one ended, a member of
    the family is missing; a number that comes again begins a newer leg, which writes the same variables, be it
    the same states again or the next ones: that shows in their times.  A number left out inside a file, a name
    twice in a state and a leg with other variables are the marks of records lost or out of place: what then seems
    to be one state may be made of two.

    Attributes
    ----------
    numbers : array of int, shape (n,)
        Number of each state, in the order of the files by their first times.
    groups : tuple of Group
        The same states by file and layout.
    unfinished : tuple of str
        Files whose last state is not whole; it is left out.
    missing : tuple of str
        Numbers between two files, as ``first to last``.
    late : int
        Number of the first state, where it is not 1; else 0.
    damage : str
        Where records are lost or out of place, so that no state can be trusted; empty if nowhere.
    """

    def __init__(self, branch: str, family: Sequence[Lsda]) -> None:
        visited = [file for file in family if file.visits[branch].numbers]
        files = sorted(visited, key=lambda file: _start(file, branch))
        cut = [_is_unfinished(file, branch) for file in files]
        self.unfinished = tuple(file.source for file, last in zip(files, cut, strict=True) if last)
        self.damage = ""
        numbers: Indices = np.empty(0, dtype=np.int64)
        starts: Indices = np.empty(0, dtype=np.int64)
        kinds: NDArray[np.int32] = np.empty(0, dtype=np.int32)
        layouts: list[tuple[Lsda, DirectoryLayout]] = []
        for file in family:
            if file.odd[branch]:
                self.damage = f"{file.source}: {branch} has {file.odd[branch][0]!r}, which is not a state"
        for file, last in zip(files, cut, strict=True):
            visits = file.visits[branch]
            whole = slice(len(visits.numbers) - last)
            here = np.array(visits.numbers[whole])
            if (np.diff(here) > 1).any():
                hole = int(np.argmax(np.diff(here) > 1))
                self.damage = f"{file.source}: {branch} goes from state {here[hole]} to {here[hole + 1]}"
            used = [file.layouts[kind] for kind in set(visits.layouts[whole])]
            if doubled := sorted(name for layout in used for name in layout.doubled):
                self.damage = f"{file.source}: {branch} has {doubled[0]} twice in one state"
            if (np.diff(here) < 1).any() and len({frozenset(layout.variables) for layout in used}) > 1:
                self.damage = f"{file.source}: {branch} begins a new leg whose states hold other variables"
            numbers = np.append(numbers, here)
            starts = np.append(starts, np.array(visits.starts[whole]))
            kinds = np.append(kinds, np.array(visits.layouts[whole]) + len(layouts))
            layouts += [(file, layout) for layout in file.layouts]
        self.numbers = numbers
        self.late = int(numbers[0]) if numbers.size and numbers[0] != 1 else 0
        self.groups = tuple(_groups(layouts, kinds, starts))
        holes = np.flatnonzero(np.diff(self.numbers) > 1)
        self.missing = tuple(f"{self.numbers[i] + 1} to {self.numbers[i + 1] - 1}" for i in holes)


def _start(file: Lsda, branch: str) -> float:
    """Time of the first state of a branch in a file; before all others where it has none."""
    visits = file.visits[branch]
    variable = file.layouts[visits.layouts[0]].variables.get("time")
    if variable is None or not variable.count:
        return -np.inf
    return float(file.read(np.array([visits.starts[0] + variable.offset]), variable.dtype)[0])


def _is_unfinished(file: Lsda, branch: str) -> bool:
    """Whether the file ends in a state of this branch that differs from the one before."""
    layouts = file.visits[branch].layouts
    return file.unfinished == branch and len(layouts) > 1 and layouts[-1] != layouts[-2]


def _groups(
    layouts: Sequence[tuple[Lsda, DirectoryLayout]], kinds: NDArray[np.int32], starts: Indices
) -> Iterator[Group]:
    """States by layout; ``kinds`` says which of ``layouts`` each one has."""
    order = np.argsort(kinds, kind="stable")
    cuts = np.flatnonzero(np.diff(kinds[order])) + 1
    for rows in np.split(order, cuts) if order.size else ():
        file, layout = layouts[kinds[rows[0]]]
        yield Group(file, layout, rows, starts[rows])
