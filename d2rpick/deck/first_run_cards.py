"""Print the cards of a first run in which the solver detects flights from contact forces, and then switches the parts.

For Radioss, sensors end the engine runs with /STOP/LSENSOR (tested with OpenRadioss; docs/reference/first-run.md). For
LS-DYNA, there is a pair of switch sets with CODE 2 (no contact force) and 4 (contact force), according to published
keyword data; this was not tested.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final, NamedTuple

from d2rpick.base.errors import DeckError, RangeError
from d2rpick.deck.engine_files import EngineFile, write_engine_lines
from d2rpick.deck.ls_dyna_parts import read_entities
from d2rpick.deck.printed_card import (
    PHYSICS,
    PrintedCard,
    Printing,
    check_ids,
    write_comments,
    write_number,
)
from d2rpick.deck.radioss_bodies import find_bodies
from d2rpick.deck.radioss_deck import find_bodies_kept_off
from d2rpick.deck.radioss_run import read_run
from d2rpick.deck.radioss_sensors import require_forces
from d2rpick.deck.reader import read_deck
from d2rpick.deck.sensor_cards import write_flight_sensors
from d2rpick.deck.suiting import find_suiting
from d2rpick.deck.switch_sets import Waiting, write_joint_remarks, write_set_pair

if TYPE_CHECKING:
    from collections.abc import Sequence

    from d2rpick.deck.model import Inventory
    from d2rpick.deck.reader import Deck

# Number of engine files in which the OpenRadioss starter reads /RBODY/OFF.
_MOST_LEGS: Final = 9
# Ratio of the force-free time after which a flight is detected to the largest time step of rigid parts [-].
# With this time-step limit, a contact is detected at most one time step late.
_STEPS_PER_WAIT: Final = 300
# Ratio of the required force-free time to the time for which LS-DYNA ignores contacts after a switch [-].
_DELAYS_PER_WAIT: Final = 100
# Radioss keywords of loads that are not contact forces.
_LOADS: Final = ("CLOAD", "PLOAD", "MONVOL", "LOAD", "PRELOAD", "LASER", "PFLUID")
_UNSEEN: Final = "acts without a contact, so contacts do not show the flight"
_OF_ALL: Final = (
    "A first run: without a reference run the energy at td is unknown, so tr is not matched to it.",
    "Only contact forces are monitored: apart from gravity, nothing else may act on the parts.",
)
_RIGID_FROM_START: Final = "The parts fall freely from rest, so they are rigid from 0."
_OF_RADIOSS: Final = (
    "Each deformable engine run ends when no contact has had a force for the force-free time.",
    "No window keeps a margin: each rigid engine run ends at most {cap:g} after a contact begins.",
    "A contact of the parts with each other counts too: while it has a force, they do not fly.",
    "Engine runs after the end of the run take one step.",
)
_OF_WALLS: Final = (
    "A rigid body that meets a rigid wall in the last step of its engine run is stopped in that step: in a test it had"
    " a momentum of 511 afterwards, a deformable body 365. d2rpick drive keeps a margin before the wall."
)
_OF_LS_DYNA: Final = (
    "CODE 2 has no force-free time: after TIME1 and TIME3, zero force makes parts rigid, even between two pulses.",
    "These switches do not react to other contacts, rigid walls and loads.",
    "These cards were not tested with the solver.",
)
_DELETED: Final = (
    "Constraints that all lie on these parts are deleted while the parts are rigid (NRBF or NCSF 1), and then activated"
    " again (2)."
)
_AT_REST: Final = "The parts fall freely from rest, so they are rigid from 0 (TIME1 0)."
_OF_LOAD: Final = "TIME1 is 0: if you know the end of the load, give it (--after)."
_WITHOUT_OFFSET: Final = (
    "OFFSET 0: the parts become deformable in the contact; only automatic contacts of shells"
    " have a margin."
)
# _PUSHES: prefixes of the LS-DYNA keywords for loads that are not contact forces.
# _OF_GRAVITY: prefixes of the LS-DYNA keywords that define gravity.
_PUSHES, _OF_GRAVITY = ("LOAD_", "AIRBAG_"), ("LOAD_BODY", "LOAD_GRAVITY")
# LS-DYNA makes the parts deformable once the gap before a contact is this multiple of the largest shell thickness [-].
# The gap must exceed the contact thickness, i.e. half the thickness of each of the two shells.
_OFFSET_THICKNESSES: Final = 2


class FirstRunDeck(NamedTuple):
    """A deck whose first run is to switch parts, and when it switches them.

    Attributes
    ----------
    path : str
        Main deck of LS-DYNA, or a file of a Radioss run with one engine file.
    inventory : Inventory
        The inventory of this deck.
    parts : sequence of int
        Parts to be switched.
    wait : float
        Force-free time after which a flight is detected [time].
    reason : str
        Text that states where this time comes from.
    after : float or None
        No part becomes rigid before this time [time].
    """

    path: str
    inventory: Inventory
    parts: Sequence[int]
    wait: float
    reason: str
    after: float | None

    def explain_wait(self) -> str:
        """Return the note that states what the waiting time means for the solver of the deck, and where it is from."""
        if self.inventory.solver == "ls-dyna":
            meaning = "After each switch to deformable, the parts stay deformable for at least"
        else:
            meaning = "A flight is detected when no force has acted for"
        return f"{meaning} {self.wait:.4g} ({self.reason})."

    def falls_from_rest(self, *, starts_moving: bool) -> bool:
        """Return True if gravity acts and the parts do not start moving, so that they may be rigid from the start."""
        has_gravity = bool(self.inventory.boundary.gravity)
        return self.after is None and has_gravity and not starts_moving


def print_first_run_cards(first_run: FirstRunDeck) -> PrintedCard:
    """Print the cards with which the first run of a deck switches its parts after the given force-free time.

    Returns
    -------
    PrintedCard
        The cards with notes for the user.

    Raises
    ------
    DeckError
        If the deck has no contact that shows a flight, or if other loads than contacts and gravity act on the parts.
    """
    if first_run.inventory.solver == "radioss":
        return _print_radioss_cards(first_run)
    return _print_ls_dyna_cards(first_run)


# The functions below write the cards for Radioss.


def _print_radioss_cards(first_run: FirstRunDeck) -> PrintedCard:
    """Print the engine files and sensors of a Radioss run; raise DeckError if the deck has no contact or rigid wall."""
    path, wait = first_run.path, first_run.wait
    run = read_run(path)
    bodies = find_bodies(path, first_run.parts)
    if run.starter is None or len(run.legs) != 1:
        count = len(run.legs)
        found = f"{count} engine files" if run.starter else "no starter deck"
        raise DeckError(
            f"{path}: the run has {found}, but a starter deck and 1 engine file were expected; give the deck of a run "
            "without restart segments, in a folder of its own"
        )
    for load in run.starter.named(*_LOADS):
        raise DeckError(f"{load.at}: /{load.name} {_UNSEEN}")
    contacts = require_forces(path, run.starter)
    (leg,) = run.legs
    _check_wait_against_end(path, wait, leg.stop.value)
    starts_moving = bool(run.starter.named("INIVEL") or leg.starts)
    at_rest = first_run.falls_from_rest(starts_moving=starts_moving)
    first_switch = max(first_run.after or 0.0, wait)
    sensors, contact, flight = write_flight_sensors(
        contacts, wait, first_switch, bodies.sensor
    )
    largest_step = float(f"{wait / _STEPS_PER_WAIT:.2g}")
    other_nodes = [
        node for node in find_bodies_kept_off(run.legs) if node not in bodies.nodes
    ]
    files = {}
    # The engine runs are alternately deformable and rigid. The first one is rigid if the parts fall from rest.
    for number in range(1, _MOST_LEGS + 1 - at_rest):
        rigid = number % 2 == at_rest
        file = EngineFile(number, leg.stop.value, largest_step if rigid else None)
        lines = [*write_engine_lines(file, leg.name, bodies.nodes, other_nodes)]
        if number < _MOST_LEGS - at_rest:
            lines += ["/STOP/LSENSOR", str(contact if rigid else flight), "0 0 0 0 0 0"]
        files[f"{leg.name}_{number:04d}.rad"] = "\n".join(lines) + "\n"
    of_radioss = [note.format(cap=largest_step) for note in _OF_RADIOSS]
    notes = [first_run.explain_wait(), *bodies.notes, *_OF_ALL, *of_radioss]
    if at_rest:
        notes.insert(0, _RIGID_FROM_START)
    if run.starter.named("RWALL"):
        notes.append(_OF_WALLS)
    head = "".join(f"# {line}\n" for line in write_comments([*notes, *PHYSICS]))
    return PrintedCard(head, (), files, tuple(notes), bodies.cards + sensors)


def _check_wait_against_end(path: str, wait: float, end: float) -> None:
    """Raise RangeError if the run ends before the force-free time has passed, so that no flight can be detected."""
    if wait < end:
        return
    raise RangeError(
        f"{path}: `wait` {wait:g} is not shorter than the run, which ends at {end:g}; give a shorter time, in the unit "
        "of the deck"
    )


# The functions below write the cards for LS-DYNA.


def _print_ls_dyna_cards(first_run: FirstRunDeck) -> PrintedCard:
    """Print the switch sets of an LS-DYNA run; raise DeckError unless exactly one contact can trigger the switches."""
    path, wait, after = first_run.path, first_run.wait, first_run.after
    deck = read_deck(path)
    contact, keyword = _find_contact(path, deck)
    part_ids = check_ids(first_run.parts)
    bodies = first_run.inventory.bodies(part_ids)
    suiting = find_suiting(path, part_ids, bodies)
    printing = Printing(
        part=tuple(part_ids),
        bodies=bodies,
        swset=suiting.swset or Printing().swset,
        delete_nodal_bodies=suiting.delete_nodal_bodies,
        delete_node_sets=suiting.delete_node_sets,
        parting=suiting.parting,
        kept_joints=suiting.kept_joints,
    )
    offset, offset_note = _choose_offset(first_run.inventory, keyword)
    notes = [first_run.explain_wait(), *_OF_ALL, *_OF_LS_DYNA, offset_note]
    if suiting.delete_nodal_bodies or suiting.delete_node_sets:
        notes.append(_DELETED)
    notes += write_joint_remarks(printing)
    if after is None:
        starts_moving = bool(deck.named("INITIAL_VELOCITY"))
        at_rest = first_run.falls_from_rest(starts_moving=starts_moving)
        notes.append(_AT_REST if at_rest else _OF_LOAD)
    delay = wait / _DELAYS_PER_WAIT
    lines = [f"$ {line}" for line in write_comments([*notes, *PHYSICS])]
    lines += write_set_pair(
        printing.swset,
        (write_number(after or 0.0), "0.0"),
        write_number(delay),
        part_ids,
        printing,
        waits=(
            Waiting(2, contact, delay),
            Waiting(4, contact, wait, offset=offset),
        ),
    )
    text = "\n".join(lines) + "\n"
    return PrintedCard(text, (), {"switches.k": text}, tuple(notes))


def _find_contact(path: str, deck: Deck) -> tuple[int, str]:
    """Return the id and keyword of the contact for which a switch can wait; raise DeckError if there is none."""
    for card in deck.cards:
        if card.name.startswith(_PUSHES) and not card.name.startswith(_OF_GRAVITY):
            raise DeckError(f"{card.at}: *{card.name} {_UNSEEN}")
    entities = read_entities(deck, "CONTACT")
    contacts = [contact for contact in entities.found if contact.triggers]
    if entities.all_known and len(contacts) == 1:
        return contacts[0].id or contacts[0].number, contacts[0].keyword
    count = len(contacts) if entities.all_known else "unknown"
    if count == 0:
        cure = "add one between the parts and what they hit, such as *CONTACT_AUTOMATIC_SURFACE_TO_SURFACE"
    else:
        cure = "keep one of them"
    raise DeckError(
        f"{path}: {count} contacts between surfaces, or of nodes with a surface; one was expected: a switch waits for"
        f" one, and single-surface contacts never trigger it; {cure}, or compute a reference run and"
        " choose the times from it (d2rpick plan)"
    )


def _choose_offset(inventory: Inventory, keyword: str) -> tuple[float, str]:
    """Return the gap between surfaces at which the parts are made deformable again [length], with a note."""
    thicknesses = [part.section.thickness for part in inventory.parts.values()]
    thickest = max((thickness or 0.0 for thickness in thicknesses), default=0.0)
    if not keyword.startswith("CONTACT_AUTOMATIC_") or thickest <= 0:
        return 0.0, _WITHOUT_OFFSET
    offset = float(write_number(_OFFSET_THICKNESSES * thickest))
    return offset, (
        f"OFFSET {offset:g}: the parts are deformable before the contact, "
        f"{_OFFSET_THICKNESSES} shell thicknesses from it."
    )
