"""Find the requirements of a deck on a card: free ids, constraints on the parts, and the name and end of the run."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final, NamedTuple

from d2rpick.base.errors import DeckError, name_units
from d2rpick.deck.ls_dyna_parts import (
    DELETING_FLAGS,
    Constraint,
    find_element_cards,
    read_constraints,
    read_parts,
)
from d2rpick.deck.radioss_files import find_root, list_run_files
from d2rpick.deck.radioss_run import RadiossRun, is_in_order, read_run
from d2rpick.deck.reader import Deck, read_deck
from d2rpick.deck.switching import read_switching

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator, Sequence

    from d2rpick.deck.ls_dyna_parts import Kind

# First id of new switch sets and part sets, unless the deck already uses it.
_FIRST: Final = 901


class Suiting(NamedTuple):
    """Requirements that a deck places on a card; None and False mean that there is no requirement.

    ``solver`` is the solver of the deck; ``name`` and ``end`` [time] are those of its run. ``swset`` contains free ids
    of switch sets; the ids above them are free for part sets, too. ``delete_nodal_bodies`` and ``delete_node_sets`` are
    True if the deck has such constraints, and only on these parts, so that they have to be deleted while the parts are
    rigid. ``parting`` describes deleted constraints that connect separate rigid bodies, and ``kept_joints`` the joints
    between separate rigid bodies that stay active.
    """

    solver: str
    name: str | None = None
    end: float | None = None
    swset: tuple[int, int] | None = None
    delete_nodal_bodies: bool = False
    delete_node_sets: bool = False
    parting: tuple[str, ...] = ()
    kept_joints: tuple[str, ...] = ()


def find_suiting(
    path: str, parts: Collection[int], bodies: Sequence[Collection[int]] = ()
) -> Suiting:
    """Return what a deck requires of a card that switches the given parts.

    ``bodies`` contains the parts of each rigid body; any other part becomes a body of its own.

    Raises
    ------
    DeckError
        If the deck cannot be read.
    """
    if list_run_files(path):
        run = read_run(path)
        legs = run.legs
        has_end = bool(legs) and is_in_order(legs) and not legs[-1].sensor
        return Suiting(
            "radioss", find_name_of_files(run), legs[-1].stop.value if has_end else None
        )
    deck = read_deck(path)
    suiting = Suiting("ls-dyna", swset=_find_free_ids(deck))
    return _choose_deletions(suiting, deck, parts, bodies)


def _choose_deletions(
    suiting: Suiting,
    deck: Deck,
    parts: Collection[int],
    bodies: Sequence[Collection[int]],
) -> Suiting:
    """Add the constraints to be deleted while the parts are rigid.

    A flag of a card deletes all constraints of its kinds. Joints between rigid bodies are valid in LS-DYNA, so they
    stay active unless the same flag has to delete other constraints.
    """
    by_flag = {flag: _read_deleted(deck, flag) for flag in ("NRBF", "NCSF")}
    nodal, by_set = (
        _is_on_parts(constraints, parts, deck) for constraints in by_flag.values()
    )
    parting_by_flag = {
        flag: [*_find_parting(constraints, parts, bodies, deck)]
        for flag, constraints in by_flag.items()
    }
    kept: list[str] = []
    are_joints = all(constraint.kind == "joint" for constraint in by_flag["NCSF"])
    if by_set and are_joints and parting_by_flag["NCSF"]:
        by_set = False
        kept = [text for _, text in parting_by_flag["NCSF"]]
    # NRBF may delete joints and extra nodes too.
    parting = [
        text
        for found in parting_by_flag.values()
        for kind, text in found
        if (nodal and "NRBF" in DELETING_FLAGS[kind])
        or (by_set and "NCSF" in DELETING_FLAGS[kind])
    ]
    return suiting._replace(
        delete_nodal_bodies=nodal,
        delete_node_sets=by_set,
        parting=tuple(parting),
        kept_joints=() if parting else tuple(kept),
    )


def _find_parting(
    constraints: Sequence[Constraint],
    parts: Collection[int],
    bodies: Sequence[Collection[int]],
    deck: Deck,
) -> Iterator[tuple[Kind, str]]:
    """Yield the constraints that connect separate rigid bodies of ``parts``, each with its kind and a description."""
    if not constraints:
        return
    # Imported here to keep start-up fast.
    from d2rpick.deck.ls_dyna_inventory import find_parts_of_nodes

    nodes = frozenset[int]().union(*(item.nodes for item in constraints))
    cards = find_element_cards(deck, searched=True)
    parts_by_node = find_parts_of_nodes(cards, nodes)
    lead_by_part = {part: min(body) for body in bodies for part in body}
    for constraint in constraints:
        linked = frozenset[int]().union(
            *(parts_by_node.get(node, ()) for node in constraint.nodes)
        )
        linked |= {constraint.part} if constraint.part else set()
        rigid = linked & {*parts}
        if len({lead_by_part.get(part, part) for part in rigid}) > 1:
            name = f"{constraint.kind} {constraint.id}".removesuffix(" 0")
            yield constraint.kind, f"{name} of {name_units(rigid)}"


def find_name_of_files(run: RadiossRun) -> str | None:
    """Return the beginning that a run's file names share, by which the engine finds the restart file.

    If the files have no common name, return the name in /RUN.
    """
    if run.starter and (root := find_root(run.starter.sources[0].name)):
        return root
    return run.legs[0].name if run.legs else None


def list_main_nodes(path: str) -> tuple[int, ...]:
    """Return the main nodes of all rigid bodies of a Radioss deck; empty if the deck cannot be read."""
    try:
        run = read_run(path)
    except DeckError:
        return ()
    bodies = run.starter.bodies if run.starter else ()
    return tuple(dict.fromkeys(body.node.value for body in bodies if body.node.value))


def _find_free_ids(deck: Deck) -> tuple[int, int]:
    """Return two ids above those of all switch sets and part sets of the deck."""
    sets = (
        switch_set.header.swset.value
        for switch_set in read_switching(deck)
        if switch_set.header
    )
    highest = max((*sets, *read_parts(deck).sets), default=0)
    first = max(_FIRST, highest + 1)
    return first, first + 1


def _read_deleted(deck: Deck, flag: str) -> list[Constraint]:
    """Return the constraints that a flag deletes. If either flag may delete a kind, the kind belongs to NCSF."""
    kinds = (kind for kind, flags in DELETING_FLAGS.items() if flags[-1] == flag)
    return [*read_constraints(deck, *kinds)]


def _is_on_parts(
    constraints: Sequence[Constraint], parts: Collection[int], deck: Deck
) -> bool:
    """Return True if there are constraints and all belong to these parts alone, so that they may be deleted."""
    if not constraints:
        return False
    # Imported here to keep start-up fast.
    from d2rpick.deck.ls_dyna_inventory import find_first_parts

    cards = find_element_cards(deck, searched=True)
    other_parts = read_parts(deck).material_by_part.keys() - set(parts)
    nodes_on_parts = find_first_parts(cards, parts)
    nodes_elsewhere = find_first_parts(cards, other_parts)
    return all(
        constraint.part in parts
        if constraint.part
        else constraint.nodes & nodes_on_parts.keys()
        and not constraint.nodes & nodes_elsewhere.keys()
        for constraint in constraints
    )
