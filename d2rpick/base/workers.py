"""Where many calls are computed: in this process, by a pool of processes, or on a Dask cluster."""

from __future__ import annotations

import os
import signal
import time
from concurrent.futures import (
    FIRST_COMPLETED,
    CancelledError,
    Future,
    ProcessPoolExecutor,
    wait,
)
from concurrent.futures.process import BrokenProcessPool
from itertools import islice
from multiprocessing import (
    Pipe,
    get_all_start_methods,
    get_context,
    set_forkserver_preload,
)
from threading import Thread
from typing import TYPE_CHECKING, Any, NamedTuple, Self, TypeVar

from d2rpick.base.errors import D2RPickError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator
    from multiprocessing.connection import Connection

Item = TypeVar("Item")
Result = TypeVar("Result")

# Plain forks copy locks that threads hold; one process that forks from a clean state is nearly as quick.
_METHOD = "forkserver" if "forkserver" in get_all_start_methods() else "spawn"
# Calls that wait for each process beside the one it works on: enough to keep it busy, too few to fill memory.
_WAITING = 2
# On a cluster, whose workers may come and go.
_LEAST_ON_CLUSTER = 64
# Tries to make a pool: after the first the process is started anew that others are forked from, if that was killed.
_STARTS = 3
_DYING = 0.1  # [s] between two tries: a process that was killed counts as alive until the system has ended it
# What the start of a process raises if the one that it is forked from was killed.
_NOT_STARTED = (BrokenProcessPool, EOFError, OSError)
# [s] until a scheduler has to answer.
_PATIENCE = 10


def cores() -> int:
    """Count the cores that this process may use."""
    try:
        return len(os.sched_getaffinity(0))
    except AttributeError:  # not on every system
        return os.cpu_count() or 1


class Finished(NamedTuple):
    """Result of the call for the item of this number, or the error that it ended with."""

    number: int
    result: Any
    error: BaseException | None


class Farm:
    """What computes calls: this one in the calling process, one after the other."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        """Give up what has not begun."""

    def answers(
        self, function: Callable[[Item], Result], items: Iterable[Item]
    ) -> Iterator[Finished]:
        """Compute ``function`` for all items, taken as there is room; answers come as they are finished."""
        return (_computed(number, function, item) for number, item in enumerate(items))


def _computed(number: int, function: Callable[[Item], Any], item: Item) -> Finished:
    try:
        return Finished(number, function(item), None)
    except Exception as error:  # noqa: BLE001  told by the answer, as a pool does
        return Finished(number, None, error)


class Cores(Farm):
    """A pool of processes on this machine, which have imported ``module`` before they begin."""

    def __init__(self, processes: int, module: str) -> None:
        begin(processes, module)
        self.processes, self.room = processes, (1 + _WAITING) * processes
        self._held, self._leash = Pipe(
            duplex=False
        )  # the processes see when this end of it is closed
        self._pool = self._new(processes)

    def __exit__(self, *_: object) -> None:
        self._pool.shutdown(wait=False, cancel_futures=True)
        self._leash.close()

    def answers(
        self, function: Callable[[Item], Result], items: Iterable[Item]
    ) -> Iterator[Finished]:
        """Compute up to ``room`` calls at a time.

        A call whose process died is repeated once, alone: the death breaks a whole pool, and not all of its calls are
        to blame.  The process that the others are forked from may die as well: it is started anew.
        """
        queue = iter(enumerate(items))
        running: dict[Future[Result], tuple[int, Item]] = {}
        while True:
            for number, item in islice(queue, self.room - len(running)):
                running[self._submit(function, item)] = number, item
            if not running:
                return
            suspects = []
            for future in wait(running, return_when=FIRST_COMPLETED).done:
                number, item = running.pop(future)
                if isinstance(future.exception(), BrokenProcessPool):
                    suspects.append((number, item))
                else:
                    yield _answer(number, future)
            for number, item in suspects:
                yield self._answer_alone(number, function, item)

    def _submit(self, function: Callable[[Item], Result], item: Item) -> Future[Result]:
        """Hand the call to the pool; to a new one if the last is broken."""
        try:
            return self._pool.submit(function, item)
        except _NOT_STARTED:
            self._pool.shutdown(wait=False)
            self._pool, future = self._begin_pool(self.processes, function, item)
            return future

    def _answer_alone(
        self, number: int, function: Callable[[Item], Result], item: Item
    ) -> Finished:
        """Compute a call in a pool of its own, so that no other call ends with its process."""
        pool, future = self._begin_pool(1, function, item)
        try:
            return _answer(number, future)
        finally:
            pool.shutdown(wait=False)  # an interrupt does not wait for the call

    def _begin_pool(
        self, processes: int, function: Callable[[Item], Result], item: Item
    ) -> tuple[ProcessPoolExecutor, Future[Result]]:
        """Make a pool that begins with a call; D2RPickError if none of its processes can be started."""
        for _ in range(_STARTS):
            pool = self._new(processes)
            try:
                return pool, pool.submit(function, item)
            except _NOT_STARTED as error:
                pool.shutdown(wait=False)
                time.sleep(_DYING)
                reason = " ".join(str(error).split())
        raise D2RPickError(
            f"no process can be started ({reason}); is there a limit on their number?"
        )

    def _new(self, processes: int) -> ProcessPoolExecutor:
        return ProcessPoolExecutor(
            processes, get_context(_METHOD), _begin_work, (self._held,)
        )


def _answer(number: int, future: Future[Any]) -> Finished:
    error = future.exception()
    if isinstance(error, BrokenProcessPool):
        error = D2RPickError(
            "its process ended without a result; was there enough memory?"
        )
    return Finished(number, None if error else future.result(), error)


def _begin_work(held: Connection) -> None:
    """End this process, whatever it does, when the other end of ``held`` is closed; without a word on interrupts."""
    if (
        signal.getsignal(signal.SIGINT) is signal.default_int_handler
    ):  # a spawned process; a forked one has no such
        signal.signal(signal.SIGINT, signal.SIG_DFL)

    def follow() -> None:
        held.poll(None)  # nothing is ever sent
        os._exit(1)

    Thread(target=follow, daemon=True).start()


def begin(processes: int, module: str) -> None:
    """Let one process import ``module``, from which others are forked later, while this one goes on.

    Whoever will need several of them calls it first; for a single one nothing happens.
    """
    if processes > 1:
        # read when a process imports numpy: with several of them, threads would only fight over the cores
        os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
        if _METHOD == "forkserver":
            _start_server(module)


def _start_server(module: str) -> None:
    """Start the process that others are forked from; an interrupt ends it without a word, even while it imports."""
    from multiprocessing import forkserver, resource_tracker  # not on every system

    set_forkserver_preload(["d2rpick.base.interruptible", module])
    resource_tracker.ensure_running()  # its start would lift what is blocked here
    before = signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])
    try:
        forkserver.ensure_running()
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def on_cores(processes: int, module: str) -> Farm:
    """Choose where to compute on this machine; for a single process, in this one."""
    return Cores(processes, module) if processes > 1 else Farm()


class Cluster(Farm):
    """A Dask cluster that is running already, under the address of its scheduler, which has to answer in time [s].

    Raises
    ------
    D2RPickError
        If ``distributed`` is not installed or no scheduler answers.
    """

    def __init__(self, address: str, patience: float = _PATIENCE) -> None:
        try:
            from distributed import Client
        except ImportError:
            found = "a Dask cluster needs the extra 'dask' of d2rpick"
            raise D2RPickError(
                f"{found}; install it with: pip install distributed"
            ) from None
        try:
            self._client = Client(address, timeout=patience, set_as_default=False)
        except (OSError, ValueError) as error:
            what = " ".join(str(error).split())
            raise D2RPickError(
                f"{address}: no answer from a Dask scheduler ({what}); check the address"
            ) from None
        self.threads = sum(self._client.nthreads().values())
        self.room = max(_LEAST_ON_CLUSTER, (1 + _WAITING) * self.threads)

    def __exit__(self, *_: object) -> None:
        self._client.close()

    def answers(
        self, function: Callable[[Item], Result], items: Iterable[Item]
    ) -> Iterator[Finished]:
        """Hand up to ``room`` calls to the scheduler, which repeats them where a worker dies.

        They go by the half of it, since each message costs as much as a call.
        """
        from distributed import as_completed

        queue, numbers = enumerate(items), dict[str, int]()
        done = as_completed(
            loop=self._client.loop, with_results=True, raise_errors=False
        )
        while True:
            wanted = self.room - len(numbers)
            if wanted >= self.room // 2 and (more := list(islice(queue, wanted))):
                begun = self._client.map(
                    function, [item for _, item in more], pure=False
                )
                numbers.update(
                    (future.key, number)
                    for future, (number, _) in zip(begun, more, strict=True)
                )
                done.update(begun)
            if not numbers:
                return
            for future, result in done.next_batch():
                yield _of_cluster(numbers.pop(future.key), future.status, result)


def _of_cluster(number: int, status: str, result: Any) -> Finished:
    """Give what a task of a cluster ended with: of one that failed, ``result`` is the kind, the error and its trace.

    The status of one that did not may be another by now: its worker may have died since it was asked for the result.
    """
    if isinstance(result, CancelledError):
        return Finished(
            number,
            None,
            D2RPickError("cancelled by the cluster; is its scheduler still running?"),
        )
    return (
        Finished(number, None, result[1])
        if status == "error"
        else Finished(number, result, None)
    )
