"""Lines that stand for an arm and for obstacles in pictures of maps and of places."""

from __future__ import annotations

import mujoco
import numpy as np
import pinocchio as pin

from jacokin.arrays import Array
from jacokin.model.robot import Robot
from jacokin.model.scene import Scene

ROUND = 33  # points of a circle
PLATE = 1.0  # [m] half the edge of the square that stands for a floor
EDGES = (0, 1, 3, 2, 0, 4, 5, 7, 6, 4, 5, 1, 3, 7, 6, 2)  # a way through the corners of a box along all its edges


def outline_arm(robot: Robot, q: Array) -> Array:
    """The origins of base, joints and tool (k, 3) [m] in the base, at `q` (dof,) [rad]."""
    model = robot.pin_model
    data = model.createData()
    pin.framesForwardKinematics(model, data, q)
    joints = [data.oMi[joint].translation for joint in range(1, model.njoints)]
    return np.array([np.zeros(3), *joints, data.oMf[robot.frame_id()].translation])


def outline_scene(scene: Scene) -> list[Array]:
    """Lines (k, 3) [m] along the edges of the obstacles, where they stand."""
    spec = mujoco.MjSpec()
    for obstacle in scene:
        obstacle.add_to(spec.worldbody)
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    return [
        line @ data.geom_xmat[geom].reshape(3, 3).T + data.geom_xpos[geom]
        for geom in range(model.ngeom)
        for line in _outline_geom(model, geom)
    ]


def _outline_geom(model: mujoco.MjModel, geom: int) -> list[Array]:
    """The lines of a shape in its own axes; of a mesh, those of its bounding box."""
    kind, size = model.geom_type[geom], model.geom_size[geom]
    angle = np.linspace(0.0, 2.0 * np.pi, ROUND)
    circle = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(ROUND)])
    if kind == mujoco.mjtGeom.mjGEOM_SPHERE:
        return [size[0] * np.roll(circle, axis, axis=1) for axis in range(3)]
    if kind in (mujoco.mjtGeom.mjGEOM_CYLINDER, mujoco.mjtGeom.mjGEOM_CAPSULE):
        half = size[1] + (size[0] if kind == mujoco.mjtGeom.mjGEOM_CAPSULE else 0.0)
        end = np.array([0.0, 0.0, half])
        sides = [size[0] * circle[row] + np.outer([-1.0, 1.0], end) for row in range(0, ROUND - 1, ROUND // 4)]
        return [size[0] * circle + end, size[0] * circle - end, *sides]
    if kind == mujoco.mjtGeom.mjGEOM_PLANE:
        return [
            PLATE
            * np.array([[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 1.0, 0.0], [-1.0, -1.0, 0.0]])
        ]
    centre, extent = model.geom_aabb[geom][:3], model.geom_aabb[geom][3:]
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * extent + centre
    return [corners[list(EDGES)]]
