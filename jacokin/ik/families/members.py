"""What all members of a family have in common: the arm, the target, the copies of angles; and their check."""

from __future__ import annotations

from dataclasses import dataclass

from jacokin.arrays import Array
from jacokin.errors import JacokinError
from jacokin.ik.targets import TargetPose
from jacokin.ik.verification import Verifier
from jacokin.model import angles
from jacokin.model.pose_targets import FreeAxis
from jacokin.model.robot import Robot

#: [m] and [rad]; members of a family close this well.
MEMBER_CLOSURE = 1e-9


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
        if max(errors) > MEMBER_CLOSURE or not self.robot.within_limits(q):
            raise JacokinError(
                f"internal error: a member of a family misses its target by {errors[0]:.3g} m and "
                f"{errors[1]:.3g} rad, please report it"
            )
        return q
