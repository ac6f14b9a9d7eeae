"""Define what the answers about one run have in common: their question, and the card and explorer of their pages."""

from __future__ import annotations

from dataclasses import field
from typing import TYPE_CHECKING, Any, ClassVar, Self

from d2rpick.api.answer import Paged
from d2rpick.api.cards import Cards
from d2rpick.base.data_classes import dataclass
from d2rpick.base.errors import D2RPickError, DeckError

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from d2rpick.api.asked import RunQuestion
    from d2rpick.api.runs import Run
    from d2rpick.choice.pair.situation import Situation
    from d2rpick.choice.td.trade_off import TradeOff
    from d2rpick.report.page import PageContext


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class RunAnswer(Paged):
    """An answer about one run, together with the question and the times on the command line.

    ``run`` is the run to which the question refers.
    """

    question: RunQuestion = field(repr=False)
    times: tuple[str, ...]
    name: ClassVar[str]  # Name of the command that asks the question.

    @property
    def run(self) -> Run:
        """The run about which the question was asked."""
        return self.question.run

    @property
    def command(self) -> tuple[str, ...]:
        """The command line that gives the same answer, beginning with the name of the command."""
        return (self.name, *self.times, *self.question.options)

    @classmethod
    def about(
        cls, question: RunQuestion, result: Any, *times: str, **further_fields: Any
    ) -> Self:
        """Make the public answer from an internal result, and add the cautions that the question raised."""
        return cls.of(
            result,
            cautions=question.cautions,
            question=question,
            times=times,
            **further_fields,
        )

    def _context(
        self,
        command: Sequence[str],
        judging: Sequence[str],
        cards: Cards | None,
        chosen: tuple[Situation, float] | None,
        explored: TradeOff | None,
    ) -> PageContext:
        """Return what a page shows in addition to the answer, e.g. the card for the chosen situation and tr."""
        from d2rpick.report.page import PageContext

        context = PageContext(
            self.question.reference.run,
            command,
            judging,
            explorer=self._explorer([explored]),
            question=self.question.repeated,
        )
        if chosen is None:
            return context
        return self._add_card(context, cards or Cards(), *chosen)

    def _add_card(
        self, context: PageContext, cards: Cards, situation: Situation, tr: float
    ) -> PageContext:
        """Add the card for a tr to a page, or the reason why the card cannot be printed."""
        from d2rpick.choice.judged_card import complete_printing, print_pair
        from d2rpick.deck.printed_card import Printing

        try:
            printing, _ = cards.complete(self.question)
        except DeckError as error:
            return context._replace(printing=Printing(), refusal=str(error))
        completed = complete_printing(printing, situation.history)
        context = context._replace(printing=completed)
        try:
            card = print_pair(self.question.reference, situation, tr, printing)
        except D2RPickError as error:
            return context._replace(refusal=str(error))
        return context._replace(card=card)

    def _explorer(self, trade_offs_or_none: Iterable[TradeOff | None]) -> Any:
        """Return the interactive data of a page, and the command line that repeats the answer for any given td."""
        from d2rpick.report.page import Explorer

        trade_offs = tuple(trade_off for trade_off in trade_offs_or_none if trade_off)
        if trade_offs:
            return Explorer(
                trade_offs, (("d2rpick", "suggest", "--td"), self.question.options)
            )
        return None
