"""Compute the errors of a pair (tr, td), with one function for each measure of the output.

A switched run keeps only the deformation of the vibration at tr, and starts at td with this deformation and without
vibration velocity. Let q be the signed deformation in units of the square root of energy, so that q^2 is the elastic
energy. The difference between the switched run and the reference run after td is then the free vibration that starts
from q(tr) - q(td) and -q'(td). All measures compare this difference with the vibration of the reference run.
"""

from __future__ import annotations

from math import sqrt
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from d2rpick.base.tuples import NamedTuple, Record
from d2rpick.histories.samples import find_first_above, narrow_brackets

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from numpy.typing import NDArray

    from d2rpick.histories.history import Samples
    from d2rpick.vibration.modes import Mode

    # Values for n times, as arrays of shape (n,) keyed by name; unknown values are NaN.
    Columns = Mapping[str, Samples]
    # A function that returns the residual of each tr with its lower and upper bound [-].
    # The function takes the residuals of the deformations, the candidate times tr, and the time td.
    Band = Callable[[Samples, Samples, Any], tuple[Samples, Samples, Samples]]

# Largest increase of the frozen-deformation error within the timing tolerance [-].
TOLERATED_GROWTH = 0.05
# Half-width of the error band of the squared residual due to noise [standard deviations].
# In a normal distribution, 98.8 % of the errors lie within 2.5 standard deviations.
BAND_DEVIATIONS = 2.5
# Fraction of the squared residual that depends on the phases at td, per damping ratio [-]; in theory, at most 2.
_PHASES_COUNT = 1.5


class Deformation(Protocol):
    """Interface of a vibration model: products of deformations at different times, and energies."""

    def compare(
        self, tr: Samples | float, td: Samples | float
    ) -> tuple[Samples, Samples]:
        """Return `separation` and `overlap` from one evaluation, with the shape of ``tr`` [energy]."""

    def elastic_energy(self, t: Samples | float) -> Samples:
        """Return the elastic energy of the deformation, with the shape of ``t`` [energy]."""

    def overlap(self, tr: Samples | float, td: Samples | float) -> Samples:
        """Return the product of the deformations at tr and td, with the shape of ``tr`` [energy]."""

    def separation(self, tr: Samples | float, td: Samples | float) -> Samples:
        """Return the elastic energy of the difference of the deformations at tr and td [energy]."""

    def kinetic_energy(self, t: Samples | float) -> Samples:
        """Return the kinetic energy T of the vibration [energy]."""

    def vibration_energy(self, t: Samples | float) -> Samples:
        """Return the energy V of the vibration [energy]."""


class Measured(Record):
    """Measures of one tr that require known deformations; a measure is None if it is unknown.

    ``residual_low`` and ``residual_high`` are bounds of the residual that allow for vibration that the model may have
    missed.
    """

    sign_match: bool | None = None
    lock_in_error: float | None = None
    residual: float | None = None
    residual_low: float | None = None
    residual_high: float | None = None
    timing_tolerance: float | None = None


def measured(
    vibration: Deformation,
    tr: Samples,
    td: Samples | float,
    find_tolerances: Callable[[Samples], Samples],
    band: Band,
) -> Columns:
    """Compute a column for each field of `Measured` from times tr (n,) and one ``td``, or a td for each tr.

    ``find_tolerances`` returns the timing tolerances of the times [time], given their frozen-deformation errors [-].
    """
    lock_in, has_sign = compare(vibration, tr, td)
    error, lowest, highest = bound_residuals(vibration, lock_in, tr, td, band)
    return {
        "sign_match": has_sign.astype(np.float64),
        "lock_in_error": lock_in,
        "residual": error,
        "residual_low": lowest,
        "residual_high": highest,
        "timing_tolerance": find_tolerances(lock_in),
    }


def bound_residuals(
    vibration: Deformation,
    lock_in: Samples,
    tr: Samples,
    td: Samples | float,
    band: Band,
) -> tuple[Samples, Samples, Samples]:
    """Return the stated residual of each tr (n,) with its lower and upper bound, from its error ``lock_in`` [-]."""
    return band(residual(lock_in, kinetic_share(vibration, td)), tr, td)


def spread(size: int, found: Sequence[tuple[NDArray[np.intp], Columns]]) -> Columns:
    """Place columns of `Measured` in the given rows of a table with ``size`` rows; the other rows are NaN."""
    # This array needs no memory, because it is broadcast from a single value.
    nothing = np.broadcast_to(np.nan, size)
    spread = {name: nothing.copy() if found else nothing for name in Measured._fields}
    for rows, columns in found:
        for name, column in columns.items():
            spread[name][rows] = column
    return spread


def compared(columns: Columns) -> NDArray[np.bool_]:
    """Return a mask of the times at which the deformation can be compared with that at td."""
    return ~np.isnan(columns["sign_match"])


def level_error(energy: Samples | float, level: Samples | float) -> Samples:
    """Return |sqrt(E(tr)/E(td)) - 1| [-], the relative amplitude error, in the shape of ``energy``.

    The error is NaN if the energy is negative, or if the ``level`` at td is not positive.

    Examples
    --------
    >>> float(level_error(1.21, 1.0)), float(level_error(1.0, -805.0))
    (0.1000..., nan)
    """
    energy = np.asarray(energy)
    comparable = (energy >= 0) & (level > 0)
    with np.errstate(
        over="ignore"
    ):  # If the level is near zero, the relative error of any other energy may overflow to infinity.
        square = np.divide(
            energy, level, out=np.full(energy.shape, np.nan), where=comparable
        )
    return np.asarray(np.abs(np.sqrt(square) - 1))


def kinetic_share(vibration: Deformation, td: Samples | float) -> Samples:
    """Return K = T(td)/V(td) [-], the kinetic fraction of the vibration energy at td, which no tr preserves.

    The result has the shape of ``td``.

    V = T + (q - q0)^2 is the energy of the vibration about the preload q0; if there is no preload, V = T + E.
    """
    return np.asarray(vibration.kinetic_energy(td) / vibration.vibration_energy(td))


def lock_in_error(
    vibration: Deformation, tr: Samples | float, td: Samples | float
) -> Samples:
    """Return L = |q(tr) - q(td)|/sqrt(V(td)) [-], the error of the locked-in deformation, in the shape of ``tr``.

    For one mode, L = |sqrt(E(tr)) - s sqrt(E(td))|/sqrt(V(td)) with s = 1 for equal signs of the deformation, else -1.
    For several modes, L is the root of the sum of squares over all modes, since their energies add up. ``td`` is one
    time for all tr, or one time for each tr.
    """
    return np.asarray(
        np.sqrt(vibration.separation(tr, td)) / np.sqrt(vibration.vibration_energy(td))
    )


def sign_match(
    vibration: Deformation, tr: Samples | float, td: Samples | float
) -> NDArray[np.bool_]:
    """Return True for each tr at which the deformation has the same direction as at td.

    For one mode, the signs are equal. For several modes, the sum of q(tr) q(td) over all modes is not negative, so that
    a mode with little deformation does not decide.
    """
    return np.asarray(vibration.overlap(tr, td) >= 0)


def compare(
    vibration: Deformation, tr: Samples, td: Samples | float
) -> tuple[Samples, NDArray[np.bool_]]:
    """Return `lock_in_error` and `sign_match` of each tr, from one evaluation of its deformation."""
    separation, overlap = vibration.compare(tr, td)
    return np.sqrt(separation) / np.sqrt(vibration.vibration_energy(td)), overlap >= 0


def band_about(
    squared: Samples, off: Samples, hidden: Samples | float, left_out: Samples | float
) -> tuple[Samples, Samples, Samples]:
    """Return a residual with its lower and upper bound, from its square and the error of the square [-].

    The square may deviate by ``off`` to either side; it may also be higher by ``hidden`` and lower by ``left_out`` [-].
    Squares are not negative: if the band reaches below zero, the middle of its remainder is returned as the residual.
    """
    low = np.maximum(squared - off, 0.0)
    high = squared + off
    lowest = np.maximum(low - left_out, 0.0)
    return np.sqrt((low + high) / 2), np.sqrt(lowest), np.sqrt(high + hidden)


def phase_share(alpha: Samples | float, omega: Samples | float) -> Samples:
    """Return the fraction of the squared residual that depends on the phase of the error at td [-].

    Damping dissipates energy only while a mode moves. Therefore the error relative to the vibration after td differs
    from that at td by a fraction of about the damping ratio, ``alpha`` divided by 2 ``omega``.
    """
    return np.asarray(_PHASES_COUNT * np.abs(alpha) / (2 * omega))


def residual(lock_in: Samples | float, kinetic: Samples | float) -> Samples:
    """Return R = sqrt(L^2 + K) [-], the vibration error after td relative to the reference vibration.

    Examples
    --------
    >>> float(residual(0.3, 0.16))
    0.5
    """
    return np.asarray(np.sqrt(np.square(lock_in) + kinetic))


def wrong_sign(kinetic: float) -> float:
    """Return R = sqrt(4 - 3 K) [-], the residual if tr has the level but not the sign of td, L^2 = 4 (1 - K).

    Examples
    --------
    >>> wrong_sign(0.0), wrong_sign(1.0)
    (2.0, 1.0)
    """
    return sqrt(4 - 3 * kinetic)


def run_time_share(
    rigid_fraction: float, cost_share: float, step_ratio: float
) -> float:
    """Return the expected run time of the switched run divided by that of the reference run, 1 - f (1 - (1 - c)/n) [-].

    In the rigid window, which is a fraction f of the run, there are n times fewer time steps, and each step saves the
    fraction c of its cost that the elements of the switched parts need.

    Parameters
    ----------
    rigid_fraction : float
        f = (td - tr)/(span of the record) [-].
    cost_share : float
        c, the fraction of a step's cost that the elements of the switched parts need, from 0 to 1 [-].
    step_ratio : float
        n, time step while the parts are rigid divided by the time step while they are deformable [-].

    Examples
    --------
    >>> run_time_share(0.5, 0.8, 1.0), run_time_share(0.5, 0.5, 2.0)
    (0.6, 0.625)
    """
    return 1 - rigid_fraction * (1 - (1 - cost_share) / step_ratio)


def timing_tolerance(
    mode: Mode, tr: Samples, td: Samples | float, errors: Samples
) -> Samples:
    """Return the time by which each tr (n,) may be wrong in either direction before L grows by 0.05 [time].

    ``errors`` are the frozen-deformation errors L of each tr [-].
    The limit is the nearest time at which |q - q(td)| exceeds its value at tr by the tolerated growth. If it never
    does, the limit is one period, because q has then passed through all its values.
    """
    wanted = np.broadcast_to(mode.deformation(td), tr.shape)
    amplitude = np.sqrt(mode.vibration_energy(td))
    room = (errors + TOLERATED_GROWTH) * amplitude
    half_period = np.pi / mode.omega
    still = mode.standstill_after(tr)
    # Times of zero velocity on both sides of tr, in columns: first those after each tr, then those before it.
    steps_after, steps_before = [0.0, 1.0, 2.0], [-1.0, -2.0, -3.0]
    steps = np.repeat([steps_after, steps_before], tr.size, axis=0).T * half_period
    # Between successive times, q is monotone.
    edges = np.vstack([np.tile(tr, 2), np.tile(still, 2) + steps])
    distances = _leaving(mode, edges, np.tile(wanted, 2), np.tile(room, 2))
    nearest = distances.reshape(2, -1).min(axis=0)
    return np.asarray(np.minimum(nearest, 2 * half_period))


def _leaving(mode: Mode, edges: Samples, wanted: Samples, room: Samples) -> Samples:
    """Return the time from ``edges[0]`` until |q - wanted| first exceeds ``room``; infinity if it never does.

    Between neighbouring edges q is monotone, so q leaves the band in the interval before the first edge outside the
    band.
    """
    outside = np.abs(mode.deformation(edges) - wanted) > room
    # tr itself is inside the band, even if rounding places it outside.
    outside[0] = False
    first = np.argmax(outside, axis=0)
    column = np.flatnonzero(first > 0)
    first_outside = first[column]
    inner = edges[first_outside - 1, column]
    outer = edges[first_outside, column]
    # The deformation q leaves the band through its upper limit if ``side`` is 1, through its lower limit if it is -1.
    middle = wanted[column]
    tolerated = room[column]
    side = np.sign(mode.deformation(outer) - middle)

    def stay_within(t: Samples) -> tuple[Samples, Samples]:
        q, velocity = mode.motion(t)
        return tolerated - side * (q - middle), -side * velocity

    leaving_time = narrow_brackets(stay_within, inner, outer)
    distances = np.full(room.size, np.inf)
    distances[column] = np.abs(leaving_time.at - edges[0, column])
    return distances


def vertices(
    time: Samples, values: Samples, at: NDArray[np.intp]
) -> tuple[Samples, Samples]:
    """Return times and values of the vertices of parabolas through the samples ``at`` and their neighbours."""
    before, after = at - 1, at + 1
    step_before = time[at] - time[before]
    step_after = time[after] - time[at]
    both_steps = step_before + step_after
    slope_before = (values[at] - values[before]) / step_before
    slope_after = (values[after] - values[at]) / step_after
    bend = (slope_after - slope_before) / both_steps
    slope = (slope_before * step_after + slope_after * step_before) / both_steps
    # A sample next to an infinite value, or on a straight line, is its own vertex.
    bent = np.isfinite(bend) & (bend != 0)
    step = np.divide(-slope, 2 * bend, out=np.zeros(at.shape), where=bent)
    rise_to_vertex = np.multiply(step, slope / 2, out=np.zeros(at.shape), where=bent)
    return time[at] + step, values[at] + rise_to_vertex


class Profile(NamedTuple):
    """Frozen-deformation errors ``error`` [-] at ascending times ``time`` [time], both of shape (n,), for one td."""

    time: Samples
    error: Samples

    @classmethod
    def of(cls, vibration: Deformation, time: Samples, td: float) -> Profile:
        """Compute the error profile at the times before ``td``."""
        time_before = time[
            : np.searchsorted(time, td)
        ]  # The arrays are views, because a copy for each td would fill the memory.
        return cls(time_before, lock_in_error(vibration, time_before, td))

    def minima(self) -> tuple[float, ...]:
        """Return the times of the local minima of the error L [time], found by fitting parabolas to L^2.

        L^2 is smooth at a minimum, whereas L may have a kink there.
        """
        t = self.time
        square = self.error**2
        if t.size < 3:
            return ()
        at = (
            np.flatnonzero((square[1:-1] < square[:-2]) & (square[1:-1] <= square[2:]))
            + 1
        )
        return tuple(vertices(t, square, at)[0].tolist())

    def cell(self, at: Samples) -> Samples:
        """Return the interval between the samples around ``at`` [time]; infinity if there are fewer than two."""
        if self.time.size < 2:
            return np.full(np.shape(at), np.inf)
        next_state = np.clip(np.searchsorted(self.time, at), 1, self.time.size - 1)
        return np.asarray(self.time[next_state] - self.time[next_state - 1])

    def tolerances(self, tr: Samples, errors: Samples) -> Samples:
        """Return by how much each tr (n,) may be wrong before L grows by 0.05, up to the length of the profile [time].

        ``errors`` are the frozen-deformation errors at each tr; the profile is linear between its times.
        """
        limit = errors + TOLERATED_GROWTH
        middle = np.searchsorted(self.time, tr)
        last = self.time.size - 1
        first_after = find_first_above(self.error, middle, limit)
        last_before = last - find_first_above(
            self.error[::-1], last + 1 - middle, limit
        )
        tolerance = np.full(tr.shape, self.time[-1] - self.time[0])
        for outside, inwards in ((first_after, -1), (last_before, 1)):
            is_inside = np.flatnonzero((outside >= 0) & (outside <= last))
            tolerance[is_inside] = np.fmin(
                tolerance[is_inside],
                self._leaving(
                    outside[is_inside], inwards, tr[is_inside], limit[is_inside]
                ),
            )
        return tolerance

    def _leaving(
        self, outside: NDArray[np.intp], inwards: int, tr: Samples, limit: Samples
    ) -> Samples:
        """Return the time from each ``tr`` to the point at which linear interpolation reaches an error of ``limit``."""
        inside = np.clip(outside + inwards, 0, self.time.size - 1)
        # If there is no sample between tr and the first sample outside, tr itself is the point inside.
        is_beyond_tr = (self.time[inside] - tr) * inwards > 0
        t0 = np.where(is_beyond_tr, tr, self.time[inside])
        e0 = np.where(is_beyond_tr, limit - TOLERATED_GROWTH, self.error[inside])
        t1, e1 = self.time[outside], self.error[outside]
        share = np.divide(limit - e0, e1 - e0, out=np.zeros(tr.shape), where=e1 != e0)
        return np.asarray(np.abs(t0 + share * (t1 - t0) - tr))
