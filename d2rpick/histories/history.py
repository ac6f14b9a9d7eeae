"""What is read of one run: its internal energy over time, checked, its momenta, and how finely they were printed."""

from __future__ import annotations

from dataclasses import dataclass, field, fields, replace
from typing import TYPE_CHECKING, Any, Final, TypeAlias, TypeVar

import numpy as np

from d2rpick.base.caching import cached_property
from d2rpick.base.errors import HistoryError, RangeError
from d2rpick.base.tuples import NamedTuple
from d2rpick.histories.digits import told_apart
from d2rpick.histories.samples import find_turns, window
from d2rpick.histories.surroundings import UNKNOWN, Surroundings

if TYPE_CHECKING:
    from collections.abc import Callable, Hashable, Sequence

    from numpy.typing import ArrayLike, NDArray

    from d2rpick.histories.contact_forces import ContactForce
    from d2rpick.histories.names import Part
    from d2rpick.histories.source import Source

# in quotes: numpy.typing costs start-up
Samples: TypeAlias = "NDArray[np.float64]"
_Found = TypeVar("_Found")
Record = TypeVar("Record", bound="History | Balance | Momenta")

# Beyond, squares of energies are no numbers any more; no unit system comes near.
LARGEST_ENERGY: Final = 1e150
# Parts slower than this share of the fastest stand still: single precision leaves them a speed.
_STILL: Final = 1e-6
# Times whose energies are looked up together: what is needed for more would take a multiple of the record's memory.
_TOGETHER: Final = 1 << 14


class Precision(NamedTuple):
    """How finely the numbers of a column were written.

    ``digits`` significant digits (17 restores every double), or, when ``decimals`` is given, a fixed
    number of places behind the point.
    """

    digits: int = 17
    decimals: int | None = None

    def quantum(self, value: float) -> float:
        """Distance between neighbouring printable numbers around ``value`` [unit of value].

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
        """The same around each of ``values``."""
        if self.decimals is not None:
            return np.full(values.shape, 10.0**-self.decimals)
        sizes = np.abs(values)
        powers = (
            np.floor(np.log10(sizes, out=np.zeros(sizes.shape), where=sizes > 0))
            - self.digits
            + 1
        )
        return np.where(sizes > 0, 10.0**powers, 0.0)

    def noise(self, values: Samples) -> float:
        """What printed digits leave open in values, half a quantum of the largest [unit of the values]."""
        return self.quantum(float(np.abs(values).max())) / 2


EXACT = Precision()


class Memory:
    """What was found in a record, each made once: the same few things are asked for often."""

    def __init__(self) -> None:
        self._found: dict[Hashable, Any] = {}

    def once(self, key: Hashable, make: Callable[[], _Found]) -> _Found:
        """Make what is not known yet by this key."""
        if key not in self._found:
            self._found[key] = make()
        found: _Found = self._found[key]
        return found

    def __reduce__(self) -> tuple[type[Memory], tuple[()]]:
        return Memory, ()  # in another process all is found anew


@dataclass(frozen=True, eq=False, repr=False)
class Momenta:
    """Momentum of ``parts`` over ``time`` (n,): ``values`` of shape (n, parts, 3); None for parts: the whole model.

    ``precision`` is that of the printed numbers; ``chosen`` are the indices of the parts to switch, ``flying``
    those of the set that is known to fly together, if it is.  ``masses`` of shape (parts,), NaN where unknown; None
    where none are [mass].  ``velocity``: velocities stand for the momenta, of a mass that is not known.
    ``surroundings`` act from outside.  ``known``: what was found of sets of parts: the same few are asked for often.
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
    known: Memory = field(default_factory=Memory, init=False)

    def choosing(
        self, chosen: tuple[int, ...], flying: tuple[int, ...] | None = None
    ) -> Momenta:
        """Give the same momenta with other parts to switch; what was found of them stays ``known``."""
        made = replace(self, chosen=chosen, flying=flying)
        object.__setattr__(made, "known", self.known)
        return made

    def of(self, members: Sequence[int]) -> Samples:
        """Sum over the parts with these indices, shape (n, 3), read-only."""
        return self.known.once(
            ("sum", *members), lambda: frozen(self.values[:, list(members)].sum(axis=1))
        )

    def noise(self, members: Sequence[int]) -> float:
        """What the printed digits of these parts leave open in their sum [momentum]."""
        largest = np.abs(np.stack(self._bounds))[:, list(members)].max(
            axis=(0, 2), initial=0.0
        )
        return sum(self.precision.quantum(value) for value in largest.tolist()) / 2

    def mass(self, members: Sequence[int]) -> float:
        """Mass of those of the parts with these indices that ever move, NaN where one is unknown [mass]."""
        if self.masses is None or self.velocity:
            return float("nan")
        largest = np.abs(np.stack(self._bounds)).max(axis=(0, 2))[list(members)]
        masses = self.masses[list(members)]
        speeds = np.divide(
            largest, masses, out=np.zeros(masses.shape), where=masses > 0
        )
        return float(masses[~(speeds <= _STILL * speeds.max(initial=0.0))].sum())

    def change(self, members: Sequence[int]) -> float:
        """Largest range that a component of one of these parts has over the record [momentum]."""
        lowest, highest = self._bounds
        return float((highest - lowest)[list(members)].max())

    @cached_property
    def at_rest(self) -> bool:
        """Whether nothing ever has any momentum."""
        return not self.values.any()

    @cached_property
    def moving(self) -> tuple[int, ...]:
        """Indices of the parts whose components are not all the same number."""
        lowest, highest = self._bounds
        return tuple(np.flatnonzero(highest.max(axis=1) > lowest.min(axis=1)).tolist())

    @cached_property
    def _bounds(self) -> tuple[Samples, Samples]:
        """Lowest and highest value of each component over the record, shape (parts, 3) [momentum]."""
        return self.values.min(axis=0), self.values.max(axis=0)


class Track(NamedTuple):
    """Values over time: ``time`` of shape (n,), ``values`` of shape (n, 3) for a momentum or the place of a part."""

    time: Samples
    values: Samples


@dataclass(frozen=True, eq=False, repr=False)
class Balance:
    """Energies of the whole model at ``time``, arrays of shape (n,); None for what the files do not have.

    ``sliding`` is the energy of contacts, ``friction`` its share by friction, ``damping`` and ``wall`` what damping and
    rigid walls have taken, ``external_work`` that of all loads, ``total`` the sum that the solver keeps, ``ratio`` that
    sum over initial energy and external work, ``eroded`` that of deleted elements.  ``artificial`` is what Abaqus
    spends against hourglassing, a part of ``internal``; ``hourglass`` is beside it.  ``velocity`` (n, 3) is that of the
    centre of mass, up to a factor, ``hourglass_of_parts`` their highest hourglass and internal energy.
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
    known: Memory = field(default_factory=Memory, init=False)

    @cached_property
    def kinetic_and_internal(self) -> Samples | None:
        """Kinetic and internal energy together, with that of hourglassing, of shape (n,); None where one is unknown."""
        if self.kinetic is None or self.internal is None:
            return None
        return (
            self.kinetic
            + self.internal
            + (0.0 if self.hourglass is None else self.hourglass)
        )

    @property
    def against_hourglassing(self) -> Samples | None:
        """Energy (n,) spent against hourglassing, be it a part of the internal energy or beside it; None if unknown."""
        return self.artificial if self.hourglass is None else self.hourglass

    @cached_property
    def worked(self) -> Samples | None:
        """External work (n,); None where it is not written, or none is ever done."""
        return (
            None
            if self.external_work is None or not np.ptp(self.external_work)
            else self.external_work
        )


@dataclass(frozen=True, eq=False, repr=False)
class Given:
    """What tells when the parts fly, beside their energy.

    ``momenta`` of the parts, then of the whole model, as far as they are written.  ``balance``: energies of the whole
    model; None where none are written beside the internal energy.  ``masses`` of the parts whose momenta are known, in
    their order, NaN where unknown; None where none are.  ``forces`` of contacts and rigid walls.
    """

    momenta: tuple[Momenta, ...] = ()
    balance: Balance | None = None
    masses: Samples | None = None
    forces: tuple[ContactForce, ...] = ()

    def internal_energies(self, parts: Sequence[Part]) -> Track | None:  # noqa: ARG002  what files hold is read below
        """Internal energies of some parts, ``values`` of shape (n, parts) [energy]; None if they are not written."""
        return None

    def kinetic_energy(self, parts: Sequence[Part] | None) -> Track | None:
        """Kinetic energy of some parts together, or of the model, ``values`` (n,) [energy]; None if not written."""
        balance = self.balance
        if parts is not None or balance is None or balance.kinetic is None:
            return None
        return Track(balance.time, balance.kinetic)


NO_EVIDENCE = Given()


@dataclass(frozen=True, eq=False, repr=False)
class History:
    """Internal energy of the parts to switch, over time, in the run's own consistent units.

    ``time`` and ``energy`` are read-only copies, finite, of shape (n,); ``time`` increases strictly.  Anything else
    raises HistoryError.  ``source`` names the files as the user gave them, ``channel`` what in them was taken for the
    energy, ``parts`` whose energy it is, None for the whole model; ``springs`` are those of them whose energy is left
    out; ``energy_format`` is that of the file which holds it.  ``complete`` is False when a file stopped inside a
    state; ``notes`` say what was left out; ``files`` were read.  Where the energy is a sum, ``part_names`` (k,) and
    ``part_energies`` (n, k) are its terms that are not always zero.  ``time_unit`` is given only where the file names
    it.  ``evidence`` tells when parts fly freely; that of a file is read when it is first asked for.  ``surroundings``
    act on them from outside.
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
    part_names: tuple[str, ...] = ()
    part_energies: Samples | None = None
    evidence: Given = NO_EVIDENCE
    surroundings: Surroundings = UNKNOWN
    complete: bool = True
    notes: tuple[str, ...] = ()
    files: tuple[Source, ...] = ()
    energy_format: str = ""
    known: Memory = field(default_factory=Memory, init=False)

    def __post_init__(self) -> None:
        time, energy = frozen(self.time), frozen(self.energy)
        where = ", ".join(self.source)
        if time.ndim != 1 or time.shape != energy.shape:
            found = f"{where}: time has shape {time.shape}, energy {energy.shape}"
            raise HistoryError(f"{found}; one of each per state expected")
        for name, values in (("time", time), ("energy", energy)):
            known = np.isfinite(values)
            if not known.all():
                bad = int(known.argmin())
                found = f"{where}: {name} of state {bad + 1} is {values[bad]}"
                raise HistoryError(f"{found}, a finite number was expected")
        if np.any(time[1:] <= time[:-1]):
            state = int(np.argmax(np.diff(time) <= 0)) + 1
            raise HistoryError(
                f"{where}: time falls from {time[state - 1]:g} to {time[state]:g} at state {state + 1}"
            )
        if self.part_energies is not None:
            terms = frozen(self.part_energies)
            if terms.shape != (time.size, len(self.part_names)):
                found = f"{where}: the energies of {len(self.part_names)} parts have shape {terms.shape}, ({time.size}"
                raise HistoryError(f"{found}, {len(self.part_names)}) was expected")
            object.__setattr__(self, "part_energies", terms)
        object.__setattr__(self, "time", time)
        object.__setattr__(self, "energy", energy)

    @property
    def momenta(self) -> tuple[Momenta, ...]:
        """Momenta of the parts, then of the whole model, as far as they are known."""
        return self.evidence.momenta

    @property
    def masses(self) -> Samples | None:
        """Masses of the parts whose momenta are known, NaN where unknown; None where none are known [mass]."""
        return self.evidence.masses

    @property
    def balance(self) -> Balance | None:
        """Energies of the whole model, as far as they are known."""
        return self.evidence.balance

    @cached_property
    def step(self) -> float:
        """Largest output interval [time]: how coarsely the record samples its vibration."""
        return float(np.max(np.diff(self.time)))

    @property
    def turns(self) -> Samples:
        """Times of the states at which the energy turns, ascending [time]."""
        return self._turns[0]

    @cached_property
    def peaks(self) -> Samples:
        """Those of them at which it peaks [time]."""
        return np.asarray(self.turns[self._turns[1]])

    @cached_property
    def _turns(self) -> tuple[Samples, NDArray[np.bool_]]:
        places, are_peaks = find_turns(self.energy)
        return self.time[places], are_peaks

    @property
    def left_beside(self) -> str:
        """Words on later legs of the run that lie beside its files and were not named; none where none do."""
        from d2rpick.histories.source import (
            later_legs,
        )  # not above: pathlib costs start-up

        legs = later_legs(self.source)
        return (
            f"; beside it lies {', '.join(legs)}, a later leg of the run? Name it too"
            if legs
            else ""
        )

    def check(self, *times: float, argument: str = "") -> None:
        """Raise RangeError unless all times of an ``argument`` lie in the record."""
        low, high = self.time[0], self.time[-1]
        if all(low <= time <= high for time in times):
            return
        from d2rpick.histories.digits import in_smaller_unit

        more = self.left_beside if max(times) > high else ""
        more = more or (in_smaller_unit(self.time, times, argument) if argument else "")
        *asked, first, last = told_apart((*times, low, high))
        what = f"{f'`{argument}`' if argument else 'time'} {' '.join(asked)}"
        found = "reaches" if any(low <= time <= high for time in times) else "lies"
        more = (
            ", where the file is cut" if max(times) > high and not self.complete else ""
        ) + more
        raise RangeError(
            f"{', '.join(self.source)}: {what} {found} outside the record, {first} to {last}{more}"
        )

    def check_unit(self, *times: float, argument: str) -> None:
        """Raise RangeError where times of an ``argument`` that lie in the record look to be in another unit than it."""
        if times[-1] * 1e3 > self.time[-1]:  # as nearly always
            return
        from d2rpick.histories.digits import in_larger_unit

        meant = in_larger_unit(self.time, times, argument, self.time_unit)
        if meant:
            *asked, first, last = told_apart((*times, self.time[0], self.time[-1]))
            where = f"`{argument}` {' '.join(asked)} lies within the first ten states of the record"
            raise RangeError(
                f"{', '.join(self.source)}: {where}, {first} to {last}{meant}"
            )

    def energy_at(self, time: float, argument: str = "") -> float:
        """Energy at ``time``, linear between the states; RangeError outside the record, naming the ``argument``."""
        self.check(time, argument=argument)
        before = max(int(np.searchsorted(self.time, time, side="right")) - 1, 0)
        cell = slice(
            before, before + 2
        )  # of whole arrays that are read-only, numpy would make copies
        return float(np.interp(time, self.time[cell], self.energy[cell]))

    def energies_at(self, times: Samples) -> Samples:
        """Energies at many times within the record, linear between the states, of their shape."""
        if times.ndim == 1 and times.size > _TOGETHER:
            pieces = np.array_split(times, times.size // _TOGETHER + 1)
            return np.concatenate([self.energies_at(piece) for piece in pieces])
        before = np.clip(
            np.searchsorted(self.time, times, side="right") - 1,
            0,
            max(self.time.size - 2, 0),
        )
        after = np.minimum(before + 1, self.time.size - 1)
        (t0, e0), (t1, e1) = (
            (self.time[at], self.energy[at]) for at in (before, after)
        )
        slope = np.divide(
            e1 - e0, t1 - t0, out=np.zeros(np.shape(times)), where=t1 > t0
        )
        return np.where(times >= t1, e1, slope * (times - t0) + e0)

    def mean_energy(self, start: float, end: float) -> float | None:
        """Mean energy of the states in a window; None where there is none [energy]."""
        energy = self.between(start, end)[1]
        return float(energy.mean()) if energy.size else None

    def between(self, start: float, end: float) -> tuple[Samples, Samples]:
        """Times and energies of the states from ``start`` to ``end``, both included [time], [energy]."""
        inside = window(self.time, start, end)
        return self.time[inside], self.energy[inside]


def rows_of(record: Record, states: slice | NDArray[np.bool_]) -> Record:
    """Give some states of a record alone: of all its arrays of as many rows as it has times, but masses of parts."""
    names, size = (
        {one.name for one in fields(record) if one.init} - {"masses"},
        record.time.size,
    )
    values = {name: getattr(record, name) for name in names}
    rows = {
        name: one[states]
        for name, one in values.items()
        if isinstance(one, np.ndarray) and len(one) == size
    }
    return replace(record, **rows)  # type: ignore[arg-type]


def frozen(values: ArrayLike) -> Samples:
    """Copy what could change, or holds more in memory than itself."""
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
