"""Write the result of ``info`` as a table, with the texts that its other output formats share.

This module is apart from the other formats, because a short record is described in the time that their imports take.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Final

from d2rpick.base.errors import COPY_AGAIN, list_names, make_printable
from d2rpick.choice.pair.grades import DO_NOT_USE, USE, USE_WITH_CARE
from d2rpick.flight.flight import NEVER_FLIES
from d2rpick.histories.source import find_earlier_legs, find_unread_legs
from d2rpick.report import tables
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

# Largest number of contact times that are listed if a contact acts often.
_MOST_TIMES: Final = 4
PARTS_HEAD: Final = ("part", "title", "highest internal energy")
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
_GIVE_END_OF_LOAD: Final = (
    "give the end of a load after which the parts fly to d2rpick plan with --after"
)
# Advice if the momenta that are written exclude every flight.
_RUN_WITHOUT_SWITCHING: Final = f"{NEVER_FLIES}: run it without switching"
# Advice if a load of unknown kind acts in every flight.
_EXPLAIN_LOAD: Final = (
    "write the mass and the part momenta (LS-DYNA matsum, Radioss /TH/PART), or give the deck of the run as `deck`, "
    "because it defines gravity and loads"
)
# Statement that no file names the unit of time.
_UNNAMED: Final = "unknown: the files do not name it (units of the run)"


def as_table(overview: Overview, display: DisplayOptions) -> str:
    """Return, as text, whether the run can be used, why, and the next command; then a line per fact, and the parts."""
    lines = tables.format_in_line(list_overview_lines(overview))
    if overview.health and (health := list_health_rows(overview)):
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
            tables.as_text(PARTS_HEAD, list_part_rows(overview), display.width),
        ]
    return "\n".join(
        [*lines, *(f"note: {make_printable(note)}" for note in overview.notes)]
    )


def list_overview_lines(overview: Overview) -> list[tuple[str, str]]:
    """Return the verdict on the run, its reason, the flights and the next command, as (name, sentence) pairs."""
    record = _NOT_JUDGED if overview.energies else _RECORD[overview.verdict]
    lines = [("record", record), ("why", overview.reason)]
    lines += [("flight", format_flight(*flight)) for flight in overview.flights]
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
        ("contact force", format_force(force)) for force in overview.contact_forces
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


def list_health_rows(overview: Overview) -> list[list[tables.Cell]]:
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


def list_part_rows(overview: Overview) -> list[list[tables.Cell]]:
    """Return a row for each part: its number, its title, and its highest internal energy."""
    return [
        [overview_part.part.id, overview_part.part.title, overview_part.energy_max]
        for overview_part in overview.parts
    ]


def format_force(force: ForceOverview) -> str:
    """Return the name of a contact and the times at which it acts, as text."""
    times = [f"{start:.6g} to {end:.6g}" for start, end in force.acts]
    when = f"acts from {list_names(times, most=_MOST_TIMES)}" if times else "never acts"
    return f"{force.name} {when}"


def format_flight(source: str, flight: FreeFlight) -> str:
    """Return the parts that fly in a flight, its times, and the evidence for it, as text."""
    names = [part.name if part.title else str(part.id) for part in flight.parts or ()]
    flying = ", ".join(names) or "the whole model"
    if flight.end_seen:
        end = f"to {flight.end:.6g}"
    else:
        end = f"to the end of the record, {flight.end:.6g}"
    return f"{flying} from {flight.start:.6g} {end} ({name_evidence(source)})"
