"""Read the parts and elements of an LS-DYNA deck.

The columns come from the vendor's keyword data as published in its Python library.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from d2rpick.deck import formulations, ls_dyna_loads
from d2rpick.deck.card import LONG
from d2rpick.deck.ls_dyna_columns import (
    MATERIAL,
    make_element_line,
    make_node_line,
    make_watched_line,
)
from d2rpick.deck.ls_dyna_parts import (
    OPTIONS_WITHOUT_IDS,
    DeckParts,
    SectionCard,
    name_material,
    read_parts,
    read_sections,
)
from d2rpick.deck.mesh import Mesh, read_lines
from d2rpick.deck.model import (
    Formulation,
    Inventory,
    Material,
    PartData,
    Section,
    place_nodes,
)
from d2rpick.deck.reader import Deck, find_cuts, has_mesh
from d2rpick.deck.unswitchable import find_unswitchable_in_ls_dyna

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator, Mapping, Sequence

    from d2rpick.deck.card import Card
    from d2rpick.deck.mesh import Integers, Layout, Lines, Reals

# Options of element keywords that d2rpick can read.
_OPTIONS: Final = OPTIONS_WITHOUT_IDS | {
    *("SCALR", "DOF", "PID", "WARPAGE", "ELBOW", "ID", "TITLE"),
    *("SHL4", "TO", "SHL8", "TET4TOTET10"),
    *("H8TOH20", "H8TOH27", "H8TOH64", "H20", "H27", "H64", "P21", "P40", "T15", "T20"),
}
# Keywords that define no elements and change neither the mass nor the cost of a part.
_NO_ELEMENTS: Final = {"MASS", "INERTIA", "BLANKING", "LANCING", "TRIM", "PLOTEL"}
_TEN: Final = 10  # Number of nodes on the second line of a solid element.
_SPRING: Final = re.compile(r"MAT_(SPRING|DAMPER|S\d\d)(_|\Z)")
_DAMPERS: Final = (
    "MAT_DAMPER",
    "MAT_S02",
    "MAT_S05",
    "MAT_SPRING_GENERAL_NONLINEAR",
    "MAT_SPRING_MAXWELL",
)
_AIRBAG: Final = ("MAT_FABRIC", "MAT_034")
_VOID: Final = ("MAT_NULL", "MAT_009")
# Material keywords, by name and by number, whose lines begin with density, Young's modulus and Poisson's ratio.
_ELASTIC: Final = {
    *(
        "ELASTIC",
        "001",
        "1",
        "PLASTIC_KINEMATIC",
        "003",
        "3",
        "RIGID",
        "020",
        "20",
        "PIECEWISE_LINEAR_PLASTICITY",
    ),
    *(
        "024",
        "24",
        "POWER_LAW_PLASTICITY",
        "018",
        "18",
        "STRAIN_RATE_DEPENDENT_PLASTICITY",
        "019",
        "19",
    ),
    *(
        "SIMPLIFIED_JOHNSON_COOK",
        "098",
        "98",
        "PLASTICITY_WITH_DAMAGE",
        "081",
        "81",
        "SPOTWELD",
        "100",
    ),
    *(
        "MODIFIED_PIECEWISE_LINEAR_PLASTICITY",
        "123",
        "LAMINATED_GLASS",
        "032",
        "32",
        "CRUSHABLE_FOAM",
        "063",
        "63",
    ),
    *(
        "RESULTANT_PLASTICITY",
        "028",
        "28",
        "3-PARAMETER_BARLAT",
        "036",
        "36",
        "FABRIC",
        "034",
        "34",
    ),
    *(
        "TRANSVERSELY_ANISOTROPIC_ELASTIC_PLASTIC",
        "037",
        "37",
        "RATE_SENSITIVE_POWERLAW_PLASTICITY",
        "064",
        "64",
    ),
}


class _LsDynaElementKind(NamedTuple):
    """A kind of element: its name, and the smallest and largest number of nodes per element."""

    name: str
    most: int
    fewest: int


_KINDS: Final = {
    "SHELL": _LsDynaElementKind("shell", 8, 3),
    "SOLID": _LsDynaElementKind("solid", 8, 4),
    "TSHELL": _LsDynaElementKind("thick shell", 8, 6),
    "BEAM": _LsDynaElementKind("beam", 2, 2),
    "DISCRETE": _LsDynaElementKind("spring", 2, 2),
    "SEATBELT": _LsDynaElementKind("seatbelt", 2, 2),
    "SPH": _LsDynaElementKind("particle", 0, 0),
}


def read_ls_dyna_inventory(deck: Deck) -> Inventory:
    """Return the parts and elements of a deck."""
    parts = read_parts(deck)
    cards = list(_find_element_cards(deck))
    ids, coordinates, codes = _read_nodes(deck)
    mesh = Mesh.of(
        [
            block
            for card in cards
            if _is_readable(card)
            for block in _read_elements(card)
        ],
        ids,
        coordinates,
    )
    notes = (
        *_list_notes(deck, cards),
        *mesh.doubts(parts.material_by_part.keys(), "*"),
    )
    joints = ls_dyna_loads.read_joints(deck)
    local_nodes = _read_watched_nodes(deck, local=True)
    watched_nodes = np.union1d(_read_watched_nodes(deck, local=False), local_nodes)
    watched = mesh.table.known(watched_nodes)
    return Inventory(
        "ls-dyna",
        _build_parts(deck, parts, mesh),
        mesh.elements,
        mesh.coordinates,
        (*notes, *_note_switching_cards(deck)),
        parts.all_known and not notes,
        joints=place_nodes(joints.found, mesh.table),
        ties=joints.unknown,
        watched=watched,
        watched_ids=mesh.table.ids[watched],
        local_ids=frozenset(local_nodes.tolist()),
        moved=_has_moved_nodes(deck),
        files=tuple(deck.sources),
        boundary=ls_dyna_loads.read_ls_dyna_boundary(
            deck, parts, (ids, coordinates, codes)
        ).placed(mesh.table),
    )


def _note_switching_cards(deck: Deck) -> Iterator[str]:
    """Yield a note on the first card by which the deck already switches parts."""
    for card in deck.named("DEFORMABLE_TO_RIGID")[:1]:
        yield (
            f"{card.at}: the deck already switches parts with *{card.name}; remove its switching cards before you add "
            "others"
        )


def find_shared_nodes(
    cards: Sequence[Card], bodies: Mapping[int, int]
) -> dict[tuple[int, int], int]:
    """Find a shared node for each pair of parts that share nodes but belong to different bodies.

    Parameters
    ----------
    cards : sequence of Card
        The *ELEMENT cards that are read.
    bodies : mapping
        Body of every part that is examined; parts of the same body may share nodes.

    Returns
    -------
    dict
        The first node found for each pair of parts (lower id first).
    """
    owner: dict[int, int] = {}
    shared: dict[tuple[int, int], int] = {}
    for part, node in _list_nodes(cards, bodies):
        first_part = owner.setdefault(node, part)
        if first_part != part and bodies[first_part] != bodies[part]:
            shared.setdefault((min(part, first_part), max(part, first_part)), node)
    return shared


def find_first_parts(cards: Sequence[Card], parts: Collection[int]) -> dict[int, int]:
    """Return the first of ``parts`` to which each node belongs, by node id."""
    part_by_node: dict[int, int] = {}
    for part, node in _list_nodes(cards, parts):
        part_by_node.setdefault(node, part)
    return part_by_node


def find_parts_of_nodes(
    cards: Sequence[Card], nodes: Collection[int]
) -> dict[int, set[int]]:
    """Return the parts whose elements contain each of the given nodes, by node id."""
    parts_by_node: dict[int, set[int]] = {}
    wanted = {*nodes}
    for card in cards:
        for _, owners, members in _read_elements(card, _TEN):
            rows = np.isin(members, [*wanted]).any(axis=1)
            for part, element_nodes in zip(
                owners[rows].tolist(), members[rows].tolist(), strict=True
            ):
                for node in wanted.intersection(element_nodes):
                    parts_by_node.setdefault(node, set()).add(part)
    return parts_by_node


def _list_nodes(
    cards: Sequence[Card], parts: Collection[int]
) -> Iterator[tuple[int, int]]:
    """Yield the part id and node id of each element node of the given parts, in deck order."""
    for card in cards:
        for _, owners, nodes in _read_elements(card, _TEN):
            rows = np.isin(owners, [*parts])
            for part, element_nodes in zip(
                owners[rows].tolist(), nodes[rows].tolist(), strict=True
            ):
                yield from (
                    (part, node) for node in {node for node in element_nodes if node}
                )


def _read_watched_nodes(deck: Deck, *, local: bool) -> Integers:
    """Return the node ids on a *DATABASE_HISTORY_NODE card: eight per line, or one per line if it has a title.

    If ``local`` is True, only nodes whose motion is written in a local coordinate system are returned, otherwise only
    the others.
    """
    ids = [np.empty(0, np.int64)]
    for card in deck.named("DATABASE_HISTORY_NODE"):
        options = card.name.removeprefix("DATABASE_HISTORY_NODE").split("_")[1:]
        if set(options) <= {"ID", "LOCAL"} and ("LOCAL" in options) is local:
            line = make_watched_line(card.width, 1 if options else 8)
            node_ids = [
                lines.integers(line.layout).ravel()
                for lines in read_lines(card)
                if len(lines)
            ]
            ids += [numbers[numbers > 0] + card.transform.node for numbers in node_ids]
    return np.unique(np.concatenate(ids))


def _has_moved_nodes(deck: Deck) -> bool:
    """Return True if the deck moves nodes away from their original coordinates."""
    moving = (*deck.named("NODE_TRANSFORM"), *deck.named("PART_MOVE"))
    return bool(moving) or any(card.transform.moved for card in deck.named("NODE"))


def _list_notes(deck: Deck, cards: Sequence[Card]) -> Iterator[str]:
    """Yield notes on elements that may be missing from the inventory."""
    yield from (
        f"{card.at}: elements of *{card.name} are not read"
        for card in cards
        if not _is_readable(card)
    )
    yield from (
        f"{include.name.at}: {include.name.text} was not read: {include.reason}; add the file, or correct its name"
        for include in deck.unread
    )
    for block in deck.encrypted:
        yield f"{block.source.name}:{block.line}: elements in an encrypted block are not read"
    yield from (
        f"{block.source.name}: {sign}"
        for block, sign in find_cuts(deck)
        if has_mesh(block)
    )


def _find_element_cards(deck: Deck) -> Iterator[Card]:
    """Yield the cards that define elements."""
    for card in deck.cards:
        kind = card.name.split("_")[1:2]
        # Seat-belt keywords for slip rings, retractors, sensors and the like define no elements.
        fitting = card.name.startswith("ELEMENT_SEATBELT_")
        if (
            card.name.startswith("ELEMENT_")
            and kind
            and kind[0] not in _NO_ELEMENTS
            and not fitting
        ):
            yield card


def _is_readable(card: Card) -> bool:
    """Return True if d2rpick can read the elements of a card."""
    _, kind, *options = card.name.split("_")
    return kind in _KINDS and set(options) <= _OPTIONS


def _get_id_width(card: Card) -> int:
    """Return the width of an id column [characters]."""
    words = card.block.head.split()
    if card.width == LONG:
        return LONG
    has_percent_suffix = "%" in words[0] or words[1:2] == ["%"]
    return 10 if has_percent_suffix else 8


def _read_elements(
    card: Card, node_count: int | None = None
) -> Iterator[tuple[str, Integers, Integers]]:
    """Yield the kind, part ids and node ids of a card's elements block by block, with the id offsets of the include.

    ``node_count`` is the number of nodes of each element; the default is the number of nodes that define its size.
    """
    kind = _KINDS[card.name.split("_")[1]]
    width = _get_id_width(card)
    waiting_line: Integers | None = None
    for lines in read_lines(card):
        if not len(lines):
            continue
        if kind.name == "particle":
            ids = lines.integers(make_element_line(width, 0).layout)
            rows = ids[(ids > 0).all(axis=1)]
            yield (
                kind.name,
                rows[:, 1] + card.transform.part,
                rows[:, :1] + card.transform.node,
            )
            continue
        most_nodes = _TEN if kind.name == "solid" else kind.most
        values = lines.integers(make_element_line(width, most_nodes).layout)
        if kind.name == "solid":
            values, waiting_line = _join_lines(
                values
                if waiting_line is None
                else np.concatenate([waiting_line, values])
            )
        # A row with an element id, a part id and enough nodes is an element; any other row belongs to an option.
        mesh = values[(values[:, : 2 + kind.fewest] > 0).all(axis=1)]
        nodes = np.maximum(mesh[:, 2 : 2 + (node_count or kind.most)], 0)
        yield (
            kind.name,
            mesh[:, 1] + card.transform.part,
            np.where(nodes > 0, nodes + card.transform.node, 0),
        )


def _join_lines(values: Integers) -> tuple[Integers, Integers | None]:
    """Join each line with element and part ids to the line of node ids below it.

    A last line whose nodes are missing is returned, too.
    """
    heads = (values[:, :2] > 0).all(axis=1) & (values[:, 2:] == 0).all(axis=1)
    if not heads.any():
        return values, None
    waiting = values[-1:] if heads[-1] else None
    heads[-1] = False
    at = np.flatnonzero(heads)
    joined = values[at]
    joined[:, 2:] = values[at + 1, :_TEN]
    return joined, waiting


def _read_nodes(deck: Deck) -> tuple[Integers, Reals, Integers]:
    """Return ids (n,) and coordinates (n, 3) of all nodes, and the codes of their fixed translations (n,)."""
    ids = [np.empty(0, np.int64)]
    coordinates = [np.empty((0, 3))]
    codes = [np.empty(0, np.int64)]
    for card in deck.named("NODE"):
        if card.name != "NODE":
            continue
        width = _get_id_width(card)
        fields = make_node_line(width, LONG if card.width == LONG else 16).layout
        for lines in read_lines(card):
            if len(lines):
                numbers = lines.integers(fields[:1])[:, 0]
                has_id = numbers > 0
                ids.append(numbers[has_id] + card.transform.node)
                line_coordinates = lines.reals(fields, slice(1, 4))[has_id]
                coordinates.append(
                    np.full_like(line_coordinates, np.nan)
                    if card.transform.scaled
                    else line_coordinates
                )
                codes.append(_read_codes(lines, fields)[has_id])
    return np.concatenate(ids), np.concatenate(coordinates), np.concatenate(codes)


def _read_codes(lines: Lines, fields: Layout) -> Integers:
    """Return the last field of each line as integers. Most of these fields are 0 and need not be parsed."""
    start, width = fields[-1]
    if (
        lines.in_columns
        and not (lines.cells[:, start : start + width] > ord("0")).any()
    ):
        return np.zeros(len(lines), np.int64)
    return lines.integers(fields)[:, -1]


def _build_parts(deck: Deck, parts: DeckParts, mesh: Mesh) -> dict[int, PartData]:
    """Return the data of all parts, keyed by part id."""
    kinds = mesh.kinds
    sections = read_sections(deck)
    materials = dict(_read_materials(deck, parts))
    unswitchable = find_unswitchable_in_ls_dyna(deck, parts)
    part_data: dict[int, PartData] = {}
    for part, name in parts.material_by_part.items():
        material = materials.get(name)
        section = _build_section(
            sections.get(parts.sections.get(part, 0)), kinds.get(part, set()), material
        )
        reason = unswitchable[part].reason if part in unswitchable else ""
        part_data[part] = PartData(
            part, parts.titles.get(part, ""), material, section, reason
        )
    return part_data


def _build_section(
    card: SectionCard | None, kinds: set[str], material: Material | None
) -> Section:
    """Return the section of a part with the formulations of its elements."""
    formulations_by_kind: dict[str, Formulation] = {}
    for kind in sorted(kinds):
        formulation = formulations.find_ls_dyna_formulation(
            kind, card.elform if card else 0
        )
        if formulation and (card or kind == "spring"):
            formulations_by_kind[kind] = formulation
    if material is None or material.kind != "spring":
        damped = None
    else:
        damped = material.name.startswith(_DAMPERS)
    if card is None:
        return Section(formulations_by_kind, damped=damped)
    area = card.first if card.kind == "BEAM" and card.elform in (2, 3, 12) else None
    thickness = card.first if card.kind == "SHELL" else None
    return Section(
        formulations_by_kind,
        thickness,
        area,
        damped,
        None,
        not card.unturned,
        card.layers,
    )


def _read_materials(deck: Deck, parts: DeckParts) -> Iterator[tuple[str, Material]]:
    """Yield the id and the material of each *MAT card."""
    for card in deck.named("MAT"):
        if not card.data or card.name.startswith("MAT_ADD"):
            continue
        row = card.data[0]
        number = name_material(card, row, MATERIAL["MID"])
        name = card.name.removesuffix("_TITLE")
        is_elastic = name.removeprefix("MAT_") in _ELASTIC
        density, modulus, poisson = (
            card.positive(row, MATERIAL[name_]) if is_elastic else None
            for name_ in ("RO", "E", "PR")
        )
        yield (
            number,
            Material(
                name, _classify_material(name, number, parts), density, modulus, poisson
            ),
        )


def _classify_material(name: str, number: str, parts: DeckParts) -> str:
    """Return the kind of a material: rigid, spring, airbag, void or deformable."""
    if number in parts.rigid_materials:
        return "rigid"
    if _SPRING.match(name):
        return "spring"
    if name.startswith(_AIRBAG):
        return "airbag"
    return "void" if name.startswith(_VOID) else "deformable"
