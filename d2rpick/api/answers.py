"""Answers about one run: the choice of switch times, and the verdict on a pair."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Unpack

from d2rpick.api import arguments
from d2rpick.api.asked import asked_of
from d2rpick.api.document import Document
from d2rpick.api.frames import frame_of
from d2rpick.files import write_whole

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    import pandas as pd
    from matplotlib.figure import Figure

    from d2rpick.api.arguments import Choosing, Parts
    from d2rpick.api.runs import Run
    from d2rpick.choice import suggest as choice
    from d2rpick.choice import verify as judgement
    from d2rpick.choice.candidates import Candidate
    from d2rpick.choice.cost import Weights
    from d2rpick.choice.health import Health
    from d2rpick.choice.judged_card import SolverInput
    from d2rpick.choice.ranking import Quality
    from d2rpick.choice.situation import Situation
    from d2rpick.choice.suggest import Pair
    from d2rpick.choice.trade_off import TradeOff
    from d2rpick.choice.warnings import Caution
    from d2rpick.flight.flight import Flight
    from d2rpick.report.explorer import Explorer
    from d2rpick.report.page import PageContext


@dataclass(frozen=True, eq=False)
class Answer(Document):
    """What a choice and a verdict have in common.

    ``situation`` is what the record tells about td, ``warnings`` are (``code``, ``message``), ``health`` how far the
    run can be trusted, None where its files hold nothing to judge it by; ``command`` is the command line that gives the
    same answer, with ``<weights in memory>`` for the file where these were no file.  Times are in the unit of the run.
    """

    run: Run = field(repr=False)
    situation: Situation = field(repr=False)
    warnings: tuple[Caution, ...]
    health: Health | None = field(repr=False)
    command: tuple[str, ...] = field(repr=False)
    _asking: tuple[str, ...] = field(repr=False)

    @property
    def td(self) -> float:
        """When the parts are switched back to deformable [time]."""
        return self.situation.td

    @property
    def flight(self) -> Flight:
        """Window of free flight around td: ``start``, ``end``, ``source``."""
        return self.situation.flight

    @property
    def basis(self) -> str:
        """What the answer rests on: ``"parts"``, ``"oscillator"`` or ``"energy"``."""
        return self.situation.basis

    @property
    def kinetic_share(self) -> float | None:
        """K, the share of the vibration energy that no tr can save; None on basis ``"energy"`` [-]."""
        return self.situation.kinetic_share

    def _record(
        self,
        tr: float | None,
        td_window: tuple[float, float] | None = None,
    ) -> PageContext:
        from d2rpick.choice.explored import explored_around
        from d2rpick.choice.judged_card import CardRequest, input_for
        from d2rpick.choice.of_run import Reference

        reference = Reference(self.run.files, self.situation.history)
        explorer = explorer_of([explored_around(reference, self.situation, td_window)], self._asking)
        card = None if tr is None else input_for(reference, self.situation, tr, CardRequest())
        return page_record(self.run, self.command, card, explorer)


@dataclass(frozen=True, eq=False)
class Suggestion(Answer):
    """Answer of `suggest`; nothing of it changes.

    ``candidates`` are ranked, best first; ``recommended`` and ``better_pair`` have ``tr``, ``td`` and ``residual``, or
    are None, with the reason in ``warnings``.
    """

    candidates: Sequence[Candidate] = field(repr=False)
    recommended: Pair | None
    better_pair: Pair | None
    _core: choice.Suggestion = field(repr=False)

    @property
    def quality(self) -> Quality | None:
        """How good the recommended pair is: ``grade`` good, fair or poor, with ``reasons``; None without one."""
        return self._core.quality

    def to_json(self) -> str:
        """Give the JSON document of ``d2rpick suggest``, schema d2rpick/suggest/1."""
        from d2rpick.report.suggestion import DOCUMENT

        return DOCUMENT.as_json(self._core, self.command)

    def to_frame(self) -> pd.DataFrame:
        """Give the candidates as a table at full precision.

        Returns
        -------
        pandas.DataFrame
            A row per candidate, best first, a column per key of ``candidates`` in the JSON; what is not known is NaN.
            ``attrs``: ``td``, ``basis``, ``source``.

        Examples
        --------
        >>> import d2rpick as d2
        >>> answer = d2.suggest(d2.read("sample_data/energy.csv"), td=0.064)
        >>> answer.to_frame().query("recommended")["tr"].round(6).tolist()
        [0.012885]
        """
        from d2rpick.report.suggestion import CANDIDATE

        source = list(self.situation.history.source)
        return frame_of(self.to_dict()["candidates"], CANDIDATE.keys, td=self.td, basis=self.basis, source=source)

    def plot(self) -> Figure:
        """Draw the energy with its level at td, and the choice, as a matplotlib Figure."""
        from d2rpick.report.figures_choice import draw_suggestion

        return draw_suggestion(self._core)

    def report(self, path: arguments.Path) -> Path:
        """Write the answer to one HTML page that needs no network; an existing file is replaced."""
        from d2rpick.report.pages import suggestion_page

        pair = self.recommended
        page = suggestion_page(self._core, self._record(pair.tr if pair else None, self._core.td_window))
        return written(path, page)


@dataclass(frozen=True, eq=False)
class Verdict(Answer):
    """Answer of `verify`; nothing of it changes.

    ``verified``: the pair is good; ``reasons``: why not, or what to know; ``tr_ok`` and ``td_ok`` are None where
    the record does not tell; ``candidate`` has the measures of the pair.
    """

    verified: bool
    reasons: tuple[str, ...]
    tr_ok: bool | None
    td_ok: bool | None
    candidate: Candidate = field(repr=False)
    _core: judgement.Verdict = field(repr=False)

    @property
    def tr(self) -> float:
        """When the parts are switched to rigid [time]."""
        return self.candidate.tr

    @property
    def quality(self) -> Quality | None:
        """How good the pair is: ``grade`` good, fair or poor, with ``reasons``; None where it does not verify."""
        return self._core.quality

    def to_json(self) -> str:
        """Give the JSON document of ``d2rpick verify``, schema d2rpick/verify/1."""
        from d2rpick.report.verdict import DOCUMENT

        return DOCUMENT.as_json(self._core, self.command)

    def to_frame(self) -> pd.DataFrame:
        """Give the measures of the pair as a table of one row, with the columns of the csv; what is not known is NaN.

        Examples
        --------
        >>> import d2rpick as d2
        >>> verdict = d2.verify(d2.read("sample_data/energy.csv"), tr=0.0135867, td=0.0687534)
        >>> verdict.to_frame()["verified"].tolist()
        [True]
        """
        from d2rpick.report.verdict import measures

        found = measures(self._core)
        return frame_of([found], list(found), basis=self.basis, source=list(self.situation.history.source))

    def plot(self) -> Figure:
        """Draw the energy with its level at td, and the pair, as a matplotlib Figure."""
        from d2rpick.report.figures_choice import draw_verdict

        return draw_verdict(self._core)

    def report(self, path: arguments.Path) -> Path:
        """Write the verdict to one HTML page that needs no network; an existing file is replaced."""
        from d2rpick.report.pages import verdict_page

        return written(path, verdict_page(self._core, self._record(self.tr if self.verified else None)))


def suggest(
    run: Run,
    td: float | None = None,
    *,
    td_window: tuple[float, float] | None = None,
    parts: Parts | None = None,
    flying: Parts | None = None,
    deck: arguments.Path | None = None,
    weights: Weights | arguments.Path | None = None,
    **choosing: Unpack[Choosing],
) -> Suggestion:
    """Choose tr for ``td``, or both times with td in ``td_window`` or the longest flight, as ``d2rpick suggest`` does.

    Parameters
    ----------
    run : Run
        As `read` gives it, without switching.
    td : float
        When the parts are switched back [time].
    td_window : (float, float)
        Instead of ``td``: where to choose it [time]; without both, in the longest flight.
    parts : number, title or several, optional
        The parts to be switched; ``"10-19"`` is a range, ``"flying"`` all deformable parts that fly together,
        ``"all"`` all that have energy.
    flying : number, title or several, optional
        What flies together with them.
    deck : path, optional
        Main deck of the run: tells what the parts cost, which are springs, which rigid bodies they become, and the
        parts of ``"recommended"``.  Without it they are taken for one body: ``position_error_assumes`` of a candidate.
    weights : Weights or path, optional
        Cost of an element by formulation, or the file that ``d2rpick calibrate`` wrote.
    **choosing
        How to choose: ``after``, ``margin``, ``tolerance``, ``max_kinetic_share``, ``max_residual``, ``oscillator``
        with ``v0``, ``fit_window``, ``replay``, ``strict``, ``cost_share``, ``step_ratio``; what they mean stands in
        ``d2rpick.api.arguments.Choosing``.

    Returns
    -------
    Suggestion

    Raises
    ------
    D2RPickError
        If the run has no such parts or energy, or td lies outside the record.
    TypeError, ValueError
        If an argument is not of its kind.

    Examples
    --------
    >>> import d2rpick as d2
    >>> run = d2.read("sample_data/energy.csv")
    >>> answer = d2.suggest(run, td_window=(0.06, 0.07))
    >>> f"{answer.recommended.tr:.6f} {answer.recommended.td:.6f}"
    '0.013587 0.068753'
    """
    from d2rpick.choice.of_run import suggest_of

    if td is not None and td_window is not None:
        raise TypeError("td or td_window was expected, and not both")
    window = None if td_window is None else arguments.window("td_window", td_window)
    wanted = window if td is None else arguments.number("td", td)
    asked = asked_of(run, parts, flying, deck, weights, choosing)
    core = suggest_of(asked.reference, wanted, asked.settings)
    core = replace(core, cautions=(*core.cautions, *asked.cautions))
    at = ("--td", repr(wanted)) if isinstance(wanted, float) else ("--td-window", *map(repr, wanted)) if wanted else ()
    return Suggestion(
        run=run,
        situation=core.situation,
        warnings=core.cautions,
        health=core.health,
        command=("suggest", *at, *asked.options),
        _asking=asked.options,
        candidates=core.candidates,
        recommended=core.recommended,
        better_pair=core.better_pair,
        _core=core,
    )


def verify(
    run: Run,
    tr: float,
    td: float,
    *,
    switched: Run | None = None,
    parts: Parts | None = None,
    flying: Parts | None = None,
    deck: arguments.Path | None = None,
    weights: Weights | arguments.Path | None = None,
    **choosing: Unpack[Choosing],
) -> Verdict:
    """Judge one pair of switch times, as ``d2rpick verify`` does.

    Parameters
    ----------
    run : Run
        As `read` gives it, without switching.
    tr, td : float
        Switch times [time].
    switched : Run, optional
        A finished run with these switch times, to be compared with ``run``.
    parts, flying, deck, weights, **choosing
        As for `suggest`.

    Returns
    -------
    Verdict

    Raises
    ------
    D2RPickError
        If the run has no such parts or energy, a time lies outside the record, or tr is not before td.
    TypeError, ValueError
        If an argument is not of its kind.

    Examples
    --------
    >>> import d2rpick as d2
    >>> run = d2.read("sample_data/energy.csv")
    >>> d2.verify(run, tr=0.0135867, td=0.0687534).verified
    True
    """
    from d2rpick.choice.of_run import compare_with, verify_of

    pair = arguments.number("tr", tr), arguments.number("td", td)
    asked = asked_of(run, parts, flying, deck, weights, choosing)
    core = verify_of(asked.reference, *pair, asked.settings)
    times = ["--tr", repr(pair[0]), "--td", repr(pair[1])]
    if switched is not None:
        core = compare_with(core, asked.reference, asked.reference.like(switched.files, asked.selection))
        times += [text for name in switched.sources for text in ("--switched", name)]
    core = replace(core, cautions=(*core.cautions, *asked.cautions))
    return Verdict(
        run=run,
        situation=core.situation,
        warnings=core.cautions,
        health=core.health,
        command=("verify", *times, *asked.options),
        _asking=asked.options,
        verified=core.verified,
        reasons=core.reasons,
        tr_ok=core.tr_ok,
        td_ok=core.td_ok,
        candidate=core.candidate,
        _core=core,
    )


def explorer_of(found: Iterable[TradeOff | None], asking: Sequence[str]) -> Explorer | None:
    """Give what can be explored on a page; ``asking`` is the command line behind the td."""
    from d2rpick.report.explorer import Explorer

    trade_offs = tuple(one for one in found if one)
    return Explorer(trade_offs, (("d2rpick", "suggest", "--td"), asking)) if trade_offs else None


def page_record(
    run: Run,
    command: Sequence[str],
    card: SolverInput | None,
    explorer: Explorer | None,
) -> PageContext:
    """Give what a page shows besides the answer that ``command`` repeats."""
    from d2rpick.report.page import PageContext

    return PageContext(run.files, ("d2rpick", *command), (), card, explorer=explorer)


def written(path: arguments.Path, page: str) -> Path:
    """Write a page and give its path."""
    place = Path(*arguments.paths("path", path))
    write_whole(place, page.encode())
    return place
