"""The figures of the reproduction: which curves they show, and the columns that hold them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, NamedTuple

from d2rpick.models.published import (
    INTEGRATED,
    MODE,
    OSCILLATOR,
    PUBLISHED,
    START,
    TIME,
    better_pair,
    deformation_of,
    residual,
    switched,
)
from d2rpick.vibration.integration import integrated

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from d2rpick.histories.history import Samples

# (tr, td) [s] of the displacements: the two of the paper, and one beside each
_PAIRS: Final = ((0.006, 0.040), INTEGRATED, (0.012, 0.080), PUBLISHED)


class Curve(NamedTuple):
    """A column of an exhibit as it is drawn: "line", "thin" or "dots"."""

    label: str
    column: str
    style: str = "line"


@dataclass(frozen=True)
class Panel:
    """Curves over time with horizontal ``levels``, the ``rigid`` window [ms] and single ``points`` (time, value)."""

    title: str
    ylabel: str
    curves: tuple[Curve, ...]
    rigid: tuple[float, float] | None = None
    levels: tuple[tuple[str, float], ...] = ()
    points: tuple[tuple[float, float], ...] = ()


@dataclass(frozen=True, eq=False)
class Exhibit:
    """A figure and the columns it shows, the first of them the time [ms]; panels row by row."""

    name: str
    title: str
    columns: Mapping[str, Samples]
    panels: tuple[tuple[Panel, ...], ...]


def exhibits(solver: Mapping[str, Samples] | None = None) -> tuple[Exhibit, ...]:
    """All figures; the last one only with a solver's run: columns time_s, reference_m, published_m, better_m."""
    drawn = (_displacement(), _integration(), _choice())
    return (*drawn, _beside_solver(solver)) if solver else drawn


def _named(pair: Sequence[float]) -> str:
    return "tr = {:.4g}, td = {:.4g} ms".format(*(1e3 * time for time in pair))


def _rigid(pair: tuple[float, float]) -> tuple[float, float]:
    return 1e3 * pair[0], 1e3 * pair[1]


def _displacement() -> Exhibit:
    """Displacements of both masses for several pairs, each beside those without switching."""
    free = OSCILLATOR.free(START, TIME)
    columns = {"time_ms": 1e3 * TIME, "z_free_m": free.z, "y_free_m": free.y}
    panels = []
    for pair in _PAIRS:
        state = switched(pair).motion(TIME)
        key = f"{1e3 * pair[0]:g}_{1e3 * pair[1]:g}"
        columns |= {f"z_{key}_m": state.z, f"y_{key}_m": state.y}
        curves = (
            Curve("z, frame", f"z_{key}_m"), Curve("y, suspended mass", f"y_{key}_m"),
            Curve("z without switching", "z_free_m", "thin"), Curve("y without switching", "y_free_m", "thin"),
        )  # fmt: skip
        panels.append(Panel(_named(pair), "displacement [m]", curves, _rigid(pair)))
    grid = (tuple(panels[:2]), tuple(panels[2:]))
    return Exhibit("displacement", "Displacement for several switch times", columns, grid)


def _integration() -> Exhibit:
    """Closed form against numerical integration."""
    replay = switched(INTEGRATED)
    closed, steps = replay.motion(TIME), integrated(replay, TIME)
    columns = {
        "time_ms": 1e3 * TIME, "z_closed_m": closed.z, "y_closed_m": closed.y, "z_integrated_m": steps.z,
        "y_integrated_m": steps.y, "z_difference_m": steps.z - closed.z, "y_difference_m": steps.y - closed.y,
    }  # fmt: skip
    motion = (
        Curve("z, closed form", "z_closed_m"), Curve("y, closed form", "y_closed_m"),
        Curve("z, integrated", "z_integrated_m", "dots"), Curve("y, integrated", "y_integrated_m", "dots"),
    )  # fmt: skip
    error = (Curve("z", "z_difference_m"), Curve("y", "y_difference_m"))
    panels = (
        (Panel(_named(INTEGRATED), "displacement [m]", motion, _rigid(INTEGRATED)),),
        (Panel("", "integrated - closed form [m]", error, _rigid(INTEGRATED)),),
    )
    return Exhibit("integration", "Closed form and numerical integration", columns, panels)


def _choice() -> Exhibit:
    """Energy with its level at td and the resulting motion: the published pair and, beside it, the better one."""
    free = OSCILLATOR.free(START, TIME)
    columns = {"time_ms": 1e3 * TIME, "energy_J": MODE.energy(TIME), "deformation_free_m": deformation_of(free)}
    energies, motions = [], []
    for name, pair in (("published", PUBLISHED), ("better", better_pair())):
        columns[f"deformation_{name}_m"] = deformation_of(switched(pair).motion(TIME))
        level = float(MODE.energy(pair[1]))
        marks = tuple((1e3 * t, float(MODE.energy(t))) for t in pair)
        title = f"{name} pair: {_named(pair)}"
        curve = (Curve("internal energy", "energy_J"),)
        energies.append(Panel(title, "energy [J]", curve, _rigid(pair), ((f"E(td) = {level:.4g} J", level),), marks))
        curves = (Curve("without switching", "deformation_free_m"), Curve("switched", f"deformation_{name}_m"))
        motions.append(Panel(f"R = {residual(pair):.3f}", "deformation y - z [m]", curves, _rigid(pair)))
    return Exhibit("choice", "Energy level and the motion that follows", columns, (tuple(energies), tuple(motions)))


def _beside_solver(solver: Mapping[str, Samples]) -> Exhibit:
    """The deformation of an explicit finite element run beside the closed form."""
    time = solver["time_s"]
    columns = {"time_ms": 1e3 * time, "reference_solver_m": solver["reference_m"]}
    panels = []
    for name, pair in (("published", PUBLISHED), ("better", better_pair())):
        columns |= {f"{name}_solver_m": solver[f"{name}_m"], f"{name}_m": deformation_of(switched(pair).motion(time))}
        curves = (
            Curve("without switching, solver", "reference_solver_m", "thin"),
            Curve("switched, closed form", f"{name}_m"), Curve("switched, solver", f"{name}_solver_m", "dots"),
        )  # fmt: skip
        panels.append((Panel(f"{name} pair: {_named(pair)}", "deformation y - z [m]", curves, _rigid(pair)),))
    return Exhibit("solver", "Closed form and an explicit solver", columns, tuple(panels))
