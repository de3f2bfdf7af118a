"""Limits of jerk: how much longer motions take, and how soon a motion from rest to rest is timed, beside Ruckig.

Run from the repository: ``python -m benchmarks.jerk [--problems 8] [--jerk 7] [--step 1e-3]``. The problems are those
of `benchmarks.motion`, whose referee looks for contact on every motion, in steps of ``--step`` [rad]. Times are those
of the processor.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from functools import partial

import numpy as np
import ruckig

import jacokin
from benchmarks.motion import ACCELERATION, KINDS, ROBOTS, faults, problems
from jacokin import Robot, plan_motion
from jacokin.arrays import Array
from jacokin.motion import move_joints

ROUNDS = 5
MOTIONS = 200


def around(robot: Robot, kind: str, count: int, jerk: float, step: float) -> str:
    """One row: motions that go around something, with a limit of jerk, over those without."""
    ratios, bounds, wrong, taken = [], [], 0, []
    for problem in problems(robot, kind, count):
        plan = partial(plan_motion, problem.solver, problem.start, acceleration_limit=ACCELERATION)
        plan(problem.start)  # prepares contact, once for each scene
        plain = plan(problem.goal)
        begin = time.process_time()
        motion = plan(problem.goal, jerk_limit=jerk)
        taken.append(1e3 * (time.process_time() - begin))
        if not plain.success or "around" not in plain.message:
            continue
        found = faults(robot, problem, motion, step) if step > 0.0 else []
        sudden = np.abs(np.diff(motion.a, axis=0)).max() / motion.t[1]
        if found or sudden > jerk * (1.0 + 1e-6):
            wrong += 1
            print(f"{kind}: {', '.join(found) or 'jerk limit'}")
        ratios.append(motion.duration / plain.duration)
        bounds.append(1.0 + ACCELERATION / jerk / plain.duration)
    if not ratios:
        return f"| {robot.name} | {kind} | 0 | | | | |"
    longer = f"{np.mean(ratios):.3f} / {max(ratios):.2f} | {np.mean(bounds):.3f}"
    return f"| {robot.name} | {kind} | {len(ratios)} | {longer} | {np.median(taken):.1f} | {wrong} |"


def least_time(robot: Robot, limits: dict[str, float], ends: Array) -> None:
    """Ruckig's profile between configurations (2, dof), without rows."""
    given = ruckig.InputParameter(robot.dof)
    given.current_position, given.target_position = ends[0].tolist(), ends[1].tolist()
    given.max_velocity = robot.velocity_limit.tolist()
    given.max_acceleration = [limits["acceleration_limit"]] * robot.dof
    given.max_jerk = [limits["jerk_limit"]] * robot.dof
    ruckig.Ruckig(robot.dof).calculate(given, ruckig.Trajectory(robot.dof))


def microseconds(run: Callable[[Array], object], ends: Array) -> float:
    """The least mean time of a call over some rounds."""
    found = []
    for _ in range(ROUNDS):
        begin = time.process_time()
        for each in ends:
            run(each)
        found.append(1e6 * (time.process_time() - begin) / len(ends))
    return min(found)


def timing(robot: Robot, jerk: float) -> str:
    """How long timing from rest to rest takes."""
    rng = np.random.default_rng(0)
    ends = robot.sample(rng, 2 * MOTIONS).reshape(MOTIONS, 2, robot.dof)
    limits = {"acceleration_limit": ACCELERATION, "jerk_limit": jerk}
    rows = np.mean([len(move_joints(robot, *each, **limits)) for each in ends])
    ours = microseconds(lambda each: move_joints(robot, *each, **limits), ends)
    theirs = microseconds(partial(least_time, robot, limits), ends)
    return (
        f"{robot.name}, from rest to rest: `move_joints` {ours:.0f} us with {rows:.0f} rows in the mean; "
        f"Ruckig {theirs:.0f} us without rows"
    )


def main() -> None:
    """Print a table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("kinds", nargs="*", help=f"of scenes: {', '.join(KINDS)}; all if none is given")
    parser.add_argument("--problems", type=int, default=8)
    parser.add_argument("--jerk", type=float, nargs="+", default=[7.0], help="[rad/s^3]")
    parser.add_argument("--step", type=float, default=1e-3, help="of the referee [rad]; 0 for none")
    parser.add_argument("--robot", choices=ROBOTS, default=ROBOTS[0])
    given = parser.parse_args()
    robot = jacokin.load_robot(given.robot)
    for jerk in given.jerk:
        print(f"{timing(robot, jerk)}\n\nLimit of jerk: {jerk:g} rad/s^3\n")
        print("| robot | scene | motions around | times as long, mean / worst | on one line | ms, median | faults |")
        print("| --- | --- | --- | --- | --- | --- | --- |")
        for kind in given.kinds or KINDS:
            print(around(robot, kind, given.problems, jerk, given.step), flush=True)


if __name__ == "__main__":
    main()
