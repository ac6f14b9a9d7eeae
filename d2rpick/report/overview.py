"""The answer of ``info`` as table, JSON, CSV and Markdown."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from d2rpick import __version__
from d2rpick.health import cautions_of_health
from d2rpick.report import tables
from d2rpick.report.health import measures_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from d2rpick.cautions import Caution
    from d2rpick.momentum import FreeFlight
    from d2rpick.overview import Overview

SCHEMA = "d2rpick/info/1"


def cautions(overview: Overview) -> tuple[Caution, ...]:
    """What to know of the health of the run."""
    return tuple(cautions_of_health(overview.health)) if overview.health else ()


def as_table(overview: Overview) -> str:
    """One line per fact, the channels, and a table of the parts."""
    rows = _rows(overview)
    width = max(len(name) for name, _ in rows)
    lines = [f"{name.ljust(width)}  {tables.short(value)}" for name, value in rows]
    if overview.parts:
        parts = [[one.part.id, one.part.title, one.energy_max] for one in overview.parts]
        lines += ["", tables.as_text(("part", "title", "highest internal energy"), parts)]
    return "\n".join([*lines, *(f"note: {note}" for note in overview.notes)])


def as_markdown(overview: Overview) -> str:
    """The facts as a Markdown table of two columns."""
    return tables.as_markdown(("what", "value"), _rows(overview))


def as_csv(overview: Overview) -> str:
    """One row of facts."""
    rows = _rows(overview)
    return tables.as_csv([name for name, _ in rows], [[value for _, value in rows]]).rstrip("\n")


def as_json(overview: Overview, command: Sequence[str]) -> str:
    """Everything by schema d2rpick/info/1."""
    facts = asdict(overview)
    facts["parts"] = [{**asdict(one.part), "energy_max": one.energy_max} for one in overview.parts]
    facts["flights"] = [
        {
            "start": f.start,
            "end": f.end if f.end_seen else None,
            "parts": [asdict(p) for p in f.parts] if f.parts else None,
        }
        for f in overview.flights
    ]
    front: dict[str, Any] = {"schema": SCHEMA, "tool_version": __version__, "command": list(command)}
    front["warnings"] = [asdict(caution) for caution in cautions(overview)]
    return tables.as_json({**front, **facts})


def _rows(overview: Overview) -> list[tuple[str, tables.Cell]]:
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
    rows += [("flight", _flight(flight)) for flight in overview.flights]
    if overview.health:
        rows += [(one.what, one.value) for one in measures_of(overview.health) if one.value]
    return rows


def _flight(flight: FreeFlight) -> str:
    who = ", ".join(part.title or str(part.id) for part in flight.parts) if flight.parts else "the whole model"
    end = f"to {flight.end:.6g}" if flight.end_seen else f"to the end of the record, {flight.end:.6g}"
    return f"{who} from {flight.start:.6g} {end}"
