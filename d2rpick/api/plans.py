"""The plan of a run."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Unpack

from d2rpick.api import arguments
from d2rpick.api.answers import explorer_of, written
from d2rpick.api.asked import asked_of
from d2rpick.api.document import Document
from d2rpick.api.frames import frame_of

if TYPE_CHECKING:
    from collections.abc import Iterable
    from pathlib import Path

    import pandas as pd
    from matplotlib.figure import Figure

    from d2rpick.api.arguments import Choosing, Parts
    from d2rpick.api.runs import Run
    from d2rpick.choice.cost import Weights
    from d2rpick.choice.plan import Plan as Core
    from d2rpick.choice.plan import Planned
    from d2rpick.choice.warnings import Caution


@dataclass(frozen=True, eq=False)
class Plan(Document):
    """Answer of `plan`; nothing of it changes.

    ``flights`` has a row per flight with ``window``, ``status`` and ``reason``; ``windows`` are the (tr, td) that this
    run supports, ``all_windows`` also those that wait for a switched run, ``next_run`` those that are done and
    ``windows``: what the next run is switched in, none where no window is new.  Times in the unit of the run.
    """

    run: Run = field(repr=False)
    flights: tuple[Planned, ...] = field(repr=False)
    windows: tuple[tuple[float, float], ...]
    all_windows: tuple[tuple[float, float], ...]
    next_run: tuple[tuple[float, float], ...]
    warnings: tuple[Caution, ...]
    command: tuple[str, ...] = field(repr=False)
    _asking: tuple[str, ...] = field(repr=False)
    _core: Core = field(repr=False)

    @property
    def rigid_fraction(self) -> float:
        """Share of the record in which the parts are rigid by ``windows`` [-]."""
        return self._core.rigid_fraction

    def to_json(self) -> str:
        """Give the JSON document of ``d2rpick plan``, schema d2rpick/plan/1."""
        from d2rpick.report.plan import DOCUMENT

        return DOCUMENT.as_json(self._core, self.command)

    def to_frame(self) -> pd.DataFrame:
        """Give a row per flight, a column per key of ``windows`` in the JSON; what is not known is NaN.

        Examples
        --------
        >>> import d2rpick as d2
        >>> d2.plan(d2.read("sample_data/energy.csv")).to_frame()["status"].tolist()
        ['supported']
        """
        from d2rpick.report.plan import WINDOW

        return frame_of(self.to_dict()["windows"], WINDOW.keys, source=list(self._core.history.source))

    def plot(self) -> Figure:
        """Draw the energy with the flights and the rigid windows, as a matplotlib Figure."""
        from d2rpick.report.figures_choice import draw_plan

        return draw_plan(self._core)

    def report(self, path: arguments.Path) -> Path:
        """Write the plan, with the solver's cards, to one HTML page that needs no network; a file is replaced."""
        from d2rpick.choice.explored import explored_flights
        from d2rpick.choice.judged_card import CardRequest, card_of_plan
        from d2rpick.choice.of_run import Reference
        from d2rpick.report.pages import plan_page

        card = card_of_plan(self._core, self.run.files, CardRequest())
        found = explored_flights(Reference(self.run.files, self._core.history), self._core)
        text = card[0].text if card else None
        page = plan_page(self._core, self.run.files, ("d2rpick", *self.command), text, explorer_of(found, self._asking))
        return written(path, page)


def plan(
    run: Run,
    *,
    parts: Parts | None = None,
    flying: Parts | None = None,
    deck: arguments.Path | None = None,
    weights: Weights | arguments.Path | None = None,
    min_rigid: float | None = None,
    done: Iterable[tuple[float, float]] = (),
    before: Run | None = None,
    **choosing: Unpack[Choosing],
) -> Plan:
    """Plan the rigid windows of a run, as ``d2rpick plan`` does.

    Parameters
    ----------
    run : Run
        As `read` gives it: without switching, or switched in the windows that are ``done``.
    parts, flying, deck, weights, **choosing
        As for `suggest`.
    min_rigid : float, optional
        Leave shorter windows out [time].  Default: 5 % of the record, and a window that locks in energy before one more
        than twice as long.
    done : pairs of float
        Windows (tr, td) in which the run was switched [time].
    before : Run, optional
        The run that these were planned from; its landings are compared.

    Returns
    -------
    Plan

    Raises
    ------
    D2RPickError
        If the run has no such parts or energy, or its parts were deformable in a window that is done.
    TypeError, ValueError
        If an argument is not of its kind.

    Examples
    --------
    >>> import d2rpick as d2
    >>> found = d2.plan(d2.read("sample_data/rollover_box.matsum"), parts="box")
    >>> [(round(tr, 3), round(td, 3)) for tr, td in found.windows]
    [(0.097, 0.37)]
    """
    from d2rpick.choice.plan import plan_of
    from d2rpick.deck.printed_card import check_windows

    shortest = None if min_rigid is None else arguments.number("min_rigid", min_rigid, 0.0)
    pairs = [arguments.window(f"done[{number}]", list(pair)) for number, pair in enumerate(done)]
    if before is not None and not pairs:
        raise ValueError("before is a run, but done names no window that was planned from it")
    asked = asked_of(run, parts, flying, deck, weights, choosing)
    earlier = asked.reference.like(before.files, asked.selection) if before is not None else None
    windows = check_windows(pairs) if pairs else ()
    core = plan_of(asked.reference, asked.settings, min_rigid=shortest, done=windows, before=earlier)
    core = replace(core, cautions=(*core.cautions, *asked.cautions))
    own = [] if shortest is None else ["--min-rigid", repr(shortest)]
    own += ["--done", "-"] if windows else []  # on its standard input, a line for each
    own += [text for name in (before.sources if before else ()) for text in ("--before", name)]
    return Plan(
        run=run,
        flights=core.rows,
        windows=core.windows(),
        all_windows=core.windows(every=True),
        next_run=core.next_run(),
        warnings=core.cautions,
        command=("plan", *own, *asked.options),
        _asking=asked.options,
        _core=core,
    )
