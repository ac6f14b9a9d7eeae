"""Watching a run that has not begun, grows, is cut within a record, goes silent, restarts, or ends."""

import gzip
import os
import time
from pathlib import Path

import pytest

from d2rpick.base.errors import D2RPickError
from d2rpick.histories.names import Selection
from d2rpick.running.events import Event
from d2rpick.running.watch import Watch, find_files, follow
from tests.command import MATSUM, ROOT

LEGS = [
    gzip.decompress((ROOT / f"tests/data/drop2_w123_T0{leg}.gz").read_bytes())
    for leg in (1, 2, 3)
]
WHOLE = Selection()


def list_news(watch: Watch) -> list[str]:
    return [event.event for event in watch.news()]


def watch_to_end(folder: Path) -> list[Event]:
    return list(follow([str(folder)], WHOLE, lasting=0.0))


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "run").mkdir()
    return tmp_path / "run"


def test_a_run_that_has_not_begun_says_so(folder: Path) -> None:
    for name in (str(folder), str(folder / "runT01"), str(folder / "*T01")):
        (state,) = follow([name], WHOLE, lasting=0.0)
        assert (state.event, state.time, state.message) == (
            "state",
            None,
            f"{name}: no file of a run yet; check the name if the run has begun",
        )
    (folder / "runT01").write_bytes(b"")
    assert (
        watch_to_end(folder)[-1].message
        == f"{folder}: no file of a run yet; check the name if the run has begun"
    )
    (folder / "runT01").write_bytes(LEGS[0][:200])
    assert watch_to_end(folder)[-1].message.startswith("cannot be read yet")


def test_a_growing_family_is_told_once_and_as_a_whole(folder: Path) -> None:
    watch, messages = Watch([str(folder / "runT01")], WHOLE), list[str]()
    for leg, data in enumerate(LEGS[:2], 1):
        for share in (0.37, 0.371, 0.8, 1.0):  # in the middle of records
            (folder / f"runT0{leg}").write_bytes(data[: int(share * len(data))])
            messages += list_news(watch)
            assert list_news(watch) == []  # no news, no message
    whole = [event.event for event in watch_to_end(folder)[:-1]]
    assert messages == whole
    assert messages.count("flight") == 3
    assert messages.count("contact") == 2


def test_a_restart_is_told_with_the_contact_that_it_takes_back(folder: Path) -> None:
    watch = Watch([str(folder)], WHOLE)
    (folder / "runT01").write_bytes(LEGS[0])
    (folder / "runT02").write_bytes(LEGS[1])
    events_before = list(watch.news())
    (folder / "runT02").unlink()
    (folder / "runT01").write_bytes(LEGS[0][: len(LEGS[0]) // 2])
    events_after = list(watch.news())
    assert [event.event for event in events_after] == ["restart", "expected"]
    assert events_after[1].time == next(
        event.time for event in events_before if event.event == "contact"
    )
    (folder / "runT01").write_bytes(LEGS[0])
    (folder / "runT02").write_bytes(LEGS[1])
    again = list(watch.news())
    assert again[0].event == "contact"
    assert again == events_before[-len(again) :]


def test_silence_is_told_after_a_minute_and_then_when_it_has_doubled(
    folder: Path,
) -> None:
    watch = Watch([str(folder)], WHOLE)
    (folder / "runT01").write_bytes(LEGS[0])
    assert "silent" not in list_news(watch)
    for age, expected in ((50, []), (70, ["silent"]), (100, []), (150, ["silent"])):
        then = time.time() - age
        os.utime(folder / "runT01", (then, then))
        watch._files = find_files([str(folder)])  # written then
        assert list_news(watch) == expected


@pytest.mark.parametrize(
    ("listing", "event"),
    [
        ("     NORMAL TERMINATION\n", "ended"),
        ("     ERROR TERMINATION\n", "failed"),
        ("NORMAL TERMINATION\n USER BREAK", None),
    ],
)
def test_the_listing_says_how_a_run_has_ended(
    folder: Path, listing: str, event: str | None
) -> None:
    (folder / "runT01").write_bytes(LEGS[0])
    (folder / "run_0001.out").write_text(listing)
    events = [watch_event.event for watch_event in watch_to_end(folder)]
    assert [
        watch_event for watch_event in events if watch_event in ("ended", "failed")
    ] == [event] * (event is not None)
    (folder / "run_0002.rad").write_text(
        "/RUN/run/2\n1.0\n"
    )  # a restart segment that does not exist yet
    assert not {*(watch_event.event for watch_event in watch_to_end(folder))} & {
        "ended"
    }


def test_looks_cost_one_percent_of_a_core(folder: Path) -> None:
    (folder / "runT01").write_bytes(LEGS[0])
    rests, begun = list[float](), time.process_time()

    def rest(seconds: float) -> None:
        rests.append(seconds)
        if len(rests) == 3:
            (folder / "run_0001.out").write_text("NORMAL TERMINATION")
            (folder / "runT01").write_bytes(LEGS[0][:-1])

    assert [event.event for event in follow([str(folder)], WHOLE, rest=rest)][-2:] == [
        "ended",
        "state",
    ]
    assert sum(rests) >= 50 * (time.process_time() - begun) / 2
    assert min(rests) >= 0.5


def test_what_cannot_be_read_and_is_not_written_to_any_more_is_an_error(
    folder: Path,
) -> None:
    (folder / "runT01").write_bytes(LEGS[0][:200])
    os.utime(folder / "runT01", (1e9, 1e9))
    with pytest.raises(D2RPickError, match="runT01"):
        watch_to_end(folder)


def test_several_runs_in_a_folder_are_refused(folder: Path) -> None:
    for name in ("aT01", "bT01"):
        (folder / name).write_bytes(LEGS[0])
    with pytest.raises(D2RPickError, match="several runs"):
        watch_to_end(folder)


@pytest.mark.parametrize("how", ["listing", "age", "growing"])
def test_a_run_that_is_over_when_first_seen_is_left_to_plan(
    folder: Path, how: str
) -> None:
    """An advice to switch now would come too late, and plan knows the whole flight."""
    history = folder / "matsum"
    history.write_bytes(Path(MATSUM).read_bytes())
    if how == "listing":
        (folder / "messag").write_text(" N o r m a l    t e r m i n a t i o n\n")
    if how == "age":
        long_ago = time.time() - 3600
        os.utime(history, (long_ago, long_ago))
    events = watch_to_end(folder)
    is_over = how != "growing"
    command = f"choose times with d2rpick plan {folder}"
    assert (command in events[0].message) == is_over
    assert (command in events[-1].message) == is_over
    advice = [event for event in events if event.event in ("switch", "later")]
    assert advice
    for event in advice:
        assert event.message.startswith("during the run the advice was") == is_over


def test_silence_names_what_ends_the_watch(folder: Path) -> None:
    history = folder / "runT01"
    history.write_bytes(LEGS[0])
    long_ago = time.time() - 3600
    os.utime(history, (long_ago, long_ago))
    (silent,) = [event for event in watch_to_end(folder) if event.event == "silent"]
    assert "Ctrl+C" in silent.message
    assert "d2rpick plan" in silent.message
