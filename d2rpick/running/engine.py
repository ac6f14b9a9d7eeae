"""The solver's processes in the folder of a run: how they are started and ended, and what they leave.

Restarts and what they are called: runs with OpenRadioss 2026-08.
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

from d2rpick.base.errors import ConfigurationError, D2RPickError, FormatError, printable
from d2rpick.histories.formats.radioss_th import TimeHistory

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator, Sequence

# Where an installation has its programs, and how they are called.
_PROGRAMS: Final = {
    "starter": (
        ("bin/starter_gf", "exec/starter_linux64_gf"),
        "-i {deck} -np 1 -nt {threads}",
    ),
    "engine": (("bin/engine_gf", "exec/engine_linux64_gf"), "-i {deck} -nt {threads}"),
}
_HOME: Final = "OPENRADIOSS_PATH"
_STARTER_ERROR: Final = re.compile(rb"^ *[1-9]\d* +ERROR\(S\)", re.MULTILINE)
_CYCLES: Final = re.compile(rb"TOTAL NUMBER OF CYCLES *: *(\d+)")
_TOTAL: Final = re.compile(rb"^ TOTAL\.+: +([\d.E+-]+)", re.MULTILINE)
_TAIL: Final = 1 << 14
# The listing of a starter says first what is wrong, and much behind it: bytes of it, how that begins, and its lines.
_LISTING, _ERROR, _OF_ERROR = 1 << 22, "** ERROR", 4
_LAST_LINES: Final = 8
# A restart that is whole has so much of the size of the starter's.
_WHOLE: Final = 0.98
# How long a solver may take to end when it is asked to, and between two looks whether it has [s].
_ENDS, _PAUSE = 4.0, 0.05


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
            raise ConfigurationError(
                f"--{program} {template!r}: cannot be split into words ({error})"
            ) from None
        if not any("{deck}" in word for word in split):
            raise ConfigurationError(
                f"--{program} {template!r}: {{deck}} was expected, where the name of the file goes"
            )
        return [
            _whole(split[0]),
            *(
                word.replace("{deck}", deck).replace("{threads}", str(self.threads))
                for word in split[1:]
            ),
        ]

    def missing(self) -> str:
        """Name the first program that is not there, or cannot be started; empty where all can.

        ConfigurationError as of `words`.
        """
        programs = (self.words(program, "{deck}")[0] for program in _PROGRAMS)
        return next((one for one in programs if shutil.which(one) is None), "")


def _whole(program: str) -> str:
    """Give the path of a program that is named by one: it is started in another folder."""
    return str(Path(program).absolute()) if "/" in program else program


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
        libraries = (
            f"{home}/exec",
            os.environ.get("LD_LIBRARY_PATH"),
            f"{home}/syslib",
        )
        own |= {
            "RAD_CFG_PATH": f"{home}/hm_cfg_files",
            "LD_LIBRARY_PATH": os.pathsep.join(filter(None, libraries)),
        }
    return {
        **own,
        **os.environ,
        "LD_LIBRARY_PATH": own.get(
            "LD_LIBRARY_PATH", os.environ.get("LD_LIBRARY_PATH", "")
        ),
    }


@contextmanager
def alone(folder: Path) -> Iterator[None]:
    """Keep every other driver out of a folder; D2RPickError where one is at work there."""
    lock = _locked(folder / ".drive.lock")
    if lock is None:
        raise D2RPickError(
            f"{folder}: another d2rpick drives this run; wait for it, or choose another folder"
        )
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


class Solver:
    """The solver in the folder of a run, one process at a time.

    The process holds a lock as long as it lives, so that a driver that comes later knows of it.
    """

    def __init__(self, folder: Path, name: str, threads: int = 1) -> None:
        self.folder, self.name, self.threads = folder, name, threads
        self._lock = folder / ".solver.lock"
        self._process: subprocess.Popen[bytes] | None = None
        self._signal = 0  # by which the last process was ended; 0: by none

    def file(self, number: int, suffix: str) -> Path:
        """Name a file of a leg, 0 for the starter."""
        return self.folder / f"{self.name}_{number:04d}{suffix}"

    def history(self, number: int) -> Path:
        """Name the time history of a leg."""
        return self.folder / f"{self.name}T{number:02d}"

    def clear(self, number: int) -> None:
        """Remove what an earlier leg of this number left."""
        for path in (
            self.history(number),
            *(self.file(number, one) for one in (".ctl", ".out", ".log")),
        ):
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
            raise D2RPickError(
                f"{self.folder}: a solver is at work there; wait for its end"
            )
        try:
            _let_stack_grow()
            with self.file(number, ".log").open("wb") as log:
                # of its own session: Ctrl-C reaches the driver, which ends all processes of the solver
                self._process = subprocess.Popen(
                    command, cwd=self.folder, env=_surroundings(self.threads), stdin=subprocess.DEVNULL, stdout=log,
                    stderr=subprocess.STDOUT, start_new_session=True, pass_fds=[lock],
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
        """Whether a solver is at work, also one that an earlier driver started."""
        if self._process is not None:
            code = self._process.poll()
            if code is None:
                return True
            self._process, self._signal = None, max(-code, 0)
        lock = _locked(self._lock)
        if lock is not None:
            os.close(lock)
        return lock is None

    def end(self) -> None:
        """End the solver, also one that an earlier driver started, with all its processes."""
        text = self._lock.read_bytes() if self._lock.exists() else b""
        for sign in (signal.SIGTERM, signal.SIGKILL):
            if not self.alive or not text.isdigit():
                return
            with suppress(ProcessLookupError, PermissionError):
                os.killpg(int(text), sign)
            begun = time.monotonic()
            with suppress(KeyboardInterrupt):  # of somebody who cannot wait
                while time.monotonic() - begun < _ENDS and self.alive:
                    time.sleep(_PAUSE)

    def silent_for(self) -> float:
        """For how long the solver has written nothing [s]."""
        times = [
            one.stat().st_mtime
            for one in self.folder.glob(f"{self.name}*")
            if one.exists()
        ]
        return max(0.0, time.time() - max(times, default=time.time()))

    def ended_well(self, number: int) -> bool:
        """Whether the listing of a leg says that it came to its end."""
        return b"NORMAL TERMINATION" in _tail(self.file(number, ".out"))

    def took(self, number: int) -> tuple[int | None, float | None]:
        """Give cycles and processor time [s] of a leg; None where its listing does not say them."""
        listing = _tail(self.file(number, ".out"))
        cycles, total = (
            found[-1] if (found := one.findall(listing)) else None
            for one in (_CYCLES, _TOTAL)
        )
        return None if cycles is None else int(
            cycles
        ), None if total is None else float(total)

    def whole(self, number: int) -> bool:
        """Whether the restarts of a leg are whole, 0 for the starter: those of all domains, as long as at first.

        A restart of OpenRadioss begins with its own name, and is as long as the first one but for what has changed of
        the contacts; a disk that is full leaves shorter ones, although the listing ends as it should.
        """
        first, own = self._restarts(0), self._restarts(number)
        sizes = {path.name[-8:]: path.stat().st_size for path in first}
        named = all(map(_begins_with_its_name, first))
        return {path.name[-8:] for path in own} >= sizes.keys() != set() and all(
            path.stat().st_size >= max(_WHOLE * sizes.get(path.name[-8:], 1), 1)
            and (not named or _begins_with_its_name(path))
            for path in own
        )

    def came_to(self, number: int, end: float) -> bool:
        """Whether the history of a leg reaches a time [time]."""
        path = self.history(number)
        try:
            written = TimeHistory(path.read_bytes(), str(path)).time
        except (FormatError, OSError):
            return False
        return bool(written.size) and float(written[-1]) >= end

    def started_well(self) -> bool:
        """Whether the starter has ended without an error, and left a restart."""
        return self.whole(0) and not _STARTER_ERROR.search(_tail(self.file(0, ".out")))

    def last_words(self, number: int) -> str:
        """Give what the solver said of its error, or the last lines that it printed, in one."""
        listing = (
            _tail(self.file(number, ".out"), _LISTING).decode("latin-1").splitlines()
        )
        at = [place for place, line in enumerate(listing) if _ERROR in line]
        text = (
            (_tail(self.file(number, ".log")) or _tail(self.file(number, ".out")))
            .decode("latin-1")
            .splitlines()
        )
        errors = [line for place in at for line in listing[place : place + _OF_ERROR]]
        lines = [" ".join(line.split()) for line in errors or text if line.strip(" -*")]
        told = lines[:_LAST_LINES] if errors else lines[-_LAST_LINES:]
        ended = f"ended by signal {self._signal}; " if self._signal else ""
        return ended + (printable(" | ".join(told)) or "nothing was printed")

    def keep(self, numbers: Collection[int]) -> None:
        """Remove the restarts of legs but for these, and of the starter's."""
        for path in self.folder.glob(f"{self.name}_[0-9][0-9][0-9][0-9]_*.rst"):
            number = int(path.name[len(self.name) + 1 :][:4])
            if number and number not in numbers:
                path.unlink(missing_ok=True)

    def check_room(self, number: int, share: float) -> None:
        """Raise D2RPickError where the disk has no room for a leg that has this share of the run still before it."""
        files = list(self.folder.iterdir())
        restart = max(
            (one.stat().st_size for one in files if one.suffix == ".rst"), default=0
        )
        histories = sum(
            self.history(one).stat().st_size
            for one in range(number)
            if self.history(one).exists()
        )
        needed = 2 * restart + round(histories * share / max(1 - share, 0.1))
        free = shutil.disk_usage(self.folder).free
        if free < needed:
            raise D2RPickError(
                f"{self.folder}: leg {number} may need {needed / 1e6:.3g} MB, {free / 1e6:.3g} MB are free; "
                "make room, then --resume"
            )

    def _restarts(self, number: int) -> list[Path]:
        return list(self.folder.glob(f"{self.name}_{number:04d}_*.rst"))


def _begins_with_its_name(restart: Path) -> bool:
    with restart.open("rb") as stream:
        return stream.read(len(restart.name)) == restart.name.encode()


def _tail(path: Path, size: int = _TAIL) -> bytes:
    with suppress(OSError), path.open("rb") as stream:
        stream.seek(max(path.stat().st_size - size, 0))
        return stream.read()
    return b""


def _let_stack_grow() -> None:
    """Give the processes that are started as much stack as the system allows: solvers hold arrays on it."""
    import resource

    _, most = resource.getrlimit(resource.RLIMIT_STACK)
    with suppress(OSError, ValueError):
        resource.setrlimit(resource.RLIMIT_STACK, (most, most))
