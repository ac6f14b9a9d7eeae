"""The parts of a run, and sets of them worth switching."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Unpack

from d2rpick.api import arguments
from d2rpick.api.answers import written
from d2rpick.api.asked import check_run, model_of
from d2rpick.api.document import Document
from d2rpick.api.frames import frame_of
from d2rpick.api.repeat import asking

if TYPE_CHECKING:
    from pathlib import Path

    import pandas as pd

    from d2rpick.api.arguments import Choosing, Parts
    from d2rpick.api.runs import Run
    from d2rpick.choice.cost import Weights
    from d2rpick.choice.sets_of_parts import Parts as Core
    from d2rpick.choice.sets_of_parts import PartSet
    from d2rpick.choice.switchable_parts import PartRow
    from d2rpick.choice.warnings import Caution


@dataclass(frozen=True, eq=False)
class PartTable(Document):
    """Answer of `parts`; nothing of it changes.

    ``rows`` has every part with its ``verdict`` and ``reasons``, ``sets`` what is worth comparing, ``recommended`` the
    set to take, None where there is none; its ``parts`` and ``cost_share`` are what `suggest` and `plan` take.
    """

    run: Run = field(repr=False)
    rows: tuple[PartRow, ...] = field(repr=False)
    sets: tuple[PartSet, ...]
    recommended: PartSet | None
    warnings: tuple[Caution, ...]
    command: tuple[str, ...] = field(repr=False)
    _core: Core = field(repr=False)

    def to_json(self) -> str:
        """Give the JSON document of ``d2rpick parts``, schema d2rpick/parts/1."""
        from d2rpick.report.parts import DOCUMENT

        return DOCUMENT.as_json(self._core, self.command)

    def to_frame(self) -> pd.DataFrame:
        """Give a row per part.

        The columns are the keys of ``parts`` in the JSON; what is not known is NaN.

        Examples
        --------
        >>> import d2rpick as d2
        >>> d2.parts(d2.read("sample_data/rollover_box.matsum")).to_frame()["verdict"].tolist()
        ['unknown', 'unknown']
        """
        from d2rpick.report.parts import PART

        return frame_of(list(map(PART.plain, self.rows)), PART.keys, source=list(self.run.sources))

    def sets_frame(self) -> pd.DataFrame:
        """Give a row per set; the columns are the keys of ``sets`` in the JSON."""
        from d2rpick.report.parts import SET

        return frame_of(list(map(SET.plain, self.sets)), SET.keys, source=list(self.run.sources))

    def report(self, path: arguments.Path) -> Path:
        """Write everything to one HTML page that needs no network; an existing file is replaced."""
        from d2rpick.report.pages import parts_page

        return written(path, parts_page(self._core, ("d2rpick", *self.command)))


def parts(
    run: Run,
    *,
    deck: arguments.Path | None = None,
    weights: Weights | arguments.Path | None = None,
    given: Parts | None = None,
    tr: float | None = None,
    td: float | None = None,
    **choosing: Unpack[Choosing],
) -> PartTable:
    """Say which parts of a run may be switched and what sets of them save, as ``d2rpick parts`` does.

    Parameters
    ----------
    run : Run
        As `read` gives it, without switching.
    deck : path, optional
        Main deck of the run: of LS-DYNA, or a starter or engine file of Radioss.
    weights : Weights or path, optional
        Cost of an element by formulation, or the file that ``d2rpick calibrate`` wrote.
    given : number, title or several, optional
        A set to be compared too.
    tr, td : float, optional
        The window to compare in, or its end alone [time].  Default: at the end of the longest flight.
    **choosing
        As for `suggest`.

    Returns
    -------
    PartTable

    Raises
    ------
    D2RPickError
        If the deck or the weights cannot be read, or the run has no such parts.
    TypeError, ValueError
        If an argument is not of its kind.

    Examples
    --------
    >>> import d2rpick as d2
    >>> [row.title for row in d2.parts(d2.read("sample_data/rollover_box.matsum")).rows]
    ['box', 'step']
    """
    from d2rpick.choice.sets_of_parts import given_parts, parts_of

    check_run(run)
    settings = arguments.settings(choosing, with_deck=True)
    times = _times(tr, td)
    names = arguments.part_names("given", given)
    model, options = model_of(deck, weights)
    given_ids = given_parts(run.files, names)
    core = parts_of(run.files, settings, model, given=given_ids, times=times, beside=options[1:2])
    named = [(f"--{name}", repr(value)) for name, value in (("tr", tr), ("td", td)) if value is not None]
    window = [text for pair in named for text in pair]
    command = ("parts", *options, *window, *asking(run, run.chosen._replace(parts=names), choosing))
    return PartTable(run, core.rows, core.sets, core.recommended, core.cautions, command, core)


def _times(tr: float | None, td: float | None) -> tuple[float, float] | float | None:
    if td is None:
        if tr is not None:
            raise ValueError("tr needs td, the end of the window")
        return None
    return arguments.number("td", td) if tr is None else arguments.window("tr, td", (tr, td))
