"""Drive a Radioss run that switches parts without a reference run."""

from __future__ import annotations

import errno
import hashlib
from contextlib import contextmanager
from typing import TYPE_CHECKING

from d2rpick.api.answer import Paged
from d2rpick.api.cards import Cards, parse_id_ranges
from d2rpick.base.data_classes import dataclass
from d2rpick.base.errors import Caution, ConfigurationError, D2RPickError
from d2rpick.choice.parts.cost import CostModel
from d2rpick.choice.parts.deck_of_run import warn_about_solver
from d2rpick.deck import read_inventory
from d2rpick.deck.writing import read_driven_deck
from d2rpick.histories.names import Selection
from d2rpick.histories.opening import open_run
from d2rpick.running.checks import check_driven
from d2rpick.running.drive import JOURNAL, Driven, Driver, Journal
from d2rpick.running.engine import Commands, Solver, alone
from d2rpick.running.inner_motion import check_wait, wait_of_deck
from d2rpick.running.looks import Looks
from d2rpick.running.sequence import Limits, windows

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence
    from pathlib import Path

    from d2rpick.running.sequence import Leg

# Shortest time from td to the next contact that is allowed [s].
_SHORTEST = 2e-3
# Assumed cost of a cycle with rigid parts relative to a deformable one, if it does not follow from the deck [-].
_UNKNOWN = 0.5


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Drive(Paged, Driven):
    """Immutable answer of ``d2rpick drive``."""

    command: tuple[str, ...]
    kind = "drive"
    said = ("windows", "saved")

    def page(
        self,
        command: Sequence[str],
        judging: Sequence[str] = (),  # noqa: ARG002  other answers use the argument
        cards: Cards | None = None,  # noqa: ARG002  other answers use the argument
    ) -> str:
        """Return the page about the run."""
        from d2rpick.report.pages import drive_page

        return drive_page(self, command)


class Driving:
    """A run that ``d2rpick drive`` starts or resumes, with times in the unit of the deck.

    Raises
    ------
    D2RPickError
        If the deck cannot be driven, or the wait contradicts the springs of the deck.
    """

    def __init__(
        self,
        deck: str,
        folder: Path,
        report: Callable[[str], None],
        part: Sequence[str] = (),
        wait: float | None = None,
        margin: float | None = None,
        *,
        starter: str | None = None,
        engine: str | None = None,
        threads: int = 1,
    ) -> None:
        self.name, self.folder, self._report = deck, folder, report
        self.commands = Commands(starter, engine, threads)
        self.deck = read_driven_deck(
            deck, parse_id_ranges("--part", part, takes_history=False) if part else ()
        )
        self.inventory = read_inventory(deck)
        if wait is not None:
            check_wait(wait, wait_of_deck(self.inventory), deck)
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
        selection = Selection(
            parts=tuple(map(str, self.deck.parts)),
            springs=tuple(map(str, sorted(self.inventory.springs))),
        )
        self.looks = Looks(selection, self.inventory, wait)
        self.solver = Solver(folder, self.deck.name, self.commands)
        self.cautions: tuple[Caution, ...] = tuple(
            warn_about_solver(self.deck.parts, self.inventory)
        )

    @contextmanager
    def driver(self, *, resume: bool) -> Iterator[Driver]:
        """Lock the run's folder against other drivers, and yield the driver.

        Raises D2RPickError if another driver is at work there, if the folder contains something else, if the run has
        begun and is not to be resumed, or if the disk is full.
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
            begun = journal.records[:1]
            if resume and not begun:
                raise D2RPickError(
                    f"{folder}: there is no run to resume in this folder; give the folder of the run, or leave out "
                    "--resume to begin one"
                )
            computed = journal.has("ended")
            if computed and not resume:
                raise D2RPickError(
                    f"{folder}: this run has begun; continue it with --resume, or choose another folder"
                )
            if computed and begun[0]["deck"] != digest:
                raise D2RPickError(
                    f"{folder}: this run was begun with another deck than {self.name} is now; give that deck"
                )
            if not begun:
                self.refuse_other_files()
            if not computed:  # The user may have corrected the deck or the command.
                journal.path.unlink(missing_ok=True)
                journal = Journal(journal.path)
                journal.add("begun", deck=digest)
            try:
                yield Driver(
                    self.deck,
                    self.solver,
                    journal,
                    self.limits,
                    self.looks,
                    self._report,
                )
            except OSError as error:
                if error.errno not in (errno.ENOSPC, errno.EDQUOT):
                    raise
                raise D2RPickError(
                    f"{folder}: {error.strerror}; make room, then --resume"
                ) from None

    def refuse_other_files(self) -> None:
        """Raise D2RPickError if the folder of the run exists and contains files, but no run that was begun."""
        folder = self.folder
        if not folder.is_dir() or (folder / JOURNAL).exists():
            return
        if any(not file.name.startswith(".") for file in folder.iterdir()):
            raise D2RPickError(f"{folder}: the folder is not empty; choose another one")

    def answer(self, driver: Driver, command: Sequence[str]) -> Drive:
        """Return the result for the part of the run that has been computed."""
        legs = driver.journal.legs
        last = legs[-1].order.number if legs else 0
        names = [str(self.solver.history(number)) for number in range(1, last + 1)]
        reasons = [
            leg.findings.why
            for leg in legs
            if leg.findings.why and not leg.findings.idle
        ]
        flights = tuple(windows(legs, self.limits))
        # An engine run that was taken back instead of being computed again has no cycles.
        computed_legs = [leg for leg in legs if leg.cycles != 0]
        warnings = [
            Caution("out-of-place", window.warning)
            for window in flights
            if window.warning
        ]
        return Drive(
            run=open_run(names),
            deck=self.deck,
            windows=flights,
            legs=tuple(computed_legs),
            why=reasons[-1] if reasons else "",
            saved=(
                self._by_model(computed_legs),
                _estimate_saving_by_time(computed_legs, self.deck.end),
            ),
            cautions=(*self.cautions, *warnings),
            command=tuple(command),
        )

    def _by_model(self, legs: Sequence[Leg]) -> float | None:
        share = CostModel(self.inventory).saved(self.deck.parts).value
        steps = [
            [
                leg.length / leg.cycles
                for leg in legs
                if leg.cycles and leg.length > 0 and leg.order.rigid is rigid
            ]
            for rigid in (False, True)
        ]
        if share is None or not all(steps):
            return None
        ratio = max(steps[1]) / min(steps[0])
        took = sum(
            leg.length * ((1 - share) / ratio if leg.order.rigid else 1.0)
            for leg in legs
        )
        return 1 - took / self.deck.end


def _estimate_saving_by_time(legs: Sequence[Leg], end: float) -> float | None:
    """Return the fraction of the run's CPU time that is saved [-]; None if it is unknown.

    A run without switching is assumed to cost the mean of the deformable segments throughout.
    """
    if any(leg.cpu is None for leg in legs):
        return None
    deformable = [leg for leg in legs if not leg.order.rigid]
    whole = (
        sum(leg.cpu or 0.0 for leg in deformable)
        / sum(leg.length for leg in deformable)
        * end
    )
    return 1 - sum(leg.cpu or 0.0 for leg in legs) / whole if whole else None
