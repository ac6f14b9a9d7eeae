"""What is stated of springs that stiffen and of records that drift holds for the motion that was integrated."""

from pathlib import Path

import numpy as np
import pytest

import d2rpick
from tests.benchmarks.promise import BAD, CLASSES, tried
from tests.energies import sure
from tests.vibration.test_identify import about_a_preload


@pytest.mark.parametrize(
    ("name", "seed", "number"),
    [
        ("Duffing and plastic", 1, 30),
        *(
            pytest.param("Duffing and plastic", *one, marks=pytest.mark.slow)
            for one in ((1, 54), (101, 249), (101, 251))
        ),
        ("drift and heating", 1, 5),
    ],
)
def test_what_was_upside_down_has_the_sign_of_td(name: str, seed: int, number: int, tmp_path: Path) -> None:
    """The energy alone, or an oscillator about a preload, gave these pairs the other sign: residuals of 2."""
    found = sure(tried(CLASSES[name](np.random.default_rng([seed, number])), tmp_path))
    assert found.kept
    assert found.true < BAD


def test_of_a_preload_that_hardly_shows_the_residual_is_in_its_range(tmp_path: Path) -> None:
    """Half the rate, and a quarter of the kinetic share: the residual is twice the one of a vibration through zero."""
    time, td = np.arange(0.0, 6.711, 1 / 40), 5.506
    path = tmp_path / "preloaded.csv"
    energy = 100 * about_a_preload(time, 2 * np.pi, 3.4484)[0] ** 2
    np.savetxt(path, np.stack([time, energy], axis=1), "%.8g", ",", header="time,internal_energy", comments="")
    answer = d2rpick.suggest(d2rpick.read(str(path)), td=td).to_dict()
    best = next(one for one in answer["candidates"] if one["recommended"])
    before, after = (about_a_preload(np.array(at), 2 * np.pi, 3.4484) for at in (best["tr"], td))
    true = float(np.hypot(before[0] - after[0], after[1]) / np.hypot(after[0] - 1, after[1]))
    assert best["residual"] - 0.05 < BAD < true < best["residual_high"] + 0.05
    assert answer["quality"] != "good"
