"""Planning paths: time, what is solved beside `track_path`, and every tick checked by MuJoCo's kinematics.

Run from the repository: ``python -m benchmarks.planning``.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

import mujoco
import numpy as np
import pinocchio as pin

import jacokin
from benchmarks.report import seconds
from jacokin import IKSolver, Robot
from jacokin.arrays import Array
from jacokin.ik import Box, Floor, FreeAxis, PathResult, Scene, plan_path, track_path
from jacokin.model import to_mujoco

DT = 0.02  # [s]
SPEED = 0.1  # [m/s]
PATHS = 200
WAYPOINTS = 200
ROUNDS = 5
LONGEST = 0.4  # [m] of a random line
TURN = 1.0  # [rad] of its orientation, at most
TOLERANCE = 1e-6  # [m] and [rad]


class Referee:
    """Checks trajectories tick by tick with MuJoCo."""

    def __init__(self, robot: Robot, frame: str) -> None:
        """Compile the twin."""
        self._robot = robot
        self._model = to_mujoco(robot)
        self._data = mujoco.MjData(self._model)
        self._site = self._model.site(frame).id

    def faults(self, result: PathResult, corners: list[pin.SE3]) -> list[str]:
        """What is wrong with a trajectory along straight lines that says it is a success."""
        robot, found = self._robot, []
        if (result.q < robot.lower).any() or (result.q > robot.upper).any():
            found.append("limit")
        if (np.abs(np.diff(result.q, axis=0)) / np.diff(result.t)[:, None] > robot.velocity_limit + 1e-8).any():
            found.append("speed")
        start, end = corners
        way, turn = end.translation - start.translation, pin.log3(start.rotation.T @ end.rotation)
        for q in result.q:
            self._data.qpos[:] = q
            mujoco.mj_kinematics(self._model, self._data)
            gone = self._data.site_xpos[self._site] - start.translation
            part = float(gone @ way / (way @ way))
            wanted = start.rotation @ pin.exp3(part * turn)
            tilt = np.linalg.norm(pin.log3(wanted.T @ self._data.site_xmat[self._site].reshape(3, 3)))
            if np.linalg.norm(gone - part * way) > TOLERANCE or tilt > TOLERANCE or not -1e-6 <= part <= 1.0 + 1e-6:
                found.append("off the line")
                break
        return found


@dataclass
class Tally:
    """How many of the random lines were solved."""

    tracked: int = 0
    kept: int = 0
    slow: int = 0
    lost: int = 0
    faults: int = 0


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


def best_of(call: Callable[[], PathResult]) -> tuple[float, PathResult]:
    """Processor time of the quickest of a few rounds [s], and the result."""
    times = []
    for _ in range(ROUNDS):
        start = time.process_time()
        result = call()
        times.append(time.process_time() - start)
    return min(times), result


def timed(robot: Robot) -> None:
    """Print how long plans of 200 waypoints take."""
    poses = loop(robot)
    free = [FreeAxis(pose, axis=[1.0, 0.0, 0.0]) for pose in poses]
    solver = IKSolver(robot, warm=True)
    scene = Scene([Box("table", [0.6, 0.6, 0.05], [0.5, -0.5, -0.1]), Floor(-0.2)])
    careful = IKSolver(robot, scene=scene, collision="reject", clearance=0.005)
    for name, call in {
        "full poses, keep": lambda: plan_path(solver, poses, dt=DT),
        "full poses, slow": lambda: plan_path(solver, poses, dt=DT, timing="slow"),
        "full poses, slow, accelerations": lambda: plan_path(
            solver, poses, dt=DT, timing="slow", acceleration_limit=2.0
        ),
        "full poses, in a scene": lambda: plan_path(careful, poses, dt=DT, timing="slow"),
        "free axis in steps of 10 degrees": lambda: plan_path(solver, free, dt=DT, timing="slow"),
    }.items():
        taken, result = best_of(call)
        print(f"{WAYPOINTS} waypoints, {name:34} {seconds(taken):>9}   {len(result)} ticks, success {result.success}")


def compared(robot: Robot) -> Tally:
    """Plan and track random lines; print those that only the tracker follows."""
    rng = np.random.default_rng(0)
    solver, referee = IKSolver(robot), Referee(robot, robot.default_frame)
    tally = Tally()
    for index in range(PATHS):
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
        for result in (kept, slow):
            wrong = referee.faults(result, corners) if result.success else []
            if wrong:
                tally.faults += 1
                print(f"line {index}: {', '.join(wrong)}")
    return tally


def across_the_base_axis(robot: Robot) -> None:
    """The wrist through the axis of joint 1, at 10 cm/s."""
    rotation = robot.forward_kinematics(robot.home, "link_6").rotation
    solver, referee = IKSolver(robot, "link_6"), Referee(robot, "link_6")
    for offset in (0.0, 2e-3, 0.02):
        corners = [pin.SE3(rotation, _at(side, offset)) for side in (0.12, -0.12)]
        tracked = track_path(robot, corners, speed=SPEED, frame="link_6").success
        slow = plan_path(solver, corners, speed=SPEED, timing="slow")
        print(
            f"{1e3 * offset:4.0f} mm beside the base axis: tracked {tracked}, planned {slow.success} in "
            f"{slow.t[-1]:.2f} s instead of 2.40 s, faults: {', '.join(referee.faults(slow, corners)) or 'none'}"
        )


def _at(x: float, y: float) -> Array:
    return np.array([x, y, 0.75])


def main() -> None:
    """Print everything."""
    robot = jacokin.load_robot()
    timed(robot)
    tally = compared(robot)
    failed = PATHS - tally.tracked
    more = tally.slow - (tally.tracked - tally.lost)
    print(
        f"{PATHS} random lines at {SPEED} m/s: track_path follows {tally.tracked}, plan_path keeps the speed on "
        f"{tally.kept} and follows {tally.slow} slowed down: {more} of the {failed} ({more / failed:.0%}) that "
        f"track_path does not, and all but {tally.lost} that it does; {tally.faults} with a fault"
    )
    across_the_base_axis(robot)


if __name__ == "__main__":
    main()
