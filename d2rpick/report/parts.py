"""The answer of ``parts`` as table, JSON, CSV and Markdown."""

from __future__ import annotations

from math import isinf
from typing import TYPE_CHECKING, Any

from d2rpick.errors import in_rows, listing, printable
from d2rpick.report import keys, tables
from d2rpick.version import __version__

if TYPE_CHECKING:
    from collections.abc import Sequence

    from d2rpick.choice.part_evidence import InFlight
    from d2rpick.choice.sets_of_parts import Parts, PartSet
    from d2rpick.choice.switchable_parts import PartRow

SCHEMA = "d2rpick/parts/1"
HEAD = (
    "", "part", "title", "verdict", "elements", "formulation", "material", "mass", "energy", "scatter", "flies",
    "deforms", "cost", "step", "shares nodes with", "why",
)  # fmt: skip
SET_HEAD = (
    "", "set", "parts", "elements", "mass", "saved of a step", "step grows", "tr", "td", "run time", "saved",
    "out of place", "turned [deg]",
)  # fmt: skip
# Columns of the sets, and of the parts in two tables: as many as a screen and a sheet hold side by side.
SETS = ("set", "parts", "saved of a step", "tr", "td", "run time", "saved", "out of place", "turned [deg]")
TABLES = {
    "Parts": ("part", "title", "verdict", "flies", "deforms", "energy", "scatter", "why"),
    "Elements": ("part", "title", "elements", "formulation", "material", "mass", "cost", "step", "shares nodes with"),
}
_WIDTH = 110  # of a table, as screens hold side by side with other things

# Keys of a part in JSON, and columns of the csv.
PART = (
    "id", "title", "elements", "formulations", "material", "kind", "mass", "mass_source", "energy", "energy_change",
    "energy_scatter", "flies", "deforms", "cost_share", "smallest_step", "step_source", "shares_nodes", "verdict",
    "merge_with", "reasons",
)  # fmt: skip
SET = (
    "name", "recommended", "parts", "bodies", "elements", "element_fraction", "mass_fraction", "cost_share",
    "step_growth", "step_free", "tr", "td", "rigid_fraction", "run_time_share", "saving", "position_error",
    "position_limit", "position_part", "position_body", "position_assumes", "angle_error", "reasons",
    "position_is_lower_bound",
)  # fmt: skip
_MOST_SHOWN = 6


def as_table(found: Parts) -> str:
    """What was read, a row per part in two tables, a row per set, and the set to take; markdown has all columns."""
    lines = heading(found)
    for names in TABLES.values():
        head, body = tables.known(names, columns(HEAD, names, rows(found)))
        if body and {*head} - {"part", "title"}:
            lines += ["", _starred(head, body, [row[0] for row in rows(found)])]
    if found.sets:
        body = columns(SET_HEAD, SETS, set_rows(found))
        lines += ["", _starred(SETS, body, [row[0] for row in set_rows(found)])]
    lines += ["", *(f"{name.ljust(11)}  {printable(text)}" for name, text in outlook(found))]
    return "\n".join(lines)


def columns(
    head: Sequence[str], names: Sequence[str], body: Sequence[Sequence[tables.Cell]]
) -> list[list[tables.Cell]]:
    """Take the columns with these names out of the rows of a table."""
    at = [head.index(name) for name in names]
    return [[row[i] for i in at] for row in body]


def _starred(head: Sequence[str], body: Sequence[Sequence[tables.Cell]], stars: Sequence[tables.Cell]) -> str:
    """Write rows with their stars before them."""
    return tables.as_text(("", *head), [[star, *row] for star, row in zip(stars, body, strict=True)], _WIDTH)


def as_markdown(found: Parts) -> str:
    """The parts and the sets as Markdown tables, and below them the set to take."""
    blocks = [tables.as_markdown(HEAD, rows(found))]
    if found.sets:
        blocks.append(tables.as_markdown(SET_HEAD, set_rows(found)))
    return "\n\n".join([*blocks, *(f"{name}: {tables.in_markdown(text)}" for name, text in outlook(found))])


def as_csv(found: Parts) -> str:
    """A row per part, a column for each key of ``parts`` in the JSON output; lists separated by semicolons."""
    body = ([_cell(value) for value in part(row).values()] for row in found.rows)
    return tables.as_csv(PART, body).rstrip("\n")


def as_json(found: Parts, command: Sequence[str]) -> str:
    """Everything by schema d2rpick/parts/1."""
    best, deck, weights = found.recommended, found.inventory, found.weights
    return tables.as_json(
        {
            "schema": SCHEMA,
            "tool_version": __version__,
            "command": list(command),
            "warnings": keys.of_warnings(found.cautions),
            "history": {
                "source": list(found.run.sources),
                "sha256": [file.sha256() for file in found.run.files],
                "format": " + ".join(one.format for one in found.run.databases),
                "notes": list(found.run.notes),
            },
            "deck": None
            if deck is None
            else {
                **keys.of_files(deck.files),
                "solver": deck.solver,
                "parts": len(deck.parts),
                "elements": sum(sum(counts.values()) for counts in deck.counts.values()),
                "complete": deck.complete,
                "notes": list(deck.notes),
            },
            "weights": None
            if weights is None
            else {
                **keys.of_weights(weights),
                "element_share": weights.element_share,
                "rigid_node": weights.rigid_node,
                "per_element": dict(weights.per_element),
            },
            "step_ratio": found.settings.step_ratio,
            "flights": [
                {"start": start, "end": end, "longest": at == found.facts.longest}
                for at, (start, end) in enumerate(found.facts.flights)
            ],
            "parts": [{**part(row), "flights": [in_flight(one) for one in row.flights]} for row in found.rows],
            "sets": [set_(one) for one in found.sets],
            "recommended": {"name": best.name, "parts": list(best.parts)} if best else None,
        }
    )


def as_value(found: Parts) -> str:
    """Numbers of the recommended set as ``--part`` takes them; nothing where there is none."""
    return ",".join(map(str, found.recommended.parts)) if found.recommended else ""


def part(row: PartRow) -> dict[str, Any]:
    """Keys of one part in JSON; what it does in flight is that of the longest."""
    told = in_flight(row.flight) if row.flight else dict.fromkeys(_IN_FLIGHT)
    return {
        "id": row.id,
        "title": row.title,
        "elements": None if row.elements is None else dict(row.elements),
        "formulations": list(row.formulations),
        "material": row.material,
        "kind": row.kind,
        "mass": row.mass,
        "mass_source": row.mass_source,
        **told,
        "cost_share": row.cost_share,
        "smallest_step": row.smallest_step,
        "step_source": row.step_source,
        "shares_nodes": None if row.shares_nodes is None else list(row.shares_nodes),
        "verdict": row.verdict,
        "merge_with": row.merge_with,
        "reasons": list(row.reasons),
    }


_IN_FLIGHT = ("energy", "energy_change", "energy_scatter", "flies", "deforms")


def in_flight(one: InFlight) -> dict[str, Any]:
    """Keys of a part in one flight."""
    values = (one.mean, one.change, one.scatter, one.flies, one.deforms)
    return dict(zip(_IN_FLIGHT, values, strict=True))


def set_(one: PartSet) -> dict[str, Any]:
    """Keys of one set in JSON."""
    free = one.step_growth is not None and isinf(one.step_growth)
    return {
        "name": one.name,
        "recommended": one.recommended,
        "parts": list(one.parts),
        "bodies": [list(body) for body in one.bodies] or None,
        "elements": one.elements,
        "element_fraction": one.element_fraction,
        "mass_fraction": one.mass_fraction,
        "cost_share": one.cost_share,
        "step_growth": None if free else one.step_growth,
        "step_free": None if one.step_growth is None else free,
        "tr": one.window[0] if one.window else None,
        "td": one.window[1] if one.window else None,
        "rigid_fraction": one.rigid_fraction,
        "run_time_share": one.run_time_share,
        "saving": one.saving,
        "position_error": one.position_error,
        "position_limit": one.position_limit,
        "position_part": keys.of_parts((one.position_part,)) if one.position_part else None,
        "position_body": list(one.position_body) if one.position_body else None,
        "position_assumes": one.position_assumes,
        "angle_error": one.angle_error,
        "reasons": list(one.reasons),
        "position_is_lower_bound": one.position_is_lower_bound,
    }


def heading(found: Parts) -> list[str]:
    """What was read."""
    run, deck = found.run, found.inventory
    formats = " + ".join(one.format for one in run.databases)
    lines = [f"history  {', '.join(run.sources)}: {formats}, {_number(len(run.parts), 'part')}"]
    if deck is None:
        lines.append("deck     none")
    else:
        number = sum(sum(counts.values()) for counts in deck.counts.values())
        lines.append(f"deck     {deck.solver}, {_number(len(deck.parts), 'part')}, {_number(number, 'element')}")
    longest = found.facts.longest
    if longest is not None:
        start, end = found.facts.flights[longest]
        lines.append(f"flight   {start:.6g} to {end:.6g}, the longest of {len(found.facts.flights)}")
    return [printable(line) for line in lines]


def rows(found: Parts) -> list[list[tables.Cell]]:
    """Cells of all parts, below ``HEAD``; those of the recommended set have a star."""
    best = set(found.recommended.parts) if found.recommended else set()
    return [
        [
            "*" if row.id in best else " ",
            row.id,
            row.title,
            verdict(row),
            _counted(row),
            ", ".join(row.formulations) or None,
            row.material,
            _short(row.mass),
            _short(row.flight.mean if row.flight else None),
            _percent(row.flight.scatter if row.flight else None),
            row.flight.flies if row.flight else None,
            row.flight.deforms if row.flight else None,
            _percent(row.cost_share),
            _short(row.smallest_step),
            None if row.shares_nodes is None else listing(row.shares_nodes, most=_MOST_SHOWN, between=","),
            "; ".join(row.reasons),
        ]
        for row in found.rows
    ]


def set_rows(found: Parts) -> list[list[tables.Cell]]:
    """Cells of all sets, below ``SET_HEAD``; that of the recommended one has a star."""
    return [
        [
            "*" if one.recommended else " ",
            one.name,
            ranges(one.parts),
            one.elements,
            _percent(one.mass_fraction),
            _percent(one.cost_share),
            _growth(one.step_growth),
            one.window[0] if one.window else None,
            one.window[1] if one.window else None,
            _percent(one.run_time_share),
            _percent(one.saving),
            _position(one),
            _least(one, one.angle_error),
        ]
        for one in found.sets
    ]


def _position(one: PartSet) -> str | None:
    """How far a set is out of place, and what that takes for granted."""
    found = _least(one, one.position_error)
    return f"{found} if one body" if one.position_assumes else found


def _least(one: PartSet, value: float | None) -> str | None:
    """An error, and whether it may be larger."""
    return f">= {value:.3g}" if one.position_is_lower_bound and value is not None else _short(value)


def verdict(row: PartRow) -> str:
    """The verdict in a word or two."""
    return f"merge with {row.merge_with}" if row.merge_with is not None else row.verdict


def outlook(found: Parts) -> list[tuple[str, str]]:
    """The set to take and what it does, and why others are not compared; a name and a sentence each."""
    lines: list[tuple[str, str]] = []
    best = found.recommended
    if best is None:
        lines.append(("recommended", "no set"))
    else:
        bodies = "one rigid body" if len(best.bodies) == 1 else f"{len(best.bodies)} rigid bodies"
        lines.append(("recommended", f"{best.name}: --part {ranges(best.parts)} ({bodies})"))
        flights = len(found.facts.flights)
        where = f", rigid in the longest of {flights} flights alone" if flights > 1 else ""
        lines.append(("run time", f"about {best.run_time_share:.0%} of the reference's{where}"))
        if best.step_growth is not None and best.step_growth > 1:
            much = "without limit" if isinf(best.step_growth) else f"{best.step_growth:.2g} times"
            lines.append(("step", f"may grow {much} while rigid, which saves more (--step-ratio); cap it (--step-cap)"))
    lines += [(one.name, reason) for one in found.sets for reason in one.reasons]
    return lines


def _number(count: int, what: str) -> str:
    return f"{count} {what}{'s' * (count != 1)}"


def _counted(row: PartRow) -> str | None:
    return None if row.elements is None else ", ".join(f"{count} {kind}" for kind, count in row.elements.items())


def ranges(ids: Sequence[int]) -> str:
    """Numbers of parts as ``--part`` takes them.

    Examples
    --------
    >>> ranges([1, 2, 3, 5, 6, 12])
    '1-3,5,6,12'
    """
    return ",".join(in_rows(ids))


def _short(value: float | None) -> str | None:
    return None if value is None else f"{value:.3g}"


def _percent(value: float | None) -> str | None:
    return None if value is None else f"{100 * value:.3g}%"


def _growth(value: float | None) -> str | None:
    return None if value is None else "free" if isinf(value) else f"{value:.2g}"


def _cell(value: Any) -> tables.Cell:
    if isinstance(value, dict):
        return ";".join(f"{count} {kind}" for kind, count in value.items())
    return ";".join(map(str, value)) if isinstance(value, list) else value
