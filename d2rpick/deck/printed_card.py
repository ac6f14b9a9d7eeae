"""What the cards of all solvers share: what is asked for, what comes out, and how a number fits its columns."""

from __future__ import annotations

import math
import re
import textwrap
from dataclasses import dataclass, field
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

from d2rpick.base.errors import DeckError, printable

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, Sequence

Times = tuple[float, float]
"""A rigid window (tr, td) [time of the model]."""

WIDTH = 10  # columns of a field
LONGEST = WIDTH - 1  # of a number: a blank stays between it and its neighbour
_POINT = re.compile(r"\d\.\d")
_MOST_DIGITS = 17
_COMMENT_WIDTH = 78

PHYSICS = (
    "The energy locked in at the first switch springs back at the second; the",
    "  kinetic energy of the vibration is lost without a trace in any energy.",
    "A switch comes at the first step at or after its time.",
    "Stresses of solids without a co-rotating frame do not turn with the rigid",
    "  body: after a large rotation they do not spring back as they should.",
    "Do not choose switching times from the energy of a switched run.",
)


class Printing(NamedTuple):
    """What a card needs to say besides its times; a solver takes what its ``takes`` names.

    Attributes
    ----------
    part : tuple of int
        Ids of the parts to switch.
    node : tuple of int
        Main nodes of the rigid bodies to be switched, for solvers that switch these.
    off : tuple of int
        Main nodes of further rigid bodies, which stay off in all legs.
    merge : int, optional
        Lead part that all others are merged into; without it each part becomes a body of its own.
    bodies : tuple of tuple of int, optional
        Parts that become one rigid body each; without ``merge`` those of a body are merged into its first.
    swset : pair of int
        Ids of the two switch sets of the first window; those of further windows follow the larger one.
    step_cap : float, optional
        Largest time step while rigid [time].
    end : float, optional
        End of the run [time].
    name : str
        Name of the run.
    starter : str
        Cards that the starter deck of the run lacks.
    sensor : int
        First id of sensors, where these switch.
    contact, wall : int, optional
        The contact, or the rigid wall, whose force switches, for solvers that take one.
    pushed : tuple of (float, float)
        When something pushes the parts, by a history [time]; ``speed`` is how fast they come to it [length/time].
    delete_nodal_bodies, delete_node_sets : bool
        LS-DYNA: delete nodal rigid bodies (NRBF), or joints and extra nodes (NCSF), while the parts are rigid.
    replaced : tuple of int
        Main nodes of bodies that the new ones take the place of.
    """

    part: tuple[int, ...] = ()
    node: tuple[int, ...] = ()
    off: tuple[int, ...] = ()
    merge: int | None = None
    bodies: tuple[tuple[int, ...], ...] = ()
    swset: tuple[int, int] = (901, 902)
    step_cap: float | None = None
    end: float | None = None
    name: str = "Root"
    starter: str = ""
    sensor: int = 901
    delete_nodal_bodies: bool = False
    delete_node_sets: bool = False
    contact: int | None = None
    wall: int | None = None
    pushed: tuple[Times, ...] = ()
    speed: float | None = None
    replaced: tuple[int, ...] = ()


@dataclass(frozen=True)
class PrintedCard:
    """Solver input: ``text`` is all of it, ``files`` the same by the names that the solver expects.

    ``windows`` are the times as printed, ``notes`` say where they are not those asked for.  ``starter`` are cards that
    go into the starter deck, before its ``/END``, and ``sensors`` are those that switch bodies, by main node.
    """

    text: str
    windows: tuple[Times, ...]
    files: Mapping[str, str] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    starter: str = ""
    sensors: Mapping[int, int] = field(default_factory=dict)


class Solver(NamedTuple):
    """A solver whose input can be printed.

    ``title`` is what people call it; ``histories`` are formats that it alone writes; ``switches`` is the field of
    `Printing` that says whom it switches, ``takes`` are further ones; ``cards`` prints windows that follow each other,
    with remarks as comments.
    """

    title: str
    histories: tuple[str, ...]
    switches: str
    takes: tuple[str, ...]
    cards: Callable[[Sequence[Times], Printing, Sequence[str]], PrintedCard]


def shortest(value: float, width: int = LONGEST) -> str:
    """Write a number in ``width`` characters so that it reads back, with as few of them as that takes.

    Where no text of that width reads back to the same double it is the nearest one that can be written.

    Examples
    --------
    >>> shortest(0.02), shortest(1e-7), shortest(0.0128853793630525), shortest(20.0)
    ('0.02', '1.0e-7', '.01288538', '20.0')
    """
    texts = {f"{value:.0f}", f"{value:.0f}."}
    for digits in range(1, _MOST_DIGITS + 1):
        fixed = f"{value:.{digits}f}"
        mantissa, _, exponent = f"{value:.{digits}e}".partition("e")
        texts |= {
            fixed,
            fixed.replace("0.", ".", 1) if abs(value) < 1 else fixed,
            f"{mantissa}e{int(exponent)}",
        }
        texts.add(f"{mantissa.replace('.', '')}e{int(exponent) - digits}")
    fitting = [text for text in texts if len(text) <= width]
    if not fitting:
        raise DeckError(
            f"{value:g} cannot be written in {width} columns, a number that fits was expected"
        )
    # exact before near, then with digits around a point, then short
    return min(
        fitting,
        key=lambda text: (
            abs(float(text) - value),
            not _POINT.search(text),
            len(text),
            text,
        ),
    )


def comments(remarks: Sequence[str]) -> Iterator[str]:
    """Remarks that cannot leave their comment lines, which are as long as those of the cards."""
    for remark in remarks:
        yield from textwrap.wrap(
            printable(remark),
            _COMMENT_WIDTH,
            subsequent_indent="  ",
            break_long_words=False,
        )


def check_windows(windows: Sequence[Times]) -> tuple[Times, ...]:
    """Return the windows, without the sign of a negative zero; DeckError unless they follow each other."""
    if not windows:
        raise DeckError("no window was given, at least one tr and td were expected")
    for tr, td in windows:
        if not 0 <= tr < td < math.inf:
            raise DeckError(f"tr is {tr:g} and td is {td:g}, 0 <= tr < td was expected")
    for (tr, td), (later, end) in pairwise(windows):
        if not later > td:
            what = "lies before" if end <= tr else "overlaps or touches"
            found = f"the window {later:g} to {end:g} {what} the one given before it, {tr:g} to {td:g}"
            raise DeckError(
                f"{found}; windows of a part in the order of time were expected, apart from each other"
            )
    return tuple((tr + 0.0, td) for tr, td in windows)


def check_ids(ids: Sequence[int], digits: int = WIDTH) -> list[int]:
    """Return ids that fit ``digits`` columns, each once; DeckError for any other, and for none at all."""
    if not ids:
        raise DeckError(
            "no id was given of what is switched, at least one was expected"
        )
    for number in ids:
        if not 0 < number < 10**digits:
            raise DeckError(
                f"id {number} does not fit, 1 to {10**digits - 1} was expected"
            )
    return list(dict.fromkeys(ids))
