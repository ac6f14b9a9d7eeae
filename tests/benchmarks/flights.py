"""Flights claimed and missed under random loads, compared with the force that truly acts.

``python -m tests.benchmarks.flights [RECORDS [SEED]]``: chains of three masses and two springs fly in a plane, half of
them under gravity, while a random load acts on the first mass.  Each record is written with seven digits, as momenta of
the parts, as totals with the momentum of the whole, and as totals alone.
"""

from __future__ import annotations

import sys
from collections import Counter
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from d2rpick.choice.question import Settings
from d2rpick.choice.td.flights import find_flights
from d2rpick.histories.history import Balance, Given, History, Momenta, Precision
from d2rpick.histories.names import Part
from tests.records import round_as_printed

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from d2rpick.histories.history import Samples

    Force = Callable[
        [float, Samples, Samples], Samples
    ]  # a function of time, positions and velocities of the first masses, (n, 2)

STATES, STEPS, DIGITS, GRAVITY = 1000, 8, 7, 9.81
# The chain flies if the force without gravity is below this fraction of its peak. A claim is wrong if more than this
# fraction of the largest momentum still changes. A missed flight lasts for at least 10 % of the record.
LITTLE, LONG = 0.01, 0.1
FORMS: Final = ("parts", "momenta", "totals")
PARTS: Final = tuple(Part(number, f"mass {number}") for number in (1, 2, 3))

TIME: Final = np.linspace(0, 1, STATES + 1)


class Flown(NamedTuple):
    """One record: times (states,), momenta (states, 3, 2), energies, and the ``force`` except gravity, (states, 2)."""

    momentum: Samples
    kinetic: Samples
    internal: Samples
    force: Samples
    masses: Samples


def compute_runs(
    random: np.random.Generator, count: int, force: Force, *, falling: bool
) -> Iterator[Flown]:
    """Integrate ``count`` chains at the same time."""
    masses, stiffness = (
        random.uniform(5, 50, (count, 3, 1)),
        random.uniform(5e4, 2e5, (count, 2, 1)),
    )
    damping = random.choice([0.0, 20.0], (count, 1, 1))
    weight = (
        masses
        * np.array([0.0, -GRAVITY])
        * random.integers(0, 2, (count, 1, 1))
        * falling
    )
    dt = 1 / (STATES * STEPS)
    moved = np.zeros((count, 3, 2))
    velocity = np.repeat(
        random.normal(size=(count, 1, 2)) * random.uniform(0.5, 10, (count, 1, 1)),
        3,
        axis=1,
    )
    rows = []
    for step in range(STATES * STEPS + 1):
        outer, stretch = (
            force(step * dt, moved[:, 0], velocity[:, 0]),
            np.diff(moved, axis=1),
        )
        if step % STEPS == 0:
            kinetic, internal = (
                (masses * velocity**2).sum((1, 2)) / 2,
                (stiffness * stretch**2).sum((1, 2)) / 2,
            )
            rows.append((masses * velocity, kinetic, internal, outer))
        pull = np.pad(
            stiffness * stretch + damping * np.diff(velocity, axis=1),
            ((0, 0), (1, 1), (0, 0)),
        )
        total = np.diff(pull, axis=1) + weight
        total[:, 0] += outer
        velocity = velocity + dt * total / masses
        moved = moved + dt * velocity
    columns = [np.stack(column, axis=1) for column in zip(*rows, strict=True)]
    yield from (
        Flown(*record) for record in zip(*columns, masses[:, :, 0], strict=True)
    )


def fading(random: np.random.Generator, count: int) -> Force:
    """Draw a push that fades exponentially, by a power of time, or as a half-sine."""
    kind, lasts = random.integers(0, 3, count), random.uniform(0.02, 0.3, count)
    power, vectors = random.uniform(1.5, 6, count), pushes(random, count)

    def force(t: float, *_: Samples) -> Samples:
        shapes = (
            np.exp(-3 * t / lasts),
            (1 + t / lasts) ** -power,
            np.sin(np.pi * np.minimum(t / lasts, 1)),
        )
        return np.asarray(np.choose(kind, shapes)[:, np.newaxis] * vectors)

    return force


def repeated(random: np.random.Generator, count: int) -> Force:
    """Draw two to five half-sine pushes."""
    starts, lengths = (
        random.uniform(0, 0.9, (5, count)),
        random.uniform(0.01, 0.08, (5, count)),
    )
    vectors = np.stack([pushes(random, count) for _ in range(5)])
    vectors[random.integers(2, 6, count) <= np.arange(5)[:, np.newaxis]] = 0

    def force(t: float, *_: Samples) -> Samples:
        inside = (t >= starts) & (t <= starts + lengths)
        return np.asarray(
            (
                (np.sin(np.pi * (t - starts) / lengths) * inside)[..., np.newaxis]
                * vectors
            ).sum(axis=0)
        )

    return force


def wall(random: np.random.Generator, count: int) -> Force:
    """Draw a fixed elastic wall; its stored energy is not written."""
    wall_position, stiffness = (
        random.uniform(0.02, 1.0, count),
        10 ** random.uniform(4, 6.5, count),
    )

    def force(_: float, moved: Samples, __: Samples) -> Samples:
        size = -stiffness * np.maximum(
            moved[:, 0] - wall_position, 0
        ) + stiffness * np.maximum(-moved[:, 0] - wall_position, 0)
        return np.column_stack([size, np.zeros(count)])

    return force


def friction(random: np.random.Generator, count: int) -> Force:
    """Draw friction of the ground that carries the chain until the chain stands still."""
    pull = random.uniform(10, 3000, (count, 1))
    return lambda _, __, velocity: np.asarray(-pull * np.tanh(velocity / 0.01))


def pushes(random: np.random.Generator, count: int) -> Samples:
    """Draw random forces, (n, 2)."""
    return np.asarray(
        random.normal(size=(count, 2)) * 10 ** random.uniform(3, 5, (count, 1))
    )


CLASSES: Final = {
    "fading": fading,
    "repeated": repeated,
    "wall": wall,
    "friction": friction,
}


def make_history(run: Flown, form: str) -> History:
    """Write a run in one of the `FORMS`."""
    precision = Precision(DIGITS)
    kinetic, internal = (
        round_as_printed(run.kinetic, DIGITS),
        round_as_printed(run.internal, DIGITS),
    )
    momenta: tuple[Momenta, ...] = ()
    if form != "totals":
        values = (
            run.momentum if form == "parts" else run.momentum.sum(axis=1, keepdims=True)
        )
        values = np.concatenate([values, np.zeros((*values.shape[:2], 1))], axis=2)
        values = round_as_printed(values.ravel(), DIGITS).reshape(values.shape)
        masses = run.masses if form == "parts" else run.masses.sum(keepdims=True)
        history_parts, chosen = (PARTS, (0, 1, 2)) if form == "parts" else (None, (0,))
        momenta = (
            Momenta(TIME, values, history_parts, precision, chosen, masses=masses),
        )
    velocity = momenta[0].values[:, 0] if form == "momenta" else None
    balance = Balance(TIME, internal, kinetic, velocity=velocity, precision=precision)
    return History(
        TIME,
        internal,
        ("made",),
        "made",
        "E",
        energy_precision=precision,
        evidence=Given(momenta, balance),
    )


def count_flights(run: Flown, form: str) -> Counter[str]:
    """Count claimed flights not graded poor, wrong ones among these, true flights, and missed flights."""
    claimed_flights = find_flights(make_history(run, form), Settings(replay=False))
    claims = [
        (f.start or 0.0, TIME[-1] if f.end is None else f.end) for f in claimed_flights
    ]
    believed = [
        claim
        for claim, flight in zip(claims, claimed_flights, strict=True)
        if not flight.unknown_load
    ]
    impulse = np.concatenate(
        [
            np.zeros((1, 2)),
            np.cumsum((run.force[1:] + run.force[:-1]) / 2, axis=0) / STATES,
        ]
    )
    largest = np.linalg.norm(run.momentum.sum(axis=1), axis=1).max()
    impulses = [impulse[(start <= TIME) & (end >= TIME)] for start, end in believed]
    wrong_count = sum(
        bool(
            np.linalg.norm(impulse_in_claim - impulse_in_claim[0], axis=1).max()
            > LITTLE * largest
        )
        for impulse_in_claim in impulses
    )
    size = np.linalg.norm(run.force, axis=1)
    edges = np.flatnonzero(
        np.diff(np.pad(size <= LITTLE * size.max(), 1).astype(int))
    ).reshape(-1, 2)
    flights = [
        (a / STATES, (b - 1) / STATES)
        for a, b in edges.tolist()
        if b - a > LONG * STATES
    ]
    flights = [
        flight
        for flight in flights
        if _measure_steady_time(impulse, flight, LITTLE * largest) > LONG
    ]
    missed = sum(
        not any(start < b and a < end for start, end in claims) for a, b in flights
    )
    return Counter(
        claimed=len(believed), wrong=wrong_count, flights=len(flights), missed=missed
    )


def _measure_steady_time(
    impulse: Samples, flight: tuple[float, float], limit: float
) -> float:
    """Return how long the force changes the momentum by at most ``limit`` at the end of a flight."""
    first, last = (round(time * STATES) for time in flight)
    momentum_change = np.linalg.norm(impulse[first : last + 1] - impulse[last], axis=1)
    return float(np.count_nonzero(momentum_change <= limit)) / STATES


def main(count: int = 300, seed: int = 27) -> None:
    """Print the counts for each load and form."""
    names = ("claimed", "wrong", "flights", "missed")
    print(f"{'load':10s}{'form':10s}" + "".join(f"{name:>9s}" for name in names))
    for number, (name, load) in enumerate(CLASSES.items()):
        random = np.random.default_rng((seed, number))
        runs = list(
            compute_runs(random, count, load(random, count), falling=name != "friction")
        )
        for form in FORMS:
            total = sum((count_flights(run, form) for run in runs), Counter[str]())
            print(
                f"{name:10s}{form:10s}"
                + "".join(f"{total[form_name]:9d}" for form_name in names)
            )


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
