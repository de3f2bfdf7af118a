"""A tool that gives way like a spring: impedance control in tool space, within limits.

    MUJOCO_GL=egl python -m examples.impedance

The actuators take torques. The tool is pulled to its place by springs and dampers, J^T (K e - D v), on top of what
holds the arm up; the wrench and the torques are limited, and springs before the joints' limits push back. A hand pushes
the tool away, and it returns. Pictures go to ``impedance.gif``; pillow writes them.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from examples.drawing import Film
from examples.gravity_compensation import FRAME_EVERY, STEPS, Demonstration
from jacokin import Robot
from jacokin.mujoco_bridge.robots import ARM_OFFSET

Array = NDArray[np.float64]
NOTHING = (0.0, 0.0, 0.0)  # [N]
PUSH = (20.0, 30.0, 0.0)  # [N] in the world


@dataclass(frozen=True)
class Impedance:
    """How stiff the tool is.

    Attributes:
        stiffness: [N/m] and [N m/rad].
        damping: [N s/m] and [N m s/rad].
        most: the springs pull no harder than this [N], [N m].
        joint_damping: [N m s/rad], for what the tool does not feel.
        margin: [rad] before a joint's limit, where a spring of `limit_stiffness` [N m/rad] begins.
        limit_stiffness: see above.
    """

    stiffness: tuple[float, float] = (400.0, 20.0)
    damping: tuple[float, float] = (120.0, 8.0)
    most: tuple[float, float] = (40.0, 5.0)
    joint_damping: float = 2.0
    margin: float = 0.15
    limit_stiffness: float = 200.0

    def torque(self, robot: Robot, q: Array, v: Array, goal: pin.SE3, frame: str = "end_effector") -> Array:
        """Torques (dof,) [N m] at joint angles `q` [rad] and velocities `v` [rad/s] towards T_base_tool."""
        tool, jacobian = robot.forward_kinematics(q, frame), robot.jacobian(q, frame)
        errors = goal.translation - tool.translation, pin.log3(goal.rotation @ tool.rotation.T)
        twist = jacobian @ v
        wrench = np.empty(6)
        for part, error in enumerate(errors):
            pull = self.stiffness[part] * error
            size = float(np.linalg.norm(pull))
            rows = slice(3 * part, 3 * part + 3)
            wrench[rows] = pull * min(1.0, self.most[part] / max(size, 1e-12)) - self.damping[part] * twist[rows]
        low = np.maximum(robot.lower + self.margin - q, 0.0)
        high = np.maximum(q - robot.upper + self.margin, 0.0)
        torque = jacobian.T @ wrench - self.joint_damping * v + self.limit_stiffness * (low - high)
        return np.asarray(torque + robot.gravity(q) + robot.coriolis(q, v) @ v)


def perform(show: Demonstration, impedance: Impedance) -> Iterator[float]:
    """Hold, be pushed, return: the distance of the tool from its place [m], one tick at a time."""
    goal = show.robot.forward_kinematics(show.joints.qpos)
    tick = STEPS * show.physics.timestep
    for force, seconds in ((NOTHING, 0.5), (PUSH, 2.0), (NOTHING, 4.0)):
        for _ in range(round(seconds / tick)):
            show.link.xfrc_applied = [*force, 0.0, 0.0, 0.0]
            q, v = show.joints.qpos, show.joints.qvel
            show.physics.bind(show.arm.actuators).ctrl = impedance.torque(show.robot, q, v, goal)
            show.physics.step(STEPS)
            tool = show.robot.forward_kinematics(show.joints.qpos)
            yield float(np.linalg.norm(tool.translation - goal.translation))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--folder", type=Path, default=Path(), help="where to write the pictures")
    arguments = parser.parse_args()
    show = Demonstration()
    film = Film(show.physics.model, (*ARM_OFFSET[:2], 0.45))
    away = []
    for index, distance in enumerate(perform(show, Impedance())):
        away.append(distance)
        if index % FRAME_EVERY == 0:
            film.take(show.physics.data)
    film.save(arguments.folder / "impedance.gif", FRAME_EVERY * STEPS * show.physics.timestep)
    print(f"pushed away by {1e3 * max(away):.0f} mm, back to {1e3 * away[-1]:.1f} mm")


if __name__ == "__main__":
    main()
