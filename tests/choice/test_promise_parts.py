"""A grade on parts is a promise: what is stated of random records holds in their exact motion."""

from itertools import islice

import numpy as np
import pytest

from d2rpick.choice.question import Settings
from tests.benchmarks.promise import BAD
from tests.benchmarks.promise_parts import CLASSES, Motion, Record, history, records, stated
from tests.energies import sure


@pytest.mark.slow
@pytest.mark.parametrize("kind", CLASSES)
def test_what_is_stated_of_random_records_holds(kind: str) -> None:
    asked = [record._replace(window=record.window[:1] * 2) for record in records(kind, 1, 2)]  # one td is cheap
    found = [one for record in asked if (one := stated(record))]
    assert found
    assert all(one.kept is not False for one in found)
    assert not any(one.true > BAD for one in found if one.grade == "good")


@pytest.mark.slow
def test_what_the_floor_of_the_swings_hides_is_no_good_pair() -> None:
    """A residual of 0.32 was good, since 0.18 was the most that the floor was thought to hide."""
    record = next(islice(records("parts with mixed modes", 101, 77), 76, None))
    found = sure(stated(record))
    assert found.true < BAD or found.grade != "good"


@pytest.mark.slow
def test_two_planes_turn_no_pair_upside_down() -> None:
    """97 and 3 % of the energy of one part: its minima stay at some per cent of its maxima."""
    forms = np.array([np.diag([0.97, 0.03, 0.0]), np.diag([0.0, 0.0, 0.5])])
    truth = Motion(7.7, 2 * np.pi * np.array([29.2, 70.1, 48.76]), np.array([2.95, 4.64, -0.82]), forms)
    time = np.arange(0, 0.4, 4e-4)
    found = sure(stated(Record(history(time, truth.energies(time)), Settings(after=0.0), (0.2, 0.38), truth.residual)))
    assert (found.basis, found.grade, found.kept) == ("parts", "good", True)
    assert found.true < BAD


def test_the_truth_of_the_benchmark_is_that_of_its_motion() -> None:
    rate, alpha = np.array([5.0, 8.0]), 0.4
    motion = Motion(
        alpha, rate, np.array([0.3, -0.9]), np.array([[[1.0, 0.2], [0.2, 0.5]], [[0.3, -0.2], [-0.2, 0.6]]])
    )
    step, td = 1e-5, 2.0
    (before, now, after) = (motion.state(td + shift)[0] for shift in (-step, 0.0, step))
    assert motion.state(td)[1] * np.hypot(rate, alpha / 2) == pytest.approx((after - before) / (2 * step), abs=1e-6)
    acceleration = (after - 2 * now + before) / step**2
    velocity = (after - before) / (2 * step)
    assert acceleration == pytest.approx(-alpha * velocity - (rate**2 + alpha**2 / 4) * now, abs=1e-3)
    assert motion.residual(td, td) ** 2 == pytest.approx(
        float([1.3, 1.1] @ motion.state(td)[1] ** 2 / ([1.3, 1.1] @ (now**2 + motion.state(td)[1] ** 2)))
    )
