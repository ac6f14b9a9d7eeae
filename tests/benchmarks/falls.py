"""Flights found for falling bodies with damped vibration, in all formats, with and without kinetic energy.

``python -m tests.benchmarks.falls [RUNS [SEED]]``: supported chains are pushed, then fall freely under gravity while
dampers and yielding springs dissipate their vibration, and land.  Half of the chains also yield in flight.  Each run is
written as a table, a glstat, a binout and a T01, with and without kinetic energy.  A flight is correct if it begins
within two states of the true one.
"""

from __future__ import annotations

import sys
from collections import Counter
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from d2rpick.base.errors import D2RPickError
from d2rpick.choice.pair.situation import examine_td
from d2rpick.choice.question import Settings, read_reference
from tests.benchmarks.chains import Chains, apply_to_first, integrate_chains
from tests.written_runs import FALL_WRITERS, Written

if TYPE_CHECKING:
    from collections.abc import Iterator

    from d2rpick.histories.history import Samples

STEPS, GRAVITY = 24, 9.81
# A flight is correct if it begins within this number of states of the true one.
WITHIN: Final = 2


class Fall(NamedTuple):
    """Run that is supported until ``start`` and lands at ``end`` [time]."""

    run: Written
    start: float
    end: float


def integrate_falls(
    random: np.random.Generator, count: int, states: int
) -> Iterator[Fall]:
    """Integrate ``count`` falls of this number of states, all of the same record length."""
    length = 10 ** random.uniform(-0.8, 0.2)
    masses = random.uniform(5, 50, (count, 3))
    periods = 10 ** random.uniform(-1.6, -0.9, (count, 2)) * length
    stiffness = masses.mean(axis=1)[:, np.newaxis] * (2 * np.pi / periods) ** 2
    damping = stiffness * periods / np.pi * 10 ** random.uniform(-3, -1, (count, 1))
    whole = masses.sum(axis=1)
    pushed = whole * random.uniform(0.5, 4, count) / length
    strength = (
        pushed[:, np.newaxis] * random.choice([0.4, 0.7, 100], (count, 1)) * np.ones(2)
    )
    starts, ends = (
        random.uniform(0.1, 0.3, count) * length,
        random.uniform(0.7, 0.95, count) * length,
    )
    starts = (
        np.round(starts * states / length) / states * length
    )  # a load ends at a state, because no state may contain half of it
    yields_until = np.where(random.random(count) < 0.5, starts, ends)
    still = np.zeros((count, 3, 2))
    heavy = masses[..., np.newaxis] * np.array([0.0, -GRAVITY])
    ground = whole * (2 * np.pi / (0.2 * length)) ** 2

    def force(time: float, positions: Samples, _: Samples) -> Samples:
        push = np.stack([np.where(time < starts, pushed, 0.0), np.zeros(count)], axis=1)
        fallen_since = GRAVITY / 2 * ((time - starts) ** 2 - (ends - starts) ** 2)
        pressed = np.where(time > ends, ground * np.maximum(fallen_since, 0) / 10, 0.0)
        landing = np.stack([np.zeros(count), pressed], axis=1)
        carried = np.where((time < starts)[:, np.newaxis, np.newaxis], -heavy, 0.0)
        return apply_to_first(push + landing) + carried + 0 * positions

    chains = Chains(masses, stiffness, damping, strength, yields_until, still, still)
    runs = integrate_chains(chains, force, lambda *_: heavy, length, states, STEPS)
    for run, start, end in zip(runs, starts.tolist(), ends.tolist(), strict=True):
        yield Fall(run.written, start, end)


def find_flight_start(path: str, td: float) -> float | None:
    """Return the start of the flight around td found in a file; None if there is no flight."""
    try:
        flight = examine_td(
            read_reference([path]).history, td, Settings(replay=False)
        ).flight
    except D2RPickError:
        return None
    return None if flight.refusal else flight.start


def main(count: int = 100, seed: int = 48) -> None:
    """Print the counts for each format."""
    right_counts: Counter[str] = Counter()
    shorter: Counter[str] = Counter()
    total: Counter[str] = Counter()
    random = np.random.default_rng(seed)
    with TemporaryDirectory() as folder:
        batch = 20
        for number in range(count // batch):
            states = int(random.choice([120, 300, 600]))
            for fall_number, fall in enumerate(integrate_falls(random, batch, states)):
                td, state = (fall.start + fall.end) / 2, float(fall.run.time[1])
                for form, write in FALL_WRITERS.items():
                    starts = [
                        find_flight_start(
                            write(fall.run, Path(folder), kinetic=has), td
                        )
                        for has in (True, False)
                    ]
                    for has, start in zip(("with", "without"), starts, strict=True):
                        good = (
                            start is not None
                            and abs(start - fall.start) <= (WITHIN + 0.01) * state
                        )
                        total[f"{form} {has}"] += 1
                        right_counts[f"{form} {has}"] += good
                        if not good:
                            print(
                                f"{form} {has} kinetic: {number}/{fall_number} {start} for {fall.start}",
                                flush=True,
                            )
                    with_, without = starts
                    if without is not None and (
                        with_ is None or with_ > without + 0.01 * state
                    ):
                        print(
                            f"{form} is shorter with kinetic energy: {number}/{fall_number} {with_} for {without}",
                            flush=True,
                        )
                        shorter[form] += 1
    for name, size in total.items():
        print(f"{name:20s}{size:6d} falls{right_counts[name]:6d} right")
    for form in FALL_WRITERS:
        print(f"{form:20s}{shorter[form]:6d} shorter with kinetic energy")


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
