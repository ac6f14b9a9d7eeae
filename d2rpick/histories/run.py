"""Run: all files of one run, and what of them is taken for the energy to be locked in."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace
from functools import partial
from itertools import compress
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from d2rpick.base.caching import cached_property
from d2rpick.base.errors import FormatError, if_written, listing
from d2rpick.histories.database import check_sum, doubts
from d2rpick.histories.history import Balance, Given, History, Momenta, Samples, Track
from d2rpick.histories.meaning import (
    is_any_internal_energy,
    note_other_quantity,
    note_unused_energies,
)
from d2rpick.histories.names import QUANTITIES, Part, Selection, menu, select_parts
from d2rpick.histories.samples import median
from d2rpick.histories.surroundings import UNKNOWN, Surroundings
from d2rpick.histories.table_forces import forces_of

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from d2rpick.histories.contact_forces import ContactForce
    from d2rpick.histories.database import Legs
    from d2rpick.histories.source import Source

_AXES = ("x_momentum", "y_momentum", "z_momentum")
_VELOCITIES = ("x_rbvelocity", "y_rbvelocity", "z_rbvelocity")
_CENTRES = ("x_center", "y_center", "z_center")

NO_STATES: Final = "no states; did the run reach its first output?"


class Run:
    """Databases of one run, one per format, those that say most of it first.

    ``sources`` name their files; ``files`` are what was read of them.  ``surroundings`` act on the model from outside.
    ``reopen`` opens the same files again within other surroundings: so it is copied, also to another process.
    ``notes`` say which files were not used; ``forces`` are those of files that hold nothing else.
    """

    def __init__(
        self,
        sources: tuple[str, ...],
        databases: tuple[Legs, ...],
        files: tuple[Source, ...] = (),
        surroundings: Surroundings = UNKNOWN,
        notes: tuple[str, ...] = (),
        forces: tuple[ContactForce, ...] = (),
        reopen: Callable[[Surroundings], Run] | None = None,
    ) -> None:
        self.sources, self.databases, self.files, self.surroundings = (
            sources,
            databases,
            files,
            surroundings,
        )
        self._notes, self._forces, self._reopen = notes, forces, reopen

    def __reduce__(self) -> tuple[Any, ...]:
        if self._reopen is None:
            raise TypeError(
                f"{self.name}: only a run that was opened from files can be copied"
            )
        return self._reopen, (self.surroundings,)

    def within(self, surroundings: Surroundings) -> Run:
        """Give the same run with what is known of its surroundings."""
        return Run(
            self.sources,
            self.databases,
            self.files,
            surroundings,
            self._notes,
            self._forces,
            self._reopen,
        )

    @property
    def name(self) -> str:
        """The files, for messages."""
        return ", ".join(self.sources)

    @property
    def parts(self) -> tuple[Part, ...]:
        """Parts with histories of their own."""
        holder = self._with_parts()
        return holder.parts if holder else ()

    @property
    def left_out(self) -> tuple[str, ...]:
        """Which files were not used, and why."""
        return self._notes

    @cached_property
    def notes(self) -> tuple[str, ...]:
        """What a user should know about the files."""
        own = (note for database in self.databases for note in database.notes)
        return tuple(dict.fromkeys([*self._notes, *own, *doubts(self.databases)]))

    def history(self, selection: Selection) -> History:
        """Take the selected energy: of parts, of named channels, or by default of the whole model.

        FormatError when something is not there, with what there is.
        """
        history = self._energy(selection)
        notes = (*history.notes, *self.unused_energies(selection))
        flying = (
            select_parts(selection.flying, self.parts, self.name)
            if selection.flying
            else None
        )
        evidence = _Written(self, history.parts, flying)
        return replace(
            history, evidence=evidence, surroundings=self.surroundings, notes=notes
        )

    def unused_energies(self, selection: Selection) -> tuple[str, ...]:
        """Return notes on the channels of tables that look like energies but are neither selected nor understood."""
        notes: list[str] = []
        for database in self.databases:
            if not database.named_by_people or not database.channels:
                continue
            chosen = if_written(partial(_selected_channels, database, selection))
            if chosen is not None:
                notes += note_unused_energies(
                    database.channels, {*chosen, *database.quantities.values()}
                )
        return tuple(notes)

    def momenta(
        self, chosen: Sequence[Part] | None, flying: Sequence[Part] | None
    ) -> tuple[Momenta, ...]:
        """Give the momentum of the parts and that of the whole model, as far as they are written.

        ``chosen`` are the parts to switch (None: all), ``flying`` those known to fly together, if they are.
        """
        of_parts, of_whole = self._part_momenta, self._whole_momentum
        if of_parts and of_parts.parts:
            ids = [part.id for part in of_parts.parts]
            members = tuple(
                ids.index(part.id) for part in chosen or self._free(of_parts.parts)
            )
            known = tuple(ids.index(part.id) for part in flying) if flying else None
            of_parts = of_parts.choosing(members, known)
        return tuple(one for one in (of_parts, of_whole) if one)

    def _free(self, parts: Sequence[Part]) -> Sequence[Part]:
        """Give those of all parts that nothing holds, or all where each is held."""
        return [
            part for part in parts if not self.surroundings.supports_of([part])
        ] or parts

    @cached_property
    def _part_momenta(self) -> Momenta | None:
        """Momenta of all parts; None where they are not written, or not for all parts."""
        holder = self._with_parts()
        if holder is None:
            return None
        values = if_written(
            lambda: np.stack(
                [self._of_holder(axis, holder.parts) for axis in _AXES], axis=2
            )
        )
        if values is None or not values.size:
            return None  # it cannot say what flies together
        precision = holder.precisions(())[1]
        masses = self._least_masses(values, holder)
        return Momenta(
            holder.part_time,
            values,
            holder.parts,
            precision,
            (),
            masses=masses,
            surroundings=self.surroundings,
        )

    @cached_property
    def masses(self) -> Samples | None:
        """Masses of the parts whose momenta are written, in their order, NaN where unknown [mass].

        As written, or momentum over velocity along the axis with most momentum; None where neither is.
        """
        momenta, holder = self._part_momenta, self._with_parts()
        return self._masses(momenta.values, holder) if momenta and holder else None

    def _masses(self, momenta: Samples, holder: Legs) -> Samples | None:
        with suppress(FormatError):
            return _median_of_some(self._of_holder("mass", holder.parts))
        axis = int(np.abs(momenta).sum(axis=(0, 1)).argmax())
        velocity, momentum = (
            if_written(lambda: self._of_holder(_VELOCITIES[axis], holder.parts)),
            momenta[:, :, axis],
        )
        if velocity is None:
            return None
        square, product = (velocity**2).sum(axis=0), (velocity * momentum).sum(axis=0)
        massless = ~momentum.any(axis=0) & ~velocity.any(axis=0)
        return np.where(
            massless,
            0.0,
            np.divide(
                product, square, out=np.full(square.shape, np.nan), where=square > 0
            ),
        )

    def _least_masses(self, momenta: Samples, holder: Legs) -> Samples | None:
        """Masses of the parts; of a part that writes none, the least that has its momentum at its kinetic energy."""
        from d2rpick.histories.balance import least_masses

        masses = self._masses(momenta, holder)
        if masses is None or not np.isnan(masses).any():
            return masses
        kinetic = if_written(lambda: self.part_kinetic_energies(holder.parts))
        return (
            masses
            if kinetic is None
            else np.where(np.isnan(masses), least_masses(momenta, kinetic), masses)
        )

    @cached_property
    def contact_forces(self) -> tuple[ContactForce, ...]:
        """Forces of contacts and rigid walls, of each the first that a file tells."""
        written = (
            if_written(partial(forces_of, database)) or ()
            for database in self.databases
        )
        named: dict[str, ContactForce] = {}
        for force in (
            *(force for forces in written for force in forces),
            *self._forces,
        ):
            named.setdefault(force.name, force)
        return tuple(named.values())

    @cached_property
    def _whole_momentum(self) -> Momenta | None:
        """Momentum of the whole model, or its velocity; None if not written."""
        from d2rpick.histories.balance import momentum_of

        found = (
            momentum_of(database) for database in self.databases if database.channels
        )
        written = next(filter(None, found), None)
        return written and replace(written, surroundings=self.surroundings)

    def momentum(self, parts: Sequence[Part] | None) -> Track | None:
        """Give the momentum of some parts together, or of the whole model; None where it is not written."""
        of_parts = parts is not None
        found = next(
            (
                one
                for one in self.momenta(parts, None)
                if (one.parts is not None) == of_parts
            ),
            None,
        )
        return Track(found.time, found.of(found.chosen)) if found else None

    @property
    def part_time(self) -> Samples:
        """Times of the states of single parts [time]."""
        return self._holder().part_time

    @cached_property
    def springs(self) -> tuple[Part, ...]:
        """Parts of springs and dampers, as far as their energies tell."""
        from d2rpick.histories.balance import springs_among

        parts = self.parts
        energies = (
            if_written(lambda: self.part_energies(parts)) if parts else None
        )  # not in every state
        return (
            ()
            if energies is None
            else springs_among(self.databases, parts, energies, self.part_time)
        )

    def part_energies(self, parts: Sequence[Part]) -> Samples:
        """Internal energies of some parts, shape (n, parts), at the times of their history [energy]."""
        return self._of_holder("internal_energy", parts)

    def part_kinetic_energies(self, parts: Sequence[Part]) -> Samples:
        """Kinetic energies of some parts, shape (n, parts) [energy]; FormatError where they are not written."""
        return self._of_holder("kinetic_energy", parts)

    def quantities(self, time: Samples) -> dict[str, Samples]:
        """Give the quantities of the whole model, by their names in `QUANTITIES`, that are written at ``time`` (n,)."""
        found: dict[str, Samples] = {}
        for database in self.databases:
            if not database.channels or not np.array_equal(database.time, time):
                continue
            for quantity in QUANTITIES:
                if quantity in database.quantities and quantity not in found:
                    with suppress(FormatError):  # not in every state
                        found[quantity] = database.channel(
                            database.quantities[quantity]
                        )
        return found

    def centre(self, parts: Sequence[Part]) -> Track | None:
        """Give the mean of the centres of some parts [length]; None where they are not written."""
        places = if_written(
            lambda: [self._of_holder(axis, parts).mean(axis=1) for axis in _CENTRES]
        )
        return (
            None if places is None else Track(self.part_time, np.stack(places, axis=1))
        )

    def _of_holder(self, quantity: str, parts: Sequence[Part]) -> Samples:
        return self._holder().part_channel(quantity, [part.id for part in parts])

    def _energy(self, selection: Selection) -> History:
        if all(database.span is None for database in self.databases):
            raise FormatError(f"{self.name}: {NO_STATES}")
        if selection.parts:
            chosen = select_parts(selection.parts, self._holder().parts, self.name)
            named = selection.springs
            springs = (
                self.springs
                if named is None
                else tuple(part for part in self.parts if str(part.id) in named)
            )
            return self._of_parts(chosen, springs)
        if selection.energy:
            return self._of_channels(selection.energy)
        for database in self.databases:
            if database.energy_channel is not None:
                return self._without_springs(database, database.energy_channel)
        return self._of_all_parts()

    def _holder(self) -> Legs:
        """The database that knows parts; FormatError with what there is instead of them."""
        holder = self._with_parts()
        if holder is None:
            self.databases[0].part_channel(
                "internal_energy", ()
            )  # knows best why there are none
            raise FormatError(
                f"{self.name}: no parts with histories of their own; let the run write them"
            )
        return holder

    def _with_parts(self) -> Legs | None:
        return next((database for database in self.databases if database.parts), None)

    def _of_parts(
        self, chosen: tuple[Part, ...], springs: tuple[Part, ...] = ()
    ) -> History:
        holder = self._holder()
        energies = self.part_energies(chosen)
        for database in self.databases:
            check_sum(database, holder, energies)
        left_out = np.array([part in springs for part in chosen])
        if not energies[:, ~left_out].any():  # springs are all that has energy
            left_out[:] = False
        idle = [
            part
            for part, energy in zip(chosen, energies.T, strict=True)
            if not energy.any()
        ]
        notes = (
            (
                f"without any internal energy: part {menu(idle)}; rigid, or without elements?",
            )
            if idle
            else ()
        )
        every = [part.name for part in chosen]
        names, apart = list(compress(every, ~left_out)), list(compress(every, left_out))
        channel = "internal energy of " + ", ".join(names)
        if apart:
            notes = (*notes, _left_out(", ".join(apart)))
        energies = energies[:, ~left_out]
        history = self._history_of(
            holder, holder.part_time, energies.sum(axis=1), channel, (), notes, chosen
        )
        return _with_terms(
            replace(history, springs=tuple(compress(chosen, left_out))), names, energies
        )

    def _without_springs(self, database: Legs, channel: str) -> History:
        """Take the energy of the whole model, less that of springs and dampers where it has other energy too."""
        from d2rpick.histories.balance import spring_energy

        whole, springs = self._of_channels((channel,)), spring_energy(database)
        if springs is None:
            return whole
        rest = whole.energy - springs[1]
        note = _left_out(f"all springs and dampers, {springs[0]},")
        return replace(
            whole,
            energy=rest,
            channel=f"{channel} - {springs[0]}",
            notes=(*whole.notes, note),
        )

    def _of_all_parts(self) -> History:
        if not self.parts:
            there = listing(
                [name for database in self.databases for name in database.channels]
            )
            found = f"{self.name}: no internal energy"
            raise FormatError(
                f"{found}; choose with `energy`: {there or 'there are no channels'}"
            )
        every = self._of_parts(self.parts)
        note = "the energies of all parts were added, those that stay deformable among them; choose with `parts`"
        return replace(
            every,
            channel="internal energy of all parts",
            parts=None,
            notes=(*every.notes, note),
        )

    def _of_channels(self, wanted: Sequence[str]) -> History:
        database, names = self._holding(wanted)
        if len(set(names)) < len(names):
            raise FormatError(f"{self.name}: an energy is given twice; name each once")
        columns = [database.channel(name) for name in names]
        channel = " + ".join(names)
        notes = note_other_quantity(channel)
        energy = columns[0] if len(columns) == 1 else np.sum(columns, axis=0)
        history = self._history_of(
            database, database.time, energy, channel, names, notes, None
        )
        return (
            history
            if len(columns) == 1
            else _with_terms(history, names, np.stack(columns, axis=1))
        )

    def _holding(self, wanted: Sequence[str]) -> tuple[Legs, tuple[str, ...]]:
        """Find the database that has all these channels, under the names it gives them."""
        refusals = []
        for database in sorted(self.databases, key=lambda one: not one.channels):
            try:
                if not database.channels:
                    database.channel(wanted[0])  # knows best why there are none
                return database, tuple(database.find(name) for name in wanted)
            except FormatError as error:
                refusals.append(error)
        raise refusals[0]

    def _history_of(
        self, database: Legs, time: Samples, energy: Samples, channel: str, names: Sequence[str],
        notes: tuple[str, ...], parts: tuple[Part, ...] | None,
    ) -> History:  # fmt: skip
        time_precision, energy_precision = database.precisions(names)
        return History(
            time=time,
            energy=energy,
            source=self.sources,
            files=self.files,
            format=" + ".join(one.format for one in self.databases),
            energy_format=database.format,
            channel=channel,
            parts=parts,
            time_precision=time_precision,
            energy_precision=energy_precision,
            time_unit=database.time_unit,
            complete=all(one.complete for one in self.databases),
            notes=(*self.notes, *notes),
        )


class _Written(Given):
    """What the files of a run hold for some parts, read when it is asked for."""

    def __init__(
        self, run: Run, chosen: Sequence[Part] | None, flying: Sequence[Part] | None
    ) -> None:
        self._run, self._chosen, self._flying = run, chosen, flying

    @cached_property
    def momenta(self) -> tuple[Momenta, ...]:
        """Momenta of the parts, then of the whole model."""
        return self._run.momenta(self._chosen, self._flying)

    @cached_property
    def masses(self) -> Samples | None:
        """Masses of the parts."""
        return self._run.masses

    @cached_property
    def forces(self) -> tuple[ContactForce, ...]:
        """Forces of contacts and rigid walls."""
        return self._run.contact_forces

    @cached_property
    def balance(self) -> Balance | None:
        """Energies of the whole model."""
        from d2rpick.histories.balance import terms_of

        return terms_of(self._run.databases)

    def internal_energies(self, parts: Sequence[Part]) -> Track | None:
        """Internal energies of some parts."""
        values = if_written(lambda: self._run.part_energies(parts))
        return None if values is None else Track(self._run.part_time, values)

    def kinetic_energy(self, parts: Sequence[Part] | None) -> Track | None:
        """Kinetic energy of some parts together, or of the whole model."""
        if parts is None:
            return super().kinetic_energy(parts)
        values = if_written(lambda: self._run.part_kinetic_energies(parts))
        return (
            None if values is None else Track(self._run.part_time, values.sum(axis=1))
        )


def _selected_channels(database: Legs, selection: Selection) -> list[str]:
    """Return the channels that are taken as energy by default, or selected, and the internal energies passed over."""
    if selection.energy:
        passed_over = filter(is_any_internal_energy, database.channels)
        return [*(database.find(name) for name in selection.energy), *passed_over]
    return [database.energy_channel] if database.energy_channel else []


def _median_of_some(values: Samples) -> Samples:
    """Median over the states of each column of values (n, k) that are not 0: the mass of a rigid part is written so."""
    some = values != 0
    if some.all():
        return median(values)
    return np.array(
        [
            median(one[there]) if there.any() else 0.0
            for one, there in zip(values.T, some.T, strict=True)
        ]
    )


def _left_out(springs: str) -> str:
    return f"the energy of {springs} was left out: that of springs holds what their dampers take and never give back"


def _with_terms(history: History, names: Sequence[str], energies: Samples) -> History:
    """Add the terms of a summed energy, (n, k), but those that are always zero; one alone is the energy itself."""
    active = np.flatnonzero(energies.any(axis=0))
    if active.size < 2:
        return history
    return replace(
        history,
        part_names=tuple(names[i] for i in active.tolist()),
        part_energies=energies[:, active],
    )
