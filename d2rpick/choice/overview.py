"""Describe the files of a run, for ``info``."""

from __future__ import annotations

from dataclasses import replace
from itertools import chain
from math import isfinite
from typing import TYPE_CHECKING, Final

import numpy as np

from d2rpick.base.errors import (
    Caution,
    DamageError,
    EnergyChoiceError,
    FormatError,
    RangeError,
    give_if_readable,
    give_if_written,
    list_names,
)
from d2rpick.base.tuples import NamedTuple
from d2rpick.choice.health import (
    BEGINS_LATE,
    Health,
    assess_health,
    list_flaws,
    warn_about_engine,
    warn_about_health,
)
from d2rpick.choice.pair.grades import DO_NOT_USE, USE, USE_WITH_CARE
from d2rpick.choice.question import FEWEST_STATES, Reference, Settings
from d2rpick.choice.switched.frozen import find_frozen_times
from d2rpick.choice.switched.switched_run import (
    find_rigid_times,
    select_model_momenta,
)
from d2rpick.choice.td.flights import find_flights
from d2rpick.flight.flight import denies_every_flight, describe_hiding_digits
from d2rpick.flight.margin import LEAST_MARGIN
from d2rpick.flight.momentum import replace_words_by_part_ids
from d2rpick.flight.window import FreeFlight
from d2rpick.histories.balance import read_balance
from d2rpick.histories.database import note_doubts
from d2rpick.histories.history import History, select_states
from d2rpick.histories.names import Part, Selection, select_parts
from d2rpick.histories.samples import compute_median

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from d2rpick.base.spans import Times
    from d2rpick.histories.database import Legs
    from d2rpick.histories.history import Samples
    from d2rpick.histories.run import OpenedRun


# Name of the Radioss output that contains the part momenta.
_RADIOSS: Final = "/TH/PART with DEF, MASS and HE for all parts"
_LS_DYNA: Final = "*DATABASE_MATSUM"


class PartOverview(NamedTuple):
    """A part and its highest internal energy; None if the energy is missing in any state."""

    part: Part
    energy_max: float | None


class ForceOverview(NamedTuple):
    """A contact or rigid wall, and the intervals ``acts`` (start, end) during which it acts on parts [time]."""

    name: str
    acts: tuple[tuple[float, float], ...]


class Sampling(NamedTuple):
    """Smallest, most frequent and largest output interval [time]."""

    min: float
    median: float
    max: float


class Overview(NamedTuple):
    """Contents of the files of a run.

    Times are in the unit of the run, which ``time_unit`` gives only if a file names it.  ``sampling`` is None for a
    single state.  It and the times are None if there are no states; they and ``states`` are None if the time has to be
    chosen among several columns.  ``flights`` are the free flights of the requested parts, or of all, each with its
    source: ``plan`` and ``suggest`` choose from them; they rest on the energy alone if nothing better is written.
    ``health`` is that of the run, with the longest flight as its window; None if there are no energies.  ``unjudged``
    states why no times can be chosen from the run; empty if they can.  ``energies`` are the numbers of the columns of
    which the user has to choose one before the run can be judged; empty if the energy is known.  ``should_write`` names
    the output that would show the flights of single parts; None if it is written, or there is no state.  ``deck`` is
    the main deck of the run that was used, and ``selection`` the columns and parts that the user chose.  ``rigid`` are
    the windows in which parts are rigid.  ``never_flies`` is True if the momentum shows no flight at any time;
    ``hiding_digits`` then says whether it may have too few digits to show one.
    ``holes`` are the intervals without states [time].
    """

    source: tuple[str, ...]
    format: str
    version: str
    title: str
    states: int | None
    time_start: float | None
    time_end: float | None
    time_unit: str
    sampling: Sampling | None
    complete: bool
    channels: tuple[str, ...]
    parts: tuple[PartOverview, ...]
    flights: tuple[tuple[str, FreeFlight], ...]
    should_write: str | None
    health: Health | None
    notes: tuple[str, ...]
    alarms: tuple[Caution, ...] = ()
    unjudged: tuple[Caution, ...] = ()
    contact_forces: tuple[ForceOverview, ...] = ()
    deck: str | None = None
    selection: Selection = Selection()
    rigid: tuple[Times, ...] = ()
    never_flies: bool = False
    hiding_digits: str = ""
    energies: tuple[str, ...] = ()
    holes: tuple[Times, ...] = ()

    @property
    def verdict(self) -> str:
        """Verdict on whether switch times can be chosen from this run: "use", "use with care" or "do not use"."""
        if self.unjudged or not self.flights or self._is_spent or self.is_loaded:
            return DO_NOT_USE
        return USE_WITH_CARE if self._doubts else USE

    @property
    def reason(self) -> str:
        """Reason for the verdict."""
        if self.unjudged:
            return "; ".join(caution.message for caution in self.unjudged)
        if not self.flights and self.states is not None and self.states < FEWEST_STATES:
            states = f"{self.states} state{'s' * (self.states != 1)}"
            return f"the files contain {states}, but at least {FEWEST_STATES} were expected"
        if not self.flights and not self.complete:
            return "the files end within a state, and no free flight is found in the part that was read"
        if not self.flights:
            reason = "no free flight is found, so nothing can be made rigid"
            return "; ".join(filter(None, (reason, self.hiding_digits)))
        if self._is_spent:
            return (
                f"this is a switched run: parts are rigid from {_list_times(self.rigid)}, and no flight follows; "
                "choose times from the reference run, and compare this one with it (d2rpick verify)"
            )
        if self.is_loaded:
            return (
                "gravity or another load acts in every flight, and the files do not show which, so no pair of times "
                "can be used"
            )
        summary = f"{_describe_flights(self.flights)}; {_describe_health(self.health)}"
        return "; ".join(self._doubts) or summary

    @property
    def is_loaded(self) -> bool:
        """True if a load of unknown kind acts in every flight, so that ``suggest`` refuses every pair of times."""
        return bool(self.flights) and not any(
            isfinite(flight.gravity) for _, flight in self.flights
        )

    @property
    def _is_spent(self) -> bool:
        """True if parts were rigid and no flight begins after they have become deformable again."""
        last = max((end for _, end in self.rigid), default=None)
        return last is not None and all(
            flight.start < last for _, flight in self.flights
        )

    @property
    def _doubts(self) -> list[str]:
        """Reasons to use a run with flights only with care."""
        health = warn_about_health(self.health) if self.health else ()
        doubts = [caution.message for caution in health]
        if doubts and not self.rigid:
            doubts.append("d2rpick plan judges each flight only up to its td")
        if self.rigid:
            when = _list_times(self.rigid)
            doubts.insert(
                0,
                f"parts are rigid from {when}, so only later flights can be planned",
            )
        if self.holes:
            doubts.insert(
                0,
                f"there are no states from {_list_times(self.holes)}: a restart segment may be missing, and no flight "
                "is assumed across this gap",
            )
        if not self.complete:
            doubts.append(
                "the files end within a state; read them again when the run has ended"
            )
        if all(source == "energy" for source, _ in self.flights):
            doubts.append(
                "the flights are known from the internal energy alone, which is not certain"
            )
        return doubts

    @property
    def cautions(self) -> tuple[Caution, ...]:
        """Warnings about the health of the run and about the engine version, and reasons why it cannot be judged."""
        health = warn_about_health(self.health) if self.health else ()
        return (*self.alarms, *health, *warn_about_engine(self.source))


def _describe_flights(flights: Sequence[tuple[str, FreeFlight]]) -> str:
    """Describe the number of flights and the duration of the longest flight."""
    longest = max(flight.end - flight.start for _, flight in flights)
    count = f"{len(flights)} free flight{'s' * (len(flights) > 1)}"
    return f"{count}; the longest lasts {longest:.6g}"


def _describe_health(health: Health | None) -> str:
    """State that all energies written by the solver are within their limits."""
    if health is None or health.energy_ratio_min is None:
        return (
            "the health of the run is unknown, because the files contain neither the energy ratio nor the external "
            "work (written to LS-DYNA glstat and Radioss T01)"
        )
    return "energies are within their usual limits"


def describe_run(
    run: OpenedRun, selection: Selection, deck: str | None = None
) -> Overview:
    """Describe all databases of a run. The flights that are found depend on ``selection`` and ``deck``."""
    deck_warnings: tuple[Caution, ...] = ()
    if deck is not None:
        run, deck_warnings = _apply_deck(run, deck)
    first = run.databases[0]
    time, refusal = _read_times(first)
    states = int(time.size) if refusal is None else None
    history = _read_history(run, selection)
    rigid: tuple[Times, ...] = ()
    flights: tuple[tuple[str, FreeFlight], ...] = ()
    energies: tuple[str, ...] = ()
    never_flies, hiding_digits = False, ""
    if history:
        rigid = find_rigid_times(Reference(run, history))
        rigid = rigid or find_frozen_times(history)
        # That the run was switched says more than that its start is missing.
        flaws = tuple(
            flaw
            for flaw in list_flaws(history)
            if not (rigid and flaw.code == BEGINS_LATE)
        )
        flights = _find_flights_to_choose_from(
            select_model_momenta(history) if rigid else history
        )
        flaws += tuple(_warn_about_flights_outside(history, flights))
        never_flies = denies_every_flight(history)
        hiding_digits = describe_hiding_digits(history) if never_flies else ""
    else:
        flaws, energies = _explain_missing_energy(run, selection)
    channels = dict.fromkeys(chain.from_iterable(d.channels for d in run.databases))
    should_write = None
    if states != 0 and not any(momenta.parts for momenta in run.momenta(None, None)):
        should_write = _name_missing_output(run)
    return Overview(
        source=run.sources,
        format=" + ".join(database.format for database in run.databases),
        version=next((d.version for d in run.databases if d.version), ""),
        title=next((d.title for d in run.databases if d.title), ""),
        states=states,
        time_start=float(time[0]) if time.size else None,
        time_end=float(time[-1]) if time.size else None,
        time_unit=first.time_unit,
        sampling=_measure_sampling(time),
        complete=all(database.complete for database in run.databases),
        channels=tuple(channels),
        parts=tuple(_list_part_overviews(run)),
        flights=flights,
        should_write=should_write,
        health=_assess_health_of_run(
            run, history, [flight for _, flight in flights], rigid
        ),
        notes=tuple(dict.fromkeys(_list_notes(run, selection, refusal))),
        alarms=(
            *(flaws if history else ()),
            *_warn_about_rigid_legs(rigid),
            *deck_warnings,
        ),
        unjudged=flaws,
        contact_forces=tuple(
            ForceOverview(force.name, force.times) for force in run.contact_forces
        ),
        deck=deck,
        selection=selection,
        rigid=rigid,
        never_flies=never_flies,
        hiding_digits=hiding_digits,
        energies=energies,
        holes=history.holes if history else (),
    )


def _read_times(first: Legs) -> tuple[Samples, str | None]:
    """Return the times of the states, and a message if the user has to choose one of several time columns.

    Raises
    ------
    FormatError
        If the times cannot be read although one energy shows which column they are.
    """
    time = np.empty(0)
    try:
        if first.span is not None:
            time = first.time if first.channels else first.part_time
    except FormatError as error:
        if (
            first.format == "csv"
            and give_if_written(lambda: first.energy_channel) is not None
        ):
            raise
        return time, str(error)
    return time, None


def _list_notes(
    run: OpenedRun, selection: Selection, refusal: str | None
) -> Iterator[str]:
    """Yield notes on what the readers omitted or assumed, and the message ``refusal`` if the times cannot be read."""
    yield from run.left_out
    for database in run.databases:
        yield from _read_notes(database)
    yield from note_doubts(run.databases)
    yield from run.unused_energies(selection)
    if refusal is not None:
        yield refusal


def _measure_sampling(time: Samples) -> Sampling | None:
    """Return the output intervals between the states; None if there are fewer than two states."""
    steps = np.diff(time)
    if not steps.size:
        return None
    return Sampling(
        float(steps.min()), float(compute_median(steps)), float(steps.max())
    )


def _apply_deck(run: OpenedRun, deck: str) -> tuple[OpenedRun, tuple[Caution, ...]]:
    """Return the run with the supports, gravity and joints of a deck, and warnings; raise DeckError on failure."""
    # Imported here to keep start-up fast.
    from d2rpick.choice.parts.deck_of_run import (
        add_surroundings,
        check_model_of_deck,
        warn_about_solver,
    )
    from d2rpick.deck import read_inventory

    inventory = read_inventory(deck)
    foreign = check_model_of_deck(run, inventory)
    if foreign:
        return run, (foreign,)
    return add_surroundings(run, inventory), tuple(warn_about_solver((), inventory))


def _name_missing_output(run: OpenedRun) -> str:
    """Name the solver output that would contain the part momenta that these files lack."""
    written = {database.format for database in run.databases}
    if written & {"radioss-th"}:
        output = _RADIOSS
    elif written & {"glstat", "matsum", "binout", "d3plot", "d3thdt"}:
        output = f"{_LS_DYNA}, with the DT of *DATABASE_GLSTAT"
    else:
        if run.momenta(None, None):
            momentum = ""
        else:
            momentum = (
                ", at least columns x_momentum, y_momentum, z_momentum of the model"
            )
        output = f"the solver's own file instead of a table (Radioss: {_RADIOSS}; LS-DYNA: {_LS_DYNA}){momentum}"
    return f"{output}: only part momenta show when single parts fly"


def _read_notes(database: Legs) -> tuple[str, ...]:
    """Return the notes that a database reader issues, or its error as a note."""
    try:
        return database.notes
    except FormatError as error:
        return (str(error),)


def _list_part_overviews(run: OpenedRun) -> Iterator[PartOverview]:
    """Yield each part with its highest internal energy."""
    if run.parts:
        energies = give_if_readable(lambda: run.part_energies(run.parts))
    else:
        energies = np.empty((0, 0))
    if energies is None:  # The energy of the part is missing in some states.
        return (
            PartOverview(part, _find_highest_energy_of_part(run, part))
            for part in run.parts
        )
    return (
        PartOverview(part, _find_maximum(column))
        for part, column in zip(run.parts, energies.T, strict=True)
    )


def _find_highest_energy_of_part(run: OpenedRun, part: Part) -> float | None:
    """Return the highest internal energy of a part [energy]; None if the solver did not write it."""
    return give_if_readable(lambda: _find_maximum(run.part_energies([part])))


def _find_maximum(energies: Samples) -> float | None:
    """Return the largest energy; None if there are no energies."""
    return float(energies.max()) if energies.size else None


def _warn_about_rigid_legs(rigid: Sequence[Times]) -> Iterator[Caution]:
    """Yield a warning if parts are rigid in some time intervals of the run."""
    if rigid:
        when = _list_times(rigid)
        effect = "part data and internal energy mean nothing there and are not used for the health"
        yield Caution("rigid-legs", f"parts are rigid from {when}: {effect}")


def _list_times(windows: Sequence[Times]) -> str:
    """Return time windows as text."""
    return list_names([f"{start:.6g} to {end:.6g}" for start, end in windows])


def _assess_health_of_run(
    run: OpenedRun,
    history: History | None,
    flights: Sequence[FreeFlight],
    rigid: Sequence[Times],
) -> Health | None:
    """Return the health of the run outside its rigid windows; None if no energies were written."""
    try:
        balance = read_balance(
            run.databases, run.parts, known=history.balance if history else None
        )
    except DamageError:
        # Without a history, the overview reports already that the file is damaged.
        if history is not None:
            raise
        return None
    if balance is None or not balance.time.size:
        return None
    if rigid:
        states = np.ones(balance.time.shape, dtype=bool)
        for start, end in rigid:
            states &= (balance.time < start) | (balance.time > end)
        if not states.any():
            return Health(
                reason="all of the run is rigid, so its energies mean nothing",
                until=float(balance.time[-1]),
            )
        return assess_health(
            replace(select_states(balance, states), hourglass_of_parts=()),
            until=float(balance.time[-1]),
        )
    longest = max(flights, key=lambda flight: flight.end - flight.start, default=None)
    return assess_health(
        balance,
        (longest.start, longest.end) if longest else None,
        until=float(balance.time[-1]),
    )


def _read_history(run: OpenedRun, selection: Selection) -> History | None:
    """Return the history to be judged; None if the user has to choose an energy or there is no state."""
    if selection.parts:
        selection = replace_words_by_part_ids(run, selection)
    for wanted in (selection.parts, selection.flying):
        if wanted:
            select_parts(wanted, run.parts, run.name)
    try:
        history = run.history(selection)
    except FormatError:  # A warning reports the error.
        return None
    run.check_energy(history)
    return history


def _explain_missing_energy(
    run: OpenedRun, selection: Selection
) -> tuple[tuple[Caution, ...], tuple[str, ...]]:
    """Return a warning if no internal energy can be read, and the columns of which the user has to choose one."""
    try:
        run.history(selection)
    except EnergyChoiceError as error:
        return (Caution("no-energy", str(error)),), error.columns
    except FormatError as error:
        return (Caution("no-energy", str(error)),), ()
    return (), ()


def _warn_about_flights_outside(
    history: History, flights: Sequence[tuple[str, FreeFlight]]
) -> Iterator[Caution]:
    """Yield a warning for each flight outside the time range of the energies, as in files from different runs."""
    for _, flight in flights:
        last_td = flight.end - LEAST_MARGIN * (flight.end - flight.start)
        if flight.end_seen and last_td > history.end:
            span = f"from {flight.start:.6g} to {flight.end:.6g}"
            text = f"the flight {span} reaches outside the record of the energy, which ends at {history.end:.6g}"
            yield Caution(
                "flight-outside-record",
                f"{text}; do all files belong to the same run?",
            )


def _find_flights_to_choose_from(
    history: History,
) -> tuple[tuple[str, FreeFlight], ...]:
    """Return the flights from which ``plan`` and ``suggest`` choose, and their sources; empty for a refused run.

    The flights of a later restart segment are listed, although its start is needed to choose from them.
    """
    if any(flaw.code != BEGINS_LATE for flaw in list_flaws(history)):
        return ()
    try:
        flights = find_flights(history, Settings())
    except RangeError:
        return ()
    return tuple(
        (
            flight.source,
            FreeFlight(
                *flight.within(history.time),
                flight.parts,
                flight.end is not None,
                flight.damping,
                flight.gravity if flight.unknown_load else 0.0,
            ),
        )
        for flight in flights
        if flight.source
    )
