"""Elastic-plastic bars that follow their points through any rotation."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from d2rpick.models.rollover.model import Plane, Truss, Values


class Bars:
    """Bars of a truss as they are: lengths at ``rest`` with the plastic elongation, ``plastic_work`` [m], [J].

    ``points`` is the number of those in the model.
    A bar knows its length only, so after a phase in which its points moved as one body it carries on with the
    elongation it had, turned with the body.
    """

    def __init__(self, truss: Truss, points: int) -> None:
        self._first, self._second = truss.ends[:, 0].copy(), truss.ends[:, 1].copy()
        self._stiffness, self._strength = truss.stiffness, truss.strength
        self.rest = truss.rest.copy()
        self.plastic_work = 0.0
        # a bar pulls its first point towards its second, and the second back
        self._pulls = np.zeros((points, truss.rest.size))
        self._pulls[self._first, np.arange(truss.rest.size)] = 1.0
        self._pulls[self._second, np.arange(truss.rest.size)] = -1.0
        self.evaluations = 0

    def forces(self, places: Plane) -> Plane:
        """Forces on all points at ``places``, shape (n,) [N]; bars beyond their strength yield."""
        along = places[self._second] - places[self._first]
        length = np.abs(along)
        tension = self._stiffness * (length - self.rest)
        held = np.minimum(np.maximum(tension, -self._strength), self._strength)
        excess = tension - held
        if excess.any():
            flow = excess / self._stiffness
            self.rest += flow
            self.plastic_work += float(held @ flow)
        along *= held / length
        self.evaluations += length.size
        return (self._pulls @ along.view(np.float64).reshape(-1, 2)).view(np.complex128).ravel()

    def elastic_energy(self, places: Plane, rest: Values | None = None) -> Values:
        """Energy that the bars give back when they are released, of the shape (...) for places (..., n) [J].

        ``rest`` are their lengths then, if others than now (..., bars) [m].
        """
        elongation = np.abs(places[..., self._second] - places[..., self._first]) - (
            self.rest if rest is None else rest
        )
        return np.asarray(elongation**2 @ self._stiffness) / 2

    def internal_energy(self, places: Plane, rest: Values | None = None, plastic_work: Values | None = None) -> Values:
        """Elastic energy and plastic work, as solvers report them, of now or of then (...) [J]."""
        return self.elastic_energy(places, rest) + (self.plastic_work if plastic_work is None else plastic_work)


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
