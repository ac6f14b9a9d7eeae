"""Skip the sections between the control words and the states of a d3plot: nodes, elements, part ids and titles.

Only sections that describe the states are read; the others are skipped according to the lengths in the control words.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from d2rpick.histories.formats.d3plot_words import CONTROL, LONG_IDS, count_dimensions
from d2rpick.histories.names import clean_text

if TYPE_CHECKING:
    from collections.abc import Mapping

    from d2rpick.histories.formats.d3plot_words import Words

_WITH_MATERIAL_TYPES: Final = (5, 7)
_WITH_ROADS: Final = (6, 7, 9)
WITH_RIGID_BODIES: Final = (8, 9)
# Number of words that the sections of additional nodes contain per element, keyed by element type.
_EXTRA_NODES: Final = {"nel48": 5, "nel20": 13}
_FULL_QUADRATIC: Final = {"nel27": 28, "nel21p": 22, "nel15t": 8}
_CUBIC: Final = {"nel20t": 21, "nel40p": 41, "nel64": 65}

_NUMBERING: Final = 10  # Length of the numbering section without its ids [words].
# Length of the head of a numbering section that contains part ids [words].
_PART_NUMBERING: Final = 16
# Length of a title [bytes], which does not depend on the word size.
_TITLE: Final = 72
_RUN_TITLE: Final = 90_000
_PART_TITLES: Final = 90_001
_KEYWORDS: Final = 90_100
_OTHER_TITLES: Final = (90_002, 90_020)
_KEYWORD: Final = 80  # Length of a keyword line [bytes].
_MOST_TITLES: Final = 1_000_000


class Geometry:
    """The sections between the control words and the titles, skipped one after another.

    ``at`` is the index of the word at which the next section begins. ``part_ids`` contains the ids of the parts, first
    in ascending order, then in the order of their definition; it is empty if the file has none. The other attributes
    are numbers of values in a state.
    """

    def __init__(self, words: Words, control: Mapping[str, int]) -> None:
        self._words, self._control = words, control
        self.at = CONTROL + max(0, control["extra"])
        self.part_ids: tuple[tuple[int, ...], ...] = ()
        self.rigid_shells = self.values_of_sph = self.airbag_values = self.roads = (
            self.rigid_bodies
        ) = 0
        self._airbag_geometry = self._left_nodes = 0

    def pass_over(self) -> None:
        """Skip all sections, one after another."""
        self._material_types()
        self.at += self._control["ialemat"]
        self._sph_flags()
        self._airbag_flags()
        self._nodes_and_elements()
        self._rigid_bodies()
        self.at += (
            2 * self._control["nadapt"]
            + 2 * self._control["nmsph"]
            + self._airbag_geometry
        )
        self._roads()
        self._extra_nodes()

    def _next(self, count: int) -> tuple[int, ...]:
        """Read ``count`` integers from the file and advance; raise FormatError if one of them is negative."""
        counts = self._words.integers(self.at, count)
        if min(counts) < 0:
            raise self._words.damaged(f"a count of {min(counts)} at word {self.at}")
        self.at += count
        return counts

    def _material_types(self) -> None:
        """Skip the material types, and count the shells of rigid parts, which have no values in a state."""
        if self._control["ndim"] in _WITH_MATERIAL_TYPES:
            self.rigid_shells, materials = self._next(2)
            self.at += materials

    def _sph_flags(self) -> None:
        """Skip the SPH flags, and count the values of a particle."""
        if self._control["nmsph"] <= 0:
            return
        begin = self.at
        (length,) = self._next(1)
        flags = self._words.integers(begin + 1, 10)
        # Older files have no word for history variables.
        histories = flags[-1] if length > len(flags) else 0
        self.values_of_sph = 1 + sum(abs(flag) for flag in flags[:-1]) + histories
        self.at = begin + length

    def _airbag_flags(self) -> None:
        """Skip the particle airbag flags, and count the airbag values in a state."""
        airbags = self._control["npefg"] % 1000
        version = self._control["npefg"] // 1000
        if self._control["npefg"] <= 0:
            return
        of_geometry, of_particle, particles, of_airbag = self._next(4)
        # Version 4 of the airbag data has an additional word for the number of chambers.
        self.at += version == 4
        # Each value has a type and a name.
        self.at += 9 * (of_geometry + of_particle + of_airbag)
        self._airbag_geometry = airbags * of_geometry
        self.airbag_values = airbags * of_airbag + particles * of_particle

    def _nodes_and_elements(self) -> None:
        """Skip nodes and elements.

        The two additional nodes of solids follow the solids or, in some releases, all elements.
        """
        control = self._control
        solids = abs(self._control["nel8"])
        self.at += count_dimensions(control) * control["numnp"] + 9 * solids
        shells = 9 * control["nelt"] + 6 * control["nel2"] + 5 * control["nel4"]
        more_nodes = 2 * solids if control["nel8"] < 0 else 0
        # The start of the numbering section shows whether the additional nodes come before or after it.
        follows = not more_nodes or self._begins_numbering(
            self.at + more_nodes + shells
        )
        self.at += shells + (more_nodes if follows else 0)
        self._left_nodes = 0 if follows else more_nodes
        self._numbering()

    def _begins_numbering(self, word: int) -> bool:
        """Return True if the section of node and element numbers begins at the given word."""
        width = self._words.form.width
        if not self._words.has(word * width, _NUMBERING * width):
            return False
        counts = self._words.integers(word + 5, 2)
        return counts == (self._control["numnp"], abs(self._control["nel8"]))

    def _numbering(self) -> None:
        """Skip the numbers of nodes and elements, and read the ids of the parts."""
        size = self._control["narbs"]
        if size <= 0:
            return
        head = self._words.integers(self.at, _NUMBERING)
        if head[0] < 0:
            self.part_ids = self._ids(head, size)
        self.at += size

    def _ids(self, head: tuple[int, ...], size: int) -> tuple[tuple[int, ...], ...]:
        """Read the part ids, sorted and in the order of definition, from a numbering section of ``size`` words."""
        form = self._words.form
        count = self._control["nmmat"]
        long = self._control["filetype"] >= LONG_IDS
        width = 8 if long else form.width
        expected = _PART_NUMBERING + (sum(head[5:]) + 3 * count) * width // form.width
        if size != expected:
            raise self._words.damaged(
                f"a section of ids of {size} words, not of {expected}"
            )
        begin = (self.at + size) * form.width - 3 * count * width
        found_ids = np.frombuffer(
            self._words.bytes(begin, 2 * count * width), f"{form.order}i{width}"
        )
        return tuple(tuple(ids.tolist()) for ids in found_ids.reshape(2, count))

    def _rigid_bodies(self) -> None:
        """Skip the rigid bodies, and count them."""
        if self._control["ndim"] not in WITH_RIGID_BODIES:
            return
        (self.rigid_bodies,) = self._next(1)
        for _ in range(self.rigid_bodies):
            _, nodes = self._next(2)
            self.at += nodes
            (active,) = self._next(1)
            self.at += active

    def _roads(self) -> None:
        """Skip the rigid roads, and count them."""
        if self._control["ndim"] not in _WITH_ROADS:
            return
        nodes, _, self.roads, _ = self._next(4)
        self.at += 4 * nodes
        for _ in range(self.roads):
            _, segments = self._next(2)
            self.at += 4 * segments

    def _extra_nodes(self) -> None:
        """Skip the additional nodes of higher-order elements."""
        control = self._control
        kinds = dict(_EXTRA_NODES)
        if control["quadr"]:
            kinds |= _FULL_QUADRATIC
        if control["cubic"]:
            kinds |= _CUBIC
        self.at += self._left_nodes + sum(
            words * control[name] for name, words in kinds.items()
        )


class Titles:
    """The titles after the geometry; ``at`` is the offset of the first byte after them, where the states may begin."""

    def __init__(self, words: Words, at: int) -> None:
        self._words, self.at = words, at
        self.of_run, self.of_parts = "", dict[int, str]()

    def read(self) -> None:
        """Read all titles; raise FormatError if the geometry does not end here."""
        width = self._words.form.width
        if not self._words.has(self.at, width):
            self._words.bytes(self.at, width)
        if not self._words.ends_at(self.at):
            raise self._words.damaged(
                f"no end of the geometry at byte {self.at}, where its head says"
            )
        self.at += width
        while self._words.has(self.at, width) and self._section():
            if self._words.ends_at(self.at):
                self.at += width

    def _section(self) -> bool:
        """Read the title section that begins here; return False if the section here is of another type."""
        (kind,), width = self._integers(1), self._words.form.width
        if kind == _RUN_TITLE:
            self.of_run = clean_text(self._words.bytes(self.at + width, _TITLE))
            self.at += width + _TITLE
            return True
        if kind not in (_PART_TITLES, _KEYWORDS, *_OTHER_TITLES):
            return False
        kind, count = self._integers(2)
        size = _KEYWORD if kind == _KEYWORDS else width + _TITLE
        rows = self._words.bytes(self.at + 2 * width, min(count, _MOST_TITLES) * size)
        if kind == _PART_TITLES:
            for begin in range(0, len(rows), size):
                id_ = int(
                    np.frombuffer(
                        rows[begin : begin + width], self._words.form.integer
                    )[0]
                )
                self.of_parts[id_] = clean_text(rows[begin + width : begin + size])
        self.at += 2 * width + len(rows)
        return True

    def _integers(self, count: int) -> tuple[int, ...]:
        """Return the given number of integers without advancing in the file."""
        integers = self._words.bytes(self.at, count * self._words.form.width)
        return tuple(np.frombuffer(integers, self._words.form.integer).tolist())
