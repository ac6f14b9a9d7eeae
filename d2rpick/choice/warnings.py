"""What a user should be aware of in a situation: stable codes for scripts, sentences for people."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from d2rpick.base.errors import Caution, listing, name_units
from d2rpick.histories.digits import not_after, window_as_read

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator, Sequence

    from d2rpick.choice.situation import Situation
    from d2rpick.flight.position_error import RigidBody
    from d2rpick.histories.names import Part

# Beyond this kinetic share more than half of the vibration is lost at td whatever tr is.
POOR_KINETIC_SHARE = 0.5
# An E_plastic above this share of the vibration is worth a word: energy alone cannot tell it from a preload.
_NOTABLE_PLASTIC = 0.05


WRONG_ENERGY: Final = "engine-wrong-energy"


def cautions_of_engine(sources: Collection[str]) -> Iterator[Caution]:
    """Say so where listings beside the files of a run show an engine that reports wrong energies."""
    if not any("T0" in name for name in sources):  # none is a leg of a Radioss run
        return
    from d2rpick.histories.listings import wrong_energies  # not above: other histories do without it

    if found := list(wrong_energies(sources)):
        why = "OpenRadioss from before January 2026 reports a wrong internal energy after /RBODY/ON or /RBODY/OFF"
        told = f"{found[0]}: {why} in a restart (its pull request 4538); do not judge by the energies of this run"
        yield Caution(WRONG_ENERGY, told)


def cautions_of(situation: Situation) -> Iterator[Caution]:
    """Everything to be aware of in a situation, the input first."""
    if not situation.history.complete:
        yield Caution("truncated-input", "the input ends within a state; only complete states were used")
    yield from _of_energy(situation)
    yield from _of_parts(situation)
    yield from _of_flight(situation)


def _of_energy(situation: Situation) -> Iterator[Caution]:
    td, mode, share = situation.td, situation.vibration.whole.mode, situation.kinetic_share
    if situation.at_rest:
        found = f"nothing vibrates from {situation.earliest_tr:.6g} to td = {td:.6g}"
        right = "" if situation.flight.unknown_load else "any tr there is right, and "
        yield Caution("at-rest", f"{found}: {right}the first one saves the most")
        return
    if situation.energy_td <= 0:
        found = f"the energy at td = {td:.6g} is {situation.energy_td:.6g}"
        yield Caution("no-energy", f"{found}; a level to lock in needs a positive energy")
    if share is not None and share > POOR_KINETIC_SHARE:
        lost = f"{share:.0%} of the vibration energy is kinetic at td = {td:.6g}"
        yield Caution("poor-td", f"{lost} and no tr can keep it")
    if mode and (mode.preload or abs(mode.energy_plastic) > _NOTABLE_PLASTIC * float(mode.vibration_energy(td))):
        found = f"plastic work {mode.energy_plastic:.4g} and a preload energy of {mode.preload**2:.4g} fit the record"
        yield Caution("plastic-or-preload", f"{found}; the energy alone cannot tell one from the other")


def _of_parts(situation: Situation) -> Iterator[Caution]:
    vibration = situation.vibration
    if vibration.estimated:
        yield Caution("kinetic-share-estimated", f"the kinetic share is what {vibration.estimated}")
    for part in vibration.signed.unsigned if vibration.signed else ():
        yield Caution("part-without-sign", f"{part.name} was left out: {part.reason}")


def _of_flight(situation: Situation) -> Iterator[Caution]:
    flight, td, earliest = situation.flight, situation.td, situation.earliest_tr
    if flight.refusal:
        yield Caution("no-free-flight", f"{flight.refusal}{_nearest_flight(situation)}")
    for doubt in flight.doubts:
        yield Caution("flight-sources-disagree", doubt)
    yield from _of_evidence(situation)
    if flight.source == "energy":
        found = f"the end of the load, {flight.start:.6g}, was found from the energy alone, which is not certain"
        if flight.settled is not None and flight.start is not None and flight.settled < flight.start:
            found += f": {flight.start - flight.settled:.3g} from {flight.settled:.6g} on are left unused for safety"
        yield Caution("flight-from-energy", f"{found}; give it as `after` where it is known")
    if earliest is None:
        yield Caution("no-flight", "nothing in the record shows when the load is over; give that time as `after`")
    elif td <= earliest:
        yield Caution(
            "td-in-load", f"td = {td:.6g} lies {'at' if td == earliest else 'before'} {end_of_load(situation)}"
        )
    if td > situation.latest_td:
        yield Caution("td-after-contact", f"td = {td:.6g} lies after {end_of_flight(situation)}")


def _of_evidence(situation: Situation) -> Iterator[Caution]:
    """Say why a flight that more than the energy of the parts shows is not certain, and what would make it so."""
    flight = situation.flight
    if flight.start is None or flight.source in ("energy", "given") or flight.certain:
        return
    if flight.source == "momentum":
        found = "the momentum changes at a constant rate in the flight, which was taken for gravity"
        yield Caution("gravity-assumed", f"{found}; the mass, or kinetic and internal energy, would show whether it is")
        return
    found = "nothing but energies shows the flight, and a fixed wall does no work"
    if flight.unknown_load:
        found = "nothing but energies shows the flight, in which gravity or another load works"
    yield Caution("flight-uncertain", f"{found}; momenta of the parts would make it sure")


def out_of_place(situation: Situation, tr: float) -> Iterator[Caution]:
    """Say so where a part that is frozen at ``tr`` puts a body off at td too much, and where that is not known."""
    bodies = situation.bodies
    if bodies is None:
        return
    if len(bodies.told) > 1 and bodies.unknown:
        yield Caution("several-bodies", _not_predicted(bodies.told, bodies.unknown))
    if bodies.apart:
        yield Caution("moves-apart", _moves_apart(bodies.apart))
    worst = bodies.worst(tr, situation.td)
    if worst is None or worst.error <= bodies.limit:
        return
    drift, which = worst.drift, f" of {name_units(worst.body.parts)}" if worst.body else ""
    share, last = worst.error / float(drift.path[-1]), float(drift.time[-1] - drift.time[0])
    found = f"{drift.part.name} is frozen elsewhere than it is at td = {situation.td:.6g}"
    least = "at least " * worst.at_least
    off = f"there the body{which} is off by {least}{worst.error:.3g}, {share:.1%} of its path in the flight"
    taken = "; this holds if the parts become one rigid body" if worst.assumed else ""
    taken += ", which `deck` tells" if worst.assumed and situation.settings.bodies is None else ""
    yield Caution("out-of-place", f"{found}: {off}; the next contact may move by {share * last:.2g}{taken}")


def _moves_apart(parts: Sequence[Part]) -> str:
    """Name the parts that nothing holds in a body."""
    away = f"{listing([part.name for part in parts])} fl{'ies' if len(parts) == 1 else 'y'} away from the other parts"
    return f"{away}: nothing joins them, and one rigid body of them would move as none of them does; leave these out"


def _not_predicted(told: Sequence[RigidBody], unknown: Sequence[RigidBody]) -> str:
    """Name the first body whose error is not known, and why."""
    first, more = unknown[0], f", and of {len(unknown) - 1} more" if len(unknown) > 1 else ""
    why = "" if first.whole else "; its pieces do not hang together"
    which = f"that of {name_units(first.parts)}{more}"
    return f"{len(told)} rigid bodies: how far {which} is out of place is not predicted{why}"


def end_of_load(situation: Situation) -> str:
    """Words for ``earliest_tr``: the start of the flight, and the margin where one is kept."""
    return f"the end of the load at {situation.flight.start:.6g}{_margin(situation.settings.margin)}"


def end_of_flight(situation: Situation) -> str:
    """Words for ``latest_td``: the end of the flight, and the margin where one is kept."""
    return f"the end of the flight at {situation.flight.end:.6g}{_margin(situation.margin)}"


def _margin(kept: float | None) -> str:
    return f" with the margin {kept:.6g}" if kept else ""


def _nearest_flight(situation: Situation) -> str:
    """Name the flight that is nearest to td, and the last td in it where a margin is kept."""
    flight = situation.flight
    if flight.start is None or flight.source == "given":
        return ""
    if flight.end is None:
        return f"; the next flight begins at {flight.start:.6g}"
    margin = _margin(situation.margin)
    last = f",{margin} its last td is {not_after(situation.latest_td):.6g}" if margin else "; td must lie in it"
    return f"; the nearest flight lasts from {window_as_read(flight.start, flight.end)}{last}"
