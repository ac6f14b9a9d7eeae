"""The keys of JSON results and the columns of CSV, each written down once: a renamed field changes no output.

Keys are only ever added.  The schemas in ``d2rpick/schemas`` say what they mean.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final, Protocol

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping, Sequence

    from d2rpick.choice.candidates import Candidate
    from d2rpick.choice.comparison import Comparison
    from d2rpick.choice.cost import Weights
    from d2rpick.choice.expectation import Expectation
    from d2rpick.choice.health import Health
    from d2rpick.choice.ranking import Quality
    from d2rpick.choice.suggest import Pair
    from d2rpick.choice.verify import Verdict
    from d2rpick.choice.warnings import Caution
    from d2rpick.flight.flight import Flight
    from d2rpick.histories.names import Part
    from d2rpick.vibration.part_signs import PartMatch, Unsigned


def of_warnings(cautions: Iterable[Caution]) -> list[dict[str, Any]]:
    """Code and sentence of each warning."""
    return [{"code": caution.code, "message": caution.message} for caution in cautions]


class Read(Protocol):
    """A file that was read."""

    @property
    def name(self) -> str:
        """Name that the user gave it."""

    def sha256(self) -> str:
        """SHA-256 of what was read."""


def of_files(files: Iterable[Read]) -> dict[str, Any]:
    """Names of files, and the SHA-256 of what was read of each; a file that is included twice once."""
    found = {file.name: file for file in files}
    return {"source": list(found), "sha256": [file.sha256() for file in found.values()]}


def of_weights(weights: Weights) -> dict[str, Any]:
    """Where weights come from: in words, and the file with its SHA-256, null where they were not read from one."""
    file = weights.file
    return {
        "source": weights.source,
        "file": file.name if file else None,
        "sha256": file.sha256() if file else None,
    }


def of_parts(parts: Sequence[Part] | None) -> list[dict[str, Any]] | None:
    """Number and title of each part, or null for the whole model."""
    return None if parts is None else [{"id": part.id, "title": part.title} for part in parts]


def of_flight(flight: Flight) -> dict[str, Any]:
    """The window of free flight and how it was found."""
    return {"start": flight.start, "end": flight.end, "source": flight.source, "parts": of_parts(flight.parts)}


def of_unsigned(parts: Iterable[Unsigned]) -> list[dict[str, Any]]:
    """Parts that were left out, and why."""
    return [{"name": part.name, "reason": part.reason} for part in parts]


def of_matches(matches: Iterable[PartMatch]) -> list[dict[str, Any]]:
    """What each part has of the mismatch."""
    return [
        {"name": one.name, "sign_match": one.sign_match, "share": one.share, "reason": one.reason} for one in matches
    ]


# What is said of a candidate beside its parts; in CSV the notes come last.
CANDIDATE: Final[Mapping[str, Callable[[Candidate], Any]]] = {
    "rank": lambda c: c.rank,
    "tr": lambda c: c.tr,
    "kind": lambda c: c.kind,
    "energy": lambda c: c.energy,
    "energy_ratio": lambda c: c.energy_ratio,
    "level_error": lambda c: c.level_error,
    "rising": lambda c: c.rising,
    "sign_match": lambda c: c.sign_match,
    "lock_in_error": lambda c: c.lock_in_error,
    "residual": lambda c: c.residual,
    "part_mismatch": lambda c: c.part_mismatch,
    "rigid_time": lambda c: c.rigid_time,
    "rigid_fraction": lambda c: c.rigid_fraction,
    "timing_tolerance": lambda c: c.timing_tolerance,
    "tr_low": lambda c: c.tr_low,
    "tr_high": lambda c: c.tr_high,
    "acceptable": lambda c: c.acceptable,
    "recommended": lambda c: c.recommended,
    "notes": lambda c: list(c.notes),
    "run_time_share": lambda c: c.run_time_share,
    "same_swing": lambda c: c.same_swing,
    "residual_high": lambda c: c.residual_high,
    "position_error": lambda c: c.position_error,
    "position_error_part": lambda c: c.position_error_part,
    "position_error_body": lambda c: c.position_error_body,
    "position_error_assumes": lambda c: c.position_error_assumes,
    "position_error_is_lower_bound": lambda c: c.position_error_is_lower_bound,
}


def of_candidate(candidate: Candidate) -> dict[str, Any]:
    """Everything in ``CANDIDATE``."""
    return {key: read(candidate) for key, read in CANDIDATE.items()}


# Of these those that measure a pair of times, in the order in which ``verify`` shows them.
MEASURES: Final = (
    *("energy", "energy_ratio", "level_error", "sign_match", "lock_in_error", "residual", "residual_high"),
    *("part_mismatch", "timing_tolerance", "rigid_time", "rigid_fraction", "run_time_share"),
    *("position_error", "position_error_part", "position_error_body", "position_error_assumes"),
    "position_error_is_lower_bound",
)


def of_verdict(verdict: Verdict) -> dict[str, Any]:
    """The pair that was judged, its measures and what they come to."""
    found = of_candidate(verdict.candidate)
    return {
        "tr": verdict.candidate.tr,
        "td": verdict.situation.td,
        **{name: found[name] for name in MEASURES},
        "tr_ok": verdict.tr_ok,
        "td_ok": verdict.td_ok,
        "verified": verdict.verified,
    }


def of_quality(quality: Quality | None) -> dict[str, Any]:
    """The grade of a pair and why it is none better; null without a pair."""
    return {
        "quality": quality.grade if quality else None,
        "quality_reasons": list(quality.reasons) if quality else None,
    }


def of_pair(pair: Pair | None) -> dict[str, Any] | None:
    """The better pair, or null."""
    return {"td": pair.td, "tr": pair.tr, "residual": pair.residual} if pair else None


def of_expected(expected: Expectation | None) -> dict[str, Any] | None:
    """What the energy alone tells of the time after td, or null."""
    if expected is None:
        return None
    return {
        "mean_energy": expected.mean_energy,
        "resting_energy": expected.resting_energy,
        "kinetic_share": expected.kinetic_share,
        "ratio": expected.ratio,
        "ratio_low": expected.ratio_low,
        "ratio_at_level": expected.ratio_at_level,
    }


def of_health(health: Health | None) -> dict[str, Any] | None:
    """How far the reference run can be trusted, or null."""
    if health is None:
        return None
    part = health.part
    return {
        "hourglass_share": health.hourglass_share,
        "part_hourglass_share": health.part_hourglass_share,
        "part": {"id": part.id, "title": part.title} if part else None,
        "energy_ratio_min": health.energy_ratio_min,
        "energy_ratio_max": health.energy_ratio_max,
        "sliding_share": health.sliding_share,
        "negative_sliding_share": health.negative_sliding_share,
        "eroded_share": health.eroded_share,
        "window": health.window,
        "window_sliding": health.window_sliding,
        "window_work": health.window_work,
        "window_eroded": health.window_eroded,
        "reason": health.reason,
        "window_reason": health.window_reason,
        "until": health.until,
    }


def of_comparison(found: Comparison) -> dict[str, Any]:
    """What a finished switched run shows beside its reference."""
    return {
        "source": found.source,
        "energy_frozen": found.energy_frozen,
        "energy_td": found.energy_td,
        "energy_ratio": found.energy_ratio,
        "end": found.end,
        "mean_after": found.mean_after,
        "mean_after_reference": found.mean_after_reference,
        "spread_after": found.spread_after,
        "spread_after_reference": found.spread_after_reference,
        "momentum_error": found.momentum_error,
        "displacement": found.displacement,
        "rigid_from": found.rigid_from,
        "rigid_to": found.rigid_to,
        "objections": found.objections,
        "notes": found.notes,
    }
