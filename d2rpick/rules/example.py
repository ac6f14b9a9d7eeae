"""Write the examples of the ``check`` rules: small LS-DYNA decks and Radioss runs, composed of fragments."""

from __future__ import annotations

from types import MappingProxyType
from typing import TYPE_CHECKING, Final

from d2rpick.base.tuples import NamedTuple
from d2rpick.deck.ls_dyna_columns import (
    SWITCH_COUNTS,
    SWITCH_TIMES,
    TO_DEFORMABLE,
    TO_RIGID,
)

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

MAIN_DECK: Final = "main.k"  # Default file name of an example deck.

HEAD = """\
*KEYWORD
*CONTROL_TERMINATION
       0.2
*DATABASE_GLSTAT
    0.0001
*DATABASE_MATSUM
    0.0001
"""
PARTS = """\
*PART
door
         1         1         1
*PART
frame
         2         1         1
"""
END = "*END\n"
GROUP: Final = "/GRNOD/PART/7\nbox\n         1\n"
_SHELL: Final = "/SHELL/1\n         1         1         2         3         4\n"
_BODY: Final = "/RBODY/1\nbox\n      1808         0         0         0                   0         7\n"
WINDOW: Final = (("0.02", "OFF"), ("0.09", "ON"), ("0.2", "OFF"))


class Example(NamedTuple):
    """An example deck called ``name``, with the files that it includes or that belong to the same run.

    ``history`` contains the arguments with which ``d2rpick replay``, or the command ``computed_by``, writes the energy
    history for the check. ``options`` contains further arguments of ``d2rpick check``. If ``stdin`` is True, the deck
    is read from standard input.
    """

    deck: str
    files: Mapping[str, str] = MappingProxyType({})
    history: str = ""
    options: str = ""
    stdin: bool = False
    name: str = MAIN_DECK
    computed_by: str = "replay"


def write_automatic_card(
    swset: int,
    time1: str,
    *,
    rigid: Sequence[str] = (),
    deformable: Sequence[str] = (),
    code: int = 0,
    pair: tuple[int, int] = (0, 0),
    counts: tuple[int, int] | None = None,
    delay: str = "0.0",
    contact: int = 0,
) -> str:
    """Return a *DEFORMABLE_TO_RIGID_AUTOMATIC card.

    ``pair`` contains RELSW and PAIRED. ``counts`` contains D2R and R2D for an example with wrong counts. ``delay`` is
    TIME3, and ``contact`` is ENTNO.
    """
    d2r, r2d = counts or (len(rigid), len(deformable))
    relsw, paired = pair
    lines = [
        "*DEFORMABLE_TO_RIGID_AUTOMATIC",
        "$    swset      code     time1     time2     time3     entno     relsw    paired",
        SWITCH_TIMES.write(
            SWSET=swset,
            CODE=code,
            TIME1=time1,
            TIME3=delay,
            ENTNO=contact,
            RELSW=relsw,
            PAIRED=paired,
        ),
        "$     nrbf      ncsf       rwf     dtmax       d2r       r2d    offset",
        SWITCH_COUNTS.write(RWF=0, D2R=d2r, R2D=r2d),
        *(
            TO_RIGID.write(PID=line, PTYPE="PART") if len(line) <= 10 else line
            for line in rigid
        ),
        *(TO_DEFORMABLE.write(PID=line, PTYPE="PART") for line in deformable),
    ]
    return "\n".join(lines) + "\n"


def write_contact(name: str) -> str:
    """Return a *CONTACT_AUTOMATIC card with the id 7, of the type ``name``."""
    zeros = f"{0:10d}" * 8 + "\n"
    return f"*CONTACT_AUTOMATIC_{name}_ID\n         7floor\n" + 3 * zeros


def make_deck(*cards: str) -> Example:
    """Return an example deck with two parts and the given cards."""
    return Example(HEAD + PARTS + "".join(cards) + END)


def make_window(tr: str, td: str, more: str = "") -> Example:
    """Return a deck that makes part 1 rigid at ``tr`` and deformable at ``td``, followed by the cards ``more``."""
    return make_deck(
        write_automatic_card(1, tr, rigid=["1"]),
        write_automatic_card(2, td, deformable=["1"]),
        more,
    )


def write_row(*fields: float | str, width: int = 10) -> str:
    """Return a line of a Radioss deck whose fields are right-aligned in columns of the given width."""
    return "".join(f"{field:>{width}}" for field in fields) + "\n"


def write_starter_deck(group: str = GROUP, more: str = "") -> str:
    """Return a starter deck with one part that is a rigid body on a node group, followed by the text ``more``."""
    head = "#RADIOSS STARTER\n/BEGIN\nbox\n      2022         0\n/TITLE\na box\n/PART/1\nbox\n         1         1\n"
    return f"{head}{_SHELL}{_BODY}{group}{more}/END\n"


def write_engine_files(
    *legs: tuple[str, str], cap: str = "1e-5 1e-5", node: str = "1808"
) -> dict[str, str]:
    """Return engine files with the given end times and /RBODY cards (ON, OFF or none), by file name."""
    files = {}
    for number, (stop, state) in enumerate(legs, start=1):
        limit = f"/DTIX\n{cap}\n" if state == "ON" and cap else ""
        switch = f"/RBODY/{state}\n{node}\n" if state else ""
        files[f"box_{number:04d}.rad"] = (
            f"/RUN/box/{number}\n{stop:>20}\n/VERS/2022\n{switch}{limit}"
        )
    return files


def make_run(files: dict[str, str], deck: str = "") -> Example:
    """Return an example that consists of a starter deck and its engine files."""
    return Example(deck or write_starter_deck(), files, name="box_0000.rad")
