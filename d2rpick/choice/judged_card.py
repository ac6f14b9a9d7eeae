"""Cards whose times were judged by an energy history, as they are printed."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

from d2rpick.choice.verify import verify
from d2rpick.deck.printing import SOLVERS, cards, solver_of
from d2rpick.deck.printing.common import Printing

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from d2rpick.choice.settings import Settings
    from d2rpick.choice.verify import Verdict
    from d2rpick.deck.printing.common import PrintedCard, Times
    from d2rpick.histories.history import History


@dataclass(frozen=True)
class CardRequest:
    """What is known of a card before its times: ``solver`` None is the one that wrote the history.

    What ``printing`` leaves open the history fills in: its chosen parts, and its end for that of the run.
    """

    solver: str | None = None
    printing: Printing = field(default_factory=Printing)

    def of(self, history: History) -> tuple[str, Printing]:
        """Name the solver, and say what its card needs."""
        ids = self.printing.part or tuple(part.id for part in history.parts or ())
        end = float(history.time[-1]) if self.printing.end is None else self.printing.end
        return self.solver or solver_of(history.format), replace(self.printing, part=ids, end=end)


def judged_card(
    windows: Sequence[Times], history: History, settings: Settings, request: CardRequest
) -> tuple[PrintedCard, tuple[Verdict, ...]] | None:
    """Print the card of windows, judge each as printed, and print it with what was found as comments.

    None where nobody says whom the card switches: the chosen parts, or main nodes for a solver that asks for these.
    """
    solver, printing = request.of(history)
    if not getattr(printing, SOLVERS[solver].SWITCHES):
        return None
    plain = cards(windows, printing, solver)
    verdicts = tuple(verify(history, tr, td, settings) for tr, td in plain.windows)
    return cards(windows, printing, solver, tuple(_remarks(verdicts))), verdicts


def _remarks(verdicts: Sequence[Verdict]) -> Iterator[str]:
    for verdict in verdicts:
        which = f" {verdict.candidate.tr:.6g} to {verdict.situation.td:.6g}" if len(verdicts) > 1 else ""
        yield from _judgement(verdict, which)
    yield from dict.fromkeys(f"{caution.code}: {caution.message}." for one in verdicts for caution in one.cautions)


def _judgement(verdict: Verdict, which: str) -> Iterator[str]:
    candidate, history = verdict.candidate, verdict.situation.history
    result = "verified" if verdict.verified else f"NOT verified ({'; '.join(verdict.reasons)})"
    yield f"Judged by {', '.join(history.source)}, {history.channel}:{which} {result}."
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
