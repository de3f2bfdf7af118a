"""Velocity commands that move an arm to joint positions, or a site with a twist."""

from __future__ import annotations

import mujoco
import numpy as np
from numpy.typing import ArrayLike

from jacokin.arrays import Array
from jacokin.errors import InvalidInputError, shown
from jacokin.model import checks
from jacokin.model.angles import nearest_copy
from jacokin.mujoco_bridge.base import RobotArm
from jacokin.mujoco_bridge.jaco_arm import JacoArm
from jacokin.mujoco_bridge.simulation.physics import Physics, check_physics

GAIN = 5.0  # [1/s] velocity per position error; removes 20 % of the error in a control step of 0.04 s
MAX_TWIST = 1e6  # [m/s, rad/s] squares of far larger numbers overflow


def command_joint_positions(physics: Physics, arm: JacoArm, positions: ArrayLike, *, gain: float = GAIN) -> Array:
    """Command velocities towards joint positions; call it once per control step.

    Hinges without limits turn the shorter way. Gravity is compensated.

    Args:
        physics: the simulation.
        arm: an arm with one velocity actuator per joint.
        positions: (n,) joint positions to move to [rad].
        gain: commanded velocity per position error [1/s].

    Returns:
        (n,) the remaining position errors [rad].

    Raises:
        InvalidInputError: wrong positions, or a gain that is not positive.
    """
    joints = check_physics(physics).bind(_checked_arm(arm).joints)
    goal = checks.vector("positions", positions, len(arm.joints), "rad")
    checked_gain = checks.positive("gain", gain, "1/s")
    error = nearest_copy(goal, joints.qpos, joints.limited == 0) - joints.qpos
    _command(physics, arm, checked_gain * error)
    return np.asarray(error)


def command_site_velocity(physics: Physics, arm: JacoArm, site: mujoco.MjsSite | str, twist: ArrayLike) -> Array:
    """Command joint velocities that move a site with a twist; call it once per control step.

    Velocities beyond the actuators' range are scaled down together, which keeps their direction. Near singularities
    damping bounds the joint velocities, and the twist is followed only approximately.

    Args:
        physics: the simulation.
        arm: an arm with one velocity actuator per joint.
        site: a site on the arm or its hand: an element, or its full name.
        twist: (6,) velocity [m/s] and angular velocity [rad/s] of the site, in world axes.

    Returns:
        (n,) the joint velocities commanded [rad/s].

    Raises:
        InvalidInputError: a wrong twist, or one faster than `MAX_TWIST`, or not a site.
        UnknownNameError: no site has this name; lists the valid ones.
        ModelError: none of the arm's joints moves the site.
    """
    commanded = checks.vector("twist", twist, 6, "m/s, rad/s")
    if np.abs(commanded).max() > MAX_TWIST:
        raise InvalidInputError(f"twist must not be faster than {MAX_TWIST:g} m/s and rad/s, got {commanded.tolist()}")
    chain = _checked_arm(arm).site_solver(check_physics(physics), site).chain()
    jacobian = chain.robot.jacobian(physics.data.qpos[chain.qpos])
    physics.update()
    R_base_world = physics.data.xmat[chain.base_body].reshape(3, 3).T
    twist_base = np.concatenate([R_base_world @ commanded[:3], R_base_world @ commanded[3:]])
    members = list(chain.joints)
    # Damped least squares: (J^T J + d^2 I)^-1 J^T v.
    # Damped by 0.005 of the Jacobian's singular values [m/rad, rad/rad], which bounds joint speeds at singular poses.
    normal = jacobian.T @ jacobian + 0.005**2 * np.eye(len(members))
    velocities = np.zeros(len(arm.joints))
    ids = list(physics.bind(arm.joints).element_ids)
    velocities[[ids.index(joint) for joint in members]] = np.linalg.solve(normal, jacobian.T @ twist_base)
    limit = physics.bind(arm.actuators).ctrlrange[:, 1]
    velocities /= max(1.0, float(np.max(np.abs(velocities) / limit)))
    _command(physics, arm, velocities)
    return velocities


def _checked_arm(arm: JacoArm) -> JacoArm:
    if not isinstance(arm, RobotArm) or not hasattr(arm, "actuators"):
        raise InvalidInputError(f"arm must be an arm with actuators such as a JacoArm, got {shown(arm)}")
    if getattr(arm, "actuation", "velocity") != "velocity":
        raise InvalidInputError(f"arm must take velocities, this one takes a {arm.actuation}; write its ctrl instead")
    return arm


def _command(physics: Physics, arm: JacoArm, velocities: Array) -> None:
    """Write velocities [rad/s] to ctrl, with the feedforward that compensates gravity."""
    actuators = physics.bind(arm.actuators)
    gain = actuators.gainprm[:, 0]  # [N m s/rad]
    bias = physics.bind(arm.joints).qfrc_bias - physics.bind(arm.joints).qfrc_passive  # [N m]
    lower, upper = actuators.ctrlrange.T
    actuators.ctrl = np.clip(velocities + bias / gain, lower, upper)
