"""Chunks through any `concurrent.futures.Executor`, with a bounded number of them under way."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Executor, Future, wait
from typing import TypeVar

from jacokin.errors import InvalidInputError, JacokinError, shown

Job = TypeVar("Job")
Made = TypeVar("Made")

AHEAD = 2  # chunks under way for each worker: none waits for its next one
FEWEST_AHEAD = 4
KEPT = "the chunks that are finished are kept: do the same again to continue"


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


def made(
    make: Callable[[Job], Made], jobs: Iterable[tuple[int, Job]], executor: Executor
) -> Iterator[tuple[int, Made]]:
    """The number and the result of every job, in the order in which they finish.

    `jobs` is read as far as workers need it: memory does not grow with the number of jobs.

    Raises:
        JacokinError: a job failed, or the executor did.
    """
    ahead = max(FEWEST_AHEAD, AHEAD * workers_of(executor))
    under_way: dict[Future[Made], int] = {}
    jobs = iter(jobs)
    try:
        while True:
            while len(under_way) < ahead and (job := next(jobs, None)) is not None:
                try:
                    under_way[executor.submit(make, job[1])] = job[0]
                except (BrokenExecutor, RuntimeError) as error:
                    raise JacokinError(f"the executor takes no more work: {error}; {KEPT}") from error
            if not under_way:
                return
            done, _ = wait(under_way, return_when=FIRST_COMPLETED)
            for future in sorted(done, key=under_way.__getitem__):
                index = under_way.pop(future)
                yield index, _result(future, index)
    finally:
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


def workers_of(executor: Executor) -> int:
    """How many workers an executor has; the interface does not tell, so this looks into those that are known."""
    known = getattr(executor, "_max_workers", None)
    if isinstance(known, int):
        return known
    client = getattr(executor, "_client", None)  # of dask.distributed
    return 2 * usable_cores() if client is None else max(1, sum(client.nthreads().values()))
