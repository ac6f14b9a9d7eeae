"""Lines that are locked to others: of stiffening springs, and of constant or oscillating deformations."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from scipy.special import ellipj, ellipk

from d2rpick.histories.history import Samples
from d2rpick.vibration.modal import identify_modal
from tests.energies import require

TIME = np.linspace(0.0, 9.0, 1801)
EVEN = np.linspace(0.0, 9.0, 50)
PAIRS = np.array([(tr, td) for tr in EVEN for td in EVEN if td - tr > 2]).T


class StiffeningSpring:
    """A unit mass on a spring of force -q - e q^3, released at q = 1: q = cn(w t, m) without damping."""

    def __init__(self, stiffening: float, scale: float) -> None:
        self.stiffening, self.scale = stiffening, scale
        self.rate = np.sqrt(1 + stiffening)
        self.modulus = stiffening / (2 * (1 + stiffening))

    def compute_positions(self, time: Samples) -> Samples:
        """Return the position at each time, of the shape of ``time``."""
        _, cosine, _, _ = ellipj(self.rate * self.scale * time, self.modulus)
        return np.asarray(cosine)

    def compute_elastic_energies(self, time: Samples) -> Samples:
        """Return the energy of the spring at each time, of the shape of ``time``."""
        position = self.compute_positions(time)
        return position**2 / 2 + self.stiffening * position**4 / 4

    def keeps_sign(self, tr: Samples, td: Samples) -> Samples:
        """Return 1 if both positions are equal, -1 if they are opposite, and a value in between otherwise."""
        return self.compute_positions(tr) * self.compute_positions(td)


@settings(max_examples=15, deadline=None)
@given(
    stiffening=st.floats(0.05, 2.0), static=st.floats(0.0, 80.0), scale=st.floats(5, 25)
)
def test_a_spring_that_stiffens_is_not_taken_for_a_stretch(
    stiffening: float, static: float, scale: float
) -> None:
    """Its line and the second harmonic would be those of a mode about a stretch, if there is enough static energy."""
    spring = StiffeningSpring(stiffening, scale)
    period = 4 * ellipk(spring.modulus) / (spring.rate * scale)
    energy = static + spring.compute_elastic_energies(TIME)
    modal = require(identify_modal(TIME, energy))
    if not modal.signed:
        return
    tr, periods = 0.5 * period, np.array([2.0, 2.5, 3.0, 3.5])
    td = tr + periods * period
    stated = np.sqrt(modal.reading.residual_squared(tr, td))
    _, low, high = modal.residual_band(stated, np.full(4, tr), td)
    true = np.where(periods % 1 == 0, 0.0, 2.0)
    assert np.all(low <= true + 1e-3)
    assert np.all(true <= high + 0.1)


@pytest.mark.parametrize("stretch", [0.3, 1.0, 2.5])
def test_a_stretch_is_not_taken_for_a_spring(stretch: float) -> None:
    deformation = np.cos(11.0 * TIME)
    modal = require(identify_modal(TIME, (stretch + deformation) ** 2))
    assert modal.bent == 0
    assert not modal.reading.is_mode.all()
    tr, td = PAIRS
    lack = np.square(np.cos(11.0 * tr) - np.cos(11.0 * td))
    true = lack + np.sin(11.0 * td) ** 2
    np.testing.assert_allclose(modal.reading.residual_squared(tr, td), true, atol=1e-3)


@pytest.mark.parametrize("depth", [0.05, 0.2, 0.5])
def test_a_stretch_that_swings_gives_a_mode_no_further_ones(depth: float) -> None:
    """A part on a hinge pulls like this: the truth is in the band, and modes alone would give too much energy."""

    def compute_stretch(time: Samples) -> Samples:
        return depth * (1.5 + np.cos(2.9 * time + 0.7))

    def compute_mode(time: Samples) -> Samples:
        return np.cos(17.0 * time + 1.0)

    energy = (compute_stretch(TIME) + compute_mode(TIME)) ** 2
    modal = require(identify_modal(TIME, energy))
    assert modal.signed
    assert modal.swinging == pytest.approx(depth**2 / 2, rel=0.05)
    tr, td = PAIRS
    apart = (compute_stretch(tr) + compute_mode(tr)) - (
        compute_stretch(td) + compute_mode(td)
    )
    true = np.sqrt(np.square(apart) + np.sin(17.0 * td + 1.0) ** 2)
    stated = np.sqrt(modal.reading.residual_squared(tr, td))
    _, low, high = modal.residual_band(stated, tr, td)
    assert np.mean((true > low - 1e-3) & (true < high + 1e-3)) > 0.9
