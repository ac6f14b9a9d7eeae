"""The answer of ``verify`` as table, JSON, CSV and Markdown."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

from d2rpick.base.errors import make_printable
from d2rpick.report import keys, tables
from d2rpick.report.fields import Document, Field, kind_of, maybe, row
from d2rpick.report.situation import heading
from d2rpick.report.suggestion import statements

if TYPE_CHECKING:
    from d2rpick.choice.answers import Verdict
    from d2rpick.choice.comparison import Comparison
    from d2rpick.report.formats import Shown

# The pair that was judged, its measures and what they come to.
MEASURES: Final = row(
    Field("tr", "number", get=lambda answer: answer.candidate.tr),
    Field("td", "number", get=lambda answer: answer.situation.td),
    *keys.CANDIDATE.of_part(lambda answer: answer.candidate, keys.MEASURES),
    Field("tr_ok", "flag?"),
    Field("td_ok", "flag?"),
    Field("verified", "flag"),
)
SWITCHED: Final = row(
    Field("source", kind_of("texts", minItems=1)),
    Field("energy_frozen", "number", "came back at td"),
    Field("energy_td", "number", "of the reference at td"),
    Field("energy_ratio", "number?"),
    Field("end", "number", "compared from td to here"),
    Field("mean_after", "number"), Field("mean_after_reference", "number"),
    Field("spread_after", kind_of("number", minimum=0), "standard deviation"),
    Field("spread_after_reference", kind_of("number", minimum=0)),
    Field("momentum_error", "size?",
          "largest deviation after td relative to the largest momentum of the reference there"),
    Field("displacement", "size?", "largest distance of the parts' centre from where the reference has it"),
    Field("rigid_from", "number?"), Field("rigid_to", "number?"), Field("objections", "texts"),
    Field("notes", "texts"),
    name="switched", later=("rigid_from", "rigid_to", "objections"),
)  # fmt: skip
DOCUMENT: Final = Document("d2rpick/verify/1", "Answer of d2rpick verify; times in the unit of the history.", row(
    *keys.FRAME,
    *keys.MECHANICS.of_part(lambda answer: answer.situation),
    *MEASURES.fields,
    *keys.QUALITY,
    keys.MATCHES._replace(get=lambda answer: answer.candidate.parts),
    keys.HEALTH,
    Field("reasons", "texts"),
    Field("switched", maybe(SWITCHED), "a finished switched run held against the reference, null without --switched"),
    later=("kinetic_share_estimated", "modes", "unsigned_parts", "health", "quality", "quality_reasons", "parts",
           *keys.LATER),
))  # fmt: skip
COMPARED = ("", "switched", "reference")


def as_table(answer: Verdict, shown: Shown) -> str:
    """The verdict and its reasons, what it rests on, and the measures of the pair."""
    lines = tables.in_line(
        (name, value)
        for name, value in MEASURES.plain(answer).items()
        if value is not None
    )
    reasons = [f"  {make_printable(reason)}" for reason in answer.reasons]
    if answer.switched:
        lines += ["", *_comparison(answer.switched)]
    graded = (
        [("quality", answer.quality.told), *statements(answer.quality)]
        if answer.quality
        else []
    )
    head = [("verdict", told(answer)), *graded]
    above = tables.in_line(heading(answer.situation, verbose=shown.verbose))
    return "\n".join([*tables.in_line(head), *reasons, "", *above, "", *lines])


def as_markdown(answer: Verdict, _: Shown) -> str:
    """The measures as a Markdown table of two columns, and the reasons below it."""
    table = tables.as_markdown(
        ("measure", "value"),
        list({**MEASURES.plain(answer), **_of_switched(answer)}.items()),
    )
    return "\n".join(
        [table, *(f"\n* {tables.in_markdown(reason)}" for reason in answer.reasons)]
    )


def measures(answer: Verdict) -> dict[str, Any]:
    """Each measure by its key, those of a switched run with ``switched_`` before them, and the reasons as one text."""
    situation = answer.situation
    measured = {
        "energy_td": situation.energy_td,
        "kinetic_share": situation.kinetic_share,
        **MEASURES.plain(answer),
    }
    return {**measured, **_of_switched(answer), "reasons": "; ".join(answer.reasons)}


def as_csv(answer: Verdict, _: Shown) -> str:
    """One row, a column for each key of `measures`."""
    found = measures(answer)
    return tables.as_csv(list(found), [list(found.values())]).rstrip("\n")


def told(answer: Verdict) -> str:
    """The verdict, and what a pair that verifies keeps."""
    if not answer.verified:
        return answer.word
    if answer.situation.at_rest:
        return f"{answer.word}: tr lies in the flight, and nothing vibrates there"
    held = (
        "its level is"
        if answer.situation.basis == "energy"
        else "its sign matches and its error is"
    )
    return f"{answer.word}: tr lies in the flight, {held} within the tolerance"


def comparison(switched: Comparison) -> list[tuple[str, float, float]]:
    """Rows of numbers that both runs have, below ``COMPARED``."""
    return [
        ("energy right after td", switched.energy_frozen, switched.energy_td),
        ("mean energy after td", switched.mean_after, switched.mean_after_reference),
        (
            "standard deviation after td",
            switched.spread_after,
            switched.spread_after_reference,
        ),
    ]


def deviations(switched: Comparison) -> list[tuple[str, str]]:
    """How far the switched run moves off the reference after td."""
    error, displacement = switched.momentum_error, switched.displacement
    off = (
        []
        if error is None
        else [("largest error of the momentum after td", f"{error:.2g} of its maximum")]
    )
    return (
        off
        if displacement is None
        else [*off, ("largest displacement after td", f"{displacement:.3g}")]
    )


def _comparison(switched: Comparison) -> list[str]:
    """Lines that hold the switched run against the reference."""
    return [
        f"switched run  {make_printable(', '.join(switched.source))}; compared from td to {switched.end:.6g}",
        tables.as_text(COMPARED, comparison(switched)),
        *(f"{name.ljust(38)}  {text}" for name, text in deviations(switched)),
        *(f"note: {make_printable(note)}" for note in switched.notes),
    ]


def _of_switched(answer: Verdict) -> dict[str, Any]:
    """Measures of the switched run under names of their own; empty where there is none."""
    found = SWITCHED.plain(answer.switched) if answer.switched else {}
    found = {
        name: "; ".join(value) if name == "objections" else value
        for name, value in found.items()
    }
    return {
        f"switched_{name}": value
        for name, value in found.items()
        if name not in ("source", "notes")
    }
