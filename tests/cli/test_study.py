"""The command ``study`` for a user: formats, exit codes, lists, and rows that survive a killed process."""

import csv
import gzip
import io
import json
import os
import re
import signal
import time
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest

from d2rpick import __version__
from tests import variants
from tests.command import (
    BOX,
    ENERGY,
    GLSTAT,
    MATSUM,
    ROOT,
    put,
    read_refusal,
    run,
    run_json,
    start_program,
)
from tests.json_schemas import check_by_definition, check_by_schema, run_json_checked
from tests.variants import STUDY

FORMATS = ("table", "json", "csv", "markdown", "ndjson")
KEYS = (
    "source",
    "tr",
    "tr_low",
    "tr_high",
    "energy_td",
    "residual",
    "status",
    "message",
    "td",
    "common_error",
)


@pytest.fixture
def runs(tmp_path: Path) -> list[str]:
    """Write three slightly different runs."""
    return variants.write_variants(tmp_path)


def check_line(check_report: dict[str, Any], kind: str) -> None:
    """Validate a line of newline-delimited JSON by the schema of the package."""
    check_by_definition(check_report, "study-1", kind)


def read_lines(text: str) -> list[dict[str, Any]]:
    """Return the documents of newline-delimited JSON."""
    return [json.loads(line) for line in text.splitlines()]


# Results.


@pytest.mark.parametrize(
    "extra", [(), ("absent.csv",), ("--td", "0.064"), ("--max-residual", "0.001")]
)
def test_json_follows_the_schema(runs: list[str], extra: tuple[str, ...]) -> None:
    document = run_json_checked(*STUDY, *runs, *extra)
    assert document["tool_version"] == __version__
    assert document["command"] == [*STUDY, *runs, *extra, "-f", "json"]
    assert [row["source"] for row in document["runs"]][:3] == runs


@pytest.mark.slow
def test_every_format_says_the_same(runs: list[str]) -> None:
    sources = [*runs, "absent.csv"]
    document = run_json(*STUDY, *sources)
    rows = list(csv.DictReader(io.StringIO(run(*STUDY, *sources, "-f", "csv").stdout)))
    for row, run_row in zip(rows, document["runs"], strict=True):
        texts = {key: "" if run_row[key] is None else str(run_row[key]) for key in KEYS}
        assert {key: row[key] for key in KEYS} == texts
    *lines, last = read_lines(run(*STUDY, *sources, "-f", "ndjson").stdout)
    for line in lines:
        check_line(line, "line")
    check_line(last, "last")
    errors = last["common_errors"]
    again = [
        {**line, "common_error": error}
        for line, error in zip(lines, errors, strict=True)
    ]
    assert [
        {key: line[key] for key in run_row}
        for line, run_row in zip(again, document["runs"], strict=True)
    ] == document["runs"]
    assert {**last, "command": 0} == {
        **{key: document[key] for key in document if key != "runs"},
        "command": 0,
    }
    for form in ("table", "markdown"):
        text = run(*STUDY, *sources, "-f", form).stdout
        common = f"common tr = {document['common_tr']:g}, for 3 of 4 runs"
        assert re.match(rf"(\* )?{document['common_verdict']}:? +{common}", text)
        assert form == "table" or all(
            source in text for source in sources
        )  # a table wraps long names


@pytest.mark.slow
def test_a_window_for_td_lets_each_run_choose_its_own(runs: list[str]) -> None:
    study_answer = run_json_checked("study", "--td-window", "0.06", "0.07", *runs)
    assert (study_answer["td"], study_answer["td_window"]) == (None, [0.06, 0.07])
    for name, run_row in zip(runs, study_answer["runs"], strict=True):
        pair = run_json("suggest", "--td-window", "0.06", "0.07", name)["recommended"]
        assert (run_row["tr"], run_row["td"]) == (pair["tr"], pair["td"])
        verdict = run_json(
            "verify",
            "--tr",
            repr(study_answer["common_tr"]),
            "--td",
            repr(run_row["td"]),
            name,
        )
        assert verdict["verified"]
        assert run_row["common_error"] == pytest.approx(verdict["residual"], abs=1e-3)
    assert (
        "of each run in 0.06 to 0.07"
        in run("study", "--td-window", "0.06", "0.07", *runs).stdout
    )


def test_options_of_suggest_hold_for_each_run() -> None:
    study_answer = run_json(
        "study", "--td", "0.37", "--part", "box", BOX, BOX, "--jobs", "2"
    )
    (expected,) = [
        c
        for c in run_json("suggest", "--td", "0.37", "--part", "box", BOX)["candidates"]
        if c["recommended"]
    ]
    assert [row["tr"] for row in study_answer["runs"]] == [expected["tr"]] * 2
    assert study_answer["runs"][0]["basis"] == "energy"
    later = run_json(*STUDY, "--after", "0.02", ENERGY)
    assert later["runs"][0]["tr"] > 0.02


# Exit codes.


@pytest.mark.slow
@pytest.mark.parametrize(
    ("extra", "code"),
    [
        ((), 0),
        (("absent.csv",), 1),
        (("--max-residual", "0.001"), 1),
        (("--tolerance", "0.001"), 1),  # each run has a tr, but none is common to all
        (("--td", "7"), 2),
        (("--td", "x"), 2),
        (("--jobs", "0"), 2),
        (("--from", "absent.txt"), 2),
        (("-",), 2),
        (("--scheduler", "tcp://127.0.0.1:9"), 2),  # together with --jobs
        (("--energy", "a", "--part", "1"), 2),
    ],
)
def test_the_exit_code_does_not_depend_on_the_format(
    runs: list[str], extra: tuple[str, ...], code: int
) -> None:
    args = (*STUDY, *runs, *extra)
    assert [run(*args, "-f", form).exit_code for form in ("table", "ndjson")] == [
        code
    ] * 2
    assert run(*args, "--exit-zero").exit_code == {0: 0, 1: 0, 2: 2}[code]


def test_when_none_can_be_read_the_first_reason_is_told() -> None:
    result = run(*STUDY, "absent.csv", "missing.csv")
    assert result.exit_code == 2
    assert re.search(
        "^absent.csv +unreadable +no such file", result.stdout, re.MULTILINE
    )
    assert result.stderr.startswith(
        "d2rpick: no run could be judged; the first: absent.csv: no such file"
    )


@pytest.mark.parametrize("args", [STUDY, (*STUDY, "--from", "-")])
def test_no_runs_are_a_question_of_usage(args: tuple[str, ...]) -> None:
    result = run(*args, stdin=b"# none\n\n")
    assert (result.exit_code, result.stdout) == (2, "")
    assert "give their names, or a list with --from" in result.stderr


# Lists, folders, patterns.


@pytest.mark.usefixtures("here")
def test_names_come_from_a_list_too(runs: list[str]) -> None:
    text = f"# variants\n\n  run2.csv  \r\n{runs[2]}\n"
    Path("list.txt").write_text(text)
    expected = [runs[0], "run2.csv", runs[2]]
    for args in ((runs[0], "--from", "list.txt"), (runs[0], "--from", "-")):
        document = json.loads(
            run(*STUDY, *args, "-f", "json", stdin=text.encode()).stdout
        )
        assert [row["source"] for row in document["runs"]] == expected
    result = run(*STUDY, "-f", "csv", env={"D2RPICK_STUDY_FROM": "list.txt"})
    assert result.stdout.count("\n") == 3


@pytest.mark.usefixtures("here")
def test_a_pattern_stands_for_runs_and_a_folder_for_one() -> None:
    for name in ("one", "two"):
        Path(name).mkdir()
        (Path(name) / "glstat").write_bytes(Path(GLSTAT).read_bytes())
    document = run_json(*STUDY, "*/glstat", "one", "no*")
    statuses = [(row["source"], row["status"]) for row in document["runs"]]
    expected = [os.path.join(name, "glstat") for name in ("one", "two")]  # noqa: PTH118
    assert statuses == [
        (expected[0], "ok"),
        (expected[1], "ok"),
        ("one", "ok"),
        ("no*", "unreadable"),
    ]
    assert document["agree"] is True


# Processes.


def wait_for(ledger: Path, lines: int) -> None:
    """Wait until a ledger has this many lines."""
    for _ in range(1000):
        with suppress(
            FileNotFoundError
        ):  # d2rpick tests if the ledger can be written before it writes the first line
            if ledger.read_bytes().count(b"\n") >= lines:
                return
        time.sleep(0.02)
    raise AssertionError(f"{ledger} never had {lines} lines")


@pytest.mark.slow
def test_all_processes_give_the_answer_of_one(runs: list[str]) -> None:
    sources = [*runs, "absent.csv", *runs]
    expected = run(*STUDY, *sources).stdout
    assert (
        run("study", "--td", str(variants.TD), "--jobs", "3", *sources).stdout
        == expected
    )


@pytest.mark.slow
def test_rows_come_in_order_as_soon_as_they_can(
    runs: list[str], tmp_path: Path
) -> None:
    os.mkfifo(tmp_path / "slow.csv")  # the reader of the pipe waits
    args = (*STUDY[:-1], "2", "-f", "ndjson", "run1.csv", "slow.csv", "run2.csv")
    with start_program(*args, cwd=tmp_path, text=True) as process:
        assert process.stdout is not None
        assert json.loads(process.stdout.readline())["source"] == "run1.csv"
        (tmp_path / "slow.csv").write_bytes(Path(runs[2]).read_bytes())
        other_lines, _ = process.communicate(timeout=30)
    assert [line.get("source") for line in read_lines(other_lines)] == [
        "slow.csv",
        "run2.csv",
        None,
    ]


@pytest.mark.slow
@pytest.mark.parametrize("jobs", ["1", "2"])
def test_a_killed_study_loses_nothing_that_was_finished(
    runs: list[str], tmp_path: Path, jobs: str
) -> None:
    slow, ledger = tmp_path / "slow.csv", tmp_path / "ledger.ndjson"
    args = (
        *STUDY[:-1],
        jobs,
        "-f",
        "json",
        *runs[:2],
        str(slow),
        runs[2],
        "--resume",
        str(ledger),
    )
    os.mkfifo(slow)  # the reader of the pipe waits
    finished = 2 if jobs == "1" else 3
    with start_program(*args, cwd=tmp_path, text=True) as process:
        wait_for(ledger, finished)
        process.send_signal(signal.SIGKILL)
        text, _ = process.communicate(
            timeout=30
        )  # no process of the pool keeps the streams open
    assert (process.returncode, text) == (-signal.SIGKILL, "")
    with ledger.open("ab") as file:
        file.write(ledger.read_bytes().splitlines()[0][:200])  # as if it were writing
    slow.unlink()
    variants.write(slow, variants.make_variant(1.0005))
    again = run(*args)
    assert again.stderr.startswith(f"note: {finished} of 4 runs reused from {ledger}\n")
    whole = run(*(arg for arg in args if arg not in ("--resume", str(ledger))))
    assert {**json.loads(again.stdout), "command": 0} == {
        **json.loads(whole.stdout),
        "command": 0,
    }
    assert run(*args).stderr.startswith(f"note: 4 of 4 runs reused from {ledger}\n")


@pytest.mark.slow
@pytest.mark.parametrize(("jobs", "everyone"), [("1", True), ("2", True), ("2", False)])
def test_an_interrupted_study_ends_at_once_with_a_line(
    runs: list[str], tmp_path: Path, jobs: str, everyone: bool
) -> None:
    os.mkfifo(tmp_path / "slow.csv")
    ledger = tmp_path / "ledger.ndjson"
    args = (*STUDY[:-1], jobs, runs[0], "slow.csv", "--resume", str(ledger))
    with start_program(*args, cwd=tmp_path, text=True) as process:
        wait_for(ledger, 1)
        time.sleep(0.1)
        (os.killpg if everyone else os.kill)(process.pid, signal.SIGINT)
        text, error_output = process.communicate(timeout=30)
    assert (process.returncode, text, error_output.strip()) == (
        -signal.SIGINT,
        "",
        "d2rpick: interrupted",
    )


@pytest.mark.slow
def test_a_run_that_kills_its_process_is_a_row(
    runs: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # The system does the same if memory runs out.
    (tmp_path / "sitecustomize.py").write_text(
        "import os, d2rpick.choice.runs.study as study\n"
        "judge_run = study.judge_run\n"
        "def kill(question, source):\n"
        "    return os.abort() if source.endswith('deadly.csv') else judge_run(question, source)\n"
        "kill.__module__, kill.__qualname__ = 'd2rpick.choice.runs.study', 'judge_run'\n"
        "study.judge_run = kill\n"
    )
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(tmp_path), str(ROOT)]))
    args = (*STUDY[:-1], "2", "-f", "json", runs[0], "deadly.csv", *runs[1:])
    with start_program(*args, cwd=tmp_path, text=True) as process:
        text, _ = process.communicate(timeout=30)
    document = json.loads(text)
    assert [row["status"] for row in document["runs"]] == ["ok", "failed", "ok", "ok"]
    assert "memory" in document["runs"][1]["message"]
    assert process.returncode == 1


@pytest.mark.slow
@pytest.mark.parametrize("jobs", ["1", "2"])
def test_an_unforeseen_error_is_the_row_of_its_run(
    runs: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, jobs: str
) -> None:
    (tmp_path / "odd.csv").write_bytes(gzip.compress(Path(runs[0]).read_bytes()))
    (tmp_path / "sitecustomize.py").write_text(
        "import zlib\nzlib.decompressobj = lambda **_: 1 / 0\n"
    )
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(tmp_path), str(ROOT)]))
    args = (*STUDY[:-1], jobs, "-f", "json", "--exit-zero", runs[0], "odd.csv", runs[1])
    with start_program(*args, cwd=tmp_path, text=True) as process:
        text, _ = process.communicate(timeout=30)
    document = json.loads(text)
    check_by_schema(document)
    assert [row["status"] for row in document["runs"]] == ["ok", "internal-error", "ok"]
    assert document["runs"][1]["message"].startswith(
        "odd.csv: internal error, please report it (ZeroDivisionError"
    )
    assert process.returncode == 2


# Resuming.


def count_taken(args: Sequence[str]) -> str:
    """Return the number of runs that were taken from the ledger."""
    return next(
        (line for line in run(*args).stderr.splitlines() if "reused from" in line), ""
    )


def test_runs_are_computed_again_after_a_change(
    runs: list[str], tmp_path: Path
) -> None:
    ledger = str(tmp_path / "ledger.ndjson")
    args = (*STUDY, *runs, "--resume", ledger)
    assert count_taken(args) == ""
    assert count_taken(args) == f"note: 3 of 3 runs reused from {ledger}"
    changed = (
        "have changed, or were computed with other options, and are computed again"
    )
    assert (
        count_taken((*args, "--tolerance", "0.19"))
        == f"note: 0 of 3 runs reused from {ledger}; 3 {changed}"
    )
    os.utime(runs[1])
    assert count_taken(args) == f"note: 2 of 3 runs reused from {ledger}; 1 {changed}"
    assert count_taken((*args, "--tolerance", "0.19")).startswith("note: 2 of 3")
    assert run(*args, "-q").stderr == ""


def test_what_ndjson_gave_can_be_taken_up(runs: list[str], tmp_path: Path) -> None:
    ledger = put(
        tmp_path / "result.ndjson", run(*STUDY, *runs[:2], "-f", "ndjson").stdout
    )
    assert (
        count_taken((*STUDY, *runs, "--resume", str(ledger)))
        == f"note: 2 of 3 runs reused from {ledger}"
    )
    *_, third = read_lines(ledger.read_text())
    assert third["source"] == runs[2]


@pytest.mark.slow
def test_a_figure_of_runs_that_were_kept_without_outline_reads_them_again(
    runs: list[str], tmp_path: Path
) -> None:
    ledger, figure = str(tmp_path / "ledger.ndjson"), str(tmp_path / "figure.svg")
    run(*STUDY, *runs, "--resume", ledger)
    args = (*STUDY, *runs, "--resume", ledger, "--plot", figure, "--overwrite")
    assert count_taken(args).startswith("note: 0 of 3")
    first = Path(figure).read_bytes()
    assert count_taken(args).startswith("note: 3 of 3")
    assert Path(figure).read_bytes() == first


@pytest.mark.parametrize(
    ("option", "suffix"), [("-o", "svg"), ("--plot", "svg"), ("--report", "html")]
)
def test_a_ledger_is_never_replaced_by_a_result(
    runs: list[str], tmp_path: Path, option: str, suffix: str
) -> None:
    name = str(tmp_path / f"file.{suffix}")
    assert "are the same file" in read_refusal(
        *STUDY, *runs, "--resume", name, option, name, "--overwrite"
    )
    assert not Path(name).exists()


def test_a_ledger_is_not_the_standard_output(runs: list[str], tmp_path: Path) -> None:
    ledger = tmp_path / "ledger.ndjson"
    with (
        ledger.open("w") as file,
        start_program(
            *STUDY, *runs, "--resume", str(ledger), stdout=file, text=True
        ) as process,
    ):
        _, error_output = process.communicate(timeout=30)
    assert process.returncode == 2
    assert "standard output are the same file" in error_output


# Files.


@pytest.mark.parametrize(
    ("option", "suffix"), [("-o", "svg"), ("--plot", "svg"), ("--report", "html")]
)
def test_a_file_in_the_folder_of_a_run_is_never_written_to(
    tmp_path: Path, option: str, suffix: str
) -> None:
    # A database is recognised by its content; its name would not fit a plot.
    file = tmp_path / f"binout0.{suffix}"
    file.symlink_to(tmp_path / "glstat")
    (tmp_path / "glstat").write_bytes(Path(GLSTAT).read_bytes())
    content_before = (tmp_path / "glstat").read_bytes()
    result = run(*STUDY, str(tmp_path), option, str(file), "--overwrite")
    assert (result.exit_code, "this is an input" in result.stderr) == (2, True)
    assert (tmp_path / "glstat").read_bytes() == content_before


# The svg grows mostly with the number of curves, which is constant from eleven runs on.
@pytest.mark.slow
@pytest.mark.parametrize(
    ("number", "suffix"), [(3, "png"), (12, "pdf"), (3, "svg"), (12, "svg")]
)
def test_a_plot_shows_the_runs(
    runs: list[str], tmp_path: Path, number: int, suffix: str
) -> None:
    figure = tmp_path / f"figure.{suffix}"
    sources = (runs * 20)[:number]
    assert run(*STUDY, *sources, "absent.csv", "--plot", str(figure)).exit_code == 1
    content = figure.read_bytes()
    assert content.startswith(
        {"png": b"\x89PNG", "svg": b"<?xml", "pdf": b"%PDF"}[suffix]
    )
    if suffix == "svg":  # few runs have a name beside their curve, many have one legend
        label = (
            f"internal energy of {number} runs"
            if number > 10
            else Path(sources[0]).name
        )
        assert f"<!-- {label} -->" in content.decode()
    assert len(content) < 1e6


def test_a_plot_of_nothing_is_empty(tmp_path: Path) -> None:
    figure = tmp_path / "figure.svg"
    assert run(*STUDY, "absent.csv", "--plot", str(figure)).exit_code == 2
    assert figure.read_bytes().startswith(b"<?xml")


def test_the_report_is_one_page_with_all_of_it(runs: list[str], tmp_path: Path) -> None:
    page = tmp_path / "page.html"
    odd = variants.write(tmp_path / "a<b>&.csv")
    result = run(*STUDY, *runs, odd, "absent.csv", "--report", str(page))
    text = page.read_text()
    assert result.exit_code == 1
    assert text.startswith("<!DOCTYPE html>")
    assert "Switch times of 5 runs" in text
    assert "a&lt;b&gt;&amp;.csv" in text
    assert "a<b>" not in text
    assert all(
        name in text
        for name in (
            *runs,
            "absent.csv",
            "no such file",
            "runs-left-out",
            "d2rpick study --td",
        )
    )
    assert "http://" not in text.replace("http://www.w3.org", "")
    assert (
        run(*STUDY, "absent.csv", "--report", str(page), "--overwrite").exit_code == 2
    )
    assert "None: no run could be judged" in page.read_text()


def test_a_study_of_one_run_gives_the_verdict_of_suggest() -> None:
    """The error of the pair exceeds 0.5, but matters little in the next contact."""
    question = (
        "--td",
        "0.37",
        "--part",
        "flying",
        str(ROOT / "sample_data/rollover_box.matsum"),
    )
    suggestion = run_json("suggest", *question)
    study = run_json("study", *question)
    assert suggestion["candidates"][0]["residual"] > 0.5
    assert study["common_verdict"] == suggestion["verdict"] == "use with care"
    assert study["runs"][0]["verdict"] == suggestion["verdict"]


def test_a_study_says_which_energy_it_judged_and_how_to_choose_parts(
    tmp_path: Path,
) -> None:
    """The files show which parts fly, but the energy of the whole model was judged."""
    page = tmp_path / "page.html"
    result = run("study", MATSUM, "--report", str(page))
    assert re.search(
        r"(?m)^judged +internal energy.*, not that of chosen parts \(--part\)$",
        result.stdout,
    )
    step = "choose the parts to switch, for example those that fly, with d2rpick study --part flying"
    assert step in " ".join(result.stdout.split())
    assert "not that of chosen parts (--part)" in page.read_text()
    (row,) = run_json_checked("study", MATSUM)["runs"]
    assert row["is_unchosen"] is True
    assert row["parts"] is None


def test_a_study_of_chosen_parts_names_their_energy() -> None:
    result = run("study", "--part", "1,2", MATSUM)
    assert re.search(r"(?m)^judged +internal energy of box, step$", result.stdout)
    assert "choose the parts" not in result.stdout
    (row,) = run_json("study", "--part", "1,2", MATSUM)["runs"]
    assert row["energy"] == "internal energy of box, step"
    assert (row["parts"], row["is_unchosen"]) == ([1, 2], False)


def test_a_study_of_a_table_without_parts_names_its_column() -> None:
    result = run("study", "--td", "0.0687534", ENERGY)
    assert re.search(r"(?m)^judged +internal_energy$", result.stdout)


def test_the_recommended_set_is_refused_before_any_run_is_read() -> None:
    refusal = read_refusal("study", "--part", "recommended", "absent.csv")
    assert "--part recommended needs a deck" in refusal
    assert "d2rpick parts" in refusal
