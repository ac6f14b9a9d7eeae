"""Closed streams, full disks, interrupts and damaged files give one error line, or the result."""

import gzip
import io
import json
import os
import signal
import subprocess
import sys
import zlib
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from tests.command import (
    ENERGY,
    GLSTAT,
    INTERRUPTIBLE,
    ROOT,
    TIME_LIMIT,
    put,
    read_refusal,
    run,
    run_json,
    start_program,
)
from tests.made_binout import make_binout as made_binout
from tests.made_t01 import make_t01, make_value
from tests.text_files import make_glstat_text, make_matsum_text

SIGNALLING = 0x7FA00000.to_bytes(4)  # a NaN on which the machine raises a flag
ODD = {
    "binout": bytes(made_binout(range(1, 9)).data).replace(
        np.float32(3 / 8).tobytes(), SIGNALLING[::-1]
    ),  # a time
    "T01": bytes(make_t01(8).data).replace(
        np.array(make_value(3, 0, 1), ">f4").tobytes(), SIGNALLING
    ),  # an energy
    "matsum": make_matsum_text([0.0, 0.1], [1, 2], np.ones((2, 2))).replace(
        b"mat.#=    1   ", b"mat.#=" + b"1" * 5000
    ),
}


def run_in_shell(command: str, *args: str | Path) -> subprocess.CompletedProcess[str]:
    """Call the program in a shell, which can close streams and limit memory; ``$@`` are the arguments."""
    program = f'd2rpick() {{ "{sys.executable}" -m d2rpick "$@"; }}; {command}'
    return subprocess.run(
        ["bash", "-c", program, "bash", *args], cwd=ROOT, capture_output=True, text=True, check=False,
        timeout=TIME_LIMIT,
    )  # fmt: skip


def read_one_line(result: subprocess.CompletedProcess[str]) -> str:
    """Return the message of a call that failed."""
    assert (result.returncode, result.stdout, result.stderr.count("\n")) == (
        2,
        "",
        1,
    ), result
    assert "internal error" not in result.stderr
    return result.stderr


def test_standard_input_that_is_closed_is_told() -> None:
    assert "-: standard input is closed" in read_one_line(
        run_in_shell("d2rpick info - <&-")
    )
    assert "-: standard input is closed" in read_one_line(
        run_in_shell("d2rpick study --td 1 --from - <&-")
    )


@pytest.mark.parametrize(
    "args", ["--help", "suggest --td 0.064 -q", "study --td 0.064 -qf ndjson"]
)
def test_a_result_that_nobody_can_get_is_no_success(args: str) -> None:
    for closed, message in (
        (">&-", "standard output is closed; open it"),
        (">/dev/full", "No space left on device"),
    ):
        if Path("/dev/full").exists() or closed == ">&-":
            assert message in read_one_line(
                run_in_shell(f'd2rpick {args} "$@" {closed}', ENERGY)
            )


def test_a_closed_stdout_is_not_missed_where_nothing_is_written_to_it(
    tmp_path: Path,
) -> None:
    process_result = run_in_shell(
        'd2rpick suggest --td 0.064 -qf value "$1" -o "$2" >&-', ENERGY, tmp_path / "tr"
    )
    assert (process_result.returncode, process_result.stderr) == (0, "")
    assert float((tmp_path / "tr").read_text()) == pytest.approx(0.0128852793630525)


def test_an_interrupt_during_the_imports_ends_the_program_without_a_word(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "click.py").write_text(
        "import os, signal\nos.kill(os.getpid(), signal.SIGINT)\nwhile True: pass\n"
    )
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(tmp_path), str(ROOT)]))
    with start_program("info", ENERGY) as process:
        assert process.communicate() == (b"", b"")
    assert process.returncode == -signal.SIGINT


@pytest.mark.parametrize(
    ("rest", "message"),
    [("raise SystemExit(0)", b""), ("while True: pass", b"d2rpick: interrupted")],
)
def test_an_interrupt_that_a_library_swallows_ends_the_program_all_the_same(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, rest: str, message: bytes
) -> None:
    """This happens in a finalizer of an object, or while an extension module is imported."""
    (tmp_path / "numpy.py").write_text(
        "import os, signal\n"
        "class Swallowing:\n"
        "    def __del__(self):\n"
        "        os.kill(os.getpid(), signal.SIGINT)\n"
        "Swallowing()\n"
        f"{rest}\n"
    )
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(tmp_path), str(ROOT)]))
    with start_program("info", ENERGY) as process:
        output, errors = process.communicate()
    assert (output, errors.strip()) == (b"", message)
    assert process.returncode == -signal.SIGINT


def test_an_interrupt_ends_the_program_though_a_thread_goes_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Python waits for all threads at its end, and a thread may wait for a process that has died."""
    (tmp_path / "numpy.py").write_text(
        "import os, signal, threading, time\n"
        "threading.Thread(target=time.sleep, args=(300,)).start()\n"
        "os.kill(os.getpid(), signal.SIGINT)\n"
    )
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(tmp_path), str(ROOT)]))
    with start_program("info", ENERGY) as process:
        output, errors = process.communicate(timeout=30)
    assert (output, errors.strip()) == (b"", b"d2rpick: interrupted")
    assert process.returncode == -signal.SIGINT


def test_an_interrupt_while_a_class_is_made_is_no_error_of_the_program(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Python 3.11 raises a RuntimeError in this case."""
    (tmp_path / "numpy.py").write_text(
        "import os, signal\n"
        "class Named:\n"
        "    def __set_name__(self, owner, name):\n"
        "        os.kill(os.getpid(), signal.SIGINT)\n"
        "class Owner:\n"
        "    value = Named()\n"
    )
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(tmp_path), str(ROOT)]))
    with start_program("info", ENERGY) as process:
        assert process.communicate()[1].strip() == b"d2rpick: interrupted"
    assert process.returncode == -signal.SIGINT


@pytest.mark.parametrize("command", ["study --td 0.064 --jobs 1", "info"])
def test_an_interrupt_ends_the_loop_of_a_shell(tmp_path: Path, command: str) -> None:
    """The reader of the run opens the pipe and then waits in it for the interrupt."""
    pipe = tmp_path / "run.csv"
    os.mkfifo(pipe)
    python = f'"{sys.executable}" -c "{INTERRUPTIBLE}"'
    loop = f'for run in 1 2 3; do {python} {command} "{pipe}"; echo "after $?"; done'
    trap = [
        sys.executable,
        "-c",
        "import os, signal, sys; signal.signal(2, signal.SIG_DFL); os.execvp('bash', sys.argv[1:])",
    ]
    with (
        subprocess.Popen(
            [*trap, "bash", "-c", loop],
            cwd=ROOT,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            start_new_session=True,
        ) as shell,
        pipe.open("wb"),
    ):
        os.killpg(shell.pid, signal.SIGINT)
        shell_output, errors = shell.communicate(timeout=TIME_LIMIT)
    assert (shell.returncode, shell_output, errors.strip()) == (
        -signal.SIGINT,
        b"",
        b"d2rpick: interrupted",
    )


def test_a_job_that_ignores_interrupts_goes_on(tmp_path: Path) -> None:
    pipe = tmp_path / "run.csv"
    os.mkfifo(pipe)
    job = f'trap "" INT; exec "{sys.executable}" -m d2rpick info -f json "{pipe}"'
    with (
        subprocess.Popen(
            ["bash", "-c", job],
            cwd=ROOT,
            stdout=subprocess.PIPE,
            start_new_session=True,
        ) as process,
        pipe.open("wb") as writer,
    ):
        os.killpg(process.pid, signal.SIGINT)
        writer.write(Path(ENERGY).read_bytes())
        writer.close()
        assert json.loads(process.communicate(timeout=TIME_LIMIT)[0])["states"] > 0
    assert process.returncode == 0


def test_a_closed_stderr_loses_no_result() -> None:
    process_result = run_in_shell(
        'd2rpick suggest --td 0.064 -f value "$@" 2>&-', ENERGY
    )
    assert process_result.returncode == 0
    assert float(process_result.stdout) == pytest.approx(0.0128852793630525)


def test_a_pipe_in_place_of_a_file_is_read_once_and_signed() -> None:
    piped = run_in_shell(
        'd2rpick suggest --td 0.064 -f json <(cat "$1")', ENERGY
    ).stdout
    digests = [
        document["history"]["sha256"]
        for document in (
            json.loads(piped),
            run_json("suggest", "--td", "0.064", ENERGY),
        )
    ]
    assert digests[0] == digests[1]


@pytest.mark.slow
def test_a_full_disk_is_told_of_the_file_that_it_holds(tmp_path: Path) -> None:
    ledger = tmp_path / "ledger"
    message = read_one_line(
        run_in_shell(
            'ulimit -f 0; d2rpick study --td 0.064 --resume "$1" "$2"', ledger, ENERGY
        )
    )
    assert f"{ledger}: cannot be written (File too large); make room" in message
    assert not ledger.exists()
    ledger.symlink_to(os.devnull)
    assert "not a regular file" in read_one_line(
        run_in_shell('d2rpick study --td 0.064 --resume "$1" "$2"', ledger, ENERGY)
    )


def test_a_disk_that_fills_up_leaves_the_rows_that_fitted(tmp_path: Path) -> None:
    """The file size is limited in blocks of 1 kB, and the second row exceeds the limit."""
    ledger, again = tmp_path / "ledger", tmp_path / "again.csv"
    again.write_bytes(Path(ENERGY).read_bytes())
    assert (
        run(
            "study", "--td", "0.064", "--jobs", "1", "--resume", str(ledger), ENERGY
        ).exit_code
        == 0
    )
    first = ledger.read_bytes()
    blocks = -(-len(first) // 1024)
    study = (
        'ulimit -f "$1"; d2rpick study -q --td 0.064 --jobs 1 --resume "$2" "$3" "$4"'
    )
    assert "make room" in read_one_line(
        run_in_shell(study, str(blocks), ledger, ENERGY, again)
    )
    assert ledger.read_bytes() == first


@pytest.mark.parametrize("args", [("absent.csv",), ("absent.csv", "--after", "-1")])
def test_a_study_without_a_finished_run_leaves_no_ledger(
    tmp_path: Path, args: tuple[str, ...]
) -> None:
    assert (
        run(
            "study", "--td", "0.064", "--resume", str(tmp_path / "ledger"), *args
        ).exit_code
        == 2
    )
    assert not (tmp_path / "ledger").exists()


def test_what_is_packed_beyond_the_memory_ends_in_one_line(tmp_path: Path) -> None:
    packed = put(tmp_path / "zeros.gz", 17 * gzip.compress(bytes(1 << 24)))
    message = read_one_line(
        run_in_shell(
            'ulimit -v 260000; D2RPICK_MAX_RATIO=2e3 d2rpick info "$1"', packed
        )
    )
    assert "zeros.gz: its unpacked data do not fit into memory" in message


def make_deep_file(groups: int) -> bytes:
    content = io.BytesIO()
    with h5py.File(content, "w") as file:
        group = file.create_group("/".join(["g"] * groups))
        group["time"], group["internal_energy"] = np.arange(9.0), np.arange(9.0) ** 2
    return content.getvalue()


def make_dense_file(sizes: Sequence[int], **options: Any) -> bytes:
    """Return a file with compressed columns of zeros; empty chunks are not stored."""
    content = io.BytesIO()
    with h5py.File(content, "w") as file:
        for number, size in enumerate(sizes):
            file.create_dataset(
                f"e{number}", data=np.zeros(size), chunks=(1 << 17,), **options
            )
    return content.getvalue()


BEYOND: dict[str, tuple[Callable[[], bytes], str, str]] = {
    "zeros.gz": (
        lambda: gzip.compress(bytes(1 << 24)) * 2,
        "RATIO",
        "its packed data become more than 100 times",
    ),
    "deep.h5": (
        lambda: make_deep_file(101),
        "DEPTH",
        "its data lie in more than 100 groups",
    ),
    "one.h5": (
        lambda: make_dense_file([1 << 22], compression="gzip"),
        "RATIO",
        "its packed data become more than 100 times",
    ),
    "all.h5": (
        lambda: make_dense_file([1 << 20] * 3, compression="gzip"),
        "RATIO",
        "become more than 100 times as many bytes",
    ),
    "head.csv": (
        lambda: b"time,energy" + b" " * 1_000_000 + b"\n0,1\n",
        "LINE",
        "head.csv:1: the line has more than",
    ),
    "row.csv": (
        lambda: b"time,energy\n0,1\n1," + b" " * 1_000_001 + b"2\n",
        "LINE",
        "row.csv:3: the line has more",
    ),
    "end.csv": (
        lambda: b"time,energy\n0,1\n" + b"1" * 1_000_001,
        "LINE",
        "end.csv:3: the line has more than 1,000,000",
    ),
    "utf16.csv": (
        lambda: ("x" * 1_000_001).encode("utf-16"),
        "LINE",
        "utf16.csv:1: the line has more than 1,000,000",
    ),
    "line.k": (
        lambda: b"*PART\n" + b"1," * 500_001 + b"\n",
        "LINE",
        "line.k:2: the line has more than 1,000,000",
    ),
    "long.k": (
        lambda: b"*SET_PART\n1\n" + b" " * 5_000_000,
        "LINE",
        "long.k:3: the line has more than 1,000,000",
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", BEYOND)
def test_what_is_beyond_a_bound_is_told_unless_the_environment_raises_it(
    name: str, tmp_path: Path
) -> None:
    make, bound, message_expected = BEYOND[name]
    (tmp_path / name).write_bytes(make())
    command = "check" if name.endswith(".k") else "info"
    message = read_refusal(command, str(tmp_path / name))
    assert message_expected in message
    assert f"set D2RPICK_MAX_{bound} higher" in message
    raised = run(command, str(tmp_path / name), env={f"D2RPICK_MAX_{bound}": "1e9"})
    assert "D2RPICK_MAX" not in raised.stderr


@pytest.mark.slow
def test_the_bounds_themselves_are_kept(tmp_path: Path) -> None:
    small = b"time,internal_energy\n" + b"".join(
        b"%d,0\n" % state for state in range(1000)
    )
    for name, content in {
        "deep.h5": make_deep_file(100),
        "still.gz": gzip.compress(
            small + (b"#" * 4095 + b"\n") * (1 << 11)
        ),  # 1,000 times as many bytes, which are still few
        "line.csv": small + b"#" * 1_000_000,
    }.items():
        (tmp_path / name).write_bytes(content)
        assert run("info", str(tmp_path / name)).exit_code == 0
        assert (
            run(
                "info",
                str(tmp_path / name),
                env={
                    f"D2RPICK_MAX_{which}": "0.5"
                    for which in ("DEPTH", "LINE", "UNPACKED")
                },
            ).exit_code
            == 2
        )
    result = run("info", ENERGY, env={"D2RPICK_MAX_LINE": "long"})
    assert (
        result.stderr
        == "d2rpick: D2RPICK_MAX_LINE is 'long', but a number above 0 was expected; correct it or leave it out\n"
    )


@pytest.mark.usefixtures("here")
def test_an_unforeseen_error_names_the_files_of_the_run(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    Path("a.csv").write_bytes(Path(ENERGY).read_bytes())
    Path("b.csv.gz").write_bytes(gzip.compress(Path(ENERGY).read_bytes()))
    monkeypatch.setattr(zlib, "decompressobj", lambda **_: 1 / 0)
    for command in (("plan",), ("info",), ("suggest", "--td", "0.064")):
        message = "a.csv, b.csv.gz: internal error, please report it (ZeroDivisionError: division by zero)"
        assert (
            read_refusal(*command, "a.csv", "b.csv.gz")
            == f"{message}; --debug shows where"
        )


@pytest.mark.usefixtures("here")
def test_links_in_a_circle_give_each_run_once() -> None:
    Path("run.csv").write_bytes(Path(ENERGY).read_bytes())
    Path("again").symlink_to(".")
    Path("self.csv").symlink_to("self.csv")
    document = json.loads(
        run("study", "--td", "0.064", "-f", "json", "**/*.csv").stdout
    )
    assert [one_run["source"] for one_run in document["runs"]] == [
        "run.csv",
        "self.csv",
    ]
    assert [one_run["status"] for one_run in document["runs"]] == ["ok", "unreadable"]
    assert run("info", "-f", "json", "**/run.csv").exit_code == 0


def test_a_deck_is_called_a_deck() -> None:
    result = run("info", "sample_data/switching.k")
    assert (
        "sample_data/switching.k: this is a deck, but an energy history was expected"
        in result.stderr
    )


@pytest.mark.parametrize(
    "damage",
    ["123", "null", "[]", '{"files": 1}', '{"files": [{"name": "x"}]}', "{", "\ufffd"],
)
def test_a_damaged_line_of_a_resume_file_is_passed_over(
    damage: str, tmp_path: Path
) -> None:
    ledger = tmp_path / "ledger.ndjson"
    args = ("study", "--td", "0.064", "-f", "json", "--resume", str(ledger), ENERGY)
    whole = run(*args)
    ledger.write_text(f"{ledger.read_text()}{damage}\n")
    again = run(*args)
    assert (again.exit_code, json.loads(again.stdout)["runs"]) == (
        whole.exit_code,
        json.loads(whole.stdout)["runs"],
    )
    assert "1 of 1 runs reused" in again.stderr
    assert "damaged or without a checksum: 1" in again.stderr


@pytest.mark.slow
def test_no_changed_byte_of_a_resume_file_gives_another_row(tmp_path: Path) -> None:
    from d2rpick.api.studies import Ledger
    from d2rpick.choice.question import Settings
    from d2rpick.choice.runs.study import Question, judge_run

    file, question = tmp_path / "ledger", Question(0.064, Settings())
    row = judge_run(question, ENERGY)
    Ledger(str(file), question).add(row)
    content = bytearray(file.read_bytes())
    for byte_index in range(11, len(content) - 1, 7):
        content[byte_index] ^= 1
        file.write_bytes(content)
        assert Ledger(str(file), question).find(ENERGY) is None
        content[byte_index] ^= 1


def test_two_runs_are_not_legs_of_one(tmp_path: Path) -> None:
    times = [0.0, 0.125, 0.25, 0.375, 0.5]
    contents = {
        "one": make_glstat_text(times, [0, 10, 20, 30, 40]),
        "copy": make_glstat_text(times, [0, 10, 20, 30, 40]),
        "other": make_glstat_text(times, [0, 10, 21, 30, 40]),
        "restart": make_glstat_text(
            times[2:], [20, 35, 45]
        ),  # continues differently from its first state
        "restart of another": make_glstat_text(times[2:], [25, 35, 45]),
        "parts": make_matsum_text(
            times, [7, 3], [[0, 0], [1, 1], [2, 2], [3, 3], [4, 4]]
        ),
        "other parts": make_matsum_text(
            times, [7, 3], [[0, 0], [1, 1], [2, 5], [3, 3], [4, 4]]
        ),
    }
    names = {name: tmp_path / name for name in contents}
    for name, content in contents.items():
        names[name].write_bytes(content)
    for first_file, second_file, legs in (
        ("one", "copy", True), ("one", "other", False), ("one", "restart", True),
        ("one", "restart of another", False), ("parts", "other parts", False), ("parts", "parts", True),
    ):  # fmt: skip
        for pair in ((first_file, second_file), (second_file, first_file)):
            result = run("info", *(str(names[name]) for name in pair))
            assert ("different energies at the same times" in result.stderr) is not legs
            assert result.exit_code == (0 if legs else 2)


def test_tables_of_different_quantities_are_not_legs_of_one(tmp_path: Path) -> None:
    """If the files have no common column, no state is left, as if the run had written none."""
    for name, head in (
        ("one", "time,internal_energy"),
        ("other", "time,force"),
        ("leg", "time,internal_energy"),
    ):
        start = 4 if name == "leg" else 0
        rows = [f"{start + i},{i + 1}" for i in range(4)]
        (tmp_path / f"{name}.csv").write_text("\n".join([head, *rows, ""]))
    first_file, second_file, leg = (
        str(tmp_path / f"{name}.csv") for name in ("one", "other", "leg")
    )
    assert "neither a column nor a part in common" in read_refusal(
        "info", first_file, second_file
    )
    assert run("info", first_file, leg).exit_code == 0


@pytest.mark.parametrize("name", ODD)
def test_odd_numbers_reach_no_warning_of_the_machine(name: str, tmp_path: Path) -> None:
    result = run("info", str(put(tmp_path / name, ODD[name])))
    assert "RuntimeWarning" not in result.stderr
    assert "internal error" not in result.stderr
    assert result.exit_code in (0, 2)


def test_numbers_whose_squares_overflow_reach_no_warning_of_the_machine(
    tmp_path: Path,
) -> None:
    rows = [f"{i / 2},{i % 7},{1e308 if i >= 13 else i % 5}" for i in range(15)]
    (tmp_path / "large.csv").write_text(
        "\n".join(["time,internal energy,kinetic energy", *rows, ""])
    )
    result = run("info", str(tmp_path / "large.csv"))
    assert (result.exit_code, result.stderr) == (0, "")


def test_a_number_of_too_many_digits_is_no_part() -> None:
    assert "no part" in read_refusal(
        "suggest", "--td", "0.1", "--part", "9" * 5000, "sample_data/rolloverT01.gz"
    )


def test_lines_of_another_state_are_refused() -> None:
    content = Path(GLSTAT).read_bytes()
    begin = content.index(b" internal energy", len(content) // 2)
    label_index = content.index(b" kinetic energy")
    broken = (
        content[: begin + 28]
        + content[label_index : label_index + 120]
        + content[begin + 40 :]
    )
    refused = run("suggest", "--td", "0.064", "-", stdin=broken)
    assert refused.exit_code == 2
    assert "'internal energy' is missing, cut or doubled" in refused.stderr


def test_a_loop_of_links_in_place_of_a_file_to_write_is_told(tmp_path: Path) -> None:
    loop = tmp_path / "loop.csv"
    loop.symlink_to(loop)
    assert f"{loop}: cannot be written" in read_one_line(
        run_in_shell('d2rpick extract "$@"', ENERGY, "-o", loop)
    )


@pytest.mark.parametrize(
    "command", [("info",), ("suggest", "--td", "1"), ("check",), ("plan",)]
)
@pytest.mark.parametrize("device", ["/dev/zero", "/dev/full", "/dev/null"])
def test_a_device_that_never_ends_is_refused(
    command: tuple[str, ...], device: str
) -> None:
    if not Path(device).exists():
        pytest.skip(f"no {device} here")
    assert f"{device}: this is a device" in read_refusal(*command, device)
