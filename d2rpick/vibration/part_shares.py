"""What each part has of the mismatch between tr and td."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from d2rpick.vibration import measures

if TYPE_CHECKING:
    from collections.abc import Sequence

    from d2rpick.vibration.part_signs import SignedParts
    from d2rpick.vibration.swings import Swings

# The parts that are named together make up this much of the mismatch.
_MOST = 0.8


class PartMatch(NamedTuple):
    """One part: whether its deformation has the same sign at tr and td, and its share in the square of D.

    Both None where the part has no sign; ``reason`` says why.
    """

    name: str
    sign_match: bool | None
    share: float | None
    reason: str | None = None


def contributions(vibration: SignedParts | Swings, tr: float, td: float) -> tuple[PartMatch, ...]:
    """Give the match of each part, that with the largest share first, then those without a sign."""
    shares = np.bincount(vibration.owner, measures.mismatch_shares(vibration, tr, td)).tolist()
    same = np.bincount(vibration.owner, vibration.amplitudes(tr) * vibration.amplitudes(td)) >= 0
    matches = [PartMatch(*row) for row in zip(vibration.names, same.tolist(), shares, strict=True)]
    matches.sort(key=lambda one: -(one.share or 0.0))
    return (*matches, *(PartMatch(part.name, None, None, part.reason) for part in vibration.unsigned))


def main_contributors(matches: Sequence[PartMatch]) -> str:
    """Name the parts that contribute most.

    Examples
    --------
    >>> main_contributors([PartMatch("roof", False, 0.7), PartMatch("door", True, 0.25), PartMatch("seat", True, 0.05)])
    'roof 70 % (opposite sign), door 25 %'
    """
    named, sum_of_shares = [], 0.0
    for match in matches:
        if match.share is None or sum_of_shares >= _MOST:
            break
        named.append(f"{match.name} {match.share * 100:.0f} %{'' if match.sign_match else ' (opposite sign)'}")
        sum_of_shares += match.share
    return ", ".join(named)
