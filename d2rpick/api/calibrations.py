"""The cost of elements, fitted to runs of a site."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

from d2rpick.api import arguments
from d2rpick.api.answers import written
from d2rpick.api.document import Document
from d2rpick.api.frames import frame_of
from d2rpick.report.shell import positional

if TYPE_CHECKING:
    from collections.abc import Iterable
    from pathlib import Path

    import pandas as pd

    from d2rpick.choice.calibration import Calibration as Core
    from d2rpick.choice.calibration import Observation
    from d2rpick.choice.cost import Weights
    from d2rpick.choice.warnings import Caution


@dataclass(frozen=True, eq=False)
class Calibration(Document):
    """Answer of `calibrate`; nothing of it changes.

    ``weights`` are what `parts`, `suggest`, `plan`, `explore` and `verify` take; ``told`` names what the runs decide,
    the others keep the measured ratio.  ``misfit`` is relative to the time of a leg [-]; ``legs`` have what each took
    per cycle [us], and what it computed.
    """

    weights: Weights
    told: tuple[str, ...]
    misfit: float
    legs: tuple[Observation, ...] = field(repr=False)
    warnings: tuple[Caution, ...]
    command: tuple[str, ...] = field(repr=False)
    _core: Core = field(repr=False)

    def to_json(self) -> str:
        """Give the JSON document of ``d2rpick calibrate``, schema d2rpick/calibrate/1."""
        from d2rpick.report.calibration import DOCUMENT

        return DOCUMENT.as_json(self._core, self.command)

    def to_frame(self) -> pd.DataFrame:
        """Give a row per formulation: its weight, what was measured with OpenRadioss, whether the runs tell it.

        Examples
        --------
        >>> import d2rpick as d2
        >>> d2.calibrate("sample_data/flying_box").to_frame()["formulation"].tolist()
        ['QBAT', 'QEPH', 'point']
        """
        from d2rpick.report.calibration import COLUMNS, plain_rows

        rows = [dict(zip(COLUMNS, row, strict=True)) for row in plain_rows(self._core)]
        return frame_of(rows, COLUMNS, source=[one.name for one in self.legs])

    def save(self, path: arguments.Path) -> Path:
        """Write the TOML file that ``--weights`` reads; an existing file is replaced."""
        from d2rpick.report.calibration import as_toml

        return written(path, f"{as_toml(self._core)}\n")


def calibrate(runs: arguments.Path | Iterable[arguments.Path]) -> Calibration:
    """Fit the cost of elements to what runs of a site took, as ``d2rpick calibrate`` does.

    Parameters
    ----------
    runs : path or several
        Folders, each with the deck of one run and what its solver printed; with and without switching of one model.

    Returns
    -------
    Calibration

    Raises
    ------
    D2RPickError
        If a folder is not that of one run, nothing says what a run took, or none is without rigid parts.
    TypeError, ValueError
        If an argument is not of its kind.

    Examples
    --------
    >>> import d2rpick as d2
    >>> found = d2.calibrate("sample_data/flying_box")
    >>> round(found.weights.element_share, 2)
    0.65
    """
    from d2rpick.choice.calibration import calibrate as fitted
    from d2rpick.choice.calibration import observations_of_runs

    names = arguments.paths("runs", runs)
    observations, cautions = observations_of_runs(names)
    core = replace(fitted(observations), cautions=cautions)
    command = ("calibrate", *positional(names))
    return Calibration(core.weights, core.told, core.misfit, core.observations, core.cautions, command, core)
