"""Write the result of ``drive`` as a table and JSON."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from d2rpick.report import keys, tables
from d2rpick.report.fields import Document, Field, many, row

if TYPE_CHECKING:
    from d2rpick.report.formats import Shown
    from d2rpick.running.drive import Driven

_WINDOW: Final = row(
    Field("free", "number", "since when no force has acted"),
    Field("wait", "number", "time without force that was asked for"),
    Field("tr", "number"), Field("td", "number"),
    Field("contact", "number?", "first contact of the rigid body; null where the run ended before"),
    Field("reason", "text?", "why the flight was left out, deformable from tr to td; null where it was switched"),
)  # fmt: skip
_LEG: Final = row(
    Field("kind", "text", "load, probe or rigid"),
    Field("length", "number"),
    Field("cycles", "integer?"),
    Field("cpu", "number?", "processor time [s]"),
)
DOCUMENT: Final = Document("d2rpick/drive/1", "Answer of d2rpick drive; times in the unit of the deck.", row(
    keys.WARNINGS,
    Field("windows", many(_WINDOW)),
    Field("legs", many(_LEG), "in the order they were computed, with those that were thrown away"),
    Field("saved_by_model", "number?", "share of a deformable run, by the cost model", lambda one: one.saved[0]),
    Field("saved_by_time", "number?", "the same, by the processor time of the legs", lambda one: one.saved[1]),
))  # fmt: skip
_NOT_KNOWN: Final = "without a reference no level at td is matched: what keeps of the vibration is an expectation"


def as_table(found: Driven, shown: Shown) -> str:
    """Return the rigid windows, the CPU time of the restart segments, and what was saved."""
    parts = [
        tables.as_text(*windows(found), shown.width) if found.windows else "no window",
        tables.as_text(*legs(found), shown.width),
    ]
    return "\n\n".join([*parts, "\n".join(tables.in_line(outlook(found), 9))])


def windows(found: Driven) -> tuple[list[str], list[list[tables.Cell]]]:
    """Return the column names and rows of the flights; ``deformable`` is the deformable time of a flight."""
    columns = {
        "flight": lambda one: one.free, "wait": lambda one: f"{one.wait:.4g}",
        "tr": lambda one: None if one.reason else one.tr, "td": lambda one: None if one.reason else one.td,
        "contact": lambda one: one.contact,
        "margin": lambda one: None if one.contact is None or one.reason else f"{one.contact - one.td:.3g}",
        "deformable": lambda one: f"{(one.contact if one.reason and one.contact else one.tr) - one.free:.3g}",
        "status": lambda one: f"left out: {one.reason}" if one.reason else "switched",
    }  # fmt: skip
    return tables.filled(columns, found.windows)


def legs(found: Driven) -> tuple[list[str], list[list[tables.Cell]]]:
    """Return the column names and the rows of the restart segments, one row per kind."""
    rows: list[list[tables.Cell]] = []
    for kind in dict.fromkeys(one.kind for one in found.legs):
        own = [one for one in found.legs if one.kind == kind]
        if any(one.cpu is None for one in own):
            cpu = None
        else:
            cpu = f"{sum(one.cpu or 0.0 for one in own):.4g}"
        rows.append(
            [
                kind,
                len(own),
                f"{sum(one.length for one in own):.4g}",
                sum(one.cycles or 0 for one in own),
                cpu,
            ]
        )
    return ["kind", "legs", "time", "cycles", "CPU s"], rows


def outlook(found: Driven) -> list[tuple[str, str]]:
    """Return what was saved and what to keep in mind, as pairs of a name and a sentence."""
    words = zip(
        found.saved,
        ("by the cost model", "by the processor time of its legs"),
        strict=True,
    )
    saved = [f"{value:.0%} {by}" for value, by in words if value is not None]
    if saved:
        lines = [("saves", f"{', '.join(saved)}, against a deformable run")]
    else:
        lines = []
    lines += [
        ("place", one.message) for one in found.cautions if one.code == "out-of-place"
    ]
    return [
        *lines,
        *([("wait", found.why)] if found.why else []),
        ("keeps", _NOT_KNOWN),
    ]
