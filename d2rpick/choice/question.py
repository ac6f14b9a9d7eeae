"""What a choice is asked about: a run, the energy in it that is meant, and how it is judged."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from d2rpick.base.tuples import NamedTuple
from d2rpick.histories.names import Selection
from d2rpick.histories.opening import open_run
from d2rpick.vibration.measures import run_time_share

if TYPE_CHECKING:
    from collections.abc import Sequence

    from d2rpick.choice.cost import ByDeck
    from d2rpick.deck.geometry import Placement
    from d2rpick.flight.position_error import RigidBody
    from d2rpick.histories.history import History
    from d2rpick.histories.run import Run
    from d2rpick.vibration.modes import Mode

_DEFAULT = Selection()


class Reference(NamedTuple):
    """A run without switching, and the energy in it that a choice is about."""

    run: Run
    history: History

    @classmethod
    def of(cls, run: Run, selection: Selection = _DEFAULT) -> Reference:
        """Read what is selected of a run that is open; FormatError when it is not there."""
        if selection.parts:
            from d2rpick.flight.momentum import (
                with_parts_by_number,
            )  # not above: a table has no parts

            selection = with_parts_by_number(run, selection)
        return cls(run, run.history(selection))

    def like(self, run: Run, selection: Selection = _DEFAULT) -> Reference:
        """Read of another run of the model the parts that this one has, whatever words they were asked for by."""
        ids = tuple(str(part.id) for part in self.history.parts or ())
        springs = tuple(str(part.id) for part in self.history.springs)
        run = run.within(self.run.surroundings)
        return Reference.of(
            run, selection._replace(parts=ids, springs=springs) if ids else selection
        )


def read(
    names: Sequence[str], selection: Selection = _DEFAULT, input_format: str = "auto"
) -> Reference:
    """Open the files of a run and read what is selected; arguments and errors as of `open_run`."""
    return Reference.of(open_run(names, selection, input_format), selection)


@dataclass(frozen=True, eq=False, repr=False)
class Settings:
    """What the analyst asks for; times in the unit of the history.

    ``after``: the load ends here, ``landing``: the next contact comes here (None: found from the record).  ``margin``:
    kept clear after the load and before the next contact (None: nothing, but where td is chosen or the landing given
    what `d2rpick.flight.margin` derives before the contact).
    ``tolerance``: on the lock-in error, on the level error where no oscillator is known.
    ``max_kinetic_share``, ``max_residual``: limits that a recommendation must keep, or None.  ``oscillator``:
    given instead of identified.  ``fit_window``: the oscillator is identified there.  ``replay`` False: judge by
    the energy level alone.  ``strict``: accept no tr of a flight that is not certain.
    ``keep_vibration``: grade the vibration by itself, however little its error is worth in the next contact.
    ``cost_share``, ``step_ratio``: of the switched parts in the cost of a step, and of the step while rigid to that
    while deformable; without the first nothing is said of the run time.
    ``bodies``: what the parts become while they are rigid, by a deck; None without one, empty where it does not tell.
    Then one body is assumed.
    ``placement``: where the deck puts the parts, or None without one.
    ``by_deck``: the files that these, and a cost share that is not given, come from; None where no deck tells anything.
    ``kept_off``: main nodes of rigid bodies that the run of a Radioss deck keeps off.  ``ruined``: what ruins that run.
    """

    after: float | None = None
    landing: float | None = None
    margin: float | None = None
    tolerance: float = 0.2
    max_kinetic_share: float | None = None
    max_residual: float | None = None
    oscillator: Mode | None = None
    fit_window: tuple[float, float] | None = None
    replay: bool = True
    strict: bool = False
    keep_vibration: bool = False
    cost_share: float | None = None
    step_ratio: float = 1.0
    bodies: tuple[RigidBody, ...] | None = None
    placement: Placement | None = field(default=None, compare=False, repr=False)
    by_deck: ByDeck | None = field(default=None, compare=False, repr=False)
    kept_off: tuple[int, ...] = field(default=(), compare=False, repr=False)
    ruined: tuple[str, ...] = field(default=(), compare=False, repr=False)

    def run_time_share(self, rigid_fraction: float) -> float | None:
        """Give the expected run time over that of the reference [-]; None where the cost share is not known."""
        share = self.cost_share
        if share is None:
            return None
        return run_time_share(rigid_fraction, share, self.step_ratio)
