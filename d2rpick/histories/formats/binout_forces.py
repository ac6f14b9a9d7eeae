"""Read the force branches of LS-DYNA's binout: rcforc (contacts) and rwforc (rigid walls)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from d2rpick.histories.contact_forces import ContactForce
from d2rpick.histories.formats.binout_branch import Branch

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from numpy.typing import NDArray

    from d2rpick.histories.formats.lsda import Lsda
    from d2rpick.histories.history import Samples

    Indices = NDArray[np.int64]

# Branches that contain forces, keyed by name, with the type of object that exerts the force.
FORCES: Final = {"rcforc": "contact", "rwforc/forces": "rigid wall"}


def has_forces(files: Sequence[Lsda]) -> bool:
    """Return True if any state of a family contains forces."""
    return any(ForceBranch(name, files, by_part=True).writes_forces for name in FORCES)


def read_binout_forces(files: Sequence[Lsda]) -> tuple[ContactForce, ...]:
    """Return the forces of all contacts and rigid walls of a family; raise FormatError if they are ambiguous."""
    branches = [ForceBranch(name, files, by_part=True) for name in FORCES]
    return tuple(
        force
        for branch in branches
        if branch.writes_forces
        for force in _join_sides(branch)
    )


class ForceBranch(Branch):
    """A branch whose variables are lists, with one value per side of each contact, or one per wall."""

    @property
    def writes_forces(self) -> bool:
        """True if the states contain forces; in a run without contacts, they contain only a time."""
        return bool(self._variables) and all(
            "x_force" in variables for variables in self._variables
        )

    def of_each(self, name: str) -> tuple[Indices, Samples]:
        """Return the listed ids (one for each side of a contact), and the values of one variable, shape (n, ids)."""
        listed: Indices | None = None
        columns: list[tuple[Indices, Samples]] = []
        for group, variable in self.checked(name):
            ids = self.ids_of(group)
            first = ids[0] if listed is None else listed
            if (
                variable.count != ids.shape[1]
                or ids.shape[1] != first.size
                or (ids != first).any()
            ):
                raise self.refused(
                    group,
                    f"other ids than before, so the values of {name} cannot be assigned",
                )
            listed = first
            values = group.values(variable, np.arange(variable.count)[None, :])
            columns.append((group.rows, values))
        if listed is None:
            return np.empty(0, np.int64), np.empty((self.time.size, 0))
        forces = np.empty((self.time.size, listed.size))
        for rows, values in columns:
            forces[rows] = values
        return listed, forces


def _join_sides(branch: ForceBranch) -> Iterator[ContactForce]:
    """Yield one force per contact, that on its more loaded side; the other side has the opposite force or none."""
    ids, first = branch.of_each("x_force")
    forces = np.stack(
        [first, *(branch.of_each(f"{axis}_force")[1] for axis in "yz")], axis=2
    )
    for id_ in dict.fromkeys(ids.tolist()):
        sides = forces[:, ids == id_]
        strongest = int(np.abs(sides).sum(axis=(0, 2)).argmax())
        title = branch.legend.get(id_, "")
        name = f"{FORCES[branch.name]} {id_}{f' {title!r}' if title else ''}"
        yield ContactForce.of_forces(name, branch.time, sides[:, strongest])
