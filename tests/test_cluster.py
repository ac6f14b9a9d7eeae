"""Studies on a real Dask scheduler and workers, each a process of its own; one worker is killed during a study."""

import json
import os
import re
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pytest

from d2rpick.base.errors import D2RPickError
from d2rpick.base.workers import Cluster
from tests import variants
from tests.command import ROOT, read_refusal, run

pytestmark = pytest.mark.skipif(
    not find_spec("distributed"), reason="needs the extra 'dask'"
)
PATIENCE = 30.0  # longest wait for a cluster [s]


def until(true: Callable[[], Any]) -> Any:
    """Wait until ``true`` returns a true value, and return this value."""
    end = time.monotonic() + PATIENCE
    while time.monotonic() < end:
        if value := true():
            return value
        time.sleep(0.02)
    raise AssertionError("waited in vain")


@contextmanager
def process(*args: str, **options: Any) -> Iterator[subprocess.Popen[str]]:
    """Run a Python program until the end of the block."""
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, **options}
    with subprocess.Popen(
        [sys.executable, *args], cwd=ROOT, text=True, **quiet
    ) as started:
        try:
            yield started
        finally:
            started.kill()


@contextmanager
def cluster(
    folder: Path, names: tuple[str, ...]
) -> Iterator[tuple[str, dict[str, subprocess.Popen[str]]]]:
    """Start a scheduler and one-thread workers with these names; yield the address, and the processes by name."""
    listed = folder / "scheduler.json"
    common = ("--no-dashboard", "--scheduler-file", str(listed), "--host", "127.0.0.1")
    with ExitStack() as stack:
        stack.enter_context(
            process("-m", "distributed.cli.dask_scheduler", *common, "--port", "0")
        )
        until(lambda: listed.exists() and listed.read_text())
        workers = {
            name: stack.enter_context(
                process(
                    *(
                        "-m",
                        "distributed.cli.dask_worker",
                        *common,
                        "--name",
                        name,
                        "--nthreads",
                        "1",
                        "--no-nanny",
                    ),
                    *("--local-directory", str(folder)),
                )
            )
            for name in names
        }
        yield json.loads(listed.read_text())["address"], workers


@pytest.mark.slow
def test_a_study_on_a_cluster_outlives_the_death_of_a_worker(tmp_path: Path) -> None:
    from distributed import Client  # slow

    sources = variants.write_variants(tmp_path)
    expected = json.loads(
        run(*variants.STUDY, "-f", "json", *sources, sources[0]).stdout
    )
    slow, ledger = tmp_path / "slow.csv", tmp_path / "ledger.ndjson"
    os.mkfifo(slow)  # the reader of the pipe waits
    with (
        cluster(tmp_path, ("one", "two")) as (address, workers),
        Client(address, set_as_default=False) as client,
    ):
        client.wait_for_workers(2, timeout=PATIENCE)
        args = (
            "study",
            "--td",
            str(variants.TD),
            "--scheduler",
            address,
            "-f",
            "json",
            "--resume",
            str(ledger),
        )
        names = [os.path.relpath(name, ROOT) for name in (*sources, str(slow))]
        with process(
            "-m",
            "d2rpick",
            *args,
            *names,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
        ) as study:
            until(
                lambda: (
                    ledger.exists() and ledger.read_bytes().count(b"\n") == len(sources)
                )
            )
            (busy,) = until(
                lambda: [
                    address for address, calls in client.processing().items() if calls
                ]
            )
            victim = client.scheduler_info(n_workers=-1)["workers"][busy]["id"]
            slow.unlink()
            slow.write_bytes(Path(sources[0]).read_bytes())
            workers[victim].kill()
            text, error_output = study.communicate(timeout=PATIENCE)
    assert study.returncode == 0, error_output
    document = json.loads(text)
    assert [row["source"] for row in document["runs"]] == names
    for row in (*document["runs"], *expected["runs"]):
        del row["source"]
    same = ("runs", "tr", "agree", "common_tr", "common_window")
    assert {key: document[key] for key in same} == {key: expected[key] for key in same}


@pytest.mark.slow
def test_what_a_worker_found_before_it_died_is_not_lost(tmp_path: Path) -> None:
    from distributed import Client  # slow

    results = []
    with (
        cluster(tmp_path, ("one", "two")) as (address, workers),
        Cluster(address) as farm,
        Client(address, set_as_default=False) as client,
    ):
        for answer in farm.answers(abs, range(500)):
            results.append(answer)
            if len(results) == 100:
                until(
                    lambda: not any(client.processing().values())
                )  # so that everything that was begun is finished
            if len(results) == 101:
                workers["one"].kill()
                until(lambda: len(client.scheduler_info(n_workers=-1)["workers"]) == 1)
    assert sorted(results) == [(number, number, None) for number in range(500)]


@pytest.mark.slow
def test_what_cannot_be_read_on_a_cluster_is_a_row_and_no_scheduler_an_error(
    tmp_path: Path,
) -> None:
    with cluster(tmp_path, ("one",)) as (address, _):
        args = ("study", "--td", str(variants.TD), "--scheduler", address)
        result = run(
            *args,
            "-f",
            "ndjson",
            variants.write(tmp_path / "run.csv"),
            str(tmp_path / "absent.csv"),
        )
    statuses = [json.loads(line).get("status") for line in result.stdout.splitlines()]
    assert (result.exit_code, statuses) == (1, ["ok", "unreadable", None])


def test_where_no_scheduler_answers_the_study_ends(tmp_path: Path) -> None:
    message = "no answer from a Dask scheduler ("
    with pytest.raises(D2RPickError, match=f"^tcp://127.0.0.1:9: {re.escape(message)}"):
        Cluster("tcp://127.0.0.1:9", patience=0.3)
    arguments = (
        "study",
        "--td",
        str(variants.TD),
        variants.write(tmp_path / "run.csv"),
        "--scheduler",
        "nonsense://x",
    )
    assert read_refusal(*arguments).startswith(f"nonsense://x: {message}")


def test_without_the_package_its_name_is_told(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    assert "pip install distributed" in read_refusal(
        "study",
        "--td",
        "0.064",
        variants.write(tmp_path / "run.csv"),
        "--scheduler",
        "tcp://127.0.0.1:9",
    )
