"""Times of force switches for planned windows, which the check of such switches reads back."""

import itertools
import math
from collections.abc import Sequence
from pathlib import Path

import pytest
from hypothesis import given, strategies as st

import d2rpick as d2
from d2rpick.base.errors import DeckError
from d2rpick.deck.contact_timing import Pushes, find_pair_timing, find_sensor_timing
from tests.command import MATSUM, put, read_refusal, run, run_json
from tests.sample_deck import DECK

PUSHES = Pushes(
    ((0.0, 0.01), (0.05, 0.06), (0.062, 0.07), (0.12, 0.13), (0.2, 0.21)), speed=3.0
)

BY_CONTACT = ("--solver", "ls-dyna-contact", "--contact", "7")


def flatten_windows(windows: Sequence[tuple[float, float]]) -> list[float]:
    return [time for window in windows for time in window]


def test_the_wait_lets_no_window_begin_before_it_is_planned() -> None:
    planned = [(0.02, 0.049), (0.08, 0.119)]
    pair = find_pair_timing(planned, PUSHES)
    assert [tr for tr, _ in pair.windows] == pytest.approx([0.02, 0.08])
    assert pair.earliest == 0.02
    assert 0.12 < pair.latest < 0.13  # in the contact after the last window
    sensor = find_sensor_timing(planned, PUSHES)
    assert sensor.wait == pytest.approx(0.01)
    assert flatten_windows(sensor.windows) == pytest.approx([0.02, 0.05, 0.08, 0.119])


def test_the_offset_is_what_the_parts_fly_from_td_to_the_contact() -> None:
    timing = find_pair_timing([(0.02, 0.049), (0.08, 0.117)], PUSHES)
    assert timing.offset == pytest.approx(3.0 * 0.001)
    assert [td for _, td in timing.windows] == pytest.approx([0.049, 0.119])
    assert find_pair_timing([(0.02, 0.049)], PUSHES._replace(speed=None)).offset == 0


def test_chatter_between_two_windows_is_waited_for() -> None:
    timing = find_sensor_timing([(0.013, 0.05), (0.0705, 0.12)], PUSHES)
    assert flatten_windows(timing.windows) == pytest.approx([0.013, 0.05, 0.073, 0.12])
    with pytest.raises(
        DeckError, match="no force-free time lets a sensor switch"
    ):  # the short gap from 0.06 to 0.062 contains no window
        find_sensor_timing([(0.011, 0.05), (0.0705, 0.12)], PUSHES)


def test_a_flight_without_a_window_is_left_out_by_a_pair_alone() -> None:
    planned = [(0.02, 0.049), (0.14, 0.199)]
    assert [tr for tr, _ in find_pair_timing(planned, PUSHES).windows] == pytest.approx(
        [0.02, 0.14]
    )
    with pytest.raises(
        DeckError, match=r"in the planned windows \(0.02 to 0.049, 0.14 to 0.199\)"
    ):
        find_sensor_timing(planned, PUSHES)


def test_without_a_contact_behind_it_a_pair_switches_nothing_back() -> None:
    with pytest.raises(DeckError, match="no force-free time lets a pair"):
        find_pair_timing([(0.22, 0.3)], PUSHES)
    assert flatten_windows(
        find_sensor_timing([(0.22, 0.3)], PUSHES).windows
    ) == pytest.approx([0.22, 0.3])


@given(st.lists(st.floats(0.5, 9.0), min_size=3, max_size=9), st.floats(0.0, 0.9))
def test_windows_after_every_contact_are_met_by_a_common_wait(
    gaps: list[float], share: float
) -> None:
    """Contacts of length 1 with gaps: each window begins at the same time after a contact and fills the gap."""
    starts = [sum(gaps[:at]) + at for at in range(len(gaps) + 1)]
    contacts = tuple((start, start + 1.0) for start in starts)
    wait = share * min(gaps)
    planned = [
        (end + wait, start) for (_, end), (start, _) in itertools.pairwise(contacts)
    ]
    timing = find_sensor_timing(planned, Pushes(contacts))
    assert flatten_windows(timing.windows) == pytest.approx(flatten_windows(planned))
    assert timing.wait == pytest.approx(wait, abs=1e-9)
    paired = find_pair_timing(planned, Pushes(contacts))
    assert [tr for tr, _ in paired.windows] == pytest.approx([tr for tr, _ in planned])
    assert not math.isinf(paired.latest)


@pytest.fixture(scope="module")
def falls(tmp_path_factory: pytest.TempPathFactory) -> str:
    path = str(tmp_path_factory.mktemp("falls") / "falls.matsum")
    assert (
        run(
            "rollover", "--drop", "0.4", "--mesh", "6", "--dt", "5e-4", "-o", path
        ).exit_code
        == 0
    )
    return path


def test_the_printed_pair_is_read_back_with_its_windows(
    falls: str, tmp_path: Path
) -> None:
    card = d2.plan(d2.read(falls), parts="box", replay=False, min_quality="poor").card(
        solver="ls-dyna-contact", contact=7
    )
    assert card is not None
    assert len(card.card.windows) == 2
    report = run_json(
        "check", str(put(tmp_path / "pair.k", card.card.text)), "--history", falls
    )
    read_windows = [(window["tr"], window["td"]) for window in report["windows"]]
    assert flatten_windows(read_windows) == pytest.approx(
        flatten_windows(card.card.windows), abs=1e-5
    )  # digits of the card


def test_the_printed_sensor_names_its_wait_and_wall(falls: str) -> None:
    options = {"solver": "radioss-contact", "wall": 3, "node": 1808, "end": 1.2}
    plan = d2.plan(d2.read(falls), parts="box", replay=False, min_quality="poor")
    card = plan.card(**options)  # type: ignore[arg-type]
    assert card is not None
    assert "/SENSOR/RWALL/" in card.card.starter
    assert f"{3:10d}{'NF':>10}" in card.card.starter
    assert list(card.card.sensors) == [1808]
    assert len(card.card.windows) == 2


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--solver", "ls-dyna-contact"), "needs one --contact, or one rigid --wall"),
        ((*BY_CONTACT, "--wall", "2"), "needs one --contact, or one rigid --wall"),
        (("--contact", "7"), "--contact is an option of --solver ls-dyna-contact"),
    ],
)
def test_what_pushes_has_to_be_named_once(
    falls: str, options: tuple[str, ...], message: str
) -> None:
    assert message in read_refusal(
        "plan", "-q", "--part", "box", "--no-verify", "-f", "card", *options, falls
    )


def test_without_momenta_nothing_shows_when_something_pushes() -> None:
    message = read_refusal(
        "card", "--tr", "0.02", "--td", "0.09", "--part", "1", *BY_CONTACT
    )
    assert "needs a history with the force of that contact or wall" in message


def test_the_parts_do_not_become_rigid_again_before_the_contact_that_the_offset_anticipates() -> (
    None
):
    timing = find_pair_timing([(0.02, 0.047)], PUSHES)
    assert flatten_windows(timing.windows) == pytest.approx([0.02, 0.047])
    assert 0.003 < timing.wait < 0.013  # ends in the contact from 0.05 to 0.06


def test_the_check_of_a_pair_with_an_offset_ends_and_finds_the_window_of_the_card(
    tmp_path: Path,
) -> None:
    """Before, the check followed the two sets step by step without end, and took all memory."""
    question = ("plan", MATSUM, "--part", "flying", "--deck", str(DECK), *BY_CONTACT)
    written = run(*question, "--write-deck", str(tmp_path / "next"))
    checked = " ".join(written.stdout.split()).partition(
        "rollover_box.k use with care"
    )[2]
    assert "parts 1, 2: rigid from 0.123689 to 0.37 (" in checked
    assert "D2R208" not in checked
