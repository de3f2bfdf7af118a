"""The chain of an arm's joints up to a site, taken from a compiled scene.

The base may have any pose. Joints on the way to the site that are not the arm's, such as fingers, are held at their
present positions. Free objects and other robots do not matter.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.errors import ModelError
from jacokin.model.descriptions import mjcf
from jacokin.model.robot import Robot
from jacokin.model.source import Home, Source

BASE = "base"
SITE = "site"

Memory = tuple[memoryview, ...]
"""Live parts of MuJoCo's arrays. Joining their bytes is the quickest way to compare all of them with what they were."""

_INFINITE = np.array([np.inf])


@dataclass(frozen=True, slots=True, eq=False)
class SceneChain:
    """The joints that move a site.

    Attributes:
        robot: the chain; its only frame is the site, its base the parent of the first joint's body.
        base_body: id of that body.
        base_is_fixed: whether the simulation never moves that body.
        base_memory: the parts of the model that determine the pose of a fixed base.
        joints: (dof,) ids of the joints, base to site.
        qpos: (dof,) addresses of the joints' positions in qpos.
        memory: the parts of the model that determine the chain, and the positions of joints that are held.
        memory_then: their bytes when the chain was made.
    """

    robot: Robot
    base_body: int
    base_is_fixed: bool
    base_memory: Memory
    joints: tuple[int, ...]
    qpos: NDArray[np.intp]
    memory: Memory
    memory_then: bytes

    @property
    def is_current(self) -> bool:
        """Whether the model and the held joints are as they were when the chain was made."""
        return b"".join(self.memory) == self.memory_then


def scene_chain(model: mujoco.MjModel, qpos: Array, joints: Sequence[int], site: int) -> SceneChain:
    """Build the chain.

    Args:
        model: the compiled scene.
        qpos: its live configuration; joints that are not the arm's are held there.
        joints: ids of the arm's joints.
        site: id of the site.

    Raises:
        ModelError: none of the joints moves the site, or a joint on the way is neither hinge nor slide.
    """
    bodies = _path(model, int(model.site_bodyid[site]))
    moved = [i for i, body in enumerate(bodies) if set(mjcf.body_joints(model, body)) & set(joints)]
    if not moved:
        raise ModelError(f"none of the arm's joints moves site {model.site(site).name!r}")
    above, bodies = bodies[: moved[0]], bodies[moved[0] :]
    members: list[int] = []
    addresses: list[int] = []
    held: list[int] = []
    out = pin.Model()
    out.name = "scene"
    carrier, T = 0, pin.SE3.Identity()
    for body in bodies:
        T = T * mjcf.placement(model.body_quat[body], model.body_pos[body])
        for joint in mjcf.body_joints(model, body):
            if model.jnt_type[joint] not in mjcf.SCALAR_JOINTS:
                raise ModelError(f"joint {mjcf.joint_name(model, joint)!r} of the arm is neither hinge nor slide")
            kind, T_zero = mjcf.pinocchio_joint(model, joint)
            anchor = pin.SE3(np.eye(3), np.array(model.jnt_pos[joint]))
            address = int(model.jnt_qposadr[joint])
            if joint in joints:
                limits = model.jnt_range[joint] if model.jnt_limited[joint] else (-np.inf, np.inf)
                lower, upper = np.array(limits[:1]), np.array(limits[1:])
                name = mjcf.joint_name(model, joint)
                carrier = out.addJoint(carrier, kind, T * anchor * T_zero, name, _INFINITE, _INFINITE, lower, upper)
                T = anchor.inverse()
                members.append(joint)
                addresses.append(address)
            else:
                T = T * anchor * mjcf.scalar_joint_motion(model, joint, float(qpos[address])) * anchor.inverse()
                held.append(address)
    T = T * mjcf.placement(model.site_quat[site], model.site_pos[site])
    out.addFrame(pin.Frame(BASE, 0, 0, pin.SE3.Identity(), pin.FrameType.OP_FRAME), False)
    out.addFrame(pin.Frame(SITE, carrier, 0, T, pin.FrameType.OP_FRAME), False)
    memory = (*_memory(model, bodies, site), *_rows(qpos, held))
    source = Source(path=Path("scene"), kind="mjcf", bundled=None, base=BASE, tip=SITE)
    return SceneChain(
        robot=Robot(
            out, base=BASE, tip=SITE, source=source, home=Home(qpos[addresses], "where the arm was in the scene")
        ),
        base_body=int(model.body_parentid[bodies[0]]),
        base_is_fixed=not any(model.body_dofnum[body] or model.body_mocapid[body] >= 0 for body in above),
        base_memory=_poses(model, above),
        joints=tuple(members),
        qpos=np.array(addresses, dtype=np.intp),
        memory=memory,
        memory_then=b"".join(memory),
    )


def _memory(model: mujoco.MjModel, bodies: Sequence[int], site: int) -> Memory:
    """The parts of the model that determine a chain along these bodies."""
    joints = [joint for body in bodies for joint in mjcf.body_joints(model, body)]
    arrays = model.jnt_range, model.jnt_limited, model.jnt_pos, model.jnt_axis
    return (
        *_poses(model, bodies),
        *(part for array in arrays for part in _rows(array, joints)),
        *(part for array in (model.site_pos, model.site_quat) for part in _rows(array, [site])),
    )


def _poses(model: mujoco.MjModel, bodies: Sequence[int]) -> Memory:
    """The parts of the model with the poses of bodies in their parents."""
    return tuple(part for array in (model.body_pos, model.body_quat) for part in _rows(array, bodies))


def _rows(array: NDArray[Any], rows: Sequence[int]) -> Memory:
    """The memory of some rows of an array; consecutive ones are one part."""
    starts = [row for i, row in enumerate(rows) if i == 0 or row != rows[i - 1] + 1]
    stops = [row + 1 for i, row in enumerate(rows) if i == len(rows) - 1 or rows[i + 1] != row + 1]
    return tuple(array[start:stop].data for start, stop in zip(starts, stops, strict=True))


def _path(model: mujoco.MjModel, body: int) -> list[int]:
    """Ids of the bodies from the world's child down to a body."""
    path: list[int] = []
    while body > 0:
        path.insert(0, body)
        body = int(model.body_parentid[body])
    return path
