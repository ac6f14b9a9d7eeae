"""The box, its step, the sled and the ground: what is computed, before anything moves; and how its bars resist.

The box is the cross-section of a thin-walled body in its plane of roll: an outer and an inner ring of mass points,
joined by bars along both rings, across, and diagonally.  So its walls bend, the frame racks, and it has as many modes
as two times its points.  The step is a small truss at the foot of the leading side; it alone meets the curb and is
never switched.  Vectors of the plane are complex numbers, x + i z: x forward, z up.  SI units.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from d2rpick.base.errors import RangeError

Plane = NDArray[np.complex128]
Values = NDArray[np.float64]
Ends = NDArray[np.intp]

GRAVITY = 9.81
_POSITIVE = (
    "braking", "stiffness", "yield_strain", "mass", "width", "height", "wall", "step_mass", "step_stiffness",
    "step_yield_strain", "ground_stiffness", "roof_strength",
)  # fmt: skip
# The step takes a quarter of the leading side, and at least one cell.
_COARSEST = 4
# Bars of a cell, the cells of the leading side first, then those of the roof.
_BARS = 5


@dataclass(frozen=True)
class Parameters:
    """Box, sled and surroundings; RangeError where a number makes no model.  SI units.

    The defaults are a narrow box on the standard dolly.  They were tuned, by nothing but these two times, such that
    the trip is over at about 85 ms and the ground comes at 380 ms, as in the published study, which states no other
    figure of its model.
    """

    speed: float = 7.0
    """Of sled and box at the start [m/s]: enough to roll by more than a quarter turn."""
    braking: float = 0.06
    """The sled comes to rest in this time, evenly [s]: 12 g; the box leaves it 25 ms later."""
    stiffness: float = 4.5e6
    """Of every bar of the box, E A [N]: racking at 20 Hz, where bodies of cars have their first modes."""
    yield_strain: float = 4.5e-3
    """At which the bars of the box yield [-]: in the trip it takes plastic work of the size of its vibration."""
    roof_strength: float = 1.0
    """Force at which the bars of the roof yield, over that of the other walls [-]."""
    damping: float = 0.2
    """Rate alpha of the damping, proportional to mass [1/s]: small, for it slows flight and roll as well."""
    mesh: int = 16
    """Cells along each side of the box: with twice as many its lowest modes fall by a tenth."""
    mass: float = 350.0
    """Of the box [kg]: a body without its engine."""
    tilt: float = 23.0
    """Of the floor of the sled, down towards the curb [degrees]: that of the standard dolly (FMVSS 208)."""
    width: float = 0.7
    """Of the box [m]: the narrower, the less it is thrown up and the sooner it leaves the sled."""
    height: float = 1.4
    """Of the box [m]: that of a car."""
    wall: float = 0.12
    """Distance of its two rings [m]."""
    step_mass: float = 6.0
    """Of the step [kg]."""
    step_stiffness: float = 8e6
    """E A of the bars of the step [N]: stiffer than the box, for it carries the whole trip."""
    step_yield_strain: float = 4e-3
    """At which the bars of the step yield [-]: it must not fold."""
    cushion: float = 24e3
    """Force at which the cushion of the curb crushes under a point [N]: 7 times the weight of the box."""
    cushion_depth: float = 0.08
    """Crushed so far, the cushion is solid [m]."""
    curb: float = 0.1
    """Height of the curb above the floor of the sled [m]: the flange of the standard dolly."""
    friction: float = 0.3
    """Coefficient, everywhere [-]: steel on steel, dry."""
    ground: float = 0.1855
    """Depth of the ground below the lower edge of the sled [m]: near the 0.23 m of the standard dolly."""
    ground_stiffness: float = 5e5
    """Of the ground at one point [N/m]: softer than the box, so that a landing sinks in by centimetres."""
    drop: float | None = None
    """Without a sled: height of the lowest point above the ground at the start [m]; ``tilt`` is then that of the box,
    ``speed`` its velocity along x."""

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if value is not None and not (np.isfinite(value) and value >= 0):
                raise RangeError(
                    f"{name} is {value}, a number of at least 0 was expected"
                )
        for name in _POSITIVE:
            if not getattr(self, name) > 0:
                raise RangeError(f"{name} is 0, a positive number was expected")
        if self.mesh < _COARSEST:
            raise RangeError(
                f"mesh is {self.mesh}, at least {_COARSEST} cells along each side were expected"
            )


class Truss(NamedTuple):
    """Elastic-plastic bars: ``ends`` (bars, 2), ``rest`` length [m], ``stiffness`` [N/m], ``strength`` [N] (bars,)."""

    ends: Ends
    rest: Values
    stiffness: Values
    strength: Values

    @classmethod
    def between(
        cls,
        places: Plane,
        ends: list[tuple[int, int]],
        axial: float,
        yield_strain: float,
    ) -> Truss:
        """Straight bars of one section, E A = ``axial`` [N], free of stress at these places."""
        pairs = np.array(ends, dtype=np.intp)
        rest = np.abs(places[pairs[:, 1]] - places[pairs[:, 0]])
        return cls(pairs, rest, axial / rest, np.full(rest.size, axial * yield_strain))


class Structure(NamedTuple):
    """Points at ``places`` (n,) with ``masses``, the first ``of_box`` those of the box, and the bars of both parts.

    The outer ring comes first.  ``skin`` are the points that may touch floor and ground, ``toes`` those that may meet
    the curb.
    """

    places: Plane
    masses: Values
    of_box: int
    box: Truss
    step: Truss
    skin: Ends
    toes: Ends


def build(parameters: Parameters) -> Structure:
    """Lay out box and step on the tilted floor of the sled, the lower end of the step at the curb, the origin.

    For a drop they are raised or lowered to their height above the ground.
    """
    p = parameters
    ring = _ring(p.mesh)
    outer = _scaled(ring, p.width, p.height)
    inner = _scaled(ring, p.width - 2 * p.wall, p.height - 2 * p.wall)
    cells, top = ring.size, p.mesh // 4
    toes = outer[[0, top]] + p.wall
    upright = np.concatenate([outer, inner, toes]) - toes[0]
    places = upright * np.exp(-1j * np.radians(p.tilt))
    if p.drop is not None:
        places += 1j * (p.drop - p.ground - places.imag.min())
    of_box = 2 * cells
    walls = Truss.between(places, _walls(cells), p.stiffness, p.yield_strain)
    walls.strength[_BARS * p.mesh : _BARS * 2 * p.mesh] *= p.roof_strength
    both = of_box + np.arange(toes.size)
    return Structure(
        places=places,
        masses=np.repeat(
            [p.mass / of_box, p.step_mass / toes.size], [of_box, toes.size]
        ),
        of_box=of_box,
        box=walls,
        step=Truss.between(
            places, _step(cells, top), p.step_stiffness, p.step_yield_strain
        ),
        skin=np.concatenate([np.arange(cells), both]),
        toes=both,
    )


def _ring(mesh: int) -> Plane:
    """Points around a square of side 1 about the origin, from its lower leading corner up and around."""
    side = np.arange(mesh) / mesh - 0.5
    return np.concatenate(
        [0.5 + 1j * side, -side + 0.5j, -0.5 - 1j * side, side - 0.5j]
    )


def _scaled(ring: Plane, width: float, height: float) -> Plane:
    return ring.real * width + 1j * ring.imag * height


def _walls(cells: int) -> list[tuple[int, int]]:
    """Bars of the box: along both rings, across, and both diagonals of every cell."""
    ends = []
    for one in range(cells):
        other = (one + 1) % cells
        ends += [(one, other), (cells + one, cells + other), (one, cells + one)]
        ends += [(one, cells + other), (other, cells + one)]
    return ends


def _step(cells: int, top: int) -> list[tuple[int, int]]:
    """Bars of the step: between its two points, from both to the ends of the skin beside it and to what is behind."""
    low, high = 2 * cells, 2 * cells + 1
    to_skin = [(toe, skin) for toe in (low, high) for skin in (0, top)]
    return [
        (low, high),
        *to_skin,
        (low, 1),
        (high, top - 1),
        (low, cells),
        (high, cells + top),
    ]


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
        return (
            (self._pulls @ along.view(np.float64).reshape(-1, 2))
            .view(np.complex128)
            .ravel()
        )

    def elastic_energy(self, places: Plane, rest: Values | None = None) -> Values:
        """Energy that the bars give back when they are released, of the shape (...) for places (..., n) [J].

        ``rest`` are their lengths then, if others than now (..., bars) [m].
        """
        elongation = np.abs(places[..., self._second] - places[..., self._first]) - (
            self.rest if rest is None else rest
        )
        return np.asarray(elongation**2 @ self._stiffness) / 2

    def internal_energy(
        self,
        places: Plane,
        rest: Values | None = None,
        plastic_work: Values | None = None,
    ) -> Values:
        """Elastic energy and plastic work, as solvers report them, of now or of then (...) [J]."""
        return self.elastic_energy(places, rest) + (
            self.plastic_work if plastic_work is None else plastic_work
        )


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
