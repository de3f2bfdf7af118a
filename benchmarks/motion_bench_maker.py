"""Free motions of a UR5 in MotionBenchMaker's scenes: jacokin beside VAMP, OMPL, sscbirrt and roboplan.

All look for the same contact: 40 spheres for the arm and its gripper, boxes and capsules around them, as VAMP has them.
Start and goal are configurations. A referee that shares no code with them (`bench_maker`) looks at each path, every
0.002 rad of a joint. All paths but jacokin's, which come timed, are timed by the same code under the same limits, with
as much of their corners cut as is certain to be clear.

The data are read from a clone of VAMP's repository, whose folder is given; peers that are installed take part:
``pip install ompl sscbirrt roboplan``, VAMP from its clone. Run from the repository:
``python -m benchmarks.motion_bench_maker VAMP/resources/ur5 [--problems 30] [--rounds 3] [--planner NAME ..]``. Times
are those of the processor, the median of the rounds; the first one builds the world, too. Planners take turns.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterable, Sequence
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np

import jacokin
from benchmarks.bench_maker import BenchProblem, Referee, files_in, load_problems
from benchmarks.bench_maker_peers import PLANNERS, Jacokin, Planner
from jacokin import Robot
from jacokin.arrays import Array
from jacokin.motion.free_motion.plan_motion import search_of
from jacokin.motion.free_motion.search import Randomness
from jacokin.motion.free_motion.timed_course import fit_time
from jacokin.motion.joint_motion import ACCELERATION
from jacokin.motion.rows import Limits

STEP = 0.002  # [rad] of the referee
DEEP = 1e-5  # [m] what is less deep may be rounding: VAMP computes in single precision
DT = 0.01  # [s] of rows whose length is measured


class Answer(NamedTuple):
    """What a planner found."""

    first: float
    """With the world built [ms]."""
    again: float
    """In the same world, median [ms]."""
    duration: float
    """Of the motion [s]."""
    length: float
    """Of the motion, corners cut, in the space of joints [rad]."""
    depth: float
    """How deep something is in something else on the path, negative for nothing [m]."""


def ask(planner: Planner, problem: BenchProblem, rounds: int, limit: float) -> tuple[float, float, Array | None]:
    """Times with and without the world [ms], and the path."""
    begin = time.process_time()
    planner.build(problem)
    path = planner.plan(problem, limit)
    first, again = time.process_time() - begin, []
    for _ in range(rounds):
        begin = time.process_time()
        path = planner.plan(problem, limit)
        again.append(time.process_time() - begin)
    return 1e3 * first, 1e3 * float(np.median(again)), path


class Timer:
    """Times paths of others as `plan_motion` times its own."""

    def __init__(self, robot: Robot) -> None:
        """Take the limits of a robot."""
        self._robot, self._world = robot, Jacokin(robot, 1)

    def measure(self, problem: BenchProblem, path: Array) -> tuple[float, float]:
        """Duration [s] and length [rad] of the motion along a path (n, 6)."""
        robot = self._robot
        self._world.build(problem)
        search = search_of(self._world.solver)
        full, hard = robot.velocity_limit, np.full(robot.dof, ACCELERATION)
        search.begin(problem.start, problem.goal[None], full, Limits(full, hard), Randomness())
        path, cuts = search.cut_corners(path)
        certain = [search.contact.in_the_way(a, b) is None for a, b in pairwise(path)]
        for corner in range(1, len(path) - 1):
            if not (certain[corner - 1] and certain[corner]):
                cuts[corner] = 0.0
        timed = fit_time(path, cuts, full, full, hard)
        rows = timed.at(np.linspace(0.0, timed.duration, max(2, int(timed.duration / DT))))[0]
        return timed.duration, length_of(rows)


def length_of(rows: Array) -> float:
    """Of a path through configurations (n, dof) [rad]."""
    return float(np.linalg.norm(np.diff(rows, axis=0), axis=1).sum())


def make(names: Iterable[str], robot: Robot, urdf: Path, srdf: Path) -> dict[str, Planner]:
    """Those of the planners that are installed; says what the others need."""
    made = {}
    for name in names:
        call, needs = PLANNERS[name]
        try:
            made[name] = call(robot, urdf, srdf)
        except ImportError as error:
            print(f"{name} is left out ({error}): install {needs}")
    return made


def percentiles(values: Sequence[float]) -> str:
    """Median and 95 % of times [ms]."""
    return " / ".join(f"{value:.2f}" if value < 10.0 else f"{value:.0f}" for value in np.percentile(values, [50, 95]))


def row(name: str, answers: Sequence[Answer | None], ours: Sequence[Answer | None]) -> str:
    """One planner of the table, beside jacokin."""
    found = [answer for answer in answers if answer is not None]
    if not found:
        return f"| {name} | 0 of {len(answers)} |" + " |" * 6
    both = [(a, b) for a, b in zip(answers, ours, strict=True) if a is not None and b is not None]
    length, duration = (float(np.median([a[k] / b[k] for a, b in both])) for k in (3, 2))
    deep = [1e3 * answer.depth for answer in found if answer.depth > DEEP]
    touching = f"{len(deep)}, up to {max(deep):.2g} mm" if deep else "0"
    return (
        f"| {name} | {len(found)} of {len(answers)} | {percentiles([a.again for a in found])} | "
        f"{percentiles([a.first for a in found])} | {np.median([a.length for a in found]):.2f} ({length:.2f}) | "
        f"{np.median([a.duration for a in found]):.1f} ({duration:.2f}) | {touching} |"
    )


def main() -> None:
    """Print tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, help="resources/ur5 of a clone of VAMP's repository")
    parser.add_argument("--problems", type=int, default=30, help="of each kind, at most 100")
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--time-limit", type=float, default=5.0, help="[s]")
    parser.add_argument("--planner", action="append", choices=PLANNERS, help="all that are installed if none is given")
    parser.add_argument("--each", action="store_true", help="a table for each kind, too")
    given = parser.parse_args()
    archive, urdf, srdf = files_in(given.folder)
    robot = jacokin.load_robot(urdf, srdf=srdf)
    referee, timer = Referee(urdf, srdf), Timer(robot)
    planners = make(list(dict.fromkeys(["jacokin", *(given.planner or PLANNERS)])), robot, urdf, srdf)
    problems = load_problems(archive, given.problems)
    valid = [p for p in problems if referee.depth(np.array([p.start, p.goal]), p.solids) <= 0.0]
    print(f"{len(valid)} of {len(problems)} problems have start and goal clear\n", flush=True)
    answers: dict[str, list[Answer | None]] = {name: [] for name in planners}
    for problem in valid:
        for name, planner in planners.items():
            first, again, path = ask(planner, problem, given.rounds, given.time_limit)
            if path is None:
                print(f"{name} found no way: {problem.kind} {problem.number}, {first:.0f} ms")
                answers[name].append(None)
                continue
            measured = (
                (planner.duration, length_of(path)) if isinstance(planner, Jacokin) else timer.measure(problem, path)
            )
            depth = referee.depth_along(path, problem.solids, STEP)
            missed = max(np.abs(path[0] - problem.start).max(), np.abs(path[-1] - problem.goal).max())
            if missed > 1e-6:
                print(f"{name} misses its ends by {missed:.2g} rad: {problem.kind} {problem.number}")
            answers[name].append(Answer(first, again, *measured, depth))
    for kind in [*(dict.fromkeys(p.kind for p in valid) if given.each else ()), ""]:
        at = [k for k, problem in enumerate(valid) if kind in ("", problem.kind)]
        print(f"\n{kind or 'all'}\n")
        print("| planner | solved | ms | ms with the world | length rad (part of jacokin's) | s (part) | touching |")
        print("| --- | --- | --- | --- | --- | --- | --- |")
        ours = [answers["jacokin"][k] for k in at]
        for name, found in answers.items():
            print(row(name, [found[k] for k in at], ours))


if __name__ == "__main__":
    main()
