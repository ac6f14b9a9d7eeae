"""Calls give the same results in this process, in other processes and on a cluster; a dead process stops nothing."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Generator, Iterator
from pathlib import Path
from subprocess import PIPE, Popen, check_output

import pytest

from d2rpick.base.errors import D2RPickError
from d2rpick.base.workers import Cores, Farm, count_cores
from tests.command import ROOT, TIME_LIMIT

FARMS = [Farm, lambda: Cores(2, __name__)]


def square(number: int) -> int:
    """Compute, fail or die, depending on the number."""
    if number == 13:
        raise ValueError("thirteen")
    if number == 99:
        os.kill(os.getpid(), signal.SIGKILL)
    time.sleep(0.02 if number == 0 else 0)
    return number**2


@pytest.mark.parametrize("farm", FARMS)
def test_every_item_is_answered_once_by_its_number(farm: Callable[[], Farm]) -> None:
    with farm() as workers:
        results = {
            answer.number: answer.result
            for answer in workers.answers(square, range(12))
        }
    assert results == {i: i**2 for i in range(12)}


@pytest.mark.parametrize("farm", FARMS)
def test_an_error_is_the_answer_of_its_item_alone(farm: Callable[[], Farm]) -> None:
    with farm() as workers:
        answers = {
            answer.number: answer for answer in workers.answers(square, (1, 13, 2))
        }
    assert [answers[i].result for i in range(3)] == [1, None, 4]
    assert str(answers[1].error) == "thirteen"
    assert answers[0].error is answers[2].error is None


def test_a_process_that_dies_is_told_for_its_item_alone() -> None:
    items = [*range(8), 99, *range(8, 12), 99, 12]
    with Cores(2, __name__) as workers:
        answers = {answer.number: answer for answer in workers.answers(square, items)}
    dead = [number for number, answer in answers.items() if answer.error]
    assert sorted(dead) == [8, 13]
    assert all(isinstance(answers[number].error, D2RPickError) for number in dead)
    assert "memory" in str(answers[8].error)
    assert [answers[n].result for n in sorted(answers) if n not in dead] == [
        i**2 for i in range(13)
    ]


def children_of(process: int) -> dict[str, list[int]]:
    """Return the ids of the child processes by kind; forked processes have the command of the first one."""
    listed = check_output(
        ["ps", "-e", "-ww", "-o", "pid=,ppid=,args="], text=True
    ).splitlines()
    rows = [line.split(maxsplit=2) for line in listed]
    kinds: dict[str, list[int]] = {
        "resource_tracker": [],
        "forkserver": [],
        "worker": [],
    }
    for pid, parent, command in rows:
        kind = next((kind for kind in kinds if kind in command), "")
        if int(parent) == process and kind:
            kinds[kind].append(int(pid))
    kinds["worker"] = [
        int(pid) for pid, parent, _ in rows if int(parent) in kinds["forkserver"]
    ]
    return kinds


@pytest.mark.skipif(
    not Path("/proc").exists(), reason="processes are listed as on Linux"
)
@pytest.mark.parametrize("victim", ["forkserver", "worker", "resource_tracker"])
@pytest.mark.parametrize(
    "after", [1, *(pytest.param(done, marks=pytest.mark.slow) for done in (0, 5))]
)
def test_any_process_may_be_killed_without_a_loss(victim: str, after: int) -> None:
    code = (
        "from d2rpick.base.workers import Cores\n"
        "from tests.base.test_workers import square\n"
        "with Cores(2, 'tests.base.test_workers') as farm:\n"
        "    for done, answer in enumerate(farm.answers(square, [0] * 12)):\n"
        "        assert answer.error is None, answer\n"
        f"        if done == {after}: print(flush=True); input()\n"
        "print(done)\n"
    )
    with Popen(
        [sys.executable, "-c", code],
        cwd=ROOT,
        stdin=PIPE,
        stdout=PIPE,
        stderr=PIPE,
        text=True,
    ) as process:
        assert process.stdout
        assert process.stdout.readline() == "\n"
        os.kill(children_of(process.pid)[victim][0], signal.SIGKILL)
        assert process.communicate("\n", timeout=TIME_LIMIT) == ("11\n", "")
    assert process.returncode == 0


def test_a_program_that_is_killed_leaves_no_message_of_its_pool() -> None:
    """The processes of the pool end silently, whoever kills the program."""
    code = (
        "import os, signal\n"
        "from d2rpick.base.workers import Cores\n"
        "from tests.base.test_workers import square\n"
        "with Cores(2, 'tests.base.test_workers') as farm:\n"
        "    next(farm.answers(square, [0] * 12))\n"
        "    os.kill(os.getpid(), signal.SIGKILL)\n"
    )
    with Popen(
        [sys.executable, "-c", code], cwd=ROOT, stdout=PIPE, stderr=PIPE, text=True
    ) as process:
        # The processes of the pool inherit stderr, so this waits until all of them have ended.
        assert process.communicate(timeout=TIME_LIMIT) == ("", "")
    assert process.returncode == -signal.SIGKILL


def test_a_worker_that_starts_too_late_ends_without_a_traceback() -> None:
    """The program may end before it has sent what a worker needs to start."""
    code = (
        "import d2rpick.base.interruptible, os\n"
        "from multiprocessing.spawn import _main\n"
        "end, start = os.pipe()\n"
        "os.close(start)\n"
        "_main(end, end)\n"
    )
    process = subprocess.run(
        [sys.executable, "-c", code],
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=TIME_LIMIT,
        check=False,
    )
    assert (process.returncode, process.stderr) == (1, "")


@pytest.mark.parametrize("farm", FARMS)
def test_items_are_taken_as_there_is_room(farm: Callable[[], Farm]) -> None:
    taken = 0

    def items() -> Iterator[int]:
        nonlocal taken
        for number in range(60):
            taken += 1
            yield number

    with farm() as workers:
        for done, _ in enumerate(workers.answers(square, items())):
            assert taken <= done + getattr(workers, "room", 1)


class UnsendableError(Exception):
    """An error that can be packed, but not unpacked."""

    def __init__(self, place: int, reason: str) -> None:
        super().__init__(f"{reason} at {place}")


def answer_oddly(number: int) -> object:
    """Return or raise something that cannot be sent to another process, or more than a pipe holds."""
    if number == 0:
        return lambda: None
    if number == 1:
        raise UnsendableError(7, "odd")
    return bytes(10**6)


def test_an_answer_that_cannot_be_sent_is_an_error_of_its_item_alone() -> None:
    with Cores(2, __name__) as workers:
        answers = {
            answer.number: answer for answer in workers.answers(answer_oddly, range(6))
        }
    assert sorted(answers) == [*range(6)]
    assert all("cannot be sent" in str(answers[number].error) for number in (0, 1))
    assert all(answers[number].result == bytes(10**6) for number in (2, 3, 4, 5))


def test_an_error_in_another_process_keeps_its_place_beside_its_message() -> None:
    """The message stays one line, and ``--debug`` shows the line that failed."""
    with Cores(2, __name__) as workers:
        (answer,) = workers.answers(square, [13])
    assert answer.error
    assert str(answer.error) == "thirteen"
    assert "in square" in "".join(answer.error.__notes__)


def test_items_larger_than_a_pipe_reach_their_process() -> None:
    with Cores(2, __name__) as workers:
        lengths = [answer.result for answer in workers.answers(len, [bytes(10**6)] * 9)]
    assert lengths == [10**6] * 9


def test_answers_that_nobody_awaited_are_no_answers_of_later_calls() -> None:
    with Cores(2, __name__) as workers:
        first = workers.answers(square, [0] * 9)
        assert next(first).result == 0
        assert isinstance(first, Generator)
        first.close()
        later = {answer.number: answer.result for answer in workers.answers(abs, [-5])}
    assert later == {0: 5}


def test_there_is_a_core() -> None:
    assert count_cores() >= 1


def test_an_interrupt_while_the_first_process_imports_is_no_traceback(
    tmp_path: Path,
) -> None:
    """If the parent continues after the interrupt, it restarts the process."""
    (tmp_path / "slow.py").write_text(
        "import sys; print('importing', flush=True); sys.stdin.readline()"
    )
    code = (
        "import signal; from d2rpick.base.workers import Cores, start_importing\n"
        "signal.signal(signal.SIGINT, lambda *_: None)\n"  # an ignored SIGINT would be inherited
        "start_importing(2, 'slow')\n"
        "with Cores(2, 'slow') as farm: print(next(farm.answers(abs, [-7])).result)\n"
    )
    command = [sys.executable, "-c", code]
    with Popen(
        command,
        cwd=tmp_path,
        stdin=PIPE,
        stdout=PIPE,
        stderr=PIPE,
        text=True,
        start_new_session=True,
    ) as process:
        assert process.stdout
        assert process.stdout.readline() == "importing\n"
        os.killpg(process.pid, signal.SIGINT)  # to the children too, as a terminal does
        assert process.communicate("\n", timeout=TIME_LIMIT) == ("importing\n7\n", "")
