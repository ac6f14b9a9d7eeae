"""The solver's processes in the folder of a run: how they are started, told to stop, and what they leave.

Control files, restarts and what they are called: Altair's public help for /RFILE and for the run control file, and runs
with OpenRadioss 2026-08.
"""

from __future__ import annotations

import os
import re
import shlex
import subprocess
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from d2rpick.base.errors import ConfigurationError, D2RPickError, FormatError, printable
from d2rpick.base.files import write_whole
from d2rpick.histories.formats.radioss_th import TimeHistory
from d2rpick.histories.listings import Timing, read_timing

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

# Where an installation has its programs, and how they are called.
_PROGRAMS: Final = {
    "starter": (("bin/starter_gf", "exec/starter_linux64_gf"), "-i {deck} -np 1 -nt {threads}"),
    "engine": (("bin/engine_gf", "exec/engine_linux64_gf"), "-i {deck} -nt {threads}"),
}
_HOME: Final = "OPENRADIOSS_PATH"
_STARTER_ERROR: Final = re.compile(rb"^ *[1-9]\d* +ERROR\(S\)", re.MULTILINE)
_TAIL: Final = 1 << 14
_LAST_LINES: Final = 5


class Commands(NamedTuple):
    """How starter and engine are started, None for those of the installation, on so many threads."""

    starter: str | None = None
    engine: str | None = None
    threads: int = 1

    def words(self, program: str, deck: str) -> list[str]:
        """Split the command that starts a program on a deck as a shell would.

        ConfigurationError where it cannot be split or does not name the deck, or no installation is known.
        """
        template = getattr(self, program)
        try:
            split = _installed(program) if template is None else shlex.split(template)
        except ValueError as error:
            raise ConfigurationError(f"--{program} {template!r}: cannot be split into words ({error})") from None
        if not any("{deck}" in word for word in split):
            raise ConfigurationError(
                f"--{program} {template!r}: {{deck}} was expected, where the name of the file goes"
            )
        return [word.replace("{deck}", deck).replace("{threads}", str(self.threads)) for word in split]


def _installed(program: str) -> list[str]:
    home = os.environ.get(_HOME, "")
    names, options = _PROGRAMS[program]
    for path in (Path(home, name) for name in names if home):
        if path.is_file():
            return [str(path.resolve()), *options.split()]
    raise ConfigurationError(
        f"no {program} is known; set {_HOME} to the folder of OpenRadioss, or give --{program} 'CMD {{deck}}'"
    )


def _surroundings(threads: int) -> dict[str, str]:
    """What the programs of an installation need in their environment, beside what is there."""
    home = os.environ.get(_HOME)
    own = {"OMP_NUM_THREADS": str(threads), "OMP_STACKSIZE": "400m"}
    if home:
        libraries = (f"{home}/exec", os.environ.get("LD_LIBRARY_PATH"), f"{home}/syslib")
        own |= {"RAD_CFG_PATH": f"{home}/hm_cfg_files", "LD_LIBRARY_PATH": os.pathsep.join(filter(None, libraries))}
    return {**own, **os.environ, "LD_LIBRARY_PATH": own.get("LD_LIBRARY_PATH", os.environ.get("LD_LIBRARY_PATH", ""))}


@contextmanager
def alone(folder: Path) -> Iterator[None]:
    """Keep every other driver out of a folder; D2RPickError where one is at work there."""
    lock = _locked(folder / ".drive.lock")
    if lock is None:
        raise D2RPickError(f"{folder}: another d2rpick drives this run; wait for it, or choose another folder")
    try:
        yield
    finally:
        os.close(lock)


def _locked(path: Path) -> int | None:
    """Lock a file, as long as the number that is given stays open; None where it is locked."""
    import fcntl

    lock = os.open(path, os.O_RDWR | os.O_CREAT, 0o666)
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        os.close(lock)
        return None
    return lock


class Left(NamedTuple):
    """What a leg left: whether it ended as it should, its ``restart`` (None: none to go on from), and what it took."""

    normal: bool
    restart: str | None
    timing: Timing | None


class Solver:
    """The solver in the folder of a run, one process at a time.

    The process holds a lock as long as it lives, so that a driver that comes later knows of it.
    """

    def __init__(self, folder: Path, name: str, threads: int = 1) -> None:
        self.folder, self.name, self.threads = folder, name, threads
        self._lock = folder / ".solver.lock"
        self._process: subprocess.Popen[bytes] | None = None

    def file(self, number: int, suffix: str) -> Path:
        """Name a file of a leg, 0 for the starter."""
        return self.folder / f"{self.name}_{number:04d}{suffix}"

    def history(self, number: int) -> Path:
        """Name the time history of a leg."""
        return self.folder / f"{self.name}T{number:02d}"

    def clear(self, number: int) -> None:
        """Remove what an earlier leg of this number left."""
        for path in (self.history(number), *(self.file(number, one) for one in (".ctl", ".out", ".log"))):
            path.unlink(missing_ok=True)
        for path in self._restarts(number):
            path.unlink()

    def start(self, command: Sequence[str], number: int) -> None:
        """Start the solver on a leg.

        Raises
        ------
        D2RPickError
            If it cannot be started, or one is at work in the folder.
        """
        lock = _locked(self._lock)
        if lock is None:
            raise D2RPickError(f"{self.folder}: a solver is at work there; wait for its end")
        try:
            _let_stack_grow()
            with self.file(number, ".log").open("wb") as log:
                # of its own session: Ctrl-C reaches the driver, which lets the solver write its restart
                self._process = subprocess.Popen(
                    command, cwd=self.folder, env=_surroundings(self.threads), stdin=subprocess.DEVNULL, stdout=log,
                    stderr=subprocess.STDOUT, start_new_session=True, pass_fds=[lock],
                )  # fmt: skip
        except OSError as error:
            raise D2RPickError(f"{command[0]}: cannot be started ({error.strerror}); check the command") from None
        finally:
            os.close(lock)

    @property
    def alive(self) -> bool:
        """Whether a solver is at work, also one that an earlier driver started."""
        if self._process is not None:
            if self._process.poll() is None:
                return True
            self._process = None
        lock = _locked(self._lock)
        if lock is not None:
            os.close(lock)
        return lock is None

    def tell(self, number: int, text: str) -> None:
        """Write the control file of a leg, whole; the engine looks for it every ten cycles."""
        write_whole(self.file(number, ".ctl"), text.encode())

    def left(self, number: int) -> Left:
        """Say what a leg that is over has left."""
        normal = b"NORMAL TERMINATION" in _tail(self.file(number, ".out"))
        try:
            timing = read_timing(str(self.file(number, ".out")))
        except FormatError:
            timing = None
        restarts = self._restarts(number)
        if not normal and self.history(number).exists():  # nobody knows whether one that was written last is whole
            written = self.history(number).stat().st_mtime_ns
            restarts = [path for path in restarts if path.stat().st_mtime_ns < written]
        latest = max(restarts, key=lambda path: path.stat().st_mtime_ns, default=None)
        return Left(normal, None if latest is None else _letter(latest), timing)

    def started_well(self) -> bool:
        """Whether the starter has ended without an error, and left a restart."""
        return bool(self._restarts(0)) and not _STARTER_ERROR.search(_tail(self.file(0, ".out")))

    def shorten(self, number: int, time: float) -> None:
        """Cut the history of a leg behind a time: a reader would find two energies there."""
        os.truncate(self.history(number), self._states(number).size_until(time))

    def times(self, number: int, start: float, cycles: Sequence[int]) -> list[float]:
        """Say when a leg that began at ``start`` had computed so many cycles, by the steps that its history shows.

        Between two states a step grows by the same factor each cycle, if it does; so their geometric mean counts.
        Nothing where a step is not written.
        """
        history = self._states(number)
        steps = history.channel("time_step") if "time_step" in history.channels else np.zeros(1)
        if not np.all(steps > 0):
            return []
        steps = np.sqrt(steps * np.append(steps[:1], steps[:-1]))
        counts = np.cumsum(np.diff(history.time, prepend=start) / steps)
        return [float(one) for one in np.interp(cycles, np.append(0.0, counts), np.append(start, history.time))]

    def _states(self, number: int) -> TimeHistory:
        path = self.history(number)
        return TimeHistory(path.read_bytes(), str(path))

    def last_lines(self, number: int) -> str:
        """Give the last lines that the solver printed, in one."""
        text = (_tail(self.file(number, ".log")) or _tail(self.file(number, ".out"))).decode("latin-1")
        lines = [" ".join(line.split()) for line in text.splitlines() if line.strip(" -*")]
        return printable(" | ".join(lines[-_LAST_LINES:])) or "nothing was printed"

    def keep_two(self, number: int) -> None:
        """Remove the restarts of legs before the two that come before this one."""
        for earlier in range(number - 2):
            for path in self._restarts(earlier):
                path.unlink(missing_ok=True)

    def check_room(self, number: int, share: float, restarts: int) -> None:
        """Raise D2RPickError where the disk has no room for a leg that has this share of the run still before it.

        It keeps so many ``restarts`` of the size of the largest so far, and one that is being written.
        """
        import shutil

        files = list(self.folder.iterdir())
        restart = max((one.stat().st_size for one in files if one.suffix == ".rst"), default=0)
        histories = sum(self.history(one).stat().st_size for one in range(number) if self.history(one).exists())
        needed = (restarts + 1) * restart + round(histories * share / max(1 - share, 0.1))
        free = shutil.disk_usage(self.folder).free
        if free < needed:
            raise D2RPickError(
                f"{self.folder}: leg {number} may need {needed / 1e6:.3g} MB, {free / 1e6:.3g} MB are free; "
                "make room, then --resume"
            )

    def _restarts(self, number: int) -> list[Path]:
        return list(self.folder.glob(f"{self.name}_{number:04d}_*.rst"))


def _letter(restart: Path) -> str:
    """Give the letter of a restart, as /RUN names it; empty where it has none."""
    last = restart.stem.rpartition("_")[2]
    return "" if last.isdecimal() else last


def _tail(path: Path) -> bytes:
    with suppress(OSError), path.open("rb") as stream:
        stream.seek(max(path.stat().st_size - _TAIL, 0))
        return stream.read()
    return b""


def _let_stack_grow() -> None:
    """Give the processes that are started as much stack as the system allows: solvers hold arrays on it."""
    import resource

    _, most = resource.getrlimit(resource.RLIMIT_STACK)
    with suppress(OSError, ValueError):
        resource.setrlimit(resource.RLIMIT_STACK, (most, most))
