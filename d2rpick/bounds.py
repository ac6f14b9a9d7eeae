"""How much a file may ask for: more than any history or deck needs, less than what a hostile one takes.

Each bound can be set by an environment variable, ``D2RPICK_MAX_`` and its name.
"""

from __future__ import annotations

import os
from typing import Final, Protocol

from d2rpick.errors import D2RPickError


class Searched(Protocol):
    """Bytes in which something can be looked for."""

    def __len__(self) -> int: ...

    def rfind(self, wanted: bytes, begin: int, end: int, /) -> int:
        """Place of the last ``wanted`` there, -1 where there is none."""


# The largest value of each, and what it counts.
_BOUNDS: Final = {
    "RATIO": (100.0, "times as many bytes"),  # histories become 3 to 30 times as many
    "UNPACKED": (4e9, "bytes"),  # they are held in memory
    "LINE": (1e6, "bytes"),  # some 50,000 columns
    "DEPTH": (100.0, "groups"),
}
# Constant columns pack a thousandfold: the ratio counts only above so many bytes, which take no time and little memory.
_ALLOWED: Final = 1 << 24


def bound(name: str) -> float:
    """Largest value that is allowed; D2RPickError where the environment sets one that is no number above 0."""
    variable = f"D2RPICK_MAX_{name}"
    text = os.environ.get(variable)
    try:
        value = _BOUNDS[name][0] if text is None else float(text)
    except ValueError:
        value = 0.0
    if not value > 0:
        raise D2RPickError(f"{variable} is {text!r}, a number above 0 was expected; correct it or leave it out")
    return value


def beyond(name: str, value: float = float("inf")) -> str:
    """Say by what a value is above its bound, and what to do; nothing where it is not.

    Examples
    --------
    >>> beyond("DEPTH", 101), beyond("DEPTH", 100)
    ('more than 100 groups; is the file damaged? Copy it again, or set D2RPICK_MAX_DEPTH higher', '')
    """
    most = bound(name)
    if value <= most:
        return ""
    what = f"more than {most:,.10g} {_BOUNDS[name][1]}"
    return f"{what}; is the file damaged? Copy it again, or set D2RPICK_MAX_{name} higher"


def unpacked_beyond(packed: int, unpacked: int) -> str:
    """Say the same of data of so many bytes that become so many."""
    ratio = unpacked / max(packed, 1) if unpacked > _ALLOWED else 0.0
    return beyond("UNPACKED", unpacked) or beyond("RATIO", ratio)


def long_line(data: bytes | Searched) -> int:
    r"""Where a line beyond the bound begins, -1 where there is none; of the others little is looked at.

    Examples
    --------
    >>> long_line(b"ab\n" * 9), long_line(b"ab\n" + bytes(1_000_001))
    (-1, 3)
    """
    begin, most = 0, int(min(bound("LINE"), len(data)))
    while begin + most < len(data):
        end = data.rfind(b"\n", begin, begin + most + 1) + 1
        if not end:
            return begin
        begin = end
    return -1
