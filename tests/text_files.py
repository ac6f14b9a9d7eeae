"""glstat and matsum texts as LS-DYNA writes them, from numbers."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

HEAD = (
    b" Bolted Connection Type b                                                \n"
    b"                    ls-dyna smp d R13 R13.1.1_27_8731a0 date 07/28/2023\n"
)
LABELS = (
    "time step", "kinetic energy", "internal energy", "spring and damper energy", "hourglass energy ",
    "system damping energy", "sliding interface energy", "external work", "eroded kinetic energy",
    "eroded internal energy", "eroded hourglass energy", "total energy", "total energy / initial energy",
    "energy ratio w/o eroded energy", "global x velocity", "global y velocity", "global z velocity",
)  # fmt: skip
LAST = b" time per zone cycle.(nanosec)..             0\n"


def format_glstat_line(label: str, value: float) -> bytes:
    return f" {label:.<31s}{value:14.5E}\n".encode()


def make_glstat_blocks(times: ArrayLike, energies: ArrayLike) -> list[bytes]:
    """Return a block per state: controller line, values, two blank lines; values other than energies are their rank."""
    other_labels = {
        label: format_glstat_line(label, rank) for rank, label in enumerate(LABELS)
    }
    other_labels["spring and damper energy"] = format_glstat_line(
        "spring and damper energy", 1e-20
    )
    fixed = [other_labels[label] for label in LABELS]
    energy_rank = LABELS.index("internal energy")
    before_energy, after_energy = (
        b"".join(fixed[:energy_rank]),
        b"".join(fixed[energy_rank + 1 :]) + LAST,
    )
    return [
        b" dt of cycle%8d is controlled by solid         100449 of part        10\n\n" % (24 * state + 1)
        + format_glstat_line("time", time) + before_energy
        + format_glstat_line("internal energy", energy) + after_energy + b"\n\n"
        for state, (time, energy) in enumerate(zip(np.asarray(times), np.asarray(energies), strict=True))
    ]  # fmt: skip


def make_glstat_text(times: ArrayLike, energies: ArrayLike) -> bytes:
    return HEAD + b"\n\n" + b"".join(make_glstat_blocks(times, energies))


def make_matsum_head(ids: Sequence[int]) -> bytes:
    titles = b"".join(b"%9d     %-72s\n" % (id_, b"Part %d" % id_) for id_ in ids)
    return (
        HEAD
        + b"\n{BEGIN LEGEND}\n Entity #        Title\n"
        + titles
        + b"{END LEGEND}\n\n\n\n"
    )


def make_matsum_part(id_: int, energy: float, lines: int = 4) -> bytes:
    """Return the lines of one part; numbers other than its internal energy are 0."""
    zero = b"   0.0000E+00"
    number = b"%5d             " % id_ if id_ < 100_000 else b"%8d          " % id_
    text = (
        b" mat.#=" + number + b"inten=" + f"{energy:13.4E}".encode()
        + b"     kinen=" + zero + b"     eroded_ie=" + zero + b"     eroded_ke=" + zero + b"\n"
        b" x-mom=" + zero + b"     y-mom=" + zero + b"     z-mom=" + zero + b"\n"
        b" x-rbv=" + zero + b"     y-rbv=" + zero + b"     z-rbv=" + zero + b"\n"
    )  # fmt: skip
    return (
        text
        if lines == 3
        else text + b"                         hgeng=" + zero + b"\n\n\n"
    )


def make_matsum_state(
    time: float, ids: Sequence[int], energies: ArrayLike, lines: int = 4
) -> bytes:
    parts = zip(ids, np.asarray(energies).tolist(), strict=True)
    return f" time ={time:13.4E}\n".encode() + b"".join(
        make_matsum_part(id_, energy, lines) for id_, energy in parts
    )


def make_matsum_text(
    times: ArrayLike, ids: Sequence[int], energies: ArrayLike, lines: int = 4
) -> bytes:
    states = zip(np.asarray(times).tolist(), np.asarray(energies), strict=True)
    return make_matsum_head(ids) + b"".join(
        make_matsum_state(time, ids, row, lines) for time, row in states
    )
