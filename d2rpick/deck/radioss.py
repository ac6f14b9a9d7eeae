"""Parts and elements of a Radioss starter deck.

Columns: Altair's public help for the elements, properties and materials, and the solver's published source.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from d2rpick.deck import formulations, radioss_loads
from d2rpick.deck.columns import placed, places_of
from d2rpick.deck.expression import ExpressionError, number
from d2rpick.deck.model import Elements, Inventory, Material, PartData, Section, placed_joints
from d2rpick.deck.pieces import placed_boundary
from d2rpick.deck.radioss_engine import blocks, card_of, kept_off, keyword, whole
from d2rpick.deck.radioss_flaws import flaws_of
from d2rpick.deck.radioss_mesh import KINDS, NOT_COUNTED, elements_of, nodes_of
from d2rpick.deck.radioss_run import find_run_windows, left_rigid
from d2rpick.deck.reader import cuts, holds_mesh
from d2rpick.errors import name_units

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from d2rpick.deck.card import Card
    from d2rpick.deck.columns import Integers
    from d2rpick.deck.model import Formulation
    from d2rpick.deck.radioss_run import Run
    from d2rpick.deck.radioss_starter import Starter
    from d2rpick.deck.windows import Window

_WIDTH, _REAL = 10, 20

_ELASTIC: Final = {
    *("ELAST", "LAW1", "LAW01", "PLAS_JOHNS", "LAW2", "LAW02", "PLAS_ZERIL", "PLAS_BRIT", "LAW27", "PLAS_TAB", "LAW36"),
    *("COWPER", "LAW44", "DAMA", "LAW22", "LAW22_DAMA"),
}  # density, then Young's modulus and Poisson's ratio
_VOID: Final = {"VOID", "LAW0", "LAW00"}
_AIRBAG: Final = {"FABRI", "FABR_A", "LAW19", "LAW58"}
_PLAIN_SHELLS: Final = {"SHELL", "TYPE1", "SH_ORTH", "TYPE9"}  # with their thickness in the same columns
_SHELLS: Final = {*_PLAIN_SHELLS, "SH_COMP", "TYPE10", "SH_SANDW", "TYPE11", "SH_FABR", "TYPE16", "STACK", "TYPE17",
                  "TYPE51"}  # fmt: skip
_SOLIDS: Final = {"SOLID", "TYPE14", "SOL_ORTH", "TYPE6"}
_BEAMS: Final = {"BEAM", "TYPE3"}
_TRUSSES: Final = {"TRUSS", "TYPE2"}
_SPRING: Final = {"SPRING", "TYPE4"}
_OTHER_SPRINGS: Final = {"SPR_GENE", "TYPE8", "SPR_BEAM", "TYPE13", "SPR_PUL", "TYPE12", "SPR_AXI", "TYPE25", "KJOINT",
                         "TYPE33", "KJOINT2", "TYPE45"}  # fmt: skip
_OF_SPRINGS: Final = _SPRING | _OTHER_SPRINGS
_DEFAULT_SHELL, _DEFAULT_TRIANGLE, _DEFAULT_SOLID = 1, 2, 1


class _Property(NamedTuple):
    """A property as written: its type and the flags and numbers that matter."""

    type: str
    shell: int = 0
    triangle: int = 0
    solid: int = 0
    section: Section = Section()


def read(run: Run) -> Inventory:
    """Collect the parts and elements of a run whose starter deck was read."""
    starter = run.starter
    if starter is None:
        return Inventory("radioss", {}, (), np.empty((0, 3)), ("no starter deck (NAME_0000.rad) was found",), False)
    cards = [card_of(block) for source in starter.sources for block in blocks(source)]
    worded = [(card, keyword(card.block)) for card in cards]
    raw = [one for card, words in worded if words and words[0] in KINDS for one in elements_of(card, words)]
    ids, coordinates = nodes_of([card for card, words in worded if words[:1] == ("NODE",)])
    kinds = sorted({(kind, nodes.shape[1]) for kind, _, nodes in raw})
    table, places = placed(
        ids, [np.concatenate([n for name, _, n in raw if (name, n.shape[1]) == kind]) for kind in kinds]
    )
    elements = tuple(
        Elements(kind[0], np.concatenate([part for name, part, n in raw if (name, n.shape[1]) == kind]), nodes)
        for kind, nodes in zip(kinds, places, strict=True)
    )
    beyond = np.full((table.size - ids.size, 3), np.nan)
    notes = tuple(_notes(run, worded, elements, starter, len(beyond)))
    windows = find_run_windows(run).windows.windows if run.legs else ()
    parts = _parts(starter, worded, elements, _always_rigid(windows))
    held = radioss_loads.joints_of(run, starter, worded)
    return Inventory(
        "radioss", parts, elements, np.concatenate([coordinates, beyond]), notes, not notes,
        joints=placed_joints(held.found, table), switched=placed_joints(held.switched, table), ties=held.unknown,
        watched=places_of(_watched(worded), table), moved=any(words[:1] == ("TRANSFORM",) for _, words in worded),
        files=tuple(run.deck.sources),
        history_groups=frozenset(whole(words[-1]) for _, words in worded if words[:1] == ("THPART",)),
        kept_off=kept_off(run.legs), flaws=flaws_of(run, _switched(run, starter)),
        boundary=placed_boundary(radioss_loads.read(run, starter, worded), table),
        left_rigid=left_rigid(run, windows),
    )  # fmt: skip


def _switched(run: Run, starter: Starter) -> set[int]:
    """Main nodes that the legs switch; of all bodies where there is no engine file."""
    named = {node.value for leg in run.legs for _, _, nodes in leg.switched for node in nodes}
    return named if run.legs else {body.node.value for body in starter.bodies}


def _watched(cards: Sequence[tuple[Card, tuple[str, ...]]]) -> Integers:
    """Ids of the nodes of /TH/NODE, below a line of a title and one of variables."""
    watching = [card for card, words in cards if words[:2] == ("TH", "NODE")]
    rows = [row for card in watching for row in card.rows[1:] if not row.blank]
    ids = [_whole_number(row.text[:_WIDTH]) for row in rows]
    return np.unique(np.array([one for one in ids if one], np.int64))


def _notes(
    run: Run, cards: Sequence[tuple[Card, tuple[str, ...]]], elements: Sequence[Elements], starter: Starter, lost: int
) -> Iterator[str]:
    """Say what may be missing."""
    for card, words in cards:
        if words and words[0] in NOT_COUNTED:
            yield f"{card.at}: elements of /{'/'.join(words)} are not followed"
    yield from (f"{block.source.name}: {told}" for block, told in cuts(run.deck) if holds_mesh(block))
    for unread in run.deck.unread:
        yield f"{unread.name.at}: {unread.name.text} was not read: {unread.reason}"
    if starter.moved:
        yield "ids of a //SUBMODEL may be moved, which is not followed"
    unknown = sorted({int(part) for one in elements for part in np.unique(one.part)} - starter.parts.keys())
    if unknown:
        yield f"elements of {name_units(unknown)}, which no /PART of the deck defines"
    if lost:
        yield f"{lost} nodes of elements are not in any /NODE of the deck"


def _parts(
    starter: Starter, cards: Sequence[tuple[Card, tuple[str, ...]]], elements: Sequence[Elements], rigid: set[int]
) -> Mapping[int, PartData]:
    materials = dict(_materials(cards))
    properties = dict(_properties(cards))
    kinds: dict[int, set[str]] = {}
    for one in elements:
        for part in np.unique(one.part).tolist():
            kinds.setdefault(part, set()).add(one.kind)
    unturned = starter.unturned
    found: dict[int, PartData] = {}
    for card, words in cards:
        rows = [row for row in card.rows if not row.blank] if words[:1] == ("PART",) else []
        if len(rows) < 2:
            continue
        part, prop, material = whole(words[1]), card.integer(rows[1], 0).value, card.integer(rows[1], 1).value
        section = _section(properties.get(prop), kinds.get(part, set()), turns=part not in unturned)
        found[part] = PartData(
            part, rows[0].text.strip(), _material(materials.get(material), properties.get(prop), part in rigid), section
        )
    return found


def _material(found: Material | None, prop: _Property | None, rigid: bool) -> Material | None:
    """Material of a part: a spring has its stiffness in its property, and a rigid body takes whole parts."""
    if prop and prop.type in _OF_SPRINGS:
        return Material(f"PROP/{prop.type}", "spring")
    if found and rigid:
        return Material(found.name, "rigid", found.density, found.modulus, found.poisson)
    return found


def _always_rigid(windows: Sequence[Window]) -> set[int]:
    """Parts in a rigid body that is on from the start to the end; none where no engine file tells."""
    return {one.unit.id for one in windows if not one.unit.is_body and one.tr == 0 and one.td is None}


def _materials(cards: Sequence[tuple[Card, tuple[str, ...]]]) -> Iterator[tuple[int, Material]]:
    for card, words in cards:
        if words[:1] != ("MAT",) or len(words) < 3:
            continue
        rows = [row for row in card.rows if not row.blank]
        law = words[1]
        density = _positive(rows[1].text[:_REAL]) if len(rows) > 1 else None
        known = law in _ELASTIC and len(rows) > 2
        modulus, poisson = (_positive(rows[2].text[at : at + _REAL]) if known else None for at in (0, _REAL))
        kind = "void" if law in _VOID else "airbag" if law in _AIRBAG else "deformable"
        yield whole(words[2]), Material(f"MAT/{law}", kind, density, modulus, poisson)


def _properties(cards: Sequence[tuple[Card, tuple[str, ...]]]) -> Iterator[tuple[int, _Property]]:
    defaults = {words[0]: _flags(card, 0) for card, words in cards if words[:1] in (("DEF_SHELL",), ("DEF_SOLID",))}
    shell, _, triangle = (defaults.get("DEF_SHELL") or [0, 0, 0])[:3]
    solid = (defaults.get("DEF_SOLID") or [0])[0]
    for card, words in cards:
        if words[:1] != ("PROP",) or len(words) < 3:
            continue
        flags, rows = _flags(card, 1), [row.text for row in card.rows if not row.blank]
        found = _Property(words[1])
        if words[1] in _SHELLS:
            found = _Property(
                words[1], flags[0] or shell or _DEFAULT_SHELL, flags[2] or triangle or _DEFAULT_TRIANGLE,
                section=_of_plain_shells(rows) if words[1] in _PLAIN_SHELLS else Section(),
            )  # fmt: skip
        elif words[1] in _SOLIDS:
            found = _Property(words[1], solid=flags[0] or solid or _DEFAULT_SOLID)
        elif words[1] in _BEAMS:
            found = _Property(words[1], section=Section(area=_at(rows, 3, 0)))
        elif words[1] in _TRUSSES:
            found = _Property(words[1], section=Section(area=_at(rows, 1, 0)))
        elif words[1] in _SPRING:
            damped = len(rows) > 2 and _positive(rows[2][_REAL : 2 * _REAL]) is not None
            found = _Property(words[1], section=Section(damped=damped, mass=_at(rows, 1, 0)))
        yield whole(words[2]), found


def _section(prop: _Property | None, kinds: set[str], *, turns: bool) -> Section:
    if prop is None:
        return Section(turns=turns)
    found: dict[str, Formulation] = {}
    for kind in sorted(kinds):
        flags = (prop.shell, prop.triangle, prop.solid)
        needed = {"shell": flags[0], "triangle": flags[1]}.get(kind, 1)
        one = formulations.radioss(kind, *flags) if needed else None
        if one:
            found[kind] = one
    own = prop.section
    return Section(found, own.thickness, own.area, own.damped, own.mass, turns, own.layers)


def _of_plain_shells(rows: Sequence[str]) -> Section:
    """Thickness and integration points through it; 0 points stand for global integration, which is one."""
    layers = _whole_number(rows[3][:_WIDTH]) if len(rows) > 3 else None
    return Section(thickness=_at(rows, 3, 20), layers=None if layers is None else max(layers, 1))


def _flags(card: Card, row: int) -> list[int]:
    """Eight integers of a line of 10 columns each; 0 for what is none."""
    rows = [one for one in card.rows if not one.blank]
    return [card.integer(rows[row], at).value if row < len(rows) else 0 for at in range(8)]


def _at(rows: Sequence[str], row: int, start: int) -> float | None:
    return _positive(rows[row][start : start + _REAL]) if row < len(rows) else None


def _whole_number(text: str) -> int:
    """Read an id, 0 for what is none: a title, names of variables."""
    return int(text) if text.strip().isdecimal() else 0


def _positive(text: str) -> float | None:
    """Read a number above 0, or None."""
    try:
        value = float(number(text))
    except ExpressionError:
        return None
    return value if value > 0 else None
