"""Choose the switch times tr and td, or judge a given pair."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Unpack

from d2rpick.api import arguments
from d2rpick.api.answer import build_frame
from d2rpick.api.asked import RunQuestion, ask_run, make_request
from d2rpick.api.cards import Cards
from d2rpick.api.judged_cards import JudgedCard, judge_and_print as card_judged
from d2rpick.api.request import MIN_MEAN_ENERGY, choose_time_or_window
from d2rpick.api.run_answer import RunAnswer
from d2rpick.api.times import TimeArguments
from d2rpick.base.data_classes import dataclass
from d2rpick.base.errors import ArgumentError, EnergyChoiceError, FormatError
from d2rpick.base.options import FRACTION
from d2rpick.choice import answers
from d2rpick.histories.digits import round_as_read

if TYPE_CHECKING:
    from collections.abc import Sequence

    import pandas as pd

    from d2rpick.api.arguments import Parts, Time
    from d2rpick.api.cards import CardOptions
    from d2rpick.api.choosing import Choosing
    from d2rpick.api.runs import Run
    from d2rpick.choice.pair.candidates import Pair
    from d2rpick.choice.parts.cost import Weights
    from d2rpick.choice.question import Reference
    from d2rpick.choice.switched.switch_times import SwitchedWindow


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Suggestion(RunAnswer, answers.PairSuggestion):
    """Immutable answer of `suggest`.

    ``candidates`` are in order of rank, best first. ``recommended`` and ``better_pair`` have ``tr``, ``td`` and
    ``residual``, or are None, with the reason in ``warnings``; the better pair may be the recommended pair. ``quality``
    of the recommended pair has a ``grade`` (good, fair or poor) and ``reasons``.
    """

    kind = "suggestion"
    name = "suggest"

    def to_frame(self) -> pd.DataFrame:
        """Return the candidates as a table at full precision.

        Returns
        -------
        pandas.DataFrame
            Table with a row per candidate, best first, and a column per key of ``candidates`` in the JSON output;
            unknown values are NaN. ``attrs`` contains ``td``, ``basis`` and ``source``.

        Examples
        --------
        >>> import d2rpick as d2
        >>> answer = d2.suggest(d2.read("sample_data/energy.csv"), td=0.064)
        >>> answer.to_frame().query("recommended")["tr"].round(6).tolist()
        [0.012885]
        """
        from d2rpick.report.suggestion import CANDIDATE

        source = list(self.situation.history.source)
        rows = self.to_dict()["candidates"]
        return build_frame(
            rows, CANDIDATE.keys, td=self.td, basis=self.basis, source=source
        )

    def card(self, **options: Unpack[CardOptions]) -> JudgedCard | None:
        """Print the card of the recommended pair and judge the printed times; None if no pair is recommended."""
        return self.printed(Cards.for_run(self.question.run, options))

    def printed(self, cards: Cards) -> JudgedCard | None:
        """Print the card of the recommended pair and judge the printed times; None if no pair is recommended."""
        pair = self.recommended
        question = self.question
        judge = partial(
            answers.verify_run,
            question.reference,
            settings=self.situation.settings,
            earlier=self.situation,
        )
        return (
            card_judged(question, cards, [(pair.tr, pair.td)], judge) if pair else None
        )

    def page(
        self,
        command: Sequence[str],
        judging: Sequence[str] = (),
        cards: Cards | None = None,
    ) -> str:
        """Return the page, with the card of the recommended pair."""
        from d2rpick.choice.td.trade_off import explore_around
        from d2rpick.report.pages import suggestion_page

        chosen = (self.situation, self.recommended.tr) if self.recommended else None
        explored = explore_around(
            self.question.reference, self.situation, self.td_window
        )
        return suggestion_page(
            self, self._context(command, judging, cards, chosen, explored)
        )


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Verdict(RunAnswer, answers.PairVerdict):
    """Immutable answer of `verify`.

    ``verified`` is True if the pair can be used. ``reasons`` states why it cannot be used, or what to keep in mind.
    ``tr_ok`` and ``td_ok`` are None if the record does not show whether the time is suitable. ``candidate`` contains
    the measures of the pair; ``quality`` is None if the pair is not verified.
    """

    compared: Run | None = None
    kind = "verdict"
    name = "verify"

    @property
    def tr(self) -> float:
        """Time at which the parts are switched to rigid [time]."""
        return self.candidate.tr

    def to_frame(self) -> pd.DataFrame:
        """Return the values of the pair as a one-row table with the same columns as the CSV; unknown values are NaN.

        Examples
        --------
        >>> import d2rpick as d2
        >>> verdict = d2.verify(d2.read("sample_data/energy.csv"), tr=0.0135867, td=0.0687534)
        >>> verdict.to_frame()["verified"].tolist()
        [True]
        """
        from d2rpick.report.verdict import list_all_measures

        values = list_all_measures(self)
        return build_frame(
            [values],
            list(values),
            basis=self.basis,
            source=list(self.situation.history.source),
        )

    def page(
        self,
        command: Sequence[str],
        judging: Sequence[str] = (),
        cards: Cards | None = None,
    ) -> str:
        """Return the page, with the card of the pair if the pair is good."""
        from d2rpick.choice.td.trade_off import explore_around
        from d2rpick.report.pages import verdict_page

        chosen = (self.situation, self.tr) if self.verified else None
        explored = explore_around(self.question.reference, self.situation)
        context = self._context(command, judging, cards, chosen, explored)
        return verdict_page(
            self,
            context._replace(switched=self.compared.files if self.compared else None),
        )


def suggest(
    run: Run,
    td: Time | None = None,
    *,
    td_window: tuple[Time, Time] | None = None,
    parts: Parts | None = None,
    flying: Parts | None = None,
    deck: arguments.Deck | None = None,
    weights: Weights | arguments.Path | None = None,
    **choosing: Unpack[Choosing],
) -> Suggestion:
    """Choose tr for ``td``, or both times with td in ``td_window`` or the longest flight, as ``d2rpick suggest`` does.

    Parameters
    ----------
    run : Run
        The run, opened with `read`; it must not be switched.
    td : float or text
        Time at which the parts become deformable again [time]; it may be a string with a unit, such as ``"64ms"``, if
        the run names its unit.
    td_window : (float, float)
        Range in which td is chosen, instead of ``td`` [time]; the default is the longest flight.
    parts : number, title or several, optional
        The parts to be switched; ``"10-19"`` is a range, ``"flying"`` stands for all deformable parts that fly
        together, and ``"all"`` for all parts that have energy.
    flying : number, title or several, optional
        Parts that fly together with these parts.
    deck : path, optional
        Main deck of the run, which defines the cost of the parts, the springs, the rigid bodies, and the parts of
        ``"recommended"``.  Without a deck, the parts are assumed to become one rigid body, see
        ``position_error_assumes`` of a candidate.  The default is the only main deck in the folder that was read; False
        means no deck.
    weights : Weights or path, optional
        Cost of an element by formulation, or the file that ``d2rpick calibrate`` wrote.
    **choosing
        Options that determine the choice, for example ``tolerance`` or ``max_residual``: see
        ``d2rpick.api.choosing.Choosing``.

    Returns
    -------
    Suggestion

    Raises
    ------
    D2RPickError
        If the run has no such parts or energy, or if td lies outside the record.
    TypeError, ValueError
        If an argument has a wrong type or value.

    Examples
    --------
    >>> import d2rpick as d2
    >>> run = d2.read("sample_data/energy.csv")
    >>> answer = d2.suggest(run, td_window=(0.06, 0.07))
    >>> f"{answer.recommended.tr:.6f} {answer.recommended.td:.6f}"
    '0.013587 0.068753'
    """
    times = TimeArguments.of_run(run)
    wanted = choose_time_or_window(
        times.check_time("td", td),
        times.check_window("td_window", td_window),
    )
    request = make_request(run, parts, flying, deck, weights, choosing)
    question = ask_run(run, request)
    return suggest_for_question(question, wanted)


def suggest_for_question(
    question: RunQuestion, td: float | tuple[float, float] | None
) -> Suggestion:
    """Choose tr for ``td``, or both times with td in a range; None stands for the longest flight."""
    result = answers.suggest_in_run(question.reference, td, question.settings)
    if (
        result.better_pair
        and result.recommended
        and _read(result.better_pair) == _read(result.recommended)
    ):
        result = replace(result, better_pair=None)
    if isinstance(td, tuple):
        times = ("--td-window", *map(repr, td))
    else:
        times = () if td is None else ("--td", repr(td))
    return Suggestion.about(question, result, *times)


def _read(pair: Pair) -> tuple[float, float]:
    return round_as_read(pair.tr), round_as_read(pair.td)


def verify(
    run: Run,
    tr: Time | None = None,
    td: Time | None = None,
    *,
    switched: Run | None = None,
    min_mean_energy: float | None = MIN_MEAN_ENERGY,
    parts: Parts | None = None,
    flying: Parts | None = None,
    deck: arguments.Deck | None = None,
    weights: Weights | arguments.Path | None = None,
    **choosing: Unpack[Choosing],
) -> Verdict:
    """Judge one pair of switch times, as ``d2rpick verify`` does.

    Parameters
    ----------
    run : Run
        The run, opened with `read`; it must not be switched.
    tr, td : float or text
        Switch times [time], or strings such as ``"64ms"``; times that are not given are determined from ``switched``.
    switched : Run, optional
        A finished run with these switch times, to be compared with ``run``.
    min_mean_energy : float
        Smallest accepted mean energy of the switched run after td, relative to that of ``run`` [-]; the largest is 2
        minus this value.
    parts, flying, deck, weights, **choosing
        Arguments as for `suggest`.

    Returns
    -------
    Verdict

    Raises
    ------
    D2RPickError
        If the run has no such parts or energy, if a time lies outside the record, or if tr is not before td.
    TypeError, ValueError
        If an argument has a wrong type or value.

    Examples
    --------
    >>> import d2rpick as d2
    >>> run = d2.read("sample_data/energy.csv")
    >>> d2.verify(run, tr=0.0135867, td=0.0687534).verified
    True
    """
    times = TimeArguments.of_run(run)
    pair = times.check_time("tr", tr), times.check_time("td", td)
    min_ratio = arguments.check_number(
        "min_mean_energy",
        MIN_MEAN_ENERGY if min_mean_energy is None else min_mean_energy,
        FRACTION,
    )
    if switched is not None:
        arguments.check_run("switched", switched)
    request = make_request(run, parts, flying, deck, weights, choosing)
    question = ask_run(run, request)
    return judge_pair(question, *pair, switched, min_ratio)


def check_pair(tr: float | None, td: float | None, switched: object) -> None:
    """Refuse an incomplete pair. Both times are needed unless a switched run defines them."""
    if not switched and (tr is None or td is None):
        if tr is None and td is None:
            times = "`tr` and `td`"
        else:
            times = "`tr` too" if tr is None else "`td` too"
        raise ArgumentError(f"give {times}, or a finished switched run as `switched`")


def _read_switched(question: RunQuestion, switched: Run) -> Reference:
    """Read a switched run; raise FormatError if the energy of the reference run does not show which column is meant."""
    reference = question.reference
    try:
        return reference.like(switched.files, question.selection)
    except EnergyChoiceError as error:
        if question.selection.energy:
            raise
        found = str(error).partition(": ")[2].rpartition("`: ")[2]
        raise FormatError(
            f"{switched.files.name}: no column is named like the energy of the reference run {reference.run.name}; if "
            f"both are runs of one model, give this column the same name in both runs; there are: {found}"
        ) from None


def judge_pair(
    question: RunQuestion,
    tr: float | None,
    td: float | None,
    switched: Run | None = None,
    min_mean_energy: float = MIN_MEAN_ENERGY,
) -> Verdict:
    """Judge a pair. A finished switched run is compared with the reference run, and supplies omitted times."""
    check_pair(tr, td, switched)
    switched_reference = switched and _read_switched(question, switched)
    tr_is_read = tr is None
    windows: tuple[SwitchedWindow, ...] = ()
    if switched_reference:
        from d2rpick.choice.switched.same_model import (
            explain_difference,
            refuse_other_model,
        )
        from d2rpick.choice.switched.switch_times import (
            find_switched_windows,
            read_switch_times,
            refuse_exchanged_runs,
        )

        refuse_other_model(question.reference.run, switched_reference.run)
        history = question.reference.history
        windows = find_switched_windows(switched_reference, history)
        refuse_exchanged_runs(question.reference, switched_reference, windows)
        if tr is None or td is None:
            explain = partial(
                explain_difference,
                question.reference.run,
                switched_reference.run,
            )
            tr, td = read_switch_times(
                switched_reference, history, windows, tr, td, explain
            )
    assert tr is not None
    assert td is not None
    result = answers.verify_run(question.reference, tr, td, question.settings)
    times = ["--tr", repr(tr), "--td", repr(td)]
    if switched is not None and switched_reference:
        from d2rpick.choice.switched.compared_verdict import add_comparison

        result = add_comparison(
            result,
            question.reference,
            switched_reference,
            windows,
            min_mean_energy,
            tr_is_read=tr_is_read,
        )
        times += [text for name in switched.sources for text in ("--switched", name)]
        times += ["--min-mean-energy", repr(min_mean_energy)] * (
            min_mean_energy != MIN_MEAN_ENERGY
        )
    return Verdict.about(question, result, *times, compared=switched)
