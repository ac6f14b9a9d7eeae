"""Define the box, its step, the sled and the ground in their initial state, and the forces of the bars.

The box is the cross-section of a thin-walled body in the plane in which it rolls. It consists of an outer and an inner
ring of mass points, connected by bars along both rings, between the rings, and diagonally. Therefore its walls can
bend, its frame can shear, and it has twice as many modes as points. The step is a small truss at the lower end of the
leading side; only the step touches the curb. Vectors in the plane are complex numbers x + i z with x forward and z up.
All quantities are in SI units.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from d2rpick.base.data_classes import dataclass
from d2rpick.base.errors import RangeError

Plane = NDArray[np.complex128]
Values = NDArray[np.float64]
Ends = NDArray[np.intp]

GRAVITY = 9.81
_POSITIVE = (
    "braking", "stiffness", "yield_strain", "mass", "width", "height", "wall", "step_mass", "step_stiffness",
    "step_yield_strain", "ground_stiffness", "roof_strength",
)  # fmt: skip
# Smallest number of cells along a side. With fewer cells, the step could not span a quarter of the leading side.
_COARSEST = 4
# Number of bars per cell. The cells of the leading side are listed first, then the cells of the roof.
_BARS = 5


@dataclass(frozen=True)
class Parameters:
    """Parameters of the box, sled and surroundings in SI units; raise RangeError for values that give no valid model.

    The defaults describe a narrow box on the standard dolly. They were tuned to the two times that the published study
    states about its model: the contact with the curb ends at about 85 ms, and the box lands at 380 ms.
    """

    speed: float = 7.0
    """Speed of sled and box at the start [m/s]: enough to roll by more than a quarter turn."""
    braking: float = 0.06
    """Time in which the sled comes to rest at constant deceleration [s]: 12 g; the box leaves it 25 ms later."""
    stiffness: float = 4.5e6
    """Axial stiffness E A of every bar of the box [N]: racking at 20 Hz, as the first modes of car bodies."""
    yield_strain: float = 4.5e-3
    """Yield strain of the bars of the box [-]: the trip dissipates plastic work of the size of the vibration energy."""
    roof_strength: float = 1.0
    """Yield force of the bars of the roof, over that of the other walls [-]."""
    damping: float = 0.2
    """Mass-proportional damping rate alpha [1/s]: small, since it slows flight and roll too."""
    mesh: int = 16
    """Cells along each side of the box; with twice as many its lowest modes are 10 % lower."""
    mass: float = 350.0
    """Mass of the box [kg]: a body without its engine."""
    tilt: float = 23.0
    """Tilt of the floor of the sled, down towards the curb [degrees]: as the standard dolly (FMVSS 208)."""
    width: float = 0.7
    """Width of the box [m]: a narrow box is thrown up less and leaves the sled sooner."""
    height: float = 1.4
    """Height of the box [m]: that of a car."""
    wall: float = 0.12
    """Distance between the two rings [m]."""
    step_mass: float = 6.0
    """Mass of the step [kg]."""
    step_stiffness: float = 8e6
    """Axial stiffness E A of the bars of the step [N]: stiffer than the box, since it carries the whole trip."""
    step_yield_strain: float = 4e-3
    """Yield strain of the bars of the step [-]: it must not fold."""
    cushion: float = 24e3
    """Force at which the cushion of the curb crushes at a point [N]: 7 times the weight of the box."""
    cushion_depth: float = 0.08
    """Depth at which the cushion is fully crushed [m]."""
    curb: float = 0.1
    """Height of the curb above the floor of the sled [m]: the flange of the standard dolly."""
    friction: float = 0.3
    """Coefficient of friction at all contacts [-]: dry steel on steel."""
    ground: float = 0.1855
    """Depth of the ground below the lower edge of the sled [m]: near the 0.23 m of the standard dolly."""
    ground_stiffness: float = 5e5
    """Stiffness of the ground at one point [N/m]: softer than the box, so that a landing sinks in by centimetres."""
    drop: float | None = None
    """Only for a drop without a sled: height of the lowest point above the ground at the start [m]; ``tilt`` is then
    the tilt of the box, ``speed`` its velocity along x."""

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if value is not None and not (np.isfinite(value) and value >= 0):
                raise RangeError(
                    f"{name} is {value}, but a number of at least 0 was expected"
                )
        for name in _POSITIVE:
            if not getattr(self, name) > 0:
                raise RangeError(f"{name} is 0, but a positive number was expected")
        if self.mesh < _COARSEST:
            raise RangeError(
                f"mesh is {self.mesh}, but at least {_COARSEST} cells along each side were expected"
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
        points: Plane,
        ends: list[tuple[int, int]],
        axial: float,
        yield_strain: float,
    ) -> Truss:
        """Return straight bars between these points that have the axial stiffness ``axial`` [N] and no stress."""
        pairs = np.array(ends, dtype=np.intp)
        first, second = pairs.T
        lengths = np.abs(points[second] - points[first])
        stiffness = axial / lengths
        strength = np.full(lengths.size, axial * yield_strain)
        return cls(pairs, lengths, stiffness, strength)


class Structure(NamedTuple):
    """Points at ``places`` (n,) with ``masses``, of which the first ``of_box`` belong to the box, and all bars.

    The points of the outer ring are listed first. ``skin`` contains the points that may touch the floor and the ground,
    ``toes`` the points that may touch the curb.
    """

    places: Plane
    masses: Values
    of_box: int
    box: Truss
    step: Truss
    skin: Ends
    toes: Ends


def build_structure(parameters: Parameters) -> Structure:
    """Return the box and the step on the tilted floor of the sled, with the lower step point at the curb (the origin).

    For a drop test, both are moved vertically to their height above the ground.
    """
    p = parameters
    ring = _make_ring(p.mesh)
    outer = _scale_ring(ring, p.width, p.height)
    inner = _scale_ring(ring, p.width - 2 * p.wall, p.height - 2 * p.wall)
    cells = ring.size
    top = p.mesh // 4
    toes = outer[[0, top]] + p.wall
    upright = np.concatenate([outer, inner, toes]) - toes[0]
    positions = upright * np.exp(-1j * np.radians(p.tilt))
    if p.drop is not None:
        height = p.drop - p.ground - positions.imag.min()
        positions += 1j * height
    of_box = 2 * cells
    toe_points = of_box + np.arange(toes.size)
    point_masses = [p.mass / of_box, p.step_mass / toes.size]
    bars_of_box = _list_bars_of_box(cells)
    walls = Truss.between(positions, bars_of_box, p.stiffness, p.yield_strain)
    roof = slice(_BARS * p.mesh, _BARS * 2 * p.mesh)
    walls.strength[roof] *= p.roof_strength
    bars_of_step = _list_bars_of_step(cells, top)
    step = Truss.between(positions, bars_of_step, p.step_stiffness, p.step_yield_strain)
    return Structure(
        places=positions,
        masses=np.repeat(point_masses, [of_box, toes.size]),
        of_box=of_box,
        box=walls,
        step=step,
        skin=np.concatenate([np.arange(cells), toe_points]),
        toes=toe_points,
    )


def _make_ring(mesh: int) -> Plane:
    """Return points around a square of side 1 about the origin, from its lower leading corner upwards."""
    along = np.arange(mesh) / mesh - 0.5
    leading_side = 0.5 + 1j * along
    roof = -along + 0.5j
    trailing_side = -0.5 - 1j * along
    floor = along - 0.5j
    return np.concatenate([leading_side, roof, trailing_side, floor])


def _scale_ring(ring: Plane, width: float, height: float) -> Plane:
    """Return the points of a ring, scaled to the given width and height [m]."""
    return ring.real * width + 1j * ring.imag * height


def _list_bars_of_box(cells: int) -> list[tuple[int, int]]:
    """Return the bars of the box: along both rings, between the rings, and along both diagonals of every cell."""
    ends = []
    for cell in range(cells):
        following = (cell + 1) % cells
        ends += [
            (cell, following),
            (cells + cell, cells + following),
            (cell, cells + cell),
        ]
        ends += [(cell, cells + following), (following, cells + cell)]
    return ends


def _list_bars_of_step(cells: int, top: int) -> list[tuple[int, int]]:
    """Return the bars of the step: one between its two points, and four from each point to nearby box points."""
    low = 2 * cells
    high = 2 * cells + 1
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
    """The current state of the bars of a truss: lengths ``rest`` with plastic elongation [m], and ``plastic_work`` [J].

    ``points`` is the number of points of the model. The force of a bar depends only on its length, so after a phase in
    which its points moved as one rigid body, the bar continues with the same elongation, rotated with the body.
    """

    def __init__(self, truss: Truss, points: int) -> None:
        # Numbers of the first and of the second point of each bar.
        self._first = truss.ends[:, 0].copy()
        self._second = truss.ends[:, 1].copy()
        self._stiffness = truss.stiffness
        self._strength = truss.strength
        self.rest = truss.rest.copy()
        self.plastic_work = 0.0
        # A bar in tension pulls its first point towards its second point, and its second point towards its first.
        bars = np.arange(truss.rest.size)
        self._pulls = np.zeros((points, bars.size))
        self._pulls[self._first, bars] = 1.0
        self._pulls[self._second, bars] = -1.0
        self.evaluations = 0

    def forces(self, positions: Plane) -> Plane:
        """Return the forces on all points at ``positions``, shape (n,) [N]; bars yield at their strength."""
        along = positions[self._second] - positions[self._first]
        length = np.abs(along)
        tension = self._stiffness * (length - self.rest)
        limited = np.minimum(np.maximum(tension, -self._strength), self._strength)
        excess = tension - limited
        if excess.any():
            flow = excess / self._stiffness
            self.rest += flow
            self.plastic_work += float(limited @ flow)
        along *= limited / length
        self.evaluations += length.size
        # The product of real matrices is faster than that of complex ones; the columns are the x and z components.
        components = along.view(np.float64).reshape(-1, 2)
        forces = self._pulls @ components
        return forces.view(np.complex128).ravel()

    def elastic_energy(self, positions: Plane, rest: Values | None = None) -> Values:
        """Return the elastic energy of the bars, shape (...), for ``positions`` of shape (..., n) [J].

        ``rest`` are the lengths at rest (..., bars) at the time of the positions, if they differ from the current ones
        [m].
        """
        length = np.abs(positions[..., self._second] - positions[..., self._first])
        rest_length = self.rest if rest is None else rest
        elongation = length - rest_length
        return np.asarray(elongation**2 @ self._stiffness) / 2

    def internal_energy(
        self,
        positions: Plane,
        rest: Values | None = None,
        plastic_work: Values | None = None,
    ) -> Values:
        """Return the sum of elastic energy and plastic work in the current or a past state, shape (...) [J]."""
        if plastic_work is None:
            return self.elastic_energy(positions, rest) + self.plastic_work
        return self.elastic_energy(positions, rest) + plastic_work


def compute_stiffest_rate(masses: Values, *trusses: Truss, extra: Values) -> float:
    """Return an upper bound on the angular frequencies of the model [1/s].

    If the mass m of each point is divided among its bars in proportion to their stiffness, a bar has omega^2 = K_1/m_1
    + K_2/m_2, where K is the sum of the stiffnesses at a point. No mode of the model has a higher frequency than the
    bar with the highest frequency. ``extra`` is the contact stiffness at the points [N/m].
    """
    at_point = extra.copy()
    for truss in trusses:
        np.add.at(at_point, truss.ends, truss.stiffness[:, np.newaxis])
    squares_at_points = at_point / masses
    squares = [squares_at_points[truss.ends].sum(axis=1).max() for truss in trusses]
    return float(np.sqrt(max(squares)))
