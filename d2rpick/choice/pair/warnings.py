"""Warn about a td, estimate the motion after td from the energy alone, and list the objections to a tr.

Each warning has a stable code for scripts and a sentence for users.
"""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Final

import numpy as np

from d2rpick.base.errors import Caution, name_units
from d2rpick.base.tuples import NamedTuple
from d2rpick.choice.pair.few_states import warn_about_few_states
from d2rpick.choice.pair.moving_apart import find_parts_moving_apart
from d2rpick.choice.parts.margins import compute_turning_speed
from d2rpick.flight.internal_energy import round_off
from d2rpick.flight.margin import compute_margin
from d2rpick.histories.digits import (
    format_beyond_limit,
    format_window,
    round_down_as_read,
    round_to_first_as_read,
)
from d2rpick.vibration import measures
from d2rpick.vibration.model import NOTHING_KEPT

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Sequence

    from numpy.typing import NDArray

    from d2rpick.choice.pair.situation import Situation
    from d2rpick.flight.position_error import RigidBody
    from d2rpick.histories.history import Samples
    from d2rpick.vibration.measures import Columns

# Code of the warning about a given landing at which the record shows no contact.
LANDING_NOT_SHOWN: Final = "landing-not-shown"
# Modes of higher frequency are detected only if each energy period has at least this number of states.
_FEW_STATES = 4
# Kinetic fraction at td above which every tr loses more than half of the vibration energy [-].
POOR_KINETIC_SHARE = 0.5
# Largest residual of a pair that is not poor [-]. At this value, the error has 25 % of the vibration energy.
POOR_RESIDUAL = 0.5
# Plastic energy up to this fraction of the vibration energy causes no warning [-], because it may be a preload.
_NOTABLE_PLASTIC = 0.05

# Assumed ratio of the static energy to the lowest energy in flight [-]; modes rarely all reach zero energy at once.
# With _AT_REST = 0.85, the predicted mean energies after td were wrong by up to 0.03 in 12 switched runs of a car.
# With _AT_REST = 0.85, the predicted mean energies of a shell box were wrong by -0.05 to 0.16.
_AT_REST = 0.85
# Largest expected mean energy after td relative to the reference run [-]; it exceeds 1 because estimates are inexact.
# Switching adds no energy, so a ratio above MOST_KEPT indicates a contact in the flight.
MOST_KEPT = 1.2
# Largest argument for which the exponential function does not overflow [-].
_LARGEST_EXPONENT = 700.0


def warn_about_td(situation: Situation) -> Iterator[Caution]:
    """Yield all warnings about the td of a situation, beginning with those about the input."""
    if not situation.history.complete:
        end = float(situation.history.time[-1])
        yield Caution(
            "truncated-input",
            f"the input ends within a state, so times after {end:.6g} are unknown; let the run finish, "
            "or copy the file again",
        )
    yield from _warn_about_energy(situation)
    yield from warn_about_few_states(situation)
    yield from _warn_about_model(situation)
    yield from _warn_about_flight(situation)


def _warn_about_energy(situation: Situation) -> Iterator[Caution]:
    """Yield the warnings about the energy at td."""
    td = situation.td
    mode = situation.vibration.whole.mode
    share = situation.kinetic_share
    if situation.at_rest:
        text = f"nothing vibrates from {situation.earliest_tr:.6g} to td = {td:.6g}"
        advice = (
            ""
            if situation.flight.unknown_load
            else ", so every tr in this interval is suitable"
        )
        yield Caution(
            "at-rest",
            f"{text}{advice}; the earliest keeps the parts rigid for longest",
        )
        return
    if situation.energy_td <= 0:
        if not situation.history.energy.any():
            text = "the energy is 0 in all states; it must be above 0"
            cure = "choose the column with the internal energy, as `energy`"
        else:
            text = f"the energy at td = {td:.6g} is {situation.energy_td:.6g}; it must be above 0"
            cure = "choose another td"
        yield Caution("no-energy", f"{text} to be matched at tr; {cure}")
    if share is not None and share > POOR_KINETIC_SHARE:
        lost = f"{share:.0%} of the vibration energy is kinetic at td = {td:.6g},"
        yield Caution("poor-td", f"{lost} and no tr can keep it; choose another td")
    if mode and (
        mode.preload
        or abs(mode.energy_plastic)
        > _NOTABLE_PLASTIC * float(mode.vibration_energy(td))
    ):
        text = f"plastic work {mode.energy_plastic:.4g} and a preload energy of {mode.preload**2:.4g} fit the record"
        yield Caution(
            "plastic-or-preload",
            f"{text}; the energy alone does not show which of them it is",
        )


def _warn_about_model(situation: Situation) -> Iterator[Caution]:
    """Yield the warnings about the number of states and about an estimated kinetic fraction."""
    vibration = situation.vibration
    states = situation.evidence.states_per_period
    if vibration.basis == "modal" and states is not None and states < _FEW_STATES:
        text = f"the fastest line of the energy has {states:.2g} states per period"
        strong = situation.evidence.states_per_strong_period
        if strong is not None and strong > states:
            text += f", the fastest strong line {strong:.2g}; the verdict rests on the strong lines"
        yield Caution(
            "coarse-record",
            f"{text}; a faster vibration would not be seen; write the energies more often",
        )
    if vibration.estimated:
        yield Caution(
            "kinetic-share-estimated",
            f"the kinetic fraction is an estimate: it is what {vibration.estimated}",
        )


def _warn_about_flight(situation: Situation) -> Iterator[Caution]:
    """Yield the warnings about the flight and the position of td in it."""
    flight = situation.flight
    td = situation.td
    earliest = situation.earliest_tr
    if flight.refusal:
        yield Caution(
            "no-free-flight", f"{flight.refusal}{_describe_nearest_flight(situation)}"
        )
    for doubt in flight.doubts:
        yield Caution("flight-sources-disagree", doubt)
    yield from _warn_about_evidence(situation)
    if flight.source == "energy":
        text = f"the end of the load, {flight.start:.6g}, is known from the energy alone, which is not certain"
        if (
            flight.settled is not None
            and flight.start is not None
            and flight.settled < flight.start
        ):
            waited = f"{flight.start - flight.settled:.3g}"
            text += (
                f" (the energy settles at {flight.settled:.6g}; to be safe, d2rpick waits for another {waited}, a "
                f"third of the time until td = {td:.6g})"
            )
        yield Caution(
            "flight-from-energy", f"{text}; if you know it, give it as `after`"
        )
    if earliest is None:
        text = "no end of the load is found in the record"
        is_given = situation.settings.after is not None or flight.refusal
        yield Caution("no-flight", text if is_given else f"{text}; give it as `after`")
    # If the flight is refused, the reason for its refusal already contains this warning.
    elif td <= earliest and not flight.refusal:
        yield Caution(
            "td-in-load",
            f"td = {td:.6g} lies {'at' if td == earliest else 'before'} {describe_end_of_load(situation)}",
        )
    yield from _warn_about_given_landing(situation)
    yield from _warn_about_grazing(situation)
    yield from _warn_about_unknown_rotation(situation)
    if td > situation.latest_td and not flight.refusal:
        yield Caution(
            "td-after-contact",
            f"td = {td:.6g} lies after {describe_end_of_flight(situation)}",
        )


def _warn_about_given_landing(situation: Situation) -> Iterator[Caution]:
    """Yield a warning if the user gave a landing at which the record shows no contact."""
    flight = situation.flight
    if flight.end is None or flight.refusal or flight.shows_contact:
        return
    shown = (
        f"the record shows no contact at `landing` {flight.end:.6g}: the parts fly on"
    )
    graded = "the energy of what happens there is unknown, so the vibration is graded by its error alone"
    yield Caution(LANDING_NOT_SHOWN, f"{shown}; {graded}")


def _warn_about_grazing(situation: Situation) -> Iterator[Caution]:
    """Yield a warning with the earliest contact time if the contact that ends the flight is only grazing."""
    flight = situation.flight
    margin = situation.expected_margin
    if flight.end is None or flight.refusal or margin.source != "grazing":
        return
    grazed = f"the force of the contact at {flight.end:.6g} is at first below 1 % of its maximum"
    if margin.grazing == "momentum":
        grazed = f"the contact at {flight.end:.6g} takes less than 10 % of the momentum towards it"
    moved = "the body only grazes it, so a position error at td makes it come up to"
    yield Caution(
        "grazing-contact", f"{grazed}: {moved} {_describe_early_contact(situation)}"
    )


def _warn_about_unknown_rotation(situation: Situation) -> Iterator[Caution]:
    """Yield a warning if the body's rotation is unknown and may cause an earlier contact."""
    flight = situation.flight
    margin = situation.expected_margin
    if flight.end is None or flight.refusal or margin.rotation is None:
        return
    unknown = "nothing shows how the body turns, and its kinetic energy may be that of a rotation"
    slow = "which slows the surface that touches first"
    moved = f"a position error at td makes the contact at {flight.end:.6g} come"
    early = f"up to {_describe_early_contact(situation)}"
    if margin.rotation == "unseen":
        early = f"earlier than the margin of {margin.time:.2g}; give the deck (`deck`), which shows the rotation"
    yield Caution("rotation-unknown", f"{unknown} {slow}: {moved} {early}")


def _describe_early_contact(situation: Situation) -> str:
    """Describe how much earlier the contact may occur, and give the last safe td."""
    start, end = situation.flight.within(situation.history.time)
    early = min(situation.expected_margin.time, end - start)
    if early < end - start:
        advice = f"keep td before {round_down_as_read(end - early):.6g}"
    else:
        advice = "no td in this flight is safe"
    return f"{early:.2g} earlier; {advice}"


def _warn_about_evidence(situation: Situation) -> Iterator[Caution]:
    """Yield a warning with advice if a flight is uncertain although data other than the part energies show it."""
    flight = situation.flight
    if flight.start is None or flight.source in ("energy", "given") or flight.certain:
        return
    if flight.source == "momentum":
        text = "the momentum changes at a constant rate in the flight, which is assumed to be gravity"
        yield Caution(
            "gravity-assumed",
            f"{text}; write the mass, or kinetic and internal energy, to check this",
        )
        return
    if flight.source == "contact-force":
        text = "the flight is known from the contact forces in the files, which do not show other contacts and loads"
        yield Caution(
            "flight-uncertain",
            f"{text}; write the part momenta to confirm it",
        )
        return
    text = "the flight is known from energies alone, which do not show the force of a fixed wall"
    if flight.unknown_load:
        text = "the flight is known from energies alone, and gravity or another load acts in it"
    yield Caution("flight-uncertain", f"{text}; write the part momenta to confirm it")


def warn_about_place(situation: Situation, tr: float) -> Iterator[Caution]:
    """Yield warnings if the position error at td is unknown, or too large because of a part frozen at ``tr``."""
    bodies = situation.bodies
    if bodies is None:
        return
    if len(bodies.told) > 1 and bodies.unknown:
        yield Caution(
            "several-bodies", _describe_not_predicted(bodies.told, bodies.unknown)
        )
    moving_apart = find_parts_moving_apart(situation)
    if moving_apart is not None:
        yield Caution(
            "moves-apart", f"{moving_apart.describe()}; {moving_apart.advice}"
        )
    worst = bodies.worst(tr, situation.td)
    if worst is None or worst.error <= bodies.limit:
        return
    drift = worst.drift
    which = f" of {name_units(worst.body.parts)}" if worst.body else ""
    share = worst.error / float(drift.path[-1])
    last = float(drift.time[-1] - drift.time[0])
    frozen = f"{drift.part.name} is frozen at a place where it is not at td = {situation.td:.6g}"
    bound = "at least " * worst.at_least
    distance = (
        f"the body{which} is then out of place by {bound}{worst.error:.3g}, {share:.1%} of its path in "
        "the flight"
    )
    assumption = (
        "; this holds if the parts become one rigid body" if worst.assumed else ""
    )
    if worst.assumed and situation.settings.bodies is None:
        assumption += ", which the deck of the run shows (`deck`)"
    turning = compute_turning_speed(
        situation.history, situation.flight, bodies, situation.settings.placement
    )
    contact = compute_margin(
        situation.history, situation.flight, place=worst.error, turning=turning
    ).spread
    moved = f"; the next contact may move by {share * last if contact is None else contact:.2g}"
    yield Caution(
        "out-of-place",
        f"{frozen}: {distance}{moved if situation.flight.end is not None else ''}{assumption}",
    )


def _describe_not_predicted(
    bodies: Sequence[RigidBody], unknown: Sequence[RigidBody]
) -> str:
    """Describe the first body with an unknown position error, and the reason why it is unknown."""
    first = unknown[0]
    others_text = f", and of {len(unknown) - 1} more" if len(unknown) > 1 else ""
    why = "" if first.whole else ", because its pieces are not connected"
    which = f"the body of {name_units(first.parts)}{others_text}"
    return f"{len(bodies)} rigid bodies: the position error at td is unknown for {which}{why}"


def describe_end_of_load(situation: Situation) -> str:
    """Describe ``earliest_tr`` in words: the start of the flight, plus the margin if there is one."""
    start, margin = situation.flight.start, situation.settings.margin
    load = f"the end of the load at {start:.6g}"
    if not margin or start is None:
        return load
    return f"the first tr of the flight, {start + margin:.6g} ({load} plus the margin {margin:.6g})"


def describe_end_of_flight(situation: Situation) -> str:
    """Describe ``latest_td`` in words: the end of the flight, minus the margin if there is one."""
    end = situation.flight.end
    cause = ""
    if any(start == end for start, _ in situation.history.holes):
        cause = ", where the states stop (is a restart segment missing?)"
    if not situation.margin:
        return f"the end of the flight at {end:.6g}{cause}"
    last = f"the last td of the flight, {round_down_as_read(situation.latest_td):.6g}"
    return (
        f"{last} (its end at {end:.6g}{cause} minus the margin {situation.margin:.6g})"
    )


def _describe_nearest_flight(situation: Situation) -> str:
    """Describe the flight nearest to td and the last td in this flight that keeps the margin."""
    flight = situation.flight
    if flight.start is None or flight.source == "given":
        return ""
    if flight.end is None:
        return f"; the next flight begins at {flight.start:.6g}"
    if situation.margin:
        latest_td = round_down_as_read(situation.latest_td)
        last = f"; because of the margin {situation.margin:.6g}, its last td is {latest_td:.6g}"
    else:
        last = "; td must lie in it"
    return f"; the nearest flight is {format_window(flight.start, flight.end)}{last}"


class Expectation(NamedTuple):
    r"""Estimates of the motion after td for a vibration with many modes. The fields are the keys of the JSON output.

    The energy of such a vibration is shared equally between internal and kinetic energy. The frozen energy above the
    energy at rest :math:`E_s` is released at td as vibration, whose energy is shared in the same way:

    .. math:: \frac{E_s + (E(t_r) - E_s)/2}{E_s + (\langle E \rangle - E_s)\,
        e^{-\alpha t_d}/\langle e^{-\alpha t} \rangle}

    The denominator is the mean energy of the reference run at td: its mean over the flight, reduced by damping. The
    energy at rest is assumed to be 0.85 of the lowest energy in the flight. Since only its upper bound is certain, a
    lower bound of the ratio is stated, too.

    Parameters
    ----------
    mean_energy : float
        Mean of E in the flight, <E> [energy].
    resting_energy : float
        Lowest E in the flight, an upper bound of E_s: plastic work and residual stress do not vibrate [energy].
    kinetic_share : float
        Kinetic fraction of the vibration energy at td, 1 - E(td)/(2 <E>) [-].
    ratio : float or None
        Mean of E after td, relative to the reference run, if E(tr) is locked in [-]; None if there is no tr.
    ratio_low : float or None
        Ratio if all of E(tr) vibrates, undamped: E(tr)/(2 <E>) [-].
    ratio_at_level : float
        Same as ``ratio`` if E(td) is locked in [-].
    """

    mean_energy: float
    resting_energy: float
    kinetic_share: float
    ratio: float | None
    ratio_low: float | None
    ratio_at_level: float


class Means(NamedTuple):
    """Energies that determine the mean energy after td [energy].

    ``mean`` and ``lowest`` refer to the flight, ``resting`` is the energy that does not vibrate, and ``mean_after`` is
    the mean of the reference run after td.
    """

    mean: float
    lowest: float
    resting: float
    mean_after: float

    def ratio(self, locked: float) -> float:
        """Return the mean energy after td, relative to the reference run, for a locked-in energy ``locked`` [-]."""
        return (self.resting + (locked - self.resting) / 2) / self.mean_after

    @property
    def largest_locked_in(self) -> float:
        """Largest locked-in energy that does not raise the energy after td above that of the reference run [energy]."""
        return self.resting + 2 * (MOST_KEPT * self.mean_after - self.resting)


def compute_means(situation: Situation) -> Means | None:
    """Compute the energies of the flight; None if the basis is not "energy" or if nothing flies or vibrates."""
    if situation.basis != "energy":
        return None
    mean = compute_mean_in_flight(situation)
    if mean is None or not situation.energy_td > 0 or situation.at_rest:
        return None
    time, energy = select_energies_in_flight(situation)
    lowest = max(0.0, float(energy.min()))
    resting = _AT_REST * lowest
    energy_after = resting + (mean - resting) / compute_mean_decay(situation, time)
    if energy_after > round_off(situation.history):
        return Means(mean, lowest, resting, energy_after)
    return None


def find_largest_energy(situation: Situation) -> float:
    """Return the largest energy that may be locked in for a td [energy]; infinite if the energy sets no limit."""
    means = compute_means(situation)
    return means.largest_locked_in if means else np.inf


def estimate_time_after(
    situation: Situation, energy_tr: float | None
) -> Expectation | None:
    """Estimate the motion after td; None if the basis is not "energy" or if the flight or the energy is unknown.

    ``energy_tr`` is the energy that the recommended tr freezes [energy]; None if there is no tr.
    """
    means = compute_means(situation)
    if means is None:
        return None
    return Expectation(
        mean_energy=means.mean,
        resting_energy=means.lowest,
        kinetic_share=max(0.0, 1 - situation.energy_td / (2 * means.mean)),
        ratio=None if energy_tr is None else means.ratio(energy_tr),
        ratio_low=None if energy_tr is None else energy_tr / (2 * means.mean),
        ratio_at_level=means.ratio(situation.energy_td),
    )


def compute_mean_in_flight(situation: Situation) -> float | None:
    """Return the mean energy of the flight, up to td if its end is unknown [energy]; None unless it is positive."""
    energy = select_energies_in_flight(situation)[1]
    mean = float(energy.mean()) if energy.size else 0.0
    return mean if mean > round_off(situation.history) else None


def compute_mean_decay(situation: Situation, time: Samples) -> float:
    """Return the mean vibration energy at ``time`` relative to that at td [-], from the damping in the flight."""
    exponents = -situation.flight.damping * (time - situation.td)
    return float(np.mean(np.exp(np.minimum(exponents, _LARGEST_EXPONENT))))


def select_energies_in_flight(situation: Situation) -> tuple[Samples, Samples]:
    """Return times and energies of the flight, or of its part up to td if its end is unknown; empty if unknown."""
    start = situation.flight.start
    end = situation.flight.end
    return situation.history.between(
        np.inf if start is None else start, situation.td if end is None else end
    )


def compute_shortfall(energy: Samples, mean: float) -> Samples:
    """Return the relative difference between a locked-in amplitude and the largest one, 1 - sqrt(E/(2 <E>)) [-].

    The shortfall is infinite if E exceeds 2 <E>; such energies must not be frozen.

    Examples
    --------
    >>> compute_shortfall(np.array([0.5, 2.0, 3.0]), 1.0)
    array([0.5, 0. , inf])
    """
    return np.where(
        energy <= 2 * mean, 1 - np.sqrt(np.maximum(energy, 0.0) / (2 * mean)), np.inf
    )


class Objection(NamedTuple):
    """An objection to each candidate for which ``holds``, shape (n,), is True.

    ``describe`` returns the text of the objection for the candidate with a given index. It is a partial call of a
    function of this module, because answers are pickled. ``is_of_error`` is True if the objection only states that an
    error is too large, which the residual shows as well.
    """

    holds: NDArray[np.bool_]
    describe: Callable[[int], Iterable[str]]
    is_of_error: bool = False


def list_objections(
    situations: Sequence[Situation],
    situation_of: NDArray[np.int32],
    tr: Samples,
    columns: Columns,
) -> Iterator[Objection]:
    """Yield all objections that apply to at least one of the candidates.

    Parameters
    ----------
    situations : sequence
        Situations with the same record and rules.
    situation_of : array of shape (n,)
        Index of the situation of each candidate.
    tr : array of shape (n,)
        Times of the candidates [time].
    columns : mapping of arrays of shape (n,)
        Measures by name, with ``energy`` and ``level_error``.
    """
    starts = np.array([_get_first_tr(situation) for situation in situations])
    is_early = ~(tr >= starts[situation_of])
    yield Objection(is_early, partial(_tell_in_load, situations, situation_of))
    refused = np.array(
        [bool([*list_objections_to_td(situation)]) for situation in situations]
    )
    yield Objection(
        refused[situation_of], partial(_tell_against_td, situations, situation_of)
    )
    moves = np.array([not situation.at_rest for situation in situations])[situation_of]
    compared = measures.compared(columns)
    described = (
        compared
        | np.array([bool(situation.vibration.unknown) for situation in situations])[
            situation_of
        ]
    )
    modal = np.array([situation.basis == "modal" for situation in situations])[
        situation_of
    ]
    same_sign = (columns["sign_match"] != 0) | modal
    yield Objection(
        # Before the flight, no model is expected to describe the vibration, so a missing model is no second objection.
        moves & ~described & ~is_early,
        partial(_tell_undescribed, situations, situation_of),
    )
    yield Objection(
        moves & ~same_sign,
        partial(_tell_always, "at tr the deformation has the opposite direction"),
    )
    judged = moves & described & same_sign
    yield from _object_to_errors(
        situations, situation_of, columns, judged, compared, modal
    )
    yield from _object_to_energy(situations, situation_of, columns["energy"])


def _object_to_errors(
    situations: Sequence[Situation],
    situation_of: NDArray[np.int32],
    columns: Columns,
    judged: NDArray[np.bool_],
    compared: NDArray[np.bool_],
    modal: NDArray[np.bool_],
) -> Iterator[Objection]:
    """Yield the objections to candidates whose deformation differs too much from that at td.

    Only ``judged`` candidates have an error. It is the deformation error if a model was ``compared``, otherwise the
    level error; ``modal`` candidates have a residual.
    """
    error = np.where(compared, columns["lock_in_error"], columns["level_error"])
    nothing = "the energy is not positive at tr, so no deformation can be compared"
    yield Objection(judged & np.isnan(error), partial(_tell_always, nothing))
    limits = np.array([situation.most_error for situation in situations])[situation_of]
    too_much = judged & (error > limits)
    for name, of_this_name in (
        ("frozen-deformation error", compared),
        ("level error", ~compared),
    ):
        yield Objection(
            too_much & ~modal & of_this_name,
            partial(_tell_error, name, error, limits),
            is_of_error=True,
        )
    yield Objection(
        too_much & modal,
        partial(_tell_keeps_nothing, situations, situation_of, columns["residual"]),
        is_of_error=True,
    )


def _object_to_energy(
    situations: Sequence[Situation], situation_of: NDArray[np.int32], energy: Samples
) -> Iterator[Objection]:
    """Yield the objection to candidates with more ``energy`` at tr than the reference run has after td."""
    # If td lies after the end of the flight, the energy in the flight does not predict the motion after td.
    means = [
        compute_means(situation) if situation.td <= situation.latest_td else None
        for situation in situations
    ]
    if any(means):
        is_above = (
            energy
            > np.array(
                [
                    situation.largest_locked_in if situation else np.inf
                    for situation in means
                ]
            )[situation_of]
        )
        yield Objection(
            is_above,
            partial(_tell_above_the_reference, means, situation_of, energy),
            is_of_error=True,
        )


def _get_first_tr(situation: Situation) -> float:
    """Return the earliest tr, rounded to printed digits [time]; NaN if the earliest tr is unknown."""
    if situation.earliest_tr is None:
        return np.nan
    return round_to_first_as_read(situation.earliest_tr)


def list_times_outside_flight(situation: Situation, tr: float) -> list[str]:
    """Describe the times of a pair that lie outside the flight, or less than the margin before its end."""
    outside = []
    if tr < _get_first_tr(situation):
        outside.append(_describe_in_load(situation))
    if situation.td > situation.latest_td:
        outside.append(f"td after {describe_end_of_flight(situation)}")
    return outside


def _tell_in_load(
    situations: Sequence[Situation], situation_of: NDArray[np.int32], candidate: int
) -> list[str]:
    """Return the objection that a candidate for tr lies before the flight."""
    return [_describe_in_load(situations[situation_of[candidate]])]


def _tell_against_td(
    situations: Sequence[Situation], situation_of: NDArray[np.int32], candidate: int
) -> Iterator[str]:
    """Return the objections to the td of a candidate."""
    return list_objections_to_td(situations[situation_of[candidate]])


def _tell_undescribed(
    situations: Sequence[Situation], situation_of: NDArray[np.int32], candidate: int
) -> list[str]:
    """Return the objection that no model describes the vibration at the time of a candidate."""
    return [situations[situation_of[candidate]].vibration.undescribed]


def _tell_always(reason: str, _: int) -> list[str]:
    """Return an objection that applies to every candidate."""
    return [reason]


def _tell_error(
    name: str, error: Samples, limits: Samples, candidate: int
) -> list[str]:
    """Return the objection that the error of a candidate exceeds the tolerance."""
    limit = limits[candidate]
    return [
        f"{name} {format_beyond_limit(error[candidate], limit)}, above the tolerance {limit:g}"
    ]


def _tell_keeps_nothing(
    situations: Sequence[Situation],
    situation_of: NDArray[np.int32],
    residual: Samples,
    candidate: int,
) -> list[str]:
    """Return the objection that the residual of a candidate exceeds that of a release without any vibration."""
    return [
        _describe_keeps_nothing(
            situations[situation_of[candidate]], residual[candidate]
        )
    ]


def _tell_above_the_reference(
    means: Sequence[Means | None],
    situation_of: NDArray[np.int32],
    energy: Samples,
    candidate: int,
) -> Iterator[str]:
    """Return the objection that a candidate locks in too much energy."""
    return _describe_above_reference(means[situation_of[candidate]], energy[candidate])


def _describe_in_load(situation: Situation) -> str:
    """State that a tr lies before the flight, or that no flight is known."""
    if situation.earliest_tr is None:
        return situation.flight.refusal or "unknown: no end of the load is found"
    start = situation.flight.start
    if any(end == start for _, end in situation.history.holes):
        return (
            f"tr before the states go on at {start:.6g} (is a restart segment missing?)"
        )
    return f"tr before {describe_end_of_load(situation)}"


def _describe_keeps_nothing(situation: Situation, residual: float) -> str:
    """State that a pair's residual exceeds that of a release without vibration, or the smallest residual at this td."""
    smallest = situation.vibration.least_residual or 0.0
    better = f"{NOTHING_KEPT:g}, the residual of a release without any vibration"
    if situation.vibration.keeps_nothing:
        better = f"{smallest:.3f}, the smallest at this td"
    return f"residual {residual:.3f}, more than {better}"


def _describe_above_reference(means: Means | None, energy: float) -> Iterator[str]:
    """State the ratio of the mean energy expected after td to that of the reference run."""
    if means:
        times = format_beyond_limit(means.ratio(energy), MOST_KEPT)
        text = f"the mean energy after td is expected to be {times} times that of the reference run"
        yield f"{text}, but at most {MOST_KEPT:g} was expected"


def list_objections_to_td(situation: Situation) -> Iterator[str]:
    """Yield the reasons why no tr is acceptable at this td."""
    if situation.td > situation.latest_td:
        yield f"td after {describe_end_of_flight(situation)}"
    if situation.settings.strict and not situation.flight.certain:
        yield "the flight is known from the energy alone, which is not certain"
    yield from situation.vibration.doubts
