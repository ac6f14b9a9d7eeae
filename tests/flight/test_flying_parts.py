"""Parts by what they do: those that fly together, and all that deform."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pandas as pd
import pytest

import d2rpick as d2
from d2rpick.base.errors import FormatError
from d2rpick.flight.flying_parts import deformable_parts, flying_parts, with_parts_by_number
from d2rpick.histories.opening import Selection, open_run
from tests.command import BOX, ENERGY, GLSTAT, answer, run
from tests.computed import stored

if TYPE_CHECKING:
    from d2rpick.histories.opening import Run


def opened(name: str) -> Run:
    return open_run([name], Selection())


def titles(found: Run, *, flying: bool) -> set[str]:
    return {part.title for part in (flying_parts(found) if flying else deformable_parts(found))}


def test_the_box_and_the_step_on_it_fly_and_the_sled_does_not() -> None:
    assert titles(opened(BOX), flying=True) == {"box", "step"}
    found = answer("suggest", "--part", "flying", "--td", "0.37", BOX)
    assert found["history"]["parts"] == answer("suggest", "--part", "1,2", "--td", "0.37", BOX)["history"]["parts"]
    assert found["recommended"] == answer("suggest", "--part", "1,2", "--td", "0.37", BOX)["recommended"]


def test_all_parts_of_the_car_fly_but_the_ground() -> None:
    car = opened(stored("carT01.gz"))
    everything = titles(car, flying=False)
    assert "ground" not in everything
    assert len(everything) == 17
    assert titles(car, flying=True) == everything


def test_words_may_stand_beside_numbers_and_are_read_once() -> None:
    selection = with_parts_by_number(opened(BOX), Selection(parts=("box", "FLYING")))
    assert selection.parts == ("box", "1", "2")


@pytest.mark.parametrize("word", ["flying", "all"])
def test_files_without_parts_say_so(word: str) -> None:
    for name in (ENERGY, GLSTAT):
        result = run("suggest", "--part", word, "--td", "0.06", name)
        assert result.exit_code == 2
        assert "parts" in result.stderr
        assert result.stderr.count("\n") == 1


def test_a_table_has_no_parts_that_could_fly() -> None:
    table = pd.DataFrame({"time": [0.0, 1.0, 2.0], "internal_energy": [0.0, 4.0, 1.0]})
    with pytest.raises(FormatError, match="no parts"):
        flying_parts(d2.from_frame(table).files)


def test_every_command_takes_the_words() -> None:
    for command in (("info",), ("plan",), ("verify", "--tr", "0.1", "--td", "0.37")):
        assert run(*command, "-q", "--part", "flying", BOX).exit_code in (0, 1)
    assert "part_2" in run("extract", "-q", "--part", "all", BOX, "--write-as", "csv", "-o", "-").stdout
