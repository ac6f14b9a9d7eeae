"""LS-DYNA: a pair of *DEFORMABLE_TO_RIGID_AUTOMATIC cards for each window."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING, Final

from d2rpick.deck.printing.common import (
    LONGEST,
    PHYSICS,
    PrintedCard,
    check_ids,
    check_windows,
    comments,
    shortest,
)
from d2rpick.errors import DeckError
from d2rpick.version import __version__

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from d2rpick.deck.printing.common import Printing, Times

TITLE = "LS-DYNA"
HISTORIES: tuple[str, ...] = ("glstat", "matsum", "binout")
SWITCHES = "part"
TAKES: tuple[str, ...] = ("merge", "swset", "step_cap")
FILE: Final = "switches.k"

_SET_HEAD = "$#   swset      code     time1     time2     time3     entno     relsw    paired"
_COUNT_HEAD = "$#    nrbf      ncsf       rwf     dtmax       d2r       r2d    offset"
_SOLVER = (
    "Nodal rigid bodies, spotwelds and rigid walls on these parts stay active",
    "  (NRBF, NCSF, RWF 0); where they are, delete them (1) and activate again (2).",
    "Springs and dampers are not switched.",
)
_UNCAPPED = (
    "DTMAX is 0: with nothing deformable left the time step may grow without",
    "  limit and the second switch come late; set d2rpick card --step-cap.",
)
_UNMERGED = ("Merge parts that share nodes (d2rpick card --merge), never loose ones.",)


def cards(windows: Sequence[Times], printing: Printing, remarks: Sequence[str] = ()) -> PrintedCard:
    """Print two unpaired CODE 0 sets for each window, their times in at most 9 characters.

    Raises
    ------
    DeckError
        If windows do not follow each other, as given or as printed, or an id does not fit.
    """
    windows, ids = check_windows(windows), check_ids(printing.part)
    sets = list(_sets(printing.swset, len(windows)))
    if printing.merge is not None:
        check_ids([printing.merge], LONGEST)  # stands right of an id, with a blank between them
    texts = [(shortest(tr), shortest(td)) for tr, td in windows]
    _check_printed([text for pair in texts for text in pair])
    notes = tuple(note for times, pair in zip(windows, texts, strict=True) for note in _roundings(times, pair))
    told = (*notes, *_warnings(ids, printing), *comments(remarks))
    spans = ", ".join(f"{tr} to {td}" for tr, td in texts)
    lines = [*comments([f"Rigid from {spans}; written by d2rpick {__version__}"]), *told]
    lines = [f"$ {line}" for line in lines]
    for pair, numbers in zip(texts, sets, strict=True):
        lines += _window(pair, numbers, ids, printing)
    text = "\n".join(lines) + "\n"
    return PrintedCard(text, tuple((float(tr), float(td)) for tr, td in texts), {FILE: text}, notes)


def _window(texts: tuple[str, str], sets: tuple[int, int], ids: Sequence[int], printing: Printing) -> Iterator[str]:
    leads = _leads(ids, printing)
    yield from _header(sets[0], texts[0], shortest(printing.step_cap or 0.0), (len(ids), 0))
    yield "$#     pid       lrb     ptype"
    for part in sorted(ids, key=lambda part: part in leads):  # those that lead first
        yield f"{part:10d}{leads.get(part, 0):10d}      PART"
    yield from _header(sets[1], texts[1], "0.0", (0, len(ids)))
    yield "$#     pid     ptype"
    for part in ids:
        yield f"{part:10d}      PART"


def _leads(ids: Sequence[int], printing: Printing) -> dict[int, int]:
    """Give the lead of each part that is merged into another."""
    if printing.merge is not None:
        return {part: printing.merge for part in ids if part != printing.merge}
    bodies = [[part for part in body if part in ids] for body in printing.bodies]
    return {part: body[0] for body in bodies for part in body[1:]}


def _header(swset: int, time: str, step_cap: str, counts: tuple[int, int]) -> Iterator[str]:
    yield "*DEFORMABLE_TO_RIGID_AUTOMATIC"
    yield _SET_HEAD
    yield f"{swset:10d}{0:10d}{time:>10s}{'0.0':>10s}{'0.0':>10s}{0:10d}{0:10d}{0:10d}"
    yield _COUNT_HEAD
    yield f"{0:10d}{0:10d}{0:10d}{step_cap:>10s}{counts[0]:10d}{counts[1]:10d}{'0.0':>10s}"


def _sets(first: tuple[int, int], count: int) -> Iterator[tuple[int, int]]:
    """Ids of the switch sets of each window, all different."""
    if first[0] == first[1]:
        raise DeckError(f"both switch sets are {first[0]}, two different ids were expected")
    above = max(first) + 1
    check_ids([*first, above + 2 * count])
    yield first
    yield from ((above + 2 * i, above + 2 * i + 1) for i in range(count - 1))


def _check_printed(texts: Sequence[str]) -> None:
    for one, other in pairwise(texts):
        if float(one) >= float(other):
            raise DeckError(
                f"two switching times are both {one} in {LONGEST} characters, different times were expected"
            )


def _roundings(asked: Times, texts: tuple[str, str]) -> Iterator[str]:
    for name, value, text in zip(("tr", "td"), asked, texts, strict=True):
        if float(text) != value:
            off = f"{float(text) - value:+.1e} off {value!r}"
            yield f"{name} is printed as {text}, {off}: nearest in {LONGEST} characters."


def _warnings(ids: Sequence[int], printing: Printing) -> Iterator[str]:
    yield from (*PHYSICS, *_SOLVER)
    if not printing.step_cap:
        yield from _UNCAPPED
    if printing.merge is None and printing.bodies:
        yield from (
            f"{len(body)} parts are one rigid body by the deck, led by part {body[0]} (LRB)."
            for body in printing.bodies
            if len(body) > 1
        )
    elif printing.merge is None and len(ids) > 1:
        yield from _UNMERGED
    elif printing.merge is not None and printing.merge not in ids:
        yield f"Part {printing.merge} is the lead: it must be rigid already."
