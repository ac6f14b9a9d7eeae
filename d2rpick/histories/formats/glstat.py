"""Read LS-DYNA's glstat: one block of ``label....... value`` lines per state, for the whole model.

A label occupies columns 2-32, padded with dots; its value is right-justified in columns 33-46. Complete labels are
compared, because ``eroded internal energy`` ends with ``internal energy``. A block begins with its ``time....`` line;
the line before, which names the element that controls the time step, has too many forms to be recognised reliably.
"""

from __future__ import annotations

import re
from contextlib import suppress
from typing import TYPE_CHECKING, Final

from d2rpick.base.errors import FormatError
from d2rpick.histories.formats.blocks import (
    UNSURE,
    BlockLayout,
    Grammar,
    make_head,
    read_head_of_listing,
)
from d2rpick.histories.formats.fixed_text import Blocks
from d2rpick.histories.history import Samples, freeze

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from d2rpick.histories.content import Bytes, Content
    from d2rpick.histories.names import Selection
    from d2rpick.histories.source import Source

_TIME: Final = "time"
_ENERGY: Final = "internal energy"
# Label of the spring energy, which is read in advance because it is always needed.
_SPRINGS: Final = "spring and damper energy"
_START: Final = b" time".ljust(32, b".")
# Number of bytes at the start of a file that contain the header and the first state.
_NEAR: Final = 4096
_WIDTH: Final = 14
_CONTROL: Final = b"\n dt of cycle"
# Last line of a state in all known glstat files; mass scaling may add lines after it.
_LAST: Final = "time per zone cycle.(nanosec)"
_LINE: Final = re.compile(rb"^ ([A-Za-z][^=\r\n]{29}\.)([^\r\n]*)\r?$", re.MULTILINE)
# Pattern of a value. Each rigid wall has its own line, in which the number of the wall follows the value.
_VALUE: Final = rb".{14}(?: +(wall# *\d+))?(?=[ \t]|$)"

# Pattern of variable text in other lines: numbers, and the element that controls the time step.
_CHANGING: Final = re.compile(
    rb" {0,12}[+-]?\d[\d+-]*|(?<= is controlled by )[^\r\n]{1,40}"
)


def recognises(head: bytes) -> bool:
    """Return True if ``head``, the start of a file, looks like a glstat; a header without states is sufficient."""
    if b"\n" + _START in head or head.startswith(_START):
        return True
    _, version, begin = read_head_of_listing(head)
    states = head[begin:].strip()
    return bool(version) and (not states or states.startswith(_CONTROL.strip()))


def open_legs(sources: Sequence[Source], selection: Selection) -> list[Glstat]:
    """Open each file as a restart segment of the run. An incomplete last state must contain the selected lines."""
    return [
        Glstat(source.data, source.name, selection.energy or (_ENERGY,))
        for source in sources
    ]


class Glstat(Blocks):
    """One glstat file, as a ``Database`` without parts.

    If the file ends within the last state, this state is used if it has the lines that are ``needed``. Raises
    FormatError if there is neither a header nor a state, or if a time is not a number.
    """

    format, digits = "glstat", 6
    no_parts = "a glstat has no parts; add the matsum of the run"

    def __init__(
        self, data: bytes | Content, source: str, needed: Sequence[str] = ()
    ) -> None:
        springs = [_SPRINGS] if _SPRINGS.encode() in data[:_NEAR] else []
        super().__init__(data, source, _GRAMMAR, (_TIME, _ENERGY, *springs))
        self.channels = self._names()
        names = [_TIME]
        # A missing line is reported later, when its values are requested.
        with suppress(FormatError):
            names += [self.find(name) for name in needed or self.channels]
            self.admit_rest(names)
        self.refuse_foreign()
        if self.complete and _CONTROL in data[self.tail :]:
            self.complete = False
            self.notes += ("the file ends before the time of its next state",)
        if not self.version:
            self.notes += (
                "the file has no header; everything before its first time line was left out",
            )
        # False for each line that some states lack although others have it.
        self._even = True
        self._columns = self._pass_over([*names, *springs], [_TIME])
        self.time = self._columns[_TIME]

    def channel(self, name: str) -> Samples:
        """Return the values of the line ``name``, shape (n,); raise FormatError unless every state has it once."""
        if name not in self._columns:
            wanted = [name]
            # A request for a further line is usually followed by requests for more lines.
            if self._even:
                names = dict.fromkeys((*self.channels, name))
                wanted = [label for label in names if label not in self._columns]
            self._columns |= self._pass_over(wanted, [name])
        return self._columns[name]

    def _pass_over(
        self, names: list[str], needed_names: list[str]
    ) -> dict[str, Samples]:
        """Read lines in one pass; if a state lacks one of them, read only the required lines."""
        try:
            columns = self.numbers(names)
        except FormatError:
            self._even, names = False, needed_names
            columns = self.numbers(needed_names)
        return dict(zip(names, map(freeze, columns.T), strict=True))

    def _names(self) -> tuple[str, ...]:
        """Return the labels of all lines with values, except the time."""
        layouts = {(run.example, run.stride) for run in self}
        if not layouts and self.rest:
            layouts = {(self.rest.example, self.rest.stride)}
        names = {
            str(name): None
            for layout in sorted(layouts)
            for name in self.layout(*layout).fields
        }
        return tuple(name for name in names if name != _TIME)


def _describe_glstat_block(
    block: bytes, lines: Sequence[re.Match[bytes]], literal: Bytes
) -> tuple[dict[str, int], str]:
    """Return the offsets of a block's values by label, and its last label. UNSURE marks a truncated value."""
    fields: dict[str, int] = {}
    name, end, is_mixed = "", 0, False
    for line in lines:
        # A truncated line inside the block may belong to another state.
        is_mixed |= name in fields and b"..." in block[end : line.start()]
        name = line[1].rstrip(b".").rstrip().decode("latin-1")
        end = line.end()
        value = re.match(_VALUE, line[2])
        if value is None:
            fields[name] = UNSURE
            continue
        if value[1]:
            name += " " + " ".join(value[1].decode().split())
        literal[line.start(2) : line.start(2) + _WIDTH] = 0
        is_mixed |= name in fields
        fields[name] = line.start(2)
    if is_mixed:  # The block may mix lines of two states.
        fields = {
            name: offset if name == _TIME else UNSURE for name, offset in fields.items()
        }
    return fields, name


def _has_last_line(layout: BlockLayout) -> bool:
    """Return True if a block contains the line that ends a state."""
    return _LAST in layout.fields


_GRAMMAR: Final = Grammar(
    _START,
    _LINE,
    _describe_glstat_block,
    _CHANGING,
    _TIME,
    _has_last_line,
    width=_WIDTH,
    decimals=5,
    compare_all=True,
)


def write(title: str, lines: Mapping[str, Samples]) -> bytes:
    """Write a glstat: blocks of ``label....... value`` with six significant digits, ``time`` first; all (n,)."""
    states = zip(*(values.tolist() for values in lines.values()), strict=True)
    blocks = (
        f" dt of cycle{cycle:8d} is controlled by solid              1 of part         1\n\n"
        + "".join(
            f" {label:.<31}{value:14.5E}\n"
            for label, value in zip(lines, values, strict=True)
        )
        for cycle, values in enumerate(states, start=1)
    )
    return (make_head(title, "glstat") + "\n\n" + "\n\n".join(blocks)).encode()
