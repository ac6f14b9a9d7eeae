"""Compute many calls in this process, in a pool of processes, or on a Dask cluster."""

from __future__ import annotations

import os
import signal
import time
from concurrent.futures import CancelledError, Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from functools import partial
from itertools import islice
from multiprocessing import (
    Pipe,
    get_all_start_methods,
    get_context,
    set_forkserver_preload,
)
from queue import SimpleQueue
from threading import Thread
from typing import TYPE_CHECKING, Any, NamedTuple, Self, TypeVar

from d2rpick.base.errors import D2RPickError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator
    from multiprocessing.connection import Connection

Item = TypeVar("Item")
Result = TypeVar("Result")

# A fork copies the locks of all threads. Forking from a clean process avoids this and is nearly as fast.
_METHOD = "forkserver" if "forkserver" in get_all_start_methods() else "spawn"
# Number of calls queued per process, which keeps the processes busy and the memory small.
_WAITING = 2
# Smallest number of calls sent to a cluster at a time, because its number of workers may change.
_LEAST_ON_CLUSTER = 64
# Largest number of attempts to start a pool; the fork server is restarted after the first attempt.
_STARTS = 3
_DYING = 0.1  # Pause between attempts to start a pool [s], so that the system can finish terminating a killed process.
# Errors that are raised if a process is started after the fork server was killed.
_NOT_STARTED = (BrokenProcessPool, EOFError, OSError)
# Filter, as in PYTHONWARNINGS, for warnings whose text begins with the name of the resource tracker.
_QUIET_TRACKER = "ignore:resource_tracker:UserWarning"
# Longest wait for a reply from the scheduler [s].
_PATIENCE = 10


def count_cores() -> int:
    """Return the number of cores that this process may use."""
    try:
        return len(os.sched_getaffinity(0))
    except AttributeError:  # Some systems lack this function.
        return os.cpu_count() or 1


class Finished(NamedTuple):
    """The result of the call for one item, or the error that ended the call."""

    number: int
    result: Any
    error: BaseException | None


class _Call(NamedTuple):
    """A call for one item; ``is_suspect`` is True if the pool that computed it broke."""

    number: int
    item: Any
    is_suspect: bool = False


class Farm:
    """Computes calls in the calling process, one after another; derived classes compute them elsewhere."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        """Cancel the calls that have not begun."""

    def answers(
        self, function: Callable[[Item], Result], items: Iterable[Item]
    ) -> Iterator[Finished]:
        """Yield the results of ``function`` for all items, in the order in which the calls finish."""
        return (
            _compute_call(number, function, item) for number, item in enumerate(items)
        )


def _compute_call(number: int, function: Callable[[Item], Any], item: Item) -> Finished:
    """Execute one call; an exception is returned in the result instead of being raised."""
    try:
        return Finished(number, function(item), None)
    except Exception as error:  # noqa: BLE001  the caller handles any error
        return Finished(number, None, error)


class Cores(Farm):
    """A pool of processes on this machine, each of which has imported ``module`` before its first call.

    A thread of its own uses the pool.  An interrupt is raised in the main thread at any line, and one that is raised
    where the main thread holds a lock of the pool would leave it locked, so that the program could never end.
    """

    def __init__(self, processes: int, module: str) -> None:
        start_importing(processes, module)
        self.processes, self.room = processes, (1 + _WAITING) * processes
        # Closing this end of the pipe makes the processes exit.
        self._held, self._leash = Pipe(duplex=False)
        self._pool = self._new(processes)
        self._is_closed = False

    def __exit__(self, *exception: object) -> None:
        """End all processes.

        The thread of the pool is awaited: until Python 3.12, the pool's own handler at exit may use a pipe that this
        thread is just closing, and prints a traceback.
        """
        self._is_closed = True
        self._leash.close()
        # After an interrupt, the pool's thread may keep its lock for ever, because it waits for a dead process.
        if KeyboardInterrupt not in exception:
            self._pool.shutdown(wait=True, cancel_futures=True)

    def answers(
        self, function: Callable[[Item], Result], items: Iterable[Item]
    ) -> Iterator[Finished]:
        """Yield the results of all calls; at most ``room`` calls are computed or queued at the same time.

        If the process of a call dies, the call is repeated once in a pool of its own: the death breaks a whole pool,
        and not all of its calls cause it. The process from which others are forked may die too; it is then restarted.
        """
        queue = enumerate(items)
        # An interrupt cannot damage these queues, because they are not written in Python.
        calls = SimpleQueue[_Call | None]()
        finished = SimpleQueue[Finished | BaseException]()
        Thread(
            target=self._compute, args=(function, calls, finished), daemon=True
        ).start()
        running = 0
        try:
            while True:
                for number, item in islice(queue, self.room - running):
                    calls.put(_Call(number, item))
                    running += 1
                if not running:
                    return
                answer = finished.get()
                if isinstance(answer, BaseException):
                    raise answer
                running -= 1
                yield answer
        finally:
            calls.put(None)

    def _compute(
        self,
        function: Callable[[Any], Any],
        calls: SimpleQueue[_Call | None],
        finished: SimpleQueue[Finished | BaseException],
    ) -> None:
        """Compute ``calls`` until None arrives; put each answer, or an error that ends all calls, into ``finished``."""

        def hand_over(call: _Call, future: Future[Any]) -> None:
            """Pass on the answer to a call, or the call itself if it has to be repeated."""
            if future.cancelled():
                return
            if isinstance(future.exception(), BrokenProcessPool):
                calls.put(call._replace(is_suspect=True))
            else:
                finished.put(_make_answer(call.number, future))

        try:
            while (call := calls.get()) and not self._is_closed:
                if call.is_suspect:
                    finished.put(self._answer_alone(call.number, function, call.item))
                else:
                    future = self._submit(function, call.item)
                    future.add_done_callback(partial(hand_over, call))
        except BaseException as error:  # noqa: BLE001  it is raised where the answers are awaited
            finished.put(error)

    def _submit(self, function: Callable[[Item], Result], item: Item) -> Future[Result]:
        """Submit a call to the pool; if the pool is broken, start a new one."""
        try:
            return self._pool.submit(function, item)
        except _NOT_STARTED:
            self._pool.shutdown(wait=False)
            self._pool, future = self._begin_pool(self.processes, function, item)
            return future

    def _answer_alone(
        self, number: int, function: Callable[[Item], Result], item: Item
    ) -> Finished:
        """Execute a call in a separate pool, so that a crash of its process affects no other call."""
        pool, future = self._begin_pool(1, function, item)
        answer = _make_answer(number, future)
        pool.shutdown(wait=False)
        return answer

    def _begin_pool(
        self, processes: int, function: Callable[[Item], Result], item: Item
    ) -> tuple[ProcessPoolExecutor, Future[Result]]:
        """Start a pool and submit one call to it; raise D2RPickError if none of its processes can be started."""
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
        """Return a new pool."""
        return ProcessPoolExecutor(
            processes, get_context(_METHOD), _begin_work, (self._held,)
        )


def _make_answer(number: int, future: Future[Any]) -> Finished:
    """Return the result or the error of a finished call."""
    error = future.exception()
    if isinstance(error, BrokenProcessPool):
        error = D2RPickError(
            "its process ended without a result; was there enough memory?"
        )
    return Finished(number, None if error else future.result(), error)


def _begin_work(held: Connection) -> None:
    """Exit this process when the other end of ``held`` is closed; an interrupt ends the process without a message."""
    # A spawned process still has Python's own handler; in a forked process, `interruptible` has already replaced it.
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, signal.SIG_DFL)

    def follow() -> None:
        # poll() returns only when the other end is closed, because nothing is ever sent.
        held.poll(None)
        os._exit(1)

    Thread(target=follow, daemon=True).start()


def start_importing(processes: int, module: str) -> None:
    """Import ``module`` in one background process, from which the workers are forked later.

    Call this as early as it is known that several processes will be needed; for a single one it does nothing.
    """
    if processes > 1:
        # numpy reads this variable when it is imported; its threads would compete with the processes for the cores.
        os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
        if _METHOD == "forkserver":
            _start_server(module)


def _start_server(module: str) -> None:
    """Start the process from which others are forked; an interrupt ends it silently, even during its imports."""
    # Windows has no fork server.
    from multiprocessing import forkserver

    set_forkserver_preload(["d2rpick.base.interruptible", module])
    _start_tracker()  # The tracker is started first, because starting it unblocks SIGINT.
    mask = signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])
    try:
        forkserver.ensure_running()
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)


def _start_tracker() -> None:
    """Start the process that deletes the semaphores of a program that was ended, which needs no warning."""
    from multiprocessing import resource_tracker

    given = os.environ.get("PYTHONWARNINGS")
    os.environ["PYTHONWARNINGS"] = _QUIET_TRACKER
    try:
        resource_tracker.ensure_running()
    finally:
        if given is None:
            del os.environ["PYTHONWARNINGS"]
        else:
            os.environ["PYTHONWARNINGS"] = given


def choose_farm(processes: int, module: str) -> Farm:
    """Return the object that computes calls in the given number of processes; 1 means in this process."""
    return Cores(processes, module) if processes > 1 else Farm()


class Cluster(Farm):
    """A running Dask cluster, given the address of its scheduler, which must answer within ``patience`` [s].

    Raises
    ------
    D2RPickError
        If ``distributed`` is not installed or no scheduler answers.
    """

    def __init__(self, address: str, patience: float = _PATIENCE) -> None:
        try:
            from distributed import Client
        except ImportError:
            raise D2RPickError(
                "a Dask cluster needs the extra 'dask' of d2rpick; install it with: pip install distributed"
            ) from None
        try:
            self._client = Client(address, timeout=patience, set_as_default=False)
        except (OSError, ValueError) as error:
            reason = " ".join(str(error).split())
            raise D2RPickError(
                f"{address}: no answer from a Dask scheduler ({reason}); check the address"
            ) from None
        self.threads = sum(self._client.nthreads().values())
        self.room = max(_LEAST_ON_CLUSTER, (1 + _WAITING) * self.threads)

    def __exit__(self, *_: object) -> None:
        self._client.close()

    def answers(
        self, function: Callable[[Item], Result], items: Iterable[Item]
    ) -> Iterator[Finished]:
        """Yield the results of all calls; at most ``room`` calls are sent to the scheduler at a time.

        The scheduler repeats the calls of dead workers.  Calls are submitted in groups of at least half of ``room``,
        since each message costs as much as a call.
        """
        from distributed import as_completed

        queue = enumerate(items)
        numbers = dict[str, int]()
        done = as_completed(
            loop=self._client.loop, with_results=True, raise_errors=False
        )
        while True:
            wanted = self.room - len(numbers)
            if wanted >= self.room // 2:
                batch = list(islice(queue, wanted))
                if batch:
                    futures = self._client.map(
                        function, [item for _, item in batch], pure=False
                    )
                    for future, (number, _) in zip(futures, batch, strict=True):
                        numbers[future.key] = number
                    done.update(futures)
            if not numbers:
                return
            for future, result in done.next_batch():
                yield _make_cluster_answer(
                    numbers.pop(future.key), future.status, result
                )


def _make_cluster_answer(number: int, status: str, result: Any) -> Finished:
    """Convert the outcome of a cluster task; the ``result`` of a failed task is its error type, error and traceback.

    The status of a successful task may have changed meanwhile: its worker may have died after it returned the result.
    """
    if isinstance(result, CancelledError):
        return Finished(
            number,
            None,
            D2RPickError("cancelled by the cluster; is its scheduler still running?"),
        )
    if status == "error":
        return Finished(number, None, result[1])
    return Finished(number, result, None)
