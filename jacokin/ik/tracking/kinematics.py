"""Frames and Jacobians of the arm, at one configuration at a time."""

from __future__ import annotations

from typing import Any

import pinocchio as pin

from jacokin.arrays import Array
from jacokin.errors import InvalidInputError
from jacokin.model.robot import Robot

TOOL_FRAME = "jacokin_tool"


class Kinematics:
    """The arm with a tool frame.

    Attributes:
        tool: number of the tool frame.
    """

    def __init__(self, robot: Robot, joint: int, T_joint_tool: pin.SE3) -> None:
        """Add the tool frame to a copy of the robot's model.

        Args:
            robot: the arm.
            joint: Pinocchio's number of the joint that carries the tool.
            T_joint_tool: pose of the tool there.
        """
        self._robot = robot
        self._model = pin.Model(robot.pin_model)
        self.tool: int = self._model.addFrame(pin.Frame(TOOL_FRAME, joint, T_joint_tool, pin.FrameType.OP_FRAME))
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
        number = self._robot.frame_id(name)
        if self._model.frames[number].parentJoint == 0:
            raise InvalidInputError(f"frame {name!r} is fixed to the base and cannot follow a target")
        return number

    def pose(self, frame: int) -> pin.SE3:
        """T_base_frame; changes with the next `move_to`."""
        return pin.updateFramePlacement(self._model, self._data, frame)

    def jacobian(self, frame: int, reference: pin.ReferenceFrame) -> Array:
        """(6, dof) linear rows [m/rad], then angular ones."""
        jacobian: Array = pin.getFrameJacobian(self._model, self._data, frame, reference)
        return jacobian.reshape(6, -1)  # one joint gives six numbers without a second axis
