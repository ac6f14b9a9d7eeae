"""Read one branch of LS-DYNA's binout: its states in all files of a family, grouped by file and layout.

A column is collected with a few array operations, regardless of the number of states. If states are inconsistent (a
variable or a part is missing in a state, or a count changes), the branch is refused with the number of the state;
values are never shifted.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from d2rpick.base.caching import cached_property
from d2rpick.base.data_classes import dataclass
from d2rpick.base.errors import FormatError, list_names
from d2rpick.histories.database import Database
from d2rpick.histories.names import clean_text

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator, Sequence
    from typing import Any

    from numpy.typing import NDArray

    from d2rpick.histories.formats.lsda import DirectoryLayout, Lsda, Variable
    from d2rpick.histories.history import Samples

    Indices = NDArray[np.int64]

# Number of values that are read at a time, which limits the memory for the index arrays.
_CHUNK: Final = 1 << 17


@dataclass(frozen=True)
class Group:
    """States in one file that share a layout, with their row numbers in the columns and their byte offsets."""

    file: Lsda
    layout: DirectoryLayout
    rows: Indices
    starts: Indices

    def chunks(self, width: int) -> Iterator[Group]:
        """Split the group into subgroups small enough to read ``width`` values per state in one read."""
        length = max(1, _CHUNK // max(1, width))
        for begin in range(0, self.rows.size, length):
            part = slice(begin, begin + length)
            yield Group(self.file, self.layout, self.rows[part], self.starts[part])

    def values(self, variable: Variable, indices: Indices) -> NDArray[Any]:
        """Return the values at the ``indices`` of a list variable, shape (states, indices), as integers or doubles."""
        positions = (
            self.starts[:, None] + variable.offset + variable.dtype.itemsize * indices
        )
        values = self.file.read(positions, variable.dtype)
        if variable.dtype.kind != "f":
            return values
        # A NaN raises an error later, but only if the value is used.
        with np.errstate(invalid="ignore"):
            return values.astype(np.float64)


def _read_start(file: Lsda, branch: str) -> float:
    """Return the time of the first state of a branch in a file, or -inf if this state contains no time."""
    _, start, layout = file.visits[branch][:3]
    variable = file.layouts[layout].variables.get("time")
    if variable is None or not variable.count:
        return -np.inf
    return float(file.read(np.array([start + variable.offset]), variable.dtype)[0])


def _is_unfinished(file: Lsda, branch: str) -> bool:
    """Return True if the layout of the last state of a branch in a file differs from that of the state before it."""
    layouts = file.visits[branch][2::3][-2:]
    return file.unfinished == branch and len({*layouts}) > 1


def _find_damages(
    numbers: Indices, layouts: Sequence[DirectoryLayout], where: str
) -> Iterator[str]:
    """Yield descriptions of the evidence that records of a file are lost or misplaced."""
    steps = np.diff(numbers)
    if (steps > 1).any():
        hole = int(np.argmax(steps > 1))
        yield f"{where} goes from state {numbers[hole]} to {numbers[hole + 1]}"
    if doubled := sorted(name for layout in layouts for name in layout.doubled):
        yield f"{where} has {doubled[0]} twice in one state"
    variable_sets = {frozenset(layout.variables) for layout in layouts}
    if (steps < 1).any() and len(variable_sets) > 1:
        yield f"{where} begins a new restart segment whose states have other variables"


def _group_states(
    layouts: Sequence[tuple[Lsda, DirectoryLayout]], kinds: Indices, starts: Indices
) -> Iterator[Group]:
    """Yield the states grouped by layout; ``kinds`` contains the indices of their layouts in ``layouts``."""
    order = np.argsort(kinds, kind="stable")
    cuts = np.flatnonzero(np.diff(kinds[order])) + 1
    for rows in np.split(order, cuts) if order.size else ():
        file, layout = layouts[kinds[rows[0]]]
        yield Group(file, layout, rows, starts[rows])


class Branch(Database):
    """The states of one branch in all files of a family; the object is falsy if no file contains the branch.

    A solver numbers its states consecutively. If the first number in a file is too high, a file of the family is
    missing. A repeated number is the start of a newer restart segment, which contains the same variables, either for
    the same states again or for the next ones; their times show which. A number missing inside a file, a name that
    occurs twice in a state, or a restart segment with other variables show that records are lost or misplaced, so that
    a state may be a mixture of two.

    Parameters
    ----------
    name : str
    files : sequence of Lsda
        The family, in its order.
    by_part : bool
        True if variables are lists with one value for each part.

    Attributes
    ----------
    damage : str
        Where records are lost or misplaced, so that no state can be trusted; empty if there is no damage.
    """

    def __init__(self, name: str, files: Sequence[Lsda], *, by_part: bool) -> None:
        self.name, self._by_part, self._files = name, by_part, files
        visited = sorted(
            (file for file in files if file.visits[name]),
            key=lambda file: _read_start(file, name),
        )
        # Names of the files whose last state is incomplete and therefore not used.
        self._unfinished = [
            file.source for file in visited if _is_unfinished(file, name)
        ]
        damages = [
            f"{file.source}: {name} contains {file.odd[name][0]!r}, which is not a state"
            for file in files
            if file.odd[name]
        ]
        numbers, starts, kinds = np.empty((3, 0), dtype=np.int64)
        layouts: list[tuple[Lsda, DirectoryLayout]] = []
        for file in visited:
            states = file.states(name)
            if file.source in self._unfinished:
                states = states[:-1]
            file_numbers, file_starts, file_kinds = states.T
            used = [file.layouts[kind] for kind in {*file_kinds.tolist()}]
            damages += _find_damages(file_numbers, used, f"{file.source}: {name}")
            numbers = np.append(numbers, file_numbers)
            starts = np.append(starts, file_starts)
            kinds = np.append(kinds, file_kinds + len(layouts))
            layouts += [(file, layout) for layout in file.layouts]
        self.damage = damages[-1] if damages else ""
        self._numbers = numbers
        self._groups = tuple(_group_states(layouts, kinds, starts))
        self._variables = [group.layout.variables for group in self._groups]
        holes = np.flatnonzero(np.diff(numbers) > 1)
        self._missing = tuple(
            f"{numbers[i] + 1} to {numbers[i + 1] - 1}" for i in holes
        )
        self.source = (
            f"{', '.join(file.source for file in files if name in file.names)}: {name}"
        )
        self.complete = not (self._missing or self._unfinished or self.damage)
        self.notes = self._remarks()

    def __bool__(self) -> bool:
        return any(self.name.split("/")[0] in file.names for file in self._files)

    def _remarks(self) -> tuple[str, ...]:
        """Return notes on missing or omitted states, and on variables that are missing in some states."""
        notes = [
            f"{name}: the last state of {self.name} is not whole and was left out"
            for name in self._unfinished
        ]
        if self.damage:
            notes.append(f"{self.damage}; records are lost or out of place")
        first = int(self._numbers[0]) if self._numbers.size else 1
        if first != 1:
            notes.append(
                f"{self.source} begins with state {first}, not 1; is a file of the family missing or damaged?"
            )
        if self._missing:
            holes = list_names(self._missing, most=3)
            notes.append(
                f"{self.source} lacks the states {holes}; is a file of the family missing?"
            )
        names = set().union(*self._variables)
        common = {
            name
            for name in names
            if all(name in variables for variables in self._variables)
        }
        if late := list_names(sorted(names - common)):
            notes.append(f"{self.source} has {late} in some states only")
        kinds = {
            name: {variables[name].dtype.kind for variables in self._variables}
            for name in common
        }
        if changing := list_names(
            sorted(name for name in common if len(kinds[name]) > 1)
        ):
            notes.append(
                f"{self.source} has {changing} of another type in some states: damaged there, and left out"
            )
        if self and not self._numbers.size:
            notes.append(f"{self.source} has no state yet")
        return tuple(notes)

    def has_variables(self, names: Collection[str]) -> bool:
        """Return True if the branch has states and all of them contain all of these variables."""
        return bool(self._variables) and all(
            variables.keys() >= set(names) for variables in self._variables
        )

    @property
    def scalars(self) -> tuple[str, ...]:
        """Floating-point variables with one value per state, in file order."""
        first = self._variables[0] if self._variables else {}
        return tuple(
            name
            for name in first
            if all(
                _is_scalar_variable(variables.get(name))
                for variables in self._variables
            )
        )

    @property
    def time_width(self) -> int:
        """Smallest number of bytes of the time in any state; integer times raise an error when they are read."""
        widths = [
            variables["time"].dtype.itemsize
            for variables in self._variables
            if "time" in variables and variables["time"].dtype.kind == "f"
        ]
        return min(widths, default=8)

    @cached_property
    def legend(self) -> dict[int, str]:
        """Titles of the parts, keyed by part id."""
        titles: dict[int, str] = {}
        for file, start, layout in self._metadata:
            ids = _read_integers(file, start, layout, "legend_ids")
            legend = layout.variables.get("legend")
            if legend is None or not ids.size or legend.count % ids.size:
                continue  # The titles cannot be separated, because they vary in length.
            raw = file.raw(start, legend)
            width = legend.count // ids.size
            for i, id_ in enumerate(ids.tolist()):
                titles[id_] = clean_text(raw[i * width : (i + 1) * width])
        return titles

    @cached_property
    def part_ids(self) -> tuple[int, ...]:
        """Ids of all parts that occur in any state, in the order of the id lists."""
        # A dictionary is used as a set that keeps its order.
        part_ids: dict[int, None] = {}
        for group in self._groups:
            for part in group.chunks(max(self._list_lengths(group), default=1)):
                listed = self.ids_of(part)
                changed = np.append(True, (np.diff(listed, axis=0) != 0).any(axis=1))
                part_ids.update(dict.fromkeys(listed[changed].ravel().tolist()))
        return tuple(part_ids)

    def text(self, name: str) -> str:
        """Return the metadata text with this name; empty if there is no such text."""
        for file, start, layout in self._metadata:
            if name in layout.variables:
                return clean_text(file.raw(start, layout.variables[name]))
        return ""

    @cached_property
    def time(self) -> Samples:
        """Times of the states, shape (n,) [time]."""
        return self.channel("time")

    def channel(self, name: str) -> Samples:
        """Return a variable with one value per state, shape (n,)."""
        column = np.empty(self._numbers.size)
        for group, variable in self.checked(name):
            if variable.count != 1:
                raise self.refused(
                    group,
                    f"one {name} was expected, not {variable.count}; ask for another",
                )
            for part in group.chunks(1):
                column[part.rows] = part.values(
                    variable, np.zeros((1, 1), dtype=np.int64)
                )[:, 0]
        return column

    def part_channel(self, quantity: str, ids: Sequence[int]) -> Samples:
        """Return a variable of the given parts, shape (n, len(ids))."""
        columns = np.empty((self._numbers.size, len(ids)))
        for group, variable in self.checked(quantity):
            for part in group.chunks(max(variable.count, len(ids))):
                listed = self.ids_of(part)
                if listed.shape[1] != variable.count:
                    counts = f"{variable.count} values of {quantity} for {listed.shape[1]} parts"
                    raise self.refused(part, f"{counts}; they cannot be told apart")
                columns[part.rows] = 0.0
                if ids:
                    indices_of_parts = [self._places(part, listed, id_) for id_ in ids]
                    indices = np.stack(indices_of_parts, axis=1)
                    columns[part.rows] = part.values(variable, indices)
        return columns

    def checked(self, name: str) -> Iterator[tuple[Group, Variable]]:
        """Yield each group of states with its variable of this name.

        If the number of values fits neither the parts nor the other states, records of two states were merged, and no
        value of the state can be trusted.
        """
        for group in self._groups:
            variables = group.layout.variables
            if name not in variables:
                raise self.refused(
                    group,
                    f"no {name}, only {list_names(list(variables), most=40)}; ask for one of these",
                )
            if variables[name].dtype.kind != "f":
                raise self.refused(
                    group,
                    f"{name} is stored as {variables[name].dtype}, not as floating point",
                )
            for checked_name, variable in variables.items():
                fitting = self._fitting(group, checked_name)
                if variable.count not in fitting:
                    counts = f"{variable.count} values of {checked_name} where {list_names(sorted(fitting))} would fit"
                    raise self.refused(group, f"{counts}; the file is damaged there")
            yield group, variables[name]

    def _fitting(self, group: Group, name: str) -> set[int]:
        """Return the plausible lengths of a variable: one, one per part, or that of the first state."""
        if self._by_part:
            return {1, *self._list_lengths(group)}
        return {self._variables[0].get(name, group.layout.variables[name]).count}

    def _list_lengths(self, group: Group) -> set[int]:
        """Return the possible numbers of parts in a group, from its id list or from the lists in the metadata."""
        ids_of_states = group.layout.variables.get("ids")
        if ids_of_states:
            return {ids_of_states.count}
        return {ids.size for _, _, ids in self._id_lists}

    def refused(self, group: Group, why: str, row: int = 0) -> FormatError:
        """Return the error for a value from an unreliable state."""
        return FormatError(
            f"{self.source} state {self._numbers[group.rows[row]]}: {why}"
        )

    @cached_property
    def _metadata(self) -> list[tuple[Lsda, int, DirectoryLayout]]:
        """File, start [byte] and layout of each metadata directory of the branch."""
        return [
            (file, start, file.layouts[layout])
            for file in self._files
            for start, layout in file.metadata[self.name]
        ]

    @cached_property
    def _id_lists(self) -> list[tuple[int, int, Indices]]:
        """The part id lists in the metadata, each with its file number and byte offset."""
        lists = (
            (file, at, _read_integers(file, at, layout, "ids"))
            for file, at, layout in self._metadata
        )
        return [
            (self._files.index(file), at, ids) for file, at, ids in lists if ids.size
        ]

    def ids_of(self, group: Group) -> Indices:
        """Return the part ids of a group's states, shape (states, parts), or (1, parts) if they are all the same."""
        ids_of_states = group.layout.variables.get("ids")
        if ids_of_states and ids_of_states.dtype.kind in "iu":
            indices = np.arange(ids_of_states.count)[None, :]
            return group.values(ids_of_states, indices).astype(np.int64)
        if not self._id_lists:
            raise FormatError(
                f"{self.source} has no part ids in its metadata; the values cannot be assigned to parts"
            )
        index = self._files.index(group.file)
        lists_in_earlier_files = sum(1 for file, _, _ in self._id_lists if file < index)
        list_starts = np.array(
            [start for file, start, _ in self._id_lists if file == index],
            dtype=np.int64,
        )
        # A state uses the last list before it. In a file of one MPI rank, the list may follow the first states.
        before_state = np.searchsorted(list_starts, group.starts)
        in_force = np.maximum(lists_in_earlier_files + before_state - 1, 0)
        lists = {
            int(i): self._id_lists[i][2] for i in np.flatnonzero(np.bincount(in_force))
        }
        if len({entry.size for entry in lists.values()}) > 1:
            raise self.refused(
                group,
                "the number of parts changes here or later, but not the number of values",
            )
        if len(lists) == 1:
            ids: Indices = next(iter(lists.values()))
            return ids[None, :]
        return np.stack([lists[i] for i in in_force.tolist()])

    def _places(self, group: Group, listed: Indices, id_: int) -> Indices:
        """Return the index of a part in the id list of each state, shape (states,) or (1,)."""
        is_part = listed == id_
        times = is_part.sum(axis=1)
        if (times != 1).any():
            row = int(np.argmax(times != 1))
            hint = f"there are {list_names(self.part_ids)}"
            if id_ in self.part_ids:
                hint = "it is there in some states only"
            raise self.refused(
                group, f"part {id_} is listed {times[row]} times, not once; {hint}", row
            )
        return np.asarray(is_part.argmax(axis=1))


def _is_scalar_variable(variable: Variable | None) -> bool:
    """Return True if a variable is a single floating-point value."""
    return variable is not None and variable.count == 1 and variable.dtype.kind == "f"


def _read_integers(
    file: Lsda, start: int, layout: DirectoryLayout, name: str
) -> Indices:
    """Return the list of integers with this name in a directory; empty if there is none."""
    variable = layout.variables.get(name)
    if variable is None or variable.dtype.kind not in "iu":
        return np.empty(0, dtype=np.int64)
    positions = (
        start + variable.offset + variable.dtype.itemsize * np.arange(variable.count)
    )
    return file.read(positions, variable.dtype).astype(np.int64)
