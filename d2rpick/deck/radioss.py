"""Parts and elements of a Radioss starter deck.

Columns: Altair's public help for the elements, properties and materials, and the solver's published source.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from d2rpick.deck import formulations, radioss_loads
from d2rpick.deck.expression import ExpressionError, number
from d2rpick.deck.mesh import KINDS, NOT_COUNTED, Mesh, elements_of, nodes_of
from d2rpick.deck.model import Formulation, Inventory, Material, PartData, Section, placed
from d2rpick.deck.radioss_deck import SOLIDS, Starter, below_title, card_of, kept_off, number_of
from d2rpick.deck.radioss_flaws import flaws_of
from d2rpick.deck.radioss_run import Run, find_run_windows, left_rigid
from d2rpick.deck.reader import cuts, holds_mesh

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from d2rpick.deck.card import Card, Row
    from d2rpick.deck.mesh import Integers
    from d2rpick.deck.switching import Window

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
    cards = [card_of(block) for block in starter.blocks]
    ids, coordinates = nodes_of(starter.named("NODE"))
    mesh = Mesh.of([one for card in starter.named(*KINDS) for one in elements_of(card)], ids, coordinates)
    notes = (*_notes(run, cards, starter), *mesh.doubts(starter.parts.keys(), "/"))
    windows = find_run_windows(run).windows.windows if run.legs else ()
    joints = radioss_loads.joints_of(run, starter, cards)
    switched = run.named if run.legs else {body.node.value for body in starter.bodies}  # all without an engine file
    return Inventory(
        "radioss", _parts(starter, cards, mesh, _always_rigid(windows)), mesh.elements, mesh.coordinates, notes,
        not notes, joints=placed(joints.found, mesh.table), switched=placed(joints.switched, mesh.table),
        ties=joints.unknown, watched=mesh.table.known(_watched(cards)),
        moved=any(card.words[0] == "TRANSFORM" for card in cards), files=tuple(run.deck.sources),
        history_groups=frozenset(number_of(card, -1) for card in cards if card.words[0] == "THPART"),
        kept_off=kept_off(run.legs), flaws=flaws_of(run, switched),
        boundary=radioss_loads.read(run, starter, cards).placed(mesh.table), left_rigid=left_rigid(run, windows),
    )  # fmt: skip


def _watched(cards: Sequence[Card]) -> Integers:
    """Ids of the nodes of /TH/NODE, below a line of a title and one of variables."""
    rows = [row for card in cards if card.words[:2] == ("TH", "NODE") for row in below_title(card)]
    ids = (row.text[:_WIDTH].strip() for row in rows)
    return np.unique(np.array([int(one) for one in ids if one.isdecimal() and int(one)], np.int64))


def _notes(run: Run, cards: Sequence[Card], starter: Starter) -> Iterator[str]:
    """Say what may be missing."""
    for card in cards:
        if card.words[0] in NOT_COUNTED:
            yield f"{card.at}: elements of /{card.name} are not followed"
    yield from (f"{block.source.name}: {told}" for block, told in cuts(run.deck) if holds_mesh(block))
    yield from (f"{one.name.at}: {one.name.text} was not read: {one.reason}" for one in run.deck.unread)
    if starter.moved:
        yield "ids of a //SUBMODEL may be moved, which is not followed"


def _parts(starter: Starter, cards: Sequence[Card], mesh: Mesh, rigid: set[int]) -> Mapping[int, PartData]:
    materials, properties = dict(_materials(cards)), dict(_properties(cards))
    kinds, unturned = mesh.kinds, starter.unturned
    found: dict[int, PartData] = {}
    for card in cards:
        rows = below_title(card) if card.words[0] == "PART" else ()
        if rows:
            part, prop, material = number_of(card), *(card.integer(rows[0], at).value for at in (0, 1))
            section = _section(properties.get(prop), kinds.get(part, set()), turns=part not in unturned)
            made_of = _material(materials.get(material), properties.get(prop), part in rigid)
            found[part] = PartData(part, card.rows[0].text.strip(), made_of, section)
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


def _materials(cards: Sequence[Card]) -> Iterator[tuple[int, Material]]:
    for card in cards:
        if card.words[0] != "MAT" or len(card.words) < 3:
            continue
        rows, law = [row.text for row in below_title(card)], card.words[1]
        known = law in _ELASTIC
        modulus, poisson = (_at(rows, 1, at) if known else None for at in (0, _REAL))
        kind = "void" if law in _VOID else "airbag" if law in _AIRBAG else "deformable"
        yield number_of(card, 2), Material(f"MAT/{law}", kind, _at(rows, 0, 0), modulus, poisson)


def _properties(cards: Sequence[Card]) -> Iterator[tuple[int, _Property]]:
    defaults = {
        card.words[0]: _flags(card, card.lines) for card in cards if card.words[0] in ("DEF_SHELL", "DEF_SOLID")
    }
    shell, _, triangle = defaults.get("DEF_SHELL", [0, 0, 0])[:3]
    solid = defaults.get("DEF_SOLID", [0])[0]
    for card in cards:
        if card.words[0] != "PROP" or len(card.words) < 3:
            continue
        below, type_ = below_title(card), card.words[1]
        flags, rows = _flags(card, below), [row.text for row in below]
        found = _Property(type_)
        if type_ in _SHELLS:
            found = _Property(
                type_, flags[0] or shell or _DEFAULT_SHELL, flags[2] or triangle or _DEFAULT_TRIANGLE,
                section=_of_plain_shells(rows) if type_ in _PLAIN_SHELLS else Section(),
            )  # fmt: skip
        elif type_ in SOLIDS:
            found = _Property(type_, solid=flags[0] or solid or _DEFAULT_SOLID)
        elif type_ in _BEAMS:
            found = _Property(type_, section=Section(area=_at(rows, 2, 0)))
        elif type_ in _TRUSSES:
            found = _Property(type_, section=Section(area=_at(rows, 0, 0)))
        elif type_ in _SPRING:
            found = _Property(type_, section=_of_springs(rows))
        yield number_of(card, 2), found


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
    return Section(found, own.thickness, own.area, own.damped, own.mass, turns, own.layers, own.stiffness)


def _of_springs(rows: Sequence[str]) -> Section:
    """Mass and stiffness of a spring, which a function of its length would replace."""
    linear = len(rows) < 3 or not rows[2][:_WIDTH].strip(" 0")
    return Section(
        damped=_at(rows, 1, _REAL) is not None, mass=_at(rows, 0, 0), stiffness=_at(rows, 1, 0) if linear else None
    )


def _of_plain_shells(rows: Sequence[str]) -> Section:
    """Thickness and integration points through it; 0 points stand for global integration, which is one."""
    points = rows[2][:_WIDTH].strip() if len(rows) > 2 else None
    layers = None if points is None else max(int(points) if points.isdecimal() else 0, 1)
    return Section(thickness=_at(rows, 2, 20), layers=layers)


def _flags(card: Card, rows: Sequence[Row]) -> list[int]:
    """Eight integers of the first line, of 10 columns each; 0 for what is none."""
    return [card.integer(rows[0], at).value if rows else 0 for at in range(8)]


def _at(rows: Sequence[str], row: int, start: int) -> float | None:
    """Read a number above 0 in 20 columns, or None."""
    try:
        value = float(number(rows[row][start : start + _REAL])) if row < len(rows) else 0.0
    except ExpressionError:
        return None
    return value if value > 0 else None
