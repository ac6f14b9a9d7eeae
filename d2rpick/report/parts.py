"""The answer of ``parts`` as table, JSON, CSV and Markdown."""

from __future__ import annotations

from math import isinf
from typing import TYPE_CHECKING, Any, Final

from d2rpick.base.errors import format_ranges, list_names, make_printable
from d2rpick.report import keys, tables
from d2rpick.report.decision import saved
from d2rpick.report.fields import (
    Document,
    Field,
    csv_of,
    each,
    many,
    maybe,
    one_of,
    row,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    from d2rpick.choice.sets_of_parts import Parts, PartSet
    from d2rpick.choice.switchable_parts import PartRow
    from d2rpick.report.formats import Shown

# Columns of the sets, and of the parts in two tables: as many as a screen and a sheet hold side by side.
SETS = (
    "set",
    "parts",
    "saves of a step",
    "tr",
    "td",
    "processor time",
    "saves",
    "out of place",
    "turned [deg]",
)
TABLES = {
    "Parts": (
        "part",
        "title",
        "make rigid?",
        "flies",
        "deforms",
        "energy",
        "scatter",
        "why",
    ),
    "Elements": (
        "part",
        "title",
        "elements",
        "formulation",
        "material",
        "mass",
        "cost",
        "step",
        "shares nodes with",
    ),
}

_COUNTS: Final = maybe(each("integer"))
_IN_FLIGHT: Final = row(
    Field(
        "energy", "number?", "mean internal energy in the flight", lambda one: one.mean
    ),
    Field(
        "energy_change",
        "number?",
        "at its end less at its start",
        lambda one: one.change,
    ),
    Field(
        "energy_scatter",
        "number?",
        "standard deviation over mean",
        lambda one: one.scatter,
    ),
    Field("flies", "flag?", "whether the part flies with the rest"),
    Field(
        "deforms",
        "flag?",
        "whether its energy still scatters by a tenth of its mean or more",
    ),
)
# What it does in flight is that of the longest.
PART: Final = row(
    *keys.PART.fields,
    Field("elements", _COUNTS, "numbers by kind; null without a deck"),
    Field("formulations", "texts"),
    Field("material", "text?"),
    Field(
        "kind",
        maybe(one_of("deformable", "rigid", "spring", "airbag", "void", "particles")),
    ),
    Field("mass", "number?"),
    Field("mass_source", maybe(one_of("history", "deck"))),
    *_IN_FLIGHT.of_part(lambda part: part.flight),
    Field("cost_share", "number?", "share of its elements in the cost of all elements"),
    Field("smallest_step", "number?", "smallest stable time step"),
    Field("step_source", maybe(one_of("deck", "glstat", "d3hsp"))),
    Field(
        "shares_nodes",
        maybe(many("integer")),
        "parts that share nodes with it; null without a deck",
    ),
    Field("verdict", one_of("switch", "merge", "keep", "unknown")),
    Field("merge_with", "integer?"),
    Field("reasons", "texts"),
)


def _free(one: PartSet) -> bool | None:
    """Tell whether nothing deformable keeps the step."""
    return None if one.step_growth is None else isinf(one.step_growth)


SET: Final = row(
    Field("name", "text"),
    Field("recommended", "flag"),
    Field("parts", many("integer")),
    Field("bodies", maybe(many(many("integer"))), "the rigid bodies that its parts make; null without a deck",
          lambda one: one.bodies or None),
    Field("elements", "integer?", "elements that are rigid with it"),
    Field("element_fraction", "number?"),
    Field("mass_fraction", "number?"),
    Field("cost_share", "number?", "share of a step that is saved while it is rigid"),
    Field("step_growth", "number?", "how much the step may at least grow while it is rigid",
          lambda one: None if _free(one) else one.step_growth),
    Field("step_free", "flag?", "whether nothing deformable keeps the step", _free),
    Field("tr", "number?", get=lambda one: one.window and one.window[0]),
    Field("td", "number?", get=lambda one: one.window and one.window[1]),
    Field("rigid_fraction", "number?"),
    Field("run_time_share", "number?"),
    Field("saving", "number?"),
    keys.CANDIDATE.field("position_error")._replace(kind="number?"),
    Field("position_limit", "number?"),
    Field("position_part", maybe(many(keys.PART)), get=lambda one: one.position_part and (one.position_part,)),
    Field("position_body", maybe(many("integer")),
          "parts of the rigid body that is off, where there are several; else null",
          lambda one: one.position_body or None),
    keys.CANDIDATE.field("position_error_assumes")._replace(key="position_assumes"),
    Field("angle_error", "number?",
          "by how much the body is turned at td from where it should be [degrees]; null where the parts do not tell"),
    Field("reasons", "texts"),
    keys.CANDIDATE.field("position_error_is_lower_bound")._replace(key="position_is_lower_bound"),
)  # fmt: skip
_HISTORY: Final = row(
    Field("source", "texts", get=lambda run: run.sources),
    Field("sha256", "texts", get=lambda run: [file.sha256() for file in run.files]),
    Field(
        "format",
        "text",
        get=lambda run: " + ".join(one.format for one in run.databases),
    ),
    Field("notes", "texts"),
)
_DECK: Final = row(
    *keys.FILES,
    Field("solver", one_of("ls-dyna", "radioss")),
    Field("parts", "integer", get=lambda deck: len(deck.parts)),
    Field(
        "elements",
        "integer",
        get=lambda deck: sum(sum(counts.values()) for counts in deck.counts.values()),
    ),
    Field("complete", "flag"),
    Field("notes", "texts"),
)
_WEIGHTS: Final = row(
    *keys.WEIGHTS,
    Field("element_share", "number"),
    Field("rigid_node", "number"),
    Field("per_element", each("number")),
)
_FLIGHT: Final = row(
    Field("start", "number"), Field("end", "number"), Field("longest", "flag")
)


def _flights(found: Parts) -> list[dict[str, Any]]:
    facts = found.facts
    return [
        {"start": one[0], "end": one[1], "longest": at == facts.longest}
        for at, one in enumerate(facts.flights)
    ]


DOCUMENT: Final = Document(
    "d2rpick/parts/1",
    "Answer of d2rpick parts; times, masses and energies in the units of the history.",
    row(
        keys.WARNINGS,
        Field("history", _HISTORY, get=lambda found: found.files),
        Field("deck", maybe(_DECK), get=lambda found: found.inventory),
        Field("weights", maybe(_WEIGHTS)),
        Field("step_ratio", "number", get=lambda found: found.settings.step_ratio),
        Field("flights", many(_FLIGHT), get=_flights),
        Field(
            "parts",
            many(row(*PART.fields, Field("flights", many(_IN_FLIGHT)))),
            get=lambda found: found.rows,
        ),
        Field("sets", many(SET)),
        Field(
            "recommended",
            maybe(row(Field("name", "text"), Field("parts", many("integer")))),
        ),
    ),
    closed=True,
)
_MOST_SHOWN = 6
# Left out, in this order, where a terminal has no room for them.
_SPARE: Final = ("material", "step", "mass", "saves of a step", "turned [deg]")


def as_table(found: Parts, shown: Shown) -> str:
    """The set to take and what to do next, a row per set, a row per part in two tables, and what was read."""
    lines = tables.in_line(verdict_on_set(found))
    if found.sets:
        lines += ["", tables.as_text(*set_table(found, SETS), shown.width, _SPARE)]
    for names in TABLES.values():
        head, body = tables.known(*table(found, names))
        if body and {*head} - {"", "part", "title"}:
            lines += ["", tables.as_text(head, body, shown.width, _SPARE)]
    below = [*outlook(found), *heading(found)]
    return "\n".join([*lines, "", *tables.in_line(below)])


def as_markdown(found: Parts, _: Shown) -> str:
    """The set to take, the sets and the parts as Markdown tables, and what was read."""
    sets = [tables.as_markdown(*set_table(found))] if found.sets else []
    above = tables.listed(verdict_on_set(found))
    below = tables.listed(outlook(found))
    return "\n\n".join([*above, *sets, tables.as_markdown(*table(found)), *below])


def as_csv(found: Parts, _: Shown) -> str:
    """A row per part, a column for each key of ``parts`` in the JSON output; lists separated by semicolons."""
    return csv_of(PART.keys, map(PART.plain, found.rows), ";")


def as_value(found: Parts, _: Shown) -> str:
    """Numbers of the recommended set as ``--part`` takes them; nothing where there is none."""
    return ",".join(map(str, found.recommended.parts)) if found.recommended else ""


def heading(found: Parts) -> list[tuple[str, str]]:
    """What was read, by names."""
    run, deck = found.files, found.inventory
    formats = " + ".join(one.format for one in run.databases)
    lines = [
        (
            "history",
            f"{', '.join(run.sources)}: {formats}, {_number(len(run.parts), 'part')}",
        )
    ]
    if deck is None:
        lines.append(("deck", "none"))
    else:
        number = sum(sum(counts.values()) for counts in deck.counts.values())
        lines.append(
            (
                "deck",
                f"{deck.solver}, {_number(len(deck.parts), 'part')}, {_number(number, 'element')}",
            )
        )
    longest = found.facts.longest
    if longest is not None:
        start, end = found.facts.flights[longest]
        lines.append(
            (
                "flight",
                f"{start:.6g} to {end:.6g}, the longest of {len(found.facts.flights)}",
            )
        )
    return [(name, make_printable(text)) for name, text in lines]


def table(
    found: Parts, names: Iterable[str] = ()
) -> tuple[list[str], list[list[tables.Cell]]]:
    """Give names and cells of all columns of the parts, or of some; the parts of the recommended set have a star."""
    best = set(found.recommended.parts) if found.recommended else set()
    columns = {name: COLUMNS[name] for name in names or COLUMNS}
    return tables.filled(
        {"": lambda row: "*" if row.id in best else " ", **columns}, found.rows
    )


def set_table(
    found: Parts, names: Iterable[str] = ()
) -> tuple[list[str], list[list[tables.Cell]]]:
    """Give the same of the sets, among which the recommended one has a star."""
    columns = {name: SET_COLUMNS[name] for name in names or SET_COLUMNS}
    return tables.filled(
        {"": lambda one: "*" if one.recommended else " ", **columns}, found.sets
    )


def _position(one: PartSet) -> str | None:
    """How far a set is out of place, and what that takes for granted."""
    found = _least(one, one.position_error)
    return f"{found} if one body" if one.position_assumes else found


def _least(one: PartSet, value: float | None) -> str | None:
    """An error, and whether it may be larger."""
    return (
        f">= {value:.3g}"
        if one.position_is_lower_bound and value is not None
        else _short(value)
    )


def verdict(row: PartRow) -> str:
    """Whether to make a part rigid, in a word or two."""
    if row.merge_with is not None:
        return f"merge with {row.merge_with}"
    return _VERDICTS.get(row.verdict, row.verdict)


# Of parts, for people.
_VERDICTS: Final = {"switch": "make rigid", "keep": "no"}


def verdict_on_set(found: Parts) -> list[tuple[str, str]]:
    """Which parts to make rigid, why, and what to do next; a name and a sentence each."""
    best = found.recommended
    if best is None:
        why = next(
            (one.reasons[0] for one in found.sets if one.reasons),
            "no part can be switched",
        )
        return [
            ("make rigid", "nothing: no set of parts can be recommended"),
            ("why", why),
        ]
    bodies = (
        "one rigid body"
        if len(best.bodies) == 1
        else f"{len(best.bodies)} rigid bodies"
    )
    flights = len(found.facts.flights)
    where = (
        f", if rigid in the longest of {flights} flights only" if flights > 1 else ""
    )
    share = best.run_time_share
    saves = "unknown" if share is None else f"{saved(share)}{where}"
    return [
        ("make rigid", f"--part {ranges(best.parts)}, {set_name(best)} ({bodies})"),
        ("saves", saves),
        ("next", f"d2rpick plan --part {ranges(best.parts)} with the same files"),
    ]


# What the sets are called for people.
_SET_NAMES: Final = {
    "all that may": "all eligible parts",
    "all but what moves": "all eligible parts but loose ones",
    "heavy": "heaviest half by mass",
}


def set_name(one: PartSet) -> str:
    """Give what a set is called for people."""
    return _SET_NAMES.get(one.name, one.name)


def outlook(found: Parts) -> list[tuple[str, str]]:
    """What to know of the recommended set, and why others are not compared; a name and a sentence each."""
    lines: list[tuple[str, str]] = []
    best = found.recommended
    if best and best.step_growth is not None and best.step_growth > 1:
        much = (
            "without limit"
            if isinf(best.step_growth)
            else f"{best.step_growth:.2g} times"
        )
        grows = f"may grow {much} while these parts are rigid"
        cures = "set a maximum with --step-cap; --step-ratio adds its gain to the processor time saved"
        lines.append(("time step", f"{grows}: {cures}"))
    lines += [(set_name(one), reason) for one in found.sets for reason in one.reasons]
    return lines


def _number(count: int, what: str) -> str:
    return f"{count} {what}{'s' * (count != 1)}"


def _counted(row: PartRow) -> str | None:
    return (
        None
        if row.elements is None
        else ", ".join(f"{count} {kind}" for kind, count in row.elements.items())
    )


def _sharing(row: PartRow) -> str | None:
    return (
        None
        if row.shares_nodes is None
        else list_names(row.shares_nodes, most=_MOST_SHOWN, between=",")
    )


def ranges(ids: Sequence[int]) -> str:
    """Numbers of parts as ``--part`` takes them.

    Examples
    --------
    >>> ranges([1, 2, 3, 5, 6, 12])
    '1-3,5,6,12'
    """
    return ",".join(format_ranges(ids))


def _short(value: float | None) -> str | None:
    return tables.shown(value, ".3g")


def _percent(value: float | None) -> str | None:
    return None if value is None else f"{100 * value:.3g}%"


COLUMNS: Final[dict[str, Callable[[PartRow], tables.Cell]]] = {
    "part": lambda row: row.id,
    "title": lambda row: row.title,
    "make rigid?": verdict,
    "elements": _counted,
    "formulation": lambda row: ", ".join(row.formulations) or None,
    "material": lambda row: row.material,
    "mass": lambda row: _short(row.mass),
    "energy": lambda row: _short(row.flight.mean if row.flight else None),
    "scatter": lambda row: _percent(row.flight.scatter if row.flight else None),
    "flies": lambda row: row.flight.flies if row.flight else None,
    "deforms": lambda row: row.flight.deforms if row.flight else None,
    "cost": lambda row: _percent(row.cost_share),
    "step": lambda row: _short(row.smallest_step),
    "shares nodes with": _sharing,
    "why": lambda row: "; ".join(row.reasons),
}
SET_COLUMNS: Final[dict[str, Callable[[PartSet], tables.Cell]]] = {
    "set": set_name,
    "parts": lambda one: ranges(one.parts),
    "elements": lambda one: one.elements,
    "mass": lambda one: _percent(one.mass_fraction),
    "saves of a step": lambda one: _percent(one.cost_share),
    "step grows": lambda one: (
        "free" if _free(one) else tables.shown(one.step_growth, ".2g")
    ),
    "tr": lambda one: one.window[0] if one.window else None,
    "td": lambda one: one.window[1] if one.window else None,
    "processor time": lambda one: _percent(one.run_time_share),
    "saves": lambda one: _percent(one.saving),
    "out of place": _position,
    "turned [deg]": lambda one: _least(one, one.angle_error),
}
