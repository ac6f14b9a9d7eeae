"""Represent the data of one run: its checked internal energy over time, its momenta, and its printed precision."""

from __future__ import annotations

from dataclasses import field, fields, replace
from typing import TYPE_CHECKING, Any, Final, TypeAlias, TypeVar

import numpy as np

from d2rpick.base.caching import cached_property
from d2rpick.base.data_classes import dataclass
from d2rpick.base.errors import COPY_AGAIN, HistoryError, RangeError, list_names
from d2rpick.base.memory import Memory, remember
from d2rpick.base.tuples import NamedTuple
from d2rpick.histories.digits import format_distinctly
from d2rpick.histories.samples import find_holes, find_turns, find_window
from d2rpick.histories.surroundings import UNKNOWN, Surroundings

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike, NDArray

    from d2rpick.histories.contact_forces import ContactForce
    from d2rpick.histories.names import Part
    from d2rpick.histories.source import Source

# The type is in quotes, because importing numpy.typing would slow down start-up.
Samples: TypeAlias = "NDArray[np.float64]"
Record = TypeVar("Record", bound="History | Balance | Momenta")

# Largest energy that is accepted [energy]; the squares of larger energies overflow a double.
LARGEST_ENERGY: Final = 1e150
# Largest speed that is treated as rest, relative to the speed of the fastest part [-]; it may be a rounding error.
_STILL: Final = 1e-6
# Number of times at which the energy is interpolated in one step; it is small to keep the work arrays small.
_TOGETHER: Final = 1 << 14
# Largest number of parts that the name of an energy lists.
_MOST_NAMED: Final = 5


# Relative difference of two doubles that were read from the same decimal number [-].
_SAME_NUMBER: Final = 1e-12


class Precision(NamedTuple):
    """The precision with which the numbers of a column were printed.

    ``digits`` is the number of significant digits (17 restore every double); if ``decimals`` is given, the numbers have
    this fixed number of decimals instead.
    """

    digits: int = 17
    decimals: int | None = None

    def quantum(self, value: float) -> float:
        """Return the distance between adjacent printable numbers near ``value`` [unit of value].

        Examples
        --------
        >>> f"{Precision(digits=6).quantum(0.0640123):g}"
        '1e-07'
        >>> f"{Precision(decimals=4).quantum(0.0640123):g}"
        '0.0001'
        """
        if self.decimals is not None:
            return float(10.0**-self.decimals)
        if value == 0.0:
            return 0.0
        return float(10.0 ** (np.floor(np.log10(abs(value))) - self.digits + 1))

    def quanta(self, values: Samples) -> Samples:
        """Return the distance between adjacent printable numbers near each of the ``values``, in the same shape."""
        if self.decimals is not None:
            return np.full(values.shape, 10.0**-self.decimals)
        sizes = np.abs(values)
        powers = (
            np.floor(np.log10(sizes, out=np.zeros(sizes.shape), where=sizes > 0))
            - self.digits
            + 1
        )
        return np.where(sizes > 0, 10.0**powers, 0.0)

    def round(self, values: Samples) -> Samples:
        """Return ``values`` (n,) with no more digits than were printed, in the same unit.

        A sum of printed numbers has more digits than are known.

        Examples
        --------
        >>> Precision(digits=5).round(np.array([44.181 + 0.58376, 0.0]))
        array([44.765,  0.   ])
        """
        if self == EXACT:
            return values
        if self.decimals is not None:
            return values.round(self.decimals)
        printed = f"{{:.{self.digits - 1}e}}".format
        return np.array([float(printed(value)) for value in values.tolist()])

    def noise(self, values: Samples) -> float:
        """Return the rounding error of printed values: half a unit of the last printed digit of the largest value."""
        return self.quantum(float(np.abs(values).max())) / 2


EXACT = Precision()


def find_digits(values: Samples, most: int) -> int:
    """Return the number of significant digits that restore all ``values``, but no more than ``most``.

    Examples
    --------
    >>> find_digits(np.array([2450.0, -0.1717, 0.0]), 17), find_digits(np.array([1 / 3]), 6)
    (4, 6)
    """
    for digits in range(1, most):
        quanta = Precision(digits).quanta(values)
        counts = np.divide(values, quanta, out=np.zeros(values.shape), where=quanta > 0)
        if (np.abs(counts - counts.round()) <= _SAME_NUMBER * np.abs(counts)).all():
            return digits
    return most


@dataclass(frozen=True, eq=False, repr=False)
class Momenta:
    """Momenta of ``parts``, or of the model if ``parts`` is None: ``values`` (n, parts, 3) over ``time`` (n,).

    ``precision`` is that of the printed numbers. ``chosen`` contains the indices of the parts to be switched, and
    ``flying`` those of the parts that are known to fly together, if any. ``masses`` (parts,) contains NaN for an
    unknown mass, and is None if no mass is known [mass]. ``velocity`` is True if the values are velocities of unknown
    masses. ``surroundings`` describes the external forces. ``memory`` keeps results for sets of parts, because the same
    few sets are requested often.
    """

    time: Samples
    values: Samples
    parts: tuple[Part, ...] | None
    precision: Precision
    chosen: tuple[int, ...]
    flying: tuple[int, ...] | None = None
    masses: Samples | None = None
    velocity: bool = False
    surroundings: Surroundings = UNKNOWN
    memory: Memory = field(default_factory=Memory, init=False)

    def choosing(
        self, chosen: tuple[int, ...], flying: tuple[int, ...] | None = None
    ) -> Momenta:
        """Return the momenta with another choice of parts to switch; results that were already computed are kept."""
        copy = replace(self, chosen=chosen, flying=flying)
        object.__setattr__(copy, "memory", self.memory)
        return copy

    def of(self, members: Sequence[int]) -> Samples:
        """Return the sum of the momenta of the parts with these indices, shape (n, 3), read-only."""
        return _sum_momenta(self, *members)

    def noise(self, members: Sequence[int]) -> float:
        """Return the rounding error of the sum of the printed momenta of these parts [momentum]."""
        largest = np.abs(np.stack(self._bounds))[:, list(members)].max(
            axis=(0, 2), initial=0.0
        )
        return sum(self.precision.quantum(value) for value in largest.tolist()) / 2

    def mass(self, members: Sequence[int]) -> float:
        """Return the mass of those given parts that move [mass]; NaN if a mass is unknown."""
        if self.masses is None or self.velocity:
            return float("nan")
        largest = np.abs(np.stack(self._bounds)).max(axis=(0, 2))[list(members)]
        masses = self.masses[list(members)]
        speeds = np.divide(
            largest, masses, out=np.zeros(masses.shape), where=masses > 0
        )
        return float(masses[~(speeds <= _STILL * speeds.max(initial=0.0))].sum())

    def change(self, members: Sequence[int]) -> float:
        """Return the largest variation of any momentum component of these parts over the record [momentum]."""
        lowest, highest = self._bounds
        return float((highest - lowest)[list(members)].max())

    @cached_property
    def at_rest(self) -> bool:
        """True if all momenta are zero at all times."""
        return not self.values.any()

    @cached_property
    def moving(self) -> tuple[int, ...]:
        """Indices of the moving parts: those with momentum components that vary or differ from each other."""
        lowest, highest = self._bounds
        return tuple(np.flatnonzero(highest.max(axis=1) > lowest.min(axis=1)).tolist())

    @cached_property
    def _bounds(self) -> tuple[Samples, Samples]:
        """Lowest and highest value of each component over the record, shape (parts, 3) [momentum]."""
        return self.values.min(axis=0), self.values.max(axis=0)


class Track(NamedTuple):
    """A vector over time, such as a momentum or a position: ``time`` of shape (n,), ``values`` of shape (n, 3)."""

    time: Samples
    values: Samples


class NodeMotion(NamedTuple):
    """Displacements of the nodes ``ids`` since the start of the run: (n, nodes, 3) over ``time`` (n,) [length]."""

    time: Samples
    ids: tuple[int, ...]
    displacements: Samples


@remember
def _sum_momenta(momenta: Momenta, *members: int) -> Samples:
    """Return the sum of the momenta of the given parts, read-only, shape (n, 3)."""
    return freeze(momenta.values[:, list(members)].sum(axis=1))


@dataclass(frozen=True, eq=False, repr=False)
class Balance:
    """Energies of the whole model at the times ``time``, shape (n,). None stands for an energy that the files lack.

    ``sliding`` is the contact energy, and ``friction`` the part of it that is due to friction; ``damping`` and ``wall``
    are the energies dissipated by damping and at rigid walls. ``external_work`` is the work of all loads, ``total`` the
    total energy according to the solver, ``ratio`` this total divided by the initial energy plus the external work, and
    ``eroded`` the energy of eroded elements. ``artificial`` is the hourglass-control energy of Abaqus, which
    ``internal`` contains, whereas ``internal`` does not contain ``hourglass``. ``velocity`` (n, 3) is that of the
    centre of mass, possibly multiplied by a constant. ``hourglass_of_parts`` contains the highest hourglass and
    internal energies of each part.
    """

    time: Samples
    internal: Samples | None = None
    kinetic: Samples | None = None
    hourglass: Samples | None = None
    artificial: Samples | None = None
    sliding: Samples | None = None
    friction: Samples | None = None
    external_work: Samples | None = None
    total: Samples | None = None
    ratio: Samples | None = None
    eroded: Samples | None = None
    damping: Samples | None = None
    wall: Samples | None = None
    velocity: Samples | None = None
    hourglass_of_parts: tuple[tuple[Part, float, float], ...] = ()
    precision: Precision = EXACT
    memory: Memory = field(default_factory=Memory, init=False)

    @cached_property
    def kinetic_and_internal(self) -> Samples | None:
        """Sum of kinetic, internal and hourglass energy, shape (n,); None if one of the first two is unknown."""
        if self.kinetic is None or self.internal is None:
            return None
        return (
            self.kinetic
            + self.internal
            + (0.0 if self.hourglass is None else self.hourglass)
        )

    @property
    def against_hourglassing(self) -> Samples | None:
        """Hourglass energy, shape (n,), even if the internal energy contains it; None if it is unknown."""
        return self.artificial if self.hourglass is None else self.hourglass

    @cached_property
    def worked(self) -> Samples | None:
        """External work, shape (n,); None if the files do not contain it or if it is always zero."""
        if self.external_work is None or not np.ptp(self.external_work):
            return None
        return self.external_work


@dataclass(frozen=True, eq=False, repr=False)
class Given:
    """Data that show flights in a run, other than the energy of the parts.

    ``momenta`` contains those of the parts and then those of the whole model, as far as they are written. ``balance``
    contains the energies of the whole model; None if only the internal energy is written. ``masses`` contains those of
    the parts with known momenta, in the order of the parts; a value is NaN if it is unknown, and all are None if no
    mass is known. ``forces`` contains those of contacts and rigid walls. ``not_chosen`` contains the parts that a table
    names as not included in its internal energy. ``springs`` contains the springs and dampers of the run, whose energy
    is left out of a sum of part energies. ``written`` contains all data of a switched run whose part data are
    not used, because the parts were rigid at some time.
    """

    momenta: tuple[Momenta, ...] = ()
    balance: Balance | None = None
    masses: Samples | None = None
    forces: tuple[ContactForce, ...] = ()
    not_chosen: tuple[Part, ...] = ()
    springs: tuple[Part, ...] = ()
    written: Given | None = None

    def internal_energies(self, parts: Sequence[Part]) -> Track | None:  # noqa: ARG002  subclasses use the argument
        """Return internal energies of the given parts, ``values`` (n, parts) [energy]; None if the files lack them."""
        return None

    def displacements(self, ids: Sequence[int]) -> NodeMotion | None:
        """Return the displacements of the requested nodes that the files contain; None if they contain none of them."""
        return self.written.displacements(ids) if self.written else None

    def kinetic_energy(self, parts: Sequence[Part] | None) -> Track | None:
        """Return the kinetic energy of given parts or of the model, ``values`` (n,) [energy]; None if it is missing."""
        balance = self.balance
        if parts is not None or balance is None or balance.kinetic is None:
            return None
        return Track(balance.time, balance.kinetic)


NO_EVIDENCE = Given()


@dataclass(frozen=True, eq=False, repr=False)
class History:
    """Internal energy over time of the parts to switch, in the consistent units of the run.

    ``time`` and ``energy`` are read-only copies with finite values, shape (n,); ``time`` increases strictly. Other
    values raise a HistoryError. ``source`` contains the file names as the user gave them, and ``channel`` the name of
    the energy. ``parts`` contains the parts to which the energy belongs, or is None for the whole model; ``springs``
    contains those of them whose energy is excluded. ``energy_format`` is the format of the file with the energy.
    ``complete`` is False if a file ends within a state. ``notes`` are for the user, and ``files`` contains all files
    that were read. ``time_unit`` and ``energy_unit`` are empty unless the file contains them. ``evidence`` shows when
    parts fly freely; it is read from the files at the first request. ``surroundings`` describes the external forces.
    """

    time: Samples
    energy: Samples
    source: tuple[str, ...]
    format: str
    channel: str
    parts: tuple[Part, ...] | None = None
    springs: tuple[Part, ...] = ()
    time_precision: Precision = EXACT
    energy_precision: Precision = EXACT
    time_unit: str = ""
    energy_unit: str = ""
    evidence: Given = NO_EVIDENCE
    surroundings: Surroundings = UNKNOWN
    complete: bool = True
    notes: tuple[str, ...] = ()
    files: tuple[Source, ...] = ()
    energy_format: str = ""
    memory: Memory = field(default_factory=Memory, init=False)

    def __post_init__(self) -> None:
        time = freeze(self.time)
        energy = freeze(self.energy)
        where = ", ".join(self.source)
        if time.ndim != 1 or time.shape != energy.shape:
            shapes = f"{where}: time has shape {time.shape}, energy {energy.shape}"
            raise HistoryError(f"{shapes}; one of each per state expected")
        for name, values in (("time", time), ("energy", energy)):
            is_finite = np.isfinite(values)
            if not is_finite.all():
                bad = int(is_finite.argmin())
                raise HistoryError(
                    f"{where}: {name} of state {bad + 1} is {values[bad]}, but a finite number was expected"
                )
        if np.any(time[1:] <= time[:-1]):
            state = int(np.argmax(np.diff(time) <= 0)) + 1
            raise HistoryError(
                f"{where}: time falls from {time[state - 1]:g} to {time[state]:g} at state {state + 1}"
            )
        object.__setattr__(self, "time", time)
        object.__setattr__(self, "energy", energy)

    @property
    def energy_name(self) -> str:
        """Name of the energy; if it belongs to many parts, only the first of them are named."""
        parts = [part.name for part in self.parts or () if part not in self.springs]
        if len(parts) <= _MOST_NAMED:
            return self.channel
        return f"internal energy of {list_names(parts, most=_MOST_NAMED)}"

    @property
    def momenta(self) -> tuple[Momenta, ...]:
        """Momenta that the files contain: those of the parts first, then that of the whole model."""
        return self.evidence.momenta

    def find_momenta(self, *, of_parts: bool) -> Momenta | None:
        """Return the momenta of the parts, or of the whole model; None if the files do not contain them."""
        for momenta in self.momenta:
            if (momenta.parts is not None) is of_parts:
                return momenta
        return None

    @property
    def masses(self) -> Samples | None:
        """Masses of the parts with known momenta [mass]; NaN for an unknown mass, None if all masses are unknown."""
        return self.evidence.masses

    @property
    def balance(self) -> Balance | None:
        """Energies of the whole model that the files contain."""
        return self.evidence.balance

    @property
    def start(self) -> float:
        """Time of the first state [time]."""
        return float(self.time[0])

    @property
    def end(self) -> float:
        """Time of the last state [time]."""
        return float(self.time[-1])

    @property
    def duration(self) -> float:
        """Time from the first to the last state [time]."""
        return float(self.time[-1] - self.time[0])

    @cached_property
    def step(self) -> float:
        """Largest output interval [time], which limits the vibration frequencies that the record resolves."""
        return float(np.max(np.diff(self.time)))

    @cached_property
    def holes(self) -> tuple[tuple[float, float], ...]:
        """Intervals without states, such as those of a missing restart segment, in ascending order [time]."""
        return find_holes(self.time)

    @property
    def turns(self) -> Samples:
        """Times of the states at which the energy has an extremum, in ascending order [time]."""
        return self._turns[0]

    @cached_property
    def peaks(self) -> Samples:
        """Times of the states at which the energy has a maximum, in ascending order [time]."""
        return np.asarray(self.turns[self._turns[1]])

    @cached_property
    def _turns(self) -> tuple[Samples, NDArray[np.bool_]]:
        """Times of the energy extrema, and a mask that is True for maxima."""
        indices, are_peaks = find_turns(self.energy)
        return self.time[indices], are_peaks

    @property
    def missing_legs(self) -> list[str]:
        """Restart segments in the folder that precede the first of the files, if the record begins after 0."""
        if self.time.size < 2 or self.start <= self.step:
            return []
        # Imported here to keep start-up fast.
        from d2rpick.histories.source import find_earlier_legs

        return find_earlier_legs(self.source)

    @property
    def left_beside(self) -> str:
        """A question about later restart segments that the user did not name; empty if the folder contains none."""
        # Imported here to keep start-up fast.
        from d2rpick.histories.source import find_later_legs

        legs = find_later_legs(self.source)
        if not legs:
            return ""
        if len(legs) == 1:
            return f"; in the same folder is {legs[0]}, a later restart segment of the run? Name it too"
        return f"; in the same folder are {', '.join(legs)}, later restart segments of the run? Name them too"

    def check(self, *times: float, argument: str = "", subject: str = "") -> None:
        """Raise RangeError if a time lies outside the record.

        The message names the ``argument`` that the user gave or, without it, calls the times ``subject``.
        """
        low = self.time[0]
        high = self.time[-1]
        if all(low <= time <= high for time in times):
            return
        from d2rpick.histories.digits import ask_for_smaller_unit

        is_late = max(times) > high
        hint = self.left_beside if is_late else ""
        if not hint and argument:
            hint = ask_for_smaller_unit(self.time, times, argument)
        if not hint and subject:
            hint = f"; do all files belong to the same run? {self._advise_on_files()}"
        if is_late and not self.complete:
            cure = hint or f"; {COPY_AGAIN}, or give a time within the record"
            hint = f", where the file is cut{cure}"
        elif not hint:
            some_times = "times" if len(times) > 1 else "a time"
            hint = f"; give {some_times} within it"
        *values, first, last = format_distinctly((*times, low, high))
        if argument:
            described = f"`{argument}` {' '.join(values)}"
        elif subject:
            span = f"from {' to '.join(values)}" if len(values) > 1 else values[0]
            described = f"{subject} {span},"
        else:
            described = f"time {' '.join(values)}"
        verb = "reaches" if any(low <= time <= high for time in times) else "lies"
        raise RangeError(
            f"{', '.join(self.source)}: {described} {verb} outside the record, {first} to {last}{hint}"
        )

    def _advise_on_files(self) -> str:
        """Return the advice for files that may belong to several runs: the first one may be the odd one."""
        if len(self.source) == 1:
            return "If not, give the files of one run only"
        energies, *others = self.source
        return f"If not, leave out {energies}, which has the energies, or {list_names(others, most=3)}"

    def check_pair(self, tr: float, td: float, place: str = "") -> None:
        """Raise RangeError if both times of a pair lie outside the record and fit it in a smaller unit.

        The message begins with the ``place`` of the pair, such as a file; without one, it names the arguments.
        """
        low, high = self.time[0], self.time[-1]
        if low <= tr <= high or low <= td <= high:
            return
        from d2rpick.histories.digits import find_smaller_unit

        unit, values = find_smaller_unit(self.time, (tr, td))
        if not unit:
            return
        first_tr, first_td, first, last = format_distinctly((tr, td, low, high))
        record = f"outside the record of {', '.join(self.source)}, {first} to {last}"
        asked = f"were they meant in {unit}? Then give"
        if place:
            problem = (
                f"{place}: tr = {first_tr} and td = {first_td} lie {record}; {asked}"
            )
            raise RangeError(
                f"{problem} {values[0]:g} {values[1]:g}, in the unit of the record"
            )
        raise RangeError(
            f"`tr` {first_tr} and `td` {first_td} lie {record}; {asked} `tr` {values[0]:g} `td` {values[1]:g}, in the "
            "unit of the record"
        )

    def check_length(self, length: float, *, argument: str) -> None:
        """Raise RangeError if an ``argument`` of the user is longer than the record [time]."""
        if length <= self.duration:
            return
        from d2rpick.histories.digits import ask_for_smaller_unit

        hint = ask_for_smaller_unit(self.time, (length,), argument)
        value, duration = format_distinctly((length, self.duration))
        raise RangeError(
            f"{', '.join(self.source)}: `{argument}` {value} is longer than the record, {duration}"
            f"{hint or '; give a shorter time'}"
        )

    def check_unit(self, *times: float, argument: str) -> None:
        """Raise RangeError if the times of an ``argument`` seem to be in a different unit from those of the record."""
        # A time above 1/1000 of the end of the record has the right unit, so no further check is needed.
        if times[-1] * 1e3 > self.time[-1]:
            return
        from d2rpick.histories.digits import ask_for_larger_unit

        meant = ask_for_larger_unit(self.time, times, argument, self.time_unit)
        if meant:
            *values, first, last = format_distinctly(
                (*times, self.time[0], self.time[-1])
            )
            problem = f"`{argument}` {' '.join(values)} lies within the first ten states of the record"
            raise RangeError(
                f"{', '.join(self.source)}: {problem}, {first} to {last}{meant}"
            )

    def energy_at(self, time: float, argument: str = "") -> float:
        """Return the energy at ``time``, interpolated linearly.

        A time outside the record raises a RangeError that names the ``argument``.
        """
        self.check(time, argument=argument)
        index = max(int(np.searchsorted(self.time, time, side="right")) - 1, 0)
        # A slice is passed, because numpy would copy the complete read-only array.
        cell = slice(index, index + 2)
        return float(np.interp(time, self.time[cell], self.energy[cell]))

    def energies_at(self, times: Samples) -> Samples:
        """Return the energies at times within the record, interpolated linearly, in the shape of the times."""
        if times.ndim == 1 and times.size > _TOGETHER:
            pieces = np.array_split(times, times.size // _TOGETHER + 1)
            return np.concatenate([self.energies_at(piece) for piece in pieces])
        last_index = self.time.size - 1
        states_before = np.searchsorted(self.time, times, side="right") - 1
        start = np.clip(states_before, 0, max(last_index - 1, 0))
        end = np.minimum(start + 1, last_index)
        t0 = self.time[start]
        e0 = self.energy[start]
        t1 = self.time[end]
        e1 = self.energy[end]
        slope = np.divide(
            e1 - e0, t1 - t0, out=np.zeros(np.shape(times)), where=t1 > t0
        )
        return np.where(times >= t1, e1, slope * (times - t0) + e0)

    def mean_energy(self, start: float, end: float) -> float | None:
        """Return the mean energy of the states in a window [energy]; None if the window contains no state."""
        energy = self.between(start, end)[1]
        return float(energy.mean()) if energy.size else None

    def between(self, start: float, end: float) -> tuple[Samples, Samples]:
        """Return the times [time] and energies [energy] of the states from ``start`` to ``end``, both included."""
        inside = find_window(self.time, start, end)
        return self.time[inside], self.energy[inside]


def list_columns(record: History | Balance | Momenta) -> dict[str, NDArray[Any]]:
    """Return the arrays of a record that have one row per time, by name; this excludes the masses of parts."""
    columns: dict[str, NDArray[Any]] = {}
    for record_field in fields(record):
        values = getattr(record, record_field.name)
        is_given = record_field.init and record_field.name != "masses"
        if (
            is_given
            and isinstance(values, np.ndarray)
            and len(values) == record.time.size
        ):
            columns[record_field.name] = values
    return columns


def select_states(
    record: Record, states: slice | NDArray[np.bool_ | np.intp]
) -> Record:
    """Return a record with only the selected states. Part masses do not change, because they do not depend on time."""
    columns = list_columns(record)
    rows: dict[str, Any] = {name: values[states] for name, values in columns.items()}
    return replace(record, **rows)


def freeze(values: ArrayLike) -> Samples:
    """Return values as a read-only array of doubles; an array that already has this form is not copied."""
    if (
        isinstance(values, np.ndarray)
        and values.dtype == np.float64
        and not values.flags.writeable
    ):
        whole: object = values if values.base is None else values.base
        if (
            isinstance(whole, np.ndarray)
            and whole.size == values.size
            and not whole.flags.writeable
        ):
            return values
    copy = np.array(values, dtype=np.float64)
    copy.flags.writeable = False
    return copy
