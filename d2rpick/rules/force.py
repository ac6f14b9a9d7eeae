"""D2R007-010: switches by the force of a contact or rigid wall."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Final

from d2rpick.deck.constraints import read_contacts, read_rigid_walls
from d2rpick.errors import listing
from d2rpick.rules.base import Example, Rule, Severity
from d2rpick.rules.example_decks import BACK, END, GOOD, HEAD, PARTS, THERE, automatic

if TYPE_CHECKING:
    from collections.abc import Iterator

    from d2rpick.deck.constraints import Entities, Entity
    from d2rpick.deck.switching import Header
from d2rpick.rules.base import Case, Objection

_OF_WALL: Final = {1, 3}
_OF_CONTACT: Final = {2, 4}
_NEEDS_FORCE: Final = {3, 4}
_ABLE: Final = ("SURFACE_TO_SURFACE", "NODES_TO_SURFACE", "NODE_TO_SURFACE")  # in the names of contacts that trigger
_MOST_LISTED = 8


def _by_force(case: Case, codes: set[int]) -> Iterator[Header]:
    for card in case.sets:
        header = card.header
        if header and not header.code.problem and not header.entno.problem and header.code.value in codes:
            yield header


def _there(case: Case) -> Iterator[Objection]:
    for codes, what, read in ((_OF_CONTACT, "contact", read_contacts), (_OF_WALL, "rigid wall", read_rigid_walls)):
        headers = [header for header in _by_force(case, codes) if header.entno.value]
        entities = read(case.deck) if headers else None
        if entities is None or not (entities.all_known and case.parts.all_known and case.parts.materials):
            continue  # a file with nothing but cards is for another deck to include
        for header in headers:
            if entities.named(header.entno.value) is None:
                there = f"has {_listed(entities)}" if entities.found else "has none"
                found = f"ENTNO is {header.entno.value}, but no {what} has this number: the deck {there}"
                yield header.entno.field, f"{found}; the switch never comes: give the number of one of them"


def _able(case: Case) -> Iterator[Objection]:
    headers = [header for header in _by_force(case, _OF_CONTACT) if header.entno.value]
    entities = read_contacts(case.deck) if headers else None
    for header in headers:
        named = entities.named(header.entno.value) if entities else None
        if named and entities and not _triggers(named):
            others = [one for one in entities.found if _triggers(one)]
            able = f" (here: {_listed(entities._replace(found=tuple(others)))})" if others else ""
            found = f"ENTNO {header.entno.value} is *{named.keyword}, whose force triggers no switch"
            yield header.entno.field, f"{found}; choose a surface-to-surface or nodes-to-surface contact{able}"


def _triggers(contact: Entity) -> bool:
    return any(name in contact.keyword for name in _ABLE)


def _listed(entities: Entities) -> str:
    texts = [
        f"{one.id or one.number} (*{one.keyword}{f' {one.title!r}' if one.title else ''})" for one in entities.found
    ]
    return listing(texts, most=_MOST_LISTED)


def _delay(case: Case) -> Iterator[Objection]:
    for header in _by_force(case, _OF_CONTACT):
        if not header.time3.problem and header.time3.value == 0:
            yield (
                header.time3.field,
                (
                    f"TIME3 is 0 with CODE {header.code.value}: the parts may switch back and forth in every contact; "
                    "set it to a time in which the contact settles"
                ),
            )


def _unnamed(case: Case) -> Iterator[Objection]:
    for header in _by_force(case, _NEEDS_FORCE):
        if header.entno.value == 0:
            what = "a contact" if header.code.value in _OF_CONTACT else "a rigid wall"
            yield (
                header.entno.field,
                f"ENTNO is 0 with CODE {header.code.value}, which waits for the force of {what}; give its number",
            )


def _force(code: int, entno: int, time3: str = "1.0e-3", contact: str = "") -> Example:
    card = automatic(1, "0.0", rigid=["1"], code=code)
    old = f"{'0.0':>10s}{'0.0':>10s}{'0.0':>10s}{0:10d}"
    assert old in card
    card = card.replace(old, f"{'0.0':>10s}{'0.0':>10s}{time3:>10s}{entno:10d}", 1)
    return Example(HEAD + PARTS + contact + card + END)


def _contact(name: str, number: int = 7) -> str:
    zeros = f"{0:10d}" * 8 + "\n"
    return f"*CONTACT_AUTOMATIC_{name}_ID\n{number:10d}floor\n" + 3 * zeros


_FLOOR: Final = _contact("SURFACE_TO_SURFACE")
_BY_ORDER: Final = "*CONTACT_NODES_TO_SURFACE\n" + 3 * ("         0" * 8 + "\n")
_WALL: Final = (
    "*RIGIDWALL_PLANAR_ID\n         3ground\n         0         0         0\n       0.0       0.0       0.0\n"
)
_with_floor = partial(_force, contact=_FLOOR)

RULES: Final = (
    Rule(
        "D2R007",
        Severity.ERROR,
        "ENTNO names no contact or rigid wall of the deck",
        "CODE 2 and 4 wait for the force of contact ENTNO, 1 and 3 for that of a rigid wall. One that does not exist "
        "never has a force. ENTNO is the id of *CONTACT_..._ID; without ids the order of definition counts (from "
        "memory of the manual, not confirmed). Judged only when all of the deck could be read and it has parts. "
        "Source: vendor keyword data.",
        _there,
        (_with_floor(4, 7), _force(4, 1, contact=_BY_ORDER), _force(3, 3, contact=_WALL), Example(THERE + BACK)),
        (_with_floor(4, 8), _force(4, 7), _force(3, 4, contact=_WALL), _force(2, 2, contact=_BY_ORDER)),
    ),
    Rule(
        "D2R008",
        Severity.ERROR,
        "ENTNO names a contact whose force cannot trigger a switch",
        "Only surface-to-surface and nodes-to-surface contacts switch parts by their force; one of type GENERAL or "
        "SINGLE_SURFACE never does, so the part stays as it is, silently. Source: Vol I, Remark 1, as quoted by a "
        "public drop tool, and the vendor's help on OFFSET, which names the same types; not tried with the solver.",
        _able,
        (_with_floor(4, 7), _force(2, 1, contact=_BY_ORDER), _force(3, 7, contact=_contact("GENERAL") + _WALL)),
        (_force(4, 7, contact=_contact("GENERAL")), _force(2, 7, contact=_contact("SINGLE_SURFACE"))),
    ),
    Rule(
        "D2R009",
        Severity.WARNING,
        "TIME3 is 0 with a contact CODE",
        "TIME3 is how long after a switch no other one of the set is made. With 0 the next step may switch back: the "
        "force of a contact is zero and not zero many times in one impact, and the parts chatter. Source: vendor "
        "keyword data for the meaning; a public drop tool reports the chatter.",
        _delay,
        (Example(GOOD), _with_floor(4, 7)),
        (_with_floor(4, 7, "0.0"), _with_floor(2, 7, "0.0")),
    ),
    Rule(
        "D2R010",
        Severity.ERROR,
        "CODE 3 or 4 without a contact or rigid wall (ENTNO 0)",
        "The switch waits for a force that is not zero. Without the number of the contact or rigid wall there is no "
        "force to wait for. Source: vendor keyword data; what the solver does with 0 is not confirmed.",
        _unnamed,
        (Example(GOOD), _with_floor(4, 7)),
        (_with_floor(4, 0), _force(3, 0)),
    ),
)
