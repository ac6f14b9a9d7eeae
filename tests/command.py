"""Call the command line inside the test process, with stdout and stderr kept apart."""

import json
import os
import shlex
import signal
import subprocess
import sys
import tempfile
from collections.abc import Hashable, Iterator, Mapping
from contextlib import contextmanager, suppress
from inspect import signature
from pathlib import Path
from threading import Timer
from typing import Any

from click.testing import CliRunner, Result

from d2rpick.cli import d2rpick

TIME_LIMIT = 60  # a child process that takes longer is stopped [s]
ROOT = Path(__file__).resolve().parents[1]
ENERGY = str(ROOT / "sample_data" / "energy.csv")
GLSTAT = str(ROOT / "sample_data" / "energy.glstat")
ROLLOVER = str(ROOT / "sample_data" / "rollover.csv")
DECK = str(ROOT / "sample_data" / "switching.k")
MATSUM = str(ROOT / "sample_data" / "rollover_box.matsum")
BOX = str(ROOT / "sample_data" / "rolloverT01.gz")
OSCILLATOR = tuple(
    shlex.split("--stiffness 660e3 --mass 31.4 --beta 2 --alpha 50 --v0 6")
)
_TEMPORARY = Path(tempfile.gettempdir())
_ANSWERED: dict[Hashable, Result] = {}
INTERRUPTIBLE = (
    "import signal; signal.signal(signal.SIGINT, signal.default_int_handler)\nfrom "
    "d2rpick.__main__ import main; main()"
)
# Environment without colour variables, and without options of d2rpick that a developer may have set.
_ENVIRONMENT = {
    "NO_COLOR": None,
    "FORCE_COLOR": None,
    "COLUMNS": None,
    "D2RPICK_SUGGEST_TD": None,
}
# Click before 8.2 mixes stdout and stderr by default.
_APART: dict[str, Any] = (
    {"mix_stderr": False} if "mix_stderr" in signature(CliRunner).parameters else {}
)


def run(
    *args: str,
    stdin: bytes | None = None,
    color: bool = False,
    env: Mapping[str, str | None] | None = None,
) -> Result:
    """Call ``d2rpick`` with these arguments; raise every exception except the regular exit.

    Results for files of the repository are cached, because these files do not change.
    """
    environment = {**_ENVIRONMENT, **(env or {})}
    around = frozenset(
        (name, value)
        for name, value in os.environ.items()
        if name != "PYTEST_CURRENT_TEST"
    )
    key = (args, stdin, color, *environment.items(), around, Path.cwd())
    if key in _ANSWERED:
        return _ANSWERED[key]
    result = CliRunner(**_APART).invoke(
        d2rpick, args, input=stdin, color=color, env=environment
    )
    if result.exception and not isinstance(result.exception, SystemExit):
        raise result.exception
    if not any(
        _is_temporary(folder)
        for folder in (
            Path.cwd(),
            *(Path(arg).absolute() for arg in args if "/" in arg),
        )
    ):
        _ANSWERED[key] = result
    return result


def put(path: Path, content: str | bytes) -> Path:
    """Write a file and return its path."""
    path.write_bytes(content if isinstance(content, bytes) else content.encode("utf-8"))
    return path


def read_refusal(*args: str) -> str:
    """Return the error message of a failed command, which must be one line on stderr and the only output."""
    result = run(*args)
    assert (result.exit_code, result.stdout) == (2, ""), result.stderr
    assert result.stderr.count("\n") == 1
    assert result.stderr.startswith("d2rpick: ")
    return result.stderr.removeprefix("d2rpick: ").rstrip("\n")


def _is_temporary(path: Path) -> bool:
    """Return True if a file may change, i.e. is in a temporary folder and not in the repository."""
    path = Path(os.path.normpath(path))
    return not path.is_relative_to(ROOT) and (
        path == _TEMPORARY or _TEMPORARY in path.parents
    )


def join_wrapped_lines(text: str) -> str:
    """Join the lines of a text that was wrapped."""
    return " ".join(text.split())


@contextmanager
def start_program(*args: str, **options: Any) -> Iterator[subprocess.Popen[Any]]:
    """Start the program in its own session, and stop it after the block or the time limit.

    It can be interrupted even if this process cannot, for example in the background of a shell.
    """
    command = [sys.executable, "-c", INTERRUPTIBLE, *args]
    popen_options = {
        "stdout": subprocess.PIPE,
        "stderr": subprocess.PIPE,
        "cwd": ROOT,
        **options,
    }
    with subprocess.Popen(command, start_new_session=True, **popen_options) as process:
        watch = Timer(TIME_LIMIT, _end_group, [process.pid])
        watch.start()
        try:
            yield process
        finally:
            watch.cancel()
            _end_group(process.pid)


def _end_group(group: int) -> None:
    with suppress(ProcessLookupError):
        os.killpg(group, signal.SIGKILL)


def run_json(*args: str) -> dict[str, Any]:
    """Run a command with JSON output, and return the document; exit code 1 (problems found) is allowed."""
    result = run(*args, "-f", "json")
    assert result.exit_code in (0, 1), result.stderr
    document: dict[str, Any] = json.loads(result.stdout)
    return document


def make_replay_file(form: str, *options: str, v0: str = "6") -> bytes:
    """Return the content of a file with 0.15 s of the paper's oscillator, one state each 0.1 ms, in this format."""
    times = ("--t-end", "0.15", "--dt", "1e-4", "--write-as", form)
    result = run("replay", *OSCILLATOR[:-1], v0, *times, *options)
    assert result.exit_code == 0, result.stderr
    return result.stdout_bytes


def list_warning_codes(document: dict[str, Any]) -> set[str]:
    """Return the codes of the warnings of an answer."""
    return {warning["code"] for warning in document["warnings"]}
