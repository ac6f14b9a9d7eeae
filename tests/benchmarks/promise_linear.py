"""Random records of linear structures, whose motion is known exactly.  A further class is a line in `LINEAR`."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import ellipj

from d2rpick.histories.history import Samples
from tests.benchmarks.promise_modes import Load, Modes, Parts, Stretch
from tests.benchmarks.promise_records import (
    Make,
    Record,
    add_evidence,
    ask_for_times,
    draw_log,
)
from tests.benchmarks.promise_truth import Truth

# A longer record would only take more time.
_MOST_STATES: Final = 4000
_FEWEST_PER_PERIOD: Final = 6.0
PART_COLUMNS: Final = ("frame_internal_energy", "cabin_internal_energy")


class Shapes(NamedTuple):
    """Vibrating structure: ``ratios`` (k,) are the frequencies of its modes relative to a first frequency.

    ``local`` (k, k) maps loads on places to loads on the modes, and ``loaded`` (k,) says which places have any.
    """

    ratios: Samples
    local: Samples
    loaded: Samples
    parts: Parts | None = None


class Surroundings(NamedTuple):
    """Properties of a record needed to draw its slow deformation: times, and the amplitude of each mode, shape (k,)."""

    period: float
    loaded_until: float
    swings: Samples


DrawShapes = Callable[[np.random.Generator], Shapes]
DrawDamping = Callable[[np.random.Generator, Samples], Samples]
DrawStretch = Callable[[np.random.Generator, Surroundings], Stretch]


def make_linear(
    random: np.random.Generator,
    *,
    shapes: DrawShapes,
    damping: DrawDamping | None = None,
    stretch: DrawStretch | None = None,
    fading: bool = False,
    irregular: bool = False,
    coarse: bool = False,
    plastic: bool = False,
    noise: float = 0.0,
) -> Record:
    """Make one record.

    ``damping`` gives the ratios of modes by their frequencies; ``fading``: a preload vanishes at take-off; ``plastic``:
    the load leaves work of 0.1 to 50 times the vibration; ``noise``: standard deviation over the swing of the flight.
    """
    shape = shapes(random)
    period = draw_log(random, 0.005, 0.05)
    undamped = 2 * np.pi / period * shape.ratios
    draw_damping = damping or damp_by_mass
    ratio = draw_damping(random, shape.ratios)
    modes = Modes(
        rate=undamped * np.sqrt(1 - ratio**2),
        decay=undamped * ratio,
        loads=_draw_loads(random, shape, period, fading=fading),
        parts=_scale(shape.parts, period),
    )
    flight_start = modes.loaded_until
    if stretch is not None:
        first_period = np.linspace(flight_start, flight_start + period, 400)
        swings = np.abs(modes.compute_states(first_period)[0]).max(axis=0)
        modes = modes._replace(
            stretch=stretch(random, Surroundings(period, flight_start, swings))
        )
    flight_end = flight_start + random.uniform(4, 15) * period
    time = _draw_times(
        random, modes.fastest_period / 2, flight_end, irregular=irregular, coarse=coarse
    )

    elastic, kinetic = modes.compute_energies(time)
    part_count = elastic.shape[1]
    flight_energy = elastic.sum(axis=1)[time >= flight_start]
    swing = float(np.ptp(flight_energy))
    unit = draw_log(random, 10.0, 1e4) / float(flight_energy.max())
    work = draw_log(random, 0.1, 50.0) * swing if plastic else 0.0
    worked = work * np.clip(time / flight_start, 0, 1) ** 2
    scatter = noise * swing * random.standard_normal(elastic.shape)
    # The noise is divided among the parts, so that the noise of their sum is that of one record.
    energies = (
        elastic + worked[:, np.newaxis] / part_count + scatter / np.sqrt(part_count)
    )

    names = list(PART_COLUMNS) if part_count > 1 else ["internal_energy"]
    columns = {"time": time}
    columns |= dict(zip(names, unit * energies.T, strict=True))
    columns |= add_evidence(
        random, time, _add_impulses(modes.loads, time), unit * kinetic
    )
    suggest = ask_for_times(random, flight_start, flight_end)
    if random.random() < 1 / 4:
        suggest["after"] = flight_start
    reading = {"energy": names} if part_count > 1 else {}
    return Record(
        columns, Truth(modes, (flight_start, flight_end)), read=reading, suggest=suggest
    )


def _add_impulses(loads: Sequence[Load], time: Samples) -> Samples:
    """Return the integral of the loads up to the times, shape (n,); a short kick may lie between two of them."""
    return np.asarray(
        sum(np.abs(load.heights).max() * load.integrate(time) for load in loads)
    )


def _draw_loads(
    random: np.random.Generator, shape: Shapes, period: float, *, fading: bool
) -> list[Load]:
    """Draw up to three pushes, in most records followed by a kick, or a load that fades."""
    scale = shape.loaded * np.exp(random.uniform(np.log(0.2), 0.0, shape.ratios.size))

    def draw_heights() -> Samples:
        return np.asarray(shape.local @ (scale * random.normal(size=scale.size)))

    loads: list[Load] = []
    start = 0.0
    kicked = random.random() < 3 / 4
    for _ in range(int(random.integers(0 if kicked or fading else 1, 4))):
        start += random.uniform(0, 1.0) * period
        height = (
            0.4 if kicked else 1.0
        )  # slow modes must not hide the effect of a kick on the fast modes
        loads.append(
            Load(start, draw_log(random, 0.1, 1.5) * period, height * draw_heights())
        )
    pushed_until = max((load.end for load in loads), default=0.0)
    take_off = pushed_until + random.uniform(0.1, 0.8) * period
    fastest_period = period / shape.ratios.max()
    if fading:
        loads.append(
            Load(
                take_off,
                draw_log(random, 0.05, 0.6) * period,
                2 * draw_heights(),
                fades=True,
            )
        )
    elif kicked:
        duration = random.uniform(0.2, 0.8) * fastest_period
        impulse = 1 / (
            4 * shape.ratios * duration / period
        )  # duration of a short push: velocity over undamped frequency
        loads.append(Load(take_off, duration, impulse * draw_heights()))
    return loads


def _draw_times(
    random: np.random.Generator,
    fastest_period: float,
    end: float,
    *,
    irregular: bool,
    coarse: bool,
) -> Samples:
    """Draw the times of states, with some states in each period of the fastest line of the energy."""
    density = draw_log(random, 2.2, 8.0) if coarse else draw_log(random, 10.0, 50.0)
    most_shared = max(_MOST_STATES * fastest_period / end, _FEWEST_PER_PERIOD)
    step = fastest_period / min(density, most_shared)
    if not irregular:
        return np.arange(0.0, end, step)
    steps = step * random.uniform(0.4, 1.6, int(3 * end / step) + 2)
    if random.random() < 0.5:
        restart = random.integers(
            0, int(end / step)
        )  # a restart with another output interval
        steps[restart:] *= random.choice([0.5, 2.0])
    time = np.cumsum(steps)
    return np.asarray(np.append(0.0, time[time < end]))


def _scale(parts: Parts | None, period: float) -> Parts | None:
    """Draw the velocities of parts for a first frequency of 1 in their unit."""
    return parts and parts._replace(masses=parts.masses * period / (2 * np.pi))


# Functions that return damping ratios of modes, shape (k,), given their frequencies relative to the first.


def damp_by_mass(random: np.random.Generator, ratios: Samples) -> Samples:
    """Damp all modes at one rate, or none."""
    return np.asarray(random.choice([0.0, draw_log(random, 1e-4, 0.02)]) / ratios)


def damp_by_stiffness(random: np.random.Generator, ratios: Samples) -> Samples:
    """Damp fast modes more than slow ones."""
    return np.minimum(draw_log(random, 1e-3, 0.02) * ratios, 0.3)


def damp_each(random: np.random.Generator, ratios: Samples) -> Samples:
    """Damp each mode individually."""
    return np.asarray(np.exp(random.uniform(np.log(5e-4), np.log(0.05), ratios.size)))


# Frequencies of modes.


def draw_modes(
    random: np.random.Generator, fewest: int, most_modes: int, highest: float
) -> Shapes:
    """Draw this number of modes, between a first frequency and the ``highest``."""
    gaps = random.uniform(0.3, 1.7, int(random.integers(fewest, most_modes + 1)) - 1)
    return _keep_apart(
        np.append(1.0, 1 + (highest - 1) * np.cumsum(gaps) / gaps.sum())
        if gaps.size
        else np.ones(1)
    )


def draw_close(random: np.random.Generator) -> Shapes:
    """Draw one or two pairs of modes whose frequencies differ by 0.3 to 6 %, possibly with another mode."""
    first = np.array([1.0, random.uniform(1.3, 3.5)])[: random.integers(1, 3)]
    second = first * (
        1 + np.exp(random.uniform(np.log(0.003), np.log(0.06), first.size))
    )
    second_rate = random.uniform(1.3, 3.5, random.integers(0, 2))
    return _keep_apart(np.concatenate([first, second, second_rate]))


def draw_harmonic(random: np.random.Generator) -> Shapes:
    """Draw modes at two or three times a first frequency, exactly or nearly, possibly with another mode."""
    multiples = [(2.0,), (3.0,), (2.0, 3.0)][random.integers(0, 3)]
    frequency_error = random.choice([0.0, 1e-3]) * random.normal(size=len(multiples))
    second_rate = random.uniform(1.2, 3.5, random.integers(0, 2))
    return _keep_apart(
        np.concatenate(
            [[1.0], np.array(multiples) * (1 + frequency_error), second_rate]
        )
    )


def _keep_apart(ratios: Samples) -> Shapes:
    return Shapes(np.sort(ratios), np.eye(ratios.size), np.ones(ratios.size))


def draw_exchange(random: np.random.Generator) -> Shapes:
    """Draw two parts with their own energies, whose nearly equal frequencies a weak spring couples."""
    frame = np.append(1.0, random.uniform(1.3, 3.0, random.integers(0, 2)))
    cabin = np.append(
        1 + random.uniform(-0.05, 0.05), random.uniform(1.3, 3.0, random.integers(0, 2))
    )
    positions = np.concatenate([frame, cabin])
    owners = np.repeat([0, 1], [frame.size, cabin.size])
    springs = [(0, frame.size, draw_log(random, 0.01, 0.15))]
    if positions.size > 2:
        springs.append((0, positions.size - 1, draw_log(random, 0.01, 0.3)))
    owners = np.append(owners, random.integers(0, 2, len(springs)))
    return _couple(positions, springs, owners, np.ones(positions.size, dtype=bool))


def draw_leak(random: np.random.Generator) -> Shapes:
    """Draw modes whose energy leaks through weak springs into others nearby, which are not recorded."""
    recorded = np.append(1.0, random.uniform(1.3, 3.0, random.integers(0, 3)))
    positions = [*recorded]
    springs: list[tuple[int, int, float]] = []
    for column_index, frequency in enumerate(recorded):
        for _ in range(int(random.integers(2, 6))):
            springs.append(
                (
                    column_index,
                    len(positions),
                    draw_log(random, 0.0005, 0.01) * frequency**2,
                )
            )
            positions.append(frequency * (1 + random.uniform(-0.05, 0.05)))
    is_recorded = np.arange(len(positions)) < recorded.size
    return _couple(
        np.array(positions), springs, np.zeros(recorded.size, dtype=int), is_recorded
    )


def _couple(
    positions: Samples,
    springs: Sequence[tuple[int, int, float]],
    owners: NDArray[np.int_],
    is_recorded: NDArray[np.bool_],
) -> Shapes:
    """Connect unit masses, each on its own spring with one of these frequencies, by springs (two places, stiffness).

    ``owners`` are the parts of the recorded springs: those of recorded masses, then, if all are, those between them.
    """
    identity = np.eye(positions.size)
    rows = list(positions[:, np.newaxis] * identity)
    for start, end, stiffness in springs:
        rows.append(np.sqrt(stiffness) * (identity[start] - identity[end]))
    stretches = np.array(rows)
    squares, vectors = np.linalg.eigh(stretches.T @ stretches)
    frequencies = np.sqrt(squares)
    unit = frequencies[0]
    in_modes = (
        vectors / frequencies
    )  # springs of the masses, so that the elastic energy is the sum of q^2
    recorded = (
        stretches if is_recorded.all() else stretches[: positions.size][is_recorded]
    )
    parts = Parts(recorded @ in_modes, in_modes[is_recorded] * unit, owners)
    return Shapes(
        frequencies / unit, in_modes.T * positions, is_recorded.astype(float), parts
    )


# Slow deformations.


def draw_spin(random: np.random.Generator, around: Surroundings) -> Stretch:
    """Draw the deformation of a body that spins up under its load, equal to 0.05 to 3 amplitudes of a mode."""
    until = around.loaded_until

    def course(time: Samples) -> Samples:
        return np.asarray((1 - np.cos(np.pi * np.clip(time / until, 0, 1))) / 2)

    def rate(time: Samples) -> Samples:
        return np.asarray(
            np.where(
                time < until, np.pi / 2 / until * np.sin(np.pi * time / until), 0.0
            )
        )

    heights = (
        draw_log(random, 0.05, 3.0)
        * around.swings
        * random.normal(size=around.swings.size)
    )
    return Stretch(heights, course, rate)


def draw_hinge(random: np.random.Generator, around: Surroundings) -> Stretch:
    """Draw the pull of a part that swings on its hinge like a pendulum, 3 to 20 times more slowly than the modes.

    Its angle has sin(angle / 2) = depth sn(slow t), and it pulls with cos(angle) and the square of its speed.
    """
    slow = 2 * np.pi / around.period / draw_log(random, 3.0, 20.0)
    depth = np.sin(random.uniform(0.3, 2.0) / 2)
    shift = random.uniform(0, 2 * np.pi)

    def course(time: Samples) -> Samples:
        sine, _, _, _ = ellipj(slow * time + shift, depth**2)
        return np.asarray(1 + 4 * depth**2 - 6 * depth**2 * sine**2)

    def rate(time: Samples) -> Samples:
        sine, cosine, delta, _ = ellipj(slow * time + shift, depth**2)
        return np.asarray(-12 * depth**2 * slow * sine * cosine * delta)

    heights = (
        draw_log(random, 0.003, 0.3)
        / (1 + 4 * depth**2)
        * around.swings
        * random.normal(size=around.swings.size)
    )
    return Stretch(heights, course, rate)


few_modes: Final = partial(draw_modes, fewest=1, most_modes=4, highest=3.5)
ten_modes: Final = partial(draw_modes, fewest=10, most_modes=10, highest=8.0)
several_modes: Final = partial(draw_modes, fewest=2, most_modes=5, highest=4.0)

_ALSO_NOISY: Final = {
    "damping by mode": partial(make_linear, shapes=several_modes, damping=damp_each),
    "stiffness damping": partial(
        make_linear, shapes=several_modes, damping=damp_by_stiffness
    ),
    "exchange": partial(make_linear, shapes=draw_exchange),
    "10 modes": partial(make_linear, shapes=ten_modes),
}
LINEAR: Final[dict[str, Make]] = {
    **_ALSO_NOISY,
    **{
        f"{name}, {percent} % noise": partial(make, noise=percent / 100)
        for percent in (1, 2)
        for name, make in _ALSO_NOISY.items()
    },
    "close modes": partial(make_linear, shapes=draw_close),
    "harmonic": partial(make_linear, shapes=draw_harmonic),
    "5 modes": partial(
        make_linear, shapes=partial(draw_modes, fewest=5, most_modes=5, highest=5.0)
    ),
    "30 modes": partial(
        make_linear, shapes=partial(draw_modes, fewest=30, most_modes=30, highest=12.0)
    ),
    "coarse": partial(make_linear, shapes=few_modes, coarse=True),
    "irregular": partial(make_linear, shapes=few_modes, irregular=True),
    "leak": partial(make_linear, shapes=draw_leak),
    "spin": partial(make_linear, shapes=few_modes, stretch=draw_spin),
    "plastic": partial(make_linear, shapes=few_modes, plastic=True),
    "preload vanishes": partial(make_linear, shapes=few_modes, fading=True),
    "hinge": partial(make_linear, shapes=few_modes, stretch=draw_hinge),
}
