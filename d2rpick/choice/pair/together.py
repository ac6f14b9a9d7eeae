"""Find the parts that vibrate together with the chosen parts in a flight."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from d2rpick.base.caching import cached_property
from d2rpick.histories.formats import READERS

if TYPE_CHECKING:
    from d2rpick.flight.flight import Flight
    from d2rpick.flight.vibrating import Beside
    from d2rpick.histories.history import History, Samples


# Parts that the energy of a table must contain, because the verdict on a pair assumes it.
ASSUMED_PARTS: Final = (
    "the energy of the switched parts and of all parts that vibrate with them"
)


def rests_on_assumed_parts(history: History) -> bool:
    """Return True if nothing shows of which parts the energy is, because it is from a table or from no file."""
    is_of_solver = history.energy_format != "" and READERS[history.energy_format].solver
    return history.parts is None and not is_of_solver


class PartsTogether:
    """The parts that vibrate together in a flight, whether all of them were chosen, and their kinetic energy."""

    def __init__(self, history: History, flight: Flight) -> None:
        self._history, self._flight = history, flight

    @cached_property
    def not_chosen(self) -> Beside:
        """Parts that vibrate together with the chosen parts but were not chosen."""
        # Imported here to keep start-up fast.
        from d2rpick.flight.vibrating import (
            find_vibrating_parts,
        )

        return find_vibrating_parts(self._history, self._flight)

    @property
    def complete(self) -> bool:
        """True if all parts that vibrate together were chosen."""
        return not self.not_chosen.parts

    @property
    def kinetic(self) -> tuple[Samples, Samples] | None:
        """Times in the flight and kinetic energies of the parts that vibrate together; None if not written."""
        # Imported here to keep start-up fast.
        from d2rpick.flight.vibrating import (
            extract_kinetic_energy,
        )

        return extract_kinetic_energy(self._history, self._flight)
