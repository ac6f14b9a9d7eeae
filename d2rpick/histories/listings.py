"""What solvers print beside the histories: which engine computed a run, what it took, the smallest steps of its parts.

Sources: the published source of OpenRadioss (radioss_title.F, rbyonf.F, or_build_info.py), its pull request 4538 and
its commit 780156a9a; ``CUMULATIVE CPU TIME SUMMARY`` of Radioss' engine listing (NAME_0001.out); the timing information
and the ``25 smallest timesteps`` of LS-DYNA's d3hsp; ``time per zone cycle`` and ``dt of cycle 24 is controlled by
solid 100449 of part 10`` of its glstat; listings of runs.
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
    from d2rpick.histories.run import Run

# Patterns are compiled where they are needed, by the functions of `re`: start-up.
_HISTORY: Final = r"(?s)(?P<root>.+)T(?P<leg>\d\d)(\.csv)?(\.gz)?"
_HEAD, _TAIL = (
    1 << 20,
    1 << 16,
)  # bytes: the engine echoes its input, and tells when it ran at the end
_SWITCHED: Final = rb"RIGID BODY: *\d+ +SET O(?:N|FF)"
_COMMIT: Final = rb"CommitID: *([0-9a-f]{7,40})\b"
_BUILT: Final = rb"COPYRIGHT \(C\) (?:\d{4}-)?(\d{4})"  # the year is that of the build
_RAN: Final = rb"EXECUTION (?:STARTED|COMPLETED) *[.:]+ *(\d{4})/(\d\d)/(\d\d)"
_FIXED: Final = (2026, 1, 13)
# Commits from the last weeks before the fix, which may have been built in its year.
_BEFORE: Final = (
    "49d9807 fe00fc0 ec1d512 76c61f5 52050b0 e28e42b 2b7ab50 6068aa2 0043df5 20f7b7f 0387857 c43d89c c36006f 670017c "
    "df5cc2b 047586b c3dff92 3844b9a 8751b9d f7fed09 cb26b37 062cdd8 e6f5601 ddf0b52 36f7b44 bcc1391 835210e 379fcb2 "
    "9e0e860 26e6573 0905ab7 96c6242 055fbad 9344188 cdf7934 49ecd10 eb51543 c2cb8fa 534623f 46f299a 8de64c8 43562a9 "
    "0260a03 d136353 7ca05a4 abdd714 0fd23b1 898ac63 9e2cfb1"
)
_SHORT: Final = 7  # digits of a commit


def wrong_energies(histories: Iterable[str]) -> Iterator[str]:
    """Name the listings of restarts whose engine reports a wrong internal energy, and how that is seen.

    OpenRadioss before its fix of January 2026 counts the energy of elements wrongly that /RBODY/ON or /RBODY/OFF of a
    restart switches.  Nothing is told where the listing does not show when the engine was built.
    """
    for name in histories:
        found = re.fullmatch(_HISTORY, name)
        if found and int(found["leg"]) > 1:
            listing = f"{found['root']}_{int(found['leg']):04d}.out"
            old = _before_the_fix(*_ends(listing))
            if old:
                yield f"{listing}: {old}"


WITH_AN_ERROR: Final = "with an error"
# What stands at the end of Radioss' engine listing, of LS-DYNA's messag and d3hsp.
_ENDINGS: Final = {
    b"ERROR TERMINATION": WITH_AN_ERROR,
    b"E r r o r   t e r m i n a t i o n": WITH_AN_ERROR,
    b"NORMAL TERMINATION": "normally",
    b"N o r m a l    t e r m i n a t i o n": "normally",
}
_STOPPED: Final = b"USER BREAK"


def ending(history: str) -> str | None:
    """Say how a run has ended, by the listing beside its last history; None where that does not say so.

    A leg that was told to stop has not ended the run, nor has one whose next leg lies there.
    """
    from pathlib import Path  # not above, nor below: start-up

    found = re.fullmatch(_HISTORY, history)
    if found is None:
        tails = [
            _ends(str(Path(history).parent / name))[1] for name in ("messag", "d3hsp")
        ]
    elif Path(f"{found['root']}_{int(found['leg']) + 1:04d}.rad").exists():
        return None
    else:
        tails = [_ends(f"{found['root']}_{int(found['leg']):04d}.out")[1]]
    said = (
        how
        for words, how in _ENDINGS.items()
        for tail in tails
        if words in tail and _STOPPED not in tail
    )
    return next(said, None)


def _ends(path: str) -> tuple[bytes, bytes]:
    """Give the beginning and the end of a file; nothing of one that cannot be read."""
    try:
        with open(path, "rb") as stream:  # noqa: PTH123  start-up
            head = stream.read(_HEAD)
            stream.seek(max(os.fstat(stream.fileno()).st_size - _TAIL, 0))
            return head, stream.read()
    except (OSError, ValueError):
        return b"", b""


def _before_the_fix(head: bytes, tail: bytes) -> str:
    """Say what shows that an engine that switches bodies is from before the fix; nothing where nothing does."""
    if b"OpenRadioss" not in head or not re.search(_SWITCHED, head):
        return ""
    commit, built, ran = (
        re.search(_COMMIT, head),
        re.search(_BUILT, head),
        re.search(_RAN, tail),
    )
    if commit and commit[1][:_SHORT].decode() in _BEFORE:
        return f"commit {commit[1].decode()[:9]}"
    if built and int(built[1]) < _FIXED[0]:
        return f"built in {int(built[1])}"
    if ran and tuple(map(int, ran.groups())) < _FIXED:
        return f"run on {b'-'.join(ran.groups()).decode()}"
    return ""


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
    found = (
        _of_radioss(path, data)
        if _SUMMARY in data
        else _of_d3hsp(path, data)
        if _TIMING in data
        else None
    )
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
    for line in re.finditer(_ZONE, _read(path)):
        if line[0].startswith(_PER_ZONE):
            pairs.append((time, float(line[1])))
        else:
            time = float(line[1])
    times = np.array(pairs, np.float64).reshape(-1, 2)
    times = times[times[:, 1] > 0]
    if not len(times):
        raise FormatError(
            f"{path}: no time per zone cycle above 0 was found, a glstat of LS-DYNA was expected"
        )
    return ZoneTimes(path, times[:, 0], times[:, 1] * 1e-9)


def is_glstat(path: str) -> bool:
    """Whether a file has times per zone cycle."""
    return b"time per zone cycle" in _read(path)


def _read(path: str) -> bytes:
    try:
        with open(path, "rb") as stream:  # noqa: PTH123
            return stream.read()
    except OSError as error:
        raise FormatError(
            f"{path}: cannot be read ({error.strerror}); check the name and the permissions"
        ) from None


def _of_radioss(name: str, data: bytes) -> Timing | None:
    summary = data[data.rindex(_SUMMARY) :]
    found = [
        re.search(one, summary)
        for one in (_RADIOSS_ELEMENTS, _RADIOSS_TOTAL, _RADIOSS_CYCLES)
    ]
    elements, total, cycles = (float(one[1]) if one else 0.0 for one in found)
    return Timing(name, int(cycles), total, elements)


def _of_d3hsp(name: str, data: bytes) -> Timing | None:
    """Take processor times, or times of the clock where those are rounded to nothing; less what came before the run."""
    table = data[data.rindex(_TIMING) :]
    cycles, total, elements = (
        re.search(one, table) for one in (_D3HSP_CYCLES, _D3HSP_TOTAL, _D3HSP_ELEMENTS)
    )
    if not (cycles and total and elements):
        return None
    column = 1 if float(elements[1]) > 0 else 3
    before = sum(float(row[column - 1]) for row in re.findall(_D3HSP_SETUP, table))
    return Timing(
        name, int(cycles[1]), float(total[column]) - before, float(elements[column])
    )


_STEP_NUMBER: Final = rb"([-+.\dEe]+)"
_STEP: Final = (
    rb"(?m)is controlled by +[\w ]*?\d+ +of part +(\d+)|^ time step\.+ +" + _STEP_NUMBER
)
_TABLE: Final = rb"smallest timesteps *\r?\n[^\n]*\n[^\n]*part +timestep *\r?\n((?:[^\n]*\n)*?) *(?:\n|\Z)"
_ROW: Final = rb"(?m)^ *[a-z][a-z ]* +\d+ +(\d+) +" + _STEP_NUMBER + rb"\s*$"
_SEARCHED: Final = (
    64 << 20
)  # bytes of a file that are searched: it begins with what matters
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
    for name, part, step in (
        *_of_glstat(run),
        *_smallest_of_d3hsp((*run.sources, *beside)),
    ):
        if step > 0 and (part not in found or step < found[part][0]):
            found[part] = step, name
    return found


def _of_glstat(run: Run) -> Iterator[tuple[str, int, float]]:
    """Pair the part that controls each cycle with the step printed below it."""
    for file in run.files:
        part: bytes | None = None
        for line in re.finditer(_STEP, file.data[:_SEARCHED]):
            if line[1]:
                part = line[1]
            elif part:
                yield ("glstat", *_pair(part, line[2]))
                part = None


def _smallest_of_d3hsp(names: Sequence[str]) -> Iterator[tuple[str, int, float]]:
    from pathlib import Path

    for folder in dict.fromkeys(Path(name).parent for name in names):
        path = folder / _D3HSP
        if not path.is_file():
            continue
        with path.open("rb") as stream:
            table = re.search(_TABLE, stream.read(_SEARCHED))
        if table:
            yield from (
                (_D3HSP, *_pair(*row.groups())) for row in re.finditer(_ROW, table[1])
            )


def _pair(part: bytes, step: bytes) -> tuple[int, float]:
    """Part and step; 0 for a number that is cut."""
    try:
        return int(part), float(step)
    except ValueError:
        return int(part), 0.0
