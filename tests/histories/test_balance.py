"""Energy of springs and dampers: found if energies add up, and left out of the level unless it is the only energy."""

from dataclasses import dataclass, field

import numpy as np
import pytest

from d2rpick.choice.answers import suggest_in_history
from d2rpick.choice.question import Settings
from d2rpick.histories.balance import find_spring_energy, find_springs
from d2rpick.histories.history import Samples
from d2rpick.histories.names import Part
from d2rpick.histories.opening import Selection, open_run
from tests.computed import locate_stored
from tests.energies import require
from tests.reading import read

TIME = np.linspace(0.0, 1.0, 50)
PARTS = tuple(Part(i + 1, f"part {i + 1}") for i in range(4))
ENERGIES = np.stack(
    [np.sin(TIME) ** 2, 2 * np.cos(3 * TIME) ** 2, TIME, 1 - np.exp(-TIME)], axis=1
)

CAR = locate_stored("carT01.gz")


@dataclass
class Made:
    """A database with two energies of the whole model."""

    springs: Samples
    whole: Samples = field(default_factory=lambda: ENERGIES.sum(axis=1))
    format: str = "glstat"
    time: Samples = field(default_factory=lambda: TIME)
    energy_channel = "internal energy"
    channels = ("kinetic energy", "internal energy", "spring and damper energy")

    def channel(self, name: str) -> Samples:
        return self.springs if name.startswith("spring") else self.whole


def find_spring_ids(database: Made, energies: Samples = ENERGIES) -> tuple[int, ...]:
    return tuple(part.id for part in find_springs([database], PARTS, energies, TIME))  # type: ignore[list-item]


def test_the_parts_that_add_up_to_the_energy_of_the_springs_are_springs() -> None:
    assert find_spring_ids(Made(ENERGIES[:, [1, 3]].sum(axis=1))) == (2, 4)
    printed = np.array([[float(f"{value:.4e}") for value in row] for row in ENERGIES])
    assert find_spring_ids(Made(ENERGIES[:, 2]), printed) == (3,)


def test_where_nothing_adds_up_no_part_is_taken_for_a_spring() -> None:
    assert find_spring_ids(Made(0.5 * ENERGIES[:, 0])) == ()
    assert (
        find_spring_ids(Made(ENERGIES[:, 0] + 0.1)) == ()
    )  # a spring without its own history
    assert (
        find_spring_ids(Made(np.full(TIME.size, 1e-20))) == ()
    )  # LS-DYNA prints 1e-20 for zero
    assert (
        find_spring_ids(Made(ENERGIES[:, 3], whole=0.5 * ENERGIES[:, 3])) == ()
    )  # more than the energy of all parts
    assert (
        find_spring_ids(Made(ENERGIES[:, 0], format="csv")) == ()
    )  # in a table, the name may mean something else
    twins = ENERGIES[:, [0, 0, 2, 3]]
    assert find_spring_ids(Made(twins[:, 0], whole=twins.sum(axis=1)), twins) in (
        (),
        (1,),
        (2,),
    )


def test_springs_that_have_all_of_the_energy_are_what_there_is() -> None:
    assert find_spring_energy(Made(ENERGIES.sum(axis=1))) is None  # type: ignore[arg-type]


def test_the_springs_of_the_car_are_known_and_left_out_of_the_level() -> None:
    run = open_run([CAR], Selection())
    assert [part.title for part in run.springs] == ["mounts", "suspension", "latches"]
    whole, parts, body = (
        read([CAR], Selection(parts=p)).history for p in ((), ("1-17",), ("1-14",))
    )
    assert whole.channel == "internal_energy - spring_energy"
    np.testing.assert_allclose(parts.energy, body.energy)
    np.testing.assert_allclose(whole.energy, body.energy, rtol=1e-5, atol=1e-3)
    assert (
        len(require(parts.parts)) == 17
    )  # the springs are switched although their energy is left out
    assert [
        note
        for note in parts.notes
        if "mounts, suspension, latches was left out" in note
    ]
    answer = suggest_in_history(parts, 0.1464, Settings())
    assert require(answer.recommended).tr == pytest.approx(
        0.0386, abs=5e-4
    )  # with the springs the result is 0.0496 or, at another td, 0.0824


def test_what_is_asked_for_by_name_is_taken_as_it_is() -> None:
    history = read([CAR], Selection(energy=("internal_energy",))).history
    assert history.channel == "internal_energy"
    only = read([CAR], Selection(parts=("15-17",))).history
    assert only.energy[-1] == pytest.approx(2407.6, rel=1e-4)
    assert not only.springs


def test_parts_that_are_said_to_be_springs_are() -> None:
    run = open_run([CAR], Selection())
    history = run.history(Selection(parts=("12-15",), springs=("15",)))
    assert [part.id for part in history.springs] == [15]
    none = run.history(Selection(parts=("12-15",), springs=()))
    assert none.energy[-1] > history.energy[-1] + 100
