"""Watching a run that has not begun, grows, is cut within a record, becomes silent, restarts, or ends."""

import gzip
import os
import time
from pathlib import Path

import pytest

from d2rpick.base.errors import D2RPickError, FormatError
from d2rpick.histories.names import Selection
from d2rpick.running.watch import News, Watch, find_files, follow
from tests.command import ROOT
from tests.energies import require

LEGS = [
    gzip.decompress((ROOT / f"tests/data/drop2_w123_T0{leg}.gz").read_bytes())
    for leg in (1, 2, 3)
]
WHOLE = Selection()


def list_keywords(news: News) -> list[str]:
    return [event.event for event in news.events]


def read_once(folder: Path) -> News:
    (news,) = follow([str(folder)], WHOLE, lasting=0.0)
    return news


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "run").mkdir()
    return tmp_path / "run"


def test_a_run_that_has_not_begun_has_no_state(folder: Path) -> None:
    for name in (folder, folder / "runT01", folder / "*T01"):
        assert read_once(name) == News()
    (folder / "runT01").write_bytes(b"")
    assert read_once(folder) == News()
    (folder / "runT01").write_bytes(LEGS[0][:200])
    news = read_once(folder)
    assert (news.now, news.events) == (None, ())
    assert isinstance(news.error, FormatError)


def test_an_error_is_forgotten_once_the_files_can_be_read(folder: Path) -> None:
    watch = Watch([str(folder)], WHOLE)
    (folder / "runT01").write_bytes(LEGS[0][:200])
    assert watch.look().error is not None
    assert watch.look().error is not None
    (folder / "runT01").write_bytes(LEGS[0])
    assert watch.look().error is None


def test_a_growing_family_is_told_once_and_as_a_whole(folder: Path) -> None:
    watch, keywords = Watch([str(folder / "runT01")], WHOLE), list[str]()
    for leg, data in enumerate(LEGS[:2], 1):
        for share in (0.37, 0.371, 0.8, 1.0):  # in the middle of records
            (folder / f"runT0{leg}").write_bytes(data[: int(share * len(data))])
            news = watch.look()
            keywords += list_keywords(news)
            assert news.undone_events == ()
            # Without new states there are no further events.
            assert watch.look() == news._replace(events=())
    whole = read_once(folder)
    assert keywords == list_keywords(whole)
    assert keywords.count("flight") == 3
    assert keywords.count("contact") == 2
    assert (news.start, news.now, news.flight) == (whole.start, whole.now, whole.flight)


def test_a_restart_undoes_events_which_the_run_may_show_again(folder: Path) -> None:
    watch = Watch([str(folder)], WHOLE)
    (folder / "runT01").write_bytes(LEGS[0])
    (folder / "runT02").write_bytes(LEGS[1])
    before = watch.look()
    (folder / "runT02").unlink()
    (folder / "runT01").write_bytes(LEGS[0][: len(LEGS[0]) // 2])
    restarted = watch.look()
    assert require(restarted.now) < require(before.now)
    assert restarted.events == ()
    assert restarted.undone_events == before.events[-len(restarted.undone_events) :]
    assert restarted.undone_events[0].event == "contact"
    (folder / "runT01").write_bytes(LEGS[0])
    (folder / "runT02").write_bytes(LEGS[1])
    again = watch.look()
    assert (again.events, again.undone_events) == (restarted.undone_events, ())


def test_silence_is_told_after_a_minute_and_then_when_it_has_doubled(
    folder: Path,
) -> None:
    watch = Watch([str(folder)], WHOLE)
    (folder / "runT01").write_bytes(LEGS[0])
    assert watch.look().silence is None
    for age, is_reported in ((50, False), (70, True), (100, False), (150, True)):
        then = time.time() - age
        os.utime(folder / "runT01", (then, then))
        watch._files = find_files([str(folder)])  # written then
        silence = watch.look().silence
        assert (silence is not None) is is_reported
        if silence is not None:
            assert silence >= age


@pytest.mark.parametrize(
    ("listing", "ending"),
    [
        ("     NORMAL TERMINATION\n", "normally"),
        ("     ERROR TERMINATION\n", "with an error"),
        ("NORMAL TERMINATION\n USER BREAK", None),
    ],
)
def test_the_listing_says_how_a_run_has_ended(
    folder: Path, listing: str, ending: str | None
) -> None:
    (folder / "runT01").write_bytes(LEGS[0])
    (folder / "run_0001.out").write_text(listing)
    assert read_once(folder).ending == ending
    # This restart segment does not exist yet.
    (folder / "run_0002.rad").write_text("/RUN/run/2\n1.0\n")
    assert read_once(folder).ending is None


def test_looks_cost_one_percent_of_a_core(folder: Path) -> None:
    (folder / "runT01").write_bytes(LEGS[0])
    rests, begun = list[float](), time.process_time()

    def rest(seconds: float) -> None:
        rests.append(seconds)
        if len(rests) == 3:
            (folder / "run_0001.out").write_text("NORMAL TERMINATION")
            (folder / "runT01").write_bytes(LEGS[0][:-1])

    endings = [news.ending for news in follow([str(folder)], WHOLE, rest=rest)]
    assert endings == [None, None, None, "normally"]
    assert sum(rests) >= 50 * (time.process_time() - begun) / 2
    assert min(rests) >= 0.5


def test_what_cannot_be_read_and_is_not_written_to_any_more_is_an_error(
    folder: Path,
) -> None:
    (folder / "runT01").write_bytes(LEGS[0][:200])
    os.utime(folder / "runT01", (1e9, 1e9))
    with pytest.raises(D2RPickError, match="runT01"):
        read_once(folder)


def test_several_runs_in_a_folder_are_refused(folder: Path) -> None:
    for name in ("aT01", "bT01"):
        (folder / name).write_bytes(LEGS[0])
    with pytest.raises(D2RPickError, match="several runs"):
        read_once(folder)
