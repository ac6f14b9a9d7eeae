"""Pieces that the examples of the rules are put together from."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Sequence

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


def automatic(
    swset: int,
    time1: str,
    *,
    rigid: Sequence[str] = (),
    deformable: Sequence[str] = (),
    code: int = 0,
    pair: tuple[int, int] = (0, 0),
    counts: tuple[int, int] | None = None,
) -> str:
    """Write a card; ``pair`` is RELSW and PAIRED, ``counts`` D2R and R2D where they are to be wrong."""
    d2r, r2d = counts or (len(rigid), len(deformable))
    relsw, paired = pair
    lines = [
        "*DEFORMABLE_TO_RIGID_AUTOMATIC",
        "$    swset      code     time1     time2     time3     entno     relsw    paired",
        f"{swset:10d}{code:10d}{time1:>10s}       0.0       0.0         0{relsw:10d}{paired:10d}",
        "$     nrbf      ncsf       rwf     dtmax       d2r       r2d    offset",
        f"         0         0         0       0.0{d2r:10d}{r2d:10d}       0.0",
        *(f"{line:>10s}         0      PART" if len(line) <= 10 else line for line in rigid),
        *(f"{line:>10s}      PART" for line in deformable),
    ]
    return "\n".join(lines) + "\n"


THERE = automatic(1, "0.02", rigid=["1"])
BACK = automatic(2, "0.09", deformable=["1"])
END = "*END\n"
GOOD = HEAD + PARTS + THERE + BACK + END
