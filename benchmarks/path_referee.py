"""Checks trajectories tick by tick with code that made none of them: MuJoCo's kinematics, and Coal's distances."""

from __future__ import annotations

import coal
import mujoco
import numpy as np
import pinocchio as pin

import jacokin
from jacokin import FreeAxis, Robot
from jacokin.arrays import Array
from jacokin.model import to_mujoco
from jacokin.motion import Trajectory

TOLERANCE = 1e-6  # [m] and [rad]
ROUNDING = 1e-8  # [rad/s]
SHAPES_APART = 1e-4  # [m] that two engines may differ in a distance

Targets = list[pin.SE3] | list[FreeAxis]


class Referee:
    """Is a trajectory that says it is a success on the lines between its targets, and within the limits?"""

    def __init__(self, robot: Robot, frame: str | None = None) -> None:
        """Compile the twin."""
        self._robot = robot
        self._model = to_mujoco(robot)
        self._data = mujoco.MjData(self._model)
        self._site = self._model.site(frame or robot.default_frame).id

    def faults(self, result: Trajectory, targets: Targets) -> list[str]:
        """What is wrong."""
        robot, found = self._robot, []
        if (result.q < robot.lower).any() or (result.q > robot.upper).any():
            found.append("limit")
        if (np.abs(np.diff(result.q, axis=0)) / np.diff(result.t)[:, None] > robot.velocity_limit + ROUNDING).any():
            found.append("speed")
        if self._far(result, targets) > TOLERANCE:
            found.append("off the lines")
        return found

    def _far(self, result: Trajectory, targets: Targets) -> float:
        """Largest error [m] or [rad] against the nearest place of the line that each tick belongs to."""
        poses = [target.pose if isinstance(target, FreeAxis) else target for target in targets]
        worst = part = 0.0
        line = 0
        for q, segment in zip(result.q, result.segment.tolist(), strict=True):
            position, rotation = self._tool(q)
            if segment > line:
                line, part = segment, 0.0
            start, end = poses[line], poses[line + 1]
            way, turn = end.translation - start.translation, pin.log3(start.rotation.T @ end.rotation)
            gone = position - start.translation
            now = float(gone @ way / (way @ way))
            wanted = start.rotation @ pin.exp3(now * turn)
            if isinstance(targets[line], FreeAxis):
                axis = targets[line].axis
                tilt = float(np.linalg.norm(np.cross(rotation @ axis, wanted @ axis)))
            else:
                tilt = float(np.linalg.norm(pin.log3(wanted.T @ rotation)))
            off = float(np.linalg.norm(gone - now * way))
            back = max(part - now, now - 1.0) * float(np.linalg.norm(way))
            worst, part = max(worst, off, tilt, back), now
        for k in (0, -1):
            worst = max(worst, float(np.linalg.norm(self._tool(result.q[k])[0] - poses[k].translation)))
        return worst

    def _tool(self, q: Array) -> tuple[Array, Array]:
        self._data.qpos[:] = q
        mujoco.mj_kinematics(self._model, self._data)
        return self._data.site_xpos[self._site].copy(), self._data.site_xmat[self._site].reshape(3, 3).copy()


class Surveyor:
    """Distances of a bundled arm to boxes, by Pinocchio's reader of the URDF and Coal."""

    def __init__(self, name: str, boxes: list[tuple[Array, Array]]) -> None:
        """Read the shapes; boxes are edge lengths (3,) and centres (3,) [m]."""
        path = str(jacokin.model.urdf_folder() / f"{name}.urdf")
        self._robot = jacokin.load_robot(name)
        self._model = pin.buildModelFromUrdf(path)
        self._shapes = pin.buildGeomFromUrdf(self._model, path, pin.GeometryType.COLLISION)
        self._boxes = [(coal.Box(*size), coal.Transform3s(np.eye(3), centre)) for size, centre in boxes]

    def least(self, rows: Array) -> float:
        """The smallest distance of all rows (n, dof) [m]."""
        data, geometry = self._model.createData(), self._shapes.createData()
        request, found = coal.DistanceRequest(), np.inf
        for q in rows:
            pin.updateGeometryPlacements(self._model, data, self._shapes, geometry, self._full(q))
            for shape, placed in zip(self._shapes.geometryObjects, geometry.oMg, strict=True):
                if self._model.frames[shape.parentFrame].parentJoint == 0:
                    continue  # the base stands where it stands
                at = coal.Transform3s(placed.rotation, placed.translation)
                for box, place in self._boxes:
                    result = coal.DistanceResult()
                    found = min(found, coal.distance(shape.geometry, at, box, place, request, result))
        return float(found)

    def _full(self, q: Array) -> Array:
        """The configuration of the whole model: continuous joints as cosine and sine, fingers where they are locked."""
        robot, model = self._robot, self._model
        full: Array = pin.neutral(model)
        for number, joint in enumerate(model.joints.tolist()[1:], start=1):
            name = model.names[number]
            index = robot.joint_names.index(name) if name in robot.joint_names else None
            angle = float(robot.finger_angle or 0.0) if index is None else float(q[index])
            if index is None and "tip" in name:
                angle = 0.0
            full[joint.idx_q : joint.idx_q + joint.nq] = [np.cos(angle), np.sin(angle)] if joint.nq == 2 else [angle]
        return full
