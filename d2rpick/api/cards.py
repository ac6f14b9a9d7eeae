"""Define the options of a card, and fill in missing ones from the run and its deck."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any, Final

from d2rpick.api.request import OPTIONS
from d2rpick.base.data_classes import dataclass
from d2rpick.base.errors import ArgumentError, DeckError, list_names
from d2rpick.base.options import (
    POSITIVE,
    TIME,
    UNLIMITED,
    Option,
    list_options,
    make_option,
    make_option_name,
)
from d2rpick.deck.beside import SOME_NODES, SOME_PARTS, find_run_name

if TYPE_CHECKING:
    from collections.abc import Sequence
    from typing import TypedDict

    from d2rpick.api.arguments import Parts, Time
    from d2rpick.api.asked import RunQuestion
    from d2rpick.api.choosing import JudgingOptions
    from d2rpick.api.runs import Run
    from d2rpick.deck.printed_card import CardSolver as Module, Printing
    from d2rpick.flight.position_error import RigidBody

# This pattern is compiled at its first use, to keep start-up fast.
_RANGE: Final = r"(\d{1,10})(?:\s*-\s*(\d{1,10}))?"
_MOST_IDS: Final = 100_000
# Largest number of main nodes of a deck that are named in a message.
_MOST_NODES: Final = 8
_IDS: Final = range(1, UNLIMITED)


if TYPE_CHECKING:

    class CardOptions(TypedDict, total=False):
        """Options of a card.

        ``solver`` is ``"ls-dyna"``, ``"radioss"`` or ``"radioss-sensors"``; the default is the solver that wrote the
        history. With the id of a ``contact`` or ``wall``, it may also be ``"ls-dyna-contact"`` or
        ``"radioss-contact"``. ``step_cap`` is the largest time step while the parts are rigid. For LS-DYNA, ``merge``
        is the lead part into which all others are merged, and ``swset`` contains the ids of the two switch sets of the
        first window. For Radioss, ``node`` contains the main nodes of the rigid bodies; ``end`` and ``name`` are those
        of the run.
        """

        solver: str | None
        merge: int | None
        swset: tuple[int, int] | None
        step_cap: float | None
        node: Parts | None
        end: Time | None
        name: str | None
        contact: int | None
        wall: int | None

    class Judging(CardOptions, JudgingOptions, total=False):
        """Options of a card, together with the options that determine how its windows are judged."""


def _check_option(name: str, value: Any, option: Option) -> Any:
    """Return a value converted to the type of its option. Only the code that prints cards knows the solvers."""
    from d2rpick.api import arguments

    if option.kind == "solver":
        option = option._replace(kind=tuple(list_solvers()))
    return arguments.check_option(name, value, option)


def list_solvers() -> Sequence[str]:
    """Return the names of the solvers for which d2rpick can print input."""
    from d2rpick.deck.printing import SOLVERS  # Imported here to keep start-up fast.

    return tuple(SOLVERS)


def explain_unknown_solver(name: object) -> str:
    """Return the message about a name that is not a solver, with the most similar name of a solver."""
    from d2rpick.histories.names import suggest_name

    solvers = list_solvers()
    near = suggest_name(str(name), solvers)
    return f"{name!r} was found{near}, but one of {', '.join(solvers)} was expected"


@dataclass(eq=False, repr=False)
class Cards:
    """Options that are common to all commands that print a card."""

    solver: str | None = make_option(
        "Solver whose input is printed.  [default: solver that wrote the history, else ls-dyna]",
        "solver",
    )
    merge: int | None = make_option(
        "LS-DYNA: lead part into which all others are merged (LRB).", _IDS, "ID"
    )
    swset: tuple[int, int] | None = make_option(
        "LS-DYNA: switch sets of the first window; further windows use the next ids.  [default: 901 902]",
        _IDS,
        "ID ID",
        pair=True,
    )
    step_cap: float | None = make_option(
        "Largest time step while the parts are rigid (DTMAX, /DTIX).", POSITIVE, "DT"
    )
    node: tuple[str, ...] = make_option(
        "Radioss: main nodes of the rigid bodies.", "names", "IDS", many=True
    )
    end: float | None = make_option(
        "Radioss: end of the run.  [default: end of the history]", TIME, "T"
    )
    name: str | None = make_option(
        "Radioss: name of the run if neither deck nor history gives it.  [default: Root]",
        metavar="NAME",
    )
    contact: int | None = make_option(
        "Contact whose force triggers the switch (solvers ls-dyna-contact, radioss-contact).",
        _IDS,
        "ID",
    )
    wall: int | None = make_option(
        "Rigid wall whose force triggers the switch (solvers ls-dyna-contact, radioss-contact).",
        _IDS,
        "ID",
    )

    @classmethod
    def of(cls, arguments_of_card: CardOptions) -> Cards:
        """Check the arguments of a Python call; raise TypeError or ValueError for a wrong argument."""
        from d2rpick.api import arguments

        known_options = list_options(Cards)
        if unknown := [name for name in arguments_of_card if name not in known_options]:
            arguments.refuse_unknown(unknown[0], known_options)
        return cls(
            **{
                name: _check_option(name, option_value, known_options[name])
                for name, option_value in arguments_of_card.items()
                if option_value is not None
            }
        )

    @classmethod
    def for_run(cls, run: Run, options: CardOptions) -> Cards:
        """Check the arguments of a Python call; times with a unit are converted to the unit of the run."""
        # Imported here to keep start-up fast.
        from d2rpick.api.times import TimeArguments

        times = TimeArguments.of_run(run)
        return cls.of(times.convert_options(options, list_options(Cards)))  # type: ignore[arg-type]  # the keys are the options of a card

    @property
    def given(self) -> list[str]:
        """Names of the options that were given, except the solver."""
        return [
            name
            for name in list_options(Cards)
            if name != "solver" and getattr(self, name) not in (None, ())
        ]

    def replace_in(self, printing: Printing, parts: Sequence[int]) -> Printing:
        """Return the options of the card, with the parts to switch if any are given."""
        values = {name: getattr(self, name) for name in self.given}
        if self.node:
            values["node"] = tuple(parse_id_ranges("--node", self.node))
        solver = self.solver or printing.solver
        return printing._replace(solver=solver, part=tuple(parts), **values)

    def check_solver(self, solver: str) -> None:
        """Refuse options that have no equivalent in the input of ``solver``."""
        from d2rpick.deck.printing import SOLVERS

        options_by_solver = {
            name: {solver_or_input.switches, *solver_or_input.takes}
            for name, solver_or_input in SOLVERS.items()
        }
        for name in self.given:
            if name not in options_by_solver[solver]:
                owner = next(
                    solver_or_input
                    for solver_or_input, takes in options_by_solver.items()
                    if name in takes
                )
                if self.solver:
                    hint = ""
                else:
                    hint = f"; without `solver` the card is one for {SOLVERS[solver].title}"
                raise ArgumentError(f"`{name}` is an option of `solver` {owner}{hint}")

    def complete(self, question: RunQuestion) -> tuple[Printing, tuple[str, ...]]:
        """Complete the options of a card with values from the deck of the run.

        Notes list the rigid bodies that are missing in the deck.

        Raises
        ------
        DeckError
            If the deck cannot be read, or if its rigid bodies cannot switch the parts.
        ArgumentError
            If an option does not apply to the input of the solver.
        """
        from d2rpick.deck.printing import find_solver

        printing, notes = self._suit_question(question)
        history_format = question.reference.history.format
        self.check_solver(printing.solver or find_solver(history_format))
        return printing, notes

    def _suit_question(self, question: RunQuestion) -> tuple[Printing, tuple[str, ...]]:
        """Return the options of a card, completed with what the deck of the run requires of it, with notes."""
        from d2rpick.deck.printed_card import Printing

        on_card = parse_id_ranges("--part", question.on_card)
        if question.deck is None:
            name = find_run_name(question.reference.history.source)
            printing = Printing()
            printing = printing._replace(name=name or printing.name)
            return self.replace_in(printing, on_card), ()
        history_parts = question.reference.history.parts or ()
        parts = on_card or [part.id for part in history_parts]
        bodies = find_bodies_on_card(question, parts) or ()
        printing, notes = self.suit_deck(question.deck, parts, bodies)
        return self.replace_in(printing, on_card), notes

    def suit_deck(
        self, deck: str, parts: Sequence[int], bodies: Sequence[RigidBody]
    ) -> tuple[Printing, tuple[str, ...]]:
        """Return what a deck requires of a card that switches ``parts``, with notes on missing rigid bodies.

        The deck defines the solver, the name and end of the run, free ids, the constraints that have to be deleted, and
        the rigid bodies that switch the parts. The parts become the rigid ``bodies``, unless the card merges all parts.
        """
        from d2rpick.deck.printed_card import Printing
        from d2rpick.deck.printing import SOLVERS
        from d2rpick.deck.suiting import find_suiting

        joined = [body.parts for body in bodies]
        if self.merge is not None:
            joined = [(*parts, self.merge)]
        suiting = find_suiting(deck, parts, joined)
        solver = self.solver or suiting.solver
        printing = Printing(solver=solver)
        if SOLVERS[solver].title != SOLVERS[suiting.solver].title:
            return printing, ()
        if suiting.solver == "ls-dyna":
            return printing._replace(
                swset=suiting.swset or printing.swset,
                delete_nodal_bodies=suiting.delete_nodal_bodies,
                delete_node_sets=suiting.delete_node_sets,
                parting=suiting.parting,
                kept_joints=suiting.kept_joints,
            ), ()
        name = suiting.name or printing.name
        printing = printing._replace(name=name, end=suiting.end)
        if self.node:
            self._refuse_unknown_nodes(deck)
        if not parts or self.node:
            return printing, ()
        from d2rpick.deck.radioss_bodies import find_bodies

        found = find_bodies(deck, parts)
        return printing._replace(
            node=tuple(found.nodes),
            replaced=found.replaced,
            starter=found.cards,
            sensor=found.sensor,
        ), found.notes

    def _refuse_unknown_nodes(self, deck: str) -> None:
        """Raise DeckError if a main node belongs to no rigid body of the deck: the engine would skip it silently."""
        from d2rpick.deck.suiting import list_main_nodes

        nodes = list_main_nodes(deck)
        wanted = parse_id_ranges("--node", self.node)
        unknown = [str(node) for node in wanted if node not in nodes]
        if nodes and unknown:
            known = list_names([*map(str, nodes)], most=_MOST_NODES)
            raise DeckError(
                f"{deck}: no rigid body has the main node {', '.join(unknown)}; give those of the bodies to be "
                f"switched as `node`: the deck has {known}"
            )


def find_bodies_on_card(
    question: RunQuestion, parts: Sequence[int]
) -> tuple[RigidBody, ...] | None:
    """Return the rigid bodies that the parts of a card become according to the deck; None if there is no deck."""
    if question.on_card and question.model and question.deck:
        # Imported here to keep start-up fast.
        from d2rpick.choice.parts.deck_of_run import find_rigid_bodies

        return find_rigid_bodies(question.model.inventory, parts)
    return question.settings.bodies


# Keys of the settings that apply to all commands. All other keys apply to the rules or to a single command.
SETTINGS: Final = (*map(make_option_name, (*OPTIONS, *list_options(Cards))), "fail-on")


def name_needed_argument(solver: Module) -> str:
    """Return a message that names the argument with the parts or bodies on a card of ``solver``."""
    arguments_by_kind = {
        "part": "`parts`, the parts to switch",
        "node": "`node`, the main nodes of the rigid bodies",
    }
    return f"a card for {solver.title} needs {arguments_by_kind[solver.switches]}"


def parse_id_ranges(
    name: str, texts: Sequence[str], *, takes_history: bool = True
) -> list[int]:
    """Return the ids given as numbers and ranges. Without a history, all ids in a range are assumed to exist.

    Messages name the option --history only if the command ``takes_history``.
    """
    ids: list[int] = []
    for piece in (piece.strip() for text in texts for piece in text.split(",")):
        match = re.fullmatch(_RANGE, piece, re.ASCII)
        if not match:
            if piece in (SOME_PARTS, SOME_NODES):
                raise ArgumentError(
                    f"{name}: {piece} stands for ids that the files do not contain; give those of your deck"
                )
            if piece.isdecimal():
                hint = "; an id has at most 10 digits"
            elif name == "--part" and takes_history:
                hint = "; titles need a --history that has parts"
            elif name == "--part":
                hint = "; give the ids of parts in the deck"
            else:
                hint = ""
            raise ArgumentError(
                f"{name}: {piece!r} is not a number (7) or range (10-19){hint}"
            )
        low = int(match[1])
        high = int(match[2] or match[1])
        if low == 0:
            raise ArgumentError(
                f"{name}: {piece!r} does not fit, but ids from 1 were expected; give those that the deck lists"
            )
        if high < low:
            raise ArgumentError(
                f"{name}: the range {piece!r} is reversed; give the smaller number first, {high}-{low}"
            )
        if not high < low + _MOST_IDS:
            raise ArgumentError(
                f"{name}: {piece!r} holds more than {_MOST_IDS} numbers; give shorter ranges"
            )
        ids += range(low, high + 1)
    return ids
