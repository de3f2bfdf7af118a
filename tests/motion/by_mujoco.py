"""Poses to plan to, and where the tool is by MuJoCo, which the planner does not use."""

from __future__ import annotations

import mujoco
import numpy as np
import pinocchio as pin

import jacokin
from jacokin import Robot
from jacokin.arrays import Array
from jacokin.model import to_mujoco

DOWN = jacokin.pose([0.0, 0.0, 0.0], down=True).rotation


def at(x: float, y: float, z: float, rotation: Array = DOWN) -> pin.SE3:
    return pin.SE3(rotation, np.array([x, y, z]))


def random_line(robot: Robot, rng: np.random.Generator) -> list[pin.SE3]:
    """From the pose of a random configuration in a random direction, turning about a random axis."""
    start = robot.forward_kinematics(robot.sample(rng))
    way, turn = rng.normal(size=3), rng.normal(size=3)
    way *= rng.uniform(0.1, 0.4) / np.linalg.norm(way)
    turn *= rng.uniform(0.0, 1.0) / np.linalg.norm(turn)
    return [start, pin.SE3(start.rotation @ pin.exp3(turn), start.translation + way)]


def tool_poses(robot: Robot, rows: Array, frame: str = "end_effector") -> tuple[Array, Array]:
    """Positions and rotations by MuJoCo."""
    model = to_mujoco(robot)
    data = mujoco.MjData(model)
    site = model.site(frame).id
    positions, rotations = [], []
    for q in rows:
        data.qpos[:] = q
        mujoco.mj_kinematics(model, data)
        positions.append(data.site_xpos[site].copy())
        rotations.append(data.site_xmat[site].reshape(3, 3).copy())
    return np.array(positions), np.array(rotations)
