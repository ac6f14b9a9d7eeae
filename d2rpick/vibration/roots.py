"""The one bracketing root finder: halves every bracket at once, and takes Newton's steps where a slope is known."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from d2rpick.histories.history import Samples

# Of a time: a place that moves by less has been found, but for rounding.
_STILL: Final = 8 * float(np.finfo(np.float64).eps)
HALVINGS: Final = 50  # to rounding


class Roots(NamedTuple):
    """What is left of the brackets: ``within`` on the side that was asked about, ``beyond`` on the other, ``at``."""

    within: Samples
    beyond: Samples
    at: Samples


def narrow(
    inside: Callable[[Samples], Samples | NDArray[np.bool_]],
    within: Samples,
    beyond: Samples,
    *,
    slope: Callable[[Samples], Samples] | None = None,
    steps: int = HALVINGS,
) -> Roots:
    """Narrow brackets about the places where ``inside`` turns from positive to not.

    Parameters
    ----------
    inside : callable
        Positive at ``within`` and not at ``beyond``, an array for an array; true and false serve too.
    within, beyond : array
        Ends of the brackets, in either order.
    slope : callable, optional
        Derivative of ``inside``, which is then a smooth function: Newton's steps are taken where they stay inside of
        their bracket, and each place stays once it hardly moves, whatever other places are looked for beside it.
    steps : int
        At most.

    Examples
    --------
    >>> found = narrow(lambda t: 2 - t**2, np.array([0.0]), np.array([2.0]), slope=lambda t: -2 * t)
    >>> f"{found.at[0]:.12f}"
    '1.414213562373'
    """
    at, still = (within + beyond) / 2, np.zeros(np.shape(within), dtype=bool)
    for _ in range(steps):
        value = inside(at)
        good = value > 0
        within, beyond = np.where(good, at, within), np.where(good, beyond, at)
        following = (within + beyond) / 2
        if slope is not None:
            rise = slope(at)
            newton = at - value / np.where(rise == 0, np.inf, rise)
            inner = (newton >= np.minimum(within, beyond)) & (newton <= np.maximum(within, beyond))
            following = np.where(inner, newton, following)
            following = np.where(still, at, following)
            still |= np.abs(following - at) <= _STILL * np.abs(at)
        at = following
        if still.all():
            break
    return Roots(within, beyond, at)
