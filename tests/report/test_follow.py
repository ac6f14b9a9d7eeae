"""Sentences about a run that is followed: before it begins, while it grows, after a restart, and once it is over."""

import gzip
import os
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from d2rpick.histories.names import Selection
from d2rpick.report.follow import Event, describe_news
from d2rpick.running.watch import News, Watch
from tests.command import MATSUM, ROOT
from tests.energies import require

LEGS = [
    gzip.decompress((ROOT / f"tests/data/drop2_w123_T0{leg}.gz").read_bytes())
    for leg in (1, 2)
]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "run").mkdir()
    return tmp_path / "run"


def follow_changes(name: Path, *changes: Callable[[], object]) -> list[Event]:
    """Follow a run that is read once after each of the changes to its files."""
    watch = Watch([str(name)], Selection())

    def list_reads() -> Iterator[News]:
        for change in changes:
            change()
            yield watch.look()

    return list(describe_news(list_reads(), [str(name)], ()))


def follow_once(name: Path) -> list[Event]:
    return follow_changes(name, lambda: None)


def list_keywords(events: list[Event]) -> list[str]:
    return [event.event for event in events]


def make_older(path: Path, seconds: float) -> None:
    then = time.time() - seconds
    os.utime(path, (then, then))


def test_a_run_that_has_not_begun_says_so(folder: Path) -> None:
    for name in (folder, folder / "runT01", folder / "*T01"):
        message = f"{name}: no file of a run yet; check the name if the run has begun"
        assert follow_once(name) == [Event("state", None, None, message)]
    (folder / "runT01").write_bytes(LEGS[0][:200])
    (state,) = follow_once(folder)
    assert state.message.startswith("cannot be read yet")


def test_the_lines_of_a_growing_run_are_those_of_the_whole_one(folder: Path) -> None:
    history = folder / "runT01"
    parts = [LEGS[0][: int(share * len(LEGS[0]))] for share in (0.4, 0.4, 0.8, 1.0)]
    growing = follow_changes(
        folder, *[lambda data=part: history.write_bytes(data) for part in parts]
    )
    whole = follow_once(folder)
    assert growing[0].message.startswith("the run has reached")
    assert growing[1:] == whole[1:]
    assert list_keywords(whole)[0] == "begun"
    assert list_keywords(whole)[-1] == "state"
    assert f"since {whole[-1].time:.6g}" in whole[-1].message


def test_a_restart_is_told_with_the_contact_that_it_takes_back(folder: Path) -> None:
    first, second = folder / "runT01", folder / "runT02"

    def write_both() -> None:
        first.write_bytes(LEGS[0])
        second.write_bytes(LEGS[1])

    def restart() -> None:
        second.unlink()
        first.write_bytes(LEGS[0][: len(LEGS[0]) // 2])

    events = follow_changes(folder, write_both, restart, write_both)
    keywords = list_keywords(events)
    restarted = keywords.index("restart")
    assert keywords[restarted : restarted + 2] == ["restart", "expected"]
    first_contact = keywords.index("contact")
    assert events[restarted + 1].time == events[first_contact].time
    # The run then shows again what it had shown before.
    again = events[restarted + 2 : -1]
    assert again == events[first_contact:restarted]
    last_time = require(events[restarted - 1].seen)
    assert require(events[restarted].time) < last_time


@pytest.mark.parametrize(
    ("listing", "keyword"),
    [("NORMAL TERMINATION", "ended"), ("ERROR TERMINATION", "failed")],
)
def test_the_end_of_a_run_is_told_once_with_the_next_step(
    folder: Path, listing: str, keyword: str
) -> None:
    write_history = lambda: (folder / "runT01").write_bytes(LEGS[0])  # noqa: E731
    write_listing = lambda: (folder / "run_0001.out").write_text(listing)  # noqa: E731
    events = follow_changes(folder, write_history, write_listing, lambda: None)
    assert list_keywords(events).count(keyword) == 1
    assert "d2rpick plan" not in events[0].message
    assert f"choose times with d2rpick plan {folder}" in events[-1].message


@pytest.mark.parametrize("how", ["listing", "age", "growing"])
def test_a_run_that_is_over_when_first_seen_is_left_to_plan(
    folder: Path, how: str
) -> None:
    """An advice to switch now would come too late, and plan uses the whole flight."""
    history = folder / "matsum"
    history.write_bytes(Path(MATSUM).read_bytes())
    if how == "listing":
        (folder / "messag").write_text(" N o r m a l    t e r m i n a t i o n\n")
    if how == "age":
        make_older(history, 3600)
    events = follow_once(folder)
    is_over = how != "growing"
    command = f"choose times with d2rpick plan {folder}"
    assert (command in events[0].message) == is_over
    assert (command in events[-1].message) == is_over
    advice = [event for event in events if event.event in ("switch", "later")]
    assert advice
    for event in advice:
        assert (
            event.message.startswith("advice during the run, now out of date: ")
            == is_over
        )


def test_a_run_that_goes_on_after_a_silence_is_not_over(folder: Path) -> None:
    history = folder / "runT01"

    def write_half_long_ago() -> None:
        history.write_bytes(LEGS[0][: len(LEGS[0]) // 2])
        make_older(history, 3600)

    events = follow_changes(
        folder, write_half_long_ago, lambda: history.write_bytes(LEGS[0])
    )
    assert "seems over" in events[0].message
    assert "d2rpick plan" not in events[-1].message


def test_silence_names_what_ends_the_watch(folder: Path) -> None:
    history = folder / "runT01"
    history.write_bytes(LEGS[0])
    make_older(history, 3600)
    (silent,) = [event for event in follow_once(folder) if event.event == "silent"]
    assert "Ctrl+C" in silent.message
    assert "d2rpick plan" in silent.message


def test_the_command_for_a_finished_run_can_be_typed() -> None:
    """It names the chosen parts, and a file whose name looks like an option follows two dashes."""
    reads = [News(start=0.0, now=1.0, ending="normally")]
    begun, *_ = describe_news(reads, ["-a run"], ("box", "3"))
    assert "d2rpick plan --part box,3 -- '-a run'" in begun.message


def test_a_switched_run_that_is_over_is_left_to_the_comparison() -> None:
    """Plan would refuse it, or answer with the same comparison, since its times were chosen before."""
    folder = ROOT / "sample_data/oscillator_switched"
    events = follow_once(folder)
    step = f"d2rpick verify --switched {folder} REFERENCE (the reference run instead of REFERENCE)"
    assert events[-1].message.endswith(
        f"; this run was switched: compare this run with its reference run: {step}"
    )
    assert events[0].message.startswith("this run was switched: the run has reached")
    assert not [event for event in events if "d2rpick plan" in event.message]


def test_the_comparison_keeps_the_parts_and_names_every_file() -> None:
    news = News(0.0, 1.0, was_switched=True, later_files=("T02",), ending="normally")
    *_, state = describe_news([news], ["T01"], ("box",))
    command = "d2rpick verify --switched T01 --switched T02 --part box REFERENCE"
    assert command in state.message


def test_a_run_that_is_over_is_not_said_to_fly_later() -> None:
    news = News(0.0, 1.0, knows_wait=True, ending="normally")
    *_, state = describe_news([news], ["T01"], ())
    assert state.message == (
        "no flight was seen during the run; d2rpick plan judges the whole record, which may show a flight; "
        "choose times with d2rpick plan T01"
    )
    *_, state = describe_news([news._replace(ending=None)], ["T01"], ())
    assert state.message == "no flight yet"
