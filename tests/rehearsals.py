"""Twenty-one rollovers, fixed in advance, compare the recommendations with switched runs at every tr."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from d2rpick.models.box_model import Parameters
from d2rpick.models.box_run import (
    BOX,
    BoxWindow,
    Outcome,
    Record,
    scan,
    scan_times,
    simulate,
)
from d2rpick.report import history_files
from tests.command import put, run_json
from tests.energies import require

T_END = 0.55
# td is this much before the landing [s], rounded to 1 ms; as in the published study.
BEFORE_LANDING = 0.010
# Time after td for the mean energy, without ground contact [s]: two periods of the lowest mode.
MEAN_OVER = 0.1
NO_GROUND = 50.0


def _halton(index: int, base: int) -> float:
    """Return number ``index`` of the Halton sequence, which fills [0, 1) evenly."""
    value, share = 0.0, 1.0
    while index:
        share /= base
        value += share * (index % base)
        index //= base
    return value


def _set(index: int) -> Parameters:
    stiffness, strain, damping, speed, mesh = (
        _halton(index, base) for base in (2, 3, 5, 7, 11)
    )
    return Parameters(
        stiffness=3e6 * 3**stiffness,
        yield_strain=3.5e-3 * 2**strain,
        damping=3 * damping,
        speed=6.4 + 1.2 * speed,
        mesh=8 + round(12 * mesh),
    )


SETS = (Parameters(), *(_set(index) for index in range(1, 21)))


@dataclass(frozen=True)
class Rehearsal:
    """One set of parameters: the reference run, the recommendation, and the switched runs compared with the reference.

    ``announced`` is the predicted mean energy after td over that of the reference.  ``mean_ratio`` is the computed
    value over two periods after td, ``mean_to_landing`` the value over the few milliseconds until the landing.
    """

    parameters: Parameters
    reference: Record
    td: float
    flight: tuple[float, float, str]
    tr: float | None
    worst: float
    error: float
    announced: float
    mean_ratio: float
    mean_to_landing: float
    outcomes: tuple[Outcome, ...]

    @property
    def roll_share(self) -> float:
        """Roll error of the recommended tr divided by the largest one in the scan [-]."""
        return self.error / self.worst

    @property
    def energy_off(self) -> float:
        """Difference between the mean energy after td and the announced value [-]."""
        return self.mean_ratio / self.announced - 1


def rehearse(
    parameters: Parameters, folder: Path, *, stride: int = 1, interval: float = 1e-4
) -> Rehearsal:
    """Compute one set of parameters; the scan uses every ``stride``-th tr."""
    reference = simulate(parameters, T_END, interval=interval)
    until_landing = reference.time <= require(reference.landed) + 0.04
    td = round(require(reference.landed) - BEFORE_LANDING, 3)
    file = put(
        folder / "reference.matsum",
        history_files.BOX_WRITERS["matsum"](
            _until(reference, int(until_landing.sum()))
        ),
    )
    suggestion = run_json("suggest", "--td", str(td), "--part", "box", str(file))
    tr = suggestion["recommended"]["tr"] if suggestion["recommended"] else None
    flight = suggestion["flight"]
    times = sorted(
        {*scan_times(require(reference.released), td)[::stride], *([tr] if tr else [])}
    )
    outcomes = tuple(scan(parameters, reference, times, td, jobs=1))
    chosen = next((outcome for outcome in outcomes if outcome.tr == tr), None)
    return Rehearsal(
        parameters=parameters,
        reference=reference,
        td=td,
        flight=(flight["start"], flight["end"], flight["source"]),
        tr=tr,
        worst=max(abs(outcome.roll_error) for outcome in outcomes),
        error=abs(chosen.roll_error) if chosen else np.nan,
        announced=suggestion["expected"]["ratio"] if chosen else np.nan,
        mean_ratio=_mean_ratio(parameters, tr, td, interval) if tr else np.nan,
        mean_to_landing=chosen.mean_ratio if chosen else np.nan,
        outcomes=outcomes,
    )


def _mean_ratio(parameters: Parameters, tr: float, td: float, interval: float) -> float:
    """Return the mean energy of the box after td, switched over reference, without contact with the ground."""
    flying = replace(parameters, ground=NO_GROUND)
    runs = (
        simulate(flying, td + MEAN_OVER, *windows, interval=interval)
        for windows in ((BoxWindow(tr, td),), ())
    )
    means = [float(run.internal_energy[run.time > td, BOX].mean()) for run in runs]
    return means[0] / means[1]


def _until(record: Record, states: int) -> Record:
    """Return the first states of a record."""
    return Record._make(
        value[:states] if isinstance(value, np.ndarray) else value for value in record
    )
