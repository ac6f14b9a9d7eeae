"""Pairs graded good or fair under lasting loads, compared with the momentum that the loads really change.

``python -m tests.benchmarks.loads [RECORDS [SEED]]``: chains of three masses and two springs move in a plane and
vibrate under a load of one kind.  Each run is written as four files with the digits of their formats: totals in a
table, momenta of the model in a table, a glstat and a matsum.
"""

from __future__ import annotations

import sys
from collections import Counter
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from d2rpick.base.errors import D2RPickError
from d2rpick.choice.answers import suggest_in_run
from d2rpick.choice.question import Settings, read_reference
from d2rpick.choice.td.flights import find_flights
from tests.benchmarks.chains import (
    Chains,
    Run,
    apply_half_sine,
    apply_to_first,
    draw_directions,
    integrate_chains,
)
from tests.written_runs import WRITERS

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from d2rpick.choice.question import Reference
    from d2rpick.histories.history import Samples

    Motion = Callable[[float, Samples, Samples, Samples], Samples]

STATES, STEPS = 500, 16
# Stiffness of a second spring and mass of a third mass in a chain of two.
_NO_MASS: Final = 1e-6
# A pair is wrong if more than this fraction of the largest momentum changes.
WRONG: Final = 0.01
# A flight is missed if less of the momentum changes for this fraction of the record, but no flight is shown.
STEADY, LONG = 0.001, 0.15
# Given values of td in addition to the chosen one, as fractions of the record.
ASKED: Final = (0.4, 0.85)
GRAVITY: Final = 9.81
# Gravity of the Moon, Mars, Venus and Jupiter, and of a centrifuge.
OTHER_GRAVITIES: Final = (1.62, 3.71, 8.87, 24.8, 49.05)


class LastingLoad(NamedTuple):
    """Forces on ``count`` chains: ``force`` (n, 3, 2) of time, masses (n, 3), positions and velocities (n, 3, 2).

    If ``falling``, half of the chains fall on earth.
    """

    force: Motion
    falling: bool = True


def friction(random: np.random.Generator, count: int) -> LastingLoad:
    """Draw dry friction of the ground, a constant deceleration of all masses or of the first."""
    size = 10 ** random.uniform(-1, 1.3, (count, 1, 1))
    only_first = random.random((count, 1)) < 1 / 3

    def force(_: float, masses: Samples, __: Samples, velocity: Samples) -> Samples:
        whole = masses.sum(axis=1, keepdims=True)
        carried = np.where(only_first, whole * (np.arange(3) == 0), masses)[
            ..., np.newaxis
        ]
        speed = np.linalg.norm(velocity, axis=2, keepdims=True)
        return np.asarray(-size * carried * velocity / np.maximum(speed, 0.01))

    return LastingLoad(force, falling=False)


def drag(random: np.random.Generator, count: int) -> LastingLoad:
    """Draw drag by the square of the speed, on one or two masses."""
    size, on_first = (
        10 ** random.uniform(-2.5, 0, (count, 1, 1)),
        random.uniform(0.5, 2.0, (count, 1, 1)).clip(max=1),
    )
    shares = np.concatenate([on_first, 1 - on_first, 0 * on_first], axis=1)

    def force(_: float, masses: Samples, __: Samples, velocity: Samples) -> Samples:
        whole = masses.sum(axis=1)[:, np.newaxis, np.newaxis]
        speed = np.linalg.norm(velocity, axis=2, keepdims=True)
        return np.asarray(-size * whole * shares / 5 * speed * velocity)

    return LastingLoad(force)


def late_contact(random: np.random.Generator, count: int) -> LastingLoad:
    """Draw a light contact of the first mass late in the record."""
    start, length = (
        random.uniform(0.4, 0.85, count),
        10 ** random.uniform(-2, -0.7, count),
    )
    size, along = 10 ** random.uniform(-1.5, 1, count), draw_directions(random, count)

    def force(time: float, masses: Samples, _: Samples, __: Samples) -> Samples:
        pushed = (size * masses.sum(axis=1) * apply_half_sine(time, start, length))[
            :, np.newaxis
        ] * along
        return apply_to_first(pushed)

    return LastingLoad(force)


def airbag(random: np.random.Generator, count: int) -> LastingLoad:
    """Draw a pressure that rises at once and leaks away."""
    start, lasts = random.uniform(0.3, 0.8, count), random.uniform(0.03, 0.3, count)
    size, along = 10 ** random.uniform(-0.5, 1.5, count), draw_directions(random, count)

    def force(time: float, masses: Samples, _: Samples, __: Samples) -> Samples:
        since = np.maximum(time - start, 0) / lasts
        pressure = np.where(time > start, since * np.exp(1 - 4 * since), 0.0)
        return apply_to_first(
            (size * masses.sum(axis=1) * pressure)[:, np.newaxis] * along
        )

    return LastingLoad(force)


def rope(random: np.random.Generator, count: int) -> LastingLoad:
    """Draw a rope to the ground that is slack up to its length."""
    length, pull = (
        random.uniform(0.3, 3, (count, 1)),
        10 ** random.uniform(1, 4, (count, 1)),
    )

    def force(_: float, __: Samples, positions: Samples, ___: Samples) -> Samples:
        distance = np.linalg.norm(positions[:, 0], axis=1, keepdims=True)
        stretched = np.maximum(distance - length, 0)
        return apply_to_first(
            -pull * stretched * positions[:, 0] / np.maximum(distance, 1e-9)
        )

    return LastingLoad(force)


def couple(random: np.random.Generator, count: int) -> LastingLoad:
    """Draw two opposite forces on two masses, which change no momentum."""
    start, length = random.uniform(0.2, 0.6, count), random.uniform(0.05, 0.4, count)
    size, along = 10 ** random.uniform(-1, 1, count), draw_directions(random, count)

    def force(time: float, masses: Samples, _: Samples, __: Samples) -> Samples:
        pushed = (size * masses.sum(axis=1) * apply_half_sine(time, start, length))[
            :, np.newaxis
        ] * along
        return np.stack([pushed, -pushed, np.zeros_like(pushed)], axis=1)

    return LastingLoad(force)


def other_gravity(random: np.random.Generator, count: int) -> LastingLoad:
    """Draw the gravity of another planet, which no file distinguishes from a load without a deck."""
    size = random.choice(OTHER_GRAVITIES, count)[:, np.newaxis, np.newaxis]

    def force(_: float, masses: Samples, positions: Samples, __: Samples) -> Samples:
        return np.asarray(
            masses[..., np.newaxis]
            * size
            * np.array([0.0, -1.0])
            * np.ones_like(positions)
        )

    return LastingLoad(force, falling=False)


CLASSES: Final = {
    one.__name__: one
    for one in (friction, drag, late_contact, airbag, rope, couple, other_gravity)
}


def compute_runs(
    random: np.random.Generator, count: int, load: LastingLoad
) -> Iterator[Run]:
    """Integrate ``count`` chains that are pushed and then fly, except for their load.

    Every other chain has a single spring and moves along x: one oscillator describes its energy.
    """
    masses = random.uniform(5, 50, (count, 3))
    stiffness = (
        masses.mean(axis=1)[:, np.newaxis] * random.uniform(30, 150, (count, 2)) ** 2
    )
    masses[::2, 2], stiffness[::2, 1] = _NO_MASS, 0.0
    damping = stiffness * random.choice([0.0, 2e-5, 2e-4], (count, 1))
    falls = (random.integers(0, 2, count) * load.falling)[:, np.newaxis, np.newaxis]
    heavy = masses[..., np.newaxis] * np.array([0.0, -GRAVITY]) * falls
    speed = draw_directions(random, count) * random.uniform(1, 12, (count, 1))
    positions = random.normal(size=(count, 3, 2)) * random.uniform(
        1e-3, 2e-2, (count, 1, 1)
    )
    positions[::2, :, 1] = 0
    velocities, never = np.repeat(speed[:, np.newaxis], 3, axis=1), np.zeros(count)
    chains = Chains(
        masses, stiffness, damping, 0 * stiffness, never, positions, velocities
    )
    whole, lasts = masses.sum(axis=1), random.uniform(0.02, 0.1, count)
    pushed = (
        draw_directions(random, count)
        * (whole * random.uniform(5, 50, count))[:, np.newaxis]
    )

    def force(time: float, moved: Samples, velocity: Samples) -> Samples:
        push = apply_to_first(
            pushed * apply_half_sine(time, 0 * lasts, lasts)[:, np.newaxis]
        )
        return load.force(time, masses, moved, velocity) + push

    yield from integrate_chains(chains, force, lambda *_: heavy, 1.0, STATES, STEPS)


def measure_change(impulse: Samples, time: Samples, start: float, end: float) -> float:
    """Return the largest change of an impulse (n, 2) from ``start`` to ``end``."""
    inside = impulse[(time >= start) & (time <= end)]
    return float(np.linalg.norm(inside - inside[:1], axis=1).max(initial=0.0))


def count_pairs(reference: Reference, run: Run) -> Counter[str]:
    """Count pairs not graded poor, wrong ones among them, true flights, and flights that no source shows."""
    counts: Counter[str] = Counter()
    time, impulse = run.written.time, run.impulse
    largest = float(np.linalg.norm(run.written.momentum.sum(axis=1), axis=1).max())
    for td in (None, *ASKED):
        try:
            answer = suggest_in_run(reference, td, Settings(), with_better=False)
        except D2RPickError:
            continue
        pair = answer.recommended
        if pair is None or answer.quality is None or answer.quality.grade == "poor":
            continue
        counts["pairs"] += 1
        counts["wrong"] += (
            measure_change(impulse, time, pair.tr, pair.td) > WRONG * largest
        )
    true = list(_find_true_flights(impulse, time, STEADY * largest))
    try:
        shown_flights = [
            flight_found.within(time)
            for flight_found in find_flights(reference.history, Settings(replay=False))
        ]
    except D2RPickError:
        shown_flights = []
    counts["flights"] += len(true)
    counts["missed"] += sum(
        not any(start < b and a < end for start, end in shown_flights) for a, b in true
    )
    return counts


def _find_true_flights(
    impulse: Samples, time: Samples, room: float
) -> Iterator[tuple[float, float]]:
    """Yield, one after the other, the longest periods in which an impulse changes by at most ``room``."""
    first = 0
    while first < time.size - 1:
        last = first
        low = high = impulse[first]
        while last < time.size - 1:
            low, high = (
                np.minimum(low, impulse[last + 1]),
                np.maximum(high, impulse[last + 1]),
            )
            if np.linalg.norm(high - low) > room:
                break
            last += 1
        if time[last] - time[first] >= LONG:
            yield float(time[first]), float(time[last])
            first = last
        first += 1


def main(count: int = 60, seed: int = 48) -> None:
    """Print the counts for each load and form."""
    names = ("pairs", "wrong", "flights", "missed")
    print(f"{'load':15s}{'form':10s}" + "".join(f"{name:>9s}" for name in names))
    with TemporaryDirectory() as folder:
        for number, (name, load) in enumerate(CLASSES.items()):
            random = np.random.default_rng((seed, number))
            runs = list(compute_runs(random, count, load(random, count)))
            for form, write in WRITERS.items():
                total: Counter[str] = Counter()
                for run in runs:
                    total += count_pairs(
                        read_reference([write(run.written, Path(folder))]), run
                    )
                print(
                    f"{name:15s}{form:10s}"
                    + "".join(f"{total[load_name]:9d}" for load_name in names),
                    flush=True,
                )


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
