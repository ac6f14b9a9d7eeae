"""What vibrates together with the chosen parts in a flight."""

from __future__ import annotations

from typing import TYPE_CHECKING

from d2rpick.base.caching import cached_property

if TYPE_CHECKING:
    from d2rpick.flight.flight import Flight
    from d2rpick.flight.vibrating import Beside
    from d2rpick.histories.history import History, Samples


class Together:
    """What vibrates together in a flight: whether its energy is all of what was chosen, and its kinetic energy."""

    def __init__(self, history: History, flight: Flight) -> None:
        self._history, self._flight = history, flight

    @cached_property
    def beside(self) -> Beside:
        """Parts that vibrate with the chosen ones and were not chosen."""
        from d2rpick.flight.vibrating import (
            find_vibrating_parts,
        )  # not above: an oscillator does without it

        return find_vibrating_parts(self._history, self._flight)

    @property
    def complete(self) -> bool:
        """Whether all that vibrates together was chosen."""
        return not self.beside.parts

    @property
    def kinetic(self) -> tuple[Samples, Samples] | None:
        """Kinetic energy of what vibrates together, at times in the flight; None if it is not written."""
        from d2rpick.flight.vibrating import (
            extract_kinetic_energy,
        )  # not above: an oscillator does without it

        return extract_kinetic_energy(self._history, self._flight)
