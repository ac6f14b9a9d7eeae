"""A Radioss run that switches itself while it is computed, in its first run."""

from __future__ import annotations

import errno
import hashlib
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING

from d2rpick.api.answer import Paged
from d2rpick.api.cards import Cards, numbers
from d2rpick.base.errors import ConfigurationError, D2RPickError
from d2rpick.choice.cost import CostModel
from d2rpick.choice.deck_of_run import doubts_of_solver
from d2rpick.deck import read_inventory
from d2rpick.deck.writing import read_driven_deck
from d2rpick.histories.opening import open_run
from d2rpick.running.checks import check_driven
from d2rpick.running.drive import JOURNAL, Driven, Driver, Journal, Observer
from d2rpick.running.engine import Commands, Solver, alone
from d2rpick.running.inner_motion import check_wait, wait_of_deck
from d2rpick.running.sequence import Limits, windows

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence
    from pathlib import Path

    from d2rpick.base.errors import Caution
    from d2rpick.running.sequence import Leg

# Of a second: so long before a contact td lies at least.
_SHORTEST = 2e-3
# What a cycle of rigid parts costs, of a deformable one, where the deck does not tell.
_UNKNOWN = 0.5


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Drive(Paged, Driven):
    """Answer of ``d2rpick drive``; nothing of it changes."""

    command: tuple[str, ...]
    kind = "drive"
    said = ("windows", "saved")

    def page(
        self,
        command: Sequence[str],
        judging: Sequence[str] = (),  # noqa: ARG002
        cards: Cards | None = None,  # noqa: ARG002
    ) -> str:
        """Write the page."""
        from d2rpick.report.pages import drive_page

        return drive_page(self, command)


class Driving:
    """A run that is about to be driven, or to go on, as ``d2rpick drive`` is told; times in the unit of the deck.

    Raises
    ------
    D2RPickError
        If the deck cannot be driven, or the wait contradicts what it says of its springs.
    """

    def __init__(
        self,
        deck: str,
        folder: Path,
        told: Callable[[str], None],
        part: Sequence[str] = (),
        wait: float | None = None,
        margin: float | None = None,
        *,
        starter: str | None = None,
        engine: str | None = None,
        threads: int = 1,
    ) -> None:
        self.name, self.folder, self._told = deck, folder, told
        self.commands = Commands(starter, engine, threads)
        self.deck = read_driven_deck(deck, numbers("--part", part) if part else ())
        self.inventory = read_inventory(deck)
        known = wait_of_deck(self.inventory)
        if wait is not None:
            check_wait(wait, known, deck)
        shortest = _SHORTEST * self.deck.second if self.deck.second else 0.0
        share = CostModel(self.inventory).saved(self.deck.parts).value
        self.limits = Limits(
            self.deck.end,
            self.deck.interval,
            shortest,
            margin,
            _UNKNOWN if share is None else 1 - share,
        )
        check_driven(deck, self.inventory, self.deck.parts, self.limits, wait)
        self.observer = Observer(self.deck.parts, self.inventory, wait, known)
        self.solver = Solver(folder, self.deck.name, threads)
        self.cautions: tuple[Caution, ...] = tuple(
            doubts_of_solver(self.deck.parts, self.inventory)
        )

    @contextmanager
    def driver(self, *, resume: bool) -> Iterator[Driver]:
        """Give the driver of the run in its folder, and keep others out.

        D2RPickError where one is at work there, the folder holds something else, or the run has begun and is not to
        be resumed, or the disk is full.
        """
        folder = self.folder
        if missing := self.commands.missing():
            raise ConfigurationError(
                f"{missing}: no such program; correct the command of --starter or --engine"
            )
        folder.mkdir(parents=True, exist_ok=True)
        with alone(folder):
            journal = Journal(folder / JOURNAL)
            digest = hashlib.sha256(b"\0".join(self.deck.files.values())).hexdigest()
            begun, computed = journal.all("begun"), journal.all("ended")
            if computed and not resume:
                raise D2RPickError(
                    f"{folder}: this run has begun; --resume goes on with it, or choose another folder"
                )
            if computed and begun[0]["deck"] != digest:
                raise D2RPickError(
                    f"{folder}: begun with another deck than {self.name} is now; name that one"
                )
            if not begun and any(
                not one.name.startswith(".") for one in folder.iterdir()
            ):
                raise D2RPickError(
                    f"{folder}: the folder is not empty; choose another one"
                )
            if (
                not computed
            ):  # a deck, or a command, that has been corrected may be another one
                journal.path.unlink(missing_ok=True)
                journal = Journal(journal.path)
                journal.add("begun", deck=digest)
            try:
                yield Driver(
                    self.deck,
                    self.solver,
                    journal,
                    self.commands,
                    self.limits,
                    self.observer,
                    self._told,
                )
            except OSError as error:
                if error.errno not in (errno.ENOSPC, errno.EDQUOT):
                    raise
                raise D2RPickError(
                    f"{folder}: {error.strerror}; make room, then --resume"
                ) from None

    def answer(self, driver: Driver, command: Sequence[str]) -> Drive:
        """Say what has come of the run so far."""
        legs = driver.legs
        last = legs[-1].order.number if legs else 0
        names = [str(self.solver.history(number)) for number in range(1, last + 1)]
        reasons = [
            leg.findings.why
            for leg in legs
            if leg.findings.why and not leg.findings.idle
        ]
        return Drive(
            run=open_run(names),
            deck=self.deck,
            windows=tuple(windows(legs, self.limits)),
            legs=tuple(legs),
            why=reasons[-1] if reasons else "",
            saved=(self._by_model(legs), _by_time(legs, self.deck.end)),
            cautions=(*self.cautions, *driver.out_of_place),
            command=tuple(command),
        )

    def _by_model(self, legs: Sequence[Leg]) -> float | None:
        share = CostModel(self.inventory).saved(self.deck.parts).value
        steps = [
            [
                one.length / one.cycles
                for one in legs
                if one.cycles and one.length > 0 and one.order.rigid is rigid
            ]
            for rigid in (False, True)
        ]
        if share is None or not all(steps):
            return None
        ratio = max(steps[1]) / min(steps[0])
        took = sum(
            one.length * ((1 - share) / ratio if one.order.rigid else 1.0)
            for one in legs
        )
        return 1 - took / self.deck.end


def _by_time(legs: Sequence[Leg], end: float) -> float | None:
    """Share that is saved where a deformable run takes as long as the deformable legs do on the whole."""
    if any(one.cpu is None for one in legs):
        return None
    deformable = [one for one in legs if not one.order.rigid]
    whole = (
        sum(one.cpu or 0.0 for one in deformable)
        / sum(one.length for one in deformable)
        * end
    )
    return 1 - sum(one.cpu or 0.0 for one in legs) / whole if whole else None
