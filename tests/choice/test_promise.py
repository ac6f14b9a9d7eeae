"""What is stated of springs that stiffen and of records that drift holds for the motion that was integrated."""

from pathlib import Path

import numpy as np
import pytest

from tests.benchmarks.promise import BAD, CLASSES, tried
from tests.energies import sure


@pytest.mark.parametrize(
    ("name", "number"), [("Duffing and plastic", 30), ("Duffing and plastic", 54), ("drift and heating", 5)]
)
def test_what_was_upside_down_has_the_sign_of_td(name: str, number: int, tmp_path: Path) -> None:
    """The energy alone, or an oscillator about a preload, gave these pairs the other sign: residuals of 2."""
    found = sure(tried(CLASSES[name](np.random.default_rng([1, number])), tmp_path))
    assert found.kept
    assert found.true < BAD
