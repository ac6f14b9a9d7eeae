"""Compute many calls in this process, in a pool of processes, or on a Dask cluster."""

from __future__ import annotations

import os
import pickle
import signal
import time
import warnings
from collections import deque
from concurrent.futures import CancelledError
from contextlib import suppress
from itertools import islice
from multiprocessing import (
    Pipe,
    get_all_start_methods,
    get_context,
    set_forkserver_preload,
)
from multiprocessing.connection import wait
from threading import Thread
from typing import TYPE_CHECKING, Any, NamedTuple, Self, TypeVar, cast

from d2rpick.base.errors import D2RPickError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator
    from multiprocessing.connection import Connection
    from multiprocessing.process import BaseProcess

Item = TypeVar("Item")
Result = TypeVar("Result")

# A fork copies the locks of all threads. Forking from a clean process avoids this and is nearly as fast.
_METHOD = "forkserver" if "forkserver" in get_all_start_methods() else "spawn"
# Number of calls that wait per process, which keeps the processes busy and the memory small.
_WAITING = 2
# Smallest number of calls sent to a cluster at a time, because its number of workers may change.
_LEAST_ON_CLUSTER = 64
# Largest number of attempts to start a process; the fork server is restarted after the first attempt.
_STARTS = 3
# Pause between these attempts [s], so that the system can finish terminating a killed fork server.
_DYING = 0.1
_DIED = "its process ended without a result; was there enough memory?"
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
    """A call for one item; ``is_repeated`` is True if the first process that computed it died."""

    number: int
    item: Any
    is_repeated: bool = False


class _Worker:
    """A process that computes one call at a time, which ``calls`` brings to it and from which its answers come back."""

    def __init__(self, process: BaseProcess, calls: Connection) -> None:
        self.process, self.calls = process, calls
        self.call: _Call | None = None

    def begin(self, function: Callable[[Any], Any], call: _Call) -> None:
        """Send a call; that the process has died is noticed when its answer is awaited."""
        self.call = call
        with suppress(OSError):
            self.calls.send((call.number, function, call.item))

    def take_answer(self) -> Finished | None:
        """Return the answer to the call, or None if the process has died."""
        try:
            answer: Finished = self.calls.recv()
        except (EOFError, OSError):
            return None
        self.call = None
        return answer


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

    Each process has a pipe of its own, so that an interrupt finds no lock that it could leave locked, and so that
    nothing has to be registered with the resource tracker of Python, which reports with tracebacks if it was killed.
    """

    def __init__(self, processes: int, module: str) -> None:
        start_importing(processes, module)
        self.processes, self.room = processes, (1 + _WAITING) * processes
        self._module = module
        # Closing this end of the pipe makes the processes exit.
        self._held, self._leash = Pipe(duplex=False)
        self._workers: list[_Worker] = []

    def __exit__(self, *_: object) -> None:
        """End all processes."""
        self._leash.close()

    def answers(
        self, function: Callable[[Item], Result], items: Iterable[Item]
    ) -> Iterator[Finished]:
        """Yield the results of all calls; at most ``room`` calls are computed or wait at the same time.

        If the process of a call dies, the call is repeated once, since something else may have ended the process. The
        process from which others are forked may die too; it is then restarted.
        """
        queue = enumerate(items)
        waiting = deque[_Call]()
        running = 0
        try:
            while True:
                for number, item in islice(queue, self.room - running):
                    waiting.append(_Call(number, item))
                    running += 1
                    self._begin_calls(function, waiting)
                if not running:
                    return
                answers = self._await_answers(waiting)
                # The processes compute the next calls while the caller uses these answers.
                self._begin_calls(function, waiting)
                running -= len(answers)
                yield from answers
        finally:
            # A process whose answer nobody awaits ends when it sends the answer.
            self._workers = [worker for worker in self._workers if not worker.call]

    def _begin_calls(
        self, function: Callable[[Any], Any], waiting: deque[_Call]
    ) -> None:
        """Send the first of the waiting calls to processes without a call; start processes while some are missing."""
        while waiting:
            idle = [worker for worker in self._workers if not worker.call]
            if not idle and len(self._workers) == self.processes:
                return
            (idle[0] if idle else self._start_worker()).begin(
                function, waiting.popleft()
            )

    def _await_answers(self, waiting: deque[_Call]) -> list[Finished]:
        """Return the answers of all processes that have finished, once there is one.

        The call of a process that has died is put before the waiting ones, or answered with an error if it was already
        repeated.
        """
        busy = {worker.calls: worker for worker in self._workers if worker.call}
        answers = []
        for ready in wait(list(busy)):
            worker = busy[cast("Connection", ready)]
            call = worker.call
            answer = worker.take_answer()
            if call and not answer:
                self._workers.remove(worker)
                worker.calls.close()
                if call.is_repeated:
                    answer = Finished(call.number, None, D2RPickError(_DIED))
                else:
                    waiting.appendleft(call._replace(is_repeated=True))
            if answer:
                answers.append(answer)
        return answers

    def _start_worker(self) -> _Worker:
        """Start a process; raise D2RPickError if it cannot be started."""
        context: Any = get_context(_METHOD)
        for _ in range(_STARTS):
            ours, theirs = Pipe()
            try:
                start_importing(self.processes, self._module)
                process = context.Process(
                    target=_work, args=(theirs, self._held), daemon=True
                )
                process.start()
            except (EOFError, OSError) as error:
                time.sleep(_DYING)
                reason = " ".join(str(error).split())
            else:
                self._workers.append(_Worker(process, ours))
                return self._workers[-1]
            finally:
                theirs.close()
        raise D2RPickError(
            f"no process can be started ({reason}); is there a limit on their number?"
        )


def _work(calls: Connection, held: Connection) -> None:
    """Compute calls until the other end of ``held`` is closed; an interrupt ends this process without a message."""
    # A spawned process still has Python's own handler; in a forked process, `interruptible` has already replaced it.
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, signal.SIG_DFL)

    def follow() -> None:
        # poll() returns only when the other end is closed, because nothing is ever sent.
        held.poll(None)
        os._exit(1)

    Thread(target=follow, daemon=True).start()
    # The program may end before this process has read or sent anything.
    with suppress(EOFError, OSError):
        while True:
            number, function, item = calls.recv()
            calls.send_bytes(_pack_answer(_compute_call(number, function, item)))


def _pack_answer(answer: Finished) -> bytes:
    """Return the answer as bytes; an error brings the place at which it was raised, for ``--debug``."""
    try:
        if answer.error:
            from traceback import format_exception

            answer.error.add_note("".join(format_exception(answer.error)))
            # Some errors can be packed, but not unpacked.
            pickle.loads(pickle.dumps(answer.error))
        return pickle.dumps(answer)
    except Exception as error:  # noqa: BLE001  the program has to learn of any failure
        reason = f"its answer cannot be sent ({type(error).__name__}: {error})"
        return pickle.dumps(Finished(answer.number, None, RuntimeError(reason)))


def start_importing(processes: int, module: str) -> None:
    """Import ``module`` in one background process, from which the workers are forked later, unless this runs already.

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
    from multiprocessing import forkserver, resource_tracker

    set_forkserver_preload(["d2rpick.base.interruptible", module])
    with warnings.catch_warnings():
        # Python warns if the tracker was killed, but the pool leaves nothing behind that it would have to delete.
        warnings.filterwarnings("ignore", "resource_tracker", UserWarning)
        # The tracker is started first, because starting it unblocks SIGINT.
        resource_tracker.ensure_running()
    mask = signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])
    try:
        forkserver.ensure_running()
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)


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
