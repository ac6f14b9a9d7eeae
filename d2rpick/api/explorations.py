"""What each td costs, of a run."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Unpack

from d2rpick.api import arguments
from d2rpick.api.answers import explorer_of, page_record, written
from d2rpick.api.asked import asked_of
from d2rpick.api.document import Document
from d2rpick.api.frames import frame_of

if TYPE_CHECKING:
    from pathlib import Path

    import pandas as pd
    from matplotlib.figure import Figure

    from d2rpick.api.arguments import Choosing, Parts
    from d2rpick.api.runs import Run
    from d2rpick.choice.cost import Weights
    from d2rpick.choice.trade_off import Offer, TradeOff
    from d2rpick.choice.warnings import Caution


@dataclass(frozen=True, eq=False)
class Exploration(Document):
    """Answer of `explore`; nothing of it changes.

    ``offers`` are by ascending td, each with ``tr``, ``error``, ``rigid_time``, ``unbeaten``, ``quality`` and its
    measures in ``best``; ``recommended`` is the one that `suggest` chooses, ``step`` the nearest unbeaten td with
    half the error of ``start``, the td asked for or else the one that saves most.  ``answer`` says it in a sentence.
    """

    run: Run = field(repr=False)
    offers: tuple[Offer, ...] = field(repr=False)
    recommended: Offer | None
    start: Offer | None = field(repr=False)
    step: Offer | None = field(repr=False)
    warnings: tuple[Caution, ...]
    command: tuple[str, ...] = field(repr=False)
    _asking: tuple[str, ...] = field(repr=False)
    _core: TradeOff = field(repr=False)

    @property
    def answer(self) -> str:
        """The shortest sensible answer."""
        from d2rpick.report.trade_off import answer

        return answer(self._core)

    def to_json(self) -> str:
        """Give the JSON document of ``d2rpick explore``, schema d2rpick/explore/1."""
        from d2rpick.report.trade_off import DOCUMENT

        return DOCUMENT.as_json(self._core, self.command)

    def to_frame(self) -> pd.DataFrame:
        """Give a row per td, a column per single value of ``offers`` in the JSON; what is not known is NaN.

        Examples
        --------
        >>> import d2rpick as d2
        >>> table = d2.explore(d2.read("sample_data/energy.csv"), td_window=(0.06, 0.07), steps=10).to_frame()
        >>> table.query("recommended")[["tr", "td"]].round(6).values.tolist()
        [[0.013587, 0.068753]]
        """
        from d2rpick.report.trade_off import COLUMNS

        return frame_of(self.to_dict()["offers"], COLUMNS, source=list(self._core.situation.history.source))

    def plot(self) -> Figure:
        """Draw energy, error and rigid time over td, as a matplotlib Figure."""
        from d2rpick.report.figures_choice import draw_trade_off

        return draw_trade_off(self._core)

    def report(self, path: arguments.Path) -> Path:
        """Write the answer to one HTML page that needs no network; an existing file is replaced."""
        from d2rpick.choice.judged_card import CardRequest, input_for
        from d2rpick.choice.of_run import Reference
        from d2rpick.report.pages import trade_off_page

        core = self._core
        pair, explorer = core.suggestion.recommended, explorer_of([core], self._asking)
        there = core.suggestion.situation
        card = input_for(Reference(self.run.files, there.history), there, pair.tr, CardRequest()) if pair else None
        return written(path, trade_off_page(core, page_record(self.run, self.command, card, explorer)))


def explore(
    run: Run,
    td: float | None = None,
    *,
    td_window: tuple[float, float] | None = None,
    steps: int = 200,
    parts: Parts | None = None,
    flying: Parts | None = None,
    deck: arguments.Path | None = None,
    weights: Weights | arguments.Path | None = None,
    **choosing: Unpack[Choosing],
) -> Exploration:
    """Find what each td costs, as ``d2rpick explore`` does.

    Parameters
    ----------
    run : Run
        As `read` gives it, without switching.
    td : float, optional
        Explored too, and what others are compared with [time].
    td_window : (float, float), optional
        Where td is looked for [time].  Default: the longest flight; where none is seen but td is named, the record.
    steps : int
        Number of evenly spaced td; peaks of the energy come on top.
    parts, flying, deck, weights, **choosing
        As for `suggest`.

    Returns
    -------
    Exploration

    Raises
    ------
    D2RPickError
        If the run has no such parts or energy, a time lies outside the record, or no flight is seen and no td
        is named.
    TypeError, ValueError
        If an argument is not of its kind.

    Examples
    --------
    >>> import d2rpick as d2
    >>> found = d2.explore(d2.read("sample_data/energy.csv"), td=0.064, td_window=(0.06, 0.07), steps=100)
    >>> round(found.step.td - found.start.td, 4)
    0.0048
    """
    from d2rpick.choice.trade_off import explore_of

    wanted = None if td is None else arguments.number("td", td)
    window = None if td_window is None else arguments.window("td_window", td_window)
    count = arguments.whole("steps", steps, 1)
    asked = asked_of(run, parts, flying, deck, weights, choosing)
    core = explore_of(asked.reference, asked.settings, window, td=wanted, steps=count)
    core = replace(core, cautions=(*core.cautions, *asked.cautions))
    times = [] if wanted is None else ["--td", repr(wanted)]
    times += ["--td-window", *map(repr, window)] if window else []
    return Exploration(
        run=run,
        offers=core.offers,
        recommended=core.recommended,
        start=core.start,
        step=core.step,
        warnings=core.cautions,
        command=("explore", *times, "--steps", str(count), *asked.options),
        _asking=asked.options,
        _core=core,
    )
