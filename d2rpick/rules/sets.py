"""Define rules D2R004-010, D2R012 and D2R208: switch sets, their pairs, and switches by contact or wall force."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Final, Literal

from d2rpick.base.errors import list_names
from d2rpick.deck.ls_dyna_columns import SENSOR_CONTROL
from d2rpick.deck.ls_dyna_parts import Entities, read_entities
from d2rpick.deck.switching import BY_SENSOR, BY_TIME, SwitchHeader, SwitchSet, Unit
from d2rpick.rules.base import BOTH, ERROR, WARNING, Case, PlacedMessage
from d2rpick.rules.example import (
    Example,
    make_deck,
    write_automatic_card,
    write_contact,
)
from d2rpick.rules.rule import (
    BACK,
    PASS,
    THERE,
    make_rule_decorator,
    set_failing,
    set_passing,
)

if TYPE_CHECKING:
    from collections.abc import Iterator

    from d2rpick.deck.card import Card


_OF_WALL: Final = {1, 3}
_OF_CONTACT: Final = {2, 4}
_FAMILIES: Final = (_OF_WALL, _OF_CONTACT)
_WITHOUT_FORCE, _WITH_FORCE = {1, 2}, {3, 4}

_ENTITIES: Final[tuple[tuple[set[int], str, Literal["CONTACT", "RIGIDWALL"]], ...]] = (
    (_OF_CONTACT, "contact", "CONTACT"), (_OF_WALL, "rigid wall", "RIGIDWALL"),
)  # fmt: skip
_MOST_LISTED = 8
_BY_ORDER: Final = "*CONTACT_NODES_TO_SURFACE\n" + 3 * ("         0" * 8 + "\n")
_WALL: Final = (
    "*RIGIDWALL_PLANAR_ID\n         3ground\n         0         0         0\n       "
    "0.0       0.0       0.0\n"
)
_CONTROL: Final = "*SENSOR_CONTROL\n         5   DEF2RIG{:10d}        ON\n         3\n"
_FLOOR: Final = write_contact("SURFACE_TO_SURFACE")
# Arguments of `d2rpick rollover` for the history of a box that lands on its edge and rattles there.
_LANDING: Final = "--drop 0.2 --tilt 20 --mesh 4 --ground-stiffness 2e6 --t-end 0.7 --dt 5e-4 --write-as matsum"


def _make_paired_deck(
    codes: tuple[int, int], signs: tuple[int, int] = (1, -1), back: int = 1
) -> Example:
    rigid_card = write_automatic_card(
        1, "0.0", rigid=["1"], code=codes[0], pair=(2, signs[0])
    )
    back_card = write_automatic_card(
        2, "0.0", deformable=["1"], code=codes[1], pair=(back, signs[1])
    )
    return make_deck(rigid_card + back_card)


def _make_force_deck(
    code: int, entno: int, time3: str = "1.0e-3", contact: str = ""
) -> Example:
    card = write_automatic_card(
        1, "0.0", rigid=["1"], code=code, delay=time3, contact=entno
    )
    return make_deck(contact + card)


_with_floor = partial(_make_force_deck, contact=_FLOOR)


@set_failing(
    lambda: [make_deck(THERE + write_automatic_card(1, "0.09", deformable=["1"]))]
)
@make_rule_decorator("D2R004", ERROR, "a SWSET used twice")
def _check_unique_ids(case: Case) -> Iterator[PlacedMessage]:
    """Each *DEFORMABLE_TO_RIGID_AUTOMATIC is a switch set with its own id, to which RELSW refers.

    Fix: Give every switch set its own SWSET.
    """
    first: dict[int, SwitchHeader] = {}
    for _, header in case.headers:
        if header.swset.problem:
            continue
        first_header = first.setdefault(header.swset.value, header)
        if first_header is not header:
            problem = f"SWSET {header.swset.value} is already used at {first_header.swset.field.at}"
            yield header.swset.field, f"{problem}; give every switch set its own id"


@set_passing(lambda: [_make_paired_deck((2, 4)), _make_paired_deck((1, 3))])
@set_failing(
    lambda: [
        _make_paired_deck((2, 4), back=7),
        _make_paired_deck((2, 4), signs=(1, 1)),
        _make_paired_deck((1, 4)),
    ]
)
@make_rule_decorator(
    "D2R005",
    ERROR,
    "paired sets whose RELSW do not name each other, or whose PAIRED or CODE do not belong together",
)
def _check_pairs(case: Case) -> Iterator[PlacedMessage]:
    """Paired sets act in turn as a contact or wall force begins and ends. Each set names the other in RELSW. PAIRED is
    1 for the set that acts first and -1 for the other. Their CODEs are 1 and 3 (rigid wall) or 2 and 4 (contact). CODE
    3 or 4 on the D2R side, or CODE 1 or 2 on the R2D side, is wrong for every set, paired or not: the parts are rigid
    during the impact and deformable in flight. Source: vendor keyword data for the codes. For a long time, a public
    drop tool wrote decks in which CODE 2 and 4 were interchanged.

    Fix: Let RELSW of each set name the other and set PAIRED to 1 and -1. Use CODE 1 or 2 to make parts rigid, and CODE
    3 or 4 to make them deformable.
    """
    by_id = {header.swset.value: header for _, header in reversed(case.headers)}
    for _, header in case.headers:
        problem = _describe_lone_problem(header)
        partner = by_id.get(header.relsw.value)
        if (
            not problem
            and header.relsw.value
            and partner is None
            and not case.deck.unread
        ):
            problem = f"RELSW names set {header.relsw.value}, which no card defines"
        if not problem and header.relsw.value and partner is not None:
            # A problem of two sets is reported at only one of them.
            first = header.swset.value < partner.swset.value
            if partner.relsw.value != header.swset.value or partner is header:
                problem = f"RELSW names set {header.relsw.value}, which names set {partner.relsw.value}"
            elif first:
                problem = _describe_mismatch(header, partner)
        if problem:
            yield (
                header.relsw.field,
                f"{problem}; check RELSW, PAIRED and CODE of both sets",
            )
    for header, problem in _find_swapped(case):
        yield header.code.field, f"{problem}; exchange the CODEs"


def _find_swapped(case: Case) -> Iterator[tuple[SwitchHeader, str]]:
    """Yield each set that makes parts rigid while a force acts, if another set releases them when no force acts."""
    rigid_sets = [
        (card, header)
        for card, header in case.headers
        if header.code.value in _WITH_FORCE
    ]
    back_sets = [
        (card, header)
        for card, header in case.headers
        if header.code.value in _WITHOUT_FORCE
    ]
    for rigid_card, header in rigid_sets:
        for back_card, back_header in back_sets:
            family = {header.code.value, back_header.code.value} in _FAMILIES
            if family and _find_units(case, rigid_card, to_rigid=True) & _find_units(
                case, back_card, to_rigid=False
            ):
                ids = f"sets {header.swset.value} and {back_header.swset.value}"
                problem = f"{ids} make parts rigid while there is a force and deformable while there is none"
                why = "so they are rigid in the impact and deformable in flight"
                yield header, f"{problem}, {why}"
                break


def _find_units(case: Case, card: SwitchSet, *, to_rigid: bool) -> set[Unit]:
    """Return the parts, or sets of unknown parts, that a card makes rigid (``to_rigid``) or deformable."""
    return {
        event.unit
        for event in case.windows.events
        if event.by is card and event.line.to_rigid == to_rigid
    }


def _describe_lone_problem(header: SwitchHeader) -> str:
    """Describe what is wrong with RELSW and PAIRED in one header; empty if both are right."""
    relsw = header.relsw.value
    paired = header.paired.value
    if relsw and not paired:
        return f"RELSW names set {relsw} but PAIRED is 0"
    if paired and not relsw:
        return f"PAIRED is {paired} but RELSW names no set"
    return f"PAIRED is {paired}" if paired not in {-1, 0, 1} else ""


def _describe_mismatch(first: SwitchHeader, second: SwitchHeader) -> str:
    """Describe what is wrong with PAIRED or CODE in two sets that refer to each other; empty if both are right."""
    ids = f"sets {first.swset.value} and {second.swset.value}"
    if first.paired.value == second.paired.value:
        return f"{ids} both have PAIRED {first.paired.value}"
    codes = [first.code.value, second.code.value]
    if any(codes) and not any(set(codes) <= family for family in _FAMILIES):
        return (
            f"{ids} have CODE {codes[0]} and {codes[1]}, expected 1 and 3, or 2 and 4"
        )
    return ""


@set_passing(lambda: [PASS, _make_paired_deck((2, 4))])
@set_failing(
    lambda: [
        make_deck(write_automatic_card(1, "0.02", rigid=["1"], pair=(2, 1)) + BACK)
    ]
)
@make_rule_decorator("D2R006", WARNING, "PAIRED together with CODE 0")
def _check_timed_pairs(case: Case) -> Iterator[PlacedMessage]:
    """Two paired switch sets act alternately, triggered by a force. A window defined by times (CODE 0) needs only two
    unpaired sets.

    Fix: Set PAIRED and RELSW to 0.
    """
    for _, header in case.headers:
        if (
            header.paired.value
            and header.code.value == BY_TIME
            and not header.code.problem
        ):
            problem = f"PAIRED is {header.paired.value} with CODE 0, but only sets that switch by a force are paired"
            yield (
                header.paired.field,
                f"{problem}; set PAIRED and RELSW to 0",
            )


def _find_force_headers(case: Case, codes: set[int]) -> Iterator[SwitchHeader]:
    """Yield the readable headers whose CODE is one of the given ones."""
    for _, header in case.headers:
        if (
            not header.code.problem
            and not header.entno.problem
            and header.code.value in codes
        ):
            yield header


@set_passing(
    lambda: [
        _with_floor(4, 7),
        _make_force_deck(4, 1, contact=_BY_ORDER),
        _make_force_deck(3, 3, contact=_WALL),
        Example(THERE + BACK),
    ]
)
@set_failing(
    lambda: [
        _with_floor(4, 8),
        _make_force_deck(4, 7),
        _make_force_deck(3, 4, contact=_WALL),
        _make_force_deck(2, 2, contact=_BY_ORDER),
    ]
)
@make_rule_decorator(
    "D2R007", ERROR, "an ENTNO that names no contact or rigid wall of the deck"
)
def _check_entity_exists(case: Case) -> Iterator[PlacedMessage]:
    """CODE 2 and 4 wait for the force of contact ENTNO, and CODE 1 and 3 wait for the force of rigid wall ENTNO. A
    contact or wall that does not exist never has a force. ENTNO is the id of *CONTACT_..._ID. Contacts without ids are
    counted in the order of their definition (no available source confirms this). d2rpick applies this rule only if it
    could read the whole deck and the deck has parts. Source: vendor keyword data.

    Fix: Set ENTNO to the id of a contact or rigid wall of the deck.
    """
    for codes, kind, keyword in _ENTITIES:
        headers = [
            header for header in _find_force_headers(case, codes) if header.entno.value
        ]
        entities = read_entities(case.deck, keyword) if headers else None
        if entities is None or not (entities.all_known and case.knows_all_parts):
            continue
        for header in headers:
            if entities.named(header.entno.value) is None:
                entno = f"ENTNO is {header.entno.value}, but"
                if entities.found:
                    problem = f"{entno} no {kind} has this id (the deck has {_list_entities(entities)})"
                    yield (
                        header.entno.field,
                        f"{problem}, so the set never switches; give the id of one of them",
                    )
                else:
                    yield (
                        header.entno.field,
                        f"{entno} the deck has no {kind}, so the set never switches; add one",
                    )


@set_passing(
    lambda: [
        _with_floor(4, 7),
        _make_force_deck(2, 1, contact=_BY_ORDER),
        _make_force_deck(3, 7, contact=write_contact("GENERAL") + _WALL),
    ]
)
@set_failing(
    lambda: [
        _make_force_deck(4, 7, contact=write_contact("GENERAL")),
        _make_force_deck(2, 7, contact=write_contact("SINGLE_SURFACE")),
    ]
)
@make_rule_decorator(
    "D2R008", ERROR, "an ENTNO that names a contact whose force cannot trigger a switch"
)
def _check_entity_triggers(case: Case) -> Iterator[PlacedMessage]:
    """Only the force of surface-to-surface and nodes-to-surface contacts triggers a switch. A contact of type GENERAL
    or SINGLE_SURFACE never triggers a switch, so the part keeps its state, and the solver issues no message. Source:
    LS-DYNA manual, Vol I, *DEFORMABLE_TO_RIGID_AUTOMATIC, Remark 1, as quoted by a public drop tool, and the vendor's
    help on OFFSET, which lists the same types. Not tested with the solver.

    Fix: Define a surface-to-surface or nodes-to-surface contact for the impact and set ENTNO to its id.
    """
    headers = [
        header
        for header in _find_force_headers(case, _OF_CONTACT)
        if header.entno.value
    ]
    entities = read_entities(case.deck, "CONTACT") if headers else None
    for header in headers:
        entity = entities.named(header.entno.value) if entities else None
        if entity and entities and not entity.triggers:
            able_entities = [
                candidate for candidate in entities.found if candidate.triggers
            ]
            if able_entities:
                able = f" (here: {_list_entities(entities._replace(found=tuple(able_entities)))})"
            else:
                able = ""
            problem = f"ENTNO {header.entno.value} is *{entity.keyword}, whose force triggers no switch"
            yield (
                header.entno.field,
                f"{problem}; choose a surface-to-surface or nodes-to-surface contact{able}",
            )


def _list_entities(entities: Entities) -> str:
    """Return the contacts or walls as text, with their ids, keywords and titles."""
    texts = [
        f"{entity.id or entity.number} (*{entity.keyword}{f' {entity.title!r}' if entity.title else ''})"
        for entity in entities.found
    ]
    return list_names(texts, most=_MOST_LISTED)


def _make_sensor_deck(control: str) -> Example:
    """Return a deck whose switch set has CODE 5 and the given *SENSOR_CONTROL."""
    return make_deck(
        control + write_automatic_card(20, "0.0", rigid=["1"], code=BY_SENSOR)
    )


@set_passing(
    lambda: [
        PASS,
        _make_sensor_deck(_CONTROL.format(20)),
        _make_sensor_deck(
            "*SENSOR_CONTROL_TITLE\nby force\n" + _CONTROL.format(20)[16:]
        ),
    ]
)
@set_failing(
    lambda: [
        _make_sensor_deck(""),
        _make_sensor_deck(_CONTROL.format(21)),
        _make_sensor_deck(_CONTROL.format(20).replace("DEF2RIG", " AIRBAG")),
    ]
)
@make_rule_decorator(
    "D2R012", ERROR, "CODE 5 without a *SENSOR_CONTROL that switches the set"
)
def _check_sensor_control(case: Case) -> Iterator[PlacedMessage]:
    """A set with CODE 5 is switched by a *SENSOR_CONTROL with TYPE DEF2RIG whose TYPEID is its SWSET. Without one it
    never switches. d2rpick applies this rule only if it could read the whole deck and the deck has parts. D2R302
    reports when the sensor switches. Source: vendor keyword data.

    Fix: Add a *SENSOR_CONTROL with TYPE DEF2RIG and TYPEID equal to SWSET, or choose another CODE.
    """
    if not case.knows_all_parts:
        return
    controlled = {
        number
        for card in case.deck.named("SENSOR_CONTROL")
        for number in _find_controlled(card)
    }
    for _, header in case.headers:
        if (
            header.code.value == BY_SENSOR
            and not header.code.problem
            and header.swset.value not in controlled
        ):
            problem = f"no *SENSOR_CONTROL of type DEF2RIG has TYPEID {header.swset.value}, so set {header.swset.value}"
            yield (
                header.code.field,
                f"{problem} never switches; add one, or choose another CODE",
            )


def _find_controlled(card: Card) -> Iterator[int]:
    """Yield the id of the switch set that a *SENSOR_CONTROL switches, if there is one."""
    for row in card.data[:1]:
        if card.word(row, SENSOR_CONTROL["TYPE"]).value == "DEF2RIG":
            yield (
                card.integer(row, SENSOR_CONTROL["TYPEID"]).value + card.transform.rest
            )


def _make_delayed_deck(wait: str) -> Example:
    """Return a deck with a pair of sets; ``wait`` is TIME3 of the set that makes the parts deformable."""
    rigid_card = write_automatic_card(1, "0.0", rigid=["1"], code=2, pair=(2, 1))
    back_card = write_automatic_card(
        2, "0.0", deformable=["1"], code=4, pair=(1, -1), delay=wait
    )
    return make_deck(rigid_card + back_card)


@set_passing(lambda: [PASS, _with_floor(4, 7), _make_delayed_deck("0.01")])
@set_failing(
    lambda: [
        _with_floor(4, 7, "0.0"),
        _with_floor(2, 7, "0.0"),
        _make_delayed_deck("0.0"),
    ]
)
@make_rule_decorator("D2R009", WARNING, "TIME3 0 together with a contact CODE")
def _check_delay(case: Case) -> Iterator[PlacedMessage]:
    """TIME3 is the time after a switch during which the set makes no further switch. A contact force begins and ends
    many times in one impact, so with TIME3 = 0 the parts switch back and forth. In a pair, one of the two sets needs a
    TIME3 above 0. Source: the vendor's keyword data define TIME3; a public drop tool reports the
    repeated switches.

    Fix: Set TIME3 to a time that is longer than the contact.
    """
    waiting = {
        header.swset.value for _, header in case.headers if header.time3.value > 0
    }
    for header in _find_force_headers(case, _OF_CONTACT):
        if (
            not header.time3.problem
            and header.time3.value == 0
            and header.relsw.value not in waiting
        ):
            problem = f"TIME3 is 0 with CODE {header.code.value}, so parts may switch back and forth in every contact"
            yield (
                header.time3.field,
                f"{problem}; set TIME3 to a time that is longer than the contact",
            )


@set_passing(lambda: [PASS, _with_floor(4, 7)])
@set_failing(lambda: [_with_floor(4, 0), _make_force_deck(3, 0)])
@make_rule_decorator(
    "D2R010", ERROR, "CODE 3 or 4 without a contact or rigid wall (ENTNO 0)"
)
def _check_entity_named(case: Case) -> Iterator[PlacedMessage]:
    """The set switches when the force of ENTNO is not zero. ENTNO 0 names no contact or rigid wall, so there is no such
    force. Source: vendor keyword data. No available source confirms what the solver does with 0.

    Fix: Set ENTNO to the id of the contact or rigid wall.
    """
    for header in _find_force_headers(case, _WITH_FORCE):
        if header.entno.value == 0:
            kind = "a contact" if header.code.value in _OF_CONTACT else "a rigid wall"
            problem = f"ENTNO is 0 with CODE {header.code.value}, which waits for the force of {kind}"
            yield header.entno.field, f"{problem}; give its id"


def _make_landing_deck(wait: str) -> Example:
    """Return a deck with a pair of sets, and the history of the landing box; ``wait`` is TIME3."""
    # The deck has the ENDTIM and the part titles of the history.
    landed = _make_delayed_deck(wait).deck.replace("       0.2", "       0.7", 1)
    landed = landed.replace("\ndoor\n", "\nbox\n").replace("\nframe\n", "\nstep\n")
    return Example(landed, history=_LANDING, computed_by="rollover")


@set_passing(lambda: [PASS, _make_landing_deck("0.07")])
@set_failing(lambda: [_make_landing_deck("0.0")])
@make_rule_decorator(
    "D2R208", WARNING, "a switch by a force that chatters in the history", BOTH
)
def _check_chatter(case: Case) -> Iterator[PlacedMessage]:
    """A contact force begins and ends many times in one impact. d2rpick follows the switches through the history if the
    history contains the force of the contact or wall. Part momenta are enough if the deck has only one contact or wall.
    Rigid windows shorter than 10 % of the longest window are not flights but chatter. There is no chatter if TIME3 of
    the set that makes the parts deformable (Radioss: Tdelay of the sensor) is longer than the contact. d2rpick cannot
    detect a force that begins and ends within one output interval.

    Fix: Raise TIME3 (Radioss: Tdelay) to the value in the finding.
    """
    for switch in case.by_condition:
        short_count = len(switch.times) - len(switch.lasting)
        if short_count:
            # Imported here to keep start-up fast.
            from d2rpick.deck.force_switching import find_delay_without_chatter

            wait = switch.contacts and find_delay_without_chatter(
                switch.lasting, switch.contacts
            )
            if wait:
                cure = f"; set {switch.wait} to {wait:.3g} or more, which leaves {len(switch.lasting)}"
            else:
                cure = ""
            problem = f"{switch.switches} switches in the history, in {len(switch.times)} windows"
            yield (
                switch.place.here,
                f"{problem}, {short_count} of which are below 10 % of the longest{cure}",
            )
