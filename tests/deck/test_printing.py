"""Printed cards: numbers in columns, windows that follow each other, LS-DYNA cards and Radioss engine files."""

import json
import re
from pathlib import Path

import pytest
from hypothesis import given, strategies as st

from d2rpick.api.arguments import read_windows
from d2rpick.base.errors import DeckError
from d2rpick.deck.printed_card import (
    LONGEST,
    PrintedCard,
    Printing,
    refuse_overlapping_windows,
    write_number,
)
from d2rpick.deck.printing import SOLVERS, find_solver, print_cards
from d2rpick.histories.formats import READERS
from d2rpick.rules import check_deck
from tests.command import read_refusal, run
from tests.decks import count_findings, list_spans, read, write

TIMES = st.floats(1e-9, 1e9)
# A contact force acts from the end of each window in the test to the next window.
ALL = Printing(
    part=(11,),
    node=(1001,),
    end=1e6,
    contact=3,
    pushed=((0.09, 0.2), (0.3, 0.5), (0.75, 0.8)),
)

PARTS = Printing(part=(11, 12))
MERGED = PARTS._replace(merge=11)
CARD = """\
*DEFORMABLE_TO_RIGID_AUTOMATIC
$#   swset      code     time1     time2     time3     entno     relsw    paired
       901         0      0.02       0.0       0.0         0         0         0
$#    nrbf      ncsf       rwf     dtmax       d2r       r2d    offset
         0         0         0    7.0e-5         2         0       0.0
$#     pid       lrb     ptype
        11         0      PART
        12        11      PART
*DEFORMABLE_TO_RIGID_AUTOMATIC
$#   swset      code     time1     time2     time3     entno     relsw    paired
       902         0      0.09       0.0       0.0         0         0         0
$#    nrbf      ncsf       rwf     dtmax       d2r       r2d    offset
         0         0         0       0.0         0         2       0.0
$#     pid     ptype
        11      PART
        12      PART
"""
BOX = Printing(node=tuple(range(1, 13)), end=0.15, name="run")
ONE, LONE = [(0.02, 0.09)], Printing(node=(1,))


def join_comments(text: str) -> str:
    """Return the comments of a card as one line."""
    lines = (line[1:] for line in text.splitlines() if line[:2] in {"$ ", "# "})
    return " ".join(" ".join(lines).split())


@given(st.integers(-9999, 99999), st.integers(-3, 3))
def test_few_digits_read_back(digits: int, exponent: int) -> None:
    value = float(f"{digits}e{exponent}")
    assert float(write_number(value)) == value
    assert len(write_number(value)) <= LONGEST


@given(TIMES)
def test_the_nearest_text_is_taken(value: float) -> None:
    text = write_number(value)
    assert len(text) <= LONGEST
    texts = [f"{value:.{n}f}" for n in range(12)] + [
        f"{value:.{n}g}" for n in range(1, 12)
    ]
    texts += [text.removeprefix("0") for text in texts if "." in text]
    assert abs(float(text) - value) <= min(
        abs(float(text) - value) for text in texts if len(text) <= LONGEST
    )


def test_a_number_too_wide_is_refused() -> None:
    with pytest.raises(DeckError, match="cannot be written"):
        write_number(1e300, 4)


@pytest.mark.parametrize(
    ("windows", "message"),
    [
        ([], "no window"),
        ([(0.09, 0.02)], "tr < td was expected"),
        ([(0.02, 0.02)], "tr and td are both 0.02; give a td after tr"),
        ([(-1.0, 1.0)], "tr is -1, before the start of the run"),
        ([(0.0, float("inf"))], "tr < td was expected"),
        ([(0.02, float("nan"))], "tr < td was expected"),
        ([(0.02, 0.09), (0.05, 0.2)], "overlaps or touches"),
        ([(0.02, 0.09), (0.09, 0.2)], "overlaps or touches"),
        ([(0.2, 0.3), (0.02, 0.09)], "lies before"),
    ],
)
@pytest.mark.parametrize("solver", SOLVERS)
def test_windows_that_do_not_follow_each_other_are_refused(
    windows: list[tuple[float, float]], message: str, solver: str
) -> None:
    with pytest.raises(DeckError, match=message):
        print_cards(windows, ALL._replace(solver=solver))


@pytest.mark.parametrize("solver", SOLVERS)
def test_every_solver_prints_what_it_is_given(solver: str) -> None:
    windows = [(0.0, 0.09), (0.2, 0.3), (0.5, 0.75)]
    card = print_cards(windows, ALL._replace(solver=solver), ["a\nremark"])
    assert card.windows == tuple(windows)
    assert " a\\nremark\n" in card.text
    assert all("cycles at least" in note for note in card.notes)
    assert len(card.notes) == (
        solver in ("radioss-sensors", "radioss-contact")
    )  # one step for the whole run
    of_one_step = [
        " ".join(content.split("\n# ")).count("cycles at least")
        for content in card.files.values()
    ]
    assert sum(of_one_step) == len(card.notes)
    assert all(content in card.text for content in card.files.values())
    assert hasattr(ALL, SOLVERS[solver].switches)
    assert all(hasattr(ALL, name) for name in SOLVERS[solver].takes)


def test_the_solver_is_that_of_the_history() -> None:
    formats = {name: find_solver(name) for name in READERS}
    assert {name for name, solver in formats.items() if solver == "radioss"} == {
        "radioss-th"
    }
    assert find_solver("glstat + matsum") == "ls-dyna"
    claimed = [name for solver in SOLVERS.values() for name in solver.histories]
    assert len(claimed) == len(set(claimed))


def test_the_command_line_offers_the_solvers_there_are() -> None:
    assert f"[{'|'.join(SOLVERS)}]" in run("card", "--help").stdout
    assert (
        f"'abaqus' was found, but one of {', '.join(SOLVERS)} was expected"
        in read_refusal(
            "card", "--solver", "abaqus", "--tr", "1", "--td", "2", "--part", "1"
        )
    )


def test_a_file_of_windows() -> None:
    assert read_windows("# tr td\n0.02 0.09\n\n .2  3e-1\n", "w.txt") == (
        (0.02, 0.09),
        (0.2, 0.3),
    )
    assert refuse_overlapping_windows([(-0.0, 1.0)])[0][0].hex() == "0x0.0p+0"


def test_windows_are_read_from_the_journal_of_a_driven_run() -> None:
    """A leg replaces a leg with the same number, for example a probe that went too far or a skipped flight."""
    legs = [("load", 1, 0.0, 0.06), ("probe", 2, 0.06, 0.1), ("probe", 3, 0.1, 0.2), ("rigid", 3, 0.1, 0.145),
            ("load", 4, 0.145, 0.16), ("probe", 5, 0.16, 0.17), ("load", 5, 0.16, 0.2), ("probe", 6, 0.2, 0.3),
            ("probe", 7, 0.3, 0.32), ("load", 7, 0.3, 0.4), ("load", 8, 0.4, 0.5)]  # fmt: skip
    lines = [
        json.dumps({"event": "ended", "order": [*leg, 0.0], "seen": []}) for leg in legs
    ]
    text = "\n".join(['{"event": "prepared"}', *lines, lines[-1][:40]])
    assert read_windows(text, "drive.ndjson") == ((0.06, 0.145), (0.2, 0.3))
    back = "\n".join(
        [*lines, '{"event": "back", "legs": 5}']
    )  # up to the second flight
    assert read_windows(back, "drive.ndjson") == ((0.06, 0.145),)
    with pytest.raises(DeckError, match="no window was found"):
        read_windows('{"event": "prepared"}\n', "drive.ndjson")


@pytest.mark.parametrize(
    ("text", "message"),
    [("0.02\n", "w.txt:1: '0.02'"), ("1 2\na b\n", "w.txt:2"), ("", "w.txt: no")],
)
def test_what_is_not_a_file_of_windows(text: str, message: str) -> None:
    with pytest.raises(DeckError, match=message):
        read_windows(text, "w.txt")


def list_rows(text: str) -> list[str]:
    """Return the data lines of a card."""
    return [line for line in text.splitlines() if line[0] not in "$*"]


def test_the_card_to_the_letter() -> None:
    text = print_cards([(0.02, 0.09)], MERGED).text
    assert text[text.index("*") :] == CARD


@given(
    TIMES,
    st.lists(st.floats(1.001, 100), min_size=1, max_size=7),
    st.lists(st.integers(1, 10**9 - 1), min_size=1, max_size=30, unique=True),
)
def test_the_check_finds_in_a_card_what_was_asked_for(
    tmp_path_factory: pytest.TempPathFactory,
    start: float,
    factors: list[float],
    parts: list[int],
) -> None:
    times = [start]
    for factor in factors:
        times.append(times[-1] * factor)
    windows = list(zip(times[::2], times[1::2], strict=False))
    card = print_cards(windows, Printing(part=tuple(parts), merge=parts[-1]))
    folder = tmp_path_factory.mktemp("card")
    assert check_deck(write(folder, card.text)).findings == ()
    assert list_spans(read(folder, card.text)) == [
        (part, tr, td) for part in sorted(parts) for tr, td in card.windows
    ]
    assert all(len(line) <= 100 for line in card.text.split("\n"))
    assert all(
        a == " " or b == " "
        for row in list_rows(card.text)
        for a, b in zip(row[9::10], row[10::10], strict=False)
    )


def test_rounding_is_reported() -> None:
    card = print_cards([(1.23456e-5, 0.064)], PARTS)
    assert card.windows == ((1.2346e-5, 0.064),)
    assert card.notes[0].startswith("tr = 1.23456e-05 is rounded to 1.2346e-5, ")
    assert card.notes[0] in " ".join(card.text.replace("$", "").split())


@pytest.mark.parametrize("tr", [0.02, 0.0128853793630525, 0.000499539])
def test_rounding_beyond_the_six_digits_of_all_answers_is_not_reported(
    tr: float,
) -> None:
    card = print_cards([(tr, 0.064)], PARTS)
    assert card.notes == ()
    assert f"$ Rigid from {tr:.6g} to 0.064;" in card.text
    assert f"{card.windows[0][0]:.6g}" == f"{tr:.6g}"


def test_warnings_are_those_that_apply() -> None:
    def text(printing: Printing) -> str:
        return print_cards([(0.02, 0.09)], printing).text

    assert "Merge parts that share nodes (--merge)" in text(PARTS)
    assert "merged" not in text(MERGED)
    assert "merged" not in text(Printing(part=(11,)))
    assert "already" in text(PARTS._replace(merge=5))
    assert "    7.0e-5 " in text(PARTS)  # 1/1000 of the window
    assert "    1.0e-5 " in text(PARTS._replace(step_cap=1e-5))


def test_the_comments_ask_only_for_flags_that_the_constraints_allow() -> None:
    comments = join_comments(print_cards(ONE, MERGED).text)
    assert "lies only on switched parts, set NRBF and NCSF to 1 (delete)" in comments
    assert (
        "The window must end before the parts touch a rigid wall (RWF 0)." in comments
    )
    assert "welds or ties" not in comments


def test_the_comments_state_that_failed_welds_still_merge_parts() -> None:
    """Before, nothing stated that parts stay merged whose welds fail before the switch."""
    for bodies, is_stated in (
        ((), False),
        (((11,), (12,)), False),
        (((11, 12),), True),
    ):
        printing = Printing(part=(11, 12), bodies=bodies)
        comments = join_comments(print_cards(ONE, printing).text)
        stated = (
            "Merged parts stay one rigid body even if the welds or ties" in comments
        )
        assert stated == is_stated


def test_the_comments_allow_to_plan_later_flights_from_a_switched_run() -> None:
    for printing in (MERGED, BOX._replace(solver="radioss")):
        comments = join_comments(print_cards(ONE, printing).text)
        assert (
            "Do not choose new times for a window from a run that is rigid in it."
            in comments
        )
        assert "no energy output shows this loss" in comments


def test_every_window_has_sets_of_its_own(tmp_path: Path) -> None:
    text = print_cards(
        [(0.02, 0.09), (0.2, 0.3), (0.4, 0.5)], MERGED._replace(swset=(8, 7))
    ).text
    assert re.findall(
        r"^ +(\d+) +0 +\S+ +0.0 +0.0 +0 +0 +0$", text, flags=re.MULTILINE
    ) == [*("8", "7", "9", "10", "11", "12")]
    assert not count_findings(tmp_path, text)


def print_radioss_cards(
    windows: list[tuple[float, float]], printing: Printing
) -> PrintedCard:
    return print_cards(windows, printing._replace(solver="radioss"))


def test_three_engine_files() -> None:
    card = print_radioss_cards([(0.0128853793630525, 0.064)], BOX)
    parts = [leg.split("\n") for leg in card.files.values()]
    assert list(card.files) == ["run_0001.rad", "run_0002.rad", "run_0003.rad"]
    assert [leg[:3] for leg in parts] == [
        ["/RUN/run/1", "  0.0128853793630525", "/RBODY/OFF"],
        ["/RUN/run/2", "               0.064", "/RBODY/ON"],
        ["/RUN/run/3", "                0.15", "/RBODY/OFF"],
    ]
    assert [leg[3:5] for leg in parts] == [["1 2 3 4 5 6 7 8 9 10", "11 12"]] * 3
    assert ["/DTIX\n5.1e-05 5.1e-05" in leg for leg in card.files.values()] == [
        False,
        True,
        False,
    ]
    assert re.findall(r"# ---- (\S+)", card.text) == list(card.files)
    capped = print_radioss_cards(
        [(0.01, 0.02)], Printing(node=(1,), end=0.03, step_cap=1e-6)
    )
    assert "/DTIX\n1e-06 1e-06" in capped.text


def test_every_window_has_a_leg_and_one_from_the_start_none_before_it() -> None:
    card = print_radioss_cards([(0.0, 0.02), (0.05, 0.09)], BOX)
    printed_windows = re.findall(r"/RUN/run/(\d)\n +(\S+)\n/RBODY/(\w+)", card.text)
    assert printed_windows == [
        ("1", "0.02", "ON"),
        ("2", "0.05", "OFF"),
        ("3", "0.09", "ON"),
        ("4", "0.15", "OFF"),
    ]


@pytest.mark.parametrize(
    ("solver", "windows", "printing", "message"),
    [
        ("ls-dyna", ONE, Printing(), "no id of a part or body"),
        ("ls-dyna", ONE, Printing(part=(0,)), "id 0 does not fit"),
        ("ls-dyna", ONE, Printing(part=(10**10,)), "id 10000000000 does not fit"),
        ("ls-dyna", ONE, PARTS._replace(merge=10**9), "id 1000000000 does not fit"),
        ("ls-dyna", ONE, PARTS._replace(swset=(5, 5)), "both switch sets have id 5"),
        ("ls-dyna", [(1.0000000001, 1.0000000002)], PARTS, "different times"),
        (
            "ls-dyna",
            [(1.0, 2.00000000001), (2.00000000002, 3.0)],
            PARTS,
            "different times",
        ),
        ("radioss", ONE, LONE._replace(end=0.05), "the run ends at 0.05"),
        ("radioss", ONE, LONE, "not given"),
        ("radioss", ONE, LONE._replace(end=float("inf")), "the run ends"),
        ("radioss", ONE, Printing(end=1.0), "no id of a part or body"),
        ("radioss", ONE, LONE._replace(end=1.0, name="a/b"), "the name of the run"),
        (
            "radioss",
            [(i, i + 0.5) for i in range(1, 60)],
            LONE._replace(end=100.0),
            "at most 99",
        ),
    ],
)
def test_what_a_solver_cannot_be_told_is_refused(
    solver: str, windows: list[tuple[float, float]], printing: Printing, message: str
) -> None:
    with pytest.raises(DeckError, match=message):
        print_cards(windows, printing._replace(solver=solver))
