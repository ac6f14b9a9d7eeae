"""Check a card within the deck of its run before the user pastes it there."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from d2rpick.base.errors import Caution, DeckError

if TYPE_CHECKING:
    from collections.abc import Iterator

    from d2rpick.deck.printed_card import PrintedCard

OBJECTION: Final = "card-objection"
ERROR_OF_CARD: Final = "card-error"
UNJOINED: Final = "parts-not-joined"


def collect_objections(
    card: PrintedCard, deck: str | None, parts: int
) -> Iterator[Caution]:
    """Yield the findings of ``check`` for the deck with the card or, without a deck, a warning about shared nodes.

    ``parts`` is the number of parts that the card switches by their ids.
    """
    if deck is None:
        if parts > 1:
            message = "without a deck of the run it is unknown whether these parts share nodes"
            yield Caution(
                UNJOINED,
                f"{message}; give the main deck as `deck`, or merge the parts with `merge`",
            )
        return
    from tempfile import TemporaryDirectory

    from d2rpick.deck.writing import write_deck
    from d2rpick.rules import check_deck
    from d2rpick.rules.base import ERROR, INFO

    with TemporaryDirectory() as folder:
        try:
            checked = check_deck(write_deck(deck, card, folder)[0])
        except DeckError as error:
            yield Caution(
                ERROR_OF_CARD, f"the card does not fit into the deck: {error}"
            )
            return
        for finding in checked.findings:
            if finding.severity is not INFO:
                location = finding.file.removeprefix(f"{folder}/")
                message = f"{finding.rule} ({finding.severity}): {finding.message.replace(f'{folder}/', '')}"
                is_error = finding.severity is ERROR
                yield Caution(
                    ERROR_OF_CARD if is_error else OBJECTION,
                    f"check of the deck with this card, {location}:{finding.line}: {message}",
                )
