"""Write families of d3plot files for tests and benchmarks, in both precisions and byte orders."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

END = -999999.0
BLOCK = 512  # files are filled up to a multiple of this number of words

# Indices of the control words that are not 0 in every file.
_PLACES = {
    "filetype": 11, "ndim": 15, "numnp": 16, "icode": 17, "nglbv": 18, "it": 19, "iu": 20, "iv": 21, "ia": 22,
    "nel8": 23, "nummat8": 24, "nv3d": 27, "nel2": 28, "nummat2": 29, "nv1d": 30, "nel4": 31, "nummat4": 32,
    "nv2d": 33, "maxint": 36, "nmsph": 37, "narbs": 39, "nelt": 40, "nv3dt": 42, "ialemat": 47, "nadapt": 50,
    "nmmat": 51, "npefg": 54, "nel48": 55, "idtdt": 56, "extra": 57, "nel20": 64, "nt3d": 65, "nel27": 66,
    "nel20t": 71, "quadr": 74, "cubic": 75, "penout": 78, "engout": 79,
}  # fmt: skip


@dataclass(frozen=True)
class State:
    """Time and values of the model and its parts; ``velocities`` has shape (parts, 3)."""

    time: float
    kinetic: Sequence[float]
    internal: Sequence[float]
    velocities: Any
    masses: Sequence[float]
    hourglass: Sequence[float]
    model: Sequence[float]
    walls: Sequence[float] = ()

    def values(self) -> list[float]:
        """Return the global values, which begin a state."""
        whole = [
            sum(self.kinetic),
            sum(self.internal),
            sum(self.kinetic) + sum(self.internal),
            *self.model,
        ]
        velocities = np.ravel(self.velocities)
        parts = [
            *self.internal,
            *self.kinetic,
            *velocities,
            *self.masses,
            *self.hourglass,
        ]
        return [self.time, *whole, *parts, *self.walls]


def make_states(times: Sequence[float], parts: int = 2, walls: int = 0) -> list[State]:
    """Make states whose values are all different."""
    states_made = []
    for number, time in enumerate(times, start=1):
        part_values = np.arange(1, parts + 1)
        velocities = np.outer(part_values, [1.0, -2.0, 0.5]) * number
        forces = [7.0 * number + wall for wall in range(4 * walls)]
        states_made.append(
            State(
                time=time,
                kinetic=(part_values * 10 + number).tolist(),
                internal=(part_values * 100 + number).tolist(),
                velocities=velocities,
                masses=(part_values * 2.5).tolist(),
                hourglass=(part_values * 0.25 * number).tolist(),
                model=(0.1 * number, 0.2 * number, -0.3 * number),
                walls=forces,
            )
        )
    return states_made


@dataclass
class D3plotWriter:
    """Writer of a family: ``control`` words, ids and titles of parts, and states.

    ``sections`` are inserted after the sections they are named for: "control", "elements" or "ids".
    """

    width: int = 4
    order: str = "<"
    ids: Sequence[int] = (7, 3)
    titles: Sequence[str] = ("roof", "door")
    title: str = "made for a test"
    control: Mapping[str, int] = field(default_factory=dict)
    sections: Mapping[str, Sequence[int]] = field(default_factory=dict)
    more_of_state: int = 0
    walls: int = 0
    numbered: bool = True
    family: int = 1
    name: str = "R920"
    release: float = 960.0  # the release that every file with part names has
    values_of_part: int = 7

    def real(self, values: Sequence[float]) -> bytes:
        """Return the bytes of real numbers."""
        return np.asarray(values, f"{self.order}f{self.width}").tobytes()

    def whole(self, values: Sequence[int]) -> bytes:
        """Return the bytes of integers."""
        return np.asarray(values, f"{self.order}i{self.width}").tobytes()

    def words(self) -> dict[str, int]:
        """Return the control words by name."""
        parts = len(self.ids)
        sizes = {
            "numnp": 5,
            "nel8": 2,
            "nel4": 1,
            "nel2": 1,
            "nelt": 1,
            "nv3d": 7,
            "nv2d": 9,
            "nv1d": 6,
            "nv3dt": 8,
        }
        switches = {
            "filetype": self.family,
            "ndim": 4,
            "icode": 6,
            "iu": 1,
            "iv": 1,
            "ia": 1,
            "maxint": -10003,
        }
        of_wall = 4 if self.name.strip().startswith("R") or self.release >= 971 else 1
        values = 6 + self.values_of_part * parts + of_wall * self.walls
        words_by_name = {
            **sizes,
            **switches,
            "nglbv": values,
            "nmmat": parts,
            "nummat8": parts,
            "extra": 64,
            **self.control,
        }
        return {
            "narbs": self._numbers(words_by_name).size if self.numbered else 0,
            **words_by_name,
        }

    def head(self) -> bytes:
        """Return the control words, the geometry and the titles."""
        words, plain = self.words(), np.zeros(128, f"{self.order}i{self.width}")
        for name, value in words.items():
            plain[_PLACES[name]] = value
        data = bytearray(plain.tobytes())
        data[: 10 * self.width] = self.title.encode().ljust(10 * self.width)
        data[13 * self.width : 13 * self.width + 4] = self.name.encode()
        data[14 * self.width : 15 * self.width] = self.real([self.release])
        solids = abs(words["nel8"])
        elements = (
            9 * solids + 9 * words["nelt"] + 6 * words["nel2"] + 5 * words["nel4"]
        )
        data += self.whole(self.sections.get("control", ()))
        data += self.real([0.5 + node for node in range(3 * words["numnp"])])
        data += self.whole([1] * elements) + self.whole(
            self.sections.get("elements", ())
        )
        if self.numbered:
            data += self.whole(self._numbers(words))
        data += self.whole(self.sections.get("ids", ()))
        return bytes(data) + self._titles()

    def _numbers(self, words: dict[str, int]) -> Any:
        """Return the section of node, element and part ids."""
        counts = [
            words["numnp"],
            abs(words["nel8"]),
            words["nel2"],
            words["nel4"],
            words["nelt"],
        ]
        head = [-1, 1, 1, 1, 1, *counts, 0, 0, 0, len(self.ids), 0, len(self.ids)]
        numbers_in_order = [
            number for count in counts for number in range(1, count + 1)
        ]
        return np.array(
            [
                *head,
                *numbers_in_order,
                *self.ids,
                *self.ids,
                *range(1, len(self.ids) + 1),
            ]
        )

    def _titles(self) -> bytes:
        rows = b"".join(
            self.whole([id_]) + title.encode().ljust(72)
            for id_, title in zip(self.ids, self.titles, strict=False)
        )
        parts = self.whole([90001, len(self.titles)]) + rows if self.titles else b""
        end = self.real([END])
        return end + parts + self.whole([90000]) + self.title.encode().ljust(72) + end

    def state(self, state: State) -> bytes:
        """Return one state: its values, then nodes and elements, none of which is 0."""
        words = self.words()
        elements = (
            abs(words["nel8"]) * words["nv3d"]
            + words["nel4"] * words["nv2d"]
            + words["nel2"] * words["nv1d"]
            + words["nelt"] * words["nv3dt"]
        )
        solids = abs(words["nel8"]) + words["nel4"] + words["nel2"] + words["nelt"]
        deleted = (
            solids
            if words["maxint"] <= -10000
            else words["numnp"]
            if words["maxint"] < 0
            else 0
        )
        remaining_words = 9 * words["numnp"] + elements + deleted + self.more_of_state
        return self.real([*state.values(), *[0.125] * remaining_words])

    def file(self, states: Sequence[State], *, ended: bool = True) -> bytes:
        """Return a file of states only, filled up after the end mark."""
        return self.filled(
            b"".join(map(self.state, states)) + (self.real([END]) if ended else b"")
        )

    def filled(self, data: bytes) -> bytes:
        """Fill up to complete blocks."""
        return data + bytes(-len(data) % (BLOCK * self.width))

    def together(self, states: Sequence[State]) -> bytes:
        """Return one file with everything."""
        return self.head() + self.file(states)

    def written(
        self, states: Sequence[State], per_file: int = 1, name: str = "d3plot"
    ) -> dict[str, bytes]:
        """Return a family with ``per_file`` states in each file, by file name."""
        groups = [
            states[begin : begin + per_file]
            for begin in range(0, len(states), per_file)
        ]
        files = {
            f"{name}{number:02d}": self.file(group)
            for number, group in enumerate(groups, start=1)
        }
        return {name: self.filled(self.head()), **files}
