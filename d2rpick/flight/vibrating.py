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
    inside = slice(*np.searchsorted(time, flight.within(history.time)).tolist())
    energy_in_flight = history.between(*flight.within(history.time))[1]
    if energy_in_flight.size == 0 or values[inside].size == 0:
        return Beside()
    ranges = np.ptp(values[inside], axis=0)
    notable = ranges > _HARDLY * float(np.ptp(energy_in_flight))
    return Beside(tuple(compress(not_chosen, notable)), float(ranges[notable].sum()))


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
    inside = slice(*np.searchsorted(kinetic.time, flight.within(history.time)).tolist())
    time = kinetic.time[inside]
    energy = kinetic.values[inside]
    if time.size < _FEWEST:
        return None
    since = time - time[0]
    rest = energy - np.polyval(np.polyfit(since, energy, 2), since)
    # The rounding errors of an energy that does not vibrate must not be read as modes.
    is_resolved = np.ptp(rest) > RESOLVED * float(np.abs(energy).max())
    return (time, rest) if is_resolved else None
