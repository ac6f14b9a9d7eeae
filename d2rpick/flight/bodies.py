"""How far the rigid bodies that some parts become are out of place at td: each by itself, the largest error counts.

A body of several parts is off where these move against each other (`d2rpick.flight.position_error`).  One of a single
part moves as the part does: its momentum is kept, and nothing in it is frozen elsewhere.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from d2rpick.flight.position_error import Drift, apart_in_flight, drift_in_flight

if TYPE_CHECKING:
    from collections.abc import Sequence

    from d2rpick.deck.geometry import Placement
    from d2rpick.flight.flight import Flight
    from d2rpick.histories.history import History, Samples
    from d2rpick.histories.names import Part


class RigidBody(NamedTuple):
    """Numbers of the parts that become one rigid body; ``whole`` False: a single part whose pieces move by themselves.

    Of pieces that do not hang together and yet become one body nobody writes how they move against each other.
    """

    parts: tuple[int, ...]
    whole: bool = True

    @property
    def name(self) -> str:
        """Numbers of the parts, as `parts` takes them."""
        return ",".join(map(str, self.parts))


class Off(NamedTuple):
    """How far the body that is off most will be [length], and how it drifts; ``body`` is named where there are several.

    ``assumed``: no deck tells that the parts become one body.  ``at_least``: it may be further off, or another body is.
    """

    error: float
    drift: Drift
    body: RigidBody | None
    assumed: bool
    at_least: bool = False

    @property
    def part(self) -> str | None:
        """Name of the part that is frozen elsewhere; None where nothing is."""
        return self.drift.part.name if self.error > 0 else None


class Bodies:
    """Rigid bodies of a flight, each with its drift; ``told`` are those of a deck, none where one body is assumed.

    Where the drift of one of them is not known, no error is: it may be the largest.  ``apart`` are parts that are to
    become one body with others, and fly away from them.
    """

    def __init__(
        self, drifts: Sequence[Drift | None], told: Sequence[RigidBody] | None, apart: Sequence[Part] = ()
    ) -> None:
        self.told, self.apart = tuple(told or ()), tuple(apart)
        self._known = tuple(one for one in drifts if one)
        self._complete = len(self._known) == len(drifts) > 0
        self.unknown = tuple(body for body, one in zip(self.told, drifts, strict=False) if one is None)

    def errors(self, tr: Samples, td: float) -> Samples:
        """How far the body that is off most will be at td, for times tr (k,) [length]; NaN outside the flight."""
        return np.asarray(self._each(tr, td).max(axis=0)) if self._complete else np.full(tr.shape, np.nan)

    @property
    def limit(self) -> float:
        """From which error on a body is out of place, the least of those whose parts move [length]."""
        return min((one.limit for one in self._known if one.place.any()), default=np.inf)

    def worst(self, tr: float, td: float) -> Off | None:
        """Give the body that is off most; None outside the flight, and where one is not known."""
        found = self._each(np.array([tr]), td)[:, 0] if self._complete else np.full(1, np.nan)
        if np.isnan(found).any():
            return None
        at = int(np.argmax(found))
        body = self.told[at] if len(self.told) > 1 else None
        return Off(float(found[at]), self._known[at], body, not self.told, any(one.at_least for one in self._known))

    def _each(self, tr: Samples, td: float) -> Samples:
        """Errors by body, shape (bodies, k) [length]."""
        return np.stack([one.errors(tr, td) for one in self._known])


def bodies_in_flight(
    history: History, flight: Flight, told: Sequence[RigidBody] | None, placement: Placement | None = None
) -> Bodies:
    """Find how the bodies that the parts to be switched become drift in a flight.

    Parameters
    ----------
    history : History
    flight : Flight
        With the parts that fly in it.
    told : sequence of RigidBody or None
        By a deck; without them the parts are taken for one body.
    placement : Placement, optional
        Where the deck puts the parts.
    """
    if not told:
        away = apart_in_flight(history, flight)
        return Bodies([None if away else drift_in_flight(history, flight, placement=placement)], None, away)
    parts = [[part for part in history.parts or () if part.id in body.parts] for body in told]
    leaving = [apart_in_flight(history, flight, own) for own in parts]
    drifts = [
        None if some else _drift(history, flight, body, own, placement)
        for body, own, some in zip(told, parts, leaving, strict=True)
    ]
    return Bodies(drifts, told, sum(leaving, ()))


def _drift(
    history: History, flight: Flight, body: RigidBody, parts: Sequence[Part], placement: Placement | None
) -> Drift | None:
    """Drift of one body of those parts that have energy; of a single part none at all while it flies."""
    if not body.whole or len(parts) < len(body.parts):
        return None
    if len(parts) > 1:
        return drift_in_flight(history, flight, parts, placement)
    (part,) = parts
    if flight.refusal or part.id not in {one.id for one in flight.parts or ()}:
        return None
    return Drift(np.array(flight.within(history.time)), np.zeros((2, 3)), np.zeros(2), part, 0.0)
