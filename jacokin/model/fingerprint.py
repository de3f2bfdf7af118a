"""A robot's numbers as one hash: two robots with the same hash give the same answers."""

from __future__ import annotations

import hashlib

import numpy as np

from jacokin.model.robot import Robot


def fingerprint(robot: Robot, *, shapes: bool = False) -> str:
    """SHA-256 of joints, limits, placements and frames, in hexadecimal digits.

    Args:
        robot: the arm.
        shapes: the collision shapes too.
    """
    model = robot.pin_model
    names = [robot.base, robot.default_frame, *robot.joint_names, *robot.frames]
    names += [joint.shortname() for joint in model.joints]
    arrays = [robot.lower, robot.upper, robot.home]
    arrays += [placement.homogeneous for placement in model.jointPlacements]
    for name in robot.frames:
        frame = model.frames[robot.frame_id(name)]
        arrays += [np.array([frame.parentJoint]), frame.placement.homogeneous]
    content = hashlib.sha256("\n".join(names).encode())
    for array in arrays:
        content.update(np.ascontiguousarray(array, dtype=np.float64).tobytes())
    if shapes:
        content.update(_shapes(robot))
    return content.hexdigest()


def _shapes(robot: Robot) -> bytes:
    described = robot.source.content
    if described is None:
        return f"bundled {robot.source.bundled}".encode()
    if isinstance(described, str):
        return described.encode()
    arrays = (described.geom_type, described.geom_size, described.geom_pos, described.geom_quat, described.geom_bodyid)
    return b"".join(np.ascontiguousarray(array).tobytes() for array in (*arrays, described.mesh_vert))
