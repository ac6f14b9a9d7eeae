"""Find the parts of a switched run that are deformable again in a flight after the rigid windows.

The momenta of parts that a rigid body has absorbed are not written, so the flights of a switched run are those of the
whole model. If the momenta of the parts add up to that of the model throughout a flight, they show how the parts move
relative to each other, as in a reference run.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from d2rpick.base.memory import remember
from d2rpick.histories.history import Given
from d2rpick.histories.samples import find_window

if TYPE_CHECKING:
    from d2rpick.flight.flight import Flight
    from d2rpick.histories.history import History


@remember
def restore_parts(history: History, flight: Flight) -> tuple[History, Flight]:
    """Return the record and a flight of the whole model with the parts that move in it, if these are deformable.

    The record and the flight are returned unchanged if the flight already has parts, or if a rigid body has absorbed
    parts in one of its states. The momenta of the parts are those of the states around the flight in which no part is
    absorbed.
    """
    written = history.evidence.written
    if written is None or flight.parts is not None:
        return history, flight
    of_parts = next((momenta for momenta in written.momenta if momenta.parts), None)
    whole = next((momenta for momenta in written.momenta if not momenta.parts), None)
    if of_parts is None or of_parts.parts is None or whole is None:
        return history, flight
    # Imported here to keep start-up fast.
    from d2rpick.flight.momentum import find_complete_stretches

    inside = find_window(of_parts.time, *flight.within(of_parts.time))
    for states in find_complete_stretches(of_parts, whole):
        if states.start <= inside.start and inside.stop <= states.stop:
            deformable = replace(
                of_parts, time=of_parts.time[states], values=of_parts.values[states]
            )
            parts = tuple(of_parts.parts[i] for i in deformable.moving)
            evidence = Given(
                (deformable, whole), written.balance, written.masses, written=written
            )
            return replace(history, evidence=evidence), flight._replace(parts=parts)
    return history, flight
