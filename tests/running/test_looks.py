"""What a look at growing files adds: only new states, or all states if files were rewritten."""

import gzip
from pathlib import Path

import numpy as np
import pytest

from d2rpick.base.errors import FormatError
from d2rpick.histories.history import History, Samples
from d2rpick.histories.names import Selection
from d2rpick.histories.opening import open_run
from d2rpick.report.follow import describe_news
from d2rpick.running.events import RunEvent
from d2rpick.running.looks import Looks
from d2rpick.running.watch import News, Watch, follow
from tests.command import ROOT
from tests.energies import require
from tests.histories.test_contact_forces import rcforc
from tests.made_binout import make_binout
from tests.written_runs import FALL_WRITERS, WRITERS, Written, as_glstat

LEGS = [
    gzip.decompress((ROOT / f"tests/data/drop2_w123_T0{leg}.gz").read_bytes())
    for leg in (1, 2)
]

FORMS = {**WRITERS, **FALL_WRITERS}
SHARES = (0.4, 0.401, 0.65, 0.8, 0.9, 1.0, 1.0)  # in the middle of states


def test_only_new_states_are_read_of_files_that_grow_and_together_they_are_all(
    tmp_path: Path,
) -> None:
    names, looks = [str(tmp_path / f"runT0{leg}") for leg in (1, 2)], Looks(Selection())
    times, momenta, energies = list[Samples](), list[Samples](), list[Samples]()
    for leg, data in enumerate(LEGS):
        for share in (0.3, 0.301, 0.7, 1.0):  # in the middle of records
            Path(names[leg]).write_bytes(data[: int(share * len(data))])
            states, follows = looks.new_states(names[: leg + 1])
            assert follows is bool(times)
            if not states.time.size:
                continue
            assert not times or states.time[0] > times[-1][-1]
            times.append(states.time)
            energies.append(states.energy)
            momenta.append(states.momenta[0].values)
    assert len(times) >= 7
    whole = open_run(names).history(Selection())
    assert np.array_equal(np.concatenate(times), whole.time)
    assert np.concatenate(energies) == pytest.approx(
        whole.energy, abs=1e-20
    )  # round-off is 0 compared with a landing
    assert np.array_equal(np.concatenate(momenta), whole.momenta[0].values)


@pytest.mark.parametrize("form", ["glstat", "matsum", "binout", "t01"])
def test_a_file_that_became_shorter_is_read_as_a_whole_at_whatever_byte_it_ends(
    tmp_path: Path, form: str
) -> None:
    path = Path(FORMS[form](make_falling_masses(), tmp_path))
    data = path.read_bytes()
    for share in (0.999, 0.99, 0.6, 0.4):
        looks = Looks(Selection())
        path.write_bytes(data)
        before, _ = looks.new_states([str(path)])
        path.write_bytes(data[: int(share * len(data))])
        states, follows = looks.new_states([str(path)])
        whole, _ = Looks(Selection()).new_states([str(path)])
        # a binout ends with a table of its contents, without which it still has all its states
        assert follows is bool(whole.time[-1] == before.time[-1])
        assert states.time.size == (0 if follows else whole.time.size)


@pytest.mark.parametrize("changed", ["shorter", "other", "gone"])
def test_files_that_were_written_anew_are_read_as_a_whole(
    tmp_path: Path, changed: str
) -> None:
    names, looks = (
        [str(tmp_path / "runT01"), str(tmp_path / "runT02")],
        Looks(Selection()),
    )
    for name, data in zip(names, LEGS, strict=True):
        Path(name).write_bytes(data)
    looks.new_states(names)
    first = Path(names[0])
    if changed == "shorter":
        first.write_bytes(LEGS[0][: len(LEGS[0]) // 2])
    elif changed == "other":
        first.write_bytes(LEGS[1])
    remaining_names = names[:1]
    states, follows = looks.new_states(remaining_names)
    assert not follows
    assert np.array_equal(
        states.time, open_run(remaining_names).history(Selection()).time
    )


def make_falling_masses() -> Written:
    """Return three vibrating masses that are pushed for 10 % of the record and then fall."""
    time = np.linspace(0.0, 1.0, 401)
    masses = np.array([3.0, 2.0, 1.0])
    swing = np.outer(np.sin(60 * time), [1.0, -1.0, 0.0])
    momentum = np.zeros((time.size, 3, 2))
    momentum[:, :, 0] = swing + 40 * np.minimum(time, 0.1)[:, np.newaxis] * masses
    momentum[:, :, 1] = -9.81 * np.outer(np.maximum(time - 0.1, 0.0), masses)
    kinetic = (momentum**2).sum(axis=2) / (2 * masses)
    internal = np.outer(1 + np.cos(60 * time) ** 2, [1.0, 1.0, 0.0])
    return Written(time, momentum, kinetic, internal, 0 * time, masses, 0 * time)


def cut_run(run: Written, count: int) -> Written:
    """Return a copy of the first states of a run."""
    columns = {
        name: column[:count].copy()
        for name, column in run._asdict().items()
        if name != "masses"
    }
    return run._replace(**columns)


def _find_state(data: bytes, share: float) -> int:
    """Return the end of a glstat state near a fraction of the length; for other contents, the length itself."""
    size = int(share * len(data))
    end = data.find(b"\n dt of cycle", size)
    return end if end > 0 else size


@pytest.mark.parametrize("form", ["glstat", "matsum", "binout", "momenta"])
def test_a_look_at_a_file_that_is_read_as_a_whole_gives_the_new_states_alone(
    tmp_path: Path, form: str
) -> None:
    path = Path(FORMS[form](make_falling_masses(), tmp_path))
    data, looks = path.read_bytes(), Looks(Selection())
    whole = open_run([str(path)]).history(Selection())
    times, energies = list[Samples](), list[Samples]()
    first = data[: _find_state(data, 0.3)]
    for content in (first, *(data[: int(share * len(data))] for share in SHARES)):
        path.write_bytes(content)
        try:
            states, follows = looks.new_states([str(path)])
        except FormatError:  # a table that ends in the middle of a number
            continue
        if not follows:
            times, energies = [], []
        times.append(states.time)
        energies.append(states.energy)
    assert np.array_equal(np.concatenate(times), whole.time)
    assert np.array_equal(np.concatenate(energies), whole.energy)
    assert not times[-1].size  # nothing was written since the previous look
    assert len(times) > 2
    assert bool(looks.resume_points) is (form != "momenta")


def test_a_state_that_was_not_yet_written_in_full_is_given_with_all_states(
    tmp_path: Path,
) -> None:
    """Its numbers change, so results that were derived from it are discarded."""
    run, looks = make_falling_masses(), Looks(Selection())
    for last_energy in (7.0, 8.0):
        cut = cut_run(run, 200)
        cut.internal[-1] = last_energy
        states, follows = looks.new_states([as_glstat(cut, tmp_path)])
        assert states.time.size == 200
        assert not follows


@pytest.mark.parametrize("form", ["glstat", "matsum", "binout", "t01"])
def test_a_later_look_does_not_read_the_states_before_the_last_ones(
    tmp_path: Path, form: str
) -> None:
    path = Path(FORMS[form](make_falling_masses(), tmp_path))
    data, looks = path.read_bytes(), Looks(Selection())
    whole = open_run([str(path)]).history(Selection())
    path.write_bytes(data[: int(0.7 * len(data))])
    before = looks.new_states([str(path)])[0]
    size = len(data) // 10
    with path.open("r+b") as stream:  # the same file
        stream.seek(3 * size)
        stream.write(b"?" * size)
        stream.seek(0, 2)
        stream.write(data[int(0.7 * len(data)) :])
    states, follows = looks.new_states([str(path)])
    assert follows
    assert np.array_equal(np.append(before.time, states.time), whole.time)
    for momenta, momenta_before, momenta_of_whole in zip(
        states.momenta, before.momenta, whole.momenta, strict=True
    ):
        together = np.append(momenta_before.values, momenta.values, axis=0)
        assert np.array_equal(together, momenta_of_whole.values)


@pytest.mark.parametrize("form", ["glstat", "matsum", "binout"])
@pytest.mark.parametrize("state_count", [12, 210])
def test_a_state_that_is_being_written_is_left_out_wherever_the_file_ends(
    tmp_path: Path, form: str, state_count: int
) -> None:
    """The new part of the file would lack the velocities or the momenta that show a force."""
    path = Path(FORMS[form](cut_run(make_falling_masses(), state_count), tmp_path))
    data, looks = path.read_bytes(), Looks(Selection())
    whole = open_run([str(path)]).history(Selection())
    pieces = list[History]()
    begin = len(data) - len(data) // state_count - 20
    for size in (*range(begin, len(data), 17), len(data)):
        path.write_bytes(data[:size])
        first_look, _ = Looks(Selection()).new_states([str(path)])
        assert len(first_look.momenta) == 1
        states, follows = looks.new_states([str(path)])
        assert follows is bool(pieces)
        pieces.append(states)
        assert sum(piece.time.size for piece in pieces) == first_look.time.size
    assert np.array_equal(np.concatenate([piece.time for piece in pieces]), whole.time)


@pytest.mark.parametrize("form", ["glstat", "matsum"])
def test_states_at_the_same_printed_time_do_not_make_a_look_begin_again(
    tmp_path: Path, form: str
) -> None:
    """The newest of them is valid, so the last one is not returned before a later time is written."""
    run = cut_run(make_falling_masses(), 240)
    step = 4e-6 if form == "glstat" else 4e-5  # 2/5 of the last printed digit
    time = np.asarray(1 + step * np.arange(240), np.float64)
    path = Path(FORMS[form](run._replace(time=time), tmp_path))
    data, looks = path.read_bytes(), Looks(Selection())
    whole = open_run([str(path)]).history(Selection())
    pieces = list[History]()
    for end in range(9 * len(data) // 10, len(data) + 1, len(data) // 397):
        path.write_bytes(data[:end])
        states, follows = looks.new_states([str(path)])
        assert follows is bool(pieces)
        pieces.append(states)
    assert sum(piece.time.size > 0 for piece in pieces) > 5
    times = np.concatenate([piece.time for piece in pieces])
    assert np.array_equal(times, whole.time[: times.size])
    assert times.size >= whole.time.size - 2
    energies = np.concatenate([piece.energy for piece in pieces])
    assert np.array_equal(energies, whole.energy[: times.size])


def test_a_run_is_watched_from_a_look_at_a_state_that_is_half_written(
    tmp_path: Path,
) -> None:
    path = Path(as_glstat(make_falling_masses(), tmp_path))
    path.write_bytes(path.read_bytes().rpartition(b" global x velocity")[0])
    news = Watch([str(path)], Selection()).look()
    assert news.now == pytest.approx(1 - 1 / 400)  # part of the last state but one


def test_files_of_one_run_that_grow_in_turn_are_read_on_and_forces_are_not(
    tmp_path: Path,
) -> None:
    """One file always has a state that the other one does not have yet; an rcforc has no states of the history."""
    run, looks = make_falling_masses(), Looks(Selection())
    contents = {}
    for form in ("glstat", "matsum"):
        written = Path(FORMS[form](run, tmp_path))
        contents[written] = written.read_bytes()
    forces = tmp_path / "rcforc"
    forces.write_bytes(rcforc())
    names = [*map(str, contents), str(forces)]
    whole = open_run(names).history(Selection())
    pieces = list[History]()
    for path, data in contents.items():
        path.write_bytes(data[: int(0.6 * len(data))])
    for share in (0.6, 0.7, 0.71, 0.78, 0.85, 0.93, 1.0):
        for path, data in contents.items():
            path.write_bytes(data[: int(share * len(data))])
            states, follows = looks.new_states(names)
            assert follows is bool(pieces)
            pieces.append(states)
        forces.write_text("no forces any more")
    for number, momenta in enumerate(whole.momenta):
        values = [piece.momenta[number].values for piece in pieces]
        assert np.array_equal(np.concatenate(values), momenta.values)
    assert np.array_equal(np.concatenate([piece.time for piece in pieces]), whole.time)


@pytest.mark.parametrize("relative", [False, True])
@pytest.mark.parametrize("every", [1, 3])
def test_both_branches_of_a_binout_are_read_on_wherever_it_ends(
    tmp_path: Path,
    relative: bool,
    every: int,
) -> None:
    path, looks = tmp_path / "binout", Looks(Selection())
    writer = make_binout(range(1, 241), relative=relative, matsum_every=every)
    data = bytes(writer.data)
    path.write_bytes(data)
    whole = open_run([str(path)]).history(Selection())
    pieces = list[History]()
    for mark in (*writer.marks[-280::9], len(data)):
        path.write_bytes(data[: mark + 5])
        states, follows = looks.new_states([str(path)])
        assert follows is bool(pieces)
        assert looks.resume_points
        pieces.append(states)
    assert np.array_equal(np.concatenate([piece.time for piece in pieces]), whole.time)
    for number, momenta in enumerate(whole.momenta):
        values = [piece.momenta[number].values for piece in pieces]
        assert np.array_equal(np.concatenate(values), momenta.values)


@pytest.mark.parametrize("form", ["glstat", "matsum", "binout"])
def test_the_events_of_a_file_that_grows_are_those_of_the_whole_file(
    tmp_path: Path, form: str
) -> None:
    path = Path(FORMS[form](make_falling_masses(), tmp_path))
    data = path.read_bytes()
    whole = list(follow([str(path)], Selection(), lasting=0.0))
    watch, reads = Watch([str(path)], Selection()), list[News]()
    first = data[: _find_state(data, 0.3)]
    for content in (first, *(data[: int(share * len(data))] for share in SHARES)):
        path.write_bytes(content)
        reads.append(watch.look())
    names = [str(path)]
    events = [
        event
        for event in describe_news(reads, names, ())
        if event.event not in ("begun", "restart")
    ]
    assert events == list(describe_news(whole, names, ()))[1:]
    assert "flight" in {event.event for event in events}


def test_a_growing_matsum_shows_the_flight_that_the_whole_one_shows(
    tmp_path: Path,
) -> None:
    """Its masses are lower bounds from the states that were read; the last states alone show 145 of 350 kg."""
    data = (ROOT / "sample_data" / "rollover_box.matsum").read_bytes()
    watch = Watch([str(tmp_path / "matsum")], Selection(parts=("box",)))
    events = list[RunEvent]()
    for share in (0.3, 0.45, 0.5, 0.55, 0.6, 0.65, 1.0):
        (tmp_path / "matsum").write_bytes(data[: int(share * len(data))])
        events += watch.look().events
    whole = Watch(
        [str(ROOT / "sample_data" / "rollover_box.matsum")], Selection(parts=("box",))
    )
    kinds = ("flight", "switch", "contact")
    assert [event[:3] for event in events if event.event in kinds] == [
        event[:3] for event in whole.look().events if event.event in kinds
    ]
    masses = require(watch.looks.evidence.history.momenta[0].masses)
    assert masses == pytest.approx([350.0, 6.0], rel=1e-3)
