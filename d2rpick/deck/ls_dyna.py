"""Parts and elements of an LS-DYNA deck.

Columns: the vendor's keyword data as published in its Python library.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from d2rpick.deck import formulations, ls_dyna_loads
from d2rpick.deck.card import LONG
from d2rpick.deck.columns import layout, lines_of, placed, places_of
from d2rpick.deck.model import Elements, Inventory, Material, PartData, Section, placed_joints
from d2rpick.deck.parts import read_parts
from d2rpick.deck.pieces import placed_boundary
from d2rpick.deck.reader import cuts, holds_mesh
from d2rpick.deck.sections import NOT_TURNED
from d2rpick.errors import name_units

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from d2rpick.deck.card import Card, Row
    from d2rpick.deck.columns import Integers, Layout, Lines, Reals
    from d2rpick.deck.model import Formulation
    from d2rpick.deck.parts import Parts
    from d2rpick.deck.reader import Deck


class _Kind(NamedTuple):
    """Kind of elements: what to call it, nodes in its line at most, and nodes that each element has at least."""

    name: str
    most: int
    fewest: int


_KINDS: Final = {
    "SHELL": _Kind("shell", 8, 3),
    "SOLID": _Kind("solid", 8, 4),
    "TSHELL": _Kind("thick shell", 8, 6),
    "BEAM": _Kind("beam", 2, 2),
    "DISCRETE": _Kind("spring", 2, 2),
    "SEATBELT": _Kind("seatbelt", 2, 2),
    "SPH": _Kind("particle", 0, 0),
}
# Options whose lines hold reals or words, or ids in other columns than those of an element and its part.
_OPTIONS: Final = {
    *("THICKNESS", "BETA", "MCID", "OFFSET", "ORTHO", "ORIENTATION", "COMPOSITE", "LONG", "SCALAR", "SCALR"),
    *("SECTION", "ELFORM", "DOF", "PID", "WARPAGE", "ELBOW", "ID", "TITLE", "SHL4", "TO", "SHL8", "TET4TOTET10"),
    *("H8TOH20", "H8TOH27", "H8TOH64", "H20", "H27", "H64", "P21", "P40", "T15", "T20"),
}
_NO_ELEMENTS: Final = {
    "MASS",
    "INERTIA",
    "BLANKING",
    "LANCING",
    "TRIM",
    "PLOTEL",
}  # they make no part heavier or dearer
_TEN: Final = 10  # nodes in the second line of a solid
_SPRING: Final = re.compile(r"MAT_(SPRING|DAMPER|S\d\d)(_|\Z)")
_DAMPERS: Final = ("MAT_DAMPER", "MAT_S02", "MAT_S05", "MAT_SPRING_GENERAL_NONLINEAR", "MAT_SPRING_MAXWELL")
_AIRBAG: Final = ("MAT_FABRIC", "MAT_034")
_VOID: Final = ("MAT_NULL", "MAT_009")
# Materials that begin with density, Young's modulus and Poisson's ratio, by name and number.
_ELASTIC: Final = {
    *("ELASTIC", "001", "1", "PLASTIC_KINEMATIC", "003", "3", "RIGID", "020", "20", "PIECEWISE_LINEAR_PLASTICITY"),
    *("024", "24", "POWER_LAW_PLASTICITY", "018", "18", "STRAIN_RATE_DEPENDENT_PLASTICITY", "019", "19"),
    *("SIMPLIFIED_JOHNSON_COOK", "098", "98", "PLASTICITY_WITH_DAMAGE", "081", "81", "SPOTWELD", "100"),
    *("MODIFIED_PIECEWISE_LINEAR_PLASTICITY", "123", "LAMINATED_GLASS", "032", "32", "CRUSHABLE_FOAM", "063", "63"),
    *("RESULTANT_PLASTICITY", "028", "28", "3-PARAMETER_BARLAT", "036", "36", "FABRIC", "034", "34"),
    *("TRANSVERSELY_ANISOTROPIC_ELASTIC_PLASTIC", "037", "37", "RATE_SENSITIVE_POWERLAW_PLASTICITY", "064", "64"),
}


def read(deck: Deck) -> Inventory:
    """Collect the parts and elements of a deck that was read."""
    parts = read_parts(deck)
    cards = list(_element_cards(deck))
    raw = [one for card in cards if _followed(card) for one in _elements(card)]
    ids, coordinates, codes = _nodes(deck)
    kinds = sorted({kind for kind, _, _ in raw})
    table, places = placed(ids, [_joined([n for name, _, n in raw if name == kind]) for kind in kinds])
    elements = tuple(
        Elements(kind, np.concatenate([part for name, part, _ in raw if name == kind]), nodes)
        for kind, nodes in zip(kinds, places, strict=True)
    )
    beyond = np.full((table.size - ids.size, 3), np.nan)
    notes = tuple(_notes(deck, cards, elements, parts, lost=len(beyond)))
    held = ls_dyna_loads.joints_of(deck)
    boundary = ls_dyna_loads.read(deck, parts, (ids, coordinates, codes))
    return Inventory(
        "ls-dyna", _parts(deck, parts, elements), elements, np.concatenate([coordinates, beyond]), notes,
        parts.all_known and not notes, joints=placed_joints(held.found, table), ties=held.unknown,
        watched=places_of(_watched(deck), table), moved=_moves_nodes(deck), files=tuple(deck.sources),
        boundary=placed_boundary(boundary, table),
    )  # fmt: skip


def _watched(deck: Deck) -> Integers:
    """Ids of the nodes of *DATABASE_HISTORY_NODE, eight in a line or, with a title each, one."""
    ids = [np.empty(0, np.int64)]
    for card in deck.named("DATABASE_HISTORY_NODE"):
        options = card.name.removeprefix("DATABASE_HISTORY_NODE").split("_")[1:]
        if set(options) <= {"ID", "LOCAL"}:
            fields: Layout = layout(*[20 if card.width == LONG else 10] * (1 if options else 8))
            found = [lines.integers(fields).ravel() for lines in lines_of(card) if len(lines)]
            ids += [one[one > 0] + card.transform.node for one in found]
    return np.unique(np.concatenate(ids))


def _moves_nodes(deck: Deck) -> bool:
    """Whether the deck moves nodes away from their coordinates."""
    moving = (*deck.named("NODE_TRANSFORM"), *deck.named("PART_MOVE"))
    return bool(moving) or any(card.transform.moved for card in deck.named("NODE"))


def _notes(deck: Deck, cards: Sequence[Card], elements: Sequence[Elements], parts: Parts, lost: int) -> Iterator[str]:
    """Say what may be missing."""
    for card in cards:
        if not _followed(card):
            yield f"{card.at}: elements of *{card.name} are not followed"
    for unread in deck.unread:
        yield f"{unread.name.at}: {unread.name.text} was not read: {unread.reason}"
    for block in deck.encrypted:
        yield f"{block.source.name}:{block.line}: elements may hide in an encrypted block"
    yield from (f"{block.source.name}: {told}" for block, told in cuts(deck) if holds_mesh(block))
    unknown = sorted({int(part) for one in elements for part in np.unique(one.part)} - parts.materials.keys())
    if unknown:
        yield f"elements of {name_units(unknown)}, which no *PART of the deck defines"
    if lost:
        yield f"{lost} nodes of elements are not in any *NODE of the deck"


def _element_cards(deck: Deck) -> Iterator[Card]:
    for card in deck.cards:
        kind = card.name.split("_")[1:2]
        fitting = card.name.startswith("ELEMENT_SEATBELT_")  # slip ring, retractor, sensor, ...
        if card.name.startswith("ELEMENT_") and kind and kind[0] not in _NO_ELEMENTS and not fitting:
            yield card


def _followed(card: Card) -> bool:
    _, kind, *options = card.name.split("_")
    return kind in _KINDS and set(options) <= _OPTIONS


def _width(card: Card) -> int:
    """Columns of an id."""
    return LONG if card.width == LONG else 10 if "%" in card.block.head.split(maxsplit=1)[0] or _percent(card) else 8


def _percent(card: Card) -> bool:
    return card.block.head.split()[1:2] == ["%"]


def _elements(card: Card) -> Iterator[tuple[str, Integers, Integers]]:
    """Kind, parts and node ids of the elements of a card, piece by piece; ids with their offsets."""
    kind = _KINDS[card.name.split("_")[1]]
    width = _width(card)
    left: Integers | None = None
    for lines in lines_of(card):
        if not len(lines):
            continue
        if kind.name == "particle":
            ids, mesh = lines.integers(layout(width, width)), None
            rows = ids[(ids > 0).all(axis=1)]
            yield kind.name, rows[:, 1] + card.transform.part, rows[:, :1] + card.transform.node
            continue
        values = lines.integers(layout(*[width] * (2 + (_TEN if kind.name == "solid" else kind.most))))
        if kind.name == "solid":
            values, left = _of_two_lines(values if left is None else np.concatenate([left, values]))
        mesh = values[_real_elements(values, kind)]
        nodes = np.maximum(mesh[:, 2 : 2 + kind.most], 0)
        yield kind.name, mesh[:, 1] + card.transform.part, np.where(nodes > 0, nodes + card.transform.node, 0)


def _real_elements(values: Integers, kind: _Kind) -> Integers:
    """Rows that name an element, its part and enough nodes: not those of further options."""
    good = (values[:, :2] > 0).all(axis=1) & (values[:, 2 : 2 + kind.fewest] > 0).all(axis=1)
    return np.flatnonzero(good)


def _of_two_lines(values: Integers) -> tuple[Integers, Integers | None]:
    """Join lines of an element and its part with the first of its nodes below; give back one that waits for them."""
    heads = (values[:, :2] > 0).all(axis=1) & (values[:, 2:] == 0).all(axis=1)
    if not heads.any():
        return values, None
    waiting = values[-1:] if heads[-1] else None
    heads[-1] = False
    at = np.flatnonzero(heads)
    joined = values[at]
    joined[:, 2:] = values[at + 1, :_TEN]
    return joined, waiting


def _joined(blocks: Sequence[Integers]) -> Integers:
    return np.concatenate(blocks)


def _nodes(deck: Deck) -> tuple[Integers, Reals, Integers]:
    """Ids and coordinates of all nodes, and the codes of their translations that are fixed."""
    ids, places, codes = [np.empty(0, np.int64)], [np.empty((0, 3))], [np.empty(0, np.int64)]
    for card in deck.named("NODE"):
        if card.name != "NODE":
            continue
        width = _width(card)
        fields: Layout = layout(width, *[LONG if card.width == LONG else 16] * 3)
        for lines in lines_of(card):
            if len(lines):
                numbers = lines.integers(fields[:1])[:, 0]
                good = numbers > 0
                ids.append(numbers[good] + card.transform.node)
                places.append(_moved(lines, fields, card)[good])
                codes.append(_codes(lines, [*fields, (sum(fields[-1]), width)])[good])
    return np.concatenate(ids), np.concatenate(places), np.concatenate(codes)


def _codes(lines: Lines, fields: Layout) -> Integers:
    """Last of some fields, 0 in most meshes."""
    start, width = fields[-1]
    if lines.in_columns and not (lines.cells[:, start : start + width] > ord("0")).any():
        return np.zeros(len(lines), np.int64)
    return lines.integers(fields)[:, -1]


def _moved(lines: Lines, fields: Layout, card: Card) -> Reals:
    """Coordinates; unknown in an include whose lengths are scaled."""
    found = lines.reals(fields, slice(1, 4))
    return np.full_like(found, np.nan) if card.transform.scaled else found


def _parts(deck: Deck, parts: Parts, elements: Sequence[Elements]) -> dict[int, PartData]:
    kinds: dict[int, set[str]] = {}
    for one in elements:
        for part in np.unique(one.part).tolist():
            kinds.setdefault(part, set()).add(one.kind)
    sections, materials = dict(_sections(deck)), dict(_materials(deck, parts))
    return {
        part: PartData(
            part,
            parts.titles.get(part, ""),
            materials.get(name),
            _section(sections.get(parts.sections.get(part, 0)), kinds.get(part, set()), materials.get(name)),
        )
        for part, name in parts.materials.items()
    }


class _Raw(NamedTuple):
    """A *SECTION as written: its kind, ELFORM, the first number of its second line, points through the thickness."""

    kind: str
    elform: int
    first: float | None
    layers: int | None


def _sections(deck: Deck) -> Iterator[tuple[int, _Raw]]:
    for card in deck.named("SECTION"):
        _, kind, *options = card.name.split("_")
        rows = [row for row in card.rows if not row.blank]
        per_section = {"SOLID": 1, "DISCRETE": 2, "SHELL": 2, "BEAM": 2, "TSHELL": 2}.get(kind)
        titled = "TITLE" in options
        if per_section is None or set(options) - {"TITLE"}:
            rows = rows[int(titled) :][:2]
            per_section, titled = 2, False
        step = per_section + titled
        for at in range(titled, len(rows), step):
            number, elform = card.integer(rows[at], 0), card.integer(rows[at], 1, 1 if kind == "SOLID" else 2)
            if not number.problem:
                second = rows[at + 1] if per_section > 1 and at + 1 < len(rows) else None
                layers = card.integer(rows[at], 3, 2) if kind == "SHELL" else None
                through = (layers.value or 2) if layers and not layers.problem else None
                raw = _Raw(kind, 0 if elform.problem else elform.value, _number(card, second, 0), through)
                yield number.value + card.transform.rest, raw


def _section(raw: _Raw | None, kinds: set[str], material: Material | None) -> Section:
    found: dict[str, Formulation] = {}
    for kind in sorted(kinds):
        one = formulations.ls_dyna(kind, raw.elform if raw else 0)
        if one and (raw or kind == "spring"):
            found[kind] = one
    damped = None if material is None or material.kind != "spring" else material.name.startswith(_DAMPERS)
    if raw is None:
        return Section(found, damped=damped)
    area = raw.first if raw.kind == "BEAM" and raw.elform in (2, 3, 12) else None
    turns = not (raw.kind == "SOLID" and raw.elform in NOT_TURNED)
    return Section(found, raw.first if raw.kind == "SHELL" else None, area, damped, None, turns, raw.layers)


def _materials(deck: Deck, parts: Parts) -> Iterator[tuple[str, Material]]:
    for card in deck.named("MAT"):
        rows = [row for row in (card.rows[1:] if card.name.endswith("_TITLE") else card.rows) if not row.blank]
        if not rows or card.name.startswith("MAT_ADD"):
            continue
        value = card.integer(rows[0], 0)
        number = value.field.text.upper() if value.problem else str(value.value + card.transform.material)
        name = card.name.removesuffix("_TITLE")
        short = name.removeprefix("MAT_")
        density, modulus, poisson = (_number(card, rows[0], at) for at in (1, 2, 3))
        known = short in _ELASTIC
        yield number, Material(
            name, _kind(name, number, parts), density if known else None, modulus if known else None,
            poisson if known else None,
        )  # fmt: skip


def _kind(name: str, number: str, parts: Parts) -> str:
    if number in parts.rigid_materials:
        return "rigid"
    if _SPRING.match(name):
        return "spring"
    if name.startswith(_AIRBAG):
        return "airbag"
    return "void" if name.startswith(_VOID) else "deformable"


def _number(card: Card, row: Row | None, position: int) -> float | None:
    """Read a positive number, or None; of an include in other units none is known."""
    if row is None or card.transform.scaled:
        return None
    value = card.real(row, position)
    return None if value.problem or value.value <= 0 else value.value
