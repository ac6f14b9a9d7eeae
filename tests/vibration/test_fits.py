"""Windows of a record are fitted once."""

from __future__ import annotations

from typing import TYPE_CHECKING

from d2rpick.choice.examine import examine
from d2rpick.choice.settings import Settings
from d2rpick.vibration.fits import Fits
from d2rpick.vibration.identify import identify
from tests import paper
from tests.records import ENERGY, TIME

if TYPE_CHECKING:
    import numpy as np


def test_a_window_is_fitted_once_by_each_fitter_and_demand() -> None:
    fits, calls = Fits(), []

    def counting(time: np.ndarray, energy: np.ndarray, *, quick: bool = False) -> object:
        calls.append((time.size, quick))
        return identify(time, energy, quick=quick)

    fitter = fits.remembered("one", counting)  # type: ignore[arg-type]
    first = fitter(TIME, ENERGY)
    assert fitter(TIME, ENERGY) is first
    fitter(TIME, ENERGY, quick=True)
    fitter(TIME[1:], ENERGY[1:])
    fits.remembered("other", counting)(TIME, ENERGY)  # type: ignore[arg-type]
    assert calls == [(1501, False), (1501, True), (1500, False), (1501, False)]
    assert fitter(TIME[:0], ENERGY[:0]).reason


def test_what_was_fitted_before_changes_no_answer() -> None:
    fits = Fits()
    for td in (0.05, paper.TD, 0.1):
        anew, again = (examine(paper.history(), td, Settings(), known) for known in (None, fits))
        assert again.evidence.span == anew.evidence.span
        assert again.evidence.fit is not None
        assert anew.evidence.fit is not None
        assert again.evidence.fit.mode == anew.evidence.fit.mode
