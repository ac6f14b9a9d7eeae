"""Sections of solid elements: the formulation (ELFORM) of every part of solids."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from d2rpick.deck.parts import Parts
    from d2rpick.deck.reader import Deck

# Solid formulations that keep their stresses in global axes, by ELFORM; 0 and 9 co-rotate.
NOT_TURNED: Final = {
    -2: "8 points, selectively reduced, for poor aspect ratios",
    -1: "8 points, selectively reduced, for poor aspect ratios",
    1: "constant stress",
    2: "8 points, selectively reduced",
    3: "8 nodes with rotations",
    4: "4 nodes with rotations",
    10: "tetrahedron with 1 point",
    13: "tetrahedron with nodal pressure",
    15: "pentahedron with 2 points",
    16: "tetrahedron with 10 nodes",
    17: "tetrahedron with 10 nodes",
}
_DEFAULT: Final = 1  # ELFORM of a blank field


def solid_formulations(deck: Deck, parts: Parts) -> dict[int, int]:
    """ELFORM by part, of the parts whose section is a *SECTION_SOLID that is followed."""
    elforms: dict[int, int] = {}
    for card in deck.named("SECTION_SOLID"):
        options = set(card.name.split("_")[2:])
        rows = [row for row in card.rows if not row.blank]
        rows = rows[1::2] if options == {"TITLE"} else rows if not options else rows[:0]
        for row in rows:
            section, elform = card.integer(row, 0), card.integer(row, 1, _DEFAULT)
            if not section.problem and not elform.problem:
                elforms[section.value + card.transform.rest] = elform.value
    return {part: elforms[section] for part, section in parts.sections.items() if section in elforms}
