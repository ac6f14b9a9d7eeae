"""Times with a unit as arguments of Python: converted to the unit of the run, or refused with the numbers to give."""

import shutil
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

import d2rpick as d2
from d2rpick.deck import find_time_unit
from tests.command import ENERGY, ROOT, read_refusal, run

if TYPE_CHECKING:
    from d2rpick.api.arguments import Time

SIZES = {"s": 1.0, "ms": 1e-3}


def write_in(folder: Path, unit: str) -> str:
    """Write the history of the oscillator with times in a unit that the column names."""
    time, energy = np.loadtxt(
        ENERGY, delimiter=",", skiprows=1, usecols=(0, 5), unpack=True
    )
    numbers = np.column_stack([np.round(time / SIZES[unit], 9), energy])
    name = str(folder / f"energy_{unit}.csv")
    head = f"time_{unit},internal_energy"
    np.savetxt(name, numbers, delimiter=",", header=head, comments="")
    return name


def drop_command(answer: Any) -> dict[str, Any]:
    """Return an answer as a dictionary."""
    return {
        name: value for name, value in answer.to_dict().items() if name != "command"
    }


@pytest.mark.parametrize("unit", SIZES)
@pytest.mark.parametrize("typed", ["64ms", "0.064 s", "64000us"])
def test_a_text_is_the_number_in_the_unit_of_the_run(
    tmp_path: Path, unit: str, typed: str
) -> None:
    run = d2.read(write_in(tmp_path, unit))
    number = 0.064 if unit == "s" else 64.0
    assert drop_command(d2.suggest(run, td=typed)) == drop_command(
        d2.suggest(run, td=number)
    )


@pytest.mark.parametrize(
    ("function", "typed", "numbers"),
    [
        (
            d2.verify,
            {"tr": "13.5867ms", "td": "68.7534ms"},
            {"tr": 0.0135867, "td": 0.0687534},
        ),
        (d2.suggest, {"td_window": ("60ms", 0.07)}, {"td_window": (0.06, 0.07)}),
        (
            d2.explore,
            {"td": "64ms", "td_window": ["60ms", "70ms"], "steps": 5},
            {"td": 0.064, "td_window": (0.06, 0.07), "steps": 5},
        ),
        (d2.plan, {"min_rigid": "10ms"}, {"min_rigid": 0.01}),
        (
            d2.suggest,
            {"td": "64ms", "after": "2ms", "landing": "0.14s", "margin": "500us"},
            {"td": 0.064, "after": 0.002, "landing": 0.14, "margin": 0.0005},
        ),
        (
            d2.suggest,
            {"td": 0.064, "fit_window": ("10ms", "60ms")},
            {"td": 0.064, "fit_window": (0.01, 0.06)},
        ),
    ],
)
def test_each_time_of_a_function_may_have_its_unit(
    tmp_path: Path, function: Any, typed: dict[str, Any], numbers: dict[str, Any]
) -> None:
    run = d2.read(write_in(tmp_path, "s"))
    assert drop_command(function(run, **typed)) == drop_command(
        function(run, **numbers)
    )


def test_windows_that_an_iterator_gives_may_have_their_units() -> None:
    windows: list[tuple[Time, Time]] = [("20ms", "0.09s")]
    with pytest.raises(ValueError, match="known from the arguments, which contain no"):
        d2.card(iter(windows), parts=11)


def test_a_card_takes_the_unit_of_its_run(tmp_path: Path) -> None:
    run = d2.read(write_in(tmp_path, "ms"))
    cards = [
        d2.card([window], parts=1, run=run)
        for window in (("13586.7us", "0.0687534s"), (13.5867, 68.7534))
    ]
    assert str(cards[0]) == str(cards[1])


def test_a_study_takes_the_unit_that_all_its_runs_have(tmp_path: Path) -> None:
    names = [write_in(tmp_path, unit) for unit in SIZES]
    typed = d2.study(names[:1], td="64ms", margin="1ms")
    assert drop_command(typed) == drop_command(
        d2.study(names[:1], td=0.064, margin=0.001)
    )
    with pytest.raises(ValueError, match=r"give 0\.064 if it is s, 64 if it is ms"):
        d2.study(names, td="64ms")


def test_without_a_unit_of_the_run_both_numbers_are_named() -> None:
    with pytest.raises(ValueError, match="unit of time is not known") as raised:
        d2.suggest(d2.read(ENERGY), td="64ms")
    assert str(raised.value) == (
        f"td: '64ms': the unit of time is not known from {ENERGY}; "
        "give 0.064 if it is s, 64 if it is ms"
    )
    with pytest.raises(ValueError, match=r"^landing: '64ms': the unit"):
        d2.suggest(d2.read(ENERGY), td=0.064, landing="64ms")


def test_limits_and_kinds_hold_for_texts_too(tmp_path: Path) -> None:
    run = d2.read(write_in(tmp_path, "ms"))
    with pytest.raises(ValueError, match="margin is -1, but a number of at least 0"):
        d2.suggest(run, td=64, margin="-1ms")
    no_time: Any = "1ms"
    with pytest.raises(
        TypeError, match="tolerance is '1ms', but a number was expected"
    ):
        d2.suggest(run, td=64, tolerance=no_time)
    with pytest.raises(TypeError, match="td is '64mm', but a number was expected"):
        d2.suggest(run, td="64mm")


PLATE = ROOT / "sample_data" / "falling_plate"


def copy_plate(folder: Path, of_deck: str, of_run: str) -> str:
    """Copy the deck of the falling plate with these units of time in /BEGIN, or without units if the text is empty."""
    shutil.copytree(PLATE, folder)
    starter = folder / "plate_0000.rad"
    text = starter.read_text()
    if of_deck:
        units = "".join(
            f"{'kg':>20}{'m':>20}{unit:>20}\n" for unit in (of_deck, of_run)
        )
        text = text.replace(
            "      2022         0\n", f"      2022         0\n{units}", 1
        )
    starter.write_text(text)
    return str(starter)


@pytest.mark.parametrize(
    ("units", "unit", "wait"),
    [(("s", "s"), "s", 2e-7), (("ms", "ms"), "ms", 2e-4), (("mus", "mus"), "us", 0.2)],
)
def test_a_first_run_takes_the_unit_of_its_deck(
    tmp_path: Path, units: tuple[str, str], unit: str, wait: float
) -> None:
    deck = copy_plate(tmp_path / "run", *units)
    assert find_time_unit(deck) == unit
    written = d2.first(deck, tmp_path / "first", parts=1, wait="0.0002ms")
    assert written.wait == pytest.approx(wait)
    by_number = d2.first(deck, tmp_path / "second", parts=1, wait=wait)
    for name, same in zip(written.files, by_number.files, strict=True):
        assert Path(name).read_bytes() == Path(same).read_bytes()
    words = ("first", "--part", "1", "--wait", "0.0002ms")
    typed = (*words, deck, "-o", str(tmp_path / "3"))
    assert run(*typed).exit_code == 0


@pytest.mark.parametrize("units", [("", ""), ("s", "ms")])
def test_a_deck_that_names_no_unit_or_two_gives_the_numbers(
    tmp_path: Path, units: tuple[str, str]
) -> None:
    deck = copy_plate(tmp_path / "run", *units)
    assert find_time_unit(deck) == ""
    expected = (
        "the unit of time is not known from .*; give 0.02 if it is s, 20 if it is ms"
    )
    for name in ("wait", "after"):
        times: Any = {"wait": 1.0, name: "20ms"}
        with pytest.raises(ValueError, match=expected):
            d2.first(deck, tmp_path / "first", parts=1, **times)
    assert not (tmp_path / "first").exists()
    drive = ("drive", deck, "--part", "1", "--wait", "20ms", "-o", str(tmp_path / "d"))
    assert "give 0.02 if it is s" in read_refusal(*drive)


def test_a_followed_run_takes_the_unit_of_its_deck() -> None:
    history = str(ROOT / "sample_data" / "rolloverT01.gz")
    flying_box = str(ROOT / "sample_data" / "flying_box" / "BOX_0000.rad")
    typed, numbers = (
        [*d2.follow(history, wait=wait, deck=flying_box, lasting=0)]
        for wait in ("400ms", 0.4)
    )
    assert typed == numbers
    with pytest.raises(ValueError, match="no deck is given; give 0"):
        d2.follow(history, wait="5ms", lasting=0)


def test_the_end_of_a_card_of_an_answer_has_the_unit_of_its_run(tmp_path: Path) -> None:
    answer = d2.suggest(d2.read(write_in(tmp_path, "ms")), td="68.7534ms")
    options: Any = {"solver": "radioss", "node": 1001}
    typed, number = (answer.card(end=end, **options) for end in ("0.15s", 150.0))
    assert typed is not None
    assert number is not None
    assert typed.card.text == number.card.text
    plan = d2.plan(d2.read(write_in(tmp_path, "ms")))
    planned = plan.card(end="0.15s", **options)
    assert planned is not None
    assert "150.0" in planned.card.text
    without = d2.suggest(d2.read(ENERGY), td=0.0687534)
    with pytest.raises(ValueError, match=r"give 0\.15 if it is s, 150 if it is ms"):
        without.card(end="150ms", **options)
