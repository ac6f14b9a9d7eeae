"""Write binouts for tests and benchmarks: LSDA with any byte order and field sizes, with or without symbol tables."""

import struct
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

_FIELDS = {1: "B", 2: "H", 4: "I", 8: "Q"}
_TYPES = {"i1": 1, "i2": 2, "i4": 3, "i8": 4, "f4": 9, "f8": 10}

# Variables of a glstat state as LS-DYNA R12 writes them.
GLSTAT = (
    "time", "time_step", "kinetic_energy", "internal_energy", "stonewall_energy", "spring_and_damper_energy",
    "hourglass_energy", "system_damping_energy", "sliding_interface_energy", "external_work",
    "eroded_kinetic_energy", "eroded_internal_energy", "eroded_hourglass_energy", "total_energy",
    "energy_ratio", "energy_ratio_wo_eroded", "global_x_velocity", "global_y_velocity", "global_z_velocity",
)  # fmt: skip
MATSUM = (
    "internal_energy", "kinetic_energy", "hourglass_energy", "x_momentum", "y_momentum", "z_momentum",
    "eroded_internal_energy",
)  # fmt: skip


@dataclass(frozen=True)
class Style:
    """Byte order, sizes of the length, offset, command and type fields [bytes], and the type of real numbers."""

    order: str = "<"
    length: int = 8
    offset: int = 8
    command: int = 1
    type_id: int = 1
    real: str = "f4"


@dataclass
class LsdaWriter:
    """Writer that appends records to ``data``; ``marks`` are the offsets at which records begin."""

    style: Style = Style()
    data: bytearray = field(default_factory=bytearray)
    marks: list[int] = field(default_factory=list)

    def __post_init__(self) -> None:
        s = self.style
        self._head = struct.Struct(s.order + _FIELDS[s.length] + _FIELDS[s.command])
        self._symbol = struct.Struct(
            s.order + _FIELDS[s.type_id] + _FIELDS[s.offset] + _FIELDS[s.length]
        )
        self._offset = struct.Struct(s.order + _FIELDS[s.offset])
        self.data += bytes(
            [8, s.length, s.offset, s.command, s.type_id, s.order == "<", 0, 0]
        )
        self._link = len(self.data) + self._head.size
        self.record(7, self._offset.pack(0))
        self._path = "/"
        self._dirty: dict[str, list[bytes]] = {}
        self.cd("/")

    def record(self, command: int, body: bytes) -> None:
        self.marks.append(len(self.data))
        self.data += self._head.pack(self._head.size + len(body), command) + body

    def cd(self, path: str, text: str | None = None) -> None:
        self._path = path
        self.record(2, (text or path).encode())

    def put(self, name: str, values: Any, kind: str) -> None:
        raw = (
            values
            if isinstance(values, bytes)
            else np.asarray(values, self.style.order + kind).tobytes()
        )
        count = len(raw) // int(kind[1])
        entry = bytes(name, "ascii") + self._symbol.pack(
            _TYPES[kind], len(self.data), count
        )
        self._dirty.setdefault(self._path, []).append(
            self._head.pack(self._head.size + len(entry), 4) + entry
        )
        code = struct.pack(self.style.order + _FIELDS[self.style.type_id], _TYPES[kind])
        self.record(3, code + bytes([len(name)]) + name.encode() + raw)

    def table(self) -> None:
        """Write a symbol table and link the previous one to it."""
        body = b""
        for path, entries in self._dirty.items():
            body += (
                self._head.pack(self._head.size + len(path), 2)
                + path.encode()
                + b"".join(entries)
            )
        body += self._head.pack(self._head.size + self.style.offset, 6)
        self._offset.pack_into(self.data, self._link, len(self.data))
        self.record(5, body + self._offset.pack(0))
        self._link = len(self.data) - self.style.offset
        self._dirty = {}


def compute_value(name: str, state: int, part: int = 0) -> float:
    """Return a number that is unique to a variable, state and part, and exact in single precision up to state 4000."""
    names = [*GLSTAT, *MATSUM]
    return (
        names.index(name) * 8192.0 + state + part / 64 if name != "time" else state / 8
    )


def make_binout(
    states: Sequence[int],
    parts: Sequence[int] = (7, 3),
    *,
    style: Style = Style(),
    relative: bool = False,
    tables: bool = True,
    matsum_every: int = 1,
    titles: Mapping[int, str] | None = None,
    parts_of: Callable[[int], Sequence[int]] | None = None,
    glstat: bool = True,
    shift: int = 0,
) -> LsdaWriter:
    """Write states of glstat and matsum; ``parts_of`` gives the part ids of each state.

    State n has the numbers of state n + ``shift``, like the first states after a restart.
    """
    writer = LsdaWriter(style)
    titles = titles or {id_: f"part {id_}" for id_ in parts}
    for branch in ("glstat", "matsum") if glstat else ("matsum",):
        writer.cd(f"/{branch}/metadata")
        writer.put("title", b"made for tests".ljust(80), "i1")
        writer.put("version", b"smp s R12   ", "i1")
        writer.put("revision", bytes(10), "i1")
    if not parts_of:
        writer.put("ids", parts, "i4")
    writer.put(
        "legend", b"".join(title.encode().ljust(70) for title in titles.values()), "i1"
    )
    writer.put("legend_ids", list(titles), "i4")
    for state in states:
        if glstat:
            writer.cd(
                f"/glstat/d{state:06d}",
                f"../../glstat/d{state:06d}" if relative else None,
            )
            writer.put("cycle", [state], "i4")
            for name in GLSTAT:
                writer.put(name, [compute_value(name, state + shift)], style.real)
        if state % matsum_every == 0:
            number = state // matsum_every  # each branch counts its own states
            writer.cd(
                f"/matsum/d{number:06d}",
                f"../../matsum/d{number:06d}" if relative else None,
            )
            writer.put("time", [compute_value("time", state + shift)], style.real)
            state_parts = parts_of(state) if parts_of else parts
            if parts_of:
                writer.put("ids", state_parts, "i4")
            for name in MATSUM:
                writer.put(
                    name,
                    [compute_value(name, state + shift, id_) for id_ in state_parts],
                    style.real,
                )
        if tables:
            writer.table()
    return writer
