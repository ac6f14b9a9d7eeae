"""What the history of a run that is being computed shows of its last leg."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from d2rpick.base.errors import FormatError, HistoryError
from d2rpick.choice.deck_of_run import in_deck
from d2rpick.deck.model import DISCRETE
from d2rpick.histories.names import Selection
from d2rpick.histories.opening import open_run
from d2rpick.running.evidence import contact_after, highest_energy, quiet_times
from d2rpick.running.sequence import LOAD, Seen
from d2rpick.running.swing import swing_in
from d2rpick.running.wait import InnerMotion, Wait

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from d2rpick.deck.model import Inventory
    from d2rpick.histories.history import History
    from d2rpick.running.sequence import Order, Window

# A leg is told to stop at the end of the wait when so much of it is over.
HALF = 0.5


class _Half(NamedTuple):
    """Half of the wait that was given, or that a record asks for."""

    given: float | None
    whole: InnerMotion

    def needed(self, start: float, now: float) -> float | None:
        """Half of the wait; None where it is not known."""
        needed = self.given or self.whole.needed(start, now)
        return needed and HALF * needed


class Looks:
    """Looks at the record of some ``parts`` of a deck, with the ``wait`` that was given or that the deck tells."""

    def __init__(
        self, parts: Sequence[int], inventory: Inventory, wait: float | None = None, of_deck: Wait | None = None
    ) -> None:
        springs = sorted(part for part, kinds in inventory.counts.items() if {*kinds} <= DISCRETE)
        self._selection = Selection(parts=tuple(map(str, parts)), springs=tuple(map(str, springs)))
        self._inventory, self._wait, self._of_deck = inventory, wait, of_deck
        self.why = ""  # of the wait

    def __call__(self, order: Order, histories: Sequence[Path], known: float) -> Seen | None:
        """Say what is seen of the leg that is ordered, whose history is the last.

        ``known`` is the longest wait that the record before these histories asked for [time].  None where there is no
        state yet.  A wait that was given is kept to where the record shows a longer one: ``why`` says so.
        """
        try:
            history = self._history(histories)
        except (FormatError, HistoryError, FileNotFoundError):
            return None  # the head is being written
        if not history.time.size or history.time[-1] < order.start:
            return None
        now = float(history.time[-1])
        if order.kind != LOAD:
            contact = contact_after(history, order.start)
            return Seen(now, peak=None if order.rigid else highest_energy(history, order.start, now), contact=contact)
        motion = InnerMotion(history, None, self._floor(known))
        quiet = quiet_times(history, _Half(self._wait, motion))
        free = quiet[-1].start if quiet and quiet[-1].end is None else None
        asked = None if free is None else motion.wait(free, now)
        at_rest = asked is not None and asked.source == "at-rest"
        wait = asked if self._wait is None else Wait(self._wait, "given", "as given")
        if free is None or wait is None:
            return Seen(now)
        longer = asked is not None and asked.time > wait.time
        self.why = f"{wait.reason}, but {asked.reason}" if asked and longer else wait.reason
        return Seen(now, free, wait.time, idle=at_rest)

    def swing(self, histories: Sequence[Path], planned: Window) -> str:
        """Say so where parts swing too much to be rigid in a window."""
        found = swing_in(self._history(histories), planned.free, planned.tr)
        return f"tr = {planned.tr:.6g}: {found.told}" if found and found.flight > planned.td - planned.free else ""

    def _history(self, histories: Sequence[Path]) -> History:
        return in_deck(open_run([str(path) for path in histories]), self._inventory).history(self._selection)

    def _floor(self, known: float) -> Wait | None:
        """Give the longest wait that is known from the deck, or from the record of flights before."""
        if known > (self._of_deck.time if self._of_deck else 0.0):
            return Wait(known, "record", "as in the flight before")
        return self._of_deck
