"""D2R001-003, D2R011, D2R109, D2R110, D2R303: what must be readable before anything can be judged."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from d2rpick.deck.card import Field
from d2rpick.deck.reader import UNKNOWN_KIND, cure, cuts
from d2rpick.deck.switching import misspelt
from d2rpick.rules.base import BOTH, Example, Rule, Severity
from d2rpick.rules.example_decks import BACK, END, GOOD, HEAD, PARTS, THERE, automatic

if TYPE_CHECKING:
    from collections.abc import Iterator

    from d2rpick.deck.card import Card, Problem
    from d2rpick.rules.base import Case, Objection


def _counts(case: Case) -> Iterator[Objection]:
    for card in case.sets:
        if card.count_problem:
            lost = "missing" in card.count_problem
            cure = (
                "write all lines of the card" if lost else "write a line per part, and their count on the second line"
            )
            yield card.card.here, f"{card.count_problem}; {cure}"


def _fields(case: Case) -> Iterator[Objection]:
    for unknown, near in misspelt(case.deck):
        head = unknown.block.head.strip()
        yield unknown.here, f"{head!r} is not a switching keyword, so its lines were not read; did you mean {near}?"
    for card in case.sets:
        for field, problem in card.problems:
            yield field, f"{problem}; check its columns and its parameters"
    if case.sets:
        for field, problem in (*case.parts.problems, *_unreadable_members(case)):
            yield field, f"{problem}; it is needed to know which parts are switched"
        for support, value in case.supporting:
            if value.problem:
                yield value.field, f"{value.problem}; *{support.name} is needed to judge the switching times"


def _unreadable_members(case: Case) -> Iterator[Problem]:
    used = dict.fromkeys(line.part.value for card in case.sets for line in card.switched if line.by_set)
    for set_id in dict.fromkeys(reached for one in used for reached in case.parts.reached(one)):
        content = case.parts.sets.get(set_id)
        yield from content.problems if content else ()


_CURES: Final = {
    "no such file": "add the file or its *INCLUDE_PATH",
    UNKNOWN_KIND: "check that file separately",
}


def _includes(case: Case) -> Iterator[Objection]:
    for missing in case.unread:
        cure = _CURES.get(missing.reason, "correct it")
        found = f"include {missing.name.text!r} was not read ({missing.reason})"
        yield missing.name, f"{found}; switching cards may hide in it: {cure}"


def _ambiguous(case: Case) -> Iterator[Objection]:
    uses = [(card.card, value) for card in case.sets for value in card.values if value.parameters]
    if case.sets:
        uses += [(card, value) for card, value in case.supporting if value.parameters]
    seen: set[tuple[Card, str]] = set()
    for card, value in uses:
        for name in card.scope.closure(value.parameters):
            first, *others = card.scope.definitions(name) or (None,)
            differing = [other for other in others if other and first and other.value != first.value]
            if first and differing and (card, name) not in seen:
                seen.add((card, name))
                other, place = differing[0], first.place
                yield (
                    value.field,
                    (
                        f"parameter &{name} is {first.value} at {place.file}:{place.line} but {other.value} at "
                        f"{other.place.file}:{other.place.line}; which one counts depends on the solver: keep one"
                    ),
                )


def _scaled(case: Case) -> Iterator[Objection]:
    for card in case.sets:
        factor = card.card.transform.time
        if factor != 1:
            yield (
                card.card.here,
                (
                    f"the card is in an include whose times are multiplied by {factor:g} (FCTTIM); that "
                    "this holds for switching times is not confirmed: move the card to the main deck"
                ),
            )


def _encrypted(case: Case) -> Iterator[Objection]:
    for block in case.deck.encrypted:
        place = Field("", block, 0, 1)
        yield (
            place,
            "an encrypted block starts here; switching cards may hide in it, nothing in it was checked",
        )


def _cut(case: Case) -> Iterator[Objection]:
    for block, told in cuts(case.deck):
        yield Field("", block, 0, 1), f"{told} What is missing was not checked: {cure(block)}"


_INNER = THERE + BACK + END


def _transformed(factor: str) -> Example:
    include = f"*INCLUDE_TRANSFORM\nswitch.k\n{'0':>10s}\n{'0':>10s}\n{'1.0':>10s}{factor:>10s}\n{'0':>10s}\n"
    return Example(HEAD + PARTS + include + END, {"switch.k": _INNER})


_PARAMETER = "*PARAMETER\nR tr           0.02\n"
_BY_NAME = PARTS + automatic(1, "&tr", rigid=["1"]) + BACK + END

RULES: Final = (
    Rule(
        "D2R001",
        Severity.ERROR,
        "the rows after a card do not match its D2R/R2D counts",
        "The second line of *DEFORMABLE_TO_RIGID_AUTOMATIC counts the D2R and R2D lines that follow it, "
        "one per part. With wrong counts the solver reads a part from the wrong line, or a line as the "
        "next card. A card whose counts are both 0 switches nothing. A line that is missing is named: the solver takes "
        "the next one in its place.",
        _counts,
        (Example(GOOD),),
        (
            Example(HEAD + PARTS + automatic(1, "0.02", rigid=["1"], counts=(2, 0)) + BACK + END),
            Example("*DEFORMABLE_TO_RIGID_AUTOMATIC\n         1\n"),
            Example(HEAD + PARTS + automatic(1, "0.02", rigid=["1"], counts=(2, -1)) + BACK + END),
            Example(HEAD + PARTS + automatic(1, "0.02") + END),
            Example(HEAD + PARTS + "\n".join(THERE.split("\n")[:3] + THERE.split("\n")[5:]) + BACK + END),
            Example(HEAD + PARTS + "\n".join(THERE.split("\n")[:5]) + "\n" + BACK + END),
            Example("*DEFORMABLE_TO_RIGID_INERTIA\n         1\n"),
        ),
    ),
    Rule(
        "D2R002",
        Severity.ERROR,
        "a switching keyword, number or &parameter that cannot be read",
        "Fields are 10 columns wide (20 in long format) unless the line has commas. A text in a number's "
        "columns, or an undefined parameter, stops the run or, worse, is read as something else. "
        "So is a keyword that begins like a switching card but is not one. "
        "ENDTIM and the DT of *DATABASE_GLSTAT and _MATSUM are looked at too: the switching times are "
        "judged by them.",
        _fields,
        (Example(GOOD), Example(HEAD + _PARAMETER + _BY_NAME)),
        (
            Example(HEAD + _BY_NAME),
            Example("*DEFORMABLE_TO_RIGID\n         ?\n"),
            Example(HEAD + PARTS + automatic(0, "0.02", rigid=["1"]) + END),
            Example(GOOD.replace("      0.02       0.0", "    0.0135867    0.0")),
            Example("*SET_PART\n         3\n     &door\n*DEFORMABLE_TO_RIGID\n         3         0      PSET\n"),
            Example(GOOD.replace("         2         1         1", "       abc         1         1")),
            Example(HEAD + "*INCLUDE_TRANSFORM\nall.k\n" + f"{'&off':>30s}\n", {"all.k": PARTS + THERE + BACK}),
            Example(GOOD.replace("_AUTOMATIC", "_AUTOMATC")),
            Example(GOOD.replace("*DEFORM", "* DEFORM")),
            Example("*DEFORMABLE_TO_RIGID\n         1         0      WALL\n"),
        ),
        solvers=BOTH,
    ),
    Rule(
        "D2R003",
        Severity.ERROR,
        "an include file is missing or cannot be read",
        "Looked for in the main deck's folder, in the *INCLUDE_PATH folders and in the including file's "
        "folder. A file that includes itself or cannot be read is reported too; one that a Radioss starter deck "
        "asks for, only where a main node that is switched was not found without it. Switching cards, parts or "
        "parameters may be in it, so the other findings may be incomplete.",
        _includes,
        (Example(HEAD + "*INCLUDE\nswitch.k\n" + END, {"switch.k": PARTS + _INNER}),),
        (Example(HEAD + "*INCLUDE\nnowhere.k\n" + END), Example(HEAD + "*INCLUDE_AUTO_OFFSET\nswitch.k\n" + END)),
        solvers=BOTH,
    ),
    Rule(
        "D2R011",
        Severity.WARNING,
        "a file of the deck seems to be cut",
        "A file without *END (Radioss: /END) whose last line has no line end may have lost the end of a number, and "
        "all that came after it; so may a main deck without *END whose last lines are nodes or elements. Switching "
        "cards, parts or parameters may be missing. d2rpick parts computes no cost from a mesh that is cut.",
        _cut,
        (Example(GOOD.removesuffix(END)),),
        (Example(GOOD.removesuffix("      PART\n" + END)), Example(GOOD.removesuffix(END) + "*NODE\n       1\n")),
        solvers=BOTH,
    ),
    Rule(
        "D2R109",
        Severity.WARNING,
        "a parameter used by a card is defined twice with different values",
        "LS-DYNA by default warns and keeps the first definition; *PARAMETER_DUPLICATION and _MUTABLE "
        "change that, and other readers of decks keep the last. A switching time should not depend on it.",
        _ambiguous,
        (Example(HEAD + _PARAMETER + _PARAMETER + _BY_NAME),),
        (Example(HEAD + _PARAMETER + "*PARAMETER\nR tr           0.03\n" + _BY_NAME),),
    ),
    Rule(
        "D2R110",
        Severity.WARNING,
        "the card is in a transformed include whose FCTTIM is not 1",
        "*INCLUDE_TRANSFORM multiplies the times of a file by FCTTIM (0 means 1). d2rpick applies it to the "
        "switching times too, but whether the solver does is not confirmed by any source that was available.",
        _scaled,
        (_transformed("1.0"), _transformed("0.0")),
        (_transformed("0.5"),),
    ),
    Rule(
        "D2R303",
        Severity.INFO,
        "encrypted block: cards may hide in it",
        "Vendor models hold blocks between BEGIN PGP MESSAGE and END PGP MESSAGE that only the solver can read.",
        _encrypted,
        (Example(GOOD),),
        (Example(GOOD.replace(END, "-----BEGIN PGP MESSAGE-----\nhQEMA\n-----END PGP MESSAGE-----\n") + END),),
    ),
)
