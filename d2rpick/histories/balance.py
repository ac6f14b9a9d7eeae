"""Read the energy balance of a run from energies whose names depend on the solver."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from itertools import compress
from typing import TYPE_CHECKING, Final

import numpy as np

from d2rpick.base.errors import give_if_written
from d2rpick.histories.formats import READERS
from d2rpick.histories.history import Balance, Momenta, Samples
from d2rpick.histories.meaning import (
    ROTATION_ENERGY,
    is_internal_energy,
    is_total_internal_energy,
)
from d2rpick.histories.names import Part, normalise_name
from d2rpick.histories.samples import compute_median

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from d2rpick.histories.database import Legs

# Fields of `Balance`, each with the name of its quantity in `d2rpick.histories.names.QUANTITIES`.
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
# Names that Abaqus uses for a total energy, i.e. the sum of all energies minus the external work, which is constant.
_LESS_WORK: Final = frozenset({"etotal", "allwk"})
# The health of a run can be judged if its files contain at least one of these quantities.
_JUDGED: Final = frozenset(_QUANTITIES.values()) - {
    "kinetic_energy",
    "frictional_contact_energy",
    "damping_energy",
}
# Normalised names of the energy absorbed by rigid walls.
_WALLS: Final = ("stonewallenergy", "rigidwallenergy")
_GLOBAL_VELOCITIES: Final = ("globalxvelocity", "globalyvelocity", "globalzvelocity")
_MOMENTA: Final = ("x_momentum", "y_momentum", "z_momentum")
_VELOCITIES: Final = ("x_velocity", "y_velocity", "z_velocity")

# Normalised names of the spring energy in Radioss, in LS-DYNA's glstat, and in the glstat branch of a binout.
# Spring energies are recognised in solver files only, because in tables these names may have another meaning.
_SPRINGS: Final = frozenset({"springenergy", "springanddamperenergy"})
# Largest spring energy that is treated as zero, relative to the peak internal energy [-].
# This limit corresponds to six or seven significant digits, as in a glstat and in single precision.
_NONE: Final = 1e-6
# Largest spring energy that is treated as zero [energy]; LS-DYNA prints 1e-20 for zero.
_FLOOR: Final = 1e-15
# Largest deviation of the sum of the parts' spring energies, relative to its peak [-]; matsum prints five digits.
_ADDS_UP: Final = 1e-3
# A part is included in the sum if its fitted factor exceeds this [-]; the ideal factors are 0 and 1.
_HALF: Final = 0.5


def read_balance(
    databases: Sequence[Legs],
    parts: Sequence[Part] | None,
    until: float = np.inf,
    known: Balance | None = None,
) -> Balance | None:
    """Return the energy balance of the whole model, and the hourglass energies of ``parts``, up to a time [time].

    ``known`` is the result of `read_terms` if it is already available and all times are requested. The result is None
    if the files contain no term by which the run can be judged, or if the columns are ambiguous.
    """
    whole = _find_whole_model(databases)
    of_parts = _read_hourglass_energies(databases, parts, until) if parts else ()
    judged = whole is not None and not _JUDGED.isdisjoint(whole.quantities)
    if not (judged or of_parts):
        return None
    if whole is None:
        return Balance(databases[0].part_time, hourglass_of_parts=of_parts)
    terms = known or _read_terms_until(whole, until)
    return terms and replace(terms, hourglass_of_parts=of_parts)


def read_terms(databases: Sequence[Legs]) -> Balance | None:
    """Return the energy balance of the whole model, even if too much is missing to judge the run.

    The result is None if the files contain only the internal energy, or if the columns are ambiguous.
    """
    whole = _find_whole_model(databases)
    if whole is None or {*_QUANTITIES.values()}.isdisjoint(whole.quantities):
        return None
    return _read_terms_until(whole, np.inf)


def read_momentum(database: Legs) -> Momenta | None:
    """Return the momentum of the model, or its velocity if the mass is unknown; None if neither is in the files."""
    has_components = not {*_MOMENTA, *_VELOCITIES}.isdisjoint(database.quantities)
    if not has_components and not _find_global_velocities(database):
        return None
    columns = give_if_written(lambda: _Columns(database, database.time.size))
    values = columns.velocity() if columns else None
    if columns is None or values is None:
        return None
    values = values[:, np.newaxis]
    precision = database.precisions(columns.used)[1]
    # The mass stays unknown if no file contains it, or if nothing moves.
    mass = float("nan")
    if columns.momentum:
        mass = columns.mass(values) or mass
    return Momenta(
        database.time,
        values,
        None,
        precision,
        (0,),
        masses=np.array([mass]),
        velocity=not columns.momentum,
    )


def compute_least_masses(momenta: Samples, kinetic: Samples) -> Samples:
    """Return the smallest masses (k,) that are consistent with these momenta (n, k, 3) and kinetic energies (n, k)."""
    squares = np.sum(momenta**2, axis=2)
    masses = np.divide(
        squares, 2 * kinetic, out=np.zeros(squares.shape), where=kinetic > 0
    )
    return np.asarray(masses.max(axis=0))


def _find_whole_model(databases: Sequence[Legs]) -> Legs | None:
    """Return the first database that describes the whole model."""
    return next((database for database in databases if database.channels), None)


def _read_terms_until(whole: Legs, until: float) -> Balance | None:
    """Return the energies of the balance up to a time, or None if the time or the columns cannot be read."""
    columns = give_if_written(
        lambda: _Columns(whole, int(np.searchsorted(whole.time, until, side="right")))
    )
    if columns is None:
        return None
    terms = {term: columns.quantity(quantity) for term, quantity in _QUANTITIES.items()}
    rotation = columns.called(ROTATION_ENERGY)
    if rotation is not None and terms["kinetic"] is not None:
        terms["kinetic"] = terms["kinetic"] + rotation
    walls = (columns.called(name) for name in _WALLS)
    terms["wall"] = next((energy for energy in walls if energy is not None), None)
    total = terms["total"]
    work = terms["external_work"]
    is_less_work = _LESS_WORK.issubset(map(normalise_name, columns.used))
    if total is not None and work is not None and is_less_work:
        terms["total"] = total + work
    return Balance(
        time=whole.time[: columns.states],
        internal=columns.internal(),
        velocity=columns.velocity(),
        hourglass_of_parts=(),
        precision=whole.precisions(columns.used)[1],
        **terms,
    )


def _find_global_velocities(database: Legs) -> dict[str, str]:
    """Return the channels whose names denote a velocity of the whole model, keyed by normalised name."""
    names = {normalise_name(name): name for name in reversed(database.channels)}
    return {name: names[name] for name in _GLOBAL_VELOCITIES if name in names}


class _Columns:
    """The columns of a database for its first ``states`` states, keyed by quantity.

    A column is None if it is missing in the database or in some of its states.
    """

    def __init__(self, database: Legs, states: int) -> None:
        self._database = database
        self.states = states
        self.used: list[str] = []
        # True if the momentum of the model is read because its velocity is missing.
        self.momentum = False

    def mass(self, momenta: Samples) -> float:
        """Return the mass in the file or, failing that, the smallest mass that fits these momenta (n, 1, 3)."""
        written = self.quantity("mass")
        kinetic = self.quantity("kinetic_energy")
        if written is not None and written.size:
            return float(compute_median(written))
        if kinetic is None or not (kinetic > 0).any():
            return float("nan")
        return float(compute_least_masses(momenta, kinetic[:, np.newaxis])[0])

    def quantity(self, quantity: str) -> Samples | None:
        """Return the column that contains a given quantity from `d2rpick.histories.names.QUANTITIES`."""
        name = self._database.quantities.get(quantity)
        return None if name is None else self._values(name)

    def called(self, wanted: str) -> Samples | None:
        """Return the column with this normalised name."""
        name = next(
            (
                name
                for name in self._database.channels
                if normalise_name(name) == wanted
            ),
            None,
        )
        return None if name is None else self._values(name)

    def velocity(self) -> Samples | None:
        """Return the velocity of the centre of mass, shape (n, 3), possibly multiplied by an unknown constant.

        A global velocity is preferred, then a momentum, then any other velocity. A planar one has two of the three
        components.
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
        """Return the internal energy of the model, preferably from a column whose name contains "total".

        Other columns may belong to only some of the parts.
        """
        for says_so in (is_total_internal_energy, is_internal_energy):
            names = [name for name in self._database.channels if says_so(name)]
            if names:
                return self._values(names[0])
        return None

    def _values(self, name: str) -> Samples | None:
        """Return a column; None if the column is missing, or if some of its values are not finite."""
        values = give_if_written(lambda: self._database.channel(name)[: self.states])
        if values is None or not np.isfinite(values).all():
            return None
        self.used.append(name)
        return values


def _stack_components(components: Sequence[Samples | None]) -> Samples | None:
    """Stack components (n,) into vectors (n, 3), with 0 for a missing component; None if there are fewer than two."""
    present = [component for component in components if component is not None]
    if len(present) < 2:
        return None
    zeros = np.zeros_like(present[0])
    return np.stack(
        [zeros if component is None else component for component in components], axis=1
    )


def _read_hourglass_energies(
    databases: Sequence[Legs], parts: Sequence[Part], until: float
) -> tuple[tuple[Part, float, float], ...]:
    """Return the highest hourglass energy and the highest internal energy of each part for which both are written."""
    ids = [part.id for part in parts]
    for database in databases:
        energies = give_if_written(partial(_read_both_energies, database, ids))
        if energies is None:
            continue
        hourglass, internal = energies
        until_then = database.part_time <= until
        highest = (
            energy[until_then].max(axis=0, initial=0.0).tolist()
            for energy in (hourglass, internal)
        )
        return tuple(zip(parts, *highest, strict=True))
    return ()


def _read_both_energies(database: Legs, ids: Sequence[int]) -> tuple[Samples, Samples]:
    """Return the hourglass energies and the internal energies of parts, each of shape (n, parts)."""
    return (
        database.part_channel("hourglass_energy", ids),
        database.part_channel("internal_energy", ids),
    )


def find_spring_energy(database: Legs) -> tuple[str, Samples] | None:
    """Return the name and values (n,) of the spring and damper energy; None if it is zero or no other energy exists."""
    total = database.energy_channel
    if not READERS[database.format].solver or total is None:
        return None
    name = next(
        (name for name in database.channels if normalise_name(name) in _SPRINGS), None
    )
    if name is None:
        return None
    energies = give_if_written(
        lambda: (database.channel(name), database.channel(total))
    )
    if energies is None or not energies[0].size or not np.isfinite(energies[0]).all():
        return None
    springs, whole = energies
    threshold = max(_NONE * float(np.abs(whole).max()), _FLOOR)
    others = whole - springs
    is_part_of_whole = (
        springs.max() > threshold
        and others.max() > threshold
        and others.min() >= -threshold
    )
    return (name, springs) if is_part_of_whole else None


def find_springs(
    databases: Sequence[Legs], parts: Sequence[Part], energies: Samples, time: Samples
) -> tuple[Part, ...]:
    """Return the parts whose energies add up to the spring and damper energy; empty if there are none.

    ``energies`` (n, parts) contains the energies of all parts at the times ``time`` (n,).
    """
    candidates = ((legs, find_spring_energy(legs)) for legs in databases)
    database, springs = next(
        ((legs, energy) for legs, energy in candidates if energy), (None, None)
    )
    if database is None or springs is None or not time.size > len(parts) > 0:
        return ()
    inside = (time >= database.time[0]) & (time <= database.time[-1])
    wanted = np.interp(time[inside], database.time, springs[1])
    table = energies[inside]
    if not wanted.any() or not np.isfinite(table).all():
        return ()
    is_chosen = np.linalg.lstsq(table, wanted, rcond=None)[0] > _HALF
    misfit = np.abs(table[:, is_chosen].sum(axis=1) - wanted).max()
    if misfit > _ADDS_UP * np.abs(wanted).max():
        return ()
    return tuple(compress(parts, is_chosen.tolist()))
