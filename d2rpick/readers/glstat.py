"""LS-DYNA glstat: one block of ``label.......   value`` lines per state, for the model as a whole.

A label stands in columns 2-32, padded with dots, its value right-justified in columns 33-46.  Labels are
taken whole: ``internal energy`` also ends ``eroded internal energy``.  A block begins at its ``time....``
line; the line before it, on what controls the time step, has too many forms to rely on.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Final, NoReturn

import numpy as np

from d2rpick.errors import FormatError
from d2rpick.readers.database import SolverFile
from d2rpick.readers.fixed_text import TWICE, Blocks, Grammar, Layout, head

if TYPE_CHECKING:
    from collections.abc import Hashable, Sequence

    from d2rpick.history import Part, Samples
    from d2rpick.readers.selection import Selection
    from d2rpick.readers.source import Content, Source

_START: Final = b" time".ljust(32, b".")
_CONTROL: Final = b"\n dt of cycle"
_LAST: Final = "time per zone cycle.(nanosec)"  # in every glstat seen; mass scaling may add lines behind it
_LINE: Final = re.compile(rb"^ ([A-Za-z][^=\r\n]{29}\.)([^\r\n]{14})([ \t][^\r\n]*)?\r?$", re.MULTILINE)


def recognises(data: bytes) -> bool:
    """Whether ``data``, the beginning of a file, looks like a glstat; a head alone does, too."""
    if b"\n" + _START in data or data.startswith(_START):
        return True
    _, version, begin = head(data)
    states = data[begin:].strip()
    return bool(version) and (not states or states.startswith(_CONTROL.strip()))


def open_legs(sources: Sequence[Source], _: Selection) -> list[Glstat]:
    """Open each file as a leg of the run."""
    return [Glstat(source.data, source.name) for source in sources]


class Glstat(SolverFile):
    """One glstat file; a ``Database`` without parts.

    FormatError if it has neither a head nor a state, or a time that is no number.
    """

    format: Final = "glstat"
    parts: tuple[Part, ...] = ()
    digits = 6

    def __init__(self, data: Content, source: str) -> None:
        self.source = source
        self.title, self.version, begin = head(data)
        self._blocks = Blocks(data, source, begin, _GRAMMAR)
        if not self.version and not self._blocks.states:
            raise FormatError(
                f"{source}:1: neither a line with 'ls-dyna' nor a whole state was found, this is no glstat; "
                "choose another input format"
            )
        self.complete, self.notes = self._blocks.complete, self._blocks.notes
        if self.complete and _CONTROL in data[self._blocks.tail :]:
            self.complete = False
            self.notes += ("the file stops before the time of its next state",)
        if not self.version:
            self.notes += ("the file has no head; what stands before its first time line was left out",)
        self.channels = self._names()
        self.time = self._blocks.numbers(["time"])[:, 0]

    @property
    def part_time(self) -> Samples:
        """Refused: a glstat knows the model as a whole only."""
        raise self._no_parts()

    def channel(self, name: str) -> Samples:
        """Values of the line ``name``, shape (n,); FormatError unless every state has a number in one such line."""
        return self._blocks.numbers([name])[:, 0]

    def part_channel(self, quantity: str, ids: Sequence[int]) -> NoReturn:  # noqa: ARG002  as a Database
        """Refused: a glstat knows the model as a whole only."""
        raise self._no_parts()

    def _no_parts(self) -> FormatError:
        return FormatError(f"{self.source}: a glstat has no parts; add the matsum of the run")

    def _names(self) -> tuple[str, ...]:
        layouts = {(run.example, run.stride) for run in self._blocks}
        names = {str(name): None for layout in sorted(layouts) for name in self._blocks.layout(*layout).fields}
        return tuple(name for name in names if name != "time")


def _describe(block: bytes) -> Layout:
    literal = np.where(np.frombuffer(block, np.uint8) == ord("\n"), np.uint8(255), np.uint8(0))
    fields: dict[Hashable, int] = {}
    name = ""
    for line in _LINE.finditer(block):
        label, _, remark = line.groups()
        name = label.rstrip(b".").rstrip().decode("latin-1")
        if remark and remark.strip():  # "wall# 1": there is a line for each wall
            name += " " + " ".join(remark.decode("latin-1").split())
        literal[line.start() : line.end()] = 255
        literal[line.start(2) : line.end(2)] = 0
        fields[name] = TWICE if name in fields else line.start(2)
    return Layout(fields, literal, last=name, broken_off=b"ls-dyna" in block)


def _is_whole(layout: Layout) -> bool:
    return _LAST in layout.fields


_GRAMMAR: Final = Grammar(_START, _describe, _is_whole, width=14, decimals=5, compare_all=True)
