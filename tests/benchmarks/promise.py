"""What a stated residual and a good grade are worth: ``python -m tests.benchmarks.promise [RECORDS [SEED [CLASS]]]``.

A structure is loaded by some pulses and then flies: modes whose springs may stiffen, plastic work, heat and drift in
the energy.  scipy integrates its motion.  The record goes through a file, and ``suggest`` recommends a pair.  The true
residual of that pair comes from integrating two runs from td on: that of the reference, and one that begins with the
deformation of tr at rest.  Goals in each class: no pair called good is worse than 0.3, and 95 % of the residuals lie
within 0.05 of what was stated.  A further class is a line in `CLASSES`.
"""

from __future__ import annotations

import sys
from itertools import pairwise
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np
from scipy.integrate import solve_ivp

import d2rpick
from d2rpick.base.errors import D2RPickError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping, Sequence

    from scipy.integrate import OdeSolution

    from d2rpick.histories.history import Samples

MOST_GOOD, MOST_FAIR, WITHIN = 0.2, 0.5, 0.05
BAD: Final = 0.3
MASS, GRAVITY = 1000.0, 9.81
# Periods of the slowest mode after td over which two runs are compared.
COMPARED: Final = 2.0
_EXACT: Final = {"method": "DOP853", "rtol": 1e-7, "atol": 1e-10}


class Structure(NamedTuple):
    """Modes q'' = -alpha q' - omega^2 (q + stiffening q^3) + pushes of half-sines; q^2 is the linear energy.

    ``omega``, ``stiffening`` of shape (k,); ``pushes`` of shape (p, 2 + k): start, end, and height on each mode.
    """

    omega: Samples
    alpha: float
    stiffening: Samples
    pushes: Samples

    @property
    def loaded_until(self) -> float:
        """End of the last push [time]."""
        return float(self.pushes[:, 1].max())

    def moved(self, start: float, end: float, state: Samples) -> Callable[[Samples], Samples]:
        """Integrate from a state, q and q' in one; give both at any times, shape (2 k, n)."""
        stops = np.unique(np.clip([start, *self.pushes[:, :2].ravel(), end], start, end))
        pieces: list[OdeSolution] = []
        for first, last in pairwise(stops.tolist()):  # a push begins with a kink
            found = solve_ivp(self._slope, (first, last), state, dense_output=True, **_EXACT)
            pieces.append(found.sol)
            state = found.y[:, -1]

        def at(t: Samples) -> Samples:
            place = np.clip(np.searchsorted(stops, t) - 1, 0, len(pieces) - 1)
            found = np.empty((state.size, t.size))
            for piece in np.unique(place):
                found[:, place == piece] = pieces[piece](t[place == piece])
            return found

        return at

    def push(self, t: float) -> Samples:
        """Force on each mode at a time, shape (k,)."""
        first, last = self.pushes[:, 0], self.pushes[:, 1]
        share = np.where((first < t) & (t < last), np.sin(np.pi * (t - first) / (last - first)), 0.0)
        return np.asarray(share @ self.pushes[:, 2:])

    def _slope(self, t: float, state: Samples) -> Samples:
        q, speed = np.split(state, 2)
        spring = self.omega**2 * (q + self.stiffening * q**3)
        return np.concatenate([speed, self.push(t) - self.alpha * speed - spring])

    def energies(self, states: Samples) -> tuple[Samples, Samples]:
        """Elastic and kinetic energy of states of shape (2 k, n), each of shape (k, n)."""
        q, speed = np.split(states, 2)
        return q**2 + self.stiffening[:, np.newaxis] * q**4 / 2, (speed / self.omega[:, np.newaxis]) ** 2

    def residual(self, tr: Samples, td: Samples) -> float:
        """Error of the vibration after td over that of the reference: states at tr and td, of shape (2 k,)."""
        free = self._replace(pushes=self.pushes[:0])
        end = COMPARED * 2 * np.pi / float(self.omega.min())
        times = np.linspace(0.0, end, 200)
        held = np.concatenate([np.split(tr, 2)[0], np.zeros(self.omega.size)])
        reference, switched = (free.moved(0.0, end, state)(times) for state in (td, held))
        linear = free._replace(stiffening=np.zeros(self.omega.size))
        off, whole = (sum(map(np.sum, linear.energies(one))) for one in (switched - reference, reference))
        return float(np.sqrt(off / whole)) if whole > 0 else 0.0


class Record(NamedTuple):
    """Columns of a file, written with so many ``digits``; ``asked`` are arguments of ``read`` and of ``suggest``.

    ``residual``: the true one of a pair (tr, td).
    """

    columns: Mapping[str, Samples]
    residual: Callable[[float, float], float]
    digits: int = 8
    read: Mapping[str, Any] = {}
    suggest: Mapping[str, Any] = {}


class Truth(NamedTuple):
    """What became of one record: the true residual of the recommended pair, what was stated of it, grade and basis."""

    true: float
    low: float | None
    high: float | None
    grade: str
    basis: str

    @property
    def kept(self) -> bool | None:
        """Whether the residual is what was stated; None where nothing was."""
        if self.low is None or self.high is None:
            return None
        return self.low - WITHIN <= self.true <= self.high + WITHIN


def tried(record: Record, folder: Path) -> Truth | None:
    """Write the record, ask for a pair, and hold it against the truth; None where none is recommended."""
    path = folder / "record.csv"
    names, values = list(record.columns), np.stack(list(record.columns.values()), axis=1)
    np.savetxt(path, values, f"%.{record.digits}g", ",", header=",".join(names), comments="")
    try:
        answer = d2rpick.suggest(d2rpick.read(str(path), **record.read), **record.suggest).to_dict()
    except D2RPickError:
        return None
    best = next((one for one in answer["candidates"] if one["recommended"]), None)
    if best is None:
        return None
    true = record.residual(best["tr"], answer["recommended"]["td"])
    return Truth(true, best["residual"], best["residual_high"], answer["quality"], answer["basis"])


def made(
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
) -> Record:
    """One record.

    ``stiffening`` at the highest deformation; ``plastic`` work over the vibration; ``heat``: the share of the energy
    lost to damping that stays in the record; ``drift`` over the flight and ``noise`` over the vibration; ``states`` per
    period of the energy; ``units`` of time and energy.
    """
    period = np.exp(random.uniform(np.log(0.005), np.log(0.05)))
    rates = np.cumprod(np.append(1.0, random.uniform(1.25, 2.2, modes - 1))) * 2 * np.pi / period
    scale = np.append(1.0, np.exp(random.uniform(np.log(0.03), np.log(0.8), modes - 1)))
    starts = np.cumsum(random.uniform(0, 1.5, random.integers(1, 4))) * period
    lasts = np.exp(random.uniform(np.log(0.15), np.log(2.5), starts.size)) * period
    heights = random.normal(size=(starts.size, 1)) * scale * rates**2
    pushes = np.column_stack([starts, starts + lasts, heights])
    structure = Structure(rates, random.choice([0.0, random.uniform(0, 0.3)]) / period, np.zeros(modes), pushes)
    begin = structure.loaded_until
    end = begin + random.uniform(4, 15) * period
    density = states or np.exp(random.uniform(np.log(15), np.log(80)))
    time = np.arange(0.0, end, np.pi / rates[-1] / density)
    if stiffening:
        highest = np.abs(structure.moved(0.0, begin + period, np.zeros(2))(time[time < begin + period])[0]).max()
        structure = structure._replace(stiffening=np.array([stiffening / highest**2]))
    motion = structure.moved(0.0, end, np.zeros(2 * modes))
    states_of = motion(time)
    elastic, kinetic = (one.sum(axis=0) for one in structure.energies(states_of))
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
    columns |= _evidence(random, time, structure, unit * kinetic, units)

    def residual(tr: float, td: float) -> float:
        at_tr, at_td = motion(np.array([tr, td]) / by_time).T
        return structure.residual(at_tr, at_td)

    return Record(columns, residual, digits, suggest=_asked(random, begin * by_time, end * by_time))


def _asked(random: np.random.Generator, begin: float, end: float) -> dict[str, object]:
    """Ask for both times, or for a td in the flight."""
    return {} if random.random() < 2 / 3 else {"td": float(random.uniform(begin + 0.4 * (end - begin), end))}


def _evidence(
    random: np.random.Generator, time: Samples, structure: Structure, kinetic: Samples, units: tuple[float, float]
) -> dict[str, Samples]:
    """Nothing, momenta that do not fall, or falling ones with the kinetic energy of the whole."""
    kind = random.integers(0, 4)
    if kind < 2:
        return {}
    pushed = np.array([np.abs(structure.push(t)).max() for t in time])
    impulse = np.cumsum(pushed * np.gradient(time))
    speed = np.zeros((time.size, 3)) + random.normal(size=3) * 5
    speed[:, 0] += random.uniform(1, 5) * impulse / max(impulse[-1], 1e-300)
    speed[:, 2] -= GRAVITY * time * (kind == 3)
    by_time, by_energy = units
    unit = by_energy * by_time  # of a momentum whose unit of length is the metre
    momenta = {f"{axis}_momentum": MASS * speed[:, place] * unit for place, axis in enumerate("xyz")}
    if kind == 2:
        return momenta
    return momenta | {"kinetic_energy": (MASS / 2 * (speed**2).sum(axis=1) + kinetic) * by_energy}


def _log(random: np.random.Generator, low: float, high: float) -> float:
    return float(np.exp(random.uniform(np.log(low), np.log(high))))


def nonlinear(random: np.random.Generator) -> Record:
    """One spring that stiffens, plastic work under the vibration, or both."""
    which = random.integers(1, 4)
    stiffening = _log(random, 0.03, 2.0) if which != 2 else 0.0
    return made(random, stiffening=stiffening, plastic=_log(random, 0.1, 50.0) if which > 1 else 0.0)


def drifting(random: np.random.Generator) -> Record:
    """Energy that drifts in flight, or keeps what damping takes of the vibration."""
    which = random.integers(1, 4)
    return made(random, drift=_log(random, 0.01, 0.5) * (which != 2), heat=random.uniform(0.1, 1.0) * (which > 1))


def units(random: np.random.Generator) -> Record:
    """Other units, and few digits."""
    by = random.choice([1.0, 1e3, 1e6]), 10.0 ** random.integers(-6, 7)
    return made(random, units=by, digits=int(random.integers(4, 8)))


CLASSES: Final[dict[str, Callable[[np.random.Generator], Record]]] = {
    "one mode": made,
    "two modes": lambda random: made(random, modes=2),
    "3 to 5 modes, noise": lambda random: made(
        random, modes=int(random.integers(3, 6)), noise=random.choice([0.0, _log(random, 1e-4, 0.02)])
    ),
    "Duffing and plastic": nonlinear,
    "drift and heating": drifting,
    "coarse output": lambda random: made(random, modes=int(random.integers(1, 3)), states=random.uniform(5, 15)),
    "units and digits": units,
}


def counted(make: Callable[[np.random.Generator], Record], count: int, seed: int) -> list[Truth | None]:
    """Try so many records of a class."""
    with TemporaryDirectory() as folder:
        return [tried(make(np.random.default_rng([seed, number])), Path(folder)) for number in range(count)]


def row(found: Sequence[Truth | None]) -> list[str]:
    """What became of the records of a class, as cells below `HEAD`."""
    pairs = [one for one in found if one]
    good = [one for one in pairs if one.grade == "good"]
    kept = [one.kept for one in pairs if one.kept is not None]
    groups = [
        [one.grade == "good" for one in pairs if low < one.true <= high]
        for low, high in ((-1.0, MOST_GOOD), (MOST_GOOD, MOST_FAIR), (MOST_FAIR, np.inf))
    ]
    shares = [f"{sum(group)}/{len(group)}" for group in groups]
    stated = f"{np.mean(kept):.3f} of {len(kept)}" if kept else "-"
    return [*map(str, (len(found), len(pairs), len(good), sum(one.true > BAD for one in good))), stated, *shares]


HEAD: Final = ("records", "recommended", "good", "good, R > 0.3", "as stated", "good of R < 0.2", "< 0.5", "above")


def table(classes: Iterable[str], found: Callable[[str, int, int], Sequence[Truth | None]], *args: str) -> None:
    """Print a line for each class, or for those that have one of some names behind number and seed in ``args``."""
    count, seed = int((args[:1] or ("100",))[0]), int((args[1:2] or ("1",))[0])
    print("".join(f"{head:>17}" for head in ("class", *HEAD)))
    for name in classes:
        if not args[2:] or any(one in name for one in args[2:]):
            print("".join(f"{cell:>17}" for cell in (name[:16], *row(found(name, count, seed)))), flush=True)


if __name__ == "__main__":
    table(CLASSES, lambda name, count, seed: counted(CLASSES[name], count, seed), *sys.argv[1:])
