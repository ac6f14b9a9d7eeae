"""What a run took: cycles and processor time as solvers print them, per leg.

Sources: ``CUMULATIVE CPU TIME SUMMARY`` of Radioss' engine listing (NAME_0001.out), the timing information of LS-DYNA's
d3hsp, and ``time per zone cycle`` of its glstat.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from d2rpick.errors import FormatError

if TYPE_CHECKING:
    from d2rpick.histories.history import Samples

_NUMBER: Final = rb"([-+]?[.\d]+(?:[Ee][-+]?\d+)?)"
_RADIOSS_ELEMENTS: Final = re.compile(rb"^ *ELEMENT FORCES\.*: *" + _NUMBER, re.MULTILINE)
_RADIOSS_TOTAL: Final = re.compile(rb"^ *TOTAL\.*: *" + _NUMBER, re.MULTILINE)
_RADIOSS_CYCLES: Final = re.compile(rb"TOTAL NUMBER OF CYCLES *: *(\d+)")
_SUMMARY: Final = b"CUMULATIVE CPU TIME SUMMARY"
_TIMING: Final = b"T i m i n g   i n f o r m a t i o n"
_D3HSP_ROW: Final = rb" *\.* +" + _NUMBER + rb" +" + _NUMBER + rb" +" + _NUMBER
_D3HSP_ELEMENTS: Final = re.compile(rb"^ *Element processing" + _D3HSP_ROW, re.MULTILINE)
_D3HSP_TOTAL: Final = re.compile(rb"^ *T o t a l s" + _D3HSP_ROW, re.MULTILINE)
_D3HSP_SETUP: Final = re.compile(
    rb"^ *(?:Keyword Processing|Initialization|MPP Decomposition)" + _D3HSP_ROW, re.MULTILINE
)
_D3HSP_CYCLES: Final = re.compile(rb"Problem cycle *= *(\d+)")
_ZONE: Final = re.compile(rb"^ time(?:\.{5,}| per zone cycle\.\(nanosec\)\.\.) +" + _NUMBER, re.MULTILINE)
_PER_ZONE: Final = b" time per zone"


class Timing(NamedTuple):
    """What a leg of a run took: cycles, processor time of all of them and of their elements [s]."""

    name: str
    cycles: int
    total: float
    elements: float


class ZoneTimes(NamedTuple):
    """Time per element and cycle over the time of a run, each of shape (n,) [time of the run], [s]."""

    name: str
    time: Samples
    per_zone: Samples


def read_timing(path: str) -> Timing:
    """Read a Radioss listing or a d3hsp.

    Raises
    ------
    FormatError
        If the file cannot be read, or its summary of times is not there or says nothing.
    """
    data = _read(path)
    found = _of_radioss(path, data) if _SUMMARY in data else _of_d3hsp(path, data) if _TIMING in data else None
    if found is None or not found.cycles or not 0 < found.elements <= found.total:
        raise FormatError(
            f"{path}: no times of elements and of all work with their cycles were found, a Radioss listing "
            "(NAME_0001.out, with /MON/ON) or a d3hsp of a run that has ended was expected"
        )
    return found


def read_zone_times(path: str) -> ZoneTimes:
    """Read the time per zone cycle of a glstat; FormatError where it has none above zero."""
    pairs: list[tuple[float, float]] = []
    time = 0.0
    for line in _ZONE.finditer(_read(path)):
        if line[0].startswith(_PER_ZONE):
            pairs.append((time, float(line[1])))
        else:
            time = float(line[1])
    times = np.array(pairs, np.float64).reshape(-1, 2)
    times = times[times[:, 1] > 0]
    if not len(times):
        raise FormatError(f"{path}: no time per zone cycle above 0 was found, a glstat of LS-DYNA was expected")
    return ZoneTimes(path, times[:, 0], times[:, 1] * 1e-9)


def is_glstat(path: str) -> bool:
    """Whether a file has times per zone cycle."""
    return b"time per zone cycle" in _read(path)


def _read(path: str) -> bytes:
    try:
        return Path(path).read_bytes()
    except OSError as error:
        raise FormatError(f"{path}: cannot be read ({error.strerror}); check the name and the permissions") from None


def _of_radioss(name: str, data: bytes) -> Timing | None:
    summary = data[data.rindex(_SUMMARY) :]
    found = [one.search(summary) for one in (_RADIOSS_ELEMENTS, _RADIOSS_TOTAL, _RADIOSS_CYCLES)]
    elements, total, cycles = (float(one[1]) if one else 0.0 for one in found)
    return Timing(name, int(cycles), total, elements)


def _of_d3hsp(name: str, data: bytes) -> Timing | None:
    """Take processor times, or times of the clock where those are rounded to nothing; less what came before the run."""
    table = data[data.rindex(_TIMING) :]
    cycles, total, elements = (one.search(table) for one in (_D3HSP_CYCLES, _D3HSP_TOTAL, _D3HSP_ELEMENTS))
    if not (cycles and total and elements):
        return None
    column = 1 if float(elements[1]) > 0 else 3
    before = sum(float(row[column - 1]) for row in _D3HSP_SETUP.findall(table))
    return Timing(name, int(cycles[1]), float(total[column]) - before, float(elements[column]))
