"""LS-DYNA binout: the branches glstat (whole model) and matsum (parts) of one leg of a run.

A branch has a directory ``metadata`` (title, version, part ids, part titles) and one directory per state,
``d000001`` and so on, of variables such as ``internal_energy``: one value in glstat, one per part in matsum.
A run may spread its branches over several files and continue a file in ``%001``, ``%002``.
"""

from __future__ import annotations

from functools import cached_property
from pathlib import PurePath
from typing import TYPE_CHECKING, Final

from d2rpick.errors import FormatError, listing
from d2rpick.histories.database import DIGITS, SolverFile
from d2rpick.histories.formats.binout_branch import Branch
from d2rpick.histories.formats.lsda import Lsda, recognises
from d2rpick.histories.names import Part

if TYPE_CHECKING:
    from collections.abc import Sequence

    from d2rpick.histories.content import Content
    from d2rpick.histories.history import Samples
    from d2rpick.histories.names import Selection
    from d2rpick.histories.source import Source

__all__ = ["Binout", "open_legs", "recognises"]

_GLOBAL: Final = "glstat"
_PARTS: Final = "matsum"


def open_legs(sources: Sequence[Source], _: Selection) -> list[Binout]:
    """Open the files of each folder as one leg: there a solver continues a binout and spreads its branches."""
    folders: dict[str, list[tuple[str, bytes | Content]]] = {}
    for source in sources:
        folders.setdefault(str(PurePath(source.name).parent), []).append((source.name, source.data))
    return [Binout(family) for family in folders.values()]


class Binout(SolverFile):
    """All binout files of one leg, read as one `Database`.

    Parameters
    ----------
    files : sequence of (str, bytes or Content)
        Name and content of each file, those of a family in their order.

    Raises
    ------
    FormatError
        If a file is no binout, or none of them holds glstat or matsum.
    """

    format = "binout"

    def __init__(self, files: Sequence[tuple[str, bytes | Content]]) -> None:
        self._files = [Lsda(content, name, (_GLOBAL, _PARTS)) for name, content in files]
        self.source = ", ".join(name for name, _ in files)
        self._glstat = Branch(_GLOBAL, self._files, by_part=False)
        self._matsum = Branch(_PARTS, self._files, by_part=True)
        if not self._glstat and not self._matsum:
            raise FormatError(self._without(f"{_GLOBAL} or {_PARTS}"))

    @cached_property
    def version(self) -> str:
        """Solver, release, revision and build, as far as they are given."""
        head = self._glstat or self._matsum
        revision = head.text("revision")
        names = (head.text("version"), f"rev {revision}" if revision else "", head.text("build_id"))
        return " ".join(name for name in names if name)

    @cached_property
    def title(self) -> str:
        """Title of the run."""
        return self._glstat.text("title") or self._matsum.text("title")

    @cached_property
    def digits(self) -> int:  # type: ignore[override]
        """Significant digits of the numbers: 7 in single, 17 in double precision."""
        widths = [branch.time_width for branch in (self._glstat, self._matsum) if branch]
        return DIGITS[min(widths, default=8)]

    @cached_property
    def complete(self) -> bool:
        """Whether every file ends behind a whole state and no state is missing in between."""
        return not self._stops and self._glstat.complete and self._matsum.complete

    @cached_property
    def notes(self) -> tuple[str, ...]:
        """What was left out, state by state."""
        return (*self._stops, *self._glstat.notes, *self._matsum.notes)

    @cached_property
    def channels(self) -> tuple[str, ...]:  # type: ignore[override]  # as a property
        """Variables of glstat that every state holds with one value."""
        return tuple(name for name in self._glstat.scalars if name != "time")

    @cached_property
    def parts(self) -> tuple[Part, ...]:
        """Parts of matsum, in the order of its first list of ids."""
        titles = self._matsum.legend
        return tuple(Part(number, titles.get(number, "")) for number in self._matsum.part_ids)

    @cached_property
    def time(self) -> Samples:
        """Times of glstat, shape (n,) [time]."""
        return self._branch(self._glstat).channel("time")

    def channel(self, name: str) -> Samples:
        """One variable of glstat, shape (n,)."""
        return self._branch(self._glstat).channel(name)

    @property
    def part_time(self) -> Samples:
        """Return the times of matsum, shape (m,) [time]."""
        return self._branch(self._matsum).channel("time")

    def part_channel(self, quantity: str, ids: Sequence[int]) -> Samples:
        """One variable of matsum for some parts, shape (m, len(ids)).

        Raises
        ------
        FormatError
            If a state lacks the variable or one of the parts.
        """
        return self._branch(self._matsum).part_channel(quantity, ids)

    @property
    def _stops(self) -> tuple[str, ...]:
        return tuple(f"{file.source}: {file.stop}; what lies before it was read" for file in self._files if file.stop)

    def _branch(self, branch: Branch) -> Branch:
        if not branch:
            raise FormatError(self._without(branch.name))
        # Records that one branch has lost or gained may be the other's.
        if damage := self._glstat.damage or self._matsum.damage:
            raise FormatError(f"{damage}; records are lost or out of place, copy the file again")
        return branch

    def _without(self, name: str) -> str:
        there = sorted(set().union(*(file.names for file in self._files)))
        return (
            f"{self.source}: no {name} in it, but {listing(there) or 'nothing'}; "
            "name the binout of the run that holds it (binout0000, binout0001, ...) or let the run write it"
        )
