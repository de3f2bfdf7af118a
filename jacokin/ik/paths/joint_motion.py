"""From one joint configuration to another in the least time, within velocity, acceleration and jerk limits.

The time profile is Ruckig's (extra ``motion``): all joints start and stop together, at rest on both ends, and no joint
leaves the interval between its two ends.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from jacokin.arrays import Array
from jacokin.errors import InvalidInputError, MissingExtraError
from jacokin.ik.tracking.joint_limits import velocity_limits
from jacokin.model import angles, checks
from jacokin.model.robot import Robot

ACCELERATION = 1.0  # [rad/s^2] full speed in about 0.7 s; the maker publishes no figure, so this is a gentle guess


@dataclass(frozen=True, slots=True, eq=False)
class JointMotion:
    """A motion between two configurations, sampled. Arrays are read-only."""

    t: Array
    """(n,) time [s], from 0; the last row is the end of the motion."""
    q: Array
    """(n, dof) joint angles [rad]."""
    v: Array
    """(n, dof) velocities [rad/s]."""
    a: Array
    """(n, dof) accelerations [rad/s^2]."""

    @property
    def duration(self) -> float:
        """Length of the motion [s]."""
        return float(self.t[-1])

    def __len__(self) -> int:
        """Number of rows."""
        return len(self.t)


def move_joints(
    robot: Robot,
    q_from: ArrayLike,
    q_to: ArrayLike,
    *,
    dt: float = 0.01,
    velocity_limit: ArrayLike | None = None,
    acceleration_limit: ArrayLike = ACCELERATION,
    jerk_limit: ArrayLike | None = None,
) -> JointMotion:
    """The fastest motion from rest to rest, joints in step; free joints take the short way round.

    Args:
        robot: the arm.
        q_from: (dof,) where the arm is [rad].
        q_to: (dof,) where it goes [rad]; on free joints the 2 pi copy nearest to `q_from` is taken.
        dt: sampling step [s]; the last row is at the end of the motion, whole step or not.
        velocity_limit: (dof,) or one for all [rad/s]; None for the robot's own.
        acceleration_limit: (dof,) or one for all [rad/s^2].
        jerk_limit: (dof,) or one for all [rad/s^3]; None for none.

    Returns:
        The sampled motion. Shapes are not looked at: check it for collisions.

    Raises:
        InvalidInputError: a configuration outside the limits, or a number that is malformed or not positive.
        MissingExtraError: Ruckig is not installed.
    """
    if not isinstance(robot, Robot):
        raise InvalidInputError(f"robot must be a jacokin.Robot (see load_robot), got {type(robot).__name__}")
    step = checks.positive("dt", dt, "s")
    start, end = (_legal(robot, q, name) for q, name in ((q_from, "q_from"), (q_to, "q_to")))
    end = angles.nearest_copy(end, start, robot.unlimited)
    velocity = velocity_limits(robot, velocity_limit)
    acceleration = checks.positive_vector("acceleration_limit", acceleration_limit, robot.dof, "rad/s^2")
    jerk = None if jerk_limit is None else checks.positive_vector("jerk_limit", jerk_limit, robot.dof, "rad/s^3")
    try:
        import ruckig
    except ImportError:
        raise MissingExtraError("ruckig", "motion") from None

    given = ruckig.InputParameter(robot.dof)
    given.current_position, given.target_position = start.tolist(), end.tolist()
    given.max_velocity, given.max_acceleration = velocity.tolist(), acceleration.tolist()
    if jerk is not None:
        given.max_jerk = jerk.tolist()
    trajectory = ruckig.Trajectory(robot.dof)
    result = ruckig.Ruckig(robot.dof).calculate(given, trajectory)
    if result not in (ruckig.Result.Working, ruckig.Result.Finished):
        raise InvalidInputError(f"no motion found within these limits ({result.name}): are they of sensible size?")
    whole = np.arange(0.0, trajectory.duration, step)
    times = np.append(whole, trajectory.duration) if trajectory.duration > 0.0 else np.zeros(1)
    rows = [trajectory.at_time(float(time)) for time in times]
    q, v, a = (np.array(column) for column in zip(*rows, strict=True))
    # Rounding may pass the ends by one unit in the last place, and an end may be a limit.
    q = np.clip(q, np.minimum(start, end), np.maximum(start, end))
    q[0], q[-1] = start, end
    return JointMotion(*map(checks.read_only, (times, q, v, a)))


def _legal(robot: Robot, q: ArrayLike, name: str) -> Array:
    """A configuration inside the limits.

    Raises:
        InvalidInputError: malformed, or a joint is outside; it is named.
    """
    angles = robot.configuration(q, name)
    outside = np.flatnonzero((angles < robot.lower) | (angles > robot.upper))
    if outside.size:
        joint = int(outside[0])
        raise InvalidInputError(
            f"{name} puts {robot.joint_names[joint]} at {angles[joint]:.17g} rad, outside "
            f"[{robot.lower[joint]:.17g}, {robot.upper[joint]:.17g}]"
        )
    return angles
