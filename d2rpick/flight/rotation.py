"""Find the steady rotation of a flying body from the displacements of its parts relative to its centre.

In a body that rotates at a constant rate, each part moves on a circle. The displacements minus these circles are the
motion of the parts relative to each other, in a frame that rotates with the body. The moving parts are chosen so that
the other parts most nearly form one rigid body.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from d2rpick.histories.samples import integrate_by_trapezia, remove_line

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from d2rpick.histories.history import Samples

    Places = NDArray[np.intp]

# An accepted rotation may leave at most this fraction of the displacements unexplained [-].
_SHOWN: Final = 0.25
# Largest number of Gauss-Newton steps; from a good start, a dozen steps reach full precision.
_MOST_STEPS: Final = 25
# _SMALL: step of the numerical derivative with respect to the angular velocity [revolutions per record].
# _LEAST_GAIN: the iteration stops once the angular velocity or the fit changes by less than this fraction [-].
_SMALL: Final = 1e-6
_LEAST_GAIN: Final = 1e-4
# A sum of m r^2, about an axis or left unexplained, is treated as zero below this fraction of the full sum [-].
_VANISHING: Final = 1e-6
# Numbers of periods per record that are tried as starting values for the harmonic motion.
_PERIODS: Final = (*(n / 20 for n in range(4, 41)), *(2 * 1.1**n for n in range(1, 25)))

# Number of candidates for the next moving part that each of two criteria selects.
_TRIED: Final = 2
# Omitting the next moving part must reduce the unexplained displacement to at most this fraction [-].
_MORE_RIGID: Final = 0.5
# A rotation that moves the other parts by at most this fraction of the motion of the moving part is ignored [-].
_NOTABLE_WAY: Final = 0.1
# If one part has more than this fraction of the mass, the rotation of the body cannot be determined [-].
_MOST_OF_BODY: Final = 0.95
# Smallest mass fraction of the parts that are tried [-]; lighter parts hardly move the others.
_HEAVY: Final = 0.05


def _fit_steady_rotation(
    time: Samples, ways: Samples, masses: Samples, least: float
) -> tuple[Samples, float]:
    """Fit the constant angular velocity that best explains how the parts of a body are displaced about its centre.

    Parameters
    ----------
    time : array of shape (n,)
        [time]
    ways : array of shape (n, parts, 3)
        Displacements relative to the centre of mass, each up to a constant [length].
    masses : array of shape (parts,)
        [mass]
    least : float
        Smallest sum of m r^2 over parts and states for which displacements can show a rotation [mass length^2].

    Returns
    -------
    rate : array of shape (3,)
        Angular velocity of the body [rad/time]; 0 if no rotation explains three quarters of the displacements.
    rest : float
        Sum of m r^2 over parts and states that the rotation does not explain [mass length^2].
    """
    weights = np.sqrt(masses)[:, np.newaxis]
    stood = float(np.sum(_compute_rest(time, ways, np.zeros(3), weights) ** 2))
    if stood <= least:
        return np.zeros(3), stood
    terms = _list_linear_terms(time, ways, masses)
    _, right_side, normal = (term.sum(axis=0) for term in terms)
    inverse = np.linalg.pinv(normal, rcond=_VANISHING, hermitian=True)
    rate = np.asarray(inverse @ right_side)
    misfit = _compute_rest(time, ways, rate, weights)
    small = _SMALL * 2 * np.pi / float(time[-1] - time[0])
    damping = 1e-3
    for _ in range(_MOST_STEPS):
        columns = []
        for axis in np.eye(3):
            moved = _compute_rest(time, ways, rate + small * axis, weights)
            columns.append((moved - misfit).ravel() / small)
        slope = np.stack(columns, axis=1)
        normal = slope.T @ slope
        damping_matrix = damping * np.trace(normal) * np.eye(3) / 3
        # The smallest number keeps the matrix regular if the misfit does not depend on the rate.
        damped = normal + damping_matrix + np.finfo(float).tiny * np.eye(3)
        step = -np.linalg.solve(damped, slope.T @ misfit.ravel())
        trial = _compute_rest(time, ways, rate + step, weights)
        gain = 1 - float(np.sum(trial**2)) / max(
            float(np.sum(misfit**2)), np.finfo(float).tiny
        )
        if gain >= 0:
            rate = rate + step
            misfit = trial
            damping = damping / 10
        else:
            damping *= 10
        if 0 <= gain <= _LEAST_GAIN or float(np.abs(step).max()) <= small:
            break
    turned = float(np.sum(misfit**2))
    return (rate, turned) if turned <= _SHOWN * stood else (np.zeros(3), stood)


def subtract_circles(time: Samples, ways: Samples, rate: Samples) -> Samples:
    """Return the displacements (n, parts, 3) in the rotating frame, minus their mean and the circular motion.

    The circle of each part is fitted by least squares, because its arm (the position at the start) is unknown.
    """
    frame = _rotate_frame(time, rate)
    turned = ways @ frame
    frame = frame - frame.mean(axis=0)
    turned = turned - turned.mean(axis=0)
    normal = np.tensordot(frame, frame, axes=((0, 2), (0, 2)))
    right_side = np.tensordot(turned, frame, axes=((0, 2), (0, 2)))
    arms = right_side @ np.linalg.pinv(normal, rcond=_VANISHING, hermitian=True)
    return np.asarray(turned - arms @ frame)


def count_periods(time: Samples, left: Samples, rate: Samples) -> float:
    """Return the number of periods of the harmonic motion that best fits the unexplained displacement.

    A motion of less than a period looks like an arc, so subtracting a circle has removed most of it. Therefore a circle
    is also subtracted from each trial motion before it is compared with ``left`` (n, 3). The result is infinite if no
    trial motion explains half of ``left``.
    """
    wanted = (left - left.mean(axis=0)).ravel()
    least_misfit = 0.5 * float(wanted @ wanted)
    best_periods = np.inf
    since_start = (time - time[0])[:, np.newaxis, np.newaxis]
    duration = time[-1] - time[0]
    for periods in _PERIODS:
        phase = 2 * np.pi * periods * since_start / duration
        cosines = np.cos(phase) * np.eye(3)
        sines = np.sin(phase) * np.eye(3)
        motions = np.concatenate([cosines, sines], axis=1)
        remaining_motions = subtract_circles(time, motions, rate)
        # One column for each motion, with the values of all states and directions.
        columns = remaining_motions.transpose(0, 2, 1).reshape(wanted.size, -1)
        amplitudes = np.linalg.lstsq(columns, wanted, rcond=_VANISHING)[0]
        misfit = float(np.sum((wanted - columns @ amplitudes) ** 2))
        if misfit < least_misfit:
            least_misfit = misfit
            best_periods = float(periods)
    return best_periods


def _compute_least_displacements(ways: Samples, masses: Samples) -> Samples:
    """Return, for each omitted part, the sum of m r^2 of all other parts about their common centre, shape (parts,)."""
    deviations = ways - ways.mean(axis=0)
    squares = np.sum(deviations**2, axis=(0, 2))
    return _sum_without_each(masses * squares, masses)


def _estimate_least_rests(time: Samples, ways: Samples, masses: Samples) -> Samples:
    """Estimate, for each omitted part, the sum of m r^2 of the other parts that no rotation explains, shape (parts,).

    In a rotation, the velocity is rate x displacement. Therefore the displacements minus straight lines are rate x
    their integrals. This is linear in the rate, and each part can easily be removed from the normal equations.
    """
    terms = _list_linear_terms(time, ways, masses)
    square, right_side, normal = (_sum_without_each(term, masses) for term in terms)
    inverse = np.linalg.pinv(normal, rcond=_VANISHING, hermitian=True)
    rate = np.einsum("pij,pj->pi", inverse, right_side)
    explained = np.einsum("pi,pi->p", right_side, rate)
    return np.asarray(square - explained)


def _sum_without_each(terms: Samples, masses: Samples) -> Samples:
    """Sum quadratic terms (parts, ...) over all parts but one, about their common centre, for each omitted part."""
    # Without a part, the common centre moves away from it, which raises its term by the factor 1/(1 - m/M).
    shares_of_others = 1 - masses / masses.sum()
    raised_terms = (terms.T / shares_of_others).T
    return np.asarray(terms.sum(axis=0) - raised_terms)


def _list_linear_terms(
    time: Samples, ways: Samples, masses: Samples
) -> tuple[Samples, Samples, Samples]:
    """Return the normal equations of each part: squares (parts,), right side (parts, 3), matrix (parts, 3, 3)."""
    columns = ways.reshape(time.size, -1)
    bent_places = remove_line(time, columns).reshape(ways.shape)
    integrals = integrate_by_trapezia(time, columns)
    arm = remove_line(time, integrals).reshape(ways.shape)
    square = masses * np.einsum("npi,npi->p", bent_places, bent_places)
    moment = np.cross(arm, bent_places).sum(axis=0)
    right_side = masses[:, np.newaxis] * moment
    # For any vector u, the sum of (u x arm)^2 is u (trace(outer) - outer) u.
    outer = np.einsum("npi,npj->pij", arm, arm)
    trace = np.trace(outer, axis1=1, axis2=2)
    normal = trace[:, np.newaxis, np.newaxis] * np.eye(3) - outer
    return square, right_side, masses[:, np.newaxis, np.newaxis] * normal


def _compute_rest(
    time: Samples, ways: Samples, rate: Samples, weights: Samples
) -> Samples:
    """Return the sum of m r^2 that a rotation at the angular velocity ``rate`` leaves unexplained."""
    return np.asarray(weights * subtract_circles(time, ways, rate))


def _rotate_frame(time: Samples, rate: Samples) -> Samples:
    """Return the axes (n, 3, 3) of a frame that rotates at ``rate``; they transform row vectors into this frame."""
    size = float(np.linalg.norm(rate))
    axis = rate / size if size > 0 else np.zeros(3)
    since_start = time - time[0]
    angle = size * since_start[:, np.newaxis, np.newaxis]
    x, y, z = axis
    # The product ``across @ v`` is the cross product of the axis and v.
    across = np.array(
        [
            [0.0, -z, y],
            [z, 0.0, -x],
            [-y, x, 0.0],
        ]
    )
    # This is Rodrigues' formula.
    odd = np.sin(angle) * across
    even = (1 - np.cos(angle)) * (across @ across)
    return np.asarray(np.eye(3) + odd + even)


def find_moving_parts(
    time: Samples, ways: Samples, mass: Samples
) -> tuple[list[int], Samples, float]:
    """Find the parts that move relative to the others, the rotation of the others, and the unexplained sum of m r^2."""
    moving: list[int] = []
    rate = np.zeros(3)
    misfit = np.inf
    while True:
        remaining = np.setdiff1d(np.arange(mass.size), moving)
        best_part = _find_next_moving_part(time, ways, mass, remaining)
        if best_part is None or best_part.rest > _MORE_RIGID * misfit:
            return moving, rate, misfit
        part, rate, misfit, _ = best_part
        moving.append(part)


class _Apart(NamedTuple):
    """Rigid rotation fitted to all parts but one: the rotation, the misfit, and the effect of the omitted part."""

    part: int
    rate: Samples
    rest: float
    effect: float


def _find_next_moving_part(
    time: Samples, ways: Samples, mass: Samples, left: Places
) -> _Apart | None:
    """Find the part whose omission leaves parts that move most nearly like a rigid body.

    If one part slides, all parts may seem to rotate.  Among parts that are equally good, the one with the largest
    effect is chosen.
    """
    about = _subtract_centre(ways[:, left], mass[left])
    masses = mass[left]
    orders = (
        np.argsort(_estimate_least_rests(time, about, masses)),
        np.argsort(_compute_least_displacements(about, masses)),
    )
    candidates: list[int] = []
    for order in orders:
        parts = left[order].tolist()
        allowed = [part for part in parts if _can_leave_out(mass, left, part)]
        candidates += allowed[:_TRIED]
    trials = [
        _leave_part_out(time, ways, mass, left, part)
        for part in dict.fromkeys(candidates)
    ]
    squares = (about - about.mean(axis=0)) ** 2
    nothing = _VANISHING * float(np.sum(masses[:, np.newaxis] * squares))
    least_misfit = min((trial.rest for trial in trials), default=0.0) + nothing
    alike = [trial for trial in trials if _MORE_RIGID * trial.rest <= least_misfit]
    return max(alike, key=lambda trial: trial.effect, default=None)


def _leave_part_out(
    time: Samples, ways: Samples, mass: Samples, left: Places, part: int
) -> _Apart:
    """Omit one part, and fit the rotation of the others."""
    remaining = left[left != part]
    ways_of_others = ways[:, remaining]
    masses = mass[remaining]
    centre_of_others = np.average(ways_of_others, axis=1, weights=masses)
    path_of_part = ways[:, [part]] - centre_of_others[:, np.newaxis]
    squares = (path_of_part - path_of_part.mean(axis=0)) ** 2
    # A rotation that moves the other parts by a small fraction of this path is ignored.
    least = _NOTABLE_WAY**2 * masses.sum() * float(np.sum(squares))
    about = _subtract_centre(ways_of_others, masses)
    rate, misfit = _fit_steady_rotation(time, about, masses, least)
    unexplained = subtract_circles(time, path_of_part, rate)
    effect = float(mass[part] * np.linalg.norm(unexplained))
    return _Apart(part, rate, misfit, effect)


def _subtract_centre(ways: Samples, mass: Samples) -> Samples:
    """Return the displacements relative to the centre of mass."""
    return np.asarray(ways - np.average(ways, axis=1, weights=mass)[:, np.newaxis])


def _can_leave_out(mass: Samples, left: Places, part: int) -> bool:
    """Return True if the other parts have at least half of the mass, and no part has almost all of it."""
    masses_of_others = mass[left[left != part]]
    total = masses_of_others.sum()
    has_half = 2 * total >= mass.sum()
    is_spread = masses_of_others.max() <= _MOST_OF_BODY * total
    return bool(has_half and is_spread)


def has_clear_rotation(mass: Samples) -> bool:
    """Return True if the rotation of the body is still found after omitting any one of its heavy parts."""
    if mass.size < 3:
        return False
    columns = np.arange(mass.size)
    is_heavy = mass >= _HEAVY * mass.sum()
    is_most = 2 * mass > mass.sum()
    heavy = columns[is_heavy & ~is_most].tolist()
    return all(_can_leave_out(mass, columns, part) for part in heavy)
