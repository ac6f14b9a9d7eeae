"""When the parts of a question were rigid, and when only other parts were rigid."""

from pathlib import Path

import numpy as np
import pytest

from d2rpick.base.errors import RangeError
from d2rpick.choice.answers import suggest_in_run, verify_run
from d2rpick.choice.question import Settings, read_reference
from d2rpick.choice.switched.switched_run import prepare_switched_history
from d2rpick.choice.td.plan import plan_run
from d2rpick.histories.formats import glstat, matsum
from d2rpick.histories.history import Samples
from d2rpick.histories.opening import Selection

TIME = np.linspace(0, 1, 501)


def make_column(energy: Samples, kinetic: Samples, title: str) -> matsum.PartColumns:
    return matsum.PartColumns(title, energy, kinetic, 0 * TIME, 0 * TIME + 3)


@pytest.fixture
def files(tmp_path: Path) -> list[str]:
    """Write three bodies: the first has the kinetic energy of a rigid body for a while, the others never have it."""
    is_off = (TIME > 0.299) & (TIME < 0.701)
    swing, moves = 5 + np.sin(40 * TIME), 100 + np.cos(40 * TIME)
    parts = (
        make_column(
            np.where(is_off, swing[150], swing), np.where(is_off, 0.0, moves), "engine"
        ),
        make_column(3 + np.cos(31 * TIME), moves, "car"),
        make_column(1e-9 * swing, moves, "dust"),
    )
    lines = {
        "time": TIME,
        "kinetic energy": 2 * moves,
        "internal energy": parts[0][1] + parts[1][1],
    }
    for name, content in (
        ("matsum", matsum.write("bodies", TIME, parts)),
        ("glstat", glstat.write("bodies", lines)),
    ):
        (tmp_path / name).write_bytes(content)
    return [str(tmp_path / name) for name in ("matsum", "glstat")]


@pytest.mark.parametrize(
    ("arguments", "done"),
    [
        ((), False),
        (("engine",), True),
        (("car",), None),
        (("engine", "car"), False),
        (("engine", "dust"), True),
    ],
)
def test_a_window_is_done_only_where_the_parts_of_the_question_were_rigid(
    files: list[str], arguments: tuple[str, ...], done: bool | None
) -> None:
    reference = read_reference(files, Selection(parts=arguments))
    history, windows, cautions = prepare_switched_history(reference, ())
    assert [time for window in windows for time in window] == pytest.approx(
        [0.3, 0.7] * bool(done)
    )
    codes_expected = {None: [], True: ["rigid-times"], False: ["partly-rigid"]}[done]
    assert [caution.code for caution in cautions] == codes_expected
    if done is False:
        assert (
            "these parts were rigid: engine; the others deform" in cautions[0].message
        )
    # If a rigid body has taken over the momenta, the momenta of its parts show no flight.
    assert (history.evidence is reference.history.evidence) == (done is None)


@pytest.mark.parametrize("chosen", [(), ("engine", "car")])
def test_a_run_in_which_some_of_the_parts_were_rigid_is_no_reference_for_them(
    files: list[str], chosen: tuple[str, ...]
) -> None:
    reference = read_reference(files, Selection(parts=chosen))
    refused = "a switched run: these parts were rigid from 0.3 to 0.7: engine; choose"
    with pytest.raises(RangeError, match=refused):
        suggest_in_run(reference, 0.6, Settings(after=0.1))
    with pytest.raises(RangeError, match=refused):
        verify_run(reference, 0.4, 0.6, Settings(after=0.1))
    with pytest.raises(RangeError, match=refused):
        plan_run(reference, Settings(after=0.1))


def test_parts_that_were_deformable_can_be_chosen_from_a_switched_run(
    files: list[str],
) -> None:
    deformable = read_reference(files, Selection(parts=("car",)))
    assert suggest_in_run(deformable, 0.6, Settings(after=0.1)).td == 0.6
    later = read_reference(files, Selection())
    assert suggest_in_run(later, 0.9, Settings(after=0.75)).td == 0.9


def test_a_part_at_rest_is_not_taken_for_a_rigid_part(tmp_path: Path) -> None:
    """A plate rests until it is hit, and its kinetic energy is then zero as if it were rigid."""
    rests = TIME < 0.7
    swing, moves = 5 + np.sin(40 * TIME), 100 + np.cos(40 * TIME)
    plate = make_column(
        np.where(rests, 0.0, swing), np.where(rests, 0.0, moves), "plate"
    )
    parts = (make_column(swing, moves, "ball"), plate)
    lines = {"time": TIME, "kinetic energy": moves, "internal energy": swing}
    (tmp_path / "matsum").write_bytes(matsum.write("bodies", TIME, parts))
    (tmp_path / "glstat").write_bytes(glstat.write("bodies", lines))
    files = [str(tmp_path / name) for name in ("matsum", "glstat")]
    reference = read_reference(files, Selection())
    assert suggest_in_run(reference, 0.6, Settings(after=0.1)).td == 0.6
