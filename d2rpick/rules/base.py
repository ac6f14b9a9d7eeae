"""What every rule of ``check`` is made of: a case to look at, a rule with its examples, and findings."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import StrEnum
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple, Protocol

from d2rpick.deck import Deck, Parts, SwitchSet, Window, Windows, find_windows, read_parts, read_switching
from d2rpick.deck.sections import NOT_TURNED, solid_formulations

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Iterable, Mapping, Sequence

    from d2rpick.deck.card import Card, Field, Value
    from d2rpick.deck.reader import Unread


LS_DYNA, RADIOSS = "ls-dyna", "radioss"
BOTH = (LS_DYNA, RADIOSS)


class Fault(NamedTuple):
    """What an energy history has against a window: the rule it belongs to, at which end, and why."""

    rule: str
    at_td: bool
    message: str


class Judge(Protocol):
    """Judges windows by an energy history."""

    @property
    def end(self) -> float:
        """Last time of the history."""

    def faults(self, window: Window, together: Iterable[int]) -> Sequence[Fault]:
        """Everything that speaks against a window; nothing when it is a good one."""

    def deforming(self, parts: Collection[int]) -> tuple[int, ...] | None:
        """Those of some parts that ever have internal energy; None where that is not known."""


class Severity(StrEnum):
    """How much a finding weighs; ``error`` is an objection."""

    ERROR = "error"
    WARNING = "warning"
    INFO = "info"

    @property
    def rank(self) -> int:
        """Return 0 for an error, more for less."""
        return list(Severity).index(self)


@dataclass(frozen=True)
class Finding:
    """One thing wrong with a deck: ``deck`` is the deck that was checked, ``file`` the file it stands in."""

    rule: str
    severity: Severity
    message: str
    deck: str
    file: str
    line: int
    column: int


@dataclass(frozen=True)
class Unreadable:
    """A deck that could not be checked, and why; ``code`` is that of the warning that tells it."""

    deck: str
    reason: str
    code: str = "unreadable-deck"


@dataclass(frozen=True, eq=False)
class Case:
    """A deck as the rules see it; ``judge`` is given when there is an energy history to judge windows by."""

    deck: Deck
    judge: Judge | None = None

    @property
    def solver(self) -> str:
        """Whose deck it is."""
        return LS_DYNA

    @cached_property
    def parts(self) -> Parts:
        """Parts, part sets, rigid materials."""
        return read_parts(self.deck)

    @cached_property
    def sets(self) -> tuple[SwitchSet, ...]:
        """All switching cards."""
        return read_switching(self.deck)

    @cached_property
    def windows(self) -> Windows:
        """The switching windows of every part."""
        return find_windows(self.sets, self.parts)

    @cached_property
    def end_time(self) -> Value[float] | None:
        """ENDTIM as written; of several the last counts."""
        return next((value for card, value in self.supporting if card.name == "CONTROL_TERMINATION"), None)

    @cached_property
    def end(self) -> float | None:
        """ENDTIM [time of the deck], where it is known and positive."""
        cards = self.deck.named("CONTROL_TERMINATION")
        if self.end_time is None or self.end_time.problem or not self.end_time.value > 0:
            return None
        return self.end_time.value * cards[-1].transform.time

    @cached_property
    def unread(self) -> Sequence[Unread]:
        """Includes that were not read and may hold what is switched."""
        return self.deck.unread

    @cached_property
    def untimed(self) -> tuple[tuple[Field, str], ...]:
        """Cards that no clock switches, and what does."""
        return ()

    @cached_property
    def unturned(self) -> Mapping[int, str]:
        """Parts of solids whose stresses do not turn with a rigid body, and their formulation."""
        forms = solid_formulations(self.deck, self.parts)
        return {part: f"ELFORM {form}, {NOT_TURNED[form]}" for part, form in forms.items() if form in NOT_TURNED}

    @cached_property
    def supporting(self) -> tuple[tuple[Card, Value[float]], ...]:
        """Numbers of other cards that the rules rely on: ENDTIM, and DT of the energy databases."""
        names = ("CONTROL_TERMINATION", "DATABASE_GLSTAT", "DATABASE_MATSUM")
        cards = [card for name in names for card in self.deck.named(name)[-1:] if card.rows]
        return tuple((card, card.real(card.rows[0], 0)) for card in cards)


Objection = tuple["Field", str] | tuple["Field", str, Severity]
"""Where, what is wrong there, and how much it weighs where that is more than the rule says."""


@dataclass(frozen=True)
class Example:
    """A deck, and the files it includes, or that belong to it, by name; ``name`` is that of the deck itself.

    ``history`` are arguments of ``d2rpick replay`` that write the energy history it is checked with, ``options``
    further ones of ``d2rpick check``.  ``stdin`` tells that it is read from standard input.
    """

    deck: str
    files: Mapping[str, str] = field(default_factory=dict)
    history: str = ""
    options: str = ""
    stdin: bool = False
    name: str = "main.k"


@dataclass(frozen=True)
class Rule:
    """A rule: ``passing`` and ``failing`` decks are its documentation and its tests at once."""

    id: str
    severity: Severity
    summary: str
    explanation: str
    check: Callable[[Case], Iterable[Objection]]
    passing: tuple[Example, ...]
    failing: tuple[Example, ...]
    solvers: tuple[str, ...] = (LS_DYNA,)  # whose decks it looks at
