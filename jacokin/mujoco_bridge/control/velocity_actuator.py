"""The velocity actuators that the descriptions leave to the bridge."""

from __future__ import annotations

from typing import Any

import mujoco

from jacokin.model import table


def add_velocity_actuator(spec: mujoco.MjSpec, joint: Any, group: str) -> Any:
    """Add a velocity actuator of the joint's name to a joint.

    Args:
        spec: the spec of the joint.
        joint: the joint element.
        group: "large", "small" or "finger": the row of the table of numbers with gain, speed and torque.
    """
    row = table.actuator(group)
    actuator = spec.add_actuator(name=joint.name, target=joint.name, trntype=mujoco.mjtTrn.mjTRN_JOINT)
    actuator.set_to_velocity(kv=row["kv"])
    actuator.ctrllimited = actuator.forcelimited = True
    actuator.ctrlrange = row["ctrl_range"]  # [rad/s]
    actuator.forcerange = row["force_range"]  # [N m]
    return actuator
