"""The command ``suggest``."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from d2rpick.api.request import time_or_window
from d2rpick.cli import options
from d2rpick.cli.options import ANSWER, DECK_OF_PARTS, ONE_RUN, WINDOW
from d2rpick.cli.progress import opened
from d2rpick.errors import ArgumentError
from d2rpick.report.formats import FORMATS

if TYPE_CHECKING:
    from d2rpick.api.cards import Cards
    from d2rpick.api.choices import Suggestion
    from d2rpick.api.request import Request
    from d2rpick.cli.output import Output

EXAMPLES = """\b
Examples:
  d2rpick suggest --part box sample_data/rolloverT01.gz
  d2rpick suggest --td 0.064 sample_data/energy.csv
  d2rpick suggest --td-window 0.06 0.07 sample_data/energy.csv
  d2rpick suggest --td 0.37 --energy boxIE_J sample_data/rollover.csv
  d2rpick suggest --td 0.064 -f json sample_data/energy.glstat
  d2rpick suggest --td 0.37 --part box -f card --node 1001 sample_data/rolloverT01.gz
  d2rpick suggest --td 0.064 --report report.html sample_data/energy.csv
"""


@options.command("suggest", EXAMPLES)
@options.time("--td", "Switch back to deformable at this time.", instead_of=("td_window",))
@options.time("--td-window", "Choose the time to switch back within this window.", instead_of=("td",), pair=True)
@options.LIMIT
@options.takes(*ONE_RUN, *ANSWER, deck=DECK_OF_PARTS, forms=[*FORMATS["suggestion"], "card"])
def command(td: float | None, td_window: WINDOW, limit: int, request: Request, cards: Cards, output: Output) -> None:
    """Rank the times tr at which the parts of HISTORY can be made rigid until td, or choose both times.

    Without --td both are chosen, in --td-window or in the longest flight.

    A candidate is a time before td at which the internal energy had the level it has at td.  Each is verified by
    replaying the floating oscillator behind the record; the best one, and a better td, are named.
    """
    from d2rpick.api.asked import ask
    from d2rpick.api.choices import suggested

    wanted, card = time_or_window(td, td_window), output.output_format == "card"
    if card and not (request.part or cards.node):
        raise ArgumentError("-f card needs --part, the parts to switch (Radioss: --node, their main nodes)")
    prints = output.prints(cards, request)
    with opened(request, output) as (run, output):
        asked = ask(run, request, prints=prints, merge=cards.merge)
    answer = suggested(asked, wanted)
    output.notes(asked.reference.history.notes, answer.cautions)
    output.beside_answer(answer, lambda: answer.page(options.repeat(), request.judging(), cards))
    if card:
        return output.finish(objection=not _card(answer, cards, output), quality=answer.quality)
    output.answer(answer, limit=limit)
    return output.finish(objection=answer.recommended is None, quality=answer.quality)


def _card(answer: Suggestion, cards: Cards, output: Output) -> bool:
    """Print the card of the recommended pair, judged as it is printed; False where there is none or it fails."""
    from d2rpick.api.cards import all_cautions, need_ids
    from d2rpick.choice.judged_card import judged_card
    from d2rpick.choice.of_run import judge_of

    pair, situation = answer.recommended, answer.situation
    if pair is None:
        output.content(b"")
        return False
    request = cards.request(answer.question).by(situation.settings)
    judge = partial(judge_of, answer.question.reference, situation)
    found = judged_card([(pair.tr, pair.td)], situation.history, judge, request)
    if found is None:
        raise ArgumentError(need_ids(request, situation.history))
    card, (verdict,) = found
    said = set(answer.cautions)
    output.notes(card.notes, [caution for caution in all_cautions(verdict) if caution not in said])
    output.content(card.text.encode())
    return verdict.verified
