"""Read LS-DYNA's binout: the branches glstat (whole model) and matsum (parts) of one restart segment of a run.

A branch has a directory ``metadata`` (title, version, part ids, part titles) and one directory per state, ``d000001``
and so on, with variables such as ``internal_energy``: one value in glstat, one value per part in matsum. A run may
distribute its branches over several files and continue a file in ``%001``, ``%002``.
"""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, Final

import numpy as np

from d2rpick.base.caching import cached_property
from d2rpick.base.errors import FormatError, list_names
from d2rpick.histories.database import DIGITS, Database
from d2rpick.histories.formats.binout_branch import Branch
from d2rpick.histories.formats.binout_forces import (
    FORCES,
    has_forces,
    read_binout_forces,
)
from d2rpick.histories.formats.lsda import Lsda, recognises
from d2rpick.histories.names import Part, Selection

if TYPE_CHECKING:
    from collections.abc import Sequence

    from d2rpick.histories.contact_forces import ContactForce
    from d2rpick.histories.content import Content
    from d2rpick.histories.history import Samples
    from d2rpick.histories.resuming import ResumePoint
    from d2rpick.histories.source import Source

__all__ = ["Binout", "open_legs", "recognises"]

_BRANCHES: Final = ("glstat", "matsum")
_NODES: Final = "nodout"
_DISPLACEMENTS: Final = ("x_displacement", "y_displacement", "z_displacement")


def open_legs(sources: Sequence[Source], _: Selection) -> list[Binout]:
    """Open all files in a folder as one restart segment, because a solver writes each binout into one folder."""
    folders: dict[str, list[tuple[str, bytes | Content]]] = {}
    for source in sources:
        folder = os.path.dirname(os.path.normpath(source.name))  # noqa: PTH120  pathlib would slow down start-up
        folders.setdefault(folder, []).append((source.name, source.data))
    return [Binout(family) for family in folders.values()]


class Binout(Database):
    """All binout files of one restart segment, in family order, read as one `Database`.

    Raises FormatError if a file is not a binout, or if none of them has glstat, matsum or contact forces.
    """

    format = "binout"

    def __init__(self, files: Sequence[tuple[str, bytes | Content]]) -> None:
        self._files = [
            Lsda(content, name, (*_BRANCHES, _NODES, *FORCES))
            for name, content in files
        ]
        self.source = ", ".join(name for name, _ in files)
        whole, parts = self._branches = [
            Branch(name, self._files, by_part=name == "matsum") for name in _BRANCHES
        ]
        head = whole or parts
        self.only_forces = not head and has_forces(self._files)
        if not head and not self.only_forces:
            raise FormatError(self._without("glstat or matsum"))
        revision = head.text("revision")
        names = (
            head.text("version"),
            f"rev {revision}" if revision else "",
            head.text("build_id"),
        )
        self.version = " ".join(name for name in names if name)
        self.title = whole.text("title") or parts.text("title")
        self.digits = DIGITS[min(branch.time_width for branch in self._branches)]
        stops = [
            f"{file.source}: {file.stop}; the records before it were read"
            for file in self._files
            if file.stop
        ]
        self.complete = not stops and whole.complete and parts.complete
        self.notes = (*stops, *whole.notes, *parts.notes)
        self.channels = tuple(name for name in whole.scalars if name != "time")

    @cached_property
    def parts(self) -> tuple[Part, ...]:  # type: ignore[override]  # a property overrides a field
        """The parts in the matsum branch, in the order of the first id list."""
        _, branch = self._branches
        return tuple(
            Part(number, branch.legend.get(number, "")) for number in branch.part_ids
        )

    @cached_property
    def contact_forces(self) -> tuple[ContactForce, ...]:
        """Forces of the contacts (one force for both sides of a contact) and of the rigid walls."""
        return read_binout_forces(self._files)

    @cached_property
    def _nodes(self) -> Branch:
        """The nodout branch, whose variables are lists with one value per node."""
        return Branch(_NODES, self._files, by_part=True)

    @cached_property
    def node_ids(self) -> tuple[int, ...]:  # type: ignore[override]  # a property overrides a field
        """Numbers of the nodes with displacements in the nodout branch; none if its records are lost or damaged."""
        if self._nodes.damage or not self._nodes.has_variables(_DISPLACEMENTS):
            return ()
        return self._nodes.part_ids

    @cached_property
    def node_time(self) -> Samples:
        """Times of the states in the nodout branch, shape (k,) [time]."""
        return self._nodes.time

    def node_displacements(self, ids: Sequence[int]) -> Samples:
        """Return the displacements of the given nodes since the start of the run, shape (k, len(ids), 3)."""
        components = [self._nodes.part_channel(name, ids) for name in _DISPLACEMENTS]
        return np.stack(components, axis=2)

    def find_resume_points(self) -> dict[str, ResumePoint]:
        """Return the offset from which each file can be read further: the second-to-last state of both branches."""
        return {file.source: file.find_resume_point(_BRANCHES) for file in self._files}

    def branch(self, name: str) -> Branch:
        """Return a branch by name; raise FormatError if the branch is missing, or if records of any branch are lost."""
        for branch in self._branches:
            if branch and branch.damage:
                raise FormatError(
                    f"{branch.damage}; records are lost or out of place, copy the file again"
                )
        for branch in self._branches:
            if branch and branch.name == name:
                return branch
        raise FormatError(self._without(name))

    def _without(self, name: str) -> str:
        """Return the message that no file of the restart segment contains a branch of this name."""
        names = sorted(set().union(*(file.names for file in self._files)))
        return (
            f"{self.source}: no {name} in it, but {list_names(names) or 'nothing'}; "
            "name the binout of the run that contains it (binout0000, binout0001, ...) or let the run write it"
        )
