"""What a chunk costs dask's scheduler with up to a thousand workers: python -m benchmarks.scheduler [--workers 10 100].

The scheduler runs in a process of its own, whose processor time is read. The workers are simulated in this one, with a
socket each; they do nothing, so that jobs come as fast as the scheduler hands them out. A job holds up to 16 chunks of
8,192 poses.
"""

from __future__ import annotations

import argparse
import asyncio
import logging
import os
import subprocess
import sys
import time
from pathlib import Path

from benchmarks import report
from jacokin.ik.batches.solve_file import TOGETHER

COUNTS = (10, 100, 1000)
JOBS = 5000
RECIPE = b"x" * 2000  # as large as the recipe of a job
IDLE = 10.0  # [s] of nothing but heartbeats
AT_ONCE = 50  # workers that start together
WORKER = 0.081  # [s] of a worker for a chunk, as docs/performance.md has it
QUIET = {  # of the simulated workers: what looks at the machine they share would be done a thousand times
    "distributed.worker.profile.enabled": False,
    "distributed.admin.system-monitor.interval": "600s",
    "distributed.admin.tick.interval": "600s",
    "distributed.admin.tick.cycle": "600s",
    "distributed.worker.memory.target": False,
    "distributed.worker.memory.spill": False,
    "distributed.worker.memory.pause": False,
    "distributed.worker.memory.terminate": False,
    "distributed.comm.timeouts.connect": "120s",
}
SCHEDULER = """
import asyncio, logging
from distributed import Scheduler
logging.disable(logging.CRITICAL)
async def main():
    async with Scheduler(host="127.0.0.1", port=0, dashboard=False) as scheduler:
        print(scheduler.address, flush=True)
        await scheduler.finished()
asyncio.run(main())
"""


def answer(number: int, recipe: bytes) -> int:
    """What a job gives back: which one it was."""
    return number


async def measured(count: int, jobs: int) -> tuple[float, float, float]:
    """Processor time of the scheduler for a job, with its heartbeats [s]; for heartbeats alone [1]; memory [MB]."""
    from distributed import Client, Worker

    process = subprocess.Popen([sys.executable, "-P", "-c", SCHEDULER], stdout=subprocess.PIPE, text=True)
    workers: list[Worker] = []
    try:
        assert process.stdout is not None
        address = process.stdout.readline().strip()
        while len(workers) < count:
            some = (Worker(address, nthreads=1, dashboard=False) for _ in range(min(AT_ONCE, count - len(workers))))
            workers += await asyncio.gather(*some)
        async with Client(address, asynchronous=True) as client:
            before, begin = used(process.pid), time.monotonic()
            await asyncio.sleep(IDLE)
            idle = (used(process.pid) - before) / (time.monotonic() - begin)
            before = used(process.pid)
            futures = client.map(answer, range(jobs), [RECIPE] * jobs, pure=False)
            assert await client.gather(futures) == list(range(jobs))
            busy = used(process.pid) - before
        pages = int(Path(f"/proc/{process.pid}/statm").read_text(encoding="ascii").split()[1])
        return busy / jobs, idle, pages * 4096 / 1e6
    finally:
        process.kill()  # first: workers that say goodbye to it one by one take minutes
        process.wait()
        if len(workers) <= 2 * AT_ONCE:  # more take minutes, and end with this process
            await asyncio.gather(*(worker.close(timeout=1, nanny=False) for worker in workers), return_exceptions=True)


def used(pid: int) -> float:
    """Processor time of a process so far [s]."""
    fields = Path(f"/proc/{pid}/stat").read_text(encoding="ascii").rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def main(counts: tuple[int, ...] = COUNTS, jobs: int = JOBS) -> None:
    """Print a table."""
    import dask

    logging.disable(logging.CRITICAL)
    rows = []
    with dask.config.set(QUIET):
        for count in counts:
            job, idle, memory = asyncio.run(measured(count, jobs))
            chunk = job / TOGETHER
            fed = WORKER / chunk
            rows.append(
                (
                    f"{count:,}",
                    report.seconds(job),
                    report.seconds(chunk),
                    report.percent(idle),
                    f"{memory:.0f}",
                    f"{fed:.0f}",
                )
            )
    head = ("workers", "a job", "a chunk", "heartbeats, of a core", "memory [MB]", "workers that it keeps busy")
    print(report.table(head, rows))


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--workers", type=int, nargs="+", default=list(COUNTS))
    parser.add_argument("--jobs", type=int, default=JOBS)
    options = parser.parse_args()
    main(tuple(options.workers), options.jobs)
