"""Sources of the bytes: files, folders, globs, gzip and standard input, for all formats."""

import gzip
import hashlib
import io
import os
import time
from collections.abc import Sequence
from contextlib import nullcontext
from pathlib import Path
from threading import Thread

import numpy as np
import pytest

from d2rpick.base.errors import FormatError
from d2rpick.histories.formats import READERS
from d2rpick.histories.opening import Selection, open_run
from d2rpick.histories.source import (
    expand,
    find_later_legs,
    find_unread_legs,
    has_next_leg,
    open_files,
)
from tests.command import read_refusal
from tests.computed import locate_stored
from tests.hdf5_files import plain, write_hdf5
from tests.made_binout import make_binout
from tests.made_d3plot import D3plotWriter, make_states
from tests.made_t01 import make_t01
from tests.reading import read_history
from tests.text_files import make_glstat_text, make_matsum_text

TIMES = [0.125, 0.25, 0.375]
CONTENTS = {
    "binout": bytes(make_binout([1, 2, 3]).data),
    "radioss-th": bytes(make_t01(3).data),
    "glstat": make_glstat_text(TIMES, [1, 2, 3]),
    "matsum": make_matsum_text(TIMES, [7, 3], np.ones((3, 2))),
    "hdf5": write_hdf5(plain).getvalue(),
    "csv": b"time,IE\n0,1\n1,2\n",
    "d3thdt": D3plotWriter(family=3).together(make_states(TIMES)),
    "d3plot": D3plotWriter().together(make_states(TIMES)),
}


def names(*files: str) -> Sequence[str]:
    for file in files:
        Path(file).parent.mkdir(exist_ok=True)
        Path(file).write_bytes(b"x")
    return files


def test_there_is_an_example_of_each_format() -> None:
    assert list(CONTENTS) == list(READERS)


@pytest.mark.parametrize("kind", CONTENTS)
def test_every_format_is_read_by_its_content_from_a_file_gzip_and_standard_input(
    kind: str, here: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    content = CONTENTS[kind]
    Path("plain").write_bytes(content)
    Path("packed").write_bytes(gzip.compress(content))
    monkeypatch.setattr("sys.stdin", io.TextIOWrapper(io.BytesIO(content)))
    histories = [read_history([name]) for name in ("plain", "packed", "-")]
    assert {history.format for history in histories} == {kind}
    for history, data in zip(
        histories, (content, Path("packed").read_bytes(), content), strict=True
    ):
        assert history.time.tolist() == histories[0].time.tolist()
        assert history.energy.tolist() == histories[0].energy.tolist()
        assert (
            history.files[0].sha256() == hashlib.sha256(data).hexdigest()
        )  # the bytes on disk, before they are unpacked
    assert (
        read_history([str(here / "plain")], input_format=kind).energy.tolist()
        == histories[0].energy.tolist()
    )


@pytest.mark.usefixtures("here")
def test_a_folder_holds_the_databases_of_one_run() -> None:
    run = names(
        "run/binout0000",
        "run/binout0000%001",
        "run/binout0004",
        "run/GLSTAT",
        "run/matsum.gz",
    )
    run = [*run, *names("run/d3plot", "run/d3plot01", "run/d3thdt")]
    names(
        "run/d3hsp",
        "run/d3dump01",
        "run/messag",
        "run/glstat.txt",
        "run/nodout",
        "run/binout.log",
    )
    assert expand(["run"]) == tuple(sorted(run))
    legs = names("rad/box_T01", "rad/box_T02.gz", "rad/box_T03")
    names("rad/box_0001.out", "rad/box_T01.csv")
    assert expand(["rad", "run/GLSTAT", "rad/box_T01"]) == (*legs, "run/GLSTAT")


@pytest.mark.parametrize(
    "change", ["replaced", "cut", "written anew", "appended", "taken away"]
)
def test_files_of_one_run_are_not_mixed_with_those_of_the_next(
    change: str, here: Path
) -> None:
    first, second, whole = here / "run.glstat", here / "run.matsum", CONTENTS["glstat"]
    for name in (first, here / "next"):
        name.write_bytes(whole)
    os.mkfifo(second)
    time.sleep(0.02)  # more than the resolution of the file's times

    def write_the_second() -> None:
        with second.open(
            "wb"
        ) as pipe:  # the first file was read when the second one is opened
            if change == "replaced":
                Path("next").replace(first)
            elif change == "taken away":
                first.unlink()
            else:
                first.write_bytes(
                    {"cut": whole[:-900], "written anew": whole, "appended": 2 * whole}[
                        change
                    ]
                )
            pipe.write(CONTENTS["matsum"])

    writer = Thread(target=write_the_second, daemon=True)
    writer.start()
    reason = r"run\.glstat: this file was replaced or written anew"
    with (
        nullcontext()
        if change == "appended"
        else pytest.raises(FormatError, match=reason)
    ):
        assert len(open_files([str(first), str(second)])) == 2
    writer.join()


@pytest.mark.usefixtures("here")
def test_a_glob_takes_what_has_such_a_name() -> None:
    files = names("leg1/binout", "leg2/binout")
    assert expand(["leg*/binout"]) == files
    assert expand(["leg[2-9]/*"]) == files[1:]
    with pytest.raises(FormatError, match=r"leg\*/glstat: no file matches"):
        expand(["leg*/glstat"])
    names("run[1]")
    assert expand(["run[1]"]) == ("run[1]",)  # a file is a file, whatever its name


@pytest.mark.usefixtures("here")
@pytest.mark.parametrize(
    ("files", "reason"),
    [
        (
            ("run/aT01", "run/bT01", "run/bT02"),
            r"run: this folder contains several runs \(aT01, bT01\)",
        ),
        (("run/aT01", "run/binout"), r"several runs \(aT01, one of LS-DYNA\)"),
        (("run/job7.glstat", "run/job8.matsum"), r"several runs \(job7, job8\)"),
        (
            ("run/d3dump01",),
            "run: no glstat, matsum, binout, d3plot or T01 in this folder; give the file",
        ),
    ],
)
def test_a_folder_of_several_runs_or_none_is_refused(
    files: Sequence[str], reason: str
) -> None:
    names(*files)
    with pytest.raises(FormatError, match=reason):
        expand(["run"])


@pytest.mark.usefixtures("here")
def test_a_folder_is_read_as_one_run() -> None:
    for name in ("binout", "glstat", "matsum"):
        Path(name).write_bytes(CONTENTS[name])
    run = open_run(["."])
    assert run.sources == ("binout", "glstat", "matsum")
    assert run.notes == ()
    history = run.history(Selection())
    assert (history.format, history.channel) == (
        "binout + glstat + matsum",
        "internal_energy",
    )
    assert history.time.tolist() == TIMES


@pytest.mark.parametrize(
    ("named", "beside", "later"),
    [
        (["runT01"], ["runT02.gz", "runT03", "otherT02"], ["runT02.gz", "runT03"]),
        (["binout0000"], ["binout0001", "binoutx"], ["binout0001"]),
        (["glstat"], ["glstat01", "glstat.csv"], ["glstat01"]),
        (["runT02", "runT03"], ["runT01"], []),
        (["missing/runT01"], [], []),
    ],
)
def test_legs_are_files_of_the_same_name_with_a_higher_number(
    named: list[str], beside: list[str], later: list[str], tmp_path: Path
) -> None:
    for name in (*(n for n in named if "/" not in n), *beside):
        (tmp_path / name).touch()
    assert find_later_legs([str(tmp_path / name) for name in named]) == [
        str(tmp_path / name) for name in later
    ]


def test_a_td_that_only_a_later_leg_reaches_names_it() -> None:
    first = locate_stored("rollover_r100_T01.gz")
    assert first.replace("T01", "T02") in read_refusal(
        "suggest", "--td", "0.4", "--part", "box", first
    )


@pytest.mark.usefixtures("here")
def test_a_named_leg_is_read_however_its_folder_is_written() -> None:
    for name in ("runT01", "runT02", "runT03"):
        Path(name).touch()
    assert find_unread_legs(["./runT01", "./runT02", "./runT03"]) == []
    assert find_unread_legs(["./runT01", "./runT03"]) == ["runT02"]


@pytest.mark.parametrize("suffix", ["", ".gz"])
def test_a_radioss_history_has_a_next_leg_only_if_the_next_number_exists(
    suffix: str, tmp_path: Path
) -> None:
    for name in (
        "runT01",
        f"runT02{suffix}",
        "runT09.gz",
        "runT10",
        "table1",
        "table2",
    ):
        (tmp_path / name).touch()
    followed = [
        name
        for name in ("runT01", f"runT02{suffix}", "runT09.gz", "runT10", "table1")
        if has_next_leg(str(tmp_path / name))
    ]
    assert followed == ["runT01", "runT09.gz"]


@pytest.mark.usefixtures("here")
def test_the_names_of_a_job_are_those_of_its_run() -> None:
    """``ls-dyna i=main.k jobid=job7`` writes job7.glstat, job7.matsum, job7.binout0000 and job7.d3plot."""
    databases = names(
        "run/job7.binout0000", "run/job7.glstat", "run/job7.matsum", "run/job7.rcforc"
    )
    names("run/job7.k", "run/job7.messag")
    assert sorted(expand(["run"])) == sorted(databases)


@pytest.mark.usefixtures("here")
def test_a_copy_with_a_name_of_its_own_beside_the_files_of_a_run_is_not_read() -> None:
    names("run/glstat", "run/old.glstat")
    assert expand(["run"]) == ("run/glstat",)
