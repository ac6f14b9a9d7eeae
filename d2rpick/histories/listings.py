"""Read listings of solvers for the engine version, CPU times, and the smallest time steps of parts.

Sources: the published source of OpenRadioss (radioss_title.F, rbyonf.F, or_build_info.py), its pull request 4538 and
its commit 780156a9a; ``CUMULATIVE CPU TIME SUMMARY`` of Radioss' engine listing (NAME_0001.out); the timing
information and the ``25 smallest timesteps`` of LS-DYNA's d3hsp; ``time per zone cycle`` and ``dt of cycle 24 is
controlled by solid 100449 of part 10`` of its glstat; listings of runs.
"""

from __future__ import annotations

import os
import re
from typing import TYPE_CHECKING, Final

import numpy as np

from d2rpick.base.errors import FormatError
from d2rpick.base.tuples import NamedTuple

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from d2rpick.histories.history import Samples
    from d2rpick.histories.run import OpenedRun

# These patterns are compiled by the functions of `re` on first use, to keep start-up fast.
_HISTORY: Final = r"(?s)(?P<root>.+)T(?P<leg>\d\d)(\.csv)?(\.gz)?"
# Numbers of bytes that are read at the start and at the end of an engine listing.
_HEAD, _TAIL = 1 << 20, 1 << 16
_SWITCHED: Final = rb"RIGID BODY: *\d+ +SET O(?:N|FF)"
_COMMIT: Final = rb"CommitID: *([0-9a-f]{7,40})\b"
# Pattern of the copyright line, whose last year is the year in which the engine was built.
_BUILT: Final = rb"COPYRIGHT \(C\) (?:\d{4}-)?(\d{4})"
_RAN: Final = rb"EXECUTION (?:STARTED|COMPLETED) *[.:]+ *(\d{4})/(\d\d)/(\d\d)"
# Date on which OpenRadioss corrected the energy of switched elements.
_FIXED: Final = (2026, 1, 13)
# Hashes of the last commits before the correction; engines built from them may show the year 2026.
_BEFORE: Final = (
    "49d9807 fe00fc0 ec1d512 76c61f5 52050b0 e28e42b 2b7ab50 6068aa2 0043df5 20f7b7f 0387857 c43d89c c36006f 670017c "
    "df5cc2b 047586b c3dff92 3844b9a 8751b9d f7fed09 cb26b37 062cdd8 e6f5601 ddf0b52 36f7b44 bcc1391 835210e 379fcb2 "
    "9e0e860 26e6573 0905ab7 96c6242 055fbad 9344188 cdf7934 49ecd10 eb51543 c2cb8fa 534623f 46f299a 8de64c8 43562a9 "
    "0260a03 d136353 7ca05a4 abdd714 0fd23b1 898ac63 9e2cfb1"
)
_SHORT: Final = 7  # Number of digits of an abbreviated commit hash.

WITH_AN_ERROR: Final = "with an error"
_PACKED: Final = "normally (its history is compressed)"
# Texts at the end of Radioss' engine listing and of LS-DYNA's messag and d3hsp.
_ENDINGS: Final = {
    b"ERROR TERMINATION": WITH_AN_ERROR,
    b"E r r o r   t e r m i n a t i o n": WITH_AN_ERROR,
    b"NORMAL TERMINATION": "normally",
    b"N o r m a l    t e r m i n a t i o n": "normally",
}
_STOPPED: Final = b"USER BREAK"
_NUMBER: Final = rb"([-+]?[.\d]+(?:[Ee][-+]?\d+)?)"
_RADIOSS_ELEMENTS: Final = rb"(?m)^ *ELEMENT FORCES\.*: *" + _NUMBER
_RADIOSS_TOTAL: Final = rb"(?m)^ *TOTAL\.*: *" + _NUMBER
_RADIOSS_CYCLES: Final = rb"TOTAL NUMBER OF CYCLES *: *(\d+)"
_SUMMARY: Final = b"CUMULATIVE CPU TIME SUMMARY"
_TIMING: Final = b"T i m i n g   i n f o r m a t i o n"
_D3HSP_ROW: Final = rb" *\.* +" + _NUMBER + rb" +" + _NUMBER + rb" +" + _NUMBER
_D3HSP_ELEMENTS: Final = rb"(?m)^ *Element processing" + _D3HSP_ROW
_D3HSP_TOTAL: Final = rb"(?m)^ *T o t a l s" + _D3HSP_ROW
_D3HSP_SETUP: Final = (
    rb"(?m)^ *(?:Keyword Processing|Initialization|MPP Decomposition)" + _D3HSP_ROW
)
_D3HSP_CYCLES: Final = rb"Problem cycle *= *(\d+)"
_ZONE: Final = rb"(?m)^ time(?:\.{5,}| per zone cycle\.\(nanosec\)\.\.) +" + _NUMBER
_PER_ZONE: Final = b" time per zone"
_STEP_NUMBER: Final = rb"([-+.\dEe]+)"
_STEP: Final = (
    rb"(?m)is controlled by +[\w ]*?\d+ +of part +(\d+)|^ time step\.+ +" + _STEP_NUMBER
)
_TABLE: Final = rb"smallest timesteps *\r?\n[^\n]*\n[^\n]*part +timestep *\r?\n((?:[^\n]*\n)*?) *(?:\n|\Z)"
_ROW: Final = rb"(?m)^ *[a-z][a-z ]* +\d+ +(\d+) +" + _STEP_NUMBER + rb"\s*$"
# Number of bytes at the start of a file that are searched for time steps.
_SEARCHED: Final = 64 << 20
_D3HSP: Final = "d3hsp"


def find_wrong_energies(histories: Iterable[str]) -> Iterator[str]:
    """Yield the listings of restarts whose engine reports a wrong internal energy, each with the evidence.

    OpenRadioss before its fix of January 2026 reports a wrong energy of elements that /RBODY/ON or /RBODY/OFF of a
    restart switches. Nothing is yielded if the listing does not show when the engine was built.
    """
    for name in histories:
        match = re.fullmatch(_HISTORY, name)
        if match and int(match["leg"]) > 1:
            listing = f"{match['root']}_{int(match['leg']):04d}.out"
            old = _detect_old_engine(*_read_ends(listing))
            if old:
                yield f"{listing}: {old}"


def find_ending(history: str) -> str | None:
    """Return how a run ended according to its last history and the listing next to it; None if it is unknown.

    A packed history belongs to a run that has ended. The run has not ended with a restart segment that was told to
    stop, or that is followed by another segment.
    """
    from pathlib import Path  # Imported here to keep start-up fast.

    if history.endswith(".gz"):
        return _PACKED
    match = re.fullmatch(_HISTORY, history)
    if match and Path(f"{match['root']}_{int(match['leg']) + 1:04d}.rad").exists():
        return None
    endings = {ending for _, ending in _read_endings(history)}
    return next((manner for manner in _ENDINGS.values() if manner in endings), None)


def find_listing_with_error(histories: Sequence[str]) -> str | None:
    """Return the listing next to the last history of a run that ended with an error; None if there is none."""
    endings = _read_endings(max(histories))
    return next(
        (listing for listing, ending in endings if ending == WITH_AN_ERROR), None
    )


def _read_endings(history: str) -> Iterator[tuple[str, str]]:
    """Yield the listings next to a history that report how the run ended, each with this ending."""
    from pathlib import Path  # Imported here to keep start-up fast.

    match = re.fullmatch(_HISTORY, history)
    if match:
        listings = [f"{match['root']}_{int(match['leg']):04d}.out"]
    else:
        listings = [str(Path(history).parent / name) for name in ("messag", "d3hsp")]
    for listing in listings:
        tail = read_tail(listing, _TAIL)
        for words, manner in _ENDINGS.items():
            if words in tail and _STOPPED not in tail:
                yield listing, manner


def _read_ends(path: str) -> tuple[bytes, bytes]:
    """Return the first and last bytes of a file; both are empty if it cannot be read."""
    try:
        with open(path, "rb") as stream:  # noqa: PTH123  pathlib would slow down start-up
            return stream.read(_HEAD), read_tail(path, _TAIL)
    except (OSError, ValueError):
        return b"", b""


def read_tail(path: str, size: int) -> bytes:
    """Return the last bytes of a file; empty if it cannot be read."""
    try:
        with open(path, "rb") as stream:  # noqa: PTH123  pathlib would slow down start-up
            stream.seek(max(os.fstat(stream.fileno()).st_size - size, 0))
            return stream.read()
    except (OSError, ValueError):
        return b""


def _detect_old_engine(head: bytes, tail: bytes) -> str:
    """Return the evidence that an engine reports wrong energies after switching; empty if there is none."""
    if b"OpenRadioss" not in head or not re.search(_SWITCHED, head):
        return ""
    commit = re.search(_COMMIT, head)
    built = re.search(_BUILT, head)
    ran = re.search(_RAN, tail)
    if commit and commit[1][:_SHORT].decode() in _BEFORE:
        return f"commit {commit[1].decode()[:9]}"
    if built and int(built[1]) < _FIXED[0]:
        return f"built in {int(built[1])}"
    if ran and tuple(map(int, ran.groups())) < _FIXED:
        return f"run on {b'-'.join(ran.groups()).decode()}"
    return ""


class Timing(NamedTuple):
    """Number of cycles of a restart segment, and the CPU times of the whole segment and of its elements [s]."""

    name: str
    cycles: int
    total: float
    elements: float


class ZoneTimes(NamedTuple):
    """CPU time per element and cycle [s] at times of a run [time]; both have shape (n,)."""

    name: str
    time: Samples
    per_zone: Samples


def read_timing(path: str) -> Timing:
    """Read the CPU times in a Radioss listing or a d3hsp.

    Raises
    ------
    FormatError
        If the file cannot be read, or contains no usable summary of CPU times.
    """
    data = _read_listing(path)
    timing = find_radioss_timing(path, data)
    if timing is None and _TIMING in data:
        timing = _read_d3hsp_timing(path, data)
    if timing is None or not timing.cycles or not 0 < timing.elements <= timing.total:
        raise FormatError(
            f"{path}: no times of elements and of all work with their cycles were found, but a Radioss listing "
            "(NAME_0001.out, with /MON/ON) or a d3hsp of a run that has ended was expected"
        )
    return timing


def read_zone_times(path: str) -> ZoneTimes:
    """Read the times per zone cycle from a glstat; raise FormatError if none is positive."""
    pairs: list[tuple[float, float]] = []
    time = 0.0
    for line in re.finditer(_ZONE, _read_listing(path)):
        if line[0].startswith(_PER_ZONE):
            pairs.append((time, float(line[1])))
        else:
            time = float(line[1])
    times = np.array(pairs, np.float64).reshape(-1, 2)
    times = times[times[:, 1] > 0]
    if not len(times):
        raise FormatError(
            f"{path}: no time per zone cycle above 0 was found, but a glstat of LS-DYNA was expected"
        )
    return ZoneTimes(path, times[:, 0], times[:, 1] * 1e-9)


def is_glstat(path: str) -> bool:
    """Return True if a file contains times per zone cycle."""
    return b"time per zone cycle" in _read_listing(path)


def _read_listing(path: str) -> bytes:
    """Return the bytes of a file; raise FormatError if the file cannot be read."""
    try:
        with open(path, "rb") as stream:  # noqa: PTH123  pathlib would slow down start-up
            return stream.read()
    except OSError as error:
        raise FormatError(
            f"{path}: cannot be read ({error.strerror}); check the name and the permissions"
        ) from None


def find_radioss_timing(name: str, data: bytes) -> Timing | None:
    """Return the CPU times in a Radioss listing (0 for a missing number); None if the listing has no summary."""
    if _SUMMARY not in data:
        return None
    summary = data[data.rindex(_SUMMARY) :]
    numbers = []
    for pattern in (_RADIOSS_ELEMENTS, _RADIOSS_TOTAL, _RADIOSS_CYCLES):
        match = re.search(pattern, summary)
        numbers.append(float(match[1]) if match else 0.0)
    elements, total, cycles = numbers
    return Timing(name, int(cycles), total, elements)


def _read_d3hsp_timing(name: str, data: bytes) -> Timing | None:
    """Return the CPU times in a d3hsp without initialisation.

    If the CPU times are rounded to zero, elapsed times replace them.
    """
    table = data[data.rindex(_TIMING) :]
    cycles = re.search(_D3HSP_CYCLES, table)
    total = re.search(_D3HSP_TOTAL, table)
    elements = re.search(_D3HSP_ELEMENTS, table)
    if not (cycles and total and elements):
        return None
    column = 1 if float(elements[1]) > 0 else 3
    setup = sum(float(row[column - 1]) for row in re.findall(_D3HSP_SETUP, table))
    return Timing(
        name, int(cycles[1]), float(total[column]) - setup, float(elements[column])
    )


def find_printed_steps(
    run: OpenedRun, *neighbours: str
) -> dict[int, tuple[float, str]]:
    """Return the smallest time step of each part and the name of the file that contains it, keyed by part id.

    Parameters
    ----------
    run : Run
        Run whose glstat is examined.
    *neighbours : str
        Files whose folders are also searched for a d3hsp.

    Returns
    -------
    dict
        (time step [time], source) of the parts that control the time step or are in the table of smallest time steps,
        keyed by part id.
    """
    steps: dict[int, tuple[float, str]] = {}
    names = (*run.sources, *neighbours)
    for name, part, step in (*_read_steps_of_glstat(run), *_read_steps_of_d3hsp(names)):
        if step > 0 and (part not in steps or step < steps[part][0]):
            steps[part] = step, name
    return steps


def _read_steps_of_glstat(run: OpenedRun) -> Iterator[tuple[str, int, float]]:
    """Yield the part that controls the time step in each cycle, with the time step printed below it."""
    for file in run.files:
        part: bytes | None = None
        for line in re.finditer(_STEP, file.data[:_SEARCHED]):
            if line[1]:
                part = line[1]
            elif part:
                yield ("glstat", *_parse_part_and_step(part, line[2]))
                part = None


def _read_steps_of_d3hsp(names: Sequence[str]) -> Iterator[tuple[str, int, float]]:
    """Yield the smallest time step of each part, from the table in each d3hsp next to the given files."""
    from pathlib import Path

    for folder in dict.fromkeys(Path(name).parent for name in names):
        path = folder / _D3HSP
        if not path.is_file():
            continue
        with path.open("rb") as stream:
            table = re.search(_TABLE, stream.read(_SEARCHED))
        if table:
            yield from (
                (_D3HSP, *_parse_part_and_step(*row.groups()))
                for row in re.finditer(_ROW, table[1])
            )


def _parse_part_and_step(part: bytes, step: bytes) -> tuple[int, float]:
    """Return the part id and the time step, which is 0 if it is truncated."""
    try:
        return int(part), float(step)
    except ValueError:
        return int(part), 0.0
