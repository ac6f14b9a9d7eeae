"""Measures of a pair of times, compared with the motion of the oscillator and with independent digits."""

import numpy as np
import pytest
from hypothesis import assume, given, strategies as st

from d2rpick.vibration import measures
from d2rpick.vibration.modes import Mode
from d2rpick.vibration.oscillator import Replay, make_from_mode, to_mode
from tests import paper
from tests.records import MODES, compute_replayed_residual


@given(MODES, st.floats(0, 3), st.floats(0, 3))
def test_measures_by_formula_are_those_of_the_motion(
    mode: Mode, tr: float, window: float
) -> None:
    td = tr + window
    oscillator, start = make_from_mode(mode, tr)
    replay = Replay(oscillator, start, tr, tr, td)
    at_td = replay.reference(td)
    whole = float(oscillator.vibration_energy(at_td))
    assume(whole > 1e-9)
    kinetic = measures.kinetic_share(mode, td)
    lock_in = float(measures.lock_in_error(mode, tr, td))
    assert kinetic == pytest.approx(
        1 - float(oscillator.internal_energy(at_td)) / whole, abs=1e-7
    )
    frozen = replay.motion(td)
    apart = float((frozen.y - frozen.z) - (at_td.y - at_td.z))
    assert lock_in == pytest.approx(abs(apart) / np.sqrt(whole), abs=1e-6, rel=1e-7)
    assert replay.residual() == pytest.approx(
        measures.residual(lock_in, kinetic), abs=1e-6, rel=1e-7
    )
    assert float(
        compute_replayed_residual(mode, np.array([tr]), td)[0]
    ) == pytest.approx(replay.residual(), abs=1e-6, rel=1e-7)


def test_each_measure_has_a_column() -> None:
    mode, tr = to_mode(paper.OSCILLATOR, 6.0), np.array([0.01, 0.02])
    columns = measures.measured(
        mode,
        tr,
        paper.TD,
        lambda _: tr,
        lambda error, *_: (error, error - 0.1, error + 0.1),
    )
    assert (*columns,) == measures.Measured._fields
    assert {column.shape for column in columns.values()} == {tr.shape}
    spread = measures.spread(5, [(np.array([3, 1]), columns)])
    assert measures.compared(spread).tolist() == [False, True, False, True, False]
    assert spread["timing_tolerance"][[1, 3]].tolist() == [0.02, 0.01]


def test_the_published_pair_loses_nearly_all_vibration() -> None:
    mode = to_mode(paper.OSCILLATOR, 6.0)
    assert measures.kinetic_share(mode, paper.TD) == pytest.approx(
        paper.KINETIC_SHARE, rel=1e-10
    )
    assert measures.residual(
        float(measures.lock_in_error(mode, 0.0128852793630525, paper.TD)),
        paper.KINETIC_SHARE,
    ) == (pytest.approx(0.957444, abs=1e-6))


@pytest.mark.slow
@given(MODES, st.floats(0, 3), st.floats(0, 3))
def test_the_timing_tolerance_is_where_the_error_has_grown(
    mode: Mode, tr: float, window: float
) -> None:
    td = tr + window
    assume(float(mode.vibration_energy(td)) > 1e-6)
    tolerance = float(
        measures.timing_tolerance(
            mode,
            np.array([tr]),
            td,
            measures.lock_in_error(mode, np.array([tr]), td),
        )[0]
    )
    lock_in_at_tr = float(measures.lock_in_error(mode, tr, td))
    grown = lock_in_at_tr + measures.TOLERATED_GROWTH
    inside = np.linspace(tr - tolerance, tr + tolerance, 501)[1:-1]
    assert (
        max(measures.lock_in_error(mode, float(t), td) for t in inside)
        <= grown * (1 + 1e-9) + 1e-9
    )
    ends = [measures.lock_in_error(mode, tr + side * tolerance, td) for side in (-1, 1)]
    assert max(ends) == pytest.approx(grown, rel=1e-6) or tolerance == pytest.approx(
        2 * np.pi / mode.omega
    )
