"""Find the error and the saving for each td in a flight, and plan the rigid windows of all flights."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final, Unpack

from d2rpick.api import arguments
from d2rpick.api.answer import build_frame
from d2rpick.api.asked import RunQuestion, ask_run, make_request
from d2rpick.api.cards import Cards
from d2rpick.api.judged_cards import JudgedCard, judge_and_print
from d2rpick.api.request import check_window
from d2rpick.api.run_answer import RunAnswer
from d2rpick.api.times import TimeArguments
from d2rpick.base.data_classes import dataclass
from d2rpick.base.errors import ArgumentError, DeckError
from d2rpick.base.options import NOT_NEGATIVE
from d2rpick.choice.td import plan as planning, trade_off

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    import pandas as pd

    from d2rpick.api.arguments import Parts, Time
    from d2rpick.api.cards import CardOptions
    from d2rpick.api.checking import Findings
    from d2rpick.api.choosing import Choosing
    from d2rpick.api.runs import Run
    from d2rpick.base.spans import Times
    from d2rpick.choice.parts.cost import Weights

_STEPS: Final = 200  # Default number of td values that are explored.


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Exploration(RunAnswer, trade_off.TradeOff):
    """Immutable answer of `explore`.

    ``offers`` are sorted by td; each has ``tr``, ``error``, ``rigid_time``, ``unbeaten`` (True if Pareto-optimal),
    ``quality``, and its measures in ``best``. ``recommended`` is the offer that `suggest` chooses. ``start`` is the
    requested td or, if there is none, the td that saves most. ``step`` is the nearest Pareto-optimal td with half the
    error of ``start``. ``answer`` is the result in one sentence.
    """

    kind = "trade_off"
    name = "explore"

    @property
    def answer(self) -> str:
        """Result of the exploration in one sentence."""
        from d2rpick.report.trade_off import give_answer

        return give_answer(self)

    def to_frame(self) -> pd.DataFrame:
        """Return one row per td and one column per scalar key of ``offers`` in the JSON output; unknown values are NaN.

        Examples
        --------
        >>> import d2rpick as d2
        >>> table = d2.explore(d2.read("sample_data/energy.csv"), td_window=(0.06, 0.07), steps=10).to_frame()
        >>> table.query("recommended")[["tr", "td"]].round(6).values.tolist()
        [[0.013587, 0.068753]]
        """
        from d2rpick.report.trade_off import COLUMNS

        return build_frame(
            self.to_dict()["offers"],
            COLUMNS,
            source=list(self.situation.history.source),
        )

    def page(
        self,
        command: Sequence[str],
        judging: Sequence[str] = (),
        cards: Cards | None = None,
    ) -> str:
        """Return the page, with the card of the recommended pair."""
        from d2rpick.report.pages import trade_off_page

        suggestion = self.suggestion
        chosen = (
            (suggestion.situation, suggestion.recommended.tr)
            if suggestion.recommended
            else None
        )
        return trade_off_page(
            self, self._context(command, judging, cards, chosen, self)
        )


def explore(
    run: Run,
    td: Time | None = None,
    *,
    td_window: tuple[Time, Time] | None = None,
    steps: int | None = _STEPS,
    parts: Parts | None = None,
    flying: Parts | None = None,
    deck: arguments.Deck | None = None,
    weights: Weights | arguments.Path | None = None,
    **choosing: Unpack[Choosing],
) -> Exploration:
    """Find the error and the saving for each td, as ``d2rpick explore`` does.

    Parameters
    ----------
    run : Run
        The run, opened with `read`; it must not be switched.
    td : float or text, optional
        Additional td, with which the others are compared [time].
    td_window : (float, float), optional
        Range of td [time].  The default is the flight that contains td, or else the longest flight; if there is no
        flight but td is given, the whole record.
    steps : int
        Number of evenly spaced values of td; the peaks of the energy are added.
    parts, flying, deck, weights, **choosing
        Arguments as for `suggest`.

    Returns
    -------
    Exploration

    Raises
    ------
    D2RPickError
        If the run has no such parts or energy, if a time lies outside the record, or if no flight is found and no td is
        given.
    TypeError, ValueError
        If an argument has a wrong type or value.

    Examples
    --------
    >>> import d2rpick as d2
    >>> found = d2.explore(d2.read("sample_data/energy.csv"), td=0.064, td_window=(0.06, 0.07), steps=100)
    >>> round(found.step.td - found.start.td, 4)
    0.0048
    """
    times = TimeArguments.of_run(run)
    wanted = times.check_time("td", td)
    window = times.check_window("td_window", td_window)
    count = arguments.check_whole_number("steps", _STEPS if steps is None else steps, 1)
    request = make_request(run, parts, flying, deck, weights, choosing)
    question = ask_run(run, request)
    return explore_for_question(question, wanted, window, count)


def explore_for_question(
    question: RunQuestion,
    td: float | None,
    td_window: tuple[float, float] | None,
    steps: int,
) -> Exploration:
    """Find the error and the saving for each td in a range, or in the flight of td or the longest flight."""
    check_window("td_window", td_window)
    result = trade_off.explore_run(
        question.reference, question.settings, td_window, td=td, steps=steps
    )
    times = [] if td is None else ["--td", repr(td)]
    times += ["--td-window", *map(repr, td_window)] if td_window else []
    return Exploration.about(question, result, *times, "--steps", str(steps))


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Plan(RunAnswer, planning.RunPlan):
    """Immutable answer of `plan`.

    ``flights`` has a row per flight with ``window``, ``status`` and ``reason``. ``windows`` contains the windows (tr,
    td) that this run supports; ``all_windows`` also contains those that require a switched run first. ``next_run``
    contains the windows of the next run: those that are done and ``windows``; it is empty if no window is new.
    ``rigid_fraction`` is the fraction of the record in which ``windows`` make the parts rigid. All times are in the
    unit of the run.
    """

    kind = name = "plan"

    def to_frame(self) -> pd.DataFrame:
        """Return a row per flight and a column per key of ``windows`` in the JSON output; unknown values are NaN.

        Examples
        --------
        >>> import d2rpick as d2
        >>> d2.plan(d2.read("sample_data/energy.csv")).to_frame()["status"].tolist()
        ['supported']
        """
        from d2rpick.report.plan import WINDOW

        return build_frame(
            self.to_dict()["windows"], WINDOW.keys, source=list(self.history.source)
        )

    def card(
        self, *, every: bool | None = False, **options: Unpack[CardOptions]
    ) -> JudgedCard | None:
        """Print the card for the next run, and judge the printed times of its windows.

        The card contains all new windows if ``every`` is True, otherwise only the windows that the history supports.
        """
        return self.printed(
            Cards.for_run(self.question.run, options),
            every=arguments.check_flag("every", every, False),
        )

    def printed(self, cards: Cards, *, every: bool = False) -> JudgedCard | None:
        """Print the card for the next run, and judge its new windows; None if there are no new windows."""
        new = self.all_windows if every else self.windows
        question = self.question
        question = question._replace(
            reference=question.reference._replace(history=self.history)
        )
        return judge_and_print(question, cards, new, done=self.done) if new else None

    def page(
        self,
        command: Sequence[str],
        judging: Sequence[str] = (),  # noqa: ARG002  other answers use the argument
        cards: Cards | None = None,
    ) -> str:
        """Return the page, with the cards of the next run."""
        from d2rpick.report.pages import plan_page

        card = self._card_of_windows(cards or Cards())
        explorer = self._explorer(
            trade_off.explore_flights(self.question.reference, self)
        )
        return plan_page(
            self,
            self.question.reference.run,
            command,
            card.card.text if card else None,
            explorer,
            self.question.repeated,
        )

    def _card_of_windows(self, cards: Cards) -> JudgedCard | None:
        """Return the card for the next run; None if no parts are named or the deck's bodies cannot be switched."""
        from d2rpick.choice.judged_card import complete_printing, list_switched

        try:
            printing, _ = cards.complete(self.question)
        except DeckError:
            return None
        if list_switched(complete_printing(printing, self.history)):
            return self.printed(cards)
        return None


def plan(
    run: Run,
    *,
    parts: Parts | None = None,
    flying: Parts | None = None,
    deck: arguments.Deck | None = None,
    weights: Weights | arguments.Path | None = None,
    min_rigid: Time | None = None,
    done: Iterable[tuple[Time, Time]] | None = (),
    before: Run | None = None,
    **choosing: Unpack[Choosing],
) -> Plan:
    """Plan the rigid windows of a run, as ``d2rpick plan`` does.

    Parameters
    ----------
    run : Run
        The run, opened with `read`; it must not be switched outside the windows ``done``.
    parts, flying, deck, weights, **choosing
        Arguments as for `suggest`.
    min_rigid : float or text, optional
        Shorter windows are left out [time].  The default is 5 % of the record; a window that freezes vibration energy
        is then also left out if a later window is more than twice as long.
    done : pairs of float
        Windows (tr, td) in which the run was switched [time].
    before : Run, optional
        The run from which these windows were planned; the landings of both runs are compared.

    Returns
    -------
    Plan

    Raises
    ------
    D2RPickError
        If the run has no such parts or energy, or if its parts were deformable in a window that is done.
    TypeError, ValueError
        If an argument has a wrong type or value.

    Examples
    --------
    >>> import d2rpick as d2
    >>> found = d2.plan(d2.read("sample_data/rollover_box.matsum"), parts="flying")
    >>> [(round(tr, 3), round(td, 3)) for tr, td in found.windows]
    [(0.124, 0.37)]
    """
    times = TimeArguments.of_run(run)
    shortest = times.check_time("min_rigid", min_rigid, NOT_NEGATIVE)
    windows = times.check_windows("done", done)
    if before is not None:
        arguments.check_run("before", before)
    request = make_request(run, parts, flying, deck, weights, choosing)
    question = ask_run(run, request)
    return plan_for_question(question, shortest, windows, before)


def plan_for_question(
    question: RunQuestion,
    min_rigid: float | None,
    done: Sequence[Times],
    before: Run | None,
) -> Plan:
    """Plan the rigid windows of a run, or those that follow the windows ``done`` in a finished run."""
    if before is not None and not done:
        raise ArgumentError(
            "`before` compares the landings of a switched run; name its windows with `done`"
        )
    windows: Sequence[Times] = ()
    if done:
        # Imported here to keep start-up fast.
        from d2rpick.deck.printed_card import refuse_overlapping_windows

        windows = refuse_overlapping_windows(done)
    earlier = (
        question.reference.like(before.files, question.selection) if before else None
    )
    result = planning.plan_run(
        question.reference,
        question.settings,
        min_rigid=min_rigid,
        done=windows,
        before=earlier,
    )
    times = [] if min_rigid is None else ["--min-rigid", repr(min_rigid)]
    # The text has one line per window, in the format that `check` reads from standard input.
    times += ["--done", "-"] if windows else []
    times += [
        text
        for name in (before.sources if before else ())
        for text in ("--before", name)
    ]
    return Plan.about(question, result, *times)


def write_planned_deck(
    plan: Plan, card: JudgedCard, folder: str, *, overwrite: bool
) -> tuple[list[str], Findings]:
    """Write a copy of the plan's deck with the plan's card, and check the copy by means of the history.

    Return the names of the files, beginning with the main file, and the findings in the copy.
    """
    from d2rpick.api.checking import check_written
    from d2rpick.deck.writing import write_deck
    from d2rpick.rules.judgement import HistoryJudge

    question = plan.question
    # The copy of the deck contains only the windows whose times are on the card.
    done = card.card.windows[: len(plan.done)]
    names = write_deck(
        question.request.deck or "", card.card, folder, overwrite=overwrite
    )
    judge = HistoryJudge(
        question.reference.run,
        question.request.selection(parts=False),
        plan.settings,
        done,
    )
    return names, check_written(names[0], judge)
