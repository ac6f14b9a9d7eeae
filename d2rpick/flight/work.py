"""Free flight, seen in the energies of the model: gravity and damping proportional to mass are all that works.

With the resultant F of gravity, the momentum p and the mass m, gravity works by the integral of F p/m; such damping by
-2 alpha times the integral of the kinetic energy, which Radioss counts as external work.  While nothing touches, the
contact energy does not change.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from d2rpick.flight.window import FEWEST, Constant, FreeFlight, Law, lasting_window
from d2rpick.histories.samples import integral, window

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from d2rpick.histories.history import Balance, Momenta, Samples


# States from which a load can be told from gravity and damping: twice the unknowns.
FEWEST_STATES: Final = 6
# What sampling and the solver's own sums leave of the work of gravity, as a share of its change: contacts do more.
_OWN_ERROR: Final = 1e-3
# Where no velocity is written, damping of the motion bends the parabola of the work of gravity.
_BENT: Final = 1e-2
# Mass follows from kinetic energy and velocity where it moves; states slower than this share (squared) are left out.
_SLOW: Final = 1e-2
# Mass so found is a bound already; a table may hold the kinetic energy of the chosen parts only, and a load that works
# like gravity without moving the model exceeds it by orders of magnitude.
_MASS_ERROR: Final = 2.0
# What deviates by less than the tolerance of this share of the range of the internal energy shows no work.
_OF_INTERNAL: Final = 0.1
# Of a sum of energies less the work of gravity so many times the relative error of a printed number is open: energies,
# momenta and the mass that was found from both are rounded, the mass at the state at which that shows most.
_OF_DIGITS: Final = 4
# Momentum changes by half the share of the kinetic energy that is gained or lost along the motion.  A loss of this much
# of it is told from that by friction.
_LITTLE, _MUCH = 5e-3, 0.5


def work_beyond_gravity(balance: Balance, start: float, end: float) -> float | None:
    """Largest external work in a window that neither gravity nor damping explains [energy].

    Both factors have a sign: gravity acts along the mean change of the momentum, and damping takes energy.  Where
    no velocity is written, the work of gravity is an upward parabola of time.  What printed digits and a solver's own
    sums leave open is not counted.  None where the work is not written, or the window holds too few states.
    """
    inside = window(balance.time, start, end)
    if balance.external_work is None or balance.time[inside].size < FEWEST_STATES:
        return None
    time, work = balance.time[inside], balance.external_work[inside]
    elapsed = (time - time[0]) / (time[-1] - time[0])
    free, most = [np.ones_like(time)], np.inf
    if balance.velocity is None:
        free.append(elapsed)
        gravity = elapsed**2
    else:
        from d2rpick.flight.free_fall import FreeFall

        velocity = balance.velocity[inside]
        gravity = integral(time, velocity @ FreeFall(time, velocity).gravity())
        if balance.kinetic is not None:
            most = _most_gravity(velocity, balance.kinetic[inside])
    one_sided = [gravity]
    if balance.kinetic is not None:
        one_sided.append(-integral(time, balance.kinetic[inside]))
    error = _BENT if balance.velocity is None else _OWN_ERROR
    rest = float(np.abs(_rest(work, free, one_sided, most)).max())
    own = 2 * balance.precision.noise(work) + error * float(np.ptp(work))
    return max(0.0, rest - own)


def _most_gravity(velocity: Samples, kinetic: Samples) -> float:
    """Largest factor of the integral of F v: the motion as a whole has no more than all of the kinetic energy."""
    squares = np.sum(velocity**2, axis=1)
    fast = squares > _SLOW * squares.max(initial=0.0)
    return (
        _MASS_ERROR * float((2 * kinetic[fast] / squares[fast]).min())
        if fast.any()
        else np.inf
    )


def _rest(
    values: Samples, free: Sequence[Samples], one_sided: Sequence[Samples], most: float
) -> Samples:
    """What least squares leave of ``values``; columns of ``one_sided`` are only added, the first ``most`` times."""
    first, *others = one_sided
    for gravity in ([first], []):
        used = [
            column / np.abs(column).max()
            for column in (*gravity, *others)
            if column.any()
        ]
        rest, factors = _least_squares(values, free, used)
        if not (gravity and first.any() and factors[0] > most * np.abs(first).max()):
            return rest
        values = values - most * first
    return rest


def _least_squares(
    values: Samples, free: Sequence[Samples], used: Sequence[Samples]
) -> tuple[Samples, Samples]:
    """What is left of ``values``, and the factors of the columns ``used``, none of them negative."""
    kept = list(range(len(used)))
    while True:
        table = np.stack([*free, *(used[i] for i in kept)], axis=1)
        found, *_ = np.linalg.lstsq(table, values, rcond=None)
        factors = np.zeros(len(used))
        factors[kept] = found[len(free) :]
        if factors.min(initial=0.0) >= 0:
            return values - table @ found, factors
        kept = [i for i in kept if factors[i] > 0]


def can_tell(balance: Balance) -> bool:
    """Whether work or energy is written that free flight would hold to a law."""
    return balance.time.size >= FEWEST and bool(_terms(balance))


def change_of_balance(balance: Balance, start: float, end: float) -> float | None:
    """Largest change of kinetic and internal energy in a window that neither gravity nor damping explains [energy].

    What printed digits leave open is not counted.  None where one of them is not written.
    """
    whole = balance.kinetic_and_internal
    if whole is None:
        return None
    inside = window(balance.time, start, end)
    kinetic = None if balance.kinetic is None else balance.kinetic[inside]
    law = _Parabola(balance.time[inside], whole[inside][:, np.newaxis], kinetic)
    rest = law.misfit(0, law.time.size - 1)
    return max(
        0.0,
        rest
        - 2 * balance.precision.noise(whole)
        - _OWN_ERROR * float(np.ptp(whole[inside])),
    )


def balanced_around(balance: Balance, td: float) -> FreeFlight | None:
    """Find the window around ``td`` [time] in which energy changes by gravity and damping only, or None.

    Held to it are the external work, and kinetic and internal energy together.  Where the momentum of the model is
    written, it shows what they can show, and more: a model whose momentum is never that of free flight may be driven
    so smoothly that its energy looks like it.
    """
    time, terms = balance.time, _terms(balance)
    if (
        balance.velocity is not None
        or not terms
        or time.size < FEWEST
        or not time[0] <= td <= time[-1]
    ):
        return None
    extent = min(float(np.ptp(term)) for term in terms)
    if (
        balance.internal is not None
    ):  # a crash into a fixed wall leaves the sum as it was
        extent = max(extent, _OF_INTERNAL * float(np.ptp(balance.internal)))
    noise = balance.precision.noise(np.stack(terms))
    if noise > _OWN_ERROR * extent:
        return None
    # without and with a rate, which takes up what tells a load from free flight, too
    exact, ringing = balance.known.once(
        "work",
        lambda: [
            _Parabola(time, np.stack(terms, axis=1), balance.kinetic, of)
            for of in (None, balance.internal)
        ],
    )
    window = lasting_window(exact, td, extent, noise)
    rings = (
        lasting_window(ringing, td, extent, noise, rings=True)
        if window is None
        else None
    )
    found = window or rings
    if found is None:
        return None
    return FreeFlight.of(
        time, found, gravity=_unexplained(balance, *found) or (np.nan if rings else 0.0)
    )


def lowered_by_damping(
    balance: Balance, flight: FreeFlight, momenta: Momenta | None
) -> tuple[list[Samples], float]:
    """Give energies (n,) of a balance that damping lowers in a flight, and what their digits leave open [energy].

    The first is the sum of kinetic and internal energy; none is given where a load of unknown size works on it, too.

    Under gravity that sum grows as the body falls, so that it hides what damping takes: what is left of it without the
    work of gravity, and the damping energy where it is written, show that.  ``momenta`` are those that show the flight,
    and their gravity.
    """
    whole = balance.kinetic_and_internal
    assert whole is not None
    work = balance.worked
    if momenta is not None and work is None and np.isnan(flight.gravity):
        return [], 0.0
    if momenta is not None and work is None and flight.gravity:
        work = _work_of_gravity(balance, flight, momenta)
    sums = [whole]
    sums += [] if balance.damping is None else [-balance.damping]
    sums += [] if work is None or not flight.gravity else [whole - work]
    largest = float(
        np.abs(whole[window(balance.time, flight.start, flight.end)]).max(initial=0.0)
    )
    return sums, _OF_DIGITS * balance.precision.noise(np.ones(1)) * largest


def _work_of_gravity(balance: Balance, flight: FreeFlight, momenta: Momenta) -> Samples:
    """Work of gravity since the first state (n,), by the momentum of the model that it changes [energy].

    Of a velocity the mass is the largest that moves so at the kinetic energy that is written.
    """
    from d2rpick.flight.free_fall import FreeFall

    time, momentum = momenta.time, momenta.of((0,))
    inside = window(time, flight.start, flight.end)
    force = FreeFall(time[inside], momentum[inside]).gravity()
    along = momentum @ force / np.linalg.norm(force)
    if momenta.velocity and balance.kinetic is not None:
        along *= (
            _most_gravity(momentum, np.interp(time, balance.time, balance.kinetic))
            / _MASS_ERROR
        )
    return np.interp(balance.time, time, flight.gravity * integral(time, along))


def taken_by_damping(
    balance: Balance,
    start: float,
    end: float,
    vibration: Callable[[Samples], Samples],
    alpha: float | None,
) -> bool | None:
    r"""Whether kinetic and internal energy together change between two times [time] as a vibration is damped.

    Damping within the body takes energy of the vibration alone, whose energy V(t) ``vibration`` gives:
    :math:`K + E - V` is constant.  Damping proportional to mass takes the motion of the body as well, at the rate
    ``alpha`` of its vibration [1/time]: :math:`K + E + 2 \alpha \int K dt` is constant.  Nothing is fitted, so that
    no load is taken for either (docs/explanation/flights.md, "Energies that look like
    flight").  None where an energy is missing.
    """
    inside = window(balance.time, start, end)
    whole, kinetic, time = (
        balance.kinetic_and_internal,
        balance.kinetic,
        balance.time[inside],
    )
    if whole is None or kinetic is None or not time.size:
        return None
    of_vibration = vibration(time)
    changes = [float(np.ptp(whole[inside] - of_vibration))]
    if alpha is not None:
        changes.append(
            float(np.ptp(whole[inside] + 2 * alpha * integral(time, kinetic[inside])))
        )
    return min(changes) <= _LITTLE * float((kinetic[inside] - of_vibration).max())


def _unexplained(balance: Balance, first: int, last: int) -> float:
    """What stands for gravity in a window: 0 where energies change by nothing or damping alone, else of unknown size.

    NaN where they are lost, by gravity, friction or damping: what damping takes falls off with the kinetic energy,
    which shows when much of it is gone.  Infinity where they grow, or lose more than a vibration has and rather as a
    constant force takes it than as damping does: by gravity or another load.
    """
    whole, kinetic = balance.kinetic_and_internal, balance.kinetic
    if whole is None or kinetic is None:
        return 0.0
    states = slice(first, last + 1)
    largest = float(kinetic[states].max())
    grown = float((whole[states] - np.minimum.accumulate(whole[states])).max())
    if grown > _LITTLE * largest:
        return np.inf
    spent = -integral(balance.time[states], kinetic[states])
    rest, _ = _least_squares(
        whole[states], [np.ones(last - first + 1)], [spent] if spent.any() else []
    )
    lost = float(whole[first] - whole[last])
    bent = float(np.ptp(rest)) / largest if largest > 0 else 0.0
    if (bent <= _OWN_ERROR and lost >= _MUCH * largest) or (
        bent <= _LITTLE and lost <= _LITTLE * largest
    ):
        return 0.0
    if balance.internal is None or lost <= np.ptp(balance.internal[states]):
        return np.nan
    elapsed = balance.time[states] - balance.time[first]
    pulled, _ = _least_squares(
        whole[states], [np.ones_like(elapsed), elapsed, elapsed**2], []
    )
    return np.nan if bent <= _OWN_ERROR and np.ptp(rest) < np.ptp(pulled) else np.inf


def _terms(balance: Balance) -> list[Samples]:
    """Energies that change by gravity and damping only, as far as they are written and change at all."""
    whole, internal = balance.kinetic_and_internal, balance.internal
    changes = (
        whole is not None
        and internal is not None
        and (np.ptp(whole) > 0 or np.ptp(internal) > 0)
    )
    return [
        term
        for term in (balance.worked, whole if changes else None)
        if term is not None
    ]


class _Parabola(Law):
    """Energies that are parabolas of time but for damping, which takes a share of the kinetic energy.

    Solvers know velocities half a step away from places: that adds the rate of the ``internal`` energy, where given.
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
        self.others = [] if kinetic is None else [integral(time, kinetic)]
        if internal is not None and time.size > 1:
            self.others.append(np.gradient(internal, time))

    def _misfit(self, first: int, last: int) -> float:
        states = slice(first, last + 1)
        time = self.time[states]
        if time.size < FEWEST_STATES:
            return 0.0
        elapsed = (time - time[0]) / (time[-1] - time[0])
        others = [
            (one[states] - one[states.start]) / extent
            for one in self.others
            if (extent := np.ptp(one[states]))
        ]
        table = np.stack([np.ones_like(elapsed), elapsed, elapsed**2, *others], axis=1)
        scale = 2.0 ** (
            np.frexp(np.abs(self.energies[states]).max())[1] - 1
        )  # exact; squares of 1e200 would overflow
        energies = self.energies[states] / scale
        factors, *_ = np.linalg.lstsq(table, energies, rcond=None)
        return float(np.abs(energies - table @ factors).max()) * float(scale)


# A contact energy that never exceeds its printed digits by this factor shows no contact at all.
_VISIBLE = 100


def shows_contacts(balance: Balance) -> bool:
    """Whether the model has contacts that were ever closed, as far as the contact energy tells."""
    energy = balance.sliding
    if energy is None or energy.size < FEWEST:
        return False
    return float(np.ptp(energy)) > _VISIBLE * balance.precision.noise(energy)


def plateau_around(balance: Balance, td: float) -> FreeFlight | None:
    """Find the window around ``td`` [time] in which the contact energy is constant, or None.

    Where it has been constant since the first state no contact has ended, and a load of another kind may act: such a
    window counts only where the external work is written too, which shows that load.
    """
    time, energy = balance.time, balance.sliding
    if energy is None or not time[0] <= td <= time[-1]:
        return None
    law = balance.known.once("sliding", lambda: Constant(time, energy[:, np.newaxis]))
    states = lasting_window(
        law, td, float(np.ptp(energy)), balance.precision.noise(energy)
    )
    if states is None or (states[0] == 0 and balance.external_work is None):
        return None
    return FreeFlight.of(time, states, gravity=_unexplained(balance, *states))
