"""Cards whose times were judged by an energy history, as they are printed."""

from __future__ import annotations

from typing import TYPE_CHECKING

from d2rpick.choice.verify import verify_at
from d2rpick.deck.printing.cards import ls_dyna

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from d2rpick.choice.situation import Situation
    from d2rpick.choice.verify import Verdict
    from d2rpick.deck.printing.cards import PrintedCard


def judged(
    write: Callable[[Sequence[str]], PrintedCard], judge: Callable[[float, float], Verdict]
) -> tuple[PrintedCard, Verdict]:
    """Write a card, let ``judge`` judge its tr and td as printed, and write it again with what it found as comments."""
    plain = write(())
    verdict = judge(plain.tr, plain.td)
    return write(tuple(_remarks(verdict))), verdict


def of_parts(situation: Situation, times: tuple[float, float]) -> tuple[PrintedCard, Verdict] | None:
    """Write the LS-DYNA card of the parts that were chosen for (tr, td), judged; None where none were."""
    parts = situation.history.parts
    if not parts:
        return None
    ids = [part.id for part in parts]
    return judged(lambda remarks: ls_dyna(*times, ids, remarks=remarks), lambda tr, td: verify_at(situation.at(td), tr))


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
