"""Cost of an identification over a scipy least_squares fit that starts at the truth, and the accuracy of residuals.

The accuracy is measured on random records: 3 to 12 periods of a mode, 15 to 200 states per period, noise up to 3 %, and
no other mode, one with 0.3 to 3 % of the energy, or one with 3 to 30 %.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy.optimize import least_squares

from d2rpick.choice.answers import suggest_in_history
from d2rpick.choice.question import Settings
from d2rpick.histories.history import History
from d2rpick.vibration.identify import identify
from d2rpick.vibration.modes import Mode
from tests.benchmarks.timing import measure_ratio
from tests.records import (
    ENERGY,
    MODE,
    TIME,
    compute_replayed_residual,
    find_level_crossings,
    make_mode,
    round_as_printed,
    sum_energies,
)

if TYPE_CHECKING:
    from collections.abc import Iterable

    from d2rpick.histories.history import Samples

_TRUTH = np.array([MODE.omega, MODE.alpha, MODE.cosine, MODE.sine])
_ROUNDS = 51
# Energy fraction of the second mode, from the first value times ten to the power of 0 to 1.
_SHARES = {"one": 0.0, "small": 0.003, "large": 0.03}
# A crossing this close to a true crossing [periods] is treated as that crossing.
_NEAR = 1 / 8


def to_scipy() -> float:
    """Return the time of an identification over that of a scipy fit, as medians of interleaved runs, for 6 digits."""
    energy = round_as_printed(ENERGY)

    def residuals(parameters: Samples) -> Samples:
        return make_mode(parameters).energy(TIME) - energy

    def scipy_fit() -> float:
        return float(least_squares(residuals, _TRUTH).x[0])

    def ours() -> float:
        mode = identify(TIME, energy).mode
        assert mode is not None
        return mode.omega

    assert abs(ours() / scipy_fit() - 1) < 1e-7
    return measure_ratio(ours, scipy_fit, _ROUNDS)


def residual_error(kind: str, count: int) -> float:
    """Return the error of the stated residual that 95 % of this number of random records do not exceed [-]."""
    return summarize_records(small_second_modes(kind, range(count)))[0]


class Stated(NamedTuple):
    """Stated residual of a recommended pair, its upper limit, and the true residual [-].

    ``held`` is True if tr_low..tr_high contains the true crossing; None if the record hardly shows a crossing.
    """

    stated: float
    highest: float
    true: float
    held: bool | None


def small_second_modes(kind: str, seeds: Iterable[int]) -> list[Stated]:
    """Return the results for seeded random records of one kind that have a recommended pair."""
    return [
        stated_records
        for seed in seeds
        if (
            stated_records := _state_residual(
                np.random.default_rng(seed), _SHARES[kind]
            )
        )
    ]


def summarize_records(records: list[Stated]) -> tuple[float, float, float]:
    """Return 95th percentiles of the errors of residuals and of their ranges, and the fraction of right intervals."""
    deviations = [abs(record.stated - record.true) for record in records]
    beyond = [
        max(record.stated - record.true, record.true - record.highest, 0.0)
        for record in records
    ]
    held = [record.held for record in records if record.held is not None]
    return (
        float(np.percentile(deviations, 95)),
        float(np.percentile(beyond, 95)),
        float(np.mean(held)),
    )


def _state_residual(rng: np.random.Generator, least_share: float) -> Stated | None:
    truth, time, noise = _draw_modes(rng, least_share * 10 ** rng.uniform())
    energy = sum_energies(truth, time)
    energy = energy + noise * energy.max() * rng.standard_normal(time.size)
    td = float(time[-1] * rng.uniform(0.5, 0.9))
    answer = suggest_in_history(
        History(time, energy, source=("made",), format="csv", channel="E"),
        td,
        Settings(after=0.0),
    )
    best = next(
        (candidate for candidate in answer.candidates if candidate.recommended), None
    )
    if best is None or best.residual is None:
        return None
    assert best.residual_high is not None
    assert best.tr_low is not None
    assert best.tr_high is not None
    crossings = find_level_crossings(truth, td, -0.2)
    is_crossing_seen = best.kind == "crossing" and bool(
        np.any(np.abs(crossings - best.tr) < _NEAR)
    )
    held = (
        bool(np.any((best.tr_low <= crossings) & (crossings <= best.tr_high)))
        if is_crossing_seen
        else None
    )
    true = float(compute_replayed_residual(truth, np.array([best.tr]), td)[0])
    return Stated(best.residual, best.residual_high, true, held)


def _draw_modes(
    rng: np.random.Generator, share: float
) -> tuple[list[Mode], Samples, float]:
    """Draw two equally damped modes, the first with period 1, the second with ``share`` of its energy; and noise."""
    alpha, periods = rng.uniform(0, 0.5), rng.uniform(3, 12)
    rates = (
        2
        * np.pi
        * np.array([1.0, rng.choice([rng.uniform(1.3, 4), rng.uniform(0.35, 0.75)])])
    )
    roots, phases = np.sqrt([1 - share, share]), rng.uniform(0, 2 * np.pi, 2)
    table = np.stack([rates, roots * np.cos(phases), roots * np.sin(phases)], axis=1)[
        : 2 if share else 1
    ].tolist()
    time = np.arange(0, periods, 1 / np.exp(rng.uniform(np.log(15), np.log(200))))
    noise = rng.choice([0.0, np.exp(rng.uniform(np.log(1e-4), np.log(0.03)))])
    modes = [Mode(rate, alpha, cosine, sine, 0.0) for rate, cosine, sine in table]
    return modes, time, float(noise)


if __name__ == "__main__":
    for name, count in (("one", 600), ("small", 200), ("large", 200)):
        records = small_second_modes(name, range(count))
        residual, beyond, crossing = summarize_records(records)
        print(
            f"{name}: {len(records)} of {count}, 95 % within {residual:.3g}, {beyond:.3g}; tr held {crossing:.3f}"
        )
