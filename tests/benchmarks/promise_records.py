"""Random records of structures that were integrated: modes with stiffening springs, plastic work, heat, or drift.

Each is a file, questions to ask, and the truth about every pair.  A further class is a line in `INTEGRATED`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, Final, NamedTuple

import numpy as np

from d2rpick.histories.history import Samples
from tests.benchmarks.promise_structure import IntegratedRun, Joint, Structure
from tests.benchmarks.promise_truth import Truth

MASS, GRAVITY = 1000.0, 9.81


class Record(NamedTuple):
    """Columns of a file that are written with this number of ``digits``, and the truth about its pairs.

    ``read`` and ``suggest`` are arguments of the functions of this name.
    """

    columns: Mapping[str, Samples]
    truth: Truth
    digits: int = 8
    read: Mapping[str, Any] = {}
    suggest: Mapping[str, Any] = {}


Make = Callable[[np.random.Generator], Record]


def make_integrated(
    random: np.random.Generator,
    *,
    modes: int = 1,
    noise: float = 0.0,
    stiffening: float = 0.0,
    plastic: float = 0.0,
    heat: float = 0.0,
    drift: float = 0.0,
    states: float | None = None,
    units: tuple[float, float] = (1.0, 1.0),
    digits: int = 8,
    join: Callable[[np.random.Generator, Structure, Samples], Joint] | None = None,
) -> Record:
    """Make one record.

    ``stiffening`` at the highest deformation; ``plastic`` work over the vibration; ``heat``: the share of the energy
    lost to damping that stays in the record; ``drift`` over the flight and ``noise`` over the vibration; ``states`` per
    period of the energy; ``units`` of time and energy; ``join`` chooses a joint for a structure and its free states.
    """
    period = np.exp(random.uniform(np.log(0.005), np.log(0.05)))
    rates = (
        np.cumprod(np.append(1.0, random.uniform(1.25, 2.2, modes - 1)))
        * 2
        * np.pi
        / period
    )
    scale = np.append(1.0, np.exp(random.uniform(np.log(0.03), np.log(0.8), modes - 1)))
    starts = np.cumsum(random.uniform(0, 1.5, random.integers(1, 4))) * period
    lasts = np.exp(random.uniform(np.log(0.15), np.log(2.5), starts.size)) * period
    heights = random.normal(size=(starts.size, 1)) * scale * rates**2
    pushes = np.column_stack([starts, starts + lasts, heights])
    structure = Structure(
        rates,
        random.choice([0.0, random.uniform(0, 0.3)]) / period,
        np.zeros(modes),
        pushes,
    )
    begin = structure.loaded_until
    end = begin + random.uniform(4, 15) * period
    density = states or np.exp(random.uniform(np.log(15), np.log(80)))
    time = np.arange(0.0, end, np.pi / rates[-1] / density)
    state_at_rest = np.zeros(2 * modes)
    if stiffening:
        highest = np.abs(
            structure.move(0.0, begin + period, state_at_rest)(
                time[time < begin + period]
            )[0]
        ).max()
        structure = structure._replace(stiffening=np.array([stiffening / highest**2]))
    if join is not None:
        first_periods = np.linspace(begin, begin + 2 * period, 400)
        free_states = structure.move(0.0, begin + 2 * period, state_at_rest)(
            first_periods
        )
        structure = structure._replace(joint=join(random, structure, free_states))
    motion = structure.move(0.0, end, state_at_rest)
    states_of = motion(time)
    elastic, kinetic = (
        energies.sum(axis=0) for energies in structure.compute_energies(states_of)
    )
    if structure.joint is not None:
        elastic = elastic + structure.joint.compute_energy(np.split(states_of, 2)[0])
    vibration = elastic + kinetic
    flying = time >= begin
    unit = np.exp(random.uniform(np.log(10.0), np.log(1e4))) / vibration[flying].max()
    swing = vibration[flying].max()
    lost = structure.alpha * np.cumsum(2 * kinetic * np.gradient(time))
    worked = np.clip(time / begin, 0, 1) ** 2 * plastic * swing
    drifted = drift * swing * np.clip((time - begin) / (end - begin), 0, 1)
    scatter = noise * swing * random.standard_normal(time.size)
    energy = unit * (elastic + worked + heat * lost + drifted + scatter)
    by_time, by_energy = units
    columns = {"time": time * by_time, "internal_energy": energy * by_energy}
    impulse = np.cumsum(
        np.abs(structure.compute_push(time)).max(axis=1) * np.gradient(time)
    )
    columns |= add_evidence(random, time, impulse, unit * kinetic, units)
    truth = Truth(IntegratedRun(structure, motion), (begin, end), by_time)
    return Record(
        columns,
        truth,
        digits,
        suggest=ask_for_times(random, begin * by_time, end * by_time),
    )


def ask_for_times(
    random: np.random.Generator, begin: float, end: float
) -> dict[str, object]:
    """Request both times, or the best tr for a td in the flight."""
    return (
        {}
        if random.random() < 2 / 3
        else {"td": float(random.uniform(begin + 0.4 * (end - begin), end))}
    )


def add_evidence(
    random: np.random.Generator,
    time: Samples,
    impulse: Samples,
    kinetic: Samples,
    units: tuple[float, float] = (1.0, 1.0),
) -> dict[str, Samples]:
    """Draw no momenta, momenta that do not fall, or falling momenta with the kinetic energy of the whole model.

    ``impulse`` that the loads have given so far, in any unit, and ``kinetic``, the energy of the vibration: shape (n,).
    """
    kind = random.integers(0, 4)
    if kind < 2:
        return {}
    speed = np.zeros((time.size, 3)) + random.normal(size=3) * 5
    speed[:, 0] += random.uniform(1, 5) * impulse / max(impulse[-1], 1e-300)
    speed[:, 2] -= GRAVITY * time * (kind == 3)
    by_time, by_energy = units
    unit = by_energy * by_time  # for a momentum in metres
    momenta = {
        f"{axis}_momentum": MASS * speed[:, axis_index] * unit
        for axis_index, axis in enumerate("xyz")
    }
    if kind == 2:
        return momenta
    return momenta | {
        "kinetic_energy": (MASS / 2 * (speed**2).sum(axis=1) + kinetic) * by_energy
    }


def draw_log(random: np.random.Generator, low: float, high: float) -> float:
    """Draw a number whose logarithm is uniform."""
    return float(np.exp(random.uniform(np.log(low), np.log(high))))


def make_stiffening(random: np.random.Generator) -> Record:
    """Make one spring that stiffens, plastic work under the vibration, or both."""
    which = random.integers(1, 4)
    stiffening = draw_log(random, 0.03, 2.0) if which != 2 else 0.0
    return make_integrated(
        random,
        stiffening=stiffening,
        plastic=draw_log(random, 0.1, 50.0) if which > 1 else 0.0,
    )


def make_drifting(random: np.random.Generator) -> Record:
    """Make an energy that drifts in flight, or that contains what damping takes from the vibration."""
    which = random.integers(1, 4)
    return make_integrated(
        random,
        drift=draw_log(random, 0.01, 0.5) * (which != 2),
        heat=random.uniform(0.1, 1.0) * (which > 1),
    )


def make_units(random: np.random.Generator) -> Record:
    """Make a record in other units, and with few digits."""
    by = random.choice([1.0, 1e3, 1e6]), 10.0 ** random.integers(-6, 7)
    return make_integrated(random, units=by, digits=int(random.integers(4, 8)))


def make_noisy(random: np.random.Generator) -> Record:
    """Make three to five modes, half of them with noise."""
    modes = int(random.integers(3, 6))
    return make_integrated(
        random, modes=modes, noise=random.choice([0.0, draw_log(random, 1e-4, 0.02)])
    )


def make_coarse(random: np.random.Generator) -> Record:
    """Make one or two modes of few states."""
    return make_integrated(
        random, modes=int(random.integers(1, 3)), states=random.uniform(5, 15)
    )


def make_rubbing(random: np.random.Generator) -> Record:
    """Make modes that dry friction slows by 1 to 20 % of the amplitude per period; the heat is not in the energy."""
    return make_integrated(
        random, modes=int(random.integers(1, 4)), join=_choose_friction
    )


def _choose_friction(
    random: np.random.Generator, structure: Structure, states: Samples
) -> Joint:
    row = _draw_row(random, structure)
    q, speed = np.split(states, 2)
    force = 2 * draw_log(random, 0.0025, 0.05) * float(np.abs(row @ q).max())
    return Joint(row, friction=force, creep=0.01 * float(np.abs(row @ speed).max()))


def make_rattling(random: np.random.Generator) -> Record:
    """Make masses that hit each other across a gap, which 20 to 90 % of their amplitude closes."""
    return make_integrated(random, modes=int(random.integers(2, 4)), join=_choose_gap)


def _choose_gap(
    random: np.random.Generator, structure: Structure, states: Samples
) -> Joint:
    row = _draw_row(random, structure)
    swing = float(np.abs(row @ np.split(states, 2)[0]).max())
    stiffness, gap = draw_log(random, 2.0, 40.0), random.uniform(0.2, 0.9) * swing
    return Joint(
        row, stiffness=stiffness, gap=gap, recorded=bool(random.random() < 0.5)
    )


def _draw_row(random: np.random.Generator, structure: Structure) -> Samples:
    """Draw, with a length of 1, how far each mode moves the two sides of a joint relative to each other."""
    row = random.normal(size=structure.omega.size)
    return np.asarray(row / np.linalg.norm(row))


INTEGRATED: Final[dict[str, Make]] = {
    "one mode": make_integrated,
    "two modes": lambda random: make_integrated(random, modes=2),
    "3 to 5 modes, noise": make_noisy,
    "Duffing and plastic": make_stiffening,
    "drift and heating": make_drifting,
    "coarse output": make_coarse,
    "units and digits": make_units,
    "friction": make_rubbing,
    "rattle": make_rattling,
}
