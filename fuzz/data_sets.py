"""Recordings that are killed at any time and damaged on disk: what is read back is what was simulated, or refused."""

from __future__ import annotations

import contextlib
import os
import shutil
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

import jacokin.tasks
from fuzz.findings import Finding
from jacokin.errors import JacokinError
from jacokin.tasks import Task, TaskEnv
from jacokin.tasks.datasets.recorded import Recorded
from jacokin.tasks.datasets.recording import FORMATS, run_episode

EPISODES, STEPS, SEED = 6, 8, 4
TASKS = ("reach_site", "lift_brick")
RECORD = """
import sys
from fuzz.data_sets import record
record(sys.argv[1], sys.argv[2])
"""


class Waves:
    """Actions that follow from what is seen."""

    def __call__(self, observation: Any) -> Any:
        """(9,)."""
        seen = np.concatenate([np.ravel(each) for each in observation.values()])
        return np.sin(np.arange(9.0) + seen[:9].sum())


def make(task: str) -> TaskEnv:
    """Short episodes of a task."""
    Task.time_limit = STEPS * 0.04  # [s]
    return TaskEnv(task, flatten=False)


def record(task: str, path: str) -> None:
    """All episodes to a path."""
    jacokin.tasks.record(make(task), Waves(), path, episodes=EPISODES, seed=SEED)


@cache
def expected(task: str) -> list[Recorded]:
    """The episodes, not recorded."""
    env, policy = make(task), Waves()
    return [run_episode(env, policy, SEED + number) for number in range(EPISODES)]


def run(seed: int, first: int, cases: int) -> Iterator[tuple[int, int, list[Finding]]]:
    """Case after case, one recording each."""
    for case in range(first, first + cases):
        rng = np.random.default_rng([seed, case])
        with tempfile.TemporaryDirectory() as folder:
            yield case, 1, list(check(Path(folder), rng))


def check(folder: Path, rng: np.random.Generator) -> Iterator[Finding]:
    """Kill a recording, damage what it left or not, go on, read it, damage that."""
    task, ending = TASKS[int(rng.integers(len(TASKS)))], list(FORMATS)[int(rng.integers(len(FORMATS)))]
    path = folder / f"demos{ending}"
    given = f"{task}, {ending}"
    with subprocess.Popen(
        [sys.executable, "-c", RECORD, task, str(path)], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    ) as process:
        try:
            process.wait(timeout=float(rng.uniform(0.5, 8.0)))  # [s] after which it is killed
        except subprocess.TimeoutExpired:
            os.kill(process.pid, signal.SIGKILL)
    if path.exists() and process.returncode == 0:
        yield from check_same(task, path, f"{given}, not killed")
    elif path.exists():
        # Between the last file's name and the end of the folder of episodes there is a moment.
        shutil.rmtree(path.with_name(f"{path.name}.episodes"), ignore_errors=True)
        yield from check_same(task, path, f"{given}, killed at its end")
    else:
        kept = sorted(folder.glob("*.episodes/*.npz"))
        harmed = kept[int(rng.integers(len(kept)))] if kept and rng.random() < 0.5 else None
        if harmed is not None:
            damage(harmed, rng)
        try:
            record(task, str(path))
        except JacokinError as error:
            if harmed is None:
                yield Finding("raw", "record, after a kill", f"{error}; {given}")
                return
            for each in (harmed, path):
                each.unlink(missing_ok=True)
            try:
                record(task, str(path))
            except JacokinError as again:
                yield Finding("raw", "record, a damaged episode removed", f"{again}; {given}")
                return
        yield from check_same(task, path, f"{given}, killed{'' if harmed is None else ', damaged'}")
    files = sorted(each for each in (path, *path.rglob("*")) if each.is_file())
    damage(files[int(rng.integers(len(files)))], rng)
    with contextlib.suppress(JacokinError):
        jacokin.tasks.replay(path)


def damage(path: Path, rng: np.random.Generator) -> None:
    """Cut a file, or change some bytes of it."""
    data = bytearray(path.read_bytes())
    if rng.random() < 0.5:
        data = data[: int(rng.integers(len(data)))]
    else:
        for place in rng.integers(len(data), size=int(rng.integers(1, 20))).tolist():
            data[place] = int(rng.integers(256))
    path.write_bytes(bytes(data))


def check_same(task: str, path: Path, given: str) -> Iterator[Finding]:
    """What is on disk is what was simulated."""
    module = __import__(f"jacokin.tasks.datasets.{FORMATS[path.suffix]}", fromlist=["read"])
    found = list(module.read(path)[1])
    if len(found) != EPISODES:
        yield Finding("wrong", "data set", f"{len(found)} episodes; {given}")
    for one, other in zip(found, expected(task), strict=False):
        for name in ("seed", "actions", "rewards", "success", "states"):
            if not np.array_equal(getattr(one, name), getattr(other, name)):
                yield Finding("wrong", "data set", f"{name} of episode {one.seed}; {given}")
    left = [each.name for each in path.parent.iterdir() if each != path]
    if left:
        yield Finding("wrong", "data set", f"{left} left over; {given}")
    if not all(each.is_equal for each in jacokin.tasks.replay(path)):
        yield Finding("wrong", "data set", f"replay differs; {given}")
