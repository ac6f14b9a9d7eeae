"""The energy between the states is linear, whatever part of the record is looked at."""

from __future__ import annotations

import numpy as np
import pytest

from d2rpick.errors import RangeError
from d2rpick.histories.history import History

RNG = np.random.default_rng(3)


@pytest.mark.parametrize("states", [1, 2, 3, 50])
def test_energy_between_the_states_is_that_of_numpy_over_the_whole_record(states: int) -> None:
    time, energy = np.cumsum(RNG.uniform(0.1, 1, states)), RNG.normal(size=states)
    history = History(time, energy, source=("made",), format="csv", channel="E")
    for t in (*time, *RNG.uniform(time[0], time[-1], 20)):
        assert history.energy_at(float(t)) == np.interp(t, time, energy)
    for outside in (time[0] - 0.01, time[-1] + 0.01):
        with pytest.raises(RangeError, match="lies outside the record"):
            history.energy_at(float(outside))
