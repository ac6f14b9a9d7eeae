"""Apply the deck of a run: rigid bodies, supports, gravity and costs, and doubts about the deck.

The part ids of a deck of another model have nothing to do with the run, so nothing of it is used.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from d2rpick.base.errors import Caution, are, if_written, name_units
from d2rpick.choice.cost import ByDeck, CostModel, Share
from d2rpick.deck.geometry import Placement
from d2rpick.deck.pieces import pieces_of, supports_of
from d2rpick.deck.radioss_files import LEFT_RIGID, RUINS
from d2rpick.flight.position_error import RigidBody
from d2rpick.histories.surroundings import Support, Surroundings

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Iterator, Sequence

    from d2rpick.choice.question import Reference, Settings
    from d2rpick.deck.model import Gravity, Hold, Inventory
    from d2rpick.histories.names import Part
    from d2rpick.histories.run import Run


def bodies_of(inventory: Inventory, parts: Collection[int]) -> tuple[RigidBody, ...]:
    """Return the rigid bodies that ``parts`` become; empty if elements, or ties between bodies, are unknown.

    In LS-DYNA, which switches parts, disconnected pieces of one part become one rigid body.  In Radioss, whose rigid
    bodies are sets of nodes, each piece may have a body of its own.
    """
    if not inventory.complete or not inventory.counts.keys() >= set(parts):
        return ()
    bodies = inventory.bodies(parts)
    if len(bodies) > 1 and inventory.ties:
        return ()
    return tuple(RigidBody(body, _whole(inventory, body)) for body in bodies)


def _whole(inventory: Inventory, body: tuple[int, ...]) -> bool:
    """Return True if a rigid body is one connected piece, or Radioss can treat its pieces separately."""
    alone = len(body) == 1 and inventory.solver == "radioss"
    return (
        alone or frozenset(body) in inventory.ready or pieces_of(inventory, body) == 1
    )


def merged(parts: Collection[int], bodies: Iterable[RigidBody]) -> RigidBody:
    """Return the single rigid body of parts that are merged, whatever ``bodies`` they would become."""
    whole = len(parts) > 1 or any(
        body.whole for body in bodies
    )  # a single part may consist of pieces
    return RigidBody(tuple(sorted(parts)), whole=whole)


def of_another_model(run: Run, inventory: Inventory) -> Caution | None:
    """Return a warning if a deck is not that of a run, else None.

    It is not if more titles of the parts in both differ than agree, or if the whole deck was read and lacks parts that
    have energy.
    """
    titled = [
        one
        for one in run.parts
        if one.id in inventory.parts and one.title and _title(one, inventory)
    ]
    other = [one for one in titled if _differ(one.title, _title(one, inventory))]
    found = _named(other, inventory) if 2 * len(other) > len(titled) else ""
    known = inventory.parts.keys() | inventory.history_groups
    absent = [one for one in run.parts if one.id not in known]
    if not found and inventory.complete and _has_energy(run, absent):
        found = f"{name_units(one.id for one in absent)} of the history {are(absent)} not in the deck"
    told = f"{found}: nothing of the deck is used; name that of the run"
    return Caution("deck-of-another-model", told) if found else None


def _has_energy(run: Run, parts: Sequence[Part]) -> bool:
    """Return True if the history contains energy of any of the parts."""
    return bool(parts) and bool(if_written(lambda: run.part_energies(parts).any()))


def doubts_of(parts: Iterable[Part], inventory: Inventory) -> Iterator[Caution]:
    """Yield a warning if some parts have other titles in the deck than in the history."""
    other = [
        part
        for part in parts
        if part.id in inventory.parts and _differ(part.title, _title(part, inventory))
    ]
    if other:
        yield Caution(
            "deck-of-another-model",
            f"{_named(other, inventory)}: is this the deck of the run?",
        )


def doubts_of_bodies(parts: Collection[int], inventory: Inventory) -> Iterator[Caution]:
    """Yield warnings if ties that are not followed may join the bodies of ``parts``, or one has loose pieces."""
    if inventory.ties and len(inventory.bodies(parts)) > 1:
        if len(inventory.ties) > 1:
            more = f" and {len(inventory.ties) - 1} more ties"
        else:
            more = ""
        found = f"{inventory.ties[0]}{more} may join parts that share no nodes, which is not followed"
        yield Caution(
            "ties-not-followed",
            f"{found}; parts that are tied belong in one rigid body",
        )
    cure = "LS-DYNA makes one rigid body of them: leave these parts out, or give each piece a part of its own"
    if inventory.solver != "ls-dyna":
        cure = "each of them needs a rigid body of its own"
    for body in bodies_of(inventory, parts):
        if not (body.whole or inventory.ties):
            lies = (
                f"{name_units(body.parts)} {'lies' if len(body.parts) == 1 else 'lie'}"
            )
            yield Caution(
                "loose-pieces",
                f"{lies} in {pieces_of(inventory, body.parts)} pieces that nothing joins; {cure}",
            )


def doubts_of_solver(parts: Collection[int], inventory: Inventory) -> Iterator[Caution]:
    """Yield warnings about what ruins a run, unknown supports, and parts whose stresses do not rotate with them."""
    for flaw in inventory.flaws:
        yield Caution(flaw.code, f"{flaw.place.file}:{flaw.place.line}: {flaw.message}")
    yield from (Caution("deck-not-followed", note) for note in inventory.boundary.notes)
    for part in parts:
        if part in inventory.parts and (why := inventory.parts[part].unswitchable):
            yield Caution(
                "unswitchable-part", f"{name_units([part])}: {why}; leave it out"
            )
    unturned = [
        part
        for part in parts
        if part in inventory.parts and not inventory.parts[part].section.turns
    ]
    if unturned and inventory.solver == "radioss":
        found = f"{name_units(unturned)}: the stresses of these solids do not turn with the rigid body"
        yield Caution(
            "stresses-unturned", f"{found}; expect an error after a large rotation"
        )


def left_rigid_in(run: Run, inventory: Inventory) -> Iterator[Caution]:
    """Yield a warning if a deck keeps parts rigid that deform in the history."""
    left = inventory.left_rigid
    if left and _has_energy(run, [part for part in run.parts if part.id in left.parts]):
        where = f"{left.place.file}:{left.place.line}"
        yield Caution(
            LEFT_RIGID,
            f"{where}: {left.found}, which deform in the history; {left.way_out}",
        )


def doubts_of_cost(model: CostModel, *, used: bool = True) -> Iterator[Caution]:
    """Yield warnings about what was not followed in a deck and, if its cost is ``used``, about weights not measured."""
    for note in model.inventory.notes:
        yield Caution("deck-not-followed", note)
    if used and model.assumed:
        taken = f"the cost of {', '.join(model.assumed)} was not measured; that of a formulation alike was taken"
        yield Caution("weights-by-analogy", taken)


def _named(other: Sequence[Part], inventory: Inventory) -> str:
    """Describe the first of the parts whose titles differ."""
    first = other[0]
    more = f", and {len(other) - 1} more" if len(other) > 1 else ""
    return f"part {first.id} is {first.title!r} in the history and {_title(first, inventory)!r} in the deck{more}"


def _title(part: Part, inventory: Inventory) -> str:
    """Return the title of a part in the deck."""
    return inventory.parts[part.id].title


def _differ(one: str, other: str) -> bool:
    """Return True if two titles differ, except in spaces, case, and length if one is cut off.

    Letters beyond ASCII are not compared, since the files of one run encode them in different ways.
    """
    plain = ("".join(filter(str.isascii, title)) for title in (one, other))
    first, second = (" ".join(title.split()).casefold() for title in plain)
    shorter = min(len(first), len(second))
    return first[:shorter] != second[:shorter]


def with_deck(
    settings: Settings, reference: Reference, model: CostModel
) -> tuple[Settings, tuple[Caution, ...]]:
    """Return settings with the cost share and the rigid bodies that the deck defines for the parts of a history.

    A given cost share is kept.  Warnings list what stays unknown; a deck of another model is not used.
    """
    inventory = model.inventory
    if foreign := of_another_model(reference.run, inventory):
        return replace(settings, bodies=()), (foreign,)
    ids = [part.id for part in reference.history.parts or ()]
    told = (*doubts_of_solver(ids, inventory), *left_rigid_in(reference.run, inventory))
    ruined = tuple(
        RUINS[code] for code in dict.fromkeys(one.code for one in told) if code in RUINS
    )
    history = reference.history
    settings = replace(settings, kept_off=inventory.kept_off, ruined=ruined)
    if not history.parts:
        why = "no parts are named whose elements are saved; give them with `parts`"
        if settings.cost_share is None:
            open_ = [Caution("cost-unknown", f"the run time stays open: {why}")]
        else:
            open_ = []
        return replace(settings, bodies=()), (*told, *open_)
    asked = settings.cost_share is None
    share = model.saved(ids) if asked else Share(settings.cost_share)
    found = replace(
        settings,
        cost_share=share.value,
        bodies=bodies_of(inventory, ids),
        placement=Placement(inventory),
        by_deck=ByDeck(inventory.files, model.weights if asked else None),
    )
    doubts = [
        *doubts_of(history.parts, inventory),
        *doubts_of_cost(model, used=asked and share.value is not None),
        *doubts_of_bodies(ids, inventory),
        *told,
    ]
    if share.reason:
        doubts.append(
            Caution("cost-unknown", f"the run time stays open: {share.reason}")
        )
    return found, tuple(doubts)


def in_deck(run: Run, inventory: Inventory | None) -> Run:
    """Return a run with the surroundings that its deck defines; unchanged without a deck of the model."""
    if inventory is None or of_another_model(run, inventory):
        return run
    return run.within(_surroundings(inventory))


def _surroundings(inventory: Inventory) -> Surroundings:
    """Return gravity, supports and connected parts according to the deck."""
    by_part, whole = supports_of(inventory)
    supports: dict[int | None, tuple[Support, ...]] = {
        part: _supports(holds) for part, holds in by_part.items()
    }
    supports[None] = _supports(whole)
    gravity: dict[int | None, tuple[float, ...]] = dict(_gravity(inventory))
    on_free = {
        gravity.get(part) for part in inventory.nodes_by_part.keys() - by_part.keys()
    }
    if len(on_free) == 1 and (common := on_free.pop()) is not None:
        gravity[None] = common
    return Surroundings(gravity, supports, partial(_bodies, inventory))


def _bodies(inventory: Inventory) -> tuple[tuple[int, ...], ...]:
    """Return the groups of connected parts; empty if parts may be missing, or ties may join the groups."""
    known = inventory.complete and not inventory.ties
    return inventory.bodies(inventory.nodes_by_part.keys()) if known else ()


def _supports(holds: tuple[Hold, ...]) -> tuple[Support, ...]:
    """Return the supports with their names and times, each once."""
    return tuple(dict.fromkeys(Support(one.name, one.start, one.end) for one in holds))


def _gravity(inventory: Inventory) -> Iterator[tuple[int, tuple[float, ...]]]:
    """Yield the possible accelerations of gravity for each part for which they are known."""
    loads = inventory.boundary.gravity
    for part, nodes in inventory.nodes_by_part.items() if loads is not None else ():
        acting = [(one, _acts(one, part, nodes)) for one in loads or ()]
        if all(acts is not None for _, acts in acting):
            together = _together([one for one, acts in acting if acts])
            if together is not None:
                yield part, together


def _acts(load: Gravity, part: int, nodes: np.ndarray) -> bool | None:
    """Return True if gravity acts on a part with these nodes; None if it acts on some nodes only."""
    if load.nodes is None or part in load.parts:
        return True
    inside = np.isin(nodes, load.nodes)
    return bool(inside.any()) if inside.all() or not inside.any() else None


def _together(loads: list[Gravity]) -> tuple[float, ...] | None:
    """Return the possible sizes of the sum of several loads; None if the sum is unknown."""
    if len(loads) < 2:
        return tuple(
            sorted({abs(value) for one in loads for value in one.values} or {0.0})
        )
    if any(one.axis is None or len(one.values) > 1 for one in loads):
        return None
    along = [
        sum(one.values[0] for one in loads if one.axis == axis) for axis in range(3)
    ]
    return (float(np.linalg.norm(along)),)
