"""Define what the ``check`` rules are made of: the `Rule` type, its decorators, and deck fragments for examples."""

from __future__ import annotations

from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Final

from d2rpick.base.tuples import NamedTuple
from d2rpick.deck.ls_dyna_columns import (
    SWITCH_COUNTS,
    SWITCH_TIMES,
    TO_DEFORMABLE,
    TO_RIGID,
)
from d2rpick.rules.base import LS_DYNA

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping, Sequence

    from d2rpick.rules.base import Objection, Severity


MAIN_DECK: Final = "main.k"  # Default file name of an example deck.

HEAD = """\
*KEYWORD
*CONTROL_TERMINATION
       0.2
*DATABASE_GLSTAT
    0.0001
*DATABASE_MATSUM
    0.0001
"""
PARTS = """\
*PART
door
         1         1         1
*PART
frame
         2         1         1
"""
END = "*END\n"
GROUP: Final = "/GRNOD/PART/7\nbox\n         1\n"
_SHELL: Final = "/SHELL/1\n         1         1         2         3         4\n"
_BODY: Final = "/RBODY/1\nbox\n      1808         0         0         0                   0         7\n"
WINDOW: Final = (("0.02", "OFF"), ("0.09", "ON"), ("0.2", "OFF"))


class Example(NamedTuple):
    """An example deck called ``name``, with the files that it includes or that belong to the same run.

    ``history`` contains the arguments with which ``d2rpick replay``, or the command ``computed_by``, writes the energy
    history for the check. ``options`` contains further arguments of ``d2rpick check``. If ``stdin`` is True, the deck
    is read from standard input.
    """

    deck: str
    files: Mapping[str, str] = MappingProxyType({})
    history: str = ""
    options: str = ""
    stdin: bool = False
    name: str = MAIN_DECK
    computed_by: str = "replay"


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
    check: Callable[[Any], Iterable[Objection]]
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


# The code below builds fragments of LS-DYNA decks and Radioss runs for the examples.


def write_automatic_card(
    swset: int,
    time1: str,
    *,
    rigid: Sequence[str] = (),
    deformable: Sequence[str] = (),
    code: int = 0,
    pair: tuple[int, int] = (0, 0),
    counts: tuple[int, int] | None = None,
    delay: str = "0.0",
    contact: int = 0,
) -> str:
    """Return a *DEFORMABLE_TO_RIGID_AUTOMATIC card.

    ``pair`` contains RELSW and PAIRED. ``counts`` contains D2R and R2D for an example with wrong counts. ``delay`` is
    TIME3, and ``contact`` is ENTNO.
    """
    d2r, r2d = counts or (len(rigid), len(deformable))
    relsw, paired = pair
    lines = [
        "*DEFORMABLE_TO_RIGID_AUTOMATIC",
        "$    swset      code     time1     time2     time3     entno     relsw    paired",
        SWITCH_TIMES.write(
            SWSET=swset,
            CODE=code,
            TIME1=time1,
            TIME3=delay,
            ENTNO=contact,
            RELSW=relsw,
            PAIRED=paired,
        ),
        "$     nrbf      ncsf       rwf     dtmax       d2r       r2d    offset",
        SWITCH_COUNTS.write(RWF=0, D2R=d2r, R2D=r2d),
        *(
            TO_RIGID.write(PID=line, PTYPE="PART") if len(line) <= 10 else line
            for line in rigid
        ),
        *(TO_DEFORMABLE.write(PID=line, PTYPE="PART") for line in deformable),
    ]
    return "\n".join(lines) + "\n"


THERE = write_automatic_card(1, "0.02", rigid=["1"])
BACK = write_automatic_card(2, "0.09", deformable=["1"])
GOOD = HEAD + PARTS + THERE + BACK + END


def make_deck(*cards: str) -> Example:
    """Return an example deck with two parts and the given cards."""
    return Example(HEAD + PARTS + "".join(cards) + END)


def make_window(tr: str, td: str, more: str = "") -> Example:
    """Return a deck that makes part 1 rigid at ``tr`` and deformable at ``td``, followed by the cards ``more``."""
    return make_deck(
        write_automatic_card(1, tr, rigid=["1"]),
        write_automatic_card(2, td, deformable=["1"]),
        more,
    )


PASS = Example(GOOD)


def write_starter_deck(group: str = GROUP, more: str = "") -> str:
    """Return a starter deck with one part that is a rigid body on a node group, followed by the text ``more``."""
    head = "#RADIOSS STARTER\n/BEGIN\nbox\n      2022         0\n/TITLE\na box\n/PART/1\nbox\n         1         1\n"
    return f"{head}{_SHELL}{_BODY}{group}{more}/END\n"


def write_engine_files(
    *legs: tuple[str, str], cap: str = "1e-5 1e-5", node: str = "1808"
) -> dict[str, str]:
    """Return engine files with the given end times and /RBODY cards (ON, OFF or none), by file name."""
    files = {}
    for number, (stop, state) in enumerate(legs, start=1):
        limit = f"/DTIX\n{cap}\n" if state == "ON" and cap else ""
        switch = f"/RBODY/{state}\n{node}\n" if state else ""
        files[f"box_{number:04d}.rad"] = (
            f"/RUN/box/{number}\n{stop:>20}\n/VERS/2022\n{switch}{limit}"
        )
    return files


def make_run(files: dict[str, str], deck: str = "") -> Example:
    """Return an example that consists of a starter deck and its engine files."""
    return Example(deck or write_starter_deck(), files, name="box_0000.rad")


GOOD_RUN: Final = make_run(write_engine_files(*WINDOW))


def make_rule_decorator(
    id_: str, severity: Severity, summary: str, solvers: tuple[str, ...] = (LS_DYNA,)
) -> Callable[[Callable[[Any], Iterable[Objection]]], Rule]:
    """Return a decorator that makes a rule from a function that finds objections in a case."""

    def write_good_deck() -> Sequence[Example]:
        return [PASS if LS_DYNA in solvers else GOOD_RUN]

    def write_nothing() -> Sequence[Example]:
        return []

    def make_rule(check: Callable[[Any], Iterable[Objection]]) -> Rule:
        return Rule(
            id_, severity, summary, check, write_good_deck, write_nothing, solvers
        )

    return make_rule


def set_passing(
    write_examples: Callable[[], Sequence[Example]],
) -> Callable[[Rule], Rule]:
    """Return a decorator that sets the decks that must pass a rule; default: `GOOD`, or `GOOD_RUN` for Radioss."""
    return lambda rule: rule._replace(write_passing=write_examples)


def set_failing(
    write_examples: Callable[[], Sequence[Example]],
) -> Callable[[Rule], Rule]:
    """Return a decorator that sets the decks in which a rule must find a problem."""
    return lambda rule: rule._replace(write_failing=write_examples)
