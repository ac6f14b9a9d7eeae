"""Switch sets with CODE 5: what their *SENSOR_CONTROL does, given the time and the forces in a history."""

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, strategies as st

from d2rpick.deck.ls_dyna_sensors import follow_control, read_controls
from d2rpick.deck.reader import read_deck
from d2rpick.rules.example import HEAD, PARTS, make_deck, write_automatic_card
from tests.command import put, read_refusal, run, run_json
from tests.rules.test_by_force import list_windows

END = 1.0

TIMES = np.arange(0.0, END + 5e-3, 0.01)
CONTACT = (
    "*CONTACT_AUTOMATIC_SURFACE_TO_SURFACE_ID\n"
    "         7     floor\n"
    "         8\n*CONTACT_AUTOMATIC_SURFACE_TO_SURFACE_ID\n         8      wall\n"
)
SET = write_automatic_card(20, "0.0", rigid=["1"], code=5)


def flat(found: dict[str, object]) -> list[float | None]:
    """List all ends of the windows."""
    return [time for pair in list_windows(found) for time in pair]


def control(switches: str, initial: str = "OFF", repeats: int = 0) -> str:
    """Write the control of set 20; ``switches`` are numbers between spaces."""
    first = f"{5:10d}{'DEF2RIG':>10}{20:10d}{0:10d}{repeats:10d}\n"
    numbers = "".join(f"{number:>10}" for number in switches.split())
    return f"*SENSOR_CONTROL\n{first}{initial:>10}{numbers}\n"


def by_time(number: int, logic: str, value: float, delay: float = 0.0) -> str:
    row = f"{number:10d}{'TIME':>10}{'':10}{logic:>10}{value:10g}{0:10d}{0.0:10g}{delay:10g}\n"
    return f"*SENSOR_SWITCH\n{row}"


def by_force(
    number: int, logic: str, value: float, duration: float = 0.0, sensor: int = 3
) -> str:
    row = f"{number:10d}{'SENSOR':>10}{sensor:10d}{logic:>10}{value:10g}{0:10d}{duration:10g}\n"
    return f"*SENSOR_SWITCH\n{row}"


def force_of(kind: str = "CONTACT", entity: int = 7, direction: str = "M") -> str:
    return f"*SENSOR_DEFINE_FORCE\n{3:10d}{kind:>10}{entity:10d}{direction:>10}\n"


def write(folder: Path, *cards: str, switch_set: str = SET) -> str:
    text = make_deck("".join(cards) + CONTACT + switch_set).deck.replace(
        "       0.2", f"{END:10g}", 1
    )
    return str(put(folder / "main.k", text))


def history(place: Path, spans: list[tuple[float, float]]) -> str:
    """Write a run in which contact 7 pushes in some spans, and contact 8 all the time."""
    from tests.text_files import make_glstat_text

    acts = np.zeros(TIMES.size, bool)
    for start, end in spans:
        acts |= (start < TIMES) & (end > TIMES)
    lines = [
        f" {side:<8} {contact:6d} time {time:11.5E}  x {0:11.5E} y {0:11.5E} z {sign * force:11.5E} mass {0:11.5E}\n"
        for time, pushes in zip(TIMES, acts, strict=True)
        for contact, force in ((7, 3.0 * pushes), (8, 5.0))
        for side, sign in (("slave", 1), ("master", -1))
    ]
    folder = place / "run"
    folder.mkdir()
    (folder / "rcforc").write_text(" made for tests\n\n" + "".join(lines))
    (folder / "glstat").write_bytes(
        make_glstat_text(TIMES, 1 + np.sin(40 * TIMES) ** 2)
    )
    return str(folder)


def test_a_control_by_time_needs_no_history(tmp_path: Path) -> None:
    cards = control("1 2") + by_time(1, "GT", 0.2) + by_time(2, "GT", 0.5, delay=0.1)
    check_report = run_json("check", write(tmp_path, cards))
    assert flat(check_report) == pytest.approx([0.2, 0.6])
    timing_finding = next(
        finding for finding in check_report["findings"] if finding["rule"] == "D2R302"
    )
    assert "off at 0, on at 0.2, off at 0.6" in timing_finding["message"]


def test_a_control_that_begins_on_is_rigid_from_the_start(tmp_path: Path) -> None:
    cards = control("1", initial="ON") + by_time(1, "GT", 0.3)
    assert list_windows(run_json("check", write(tmp_path, cards))) == [(0.0, 0.3)]
    assert list_windows(run_json("check", write(tmp_path, control("", "ON")))) == [
        (0.0, None)
    ]


def test_a_control_by_force_follows_its_contact_among_others(tmp_path: Path) -> None:
    folder = history(tmp_path, [(0.1, 0.2), (0.5, 0.6), (0.605, 0.7)])
    cards = control("1 2", repeats=-1) + force_of()
    cards += by_force(1, "LT", 1e-3, duration=0.05) + by_force(2, "GT", 1e-3)
    check_report = run_json("check", write(tmp_path, cards), "--history", folder)
    assert flat(check_report) == pytest.approx(
        [0.05, 0.105, 0.245, 0.505, 0.745, None], abs=0.011
    )
    assert list_windows(run_json("check", write(tmp_path, cards))) == []


def test_a_set_by_time_may_be_undone_by_a_sensor(tmp_path: Path) -> None:
    folder = history(tmp_path, [(0.5, 0.6)])
    sets = write_automatic_card(10, "0.1", rigid=["1"]) + write_automatic_card(
        20, "0.0", deformable=["1"], code=5
    )
    cards = control("1") + by_force(1, "GT", 1.0) + force_of()
    check_report = run_json(
        "check", write(tmp_path, cards, switch_set=sets), "--history", folder
    )
    assert flat(check_report) == pytest.approx([0.1, 0.505], abs=0.006)


def test_a_pair_waits_for_the_force_of_its_own_contact(tmp_path: Path) -> None:
    """No momenta are written, and contact 8 never ends."""
    folder = history(tmp_path, [(0.1, 0.2), (0.5, 0.6)])
    found = {}
    for contact in (7, 8):
        rigid_card = write_automatic_card(20, "0.0", rigid=["1"], code=2, pair=(21, 1))
        back = write_automatic_card(21, "0.0", deformable=["1"], code=4, pair=(20, -1))
        pair = "".join(
            text.replace("0.0         0", f"0.0{contact:10d}", 1)
            for text in (rigid_card, back)
        )
        path = write(tmp_path, switch_set=pair)
        found[contact] = run_json("check", path, "--history", folder)
    assert flat(found[7]) == pytest.approx(
        [0.0, 0.105, 0.195, 0.505, 0.595, None], abs=0.011
    )
    assert list_windows(found[8]) == []
    by_history = "by the contact forces of the history"
    for contact, text in (
        (7, f"5 times {by_history}, first at 0"),
        (8, f"0 times {by_history}"),
    ):
        messages = [finding["message"] for finding in found[contact]["findings"]]
        assert any(text in message for message in messages)


def test_a_contact_whose_force_triggers_no_switch_is_not_followed(
    tmp_path: Path,
) -> None:
    folder = history(tmp_path, [(0.1, 0.2), (0.5, 0.6)])
    rigid_card = write_automatic_card(20, "0.0", rigid=["1"], code=2).replace(
        "0.0         0", f"0.0{7:10d}", 1
    )
    path = Path(write(tmp_path, switch_set=rigid_card))
    path.write_text(path.read_text().replace("SURFACE_TO_SURFACE", "GENERAL"))
    check_report = run_json("check", str(path), "--history", folder)
    assert list_windows(check_report) == []
    assert "D2R008" in {finding["rule"] for finding in check_report["findings"]}


def test_a_card_is_timed_by_the_force_of_the_named_contact(tmp_path: Path) -> None:
    """The printed pair switches in the planned window when it is read back with the same history."""
    run_folder = history(tmp_path, [(0.1, 0.2), (0.5, 0.6)])
    card = ("card", "--tr", "0.25", "--td", "0.45", "--part", "1", "--no-deck")
    options = ("--solver", "ls-dyna-contact", "--history", run_folder)
    printed = run(*card, *options, "--contact", "7")
    assert "after the end of the flight" not in printed.stderr  # it ends at the contact
    path = write(tmp_path, switch_set=printed.stdout)
    assert flat(run_json("check", path, "--history", run_folder)) == pytest.approx(
        [0.25, 0.505], abs=0.006
    )  # no momenta show a speed, so there is no OFFSET
    message = read_refusal(*card, *options, "--contact", "9")
    assert "needs a history with the force of that contact" in message


@pytest.mark.parametrize(
    ("cards", "why"),
    [
        (control("1"), "switch 1, which the deck has not"),
        (control("1") + by_force(1, "GT", 0.0), "sensor 3, which the deck has not"),
        (
            control("1") + by_force(1, "GT", 0.0) + force_of("JOINT"),
            "sensor 3 (*SENSOR_DEFINE_FORCE), which is not followed",
        ),
        (
            control("1") + by_force(1, "GT", 0.0) + force_of(direction="Z"),
            "only a magnitude (VID M) is followed",
        ),
        (
            control("1") + by_force(1, "GT", 0.0) + force_of(),
            "of contact 7), whose force no history shows",
        ),
        (control("1", initial="3"), "INITSTT is '3'"),
        (
            control("1 2", repeats=-1) + by_time(1, "GT", 0.1) + by_time(2, "GT", 0.1),
            "hold at the same time",
        ),
    ],
)
def test_what_is_not_followed_is_named(cards: str, why: str, tmp_path: Path) -> None:
    check_report = run_json("check", write(tmp_path, cards))
    assert list_windows(check_report) == []
    messages = [
        finding["message"]
        for finding in check_report["findings"]
        if finding["rule"] == "D2R302"
    ]
    assert why in messages[0]
    assert "not judged by time" in messages[0]


@given(
    times=st.lists(st.integers(1, 99), min_size=1, max_size=7, unique=True),
    begins_on=st.booleans(),
)
def test_switches_of_time_have_their_turns(
    tmp_path_factory: pytest.TempPathFactory, times: list[int], begins_on: bool
) -> None:
    """A switch whose time has passed when its turn comes acts at once, so the changes are at the running maximum."""
    cards = control(
        " ".join(str(number + 1) for number in range(len(times))),
        "ON" if begins_on else "OFF",
    )
    cards += "".join(
        by_time(number + 1, "GT", time / 100) for number, time in enumerate(times)
    )
    path = str(put(tmp_path_factory.mktemp("deck") / "main.k", HEAD + PARTS + cards))
    deck = read_deck(path)
    (only,) = read_controls(deck)
    changes = follow_control(deck, only, None, math.inf)
    assert not isinstance(changes, str)
    latest = [0.0, *np.maximum.accumulate(times).tolist()]
    assert [change.time for change in changes] == pytest.approx(
        [time / 100 for time in latest]
    )
    on = [begins_on != bool(index % 2) for index in range(len(latest))]
    assert [change.on for change in changes] == on
