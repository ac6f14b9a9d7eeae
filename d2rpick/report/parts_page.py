"""The answer of ``parts`` as one HTML page to be read, printed and signed."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from d2rpick.report import page
from d2rpick.report.html import Markup, document, pairs, remarks, section, table, tag
from d2rpick.report.parts import HEAD, SET_HEAD, heading, outlook, ranges, rows, set_rows
from d2rpick.report.shell import shell_line

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from d2rpick.choice.part_sets import Parts, PartSet
    from d2rpick.report.tables import Cell

# Columns of the sets, and of the parts in two tables: as many as a screen and a sheet hold side by side.
_SETS: Final = ("set", "parts", "saved of a step", "tr", "td", "run time", "saved", "out of place", "turned [deg]")
_TABLES: Final = {
    "Parts": ("part", "title", "verdict", "why", "flies", "deforms", "energy", "scatter"),
    "Elements": ("part", "title", "elements", "formulation", "material", "mass", "cost", "step", "shares nodes with"),
}


def as_page(found: Parts, command: Sequence[str]) -> str:
    """Write the page; ``command`` are the arguments that repeat the answer."""
    return document(f"Parts to switch: {page.title_of(found.run)}", *_sections(found, command), signed=page.SIGNED)


def _sections(found: Parts, command: Sequence[str]) -> Iterator[Markup]:
    yield tag("section", tag("div", _card(found.recommended), class_="choice"), remarks(found.cautions))
    if found.sets:
        marked = next((at for at, one in enumerate(found.sets) if one.recommended), None)
        yield section("Sets", table("Sets", _SETS, _columns(SET_HEAD, _SETS, set_rows(found)), marked))
    for caption, names in _TABLES.items():
        yield section(caption, table(caption, names, _columns(HEAD, names, rows(found))))
    yield section("What it means", pairs(outlook(found)))
    read = [(line.partition(" ")[0], line.partition(" ")[2].strip()) for line in heading(found)]
    if found.weights:
        read.append(("weights", found.weights.source))
    yield section("What was read", pairs([*read, *page.digests(found.run.files)]))
    yield section("To repeat this", tag("pre", shell_line(command), class_="wrap"))


def _columns(head: Sequence[str], names: Sequence[str], body: Sequence[Sequence[Cell]]) -> list[list[Cell]]:
    """Take the columns with these names out of the rows of a table."""
    at = [head.index(name) for name in names]
    return [[row[i] for i in at] for row in body]


def _card(best: PartSet | None) -> Markup:
    if best is None:
        nothing = tag("p", "No set of parts can be recommended.")
        return tag("div", tag("h2", "Nothing recommended"), nothing, class_="card refused")
    saved = tag("span", tag("i", "saved"), f"{best.saving:.0%}")
    listed = tag("p", f"parts {ranges(best.parts)}")
    return tag("div", tag("h2", best.name), tag("div", saved, class_="times"), listed, class_="card chosen")
