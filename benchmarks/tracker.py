"""Cost of one tick of the tracker beside a bare mink loop with the same limits, interleaved tick by tick.

Run from the repository: ``python benchmarks/tracker.py``.
"""

from __future__ import annotations

import time
from collections.abc import Callable

import mink
import numpy as np
import pinocchio as pin

import jacokin
from jacokin import Robot
from jacokin.model import poses, to_mujoco
from jacokin.motion import Tracker

DT = 0.01  # [s]
TICKS = 2000
SPEED = 0.05  # [m/s]


def line(robot: Robot) -> list[pin.SE3]:
    """Ten centimetres up and down from home at 5 cm/s."""
    start = robot.forward_kinematics(robot.home)
    heights = 0.05 - 0.05 * np.cos(np.arange(1, TICKS + 1) * DT * SPEED / 0.05)
    return [pin.SE3(start.rotation, start.translation + np.array([0.0, 0.0, height])) for height in heights]


def bare_mink(robot: Robot) -> Callable[[pin.SE3], None]:
    """The loop everybody writes: prebuilt task and limits, solve, integrate."""
    model = to_mujoco(robot)
    configuration = mink.Configuration(model)
    configuration.update(robot.home)
    task = mink.FrameTask(robot.default_frame, "site", position_cost=1.0, orientation_cost=0.1, lm_damping=1e-2)
    limits = [
        mink.ConfigurationLimit(model),
        mink.VelocityLimit(model, dict(zip(robot.joint_names, robot.velocity_limit, strict=True))),
    ]

    def tick(target: pin.SE3) -> None:
        task.set_target(mink.SE3(np.concatenate([poses.quat_wxyz(target.rotation), target.translation])))
        velocity = mink.solve_ik(configuration, [task], DT, "daqp", limits=limits)
        configuration.integrate_inplace(velocity, DT)

    return tick


def bare_solve(robot: Robot) -> Callable[[pin.SE3], object]:
    """`mink.solve_ik` and nothing around it: the target is not even changed."""
    model = to_mujoco(robot)
    configuration = mink.Configuration(model)
    configuration.update(robot.home)
    task = mink.FrameTask(robot.default_frame, "site", position_cost=1.0, orientation_cost=0.1, lm_damping=1e-2)
    task.set_target_from_configuration(configuration)
    limits = [
        mink.ConfigurationLimit(model),
        mink.VelocityLimit(model, dict(zip(robot.joint_names, robot.velocity_limit, strict=True))),
    ]
    return lambda _: mink.solve_ik(configuration, [task], DT, "daqp", limits=limits)


def tracker(robot: Robot, collision: str, clearance: float | None = None) -> Callable[[pin.SE3], None]:
    """One tick of ours, checks and report included."""
    following = Tracker(robot, dt=DT, collision=collision, clearance=clearance)

    def tick(target: pin.SE3) -> None:
        following.step(target)

    return tick


def main() -> None:
    """Print median and 99th percentile of each loop, and the ratio to mink."""
    robot = jacokin.load_robot()
    loops = {
        "bare mink.solve_ik": bare_solve(robot),
        "bare mink loop": bare_mink(robot),
        "Tracker": tracker(robot, "ignore"),
        "Tracker, self-collision avoidance": tracker(robot, "reject", clearance=0.005),
    }
    times: dict[str, list[float]] = {name: [] for name in loops}
    for target in line(robot):
        for name, tick in loops.items():
            start = time.perf_counter()
            tick(target)
            times[name].append(time.perf_counter() - start)
    base = np.median(times["bare mink.solve_ik"])
    print(f"{'one tick':36} {'median us':>10} {'p99 us':>8} {'of bare':>8}")
    for name, values in times.items():
        median, high = np.median(values) * 1e6, np.percentile(values, 99) * 1e6
        print(f"{name:36} {median:10.1f} {high:8.1f} {np.median(values) / base:8.2f}")


if __name__ == "__main__":
    main()
