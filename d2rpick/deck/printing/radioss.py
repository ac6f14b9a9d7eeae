"""Radioss: engine files whose legs end at the switching times, with /RBODY/ON and /RBODY/OFF."""

from __future__ import annotations

import math
import re
from typing import TYPE_CHECKING, NamedTuple

from d2rpick.deck.printing.common import PHYSICS, PrintedCard, check_ids, check_windows, comments
from d2rpick.errors import DeckError
from d2rpick.version import __version__

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from d2rpick.deck.printing.common import Printing, Times

TITLE = "Radioss"
HISTORIES: tuple[str, ...] = ("radioss-th",)
SWITCHES = "node"
TAKES: tuple[str, ...] = ("step_cap", "end", "name")

_RUN_NAME = re.compile(r"[\w.-]+", re.ASCII)
_NODES_PER_LINE = 10
# Of the rigid window, per step: the release is at most a thousandth of it late.  Each window has its own, so that
# further windows leave the run up to them as it was.
_CAP_SHARE = 1000
_MOST_LEGS = 99  # the solver numbers them with two digits where it matters, in the names of time histories
_SOLVER = (
    "Ids are main nodes of /RBODY, not bodies; an unknown one is skipped silently.",
    "Gravity and damping act on a rigid body only if its main node is in their",
    "  node groups; no warning is given.",
    "The energy reported for rigid solids can be wrong until the release.",
    "The starter looks for /RBODY/OFF in the engine files; keep all of them.",
    "A body that the first file does not put off is rigid from time 0.",
    "The starter takes the nodes of an /RBODY from every /RWALL; Ikrem 1 keeps",
    "  them there while the body is off.",
    "An initial velocity must move the main node of a body too.",
    "Repeat your output keywords (/TFILE, /ANIM, ...) in every file.",
)


class EngineFile(NamedTuple):
    """An engine run: its number, its end, and its largest step where the bodies are rigid in it, else None."""

    number: int
    stop: float
    cap: float | None


def cards(windows: Sequence[Times], printing: Printing, remarks: Sequence[str] = ()) -> PrintedCard:
    """Print the engine files, a leg up to each switch and one to the end.

    The main nodes are those of /RBODY in the starter file, of bodies without sensor.  Without a cap the step is
    held below a thousandth of the rigid window while the bodies are rigid.

    Raises
    ------
    DeckError
        If windows do not follow each other, an id does not fit, or the run does not end after the last window.
    """
    windows, ids = check_windows(windows), check_ids(printing.node)
    name = printing.name
    if not _RUN_NAME.fullmatch(name):
        raise DeckError(f"the name of the run is {name!r}, letters, digits, '.', '_' and '-' were expected")
    if printing.end is None or not windows[-1][1] < printing.end < math.inf:
        found = "the end of the run is not given" if printing.end is None else f"the run ends at {printing.end:g}"
        raise DeckError(f"{found}, a time after td = {windows[-1][1]:g} was expected")
    files = {
        f"{name}_{leg.number:04d}.rad": "\n".join(_engine(leg, name, ids, printing.off)) + "\n"
        for leg in legs(windows, printing.end, printing.step_cap)
    }
    spans = ", ".join(f"{tr!r} to {td!r}" for tr, td in windows)
    head = comments([f"Rigid from {spans}; written by d2rpick {__version__}", *PHYSICS, *_SOLVER, *remarks])
    text = "".join(f"# {line}\n" for line in head)
    text += "".join(f"# ---- {file}\n{content}" for file, content in files.items())
    return PrintedCard(text, windows, files)


def legs(windows: Sequence[Times], end: float, step_cap: float | None) -> list[EngineFile]:
    """Give the engine runs that the windows ask for; a window from 0 on needs none before it."""
    caps = [step_cap or float(f"{(td - tr) / _CAP_SHARE:.2g}") for tr, td in windows]
    switches = zip(windows, caps, strict=True)
    stops = [(time, cap) for (tr, td), own in switches for time, cap in ((tr, None), (td, own)) if time > 0]
    if len(stops) >= _MOST_LEGS:
        raise DeckError(f"{len(windows)} windows need {len(stops) + 1} engine runs, at most {_MOST_LEGS} were expected")
    numbered = enumerate([*stops, (end, None)], start=1)
    return [EngineFile(number, stop, cap) for number, (stop, cap) in numbered]


def off(nodes: Sequence[int]) -> Iterator[str]:
    """Put rigid bodies off; the starter of OpenRadioss overlooks a second such block right behind the first."""
    if nodes:
        yield from ("/RBODY/OFF", *listed(nodes))


def listed(ids: Sequence[int]) -> Iterator[str]:
    """Write numbers in lines."""
    yield from (" ".join(map(str, ids[i : i + _NODES_PER_LINE])) for i in range(0, len(ids), _NODES_PER_LINE))


def _engine(leg: EngineFile, name: str, ids: Sequence[int], others: Sequence[int]) -> Iterator[str]:
    yield f"/RUN/{name}/{leg.number}"
    yield f"{leg.stop!r:>20}"
    if leg.cap is not None:
        yield from ("/RBODY/ON", *listed(ids))
    yield from off(others if leg.cap is not None else (*ids, *others))
    if leg.cap is not None:
        yield from ("# with nothing deformable left the step would grow without limit", "/DTIX")
        yield f"{leg.cap!r} {leg.cap!r}"
