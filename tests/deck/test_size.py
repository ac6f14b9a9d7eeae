"""Masses and stable steps of parts, against sizes worked out by hand."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from d2rpick.deck import ls_dyna, radioss
from d2rpick.deck.geometry import masses_and_steps
from d2rpick.deck.radioss_run import read_run
from tests.computed import starter, stored
from tests.deck.test_ls_dyna import row
from tests.decks import read

RHO, E, NU = 8000.0, 2.0e11, 0.25
SPEED = math.sqrt(E / RHO)
CARDS = f"*MAT_ELASTIC\n{1:10d}{RHO:10.1f}{E:10.2e}{NU:10.2f}\n"
PLACES = [(0, 0, 0), (2, 0, 0), (2, 1, 0), (0, 1, 0), (0, 0, 3), (2, 0, 3), (2, 1, 3), (0, 1, 3)]
NODES = "*NODE\n" + "".join(
    f"{n:8d}" + "".join(f"{float(x):16.4f}" for x in place) + "\n" for n, place in enumerate(PLACES, start=1)
)
SHELL = "*SECTION_SHELL\n         1         2\n      0.01      0.01      0.01      0.01\n"
IN_SHELLS = SPEED / math.sqrt(1 - NU**2)
IN_SOLIDS = SPEED * math.sqrt((1 - NU) / ((1 + NU) * (1 - 2 * NU)))


@pytest.mark.parametrize(
    ("section", "elements", "mass", "step"),
    [
        (SHELL, "*ELEMENT_SHELL\n" + row(1, 7, 1, 2, 3, 4), RHO * 2 * 0.01, 1 / IN_SHELLS),
        (SHELL, "*ELEMENT_SHELL\n" + row(1, 7, 1, 2, 3, 3), RHO * 0.01, 2 / math.sqrt(5) / IN_SHELLS),
        ("*SECTION_SOLID\n         1         2\n", "*ELEMENT_SOLID\n" + row(1, 7, *range(1, 9)), RHO * 6,
         1 / IN_SOLIDS),
        ("*SECTION_SOLID\n         1        10\n", "*ELEMENT_SOLID\n" + row(1, 7, 1, 2, 4, 5, 5, 5, 5, 5), RHO,
         3 / math.sqrt(49 / 4) / IN_SOLIDS),
        ("*SECTION_BEAM\n         1         2\n      0.05\n", "*ELEMENT_BEAM\n" + row(1, 7, 1, 2), RHO * 0.1,
         2 / SPEED),
    ],
)  # fmt: skip
def test_by_hand(tmp_path: Path, section: str, elements: str, mass: float, step: float) -> None:
    part = "*KEYWORD\n*PART\na\n" + row(7, 1, 1, width=10)
    found = masses_and_steps(ls_dyna.read(read(tmp_path, f"{part}{section}{CARDS}{NODES}{elements}*END\n")))
    assert list(found[7]) == pytest.approx([mass, step])


@pytest.mark.parametrize("lost", ["*MAT", "*SECTION", "*NODE"])
def test_what_is_not_in_the_deck_is_not_guessed(tmp_path: Path, lost: str) -> None:
    part = "*KEYWORD\n*PART\na\n" + row(7, 1, 1, width=10)
    text = f"{part}{SHELL}{CARDS}{NODES}*ELEMENT_SHELL\n{row(1, 7, 1, 2, 3, 4)}*END\n".replace(lost, "*OTHER")
    mass, step = masses_and_steps(ls_dyna.read(read(tmp_path, text)))[7]
    assert mass is None
    assert (step is None) == (lost != "*SECTION")


def test_masses_of_the_car_are_those_that_the_solver_printed(tmp_path: Path) -> None:
    (tmp_path / "CAR_0000.rad").write_bytes(starter("CAR"))
    found = masses_and_steps(radioss.read(read_run(str(tmp_path / "CAR_0000.rad"))))
    lines = Path(stored("car_parts.csv")).read_text("ascii").splitlines()
    head, *rows = (line.split(",") for line in lines)
    for cells in rows:
        one = dict(zip(head, cells, strict=True))
        mass, step = found[int(one["id"])]
        assert mass == pytest.approx(float(one["mass_kg"]), rel=1e-3)
        assert (
            step is None
            or step == pytest.approx(21.54e-6 / 0.9, rel=0.25)
            or one["part"] in ("engine", "battery", "wheels")
        )
