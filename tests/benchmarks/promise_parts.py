"""How reliable a good grade of several parts is: random records compared with the exact motion of their modes.

python -m tests.benchmarks.promise_parts [N [SEED]]

The motion is computed here from its modes, independently of d2rpick.  The classes are: springs with one mode each; two
parts of a larger structure, or a free chain of masses whose springs or groups of springs are the parts, so that modes
mix in each part; and a part that bends in two planes next to another part.  Damping is proportional to mass.

Two further classes have records from which the true residual cannot be found: two parts of a larger structure, whose
other parts are missing, and two parts with nearly equal frequencies.
"""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from d2rpick.choice.answers import suggest_in_history
from d2rpick.choice.question import Settings
from d2rpick.histories.history import History
from tests.benchmarks.promise import Pair, Trial, run_benchmark
from tests.energies import suggest_in_window

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from d2rpick.histories.history import Samples


class Motion(NamedTuple):
    """Vibration of m modes, ``exp(-alpha t/2) cos(rate t + phase)``. The energy of a part is ``x' form x``.

    ``rate`` and ``phase`` have shape (m,); ``forms`` (k, m, m) are the stiffnesses of k parts in the modes.
    """

    alpha: float
    rate: Samples
    phase: Samples
    forms: Samples

    def state(self, time: Samples | float) -> tuple[Samples, Samples]:
        """Return coordinates, and velocities over the undamped rates, in the shape of ``time`` with an axis for m."""
        angle, half = np.multiply.outer(time, self.rate) + self.phase, self.alpha / 2
        decay = np.exp(-half * np.asarray(time))[..., np.newaxis]
        own_rate = np.hypot(self.rate, half)
        return decay * np.cos(angle), -decay * (
            self.rate * np.sin(angle) + half * np.cos(angle)
        ) / own_rate

    def energies(self, time: Samples) -> Samples:
        """Return the energies of the parts, shape (n, k)."""
        state_at_times = self.state(time)[0]
        return np.asarray(
            np.einsum("ni,kij,nj->nk", state_at_times, self.forms, state_at_times)
        )

    def residual(self, tr: float, td: float) -> float:
        """Return the energy norm of the missing motion at td over that of the reference, summed over the modes.

        For parts of a larger structure it is the mean over time after td, because their energy is no sum at any one
        time.
        """
        (state_at_tr, _), (state_at_td, velocity) = self.state(tr), self.state(td)
        stiffness = np.einsum("kii->i", self.forms)
        lack, whole = (
            (state_at_tr - state_at_td) ** 2 + velocity**2,
            state_at_td**2 + velocity**2,
        )
        return float(np.sqrt(stiffness @ lack / (stiffness @ whole)))


class PartsRecord(NamedTuple):
    """History, settings, td range (of width 0 for one td), and the true motion."""

    history: History
    settings: Settings
    window: tuple[float, float]
    residual: Callable[[float, float], float]


def draw_one_mode_each(rng: np.random.Generator) -> Motion:
    """Draw two or three parts with one mode each."""
    count = int(rng.integers(2, 4))
    return _draw_planes(
        rng, [(i, energy) for i, energy in enumerate(rng.uniform(0.1, 1, count))]
    )


def draw_mixed_modes(rng: np.random.Generator) -> Motion:
    """Draw two parts of a larger structure, or a free chain of three to six masses whose springs are the parts.

    In a third of the chains several springs are one part.
    """
    if rng.uniform() < 1 / 3:
        return draw_parts_of_structure(rng)
    count = int(rng.integers(2, 6))
    mass, spring = rng.uniform(0.3, 3, count + 1), rng.uniform(0.3, 3, count)
    stretch = np.diff(np.eye(count + 1), axis=0) / np.sqrt(mass)
    square, shapes = np.linalg.eigh(stretch.T @ (spring[:, np.newaxis] * stretch))
    own_rates = np.sqrt(square[1:]) * 2 * np.pi / np.sqrt(square[1])
    amplitude = rng.uniform(0.2, 1, count) / own_rates
    rows = stretch @ shapes[:, 1:] * amplitude * np.sqrt(spring)[:, np.newaxis]
    forms = np.einsum("si,sj->sij", rows, rows)
    if rng.uniform() < 1 / 3:
        forms = np.stack([forms[:-1].sum(axis=0), forms[-1]])
    alpha = rng.uniform(0, 0.5)
    return Motion(
        alpha,
        np.sqrt(own_rates**2 - alpha**2 / 4),
        rng.uniform(0, 2 * np.pi, count),
        forms,
    )


def draw_parts_of_structure(rng: np.random.Generator) -> Motion:
    """Draw two parts of a larger structure, whose two or three modes also deform parts without energies."""
    modes = int(rng.integers(2, 4))
    rows, rate = (
        rng.uniform(-1, 1, (2, modes)),
        2 * np.pi * rng.uniform(1, 3.5, modes),
    )
    forms = np.einsum("pi,pj->pij", rows, rows)
    return Motion(rng.uniform(0, 0.5), rate, rng.uniform(0, 2 * np.pi, modes), forms)


def draw_nearly_equal(rng: np.random.Generator) -> Motion:
    """Draw two parts with one mode each, whose frequencies differ by 0.2 %."""
    motion = _draw_planes(rng, [*enumerate(rng.uniform(0.1, 1, 2))])
    return motion._replace(rate=motion.rate[0] * np.array([1.0, 1.002]))


def draw_two_planes(rng: np.random.Generator) -> Motion:
    """Draw a part whose second plane has 0.3 to 50 % of its energy, next to a part with one mode or two planes."""
    modes = [
        (0, 1 - (share := 10 ** rng.uniform(-2.5, -0.3))),
        (0, share),
        (1, rng.uniform(0.1, 1)),
    ]
    second = (
        [(1, modes[-1][1] * 10 ** rng.uniform(-2.5, -0.3))]
        if rng.uniform() < 0.3
        else []
    )
    return _draw_planes(rng, [*modes, *second])


def _draw_planes(rng: np.random.Generator, modes: list[tuple[int, float]]) -> Motion:
    """Draw modes, each with an energy and the number of the part to which it belongs."""
    part, energy = (np.array(column) for column in zip(*modes, strict=True))
    rate = 2 * np.pi * rng.uniform(1, 3.5, len(modes))
    forms = np.array(
        [
            np.diag(np.where(part == plane_part, energy, 0.0))
            for plane_part in range(part.max() + 1)
        ]
    )
    return Motion(
        rng.uniform(0, 0.5), rate, rng.uniform(0, 2 * np.pi, len(modes)), forms
    )


CLASSES: Final = {
    "parts with one mode each": draw_one_mode_each,
    "parts with mixed modes": draw_mixed_modes,
    "two planes": draw_two_planes,
}
# Records from which the true residual cannot be found.
EXCEPTIONS: Final = {
    "two parts of a larger structure": draw_parts_of_structure,
    "nearly equal frequencies": draw_nearly_equal,
}
_ALL_CLASSES: Final = {**CLASSES, **EXCEPTIONS}


def draw_records(kind: str, seed: int, number: int) -> Iterator[PartsRecord]:
    """Yield random records of a class: 4 to 14 slow periods, 20 to 150 states per fast period, some with noise."""
    for record_number in range(number):
        rng = np.random.default_rng(
            [seed, list(_ALL_CLASSES).index(kind), record_number]
        )
        motion = _ALL_CLASSES[kind](rng)
        last, states = rng.uniform(4, 14), np.exp(rng.uniform(np.log(20), np.log(150)))
        time = np.arange(0, last, 2 * np.pi / motion.rate.max() / states)
        energies = motion.energies(time)
        spread = rng.choice([0.0, 0.0, 10 ** rng.uniform(-4, -2.3)])
        energies = np.maximum(
            energies + spread * energies.max() * rng.standard_normal(energies.shape),
            0.0,
        )
        digits = int(rng.choice([5, 8, 15]))
        energies = np.array(
            [float(f"{value:.{digits}g}") for value in energies.ravel()]
        ).reshape(energies.shape)
        first = float(time[-1] * rng.uniform(0.4, 0.9))
        last = float(time[-1] * 0.95) if rng.uniform() < 0.5 else first
        yield PartsRecord(
            make_history_of_parts(time, energies),
            Settings(after=0.0),
            (first, last),
            motion.residual,
        )


def make_history_of_parts(time: Samples, energies: Samples) -> History:
    """Return the history of the sum of the energies of parts, shape (n, k), as a reader gives it."""
    return History(
        time, energies.sum(axis=1), source=("made",), format="csv", channel="sum"
    )


def recommend_pair(record: PartsRecord) -> Pair | None:
    """Ask for a pair; return None if none is recommended."""
    first, last = record.window
    ask = (
        partial(suggest_in_history, td=first)
        if first == last
        else partial(suggest_in_window, window=record.window)
    )
    answer = ask(record.history, settings=record.settings)
    best, quality = answer.chosen, answer.quality
    if best is None or quality is None:
        return None
    true = record.residual(best.tr, answer.situation.td)
    return Pair(
        best.tr,
        answer.situation.td,
        true,
        best.residual,
        getattr(best, "residual_low", best.residual),
        best.residual_high,
        quality.grade,
        answer.situation.basis,
    )


def try_class(kind: str, count: int, seed: int) -> list[Trial]:
    """Try this number of records of a class, without an oracle."""
    return [Trial(recommend_pair(record)) for record in draw_records(kind, seed, count)]


if __name__ == "__main__":
    run_benchmark(_ALL_CLASSES, try_class, "What a good grade is worth on parts.")
