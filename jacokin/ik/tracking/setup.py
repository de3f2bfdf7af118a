"""What the tracker is built from, checked once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from jacokin.errors import InvalidInputError, UnknownNameError
from jacokin.ik.tracking import obstacles
from jacokin.ik.tracking.acceleration import Follower
from jacokin.ik.tracking.aims import TOOL_SITE, Aims
from jacokin.ik.tracking.checks import limits, listed, positive, velocity_limits
from jacokin.ik.tracking.clearance import ClearanceGuard
from jacokin.ik.tracking.joint_bounds import JointBox
from jacokin.ik.tracking.objectives import Objective, Posture
from jacokin.ik.tracking.obstacles import Clearance
from jacokin.model import checks, poses
from jacokin.model.mujoco_twin.export import body_of_joint, to_spec
from jacokin.model.robot import Robot

Array = NDArray[np.float64]

LIMIT_NOISE = 0.01  # [rad] an encoder may report a joint this far past its limit
TWIST_REFERENCES = ("local_world_aligned", "local", "world")


@dataclass(frozen=True, slots=True)
class Parts:
    """The checked parts of a tracker."""

    frame: str
    dt: float
    velocity: Array
    model: mujoco.MjModel
    box: JointBox
    follower: Follower | None
    guard: ClearanceGuard | None
    aims: Aims
    objectives: tuple[Objective, ...]


def prepare(
    robot: Robot,
    frame: str | None,
    dt: float,
    tool: pin.SE3 | ArrayLike | None,
    velocity_limit: ArrayLike | None,
    acceleration_limit: ArrayLike | None,
    collision: Clearance | None,
    posture: ArrayLike | None,
    objectives: Sequence[Objective],
) -> Parts:
    """Check the arguments of `Tracker` and build its parts; errors as there."""
    if not isinstance(robot, Robot):
        raise InvalidInputError(f"robot must be a jacokin.Robot (see load_robot), got {type(robot).__name__}")
    name = robot.default_frame if frame is None else frame
    moving_frame(robot, name)
    step = positive("dt", dt, "s")
    velocity = velocity_limits(robot, velocity_limit)
    acceleration = None if acceleration_limit is None else limits("acceleration_limit", acceleration_limit, robot.dof)
    wishes = listed("objectives", objectives)
    if posture is not None:
        wishes = (Posture(posture), *wishes)
    for wish in wishes:
        if isinstance(wish, Posture):
            robot.configuration(wish.q, "posture")
        elif not callable(getattr(wish, "velocity", None)):
            raise InvalidInputError(f"objectives must have a velocity() method, got {type(wish).__name__}")
    model, pairs = _model(robot, name, tool, collision)
    guard = ClearanceGuard(model, pairs, collision.distance, velocity, step) if collision is not None else None
    box = JointBox(robot.joint_names, robot.lower, robot.upper, velocity, step)
    follower = None if acceleration is None else Follower(robot.joint_names, box, acceleration, step)
    return Parts(name, step, velocity, model, box, follower, guard, Aims(robot, model), wishes)


def _model(
    robot: Robot, frame: str, tool: pin.SE3 | ArrayLike | None, collision: Clearance | None
) -> tuple[mujoco.MjModel, list[tuple[int, int]]]:
    """The twin with a site at the tool; with shapes and obstacles where something is kept apart."""
    if collision is not None and not isinstance(collision, Clearance):
        raise InvalidInputError(
            f"collision must be a jacokin.ik.tracking.obstacles.Clearance or None, got {collision!r}"
        )
    placed = robot.pin_model.frames[robot.frame_id(frame)]
    T_joint_tool = placed.placement if tool is None else placed.placement * poses.checked_pose(tool, "tool")
    spec = to_spec(robot, geometry=collision is not None)
    spec.body(body_of_joint(robot, placed.parentJoint)).add_site(
        name=TOOL_SITE, pos=T_joint_tool.translation, quat=poses.quat_wxyz(T_joint_tool.rotation)
    )
    if collision is None:
        return spec.compile(), []
    return obstacles.compile_with(spec, robot, collision)


def moving_frame(robot: Robot, frame: str) -> None:
    """Refuse frames that do not exist or do not move.

    Raises:
        UnknownNameError: no such frame.
        InvalidInputError: the frame is fixed to the base.
    """
    if robot.pin_model.frames[robot.frame_id(frame)].parentJoint == 0:
        moving = [name for name in robot.frames if robot.pin_model.frames[robot.frame_id(name)].parentJoint > 0]
        raise InvalidInputError(f"frame {frame!r} is fixed to the base and cannot follow a target; {moving} move")


def tolerances(position: float, orientation: float) -> tuple[float, float]:
    """Checked tolerances [m], [rad]."""
    return positive("position_tolerance", position, "m"), positive("orientation_tolerance", orientation, "rad")


def start(robot: Robot, q: ArrayLike | None) -> Array:
    """A legal configuration (dof,) [rad], read-only; noise past a limit is removed.

    Raises:
        InvalidInputError: malformed or outside the limits.
    """
    if q is None:
        return robot.home
    angles = robot.configuration(q)
    legal = np.clip(angles, robot.lower, robot.upper)
    joint = int(np.argmax(np.abs(angles - legal)))
    if abs(angles[joint] - legal[joint]) > LIMIT_NOISE:
        raise InvalidInputError(
            f"q puts {robot.joint_names[joint]} at {angles[joint]:.6g} rad, outside "
            f"[{robot.lower[joint]:.6g}, {robot.upper[joint]:.6g}]"
        )
    return checks.read_only(legal)


def moved(pose: pin.SE3, twist: ArrayLike, reference: str, dt: float) -> pin.SE3:
    """A pose after moving along a twist (6,) for `dt` [s].

    Raises:
        InvalidInputError: the twist is malformed.
        UnknownNameError: the reference is unknown.
    """
    if reference not in TWIST_REFERENCES:
        raise UnknownNameError("reference", reference, TWIST_REFERENCES)
    motion = checks.vector("twist", twist, 6, "m/s, rad/s") * dt
    if reference == "local":
        return pose * pin.exp6(motion)
    if reference == "world":
        return pin.exp6(motion) * pose
    return pin.SE3(pin.exp3(motion[3:]) @ pose.rotation, pose.translation + motion[:3])
