"""Why a tr is not acceptable: each reason for all candidates of a td at once, its sentence only where one is shown."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from d2rpick.choice.warnings import end_of_flight, end_of_load
from d2rpick.histories.digits import above, first_as_read
from d2rpick.vibration.measures import column_of

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from d2rpick.choice.situation import Situation
    from d2rpick.histories.history import Samples


class Objection(NamedTuple):
    """A reason and the candidates that it ``holds`` for, of shape (n,).

    ``error`` (n,) and the ``limit`` that it is above where the reason names them, the error as {}.
    """

    holds: NDArray[np.bool_]
    reason: str
    error: Samples | None = None
    limit: float = 0.0

    def sentence(self, place: int) -> str:
        """Say it of the candidate at a place."""
        return self.reason if self.error is None else self.reason.format(above(self.error[place], self.limit))


def objections(
    situation: Situation, tr: Samples, known: NDArray[np.object_], energy: Samples, level_error: Samples
) -> Iterator[Objection]:
    """Give every reason against some of the candidates.

    Parameters
    ----------
    situation : Situation
    tr : array of shape (n,)
        [time]
    known : array of shape (n,)
        `Measured` of each, None where it cannot be compared with td.
    energy : array of shape (n,)
        [energy]
    level_error : array of shape (n,)
        NaN where an energy is not positive [-].
    """
    everywhere = np.ones(tr.size, dtype=bool)
    earliest, vibration = situation.earliest_tr, situation.vibration
    if earliest is None:
        yield Objection(everywhere, situation.flight.refusal or "unknown: nothing shows when the load is over")
    else:
        yield Objection(tr < first_as_read(earliest), f"before {end_of_load(situation)}")
    yield from (Objection(everywhere, reason) for reason in against_td(situation))
    if situation.at_rest:
        return
    compared = known.astype(bool)
    described = compared | bool(vibration.unknown)
    same_sign = column_of(known, "sign_match") != 0
    yield Objection(~described, vibration.undescribed)
    yield Objection(~same_sign, "opposite sign of the deformation")
    error, judged = np.where(compared, column_of(known, "lock_in_error"), level_error), described & same_sign
    yield Objection(judged & np.isnan(error), "the energy is not positive here, so there is nothing to compare")
    tolerance = situation.settings.tolerance
    yield Objection(judged & (error > tolerance), f"error {{}} above the tolerance {tolerance:g}", error, tolerance)
    if situation.basis == "energy" and situation.td <= situation.latest_td:  # beyond, the flight tells nothing of it
        yield from _above_the_reference(situation, energy)


def _above_the_reference(situation: Situation, energy: Samples) -> Iterator[Objection]:
    """Object where more energy would come back after td than the reference has."""
    from d2rpick.choice.expectation import MOST_KEPT, means_of  # not above: an oscillator does without it

    means = means_of(situation)
    if means:
        found = "the mean energy after td is expected to be {} times that of the reference, more than"
        kept = means.ratio(energy)
        yield Objection(energy > means.most, f"{found} {MOST_KEPT:g} times", kept, MOST_KEPT)


def against_td(situation: Situation) -> Iterator[str]:
    """Why no tr at all is acceptable at this td."""
    if situation.td > situation.latest_td:
        yield f"td after {end_of_flight(situation)}"
    if situation.settings.strict and not situation.flight.certain:
        yield "the flight was found from the energy alone, which is not certain"
    yield from situation.vibration.doubts
