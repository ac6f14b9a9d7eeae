"""Write the results of a ``rollover`` scan as a table, JSON, CSV or Markdown."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final, NamedTuple

from d2rpick.models.box_run import BOX, Outcome, Record
from d2rpick.report import keys, tables
from d2rpick.report.fields import Document, Field, many, row, write_csv

if TYPE_CHECKING:
    from collections.abc import Sequence

    from d2rpick.base.errors import Caution
    from d2rpick.choice.answers import PairSuggestion
    from d2rpick.report.formats import DisplayOptions

# Fields of a run in the JSON output, which are also the columns of the table.
RUN: Final = row(
    keys.TR,
    Field("energy", "number", "internal energy of the box at tr"),
    Field("energy_ratio", "number", "energy divided by energy_td"),
    Field("roll_error", "number", "error of the roll angle at td"),
    Field("x_error", "number", "horizontal position error of the centre of mass at td"),
    Field("z_error", "number", "vertical position error of the centre of mass at td"),
    Field("omega_error", "number", "error of the roll rate at td"),
    Field("lost_energy", "number", "kinetic energy of the vibration at tr"),
    Field(
        "mean_ratio",
        "number",
        "mean energy of the box from td to the landing, divided by the mean in the reference run",
    ),
    closed=True,
)
DOCUMENT: Final = Document(
    "d2rpick/rollover/1",
    "Switched runs of the rollover box, compared with the reference run; SI units, roll_error in degrees.",
    row(
        keys.WARNINGS,
        Field(
            "released",
            "number?",
            "time of the last sled force",
            lambda scan: scan.reference.released,
        ),
        Field(
            "landed",
            "number?",
            "time of the first ground force; null if the run ends earlier",
            lambda scan: scan.reference.landed,
        ),
        keys.TD._replace(get=lambda scan: scan.answer.situation.td),
        Field(
            "energy_td",
            "number",
            "internal energy of the box at td in the reference run",
            lambda scan: _interpolate_energy(scan.reference, scan.answer.situation.td),
        ),
        Field(
            "recommended",
            "number?",
            "tr that suggest recommends",
            lambda scan: _get_recommended_tr(scan.answer),
        ),
        Field(
            "runs",
            many(RUN),
            "switched runs, compared with the reference run",
            lambda scan: scan.outcomes,
        ),
        title="d2rpick rollover --scan",
    ),
)


class Scan(NamedTuple):
    """Runs switched at many tr, the ``reference`` run, and the recommendation derived from the reference run."""

    reference: Record
    outcomes: Sequence[Outcome]
    answer: PairSuggestion
    cautions: Sequence[Caution]


def as_table(scan: Scan, display: DisplayOptions) -> str:
    """Return as text the events of the reference run, one row per tr, and the error of the recommended tr."""
    reference, outcomes, answer, _ = scan
    td = answer.situation.td
    recommended = _get_recommended_tr(answer)
    above = [
        (
            "load",
            f"until {_format_time(reference.released)} s; next contact: {_describe_landing(reference.landed)}",
        ),
        (
            "td",
            f"{td:.6g} s: energy of the box {_interpolate_energy(reference, td):.6g} J",
        ),
        ("units", "s, J, m, rad/s; roll_error in degrees"),
    ]
    rows = [
        ["*" if outcome.tr == recommended else "", *_list_short_values(outcome)]
        for outcome in outcomes
    ]
    recommendation = "none"
    if chosen := next(
        (outcome for outcome in outcomes if outcome.tr == recommended), None
    ):
        error = abs(chosen.roll_error)
        largest_error = max(abs(outcome.roll_error) for outcome in outcomes)
        share = error / largest_error
        recommendation = f"tr = {chosen.tr:.6g}: roll error {error:.3g} degrees, {share:.2g} of the largest"
    shown_rows = tables.as_text(("", *RUN.keys), rows, display.width)
    return "\n".join(
        [
            *tables.format_in_line(above),
            "",
            shown_rows,
            "",
            f"recommended  {recommendation}",
        ]
    )


def as_markdown(scan: Scan, _: DisplayOptions) -> str:
    """Return a Markdown table with one row for each tr."""
    return tables.as_markdown(
        RUN.keys, [_list_short_values(outcome) for outcome in scan.outcomes]
    )


def as_csv(scan: Scan, _: DisplayOptions) -> str:
    """Return CSV with one row for each tr, at full precision."""
    return write_csv(RUN.keys, map(RUN.plain, scan.outcomes))


def _get_recommended_tr(answer: PairSuggestion) -> float | None:
    return answer.recommended.tr if answer.recommended else None


def _list_short_values(outcome: Outcome) -> list[tables.Cell]:
    """Return the table cells of a run with four digits; they suffice, because runs differ in the second digit."""
    return [float(f"{value:.4g}") for value in RUN.plain(outcome).values()]


def _format_time(time: float | None) -> str:
    return "-" if time is None else f"{time:.6g}"


def _describe_landing(time: float | None) -> str:
    """Return the time of the next contact as text; say so if the run ends before it."""
    return "none before the end of the run" if time is None else f"at {time:.6g} s"


def _interpolate_energy(reference: Record, time: float) -> float:
    return float(reference.internal_energy[abs(reference.time - time).argmin(), BOX])
