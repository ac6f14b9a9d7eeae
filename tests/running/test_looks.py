"""What a look at growing files adds: only new states, or all states if files were written again."""

import gzip
from pathlib import Path

import numpy as np
import pytest

from d2rpick.base.errors import FormatError
from d2rpick.histories.history import Samples
from d2rpick.histories.names import Selection
from d2rpick.histories.opening import open_run
from d2rpick.running.events import Event
from d2rpick.running.looks import Looks
from d2rpick.running.watch import Watch
from tests.command import ROOT
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
            if states is None:
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
    assert states is not None
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


def _find_state(data: bytes, share: float) -> int:
    """Return the end of a glstat state near a share of the length; for other contents, the length itself."""
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
        if states is None:
            continue  # its last state is being written
        if not follows:
            times, energies = [], []
        times.append(states.time)
        energies.append(states.energy)
    assert np.array_equal(np.concatenate(times), whole.time)
    assert np.array_equal(np.concatenate(energies), whole.energy)
    assert not times[-1].size  # nothing was written since the previous look
    assert len(times) > 2
    assert not looks.grow


def test_a_state_that_was_not_yet_written_in_full_is_given_with_all_states(
    tmp_path: Path,
) -> None:
    """Its numbers change, so results derived from it are discarded."""
    run, looks = make_falling_masses(), Looks(Selection())
    for last_energy in (7.0, 8.0):
        internal = run.internal[:200].copy()
        internal[-1] = last_energy
        cut = run._replace(
            time=run.time[:200],
            momentum=run.momentum[:200],
            kinetic=run.kinetic[:200],
            internal=internal,
            work=run.work[:200],
            damped=run.damped[:200],
        )
        states, follows = looks.new_states([as_glstat(cut, tmp_path)])
        assert states is not None
        assert states.time.size == 200
        assert not follows


@pytest.mark.parametrize("form", ["glstat", "matsum", "binout"])
def test_the_events_of_a_file_that_grows_are_those_of_the_whole_file(
    tmp_path: Path, form: str
) -> None:
    path = Path(FORMS[form](make_falling_masses(), tmp_path))
    data = path.read_bytes()
    whole = [
        watch_event
        for watch_event in Watch([str(path)], Selection()).news()
        if watch_event.seen
    ]
    watch, events = Watch([str(path)], Selection()), list[Event]()
    first = data[: _find_state(data, 0.3)]
    for content in (first, *(data[: int(share * len(data))] for share in SHARES)):
        path.write_bytes(content)
        events += watch.news()
    watch_events = [
        watch_event
        for watch_event in events
        if watch_event.event not in ("begun", "restart")
    ]
    assert watch_events == [
        watch_event for watch_event in whole if watch_event.event != "begun"
    ]
    assert "flight" in {watch_event.event for watch_event in watch_events}
