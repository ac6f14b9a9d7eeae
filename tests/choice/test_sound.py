"""Runs that cannot be judged: one that blew up, and one in which nothing has energy; and sound ones that look alike."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from d2rpick.choice.health import unsound
from d2rpick.histories.history import Balance, Given, History
from tests.command import answer, codes, run

if TYPE_CHECKING:
    from pathlib import Path

    from d2rpick.histories.history import Samples

TIME = np.linspace(0, 0.1, 201)
# A body that is shaken, and falls apart between two states at 0.03.
TORN = TIME > 0.03
INTERNAL = np.where(TORN, 8e3, 3 * TIME)
KINETIC = np.where(TORN, 1.5e13, 0.2 * np.sqrt(TIME))
LATE = TIME > 0.05


def record(internal: Samples, kinetic: Samples, **terms: Any) -> History:
    balance = Balance(TIME, internal=internal, kinetic=kinetic, **terms)
    return History(TIME, internal, ("made",), "made", "E", evidence=Given(balance=balance))


def said(history: History) -> list[str]:
    return [one.code for one in unsound(history)]


@pytest.mark.parametrize("terms", [{}, {"external_work": 4 * TIME}])
def test_a_run_that_gains_energy_from_nothing_blew_up(terms: dict[str, Samples]) -> None:
    (found,) = unsound(record(INTERNAL, KINETIC, **terms))
    assert found.code == "blew-up"
    assert "from 0.1" in found.message
    assert "its energy reaches 1.5e+13 at 0.0305" in found.message


@pytest.mark.parametrize(
    ("internal", "kinetic", "terms"),
    [
        # a load on a body that was at rest but for round-off, and one that hits a wall after a free fall
        (np.where(LATE, 40.0, 1e-13), np.where(LATE, 1e3, 1e-12), {}),
        (np.where(LATE, 200.0, 1e-18), np.where(LATE, 20.0, 220.0), {}),
        # a velocity that is given to all of it, at rest before or in the noise of a contact, does not deform it
        (np.where(LATE, 2e-9, 1e-9), np.where(LATE, 1e5, 1e-9), {}),
        (0 * TIME, np.where(LATE, 1e5, 1.9e-9), {}),
        (np.where(LATE, 1e-5, 0.0), np.where(LATE, 1e5, 1.9e-9), {}),
        # what external work explains, and a gain that a load may well have
        (INTERNAL, KINETIC, {"external_work": np.where(TORN, 1.5e13, TIME)}),
        (np.where(TORN, 8e3, 3 * TIME), np.where(TORN, 1e7, 0.2 * TIME), {}),
        # only the first states
        (np.where(TIME > 0.004, 8e3, 3 * TIME), np.where(TIME > 0.004, 1.5e13, TIME), {}),
    ],
)
def test_a_run_with_a_sudden_load_is_sound(internal: Samples, kinetic: Samples, terms: dict[str, Samples]) -> None:
    assert "blew-up" not in said(record(internal, kinetic, **terms))


def test_energies_of_nothing_are_nothing_to_judge() -> None:
    assert said(record(0 * TIME, 0 * TIME + 1.9e-9)) == ["nothing-to-judge"]
    assert said(record(1e-32 * TIME, 1e-31 * TIME)) == ["nothing-to-judge"]
    assert said(record(1e-18 + 0 * TIME, 225.0 * TIME)) == []  # a free fall deforms nothing yet
    assert said(History(TIME, 0 * TIME, ("made",), "made", "E")) == []  # of a column alone its energy is objected to


@pytest.fixture
def csv(tmp_path: Path) -> Any:
    def write(internal: Samples, kinetic: Samples) -> str:
        file, table = tmp_path / "run.csv", np.stack([TIME, internal, kinetic], axis=1)
        np.savetxt(file, table, "%.7g", ",", header="time,internal_energy,kinetic_energy", comments="")
        return str(file)

    return write


COMMANDS = (
    ("suggest",), ("suggest", "--td", "0.02"), ("suggest", "--td-window", "0.01", "0.02"), ("plan",), ("explore",),
    ("study", "--td", "0.02"),
)  # fmt: skip


@pytest.mark.parametrize("args", [*COMMANDS, ("verify", "--tr", "0.01", "--td", "0.02")])
def test_a_run_that_blew_up_is_refused_by_all(csv: Any, args: tuple[str, ...]) -> None:
    result = run(*args, csv(INTERNAL, KINETIC))
    assert result.exit_code == 2
    assert "run.csv: the run blew up: from 0.1" in result.stderr
    assert result.stderr.count("\n") == 1


@pytest.mark.parametrize("args", COMMANDS)
def test_where_nothing_deforms_nothing_is_chosen(csv: Any, args: tuple[str, ...]) -> None:
    result = run(*args, csv(0 * TIME, 0 * TIME + 1.9e-9))
    assert result.exit_code == 2
    assert "run.csv: nothing to judge: no internal energy exceeds 0, so nothing deforms" in result.stderr


@pytest.mark.parametrize(
    ("columns", "code"), [((INTERNAL, KINETIC), "blew-up"), ((0 * TIME, TIME), "nothing-to-judge")]
)
def test_info_tells_it_and_lists_no_flight(csv: Any, columns: tuple[Samples, Samples], code: str) -> None:
    found = answer("info", csv(*columns))
    assert code in codes(found)
    assert found["flights"] == []
