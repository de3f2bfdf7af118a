"""Run jobs on any `concurrent.futures.Executor`, with a bounded number of them under way; executors, and progress."""

from __future__ import annotations

import contextlib
import functools
import logging
import os
import signal
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Executor, Future, ThreadPoolExecutor, wait
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol, TypeVar

from jacokin.errors import InvalidInputError, JacokinError, needed, shown

if TYPE_CHECKING:
    from concurrent.futures import ProcessPoolExecutor

Job = TypeVar("Job")
Made = TypeVar("Made")

AHEAD = 2  # chunks under way for each worker: none waits for its next one
FEWEST_AHEAD = 4
ANSWER_WITHIN = 10.0  # [s] that a scheduler has to answer
KEPT = "finished chunks are kept: run it again to continue"

_worker = threading.local()


class StopEvent(Protocol):
    """An event of threads or of processes."""

    def set(self) -> None:
        """Stop the work."""

    def is_set(self) -> bool:
        """Whether it is to stop."""


def heed(stop: StopEvent | None) -> None:
    """Let an event stop the jobs of this worker, a thread or a process; None for no event."""
    _worker.stop = stop


def is_stopped() -> bool:
    """Whether nobody waits for what this worker does: asked by jobs, now and then."""
    stop: StopEvent | None = getattr(_worker, "stop", None)
    return stop is not None and stop.is_set()


def _heeding(make: Callable[[Job], Made], stop: StopEvent, job: Job) -> Made:
    """A job that an event stops."""
    heed(stop)
    try:
        return make(job)
    finally:
        heed(None)


def run_jobs(
    make: Callable[[Job], Made], jobs: Iterable[tuple[int, Job]], executor: Executor
) -> Iterator[tuple[int, Made]]:
    """The number and the result of every job, in the order in which they finish.

    `jobs` is read as far as workers need it: memory does not grow with the number of jobs. Whoever stops waiting, as
    after Ctrl-C, stops jobs under way on threads, whosever they are, where these ask `is_stopped`.

    Raises:
        JacokinError: a job failed, or the executor did.
    """
    ahead = max(FEWEST_AHEAD, AHEAD * count_workers(executor))
    under_way: dict[Future[Made], int] = {}
    jobs, stop = iter(jobs), threading.Event()
    run = functools.partial(_heeding, make, stop) if isinstance(executor, ThreadPoolExecutor) else make
    try:
        while True:
            while len(under_way) < ahead and (job := next(jobs, None)) is not None:
                try:
                    under_way[executor.submit(run, job[1])] = job[0]
                except (BrokenExecutor, RuntimeError) as error:
                    raise JacokinError(f"the executor takes no more work: {error}; {KEPT}") from error
            if not under_way:
                return
            done, _ = wait(under_way, return_when=FIRST_COMPLETED)
            for future in sorted(done, key=under_way.__getitem__):
                index = under_way.pop(future)
                yield index, _result(future, index)
    finally:
        stop.set()
        for future in under_way:
            future.cancel()


def _result(future: Future[Made], index: int) -> Made:
    try:
        return future.result()
    except JacokinError:
        raise
    except BrokenExecutor as error:
        raise JacokinError(
            f"a worker process ended at chunk {index}, and the executor with it; {KEPT}. A script that uses processes "
            f"must do so under `if __name__ == '__main__':`, because each of them imports it"
        ) from error
    except Exception as error:
        raise JacokinError(f"chunk {index} failed: {type(error).__name__}: {error}; {KEPT}") from error


def checked_executor(executor: Executor | None) -> Executor | None:
    """An executor, or None.

    Raises:
        InvalidInputError: anything else.
    """
    if executor is not None and not isinstance(executor, Executor):
        hint = "; of a dask client, give client.get_executor()" if hasattr(executor, "get_executor") else ""
        raise InvalidInputError(f"executor must be a concurrent.futures.Executor, got {shown(executor)}{hint}")
    return executor


def usable_cores() -> int:
    """Cores that this process may run on."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def count_workers(executor: Executor) -> int:
    """How many workers an executor has; the interface does not tell, so this looks into those that are known."""
    known = getattr(executor, "_max_workers", None)
    if isinstance(known, int):
        return known
    client = getattr(executor, "_client", None)  # of dask.distributed
    return 2 * usable_cores() if client is None else max(1, sum(client.nthreads().values()))


def worker_processes(
    count: int, prepare: Callable[..., object] | None = None, *arguments: object
) -> ProcessPoolExecutor:
    """Processes of their own, started anew: threads of numba and BLAS do not survive a fork.

    Scripts that use them must do so under ``if __name__ == "__main__":``, because each process imports the script.

    Args:
        count: how many.
        prepare: called in each of them before it works; None for nothing.
        arguments: what it is called with.
    """
    import multiprocessing  # not for who solves in this process: some hundredths of a second
    from concurrent.futures import ProcessPoolExecutor

    context = multiprocessing.get_context("spawn")
    return ProcessPoolExecutor(count, mp_context=context, initializer=functools.partial(_begin, prepare, *arguments))


def _begin(prepare: Callable[..., object] | None, *arguments: object) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the parent, which then stops them
    threading.Thread(target=_end_with_parent, daemon=True).start()
    if prepare is not None:
        prepare(*arguments)


def _end_with_parent() -> None:
    """End this process when its parent has ended: a killed one cannot tell, and this would wait for work for ever."""
    from multiprocessing import parent_process

    parent = parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


@contextlib.contextmanager
def dask_executor(address: str) -> Iterator[Executor]:
    """An executor whose work is done by the workers of a scheduler, such as tcp://10.0.0.1:8786.

    Raises:
        MissingExtraError: distributed is not installed.
        InvalidInputError: no scheduler answers at the address.
        JacokinError: the cluster has no workers.
    """
    with needed("distributed", "cluster"):
        from distributed import Client
    if not isinstance(address, str) or not address:
        raise InvalidInputError(f"the address of a scheduler must be like tcp://10.0.0.1:8786, got {address!r}")
    logger = logging.getLogger("distributed")
    level = logger.level
    logger.setLevel(logging.CRITICAL)  # it would log what the error below says, with tracebacks
    try:
        client = Client(address, timeout=ANSWER_WITHIN, set_as_default=False)
    except (OSError, ValueError, TypeError) as error:
        raise InvalidInputError(f"no dask scheduler answers at {address}: {error}") from error
    finally:
        logger.setLevel(level)
    with client:
        if not client.nthreads():
            raise JacokinError(f"the dask scheduler at {address} has no workers: start some with `dask worker`")
        yield client.get_executor()


@dataclass(frozen=True, slots=True)
class Progress:
    """How far a long run has come."""

    done: int
    """Rows or cells that are finished."""
    total: int
    """How many there are."""
    rate: float
    """How many are finished in a second of this run."""
    seconds_left: float
    """How long the rest takes at this rate [s]; infinite before the first chunk."""


def reporter(progress: Callable[[Progress], None] | None, total: int, done: int) -> Callable[[int], None]:
    """A function that is told how many more are finished, and reports them; `done` were before this run."""
    began, before = time.perf_counter(), done

    def advance(more: int) -> None:
        nonlocal done
        done += more
        if progress is not None:
            rate = (done - before) / max(time.perf_counter() - began, 1e-9)
            progress(Progress(done, total, rate, (total - done) / rate if rate > 0.0 else float("inf")))

    return advance
