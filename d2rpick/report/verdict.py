"""The answer of ``verify`` as table, JSON, CSV and Markdown."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

from d2rpick.base.errors import make_printable
from d2rpick.report import keys, tables
from d2rpick.report.decision import accuracy, headed, rigid_for, saved, statements
from d2rpick.report.fields import Document, Field, kind_of, maybe, row
from d2rpick.report.situation import heading

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
    Field(
        "verified",
        "flag",
        "admissible, not poor, and with a residual of at most 0.5; verdict says what to do",
    ),
)
SWITCHED: Final = row(
    Field("source", kind_of("texts", minItems=1)),
    Field("energy_frozen", "number", "came back at td"),
    Field("energy_td", "number", "of the reference at td"),
    Field("level_ratio", "number?", "energy_frozen over energy_td"),
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
    """The verdict, why, and what would be better; then what it rests on, and the measures of the pair."""
    decided = answer.decision.reason
    remarks = [("note", what) for what in answer.reasons if what not in decided]
    above = heading(answer.situation, verbose=shown.verbose)
    lines = tables.in_line(verdict(answer))
    if answer.switched:
        lines += ["", *_comparison(answer.switched)]
    listed = [*facts(answer), *above, *remarks]
    said = [(name, make_printable(text)) for name, text in listed]
    return "\n".join(
        [*lines, "", *tables.in_line(said), "", *tables.in_line(measured(answer))]
    )


def verdict(answer: Verdict) -> list[tuple[str, str]]:
    """What to do with the pair, why, and what would be better; a name and a sentence each."""
    return headed(answer.decision, answer.candidate.tr, answer.td)


def facts(answer: Verdict) -> list[tuple[str, str]]:
    """What the verdict rests on, how long the parts are rigid, and how exactly tr is known."""
    best = answer.candidate
    lines = [*statements(answer.decision), ("rigid for", rigid_for(best))]
    if best.run_time_share is not None:
        lines.append(("saves", saved(best.run_time_share)))
    if exact := accuracy(best):
        lines.append(("tr", exact))
    return lines


def measured(answer: Verdict) -> list[tuple[str, tables.Cell]]:
    """The measures of the pair by names for people, without those that are not known."""
    best = answer.candidate
    direction = {True: "the same", False: "opposite", None: None}[best.sign_match]
    found: list[tuple[str, tables.Cell]] = [
        ("energy at tr", best.energy),
        ("energy at td", answer.energy_td),
        ("energy at tr / at td", best.level_ratio),
        ("level error", tables.shown(best.level_error, ".3f")),
        ("direction of the deformation at tr", direction),
        ("kinetic fraction at td", tables.shown(answer.kinetic_share, ".3f")),
        ("lock-in error", tables.shown(best.lock_in_error, ".3f")),
        ("residual, expected", tables.shown(best.residual, ".3f")),
        ("residual, lowest", tables.shown(best.residual_low, ".3f")),
        ("residual, highest", tables.shown(best.residual_high, ".3f")),
        ("mismatch of the parts", tables.shown(best.part_mismatch, ".3f")),
        ("timing tolerance", best.timing_tolerance),
        ("position error", best.position_error),
    ]
    return [one for one in found if one[1] is not None]


def as_markdown(answer: Verdict, _: Shown) -> str:
    """The verdict, and the measures as a Markdown table of two columns."""
    said = tables.listed((*verdict(answer), *facts(answer)))
    table = tables.as_markdown(("measure", "value"), measured(answer))
    switched = answer.switched
    compared = (
        [
            tables.as_markdown(COMPARED, comparison(switched)),
            *tables.listed(deviations(switched)),
        ]
        if switched
        else []
    )
    reasons = [f"* {tables.in_markdown(reason)}" for reason in answer.reasons]
    return "\n\n".join([*said, table, *compared, *reasons])


def measures(answer: Verdict) -> dict[str, Any]:
    """Each measure by its key, those of a switched run with ``switched_`` before them, and the reasons as one text."""
    situation = answer.situation
    measured: dict[str, Any] = {
        "energy_td": situation.energy_td,
        "kinetic_share": situation.kinetic_share,
        **MEASURES.plain(answer),
    }
    decided = {field.key: field.of(answer) for field in keys.DECISION}
    return {
        **measured,
        **_of_switched(answer),
        **decided,
        "quality": answer.decision.grade,
        "reasons": "; ".join(answer.reasons),
    }


def as_csv(answer: Verdict, _: Shown) -> str:
    """One row, a column for each key of `measures`."""
    found = measures(answer)
    return tables.as_csv(list(found), [list(found.values())]).rstrip("\n")


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
