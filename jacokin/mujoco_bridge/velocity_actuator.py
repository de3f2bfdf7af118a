"""Velocity actuators, which the descriptions in ``urdf`` do not contain."""

from __future__ import annotations

import mujoco

from jacokin.model.descriptions import bundled


def add_velocity_actuator(spec: mujoco.MjSpec, joint: mujoco.MjsJoint, group: str) -> mujoco.MjsActuator:
    """Add a velocity actuator to a joint, under the name of the joint.

    Args:
        spec: the spec of the joint.
        joint: the joint element.
        group: "large", "small" or "finger": the row with gain, speed and torque in ``urdf/jaco.toml``.
    """
    row = bundled.actuator(group)
    actuator = spec.add_actuator(name=joint.name, target=joint.name, trntype=mujoco.mjtTrn.mjTRN_JOINT)
    actuator.set_to_velocity(kv=row["kv"])
    actuator.ctrllimited = actuator.forcelimited = True
    actuator.ctrlrange = row["ctrl_range"]  # [rad/s]
    actuator.forcerange = row["force_range"]  # [N m]
    return actuator
