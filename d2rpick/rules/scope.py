"""D2R301, D2R302, D2R304-306: what the check looked at but does not judge."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from d2rpick.deck.elements import unread_elements
from d2rpick.deck.source import STDIN
from d2rpick.rules.base import BOTH, LS_DYNA, Example, Rule, Severity
from d2rpick.rules.example_decks import BACK, END, GOOD, HEAD, PARTS, THERE, automatic

if TYPE_CHECKING:
    from collections.abc import Iterator

    from d2rpick.deck import SwitchSet
    from d2rpick.deck.card import Card
    from d2rpick.rules.base import Case, Objection

_CODES: Final = {
    1: "when the force of rigid wall {} is zero",
    2: "when the force of contact {} is zero",
    3: "when rigid wall {} has a force",
    4: "when contact {} has a force",
    5: "by a *SENSOR_CONTROL of type DEF2RIG",
}


def _disabled(case: Case) -> Iterator[Objection]:
    for card in case.deck.disabled:
        yield card.here, f"the keyword line {card.block.head.strip()!r} is a comment: this card does nothing"


def _untimed(case: Case) -> Iterator[Objection]:
    for place, how in case.untimed:
        yield place, f"{how}; not judged by time"
    for card in case.sets:
        reason = _reason(card) if case.solver == LS_DYNA else ""
        if reason:
            yield card.card.here, f"*{card.card.name} {reason}; not judged by time"


def _unread(case: Case) -> Iterator[Objection]:
    switched = {event.unit for event in case.windows.events if event.line.to_rigid}
    if len(switched) < 2:
        return
    first: dict[str, Card] = {}
    for card in unread_elements(case.deck):
        first.setdefault(card.name, card)
    for card in first.values():
        yield card.here, f"nodes that parts share were not searched in *{card.name}, whose lines are not followed"


def _inertias(case: Case) -> Iterator[Objection]:
    made = {event.unit.id for event in case.windows.events if event.line.to_rigid and not event.unit.is_set}
    unknown = any(event.unit.is_set for event in case.windows.events)
    for card in case.sets:
        if card.kind != "inertia" or card.part is None:
            continue
        part = card.part.value
        used = "" if part in made or unknown else f"; no card of this deck makes part {part} rigid"
        yield card.card.here, f"gives mass and inertia of part {part} for when a switch makes it rigid{used}"


def _without_parts(case: Case) -> Iterator[Objection]:
    if case.deck.path == STDIN and case.sets and not case.parts.materials and case.parts.all_known:
        yield (
            case.sets[0].card.here,
            "the parts are unknown: no *PART came with the cards, so their ids were not checked",
        )


def _reason(card: SwitchSet) -> str:
    if card.kind == "restart":
        return "acts at the restart, whose time is the end of the run before"
    if card.kind == "plain":
        return "acts at the start of the run"
    if card.header is None or card.header.code.problem or card.header.code.value not in _CODES:
        return ""
    return "switches " + _CODES[card.header.code.value].format(card.header.entno.value)


_INERTIA: Final = """\
*DEFORMABLE_TO_RIGID_INERTIA
         1
       0.0       0.0       0.0      12.5
       1.0       0.0       0.0       1.0       0.0       1.0
"""


def _elements(keyword: str) -> Example:
    cards = automatic(1, "0.02", rigid=["1", "2"]) + automatic(2, "0.09", deformable=["1", "2"])
    return Example(HEAD + PARTS + keyword + "\n       1       1       1       2       3       4\n" + cards + END)


RULES: Final = (
    Rule(
        "D2R301",
        Severity.INFO,
        "a card disabled by *COMMENT",
        "Everything from *COMMENT to the next keyword is a comment, the rest of the keyword line too. "
        "Below it a switching card looks alive and is not.",
        _disabled,
        (Example(GOOD),),
        (Example(HEAD + PARTS + "*COMMENT c:" + THERE + END),),
    ),
    Rule(
        "D2R302",
        Severity.INFO,
        "not judged by time: CODE 1-5, restart cards, plain *DEFORMABLE_TO_RIGID",
        "CODE 1 to 4 switch by a contact or wall force, CODE 5 by a sensor, restart cards when the "
        "restart begins, plain cards at the start, a Radioss body by a sensor other than /SENSOR/TIME: "
        "no time on the card can be compared with an energy history.",
        _untimed,
        (Example(GOOD),),
        (
            Example(HEAD + PARTS + automatic(1, "0.0", rigid=["1"], code=2) + END),
            Example("*RIGID_DEFORMABLE_R2D\n         1\n"),
            Example("*DEFORMABLE_TO_RIGID\n         1\n"),
        ),
        solvers=BOTH,
    ),
    Rule(
        "D2R304",
        Severity.INFO,
        "elements of a kind that is not searched for shared nodes",
        "D2R108 looks for nodes that separate rigid bodies share. Element keywords with options that put more "
        "whole numbers on their lines are not followed, so it may miss some.",
        _unread,
        (Example(GOOD), _elements("*ELEMENT_SHELL_COMPOSITE"), Example(GOOD.replace(END, "*ELEMENT_SHELL_DOF\n"))),
        (_elements("*ELEMENT_SHELL_DOF"), _elements("*ELEMENT_BEAM_PID")),
    ),
    Rule(
        "D2R305",
        Severity.INFO,
        "*DEFORMABLE_TO_RIGID_INERTIA: mass and inertia given for a switch",
        "The card replaces the mass properties that the solver computes from the mesh when the part is made rigid; "
        "left over from another state of the model they are wrong without a word. Source: vendor keyword data.",
        _inertias,
        (Example(GOOD),),
        (Example(HEAD + PARTS + _INERTIA + THERE + BACK + END), Example(HEAD + PARTS + _INERTIA + END)),
    ),
    Rule(
        "D2R306",
        Severity.INFO,
        "switching cards on standard input without parts: ids are not checked",
        "A file of cards alone is for another deck to include, which is checked with it. Cards on standard input, as "
        "in d2rpick card ... | d2rpick check -, have no deck around them: that their parts exist is not known.",
        _without_parts,
        (Example(THERE + BACK), Example(GOOD, stdin=True)),
        (Example(THERE + BACK, stdin=True),),
    ),
)
