"""How often the experts solve their tasks; writes docs/tasks_experts.json.

nice -n 15 python -m benchmarks.experts [NAME ...] [--episodes 100] [--workers 2]
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
from jacokin.tasks.experts.expert import SCRIPTS

RECORD = Path(__file__).resolve().parent.parent / "docs" / "tasks_experts.json"
EPISODES = 100


def episodes(name: str, seeds: Iterable[int]) -> list[tuple[int, float, bool]]:
    """Seed, return, and whether the task is solved at the end, of one episode for each seed."""
    environment, expert = jacokin.tasks.TaskEnv(name, flatten=False), jacokin.tasks.expert(name)
    found = []
    for seed in seeds:
        observation, info = environment.reset(seed=seed)
        expert.reset()
        total, is_over = 0.0, False
        while not is_over:
            observation, reward, _, is_over, info = environment.step(expert(observation))
            total += reward
        found.append((seed, total, bool(info["is_success"])))
    return found


def row(name: str, found: list[tuple[int, float, bool]]) -> dict[str, Any]:
    """What is recorded of a task."""
    returns = [total for _, total, _ in found]
    return {
        "name": name,
        "episodes": len(found),
        "successes": sum(success for *_, success in found),
        "mean_return": round(statistics.fmean(returns), 2),
        "median_return": round(statistics.median(returns), 2),
        "seeds": [found[0][0], found[-1][0]],
        "failed_seeds": [seed for seed, _, success in found if not success],
        "mujoco": mujoco.__version__,
    }


def main() -> None:
    parser = argparse.ArgumentParser(description="How often the experts solve their tasks.")
    parser.add_argument("names", nargs="*", metavar="NAME", help="tasks; all that have an expert if none is given")
    parser.add_argument("--episodes", type=int, default=EPISODES, help="seeds 0, 1, ... (%(default)s)")
    parser.add_argument("--workers", type=int, default=2, help="processes (%(default)s)")
    options = parser.parse_args()
    unknown = [name for name in options.names if name not in SCRIPTS]
    if unknown:
        parser.error(f"no expert for {', '.join(unknown)}; there are {', '.join(SCRIPTS)}")
    with ProcessPoolExecutor(options.workers, get_context("spawn")) as pool:
        for name in options.names or SCRIPTS:
            parts = [range(start, options.episodes, options.workers) for start in range(options.workers)]
            answers = pool.map(episodes, [name] * len(parts), parts)
            found = row(name, sorted(episode for answer in answers for episode in answer))
            print(found, flush=True)
            if options.episodes == EPISODES:
                write(found)


def write(found: dict[str, Any]) -> None:
    """Put the row of a task into the record."""
    known = {each["name"]: each for each in json.loads(RECORD.read_text())} if RECORD.exists() else {}
    known[found["name"]] = found
    RECORD.write_text(json.dumps([known[name] for name in SCRIPTS if name in known], indent=1) + "\n")


if __name__ == "__main__":
    main()
