"""The answer of ``parts`` as one HTML page to be read, printed and signed."""

from __future__ import annotations

from typing import TYPE_CHECKING

from d2rpick.report import page
from d2rpick.report.html import Markup, document, pairs, remarks, section, table, tag
from d2rpick.report.parts import HEAD, SET_HEAD, SETS, TABLES, columns, heading, outlook, ranges, rows, set_rows
from d2rpick.report.shell import shell_line

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from d2rpick.choice.part_sets import Parts, PartSet


def as_page(found: Parts, command: Sequence[str]) -> str:
    """Write the page; ``command`` are the arguments that repeat the answer."""
    return document(f"Parts to switch: {page.title_of(found.run)}", *_sections(found, command), signed=page.SIGNED)


def _sections(found: Parts, command: Sequence[str]) -> Iterator[Markup]:
    yield tag("section", tag("div", _card(found.recommended), class_="choice"), remarks(found.cautions))
    if found.sets:
        marked = next((at for at, one in enumerate(found.sets) if one.recommended), None)
        yield section("Sets", table("Sets", SETS, columns(SET_HEAD, SETS, set_rows(found)), marked))
    for caption, names in TABLES.items():
        yield section(caption, table(caption, names, columns(HEAD, names, rows(found))))
    yield section("What it means", pairs(outlook(found)))
    read = [(line.partition(" ")[0], line.partition(" ")[2].strip()) for line in heading(found)]
    if found.weights:
        read.append(("weights", found.weights.source))
    deck = page.deck_digests(found.inventory.files, found.weights) if found.inventory else []
    yield section("What was read", pairs([*read, *page.digests(found.run.files), *deck]))
    yield section("To repeat this", tag("pre", shell_line(command), class_="wrap"))


def _card(best: PartSet | None) -> Markup:
    if best is None:
        nothing = tag("p", "No set of parts can be recommended.")
        return tag("div", tag("h2", "Nothing recommended"), nothing, class_="card refused")
    saved = tag("span", tag("i", "saves about"), f"{best.saving:.0%}", tag("i", " of the run time"))
    listed = tag("p", f"parts {ranges(best.parts)}")
    return tag("div", tag("h2", best.name), tag("div", saved, class_="times"), listed, class_="card chosen")
