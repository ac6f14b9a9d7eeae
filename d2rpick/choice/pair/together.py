"""Find the parts that vibrate together with the chosen parts in a flight."""

from __future__ import annotations

from typing import TYPE_CHECKING

from d2rpick.base.caching import cached_property

if TYPE_CHECKING:
    from d2rpick.flight.flight import Flight
    from d2rpick.flight.vibrating import Beside
    from d2rpick.histories.history import History, Samples


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
