"""Read LS-DYNA's matsum, which contains one block per state with three or four lines per part.

The lines of a part begin with ``mat.#=``. Numbers have 13 columns after their name and an equals sign; the names depend
on the version. A legend at the top lists the titles by part number. If a part occurs only in some states, a note names
it, and a request for it is refused, because its column would have gaps.
"""

from __future__ import annotations

import re
from collections import Counter
from functools import partial
from typing import TYPE_CHECKING, Final

from d2rpick.base.errors import FormatError
from d2rpick.base.tuples import NamedTuple
from d2rpick.histories.formats.blocks import UNSURE, BlockLayout, Grammar, make_head
from d2rpick.histories.formats.fixed_text import Blocks
from d2rpick.histories.names import Part, Selection

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from d2rpick.histories.content import Bytes, Content
    from d2rpick.histories.history import Samples
    from d2rpick.histories.source import Source

_COMPONENTS: Final[Mapping[str, str]] = {
    "internal_energy": "inten",
    "kinetic_energy": "kinen",
    "x_momentum": "x-mom",
    "y_momentum": "y-mom",
    "z_momentum": "z-mom",
    "x_rbvelocity": "x-rbv",
    "y_rbvelocity": "y-rbv",
    "z_rbvelocity": "z-rbv",
    "hourglass_energy": "hgeng",
    "eroded_internal_energy": "eroded_ie",
}

# Quantities that stand next to each other in the file and are therefore read together.
_AXES: Final = (
    "x_momentum",
    "y_momentum",
    "z_momentum",
)

_START: Final = b" time ="
_TIME: Final[tuple[int | None, str]] = (None, "time")
_MAT: Final = "mat.#"  # Text at the start of the lines of a part.
# Part number 0, printed as "mat.#=    0", which stands for lumped masses and their kinetic energy.
_LUMPED: Final = 0
# Placeholder for a part number that is damaged, or too long for its columns.
_UNREADABLE: Final = -1
# Largest part number that fits into its eight columns.
_WIDEST: Final = 99_999_999

_LEGEND: Final = re.compile(
    rb"^\{BEGIN LEGEND\}[ \r]*\n(.*?)^\{END LEGEND\}", re.MULTILINE | re.DOTALL
)
_ENTRY: Final = re.compile(
    rb"^(?=[ \d]{9}(?: {5}|\r?$)) *(\d+)(?: {5}([^\r\n]*))?\r?$", re.MULTILINE
)
_LONGEST: Final = 1 << 24  # Largest length of a legend [bytes].
_LINE: Final = re.compile(
    rb"^(?: time =| mat\.#=([^\r\n]*)| [xyz]-(?:mom|rbv)=| +hgeng=| +\+mass=)[^\r\n]*\r?$",
    re.MULTILINE,
)
_FIELD: Final = re.compile(rb" ([a-z_+-]+) ?=([^\r\n]{13}(?=[ \r\n]|\Z))?")
# A part number has 5 columns, or 8 from 100000 on; a longer number shifts the rest of the line.
_ID: Final = re.compile(
    rb"(?=[ \d]{4}\d {13}i|(?:  \d{6}| \d{7}|\d{8,18}) {10}i) *(0|[1-9]\d*) +inten="
)
# Pattern of the numbers that may differ from state to state.
_CHANGING: Final = re.compile(rb" {0,12}[+-]?\d[\d+-]*")
_OVERFLOW: Final = re.compile(rb"\*+ +inten=")


def recognises(head: bytes) -> bool:
    """Return True if ``head``, the start of a file, looks like a matsum; a legend without states is sufficient."""
    if b"\n mat.#=" in head:
        return b"\n" + _START in head
    _, legend, states = head.partition(b"\n{END LEGEND}")
    return bool(legend) and not states.strip()


def open_legs(sources: Sequence[Source], _: Selection) -> list[Matsum]:
    """Open each file as a restart segment of the run."""
    return [Matsum(source.data, source.name) for source in sources]


class Matsum(Blocks):
    """One matsum file, as a ``Database`` without whole-model channels.

    Raises FormatError if the file has neither a header nor a state, or if a time is not a number.
    """

    format, digits = "matsum", 5
    no_channels = (
        "a matsum has parts only; choose with `parts` or add the glstat of the run"
    )

    def __init__(self, data: bytes | Content, source: str) -> None:
        self._legend = _read_legend(data)
        describe = partial(_describe_matsum_block, self._legend)
        whole = partial(_has_all_parts, self._legend)
        grammar = Grammar(
            _START,
            _LINE,
            describe,
            _CHANGING,
            _TIME,
            whole,
            width=13,
            decimals=4,
            compare_all=False,
        )
        super().__init__(data, source, grammar)
        self.refuse_foreign()
        self.part_time = self.numbers([_TIME])[:, 0]
        # Columns that were read together with the requested columns.
        self._together: dict[tuple[str | int, ...], Samples] = {}
        present = self._present()
        self.parts = tuple(
            Part(id_, self._legend.get(id_, "")) for id_ in present if id_ > _LUMPED
        )
        self.notes += self._remarks(present)

    def part_channel(self, quantity: str, ids: Sequence[int]) -> Samples:
        """Return one of ``_COMPONENTS`` for the parts ``ids``, shape (n, len(ids)).

        Raises
        ------
        FormatError
            If the quantity or a part does not occur exactly once in every state.
        """
        if quantity not in _COMPONENTS:
            raise FormatError(
                f"{self.source}: no quantity {quantity!r} in a matsum, only {', '.join(_COMPONENTS)}"
            )
        part_ids = {part.id for part in self.parts}
        missing = [id_ for id_ in ids if id_ not in part_ids]
        if missing:
            problem = f"{self.source}: no part {', '.join(map(str, missing))}"
            raise FormatError(
                f"{problem}; choose from {', '.join(str(part.id) for part in self.parts) or 'none'}"
            )
        wanted: tuple[str | int, ...] = (quantity, *ids)
        if wanted not in self._together:
            # A request for one component is usually followed by requests for the others.
            together = _AXES if quantity in _AXES else (quantity,)
            names = [
                (id_, _COMPONENTS[component]) for id_ in ids for component in together
            ]
            values = self.numbers(names, anchors=[(id_, _MAT) for id_, _ in names])
            self._together = {
                (component, *ids): values[:, column :: len(together)]
                for column, component in enumerate(together)
            }
        return self._together.pop(wanted)

    def _present(self) -> Counter[int]:
        """Count the states that contain each part, in the order in which the parts occur."""
        states = Counter[int]()
        for run in self:
            names = self.layout(run.example, run.stride).fields
            ids = {
                name[0]: run.repeats
                for name in names
                if isinstance(name, tuple) and name[1] == _MAT
            }
            states.update(ids)
        return states

    def _remarks(self, present: Counter[int]) -> tuple[str, ...]:
        """Return notes on parts that are missing in some states or whose number cannot be read."""
        unseen = [id_ for id_ in self._legend if id_ not in present]
        passing = [
            id_ for id_, states in present.items() if id_ > 0 and states < self.states
        ]
        remarks = []
        if unseen and self.states:
            remarks.append(
                f"no state has part {', '.join(map(str, unseen))} of the legend"
            )
        if passing:
            remarks.append(f"only some states have part {', '.join(map(str, passing))}")
        if _UNREADABLE in present:
            remarks.append(
                "parts whose number is damaged or too wide for its columns were left out"
            )
        return tuple(remarks)


def _read_legend(data: bytes | Content) -> dict[int, str]:
    """Return the titles of the parts, keyed by number, in the order of the legend."""
    first_state = data.find(b"\n" + _START)
    match = _LEGEND.search(
        data[: min(first_state, _LONGEST) if first_state >= 0 else _LONGEST]
    )
    entries = _ENTRY.findall(match[1]) if match else []
    return {int(id_): title.decode("latin-1").strip() for id_, title in entries}


class PartColumns(NamedTuple):
    """Energies and momenta of one part to be written, each of shape (n,)."""

    title: str
    internal_energy: Samples
    kinetic_energy: Samples
    x_momentum: Samples
    z_momentum: Samples


def write(title: str, time: Samples, parts: Sequence[PartColumns]) -> bytes:
    """Write a matsum of parts numbered from 1, with five significant digits; ``time`` has shape (n,)."""
    legend = "".join(
        f"{number:9d}     {part.title:<70}\n"
        for number, part in enumerate(parts, start=1)
    )
    columns = [
        list(zip(*(column.tolist() for column in part[1:]), strict=True))
        for part in parts
    ]
    blocks = (
        f"\n time ={moment:13.4E}\n"
        + "".join(
            _write_part(number, *rows[i])
            for number, rows in enumerate(columns, start=1)
        )
        for i, moment in enumerate(time.tolist())
    )
    head = f"{make_head(title, 'matsum')}\n{{BEGIN LEGEND}}\n Entity #        Title\n{legend}{{END LEGEND}}\n"
    return (head + "\n".join(blocks)).encode()


def _write_part(
    number: int, internal: float, kinetic: float, x_momentum: float, z_momentum: float
) -> str:
    """Return the lines of a part in one state."""
    return (
        f" mat.#={number:5d}             inten={internal:13.4E}     kinen={kinetic:13.4E}"
        f"     eroded_ie={0:13.4E}     eroded_ke={0:13.4E}\n"
        f" x-mom={x_momentum:13.4E}     y-mom={0:13.4E}     z-mom={z_momentum:13.4E}\n"
        f" x-rbv={0:13.4E}     y-rbv={0:13.4E}     z-rbv={0:13.4E}\n"
        f"                         hgeng={0:13.4E}     +mass={0:13.4E}     eroded_he={0:13.4E}\n"
    )


def _has_all_parts(legend: Mapping[int, str], layout: BlockLayout) -> bool:
    """Return True if the only state of a file has all parts of the legend; False if there is no legend."""
    return bool(legend) and all((id_, _MAT) in layout.fields for id_ in legend)


def _describe_matsum_block(
    legend: Mapping[int, str],
    block: bytes,
    lines: Sequence[re.Match[bytes]],
    literal: Bytes,
) -> tuple[dict[tuple[int | None, str], int], tuple[int | None, str]]:
    """Return the offsets of a block's numbers by part and name, and its last name; UNSURE marks a truncated number."""
    fields: dict[tuple[int | None, str], int] = {}
    part: int | None = None
    doubled = False
    name = _TIME
    for line in lines:
        if line[1] is not None:
            part = _find_part_number(legend, line[1], block)
            doubled = (part, _MAT) in fields
            if doubled:  # If a part has two groups of lines, neither group is reliable.
                fields.update({field: UNSURE for field in fields if field[0] == part})
            # The offset includes the line ending before the line.
            fields[part, _MAT] = UNSURE if doubled else line.start() - 1
        for field in _FIELD.finditer(block, *line.span()):
            name = (part, field[1].decode())
            if field[2] is None or doubled or name in fields:
                fields[name] = UNSURE
            else:
                literal[field.start(2) : field.end(2)] = 0
                fields[name] = field.start(2)
    return fields, name


def _find_part_number(legend: Mapping[int, str], text: bytes, block: bytes) -> int:
    """Read the part number at the beginning of ``text``.

    If a number overflowed its field, it is the only number in the legend that is too wide; several such numbers could
    not be distinguished.
    """
    if match := _ID.match(text):
        return int(match[1])
    wide = [id_ for id_ in legend if id_ > _WIDEST]
    if _OVERFLOW.match(text) and len(wide) == 1 and block.count(b"\n mat.#=*") == 1:
        return wide[0]
    return _UNREADABLE
