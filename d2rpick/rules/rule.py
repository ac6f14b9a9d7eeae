"""Define what the ``check`` rules are made of: the `Rule` type, its decorators, and the decks that each rule passes."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

from d2rpick.base.tuples import NamedTuple
from d2rpick.rules.base import LS_DYNA
from d2rpick.rules.example import (
    END,
    HEAD,
    PARTS,
    WINDOW,
    Example,
    make_run,
    write_automatic_card,
    write_engine_files,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    from d2rpick.rules.base import PlacedMessage, Severity

# Cards that make part 1 rigid at 0.02, and deformable at 0.09.
THERE: Final = write_automatic_card(1, "0.02", rigid=["1"])
BACK: Final = write_automatic_card(2, "0.09", deformable=["1"])
# Deck in which no rule finds a problem, and a Radioss run in which none does.
GOOD: Final = HEAD + PARTS + THERE + BACK + END
PASS: Final = Example(GOOD)
GOOD_RUN: Final = make_run(write_engine_files(*WINDOW))


class Rule(NamedTuple):
    """A rule of ``check``: what it finds (``summary``), why this matters (``explanation``), and the ``fix``.

    Explanation and fix are the docstring of ``check``, whose last paragraph begins with ``Fix:``.
    The ``passing`` and ``failing`` decks are both its documentation and its tests. They are written when somebody asks
    for them: to write those of all rules takes 5 % of the time in which a small deck is checked.
    """

    id: str
    severity: Severity
    summary: str
    # Function that finds the problems in a Case, or in a RunCase if the rule applies only to Radioss.
    check: Callable[[Any], Iterable[PlacedMessage]]
    write_passing: Callable[[], Sequence[Example]]
    write_failing: Callable[[], Sequence[Example]]
    solvers: tuple[str, ...] = (LS_DYNA,)

    @property
    def explanation(self) -> str:
        """Return the reason why a problem that this rule finds matters."""
        return self._split_docstring()[0]

    @property
    def fix(self) -> str:
        """Return what to do about a problem that this rule finds."""
        return self._split_docstring()[1]

    @property
    def passing(self) -> tuple[Example, ...]:
        """Return the decks in which the rule finds nothing."""
        return tuple(self.write_passing())

    @property
    def failing(self) -> tuple[Example, ...]:
        """Return the decks in each of which the rule finds a problem."""
        return tuple(self.write_failing())

    def _split_docstring(self) -> tuple[str, str]:
        """Return the explanation and the fix, each in one line."""
        text = " ".join((self.check.__doc__ or "").split())
        explanation, _, fix = text.partition(" Fix: ")
        return explanation, fix


def make_rule_decorator(
    id_: str, severity: Severity, summary: str, solvers: tuple[str, ...] = (LS_DYNA,)
) -> Callable[[Callable[[Any], Iterable[PlacedMessage]]], Rule]:
    """Return a decorator that makes a rule from a function that finds objections in a case."""

    def write_good_deck() -> Sequence[Example]:
        return [PASS if LS_DYNA in solvers else GOOD_RUN]

    def write_nothing() -> Sequence[Example]:
        return []

    def make_rule(check: Callable[[Any], Iterable[PlacedMessage]]) -> Rule:
        return Rule(
            id_, severity, summary, check, write_good_deck, write_nothing, solvers
        )

    return make_rule


def set_passing(
    write_examples: Callable[[], Sequence[Example]],
) -> Callable[[Rule], Rule]:
    """Return a decorator that sets the decks that must pass a rule.

    They replace the default, `PASS` or, for Radioss, `GOOD_RUN`.
    """
    return lambda rule: rule._replace(write_passing=write_examples)


def set_failing(
    write_examples: Callable[[], Sequence[Example]],
) -> Callable[[Rule], Rule]:
    """Return a decorator that sets the decks in which a rule must find a problem."""
    return lambda rule: rule._replace(write_failing=write_examples)
