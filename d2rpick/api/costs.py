"""Determine which parts may be switched and how much sets of parts save; fit element costs to the runs of a site."""

from __future__ import annotations

from typing import TYPE_CHECKING, Unpack

from d2rpick.api import arguments
from d2rpick.api.answer import Answer, Paged, build_frame, write_page
from d2rpick.api.asked import make_request, read_cost_model
from d2rpick.api.deck_in_folder import name_deck
from d2rpick.api.times import TimeArguments
from d2rpick.base.data_classes import dataclass
from d2rpick.base.errors import ArgumentError
from d2rpick.choice.parts import calibration, sets_of_parts
from d2rpick.choice.parts.cost import Weights, format_weights_as_toml
from d2rpick.report.tables import make_positional

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence
    from pathlib import Path

    import pandas as pd
    from matplotlib.figure import Figure

    from d2rpick.api.arguments import Parts, Time
    from d2rpick.api.cards import Cards
    from d2rpick.api.choosing import Choosing
    from d2rpick.api.request import Request
    from d2rpick.api.runs import Run
    from d2rpick.base.spans import Times
    from d2rpick.report.formats import RepeatedQuestion


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class PartTable(Paged, sets_of_parts.Parts):
    """Immutable answer of `parts`.

    ``rows`` contains every part with its ``verdict`` and ``reasons``, and ``sets`` the sets that are compared.
    ``recommended`` is the set to use; None if no set is recommended. Its ``parts`` and ``cost_share`` can be given to
    `suggest` and `plan`.
    """

    run: Run
    command: tuple[str, ...]
    question: RepeatedQuestion
    kind = "parts"

    def to_frame(self) -> pd.DataFrame:
        """Return a table with a row for each part.

        The columns are the keys of ``parts`` in the JSON output; unknown values are NaN.

        Examples
        --------
        >>> import d2rpick as d2
        >>> d2.parts(d2.read("sample_data/rollover_box.matsum")).to_frame()["verdict"].tolist()
        ['unknown', 'unknown']
        """
        from d2rpick.report.parts import PART

        return build_frame(
            list(map(PART.plain, self.rows)), PART.keys, source=list(self.run.sources)
        )

    def sets_frame(self) -> pd.DataFrame:
        """Return a table with a row for each set; the columns are the keys of ``sets`` in the JSON output."""
        from d2rpick.report.parts import SET

        return build_frame(
            list(map(SET.plain, self.sets)), SET.keys, source=list(self.run.sources)
        )

    def page(
        self,
        command: Sequence[str],
        judging: Sequence[str] = (),  # noqa: ARG002  other answers use the argument
        cards: Cards | None = None,  # noqa: ARG002  other answers use the argument
    ) -> str:
        """Return the page with the next step; ``command`` is the command line that repeats it."""
        from d2rpick.report.pages import parts_page

        return parts_page(self, command, self.question)

    def plot(self) -> Figure:
        """Draw the flights, and the energies of those parts that have the largest energies."""
        from d2rpick.report.figures_choice import draw_parts

        return draw_parts(self)


def parts(
    run: Run,
    *,
    deck: arguments.Deck | None = None,
    weights: Weights | arguments.Path | None = None,
    given: Parts | None = None,
    tr: Time | None = None,
    td: Time | None = None,
    **choosing: Unpack[Choosing],
) -> PartTable:
    """Determine which parts of a run may be switched and how much sets of parts save, as ``d2rpick parts`` does.

    Parameters
    ----------
    run : Run
        The run, opened with `read`; it must not be switched.
    deck : path, optional
        Main deck of the run: an LS-DYNA deck, or a starter or engine file of Radioss.  The default is the only main
        deck in the folder that was read; False means no deck.
    weights : Weights or path, optional
        Cost of an element by formulation, or the file that ``d2rpick calibrate`` wrote.
    given : number, title or several, optional
        Parts of an additional set that is compared with the others.
    tr, td : float or text, optional
        Window in which the sets are compared, or only its end [time].  By default, it ends with the longest flight.
    **choosing
        Options as for `suggest`.

    Returns
    -------
    PartTable

    Raises
    ------
    D2RPickError
        If the deck or the weights cannot be read, or if the run has no such parts.
    TypeError, ValueError
        If an argument has a wrong type or value.

    Examples
    --------
    >>> import d2rpick as d2
    >>> [row.title for row in d2.parts(d2.read("sample_data/rollover_box.matsum")).rows]
    ['box', 'step']
    """
    request = make_request(run, given, None, deck, weights, choosing)
    times = TimeArguments.of_run(run)
    return compare_parts(
        run, request, times.check_time("tr", tr), times.check_time("td", td)
    )


def compare_parts(
    run: Run, request: Request, tr: float | None, td: float | None
) -> PartTable:
    """Determine which parts may be switched, and compare sets of parts in a window that ends at td."""
    times = check_times(tr, td)
    model = read_cost_model(request)
    deck_names = [request.deck] if request.deck else []
    ids = sets_of_parts.find_given_parts(run.files, request.part)
    table = sets_of_parts.compare_sets_of_parts(
        run.files,
        request.settings,
        model,
        given_ids=ids,
        times=times,
        deck_files=deck_names,
    )
    window = [
        text
        for name, time in (("tr", tr), ("td", td))
        if time is not None
        for text in (f"--{name}", repr(time))
    ]
    command = ("parts", *window, *request.asking(), *make_positional(request.history))
    return PartTable.of(
        table,
        run=run,
        command=command,
        question=request.repeat()._replace(times=tuple(window)),
        cautions=name_deck(request),
    )


def check_times(tr: float | None, td: float | None) -> Times | float | None:
    """Return the window in which sets are compared, or its end only; raise ArgumentError for tr without td."""
    if tr is not None and td is None:
        raise ArgumentError("`tr` needs `td`, the end of the window")
    if tr is not None and td is not None and not tr < td:
        raise ArgumentError(
            f"`tr` {tr:g} `td` {td:g}: tr must lie before td; give a smaller `tr` or a larger `td`"
        )
    return td if tr is None or td is None else (tr, td)


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Calibration(Answer, calibration.FittedWeights):
    """Immutable answer of `calibrate`.

    ``weights`` can be given to `parts`, `suggest`, `plan`, `explore` and `verify`. ``told`` lists the formulations
    whose weights the runs determine; all others keep their default ratio. ``misfit`` is the rms misfit relative to the
    time of a restart segment [-]. ``legs`` contains the time per cycle [us] of each restart segment, and the elements
    and nodes that it computed.
    """

    command: tuple[str, ...]
    kind = "calibration"
    said = ("weights", "told", "misfit")

    def to_frame(self) -> pd.DataFrame:
        """Return a row per formulation: its weight, the OpenRadioss weight, and whether the runs determine the weight.

        Examples
        --------
        >>> import d2rpick as d2
        >>> d2.calibrate("sample_data/flying_box").to_frame()["formulation"].tolist()
        ['QBAT', 'QEPH', 'point']
        """
        from d2rpick.report.calibration import COLUMNS, list_plain_rows

        rows = [dict(zip(COLUMNS, row, strict=True)) for row in list_plain_rows(self)]
        return build_frame(rows, COLUMNS, source=[leg.name for leg in self.legs])

    def save(self, path: arguments.Path) -> Path:
        """Write the TOML file that ``--weights`` reads; an existing file is replaced."""
        return write_page(path, f"{format_weights_as_toml(self.weights)}\n")


def calibrate(runs: arguments.Path | Iterable[arguments.Path]) -> Calibration:
    """Fit the cost of elements to the CPU times of a site's runs, as ``d2rpick calibrate`` does.

    Parameters
    ----------
    runs : path or several
        Folders, each with the deck of one run and its solver listings; the runs should be of one model, with and
        without switching.

    Returns
    -------
    Calibration

    Raises
    ------
    D2RPickError
        If a folder does not contain exactly one run, if no file contains the CPU time of a run, or if no run is without
        rigid parts.
    TypeError, ValueError
        If an argument has a wrong type or value.

    Examples
    --------
    >>> import d2rpick as d2
    >>> found = d2.calibrate("sample_data/flying_box")
    >>> round(found.weights.element_share, 2)
    0.65
    """
    names = arguments.list_paths("runs", runs)
    observations, cautions = calibration.read_observations_of_runs(names)
    command = ("calibrate", *make_positional(names))
    return Calibration.of(
        calibration.fit_weights(observations), cautions=cautions, command=command
    )
