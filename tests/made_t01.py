"""Write Radioss time histories for tests, binary or text, with any number of globals, parts, variables and groups."""

import struct
from collections.abc import Sequence
from dataclasses import dataclass, field


def pack_numbers(kind: str, numbers: Sequence[float]) -> bytes:
    """Return numbers of four bytes; without numpy, because the fake solver starts anew for each restart segment."""
    return struct.pack(f">{len(numbers)}{kind}", *numbers)


@dataclass
class T01Writer:
    """Writer that appends Fortran records to ``data``; ``marks`` are the offsets at which records begin."""

    data: bytearray = field(default_factory=bytearray)
    marks: list[int] = field(default_factory=list)

    def record(self, body: bytes) -> None:
        self.marks.append(len(self.data))
        self.data += struct.pack(">i", len(body)) + body + struct.pack(">i", len(body))

    def titled(
        self, first: Sequence[int], title: str, last: Sequence[int] = ()
    ) -> None:
        self.record(pack_numbers("i", first) + title.encode() + pack_numbers("i", last))

    def integers(self, *numbers: int) -> None:
        if numbers:
            self.record(pack_numbers("i", numbers))

    def setting(self, number: int) -> None:
        self.integers(number)

    def reals(self, numbers: Sequence[float]) -> None:
        if numbers:
            self.record(pack_numbers("f", numbers))

    def state(
        self, time: float, whole: Sequence[float], parts: Sequence[float], subset_variables: int = 2,
        groups: Sequence[Sequence[float]] = (), nodes: Sequence[float] = (0.0,) * 18,
    ) -> None:  # fmt: skip
        self.reals([time])
        self.reals(whole)
        self.reals(parts)
        self.reals([0.0] * subset_variables)
        self.reals(nodes)
        for values in groups:
            self.reals(values)


@dataclass
class T01TextWriter(T01Writer):
    """Text writer with the columns of ``/TFILE/3``; ``marks`` are the offsets of the lines with record shapes."""

    line_end: bytes = b"\n"

    def line(self, text: str) -> None:
        self.data += text.encode() + self.line_end

    def titled(
        self, first: Sequence[int], title: str, last: Sequence[int] = ()
    ) -> None:
        is_run = not last and len(self.marks) < 2  # the file name is written before it
        if is_run:
            self.line("runT01 FORMAT")
            title = title[:72] if first else title
        self.marks.append(len(self.data))
        title_length = (
            40 if last else len(title)
        )  # the solver writes 40 for a part, whatever its length
        count = (
            [f"{len(first):5d}I"] * bool(first)
            + [f"{title_length:5d}C"]
            + [f"{len(last):5d}I"] * bool(last)
        )
        self.line("ZZZZZEOR" + "".join(count))
        width = 5 if is_run else 10
        self.line(
            "".join(f"{n:{width}d}" for n in first)
            + title
            + "".join(_five(n) for n in last)
        )

    def integers(self, *numbers: int) -> None:
        self._numbers("I", [f"{n:10d}" for n in numbers], 16)

    def setting(self, number: int) -> None:
        self._numbers("I", [f"{number:5d}"], 1)

    def reals(self, numbers: Sequence[float]) -> None:
        self._numbers("R", [format_real(number) for number in numbers], 5)

    def _numbers(self, kind: str, fields: Sequence[str], per_line: int) -> None:
        if fields:
            self.marks.append(len(self.data))
            self.line(f"ZZZZZEOR{_five(len(fields))}{kind}")
            for begin in range(0, len(fields), per_line):
                self.line("".join(fields[begin : begin + per_line]))


def _five(number: int) -> str:
    return f"{number:5d}" if number < 10**5 else "*****"


def format_real(number: float) -> str:
    """Return a number as 1PE15.8 after a blank; Fortran drops the E if the exponent has three digits."""
    mantissa, _, exponent = f"{number:.8E}".partition("E")
    return f"{mantissa + exponent if len(exponent) > 3 else f'{number:.8E}':>16}"


@dataclass(frozen=True)
class MadePart:
    id: int
    title: str
    codes: tuple[int, ...] = (1, 2, 3, 4, 5, 6, 7, 28)
    is_group: bool = False
    material: int = 1


@dataclass(frozen=True)
class MadeGroup:
    """Group of interfaces (101) or rigid walls (102) with a history; members are given by their numbers."""

    kind: int
    members: dict[int, str]
    variables: tuple[int, ...] = (1, 2, 3, 4, 5, 6)


def make_value(state: int, part: int, code: int) -> float:
    """Return a number that is unique to a state, part (0: globals) and variable, and exact in single precision."""
    return state + part * 16384.0 + code / 64


def make_t01(
    states: int,
    parts: Sequence[MadePart] = (MadePart(3, "box"), MadePart(12, "step")),
    *,
    globals_: int = 22,
    code: int = 3040,
    title: int = 40,
    subset_variables: int = 2,
    start: int = 0,
    writer: T01Writer | None = None,
) -> T01Writer:
    writer = write_head(
        parts,
        globals_=globals_,
        code=code,
        title=title,
        subset_variables=subset_variables,
        writer=writer,
    )
    for state in range(start, start + states):
        globals_of = [make_value(state, 0, code) for code in range(1, globals_ + 1)]
        of_parts = [
            make_value(state, part.id, code) for part in parts for code in part.codes
        ]
        writer.state(state / 8, globals_of, of_parts, subset_variables)
    return writer


def write_head(
    parts: Sequence[MadePart],
    *,
    globals_: int,
    code: int = 3040,
    title: int = 40,
    subset_variables: int = 2,
    writer: T01Writer | None = None,
    groups: Sequence[MadeGroup] = (),
) -> T01Writer:
    """Write everything before the states, into ``writer`` if it is given (a text writer)."""
    writer = T01Writer() if writer is None else writer
    writer.titled([code], "made for tests".ljust(80))
    writer.titled(
        [], "Fri Nov 20 23:34:18 2026 RADIOSS OpenRadioss,       linuxa64 gf".ljust(80)
    )
    if code >= 3050:
        writer.setting(2)
        writer.setting(title)
        writer.reals([1, 1, 1])
    writer.integers(len(parts), 2, 1, 1, 1 + len(groups), globals_)
    writer.integers(*range(1, globals_ + 1))
    for part in parts:
        numbers = (
            0,
            0 if part.is_group else part.material,
            0 if part.is_group else 2,
            len(part.codes),
        )
        writer.titled([part.id], part.title.ljust(title), numbers)
        writer.integers(*part.codes)
    for number in (1, 2, 3):
        writer.titled([number], "steel".ljust(title))
    writer.titled([0, 0, 0, len(parts), subset_variables], "GLOBAL MODEL".ljust(title))
    writer.integers(*(part.id for part in parts))
    writer.integers(*range(1, subset_variables + 1))
    writer.titled([1, 0, 0, 3, 6], "nodes".ljust(title))
    for node in (5, 6, 7):
        writer.titled([node], "corner".ljust(title))
    writer.integers(*range(1, 7))
    for number, group in enumerate(groups, start=2):
        writer.titled(
            [number, group.kind, 0, len(group.members), len(group.variables)],
            "forces".ljust(title),
        )
        for id_, name in group.members.items():
            writer.titled([id_], name.ljust(title))
        writer.integers(*group.variables)
    return writer
