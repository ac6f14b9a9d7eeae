"""Warn if a file has too few states to determine the level of a fluctuating energy."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from d2rpick.base.errors import Caution, list_names
from d2rpick.histories.formats import FAMILIES
from d2rpick.histories.samples import changes_at_random
from d2rpick.vibration.identify import MIN_SAMPLES_PER_PERIOD

if TYPE_CHECKING:
    from collections.abc import Iterator

    from d2rpick.choice.pair.situation import Situation

# Smallest number of states that resolve a flight; if there are fewer, a shorter output interval is proposed.
ENOUGH_STATES: Final = 200
# Number of energy extrema in each energy period: a minimum and a maximum.
_TURNS_PER_PERIOD: Final = 2
# Files with a short output interval are too coarse if they have fewer states than this up to td.
_FEWEST: Final = 20
# LS-DYNA usually writes these files at shorter intervals than d3plot.
_OFTENER: Final = ("d3thdt", "glstat", "matsum", "binout")


def warn_about_few_states(situation: Situation) -> Iterator[Caution]:
    """Yield a warning if a visible period has fewer than 10 states, too few to determine the energy level at td.

    If no period is visible, the output may be too coarse to show any, since a d3plot has a few hundred states at most.
    Other files have a shorter output interval, so they are only examined for a very small number of states.
    """
    history = situation.history
    td = situation.td
    start = situation.flight.start
    if situation.at_rest:
        return
    begin = history.start if start is None else start
    _, energy = history.between(begin, td)
    states = energy.size
    if history.energy_format not in FAMILIES:
        if states < _FEWEST and begin < td:
            interval = (td - begin) / ENOUGH_STATES
            yield Caution(
                "few-states",
                f"{states} states from {begin:.6g} to td = {td:.6g} are too few to show how the energy oscillates; "
                f"write the energies every {interval:.2g} or more often",
            )
        return
    turns = int(np.count_nonzero((history.turns > begin) & (history.turns < td)))
    if (
        turns >= _TURNS_PER_PERIOD
        and states * _TURNS_PER_PERIOD >= MIN_SAMPLES_PER_PERIOD * turns
    ):
        return
    if changes_at_random(energy):
        return  # The grade of the vibration blames the noise.
    oftener = list_names([name for name in _OFTENER if name != history.energy_format])
    text = (
        f"{states} states of the {history.energy_format} up to td = {td:.6g} are too few to show how the "
        "energy oscillates"
    )
    yield Caution(
        "few-states",
        f"{text}, so the energy at td is uncertain; name a file with more states: {oftener}",
    )
