"""Define a question: a run, its selected energy, and the settings for the choice."""

from __future__ import annotations

from dataclasses import field
from typing import TYPE_CHECKING, Final

from d2rpick.base.data_classes import dataclass
from d2rpick.base.tuples import NamedTuple
from d2rpick.choice.options import ChoiceOptions
from d2rpick.choice.pair.grades import FAIR
from d2rpick.histories.names import Selection
from d2rpick.histories.opening import open_run

if TYPE_CHECKING:
    from collections.abc import Sequence

    from d2rpick.choice.parts.cost import ByDeck
    from d2rpick.deck.geometry import Placement
    from d2rpick.flight.position_error import RigidBody
    from d2rpick.histories.history import History
    from d2rpick.histories.run import OpenedRun
    from d2rpick.vibration.modes import Mode

# Smallest number of states from which times can be chosen.
FEWEST_STATES: Final = 3
_DEFAULT = Selection()


class Reference(NamedTuple):
    """A reference run with its selected energy."""

    run: OpenedRun
    history: History

    @classmethod
    def of(cls, run: OpenedRun, selection: Selection = _DEFAULT) -> Reference:
        """Read the selected energy of an open run; raise FormatError if it is missing, HistoryError if it is wrong."""
        if selection.parts:
            # Imported here to keep start-up fast.
            from d2rpick.flight.momentum import (
                replace_words_by_part_ids,
            )

            selection = replace_words_by_part_ids(run, selection)
        history = run.history(selection)
        run.check_energy(history)
        return cls(run, history)

    def like(self, run: OpenedRun, selection: Selection = _DEFAULT) -> Reference:
        """Read the same parts from another run of the model, even if the selection gave them different names."""
        ids = tuple(str(part.id) for part in self.history.parts or ())
        springs = tuple(str(part.id) for part in self.history.springs)
        run = run.within(self.run.surroundings)
        return Reference.of(
            run, selection._replace(parts=ids, springs=springs) if ids else selection
        )


def read_reference(
    names: Sequence[str], selection: Selection = _DEFAULT, input_format: str = "auto"
) -> Reference:
    """Open the files of a run and read the selected energy; see `open_run` for the arguments and errors."""
    return Reference.of(open_run(names, selection, input_format), selection)


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Settings(ChoiceOptions):
    """The analyst's settings: the choice options, and the data from the deck of the run.

    ``oscillator`` is given by the user instead of identified. If ``replay`` is False, pairs are judged only by the
    energy level. ``min_quality`` is the lowest grade of a pair that is planned or that a deck may contain. ``bodies``
    are the rigid bodies that the parts become; it is None if there is no deck, and empty if the deck does not define
    them, and one body is then assumed. ``placement`` contains the part positions according to the deck, or None.
    ``by_deck`` names the files from which these values, and a cost share that the user did not give, were computed;
    None if there is no deck. ``kept_off`` contains the main nodes of rigid bodies that a Radioss deck keeps inactive.
    ``kept_deformable`` contains the parts that the deck does not allow to become rigid, such as springs.
    ``ruined`` lists faults of the deck that ruin its run.
    """

    min_quality: str = FAIR
    step_ratio: float = 1.0
    oscillator: Mode | None = None
    replay: bool = True
    bodies: tuple[RigidBody, ...] | None = None
    placement: Placement | None = field(default=None, compare=False, repr=False)
    by_deck: ByDeck | None = field(default=None, compare=False, repr=False)
    kept_off: tuple[int, ...] = field(default=(), compare=False, repr=False)
    kept_deformable: tuple[int, ...] = field(default=(), compare=False, repr=False)
    ruined: tuple[str, ...] = field(default=(), compare=False, repr=False)

    def run_time_share(self, rigid_fraction: float) -> float | None:
        """Return the expected run time relative to the reference run [-]; None if the cost fraction is unknown."""
        # Imported here to keep start-up fast.
        from d2rpick.vibration.measures import run_time_share

        share = self.cost_share
        if share is None:
            return None
        return run_time_share(rigid_fraction, share, self.step_ratio)
