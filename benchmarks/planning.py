"""Planning paths: time, what is solved beside `track_path`, and every tick checked by other code.

Run from the repository: ``python -m benchmarks.planning``. Each success is checked by `path_referee`.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial

import numpy as np
import pinocchio as pin

import jacokin
from benchmarks.path_referee import SHAPES_APART, Referee, Surveyor, Targets
from benchmarks.report import seconds
from jacokin import IKSolver, Robot
from jacokin.arrays import Array
from jacokin.ik import Box, FreeAxis, Scene
from jacokin.motion import Trajectory, plan_path, track_path

DT = 0.02  # [s]
SPEED = 0.1  # [m/s]
WAYPOINTS = 200
ROUNDS = 3
LONGEST = 0.4  # [m] of a random line
TURN = 1.0  # [rad] of its orientation, at most
CLEARANCE = 0.005  # [m]
BOXES = [
    (np.array([0.6, 0.6, 0.05]), np.array([0.5, -0.5, -0.1])),
    (np.array([2.0, 2.0, 0.1]), np.array([0, 0, -0.25])),
]


@dataclass
class Tally:
    """How many of the random lines were solved."""

    tracked: int = 0
    kept: int = 0
    slow: int = 0
    lost: int = 0
    faults: int = 0
    only_tracked: list[float] = field(default_factory=list)
    """Lines that the tracker follows and timing="keep" does not: share of its limit that their fastest joint needs."""


def loop(robot: Robot) -> list[pin.SE3]:
    """A closed curve in space with the orientation of home."""
    start = robot.forward_kinematics(robot.home)
    angles = np.linspace(0.0, 6.0, WAYPOINTS)
    offsets = np.column_stack([-0.08 * np.sin(angles), 0.05 * np.sin(angles) ** 2, 0.06 * (1.0 - np.cos(angles))])
    return [pin.SE3(start.rotation, start.translation + offset) for offset in offsets]


def line(robot: Robot, rng: np.random.Generator) -> list[pin.SE3]:
    """From the pose of a random configuration in a random direction, turning about a random axis."""
    start = robot.forward_kinematics(robot.sample(rng))
    way, turn = rng.normal(size=3), rng.normal(size=3)
    way *= rng.uniform(0.1, LONGEST) / np.linalg.norm(way)
    turn *= rng.uniform(0.0, TURN) / np.linalg.norm(turn)
    return [start, pin.SE3(start.rotation @ pin.exp3(turn), start.translation + way)]


def best_of(call: Callable[[], Trajectory]) -> tuple[float, Trajectory]:
    """Processor time of the quickest of a few rounds [s], and the result."""
    times = []
    for _ in range(ROUNDS):
        start = time.process_time()
        result = call()
        times.append(time.process_time() - start)
    return min(times), result


def verdict(result: Trajectory, faults: list[str]) -> str:
    """In words."""
    wrong = faults if result.success else ["failed", *faults]
    return ", ".join([f"{len(result)} ticks", *wrong])


def timed(robot: Robot) -> None:
    """Print how long plans of 200 waypoints take on an arm."""
    poses: Targets = loop(robot)
    solver, referee, surveyor = (
        IKSolver(robot, collision="ignore"),
        Referee(robot),
        Surveyor(robot.name, BOXES),
    )
    scene = Scene([Box(f"box_{number}", *box) for number, box in enumerate(BOXES)])
    careful = IKSolver(robot, scene=scene, collision="reject", clearance=CLEARANCE)
    kinds: list[tuple[str, IKSolver, Targets, str, float | None]] = [
        ("full poses, keep", solver, poses, "keep", None),
        ("full poses, slow", solver, poses, "slow", None),
        ("full poses, slow, accelerations", solver, poses, "slow", 2.0),
        ("full poses, slow, in a scene", careful, poses, "slow", None),
    ]
    if robot.dof == 6:
        free: Targets = [FreeAxis(pose, axis=[1.0, 0.0, 0.0]) for pose in poses]
        kinds.append(("free axis, 10 degrees, slow", solver, free, "slow", None))
        kinds.append(("the same in a scene", careful, free, "slow", None))
    for name, planner, targets, timing, acceleration in kinds:
        plan = partial(plan_path, planner, targets, DT, timing=timing, acceleration_limit=acceleration)
        taken, result = best_of(plan)
        faults = referee.faults(result, targets)
        if planner is careful and surveyor.least(result.q) < CLEARANCE - SHAPES_APART:
            faults.append("clearance")
        print(f"{robot.name}, {WAYPOINTS} waypoints, {name:32} {seconds(taken):>8}   {verdict(result, faults)}")


def compared(robot: Robot, paths: int) -> Tally:
    """Plan and track random lines; print those that only the tracker follows."""
    rng = np.random.default_rng(0)
    solver, referee = IKSolver(robot, collision="ignore"), Referee(robot)
    tally = Tally()
    for index in range(paths):
        corners = line(robot, rng)
        tracked = track_path(robot, corners, dt=DT, speed=SPEED).success
        kept = plan_path(solver, corners, dt=DT, speed=SPEED)
        slow = plan_path(solver, corners, dt=DT, speed=SPEED, timing="slow")
        tally.tracked += tracked
        tally.kept += kept.success
        tally.slow += slow.success
        if tracked and not slow.success:
            tally.lost += 1
            print(f"line {index} is tracked but not planned: {slow.message}")
        if tracked and not kept.success and robot.dof == 6:
            tally.only_tracked.append(fastest_share(solver, corners))
        for result in (kept, slow):
            wrong = referee.faults(result, corners) if result.success else []
            if wrong:
                tally.faults += 1
                print(f"line {index}: {', '.join(wrong)}")
    return tally


def fastest_share(solver: IKSolver, corners: list[pin.SE3]) -> float:
    """Share of its limit that the fastest joint needs to follow a line exactly, on the branch where it is least.

    From one start there is one way to follow a line exactly, so all starts are all ways.
    """
    shares = []
    for q in solver.solve_all(corners[0]).q_within_limits:
        result = plan_path(solver, corners, dt=DT, speed=SPEED, start=q)
        if "HELD" not in result.status:
            shares.append(float((np.abs(result.v) / result.velocity_limit).max()))
    return min(shares)


def across_the_base_axis(robot: Robot) -> None:
    """The wrist through the axis of joint 1, at 10 cm/s."""
    rotation = robot.forward_kinematics(robot.home, "link_6").rotation
    solver, referee = IKSolver(robot, "link_6", collision="ignore"), Referee(robot, "link_6")
    for offset in (0.0, 2e-3, 0.02):
        corners: Targets = [pin.SE3(rotation, _at(side, offset)) for side in (0.12, -0.12)]
        tracked = track_path(robot, corners, speed=SPEED, frame="link_6").success
        slow = plan_path(solver, corners, speed=SPEED, timing="slow")
        planned = verdict(slow, referee.faults(slow, corners))
        print(
            f"a line {1e3 * offset:.0f} mm from the base axis at {SPEED} m/s: {'' if tracked else 'not '}tracked; "
            f'planned with timing="slow": {slow.t[-1]:.2f} s instead of 2.40 s, {planned}'
        )


def _at(x: float, y: float) -> Array:
    return np.array([x, y, 0.75])


def report(robot: Robot, paths: int) -> None:
    """Print how many random lines are planned and tracked, and how well."""
    tally = compared(robot, paths)
    failed = paths - tally.tracked
    more = tally.slow - (tally.tracked - tally.lost)
    print(
        f"{robot.name}, {paths} random lines at {SPEED} m/s: track_path follows {tally.tracked}; plan_path with "
        f'timing="slow" {tally.slow}: all but {tally.lost} of those, and {more} of the other {failed} '
        f'({more / failed:.0%}); with timing="keep" {tally.kept}, exactly at that speed. {tally.faults} have a fault.'
    )
    if tally.only_tracked:
        low, high = 100.0 * min(tally.only_tracked), 100.0 * max(tally.only_tracked)
        print(
            f"The {len(tally.only_tracked)} lines that are tracked and not kept: from rest to rest along the line, the "
            f"fastest joint needs {low:.0f} to {high:.0f} % of its limit on the best branch. The tracker leaves these "
            "lines by less than its tolerances, 0.1 mm and 1 mrad."
        )


def main() -> None:
    """Print everything."""
    robot, seven = jacokin.load_robot(), jacokin.load_robot("j2s7s300")
    timed(robot)
    timed(seven)
    report(robot, 200)
    report(seven, 20)  # on seven joints, where the tracker has many starts to try
    across_the_base_axis(robot)


if __name__ == "__main__":
    main()
