"""The command line called inside this process, with its output streams apart."""

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

TIME_LIMIT = 60  # [s] after which a child that hangs is ended
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
# No colour variables and no options that the tester's own environment may set.
_ENVIRONMENT = {
    "NO_COLOR": None,
    "FORCE_COLOR": None,
    "COLUMNS": None,
    "D2RPICK_SUGGEST_TD": None,
}
# Before 8.2, click's runner mixes the streams unless it is told not to.
_APART: dict[str, Any] = (
    {"mix_stderr": False} if "mix_stderr" in signature(CliRunner).parameters else {}
)


def run(
    *args: str,
    stdin: bytes | None = None,
    color: bool = False,
    env: Mapping[str, str | None] | None = None,
) -> Result:
    """Call ``d2rpick`` with these arguments; whatever it raises but the exit itself is raised here.

    What was asked before of files of the clone alone is not computed again.
    """
    given = {**_ENVIRONMENT, **(env or {})}
    around = frozenset(
        (name, value)
        for name, value in os.environ.items()
        if name != "PYTEST_CURRENT_TEST"
    )
    asked = (args, stdin, color, *given.items(), around, Path.cwd())
    if asked in _ANSWERED:
        return _ANSWERED[asked]
    result = CliRunner(**_APART).invoke(
        d2rpick, args, input=stdin, color=color, env=given
    )
    if result.exception and not isinstance(result.exception, SystemExit):
        raise result.exception
    if not any(
        _changes(folder)
        for folder in (
            Path.cwd(),
            *(Path(arg).absolute() for arg in args if "/" in arg),
        )
    ):
        _ANSWERED[asked] = result
    return result


def put(path: Path, content: str | bytes) -> Path:
    """Write a file, and give its path."""
    path.write_bytes(content if isinstance(content, bytes) else content.encode("utf-8"))
    return path


def refused(*args: str) -> str:
    """Give the message of a command that could not run; it is one line on stderr and all there is."""
    result = run(*args)
    assert (result.exit_code, result.stdout) == (2, ""), result.stderr
    assert result.stderr.count("\n") == 1
    assert result.stderr.startswith("d2rpick: ")
    return result.stderr.removeprefix("d2rpick: ").rstrip("\n")


def _changes(path: Path) -> bool:
    """Whether a file is temporary, or of a temporary folder; those of the clone stay as they are."""
    path = Path(os.path.normpath(path))
    return not path.is_relative_to(ROOT) and (
        path == _TEMPORARY or _TEMPORARY in path.parents
    )


def unwrapped(text: str) -> str:
    """A text in one line, however it was wrapped."""
    return " ".join(text.split())


@contextmanager
def started(*args: str, **options: Any) -> Iterator[subprocess.Popen[Any]]:
    """Start the program in a session of its own; what is left of it after the block, or the time limit, is ended.

    It can be interrupted also where this process cannot, as in the background of a shell.
    """
    command = [sys.executable, "-c", INTERRUPTIBLE, *args]
    given = {
        "stdout": subprocess.PIPE,
        "stderr": subprocess.PIPE,
        "cwd": ROOT,
        **options,
    }
    with subprocess.Popen(command, start_new_session=True, **given) as process:
        watch = Timer(TIME_LIMIT, _end, [process.pid])
        watch.start()
        try:
            yield process
        finally:
            watch.cancel()
            _end(process.pid)


def _end(group: int) -> None:
    with suppress(ProcessLookupError):
        os.killpg(group, signal.SIGKILL)


def answer(*args: str) -> dict[str, Any]:
    """Run a command with JSON output and give what it says, be it an objection or not."""
    result = run(*args, "-f", "json")
    assert result.exit_code in (0, 1), result.stderr
    found: dict[str, Any] = json.loads(result.stdout)
    return found


def replayed(form: str, *options: str, v0: str = "6") -> bytes:
    """The oscillator of the paper for 0.15 s, a state each 0.1 ms, as a file of this format has it."""
    times = ("--t-end", "0.15", "--dt", "1e-4", "--write-as", form)
    result = run("replay", *OSCILLATOR[:-1], v0, *times, *options)
    assert result.exit_code == 0, result.stderr
    return result.stdout_bytes


def codes(found: dict[str, Any]) -> set[str]:
    """Codes of the warnings of an answer."""
    return {warning["code"] for warning in found["warnings"]}
