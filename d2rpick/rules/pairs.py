"""D2R004-006: switch sets among each other."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from d2rpick.deck.switching import BY_TIME
from d2rpick.rules.base import Example, Rule, Severity
from d2rpick.rules.example_decks import BACK, END, GOOD, HEAD, PARTS, THERE, automatic

if TYPE_CHECKING:
    from collections.abc import Iterator

    from d2rpick.deck.switching import Header, SwitchSet
    from d2rpick.deck.windows import Unit
    from d2rpick.rules.base import Case, Objection

_FAMILIES: Final = ({1, 3}, {2, 4})  # rigid wall, contact
_WITHOUT_FORCE, _WITH_FORCE = {1, 2}, {3, 4}


def _headers(case: Case) -> list[tuple[SwitchSet, Header]]:
    return [(card, card.header) for card in case.sets if card.header is not None]


def _unique(case: Case) -> Iterator[Objection]:
    first: dict[int, Header] = {}
    for _, header in _headers(case):
        if header.swset.problem:
            continue
        known = first.setdefault(header.swset.value, header)
        if known is not header:
            place = known.swset.field
            yield (
                header.swset.field,
                (f"SWSET {header.swset.value} is already used at {place.file}:{place.line}; give every set its own id"),
            )


def _mutual(case: Case) -> Iterator[Objection]:
    headers = _headers(case)
    by_id = {header.swset.value: (card, header) for card, header in reversed(headers)}
    for card, header in headers:
        problem = _alone(header)
        partner = by_id.get(header.relsw.value)
        if not problem and header.relsw.value and partner is None and not case.deck.unread:
            problem = f"RELSW names set {header.relsw.value}, which no card defines"
        if not problem and header.relsw.value and partner is not None:
            first = header.swset.value < partner[1].swset.value  # what both share is said once, at one of them
            problem = _one_sided(header, partner[1]) or (_mismatch((card, header), partner) if first else "")
        if problem:
            yield header.relsw.field, f"{problem}; check RELSW, PAIRED and CODE of both sets"
    for header, problem in _swapped(case):
        yield header.code.field, f"{problem}; exchange the CODEs", Severity.ERROR


def _swapped(case: Case) -> Iterator[tuple[Header, str]]:
    """Sets that make the same parts rigid under a force and deformable without one, paired or not."""
    rigid = [(card, header) for card, header in _headers(case) if header.code.value in _WITH_FORCE]
    back = [(card, header) for card, header in _headers(case) if header.code.value in _WITHOUT_FORCE]
    for there, header in rigid:
        for again, other in back:
            family = {header.code.value, other.code.value} in _FAMILIES
            if family and _units(case, there, to_rigid=True) & _units(case, again, to_rigid=False):
                ids = f"sets {header.swset.value} and {other.swset.value}"
                yield (
                    header,
                    (
                        f"{ids} make parts rigid while there is a force and deformable while there is none, rigid in "
                        "the impact and deformable in flight: the CODEs seem to be swapped"
                    ),
                )
                break


def _units(case: Case, card: SwitchSet, *, to_rigid: bool) -> set[Unit]:
    return {event.unit for event in case.windows.events if event.by is card and event.line.to_rigid == to_rigid}


def _alone(header: Header) -> str:
    relsw, paired = header.relsw.value, header.paired.value
    if relsw and not paired:
        return f"RELSW names set {relsw} but PAIRED is 0"
    if paired and not relsw:
        return f"PAIRED is {paired} but RELSW names no set"
    return f"PAIRED is {paired}" if paired not in {-1, 0, 1} else ""


def _one_sided(header: Header, partner: Header) -> str:
    if partner.relsw.value == header.swset.value and partner is not header:
        return ""
    return f"RELSW names set {header.relsw.value}, which names set {partner.relsw.value}"


def _mismatch(one: tuple[SwitchSet, Header], other: tuple[SwitchSet, Header]) -> str:
    """Say what is wrong with a mutual pair: signs, or families of CODEs."""
    headers = one[1], other[1]
    ids = f"sets {headers[0].swset.value} and {headers[1].swset.value}"
    if headers[0].paired.value == headers[1].paired.value:
        return f"{ids} both have PAIRED {headers[0].paired.value}"
    codes = [header.code.value for header in headers]
    if any(codes) and not any(set(codes) <= family for family in _FAMILIES):
        return f"{ids} have CODE {codes[0]} and {codes[1]}, one of 1 and 3 or of 2 and 4 was expected"
    return ""


def _timed_pair(case: Case) -> Iterator[Objection]:
    for _, header in _headers(case):
        if header.paired.value and header.code.value == BY_TIME and not header.code.problem:
            yield (
                header.paired.field,
                (
                    f"PAIRED is {header.paired.value} with CODE 0; a pair alternates by force, a switch by "
                    "time needs none: set PAIRED and RELSW to 0"
                ),
            )


def _pair(codes: tuple[int, int], signs: tuple[int, int] = (1, -1), back: int = 1) -> Example:
    there = automatic(1, "0.0", rigid=["1"], code=codes[0], pair=(2, signs[0]))
    again = automatic(2, "0.0", deformable=["1"], code=codes[1], pair=(back, signs[1]))
    return Example(HEAD + PARTS + there + again + END)


RULES: Final = (
    Rule(
        "D2R004",
        Severity.ERROR,
        "SWSET used twice",
        "Every *DEFORMABLE_TO_RIGID_AUTOMATIC is a switch set with an id of its own; RELSW refers to it.",
        _unique,
        (Example(GOOD),),
        (Example(HEAD + PARTS + THERE + automatic(1, "0.09", deformable=["1"]) + END),),
    ),
    Rule(
        "D2R005",
        Severity.WARNING,
        "RELSW/PAIRED not mutual, not of opposite sign, or CODEs of different families",
        "Paired sets alternate as a contact or wall force comes and goes: each names the other in RELSW, "
        "PAIRED is 1 for the one that acts first and -1 for the other, and their CODEs are 1 and 3 (wall) "
        "or 2 and 4 (contact). Sets, paired or not, that are rigid under force (CODE 3 or 4 on the D2R side, 1 or 2 "
        "on the other) are the wrong way round, rigid during the impact and deformable in flight: that finding is an "
        "error. Source: vendor keyword data for the codes; a public drop tool wrote decks with 2 and 4 exchanged "
        "for months.",
        _mutual,
        (_pair((2, 4)), _pair((1, 3))),
        (_pair((2, 4), back=7), _pair((2, 4), signs=(1, 1)), _pair((1, 4))),
    ),
    Rule(
        "D2R006",
        Severity.WARNING,
        "PAIRED together with CODE 0",
        "For one window by time two unpaired sets are enough.",
        _timed_pair,
        (Example(GOOD), _pair((2, 4))),
        (Example(HEAD + PARTS + automatic(1, "0.02", rigid=["1"], pair=(2, 1)) + BACK + END),),
    ),
)
