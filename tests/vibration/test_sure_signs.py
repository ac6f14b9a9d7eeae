"""A sign is claimed of a part where its motion is sure: one deformation, or modes that do not mix."""

import numpy as np
import pytest

from d2rpick.choice.answers import suggest
from d2rpick.choice.question import Settings
from d2rpick.choice.situation import examine
from d2rpick.histories.history import History
from d2rpick.vibration.measures import kinetic_share, lock_in_error
from d2rpick.vibration.part_signs import SignedParts, by_own_modes
from d2rpick.vibration.waves import Waves, all_zeros, followed
from tests.benchmarks.promise_parts import Motion, history
from tests.energies import sure
from tests.records import noisy

TIME = np.arange(0, 0.4, 4e-4)
NAMES = ("A", "B")


def planes(share: float) -> Motion:
    """A bends in two planes, of which the second has that share of its energy; B has one mode."""
    forms = np.array([np.diag([1 - share, share, 0.0]), np.diag([0.0, 0.0, 0.5])])
    return Motion(7.7, 2 * np.pi * np.array([29.2, 70.1, 48.76]), np.array([2.95, 4.64, -0.82]), forms)


def grouped() -> Motion:
    """Three springs in which three modes mix; the first two are one part."""
    rows = np.array([[1.0, 0.7, -0.2], [0.8, -0.9, 0.4], [0.3, 0.2, 1.0]])
    forms = np.einsum("si,sj->sij", rows, rows)
    return Motion(
        3.0,
        2 * np.pi * np.array([20.0, 33.0, 51.0]),
        np.array([0.3, 1.9, -0.7]),
        np.stack([forms[0] + forms[1], forms[2]]),
    )


def written(motion: Motion, noise: float = 0.0) -> History:
    energies = motion.energies(TIME)
    return history(TIME, np.maximum(np.stack([noisy(row, noise, seed=2) for row in energies.T], axis=1), 0.0))


@pytest.mark.slow
@pytest.mark.parametrize(("share", "noise"), [(0.003, 0.0), (0.03, 0.0), (0.03, 2e-3), (0.45, 2e-3)])
def test_of_a_part_that_bends_in_two_planes_the_residual_is_in_its_range(share: float, noise: float) -> None:
    truth, td = planes(share), 0.31
    answer = suggest(written(truth, noise), td, Settings(after=0.0))
    assert answer.situation.basis == "parts"
    for one in answer.candidates[:6]:
        assert sure(one.residual) - 0.05 <= truth.residual(one.tr, td) <= sure(one.residual_high) + 0.05


def test_minima_that_stay_above_zero_prove_no_sign() -> None:
    energy = planes(0.03).energies(TIME)[:, 0]
    (zeros,) = all_zeros(TIME, np.sqrt(energy)[np.newaxis])
    tracked = np.where(np.searchsorted(zeros.sure, TIME) % 2, -1, 1) * np.sqrt(energy)
    assert followed(TIME, tracked, zeros) is None
    own = sure(by_own_modes(TIME, energy, None))
    assert len(own.model.amplitudes(TIME)) == 2


def test_what_a_second_plane_may_hold_unseen_widens_the_residual() -> None:
    small = SignedParts(TIME, planes(5e-4).energies(TIME), NAMES)
    assert small.names == NAMES
    assert all(isinstance(motion.model, Waves) for motion in small.motions)  # taken for one plane
    tr, td = np.array([0.05, 0.1]), 0.2072
    told = np.sqrt(np.sum((small.amplitudes(tr).T - small.amplitudes(td)) ** 2, axis=1) + small.kinetic_energy(td))
    told /= np.sqrt(small.vibration_energy(td))
    high = small.residual_bound(told, tr, td)
    truth = [planes(5e-4).residual(one, td) for one in tr]
    assert np.all(high > told + 5e-4)
    assert np.all(np.abs(told - truth) < 0.02)
    assert np.all(truth <= high + 1e-3)


def test_parts_of_several_springs_in_which_modes_mix_have_no_sign() -> None:
    parts = SignedParts(TIME, grouped().energies(TIME), NAMES)
    assert parts.names == ("B",)
    assert [one.name for one in parts.unsigned] == ["A"]
    assert examine(written(grouped()), 0.3, Settings(after=0.0)).basis != "parts"


def test_what_crosses_between_modes_in_the_parts_is_no_part_of_the_error() -> None:
    """The energy of the parts alone may come back wrong by it at td, and is right a moment later."""
    rows = np.array([[0.9, 0.6], [0.8, -0.3]])
    forms = np.einsum("pi,pj->pij", rows, rows)
    truth = Motion(3.0, 2 * np.pi * np.array([24.0, 37.0]), np.array([0.4, 2.1]), forms)
    parts = SignedParts(TIME, truth.energies(TIME), NAMES)
    assert parts.names == NAMES
    td = 0.31
    for tr in (0.05, 0.1, 0.2):
        found = np.hypot(lock_in_error(parts, tr, td), np.sqrt(kinetic_share(parts, td)))
        assert found == pytest.approx(truth.residual(tr, td), abs=1e-3)


def test_the_share_of_a_part_is_that_of_all_its_modes() -> None:
    answer = suggest(written(planes(0.2)), 0.31, Settings(after=0.0))
    for one in answer.candidates[:5]:
        assert sorted(part.name for part in one.parts) == ["part 1", "part 2"]
        assert sum(part.share or 0.0 for part in one.parts) == pytest.approx(1)
