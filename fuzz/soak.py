"""Whether long runs keep their memory: `python -m fuzz.soak [--minutes 10]`; exit code 1 where it grows.

Viewer (with an open page), tracker and a vector of environments take turns. Each has a fresh process, whose memory is
read after every round: over the second half of the rounds its trend must stay below `ALLOWED`.
"""

from __future__ import annotations

import argparse
import contextlib
import ctypes
import gc
import json
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import numpy as np

ROUND = 5.0  # [s] between two looks at the memory
ALLOWED = 2.0  # [MB] that the memory may grow by in the second half, by its trend: allocators keep some pages
MINUTES = 10.0


def viewer() -> Iterator[None]:
    """Moves of the gizmo, branches, obstacles, joints, sent by a page that keeps what it is told; a target a turn."""
    from jacokin.viewer import serve
    from tests.viewer.page import opened, repeat

    def is_at(position: tuple[float, ...]) -> bool:
        return np.allclose(running.view.target.translation, position)

    rng = np.random.default_rng(3)
    with serve(port=0) as running, opened(running) as page:
        while True:
            position = tuple(rng.uniform((-0.5, -0.5, 0.0), (0.5, 0.5, 1.0)).round(3).tolist())
            # Again where a slider was moved just before: its answer brings the gizmo to where it has the tool.
            repeat(partial(page.move_gizmo, position), partial(is_at, position), pause=1.0)
            page.press("Next branch")
            turn = rng.integers(20)
            if turn == 0:
                page.click("Add in front")
            elif turn == 1:
                page.click("Remove")
            elif turn == 2:
                page.change("Ghosts", bool(rng.integers(2)))
            elif turn == 3:
                page.change("joint_2", float(rng.uniform(1.0, 5.0)))
            yield


def tracker() -> Iterator[None]:
    """Ticks after targets in and out of reach; a target a turn."""
    import jacokin

    rng = np.random.default_rng(4)
    robot = jacokin.load_robot()
    following = jacokin.Tracker(robot, dt=0.01)
    while True:
        target = jacokin.pose(rng.uniform(-0.9, 0.9, 3), down=True)
        for _ in range(100):
            following.step(target)
        yield


def vectors() -> Iterator[None]:
    """A vector of environments with random actions, episodes ending among them; a step a turn."""
    import gymnasium

    import jacokin.tasks.gym  # noqa: F401 - registers the environments

    vector = gymnasium.make_vec(
        "jacokin/ReachSite-v0",
        num_envs=4,
        vectorization_mode="vector_entry_point",
        vector_kwargs={"threads": 1},
    )
    vector.action_space.seed(5)
    vector.reset(seed=5)
    while True:
        vector.step(vector.action_space.sample())
        yield


KINDS: dict[str, Callable[[], Iterator[None]]] = {"viewer": viewer, "tracker": tracker, "vectors": vectors}


def main() -> int:
    """Soak every kind, print a line for each; 1 if one grows."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--minutes", type=float, default=MINUTES, help="of all together")
    parser.add_argument("--kind", choices=KINDS, help="in this process: prints the memory of each round, a JSON list")
    options = parser.parse_args()
    if options.kind:
        print(json.dumps(soak(KINDS[options.kind], 60.0 * options.minutes)))
        return 0
    grown = []
    for kind in KINDS:
        share = str(options.minutes / len(KINDS))
        words = [sys.executable, "-m", "fuzz.soak", "--kind", kind, "--minutes", share]
        turns, rows = json.loads(subprocess.run(words, check=True, stdout=subprocess.PIPE, text=True).stdout)
        half = np.array(rows[len(rows) // 2 :])
        growth = float(np.polyfit(np.linspace(0.0, 1.0, len(half)), half, 1)[0]) if len(half) > 1 else float("nan")
        print(f"{kind}: {turns} turns, {rows[0]:.1f} MB at first, {rows[-1]:.1f} MB at last, trend {growth:+.2f} MB")
        if not growth < ALLOWED:
            grown.append(kind)
    print(f"memory grows: {', '.join(grown)}" if grown else "memory is flat")
    return 1 if grown else 0


def soak(make: Callable[[], Iterator[None]], seconds: float) -> tuple[int, list[float]]:
    """How many turns were taken in some time [s], and the memory after each round [MB]."""
    turns, rows, work = 0, [], make()
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        until = min(time.monotonic() + ROUND, end)
        while time.monotonic() < until:
            next(work)
            turns += 1
        gc.collect()
        rows.append(resident())
    work.close()  # type: ignore[attr-defined]  # a generator
    return turns, rows


def resident() -> float:
    """Memory of this process that is in use [MB]; what glibc's allocator keeps for later is given back before."""
    with contextlib.suppress(AttributeError):
        ctypes.CDLL(None).malloc_trim(0)
    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
    return pages * 4096 / 1e6


if __name__ == "__main__":
    sys.exit(main())
