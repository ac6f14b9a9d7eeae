"""Reduce computed runs to the small copies in tests/data: ``python -m tests.thinned FOLDER`` writes them again.

FOLDER holds the runs as OpenRadioss wrote them, and the tables made of them.  A reduced time history keeps its head,
every n-th state and the last one up to a time, and the variables of parts that d2rpick reads; nodes, interfaces and
subsets are dropped.  A reduced table keeps the named columns.
"""

import csv
import gzip
import io
import struct
import sys
from collections.abc import Iterator
from itertools import islice
from pathlib import Path
from typing import NamedTuple

import numpy as np

from tests.computed import DATA
from tests.made_t01 import T01Writer

MOTION = (1, 2, 3, 4, 5, 6)  # internal and kinetic energy, momentum, mass
CENTRES = (7, 9, 10, 11)  # hourglass energy, centre
SILENT = (1, 3, 4, 5, 6)  # without the kinetic energy

TABLES = {
    "chain_ref": ("time_s", "x3_m", "IE_spring1_J", "IE_spring2_J", "IE_total_J"),
    "load_L1_ref": ("time_s", "IE_spring1_J", "IE_J", "momentum_x_solver"),
    "load_L3_ref": ("time_s", "IE_spring1_J", "IE_J", "momentum_x_solver"),
    **{
        f"oscillator_{name}_ref": ("time_s", "IE_J", "KE_J", "momentum_x", "EXTWORK_J")
        for name in ("S1", "S2", "S4")
    },
    **{
        f"oscillator_{name}": ("time_s", "IE_J")
        for name in ("ref", "d2r_13_64", "d2r_6_80", "d2r_13p587_68p753")
    },
    "rollover_r20": ("time_s", "boxIE_J"),
}


class Thinned(NamedTuple):
    """Selection of the states and variables of a time history that are kept."""

    every: int
    end: float = np.inf
    codes: tuple[int, ...] = MOTION


RUNS = {
    "chain_referenceT01": Thinned(10),
    "oscillator_referenceT01": Thinned(10),
    "rollover_r100_T01": Thinned(10, codes=MOTION + CENTRES),
    "rollover_r100_T02": Thinned(10, codes=MOTION + CENTRES),
    "rollover_r100_T03": Thinned(10, codes=MOTION + CENTRES),
    "car_drop/carT01": Thinned(1, 0.17, SILENT),
    "car_drop/switched/car_all_T01": Thinned(4),
    "car_drop/switched/car_all_T02": Thinned(4),
    "car_drop/switched/car_all_T03": Thinned(2, 0.17),
    "car_drop/switched/car_heavy_T02": Thinned(4),
    "car_drop/switched/car_heavy_T03": Thinned(2, 0.17),
    "car_drop/drop2T01": Thinned(2, codes=SILENT),
    **{f"car_drop/switched/drop2_w123_T0{leg}": Thinned(2) for leg in range(1, 7)},
}


def thin(data: bytes, selection: Thinned) -> bytes:
    """Return a time history with only the selected states and part variables, and without groups."""
    records, writer = split_records(data), T01Writer()
    for _ in range(2):
        writer.record(next(records))
    counts = next(records)
    if len(counts) == 4:  # written by newer codes
        for record in (counts, *islice(records, *read_integers(counts))):
            writer.record(record)
        counts = next(records)
    parts, materials, properties, subsets, groups, variables = read_integers(counts)
    writer.integers(parts, materials, properties, subsets, 0, variables)
    if variables:
        writer.record(next(records))
    first_position, positions = 0, list[int]()
    for _ in range(parts):
        head = next(records)
        codes = read_integers(next(records)) if read_integers(head)[-1] else ()
        own_positions = [
            position for position, code in enumerate(codes) if code in selection.codes
        ]
        writer.record(head[:-4] + len(own_positions).to_bytes(4))
        writer.integers(*(codes[position] for position in own_positions))
        positions += [first_position + position for position in own_positions]
        first_position += len(codes)
    for record in islice(records, materials + properties):
        writer.record(record)
    of_subsets = sum(copy_subset(records, writer) for _ in range(subsets))
    of_groups = [skip_group(records) for _ in range(groups)]
    states = zip(
        *[records]
        * sum(map(bool, (True, variables, first_position, of_subsets, *of_groups))),
        strict=True,
    )
    inside = [
        state for state in states if np.frombuffer(state[0], ">f4")[0] <= selection.end
    ]
    of_parts = 1 + bool(variables)
    for state in [*inside[: -1 : selection.every], inside[-1]]:
        for record in state[:of_parts]:
            writer.record(record)
        writer.record(np.frombuffer(state[of_parts], ">f4")[positions].tobytes())
    return bytes(writer.data)


def copy_subset(records: Iterator[bytes], writer: T01Writer) -> int:
    """Copy a subset without its variables; return their number."""
    head = next(records)
    children, parts, variables = read_integers(head[8:20])
    writer.record(head[:16] + bytes(4) + head[20:])
    for record in islice(records, bool(children) + bool(parts)):
        writer.record(record)
    if variables:
        next(records)
    return variables


def skip_group(records: Iterator[bytes]) -> int:
    """Skip a group; return how many numbers of it a state has."""
    elements, variables = read_integers(next(records)[12:20])
    for _ in range(elements + bool(variables)):
        next(records)
    return elements * variables


def split_records(data: bytes) -> Iterator[bytes]:
    """Yield the contents of the Fortran records."""
    offset = 0
    while offset < len(data):
        (length,) = struct.unpack_from(">i", data, offset)
        yield data[offset + 4 : offset + 4 + length]
        offset += 8 + length


def read_integers(record: bytes) -> tuple[int, ...]:
    return tuple(np.frombuffer(record, ">i4").tolist())


def choose_columns(text: str, names: tuple[str, ...]) -> str:
    """Return a table of the named columns, each cell as it was written."""
    table_text = io.StringIO()
    writer = csv.DictWriter(
        table_text, names, extrasaction="ignore", lineterminator="\n"
    )
    writer.writeheader()
    writer.writerows(csv.DictReader(text.splitlines()))
    return table_text.getvalue()


def main(folder: Path) -> None:
    """Write all copies and print their sizes."""
    for name, selection in RUNS.items():
        write(
            f"{name}.gz",
            thin(gzip.decompress((folder / f"{name}.gz").read_bytes()), selection),
        )
    for name, columns in TABLES.items():
        write(
            f"{name}.csv.gz",
            choose_columns(
                (folder / f"{name}.csv").read_text("ascii"), columns
            ).encode(),
        )


def write(name: str, content: bytes) -> None:
    packed = gzip.compress(content, 9, mtime=0)
    (DATA / Path(name).name).write_bytes(packed)
    print(f"{len(packed):8d} {Path(name).name}")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
