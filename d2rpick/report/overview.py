"""Write the result of ``info`` as a table, JSON, CSV or Markdown."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Final

from d2rpick.base.errors import COPY_AGAIN, list_names, make_printable
from d2rpick.choice.pair.grades import DO_NOT_USE, USE, USE_WITH_CARE
from d2rpick.flight import SOURCES
from d2rpick.flight.flight import NEVER_FLIES
from d2rpick.histories.source import find_earlier_legs, find_unread_legs
from d2rpick.report import keys, tables
from d2rpick.report.fields import Document, Field, get_kind, many, maybe, one_of, row
from d2rpick.report.formats import RepeatedQuestion
from d2rpick.report.situation import (
    list_health_columns,
    list_health_measures,
    name_evidence,
)

if TYPE_CHECKING:
    from collections.abc import Iterator

    from d2rpick.choice.overview import ForceOverview, Overview
    from d2rpick.flight.window import FreeFlight
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
# Largest number of contact times that are listed if a contact acts often.
_MOST_TIMES: Final = 4
_PARTS_HEAD = ("part", "title", "highest internal energy")
# Whether times can be chosen from the record. The verdict on a pair uses similar words, so the sentence names the
# record, and leaves the verdict on its windows to `plan`.
_RECORD: Final = {
    USE: "suitable for choosing times: it contains flights (d2rpick plan judges the windows in them)",
    USE_WITH_CARE: "suitable with care for choosing times: it contains flights (d2rpick plan judges the windows in "
    "them)",
    DO_NOT_USE: "do not use it to choose times",
}
_NOT_JUDGED: Final = (
    "cannot be judged until the column with the internal energy is chosen"
)
# Advice if momenta are written but show no flight.
_GIVE_END_OF_LOAD: Final = "if you know that the parts fly after a load, give its end to d2rpick plan with --after"
# Advice if the momenta that are written exclude every flight.
_RUN_WITHOUT_SWITCHING: Final = f"{NEVER_FLIES}: run it without switching"
# Advice if a load of unknown kind acts in every flight.
_EXPLAIN_LOAD: Final = (
    "write the mass and the part momenta (LS-DYNA matsum, Radioss /TH/PART), or give the deck of the run as `deck`, "
    "because it defines gravity and loads"
)
# Statement that no file names the unit of time.
_UNNAMED: Final = "unknown: the files do not name it (units of the run)"
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


def as_table(overview: Overview, display: DisplayOptions) -> str:
    """Return, as text, whether the run can be used, why, and the next command; then a line per fact, and the parts."""
    lines = tables.format_in_line(list_overview_lines(overview))
    if overview.health and (health := _list_health_rows(overview)):
        lines += [
            "",
            tables.as_text(list_health_columns(overview.health), health, display.width),
        ]
    known_facts = [
        (name, value) for name, value in list_facts(overview) if value is not None
    ]
    lines += ["", *tables.format_in_line(known_facts)]
    if overview.parts:
        lines += [
            "",
            tables.as_text(_PARTS_HEAD, _list_part_rows(overview), display.width),
        ]
    return "\n".join(
        [*lines, *(f"note: {make_printable(note)}" for note in overview.notes)]
    )


def list_overview_lines(overview: Overview) -> list[tuple[str, str]]:
    """Return whether the run can be used, why, its flights, and the next command, as (name, sentence) pairs."""
    record = _NOT_JUDGED if overview.energies else _RECORD[overview.verdict]
    lines = [("record", record), ("why", overview.reason)]
    lines += [("flight", _format_flight(*flight)) for flight in overview.flights]
    if overview.energies:
        return [*lines, ("next", _name_step_to_energy(overview))]
    earlier = find_earlier_legs(overview.source)
    later = find_unread_legs(overview.source)
    if earlier or later:
        which = [*_list_given_selection(overview)]
        files = tables.make_positional((*earlier, *overview.source, *later))
        line = tables.quote_shell_line(("d2rpick", "info", *which, *files))
        which_legs = "other" if earlier else "later"
        return [
            *lines,
            ("next", f"read the {which_legs} restart segments too with {line}"),
        ]
    if overview.verdict == DO_NOT_USE:
        is_known = overview.unjudged or overview.rigid
        if overview.rigid and not overview.unjudged:
            # Imported here to keep start-up fast.
            from d2rpick.report.next_step import name_step_after_switched_run

            question = RepeatedQuestion(files=overview.source)
            return [*lines, ("next", name_step_after_switched_run(question))]
        if is_known:
            return lines
        if overview.is_loaded:
            return [*lines, ("to improve", _EXPLAIN_LOAD)]
        if not overview.complete:
            return [*lines, ("to improve", COPY_AGAIN)]
        missing = overview.should_write
        without_output = (
            _RUN_WITHOUT_SWITCHING if overview.never_flies else _GIVE_END_OF_LOAD
        )
        cure = f"write {missing}" if missing else without_output
        return [*lines, ("to improve", f"{_ask_for_states(overview)}{cure}")]
    which = [*_list_selection_options(overview)]
    deck = ["--deck", overview.deck] if overview.deck else []
    command = ["d2rpick", "plan", *which, *deck]
    command += tables.make_positional(overview.source)
    return [*lines, ("next", tables.quote_shell_line(command))]


def _name_step_to_energy(overview: Overview) -> str:
    """Return the command that judges the first of the columns that may contain the internal energy."""
    first, *others = overview.energies
    files = tables.make_positional(overview.source)
    line = tables.quote_shell_line(("d2rpick", "info", "--energy", first, *files))
    hint = f" (or another column instead of {first}: {', '.join(others)})"
    return f"{line}{hint if others else ''}"


def _ask_for_states(overview: Overview) -> str:
    """Return the advice to write more states if those of the record are too few to show a flight; otherwise empty."""
    if (
        overview.states is None
        or overview.time_start is None
        or overview.time_end is None
    ):
        return ""
    # Imported here to keep start-up fast.
    from d2rpick.report.next_step import ask_for_states_that_show_flight

    return ask_for_states_that_show_flight(
        overview.states, overview.time_start, overview.time_end
    )


def _list_given_selection(overview: Overview) -> Iterator[str]:
    """Yield the options with which the user selected columns and parts."""
    selection = overview.selection
    if selection.time is not None:
        yield from ("--time", selection.time)
    for name in selection.energy:
        yield from ("--energy", name)
    for quantity, name in selection.channels:
        yield from ("--channel", f"{quantity}={name}")
    for name in selection.parts:
        yield from ("--part", name)
    for name in selection.flying:
        yield from ("--flying", name)


def _list_selection_options(overview: Overview) -> Iterator[str]:
    """Yield the options that select the same columns and parts; by default, the flying parts, otherwise all parts."""
    yield from _list_given_selection(overview)
    selection = overview.selection
    if selection.energy or selection.parts or not overview.parts:
        return
    flying = any(flight.parts for _, flight in overview.flights)
    yield from ("--part", "flying" if flying else "all")


def as_markdown(overview: Overview, _: DisplayOptions) -> str:
    """Return the facts and the parts as Markdown tables, followed by the notes."""
    verdict_lines = tables.format_as_list(list_overview_lines(overview))
    known_facts = [
        (name, value) for name, value in list_facts(overview) if value is not None
    ]
    fact_table = tables.as_markdown(("what", "value"), known_facts)
    if overview.parts:
        parts = [tables.as_markdown(_PARTS_HEAD, _list_part_rows(overview))]
    else:
        parts = []
    listed = _list_health_rows(overview)
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
        "flights": "; ".join(_format_flight(*flight) for flight in overview.flights),
        "should_write": overview.should_write,
        "health": "; ".join(
            f"{measure_name} {value}"
            for measure_name, value, *_ in _list_health_rows(overview)
        ),
        "notes": "; ".join(overview.notes),
        "verdict": overview.verdict,
        "verdict_reason": overview.reason,
        "contact_forces": "; ".join(map(_format_force, overview.contact_forces)),
    }
    return tables.as_csv(list(row), [list(row.values())]).rstrip("\n")


def list_facts(overview: Overview) -> list[tuple[str, tables.Cell]]:
    """Return each fact as a (name, value) pair."""
    sampling = overview.sampling
    rows: list[tuple[str, tables.Cell]] = [
        ("source", ", ".join(overview.source)),
        ("format", overview.format),
        ("version", overview.version or None),
        ("title", overview.title or None),
        ("states", overview.states),
        ("first time", overview.time_start),
        ("last time", overview.time_end),
        ("time unit", overview.time_unit or _UNNAMED),
        ("shortest interval", sampling.min if sampling else None),
        ("median interval", sampling.median if sampling else None),
        ("longest interval", sampling.max if sampling else None),
        ("complete", _describe_completeness(overview)),
        ("channels", ", ".join(_list_distinct_channels(overview)) or None),
    ]
    rows += [
        ("contact force", _format_force(force)) for force in overview.contact_forces
    ]
    if overview.should_write:
        rows.append(("should write", overview.should_write))
    return rows


def _list_distinct_channels(overview: Overview) -> list[str]:
    """Return the channels; of those whose names differ only in case and separators, only the first."""
    channels = {
        re.sub("[^a-z0-9]+", "_", channel.lower()): channel
        for channel in reversed(overview.channels)
    }
    return [channel for channel in overview.channels if channel in channels.values()]


def _describe_completeness(overview: Overview) -> bool | None:
    """Return whether the file ends with a whole state; None if it cannot be used anyway, where "yes" would mislead."""
    is_refused = overview.verdict == DO_NOT_USE
    return None if overview.complete and is_refused else overview.complete


def _list_health_rows(overview: Overview) -> list[list[tables.Cell]]:
    """Return the health quantities for which the files have data, each with the limit of good practice."""
    if overview.health is None:
        return []
    verdicts = {True: "within limit", False: "exceeded", None: None}
    return [
        [
            health_measure.what,
            health_measure.value,
            health_measure.limit,
            verdicts[health_measure.good],
        ]
        for health_measure in list_health_measures(overview.health)
        if health_measure.value
    ]


def _list_part_rows(overview: Overview) -> list[list[tables.Cell]]:
    return [
        [overview_part.part.id, overview_part.part.title, overview_part.energy_max]
        for overview_part in overview.parts
    ]


def _format_force(force: ForceOverview) -> str:
    """Return the name of a contact and the times at which it acts, as text."""
    times = [f"{start:.6g} to {end:.6g}" for start, end in force.acts]
    when = f"acts from {list_names(times, most=_MOST_TIMES)}" if times else "never acts"
    return f"{force.name} {when}"


def _format_flight(source: str, flight: FreeFlight) -> str:
    names = [part.name if part.title else str(part.id) for part in flight.parts or ()]
    flying = ", ".join(names) or "the whole model"
    if flight.end_seen:
        end = f"to {flight.end:.6g}"
    else:
        end = f"to the end of the record, {flight.end:.6g}"
    return f"{flying} from {flight.start:.6g} {end} ({name_evidence(source)})"
