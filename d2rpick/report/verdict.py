"""The answer of ``verify`` as table, JSON, CSV and Markdown."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from d2rpick.errors import printable
from d2rpick.report import keys, tables
from d2rpick.report.situation import frame, heading, mechanics

if TYPE_CHECKING:
    from collections.abc import Sequence

    from d2rpick.choice.comparison import Comparison
    from d2rpick.choice.verify import Verdict

SCHEMA = "d2rpick/verify/1"
COMPARED = ("", "switched", "reference")


def as_table(answer: Verdict) -> str:
    """The verdict and its reasons, what it rests on, and the measures of the pair."""
    width = max(len(name) for name in keys.of_verdict(answer))
    lines = [f"{name.ljust(width)}  {tables.short(value)}" for name, value in keys.of_verdict(answer).items()]
    reasons = [f"  {printable(reason)}" for reason in answer.reasons]
    if answer.switched:
        lines += ["", *_comparison(answer.switched)]
    told = [f"verdict  {_told(answer)}", *([f"quality  {answer.quality.told}"] if answer.quality else [])]
    return "\n".join([*told, *reasons, "", *heading(answer.situation), "", *lines])


def as_markdown(answer: Verdict) -> str:
    """The measures as a Markdown table of two columns, and the reasons below it."""
    table = tables.as_markdown(("measure", "value"), list({**keys.of_verdict(answer), **_of_switched(answer)}.items()))
    return "\n".join([table, *(f"\n* {tables.in_markdown(reason)}" for reason in answer.reasons)])


def row(answer: Verdict) -> dict[str, Any]:
    """Each measure by its key, those of a switched run with ``switched_`` before them, and the reasons as one text."""
    situation = answer.situation
    measured = {"energy_td": situation.energy_td, "kinetic_share": situation.kinetic_share, **keys.of_verdict(answer)}
    return {**measured, **_of_switched(answer), "reasons": "; ".join(answer.reasons)}


def as_csv(answer: Verdict) -> str:
    """One row, a column for each key of `row`."""
    found = row(answer)
    return tables.as_csv(list(found), [list(found.values())]).rstrip("\n")


def as_json(answer: Verdict, command: Sequence[str]) -> str:
    """The whole answer by schema d2rpick/verify/1."""
    situation = answer.situation
    return tables.as_json(
        {
            **frame(situation, SCHEMA, command, answer.cautions),
            **mechanics(situation),
            **keys.of_verdict(answer),
            **keys.of_quality(answer.quality),
            "parts": keys.of_matches(answer.candidate.parts),
            "health": keys.of_health(answer.health),
            "reasons": list(answer.reasons),
            "switched": keys.of_comparison(answer.switched) if answer.switched else None,
        }
    )


def _told(answer: Verdict) -> str:
    """The verdict, and what a pair that verifies keeps."""
    if not answer.verified:
        return answer.word
    if answer.situation.at_rest:
        return f"{answer.word}: tr lies in the flight, and nothing vibrates there"
    held = "its level is" if answer.situation.basis == "energy" else "its sign matches and its error is"
    return f"{answer.word}: tr lies in the flight, {held} within the tolerance"


def comparison(switched: Comparison) -> list[tuple[str, float, float]]:
    """Rows of numbers that both runs have, below ``COMPARED``."""
    return [
        ("energy right after td", switched.energy_frozen, switched.energy_td),
        ("mean energy after td", switched.mean_after, switched.mean_after_reference),
        ("standard deviation after td", switched.spread_after, switched.spread_after_reference),
    ]


def deviations(switched: Comparison) -> list[tuple[str, str]]:
    """How far the switched run moves off the reference after td."""
    error, displacement = switched.momentum_error, switched.displacement
    off = "not available in both runs" if error is None else f"{error:.2g} of its maximum"
    moved = "not available in both runs" if displacement is None else f"{displacement:.3g}"
    return [("largest error of the momentum after td", off), ("largest displacement after td", moved)]


def _comparison(switched: Comparison) -> list[str]:
    """Lines that hold the switched run against the reference."""
    return [
        f"switched run  {printable(', '.join(switched.source))}; compared from td to {switched.end:.6g}",
        tables.as_text(COMPARED, comparison(switched)),
        *(f"{name.ljust(38)}  {text}" for name, text in deviations(switched)),
        *(f"note: {printable(note)}" for note in switched.notes),
    ]


def _of_switched(answer: Verdict) -> dict[str, Any]:
    """Measures of the switched run under names of their own; empty where there is none."""
    found = keys.of_comparison(answer.switched) if answer.switched else {}
    return {f"switched_{name}": value for name, value in found.items() if name not in ("source", "notes")}
