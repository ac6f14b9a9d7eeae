"""Compute the sample models: define the requests for the oscillator and the rollover box, and their answers."""

from __future__ import annotations

from dataclasses import field
from typing import TYPE_CHECKING, Any

from d2rpick.api.request import OPTIONS, Request
from d2rpick.base.data_classes import dataclass
from d2rpick.base.errors import ArgumentError, Caution
from d2rpick.base.options import (
    NOT_NEGATIVE,
    POSITIVE,
    TIME,
    UNLIMITED,
    make_option,
    make_option_name,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from d2rpick.models.box_model import Parameters
    from d2rpick.models.box_run import BoxWindow, Record
    from d2rpick.report.rollover import Scan
    from d2rpick.vibration.oscillator import Oscillator, Replay, State, Trajectory

# Largest number of states in an oscillator history; a longer history would take up several gigabytes as text.
MOST_REPLAYED = 10_000_000
HISTORIES = (
    "csv",
    "hdf5",
    "glstat",
    "matsum",
)  # These are the formats of d2rpick.report.history_files, which --help does not import.

MOST_STATES = 1_000_000
PARAMETERS = (
    "speed",
    "stiffness",
    "yield_strain",
    "damping",
    "mesh",
    "drop",
    "tilt",
    "ground_stiffness",
)
# Default td [s], which is 10 ms before the ground contact in the published study.
TD = 0.37
# Tilt of a falling box that lands on an edge and tumbles [degrees].
TILT = 30.0
# Default end time of the simulation [s]; the key is True for a dropped box.
T_END = {False: 0.42, True: 1.2}
# A caution is issued if the energy imbalance of a run exceeds this fraction of its largest total energy [-].
BALANCED = 0.01


def _copy_option(name: str, **changes: Any) -> Any:
    """Return a copy of a request option in which the given attributes are replaced."""
    return field(default=None, metadata={"option": OPTIONS[name]._replace(**changes)})


@dataclass(frozen=True)
class Motion:
    """Request for a motion of the oscillator: parameters, initial state, and rigid windows."""

    stiffness: float = _copy_option("stiffness")
    mass: float = _copy_option("mass")
    frame_mass: float | None = _copy_option("frame_mass")
    beta: float | None = _copy_option("beta")
    alpha: float = _copy_option("alpha")
    v0: float | None = _copy_option("v0", help="Velocity of the frame at time 0.")
    z0: float | None = make_option(
        "Displacement of the frame at time 0.  [default: 0]", TIME
    )
    y0: float | None = make_option(
        "Displacement of the suspended mass at time 0.  [default: 0]", TIME
    )
    vz0: float | None = make_option(
        "Velocity of the frame at time 0; the same as --v0.  [default: 0]",
        TIME,
        instead_of=("v0",),
    )
    vy0: float | None = make_option(
        "Velocity of the suspended mass at time 0.  [default: 0]", TIME
    )
    tr: float | None = make_option(
        "Switch to rigid at this time; with --td.", NOT_NEGATIVE, "T"
    )
    td: float | None = make_option(
        "Switch back to deformable at this time.", NOT_NEGATIVE, "T"
    )
    t_end: float = make_option("End of the computed run.", POSITIVE, "T")
    dt: float = make_option("Output interval.", POSITIVE, "T")
    write_as: str | None = make_option(
        "Format of the result.  [default: suffix of -o, else csv]", HISTORIES
    )

    def __post_init__(self) -> None:
        """Refuse contradictory arguments."""
        given_names = [
            name
            for name in ("z0", "y0", "v0", "vz0", "vy0")
            if getattr(self, name) is not None
        ]
        if {"v0", "vz0"} <= {*given_names}:
            raise ArgumentError(
                "--v0 and --vz0 exclude each other: both are the velocity of the frame at time 0"
            )
        if not given_names:
            raise ArgumentError(
                "the motion needs a start: give --v0, or some of --z0, --y0, --vz0 and --vy0"
            )
        _ = self.oscillator
        if (self.tr is None) != (self.td is None):
            raise ArgumentError("give --tr and --td together")
        if self.tr is not None and self.td is not None:
            _check_windows((self.tr,), (self.td,), self.t_end)
        _check_interval(self.dt, self.t_end)
        if self.t_end / self.dt > MOST_REPLAYED:
            raise ArgumentError(
                f"--t-end {self.t_end:g} holds more than {MOST_REPLAYED} intervals of --dt {self.dt:g}"
            )

    @property
    def start(self) -> State:
        """The state of the oscillator at time 0."""
        from d2rpick.vibration.oscillator import State

        values = (self.z0, self.y0, self.v0 if self.vz0 is None else self.vz0, self.vy0)
        return State.of(*(value or 0.0 for value in values))

    @property
    def oscillator(self) -> Oscillator:
        """The oscillator of the request; raise ArgumentError if it is incomplete."""
        parameters = {
            name: getattr(self, name)
            for name in ("stiffness", "mass", "frame_mass", "beta", "alpha")
        }
        oscillator = Request(**parameters, v0=0.0).oscillator
        # On the command line, the oscillator is always complete, because click requires all options of the oscillator.
        assert oscillator is not None
        return oscillator

    def computed(self) -> tuple[Trajectory, Replay | None]:
        """Return the motion and, if windows are given, the motion with switching."""
        from d2rpick.vibration.oscillator import Replay, compute_trajectory

        start = self.start
        oscillator = self.oscillator
        switched = None
        if self.tr is not None and self.td is not None:
            switched = Replay(oscillator, start, 0.0, self.tr, self.td)
        return compute_trajectory(
            oscillator, start, self.t_end, self.dt, switched
        ), switched


@dataclass(frozen=True)
class Box:
    """Request for the rollover box in SI units: its parameters, its windows and the scan."""

    tr: tuple[float, ...] = make_option(
        "Switch the box to rigid at this time; for several windows give --tr and --td in pairs.",
        *(NOT_NEGATIVE, "T"), many=True,
    )  # fmt: skip
    td: tuple[float, ...] = make_option(
        "Switch the box back at this time.  [default: 0.37 with --scan]",
        NOT_NEGATIVE,
        "T",
        many=True,
    )
    with_step: bool = make_option(
        "Switch the step too, as one rigid body with the box.", "flag", default=False
    )
    drop: float | None = make_option(
        "Height in m from which the box falls on the ground, instead of tripping on the sled.",
        *(NOT_NEGATIVE, "HEIGHT"),
    )
    tilt: float | None = make_option(
        "Tilt of the falling box, in degrees.  [default: 30]", NOT_NEGATIVE, "DEG"
    )
    ground_stiffness: float | None = make_option(
        "Stiffness of the ground at a point, N/m.  [default: 5e5]", POSITIVE
    )
    scan: bool = make_option(
        "Compute switched runs for many values of tr, and compare each run with the reference run.",
        "flag",
        default=False,
    )
    jobs: int | None = make_option(
        "Number of processes of a scan.  [default: one per core]", range(1, UNLIMITED)
    )
    t_end: float | None = make_option(
        "End of the run.  [default: 0.42; if --drop is given, 1.2]", POSITIVE, "T"
    )
    dt: float = make_option("Output interval.", POSITIVE, "T", default=1e-4)
    speed: float | None = make_option(
        "Speed of the sled at the start, or of a falling box along x, in m/s.  [default: 7; if --drop is given, 0]",
        NOT_NEGATIVE,
    )
    stiffness: float | None = make_option(
        "Stiffness E A of the bars of the box, N.  [default: 4.5e6]", POSITIVE
    )
    yield_strain: float | None = make_option(
        "Yield strain of the bars of the box.  [default: 4.5e-3]", POSITIVE
    )
    damping: float | None = make_option(
        "Rate of the mass damping, 1/s.  [default: 0.2]", NOT_NEGATIVE
    )
    mesh: int | None = make_option(
        "Number of cells along each side of the box.  [default: 16]", range(4, 201)
    )
    write_as: str | None = make_option(
        "Format of a history.  [default: suffix of -o, else csv]", HISTORIES
    )

    def __post_init__(self) -> None:
        """Refuse contradictory arguments."""
        if self.scan:
            excluded = ("tr", "with_step", "write_as")
            lost = [name for name in excluded if getattr(self, name)] + ["drop"] * (
                self.drop is not None
            )
            if lost:
                raise ArgumentError(
                    f"--scan and --{make_option_name(lost[0])} exclude each other"
                )
            if len(self.td) > 1:
                raise ArgumentError("--scan takes one --td")
        elif self.jobs:
            raise ArgumentError("--jobs needs --scan")
        elif self.with_step and not self.tr:
            raise ArgumentError("--with-step needs --tr and --td")
        else:
            _check_windows(self.tr, self.td, self.end)
        if self.tilt is not None and self.drop is None:
            raise ArgumentError("--tilt needs --drop: it is the tilt of a falling box")
        _check_interval(self.dt, self.end)
        if self.end / self.dt > MOST_STATES:
            raise ArgumentError(
                f"--t-end {self.end:g} holds more than {MOST_STATES} intervals of --dt {self.dt:g}"
            )

    @property
    def end(self) -> float:
        """End of the simulation [s]."""
        return self.t_end or T_END[self.drop is not None]

    @property
    def parameters(self) -> Parameters:
        """The parameters of the box model."""
        from d2rpick.models.box_model import Parameters

        values = {
            name: getattr(self, name)
            for name in PARAMETERS
            if getattr(self, name) is not None
        }
        return Parameters(
            **(
                {"speed": 0.0, "tilt": TILT, **values}
                if self.drop is not None
                else values
            )
        )

    @property
    def windows(self) -> tuple[BoxWindow, ...]:
        """The windows in which the box is rigid."""
        from d2rpick.models.box_run import BoxWindow

        return tuple(
            BoxWindow(tr, td, self.with_step)
            for tr, td in zip(self.tr, self.td, strict=True)
        )

    def simulated(self, *rigid: BoxWindow) -> Record:
        """Compute the run of the box with these windows."""
        from d2rpick.models.box_run import simulate

        return simulate(self.parameters, self.end, *rigid, interval=self.dt)


def _check_interval(dt: float, t_end: float) -> None:
    """Raise ArgumentError if the output interval is longer than the run, which would give a single state."""
    if dt > t_end:
        raise ArgumentError(
            f"--dt {dt:g} is longer than the run, --t-end {t_end:g}; give a shorter --dt"
        )


def _check_windows(
    starts: Sequence[float], ends: Sequence[float], t_end: float
) -> None:
    """Raise ArgumentError unless the times are ordered pairs within the duration of the run."""
    if len(starts) != len(ends):
        raise ArgumentError("give one --td for each --tr")
    previous_end = None
    for tr, td in zip(starts, ends, strict=True):
        if not tr < td:
            raise ArgumentError(f"--tr {tr:g} is not before --td {td:g}")
        if previous_end is not None and not previous_end < tr:
            raise ArgumentError(
                f"--tr {tr:g} is not after --td {previous_end:g} of the window before it"
            )
        if td > t_end:
            raise ArgumentError(
                f"--td {td:g} lies after the end of the run, --t-end {t_end:g}"
            )
        previous_end = td


class Scanning:
    """A scan over tr: the reference run, the recommendation derived from this run, and the other values of tr."""

    def __init__(self, box: Box) -> None:
        from d2rpick.base.workers import count_cores, start_importing

        start_importing(box.jobs or count_cores(), "d2rpick.models.box_run")
        from d2rpick.choice.answers import suggest_in_history
        from d2rpick.choice.question import Settings
        from d2rpick.models.box_run import find_comparison_end, make_history, scan_times

        self.box, self.td, self.reference = box, next(iter(box.td), TD), box.simulated()
        find_comparison_end(self.reference, self.td)
        times = scan_times(self.reference.released or self.td / 3, self.td)
        self.answer = suggest_in_history(
            make_history(self.reference), self.td, Settings()
        )
        self.cautions = (*warn_if_unbalanced(self.reference), *self.answer.cautions)
        if self.answer.recommended:
            self.times = sorted({*times, self.answer.recommended.tr})
        else:
            self.times = times

    def run(self, told: Callable[[int], None]) -> Scan:
        """Compute the runs of the scan, and call ``told`` with the number of finished runs."""
        from d2rpick.models.box_run import scan
        from d2rpick.report.rollover import Scan

        told(0)
        outcomes = []
        for outcome in scan(
            self.box.parameters, self.reference, self.times, self.td, self.box.jobs
        ):
            outcomes.append(outcome)
            told(len(outcomes))
        return Scan(self.reference, outcomes, self.answer, self.cautions)


def warn_if_unbalanced(record: Record) -> tuple[Caution, ...]:
    """Return a caution if the energy of a run is not balanced, e.g. because of damping over few time steps."""
    imbalance = float(abs(record.imbalance).max())
    if imbalance <= BALANCED:
        return ()
    message = f"the energy is balanced within {imbalance:.2g} of the largest total, but {BALANCED} was expected"
    return (
        Caution(
            "energy-balance",
            f"{message}; choose parameters closer to the defaults",
        ),
    )
