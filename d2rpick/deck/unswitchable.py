"""Find the parts that must not be switched whatever their energy, and the reasons.

Material that flows through its mesh is not a body. A law that computes the stress from the deformation since the start
has the start as its stress-free reference. The changes of the part while it is rigid (stresses that were set to zero,
or a motion that differs from its own) become a deformation when it is switched back.

Source: the vendor's keyword data for ELFORM, the theory of the laws, Altair's public help for /ALE/MAT, /EULER/MAT,
/PROP/SOLID and the laws, and a report of 2026 on LS-DYNA R14 (a hyperelastic solid that had stress after it was
switched back). This was not tested with LS-DYNA.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Final

from d2rpick.base.tuples import NamedTuple
from d2rpick.deck.ls_dyna_columns import MATERIAL
from d2rpick.deck.ls_dyna_parts import DeckParts, name_material, read_sections
from d2rpick.deck.radioss_columns import SOLID_FLAGS

if TYPE_CHECKING:
    from collections.abc import Mapping

    from d2rpick.deck.radioss_deck import Starter
    from d2rpick.deck.reader import Deck

# Formulations of *SECTION_SOLID (ELFORM) in which material flows through the mesh.
_FLOWING: Final = {5: "ALE", 6: "Eulerian", 7: "Eulerian", 11: "ALE", 12: "ALE"}
# Patterns of the *MAT keywords, by name and number, of material laws with a stress-free reference state.
# They are compiled at their first use, to keep start-up fast.
_REFERENCE_BY_NAME: Final = (
    r"MAT_(BLATZ-KO|MOONEY-RIVLIN|FRAZER_NASH|FRAZER-NASH|HYPERELASTIC|OGDEN|ARRUDA_BOYCE|SIMPLIFIED_RUBBER"
    r"|SOFT_TISSUE|LOW_DENSITY_FOAM|FU_CHANG_FOAM|ORTHOTROPIC_ELASTIC|ANISOTROPIC_ELASTIC)"
)
_REFERENCE_BY_NUMBER: Final = r"MAT_0*(2|7|27|31|57|77|77_[HO]|83|91|92|127|181)(_|\Z)"
_LAWS_WITH_REFERENCE: Final = {
    *(
        "LAW42",
        "OGDEN",
        "LAW62",
        "VISC_HYP",
        "LAW69",
        "LAW82",
        "LAW88",
        "TABULATED",
        "LAW92",
        "ARRUDA_BOYCE",
    ),
    *("LAW94", "YEOH", "LAW95", "BERGSTROM_BOYCE", "LAW100", "MNF", "LAW111", "MARLOW"),
}
# Values of Ismstr for solids whose stress follows from the total strain.
_TOTAL_STRAIN: Final = {10, 11, 12}
_GAINS: Final = "so it may gain stress when it is switched back"


class Unswitchable(NamedTuple):
    """The reason why a part must not be switched.

    ``flows`` is True if its material flows through the mesh, and False if its material law has a reference state.
    """

    flows: bool
    reason: str


def find_unswitchable_in_ls_dyna(
    deck: Deck, parts: DeckParts
) -> dict[int, Unswitchable]:
    """Return the parts of an LS-DYNA deck whose section or material forbids switching, by part id."""
    sections = read_sections(deck)
    laws = {
        name_material(card, card.data[0], MATERIAL["MID"]): card.name
        for card in deck.named("MAT")
        if card.data
    }
    reasons: dict[int, Unswitchable] = {}
    for part, material in parts.material_by_part.items():
        section = sections.get(parts.sections.get(part, 0))
        law = laws.get(material, "").removesuffix("_TITLE")
        if section and section.kind == "SOLID" and section.elform in _FLOWING:
            reasons[part] = _make_flowing(
                f"{_FLOWING[section.elform]}, ELFORM {section.elform}"
            )
        elif law and (
            re.match(_REFERENCE_BY_NAME, law) or re.match(_REFERENCE_BY_NUMBER, law)
        ):
            reasons[part] = _make_with_reference(f"*{law}")
    return reasons


def find_unswitchable_in_radioss(starter: Starter) -> dict[int, Unswitchable]:
    """Return the parts of a starter deck that must not be switched, by part id, from materials and properties."""
    # Imported here to keep start-up fast.
    from d2rpick.deck.radioss_deck import get_number

    flowing = {
        get_number(card, 2): card.words[0]
        for card in starter.named("ALE", "EULER")
        if card.words[1:2] == ("MAT",)
    }
    laws = {
        get_number(card, 2): card.words[1]
        for card in starter.named("MAT")
        if card.words[2:]
    }
    strains = _read_strain_flags(starter)
    reasons: dict[int, Unswitchable] = {}
    for part, line in starter.parts.items():
        if line.material in flowing:
            reasons[part] = _make_flowing(
                f"/{flowing[line.material]}/MAT/{line.material}"
            )
        elif laws.get(line.material) in _LAWS_WITH_REFERENCE:
            reasons[part] = _make_with_reference(f"/MAT/{laws[line.material]}")
        elif strains.get(line.prop, 0) in _TOTAL_STRAIN:
            reasons[part] = _make_with_reference(f"Ismstr {strains[line.prop]}")
    return reasons


def _read_strain_flags(starter: Starter) -> Mapping[int, int]:
    """Return the Ismstr of solid properties, keyed by property id."""
    from d2rpick.deck.radioss_deck import SOLIDS, get_lines_below_title, get_number

    solids = [
        card
        for card in starter.named("PROP")
        if card.words[2:] and card.words[1] in SOLIDS
    ]
    return {
        get_number(card, 2): card.integer(row, SOLID_FLAGS["Ismstr"]).value
        for card in solids
        for row in get_lines_below_title(card)[:1]
    }


def _make_flowing(how: str) -> Unswitchable:
    """Return the reason why a part whose material flows through the mesh must not be switched."""
    return Unswitchable(True, f"its material flows through the mesh ({how})")


def _make_with_reference(how: str) -> Unswitchable:
    """Return the reason why a part whose material law has a stress-free reference state must not be switched."""
    return Unswitchable(
        False, f"its law keeps a stress-free reference ({how}), {_GAINS}"
    )
