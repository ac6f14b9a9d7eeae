"""Print the card of an answer, or a card for given times, with a verdict on each window for the printed times."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any, Final, Unpack

from d2rpick.api.card_in_deck import ERROR_OF_CARD, warn_about_lead
from d2rpick.api.cards import (
    Cards,
    find_bodies_on_card,
    name_needed_argument,
    parse_id_ranges,
)
from d2rpick.api.request import CHOOSING_FOR_CARDS, Request
from d2rpick.base.errors import ArgumentError, Caution
from d2rpick.base.options import list_options
from d2rpick.base.tuples import NamedTuple
from d2rpick.choice.pair.grades import GRADES

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Sequence

    from d2rpick.api.arguments import Parts, Time
    from d2rpick.api.asked import RunQuestion
    from d2rpick.api.cards import Judging
    from d2rpick.api.runs import Run
    from d2rpick.base.spans import Times
    from d2rpick.choice.answers import PairVerdict
    from d2rpick.choice.pair.decision import Decision
    from d2rpick.deck.printed_card import PrintedCard, Printing

_ONLY_JUDGED: Final = (
    "a card for {} switches the rigid bodies of `node`; `parts` only selects the energy by which it is judged, so omit "
    "it, or give a `run` with parts"
)

_NEEDS_END: Final = "a card for {} needs `end`, the end of the run, or a `run`"
_NOT_JUDGED: Final = (
    "NOT JUDGED: no history of a reference run was given, so nothing shows whether these "
    "times are good."
)


class JudgedCard(NamedTuple):
    """A card with a verdict on each new window for the printed times; ``str`` returns the text of the card.

    ``card`` contains the ``text``, the ``files`` keyed by the names that the solver expects, the ``windows`` as
    printed, and ``notes``. ``cautions`` contains the findings of `check` for the deck of the run with the card; if
    there is no deck, it lists what could not be checked.
    """

    card: PrintedCard
    verdicts: tuple[PairVerdict, ...] = ()
    cautions: tuple[Caution, ...] = ()

    def __str__(self) -> str:
        return self.card.text

    @property
    def verified(self) -> bool:
        """True if all windows on the card have been verified."""
        return all(verdict.verified for verdict in self.verdicts)

    @property
    def worst(self) -> Decision | None:
        """Verdict on the worst of the judged windows; None if no window was judged."""
        return min(
            (verdict.decision for verdict in self.verdicts),
            key=lambda decision: GRADES.index(decision.grade),
            default=None,
        )

    @property
    def has_errors(self) -> bool:
        """True if the check of the deck with the card finds an error, so that the card must not be used."""
        return any(caution.code == ERROR_OF_CARD for caution in self.cautions)

    @property
    def passed(self) -> bool:
        """True if all windows are admissible and reach the grade ``min_quality``, and the card has no errors."""
        return not self.has_errors and all(
            verdict.decision.reaches(verdict.situation.settings.min_quality)
            for verdict in self.verdicts
        )


def judge_and_print(
    question: RunQuestion,
    cards: Cards,
    windows: Sequence[Times],
    judge: Callable[[float, float], PairVerdict] | None = None,
    done: Sequence[Times] = (),
) -> JudgedCard:
    """Print the card for windows, and judge their printed times as `verify` does or by a call of ``judge``.

    Raises
    ------
    ArgumentError
        If it is unknown which parts or bodies the card switches, or if an option belongs to another solver.
    """
    from d2rpick.api.card_in_deck import collect_objections
    from d2rpick.choice.answers import verify_run
    from d2rpick.choice.judged_card import complete_printing, print_judged_card
    from d2rpick.deck.printing import DEFAULT, SOLVERS

    reference = question.reference
    printing, notes = cards.complete(question)
    printing = complete_printing(_add_bodies(printing, question), reference.history)
    judge = judge or partial(verify_run, reference, settings=question.settings)
    result = print_judged_card(windows, reference.history, judge, printing, done)
    solver = SOLVERS[printing.solver or DEFAULT]
    if result is None:
        raise ArgumentError(name_needed_argument(solver))
    card, verdicts = result
    card = replace(card, notes=(*notes, *card.notes))
    apart = _count_separate_parts(printing)
    cautions = tuple(
        collect_objections(
            card, question.deck, apart, printing.merge, reference.run.parts
        )
    )
    return JudgedCard(card, verdicts, cautions)


def _count_separate_parts(printing: Printing) -> int:
    """Return the number of parts that a card switches by their ids although nothing shows which of them share nodes."""
    from d2rpick.deck.printing import DEFAULT, SOLVERS

    solver = SOLVERS[printing.solver or DEFAULT]
    is_known = printing.merge is not None or bool(printing.bodies)
    return 0 if is_known or solver.switches != "part" else len(printing.part)


def _add_bodies(printing: Printing, question: RunQuestion) -> Printing:
    """Add the rigid bodies that the parts of a card become according to the deck."""
    from d2rpick.choice.judged_card import add_deck_bodies

    bodies = find_bodies_on_card(question, printing.part)
    return add_deck_bodies(printing, replace(question.settings, bodies=bodies))


def collect_cautions(card: JudgedCard) -> tuple[Caution, ...]:
    """Return the cautions about a card and its verdicts without duplicates, one of them for each negative verdict."""
    of_verdicts = (
        caution
        for verdict in card.verdicts
        for caution in _list_verdict_cautions(verdict)
    )
    return tuple(dict.fromkeys((*of_verdicts, *card.cautions)))


def _list_verdict_cautions(verdict: PairVerdict) -> Iterator[Caution]:
    yield from verdict.cautions
    decision = verdict.decision
    if not decision.reaches(verdict.situation.settings.min_quality):
        message = f"{decision.verdict}: {decision.reason}"
        yield Caution(
            "not-verified", f"the times as printed: {message}; {decision.cure}"
        )


def card(
    windows: Iterable[tuple[Time, Time]],
    *,
    run: Run | None = None,
    parts: Parts | None = None,
    **options: Unpack[Judging],
) -> JudgedCard:
    """Print solver input for rigid windows, as ``d2rpick card`` does. If a run is given, judge the windows.

    Parameters
    ----------
    windows : pairs of float
        tr and td of each window [time].
    run : Run, optional
        The run, opened with `read`; it must not be switched.
    parts : number or several, optional
        The parts to be switched; if a run with parts is given, they may also be given by title.
    **options
        ``solver``, ``merge``, ``swset``, ``step_cap``, ``node``, ``end``, ``name``; with a run, also options that
        determine how the windows are judged, see ``d2rpick.api.choosing.JudgingOptions``.

    Returns
    -------
    JudgedCard

    Raises
    ------
    D2RPickError
        If windows overlap or are not in order, or if the run has no such parts or energy.
    TypeError, ValueError
        If an argument has a wrong type or value, or if it is unknown which parts or bodies the card switches.

    Examples
    --------
    >>> import d2rpick as d2
    >>> d2.card([(0.02, 0.09), (0.2, 0.3)], parts=11).card.windows
    ((0.02, 0.09), (0.2, 0.3))
    """
    from d2rpick.api.asked import make_request
    from d2rpick.api.times import TimeArguments

    times = TimeArguments.of_run(run)
    times_of_windows = times.check_windows("windows", windows)
    arguments_of_card = times.convert_options(options, list_options(Cards))
    judging: Any = {
        name: arguments_of_card.pop(name)
        for name in CHOOSING_FOR_CARDS
        if name in arguments_of_card
    }
    return print_card(
        times_of_windows,
        run,
        make_request(run, parts, None, None, None, judging),
        Cards.of(arguments_of_card),  # type: ignore[arg-type]  # the keys are the options of a card
    )


def print_card(
    windows: Sequence[Times],
    run: Run | None,
    request: Request,
    cards: Cards,
    listed_in: str = "",
) -> JudgedCard:
    """Print the card for windows. If a run is given, judge the printed times with it.

    Messages on times in another unit name the file that the windows are ``listed_in``.
    """
    from d2rpick.deck.printing import SOLVERS, find_solver, print_cards

    if run is None:
        if request.deck:
            _refuse_history_as_deck(request.deck)
        request.without_history()
        if request.deck is not None:
            return _print_in_deck(windows, request.deck, request, cards)
        printing = _complete_alone(request, cards)
        unknown_lead = warn_about_lead(printing.merge, printing.part)
        return JudgedCard(print_cards(windows, printing), cautions=tuple(unknown_lead))
    from d2rpick.api.asked import ask_run  # Imported here to keep start-up fast.

    question = ask_run(run, request, card_alone=True)
    for tr, td in windows:
        question.reference.history.check_pair(tr, td, listed_in)
    solver = cards.solver or find_solver(question.reference.history.format)
    cards.check_solver(solver)
    parts = parse_id_ranges("--part", question.on_card)
    if parts and SOLVERS[solver].switches != "part":
        raise ArgumentError(_ONLY_JUDGED.format(SOLVERS[solver].title))
    return judge_and_print(question, cards, windows)


def _refuse_history_as_deck(name: str) -> None:
    """Raise DeckError if a file that was given as a deck is a history."""
    from d2rpick.deck.source import SourceFile  # Imported here to keep start-up fast.

    SourceFile(name).refuse_history()


def _print_in_deck(
    windows: Sequence[Times], deck: str, request: Request, cards: Cards
) -> JudgedCard:
    """Print the card for windows that no history judges, and check the deck with the card."""
    from d2rpick.api.card_in_deck import collect_objections
    from d2rpick.choice.parts.deck_of_run import (
        find_rigid_bodies,
        warn_about_bodies,
        warn_about_solver,
    )
    from d2rpick.deck import read_inventory
    from d2rpick.deck.printing import print_cards
    from d2rpick.running.checks import refuse_absent

    inventory = read_inventory(deck)
    parts = parse_id_ranges("--part", request.part)
    if inventory.complete and inventory.nodes_by_part:
        refuse_absent(deck, inventory, parts)
    bodies = find_rigid_bodies(inventory, parts)
    printing, notes = cards.suit_deck(deck, parts, bodies)
    printing = cards.replace_in(printing, parts)
    replaced = (*printing.node, *printing.replaced)
    printing = printing._replace(
        bodies=tuple(body.parts for body in bodies),
        off=tuple(node for node in inventory.kept_off if node not in replaced),
    )
    _require_switched(printing, cards)
    card = print_cards(windows, printing, [_NOT_JUDGED])
    card = replace(card, notes=(*notes, *card.notes))
    cautions = (
        *warn_about_bodies(parts, inventory),
        *warn_about_solver(parts, inventory),
        *collect_objections(card, deck, _count_separate_parts(printing)),
    )
    return JudgedCard(card, (), cautions)


def _require_switched(printing: Printing, cards: Cards) -> None:
    """Raise ArgumentError if it is unknown which parts or bodies a card switches, or when the run ends."""
    from d2rpick.choice.judged_card import list_switched
    from d2rpick.deck.printing import DEFAULT, SOLVERS

    solver = printing.solver or DEFAULT
    cards.check_solver(solver)
    module = SOLVERS[solver]
    if not list_switched(printing):
        raise ArgumentError(name_needed_argument(module))
    if "end" in module.takes and printing.end is None:
        raise ArgumentError(_NEEDS_END.format(module.title))


def _complete_alone(request: Request, cards: Cards) -> Printing:
    """Return the options of a card without a history and a deck; raise ArgumentError if an option is missing."""
    from d2rpick.deck.printed_card import Printing
    from d2rpick.deck.printing import DEFAULT, SOLVERS

    solver = cards.solver or DEFAULT
    cards.check_solver(solver)
    module = SOLVERS[solver]
    if not {"part": request.part, "node": cards.node}[module.switches]:
        raise ArgumentError(name_needed_argument(module))
    if request.part and module.switches != "part":
        raise ArgumentError(_ONLY_JUDGED.format(module.title))
    if "end" in module.takes and cards.end is None:
        raise ArgumentError(_NEEDS_END.format(module.title))
    return cards.replace_in(Printing(), parse_id_ranges("--part", request.part))
