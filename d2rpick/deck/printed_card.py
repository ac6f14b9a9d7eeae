"""Define what the cards of all solvers share: card options, the printed card, and the number format."""

from __future__ import annotations

import math
import re
import textwrap
from dataclasses import field
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

from d2rpick.base.data_classes import dataclass
from d2rpick.base.errors import DeckError, make_printable

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, Sequence

    from d2rpick.base.spans import Times


WIDTH = 10  # Width of a field [characters].
# Largest number of characters of a number; a space separates it from the next field.
LONGEST = WIDTH - 1
_POINT = re.compile(r"\d\.\d")
_MOST_DIGITS = 17
_COMMENT_WIDTH = 78

PHYSICS = (
    "The strain energy frozen at the first switch is released at the second. The",
    "  kinetic energy of the vibration is lost; no energy output shows this loss.",
    "A switch takes place at the first time step at or after its time.",
    "Stresses of solids without a co-rotational stress update do not rotate with",
    "  the rigid body. After a large rotation their springback is wrong.",
    "Do not choose new times for a window from a run that is rigid in it.",
)


class Printing(NamedTuple):
    """Options of a card besides its times; each solver uses the options listed in ``Solver.takes``.

    Attributes
    ----------
    solver : str, optional
        A key of `SOLVERS`; the default is the solver that wrote the history or, if this is unknown, LS-DYNA.
    part : tuple of int
        Ids of the parts to switch.
    node : tuple of int
        Main nodes of the rigid bodies to switch, for solvers that switch bodies.
    off : tuple of int
        Main nodes of further rigid bodies, which stay inactive in all engine runs.
    merge : int, optional
        Lead part into which all others are merged; if it is None, each part becomes a separate rigid body.
    bodies : tuple of tuple of int, optional
        Parts of each rigid body; if ``merge`` is None, they are merged into the first part of their body.
    swset : pair of int
        Ids of the two switch sets of the first window; further windows use the ids above the larger one.
    step_cap : float, optional
        Largest time step while rigid [time].
    end : float, optional
        End of the run [time].
    name : str
        Name of the run.
    starter : str
        Cards to be added to the starter deck of the run.
    sensor : int
        Id of the first sensor, if sensors switch the bodies.
    contact, wall : int, optional
        Id of the contact, or of the rigid wall, whose force switches.
    pushed : tuple of (float, float)
        Spans in which a contact force acts on the parts in a history [time].
    speed : float, optional
        Speed at which the parts approach the contact [length/time].
    delete_nodal_bodies, delete_node_sets : bool
        For LS-DYNA, delete nodal rigid bodies and generalized welds (NRBF), or other constraints (NCSF), while the
        parts are rigid.
    parting, kept_joints : tuple of str
        For LS-DYNA, the deleted constraints and the active joints that connect separate rigid bodies, as text.
    replaced : tuple of int
        Main nodes of the bodies that new bodies replace.
    """

    solver: str | None = None
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
    parting: tuple[str, ...] = ()
    kept_joints: tuple[str, ...] = ()
    contact: int | None = None
    wall: int | None = None
    pushed: tuple[Times, ...] = ()
    speed: float | None = None
    replaced: tuple[int, ...] = ()


@dataclass(frozen=True)
class PrintedCard:
    """Solver input: all of it as ``text``, and split into ``files`` under the file names that the solver expects.

    ``windows`` are the times as printed, ``notes`` report times that differ from the given times. ``starter`` are cards
    for the starter deck, before its ``/END``. ``sensors`` are the ids of the sensors that switch bodies, by main node.
    ``fewest_cycles`` is the smallest number of cycles of a run whose time-step limit applies throughout, as with
    sensors; otherwise None.
    """

    text: str
    windows: tuple[Times, ...]
    files: Mapping[str, str] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    starter: str = ""
    sensors: Mapping[int, int] = field(default_factory=dict)
    fewest_cycles: int | None = None

    @property
    def has_engine_files(self) -> bool:
        """True if the input consists of Radioss engine files, which no deck includes."""
        return any(name.endswith(".rad") for name in self.files)


class CardSolver(NamedTuple):
    """A solver whose input d2rpick can print.

    ``title`` is its name, and ``histories`` contains the formats that only this solver writes. ``switches`` is the
    field of `Printing` that lists what the solver switches (parts or main nodes), and ``takes`` contains the further
    fields that it uses. ``cards`` prints consecutive windows, with remarks as comments.
    """

    title: str
    histories: tuple[str, ...]
    switches: str
    takes: tuple[str, ...]
    cards: Callable[[Sequence[Times], Printing, Sequence[str]], PrintedCard]


def write_number(value: float, width: int = LONGEST) -> str:
    """Return the shortest text of at most ``width`` characters that the solver reads back as the number.

    If there is no such text, the text that reads back as the nearest number is returned.

    Examples
    --------
    >>> write_number(0.02), write_number(1e-7), write_number(0.0128853793630525), write_number(20.0)
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
            f"{value:g} cannot be written in {width} columns; give a number that fits"
        )
    # An exact representation comes first, then one with digits on both sides of the decimal point, then a short one.
    return min(
        fitting,
        key=lambda text: (
            abs(float(text) - value),
            not _POINT.search(text),
            len(text),
            text,
        ),
    )


def write_comments(remarks: Sequence[str]) -> Iterator[str]:
    """Yield remarks as lines short enough for the comment lines of a card."""
    for remark in remarks:
        yield from textwrap.wrap(
            make_printable(remark),
            _COMMENT_WIDTH,
            subsequent_indent="  ",
            break_long_words=False,
        )


def refuse_overlapping_windows(windows: Sequence[Times]) -> tuple[Times, ...]:
    """Return the windows with 0.0 in place of -0.0; raise DeckError unless each begins after the previous window."""
    if not windows:
        raise DeckError("no window was given, expected at least one tr and td")
    for tr, td in windows:
        if tr == td:
            raise DeckError(f"tr and td are both {tr:g}; give a td after tr")
        if tr < 0:
            raise DeckError(
                f"tr is {tr:g}, before the start of the run; give a tr from 0"
            )
        if not tr < td < math.inf:
            raise DeckError(
                f"tr is {tr:g} and td is {td:g}, but tr < td was expected; give the earlier time as tr"
            )
    for (tr, td), (later, end) in pairwise(windows):
        if not later > td:
            relation = "lies before" if end <= tr else "overlaps or touches"
            problem = f"the window {later:g} to {end:g} {relation} the one given before it, {tr:g} to {td:g}"
            raise DeckError(
                f"{problem}; give windows in the order of time that do not overlap"
            )
    return tuple((tr + 0.0, td) for tr, td in windows)


def check_ids(ids: Sequence[int], digits: int = WIDTH) -> list[int]:
    """Return the distinct ids; raise DeckError if there are none, or if an id needs more than ``digits`` columns."""
    if not ids:
        raise DeckError(
            "no id of a part or body to switch was given, expected at least one"
        )
    for number in ids:
        if not 0 < number < 10**digits:
            raise DeckError(
                f"id {number} does not fit (expected 1 to {10**digits - 1})"
            )
    return list(dict.fromkeys(ids))
