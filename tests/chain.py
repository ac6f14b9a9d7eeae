"""Chain of three masses and two springs, computed by a solver with and without switching."""

import csv
from functools import cache

from d2rpick.histories.history import History
from d2rpick.histories.opening import Selection
from tests.computed import locate_results, locate_stored
from tests.reading import read_history

TD_PEAK, TD_LATE = 0.13505, 0.238


@cache
def read_chain_history(*energies: str) -> History:
    """Read the energy history of the reference run, by default the sum of the energies of both springs."""
    energies = energies or ("IE_spring1_J", "IE_spring2_J")
    return read_history([locate_stored("chain_ref.csv.gz")], Selection(energy=energies))


@cache
def scan() -> tuple[dict[str, float], ...]:
    """Read the table of the switched runs: times, true signs of both springs, and the computed residual."""
    names = ("tr_s", "td_s", "sign1", "sign2", "R_sim")
    with locate_results("chain_scan.csv").open(encoding="ascii") as lines:
        return tuple(
            {name: float(row[name]) for name in names} for row in csv.DictReader(lines)
        )
