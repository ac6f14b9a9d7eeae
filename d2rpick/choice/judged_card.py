"""Cards whose times were judged by an energy history, as they are printed."""

from __future__ import annotations

from typing import TYPE_CHECKING

from d2rpick.choice.verify import verify
from d2rpick.deck.printing.cards import ls_dyna

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from d2rpick.choice.settings import Settings
    from d2rpick.choice.verify import Verdict
    from d2rpick.deck.printing.cards import PrintedCard
    from d2rpick.histories.history import History


def judged(
    write: Callable[[Sequence[str]], PrintedCard], history: History, settings: Settings
) -> tuple[PrintedCard, Verdict]:
    """Write a card, judge its times as printed, and write it again with what was found as comments."""
    plain = write(())
    verdict = verify(history, plain.tr, plain.td, settings)
    return write(tuple(_remarks(verdict))), verdict


def of_parts(history: History, times: tuple[float, float], settings: Settings) -> tuple[PrintedCard, Verdict] | None:
    """Write the LS-DYNA card of the parts that were chosen for (tr, td), judged; None where none were."""
    if not history.parts:
        return None
    ids = [part.id for part in history.parts]
    return judged(lambda remarks: ls_dyna(*times, ids, remarks=remarks), history, settings)


def _remarks(verdict: Verdict) -> Iterator[str]:
    candidate, history = verdict.candidate, verdict.situation.history
    result = "verified" if verdict.verified else f"NOT verified ({'; '.join(verdict.reasons)})"
    yield f"Judged by {', '.join(history.source)}, {history.channel}: {result}."
    measures = [
        f"{name} {value:.3f}"
        for name, value in (
            ("lock-in error", candidate.lock_in_error),
            ("level error", candidate.level_error),
            ("kinetic share", verdict.situation.kinetic_share),
            ("residual", candidate.residual),
        )
        if value is not None
    ]
    if measures:
        yield f"{', '.join(measures).capitalize()}."
    yield from (f"{caution.code}: {caution.message}." for caution in verdict.cautions)
