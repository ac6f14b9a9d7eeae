"""Radioss T01: computed runs against other readings, and made files of every age."""

from __future__ import annotations

import numpy as np
import pytest

from d2rpick.errors import FormatError
from d2rpick.histories.formats.radioss_th import TimeHistory, recognises
from tests.command import BOX, ROLLOVER
from tests.computed import stored, unpacked
from tests.made_t01 import MadePart, T01Writer, t01, value


def opened(made: T01Writer | bytes) -> TimeHistory:
    return TimeHistory(bytes(made.data) if isinstance(made, T01Writer) else made, "runT01")


@pytest.mark.parametrize("path", [BOX, stored("rollover_r100_T02.gz"), stored("chain_referenceT01.gz")])
def test_energies_of_the_parts_add_up_to_that_of_the_model(path: str) -> None:
    run = opened(unpacked(path))
    total = run.part_channel("internal_energy", [part.id for part in run.parts]).sum(axis=1)
    np.testing.assert_allclose(total, run.channel("internal_energy"), atol=1e-6 * total.max())


def test_the_rollover_agrees_with_the_table_of_its_makers() -> None:
    """rollover_ref.csv was made apart from these files: seven digits of energies, parts box and step."""
    run = opened(unpacked(BOX))
    table = np.genfromtxt(ROLLOVER, delimiter=",", names=True)
    at = np.searchsorted(run.time, table["time_s"] - 1e-7)
    box = run.part_channel("internal_energy", [1])[at, 0]
    close = np.abs(run.time[at] - table["time_s"]) < 2e-6
    assert close.sum() > 500
    np.testing.assert_allclose(box[close], table["boxIE_J"][close], rtol=1e-4, atol=1e-3)


def test_legs_follow_one_another() -> None:
    legs = [opened(unpacked(stored(f"rollover_r100_T0{leg}.gz"))) for leg in (1, 2, 3)]
    assert [leg.time.size for leg in legs] == [201, 541, 161]
    assert (np.diff(np.concatenate([leg.time for leg in legs])) > 0).all()


@pytest.mark.parametrize("globals_", [0, 12, 16, 22, 25])
@pytest.mark.parametrize(("code", "title"), [(3040, 40), (3041, 80), (3050, 80), (4021, 100)])
def test_any_age_of_the_format(globals_: int, code: int, title: int) -> None:
    run = opened(t01(5, globals_=globals_, code=code, title=title))
    assert run.time.tolist() == [state / 8 for state in range(5)]
    assert (run.title, run.version) == ("made for tests", "Fri Nov 20 23:34:18 2026 RADIOSS OpenRadioss, linuxa64 gf")
    assert len(run.channels) == globals_
    for number, name in enumerate(run.channels, start=1):
        assert run.channel(name).tolist() == [value(state, 0, number) for state in range(5)]
    for number, name in ((1, "internal_energy"), (5, "z_momentum"), (7, "hourglass_energy")):
        assert run.part_channel(name, [12, 3]).tolist() == [
            [value(s, id_, number) for id_ in (12, 3)] for s in range(5)
        ]


def test_a_group_of_elements_is_no_part_and_its_energy_not_counted_twice() -> None:
    run = opened(t01(2, [MadePart(1, "box"), MadePart(1, "half of the box", is_group=True)]))
    assert [(part.id, part.title) for part in run.parts] == [(1, "box")]
    assert run.part_channel("internal_energy", [1])[:, 0].tolist() == [value(s, 1, 1) for s in range(2)]


def test_a_part_without_variables_is_noted_and_refused() -> None:
    run = opened(t01(2, [MadePart(1, "box"), MadePart(2, "step", codes=())]))
    assert [part.id for part in run.parts] == [1]
    assert any("no variables of part 2 in the file" in note for note in run.notes)
    with pytest.raises(FormatError, match="no internal_energy of part 2, parts with variables: 1;"):
        run.part_channel("internal_energy", [2])


def test_a_variable_that_was_not_asked_for_is_refused() -> None:
    run = opened(t01(2, [MadePart(1, "box", codes=(1, 2))]))
    with pytest.raises(FormatError, match="no x_momentum of part 1, only internal_energy, kinetic_energy;"):
        run.part_channel("x_momentum", [1])
    with pytest.raises(FormatError, match="no global heat, there are internal_energy"):
        run.channel("heat")


def test_control_bytes_in_titles_are_blanks() -> None:
    made = bytes(t01(1, [MadePart(1, "box")]).data).replace(b"box ", b"b\nx\0")
    assert opened(made).parts[0].title == "b x"


def test_no_states_is_a_legal_file() -> None:
    run = opened(t01(0))
    assert run.time.shape == (0,)
    assert run.complete


@pytest.mark.parametrize("head", [b"", b"\0\0\0T", b"time,internal energy\n0,0\n"])
def test_something_else_is_not_recognised_and_refused(head: bytes) -> None:
    assert not recognises(head)
    with pytest.raises(FormatError, match="was expected in the head of the time history"):
        opened(head)
