"""The same arm in MuJoCo: what mink solves on, and what checks contact.

`to_mujoco` builds a model with the joints of a `Robot` and nothing else that moves, from the robot's own Pinocchio
numbers, so a URDF and an MJCF end in the same place. It is a kinematic twin: masses are placeholders.
"""

from __future__ import annotations

import mujoco
import numpy as np

from jacokin.model import checks, poses
from jacokin.model.mujoco_twin.shapes import add_shapes
from jacokin.model.robot import Robot, checked_robot

UNLIMITED = 1e6  # [rad] stands for an open side
LOCKED_ROOM = 1e-9  # [rad] on both sides of a joint with equal limits

BASE_BODY = "jacokin_base"


def to_mujoco(robot: Robot, *, geometry: bool = False) -> mujoco.MjModel:
    """Compile the kinematic twin of a robot.

    Args:
        robot: the arm.
        geometry: True to carry the collision shapes of the description, fingers locked at `robot.finger_angle`.

    Returns:
        A model with nq == nv == robot.dof, joints in the robot's order and named as there, one body a link, and a
        site for every name in `robot.frames`. The world of the model is the robot's base.

    Raises:
        InvalidInputError: `robot` is not a Robot, `geometry` neither True nor False.
        ModelError: `geometry` and the description's shapes cannot be loaded by MuJoCo.
    """
    return to_spec(checked_robot("robot", robot), geometry=checks.flag("geometry", geometry)).compile()


def to_spec(robot: Robot, *, geometry: bool = False, finger_angle: float | None = None) -> mujoco.MjSpec:
    """As `to_mujoco`, before compiling: scene geometry can still be added.

    With `finger_angle` [rad] the shapes of the fingers stand at that angle instead of the robot's own.
    """
    model = robot.pin_model
    spec = mujoco.MjSpec()
    spec.modelname = robot.name
    spec.compiler.degree = False
    spec.compiler.autolimits = False
    carriers = [spec.worldbody.add_body(name=BASE_BODY)]
    for index in range(1, model.njoints):
        placement = model.jointPlacements[index]
        body = carriers[model.parents[index]].add_body(
            name=body_of_joint(robot, index),
            pos=placement.translation,
            quat=poses.quaternion(placement.rotation),
        )
        # Kinematics needs no mass; MuJoCo refuses moving bodies without one.
        body.mass, body.inertia, body.explicitinertial = 1.0, np.ones(3), True
        _add_joint(body, robot, index)
        carriers.append(body)
    for name in robot.frames:
        frame = model.frames[robot.frame_id(name)]
        carriers[frame.parentJoint].add_site(
            name=name, pos=frame.placement.translation, quat=poses.quaternion(frame.placement.rotation)
        )
    if geometry:
        add_shapes(spec, carriers, robot, finger_angle)
    return spec


def body_of_joint(robot: Robot, joint: int) -> str:
    """Name of the twin's body that Pinocchio's joint (by number, 0 for the base) moves."""
    return f"jacokin_body_{joint}" if joint else BASE_BODY


def _add_joint(body: mujoco.MjsBody, robot: Robot, index: int) -> None:
    """The joint that moves a body, about (or along) the axis Pinocchio has."""
    joint = robot.pin_model.joints[index]
    data = joint.createData()
    joint.calc(data, np.zeros(robot.dof))
    subspace = np.asarray(data.S).ravel()
    hinge = bool(subspace[3:].any())
    limited = bool(np.isfinite(robot.lower[index - 1]) or np.isfinite(robot.upper[index - 1]))
    # MuJoCo wants a finite range; one side may be open.
    low, high = np.clip((robot.lower[index - 1], robot.upper[index - 1]), -UNLIMITED, UNLIMITED)
    if not low < high:  # a locked joint: MuJoCo wants some room, answers are clamped to the robot's own limits
        low, high = low - LOCKED_ROOM, high + LOCKED_ROOM
    body.add_joint(
        name=robot.joint_names[index - 1],
        type=mujoco.mjtJoint.mjJNT_HINGE if hinge else mujoco.mjtJoint.mjJNT_SLIDE,
        axis=subspace[3:] if hinge else subspace[:3],
        limited=mujoco.mjtLimited.mjLIMITED_TRUE if limited else mujoco.mjtLimited.mjLIMITED_FALSE,
        range=(low, high) if limited else (0.0, 0.0),
    )
