"""MuJoCo's own kinematics and dynamics of a robot's description, for cross-checks."""

from __future__ import annotations

import mujoco
import numpy as np

from jacokin.arrays import Array
from jacokin.model.descriptions import mjcf
from jacokin.model.mujoco_twin import source
from jacokin.model.robot import Robot


class MujocoEngine:
    """The description compiled by MuJoCo, joints off the arm held where the robot has them.

    Poses and Jacobians are expressed in the robot's base, as the robot's own are.
    """

    def __init__(self, robot: Robot) -> None:
        """Prepare working memory."""
        self._model = model = source.with_masses(robot)
        self._data = mujoco.MjData(model)
        self.label = f"{robot.name} in MuJoCo"
        self.joint_names = robot.joint_names
        self._qpos = mjcf.joint_addresses(model, robot.joint_names)
        self._dofs = mjcf.dof_addresses(model, robot.joint_names)
        self.has_armature = bool(np.any(model.dof_armature[self._dofs]))
        self._bodies = {mjcf.body_name(model, body): body for body in range(model.nbody)}
        self._sites = {mjcf.site_name(model, site): site for site in range(model.nsite)}
        self.frames = tuple(name for name in robot.frames if name in self._bodies or name in self._sites)
        self._hold_still(robot)
        self._base = robot.base if robot.base in self._bodies or robot.base in self._sites else None
        self._mass = np.zeros((model.nv, model.nv))

    def _hold_still(self, robot: Robot) -> None:
        """Joints off the arm at the robot's finger angle, clipped into their limits."""
        model = self._model
        for joint in range(model.njnt):
            address = model.jnt_qposadr[joint]
            if address in self._qpos or model.jnt_type[joint] not in mjcf.SCALAR_JOINTS:
                continue
            angle = self._data.qpos[address] if robot.finger_angle is None else robot.finger_angle
            if model.jnt_limited[joint]:
                angle = np.clip(angle, *model.jnt_range[joint])
            self._data.qpos[address] = angle

    def update(self, q: Array) -> None:
        """Compute everything at `q` (dof,) [rad]."""
        self._data.qpos[self._qpos] = q
        self._data.qvel[:] = 0.0
        mujoco.mj_kinematics(self._model, self._data)
        mujoco.mj_comPos(self._model, self._data)
        mujoco.mj_makeM(self._model, self._data)
        mujoco.mj_comVel(self._model, self._data)
        mujoco.mj_rne(self._model, self._data, 0, self._data.qfrc_bias)
        mujoco.mj_fullM(self._model, self._data, self._mass)

    def _placement(self, frame: str) -> tuple[Array, Array]:
        if frame in self._bodies:
            body = self._bodies[frame]
            return np.array(self._data.xpos[body]), np.array(self._data.xmat[body]).reshape(3, 3)
        site = self._sites[frame]
        return np.array(self._data.site_xpos[site]), np.array(self._data.site_xmat[site]).reshape(3, 3)

    def pose(self, frame: str) -> tuple[Array, Array]:
        """Position (3,) [m] and rotation (3, 3) of a frame in the base."""
        position, rotation = self._placement(frame)
        if self._base is None:
            return position, rotation
        base_position, base_rotation = self._placement(self._base)
        return base_rotation.T @ (position - base_position), base_rotation.T @ rotation

    def jacobian(self, frame: str) -> Array:
        """(6, dof), local world aligned."""
        linear, angular = np.zeros((3, self._model.nv)), np.zeros((3, self._model.nv))
        if frame in self._bodies:
            mujoco.mj_jacBody(self._model, self._data, linear, angular, self._bodies[frame])
        else:
            mujoco.mj_jacSite(self._model, self._data, linear, angular, self._sites[frame])
        if self._base is not None:
            to_base = self._placement(self._base)[1].T
            linear, angular = to_base @ linear, to_base @ angular
        return np.vstack((linear, angular))[:, self._dofs]

    def mass_matrix(self, with_armature: bool) -> Array:
        """(dof, dof), with or without armature."""
        block = self._mass[np.ix_(self._dofs, self._dofs)]
        return block if with_armature else block - np.diag(self._model.dof_armature[self._dofs])

    def gravity_torque(self) -> Array:
        """(dof,) torque that holds the arm still [N m]."""
        return np.array(self._data.qfrc_bias[self._dofs])
