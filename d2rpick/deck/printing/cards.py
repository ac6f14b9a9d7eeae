"""A switch window as solver input: what an analyst pastes, with the warnings that apply."""

from __future__ import annotations

import math
import re
import textwrap
from dataclasses import dataclass
from typing import TYPE_CHECKING

from d2rpick import __version__
from d2rpick.errors import DeckError

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

WIDTH = 10
_RUN_NAME = re.compile(r"[\w.-]+", re.ASCII)
_POINT = re.compile(r"\d\.\d")
_MOST_DIGITS = 17
_NODES_PER_LINE = 10
_COMMENT_WIDTH = 78
_CAP_SHARE = 1000  # of the rigid window, per step: the release is at most a thousandth of it late

_SET_HEAD = "$#   swset      code     time1     time2     time3     entno     relsw    paired"
_COUNT_HEAD = "$#    nrbf      ncsf       rwf     dtmax       d2r       r2d    offset"

_PHYSICS = (
    "The energy locked in at the first switch springs back at the second; the",
    "  kinetic energy of the vibration is lost without a trace in any energy.",
    "A switch comes at the first step at or after its time.",
    "Stresses of solids without a co-rotating frame do not turn with the rigid",
    "  body: after a large rotation they do not spring back as they should.",
    "A switched run is no reference to choose switching times by.",
)
_LS_DYNA = (
    "Nodal rigid bodies, spotwelds and rigid walls on these parts stay active",
    "  (NRBF, NCSF, RWF 0); where they are, delete them (1) and activate again (2).",
    "Springs and dampers are not switched.",
)
_UNCAPPED = (
    "DTMAX is 0: with nothing deformable left the step may grow without limit",
    "  and the second switch comes late; d2rpick card --step-cap cures it.",
)
_UNMERGED = ("Parts that share nodes must be merged into one rigid body (d2rpick card --merge).",)
_RADIOSS = (
    "Ids are main nodes of /RBODY, not bodies; an unknown one is skipped silently.",
    "Gravity and damping act on a rigid body only if its main node is in their",
    "  node groups; no warning is given.",
    "The energy reported for rigid solids can be wrong until the release.",
    "The starter looks for /RBODY/OFF in the engine files; keep all three.",
)


@dataclass(frozen=True)
class PrintedCard:
    """Solver input: ``tr`` and ``td`` are the times as printed, ``notes`` say where they are not those asked for."""

    text: str
    tr: float
    td: float
    notes: tuple[str, ...] = ()


def shortest(value: float, width: int = WIDTH) -> str:
    """Write a number in ``width`` columns so that it reads back, with as few characters as that takes.

    Where no text of that width reads back to the same double it is the nearest one that can be written.

    Examples
    --------
    >>> shortest(0.02), shortest(1e-7), shortest(0.0128853793630525), shortest(20.0)
    ('0.02', '1.0e-7', '.012885379', '20.0')
    """
    texts = {f"{value:.0f}", f"{value:.0f}."}
    for digits in range(1, _MOST_DIGITS + 1):
        fixed = f"{value:.{digits}f}"
        mantissa, _, exponent = f"{value:.{digits}e}".partition("e")
        texts |= {fixed, fixed.replace("0.", ".", 1) if abs(value) < 1 else fixed, f"{mantissa}e{int(exponent)}"}
        texts.add(f"{mantissa.replace('.', '')}e{int(exponent) - digits}")
    fitting = [text for text in texts if len(text) <= width]
    if not fitting:
        raise DeckError(f"{value:g} cannot be written in {width} columns, a number of ordinary size was expected")
    # exact before near, then with digits around a point, then short
    return min(fitting, key=lambda text: (abs(float(text) - value), not _POINT.search(text), len(text), text))


def ls_dyna(
    tr: float,
    td: float,
    parts: Sequence[int],
    *,
    merge: int | None = None,
    step_cap: float = 0.0,
    sets: tuple[int, int] = (901, 902),
    remarks: Sequence[str] = (),
) -> PrintedCard:
    """Two unpaired CODE 0 sets of *DEFORMABLE_TO_RIGID_AUTOMATIC; the times are printed in 10 columns.

    Parameters
    ----------
    tr, td : float
        Made rigid and switched back [time of the deck], 0 <= tr < td.
    parts : sequence of int
        Ids of the parts.
    merge : int, optional
        Lead part (LRB) all others are merged into; without it each part becomes a body of its own.
    step_cap : float
        DTMAX while rigid [time]; 0 leaves the step free.
    sets : pair of int
        Ids of the two switch sets, unused elsewhere in the deck.
    remarks : sequence of str
        Further comment lines.
    """
    tr = _check_times(tr, td)
    ids = _check_ids(parts)
    if sets[0] == sets[1]:
        raise DeckError(f"both switch sets are {sets[0]}, two different ids were expected")
    _check_ids([*sets, *([] if merge is None else [merge])])
    texts = shortest(tr), shortest(td)
    printed = float(texts[0]), float(texts[1])
    if printed[0] >= printed[1]:
        raise DeckError(f"tr and td are both {texts[0]} in {WIDTH} columns, different times were expected")
    notes = tuple(_roundings((tr, td), texts))
    comments = (*notes, *_ls_dyna_warnings(ids, merge, step_cap), *_one_line(remarks))
    lines = [
        f"$ Rigid from {texts[0]} to {texts[1]}; written by d2rpick {__version__}",
        *(f"$ {line}" for line in comments),
        *_header(sets[0], texts[0], shortest(step_cap), (len(ids), 0)),
        "$#     pid       lrb     ptype",
        *(f"{part:10d}{0 if merge is None or part == merge else merge:10d}      PART" for part in _led(ids, merge)),
        *_header(sets[1], texts[1], "0.0", (0, len(ids))),
        "$#     pid     ptype",
        *(f"{part:10d}      PART" for part in ids),
    ]
    return PrintedCard("\n".join(lines) + "\n", *printed, notes)


def radioss(
    tr: float,
    td: float,
    end: float,
    nodes: Sequence[int],
    *,
    name: str = "Root",
    step_cap: float | None = None,
    remarks: Sequence[str] = (),
) -> PrintedCard:
    """Blocks for the three engine files: off to tr, on to td, off to the end.

    Parameters
    ----------
    tr, td, end : float
        Made rigid, switched back, end of the run [time of the model].
    nodes : sequence of int
        Main nodes of the rigid bodies (/RBODY in the starter file, without sensor).
    name : str
        Run name.
    step_cap : float, optional
        Largest step while rigid (/DTIX) [time]; default a thousandth of the rigid window.
    remarks : sequence of str
        Further comment lines.
    """
    tr = _check_times(tr, td)
    if not _RUN_NAME.fullmatch(name):
        raise DeckError(f"the name of the run is {name!r}, letters, digits, '.', '_' and '-' were expected")
    if not td < end < math.inf:
        raise DeckError(f"the run ends at {end:g}, a time after td = {td:g} was expected")
    ids = _check_ids(nodes)
    listed = [" ".join(map(str, ids[i : i + _NODES_PER_LINE])) for i in range(0, len(ids), _NODES_PER_LINE)]
    cap = step_cap or float(f"{(td - tr) / _CAP_SHARE:.2g}")
    comments = [
        *_PHYSICS,
        *_RADIOSS,
        "Repeat your output keywords (/TFILE, /ANIM, ...) in every file.",
        *_one_line(remarks),
    ]
    lines = [
        f"# Rigid from {tr!r} to {td!r}; written by d2rpick {__version__}",
        *(f"# {line}" for line in comments),
    ]
    for leg, (stop, state) in enumerate(((tr, "OFF"), (td, "ON"), (end, "OFF")), start=1):
        lines += [f"# ---- {name}_{leg:04d}.rad", f"/RUN/{name}/{leg}", f"{stop!r:>20}", f"/RBODY/{state}", *listed]
        if state == "ON":
            lines += ["# with nothing deformable left the step would grow without limit", "/DTIX", f"{cap!r} {cap!r}"]
    return PrintedCard("\n".join(lines) + "\n", tr, td)


def _ls_dyna_warnings(ids: Sequence[int], merge: int | None, step_cap: float) -> Iterator[str]:
    yield from (*_PHYSICS, *_LS_DYNA)
    if not step_cap:
        yield from _UNCAPPED
    if merge is None and len(ids) > 1:
        yield from _UNMERGED
    elif merge is not None and merge not in ids:
        yield f"Part {merge} is the lead: it must be rigid already."


def _one_line(remarks: Sequence[str]) -> Iterator[str]:
    """Remarks that cannot leave their comment lines, which are as long as those of the cards."""
    for remark in remarks:
        yield from textwrap.wrap(remark, _COMMENT_WIDTH, subsequent_indent="  ", break_long_words=False)


def _header(swset: int, time: str, step_cap: str, counts: tuple[int, int]) -> Iterator[str]:
    yield "*DEFORMABLE_TO_RIGID_AUTOMATIC"
    yield _SET_HEAD
    yield f"{swset:10d}{0:10d}{time:>10s}{'0.0':>10s}{'0.0':>10s}{0:10d}{0:10d}{0:10d}"
    yield _COUNT_HEAD
    yield f"{0:10d}{0:10d}{0:10d}{step_cap:>10s}{counts[0]:10d}{counts[1]:10d}{'0.0':>10s}"


def _led(ids: Sequence[int], merge: int | None) -> list[int]:
    """Parts with their lead first."""
    return sorted(ids, key=lambda part: part != merge)


def _roundings(asked: tuple[float, float], texts: tuple[str, str]) -> Iterator[str]:
    for name, value, text in zip(("tr", "td"), asked, texts, strict=True):
        if float(text) != value:
            yield f"{name} is printed as {text}, {float(text) - value:+.1e} off {value!r}: nearest in {WIDTH} columns."


def _check_times(tr: float, td: float) -> float:
    """Return tr, without the sign of a negative zero."""
    if not 0 <= tr < td < math.inf:
        raise DeckError(f"tr is {tr:g} and td is {td:g}, 0 <= tr < td was expected")
    return tr + 0.0


def _check_ids(ids: Sequence[int]) -> list[int]:
    if not ids:
        raise DeckError("no part was given, at least one id was expected")
    for number in ids:
        if not 0 < number < 10**WIDTH:
            raise DeckError(f"id {number} does not fit, 1 to {10**WIDTH - 1} was expected")
    return list(dict.fromkeys(ids))
