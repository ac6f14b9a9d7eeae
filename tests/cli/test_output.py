"""Destination and form of results: formats, files, figures, colours and exit codes."""

import csv
import hashlib
import io
import json
import os
import re
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from d2rpick import __version__
from d2rpick.cli import COMMANDS, progress
from tests.command import (
    BOX,
    DECK,
    ENERGY,
    GLSTAT,
    MATSUM,
    OSCILLATOR,
    ROLLOVER,
    ROOT,
    put,
    read_refusal,
    run,
    run_json,
    start_program,
)
from tests.json_schemas import check_by_schema, run_json_checked

SUGGEST = ("suggest", "--td", "0.064")
VERIFY = ("verify", "--tr", "0.0135867", "--td", "0.0687534")
ALONE = ("--no-verify", "--energy", "boxIE_J", ROLLOVER)  # judged by the energy alone
NOTHING = (*SUGGEST, "--max-residual", "0.5", ENERGY)  # reported as a problem
ANSWERS = [
    (*SUGGEST, ENERGY),
    (*SUGGEST, GLSTAT),
    NOTHING,
    ("suggest", "--td", "0.37", *ALONE),
    (*VERIFY, ENERGY),
    ("verify", "--tr", "0.1", "--td", "0.37", *ALONE),
]
FORMATS = {
    "suggest": ("table", "json", "csv", "markdown", "value"),
    "verify": ("table", "json", "csv", "markdown"),
}

TEXTS = (
    *("kind", "notes", "reasons", "quality"),
    *("verdict", "verdict_reason", "cure", "expected_after_td", "worst_case"),
)
FIRST_BYTES = {"png": b"\x89PNG\r\n", "svg": b"<?xml", "pdf": b"%PDF-"}
PERIOD = 0.02


def read_rows(text: str) -> list[dict[str, Any]]:
    """Return the rows of a CSV result with the types of JSON."""
    return [
        {key: _convert_cell(key, cell) for key, cell in row.items()}
        for row in csv.DictReader(io.StringIO(text))
    ]


def _convert_cell(key: str, cell: str) -> Any:
    if key in TEXTS:
        return cell
    return json.loads(cell) if cell else None


# Formats.


@pytest.mark.parametrize("args", ANSWERS)
def test_json_follows_the_schema_and_says_where_it_comes_from(
    args: tuple[str, ...],
) -> None:
    document = run_json_checked(*args)
    assert document["tool_version"] == __version__
    assert document["command"] == [*args, "-f", "json"]
    assert document["history"]["source"] == [args[-1]]
    assert document["history"]["sha256"] == [
        hashlib.sha256(Path(args[-1]).read_bytes()).hexdigest()
    ]


@pytest.mark.parametrize("key", ["td", "candidates", "history", "warnings"])
def test_the_schema_asks_for_what_scripts_rely_on(key: str) -> None:
    document = run_json(*SUGGEST, ENERGY)
    del document[key]
    with pytest.raises(jsonschema.ValidationError, match=key):
        check_by_schema(document)


@pytest.mark.parametrize("args", ANSWERS)
def test_csv_holds_the_numbers_of_json_to_the_last_digit(args: tuple[str, ...]) -> None:
    document, rows = run_json(*args), read_rows(run(*args, "-f", "csv").stdout)
    expected = document["candidates"] if args[0] == "suggest" else [document]
    assert len(rows) == len(expected)
    for row, json_row in zip(rows, expected, strict=True):
        assert row.pop("td") == document["td"]
        assert row == {
            key: "; ".join(json_row[key])
            if isinstance(json_row[key], list)
            else json_row[key]
            for key in row
        }
    if args[0] == "suggest":
        assert set(rows[0]) == set(expected[0])


@pytest.mark.parametrize("source", [ENERGY, GLSTAT])
def test_value_is_the_recommended_tr_in_the_shortest_digits_that_read_back(
    source: str,
) -> None:
    text = run(*SUGGEST, "-f", "value", source).stdout
    assert text.endswith("\n")
    assert float(text) == run_json(*SUGGEST, source)["recommended"]["tr"]
    assert text.strip() == repr(float(text))


@pytest.mark.parametrize("args", ANSWERS)
def test_markdown_begins_with_the_verdict_and_has_a_table(
    args: tuple[str, ...],
) -> None:
    verdict, *paragraphs = run(*args, "-f", "markdown").stdout.split("\n\n")
    assert re.match("(use|use with care|do not use|no pair to use): ", verdict)
    table = next(paragraph for paragraph in paragraphs if paragraph.startswith("|"))
    head, rule, *rows = [
        line.strip("|\n").split("|") for line in table.rstrip("\n").split("\n")
    ]
    assert {cell.strip() for cell in rule} == {"---"}
    assert rows
    assert {len(row) for row in (rule, *rows)} == {len(head)}


def test_the_table_names_what_it_rests_on_and_marks_the_recommended_row() -> None:
    lines = run(*SUGGEST, ENERGY).stdout.splitlines()
    assert lines[:4] == [
        "do not use  tr = 0.0128853, td = 0.064",
        "why         the vibration after td is wrong by 96%, since 92% of its energy is kinetic at td, and no",
        "            tr can keep kinetic energy",
        "to improve  use tr = 0.0135867, td = 0.0687534: vibration error 0.0%",
    ]
    assert lines[4].startswith(
        "expect      mean energy after td 8% of the reference run, vibration error 96% (residual 0.957)"
    )
    assert "motion     good" in lines
    assert "rigid for  0.0511147, 34% of the simulated time" in lines
    words = " ".join("\n".join(lines).split())
    assert f"history {ENERGY}: csv, internal" in words
    assert [line.split()[1] for line in lines if line.startswith("*")] == ["0.0128853"]
    assert "do not use" in next(line for line in lines if line.startswith("*"))


@pytest.mark.slow
@settings(max_examples=15, deadline=None)
@given(
    energy=st.lists(
        st.floats(-1e3, 1e6, allow_subnormal=False), min_size=3, max_size=40
    ),
    step=st.floats(1e-6, 1e3),
    share=st.floats(0.01, 1.0),
)
def test_whatever_the_energies_every_format_gives_one_answer(
    tmp_path_factory: pytest.TempPathFactory,
    energy: list[float],
    step: float,
    share: float,
) -> None:
    file = tmp_path_factory.mktemp("history") / "random.csv"
    time = step * np.arange(len(energy))
    file.write_text(
        "time,energy\n"
        + "".join(f"{t!r},{e!r}\n" for t, e in zip(time.tolist(), energy, strict=True))
    )
    args = ("suggest", "--td", repr(float(share * time[-1])), "-q", str(file))
    document = run_json_checked(*args)
    results = {name: run(*args, "-f", name) for name in FORMATS["suggest"]}
    assert {result.exit_code for result in results.values()} == {
        0 if document["recommended"] else 1
    }
    assert [row["tr"] for row in read_rows(results["csv"].stdout)] == [
        c["tr"] for c in document["candidates"]
    ]
    assert results["value"].stdout == (
        f"{document['recommended']['tr']!r}\n" if document["recommended"] else ""
    )


# Exit codes and streams.


@pytest.mark.parametrize(
    ("args", "code"),
    [
        ((*SUGGEST, ENERGY), 0),
        (NOTHING, 1),
        ((*SUGGEST, "absent.csv"), 2),
        ((*VERIFY, ENERGY), 0),
        (("verify", "--tr", "0.02", "--td", "0.064", ENERGY), 1),
        (("verify", "--tr", "0.07", "--td", "0.064", ENERGY), 2),
    ],
)
def test_the_exit_code_does_not_depend_on_the_format_and_objections_can_be_let_pass(
    args: tuple[str, ...], code: int
) -> None:
    formats = FORMATS[args[0]]
    assert [run(*args, "-f", name).exit_code for name in formats] == [code] * len(
        formats
    )
    assert run(*args, "--exit-zero").exit_code == {0: 0, 1: 0, 2: 2}[code]


def test_warnings_go_to_stderr_and_quiet_silences_them_but_not_errors() -> None:
    loud, quiet = run(*SUGGEST, ENERGY), run(*SUGGEST, "--quiet", ENERGY)
    assert loud.stderr.startswith("warning: poor-td: ")
    assert "poor-td" not in loud.stdout
    assert (quiet.stdout, quiet.stderr) == (loud.stdout, "")
    assert run(*SUGGEST, "-q", "absent.csv").stderr.startswith("d2rpick: ")


def test_notes_of_a_reader_go_to_stderr_and_into_json(tmp_path: Path) -> None:
    cut = put(tmp_path / "cut.csv", Path(ENERGY).read_bytes()[:-40])
    document, result = run_json(*SUGGEST, str(cut)), run(*SUGGEST, str(cut))
    assert document["history"]["complete"] is False
    assert "truncated-input" in [warning["code"] for warning in document["warnings"]]
    assert [
        f"note: {note}" for note in document["history"]["notes"]
    ] == result.stderr.splitlines()[:1]


def test_a_truncated_file_is_reported_once_with_the_end_of_its_record(
    tmp_path: Path,
) -> None:
    cut = put(tmp_path / "cut.glstat", Path(GLSTAT).read_bytes()[:-40])
    document, result = run_json(*SUGGEST, str(cut)), run(*SUGGEST, str(cut))
    assert document["history"]["complete"] is False
    (note,) = document["history"]["notes"]
    assert "the file ends within" in note
    (told,) = (line for line in result.stderr.splitlines() if "ends within" in line)
    end = document["history"]["time_end"]
    assert told.startswith("warning: truncated-input: the input ends within a state, ")
    assert f"times after {end:.6g} are unknown; let the run finish, or copy" in told


@pytest.mark.parametrize(
    "terminal", [False, True]
)  # CliRunner's colour option stands in for a terminal
@pytest.mark.parametrize(
    ("args", "line"),
    [
        ((*SUGGEST, ENERGY), r"\*"),
        ((*VERIFY, "--no-verify", ENERGY), "do not use  "),
        (("check", DECK, "--history", ENERGY), r"  \S+:43:21: error"),
    ],
)
def test_what_stands_out_does_so_on_terminals_and_where_asked_for(
    args: tuple[str, ...], line: str, terminal: bool, tmp_path: Path
) -> None:
    styled_by_variables = {
        (): terminal,
        ("FORCE_COLOR",): True,
        ("NO_COLOR",): False,
        ("NO_COLOR", "FORCE_COLOR"): False,
    }
    for names, coloured in styled_by_variables.items():
        result = run(*args, color=terminal, env=dict.fromkeys(names, "1")).stdout
        assert (
            bool(re.search(rf"(?m)^\x1b\[1m{line}", result))
            == coloured
            == ("\x1b" in result)
        )
    file = tmp_path / "result.txt"
    run(*args, "-o", str(file), color=terminal, env={"FORCE_COLOR": "1"})
    assert "\x1b" not in file.read_text()


# Files.


@pytest.mark.parametrize("form", FORMATS["suggest"])
def test_a_file_gets_what_stdout_would_have_got(form: str, tmp_path: Path) -> None:
    file = tmp_path / "result"
    to_file, to_stdout = (
        run(*SUGGEST, ENERGY, "-f", form, "-o", str(file)),
        run(*SUGGEST, ENERGY, "-f", form),
    )
    assert (to_file.exit_code, to_file.stdout, to_file.stderr) == (
        0,
        "",
        to_stdout.stderr,
    )
    written, printed = file.read_text(), to_stdout.stdout
    if form == "json":
        assert {**json.loads(written), "command": []} == {
            **json.loads(printed),
            "command": [],
        }
    else:
        assert written == printed
    assert [path.name for path in tmp_path.iterdir()] == ["result"]


# Options that write a file, with a suffix that each accepts.
_SUFFIXES = {"-o": ".txt", "--plot": ".svg", "--report": ".html"}


@pytest.mark.parametrize("option", _SUFFIXES)
def test_a_file_is_replaced_only_when_that_was_asked_for(
    option: str, tmp_path: Path
) -> None:
    suffix = _SUFFIXES[option]
    file = put(tmp_path / f"result{suffix}", "kept")
    assert "the file exists; give another one or --overwrite" in read_refusal(
        *SUGGEST, ENERGY, option, str(file)
    )
    assert "no such folder" in read_refusal(
        *SUGGEST, ENERGY, option, str(tmp_path / "no" / f"a{suffix}")
    )
    assert file.read_text() == "kept"
    assert run(*SUGGEST, ENERGY, option, str(file), "--overwrite").exit_code == 0
    assert file.read_text() != "kept"


@pytest.mark.parametrize("option", _SUFFIXES)
@pytest.mark.parametrize("spelling", ["energy", "./energy", "link"])
@pytest.mark.usefixtures("here")
def test_an_input_is_never_written_to(option: str, spelling: str) -> None:
    suffix = _SUFFIXES[option]
    table = Path(f"energy{suffix}")
    table.write_bytes(Path(ENERGY).read_bytes())
    Path(f"link{suffix}").symlink_to(table)
    assert "this is an input" in read_refusal(
        *SUGGEST, str(table), option, f"{spelling}{suffix}", "--overwrite"
    )
    assert table.read_bytes() == Path(ENERGY).read_bytes()


def test_a_write_that_fails_leaves_the_old_file_and_nothing_else(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: object) -> None:
        raise PermissionError(13, "Permission denied")

    file = put(tmp_path / "result.txt", "old")
    monkeypatch.setattr(Path, "replace", fail)
    message = read_refusal(*SUGGEST, ENERGY, "-q", "-o", str(file), "--overwrite")
    assert message.startswith(f"{file}: cannot be written (Permission denied)")
    assert [path.read_text() for path in tmp_path.iterdir()] == ["old"]


def test_a_link_stays_and_the_file_behind_it_is_replaced(tmp_path: Path) -> None:
    (tmp_path / "target").write_text("old")
    (tmp_path / "link").symlink_to("target")
    assert (
        run(
            *SUGGEST, ENERGY, "-f", "value", "-o", str(tmp_path / "link"), "--overwrite"
        ).exit_code
        == 0
    )
    assert (tmp_path / "link").is_symlink()
    assert float((tmp_path / "target").read_text()) > 0


def test_a_named_pipe_is_written_to_and_stays_one(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    received: list[str] = []
    reader = threading.Thread(
        target=lambda: received.append(pipe.read_text()), daemon=True
    )
    reader.start()
    assert (
        run(*SUGGEST, ENERGY, "-f", "value", "-o", str(pipe), "--overwrite").exit_code
        == 0
    )
    reader.join(timeout=10)
    assert received == [run(*SUGGEST, ENERGY, "-f", "value").stdout]
    assert pipe.is_fifo()


# Figures.


@pytest.mark.slow
@pytest.mark.parametrize(
    ("suffix", "args"),
    [
        *((suffix, (*SUGGEST, "--no-verify", ENERGY)) for suffix in FIRST_BYTES),
        ("svg", NOTHING),
        ("svg", ("suggest", "--td", "0.37", *ALONE)),
        ("svg", (*VERIFY, ENERGY)),
        (
            "svg",
            (
                "replay",
                *OSCILLATOR,
                "--t-end",
                "0.15",
                "--dt",
                "1e-4",
                "--tr",
                "0.013",
                "--td",
                "0.064",
            ),
        ),
    ],
)
def test_a_plot_is_drawn_in_the_format_of_its_suffix(
    suffix: str, args: tuple[str, ...], tmp_path: Path
) -> None:
    file = tmp_path / f"figure.{suffix.upper()}"
    result = run(*args, "--plot", str(file))
    assert result.exit_code == (1 if args == NOTHING else 0)
    assert file.read_bytes().startswith(FIRST_BYTES[suffix])
    assert [path.name for path in tmp_path.iterdir()] == [file.name]


def test_the_plot_comes_beside_the_result_and_shows_the_switch_times(
    tmp_path: Path,
) -> None:
    file = tmp_path / "figure.svg"
    assert (
        run(*SUGGEST, ENERGY, "--plot", str(file)).stdout
        == run(*SUGGEST, ENERGY).stdout
    )
    drawn = file.read_text()
    for label in ("tr = 0.0128853", "td = 0.064"):
        assert f"<!--  {label}  -->" in drawn


def test_no_recommendation_leaves_no_older_one_in_the_file(tmp_path: Path) -> None:
    file = put(tmp_path / "tr.txt", "0.0128853\n")
    result = run(*NOTHING, "-f", "value", "-o", str(file), "--overwrite")
    assert (result.exit_code, file.read_text()) == (1, "")


def test_a_name_that_promises_another_format_is_told(tmp_path: Path) -> None:
    message = "-f json writes what its name promises"
    name = str(tmp_path / "answer.json")
    result = run("suggest", "--td", "0.0687534", "-o", name, ENERGY)
    assert (result.exit_code, result.stderr.count(message)) == (0, 1)
    for options in (("-f", "json"), ("-f", "table"), ("-q",)):
        result = run(
            "suggest", "--td", "0.0687534", "--overwrite", *options, "-o", name, ENERGY
        )
        assert (result.exit_code, result.stderr) == (0, "")
    assert (
        "-f csv writes what its name promises"
        in run("check", "-o", str(tmp_path / "found.csv"), DECK).stderr
    )
    assert (
        "-f ndjson writes what its name promises"
        in run("info", "-o", str(tmp_path / "read.ndjson"), ENERGY).stderr
    )
    pair = ("--tr", "0.0135867", "--td", "0.0687534")
    assert (
        run("verify", *pair, "-o", str(tmp_path / "judged.ndjson"), ENERGY).stderr == ""
    )  # it has no ndjson
    assert (
        run(
            "replay",
            *OSCILLATOR,
            "--t-end",
            "0.1",
            "--dt",
            "0.01",
            "-o",
            str(tmp_path / "run.csv"),
        ).stderr
        == ""
    )


def test_a_report_is_a_file_of_its_own_and_not_named_what_it_is_not(
    tmp_path: Path,
) -> None:
    for name, message in (
        (str(tmp_path / "report.PDF"), "the report is an HTML page"),
        ("-", "--report writes a file"),
    ):
        assert message in read_refusal(
            *SUGGEST, "--report", name, "--plot", str(tmp_path / "a.svg"), ENERGY
        )
    assert [*tmp_path.iterdir()] == []


pty = pytest.importorskip("pty", reason="terminals are a matter of POSIX")


class Terminal(io.StringIO):
    """Stand-in for stderr that is a terminal."""

    def isatty(self) -> bool:
        return True


def read_rest(terminal: int) -> bytes:
    """Read the remaining content of a terminal to which nobody writes any more."""
    output = b""
    with suppress(OSError):  # Linux reports a closed other end this way
        while piece := os.read(terminal, 1000):
            output += piece
    os.close(terminal)
    return output


def show_progress(
    stream: io.StringIO, names: Sequence[str], *, periods: float, quiet: bool = False
) -> str:
    """Return the content of ``stream`` after this many periods of reading."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "stderr", stream)
        patch.setenv("COLUMNS", "40")
        with progress.show_reading(names, quiet=quiet, period=PERIOD):
            time.sleep(periods * PERIOD)
    return stream.getvalue()


def test_a_line_counts_the_time_and_is_erased() -> None:
    pieces = show_progress(Terminal(), ["glstat"], periods=10).split("\r")
    assert pieces[0] == pieces[-1] == ""
    assert pieces[1] == "reading glstat ... 0 s"
    assert pieces[-2] == " " * len(pieces[-3])
    assert len(pieces) > 5


def test_several_files_are_counted_and_a_long_name_does_not_wrap() -> None:
    long = show_progress(
        Terminal(), ["a/very/long/name/" * 5 + "binout0000", "b", "c"], periods=5
    ).split("\r")[1]
    assert long.endswith("/binout0000 and 2 more ... 0 s")
    assert len(long) == 39


def test_a_long_computation_is_shown_too(monkeypatch: pytest.MonkeyPatch) -> None:
    stream = Terminal()
    monkeypatch.setattr(sys, "stderr", stream)
    with progress.show_computing(quiet=False, period=PERIOD):
        time.sleep(5 * PERIOD)
    assert stream.getvalue().split("\r")[1] == "computing ... 0 s"


@pytest.mark.parametrize("case", ["no terminal", "quiet", "fast"])
def test_nothing_is_shown_otherwise(case: str) -> None:
    stream = io.StringIO() if case == "no terminal" else Terminal()
    assert (
        show_progress(
            stream,
            ["glstat"],
            periods=0 if case == "fast" else 5,
            quiet=case == "quiet",
        )
        == ""
    )


def test_an_error_is_shown_on_a_clean_line(monkeypatch: pytest.MonkeyPatch) -> None:
    stream = Terminal()
    monkeypatch.setattr(sys, "stderr", stream)

    def fail() -> None:
        with progress.show_reading(["glstat"], quiet=False, period=PERIOD):
            time.sleep(5 * PERIOD)
            raise ValueError("broken")

    with pytest.raises(ValueError, match="broken"):
        fail()
    assert stream.getvalue().endswith(" \r")


@pytest.mark.slow
def test_a_program_that_waits_for_its_input_says_so_on_the_terminal() -> None:
    master, slave = pty.openpty()
    with start_program(
        "info", "-f", "csv", "-", stdin=subprocess.PIPE, stderr=slave
    ) as process:
        os.close(slave)
        first = os.read(master, 1000)  # blocks until there is output
        result, _ = process.communicate(Path(ENERGY).read_bytes(), timeout=30)
    output = read_rest(master)
    assert first.startswith(b"\rreading standard input ... 1 s")
    assert output.endswith(b" \r")
    assert process.returncode == 0
    assert result.startswith(b"source,format,")


@pytest.mark.slow
@pytest.mark.parametrize("quiet", [False, True])
def test_the_runs_of_a_scan_are_counted_until_it_is_interrupted(quiet: bool) -> None:
    master, slave = pty.openpty()
    options = ["--quiet"] if quiet else []
    with start_program(
        "rollover", "--scan", "--mesh", "4", "--jobs", "2", *options, stderr=slave
    ) as process:
        os.close(slave)
        terminal_text = b""
        if quiet:
            time.sleep(2.5)  # other commands would have reported progress by now
        while not quiet and b" runs" not in terminal_text:
            terminal_text += os.read(master, 1000)
        os.killpg(process.pid, signal.SIGINT)  # like a terminal, to the children too
        process.communicate(timeout=30)
    terminal_text += read_rest(master)
    assert process.returncode == -signal.SIGINT
    assert b"Traceback" not in terminal_text
    assert terminal_text.endswith(b"d2rpick: interrupted\r\n")
    assert (
        terminal_text == b"\r\nd2rpick: interrupted\r\n"
        if quiet
        else re.search(rb"\r\d+ of \d+ runs[,\r]", terminal_text)
    )


def test_runs_are_counted_with_the_time_that_is_left(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    stream = Terminal()
    monkeypatch.setattr(sys, "stderr", stream)
    with progress.show_counting(9, quiet=False, period=PERIOD) as count:
        count.done = count.taken = 3
        time.sleep(5 * PERIOD)
        count.done = 5
        time.sleep(5 * PERIOD)
    assert "\r3 of 9 runs\r" in stream.getvalue()
    assert "\r5 of 9 runs, 0:00 left\r" in stream.getvalue()
    assert stream.getvalue().endswith(" \r")
    # Two runs took 60 s, so the next two will take as long.
    count = progress.Count(total=9)
    count.tell(3)
    count.tell(5)
    assert count.told(60) == "5 of 9 runs, 2:00 left"


# Widths.


@pytest.mark.parametrize("columns", [80, 500])
@pytest.mark.parametrize(
    "args",
    [
        (*SUGGEST, ENERGY),
        (
            "suggest",
            "-v",
            "--td",
            "0.37",
            "--energy",
            "boxIE_J",
            "--no-verify",
            ROLLOVER,
        ),
        (
            "explore",
            "--td-window",
            "0.06",
            "0.07",
            "--steps",
            "5",
            "--no-verify",
            ENERGY,
        ),
        ("plan", "--no-verify", ENERGY),
        (*VERIFY, "--no-verify", ENERGY),
        ("info", ENERGY),
        ("follow", "--once", "--part", "box", BOX),
        ("rule",),
        ("rule", "D2R001", "D2R206", "D2R409"),
        ("check", DECK, "--history", ENERGY),
        *((command, "--help") for command in COMMANDS),
    ],
)
def test_nothing_on_stdout_is_wider_than_the_terminal(
    args: tuple[str, ...], columns: int
) -> None:
    """Only a command stands in one line however long it is, so that it can be copied."""
    result = run(*args, env={"COLUMNS": str(columns)})
    lines = result.stdout.replace(str(ROOT), "").splitlines()
    texts = [line for line in lines if not line.lstrip().startswith("d2rpick ")]
    assert max(map(len, texts)) <= min(columns, 100)


def test_an_error_ends_where_the_terminal_does() -> None:
    args = ("suggest", "--td", "0.06", "--part", "1", ENERGY)
    assert (
        run(*args, env={"COLUMNS": "80"}).stderr.count("\n") == 1
    )  # a log is not a terminal
    master, slave = pty.openpty()
    with start_program(
        *args, stderr=slave, env={**os.environ, "COLUMNS": "80"}
    ) as process:
        os.close(slave)
        process.wait(timeout=30)
    assert (
        max(map(len, read_rest(master).decode().replace(str(ROOT), "").splitlines()))
        <= 80
    )


def test_columns_without_a_value_are_left_out_and_three_rows_are_shown() -> None:
    args = ("suggest", "--td", "0.37", "--energy", "boxIE_J", "--no-verify", ROLLOVER)
    brief, full = run(*args, "-q").stdout, run(*args, "-q", "-v").stdout
    assert sum(line[6:7].isdigit() for line in brief.splitlines()) == 3
    assert not re.search(r"  -( |$)", brief)
    assert "crossing" not in brief
    assert "crossing" in full
    assert (
        "basis       energy alone (the direction of the deformation is unknown)\n"
        in brief
    )
    assert (
        "(the direction of the deformation is unknown): identification was switched off"
        in " ".join(full.split())
    )


def test_a_td_at_the_landing_is_answered_by_its_reason_and_the_pair_before_it() -> None:
    result = run("suggest", "--td", "0.38", "--part", "box", MATSUM)
    assert result.exit_code == 1
    first, second, *_ = result.stdout.split("\n")
    assert (
        first == "no pair to use  td = 0.38 lies after the end of the flight at 0.379"
    )
    assert second.startswith("next            choose both times in the flight with")
    assert " verdict" not in result.stdout
    assert "no-candidate" not in result.stderr
    assert (
        "no-candidate"
        in run("suggest", "--td", "0.38", "--part", "box", MATSUM, "-f", "value").stderr
    )


def test_a_td_that_was_given_is_answered_however_poor_and_none_is_chosen_so() -> None:
    poor = ("--max-residual", "2", ENERGY)
    result = run(*SUGGEST, *poor)
    chosen = run("suggest", "--td-window", "0.063", "0.065", *poor)
    for answered in (result, chosen):
        assert answered.stdout.startswith("do not use  tr = ")
    assert (result.exit_code, chosen.exit_code) == (0, 1)
