"""Switch at pairs with a predicted residual, and compare: ``python -m validation.vibration FOLDER [CASE...]``.

A case is a model with a landing after td.  Its reference, a reference with a smaller time step and a run for each pair
are computed unless FOLDER contains them.  The velocities of all nodes from td to the landing give the residual and the
correlation.  Differences after the landing are printed with their estimate from the vibration error: R^2 H over the
rise of the internal energy.  Without OPENRADIOSS_PATH nothing is computed.
"""

from __future__ import annotations

import argparse
import csv
import os
import sys
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

import d2rpick
from d2rpick.base.caching import cached_property
from d2rpick.histories.opening import Selection, open_run
from validation import frame_deck
from validation.compare import compare, read
from validation.frame_deck import Landing, write_deck
from validation.landing import TOTAL, Record, compare_landings
from validation.models import MODELS, Model
from validation.nodes import (
    compare_vibration,
    compute_vibration_energy,
    read_motion,
    read_nodes,
)
from validation.run import run

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    Pair = tuple[float, float]  # tr and td [s]

    from validation.landing import LandingDifference
    from validation.nodes import Nodes, VibrationError

_SMALLER_SCALE: Final = (
    0.85  # of the stable step: what this changes is the scatter of the model
)
_HISTORY: Final = (
    "time",
    "internal_energy",
    "kinetic_energy",
    "x_momentum",
    "y_momentum",
    "z_momentum",
)
_THINNED: Final = 4  # every so many states are written to a csv history
_GROUP_OF_BODY: Final = (60, 70)  # columns of the group in the card of a rigid body
_CLEAR: Final = 2e-4  # states so near to td and to the landing are not compared [s]

_ROLL_PAIRS: Final = (
    (0.155716, 0.371906), (0.15527, 0.37225), (0.12851, 0.26421), (0.0957549, 0.372553), (0.10516, 0.37225),
    (0.119556, 0.372923),
)  # fmt: skip
_CAR_PAIRS: Final = ((0.0386669, 0.146717), (0.0496, 0.1464), (0.1, 0.1464))
_CAR_PARTS: Final = (
    "floor", "rail_p", "rail_m", "side_p", "side_m", "roof", "bulkheads", "glass", "hood", "bumper", "bows", "engine",
    "battery", "wheels",
)  # fmt: skip
_LANDING, _REACH = (
    0.1155,
    0.0975,
)  # of the frame [s]; how far its lowest foot leads then [m]
_TD_FRAME: Final = 0.10025
_FRAME_STARTS: Final = (
    0.019475,
    0.018775,
    0.01835,
    0.028825,
    0.0121,
    0.045325,
    0.048425,
    0.014575,
    0.024125,
)
_FRAME_PAIRS: Final = tuple((tr, _TD_FRAME) for tr in _FRAME_STARTS)
_COLUMNS: Final = (
    "case", "tr_s", "td_s", "R_predicted", "R_high", "mean_energy_low", "mean_energy_high",
    "R_nodes", "correlation", "mean_energy", "worth", "shift_s", "impulse", "place_m",
    "turned_deg", "energy", "rise_J", "rms", "peak", "final",
)  # fmt: skip


@dataclass(frozen=True)
class Frame(Model):
    """Frame of `frame_deck` with its landing speed."""

    landing: Landing = field(default_factory=Landing)

    def deck(self) -> bytes:
        """Return the starter deck."""
        return write_deck(self.landing).encode()


@dataclass(frozen=True)
class AllNodes(Model):
    """Stored deck whose rigid body contains the nodes of a ``group``; its histories hold their motion."""

    group: int = 0

    def deck(self) -> bytes:
        """Return the starter deck."""
        text = super().deck().decode()
        text_before, text_after = text.split("/TH/NODE/1\n")
        tail = text_after[text_after.index("/TH/PART/") :]
        nodes = (
            text.partition(f"/GRNOD/NODE/{self.group}\n")[2]
            .partition("\n/")[0]
            .split("\n", 1)[1]
            .split()
        )
        watched = "".join(
            f"{int(node):10d}{0:10d}node {node}\n"
            for node in nodes
            if int(node) != self.main
        )
        variables = "DX        DY        DZ        VX        VY        VZ"
        return f"{self._switch_group(text_before)}/TH/NODE/1\nnodes\n{variables}\n{watched}{tail}".encode()

    def _switch_group(self, text: str) -> str:
        """Make the first rigid body contain the group."""
        head, body = text.split("/RBODY/1\n")
        title, card, further = body.split("\n", 2)
        start, end = _GROUP_OF_BODY
        return f"{head}/RBODY/1\n{title}\n{card[:start]}{self.group:10d}{card[end:]}\n{further}"


class Case(NamedTuple):
    """Model, switched parts, pairs, and times [s].

    It flies from ``flight_start`` to the landing; the runs are compared for the time ``after_landing``.
    """

    model: Model
    parts: tuple[str, ...]
    pairs: tuple[Pair, ...]
    flight_start: float
    after_landing: float


def watch_all_nodes(name: str, group: int, interval: float) -> AllNodes:
    """Return a stored model that switches a group of nodes and writes their motion each ``interval`` [s]."""
    model = MODELS[name]
    return AllNodes(
        name, model.what, model.main, model.t_end, interval, model.cap, group=group
    )


def _make_frame_case(speed: float, pairs: tuple[Pair, ...]) -> Case:
    """Return the frame with a landing speed [m/s]; the ground is placed so that the frame lands at the same time."""
    landing = Landing(speed, _LANDING + _REACH / speed)
    model = Frame(
        frame_deck.NAME,
        "frame on four feet",
        frame_deck.MAIN_NODE,
        0.16,
        5e-5,
        2e-5,
        landing=landing,
    )
    return Case(model, frame_deck.PARTS, pairs, 0.004, 0.025)


CASES: Final = {
    "ROLL": Case(
        watch_all_nodes("ROLL", group=2, interval=1e-4),
        ("box", "step"),
        _ROLL_PAIRS,
        flight_start=0.0885,
        after_landing=0.06,
    ),
    "FRAME": _make_frame_case(
        5.0, (*_FRAME_PAIRS, (_TD_FRAME - 3e-5, _TD_FRAME))
    ),  # the last one only stops the vibration
    "FRAME-FAST": _make_frame_case(10.0, _FRAME_PAIRS[::2]),
    "FRAME-SLOW": _make_frame_case(2.5, _FRAME_PAIRS[::2]),
    "CAR": Case(
        watch_all_nodes("CAR", group=4, interval=1e-4),
        _CAR_PARTS,
        _CAR_PAIRS,
        flight_start=0.0386,
        after_landing=0.08,
    ),
}


class Prediction(NamedTuple):
    """Prediction of d2rpick for a pair, from the reference alone; None if unknown [-].

    ``residual`` and its upper bound, bounds of the mean energy from td to the landing over that of the reference.
    """

    residual: float | None = None
    residual_high: float | None = None
    mean_energy_low: float | None = None
    mean_energy_high: float | None = None


class Row(NamedTuple):
    """Result for a pair, or for the smaller time step, which has neither pair nor vibration.

    ``mean_energy`` from td to the landing is over that of the reference [-].
    ``worth`` is R^2 H over the rise of the internal energy at the landing, with the residual R of the nodes [-].
    """

    pair: Pair | None
    predicted: Prediction
    vibration: VibrationError | None
    mean_energy: float | None
    worth: float
    landing: LandingDifference


@dataclass(frozen=True)
class Reference:
    """Reference run of a case, with which its switched runs are compared."""

    case: Case
    legs: list[Path]
    nodes: Nodes
    history: Path

    def compare_scatter(self, legs: Sequence[Path]) -> Row:
        """Compare the reference with a run that is not switched either."""
        landing = self._compare_landings(legs, self.case.pairs[0][1])
        return Row(None, Prediction(), None, None, 0.0, landing)

    def compare_pair(self, legs: Sequence[Path], pair: Pair) -> Row:
        """Compare a switched run."""
        landing = self._compare_landings(legs, pair[1])
        start, end = pair[1] + _CLEAR, self.record(pair[1]).landing - _CLEAR
        wanted, reference_motion = (
            read_motion(names, self.nodes, start, end) for names in (self.legs, legs)
        )
        vibration = compare_vibration(wanted, reference_motion, self.nodes)
        worth = (
            vibration.residual**2 * self.vibration_energy / landing.energies[TOTAL].rise
        )
        theirs, ours = (
            read([str(leg) for leg in names]) for names in (self.legs, legs)
        )
        mean_energy = compare(theirs, ours, pair[1]).mean_ratio
        return Row(
            pair, predict(self.history, *pair), vibration, mean_energy, worth, landing
        )

    def _compare_landings(self, legs: Sequence[Path], td: float) -> LandingDifference:
        since = np.arange(0.0, self.case.after_landing, self.case.model.interval)
        wanted = self.record(td).course(self.nodes, since)
        switched = Record(legs, self.case.parts, td)
        switched.align(wanted, since)
        return compare_landings(
            wanted, switched.course(self.nodes, since), self.case.parts, self.nodes
        )

    def record(self, td: float) -> Record:
        """Return the histories of the reference with its landing after td [s]."""
        return Record(self.legs, self.case.parts, td)

    def write_history(self) -> None:
        """Write energies and momenta of the switched parts as csv, every fourth state."""
        (database,) = open_run([str(leg) for leg in self.legs], Selection()).databases
        ids = [part.id for part in database.parts if part.title in self.case.parts]
        columns = [
            database.time,
            *(database.part_channel(name, ids).sum(axis=1) for name in _HISTORY[1:]),
        ]
        rows = np.stack(columns, axis=1)[::_THINNED]
        np.savetxt(
            self.history,
            rows,
            fmt="%.6g",
            delimiter=",",
            header=",".join(_HISTORY),
            comments="",
        )

    @cached_property
    def vibration_energy(self) -> float:
        """Mean energy of the vibration in the second half of the flight [J]."""
        landing = self.record(self.case.pairs[0][1]).landing
        start = (self.case.flight_start + landing) / 2
        return compute_vibration_energy(
            read_motion(self.legs, self.nodes, start, landing - _CLEAR), self.nodes
        )


def compute_study(case: Case, folder: Path, solver: Path) -> Iterator[Row]:
    """Compute missing runs of a case in a folder; yield a row for the smaller time step, then one for each pair.

    The energies and momenta of the reference are written to ``reference.csv`` in the folder.
    """
    model = case.model
    legs = compute(model, folder / "reference", [], solver)
    nodes = read_nodes(folder / "reference" / f"{model.name}_0000.rad")
    reference = Reference(case, legs, nodes, folder / "reference.csv")
    reference.write_history()
    smaller = compute(
        replace(model, scale=_SMALLER_SCALE), folder / "smaller_step", [], solver
    )
    yield reference.compare_scatter(smaller)
    for pair in case.pairs:
        name = f"tr_{1e3 * pair[0]:g}_td_{1e3 * pair[1]:g}"
        switched = compute(model, folder / name, [pair], solver)
        yield reference.compare_pair(switched, pair)


def predict(history: Path, tr: float, td: float) -> Prediction:
    """Return the prediction of d2rpick for a pair from the history of the reference."""
    verdict = d2rpick.verify(d2rpick.read(history), tr=tr, td=td).to_dict()
    return Prediction(**{name: verdict[name] for name in Prediction._fields})


def compute(
    model: Model, folder: Path, windows: list[Pair], solver: Path
) -> list[Path]:
    """Run a model unless its folder contains a finished run; return its time histories."""
    done = folder / "done"
    if not done.exists():
        run(model, folder, windows, solver)
        done.touch()
    return sorted(folder.glob(f"{model.name}T[0-9][0-9]"))


def list_cells(name: str, row: Row) -> Iterator[tuple[object, ...]]:
    """Yield the lines of a row in the table of results, one for each energy."""
    pair, vibration = row.pair or (None, None), row.vibration or (None, None)
    shared = (
        name,
        *pair,
        *row.predicted,
        *vibration,
        row.mean_energy,
        row.worth,
        *row.landing[1:],
    )
    for energy, difference in row.landing.energies.items():
        yield (
            *shared,
            energy,
            difference.rise,
            difference.rms,
            difference.peak,
            difference.final,
        )


def main() -> None:
    """Write the table of results as csv to stdout."""
    parser = argparse.ArgumentParser(
        prog="python -m validation.vibration", description=__doc__
    )
    parser.add_argument("folder", type=Path)
    parser.add_argument(
        "cases",
        nargs="*",
        metavar="CASE",
        help=f"of {', '.join(CASES)}; by default all",
    )
    options = parser.parse_args()
    solver = os.environ.get("OPENRADIOSS_PATH")
    if not solver:
        print("skipped: OPENRADIOSS_PATH is not set")
        return
    table = csv.writer(sys.stdout, lineterminator="\n")
    table.writerow(_COLUMNS)
    for name in options.cases or CASES:
        for row in compute_study(CASES[name], options.folder / name, Path(solver)):
            for line in list_cells(name, row):
                table.writerow(
                    [
                        f"{value:.6g}" if isinstance(value, float) else value
                        for value in line
                    ]
                )


if __name__ == "__main__":
    main()
