"""A loop against the clock, at 500 Hz: how late it wakes up, how long a tick takes, and what helps.

Teleoperation by twists among twenty obstacles, of which seven move, with acceleration limits. Each way to run it gets
some seconds in turn, several times over, so that what else the machine does hits all alike. Run from the repository:
``python -m benchmarks.deadline``, and ``--load 4`` beside four processes that keep the machine busy; a minute of each
way at 1 kHz takes ``--rate 1000 --seconds 20``.
"""

from __future__ import annotations

import argparse
import contextlib
import gc
import os
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager

import numpy as np

import jacokin
from benchmarks.tracker import crowd
from jacokin.ik import Sphere
from jacokin.motion import Tracker
from jacokin.teleop import Teleop

ACCELERATION = 4.0  # [rad/s^2]
BUSY = "while True: pass"
Times = tuple[list[float], list[float], int]


@contextlib.contextmanager
def without_garbage_collection() -> Iterator[None]:
    """As a loop should run: what there is counts as permanent, nothing is collected."""
    gc.collect()
    gc.freeze()
    gc.disable()
    try:
        yield
    finally:
        gc.enable()
        gc.unfreeze()


@contextlib.contextmanager
def on_one_core() -> Iterator[None]:
    """The last core that this process may use."""
    before = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {max(before)})
    try:
        yield
    finally:
        os.sched_setaffinity(0, before)


@contextlib.contextmanager
def before_all_others() -> Iterator[None]:
    """With real-time priority, as `chrt -f 50` gives it; raises PermissionError where it is not allowed."""
    os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(50))  # of the real-time scheduler
    try:
        yield
    finally:
        os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))


@contextlib.contextmanager
def beside_a_thread() -> Iterator[None]:
    """With another thread of this Python that computes."""
    done = threading.Event()

    def compute() -> None:
        while not done.is_set():
            sum(range(1000))

    thread = threading.Thread(target=compute, daemon=True)
    thread.start()
    try:
        yield
    finally:
        done.set()
        thread.join()


@contextlib.contextmanager
def beside_a_polite_thread() -> Iterator[None]:
    """The same, where threads hand over after 0.1 ms instead of 5 ms, and with real-time priority."""
    before = sys.getswitchinterval()
    sys.setswitchinterval(1e-4)
    try:
        with beside_a_thread(), before_all_others():
            yield
    finally:
        sys.setswitchinterval(before)


@contextlib.contextmanager
def beside_a_thread_first() -> Iterator[None]:
    """With another thread of this Python that computes, and real-time priority."""
    with beside_a_thread(), before_all_others():
        yield


@contextlib.contextmanager
def core_and_priority() -> Iterator[None]:
    """A core, real-time priority and no garbage collection."""
    with without_garbage_collection(), on_one_core(), before_all_others():
        yield


WAYS: dict[str, tuple[Callable[[], AbstractContextManager[None]], float | None]] = {
    "as it comes": (contextlib.nullcontext, None),
    "no garbage collection": (without_garbage_collection, None),
    "one core": (on_one_core, None),
    "real-time priority": (before_all_others, None),
    "all three": (core_and_priority, None),
    "a budget of 0.8 ms": (contextlib.nullcontext, 0.8e-3),  # [s]
    "busy thread, priority": (beside_a_thread_first, None),
    "... and 0.1 ms a turn": (beside_a_polite_thread, None),
}


def run(teleop: Teleop, balls: list[Sphere], seconds: float, budget: float | None) -> Times:
    """Tick by the clock: delays of waking up and durations of ticks [s], and how many ended after their time.

    A loop that missed its time goes on from there, as one that drives an arm would.
    """
    wakes, ticks, missed, dt = list[float](), list[float](), 0, teleop.tracker.dt
    due = time.perf_counter()
    end = due + seconds
    while due < end:
        due += dt
        time.sleep(max(0.0, due - time.perf_counter()))
        woke = time.perf_counter()
        phase = np.pi * len(ticks) * dt
        shift, rate = 0.02 * np.sin(phase), 0.02 * np.pi * np.cos(phase)
        obstacles = {
            ball.name: (np.add(ball.position, [shift, 0.0, 0.0]), [rate, 0.0, 0.0, 0.0, 0.0, 0.0]) for ball in balls
        }
        teleop.step([0.0, 0.0, 0.05 * np.cos(phase), 0.0, 0.0, 0.1 * np.cos(phase)], obstacles=obstacles, budget=budget)
        ended = time.perf_counter()
        wakes.append(woke - due)
        ticks.append(ended - woke)
        if ended > due + dt:
            missed, due = missed + 1, ended
    return wakes, ticks, missed


def main() -> None:
    """Print a row for each way."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=4.0, help="of a way in a round")
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--rate", type=float, default=500.0, help="of the loop [Hz]")
    parser.add_argument("--load", type=int, default=0, help="processes that keep the machine busy meanwhile")
    parser.add_argument(
        "--ways", nargs="+", choices=list(WAYS), default=list(WAYS), metavar="WAY", help="of these only"
    )
    arguments = parser.parse_args()
    robot = jacokin.load_robot()
    scene = crowd(robot, np.random.default_rng(0))
    balls = [shape for shape in scene if isinstance(shape, Sphere)]
    teleop = Teleop(Tracker(robot, dt=1.0 / arguments.rate, scene=scene, acceleration_limit=ACCELERATION), clutch=True)
    run(teleop, balls, 0.5, None)
    found: dict[str, list[Times]] = {name: [] for name in arguments.ways}
    busy = [subprocess.Popen([sys.executable, "-c", BUSY]) for _ in range(arguments.load)]
    try:
        for _ in range(arguments.rounds):
            for name in found:
                way, budget = WAYS[name]
                with contextlib.suppress(PermissionError), way():
                    found[name].append(run(teleop, balls, arguments.seconds, budget))
    finally:
        for process in busy:
            process.kill()
            process.wait()
    print(f"{os.cpu_count()} cores, load {os.getloadavg()[0]:.1f}, {arguments.load} busy processes of our own")
    parts = ("99 %", 8), ("99.9 %", 8), ("worst", 8)
    heads = ("late: median", 14), *parts, ("tick: median", 14), *parts, ("missed", 9)
    print(f"{'[ms]':24}" + "".join(f"{head:>{width}}" for head, width in heads))
    for name, rounds in found.items():
        if not rounds:
            print(f"{name:24}{'not permitted here':>14}")
            continue
        columns = [
            np.percentile(np.concatenate([each[part] for each in rounds]), [50, 99, 99.9, 100]) for part in (0, 1)
        ]
        late, tick = (1e3 * column for column in columns)
        total = sum(len(each[0]) for each in rounds)
        print(
            f"{name:24}"
            + "".join(f"{times[0]:14.2f}" + "".join(f"{time:8.2f}" for time in times[1:]) for times in (late, tick))
            + f"{sum(each[2] for each in rounds) / total:9.2%}"
        )


if __name__ == "__main__":
    main()
