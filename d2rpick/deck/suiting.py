"""What a card has to suit in the deck that it is for: ids that are taken, constraints on the parts, the run's end."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final, NamedTuple

from d2rpick.deck.ls_dyna_parts import (
    Constraint,
    element_cards,
    read_constraints,
    read_parts,
)
from d2rpick.deck.radioss_files import root_of, run_files
from d2rpick.deck.radioss_run import Run, in_order, read_run
from d2rpick.deck.reader import Deck, read_deck
from d2rpick.deck.switching import read_switching

if TYPE_CHECKING:
    from collections.abc import Collection, Sequence

_FIRST: Final = 901  # id of switch sets and part sets, where it is free


class Suiting(NamedTuple):
    """What the deck asks of a card; None and False where it asks nothing.

    ``solver`` is whose deck it is, ``name`` and ``end`` are those of its run [time], ``swset`` are free ids of switch
    sets, above which those of part sets are free too.  ``delete_nodal_bodies``, ``delete_node_sets``: constraints of
    the deck, which all lie on the parts, have to be deleted while these are rigid.
    """

    solver: str
    name: str | None = None
    end: float | None = None
    swset: tuple[int, int] | None = None
    delete_nodal_bodies: bool = False
    delete_node_sets: bool = False


def find_suiting(path: str, parts: Collection[int]) -> Suiting:
    """Find what a deck asks of a card that switches some parts.

    Raises
    ------
    DeckError
        If the deck cannot be read.
    """
    if run_files(path):
        run = read_run(path)
        legs = run.legs
        has_end = bool(legs) and in_order(legs) and not legs[-1].sensor
        return Suiting(
            "radioss", find_name_of_files(run), legs[-1].stop.value if has_end else None
        )
    deck = read_deck(path)
    bodies = [*read_constraints(deck, "nodal rigid body")]
    further = [*read_constraints(deck, "extra nodes", "joint")]
    nodal, by_set = (_lie_on(some, parts, deck) for some in (bodies, further))
    return Suiting("ls-dyna", None, None, _find_free_ids(deck), nodal, by_set)


def find_name_of_files(run: Run) -> str | None:
    """Give the name that the files of a run begin with, by which the engine finds its restart; else that in /RUN."""
    if run.starter and (root := root_of(run.starter.sources[0].name)):
        return root
    return run.legs[0].name if run.legs else None


def _find_free_ids(deck: Deck) -> tuple[int, int]:
    """Two ids from which on no switch set and no part set of the deck has any."""
    sets = (one.header.swset.value for one in read_switching(deck) if one.header)
    highest = max((*sets, *read_parts(deck).sets), default=0)
    first = max(_FIRST, highest + 1)
    return first, first + 1


def _lie_on(
    constraints: Sequence[Constraint], parts: Collection[int], deck: Deck
) -> bool:
    """Whether there are constraints, and each lies on these parts alone: to delete them is to delete all of a kind."""
    if not constraints:
        return False
    from d2rpick.deck.ls_dyna_inventory import first_parts  # loads numpy

    cards = element_cards(deck, searched=True)
    rest = read_parts(deck).materials.keys() - set(parts)
    touching, beyond = first_parts(cards, parts), first_parts(cards, rest)
    return all(
        constraint.part in parts
        or (constraint.nodes & touching.keys() and not constraint.nodes & beyond.keys())
        for constraint in constraints
    )
