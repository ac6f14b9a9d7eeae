"""Elastic-plastic bars that follow their points through any rotation."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from d2rpick.models.rollover.model import Plane, Truss, Values


class Bars:
    """Bars of a truss as they are: their plastic elongation and work; ``points`` in the model.

    A bar knows its length only, so after a phase in which its points moved as one body it carries on with the
    elongation it had, turned with the body.
    """

    def __init__(self, truss: Truss, points: int) -> None:
        self._first, self._second = truss.ends[:, 0].copy(), truss.ends[:, 1].copy()
        self._stiffness, self._strength = truss.stiffness, truss.strength
        self._rest = truss.rest.copy()  # with the plastic elongation
        self._plastic_work = 0.0
        # a bar pulls its first point towards its second, and the second back
        self._pulls = np.zeros((points, truss.rest.size))
        self._pulls[self._first, np.arange(truss.rest.size)] = 1.0
        self._pulls[self._second, np.arange(truss.rest.size)] = -1.0
        self.evaluations = 0

    def forces(self, places: Plane) -> Plane:
        """Forces on all points at ``places``, shape (n,) [N]; bars beyond their strength yield."""
        along = places[self._second] - places[self._first]
        length = np.abs(along)
        tension = self._stiffness * (length - self._rest)
        held = np.minimum(np.maximum(tension, -self._strength), self._strength)
        excess = tension - held
        if excess.any():
            flow = excess / self._stiffness
            self._rest += flow
            self._plastic_work += float(held @ flow)
        along *= held / length
        self.evaluations += length.size
        return (self._pulls @ along.view(np.float64).reshape(-1, 2)).view(np.complex128).ravel()

    def elastic_energy(self, places: Plane) -> float:
        """Energy that the bars give back when they are released [J]."""
        elongation = np.abs(places[self._second] - places[self._first]) - self._rest
        return float(self._stiffness @ elongation**2) / 2

    def internal_energy(self, places: Plane) -> float:
        """Elastic energy and plastic work, as solvers report them [J]."""
        return self.elastic_energy(places) + self._plastic_work


def stiffest_rate(masses: Values, *trusses: Truss, extra: Values) -> float:
    """Bound of the highest rate of free vibration [1/s].

    A bar of stiffness k between points whose masses are shared among their bars in proportion to the stiffness has
    omega^2 = K_1/m_1 + K_2/m_2, with K the sum of the stiffnesses at a point; no mode of the whole is faster than its
    fastest bar.  ``extra`` is the stiffness of contacts at the points [N/m].
    """
    at_point = extra.copy()
    for truss in trusses:
        np.add.at(at_point, truss.ends, truss.stiffness[:, np.newaxis])
    rates = at_point / masses
    return float(np.sqrt(max(rates[truss.ends].sum(axis=1).max() for truss in trusses)))
