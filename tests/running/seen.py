"""Evidence and inner motion of a whole record, as a finished run shows them."""

from d2rpick.histories.history import History
from d2rpick.running.evidence import GrowingEvidence
from d2rpick.running.inner_motion import InnerMotion, Wait


def take_whole_record(
    history: History, given_wait: float | None = None, of_deck: Wait | None = None
) -> tuple[GrowingEvidence, InnerMotion]:
    """Take all states of a record at once."""
    evidence, motion = GrowingEvidence(), InnerMotion(given_wait, of_deck)
    evidence.take(history)
    motion.take(history, evidence)
    return evidence, motion
