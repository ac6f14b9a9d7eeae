"""Later legs of a run that lie beside the files that were named."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from collections.abc import Sequence

# A name and the number of the leg behind it: runT01, binout0001, glstat02; the first leg may have none.
_NUMBERED: Final = re.compile(r"(.*?)(\d*)(\.gz)?", re.DOTALL)


def later_legs(names: Sequence[str]) -> list[str]:
    """Find the files beside these that are named alike but for a higher number at the end, and were not named."""
    found: list[str] = []
    for name in names:
        path = Path(name)
        stem, number = _split(path.name)
        try:
            beside = sorted(path.parent.iterdir())
        except OSError:
            continue
        found += [str(one) for one in beside if _split(one.name)[0] == stem and _split(one.name)[1] > number]
    named = {str(Path(name)) for name in names}
    return [name for name in dict.fromkeys(found) if name not in named]


def _split(name: str) -> tuple[str, int]:
    match = _NUMBERED.fullmatch(name)
    assert match is not None  # it matches any text
    return match[1], int(match[2] or 0)
