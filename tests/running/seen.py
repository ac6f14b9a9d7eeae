"""Evidence of a whole record, as shown by a finished run."""

from __future__ import annotations

from typing import TYPE_CHECKING

from d2rpick.running.evidence import GrowingEvidence

if TYPE_CHECKING:
    from d2rpick.histories.history import History
    from d2rpick.running.inner_motion import Wait


def take_whole_record(
    history: History, given_wait: float | None = None, of_deck: Wait | None = None
) -> GrowingEvidence:
    """Add all states of a record at once."""
    evidence = GrowingEvidence(given_wait, of_deck)
    evidence.take(history, history)
    return evidence
