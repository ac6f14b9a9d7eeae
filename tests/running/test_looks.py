"""What a look adds to those before: new states alone, or all of them where files were written anew."""

import gzip
from pathlib import Path

import numpy as np
import pytest

from d2rpick.histories.history import Samples
from d2rpick.histories.names import Selection
from d2rpick.histories.opening import open_run
from d2rpick.running.looks import Looks
from tests.command import ENERGY, ROOT

LEGS = [
    gzip.decompress((ROOT / f"tests/data/drop2_w123_T0{leg}.gz").read_bytes())
    for leg in (1, 2)
]


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
    )  # round-off is 0 beside a landing
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
    left = names[:1]
    states, follows = looks.new_states(left)
    assert not follows
    assert states is not None
    assert np.array_equal(states.time, open_run(left).history(Selection()).time)


def test_other_formats_are_read_as_a_whole_each_time() -> None:
    looks = Looks(Selection())
    sizes = [
        (states.time.size, follows)
        for states, follows in (looks.new_states([ENERGY]) for _ in range(2))
        if states
    ]
    assert len(sizes) == 2
    assert sizes[0] == sizes[1]
    assert not sizes[1][1]
    assert not looks.grow
