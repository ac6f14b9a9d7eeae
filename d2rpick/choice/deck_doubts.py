"""What may be wrong with what a deck says: of another model, not followed as a whole, weights taken over.

The deck of another model tells numbers of parts that have nothing to do with the run: nothing of it is used.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from d2rpick.choice.rigid_bodies import bodies_of
from d2rpick.choice.warnings import Caution
from d2rpick.deck.pieces import pieces_of
from d2rpick.deck.radioss_run import LEFT_RIGID
from d2rpick.errors import FormatError, are, name_units

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Iterator, Sequence

    from d2rpick.choice.cost import CostModel
    from d2rpick.deck.model import Inventory
    from d2rpick.histories.names import Part
    from d2rpick.histories.run import Run


def of_another_model(run: Run, inventory: Inventory) -> Caution | None:
    """Say why a deck is not that of a run; None where nothing shows it.

    It is not where more of the parts that both have differ in their titles than agree, or where all of the deck was
    read and parts with energy are not in it.
    """
    titled = [one for one in run.parts if one.id in inventory.parts and one.title and _title(one, inventory)]
    other = [one for one in titled if _differ(one.title, _title(one, inventory))]
    found = _named(other, inventory) if 2 * len(other) > len(titled) else ""
    known = inventory.parts.keys() | inventory.history_groups
    absent = [one for one in run.parts if one.id not in known]
    if not found and inventory.complete and _has_energy(run, absent):
        found = f"{name_units(one.id for one in absent)} of the history {are(absent)} not in the deck"
    told = f"{found}: nothing of the deck is used; name that of the run"
    return Caution("deck-of-another-model", told) if found else None


def _has_energy(run: Run, parts: Sequence[Part]) -> bool:
    """Whether parts are seen to have energy."""
    try:
        return bool(parts) and bool(run.part_energies(parts).any())
    except FormatError:  # it is not written
        return False


def doubts_of(parts: Iterable[Part], inventory: Inventory) -> Iterator[Caution]:
    """Say so where some parts of a history have other titles in the deck: what it says may be of another model."""
    other = [part for part in parts if part.id in inventory.parts and _differ(part.title, _title(part, inventory))]
    if other:
        yield Caution("deck-of-another-model", f"{_named(other, inventory)}: is this the deck of the run?")


def doubts_of_bodies(parts: Collection[int], inventory: Inventory) -> Iterator[Caution]:
    """Say so where ties that are not followed may join the rigid bodies that parts become, or one has loose pieces."""
    if inventory.ties and len(inventory.bodies(parts)) > 1:
        more = f" and {len(inventory.ties) - 1} more ties" if len(inventory.ties) > 1 else ""
        found = f"{inventory.ties[0]}{more} may join parts that share no nodes, which is not followed"
        yield Caution("ties-not-followed", f"{found}; parts that are tied belong in one rigid body")
    cure = "LS-DYNA makes one rigid body of them: leave these parts out, or give each piece a part of its own"
    cure = cure if inventory.solver == "ls-dyna" else "each of them needs a rigid body of its own"
    for body in bodies_of(inventory, parts):
        if not (body.whole or inventory.ties):
            lies = f"{name_units(body.parts)} {'lies' if len(body.parts) == 1 else 'lie'}"
            yield Caution(
                "loose-pieces", f"{lies} in {pieces_of(inventory, body.parts)} pieces that nothing joins; {cure}"
            )


def doubts_of_solver(parts: Collection[int], inventory: Inventory) -> Iterator[Caution]:
    """Say what ruins a run, what is not known of its supports, and which parts would spring back wrongly if turned."""
    for flaw in inventory.flaws:
        yield Caution(flaw.code, f"{flaw.place.file}:{flaw.place.line}: {flaw.message}")
    yield from (Caution("deck-not-followed", note) for note in inventory.boundary.notes)
    unturned = [part for part in parts if part in inventory.parts and not inventory.parts[part].section.turns]
    if unturned and inventory.solver == "radioss":
        found = f"{name_units(unturned)}: the stresses of these solids do not turn with the rigid body"
        yield Caution("stresses-unturned", f"{found}; expect an error after a large rotation")


def left_rigid_in(run: Run, inventory: Inventory) -> Iterator[Caution]:
    """Say which parts a deck keeps rigid, in a run that switches others, although they deform."""
    left = inventory.left_rigid
    if left and _has_energy(run, [part for part in run.parts if part.id in left.parts]):
        where = f"{left.place.file}:{left.place.line}"
        yield Caution(LEFT_RIGID, f"{where}: {left.found}, which deform in the history; {left.way_out}")


def doubts_of_cost(model: CostModel, *, used: bool = True) -> Iterator[Caution]:
    """Say what was not followed of a deck and, where its cost is ``used``, which weights were not measured."""
    for note in model.inventory.notes:
        yield Caution("deck-not-followed", note)
    if used and model.assumed:
        taken = f"the cost of {', '.join(model.assumed)} was not measured; that of a formulation alike was taken"
        yield Caution("weights-by-analogy", taken)


def _named(other: Sequence[Part], inventory: Inventory) -> str:
    """Name the first of the parts whose titles differ."""
    first, more = other[0], f", and {len(other) - 1} more" if len(other) > 1 else ""
    return f"part {first.id} is {first.title!r} in the history and {_title(first, inventory)!r} in the deck{more}"


def _title(part: Part, inventory: Inventory) -> str:
    return inventory.parts[part.id].title


def _differ(one: str, other: str) -> bool:
    """Whether two titles are there and differ, but for blanks, capitals, and where a format cuts them.

    Letters beyond ASCII are not compared: files of one run encode them in different ways.
    """
    plain = ("".join(filter(str.isascii, title)) for title in (one, other))
    first, second = (" ".join(title.split()).casefold() for title in plain)
    shorter = min(len(first), len(second))
    return first[:shorter] != second[:shorter]
