"""Write the coarse decks in ``sample_data``: the rollover box with its step and the sled, as shells.

Run ``python -m tests.sample_deck``.  The LS-DYNA deck has the parts of the sample histories of the box, for ``d2rpick
parts``.  In the Radioss decks, box and step fly, deformable for 20 ms and rigid for 20 ms, for ``d2rpick calibrate``;
their listings are those of the solver, reduced to the summary.
"""

import itertools
from collections.abc import Iterator

import numpy as np

from d2rpick.histories.history import Samples
from tests.command import ROOT

DECK = ROOT / "sample_data" / "rollover_box.k"
FLYING = ROOT / "sample_data" / "flying_box"
_X, _Y, _Z = (
    np.linspace(-0.9, 0.0, 4),
    np.linspace(0.0, 1.5, 6),
    np.linspace(0.2, 1.4, 5),
)
_SLED, _MAIN = 3, 9999  # part id of the sled, and main node of the rigid body
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
    """Nodes by position, and shells by part."""

    def __init__(self) -> None:
        self.nodes: dict[tuple[float, ...], int] = {}
        self.shells: list[tuple[int, list[int]]] = []

    def grid(
        self,
        part: int,
        fixed: int,
        level: float,
        first_span: Samples,
        second_span: Samples,
    ) -> None:
        """Fill a rectangle in the plane in which coordinate ``fixed`` is ``level`` with shells."""
        for a, b in itertools.pairwise(first_span):
            for c, d in itertools.pairwise(second_span):
                corners = [(a, c), (b, c), (b, d), (a, d)]
                self.shells.append(
                    (
                        part,
                        [
                            self._node(*np.insert(corner, fixed, level))
                            for corner in corners
                        ],
                    )
                )

    def _node(self, *position: float) -> int:
        key = tuple(round(float(value), 6) for value in position)
        return self.nodes.setdefault(key, len(self.nodes) + 1)


def make_deck() -> str:
    """Return the text of the LS-DYNA deck."""
    return "\n".join(_lines(_mesh())) + "\n"


def make_radioss_files() -> dict[str, str]:
    """Return the texts of the starter and of two engine files by file name."""
    step = "/VERS/2022\n/DT\n0.9 0.0\n/DTIX\n5e-05 5e-05\n"
    run_time_cards = "/TFILE/4\n0.001\n/PRINT/-2000\n/MON/ON\n"
    legs = {
        f"BOX_000{leg}.rad": f"/RUN/BOX/{leg}\n{stop}\n{step}/RBODY/{word}\n9999\n{run_time_cards}"
        for leg, stop, word in ((1, 0.02, "OFF"), (2, 0.04, "ON"))
    }
    return {"BOX_0000.rad": "\n".join(_starter(_mesh())) + "\n", **legs}


def _mesh() -> _Mesh:
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
    return mesh


def _lines(mesh: _Mesh) -> Iterator[str]:
    yield "*KEYWORD\n*TITLE\nrollover box on a sled, coarse"
    yield "*PART"
    for number, (title, section, material) in enumerate(
        (("box", 1, 1), ("step", 2, 1), ("sled", 1, 2)), start=1
    ):
        yield f"{title}\n{number:10d}{section:10d}{material:10d}"
    yield _CARDS + "*NODE"
    for (x, y, z), number in mesh.nodes.items():
        yield f"{number:8d}{x:16.6f}{y:16.6f}{z:16.6f}"
    yield "*ELEMENT_SHELL"
    for number, (part, nodes) in enumerate(mesh.shells, start=1):
        yield f"{number:8d}{part:8d}" + "".join(f"{node:8d}" for node in nodes)
    yield f"*LOAD_BODY_Z\n{1:10d}{9.81:10g}\n*DEFINE_CURVE\n{1:10d}\n{0:20d}{1:20d}\n{1:20d}{1:20d}"
    # The output that the sample histories contain, and that a switched run needs for its comparison.
    yield f"*DATABASE_GLSTAT\n{0.001:10g}\n*DATABASE_MATSUM\n{0.001:10g}\n*END"


def _starter(mesh: _Mesh) -> Iterator[str]:
    shells = [(part, nodes) for part, nodes in mesh.shells if part != _SLED]
    used = sorted({node for _, nodes in shells for node in nodes})
    node_positions = {number: position for position, number in mesh.nodes.items()}
    yield "#RADIOSS STARTER\n/BEGIN\nBOX\n      2022         0"
    yield (
        f"{'kg':>20}{'m':>20}{'s':>20}\n" * 2
        + "/TITLE\nflying box\n/MAT/PLAS_JOHNS/1\nsteel"
    )
    yield f"{7850:20d}\n{2.1e11:20g}{0.3:20g}{0:10d}\n{3.5e8:20g}{6e8:20g}{0.5:20g}{0:20d}{0:20d}"
    yield f"{0:20d}{0:20d}{0:10d}{0:10d}{0:20d}{0:20d}\n" + f"{0:20d}" * 4
    for number, (form, thickness) in enumerate(((24, 0.005), (12, 0.002)), start=1):
        yield (
            f"/PROP/SHELL/{number}\nshell\n{form:10d}{0:10d}{0:10d}{0:10d}{'':20}{0:20d}\n"
            + f"{0:20d}" * 5
        )
        yield f"{3:10d}{0:10d}{thickness:20g}{0:20d}{'':10}{1:10d}{1:10d}"
    yield "/NODE"
    for node in used:
        yield f"{node:10d}" + "".join(
            f"{value:20.6f}" for value in node_positions[node]
        )
    yield f"{_MAIN:10d}{-0.45:20.6f}{0.75:20.6f}{0.8:20.6f}"
    for number, title in ((1, "box"), (2, "step")):
        yield f"/PART/{number}\n{title}\n{number:10d}{1:10d}\n/SHELL/{number}"
        for id_, (part, nodes) in enumerate(shells, start=1):
            if part == number:
                yield f"{id_:10d}" + "".join(f"{node:10d}" for node in nodes)
    for group, members in ((1, used), (2, [*used, _MAIN])):
        yield f"/GRNOD/NODE/{group}\nnodes"
        yield from (
            "".join(f"{node:10d}" for node in members[first_member : first_member + 10])
            for first_member in range(0, len(members), 10)
        )
    yield f"/RBODY/1\nbody\n{_MAIN:10d}{0:10d}{0:10d}{0:10d}{0:20d}{1:10d}{0:10d}{0:10d}{0:10d}"
    yield f"{0:20d}{0:20d}{0:20d}\n" * 2 + f"{0:10d}{0:10d}{0:10d}"
    yield f"/INIVEL/TRA/1\nflight\n{4:20d}{0:20d}{2:20d}{2:10d}{0:10d}\n/TH/PART/1\nparts\nDEF\n{1:10d}{2:10d}\n/END"


if __name__ == "__main__":
    DECK.write_text(make_deck(), "utf-8")
    FLYING.mkdir(exist_ok=True)
    for name, text in make_radioss_files().items():
        (FLYING / name).write_text(text, "utf-8")
