"""Judge which parts may be switched, with reasons, from the data in deck and history."""

from __future__ import annotations

from collections import Counter
from types import MappingProxyType
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from d2rpick.base.errors import DamageError, FormatError, give_if_written, name_units
from d2rpick.choice.td.flights import find_flights
from d2rpick.deck.geometry import compute_masses_and_steps
from d2rpick.deck.model import DISCRETE, Inventory, PartData
from d2rpick.deck.pieces import count_pieces
from d2rpick.flight.internal_energy import find_largest
from d2rpick.flight.momentum import find_parts_flying_together, list_deformable_parts
from d2rpick.flight.window import LAST_DIGIT
from d2rpick.histories.opening import Selection
from d2rpick.histories.run import NO_STATES
from d2rpick.histories.samples import find_window

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator, Mapping, Sequence

    from d2rpick.choice.parts.cost import CostModel
    from d2rpick.choice.question import Settings
    from d2rpick.flight.flight import Flight
    from d2rpick.histories.history import History, Samples
    from d2rpick.histories.names import Part
    from d2rpick.histories.run import OpenedRun


# A part no longer deforms if the standard deviation of its energy in flight is at most this fraction of the mean [-].
STOPPED: Final = 0.1
# Duration of the first phase of a landing, as a fraction of the preceding flight [-].
_LANDING: Final = 0.05

SWITCH, MERGE, KEEP, UNKNOWN = "switch", "merge", "keep", "unknown"
# LANDING_ALONE: a bumper or skid absorbs at least this fraction of the energy at the start of the landing [-].
# _CHEAP: a bumper or skid may stay deformable if its element cost is at most this fraction of the total [-].
LANDING_ALONE: Final = 0.9
_CHEAP: Final = 0.1


class InFlight(NamedTuple):
    """Data of one part in one flight; energies are None if they are not written or the part has none.

    ``scatter`` is the standard deviation of the internal energy divided by its mean [-]; ``change`` is the energy at
    the end minus that at the start [energy]. ``landing`` is the energy that the part absorbs at the start of the
    landing [energy].
    """

    flies: bool | None = None
    mean: float | None = None
    change: float | None = None
    scatter: float | None = None
    landing: float | None = None

    @property
    def deforms(self) -> bool | None:
        """True if the part still deforms in the flight; None if its energy is unknown."""
        return None if self.scatter is None else self.scatter >= STOPPED


class PartFacts(NamedTuple):
    """Data of one part from the history; ``has_energy`` is None if its energy is not written.

    ``held`` names the support that acts on the part in the longest flight or, without flights, at the end of the
    record.
    """

    part: Part
    mass: float | None
    has_energy: bool | None
    flights: tuple[InFlight, ...] = ()
    held: str | None = None


class RunFacts(NamedTuple):
    """Data of all parts from the history.

    ``flights`` contains (start, end) of each flight [time], and ``longest`` the index of the longest flight; None if
    there are no flights. ``reason`` states why there are no parts or no flights.
    """

    parts: Mapping[int, PartFacts]
    flights: tuple[tuple[float, float], ...] = ()
    longest: int | None = None
    reason: str | None = None


def collect_facts(run: OpenedRun, settings: Settings) -> RunFacts:
    """Collect the data of parts from the files of a run.

    Parameters
    ----------
    run : Run
        The reference run.
    settings : Settings
        Options for the search for flights, which are needed if momenta do not show them.

    Returns
    -------
    RunFacts
        If the files have no data of parts, the result has no parts but the reason.
    """
    try:
        energies = run.part_energies(run.parts)
    except FormatError as error:
        return RunFacts({}, reason=str(error))
    if not energies.size:
        return RunFacts({}, reason=f"{run.name}: {NO_STATES}")
    masses = _read_masses(run)
    try:
        history, members = _read_energy_of_flight(run)
    except DamageError:
        raise
    except FormatError as error:  # The error is raised if no part ever deforms.
        still = {
            part.id: PartFacts(part, masses.get(part.id), has_energy=False)
            for part in run.parts
        }
        return RunFacts(still, reason=str(error))
    flights = find_flights(history, settings)
    spans = tuple(flight.within(history.time) for flight in flights)
    longest = max(
        range(len(spans)), key=lambda at: spans[at][1] - spans[at][0], default=None
    )
    moment = history.end if longest is None else sum(spans[longest]) / 2
    facts = {}
    for part, energy in zip(run.parts, energies.T, strict=True):
        in_flights = [
            _measure_in_flight(
                history.time, energy, span, _is_flying(part, flight, members)
            )
            for span, flight in zip(spans, flights, strict=True)
        ]
        facts[part.id] = PartFacts(
            part,
            masses.get(part.id),
            bool(energy.any()),
            tuple(in_flights),
            run.surroundings.held([part], moment),
        )
    return RunFacts(
        facts, spans, longest, None if flights else "no flight is found in the history"
    )


def _read_energy_of_flight(run: OpenedRun) -> tuple[History, Sequence[Part] | None]:
    """Return the energy of the parts that fly together (of all deformable parts if none fly), and the flying parts."""
    members = give_if_written(lambda: find_parts_flying_together(run))
    chosen = members or list_deformable_parts(run)
    return run.history(Selection(parts=tuple(str(part.id) for part in chosen))), members


def _is_flying(
    part: Part, flight: Flight, members: Sequence[Part] | None
) -> bool | None:
    """Return True if a part flies together with the others; None if no part momenta show it."""
    if members is None:
        return None
    together = flight.parts if flight.source == "momentum" and flight.parts else members
    return part.id in {member.id for member in together}


def _measure_in_flight(
    time: Samples, energy: Samples, span: tuple[float, float], flies: bool | None
) -> InFlight:
    """Return the mean, change and standard deviation of a part's energy in flight, and its energy in the landing."""
    inside = energy[find_window(time, *span)]
    if not inside.size or not inside.any():
        return InFlight(flies)
    mean = float(inside.mean())
    scatter = float(inside.std()) / mean if mean > 0 else None
    if find_largest(inside) <= LAST_DIGIT * find_largest(energy):
        # The part does not vibrate: its energy in flight is only round-off of its energy in later contacts.
        scatter = 0.0
    return InFlight(
        flies,
        mean,
        float(inside[-1] - inside[0]),
        scatter,
        _measure_landing(time, energy, span),
    )


def _measure_landing(
    time: Samples, energy: Samples, span: tuple[float, float]
) -> float | None:
    """Return the energy that a part absorbs at the start of the landing [energy]; None if the record ends earlier."""
    start, end = span
    energies = energy[find_window(time, end, end + _LANDING * (end - start))]
    if end < float(time[-1]) and energies.size > 1:
        return float(energies[-1] - energies[0])
    return None


def _read_masses(run: OpenedRun) -> dict[int, float]:
    """Return the known masses, keyed by part id [mass]."""
    masses = run.masses
    if masses is None:
        return {}
    return {
        part.id: mass
        for part, mass in zip(run.parts, masses.tolist(), strict=True)
        if np.isfinite(mass)
    }


class PartRow(NamedTuple):
    """All data of one part; unknown values are None.

    ``cost_share`` is the fraction of the cost of all elements that is due to those of the part [-]. ``smallest_step``
    is the smallest stable time step of the part [time]; ``mass_source`` and ``step_source`` name the sources of the
    mass and of this time step. ``flights`` contains the data of the part in each flight, and ``flight`` those in the
    longest flight. ``merge_with`` is the part whose rigid body this part joins.
    """

    id: int
    title: str
    elements: Mapping[str, int] | None
    formulations: tuple[str, ...]
    material: str | None
    kind: str | None
    mass: float | None
    mass_source: str | None
    flights: tuple[InFlight, ...]
    flight: InFlight | None
    cost_share: float | None
    smallest_step: float | None
    step_source: str | None
    shares_nodes: tuple[int, ...] | None
    verdict: str = UNKNOWN
    merge_with: int | None = None
    reasons: tuple[str, ...] = ()

    @property
    def movable(self) -> bool:
        """True if the part may be switched."""
        return self.verdict in (SWITCH, MERGE)


def judge_parts(
    facts: RunFacts,
    model: CostModel | None,
    printed: Mapping[int, tuple[float, str]] = MappingProxyType({}),
) -> tuple[PartRow, ...]:
    """Judge whether each part of a deck or history can be switched; the result is sorted by part id.

    Parameters
    ----------
    facts : RunFacts
        Data from the history.
    model : CostModel or None
        The deck with its costs; if it is missing, no verdict that depends on materials or shared nodes is given.
    printed : mapping of (float, str), optional
        Smallest time steps of the parts that controlled the time step, by id, with the name of the source [time].
    """
    inventory = model.inventory if model else None
    ids = sorted({*facts.parts, *(inventory.parts if inventory else ())})
    sizes = compute_masses_and_steps(inventory) if inventory else {}
    rows = [
        _describe_part(part, facts, model, sizes.get(part, (None, None)), printed)
        for part in ids
    ]
    alone = find_landing_alone(rows)
    judged = [_judge_part(row, facts, inventory, alone) for row in rows]
    return tuple(_merge_rows(judged, inventory)) if inventory else tuple(judged)


def _describe_part(
    part: int,
    facts: RunFacts,
    model: CostModel | None,
    by_deck: tuple[float | None, float | None],
    printed: Mapping[int, tuple[float, str]],
) -> PartRow:
    """Collect the data of a part; ``by_deck`` contains the mass and the time step that the deck defines."""
    fact = facts.parts.get(part)
    inventory = model.inventory if model else None
    data = inventory.parts.get(part) if inventory else None
    counts = inventory.counts.get(part, Counter()) if inventory and data else None
    if inventory and not counts and not inventory.complete:
        counts = None  # The elements may be defined in a file that was not read.
    if by_deck[1] is None:
        step, source = printed.get(part, (None, None))
    else:
        step, source = by_deck[1], "deck"
    mass = by_deck[0]
    mass_source = None if mass is None else "deck"
    if fact and fact.mass is not None:
        mass = fact.mass
        mass_source = "history"
    title = fact.part.title if fact else ""
    if data and data.title:
        title = data.title
    formulations = tuple[str, ...]()
    if inventory and counts:
        formulations = tuple(inventory.formulation(part, kind).name for kind in counts)
    flight = None
    if fact and facts.longest is not None and fact.flights:
        flight = fact.flights[facts.longest]
    shares_nodes = None
    if inventory and data:
        shares_nodes = tuple(sorted(inventory.neighbours.get(part, ())))
    return PartRow(
        id=part,
        title=title,
        elements=counts,
        formulations=formulations,
        material=data.material.name if data and data.material else None,
        kind=_find_kind(data, counts),
        mass=mass,
        mass_source=mass_source,
        flights=fact.flights if fact else (),
        flight=flight,
        cost_share=model.share_of(part).value if model and counts is not None else None,
        smallest_step=step,
        step_source=source,
        shares_nodes=shares_nodes,
    )


def _find_kind(data: PartData | None, counts: Mapping[str, int] | None) -> str | None:
    """Return the type of a part: "spring" or "particles" according to its elements, otherwise its material type."""
    if data is None:
        return None
    if counts and set(counts) <= DISCRETE:
        return "spring"
    if counts and "particle" in counts:
        return "particles"
    return data.material.kind if data.material else None


def _judge_part(
    row: PartRow, facts: RunFacts, inventory: Inventory | None, alone: int | None
) -> PartRow:
    """Return the row of a part with its verdict and reasons; only the part ``alone`` absorbs the landing energy."""
    fact = facts.parts.get(row.id)
    data = inventory.parts.get(row.id) if inventory else None
    reasons_to_keep = tuple(_list_reasons_to_keep(row, fact, data, alone)) or tuple(
        _describe_pieces(row, inventory)
    )
    if reasons_to_keep:
        return row._replace(verdict=KEEP, reasons=reasons_to_keep)
    unknowns = tuple(_list_unknowns(row, facts, inventory, data))
    if unknowns:
        return row._replace(verdict=UNKNOWN, reasons=unknowns)
    return row._replace(
        verdict=SWITCH,
        reasons=(
            *_list_remarks_on_switch(row, fact, data),
            *_describe_joined(row, inventory),
        ),
    )


def _describe_joined(row: PartRow, inventory: Inventory | None) -> Iterator[str]:
    """Yield a remark that names the parts joined to a part; their welds and ties are inactive while it is rigid."""
    joined = inventory.joined.get(row.id, {}) if inventory else {}
    if joined:
        kinds = ", ".join(sorted(frozenset[str]().union(*joined.values())))
        yield f"joined to {name_units(joined)} ({kinds})"


def _list_reasons_to_keep(
    row: PartRow, fact: PartFacts | None, data: PartData | None, alone: int | None
) -> Iterator[str]:
    """Yield the reasons not to switch a part."""
    if row.kind == "rigid" and not (fact and fact.has_energy):
        yield "already rigid"
        return
    if row.kind == "spring":
        yield "discrete"
        if data and data.section.damped:
            yield "with dampers, whose energy contains the dissipated work"
        return
    if row.kind in ("airbag", "void", "particles"):
        yield {
            "airbag": "airbag fabric",
            "void": "void material, without stiffness",
            "particles": "particles",
        }[row.kind]
        return
    if row.elements is not None and not row.elements:
        yield "no elements"
        return
    if data and data.unswitchable:
        yield data.unswitchable
    if fact and fact.held:
        yield fact.held
    elif fact and fact.has_energy is False:
        yield "never has internal energy: rigid, or fixed"
    elif row.flight and row.flight.flies is False:
        yield "does not fly with the other parts"
    if data and not data.section.turns:
        yield "stresses of its solids do not rotate with a rigid body"
    if row.id == alone:
        yield "determines the landing alone, and costs little"


def _describe_pieces(row: PartRow, inventory: Inventory | None) -> Iterator[str]:
    """Yield a reason if LS-DYNA would make one rigid body of a part's disconnected pieces."""
    if (
        inventory is None
        or inventory.solver != "ls-dyna"
        or inventory.ties
        or not inventory.complete
    ):
        return
    pieces = count_pieces(inventory, [row.id], among=inventory.parts.keys())
    if pieces > 1:
        yield f"{pieces} disconnected pieces, which LS-DYNA would make one rigid body"


def _list_unknowns(
    row: PartRow, facts: RunFacts, inventory: Inventory | None, data: PartData | None
) -> Iterator[str]:
    """Yield the missing data that a verdict on a part needs, if there is no reason against switching it."""
    if inventory is None:
        yield "without a deck it is unknown whether it is discrete, already rigid, or shares nodes"
    elif data is None:
        yield "not in the deck"
    elif row.elements is None:
        yield "its elements are not in the files of the deck that were read"
    elif data.material is None:
        yield "its material is not in the deck"
    if row.id not in facts.parts:
        yield facts.reason or "not in the history"
    elif row.flight is None:
        yield facts.reason or "no flight is found"
    elif row.flight.flies is None:
        yield "no part momenta show whether it flies with the other parts"


def _list_remarks_on_switch(
    row: PartRow, fact: PartFacts | None, data: PartData | None
) -> Iterator[str]:
    """Yield remarks on a part that may be switched."""
    if row.kind == "rigid":
        yield "rigid in the deck, but has internal energy in the history"
    if row.flight and row.flight.deforms is not None:
        yield (
            "flies, so it can be rigid; vibrates, so its energies at tr and td must match"
            if row.flight.deforms
            else "flies, so it can be rigid; does not vibrate, so any tr fits"
        )
    if data and data.section.formulations.keys() & {
        "solid",
        "tetrahedron",
        "pentahedron",
        "thick shell",
    }:
        yield "solids: some solvers report wrong energies for them while they are rigid"
    if fact and fact.has_energy is None:
        yield "its energy is not written"


def compute_step_growth(
    rows: Sequence[PartRow], switched: Collection[int]
) -> float | None:
    """Return the smallest growth factor of the time step while the ``switched`` parts are rigid, at least 1 [-].

    The result is None if the time step of a part that remains deformable is unknown. It is infinite if no part remains
    deformable.
    """
    computed = [
        row for row in rows if row.elements and row.kind not in ("rigid", "void")
    ]
    remaining = [row.smallest_step for row in computed if row.id not in switched]
    known_steps = [step for step in remaining if step is not None]
    steps = [row.smallest_step for row in computed if row.smallest_step is not None]
    if len(known_steps) < len(remaining) or not steps:
        return None
    return min(known_steps) / min(steps) if known_steps else float("inf")


def find_landing_alone(rows: Sequence[PartRow]) -> int | None:
    """Find the cheap part that absorbs nearly all energy at the start of the landing after the longest flight."""
    taken = {
        row.id: row.flight.landing
        for row in rows
        if row.flight and row.flight.landing is not None
    }
    total = sum(value for value in taken.values() if value > 0)
    for row in rows:
        if row.cost_share is None or row.cost_share > _CHEAP or row.kind == "spring":
            continue
        if total > 0 and taken.get(row.id, 0.0) >= LANDING_ALONE * total:
            return row.id
    return None


def _merge_rows(rows: Sequence[PartRow], inventory: Inventory) -> Iterator[PartRow]:
    """Merge connected parts into one rigid body, with the part of smallest id as the lead part."""
    bodies = inventory.groups([row.id for row in rows if row.verdict == SWITCH])
    lead = {part: body[0] for body in bodies for part in body[1:]}
    for row in rows:
        if row.id in lead:
            yield row._replace(
                verdict=MERGE, merge_with=lead[row.id], reasons=row.reasons
            )
        else:
            yield row
