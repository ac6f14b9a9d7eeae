"""Represent all files of one run, and select an energy in them."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from itertools import compress
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from d2rpick.base.caching import cached_property
from d2rpick.base.errors import FormatError, give_if_written, list_names
from d2rpick.histories.database import check_energy_of_parts, note_doubts
from d2rpick.histories.history import (
    Balance,
    Given,
    History,
    Momenta,
    NodeMotion,
    Samples,
    Track,
)
from d2rpick.histories.meaning import (
    is_any_internal_energy,
    is_total_internal_energy,
    note_missed_energy,
    note_other_quantity,
    note_unused_energies,
)
from d2rpick.histories.names import (
    QUANTITIES,
    Part,
    Selection,
    list_parts,
    select_parts,
)
from d2rpick.histories.samples import compute_median
from d2rpick.histories.surroundings import UNKNOWN, Surroundings
from d2rpick.histories.table_forces import find_forces
from d2rpick.histories.table_parts import (
    find_parts_not_chosen,
    find_springs_not_chosen,
    read_energies_of_parts_not_chosen,
)
from d2rpick.histories.wrong_values import (
    CheckedQuantity,
    check_balance,
    check_internal_energy,
    check_momenta,
    has_lone_jump,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from d2rpick.histories.contact_forces import ContactForce
    from d2rpick.histories.database import Legs
    from d2rpick.histories.source import Source

_AXES = ("x_momentum", "y_momentum", "z_momentum")
_VELOCITIES = ("x_rbvelocity", "y_rbvelocity", "z_rbvelocity")
_CENTRES = ("x_center", "y_center", "z_center")

NO_STATES: Final = "no states; did the run reach its first output?"


class OpenedRun:
    """The databases of one run, one per format, with the most comprehensive first.

    ``sources`` contains the names of the files, and ``files`` their contents. ``surroundings`` describes the external
    forces. ``reopen`` opens the same files again with other surroundings; it is used to copy a run to another process.
    ``notes`` is about files that were not used. ``forces`` contains the forces in files that contain only forces, and
    ``nodes`` the files that contain only the motion of nodes.
    """

    def __init__(
        self,
        sources: tuple[str, ...],
        databases: tuple[Legs, ...],
        files: tuple[Source, ...] = (),
        surroundings: Surroundings = UNKNOWN,
        notes: tuple[str, ...] = (),
        forces: tuple[ContactForce, ...] = (),
        nodes: tuple[Source, ...] = (),
        reopen: Callable[[Surroundings], OpenedRun] | None = None,
    ) -> None:
        self.sources, self.databases, self.files = sources, databases, files
        self.surroundings = surroundings
        self._notes, self._forces, self._reopen = notes, forces, reopen
        self._nodes = nodes

    def __reduce__(self) -> tuple[Any, ...]:
        if self._reopen is None:
            raise TypeError(
                f"{self.name}: only a run that was opened from files can be copied"
            )
        return self._reopen, (self.surroundings,)

    def within(self, surroundings: Surroundings) -> OpenedRun:
        """Return the run with different external forces on its parts (``surroundings``)."""
        return OpenedRun(
            self.sources,
            self.databases,
            self.files,
            surroundings,
            self._notes,
            self._forces,
            self._nodes,
            self._reopen,
        )

    @property
    def name(self) -> str:
        """The file names, joined for messages."""
        return ", ".join(self.sources)

    @property
    def parts(self) -> tuple[Part, ...]:
        """The parts whose histories the files contain."""
        holder = self._with_parts()
        return holder.parts if holder else ()

    @property
    def left_out(self) -> tuple[str, ...]:
        """Notes on files that were not used, each with the reason."""
        return self._notes

    @cached_property
    def notes(self) -> tuple[str, ...]:
        """Notes on the files for the user."""
        notes = [*self._notes]
        for database in self.databases:
            notes += database.notes
        return tuple(dict.fromkeys([*notes, *note_doubts(self.databases)]))

    def history(self, selection: Selection) -> History:
        """Return the history of the selected energy: that of parts, of channels, or by default of the whole model.

        Raises FormatError if a selected energy is missing; the message lists the available ones.
        """
        history = self._energy(selection)
        notes = (*history.notes, *self.unused_energies(selection))
        if selection.flying:
            flying = select_parts(selection.flying, self.parts, self.name)
        else:
            flying = None
        evidence = _Written(self, history.parts, flying)
        return replace(
            history, evidence=evidence, surroundings=self.surroundings, notes=notes
        )

    def check_energy(self, history: History) -> None:
        """Raise HistoryError if a single internal energy of the ``history`` is wrong, as in a damaged file."""
        if not has_lone_jump(history.energy):
            return
        if history.parts is None:
            balance = history.balance
            total = balance.kinetic_and_internal if balance else None
            if balance is None or not np.array_equal(balance.time, history.time):
                total = None
            internal = CheckedQuantity(history.channel, history.time, history.energy)
            check_internal_energy(internal, total, self.files)
            return
        total = give_if_written(self._compute_total_of_parts)
        deforming = [part for part in history.parts if part not in history.springs]
        for part, energy in zip(
            deforming, self.part_energies(deforming).T, strict=True
        ):
            internal = CheckedQuantity(
                f"internal energy of part {part.name}", self.part_time, energy
            )
            check_internal_energy(internal, total, self.files)

    def _compute_total_of_parts(self) -> Samples:
        """Return the sum of the internal and kinetic energies of all parts (n,) [energy], or raise FormatError."""
        energies = (
            self.part_energies(self.parts),
            self.part_kinetic_energies(self.parts),
        )
        return np.asarray(np.sum(energies, axis=(0, 2)))

    def unused_energies(self, selection: Selection) -> tuple[str, ...]:
        """Return notes on table channels that look like energies but are neither selected nor recognised."""
        notes: list[str] = []
        for database in self.databases:
            if not database.named_by_people or not database.channels:
                continue
            chosen = give_if_written(
                partial(_list_energy_channels, database, selection)
            )
            if chosen is not None:
                totals = filter(is_total_internal_energy, database.channels)
                used = {*chosen, *database.quantities.values(), *totals}
                notes += note_unused_energies(database.channels, used)
        return tuple(notes)

    def momenta(
        self, chosen: Sequence[Part] | None, flying: Sequence[Part] | None
    ) -> tuple[Momenta, ...]:
        """Return the momenta of the parts and of the whole model, if the files contain them.

        ``chosen`` contains the parts to be switched (None stands for all parts), and ``flying`` those that are known to
        fly together, if any.
        """
        of_parts = self._part_momenta
        of_whole = self._whole_momentum
        if of_parts and of_parts.parts:
            ids = [part.id for part in of_parts.parts]
            members = tuple(
                ids.index(part.id) for part in chosen or self._free(of_parts.parts)
            )
            together = tuple(ids.index(part.id) for part in flying) if flying else None
            of_parts = of_parts.choosing(members, together)
        return tuple(momenta for momenta in (of_parts, of_whole) if momenta)

    def _free(self, parts: Sequence[Part]) -> Sequence[Part]:
        """Return the parts without supports, or all parts if all have supports."""
        return [
            part for part in parts if not self.surroundings.supports_of([part])
        ] or parts

    @cached_property
    def _part_momenta(self) -> Momenta | None:
        """Momenta of all parts; None if the momentum of any part is missing."""
        holder = self._with_parts()
        if holder is None:
            return None
        values = give_if_written(
            lambda: np.stack(
                [self._of_holder(axis, holder.parts) for axis in _AXES], axis=2
            )
        )
        if values is None or not values.size:
            # If the momenta of some parts are missing, the database cannot show which parts fly together.
            return None
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
        """Masses of the parts whose momenta are written, in the order of the momenta; NaN if a mass is unknown [mass].

        They are read from the file, or are the momentum divided by the velocity along the axis with the largest
        momentum. The result is None if neither is written.
        """
        momenta = self._part_momenta
        holder = self._with_parts()
        return self._masses(momenta.values, holder) if momenta and holder else None

    def _masses(self, momenta: Samples, holder: Legs) -> Samples | None:
        """Return the masses of all parts, shape (parts,), as written or from momenta (n, parts, 3) and velocities."""
        written = give_if_written(lambda: self._of_holder("mass", holder.parts))
        if written is not None:
            return _compute_median_of_nonzero(written)
        axis = int(np.abs(momenta).sum(axis=(0, 1)).argmax())
        velocity = give_if_written(
            lambda: self._of_holder(_VELOCITIES[axis], holder.parts)
        )
        momentum = momenta[:, :, axis]
        if velocity is None:
            return None
        square = (velocity**2).sum(axis=0)
        product = (velocity * momentum).sum(axis=0)
        massless = ~momentum.any(axis=0) & ~velocity.any(axis=0)
        ratios = np.divide(
            product, square, out=np.full(square.shape, np.nan), where=square > 0
        )
        return np.where(massless, 0.0, ratios)

    def _least_masses(self, momenta: Samples, holder: Legs) -> Samples | None:
        """Return the part masses.

        An unknown mass is set to the smallest one that fits its momentum and kinetic energy.
        """
        from d2rpick.histories.balance import compute_least_masses

        masses = self._masses(momenta, holder)
        if masses is None or not np.isnan(masses).any():
            return masses
        kinetic = give_if_written(lambda: self.part_kinetic_energies(holder.parts))
        if kinetic is None:
            return masses
        return np.where(
            np.isnan(masses), compute_least_masses(momenta, kinetic), masses
        )

    @cached_property
    def contact_forces(self) -> tuple[ContactForce, ...]:
        """Forces of contacts and rigid walls, each from the first file that contains it."""
        forces_by_name: dict[str, ContactForce] = {}
        for database in self.databases:
            for force in give_if_written(partial(find_forces, database)) or ():
                forces_by_name.setdefault(force.name, force)
        for force in self._forces:
            forces_by_name.setdefault(force.name, force)
        return tuple(forces_by_name.values())

    @cached_property
    def _whole_momentum(self) -> Momenta | None:
        """Momentum of the whole model, or its velocity; None if the files contain neither."""
        from d2rpick.histories.balance import read_momentum

        for database in self.databases:
            momentum = read_momentum(database) if database.channels else None
            if momentum:
                return replace(momentum, surroundings=self.surroundings)
        return None

    def displacements(self, ids: Sequence[int]) -> NodeMotion | None:
        """Return the displacements of the requested nodes that the files contain; None if they contain none of them."""
        # Imported here to keep start-up fast.
        from d2rpick.histories.node_listings import find_motion

        return find_motion(self.databases, self._nodes, set(ids))

    def momentum(self, parts: Sequence[Part] | None) -> Track | None:
        """Return the total momentum of the given parts, or of the whole model; None if the files do not contain it."""
        of_parts = parts is not None
        for momenta in self.momenta(parts, None):
            if (momenta.parts is not None) == of_parts:
                return Track(momenta.time, momenta.of(momenta.chosen))
        return None

    @property
    def part_time(self) -> Samples:
        """Times of the states in the part histories [time]."""
        return self._holder().part_time

    @cached_property
    def springs(self) -> tuple[Part, ...]:
        """Parts that, judging by their energies, are springs or dampers."""
        from d2rpick.histories.balance import find_springs

        parts = self.parts
        # The energies are missing in some states.
        energies = give_if_written(lambda: self.part_energies(parts)) if parts else None
        if energies is None:
            return ()
        return find_springs(self.databases, parts, energies, self.part_time)

    def part_energies(self, parts: Sequence[Part]) -> Samples:
        """Return the internal energies of the given parts, shape (n, parts), at the times of the parts [energy]."""
        return self._of_holder("internal_energy", parts)

    def part_kinetic_energies(self, parts: Sequence[Part]) -> Samples:
        """Return the kinetic energies of the given parts, shape (n, parts) [energy], or raise FormatError."""
        return self._of_holder("kinetic_energy", parts)

    def quantities(self, time: Samples) -> dict[str, Samples]:
        """Return the quantities of the whole model that are written at the times ``time`` (n,), keyed by name."""
        columns: dict[str, Samples] = {}
        for database in self.databases:
            if not database.channels or not np.array_equal(database.time, time):
                continue
            for quantity in QUANTITIES:
                name = database.quantities.get(quantity)
                if name is None or quantity in columns:
                    continue
                values = give_if_written(partial(database.channel, name))
                if values is not None:
                    columns[quantity] = values
        return columns

    def centre(self, parts: Sequence[Part]) -> Track | None:
        """Return the mean position of the centres of the given parts [length]; None if they are not in the files."""
        components = give_if_written(
            lambda: [self._of_holder(axis, parts).mean(axis=1) for axis in _CENTRES]
        )
        if components is None:
            return None
        return Track(self.part_time, np.stack(components, axis=1))

    def _of_holder(self, quantity: str, parts: Sequence[Part]) -> Samples:
        """Return a quantity of the given parts, shape (n, parts)."""
        return self._holder().part_channel(quantity, [part.id for part in parts])

    def _energy(self, selection: Selection) -> History:
        """Return the history of the selected energy without any other data that show flights."""
        if all(database.span is None for database in self.databases):
            raise FormatError(f"{self.name}: {NO_STATES}")
        if selection.parts:
            chosen = select_parts(selection.parts, self._holder().parts, self.name)
            springs = self.springs
            if selection.springs is not None:
                springs = tuple(
                    part for part in self.parts if str(part.id) in selection.springs
                )
            return self._of_parts(chosen, springs)
        if selection.energy:
            return self._of_channels(selection.energy)
        for database in self.databases:
            if database.energy_channel is not None:
                return self._without_springs(database, database.energy_channel)
        return self._of_all_parts()

    def _holder(self) -> Legs:
        """Return the database with parts; if there is none, raise a FormatError that lists what the files contain."""
        holder = self._with_parts()
        if holder is None:
            # The first database raises the error with the best message about missing parts.
            self.databases[0].part_channel("internal_energy", ())
            raise FormatError(
                f"{self.name}: no parts with histories of their own; let the run write them"
            )
        return holder

    def _with_parts(self) -> Legs | None:
        """Return the first database that contains parts; None if there is none."""
        return next((database for database in self.databases if database.parts), None)

    def _of_parts(
        self, chosen: tuple[Part, ...], springs: tuple[Part, ...] = ()
    ) -> History:
        """Return the history of the summed energies of parts. Springs are added only if no other part has energy."""
        holder = self._holder()
        energies = self.part_energies(chosen)
        for database in self.databases:
            check_energy_of_parts(database, holder, energies)
        left_out = np.array([part in springs for part in chosen])
        # Springs are included if no other part has energy.
        if not energies[:, ~left_out].any():
            left_out[:] = False
        idle = [
            part
            for part, energy in zip(chosen, energies.T, strict=True)
            if not energy.any()
        ]
        notes: tuple[str, ...] = ()
        if idle:
            notes = (
                f"without any internal energy: part {list_parts(idle)}; rigid, or without elements?",
            )
        all_names = [part.name for part in chosen]
        names = list(compress(all_names, ~left_out))
        names_left_out = list(compress(all_names, left_out))
        channel = "internal energy of " + ", ".join(names)
        if names_left_out:
            notes = (*notes, _note_left_out_springs(", ".join(names_left_out)))
        energies = energies[:, ~left_out]
        history = self._history_of(
            holder, holder.part_time, energies.sum(axis=1), channel, (), notes, chosen
        )
        return replace(history, springs=tuple(compress(chosen, left_out)))

    def _without_springs(self, database: Legs, channel: str) -> History:
        """Return the history of the model without spring and damper energy, unless no other energy exists."""
        from d2rpick.histories.balance import find_spring_energy

        whole = self._of_channels((channel,))
        springs = find_spring_energy(database)
        if springs is None:
            return whole
        note = _note_left_out_springs(f"all springs and dampers, {springs[0]},")
        return replace(
            whole,
            energy=whole.energy - springs[1],
            channel=f"{channel} - {springs[0]}",
            notes=(*whole.notes, note),
        )

    def _of_all_parts(self) -> History:
        """Return the history of the summed energy of all parts; raise FormatError if there are no parts."""
        if not self.parts:
            channels = [
                name for database in self.databases for name in database.channels
            ]
            raise FormatError(
                f"{self.name}: no internal energy; choose with `energy`: "
                f"{list_names(channels) or 'there are no channels'}"
            )
        sum_of_parts = self._of_parts(self.parts)
        note = "the energies of all parts were added, including parts that stay deformable; choose with `parts`"
        return replace(
            sum_of_parts,
            channel="internal energy of all parts",
            parts=None,
            notes=(*sum_of_parts.notes, note),
        )

    def _of_channels(self, wanted: Sequence[str]) -> History:
        """Return the history of the summed energy of channels."""
        database, names = self._holding(wanted)
        if len(set(names)) < len(names):
            raise FormatError(f"{self.name}: an energy is given twice; name each once")
        columns = [database.channel(name) for name in names]
        channel = " + ".join(names)
        notes = (
            *note_other_quantity(channel),
            *note_missed_energy(names, database.channels),
        )
        energy = columns[0] if len(columns) == 1 else np.sum(columns, axis=0)
        return self._history_of(
            database, database.time, energy, channel, names, notes, None
        )

    def _holding(self, wanted: Sequence[str]) -> tuple[Legs, tuple[str, ...]]:
        """Return the database that has all these channels, and the names of the channels in it."""
        refusals = []
        for database in sorted(self.databases, key=lambda legs: not legs.channels):
            try:
                if not database.channels:
                    # A database without channels raises the error with the best message about missing channels.
                    database.channel(wanted[0])
                return database, tuple(database.find(name) for name in wanted)
            except FormatError as error:
                refusals.append(error)
        raise refusals[0]

    def _history_of(
        self, database: Legs, time: Samples, energy: Samples, channel: str, names: Sequence[str],
        notes: tuple[str, ...], parts: tuple[Part, ...] | None,
    ) -> History:  # fmt: skip
        """Return the history of an energy (n,), with the names and precisions of its database."""
        time_precision, energy_precision = database.precisions(names)
        return History(
            time=time,
            energy=energy,
            source=self.sources,
            files=self.files,
            format=" + ".join(legs.format for legs in self.databases),
            energy_format=database.format,
            channel=channel,
            parts=parts,
            time_precision=time_precision,
            energy_precision=energy_precision,
            time_unit=database.time_unit,
            energy_unit=_find_common_energy_unit(database, names),
            complete=all(legs.complete for legs in self.databases),
            notes=(*self.notes, *notes),
        )


def _find_common_energy_unit(database: Legs, names: Sequence[str]) -> str:
    """Return the energy unit that all these channels share; empty if a channel has no unit or units differ."""
    units = {database.find_energy_unit(name) for name in names}
    return units.pop() if len(units) == 1 else ""


class _Written(Given):
    """The data in the files of a run that show the flights of the given parts, read on request."""

    def __init__(
        self,
        run: OpenedRun,
        chosen: Sequence[Part] | None,
        flying: Sequence[Part] | None,
    ) -> None:
        self._run, self._chosen, self._flying = run, chosen, flying

    @cached_property
    def momenta(self) -> tuple[Momenta, ...]:
        """Momenta of the parts, followed by that of the whole model."""
        found = self._run.momenta(self._chosen, self._flying)
        for momenta in found:
            check_momenta(momenta, self._run.files)
        return found

    @cached_property
    def masses(self) -> Samples | None:
        """Masses of the parts."""
        return self._run.masses

    @cached_property
    def forces(self) -> tuple[ContactForce, ...]:
        """Forces of contacts and rigid walls."""
        return self._run.contact_forces

    @cached_property
    def springs(self) -> tuple[Part, ...]:
        """Springs and dampers of the run, judging by their energies, or by the names of the columns of a table."""
        database = self._find_table_with_others()
        return find_springs_not_chosen(database) if database else self._run.springs

    @cached_property
    def not_chosen(self) -> tuple[Part, ...]:
        """Parts whose energies a table lists separately, because its internal energy does not include them."""
        database = self._find_table_with_others()
        return find_parts_not_chosen(database) if database else ()

    def _find_table_with_others(self) -> Legs | None:
        """Return the first table that lists parts excluded from its internal energy; None if there is no such table."""
        return next(filter(find_parts_not_chosen, self._run.databases), None)

    @cached_property
    def balance(self) -> Balance | None:
        """Energies of the whole model."""
        from d2rpick.histories.balance import read_terms

        balance = read_terms(self._run.databases)
        if balance:
            check_balance(balance, self._run.files)
        return balance

    def displacements(self, ids: Sequence[int]) -> NodeMotion | None:
        """Return the displacements of the requested nodes that the files contain; None if they contain none of them."""
        return self._run.displacements(ids)

    def internal_energies(self, parts: Sequence[Part]) -> Track | None:
        """Return the internal energies of the given parts; None if the files do not contain them."""
        table = self._find_table_with_others()
        if table is not None and not self._run.parts:
            return Track(table.time, read_energies_of_parts_not_chosen(table, parts))
        values = give_if_written(lambda: self._run.part_energies(parts))
        return None if values is None else Track(self._run.part_time, values)

    def kinetic_energy(self, parts: Sequence[Part] | None) -> Track | None:
        """Return the total kinetic energy of the given parts, or of the model; None if the files do not contain it."""
        if parts is None:
            return super().kinetic_energy(parts)
        values = give_if_written(lambda: self._run.part_kinetic_energies(parts))
        if values is None:
            return None
        return Track(self._run.part_time, values.sum(axis=1))


def _list_energy_channels(database: Legs, selection: Selection) -> list[str]:
    """Return the channels that are used as the energy, and all other channels with an internal energy."""
    if selection.energy:
        passed_over = filter(is_any_internal_energy, database.channels)
        return [*(database.find(name) for name in selection.energy), *passed_over]
    return [database.energy_channel] if database.energy_channel else []


def _compute_median_of_nonzero(values: Samples) -> Samples:
    """Return the median of each column of values (n, k) over the states in which the column is not 0.

    States in which a column is 0 are ignored, because the written mass of a part is 0 while it is rigid.
    """
    is_nonzero = values != 0
    if is_nonzero.all():
        return compute_median(values)
    medians = []
    for column, states in zip(values.T, is_nonzero.T, strict=True):
        medians.append(compute_median(column[states]) if states.any() else 0.0)
    return np.array(medians)


def _note_left_out_springs(springs: str) -> str:
    """Return the note that the spring energy is left out."""
    return f"the energy of {springs} was left out: it contains what their dampers dissipate, which never comes back"
