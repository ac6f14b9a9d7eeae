"""What history, deck and solver say about each part: mass, time step, energy and motion in the flights."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from d2rpick.base.errors import FormatError, if_written
from d2rpick.choice.flights import bounds, flights_of
from d2rpick.flight.flying_parts import deformable_parts, flying_together
from d2rpick.histories.opening import Selection
from d2rpick.histories.samples import window

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from d2rpick.choice.settings import Settings
    from d2rpick.flight.flight import Flight
    from d2rpick.histories.history import History, Samples
    from d2rpick.histories.names import Part
    from d2rpick.histories.run import Run

# A part whose energy in flight scatters by less than this share of its mean has stopped deforming: what it holds is
# plastic work, and its vibration is a small part of it.
STOPPED: Final = 0.1
# After a landing has begun, its first share of so much of the flight before shows which part takes it.
_LANDING: Final = 0.05


@dataclass(frozen=True)
class InFlight:
    """One part in one flight; energies are None where the part has none or they are not written.

    ``scatter`` is the standard deviation of the internal energy over its mean [-]; ``change`` its end less its start.
    """

    flies: bool | None = None
    mean: float | None = None
    change: float | None = None
    scatter: float | None = None
    landing: float | None = None

    @property
    def deforms(self) -> bool | None:
        """Whether the part still deforms; None where its energy does not tell."""
        return None if self.scatter is None else self.scatter >= STOPPED


@dataclass(frozen=True)
class PartFacts:
    """What the history says about one part; ``has_energy`` None: its energy is not written.

    ``held`` says what holds it in the longest flight, or at the end of a record without any.
    """

    part: Part
    mass: float | None
    has_energy: bool | None
    flights: tuple[InFlight, ...] = ()
    held: str | None = None


@dataclass(frozen=True)
class RunFacts:
    """What a history says about all of its parts.

    ``flights`` are (start, end) [time], ``longest`` the place of the longest one, None without any.  ``reason`` says
    why there are no parts or no flights.
    """

    parts: Mapping[int, PartFacts]
    flights: tuple[tuple[float, float], ...] = ()
    longest: int | None = None
    reason: str | None = None


def facts_of(run: Run, settings: Settings) -> RunFacts:
    """Collect what the files of a run say about its parts.

    Parameters
    ----------
    run : Run
        Without switching.
    settings : Settings
        How flights are looked for where momenta do not show them.

    Returns
    -------
    RunFacts
        Without parts, and with the reason, where the files have none.
    """
    try:
        energies = run.part_energies(run.parts)
    except FormatError as error:
        return RunFacts({}, reason=str(error))
    masses = _masses(run)
    try:
        history, members = _history(run)
    except FormatError as error:  # nothing ever deforms
        still = {part.id: PartFacts(part, masses.get(part.id), has_energy=False) for part in run.parts}
        return RunFacts(still, reason=str(error))
    flights = flights_of(history, settings)
    spans = tuple(bounds(history, flight) for flight in flights)
    lengths = [end - start for start, end in spans]
    longest = int(np.argmax(lengths)) if lengths else None
    moment = float(history.time[-1]) if longest is None else sum(spans[longest]) / 2
    known = {
        part.id: PartFacts(
            part,
            masses.get(part.id),
            bool(energies[:, at].any()),
            tuple(
                _in_flight(history.time, energies[:, at], span, _flies(part, flight, members))
                for span, flight in zip(spans, flights, strict=True)
            ),
            run.surroundings.held([part], moment),
        )
        for at, part in enumerate(run.parts)
    }
    return RunFacts(known, spans, longest, None if flights else "no flight is seen in the history")


def _history(run: Run) -> tuple[History, Sequence[Part] | None]:
    """Energy of the parts that fly together, or of all that deform where momenta do not tell."""
    members = if_written(lambda: flying_together(run))
    chosen = members or deformable_parts(run)
    return run.history(Selection(parts=tuple(str(part.id) for part in chosen))), members


def _flies(part: Part, flight: Flight, members: Sequence[Part] | None) -> bool | None:
    """Whether a part flies with the rest; None where no momentum of parts shows it."""
    if members is None:
        return None
    together = flight.parts if flight.source == "momentum" and flight.parts else members
    return part.id in {one.id for one in together}


def _in_flight(time: Samples, energy: Samples, span: tuple[float, float], flies: bool | None) -> InFlight:
    inside = energy[window(time, *span)]
    if not inside.size or not inside.any():
        return InFlight(flies)
    mean = float(inside.mean())
    scatter = float(inside.std()) / mean if mean > 0 else None
    return InFlight(flies, mean, float(inside[-1] - inside[0]), scatter, _landing(time, energy, span))


def _landing(time: Samples, energy: Samples, span: tuple[float, float]) -> float | None:
    """What the part takes up at the beginning of the landing after a flight; None where the record ends in it."""
    start, end = span
    after = energy[window(time, end, end + _LANDING * (end - start))]
    return float(after[-1] - after[0]) if end < float(time[-1]) and after.size > 1 else None


def _masses(run: Run) -> dict[int, float]:
    """Masses by part, of those that are known."""
    found = run.masses
    if found is None:
        return {}
    return {part.id: mass for part, mass in zip(run.parts, found.tolist(), strict=True) if np.isfinite(mass)}
