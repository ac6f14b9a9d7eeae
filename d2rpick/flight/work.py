"""Find free flight in the energies of the model; only gravity and mass-proportional damping do work in it.

With the weight F, the momentum p and the mass m, gravity does the work int F p/m dt. Mass-proportional damping does the
work -2 alpha int K dt, which Radioss includes in the external work. Without contact, the contact energy is constant.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from d2rpick.base.memory import remember
from d2rpick.flight.window import (
    FEWEST,
    FEWEST_STATES_OF_WORK,
    VISIBLE,
    Constant,
    FreeFlight,
    Law,
    find_lasting_window,
    find_longest_window,
)
from d2rpick.histories.samples import find_window, integrate_by_trapezia

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from d2rpick.histories.history import Balance, Momenta, Samples


# Relative error of the work of gravity, due to sampling and to sums formed by the solver [-].
# A contact is found if it changes the energies by more than this fraction of the work of gravity [-].
_OWN_ERROR: Final = 1e-3
# If the work of gravity deviates from a parabola by at most this fraction, damping may be the reason [-].
_BENT: Final = 1e-2
# States are used to compute the mass if their squared speed is at least this fraction of the largest [-].
_SLOW: Final = 1e-2
# Safety factor on the mass computed from kinetic energy and velocity [-].
# The computed mass may be too small, because a table may contain the kinetic energy of only the chosen parts.
# A load that does work like gravity without moving the model would need a much larger mass.
_MASS_ERROR: Final = 2.0
# Work up to this fraction of the internal-energy range is treated as zero [-].
_OF_INTERNAL: Final = 0.1
# Error of a sum of energies minus the work of gravity, as a multiple of the relative rounding error of a number [-].
# Energies, momenta and the mass computed from them are all rounded.
_OF_DIGITS: Final = 4
# _LITTLE: a relative loss of kinetic energy up to this is ignored [-].
# _MUCH: a relative loss of kinetic energy of at least this is attributed to friction instead of damping [-].
_LITTLE, _MUCH = 5e-3, 0.5

# Relative error of the energy that damping dissipates if it is computed from the damping rate [-].
_RATE_ERROR: Final = 0.02


def compute_work_beyond_gravity(
    balance: Balance, start: float, end: float
) -> float | None:
    """Return the largest external work in a window that neither gravity nor damping explains [energy].

    The signs of both contributions are known: gravity acts along the mean change of the momentum, and damping reduces
    the energy. If no velocity is written, the work of gravity is a parabola over time that opens upwards. Errors of
    printed digits and of the solver's sums are subtracted. The result is None if the work is not written, or if the
    window has too few states.
    """
    inside = find_window(balance.time, start, end)
    state_count = balance.time[inside].size
    if balance.external_work is None or state_count < FEWEST_STATES_OF_WORK:
        return None
    law = _make_law_of_external_work(balance)
    return law.misfit(inside.start, inside.stop - 1)


def limit_to_undriven(
    balance: Balance, flight: FreeFlight, td: float
) -> FreeFlight | None:
    """Return the part of a flight around ``td`` [time] in which gravity and damping explain the external work.

    Opposite forces do work on a model without changing its momentum, and weak loads hardly change it. The result is
    None if the work is not written, or if a load does work at td.
    """
    time = balance.time
    inside = find_window(time, flight.start, flight.end)
    at = int(np.searchsorted(time, td))
    if balance.external_work is None or not inside.start <= at < inside.stop:
        return None
    law = _make_law_of_external_work(balance)
    first, last = find_longest_window(law, at, 0.0)
    start = max(flight.start, float(time[first]))
    end = min(flight.end, float(time[last]))
    end_seen = flight.end_seen or end < flight.end
    return flight._replace(start=start, end=end, end_seen=end_seen)


@remember
def _make_law_of_external_work(balance: Balance) -> _ExternalWork:
    """Return the law of the external work in free flight."""
    return _ExternalWork(balance)


class _ExternalWork(Law):
    """Law that gravity and damping do all external work; the misfit is the work that they do not explain [energy].

    Errors of printed digits and of the solver's sums are subtracted, so the misfit is 0 in a free flight.
    """

    def __init__(self, balance: Balance) -> None:
        super().__init__(balance.time)
        assert balance.external_work is not None
        self._balance = balance
        self._work = balance.external_work

    def _misfit(self, first: int, last: int) -> float:
        if last - first + 1 < FEWEST_STATES_OF_WORK:
            return 0.0
        states = slice(first, last + 1)
        return _measure_unexplained_work(self._balance, self._work, states)


def _measure_unexplained_work(
    balance: Balance, external_work: Samples, inside: slice
) -> float:
    """Return the largest external work in the given states that neither gravity nor damping explains [energy]."""
    time = balance.time[inside]
    work = external_work[inside]
    elapsed = (time - time[0]) / (time[-1] - time[0])
    free = [np.ones_like(time)]
    most_gravity = np.inf
    if balance.velocity is None:
        free.append(elapsed)
        gravity = elapsed**2
    else:
        from d2rpick.flight.free_fall import FreeFall

        velocity = balance.velocity[inside]
        acceleration = FreeFall(time, velocity).gravity()
        gravity = integrate_by_trapezia(time, velocity @ acceleration)
        if balance.kinetic is not None:
            most_gravity = _bound_work_of_gravity(velocity, balance.kinetic[inside])
    one_sided = [gravity]
    if balance.kinetic is not None:
        one_sided.append(-integrate_by_trapezia(time, balance.kinetic[inside]))
    remainder = _fit_one_sided(work, free, one_sided, most_gravity)
    unexplained = float(np.abs(remainder).max())
    relative_error = _BENT if balance.velocity is None else _OWN_ERROR
    noise = balance.precision.noise(work)
    error = 2 * noise + relative_error * float(np.ptp(work))
    return max(0.0, unexplained - error)


def _bound_work_of_gravity(velocity: Samples, kinetic: Samples) -> float:
    """Return an upper bound on the mass, from kinetic energy and velocity; it limits the work of gravity."""
    squares = np.sum(velocity**2, axis=1)
    is_fast = squares > _SLOW * squares.max(initial=0.0)
    if not is_fast.any():
        return np.inf
    # T is at least m v^2/2.
    masses = 2 * kinetic[is_fast] / squares[is_fast]
    return _MASS_ERROR * float(masses.min())


def _fit_one_sided(
    values: Samples, free: Sequence[Samples], one_sided: Sequence[Samples], most: float
) -> Samples:
    """Return the residual of a least-squares fit to ``values`` (n,).

    The factors of the columns of ``one_sided`` are at least 0; that of the first column is at most ``most``.
    """
    first, *others = one_sided
    remainder, factors = _fit_not_negative(values, free, _scale_columns(one_sided))
    if not first.any() or factors[0] <= most * np.abs(first).max():
        return remainder
    # The first column is subtracted with its largest factor, and the others are fitted again.
    remaining_values = values - most * first
    remainder, _ = _fit_not_negative(remaining_values, free, _scale_columns(others))
    return remainder


def _scale_columns(columns: Sequence[Samples]) -> list[Samples]:
    """Return the columns that are not all 0, divided by their largest absolute values."""
    return [column / np.abs(column).max() for column in columns if column.any()]


def _fit_not_negative(
    values: Samples, free: Sequence[Samples], used: Sequence[Samples]
) -> tuple[Samples, Samples]:
    """Fit the columns ``used`` to ``values``; return the residual and the non-negative factors."""
    used_columns = list(range(len(used)))
    while True:
        table = np.stack([*free, *(used[i] for i in used_columns)], axis=1)
        solution, *_ = np.linalg.lstsq(table, values, rcond=None)
        factors = np.zeros(len(used))
        factors[used_columns] = solution[len(free) :]
        if factors.min(initial=0.0) >= 0:
            return values - table @ solution, factors
        used_columns = [i for i in used_columns if factors[i] > 0]


def has_laws(balance: Balance) -> bool:
    """Return True if the record contains work, or an energy that obeys a law in free flight."""
    return balance.time.size >= FEWEST and bool(_list_terms(balance))


def compute_change_of_balance(
    balance: Balance, start: float, end: float
) -> float | None:
    """Return the largest change of kinetic plus internal energy that gravity and damping leave unexplained [energy].

    Errors of printed digits are subtracted. The result is None if one of the energies is not written.
    """
    whole = balance.kinetic_and_internal
    if whole is None:
        return None
    inside = find_window(balance.time, start, end)
    kinetic = None if balance.kinetic is None else balance.kinetic[inside]
    whole_in_window = whole[inside]
    law = _Parabola(balance.time[inside], whole_in_window[:, np.newaxis], kinetic)
    misfit = law.misfit(0, law.time.size - 1)
    rounding = 2 * balance.precision.noise(whole)
    error_of_solver = _OWN_ERROR * float(np.ptp(whole_in_window))
    return max(0.0, misfit - rounding - error_of_solver)


@remember
def _make_laws_of_work(balance: Balance) -> tuple[_Parabola, _Parabola]:
    """Return two laws of the energies in free flight; the second allows the internal energy to vibrate."""
    terms = np.stack(_list_terms(balance), axis=1)
    return (
        _Parabola(balance.time, terms, balance.kinetic, None),
        _Parabola(balance.time, terms, balance.kinetic, balance.internal),
    )


def find_balanced_window(balance: Balance, td: float) -> FreeFlight | None:
    """Find the window around ``td`` [time] in which only gravity and damping change the energy; None if there is none.

    Both the external work and kinetic plus internal energy must obey this law. If the momentum of the model is written,
    it is better evidence, and the energies are not used: a load may act so smoothly that the energy looks like that of
    a free flight.
    """
    time = balance.time
    terms = _list_terms(balance)
    if balance.velocity is not None or not terms:
        return None
    if time.size < FEWEST or not time[0] <= td <= time[-1]:
        return None
    extent = min(float(np.ptp(term)) for term in terms)
    # A crash into a fixed wall does not change the sum of energies.
    if balance.internal is not None:
        extent = max(extent, _OF_INTERNAL * float(np.ptp(balance.internal)))
    noise = balance.precision.noise(np.stack(terms))
    if noise > _OWN_ERROR * extent:
        return None
    # The law without vibration is tried first, because the additional parameter of the other law could fit a load.
    exact, ringing = _make_laws_of_work(balance)
    states = find_lasting_window(exact, td, extent, noise)
    gravity_if_none_is_seen = 0.0
    if states is None:
        states = find_lasting_window(ringing, td, extent, noise, rings=True)
        gravity_if_none_is_seen = np.nan
    if states is None:
        return None
    gravity = _classify_gravity(balance, *states) or gravity_if_none_is_seen
    return FreeFlight.of(time, states, gravity=gravity)


def list_damped_energies(
    balance: Balance, flight: FreeFlight, momenta: Momenta | None
) -> tuple[list[Samples], float]:
    """Return the energies (n,) that only damping reduces in a flight, and their rounding error [energy].

    The first one is kinetic plus internal energy. The list is empty if a load of unknown size also does work on the
    model.

    Under gravity, this sum grows as the body falls, which hides the loss by damping. The sum minus the work of gravity
    shows the loss, and so does the damping energy if it is written. ``momenta`` are the momenta that show the flight
    and its gravity.
    """
    whole = balance.kinetic_and_internal
    assert whole is not None
    work = balance.worked
    if momenta is not None and work is None and np.isnan(flight.gravity):
        return [], 0.0
    if momenta is not None and work is None and flight.gravity:
        work = _compute_work_of_gravity(balance, flight, momenta)
    energies = [whole]
    if balance.damping is not None:
        energies.append(-balance.damping)
    if work is not None and flight.gravity:
        energies.append(whole - work)
    inside = find_window(balance.time, flight.start, flight.end)
    largest = float(np.abs(whole[inside]).max(initial=0.0))
    relative_rounding = balance.precision.noise(np.ones(1))
    return energies, _OF_DIGITS * relative_rounding * largest


def _compute_work_of_gravity(
    balance: Balance, flight: FreeFlight, momenta: Momenta
) -> Samples:
    """Return the work of gravity since the first state (n,), from the momentum that gravity gives the model [energy].

    If only a velocity is known, the mass is the largest one that the written kinetic energy allows.
    """
    from d2rpick.flight.free_fall import FreeFall

    time = momenta.time
    momentum = momenta.of((0,))
    inside = find_window(time, flight.start, flight.end)
    force = FreeFall(time[inside], momentum[inside]).gravity()
    momentum_along = momentum @ force / np.linalg.norm(force)
    if momenta.velocity and balance.kinetic is not None:
        kinetic = np.interp(time, balance.time, balance.kinetic)
        momentum_along *= _bound_work_of_gravity(momentum, kinetic) / _MASS_ERROR
    work = flight.gravity * integrate_by_trapezia(time, momentum_along)
    return np.interp(balance.time, time, work)


def is_taken_by_damping(
    balance: Balance,
    start: float,
    end: float,
    vibration: Callable[[Samples], Samples],
    alpha: float | None,
) -> bool | None:
    r"""Return True if kinetic plus internal energy changes between two times [time] as in a damped vibration.

    Damping within the body takes energy only from the vibration, whose energy V(t) is ``vibration``, so :math:`K + E -
    V` is constant. Mass-proportional damping also takes energy from the motion of the body, at the damping rate
    ``alpha`` of the vibration [1/time], so :math:`K + E + 2 \alpha \int K dt` is constant. No parameter is fitted, so a
    load cannot be mistaken for damping ("Energies that look like flight" in docs). Drag also takes energy from both,
    but hardly at the same rate, and the loss has to agree within 2 %. The result is None if an energy is missing.
    """
    inside = find_window(balance.time, start, end)
    time = balance.time[inside]
    if balance.kinetic_and_internal is None or balance.kinetic is None or not time.size:
        return None
    whole = balance.kinetic_and_internal[inside]
    kinetic = balance.kinetic[inside]
    of_vibration = vibration(time)
    largest = float((kinetic - of_vibration).max())
    room = _LITTLE * largest
    if float(np.ptp(whole - of_vibration)) <= room:
        return True
    if alpha is None:
        return False
    taken = 2 * alpha * integrate_by_trapezia(time, kinetic)
    agreement = max(_OWN_ERROR * largest, _RATE_ERROR * float(np.ptp(taken)))
    return float(np.ptp(whole + taken)) <= min(room, agreement)


def _classify_gravity(balance: Balance, first: int, last: int) -> float:
    """Return the gravity in a window: 0 if the energies are constant or only damped; otherwise unknown.

    The result is NaN if energy is lost because of gravity, friction or damping; these cannot be distinguished unless
    much of the kinetic energy is lost, because only the loss by damping decreases with the kinetic energy. It is
    infinite if the energies grow because of gravity or another load. It is also infinite if they lose more than the
    vibration energy, and the loss is more like that due to a constant force than that due to damping.
    """
    if balance.kinetic_and_internal is None or balance.kinetic is None:
        return 0.0
    states = slice(first, last + 1)
    time = balance.time[states]
    whole = balance.kinetic_and_internal[states]
    kinetic = balance.kinetic[states]
    largest = float(kinetic.max())
    grown = float((whole - np.minimum.accumulate(whole)).max())
    if grown > _LITTLE * largest:
        return np.inf
    # Damping takes energy in proportion to the kinetic energy.
    spent = -integrate_by_trapezia(time, kinetic)
    columns = [spent] if spent.any() else []
    remainder, _ = _fit_not_negative(whole, [np.ones_like(time)], columns)
    lost = float(whole[0] - whole[-1])
    misfit_of_damping = float(np.ptp(remainder)) / largest if largest > 0 else 0.0
    is_much_and_exact = misfit_of_damping <= _OWN_ERROR and lost >= _MUCH * largest
    is_little = misfit_of_damping <= _LITTLE and lost <= _LITTLE * largest
    if is_much_and_exact or is_little:
        return 0.0
    if balance.internal is None or lost <= np.ptp(balance.internal[states]):
        return np.nan
    # A constant force changes the energy as a parabola over time.
    elapsed = time - time[0]
    parabola = [np.ones_like(elapsed), elapsed, elapsed**2]
    remainder_of_force, _ = _fit_not_negative(whole, parabola, [])
    is_more_like_damping = np.ptp(remainder) < np.ptp(remainder_of_force)
    if misfit_of_damping <= _OWN_ERROR and is_more_like_damping:
        return np.nan
    return np.inf


def _list_terms(balance: Balance) -> list[Samples]:
    """Return those written energies that only gravity and damping change in free flight."""
    terms = []
    if balance.worked is not None:
        terms.append(balance.worked)
    whole = balance.kinetic_and_internal
    internal = balance.internal
    if whole is None or internal is None:
        return terms
    if np.ptp(whole) > 0 or np.ptp(internal) > 0:
        terms.append(whole)
    return terms


class _Parabola(Law):
    """Law of parabolic energies over time, except for damping, which removes a fraction of the kinetic energy.

    Solvers compute velocities half a time step away from positions, which adds a term proportional to the rate of
    change of the ``internal`` energy.
    """

    def __init__(
        self,
        time: Samples,
        energies: Samples,
        kinetic: Samples | None,
        internal: Samples | None = None,
    ) -> None:
        super().__init__(time)
        self.energies = energies
        self.others = [] if kinetic is None else [integrate_by_trapezia(time, kinetic)]
        if internal is not None and time.size > 1:
            self.others.append(np.gradient(internal, time))

    def _misfit(self, first: int, last: int) -> float:
        states = slice(first, last + 1)
        time = self.time[states]
        if time.size < FEWEST_STATES_OF_WORK:
            return 0.0
        elapsed = (time - time[0]) / (time[-1] - time[0])
        columns = [np.ones_like(elapsed), elapsed, elapsed**2]
        for values in self.others:
            inside = values[states]
            extent = np.ptp(inside)
            if extent:
                columns.append((inside - inside[0]) / extent)
        table = np.stack(columns, axis=1)
        # The scale is a power of two, so that scaling is exact.
        _, exponent = np.frexp(np.abs(self.energies[states]).max())
        scale = 2.0 ** (exponent - 1)
        energies = self.energies[states] / scale
        factors, *_ = np.linalg.lstsq(table, energies, rcond=None)
        misfit = float(np.abs(energies - table @ factors).max())
        return misfit * float(scale)


def has_visible_contacts(balance: Balance) -> bool:
    """Return True if the contact energy shows that a contact of the model was closed at any time."""
    energy = balance.sliding
    if energy is None or energy.size < FEWEST:
        return False
    return float(np.ptp(energy)) > VISIBLE * balance.precision.noise(energy)


@remember
def _make_law_of_contacts(balance: Balance) -> Constant:
    """Return the law that the contact energy is constant in free flight."""
    assert balance.sliding is not None
    return Constant(balance.time, balance.sliding[:, np.newaxis])


def find_plateau(balance: Balance, td: float) -> FreeFlight | None:
    """Find the window around ``td`` in which the contact energy is constant [time]; None if there is none.

    If the energy has been constant since the first state, no contact has ended, and a load of another kind may act.
    Such a window is used only if the external work, which shows this load, is written, too.
    """
    time = balance.time
    energy = balance.sliding
    if energy is None or not time[0] <= td <= time[-1]:
        return None
    law = _make_law_of_contacts(balance)
    extent = float(np.ptp(energy))
    noise = balance.precision.noise(energy)
    states = find_lasting_window(law, td, extent, noise)
    if states is None or (states[0] == 0 and balance.external_work is None):
        return None
    return FreeFlight.of(time, states, gravity=_classify_gravity(balance, *states))
