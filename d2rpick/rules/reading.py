"""D2R001-003, D2R011, D2R109-110, D2R301-306: what cannot be read, and what is not judged."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from d2rpick.base.errors import listing
from d2rpick.base.files import STDIN
from d2rpick.deck.card import Field, Problem
from d2rpick.deck.ls_dyna_parts import element_cards
from d2rpick.deck.reader import UNKNOWN_KIND, cure, cuts
from d2rpick.deck.switching import SwitchSet, misspelt
from d2rpick.rules.base import BOTH, ERROR, INFO, LS_DYNA, WARNING, Case, Objection
from d2rpick.rules.rule import (
    BACK,
    END,
    GOOD,
    HEAD,
    PARTS,
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
    from d2rpick.rules.by_sensor import Sensed

_MOST_LISTED: Final = 8
_CURES: Final = {
    "no such file": "add the file or its *INCLUDE_PATH",
    UNKNOWN_KIND: "check that file separately",
}
_INNER = THERE + BACK + END


def _transformed(factor: str) -> Example:
    include = f"*INCLUDE_TRANSFORM\nswitch.k\n{'0':>10s}\n{'0':>10s}\n{'1.0':>10s}{factor:>10s}\n{'0':>10s}\n"
    return Example(HEAD + PARTS + include + END, {"switch.k": _INNER})


_PARAMETER = "*PARAMETER\nR tr           0.02\n"
_BY_NAME = PARTS + automatic(1, "&tr", rigid=["1"]) + BACK + END
_CODES: Final = {
    1: "when the force of rigid wall {} is zero",
    2: "when the force of contact {} is zero",
    3: "when rigid wall {} has a force",
    4: "when contact {} has a force",
    5: "by a *SENSOR_CONTROL of type DEF2RIG",
}


_INERTIA: Final = """\
*DEFORMABLE_TO_RIGID_INERTIA
         1
       0.0       0.0       0.0      12.5
       1.0       0.0       0.0       1.0       0.0       1.0
"""


def _elements(keyword: str) -> Example:
    cards = automatic(1, "0.02", rigid=["1", "2"]) + automatic(
        2, "0.09", deformable=["1", "2"]
    )
    return deck(
        keyword + "\n       1       1       1       2       3       4\n" + cards
    )


@fails(
    deck(automatic(1, "0.02", rigid=["1"], counts=(2, 0)) + BACK),
    Example("*DEFORMABLE_TO_RIGID_AUTOMATIC\n         1\n"),
    deck(automatic(1, "0.02", rigid=["1"], counts=(2, -1)) + BACK),
    deck(automatic(1, "0.02")),
    deck("\n".join(THERE.split("\n")[:3] + THERE.split("\n")[5:]) + BACK),
    deck("\n".join(THERE.split("\n")[:5]) + "\n" + BACK),
    Example("*DEFORMABLE_TO_RIGID_INERTIA\n         1\n"),
)
@rule("D2R001", ERROR, "the rows after a card do not match its D2R/R2D counts")
def _counts(case: Case) -> Iterator[Objection]:
    """The second line of *DEFORMABLE_TO_RIGID_AUTOMATIC counts the D2R and R2D lines that follow it, one per part.
    With wrong counts the solver reads a part from the wrong line, or a line as the next card. A card whose counts
    are both 0 switches nothing. A line that is missing is named: the solver takes the next one in its place.
    """
    for card in case.sets:
        if card.count_problem:
            lost = "missing" in card.count_problem
            rows = (
                "all lines of the card"
                if lost
                else "a line per part, and their count on the second line"
            )
            yield card.card.here, f"{card.count_problem}; write {rows}"


@passes(PASS, Example(HEAD + _PARAMETER + _BY_NAME))
@fails(
    Example(HEAD + _BY_NAME),
    Example("*DEFORMABLE_TO_RIGID\n         ?\n"),
    deck(automatic(0, "0.02", rigid=["1"])),
    Example(GOOD.replace("      0.02       0.0", "    0.0135867    0.0")),
    Example(
        "*SET_PART\n         3\n     &door\n*DEFORMABLE_TO_RIGID\n         3         0      PSET\n"
    ),
    Example(
        GOOD.replace("         2         1         1", "       abc         1         1")
    ),
    Example(
        HEAD + "*INCLUDE_TRANSFORM\nall.k\n" + f"{'&off':>30s}\n",
        {"all.k": PARTS + THERE + BACK},
    ),
    Example(GOOD.replace("_AUTOMATIC", "_AUTOMATC")),
    Example(GOOD.replace("*DEFORM", "* DEFORM")),
    Example("*DEFORMABLE_TO_RIGID\n         1         0      WALL\n"),
)
@rule(
    "D2R002",
    ERROR,
    "a switching keyword, number or &parameter that cannot be read",
    BOTH,
)
def _fields(case: Case) -> Iterator[Objection]:
    """Fields are 10 columns wide (20 in long format) unless the line has commas. A text in a number's columns, or an
    undefined parameter, stops the run or, worse, is read as something else. So is a keyword that begins like a
    switching card but is not one. ENDTIM and the DT of *DATABASE_GLSTAT and _MATSUM are looked at too: the switching
    times are judged by them.
    """
    for unknown, near in misspelt(case.deck):
        head = unknown.block.head.strip()
        yield (
            unknown.here,
            f"{head!r} is not a switching keyword, so its lines were not read; did you mean {near}?",
        )
    for card in case.sets:
        for field, problem in card.problems:
            yield field, f"{problem}; check its columns and its parameters"
    if case.sets:
        for field, problem in (*case.parts.problems, *_unreadable_members(case)):
            yield field, f"{problem}; it is needed to know which parts are switched"
        for support, value in case.supporting:
            if value.problem:
                yield (
                    value.field,
                    f"{value.problem}; *{support.name} is needed to judge the switching times",
                )


def _unreadable_members(case: Case) -> Iterator[Problem]:
    used = dict.fromkeys(
        line.part.value for card in case.sets for line in card.switched if line.by_set
    )
    for set_id in dict.fromkeys(
        reached for one in used for reached in case.parts.reached(one)
    ):
        content = case.parts.sets.get(set_id)
        yield from content.problems if content else ()


@passes(Example(HEAD + "*INCLUDE\nswitch.k\n" + END, {"switch.k": PARTS + _INNER}))
@fails(
    Example(HEAD + "*INCLUDE\nnowhere.k\n" + END),
    Example(HEAD + "*INCLUDE_AUTO_OFFSET\nswitch.k\n" + END),
)
@rule("D2R003", ERROR, "an include file is missing or cannot be read", BOTH)
def _includes(case: Case) -> Iterator[Objection]:
    """Looked for in the main deck's folder, in the *INCLUDE_PATH folders and in the including file's folder. A file
    that includes itself or cannot be read is reported too, also one that a Radioss starter deck asks for (#include): a
    rigid body with a sensor may stand in it. Switching cards, parts or parameters may be in it, so the other findings
    may be incomplete.
    """
    for missing in case.unread:
        cure = _CURES.get(missing.reason, "correct it")
        if case.solver != LS_DYNA and missing.reason in _CURES:
            cure = "add the file"
        found = f"include {missing.name.text!r} was not read ({missing.reason})"
        yield missing.name, f"{found}; switching cards may hide in it: {cure}"


@passes(Example(HEAD + _PARAMETER + _PARAMETER + _BY_NAME))
@fails(Example(HEAD + _PARAMETER + "*PARAMETER\nR tr           0.03\n" + _BY_NAME))
@rule(
    "D2R109",
    WARNING,
    "a parameter used by a card is defined twice with different values",
)
def _ambiguous(case: Case) -> Iterator[Objection]:
    """LS-DYNA by default warns and keeps the first definition; *PARAMETER_DUPLICATION and _MUTABLE change that, and
    other readers of decks keep the last. A switching time should not depend on it.
    """
    uses = [
        (card.card, value)
        for card in case.sets
        for value in card.values
        if value.parameters
    ]
    if case.sets:
        uses += [(card, value) for card, value in case.supporting if value.parameters]
    seen: set[tuple[Card, str]] = set()
    for card, value in uses:
        for name in card.scope.closure(value.parameters):
            first, *others = card.scope.definitions(name) or (None,)
            differing = [
                other for other in others if first and other.value != first.value
            ]
            if first and differing and (card, name) not in seen:
                seen.add((card, name))
                other, place = differing[0], first.place
                found = f"parameter &{name} is {first.value} at {place.at} but {other.value} at {other.place.at}"
                yield (
                    value.field,
                    f"{found}; which one counts depends on the solver: keep one",
                )


@passes(_transformed("1.0"), _transformed("0.0"))
@fails(_transformed("0.5"))
@rule("D2R110", WARNING, "the card is in a transformed include whose FCTTIM is not 1")
def _scaled(case: Case) -> Iterator[Objection]:
    """*INCLUDE_TRANSFORM multiplies the times of a file by FCTTIM (0 means 1). d2rpick applies it to the switching
    times too, but whether the solver does is not confirmed by any source that was available.
    """
    for card in case.sets:
        factor = card.card.transform.time
        if factor != 1:
            found = f"the card is in an include whose times are multiplied by {factor:g} (FCTTIM)"
            why = "that this holds for switching times is not confirmed"
            yield card.card.here, f"{found}; {why}: move the card to the main deck"


@fails(
    Example(
        GOOD.replace(
            END, "-----BEGIN PGP MESSAGE-----\nhQEMA\n-----END PGP MESSAGE-----\n"
        )
        + END
    )
)
@rule("D2R303", INFO, "encrypted block: cards may hide in it")
def _encrypted(case: Case) -> Iterator[Objection]:
    """Vendor models hold blocks between BEGIN PGP MESSAGE and END PGP MESSAGE that only the solver can read."""
    for block in case.deck.encrypted:
        told = "an encrypted block starts here; switching cards may hide in it, nothing in it was checked"
        yield Field("", block, 0, 1), told


@passes(Example(GOOD.removesuffix(END)))
@fails(
    Example(GOOD.removesuffix("      PART\n" + END)),
    Example(GOOD.removesuffix(END) + "*NODE\n       1\n"),
)
@rule("D2R011", WARNING, "a file of the deck seems to be cut", BOTH)
def _cut(case: Case) -> Iterator[Objection]:
    """A file without *END (Radioss: /END) whose last line has no line end may have lost the end of a number, and all
    that came after it; so may a main deck without *END whose last lines are nodes or elements. Switching cards,
    parts or parameters may be missing. d2rpick parts computes no cost from a mesh that is cut.
    """
    for block, told in cuts(case.deck):
        yield (
            Field("", block, 0, 1),
            f"{told} What is missing was not checked: {cure(block)}",
        )


@fails(deck("*COMMENT c:" + THERE))
@rule("D2R301", INFO, "a card disabled by *COMMENT")
def _disabled(case: Case) -> Iterator[Objection]:
    """Everything from *COMMENT to the next keyword is a comment, the rest of the keyword line too. Below it a
    switching card looks alive and is not.
    """
    for card in case.deck.disabled:
        yield (
            card.here,
            f"the keyword line {card.block.head.strip()!r} is a comment: this card does nothing",
        )


@fails(
    deck(automatic(1, "0.0", rigid=["1"], code=2)),
    Example("*RIGID_DEFORMABLE_R2D\n         1\n"),
    Example("*DEFORMABLE_TO_RIGID\n         1\n"),
)
@rule(
    "D2R302",
    INFO,
    "not judged by time: CODE 1-5, restart cards, plain *DEFORMABLE_TO_RIGID",
    BOTH,
)
def _untimed(case: Case) -> Iterator[Objection]:
    """CODE 1 to 4 switch by a contact or wall force, CODE 5 by a sensor, restart cards when the restart begins, plain
    cards at the start, a Radioss body by a sensor other than /SENSOR/TIME: no time on the card can be compared with an
    energy history. If a history has the force of the contact or wall (or the momenta of the parts, if the deck has one
    contact or wall), the times at which it switches are found from it and judged. A *SENSOR_CONTROL is followed through
    *SENSOR_SWITCH of the time, or of the magnitude of such a force; that its set is made while it is on and undone
    while it is off was not tried with the solver. Restarts that are checked together with their main deck have
    times: each begins at the ENDTIM of the run before it.
    """
    for place, how in case.untimed:
        yield place, f"{how}; not judged by time"
    for card in case.sets:
        reason = _reason(card) if case.solver == LS_DYNA else ""
        forced = next((one for one in case.forced if card.card in one.cards), None)
        sensed = next((one for one in case.sensed if one.by is card), None)
        if reason and forced:
            first = f", first at {forced.times[0][0]:.6g}" if forced.times else ""
            times = f"by the {forced.source} of the history {forced.switches} times"
            yield card.card.here, f"*{card.card.name} {reason}: {times}{first}"
        elif reason and sensed:
            yield card.card.here, f"*{card.card.name} {reason}{_course_of(sensed)}"
        elif reason:
            yield card.card.here, f"*{card.card.name} {reason}; not judged by time"


@passes(
    PASS,
    _elements("*ELEMENT_SHELL_COMPOSITE"),
    Example(GOOD.replace(END, "*ELEMENT_SHELL_DOF\n")),
)
@fails(_elements("*ELEMENT_SHELL_DOF"), _elements("*ELEMENT_BEAM_PID"))
@rule("D2R304", INFO, "elements of a kind that is not searched for shared nodes")
def _unread(case: Case) -> Iterator[Objection]:
    """D2R108 looks for nodes that separate rigid bodies share. Element keywords with options that put more whole
    numbers on their lines are not followed, so it may miss some.
    """
    switched = {event.unit for event in case.windows.events if event.line.to_rigid}
    if len(switched) < 2:
        return
    first: dict[str, Card] = {}
    for card in element_cards(case.deck, searched=False):
        first.setdefault(card.name, card)
    for card in first.values():
        yield (
            card.here,
            f"nodes that parts share were not searched in *{card.name}, whose lines are not followed",
        )


@fails(deck(_INERTIA + THERE + BACK), deck(_INERTIA))
@rule(
    "D2R305", INFO, "*DEFORMABLE_TO_RIGID_INERTIA: mass and inertia given for a switch"
)
def _inertias(case: Case) -> Iterator[Objection]:
    """The card replaces the mass properties that the solver computes from the mesh when the part is made rigid; left
    over from another state of the model they are wrong without a word. Source: vendor keyword data.
    """
    made = {event.unit.id for event in case.made_rigid}
    unknown = any(event.unit.is_set for event in case.windows.events)
    for card in case.sets:
        if card.kind != "inertia" or card.part is None:
            continue
        part = card.part.value
        used = (
            ""
            if part in made or unknown
            else f"; no card of this deck makes part {part} rigid"
        )
        yield (
            card.card.here,
            f"gives mass and inertia of part {part} for when a switch makes it rigid{used}",
        )


@passes(Example(THERE + BACK), Example(GOOD, stdin=True))
@fails(Example(THERE + BACK, stdin=True))
@rule(
    "D2R306",
    INFO,
    "switching cards on standard input without parts: ids are not checked",
)
def _without_parts(case: Case) -> Iterator[Objection]:
    """A file of cards alone is for another deck to include, which is checked with it. Cards on standard input, as in
    d2rpick card ... | d2rpick check -, have no deck around them: that their parts exist is not known.
    """
    if (
        case.deck.path == STDIN
        and case.sets
        and not case.parts.materials
        and case.parts.all_known
    ):
        told = "the parts are unknown: no *PART came with the cards, so their ids were not checked"
        yield case.sets[0].card.here, told


def _course_of(sensed: Sensed) -> str:
    """Say when a control is on, or why that is not known."""
    if sensed.unknown:
        return f", by {sensed.unknown}; not judged by time"
    changes = sensed.changes
    listed = listing(
        [f"{'on' if change.on else 'off'} at {change.time:.6g}" for change in changes],
        most=_MOST_LISTED,
    )
    return f": {listed}; its parts are taken to be switched while it is on, and back while it is off"


def _reason(card: SwitchSet) -> str:
    if card.restart:
        return ""
    if card.kind == "restart":
        return "acts at the restart, whose time is the end of the run before"
    if card.kind == "plain" and not card.switched and not card.count_problem:
        return ""  # it only lets restarts switch
    if card.kind == "plain":
        return "acts at the start of the run"
    if (
        card.header is None
        or card.header.code.problem
        or card.header.code.value not in _CODES
    ):
        return ""
    return "switches " + _CODES[card.header.code.value].format(card.header.entno.value)
