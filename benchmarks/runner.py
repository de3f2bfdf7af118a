"""Motions played on simulated arms with faults, in a closed loop by `Runner` and in an open one.

Random motions without contact, planned from one random configuration to another, each played both ways on the same arm
with the same faults: where it ends, whether what did not end there was stopped, and whether limits were broken.
Run from the repository: ``python -m benchmarks.runner``.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

import jacokin
from jacokin import Robot
from jacokin.ik import Floor, Scene
from jacokin.motion import Trajectory, plan_motion
from jacokin.runner import PlannedMotion, Runner, RunnerOptions, RunnerStatus, TwinLink, run
from jacokin.twin import Faults, KinovaDriver, SimulatedArm, TrajectoryController

FAULTS = ("", "lag=0.02", "lag=0.02,loss=0.01", "lag=0.02,loss=0.01,stall")
LOOPS = {"closed": RunnerOptions(), "open": RunnerOptions(gain=0.0, lag=10.0, silence=100.0, patience=1.0)}
PERIODS = {1: 0.1, 2: 0.01}  # [s] in which the nodes say where the arm is
CLEARANCE = 0.03  # [m]
THERE = 0.5  # [deg]


class Played(NamedTuple):
    """How a motion ended."""

    status: RunnerStatus
    away: float
    """From its end, as the simulation has it [deg]."""
    broken: bool
    """Whether a joint or velocity limit was."""
    moved: float
    """How long the arm moved on after it was told to stop [s]."""


def motions(robot: Robot, count: int, seed: int) -> Iterator[Trajectory]:
    """Random motions without contact."""
    rng = np.random.default_rng(seed)
    solver = jacokin.IKSolver(robot, scene=Scene([Floor(0.0)]), clearance=CLEARANCE)
    while count:
        start, end = robot.sample(rng, 2)
        motion = plan_motion(solver, start, end, rng=rng)
        if motion.success and motion.clearance.min() > 0.0:  # a plan may lead out of a start that touches
            count -= 1
            yield motion


def play(robot: Robot, motion: Trajectory, ros: int, faults: str, options: RunnerOptions, seed: int) -> Played:
    """Play one on a new arm."""
    arm = SimulatedArm(q=motion.q[0])
    driver: KinovaDriver | TrajectoryController
    if ros == 1:
        driver = KinovaDriver(arm, faults=Faults.parse(faults), seed=seed)
    else:
        driver = TrajectoryController(arm, robot.joint_names, faults=Faults.parse(faults), seed=seed)
    runner = Runner(robot, PlannedMotion.of(motion, robot), options)
    ended: list[float] = []

    def watch() -> None:
        if runner.status.has_ended and not ended:
            ended.append(arm.state.time)

    run(runner, TwinLink(driver, period=PERIODS[ros]), watch=watch)
    away = float(np.degrees(np.abs(arm.state.q - motion.q[-1]).max()))
    return Played(runner.status, away, arm.margin < 0.0 or arm.speed > 1.02, arm.moved - ended[0])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--motions", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--faults", nargs="*", default=FAULTS)
    options = parser.parse_args()
    robot = jacokin.load_robot(finger_angle=float(SimulatedArm().finger_range[0]))  # open, as the arm's are
    made = list(motions(robot, options.motions, options.seed))
    print(f"{len(made)} motions, {np.median([motion.duration for motion in made]):.1f} s in the median")
    head = ("ROS", "faults", "loop", "there", "stopped", "neither", "median [deg]", "largest [deg]", "limits broken")
    print("| " + " | ".join((*head, "stands after [s]")) + " |\n" + "| --- " * (len(head) + 1) + "|", flush=True)
    for ros in PERIODS:
        for faults in options.faults:
            for loop, chosen in LOOPS.items():
                ends = [play(robot, motion, ros, faults, chosen, seed) for seed, motion in enumerate(made)]
                report(ros, faults or "none", loop, ends)


def report(ros: int, faults: str, loop: str, ends: list[Played]) -> None:
    """A row of the table; distances are those of motions that were not stopped."""
    stops = (RunnerStatus.BEHIND, RunnerStatus.SILENT, RunnerStatus.NOT_THERE)
    stopped = [end for end in ends if end.status in stops]
    rest = np.array([end.away for end in ends if end.status not in stops])
    there = int((rest < THERE).sum())
    late = max((end.moved for end in stopped), default=0.0)
    print(
        f"| {ros} | {faults} | {loop} | {there} | {len(stopped)} | {len(rest) - there} | {np.median(rest):.2f} | "
        f"{rest.max():.2f} | {sum(end.broken for end in ends)} | {late:.2f} |",
        flush=True,
    )


if __name__ == "__main__":
    main()
