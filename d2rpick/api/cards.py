"""What is asked of a card beside its times, and the card of an answer."""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any, Final, TypedDict, Unpack

from d2rpick.api.request import (
    OPTIONS,
    POSITIVE,
    TIME,
    UNLIMITED,
    Number,
    Option,
    Request,
    dashed,
    option,
    options_of,
)
from d2rpick.base.errors import ArgumentError, Caution
from d2rpick.base.tuples import NamedTuple

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Sequence

    from d2rpick.api.arguments import Parts
    from d2rpick.api.asked import Asked
    from d2rpick.api.runs import Run
    from d2rpick.choice.answers import Verdict
    from d2rpick.choice.judged_card import CardRequest
    from d2rpick.choice.switched_run import Times
    from d2rpick.deck.printed_card import CardSolver as Module, PrintedCard, Printing

_RANGE: Final = r"(\d{1,10})(?:\s*-\s*(\d{1,10}))?"  # compiled where it is needed
_MOST_IDS: Final = 100_000
_IDS: Final = range(1, UNLIMITED)
_ONLY_JUDGED: Final = (
    "`parts` chooses by whose energy a card for {} is judged; give a `run` with parts"
)


class CardOptions(TypedDict, total=False):
    """How a card is printed.

    ``solver``: ``"ls-dyna"``, ``"radioss"`` or ``"radioss-sensors"`` (default: the one that wrote the history); with
    ``contact`` or ``wall``, the number of what pushes, ``"ls-dyna-contact"`` or ``"radioss-contact"``.
    ``step_cap``: the largest time step while rigid.  LS-DYNA: ``merge``, the lead part that all others are merged into,
    ``swset``, ids of the two switch sets of the first window.  Radioss: ``node``, main nodes of the rigid bodies,
    ``end`` of the run and its ``name``.
    """

    solver: str | None
    merge: int | None
    swset: tuple[int, int] | None
    step_cap: float | None
    node: Parts | None
    end: float | None
    name: str | None
    contact: int | None
    wall: int | None


class Judging(CardOptions, total=False):
    """The same, and how the windows are judged: as in ``d2rpick.api.arguments.Choosing``."""

    after: float | None
    landing: float | None
    margin: float | None
    tolerance: float | None


def _checked(name: str, value: Any, option: Option) -> Any:
    """Give a value in its kind."""
    from d2rpick.api import arguments

    kind = option.kind
    if option.many:
        return arguments.part_names(name, value)
    if option.pair:
        is_pair = (
            hasattr(value, "__len__")
            and hasattr(value, "__iter__")
            and getattr(value, "ndim", 1) == 1
        )
        if not is_pair or isinstance(value, str | bytes) or len(value) != 2:
            raise TypeError(f"{name} is {value!r}, a pair of numbers was expected")
        return tuple(arguments.whole(name, one, _IDS.start) for one in value)
    if isinstance(kind, range):
        return arguments.whole(name, value, kind.start)
    if isinstance(kind, Number):
        return arguments.number(name, value, kind)
    if not isinstance(value, str):
        raise TypeError(f"{name} is {value!r}, a text was expected")
    if kind == "solver" and value not in solvers():
        raise ValueError(
            f"{name} is {value!r}, one of {', '.join(solvers())} was expected"
        )
    return value


def solvers() -> Sequence[str]:
    """Names of the solvers whose input can be printed."""
    from d2rpick.deck.printing import SOLVERS  # not above: start-up

    return tuple(SOLVERS)


@dataclass(eq=False, repr=False)
class Cards:
    """How a card is printed: the options of every command that prints one."""

    solver: str | None = option(
        "Solver whose input is printed.  [default: of the solver that wrote the history, else ls-dyna]",
        "solver",
    )
    merge: int | None = option(
        "LS-DYNA: lead part that all others are merged into (LRB).", _IDS, "ID"
    )
    swset: tuple[int, int] | None = option(
        "LS-DYNA: switch sets of the first window; the next ids follow.  [default: 901 902]",
        _IDS,
        "ID ID",
        pair=True,
    )
    step_cap: float | None = option(
        "Largest time step while rigid (DTMAX, /DTIX).", POSITIVE, "DT"
    )
    node: tuple[str, ...] = option(
        "Radioss: main nodes of the rigid bodies.", "names", "IDS", many=True
    )
    end: float | None = option(
        "Radioss: end of the run.  [default: end of the history]", TIME, "T"
    )
    name: str | None = option(
        "Radioss: name of the run.  [default: Root]", metavar="NAME"
    )
    contact: int | None = option(
        "Contact whose force switches (solvers ls-dyna-contact, radioss-contact).",
        _IDS,
        "ID",
    )
    wall: int | None = option(
        "Rigid wall whose force switches (the same solvers).", _IDS, "ID"
    )
    starter: str = ""  # cards that the starter deck lacks
    sensor: int = 901  # first id of sensors that is free
    delete_nodal_bodies: bool = False  # as those of Printing
    delete_node_sets: bool = False
    replaced: tuple[int, ...] = ()  # main nodes of bodies that leave the starter deck

    @classmethod
    def of(cls, given: CardOptions) -> Cards:
        """Take the arguments of Python; TypeError or ValueError for one that is not of its kind."""
        from d2rpick.api import arguments

        known = options_of(Cards)
        if unknown := [name for name in given if name not in known]:
            arguments.refuse_unknown(unknown[0], known)
        return cls(
            **{
                name: _checked(name, one, known[name])
                for name, one in given.items()
                if one is not None
            }
        )

    @property
    def given(self) -> list[str]:
        """Names of the options that were given, the solver aside."""
        return [
            name
            for name in options_of(Cards)
            if name != "solver" and getattr(self, name) not in (None, ())
        ]

    def printing(self, parts: Sequence[int] = ()) -> Printing:
        """Say what a card says besides its times and its solver."""
        from d2rpick.deck.printed_card import Printing

        given = {name: getattr(self, name) for name in self.given}
        if self.node:
            given["node"] = tuple(numbers("--node", self.node))
        return Printing(
            part=tuple(parts),
            starter=self.starter,
            sensor=self.sensor,
            replaced=self.replaced,
            delete_nodal_bodies=self.delete_nodal_bodies,
            delete_node_sets=self.delete_node_sets,
            **given,
        )

    def check_solver(self, solver: str) -> None:
        """Refuse an option that says what the input of ``solver`` has no place for."""
        from d2rpick.deck.printing import SOLVERS

        places = {name: {one.switches, *one.takes} for name, one in SOLVERS.items()}
        for name in self.given:
            if name not in places[solver]:
                owner = next(one for one, takes in places.items() if name in takes)
                hint = (
                    ""
                    if self.solver
                    else f"; without `solver` the card is one for {SOLVERS[solver].title}"
                )
                raise ArgumentError(f"`{name}` is an option of `solver` {owner}{hint}")

    def by_deck(self, asked: Asked) -> tuple[Cards, tuple[str, ...]]:
        """Complete a card by the deck of the run, unless its options say otherwise.

        The deck gives the solver, the name and end of the run, ids that are free, the constraints that have to be
        deleted, and the rigid bodies that switch the parts.  Notes say which bodies it lacks.

        Raises
        ------
        DeckError
            If the deck cannot be read, or rigid bodies of it cannot switch the parts.
        """
        deck, parts = (
            asked.deck,
            [part.id for part in asked.reference.history.parts or ()],
        )
        if deck is None:
            return self, ()
        from d2rpick.deck.suiting import find_suiting

        found = find_suiting(deck, parts)
        cards = replace(self, solver=self.solver or found.solver)
        if found.solver == "ls-dyna" and str(cards.solver).startswith("ls-dyna"):
            cards = replace(
                cards,
                swset=cards.swset or found.swset,
                delete_nodal_bodies=found.delete_nodal_bodies,
                delete_node_sets=found.delete_node_sets,
            )
            return cards, ()
        from d2rpick.deck.printing import SOLVERS

        if SOLVERS[cards.solver or ""].title != SOLVERS[found.solver].title:
            return cards, ()
        end = found.end if cards.end is None else cards.end
        cards = replace(cards, name=cards.name or found.name, end=end)
        if not parts or cards.node:
            return cards, ()
        from d2rpick.deck.radioss_bodies import find_bodies

        bodies = find_bodies(deck, parts)
        cards = replace(
            cards, node=tuple(map(str, bodies.nodes)), replaced=bodies.replaced
        )
        return replace(cards, starter=bodies.cards, sensor=bodies.sensor), bodies.notes

    def request(self, asked: Asked) -> CardRequest:
        """Say how the card of a run is printed."""
        from d2rpick.choice.judged_card import CardRequest

        request = CardRequest(
            self.solver, self.printing(numbers("--part", asked.on_card))
        )
        self.check_solver(request.of(asked.reference.history)[0])
        return request


# Keys of the settings that are for all commands; further ones are for the rules of check, or for one command.
SETTINGS: Final = (*map(dashed, (*OPTIONS, *options_of(Cards))), "fail-on")


def needed(solver: Module) -> str:
    """Say which argument names whom the card of ``solver`` switches."""
    what = {
        "part": "`parts`, the parts to switch",
        "node": "`node`, the main nodes of the rigid bodies",
    }
    return f"a card for {solver.title} needs {what[solver.switches]}"


def numbers(name: str, texts: Sequence[str]) -> list[int]:
    """Numbers and ranges as they are typed; without a history nobody knows which of a range exist."""
    ids: list[int] = []
    for piece in (piece.strip() for text in texts for piece in text.split(",")):
        found = re.fullmatch(_RANGE, piece, re.ASCII)
        if not found:
            hint = (
                "; titles need a --history that has parts" if name == "--part" else ""
            )
            raise ArgumentError(
                f"{name}: {piece!r} is not a number (7) or range (10-19){hint}"
            )
        low, high = int(found[1]), int(found[2] or found[1])
        if not low <= high < low + _MOST_IDS:
            raise ArgumentError(
                f"{name}: {piece!r} is not a range of 1 to {_MOST_IDS} numbers"
            )
        ids += range(low, high + 1)
    return ids


class JudgedCard(NamedTuple):
    """A card, with what was found of each of its new windows as printed; ``str`` gives its text.

    ``card`` has ``text``, ``files`` by the names that the solver expects, ``windows`` as printed and ``notes``.
    ``cautions`` are what `check` has against the card in the deck of the run, and what is not known without a deck.
    """

    card: PrintedCard
    verdicts: tuple[Verdict, ...] = ()
    cautions: tuple[Caution, ...] = ()

    def __str__(self) -> str:
        return self.card.text

    @property
    def verified(self) -> bool:
        """Whether all windows are."""
        return all(verdict.verified for verdict in self.verdicts)

    @property
    def passed(self) -> bool:
        """Whether all windows are admissible, and as good as ``min_quality`` asks for."""
        return all(
            verdict.decision.reaches(verdict.situation.settings.min_quality)
            for verdict in self.verdicts
        )


def judged(
    asked: Asked,
    cards: Cards,
    windows: Sequence[Times],
    judge: Callable[[float, float], Verdict] | None = None,
    done: Sequence[Times] = (),
) -> JudgedCard:
    """Print the card of windows that are judged as printed, as `verify` does it or by ``judge``.

    Raises
    ------
    ArgumentError
        If nobody says whom it switches, or an option belongs to another solver.
    """
    from d2rpick.api.card_in_deck import collect_objections
    from d2rpick.choice.answers import verify_of
    from d2rpick.choice.judged_card import judged_card
    from d2rpick.deck.printing import SOLVERS

    cards, notes = cards.by_deck(asked)
    reference, request = asked.reference, cards.request(asked).by(asked.settings)
    judge = judge or partial(verify_of, reference, settings=asked.settings)
    found = judged_card(windows, reference.history, judge, request, done)
    solver, printing = request.of(reference.history)
    if found is None:
        raise ArgumentError(needed(SOLVERS[solver]))
    card, verdicts = found
    card = replace(card, notes=(*notes, *card.notes))
    apart = (
        0
        if printing.merge or SOLVERS[solver].switches != "part"
        else len(printing.part)
    )
    return JudgedCard(card, verdicts, tuple(collect_objections(card, asked, apart)))


def all_cautions(card: JudgedCard) -> tuple[Caution, ...]:
    """Cautions of a card and of its verdicts, each once, and the verdicts themselves where they are objections."""
    of_verdicts = (
        caution for verdict in card.verdicts for caution in _cautions(verdict)
    )
    return tuple(dict.fromkeys((*of_verdicts, *card.cautions)))


def _cautions(verdict: Verdict) -> Iterator[Caution]:
    yield from verdict.cautions
    decision = verdict.decision
    if not decision.reaches(verdict.situation.settings.min_quality):
        told = f"{decision.verdict}: {decision.reason}"
        yield Caution("not-verified", f"the times as printed: {told}; {decision.cure}")


def card(
    windows: Iterable[tuple[float, float]],
    *,
    run: Run | None = None,
    parts: Parts | None = None,
    **options: Unpack[Judging],
) -> JudgedCard:
    """Print solver input for switching windows, as ``d2rpick card`` does; where there is a run they are judged by it.

    Parameters
    ----------
    windows : pairs of float
        tr and td of each [time].
    run : Run, optional
        As `read` gives it, without switching.
    parts : number or several, optional
        The parts to be switched; with a run that has parts by title too.
    **options
        ``solver``, ``merge``, ``swset``, ``step_cap``, ``node``, ``end``, ``name``; with a run ``after``, ``landing``,
        ``margin``, ``tolerance``.

    Returns
    -------
    JudgedCard

    Raises
    ------
    D2RPickError
        If windows do not follow each other, or the run has no such parts or energy.
    TypeError, ValueError
        If an argument is not of its kind, or nobody says whom the card switches.

    Examples
    --------
    >>> import d2rpick as d2
    >>> d2.card([(0.02, 0.09), (0.2, 0.3)], parts=11).card.windows
    ((0.02, 0.09), (0.2, 0.3))
    """
    from d2rpick.api import arguments
    from d2rpick.api.asked import request_of

    times = arguments.pairs("windows", windows)
    given: dict[str, Any] = dict(options)
    judging: Any = {
        name: given.pop(name)
        for name in ("after", "landing", "margin", "tolerance")
        if name in given
    }
    return card_of(
        times,
        run,
        request_of(run, parts, None, None, None, judging),
        Cards.of(given),  # type: ignore[arg-type]
    )


def card_of(
    windows: Sequence[Times], run: Run | None, request: Request, cards: Cards
) -> JudgedCard:
    """Print the card of windows, judged as printed where there is a run."""
    from d2rpick.deck.printing import DEFAULT, SOLVERS, print_cards

    if run is None:
        request.without_history()
        solver = cards.solver or DEFAULT
        return JudgedCard(print_cards(windows, _alone(request, cards, solver), solver))
    from d2rpick.api.asked import ask  # not above: a card alone does without numpy

    asked = ask(run, request, card_alone=True)
    wanted = cards.request(asked)
    module = SOLVERS[wanted.of(asked.reference.history)[0]]
    if wanted.printing.part and module.switches != "part":
        raise ArgumentError(_ONLY_JUDGED.format(module.title))
    return judged(asked, cards, windows)


def _alone(request: Request, cards: Cards, solver: str) -> Printing:
    """Say what the card needs where no history says anything; ArgumentError where something is missing."""
    from d2rpick.deck.printing import SOLVERS

    cards.check_solver(solver)
    module = SOLVERS[solver]
    if not {"part": request.part, "node": cards.node}[module.switches]:
        raise ArgumentError(needed(module))
    if request.part and module.switches != "part":
        raise ArgumentError(_ONLY_JUDGED.format(module.title))
    if "end" in module.takes and cards.end is None:
        raise ArgumentError(
            f"a card for {module.title} needs `end`, the end of the run, or a `run`"
        )
    return cards.printing(numbers("--part", request.part))
