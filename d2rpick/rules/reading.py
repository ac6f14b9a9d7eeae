"""Define rules D2R001-003, D2R011, D2R109-110 and D2R301-306: unreadable input, and input that is not judged."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Final

from d2rpick.base.errors import list_names
from d2rpick.base.files import STDIN
from d2rpick.deck.card import CardField, Problem
from d2rpick.deck.ls_dyna_parts import find_element_cards
from d2rpick.deck.reader import UNKNOWN_KIND, describe_cure, find_cuts
from d2rpick.deck.switching import SwitchSet, find_misspelt
from d2rpick.rules.base import BOTH, ERROR, INFO, LS_DYNA, WARNING, Case, PlacedMessage
from d2rpick.rules.example import (
    END,
    HEAD,
    PARTS,
    Example,
    make_deck,
    write_automatic_card,
)
from d2rpick.rules.rule import (
    BACK,
    GOOD,
    PASS,
    THERE,
    make_rule_decorator,
    set_failing,
    set_passing,
)

if TYPE_CHECKING:
    from collections.abc import Iterator

    from d2rpick.deck.card import Card
    from d2rpick.rules.by_sensor import Sensed

_MOST_LISTED: Final = 8
# Gap between two values of a line with columns, inside a text that was read as one field.
_BETWEEN_COLUMNS: Final = r"\S {2,}\S"
_CURES: Final = {
    "no such file": "add the file or its *INCLUDE_PATH",
    UNKNOWN_KIND: "check that file separately",
}
_INNER = THERE + BACK + END

_PARAMETER = "*PARAMETER\nR tr           0.02\n"
_BY_NAME = PARTS + write_automatic_card(1, "&tr", rigid=["1"]) + BACK + END
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


def _make_transformed(factor: str) -> Example:
    include = f"*INCLUDE_TRANSFORM\nswitch.k\n{'0':>10s}\n{'0':>10s}\n{'1.0':>10s}{factor:>10s}\n{'0':>10s}\n"
    return Example(HEAD + PARTS + include + END, {"switch.k": _INNER})


def _make_elements(keyword: str) -> Example:
    cards = write_automatic_card(1, "0.02", rigid=["1", "2"]) + write_automatic_card(
        2, "0.09", deformable=["1", "2"]
    )
    return make_deck(
        keyword + "\n       1       1       1       2       3       4\n" + cards
    )


@set_failing(
    lambda: [
        make_deck(write_automatic_card(1, "0.02", rigid=["1"], counts=(2, 0)) + BACK),
        Example("*DEFORMABLE_TO_RIGID_AUTOMATIC\n         1\n"),
        make_deck(write_automatic_card(1, "0.02", rigid=["1"], counts=(2, -1)) + BACK),
        make_deck(write_automatic_card(1, "0.02")),
        make_deck("\n".join(THERE.split("\n")[:3] + THERE.split("\n")[5:]) + BACK),
        make_deck("\n".join(THERE.split("\n")[:5]) + "\n" + BACK),
        Example("*DEFORMABLE_TO_RIGID_INERTIA\n         1\n"),
    ]
)
@make_rule_decorator(
    "D2R001", ERROR, "lines after a card that do not match its D2R and R2D counts"
)
def _check_counts(case: Case) -> Iterator[PlacedMessage]:
    """The second line of *DEFORMABLE_TO_RIGID_AUTOMATIC gives the number of D2R lines (D2R) and of R2D lines (R2D) that
    follow it, one line per part. If a count is wrong or a line is missing, the solver misreads the lines: it reads a
    part from the wrong line or treats a part line as the next card. If both counts are 0, the card switches no part.

    Fix: Write one line per part and set D2R and R2D to the number of these lines.
    """
    for card in case.sets:
        if card.count_problem:
            lost = "missing" in card.count_problem
            cure = "write a line per part, and their count on the second line"
            if lost:
                cure = "write all lines of the card"
            yield card.card.here, f"{card.count_problem}; {cure}"


@set_passing(lambda: [PASS, Example(HEAD + _PARAMETER + _BY_NAME)])
@set_failing(
    lambda: [
        Example(HEAD + _BY_NAME),
        Example("*DEFORMABLE_TO_RIGID\n         ?\n"),
        make_deck(write_automatic_card(0, "0.02", rigid=["1"])),
        Example(GOOD.replace("      0.02       0.0", "    0.0135867    0.0")),
        Example(
            "*SET_PART\n         3\n     &door\n*DEFORMABLE_TO_RIGID\n         3         0      PSET\n"
        ),
        Example(
            GOOD.replace(
                "         2         1         1", "       abc         1         1"
            )
        ),
        Example(
            HEAD + "*INCLUDE_TRANSFORM\nall.k\n" + f"{'&off':>30s}\n",
            {"all.k": PARTS + THERE + BACK},
        ),
        Example(GOOD.replace("_AUTOMATIC", "_AUTOMATC")),
        Example(GOOD.replace("*DEFORM", "* DEFORM")),
        Example("*DEFORMABLE_TO_RIGID\n         1         0      WALL\n"),
    ]
)
@make_rule_decorator(
    "D2R002",
    ERROR,
    "a switching keyword, number or &parameter that cannot be read",
    BOTH,
)
def _check_fields(case: Case) -> Iterator[PlacedMessage]:
    """Fields are 10 columns wide (20 in long format), unless commas separate the fields of the line. If the columns of
    a number contain text, or a parameter is undefined, the run stops, or the solver reads another value. If a switching
    keyword is misspelled, the solver ignores the card. d2rpick also checks ENDTIM and the DT of *DATABASE_GLSTAT and
    *DATABASE_MATSUM, because it compares the switching times with them.

    Fix: Move the value into its columns, define the parameter, or correct the keyword.
    """
    for unknown, near in find_misspelt(case.deck):
        head = unknown.block.head.strip()
        yield (
            unknown.here,
            f"{head!r} is not a switching keyword, so its lines were not read; did you mean {near}?",
        )
    for card in case.sets:
        yield from _list_unreadable_fields(card)
    if case.sets:
        for field, problem in (*case.parts.problems, *_find_unreadable_members(case)):
            yield field, f"{problem}; it is needed to know which parts are switched"
        for card_of_time, value in case.end_and_intervals:
            if value.problem:
                yield (
                    value.field,
                    f"{value.problem}; *{card_of_time.name} is needed to judge the switching times",
                )


def _list_unreadable_fields(card: SwitchSet) -> Iterator[PlacedMessage]:
    """Yield the unreadable fields of a switching card; of a line with a decimal comma only the first."""
    lines_with_comma = set()
    for field, problem in card.problems:
        if not re.search(_BETWEEN_COLUMNS, field.text):
            yield field, f"{problem}; check its columns and its parameters"
            continue
        if field.line not in lines_with_comma:
            lines_with_comma.add(field.line)
            words = " ".join(field.text.split())
            yield (
                field,
                (
                    f"{words!r} is not a number: because of a comma in this line, its fields are not read by columns; "
                    "write decimal numbers with a point, 0.012 for 0,012"
                ),
            )


def _find_unreadable_members(case: Case) -> Iterator[Problem]:
    """Yield the unreadable fields of all part sets that the switching cards name, directly or through other sets."""
    used = dict.fromkeys(
        line.part.value for card in case.sets for line in card.switched if line.by_set
    )
    for set_id in dict.fromkeys(
        reached for used_set in used for reached in case.parts.reached(used_set)
    ):
        content = case.parts.sets.get(set_id)
        yield from content.problems if content else ()


@set_passing(
    lambda: [Example(HEAD + "*INCLUDE\nswitch.k\n" + END, {"switch.k": PARTS + _INNER})]
)
@set_failing(
    lambda: [
        Example(HEAD + "*INCLUDE\nnowhere.k\n" + END),
        Example(HEAD + "*INCLUDE_AUTO_OFFSET\nswitch.k\n" + END),
    ]
)
@make_rule_decorator(
    "D2R003", ERROR, "an include file that is missing or cannot be read", BOTH
)
def _check_includes(case: Case) -> Iterator[PlacedMessage]:
    """d2rpick looks for include files in the folder of the main deck, in the folders of *INCLUDE_PATH and in the folder
    of the including file. For Radioss it follows #include in the same way. d2rpick reports a file that is missing, that
    cannot be read, or that includes itself. The file may contain switching cards, rigid bodies, parts or parameters, so
    the other findings may be incomplete.

    Fix: Add the file, correct its name, or add its folder with *INCLUDE_PATH (LS-DYNA). Then run the check again.
    """
    for missing in case.unread:
        cure = _CURES.get(missing.reason, "correct it")
        if case.solver != LS_DYNA and missing.reason in _CURES:
            cure = "add the file"
        problem = f"include {missing.name.text!r} was not read ({missing.reason})"
        yield (
            missing.name,
            f"{problem}, so its switching cards were not checked; {cure}",
        )


@set_passing(lambda: [Example(HEAD + _PARAMETER + _PARAMETER + _BY_NAME)])
@set_failing(
    lambda: [
        Example(HEAD + _PARAMETER + "*PARAMETER\nR tr           0.03\n" + _BY_NAME)
    ]
)
@make_rule_decorator(
    "D2R109",
    WARNING,
    "a parameter of a card that is defined twice with different values",
)
def _check_parameters(case: Case) -> Iterator[PlacedMessage]:
    """By default LS-DYNA warns and keeps the first definition. *PARAMETER_DUPLICATION and *PARAMETER_MUTABLE change
    this behaviour, and other programs that read decks keep the last definition. A switching time must not depend on
    this choice.

    Fix: Keep one definition of the parameter.
    """
    uses = [
        (card.card, value)
        for card in case.sets
        for value in card.values
        if value.parameters
    ]
    if case.sets:
        uses += [
            (card, value) for card, value in case.end_and_intervals if value.parameters
        ]
    reported: set[tuple[Card, str]] = set()
    for card, value in uses:
        for name in card.scope.closure(value.parameters):
            first, *later_definitions = card.scope.definitions(name) or (None,)
            differing = [
                later
                for later in later_definitions
                if first and later.value != first.value
            ]
            if first and differing and (card, name) not in reported:
                reported.add((card, name))
                later = differing[0]
                first_place = first.place
                problem = f"&{name} is {first.value} at {first_place.at} but {later.value} at {later.place.at}"
                yield (
                    value.field,
                    f"{problem}; the value depends on the program that reads the deck: keep one definition",
                )


@set_passing(lambda: [_make_transformed("1.0"), _make_transformed("0.0")])
@set_failing(lambda: [_make_transformed("0.5")])
@make_rule_decorator(
    "D2R110", WARNING, "a card in a transformed include whose FCTTIM is not 1"
)
def _check_time_factor(case: Case) -> Iterator[PlacedMessage]:
    """*INCLUDE_TRANSFORM multiplies the times of the included file by FCTTIM (0 is read as 1). d2rpick applies this
    factor to the switching times too. No available source confirms that the solver does the same.

    Fix: Move the switching cards to the main deck, where no factor applies.
    """
    for card in case.sets:
        factor = card.card.transform.time
        if factor != 1:
            problem = f"the card is in an include whose times are multiplied by {factor:g} (FCTTIM)"
            why = "whether the solver applies this to switching times is not confirmed"
            yield card.card.here, f"{problem}; {why}: move the card to the main deck"


@set_failing(
    lambda: [
        Example(
            GOOD.replace(
                END, "-----BEGIN PGP MESSAGE-----\nhQEMA\n-----END PGP MESSAGE-----\n"
            )
            + END
        )
    ]
)
@make_rule_decorator(
    "D2R303", INFO, "an encrypted block, which may contain switching cards"
)
def _report_encrypted(case: Case) -> Iterator[PlacedMessage]:
    """Models from vendors may contain encrypted blocks, from BEGIN PGP MESSAGE to END PGP MESSAGE, which only the
    solver can read. d2rpick cannot check switching cards, parts or parameters in such a block.

    Fix: Keep the switching cards outside encrypted blocks, or check the original file before it is encrypted.
    """
    for block in case.deck.encrypted:
        problem = (
            "an encrypted block starts here; switching cards in it were not checked"
        )
        yield CardField("", block, 0, 1), problem


@set_passing(lambda: [Example(GOOD.removesuffix(END))])
@set_failing(
    lambda: [
        Example(GOOD.removesuffix("      PART\n" + END)),
        Example(GOOD.removesuffix(END) + "*NODE\n       1\n"),
    ]
)
@make_rule_decorator(
    "D2R011", WARNING, "a file of the deck that seems to be truncated", BOTH
)
def _check_truncation(case: Case) -> Iterator[PlacedMessage]:
    """A file seems to be truncated if it has no *END (Radioss: /END) and its last line has no line end. A main deck
    without *END whose last lines are nodes or elements may be truncated too. The last number may be incomplete, and
    switching cards, parts or parameters may be missing. The command d2rpick parts computes no cost from a truncated
    mesh.

    Fix: Copy or write the file again. If the file is complete, add *END (Radioss: /END), or end the last line with a
    line break.
    """
    for block, problem in find_cuts(case.deck):
        yield (
            CardField("", block, 0, 1),
            f"{problem} The missing lines were not checked: {describe_cure(block)}",
        )


@set_failing(lambda: [make_deck("*COMMENT c:" + THERE)])
@make_rule_decorator("D2R301", INFO, "a card disabled by *COMMENT")
def _report_disabled(case: Case) -> Iterator[PlacedMessage]:
    """All lines from *COMMENT to the next keyword are a comment, and so is the rest of the keyword line. A switching
    card in this block looks active but has no effect.

    Fix: Remove *COMMENT to activate the card or delete the card.
    """
    for card in case.deck.disabled:
        yield (
            card.here,
            f"the keyword line {card.block.head.strip()!r} is a comment, so this card has no effect",
        )


@set_failing(
    lambda: [
        make_deck(write_automatic_card(1, "0.0", rigid=["1"], code=2)),
        Example("*RIGID_DEFORMABLE_R2D\n         1\n"),
        Example("*DEFORMABLE_TO_RIGID\n         1\n"),
    ]
)
@make_rule_decorator(
    "D2R302",
    INFO,
    "switches whose card gives no time: CODE 1-5, restart cards, plain *DEFORMABLE_TO_RIGID",
    BOTH,
)
def _report_untimed(case: Case) -> Iterator[PlacedMessage]:
    """CODE 1 to 4 switch by the force of a contact or rigid wall, and CODE 5 by a sensor. Restart cards switch when the
    restart begins, and plain cards at the start of the run. A Radioss body may be switched by a sensor other than
    /SENSOR/TIME. No time on such a card can be compared with an energy history. If the history contains the force of
    the contact or wall, d2rpick finds the switching times from this force and judges them. Part momenta are enough if
    the deck has only one contact or wall. d2rpick evaluates a *SENSOR_CONTROL if its *SENSOR_SWITCH depends on the
    time, or on the magnitude of a contact or wall force. It assumes that the parts are rigid while the sensor is on,
    and deformable while it is off; this was not tested with the solver. If you check restarts together with their main
    deck, their switches have times: each restart begins at the ENDTIM of the previous run.

    Fix: To judge the switches, give a history with contact forces or part momenta (--history). Check restarts together
    with their main deck, or switch by time (CODE 0).
    """
    for field, how in case.untimed:
        yield field, f"{how}; not judged by time"
    for card in case.sets:
        reason = _describe_trigger(card) if case.solver == LS_DYNA else ""
        forced = next(
            (switch for switch in case.forced if card.card in switch.cards), None
        )
        sensed = next((sensed for sensed in case.sensed if sensed.by is card), None)
        if reason and forced:
            first = f", first at {forced.times[0][0]:.6g}" if forced.times else ""
            times = f"{forced.switches} times by the {forced.source} of the history"
            yield card.card.here, f"*{card.card.name} {reason}: {times}{first}"
        elif reason and sensed:
            yield (
                card.card.here,
                f"*{card.card.name} {reason}{_describe_course(sensed)}",
            )
        elif reason and _has_judged_end(case, card):
            judged = "its parts are judged by the time at which they deform again"
            yield card.card.here, f"*{card.card.name} {reason}; {judged}"
        elif reason:
            yield card.card.here, f"*{card.card.name} {reason}; not judged by time"


def _has_judged_end(case: Case, card: SwitchSet) -> bool:
    """Return True if a history judges a window that a card opens at the start of the run, because the window ends."""
    return (
        case.judge is not None
        and card.kind == "plain"
        and any(
            window.opened.by is card and window.closed is not None
            for window in case.windows.windows
        )
    )


@set_passing(
    lambda: [
        PASS,
        _make_elements("*ELEMENT_SHELL_COMPOSITE"),
        Example(GOOD.replace(END, "*ELEMENT_SHELL_DOF\n")),
    ]
)
@set_failing(
    lambda: [_make_elements("*ELEMENT_SHELL_DOF"), _make_elements("*ELEMENT_BEAM_PID")]
)
@make_rule_decorator("D2R304", INFO, "elements that are not searched for shared nodes")
def _report_unread_elements(case: Case) -> Iterator[PlacedMessage]:
    """D2R108 searches the elements for nodes that separate rigid bodies share. Some options of element keywords put
    further integers on the element lines. d2rpick does not read such lines, so D2R108 may miss shared nodes.

    Fix: Check yourself that the switched parts share no nodes with the elements of this keyword, or merge the parts
    with LRB.
    """
    switched = {event.unit for event in case.windows.events if event.line.to_rigid}
    if len(switched) < 2:
        return
    first: dict[str, Card] = {}
    for card in find_element_cards(case.deck, searched=False):
        first.setdefault(card.name, card)
    for card in first.values():
        yield (
            card.here,
            f"*{card.name} was not searched for nodes that parts share, because its lines are not read",
        )


@set_failing(lambda: [make_deck(_INERTIA + THERE + BACK), make_deck(_INERTIA)])
@make_rule_decorator(
    "D2R305", INFO, "*DEFORMABLE_TO_RIGID_INERTIA: mass and inertia given for a switch"
)
def _report_inertias(case: Case) -> Iterator[PlacedMessage]:
    """The card replaces the mass properties that the solver computes from the mesh when it makes the part rigid. If the
    card comes from an earlier state of the model, mass and inertia are wrong, and the solver issues no message. Source:
    vendor keyword data.

    Fix: Check that mass, centre and inertia belong to the present mesh, or remove the card.
    """
    rigid_parts = {event.unit.id for event in case.made_rigid}
    unknown = any(event.unit.is_set for event in case.windows.events)
    for card in case.sets:
        if card.kind != "inertia" or card.part is None:
            continue
        part = card.part.value
        if part in rigid_parts or unknown:
            used = ""
        else:
            used = f"; no card of this deck makes part {part} rigid"
        yield (
            card.card.here,
            f"the card replaces mass and inertia of part {part} while it is rigid{used}",
        )


@set_passing(lambda: [Example(THERE + BACK), Example(GOOD, stdin=True)])
@set_failing(lambda: [Example(THERE + BACK, stdin=True)])
@make_rule_decorator(
    "D2R306",
    INFO,
    "switching cards on standard input without parts: ids are not checked",
)
def _report_missing_parts(case: Case) -> Iterator[PlacedMessage]:
    """A file that contains only switching cards is meant to be included in another deck, and d2rpick checks it together
    with that deck. Cards from standard input, as in d2rpick card ... | d2rpick check -, come without a deck, so d2rpick
    cannot check that their parts exist.

    Fix: Paste the cards into the deck, or include them there, and check the main deck.
    """
    if (
        case.deck.path == STDIN
        and case.sets
        and not case.parts.material_by_part
        and case.parts.all_known
    ):
        problem = (
            "the input has no *PART, so the part ids of the cards were not checked"
        )
        yield case.sets[0].card.here, problem


def _describe_course(sensed: Sensed) -> str:
    """Describe when a sensor control is on, or why this is unknown."""
    if sensed.unknown:
        return f", by {sensed.unknown}; not judged by time"
    changes = sensed.changes
    listed = list_names(
        [f"{'on' if change.on else 'off'} at {change.time:.6g}" for change in changes],
        most=_MOST_LISTED,
    )
    return f": {listed}; its parts are assumed to be rigid while it is on, and deformable while it is off"


def _describe_trigger(card: SwitchSet) -> str:
    """Return the trigger of a switching card without a time; empty for other cards and for triggers without effect."""
    if card.restart:
        return ""
    if card.kind == "restart":
        return "acts at the restart, whose time is the end of the run before"
    if card.kind == "plain" and not card.switched and not card.count_problem:
        # This card itself switches nothing, but permits switches in a restart.
        return ""
    if card.kind == "plain":
        return "acts at the start of the run"
    if (
        card.header is None
        or card.header.code.problem
        or card.header.code.value not in _CODES
    ):
        return ""
    return "switches " + _CODES[card.header.code.value].format(card.header.entno.value)
