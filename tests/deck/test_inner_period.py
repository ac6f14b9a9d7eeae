"""The longest period of masses on springs: values of a closed form, and cases in which it is unknown."""

import math
from pathlib import Path

import pytest
from hypothesis import given, settings, strategies as st

from d2rpick.deck import read_inventory
from d2rpick.deck.pieces import find_inner_period
from tests.command import put
from tests.decks import pad
from tests.sprung import DENSITY, write_cubes


def find_period(folder: Path, deck: str) -> tuple[float, ...] | None:
    name = put(folder / "box_0000.rad", deck)
    inner = find_inner_period(read_inventory(str(name)))
    return inner and inner[:2]


@settings(max_examples=15)
@given(
    masses=st.lists(st.floats(1.0, 8.0), min_size=2, max_size=2),
    stiffness=st.lists(st.floats(1e3, 1e6), min_size=1, max_size=3),
)
def test_two_masses_on_parallel_springs(
    tmp_path_factory: pytest.TempPathFactory,
    masses: list[float],
    stiffness: list[float],
) -> None:
    """All springs act along x, so the period and its lower limit equal the closed form of two masses."""
    first_mass, second_mass = masses
    expected = (
        2
        * math.pi
        * math.sqrt(
            first_mass * second_mass / (first_mass + second_mass) / sum(stiffness)
        )
    )
    periods = find_period(
        tmp_path_factory.mktemp("deck"),
        write_cubes((first_mass, second_mass), [(10, 20, k) for k in stiffness]),
    )
    assert periods is not None
    assert periods == pytest.approx((expected, expected))


def test_the_longest_of_several_counts_and_light_pieces_do_not(tmp_path: Path) -> None:
    deck = write_cubes((5.0, 5.0, 0.01), [(10, 20, 1e6), (20, 30, 1.0)])
    periods = find_period(tmp_path, deck)
    assert periods
    assert (
        periods[0] < 1
    )  # [s]; the light mass on its soft spring has a period of 0.6 s
    softer = find_period(
        tmp_path, write_cubes((5.0, 5.0, 0.01), [(10, 20, 1e6), (20, 30, 0.1)])
    )
    assert softer == pytest.approx(periods, rel=1e-5)
    heavier = find_period(
        tmp_path, write_cubes((5.0, 5.0, 1.0), [(10, 20, 1e6), (20, 30, 1.0)])
    )
    assert heavier
    assert heavier[0] > 1


def test_springs_at_an_angle_make_a_bracket(tmp_path: Path) -> None:
    """Two springs k at an angle have k (1 + cos) in their stiffest direction; no direction has more than 2 k."""
    side, stiffness = 2.0, 1e5
    mass = DENSITY * side**3
    periods = find_period(
        tmp_path, write_cubes((mass, mass), [(10, 20, stiffness), (10, 23, stiffness)])
    )
    angle = math.atan(side / 10)
    both = (
        2 * math.pi * math.sqrt(mass / 2 / stiffness / share)
        for share in (1 + math.cos(angle), 2)
    )
    assert periods == pytest.approx(tuple(both))


@pytest.mark.parametrize(
    "deck",
    [
        write_cubes((5.0, 5.0), []),
        write_cubes((5.0, 5.0), [(10, 20, 0.0)]),
        write_cubes((5.0, 5.0), [(10, 20, 1e5)], prop="SPR_GENE"),
        write_cubes((5.0, 5.0), [(10, 20, 1e5)], extra_text=pad(7)),
        write_cubes((5.0, 5.0), [(10, 20, 1e5)]).replace(
            "/END", "#include other.inc\n/END"
        ),
        write_cubes((5.0, 5.0), [(10, 20, 1e5)]).replace(
            f"{DENSITY:>20}", f"{0.0:>20}"
        ),
    ],
    ids=[
        "no springs",
        "no stiffness",
        "another kind",
        "by a function",
        "not whole",
        "no density",
    ],
)
def test_what_the_deck_does_not_give_is_not_guessed(tmp_path: Path, deck: str) -> None:
    assert find_period(tmp_path, deck) is None
