"""Histories that are refused; energies at many times equal those at each single time."""

import pickle

import numpy as np
import pytest
from hypothesis import given, strategies as st
from numpy.typing import ArrayLike

from d2rpick.base.errors import RangeError
from d2rpick.base.memory import remember
from d2rpick.histories.history import History, Precision, Samples


def history(energy: ArrayLike, time: ArrayLike | None = None) -> History:
    energy = np.asarray(energy, dtype=np.float64)
    time = np.arange(float(energy.size)) if time is None else np.asarray(time)
    return History(
        time, energy, source=("run",), format="csv", channel="internal energy"
    )


def read_only(values: Samples) -> Samples:
    values.flags.writeable = False
    return values


def test_what_could_change_is_copied() -> None:
    energy = np.array([1.0, 3.0, 2.0, 5.0])
    for values in (energy, energy.view(), read_only(energy.view())):
        energy_of_history = history(values).energy
        energy[0] += 1
        assert energy_of_history[0] == energy[0] - 1
        assert not energy_of_history.flags.writeable


def test_what_cannot_change_is_not_copied_unless_it_holds_more_than_itself() -> None:
    energy = read_only(np.array([1.0, 3.0, 2.0, 5.0]))
    assert np.shares_memory(history(energy).energy, energy)
    assert np.shares_memory(history(energy.reshape(4)).energy, energy)
    table = read_only(np.ones((4, 20)))
    assert not np.shares_memory(history(table[:, 3]).energy, table)


@given(
    st.lists(st.floats(-1e6, 1e6), min_size=2, max_size=30),
    st.lists(st.floats(0, 1), min_size=1, max_size=20),
)
def test_many_energies_are_those_of_single_times(
    energy: list[float], shares: list[float]
) -> None:
    record = history(energy, np.arange(len(energy)) * 0.5)
    times = np.array([*shares, 0.0, 1.0]) * record.time[-1]
    assert record.energies_at(times).tolist() == pytest.approx(
        [record.energy_at(t) for t in times.tolist()]
    )


@pytest.mark.parametrize(
    "precision", [Precision(6), Precision(decimals=4), Precision()]
)
def test_quanta_are_the_quantum_of_each(precision: Precision) -> None:
    values = np.array([0.0, 1.0, -1.0, 0.0640123, 999999.0, 1e-30, -7.5e12])
    assert precision.quanta(values).tolist() == pytest.approx(
        [precision.quantum(v) for v in values.tolist()], rel=1e-12
    )


@pytest.mark.parametrize("states", [1, 2, 3, 50])
def test_energy_between_the_states_is_that_of_numpy_over_the_whole_record(
    states: int,
) -> None:
    rng = np.random.default_rng(3)
    time, energy = np.cumsum(rng.uniform(0.1, 1, states)), rng.normal(size=states)
    record = history(energy, time)
    for t in (*time, *rng.uniform(time[0], time[-1], 20)):
        assert record.energy_at(float(t)) == np.interp(t, time, energy)
    for outside in (time[0] - 0.01, time[-1] + 0.01):
        with pytest.raises(RangeError, match="lies outside the record"):
            record.energy_at(float(outside))


def test_what_was_found_in_a_record_is_made_once_and_stays_behind_when_it_goes_to_another_process() -> (
    None
):
    numbers = iter(range(10))

    @remember
    def take_number(_: History, __: str, *, without_effect: int) -> int:  # noqa: ARG001
        return next(numbers)

    record = history(np.ones(3))
    assert [take_number(record, "one", without_effect=n) for n in range(2)] == [0, 0]
    assert take_number(record, "other", without_effect=0) == 1
    sent = pickle.loads(pickle.dumps(record))
    assert take_number(sent, "one", without_effect=0) == 2
    assert take_number(record, "one", without_effect=0) == 0
