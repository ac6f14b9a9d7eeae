"""Find flights from the internal energy if better data are missing, and refine flights found from other energies.

The internal energy alone is poor evidence and never certain, because a mild contact may leave no trace in it. Therefore
the window begins later than the energy suggests, and ends earlier if the energy shows a contact.

Even if other evidence shows a flight, the internal energy must keep its level, and there must be motion besides the
vibration. A fixed rigid wall does no work, so kinetic plus internal energy is constant in a crash into it, and two
colliding bodies keep their total momentum. But pushed parts deform, and parts that spring back gain speed: the internal
energy then drifts, and the total energy does not follow it as it would if damping reduced both.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from d2rpick.base.memory import remember
from d2rpick.base.tuples import NamedTuple
from d2rpick.flight.window import FEWEST, LAST_DIGIT, SHORTEST
from d2rpick.histories.samples import find_crossings, find_window

if TYPE_CHECKING:
    from d2rpick.histories.history import Balance, History, Samples


# Widening of the energy band before td, as a fraction of the band width [-]; the band may miss part of an oscillation.
_BAND_RESERVE: Final = 0.25
# Fraction of the time before td that is excluded from the energy band [-], because the load may still act in it.
# In 45 computed runs, the energy entered its band too early by up to 30 % of the time before td.
_WAIT: Final = 1 / 3
# _OUTER: fraction of the lowest and of the highest energies that lie outside the usual range [-].
# _LATEST: fraction of the time before td in which the usual rate of change of the energy is measured [-].
# _FASTER: smallest rate of change that shows a contact, relative to the usual rate of change before td [-].
_OUTER, _LATEST, _FASTER = 0.1, 1 / 4, 2.0
# Averaging time for the energy level, as a fraction of the time without load [-].
# The level has changed once the mean energy leaves the range of earlier means, extended by its width at both ends.
_LEVEL: Final = 1 / 8
# _KNOWN: fraction of the time before a possible landing that sets the energy range for comparison [-].
# _TURNED: smallest number of energy extrema that are required in the time that sets this range.
_KNOWN, _TURNED = 3 / 4, 4


# Widening at which the energy band of the last quarter of a flight includes all energies of the flight [band widths].
_RESERVE: Final = 0.5
# Largest difference between the mean energies in the last two quarters of a flight, relative to the energy band [-].
# A vibration with 3/4 of a period in each quarter changes the mean energies by 30 % of the band width.
# A steady drift changes the mean energies of the two quarters by the band width.
_DRIFT: Final = 0.35
# A slow vibration passes through half of its energy range at least this often; a crash does so less often.
_SWINGS: Final = 4
# Smallest energy range in each half of a flight with a slow vibration, as a fraction of the total range [-].
_ALIKE: Final = 0.75
# _TO_ZERO: largest minimum of the energy of a single vibration, relative to its peaks [-].
# _HARDLY: largest oscillation of the energy that is ignored, relative to the plastic energy [-].
_TO_ZERO, _HARDLY = 0.05, 1e-3
# _FLAT: a yielding body's minimum and later level may differ from zero and the peak by this fraction of the rise [-].
# _MOST_FLAT: the energy stays near its minimum for at most this multiple of its rise time [-].
# The energy of a harmonic motion stays near its minimum for 0.7 of its rise time.
# The energy of a body that collides later stays near its minimum for longer.
_FLAT, _MOST_FLAT = 0.1, 1.0
# Largest rise of the total energy while a body yields and loses kinetic energy, relative to the yielding energy [-].
_NOT_FROM_MOTION: Final = 0.1


class QuietTime(NamedTuple):
    """A window in which the energy shows no load [time]; ``end`` is None if the record shows no later contact.

    The window was found around ``td``. ``settled`` is the time at which the energy had settled; for safety, the time
    from ``settled`` to ``start`` is not used.
    """

    start: float
    end: float | None
    settled: float
    td: float


def find_quiet_time(history: History, td: float) -> QuietTime | None:
    """Find the window around ``td`` in which the energy keeps its level and its band [time]; None if there is none."""
    start = history.start
    after_td = int(np.searchsorted(history.time, td, side="right"))
    states = slice(0, after_td)
    rounding = round_off(history)
    energy_before = history.energy[states]
    is_unloaded = (
        rounding > 0
        and energy_before.size >= FEWEST
        and max(energy_before.max(), -energy_before.min()) <= rounding
    )
    if is_unloaded and td - start >= SHORTEST * (history.end - start):
        # No load has acted since the start of the record.
        burst = _find_burst(history, states)
        return QuietTime(start, burst, start, td)
    settled = find_end_of_load(history, td)
    if settled is None:
        return None
    states = _select_states(history, settled, after_td)
    excursion = _find_last_excursion(history, states)
    if excursion is not None:
        settled = excursion
        states = _select_states(history, settled, after_td)
    push = _find_last_push(history, states, td - _LATEST * (td - settled))
    if push is not None:
        settled = push
        states = _select_states(history, settled, after_td)
    changes = (
        _find_burst(history, states),
        _find_change_of_level(history, states),
    )
    end = min((time for time in changes if time), default=None)
    start = settled + _WAIT * (td - settled)
    return QuietTime(start, end, settled, td)


def _select_states(history: History, start: float, stop: int) -> slice:
    """Return the states from the time ``start`` up to the state before ``stop``."""
    return slice(int(np.searchsorted(history.time, start)), stop)


@remember
def find_landing_after(history: History, start: float) -> float | None:
    """Return the first time after ``start`` at which the energy quickly leaves its range so far [time]; otherwise None.

    The energy is compared with its range in the first 3/4 of the time since ``start``, and must leave this range by
    more than its width. No vibration exceeds its range over so long a time by so much.
    """
    time, energy = history.between(start, np.inf)
    if time.size < FEWEST:
        return None
    # Each state is compared with the states in the first part of the time from ``start`` to this state.
    end_of_known = start + _KNOWN * (time - start)
    last_known = np.searchsorted(time, end_of_known, side="right") - 1
    top = np.maximum.accumulate(energy)[last_known]
    bottom = np.minimum.accumulate(energy)[last_known]
    turns_before = np.searchsorted(history.turns, start)
    turns = np.searchsorted(history.turns, time[last_known]) - turns_before
    is_late = time - start >= SHORTEST * history.duration
    is_beyond = energy > 2 * top - bottom
    beyond = np.flatnonzero((turns >= _TURNED) & is_late & is_beyond)
    if not beyond.size:
        return None
    first = int(beyond[0])
    # The landing begins where the energy last leaves the band of the compared states.
    top_of_band = top[first] + _BAND_RESERVE * (top[first] - bottom[first])
    in_band = np.flatnonzero(energy[: first + 1] <= top_of_band)
    return float(time[in_band[-1] + 1])


def find_end_of_load(history: History, td: float) -> float | None:
    """Return the last time before td at which the energy enters its band, i.e. the end of the load [time].

    The band is the energy range in the last quarter of the record before td, widened by a quarter of its width. The
    result is None if the energy was never above the band, so that no end of a load is visible. It is also None if the
    last part of the energy leaves the range of the rest, so that a load still acts on the parts.
    """
    length = td - history.start
    start = td - length / 4
    middle = td - length / 16
    first, first_of_latest = np.searchsorted(history.time, [start, middle])
    after_middle, after_td = np.searchsorted(history.time, [middle, td], side="right")
    earlier = history.energy[first:after_middle]
    earlier = np.append(earlier, history.energy_at(middle))
    latest = history.energy[first_of_latest:after_td]
    latest = np.append(latest, history.energy_at(td))
    if latest.max() > earlier.max() + _BAND_RESERVE * np.ptp(earlier):
        return None
    values = np.append(earlier, latest)
    level = float(values.max() + _BAND_RESERVE * np.ptp(values))
    time = history.time[:after_td]
    energy = history.energy[:after_td]
    above = energy > level
    falls = np.flatnonzero(above[:-1] & ~above[1:])
    if not falls.size:
        return None
    last = slice(falls[-1], falls[-1] + 2)
    return float(find_crossings(time[last], energy[last], level)[0][0])


def _find_last_excursion(history: History, states: slice) -> float | None:
    """Return the last time in the given states at which the energy is far from its usual values; otherwise None."""
    energy = history.energy[states]
    if energy.size < FEWEST:
        return None
    usual_range = np.quantile(energy, (_OUTER, 1 - _OUTER))
    low, high = _widen_band(usual_range, 1.0)
    far = np.flatnonzero((energy < low) | (energy > high))
    if not far.size:
        return None
    return float(history.time[states][far[-1]])


def _find_last_push(history: History, states: slice, latest: float) -> float | None:
    """Return the time in the given states at which the last unusually fast energy change ends; None if there is none.

    The usual rates of change are those from the time ``latest`` on.
    """
    time = history.time[states]
    if time.size < FEWEST:
        return None
    rates = _compute_rates(history)[states.start : states.stop - 1]
    is_latest = time[1:] >= latest
    largest_usual = rates[is_latest].max(initial=0.0)
    fast = np.flatnonzero(rates > _FASTER * largest_usual)
    if not fast.size:
        return None
    return float(time[fast[-1] + 1])


@remember
def _compute_rates(history: History) -> Samples:
    """Return the rate of change of the energy between successive states, shape (n - 1,) [energy/time]."""
    return np.asarray(np.abs(np.diff(history.energy)) / np.diff(history.time))


def _find_burst(history: History, states: slice) -> float | None:
    """Return the first time [time] after the given states at which the energy exceeds its band; otherwise None."""
    _, top = _widen_band(history.energy[states], _BAND_RESERVE)
    later_energy = history.energy[states.stop :]
    above = np.flatnonzero(later_energy > top)
    if not above.size:
        return None
    return float(history.time[states.stop + above[0]])


def _find_change_of_level(history: History, states: slice) -> float | None:
    """Return the first time [time] after the given states at which the mean energy leaves its band; otherwise None."""
    count = states.stop - states.start
    width = round(_LEVEL * count)
    if width < 1:
        return None
    sums = _sum_energies(history)[states.start :]
    means = (sums[width:] - sums[:-width]) / width
    # The mean with the index ``count`` is the first mean that contains only later states.
    low, high = _widen_band(means[: count - width + 1], 1.0)
    later_means = means[count:]
    outside = np.flatnonzero((later_means < low) | (later_means > high))
    if outside.size:
        middle = states.stop + int(outside[0]) + width // 2
        return float(history.time[middle])
    return None


@remember
def _sum_energies(history: History) -> Samples:
    """Return the sums of the energies of the first 0, 1, ... n states, shape (n + 1,) [energy]."""
    return np.append(0.0, np.cumsum(history.energy))


def _widen_band(values: Samples, share: float) -> tuple[float, float]:
    """Return the band of the given values, widened at both ends by a fraction of its width."""
    room = share * float(np.ptp(values))
    return float(values.min()) - room, float(values.max()) + room


@remember
def round_off(history: History) -> float:
    """Return the energy up to which an internal energy is only round-off of the run's largest energy [energy]."""
    balance = history.balance
    terms: list[Samples | None] = []
    if balance:
        terms += [balance.internal, balance.kinetic]
        terms += [balance.external_work, balance.total]
    # A single largest value may be wrong, as in a damaged file.
    return LAST_DIGIT * max(map(_find_second_largest, (history.energy, *terms)))


def _find_second_largest(term: Samples | None) -> float:
    """Return the largest absolute energy that two states have or exceed [energy]; 0 if there are no two states."""
    if term is None or term.size < 2:
        return 0.0
    return float(np.partition(np.abs(term), -2)[-2])


def find_largest(*terms: Samples | None) -> float:
    """Return the largest absolute energy [energy]. Missing arrays are skipped; if all are missing, return 0."""
    written = [term for term in terms if term is not None]
    return max((float(np.abs(term).max(initial=0.0)) for term in written), default=0.0)


def find_settled_time(
    time: Samples,
    energy: Samples,
    damped: Samples | None,
    start: float,
    end: float,
    unseen: float = 0.0,
    *,
    driven: bool = False,
) -> float | None:
    """Return the time in a window after which the internal energy keeps its level [time]; None if the energy drifts.

    Parameters
    ----------
    time, energy : array of shape (n,)
    damped : array of shape (k, n), or None
        Energies that damping reduces. The level may fall by as much as one of them falls; if it is None, by any amount.
    start, end : float
        [time]
    unseen : float
        Rounding error of these energies [energy]; the level may also fall by this amount.
    driven : bool
        True if the energies grow under a load of unknown size. A steady push also makes a body oscillate about a level,
        so slow oscillations are then no evidence of a free vibration.
    """
    inside = find_window(time, start, end)
    rounding = LAST_DIGIT * float(np.abs(energy).max(initial=0.0))
    first = inside.start
    last = inside.stop
    while last - first >= FEWEST:
        if damped is None:
            lost = np.full(last - first, np.inf)
        else:
            lost = _sum_later_losses(damped[:, first:last]) + unseen
        states = energy[first:last], lost, rounding
        is_slow = not driven and _has_slow_swings(*states)
        first_kept = 0 if is_slow else _find_first_kept(*states)
        if first_kept is not None:
            settled = first + first_kept
            return start if settled == inside.start else float(time[settled])
        first += max(1, (last - first) // 4)
    return None


def rises_as_it_yields(
    time: Samples,
    energy: Samples,
    whole: Samples | None,
    start: float,
    settled: float,
    end: float,
) -> bool:
    """Return True if an internal energy rises at the start of a flight because a vibrating body yields.

    The energy of permanent deformation remains in the internal energy, which rises at once to the level that it keeps
    later.

    Parameters
    ----------
    time, energy : array of shape (n,)
    whole : array of shape (n,), or None
        Kinetic plus internal energy without the work of gravity; None if these are not written.
    start, settled, end : float
        Start and end of the flight, and the time in it from which the energy keeps its level [time].
    """
    rising = find_window(time, start, settled)
    level = find_window(time, settled, end)
    before = energy[rising]
    kept = energy[level]
    if before.size < 2 or not kept.size:
        return False
    lowest = float(before.min())
    rise = float(kept.min()) - lowest
    if rise <= 0 or float(before.max()) > float(kept.max()) + _FLAT * rise:
        return False
    if whole is not None:
        grown = whole[rising] - np.minimum.accumulate(whole[rising])
        if grown.max() > _NOT_FROM_MOTION * rise:
            return False
    high = int(np.argmax(before >= lowest + (1 - _FLAT) * rise))
    first_swing = before[: high + 1]
    if first_swing[-1] < lowest + (1 - _FLAT) * rise:
        return False
    times = time[rising][: high + 1]
    flat = first_swing <= lowest + _FLAT * rise
    if not flat.any():
        return False
    last_flat = int(np.flatnonzero(flat)[-1])
    first_flat = int(np.argmax(flat))
    rise_time = times[-1] - times[last_flat]
    return bool(times[last_flat] - times[first_flat] <= _MOST_FLAT * rise_time)


def _sum_later_losses(damped: Samples) -> Samples:
    """Return the energy that damping removes from each state to the last quarter of a window, shape (n,) [energy]."""
    last_quarter = damped[:, 3 * damped.shape[1] // 4 :]
    final_level = last_quarter.mean(axis=1, keepdims=True)
    losses = damped - final_level
    return np.asarray(losses.max(axis=0, initial=0.0))


def _find_first_kept(energy: Samples, lost: Samples, least: float) -> int | None:
    """Return the first state after which an energy stays on the level of its last quarter; None if it drifts there.

    The energy may exceed this level by ``lost`` (n,), the energy that damping takes after each state; infinite if
    unknown.
    """
    half = energy.size // 2
    last = 3 * energy.size // 4
    third_quarter = slice(half, last)
    last_quarter = energy[last:]
    low = float(last_quarter.min())
    high = float(last_quarter.max())
    width = max(high - low, least)
    drift = float(last_quarter.mean() - energy[third_quarter].mean())
    # Energy that damping takes explains a decrease, but not an increase.
    explained = float(lost[third_quarter].mean()) if drift < 0 else 0.0
    if abs(drift) > _DRIFT * width + explained:
        return None
    earlier = energy[:last]
    lost_earlier = lost[:last]
    top = high + _RESERVE * width + lost_earlier
    known_losses = np.where(np.isinf(lost_earlier), 0.0, lost_earlier)
    bottom = low - _RESERVE * width - known_losses
    outside = np.flatnonzero((earlier < bottom) | (earlier > top))
    if not outside.size:
        return 0
    return int(outside[-1]) + 1


def _has_slow_swings(energy: Samples, lost: Samples, least: float) -> bool:
    """Return True if an energy oscillates slowly about one level, by half of its range and equally in both halves."""
    width = float(np.ptp(energy))
    if width <= least:
        return True
    first_half, second_half = np.array_split(energy, 2)
    # Near the end of a fall, the sum of energies is larger than in the last quarter, although damping takes nothing.
    taken = 0.0 if np.isinf(lost[0]) else float(lost[0])
    drift = float(second_half.mean() - first_half.mean())
    # Energy that damping takes explains a decrease, but not an increase.
    explained = taken if drift < 0 else 0.0
    if abs(drift) > _DRIFT * _ALIKE * width + explained:
        return False
    if min(np.ptp(first_half), np.ptp(second_half)) < _ALIKE * width - taken:
        return False
    return _count_large_swings(energy, width / 2) >= _SWINGS


def _count_large_swings(energy: Samples, least: float) -> int:
    """Count the energy extrema that follow a change of at least ``least``."""
    extrema = np.flatnonzero(np.diff(np.sign(np.diff(energy)))) + 1
    turns = 0
    low = energy[0]
    high = energy[0]
    rising = None
    for value in [*energy[extrema].tolist(), float(energy[-1])]:
        low = min(low, value)
        high = max(high, value)
        if rising is not True and value - low >= least:
            turns = turns + 1
            rising = True
            high = value
        elif rising is not False and high - value >= least:
            turns = turns + 1
            rising = False
            low = value
    return turns


def has_whole_motion(balance: Balance, start: float, end: float) -> bool:
    """Return True if a window has more kinetic energy than the vibration of the internal energy accounts for."""
    inside = find_window(balance.time, start, end)
    if (
        balance.kinetic is None
        or balance.internal is None
        or not balance.time[inside].size
    ):
        return True
    kinetic = balance.kinetic[inside]
    internal = balance.internal[inside]
    top = float(internal.max())
    bottom = float(internal.min())
    if bottom <= _TO_ZERO * top:
        least_kinetic = _TO_ZERO * top
    else:
        least_kinetic = max(top - bottom, _HARDLY * top)
    return float(kinetic[int(np.argmax(internal))]) > least_kinetic
