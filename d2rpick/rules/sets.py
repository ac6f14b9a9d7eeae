"""D2R004-010, D2R012, D2R208: switch sets among each other, and switches by the force of a contact or rigid wall."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Final, Literal

from d2rpick.base.errors import listing
from d2rpick.deck.force_switching import find_delay_without_chatter
from d2rpick.deck.ls_dyna_parts import Entities, read_entities
from d2rpick.deck.switching import BY_SENSOR, BY_TIME, Header, SwitchSet, Unit
from d2rpick.rules.base import BOTH, ERROR, WARNING, Case, Objection
from d2rpick.rules.rule import (
    BACK,
    PASS,
    THERE,
    Example,
    automatic,
    deck,
    fails,
    passes,
    rule,
)

if TYPE_CHECKING:
    from collections.abc import Iterator

    from d2rpick.deck.card import Card


_OF_WALL: Final = {1, 3}
_OF_CONTACT: Final = {2, 4}
_FAMILIES: Final = (_OF_WALL, _OF_CONTACT)
_WITHOUT_FORCE, _WITH_FORCE = {1, 2}, {3, 4}


def _pair(
    codes: tuple[int, int], signs: tuple[int, int] = (1, -1), back: int = 1
) -> Example:
    there = automatic(1, "0.0", rigid=["1"], code=codes[0], pair=(2, signs[0]))
    again = automatic(2, "0.0", deformable=["1"], code=codes[1], pair=(back, signs[1]))
    return deck(there + again)


_ENTITIES: Final[tuple[tuple[set[int], str, Literal["CONTACT", "RIGIDWALL"]], ...]] = (
    (_OF_CONTACT, "contact", "CONTACT"), (_OF_WALL, "rigid wall", "RIGIDWALL"),
)  # fmt: skip
_MOST_LISTED = 8


def _force(code: int, entno: int, time3: str = "1.0e-3", contact: str = "") -> Example:
    card = automatic(1, "0.0", rigid=["1"], code=code)
    old = f"{'0.0':>10s}{'0.0':>10s}{'0.0':>10s}{0:10d}"
    assert old in card
    card = card.replace(old, f"{'0.0':>10s}{'0.0':>10s}{time3:>10s}{entno:10d}", 1)
    return deck(contact + card)


def _contact(name: str, number: int = 7) -> str:
    zeros = f"{0:10d}" * 8 + "\n"
    return f"*CONTACT_AUTOMATIC_{name}_ID\n{number:10d}floor\n" + 3 * zeros


_FLOOR: Final = _contact("SURFACE_TO_SURFACE")
_BY_ORDER: Final = "*CONTACT_NODES_TO_SURFACE\n" + 3 * ("         0" * 8 + "\n")
_WALL: Final = (
    "*RIGIDWALL_PLANAR_ID\n         3ground\n         0         0         0\n       "
    "0.0       0.0       0.0\n"
)


_with_floor = partial(_force, contact=_FLOOR)


@fails(deck(THERE + automatic(1, "0.09", deformable=["1"])))
@rule("D2R004", ERROR, "SWSET used twice")
def _unique(case: Case) -> Iterator[Objection]:
    """Every *DEFORMABLE_TO_RIGID_AUTOMATIC is a switch set with an id of its own; RELSW refers to it."""
    first: dict[int, Header] = {}
    for _, header in case.headers:
        if header.swset.problem:
            continue
        known = first.setdefault(header.swset.value, header)
        if known is not header:
            found = (
                f"SWSET {header.swset.value} is already used at {known.swset.field.at}"
            )
            yield header.swset.field, f"{found}; give every set its own id"


@passes(_pair((2, 4)), _pair((1, 3)))
@fails(_pair((2, 4), back=7), _pair((2, 4), signs=(1, 1)), _pair((1, 4)))
@rule(
    "D2R005",
    ERROR,
    "RELSW/PAIRED not mutual, not of opposite sign, or CODEs of different families",
)
def _mutual(case: Case) -> Iterator[Objection]:
    """Paired sets alternate as a contact or wall force comes and goes: each names the other in RELSW, PAIRED is 1
    for the one that acts first and -1 for the other, and their CODEs are 1 and 3 (wall) or 2 and 4 (contact). Sets,
    paired or not, that are rigid under force (CODE 3 or 4 on the D2R side, 1 or 2 on the other) are the wrong way
    round, rigid during the impact and deformable in flight. Source: vendor keyword data for the codes; a public
    drop tool wrote decks with 2 and 4 exchanged for months.
    """
    by_id = {header.swset.value: header for _, header in reversed(case.headers)}
    for _, header in case.headers:
        problem = _alone(header)
        partner = by_id.get(header.relsw.value)
        if (
            not problem
            and header.relsw.value
            and partner is None
            and not case.deck.unread
        ):
            problem = f"RELSW names set {header.relsw.value}, which no card defines"
        if not problem and header.relsw.value and partner is not None:
            first = (
                header.swset.value < partner.swset.value
            )  # what both share is said once, at one of them
            if partner.relsw.value != header.swset.value or partner is header:
                problem = f"RELSW names set {header.relsw.value}, which names set {partner.relsw.value}"
            elif first:
                problem = _mismatch(header, partner)
        if problem:
            yield (
                header.relsw.field,
                f"{problem}; check RELSW, PAIRED and CODE of both sets",
            )
    for header, problem in _swapped(case):
        yield header.code.field, f"{problem}; exchange the CODEs"


def _swapped(case: Case) -> Iterator[tuple[Header, str]]:
    """Sets that make the same parts rigid under a force and deformable without one, paired or not."""
    rigid = [
        (card, header)
        for card, header in case.headers
        if header.code.value in _WITH_FORCE
    ]
    back = [
        (card, header)
        for card, header in case.headers
        if header.code.value in _WITHOUT_FORCE
    ]
    for there, header in rigid:
        for again, other in back:
            family = {header.code.value, other.code.value} in _FAMILIES
            if family and _units(case, there, to_rigid=True) & _units(
                case, again, to_rigid=False
            ):
                ids = f"sets {header.swset.value} and {other.swset.value}"
                found = f"{ids} make parts rigid while there is a force and deformable while there is none"
                why = "rigid in the impact and deformable in flight: the CODEs seem to be swapped"
                yield header, f"{found}, {why}"
                break


def _units(case: Case, card: SwitchSet, *, to_rigid: bool) -> set[Unit]:
    return {
        event.unit
        for event in case.windows.events
        if event.by is card and event.line.to_rigid == to_rigid
    }


def _alone(header: Header) -> str:
    relsw, paired = header.relsw.value, header.paired.value
    if relsw and not paired:
        return f"RELSW names set {relsw} but PAIRED is 0"
    if paired and not relsw:
        return f"PAIRED is {paired} but RELSW names no set"
    return f"PAIRED is {paired}" if paired not in {-1, 0, 1} else ""


def _mismatch(one: Header, other: Header) -> str:
    """Say what is wrong with a mutual pair: signs, or families of CODEs."""
    ids = f"sets {one.swset.value} and {other.swset.value}"
    if one.paired.value == other.paired.value:
        return f"{ids} both have PAIRED {one.paired.value}"
    codes = [one.code.value, other.code.value]
    if any(codes) and not any(set(codes) <= family for family in _FAMILIES):
        return f"{ids} have CODE {codes[0]} and {codes[1]}, one of 1 and 3 or of 2 and 4 was expected"
    return ""


@passes(PASS, _pair((2, 4)))
@fails(deck(automatic(1, "0.02", rigid=["1"], pair=(2, 1)) + BACK))
@rule("D2R006", WARNING, "PAIRED together with CODE 0")
def _timed_pair(case: Case) -> Iterator[Objection]:
    """For one window by time two unpaired sets are enough."""
    for _, header in case.headers:
        if (
            header.paired.value
            and header.code.value == BY_TIME
            and not header.code.problem
        ):
            found = f"PAIRED is {header.paired.value} with CODE 0; a pair alternates by force"
            yield (
                header.paired.field,
                f"{found}, a switch by time needs none: set PAIRED and RELSW to 0",
            )


def _by_force(case: Case, codes: set[int]) -> Iterator[Header]:
    for _, header in case.headers:
        if (
            not header.code.problem
            and not header.entno.problem
            and header.code.value in codes
        ):
            yield header


@passes(
    _with_floor(4, 7),
    _force(4, 1, contact=_BY_ORDER),
    _force(3, 3, contact=_WALL),
    Example(THERE + BACK),
)
@fails(
    _with_floor(4, 8),
    _force(4, 7),
    _force(3, 4, contact=_WALL),
    _force(2, 2, contact=_BY_ORDER),
)
@rule("D2R007", ERROR, "ENTNO names no contact or rigid wall of the deck")
def _there(case: Case) -> Iterator[Objection]:
    """CODE 2 and 4 wait for the force of contact ENTNO, 1 and 3 for that of a rigid wall. One that does not exist
    never has a force. ENTNO is the id of *CONTACT_..._ID; without ids the order of definition counts (from memory of
    the manual, not confirmed). Judged only when all of the deck could be read and it has parts. Source: vendor
    keyword data.
    """
    for codes, what, keyword in _ENTITIES:
        headers = [header for header in _by_force(case, codes) if header.entno.value]
        entities = read_entities(case.deck, keyword) if headers else None
        if entities is None or not (entities.all_known and case.whole):
            continue
        for header in headers:
            if entities.named(header.entno.value) is None:
                number = f"ENTNO is {header.entno.value}, but"
                if entities.found:
                    found = f"{number} no {what} has this number: the deck has {_listed(entities)}"
                    yield (
                        header.entno.field,
                        f"{found}; the switch never comes: give the number of one of them",
                    )
                else:
                    yield (
                        header.entno.field,
                        f"{number} the deck has no {what}, so the switch never comes; add one",
                    )


@passes(
    _with_floor(4, 7),
    _force(2, 1, contact=_BY_ORDER),
    _force(3, 7, contact=_contact("GENERAL") + _WALL),
)
@fails(
    _force(4, 7, contact=_contact("GENERAL")),
    _force(2, 7, contact=_contact("SINGLE_SURFACE")),
)
@rule("D2R008", ERROR, "ENTNO names a contact whose force cannot trigger a switch")
def _able(case: Case) -> Iterator[Objection]:
    """Only surface-to-surface and nodes-to-surface contacts switch parts by their force; one of type GENERAL or
    SINGLE_SURFACE never does, so the part stays as it is, silently. Source: Vol I, Remark 1, as quoted by a public
    drop tool, and the vendor's help on OFFSET, which names the same types; not tried with the solver.
    """
    headers = [header for header in _by_force(case, _OF_CONTACT) if header.entno.value]
    entities = read_entities(case.deck, "CONTACT") if headers else None
    for header in headers:
        named = entities.named(header.entno.value) if entities else None
        if named and entities and not named.triggers:
            others = [one for one in entities.found if one.triggers]
            able = (
                f" (here: {_listed(entities._replace(found=tuple(others)))})"
                if others
                else ""
            )
            found = f"ENTNO {header.entno.value} is *{named.keyword}, whose force triggers no switch"
            yield (
                header.entno.field,
                f"{found}; choose a surface-to-surface or nodes-to-surface contact{able}",
            )


def _listed(entities: Entities) -> str:
    texts = [
        f"{one.id or one.number} (*{one.keyword}{f' {one.title!r}' if one.title else ''})"
        for one in entities.found
    ]
    return listing(texts, most=_MOST_LISTED)


_CONTROL: Final = "*SENSOR_CONTROL\n         5   DEF2RIG{:10d}        ON\n         3\n"


def _sensed(control: str) -> Example:
    return deck(control + automatic(20, "0.0", rigid=["1"], code=BY_SENSOR))


@passes(
    PASS,
    _sensed(_CONTROL.format(20)),
    _sensed("*SENSOR_CONTROL_TITLE\nby force\n" + _CONTROL.format(20)[16:]),
)
@fails(
    _sensed(""),
    _sensed(_CONTROL.format(21)),
    _sensed(_CONTROL.format(20).replace("DEF2RIG", " AIRBAG")),
)
@rule("D2R012", ERROR, "CODE 5 without a *SENSOR_CONTROL that switches the set")
def _uncontrolled(case: Case) -> Iterator[Objection]:
    """A set with CODE 5 is switched by a *SENSOR_CONTROL with TYPE DEF2RIG whose TYPEID is its SWSET. Without one it
    never switches. Judged only when all of the deck could be read and it has parts. D2R302 says when the sensor
    switches. Source: vendor keyword data.
    """
    if not case.whole:
        return
    controlled = {
        number
        for card in case.deck.named("SENSOR_CONTROL")
        for number in _controlled(card)
    }
    for _, header in case.headers:
        if (
            header.code.value == BY_SENSOR
            and not header.code.problem
            and header.swset.value not in controlled
        ):
            found = f"no *SENSOR_CONTROL of type DEF2RIG has TYPEID {header.swset.value}, so set {header.swset.value}"
            yield (
                header.code.field,
                f"{found} never switches; add one, or choose another CODE",
            )


def _controlled(card: Card) -> Iterator[int]:
    """Switch sets that a *SENSOR_CONTROL switches."""
    for row in card.data[:1]:
        if card.word(row, 1).value == "DEF2RIG":
            yield card.integer(row, 2).value + card.transform.rest


def _delayed(wait: str) -> Example:
    """Write a pair of sets, of which the one that makes parts deformable waits before the other may act again."""
    there = automatic(1, "0.0", rigid=["1"], code=2, pair=(2, 1))
    again = automatic(2, "0.0", deformable=["1"], code=4, pair=(1, -1))
    old = f"{'0.0':>10s}{'0.0':>10s}{'0.0':>10s}"
    return deck(there + again.replace(old, f"{'0.0':>10s}{'0.0':>10s}{wait:>10s}", 1))


@passes(PASS, _with_floor(4, 7), _delayed("0.01"))
@fails(_with_floor(4, 7, "0.0"), _with_floor(2, 7, "0.0"), _delayed("0.0"))
@rule("D2R009", WARNING, "TIME3 is 0 with a contact CODE")
def _delay(case: Case) -> Iterator[Objection]:
    """TIME3 is how long after a switch no other one of the set is made. With 0 the next step may switch back: the
    force of a contact is zero and not zero many times in one impact, and the parts chatter. Of a pair one set has to
    wait. Source: vendor keyword data for the meaning; a public drop tool reports the chatter.
    """
    waiting = {
        header.swset.value for _, header in case.headers if header.time3.value > 0
    }
    for header in _by_force(case, _OF_CONTACT):
        if (
            not header.time3.problem
            and header.time3.value == 0
            and header.relsw.value not in waiting
        ):
            found = f"TIME3 is 0 with CODE {header.code.value}: the parts may switch back and forth in every contact"
            yield (
                header.time3.field,
                f"{found}; set it to a time in which the contact settles",
            )


@passes(PASS, _with_floor(4, 7))
@fails(_with_floor(4, 0), _force(3, 0))
@rule("D2R010", ERROR, "CODE 3 or 4 without a contact or rigid wall (ENTNO 0)")
def _unnamed(case: Case) -> Iterator[Objection]:
    """The switch waits for a force that is not zero. Without the number of the contact or rigid wall there is no
    force to wait for. Source: vendor keyword data; what the solver does with 0 is not confirmed.
    """
    for header in _by_force(case, _WITH_FORCE):
        if header.entno.value == 0:
            what = "a contact" if header.code.value in _OF_CONTACT else "a rigid wall"
            found = f"ENTNO is 0 with CODE {header.code.value}, which waits for the force of {what}"
            yield header.entno.field, f"{found}; give its number"


# A box that lands on its edge, and rattles.
_LANDING: Final = "--drop 0.2 --tilt 20 --mesh 4 --ground-stiffness 2e6 --t-end 0.7 --dt 5e-4 --write-as matsum"


def _landed(wait: str) -> Example:
    landed = _delayed(wait).deck.replace("       0.2", "       0.7", 1)  # ENDTIM
    return Example(landed, history=_LANDING, computed_by="rollover")


@passes(PASS, _landed("0.07"))
@fails(_landed("0.0"))
@rule("D2R208", WARNING, "a switch by force that chatters in the history", BOTH)
def _chatters(case: Case) -> Iterator[Objection]:
    """A force comes and goes many times in one impact. If the history has the force of the contact or wall, or if it
    has the momenta of the parts and the deck has one contact or wall, d2rpick follows the switches: windows below a
    tenth of the longest are no flight. A TIME3 of the set that makes the parts deformable (Radioss: Tdelay of the
    sensor) that lasts longer than the contact keeps them out. A force that comes and goes within one interval of the
    history is not seen.
    """
    for one in case.by_condition:
        short = len(one.times) - len(one.lasting)
        if short:
            wait = one.contacts and find_delay_without_chatter(
                one.lasting, one.contacts
            )
            cure = (
                f"; {wait:.3g} or more as {one.wait} leaves {len(one.lasting)}"
                if wait
                else ""
            )
            found = (
                f"{one.switches} switches by the history, in {len(one.times)} windows"
            )
            yield (
                one.place.here,
                f"{found}, {short} of which are below a tenth of the longest{cure}",
            )
