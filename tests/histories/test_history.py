"""A history keeps its numbers, whatever becomes of the arrays it was made of, and copies no more than that takes."""

from __future__ import annotations

import numpy as np

from d2rpick.histories.history import History, Samples


def history(energy: Samples) -> History:
    return History(np.arange(4.0), energy, source=("run",), format="csv", channel="internal energy")


def read_only(values: Samples) -> Samples:
    values.flags.writeable = False
    return values


def test_what_could_change_is_copied() -> None:
    energy = np.array([1.0, 3.0, 2.0, 5.0])
    for given in (energy, energy.view(), read_only(energy.view())):
        kept = history(given).energy
        energy[0] += 1
        assert kept[0] == energy[0] - 1
        assert not kept.flags.writeable


def test_what_cannot_change_is_not_copied_unless_it_holds_more_than_itself() -> None:
    energy = read_only(np.array([1.0, 3.0, 2.0, 5.0]))
    assert np.shares_memory(history(energy).energy, energy)
    assert np.shares_memory(history(energy.reshape(4)).energy, energy)
    table = read_only(np.ones((4, 20)))
    assert not np.shares_memory(history(table[:, 3]).energy, table)
