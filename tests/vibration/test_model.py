"""How the lock-in error runs before td: its minima, and how far a tr may be off."""

import numpy as np
import pytest

from d2rpick.vibration import measures
from d2rpick.vibration.identify import identify_several
from d2rpick.vibration.model import Evidence, energy_at
from d2rpick.vibration.modes import Mode, Modes
from d2rpick.vibration.moments import Moments, Profile
from d2rpick.vibration.span import Span
from tests.records import table

MODE = Mode(omega=2 * np.pi, alpha=0.2, cosine=0.0, sine=1.0, origin=0.0)
TD = 5.1
PROFILE = Profile.of(MODE, np.arange(0, 6, 1 / 64), TD)


def test_it_ends_before_td() -> None:
    assert PROFILE.time[-1] < TD
    np.testing.assert_allclose(PROFILE.error, measures.lock_in_error(MODE, PROFILE.time, TD))


def test_minima_are_where_the_deformation_is_that_at_td() -> None:
    crossings = np.array(MODE.crossings(float(MODE.deformation(TD)), 0.0, TD - 0.1))
    found = np.array(PROFILE.minima())
    assert max(np.abs(found - t).min() for t in crossings) < 2e-3


def test_three_times_are_needed_for_a_minimum() -> None:
    assert Profile(np.array([0.0, 1.0]), np.array([1.0, 0.0])).minima() == ()


def tolerance(profile: Profile, tr: float, error: float) -> float:
    return float(profile.tolerances(np.array([tr]), np.array([error]))[0])


@pytest.mark.parametrize("tr", [0.3, 1.11, 2.75, 4.0])
def test_the_tolerance_is_that_of_the_closed_form(tr: float) -> None:
    error = float(measures.lock_in_error(MODE, tr, TD))
    expected = float(measures.timing_tolerance(MODE, np.array([tr]), TD)[0])
    assert tolerance(PROFILE, tr, error) == pytest.approx(expected, abs=1e-3)


def test_the_tolerance_is_all_of_the_time_where_the_error_never_grows() -> None:
    flat = Profile(np.linspace(0, 2, 5), np.full(5, 0.1))
    assert tolerance(flat, 1.0, 0.1) == 2.0


def test_an_error_that_grows_at_once_leaves_the_way_to_the_next_time() -> None:
    steep = Profile(np.linspace(0, 4, 5), np.array([1.0, 1.0, 0.0, 1.0, 1.0]))
    assert tolerance(steep, 2.0, 0.0) == pytest.approx(0.05)
    assert tolerance(steep, 0.5, 0.2) == pytest.approx(0.5)


def test_a_td_at_which_two_modes_set_in_has_nothing_before_it_to_compare() -> None:
    modes = Modes((Mode(8.0, 0.05, 1.0, 0.4, 0.0), Mode(19.0, 0.05, 0.3, 0.6, 0.0)))
    time = np.linspace(0.0, 6.0, 1201)
    history = table(time, np.asarray(modes.energy(time)))
    fit = identify_several(time, history.energy)
    vibration = energy_at(history, 2.0, Evidence(fit, Span(2.0, 6.0)))
    crossings = vibration.moments(0.2)
    assert vibration.basis == "oscillator"
    assert crossings.are("crossing").all()
    assert (crossings.tr < 2.0).all()
    assert np.isfinite(vibration.reach(crossings)).all()
    assert not measures.compared(vibration.measured(crossings.tr)).any()


def test_crossings_of_a_level_come_before_the_other_moments() -> None:
    others = Moments.of("extremum", [2.0]), Moments.of("match", ()), Moments.of("given", np.array([0.5]))
    found = Moments.of_level(np.array([1.0, 3.0]), np.array([True, False]), *others)
    each = [found[i] for i in range(len(found))]
    assert each == [(1.0, "crossing", True), (3.0, "crossing", False), (2.0, "extremum", None), (0.5, "given", None)]
    assert found.are("extremum").tolist() == [False, False, True, False]
    assert found.at(np.array([3, 0]))[1] == found.at(slice(1))[0] == each[0]
    assert found.at(found.are("given"))[0] == each[3]
