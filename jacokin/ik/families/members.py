"""What all members of a family have in common: the arm, the target, the copies of angles; and their check."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from jacokin.arrays import Array
from jacokin.errors import JacokinError
from jacokin.ik.targets import TargetPose
from jacokin.ik.verification import Verifier
from jacokin.model import angles
from jacokin.model.pose_targets import FreeAxis
from jacokin.model.robot import Robot

#: [m] and [rad]; members of a family close this well.
MEMBER_CLOSURE = 1e-9
#: Gauss-Newton steps for what closes worse, and the relative size of motions that they leave out.
SETTLING_STEPS, NO_MOTION = 4, 1e-4


@dataclass(frozen=True, slots=True, eq=False)
class Members:
    """One target of one arm."""

    verifier: Verifier
    target: FreeAxis | TargetPose
    seed: Array
    """(dof,) unlimited joints take the 2 pi copy nearest to this [rad]."""

    @property
    def robot(self) -> Robot:
        """The arm."""
        return self.verifier.robot

    def pose_at(self, parameter: float) -> TargetPose:
        """What the tool is brought to where the parameter has a value [rad]."""
        if isinstance(self.target, TargetPose):
            return self.target
        return TargetPose(self.target.matrix_at(parameter), position_only=False)

    def parameter(self, q: Array) -> float:
        """The parameter [rad] of a configuration (dof,)."""
        if isinstance(self.target, TargetPose):
            return float(q[2])
        return self.target.parameter_of(self.verifier.tool_pose(q).rotation)

    def copies(self, q: Array, seed: Array) -> Array:
        """(..., dof) the copies within the limits nearest to a seed (dof,)."""
        return angles.into_limits(angles.nearest_copy(q, seed), self.robot.lower, self.robot.upper)

    def verified(self, q: Array, parameter: float) -> Array:
        """A configuration (dof,) that reaches the target and is within the limits, exactly.

        Raises:
            JacokinError: it does not, which cannot happen.
        """
        errors = self.verifier.measure(q, self.pose_at(parameter))
        if max(errors) > MEMBER_CLOSURE:  # a joint that is near its limit all along, moved onto it
            q = self._settled(q, parameter)
            errors = self.verifier.measure(q, self.pose_at(parameter))
        if max(errors) > MEMBER_CLOSURE or not self.robot.within_limits(q):
            raise JacokinError(
                f"internal error: a member of a family misses its target by {errors[0]:.3g} m and "
                f"{errors[1]:.3g} rad, please report it"
            )
        return q

    def _settled(self, q: Array, parameter: float) -> Array:
        """A configuration (dof,) brought nearer to the target by the joints that are not on a limit."""
        robot, pose = self.robot, self.pose_at(parameter)
        held = (q == robot.lower) | (q == robot.upper)
        goal = pin.SE3(pose.rotation, pose.position)
        for _ in range(SETTLING_STEPS):
            error = pin.log6(self.verifier.tool_pose(q).actInv(goal)).vector
            moving = np.where(held, 0.0, robot.jacobian(q, frame=self.verifier.frame, reference="local"))
            if self.verifier.tool is not None:
                moving = self.verifier.tool.toActionMatrixInverse() @ moving
            q = q + np.linalg.pinv(moving, rcond=NO_MOTION) @ error
        return self.copies(q, q)
