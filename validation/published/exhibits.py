"""Figures of the reproduction: their content, the columns of their curves, and the figures of the oscillator."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import partial
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from validation.published.values import (
    INTEGRATED,
    MODE,
    OSCILLATOR,
    PUBLISHED,
    START,
    TIME,
    compute_deformation,
    compute_residual,
    find_pair_at_peak,
    integrate_replay,
    switch_replay,
)

if TYPE_CHECKING:
    from collections.abc import Mapping

    from d2rpick.histories.history import Samples
    from d2rpick.models.box_model import Plane

# (tr, td) [s] whose responses are superposed: the two of the paper, and two beside them
_PAIRS: Final = ((0.006, 0.040), INTEGRATED, (0.012, 0.080), PUBLISHED)
# Around a switch, so much shows what a solver does there [ms].
_NEAR: Final = 1.2


VERDICTS: Final = ("yes", "in part", "no", "nothing to compare")
YES, IN_PART, NO, NOTHING = VERDICTS


# Word before the list of runs at the end of what an exhibit shows.
RUNS: Final = "Runs:"


class Curve(NamedTuple):
    """Column drawn as "line", "thin" or "dots" over the column ``x`` (default: the first one)."""

    label: str
    column: str
    style: str = "line"
    x: str | None = None


class Shape(NamedTuple):
    """Closed outlines in the plane (outlines, points) [m], drawn as "line" or "thin"."""

    label: str
    outlines: Plane
    style: str = "line"


@dataclass(frozen=True)
class Panel:
    """Curves with horizontal ``levels``, vertical ``marks``, the ``rigid`` window and single ``points`` (x, value).

    ``span`` is the range of x that is shown, all of it without one; ``shapes`` are drawn to scale.
    """

    title: str
    ylabel: str
    curves: tuple[Curve, ...] = ()
    rigid: tuple[float, float] | None = None
    levels: tuple[tuple[str, float], ...] = ()
    marks: tuple[tuple[str, float], ...] = ()
    points: tuple[tuple[float, float], ...] = ()
    shapes: tuple[Shape, ...] = ()
    xlabel: str = "time [ms]"
    span: tuple[float, float] | None = None


@dataclass(frozen=True, eq=False)
class Exhibit:
    """A figure and the columns it shows, the first of them the default x; panels row by row, none for a scheme.

    ``section`` and ``figure`` are those of the paper; ``paper`` is what it shows or claims there, ``found`` what is
    found here, ``agrees`` whether that is the same (None: there is nothing to compare), ``partly`` whether it is so
    only roughly, or only a part of it.
    """

    name: str
    title: str
    section: int
    figure: str
    paper: str
    found: str
    agrees: bool | None = None
    columns: Mapping[str, Samples] = field(default_factory=dict)
    panels: tuple[tuple[Panel, ...], ...] = ()
    partly: bool = False

    @property
    def verdict(self) -> str:
        """The verdict in words: yes, in part, no, or nothing to compare."""
        if self.partly:
            return IN_PART
        return {True: YES, False: NO, None: NOTHING}[self.agrees]


if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from d2rpick.histories.history import Samples

    Tables = Mapping[str, Mapping[str, Samples]]


def list_exhibits(solver: Tables) -> list[tuple[int, Callable[[], Exhibit]]]:
    """List the figures of the oscillator by section, each with the function that computes it.

    ``solver`` holds runs of a solver by name, each a table of columns: "run" of the pair that the paper computed
    (time_s, z_m, y_m, vz_mps, vy_mps), "pairs" of the published and the better pair (time_s, reference_m, published_m,
    better_m).
    """
    figures: list[tuple[int, Callable[[], Exhibit]]] = [
        (
            2,
            partial(
                _make_scheme,
                "masses",
                "The floating oscillator",
                2,
                "3",
                "Two masses, a spring, dampers, no support.",
            ),
        ),
        (2, _make_response_exhibit),
        (
            3,
            partial(
                _make_scheme,
                "elements",
                "Its finite element model",
                3,
                "5",
                "The oscillator in finite elements.",
            ),
        ),
        (3, partial(_make_motion_exhibit, solver.get("run"))),
        (4, _make_level_exhibit),
        (4, _make_after_td_exhibit),
    ]
    return (
        [*figures, (4, partial(_make_solver_exhibit, solver["pairs"]))]
        if "pairs" in solver
        else figures
    )


def _make_scheme(
    name: str, title: str, section: int, figure: str, paper: str
) -> Exhibit:
    return Exhibit(name, title, section, figure, paper, "Redrawn.")


def _name_pair(pair: Sequence[float]) -> str:
    return "tr = {:.4g}, td = {:.4g} ms".format(*(1e3 * time for time in pair))


def _find_rigid_span(pair: tuple[float, float]) -> tuple[float, float]:
    return 1e3 * pair[0], 1e3 * pair[1]


def _make_response_exhibit() -> Exhibit:
    """Return the response of the suspended mass for several pairs, with the reference."""
    columns = {"time_ms": 1e3 * TIME, "y_free_m": OSCILLATOR.free(START, TIME).y}
    curves, errors = [Curve("without switching", "y_free_m")], []
    for pair in _PAIRS:
        key = f"{1e3 * pair[0]:g}_{1e3 * pair[1]:g}"
        columns[f"y_{key}_m"] = switch_replay(pair).motion(TIME).y
        columns[f"error_{key}_m"] = columns[f"y_{key}_m"] - columns["y_free_m"]
        curves.append(Curve(f"({1e3 * pair[0]:g}, {1e3 * pair[1]:g}) ms", f"y_{key}_m"))
        errors.append(
            Curve(f"({1e3 * pair[0]:g}, {1e3 * pair[1]:g}) ms", f"error_{key}_m")
        )
    panels = (
        (Panel("response of the suspended mass", "y [m]", tuple(curves)),),
        (
            Panel(
                "less that without switching",
                "difference [m]",
                (Curve("", "zero_m"), *errors),
            ),
        ),
    )
    return Exhibit(
        "response", "Response for several switch times", 2, "4",
        "The response y of the switched oscillator for several pairs (tr, td), over each other, against the reference.",
        "The same curves. The pairs differ in the vibration that returns after td; while the parts are rigid, all "
        "pairs follow the mean motion.",
        True, columns | {"zero_m": 0 * TIME}, panels,
    )  # fmt: skip


def _make_motion_exhibit(run: Mapping[str, Samples] | None) -> Exhibit:
    """Return displacements and velocities in closed form, beside a solver's run or else numerical integration."""
    replay = switch_replay(INTEGRATED)
    time = TIME if run is None else run["time_s"]
    closed = replay.motion(time)
    other_columns = integrate_replay(replay, time) if run is None else [run[f"{name}_m"] for name in "zy"] + [
        run[f"v{name}_mps"] for name in "zy"
    ]  # fmt: skip
    method = "integrated" if run is None else "finite elements"
    columns = {"time_ms": 1e3 * time}
    for name, unit, ours, theirs in zip(
        ("z", "y", "vz", "vy"),
        ("m", "m", "mps", "mps"),
        closed,
        other_columns,
        strict=True,
    ):
        columns |= {
            f"{name}_closed_{unit}": ours,
            f"{name}_other_{unit}": np.asarray(theirs),
        }
    rigid = _find_rigid_span(INTEGRATED)

    def panel(
        title: str,
        unit: str,
        ylabel: str,
        names: Sequence[str],
        span: tuple[float, float] | None,
    ) -> Panel:
        lines = [
            Curve(f"{name}, closed form", f"{name}_closed_{unit}") for name in names
        ]
        dots = [
            Curve(f"{name}, {method}", f"{name}_other_{unit}", "dots") for name in names
        ]
        return Panel(title, ylabel, (*lines, *dots), rigid, span=span)

    velocities = [
        panel(title, "mps", "velocity [m/s]", ("vz", "vy"), span)
        for title, span in (
            ("velocities", None),
            ("at tr", (rigid[0] - _NEAR, rigid[0] + _NEAR)),
            ("at td", (rigid[1] - _NEAR, rigid[1] + _NEAR)),
        )
    ]
    whole = panel(
        f"displacements, {_name_pair(INTEGRATED)}",
        "m",
        "displacement [m]",
        ("z", "y"),
        None,
    )
    largest = max(
        float(np.abs(columns[f"{name}_other_m"] - columns[f"{name}_closed_m"]).max()) for name in "zy"
    ) / float(np.abs(closed.z).max())  # fmt: skip
    return Exhibit(
        "motion", f"Closed form and {method}", 3, "6a-d",
        "Displacements and velocities for (6, 80) ms, analytical and by explicit finite elements, with the solver's "
        "transients at the switches.",
        f"Displacements agree within {largest:.1g} of the largest. Velocities jump at tr to their common value; "
        "a solver takes one step for that, and its output shows the last state before it. At td nothing jumps: the "
        "spring alone accelerates the masses.",
        largest < 1e-2, columns, ((whole, velocities[0]), (velocities[1], velocities[2])),
    )  # fmt: skip


def _make_level_exhibit() -> Exhibit:
    """Return the energy with its level at td, all crossings, and tr as read off and as computed."""
    td = PUBLISHED[1]
    level = float(MODE.energy(td))
    crossings = sorted(
        time
        for sign in (1.0, -1.0)
        for time in MODE.crossings(sign * float(MODE.deformation(td)), 0.0, td)
        if time < td * (1 - 1e-9)
    )
    exact = MODE.crossings(float(MODE.deformation(td)), 0.0, td)[0]
    curve = (Curve("internal energy", "energy_J"),)
    points = tuple((1e3 * time, level) for time in (*crossings, td))
    levels = ((f"level at 64 ms, {level:.4g} J", level),)
    marks = ((f"{1e3 * exact:.3f} ms", 1e3 * exact), ("13 ms", 13.0))
    panels = (
        (
            Panel(
                "crossings of the level",
                "energy [J]",
                curve,
                None,
                levels,
                points=points,
                span=(0.0, 70.0),
            ),
            Panel(
                "tr as read and as computed",
                "energy [J]",
                curve,
                None,
                levels,
                marks,
                points,
                span=(12.0, 13.6),
            ),
        ),
    )
    return Exhibit(
        "level", "Energy level at td and its crossings", 4, "7a",
        "The level of the internal energy at td = 64 ms, and tr = 13 ms read from it.",
        f"The level, {level:.4g} J, is crossed {len(crossings)} times before td. The crossing with the sign of the "
        f"deformation at td lies at {1e3 * exact:.3f} ms; at 13 ms the energy is already "
        f"{float(MODE.energy(0.013)):.4g} J.",
        True, {"time_ms": 1e3 * TIME, "energy_J": MODE.energy(TIME)}, panels,
    )  # fmt: skip


def _make_after_td_exhibit() -> Exhibit:
    """Return the response after td for the published pair and the better one, compared with the reference."""
    columns: dict[str, Samples] = {
        "time_ms": 1e3 * TIME,
        "y_free_m": OSCILLATOR.free(START, TIME).y,
    }
    panels = []
    for name, pair in (("published", PUBLISHED), ("better", find_pair_at_peak())):
        columns[f"y_{name}_m"] = switch_replay(pair).motion(TIME).y
        columns[f"r_{name}_m"] = compute_deformation(switch_replay(pair).motion(TIME))
        motion = (
            Curve("without switching", "y_free_m"),
            Curve("switched", f"y_{name}_m"),
        )
        vibration = (
            Curve("without switching", "r_free_m"),
            Curve("switched", f"r_{name}_m"),
        )
        limits = (10.0, 150.0)
        panels.append((
            Panel(f"{name} pair: {_name_pair(pair)}", "y [m]", motion, _find_rigid_span(pair), span=limits),
            Panel(f"residual R = {compute_residual(pair):.3f}", "deformation y - z [m]", vibration,
                  _find_rigid_span(pair), span=limits),
        ))  # fmt: skip
    columns["r_free_m"] = compute_deformation(OSCILLATOR.free(START, TIME))
    return Exhibit(
        "after-td", "Response after td", 4, "7b",
        "After td the response y for (13, 64) ms agrees well with the reference.",
        f"It does not: R = {compute_residual(PUBLISHED):.3f}. At 64 ms 92 % of the energy of the vibration is kinetic "
        "and so is lost, whatever tr. The mean motion agrees, the vibration does not. 4.8 ms later, at the next "
        "peak of the energy, the switched run goes on as the reference does.",
        False, columns, tuple(panels),
    )  # fmt: skip


def _make_solver_exhibit(solver: Mapping[str, Samples]) -> Exhibit:
    """Return the deformation of explicit finite element runs beside the closed form."""
    time = solver["time_s"]
    columns = {"time_ms": 1e3 * time, "reference_solver_m": solver["reference_m"]}
    panels = []
    for name, pair in (("published", PUBLISHED), ("better", find_pair_at_peak())):
        columns |= {
            f"{name}_solver_m": solver[f"{name}_m"],
            f"{name}_m": compute_deformation(switch_replay(pair).motion(time)),
        }
        curves = (
            Curve("without switching, solver", "reference_solver_m", "thin"),
            Curve("switched, closed form", f"{name}_m"), Curve("switched, solver", f"{name}_solver_m", "dots"),
        )  # fmt: skip
        panels.append(
            (
                Panel(
                    f"{name} pair: {_name_pair(pair)}",
                    "deformation y - z [m]",
                    curves,
                    _find_rigid_span(pair),
                ),
            )
        )
    return Exhibit(
        "solver", "Both pairs by an explicit solver", 4, "7b",
        "Not shown for finite elements.",
        "The solver confirms both: 89 % error of the vibration after td for the published pair, 0.5 % for the better "
        "one.",
        None, columns, tuple(panels),
    )  # fmt: skip
