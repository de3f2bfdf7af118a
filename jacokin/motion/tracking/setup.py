"""The arguments of the tracker, checked once, and the parts that are built from them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from jacokin.arrays import Array
from jacokin.errors import InvalidInputError
from jacokin.ik import seeds
from jacokin.model import checks, poses
from jacokin.model.robot import Robot, checked_robot
from jacokin.motion.tracking.avoidance import Clearance, ClearanceGuard, compile_with
from jacokin.motion.tracking.joint_limits import Follower, JointBox, velocity_limits
from jacokin.motion.tracking.problem import Objective, Posture
from jacokin.motion.tracking.tasks import Kinematics

LIMIT_NOISE = 0.01  # [rad] an encoder may report a joint this far past its limit

TWIST_REFERENCES = ("local_world_aligned", "local", "world")


@dataclass(frozen=True, slots=True, kw_only=True)
class Options:
    """The arguments of `Tracker` as the user gave them; documented there."""

    frame: str | None
    dt: float
    tool: pin.SE3 | ArrayLike | None
    velocity_limit: ArrayLike | None
    acceleration_limit: ArrayLike | None
    collision: Clearance | None
    posture: ArrayLike | None
    objectives: Sequence[Objective]
    position_tolerance: float
    orientation_tolerance: float


@dataclass(frozen=True, slots=True)
class Parts:
    """The checked parts of a tracker."""

    frame: str
    dt: float
    velocity: Array
    kinematics: Kinematics
    box: JointBox
    follower: Follower | None
    guard: ClearanceGuard | None
    objectives: tuple[Objective, ...]
    position_tolerance: float
    orientation_tolerance: float


def prepare(robot: Robot, options: Options) -> Parts:
    """Check the options and build the parts; errors as in `Tracker`."""
    checked_robot("robot", robot)
    frame = robot.default_frame if options.frame is None else options.frame
    check_moving_frame(robot, frame)
    dt = checks.positive("dt", options.dt, "s")
    velocity = velocity_limits(robot, options.velocity_limit)
    box = JointBox(robot.joint_names, robot.lower, robot.upper, velocity, dt)
    follower = None
    if options.acceleration_limit is not None:
        acceleration = checks.positive_vector("acceleration_limit", options.acceleration_limit, robot.dof, "rad/s^2")
        follower = Follower(robot.joint_names, box, acceleration, dt)
    placed = robot.pin_model.frames[robot.frame_id(frame)]
    T_joint_tool = pin.SE3(placed.placement)
    if options.tool is not None:
        T_joint_tool = T_joint_tool * poses.checked_pose(options.tool, "tool")
    return Parts(
        frame=frame,
        dt=dt,
        velocity=velocity,
        kinematics=Kinematics(robot, placed.parentJoint, T_joint_tool),
        box=box,
        follower=follower,
        guard=_guard(robot, options.collision, velocity, dt),
        objectives=_objectives(robot, options),
        position_tolerance=checks.positive("position_tolerance", options.position_tolerance, "m"),
        orientation_tolerance=checks.positive("orientation_tolerance", options.orientation_tolerance, "rad"),
    )


def _objectives(robot: Robot, options: Options) -> tuple[Objective, ...]:
    objectives = checks.listed("objectives", options.objectives)
    if options.posture is not None:
        objectives = (Posture(options.posture), *objectives)
    for objective in objectives:
        if isinstance(objective, Posture):
            robot.configuration(objective.q, "posture")
        elif not callable(getattr(objective, "velocity", None)):
            raise InvalidInputError(f"objectives must have a velocity() method, got {type(objective).__name__}")
    return objectives


def _guard(robot: Robot, collision: Clearance | None, velocity: Array, dt: float) -> ClearanceGuard | None:
    if collision is None:
        return None
    if not isinstance(collision, Clearance):
        raise InvalidInputError(f"collision must be a jacokin.ik.Clearance or None, got {checks.shown(collision)}")
    model, pairs = compile_with(robot, collision)
    return ClearanceGuard(model, pairs, collision.distance, velocity, dt)


def check_moving_frame(robot: Robot, frame: str) -> None:
    """Refuse frames that do not exist or do not move.

    Raises:
        UnknownNameError: no such frame.
        InvalidInputError: the frame is fixed to the base.
    """
    if robot.pin_model.frames[robot.frame_id(frame)].parentJoint == 0:
        moving = [name for name in robot.frames if robot.pin_model.frames[robot.frame_id(name)].parentJoint > 0]
        raise InvalidInputError(f"frame {frame!r} is fixed to the base and cannot follow a target; {moving} move")


def checked_start(robot: Robot, q: ArrayLike | None, name: str = "q") -> Array:
    """A configuration (dof,) [rad] within the limits, read-only; noise past a limit is removed. None is home.

    Raises:
        InvalidInputError: malformed, outside the limits, or more than 1e6 rad from zero.
    """
    if q is None:
        return robot.home
    angles = seeds.near_configuration(robot, q, name)
    inside = np.clip(angles, robot.lower, robot.upper)
    joint = int(np.argmax(np.abs(angles - inside)))
    if abs(angles[joint] - inside[joint]) > LIMIT_NOISE:
        raise InvalidInputError(
            f"{name} puts {robot.joint_names[joint]} at {angles[joint]:.6g} rad, outside "
            f"[{robot.lower[joint]:.6g}, {robot.upper[joint]:.6g}]"
        )
    return checks.read_only(inside)


def moved_by_twist(pose: pin.SE3, twist: ArrayLike, reference: str, dt: float) -> pin.SE3:
    """A pose after moving along a twist (6,) for `dt` [s].

    Raises:
        InvalidInputError: the twist is malformed.
        UnknownNameError: the reference is unknown.
    """
    checks.choice("reference", reference, TWIST_REFERENCES)
    motion = checks.vector("twist", twist, 6, "m/s, rad/s") * dt
    if reference == "local":
        return pose * pin.exp6(motion)
    if reference == "world":
        return pin.exp6(motion) * pose
    return pin.SE3(pin.exp3(motion[3:]) @ pose.rotation, pose.translation + motion[:3])
