"""Check a card within the deck of its run before the user pastes it there."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from d2rpick.base.errors import Caution, DeckError, list_names

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from d2rpick.deck.printed_card import PrintedCard
    from d2rpick.histories.names import Part

OBJECTION: Final = "card-objection"
ERROR_OF_CARD: Final = "card-error"
UNJOINED: Final = "parts-not-joined"
UNKNOWN_LEAD: Final = "lead-part-unknown"
# What a check of the deck with the card cannot show.
NOT_SHOWN_BY_CHECK: Final = (UNJOINED, UNKNOWN_LEAD)
# Rule on a part that is rigid from the start: a card that switches it has no effect.
_NEVER_DEFORMABLE: Final = "D2R107"
# Largest number of parts that are named in a warning.
_MOST_NAMES: Final = 5


def warn_about_lead(
    lead: int | None,
    switched_parts: Sequence[int],
    known_parts: Sequence[Part] = (),
) -> Iterator[Caution]:
    """Yield a warning if nothing shows that the lead part of a card without a deck exists.

    ``known_parts`` are the parts of the history; empty if there is no history.
    """
    known_ids = {part.id for part in known_parts}
    if lead is None or lead in {*switched_parts, *known_ids}:
        return
    problem = f"`merge` {lead}: nothing shows that the model has a part {lead}"
    if known_parts:
        names = list_names([part.name for part in known_parts], most=_MOST_NAMES)
        problem = f"`merge` {lead}: the history has no part {lead}, only {names}"
    yield Caution(
        UNKNOWN_LEAD,
        f"{problem}; give a part of the model as `merge`, or the main deck as `deck` to check the card",
    )


def collect_objections(
    card: PrintedCard,
    deck: str | None,
    parts: int,
    lead: int | None = None,
    known_parts: Sequence[Part] = (),
) -> Iterator[Caution]:
    """Yield the findings of ``check`` for the deck with the card or, without a deck, warnings about what is unknown.

    ``parts`` is the number of parts that the card switches by their ids although nothing shows which of them share
    nodes, ``lead`` the part into which they are merged, and ``known_parts`` are the parts of the history.
    """
    if deck is None:
        yield from warn_about_lead(lead, (), known_parts)
        if parts > 1:
            message = "without a deck of the run it is unknown whether these parts share nodes"
            yield Caution(
                UNJOINED,
                f"{message}; give the main deck as `deck`, or merge the parts with `merge`",
            )
        return
    if parts > 1:
        yield Caution(
            UNJOINED,
            "d2rpick could not read all elements of the deck, so it is unknown whether these parts share nodes; "
            "merge parts that do with `merge`",
        )
    from pathlib import Path
    from tempfile import TemporaryDirectory

    from d2rpick.deck.writing import write_trial_deck
    from d2rpick.rules import check_deck
    from d2rpick.rules.base import ERROR, INFO

    with TemporaryDirectory() as folder:
        try:
            trial = write_trial_deck(deck, card, folder)
            checked = check_deck(trial)
        except DeckError as error:
            yield Caution(
                ERROR_OF_CARD, f"the card does not fit into the deck: {error}"
            )
            return
        findings = [
            finding for finding in checked.findings if finding.severity is not INFO
        ]
        severe = [
            finding
            for finding in findings
            if finding.severity is ERROR or finding.rule == _NEVER_DEFORMABLE
        ]
        home = str(Path(trial).parent)
        told = set()
        for finding in (*severe, *findings):
            if (what := (finding.rule, finding.message)) in told:
                continue
            told.add(what)
            location = finding.file.removeprefix(f"{home}/")
            message = f"{finding.rule} ({finding.severity}): {finding.message.replace(f'{home}/', '')}"
            yield Caution(
                ERROR_OF_CARD if finding in severe else OBJECTION,
                f"check of the deck with this card, {location}:{finding.line}: {message}",
            )
