"""Start and stop the solver processes in the folder of a run, and read their output.

The names and first bytes of restart files were observed in runs with OpenRadioss 2026-08.
"""

from __future__ import annotations

import os
import re
import shlex
import shutil
import signal
import subprocess
import time
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from d2rpick.base.errors import (
    ConfigurationError,
    D2RPickError,
    FormatError,
    make_printable,
)
from d2rpick.deck.engine_files import MOST_LEGS
from d2rpick.histories.formats.radioss_th import TimeHistory
from d2rpick.histories.listings import find_radioss_timing, read_tail

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator

    from d2rpick.histories.history import Samples

# Paths of the programs in an installation and their arguments, keyed by program.
_PROGRAMS: Final = {
    "starter": (
        ("bin/starter_gf", "exec/starter_linux64_gf"),
        "-i {deck} -np 1 -nt {threads}",
    ),
    "engine": (("bin/engine_gf", "exec/engine_linux64_gf"), "-i {deck} -nt {threads}"),
}
_HOME: Final = "OPENRADIOSS_PATH"
_STARTER_ERROR: Final = r"(?m)^ *[1-9]\d* +ERROR\(S\)"
# Number of bytes that are read at the end of a listing.
_TAIL_SIZE: Final = 1 << 14
# Number of bytes at the end of a listing that are searched for errors; in a starter listing, much output follows them.
_LISTING_SIZE: Final = 1 << 22
# An error in a listing consists of its first line and the next three lines.
_ERROR_LINES: Final = r".*\*\* ERROR.*(?:\n.*){0,3}"
_MOST_LINES: Final = 8
# Smallest size of a complete restart file, relative to the size of the starter's restart file [-].
_WHOLE: Final = 0.98
# _TIME_TO_STOP: time within which a solver is expected to stop on its own [s].
# _PAUSE: time between two checks of whether the solver has stopped [s].
_TIME_TO_STOP, _PAUSE = 4.0, 0.05


class Commands(NamedTuple):
    """The commands of the starter and the engine (by default, those of the installation) and the number of threads."""

    starter: str | None = None
    engine: str | None = None
    threads: int = 1

    def words(self, program: str, deck: str) -> list[str]:
        """Split the command that starts a program for a deck as a shell would.

        Raises
        ------
        ConfigurationError
            If the command cannot be split or does not contain the deck, or if no installation is known.
        """
        template = self._find_template(program)
        if template is None:
            raise self._report_unknown_programs()
        if "{deck}" not in template:
            raise ConfigurationError(
                f"--{program} {template!r}: {{deck}} was expected, where the name of the file goes"
            )
        try:
            words = shlex.split(template)
        except ValueError as error:
            raise ConfigurationError(
                f"--{program} {template!r}: cannot be split into words ({error})"
            ) from None
        if "/" in words[0]:
            # The path is made absolute, because the program is started in a different folder.
            words[0] = str(Path(words[0]).absolute())
        words = [word.replace("{threads}", str(self.threads)) for word in words]
        return [word.replace("{deck}", deck) for word in words]

    def _find_template(self, program: str) -> str | None:
        """Return the given command of a program, or that of the installation; None if neither exists."""
        given: str | None = getattr(self, program)
        return given or _find_installed(program)

    def list_unknown(self) -> list[str]:
        """Return the programs that are neither given nor installed."""
        return [name for name in _PROGRAMS if self._find_template(name) is None]

    def _report_unknown_programs(self) -> ConfigurationError:
        """Return the error that names every program whose command is unknown, so that one answer corrects all."""
        unknown = self.list_unknown()
        names = " and no ".join(unknown)
        are = "is" if len(unknown) == 1 else "are"
        options = " and ".join(f"--{name} 'CMD {{deck}}'" for name in unknown)
        return ConfigurationError(
            f"no {names} {are} known, so no command can be started or printed; set {_HOME} to the folder of "
            f"OpenRadioss, or give {options}"
        )

    def make_environment(self) -> dict[str, str]:
        """Return the environment of the programs: the current environment plus the variables of an installation."""
        environment = {"OMP_NUM_THREADS": str(self.threads), "OMP_STACKSIZE": "400m"}
        libraries = os.environ.get("LD_LIBRARY_PATH", "")
        home = os.environ.get(_HOME)
        if home:
            environment["RAD_CFG_PATH"] = f"{home}/hm_cfg_files"
            libraries = f"{home}/exec:{libraries}:{home}/syslib".replace("::", ":")
        return {**environment, **os.environ, "LD_LIBRARY_PATH": libraries}

    def missing(self) -> str:
        """Return the first program that cannot be started; empty if all programs can be started."""
        for program in _PROGRAMS:
            executable = self.words(program, "{deck}")[0]
            if shutil.which(executable) is None:
                return executable
        return ""


def _find_installed(program: str) -> str | None:
    """Return the command of an installed program; None if it is not installed."""
    home = os.environ.get(_HOME, "")
    names, arguments = _PROGRAMS[program]
    for name in names:
        path = Path(home, name)
        if home and path.is_file():
            return f"{shlex.quote(str(path.resolve()))} {arguments}"
    return None


@contextmanager
def alone(folder: Path) -> Iterator[None]:
    """Lock a folder against other drivers; raise D2RPickError if a driver is already running there."""
    lock = _lock(folder / ".drive.lock")
    if lock is None:
        raise D2RPickError(
            f"{folder}: another d2rpick drives this run; wait for its end, or choose another folder"
        )
    try:
        yield
    finally:
        os.close(lock)


def _lock(path: Path) -> int | None:
    """Lock a file and return its descriptor, which keeps the lock as long as it is open; None if the file is locked."""
    import fcntl

    lock = os.open(path, os.O_RDWR | os.O_CREAT, 0o666)
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        os.close(lock)
        return None
    return lock


class Solver:
    """The solver in the folder of a run. Only one process runs at a time.

    The process holds a lock as long as it runs, so that a later driver can detect it.
    """

    def __init__(self, folder: Path, name: str, commands: Commands) -> None:
        self.folder = folder
        self.name = name
        self.commands = commands
        self._lock_path = folder / ".solver.lock"
        self._replaced = folder / ".drive.replaced"
        self._process: subprocess.Popen[bytes] | None = None
        self._signal = 0  # Number of the signal that ended the last process, or 0.

    def file(self, number: int, suffix: str) -> Path:
        """Return the path of a file of an engine run; the number 0 stands for the starter."""
        return self.folder / f"{self.name}_{number:04d}{suffix}"

    def history(self, number: int) -> Path:
        """Return the path of the time history that an engine run writes."""
        return self.folder / f"{self.name}T{number:02d}"

    def clear(self, number: int) -> None:
        """Remove the files of an earlier engine run with the given number."""
        for path in self._find_files(number, self.folder):
            path.unlink()

    def set_aside(self, number: int) -> None:
        """Move the files of a complete engine run to a folder of their own, because another one gets its number.

        The listing is moved last: if it is still in the folder, an earlier driver was stopped before all files were
        moved.
        """
        if not self.ended_well(number):
            return
        listing = self.file(number, ".out")
        others = [
            path for path in self._find_files(number, self.folder) if path != listing
        ]
        self._replaced.mkdir(exist_ok=True)
        for path in [*others, listing]:
            path.replace(self._replaced / path.name)

    def restore(self, number: int) -> None:
        """Move the files of an engine run back that were set aside, if there are any."""
        for path in self._find_files(number, self._replaced):
            path.replace(self.folder / path.name)

    def remove_replaced(self) -> None:
        """Remove the files that were set aside."""
        shutil.rmtree(self._replaced, ignore_errors=True)

    def _find_files(self, number: int, folder: Path) -> list[Path]:
        """Return the files of an engine run in a folder: engine file, listings, restart files and history."""
        files = folder.glob(f"{self.name}_{number:04d}[._]*")
        return [*files, *folder.glob(self.history(number).name)]

    def start(self, program: str, number: int) -> None:
        """Start the solver for an engine run: the starter if ``number`` is 0, otherwise the engine.

        Raises
        ------
        D2RPickError
            If the program cannot be started.
        """
        command = self.commands.words(program, self.file(number, ".rad").name)
        lock = _lock(self._lock_path)
        assert lock is not None  # The driver has waited for any other solver.
        try:
            _raise_stack_limit()
            with self.file(number, ".log").open("wb") as log:
                # A new session shields the solver from Ctrl-C; the driver itself stops all solver processes.
                self._process = subprocess.Popen(
                    command, cwd=self.folder, env=self.commands.make_environment(), stdin=subprocess.DEVNULL,
                    stdout=log, stderr=subprocess.STDOUT, start_new_session=True, pass_fds=[lock],
                )  # fmt: skip
            os.ftruncate(lock, 0)
            os.pwrite(lock, str(self._process.pid).encode(), 0)
        except OSError as error:
            raise D2RPickError(
                f"{command[0]}: cannot be started ({error.strerror}); check the command"
            ) from None
        finally:
            os.close(lock)

    @property
    def alive(self) -> bool:
        """Return True if a solver is running, even if an earlier driver started it."""
        if self._process is not None:
            code = self._process.poll()
            if code is None:
                return True
            self._process = None
            self._signal = max(-code, 0)
        lock = _lock(self._lock_path)
        if lock is not None:
            os.close(lock)
        return lock is None

    def end(self) -> None:
        """Stop all processes of the solver, even if an earlier driver started it."""
        text = self._lock_path.read_bytes() if self._lock_path.exists() else b""
        for sign in (signal.SIGTERM, signal.SIGKILL):
            if not self.alive or not text.isdigit():
                return
            with suppress(ProcessLookupError, PermissionError):
                os.killpg(int(text), sign)
            begun = time.monotonic()
            # A second interrupt by the user must not leave any process running.
            with suppress(KeyboardInterrupt):
                while time.monotonic() - begun < _TIME_TO_STOP and self.alive:
                    time.sleep(_PAUSE)

    def silent_for(self) -> float:
        """Return the time since the solver last wrote output [s]."""
        now = time.time()
        paths = self.folder.glob(f"{self.name}*")
        times = [path.stat().st_mtime for path in paths if path.exists()]
        return max(0.0, now - max(times, default=now))

    def ended_well(self, number: int) -> bool:
        """Return True if the listing of an engine run reports a normal end."""
        return "NORMAL TERMINATION" in self._read_end(number, ".out")

    def took(self, number: int) -> tuple[int | None, float | None]:
        """Return the cycle count and CPU time [s] of an engine run; None if its listing does not contain them."""
        path = str(self.file(number, ".out"))
        timing = find_radioss_timing(path, read_tail(path, _TAIL_SIZE))
        if timing is None:
            return None, None
        return timing.cycles or None, timing.total or None

    def whole(self, number: int) -> bool:
        """Return True if an engine run, or the starter (number 0), has left complete restart files for all domains.

        An OpenRadioss restart file begins with its own name and, apart from contact data, is as long as that of the
        starter. If the disk is full, restart files are shorter although the listing reports a normal end.
        """
        starter_restarts = self._find_restarts(0)
        for first in starter_restarts:
            restart = self.file(number, first.name[-9:])
            least_size = max(_WHOLE * first.stat().st_size, 1)
            if not restart.exists() or restart.stat().st_size < least_size:
                return False
            if _has_its_name(first) and not _has_its_name(restart):
                return False
        return bool(starter_restarts)

    def read_times(self, number: int) -> Samples:
        """Return the times of the states in the history of an engine run [time]; empty if it cannot be read."""
        path = self.history(number)
        try:
            return TimeHistory(path.read_bytes(), str(path)).time
        except (FormatError, OSError):
            return np.empty(0)

    def started_well(self) -> bool:
        """Return True if the starter ended without errors and left a complete restart file."""
        has_error = re.search(_STARTER_ERROR, self._read_end(0, ".out"))
        return self.whole(0) and not has_error

    def last_words(self, number: int) -> str:
        """Return, on one line, the errors that the solver reported or, without errors, its last printed lines."""
        listing = self._read_end(number, ".out", _LISTING_SIZE)
        errors = _split_lines("\n".join(re.findall(_ERROR_LINES, listing)))
        printed = _split_lines(self._read_end(number, ".log") or listing)
        text = " | ".join(errors[:_MOST_LINES] or printed[-_MOST_LINES:])
        words = [text or "nothing was printed"]
        free = shutil.disk_usage(self.folder).free
        if free < self._measure_largest_restart():
            # A solver that cannot write its files prints no error.
            words.insert(0, f"the disk is full, {free / 1e6:.3g} MB are free")
        if self._signal:
            words.insert(0, f"ended by signal {self._signal}")
        return make_printable("; ".join(words))

    def keep(self, numbers: Collection[int]) -> None:
        """Remove all restart files except those of the given engine runs and the starter."""
        for number in {*range(1, MOST_LEGS + 1)} - {*numbers}:
            for restart in self._find_restarts(number):
                restart.unlink()

    def check_room(self, number: int) -> None:
        """Raise D2RPickError if the disk has no room for the restart files of an engine run and of the one after it."""
        needed = 2 * self._measure_largest_restart()
        free = shutil.disk_usage(self.folder).free
        if free < needed:
            raise D2RPickError(
                f"{self.folder}: engine run {number} may need {needed / 1e6:.3g} MB, {free / 1e6:.3g} MB are free; "
                "make room, then --resume"
            )

    def _read_end(self, number: int, suffix: str, size: int = _TAIL_SIZE) -> str:
        """Return the last bytes of a file of an engine run as text; empty if there is no such file."""
        return read_tail(str(self.file(number, suffix)), size).decode("latin-1")

    def _find_restarts(self, number: int | None = None) -> list[Path]:
        """Return the restart files of an engine run, one per domain, or those of all engine runs."""
        leg = "*" if number is None else f"{number:04d}"
        return [*self.folder.glob(f"{self.name}_{leg}_*.rst")]

    def _measure_largest_restart(self) -> int:
        """Return the size of the largest restart file of the run [bytes]; 0 if there is none."""
        sizes = [restart.stat().st_size for restart in self._find_restarts()]
        return max(sizes, default=0)


def _split_lines(text: str) -> list[str]:
    """Return the lines of an output without redundant spaces; empty lines are left out."""
    return [" ".join(line.split()) for line in text.splitlines() if line.strip(" -*")]


def _has_its_name(restart: Path) -> bool:
    with restart.open("rb") as stream:
        return stream.read(len(restart.name)) == restart.name.encode()


def _raise_stack_limit() -> None:
    """Raise the stack limit to the system maximum, because the solver keeps large arrays on the stack."""
    import resource

    _, limit = resource.getrlimit(resource.RLIMIT_STACK)
    with suppress(OSError, ValueError):
        resource.setrlimit(resource.RLIMIT_STACK, (limit, limit))
