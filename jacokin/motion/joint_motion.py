"""From one joint configuration to another in the least time, within velocity, acceleration and jerk limits.

The time profile is Ruckig's (extra ``motion``): all joints start and stop together, at rest on both ends, and no joint
leaves the interval between its two ends.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from jacokin.arrays import Array
from jacokin.errors import InvalidInputError, needed
from jacokin.ik.seeds import checked_start
from jacokin.model import angles, checks
from jacokin.model.robot import Robot, acceleration_limits, checked_robot, jerk_limits, velocity_limits
from jacokin.motion.rows import Limits, OnTheWay, Rows, coarse, from_rest_to_rest, halved
from jacokin.motion.timing import MAX_TICKS, TooHeavy, slow_down, torque_limits, torque_strain
from jacokin.motion.trajectory import MotionStatus, Trajectory

if TYPE_CHECKING:
    import ruckig


ACCELERATION = 1.0  # [rad/s^2] full speed in about 0.7 s; the maker publishes no figure, so this is a gentle guess
USED = 1.0 - 1e-9  # of the limits along lines; what remains is for rounding
MISSED = 1e-6  # [rad] a motion that ends farther from its goal is not one


def move_joints(
    robot: Robot,
    q_from: ArrayLike,
    q_to: ArrayLike,
    *,
    dt: float = 0.01,
    velocity_limit: ArrayLike | None = None,
    acceleration_limit: ArrayLike = ACCELERATION,
    jerk_limit: ArrayLike | None = None,
    torque_limit: ArrayLike | bool | None = None,
) -> Trajectory:
    """The fastest motion from rest to rest, joints in step; unlimited joints take the short way round.

    Args:
        robot: the arm.
        q_from: (dof,) where the arm is [rad]; a joint that is outside its limits comes straight back.
        q_to: (dof,) where it goes [rad]; on unlimited joints the 2 pi copy nearest to `q_from` is taken.
        dt: step from row to row [s].
        velocity_limit: (dof,) or one for all [rad/s]; None for the robot's own.
        acceleration_limit: (dof,) or one for all [rad/s^2].
        jerk_limit: (dof,) or one for all [rad/s^3]; None for none.
        torque_limit: (dof,) or one for all [N m]; True for the robot's own (`effort_limit`), None for none. The whole
            motion is slowed down until no joint needs more, what the robot carries (`Robot.with_payload`) included.

    Returns:
        The motion in whole steps, two more than the least time takes: its accelerations change steadily from row to
        row, so that limits hold as controllers go from one to the next. One row where the arm is already there. Shapes
        are not looked at: check it for collisions. Where gravity alone asks for more torque than the limits it stays at
        the start, and `outcome` and `message` say so.

    Raises:
        InvalidInputError: `q_to` outside the limits, or a number that is malformed or not positive.
        MissingExtraError: Ruckig is not installed.
    """
    checked_robot("robot", robot)
    step = checks.positive("dt", dt, "s")
    start, end = checked_start(robot, q_from, "q_from", outside=True), checked_start(robot, q_to, "q_to")
    end = angles.nearest_copy(end, start, robot.unlimited)
    velocity = velocity_limits(robot, velocity_limit)
    acceleration = acceleration_limits(robot, acceleration_limit)
    jerk = jerk_limits(robot, jerk_limit)
    torque = torque_limits(robot, torque_limit)
    fastest = Profile(start, end, velocity, acceleration, jerk)
    law = fastest if torque is None else slow_down(robot, fastest, torque)
    if isinstance(law, TooHeavy):
        still = np.zeros(1), start[None], np.zeros((1, robot.dof)), np.zeros((1, robot.dof))
        return Trajectory.of(robot, velocity, still, status=MotionStatus.TOO_HEAVY, message=law.explain(robot))
    duration = law.duration
    if not duration / step <= MAX_TICKS:
        raise InvalidInputError(f"the motion takes {duration:.6g} s: more than {MAX_TICKS} steps of {step:.6g} s")
    missed = float(np.abs(law.at(np.array([duration]))[0][-1] - end).max())
    if not missed <= MISSED:
        raise InvalidInputError(f"no motion found within these limits: it ends {missed:.3g} rad off")

    def at(times: Array) -> Array:
        """Rounding may pass the ends by one unit in the last place, and an end may be a limit."""
        q = np.clip(law.at(times)[0], np.minimum(start, end), np.maximum(start, end))
        q[0], q[-1] = start, end
        return q

    limits = Limits(velocity, acceleration, jerk)

    def strain(rows: Rows) -> float:
        worst = float(limits.strain(rows).max())
        return worst if torque is None else max(worst, torque_strain(robot, rows, torque))

    way, fault = OnTheWay(robot, None), ""
    for finer in halved(step):
        rows = from_rest_to_rest(at, duration, finer, strain)
        found = way.fault(rows)
        if not found:
            break
        fault = found
    message = f"reached in {rows.t[-1]:.4g} s{coarse(step, finer, fault)}" if duration else "already there"
    return Trajectory.of(robot, velocity, rows, message=message)


class Profile:
    """Ruckig's motion from rest to rest, all joints in step."""

    def __init__(self, start: Array, end: Array, velocity: Array, acceleration: Array, jerk: Array | None) -> None:
        """Time it within limits (dof,) in rad and s. Errors as of `profile`."""
        self._trajectory = profile(start, end, velocity, acceleration, jerk)

    @property
    def duration(self) -> float:
        """From start to end [s]."""
        return float(self._trajectory.duration)

    def at(self, t: Array) -> tuple[Array, Array, Array]:
        """Configurations (m, dof) [rad], velocities [rad/s] and accelerations [rad/s^2] at times (m,) [s]."""
        q, v, a = zip(*(self._trajectory.at_time(at) for at in t.tolist()), strict=True)
        return np.array(q), np.array(v), np.array(a)


def profile(start: Array, end: Array, velocity: Array, acceleration: Array, jerk: Array | None) -> ruckig.Trajectory:
    """Ruckig's trajectory from rest to rest, all joints in step; limits (dof,) in rad and s.

    Raises:
        InvalidInputError: Ruckig finds none; limits of very different or extreme sizes defeat its polynomials.
        MissingExtraError: Ruckig is not installed.
    """
    with needed("ruckig", "motion"):
        import ruckig
    given = ruckig.InputParameter(len(start))
    given.current_position, given.target_position = start.tolist(), end.tolist()
    given.max_velocity, given.max_acceleration = velocity.tolist(), acceleration.tolist()
    if jerk is not None:
        given.max_jerk = jerk.tolist()
    trajectory = ruckig.Trajectory(len(start))
    try:
        result = ruckig.Ruckig(len(start)).calculate(given, trajectory)
        reason = "" if result in (ruckig.Result.Working, ruckig.Result.Finished) else result.name
    except Exception:  # an error class of its own, and result codes that its enum does not have
        reason = "Ruckig failed"
    if reason:
        raise InvalidInputError(
            f"no motion found within these limits ({reason}); velocity_limit {_range(velocity)} rad/s, "
            f"acceleration_limit {_range(acceleration)} rad/s^2"
            + ("" if jerk is None else f", jerk_limit {_range(jerk)} rad/s^3")
        )
    return trajectory


class SmoothLines:
    """Straight lines one after another within limits of velocity, acceleration and jerk, at rest between them."""

    def __init__(self, way: Array, velocity: Array, acceleration: Array, jerk: Array) -> None:
        """Time each line of a way (n, dof) [rad] by one profile for all joints; limits (dof,) in rad and s.

        Raises:
            InvalidInputError: Ruckig finds no motion.
            MissingExtraError: Ruckig is not installed.
        """
        self._way, self._steps = way, np.diff(way, axis=0)
        with np.errstate(divide="ignore"):
            limits = [(USED * limit / np.abs(self._steps)).min(axis=1) for limit in (velocity, acceleration, jerk)]
        none, whole = np.zeros(1), np.ones(1)
        self._profiles = [profile(none, whole, *(each[k : k + 1] for each in limits)) for k in range(len(self._steps))]
        self._ends = np.cumsum([0.0, *(each.duration for each in self._profiles)])

    @property
    def duration(self) -> float:
        """From start to end [s]."""
        return float(self._ends[-1])

    def at(self, t: Array) -> tuple[Array, Array, Array]:
        """Configurations (m, dof) [rad], velocities [rad/s] and accelerations [rad/s^2] at times (m,) [s]."""
        lines = np.clip(np.searchsorted(self._ends, t, side="right") - 1, 0, len(self._steps) - 1)
        gone = t - self._ends[lines]
        shares = np.array(
            [np.ravel(self._profiles[line].at_time(float(at))) for line, at in zip(lines.tolist(), gone, strict=True)]
        )
        steps = self._steps[lines]
        return self._way[lines] + shares[:, :1] * steps, shares[:, 1:2] * steps, shares[:, 2:3] * steps


def _range(values: Array) -> str:
    low, high = float(values.min()), float(values.max())
    return f"{low:.3g}" if low == high else f"{low:.3g} to {high:.3g}"
