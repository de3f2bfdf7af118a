"""From one joint configuration to another in the least time, within velocity, acceleration and jerk limits.

All joints start and stop together, at rest on both ends, and no joint leaves the interval between its two ends. The
jerk is constant from row to row, so controllers that interpolate by cubics or quintics follow the very same motion
(`kernels/rest_to_rest`).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from jacokin.arrays import Array
from jacokin.errors import InvalidInputError
from jacokin.ik.seeds import checked_start
from jacokin.kernels.library import Calls
from jacokin.kernels.rest_to_rest import fit_rest_to_rest, make_rest_work
from jacokin.model import angles, checks
from jacokin.model.robot import Robot, acceleration_limits, checked_robot, jerk_limits, velocity_limits
from jacokin.motion.rows import Limits, Rows, resting
from jacokin.motion.timing import BETWEEN, MAX_TICKS, MOST_PLACES, TooHeavy, hold_torques, slowness, torque_limits
from jacokin.motion.trajectory import MotionStatus, Trajectory

ACCELERATION = 1.0  # [rad/s^2] full speed in about 0.7 s; the maker publishes no figure, so this is a gentle guess

_fit = Calls(fit_rest_to_rest, make_rest_work, kept=20_000)  # rows


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
        The motion in whole steps, at most two more than the least time takes: its accelerations change steadily from
        row to row, so that limits hold as controllers go from one to the next. One row where the arm is already there.
        Shapes are not looked at: check it for collisions. Where gravity alone asks for more torque than the limits it
        stays at the start, and `outcome` and `message` say so.

    Raises:
        InvalidInputError: `q_to` outside the limits, or a number that is malformed or not positive.
    """
    checked_robot("robot", robot)
    step = checks.positive("dt", dt, "s")
    start, end = checked_start(robot, q_from, "q_from", outside=True), checked_start(robot, q_to, "q_to")
    end = angles.nearest_copy(end, start, robot.unlimited)
    velocity = velocity_limits(robot, velocity_limit)
    acceleration = acceleration_limits(robot, acceleration_limit)
    jerk = jerk_limits(robot, jerk_limit)
    torque = torque_limits(robot, torque_limit)
    limits = Limits(velocity, acceleration, jerk)
    rows = rest_to_rest(start, end, limits, step)
    if torque is not None:
        held = _hold_torques(robot, rows, limits, torque)
        if isinstance(held, TooHeavy):
            why = held.explain(robot)
            return Trajectory.of(robot, velocity, resting(start), status=MotionStatus.TOO_HEAVY, message=why)
        rows = held
    message = f"reached in {rows.t[-1]:.4g} s" if len(rows.t) > 1 else "already there"
    return Trajectory.of(robot, velocity, rows, message=message)


def rest_to_rest(start: Array, end: Array, limits: Limits, dt: float, *, straight: bool = False) -> Rows:
    """The least time from rest to rest in whole steps of `dt` [s], all joints in step: one row if nothing moves.

    The motion is a straight line where that takes no longer, or is asked for.

    Raises:
        InvalidInputError: it takes more than `MAX_TICKS` steps.
    """
    dof, count = len(start), 500  # rows
    while True:
        call = _fit.with_room(dof, count)
        work = call.work
        work.counts[:], work.dt[0], work.start[:dof], work.end[:dof] = (dof, straight), dt, start, end
        each = work.limits[: 3 * dof].reshape(dof, 3).T
        each[0], each[1], each[2] = limits.velocity, limits.acceleration, np.inf if limits.jerk is None else limits.jerk
        ticks = call()
        if ticks > MAX_TICKS:
            raise InvalidInputError(
                f"the motion takes {ticks * dt:.6g} s or longer: more than {MAX_TICKS} steps of {dt:.6g} s"
            )
        count = ticks + 1
        if count * dof <= len(work.q):
            break
    q, v, a = (array[: count * dof].reshape(count, dof).copy() for array in (work.q, work.v, work.a))
    return Rows(dt * np.arange(count, dtype=np.float64), q, v, a)


def _hold_torques(robot: Robot, rows: Rows, limits: Limits, torque: Array) -> Rows | TooHeavy:
    """A motion slowed down until no joint needs more torque than its limit (dof,) [N m].

    Torques are also checked between rows that are far apart.
    """
    start, end, duration, fine = rows.q[0], rows.q[-1], float(rows.t[-1]), rows
    dt = duration / max(len(rows.t) - 1, 1)
    if dt > BETWEEN:
        fine = rest_to_rest(start, end, limits, max(BETWEEN, duration / MOST_PLACES))
    slower = slowness(robot, fine[1:], torque)
    if isinstance(slower, TooHeavy):
        return slower

    def write(slower: float) -> Rows:
        return rest_to_rest(start, end, limits.slowed(slower), dt)

    return hold_torques(robot, write, torque, slower)
