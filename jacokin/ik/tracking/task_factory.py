"""From the targets of a tick to tasks on the sites of the MuJoCo twin."""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from jacokin.errors import InvalidInputError
from jacokin.ik import targets
from jacokin.ik.tracking.targets import (
    AxisTarget,
    OrientationTarget,
    PoseTarget,
    PositionTarget,
    RegionTarget,
    TrackingTarget,
)
from jacokin.ik.tracking.tasks import AxisTask, PoseTask, PositionTask, RegionTask, Task
from jacokin.model import poses
from jacokin.model.robot import Robot

TOOL_SITE = "jacokin_tool"
RIGID = 1e-9  # a pose this near to rigid is used as it is; others are checked and made rigid


class TaskFactory:
    """Makes tasks; the one for a plain pose is built once."""

    def __init__(self, robot: Robot, model: mujoco.MjModel) -> None:
        """Find the tool's site."""
        self._robot = robot
        self._model = model
        self._tool = int(model.site(TOOL_SITE).id)
        self._pose = PoseTask(self._tool, 1.0, TOOL_SITE)

    def tasks(self, target: pin.SE3 | ArrayLike | TrackingTarget | Sequence[TrackingTarget] | None) -> list[Task]:
        """Tasks for what `Tracker.step` takes; errors as there."""
        if isinstance(target, pin.SE3):
            self._pose.set(target if _rigid(target) else poses.checked_pose(target))
            return [self._pose]
        if isinstance(target, TrackingTarget):
            return [self._task(target)]
        if isinstance(target, list | tuple) and any(isinstance(one, TrackingTarget) for one in target):
            return [self._task(one) for one in target]
        checked = targets.checked(target)  # refuses what is neither a pose nor a position
        if checked.position_only:
            return [self._task(PositionTarget(checked.position))]
        self._pose.set(pin.SE3(checked.rotation, checked.position))
        return [self._pose]

    def tool_pose(self, data: mujoco.MjData) -> pin.SE3:
        """T_base_tool."""
        return pin.SE3(data.site_xmat[self._tool].reshape(3, 3).copy(), data.site_xpos[self._tool].copy())

    def _task(self, target: TrackingTarget) -> Task:
        if not isinstance(target, TrackingTarget):
            raise InvalidInputError(
                f"several targets must each be a PoseTarget, PositionTarget, ..., got {type(target).__name__}"
            )
        site = self._site(target.frame)
        match target:
            case PoseTarget(pose=pin.SE3() as pose):
                task = PoseTask(site, target.weight, target.frame or TOOL_SITE)
                task.set(pose)
                return task
            case OrientationTarget():
                task = PoseTask(site, target.weight, target.frame or TOOL_SITE, orientation_only=True)
                task.set(pin.SE3(np.asarray(target.rotation), np.zeros(3)))
                return task
            case PositionTarget():
                return PositionTask(site, target.weight, np.asarray(target.position))
            case AxisTarget():
                return AxisTask(site, target.weight, np.asarray(target.axis), np.asarray(target.direction))
            case RegionTarget():
                return RegionTask(site, target.weight, np.asarray(target.lower), np.asarray(target.upper))
        raise InvalidInputError(f"unknown kind of target {type(target).__name__}")

    def _site(self, frame: str | None) -> int:
        if frame is None:
            return self._tool
        if self._robot.pin_model.frames[self._robot.frame_id(frame)].parentJoint == 0:
            raise InvalidInputError(f"frame {frame!r} is fixed to the base and cannot follow a target")
        return int(self._model.site(frame).id)


def _rigid(pose: pin.SE3) -> bool:
    """Whether a pose is finite, right-handed and orthonormal to 1e-9; cheap, as every tick asks it."""
    (a, b, c), (d, e, f), (g, h, i) = pose.rotation.tolist()
    x, y, z = pose.translation.tolist()
    misfit: float = (
        abs(a * a + b * b + c * c - 1.0)
        + abs(d * d + e * e + f * f - 1.0)
        + abs(a * d + b * e + c * f)
        + abs(b * f - c * e - g)
        + abs(c * d - a * f - h)
        + abs(a * e - b * d - i)
    )
    return bool(misfit < RIGID and abs(x) + abs(y) + abs(z) < 1e9)
