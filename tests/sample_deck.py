"""The coarse deck in ``sample_data``: the rollover box with its step and the sled, as LS-DYNA shells.

Run as ``python -m tests.sample_deck``.  It has the parts of the sample histories of the box, for ``d2rpick parts``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from tests.command import ROOT

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

DECK = ROOT / "sample_data" / "rollover_box.k"
_X, _Y, _Z = np.linspace(-0.9, 0.0, 4), np.linspace(0.0, 1.5, 6), np.linspace(0.2, 1.4, 5)
_CARDS = """*SECTION_SHELL
$#   secid    elform      shrf       nip
         1         2       1.0         3
     0.005     0.005     0.005     0.005
         2        16       1.0         5
     0.002     0.002     0.002     0.002
*MAT_PIECEWISE_LINEAR_PLASTICITY
$#     mid        ro         e        pr      sigy
         1    7850.0    2.1E11       0.3    3.50E8
*MAT_RIGID
         2    7850.0    2.1E11       0.3
"""


class _Mesh:
    """Nodes by place, and shells by part."""

    def __init__(self) -> None:
        self.nodes: dict[tuple[float, ...], int] = {}
        self.shells: list[tuple[int, list[int]]] = []

    def grid(self, part: int, fixed: int, at: float, one: Sequence[float], other: Sequence[float]) -> None:
        """Fill a rectangle, at a constant coordinate ``fixed``, with shells."""
        for a, b in zip(one[:-1], one[1:], strict=True):
            for c, d in zip(other[:-1], other[1:], strict=True):
                corners = [(a, c), (b, c), (b, d), (a, d)]
                self.shells.append((part, [self._node(*np.insert(corner, fixed, at)) for corner in corners]))

    def _node(self, *place: float) -> int:
        key = tuple(round(float(value), 6) for value in place)
        return self.nodes.setdefault(key, len(self.nodes) + 1)


def deck() -> str:
    """Text of the deck."""
    mesh = _Mesh()
    for z in (_Z[0], _Z[-1]):
        mesh.grid(1, 2, z, _X, _Y)
    for x in (_X[0], _X[-1]):
        mesh.grid(1, 0, x, _Y, _Z)
    for y in (_Y[0], _Y[-1]):
        mesh.grid(1, 1, y, _X, _Z)
    step = np.array([0.0, 0.2])
    for x in _X[-2:]:
        mesh.grid(2, 0, x, _Y, step)
    mesh.grid(2, 2, 0.0, _X[-2:], _Y)
    mesh.grid(3, 2, -0.01, np.linspace(-2.0, 2.0, 5), np.array([0.0, 1.5]))
    return "\n".join(_lines(mesh)) + "\n"


def _lines(mesh: _Mesh) -> Iterator[str]:
    yield "*KEYWORD\n*TITLE\nrollover box on a sled, coarse"
    yield "*PART"
    for number, (title, section, material) in enumerate((("box", 1, 1), ("step", 2, 1), ("sled", 1, 2)), start=1):
        yield f"{title}\n{number:10d}{section:10d}{material:10d}"
    yield _CARDS + "*NODE"
    for (x, y, z), number in mesh.nodes.items():
        yield f"{number:8d}{x:16.6f}{y:16.6f}{z:16.6f}"
    yield "*ELEMENT_SHELL"
    for number, (part, nodes) in enumerate(mesh.shells, start=1):
        yield f"{number:8d}{part:8d}" + "".join(f"{node:8d}" for node in nodes)
    yield "*END"


if __name__ == "__main__":
    DECK.write_text(deck(), "utf-8")
