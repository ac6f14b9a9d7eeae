"""The oscillator results of "Analysis of switched-rigid floating oscillator" (Shock and Vibration), computed anew.

In the paper's units, seconds and metres; the table shows milliseconds.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from d2rpick.vibration import measures
from d2rpick.vibration.oscillator import Oscillator, Replay, State, to_mode

if TYPE_CHECKING:
    from collections.abc import Iterator

    from d2rpick.histories.history import Samples

OSCILLATOR: Final = Oscillator(stiffness=660e3, mass=31.4, frame_mass=15.7, alpha=50.0)
V0: Final = 6.0
START: Final = State.of(0.0, 0.0, V0, 0.0)
MODE: Final = to_mode(OSCILLATOR, V0)
END: Final = 0.15
TIME: Final = np.round(1e-4 * np.arange(1501), 4)

# (tr, td) [s]: what the paper integrates numerically, and what it reads off its plot
INTEGRATED, PUBLISHED = (0.006, 0.080), (0.013, 0.064)

MISPRINTS: Final = (
    "(6): with its minus sign B2 must be +V0/(omega_2 (1 + beta))",
    "(14): x is missing after (1 + beta) k/M",
    "(14): F0 acts with the sign that gives x = -Delta/(1 + beta) [...], as (18) has it and (17) has not",
    "(15)-(17): time is measured from td",
)

_EXACT = "matrix exponential of the first-order system, 40 digits"
_SOLVER = "OpenRadioss, same motion"
# Section and figure of the paper to which a value belongs.
_FREE, _RIGID, _LEVEL, _AFTER = (2, "4"), (3, "6a-d"), (4, "7a"), (4, "7b")
# Relative agreement of what rests on closed forms on both sides, to the digits that are quoted.
MOST_DIFFERENCE: Final = 1e-9
# What a solver gives differs from the closed form by its one-step lag and the mass of its spring [-].
_SOLVER_DIFFERENCE: Final = 0.006

# z [m], y [m], E [J] at times [s] of the switched runs
_STATES: Final = {
    INTEGRATED: (
        (0.006, 0.02411074833512, 0.003495532591536, 140.245749651),
        (0.012, 0.03179101171863, 0.01117579597504, 140.245749651),
        (0.064, 0.05211298900326, 0.03149777325967, 140.245749651),
        (0.080, 0.05301085160684, 0.03239563586326, 140.245749651),
        (0.100, 0.04127297724204, 0.03895923455904, 1.766623717034),
        (0.150, 0.04024623325594, 0.03984369830982, 0.05347134633845),
    ),
    PUBLISHED: (
        (0.040, 0.03335536800817, 0.03520219900172, 1.125558957182),
        (0.064, 0.0371382911785, 0.03898512217205, 1.125558957182),
        (0.080, 0.0398705626157, 0.03896578035883, 0.270148207674),
        (0.100, 0.04016469900114, 0.03951337367949, 0.1399941426274),
        (0.150, 0.04009663037928, 0.03991849974815, 0.01047107217665),
    ),
}
# Of each step, relative and absolute: far below what a figure shows, far above rounding.
_RELATIVE, _ABSOLUTE = 1e-11, 1e-14


@dataclass(frozen=True)
class PublishedValue:
    """Number of the paper, or an independent reference value, beside the computed one.

    ``published`` is the number that the paper states, None where it states none; ``reference`` one that was computed
    in another way, see ``source``; ``tolerance`` is how far the number here may be off [unit]; ``place`` is the
    section and the figure of the paper.
    """

    what: str
    unit: str
    published: float | None
    reference: float | None
    here: float
    tolerance: float
    source: str
    place: tuple[int, str]

    @property
    def section(self) -> int:
        """Section of the paper."""
        return self.place[0]

    @property
    def figure(self) -> str:
        """Number of the figure in the paper."""
        return self.place[1]

    @property
    def expected(self) -> float:
        """The published number if there is one, else the reference value; one of them must be given."""
        expected = self.reference if self.published is None else self.published
        assert expected is not None
        return expected

    @property
    def difference(self) -> float:
        """Computed less expected value, in ``unit``."""
        return self.here - self.expected

    @property
    def agrees(self) -> bool:
        """True if the difference is within the tolerance."""
        return abs(self.difference) <= self.tolerance


def _make_exact(
    quantity: str, unit: str, reference: float, our_value: float, place: tuple[int, str]
) -> PublishedValue:
    tolerance = MOST_DIFFERENCE * abs(reference)
    return PublishedValue(
        quantity, unit, None, reference, our_value, tolerance, _EXACT, place
    )


def find_pair_at_peak() -> tuple[float, float]:
    """Return the better pair: td at the first energy peak after 64 ms, tr where the deformation matches [s]."""
    td = MODE.peaks(PUBLISHED[1], END)[0]
    return _find_matching(td), td


def make_values_table() -> tuple[PublishedValue, ...]:
    """Return the numbers of the paper and reference values beside computed ones."""
    return tuple(_make_rows())


def compute_deviation(pair: tuple[float, float]) -> float:
    """Return the largest error of the deformation after td over the largest deformation of the reference there [-]."""
    times_after_td = TIME[pair[1] <= TIME]
    replay = switch_replay(pair)
    wanted, deformation = (
        compute_deformation(replay.reference(times_after_td)),
        compute_deformation(replay.motion(times_after_td)),
    )
    return float(np.abs(deformation - wanted).max() / np.abs(wanted).max())


def compute_residual(pair: tuple[float, float]) -> float:
    """Return R of a pair [-]."""
    return switch_replay(pair).residual()


def _make_rows() -> Iterator[PublishedValue]:
    td, better = PUBLISHED[1], find_pair_at_peak()
    yield _make_exact("omega_2", "rad/s", 249.86461302226118, OSCILLATOR.omega_2, _FREE)
    yield from _make_state_rows(INTEGRATED, _RIGID)
    yield PublishedValue(
        "tr with the energy of td = 64 ms", "ms", 13.0, None, 1e3 * _find_matching(td), 0.5,
        "the paper, read from its plot to a millisecond", _LEVEL,
    )  # fmt: skip
    yield _make_exact(
        "the same, sign matched",
        "ms",
        12.8852793630525,
        1e3 * _find_matching(td),
        _LEVEL,
    )
    yield _make_exact(
        "E(64 ms)", "J", 0.606348787620396, float(MODE.energy(td)), _LEVEL
    )
    share = float(measures.kinetic_share(MODE, td))
    yield _make_exact("kinetic fraction at 64 ms", "-", 0.916699887073, share, _AFTER)
    yield _make_exact(
        "energy peak after 64 ms", "ms", 68.7533824301571, 1e3 * better[1], _AFTER
    )
    yield _make_exact(
        "tr for that peak", "ms", 13.5866683619825, 1e3 * better[0], _AFTER
    )
    # The deviations decide, so they come before the states from which they follow.
    for name, pair, found in (
        ("(13, 64) ms", PUBLISHED, 0.888),
        ("better pair", better, 0.005),
    ):
        yield PublishedValue(
            f"deviation after td, {name}", "-", None, found, compute_deviation(pair),
            _SOLVER_DIFFERENCE, _SOLVER, _AFTER,
        )  # fmt: skip
    yield from _make_state_rows(PUBLISHED, _AFTER)


def _make_state_rows(
    pair: tuple[float, float], place: tuple[int, str]
) -> Iterator[PublishedValue]:
    """Displacements and energy of a switched run."""
    for time, z, y, energy in _STATES[pair]:
        state = switch_replay(pair).motion(time)
        name = f"({1e3 * pair[0]:g}, {1e3 * pair[1]:g}) ms at {1e3 * time:g} ms"
        energy_here = float(OSCILLATOR.internal_energy(state))
        yield _make_exact(f"z of {name}", "m", z, float(state.z), place)
        yield _make_exact(f"y of {name}", "m", y, float(state.y), place)
        yield _make_exact(f"E of {name}", "J", energy, energy_here, place)


def _find_matching(td: float) -> float:
    """Return the first time with the deformation of ``td``, sign included [s]."""
    return MODE.crossings(float(MODE.deformation(td)), 0.0, td)[0]


def switch_replay(pair: tuple[float, float]) -> Replay:
    """Return the run that is rigid between these times [s]."""
    return Replay(OSCILLATOR, START, 0.0, *pair)


def compute_deformation(state: State) -> Samples:
    """Return the deformation of the spring, y - z [m]."""
    return np.asarray(state.y - state.z)


def integrate_replay(switched: Replay, time: Samples) -> State:
    """Integrate the equations of motion (1) through a switched run and return its states at ``time``.

    Free up to tr; rigid up to td, when both masses have the velocity that keeps the momentum and only damping acts;
    then free again from what that leaves.  An explicit Runge-Kutta method of order 8 (scipy's DOP853) knows nothing of
    the closed forms.

    Parameters
    ----------
    switched : Replay
        Oscillator, start and switch times.
    time : array of shape (n,)
        Ascending, from the start on [time].

    Returns
    -------
    State
        Arrays of shape (n,); at tr and td the state before the switch.
    """
    from scipy.integrate import solve_ivp

    o = switched.oscillator
    masses = np.array([o.frame_mass, o.mass])

    def free(_: float, x: Samples) -> Samples:
        force = o.stiffness * (x[1] - x[0])
        return np.concatenate(
            [x[2:], np.array([force, -force]) / masses - o.alpha * x[2:]]
        )

    def rigid(_: float, x: Samples) -> Samples:
        return np.concatenate([x[2:], -o.alpha * x[2:]])

    x = np.array(switched.start, dtype=np.float64)
    states = np.empty((4, time.size))
    bounds = (
        switched.origin,
        switched.tr,
        switched.td,
        max(switched.td, float(time[-1])),
    )
    for phase, (motion, start, end) in enumerate(
        zip((free, rigid, free), bounds, bounds[1:], strict=False)
    ):
        if phase == 1:
            x[2:] = masses @ x[2:] / masses.sum()  # (8)
        steps = solve_ivp(
            motion,
            (start, end),
            x,
            "DOP853",
            dense_output=True,
            rtol=_RELATIVE,
            atol=_ABSOLUTE,
        )
        inside = (time >= start) & (time <= end)
        if inside.any():
            states[:, inside] = steps.sol(time[inside])
        x = steps.y[:, -1]
    return State(*states)
