"""Describe what ``suggest`` and ``verify`` have in common: history, flight, oscillator and health of the run."""

from __future__ import annotations

from typing import TYPE_CHECKING

from d2rpick.base.errors import list_names, make_printable
from d2rpick.base.tuples import NamedTuple
from d2rpick.choice import health as limits
from d2rpick.choice.pair.together import ASSUMED_PARTS, rests_on_assumed_parts
from d2rpick.flight.flight import MOST_WORK
from d2rpick.report.tables import format_measure

if TYPE_CHECKING:
    from d2rpick.choice.health import Health
    from d2rpick.choice.pair.situation import Situation
    from d2rpick.histories.history import History


# Largest number of parts that are named in a line; the JSON output contains all of them.
_NAMED = 5


def describe_input(history: History) -> str:
    """Return files, format, energy and time span of a history; without a time unit, say that it is that of the run."""
    unit = f" {history.time_unit}" if history.time_unit else " (units of the run)"
    description = (
        f"{', '.join(history.source)}: {history.format}, {history.energy_name}"
    )
    span = f"{history.start:.6g} to {history.end:.6g}{unit}"
    return make_printable(f"{description}, {history.time.size} states, {span}")


def label_energy(unit: str) -> str:
    """Return the axis label of an internal energy, with its unit if a file gives one.

    Examples
    --------
    >>> label_energy("mJ"), label_energy("")
    ('internal energy [mJ]', 'internal energy')
    """
    return f"internal energy [{unit}]" if unit else "internal energy"


def label_deformation(unit: str) -> str:
    """Return the axis label of a deformation, which is the square root of an energy.

    Examples
    --------
    >>> label_deformation("mJ"), label_deformation("N*mm"), label_deformation("")
    ('deformation [√mJ]', 'deformation [√(N*mm)]', 'deformation [√energy]')
    """
    if not unit:
        return "deformation [√energy]"
    root = f"√{unit}" if unit.isalpha() else f"√({unit})"
    return f"deformation [{root}]"


def list_situation_heading(
    situation: Situation, *, verbose: bool = False
) -> list[tuple[str, str]]:
    """Return the history and the basis of the choice, as (name, text) pairs; ``verbose`` adds reasons."""
    flight = situation.flight
    share = situation.kinetic_share
    why = situation.vibration.unknown if verbose else None
    kinetic = "" if share is None else f", kinetic fraction {format_measure(share)}"
    estimate = " (estimate)" if situation.vibration.estimated else ""
    energy_unit = situation.history.energy_unit
    unit = f" {make_printable(energy_unit)}" if energy_unit else ""
    lines = [
        ("history", describe_input(situation.history)),
        (
            "td",
            f"{situation.td:.6g}: energy {situation.energy_td:.6g}{unit}{kinetic}{estimate}",
        ),
        ("basis", f"{_describe_basis(situation)}{f': {why}' if why else ''}"),
    ]
    if rests_on_assumed_parts(situation.history):
        assumed = f"d2rpick assumes {ASSUMED_PARTS}; the table does not name its parts"
        lines.insert(1, ("assumes", assumed))
    if flight.start is None:
        lines.append(("flight", "unknown"))
    else:
        end = "no next contact found" if flight.end is None else f"to {flight.end:.6g}"
        if not flight.shows_contact:
            end += " (given; the record shows no contact there)"
        parts = [
            part.name if part.title else str(part.id) for part in flight.parts or ()
        ]
        names = f" of {list_names(parts, most=_NAMED)}" if parts else ""
        lines.append(
            (
                "flight",
                f"from {flight.start:.6g} ({name_evidence(flight.source)}{names}), {end}",
            )
        )
    return [(name, make_printable(text)) for name, text in lines]


def name_evidence(source: str | None) -> str:
    """Return the displayed name of the source of a flight."""
    return "energy alone, not certain" if source == "energy" else str(source)


def _describe_basis(situation: Situation) -> str:
    """Describe the basis of the choice, and the fitted oscillator."""
    fit = situation.evidence.fit
    vibration = situation.vibration
    mode = vibration.whole.mode
    if not (mode and fit):
        return vibration.told or _explain_level_alone(situation)
    facts = [f"omega {mode.omega:.6g}", f"alpha {mode.alpha:.4g}"]
    offsets = {"energy_plastic": mode.energy_plastic, "preload": mode.preload}
    facts += [f"{name} {value:.4g}" for name, value in offsets.items() if value]
    facts.append(
        "misfit below 1e-9"
        if fit.misfit is None or fit.misfit < 1e-9
        else f"misfit {fit.misfit:.1e}"
    )
    source = "given" if situation.settings.oscillator else "identified"
    return f"oscillator, {source}: {', '.join(facts)}; it refines tr and energies"


def _explain_level_alone(situation: Situation) -> str:
    """Return a note that no deformation is known, with the reason if there are several modes."""
    if situation.at_rest:
        return "energy: nothing vibrates"
    fit = situation.evidence.fit
    several = "several modes; " if fit and fit.mode and not fit.describes_record else ""
    return f"energy alone ({several}the direction of the deformation is unknown)"


def list_health_columns(health: Health) -> tuple[str, ...]:
    """Return the column names of the health table; the first one contains the time up to which the run was judged."""
    return (
        "health" if health.until is None else f"health up to {health.until:.6g}",
        "this run",
        "usual limit",
        "verdict",
    )


class Measure(NamedTuple):
    """A displayed health quantity; ``value`` and ``good`` are None if the files lack the energies that it needs."""

    what: str
    value: str | None
    limit: str
    good: bool | None


def list_health_measures(health: Health) -> list[Measure]:
    """Return all health quantities of a run, with those for its rigid window last."""
    low = health.energy_ratio_min
    high = health.energy_ratio_max
    span = None if low is None or high is None else (low, high)
    part = f"hourglass energy of {health.part.name if health.part else 'parts'}"
    measures = [
        _make_share_measure(
            "hourglass energy", health.hourglass_share, limits.MOST_HOURGLASS
        ),
        _make_share_measure(part, health.part_hourglass_share, limits.MOST_HOURGLASS),
        Measure(
            "energy ratio",
            span and f"{span[0]:.4g} to {span[1]:.4g}",
            f"{1 - limits.MOST_IMBALANCE:g} to {1 + limits.MOST_IMBALANCE:g}",
            span and max(1 - span[0], span[1] - 1) <= limits.MOST_IMBALANCE,
        ),
        _make_share_measure(
            "contact energy", health.sliding_share, limits.MOST_SLIDING
        ),
        _make_share_measure(
            "negative contact energy",
            health.negative_sliding_share,
            limits.MOST_NEGATIVE_SLIDING,
        ),
        _make_share_measure(
            "energy of eroded elements", health.eroded_share, MOST_WORK
        ),
    ]
    if health.window:
        measures += [
            _make_share_measure(
                "change of contact energy in the window",
                health.window_sliding,
                MOST_WORK,
            ),
            _make_share_measure(
                "work beyond gravity and damping in the window",
                health.window_work,
                MOST_WORK,
            ),
            _make_share_measure(
                "energy eroded in the window", health.window_eroded, 0.0
            ),
        ]
    return measures


def _make_share_measure(name: str, share: float | None, limit_share: float) -> Measure:
    limit = f"at most {limit_share:.0%}" if limit_share else "none"
    return Measure(
        name,
        None if share is None else f"{share:.2%}",
        limit,
        None if share is None else share <= limit_share,
    )
