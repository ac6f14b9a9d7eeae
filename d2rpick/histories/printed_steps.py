"""Smallest time steps of parts as the solver printed them: in glstat, and in the table of d3hsp.

Source: LS-DYNA's own output (``dt of cycle 24 is controlled by solid 100449 of part 10``, ``25 smallest timesteps``).
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from d2rpick.histories.run import Run

_NUMBER: Final = rb"([-+.\dEe]+)"
_STEP: Final = re.compile(rb"is controlled by +[\w ]*?\d+ +of part +(\d+)|^ time step\.+ +" + _NUMBER, re.MULTILINE)
_TABLE: Final = re.compile(rb"smallest timesteps *\r?\n[^\n]*\n[^\n]*part +timestep *\r?\n((?:[^\n]*\n)*?) *(?:\n|\Z)")
_ROW: Final = re.compile(rb"^ *[a-z][a-z ]* +\d+ +(\d+) +" + _NUMBER + rb"\s*$", re.MULTILINE)
_HEAD: Final = 64 << 20  # bytes of a file that are searched: it begins with what matters
_D3HSP: Final = "d3hsp"


def printed_steps(run: Run, *beside: str) -> dict[int, tuple[float, str]]:
    """Find the smallest steps by part, with the name of their source.

    Parameters
    ----------
    run : Run
        Its glstat is searched.
    *beside : str
        Files, in whose folders a d3hsp is looked for too.

    Returns
    -------
    dict
        (step, source) by part, of the parts that controlled the step or stand in the table of the smallest ones [time].
    """
    found: dict[int, tuple[float, str]] = {}
    for name, part, step in (*_of_glstat(run), *_of_d3hsp((*run.sources, *beside))):
        if step > 0 and (part not in found or step < found[part][0]):
            found[part] = step, name
    return found


def _of_glstat(run: Run) -> Iterator[tuple[str, int, float]]:
    """Pair the part that controls each cycle with the step printed below it."""
    for file in run.files:
        part: bytes | None = None
        for line in _STEP.finditer(file.data[:_HEAD]):
            if line[1]:
                part = line[1]
            elif part:
                yield ("glstat", *_pair(part, line[2]))
                part = None


def _of_d3hsp(names: Sequence[str]) -> Iterator[tuple[str, int, float]]:
    for folder in dict.fromkeys(Path(name).parent for name in names):
        path = folder / _D3HSP
        if not path.is_file():
            continue
        with path.open("rb") as stream:
            table = _TABLE.search(stream.read(_HEAD))
        if table:
            yield from ((_D3HSP, *_pair(*row.groups())) for row in _ROW.finditer(table[1]))


def _pair(part: bytes, step: bytes) -> tuple[int, float]:
    """Part and step; 0 for a number that is cut."""
    try:
        return int(part), float(step)
    except ValueError:
        return int(part), 0.0
