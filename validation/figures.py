"""Draw the figures of docs/explanation/validation.md from the results: ``python -m validation.figures``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from matplotlib.figure import Figure

from d2rpick.report.figures import FLIGHT, GOOD, REFERENCE, SWITCHED, render

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from matplotlib.axes import Axes
    from numpy.typing import NDArray

RESULTS: Final = Path(__file__).parent / "results"
PLACE: Final = Path(__file__).resolve().parents[1] / "docs/explanation/validation"
# Deviations after td of the oscillator's four runs: (tr, td) [ms], computed.
_PAIRS: Final = (
    ("6, 80", 5.64),
    ("13, 64", 0.888),
    ("12.89, 64", 0.901),
    ("13.587, 68.753", 0.005),
)
# Windows of the falling box whose contacts are compared, and what they are called.
_DROPS: Final = {
    "drop2_pert": "not switched, start changed by 1e-6", "drop2_null1": "rigid for 0.1 ms",
    "drop2_w1": "first fall", "drop2_w2": "second flight", "drop2_w123": "three flights planned at once",
}  # fmt: skip
# Cases whose vibration after td is compared node by node, and the parts that absorb their landing.
_VIBRATING: Final = {
    "ROLL": "shell box", "FRAME": "frame, 5 m/s", "FRAME-FAST": "frame, 10 m/s", "FRAME-SLOW": "frame, 2.5 m/s",
    "CAR": "car",
}  # fmt: skip
_ABSORBS: Final = 0.05  # least share of the rise of the total energy in a part whose energy is compared


def read_results(name: str) -> NDArray[Any]:
    """Read a table of results; empty cells are NaN."""
    return np.genfromtxt(
        RESULTS / f"{name}.csv", delimiter=",", names=True, dtype=None, encoding="utf-8"
    )


def draw_oscillators() -> Figure:
    """Draw predicted residuals beside those of the solver, for one and for two modes."""
    figure = Figure(figsize=(10, 4.2), layout="constrained")
    left_axes, right_axes = figure.subplots(1, 2)
    left_axes.bar(
        [name for name, _ in _PAIRS],
        [error for _, error in _PAIRS],
        color=REFERENCE,
        width=0.5,
    )
    left_axes.set(
        yscale="log",
        ylim=(1e-3, 10),
        ylabel="largest deviation after td [-]",
        xlabel="tr, td [ms]",
    )
    left_axes.set_title("oscillator: vibration after td, OpenRadioss", fontsize="small")
    rows = read_results("chain_scan")
    right_axes.plot([0, 2.2], [0, 2.2], color=FLIGHT, linewidth=1)
    single = read_results("oscillators_scan")
    right_axes.plot(
        rows["R_theory"],
        rows["R_sim"],
        ".",
        color=REFERENCE,
        label=f"two modes, {rows.size} switched runs",
    )
    right_axes.plot(
        single["R_theory"],
        single["R_sim"],
        "o",
        color=SWITCHED,
        label=f"one mode, {single.size} switched runs",
    )
    right_axes.legend(fontsize="x-small")
    right_axes.set(xlabel="residual predicted [-]", ylabel="residual computed [-]")
    right_axes.set_title(
        "chain of two springs, and three oscillators", fontsize="small"
    )
    return _finish_figure(figure)


def draw_rollover() -> Figure:
    """Draw roll at td and mean energy after td of the shell box against tr."""
    rows = np.sort(read_results("rollover_scan"), order="tr_s")
    tr = 1e3 * rows["tr_s"]
    figure = Figure(figsize=(10, 4.2), layout="constrained")
    left_axes, right_axes = figure.subplots(1, 2)
    left_axes.plot(
        tr, np.abs(rows["droll_td_deg"]), ".-", color=REFERENCE, linewidth=0.8
    )
    left_axes.set(yscale="log", ylabel="|roll error| at td [degrees]")
    right_axes.plot(
        tr,
        rows["IEmean_td_to_380ms_J"] / rows["IEmean_ref_J"],
        ".-",
        color=REFERENCE,
        linewidth=0.8,
    )
    right_axes.axhline(1.0, color=SWITCHED, linewidth=0.8)
    right_axes.set(ylabel="mean energy after td, over the reference")
    for axes in (left_axes, right_axes):
        axes.axvspan(0, 91.0, color=SWITCHED, alpha=0.1, linewidth=0, label="trip")
        axes.axvline(
            92.46, color=GOOD, linestyle="--", linewidth=1, label="recommended tr"
        )
        axes.set_xlabel("tr [ms]")
        axes.legend(fontsize="x-small")
    return _finish_figure(figure)


def draw_car() -> Figure:
    """Draw angle at td and mean energy of the car, against tr and against the level."""
    rows = read_results("car_runs")
    rows = np.sort(rows[np.char.startswith(rows["run"], "car_a")], order="tr_s")
    tr = 1e3 * rows["tr_s"]
    flying = tr > 38.5
    figure = Figure(figsize=(10, 4.2), layout="constrained")
    left_axes, right_axes = figure.subplots(1, 2)
    left_axes.plot(tr, rows["dangle_td_deg"], ".-", color=REFERENCE, linewidth=0.8)
    for span_index, (start, end) in enumerate(((2.3, 11.8), (28.1, 38.5))):
        left_axes.axvspan(
            start,
            end,
            color=SWITCHED,
            alpha=0.1,
            linewidth=0,
            label="_" if span_index else "contact",
        )
    left_axes.axvline(
        38.05, color=GOOD, linestyle="--", linewidth=1, label="recommended tr"
    )
    left_axes.set(
        yscale="log",
        xlabel="tr [ms]",
        ylabel="angle between the two bodies at td [degrees]",
    )
    left_axes.legend(fontsize="x-small")
    level = rows["E_tr_J"] / rows["E_td_ref_J"]
    for chosen_rows, colour, name in (
        (flying, REFERENCE, "in flight"),
        (~flying, SWITCHED, "during the load"),
    ):
        right_axes.plot(
            level[chosen_rows],
            rows["meanIE_td_landing_ratio"][chosen_rows],
            ".",
            color=colour,
            label=name,
        )
    right_axes.set(
        xlabel="E(tr)/E(td)", ylabel="mean energy until the landing, over the reference"
    )
    right_axes.legend(fontsize="x-small")
    return _finish_figure(figure)


def drop() -> Figure:
    """Draw how far the contacts of the falling box move, for each run."""
    rows = read_results("drop2_runs")
    figure = Figure(figsize=(10, 4.2), layout="constrained")
    axes = figure.subplots()
    numbers = np.arange(1, 8)
    colours = (REFERENCE, FLIGHT, GOOD, SWITCHED, "#cc79a7")
    for (run, name), colour in zip(_DROPS.items(), colours, strict=True):
        (row,) = rows[rows["run"] == run]
        axes.plot(
            numbers,
            [row[f"dland{n}_ms"] for n in numbers],
            ".-",
            color=colour,
            linewidth=0.8,
            label=name,
        )
    axes.set(xlabel="contact", ylabel="contact comes later by [ms]")
    axes.legend(fontsize="x-small")
    return _finish_figure(figure)


def find_absorbing_parts(rows: NDArray[Any]) -> NDArray[np.bool_]:
    """Return which rows of the vibration table are parts that absorb a relevant share of the landing energy."""
    total = {row["case"]: row["rise_J"] for row in rows if row["energy"] == "total"}
    shares = rows["rise_J"] / [total[case] for case in rows["case"]]
    return np.asarray((rows["energy"] != "total") & (shares >= _ABSORBS))


def draw_vibration() -> Figure:
    """Draw residuals of all nodes against predicted ones, and differences after the landing against their estimate."""
    rows = read_results("vibration")
    switched = rows[~np.isnan(rows["tr_s"])]
    absorbing = find_absorbing_parts(switched)
    figure = Figure(figsize=(10, 4.2), layout="constrained")
    left_axes, right_axes = figure.subplots(1, 2)
    left_axes.plot([0, 2], [0, 2], color=FLIGHT, linewidth=1)
    right_axes.axvline(
        0.01, color="grey", linestyle="--", linewidth=1, label="1 % and 5 %"
    )
    right_axes.axvline(0.05, color="grey", linestyle="--", linewidth=1)
    for (case, name), colour in zip(
        _VIBRATING.items(), (REFERENCE, FLIGHT, SWITCHED, "#cc79a7", GOOD), strict=True
    ):
        own_rows = switched[switched["case"] == case]
        whole = own_rows[own_rows["energy"] == "total"]
        if not np.isnan(whole["R_predicted"]).all():
            left_axes.plot(
                whole["R_predicted"],
                whole["R_nodes"],
                "o",
                color=colour,
                markersize=4,
                label=name,
            )
        right_axes.plot(
            whole["worth"], whole["rms"], "o", color=colour, markersize=4, label=name
        )
        parts = switched[absorbing & (switched["case"] == case)]
        right_axes.plot(
            parts["worth"], parts["rms"], "x", color=colour, markersize=4, label="_"
        )
    left_axes.set(
        xlabel="residual predicted by the reference [-]",
        ylabel="residual of all nodes [-]",
    )
    right_axes.set(
        xscale="log", yscale="log", xlabel="worth of the vibration error [-]"
    )
    right_axes.set_ylabel("energy after the landing off by, of its rise [-]")
    right_axes.set_title("dots: all parts, crosses: single parts", fontsize="small")
    left_axes.legend(fontsize="x-small")
    right_axes.legend(fontsize="x-small")
    return _finish_figure(figure)


FIGURES: Final[Mapping[str, Callable[[], Figure]]] = {
    "oscillators": draw_oscillators, "rollover": draw_rollover, "car": draw_car, "drop": drop,
    "vibration": draw_vibration,
}  # fmt: skip


def _finish_figure(figure: Figure) -> Figure:
    for axes in figure.axes:
        _show_grid(axes)
    return figure


def _show_grid(axes: Axes) -> None:
    axes.grid(visible=True, linewidth=0.3)
    axes.set_axisbelow(True)


def main() -> None:
    """Draw all figures."""
    PLACE.mkdir(parents=True, exist_ok=True)
    for name, draw in FIGURES.items():
        (PLACE / f"{name}.png").write_bytes(render(draw(), f"{name}.png"))


if __name__ == "__main__":
    main()
