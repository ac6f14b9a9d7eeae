"""Small copies of computed runs, for the tests: ``python -m tests.thinned FOLDER`` writes those of tests/data anew.

FOLDER holds the runs as OpenRadioss wrote them, and the tables made of them.  A time history keeps its head, every
n-th state and the last one up to a time, and of its parts the variables that are read; what it says of nodes,
interfaces and subsets goes.  A table keeps the columns that are named.
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


class Thinned(NamedTuple):
    """What stays of a time history."""

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


def thin(data: bytes, kept: Thinned) -> bytes:
    """Time history without the states, variables of parts and groups that are not kept."""
    records, made = bodies(data), T01Writer()
    for _ in range(2):
        made.record(next(records))
    counts = next(records)
    if len(counts) == 4:  # of newer codes
        for record in (counts, *islice(records, *integers(counts))):
            made.record(record)
        counts = next(records)
    parts, materials, properties, subsets, groups, variables = integers(counts)
    made.integers(parts, materials, properties, subsets, 0, variables)
    if variables:
        made.record(next(records))
    before, places = 0, list[int]()
    for _ in range(parts):
        head = next(records)
        codes = integers(next(records)) if integers(head)[-1] else ()
        own = [place for place, code in enumerate(codes) if code in kept.codes]
        made.record(head[:-4] + len(own).to_bytes(4))
        made.integers(*(codes[place] for place in own))
        places += [before + place for place in own]
        before += len(codes)
    for record in islice(records, materials + properties):
        made.record(record)
    of_subsets = sum(copy_subset(records, made) for _ in range(subsets))
    of_groups = [skip_group(records) for _ in range(groups)]
    states = zip(
        *[records] * sum(map(bool, (True, variables, before, of_subsets, *of_groups))),
        strict=True,
    )
    inside = [
        state for state in states if np.frombuffer(state[0], ">f4")[0] <= kept.end
    ]
    of_parts = 1 + bool(variables)
    for state in [*inside[: -1 : kept.every], inside[-1]]:
        for record in state[:of_parts]:
            made.record(record)
        made.record(np.frombuffer(state[of_parts], ">f4")[places].tobytes())
    return bytes(made.data)


def copy_subset(records: Iterator[bytes], made: T01Writer) -> int:
    """Copy a subset without its variables; how many they are."""
    head = next(records)
    children, parts, variables = integers(head[8:20])
    made.record(head[:16] + bytes(4) + head[20:])
    for record in islice(records, bool(children) + bool(parts)):
        made.record(record)
    if variables:
        next(records)
    return variables


def skip_group(records: Iterator[bytes]) -> int:
    """Pass over a group; how many numbers a state has of it."""
    elements, variables = integers(next(records)[12:20])
    for _ in range(elements + bool(variables)):
        next(records)
    return elements * variables


def bodies(data: bytes) -> Iterator[bytes]:
    """Contents of the Fortran records."""
    at = 0
    while at < len(data):
        (length,) = struct.unpack_from(">i", data, at)
        yield data[at + 4 : at + 4 + length]
        at += 8 + length


def integers(record: bytes) -> tuple[int, ...]:
    return tuple(np.frombuffer(record, ">i4").tolist())


def columns_of(text: str, names: tuple[str, ...]) -> str:
    """Table of some columns, each cell as it was written."""
    kept = io.StringIO()
    writer = csv.DictWriter(kept, names, extrasaction="ignore", lineterminator="\n")
    writer.writeheader()
    writer.writerows(csv.DictReader(text.splitlines()))
    return kept.getvalue()


def main(folder: Path) -> None:
    """Write all of them, and print their sizes."""
    for name, kept in RUNS.items():
        write(
            f"{name}.gz",
            thin(gzip.decompress((folder / f"{name}.gz").read_bytes()), kept),
        )
    for name, columns in TABLES.items():
        write(
            f"{name}.csv.gz",
            columns_of((folder / f"{name}.csv").read_text("ascii"), columns).encode(),
        )


def write(name: str, content: bytes) -> None:
    packed = gzip.compress(content, 9, mtime=0)
    (DATA / Path(name).name).write_bytes(packed)
    print(f"{len(packed):8d} {Path(name).name}")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
