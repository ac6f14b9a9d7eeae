"""Evidence and inner motion of a whole record, as a finished run shows them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from d2rpick.running.evidence import GrowingEvidence
from d2rpick.running.inner_motion import InnerMotion

if TYPE_CHECKING:
    from d2rpick.histories.history import History
    from d2rpick.running.inner_motion import Wait
    from d2rpick.running.witness import Needed, Quiet


def take_whole_record(
    history: History, given_wait: float | None = None, of_deck: Wait | None = None
) -> tuple[GrowingEvidence, InnerMotion]:
    """Take all states of a record at once."""
    evidence, motion = GrowingEvidence(), InnerMotion(given_wait, of_deck)
    evidence.take(history)
    motion.take(history, evidence)
    return evidence, motion


def find_quiet_times(history: History, needed: Needed) -> tuple[Quiet, ...]:
    """Return the flights of a whole record that lasted for the wait that they ``needed``."""
    return take_whole_record(history)[0].flights(needed)


def follow_inner_motion(
    history: History, given_wait: float | None = None, of_deck: Wait | None = None
) -> InnerMotion:
    """Return the inner motion of a whole record."""
    return take_whole_record(history, given_wait, of_deck)[1]
