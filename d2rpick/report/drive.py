"""Describe the progress of ``drive``, and write its result as a table and JSON."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from d2rpick.choice.pair.grades import USE, USE_WITH_CARE
from d2rpick.report import keys, tables
from d2rpick.report.fields import Document, Field, many, row

if TYPE_CHECKING:
    from d2rpick.report.formats import DisplayOptions
    from d2rpick.running.drive import Driven, Driver

_WINDOW: Final = row(
    Field("free", "number", "time from which no force acts"),
    Field("wait", "number", "force-free time"),
    keys.TR, keys.TD,
    Field("contact", "number?", "first contact of the rigid body; null if the run ended before a contact"),
    Field("reason", "text?", "reason why the parts were not switched in this flight; null if the parts were switched"),
)  # fmt: skip
_LEG: Final = row(
    Field("kind", "text", "load, probe or rigid", lambda leg: leg.order.kind),
    Field("length", "number", "simulated time of the engine run"),
    Field("cycles", "integer?", "number of time steps; null if unknown"),
    Field("cpu", "number?", "CPU time [s]"),
)
DOCUMENT: Final = Document("d2rpick/drive/1", "Answer of d2rpick drive; times in the unit of the deck.", row(
    keys.WARNINGS,
    Field("windows", many(_WINDOW), "one entry for each flight, in the order of time"),
    Field("legs", many(_LEG), "engine runs in the order of computation, including the discarded engine runs"),
    Field("saved_by_model", "number?", "saved fraction of the CPU time of a deformable run, according to the cost "
          "model",
          lambda answer: answer.saved[0]),
    Field("saved_by_time", "number?", "saved fraction according to the CPU times of the engine runs",
          lambda answer: answer.saved[1]),
))  # fmt: skip
_NOT_KNOWN: Final = (
    "without a reference run, tr is not matched to the energy at td, so the vibration after td may be "
    "wrong"
)


def describe_progress(driver: Driver, seconds: float) -> str:
    """Describe the engine run being computed, or how many ``seconds`` the starter has run before the first one."""
    order = driver.at
    if order is None:
        return f"starting ... {seconds:.0f} s"
    end = driver.limits.end
    return f"engine run {order.number}, {order.kind}: {order.start:.6g} to {order.until:.6g} of {end:g}"


def as_table(answer: Driven, display: DisplayOptions) -> str:
    """Return the rigid windows, the CPU time of the restart segments, and the savings as text."""
    parts = [
        "\n".join(tables.format_in_line(list_verdict_lines(answer))),
        tables.as_text(*list_window_rows(answer), display.width)
        if answer.windows
        else "no window",
        tables.as_text(*list_leg_rows(answer), display.width),
    ]
    remarks = tables.format_in_line(list_savings(answer), 9)
    return "\n\n".join([*parts, *(["\n".join(remarks)] if remarks else [])])


def list_verdict_lines(answer: Driven) -> list[tuple[str, str]]:
    """Return how to use the run, why, and how to look at its flights, as (name, sentence) pairs."""
    files = tables.make_positional([str(answer.run.sources[0])])
    switched_count = sum(not window.reason for window in answer.windows)
    if not switched_count:
        plan = tables.quote_shell_line(("d2rpick", "plan", *files))
        return [
            (USE, "the run as a reference run, because no part was switched"),
            ("next", f"choose times with {plan}"),
        ]
    info = tables.quote_shell_line(("d2rpick", "info", *files))
    flights = f"{switched_count} of {len(answer.windows)} flights"
    return [
        (USE_WITH_CARE, f"the run, whose parts were rigid in {flights}"),
        ("why", _NOT_KNOWN),
        ("next", f"look at the flights and the health of the run with {info}"),
    ]


def list_window_rows(answer: Driven) -> tuple[list[str], list[list[tables.Cell]]]:
    """Return the column names and rows for the flights, including the time for which the parts were deformable."""
    columns = {
        "flight": lambda window: window.free,
        "wait": lambda window: f"{window.wait:.4g}",
        "tr": lambda window: None if window.reason else window.tr,
        "td": lambda window: None if window.reason else window.td,
        "contact": lambda window: window.contact,
        "margin": lambda window: (
            None
            if window.contact is None or window.reason
            else f"{window.contact - window.td:.3g}"
        ),
        "deformable": lambda window: (
            f"{(window.contact if window.reason and window.contact else window.tr) - window.free:.3g}"
        ),
        "status": lambda window: (
            f"left out: {window.reason}" if window.reason else "switched"
        ),
    }
    return tables.fill_table(columns, answer.windows)


def list_leg_rows(answer: Driven) -> tuple[list[str], list[list[tables.Cell]]]:
    """Return the column names and rows for the restart segments, one row for each type of segment."""
    rows: list[list[tables.Cell]] = []
    for kind in dict.fromkeys(leg.order.kind for leg in answer.legs):
        legs_of_kind = [leg for leg in answer.legs if leg.order.kind == kind]
        if any(leg.cpu is None for leg in legs_of_kind):
            cpu = None
        else:
            cpu = f"{sum(leg.cpu or 0.0 for leg in legs_of_kind):.4g}"
        rows.append(
            [
                kind,
                len(legs_of_kind),
                f"{sum(leg.length for leg in legs_of_kind):.4g}",
                sum(leg.cycles or 0 for leg in legs_of_kind),
                cpu,
            ]
        )
    return ["kind", "legs", "time", "cycles", "CPU s"], rows


def list_savings(answer: Driven) -> list[tuple[str, str]]:
    """Return the savings and remarks, as (name, sentence) pairs."""
    words = zip(
        answer.saved,
        ("by the cost model", "by the CPU time of its engine runs"),
        strict=True,
    )
    saved = [f"{value:.0%} {by}" for value, by in words if value is not None]
    if saved:
        lines = [("saves", f"{', '.join(saved)}, against a deformable run")]
    else:
        lines = []
    lines += [
        ("place", caution.message)
        for caution in answer.cautions
        if caution.code == "out-of-place"
    ]
    return [*lines, *([("wait", answer.why)] if answer.why else [])]
