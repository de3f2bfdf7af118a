"""What the tracker can be asked for: poses, parts of poses and regions, on any frame, with weights.

Each target constrains one frame; `Tracker.step` takes one of them or several at once. All are in the base frame. The
kernels take them as rows, see `jacokin.kernels.tracking.tasks`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from jacokin.arrays import Array, Sealed
from jacokin.errors import InvalidInputError
from jacokin.ik import targets
from jacokin.ik.targets import RADIAN_IN_METRES
from jacokin.kernels.tracking.tasks import (
    DIRECTION,
    FRAME,
    GOAL,
    JOINTS,
    KIND,
    LINK,
    ORIENTATION,
    PLACEMENT,
    POSE,
    POSITION,
    REGION,
    TURN_WEIGHT,
    WEIGHT,
    TaskRows,
    make_task_rows,
)
from jacokin.model import checks, poses
from jacokin.model.contact_arrays import joints_about_z
from jacokin.model.kinematics import about_z
from jacokin.model.robot import Robot

IN_BASE = pin.LOCAL_WORLD_ALIGNED  # at the frame's origin, axes of the base


@dataclass(frozen=True, slots=True, eq=False)
class TrackingTarget(targets.PartialTarget, Sealed):
    """What all targets share.

    Attributes:
        frame: the frame it is for; None for the tracker's own frame (with its tool).
        weight: how much it counts against other targets of the same priority, > 0.
        priority: 0 comes first. Targets of the next number use what freedom is left, and cost those before nothing.
    """

    frame: str | None = field(default=None, kw_only=True)
    weight: float = field(default=1.0, kw_only=True)
    priority: int = field(default=0, kw_only=True)

    def __post_init__(self) -> None:
        """Check weight and priority."""
        object.__setattr__(self, "weight", checks.positive("weight", self.weight))
        object.__setattr__(self, "priority", checks.whole_number("priority", self.priority))

    def fill(self, row: TaskRow) -> None:
        """Write to the row of the task what is asked for."""
        raise InvalidInputError(f"unknown kind of target {type(self).__name__}")


@poses.giving_copies("pose")
@dataclass(frozen=True, slots=True, eq=False)
class PoseTarget(TrackingTarget):
    """Position and orientation: T_base_frame as `pin.SE3` or (4, 4)."""

    pose: pin.SE3 | ArrayLike

    def __post_init__(self) -> None:
        """Check the pose."""
        TrackingTarget.__post_init__(self)
        object.__setattr__(self, "pose", poses.checked_pose(self.pose, "pose"))

    def constraint(self) -> targets.Constraint:
        """Position and orientation."""
        assert isinstance(self.pose, pin.SE3)  # __post_init__ made it one
        return targets.Constraint(position=self.pose.translation.copy(), rotation=self.pose.rotation.copy())

    def fill(self, row: TaskRow) -> None:
        """Position and orientation."""
        assert isinstance(self.pose, pin.SE3)  # __post_init__ made it one
        row.set(POSE, self.pose.homogeneous[:3].ravel())


@dataclass(frozen=True, slots=True, eq=False)
class PositionTarget(TrackingTarget):
    """Position (3,) [m]; the orientation is free."""

    position: ArrayLike

    def __post_init__(self) -> None:
        """Check the position."""
        TrackingTarget.__post_init__(self)
        object.__setattr__(self, "position", checks.read_only(checks.vector("position", self.position, 3, "m")))

    def constraint(self) -> targets.Constraint:
        """The position."""
        return targets.Constraint(position=np.asarray(self.position))

    def fill(self, row: TaskRow) -> None:
        """Position alone."""
        row.set(POSITION, np.asarray(self.position))


@dataclass(frozen=True, slots=True, eq=False)
class OrientationTarget(TrackingTarget):
    """Orientation (3, 3); the position is free."""

    rotation: ArrayLike

    def __post_init__(self) -> None:
        """Check the rotation."""
        TrackingTarget.__post_init__(self)
        object.__setattr__(self, "rotation", checks.read_only(poses.checked_rotation("rotation", self.rotation)))

    def constraint(self) -> targets.Constraint:
        """The orientation."""
        return targets.Constraint(rotation=np.asarray(self.rotation))

    def fill(self, row: TaskRow) -> None:
        """Orientation alone."""
        row.set(ORIENTATION, np.column_stack([np.asarray(self.rotation), np.zeros(3)]).ravel())


@dataclass(frozen=True, slots=True, eq=False)
class AxisTarget(TrackingTarget):
    """One axis of the frame points in a direction; the rotation about it and the position are free.

    Attributes:
        direction: (3,) where the axis is to point, in the base frame; any length but zero.
        axis: (3,) the axis, in the frame; the z axis unless told otherwise.
    """

    direction: ArrayLike
    axis: ArrayLike = (0.0, 0.0, 1.0)

    def __post_init__(self) -> None:
        """Check and normalise both vectors."""
        TrackingTarget.__post_init__(self)
        object.__setattr__(self, "direction", checks.read_only(poses.unit_vector("direction", self.direction)))
        object.__setattr__(self, "axis", checks.read_only(poses.unit_vector("axis", self.axis)))

    def constraint(self) -> targets.Constraint:
        """The direction of the axis."""
        return targets.Constraint(axis=np.asarray(self.axis), direction=np.asarray(self.direction))

    def fill(self, row: TaskRow) -> None:
        """Two directions aligned."""
        row.set(DIRECTION, np.concatenate([np.asarray(self.axis), np.asarray(self.direction)]))


@dataclass(frozen=True, slots=True, eq=False)
class RegionTarget(TrackingTarget):
    """The position stays in a box along the base's axes; inside it, the position is free.

    Attributes:
        lower: (3,) corner with the least coordinates [m]; -inf for no bound.
        upper: (3,) corner with the largest coordinates [m]; inf for no bound.
    """

    lower: ArrayLike
    upper: ArrayLike

    def __post_init__(self) -> None:
        """Check the corners."""
        TrackingTarget.__post_init__(self)
        corners = []
        for name in ("lower", "upper"):
            value = getattr(self, name)
            corner = checks.read_only(checks.array(name, value, "3 numbers", "m"))
            if corner.shape != (3,) or np.isnan(corner).any():
                raise checks.refusal(name, "3 numbers", value, "m")
            object.__setattr__(self, name, corner)
            corners.append(corner)
        if not (corners[0] <= corners[1]).all():
            raise InvalidInputError(f"lower {corners[0].tolist()} must not exceed upper {corners[1].tolist()}")

    def fill(self, row: TaskRow) -> None:
        """Position in the box."""
        row.set(REGION, np.concatenate([np.asarray(self.lower), np.asarray(self.upper)]))


@dataclass(frozen=True, slots=True, eq=False)
class JointTarget(TrackingTarget):
    """Joint angles (dof,) [rad]; unlimited joints turn as far as the numbers say. It takes no `frame`."""

    q: ArrayLike

    def __post_init__(self) -> None:
        """Check the angles, whose number the tracker checks."""
        TrackingTarget.__post_init__(self)
        if self.frame is not None:
            raise InvalidInputError("a JointTarget is for all joints and takes no frame")
        array = checks.array("q", self.q, "joint angles", "rad")
        object.__setattr__(self, "q", checks.read_only(checks.vector("q", array, max(array.size, 1), "rad")))

    def fill(self, row: TaskRow) -> None:
        """Every joint at its angle."""
        row.set(JOINTS, np.empty(0))
        row.joints[:] = self.q


class TaskRow(NamedTuple):
    """One task as the kernels take it."""

    integers: NDArray[np.int64]
    numbers: Array
    joints: Array

    def set(self, kind: int, goal: Array) -> None:
        """Say what it is and where to."""
        self.integers[KIND] = kind
        self.numbers[GOAL : GOAL + goal.size] = goal


class Tasks(NamedTuple):
    """What a tick is asked for, in order of priority."""

    rows: TaskRows
    number: int
    """How many there are."""
    first: int
    """How many of them are of the first priority."""
    priorities: tuple[int, ...] = ()
    """Of each; empty where all have one."""
    pose: Array | None = None
    """(4, 4) that the only one is for, not looked at yet; None where the rows say it."""


class TaskFactory:
    """Makes tasks from what `Tracker.step` takes."""

    def __init__(self, kinematics: Kinematics) -> None:
        """Keep the kinematics for its frames."""
        self._kinematics, self._dof = kinematics, kinematics.robot.dof
        # Of frames that targets were for: link, number, and placement on the link (12,).
        self._places: dict[str | None, tuple[int, int, Array]] = {}
        self._tool = self._rows(1)
        self._place(TaskRow(self._tool.integers[0], self._tool.numbers[0], self._tool.joints), None, 1.0)
        self.nothing = Tasks(self._rows(0), 0, 0)

    def tasks(self, target: pin.SE3 | ArrayLike | TrackingTarget | Sequence[TrackingTarget] | None) -> Tasks:
        """Tasks for a target or several; errors as in `Tracker.step`."""
        matrix = target.homogeneous if isinstance(target, pin.SE3) else targets.pose_matrix(target)
        if matrix is not None:
            return Tasks(self._tool, 1, 1, pose=matrix)  # the kernel finds out whether it is rigid
        if isinstance(target, TrackingTarget):
            return self._all([target])
        if isinstance(target, list | tuple) and any(isinstance(one, TrackingTarget) for one in target):
            return self._all(target)
        checked = targets.checked_target(target)  # refuses what is neither a pose nor a position
        if checked.position_only:
            return self._all([PositionTarget(checked.position)])
        return Tasks(self._tool, 1, 1, pose=checked.matrix)

    def _rows(self, count: int) -> TaskRows:
        return make_task_rows(self._dof, count)

    def _all(self, given: Sequence[TrackingTarget]) -> Tasks:
        """Tasks for targets."""
        for target in given:
            if not isinstance(target, TrackingTarget):
                raise InvalidInputError(
                    f"several targets must each be a PoseTarget, PositionTarget, ..., got {type(target).__name__}"
                )
        ordered = sorted(given, key=lambda target: target.priority)
        rows = self._rows(len(ordered))
        joints = rows.joints.reshape(len(ordered), self._dof)
        for number, target in enumerate(ordered):
            if isinstance(target, JointTarget):
                self._kinematics.robot.configuration(target.q, "JointTarget")
            row = TaskRow(rows.integers[number], rows.numbers[number], joints[number])
            self._place(row, target.frame, target.weight)
            target.fill(row)
        priorities = tuple(target.priority for target in ordered)
        return Tasks(rows, len(ordered), priorities.count(priorities[0]), priorities)

    def _place(self, row: TaskRow, frame: str | None, weight: float) -> None:
        """Write the frame and the weights."""
        try:
            link, number, placement = self._places[frame]
        except (KeyError, TypeError):  # not asked for before, or not a name
            number = self._kinematics.frame(frame)
            link, T_link_frame = self._kinematics.on_link(number)
            placement = T_link_frame.homogeneous[:3].ravel()
            self._places[frame] = link, number, placement
        row.integers[LINK], row.integers[FRAME] = link, number
        row.numbers[WEIGHT], row.numbers[TURN_WEIGHT] = weight, weight * RADIAN_IN_METRES
        row.numbers[PLACEMENT:GOAL] = placement


class Kinematics:
    """The arm with a tool frame.

    Attributes:
        robot: the arm.
        tool: number of the tool frame.
    """

    def __init__(self, robot: Robot, frame: str, tool: pin.SE3 | None) -> None:
        """Add the tool frame to a copy of the robot's model.

        Args:
            robot: the arm.
            frame: the frame that carries the tool.
            tool: T_frame_tool; None for the frame itself.

        Raises:
            UnknownNameError: no such frame.
            InvalidInputError: it is fixed to the base.
        """
        self.robot = robot
        self._model = pin.Model(robot.pin_model)
        carrier = self._model.frames[self.frame(frame)]
        placement = carrier.placement if tool is None else carrier.placement * tool
        self.tool: int = self._model.addFrame(
            pin.Frame("jacokin_tool", carrier.parentJoint, placement, pin.FrameType.OP_FRAME)
        )
        self._data = self._model.createData()
        self._computed: Array | None = None

    def __getstate__(self) -> dict[str, Any]:
        """Everything but what was computed last."""
        return {**self.__dict__, "_computed": None}

    def move_to(self, q: Array) -> None:
        """Compute the joints' poses and Jacobian at a configuration (dof,) [rad], unless it was the last one.

        Arrays are told apart by identity: `q` must not change afterwards.
        """
        if self._computed is q:
            return
        self._computed = None  # until it is done
        pin.computeJointJacobians(self._model, self._data, q)
        self._computed = q

    def frame(self, name: str | None) -> int:
        """Number of a frame; None for the tool.

        Raises:
            UnknownNameError: no such frame.
            InvalidInputError: it is fixed to the base.
        """
        if name is None:
            return self.tool
        number = self.robot.frame_id(name)
        if self._model.frames[number].parentJoint == 0:
            moving = [n for n in self.robot.frames if self._model.frames[self.robot.frame_id(n)].parentJoint > 0]
            raise InvalidInputError(f"frame {name!r} is fixed to the base and cannot follow a target; {moving} move")
        return number

    def on_link(self, frame: int) -> tuple[int, pin.SE3]:
        """The joint that carries a frame, counted from 1, and the frame on its link as the kernels have it."""
        found = self._model.frames[frame]
        return int(found.parentJoint), about_z(self._model, found.parentJoint).inverse() * found.placement

    def joints(self) -> tuple[Array, list[int]]:
        """Placements (dof, 3, 4) of the joints as the kernels have them, and their kinds."""
        return joints_about_z(self._model)

    def pose(self, frame: int) -> pin.SE3:
        """T_base_frame; changes with the next `move_to`."""
        return pin.updateFramePlacement(self._model, self._data, frame)

    def jacobian(self, frame: int, reference: pin.ReferenceFrame) -> Array:
        """(6, dof) linear rows [m/rad], then angular ones."""
        jacobian: Array = pin.getFrameJacobian(self._model, self._data, frame, reference)
        return jacobian.reshape(6, -1)  # one joint gives six numbers without a second axis
