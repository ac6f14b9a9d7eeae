"""The energy balance of a run under the names that each solver gives its terms."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Final

import numpy as np

from d2rpick.base.errors import FormatError, if_written
from d2rpick.histories.formats import READERS
from d2rpick.histories.history import Balance, Momenta, Samples
from d2rpick.histories.meaning import (
    ROTATION_ENERGY,
    is_internal_energy,
    is_total_internal_energy,
)
from d2rpick.histories.names import Part, normalised
from d2rpick.histories.samples import median

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from d2rpick.histories.database import Legs

# Terms of the balance, and the quantities that hold them.
_QUANTITIES: Final[Mapping[str, str]] = {
    "kinetic": "kinetic_energy",
    "hourglass": "hourglass_energy",
    "artificial": "artificial_energy",
    "sliding": "contact_energy",
    "friction": "frictional_contact_energy",
    "external_work": "external_work",
    "total": "total_energy",
    "ratio": "energy_ratio",
    "eroded": "eroded_internal_energy",
    "damping": "damping_energy",
}
# Abaqus' total energy is what is left of all energies without the external work: it stays as it is at the start.
_LESS_WORK: Final = frozenset({"etotal", "allwk"})
# Without one of these nothing can be said of the health.
_JUDGED: Final = frozenset(_QUANTITIES.values()) - {
    "kinetic_energy",
    "frictional_contact_energy",
    "damping_energy",
}
# Normalised names.
_WALLS: Final = ("stonewallenergy", "rigidwallenergy")
_GLOBAL_VELOCITIES: Final = ("globalxvelocity", "globalyvelocity", "globalzvelocity")
_MOMENTA: Final = ("x_momentum", "y_momentum", "z_momentum")
_VELOCITIES: Final = ("x_velocity", "y_velocity", "z_velocity")


def balance_of(
    databases: Sequence[Legs],
    parts: Sequence[Part] | None,
    until: float = np.inf,
    known: Balance | None = None,
) -> Balance | None:
    """Read the balance of the whole model, and the hourglass energy of ``parts``, up to a time [time].

    ``known`` are its `terms_of`, where they were read already and all times are asked for.  None where the files have
    nothing of it that can be judged, or leave open which columns are meant.
    """
    whole = _whole(databases)
    of_parts = _hourglass_of(databases, parts, until) if parts else ()
    judged = whole is not None and not _JUDGED.isdisjoint(whole.quantities)
    if not (judged or of_parts):
        return None
    if whole is None:
        return Balance(databases[0].part_time, hourglass_of_parts=of_parts)
    terms = known or _terms(whole, until)
    return terms and replace(terms, hourglass_of_parts=of_parts)


def terms_of(databases: Sequence[Legs]) -> Balance | None:
    """Read the balance of the whole model, be it enough to judge the health of the run or not.

    None where the files have no energy beside the internal one, or leave open which columns are meant.
    """
    whole = _whole(databases)
    if whole is None or {*_QUANTITIES.values()}.isdisjoint(whole.quantities):
        return None
    return _terms(whole, np.inf)


def momentum_of(database: Legs) -> Momenta | None:
    """Read the momentum of the whole model, or its velocity, which is the same but for the mass; None without."""
    if {*_MOMENTA, *_VELOCITIES}.isdisjoint(
        database.quantities
    ) and not _global_velocities(database):
        return None
    columns = if_written(lambda: _Columns(database, database.time.size))
    values = columns.velocity() if columns else None
    if columns is None or values is None:
        return None
    values = values[:, np.newaxis]
    precision = database.precisions(columns.used)[1]
    mass = (columns.mass(values) if columns.momentum else 0.0) or float(
        "nan"
    )  # nothing moves, or it is not known
    return Momenta(
        database.time,
        values,
        None,
        precision,
        (0,),
        masses=np.array([mass]),
        velocity=not columns.momentum,
    )


def least_masses(momenta: Samples, kinetic: Samples) -> Samples:
    """Least masses (k,) that have such momenta (n, k, 3) at such kinetic energies (n, k); 0 where there is none."""
    squares = np.sum(momenta**2, axis=2)
    found = np.divide(
        squares, 2 * kinetic, out=np.zeros(squares.shape), where=kinetic > 0
    )
    return np.asarray(found.max(axis=0))


def _whole(databases: Sequence[Legs]) -> Legs | None:
    return next((database for database in databases if database.channels), None)


def _terms(whole: Legs, until: float) -> Balance | None:
    columns = if_written(
        lambda: _Columns(whole, int(np.searchsorted(whole.time, until, side="right")))
    )
    if columns is None:
        return None
    found = {term: columns.quantity(quantity) for term, quantity in _QUANTITIES.items()}
    rotation = columns.called(ROTATION_ENERGY)
    if rotation is not None and found["kinetic"] is not None:
        found["kinetic"] = found["kinetic"] + rotation
    walls = (columns.called(name) for name in _WALLS)
    found["wall"] = next((energy for energy in walls if energy is not None), None)
    total, work = found["total"], found["external_work"]
    if (
        total is not None
        and work is not None
        and _LESS_WORK.issubset(map(normalised, columns.used))
    ):
        found["total"] = total + work
    return Balance(
        time=whole.time[: columns.states],
        internal=columns.internal(),
        velocity=columns.velocity(),
        hourglass_of_parts=(),
        precision=whole.precisions(columns.used)[1],
        **found,
    )


def _global_velocities(database: Legs) -> dict[str, str]:
    """Return the channels called velocities of the whole model, by their normalised names."""
    names = {normalised(name): name for name in reversed(database.channels)}
    return {name: names[name] for name in _GLOBAL_VELOCITIES if name in names}


class _Columns:
    """Columns of a database by what they mean, the first ``states`` of them.

    One that is absent, or not in every state, is None.
    """

    def __init__(self, database: Legs, states: int) -> None:
        self._database = database
        self.states = states
        self.used: list[str] = []
        self.momentum = False  # whether the velocity that was read is a momentum

    def mass(self, momenta: Samples) -> float:
        """Give the mass of the model: as written, or the least that has these momenta, (n, 1, 3)."""
        written, kinetic = self.quantity("mass"), self.quantity("kinetic_energy")
        if written is not None and written.size:
            return float(median(written))
        if kinetic is None or not (kinetic > 0).any():
            return float("nan")
        return float(least_masses(momenta, kinetic[:, np.newaxis])[0])

    def quantity(self, quantity: str) -> Samples | None:
        """Return the column of a quantity of `d2rpick.histories.names.QUANTITIES`."""
        name = self._database.quantities.get(quantity)
        return None if name is None else self._values(name)

    def called(self, wanted: str) -> Samples | None:
        """Return the column with this normalised name."""
        name = next(
            (name for name in self._database.channels if normalised(name) == wanted),
            None,
        )
        return None if name is None else self._values(name)

    def velocity(self) -> Samples | None:
        """Give the velocity of the centre of mass, up to a factor, shape (n, 3).

        A velocity that is called global is preferred, then a momentum, then any other velocity.  A planar one has two
        of the three components.
        """
        velocities = [self.called(name) for name in _GLOBAL_VELOCITIES]
        stacked = _stack_components(velocities)
        if stacked is None:
            stacked = _stack_components([self.quantity(axis) for axis in _MOMENTA])
            self.momentum = stacked is not None
        if stacked is None:
            stacked = _stack_components([self.quantity(axis) for axis in _VELOCITIES])
        return stacked

    def internal(self) -> Samples | None:
        """Give the internal energy of the whole model; beside its total, a plain one may be that of some parts."""
        for says_so in (is_total_internal_energy, is_internal_energy):
            names = [name for name in self._database.channels if says_so(name)]
            if names:
                return self._values(names[0])
        return None

    def _values(self, name: str) -> Samples | None:
        values = if_written(lambda: self._database.channel(name)[: self.states])
        if values is None or not np.isfinite(values).all():
            return None
        self.used.append(name)
        return values


def _stack_components(components: Sequence[Samples | None]) -> Samples | None:
    """Stack components (n,) to vectors (n, 3), 0 where one is missing; None if fewer than two are there."""
    known = [component for component in components if component is not None]
    if len(known) < 2:
        return None
    still = np.zeros_like(known[0])
    return np.stack(
        [still if component is None else component for component in components], axis=1
    )


def _hourglass_of(
    databases: Sequence[Legs], parts: Sequence[Part], until: float
) -> tuple[tuple[Part, float, float], ...]:
    """Highest hourglass and internal energy of each part, where they are written."""
    ids = [part.id for part in parts]
    for database in databases:
        try:
            hourglass, internal = (
                database.part_channel(name, ids)
                for name in ("hourglass_energy", "internal_energy")
            )
        except FormatError:
            continue
        before = database.part_time <= until
        highest = (
            energy[before].max(axis=0, initial=0.0).tolist()
            for energy in (hourglass, internal)
        )
        return tuple(zip(parts, *highest, strict=True))
    return ()


# Radioss; glstat of LS-DYNA and its branch of a binout.  In a table the names may mean anything.
_SPRINGS: Final = frozenset({"springenergy", "springanddamperenergy"})
# Below this share of the peak internal energy springs have none: single precision and glstat print six digits.
_NONE: Final = 1e-6
# LS-DYNA begins to count at 1e-20.
_FLOOR: Final = 1e-15
# The energies of the springs add up to within this share of the peak: matsum prints five digits of each.
_ADDS_UP: Final = 1e-3
# Factors of a sum of parts are 0 or 1.
_HALF: Final = 0.5


def spring_energy(database: Legs) -> tuple[str, Samples] | None:
    """Give name and values (n,) of the energy of all springs and dampers; None where there is none, or no other."""
    total = database.energy_channel
    if not READERS[database.format].solver or total is None:
        return None
    name = next(
        (name for name in database.channels if normalised(name) in _SPRINGS), None
    )
    if name is None:
        return None
    energies = if_written(lambda: (database.channel(name), database.channel(total)))
    if energies is None or not energies[0].size or not np.isfinite(energies[0]).all():
        return None
    found, whole = energies
    least = max(_NONE * float(np.abs(whole).max()), _FLOOR)
    rest = whole - found
    told_apart = (
        found.max() > least and rest.max() > least and rest.min() >= -least
    )  # it is part of the whole
    return (name, found) if told_apart else None


def springs_among(
    databases: Sequence[Legs], parts: Sequence[Part], energies: Samples, time: Samples
) -> tuple[Part, ...]:
    """Find the parts whose energies add up to that of all springs and dampers; none where no choice of them does.

    ``energies`` are those of all parts, shape (n, parts), at ``time`` (n,).
    """
    named = next(
        ((one.time, found[1]) for one in databases if (found := spring_energy(one))),
        None,
    )
    if named is None or not time.size > len(parts) > 0:
        return ()
    inside = (time >= named[0][0]) & (time <= named[0][-1])
    wanted, table = np.interp(time[inside], *named), energies[inside]
    if not wanted.any() or not np.isfinite(table).all():
        return ()
    chosen = np.linalg.lstsq(table, wanted, rcond=None)[0] > _HALF
    if (
        np.abs(table[:, chosen].sum(axis=1) - wanted).max()
        > _ADDS_UP * np.abs(wanted).max()
    ):
        return ()
    return tuple(part for part, one in zip(parts, chosen.tolist(), strict=True) if one)
