"""Synthetic car with the difficulties of real ones: parts of the same name, an oscillating engine, detached wheels.

The body is thrown, rotates and flies until it lands.  The wheels fly away from it and land earlier; all hubs are one
part in two pieces.  The files are a T01 as OpenRadioss writes it, and the mesh as decks of both solvers.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import Final

import numpy as np

from d2rpick.histories.history import Samples
from tests.made_t01 import MadePart, write_head

BODY: Final = (1, 2, 3, 4, 5, 6)
WHEELS: Final = (7, 8, 9)
TITLES: Final = {
    **dict.fromkeys(BODY, "panel"),
    6: "engine",
    7: "hubs",
    8: "tyre",
    9: "tyre",
}
MASSES: Final = np.array([70.0, 80.0, 90.0, 75.0, 85.0, 200.0, 30.0, 10.0, 10.0])
ENGINE: Final = BODY.index(6)
LANDS, WHEELS_LAND = 0.15, 0.06
TIME: Final = np.arange(801) * 2.5e-4
_CODES: Final = (1, 2, 3, 4, 5, 6)  # energies, momentum, mass


def list_quads() -> Iterator[tuple[int, tuple[int, int, int, int]]]:
    """Return part id and nodes of each element: six that share nodes, and a hub and a tyre for each of two wheels."""
    yield from (
        (part, (n, n + 1, n + 5, n + 4))
        for part, n in zip(BODY, (1, 2, 3, 5, 6, 7), strict=True)
    )
    for first, tyre in ((21, 8), (31, 9)):
        yield from (
            (part_id, (n, n + 1, n + 3, n + 2))
            for part_id, n in ((7, first), (tyre, first + 2))
        )


def place_nodes() -> dict[int, tuple[float, float, float]]:
    """Return the node coordinates [m]; the body is not planar, so that its parts show its rotation."""
    coordinates = {
        1 + x + 4 * y: (1.2 * x, 0.8 * y, 0.3 * (x - 1) * (y - 1))
        for x in range(4)
        for y in range(3)
    }
    for first, y in ((21, -1.0), (31, 3.0)):
        coordinates |= {
            first + x + 2 * z: (1.0 + 0.4 * x, y, -0.5 + 0.2 * z)
            for x in range(2)
            for z in range(3)
        }
    return coordinates


def compute_centres() -> Samples:
    """Return the part centres, shape (parts, 3): the means of their elements."""
    coordinates = place_nodes()
    return np.array(
        [
            np.mean(
                [
                    coordinates[n]
                    for part_id, nodes in list_quads()
                    if part_id == part
                    for n in nodes
                ],
                axis=0,
            )
            for part in TITLES
        ]
    )


def compute_momenta(periods: float, wheels_land: float = WHEELS_LAND) -> Samples:
    """Return the part momenta over `TIME`, shape (n, parts, 3).

    The engine oscillates ``periods`` times until the landing; the wheels fly away.
    """
    body, masses = len(BODY), MASSES[: len(BODY)]
    inside = np.repeat(compute_centres()[np.newaxis, :body], TIME.size, axis=0)
    inside[:, ENGINE] += np.outer(
        0.02 * np.sin(2 * np.pi * periods * TIME / LANDS), (0.2, 0.6, 0.8)
    )
    inside -= np.einsum("p,npi->ni", masses / masses.sum(), inside)[:, np.newaxis]
    sine, cosine = np.sin(1.5 * TIME), np.cos(1.5 * TIME)
    where = inside.copy()
    where[:, :, 1] = (
        cosine[:, np.newaxis] * inside[:, :, 1] - sine[:, np.newaxis] * inside[:, :, 2]
    )
    where[:, :, 2] = (
        sine[:, np.newaxis] * inside[:, :, 1] + cosine[:, np.newaxis] * inside[:, :, 2]
    )
    velocity = np.empty((TIME.size, len(TITLES), 3))
    velocity[:, :body] = np.gradient(where, TIME, axis=0, edge_order=2)
    velocity[:, body:] = (0.0, 3.0, 0.0)
    velocity += (4.0, -2.5, -1.0)
    for parts, begin in ((slice(body), LANDS), (slice(body, None), wheels_land)):
        time_after_begin = np.clip(TIME - begin, 0.0, None)[:, np.newaxis]
        velocity[:, parts, 2] += (
            2.0 * np.sin(60 * time_after_begin) ** 2 - 9.81 * TIME[:, np.newaxis]
        )
    return np.asarray(velocity * MASSES[:, np.newaxis])


def write_t01(folder: Path, periods: float, wheels_land: float = WHEELS_LAND) -> str:
    """Write the time history and return its name."""
    moved = compute_momenta(periods, wheels_land)
    energy = 50.0 + 20.0 * np.cos(2 * np.pi * 90 * TIME) * np.exp(-10 * TIME)
    parts = [MadePart(part, title, _CODES) for part, title in TITLES.items()]
    writer = write_head(parts, globals_=len(_CODES))
    for i in range(TIME.size):
        rows = [
            [energy[i] * m / 100, p @ p / (2 * m), *p, m]
            for p, m in zip(moved[i], MASSES, strict=True)
        ]
        whole = np.sum(rows, axis=0)
        writer.state(
            TIME[i],
            [whole[0], whole[1], *whole[2:5], whole[5]],
            [value for row in rows for value in row],
        )
    name = folder / "MADET01"
    name.write_bytes(bytes(writer.data))
    return str(name)


def write_starter(folder: Path, extra_text: str = "") -> str:
    """Write the Radioss starter deck and return its name."""
    nodes = "".join(
        f"{node:10d}{x:20g}{y:20g}{z:20g}\n"
        for node, (x, y, z) in place_nodes().items()
    )
    text = f"#RADIOSS STARTER\n/BEGIN\nMADE\n      2022         0\n/NODE\n{nodes}"
    text += "/MAT/ELAST/1\nsteel\n              7800.0\n         210000000000                 0.3\n"
    text += "/PROP/SHELL/1\nshell\n        24\n\n\n         3         0               0.001\n"
    for part, title in TITLES.items():
        rows = (
            _row(n, *nodes)
            for n, (part_id, nodes) in enumerate(list_quads(), 1)
            if part_id == part
        )
        text += f"/PART/{part}\n{title}\n{_row(1, 1)}/SHELL/{part}\n{''.join(rows)}"
    name = folder / "MADE_0000.rad"
    text += "/GRAV/1\ngravity\n" + f"{'':10}{'Z':>10}".ljust(80) + f"{-9.81:20g}\n"
    name.write_text(f"{text}{extra_text}/END\n")
    return str(name)


def write_keywords(folder: Path, extra_text: str = "") -> str:
    """Write the same model as an LS-DYNA deck and return its name."""
    text = "*KEYWORD\n" + "".join(
        f"*PART\n{title}\n{_row(part, 1, 1)}" for part, title in TITLES.items()
    )
    text += f"*SECTION_SHELL\n{_row(1, 2)}     0.001     0.001     0.001     0.001\n"
    text += "*MAT_ELASTIC\n         1    7800.0    2.1e11       0.3\n*NODE\n"
    text += "".join(
        f"{node:8d}{x:16g}{y:16g}{z:16g}\n" for node, (x, y, z) in place_nodes().items()
    )
    rows = (
        _row(n, part, *nodes, width=8)
        for n, (part, nodes) in enumerate(list_quads(), 1)
    )
    name = folder / "made.k"
    text += (
        f"*LOAD_BODY_Z\n         1{9.81:10g}\n*DEFINE_CURVE\n         1\n"
        f"{_row(0, 1, width=20)}{_row(1, 1, width=20)}"
    )
    name.write_text(f"{text}*ELEMENT_SHELL\n{''.join(rows)}{extra_text}*END\n")
    return str(name)


def _row(*numbers: int, width: int = 10) -> str:
    return "".join(f"{number:{width}d}" for number in numbers) + "\n"
