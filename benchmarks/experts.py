"""How often the experts solve their tasks; writes docs/tasks_experts.json.

nice -n 15 python -m benchmarks.experts [NAME ...] [--episodes 100] [--workers 2] [--steps 250]

With another number of steps, or of episodes, it prints and writes nothing; then it also says after how many steps the
episodes were solved.
"""

from __future__ import annotations

import argparse
import json
import statistics
from collections.abc import Iterable
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import mujoco

import jacokin.tasks
from jacokin.tasks.episode import STEPS
from jacokin.tasks.experts.expert import SCRIPTS
from jacokin.tasks.task import CONTROL_TIMESTEP, Task

RECORD = Path(__file__).resolve().parent.parent / "docs" / "tasks_experts.json"
EPISODES = 100

Found = tuple[int, float, bool, int]


def episodes(name: str, seeds: Iterable[int], steps: int) -> list[Found]:
    """Seed, return, whether it is solved at the end, and the step from which on, of an episode for each seed."""
    Task.time_limit = steps * CONTROL_TIMESTEP
    environment, expert = jacokin.tasks.TaskEnv(name, flatten=False), jacokin.tasks.expert(name)
    found = []
    for seed in seeds:
        observation, info = environment.reset(seed=seed)
        expert.reset()
        total, is_over, step, since = 0.0, False, 0, 0
        while not is_over:
            observation, reward, _, is_over, info = environment.step(expert(observation))
            total, step = total + reward, step + 1
            since = since if info["is_success"] else step + 1
        found.append((seed, total, bool(info["is_success"]), since))
    return found


def row(name: str, found: list[Found]) -> dict[str, Any]:
    """What is recorded of a task."""
    returns = [total for _, total, *_ in found]
    return {
        "name": name,
        "episodes": len(found),
        "successes": sum(success for _, _, success, _ in found),
        "mean_return": round(statistics.fmean(returns), 2),
        "median_return": round(statistics.median(returns), 2),
        "seeds": [found[0][0], found[-1][0]],
        "failed_seeds": [seed for seed, _, success, _ in found if not success],
        "mujoco": mujoco.__version__,
    }


def main() -> None:
    parser = argparse.ArgumentParser(description="How often the experts solve their tasks.")
    parser.add_argument("names", nargs="*", metavar="NAME", help="tasks; all that have an expert if none is given")
    parser.add_argument("--episodes", type=int, default=EPISODES, help="seeds 0, 1, ... (%(default)s)")
    parser.add_argument("--workers", type=int, default=2, help="processes (%(default)s)")
    parser.add_argument("--steps", type=int, default=STEPS, help="of an episode (%(default)s)")
    options = parser.parse_args()
    unknown = [name for name in options.names if name not in SCRIPTS]
    if unknown:
        parser.error(f"no expert for {', '.join(unknown)}; there are {', '.join(SCRIPTS)}")
    with ProcessPoolExecutor(options.workers, get_context("spawn")) as pool:
        for name in options.names or SCRIPTS:
            parts = [range(start, options.episodes, options.workers) for start in range(options.workers)]
            answers = pool.map(episodes, [name] * len(parts), parts, [options.steps] * len(parts))
            each = sorted(episode for answer in answers for episode in answer)
            found = row(name, each)
            print(found, flush=True)
            if (options.episodes, options.steps) == (EPISODES, STEPS):
                write(found)
                continue
            since = sorted(step for _, _, success, step in each if success)
            if since:
                print(f"solved from steps {since[0]} to {since[-1]}, median {since[len(since) // 2]}", flush=True)


def write(found: dict[str, Any]) -> None:
    """Put the row of a task into the record."""
    known = {each["name"]: each for each in json.loads(RECORD.read_text())} if RECORD.exists() else {}
    known[found["name"]] = found
    RECORD.write_text(json.dumps([known[name] for name in SCRIPTS if name in known], indent=1) + "\n")


if __name__ == "__main__":
    main()
