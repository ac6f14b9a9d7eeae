"""Apply the deck of a run: its rigid bodies, supports, gravity and costs, and warnings about the deck.

If the deck belongs to another model, its part ids do not match the run, so the deck is not used.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from d2rpick.base.errors import Caution, choose_verb, give_if_written, name_units
from d2rpick.choice.parts.cost import ByDeck, CostModel, Share
from d2rpick.deck.geometry import Placement
from d2rpick.deck.pieces import count_pieces, find_supports
from d2rpick.deck.radioss_files import LEFT_RIGID, RUINS
from d2rpick.flight.position_error import RigidBody
from d2rpick.histories.surroundings import Support, Surroundings

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Iterator, Sequence

    from d2rpick.choice.question import Reference, Settings
    from d2rpick.deck.model import Gravity, Hold, Inventory
    from d2rpick.histories.history import History
    from d2rpick.histories.names import Part
    from d2rpick.histories.run import OpenedRun


def find_rigid_bodies(
    inventory: Inventory, parts: Collection[int]
) -> tuple[RigidBody, ...]:
    """Return the rigid bodies that ``parts`` become; empty if their elements or the ties between them are unknown.

    In LS-DYNA, parts are switched, so disconnected pieces of a part become one rigid body. In Radioss, rigid bodies are
    sets of nodes, so each piece may be a body of its own.
    """
    if not inventory.complete or not inventory.counts.keys() >= set(parts):
        return ()
    bodies = inventory.bodies(parts)
    if len(bodies) > 1 and inventory.ties:
        return ()
    return tuple(RigidBody(body, _is_whole(inventory, body)) for body in bodies)


def _is_whole(inventory: Inventory, body: tuple[int, ...]) -> bool:
    """Return True if a rigid body is connected, or if Radioss can treat its disconnected pieces as separate bodies."""
    alone = len(body) == 1 and inventory.solver == "radioss"
    return (
        alone
        or frozenset(body) in inventory.ready
        or count_pieces(inventory, body) == 1
    )


def merge_into_one_body(
    parts: Collection[int], bodies: Iterable[RigidBody]
) -> RigidBody:
    """Return the single rigid body of merged parts, which replaces the ``bodies`` of these parts."""
    # A single part is one connected body only if it has no disconnected pieces.
    whole = len(parts) > 1 or any(body.whole for body in bodies)
    return RigidBody(tuple(sorted(parts)), whole=whole)


def check_model_of_deck(run: OpenedRun, inventory: Inventory) -> Caution | None:
    """Return a warning if a deck does not match the model of a run, otherwise None."""
    difference = describe_other_model(run, inventory)
    text = f"{difference}: the deck is not used; give the deck of this run"
    return Caution("deck-of-another-model", text) if difference else None


def describe_other_model(run: OpenedRun, inventory: Inventory) -> str:
    """Describe how the model of a deck differs from that of a run; empty if the deck belongs to the run.

    A deck does not belong to a run if most titles of their common parts differ, or if the deck was read completely and
    lacks parts that have energy.
    """
    titled = [
        part
        for part in run.parts
        if part.id in inventory.parts
        and part.title
        and _get_title_in_deck(part, inventory)
    ]
    differing = [
        part
        for part in titled
        if is_different_title(part.title, _get_title_in_deck(part, inventory))
    ]
    difference = (
        _describe_differing(differing, inventory)
        if 2 * len(differing) > len(titled)
        else ""
    )
    ids_in_deck = inventory.parts.keys() | inventory.history_groups
    absent = [part for part in run.parts if part.id not in ids_in_deck]
    if not difference and inventory.complete and _has_energy(run, absent):
        difference = f"{name_units(part.id for part in absent)} of the history {choose_verb(absent)} not in the deck"
    return difference


def _has_energy(run: OpenedRun, parts: Sequence[Part]) -> bool:
    """Return True if any of the parts has an energy in the history that differs from zero at some time."""
    return bool(parts) and bool(give_if_written(lambda: run.part_energies(parts).any()))


def warn_about_titles(parts: Iterable[Part], inventory: Inventory) -> Iterator[Caution]:
    """Yield a warning if the part titles in deck and history differ."""
    differing = [
        part
        for part in parts
        if part.id in inventory.parts
        and is_different_title(part.title, _get_title_in_deck(part, inventory))
    ]
    if differing:
        yield Caution(
            "deck-of-another-model",
            f"{_describe_differing(differing, inventory)}: is this the deck of the run?",
        )


def warn_about_bodies(
    parts: Collection[int], inventory: Inventory
) -> Iterator[Caution]:
    """Yield warnings if ties that were not read may join the bodies of ``parts``, or if a body is disconnected."""
    if inventory.ties and len(inventory.bodies(parts)) > 1:
        if len(inventory.ties) > 1:
            more_ties = f" and {len(inventory.ties) - 1} more ties"
        else:
            more_ties = ""
        ties_text = f"{inventory.ties[0]}{more_ties} may connect parts that share no nodes, which is not checked"
        yield Caution(
            "ties-not-followed",
            f"{ties_text}; put tied parts into one rigid body",
        )
    cure = "LS-DYNA makes one rigid body of them: leave these parts out, or give each piece its own part"
    if inventory.solver != "ls-dyna":
        cure = "give each piece its own rigid body"
    for body in find_rigid_bodies(inventory, parts):
        if not (body.whole or inventory.ties):
            lies = (
                f"{name_units(body.parts)} {'lies' if len(body.parts) == 1 else 'lie'}"
            )
            yield Caution(
                "loose-pieces",
                f"{lies} in {count_pieces(inventory, body.parts)} pieces that are not connected; {cure}",
            )


def warn_about_solver(
    parts: Collection[int], inventory: Inventory
) -> Iterator[Caution]:
    """Yield warnings about deck features that ruin a run, unknown supports, and stresses without objective update."""
    for flaw in inventory.flaws:
        yield Caution(flaw.code, f"{flaw.place.file}:{flaw.place.line}: {flaw.message}")
    yield from (Caution("deck-not-followed", note) for note in inventory.boundary.notes)
    for part in parts:
        if part not in inventory.parts:
            continue
        why = inventory.parts[part].unswitchable
        if why:
            yield Caution(
                "unswitchable-part", f"{name_units([part])}: {why}; leave it out"
            )
    unturned = [
        part
        for part in parts
        if part in inventory.parts and not inventory.parts[part].section.turns
    ]
    if unturned and inventory.solver == "radioss":
        parts_text = f"{name_units(unturned)}: the stresses of these solids do not rotate with the rigid body"
        yield Caution(
            "stresses-unturned",
            f"{parts_text}; expect wrong stresses after a large rotation",
        )


def warn_about_other_solver(
    history: History, inventory: Inventory
) -> Iterator[Caution]:
    """Yield a warning if one solver wrote the history and the deck is for the other solver."""
    from d2rpick.deck.printing import SOLVERS  # Imported here to keep start-up fast.

    for name, solver in SOLVERS.items():
        if name != inventory.solver and history.energy_format in solver.histories:
            deck = inventory.files[0].name
            files = ", ".join(history.source)
            text = f"{files} was written by {solver.title}, but {deck} is a deck of {SOLVERS[inventory.solver].title}"
            use = (
                "check that both describe the same model, or give the deck of this run"
            )
            yield Caution("deck-of-another-solver", f"{text}; {use}")


def warn_about_left_rigid(run: OpenedRun, inventory: Inventory) -> Iterator[Caution]:
    """Yield a warning if parts that deform in the history are rigid in the deck."""
    left_rigid = inventory.left_rigid
    if left_rigid and _has_energy(
        run, [part for part in run.parts if part.id in left_rigid.parts]
    ):
        where = f"{left_rigid.place.file}:{left_rigid.place.line}"
        yield Caution(
            LEFT_RIGID,
            f"{where}: {left_rigid.found}, which deform in the history; {left_rigid.way_out}",
        )


def warn_about_cost(model: CostModel, *, used: bool = True) -> Iterator[Caution]:
    """Yield a warning about unread cards of a deck and, if its cost is ``used``, about assumed weights."""
    for note in model.inventory.notes:
        yield Caution("deck-not-followed", note)
    if used and model.assumed:
        taken = f"the cost of {', '.join(model.assumed)} was not measured; the cost of a similar formulation is used"
        yield Caution("weights-by-analogy", taken)
    if used and model.built_in:
        source = model.weights.file.name if model.weights.file else "`weights`"
        lack = f"{source} has no weight for {', '.join(model.built_in)}"
        scaled = "the built-in weights are used, scaled to the given ones"
        yield Caution("built-in-weights", f"{lack}; {scaled}")


def _describe_differing(differing: Sequence[Part], inventory: Inventory) -> str:
    """Describe the first of the parts whose titles differ."""
    first = differing[0]
    more_parts = f", and {len(differing) - 1} more" if len(differing) > 1 else ""
    title_in_deck = _get_title_in_deck(first, inventory)
    return f"part {first.id} is {first.title!r} in the history and {title_in_deck!r} in the deck{more_parts}"


def _get_title_in_deck(part: Part, inventory: Inventory) -> str:
    """Return the title of a part in the deck."""
    return inventory.parts[part.id].title


def is_different_title(first_title: str, second_title: str) -> bool:
    """Return True if two titles differ apart from spaces and case; one title may be a truncated form of the other.

    Non-ASCII letters are not compared, because the files of a run may encode them in different ways.
    """
    plain = (
        "".join(filter(str.isascii, title)) for title in (first_title, second_title)
    )
    first, second = (" ".join(title.split()).casefold() for title in plain)
    shorter = min(len(first), len(second))
    return first[:shorter] != second[:shorter]


def add_deck_to_settings(
    settings: Settings, reference: Reference, model: CostModel
) -> tuple[Settings, tuple[Caution, ...]]:
    """Return settings with the cost fraction and the rigid bodies that the deck defines for the parts of a history.

    A cost share that the user gave is kept. Warnings list the values that remain unknown; a deck of another model is
    not used.
    """
    inventory = model.inventory
    foreign = check_model_of_deck(reference.run, inventory)
    if foreign:
        return replace(settings, bodies=()), (foreign,)
    ids = [part.id for part in reference.history.parts or ()]
    doubts_of_parts = (
        *warn_about_solver(ids, inventory),
        *warn_about_left_rigid(reference.run, inventory),
        *warn_about_other_solver(reference.history, inventory),
    )
    ruined = tuple(
        RUINS[code]
        for code in dict.fromkeys(caution.code for caution in doubts_of_parts)
        if code in RUINS
    )
    history = reference.history
    settings = replace(
        settings,
        kept_off=inventory.kept_off,
        kept_deformable=_list_parts_kept_deformable(inventory),
        ruined=ruined,
    )
    if not history.parts:
        why = "name the switched parts with `parts`"
        if settings.cost_share is None:
            open_ = [Caution("cost-unknown", f"the CPU time is not estimated: {why}")]
        else:
            open_ = []
        # Parts defined in a missing include file cannot be named.
        unread = warn_about_cost(model, used=False)
        return replace(settings, bodies=()), (*doubts_of_parts, *unread, *open_)
    is_computed = settings.cost_share is None
    share = model.saved(ids) if is_computed else Share(settings.cost_share)
    with_cost = replace(
        settings,
        cost_share=share.value,
        bodies=find_rigid_bodies(inventory, ids),
        placement=Placement(inventory),
        by_deck=ByDeck(inventory.files, model.weights if is_computed else None),
    )
    doubts = [
        *warn_about_titles(history.parts, inventory),
        *warn_about_cost(model, used=is_computed and share.value is not None),
        *warn_about_bodies(ids, inventory),
        *doubts_of_parts,
    ]
    if share.reason:
        doubts.append(
            Caution("cost-unknown", f"the CPU time is not estimated: {share.reason}")
        )
    return with_cost, tuple(doubts)


def _list_parts_kept_deformable(inventory: Inventory) -> tuple[int, ...]:
    """Return the springs, and the parts whose material or solids a rigid body does not allow."""
    return tuple(
        part
        for part, data in inventory.parts.items()
        if part in inventory.springs or data.unswitchable or not data.section.turns
    )


def add_surroundings(run: OpenedRun, inventory: Inventory | None) -> OpenedRun:
    """Return the run with the gravity, supports and connections in its deck; unchanged if no deck matches."""
    if inventory is None or check_model_of_deck(run, inventory):
        return run
    return run.within(_find_surroundings(inventory))


def _find_surroundings(inventory: Inventory) -> Surroundings:
    """Return the gravity, the supports and the connected parts according to the deck."""
    by_part, whole = find_supports(inventory)
    supports: dict[int | None, tuple[Support, ...]] = {
        part: _make_supports(holds) for part, holds in by_part.items()
    }
    supports[None] = _make_supports(whole)
    gravity: dict[int | None, tuple[float, ...]] = dict(_find_gravity(inventory))
    on_free = {
        gravity.get(part) for part in inventory.nodes_by_part.keys() - by_part.keys()
    }
    if len(on_free) == 1:
        (common,) = on_free
        if common is not None:
            gravity[None] = common
    return Surroundings(gravity, supports, partial(_group_connected_parts, inventory))


def _group_connected_parts(inventory: Inventory) -> tuple[tuple[int, ...], ...]:
    """Return the groups of connected parts; empty if parts may be missing, or if ties may join the groups."""
    is_complete = inventory.complete and not inventory.ties
    return inventory.bodies(inventory.nodes_by_part.keys()) if is_complete else ()


def _make_supports(holds: tuple[Hold, ...]) -> tuple[Support, ...]:
    """Return the supports with their names and times, each of them once."""
    return tuple(
        dict.fromkeys(Support(hold.name, hold.start, hold.end) for hold in holds)
    )


def _find_gravity(inventory: Inventory) -> Iterator[tuple[int, tuple[float, ...]]]:
    """Yield each part with known gravity, and the accelerations of gravity that may act on it."""
    loads = inventory.boundary.gravity
    for part, nodes in inventory.nodes_by_part.items() if loads is not None else ():
        acting = [(load, _is_gravity_on(load, part, nodes)) for load in loads or ()]
        if all(acts is not None for _, acts in acting):
            together = _sum_gravity([load for load, acts in acting if acts])
            if together is not None:
                yield part, together


def _is_gravity_on(load: Gravity, part: int, nodes: np.ndarray) -> bool | None:
    """Return True if gravity acts on a part with these nodes; None if it acts only on some of the nodes."""
    if load.nodes is None or part in load.parts:
        return True
    inside = np.isin(nodes, load.nodes)
    return bool(inside.any()) if inside.all() or not inside.any() else None


def _sum_gravity(loads: list[Gravity]) -> tuple[float, ...] | None:
    """Return the possible sums of several gravity loads [length/time^2]; None if the sum is unknown."""
    if len(loads) < 2:
        values = loads[0].values if loads else ()
        return tuple(sorted({abs(value) for value in values} or {0.0}))
    if any(load.axis is None or len(load.values) > 1 for load in loads):
        return None
    along = [
        sum(load.values[0] for load in loads if load.axis == axis) for axis in range(3)
    ]
    return (float(np.linalg.norm(along)),)
