"""Cards of a first run that switches itself: no reference tells when it flies, so the solver sees it by contact forces.

Radioss: legs that sensors end, each by /STOP/LSENSOR (docs/reference/first-run.md).  LS-DYNA: a pair of
switch sets with CODE 2 (no contact force) and 4 (contact force), from published text.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final, NamedTuple

from d2rpick.base.errors import ArgumentError, DeckError
from d2rpick.deck import read_inventory
from d2rpick.deck.engine_files import capped, listed, off
from d2rpick.deck.ls_dyna_parts import read_entities
from d2rpick.deck.pieces import inner_period
from d2rpick.deck.printed_card import (
    PHYSICS,
    PrintedCard,
    Printing,
    check_ids,
    comments,
    shortest,
)
from d2rpick.deck.radioss_bodies import bodies_for
from d2rpick.deck.radioss_deck import kept_off
from d2rpick.deck.radioss_run import parts_off, read_run
from d2rpick.deck.reader import read_deck
from d2rpick.deck.switch_sets import Waiting, header, to_deformable, to_rigid
from d2rpick.running.checks import NO_CONTACT, contacts_of, refuse_held
from d2rpick.running.inner_motion import Wait, check_wait, wait_of_deck

if TYPE_CHECKING:
    from collections.abc import Collection, Sequence

    from d2rpick.deck.model import Inventory
    from d2rpick.deck.radioss_deck import Starter
    from d2rpick.deck.radioss_run import Run

# The starter of OpenRadioss looks for /RBODY/OFF in so many engine files.  A leg behind the end of the run is one step.
_MOST_LEGS: Final = 9
# Largest step while rigid, of the wait: a contact is seen at most so late.
_CAP_SHARE: Final = 300
# LS-DYNA: how long after it becomes rigid the first contact may not release it, of the wait.
_SHORT: Final = 100
_LOADS: Final = ("CLOAD", "PLOAD", "MONVOL", "LOAD", "PRELOAD", "LASER", "PFLUID")
_UNSEEN: Final = "pushes without a contact, so that a flight is not seen by contacts"
_OF_ALL: Final = (
    "A first run: no reference tells the level at td, so that none is matched.",
    "Only forces of contacts are seen: nothing else may act on the parts but gravity.",
)
_OF_RADIOSS: Final = (
    "Each deformable leg ends when no contact has had a force for the wait.",
    "No window keeps a margin: each rigid leg ends in the first step of a contact, {cap:g} at most into it.",
    "A contact of the parts with themselves counts: while it pushes, they do not fly.",
    "Legs behind the end of the run take one step.",
)
_OF_WALLS: Final = (
    "A rigid body that meets a rigid wall in the last step of its leg is stopped in that step: in a computed run it had"
    " a momentum of 511 after it, for 365 deformable. drive keeps a margin before it."
)
_OF_LS_DYNA: Final = (
    "CODE 2 has no wait: parts become rigid without force after TIME1, also before a push and between two of them.",
    "Other contacts, rigid walls and loads are not seen by these switches.",
    "These cards were not tried with the solver.",
)


# LS-DYNA: what acts on parts without a contact, but for gravity.
_PUSHES, _OF_GRAVITY = ("LOAD_", "AIRBAG_"), ("LOAD_BODY", "LOAD_GRAVITY")
# The offset must be more than the thickness of the contact, half of both shells: so many times the thickest one.
_CLEAR: Final = 2


class First(NamedTuple):
    """A card for the first run, the wait that it goes by, and what to know about it."""

    card: PrintedCard
    wait: Wait
    notes: tuple[str, ...]


def first_card(
    path: str,
    parts: Collection[int] = (),
    wait: float | None = None,
    after: float | None = None,
) -> First:
    """Print the cards with which the first run of a deck switches itself.

    Parameters
    ----------
    path : str
        Main deck of LS-DYNA, or a file of a Radioss run with one engine file.
    parts : collection of int
        Parts to be switched; Radioss: by default those of the bodies that the engine file puts off.
    wait : float, optional
        Time without force that counts as flight [time]; by default half of the longest inner period by the deck.
    after : float, optional
        Nothing becomes rigid before [time].

    Raises
    ------
    DeckError
        If the deck has no contact that shows a flight, or something else than contacts and gravity acts on the parts.
    RangeError
        If the wait is below half of a period that is known.
    ArgumentError
        If the deck tells no wait, or no parts.
    """
    inventory = read_inventory(path)
    chosen = tuple(parts)
    if inventory.solver == "radioss":
        chosen = chosen or parts_off(read_run(path))
    if not chosen:
        raise ArgumentError(
            f"no parts were given, and {path} keeps no body off; name them with `parts`"
        )
    refuse_held(path, inventory, chosen)
    known = _wait(path, inventory, wait)
    make = _radioss if inventory.solver == "radioss" else _ls_dyna
    return make(path, inventory, chosen, known, after)


def _wait(path: str, inventory: Inventory, given: float | None) -> Wait:
    """Give the wait and its reason."""
    if given is not None:
        check_wait(given, wait_of_deck(inventory), path)
        return Wait(given, "given", "as given")
    known = inner_period(inventory)
    if known is None:
        raise ArgumentError(
            f"`wait` is not given, and {path} does not tell it: no masses on springs that are followed; give the time"
            " without force that counts as flight, above half of the longest inner period"
        )
    return Wait(
        float(f"{known.time / 2:.3g}"),
        "deck",
        f"half of the period {known.time:.3g} of {known.reason}",
    )


# Radioss.


def _radioss(
    path: str,
    inventory: Inventory,
    parts: Sequence[int],
    wait: Wait,
    after: float | None,
) -> First:
    run, bodies = read_run(path), bodies_for(path, parts)
    if run.starter is None or len(run.legs) != 1:
        raise DeckError(
            f"{path}: the run has {len(run.legs)} engine files; its starter deck and one were expected"
        )
    _refuse_loads(run.starter)
    (leg,) = run.legs
    forces = list(contacts_of(run.starter))
    if not forces:
        raise DeckError(f"{path}: {NO_CONTACT}")
    at_rest = after is None and _falls(run, inventory, parts)
    start = wait.time if after is None else max(after, wait.time)
    sensors, contact, flight = _sensors(forces, wait.time, start, bodies.sensor)
    cap = float(f"{wait.time / _CAP_SHARE:.2g}")
    others = tuple(node for node in kept_off(run.legs) if node not in bodies.nodes)
    files = {}
    for number in range(1, _MOST_LEGS + 1 - at_rest):
        rigid = number % 2 == at_rest
        last = number == _MOST_LEGS - at_rest
        stop = (
            ()
            if last
            else ("/STOP/LSENSOR", str(contact if rigid else flight), "0 0 0 0 0 0")
        )
        lines = [f"/RUN/{leg.name}/{number}", f"{leg.stop.value!r:>20}", *stop]
        switch = ("/RBODY/ON", *listed(bodies.nodes), *capped(cap), *off(others))
        lines += switch if rigid else off((*bodies.nodes, *others))
        files[f"{leg.name}_{number:04d}.rad"] = "\n".join(lines) + "\n"
    how = (
        f"at rest in free fall: rigid from 0; then {_waited(wait)}"
        if at_rest
        else _waited(wait)
    )
    told = (note.format(cap=cap) for note in _OF_RADIOSS)
    notes = (
        how,
        *bodies.notes,
        *_OF_ALL,
        *told,
        *((_OF_WALLS,) if run.starter.named("RWALL") else ()),
    )
    head = "".join(f"# {line}\n" for line in comments([*notes, *PHYSICS]))
    return First(
        PrintedCard(head, (), files, starter=bodies.cards + sensors), wait, notes
    )


def _refuse_loads(starter: Starter) -> None:
    for card in starter.named(*_LOADS):
        raise DeckError(f"{card.at}: /{card.name} {_UNSEEN}")


def _falls(run: Run, inventory: Inventory, parts: Collection[int]) -> bool:
    """Whether the parts are at rest at first and gravity acts on them; nothing holds them."""
    starter = run.starter
    still = (
        starter is not None
        and not starter.named("INIVEL")
        and not any(leg.starts for leg in run.legs)
    )
    return still and bool(inventory.boundary.gravity) and bool(parts)


def _sensors(
    forces: Sequence[tuple[str, int]], wait: float, start: float, first: int
) -> tuple[str, int, int]:
    """Write sensors: of a force within the wait, and of a flight; their text and the ids of both."""
    texts, contact, free = list[str](), first, first + len(forces)
    for number, (kind, what) in enumerate(forces, start=first):
        row = f"{what:10d}{'NF':>10}{-1.0:20}{0.0:20}{0.0:20}"
        texts.append(
            f"/SENSOR/{kind}/{number}\nforce, or shortly after\n{shortest(wait, 20):>20}\n{row}\n"
        )
    for other in range(first + 1, first + len(forces)):
        texts.append(
            f"/SENSOR/OR/{free}\nany force\n{0:20d}\n{contact:10d}{other:10d}\n"
        )
        contact, free = free, free + 1
    texts.append(f"/SENSOR/NOT/{free}\nno force\n{0:20d}\n{contact:10d}\n")
    texts.append(f"/SENSOR/TIME/{free + 1}\nfrom then on\n{shortest(start, 20):>20}\n")
    texts.append(f"/SENSOR/AND/{free + 2}\nflight\n{0:20d}\n{free:10d}{free + 1:10d}\n")
    return "".join(texts), contact, free + 2


def _waited(wait: Wait) -> str:
    return f"flight is {wait.time:.4g} without force: {wait.reason}"


# LS-DYNA.


def _ls_dyna(
    path: str,
    inventory: Inventory,
    parts: Sequence[int],
    wait: Wait,
    after: float | None,
) -> First:
    deck = read_deck(path)
    entities = read_entities(deck, "CONTACT")
    able = [one for one in entities.found if one.triggers]
    for card in deck.cards:
        if card.name.startswith(_PUSHES) and not card.name.startswith(_OF_GRAVITY):
            raise DeckError(
                f"{card.at}: *{card.name} pushes without a contact, so that a flight is not seen by contacts"
            )
    if not entities.all_known or len(able) != 1:
        found = (
            f"{len(able)} contacts"
            if entities.all_known
            else "contacts that are not all known"
        )
        raise DeckError(
            f"{path}: {found} between surfaces, or of nodes with a surface; one was expected: a switch waits for one,"
            " and single-surface contacts never trigger it"
        )
    contact, ids = able[0].id or able[0].number, check_ids(parts)
    printing = Printing(part=tuple(ids), bodies=inventory.bodies(ids))
    one, other = printing.swset
    falls = bool(inventory.boundary.gravity) and not deck.named("INITIAL_VELOCITY")
    hint = (
        "TIME1 is 0: give the time of the last push (--after) where it is known.",
    ) * (after is None and not falls)
    fall = ("At rest in free fall: rigid from 0, TIME1 0.",) * (after is None and falls)
    offset, where = _offset(inventory, able[0].keyword)
    notes = (_waited(wait), *fall, *_OF_ALL, *_OF_LS_DYNA, where, *hint)
    lines = [f"$ {line}" for line in comments([*notes, *PHYSICS])]
    short = wait.time / _SHORT
    lines += header(
        one,
        shortest(after or 0.0),
        shortest(short),
        (len(ids), 0),
        Waiting(2, contact, short, other, 1),
    )
    lines += to_rigid(ids, printing)
    lines += header(
        other,
        "0.0",
        "0.0",
        (0, len(ids)),
        Waiting(4, contact, wait.time, one, -1, offset=offset),
    )
    lines += to_deformable(ids)
    text = "\n".join(lines) + "\n"
    return First(PrintedCard(text, (), {"switches.k": text}), wait, notes)


def _offset(inventory: Inventory, keyword: str) -> tuple[float, str]:
    """Give how far apart the surfaces of a contact are when the parts become deformable again [length], and say so."""
    sections = [part.section for part in inventory.parts.values()]
    thickest = max((one.thickness for one in sections if one.thickness), default=0.0)
    if keyword.startswith("CONTACT_AUTOMATIC_") and thickest > 0:
        offset = float(shortest(_CLEAR * thickest))
        return (
            offset,
            f"OFFSET {offset:g}: the parts are deformable before the contact, {_CLEAR} shell thicknesses from it.",
        )
    return (
        0.0,
        "OFFSET 0: the parts become deformable in the contact; only automatic contacts of shells have a margin.",
    )
