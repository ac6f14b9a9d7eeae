"""Thinned time histories hold the numbers of their source, and tables the cells of theirs."""

import numpy as np
import pytest

from d2rpick.histories.formats.radioss_th import TimeHistory
from tests.made_t01 import MadePart, t01
from tests.thinned import Thinned, columns_of, thin

PARTS = (MadePart(3, "box"), MadePart(5, "silent", ()), MadePart(12, "step", (6, 2, 1, 28)))


@pytest.mark.parametrize(("code", "title"), [(3040, 40), (3050, 80)])
@pytest.mark.parametrize("subset_variables", [0, 2])
def test_what_is_kept_is_as_it_was_written(code: int, title: int, subset_variables: int) -> None:
    source = bytes(t01(12, PARTS, code=code, title=title, subset_variables=subset_variables).data)
    whole, kept = TimeHistory(source, "whole"), TimeHistory(thin(source, Thinned(4, 1.3, (1, 2, 6))), "kept")
    states = [0, 4, 8, 10]
    assert kept.time.tolist() == whole.time[states].tolist()
    assert (kept.title, kept.version, kept.parts, kept.channels) == (
        whole.title, whole.version, whole.parts, whole.channels,
    )  # fmt: skip
    for name in kept.channels:
        assert kept.channel(name).tolist() == whole.channel(name)[states].tolist()
    for name in ("internal_energy", "kinetic_energy", "mass"):
        expected = whole.part_channel(name, [12, 3])[states]
        np.testing.assert_array_equal(kept.part_channel(name, [12, 3]), expected)
    assert kept._head.counts == (1, 22, 6)  # neither subsets nor groups


def test_cells_are_as_they_were_written() -> None:
    assert columns_of("a,b,c\n1.50,2e0,3\n4,5,06\n", ("c", "a")) == "c,a\n3,1.50\n06,4\n"
