"""Choose td, in a given range or in the longest flight, together with its tr."""

from __future__ import annotations

from dataclasses import replace
from math import sqrt
from typing import TYPE_CHECKING, Final

import numpy as np

from d2rpick.base.tuples import NamedTuple
from d2rpick.choice.pair.quality import (
    EQUALLY_GOOD,
    LIKE_LEVELS,
    LIKE_TIMES,
    ROUNDING,
    get_limit_of_like_quality,
    is_good_residual,
    is_vibration_lost,
    is_within_band,
    rank_candidates,
    rate_certainty_of_tr,
)
from d2rpick.choice.pair.situation import Situation, make_look
from d2rpick.choice.pair.warnings import compute_mean_in_flight, compute_shortfall
from d2rpick.choice.td.flights import (
    MIN_RIGID,
    check_chosen_flight,
    find_longest_flight,
)
from d2rpick.flight import SOURCES
from d2rpick.flight.internal_energy import round_off
from d2rpick.histories.digits import round_down_as_read, sum_times_as_read
from d2rpick.histories.samples import merge_times
from d2rpick.vibration.measures import kinetic_share, vertices

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from d2rpick.choice.pair.candidates import Pair
    from d2rpick.choice.pair.situation import Look
    from d2rpick.choice.question import Settings
    from d2rpick.histories.history import History, Samples
    from d2rpick.vibration.measures import Profile

    Choice = tuple[Situation, Pair]

# The search for the best td tries this many of the most promising energy peaks and as many of the last peaks.
_MOST_PEAKS: Final = 12
# If there are many modes, td is chosen among windows of at least these fractions of the longest window [-].
_LEAST_RIGID: Final = (0.5, 0.25)
_FEWEST_TD, _MOST_TD = 3, 1000
# Number of td values in a uniform grid, which gives a smooth curve on paper and on screen.
STEPS: Final = 200
# Number of decimals with which errors are shown to the user.
_READ: Final = 3
# A pair is mentioned if its rigid time exceeds that of the recommended pair by this fraction of the td range [-].
_MUCH: Final = 0.1
# Safety factor on the uncertainty of a contact time that is estimated from the energy [-].
# In 20 computed falls, the true error was up to 1.9 times the estimated uncertainty.
_HIDDEN: Final = 2.0


def bound_rigid_times(situation: Situation, times: Samples) -> Samples:
    """Return upper bounds of the rigid time of the recommended tr at each td of ``times``, shape (n,) [time].

    If pairs are judged by the level, the recommended tr is not earlier than the first time at which the energy is near
    that at td. "Near" means within the tolerance; if the energy crosses the level and has two extrema before td, it
    means that the levels are treated as equal. If pairs are judged by a model of the vibration at some td, or if the
    level is round-off, the earliest tr is the start of the flight. The result is 0 if this start is unknown.
    """
    start = situation.earliest_tr
    history = situation.history
    if start is None:
        return np.zeros(times.shape)
    start = max(start, history.start)
    if situation.evidence.has_model or start >= history.end:
        return np.maximum(times - start, 0.0)
    time, energy = history.between(np.nextafter(start, np.inf), np.inf)
    time = np.append(start, time)
    energy = np.append(history.energy_at(start), energy)
    extremes = np.minimum.accumulate(energy), np.maximum.accumulate(energy)
    level = history.energies_at(times)
    tolerance = situation.settings.tolerance
    passed = time[
        np.minimum(
            _find_first_near(*extremes, level, np.full(times.shape, -ROUNDING)),
            time.size - 1,
        )
    ]
    turns = np.searchsorted(history.turns, times) - np.searchsorted(
        history.turns, passed, side="right"
    )
    passes = (turns >= 2) & (level > ROUNDING * np.abs(history.energy).max())
    near = np.where(passes, min(tolerance, LIKE_LEVELS), tolerance) + ROUNDING
    # The energy reaches the level at this state, or between the previous state and this state.
    entered = time[np.maximum(_find_first_near(*extremes, level, near) - 1, 0)]
    return np.asarray(
        np.maximum(times - np.where(level <= round_off(history), start, entered), 0.0)
    )


def _find_first_near(
    lowest: Samples, highest: Samples, level: Samples, near: Samples
) -> Samples:
    """Return, for each level, the index of the first state at which the energy reaches it (n if it never does).

    ``lowest`` and ``highest`` are the extrema of the energy up to each state. ``near`` is the largest level error that
    is treated as near; if it is negative, the energy must have been on both sides of the level.
    """
    positive = np.maximum(level, 0.0)
    low = positive * np.maximum(1 - near, 0.0) ** 2
    high = positive * np.maximum(1 + near, 0.0) ** 2
    fallen = lowest.size - np.searchsorted(lowest[::-1], high, side="right")
    return np.asarray(np.maximum(fallen, np.searchsorted(highest, low, side="left")))


class Chosen(NamedTuple):
    """The ``situation`` of the td chosen in a range, and the ``longest`` acceptable pair of this range.

    ``window`` is the requested window, and ``inside`` the part of it that keeps the margin [time].
    """

    situation: Situation
    window: tuple[float, float]
    inside: tuple[float, float]
    longest: Pair | None

    def given_up(self, pair: Pair | None) -> Pair | None:
        """Return the longest pair if it is rigid for much longer than the recommended ``pair``, otherwise None."""
        limit = _MUCH * (self.inside[1] - self.inside[0])
        longest = self.longest
        if longest and pair and longest.rigid_time - pair.rigid_time > limit:
            return longest
        return None


def choose_td(
    history: History,
    window: tuple[float, float] | None,
    settings: Settings,
    since: float | None = None,
    times: Sequence[float] | None = None,
) -> Chosen:
    """Choose td in ``window``, or in the longest flight if ``window`` is None, with a tr no earlier than ``since``.

    Of the pairs at all energy peaks, only those of nearly the best quality are considered, and of these only the pairs
    whose tr is most certain; the pair with the longest rigid window is chosen. If deformations are known, a residual
    within 0.02 of the smallest has nearly the best quality. If only the energy is known, this is a level within the
    tolerance of the best level, which is twice the mean energy. The chosen td keeps the margin before the contact,
    unless the whole window lies in the margin. If no peak is acceptable, the ends of the window are tried. A td of
    ``times`` (by default, an even grid) replaces the chosen one if its pair is better in error or rigid time and worse
    in neither. If nothing vibrates, all td are equally good, and the last one is chosen because it saves most.

    Raises
    ------
    RangeError
        If the window lies outside the record, or if no window is given and no flight is found.
    """
    if window is None:
        window = find_longest_flight(history, settings)
        check_chosen_flight(history, window)
    look = make_look(history, settings, since)
    situation, inside = find_best_known(look, history, window)
    chosen, longest = _choose_by_model(situation, inside, look)
    if chosen is None:
        # A model may be known at the last td although none was known where the window was examined.
        last_situation = make_look(history, settings, since, quick=False)(inside[1])
        if last_situation.vibration.unknown is None:
            look = last_situation.at
            chosen, longest = _choose_by_model(last_situation, inside, look)
    td = chosen if chosen is not None else inside[1]
    if look(td).at_rest:
        last = _find_last_at_rest(situation, inside)
        td = last if last > inside[0] and look(last).at_rest else td
    elif chosen is not None:
        if times is None:
            times = list_offered_times(situation, inside, STEPS)[0].tolist()
        earliest = history.start if since is None else since
        td = _find_unbeaten(
            td,
            times,
            earliest,
            look,
            make_look(history, replace(settings, replay=False), since=since),
        )
    pair = (
        _find_longest(_select_acceptable([look(longest)]))
        if longest is not None
        else None
    )
    return Chosen(
        make_look(history, settings, since, quick=False)(td),
        window,
        inside,
        pair[1] if pair else None,
    )


def list_offered_times(
    situation: Situation, window: tuple[float, float], steps: int
) -> tuple[Samples, set[float]]:
    """Return an ascending grid of td that includes the energy peaks [time], and the set of these peaks."""
    # The grid omits the start of the range, because td must be later.
    grid = np.linspace(*window, steps + 1)[1:]
    peaks = np.array(situation.peaks(*window))
    if peaks.size > steps:
        intervals = np.searchsorted(grid, peaks)
        order = np.lexsort((-situation.vibration.whole.energies(peaks), intervals))
        highest = order[np.diff(intervals[order], prepend=-1) > 0]
        peaks = peaks[highest]
        grid = np.delete(grid, intervals[highest])
    times = merge_times(grid, peaks)
    # The end of the run is omitted, because a run that ends at td is useless.
    return times[times < situation.history.end], set(peaks.tolist())


def get_error_of_pair(situation: Situation, best: Pair | None) -> float | None:
    """Return the error by which pairs are compared across td [-]; None without a pair, or if its level is too high.

    A level is too high if it exceeds the largest possible vibration energy.
    """
    if best is None:
        return None
    if situation.at_rest:
        return 0.0
    if best.residual is not None:
        return best.residual
    mean = compute_mean_in_flight(situation)
    if mean is None:
        error = np.inf
    else:
        error = float(compute_shortfall(np.array(situation.energy_td), mean))
    return error if error < np.inf else None


def round_error(error: float | None) -> float:
    """Round an error to the digits that the user sees; infinity stands for an unknown error."""
    return np.inf if error is None else round(error, _READ)


def _find_unbeaten(
    td: float, times: Iterable[float], earliest: float, look: Look, at_level: Look
) -> float:
    """Return ``td``, or one of ``times`` whose pair is better in error or rigid time and worse in neither.

    Of several better td, the one with the longest rigid time is returned. This step is needed because the peaks were
    compared for the same flight, whereas the flight depends on td if only the energy shows it. If only pairs judged by
    the level (``at_level``) can be compared with the pair at td, no oscillator is fitted at a td that is worse even
    without an oscillator. No pair is rigid before ``earliest`` [time].
    """
    choice = next(iter(_select_acceptable([look(td)])), None)
    if choice is None:
        return td
    look_at = look if choice[0].flight.source == "energy" else choice[0].at
    look_first = (
        at_level if look_at is look and choice[0].basis == "energy" else look_at
    )
    error = round_error(get_error_of_pair(*choice))
    late_enough = (time for time in times if time - earliest >= choice[1].rigid_time)
    better = _select_beating(
        choice,
        [
            look_at(time)
            for time in late_enough
            if _can_beat(look_first(time), choice, error)
        ],
    )
    for situation, _ in sorted(
        better,
        key=lambda candidate: (
            -candidate[1].rigid_time,
            round_error(get_error_of_pair(*candidate)),
        ),
    ):
        longer = look(situation.td)
        if not _select_beating(choice, [longer]):
            continue
        if _rate_tr_at(longer) >= _rate_tr_at(choice[0]):
            return situation.td
    return td


def _can_beat(situation: Situation, choice: Choice, error: float) -> bool:
    """Return True if a pair at the td of a situation may be at least as good as ``choice`` in error and rigid time.

    Pairs judged by deformations are not compared with pairs judged by levels.
    """
    if (situation.basis == "energy") != (choice[0].basis == "energy"):
        return False
    share = situation.kinetic_share
    mean = compute_mean_in_flight(situation)
    smallest_shortfall = (
        0.0
        if mean is None
        else float(compute_shortfall(np.array(situation.energy_td), mean))
    )
    smallest_error = smallest_shortfall if share is None else sqrt(share)
    if round_error(smallest_error) > error:
        return False
    (longest,) = bound_rigid_times(situation, np.array([situation.td]))
    return bool(longest >= choice[1].rigid_time)


def _select_beating(choice: Choice, situations: Iterable[Situation]) -> list[Choice]:
    """Return the choices that are better than the given choice in error or rigid time and worse in neither.

    Errors are rounded as in the output before they are compared.
    """
    error = round_error(get_error_of_pair(*choice))
    rigid = choice[1].rigid_time
    rivals = (
        (situation, best, round_error(get_error_of_pair(situation, best)))
        for situation, best in _select_acceptable(situations)
    )
    return [
        (situation, best)
        for situation, best, rival_error in rivals
        if rival_error <= error
        and best.rigid_time >= rigid
        and (rival_error, best.rigid_time) != (error, rigid)
    ]


def find_best_known(
    look: Look, history: History, window: tuple[float, float]
) -> tuple[Situation, tuple[float, float]]:
    """Return the situation with the most certain flight in ``window``, and the td range before the margin [time].

    Raises
    ------
    RangeError
        If the window lies outside the record.
    """
    history.check(*window, argument="td_window")
    situation = _find_flying(look, window)
    return situation, (window[0], _find_latest(situation, window))


def _find_latest(situation: Situation, window: tuple[float, float]) -> float:
    """Return the last td in the range that keeps the margin even after rounding to printed digits.

    If no td of the window keeps the margin, return the last td in the flight.
    """
    low, high = window
    margin = situation.expected_margin.time
    end = float("inf") if situation.flight.end is None else situation.flight.end
    latest = sum_times_as_read(end, -margin)
    latest = latest if latest > low else situation.latest_td
    return min(
        high, max(low, latest if np.isinf(latest) else round_down_as_read(latest))
    )


def _find_last_at_rest(situation: Situation, window: tuple[float, float]) -> float:
    """Return the last td in a range in which nothing vibrates.

    This td is earlier than the last state, and earlier than the contact by the time by which a switch may shift it.
    """
    history = situation.history
    flight = situation.flight
    # The last state is omitted, because a run that ends at td is useless.
    last = min(window[1], round_down_as_read(float(history.time[-2])))
    spread = situation.expected_margin.spread
    if flight.end is None or not spread:
        return last
    return min(last, round_down_as_read(flight.end - _HIDDEN * spread))


def _find_flying(look: Look, window: tuple[float, float]) -> Situation:
    """Return the first situation with the most certain flight, at the start, middle or end of the range.

    Of flights of equal certainty, a flight that covers a part of the window is preferred to one that only ends in it.
    Then a td whose deformation is known is preferred.
    """
    low, high = window
    situations = []
    for td in (low, (low + high) / 2, high):
        situations.append(look(td))
        if _rate_certainty(situations[-1], window) == (False, 0, False, False):
            break  # No situation can be more certain than this one.
    return min(situations, key=lambda situation: _rate_certainty(situation, window))


def _rate_certainty(
    situation: Situation, window: tuple[float, float]
) -> tuple[bool, int, bool, bool]:
    """Return a sort key for the certainty that td lies in a flight; the smallest key means the greatest certainty."""
    low, high = window
    start, end = situation.flight.within(situation.history.time)
    only_ends_in_it = min(end, high) - max(start, low) < MIN_RIGID * (high - low)
    source = situation.flight.source
    rank = len(SOURCES) if source is None else SOURCES.index(source)
    is_unknown = situation.vibration.unknown is not None
    return not situation.in_flight, rank, only_ends_in_it, is_unknown


def _choose_by_model(
    situation: Situation, window: tuple[float, float], look: Look
) -> tuple[float | None, float | None]:
    """Return the chosen td, and the td of the longest acceptable window, by what is known of the vibration.

    Either is None if no pair is acceptable.
    """
    if situation.basis == "modal":
        return _choose_by_modes(situation, window, look)
    if situation.vibration.unknown:
        return _choose_by_level(situation, window, look)
    return _choose_by_residual(situation, window, look)


def _choose_by_residual(
    situation: Situation, window: tuple[float, float], look: Look
) -> tuple[float | None, float | None]:
    """Return the td of the longest rigid window with a smallest residual, and the td of the longest window of all."""
    peaks = situation.peaks(*window)
    highest = sorted(peaks, key=lambda t: -situation.vibration.whole.energy(t))[
        :_MOST_PEAKS
    ]
    pairs = _select_acceptable(
        look(td) for td in dict.fromkeys((*highest, *peaks[-_MOST_PEAKS:]))
    )
    pairs = pairs or _select_acceptable(map(look, window))
    # The level error of a pair whose deformations are unknown is no residual, so the two are not compared.
    pairs = [pair for pair in pairs if pair[1].residual is not None] or pairs
    # The smallest residual may have the widest error band.
    good = [pair for pair in pairs if _is_good(pair[1])] or pairs
    limit = min(
        (best.error for _, best in good), default=0.0
    ) + get_limit_of_like_quality(situation)
    alike = [pair for pair in good if pair[1].error <= limit]
    return _get_td(_find_longest(_select_surest(alike))), _get_td(_find_longest(pairs))


def _select_surest(pairs: Sequence[Choice]) -> list[Choice]:
    """Return the pairs with the most certain tr. Pairs that are too short to be planned are used only if all are."""
    if not pairs:
        return []
    long = _drop_too_short(pairs)
    certainties = [_rate_tr_at(situation) for situation, _ in long]
    return [
        pair
        for pair, pair_certainty in zip(long, certainties, strict=True)
        if pair_certainty == max(certainties)
    ]


def _drop_too_short(pairs: Sequence[Choice]) -> Sequence[Choice]:
    """Return the pairs that are long enough to be planned; all pairs if none is."""
    if not pairs:
        return pairs
    shortest = MIN_RIGID * pairs[0][0].history.duration
    return [pair for pair in pairs if pair[1].rigid_time >= shortest] or pairs


def _rate_tr_at(situation: Situation) -> int:
    """Return the certainty of the tr that is recommended at a td, from 0 to 2; 0 if no tr is recommended."""
    best = next(rank_candidates([situation], in_flight=True)).chosen
    return 0 if best is None else rate_certainty_of_tr(best)


def _choose_by_modes(
    situation: Situation, window: tuple[float, float], look: Look
) -> tuple[float | None, float | None]:
    """For many modes, return the td of a long window with a small residual, and that of the longest acceptable window.

    The energy at td does not matter. Of the long windows that are good, one of nearly the longest is used, because a
    longer rigid time is worth more than a still smaller residual. If no long window is good, a shorter good window is
    used. If there is no good window, the result is the longest of the long windows that may be as good as the best one,
    given its error band. A window after which the vibration is lost is used only if this is true of all windows.
    """
    compared = situation.vibration.compared
    start = situation.earliest_tr
    if start is None or compared is None:
        return _choose_by_residual(situation, window, look)
    first = max(start, compared.first)
    last = min(window[1], compared.last)
    pairs: list[Choice] = []
    for share in _LEAST_RIGID:
        times = _list_times_by_modes(situation, (window[0], first, last), share)
        pairs += _select_acceptable(look(td) for td in times)
        least_time = share * (last - first)
        good = [pair for pair in _drop_too_short(pairs) if _is_good(pair[1])]
        long = [pair for pair in good if pair[1].rigid_time >= least_time]
        if long:
            return _find_best_of_long(long)[0].td, _get_td(_find_longest(pairs))
    if not pairs:
        return _choose_by_residual(situation, window, look)
    if good:
        return _get_td(_find_longest(good)), _get_td(_find_longest(pairs))
    # However long a window is, it is not worth the loss of a vibration that a shorter window keeps.
    kept = [pair for pair in pairs if not is_vibration_lost(*pair)] or pairs
    least_time = _LEAST_RIGID[0] * (last - first)
    long = [pair for pair in kept if pair[1].rigid_time >= least_time] or kept
    alike = _find_longest(_select_within_band(long))
    return _get_td(alike), _get_td(_find_longest(pairs))


def _is_good(pair: Pair) -> bool:
    """Return True if the residual of a pair is small enough for the grade "good"."""
    residual, highest = np.array([pair.residual, pair.residual_high], np.float64)
    return bool(is_good_residual(residual, highest))


def _select_within_band(pairs: Sequence[Choice]) -> list[Choice]:
    """Return the pairs whose error exceeds the smallest one only slightly, or by no more than its uncertainty."""
    errors = np.array([pair.error for _, pair in pairs])
    highest = np.array([pair.residual_high for _, pair in pairs], np.float64)
    doubted = np.sqrt((errors**2 + np.fmax(highest, errors) ** 2) / 2)
    best = int(np.argmin(doubted))
    is_alike = is_within_band(doubted, errors, doubted[best], errors[best])
    is_alike |= errors <= errors[best] + EQUALLY_GOOD
    return [pair for pair, alike in zip(pairs, is_alike, strict=True) if alike]


def _find_best_of_long(pairs: Sequence[Choice]) -> Choice:
    """Return the choice with the smallest error among the choices that are hardly shorter than the longest choice."""
    longest = max(pair.rigid_time for _, pair in pairs)
    long = [
        choice for choice in pairs if choice[1].rigid_time >= (1 - LIKE_TIMES) * longest
    ]
    return min(long, key=lambda choice: (choice[1].error, -choice[1].rigid_time))


def _list_times_by_modes(
    situation: Situation, bounds: tuple[float, float, float], share: float
) -> list[float]:
    """Return td with locally smallest residuals and at least ``share`` of the longest rigid time; empty for few td.

    ``bounds`` are the first td, the first tr and the last td [time].
    """
    (earliest, first, last), modes = bounds, situation.vibration.modal
    if modes is None:
        return []
    least_rigid = share * (last - first)
    times = modes.time[(modes.time >= max(earliest, first + least_rigid))]
    times = times[(times > first) & (times <= last)]
    if times.size < _FEWEST_TD:
        return []
    times = times[:: -(-times.size // _MOST_TD)]
    rows = [
        _find_least_error(modes.profile(td), first, td - least_rigid)
        for td in times.tolist()
    ]
    errors, tr = np.array(rows).T
    # Half of the uncertainty is added to each estimate, because the smallest of many estimates is too optimistic.
    squares = errors**2 + kinetic_share(modes, times) + modes.half_width(tr, times) / 2
    middle = squares[1:-1]
    is_lowest = (middle <= squares[:-2]) & (middle < squares[2:])
    inner = np.flatnonzero(is_lowest) + 1
    best = inner[np.argsort(squares[inner], kind="stable")[:_MOST_PEAKS]]
    offered: list[float] = vertices(times, squares, best)[0].tolist()
    offered += vertices(times, squares, inner[-_MOST_PEAKS:])[0].tolist()
    offered.append(float(times[np.argmin(squares)]))
    # A minimum that the end of the range cuts off is offered like one just before it.
    if squares[-1] < squares[-2]:
        offered.append(float(times[-1]))
    return [*dict.fromkeys(offered)]


def _find_least_error(
    profile: Profile, first: float, last: float
) -> tuple[float, float]:
    """Return the smallest frozen-deformation error [-] in a range of tr, and its tr [time]; infinite without any tr."""
    rows = slice(*np.searchsorted(profile.time, [first, last]).tolist())
    errors = profile.error[rows]
    if not errors.size:
        return np.inf, first
    best = int(np.argmin(errors))
    return float(errors[best]), float(profile.time[rows][best])


def _choose_by_level(
    situation: Situation, window: tuple[float, float], look: Look
) -> tuple[float | None, float | None]:
    """Return the td chosen by the energy level alone; the best level is closest to the peak vibration energy, 2 <E>."""
    mean = compute_mean_in_flight(situation)
    peaks = situation.peaks(*window)
    if mean is None or not peaks:
        return None, None
    levels = situation.history.energies_at(np.array(peaks))
    falls = dict(zip(peaks, compute_shortfall(levels, mean).tolist(), strict=True))
    below = sorted((td for td in peaks if falls[td] < 1), key=falls.__getitem__)
    # No oscillator is fitted at each td, because that would take too long.
    best = next((td for td in below if _select_acceptable([situation.at(td)])), None)
    if best is None:
        return None, None
    limit = falls[best] + situation.settings.tolerance
    alike = _find_longest(
        _list_by_rigid_time(situation, [td for td in below if falls[td] <= limit])
    )
    chosen = look(alike[0].td) if alike else None
    return _get_td(alike if chosen and _select_acceptable([chosen]) else None), _get_td(
        _find_longest(_list_by_rigid_time(situation, below))
    )


def _list_by_rigid_time(
    situation: Situation, times: Iterable[float]
) -> Iterator[Choice]:
    """Yield acceptable choices, largest upper bound on the rigid time first, until no other can be rigid for longer."""
    tds = np.fromiter(times, np.float64)
    longest = 0.0
    bounds = bound_rigid_times(situation, tds)
    order = np.lexsort((-tds, -bounds))
    for td, possible in zip(tds[order].tolist(), bounds[order].tolist(), strict=True):
        if possible <= 0 or possible < longest:
            return
        for pair in _select_acceptable([situation.at(td)]):
            longest = max(longest, pair[1].rigid_time)
            yield pair


def _select_acceptable(situations: Iterable[Situation]) -> list[Choice]:
    """Return the situations whose recommended pair saves time, together with this pair."""
    return [
        (candidates.situation, candidates.saving)
        for candidates in rank_candidates([*situations], in_flight=True)
        if candidates.saving
    ]


def _find_longest(pairs: Iterable[Choice]) -> Choice | None:
    """Return the choice with the longest rigid time, or the last of several equal ones; None if there is no choice."""
    return max(pairs, key=lambda pair: (pair[1].rigid_time, pair[0].td), default=None)


def _get_td(pair: Choice | None) -> float | None:
    """Return the td of a chosen pair; None if no pair was chosen."""
    return pair[0].td if pair else None
