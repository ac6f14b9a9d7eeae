"""Find the parts that vibrate together with the chosen parts in a flight, and their kinetic energy."""

from __future__ import annotations

from itertools import compress
from typing import TYPE_CHECKING, Final

import numpy as np

from d2rpick.base.tuples import NamedTuple
from d2rpick.histories.table_parts import CHOSEN_ENERGY

if TYPE_CHECKING:
    from d2rpick.flight.flight import Flight
    from d2rpick.histories.history import History, Samples
    from d2rpick.histories.names import Part

# Smallest energy variation of other vibrating parts, relative to the energy range of the chosen parts [-].
_HARDLY: Final = 0.02
# Smallest number of states from which a fall and a vibration can be separated.
_FEWEST: Final = 16


class Beside(NamedTuple):
    """Parts that vibrate with the chosen parts but were not chosen; ``energy`` is their energy range [energy]."""

    parts: tuple[Part, ...] = ()
    energy: float = 0.0


def find_vibrating_parts(history: History, flight: Flight) -> Beside:
    """Find the parts that vibrate together with the chosen parts, but were not chosen.

    Parameters
    ----------
    history : History
    flight : Flight
        Flight with all parts that fly together; if neither the flight nor a table names parts, the result is empty.
    """
    not_chosen = _list_parts_not_chosen(history, flight)
    energies = history.evidence.internal_energies(not_chosen) if not_chosen else None
    if energies is None:
        return Beside()
    time, values = energies
    start, end = flight.within(history.time)
    first, stop = np.searchsorted(time, (start, end)).tolist()
    energies_of_others = values[first:stop]
    _, energy_in_flight = history.between(start, end)
    if energy_in_flight.size == 0 or energies_of_others.size == 0:
        return Beside()
    ranges = np.ptp(energies_of_others, axis=0)
    is_notable = ranges > _HARDLY * float(np.ptp(energy_in_flight))
    parts = tuple(compress(not_chosen, is_notable))
    return Beside(parts, float(ranges[is_notable].sum()))


def _list_parts_not_chosen(history: History, flight: Flight) -> tuple[Part, ...]:
    """Return the parts that fly with the chosen parts but were not chosen, or the parts that a table omits."""
    if history.parts is None:
        # A sum of several columns, or another column, may contain the energies of the parts that were left out.
        is_of_chosen = history.channel == CHOSEN_ENERGY
        return history.evidence.not_chosen if is_of_chosen else ()
    if flight.parts is None:
        return ()
    chosen = {part.id for part in history.parts}
    return tuple(part for part in flight.parts if part.id not in chosen)


def extract_kinetic_energy(
    history: History, flight: Flight
) -> tuple[Samples, Samples] | None:
    """Return the kinetic energy of all parts that vibrate together in the flight, without the energy of their fall.

    Parameters
    ----------
    history : History
    flight : Flight

    Returns
    -------
    time, energy : array of shape (n,), or None
        States in the flight [time], [energy]; None if no file contains this energy, or if it contains only the fall.

    Notes
    -----
    Under constant gravity, the kinetic energy of the centre of mass is a quadratic function of time; damping changes it
    only slowly. Neither causes a spectral line.
    """
    # Imported here to keep start-up fast.
    from d2rpick.vibration.hidden_energy import RESOLVED

    kinetic = history.evidence.kinetic_energy(flight.parts)
    if kinetic is None:
        return None
    ends = flight.within(history.time)
    first, stop = np.searchsorted(kinetic.time, ends).tolist()
    time = kinetic.time[first:stop]
    energy = kinetic.values[first:stop]
    if time.size < _FEWEST:
        return None
    since_start = time - time[0]
    parabola = np.polyfit(since_start, energy, 2)
    vibrating = energy - np.polyval(parabola, since_start)
    # The rounding errors of an energy that does not vibrate must not be read as modes.
    is_resolved = np.ptp(vibrating) > RESOLVED * float(np.abs(energy).max())
    return (time, vibrating) if is_resolved else None
