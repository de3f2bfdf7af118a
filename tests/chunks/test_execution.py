"""Jobs on executors: how many are under way, which errors come back, and processes that end with their parent."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from pathlib import Path
from types import SimpleNamespace

import pytest

from jacokin.chunks import execution
from jacokin.chunks.execution import (
    AHEAD,
    FEWEST_AHEAD,
    Progress,
    checked_executor,
    count_workers,
    reporter,
    run_jobs,
    usable_cores,
    worker_processes,
)
from jacokin.errors import InvalidInputError, JacokinError


def double(number: int) -> int:
    return 2 * number


@pytest.mark.parametrize("workers", [1, 3])
def test_every_job_is_made_once(workers: int) -> None:
    with ThreadPoolExecutor(workers) as executor:
        found = list(run_jobs(double, ((number, number) for number in range(100)), executor))
    assert sorted(found) == [(number, 2 * number) for number in range(100)]


@pytest.mark.parametrize("workers", [1, 4])
def test_jobs_are_read_as_workers_need_them(workers: int) -> None:
    read = 0

    def jobs() -> Iterator[tuple[int, int]]:
        nonlocal read
        for read in range(1, 101):
            yield read, read

    most = max(FEWEST_AHEAD, AHEAD * workers)
    with ThreadPoolExecutor(workers) as executor:
        for done, _ in enumerate(run_jobs(double, jobs(), executor), 1):
            assert read <= done + 2 * most  # those under way, and as many that are done and not yet handed out
    assert read == 100


def test_no_jobs_are_no_work() -> None:
    with ThreadPoolExecutor(1) as executor:
        assert list(run_jobs(double, [], executor)) == []


@pytest.mark.parametrize(
    ("error", "message"),
    [
        (ZeroDivisionError("by zero"), "chunk 2 failed: ZeroDivisionError: by zero; finished chunks are"),
        (JacokinError("the disk is full"), "^the disk is full$"),
    ],
)
def test_a_job_that_fails_ends_the_run_by_one_clear_error(error: Exception, message: str) -> None:
    def fail(number: int) -> int:
        if number == 2:
            raise error
        return number

    made: list[int] = []
    with ThreadPoolExecutor(1) as executor:
        found = run_jobs(fail, ((number, number) for number in range(1000)), executor)
        with pytest.raises(JacokinError, match=message):
            made.extend(number for number, _ in found)
    assert made == [0, 1]


def test_jobs_that_have_not_begun_are_cancelled_when_the_caller_stops() -> None:
    begun: list[int] = []
    with ThreadPoolExecutor(1) as executor:
        for _ in run_jobs(begun.append, ((number, number) for number in range(1000)), executor):
            break
    assert len(begun) <= 1 + FEWEST_AHEAD


def test_an_executor_that_was_shut_down_takes_no_more_work() -> None:
    executor = ThreadPoolExecutor(1)
    executor.shutdown()
    with pytest.raises(JacokinError, match="takes no more work: .*; finished chunks are kept"):
        list(run_jobs(double, [(0, 0)], executor))


def end(_: int) -> None:
    os._exit(3)


@pytest.mark.slow
def test_a_worker_that_is_killed_is_named() -> None:
    with worker_processes(1) as executor, pytest.raises(JacokinError, match="a worker process ended at chunk 7"):
        list(run_jobs(end, [(7, 0)], executor))


def note(path: Path) -> None:
    path.write_text(str(signal.getsignal(signal.SIGINT) is signal.SIG_IGN))


@pytest.mark.slow
def test_processes_are_prepared_and_leave_ctrl_c_to_their_parent(tmp_path: Path) -> None:
    with worker_processes(1, note, tmp_path / "note") as executor:
        assert list(run_jobs(double, [(0, 21)], executor)) == [(0, 42)]
    assert (tmp_path / "note").read_text() == "True"


PARENT = """
import os, sys, time
from jacokin.chunks.execution import worker_processes
if __name__ == "__main__":
    executor = worker_processes(1)
    print(executor.submit(os.getpid).result(), flush=True)
    executor.submit(time.sleep, 600)
    time.sleep(600)
"""


@pytest.mark.slow
def test_workers_end_with_a_parent_that_is_killed(tmp_path: Path) -> None:
    (tmp_path / "parent.py").write_text(PARENT)
    with subprocess.Popen([sys.executable, tmp_path / "parent.py"], stdout=subprocess.PIPE, text=True) as parent:
        assert parent.stdout is not None
        worker = Path("/proc", parent.stdout.readline().strip())
        assert (worker / "exe").exists()
        parent.kill()
    deadline = time.monotonic() + 60.0  # [s]
    while (worker / "exe").exists():
        assert time.monotonic() < deadline
        time.sleep(0.02)


class Unknown(Executor):
    """Does not tell how many workers it has."""

    def submit(self, *_: object, **__: object) -> Future[object]:  # type: ignore[override]  # never called
        raise NotImplementedError


class Cluster(Unknown):
    """As the executor of a dask client looks."""

    _client = SimpleNamespace(nthreads=lambda: {"one": 4, "other": 2})


def test_workers_are_counted() -> None:
    assert count_workers(ThreadPoolExecutor(3)) == 3
    assert count_workers(Unknown()) == 2 * usable_cores()
    assert count_workers(Cluster()) == 6
    assert usable_cores() >= 1


def test_other_things_than_executors_are_refused() -> None:
    assert checked_executor(None) is None
    executor = ThreadPoolExecutor(1)
    assert checked_executor(executor) is executor
    with pytest.raises(InvalidInputError, match=r"must be a concurrent\.futures\.Executor, got 3$"):
        checked_executor(3)  # type: ignore[arg-type]  # on purpose
    client = type("Client", (), {"get_executor": None})()
    with pytest.raises(InvalidInputError, match=r"of a dask client, give client\.get_executor\(\)"):
        checked_executor(client)


@pytest.mark.parametrize("address", ["", 8786, None])
def test_malformed_addresses_are_refused(address: str) -> None:
    pytest.importorskip("distributed")
    with (
        pytest.raises(InvalidInputError, match="the address of a scheduler must be like"),
        execution.dask_executor(address),
    ):
        pass


def test_progress_counts_from_what_was_there(monkeypatch: pytest.MonkeyPatch) -> None:
    clock = iter([10.0, 12.0, 20.0])
    monkeypatch.setattr(time, "perf_counter", lambda: next(clock))
    seen: list[Progress] = []
    advance = reporter(seen.append, total=100, done=40)
    advance(20)
    advance(0)
    assert seen[0] == Progress(done=60, total=100, rate=10.0, seconds_left=4.0)
    assert seen[1] == Progress(done=60, total=100, rate=2.0, seconds_left=20.0)
    monkeypatch.undo()
    reporter(None, 1, 0)(1)


def test_before_the_first_chunk_the_time_left_is_not_known() -> None:
    seen: list[Progress] = []
    reporter(seen.append, total=10, done=3)(0)
    assert seen == [Progress(3, 10, 0.0, float("inf"))]
