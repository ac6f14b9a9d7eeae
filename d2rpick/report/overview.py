"""Write the result of ``info`` as JSON, CSV or Markdown."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from d2rpick.flight import SOURCES
from d2rpick.report import keys, tables
from d2rpick.report.fields import Document, Field, get_kind, many, maybe, one_of, row
from d2rpick.report.overview_table import (
    PARTS_HEAD,
    format_flight,
    format_force,
    list_facts,
    list_health_rows,
    list_overview_lines,
    list_part_rows,
)
from d2rpick.report.situation import list_health_columns

if TYPE_CHECKING:
    from d2rpick.choice.overview import Overview
    from d2rpick.report.formats import DisplayOptions

_EVIDENCE: Final = one_of(*(source for source in SOURCES if source != "given"))
_FLIGHT: Final = row(
    Field("start", "number", "start of the flight", lambda flight: flight[1].start),
    Field("end", "number?", "end of the flight; null if the record ends in flight",
          lambda flight: flight[1].end if flight[1].end_seen else None),
    Field("parts", maybe(many(keys.PART)), "parts that fly together; null for the whole model",
          lambda flight: flight[1].parts or None),
    Field("source", _EVIDENCE, "evidence for the flight", lambda flight: flight[0]),
)  # fmt: skip
_TIMES: Final = row(
    Field("start", "number", "first time of the interval", lambda times: times[0]),
    Field("end", "number", "last time of the interval", lambda times: times[1]),
)
_FORCE: Final = row(
    Field(
        "name",
        "text",
        "name of a contact, interface, rigid wall, or column of forces",
    ),
    Field(
        "acts",
        many(_TIMES),
        "intervals in which the force acts, accurate to one output interval",
    ),
)
_PART: Final = row(
    *keys.PART.of_part(lambda overview_part: overview_part.part),
    Field(
        "energy_max",
        "number?",
        "highest internal energy; null if a state does not contain the value",
    ),
)
_SAMPLING: Final = row(
    *(
        Field(key, get_kind("number", exclusiveMinimum=0), f"{extent} output interval")
        for key, extent in (
            ("min", "shortest"),
            ("median", "median"),
            ("max", "longest"),
        )
    )
)
DOCUMENT: Final = Document("d2rpick/info/1", "Answer of d2rpick info; times in the unit of the history.", row(
    keys.WARNINGS,
    Field("source", get_kind("texts", minItems=1), "files of the run"),
    Field("format", "text", "format; the formats of companion files are joined by ' + '"),
    Field("version", "text", "version of the solver; empty if no file contains it"),
    Field("title", "text", "title of the run; empty if no file contains it"),
    Field("states", maybe(get_kind("integer", minimum=0)),
          "number of states; null if the time column is ambiguous. In this case, and for 0 states, the times are "
          "null"),
    Field("time_start", "number?", "time of the first state"), Field("time_end", "number?", "time of the last state"),
    Field("time_unit", "text", "unit of the times; empty if no file contains it"),
    Field("sampling", maybe(_SAMPLING),
          "output intervals; null for a single state"),
    Field("complete", "flag", "false if the file ends within a state"),
    Field("channels", "texts", "names of the quantities in the files, such as internal_energy"),
    Field("parts", many(_PART), "parts in the files"),
    Field("flights", many(_FLIGHT), "free flights, found from the best evidence in the files"),
    Field("should_write", "text?",
          "output to request so that the flights of single parts are known; null if the files contain it"),
    keys.HEALTH,
    Field("notes", "texts", "what was left out or assumed when the files were read"),
    Field("verdict", keys.VERDICT, "whether this run is suitable for choosing switch times", later=True),
    Field("verdict_reason", "text", "reason for the verdict, as text", lambda overview: overview.reason, later=True),
    Field("contact_forces", many(_FORCE), "contacts and rigid walls whose forces are in the files", later=True),
))  # fmt: skip
# Keys of the JSON output whose value is neither a list nor an object.
_PLAIN = (
    "format",
    "version",
    "title",
    "states",
    "time_start",
    "time_end",
    "time_unit",
    "complete",
)


def as_markdown(overview: Overview, _: DisplayOptions) -> str:
    """Return the facts and the parts as Markdown tables, followed by the notes."""
    verdict_lines = tables.format_as_list(list_overview_lines(overview))
    known_facts = [
        (name, value) for name, value in list_facts(overview) if value is not None
    ]
    fact_table = tables.as_markdown(("what", "value"), known_facts)
    if overview.parts:
        parts = [tables.as_markdown(PARTS_HEAD, list_part_rows(overview))]
    else:
        parts = []
    listed = list_health_rows(overview)
    if overview.health and listed:
        health = [tables.as_markdown(list_health_columns(overview.health), listed)]
    else:
        health = []
    return "\n\n".join(
        [
            *verdict_lines,
            fact_table,
            *parts,
            *health,
            *(f"* {tables.escape_markdown(note)}" for note in overview.notes),
        ]
    )


def as_csv(overview: Overview, _: DisplayOptions) -> str:
    """Return one row of CSV with a column per key of the JSON output; semicolons separate the items of a list."""
    sampling = overview.sampling
    row: dict[str, tables.Cell] = {
        "source": "; ".join(overview.source),
        **{name: getattr(overview, name) for name in _PLAIN},
        **{
            f"sampling_{name}": getattr(sampling, name) if sampling else None
            for name in ("min", "median", "max")
        },
        "channels": "; ".join(overview.channels),
        "parts": "; ".join(
            f"{overview_part.part.id} {overview_part.part.title}".rstrip()
            for overview_part in overview.parts
        ),
        "flights": "; ".join(format_flight(*flight) for flight in overview.flights),
        "should_write": overview.should_write,
        "health": "; ".join(
            f"{measure_name} {value}"
            for measure_name, value, *_ in list_health_rows(overview)
        ),
        "notes": "; ".join(overview.notes),
        "verdict": overview.verdict,
        "verdict_reason": overview.reason,
        "contact_forces": "; ".join(map(format_force, overview.contact_forces)),
    }
    return tables.as_csv(list(row), [list(row.values())]).rstrip("\n")
