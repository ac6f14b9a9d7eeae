"""Write the result of ``verify`` as a table, JSON, CSV and Markdown."""

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

# the judged pair, its measures and the verdict
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


def as_table(answer: Verdict, display: Shown) -> str:
    """Return the verdict, why, and what would be better; then its evidence, and the measures of the pair."""
    decided = answer.decision.reason
    remarks = [("note", reason) for reason in answer.reasons if reason not in decided]
    above = heading(answer.situation, verbose=display.verbose)
    lines = tables.in_line(verdict(answer))
    if answer.switched:
        lines += ["", *_comparison(answer.switched)]
    listed = [*facts(answer), *above, *remarks]
    printable = [(name, make_printable(text)) for name, text in listed]
    return "\n".join(
        [*lines, "", *tables.in_line(printable), "", *tables.in_line(measured(answer))]
    )


def verdict(answer: Verdict) -> list[tuple[str, str]]:
    """Return what to do with the pair, why, and what would be better, as pairs of a name and a sentence."""
    return headed(answer.decision, answer.candidate.tr, answer.td)


def facts(answer: Verdict) -> list[tuple[str, str]]:
    """Return the evidence for the verdict, the rigid time, and the accuracy of tr, each with its name."""
    best = answer.candidate
    lines = [*statements(answer.decision), ("rigid for", rigid_for(best))]
    if best.run_time_share is not None:
        lines.append(("saves", saved(best.run_time_share)))
    if exact := accuracy(best):
        lines.append(("tr", exact))
    return lines


def measured(answer: Verdict) -> list[tuple[str, tables.Cell]]:
    """Return the known measures of the pair with their names for people."""
    best = answer.candidate
    direction = {True: "the same", False: "opposite", None: None}[best.sign_match]
    rows: list[tuple[str, tables.Cell]] = [
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
    return [row for row in rows if row[1] is not None]


def as_markdown(answer: Verdict, _: Shown) -> str:
    """Return the verdict, and the measures as a Markdown table of two columns."""
    paragraphs = tables.listed((*verdict(answer), *facts(answer)))
    table = tables.as_markdown(("measure", "value"), measured(answer))
    switched = answer.switched
    if switched:
        compared = [
            tables.as_markdown(COMPARED, comparison(switched)),
            *tables.listed(deviations(switched)),
        ]
    else:
        compared = []
    reasons = [f"* {tables.in_markdown(reason)}" for reason in answer.reasons]
    return "\n\n".join([*paragraphs, table, *compared, *reasons])


def measures(answer: Verdict) -> dict[str, Any]:
    """Return each measure by its key, those of a switched run with the prefix ``switched_``; reasons are one text."""
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
    """Return one row of CSV with a column for each key of `measures`."""
    values = measures(answer)
    return tables.as_csv(list(values), [list(values.values())]).rstrip("\n")


def comparison(switched: Comparison) -> list[tuple[str, float, float]]:
    """Return the numbers that both runs have as rows of name, reference and switched run, below `COMPARED`."""
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
    """Return how far the switched run deviates from the reference after td, as pairs of a name and a text."""
    error = switched.momentum_error
    displacement = switched.displacement
    if error is None:
        rows = []
    else:
        rows = [
            ("largest error of the momentum after td", f"{error:.2g} of its maximum")
        ]
    if displacement is None:
        return rows
    return [*rows, ("largest displacement after td", f"{displacement:.3g}")]


def _comparison(switched: Comparison) -> list[str]:
    """Return the lines that compare the switched run with the reference."""
    return [
        f"switched run  {make_printable(', '.join(switched.source))}; compared from td to {switched.end:.6g}",
        tables.as_text(COMPARED, comparison(switched)),
        *(f"{name.ljust(38)}  {text}" for name, text in deviations(switched)),
        *(f"note: {make_printable(note)}" for note in switched.notes),
    ]


def _of_switched(answer: Verdict) -> dict[str, Any]:
    """Return the measures of the switched run under their own names, empty without a switched run."""
    values = SWITCHED.plain(answer.switched) if answer.switched else {}
    values = {
        name: "; ".join(value) if name == "objections" else value
        for name, value in values.items()
    }
    return {
        f"switched_{name}": value
        for name, value in values.items()
        if name not in ("source", "notes")
    }
