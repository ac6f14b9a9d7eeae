"""Deck of a frame that is pushed, flies, vibrates in several modes and lands on its feet (SI units).

Twelve beams join eight corners.  Every corner carries a plate of dense shells; one plate is heavier, so that all modes
differ.  Square tubes of shells under the lower corners are the feet.  A force pushes an upper corner obliquely; then
nothing acts until the feet meet the ground.  All parts except the ground are one rigid body, which is deactivated until
the switch.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import count, pairwise, product
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterable

    from numpy.typing import NDArray

    Place = tuple[float, float, float]
    Reals = NDArray[np.float64]
    Line = list[Reals]

NAME: Final = "FRAME"
MAIN_NODE: Final = 90001  # of the rigid body
PARTS: Final = (
    "beams",
    "plates",
    "heavy plate",
    "feet",
)  # the switched parts, numbered from 1; the ground follows

_LENGTHS: Final = np.array([0.66, 0.38, 0.50])  # between corners [m]
_BEAM_PIECES: Final = 6  # elements of one beam
_FOOT_HEIGHT: Final = 0.075  # [m]
_PLATE_SIDE: Final = 0.05  # of a plate, and of the square of a foot [m]
_HALF_SIDES: Final = np.linspace(
    -_PLATE_SIDE / 2, _PLATE_SIDE / 2, 5
)  # nodes along the side of a plate [m]
_RINGS: Final = 6  # shells along the height of a foot
_PUSHED_CORNER: Final = (1, 1, 1)  # which end along each axis
_HEAVY_CORNER: Final = (0, 1, 1)
_PUSH: Final = np.array([8000.0, 4800.0, -2200.0])  # peak of the force [N]
_PUSH_TIME: Final = 4e-3  # half a sine [s]
_GAP: Final = 1e-3  # of the contact [m]
_GROUND_SIDE: Final = 2.4  # [m]

_HEAD: Final = f"""#RADIOSS STARTER
/BEGIN
{NAME}
      2022         0
                  kg                   m                   s
                  kg                   m                   s
/TITLE
frame with heavy corners"""
_PLASTIC: Final = """/MAT/PLAS_JOHNS/{number}
{title}
{density:20.10g}
{modulus:20.10g}                 0.3         0
{strength:20.10g}{hardening:20.10g}                 0.5                   0                   0
                   0                   0         0         0                   0                   0
                   0                   0                   0                   0"""
_ELASTIC: Final = """/MAT/ELAST/{number}
{title}
{density:20.10g}
{modulus:20.10g}                 0.3"""
_MATERIALS: Final = "\n".join(
    (
        _PLASTIC.format(
            number=1,
            title="steel",
            density=7850,
            modulus=2.1e11,
            strength=350e6,
            hardening=5e8,
        ),
        _ELASTIC.format(number=2, title="dense", density=8e4, modulus=2.1e11),
        _ELASTIC.format(number=3, title="ground", density=7850, modulus=2.1e11),
    )
)
_BEAM: Final = """/PROP/BEAM/{number}
beam
                   0
                   0                   0
{area:20.10g}{bending:20.10g}{bending:20.10g}{torsion:20.10g}
   000 000         0"""
_SHELL: Final = """/PROP/SHELL/{number}
shell
{formulation:10d}         0         0         0                                       0
                   0                   0                   0                   0                   0
{layers:10d}         0{thickness:20.10g}                   0                   1         1"""
# beams: a square tube of 35 x 2.5 mm
_PROPERTIES: Final = "\n".join(
    (
        _BEAM.format(number=1, area=3.25e-4, bending=5.75e-8, torsion=8.6e-8),
        _SHELL.format(number=2, formulation=24, layers=3, thickness=0.010),
        _SHELL.format(number=3, formulation=24, layers=3, thickness=0.022),
        _SHELL.format(number=4, formulation=24, layers=5, thickness=0.0012),
        _SHELL.format(number=5, formulation=1, layers=1, thickness=0.010),
    )
)
_START: Final = """/INIVEL/TRA/1
thrown
                   0                   0{speed:20.10g}         4         0
/BCS/1
ground fixed
   111 111         0         2
/RBODY/1
frame
{main:10d}         0         0         0                   0         1         0         0         0
                   0                   0                   0
                   0                   0                   0
         0         0         0"""
_CONTACT: Final = f"""/SURF/PART/1
ground
         5
/INTER/TYPE7/1
frame to ground
         1         1         4         0         0                   0         0         0         0
                   0                   0                   0
                1000                   0                   0                   0         0         0
                   1                 0.2{_GAP:20.3g}                   0                   0
       000                             6                   0                   0                   0
         0         0                   0         2         0         0                   0         0"""


@dataclass(frozen=True)
class Landing:
    """Landing of the frame: its speed towards the ground [m/s], and when it would land without the push [s]."""

    speed: float = 5.0
    time: float = 0.135


class Part(NamedTuple):
    """Part of the model: title, kind of element, property number and material number."""

    title: str
    kind: str
    property: int
    material: int


_PARTS: Final = (
    Part(PARTS[0], "BEAM", 1, 1),
    Part(PARTS[1], "SHELL", 2, 2),
    Part(PARTS[2], "SHELL", 3, 2),
    Part(PARTS[3], "SHELL", 4, 1),
    Part("ground", "SHELL", 5, 3),
)
_BEAMS, _PLATES, _HEAVY, _FEET, _GROUND = range(len(_PARTS))


@dataclass
class Mesh:
    """Nodes by position, and the elements of each part as lists of node numbers."""

    places: list[Place] = field(default_factory=list)
    elements: list[list[list[int]]] = field(
        default_factory=lambda: [[] for _ in _PARTS]
    )
    _numbers: dict[Place, int] = field(default_factory=dict)

    def node(self, position: Iterable[float]) -> int:
        """Return the number of the node at a position; add the node if there is none."""
        x, y, z = (round(float(value), 7) + 0.0 for value in position)
        if (x, y, z) not in self._numbers:
            self.places.append((x, y, z))
            self._numbers[x, y, z] = len(self.places)
        return self._numbers[x, y, z]

    def add_beam(self, start: Reals, end: Reals, side_vector: Reals) -> None:
        """Add the elements of a beam, whose section is oriented by a node in the direction of ``side_vector``."""
        stations = (
            start + share * (end - start)
            for share in np.linspace(0, 1, _BEAM_PIECES + 1)
        )
        numbers = [self.node(station) for station in stations]
        orients = self.node(side_vector)
        self.elements[_BEAMS] += [
            [first, second, orients] for first, second in pairwise(numbers)
        ]

    def add_grid(self, part: int, origin: Reals, first: Line, second: Line) -> None:
        """Add a grid of shells that two lines of nodes span from an origin."""
        for u, v in product(pairwise(first), pairwise(second)):
            corners = (u[0] + v[0], u[1] + v[0], u[1] + v[1], u[0] + v[1])
            self.elements[part].append(
                [self.node(origin + corner) for corner in corners]
            )


def mesh_frame() -> Mesh:
    """Return the frame without the ground; its lower corners are at z = 0."""
    mesh = Mesh()
    corners = [np.array(ends) for ends in product((0, 1), repeat=3)]
    axes = np.eye(3, dtype=int)
    for corner, axis in product(corners, range(3)):
        if corner[axis] == 0:
            turned = np.abs(corner - axes[axis - 1])  # the other end along another axis
            mesh.add_beam(
                _LENGTHS * corner, _LENGTHS * (corner + axes[axis]), _LENGTHS * turned
            )
    for corner in corners:
        part = _HEAVY if tuple(corner) == _HEAVY_CORNER else _PLATES
        _add_plate(mesh, part, _LENGTHS * corner)
        if corner[2] == 0:
            _add_foot(mesh, _LENGTHS * corner)
    return mesh


def _add_plate(mesh: Mesh, part: int, centre: Reals) -> None:
    mesh.add_grid(
        part, centre, _list_points(0, _HALF_SIDES), _list_points(1, _HALF_SIDES)
    )


def _add_foot(mesh: Mesh, top: Reals) -> None:
    upwards = _list_points(2, np.linspace(-_FOOT_HEIGHT, 0, _RINGS + 1))
    for across, along in ((0, 1), (1, 0)):
        for side in _list_points(across, _HALF_SIDES[[0, -1]]):
            mesh.add_grid(_FEET, top + side, _list_points(along, _HALF_SIDES), upwards)


def _list_points(axis: int, values: Reals) -> Line:
    """Return points along an axis."""
    return [value * np.eye(3)[axis] for value in values]


def write_deck(landing: Landing) -> str:
    """Return the starter deck of the frame; its histories contain the motion of all nodes of the frame."""
    mesh = mesh_frame()
    frame = range(1, len(mesh.places) + 1)
    sides = np.linspace(-_GROUND_SIDE / 2, _GROUND_SIDE / 2, 9)
    depth = _FOOT_HEIGHT + _GAP + landing.speed * landing.time
    under = np.array([*_LENGTHS[:2] / 2, -depth])
    mesh.add_grid(_GROUND, under, _list_points(0, sides), _list_points(1, sides))
    ground = range(frame.stop, len(mesh.places) + 1)
    pushed = mesh.node(_LENGTHS * _PUSHED_CORNER)
    cards = (
        _HEAD, _MATERIALS, _PROPERTIES, _write_node_cards(mesh), _write_part_cards(mesh),
        _group(1, "frame", frame), _group(2, "ground", ground), _group(3, "pushed corner", [pushed]),
        _group(4, "frame and main node", [*frame, MAIN_NODE]),
        _push_cards(), _START.format(speed=-landing.speed, main=MAIN_NODE), _CONTACT, _write_history_cards(frame),
        "/END",
    )  # fmt: skip
    return "\n".join(cards) + "\n"


def _write_node_cards(mesh: Mesh) -> str:
    positions = {
        **dict(enumerate(mesh.places, start=1)),
        MAIN_NODE: tuple(_LENGTHS / 2),
    }
    lines = (
        f"{number:10d}{x:20.9g}{y:20.9g}{z:20.9g}"
        for number, (x, y, z) in positions.items()
    )
    return "\n".join(("/NODE", *lines))


def _write_part_cards(mesh: Mesh) -> str:
    lines, numbers = [], count(1)
    for part, (card, elements) in enumerate(
        zip(_PARTS, mesh.elements, strict=True), start=1
    ):
        lines += [
            f"/PART/{part}",
            card.title,
            f"{card.property:10d}{card.material:10d}",
            f"/{card.kind}/{part}",
        ]
        lines += [_format_integers([next(numbers), *nodes]) for nodes in elements]
    return "\n".join(lines)


def _group(number: int, title: str, nodes: Iterable[int]) -> str:
    listed = list(nodes)
    lines = (
        _format_integers(listed[first : first + 10])
        for first in range(0, len(listed), 10)
    )
    return "\n".join((f"/GRNOD/NODE/{number}", title, *lines))


def _format_integers(numbers: Iterable[int]) -> str:
    return "".join(f"{number:10d}" for number in numbers)


def _push_cards() -> str:
    times = np.linspace(0, _PUSH_TIME, 41)
    shape = np.sin(np.pi * times / _PUSH_TIME)
    points = (
        f"{time:20.9g}{value:20.9g}"
        for time, value in zip([*times, 1.0], [*shape, 0.0], strict=True)
    )
    lines = ["/FUNCT/1", "half a sine", *points]
    for number, (axis, force) in enumerate(zip("XYZ", _PUSH, strict=True), start=1):
        lines += [
            f"/CLOAD/{number}",
            "push",
            f"{1:10d}{axis:>10}{0:10d}{0:10d}{3:10d}          {1:20d}{force:20.9g}",
        ]
    return "\n".join(lines)


def _write_history_cards(nodes: Iterable[int]) -> str:
    return "\n".join((
        "/TH/NODE/1", "frame", "DX        DY        DZ        VX        VY        VZ",
        *(f"{node:10d}{0:10d}node {node}" for node in nodes),
        "/TH/PART/2", "parts", "DEF       MASS", _format_integers(range(1, len(_PARTS) + 1)),
        "/TH/INTER/3", "contact", "DEF", _format_integers([1]),
    ))  # fmt: skip
