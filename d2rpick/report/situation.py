"""What suggest and verify have in common in their output: history, flight, oscillator, health of the run."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

from d2rpick.choice import health as limits
from d2rpick.errors import listing, printable
from d2rpick.flight.flight import MOST_WORK
from d2rpick.report import keys
from d2rpick.report.tables import measure
from d2rpick.version import __version__

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from d2rpick.choice.health import Health
    from d2rpick.choice.settings import Settings
    from d2rpick.choice.situation import Situation
    from d2rpick.choice.warnings import Caution
    from d2rpick.histories.history import History


# Parts that a line names of those that are switched or fly together; the JSON document has all.
_NAMED = 5


def read_line(history: History) -> str:
    """Say what was read."""
    return f"history  {what_was_read(history)}"


def what_was_read(history: History) -> str:
    """Name files, format, energy and span of a history."""
    unit = f" {history.time_unit}" if history.time_unit else ""
    what = f"{', '.join(history.source)}: {history.format}, {energy_name(history)}"
    span = f"{history.time[0]:.6g} to {history.time[-1]:.6g}{unit}"
    return printable(f"{what}, {history.time.size} states, {span}")


def energy_name(history: History) -> str:
    """Name the energy; of many parts the first ones."""
    parts = [part.name for part in history.parts or () if part not in history.springs]
    return history.channel if len(parts) <= _NAMED else f"internal energy of {listing(parts, most=_NAMED)}"


def heading(situation: Situation) -> list[str]:
    """Lines above the table of a result: what was read, and what the choice rests on."""
    flight = situation.flight
    share = measure(situation.kinetic_share) + (" (estimate)" if situation.vibration.estimated else "")
    lines = [
        read_line(situation.history),
        f"td       {situation.td:.6g}: energy {situation.energy_td:.6g}, kinetic share {share}",
        f"basis    {_basis(situation)}",
    ]
    if flight.start is None:
        lines.append("flight   unknown")
    else:
        end = "no next contact found" if flight.end is None else f"to {flight.end:.6g}"
        parts = [part.name if part.title else str(part.id) for part in flight.parts or ()]
        who = f" of {listing(parts, most=_NAMED)}" if parts else ""
        lines.append(f"flight   from {flight.start:.6g} ({spoken(flight.source)}{who}), {end}")
    return [printable(line) for line in lines]


def spoken(source: str | None) -> str:
    """Name the source of a flight for people."""
    return "energy alone, not certain" if source == "energy" else str(source)


def _basis(situation: Situation) -> str:
    """What the choice rests on, and the oscillator behind it."""
    fit, vibration = situation.evidence.fit, situation.vibration
    mode, parts = vibration.whole.mode, f"parts, signs of {', '.join(vibration.signed)}" if vibration.signed else ""
    parts = "swings of the energy, counted" if vibration.basis == "swings" else parts
    if not (mode and fit):
        return f"{parts}; kinetic energy from the modes of each part" if parts else vibration.basis
    rates = ", ".join(f"{one.omega:.6g}" for one in mode.modes)
    facts = [f"omega {rates}", f"alpha {mode.alpha:.4g}"]
    offsets = {"energy_plastic": mode.energy_plastic, "preload": mode.preload}
    facts += [f"{name} {value:.4g}" for name, value in offsets.items() if value]
    facts.append("misfit below 1e-9" if fit.misfit is None or fit.misfit < 1e-9 else f"misfit {fit.misfit:.1e}")
    source = "given" if situation.settings.oscillator else "identified"
    count = len(mode.modes)
    oscillator = f"oscillator, {source}" if count == 1 else f"oscillator of {count} modes, {source}"
    front = f"{parts}; " if parts else ""
    return f"{front}{oscillator}: {', '.join(facts)}; tr and energies are refined on it"


def frame(situation: Situation, schema: str, command: Sequence[str], cautions: Iterable[Caution]) -> dict[str, Any]:
    """Keys that every JSON result begins with, and the history, deck and weights it rests on."""
    return frame_of(situation.history, situation.settings, schema, command, cautions)


def frame_of(
    history: History, settings: Settings, schema: str, command: Sequence[str], cautions: Iterable[Caution]
) -> dict[str, Any]:
    """Give the same keys where no td is looked at."""
    used = settings.by_deck
    return {
        "schema": schema,
        "tool_version": __version__,
        "command": list(command),
        "warnings": keys.of_warnings(cautions),
        "history": {
            "source": list(history.source),
            "sha256": [file.sha256() for file in history.files],
            "format": history.format,
            "channel": history.channel,
            "parts": keys.of_parts(history.parts),
            "states": int(history.time.size),
            "time_start": float(history.time[0]),
            "time_end": float(history.time[-1]),
            "complete": history.complete,
            "notes": list(history.notes),
        },
        "deck": keys.of_files(used.files) if used else None,
        "weights": keys.of_weights(used.weights) if used and used.weights else None,
    }


def mechanics(situation: Situation) -> dict[str, Any]:
    """Keys of JSON results that describe the situation at td."""
    flight, parts = situation.flight, situation.evidence.parts
    return {
        "energy_td": situation.energy_td,
        "kinetic_share": situation.kinetic_share,
        "kinetic_share_estimated": situation.vibration.estimated is not None,
        "basis": situation.basis,
        "flight": {
            "start": flight.start,
            "end": flight.end,
            "source": flight.source,
            "certain": flight.certain,
            "parts": keys.of_parts(flight.parts),
        },
        "oscillator": _oscillator(situation),
        "modes": _modes(situation),
        "unsigned_parts": keys.of_unsigned(parts.unsigned) if parts else None,
    }


def _oscillator(situation: Situation) -> dict[str, Any] | None:
    """Give the one oscillator that was fitted, or null; where several describe the record, that one does not."""
    fit = situation.evidence.fit
    if fit is None:
        return None
    several = fit.mode is not None and len(fit.mode.modes) > 1
    mode = None if several else fit.mode
    return {
        "omega": mode.omega if mode else None,
        "alpha": mode.alpha if mode else None,
        "energy_plastic": mode.energy_plastic if mode else None,
        "preload": mode.preload if mode else None,
        "misfit": fit.misfit,
        "source": "given" if situation.settings.oscillator else "identified",
        "describes_record": fit.describes_record and not several,
        "reason": "several modes describe the record" if several else fit.reason,
    }


def _modes(situation: Situation) -> list[dict[str, float]] | None:
    """Give the modes whose sum describes the record, or null where one or none does."""
    modes = situation.vibration.whole.mode.modes if situation.vibration.whole.mode else ()
    if len(modes) < 2:
        return None
    return [
        {"omega": one.omega, "alpha": one.alpha, "vibration_energy_td": float(one.vibration_energy(situation.td))}
        for one in modes
    ]


def head(health: Health) -> tuple[str, ...]:
    """Names of the columns of a table of health; the first says up to when the run was judged."""
    return "health" if health.until is None else f"health up to {health.until:.6g}", "this run", "practice", "verdict"


class Measure(NamedTuple):
    """A measure for people: ``value`` None where the files lack it, and then ``good`` is None too."""

    what: str
    value: str | None
    limit: str
    good: bool | None


def measures_of(health: Health) -> list[Measure]:
    """All measures of a run, those of its window last."""
    low, high = health.energy_ratio_min, health.energy_ratio_max
    span = None if low is None or high is None else (low, high)
    part = f"hourglass energy of {health.part.name if health.part else 'parts'}"
    found = [
        _share("hourglass energy", health.hourglass_share, limits.MOST_HOURGLASS),
        _share(part, health.part_hourglass_share, limits.MOST_HOURGLASS),
        Measure(
            "energy ratio",
            span and f"{span[0]:.4g} to {span[1]:.4g}",
            f"within {limits.MOST_IMBALANCE:.0%} of 1",
            span and max(1 - span[0], span[1] - 1) <= limits.MOST_IMBALANCE,
        ),
        _share("contact energy", health.sliding_share, limits.MOST_SLIDING),
        _share("negative contact energy", health.negative_sliding_share, limits.MOST_NEGATIVE_SLIDING),
        _share("energy of deleted elements", health.eroded_share, MOST_WORK),
    ]
    if health.window:
        found += [
            _share("change of contact energy in the window", health.window_sliding, MOST_WORK),
            _share("work beyond gravity and damping there", health.window_work, MOST_WORK),
            _share("energy deleted there", health.window_eroded, 0.0),
        ]
    return found


def _share(what: str, share: float | None, most: float) -> Measure:
    limit = f"at most {most:.0%}" if most else "none"
    return Measure(what, None if share is None else f"{share:.2%}", limit, None if share is None else share <= most)
