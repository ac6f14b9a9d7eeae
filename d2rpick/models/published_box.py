"""The box's figures of the reproduction: what a tr too early does, the revised pair, and variants of one run."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache, partial
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from d2rpick.models.exhibit import Curve, Exhibit, Panel, Shape
from d2rpick.models.rollover.as_history import suggestion_for
from d2rpick.models.rollover.record import BOX
from d2rpick.models.rollover.run import RigidWindow, simulate
from d2rpick.models.rollover.scan import compare

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from d2rpick.histories.history import Samples
    from d2rpick.models.rollover.model import Parameters, Plane
    from d2rpick.models.rollover.record import Record

TD: Final = 0.37
_END: Final = 0.42
# tr [s]: the paper's two, one with too little and one with too much energy, all in the trip of this box.
_EARLY, _REVISED, _LITTLE, _MUCH = 0.001, 0.070, 0.020, 0.068
_OUTLINES: Final = 8
# td of the variants is so long before the first landing [s], as in the paper.
_BEFORE_LANDING: Final = 0.010


class Variant(NamedTuple):
    """A change of one parameter, and whether it acts before td."""

    name: str
    parameters: Parameters
    before: bool


class Tried(NamedTuple):
    """A variant at its own tr and at the common one [s].

    ``level_error`` [-] and ``roll_error`` at td [degrees] are those at the common tr, ``end_error`` the roll at the end
    of the run, after the landing [degrees].
    """

    variant: Variant
    own_tr: float | None
    level_error: float
    roll_error: float
    end_error: float


@lru_cache(maxsize=64)
def _run(parameters: Parameters, *windows: RigidWindow) -> Record:
    return simulate(parameters, _END, *windows)


def _setting(_: Parameters) -> Exhibit:
    return Exhibit(
        "box", "Box on a sled that meets a curb", 1, "1", "A box on a decelerating sled, tripped by a curb.",
        "Drawn from the model: a narrow box on the tilted floor of a standard dolly.",
    )  # fmt: skip


def _early(base: Parameters) -> Exhibit:
    reference, early = _run(base), _run(base, RigidWindow(_EARLY, TD))
    off = _roll_error(reference, early)
    return _compared(
        "early", "Switched at 1 ms", "2a, b", 1, base, (_EARLY,),
        "Outlines and roll with and without switching; switched at 1 ms the box rolls less than the reference.",
        f"So does this box, by {abs(off):.2f} degrees of {np.degrees(abs(_at_td(reference).roll)):.0f} at td. Outlines "
        "and roll look identical; the difference is visible only in a panel of its own.",
        agrees=off < 0,
    )  # fmt: skip


def _energies(base: Parameters) -> Exhibit:
    reference = _run(base)
    errors = {tr: _roll_error(reference, _run(base, RigidWindow(tr, TD))) for tr in (_LITTLE, _MUCH)}
    energy = {tr: float(np.interp(tr, reference.time, reference.internal_energy[:, BOX])) for tr in (*errors, TD)}
    return _compared(
        "energies", "Too little and too much energy", "2c", 1, base, (_LITTLE, _MUCH),
        "Too little energy locked in gives less roll, too much gives more roll.",
        f"With {energy[_LITTLE] / energy[TD]:.2f} times the level (tr = {1e3 * _LITTLE:g} ms) the roll at td is off by "
        f"{errors[_LITTLE]:+.2f} degrees, with {energy[_MUCH] / energy[TD]:.2f} times the level (tr = "
        f"{1e3 * _MUCH:g} ms) by {errors[_MUCH]:+.2f} degrees. Too much energy does not give more roll here: what is "
        "cut off is the rest of the trip, and that costs roll in both cases. The energy comes back as vibration.",
        agrees=errors[_LITTLE] < 0 < errors[_MUCH],
    )  # fmt: skip


def _revised(base: Parameters) -> Exhibit:
    reference = _run(base)
    tr = _own(reference, TD)
    assert tr is not None
    errors = [_roll_error(reference, _run(base, RigidWindow(time, TD))) for time in (_REVISED, tr)]
    return _compared(
        "revised", "The revised pair", "8", 4, base, (_REVISED, tr),
        "With tr = 70 and td = 370 ms, the ground at about 380 ms, height and roll agree closely.",
        f"The sled pushes this box until {1e3 * (reference.released or 0):.0f} ms, so 70 ms lies in its trip: the roll "
        f"at td is off by {errors[0]:+.2f} degrees. The analogue is the recommended tr = {1e3 * tr:.1f} ms, after the "
        f"trip, with {errors[1]:+.2f} degrees.",
        agrees=abs(errors[1]) < abs(errors[0]),
    )  # fmt: skip


def _compared(
    name: str, title: str, figure: str, section: int, base: Parameters, times: tuple[float, ...], paper: str,
    found: str, *, agrees: bool,
) -> Exhibit:  # fmt: skip
    """Outlines, roll and height of runs switched at ``times`` beside the reference, and the differences."""
    reference = _run(base)
    columns: dict[str, Samples] = {
        "time_ms": 1e3 * reference.time, "roll_deg": np.degrees(reference.roll), "z_m": reference.centre.imag,
    }  # fmt: skip
    shapes = [Shape("without switching", _outlines(reference))]
    rolls, differences, heights = [Curve("without switching", "roll_deg")], [], []
    for tr in times:
        run, key = _run(base, RigidWindow(tr, TD)), f"{1e3 * tr:.4g}"
        label = f"tr = {key} ms"
        columns[f"roll_{key}_deg"] = np.degrees(run.roll)
        columns[f"droll_{key}_deg"] = np.degrees(run.roll - reference.roll)
        columns[f"dz_{key}_mm"] = 1e3 * (run.centre - reference.centre).imag
        shapes.append(Shape(label, _outlines(run), "thin"))
        rolls.append(Curve(label, f"roll_{key}_deg", "thin"))
        differences.append(Curve(label, f"droll_{key}_deg"))
        heights.append(Curve(label, f"dz_{key}_mm"))
    every = 1e3 * _END / (_OUTLINES - 1)
    marks = (("td", 1e3 * TD),)
    panels = (
        (
            Panel(f"box every {every:.0f} ms", "z [m]", shapes=tuple(shapes), xlabel="x [m]"),
            Panel("roll", "roll [degrees]", tuple(rolls), marks=marks),
        ),
        (
            Panel("roll less that of the reference", "difference [degrees]", tuple(differences), marks=marks),
            Panel("height less that of the reference", "difference [mm]", tuple(heights), marks=marks),
        ),
    )
    return Exhibit(name, title, section, figure, paper, found, agrees, columns, panels)


def variants_of(base: Parameters) -> Iterator[Variant]:
    """Changes that act after td, then changes that act before."""
    yield Variant("base", base, before=False)
    yield Variant("ground stiffness / 2", replace(base, ground_stiffness=base.ground_stiffness / 2), before=False)
    yield Variant("ground stiffness x 2", replace(base, ground_stiffness=base.ground_stiffness * 2), before=False)
    yield Variant("ground 10 mm lower", replace(base, ground=base.ground + 0.01), before=False)
    for name, share in (("stiffness", 0.2), ("yield_strain", 0.15), ("speed", 0.01)):
        for sign in (-1, 1):
            changed = replace(base, **{name: getattr(base, name) * (1 + sign * share)})
            yield Variant(f"{name.replace('_', ' ')} {sign * share:+.0%}", changed, before=True)
    yield Variant("damping 1 1/s", replace(base, damping=1.0), before=True)


def tried(base: Parameters) -> tuple[RigidWindow, tuple[Tried, ...]]:
    """Run all variants; give their common window, and how each run does in it.

    td is 10 ms before the first of their landings, tr the latest of their own.
    """
    variants = tuple(variants_of(base))
    landings = [_run(one.parameters).landed or _END for one in variants]
    td = round(min(landings) - _BEFORE_LANDING, 3)
    own = [_own(_run(one.parameters), td) for one in variants]
    common = RigidWindow(max(tr for tr in own if tr is not None), td)
    return common, tuple(_at(one, tr, common) for one, tr in zip(variants, own, strict=True))


def _at(variant: Variant, own: float | None, common: RigidWindow) -> Tried:
    reference, run = _run(variant.parameters), _run(variant.parameters, common)
    outcome = compare(reference, run, common.tr, common.td)
    end = float(np.degrees(run.roll[-1] - reference.roll[-1]))
    return Tried(variant, own, abs(float(np.sqrt(outcome.energy_ratio)) - 1), outcome.roll_error, end)


def _variants(base: Parameters) -> Exhibit:
    window, rows = tried(base)
    number = np.arange(1.0, len(rows) + 1)
    own = np.array([np.nan if row.own_tr is None else row.own_tr for row in rows])
    columns = {
        "run": number, "own_tr_ms": 1e3 * own, "common_tr_ms": 0 * number + 1e3 * window.tr,
        "rigid_own": (window.td - own) / _END, "rigid_common": 0 * number + (window.td - window.tr) / _END,
        "level_error_percent": 100 * np.array([row.level_error for row in rows]),
        "roll_error_deg": np.array([row.roll_error for row in rows]),
        "end_error_deg": np.array([row.end_error for row in rows]),
    }  # fmt: skip
    return Exhibit(
        "variants", "One reference run for many variants", 4, "section 4",
        "One reference run serves dozens of variants, since parameters such as headroom, belts and roof do not "
        "influence tr: they act after td.",
        _told(window, rows), None, columns, _of_variants(window),
    )  # fmt: skip


def _of_variants(window: RigidWindow) -> tuple[tuple[Panel, ...], ...]:
    dots, common = {"style": "dots", "x": "run"}, 1e3 * window.tr
    level = (f"common tr = {common:.1f} ms, td = {1e3 * window.td:g} ms", common)
    rigid = (Curve("own tr", "rigid_own", **dots), Curve("common tr", "rigid_common", **dots))
    errors = (Curve("at td", "roll_error_deg", **dots), Curve("after the landing", "end_error_deg", **dots))
    energy = (Curve("level error", "level_error_percent", **dots),)
    return (
        (
            Panel("tr of each run", "tr [ms]", (Curve("own tr", "own_tr_ms", **dots),), levels=(level,), xlabel="run"),
            Panel("the most that is saved", "rigid fraction of the run [-]", rigid, xlabel="run"),
        ),
        (
            Panel("at the common tr", "level error [%]", energy, xlabel="run"),
            Panel("at the common tr", "roll error [degrees]", errors, xlabel="run"),
        ),
    )


def _told(window: RigidWindow, rows: tuple[Tried, ...]) -> str:
    """Say how far the paper's statement holds, and where it fails."""
    known = [(row, 1e3 * row.own_tr) for row in rows if row.own_tr is not None]
    after, before = ([tr for row, tr in known if row.variant.before is flag] for flag in (False, True))
    loads = [1e3 * (_run(row.variant.parameters).released or 0.0) for row in rows]
    worst = max(rows, key=lambda row: row.level_error)
    given_up, roll = 1e3 * window.tr - min(tr for _, tr in known), max(abs(row.roll_error) for row in rows)
    names = "; ".join(f"{place} {row.variant.name}" for place, row in enumerate(rows, start=1))
    return (
        f"True for what acts after td: tr moves by {max(after) - min(after):.2g} ms. What acts before td moves it: "
        f"from {min(before):.1f} to {max(before):.1f} ms. One tr still serves all runs, the latest, "
        f"{1e3 * window.tr:.1f} ms: the roll at td is right within {roll:.2f} degrees, and up to {given_up:.1f} ms of "
        "rigid time are given up. No crossing is common: at the common tr the level is off by up to "
        f"{100 * worst.level_error:.0f} % ({worst.variant.name}), with a tolerance of 20 %. It fails where a tr is "
        f"taken over that lies before the end of the load of another run, which is between {min(loads):.1f} and "
        f"{max(loads):.1f} ms. The roof alone cannot be varied in this box. Runs: {names}."
    )


def _own(reference: Record, td: float) -> float | None:
    recommended = suggestion_for(reference, td).recommended
    return recommended.tr if recommended else None


class _State(NamedTuple):
    roll: float
    centre: complex


def _at_td(record: Record) -> _State:
    at = int(np.abs(record.time - TD).argmin())
    return _State(float(record.roll[at]), complex(record.centre[at]))


def _roll_error(reference: Record, run: Record) -> float:
    """Roll at td against the reference [degrees]."""
    return float(np.degrees(_at_td(run).roll - _at_td(reference).roll))


def _outlines(record: Record) -> Plane:
    shown = np.linspace(0, record.time.size - 1, _OUTLINES).round().astype(int)
    return np.asarray(record.outline[shown])


# Section of the paper and what makes each figure, some seconds with the default box.
_FIGURES: Final = ((1, _setting), (1, _early), (1, _energies), (4, _revised), (4, _variants))


def exhibits_of(parameters: Parameters) -> list[tuple[int, Callable[[], Exhibit]]]:
    """Figures of a box by section, each to be computed by a call."""
    return [(section, partial(make, parameters)) for section, make in _FIGURES]
