"""The answer of ``info`` as table, JSON, CSV and Markdown."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from d2rpick.base.errors import list_names, make_printable
from d2rpick.choice.grades import DO_NOT_USE
from d2rpick.report import keys, tables
from d2rpick.report.fields import Document, Field, kind_of, many, maybe, one_of, row
from d2rpick.report.situation import head, measures_of, spoken

if TYPE_CHECKING:
    from d2rpick.choice.overview import ForceOverview, Overview
    from d2rpick.flight.window import FreeFlight
    from d2rpick.report.formats import Shown

_EVIDENCE: Final = one_of(
    "momentum",
    "contact-force",
    "contact-energy",
    "energy-balance",
    "oscillator",
    "energy",
)
_FLIGHT: Final = row(
    Field("start", "number", get=lambda seen: seen[1].start),
    Field("end", "number?", "null where the record ends in flight",
          lambda seen: seen[1].end if seen[1].end_seen else None),
    Field("parts", maybe(many(keys.PART)), "that fly together, null for the whole model",
          lambda seen: seen[1].parts or None),
    Field("source", _EVIDENCE, get=lambda seen: seen[0]),
)  # fmt: skip
_TIMES: Final = row(
    Field("start", "number", get=lambda times: times[0]),
    Field("end", "number", get=lambda times: times[1]),
)
_FORCE: Final = row(
    Field(
        "name",
        "text",
        "of a contact, an interface or a rigid wall, or of a column of forces",
    ),
    Field("acts", many(_TIMES), "times in which it acts, to one output interval"),
)
_PART: Final = row(
    *keys.PART.of_part(lambda one: one.part),
    Field("energy_max", "number?", "null where not written in every state"),
)
_SAMPLING: Final = row(
    *(
        Field(key, kind_of("number", exclusiveMinimum=0))
        for key in ("min", "median", "max")
    )
)
DOCUMENT: Final = Document("d2rpick/info/1", "Answer of d2rpick info; times in the unit of the history.", row(
    keys.WARNINGS,
    Field("source", kind_of("texts", minItems=1)),
    Field("format", "text", "formats of companions joined by ' + '"),
    Field("version", "text", "of the solver, empty where no file names it"),
    Field("title", "text"),
    Field("states", maybe(kind_of("integer", minimum=0)),
          "null where several columns may be the time; then, and at 0, the times are null"),
    Field("time_start", "number?"), Field("time_end", "number?"),
    Field("time_unit", "text", "empty where no file names it"),
    Field("sampling", maybe(_SAMPLING),
          "output intervals, null with a single state"),
    Field("complete", "flag", "false when the input ends within a state"),
    Field("channels", "texts"),
    Field("parts", many(_PART)),
    Field("flights", many(_FLIGHT), "windows of free flight, by the best evidence that the files hold"),
    Field("should_write", "text?",
          "output of the solver that would show the flights for sure, null where the files have it"),
    keys.HEALTH,
    Field("notes", "texts"),
    Field("verdict", keys.VERDICT, "whether to choose switch times by this run", later=True),
    Field("verdict_reason", "text", "why, in words", lambda overview: overview.reason, later=True),
    Field("contact_forces", many(_FORCE), "contacts and rigid walls whose forces are written", later=True),
))  # fmt: skip
_MOST_TIMES: Final = 4  # that are named of a contact which acts at many
_PARTS_HEAD = ("part", "title", "highest internal energy")
# Keys of the JSON output with a single value.
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


def as_table(overview: Overview, shown: Shown) -> str:
    """Whether the run can be used, why, and what to type next; then a line per fact, and the parts."""
    lines = tables.in_line(verdict(overview))
    if overview.health and (health := _health(overview)):
        lines += ["", tables.as_text(head(overview.health), health, shown.width)]
    known = [(name, value) for name, value in facts(overview) if value is not None]
    lines += ["", *tables.in_line(known)]
    if overview.parts:
        lines += ["", tables.as_text(_PARTS_HEAD, _parts(overview), shown.width)]
    return "\n".join(
        [*lines, *(f"note: {make_printable(note)}" for note in overview.notes)]
    )


def verdict(overview: Overview) -> list[tuple[str, str]]:
    """Whether the run can be used, why, its flights, and what to type next; a name and a sentence each."""
    lines = [("this run", overview.verdict), ("why", overview.reason)]
    lines += [("flight", _flight(*flight)) for flight in overview.flights]
    if overview.verdict == DO_NOT_USE:
        cure = None if overview.unjudged else overview.should_write
        return [*lines, ("to improve", cure)] if cure else lines
    flying = any(flight.parts for _, flight in overview.flights)
    which = (
        ["--part", "flying"] if flying else ["--part", "all"] if overview.parts else []
    )
    command = ["d2rpick", "plan", *which, *tables.positional(overview.source)]
    return [*lines, ("next", tables.shell_line(command))]


def as_markdown(overview: Overview, _: Shown) -> str:
    """The facts as a Markdown table of two columns, another one of the parts, and the notes below."""
    said = tables.listed(verdict(overview))
    known = [(name, value) for name, value in facts(overview) if value is not None]
    told = tables.as_markdown(("what", "value"), known)
    parts = (
        [tables.as_markdown(_PARTS_HEAD, _parts(overview))] if overview.parts else []
    )
    listed = _health(overview)
    health = (
        [tables.as_markdown(head(overview.health), listed)]
        if overview.health and listed
        else []
    )
    return "\n\n".join(
        [
            *said,
            told,
            *parts,
            *health,
            *(f"* {tables.in_markdown(note)}" for note in overview.notes),
        ]
    )


def as_csv(overview: Overview, _: Shown) -> str:
    """One row, a column for each key of the JSON output, what is a list there with semicolons."""
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
            f"{one.part.id} {one.part.title}".rstrip() for one in overview.parts
        ),
        "flights": "; ".join(_flight(*flight) for flight in overview.flights),
        "should_write": overview.should_write,
        "health": "; ".join(f"{what} {value}" for what, value, *_ in _health(overview)),
        "notes": "; ".join(overview.notes),
        "verdict": overview.verdict,
        "verdict_reason": overview.reason,
        "contact_forces": "; ".join(map(_force, overview.contact_forces)),
    }
    return tables.as_csv(list(row), [list(row.values())]).rstrip("\n")


def facts(overview: Overview) -> list[tuple[str, tables.Cell]]:
    """Name each fact, and give it."""
    sampling = overview.sampling
    rows: list[tuple[str, tables.Cell]] = [
        ("source", ", ".join(overview.source)),
        ("format", overview.format),
        ("version", overview.version or None),
        ("title", overview.title or None),
        ("states", overview.states),
        ("first time", overview.time_start),
        ("last time", overview.time_end),
        ("time unit", overview.time_unit or None),
        ("shortest interval", sampling.min if sampling else None),
        ("median interval", sampling.median if sampling else None),
        ("longest interval", sampling.max if sampling else None),
        ("complete", overview.complete),
        ("channels", ", ".join(overview.channels) or None),
    ]
    rows += [("contact force", _force(force)) for force in overview.contact_forces]
    if overview.should_write:
        rows.append(("should write", overview.should_write))
    return rows


def _health(overview: Overview) -> list[list[tables.Cell]]:
    """Measures that the files hold, with what practice allows."""
    if overview.health is None:
        return []
    verdicts = {True: "within limit", False: "exceeded", None: None}
    return [
        [one.what, one.value, one.limit, verdicts[one.good]]
        for one in measures_of(overview.health)
        if one.value
    ]


def _parts(overview: Overview) -> list[list[tables.Cell]]:
    return [[one.part.id, one.part.title, one.energy_max] for one in overview.parts]


def _force(force: ForceOverview) -> str:
    """Name a contact and the times in which it acts."""
    times = [f"{start:.6g} to {end:.6g}" for start, end in force.acts]
    when = f"acts from {list_names(times, most=_MOST_TIMES)}" if times else "never acts"
    return f"{force.name} {when}"


def _flight(source: str, flight: FreeFlight) -> str:
    names = [part.name if part.title else str(part.id) for part in flight.parts or ()]
    who = ", ".join(names) or "the whole model"
    end = (
        f"to {flight.end:.6g}"
        if flight.end_seen
        else f"to the end of the record, {flight.end:.6g}"
    )
    return f"{who} from {flight.start:.6g} {end} ({spoken(source)})"
