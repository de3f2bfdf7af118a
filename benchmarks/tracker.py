"""Cost of one tick of the tracker beside a bare mink loop with the same limits, interleaved tick by tick.

After it, ticks among twenty obstacles that stand, and of which some move: without acceleration limits, with those of
the arm, and with higher ones. Processor time, which other programs disturb less, and time by the clock, which is what a
deadline sees.

Run from the repository: ``python benchmarks/tracker.py``.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import mink
import numpy as np
import pinocchio as pin

import jacokin
from jacokin import Robot
from jacokin.ik import Box, Capsule, Obstacle, Scene, Sphere
from jacokin.model import poses, to_mujoco
from jacokin.motion import Tracker

DT = 0.01  # [s]
TICKS = 2000
SPEED = 0.05  # [m/s]
CROWD = 20  # obstacles


def line(robot: Robot) -> list[pin.SE3]:
    """Ten centimetres up and down from home at 5 cm/s."""
    start = robot.forward_kinematics(robot.home)
    heights = 0.05 - 0.05 * np.cos(np.arange(1, TICKS + 1) * DT * SPEED / 0.05)
    return [pin.SE3(start.rotation, start.translation + np.array([0.0, 0.0, height])) for height in heights]


class MinkLoop:
    """The loop that mink's examples show: prebuilt task and limits, solve, integrate."""

    def __init__(self, robot: Robot) -> None:
        """Begin at home, with home as the target."""
        model = to_mujoco(robot)
        self.configuration = mink.Configuration(model)
        self.configuration.update(robot.home)
        site = robot.default_frame
        self.task = mink.FrameTask(site, "site", position_cost=1.0, orientation_cost=0.1, lm_damping=1e-2)
        self.task.set_target_from_configuration(self.configuration)
        speeds = dict(zip(robot.joint_names, robot.velocity_limit, strict=True))
        self.limits = [mink.ConfigurationLimit(model), mink.VelocityLimit(model, speeds)]

    def solve(self, *_: object) -> Any:
        """`mink.solve_ik` and nothing around it: the target is not even changed."""
        return mink.solve_ik(self.configuration, [self.task], DT, "daqp", limits=self.limits)

    def tick(self, target: pin.SE3) -> None:
        """One tick after a target."""
        self.task.set_target(mink.SE3(np.concatenate([poses.quat_wxyz(target.rotation), target.translation])))
        self.configuration.integrate_inplace(self.solve(), DT)


def tracker(robot: Robot, collision: str, clearance: float | None = None) -> Callable[[pin.SE3], None]:
    """One tick of ours, checks and report included."""
    following = Tracker(robot, dt=DT, collision=collision, clearance=clearance)

    def tick(target: pin.SE3) -> None:
        following.step(target)

    return tick


def crowd(robot: Robot, rng: np.random.Generator) -> Scene:
    """Twenty boxes, balls and rods around the arm."""
    shapes = list[Obstacle]()
    while len(shapes) < CROWD:
        centre = rng.uniform([-0.8, -0.8, 0.0], [0.8, 0.8, 1.0])
        pose, name = pin.SE3(pin.exp3(rng.normal(size=3)), centre), f"shape_{len(shapes)}"
        kinds = (
            Box(name, rng.uniform(0.04, 0.2, 3), pose),
            Sphere(name, float(rng.uniform(0.03, 0.1)), centre),
            Capsule(name, 0.03, 0.2, pose),
        )
        shape = kinds[len(shapes) % 3]
        if robot.clearance(robot.home, Scene([shape])) > 0.05:
            shapes.append(shape)
    return Scene(shapes)


def among_obstacles(robot: Robot, *, moving: bool, acceleration: float | None) -> None:
    """Print the cost of ticks at 500 Hz on a circle among obstacles."""
    scene, step = crowd(robot, np.random.default_rng(0)), 0.002
    following = Tracker(robot, dt=step, scene=scene, acceleration_limit=acceleration)
    start = robot.forward_kinematics(robot.home)
    balls = [shape for shape in scene if isinstance(shape, Sphere)]
    clock, processor = list[float](), list[float]()
    for tick in range(TICKS):
        angle = 2.0 * np.pi * 0.08 * tick * step
        way = 0.06 * np.array([np.sin(angle), 0.0, 1.0 - np.cos(angle)])
        shift, rate = 0.02 * np.sin(np.pi * tick * step), 0.02 * np.pi * np.cos(np.pi * tick * step)
        twist = [rate, 0.0, 0.0, 0.0, 0.0, 0.0]
        told = {ball.name: (np.add(ball.position, [shift, 0.0, 0.0]), twist) for ball in balls}
        before, used = time.perf_counter(), time.thread_time()
        following.step(pin.SE3(start.rotation, start.translation + way), obstacles=told if moving else None)
        clock.append(time.perf_counter() - before)
        processor.append(time.thread_time() - used)
    name = f"{len(balls) if moving else 'none'} of {CROWD} move"
    if acceleration != np.inf:
        name += f", {following.acceleration_limit.max():g} rad/s^2"
    for kind, times in (("processor", processor), ("clock", clock)):
        print(f"{name:28}{kind:10}" + "".join(f"{1e6 * x:10.0f}" for x in np.percentile(times, [50, 99, 99.9])))


def main() -> None:
    """Print median and 99th percentile of each loop, and the ratio to mink; then ticks among obstacles."""
    robot = jacokin.load_robot()
    loops: dict[str, Callable[[pin.SE3], object]] = {
        "bare mink.solve_ik": MinkLoop(robot).solve,
        "bare mink loop": MinkLoop(robot).tick,
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
    print(f"{'among obstacles':38}{'median us':>10}{'p99':>10}{'p99.9':>10}")
    for moving in (False, True):
        for acceleration in (np.inf, None, 4.0):
            among_obstacles(robot, moving=moving, acceleration=acceleration)


if __name__ == "__main__":
    main()
