"""Fit a free fall to a momentum; gravity and mass-proportional damping are the only forces in it.

Parts that fly together obey p' = g - alpha p in each component, with constant g and the same alpha >= 0. Therefore p(t)
= p0 + g t - alpha int p dt, which is linear in p0, g and alpha.
"""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from d2rpick.base.caching import cached_property
from d2rpick.flight.window import (
    FEWEST,
    FEWEST_STATES_OF_WORK,
    LAST_DIGIT,
    ROUND_OFF,
    TOLERANCE,
    Constant,
    Law,
    find_lasting_window,
    find_longest_window,
    list_moments,
)
from d2rpick.histories.samples import (
    compute_median,
    find_window,
    integrate_by_trapezia,
    remove_line,
)

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from d2rpick.histories.history import Balance, Momenta, Precision, Samples

# _GRAVITY: gravity in m, inches and feet per second squared; other units change it by a power of 10.
# _ALIKE: accelerations that differ by at most this fraction are treated as equal to gravity [-]; 1 in 200 loads do.
_GRAVITY, _ALIKE = (9.80665, 386.089, 32.1740), 0.002
# Usual values of gravity in decks in m, inches and feet per second squared, up to a power of 10.
_OF_DECKS = (9.80665, 9.81, 9.8, 9.807, 3.86089, 3.864, 3.86, 3.2174, 3.22)
# Ratio of the rounding error in a fitted momentum change to the rounding error in the momentum itself [-].
_REACH_OF_DIGITS = 10.0
# _ROUGHLY: relative tolerance for the magnitude of gravity while a load fades [-].
# _ALONG_AXIS: smallest direction cosine between gravity and an axis while a load fades [-].
_ROUGHLY, _ALONG_AXIS = 0.05, 0.999
# _DAMPED: a loss of at most this fraction of the momentum in a window is always attributed to damping [-].
# _LEFT: a loss above _DAMPED is attributed to damping if this fraction of the largest momentum remains [-].
_DAMPED, _LEFT = 0.2, 0.05
# A loss of at most this fraction of the momentum between successive states is attributed to damping [-].
_SHOWN = 0.1
# Largest deviation of the momentum in a window without loads, relative to its largest value and to its range [-].
# A fading load that causes this deviation may change the momentum by twice this fraction over the window.
# If only some of the moving parts are tested, TOLERANCE replaces this limit, because other parts act on them.
_ENOUGH = 3e-3
# The next three constants are used to find gravity perpendicular to a load of constant direction.
# _REACH_OF_NOISE: momentum perpendicular to the load may deviate by this because of noise [rounding errors].
# _SEEN: gravity is sought along an axis only if at least this component of the axis is perpendicular to the load [-].
# _CLEARLY: smallest ratio of the deviation along the load to the deviation perpendicular to it [-].
_REACH_OF_NOISE, _SEEN, _CLEARLY = 2.0, 0.1, 30.0
# _FADED: a force fades if its maximum in the last third of a window is at most this fraction of the first third's [-].
# _LITTLE: largest remaining force at the end of a window in which a force fades, relative to the weight [-].
_FADED, _LITTLE = 0.6, 0.02
# In a straight motion, the momentum perpendicular to the motion is at most this fraction of the momentum [-].
_STRAIGHT = 0.01
# Changes of momentum up to this multiple of the fitting error are treated as zero [-].
_UNSEEN = 2.0
# Rounding errors of times up to this fraction of the output interval move no end of a flight by a state [-].
_SEEN_IN_INTERVALS = 0.1
# Relative error of the work of gravity computed from the states [-].
_OF_WORK = 2e-3


def _measure_rounding(time: Samples, precision: Precision) -> float:
    """Return the rounding error of printed times (n,) over their span [-]; 0 if it is hardly seen in their intervals.

    A state whose time is rounded seems to have the momentum of another time.
    """
    error = precision.noise(time)
    if time.size < FEWEST:
        return 0.0
    usual_interval = float(compute_median(np.diff(time)))
    if error <= _SEEN_IN_INTERVALS * usual_interval:
        return 0.0
    return float(error / np.ptp(time))


class Laws:
    """Laws of free flight for one set of parts: either only gravity and damping act, or no force acts at all.

    A constant net force need not be gravity, and together with such a force, an exponentially fading push looks like
    damping. The force is accepted only if it equals the mass times one of the accelerations ``gravities`` of the deck,
    which contain 0 if no gravity acts for some time. If ``gravities`` is None, it must equal the mass times the gravity
    of the earth in any consistent units.
    """

    def __init__(
        self, momenta: Momenta, members: tuple[int, ...], balance: Balance | None
    ) -> None:
        """Prepare the laws of free flight for the parts in columns ``members``; ``balance`` limits an unknown mass."""
        time = momenta.time
        momentum = momenta.of(members)
        self.fit = FreeFall(time, momentum)
        self.balance = balance
        self.velocity = momenta.velocity
        parts = momenta.parts and [momenta.parts[i] for i in members]
        self.gravities = momenta.surroundings.gravity_on(parts)
        self.mass = 1.0 if momenta.velocity else momenta.mass(members)
        complete = set(momenta.moving) <= set(members)
        self.extent = float(np.ptp(momentum, axis=0).max())
        self.noise = momenta.noise(members)
        self.noise_of_times = self.extent * _measure_rounding(time, momenta.precision)
        largest = float(np.linalg.norm(momentum, axis=1).max())
        share = min(1.0, largest / self.extent) if self.extent > 0 else 0.0
        self._enough = _ENOUGH * share if complete else min(TOLERANCE, _ENOUGH * share)
        self._steady = Constant(time, momentum)
        self._given: dict[tuple[float, ...], Constant] = {}

    def window(self, td: float) -> tuple[tuple[int, int] | None, float | None]:
        """Return the first and last state of the free flight around ``td``, and gravity [length/time^2] or None."""
        window = self._lasting(self.fit, td)
        gravity = self.gravity(*window) if window else None
        if gravity is not None:
            return window, gravity
        window = self._lasting(self._steady, td)
        if window:
            return (None if self.is_carried else window), None
        window = self._lasting(self._steady, td, self._enough)
        # A contact force that briefly equals the weight keeps the momentum constant, too.
        if window and not self._falls_across:
            return (None if self.is_carried else window), None
        return self._under_gravity(td)

    def gravity(self, first: int, last: int) -> float | None:
        """Return gravity between two states of a flight [length/time^2]; 0 if there is none, NaN if it is unknown.

        The result is None if the force is not gravity, or if it only slows the parts down like a brake.
        """
        return None if self._braked(first, last) else self._gravity((first, last))

    def _lasting(
        self, law: Law, td: float, enough: float = 0.0
    ) -> tuple[int, int] | None:
        """Return the states around ``td`` that obey a law of motion even with a tighter tolerance.

        The rounding of the times is allowed for only if there are no such states otherwise, because a larger tolerance
        makes the ends of a flight less accurate.
        """
        find = partial(
            find_lasting_window, law, td, self.extent, fades=True, enough=enough
        )
        window = find(self.noise)
        if window is None and self.noise_of_times > 0:
            window = find(self.noise + self.noise_of_times)
        return window

    @property
    def is_carried(self) -> bool:
        """Return True if the parts must be held by a support whenever no force on them is visible."""
        return self.fall if self.gravities is None else 0.0 not in self.gravities

    def _is_gravity(self, acceleration: float, error: float = _ALIKE) -> bool:
        """Return True if an acceleration equals gravity within a relative error."""
        if self.gravities is None:
            return is_gravity(acceleration, error)
        return any(
            gravity > 0 and abs(acceleration - gravity) <= error * gravity
            for gravity in self.gravities
        )

    def _braked(self, first: int, last: int) -> bool:
        """Return True if a load, unlike damping, stops the parts completely or within a few states."""
        sizes = np.abs(self.fit.momentum[: last + 1])
        largest = float(sizes.max())
        largest_in_window = float(sizes[first:].max())
        length = float(self.fit.time[last] - self.fit.time[first])
        damping = self.fit.damping(first, last)
        if damping > self.fit.limit_damping(first, last):
            return True
        return largest_in_window < _LEFT * largest and damping * length > _DAMPED

    def _under_gravity(self, td: float) -> tuple[tuple[int, int] | None, float | None]:
        """Return the window around ``td`` in which gravity has a usual magnitude. A fading load may still act in it."""
        time = self.fit.time
        momentum = self.fit.momentum
        first, last = self._around(td)
        if last - first < FEWEST or not self.mass > 0:
            return None, None
        windows = []
        across = list(self._weights_across(first, last))
        for weight in across or self._weights_near(first, last):
            key = tuple(weight.tolist())
            if key not in self._given:
                impulse = (time - time[0])[:, np.newaxis] * weight
                self._given[key] = Constant(time, momentum - impulse)
            law = self._given[key]
            window = self._lasting(law, td)
            if window is None:
                enough = self._enough if across else TOLERANCE
                window = self._lasting(law, td, enough)
                if not (window and (across or self._fades_out(window, weight))):
                    window = None
            if window and self._slowed(window, weight):
                return None, None
            if window:
                gravity = float(np.linalg.norm(weight)) / self.mass
                windows.append((window, gravity))
        return max(
            windows,
            key=lambda pair: float(np.ptp(time[[*pair[0]]])),
            default=(None, None),
        )

    def _around(self, td: float) -> tuple[int, int]:
        """Return the states around ``td`` in which a fading or constant load changes the momentum almost linearly."""
        at = min(int(np.searchsorted(self.fit.time, td)), self.fit.time.size - 1)
        return find_longest_window(self.fit, at, TOLERANCE * self.extent + self.noise)

    def _weights_across(self, first: int, last: int) -> Iterator[Samples]:
        """Yield possible forces of gravity (3,), each along a coordinate axis, beside a load of fixed direction.

        They explain the momentum perpendicular to this load, which the load does not change.
        """
        if last - first < FEWEST or not self.mass > 0:
            return
        time = self.fit.time[first : last + 1]
        momentum = self.fit.momentum[first : last + 1]
        deviation = remove_line(time, momentum)
        # The load acts in the direction in which the momentum deviates most from a line.
        along = np.linalg.svd(deviation, full_matrices=False)[2][0]
        across = np.eye(along.size) - np.outer(along, along)
        room = _REACH_OF_NOISE * max(self.noise, ROUND_OFF * self.extent)
        if np.abs(deviation @ across).max() > room:
            return
        if np.abs(deviation @ along).max() < _CLEARLY * room:
            return
        force, _ = np.polyfit(time - time[0], momentum, 1)
        force_across = across @ force
        # Each row of the projection matrix is the component of one coordinate axis perpendicular to the load.
        for axis, axis_across in zip(np.eye(along.size), across, strict=True):
            square = axis_across @ axis_across
            if square <= _SEEN**2:
                continue
            size = float(force_across @ axis_across) / float(square)
            left_over = np.linalg.norm(force_across - size * axis_across)
            is_along_axis = left_over <= _ALIKE * abs(size)
            if is_along_axis and self._is_gravity(abs(size) / self.mass):
                yield size * axis

    def _weights_near(self, first: int, last: int) -> Iterator[Samples]:
        """Yield the usual weights (3,) that are close to the mean force between two states."""
        time = self.fit.time[first : last + 1]
        momentum = self.fit.momentum[first : last + 1]
        force, _ = np.polyfit(time - time[0], momentum, 1)
        acceleration = force / self.mass
        size = float(np.linalg.norm(acceleration))
        if not size > 0:
            return
        direction = acceleration / size
        if np.abs(direction).max() > _ALONG_AXIS:
            direction = np.round(direction)
        for gravity in _list_gravities_near(size, self.gravities):
            yield direction * (self.mass * gravity)

    def _fades_out(self, window: tuple[int, int], weight: Samples) -> bool:
        """Return True if the force in a window minus the ``weight`` (3,) fades and is small at the end."""
        start, end = window
        third = (end - start) // 3
        at = [start, start + third, end - third, end]
        time = self.fit.time[at]
        # Mean force in each third of the window.
        steps = np.diff(time)[:, np.newaxis]
        force = np.diff(self.fit.momentum[at], axis=0) / steps
        first, _, last = np.linalg.norm(force - weight, axis=1)
        is_faded = last <= _FADED * first
        return bool(is_faded and last <= _LITTLE * np.linalg.norm(weight))

    def _gravity(self, window: tuple[int, int]) -> float | None:
        """Return the acceleration in a window [length/time^2]: 0 if it is negligible, None if it is not gravity.

        The result is NaN if neither the mass nor the work of the force is known.
        """
        start, end = self.fit.time[[*window]].tolist()
        vector = self.fit.gravity(*window)
        force = float(np.linalg.norm(vector))
        mass = self.mass if self.mass > 0 else float("nan")
        impulse = force * (end - start)
        if impulse <= _UNSEEN * (TOLERANCE * self.extent + self.noise):
            return None if self.is_carried else 0.0
        error = _ALIKE + _REACH_OF_DIGITS * self.noise / impulse
        if self._is_gravity(force / mass, error):
            return None if self._slowed(window, vector) else force / mass
        # The acceleration follows from the velocity, so the mass is not needed.
        if self.velocity:
            return None
        gravity = None
        if self.balance is not None:
            momentum_along = self.fit.momentum @ (vector / force)
            gravity = find_acceleration_by_work(
                self.balance, self.fit.time, momentum_along, start, end
            )
        if gravity is None:
            return float("nan") if self._may_fall and np.isnan(mass) else None
        if self._is_gravity(gravity):
            return gravity
        return float("nan") if self._may_be_heavier(force, start, end) else None

    def _may_be_heavier(self, force: float, start: float, end: float) -> bool:
        """Return True if a force may be the weight of a mass larger than the lower bound implied by the kinetic energy.

        At the state that shows the largest mass, the kinetic energy of the vibration may be as large as the range of
        the internal energy.
        """
        balance = self.balance
        if self.velocity or not self.mass > 0:
            return False
        if balance is None or balance.kinetic is None or balance.internal is None:
            return False
        squares = np.sum(self.fit.momentum**2, axis=1)
        kinetic = np.interp(self.fit.time, balance.time, balance.kinetic)
        # A lower bound of the mass at each state: p^2/(2 T), which is 0 where there is no kinetic energy.
        lower_bounds = np.zeros_like(squares)
        np.divide(squares, 2 * kinetic, out=lower_bounds, where=kinetic > 0)
        best = int(np.argmax(lower_bounds))
        if self.mass > (1 + LAST_DIGIT) * lower_bounds[best]:
            # The mass exceeds its lower bound by more than rounding, so the solver wrote it.
            return False
        inside = find_window(balance.time, start, end)
        range_of_internal = float(np.ptp(balance.internal[inside]))
        largest = force / self.mass
        smallest = largest * (1 - range_of_internal / float(kinetic[best]))
        gravities = _list_gravities_near(largest, self.gravities)
        return any(smallest <= gravity <= largest for gravity in gravities)

    def _slowed(self, window: tuple[int, int], force: Samples) -> bool:
        """Return True if a constant force (3,) is friction rather than gravity, because it only slows the parts down.

        The force may have the size of gravity by chance, or because the coefficient of friction is 0.1 and units change
        gravity by powers of ten. Therefore gravity must act along an axis and, in a straight motion, have its value in
        units of m or mm and s or ms.
        """
        size = float(np.linalg.norm(force))
        along = force / size
        momentum = self.fit.momentum[[*window]]
        forward = momentum @ along
        if self.gravities is not None or (forward >= 0).any():
            return False
        sideways = momentum - np.outer(forward, along)
        across = float(np.linalg.norm(sideways, axis=1).max())
        is_straight = across <= _STRAIGHT * float(np.abs(forward).max())
        has_usual_size = is_gravity(size / self.mass, _ROUGHLY, decades=3)
        is_along_axis = float(np.abs(along).max()) >= _ALONG_AXIS
        return not is_along_axis or (is_straight and not has_usual_size)

    @property
    def _may_fall(self) -> bool:
        """Return True if gravity may act on the parts."""
        return self.gravities is None or any(self.gravities)

    @cached_property
    def fall(self) -> bool:
        """Return True if the parts fall under gravity at any time. If they never do, something supports them."""
        # A preliminary value is set, because the computation of `fall` needs one.
        self.fall = False
        if not self.noise < TOLERANCE * self.extent or self.fit.time.size < FEWEST:
            return False
        windows = (self._lasting(self.fit, td) for td in list_moments(self.fit.time))
        return any(
            (self._gravity(states) or 0.0) > 0
            for states in windows
            if states and not self._braked(*states)
        )

    @cached_property
    def _falls_across(self) -> bool:
        """Return True if the momentum perpendicular to a load shows gravity at any time."""
        return any(
            next(self._weights_across(*self._around(td)), None) is not None
            and self._under_gravity(td)[0]
            for td in list_moments(self.fit.time)
        )


def _list_gravities_near(
    acceleration: float, known: tuple[float, ...] | None
) -> Iterator[float]:
    """Yield values of gravity close to an acceleration, from the ``known`` values or, by default, the usual ones."""
    if known is not None:
        for gravity in known:
            if abs(acceleration - gravity) < _ROUGHLY * gravity:
                yield gravity
        return
    if not acceleration > 0:
        return
    for value in _OF_DECKS:
        # Other units change the value by a power of ten.
        exponent = np.round(np.log10(acceleration / value))
        gravity = float(value * 10.0**exponent)
        if abs(acceleration / gravity - 1) < _ROUGHLY:
            yield gravity


def is_gravity(acceleration: float, error: float = _ALIKE, decades: int = 1) -> bool:
    """Return True if an acceleration [length/time^2] equals gravity on Earth within a relative error.

    Other units of length and time change its value by powers of ten; the exponents are multiples of ``decades``.

    Examples
    --------
    >>> [is_gravity(size) for size in (9.81, 9810, 9.80665e-3, 386.4, 5.0, float("nan"))]
    [True, True, True, True, False, False]
    """
    if not acceleration > 0:
        return False
    powers = np.log10(acceleration / np.array(_GRAVITY))
    return bool(
        np.abs(powers - decades * np.round(powers / decades)).min()
        <= np.log10(1 + error)
    )


def find_acceleration_by_work(
    balance: Balance, time: Samples, momentum: Samples, start: float, end: float
) -> float | None:
    """Return the acceleration that explains the work done on a momentum [length/time^2].

    The work is the external work or, if this is not written, the change of kinetic plus internal energy.

    Gravity g does the work int g p dt on the parts that it moves; fixed parts have no momentum and need not be known.

    Parameters
    ----------
    balance : Balance
    time, momentum : array of shape (n,)
        Momentum along the force.
    start, end : float
        [time]

    Returns
    -------
    float or None
        None if no such energy is written; 0 if the energies do not follow the momentum.
    """
    work = balance.kinetic_and_internal if balance.worked is None else balance.worked
    inside = find_window(balance.time, start, end)
    if work is None or balance.time[inside].size < FEWEST_STATES_OF_WORK:
        return None
    impulse = integrate_by_trapezia(
        balance.time[inside], np.interp(balance.time[inside], time, momentum)
    )
    columns = [np.ones_like(impulse), impulse]
    if balance.kinetic is not None:
        columns.append(
            integrate_by_trapezia(balance.time[inside], balance.kinetic[inside])
        )
    table = np.stack(columns, axis=1)
    factors, *_ = np.linalg.lstsq(table, work[inside], rcond=None)
    misfit = float(np.abs(work[inside] - table @ factors).max())
    return (
        float(factors[1]) if misfit <= _OF_WORK * float(np.ptp(work[inside])) else 0.0
    )


class FreeFall(Law):
    """Least-squares fits of free flight to windows of one momentum record; the misfit has the unit of the momentum."""

    def __init__(self, time: Samples, momentum: Samples) -> None:
        super().__init__(time)
        self.momentum = momentum
        self.integral = integrate_by_trapezia(time, momentum)
        # Columns that are contiguous in memory can be processed faster.
        self._both = np.asfortranarray(np.hstack([momentum, self.integral]))

    def _misfit(self, first: int, last: int) -> float:
        if (
            last - first < 3
        ):  # The three parameters per component fit any three states exactly.
            return 0.0
        p, impulse, alpha = self._fitted(first, last)
        return float(np.abs(p + alpha * impulse).max())

    def damping(self, first: int, last: int) -> float:
        """Return the least-squares damping rate alpha between two states [1/time]."""
        return self._fitted(first, last)[2]

    def limit_damping(self, first: int, last: int) -> float:
        """Return the largest damping rate alpha between two states [1/time] that is not attributed to a load."""
        length = float(self.time[last] - self.time[first])
        return max(_DAMPED, _SHOWN * (last - first)) / length

    def gravity(self, first: int = 0, last: int = -1) -> Samples:
        """Return the gravity fitted between two states (default: all states), shape (components,) [momentum/time]."""
        last %= self.time.size
        states = slice(first, last + 1)
        undamped = (
            self.momentum[states] + self.damping(first, last) * self.integral[states]
        )
        return np.asarray(
            np.polyfit(self.time[states] - self.time[first], undamped, 1)[0]
        )

    def _select_states(self, first: int, last: int) -> slice | NDArray[np.intp]:
        """Return the slice of states between two states to which the law is fitted."""
        return slice(first, last + 1)

    def _fitted(self, first: int, last: int) -> tuple[Samples, Samples, float]:
        """Return the deviations of momentum and impulse from straight lines, and the alpha >= 0 that relates them."""
        states = self._select_states(first, last)
        deviation = remove_line(self.time[states], self._both[states])
        half = self.momentum.shape[1]
        p = deviation[:, :half]
        impulse = deviation[:, half:]
        power = float((impulse * impulse).sum())
        return (
            p,
            impulse,
            max(0.0, -float((impulse * p).sum()) / power) if power > 0 else 0.0,
        )
