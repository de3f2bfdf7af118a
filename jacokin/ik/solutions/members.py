"""`Members`: what configurations of one target have in common, however its set was found; each is verified."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from jacokin.arrays import Array
from jacokin.errors import JacokinError
from jacokin.ik.seeds import seed_within_limits
from jacokin.ik.solutions.track import CurveTrack
from jacokin.ik.targets import TargetPose
from jacokin.ik.verification import Candidate, Verifier
from jacokin.model import angles
from jacokin.model.angles import SNAP, TURN
from jacokin.model.robot import Robot

#: [m] and [rad]; members of curves close this well.
MEMBER_CLOSURE = 1e-9
#: [m] and [rad]; the same where curves meet on limits, where that is not to be had.
LARGEST_MISS = 1e-7
#: Gauss-Newton steps for what closes worse, and the relative size of motions that they leave out. Where joints are on
#: limits and curves meet, each halves what is left.
SETTLING_STEPS, NO_MOTION = 16, 1e-4
#: [m] and [rad] where they end.
SETTLED = 1e-13


class LostMemberError(JacokinError):
    """A point of a curve that does not reach the target within the limits, though both ends of its piece do."""


@dataclass(frozen=True, slots=True, eq=False)
class Members:
    """One target of one arm."""

    verifier: Verifier
    index: int | None
    """Which joint is the parameter; None for a free axis, and at a pose of six joints."""
    target: TargetPose
    seed: Array
    """(dof,) unlimited joints take the 2 pi copy nearest to this [rad]."""

    @property
    def robot(self) -> Robot:
        """The arm."""
        return self.verifier.robot

    def parameter(self, q: Array) -> float:
        """The parameter [rad] of a configuration (dof,)."""
        free = self.target.free_axis
        if free is not None:
            return free.parameter_of(self.verifier.tool_pose(q).rotation)
        return math.nan if self.index is None else float(q[self.index])

    def candidate(self, q: Array, parameter: float) -> Candidate:
        """A member (dof,) in the copies that are wanted, with its parameter [rad] in the range of the target."""
        free = self.target.free_axis
        if free is None:
            p = self.parameter(q)  # the joint itself, in its copy
        else:
            p = float(angles.wrap_to_pi(parameter)) if free.full_turn else self.target.nearest_angle(parameter)
        return Candidate(q, self.target.at(p), f"parameter {p:.6g} rad", p)

    def near(self, seed: ArrayLike | None) -> Array:
        """A seed (dof,) moved inside the limits [rad]; None for the seed of the set.

        Raises:
            InvalidInputError: malformed, or more than 1e6 rad from zero.
        """
        return self.seed if seed is None else seed_within_limits(self.robot, seed)[0]

    def copies(self, q: Array, seed: Array) -> Array:
        """(..., dof) the copies within the limits nearest to a seed (dof,)."""
        return angles.into_limits(angles.nearest_copy(q, seed), self.robot.lower, self.robot.upper)

    def on_limits(self, q: Array) -> Array:
        """A configuration (dof,) moved onto the limits it is past by rounding.

        NaN where a joint that has more than a turn of room is farther outside: others end their interval there.
        """
        inside = np.clip(q, self.robot.lower, self.robot.upper)
        far = np.abs(inside - q) > self.verifier.options.limit_snap
        return np.full(len(q), np.nan) if (far & self.wide).any() else inside

    @property
    def wide(self) -> NDArray[np.bool_]:
        """(dof,) limited joints that have several copies of some angles within their limits."""
        room = self.robot.upper - self.robot.lower
        return np.isfinite(room) & (room >= TURN)

    def are_copies(self, q: Array) -> bool:
        """Whether joints of q (dof,) that have several copies within their limits are in one of those, but for SNAP."""
        return bool(((q >= self.robot.lower - SNAP) & (q <= self.robot.upper + SNAP))[self.wide].all())

    def verified(self, q: Array, parameter: float) -> Array:
        """A configuration (dof,) that reaches the target and is within the limits, exactly.

        Raises:
            LostMemberError: it does not, which is not known to happen but where curves meet on a limit.
        """
        errors = self.verifier.measure(q, self.target.at(parameter))
        if max(errors) > MEMBER_CLOSURE:  # a joint that is near its limit all along, moved onto it
            q = self._settled(q, parameter)
            errors = self.verifier.measure(q, self.target.at(parameter))
        if max(errors) > LARGEST_MISS or not self.robot.within_limits(q):
            raise LostMemberError(
                f"internal error: a member of a curve misses its target by {errors[0]:.3g} m and "
                f"{errors[1]:.3g} rad, please report it"
            )
        return q

    def on_track(self, track: CurveTrack, parameter: float, q: Array, seed: Array) -> Array:
        """A configuration (dof,) of a track, in the copies nearest to a seed (dof,), verified; or the one beside it.

        Raises:
            LostMemberError: there is none anywhere near.
        """
        try:
            return self.verified(self.copies(q, seed), parameter)
        except LostMemberError as error:
            lost = error
        p, rows = track.polyline()
        for index in np.argsort(np.abs(p - parameter), kind="stable").tolist():
            try:
                return self.verified(self.copies(rows[index], seed), float(p[index]))
            except LostMemberError as error:
                lost = error
        raise lost

    def _settled(self, q: Array, parameter: float) -> Array:
        """A configuration (dof,) brought nearer to the target by the joints that are not on a limit."""
        robot, pose = self.robot, self.target.at(parameter)
        held = (q == robot.lower) | (q == robot.upper)
        goal = pin.SE3(pose.rotation, pose.position)
        for _ in range(SETTLING_STEPS):
            error = pin.log6(self.verifier.tool_pose(q).actInv(goal)).vector
            if np.abs(error).max() < SETTLED:
                break
            moving = np.where(held, 0.0, robot.jacobian(q, frame=self.verifier.frame, reference="local"))
            if self.verifier.tool is not None:
                moving = self.verifier.tool.toActionMatrixInverse() @ moving
            q = q + np.linalg.pinv(moving, rcond=NO_MOTION) @ error
        return self.copies(q, q)
