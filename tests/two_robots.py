"""Two bundled robots in one model of MuJoCo, from their files: nothing of the planners' contact."""

from __future__ import annotations

import mujoco
import numpy as np
import pinocchio as pin

from jacokin import Robot
from jacokin.arrays import Array
from jacokin.model import urdf_folder
from jacokin.model.poses import quaternion

FAR = 0.05  # [m] larger distances are this one


class TwoRobots:
    """Distances of the shapes of one robot to those of another; two bases do not count."""

    def __init__(self, robot: Robot, other: Robot, base: pin.SE3) -> None:
        """Compile both, the other one with its base at a pose in the base of the first."""
        spec, arms = mujoco.MjSpec(), (robot, other)
        for prefix, arm, place in (("a/", robot, pin.SE3.Identity()), ("b/", other, base)):
            frame = spec.worldbody.add_frame(pos=place.translation, quat=quaternion(place.rotation))
            spec.attach(mujoco.MjSpec.from_file(str(urdf_folder() / f"{arm.name}.xml")), prefix=prefix, frame=frame)
        self._model = model = spec.compile()
        self._data = mujoco.MjData(model)
        for joint in range(model.njnt):
            name, arm = model.joint(joint).name, arms[model.joint(joint).name.startswith("b/")]
            if name[2:] not in arm.joint_names and arm.finger_angle is not None:
                self._data.qpos[model.jnt_qposadr[joint]] = arm.finger_angle
        of = [str(model.body(body).name)[:2] for body in model.geom_bodyid]
        moves = model.body_weldid[model.geom_bodyid] != 0
        self._pairs = np.array(
            [
                (a, b)
                for a in range(model.ngeom)
                for b in range(model.ngeom)
                if of[a] == "a/" and of[b] == "b/" and (moves[a] or moves[b])
            ]
        )
        self._near = model.geom_rbound[self._pairs].sum(axis=1) + FAR
        names = [prefix + name for prefix, arm in (("a/", robot), ("b/", other)) for name in arm.joint_names]
        self._joints = [model.joint(name).qposadr[0] for name in names]

    def least(self, q: Array, other_q: Array) -> float:
        """The smallest distance at configurations of both [m], at most `FAR`."""
        model, data, pairs = self._model, self._data, self._pairs
        data.qpos[self._joints] = np.concatenate([q, other_q])
        mujoco.mj_kinematics(model, data)
        apart = np.linalg.norm(data.geom_xpos[pairs[:, 0]] - data.geom_xpos[pairs[:, 1]], axis=1)
        near = pairs[apart < self._near].tolist()
        return min((mujoco.mj_geomDistance(model, data, a, b, FAR, None) for a, b in near), default=FAR)
