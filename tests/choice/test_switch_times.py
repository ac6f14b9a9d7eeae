"""Rigid windows of finished runs: those that plan names are those that verify compares."""

from pathlib import Path

import numpy as np
import pytest

from d2rpick.base.errors import RangeError
from d2rpick.base.spans import Times
from d2rpick.choice.question import Reference, read_reference
from d2rpick.choice.switched.comparison import Comparison, compare_runs
from d2rpick.choice.switched.same_model import explain_difference, refuse_other_model
from d2rpick.choice.switched.switch_times import (
    find_switched_windows,
    read_switch_times,
    refuse_exchanged_runs,
    sort_windows,
)
from d2rpick.choice.switched.switched_run import prepare_switched_history
from d2rpick.histories.formats import glstat, matsum
from d2rpick.histories.history import History, Samples
from d2rpick.histories.opening import Selection
from tests.command import ROOT, join_wrapped_lines, run, run_json
from tests.computed import locate_stored

TIME = np.linspace(0, 1, 501)
SWING: Samples = 5 + np.sin(40 * TIME)
WINDOWS = ((0.3, 0.5), (0.6, 0.8))
LEGS = locate_stored("drop2_w123_T0*.gz")
DROP = locate_stored("drop2T01.gz")


def select_states(start: float, end: float) -> slice:
    """Return the states from ``start`` to ``end`` [time]."""
    first, last = np.searchsorted(TIME, [start - 1e-9, end - 1e-9]).tolist()
    return slice(first, last + 1)


def freeze(energy: Samples, *windows: Times) -> Samples:
    """Return an energy that is constant in each window, and continues from there as before the window."""
    frozen = energy.copy()
    for start, end in windows:
        states = select_states(start, end)
        frozen[states] = frozen[states.start]
    return frozen


def read_run(
    folder: Path,
    energies: dict[str, Samples],
    *windows: Times,
    rest_until: float = 0.0,
) -> Reference:
    """Write bodies of which the engine has no kinetic energy in the windows, and none has any until the model moves."""
    rests = rest_until > TIME
    absent = rests.copy()
    for start, end in windows:
        absent[select_states(start, end)] = True
    parts = [
        matsum.PartColumns(
            name,
            energy,
            np.where(absent if name == "engine" else rests, 0.0, 100.0),
            0 * TIME,
            0 * TIME + 3,
        )
        for name, energy in energies.items()
    ]
    lines = {
        "time": TIME,
        "kinetic energy": np.where(rests, 0.0, 100.0),
        "internal energy": np.sum([*energies.values()], axis=0),
    }
    folder.mkdir(exist_ok=True)
    (folder / "matsum").write_bytes(matsum.write("bodies", TIME, parts))
    (folder / "glstat").write_bytes(glstat.write("bodies", lines))
    return read_reference([str(folder / "matsum"), str(folder / "glstat")], Selection())


def test_the_windows_of_a_run_are_those_of_its_plan(tmp_path: Path) -> None:
    reference = read_run(tmp_path / "reference", {"engine": SWING})
    switched = read_run(
        tmp_path / "switched", {"engine": freeze(SWING, *WINDOWS)}, *WINDOWS
    )
    planned = prepare_switched_history(switched, ())[1]
    windows = find_switched_windows(switched, reference.history)
    assert [(window.first, window.td) for window in windows] == [*planned]
    assert [time for window in planned for time in window] == pytest.approx(
        [time for window in WINDOWS for time in window]
    )
    for window, (tr, _) in zip(windows, WINDOWS, strict=True):
        assert tr - 0.002 <= window.tr <= tr
        assert [part.name for part in window.rigid] == ["engine"]


def test_a_run_that_begins_rigid_and_at_rest_is_rigid_from_its_first_state(
    tmp_path: Path,
) -> None:
    """No output tells a rigid part from a resting one, but a later start would leave out that the part was rigid."""
    falling = np.where(TIME < 0.6, 0.0, SWING)
    switched = read_run(tmp_path, {"engine": falling}, (0.0, 0.5), rest_until=0.05)
    (window,) = find_switched_windows(switched, switched.history)
    assert (window.first, window.tr) == (0, 0)
    # If nothing vibrates, the state after the last rigid one may be the one at td.
    assert 0.5 <= window.td <= 0.502 + 1e-9


@pytest.mark.parametrize(
    ("tr", "td", "expected"),
    [
        (None, None, 0),
        (None, 0.5, 0),
        (None, 0.79, 1),
        (0.61, None, 1),
        (0.31, None, 0),
    ],
)
def test_the_window_that_is_asked_for_is_judged(
    tr: float | None, td: float | None, expected: int, tmp_path: Path
) -> None:
    reference = read_run(tmp_path / "reference", {"engine": SWING})
    switched = read_run(
        tmp_path / "switched", {"engine": freeze(SWING, *WINDOWS)}, *WINDOWS
    )
    windows = find_switched_windows(switched, reference.history)
    pair = read_switch_times(switched, reference.history, windows, tr, td)
    chosen = windows[expected]
    assert pair == (tr or chosen.tr, td or chosen.td)
    judged, earlier, later = sort_windows(windows, pair)
    assert judged == chosen
    assert (*earlier, chosen, *later) == windows


def test_parts_that_deform_have_to_be_left_out_by_name(tmp_path: Path) -> None:
    """The energy of the whole model is not that of the parts that were rigid."""
    car = 3 + np.cos(31 * TIME)
    reference = read_run(tmp_path / "reference", {"engine": SWING, "car": car})
    switched = read_run(
        tmp_path / "switched",
        {"engine": freeze(SWING, *WINDOWS), "car": car},
        *WINDOWS,
    )
    windows = find_switched_windows(switched, reference.history)
    assert len(windows) == len(WINDOWS)
    with pytest.raises(RangeError, match="only these parts were rigid: engine; choose"):
        read_switch_times(switched, reference.history, windows, None, None)


def test_runs_whose_parts_have_other_titles_are_refused(tmp_path: Path) -> None:
    """Part 1 is another part in each run, so no number of the comparison would mean anything."""
    box = read_run(tmp_path / "box", {"box": SWING})
    car = read_run(tmp_path / "car", {"engine": SWING}, *WINDOWS)
    titles = "part 1 is 'box' in the reference run and 'engine' in the switched run"
    with pytest.raises(RangeError, match=f"belong to different models: {titles}; give"):
        refuse_other_model(box.run, car.run)
    refuse_other_model(car.run, car.run)


def test_exchanged_runs_are_to_be_exchanged(tmp_path: Path) -> None:
    """Only the run that is given as the reference run was ever rigid."""
    reference = read_run(tmp_path / "reference", {"engine": SWING})
    switched = read_run(
        tmp_path / "switched", {"engine": freeze(SWING, *WINDOWS)}, *WINDOWS
    )
    windows = find_switched_windows(reference, switched.history)
    with pytest.raises(RangeError, match=r"rigid from 0\.\d+ to 0\..*exchange them"):
        refuse_exchanged_runs(switched, reference, windows)
    for first in (reference, switched):
        windows = find_switched_windows(switched, first.history)
        refuse_exchanged_runs(first, switched, windows)


def test_the_other_model_is_the_only_reason_why_no_window_is_found(
    tmp_path: Path,
) -> None:
    reference = read_run(tmp_path / "reference", {"engine": SWING})
    other = read_run(tmp_path / "other", {"engine": 3 * SWING})
    with pytest.raises(
        RangeError, match=r"not two runs of one model.*; give the switched run"
    ):
        read_switch_times(other, reference.history, (), None, None)
    same = read_run(tmp_path / "same", {"engine": 1.1 * SWING})
    with pytest.raises(RangeError, match="rigid; give the run with the switching card"):
        read_switch_times(same, reference.history, (), None, None)


def test_what_the_files_show_of_two_models_is_the_first_reason(tmp_path: Path) -> None:
    """Parts and masses decide; a title is only a sign, and another velocity is no other model."""
    engine = read_run(tmp_path / "reference", {"engine": SWING})
    both = read_run(tmp_path / "both", {"engine": SWING, "car": SWING})
    assert explain_difference(engine.run, both.run) == ""
    bar = read_reference([str(ROOT / "sample_data" / "oscillator" / "OSCT01.gz")])
    box = read_reference([str(ROOT / "sample_data" / "rolloverT01.gz")])
    switched = read_reference([locate_stored("rollover_r100_T0*.gz")])
    assert explain_difference(bar.run, box.run) == (
        "the runs belong to different models (the mass of part 1 'bar' is 0.00157 in the reference run and 374.4 in "
        "the switched run)"
    )
    assert explain_difference(box.run, switched.run) == (
        "the loads or velocities differ, but the masses of the parts do not"
    )


def test_an_unlike_run_is_the_first_reason_against_a_given_pair(tmp_path: Path) -> None:
    options = ("--t-end", "0.3", "--dt", "1e-4", "--stiffness", "660e3", "--mass")
    reference, other = (str(tmp_path / f"{name}.glstat") for name in ("ref", "other"))
    times = ("--tr", "0.06", "--td", "0.09")
    run("replay", *options, "31.4", "--beta", "2", "--v0", "6", "-o", reference)
    run("replay", *options, "31.4", "--beta", "2", "--v0", "4", *times, "-o", other)
    result = run("verify", *times, "--switched", other, reference)
    assert result.exit_code == 1
    text = join_wrapped_lines(result.stdout)
    assert (
        "why these are not two runs of one model with the same loads and velocities: the energies of the two runs "
        "differ by 56% before 0.06, when both are deformable (kinetic energy at 0: "
        in text
    )
    assert "to improve give the switched run of this model" in text
    assert (
        f"next look at the reference run, and at the switched run in the same way: d2rpick info {reference}"
        in text
    )


def make_history(energy: Samples) -> History:
    return History(TIME, energy, source=("run",), format="csv", channel="E")


def compare(switched: Samples, pair: Times, *, is_reported: bool = True) -> Comparison:
    """Compare energies (n,) with those of the reference run by their own evidence."""
    return compare_runs(
        make_history(SWING),
        make_history(switched),
        pair,
        np.inf,
        1.0,
        (None, None),
        (None, None),
        is_reported=is_reported,
    )


@pytest.mark.parametrize("wrong", [1e5, -1e5, np.pi])
@pytest.mark.parametrize("late", [0.0, 0.0005])
def test_a_wrong_energy_of_rigid_solids_is_not_that_of_another_model(
    wrong: float, late: float
) -> None:
    """The state at tr itself may be rigid already, and so may a state that lies before a tr that is given late."""
    switched = SWING.copy()
    switched[select_states(0.3, 0.5)] = wrong
    comparison = compare(switched, (0.3 + late, 0.5))
    assert not [
        text for text in comparison.objections if "not two runs of one model" in text
    ]
    different = compare(np.where(TIME < 0.2, 2 * SWING, switched), (0.3, 0.5))
    assert [
        text for text in different.objections if "not two runs of one model" in text
    ]


def test_energies_that_the_solver_reports_wrongly_are_not_compared() -> None:
    switched = SWING + np.where(TIME >= 0.3, 1e5, 0.0)
    comparison = compare(freeze(switched, (0.3, 0.5)), (0.3, 0.5), is_reported=False)
    assert comparison.objections == ()
    assert not comparison.has_energy
    assert comparison.mean_after is comparison.spread_after is None
    assert comparison.energy_frozen is comparison.level_ratio is None
    assert comparison.notes == ()


# A box that falls on its corner and was rigid in three flights, computed by a solver.


@pytest.mark.slow
def test_the_first_window_of_three_passes_and_leads_to_the_second() -> None:
    """Computed: rigid from 0 to 0.2838, 0.3654 to 0.4176 and 0.5046 to 0.5946; nothing vibrates in the first fall."""
    verify = ("verify", "--switched", LEGS, DROP)
    verdict = run_json(*verify)
    assert (verdict["tr"], verdict["td"]) == pytest.approx((0, 0.2838), abs=1e-5)
    switched = verdict["switched"]
    assert switched["objections"] == []
    assert switched["level_ratio"] is None
    later = [time for window in switched["other_windows"] for time in window]
    assert later == pytest.approx([0.3654, 0.4176, 0.5046, 0.5946], abs=1e-5)
    text = join_wrapped_lines(run(*verify).stdout)
    assert text.startswith(
        "comparison passed in window 1 of 3: momentum error after td 0.00% (limit 5%); only the motion is compared, "
        "because nothing vibrates use tr = 0, td = 0.2838"
    )
    assert (
        "judge the next window with d2rpick verify --tr 0.365405 --td 0.417605" in text
    )


@pytest.mark.slow
def test_a_window_after_one_that_changed_the_motion_needs_another_reference() -> None:
    verify = ("verify", "--no-verify", "--switched", LEGS, DROP)
    second, third = (run_json(*verify, "--td", td) for td in ("0.4176", "0.5946"))
    (moved,) = second["switched"]["objections"]
    assert "so it moves differently" in moved
    (objection,) = third["switched"]["objections"]
    assert "the two runs differ already before tr, from " in objection
    assert " to 0.504604, their momenta by 34%, because" in objection
    assert "is rigid only in the earlier ones" in objection
